//! What the filter can be told.

use serde::{Deserialize, Serialize};

/// What a gradient's magnitude is measured in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scaling {
    /// Gray levels per pixel: Sobel / 8. Means the same in every picture.
    #[default]
    Absolute,
    /// 0 to 255 of the largest in the picture, as in the thesis: one bright speck decides everybody's threshold.
    Picture,
}

messages::settings! {
    /// The settings of the filter.
    pub struct Settings {
        /// σ² of each channel's Gaussian, in square pixels, coarse to fine. Fine channels carry most of the detail of
        /// real scenes, coarse ones tell them where to look.
        pub channels: Vec<f32> = vec![8.0, 4.0, 1.5], in 0.5..=400.0;
        /// σ in pixels of the Gaussian before Sobel's operator; 0 applies Sobel to the image as it is. By default the
        /// channel's scale: √(σ² − ½), as Sobel's operator itself smooths by a variance of ½; that is σ = 1 for the
        /// channel σ² = 1.5. Smoothing at the channel's scale halves the mismatches on real scenes.
        pub smoothing: Option<f32> = None, in 0.0..=20.0;
        /// What gradient magnitudes are measured in: `absolute` (gray levels per pixel) or `picture` (0 to 255 of the
        /// largest in the picture).
        pub scaling: Scaling = Scaling::Absolute;
        /// Zero-crossings whose gradient is not above this magnitude, in units of `scaling`, are noise and not listed.
        /// Tracking at its most generous used 0.6 gray levels per pixel.
        pub floor: f32 = 0.4, in 0.0..=255.0;
    }
}

impl Settings {
    /// The constants of the thesis: σ² = 30, 20, 10; Sobel on the original image, scaled to the largest in the
    /// picture; every zero-crossing listed.
    pub fn thesis() -> Self {
        Self {
            channels: vec![30.0, 20.0, 10.0],
            smoothing: Some(0.0),
            scaling: Scaling::Picture,
            floor: 0.0,
        }
    }
}
