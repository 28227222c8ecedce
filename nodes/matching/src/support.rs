//! What neighbours say: uniqueness in the other views, support in the reference view.

use messages::NONE;

use crate::along::Choice;
use crate::rows::Rows;

/// How neighbours are asked.
#[derive(Clone, Debug)]
pub(crate) struct Neighbourhood {
    /// Pixels around the point.
    pub(crate) radius: f32,
    /// How many of the nearest are asked.
    pub(crate) nearest: u32,
    /// Share that has to agree.
    pub(crate) share: f32,
    /// Pixels of disparity within which they agree, at no distance.
    pub(crate) within: f32,
    /// Pixels of disparity more for each pixel of distance.
    pub(crate) slope: f32,
    /// Neighbours there must be.
    pub(crate) least: u32,
}

/// Uniqueness and support, with their memory.
#[derive(Debug, Default)]
pub(crate) struct Support {
    claims: Vec<(f32, u32)>,
    /// Trusted points, row by row, left to right.
    trusted: Vec<(f32, f32, u32)>,
    starts: Vec<u32>,
}

impl Support {
    /// Of several points that land on one spot of another view, keeps the best.
    pub(crate) fn keep_unique(&mut self, spots: usize, which: usize, choices: &mut [Choice], worth: impl Fn(&Choice) -> f32) {
        self.claims.clear();
        self.claims.resize(spots, (f32::INFINITY, NONE));
        for (point, choice) in (0..).zip(choices.iter()) {
            if choice.is_seen() {
                let claim = &mut self.claims[choice.spots[which] as usize];
                let worth = worth(choice);
                if worth < claim.0 {
                    *claim = (worth, point);
                }
            }
        }
        for point in 0..choices.len() {
            let choice = &choices[point];
            if !choice.is_seen() {
                continue;
            }
            let winner = self.claims[choice.spots[which] as usize].1 as usize;
            // A branch repeats points of the curve it leaves: the same disparity is no contradiction.
            if winner != point && (choices[winner].disparity - choice.disparity).abs() > 0.5 {
                choices[point] = Choice::NOTHING;
            }
        }
    }

    /// Asks the nearest points that have a disparity; forgets a choice that too few share.
    pub(crate) fn keep_supported(&mut self, reference: &Rows, around: &Neighbourhood, choices: &mut [Choice]) {
        self.trusted.clear();
        self.starts.clear();
        self.starts.push(0);
        for row in 0..reference.count() {
            for spot in &reference.spots[reference.row(row)] {
                let choice = &choices[spot.point as usize];
                if choice.is_some() {
                    self.trusted.push((spot.x, choice.disparity, spot.point));
                }
            }
            self.starts.push(self.trusted.len() as u32);
        }
        let reach = around.radius as usize;
        for row in 0..reference.count() {
            let rows = row.saturating_sub(reach)..(row + reach + 1).min(reference.count());
            for at in self.starts[row]..self.starts[row + 1] {
                let (x, disparity, point) = self.trusted[at as usize];
                let mut rings = [(0u32, 0u32); 33];
                for near_row in rows.clone() {
                    let dy = near_row as f32 - row as f32;
                    let half = (around.radius * around.radius - dy * dy).max(0.0).sqrt();
                    let line = &self.trusted[self.starts[near_row] as usize..self.starts[near_row + 1] as usize];
                    let from = line.partition_point(|t| t.0 < x - half);
                    for &(near_x, near_disparity, _) in line[from..].iter().take_while(|t| t.0 <= x + half) {
                        let distance = (dy * dy + (near_x - x) * (near_x - x)).sqrt();
                        let ring = &mut rings[(distance as usize).min(32)];
                        ring.0 += 1;
                        let allowed = around.within + around.slope * distance;
                        ring.1 += u32::from((near_disparity - disparity).abs() <= allowed);
                    }
                }
                // The point itself is in the first ring.
                rings[0].0 -= 1;
                rings[0].1 -= 1;
                let (mut all, mut agree) = (0, 0);
                for ring in rings {
                    all += ring.0;
                    agree += ring.1;
                    if all >= around.nearest {
                        break;
                    }
                }
                choices[point as usize].support = if all == 0 { 0.0 } else { agree as f32 / all as f32 };
                if all < around.least {
                    choices[point as usize].support = 0.0;
                }
            }
        }
        for choice in choices.iter_mut().filter(|choice| choice.is_some()) {
            if choice.support < around.share {
                *choice = Choice::NOTHING;
            }
        }
    }
}
