//! The two thresholds of the hysteresis, from the frame's own gradient magnitudes.

use crate::Settings;

/// The thresholds a frame was tracked with, in gray levels per pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thresholds {
    /// A curve exceeds it somewhere.
    pub high: f32,
    /// A curve exceeds it everywhere.
    pub low: f32,
}

/// HIGH is this many times LOW when both are automatic.
pub const HIGH_OVER_LOW: f32 = 3.0;

impl Thresholds {
    /// The thresholds for a frame with these magnitudes.
    pub fn new(settings: &Settings, magnitudes: &Histogram) -> Self {
        let automatic = (0.35 * magnitudes.quantile(0.5)).clamp(0.05, 0.6) * settings.strictness;
        let low = settings.low.unwrap_or(automatic);
        let high = settings.high.unwrap_or(HIGH_OVER_LOW * automatic);
        Self { high, low: low.min(high) }
    }
}

/// How often each magnitude occurs, in bins of equal ratio.
#[derive(Clone, Debug)]
pub struct Histogram {
    counts: [u32; Self::BINS],
    total: u32,
}

impl Histogram {
    /// Bins a doubling of the magnitude is divided into, as a power of two.
    const FINENESS: u32 = 4;
    /// The exponent, as a float stores it, of the first bin's magnitude, 2⁻¹².
    const FIRST: u32 = 127 - 12;
    /// From 2⁻¹² to 2¹².
    const BINS: usize = 24 << Self::FINENESS;

    /// Without any magnitude.
    pub fn new() -> Self {
        Self { counts: [0; Self::BINS], total: 0 }
    }

    /// Forgets all magnitudes.
    pub fn clear(&mut self) {
        *self = Self::new();
    }

    /// Counts a magnitude; what lies outside the bins counts in the first or last.
    pub fn add(&mut self, magnitude: f32) {
        // The leading bits of a positive float are the floor of a piecewise linear logarithm.
        let bin = (magnitude.to_bits() >> (23 - Self::FINENESS)).saturating_sub(Self::FIRST << Self::FINENESS);
        self.counts[(bin as usize).min(Self::BINS - 1)] += 1;
        self.total += 1;
    }

    /// The magnitude below which this share of all lies, interpolated within its bin; 0 without any.
    pub fn quantile(&self, share: f32) -> f32 {
        let wanted = f64::from(share) * f64::from(self.total);
        let mut below = 0.0;
        for (bin, &count) in (0u32..).zip(&self.counts) {
            let count = f64::from(count);
            if count > 0.0 && below + count >= wanted {
                let edge = |bin: u32| f32::from_bits((bin + (Self::FIRST << Self::FINENESS)) << (23 - Self::FINENESS));
                let within = ((wanted - below) / count) as f32;
                return edge(bin) + within * (edge(bin + 1) - edge(bin));
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
