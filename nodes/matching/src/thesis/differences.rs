//! Disparities inside a matched curve as in the thesis: differences of columns, row by row.

use messages::{Edge, NONE};

use super::closed_loop::Closed;
use super::settings::Filling;
use super::vote::{Side, about};
use crate::Range;
use crate::choice::Choice;
use crate::rows::{Spot, is_flat, turn};
use crate::triple::Steps;

/// Which points are partners inside matched curves.
#[derive(Clone, Debug)]
pub(crate) struct Pairing {
    /// Radians by which orientations may differ.
    pub(crate) turn: f32,
    /// Pixels of disparity around the one expected that points may have.
    pub(crate) spread: f32,
    /// Pixels by which the far view may miss what the near one predicts.
    pub(crate) miss: f32,
    /// Radians from horizontal up to which there is no one-to-one pair.
    pub(crate) flat: f32,
    /// Rows by which points of flat contours may differ.
    pub(crate) rows: f32,
    /// Points without a partner that are bridged.
    pub(crate) gap: usize,
    /// What points without a partner get.
    pub(crate) filling: Filling,
}

/// A matched curve in its views.
#[derive(Debug)]
pub(crate) struct Matched<'a> {
    pub(crate) sides: [Side<'a>; 3],
    pub(crate) steps: Steps,
    pub(crate) closed: Closed,
    pub(crate) pairing: &'a Pairing,
}

impl Matched<'_> {
    /// Finds the disparity of each point that has a partner in its row in every other view: where the curve's course
    /// says, and from there on along the curve, which need not lie in one plane.
    pub(crate) fn row_by_row(&self, edges: &[Edge], choices: &mut [Choice]) {
        for (edge, choice) in edges.iter().zip(choices.iter_mut()) {
            let expected = self.closed.course.at(edge.y, edge.x);
            *choice = self.seen(edge, expected).unwrap_or(Choice::NOTHING);
        }
        let mut last: Option<f32> = None;
        let mut follow = |at: usize, choices: &mut [Choice]| {
            if choices[at].is_some() {
                last = Some(choices[at].disparity);
            } else if let Some(seen) = last.and_then(|last| self.seen(&edges[at], last)) {
                choices[at] = seen;
                last = Some(seen.disparity);
            }
        };
        for at in 0..choices.len() {
            follow(at, choices);
        }
        for at in (0..choices.len()).rev() {
            follow(at, choices);
        }
    }

    /// A point's partners near an expected disparity, if every view has one.
    fn seen(&self, edge: &Edge, expected: f32) -> Option<Choice> {
        let Self {
            steps,
            closed,
            pairing,
            ..
        } = self;
        if !edge.is_in_row() || is_flat(edge.orientation, pairing.flat) {
            return None;
        }
        // The matched curve's own point, or, where the contour is broken elsewhere in that view, another one's that goes
        // on in its place.
        let partner = |view: usize, to: f32, reach: f32, expected: f32| {
            let range = Range {
                least: expected - reach,
                most: expected + reach,
            };
            let alike = self.sides[view]
                .rows
                .within(edge.y as usize, edge.x, to, range)
                .filter(|(_, spot)| turn(spot.orientation, edge.orientation) <= pairing.turn);
            let middle = edge.x - to * expected;
            alike.min_by(|a, b| {
                let [own_a, own_b] = [a, b].map(|near| near.1.curve != closed.curves[view]);
                let away = |near: &(usize, &Spot)| (near.1.x - middle).abs();
                own_a.cmp(&own_b).then(away(a).total_cmp(&away(b)))
            })
        };
        let (near, there) = partner(steps.near, steps.to_near, pairing.spread, expected)?;
        let short = (edge.x - there.x) / steps.to_near;
        let seen = Choice {
            disparity: short,
            cost: 1.0 - closed.score,
            spots: [near as u32, NONE],
            curves: [closed.curves[steps.near], closed.curves[steps.far]],
            run: 1,
            ..Choice::NOTHING
        };
        if !steps.third {
            return Some(seen);
        }
        let allowed = pairing.miss / steps.to_far.abs();
        let (far, beyond) = partner(steps.far, steps.to_far, allowed, short)?;
        let (disparity, bend) = steps.measure(steps.in_order(edge.x, there.x, beyond.x));
        Some(Choice {
            disparity,
            bend,
            spots: [near as u32, far as u32],
            ..seen
        })
    }

    /// Gives the points that have no partner a disparity: interpolated along the curve between pairs that agree, or, of a
    /// curve without any, its course's, as far as other views show such a contour there. As in the thesis, all get that of
    /// the centroid.
    pub(crate) fn fill(&self, edges: &[Edge], centroid: f32, choices: &mut [Choice]) {
        let Pairing {
            filling,
            gap,
            spread,
            ..
        } = *self.pairing;
        let mut last: Option<usize> = None;
        for at in 0..=choices.len() {
            let seen = choices.get(at).is_some_and(Choice::is_seen);
            if !seen && at < choices.len() {
                continue;
            }
            let start = last.map_or(0, |last| last + 1);
            let ends = (last.map(|last| choices[last]), choices.get(at).copied());
            for between in start..at {
                let edge = &edges[between];
                let disparity = match (filling, ends) {
                    (Filling::Centroid, _) => Some(centroid),
                    (Filling::Along, (Some(a), Some(b))) => {
                        let change = b.disparity - a.disparity;
                        let share = (between + 1 - start) as f32 / (at + 1 - start) as f32;
                        let along = a.disparity + share * change;
                        let agree = change.abs() <= spread;
                        (agree && (at - start <= gap || self.is_met(edge, along))).then_some(along)
                    }
                    (Filling::Along, (None, None)) => {
                        let course = self.closed.course.at(edge.y, edge.x);
                        self.is_met(edge, course).then_some(course)
                    }
                    // Beyond its last pair a contour may have gone over to another surface.
                    (Filling::Along, _) => None,
                };
                let alone = Choice {
                    cost: 1.0,
                    ..Choice::NOTHING
                };
                if let Some(disparity) = disparity {
                    choices[between] = Choice {
                        disparity,
                        spots: [NONE; 2],
                        curves: [NONE; 2],
                        ..ends.0.or(ends.1).unwrap_or(alone)
                    };
                }
            }
            last = Some(at);
        }
    }

    /// Whether a point that has no place in a row of its own is met in every other view where a disparity says.
    fn is_met(&self, edge: &Edge, disparity: f32) -> bool {
        let Self { steps, pairing, .. } = self;
        let has_place = edge.is_in_row() && !is_flat(edge.orientation, pairing.flat);
        let others = [(steps.near, steps.to_near), (steps.far, steps.to_far)];
        !has_place
            && others
                .into_iter()
                .filter(|&(view, _)| steps.uses(view))
                .all(|(view, to)| {
                    let (x, reach) = (edge.x - to * disparity, pairing.spread * to.abs());
                    let side = &self.sides[view];
                    let mut is_met = false;
                    about(
                        side,
                        edge.y,
                        x - reach,
                        x + reach,
                        pairing.rows,
                        |point, _| {
                            let there = side.view.curves.points[point as usize].orientation;
                            is_met |= turn(there, edge.orientation) <= pairing.turn;
                        },
                    );
                    is_met
                })
    }
}
