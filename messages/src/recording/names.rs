//! Names of topics in files that others rewrote: under a prefix, or beside topics of other programs.

use std::collections::BTreeMap;

use crate::payload::Kind;
use crate::record::Schema;

/// Topics beside the data that stand by their name alone.
const SINGLE: [&str; 7] = [
    "tf",
    "statistics",
    "digests",
    "ledger",
    "health",
    "synchronisation",
    "log",
];

/// What a view's camera says beside its images.
const OF_CAMERA: [&str; 4] = ["calibration", "annotations", "labels", "rejected"];

/// The kind of data of which a topic of this name may be.
fn kind(parts: &[&str]) -> Option<Kind> {
    let is_variance = |part: &&str| part.parse::<f32>().is_ok_and(|variance| variance > 0.0);
    let is_of = |kind: &Kind| {
        if let Kind::Image | Kind::Raw = kind {
            return matches!(parts, ["camera", _, what] if *what == kind.name());
        }
        let mut rest = parts.iter();
        kind.name()
            .split('/')
            .all(|word| rest.next() == Some(&word))
            && (!kind.is_per_view() || rest.next().is_some())
            && (!kind.is_per_channel() || rest.next().is_some_and(is_variance))
            && rest.next().is_none()
    };
    Kind::all().find(is_of)
}

/// How much a topic's name says that the topic is of a recording; `None` when it is not.
fn weight(topic: &str) -> Option<usize> {
    let parts: Vec<&str> = topic.split('/').collect();
    match (parts.as_slice(), kind(&parts)) {
        // Nobody else calls a topic by a filter's channel.
        (_, Some(kind)) if kind.is_per_channel() => Some(100),
        (_, Some(_)) => Some(1),
        (["camera", _, what], _) if OF_CAMERA.contains(what) => Some(1),
        (["disparity", "picture" | "error" | "confidence"], _) => Some(1),
        (["disparity", "picture" | "error" | "confidence", "legend"], _) => Some(1),
        (["map", "whole"], _) => Some(1),
        ([single], _) if SINGLE.contains(single) => Some(1),
        _ => None,
    }
}

/// Whether a topic of this name may be one of a recording.
pub(super) fn is_ours(topic: &str) -> bool {
    weight(topic).is_some()
}

/// Whether only recordings call a topic so.
pub(super) fn is_telling(topic: &str) -> bool {
    weight(topic) == Some(100)
}

/// What messages of a topic of this name are, where a file does not say it.
pub(super) fn schema_of(topic: &str) -> String {
    let parts: Vec<&str> = topic.split('/').collect();
    let schema = match (parts.as_slice(), kind(&parts)) {
        (_, Some(kind)) => Schema::of(kind),
        (["tf"], _) => Schema::transforms(),
        (["camera", _, "calibration"], _) => Schema::calibration(),
        (["map", ..], _) => Schema::of(Kind::Map),
        (["digests"], _) => Schema::digests(),
        _ => return String::new(),
    };
    schema.name
}

/// The prefix of a topic's name before what may be one of a recording, and how much that says.
fn prefix(topic: &str) -> Option<(&str, usize)> {
    let slashes = topic.match_indices('/').map(|(at, _)| at + 1);
    let mut starts = std::iter::once(0).chain(slashes);
    starts.find_map(|start| Some((&topic[..start], weight(&topic[start..])?)))
}

/// What all topics of a recording have in front of their names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Prefix {
    /// The one before most of them; empty where they are called as they were.
    pub(super) common: String,
    /// Others, before topics that only recordings have: there are several in one file.
    pub(super) others: Vec<String>,
}

impl Prefix {
    /// That of these topics.
    pub(super) fn of<'a>(topics: impl Iterator<Item = &'a str>) -> Self {
        let mut weights: BTreeMap<&str, usize> = BTreeMap::new();
        for (prefix, weight) in topics.filter_map(prefix) {
            *weights.entry(prefix).or_default() += weight;
        }
        // Of those that say as much the first, which is the shortest.
        let heaviest = weights.values().copied().max();
        let common = weights
            .iter()
            .find_map(|(prefix, weight)| (Some(*weight) == heaviest).then_some(*prefix))
            .unwrap_or_default();
        let is_other = |(prefix, weight): &(&&str, &usize)| **prefix != common && **weight >= 100;
        let others = weights.iter().filter(is_other);
        Self {
            others: others.map(|(prefix, _)| (*prefix).to_owned()).collect(),
            common: common.to_owned(),
        }
    }

    /// A topic's own name.
    pub(super) fn without<'a>(&self, topic: &'a str) -> &'a str {
        topic.strip_prefix(&*self.common).unwrap_or(topic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Codec, Shown};
    use crate::{Rail, Rig, Size};

    fn names(rig: Rig) -> Vec<String> {
        let channels = Codec::new(rig, 0).channels(Shown::RECORDED);
        channels.into_iter().map(|channel| channel.name).collect()
    }

    fn rigs() -> [Rig; 3] {
        let size = Size::new(64, 48);
        let rail = Rail {
            stride: 1,
            ..Rail::default()
        };
        [
            Rig::of_views(3, &[30.0, 1.5], size),
            Rig::of_views(20, &[4.0], size),
            Rig::of_rail(rail, &[8.0], size),
        ]
    }

    #[test]
    fn every_topic_of_a_recording_is_known_under_every_prefix() {
        for rig in rigs() {
            let names = names(rig);
            assert!(names.iter().all(|name| is_ours(name)), "{names:?}");
            for wanted in [
                "",
                "/",
                "/tricurve/",
                "robot/1/",
                "/camera/left/",
                "/points/",
            ] {
                let renamed: Vec<String> = names.iter().map(|n| format!("{wanted}{n}")).collect();
                let prefix = Prefix::of(renamed.iter().map(String::as_str));
                assert_eq!((&*prefix.common, prefix.others.len()), (wanted, 0));
                let own = renamed.iter().map(|name| prefix.without(name));
                assert!(own.eq(names.iter().map(String::as_str)));
            }
        }
    }

    #[test]
    fn topics_of_others_change_no_name_and_a_second_recording_is_seen() {
        let [rig, ..] = rigs();
        let mut names = names(rig);
        names.extend(["/camera/left/image", "/odom", "/tf", "scan/3"].map(str::to_owned));
        let prefix = Prefix::of(names.iter().map(String::as_str));
        assert_eq!(prefix, Prefix::default());
        names.push("/b/edges/left/30".to_owned());
        let prefix = Prefix::of(names.iter().map(String::as_str));
        assert_eq!(prefix.others, ["/b/"]);
    }
}
