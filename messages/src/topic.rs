//! The one list of topics: recorder, replay and viewers walk it, none of them names a topic itself.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::header::NONE;
use crate::other::Other;
use crate::payload::Kind;
use crate::rig::Rig;

/// A stage of the work on a scan, by the name of its node. What a stage comes after follows from what it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Stage(&'static str);

impl Stage {
    /// Frames come in.
    pub const CAPTURE: Self = Self("capture");
    /// Frames become zero-crossings.
    pub const FILTER: Self = Self("filter");
    /// Zero-crossings become curves.
    pub const TRACK: Self = Self("track");
    /// Curves become R-tables.
    pub const HOUGH: Self = Self("hough");
    /// R-tables become matches, disparities and points.
    pub const MATCH: Self = Self("match");
    /// Points of many frames along a rail become one map.
    pub const MAP: Self = Self("map");
    /// Points are compared with the truth, where it is known.
    pub const EVALUATE: Self = Self("evaluate");

    /// All of them: ours in the order of the pipe, then those of others.
    pub fn all() -> Vec<Self> {
        Self::of_kinds(Kind::all())
    }

    /// Ours, in the order of the pipe.
    pub fn own() -> Vec<Self> {
        Self::of_kinds(Kind::OWN.iter().copied())
    }

    fn of_kinds(kinds: impl Iterator<Item = Kind>) -> Vec<Self> {
        let mut all = Vec::new();
        for stage in kinds.map(Kind::stage) {
            if !all.contains(&stage) {
                all.push(stage);
            }
        }
        all
    }

    /// The stages that compute: all but the one where frames come in.
    pub fn computing() -> Vec<Self> {
        let mut all = Self::all();
        all.retain(|stage| *stage != Self::CAPTURE);
        all
    }

    /// The stage of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|stage| stage.0 == name)
    }

    /// The stage's name, which is its node's.
    pub const fn name(self) -> &'static str {
        self.0
    }

    /// The kinds of message that it takes in.
    pub fn takes(self) -> Vec<Kind> {
        let mut taken = Vec::new();
        for kind in self.makes().flat_map(|kind| kind.definition().from) {
            if !taken.contains(kind) {
                taken.push(*kind);
            }
        }
        taken
    }

    /// The kinds of message that it publishes.
    pub fn makes(self) -> impl Iterator<Item = Kind> {
        Kind::all().filter(move |kind| kind.stage() == self)
    }

    /// Whether something that it takes is made of what `earlier` makes, or it is that stage itself: when that computes anew,
    /// so must this.
    pub fn follows(self, earlier: Self) -> bool {
        let takes = || self.takes().into_iter().map(Kind::stage);
        self == earlier || takes().any(|stage| stage.follows(earlier))
    }
}

impl Serialize for Stage {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.0)
    }
}

impl<'de> Deserialize<'de> for Stage {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::named(&name).ok_or_else(|| unknown(&name, Self::all().into_iter().map(Self::name)))
    }
}

/// The error about a name that is none of those known.
fn unknown<E: serde::de::Error>(name: &str, known: impl Iterator<Item = &'static str>) -> E {
    let known: Vec<String> = known.map(|name| format!("`{name}`")).collect();
    E::custom(format!(
        "unknown variant `{name}`, expected one of {}",
        known.join(", ")
    ))
}

impl Kind {
    /// All of them, ours in the order a scan makes them, then those of others.
    pub fn all() -> impl Iterator<Item = Self> + Clone {
        let others = Other::all().iter().copied().map(Self::Other);
        Self::OWN.iter().copied().chain(others)
    }

    /// The stage that publishes it.
    pub const fn stage(self) -> Stage {
        Stage(self.definition().stage)
    }

    /// Whether each view has a topic of its own.
    pub const fn is_per_view(self) -> bool {
        self.definition().is_per_view
    }

    /// Whether each channel has a topic of its own.
    pub const fn is_per_channel(self) -> bool {
        self.definition().is_per_channel
    }

    /// The first part of the topic's name, or all of it.
    pub const fn name(self) -> &'static str {
        self.definition().name
    }

    /// The name that settings know it by: the last part of [`name`](Self::name).
    fn word(self) -> &'static str {
        let name = self.name();
        name.rsplit_once('/').map_or(name, |(_, word)| word)
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

impl<'de> Deserialize<'de> for Kind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        let known = Self::all().find(|kind| kind.word() == word);
        known.ok_or_else(|| unknown(&word, Self::all().map(Self::word)))
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
        let view_name = rig.views.get(view as usize).map(|view| view.name.as_str());
        let channel_name = rig.channels.get(channel as usize).map(f32::to_string);
        Self {
            kind,
            view,
            channel,
            name: Self::named(kind, view_name, channel_name.as_deref()),
        }
    }

    /// The name of the topic of a kind, of this view and channel where it has some.
    fn named(kind: Kind, view: Option<&str>, channel: Option<&str>) -> String {
        let name = match (kind, view) {
            (Kind::Image | Kind::Raw, Some(view)) => format!("camera/{view}/{}", kind.name()),
            (_, Some(view)) => format!("{}/{view}", kind.name()),
            (_, None) => kind.name().to_owned(),
        };
        match channel {
            Some(channel) => format!("{name}/{channel}"),
            None => name,
        }
    }

    /// The name of the topics of a kind, with VIEW and CHANNEL for those that they are of.
    pub fn pattern(kind: Kind) -> String {
        let view = kind.is_per_view().then_some("VIEW");
        Self::named(kind, view, kind.is_per_channel().then_some("CHANNEL"))
    }

    /// Every data topic of a rig, in the order a scan makes them: by kind, then view, then channel.
    pub fn all(rig: &Rig) -> Vec<Self> {
        Kind::all().flat_map(|kind| Self::of(rig, kind)).collect()
    }

    /// The topics of one kind, by view, then channel; what only a rail has a rig does not.
    pub fn of(rig: &Rig, kind: Kind) -> Vec<Self> {
        if kind.stage() == Stage::MAP && rig.rail.is_none() {
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
    #![expect(clippy::unwrap_used, reason = "tests")]
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
    fn a_stage_follows_those_whose_messages_it_takes_however_far_back() {
        for stage in Stage::all() {
            assert!(stage.follows(Stage::CAPTURE) && stage.follows(stage));
        }
        assert!(Stage::MAP.follows(Stage::FILTER) && Stage::EVALUATE.follows(Stage::HOUGH));
        assert!(!Stage::MAP.follows(Stage::EVALUATE) && !Stage::EVALUATE.follows(Stage::MAP));
        assert!(!Stage::FILTER.follows(Stage::TRACK));
        assert_eq!(Stage::MATCH.takes(), [Kind::Curves, Kind::Tables]);
    }

    #[test]
    fn kinds_and_stages_are_written_as_their_words() {
        for kind in Kind::all() {
            let text = serde_json::to_string(&kind).unwrap();
            assert_eq!(serde_json::from_str::<Kind>(&text).unwrap(), kind);
        }
        assert_eq!(
            serde_json::to_string(&Kind::Growing).unwrap(),
            "\"growing\""
        );
        let error = serde_json::from_str::<Stage>("\"trak\"").unwrap_err();
        assert!(
            error
                .to_string()
                .contains("expected one of `capture`, `filter`"),
            "{error}"
        );
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
