//! The generalized Hough vote of a curve's R-table against the curves of another view.
//!
//! Epipolar lines are rows, so every entry of the table looks along its own row: a point q of the other view with an
//! orientation near θ votes for the reference point at q + r, that is for the disparity (x(e) − x(q)) / steps of q's
//! curve. Each curve that gets votes is a candidate; the fullest lane of its votes is where the curve would lie. Where a
//! contour is flat a vote says little about columns: such entries only say whether they are met there, and a curve that
//! has hardly any others is compared by centroid and length.

use messages::{Edge, Entry, NONE, Table};

use crate::course::{Band, Course, Fit, Fullest, Lanes, Vote};
use crate::rows::{Rows, STEEPEST, is_flat, turn};
use crate::{ChannelView, Range};

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

/// Columns within which a contour along the rows has a point.
const NEAREST: f32 = 0.75;

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

    /// Takes the votes of a curve for the curve that agrees best with one course, those in the middle of the lane counting
    /// most: how well they agree, and by how many rows more the other view's picture would have to lie lower for them to
    /// agree better.
    pub(crate) fn agreement(&mut self, label: u32, way: &Way<'_>) -> Lowered {
        let Way {
            from,
            steps,
            band,
            ballot,
            ..
        } = *way;
        let Some((table, entries)) = table_of(from, label) else {
            return Lowered::default();
        };
        self.cast(entries, way);
        self.cast
            .sort_unstable_by_key(|cast| (cast.curve, cast.entry));
        let middle = (table.y - from.lower, table.x);
        let mut best = Lowered::default();
        for votes in self.cast.chunk_by(|a, b| a.curve == b.curve) {
            self.own.clear();
            self.own.extend(votes.iter().map(|cast| cast.vote));
            if let Some(course) = self.fullest.lane(&self.own, band, middle, ballot.lanes) {
                let found = Lowered::of(&self.own, &course, ballot.lanes, steps);
                if found.agreement > best.agreement {
                    best = found;
                }
            }
        }
        best
    }
}

/// What a curve's votes say about the rows of another view's picture.
///
/// Where that lies δ rows lower than assumed, a contour is met δ·tan θ to the right of where it should be, θ being its
/// gradient's direction: by that its disparities are less, divided by the steps. What of it a plane takes up cannot be
/// told from a slant of the surface; the rest, regressed on tan θ, tells δ.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lowered {
    /// Votes, those in the middle of the lane counting most.
    pub(crate) agreement: f32,
    /// Sum of tan θ times what disparities are beyond, both beside their planes, …
    pub(crate) both: f32,
    /// … and of its square.
    pub(crate) squares: f32,
}

impl Lowered {
    fn of(votes: &[Vote], course: &Course, lanes: Lanes, steps: f32) -> Self {
        let (mut slants, mut offs) = (Fit::default(), Fit::default());
        let inside = |vote: &&Vote| lanes.hold(vote, course);
        let place = |vote: &Vote| (vote.row - course.row, vote.column - course.column);
        let slant = |vote: &Vote| vote.slant.clamp(-STEEPEST, STEEPEST);
        let mut found = Self::default();
        for vote in votes.iter().filter(inside) {
            let (y, x) = place(vote);
            let off = vote.beyond(course);
            slants.add(vote.weight, y, x, slant(vote));
            offs.add(vote.weight, y, x, off);
            let share = off / (lanes.width / 2.0);
            found.agreement += vote.weight * (1.0 - share * share);
        }
        // Planes that take up all they can, or nothing but the mean where lanes are level.
        let least = if lanes.slope > 0.0 {
            0.1
        } else {
            f32::INFINITY
        };
        let (Some(slants), Some(offs)) = (slants.plane(least), offs.plane(least)) else {
            return found;
        };
        let beside = |plane: (f32, f32, f32), (y, x)| plane.0 + plane.1 * y + plane.2 * x;
        for vote in votes.iter().filter(inside) {
            let slant = slant(vote) - beside(slants, place(vote));
            let off = vote.beyond(course) - beside(offs, place(vote));
            found.both -= vote.weight * slant * off * steps;
            found.squares += vote.weight * slant * slant;
        }
        found
    }
}

impl std::ops::AddAssign for Lowered {
    fn add_assign(&mut self, other: Self) {
        self.agreement += other.agreement;
        self.both += other.both;
        self.squares += other.squares;
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

/// By how many rows on the mean a curve lies lower than a table's entries where a course says; nothing where they do not
/// meet.
fn lower(entries: &[Entry], way: &Way<'_>, curve: u32, course: &Course) -> Option<f32> {
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
fn met(
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

/// The range that reaches so far to both sides of a disparity, within another one.
pub(crate) fn beside(disparity: f32, reach: f32, range: Range) -> Range {
    Range {
        least: (disparity - reach).max(range.least),
        most: (disparity + reach).min(range.most),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Curve, CurvesView, Edge, Size, Sway, TablesView};

    const SIZE: Size = Size::new(100, 40);

    fn chance(seed: u32) -> f32 {
        let mixed = (u64::from(seed) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32
            / (1u64 << 24) as f32
    }

    /// A view of curves, with its index of rows and its R-tables.
    struct Seen {
        curves: Vec<Curve>,
        points: Vec<Edge>,
        tables: Vec<Table>,
        entries: Vec<Entry>,
        rows: Vec<u32>,
        order: Vec<u32>,
    }

    impl Seen {
        fn of(lines: &[Vec<Edge>]) -> Self {
            let points: Vec<Edge> = lines.iter().flatten().copied().collect();
            let (mut curves, mut tables, mut entries) = (Vec::new(), Vec::new(), Vec::new());
            for (label, line) in (0..).zip(lines) {
                let mean =
                    |of: fn(&Edge) -> f32| line.iter().map(of).sum::<f32>() / line.len() as f32;
                let (x, y) = (mean(|e| e.x), mean(|e| e.y));
                let (first, count) = (entries.len() as u32, line.len() as u32);
                curves.push(Curve {
                    label,
                    first,
                    count,
                    x,
                    y,
                    ..Curve::default()
                });
                let weight = line.len() as f32;
                tables.push(Table {
                    curve: label,
                    first,
                    count,
                    x,
                    y,
                    weight,
                });
                entries.extend((first..).zip(line).map(|(point, edge)| Entry {
                    orientation: edge.orientation,
                    rx: x - edge.x,
                    ry: y - edge.y,
                    weight: 1.0,
                    point,
                }));
            }
            let mut order: Vec<u32> = (0..points.len() as u32).collect();
            order.sort_by(|&a, &b| {
                let [a, b] = [a, b].map(|i| &points[i as usize]);
                (a.y as u32).cmp(&(b.y as u32)).then(a.x.total_cmp(&b.x))
            });
            let before = |row: u32| points.iter().filter(|p| (p.y as u32) < row).count() as u32;
            let rows = (0..=SIZE.height).map(before).collect();
            Self {
                curves,
                points,
                tables,
                entries,
                rows,
                order,
            }
        }

        fn view(&self) -> ChannelView<'_> {
            ChannelView {
                curves: CurvesView {
                    curves: &self.curves,
                    points: &self.points,
                },
                tables: TablesView {
                    tables: &self.tables,
                    entries: &self.entries,
                    rows: &self.rows,
                    order: &self.order,
                },
            }
        }
    }

    /// The peaks of a curve of one view in another one.
    fn peaks(
        label: u32,
        from: &Seen,
        to: &Seen,
        steps: f32,
        range: Range,
        ballot: &Ballot,
    ) -> Vec<Peak> {
        let [(from, a), (to, b)] = [from, to].map(|seen| {
            let mut rows = Rows::default();
            rows.fill(&seen.view(), SIZE, 0.0, &Sway::NONE, 1.0);
            (seen, rows)
        });
        let places = |seen: &Seen| -> Vec<(f32, f32)> {
            let place = |e: &Edge| (if e.is_in_row() { e.y } else { -1.0 }, e.x);
            seen.points.iter().map(place).collect()
        };
        let [of_a, of_b] = [from, to].map(places);
        let from = Side {
            view: from.view(),
            rows: &a,
            lower: 0.0,
            places: &of_a,
        };
        let to = Side {
            view: to.view(),
            rows: &b,
            lower: 0.0,
            places: &of_b,
        };
        let mut peaks = Vec::new();
        let way = Way {
            from: &from,
            to: &to,
            steps,
            band: &Band::level(range),
            ballot,
        };
        Votes::default().count(label, &way, 0.0, &mut peaks);
        peaks
    }

    const BALLOT: Ballot = Ballot {
        turn: 0.6,
        flat: 0.05,
        rows: 1.0,
        lanes: Lanes {
            width: 1.5,
            slope: 0.0,
        },
    };

    const RANGE: Range = Range {
        least: 0.0,
        most: 25.0,
    };

    #[test]
    fn votes_are_those_of_every_entry_against_every_point_of_its_row() {
        let scatter = |seed: u32, from: f32| -> Vec<Vec<Edge>> {
            let point = |i: u32| Edge {
                x: from + 60.0 * chance(3 * i + seed),
                y: (39.0 * chance(3 * i + 1 + seed)).floor(),
                orientation: 3.0 - 6.0 * chance(3 * i + 2 + seed),
                ..Edge::default()
            };
            (0..3)
                .map(|k| (80 * k..80 * k + 80).map(point).collect())
                .collect()
        };
        let (from, to) = (Seen::of(&scatter(0, 20.0)), Seen::of(&scatter(9000, 10.0)));
        for (steps, label) in [(1.0, 0), (2.0, 1), (-1.0, 2), (0.5, 0)] {
            let found = peaks(label, &from, &to, steps, RANGE, &BALLOT);
            assert_eq!(found.len(), 3, "every curve got some votes");
            assert!(found.is_sorted_by(|a, b| a.votes >= b.votes));
            for peak in found {
                let agrees = |e: &&Edge| {
                    to.points[to.curves[peak.curve as usize].range()]
                        .iter()
                        .any(|q| {
                            let flat =
                                [e.orientation, q.orientation].map(|o| is_flat(o, BALLOT.flat));
                            let off = (e.x - q.x) / steps - peak.course.disparity;
                            flat == [false; 2]
                                && q.y == e.y
                                && turn(q.orientation, e.orientation) <= BALLOT.turn
                                && RANGE.contains((e.x - q.x) / steps)
                                && off.abs() <= 0.75
                        })
                };
                let own = &from.points[from.curves[label as usize].range()];
                let twin = own.iter().filter(agrees).count() as f32;
                let flat = own
                    .iter()
                    .filter(|e| is_flat(e.orientation, BALLOT.flat))
                    .count() as f32;
                assert!(
                    (twin..=twin + flat).contains(&peak.votes),
                    "{twin} {flat} {peak:?}"
                );
                assert_eq!(peak.score, peak.votes / 80.0);
            }
        }
    }

    /// A contour that runs along the rows, from one column to another.
    fn flat(row: f32, columns: std::ops::Range<u32>) -> Vec<Edge> {
        let point = |x: u32| Edge {
            x: x as f32,
            y: row,
            orientation: std::f32::consts::FRAC_PI_2,
            ..Edge::default()
        };
        columns.map(point).collect()
    }

    #[test]
    fn a_flat_curve_is_found_by_its_centroid_if_it_is_as_long() {
        let from = Seen::of(&[flat(10.5, 40..80)]);
        let to = Seen::of(&[flat(10.75, 30..70), flat(10.25, 40..60), flat(20.5, 30..70)]);
        let found = peaks(0, &from, &to, 1.0, RANGE, &BALLOT);
        assert_eq!(
            found.len(),
            1,
            "the second is half as long, the third lies elsewhere"
        );
        assert_eq!((found[0].curve, found[0].course.disparity), (0, 10.0));
        assert_eq!(found[0].score, 1.0);
    }

    #[test]
    fn a_nearly_flat_curve_that_ends_elsewhere_along_its_line_is_not_taken_by_its_centroid() {
        let falling = |line: f32, columns: std::ops::Range<u32>| -> Vec<Edge> {
            let point = |x: u32| Edge {
                x: x as f32,
                y: 10.05 + 0.17 * (x as f32 - line),
                orientation: std::f32::consts::FRAC_PI_2 - 0.17,
                ..Edge::default()
            };
            columns.map(point).collect()
        };
        let from = Seen::of(&[falling(40.0, 40..80)]);
        let same = Seen::of(&[falling(30.0, 30..70)]);
        let found = peaks(0, &from, &same, 1.0, RANGE, &BALLOT);
        assert_eq!((found.len(), found[0].course.disparity), (1, 10.0));
        let further = Seen::of(&[falling(30.0, 32..72)]);
        assert_eq!(peaks(0, &from, &further, 1.0, RANGE, &BALLOT), []);
    }

    #[test]
    fn a_curve_that_is_partly_hidden_has_all_the_votes_of_what_is_left_of_it() {
        let line = |rows: std::ops::Range<u32>, x: f32| -> Vec<Edge> {
            rows.map(|row| Edge {
                x,
                y: row as f32,
                ..Edge::default()
            })
            .collect()
        };
        let whole = Seen::of(&[line(2..38, 50.0)]);
        let hidden = Seen::of(&[line(20..38, 42.0)]);
        for (from, to, steps) in [(&whole, &hidden, 1.0), (&hidden, &whole, -1.0)] {
            let found = peaks(0, from, to, steps, RANGE, &BALLOT);
            assert_eq!((found[0].votes, found[0].score), (18.0, 1.0));
            assert!((found[0].course.disparity - 8.0).abs() < 0.2, "{found:?}");
        }
    }
}
