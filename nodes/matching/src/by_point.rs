//! Every point along a curve chooses its partners for itself, and its neighbours have a say.

use messages::Size;

use crate::along::{self, Choice, Smoothness, Steadiness};
use crate::candidates::{Candidate, Likeness};
use crate::support::Neighbourhood;
use crate::{ChannelView, Matcher, Range, Steps};

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
        let like = Likeness {
            turn: s.orientation_tolerance.to_radians(),
            miss: s.miss,
            flat: s.flat.to_radians().sin(),
            turn_cost: s.turn_cost,
            miss_cost: s.miss_cost,
            gray_cost: s.gray_cost,
            gray_most: s.gray_most,
            better: s.better_side / (1.0 + s.better_side),
            magnitude_cost: s.magnitude_cost,
            prior_cost: s.prior_cost,
            most: s.nothing + s.jump,
            keep: s.candidates,
        };
        let prior = (has_coarser && s.prior_cost > 0.0).then_some(&self.coarser);
        self.candidates.gather(&self.rows, steps, range, &like, prior);

        let smoothness = Smoothness { nothing: s.nothing, change: s.change, jump: s.jump, crossing: s.crossing };
        let steadiness = Steadiness { step: s.steady, gap: s.gap, least: s.run };
        for pass in 0..=s.relaxations {
            let earlier = (pass > 0).then_some(&self.earlier);
            for curve in reference.curves {
                let near = &self.rows[steps.near].spots;
                let dearer = |point: usize, candidate: &Candidate| {
                    earlier.map_or(0.0, |earlier| {
                        let edge = &edges[point];
                        s.relaxation_cost * earlier.strangeness(edge.x, edge.y, candidate.disparity)
                    })
                };
                let curve_of = |spot: u32| near[spot as usize].curve;
                self.along.choose(curve.range(), &self.candidates, &smoothness, dearer, curve_of, &mut self.choices);
                along::keep_runs(&mut self.choices[curve.range()], &steadiness);
            }
            let worth = |choice: &Choice| choice.cost - (choice.run as f32).min(32.0) / 32.0;
            for (which, view) in [steps.near, steps.far].into_iter().enumerate() {
                self.support.keep_unique(self.rows[view].spots.len(), which, &mut self.choices, worth);
            }
            if pass < s.relaxations {
                self.earlier.clear(size, s.cell, range);
                for (edge, choice) in edges.iter().zip(&self.choices) {
                    if choice.is_some() {
                        self.earlier.add(edge.x, edge.y, choice.disparity);
                    }
                }
                self.earlier.settle();
            }
        }
        if s.support_share > 0.0 {
            let around = Neighbourhood {
                radius: s.support_radius,
                nearest: s.support_nearest,
                share: s.support_share,
                within: s.support_within,
                slope: s.support_slope,
                least: s.support_least,
            };
            self.support.keep_supported(&self.rows[steps.reference], &around, &mut self.choices);
        }
        for curve in reference.curves {
            let choices = &mut self.choices[curve.range()];
            along::keep_runs(choices, &steadiness);
            if s.straighten > 0 {
                along::straighten(choices, s.straighten, s.steady, &mut self.smooth);
            }
            along::fill_gaps(choices, &steadiness);
        }
    }
}
