//! Disparities inside a matched curve as in the thesis: differences of columns, row by row.

use messages::{Edge, NONE};

use crate::Range;
use crate::along::Choice;
use crate::closed_loop::Closed;
use crate::course::Course;
use crate::rows::{Rows, Spot, is_flat, turn};
use crate::settings::Filling;
use crate::triple::Steps;

/// Which points are partners inside matched curves.
#[derive(Clone, Debug)]
pub(crate) struct Pairing {
    /// Radians by which orientations may differ.
    pub(crate) turn: f32,
    /// Pixels of disparity around the curve's own that points may have.
    pub(crate) spread: f32,
    /// Pixels by which the far view may miss what the near one predicts.
    pub(crate) miss: f32,
    /// Radians from horizontal up to which there is no one-to-one pair.
    pub(crate) flat: f32,
}

/// Finds the disparity of each point of a matched curve that has a partner in its row in every other curve.
pub(crate) fn row_by_row(
    edges: &[Edge],
    closed: &Closed,
    rows: &[Rows; 3],
    steps: Steps,
    pairing: &Pairing,
    choices: &mut [Choice],
) {
    for (edge, choice) in edges.iter().zip(choices) {
        *choice = Choice::NOTHING;
        if !edge.is_in_row() || is_flat(edge.orientation, pairing.flat) {
            continue;
        }
        let expected = closed.course.at(edge.y, edge.x);
        // The matched curve's own point, or, where the contour is broken elsewhere in that view, another one's that goes
        // on in its place.
        let partner = |view: usize, to: f32, reach: f32, expected: f32| {
            let range = Range {
                least: expected - reach,
                most: expected + reach,
            };
            let alike = rows[view]
                .within(edge.y as usize, edge.x, to, range)
                .filter(|(_, spot)| turn(spot.orientation, edge.orientation) <= pairing.turn);
            let middle = edge.x - to * expected;
            let nearest = alike.min_by(|a, b| {
                let [own_a, own_b] = [a, b].map(|near| near.1.curve != closed.curves[view]);
                let away = |near: &(usize, &Spot)| (near.1.x - middle).abs();
                own_a.cmp(&own_b).then(away(a).total_cmp(&away(b)))
            });
            nearest.map(|(index, _)| index)
        };
        let reach = pairing.spread;
        let near = partner(steps.near, steps.to_near, reach, expected);
        let Some(near) = near else {
            continue;
        };
        let short = (edge.x - rows[steps.near].spots[near].x) / steps.to_near;
        let seen = Choice {
            disparity: short,
            cost: 1.0 - closed.score,
            margin: 0.0,
            bend: 0.0,
            spots: [near as u32, NONE],
            curves: [closed.curves[steps.near], closed.curves[steps.far]],
            run: 1,
            support: 0.0,
            witnesses: 0.0,
            repeats: false,
        };
        if !steps.third {
            *choice = seen;
            continue;
        }
        let allowed = pairing.miss / steps.to_far.abs();
        let Some(far) = partner(steps.far, steps.to_far, allowed, short) else {
            continue;
        };
        let xs = steps.in_order(
            edge.x,
            rows[steps.near].spots[near].x,
            rows[steps.far].spots[far].x,
        );
        let (disparity, bend) = steps.measure(xs);
        *choice = Choice {
            disparity,
            bend,
            spots: [near as u32, far as u32],
            ..seen
        };
    }
}

/// Gives the points of a matched curve that have no pair the curve's disparity: interpolated along the curve, and from its
/// last pair on as its course goes on; or, as in the thesis, that of the centroid.
pub(crate) fn fill_whole(
    edges: &[Edge],
    choices: &mut [Choice],
    filling: Filling,
    course: &Course,
    centroid: f32,
) {
    let filled = |disparity: f32, like: Choice| Choice {
        disparity,
        spots: [NONE; 2],
        curves: [NONE; 2],
        ..like
    };
    let mut last: Option<usize> = None;
    for at in 0..=choices.len() {
        let seen = choices.get(at).is_some_and(Choice::is_seen);
        if !seen && at < choices.len() {
            continue;
        }
        let start = last.map_or(0, |last| last + 1);
        for between in start..at {
            let before = last.map(|last| choices[last]);
            let after = choices.get(at).copied();
            let like = before.or(after).unwrap_or(Choice {
                cost: 1.0,
                ..Choice::NOTHING
            });
            let course = |at: usize| course.at(edges[at].y, edges[at].x);
            let beside = |at: usize, seen: Choice| seen.disparity + course(between) - course(at);
            let disparity = match (filling, before, after) {
                (Filling::Centroid, ..) => centroid,
                (Filling::Along, Some(a), Some(b)) => {
                    let share = (between + 1 - start) as f32 / (at + 1 - start) as f32;
                    a.disparity + share * (b.disparity - a.disparity)
                }
                (Filling::Along, Some(a), None) => beside(start - 1, a),
                (Filling::Along, None, Some(b)) => beside(at, b),
                (Filling::Along, None, None) => course(between),
            };
            choices[between] = filled(disparity, like);
        }
        last = Some(at);
    }
}
