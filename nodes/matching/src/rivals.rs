//! What a point might be instead, other than the search sees it: rivals whose partners lie outside the other pictures or
//! beyond the disparities searched, and the next ones of a pattern that repeats.
//!
//! A pattern along the row makes aliases: a point is taken for the next one of its kind. As long as all of them are
//! candidates, none is much cheaper than the others, and the point is left alone. Two things hide the true one:
//!
//! - its partners lie outside, or its disparity is beyond the range. Where the reference view has a like point at distance
//!   P in the same row, a candidate of disparity d has rivals at d ± P, unless the pictures that do see that place show
//!   nothing like it there;
//! - before a background that moves otherwise only one side of it is the same in all views, while an alias that comes near
//!   the background's disparity pleases both. Points of a pattern ([`Repetition`]) are not told from its next ones, unless
//!   both its ends are seen, by the same number of likes, in all views.

use messages::NONE;

use crate::Range;
use crate::candidates::{Candidate, Likeness};
use crate::repetition::{self, BORDER, Repetition};
use crate::rows::{Rows, Spot, around};
use crate::triple::Steps;

/// Pixels of disparity within which two candidates are not rivals.
pub(crate) const APART: f32 = 1.0;

/// Pixels of disparity by which rounding may move the ends of what is in sight.
const ROUNDING: f32 = 0.01;

/// The search for rivals.
#[derive(Debug)]
pub(crate) struct Rivals<'a> {
    own: &'a Rows,
    /// The near and the far view, with how many baselines to the right of the reference view they stand.
    beside: [(&'a Rows, f32); 2],
    /// How many of them have a say.
    count: usize,
    further: &'a [(f32, Rows)],
    repetition: &'a Repetition,
    width: f32,
    /// All disparities that are searched.
    full: Range,
    /// Baselines to the near view: a pattern's period over it is what its aliases differ by.
    unit: f32,
    /// Of the reference view's points that are like one by how much their disparities differ and what they cost.
    alike: &'a mut Vec<(f32, f32)>,
}

impl<'a> Rivals<'a> {
    pub(crate) fn new(
        rows: &'a [Rows; 3],
        steps: &Steps,
        further: &'a [(f32, Rows)],
        repetition: &'a Repetition,
        (width, full): (u32, Range),
        alike: &'a mut Vec<(f32, f32)>,
    ) -> Self {
        Self {
            own: &rows[steps.reference],
            beside: [
                (&rows[steps.near], steps.to_near),
                (&rows[steps.far], steps.to_far),
            ],
            count: if steps.third { 2 } else { 1 },
            further,
            repetition,
            width: width as f32,
            full,
            unit: steps.to_near.abs(),
            alike,
        }
    }

    /// What the disparities of a point and of the next one of its pattern differ by.
    pub(crate) fn period(&self, like: &Likeness, at: (&Spot, usize)) -> Option<f32> {
        let period = self.repetition.period(self.own, like, at)?;
        Some(period / self.unit)
    }

    /// Tells a point's candidates, cheapest first and found in this range, what their cheapest rivals cost that the search
    /// did not see, and whether they are part of a pattern of this period.
    pub(crate) fn judge(
        &mut self,
        like: &Likeness,
        at: (&Spot, usize),
        range: Range,
        period: Option<f32>,
        candidates: &mut [Candidate],
    ) {
        // What is not worth choosing needs no rivals.
        let count = candidates.partition_point(|candidate| candidate.cost < like.nothing);
        let worth = &mut candidates[..count];
        let mut alike = std::mem::take(self.alike);
        self.find_hidden(like, at, range, worth, &mut alike);
        *self.alike = alike;
        let Some(period) = period else { return };
        let mut own = None;
        for candidate in worth {
            candidate.repeats = self.has_alias(candidate.disparity, period) && {
                let own = *own.get_or_insert_with(|| self.likes(self.own, like, at, period));
                own.is_none_or(|own| !self.ends_agree(like, at, period, candidate, own))
            };
        }
    }

    /// The other views that have a say.
    fn looks(&self) -> impl Iterator<Item = (&'a Rows, f32)> {
        let further = self.further.iter().map(|(to, rows)| (rows, *to));
        self.beside[..self.count].iter().copied().chain(further)
    }

    /// Whether a column is in the picture, and points are found there.
    fn is_inside(&self, x: f32) -> bool {
        (BORDER..=self.width - 1.0 - BORDER).contains(&x)
    }

    /// Whether the search cannot find a point of this disparity: two other views must show it.
    fn is_out_of_sight(&self, x: f32, disparity: f32) -> bool {
        let shown = self
            .looks()
            .filter(|(_, to)| self.is_inside(x - to * disparity));
        shown.count() < self.count
    }

    /// Disparities at which a point is surely in sight: of the near and the far view both.
    fn in_sight(&self, x: f32) -> Range {
        let mut all = Range {
            least: f32::NEG_INFINITY,
            most: f32::INFINITY,
        };
        for (_, to) in &self.beside[..self.count] {
            let ends = [self.width - 1.0 - BORDER, BORDER].map(|end| (x - end) / to);
            all.least = all.least.max(ends[0].min(ends[1]) + ROUNDING);
            all.most = all.most.min(ends[0].max(ends[1]) - ROUNDING);
        }
        all
    }

    /// Tells candidates what their cheapest rivals cost that the search did not see; what is dearer than choosing nothing
    /// is none.
    fn find_hidden(
        &self,
        like: &Likeness,
        at: (&Spot, usize),
        range: Range,
        candidates: &mut [Candidate],
        alike: &mut Vec<(f32, f32)>,
    ) {
        for candidate in candidates.iter_mut() {
            candidate.rival = 1.0;
        }
        let (spot, row) = at;
        // Where a coarser channel narrowed the search, it excluded what is beyond. Else what is nearer than the nearest
        // searched is asked for too.
        let is_whole = range.least <= self.full.least && range.most >= self.full.most;
        let most = match is_whole {
            true => 2.0 * self.full.most - self.full.least,
            false => range.most,
        };
        let is_beyond = |other: f32| other > range.most || self.is_out_of_sight(spot.x, other);
        if !is_whole && !is_beyond(range.least) && !is_beyond(range.most) {
            return;
        }
        // What is alike is the same for all candidates, and nowhere nearer by than what the search has surely seen.
        let sight = self.in_sight(spot.x);
        let (mut seen, mut reach) = (f32::INFINITY, 0f32);
        for Candidate { disparity, .. } in &*candidates {
            reach = reach.max(disparity - range.least).max(most - disparity);
            seen = seen.min(sight.most.min(range.most) - disparity);
            if sight.least > range.least {
                seen = seen.min(disparity - sight.least);
            }
        }
        let (seen, reach) = (self.unit * (seen - ROUNDING).max(APART), self.unit * reach);
        alike.clear();
        for columns in [
            [spot.x - reach, spot.x - seen],
            [spot.x + seen, spot.x + reach],
        ] {
            let others = self.own.facing(row, columns, (spot.orientation, like.turn));
            alike.extend(others.filter_map(|(_, other)| {
                let by = (other.x - spot.x).abs() / self.unit;
                let cost = like.alike(spot, other, 1.0)?;
                (by > APART && cost < 1.0).then_some((by, cost))
            }));
        }
        for candidate in candidates {
            for &(by, cost) in alike.iter() {
                for rival in [candidate.disparity - by, candidate.disparity + by] {
                    if cost < candidate.rival
                        && (range.least..=most).contains(&rival)
                        && is_beyond(rival)
                    {
                        candidate.rival = self.unlike_at(like, at, rival, cost, candidate.rival);
                    }
                }
            }
        }
    }

    /// How unlike at most the other views are where a point of this disparity would be, nothing of those in which it is
    /// outside: at least `least`, and `most` where it is no less than that.
    fn unlike_at(
        &self,
        like: &Likeness,
        (spot, row): (&Spot, usize),
        disparity: f32,
        least: f32,
        most: f32,
    ) -> f32 {
        let mut unlike = least;
        for (rows, to) in self.looks() {
            let x = spot.x - to * disparity;
            if !self.is_inside(x) {
                continue;
            }
            let there = rows.facing(row, around(x, like.miss), (spot.orientation, like.turn));
            let costs = there.filter_map(|(_, other)| like.alike(spot, other, most));
            unlike = unlike.max(costs.fold(f32::INFINITY, f32::min));
            if unlike >= most {
                return most;
            }
        }
        unlike
    }

    /// Whether the next ones of a pattern are among what is searched.
    fn has_alias(&self, disparity: f32, period: f32) -> bool {
        disparity - period >= self.full.least - APART
            || disparity + period <= self.full.most + APART
    }

    /// How many likes follow a spot of a view to either side, a period of disparity apart.
    fn likes(
        &self,
        rows: &Rows,
        like: &Likeness,
        at: (&Spot, usize),
        period: f32,
    ) -> Option<[usize; 2]> {
        repetition::followers(rows, like, at, period * self.unit, self.width)
    }

    /// Whether a candidate's partners have as many likes to either side as the point itself, up to both ends.
    fn ends_agree(
        &self,
        like: &Likeness,
        (_, row): (&Spot, usize),
        period: f32,
        candidate: &Candidate,
        own: [usize; 2],
    ) -> bool {
        let mut partners = candidate.spots.iter().zip(&self.beside);
        partners.all(|(&at, (rows, _))| {
            at == NONE
                || self.likes(rows, like, (&rows.spots[at as usize], row), period) == Some(own)
        })
    }
}
