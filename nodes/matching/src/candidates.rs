//! Where a point may lie in the two other views: the multi-position criterion, point by point.
//!
//! A point seen at x in the reference view is expected at x − k·d in the view k steps to its right. Of all pairs of
//! points in the two other views that one disparity explains within a tolerance, the best few are kept. The long base
//! between the outer views gives the precision, the short one the uniqueness. Without the third view every like point
//! in the neighbouring one is a candidate.

use messages::{NONE, Reason};

use crate::rivals::{APART, Rivals};
use crate::rows::{Rows, Spot, is_flat, turn};
use crate::surroundings::Surroundings;
use crate::triple::Steps;
use crate::{Range, Settings};

/// A pair of points in the two other views that may show the same place as a point of the reference view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Disparity between neighbouring views.
    pub(crate) disparity: f32,
    /// How unlike the three points are; 0 is perfect.
    pub(crate) cost: f32,
    /// How far the three columns are from one straight motion, in pixels.
    pub(crate) bend: f32,
    /// The indices of the two spots, in the near and in the far view; [`NONE`] where the far view has no say.
    pub(crate) spots: [u32; 2],
    /// The curves they belong to.
    pub(crate) curves: [u32; 2],
    /// What its cheapest rival costs that the search did not see.
    pub(crate) rival: f32,
    /// Whether it is part of a pattern whose next ones it is not told from.
    pub(crate) repeats: bool,
}

impl Candidate {
    /// A candidate found where the search sees it.
    pub(crate) const FOUND: Self = Self {
        disparity: 0.0,
        cost: 0.0,
        bend: 0.0,
        spots: [NONE; 2],
        curves: [NONE; 2],
        rival: f32::INFINITY,
        repeats: false,
    };

    /// What the cheapest one costs that the point might be instead, seen or not; no more than choosing nothing, 1.
    pub(crate) fn rival_among(&self, all: &[Self]) -> f32 {
        let elsewhere = all
            .iter()
            .filter(|other| (other.disparity - self.disparity).abs() > APART);
        let seen = elsewhere.map(|other| other.cost).fold(1.0, f32::min);
        seen.min(self.rival)
    }
}

/// How likeness is weighed.
#[derive(Clone, Debug)]
pub(crate) struct Likeness {
    /// Radians within which gradients may differ.
    pub(crate) turn: f32,
    /// Pixels by which the far view's column may miss the prediction.
    pub(crate) miss: f32,
    /// Radians from horizontal up to which a contour is too flat to be matched point by point.
    pub(crate) flat: f32,
    /// Cost of the greatest turn.
    pub(crate) turn_cost: f32,
    /// Cost of the greatest miss.
    pub(crate) miss_cost: f32,
    /// Cost of being seen in none of more than two other views.
    pub(crate) unseen_cost: f32,
    /// Cost of a sixteenth of an edge's own step.
    pub(crate) gray_cost: f32,
    /// Most that gray levels cost.
    pub(crate) gray_most: f32,
    /// Weight of the better side, of one.
    pub(crate) better: f32,
    /// Cost of a doubled magnitude.
    pub(crate) magnitude_cost: f32,
    /// Cost of a point that chooses no candidate.
    pub(crate) nothing: f32,
    /// Candidates dearer than this are not kept.
    pub(crate) most: f32,
    /// How many are kept a point.
    pub(crate) keep: usize,
}

/// The candidates of all points of the reference view.
#[derive(Debug, Default)]
pub(crate) struct Candidates {
    /// Point by point, cheapest first.
    list: Vec<Candidate>,
    /// Start and number of each point's candidates.
    of_point: Vec<(u32, u32)>,
}

impl Candidates {
    /// The candidates of a point, cheapest first.
    pub(crate) fn of(&self, point: usize) -> &[Candidate] {
        let (start, count) = self.of_point[point];
        &self.list[start as usize..(start + count) as usize]
    }

    /// Candidates made up for a test, point by point.
    #[cfg(test)]
    pub(crate) fn from_lists(lists: &[Vec<Candidate>]) -> Self {
        let mut all = Self::default();
        for own in lists {
            all.of_point.push((all.list.len() as u32, own.len() as u32));
            all.list.extend_from_slice(own);
        }
        all
    }

    /// Collects the candidates of every point of the reference view, in the whole range of disparities or in what is
    /// predicted around each, and their rivals: `search` appends those of a point, and says why there are no others. Why a point has none,
    /// or will hardly choose one, goes to `lost`.
    pub(crate) fn gather(
        &mut self,
        reference: &Rows,
        (range, predicted): (Range, Option<&Surroundings>),
        like: &Likeness,
        rivals: Option<&Rivals<'_>>,
        lost: &mut [Reason],
        mut search: impl FnMut(&Spot, usize, Range, &mut Vec<Candidate>) -> Reason,
    ) {
        self.list.clear();
        self.of_point.clear();
        self.of_point.resize(reference.curve_of.len(), (0, 0));
        for row in 0..reference.count() {
            for spot in &reference.spots[reference.row(row)] {
                if is_flat(spot.orientation, like.flat) {
                    continue;
                }
                let start = self.list.len();
                let period = rivals.and_then(|rivals| rivals.period(like, (spot, row)));
                // Thin bars escape a coarser channel, which knows what is behind them.
                let range = match predicted {
                    Some(predicted) if period.is_none() => predicted.range(spot.x, row as f32),
                    _ => range,
                };
                let reason = search(spot, row, range, &mut self.list);
                let own = &mut self.list[start..];
                own.sort_unstable_by(|a, b| a.cost.total_cmp(&b.cost).then(a.spots.cmp(&b.spots)));
                lost[spot.point as usize] = match own.first() {
                    Some(best) if best.cost < like.nothing => Reason::Unsteady,
                    _ => reason,
                };
                self.list
                    .truncate(start + like.keep.min(self.list.len() - start));
                if let Some(rivals) = rivals {
                    let own = &mut self.list[start..];
                    rivals.judge(like, (spot, row), range, period, own);
                }
                self.of_point[spot.point as usize] =
                    (start as u32, (self.list.len() - start) as u32);
            }
        }
    }
}

/// Appends the pairs of points in the near and the far view that may show the same place as a point of the reference
/// view, and says what became of those that may not; without the third view the points of the near view.
pub(crate) fn pairs(
    rows: &[Rows; 3],
    steps: &Steps,
    like: &Likeness,
    (spot, row): (&Spot, usize),
    range: Range,
    list: &mut Vec<Candidate>,
) -> Reason {
    let (near, far) = (&rows[steps.near], &rows[steps.far]);
    let mut reason = Reason::NoPartner;
    for (n, beside) in near.within(row, spot.x, steps.to_near, range) {
        let near_turn = turn(spot.orientation, beside.orientation);
        if near_turn > like.turn {
            continue;
        }
        let short = (spot.x - beside.x) / steps.to_near;
        if !steps.third {
            reason = Reason::Unlike;
            let cost = like.cost(spot, [beside], near_turn, 0.0);
            if cost < like.most && range.contains(short) {
                list.push(Candidate {
                    disparity: short,
                    cost,
                    spots: [n as u32, NONE],
                    curves: [beside.curve, NONE],
                    ..Candidate::FOUND
                });
            }
            continue;
        }
        reason = reason.max(Reason::ThirdView);
        let expected = spot.x - steps.to_far * short;
        for (f, beyond) in far.between(row, expected - like.miss, expected + like.miss) {
            let far_turn = turn(spot.orientation, beyond.orientation);
            if far_turn > like.turn {
                continue;
            }
            reason = Reason::Unlike;
            let xs = steps.in_order(spot.x, beside.x, beyond.x);
            let (disparity, bend) = steps.measure(xs);
            let miss = (beyond.x - expected).abs();
            let cost = like.cost(spot, [beside, beyond], near_turn + far_turn, miss);
            if cost < like.most && range.contains(disparity) {
                list.push(Candidate {
                    disparity,
                    cost,
                    bend,
                    spots: [n as u32, f as u32],
                    curves: [beside.curve, beyond.curve],
                    ..Candidate::FOUND
                });
            }
        }
    }
    reason
}

impl Likeness {
    /// As the settings weigh it.
    pub(crate) fn of(s: &Settings) -> Self {
        Self {
            turn: s.orientation_tolerance.to_radians(),
            miss: s.miss,
            flat: s.flat.to_radians(),
            turn_cost: s.turn_cost,
            miss_cost: s.miss_cost,
            unseen_cost: s.unseen_cost,
            gray_cost: s.gray_cost,
            gray_most: s.gray_most,
            better: s.better_side / (1.0 + s.better_side),
            magnitude_cost: s.magnitude_cost,
            nothing: s.nothing,
            most: s.nothing + s.jump,
            keep: s.candidates,
        }
    }

    /// Cost of taking a point for its likes in one or two other views, from which it turns by `turns` in all; they miss
    /// one straight motion by `miss` pixels.
    #[inline]
    pub(crate) fn cost<const N: usize>(
        &self,
        own: &Spot,
        others: [&Spot; N],
        turns: f32,
        miss: f32,
    ) -> f32 {
        self.turn_cost * turns / (N as f32 * self.turn)
            + self.miss_cost * miss / self.miss
            + self.gray(own, others)
            + self.magnitude(own, others)
    }

    /// Cost of the gray levels beside the points: each side for itself, the better one weighing more, because at an
    /// occluding edge only one side is preserved.
    fn gray<const N: usize>(&self, own: &Spot, others: [&Spot; N]) -> f32 {
        let differences: [u16; 8] = std::array::from_fn(|i| {
            let different = |other: &Spot| u16::from(own.profile[i].abs_diff(other.profile[i]));
            others.into_iter().map(different).sum()
        });
        let side = |samples: [usize; 4]| {
            let sum: u16 = samples
                .into_iter()
                .zip(WEIGHTS)
                .map(|(i, weight)| weight * differences[i])
                .sum();
            f32::from(sum) / f32::from(N as u16 * WEIGHTS.iter().sum::<u16>())
        };
        let (left, right) = (side([3, 2, 1, 0]), side([4, 5, 6, 7]));
        let mean = self.better * left.min(right) + (1.0 - self.better) * left.max(right);
        (self.gray_cost * mean).min(self.gray_most)
    }

    /// How unlike two points of one view are on their better side; none where their gradients differ too much.
    ///
    /// How steep an edge is and how bright on average depends on both its sides, so gray levels are compared as they are.
    pub(crate) fn better_side(&self, own: &Spot, other: &Spot) -> Option<f32> {
        let turn = turn(own.orientation, other.orientation);
        if turn > self.turn {
            return None;
        }
        let side = |samples: std::ops::Range<usize>| -> u16 {
            let pairs = own.levels[samples.clone()]
                .iter()
                .zip(&other.levels[samples]);
            pairs.map(|(a, b)| u16::from(a.abs_diff(*b))).sum()
        };
        let mean = f32::from(side(0..4).min(side(4..8))) / 4.0;
        let gray = self.gray_cost * own.sixteenths * mean;
        Some(gray + self.turn_cost * turn / self.turn)
    }

    fn magnitude<const N: usize>(&self, own: &Spot, others: [&Spot; N]) -> f32 {
        let others = others.map(|other| other.magnitude);
        let least = others.into_iter().fold(own.magnitude, f32::min);
        let most = others.into_iter().fold(own.magnitude, f32::max);
        self.magnitude_cost * (most / least.max(1e-3)).log2().min(2.0)
    }
}

/// How the samples of a side count, from the edge outwards.
const WEIGHTS: [u16; 4] = [4, 7, 6, 3];
