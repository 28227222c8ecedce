//! Zero-crossings and the gradient there.
//!
//! A contour ∇²G = 0 cuts rows and columns of the pixel grid. A cut between two neighbours of a row keeps the row's
//! whole number; it is what matching along rows works with. A cut between two neighbours of a column says little where
//! the contour is steep, for the rows have cuts of their own close by, and all where it is flat. So that a contour
//! becomes a dense chain of points, none of them doubled:
//!
//! - a cut of a row is listed unless the contour is nearly horizontal there ([`NEARLY_HORIZONTAL`]);
//! - a cut of a column is listed unless its pixel lists the cut of its row, or the cut of some row lies within half a
//!   pixel of the same pixel's centre. Where the contour is steeper than 45° that is always so.
//!
//! A pixel owns the cut to its right neighbour and the cut to its lower neighbour, and lists one at most.
//!
//! Every pixel of a row is marked with the cut it lists, all of them alike and without a branch; then the cuts are
//! gathered, then measured together: what a branch costs that nobody can foresee was three quarters of the time.

use messages::elements::nearest;
use messages::profile::Profiles;
use messages::{Edge, List};
use multiversion::multiversion;

use crate::gray::Gray;
use crate::picture::Picture;

/// A contour is nearly horizontal where ∇²G changes this many times as fast down as along: within 9.5° of the row.
/// Its cuts of rows are ill placed, and their disparities mislead. Over sixteen real scenes 6 has 0.42 % wrong by more
/// than a pixel at a coverage of 0.693; 3 has 0.40 % at 0.677, no limit at all 0.43 % at 0.697.
pub const NEARLY_HORIZONTAL: f32 = 6.0;

/// Neighbours that differ by less, in gray levels per square pixel, differ by rounding only.
const ROUNDING: f32 = 1e-4;

/// What Sobel's operator makes of a slope of one gray level per pixel.
const SOBEL: f32 = 8.0;

/// Pixels whose marks are looked at together.
const WORD: usize = 64;
/// Cuts that are measured together.
const BATCH: usize = 16;

/// The mark of a pixel that lists the cut of its row.
const ROW: u8 = 1;
/// The mark of a pixel that lists the cut of its column.
const COLUMN: u8 = 2;

/// What the edges of a view in a channel are made of.
pub(crate) struct View<'a> {
    /// ∇²G.
    pub(crate) filtered: &'a Picture,
    /// What Sobel's operator is applied to.
    pub(crate) smoothed: &'a Picture,
    /// What profiles are taken from.
    pub(crate) gray: &'a Gray,
    /// How far at most the curvature of ∇²G may move a cut, in pixels.
    pub(crate) correction: f32,
    /// What magnitudes in gray levels per pixel are multiplied by.
    pub(crate) scale: f32,
    /// Magnitudes up to this are noise.
    pub(crate) floor: f32,
}

/// Finds the edges of a view row by row.
#[derive(Debug, Default)]
pub(crate) struct Crossings {
    width: usize,
    marks: Vec<u8>,
    /// Those that list a cut.
    pixels: Vec<u32>,
    gradients: Gradients,
}

/// Sobel's operator on two rows, each with what follows the other: even rows first, odd ones second.
#[derive(Debug, Default)]
struct Gradients {
    along: Vec<f32>,
    down: Vec<f32>,
}

impl Crossings {
    /// Prepares for a view of this width.
    pub(crate) fn resize(&mut self, width: usize) {
        self.width = width;
        self.marks.clear();
        self.marks.resize(width.next_multiple_of(WORD), 0);
        self.pixels.resize(width, 0);
        self.gradients.along.resize(2 * width, 0.0);
        self.gradients.down.resize(2 * width, 0.0);
    }

    /// The largest gradient of a picture of `height` rows, in gray levels per pixel.
    pub(crate) fn largest_gradient(&mut self, picture: &Picture, height: usize) -> f32 {
        let along = &mut self.gradients.along[..self.width];
        let down = &mut self.gradients.down[..self.width];
        let largest = (0..height).fold(0.0, |largest, y| {
            sobel(around(picture, y), along, down);
            largest_square(along, down, largest)
        });
        largest.sqrt() / SOBEL
    }

    /// Appends the edges of row `y`, left to right. Rows are asked for from 0 up, none left out.
    pub(crate) fn row(&mut self, view: &View<'_>, y: usize, edges: &mut List<'_, Edge>) {
        let width = self.width;
        let Gradients { along, down } = &mut self.gradients;
        for row in if y == 0 { 0..=1 } else { y + 1..=y + 1 } {
            let place = row % 2 * width..(row % 2 + 1) * width;
            sobel(
                around(view.smoothed, row),
                &mut along[place.clone()],
                &mut down[place],
            );
        }
        mark(around(view.filtered, y), &mut self.marks[..width]);
        let cuts = collect(&self.marks, &mut self.pixels);
        let room = edges.grow(cuts);
        // Without room for all, the last are refused; the list counts them.
        let unused = room.len()
            - list(
                &self.pixels[..room.len()],
                &self.marks,
                view,
                &self.gradients,
                y,
                room,
            );
        let listed = edges.len() - unused;
        edges.truncate(listed);
    }
}

/// Row `y` of a picture between the one above and the one below.
fn around(picture: &Picture, y: usize) -> [&[f32]; 3] {
    [-1, 0, 1].map(|dy| picture.row(y as isize + dy))
}

/// Sobel's operator along and down on the middle one of three rows.
#[multiversion(targets("x86_64+avx2+fma"))]
fn sobel(rows: [&[f32]; 3], along: &mut [f32], down: &mut [f32]) {
    let width = along.len();
    let shifted = |row: usize, dx: usize| &rows[row][dx..dx + width];
    let (a0, a1, a2) = (shifted(0, 0), shifted(0, 1), shifted(0, 2));
    let (b0, b2) = (shifted(1, 0), shifted(1, 2));
    let (c0, c1, c2) = (shifted(2, 0), shifted(2, 1), shifted(2, 2));
    let down = &mut down[..width];
    for x in 0..width {
        let (rising, falling) = (c2[x] - a0[x], c0[x] - a2[x]);
        along[x] = 2.0 * (b2[x] - b0[x]) + (rising - falling);
        down[x] = 2.0 * (c1[x] - a1[x]) + (rising + falling);
    }
}

/// Marks every pixel of the middle one of three rows with the cut it lists. Zero counts as positive.
#[multiversion(targets("x86_64+avx2+fma"))]
fn mark(rows: [&[f32]; 3], marks: &mut [u8]) {
    let width = marks.len();
    let shifted = |row: usize, dx: usize| &rows[row][dx..dx + width];
    let (above, above_right) = (shifted(0, 1), shifted(0, 2));
    let (left, here, right) = (shifted(1, 0), shifted(1, 1), shifted(1, 2));
    let (below_left, below, below_right) = (shifted(2, 0), shifted(2, 1), shifted(2, 2));
    for x in 0..width {
        let (a, r, b) = (here[x], right[x], below[x]);

        let along = (r - a).abs();
        let down = 0.25 * (b + below_right[x] - above[x] - above_right[x]).abs();
        let cut = ((a < 0.0) != (r < 0.0)) & (along > ROUNDING);
        let row = cut & (down <= NEARLY_HORIZONTAL * along);

        let down = (b - a).abs();
        let along = 0.25 * (r + below_right[x] - left[x] - below_left[x]).abs();
        let cut = ((a < 0.0) != (b < 0.0)) & (down > ROUNDING);
        // The pixel the cut is nearer to, and whether its row is cut nearer to it than to its neighbours.
        let upper = a.abs() < b.abs();
        let choose = |u: f32, l: f32| if upper { u } else { l };
        let near = choose(a, b);
        let cuts_near =
            |beside: f32| ((beside < 0.0) != (near < 0.0)) & (near.abs() <= beside.abs());
        let near_row =
            cuts_near(choose(left[x], below_left[x])) | cuts_near(choose(r, below_right[x]));
        let doubled = near_row & (down <= NEARLY_HORIZONTAL * along);
        let column = cut & !doubled & !row;

        marks[x] = (u8::from(row) * ROW) | (u8::from(column) * COLUMN);
    }
}

/// Collects the pixels that list a cut, left to right, and says how many.
#[multiversion(targets("x86_64+avx2+fma"))]
fn collect(marks: &[u8], pixels: &mut [u32]) -> usize {
    let mut count = 0;
    for (word, marks) in marks.as_chunks::<WORD>().0.iter().enumerate() {
        let mut left = marked(marks);
        while left != 0 {
            pixels[count] = (word * WORD) as u32 + left.trailing_zeros();
            left &= left - 1;
            count += 1;
        }
    }
    count
}

/// The marks that are set, one bit a pixel.
#[inline(always)]
fn marked(marks: &[u8; WORD]) -> u64 {
    let mut bits = 0;
    for (i, marks) in marks.as_chunks().0.iter().enumerate() {
        let bytes = u64::from_le_bytes(*marks);
        let ones = (bytes | (bytes >> 1)) & 0x0101_0101_0101_0101;
        // The product moves byte i to bit 56 + i; no two meet.
        bits |= (ones.wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * i);
    }
    bits
}

/// What there is to know where a batch of cuts is, each property for itself.
struct Cuts {
    /// The column of the pixel that lists the cut.
    column: [i32; BATCH],
    /// 1 for a cut of the column, 0 for one of the row.
    is_down: [i32; BATCH],
    /// ∇²G at four neighbours in line; the cut is between the second, the pixel that lists it, and the third.
    values: [[f32; BATCH]; 4],
    /// Sobel's operator along at the pixel and at its neighbour.
    along: [[f32; BATCH]; 2],
    /// Sobel's operator down at the pixel and at its neighbour.
    down: [[f32; BATCH]; 2],
}

impl Cuts {
    /// Cuts that can be measured, as the rest of a batch is, but mean nothing.
    const NONE: Self = Self {
        column: [0; BATCH],
        is_down: [0; BATCH],
        values: [[1.0; BATCH], [1.0; BATCH], [-1.0; BATCH], [-1.0; BATCH]],
        along: [[0.0; BATCH]; 2],
        down: [[0.0; BATCH]; 2],
    };
}

/// What is made of it.
#[derive(Default)]
struct Measured {
    x: [f32; BATCH],
    y: [f32; BATCH],
    magnitude: [f32; BATCH],
    orientation: [f32; BATCH],
    /// How far into its pixel a cut is, in steps of interpolation.
    fraction: [i32; BATCH],
    /// 1 where the row below is nearer.
    lower: [i32; BATCH],
}

/// Lists the cuts of these pixels of row `y` as edges, those above the floor, and says how many.
#[multiversion(targets("x86_64+avx2+fma"))]
fn list(
    pixels: &[u32],
    marks: &[u8],
    view: &View,
    gradients: &Gradients,
    y: usize,
    edges: &mut [Edge],
) -> usize {
    let width = gradients.along.len() / 2;
    let (values, pixel, stride) = view.filtered.around(y);
    let (steady, steady_stride) = view.gray.steady_from(y);
    let [this, next] = [y % 2 * width, (y + 1) % 2 * width];
    let (along, down) = (&gradients.along[..2 * width], &gradients.down[..2 * width]);
    let mut cuts = Cuts::NONE;
    let mut measured = Measured::default();
    let mut profiles = Profiles::NONE;
    let mut samples = [[0; 8]; BATCH];
    let mut listed = 0;
    for pixels in pixels.chunks(BATCH) {
        for (i, &column) in pixels.iter().enumerate() {
            let x = column as usize;
            // Reckoned rather than chosen: whoever chooses, branches.
            let is_down = usize::from(marks[x] / COLUMN);
            let (here, below) = (this + x, next + x);
            let beside =
                (here + 1).wrapping_add(is_down.wrapping_mul(below.wrapping_sub(here + 1)));
            cuts.column[i] = column as i32;
            cuts.is_down[i] = is_down as i32;
            let step = 1 + is_down * (stride - 1);
            for (place, values_here) in cuts.values.iter_mut().enumerate() {
                values_here[i] = values[pixel + x - step + place * step];
            }
            cuts.along[0][i] = along[here];
            cuts.along[1][i] = along[beside];
            cuts.down[0][i] = down[here];
            cuts.down[1][i] = down[beside];
        }
        measure(&cuts, y as f32, view, &mut measured);
        for (i, &column) in pixels.iter().enumerate() {
            let window = column as usize + measured.lower[i] as usize * steady_stride;
            profiles.take(i, &steady[window..], measured.fraction[i] as u8);
        }
        profiles.interpolate(&mut samples);
        for (i, &profile) in samples.iter().enumerate().take(pixels.len()) {
            // Written in any case, kept when it counts: no branch.
            edges[listed] = Edge {
                x: measured.x[i],
                y: measured.y[i],
                magnitude: measured.magnitude[i],
                orientation: measured.orientation[i],
                profile,
            };
            listed += usize::from(measured.magnitude[i] > view.floor);
        }
    }
    listed
}

/// Places and measures cuts in row `y`.
#[inline(always)]
fn measure(cuts: &Cuts, y: f32, view: &View<'_>, measured: &mut Measured) {
    let scale = view.scale / SOBEL;
    for i in 0..BATCH {
        let [before, a, b, after] = [0, 1, 2, 3].map(|place| cuts.values[place][i]);
        let t = a / (a - b);
        // The cubic through all four values: one step of Newton's method from where the line is zero.
        let [bend_a, bend_b] = [before - 2.0 * a + b, a - 2.0 * b + after];
        let bend = ((2.0 - t) * bend_a + (1.0 + t) * bend_b) / 6.0;
        let slope = (b - a) - (1.0 - 2.0 * t) * bend - t * (1.0 - t) * (bend_b - bend_a) / 6.0;
        let correction = t * (1.0 - t) * bend / slope;
        let t = (t + correction.clamp(-view.correction, view.correction)).clamp(0.0, 1.0);
        let is_down = cuts.is_down[i] as f32;
        let steps = steps(t, is_down);
        let (down, along) = (steps * is_down, steps * (1.0 - is_down));
        measured.x[i] = within(cuts.column[i] as f32, along * (1.0 / STEPS));
        measured.y[i] = within(y, down * (1.0 / STEPS));
        measured.fraction[i] = along as i32;
        measured.lower[i] = i32::from(down >= STEPS / 2.0);

        let between = |[a, b]: [f32; 2]| a + t * (b - a);
        let gx = between([cuts.along[0][i], cuts.along[1][i]]);
        let gy = between([cuts.down[0][i], cuts.down[1][i]]);
        measured.orientation[i] = Edge::orientation_of(Edge::orientation_steps(direction(gx, gy)));
        let magnitude = in_steps((gx * gx + gy * gy).sqrt() * scale);
        // A line that only touches zero, in one pixel and from below, is not cut: it goes under any floor.
        let touches = ((a == 0.0) & (before < 0.0)) | ((b == 0.0) & (after < 0.0));
        measured.magnitude[i] = if touches { -1.0 } else { magnitude };
    }
}

/// Steps of place to a pixel.
const STEPS: f32 = Edge::PIXEL_STEPS as f32;

/// A part of a pixel in whole steps, fewer than make a pixel; of a cut of the column one at least, for a whole row is what
/// cuts of rows have.
#[inline(always)]
fn steps(part: f32, least: f32) -> f32 {
    nearest(part * STEPS).min(STEPS - 1.0).max(least)
}

/// A magnitude in whole steps, the nearest that says whether it is any.
#[inline(always)]
fn in_steps(magnitude: f32) -> f32 {
    const STEPS: f32 = Edge::MAGNITUDE_STEPS as f32;
    let least = if magnitude > 0.0 { 1.0 } else { 0.0 };
    nearest(magnitude * STEPS).min(65_535.0).max(least) * (1.0 / STEPS)
}

/// A number from `whole` up to, never at, the next whole number.
#[inline(always)]
fn within(whole: f32, fraction: f32) -> f32 {
    let next = whole + 1.0;
    (whole + fraction).min(f32::from_bits(next.to_bits() - 1))
}

/// The minimax polynomial of atan(a)/a in a² over 0 … 1, to within 4·10⁻⁸.
const ARCTANGENT: [f32; 8] = [
    0.999_999_34,
    -0.333_298_6,
    0.199_465_66,
    -0.139_086_3,
    0.096_421_964,
    -0.055_912_316,
    0.021_862_95,
    -0.004_054_565,
];

/// atan2(`y`, `x`) in (−π, π] to within 10⁻⁶, without a branch.
#[inline(always)]
fn direction(x: f32, y: f32) -> f32 {
    use std::f32::consts::{FRAC_PI_2, PI};
    let (ax, ay) = (x.abs(), y.abs());
    let a = ax.min(ay) / ax.max(ay).max(f32::MIN_POSITIVE);
    let s = a * a;
    let mut r = ARCTANGENT.iter().rev().fold(0.0, |r, c| r * s + c) * a;
    r = if ay > ax { FRAC_PI_2 - r } else { r };
    r = if x < 0.0 { PI - r } else { r };
    if y < 0.0 { -r } else { r }
}

/// The largest square of a magnitude, or `start`.
#[multiversion(targets("x86_64+avx2+fma"))]
fn largest_square(along: &[f32], down: &[f32], start: f32) -> f32 {
    let squares = along.iter().zip(down).map(|(x, y)| x * x + y * y);
    squares.fold(
        start,
        |largest, square| if square > largest { square } else { largest },
    )
}

#[cfg(test)]
mod tests {
    use messages::Size;

    use super::*;
    use crate::smooth::Gaussian;

    /// The edges of a picture all of whose rows show these values of ∇²G.
    fn edges_of_rows(row: &[f32]) -> Vec<Edge> {
        edges(&[row; 3])
            .into_iter()
            .filter(|edge| edge.y == 0.0)
            .collect()
    }

    /// The edges of a picture of these values of ∇²G over a ramp, so that every gradient is the same.
    fn edges(values: &[&[f32]]) -> Vec<Edge> {
        let size = Size::new(values[0].len() as u32, values.len() as u32);
        let ramp: Vec<u8> = (0..size.pixels())
            .map(|i| (i % values[0].len() * 10) as u8)
            .collect();
        let mut filtered = Picture::default();
        filtered.resize(size);
        for (y, row) in values.iter().enumerate() {
            filtered.pair_mut(y).0.copy_from_slice(row);
        }
        filtered.mirror();
        let mut smoothed = Picture::default();
        let mut gray = Gray::new(size);
        gray.read(&ramp, size);
        gray.steady();
        Gaussian::new(0.0, size).apply(gray.pixels(), size, &mut smoothed);
        let view = View {
            filtered: &filtered,
            smoothed: &smoothed,
            gray: &gray,
            correction: 0.0,
            scale: 1.0,
            floor: 0.0,
        };
        let mut crossings = Crossings::default();
        crossings.resize(values[0].len());
        let mut slots = vec![Edge::default(); size.pixels()];
        let mut list = List::new(&mut slots);
        for y in 0..values.len() {
            crossings.row(&view, y, &mut list);
        }
        list.to_vec()
    }

    #[test]
    fn a_zero_between_unlike_neighbours_is_one_crossing_and_lies_there() {
        for row in [
            [3.0, 1.0, 0.0, -1.0, -2.0, -3.0],
            [-3.0, -1.0, 0.0, 1.0, 2.0, 3.0],
        ] {
            let places: Vec<f32> = edges_of_rows(&row).iter().map(|e| e.x).collect();
            assert_eq!(places.len(), 1, "{row:?}");
            // The pixel before owns it, and ends a step short of it.
            assert!((places[0] - 2.0).abs() <= 1.0 / 256.0, "{places:?}");
        }
    }

    #[test]
    fn a_zero_between_like_neighbours_is_no_crossing() {
        for sign in [1.0, -1.0] {
            let touching = [3.0, 1.0, 0.0, 1.0, 2.0, 3.0].map(|v| v * sign);
            assert_eq!(edges_of_rows(&touching), [], "{touching:?}");
            let down: Vec<[f32; 4]> = touching.iter().map(|&v| [v; 4]).collect();
            assert_eq!(
                edges(&down.iter().map(<[f32; 4]>::as_slice).collect::<Vec<_>>()),
                [],
                "{touching:?}, down"
            );
        }
    }

    #[test]
    fn what_rounding_leaves_of_nothing_is_no_crossing() {
        let row = [1e-6, -1e-6, 3e-6, -2e-6, 0.0, -0.0];
        assert_eq!(edges(&[&row, &row.map(|v| -v)]), []);
    }

    #[test]
    fn a_crossing_next_to_a_pixel_still_belongs_to_the_pixel_before() {
        let row = [1.0, 1.0, -1e-9, -1.0, -1.0, -1.0];
        let found = edges_of_rows(&row);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].x.floor(), 1.0);
    }

    #[test]
    fn directions_are_those_of_the_arcus_tangens() {
        for i in 0..10_000 {
            let angle = f64::from(i) / 10_000.0 * std::f64::consts::TAU;
            let (x, y) = ((7.0 * angle.cos()) as f32, (7.0 * angle.sin()) as f32);
            assert!((direction(x, y) - y.atan2(x)).abs() < 1e-6, "({x}, {y})");
        }
        assert_eq!(direction(-1.0, 0.0), std::f32::consts::PI);
        assert_eq!(direction(-1.0, -0.0), std::f32::consts::PI);
        assert_eq!(direction(0.0, 0.0), 0.0);
    }

    #[test]
    fn the_steps_of_a_pixel_are_counted_from_0_to_one_less_than_all() {
        assert_eq!(
            [0.0, 0.25, 0.5, 0.999, 1.0].map(|part| steps(part, 0.0)),
            [0.0, 64.0, 128.0, 255.0, 255.0]
        );
        // A cut of the column never lies in a row.
        assert_eq!(
            [0.0, 0.001, 0.003, 1.0].map(|part| steps(part, 1.0)),
            [1.0, 1.0, 1.0, 255.0]
        );
    }

    #[test]
    fn a_magnitude_is_the_nearest_step_and_none_becomes_nothing() {
        assert_eq!(
            [0.0, 1e-9, 0.0061, 2.5, 255.0, 1e9].map(in_steps),
            [0.0, 1.0 / 256.0, 2.0 / 256.0, 2.5, 255.0, 65_535.0 / 256.0]
        );
    }
}
