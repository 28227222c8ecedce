//! The two thresholds of the hysteresis, from the frame's own gradient magnitudes.
//!
//! What the thresholds must tell from edges is noise. The gradients of noise alone have magnitudes that follow
//! Rayleigh's distribution, so taking the weakest tenth of all magnitudes for noise gives its level in a quiet frame,
//! and too much in a textured one, where little is noise alone. The automatic LOW is three times that level, but held
//! between [`LEAST_LOW`] and [`MOST_LOW`]: on sixteen real scenes edges of half a gray level per pixel are found again
//! in the next view half of the time, those of one gray level per pixel three quarters of the time, in every channel.
//! A tenth of thousands of magnitudes does not flicker.

use crate::Settings;

/// The thresholds a frame was tracked with, in the units of its magnitudes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thresholds {
    /// Every curve reaches it somewhere.
    pub high: f32,
    /// Every point of a curve reaches it.
    pub low: f32,
}

/// HIGH is this many times LOW when it is automatic, as in the thesis. Between 2 and 3 the share of wrong matches on real
/// scenes is the same; 2 leaves more points.
pub const HIGH_OVER_LOW: f32 = 2.0;

/// The least automatic LOW, in gray levels per pixel: what rounding to whole gray levels makes of a smooth slope.
pub const LEAST_LOW: f32 = 0.25;

/// The greatest automatic LOW, in gray levels per pixel.
pub const MOST_LOW: f32 = 0.5;

/// LOW is this many times the standard deviation of the noise in each component of the gradient.
const LOW_OVER_NOISE: f32 = 3.0;

/// The share of the magnitudes, weakest first, that is taken for noise, …
const NOISE_SHARE: f32 = 0.1;

/// … and Rayleigh's quantile there, in standard deviations: √(−2 ln 0.9).
const RAYLEIGH: f32 = 0.459;

impl Thresholds {
    /// The thresholds for a frame with these magnitudes.
    pub fn new(settings: &Settings, magnitudes: &Histogram) -> Self {
        let noise = magnitudes.quantile(NOISE_SHARE) / RAYLEIGH;
        let automatic = settings.strictness * (LOW_OVER_NOISE * noise).clamp(LEAST_LOW, MOST_LOW);
        let low = settings.low.unwrap_or(automatic);
        let high = settings.high.unwrap_or(HIGH_OVER_LOW * automatic);
        Self {
            high,
            low: low.min(high),
        }
    }
}

/// How often each magnitude occurs, in bins that are each a little wider than the one before.
#[derive(Clone, Debug)]
pub struct Histogram {
    counts: [u32; Self::BINS],
    total: u32,
}

impl Histogram {
    /// Bins that each doubling of the magnitude is divided into, as a power of two.
    const FINENESS: u32 = 4;
    /// The first bin begins at 2⁻¹², …
    const FIRST: u32 = (127 - 12) << Self::FINENESS;
    /// … and the last ends at 2¹².
    const BINS: usize = 24 << Self::FINENESS;

    /// Without any magnitude.
    pub const fn new() -> Self {
        Self {
            counts: [0; Self::BINS],
            total: 0,
        }
    }

    /// Counts a magnitude; one beyond the bins counts in the first or last.
    pub fn add(&mut self, magnitude: f32) {
        // The leading bits of a positive float are a piecewise linear logarithm.
        let bin = (magnitude.to_bits() >> (23 - Self::FINENESS)).saturating_sub(Self::FIRST);
        self.counts[(bin as usize).min(Self::BINS - 1)] += 1;
        self.total += 1;
    }

    /// The magnitude below which this share of all lies, interpolated within its bin; 0 without any.
    pub fn quantile(&self, share: f32) -> f32 {
        let wanted = f64::from(share) * f64::from(self.total);
        let mut below = 0.0;
        for (bin, &count) in (Self::FIRST..).zip(&self.counts) {
            let count = f64::from(count);
            if count > 0.0 && below + count >= wanted {
                let start = |bin: u32| f32::from_bits(bin << (23 - Self::FINENESS));
                let within = ((wanted - below) / count) as f32;
                return start(bin) + within * (start(bin + 1) - start(bin));
            }
            below += count;
        }
        0.0
    }
}

impl Default for Histogram {
    fn default() -> Self {
        Self::new()
    }
}
