//! Which entries of a table meet a curve where a course says, flat ones too, which have no column to vote with.

use messages::{Edge, Entry, NONE};

use super::{Ballot, Side, Way, place};
use crate::rows::turn;
use crate::thesis::course::Course;

/// Columns within which a contour along the rows has a point.
const NEAREST: f32 = 0.75;

/// By how many rows on the mean a curve lies lower than a table's entries where a course says; nothing where they do not
/// meet.
pub(super) fn lower(entries: &[Entry], way: &Way<'_>, curve: u32, course: &Course) -> Option<f32> {
    let (mut sum, mut met) = (0.0, 0.0);
    for entry in entries {
        let Some(edge) = way.from.view.curves.points.get(entry.point as usize) else {
            continue;
        };
        let row = edge.y - way.from.lower;
        let x = edge.x - way.steps * course.at(row, edge.x);
        let mut nearest: Option<&Edge> = None;
        about(
            way.to,
            row,
            x - NEAREST,
            x + NEAREST,
            way.ballot.rows,
            |point, own| {
                let there = &way.to.view.curves.points[point as usize];
                let is_nearer =
                    nearest.is_none_or(|other| (there.x - x).abs() < (other.x - x).abs());
                if own == curve && is_nearer {
                    nearest = Some(there);
                }
            },
        );
        if let Some(there) = nearest {
            sum += there.y - way.to.lower - row;
            met += 1.0;
        }
    }
    (met > 0.0).then(|| sum / met)
}

/// The weight of the entries that meet a point of the curve where the course says; of those that are flat only, if the
/// others were counted by their votes.
#[expect(
    clippy::too_many_arguments,
    reason = "what, from where to where, and how"
)]
pub(super) fn met(
    entries: &[Entry],
    from: &Side<'_>,
    to: &Side<'_>,
    curve: u32,
    steps: f32,
    course: &Course,
    flat_only: bool,
    ballot: &Ballot,
) -> f32 {
    let reach = ballot.lanes.width * steps.abs().max(1.0);
    let mut weight = 0.0;
    for entry in entries {
        let Some(edge) = from.view.curves.points.get(entry.point as usize) else {
            continue;
        };
        if flat_only && place(entry, from, ballot).is_some() {
            continue;
        }
        let row = edge.y - from.lower;
        let x = edge.x - steps * course.at(row, edge.x);
        let mut is_met = false;
        about(to, row, x - reach, x + reach, ballot.rows, |point, own| {
            let near = &to.view.curves.points[point as usize];
            is_met |= own == curve && turn(near.orientation, entry.orientation) <= ballot.turn;
        });
        if is_met {
            weight += entry.weight;
        }
    }
    weight
}

/// Calls `meet` with the points, and their curves, that lie between two columns at most so many rows from a row of the
/// reference view.
pub(crate) fn about(
    side: &Side<'_>,
    row: f32,
    left: f32,
    right: f32,
    reach: f32,
    mut meet: impl FnMut(u32, u32),
) {
    let tables = side.view.tables;
    let points = side.view.curves.points;
    let own = row + side.lower;
    let first = (own - reach).floor().max(0.0) as usize;
    let last = (own + reach).max(0.0) as usize;
    for row in first..=last {
        let Some(&[start, end]) = tables.rows.get(row..row + 2) else {
            return;
        };
        let order = &tables.order[start as usize..end as usize];
        let x = |&point: &u32| points[point as usize].x;
        let start = order.partition_point(|point| x(point) < left);
        for &point in order[start..].iter().take_while(|point| x(point) <= right) {
            let curve = side.rows.curve_of[point as usize];
            if curve != NONE && (points[point as usize].y - own).abs() <= reach {
                meet(point, curve);
            }
        }
    }
}
