//! Every point along a curve chooses its partners for itself, and its neighbours have a say.

use messages::{Reason, Size};

use crate::along::{self, Choice, Smoothness, Steadiness};
use crate::candidates::{self, Likeness};
use crate::rivals::Rivals;
use crate::sightings::Sightings;
use crate::triple::Steps;
use crate::{ChannelView, Matcher, Range};

impl Matcher {
    /// Finds the choices of all points of the reference view.
    pub(crate) fn assign_points(
        &mut self,
        views: &[ChannelView<'_>; 3],
        size: Size,
        range: Range,
        steps: Steps,
        has_coarser: bool,
    ) {
        let s = &self.settings;
        let reference = views[steps.reference].curves;
        let edges = reference.points;
        let like = Likeness::of(s);
        let predicted = match s.prediction_margin.filter(|_| has_coarser) {
            Some(margin) => {
                self.coarser.predict(margin, range);
                Some(&self.coarser)
            }
            None => None,
        };
        let lost = &mut self.lost;
        let rows = &self.rows[steps.reference];
        let reach = steps.to_near.abs() * (range.most - range.least);
        let ratio = (steps.to_far / steps.to_near).abs();
        self.repetition
            .measure(rows, &like, size, (reach, ratio, s.repetition));
        let mut rivals = Rivals::new(
            &self.rows,
            &steps,
            &self.further,
            &self.repetition,
            (size.width, range),
            &mut self.alike,
        );
        let rivals = (s.repetition < 1.0).then_some(&mut rivals);
        match self.further.is_empty() {
            true => self.candidates.gather(
                rows,
                (range, predicted),
                &like,
                rivals,
                lost,
                |spot, row, range, list| {
                    candidates::pairs(&self.rows, &steps, &like, (spot, row), range, list)
                },
            ),
            false => {
                let mut sightings = Sightings::new(&self.rows, &steps, &self.further, size.width);
                self.candidates.gather(
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
            jump: s.jump,
            crossing: s.crossing,
        };
        let steadiness = Steadiness {
            step: s.steady,
            gap: s.gap,
            least: s.run,
            margin: s.margin,
        };
        for curve in reference.curves {
            self.along.choose(
                curve.range(),
                &self.candidates,
                &smoothness,
                &mut self.choices,
            );
            let own = curve.range();
            along::keep_runs(&mut self.choices[own.clone()], &mut lost[own], &steadiness);
        }
        let worth = |choice: &Choice| choice.cost - (choice.run as f32).min(32.0) / 32.0;
        let others = [steps.near, steps.far].into_iter().enumerate();
        for (which, view) in others.filter(|&(_, view)| s.unique && steps.uses(view)) {
            let spots = self.rows[view].spots.len();
            self.support
                .keep_unique(spots, which, &mut self.choices, lost, worth);
        }
        self.around
            .clear(size, s.support_cell, s.support_within, range);
        for (edge, choice) in edges.iter().zip(&self.choices) {
            if choice.is_some() {
                self.around.add(edge.x, edge.y, choice.disparity);
            }
        }
        self.around.settle();
        let asked = s.support_share > 0.0;
        for ((edge, choice), lost) in edges.iter().zip(&mut self.choices).zip(lost.iter_mut()) {
            if choice.is_some() {
                let (share, weight) = self.around.agreement(edge.x, edge.y, choice.disparity);
                choice.support = share;
                choice.witnesses = share * weight;
                if asked && (share < s.support_share || weight < s.support_least) {
                    *choice = Choice::NOTHING;
                    *lost = Reason::Neighbours;
                }
            }
        }
        for curve in reference.curves {
            let choices = &mut self.choices[curve.range()];
            along::keep_runs(choices, &mut lost[curve.range()], &steadiness);
            if s.straighten > 0 {
                along::straighten(choices, s.straighten, s.steady, &mut self.smooth);
            }
            along::fill_gaps(choices, &steadiness);
            for (edge, choice) in edges[curve.range()].iter().zip(choices) {
                if choice.is_some() && !choice.is_seen() {
                    let around = self.around.agreement_with(edge.x, edge.y, choice.disparity);
                    choice.witnesses = around.0 * around.1;
                }
            }
        }
    }
}
