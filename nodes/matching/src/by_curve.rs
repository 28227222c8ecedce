//! Whole curves are matched in a closed loop, weighed against their neighbours, and their points paired row by row:
//! the thesis's way.

use messages::{Reason, Size};

use crate::closed_loop::Closing;
use crate::differences::{self, Pairing};
use crate::relation::{self, Node, Relation};
use crate::settings::Filling;
use crate::triple::Steps;
use crate::vote::Ballot;
use crate::{ChannelView, Matcher, Range};

impl Matcher {
    /// Finds the choices of all points of the reference view's matched curves.
    pub(crate) fn assign_curves(
        &mut self,
        views: &[ChannelView<'_>; 3],
        size: Size,
        range: Range,
        steps: Steps,
        width: f32,
        has_coarser: bool,
    ) {
        let s = &self.settings;
        let reference = views[steps.reference].curves;
        let turn = s.orientation_tolerance.to_radians();
        let ballot = Ballot {
            turn,
            rows: s.vote_rows,
            cell: s.vote_cell,
        };
        let width = s.window_widths * width;
        let closing = Closing {
            width,
            rows: s.window_rows,
            score: s.score,
            residual: s.loop_residual,
            tries: s.candidates,
        };
        self.closed_loop.fill(views);
        self.nodes.clear();
        for (label, curve) in (0..).zip(reference.curves) {
            let predicted = if has_coarser {
                self.coarser.average(curve.x, curve.y)
            } else {
                None
            };
            let expected = predicted
                .or(s.initial_disparity)
                .map_or(range, |disparity| Range {
                    least: (disparity - width / 2.0).max(range.least),
                    most: (disparity + width / 2.0).min(range.most),
                });
            let closed = self
                .closed_loop
                .close(views, &self.rows, label, steps, expected, &ballot, &closing);
            match closed {
                Ok(closed) => {
                    self.closed[label as usize] = Some(closed);
                    self.nodes.push(Node {
                        x: curve.x,
                        y: curve.y,
                        disparity: closed.disparity,
                        certainty: closed.score,
                        support: 1.0,
                    });
                }
                Err(reason) => self.lost[curve.range()].fill(reason),
            }
        }
        let relation = Relation {
            radius: s.relation_radius,
            within: s.support_within,
            slope: s.support_slope,
            strength: s.relation_strength,
            rounds: s.relation_rounds,
        };
        relation::relax(&mut self.nodes, &relation, &mut self.nodes_before);

        let pairing = Pairing {
            turn,
            spread: s.loop_residual,
            miss: s.miss,
            flat: s.flat.to_radians(),
        };
        let closed = self.closed.iter_mut().zip(reference.curves);
        let matched = closed.filter(|(closed, _)| closed.is_some());
        for ((closed, curve), node) in matched.zip(&self.nodes) {
            let Some(found) = closed.filter(|_| node.certainty >= s.certainty) else {
                *closed = None;
                self.lost[curve.range()].fill(Reason::Neighbours);
                continue;
            };
            let range = reference.curves[found.curves[steps.reference] as usize].range();
            let choices = &mut self.choices[range.clone()];
            differences::row_by_row(
                &reference.points[range],
                &found,
                &self.rows,
                steps,
                &pairing,
                choices,
            );
            for choice in choices.iter_mut() {
                choice.support = node.support;
            }
            let centroid = (s.filling == Filling::Centroid).then_some(found.disparity);
            differences::fill_whole(choices, centroid, found.disparity);
        }

        self.around
            .clear(size, s.support_cell, s.support_within, range);
        for (edge, choice) in reference.points.iter().zip(&self.choices) {
            if choice.is_seen() {
                self.around.add(edge.x, edge.y, choice.disparity);
            }
        }
        self.around.settle();
        for (edge, choice) in reference.points.iter().zip(&mut self.choices) {
            if choice.is_some() {
                let (share, weight) = if choice.is_seen() {
                    self.around.agreement(edge.x, edge.y, choice.disparity)
                } else {
                    self.around.agreement_with(edge.x, edge.y, choice.disparity)
                };
                choice.witnesses = share * weight;
            }
        }
    }
}
