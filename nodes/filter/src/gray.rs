//! The view as taken, and the gray levels beside its edges.

use messages::{Edge, Size};
use multiversion::multiversion;

use crate::smooth::TOGETHER;

/// Columns of margin on either side: profiles reach 6 columns and one pixel to interpolate with.
const MARGIN: usize = 8;
/// Steps to a pixel in interpolation.
pub(crate) const STEPS: u16 = 256;
/// Columns a profile is taken from.
const WINDOW: usize = 2 * MARGIN;

/// The view, its only copy here, and the same steadied for profiles.
///
/// Steadied means averaged down the column with weights ¼ ½ ¼: that takes the noise of the sensor down to 0.61 of
/// itself, yet mixes nothing across the edges that matching along rows depends on, those that stand upright.
#[derive(Debug)]
pub(crate) struct Gray {
    width: usize,
    height: usize,
    /// Row by row without gaps, and a few pixels behind the last row for those who look at several at a time.
    raw: Vec<u8>,
    /// Rows with margins that repeat the border pixels.
    steady: Vec<u8>,
}

impl Gray {
    /// Room for views up to `max`.
    pub(crate) fn new(max: Size) -> Self {
        let (width, height) = (max.width as usize, max.height as usize);
        Self {
            width: 0,
            height: 0,
            raw: Vec::with_capacity(width * height + TOGETHER),
            steady: Vec::with_capacity((width + 2 * MARGIN) * (height + 1)),
        }
    }

    /// Takes a view.
    pub(crate) fn read(&mut self, pixels: &[u8], size: Size) {
        self.width = size.width as usize;
        self.height = size.height as usize;
        self.raw.clear();
        self.raw.extend_from_slice(pixels);
        self.raw.resize(pixels.len() + TOGETHER, 0);
    }

    /// Steadies the view.
    pub(crate) fn steady(&mut self) {
        let (width, height) = (self.width, self.height);
        let stride = self.stride();
        self.steady.resize(stride * (height + 1), 0);
        let row = |y: usize| &self.raw[y * width..(y + 1) * width];
        for (y, steady) in self.steady.chunks_exact_mut(stride).enumerate() {
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

    /// The view, row by row without gaps, and behind it [`TOGETHER`] more pixels that mean nothing.
    pub(crate) fn pixels(&self) -> &[u8] {
        &self.raw
    }

    /// The steadied rows from `y` on, the last one twice, and how far they are apart; for [`Profiles`].
    pub(crate) fn steady_from(&self, y: usize) -> (&[u8], usize) {
        let stride = self.stride();
        (&self.steady[y * stride..(y + 2) * stride], stride)
    }
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
pub(crate) struct Profiles<const N: usize> {
    /// The pixels on either side, the left one in the lower byte.
    beside: [[u16; 8]; N],
    /// How far the sample is from the left one, in steps.
    steps: [[u16; 8]; N],
}

impl<const N: usize> Profiles<N> {
    /// No profile yet.
    pub(crate) const NONE: Self = Self {
        beside: [[0; 8]; N],
        steps: [[0; 8]; N],
    };

    /// Takes profile `i`, that of a cut `fraction` steps to the right of the pixel at whose column `steady` starts.
    #[inline(always)]
    pub(crate) fn take(&mut self, i: usize, steady: &[u8], fraction: u8) {
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
    pub(crate) fn interpolate(&self, samples: &mut [[u8; 8]; N]) {
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
