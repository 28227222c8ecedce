//! What can be set about tracking.

messages::settings! {
    /// How zero-crossings become curves.
    pub struct Settings {
        /// Magnitude in gray levels per pixel a curve must exceed somewhere; automatic when not given.
        pub high: Option<f32> = None, in 0..=255;
        /// Magnitude in gray levels per pixel every point of a curve must exceed; automatic when not given.
        pub low: Option<f32> = None, in 0..=255;
        /// Factor on the automatic thresholds: above 1 fewer and surer curves, below 1 more.
        pub strictness: f32 = 1.0, in 0.0..=100.0;
        /// Degrees by which the orientations of successive points may differ.
        pub tolerance_degrees: f32 = 40.0, in 0..=180;
        /// Points a curve must have.
        pub min_points: usize = 8, in 2..=100000;
    }
}

impl Settings {
    /// The constants of the thesis, for magnitudes scaled to 0 … 255 of the largest in the picture.
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
