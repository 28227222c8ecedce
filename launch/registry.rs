//! The one registry of nodes: a new node is a crate, a line here and a line in a graph file. A program of others
//! [adds its own](App).

use std::error::Error;
use std::process::ExitCode;
use std::sync::OnceLock;

use messages::bus::{Bus, Start};
use messages::settings::{Key, Settings};
use messages::{Kind, Message, Stage};
use serde_json::Value;

use crate::graph::GRAPH;
use crate::profile::Profile;
use crate::program;

/// Which kinds of message a node takes or makes with its settings.
type Kinds = Box<dyn Fn(&Value) -> Vec<Kind> + Send + Sync>;

/// Is a node, with its settings.
type Be = Box<dyn Fn(&mut Bus, &Value, &Start) -> Result<(), Box<dyn Error>> + Send + Sync>;

/// A type of node: its name, what it takes and makes, its settings, and the function that it is.
///
/// The launcher runs it as a process of its own, with its table in the graph file as settings, starts it again when it dies,
/// and keeps account of every message; recorder, replay and viewers know its messages from their
/// [definitions](messages::message!).
pub struct NodeType {
    pub(crate) name: &'static str,
    pub(crate) about: &'static str,
    pub(crate) takes: Kinds,
    pub(crate) makes: Kinds,
    /// The version of its algorithm, of a stage that computes.
    pub(crate) version: Option<u32>,
    /// Whether a scan is done only when it says so.
    pub(crate) finishes: bool,
    /// Whether a scan waits for it also where it is the last to see it and does not say so.
    pub(crate) is_of_others: bool,
    /// All keys of its settings.
    pub(crate) keys: &'static [Key],
    /// Which of them cannot be changed while it runs; `None` when none can.
    pub(crate) fixed: Option<&'static [&'static str]>,
    /// Its settings in a profile.
    pub(crate) settings: Box<dyn Fn(Profile) -> Value + Send + Sync>,
    /// Checks settings: types and ranges.
    pub(crate) check: fn(&Value) -> Result<(), String>,
    /// Is the node, until it shall stop.
    pub(crate) run: Be,
    /// The kinds of message of others that it makes.
    messages: Vec<Kind>,
}

impl std::fmt::Debug for NodeType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NodeType")
            .field("name", &self.name)
            .field("about", &self.about)
            .finish_non_exhaustive()
    }
}

impl NodeType {
    /// A type of node that is called so in graph files, and what it does in a few words. `run` is the node: it subscribes,
    /// publishes and loops until the bus has nothing more for it.
    ///
    /// It takes what the [messages it makes](Self::message) are made of.
    pub fn new<S: Settings + 'static, E: Into<Box<dyn Error>> + 'static>(
        name: &'static str,
        about: &'static str,
        run: fn(&mut Bus, S, &Start) -> Result<(), E>,
    ) -> Self {
        let stage = move || Stage::named(name);
        Self {
            name,
            about,
            takes: Box::new(move |_| stage().map(Stage::takes).unwrap_or_default()),
            makes: Box::new(move |_| {
                let made = stage().map(|stage| stage.makes().collect());
                made.unwrap_or_default()
            }),
            version: None,
            finishes: false,
            is_of_others: false,
            keys: S::KEYS,
            fixed: None,
            settings: Box::new(move |profile| profile.changed(name, json(&S::default()))),
            check: |value| parse::<S>(value).map(drop),
            run: Box::new(move |bus, value, start| {
                run(bus, parse::<S>(value)?, start).map_err(Into::into)
            }),
            messages: Vec::new(),
        }
    }

    /// It makes messages of this kind, whose definition names it as their maker.
    pub fn message<M: Message>(mut self) -> Self {
        self.messages.push(M::KIND);
        self
    }

    /// It takes these kinds of message, where it makes none that say what they are made of.
    pub fn taking(self, kinds: &'static [Kind]) -> Self {
        self.takes_by(|_| kinds.to_vec())
    }

    /// The version of its algorithm: raised whenever its results become others, so that recordings say which they hold.
    pub fn version(mut self, version: u32) -> Self {
        self.version = Some(version);
        self
    }

    /// A scan is done only when it says so, with a [finisher](Bus::finisher). Without this a scan waits for a node whose messages
    /// no other takes until it asks the bus for more.
    pub fn finishing(mut self) -> Self {
        self.finishes = true;
        self
    }

    /// Its settings may be changed while it runs, but for these keys: it reads them by way of [`Bus::tuned`].
    pub fn tunable_but(mut self, fixed: &'static [&'static str]) -> Self {
        self.fixed = Some(fixed);
        self
    }

    fn takes_by(mut self, takes: impl Fn(&Value) -> Vec<Kind> + Send + Sync + 'static) -> Self {
        self.takes = Box::new(takes);
        self
    }

    fn makes_by(mut self, makes: fn(&Value) -> Vec<Kind>) -> Self {
        self.makes = Box::new(makes);
        self
    }

    /// Its constants in the thesis.
    fn thesis<S: Settings + 'static>(mut self, thesis: fn() -> S) -> Self {
        let otherwise = self.settings;
        self.settings = Box::new(move |profile| match profile {
            Profile::Thesis => json(&thesis()),
            _ => otherwise(profile),
        });
        self
    }

    /// Whether this one of its settings can be changed while it runs.
    pub(crate) fn is_tunable(&self, key: &str) -> bool {
        self.fixed.is_some_and(|fixed| !fixed.contains(&key))
    }
}

/// Our own types of node, in the order of the pipe.
fn own() -> Vec<NodeType> {
    vec![
        NodeType::new("capture", "where scans come from", capture::node::run).makes_by(captured),
        NodeType::new(
            "replay",
            "a recording in place of the stages before the cut",
            replay::node::run,
        )
        .makes_by(replayed),
        NodeType::new(
            "filter",
            "Laplacian of Gaussian, zero-crossings, gradients",
            filter::node::run,
        )
        .version(filter::VERSION)
        .thesis(filter::Settings::thesis)
        .tunable_but(&["channels"]),
        NodeType::new("track", "zero-crossings become curves", track::node::run)
            .version(track::VERSION)
            .thesis(track::Settings::thesis)
            .tunable_but(&[]),
        NodeType::new("hough", "curves become R-tables", hough::node::run)
            .version(hough::VERSION)
            .thesis(hough::Settings::thesis)
            .tunable_but(&[]),
        NodeType::new(
            "match",
            "R-tables become matches, disparities and points",
            matching::node::run,
        )
        .version(matching::VERSION)
        .thesis(matching::Settings::thesis)
        .tunable_but(&["reference"])
        .finishing(),
        NodeType::new(
            "map",
            "points of many frames along a rail become one map",
            map::node::run,
        )
        .version(map::VERSION)
        .tunable_but(&["window", "apart"])
        .finishing(),
        NodeType::new(
            "evaluate",
            "points against the truth, where the source knows it",
            evaluate::node::run,
        )
        .version(evaluate::VERSION)
        .tunable_but(&["view"])
        .finishing(),
        NodeType::new("record", "every topic into MCAP", record::node::run)
            .takes_by(recorded)
            .finishing(),
        NodeType::new(
            "bridge",
            "the graph for Foxglove and other viewers",
            bridge::node::run,
        ),
        NodeType::new(
            "verify",
            "compares what is computed with what was recorded",
            replay::verify::node::run,
        )
        .takes_by(verified)
        .finishing(),
        NodeType::new(
            "rehydrate",
            "makes the full recording that a proof stands for",
            record::rehydrate::node::run,
        )
        .takes_by(rehydrated)
        .finishing(),
    ]
}

/// The first of the nodes that take whatever is made: those of others come before it.
const FIRST_TAKER: &str = "record";

static NODES: OnceLock<Vec<NodeType>> = OnceLock::new();

/// All types of node, in the order of the pipe.
pub(crate) fn nodes() -> &'static [NodeType] {
    NODES.get_or_init(own)
}

/// A program that is tricurve with nodes of one's own: it has all its commands, and its nodes run in every graph that names
/// them.
///
/// ```no_run
/// use std::process::ExitCode;
/// use tricurve::messages::bus::{Bus, BusError, Start};
/// use tricurve::{App, NodeType, messages::Kind};
///
/// tricurve::settings! {
///     /// When to sound the alarm.
///     pub struct Settings {
///         /// Points of a scan below which something must be wrong.
///         pub least: u64 = 100, in 0..=1e9;
///     }
/// }
///
/// /// Warns of scans that have few points.
/// fn run(bus: &mut Bus, settings: Settings, _start: &Start) -> Result<(), BusError> {
///     let mut scans = bus.inputs(&[Kind::Points])?;
///     bus.ready()?;
///     while let Some(points) = bus.next(&mut scans)? {
///         let count = points.view::<tricurve::messages::Points>()?.points.len() as u64;
///         if count < settings.least {
///             bus.log(tricurve::messages::bus::Level::Warn, format!("only {count} points"));
///         }
///     }
///     bus.finish(&[]);
///     Ok(())
/// }
///
/// fn main() -> ExitCode {
///     let alarm = NodeType::new("alarm", "warns of scans with few points", run);
///     App::new().node(alarm.taking(&[Kind::Points])).main()
/// }
/// ```
#[derive(Debug, Default)]
pub struct App {
    nodes: Vec<NodeType>,
}

impl App {
    /// The program with our own nodes alone.
    pub fn new() -> Self {
        Self::default()
    }

    /// With this type of node as well.
    #[must_use]
    pub fn node(mut self, node: NodeType) -> Self {
        self.nodes.push(node);
        self
    }

    /// Is the program: reads its command line and does what it says. To be called first of all, and once.
    pub fn main(self) -> ExitCode {
        match self.register() {
            Ok(()) => program::main(),
            Err(why) => program::refused(&why),
        }
    }

    /// Makes its nodes and their messages known to this process.
    fn register(self) -> Result<(), String> {
        let mut all = own();
        let mut others = Vec::new();
        let mut kinds = Vec::new();
        for node in self.nodes {
            let name = node.name;
            let known = all.iter().chain(&others).map(|known: &NodeType| known.name);
            let is_taken = known.chain([GRAPH]).any(|known| known == name);
            let is_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
            if is_taken || name.is_empty() || !name.chars().all(is_word) {
                return Err(format!(
                    "the node {name:?} cannot be added: a node's name is a word of small letters, digits and _ that no \
                     other node has"
                ));
            }
            let is_of_others = |kind: &&Kind| kind.definition().stage != name;
            if let Some(kind) = node.messages.iter().find(is_of_others) {
                let (kind, maker) = (kind.name(), kind.definition().stage);
                return Err(format!(
                    "the node {name} cannot make {kind}: its definition says that {maker} makes it"
                ));
            }
            kinds.extend(&node.messages);
            others.push(NodeType {
                is_of_others: true,
                ..node
            });
        }
        let first_taker = all.iter().position(|node| node.name == FIRST_TAKER);
        let place = first_taker.unwrap_or(all.len());
        all.splice(place..place, others);
        messages::register(&kinds).map_err(|e| e.to_string())?;
        NODES
            .set(all)
            .map_err(|_| "an App is run once, before anything else is done".to_owned())
    }
}

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
    let played = replay::replayed_kinds(settings.from);
    let is_compared = |kind: &Kind| !played.contains(kind) && !settings.without.contains(kind);
    Kind::all().filter(is_compared).collect()
}

fn rehydrated(settings: &Value) -> Vec<Kind> {
    let settings = parse::<record::rehydrate::Settings>(settings).unwrap_or_default();
    let is_wanted = |kind: &Kind| !settings.without.contains(kind);
    Kind::all().filter(is_wanted).collect()
}

/// The versions of all stages that compute, by their names.
pub(crate) fn versions() -> impl Iterator<Item = (&'static str, u32)> {
    nodes()
        .iter()
        .filter_map(|node| Some((node.name, node.version?)))
}

fn replayed(settings: &Value) -> Vec<Kind> {
    parse::<replay::Settings>(settings)
        .unwrap_or_default()
        .kinds()
}

/// The type of node of this name.
pub(crate) fn find(name: &str) -> Option<&'static NodeType> {
    nodes().iter().find(|node| node.name == name)
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
        for node in nodes() {
            for profile in Profile::value_variants() {
                (node.check)(&(node.settings)(*profile)).unwrap();
            }
        }
    }

    #[test]
    fn every_key_says_what_it_means() {
        for node in nodes() {
            for key in node.keys {
                assert!(!key.about.trim().is_empty(), "{}.{}", node.name, key.name);
            }
        }
    }

    #[test]
    fn every_stage_is_a_node_and_takes_what_its_messages_are_made_of() {
        for stage in Stage::computing() {
            let node = find(stage.name()).unwrap();
            let settings = (node.settings)(Profile::Default);
            assert_eq!((node.takes)(&settings), stage.takes());
            assert_eq!((node.makes)(&settings), stage.makes().collect::<Vec<_>>());
            assert!(node.version.is_some(), "{}", node.name);
        }
    }

    #[test]
    fn a_node_whose_name_is_taken_or_none_is_refused() {
        for name in ["track", "graph", "", "Histogram", "a.b"] {
            let run = |_: &mut Bus, _: filter::Settings, _: &Start| Ok::<(), String>(());
            let error = App::new().node(NodeType::new(name, "", run)).register();
            assert!(error.unwrap_err().contains("cannot be added"), "{name}");
        }
    }
}
