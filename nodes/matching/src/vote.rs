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
    #[expect(clippy::too_many_arguments, reason = "a table, its rivals, where, how, and where to")]
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
        self.lines.resize(self.lines.len().max(other.curves.curves.len()), NONE);
        self.cells.clear();
        self.cells.resize(candidates.len() * width, Cell { votes: 0.0, disparities: 0.0, voter: NONE });
        for (line, &curve) in (0..).zip(candidates) {
            self.lines[curve as usize] = line;
        }
        let reach = (range.least * steps, range.most * steps);
        for (voter, entry) in (0..).zip(entries) {
            let (x, y) = (table.x - entry.rx, table.y - entry.ry);
            let (left, right) = (x - reach.0.max(reach.1), x - reach.0.min(reach.1));
            let row = (y + 0.01).max(0.0) as u32;
            for row in row.saturating_sub(ballot.rows)..=row + ballot.rows {
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
            let mut best = Cell { votes: 0.0, disparities: 0.0, voter: NONE };
            for cell in &self.cells[line * width..(line + 1) * width] {
                if cell.votes > best.votes {
                    best = *cell;
                }
            }
            if best.votes > 0.0 {
                let score = (best.votes / table.weight).min(1.0);
                peaks.push(Peak { curve, disparity: best.disparities / best.votes, score });
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
