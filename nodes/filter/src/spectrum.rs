//! The spectrum of a view, and ∇²G made of it.
//!
//! Two real rows share one complex transform, forward as real and imaginary part, and so do two rows on the way
//! back: that needs half the work of a transform a row, and on 512 columns it is 1.8 times as fast as transforms made
//! for real input. Only columns 0 … n/2 of the spectrum are kept (the others are their conjugates), each contiguous.
//! A channel drops the columns it weighs next to nothing.
//!
//! The image is continued by its own reflection on all sides; the circle the transform sees closes in the middle of
//! the margin, out of every channel's reach.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use messages::Size;
use multiversion::multiversion;
use num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use crate::picture::{Picture, mirrored};

/// Weights below this part of the largest are nothing: less than rounding adds.
const NEGLIGIBLE: f64 = 1e-6;
/// The margin in σ: beyond it, ∇²G has less than 10⁻⁴ of its weight.
const MARGIN_SIGMAS: f64 = 5.0;
/// Rows or columns that are turned into the other together: as many complex values as fill a cache line. Turning
/// reads far apart and writes close together; the other way round, the processor waits for every write.
const GROUP: usize = 8;

/// The number of frequencies, from 0 up, of a transform of length `n` that ∇²G does not all but drop.
fn reach(variance: f64, n: usize) -> usize {
    // In terms of e = σ²ω²/2 the weight is e·exp(−e), but for a constant: largest at e = 1, falling from there on.
    let kept = |k: &usize| {
        let e = 0.5 * variance * angular(*k, n).powi(2);
        e <= 1.0 || e * (1.0 - e).exp() > NEGLIGIBLE
    };
    (0..=n / 2).take_while(kept).count()
}

/// The angular frequency of index `k` of a transform of length `n`, in radians per pixel, without its sign.
fn angular(k: usize, n: usize) -> f64 {
    std::f64::consts::TAU * k.min(n - k) as f64 / n as f64
}

/// A channel's weights −|ω|²·exp(−σ²|ω|²/2) for one size, kept as (x₀ + y₀)·x₁·y₁ for column and row.
#[derive(Debug)]
struct Weights {
    /// Columns that are not negligible.
    columns: usize,
    /// Rows from 0 up, and as many from the end, that are not negligible.
    rows: usize,
    by_column: Vec<[f32; 2]>,
    /// Each twice: once for the real and once for the imaginary part.
    row_squares: Vec<f32>,
    row_factors: Vec<f32>,
}

impl Weights {
    fn new(variance: f64, padded: Size) -> Self {
        let (width, height) = (padded.width as usize, padded.height as usize);
        let square = |omega: f64| omega * omega;
        let factor = |omega: f64| (-0.5 * variance * omega * omega).exp();
        // Taking joined rows apart counts twice; neither transform divides by its length.
        let scale = -0.5 / padded.pixels() as f64;
        let columns = reach(variance, width);
        let by_column = |kx| {
            let omega = angular(kx, width);
            [square(omega) as f32, (scale * factor(omega)) as f32]
        };
        let twice = |of: &dyn Fn(f64) -> f64| {
            (0..2 * height)
                .map(|i| of(angular(i / 2, height)) as f32)
                .collect()
        };
        Self {
            columns,
            rows: reach(variance, height),
            by_column: (0..columns).map(by_column).collect(),
            row_squares: twice(&square),
            row_factors: twice(&factor),
        }
    }
}

/// All that depends on the size only.
struct Plan {
    size: Size,
    padded: Size,
    /// For every column after the image the column it mirrors.
    beside: Vec<usize>,
    /// For every row after the image the row it mirrors.
    below: Vec<usize>,
    rows_forward: Arc<dyn Fft<f32>>,
    rows_inverse: Arc<dyn Fft<f32>>,
    columns_forward: Arc<dyn Fft<f32>>,
    columns_inverse: Arc<dyn Fft<f32>>,
    /// Columns that any channel uses.
    columns: usize,
    weights: Vec<Weights>,
}

impl Plan {
    fn new(planner: &mut FftPlanner<f32>, channels: &[f32], size: Size) -> Self {
        let sigma = channels
            .iter()
            .fold(0.0, |a: f64, &v| a.max(v.into()))
            .sqrt();
        let margin = (MARGIN_SIGMAS * sigma).ceil() as usize;
        let length = |n: u32| fast_length(n as usize + 2 * margin);
        let (width, height) = (length(size.width), length(size.height));
        let padded = Size::new(width as u32, height as u32);
        let after = |n: u32, padded: usize| {
            let n = n as usize;
            let seen = move |p| {
                if p < n.midpoint(padded) {
                    p as isize
                } else {
                    p as isize - padded as isize
                }
            };
            (n..padded).map(|p| mirrored(seen(p), n)).collect()
        };
        let weights: Vec<_> = channels
            .iter()
            .map(|&variance| Weights::new(variance.into(), padded))
            .collect();
        Self {
            size,
            padded,
            beside: after(size.width, width),
            below: after(size.height, height),
            rows_forward: planner.plan_fft_forward(width),
            rows_inverse: planner.plan_fft_inverse(width),
            columns_forward: planner.plan_fft_forward(height),
            columns_inverse: planner.plan_fft_inverse(height),
            columns: weights.iter().map(|w| w.columns).max().unwrap_or(0),
            weights,
        }
    }

    fn scratch(&self) -> usize {
        let all = [
            &self.rows_forward,
            &self.rows_inverse,
            &self.columns_forward,
            &self.columns_inverse,
        ];
        let scratch = |fft: &Arc<dyn Fft<f32>>| {
            fft.get_inplace_scratch_len()
                .max(fft.get_outofplace_scratch_len())
        };
        all.map(scratch).into_iter().max().unwrap_or(0)
    }

    /// From one column of the spectrum to the next; the extra line keeps them out of each other's cache sets.
    fn stride(&self) -> usize {
        (self.padded.height as usize).next_multiple_of(GROUP) + GROUP
    }
}

/// A length of at least `n` whose transform is fast: 2ᵃ·3ᵇ with a ≥ 3, or 2ᵃ times 5, 7 or 11 with a ≥ 5; others were
/// measured up to twice as slow.
fn fast_length(n: usize) -> usize {
    let is_fast = |n: &usize| {
        let (twos, mut rest) = (n.trailing_zeros(), n >> n.trailing_zeros());
        if twos >= 5 && matches!(rest, 5 | 7 | 11) {
            return true;
        }
        while rest.is_multiple_of(3) {
            rest /= 3;
        }
        twos >= 3 && rest == 1
    };
    (n.max(8)..).find(is_fast).unwrap_or(n)
}

/// A cache line of complex values: where they start, a line starts.
#[repr(C, align(64))]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Line([Complex<f32>; GROUP]);

/// Complex values that start at a cache line.
#[derive(Default)]
struct Buffer(Vec<Line>);

impl Buffer {
    /// Room for at least this many values.
    fn grow(&mut self, len: usize) {
        if self.0.len() * GROUP < len {
            self.0.resize(len.div_ceil(GROUP), Line::zeroed());
        }
    }

    fn as_mut(&mut self, len: usize) -> &mut [Complex<f32>] {
        &mut cast_slice_mut(&mut self.0)[..len]
    }
}

/// The spectrum of the latest view, and plans for every size seen.
pub(crate) struct Spectrum {
    /// σ² of each.
    channels: Vec<f32>,
    planner: FftPlanner<f32>,
    plans: Vec<Plan>,
    current: usize,
    /// Column by column.
    values: Buffer,
    /// All row pairs on their way there, all columns on their way back.
    work: Buffer,
    /// A few row pairs on their way back.
    lines: Buffer,
    scratch: Vec<Complex<f32>>,
}

impl Spectrum {
    /// Room and plans for views up to `max`, seen in channels of these σ².
    pub(crate) fn new(channels: &[f32], max: Size) -> Self {
        let mut spectrum = Self {
            channels: channels.to_vec(),
            planner: FftPlanner::new(),
            plans: Vec::new(),
            current: 0,
            values: Buffer::default(),
            work: Buffer::default(),
            lines: Buffer::default(),
            scratch: Vec::new(),
        };
        spectrum.select(max);
        spectrum
    }

    /// Makes the plan for this size the current one.
    fn select(&mut self, size: Size) {
        if let Some(known) = self.plans.iter().position(|plan| plan.size == size) {
            self.current = known;
            return;
        }
        let plan = Plan::new(&mut self.planner, &self.channels, size);
        let width = plan.padded.width as usize;
        let columns = plan.stride() * plan.columns;
        self.values.grow(columns);
        self.work
            .grow(columns.max(width * (size.height as usize).div_ceil(2)));
        let height = plan.padded.height as usize;
        self.lines.grow(height.max((width + GROUP) * GROUP / 2));
        if self.scratch.len() < plan.scratch() {
            self.scratch.resize(plan.scratch(), Complex::default());
        }
        self.current = self.plans.len();
        self.plans.push(plan);
    }

    /// Transforms a view.
    pub(crate) fn analyse(&mut self, pixels: &[u8], size: Size) {
        self.select(size);
        let plan = &self.plans[self.current];
        let (width, height) = (size.width as usize, size.height as usize);
        let (padded_width, padded_height) =
            (plan.padded.width as usize, plan.padded.height as usize);
        let stride = plan.stride();

        let lines = self.work.as_mut(height.div_ceil(2) * padded_width);
        for (pair, line) in pixels
            .chunks(2 * width)
            .zip(lines.chunks_exact_mut(padded_width))
        {
            let (first, second) = pair.split_at(width);
            join(first, second, &mut line[..width]);
            for (i, &x) in plan.beside.iter().enumerate() {
                line[width + i] = line[x];
            }
            plan.rows_forward
                .process_with_scratch(line, &mut self.scratch);
        }

        let values = self.values.as_mut(plan.columns * stride);
        for (group, columns) in values.chunks_mut(GROUP * stride).enumerate() {
            separate(lines, padded_width, group * GROUP, columns, stride);
            for column in columns.chunks_exact_mut(stride) {
                for (i, &y) in plan.below.iter().enumerate() {
                    column[height + i] = column[y];
                }
                let column = &mut column[..padded_height];
                plan.columns_forward
                    .process_with_scratch(column, &mut self.scratch);
            }
        }
    }

    /// Writes ∇²G of the latest view in a channel, without mirrored margins.
    pub(crate) fn apply(&mut self, channel: usize, picture: &mut Picture) {
        let plan = &self.plans[self.current];
        let weights = &plan.weights[channel];
        let height = plan.size.height as usize;
        let (padded_width, padded_height) =
            (plan.padded.width as usize, plan.padded.height as usize);
        let stride = plan.stride();

        let values = self.values.as_mut(weights.columns * stride);
        let columns = self.work.as_mut(weights.columns * stride);
        let weighed = self.lines.as_mut(padded_height);
        let pairs = values
            .chunks_exact(stride)
            .zip(columns.chunks_exact_mut(stride));
        for (kx, (from, to)) in pairs.enumerate() {
            weigh(from, weights, kx, weighed);
            let to = &mut to[..padded_height];
            plan.columns_inverse
                .process_outofplace_with_scratch(weighed, to, &mut self.scratch);
        }

        picture.resize(plan.size);
        for row in (0..height).step_by(GROUP) {
            let lines = self.lines.as_mut((padded_width + GROUP) * GROUP / 2);
            conjoin(columns, stride, row, lines, padded_width);
            let rows = (row..height.min(row + GROUP)).step_by(2);
            for (y, line) in rows.zip(lines.chunks_exact_mut(padded_width + GROUP)) {
                let line = &mut line[..padded_width];
                plan.rows_inverse
                    .process_with_scratch(line, &mut self.scratch);
                let (first, second) = picture.pair_mut(y);
                split(line, first, second.unwrap_or_default());
            }
        }
    }
}

/// Two rows of pixels as real and imaginary part; a missing second one is black. Around mid-gray, as rounding errors
/// grow with the values and ∇²G does not care for an offset.
#[multiversion(targets("x86_64+avx2+fma"))]
fn join(first: &[u8], second: &[u8], line: &mut [Complex<f32>]) {
    let value = |pixel: u8| f32::from(pixel) - 128.0;
    if second.is_empty() {
        for (z, &re) in line.iter_mut().zip(first) {
            *z = Complex::new(value(re), 0.0);
        }
    } else {
        for ((z, &re), &im) in line.iter_mut().zip(first).zip(second) {
            *z = Complex::new(value(re), value(im));
        }
    }
}

/// Takes the spectra of joined rows apart, each twice as large as it is: from lines of `width` to columns `first` and
/// following.
#[multiversion(targets("x86_64+avx2+fma"))]
fn separate(
    lines: &[Complex<f32>],
    width: usize,
    first: usize,
    columns: &mut [Complex<f32>],
    stride: usize,
) {
    for (pair, line) in lines.chunks_exact(width).enumerate() {
        for (i, column) in columns.chunks_exact_mut(stride).enumerate() {
            let kx = first + i;
            let (z, c) = (line[kx], line[if kx == 0 { 0 } else { width - kx }]);
            column[2 * pair] = Complex::new(z.re + c.re, z.im - c.im);
            column[2 * pair + 1] = Complex::new(z.im + c.im, c.re - z.re);
        }
    }
}

/// Weighs column `kx` of the spectrum.
#[multiversion(targets("x86_64+avx2+fma"))]
fn weigh(column: &[Complex<f32>], weights: &Weights, kx: usize, weighed: &mut [Complex<f32>]) {
    let height = weighed.len();
    let [square, factor] = weights.by_column[kx];
    let low = weights.rows.min(height);
    let high = (height + 1 - weights.rows).max(low);
    weighed[low..high].fill(Complex::default());
    for range in [0..low, high..height] {
        let squares = &weights.row_squares[2 * range.start..2 * range.end];
        let factors = &weights.row_factors[2 * range.start..2 * range.end];
        let from: &[f32] = cast_slice(&column[range.clone()]);
        let to: &mut [f32] = cast_slice_mut(&mut weighed[range]);
        for (((to, from), s), f) in to.iter_mut().zip(from).zip(squares).zip(factors) {
            *to = from * ((square + s) * (factor * f));
        }
    }
}

/// Joins the rows from `first` on of the columns, two by two, into lines of `width` that become real and imaginary
/// part.
#[multiversion(targets("x86_64+avx2+fma"))]
fn conjoin(
    columns: &[Complex<f32>],
    stride: usize,
    first: usize,
    lines: &mut [Complex<f32>],
    width: usize,
) {
    let count = columns.len() / stride;
    for line in lines.chunks_exact_mut(width + GROUP) {
        line[count..width.max(count)].fill(Complex::default());
    }
    for (kx, column) in columns.chunks_exact(stride).enumerate() {
        let Some(rows) = column[first..].first_chunk::<GROUP>() else {
            continue;
        };
        for (line, [p, q]) in lines
            .chunks_exact_mut(width + GROUP)
            .zip(rows.as_chunks().0)
        {
            line[kx] = Complex::new(p.re - q.im, p.im + q.re);
            // That of frequency 0 falls behind the line.
            line[width - kx] = Complex::new(p.re + q.im, q.re - p.im);
        }
    }
}

/// Real and imaginary part as two rows; the second may be missing.
#[multiversion(targets("x86_64+avx2+fma"))]
fn split(line: &[Complex<f32>], first: &mut [f32], second: &mut [f32]) {
    for (re, z) in first.iter_mut().zip(line) {
        *re = z.re;
    }
    for (im, z) in second.iter_mut().zip(line) {
        *im = z.im;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_lengths_hold_what_they_must_and_never_shrink() {
        let mut before = 0;
        for n in 1..5000 {
            let fast = fast_length(n);
            let rest = [2, 3, 5, 7, 11].into_iter().fold(fast, |mut rest, p| {
                while rest.is_multiple_of(p) {
                    rest /= p;
                }
                rest
            });
            assert!(
                fast >= n && fast.is_multiple_of(8) && rest == 1,
                "{fast} for {n}"
            );
            assert!(fast <= n + n / 4 + 8, "{fast} for {n}");
            // Room made for the largest image must do for every smaller one.
            assert!(fast >= before, "{fast} for {n}, {before} for one less");
            before = fast;
        }
    }

    #[test]
    fn what_a_channel_drops_is_negligible_and_what_it_keeps_is_not() {
        for variance in [0.5, 1.5, 8.0, 30.0, 400.0] {
            let weight = |k: usize| {
                let w2 = angular(k, 576).powi(2);
                w2 * (-0.5 * variance * w2).exp()
            };
            let largest = (0..=288).map(weight).fold(0.0, f64::max);
            let reach = reach(variance, 576);
            assert!(
                (reach..=288).all(|k| weight(k) < 2e-6 * largest),
                "σ² = {variance}"
            );
            assert!(weight(reach - 1) > 0.5e-6 * largest, "σ² = {variance}");
        }
    }
}
