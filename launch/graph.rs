//! The graph file: which nodes run, with which settings.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use capture::Layout;
use messages::bus::NodePlan;
use messages::ledger::Shard;
use messages::settings::{Key, Settings as _, nearest};
use messages::{Delivery, Kind, Reference, Rig};
use serde::Deserialize as _;
use serde_json::{Map, Value};

use crate::profile::Profile;
use crate::registry::{self, NodeType};
use crate::{Failure, former, instances};

const BUILT_IN: &str = include_str!("default.toml");

messages::settings! {
    /// What concerns the graph as a whole.
    pub struct Settings {
        /// What happens to a scan that finds the door closed: lossless (it waits) or live (it is dropped, counted).
        pub delivery: Delivery = Delivery::Lossless;
        /// How often nodes may be restarted before the next scan is done; then the run gives up.
        pub restarts: u32 = 5, in 0..=1000;
        /// Seconds without any progress after which the scans under way are sent once more; after four times that the run gives up.
        pub patience: f64 = 60.0, in 1..=86400;
    }
}

/// The table of a graph file that concerns the graph as a whole.
pub(crate) const GRAPH: &str = "graph";

/// The nodes that let scans in.
const SOURCES: [&str; 2] = ["capture", "replay"];

/// A graph, checked: nodes with whole settings.
#[derive(Clone, Debug)]
pub(crate) struct Graph {
    /// The graph's own keys.
    pub(crate) settings: Settings,
    nodes: Vec<(&'static NodeType, Value)>,
    /// How many instances nodes have, where it is more than one.
    instances: BTreeMap<&'static str, u64>,
    /// Which settings nobody chose: they were found out from the source.
    measured: Vec<(&'static str, &'static str)>,
}

impl Graph {
    /// Reads a graph file, or the built-in graph; then what `overrides` set.
    pub(crate) fn load(
        file: Option<&Path>,
        profile: Profile,
        overrides: &Overrides,
    ) -> Result<Self, Failure> {
        let name = file.map_or("the built-in graph".to_owned(), |f| f.display().to_string());
        let text = match file {
            None => BUILT_IN.to_owned(),
            Some(file) => std::fs::read_to_string(file)
                .map_err(|e| Failure::usage(format!("cannot read the graph file {name}: {e}")))?,
        };
        Self::parse(&text, profile, overrides)
            .map_err(|text| Failure::usage(format!("{name}: {text}")))
    }

    pub(crate) fn parse(
        text: &str,
        profile: Profile,
        overrides: &Overrides,
    ) -> Result<Self, String> {
        let table: toml::Table = text.parse().map_err(|e: toml::de::Error| e.to_string())?;
        match serde_json::to_value(table).map_err(|e| e.to_string())? {
            Value::Object(tables) => Self::of_tables(tables, profile, overrides),
            _ => Err("expected tables".to_owned()),
        }
    }

    /// The graph of these tables, one a node, with what `overrides` set.
    pub(crate) fn of_tables(
        mut tables: Map<String, Value>,
        profile: Profile,
        overrides: &Overrides,
    ) -> Result<Self, String> {
        for name in tables.keys() {
            known_node(name)?;
        }
        for name in &overrides.with {
            let own = || Value::Object(Map::new());
            tables.entry(*name).or_insert_with(own);
        }
        for name in &overrides.without {
            tables.remove(*name);
        }
        for (name, key, value) in &overrides.set {
            known_node(name)?;
            if name == GRAPH {
                let own = || Value::Object(Map::new());
                tables.entry(GRAPH).or_insert_with(own);
            }
            let table = tables
                .get_mut(name)
                .ok_or_else(|| format!("{name}.{key} is set, but the graph has no {name}"))?;
            let Value::Object(table) = table else {
                return Err(format!("[{name}] must be a table"));
            };
            table.insert(key.clone(), value.clone());
        }
        let mut counts = BTreeMap::new();
        let mut take =
            |name: &str, keys: &[Key], mut whole: Value| -> Result<Option<Value>, String> {
                let Some(given) = tables.remove(name) else {
                    return Ok(None);
                };
                let Value::Object(given) = given else {
                    return Err(format!("[{name}] must be a table"));
                };
                if let Value::Object(whole) = &mut whole {
                    for (key, value) in flat(given) {
                        if key == instances::KEY.name && instances::may_have(name) {
                            counts.insert(name.to_owned(), instances::parsed(name, &value)?);
                            continue;
                        }
                        known_key(name, &key, keys)?;
                        whole.insert(key, value);
                    }
                }
                Ok(Some(whole))
            };
        let default = serde_json::to_value(Settings::default()).map_err(|e| e.to_string())?;
        let own = take(GRAPH, Settings::KEYS, default.clone())?.unwrap_or(default);
        let settings: Settings =
            serde_json::from_value(own).map_err(|e| format!("[{GRAPH}] {e}"))?;
        settings.check().map_err(|e| format!("{GRAPH}.{e}"))?;
        let mut nodes = Vec::new();
        for node in registry::nodes() {
            if let Some(value) = take(node.name, node.keys, (node.settings)(profile))? {
                checked(node, &value)?;
                nodes.push((node, value));
            }
        }
        let mut graph = Self {
            settings,
            instances: instances::settled(&counts),
            nodes,
            measured: Vec::new(),
        };
        graph.check_pipe()?;
        if graph.has("hough") && graph.has("match") {
            let read = reads_tables(graph.settings_of("match"))?;
            if graph.settings_of("hough")["tables"].is_null() {
                graph.fill_in("hough", "tables", read);
            }
            check_tables(graph.settings_of("hough"), graph.settings_of("match"))?;
        }
        if graph.has("record") {
            graph.check_kept()?;
        }
        Ok(graph)
    }

    /// Whether scans come in at one place, every node gets what it takes, and somebody says when a scan is done.
    fn check_pipe(&self) -> Result<(), String> {
        let is_source = |(node, _): &&(&NodeType, Value)| SOURCES.contains(&node.name);
        if self.nodes.iter().filter(is_source).count() != 1 {
            let sources = SOURCES.map(|name| format!("[{name}]")).join(" or ");
            return Err(format!(
                "a graph needs one place where scans come in: {sources}"
            ));
        }
        // Whether there is a truth the source alone knows.
        let makes = |kind: Kind| {
            kind == Kind::Truth
                || self
                    .nodes
                    .iter()
                    .any(|(n, settings)| (n.makes)(settings).contains(&kind))
        };
        let links = self
            .nodes
            .iter()
            .filter(|(n, settings)| !(n.makes)(settings).is_empty());
        for (node, settings) in links {
            let missing = (node.takes)(settings)
                .into_iter()
                .find(|&kind| !makes(kind));
            if let Some(kind) = missing {
                let (maker, takes) = (kind.stage().name(), kind.name());
                return Err(format!(
                    "{} takes {takes}, which {maker} makes: add [{maker}]",
                    node.name
                ));
            }
        }
        let finishers = self.nodes.iter().filter(|(node, _)| self.finishes(node));
        let is_idle =
            |(node, settings): &&(&NodeType, Value)| !(node.takes)(settings).into_iter().any(makes);
        if let Some((idle, _)) = finishers.clone().find(is_idle) {
            let name = idle.name;
            return Err(format!(
                "{name} would have nothing to do: nothing of what it takes is made"
            ));
        }
        if finishers.count() == 0 {
            let names = registry::nodes().iter().filter(|node| node.finishes);
            let names: Vec<String> = names.map(|node| format!("[{}]", node.name)).collect();
            return Err(format!(
                "nothing would be done with the results: a graph needs {}",
                names.join(" or ")
            ));
        }
        Ok(())
    }

    /// Whether the recorder keeps something that is made, and all that its proofs need.
    fn check_kept(&self) -> Result<(), String> {
        let settings = self.settings_of("record").clone();
        let settings: record::Settings =
            serde_json::from_value(settings).map_err(|e| format!("[record] {e}"))?;
        let nodes = self.nodes.iter();
        let made: Vec<Kind> = nodes.flat_map(|(n, own)| (n.makes)(own)).collect();
        settings.refused(&made).map_or(Ok(()), Err)
    }

    /// The node where scans come in.
    pub(crate) fn source_name(&self) -> &'static str {
        let mut nodes = self.nodes.iter().map(|(node, _)| node.name);
        nodes
            .find(|name| SOURCES.contains(name))
            .unwrap_or("capture")
    }

    /// The settings of the node where scans come in.
    pub(crate) fn source_settings(&self) -> &Value {
        let source = self
            .nodes
            .iter()
            .find(|(node, _)| SOURCES.contains(&node.name));
        source.map_or(&Value::Null, |(_, settings)| settings)
    }

    /// Whether scans come from cameras.
    pub(crate) fn has_cameras(&self) -> bool {
        let source = self.settings_of("capture").get("source");
        let source = source.and_then(Value::as_str);
        source.is_some_and(|source| source.starts_with("camera:"))
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.nodes.iter().any(|(node, _)| node.name == name)
    }

    /// A node's settings.
    pub(crate) fn settings_of(&self, name: &str) -> &Value {
        let found = self.nodes.iter().find(|(node, _)| node.name == name);
        found.map_or(&Value::Null, |(_, settings)| settings)
    }

    /// Leaves a node out for which there is nothing to do.
    pub(crate) fn remove(&mut self, name: &str) {
        self.nodes.retain(|(node, _)| node.name != name);
    }

    /// Fills in a setting that only the run knows.
    pub(crate) fn fill_in(&mut self, name: &str, key: &str, value: impl Into<Value>) {
        if let Some((_, Value::Object(settings))) =
            self.nodes.iter_mut().find(|(n, _)| n.name == name)
        {
            settings.insert(key.to_owned(), value.into());
        }
    }

    /// Fills in what the source was found to need, unless somebody chose something else than the default.
    pub(crate) fn fill_in_measured(
        &mut self,
        name: &'static str,
        key: &'static str,
        value: impl Into<Value>,
    ) {
        let value = value.into();
        if self.settings_of(name).get(key) != Some(&value) {
            self.measured.push((name, key));
        }
        self.fill_in(name, key, value);
    }

    /// Which settings were found out from the source, each as `node.key`.
    pub(crate) fn measured(&self) -> Vec<String> {
        let measured = self.measured.iter();
        measured
            .map(|(name, key)| format!("{name}.{key}"))
            .collect()
    }

    /// The kinds of message that some node takes.
    pub(crate) fn taken(&self) -> Vec<Kind> {
        let takes = |kind: &Kind| {
            let nodes = &mut self.nodes.iter();
            nodes.any(|(node, settings)| (node.takes)(settings).contains(kind))
        };
        Kind::all().filter(takes).collect()
    }

    /// The filter's channels, coarse to fine.
    pub(crate) fn channels(&self) -> Result<Vec<f32>, Failure> {
        if !self.has("filter") {
            let text = "the graph has no [filter], and everything after capture is made of its channels: add [filter] to the graph file";
            return Err(Failure::usage(text));
        }
        let channels = self.settings_of("filter").get("channels");
        let channels: Vec<f32> = serde_json::from_value(channels.cloned().unwrap_or_default())
            .map_err(Failure::usage)?;
        if channels.is_empty() || !channels.is_sorted_by(|a, b| a > b) {
            let text = format!(
                "filter.channels must go from coarse to fine, each smaller than the last, not {channels:?}"
            );
            return Err(Failure::usage(text));
        }
        Ok(channels)
    }

    /// The view that results refer to, of so many.
    pub(crate) fn reference(&self, views: usize) -> Result<usize, Failure> {
        let said = self.settings_of("match").get("reference");
        let said = said.and_then(|said| Reference::deserialize(said).ok());
        let reference = said.unwrap_or_default().index(views);
        match reference < views {
            true => Ok(reference),
            false => Err(Failure::usage(format!(
                "match.reference is view {reference}, and there are {views} views, counted from 0"
            ))),
        }
    }

    /// Frames of points before a frame on which its share of the map depends; 0 without a map.
    pub(crate) fn follow(&self) -> Result<u64, Failure> {
        if !self.has("map") {
            return Ok(0);
        }
        let settings = self.settings_of("map").clone();
        let settings: map::Settings = serde_json::from_value(settings).map_err(Failure::usage)?;
        Ok(settings.reach())
    }

    /// The nodes, as they need to know each other.
    pub(crate) fn node_plans(&self) -> Vec<NodePlan> {
        let plans = |(node, settings): &(&NodeType, Value)| {
            let of = self.instances_of(node.name);
            let (takes, makes, finishes) = (
                (node.takes)(settings),
                (node.makes)(settings),
                self.finishes(node),
            );
            let plan = |index| NodePlan {
                name: instances::name_of(node.name, index),
                shard: Shard { index, of },
                takes: takes.clone(),
                makes: makes.clone(),
                finishes,
            };
            (0..of).map(plan).collect::<Vec<_>>()
        };
        self.nodes.iter().flat_map(plans).collect()
    }

    /// Whether a scan is done only when this node is: it says so itself, or is of others, and nobody after it would notice
    /// that it lags behind.
    fn finishes(&self, node: &NodeType) -> bool {
        let is_last = || {
            let settings = self.settings_of(node.name);
            let made = (node.makes)(settings);
            let takes = |(taker, own): &(&NodeType, Value)| {
                (taker.takes)(own).iter().any(|kind| made.contains(kind))
            };
            !(node.takes)(settings).is_empty() && !self.nodes.iter().any(takes)
        };
        node.finishes || node.is_of_others && is_last()
    }

    /// How many instances a node has.
    pub(crate) fn instances_of(&self, node: &str) -> u64 {
        self.instances.get(node).copied().unwrap_or(1)
    }

    /// Why the nodes of this run cannot have several instances, if they cannot.
    pub(crate) fn check_instances(&self, rig: &Rig) -> Result<(), Failure> {
        match (self.instances.first_key_value(), rig.rail) {
            (Some((node, count)), Some(_)) => Err(Failure::usage(format!(
                "{node}.instances is {count}, and along a rail every stage takes one frame after the other: leave it at 1"
            ))),
            _ => Ok(()),
        }
    }

    /// The whole effective configuration.
    pub(crate) fn configuration(&self) -> Value {
        let own = serde_json::to_value(&self.settings).unwrap_or_default();
        let nodes = self
            .nodes
            .iter()
            .map(|(node, value)| (node.name.to_owned(), value.clone()));
        std::iter::once((GRAPH.to_owned(), own))
            .chain(nodes)
            .collect::<Map<_, _>>()
            .into()
    }

    /// The effective configuration as a graph file, each key with its meaning.
    pub(crate) fn to_toml(&self) -> String {
        let mut text = String::new();
        let own = serde_json::to_value(&self.settings).unwrap_or_default();
        let graph = (GRAPH, "the graph as a whole", Settings::KEYS, &own);
        let nodes = self
            .nodes
            .iter()
            .map(|(n, value)| (n.name, n.about, n.keys, value));
        for (name, about, keys, value) in std::iter::once(graph).chain(nodes) {
            let gap = if text.is_empty() { "" } else { "\n" };
            writeln!(text, "{gap}# {about}\n[{name}]").unwrap_or_default();
            for key in keys {
                writeln!(text, "#{}", key.about).unwrap_or_default();
                if let Some((least, most)) = key.range {
                    writeln!(text, "# {least} to {most}").unwrap_or_default();
                }
                match toml_value(value.get(key.name)) {
                    Some(value) => writeln!(text, "{} = {value}", key.name),
                    None => writeln!(text, "# {} is not set", key.name),
                }
                .unwrap_or_default();
            }
            if instances::may_have(name) {
                let Key {
                    name: key, about, ..
                } = instances::KEY;
                let count = self.instances_of(name);
                writeln!(
                    text,
                    "#{about}\n# 1 to {}\n{key} = {count}",
                    instances::MOST
                )
                .unwrap_or_default();
            }
        }
        text
    }

    /// The graph as a Mermaid diagram: nodes, and the topics between them.
    pub(crate) fn to_mermaid(&self) -> String {
        let mut text = "flowchart LR\n".to_owned();
        for (node, _) in &self.nodes {
            let times = match self.instances_of(node.name) {
                1 => String::new(),
                count => format!(" × {count}"),
            };
            writeln!(
                text,
                "    {0}[\"<b>{0}</b>{times}<br/>{1}\"]",
                node.name, node.about
            )
            .unwrap_or_default();
        }
        let source = self.nodes.first().map_or("", |(node, _)| node.name);
        for (maker, settings) in &self.nodes {
            let makes = (maker.makes)(settings);
            for (taker, settings) in &self.nodes {
                let mut between = (taker.takes)(settings);
                between.retain(|kind| makes.contains(kind));
                let kinds: Vec<&str> = between.into_iter().map(Kind::name).collect();
                if !kinds.is_empty() {
                    let kinds = kinds.join(", ");
                    writeln!(text, "    {} -->|{kinds}| {}", maker.name, taker.name)
                        .unwrap_or_default();
                }
            }
            if self.finishes(maker) {
                writeln!(text, "    {} -.->|done| {source}", maker.name).unwrap_or_default();
            }
        }
        text
    }
}

/// A table's keys, those of tables in it by both names: `[match.curves] score` is `curves.score`.
fn flat(table: Map<String, Value>) -> impl Iterator<Item = (String, Value)> {
    table.into_iter().flat_map(|(key, value)| match value {
        Value::Object(inner) => {
            let own = |(inner, value)| (format!("{key}.{inner}"), value);
            inner.into_iter().map(own).collect::<Vec<_>>()
        }
        value => vec![(key, value)],
    })
}

fn toml_value(value: Option<&Value>) -> Option<toml::Value> {
    let value = value.filter(|value| !value.is_null())?;
    toml::Value::try_from(value).ok()
}

pub(crate) fn checked(node: &NodeType, value: &Value) -> Result<(), String> {
    (node.check)(value).map_err(|text| {
        // Serde names the value but not the key: find the key that does not parse by itself.
        let Value::Object(whole) = value else {
            return format!("[{}] {text}", node.name);
        };
        let alone = |(key, value): &(&String, &Value)| check_alone(node, key, value).is_err();
        match whole.iter().find(alone) {
            Some((key, value)) if !text.starts_with(key.as_str()) => {
                format!("{}.{key} is {}, not {value}", node.name, taken(node, key))
            }
            _ => format!("{}.{text}", node.name),
        }
    })
}

/// Checks one value of a node whose other settings are sound.
fn check_alone(node: &NodeType, key: &str, value: &Value) -> Result<(), String> {
    let mut settings = (node.settings)(Profile::Default);
    if let Value::Object(settings) = &mut settings {
        settings.insert(key.to_owned(), value.clone());
    }
    (node.check)(&settings)
}

/// What a key takes, in words.
fn taken(node: &NodeType, key: &str) -> String {
    let known = node.keys.iter().find(|known| known.name == key);
    if let Some(takes) = known.and_then(Key::takes) {
        return takes;
    }
    // A choice between names: serde lists them to whoever gives it another one.
    let names = |other: Value| {
        let none = check_alone(node, key, &other).err().unwrap_or_default();
        let names = none.split_once("expected ");
        names.map(|(_, names)| names.replace('`', ""))
    };
    if known.is_some_and(|known| known.kind.starts_with("Vec<")) {
        let names = names(vec![""].into()).unwrap_or_default();
        let names = names.strip_prefix("one of ").unwrap_or(&names);
        let first = names.split(", ").next().unwrap_or_default();
        return format!("a list of some of {names}, as [{first:?}]");
    }
    names("".into()).unwrap_or("something else".to_owned())
}

pub(crate) fn known_node(name: &str) -> Result<(), String> {
    if name == GRAPH || registry::find(name).is_some() {
        return Ok(());
    }
    let known = || {
        registry::nodes()
            .iter()
            .map(|node| node.name)
            .chain([GRAPH])
    };
    Err(match nearest(name, known()) {
        Some(near) => format!("there is no node {name}; do you mean {near}?"),
        None => format!(
            "there is no node {name}; there are {}",
            known().collect::<Vec<_>>().join(", ")
        ),
    })
}

pub(crate) fn known_key(node: &str, key: &str, keys: &[Key]) -> Result<(), String> {
    let known = || keys.iter().map(|key| key.name);
    if known().any(|name| name == key) {
        return Ok(());
    }
    if let Some(told) = former::told(node, key) {
        return Err(told);
    }
    Err(match nearest(key, known()) {
        Some(near) => format!("{node} has no key {key}; do you mean {node}.{near}?"),
        None => format!(
            "{node} has no key {key}; it has {}",
            known().collect::<Vec<_>>().join(", ")
        ),
    })
}

/// A value as on the command line: what is no TOML is taken for a text.
pub(crate) fn parsed(value: &str) -> Value {
    // What is not given, so that it follows from the images; TOML has no word for it, and it is shown as the latter.
    if ["null", "automatic"].contains(&value.trim()) {
        return Value::Null;
    }
    let parsed = format!("v = {value}").parse::<toml::Table>().ok();
    let parsed = parsed
        .and_then(|mut table| table.remove("v"))
        // JSON has neither: they would be taken for nothing said.
        .filter(|parsed| parsed.as_float().is_none_or(f64::is_finite))
        .filter(|_| !value.contains('\n'));
    let parsed = parsed.and_then(|value| serde_json::to_value(value).ok());
    parsed.unwrap_or_else(|| value.into())
}

/// What the command line changes in a graph file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Overrides {
    set: Vec<(String, String, Value)>,
    without: Vec<&'static str>,
    with: Vec<&'static str>,
}

impl Overrides {
    /// Reads `node.key=value` lines; a value that is no TOML is taken for a text.
    pub(crate) fn parse(lines: &[String]) -> Result<Self, Failure> {
        let mut overrides = Self::default();
        for line in lines {
            let parts = line
                .split_once('=')
                .and_then(|(place, value)| Some((place.split_once('.')?, value)));
            let Some(((node, key), value)) = parts else {
                return Err(Failure::usage(format!(
                    "--set expects node.key=value, not {line:?}"
                )));
            };
            overrides.set(node.trim(), key.trim(), parsed(value));
        }
        Ok(overrides)
    }

    /// The keys that are set, of every node.
    pub(crate) fn keys(&self) -> impl Iterator<Item = (&str, &str)> {
        self.set.iter().map(|(node, key, _)| (&**node, &**key))
    }

    /// Sets a key.
    pub(crate) fn set(&mut self, node: &str, key: &str, value: impl Into<Value>) {
        self.set
            .push((node.to_owned(), key.to_owned(), value.into()));
    }

    /// Says how the images of a folder lie; those of a rail are a rail's.
    pub(crate) fn lay(&mut self, layout: Option<Layout>) {
        if let Some(layout) = layout {
            self.set("capture", "layout", layout.to_string());
        }
        if layout == Some(Layout::Rail) {
            self.set("capture", "mode", "rail");
        }
    }

    /// Takes a node in, with its own settings.
    pub(crate) fn with(&mut self, node: &'static str) {
        self.with.push(node);
    }

    /// Leaves a node out.
    pub(crate) fn without(&mut self, node: &'static str) {
        self.without.push(node);
        self.set.retain(|(name, _, _)| name != node);
    }
}

/// Whether a matcher with these settings reads R-tables.
pub(crate) fn reads_tables(matcher: &Value) -> Result<bool, String> {
    let settings: matching::Settings =
        serde_json::from_value(matcher.clone()).map_err(|e| format!("[match] {e}"))?;
    Ok(settings.reads_tables())
}

/// Whether the matcher gets the R-tables that it reads.
pub(crate) fn check_tables(hough: &Value, matcher: &Value) -> Result<(), String> {
    match reads_tables(matcher)? && hough["tables"] == false {
        true => Err(
            "match.assignment = curve reads R-tables, and hough.tables = false makes none: set hough.tables = true too"
                .to_owned(),
        ),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, clippy::unwrap_in_result, reason = "tests")]
    use super::*;

    fn load(text: &str, set: &[&str]) -> Result<Graph, String> {
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        Graph::parse(text, Profile::Default, &Overrides::parse(&set).unwrap())
    }

    #[test]
    fn the_built_in_graph_is_sound_and_prints_as_a_graph_file_that_reads_back() {
        let graph = load(BUILT_IN, &[]).unwrap();
        let again = load(&graph.to_toml(), &[]).unwrap();
        assert_eq!(again.configuration(), graph.configuration());
    }

    #[test]
    fn r_tables_are_made_where_the_matcher_reads_them() {
        let made = |set: &[&str]| {
            let graph = load(BUILT_IN, set)?;
            Ok::<_, String>(graph.settings_of("hough")["tables"].clone())
        };
        assert_eq!(made(&[]), Ok(false.into()));
        assert_eq!(made(&["match.assignment=curve"]), Ok(true.into()));
        assert_eq!(made(&["hough.tables=true"]), Ok(true.into()));
        let point = ["match.assignment=curve", "match.method=point"];
        assert_eq!(made(&point), Ok(false.into()));
        let error = made(&["match.assignment=curve", "hough.tables=false"]).unwrap_err();
        assert!(error.ends_with("set hough.tables = true too"), "{error}");
    }

    #[test]
    fn an_unknown_key_is_refused_with_the_nearest_known_one() {
        let error = load("[capture]\nsorce = \"x\"\n[match]\n", &[]).unwrap_err();
        assert_eq!(
            error,
            "capture has no key sorce; do you mean capture.source?"
        );
        let error = load(BUILT_IN, &["filtr.floor=1"]).unwrap_err();
        assert_eq!(error, "there is no node filtr; do you mean filter?");
    }

    #[test]
    fn keys_of_a_table_within_a_table_are_read_and_set_by_both_names() {
        let of = |graph: &Graph| graph.settings_of("match")["curves.score"].clone();
        let graph = load(&format!("{BUILT_IN}[match.curves]\nscore = 0.7\n"), &[]).unwrap();
        assert_eq!(of(&graph), 0.7);
        let again = load(&graph.to_toml(), &[]).unwrap();
        assert_eq!(of(&again), 0.7);
        let graph = load(BUILT_IN, &["match.curves.score=0.8"]).unwrap();
        assert_eq!(of(&graph), 0.8);
        let error = load(BUILT_IN, &["match.curves.score=7"]).unwrap_err();
        assert_eq!(error, "match.curves.score must lie between 0 and 1, not 7");
        let error = load(BUILT_IN, &["match.curves.scor=0.7"]).unwrap_err();
        assert!(
            error.ends_with("do you mean match.curves.score?"),
            "{error}"
        );
    }

    #[test]
    fn a_key_that_there_was_is_refused_with_what_became_of_it() {
        let of = |set: &str| load(BUILT_IN, &[set]).unwrap_err();
        assert_eq!(
            of("match.score=0.6"),
            "match.score is called match.curves.score now"
        );
        assert_eq!(
            of("match.initial_disparity=32"),
            "match.initial_disparity is called match.curves.initial_disparity and match.points.initial_disparity now"
        );
        assert_eq!(
            of("match.candidates=4"),
            "match.candidates is gone, and is always 8: more than 3 changed nothing"
        );
        let error = load("[capture]\n[match]\njump = 100\n", &[]).unwrap_err();
        assert!(
            error.starts_with("match.jump is gone, and is always 2.0: "),
            "{error}"
        );
    }

    #[test]
    fn a_value_out_of_range_names_the_key_and_the_range() {
        let error = load(BUILT_IN, &["capture.in_flight=99"]).unwrap_err();
        assert!(
            error.starts_with("capture.in_flight must lie between 1 and "),
            "{error}"
        );
    }

    #[test]
    fn a_value_of_the_wrong_type_names_the_key() {
        let error = load(BUILT_IN, &["capture.in_flight=many"]).unwrap_err();
        assert_eq!(
            error,
            "capture.in_flight is a whole number from 1 to 30, or automatic, not \"many\""
        );
        let error = load(BUILT_IN, &["match.assignment=3"]).unwrap_err();
        assert_eq!(error, "match.assignment is point or curve, not 3");
        for value in ["edges", "[\"edgs\"]", "3"] {
            let error = load(BUILT_IN, &[&format!("record.without={value}")]).unwrap_err();
            let told = "record.without is a list of some of image, image_raw, truth, edges, ";
            assert!(error.starts_with(told), "{error}");
            assert!(error.contains(", as [\"image\"], not "), "{error}");
        }
    }

    #[test]
    fn what_concerns_the_graph_is_set_also_where_it_has_no_table_for_it() {
        let text = BUILT_IN.replace("[graph]\ndelivery = \"lossless\"\n", "");
        assert_ne!(text, BUILT_IN);
        let graph = load(&text, &["graph.delivery=live"]).unwrap();
        assert_eq!(graph.settings.delivery, Delivery::Live);
    }

    #[test]
    fn a_node_is_added_where_it_is_missing_and_nowhere_else() {
        let mut overrides = Overrides::default();
        overrides.with("bridge");
        overrides.with("track");
        overrides.set("bridge", "port", 0);
        let text = format!("{BUILT_IN}[bridge]\nhost = \"::1\"\n");
        for (text, host) in [(BUILT_IN, "127.0.0.1"), (&text, "::1")] {
            let graph = Graph::parse(text, Profile::Default, &overrides).unwrap();
            let bridge = graph.settings_of("bridge");
            assert_eq!(
                (&bridge["port"], &bridge["host"]),
                (&0.into(), &host.into())
            );
            assert_eq!(graph.node_plans().len(), 9);
        }
    }

    #[test]
    fn a_graph_with_a_gap_says_which_node_is_missing() {
        let error = load("[capture]\n[filter]\n[hough]\n[match]\n", &[]).unwrap_err();
        assert_eq!(error, "hough takes curves, which track makes: add [track]");
    }

    #[test]
    fn damaged_graph_files_are_told_and_never_panic() {
        let good = load(BUILT_IN, &[]).unwrap().to_toml();
        let mut state = 11u64;
        let mut random = |below: usize| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        let (mut read, mut refused) = (0, 0);
        for _ in 0..2000 {
            let mut bytes = good.clone().into_bytes();
            for _ in 0..=random(3) {
                let (from, at) = (random(bytes.len()), random(bytes.len()));
                match random(3) {
                    0 => bytes[at] = b" \n=[]\".,-0x9#\0"[random(14)],
                    1 => bytes.truncate(at.max(1)),
                    _ => bytes[at] = bytes[from],
                }
            }
            match load(&String::from_utf8_lossy(&bytes), &[]) {
                Ok(graph) => {
                    read += 1;
                    assert!(!graph.to_mermaid().is_empty());
                }
                Err(text) => {
                    refused += 1;
                    assert!(!text.is_empty());
                }
            }
        }
        assert!(read > 50 && refused > 50, "{read} read, {refused} refused");
    }

    #[test]
    fn null_unsets_what_need_not_be_set_and_nothing_else() {
        let of = |set: &str| {
            let overrides = Overrides::parse(&[set.to_owned()]).unwrap();
            Graph::load(None, Profile::Default, &overrides)
        };
        let graph = of("filter.smoothing=null").unwrap();
        assert!(graph.settings_of("filter")["smoothing"].is_null());
        assert!(of("filter.floor=null").is_err());
    }

    #[test]
    fn the_diagram_shows_every_node_and_the_way_back_to_the_door() {
        let diagram = load(BUILT_IN, &[]).unwrap().to_mermaid();
        for line in [
            "capture -->|image| filter",
            "hough -->|tables| match",
            "record -.->|done| capture",
        ] {
            assert!(diagram.contains(line), "{line} in\n{diagram}");
        }
    }
}
