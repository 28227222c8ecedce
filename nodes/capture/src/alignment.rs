//! How well neighbouring views are aligned, measured from the images alone.
//!
//! ```text
//! points of curves in a view ─► each followed into a neighbour, in rows and columns ─► vertical misalignment, steps
//! ```
//!
//! Matching takes for granted that a point lies in the same row of every view; what is here does not. A point is sought
//! with its surroundings, coarse to fine, by normalized cross-correlation over columns *and* rows, and then placed
//! between pixels by least squares (Lucas and Kanade), with columns that may shear and gray levels that may differ by
//! gain and offset. It counts only where its surroundings fix both directions.

use messages::Size;

pub use crate::sway::{Sighted, residual};

/// Each level of a pyramid halves the one below.
const LEVELS: usize = 3;
/// Pixels from the middle to the edge of what is compared, on any level.
const REACH: i32 = 5;
/// Rows searched up and down on the coarsest level: 32 pixels of the image.
const ROWS: i32 = 8;
/// The least correlation of surroundings that are taken for the same, on the way down.
const LIKE: f64 = 0.7;
/// The least correlation once placed.
const SAME: f64 = 0.95;
/// Pixels from the middle to the edge of what is placed between pixels.
const PATCH: i32 = 9;
/// Standard deviation of its weights, in pixels.
const WEIGHT: f64 = 5.0;
/// The most that the row of a point may be uncertain, in pixels (one standard deviation).
const UNSURE: f64 = 0.04;
/// Points that miss the common trend of rows by more than this many pixels, and by more than five median deviations, are
/// taken for mistaken.
const MISTAKEN: f64 = 1.0;
/// Pixels between nearly the least and nearly the greatest disparity from which on a shift is told from a ratio.
const SPREAD: f64 = 1.0;
/// What a shift must leave of the median difference to be believed: a turned picture looks like a little of both.
const CLEARER: f64 = 0.7;
/// The least change of gray levels that makes a corner, and by how much it must exceed what noise leaves of its square.
const CORNER: f32 = 0.25;
const OVER_NOISE: f32 = 0.1;
/// One of so many pixels is looked at to see how much noise there is.
const SAMPLED: usize = 7;
/// Rounds after which a line of least absolute differences changes no more.
const ROUNDS: usize = 20;
/// Differences in disparity, in pixels, below which all weigh the same.
const SURE: f64 = 0.05;

/// A view, made ready.
#[derive(Clone, Debug)]
pub struct Ready {
    levels: Vec<Gray>,
    /// Standard deviation of the noise, and of what is as fine, in gray levels.
    noise: f32,
}

#[derive(Clone, Debug)]
struct Gray {
    width: i32,
    height: i32,
    pixels: Vec<f32>,
}

impl Gray {
    fn at(&self, x: i32, y: i32) -> f32 {
        let (x, y) = (x.clamp(0, self.width - 1), y.clamp(0, self.height - 1));
        self.pixels[(y * self.width + x) as usize]
    }

    /// Whether so much around a pixel lies inside.
    fn has(&self, x: i32, y: i32, reach: i32) -> bool {
        x >= reach && y >= reach && x + reach < self.width && y + reach < self.height
    }

    fn between(&self, x: f64, y: f64) -> f64 {
        let (column, row) = (x.floor(), y.floor());
        let (right, down) = (x - column, y - row);
        let at = |i: i32, j: i32| f64::from(self.at(column as i32 + i, row as i32 + j));
        (at(0, 0) * (1.0 - right) + at(1, 0) * right) * (1.0 - down)
            + (at(0, 1) * (1.0 - right) + at(1, 1) * right) * down
    }

    /// Weights 1 4 6 4 1 along rows and columns: what is finer than pixels would not be the same in two views.
    fn softened(&self) -> Self {
        let along = |from: &Self, dx: i32, dy: i32| {
            let mut pixels = Vec::with_capacity(from.pixels.len());
            for y in 0..from.height {
                for x in 0..from.width {
                    let far = |n: i32| from.at(x + n * dx, y + n * dy);
                    let sum = 6.0 * far(0) + 4.0 * (far(-1) + far(1)) + far(-2) + far(2);
                    pixels.push(sum / 16.0);
                }
            }
            Self { pixels, ..*from }
        };
        along(&along(self, 1, 0), 0, 1)
    }

    /// Standard deviation of noise: the median of what differs from planes and from what turns along both axes (Immerkær 1996).
    fn noise(&self) -> f32 {
        let (width, height) = (self.width as usize, self.height as usize);
        let mut seen = Vec::with_capacity(width * height / SAMPLED);
        for at in (width + 1..(width * height).saturating_sub(width + 1)).step_by(SAMPLED) {
            let row = |at: usize, [side, middle]: [f32; 2]| {
                side * (self.pixels[at - 1] + self.pixels[at + 1]) + middle * self.pixels[at]
            };
            let edges = row(at - width, [1.0, -2.0]) + row(at + width, [1.0, -2.0]);
            seen.push((edges + row(at, [-2.0, 4.0])).abs());
        }
        let middle = seen.len() / 2;
        if seen.is_empty() {
            return 0.0;
        }
        let (_, median, _) = seen.select_nth_unstable_by(middle, f32::total_cmp);
        // The mask multiplies a standard deviation by six.
        1.4826 * *median / 6.0
    }

    /// How much gray levels change around a pixel in the direction in which they change least: squared, a pixel.
    fn corner(&self, x: i32, y: i32) -> f32 {
        let [mut xx, mut xy, mut yy] = [0.0f32; 3];
        for j in y - 2..=y + 2 {
            for i in x - 2..=x + 2 {
                let across = (self.at(i + 1, j) - self.at(i - 1, j)) / 2.0;
                let down = (self.at(i, j + 1) - self.at(i, j - 1)) / 2.0;
                xx += across * across;
                xy += across * down;
                yy += down * down;
            }
        }
        let (middle, half) = ((xx + yy) / 2.0, (xx - yy) / 2.0);
        (middle - half.hypot(xy)) / 25.0
    }

    /// Half as wide and high; pixel n of it lies at pixel 2n.
    fn halved(&self) -> Self {
        let soft = self.softened();
        let (width, height) = ((self.width + 1) / 2, (self.height + 1) / 2);
        let at = |i: i32| soft.at(2 * (i % width), 2 * (i / width));
        Self {
            width,
            height,
            pixels: (0..width * height).map(at).collect(),
        }
    }
}

/// Surroundings of a pixel with their mean taken away.
struct Surroundings {
    values: Vec<f32>,
    norm: f32,
}

impl Surroundings {
    fn of(gray: &Gray, x: i32, y: i32) -> Option<Self> {
        if !gray.has(x, y, REACH) {
            return None;
        }
        let rows = (y - REACH..=y + REACH).flat_map(|y| {
            let start = (y * gray.width + x - REACH) as usize;
            &gray.pixels[start..=start + 2 * REACH as usize]
        });
        let mut values: Vec<f32> = rows.copied().collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        values.iter_mut().for_each(|value| *value -= mean);
        let norm = values.iter().map(|v| v * v).sum::<f32>().sqrt();
        // Nothing but noise: half a gray level.
        (norm > 0.5 * (values.len() as f32).sqrt()).then_some(Self { values, norm })
    }

    /// Correlation with the surroundings of another pixel.
    fn like(&self, gray: &Gray, x: i32, y: i32) -> f64 {
        if !gray.has(x, y, REACH) {
            return 0.0;
        }
        const SIDE: usize = 2 * REACH as usize + 1;
        let (mut product, mut sum, mut square) = (0.0, 0.0, 0.0);
        for (row, own) in self.values.as_chunks::<SIDE>().0.iter().enumerate() {
            let start = (y - REACH + row as i32) * gray.width + x - REACH;
            let other = &gray.pixels[start as usize..][..SIDE];
            for (own, other) in own.iter().zip(other) {
                product += own * other;
                sum += other;
                square += other * other;
            }
        }
        let norm = (square - sum * sum / self.values.len() as f32)
            .max(0.0)
            .sqrt();
        f64::from(product / (self.norm * norm).max(1e-3))
    }
}

impl Ready {
    /// Makes a view ready: 8-bit gray, row by row.
    ///
    /// # Panics
    /// When there are not as many pixels as the size says.
    pub fn new(pixels: &[u8], size: Size) -> Self {
        assert_eq!(pixels.len(), size.pixels(), "an image of {size}");
        let mut levels = vec![Gray {
            width: size.width as i32,
            height: size.height as i32,
            pixels: pixels.iter().map(|&value| value.into()).collect(),
        }];
        let noise = levels[0].noise();
        while levels.len() < LEVELS {
            let half = levels[levels.len() - 1].halved();
            levels.push(half);
        }
        // The finest level is placed between pixels.
        levels[0] = levels[0].softened();
        Self { levels, noise }
    }

    /// Where a point (column, row) of this view lies in another: by how many columns and rows further. `None` where that is
    /// not sure.
    pub fn follow(&self, other: &Self, at: [f64; 2]) -> Option<[f64; 2]> {
        let roughly = self.roughly(other, at)?;
        self.placed(other, at, roughly.by)
    }

    /// Where a point lies in another view, on the coarsest level. `None` where nothing there is like it.
    pub(crate) fn roughly(&self, other: &Self, [x, y]: [f64; 2]) -> Option<Roughly> {
        let coarse = LEVELS - 1;
        let (own, gray) = (&self.levels[coarse], &other.levels[coarse]);
        let at = [x, y].map(|v| v.round() as i32 >> coarse);
        let surroundings = Surroundings::of(own, at[0], at[1])?;
        let columns = own.width / 4;
        let mut best = (LIKE, None);
        let mut likes = Vec::with_capacity(((2 * columns + 1) * (2 * ROWS + 1)) as usize);
        for row in -ROWS..=ROWS {
            for column in -columns..=columns {
                let like = surroundings.like(gray, at[0] + column, at[1] + row);
                likes.push(like);
                if like > best.0 {
                    best = (like, Some([column, row]));
                }
            }
        }
        let (like, by) = (best.0, best.1?);
        let across = 2 * columns + 1;
        let is_far = |at: i32| {
            (at % across - columns - by[0]).abs() > 2 || (at / across - ROWS - by[1]).abs() > 2
        };
        let elsewhere = likes.iter().zip(0..).filter(|(_, at)| is_far(*at));
        let second = elsewhere.map(|(like, _)| *like).fold(0.0, f64::max);
        Some(Roughly { by, like, second })
    }

    /// Where a point lies in another view exactly, from where it is on the coarsest level.
    pub(crate) fn placed(
        &self,
        other: &Self,
        [x, y]: [f64; 2],
        roughly: [i32; 2],
    ) -> Option<[f64; 2]> {
        let whole = [x.round() as i32, y.round() as i32];
        let mut found = roughly.map(|v| 2 * v);
        for level in (0..LEVELS - 1).rev() {
            let (own, gray) = (&self.levels[level], &other.levels[level]);
            let at = whole.map(|v| v >> level);
            let surroundings = Surroundings::of(own, at[0], at[1])?;
            let mut best = (LIKE, None);
            for row in -2..=2 {
                for column in -2..=2 {
                    let by = [found[0] + column, found[1] + row];
                    let like = surroundings.like(gray, at[0] + by[0], at[1] + by[1]);
                    if like > best.0 {
                        best = (like, Some(by));
                    }
                }
            }
            found = best.1?;
            if level > 0 {
                found = found.map(|v| 2 * v);
            }
        }
        let start = found.map(f64::from);
        let placed = place(&self.levels[0], &other.levels[0], whole, start)?;
        // The way back must lead here.
        let there = [0, 1].map(|k| (f64::from(whole[k]) + placed[k]).round() as i32);
        let rest = [0, 1].map(|k| f64::from(there[k] - whole[k]) - placed[k]);
        let back = place(&other.levels[0], &self.levels[0], there, placed.map(|v| -v))?;
        let is_back = (placed[1] + back[1]).abs() < 0.25 && (placed[0] + back[0]).abs() < 0.5;
        (is_back && rest[0].abs() <= 0.5).then_some(placed)
    }

    /// Points (column, row) whose surroundings fix both directions, the best of every cell of so many pixels, row by row.
    pub(crate) fn corners(&self, cell: usize) -> Vec<[f64; 2]> {
        let gray = &self.levels[1];
        let (width, height, cell) = (gray.width, gray.height, (cell as i32 / 2).max(4));
        let edge = PATCH / 2 + 2;
        let least = CORNER.max(OVER_NOISE * self.noise * self.noise);
        let mut corners = Vec::new();
        for top in (edge..height - edge).step_by(cell as usize) {
            for left in (edge..width - edge).step_by(cell as usize) {
                let (mut best, mut at) = (least, None);
                for y in (top..(top + cell).min(height - edge)).step_by(2) {
                    for x in (left..(left + cell).min(width - edge)).step_by(2) {
                        let strength = gray.corner(x, y);
                        if strength > best {
                            (best, at) = (strength, Some([x, y]));
                        }
                    }
                }
                corners.extend(at.map(|at| at.map(|v| f64::from(2 * v))));
            }
        }
        corners
    }
}

/// Where a point is found on the coarsest level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Roughly {
    /// Columns and rows of that level.
    pub(crate) by: [i32; 2],
    /// The correlation there.
    pub(crate) like: f64,
    /// The best elsewhere.
    pub(crate) second: f64,
}

/// Unknowns of placing: columns at the middle, their change along columns and along rows, rows, gain, offset.
const UNKNOWNS: usize = 6;

/// Places the surroundings of a pixel in another image, from a start within two pixels.
fn place(own: &Gray, other: &Gray, [x, y]: [i32; 2], start: [f64; 2]) -> Option<[f64; 2]> {
    if !own.has(x, y, PATCH + 1) {
        return None;
    }
    let inside = |at: [f64; 2]| {
        let [column, row] = [x, y].map(f64::from);
        other.has(
            (column + at[0]).round() as i32,
            (row + at[1]).round() as i32,
            PATCH + 2,
        )
    };
    let mut state = [start[0], 0.0, 0.0, start[1], 1.0, 0.0];
    for _ in 0..20 {
        if !inside([state[0], state[3]]) {
            return None;
        }
        let mut normal = [[0.0; UNKNOWNS]; UNKNOWNS];
        let mut right = [0.0; UNKNOWNS];
        let (mut squares, mut weights) = (0.0, 0.0);
        // Sums for the correlation: own, other, their squares and product.
        let mut sums = [0.0; 5];
        for dy in -PATCH..=PATCH {
            for dx in -PATCH..=PATCH {
                let (column, row) = (f64::from(dx), f64::from(dy));
                let weight = (-(column * column + row * row) / (2.0 * WEIGHT * WEIGHT)).exp();
                let (px, py) = (x + dx, y + dy);
                let mine = f64::from(own.at(px, py));
                let slope = |ax: i32, ay: i32| {
                    f64::from(own.at(px + ax, py + ay) - own.at(px - ax, py - ay)) / 2.0
                };
                let (across, down) = (slope(1, 0), slope(0, 1));
                let theirs = other.between(
                    f64::from(px) + state[0] + state[1] * column + state[2] * row,
                    f64::from(py) + state[3],
                );
                let left = [across, across * column, across * row, down, theirs, 1.0];
                let miss = mine - (state[4] * theirs + state[5]);
                for i in 0..UNKNOWNS {
                    right[i] += weight * left[i] * miss;
                    for j in 0..UNKNOWNS {
                        normal[i][j] += weight * left[i] * left[j];
                    }
                }
                squares += weight * miss * miss;
                weights += weight;
                for (sum, value) in
                    sums.iter_mut()
                        .zip([mine, theirs, mine * mine, theirs * theirs, mine * theirs])
                {
                    *sum += weight * value;
                }
            }
        }
        let inverse = inverted(normal)?;
        let step: Vec<f64> = inverse
            .iter()
            .map(|row| row.iter().zip(&right).map(|(a, b)| a * b).sum())
            .collect();
        for (state, step) in state.iter_mut().zip(&step) {
            *state += step;
        }
        let has_strayed = (state[0] - start[0]).abs() > 3.0 || (state[3] - start[1]).abs() > 3.0;
        if has_strayed || state[1].abs() > 0.5 || state[2].abs() > 0.5 {
            return None;
        }
        if step[0].abs() < 2e-3 && step[3].abs() < 2e-3 {
            let [a, b, aa, bb, ab] = sums.map(|sum| sum / weights);
            let same = (ab - a * b) / ((aa - a * a) * (bb - b * b)).max(1e-6).sqrt();
            // Quantization alone makes a miss of 0.3 gray levels.
            let miss = squares / weights + 0.1;
            let unsure = (miss * inverse[3][3]).sqrt();
            return (same > SAME && unsure < UNSURE).then_some([state[0], state[3]]);
        }
    }
    None
}

/// The inverse of a symmetric matrix, by elimination; `None` where it hardly has one.
fn inverted(mut matrix: [[f64; UNKNOWNS]; UNKNOWNS]) -> Option<[[f64; UNKNOWNS]; UNKNOWNS]> {
    let mut inverse = [[0.0; UNKNOWNS]; UNKNOWNS];
    for (i, row) in inverse.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for i in 0..UNKNOWNS {
        let pivot = matrix[i][i];
        if pivot.abs() < 1e-9 {
            return None;
        }
        for k in 0..UNKNOWNS {
            matrix[i][k] /= pivot;
            inverse[i][k] /= pivot;
        }
        for row in (0..UNKNOWNS).filter(|&row| row != i) {
            let by = matrix[row][i];
            for k in 0..UNKNOWNS {
                matrix[row][k] -= by * matrix[i][k];
                inverse[row][k] -= by * inverse[i][k];
            }
        }
    }
    Some(inverse)
}

/// A point that was followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Followed {
    /// Its column and row in the view it was followed from, from the middle of the picture.
    pub from_middle: [f64; 2],
    /// By how many rows it lies lower in the right one of the two views.
    pub rows: f64,
}

/// Rows between two neighbouring views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rows {
    /// Points that were followed, without those taken for mistaken.
    pub points: usize,
    /// Points that were taken for mistaken.
    pub mistaken: usize,
    /// Median and 95th percentile of the pixels by which a point misses its row.
    pub median_px: f64,
    /// The 95th percentile.
    pub p95_px: f64,
    /// Rows by which the middle of the right view is lower.
    pub offset_px: f64,
    /// Rows more for each column to the right: a turn about the axis, in radians.
    pub per_column: f64,
    /// Rows more for each row down: a difference in scale.
    pub per_row: f64,
}

/// What the points that were followed between two views say; `None` for fewer than ten.
///
/// The trend, a plane over the picture, is fitted again and again to the half of the points that is nearest to it.
pub fn rows(followed: &[Followed]) -> Option<Rows> {
    const LEAST: usize = 10;
    if followed.len() < LEAST {
        return None;
    }
    let all: Vec<f64> = followed.iter().map(|point| point.rows).collect();
    let mut trend = [quantile(&all, 0.5), 0.0, 0.0];
    let miss = |trend: [f64; 3], point: &Followed| {
        let [column, row] = point.from_middle;
        (point.rows - trend[0] - trend[1] * column - trend[2] * row).abs()
    };
    for _ in 0..10 {
        let misses: Vec<f64> = followed.iter().map(|point| miss(trend, point)).collect();
        let half = quantile(&misses, 0.5);
        let near = followed
            .iter()
            .zip(&misses)
            .filter(|(_, miss)| **miss <= half);
        trend = plane(near.map(|(point, _)| point)).unwrap_or(trend);
    }
    let misses: Vec<f64> = followed.iter().map(|point| miss(trend, point)).collect();
    let most = MISTAKEN.max(5.0 * quantile(&misses, 0.5));
    let good = followed.iter().filter(|point| miss(trend, point) <= most);
    let off: Vec<f64> = good.map(|point| point.rows.abs()).collect();
    (off.len() >= LEAST).then(|| Rows {
        points: off.len(),
        mistaken: followed.len() - off.len(),
        median_px: quantile(&off, 0.5),
        p95_px: quantile(&off, 0.95),
        offset_px: trend[0],
        per_column: trend[1],
        per_row: trend[2],
    })
}

/// The least-squares plane rows = a + b·column + c·row.
fn plane<'a>(points: impl Iterator<Item = &'a Followed>) -> Option<[f64; 3]> {
    let mut normal = glam::DMat3::ZERO;
    let mut right = glam::DVec3::ZERO;
    for point in points {
        let [column, row] = point.from_middle;
        let left = glam::DVec3::new(1.0, column, row);
        normal += glam::DMat3::from_cols(left, left * column, left * row);
        right += left * point.rows;
    }
    (normal.determinant().abs() > 1e-6).then(|| (normal.inverse() * right).to_array())
}

/// Steps on both sides of a view: left disparity = ratio · right disparity + shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steps {
    /// Points that were followed to both sides.
    pub points: usize,
    /// The left disparity as a multiple of the right one; 1 for equal steps.
    pub ratio: f64,
    /// What the left one is more at every disparity, in pixels, as where a camera turned a little; 0 where the ratio alone
    /// says it about as well.
    pub shift_px: f64,
    /// Median of their difference, in pixels.
    pub median_px: f64,
    /// 95th percentile of their difference without its sign, in pixels; points at outlines, whose columns are seldom
    /// sure, are among them.
    pub p95_px: f64,
    /// What the steps alone make a point miss in the next view but one: what ratio and shift come to at the disparities
    /// below which 5 % and 95 % lie, or the median difference, whichever is most, in pixels.
    pub miss_px: f64,
}

/// What disparities to the left and to the right of a view say of the steps; `None` for fewer than ten.
pub fn steps(disparities: &[[f64; 2]]) -> Option<Steps> {
    if disparities.len() < 10 {
        return None;
    }
    let right: Vec<f64> = disparities.iter().map(|[_, right]| *right).collect();
    let [low, high] = [0.05, 0.95].map(|part| quantile(&right, part));
    let proportional = line(disparities, false)?;
    let shifted = line(disparities, true).filter(|_| high - low >= SPREAD);
    let off = |&(ratio, shift): &(f64, f64)| {
        let off = disparities
            .iter()
            .map(|[left, right]| (left - ratio * right - shift).abs());
        quantile(&off.collect::<Vec<_>>(), 0.5)
    };
    let (ratio, shift_px) = shifted
        .filter(|shifted| off(shifted) < CLEARER * off(&proportional))
        .unwrap_or(proportional);
    // A point that was mistaken on one side says nothing of the steps.
    let is_near =
        |[left, right]: &&[f64; 2]| (left - right * ratio - shift_px).abs() < 3.0 * MISTAKEN;
    let near: Vec<f64> = disparities
        .iter()
        .filter(is_near)
        .map(|[left, right]| left - right)
        .collect();
    let off: Vec<f64> = near.iter().map(|difference| difference.abs()).collect();
    let median_px = quantile(&near, 0.5);
    let misses = [low, high].map(|right| ((ratio - 1.0) * right + shift_px).abs());
    Some(Steps {
        points: near.len(),
        ratio,
        shift_px,
        median_px,
        p95_px: quantile(&off, 0.95),
        miss_px: misses.into_iter().fold(median_px.abs(), f64::max),
    })
}

/// Ratio and shift of left disparities over right ones by least absolute differences, as weighted least squares come to;
/// `None` where all are 0.
fn line(disparities: &[[f64; 2]], with_shift: bool) -> Option<(f64, f64)> {
    let (mut ratio, mut shift) = (1.0, 0.0);
    for _ in 0..ROUNDS {
        let [mut n, mut x, mut y, mut xx, mut xy] = [0.0; 5];
        for &[left, right] in disparities {
            let weight = 1.0 / (left - ratio * right - shift).abs().max(SURE);
            n += weight;
            x += weight * right;
            y += weight * left;
            xx += weight * right * right;
            xy += weight * right * left;
        }
        let (mean, other) = if with_shift {
            (x / n, y / n)
        } else {
            (0.0, 0.0)
        };
        let spread = xx - mean * x;
        if spread <= 0.0 {
            return None;
        }
        ratio = (xy - mean * y) / spread;
        shift = other - ratio * mean;
    }
    Some((ratio, shift))
}

/// The value below which this part of the values lies; 0 of none.
pub(crate) fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = (part * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(at).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size::new(200, 160);

    /// A picture of soft blobs, moved by so much.
    fn blobs(move_by: impl Fn(f64, f64) -> [f64; 2]) -> Vec<u8> {
        let mut gray = vec![100.0; SIZE.pixels()];
        for blob in 0..120 {
            let (x, y) = ((blob * 67 % 197) as f64, (blob * 41 % 157) as f64);
            let [dx, dy] = move_by(x, y);
            let bright = f64::from(blob * 29 % 120) - 60.0;
            let spread = 2.5 + f64::from(blob % 3);
            for (i, gray) in gray.iter_mut().enumerate() {
                let (column, row) = ((i % 200) as f64 - x - dx, (i / 200) as f64 - y - dy);
                let far = (column * column + 1.4 * row * row) / (2.0 * spread * spread);
                *gray += bright * (-far).exp();
            }
        }
        gray.into_iter().map(|v: f64| v.round() as u8).collect()
    }

    fn points() -> Vec<[f64; 2]> {
        let at = |i: i32| [f64::from(20 + i % 17 * 10), f64::from(20 + i / 17 * 10)];
        (0..17 * 13).map(at).collect()
    }

    #[test]
    fn a_shift_between_pixels_is_found_within_hundredths() {
        let (a, b) = (blobs(|_, _| [0.0; 2]), blobs(|_, _| [-9.37, 2.63]));
        let (a, b) = (Ready::new(&a, SIZE), Ready::new(&b, SIZE));
        let found: Vec<[f64; 2]> = points().iter().filter_map(|&at| a.follow(&b, at)).collect();
        assert!(found.len() > 100, "{}", found.len());
        let off = |axis: usize, shift: f64| -> Vec<f64> {
            found.iter().map(|by| (by[axis] - shift).abs()).collect()
        };
        // Gray levels are whole numbers, and some blobs are faint.
        for off in [off(0, -9.37), off(1, 2.63)] {
            let (median, p95) = (quantile(&off, 0.5), quantile(&off, 0.95));
            assert!(median < 0.03 && p95 < 0.1, "median {median}, p95 {p95}");
        }
    }

    #[test]
    fn a_turn_is_told_from_an_offset() {
        let (x, y) = ((199.0) / 2.0, 159.0 / 2.0);
        let turned = |c: f64, r: f64| {
            [
                -6.0 + 0.02 * (r - y),
                0.5 + 0.01 * (c - x) - 0.004 * (r - y),
            ]
        };
        let (a, b) = (blobs(|_, _| [0.0; 2]), blobs(turned));
        let (a, b) = (Ready::new(&a, SIZE), Ready::new(&b, SIZE));
        let followed = points().into_iter().filter_map(|at| {
            let [_, rows] = a.follow(&b, at)?;
            Some(Followed {
                from_middle: [at[0] - x, at[1] - y],
                rows,
            })
        });
        let mut followed: Vec<Followed> = followed.collect();
        // Some were mistaken.
        followed.extend([-11.0, 7.0, 9.0, 25.0].map(|rows| Followed {
            from_middle: [0.0; 2],
            rows,
        }));
        let rows = rows(&followed);
        assert!(
            rows.is_some_and(|rows| {
                rows.mistaken >= 4
                    && (rows.offset_px - 0.5).abs() < 0.03
                    && (rows.per_column - 0.01).abs() < 1e-3
                    && (rows.per_row + 0.004).abs() < 1e-3
                    && (rows.p95_px - 1.3).abs() < 0.25
            }),
            "{rows:?}"
        );
    }

    #[test]
    fn unequal_steps_show_in_their_ratio() {
        let disparities: Vec<[f64; 2]> = (0..100)
            .map(|i| [11.0 + 0.11 * f64::from(i), 10.0 + 0.1 * f64::from(i)])
            .collect();
        let steps = steps(&disparities);
        assert!(
            steps.is_some_and(|s| (s.ratio - 1.1).abs() < 1e-9 && (s.median_px - 1.5).abs() < 0.02),
            "{steps:?}"
        );
    }

    #[test]
    fn a_shift_is_told_from_unequal_steps() {
        let mut disparities: Vec<[f64; 2]> = (0..100)
            .map(|i| (f64::from(i) / 25.0 - 1.0, f64::from(i % 7 - 3) / 100.0))
            .map(|(right, noise)| [0.95 * right + 0.4 + noise, right])
            .collect();
        // Some were mistaken.
        disparities.extend([[5.0, -3.0], [9.0, 1.0], [-6.0, 2.0]]);
        let found = steps(&disparities);
        assert!(
            found.is_some_and(|s| (s.ratio - 0.95).abs() < 0.01
                && (s.shift_px - 0.4).abs() < 0.01
                && (s.miss_px - 0.44).abs() < 0.02),
            "{found:?}"
        );
        // Where all is equally far nobody can tell.
        let flat: Vec<[f64; 2]> = (0..20)
            .map(|i| [11.0 + f64::from(i % 3) / 50.0, 10.0])
            .collect();
        let found = steps(&flat);
        assert!(
            found.is_some_and(|s| (s.ratio - 1.1).abs() < 0.005 && s.shift_px == 0.0),
            "{found:?}"
        );
    }

    #[test]
    fn a_plain_picture_says_nothing() {
        let plain = Ready::new(&vec![90; SIZE.pixels()], SIZE);
        assert!(
            points()
                .iter()
                .all(|&at| plain.follow(&plain, at).is_none())
        );
        assert_eq!(rows(&[]), None);
        assert_eq!(steps(&[[1.0, 1.0]; 9]), None);
    }
}
