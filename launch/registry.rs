//! The one registry of nodes: a new node is a crate, a line here and a line in a graph file.

use std::error::Error;

use messages::bus::{Bus, Start};
use messages::settings::{Key, Settings};
use messages::{Kind, Stage};
use serde_json::Value;

use crate::profile::Profile;

/// Is a node, with its settings.
type Be = fn(&mut Bus, &Value, &Start) -> Result<(), Box<dyn Error>>;

/// A kind of node.
#[derive(Debug)]
pub(crate) struct NodeType {
    /// Its name in graph files.
    pub(crate) name: &'static str,
    /// What it does.
    pub(crate) about: &'static str,
    /// What it takes in with these settings, of what there is.
    pub(crate) takes: fn(&Value) -> Vec<Kind>,
    /// What it makes with these settings.
    pub(crate) makes: fn(&Value) -> Vec<Kind>,
    /// The version of its algorithm, of a stage that computes.
    pub(crate) version: Option<u32>,
    /// Whether a scan is done only when it says so.
    pub(crate) finishes: bool,
    /// All keys of its settings.
    pub(crate) keys: &'static [Key],
    /// Which of them cannot be changed while it runs; `None` when none can.
    pub(crate) fixed: Option<&'static [&'static str]>,
    /// Its settings in a profile.
    pub(crate) settings: fn(Profile) -> Value,
    /// Checks settings: types and ranges.
    pub(crate) check: fn(&Value) -> Result<(), String>,
    /// Is the node, until it shall stop.
    pub(crate) run: Be,
}

impl NodeType {
    /// Whether this one of its settings can be changed while it runs.
    pub(crate) fn is_tunable(&self, key: &str) -> bool {
        self.fixed.is_some_and(|fixed| !fixed.contains(&key))
    }
}

/// A line of the registry.
macro_rules! node {
    ($name:literal, $($krate:ident)::+, $about:literal, takes $takes:expr, makes $makes:expr, version $version:expr,
     finishes $finishes:literal, fixed $fixed:expr, thesis $thesis:expr) => {
        NodeType {
            name: $name,
            about: $about,
            takes: $takes,
            makes: $makes,
            version: $version,
            finishes: $finishes,
            keys: <$($krate)::+::Settings as Settings>::KEYS,
            fixed: $fixed,
            settings: |profile| match profile {
                Profile::Thesis => json(&$thesis),
                _ => profile.changed($name, json(&$($krate)::+::Settings::default())),
            },
            check: |value| parse::<$($krate)::+::Settings>(value).map(drop),
            run: |bus, value, start| Ok($($krate)::+::node::run(bus, parse(value)?, start)?),
        }
    };
}

/// All kinds of node, in the order of the pipe.
pub(crate) const NODES: &[NodeType] = &[
    node!("capture", capture, "where scans come from",
        takes |_| Stage::Capture.takes().to_vec(), makes captured, version None, finishes false, fixed None, thesis capture::Settings::default()),
    node!("replay", replay, "a recording in place of the stages before the cut",
        takes |_| vec![], makes replayed, version None, finishes false, fixed None, thesis replay::Settings::default()),
    node!("filter", filter, "Laplacian of Gaussian, zero-crossings, gradients",
        takes |_| Stage::Filter.takes().to_vec(), makes |_| Stage::Filter.makes().collect(), version Some(filter::VERSION), finishes false, fixed Some(&["channels"]), thesis filter::Settings::thesis()),
    node!("track", track, "zero-crossings become curves",
        takes |_| Stage::Track.takes().to_vec(), makes |_| Stage::Track.makes().collect(), version Some(track::VERSION), finishes false, fixed Some(&[]), thesis track::Settings::thesis()),
    node!("hough", hough, "curves become R-tables",
        takes |_| Stage::Hough.takes().to_vec(), makes |_| Stage::Hough.makes().collect(), version Some(hough::VERSION), finishes false, fixed Some(&[]), thesis hough::Settings::thesis()),
    node!("match", matching, "R-tables become matches, disparities and points",
        takes |_| Stage::Match.takes().to_vec(), makes |_| Stage::Match.makes().collect(), version Some(matching::VERSION), finishes true, fixed Some(&["reference"]), thesis matching::Settings::thesis()),
    node!("map", map, "points of many frames along a rail become one map",
        takes |_| Stage::Map.takes().to_vec(), makes |_| Stage::Map.makes().collect(), version Some(map::VERSION), finishes true, fixed Some(&["window", "apart"]), thesis map::Settings::default()),
    node!("evaluate", evaluate, "points against the truth, where the source knows it",
        takes |_| Stage::Evaluate.takes().to_vec(), makes |_| Stage::Evaluate.makes().collect(), version Some(evaluate::VERSION), finishes true, fixed Some(&["view"]), thesis evaluate::Settings::default()),
    node!("record", record, "every topic into MCAP",
        takes recorded, makes |_| vec![], version None, finishes true, fixed None, thesis record::Settings::default()),
    node!("bridge", bridge, "the graph for Foxglove and other viewers",
        takes |_| vec![], makes |_| vec![], version None, finishes false, fixed None, thesis bridge::Settings::default()),
    node!("verify", replay::verify, "compares what is computed with what was recorded",
        takes verified, makes |_| vec![], version None, finishes true, fixed None, thesis replay::verify::Settings::default()),
    node!("rehydrate", record::rehydrate, "makes the full recording that a proof stands for",
        takes rehydrated, makes |_| vec![], version None, finishes true, fixed None, thesis record::rehydrate::Settings::default()),
];

fn captured(settings: &Value) -> Vec<Kind> {
    parse::<capture::Settings>(settings)
        .unwrap_or_default()
        .makes()
}

fn recorded(settings: &Value) -> Vec<Kind> {
    record::taken_kinds(&parse::<record::Settings>(settings).unwrap_or_default())
}

fn verified(settings: &Value) -> Vec<Kind> {
    let settings = parse::<replay::verify::Settings>(settings).unwrap_or_default();
    let mut kinds = Kind::ALL.to_vec();
    let played = replay::replayed_kinds(settings.from);
    kinds.retain(|kind| !played.contains(kind) && !settings.without.contains(kind));
    kinds
}

fn rehydrated(settings: &Value) -> Vec<Kind> {
    let settings = parse::<record::rehydrate::Settings>(settings).unwrap_or_default();
    let mut kinds = Kind::ALL.to_vec();
    kinds.retain(|kind| !settings.without.contains(kind));
    kinds
}

/// The versions of all stages that compute, by their names.
pub(crate) fn versions() -> impl Iterator<Item = (&'static str, u32)> {
    NODES
        .iter()
        .filter_map(|node| Some((node.name, node.version?)))
}

fn replayed(settings: &Value) -> Vec<Kind> {
    parse::<replay::Settings>(settings)
        .unwrap_or_default()
        .kinds()
}

/// The kind of node of this name.
pub(crate) fn find(name: &str) -> Option<&'static NodeType> {
    NODES.iter().find(|node| node.name == name)
}

/// Settings as JSON, by way of their text: a single-precision 0.4 stays 0.4.
fn json(settings: &impl serde::Serialize) -> Value {
    let text = serde_json::to_string(settings).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or_default()
}

fn parse<S: Settings>(value: &Value) -> Result<S, String> {
    let settings: S = serde_json::from_value(value.clone()).map_err(|e| e.to_string())?;
    settings.check().map_err(|e| e.to_string())?;
    Ok(settings)
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use clap::ValueEnum;

    use super::*;

    #[test]
    fn every_nodes_settings_pass_their_own_check_in_every_profile() {
        for node in NODES {
            for profile in Profile::value_variants() {
                (node.check)(&(node.settings)(*profile)).unwrap();
            }
        }
    }

    #[test]
    fn every_key_says_what_it_means() {
        for node in NODES {
            for key in node.keys {
                assert!(!key.about.trim().is_empty(), "{}.{}", node.name, key.name);
            }
        }
    }
}
