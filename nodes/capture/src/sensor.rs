//! Sensor noise: rendered pictures would be the same in every scan without it.

use messages::mixed;

/// Gaussian noise from a table: every row of a frame starts at its own place in it, so that a frame costs one addition
/// a pixel.
#[derive(Clone, Debug)]
pub(crate) struct Sensor {
    /// In 256ths of a gray level; the first [`WIDEST`](Self::WIDEST) come again at the end.
    table: Vec<i16>,
    seed: u64,
}

impl Sensor {
    const COUNT: usize = 1 << 16;
    /// The widest row.
    const WIDEST: usize = 1 << 12;

    /// Noise of this standard deviation in gray levels.
    pub(crate) fn new(deviation: f32, seed: u64) -> Self {
        let mut state = seed;
        let mut chance = || {
            state = mixed(state);
            ((state >> 40) as f32 + 0.5) / (1 << 24) as f32
        };
        let mut table: Vec<i16> = (0..Self::COUNT)
            .map(|_| {
                // Box and Muller's transform.
                let (radius, turn) = (
                    (-2.0 * chance().ln()).sqrt(),
                    chance() * std::f32::consts::TAU,
                );
                (256.0 * deviation * radius * turn.cos()).round() as i16
            })
            .collect();
        table.extend_from_within(..Self::WIDEST);
        Self { table, seed }
    }

    /// Rounds a clean picture, given in 256ths of a gray level, to gray levels, with the noise of this scan and view.
    pub(crate) fn expose(&self, clean: &[u16], width: usize, scan: u64, view: u64, out: &mut [u8]) {
        let frame = mixed(mixed(self.seed ^ scan) ^ view);
        for (row, (clean, out)) in clean.chunks(width).zip(out.chunks_mut(width)).enumerate() {
            let start = mixed(frame ^ row as u64) as usize % Self::COUNT;
            let noise = &self.table[start..start + out.len()];
            for ((out, &clean), &noise) in out.iter_mut().zip(clean).zip(noise) {
                *out = ((i32::from(clean) + i32::from(noise) + 128) >> 8).clamp(0, 255) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_deviation_asked_for_and_no_offset() {
        let clean = vec![100 * 256; 512 * 480];
        let mut out = vec![0; clean.len()];
        Sensor::new(2.0, 7).expose(&clean, 512, 3, 1, &mut out);
        let differences: Vec<f64> = out.iter().map(|&gray| f64::from(gray) - 100.0).collect();
        let mean = differences.iter().sum::<f64>() / differences.len() as f64;
        let variance = differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64;
        assert!(mean.abs() < 0.02, "{mean}");
        // Rounding adds a twelfth.
        assert!((variance - 4.0 - 1.0 / 12.0).abs() < 0.1, "{variance}");
    }

    #[test]
    fn without_noise_a_picture_is_rounded_to_the_nearest_level() {
        let mut out = [0; 4];
        Sensor::new(0.0, 7).expose(&[0, 127, 128, 255 * 256], 4, 0, 0, &mut out);
        assert_eq!(out, [0, 0, 1, 255]);
    }

    #[test]
    fn rows_scans_and_views_have_noise_of_their_own() {
        let clean = [100 * 256; 64];
        let sensor = Sensor::new(4.0, 7);
        let frame = |scan, view| {
            let mut out = [0; 64];
            sensor.expose(&clean, 32, scan, view, &mut out);
            out
        };
        assert_eq!(frame(5, 1), frame(5, 1));
        assert_ne!(frame(5, 1), frame(6, 1));
        assert_ne!(frame(5, 1), frame(5, 2));
        assert_ne!(frame(5, 1)[..32], frame(5, 1)[32..]);
    }
}
