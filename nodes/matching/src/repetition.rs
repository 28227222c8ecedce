//! Where the reference view's own rows repeat themselves: fences, bricks, stripes.
//!
//! Every point votes for the distances at which its row shows a like point, and cells collect the votes of their
//! surroundings. Chance spreads them over all distances; a pattern of period P gathers them at P, 2P, …, and leaves the
//! distances between empty. One side of a point is enough to be like another: before a background that moves otherwise
//! the other side is no part of the pattern.

use messages::Size;

use crate::candidates::Likeness;
use crate::rows::{Rows, Spot, around, is_flat};

/// Columns and rows a cell measures.
const CELL: f32 = 32.0;
/// Rows of which one votes.
const EVERY: usize = 3;
/// Points whose better sides cost more than this are not like each other.
const UNLIKE: f32 = 0.7;
/// Columns of distance below which nothing votes: a contour's own neighbours.
const NEXT: f32 = 3.0;
/// Columns of a period below which a coarser channel's prediction keeps its aliases apart.
const FINE: f32 = 9.0;
/// Share of the points that recur at a period which recur at a part of it where that is the true one.
const AS_MANY: f32 = 0.7;
/// Votes between two multiples of a period count so many times against it.
const BETWEEN: f32 = 1.0;
/// Points in and around a cell below which nothing is said.
const FEW: f32 = 10.0;
/// Columns by which the next of a row of likes may miss its place.
const MISS: f32 = 2.0;
/// Columns beside the border in which points are not found reliably.
pub(crate) const BORDER: f32 = 8.0;

/// Votes for distances by place, with their memory.
#[derive(Debug, Default)]
pub(crate) struct Repetition {
    columns: usize,
    lines: usize,
    bins: usize,
    /// Cell by cell, one bin a column of distance.
    votes: Vec<f32>,
    points: Vec<f32>,
    /// The same, summed over three by three cells and three bins, as shares of the points there.
    shares: Vec<f32>,
    totals: Vec<f32>,
    /// Whether a cell has a distance that enough points share.
    repeats: Vec<bool>,
    reach: f32,
    share: f32,
    ratio: f32,
}

impl Repetition {
    /// Looks for patterns of a period of up to `reach` columns that at least this share of the points around a place take
    /// part in. What does not recur at `ratio` periods as well, as far as the far view is from the near one, has no alias
    /// in both of them.
    pub(crate) fn measure(
        &mut self,
        own: &Rows,
        like: &Likeness,
        size: Size,
        (reach, ratio, share): (f32, f32, f32),
    ) {
        (self.reach, self.ratio, self.share) = (reach, ratio, share);
        // A margin of a cell and of a bin, so that sums need no borders.
        self.columns = (size.width as f32 / CELL) as usize + 3;
        self.lines = (size.height as f32 / CELL) as usize + 3;
        self.bins = reach as usize + 3;
        let cells = self.columns * self.lines;
        for (room, length) in [
            (&mut self.votes, cells * self.bins),
            (&mut self.shares, cells * self.bins),
            (&mut self.points, cells),
            (&mut self.totals, cells),
        ] {
            room.clear();
            room.resize(length, 0.0);
        }
        self.repeats.clear();
        self.repeats.resize(cells, false);
        if share >= 1.0 {
            return;
        }
        for row in (0..own.count()).step_by(EVERY) {
            self.vote(own, like, row);
        }
        for line in 1..self.lines - 1 {
            for column in 1..self.columns - 1 {
                self.sum(line * self.columns + column);
            }
        }
    }

    fn vote(&mut self, own: &Rows, like: &Likeness, row: usize) {
        for spot in &own.spots[own.row(row)] {
            if is_flat(spot.orientation, like.flat) {
                continue;
            }
            let here = self.cell(spot.x, row);
            self.points[here] += 1.0;
            let columns = [spot.x + NEXT, spot.x + self.reach];
            for (_, other) in own.facing(row, columns, (spot.orientation, like.turn)) {
                if is_like(like, spot, other) {
                    let bin = self.bin(other.x - spot.x);
                    let there = self.cell(other.x, row);
                    self.votes[here * self.bins + bin] += 0.5;
                    self.votes[there * self.bins + bin] += 0.5;
                }
            }
        }
    }

    fn sum(&mut self, cell: usize) {
        let bins = self.bins;
        let sums = &mut self.shares[cell * bins..(cell + 1) * bins];
        for line in 0..3 {
            for column in 0..3 {
                let beside = cell + line * self.columns + column - self.columns - 1;
                self.totals[cell] += self.points[beside];
                let votes = &self.votes[beside * bins..(beside + 1) * bins];
                for (sum, votes) in sums[1..].iter_mut().zip(votes.windows(3)) {
                    *sum += votes[0] + votes[1] + votes[2];
                }
            }
        }
        let least = self.share * self.totals[cell];
        self.repeats[cell] = self.totals[cell] > FEW && sums.iter().any(|&sum| sum > least);
        for sum in sums {
            *sum /= self.totals[cell];
        }
    }

    fn cell(&self, x: f32, row: usize) -> usize {
        let column = ((x / CELL) as usize + 1).min(self.columns - 2);
        let line = ((row as f32 / CELL) as usize + 1).min(self.lines - 2);
        line * self.columns + column
    }

    fn bin(&self, distance: f32) -> usize {
        ((distance + 0.5) as usize).min(self.bins - 1)
    }

    /// The share of a cell's points that recur at a distance; none beyond what was looked at.
    fn recurring(&self, cell: usize, distance: f32) -> Option<f32> {
        let share = self.shares[cell * self.bins + self.bin(distance)];
        (distance <= self.reach).then_some(share)
    }

    /// The least distance at which the pattern that a point is part of repeats it, in columns.
    pub(crate) fn period(
        &self,
        own: &Rows,
        like: &Likeness,
        (spot, row): (&Spot, usize),
    ) -> Option<f32> {
        let cell = self.cell(spot.x, row);
        if !self.repeats[cell] {
            return None;
        }
        let is_shared = |distance: f32, least: f32| {
            let share = self.recurring(cell, distance);
            share.is_none_or(|share| share > least)
        };
        let is_period = |distance: f32| {
            let between = [0.5, 1.5].map(|half| self.recurring(cell, half * distance));
            let known = between.iter().flatten();
            let between = known.clone().sum::<f32>() / known.count() as f32;
            is_shared(distance, self.share + BETWEEN * between)
                && is_shared(distance * self.ratio, 0.5 * self.share)
        };
        let mut least = f32::INFINITY;
        let facing = (spot.orientation, like.turn);
        for (_, other) in own.facing(row, around(spot.x, self.reach), facing) {
            let distance = (other.x - spot.x).abs();
            if distance > FINE
                && distance < least
                && is_shared(distance, self.share)
                && is_like(like, spot, other)
                && is_period(distance)
            {
                least = distance;
            }
        }
        if least == f32::INFINITY {
            return None;
        }
        let shared = self.recurring(cell, least).unwrap_or_default();
        let is_multiple = (2..=4)
            .map(|parts| least / parts as f32)
            .any(|part| part > NEXT && part < FINE && is_shared(part, AS_MANY * shared));
        (!is_multiple).then_some(least)
    }
}

/// How many likes follow one another at a distance to the left and to the right of a spot; none where the next one would
/// be outside the picture.
pub(crate) fn followers(
    rows: &Rows,
    like: &Likeness,
    (spot, row): (&Spot, usize),
    distance: f32,
    width: f32,
) -> Option<[usize; 2]> {
    let mut counts = [0; 2];
    for (step, count) in [-distance, distance].into_iter().zip(&mut counts) {
        let mut next = spot.x + step;
        loop {
            if !(BORDER..=width - 1.0 - BORDER).contains(&next) {
                return None;
            }
            let facing = (spot.orientation, like.turn);
            let likes = rows
                .facing(row, around(next, MISS), facing)
                .filter(|(_, other)| is_like(like, spot, other));
            let off = |other: &Spot| (other.x - next).abs();
            let Some((_, other)) = likes.min_by(|a, b| off(a.1).total_cmp(&off(b.1))) else {
                break;
            };
            next = other.x + step;
            *count += 1;
        }
    }
    Some(counts)
}

/// Whether two points of one view look alike on one side at least.
fn is_like(like: &Likeness, spot: &Spot, other: &Spot) -> bool {
    like.better_side(spot, other)
        .is_some_and(|cost| cost < UNLIKE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::tests::{likeness, rows_of};

    const SIZE: Size = Size {
        width: 320,
        height: 96,
    };

    /// Bars 20 columns apart whose inner side is always the same and whose outer one is never.
    fn fence(bars: std::ops::Range<usize>) -> Rows {
        let bar = |row: usize, bar: usize| {
            let side = ((37 * row + 91 * bar) % 120) as u8;
            let outer = [side / 2, side, side / 3, side];
            Spot {
                x: 12.0 + 20.0 * bar as f32,
                sixteenths: 0.5,
                levels: [outer[0], outer[1], outer[2], outer[3], 150, 160, 160, 160],
                ..Spot::default()
            }
        };
        rows_of(SIZE, |row| {
            bars.clone().map(move |at| bar(row, at)).collect()
        })
    }

    fn measured(rows: &Rows) -> Repetition {
        let mut repetition = Repetition::default();
        repetition.measure(rows, &likeness(), SIZE, (80.0, 2.0, 0.16));
        repetition
    }

    #[test]
    fn bars_alike_on_one_side_only_repeat_at_their_period() {
        let rows = fence(0..15);
        let repetition = measured(&rows);
        for at in rows.row(48) {
            let period = repetition.period(&rows, &likeness(), (&rows.spots[at], 48));
            let is_right = period.is_some_and(|period| (period - 20.0).abs() < 0.1);
            assert!(is_right, "{period:?}");
        }
    }

    #[test]
    fn points_at_chance_distances_repeat_nowhere() {
        let rows = rows_of(SIZE, |row| {
            let places = (0..20).map(|at| {
                let mixed = (at + 64 * row) as u64 + 1;
                let mixed = (mixed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (mixed << 17))
                    .wrapping_mul(0xBF58_476D_1CE4_E5B9);
                (mixed >> 33) as usize % 300
            });
            let mut places: Vec<usize> = places.collect();
            places.sort_unstable();
            let spot = |x: usize| Spot {
                x: x as f32,
                sixteenths: 0.5,
                levels: [128; 8],
                ..Spot::default()
            };
            places.into_iter().map(spot).collect()
        });
        let repetition = measured(&rows);
        let all = (0..SIZE.height as usize).flat_map(|row| rows.row(row).map(move |at| (at, row)));
        let (mut count, mut repeated) = (0, 0);
        for (at, row) in all {
            count += 1;
            let period = repetition.period(&rows, &likeness(), (&rows.spots[at], row));
            repeated += usize::from(period.is_some());
        }
        assert!(repeated * 50 < count, "{repeated} of {count}");
    }

    #[test]
    fn likes_are_counted_to_either_end_and_not_where_an_end_is_out_of_sight() {
        let rows = fence(3..9);
        let count = |at: usize| {
            let spot = &rows.spots[rows.row(5).start + at];
            followers(&rows, &likeness(), (spot, 5), 20.0, SIZE.width as f32)
        };
        assert_eq!(count(0), Some([0, 5]));
        assert_eq!(count(2), Some([2, 3]));
        let rows = fence(0..9);
        let spot = &rows.spots[rows.row(5).start + 4];
        let open = followers(&rows, &likeness(), (spot, 5), 20.0, SIZE.width as f32);
        assert_eq!(open, None);
    }
}
