//! Where a point may lie in the two other views: the multi-position criterion, point by point.
//!
//! A point seen at x in the reference view is expected at x − k·d in the view k steps to its right. Of all pairs of
//! points in the two other views that one disparity explains within a tolerance, the best few are kept. The long base
//! between the outer views gives the precision, the short one the uniqueness. Without the third view every like point
//! in the neighbouring one is a candidate.

use std::cmp::Ordering;

use messages::{NONE, Reason};
use wide::i16x8;

use crate::along::JUMP;
use crate::rivals::{APART, Rivals};
use crate::rows::{Rows, Spot, around, is_flat, turn, wider};
use crate::surroundings::Surroundings;
use crate::triple::Steps;
use crate::{Range, Settings};

/// Candidates kept a point. From 3 on nothing changes.
const KEEP: usize = 8;

/// Cost of the greatest miss allowed. Without it 0.004 more is covered, and 0.28 % of the points are wrong instead of 0.27 %.
const MISS_COST: f32 = 0.2;

/// Most that gray levels cost. Without this end nothing changes.
const GRAY_MOST: f32 = 2.0;

/// How many times more the better side of an edge weighs than the worse one: at an occluding edge one side only is preserved.
/// With equal weights 0.001 less is covered, and 0.26 % of the points are wrong instead of 0.27 %.
const BETTER_SIDE: f32 = 4.0;

/// More than three views: cost of being seen in none of those in which a point should be. Half of it covers 0.009 more, with
/// 0.07 % more off by over half a pixel.
const UNSEEN_COST: f32 = 1.0;

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

    /// Which of two candidates of a point comes first: the cheaper one.
    pub(crate) fn order(&self, other: &Self) -> Ordering {
        let cheaper = self.cost.total_cmp(&other.cost);
        cheaper.then(self.spots.cmp(&other.spots))
    }

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
    /// predicted around each, and their rivals: `search` appends the best of a point, cheapest first, and says why there are no
    /// others. Why a point has none,
    /// or will hardly choose one, goes to `lost`.
    pub(crate) fn gather(
        &mut self,
        reference: &Rows,
        (range, predicted): (Range, Option<&Surroundings>),
        like: &Likeness,
        mut rivals: Option<&mut Rivals<'_>>,
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
                let period = rivals
                    .as_ref()
                    .and_then(|rivals| rivals.period(like, (spot, row)));
                // Thin bars escape a coarser channel, which knows what is behind them.
                let range = match predicted {
                    Some(predicted) if period.is_none() => predicted.range(spot.x, row as f32),
                    _ => range,
                };
                let reason = search(spot, row, range, &mut self.list);
                let own = &self.list[start..];
                lost[spot.point as usize] = match own.first() {
                    Some(best) if best.cost < like.nothing => Reason::Unsteady,
                    _ => reason,
                };
                if let Some(rivals) = &mut rivals {
                    let own = &mut self.list[start..];
                    rivals.judge(like, (spot, row), range, period, own);
                }
                self.of_point[spot.point as usize] =
                    (start as u32, (self.list.len() - start) as u32);
            }
        }
    }
}

/// Appends the best pairs of points in the near and the far view that may show the same place as a point of the reference
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
    let mut best = Best::new(list, like);
    let mut reason = Reason::NoPartner;
    let facing = (spot.orientation, like.turn);
    for (n, beside) in near.facing(row, range.columns(spot.x, steps.to_near), facing) {
        let near_turn = turn(spot.orientation, beside.orientation);
        let short = (spot.x - beside.x) / steps.to_near;
        if !steps.third {
            reason = Reason::Unlike;
            if range.contains(short) {
                best.offer(
                    like.cost(spot, [beside], near_turn, 0.0, best.dearest()),
                    Candidate {
                        disparity: short,
                        spots: [n as u32, NONE],
                        curves: [beside.curve, NONE],
                        ..Candidate::FOUND
                    },
                );
            }
            continue;
        }
        reason = reason.max(Reason::ThirdView);
        let expected = spot.x - steps.to_far * short;
        for (f, beyond) in far.facing(row, around(expected, like.miss), facing) {
            let far_turn = turn(spot.orientation, beyond.orientation);
            reason = Reason::Unlike;
            let xs = steps.in_order(spot.x, beside.x, beyond.x);
            let (disparity, bend) = steps.measure(xs);
            if !range.contains(disparity) {
                continue;
            }
            let (turns, miss) = (near_turn + far_turn, (beyond.x - expected).abs());
            best.offer(
                like.cost(spot, [beside, beyond], turns, miss, best.dearest()),
                Candidate {
                    disparity,
                    bend,
                    spots: [n as u32, f as u32],
                    curves: [beside.curve, beyond.curve],
                    ..Candidate::FOUND
                },
            );
        }
    }
    reason
}

/// The best candidates of a point, cheapest first, at the end of a list.
struct Best<'a> {
    list: &'a mut Vec<Candidate>,
    start: usize,
    most: f32,
    keep: usize,
}

impl<'a> Best<'a> {
    fn new(list: &'a mut Vec<Candidate>, like: &Likeness) -> Self {
        Self {
            start: list.len(),
            list,
            most: like.most,
            keep: like.keep,
        }
    }

    /// What is dearer is not kept.
    fn dearest(&self) -> f32 {
        match self.list.last() {
            Some(last) if self.list.len() - self.start == self.keep => last.cost,
            _ => self.most,
        }
    }

    fn offer(&mut self, cost: Option<f32>, candidate: Candidate) {
        let Some(cost) = cost.filter(|cost| *cost < self.most) else {
            return;
        };
        self.list.push(Candidate { cost, ..candidate });
        let own = &mut self.list[self.start..];
        let mut at = own.len() - 1;
        while at > 0 && own[at].order(&own[at - 1]).is_lt() {
            own.swap(at, at - 1);
            at -= 1;
        }
        self.list.truncate(self.start.saturating_add(self.keep));
    }
}

impl Likeness {
    /// As the settings weigh it.
    pub(crate) fn of(s: &Settings) -> Self {
        Self {
            turn: s.orientation_tolerance.to_radians(),
            miss: s.miss,
            flat: s.flat.to_radians(),
            turn_cost: s.turn_cost,
            miss_cost: MISS_COST,
            unseen_cost: UNSEEN_COST,
            gray_cost: s.gray_cost,
            gray_most: GRAY_MOST,
            better: BETTER_SIDE / (1.0 + BETTER_SIDE),
            magnitude_cost: s.magnitude_cost,
            nothing: s.nothing,
            most: s.nothing + JUMP,
            keep: KEEP,
        }
    }

    /// Cost of taking a point for its likes in one or two other views, from which it turns by `turns` in all; they miss
    /// one straight motion by `miss` pixels. None where it is found to be above `dearest`.
    #[inline]
    pub(crate) fn cost<const N: usize>(
        &self,
        own: &Spot,
        others: [&Spot; N],
        turns: f32,
        miss: f32,
        dearest: f32,
    ) -> Option<f32> {
        let placed =
            self.turn_cost * turns / (N as f32 * self.turn) + self.miss_cost * miss / self.miss;
        let shaded = placed + self.gray(own, others);
        (shaded <= dearest).then(|| shaded + self.magnitude(own, others))
    }

    /// Cost of the gray levels beside the points: each side for itself, the better one weighing more, because at an
    /// occluding edge only one side is preserved.
    fn gray<const N: usize>(&self, own: &Spot, others: [&Spot; N]) -> f32 {
        let mut differences = i16x8::ZERO;
        for other in others {
            differences += apart(own.profile, other.profile);
        }
        let [left, right] = sides(differences, WEIGHTS)
            .map(|sum| sum as f32 / (N as i32 * WEIGHTS_OF_A_SIDE) as f32);
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
        let [left, right] = sides(apart(own.levels, other.levels), i16x8::splat(1));
        let mean = left.min(right) as f32 / 4.0;
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

/// How the samples count: on either side the same, from the edge outwards 4, 7, 6, 3.
const WEIGHTS: i16x8 = i16x8::new([3, 6, 7, 4, 4, 7, 6, 3]);

/// What they sum up to on a side.
const WEIGHTS_OF_A_SIDE: i32 = 20;

/// By how much two profiles differ, sample by sample.
#[inline]
fn apart(a: [u8; 8], b: [u8; 8]) -> i16x8 {
    (wider(a) - wider(b)).abs()
}

/// The weighted sums of the samples to the left and to the right.
#[inline]
fn sides(differences: i16x8, weights: i16x8) -> [i32; 2] {
    let [far_left, left, right, far_right] = differences.dot(weights).to_array();
    [far_left + left, right + far_right]
}
