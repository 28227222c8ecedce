//! The generalized Hough vote of a curve's R-table against the curves of another view.
//!
//! Epipolar lines are rows, so every entry of the table looks along its own row: a point q of the other view with an
//! orientation near θ votes for the reference point at q + r, that is for the disparity (x(e) − x(q)) / steps of q's
//! curve. Each curve that gets votes is a candidate; the fullest lane of its votes is where the curve would lie. Where a
//! contour is flat a vote says little about columns: such entries only say whether they are met there, and a curve that
//! has hardly any others is compared by centroid and length.

mod lowered;
mod meeting;

use messages::{Entry, NONE, Table};

use super::course::{Band, Course, Fullest, Lanes, Vote};
use crate::rows::{Rows, STEEPEST, is_flat, turn};
use crate::{ChannelView, Range};
pub(crate) use lowered::Lowered;
pub(crate) use meeting::about;
use meeting::{lower, met};

/// How votes are counted.
#[derive(Clone, Debug)]
pub(crate) struct Ballot {
    /// Radians within which orientations may differ.
    pub(crate) turn: f32,
    /// Radians from horizontal up to which a contour is flat.
    pub(crate) flat: f32,
    /// Rows by which the points of flat contours may differ.
    pub(crate) rows: f32,
    /// Lanes in which votes are counted.
    pub(crate) lanes: Lanes,
}

/// Where a curve was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Peak {
    /// The curve it is.
    pub(crate) curve: u32,
    /// Its displacement.
    pub(crate) course: Course,
    /// Votes, in the weight of the table.
    pub(crate) votes: f32,
    /// Votes by the weight of the shorter of the two, 0 to 1: a curve that is partly hidden in one view is whole there.
    pub(crate) score: f32,
}

/// A view in which curves are looked for, or from which they come.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Side<'a> {
    pub(crate) view: ChannelView<'a>,
    /// Its points by the rows of the reference view.
    pub(crate) rows: &'a Rows,
    /// Rows by which its picture lies lower than the reference view's.
    pub(crate) lower: f32,
    /// Per point its row and column in the reference view's rows; a negative row where it has none.
    pub(crate) places: &'a [(f32, f32)],
}

/// A search: from which view to which, how many steps to the right, at what disparities, and how votes are counted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way<'a> {
    pub(crate) from: &'a Side<'a>,
    pub(crate) to: &'a Side<'a>,
    pub(crate) steps: f32,
    pub(crate) band: &'a Band,
    pub(crate) ballot: &'a Ballot,
}

/// A vote of an entry for a curve.
#[derive(Clone, Copy, Debug)]
struct Cast {
    curve: u32,
    entry: u32,
    vote: Vote,
}

/// The count, with its memory.
#[derive(Debug, Default)]
pub(crate) struct Votes {
    cast: Vec<Cast>,
    own: Vec<Vote>,
    fullest: Fullest,
}

/// Share of its points that must not be flat for a curve to be found by their votes.
const STEEP: f32 = 0.2;

/// Points by which curves compared by their centroids may differ in length: as far as their ends are not the same, their
/// centroids are not, and a flat contour has nothing else to tell its disparity by.
const LENGTHS: u32 = 2;

/// Rows by which curves compared by their centroids may lie apart on the mean: a contour that falls by 10° lies a third of
/// a row lower where its ends, and so its centroid, are two pixels off.
const ROWS: f32 = 0.25;

impl Votes {
    /// Lets a table vote for the curves of another view, `steps` to the right, and gives each one's peak, the most votes
    /// first.
    pub(crate) fn count(&mut self, label: u32, way: &Way<'_>, least: f32, peaks: &mut Vec<Peak>) {
        let Way {
            from,
            to,
            steps,
            band,
            ballot,
        } = *way;
        peaks.clear();
        let Some((table, entries)) = table_of(from, label) else {
            return;
        };
        let middle = (table.y - from.lower, table.x);
        let steep = self.cast(entries, way);
        let found_by_votes = steep >= STEEP * table.weight;
        if !found_by_votes {
            self.cast_flat(entries, way);
        }
        self.cast
            .sort_unstable_by_key(|cast| (cast.curve, cast.entry));
        let mut cast = std::mem::take(&mut self.cast);
        for votes in cast.chunk_by(|a, b| a.curve == b.curve) {
            let curve = votes[0].curve;
            let Some((other, _)) = table_of(to, curve) else {
                continue;
            };
            let shorter = table.weight.min(other.weight);
            // Not even all of its votes would do.
            let most: f32 = votes
                .chunk_by(|a, b| a.entry == b.entry)
                .map(|votes| votes[0].vote.weight)
                .sum();
            if most + (table.weight - steep) < least * shorter {
                continue;
            }
            let course = if found_by_votes {
                self.own.clear();
                self.own.extend(votes.iter().map(|cast| cast.vote));
                self.fullest.lane(&self.own, band, middle, ballot.lanes)
            } else {
                let course = Course::level((table.x - other.x) / steps);
                let alike = table.count.abs_diff(other.count) <= LENGTHS
                    && lower(entries, way, curve, &course).is_some_and(|rows| rows.abs() <= ROWS);
                alike.then_some(course)
            };
            let Some(course) = course else {
                continue;
            };
            let mut agreeing: f32 = 0.0;
            if found_by_votes {
                for votes in votes.chunk_by(|a, b| a.entry == b.entry) {
                    let holds = |cast: &&Cast| ballot.lanes.hold(&cast.vote, &course);
                    agreeing += votes
                        .iter()
                        .find(holds)
                        .map_or(0.0, |cast| cast.vote.weight);
                }
            }
            agreeing += met(
                entries,
                from,
                to,
                curve,
                steps,
                &course,
                found_by_votes,
                ballot,
            );
            peaks.push(Peak {
                curve,
                course,
                votes: agreeing,
                score: (agreeing / shorter).min(1.0),
            });
        }
        cast.clear();
        self.cast = cast;
        peaks.sort_unstable_by(|a, b| b.votes.total_cmp(&a.votes).then(a.curve.cmp(&b.curve)));
    }

    /// Casts the votes of the entries that have a column in their row; gives what these entries weigh.
    fn cast(&mut self, entries: &[Entry], way: &Way<'_>) -> f32 {
        let Way {
            from,
            to,
            steps,
            band,
            ballot,
        } = *way;
        self.cast.clear();
        let mut steep = 0.0;
        for (number, entry) in (0..).zip(entries) {
            let Some((row, x)) = place(entry, from, ballot) else {
                continue;
            };
            steep += entry.weight;
            for (_, spot) in to.rows.within(row as usize, x, steps, band.at(row, x)) {
                if turn(spot.orientation, entry.orientation) <= ballot.turn
                    && !is_flat(spot.orientation, ballot.flat)
                {
                    self.cast.push(Cast {
                        curve: spot.curve,
                        entry: number,
                        vote: Vote {
                            row,
                            column: x,
                            disparity: (x - spot.x) / steps,
                            slant: spot.orientation.tan(),
                            weight: entry.weight,
                        },
                    });
                }
            }
        }
        steep
    }

    /// Casts votes of all entries for whatever lies about where they may be: of these only the curves count.
    fn cast_flat(&mut self, entries: &[Entry], way: &Way<'_>) {
        let Way {
            from,
            to,
            steps,
            band,
            ballot,
        } = *way;
        self.cast.clear();
        for (number, entry) in (0..).zip(entries) {
            let Some(edge) = from.view.curves.points.get(entry.point as usize) else {
                continue;
            };
            let row = edge.y - from.lower;
            let range = band.at(row, edge.x);
            let ends = [edge.x - steps * range.least, edge.x - steps * range.most];
            let (left, right) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            let mut last = NONE;
            about(to, row, left, right, ballot.rows, |point, curve| {
                let near = &to.view.curves.points[point as usize];
                if curve != last && turn(near.orientation, entry.orientation) <= ballot.turn {
                    last = curve;
                    let vote = Vote {
                        row,
                        column: edge.x,
                        disparity: (edge.x - near.x) / steps,
                        slant: 0.0,
                        weight: entry.weight,
                    };
                    self.cast.push(Cast {
                        curve,
                        entry: number,
                        vote,
                    });
                }
            });
        }
    }
}

/// A curve's table and its entries.
fn table_of<'a>(side: &Side<'a>, label: u32) -> Option<(&'a Table, &'a [Entry])> {
    let tables = side.view.tables;
    let table = tables.tables.get(label as usize)?;
    let first = table.first as usize;
    let entries = tables.entries.get(first..first + table.count as usize)?;
    Some((table, entries))
}

/// Row and column of an entry's point, where its contour is steep enough to have one.
fn place(entry: &Entry, from: &Side<'_>, ballot: &Ballot) -> Option<(f32, f32)> {
    let place = *from.places.get(entry.point as usize)?;
    (place.0 >= 0.0 && !is_flat(entry.orientation, ballot.flat)).then_some(place)
}

/// The range that reaches so far to both sides of a disparity, within another one.
pub(crate) fn beside(disparity: f32, reach: f32, range: Range) -> Range {
    Range {
        least: (disparity - reach).max(range.least),
        most: (disparity + reach).min(range.most),
    }
}

#[cfg(test)]
mod tests;
