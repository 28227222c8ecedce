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

/// The least automatic LOW, in gray levels per pixel: three times what rounding to whole gray levels makes as noise.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Magnitudes of noise alone: Rayleigh's distribution, from evenly spread numbers.
    fn noise(deviation: f32, count: u32, shift: f32) -> Histogram {
        let mut magnitudes = Histogram::new();
        for i in 0..count {
            let share = (i as f32 + shift) / count as f32;
            magnitudes.add(deviation * (-2.0 * (1.0 - share).ln()).sqrt());
        }
        magnitudes
    }

    #[test]
    fn quantiles_are_those_of_sorted_magnitudes() {
        let mut magnitudes = Histogram::new();
        let mut sorted: Vec<f32> = (1..5000u32)
            .map(|i| ((i * i) % 7919) as f32 / 100.0 + 0.01)
            .collect();
        sorted
            .iter()
            .for_each(|&magnitude| magnitudes.add(magnitude));
        sorted.sort_by(f32::total_cmp);
        for share in [0.001f32, 0.1, 0.5, 0.77, 0.999] {
            let exact = sorted[(share * sorted.len() as f32) as usize];
            let quantile = magnitudes.quantile(share);
            assert!(
                (quantile - exact).abs() < 0.02 * exact + 0.01,
                "{share}: {quantile} for {exact}"
            );
        }
        assert_eq!(Histogram::new().quantile(0.5), 0.0);
    }

    #[test]
    fn magnitudes_beyond_all_bins_are_counted_at_the_ends() {
        let mut magnitudes = Histogram::new();
        [0.0, 1e-30, 1e30, f32::MAX]
            .iter()
            .for_each(|&magnitude| magnitudes.add(magnitude));
        assert!(magnitudes.quantile(0.25) < 1e-3 && magnitudes.quantile(0.75) > 1e3);
    }

    #[test]
    fn low_is_three_times_the_noise_between_its_bounds() {
        let low =
            |deviation| Thresholds::new(&Settings::default(), &noise(deviation, 4000, 0.5)).low;
        assert_eq!([low(0.01), low(3.0)], [LEAST_LOW, MOST_LOW]);
        for deviation in [0.09, 0.12, 0.16] {
            assert!((low(deviation) / (3.0 * deviation) - 1.0).abs() < 0.03);
        }
    }

    #[test]
    fn few_magnitudes_more_or_less_change_little() {
        let low =
            |count, shift| Thresholds::new(&Settings::default(), &noise(0.13, count, shift)).low;
        for count in [900, 1000, 1100] {
            for shift in [0.1, 0.9] {
                assert!((low(count, shift) / low(1000, 0.5) - 1.0).abs() < 0.02);
            }
        }
    }

    #[test]
    fn thresholds_by_hand_are_kept_and_low_never_exceeds_high() {
        let quiet = noise(0.1, 1000, 0.5);
        let by_hand = Settings {
            high: Some(7.0),
            low: Some(2.0),
            strictness: 5.0,
            ..Settings::default()
        };
        assert_eq!(
            Thresholds::new(&by_hand, &quiet),
            Thresholds {
                high: 7.0,
                low: 2.0
            }
        );
        let only_high = Settings {
            high: Some(0.1),
            ..Settings::default()
        };
        assert_eq!(
            Thresholds::new(&only_high, &quiet),
            Thresholds {
                high: 0.1,
                low: 0.1
            }
        );
        let strict = Thresholds::new(
            &Settings {
                strictness: 2.0,
                ..Settings::default()
            },
            &quiet,
        );
        let usual = Thresholds::new(&Settings::default(), &quiet);
        assert_eq!(
            [strict.low, strict.high],
            [2.0 * usual.low, 2.0 * usual.high]
        );
    }
}
