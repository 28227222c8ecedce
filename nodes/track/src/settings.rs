//! What can be set about tracking.

messages::settings! {
    /// How zero-crossings become curves.
    pub struct Settings {
        /// Magnitude every curve exceeds somewhere, in the filter's units (gray levels per pixel); by default
        /// automatic, twice the automatic `low`.
        pub high: Option<f32> = None, in 0..=255;
        /// Magnitude every point of a curve exceeds, in the filter's units (gray levels per pixel); by default
        /// automatic: three times the noise as far as it can be told, but 0.25 to 0.5.
        pub low: Option<f32> = None, in 0..=255;
        /// Factor on the automatic thresholds: more than 1 gives fewer and surer curves, for noisy cameras.
        pub strictness: f32 = 1.0, in 0.0..=100.0;
        /// Degrees by which the orientations of successive points may differ. On sixteen real scenes at σ² = 2, 10 track
        /// 0.30 of the listed zero-crossings, 40 track 0.72, 60 track 0.80, 90 track 0.84, and the share of them found
        /// again in the next view grows from 0.73 to 0.84. After matching, 90 cover 0.05 more of the Canny edges
        /// than 40, with fewer wrong.
        pub tolerance_degrees: f32 = 90.0, in 0..=180;
        /// Points a curve has at least. From 8 to 5 coverage after matching grows by 0.01, and the share wrong by more
        /// than a pixel falls.
        pub min_points: usize = 5, in 2..=100000;
    }
}

impl Settings {
    /// The constants of the thesis: 64, 32, 10°, 32 points. Its thresholds are meant for magnitudes scaled to 0 … 255
    /// of the largest in the picture.
    pub fn thesis() -> Self {
        Self {
            high: Some(64.0),
            low: Some(32.0),
            strictness: 1.0,
            tolerance_degrees: 10.0,
            min_points: 32,
        }
    }
}
