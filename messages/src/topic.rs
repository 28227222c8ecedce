//! The one list of topics: recorder, replay and viewers walk it, none of them names a topic itself.

use serde::{Deserialize, Serialize};

use crate::header::NONE;
use crate::rig::Rig;

/// The stages a scan passes through, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Frames come in.
    Capture,
    /// Frames become zero-crossings.
    Filter,
    /// Zero-crossings become curves.
    Track,
    /// Curves become R-tables.
    Hough,
    /// R-tables become matches, disparities and points.
    Match,
    /// Points of many frames along a rail become one map.
    Map,
    /// Points are compared with the truth, where it is known.
    Evaluate,
}

impl Stage {
    /// All of them, in order.
    pub const ALL: [Self; 7] = [
        Self::Capture,
        Self::Filter,
        Self::Track,
        Self::Hough,
        Self::Match,
        Self::Map,
        Self::Evaluate,
    ];

    /// The stage's name, which is its node's.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Capture => "capture",
            Self::Filter => "filter",
            Self::Track => "track",
            Self::Hough => "hough",
            Self::Match => "match",
            Self::Map => "map",
            Self::Evaluate => "evaluate",
        }
    }

    /// The kinds of message that it takes in.
    pub const fn takes(self) -> &'static [Kind] {
        match self {
            Self::Capture => &[],
            Self::Filter => &[Kind::Image],
            Self::Track => &[Kind::Edges],
            Self::Hough => &[Kind::Curves],
            Self::Match => &[Kind::Curves, Kind::Tables],
            Self::Map => &[Kind::Points],
            Self::Evaluate => &[Kind::Image, Kind::Truth, Kind::Matches, Kind::Points],
        }
    }

    /// The kinds of message that it publishes.
    pub fn makes(self) -> impl Iterator<Item = Kind> {
        Kind::ALL
            .into_iter()
            .filter(move |kind| kind.stage() == self)
    }
}

/// What a topic's messages are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Frames, one topic a view; rectified, where a calibration says how.
    Image,
    /// Frames as the cameras took them, one topic a view, where they are asked for beside rectified ones.
    #[serde(rename = "image_raw")]
    Raw,
    /// True disparities of the reference view, one topic, where the source knows them.
    Truth,
    /// Zero-crossings, one topic a view and channel.
    Edges,
    /// Curves, one topic a view and channel.
    Curves,
    /// R-tables, one topic a view and channel.
    Tables,
    /// Matched curves, one topic a channel.
    Matches,
    /// The disparity picture, one topic.
    Disparity,
    /// The points in space, one topic.
    Points,
    /// Points of the map that are settled, each once, one topic, of a rail only.
    Map,
    /// Points of the map that are still followed, one topic, of a rail only.
    Growing,
    /// How the points compare with the truth, one topic.
    Evaluation,
}

impl Kind {
    /// All of them, in the order a scan makes them.
    pub const ALL: [Self; 12] = [
        Self::Image,
        Self::Raw,
        Self::Truth,
        Self::Edges,
        Self::Curves,
        Self::Tables,
        Self::Matches,
        Self::Disparity,
        Self::Points,
        Self::Map,
        Self::Growing,
        Self::Evaluation,
    ];

    /// The stage that publishes it.
    pub const fn stage(self) -> Stage {
        match self {
            Self::Image | Self::Raw | Self::Truth => Stage::Capture,
            Self::Edges => Stage::Filter,
            Self::Curves => Stage::Track,
            Self::Tables => Stage::Hough,
            Self::Matches | Self::Disparity | Self::Points => Stage::Match,
            Self::Map | Self::Growing => Stage::Map,
            Self::Evaluation => Stage::Evaluate,
        }
    }

    /// Whether each view has a topic of its own.
    pub const fn is_per_view(self) -> bool {
        matches!(
            self,
            Self::Image | Self::Raw | Self::Edges | Self::Curves | Self::Tables
        )
    }

    /// Whether each channel has a topic of its own.
    pub const fn is_per_channel(self) -> bool {
        matches!(
            self,
            Self::Edges | Self::Curves | Self::Tables | Self::Matches
        )
    }

    /// The first part of the topic's name, or all of it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Image => "image",
            Self::Raw => "image_raw",
            Self::Truth => "truth",
            Self::Edges => "edges",
            Self::Curves => "curves",
            Self::Tables => "tables",
            Self::Matches => "matches",
            Self::Disparity => "disparity",
            Self::Points => "points",
            Self::Map => "map",
            Self::Growing => "map/growing",
            Self::Evaluation => "evaluation",
        }
    }
}

/// A topic: what its messages are and which view and channel they belong to.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Topic {
    /// What its messages are.
    pub kind: Kind,
    /// Index of the view, or [`NONE`].
    pub view: u32,
    /// Index of the channel, or [`NONE`].
    pub channel: u32,
    /// Its name: `camera/left/image`, `edges/left/20`, `matches/20`, `points`.
    pub name: String,
}

impl Topic {
    fn new(rig: &Rig, kind: Kind, view: u32, channel: u32) -> Self {
        let mut name = match kind {
            Kind::Image | Kind::Raw => {
                format!("camera/{}/{}", rig.views[view as usize].name, kind.name())
            }
            Kind::Edges | Kind::Curves | Kind::Tables => {
                format!("{}/{}", kind.name(), rig.views[view as usize].name)
            }
            Kind::Truth
            | Kind::Matches
            | Kind::Disparity
            | Kind::Points
            | Kind::Map
            | Kind::Growing
            | Kind::Evaluation => kind.name().to_owned(),
        };
        if channel != NONE {
            name = format!("{name}/{}", rig.channels[channel as usize]);
        }
        Self {
            kind,
            view,
            channel,
            name,
        }
    }

    /// Every data topic of a rig, in the order a scan makes them: by kind, then view, then channel.
    pub fn all(rig: &Rig) -> Vec<Self> {
        Kind::ALL
            .into_iter()
            .flat_map(|kind| Self::of(rig, kind))
            .collect()
    }

    /// The topics of one kind, by view, then channel; what only a rail has a rig does not.
    pub fn of(rig: &Rig, kind: Kind) -> Vec<Self> {
        if kind.stage() == Stage::Map && rig.rail.is_none() {
            return Vec::new();
        }
        let indices = |some: bool, len: usize| match some {
            true => (0..len as u32).collect(),
            false => vec![NONE],
        };
        let channels: Vec<u32> = indices(kind.is_per_channel(), rig.channels.len());
        indices(kind.is_per_view(), rig.views.len())
            .into_iter()
            .flat_map(|view| channels.iter().map(move |&channel| (view, channel)))
            .map(|(view, channel)| Self::new(rig, kind, view, channel))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Size;

    #[test]
    fn topics_are_named_by_kind_view_and_channel() {
        let rig = Rig::of_views(3, &[30.0, 1.5], Size::new(64, 64));
        let names: Vec<String> = Topic::all(&rig).into_iter().map(|t| t.name).collect();
        assert_eq!(names.len(), 2 * 3 + 3 * 6 + 2 + 4, "a rig has no map");
        for name in [
            "camera/left/image",
            "camera/left/image_raw",
            "edges/centre/30",
            "tables/right/1.5",
            "matches/30",
            "points",
        ] {
            assert!(names.iter().any(|n| n == name), "{name} in {names:?}");
        }
    }

    #[test]
    fn no_two_topics_share_a_name() {
        let rig = Rig::of_views(5, &[30.0, 20.0, 10.0], Size::new(64, 64));
        let mut names: Vec<String> = Topic::all(&rig).into_iter().map(|t| t.name).collect();
        let all = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), all);
    }
}
