//! The generalized Hough vote of a curve's R-table against the curves of another view.
//!
//! Epipolar lines are rows, so the accumulator is one-dimensional in disparity and a few rows thick. The point e of
//! the table and a point q of the other view with an orientation near θ(e), not more than a few rows away, vote for
//! the reference point at q + r, that is for the disparity (x(e) − x(q)) / steps. An entry votes for a disparity at most
//! once, so that the score S = A / L, votes by the table's weight, lies between 0 and 1.

use messages::{Entry, NONE, Table};

use crate::rows::turn;
use crate::{ChannelView, Range};

/// How votes are counted.
#[derive(Clone, Debug)]
pub(crate) struct Ballot {
    /// Radians within which orientations may differ.
    pub(crate) turn: f32,
    /// Rows by which points may differ.
    pub(crate) rows: u32,
    /// Pixels of disparity a cell is wide; a vote counts for its cell and the two beside it.
    pub(crate) cell: f32,
}

/// Where a curve was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Peak {
    /// The curve it is.
    pub(crate) curve: u32,
    /// Its displacement, in pixels of disparity between neighbouring views.
    pub(crate) disparity: f32,
    /// Votes by the table's weight, 0 to 1.
    pub(crate) score: f32,
}

/// The accumulator, a line of cells for each candidate curve.
#[derive(Debug, Default)]
pub(crate) struct Votes {
    cells: Vec<Cell>,
    /// Per curve of the other view its line, or [`NONE`].
    lines: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Cell {
    votes: f32,
    disparities: f32,
    /// The entry that voted here last.
    voter: u32,
}

impl Votes {
    /// Lets a table vote for the candidate curves of another view, `steps` to the right, and gives each one's peak,
    /// the best first.
    #[expect(
        clippy::too_many_arguments,
        reason = "a table, its rivals, where, how, and where to"
    )]
    pub(crate) fn count(
        &mut self,
        table: &Table,
        entries: &[Entry],
        other: &ChannelView<'_>,
        curve_of: &[u32],
        candidates: &[u32],
        steps: f32,
        range: Range,
        ballot: &Ballot,
        peaks: &mut Vec<Peak>,
    ) {
        peaks.clear();
        let width = ((range.most - range.least) / ballot.cell).ceil().max(0.0) as usize + 3;
        self.lines
            .resize(self.lines.len().max(other.curves.curves.len()), NONE);
        self.cells.clear();
        self.cells.resize(
            candidates.len() * width,
            Cell {
                votes: 0.0,
                disparities: 0.0,
                voter: NONE,
            },
        );
        for (line, &curve) in (0..).zip(candidates) {
            self.lines[curve as usize] = line;
        }
        let reach = (range.least * steps, range.most * steps);
        for (voter, entry) in (0..).zip(entries) {
            let (x, y) = (table.x - entry.rx, table.y - entry.ry);
            let (left, right) = (x - reach.0.max(reach.1), x - reach.0.min(reach.1));
            let row = (y + 0.01).max(0.0) as u32;
            // Its own row first: an entry's one vote for a cell goes to the nearest point.
            let others =
                (1..=ballot.rows).flat_map(|away| [row.checked_sub(away), Some(row + away)]);
            for row in std::iter::once(row).chain(others.flatten()) {
                for &point in row_between(other, row, left, right) {
                    let line = match curve_of[point as usize] {
                        NONE => NONE,
                        curve => self.lines[curve as usize],
                    };
                    let edge = &other.curves.points[point as usize];
                    if line == NONE || turn(edge.orientation, entry.orientation) > ballot.turn {
                        continue;
                    }
                    let disparity = (x - edge.x) / steps;
                    let cell = ((disparity - range.least) / ballot.cell).max(0.0) as usize + 1;
                    let first = line as usize * width + cell.min(width - 2) - 1;
                    for cell in &mut self.cells[first..first + 3] {
                        if cell.voter != voter {
                            cell.voter = voter;
                            cell.votes += entry.weight;
                            cell.disparities += entry.weight * disparity;
                        }
                    }
                }
            }
        }
        for (line, &curve) in candidates.iter().enumerate() {
            self.lines[curve as usize] = NONE;
            let mut best = Cell {
                votes: 0.0,
                disparities: 0.0,
                voter: NONE,
            };
            for cell in &self.cells[line * width..(line + 1) * width] {
                if cell.votes > best.votes {
                    best = *cell;
                }
            }
            if best.votes > 0.0 {
                let score = (best.votes / table.weight).min(1.0);
                peaks.push(Peak {
                    curve,
                    disparity: best.disparities / best.votes,
                    score,
                });
            }
        }
        peaks.sort_unstable_by(|a, b| b.score.total_cmp(&a.score).then(a.curve.cmp(&b.curve)));
    }
}

/// The points of a row from one column to another.
fn row_between<'a>(view: &ChannelView<'a>, row: u32, left: f32, right: f32) -> &'a [u32] {
    let Some(&[start, end]) = view.tables.rows.get(row as usize..row as usize + 2) else {
        return &[];
    };
    let row = &view.tables.order[start as usize..end as usize];
    let x = |&point: &u32| view.curves.points[point as usize].x;
    let start = row.partition_point(|point| x(point) < left);
    let len = row[start..].partition_point(|point| x(point) <= right);
    &row[start..start + len]
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Curve, CurvesView, Edge, TablesView};

    fn chance(seed: u32) -> f32 {
        let mixed = (u64::from(seed) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32
            / (1u64 << 24) as f32
    }

    /// Points anywhere, three curves that share them in turn, and the index of rows.
    struct Other {
        curves: Vec<Curve>,
        points: Vec<Edge>,
        rows: Vec<u32>,
        order: Vec<u32>,
        curve_of: Vec<u32>,
    }

    fn other() -> Other {
        let points: Vec<Edge> = (0..240)
            .map(|i| Edge {
                x: 100.0 * chance(3 * i),
                y: (40.0 * chance(3 * i + 1)).floor(),
                orientation: 3.0 - 6.0 * chance(3 * i + 2),
                ..Edge::default()
            })
            .collect();
        let curves = (0..3)
            .map(|k| Curve {
                label: k,
                first: 80 * k,
                count: 80,
                ..Curve::default()
            })
            .collect();
        let mut order: Vec<u32> = (0..240).collect();
        order.sort_by(|&a, &b| {
            let key = |i: u32| (points[i as usize].y, points[i as usize].x);
            key(a)
                .0
                .total_cmp(&key(b).0)
                .then(key(a).1.total_cmp(&key(b).1))
        });
        let before = |row: u32| points.iter().filter(|p| (p.y as u32) < row).count() as u32;
        let rows = (0..=40).map(before).collect();
        Other {
            curves,
            rows,
            order,
            curve_of: (0..240).map(|i| i / 80).collect(),
            points,
        }
    }

    /// Every entry against every point, cell by cell, without an index.
    fn slowly(
        table: &Table,
        entries: &[Entry],
        other: &Other,
        curve: u32,
        steps: f32,
        range: Range,
        ballot: &Ballot,
    ) -> Option<(f32, f32)> {
        let cells = ((range.most - range.least) / ballot.cell).ceil() as i32 + 3;
        let mut best: Option<(f32, f32)> = None;
        for cell in 0..cells {
            let (mut votes, mut sum) = (0.0, 0.0);
            for entry in entries {
                let (x, y) = (table.x - entry.rx, table.y - entry.ry);
                let mut seen: Vec<(f32, f32, f32)> = Vec::new();
                for (point, &label) in other.points.iter().zip(&other.curve_of) {
                    let disparity = (x - point.x) / steps;
                    let place = ((disparity - range.least) / ballot.cell).max(0.0) as i32 + 1;
                    let near = (point.y - y.round()).abs() <= ballot.rows as f32
                        && (place.min(cells - 2) - cell).abs() <= 1;
                    let inside = disparity >= range.least && disparity <= range.most;
                    if label == curve
                        && near
                        && inside
                        && turn(point.orientation, entry.orientation) <= ballot.turn
                    {
                        seen.push((point.y, point.x, disparity));
                    }
                }
                // The nearest row, then the upper one, then the leftmost point has the entry's one vote.
                let away = |row: f32| (row - y.round()).abs();
                seen.sort_by(|a, b| {
                    away(a.0)
                        .total_cmp(&away(b.0))
                        .then(a.0.total_cmp(&b.0))
                        .then(a.1.total_cmp(&b.1))
                });
                if let Some(&(_, _, disparity)) = seen.first() {
                    votes += entry.weight;
                    sum += entry.weight * disparity;
                }
            }
            if votes > best.map_or(0.0, |best| best.0) {
                best = Some((votes, sum / votes));
            }
        }
        best.map(|(votes, disparity)| (votes / table.weight, disparity))
    }

    #[test]
    fn votes_are_those_of_every_entry_against_every_point() {
        let other = other();
        let view = ChannelView {
            curves: CurvesView {
                curves: &other.curves,
                points: &other.points,
            },
            tables: TablesView {
                tables: &[],
                entries: &[],
                rows: &other.rows,
                order: &other.order,
            },
        };
        let entries: Vec<Entry> = (0..40)
            .map(|i| Entry {
                orientation: 3.0 - 6.0 * chance(9000 + i),
                rx: 20.0 * chance(7000 + i) - 10.0,
                ry: (20.0 * chance(8000 + i)).floor() - 10.0,
                weight: 0.5 + chance(6000 + i),
                point: i,
            })
            .collect();
        let weight = entries.iter().map(|entry| entry.weight).sum();
        let table = Table {
            x: 60.0,
            y: 20.0,
            weight,
            ..Table::default()
        };
        let range = Range {
            least: 0.0,
            most: 25.0,
        };
        let mut votes = Votes::default();
        let mut peaks = Vec::new();
        for (steps, rows) in [(1.0, 1), (2.0, 0), (-1.0, 2), (-2.0, 1)] {
            let ballot = Ballot {
                turn: 0.6,
                rows,
                cell: 1.0,
            };
            votes.count(
                &table,
                &entries,
                &view,
                &other.curve_of,
                &[0, 2],
                steps,
                range,
                &ballot,
                &mut peaks,
            );
            assert!(
                peaks.iter().all(|peak| peak.curve != 1),
                "no candidate, no votes"
            );
            assert!(peaks.is_sorted_by(|a, b| a.score >= b.score));
            for curve in [0, 2] {
                let found = peaks
                    .iter()
                    .find(|peak| peak.curve == curve)
                    .map(|peak| (peak.score, peak.disparity));
                let expected = slowly(&table, &entries, &other, curve, steps, range, &ballot);
                let (Some(found), Some(expected)) = (found, expected) else {
                    assert_eq!(found, expected);
                    continue;
                };
                assert!(
                    (found.0 - expected.0).abs() < 1e-5,
                    "{found:?} {expected:?} steps {steps}"
                );
                assert!(
                    (found.1 - expected.1).abs() < 1e-3,
                    "{found:?} {expected:?} steps {steps}"
                );
            }
        }
    }
}
