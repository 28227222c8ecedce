//! Names of topics in files that others rewrote: under a prefix, or beside topics of other programs.

use std::collections::BTreeMap;

/// Topics that stand by their name alone.
const SINGLE: [&str; 12] = [
    "tf",
    "statistics",
    "digests",
    "ledger",
    "health",
    "synchronisation",
    "log",
    "truth",
    "disparity",
    "points",
    "map",
    "evaluation",
];

/// What a view's camera says.
const OF_CAMERA: [&str; 6] = [
    "image",
    "image_raw",
    "calibration",
    "annotations",
    "labels",
    "rejected",
];

/// How much a topic's name says that the topic is of a recording; `None` when it is not.
fn weight(topic: &str) -> Option<usize> {
    let parts: Vec<&str> = topic.split('/').collect();
    let is_variance = |part: &str| part.parse::<f32>().is_ok_and(|variance| variance > 0.0);
    match parts.as_slice() {
        // Nobody else calls a topic so.
        ["edges" | "curves" | "tables", _, channel] if is_variance(channel) => Some(100),
        ["matches", channel] if is_variance(channel) => Some(100),
        ["camera", _, what] if OF_CAMERA.contains(what) => Some(1),
        ["disparity", "picture" | "error" | "confidence"] => Some(1),
        ["disparity", "picture" | "error" | "confidence", "legend"] => Some(1),
        ["map", "growing" | "whole"] => Some(1),
        [single] if SINGLE.contains(single) => Some(1),
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
pub(super) fn schema_of(topic: &str) -> &'static str {
    match topic.split('/').collect::<Vec<_>>().as_slice() {
        ["tf"] => "foxglove.FrameTransforms",
        ["camera", _, "calibration"] => "foxglove.CameraCalibration",
        ["camera", _, "image" | "image_raw"] | ["disparity" | "truth"] => "foxglove.RawImage",
        ["points"] | ["map", ..] => "foxglove.PointCloud",
        ["edges", ..] => "tricurve.Edges",
        ["curves", ..] => "tricurve.Curves",
        ["tables", ..] => "tricurve.Tables",
        ["matches", ..] => "tricurve.Matches",
        ["digests"] => "tricurve.Digests",
        _ => "",
    }
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
