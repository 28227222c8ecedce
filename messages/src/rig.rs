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

const EXPECTED_VIEW: &str = "left, centre, right or a view's number, counted from 0";

/// Which view results refer to: `"left"`, `"centre"`, `"right"`, or a view's number, counted from 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Reference {
    /// The left one, as in the thesis.
    #[default]
    Left,
    /// The central one: fewer occlusions, a shorter base to either side. Of an even number the one right of the centre.
    Centre,
    /// The right one.
    Right,
    /// The one of this number.
    #[serde(untagged)]
    View(u32),
}

impl Reference {
    /// The index of the view, of so many; of a number that none has, the number itself.
    pub fn index(self, views: usize) -> usize {
        match self {
            Self::Left => 0,
            Self::Centre => views / 2,
            Self::Right => views.saturating_sub(1),
            Self::View(view) => view as usize,
        }
    }

    /// What a run's configuration says, `match.reference` of all nodes' settings; the left one where it says nothing.
    #[cfg(any(feature = "bus", feature = "record"))]
    pub fn of(configuration: &serde_json::Value) -> Self {
        let said = configuration.get("match").and_then(|m| m.get("reference"));
        let said = said.and_then(|said| Self::deserialize(said).ok());
        said.unwrap_or_default()
    }
}

impl std::str::FromStr for Reference {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "left" => Ok(Self::Left),
            "centre" => Ok(Self::Centre),
            "right" => Ok(Self::Right),
            other => other
                .parse()
                .map(Self::View)
                .map_err(|_| format!("{other:?} is no view, expected {EXPECTED_VIEW}")),
        }
    }
}

impl<'de> Deserialize<'de> for Reference {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Said {
            Number(u32),
            Name(String),
            Other(serde::de::IgnoredAny),
        }
        match Said::deserialize(deserializer)? {
            Said::Number(view) => Ok(Self::View(view)),
            Said::Name(name) => name.parse().map_err(serde::de::Error::custom),
            Said::Other(_) => Err(serde::de::Error::custom(format!(
                "this is no view, expected {EXPECTED_VIEW}"
            ))),
        }
    }
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

    /// The three views whose curves matches name, left to right: the reference view and the two next to it. On a rail
    /// they are frames, of which the newest comes first.
    pub fn named(&self, reference: usize) -> [usize; 3] {
        let first = reference.clamp(1, self.views.len().saturating_sub(2).max(1)) - 1;
        [first, first + 1, first + 2]
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

    /// The baseline as it is shown to people, who take that of the outer views for it: from one to the next, and from the
    /// first to the last.
    pub fn shown_baseline(&self, size: Size) -> String {
        let baseline_m = self.calibration(size).baseline_m;
        let (each, steps) = match self.rail {
            Some(_) => ("from one frame of a triple to the next", 2),
            None => ("from view to view", self.views.len().saturating_sub(1)),
        };
        // Four digits: twice a tenth is two tenths.
        let span = format!("{:.3e}", baseline_m * steps as f64);
        let span_m: f64 = span.parse().unwrap_or_default();
        format!("{baseline_m} m {each}, {span_m} m from the first to the last")
    }

    /// Where a view's camera stands along the baseline, in metres; of a rail the scan says it.
    pub fn position_m(&self, view: usize, size: Size) -> f64 {
        self.views[view].position_steps * self.calibration(size).baseline_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_baseline_is_shown_from_view_to_view_and_over_all_views() {
        let size = Size::new(640, 480);
        let rig = Rig {
            calibration: Some(Calibration {
                baseline_m: 0.1,
                ..Calibration::assumed(size)
            }),
            ..Rig::of_views(4, &[], size)
        };
        assert_eq!(
            rig.shown_baseline(size),
            "0.1 m from view to view, 0.3 m from the first to the last"
        );
        let rail = Rig {
            calibration: rig.calibration,
            ..Rig::of_rail(Rail::default(), &[], size)
        };
        assert_eq!(
            rail.shown_baseline(size),
            "0.1 m from one frame of a triple to the next, 0.2 m from the first to the last"
        );
    }
}
