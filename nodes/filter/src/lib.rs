//! Laplacian of Gaussian by FFT, zero-crossings, gradients.
//!
//! ```text
//! image ─► spectrum ─┬─► × −|ω|² exp(−σ²|ω|²/2) ─► zero-crossings ─► edges of a channel
//!       └► smoothed ─┴─► Sobel at the crossings ──────┘
//! ```

pub mod settings;

use messages::{Edge, EdgesRoom, ImageView, Size};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

pub use settings::{Scaling, Settings};

/// Turns views into zero-crossings, one view at a time, all channels from one transform.
pub struct Filter {
    settings: Settings,
    size: Size,
    padded: Size,
    pad: usize,
    image: Vec<u8>,
    spectrum: Vec<Complex<f32>>,
    work: Vec<Complex<f32>>,
    filtered: Vec<f32>,
    smoothed: Vec<f32>,
}

impl Filter {
    /// A filter for images up to `max`.
    pub fn new(settings: &Settings, _max: Size) -> Self {
        Self {
            settings: settings.clone(),
            size: Size::default(),
            padded: Size::default(),
            pad: 0,
            image: Vec::new(),
            spectrum: Vec::new(),
            work: Vec::new(),
            filtered: Vec::new(),
            smoothed: Vec::new(),
        }
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.settings.channels.len()
    }

    /// Takes the next view: everything its channels share is computed here.
    pub fn begin(&mut self, image: ImageView<'_>, size: Size) {
        self.size = size;
        let sigma = self
            .settings
            .channels
            .iter()
            .fold(0f32, |a, &b| a.max(b))
            .sqrt();
        self.pad = (5.0 * sigma).ceil() as usize;
        let even = |n: u32| (n as usize + 2 * self.pad).next_multiple_of(32) as u32;
        self.padded = Size::new(even(size.width), even(size.height));
        self.image.clear();
        self.image.extend_from_slice(image.pixels);
        self.spectrum.clear();
        for y in 0..self.padded.height as usize {
            for x in 0..self.padded.width as usize {
                let at = |p: usize, n: u32| mirror(p as isize - self.pad as isize, n as isize);
                let pixel =
                    image.pixels[at(y, size.height) * size.width as usize + at(x, size.width)];
                self.spectrum.push(Complex::new(f32::from(pixel), 0.0));
            }
        }
        let mut spectrum = std::mem::take(&mut self.spectrum);
        transform(&mut spectrum, self.padded, true);
        self.spectrum = spectrum;
    }

    /// Appends the zero-crossings of a channel of the view that began, in raster order.
    pub fn edges(&mut self, channel: usize, room: &mut EdgesRoom<'_>) {
        let variance = self.settings.channels[channel];
        let smoothing = self
            .settings
            .smoothing
            .map_or(variance - 0.5, |s| s * s)
            .max(0.0);
        self.filtered = self.filter(|w2| -w2 * (-0.5 * variance * w2).exp());
        self.smoothed = if smoothing > 0.0 {
            self.filter(|w2| (-0.5 * smoothing * w2).exp())
        } else {
            self.image.iter().map(|&p| f32::from(p)).collect()
        };
        let (w, h) = (self.size.width as usize, self.size.height as usize);
        let gradient = |x: usize, y: usize| {
            let at = |dx: isize, dy: isize| {
                let x = mirror(x as isize + dx, w as isize);
                let y = mirror(y as isize + dy, h as isize);
                self.smoothed[y * w + x]
            };
            let gx = at(1, -1) - at(-1, -1) + 2.0 * (at(1, 0) - at(-1, 0)) + at(1, 1) - at(-1, 1);
            let gy = at(-1, 1) - at(-1, -1) + 2.0 * (at(0, 1) - at(0, -1)) + at(1, 1) - at(1, -1);
            (gx / 8.0, gy / 8.0)
        };
        let scale = match self.settings.scaling {
            Scaling::Absolute => 1.0,
            Scaling::Picture => {
                let all = (0..w * h).map(|i| gradient(i % w, i / w));
                255.0 / all.map(|(gx, gy)| gx.hypot(gy)).fold(1e-6, f32::max)
            }
        };
        let f = &self.filtered;
        for y in 0..h {
            for x in 0..w {
                let a = f[y * w + x];
                let along = (x + 1 < w)
                    .then(|| f[y * w + x + 1])
                    .filter(|&b| (a < 0.0) != (b < 0.0));
                let across = (y + 1 < h)
                    .then(|| f[y * w + x + w])
                    .filter(|&b| (a < 0.0) != (b < 0.0));
                let (dx, dy, b) = match (along, across) {
                    (None, None) => continue,
                    (Some(b), None) => (1, 0, b),
                    (None, Some(b)) => (0, 1, b),
                    (Some(b), Some(c)) if 4.0 * (b - a).abs() >= (c - a).abs() => (1, 0, b),
                    (Some(_), Some(c)) => (0, 1, c),
                };
                let t = (a / (a - b)).min(0.999);
                let (ga, gb) = (gradient(x, y), gradient(x + dx, y + dy));
                let (gx, gy) = (ga.0 + t * (gb.0 - ga.0), ga.1 + t * (gb.1 - ga.1));
                let magnitude = gx.hypot(gy) * scale;
                if magnitude <= self.settings.floor {
                    continue;
                }
                let (ex, ey) = (x as f32 + t * dx as f32, y as f32 + t * dy as f32);
                let row = if dy == 1 && t >= 0.5 { y + 1 } else { y };
                let sample = |offset: f32| {
                    let place = (ex + offset).clamp(0.0, (w - 1) as f32);
                    let left = (place as usize).min(w - 2);
                    let s = place - left as f32;
                    let (a, b) = (self.image[row * w + left], self.image[row * w + left + 1]);
                    (f32::from(a) * (1.0 - s) + f32::from(b) * s + 0.5) as u8
                };
                room.edges.push(Edge {
                    x: ex,
                    y: ey,
                    magnitude,
                    orientation: gy.atan2(gx),
                    profile: Edge::PROFILE_OFFSETS.map(sample),
                });
            }
        }
    }

    /// The view with every frequency weighted by a function of |ω|².
    fn filter(&mut self, weight: impl Fn(f32) -> f32) -> Vec<f32> {
        let (w, h) = (self.padded.width as usize, self.padded.height as usize);
        self.work.clear();
        self.work.extend_from_slice(&self.spectrum);
        let omega = |k: usize, n: usize| std::f32::consts::TAU * k.min(n - k) as f32 / n as f32;
        for ky in 0..h {
            for kx in 0..w {
                let w2 = omega(kx, w).powi(2) + omega(ky, h).powi(2);
                self.work[ky * w + kx] *= weight(w2) / (w * h) as f32;
            }
        }
        transform(&mut self.work, self.padded, false);
        let rows = self
            .work
            .chunks(w)
            .skip(self.pad)
            .take(self.size.height as usize);
        rows.flat_map(|row| &row[self.pad..self.pad + self.size.width as usize])
            .map(|z| z.re)
            .collect()
    }
}

/// The pixel that `p` shows in a mirror that stands on the outer edges of the pixels 0 and `n` − 1.
fn mirror(p: isize, n: isize) -> usize {
    let p = p.rem_euclid(2 * n);
    p.min(2 * n - 1 - p) as usize
}

fn transform(data: &mut [Complex<f32>], size: Size, forward: bool) {
    let (w, h) = (size.width as usize, size.height as usize);
    let mut planner = FftPlanner::new();
    let mut plan = |n| {
        if forward {
            planner.plan_fft_forward(n)
        } else {
            planner.plan_fft_inverse(n)
        }
    };
    plan(w).process(data);
    let columns = plan(h);
    let mut transposed: Vec<_> = (0..w * h).map(|i| data[i % h * w + i / h]).collect();
    columns.process(&mut transposed);
    for (i, value) in transposed.into_iter().enumerate() {
        data[i % h * w + i / h] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Edges, Owned};

    #[test]
    fn a_vertical_step_is_found_where_it_is() {
        let size = Size::new(64, 48);
        let pixels: Vec<u8> = (0..size.pixels())
            .map(|i| if i % 64 < 30 { 50 } else { 200 })
            .collect();
        let mut filter = Filter::new(&Settings::default(), size);
        filter.begin(ImageView { pixels: &pixels }, size);
        for channel in 0..3 {
            let mut edges = Owned::<Edges>::new(size);
            edges.fill(|room| filter.edges(channel, room));
            assert_eq!(edges.view().edges.len(), 48);
            for edge in edges.view().edges {
                assert!(
                    (edge.x - 29.5).abs() < 1e-3 && edge.orientation.abs() < 1e-3,
                    "{edge:?}"
                );
            }
        }
    }
}
