//! The default method: every point along a curve chooses its partners for itself, and its neighbours have a say.
//!
//! ```text
//! rows ─► candidates, rivals ─► dynamic programming along each curve ─► runs ─► unique ─► support ─► lines ─► gaps ─► choices
//! ```

use messages::Reason;

use crate::along::{Along, Smoothness};
use crate::candidates::{self, Likeness};
use crate::choice::Choice;
use crate::repetition::Repetition;
use crate::rivals::Rivals;
use crate::rows::Rows;
use crate::runs::{self, Steadiness};
use crate::sightings::Sightings;
use crate::{NEIGHBOURS_CELL, NEIGHBOURS_WITHIN, Settings, Shared, Task};

/// Least share of the points around one that must agree with its disparity. With 0 0.001 less is covered, and 0.005 % more of
/// the points are wrong.
const AGREE: f32 = 0.7;

/// Least weight of those points: those in a point's own cell count 4, those in the cells beside it less, and the sum is
/// divided by 4.
const FEW: f32 = 4.0;

/// The matcher of points along curves, with its memory.
#[derive(Debug, Default)]
pub(crate) struct AlongCurves {
    along: Along,
    repetition: Repetition,
    /// Working memory of the search for rivals.
    alike: Vec<(f32, f32)>,
    smooth: Vec<f32>,
}

impl AlongCurves {
    /// Finds the choices of all points of the reference view; `further` are views beside the three, each with how many
    /// baselines it stands to the right of the reference view.
    pub(crate) fn assign(
        &mut self,
        task: &Task<'_>,
        further: &[(f32, Rows)],
        s: &Settings,
        shared: &mut Shared,
    ) {
        let &Task {
            views,
            size,
            range,
            steps,
            has_coarser,
            ..
        } = task;
        let Shared {
            rows: all,
            candidates: found,
            support,
            coarser,
            around,
            choices,
            lost,
            ..
        } = shared;
        let reference = views[steps.reference].curves;
        let edges = reference.points;
        let like = Likeness::of(s);
        let predicted = match s.prediction_margin.filter(|_| has_coarser) {
            Some(margin) => {
                coarser.predict(margin, range);
                Some(&*coarser)
            }
            None => None,
        };
        let rows = &all[steps.reference];
        let reach = steps.to_near.abs() * (range.most - range.least);
        let ratio = (steps.to_far / steps.to_near).abs();
        self.repetition
            .measure(rows, &like, size, (reach, ratio, s.repetition));
        let mut rivals = Rivals::new(
            all,
            &steps,
            further,
            &self.repetition,
            (size.width, range),
            &mut self.alike,
        );
        let rivals = (s.repetition < 1.0).then_some(&mut rivals);
        match further.is_empty() {
            true => found.gather(
                rows,
                (range, predicted),
                &like,
                rivals,
                lost,
                |spot, row, range, list| {
                    candidates::pairs(all, &steps, &like, (spot, row), range, list)
                },
            ),
            false => {
                let mut sightings = Sightings::new(all, &steps, further, size.width);
                found.gather(
                    rows,
                    (range, predicted),
                    &like,
                    rivals,
                    lost,
                    |spot, row, range, list| sightings.find(&like, (spot, row), range, list),
                );
            }
        }

        let smoothness = Smoothness {
            nothing: s.nothing,
            change: s.change,
        };
        let steadiness = Steadiness {
            gap: s.gap,
            least: s.run,
            margin: s.margin,
        };
        for curve in reference.curves {
            let own = curve.range();
            self.along.choose(own.clone(), found, &smoothness, choices);
            runs::keep(&mut choices[own.clone()], &mut lost[own], &steadiness);
        }
        let worth = |choice: &Choice| choice.cost - (choice.run as f32).min(32.0) / 32.0;
        let others = [steps.near, steps.far].into_iter().enumerate();
        for (which, view) in others.filter(|&(_, view)| s.unique && steps.uses(view)) {
            let spots = all[view].spots.len();
            support.keep_unique(spots, which, choices, lost, worth);
        }
        around.clear(size, NEIGHBOURS_CELL, NEIGHBOURS_WITHIN, range);
        for (edge, choice) in edges.iter().zip(&*choices) {
            if choice.is_some() {
                around.add(edge.x, edge.y, choice.disparity);
            }
        }
        around.settle();
        for ((edge, choice), lost) in edges.iter().zip(&mut *choices).zip(lost.iter_mut()) {
            if choice.is_some() {
                let (share, weight) = around.agreement(edge.x, edge.y, choice.disparity);
                choice.support = share;
                choice.witnesses = share * weight;
                if share < AGREE || weight < FEW {
                    *choice = Choice::NOTHING;
                    *lost = Reason::Neighbours;
                }
            }
        }
        for curve in reference.curves {
            let choices = &mut choices[curve.range()];
            runs::keep(choices, &mut lost[curve.range()], &steadiness);
            if s.straighten > 0 {
                runs::straighten(choices, s.straighten, &mut self.smooth);
            }
            runs::fill_gaps(choices, &steadiness);
            for (edge, choice) in edges[curve.range()].iter().zip(choices) {
                if choice.is_some() && !choice.is_seen() {
                    let around = around.agreement_with(edge.x, edge.y, choice.disparity);
                    choice.witnesses = around.0 * around.1;
                }
            }
        }
    }
}
