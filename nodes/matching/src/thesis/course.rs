//! The course of a curve's disparity over its rows and columns: a plane, found from the fullest lane of votes.
//!
//! On a plane that the cameras see at a slant, such as a table before them, disparity changes linearly from row to row and
//! from column to column; the centroid's alone would miss the ends of a long curve by pixels.

use crate::Range;

/// A disparity that changes linearly from row to row and from column to column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Course {
    /// The row and …
    pub(crate) row: f32,
    /// … column at which it is `disparity`.
    pub(crate) column: f32,
    /// Pixels between neighbouring views.
    pub(crate) disparity: f32,
    /// Pixels more a row further down.
    pub(crate) down: f32,
    /// Pixels more a column further to the right.
    pub(crate) right: f32,
}

impl Course {
    /// The same everywhere.
    pub(crate) const fn level(disparity: f32) -> Self {
        Self {
            row: 0.0,
            column: 0.0,
            disparity,
            down: 0.0,
            right: 0.0,
        }
    }

    /// The disparity at a place.
    pub(crate) fn at(&self, row: f32, column: f32) -> f32 {
        self.disparity + self.down * (row - self.row) + self.right * (column - self.column)
    }

    /// The same by the columns of a view so many steps to the right.
    pub(crate) fn seen_from(self, steps: f32) -> Self {
        Self {
            column: self.column - steps * self.disparity,
            ..self
        }
    }
}

/// The disparities around a course that are looked at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Band {
    pub(crate) course: Course,
    /// Beside the course.
    pub(crate) beside: Range,
}

impl Band {
    /// Everything in a range, whatever the place.
    pub(crate) const fn level(range: Range) -> Self {
        Self {
            course: Course::level(0.0),
            beside: range,
        }
    }

    /// Up to so many pixels to either side of a course.
    pub(crate) const fn around(course: Course, reach: f32) -> Self {
        Self {
            course,
            beside: Range {
                least: -reach,
                most: reach,
            },
        }
    }

    /// The disparities looked at in a place.
    pub(crate) fn at(&self, row: f32, column: f32) -> Range {
        let middle = self.course.at(row, column);
        Range {
            least: middle + self.beside.least,
            most: middle + self.beside.most,
        }
    }
}

/// A vote: here the curve may have this disparity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vote {
    pub(crate) row: f32,
    pub(crate) column: f32,
    pub(crate) disparity: f32,
    /// Tangent of the gradient's direction: columns to the left by which the contour goes on to the next row.
    pub(crate) slant: f32,
    pub(crate) weight: f32,
}

impl Vote {
    /// How much more disparity it says than a course.
    pub(crate) fn beyond(&self, course: &Course) -> f32 {
        self.disparity - course.at(self.row, self.column)
    }
}

/// What lanes are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes {
    /// Pixels of disparity a lane is wide.
    pub(crate) width: f32,
    /// Most that a lane's disparity changes from row to row or column to column, in pixels.
    pub(crate) slope: f32,
}

impl Lanes {
    /// Whether a vote lies in the lane around a course.
    pub(crate) fn hold(&self, vote: &Vote, course: &Course) -> bool {
        vote.beyond(course).abs() <= self.width / 2.0
    }
}

/// Cells that a lane is divided into.
const CELLS: usize = 6;

/// Most slopes tried to either side of level.
const SLOPES: i32 = 12;

/// The search for the fullest lane, with its memory.
#[derive(Debug, Default)]
pub(crate) struct Fullest {
    cells: Vec<f32>,
}

impl Fullest {
    /// The middle of the fullest lane through the votes, which lie in the band: a plateau's middle where several are
    /// equally full. Lanes slope from row to row; what they slope from column to column is fitted to the votes they hold. A
    /// sloping lane must hold more than a level one. Gives nothing without votes.
    pub(crate) fn lane(
        &mut self,
        votes: &[Vote],
        band: &Band,
        (row, column): (f32, f32),
        lanes: Lanes,
    ) -> Option<Course> {
        let reach = votes
            .iter()
            .map(|vote| (vote.row - row).abs())
            .fold(0.0, f32::max);
        // From slope to slope the farthest vote moves by half a lane.
        let steps = (2.0 * lanes.slope * reach / lanes.width).ceil() as i32;
        let steps = steps.min(SLOPES);
        let mut best = (0.0, Course::level(f32::NAN));
        for step in (0..=steps).flat_map(|step| [step, -step]) {
            let slope = lanes.slope * step as f32 / steps.max(1) as f32;
            let (held, beside) = self.level_lane(votes, band, row, slope, lanes.width);
            if held > best.0 {
                let course = Course {
                    row,
                    column,
                    disparity: band.course.at(row, column) + beside,
                    down: band.course.down + slope,
                    right: band.course.right,
                };
                best = (held, course);
            }
        }
        (best.0 > 0.0).then(|| fitted(votes, best.1, lanes))
    }

    /// How much the fullest of the lanes of one slope holds, and where beside the band's course it lies.
    fn level_lane(
        &mut self,
        votes: &[Vote],
        band: &Band,
        row: f32,
        slope: f32,
        width: f32,
    ) -> (f32, f32) {
        let cell = width / CELLS as f32;
        let count = ((band.beside.most - band.beside.least) / cell)
            .ceil()
            .max(0.0) as usize
            + 1;
        self.cells.clear();
        self.cells.resize(count + 2 * CELLS, 0.0);
        for vote in votes {
            let beside = vote.beyond(&band.course) - slope * (vote.row - row);
            let at = (beside - band.beside.least) / cell + CELLS as f32;
            match self.cells.get_mut(at as usize) {
                Some(cell) if at >= 0.0 => *cell += vote.weight,
                _ => {}
            }
        }
        let (mut best, mut first, mut last) = (0.0, 0, 0);
        let mut held: f32 = self.cells[..CELLS].iter().sum();
        for start in 0..self.cells.len() - CELLS {
            if held > best + 1e-3 {
                (best, first, last) = (held, start, start);
            } else if held > best - 1e-3 && last + 1 == start {
                last = start;
            }
            held += self.cells[start + CELLS] - self.cells[start];
        }
        let middle = (first + last) as f32 / 2.0 - CELLS as f32 / 2.0;
        (best, band.beside.least + middle * cell)
    }
}

/// Rounds in which a course is fitted to the votes around it.
const ROUNDS: usize = 3;

/// Square pixels that a spread of rows or columns must have to say anything about a slope.
const LEAST_SPREAD: f32 = 12.0;

/// The plane through the votes in a lane, by least squares, as far as they are spread.
fn fitted(votes: &[Vote], mut course: Course, lanes: Lanes) -> Course {
    for _ in 0..ROUNDS {
        let mut fit = Fit::default();
        for vote in votes.iter().filter(|vote| lanes.hold(vote, &course)) {
            let (y, x) = (vote.row - course.row, vote.column - course.column);
            fit.add(vote.weight, y, x, vote.beyond(&course));
        }
        let Some((level, down, right)) = fit.plane(LEAST_SPREAD) else {
            return course;
        };
        let most = |slope: f32| slope.clamp(-lanes.slope, lanes.slope);
        let slopes = [most(course.down + down), most(course.right + right)];
        // Where a slope is held back the plane turns about the middle of the votes.
        let (y, x) = fit.middle();
        let held = level + down * y + right * x;
        let turned = [slopes[0] - course.down, slopes[1] - course.right];
        course = Course {
            disparity: course.disparity + held - turned[0] * y - turned[1] * x,
            down: slopes[0],
            right: slopes[1],
            ..course
        };
    }
    course
}

/// Sums of a regression of values on rows and columns.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fit {
    weight: f32,
    y: f32,
    x: f32,
    value: f32,
    yy: f32,
    xx: f32,
    yx: f32,
    y_value: f32,
    x_value: f32,
}

impl Fit {
    pub(crate) fn add(&mut self, weight: f32, y: f32, x: f32, value: f32) {
        self.weight += weight;
        self.y += weight * y;
        self.x += weight * x;
        self.value += weight * value;
        self.yy += weight * y * y;
        self.xx += weight * x * x;
        self.yx += weight * y * x;
        self.y_value += weight * y * value;
        self.x_value += weight * x * value;
    }

    /// Mean row and column.
    fn middle(&self) -> (f32, f32) {
        (self.y / self.weight, self.x / self.weight)
    }

    /// The plane: its value at the origin, its slope down and to the right. The less the places are spread beyond
    /// `least` square pixels, the flatter, and level where that is infinite; along a line the two slopes share what it tells.
    pub(crate) fn plane(&self, least: f32) -> Option<(f32, f32, f32)> {
        if self.weight <= 0.0 {
            return None;
        }
        let (y, x) = self.middle();
        let value = self.value / self.weight;
        let spread = |sum: f32, a: f32, b: f32| sum / self.weight - a * b;
        let yy = spread(self.yy, y, y) + least;
        let xx = spread(self.xx, x, x) + least;
        let yx = spread(self.yx, y, x);
        let (dy, dx) = (
            spread(self.y_value, y, value),
            spread(self.x_value, x, value),
        );
        if least.is_infinite() {
            return Some((value, 0.0, 0.0));
        }
        let determinant = yy * xx - yx * yx;
        let down = (dy * xx - dx * yx) / determinant;
        let right = (dx * yy - dy * yx) / determinant;
        Some((value - down * y - right * x, down, right))
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    const LANES: Lanes = Lanes {
        width: 1.5,
        slope: 0.1,
    };

    fn band(least: f32, most: f32) -> Band {
        Band::level(Range { least, most })
    }

    fn vote((row, disparity): (f32, f32)) -> Vote {
        Vote {
            row,
            column: 100.0,
            disparity,
            slant: 0.0,
            weight: 1.0,
        }
    }

    fn chance(seed: u32) -> f32 {
        let mixed = (u64::from(seed) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32
            / (1u64 << 24) as f32
    }

    /// Votes in a lane of one slope through a disparity at row 0.
    fn held(votes: &[Vote], disparity: f32, slope: f32) -> usize {
        let inside = |vote: &&Vote| (vote.disparity - disparity - slope * vote.row).abs() <= 0.75;
        votes.iter().filter(inside).count()
    }

    #[test]
    fn no_other_level_lane_holds_more_than_a_cell_s_votes_more() {
        let level = Lanes {
            slope: 0.0,
            ..LANES
        };
        for seed in 0..20 {
            let spread = |i: u32| (chance(7 * i), 30.0 * chance(1000 * seed + i));
            let votes: Vec<Vote> = (0..60).map(spread).map(vote).collect();
            let found = Fullest::default().lane(&votes, &band(0.0, 30.0), (0.0, 100.0), level);
            let found = held(&votes, found.unwrap().disparity, 0.0);
            let most = (0..3000)
                .map(|at| held(&votes, at as f32 * 0.01, 0.0))
                .max();
            assert!(found + 3 >= most.unwrap(), "{found} of {most:?}");
        }
    }

    #[test]
    fn a_plateau_is_answered_by_its_middle() {
        let votes: Vec<Vote> = (0..81)
            .map(|i| vote((0.0, 10.0 + 0.1 * i as f32)))
            .collect();
        let course = Fullest::default().lane(&votes, &band(0.0, 40.0), (0.0, 100.0), LANES);
        let middle = course.unwrap().disparity;
        assert!((middle - 14.0).abs() < 0.6, "{middle}");
    }

    #[test]
    fn a_slanted_lane_is_found_to_a_twentieth_of_a_pixel_between_strays() {
        for slope in [-0.08f32, -0.02, 0.0, 0.03, 0.1] {
            let on = (0..80).map(|row| (row as f32, 12.3 + slope * (row as f32 - 40.0)));
            let stray = (0..80).map(|row| (row as f32, 30.0 * chance(row)));
            let votes: Vec<Vote> = on.chain(stray).map(vote).collect();
            let course = Fullest::default().lane(&votes, &band(0.0, 30.0), (40.0, 100.0), LANES);
            let course = course.unwrap();
            for row in [0.0f32, 40.0, 79.0] {
                let expected = 12.3 + slope * (row - 40.0);
                assert!(
                    (course.at(row, 100.0) - expected).abs() < 0.1,
                    "{slope} {course:?}"
                );
            }
        }
    }

    #[test]
    fn votes_beside_the_band_count_for_nothing_and_none_give_nothing() {
        let votes: Vec<Vote> = [5.0, 5.0, 5.0, 20.0].map(|d| vote((0.0, d))).to_vec();
        let course = Fullest::default().lane(&votes, &band(15.0, 25.0), (0.0, 100.0), LANES);
        assert!((course.unwrap().disparity - 20.0).abs() < 0.3);
        assert_eq!(
            Fullest::default().lane(&[], &band(0.0, 9.0), (0.0, 0.0), LANES),
            None
        );
    }
}
