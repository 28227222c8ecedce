//! How many processes a stage runs in.
//!
//! Each instance works on the scans whose number is its own, so nobody schedules, and results are the same whatever there
//! are: how many is no setting of the stage, and no recording depends on it.

use std::collections::BTreeMap;
use std::thread::available_parallelism;

use messages::settings::Key;
use serde_json::Value;

/// Stages whose scans depend on no other scan.
pub(crate) const STAGES: [&str; 5] = ["filter", "track", "hough", "match", "evaluate"];

/// The most instances of a stage: what is under way is spread over them, and more than that had nothing to do.
pub(crate) const MOST: u64 = 16;

/// The key that says it, beside those of the stage itself.
pub(crate) const KEY: Key = Key {
    name: "instances",
    about: " How many processes share this stage's scans, each taking every so many-th; \"auto\" makes as many as this machine's \
            cores have use for. Results are the same.",
    kind: "u64",
    range: Some((1.0, MOST as f64)),
};

/// What of a scan's computing each stage takes, in per cent: default settings, 512×480, as `tricurve run` tells it.
const SHARES: [(&str, f64); 5] = [
    ("filter", 17.0),
    ("track", 30.0),
    ("hough", 3.0),
    ("match", 43.0),
    ("evaluate", 7.0),
];

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Count {
    /// So many.
    Set(u64),
    /// As many as the machine has use for.
    Auto,
}

/// Whether a node can have several.
pub(crate) fn may_have(node: &str) -> bool {
    STAGES.contains(&node)
}

/// Reads what is asked for of a node.
pub(crate) fn parsed(node: &str, value: &Value) -> Result<Count, String> {
    let count = value.as_u64().filter(|count| (1..=MOST).contains(count));
    match (value.as_str(), count) {
        (Some("auto"), _) => Ok(Count::Auto),
        (_, Some(count)) => Ok(Count::Set(count)),
        _ => Err(format!(
            "{node}.instances is a whole number from 1 to {MOST}, or \"auto\", not {value}"
        )),
    }
}

/// How many instances nodes have, where it is more than one.
pub(crate) fn settled(asked: &BTreeMap<String, Count>) -> BTreeMap<&'static str, u64> {
    let cores = available_parallelism().map_or(1, usize::from);
    let stages = STAGES.into_iter();
    let count = |stage| match asked.get(stage) {
        Some(Count::Set(count)) => *count,
        Some(Count::Auto) => fitting(stage, cores),
        None => 1,
    };
    let all = stages.map(|stage| (stage, count(stage)));
    all.filter(|(_, count)| *count > 1).collect()
}

/// How busy an instance is at most, so that a scan that takes longer than others holds nobody up.
const BUSY: f64 = 0.8;

/// How many instances of a stage keep so many cores busy.
pub(crate) fn fitting(stage: &str, cores: usize) -> u64 {
    let share = SHARES.iter().find(|(name, _)| *name == stage);
    let cores = share.map_or(0.0, |(_, share)| share / 100.0) * cores as f64;
    ((cores / BUSY).ceil() as u64).clamp(1, MOST)
}

/// The name of an instance: the first one's is the node's own.
pub(crate) fn name_of(node: &str, index: u64) -> String {
    match index {
        0 => node.to_owned(),
        _ => format!("{node}.{}", index + 1),
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use serde_json::json;

    #[test]
    fn auto_gives_a_stage_as_many_instances_as_cores_fall_to_it_and_some_room() {
        let of = |cores| STAGES.map(|stage| fitting(stage, cores));
        assert_eq!(of(1), [1, 1, 1, 1, 1]);
        assert_eq!(of(2), [1, 1, 1, 2, 1]);
        assert_eq!(of(8), [2, 3, 1, 5, 1]);
        assert_eq!(of(16), [4, 6, 1, 9, 2]);
    }

    #[test]
    fn what_is_no_number_of_instances_is_refused_in_a_sentence() {
        assert_eq!(parsed("match", &json!(3)), Ok(Count::Set(3)));
        assert_eq!(parsed("match", &json!("auto")), Ok(Count::Auto));
        for wrong in [json!(0), json!(17), json!(1.5), json!("many")] {
            let why = parsed("match", &wrong).unwrap_err();
            let told =
                format!("match.instances is a whole number from 1 to 16, or \"auto\", not {wrong}");
            assert_eq!(why, told);
        }
    }
}
