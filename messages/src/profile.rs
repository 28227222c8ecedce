//! The gray levels beside an edge: what [`Edge::profile`](crate::Edge::profile) says follows from the view and from where
//! the edge is.
//!
//! ```text
//! view ─► averaged down the column ─► Steady ─► eight samples in the edge's row ─► profile
//! ```
//!
//! All is whole numbers, so that every machine makes the same bytes of the same view. A recording leaves profiles out that
//! follow from its images: what is changed here, older recordings would read otherwise.

use multiversion::multiversion;

use crate::elements::Edge;
use crate::header::Size;

/// Columns of margin on either side: profiles reach 6 columns and one pixel to interpolate with.
const MARGIN: usize = 8;
/// Columns a profile is taken from.
const WINDOW: usize = 2 * MARGIN;
/// Steps to a pixel in interpolation.
const STEPS: u16 = Edge::PIXEL_STEPS as u16;
/// Profiles that are interpolated together.
const BATCH: usize = 16;

/// A view that is steadied for profiles: averaged down the column with weights ¼ ½ ¼.
///
/// That takes the noise of the sensor down to 0.61 of itself, yet mixes nothing across the edges that matching along rows
/// depends on, those that stand upright.
#[derive(Clone, Debug, Default)]
pub struct Steady {
    width: usize,
    height: usize,
    /// Rows with margins that repeat the border pixels; behind the last row it once more.
    rows: Vec<u8>,
}

impl Steady {
    /// Room for views up to `max`.
    pub fn new(max: Size) -> Self {
        let (width, height) = (max.width as usize, max.height as usize);
        Self {
            width: 0,
            height: 0,
            rows: Vec::with_capacity((width + 2 * MARGIN) * (height + 1)),
        }
    }

    /// Steadies a view: `height` rows of `width` gray levels, and behind them what may be there.
    ///
    /// # Panics
    /// When there are fewer gray levels than pixels.
    pub fn take(&mut self, pixels: &[u8], size: Size) {
        let (width, height) = (size.width as usize, size.height as usize);
        (self.width, self.height) = (width, height);
        let stride = self.stride();
        self.rows.clear();
        if size.pixels() == 0 {
            return;
        }
        self.rows.resize(stride * (height + 1), 0);
        let row = |y: usize| &pixels[y * width..(y + 1) * width];
        for (y, steady) in self.rows.chunks_exact_mut(stride).enumerate() {
            // One more row than there are: a copy of the last, for the cuts that would lie below it.
            let y = y.min(height - 1);
            let neighbours = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(row);
            steady_row(neighbours, &mut steady[MARGIN..MARGIN + width]);
            let (left, right) = (steady[MARGIN], steady[MARGIN + width - 1]);
            steady[..MARGIN].fill(left);
            steady[MARGIN + width..].fill(right);
        }
    }

    fn stride(&self) -> usize {
        self.width + 2 * MARGIN
    }

    /// The steadied rows from `y` on, the last one twice, and how far they are apart; for [`Profiles`].
    ///
    /// # Panics
    /// When there is no such row.
    pub fn from(&self, y: usize) -> (&[u8], usize) {
        let stride = self.stride();
        (&self.rows[y * stride..(y + 2) * stride], stride)
    }

    /// Gives every edge the profile that follows from its place; those outside the view stay as they are.
    pub fn fill(&self, edges: &mut [Edge]) {
        for edges in edges.chunks_mut(BATCH) {
            let mut samples = [[0; 8]; BATCH];
            let inside = samples_at(self, edges, &mut samples);
            for (i, (edge, profile)) in edges.iter_mut().zip(samples).enumerate() {
                if inside >> i & 1 == 1 {
                    edge.profile = profile;
                }
            }
        }
    }

    /// Whether every edge has the profile that follows from its place.
    pub fn gives(&self, edges: &[Edge]) -> bool {
        edges.chunks(BATCH).all(|edges| {
            let mut samples = [[0; 8]; BATCH];
            let inside = samples_at(self, edges, &mut samples);
            let differ = edges.iter().zip(samples).fold(0, |differ, (edge, sample)| {
                differ | (u64::from_le_bytes(edge.profile) ^ u64::from_le_bytes(sample))
            });
            differ == 0 && inside.count_ones() as usize == edges.len()
        })
    }
}

/// The profiles of up to [`BATCH`] edges, and a bit for each that lies in the view.
#[multiversion(targets("x86_64+avx2+fma"))]
fn samples_at(steady: &Steady, edges: &[Edge], samples: &mut [[u8; 8]; BATCH]) -> u32 {
    let mut profiles = Profiles::<BATCH>::NONE;
    let mut inside = 0;
    let stride = steady.stride();
    for (i, edge) in edges.iter().take(BATCH).enumerate() {
        // What is no number, or negative, is zero here.
        let (column, row) = (edge.x as u32 as usize, edge.y as u32 as usize);
        let steps = |place: f32, whole: usize| ((place - whole as f32) * f32::from(STEPS)) as u32;
        let lower = usize::from(steps(edge.y, row) >= u32::from(STEPS) / 2);
        let is_inside = (column < steady.width) & (row < steady.height);
        let at = if is_inside {
            (row + lower) * stride + column
        } else {
            0
        };
        let window = steady.rows.get(at..).unwrap_or_default();
        profiles.take(i, window, steps(edge.x, column) as u8);
        inside |= u32::from(is_inside) << i;
    }
    profiles.interpolate(samples);
    inside
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn steady_row([above, here, below]: [&[u8]; 3], steady: &mut [u8]) {
    for (((s, &a), &h), &b) in steady.iter_mut().zip(above).zip(here).zip(below) {
        *s = ((u16::from(a) + 2 * u16::from(h) + u16::from(b) + 2) >> 2) as u8;
    }
}

/// [`Edge::PROFILE_OFFSETS`] in steps from the first column of the window.
const OFFSETS: [u16; 8] = {
    let mut offsets = [0; 8];
    let mut i = 0;
    while i < offsets.len() {
        offsets[i] = ((MARGIN as f32 + Edge::PROFILE_OFFSETS[i]) * STEPS as f32) as u16;
        i += 1;
    }
    offsets
};

/// What a profile is interpolated from, sample by sample.
#[derive(Debug)]
pub struct Profiles<const N: usize> {
    /// The pixels on either side, the left one in the lower byte.
    beside: [[u16; 8]; N],
    /// How far the sample is from the left one, in steps.
    steps: [[u16; 8]; N],
}

impl<const N: usize> Profiles<N> {
    /// No profile yet.
    pub const NONE: Self = Self {
        beside: [[0; 8]; N],
        steps: [[0; 8]; N],
    };

    /// Takes profile `i`, that of a cut `fraction` steps to the right of the pixel at whose column `steady` starts.
    #[inline(always)]
    pub fn take(&mut self, i: usize, steady: &[u8], fraction: u8) {
        let window: &[u8; WINDOW] = steady.first_chunk().unwrap_or(&[0; WINDOW]);
        self.beside[i] = std::array::from_fn(|i| {
            let i = (usize::from(fraction) + usize::from(OFFSETS[i])) / usize::from(STEPS)
                % (WINDOW - 1);
            u16::from_le_bytes([window[i], window[i + 1]])
        });
        self.steps[i] = std::array::from_fn(|i| (u16::from(fraction) + OFFSETS[i]) % STEPS);
    }

    /// All profiles, interpolated linearly.
    #[inline(always)]
    pub fn interpolate(&self, samples: &mut [[u8; 8]; N]) {
        let beside = self
            .beside
            .as_flattened()
            .iter()
            .zip(self.steps.as_flattened());
        for (sample, (&beside, &steps)) in samples.as_flattened_mut().iter_mut().zip(beside) {
            let sum = (beside & 0xff) * (STEPS - steps) + (beside >> 8) * steps;
            *sample = ((sum + STEPS / 2) / STEPS) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The profile that follows from an edge's place, sample by sample.
    fn obvious(pixels: &[u8], size: Size, edge: &Edge) -> [u8; 8] {
        let (width, height) = (size.width as isize, size.height as isize);
        let gray = |x: isize, y: isize| {
            let (x, y) = (x.clamp(0, width - 1), y.clamp(0, height - 1));
            u32::from(pixels[(y * width + x) as usize])
        };
        // Of two rows the one that is nearer.
        let row = ((edge.y + 0.5).floor() as isize).min(height - 1);
        let steady = |x| (gray(x, row - 1) + 2 * gray(x, row) + gray(x, row + 1) + 2) / 4;
        Edge::PROFILE_OFFSETS.map(|offset| {
            let steps = ((edge.x + offset) * 256.0) as i64;
            let (column, part) = (steps.div_euclid(256) as isize, steps.rem_euclid(256) as u32);
            ((steady(column) * (256 - part) + steady(column + 1) * part + 128) / 256) as u8
        })
    }

    #[test]
    fn profiles_are_those_of_the_obvious_sampling() {
        let mut state = 3u64;
        let mut random = move |below: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        for size in [(1, 1), (2, 9), (40, 30), (33, 1)].map(|(w, h)| Size::new(w, h)) {
            let pixels: Vec<u8> = (0..size.pixels()).map(|_| random(256) as u8).collect();
            let mut steady = Steady::new(size);
            steady.take(&pixels, size);
            let mut edges: Vec<Edge> = (0..500)
                .map(|_| {
                    let part = random(256) as f32 / 256.0;
                    let (dx, dy) = if random(2) == 0 {
                        (part, 0.0)
                    } else {
                        (0.0, part)
                    };
                    Edge {
                        x: random(size.width.into()) as f32 + dx,
                        y: random(size.height.into()) as f32 + dy,
                        ..Edge::default()
                    }
                })
                .collect();
            steady.fill(&mut edges);
            for edge in &edges {
                assert_eq!(
                    edge.profile,
                    obvious(&pixels, size, edge),
                    "{size}: {edge:?}"
                );
            }
            assert!(steady.gives(&edges));
            for at in [0, 17, 499] {
                let mut other = edges.clone();
                other[at].profile[at % 8] ^= 1;
                assert!(!steady.gives(&other), "{at}");
            }
        }
    }

    #[test]
    fn what_lies_nowhere_has_no_profile() {
        let size = Size::new(5, 4);
        let mut steady = Steady::new(size);
        steady.take(&[200; 20], size);
        for (x, y) in [(5.0, 0.0), (0.0, 4.5), (f32::INFINITY, 1.0), (1.0, 1e30)] {
            let mut edges = [Edge {
                x,
                y,
                ..Edge::default()
            }];
            assert!(!steady.gives(&edges));
            steady.fill(&mut edges);
            assert_eq!(edges[0].profile, [0; 8]);
        }
        steady.take(&[], Size::default());
        assert!(!steady.gives(&[Edge::default()]) && steady.gives(&[]));
    }
}
