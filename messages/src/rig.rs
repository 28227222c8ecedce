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

/// One camera that moves along a rail: a scan is one frame, and three frames that follow each other at a stride are a
/// triple.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rail {
    /// Frames from one member of a triple to the next: s in (k−2s, k−s, k).
    pub stride: u64,
    /// Rows by which a picture lies lower a baseline further to the right, as a camera does that is not quite level.
    pub drift_px: f64,
    /// Frames of points before a frame on which its share of the map depends; 0 where there is no map.
    #[serde(default)]
    pub follow: u64,
}

impl Rail {
    /// The name of the view.
    pub const VIEW: &str = "moving";
    /// The frame in which the rail stands still: the optical axes of a camera at position 0.
    pub const FRAME: &str = "rail";

    /// How many frames before a frame its triple reaches.
    pub fn reach(&self) -> u64 {
        2 * self.stride
    }
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
    /// When it is one camera that moves; then there is one view, and the calibration's baseline is that of neighbours in
    /// a triple.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rail: Option<Rail>,
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
            rail: None,
        }
    }

    /// One camera that moves along a rail, without a calibration.
    pub fn of_rail(rail: Rail, channels: &[f32], size: Size) -> Self {
        let view = View {
            name: Rail::VIEW.to_owned(),
            position_steps: 0.0,
        };
        Self {
            views: vec![view],
            rail: Some(rail),
            ..Self::of_views(0, channels, size)
        }
    }

    /// How many scans before a scan its results depend on.
    pub fn reach(&self) -> u64 {
        self.rail.map_or(0, |rail| rail.reach() + rail.follow)
    }

    /// The calibration for images of this size: the known one, or the stated default.
    pub fn calibration(&self, size: Size) -> Calibration {
        self.calibration
            .unwrap_or_else(|| Calibration::assumed(size))
    }

    /// Where a view's camera stands along the baseline, in metres; of a rail the scan says it.
    pub fn position_m(&self, view: usize, size: Size) -> f64 {
        self.views[view].position_steps * self.calibration(size).baseline_m
    }
}
