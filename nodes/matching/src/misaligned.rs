//! By how many rows the pictures of cameras out of line lie lower, from the curves themselves.
//!
//! Along a slanted line a picture that lies lower looks like another disparity, but a curve that bends has one course of
//! disparity only in the right rows: in others its votes spread. Whole rows are tried, and where all curves together agree
//! best the rest is found by least squares.

use std::cmp::Reverse;

use crate::Matcher;
use crate::closed_loop::Views;
use crate::course::{Band, Lanes};
use crate::triple::Steps;
use crate::vote::{Ballot, Lowered};
use crate::{ChannelView, Size};

/// Rows by which pictures may be off without being worth a measurement.
pub(crate) const FINEST: f32 = 0.125;

/// How much more all curves must agree a row further for that row to be tried.
const BETTER: f32 = 1.1;

/// Share of the points asked that agree where pictures are out of line by a row or less, flat ones having no say.
const NEAR: f32 = 0.4;

/// Sum of the squares of tan θ, beside what planes take up, from which on curves tell the rows: to a
/// twentieth of one, where crossings are good to a seventh of a pixel.
const ENOUGH: f32 = 8.0;

/// Rounds of least squares.
const ROUNDS: usize = 4;

/// Curves that are asked, the longest ones.
const ASKED: usize = 128;

impl Matcher {
    /// Finds the offsets of the two other views beside the reference view, up to `most` rows more or less than those
    /// known, and leaves their points in the rows they belong to.
    pub(crate) fn align_rows(
        &mut self,
        views: &[ChannelView<'_>; 3],
        size: Size,
        steps: Steps,
        bands: &[Band],
        ballot: &Ballot,
        most: f32,
    ) {
        let curves = views[steps.reference].curves.curves;
        let mut asked = std::mem::take(&mut self.asked);
        asked.clear();
        asked.extend(0..curves.len() as u32);
        asked.sort_unstable_by_key(|&label| (Reverse(curves[label as usize].count), label));
        asked.truncate(ASKED);
        let others = [(steps.near, steps.to_near), (steps.far, steps.to_far)];
        for (view, to) in others.into_iter().filter(|&(view, _)| steps.uses(view)) {
            let known = self.lower[view];
            // Where all contours are nearly straight, only surfaces that face the cameras tell.
            let level = Ballot {
                lanes: Lanes {
                    slope: 0.0,
                    ..ballot.lanes
                },
                ..ballot.clone()
            };
            let reference = steps.reference;
            let mut found = None;
            for ballot in [ballot, &level] {
                found = found.or_else(|| {
                    self.offset(
                        views,
                        size,
                        reference,
                        &asked,
                        (view, to),
                        bands,
                        ballot,
                        most,
                    )
                });
            }
            self.lower[view] = found.map_or(known, |lower| lower.clamp(known - most, known + most));
            self.fill_rows(views, size, view);
        }
        self.asked = asked;
    }

    /// By how many rows another view's picture lies lower, where the curves asked tell; what is known of it is left changed.
    #[expect(
        clippy::too_many_arguments,
        reason = "what is looked at, where, and how far"
    )]
    fn offset(
        &mut self,
        views: &[ChannelView<'_>; 3],
        size: Size,
        reference: usize,
        asked: &[u32],
        to: (usize, f32),
        bands: &[Band],
        ballot: &Ballot,
        most: f32,
    ) -> Option<f32> {
        let known = self.lower[to.0];
        let curves = views[reference].curves.curves;
        let counts = asked
            .iter()
            .map(|&label| curves[label as usize].count as f32);
        let points: f32 = counts.sum();
        let mut agreement = |lower: f32| {
            self.lower[to.0] = lower;
            self.fill_rows(views, size, to.0);
            self.agreement(views, reference, asked, to, bands, ballot)
        };
        let here = agreement(known).agreement;
        let mut best = (BETTER * here, known);
        // Where most agree already least squares find the rest.
        let further = if here >= NEAR * points {
            0
        } else {
            most as i32
        };
        for offset in (1..=further).flat_map(|i| [-i, i]) {
            let lower = known + offset as f32;
            let found = agreement(lower).agreement;
            if found > best.0 {
                best = (found, lower);
            }
        }
        let mut lower = best.1;
        for _ in 0..ROUNDS {
            let found = agreement(lower);
            if found.squares < ENOUGH {
                self.lower[to.0] = known;
                return None;
            }
            lower += (found.both / found.squares).clamp(-1.0, 1.0);
        }
        Some(lower)
    }

    /// How well the votes of curves of the reference view agree with one disparity each in another view.
    fn agreement(
        &mut self,
        views: &[ChannelView<'_>; 3],
        reference: usize,
        asked: &[u32],
        to: (usize, f32),
        bands: &[Band],
        ballot: &Ballot,
    ) -> Lowered {
        let views = Views {
            views,
            rows: &self.rows,
            lower: self.lower,
        };
        let mut sum = Lowered::default();
        for &label in asked {
            let band = &bands[label as usize];
            let found = self
                .closed_loop
                .agreement(views, (reference, label), to, band, ballot);
            sum += found;
        }
        sum
    }
}
