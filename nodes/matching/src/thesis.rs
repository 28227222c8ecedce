//! The thesis's way: whole curves are matched in a closed loop, weighed against their neighbours, and their points paired
//! row by row.
//!
//! ```text
//! curves, R-tables ─► windows ─► votes ─► closed loop, back-tracking ─► relaxation ─► differences row by row ─► choices
//! ```

mod closed_loop;
mod course;
mod differences;
mod misaligned;
mod relation;
pub(crate) mod settings;
mod vote;

use messages::{CurvesView, Edge, Reason, Sway};

use crate::{ChannelView, Settings, Shared, Task, Triple};
use closed_loop::{Closed, ClosedLoop, Closing, Views};
use course::{Band, Lanes};
use differences::{Matched, Pairing};
use misaligned::FINEST;
use relation::{Node, Relation};
use vote::{Ballot, beside};

/// Rows by which a finer channel may correct how far pictures are out of line.
const FINER: f32 = 0.25;

/// Every how many points along a curve the coarser channel is asked.
const ASKED: usize = 4;

/// Candidates tried at each step of the loop: one that fails goes back to the next.
const TRIES: usize = 8;

/// Pixels of disparity within which neighbouring curves agree, at no distance, …
const WITHIN: f32 = 1.0;

/// … and pixels of disparity more for each pixel between their centroids: 10 px apart, 2 px may lie between them.
const SLOPE: f32 = 0.1;

/// The matcher of whole curves, with its memory.
#[derive(Debug, Default)]
pub(crate) struct Curves {
    closed_loop: ClosedLoop,
    /// Per curve of the reference view the loop that closed.
    closed: Vec<Option<Closed>>,
    /// Per curve of the reference view the disparities at which its partners are looked for.
    bands: Vec<Band>,
    /// Rows by which each view's picture lies lower than the reference view's, as far as the curves tell.
    lower: [f32; 3],
    /// Whether no view of the triple sways.
    is_steady: bool,
    /// Curves of the reference view by which pictures out of line are told.
    asked: Vec<u32>,
    nodes: Vec<Node>,
    nodes_before: Vec<Node>,
}

impl Curves {
    /// Takes in where the views of the next channels stand.
    pub(crate) fn begin(&mut self, triple: &Triple) {
        let own = triple.places[triple.reference];
        self.lower = triple.places.map(|place| triple.drift * (place - own));
        self.is_steady = triple.sway.iter().all(Sway::is_none);
    }

    /// The loop that closed from a curve of the reference view, in the channel matched last.
    pub(crate) fn closed(&self, label: u32) -> Option<&Closed> {
        self.closed.get(label as usize)?.as_ref()
    }

    /// Forgets the loops of the channel before.
    pub(crate) fn clear(&mut self, reference: CurvesView<'_>) {
        self.closed.clear();
        self.closed.resize(reference.curves.len(), None);
    }

    /// Finds the choices of all points of the reference view's matched curves.
    pub(crate) fn assign(&mut self, task: &Task<'_>, settings: &Settings, shared: &mut Shared) {
        let (all, s) = (settings, &settings.curves);
        let &Task {
            views,
            size,
            range,
            steps,
            width,
            has_coarser,
        } = task;
        let reference = views[steps.reference].curves;
        let ballot = Ballot {
            turn: all.orientation_tolerance.to_radians(),
            flat: all.flat.to_radians(),
            rows: s.vote_rows,
            lanes: Lanes {
                width: s.vote_cell,
                slope: s.slant_most,
            },
        };
        let closing = Closing {
            score: s.score,
            residual: s.loop_residual,
            tries: TRIES,
        };
        let reach = s.window_widths * width / 2.0;
        let mut bands = std::mem::take(&mut self.bands);
        bands.clear();
        bands.extend(reference.curves.iter().map(|curve| {
            let points = &reference.points[curve.range()];
            let predicted = match has_coarser {
                true => predicted(shared, points),
                false => s.initial_disparity,
            };
            Band::level(predicted.map_or(range, |disparity| beside(disparity, reach, range)))
        }));
        for view in (0..3).filter(|&view| steps.uses(view)) {
            self.place_rows(views, view, shared);
        }
        // What sways along a rail has been put right, frame by frame.
        let reach = if has_coarser { FINER } else { f32::INFINITY };
        let most = reach.min(s.window_rows / 2.0);
        if most >= FINEST && self.is_steady {
            self.align_rows(task, &bands, &ballot, most, shared);
        }
        self.nodes.clear();
        for (label, curve) in (0..).zip(reference.curves) {
            let seen = Views {
                views,
                rows: &shared.rows,
                lower: self.lower,
            };
            let band = &bands[label as usize];
            match self
                .closed_loop
                .close(seen, label, steps, band, &ballot, &closing)
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
                Err(reason) => shared.lost[curve.range()].fill(reason),
            }
        }
        self.bands = bands;
        let relation = Relation {
            radius: s.relation_radius,
            within: WITHIN,
            slope: SLOPE,
            strength: s.relation_strength,
            rounds: s.relation_rounds,
        };
        relation::relax(&mut self.nodes, &relation, &mut self.nodes_before);

        let pairing = Pairing {
            turn: ballot.turn,
            spread: s.vote_cell,
            miss: all.miss,
            flat: ballot.flat,
            rows: ballot.rows,
            gap: all.gap,
            filling: s.filling,
        };
        let seen = Views {
            views,
            rows: &shared.rows,
            lower: self.lower,
        };
        let closed = self.closed.iter_mut().zip(reference.curves);
        let matched = closed.filter(|(closed, _)| closed.is_some());
        for ((closed, curve), node) in matched.zip(&self.nodes) {
            let Some(found) = closed.filter(|_| node.certainty >= s.certainty) else {
                *closed = None;
                shared.lost[curve.range()].fill(Reason::Neighbours);
                continue;
            };
            let matched = Matched {
                sides: self.closed_loop.sides(seen),
                steps,
                closed: found,
                pairing: &pairing,
            };
            let (points, choices) = (
                &reference.points[curve.range()],
                &mut shared.choices[curve.range()],
            );
            matched.row_by_row(points, choices);
            for choice in choices.iter_mut() {
                choice.support = node.support;
            }
            let centroid = found.course.at(curve.y, curve.x);
            matched.fill(points, centroid, choices);
        }

        let around = &mut shared.around;
        around.clear(
            size,
            crate::NEIGHBOURS_CELL,
            crate::NEIGHBOURS_WITHIN,
            range,
        );
        for (edge, choice) in reference.points.iter().zip(&shared.choices) {
            if choice.is_seen() {
                around.add(edge.x, edge.y, choice.disparity);
            }
        }
        around.settle();
        for (edge, choice) in reference.points.iter().zip(&mut shared.choices) {
            if choice.is_some() {
                let (share, weight) = match choice.is_seen() {
                    true => around.agreement(edge.x, edge.y, choice.disparity),
                    false => around.agreement_with(edge.x, edge.y, choice.disparity),
                };
                choice.witnesses = share * weight;
            }
        }
    }

    /// Takes in the points of a view by the rows of the reference view.
    fn fill_rows(&mut self, task: &Task<'_>, view: usize, shared: &mut Shared) {
        let gain = shared.contrast.gain(view);
        let rows = &mut shared.rows[view];
        rows.fill(
            &task.views[view],
            task.size,
            self.lower[view],
            &Sway::NONE,
            gain,
        );
        self.place_rows(task.views, view, shared);
    }

    /// Notes where the points of a view lie.
    fn place_rows(&mut self, views: &[ChannelView<'_>; 3], view: usize, shared: &Shared) {
        let points = views[view].curves.points.len();
        self.closed_loop.fill(view, points, &shared.rows[view]);
    }
}

/// The average disparity that the coarser channel knows about a curve's points.
fn predicted(shared: &Shared, points: &[Edge]) -> Option<f32> {
    let asked = points.iter().step_by(ASKED);
    let known = asked.filter_map(|edge| shared.coarser.average(edge.x, edge.y));
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), known| (sum + known, count + 1.0));
    (count > 0.0).then(|| sum / count)
}
