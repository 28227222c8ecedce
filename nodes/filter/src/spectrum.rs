//! The spectrum of a view, and what the view looks like through a kernel.
//!
//! Two real rows share one complex transform, forward as real and imaginary part, and so do two rows on the way
//! back: that needs half the work of a transform a row, and on 512 columns it is 1.8 times as fast as transforms made
//! for real input. Only columns 0 … n/2 of the spectrum are kept (the others are their conjugates), each contiguous.
//! A kernel drops the columns it weighs next to nothing.
//!
//! The image is continued by its own reflection on all sides; the circle the transform sees closes in the middle of
//! the margin, out of every kernel's reach.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use messages::Size;
use multiversion::multiversion;
use num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use crate::picture::{Picture, mirrored};

/// Weights below this part of the kernel's largest are nothing: less than rounding adds.
const NEGLIGIBLE: f64 = 1e-6;
/// The margin in σ: beyond it, ∇²G has less than 10⁻⁴ of its weight.
const MARGIN_SIGMAS: f64 = 5.0;
/// Rows or columns that are turned into the other together: as many complex values as fill a cache line. Turning
/// reads far apart and writes close together; the other way round, the processor waits for every write.
const GROUP: usize = 8;

/// An even kernel, known by its weight for every frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kernel {
    /// ∇²G with this σ²: −|ω|²·exp(−σ²|ω|²/2).
    Laplacian(f32),
    /// G with this σ²: exp(−σ²|ω|²/2).
    Gaussian(f32),
}

impl Kernel {
    fn variance(self) -> f64 {
        match self {
            Self::Laplacian(variance) | Self::Gaussian(variance) => f64::from(variance),
        }
    }

    /// The number of frequencies, from 0 up, of a transform of length `n` that are not negligible.
    fn reach(self, n: usize) -> usize {
        let variance = self.variance();
        let (weight, peak): (fn(f64) -> f64, f64) = match self {
            Self::Laplacian(_) => (|e| e * (-e).exp(), 1.0),
            Self::Gaussian(_) => (|e| (-e).exp(), 0.0),
        };
        // In terms of e = σ²ω²/2 the weight has its largest at `peak` and falls from there on.
        let exponent = |k: usize| 0.5 * variance * angular(k, n).powi(2);
        let kept =
            |k: &usize| exponent(*k) <= peak || weight(exponent(*k)) > NEGLIGIBLE * weight(peak);
        (0..=n / 2).take_while(kept).count()
    }
}

/// The angular frequency of index `k` of a transform of length `n`, in radians per pixel, without its sign.
fn angular(k: usize, n: usize) -> f64 {
    std::f64::consts::TAU * k.min(n - k) as f64 / n as f64
}

/// A kernel's weights for one size: (x₀ + y₀)·x₁·y₁ for column and row.
#[derive(Debug)]
struct Weights {
    /// Columns that are not negligible.
    columns: usize,
    /// Rows from 0 up, and as many from the end, that are not negligible.
    rows: usize,
    by_column: Vec<[f32; 2]>,
    /// Each twice: once for the real and once for the imaginary part.
    row_terms: Vec<f32>,
    row_factors: Vec<f32>,
}

impl Weights {
    fn new(kernel: Kernel, padded: Size) -> Self {
        let (width, height) = (padded.width as usize, padded.height as usize);
        let factor = |omega: f64| (-0.5 * kernel.variance() * omega * omega).exp();
        let (term, constant, sign): (fn(f64) -> f64, f64, f64) = match kernel {
            Kernel::Laplacian(_) => (|omega| omega * omega, 0.0, -1.0),
            Kernel::Gaussian(_) => (|_| 0.0, 1.0, 1.0),
        };
        // The unseparated forward transform counts twice; neither transform divides by its length.
        let scale = sign * 0.5 / padded.pixels() as f64;
        let columns = kernel.reach(width);
        let by_column = |kx| {
            let omega = angular(kx, width);
            [
                (term(omega) + constant) as f32,
                (scale * factor(omega)) as f32,
            ]
        };
        let twice = |of: &dyn Fn(f64) -> f64| {
            (0..2 * height)
                .map(|i| of(angular(i / 2, height)) as f32)
                .collect()
        };
        Self {
            columns,
            rows: kernel.reach(height),
            by_column: (0..columns).map(by_column).collect(),
            row_terms: twice(&term),
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
    /// Columns that any kernel uses.
    columns: usize,
    weights: Vec<Weights>,
}

impl Plan {
    fn new(planner: &mut FftPlanner<f32>, kernels: &[Kernel], size: Size) -> Self {
        let sigma = kernels
            .iter()
            .map(|k| k.variance())
            .fold(0.0, f64::max)
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
        let weights: Vec<_> = kernels
            .iter()
            .map(|&kernel| Weights::new(kernel, padded))
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
        all.map(|fft| fft.get_inplace_scratch_len())
            .into_iter()
            .max()
            .unwrap_or(0)
    }

    /// From one column of the spectrum to the next; the extra line keeps them out of each other's cache sets.
    fn stride(&self) -> usize {
        (self.padded.height as usize).next_multiple_of(GROUP) + GROUP
    }
}

/// A length of at least `n` whose transform is fast: an even product of 2, 3 and 5.
fn fast_length(n: usize) -> usize {
    let divided = |mut n: usize, p: usize| {
        while n.is_multiple_of(p) {
            n /= p;
        }
        n
    };
    let cost = |n: &usize| {
        let without_five = divided(*n, 5);
        // Measured: a factor 5 makes the transform a quarter slower.
        let slower = if without_five < *n { 1.25 } else { 1.0 };
        slower * *n as f64 * (*n as f64).log2()
    };
    let smooth = |n: &usize| divided(divided(divided(*n, 2), 3), 5) == 1;
    // A power of two lies in every octave.
    (n..=2 * n)
        .filter(|n| n.is_multiple_of(2) && smooth(n))
        .min_by(|a, b| cost(a).total_cmp(&cost(b)))
        .unwrap_or(n.next_power_of_two())
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
    kernels: Vec<Kernel>,
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
    /// Room and plans for views up to `max`, seen through these kernels.
    pub(crate) fn new(kernels: Vec<Kernel>, max: Size) -> Self {
        let mut spectrum = Self {
            kernels,
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
        let plan = Plan::new(&mut self.planner, &self.kernels, size);
        let width = plan.padded.width as usize;
        let columns = plan.stride() * plan.columns;
        self.values.grow(columns);
        self.work
            .grow(columns.max(width * (size.height as usize).div_ceil(2)));
        self.lines
            .grow(((width + GROUP) * GROUP / 2).max(plan.padded.height as usize));
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

    /// Writes what the latest view looks like through a kernel, given by its index, without mirrored margins.
    pub(crate) fn apply(&mut self, kernel: usize, picture: &mut Picture) {
        let plan = &self.plans[self.current];
        let weights = &plan.weights[kernel];
        let height = plan.size.height as usize;
        let (padded_width, padded_height) =
            (plan.padded.width as usize, plan.padded.height as usize);
        let stride = plan.stride();

        let values = self.values.as_mut(weights.columns * stride);
        let tile = weights.columns * GROUP;
        let tiles = self
            .work
            .as_mut(weights.columns * height.next_multiple_of(GROUP));
        let column = self.lines.as_mut(padded_height);
        for (kx, from) in values.chunks_exact(stride).enumerate() {
            weigh(from, weights, kx, column);
            plan.columns_inverse
                .process_with_scratch(column, &mut self.scratch);
            scatter(column, kx, tiles, tile);
        }

        picture.resize(plan.size);
        for (group, tile) in tiles.chunks_exact(tile).enumerate() {
            let row = group * GROUP;
            let lines = self.lines.as_mut((padded_width + GROUP) * GROUP / 2);
            conjoin(tile, lines, padded_width);
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
/// grow with the values and no kernel's use cares for an offset.
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
    let [term, factor] = weights.by_column[kx];
    let low = weights.rows.min(height);
    let high = (height + 1 - weights.rows).max(low);
    weighed[low..high].fill(Complex::default());
    for range in [0..low, high..height] {
        let terms = &weights.row_terms[2 * range.start..2 * range.end];
        let factors = &weights.row_factors[2 * range.start..2 * range.end];
        let from: &[f32] = cast_slice(&column[range.clone()]);
        let to: &mut [f32] = cast_slice_mut(&mut weighed[range]);
        for (((to, from), t), f) in to.iter_mut().zip(from).zip(terms).zip(factors) {
            *to = from * ((term + t) * (factor * f));
        }
    }
}

/// Joins the rows from `first` on of the columns, two by two, into lines of `width` that become real and imaginary
/// part.
#[multiversion(targets("x86_64+avx2+fma"))]
fn conjoin(tile: &[Complex<f32>], lines: &mut [Complex<f32>], width: usize) {
    let columns = tile.as_chunks::<GROUP>().0;
    for line in lines.chunks_exact_mut(width + GROUP) {
        line[columns.len()..width].fill(Complex::default());
    }
    let (several, single) = columns.as_chunks::<SIDE>();
    for (i, columns) in several.iter().enumerate() {
        let kx = i * SIDE;
        for (pair, line) in lines.chunks_exact_mut(width + GROUP).enumerate() {
            let mut ahead = [Complex::default(); SIDE];
            let mut behind = [Complex::default(); SIDE];
            for i in 0..SIDE {
                let rows = columns[i].as_chunks().0;
                [ahead[i], behind[SIDE - 1 - i]] = conjoined(rows[pair % (GROUP / 2)]);
            }
            line[kx..kx + SIDE].copy_from_slice(&ahead);
            line[width + 1 - kx - SIDE..=width - kx].copy_from_slice(&behind);
        }
    }
    for (i, column) in single.iter().enumerate() {
        let kx = several.len() * SIDE + i;
        for (line, &pair) in lines
            .chunks_exact_mut(width + GROUP)
            .zip(column.as_chunks().0)
        {
            [line[kx], line[width - kx]] = conjoined(pair);
        }
    }
}

/// A value of two joined rows at a frequency and at its negative.
#[inline(always)]
fn conjoined([p, q]: [Complex<f32>; 2]) -> [Complex<f32>; 2] {
    [
        Complex::new(p.re - q.im, p.im + q.re),
        Complex::new(p.re + q.im, q.re - p.im),
    ]
}

const SIDE: usize = 4;

#[multiversion(targets("x86_64+avx2+fma"))]
fn scatter(column: &[Complex<f32>], kx: usize, tiles: &mut [Complex<f32>], tile: usize) {
    for (tile, rows) in tiles
        .chunks_exact_mut(tile)
        .zip(column.as_chunks::<GROUP>().0)
    {
        if let Some(to) = tile.as_chunks_mut::<GROUP>().0.get_mut(kx) {
            *to = *rows;
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
    fn fast_lengths_are_even_products_of_2_3_and_5_and_never_shrink() {
        let mut before = 0;
        for n in 1..5000 {
            let fast = fast_length(n);
            let rest = [2, 3, 5].into_iter().fold(fast, |mut rest, p| {
                while rest.is_multiple_of(p) {
                    rest /= p;
                }
                rest
            });
            assert!(
                fast >= n && fast < 2 * n + 2 && fast.is_multiple_of(2) && rest == 1,
                "{fast} for {n}"
            );
            // Room made for the largest image must do for every smaller one.
            assert!(fast >= before, "{fast} for {n}, {before} for one less");
            before = fast;
        }
    }

    #[test]
    fn what_a_kernel_drops_is_negligible_and_what_it_keeps_is_not() {
        for kernel in [0.5, 1.5, 8.0, 30.0, 400.0]
            .into_iter()
            .flat_map(|v| [Kernel::Laplacian(v), Kernel::Gaussian(v)])
        {
            let weight = |k: usize| {
                let w2 = angular(k, 576).powi(2);
                let gaussian = (-0.5 * kernel.variance() * w2).exp();
                if matches!(kernel, Kernel::Gaussian(_)) {
                    gaussian
                } else {
                    w2 * gaussian
                }
            };
            let largest = (0..=288).map(weight).fold(0.0, f64::max);
            let reach = kernel.reach(576);
            assert!(
                (reach..=288).all(|k| weight(k) < 2e-6 * largest),
                "{kernel:?}"
            );
            assert!(weight(reach - 1) > 0.5e-6 * largest, "{kernel:?}");
        }
    }
}
