//! The rig: what every node of a run knows about the views and the channels.

use serde::{Deserialize, Serialize};

use crate::calibration::Calibration;
use crate::header::Size;

/// What happens to a scan that finds the door closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Delivery {
    /// It waits: nothing is lost. For files and replay.
    #[default]
    Lossless,
    /// It is dropped whole and counted: nothing waits. For cameras.
    Live,
}

/// One camera position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// `left`, `centre`, `right`; of more than three views their numbers.
    pub name: String,
    /// Where it stands along the baseline, in steps of one baseline; the first view stands at 0.
    pub position_steps: f64,
}

/// The views, left to right, and the channels, coarse to fine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rig {
    /// The largest image of any scan.
    pub size: Size,
    /// Left to right.
    pub views: Vec<View>,
    /// σ² of each channel's Gaussian in square pixels, coarse to fine.
    pub channels: Vec<f32>,
    /// The calibration, when there is one.
    pub calibration: Option<Calibration>,
}

impl Rig {
    /// A rig of `count` views one step apart, without a calibration.
    pub fn of_views(count: usize, channels: &[f32], size: Size) -> Self {
        let names = match count {
            3 => ["left", "centre", "right"].map(str::to_owned).to_vec(),
            _ => (0..count).map(|view| view.to_string()).collect(),
        };
        let place = |(step, name)| View {
            name,
            position_steps: step as f64,
        };
        Self {
            size,
            views: names.into_iter().enumerate().map(place).collect(),
            channels: channels.to_vec(),
            calibration: None,
        }
    }

    /// The calibration for images of this size: the known one, or the stated default.
    pub fn calibration(&self, size: Size) -> Calibration {
        self.calibration
            .unwrap_or_else(|| Calibration::assumed(size))
    }

    /// Where a view's camera stands along the baseline, in metres.
    pub fn position_m(&self, view: usize, size: Size) -> f64 {
        self.views[view].position_steps * self.calibration(size).baseline_m
    }
}
