//! Smoothing before Sobel's operator.

use messages::Size;
use multiversion::multiversion;

use crate::picture::{Picture, mirrored};

/// The reach of the Gaussian in σ: beyond it less than 10⁻⁴ of its weight.
const REACH_SIGMAS: f32 = 4.0;

/// A Gaussian, along the rows and down the columns.
///
/// Its weights are few where it is narrow, as it is best for gradients: at σ = 0.5 this takes a sixth of the time of
/// one more channel of the spectrum; from σ = 3 on it takes longer.
#[derive(Debug)]
pub(crate) struct Gaussian {
    /// From the centre outwards.
    weights: Vec<f32>,
    /// A row, smoothed down the columns, with mirrored margins.
    line: Vec<f32>,
}

impl Gaussian {
    /// One of this σ, for images up to `max`.
    pub(crate) fn new(sigma: f32, max: Size) -> Self {
        let reach = (REACH_SIGMAS * sigma).ceil() as usize;
        let weight =
            |k: usize| (-0.5 * (k as f64 / f64::from(sigma.max(f32::MIN_POSITIVE))).powi(2)).exp();
        let sum = weight(0) + 2.0 * (1..=reach).map(weight).sum::<f64>();
        Self {
            weights: (0..=reach).map(|k| (weight(k) / sum) as f32).collect(),
            line: vec![0.0; max.width as usize + 2 * reach],
        }
    }

    /// Shows an image smoothed, with mirrored margins.
    pub(crate) fn apply(&mut self, pixels: &[u8], size: Size, picture: &mut Picture) {
        let (width, height) = (size.width as usize, size.height as usize);
        let reach = self.weights.len() - 1;
        if self.line.len() < width + 2 * reach {
            self.line.resize(width + 2 * reach, 0.0);
        }
        let line = &mut self.line[..width + 2 * reach];
        let row = |y: isize| {
            let y = mirrored(y, height);
            &pixels[y * width..(y + 1) * width]
        };
        picture.resize(size);
        for y in 0..height {
            let signed = y as isize;
            let inner = &mut line[reach..reach + width];
            begin_down(row(signed), self.weights[0], inner);
            for (k, &weight) in (1..).zip(&self.weights[1..]) {
                add_down([row(signed - k), row(signed + k)], weight, inner);
            }
            for k in 0..reach {
                line[reach - 1 - k] = line[reach + mirrored(-1 - k as isize, width)];
                line[reach + width + k] = line[reach + mirrored((width + k) as isize, width)];
            }
            add_along(line, &self.weights, picture.pair_mut(y).0);
        }
        picture.mirror();
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn begin_down(row: &[u8], weight: f32, line: &mut [f32]) {
    for (value, &pixel) in line.iter_mut().zip(row) {
        *value = weight * f32::from(pixel);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn add_down(rows: [&[u8]; 2], weight: f32, line: &mut [f32]) {
    for ((value, &a), &b) in line.iter_mut().zip(rows[0]).zip(rows[1]) {
        *value += weight * f32::from(u16::from(a) + u16::from(b));
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn add_along(line: &[f32], weights: &[f32], smoothed: &mut [f32]) {
    let width = smoothed.len();
    let reach = weights.len() - 1;
    for (value, middle) in smoothed.iter_mut().zip(&line[reach..]) {
        *value = weights[0] * middle;
    }
    for (k, &weight) in weights.iter().enumerate().skip(1) {
        let (left, right) = (&line[reach - k..][..width], &line[reach + k..][..width]);
        for ((value, a), b) in smoothed.iter_mut().zip(left).zip(right) {
            *value += weight * (a + b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Gaussian in the plane, pixel by pixel, the image continued by its reflection.
    fn obvious(pixels: &[u8], size: Size, sigma: f64) -> Vec<f64> {
        let reach = (6.0 * sigma).ceil() as isize;
        let (width, height) = (size.width as usize, size.height as usize);
        let at = |i: usize| {
            let (x, y) = ((i % width) as isize, (i / width) as isize);
            let (mut sum, mut weights) = (0.0, 0.0);
            for (dx, dy) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)))
            {
                let weight = (-((dx * dx + dy * dy) as f64) / (2.0 * sigma * sigma)).exp();
                sum += weight
                    * f64::from(pixels[mirrored(y + dy, height) * width + mirrored(x + dx, width)]);
                weights += weight;
            }
            sum / weights
        };
        (0..size.pixels()).map(at).collect()
    }

    #[test]
    fn both_passes_together_are_the_gaussian_in_the_plane() {
        for (width, height, sigma) in [(33, 32, 0.5), (40, 37, 1.0), (32, 45, 2.7), (32, 32, 9.0)] {
            let size = Size::new(width, height);
            let pixels: Vec<u8> = (0..size.pixels()).map(|i| (i * i % 251) as u8).collect();
            let mut picture = Picture::default();
            Gaussian::new(sigma, size).apply(&pixels, size, &mut picture);
            let expected = obvious(&pixels, size, sigma.into());
            for y in 0..height as usize {
                for (value, expected) in picture
                    .pixels(y)
                    .iter()
                    .zip(&expected[y * width as usize..])
                {
                    assert!(
                        (f64::from(*value) - expected).abs() < 0.05,
                        "{value}, not {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn no_smoothing_shows_the_image_as_it_is() {
        let size = Size::new(35, 32);
        let pixels: Vec<u8> = (0..size.pixels()).map(|i| (i * 7 % 256) as u8).collect();
        let mut picture = Picture::default();
        Gaussian::new(0.0, size).apply(&pixels, size, &mut picture);
        let shown: Vec<u8> = (0..32)
            .flat_map(|y| picture.pixels(y))
            .map(|&v| v as u8)
            .collect();
        assert_eq!(shown, pixels);
    }
}
