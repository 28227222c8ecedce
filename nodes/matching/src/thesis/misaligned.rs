//! By how many rows the pictures of cameras out of line lie lower, from the curves themselves.
//!
//! Along a slanted line a picture that lies lower looks like another disparity, but a curve that bends has one course of
//! disparity only in the right rows: in others its votes spread. Whole rows are tried, and where all curves together agree
//! best the rest is found by least squares.

use std::cmp::Reverse;

use super::Curves;
use super::closed_loop::Views;
use super::course::{Band, Lanes};
use super::vote::{Ballot, Lowered};
use crate::{Shared, Task};

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

impl Curves {
    /// Finds the offsets of the two other views beside the reference view, up to `most` rows more or less than those
    /// known, and leaves their points in the rows they belong to.
    pub(crate) fn align_rows(
        &mut self,
        task: &Task<'_>,
        bands: &[Band],
        ballot: &Ballot,
        most: f32,
        shared: &mut Shared,
    ) {
        let Task { views, steps, .. } = task;
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
            let question = |ballot| Question {
                task,
                asked: &asked,
                view,
                steps: to,
                bands,
                ballot,
            };
            let found = self
                .offset(&question(ballot), most, shared)
                .or_else(|| self.offset(&question(&level), most, shared));
            self.lower[view] = found.map_or(known, |lower| lower.clamp(known - most, known + most));
            self.fill_rows(task, view, shared);
        }
        self.asked = asked;
    }

    /// By how many rows another view's picture lies lower, up to `most` more or less than known, where the curves asked
    /// tell.
    fn offset(&mut self, question: &Question<'_>, most: f32, shared: &mut Shared) -> Option<f32> {
        let known = self.lower[question.view];
        let found = self.offset_from(known, question, most, shared);
        self.lower[question.view] = known;
        found
    }

    fn offset_from(
        &mut self,
        known: f32,
        question: &Question<'_>,
        most: f32,
        shared: &mut Shared,
    ) -> Option<f32> {
        let here = self.agreement(question, known, shared).agreement;
        // Where most agree already least squares find the rest, unless bends that would tell show in other rows only.
        if here >= NEAR * question.points()
            && let Some(lower) = self.settled(question, known, shared)
        {
            return Some(lower);
        }
        let mut best = (BETTER * here, known);
        for offset in (1..=most as i32).flat_map(|i| [-i, i]) {
            let lower = known + offset as f32;
            let found = self.agreement(question, lower, shared).agreement;
            if found > best.0 {
                best = (found, lower);
            }
        }
        self.settled(question, best.1, shared)
    }

    /// What least squares make of an offset, where curves tell it.
    fn settled(&mut self, question: &Question<'_>, from: f32, shared: &mut Shared) -> Option<f32> {
        let mut lower = from;
        for _ in 0..ROUNDS {
            let found = self.agreement(question, lower, shared);
            if found.squares < ENOUGH {
                return None;
            }
            lower += (found.both / found.squares).clamp(-1.0, 1.0);
        }
        Some(lower)
    }

    /// How well the votes of the curves asked agree with one disparity each where the view lies so many rows lower.
    fn agreement(&mut self, question: &Question<'_>, lower: f32, shared: &mut Shared) -> Lowered {
        let &Question {
            task,
            asked,
            view,
            steps,
            bands,
            ballot,
        } = question;
        self.lower[view] = lower;
        self.fill_rows(task, view, shared);
        let reference = task.steps.reference;
        let views = Views {
            views: task.views,
            rows: &shared.rows,
            lower: self.lower,
        };
        let mut sum = Lowered::default();
        for &label in asked {
            let band = &bands[label as usize];
            sum +=
                self.closed_loop
                    .agreement(views, (reference, label), (view, steps), band, ballot);
        }
        sum
    }
}

/// Which curves of the reference view are asked about the rows of another view, and how.
#[derive(Clone, Copy, Debug)]
struct Question<'a> {
    task: &'a Task<'a>,
    /// Labels of the curves.
    asked: &'a [u32],
    /// The view whose rows are in question, …
    view: usize,
    /// … and how many steps it stands to the right of the reference.
    steps: f32,
    bands: &'a [Band],
    ballot: &'a Ballot,
}

impl Question<'_> {
    /// Points of all curves asked.
    fn points(&self) -> f32 {
        let curves = self.task.views[self.task.steps.reference].curves.curves;
        let counts = self.asked.iter().map(|&label| curves[label as usize].count);
        counts.map(|count| count as f32).sum()
    }
}
