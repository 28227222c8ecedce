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
        /// Degrees by which the orientations of successive points may differ. On sixteen real scenes at σ² = 1.5, 10
        /// track 25 % of the zero-crossings, 40 track 51 %, 60 track 56 %, 90 track 57 %; from 40 to 60 the points
        /// gained are found again in the next view more often (90 %) than the others. After matching, 60 cover 0.67 of
        /// the Canny edges with 0.46 % wrong by more than a pixel, 90 cover 0.68 with 0.43 %.
        pub tolerance_degrees: f32 = 90.0, in 0..=180;
        /// Points a curve has at least. From 8 to 5 coverage after matching grows from 0.55 to 0.57, and the share wrong
        /// by more than a pixel falls.
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
