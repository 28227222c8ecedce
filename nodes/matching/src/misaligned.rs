//! By how many rows the pictures of cameras out of line lie lower, from the curves themselves.
//!
//! Along a slanted line a picture that lies lower looks like another disparity, but a curve that bends has one disparity
//! only in the right rows: in others its votes spread. The offset at which the fullest lanes of all curves together hold
//! most is the right one.

use std::cmp::Reverse;

use crate::Matcher;
use crate::closed_loop::Views;
use crate::course::{Band, Lanes};
use crate::triple::Steps;
use crate::vote::Ballot;
use crate::{ChannelView, Size};

/// Pixels of disparity a lane of votes is wide: narrow enough that a row out of line empties it.
const LANE: f32 = 1.0;

/// Rows between the offsets tried last.
pub(crate) const FINEST: f32 = 0.125;

/// Votes that must agree for an offset to be believed.
const ENOUGH: f32 = 64.0;

/// How much better it must be than the offset known before.
const BETTER: f32 = 1.01;

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
            let mut agreement = |lower: f32| {
                self.lower[view] = lower;
                self.fill_rows(views, size, view);
                self.agreement(views, steps.reference, &asked, (view, to), bands, ballot)
            };
            let least = (BETTER * agreement(known)).max(ENOUGH);
            let (mut best, mut step) = ((least, known), most.min(1.0));
            let mut reach = (most / step) as i32;
            while step >= FINEST {
                let middle = best.1;
                for offset in (1..=reach).flat_map(|i| [-i, i]) {
                    let lower = middle + step * offset as f32;
                    let found = agreement(lower);
                    if found > best.0 {
                        best = (found, lower);
                    }
                }
                step /= 2.0;
                reach = 1;
            }
            self.lower[view] = best.1;
            self.fill_rows(views, size, view);
        }
        self.asked = asked;
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
    ) -> f32 {
        let lanes = Lanes {
            width: LANE,
            slope: 0.0,
        };
        let ballot = Ballot {
            lanes,
            ..ballot.clone()
        };
        let views = Views {
            views,
            rows: &self.rows,
            lower: self.lower,
        };
        let mut sum = 0.0;
        for &label in asked {
            let band = &bands[label as usize];
            sum += self
                .closed_loop
                .agreement(views, (reference, label), to, band, &ballot);
        }
        sum
    }
}
