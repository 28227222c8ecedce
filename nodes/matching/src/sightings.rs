//! Where a point may lie in more than two other views: found next to the reference view, then followed outwards.
//!
//! Disparity is linear in position, so every further sighting adds base, which makes the line through all of them more
//! precise, and a vote, which makes it more certain: what two views propose by chance the others do not confirm. A point
//! is often hidden in some views, mostly in those of one side, so it need not be seen in all.

use messages::Reason;

use crate::Range;
use crate::candidates::{Candidate, Likeness};
use crate::rows::{Rows, Spot, around, turn};
use crate::triple::Steps;

/// The line through sightings by least squares: columns beside the reference view's, over baselines to its right.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    n: f32,
    t: f32,
    tt: f32,
    x: f32,
    tx: f32,
}

impl Line {
    fn with(self, t: f32, x: f32) -> Self {
        Self {
            n: self.n + 1.0,
            t: self.t + t,
            tt: self.tt + t * t,
            x: self.x + x,
            tx: self.tx + t * x,
        }
    }

    fn without(self, t: f32, x: f32) -> Self {
        Self {
            n: self.n - 1.0,
            t: self.t - t,
            tt: self.tt - t * t,
            x: self.x - x,
            tx: self.tx - t * x,
        }
    }

    /// Columns to the left a baseline, which is the disparity.
    fn disparity(self) -> f32 {
        (self.t * self.x - self.n * self.tx) / (self.n * self.tt - self.t * self.t)
    }

    /// Where the line is in a view so many baselines to the right.
    fn at(self, t: f32) -> f32 {
        let disparity = self.disparity();
        (self.x + disparity * self.t) / self.n - disparity * t
    }
}

/// A view other than the reference.
#[derive(Clone, Copy, Debug)]
struct Look<'a> {
    rows: &'a Rows,
    /// Baselines to the right of the reference view.
    to: f32,
    /// Which of a candidate's two spots is in it.
    slot: Option<usize>,
}

/// A point seen in another view.
#[derive(Clone, Copy, Debug)]
struct Sighting {
    /// Index of the view among those looked at.
    look: usize,
    /// Index of its spot.
    spot: usize,
    /// Columns beside the reference view's.
    x: f32,
    /// How unlike it is.
    cost: f32,
}

/// The search for sightings, with its memory.
#[derive(Debug)]
pub(crate) struct Sightings<'a> {
    /// The other views, those next to the reference view first.
    looks: Vec<Look<'a>>,
    /// For each view that proposes candidates the order in which the others are asked: outwards, then on the other side.
    orders: Vec<Vec<usize>>,
    width: f32,
    seen: Vec<Sighting>,
    costs: Vec<f32>,
}

impl<'a> Sightings<'a> {
    /// In the three views of the steps and in further ones, with how many baselines each stands to the right of the
    /// reference view.
    pub(crate) fn new(
        triple: &'a [Rows; 3],
        steps: &Steps,
        further: &'a [(f32, Rows)],
        width: u32,
    ) -> Self {
        let look = |rows, to, slot| Look { rows, to, slot };
        let mut looks = vec![
            look(&triple[steps.near], steps.to_near, Some(0)),
            look(&triple[steps.far], steps.to_far, Some(1)),
        ];
        looks.extend(further.iter().map(|(to, rows)| look(rows, *to, None)));
        looks.sort_by(|a, b| a.to.abs().total_cmp(&b.to.abs()));
        let is_next = |look: &Look<'_>| look.to.abs() < 1.01 * looks[0].to.abs();
        let orders = (0..looks.len()).filter(|&own| is_next(&looks[own]));
        let orders = orders.map(|own| {
            let mut order: Vec<usize> = (0..looks.len()).filter(|&other| other != own).collect();
            // Stable, so that each side stays in its order.
            order.sort_by_key(|&other| looks[other].to * looks[own].to < 0.0);
            order.insert(0, own);
            order
        });
        Self {
            orders: orders.collect(),
            looks,
            width: width as f32,
            seen: Vec::new(),
            costs: Vec::new(),
        }
    }

    /// Appends the best of what a point of the reference view may be in the other views, cheapest first, and says what became of what it is not.
    pub(crate) fn find(
        &mut self,
        like: &Likeness,
        (spot, row): (&Spot, usize),
        range: Range,
        list: &mut Vec<Candidate>,
    ) -> Reason {
        let mut reason = Reason::NoPartner;
        let start = list.len();
        for first in 0..self.orders.len() {
            let own = self.orders[first][0];
            let Look { rows, to, .. } = self.looks[own];
            let facing = (spot.orientation, like.turn);
            for (index, beside) in rows.facing(row, range.columns(spot.x, to), facing) {
                let Some(cost) = like.alike(spot, beside, f32::INFINITY) else {
                    continue;
                };
                reason = reason.max(Reason::ThirdView);
                self.seen.clear();
                self.seen.push(Sighting {
                    look: own,
                    spot: index,
                    x: beside.x - spot.x,
                    cost,
                });
                let line = Line::default().with(0.0, 0.0).with(to, beside.x - spot.x);
                let Some(line) = self.follow(like, (spot, row), first, line) else {
                    continue;
                };
                reason = Reason::Unlike;
                let disparity = line.disparity();
                if !range.contains(disparity) {
                    continue;
                }
                let (cost, bend) = self.cost(like, spot, line);
                if cost >= like.most {
                    continue;
                }
                let candidate = self.candidate(disparity, cost, bend);
                // Found from either side, it is one all the same.
                let found = &mut list[start..];
                let same = found
                    .iter_mut()
                    .find(|known| (known.disparity - disparity).abs() < SAME);
                match same {
                    Some(known) if known.cost <= cost => {}
                    Some(known) => *known = candidate,
                    None => list.push(candidate),
                }
            }
        }
        list[start..].sort_unstable_by(Candidate::order);
        list.truncate(start.saturating_add(like.keep));
        reason
    }

    /// Looks for the point in all other views, and gives the line through where it is seen; none where that is in two
    /// views only.
    fn follow(
        &mut self,
        like: &Likeness,
        (spot, row): (&Spot, usize),
        first: usize,
        mut line: Line,
    ) -> Option<Line> {
        for &look in &self.orders[first][1..] {
            let Look { rows, to, .. } = self.looks[look];
            let expected = line.at(to) + spot.x;
            let mut best = None::<(f32, Sighting)>;
            let facing = (spot.orientation, like.turn);
            for (index, other) in rows.facing(row, around(expected, like.miss), facing) {
                let Some(cost) = like.alike(spot, other, f32::INFINITY) else {
                    continue;
                };
                let worth = cost + like.miss_cost * (other.x - expected).abs() / like.miss;
                if best.is_none_or(|(least, _)| worth < least) {
                    let x = other.x - spot.x;
                    let sighting = Sighting {
                        look,
                        spot: index,
                        x,
                        cost,
                    };
                    best = Some((worth, sighting));
                }
            }
            if let Some((_, sighting)) = best {
                line = line.with(to, sighting.x);
                self.seen.push(sighting);
            }
        }
        // What the line through the others shows to be elsewhere was something else.
        while self.seen.len() > 2 {
            let off = |seen: &Sighting| {
                let to = self.looks[seen.look].to;
                (line.without(to, seen.x).at(to) - seen.x).abs()
            };
            let worst = (0..self.seen.len()).max_by(|&a, &b| {
                let of = |at: usize| off(&self.seen[at]);
                of(a).total_cmp(&of(b))
            })?;
            if off(&self.seen[worst]) <= like.miss {
                break;
            }
            let gone = self.seen.remove(worst);
            line = line.without(self.looks[gone.look].to, gone.x);
        }
        // Matches name curves of the views next to the reference one.
        let is_named = |seen: &Sighting| self.looks[seen.look].slot.is_some();
        (self.seen.len() >= 2 && self.seen.iter().any(is_named)).then_some(line)
    }

    /// How unlike the sightings are, and by how much they miss the line, in pixels.
    ///
    /// Likeness is that of the better half: where a background is hidden or comes forth, what lies beside an occluding
    /// edge differs from view to view.
    fn cost(&mut self, like: &Likeness, spot: &Spot, line: Line) -> (f32, f32) {
        self.costs.clear();
        self.costs.extend(self.seen.iter().map(|seen| seen.cost));
        self.costs.sort_unstable_by(f32::total_cmp);
        let better = self.costs.len().div_ceil(2).max(2);
        let unlike = self.costs[..better].iter().sum::<f32>() / better as f32;
        let own = line.at(0.0);
        let mut squares = own * own;
        for seen in &self.seen {
            let off = seen.x - line.at(self.looks[seen.look].to);
            squares += off * off;
        }
        let bend = (squares / (self.seen.len() + 1) as f32).sqrt();
        let is_inside =
            |look: &&Look<'_>| (0.0..=self.width - 1.0).contains(&(spot.x + line.at(look.to)));
        let inside = self.looks.iter().filter(is_inside).count();
        let seen = self.seen.len() as f32 / inside.max(self.seen.len()) as f32;
        let cost = unlike + like.miss_cost * bend / like.miss + like.unseen_cost * (1.0 - seen);
        (cost, bend)
    }

    fn candidate(&self, disparity: f32, cost: f32, bend: f32) -> Candidate {
        let mut candidate = Candidate {
            disparity,
            cost,
            bend,
            ..Candidate::FOUND
        };
        for seen in &self.seen {
            let look = &self.looks[seen.look];
            if let Some(slot) = look.slot {
                candidate.spots[slot] = seen.spot as u32;
                candidate.curves[slot] = look.rows.spots[seen.spot].curve;
            }
        }
        candidate
    }
}

/// Pixels of disparity within which two candidates of a point are one.
const SAME: f32 = 0.1;

impl Likeness {
    /// How unlike two points are, wherever they lie; none where their gradients differ too much, and where they are found
    /// to be more unlike than `dearest`.
    pub(crate) fn alike(&self, own: &Spot, other: &Spot, dearest: f32) -> Option<f32> {
        let turn = turn(own.orientation, other.orientation);
        if turn > self.turn {
            return None;
        }
        self.cost(own, [other], turn, 0.0, dearest)
    }
}
