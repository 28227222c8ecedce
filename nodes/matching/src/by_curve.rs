//! Whole curves are matched in a closed loop, weighed against their neighbours, and their points paired row by row:
//! the thesis's way.

use messages::{Edge, Reason, Size, Sway};

use crate::closed_loop::{Closing, Views};
use crate::course::{Band, Lanes};
use crate::differences::{Matched, Pairing};
use crate::misaligned::FINEST;
use crate::relation::{self, Node, Relation};
use crate::triple::Steps;
use crate::vote::{Ballot, beside};
use crate::{ChannelView, Matcher, Range};

/// Rows by which a finer channel may correct how far pictures are out of line.
const FINER: f32 = 0.25;

/// Every how many points along a curve the coarser channel is asked.
const ASKED: usize = 4;

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
        let s = self.settings.clone();
        let reference = views[steps.reference].curves;
        let ballot = Ballot {
            turn: s.orientation_tolerance.to_radians(),
            flat: s.flat.to_radians(),
            rows: s.vote_rows,
            lanes: Lanes {
                width: s.vote_cell,
                slope: s.slant_most,
            },
        };
        let closing = Closing {
            score: s.score,
            residual: s.loop_residual,
            tries: s.candidates,
        };
        let reach = s.window_widths * width / 2.0;
        let mut bands = std::mem::take(&mut self.bands);
        bands.clear();
        bands.extend(reference.curves.iter().map(|curve| {
            let points = &reference.points[curve.range()];
            let predicted = match has_coarser {
                true => self.predicted(points),
                false => s.initial_disparity,
            };
            Band::level(predicted.map_or(range, |disparity| beside(disparity, reach, range)))
        }));
        for view in (0..3).filter(|&view| steps.uses(view)) {
            self.place_rows(views, view);
        }
        // What sways along a rail has been put right, frame by frame.
        let reach = if has_coarser { FINER } else { f32::INFINITY };
        let most = reach.min(s.window_rows / 2.0);
        if most >= FINEST && self.is_steady {
            self.align_rows(views, size, steps, &bands, &ballot, most);
        }
        self.nodes.clear();
        for (label, curve) in (0..).zip(reference.curves) {
            let all = Views {
                views,
                rows: &self.rows,
                lower: self.lower,
            };
            let band = &bands[label as usize];
            match self
                .closed_loop
                .close(all, label, steps, band, &ballot, &closing)
            {
                Ok(closed) => {
                    self.closed[label as usize] = Some(closed);
                    self.nodes.push(Node {
                        x: curve.x,
                        y: curve.y,
                        disparity: closed.course.at(curve.y, curve.x),
                        certainty: closed.score,
                        support: 1.0,
                    });
                }
                Err(reason) => self.lost[curve.range()].fill(reason),
            }
        }
        self.bands = bands;
        let relation = Relation {
            radius: s.relation_radius,
            within: s.support_within,
            slope: s.support_slope,
            strength: s.relation_strength,
            rounds: s.relation_rounds,
        };
        relation::relax(&mut self.nodes, &relation, &mut self.nodes_before);

        let pairing = Pairing {
            turn: ballot.turn,
            spread: s.vote_cell,
            miss: s.miss,
            flat: ballot.flat,
            rows: ballot.rows,
            gap: s.gap,
            filling: s.filling,
        };
        let all = Views {
            views,
            rows: &self.rows,
            lower: self.lower,
        };
        let closed = self.closed.iter_mut().zip(reference.curves);
        let matched = closed.filter(|(closed, _)| closed.is_some());
        for ((closed, curve), node) in matched.zip(&self.nodes) {
            let Some(found) = closed.filter(|_| node.certainty >= s.certainty) else {
                *closed = None;
                self.lost[curve.range()].fill(Reason::Neighbours);
                continue;
            };
            let matched = Matched {
                sides: self.closed_loop.sides(all),
                steps,
                closed: found,
                pairing: &pairing,
            };
            let (points, choices) = (
                &reference.points[curve.range()],
                &mut self.choices[curve.range()],
            );
            matched.row_by_row(points, choices);
            for choice in choices.iter_mut() {
                choice.support = node.support;
            }
            let centroid = found.course.at(curve.y, curve.x);
            matched.fill(points, centroid, choices);
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

    /// The average disparity that the coarser channel knows about a curve's points.
    fn predicted(&self, points: &[Edge]) -> Option<f32> {
        let asked = points.iter().step_by(ASKED);
        let known = asked.filter_map(|edge| self.coarser.average(edge.x, edge.y));
        let (sum, count) = known.fold((0.0, 0.0), |(sum, count), known| (sum + known, count + 1.0));
        (count > 0.0).then(|| sum / count)
    }

    /// Takes in the points of a view by the rows of the reference view.
    pub(crate) fn fill_rows(&mut self, views: &[ChannelView<'_>; 3], size: Size, view: usize) {
        let gain = self.contrast.gain(view);
        self.rows[view].fill(&views[view], size, self.lower[view], &Sway::NONE, gain);
        self.place_rows(views, view);
    }

    /// Notes where the points of a view lie.
    fn place_rows(&mut self, views: &[ChannelView<'_>; 3], view: usize) {
        let points = views[view].curves.points.len();
        self.closed_loop.fill(view, points, &self.rows[view]);
    }
}
