//! One run of a graph: what every process of it must know to meet the others.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::control::Progress;
use crate::change::Change;
use crate::header::Sway;
use crate::ledger::Shard;
use crate::payload::Kind;
use crate::rig::{Delivery, Rig};
use crate::topic::Topic;

/// One node of a run, as the others need to know it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodePlan {
    /// Its name, unique in the run: of further instances of a node with their number, as in `match.2`.
    pub name: String,
    /// Which scans are its own.
    #[serde(default)]
    pub shard: Shard,
    /// The kinds of message it takes in.
    pub takes: Vec<Kind>,
    /// The kinds of message it makes.
    pub makes: Vec<Kind>,
    /// Whether a scan is done only when this node says so.
    pub finishes: bool,
}

/// The node that this name is an instance of.
pub fn node_of(name: &str) -> &str {
    name.split_once('.').map_or(name, |(node, _)| node)
}

/// One run of a graph: what every process of it must know to meet the others and nobody else.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Folder of the run, private to the user; the bus keeps its files there.
    pub root: PathBuf,
    /// What the names of the run's shared memory begin with.
    pub prefix: String,
    /// Views, channels, sizes.
    pub rig: Rig,
    /// What happens to a scan that finds the door closed.
    pub delivery: Delivery,
    /// Whether scans come from cameras, of whose frames there is an account.
    #[serde(default)]
    pub cameras: bool,
    /// How many scans may be under way.
    pub in_flight: usize,
    /// All nodes, in the order of the pipe.
    pub nodes: Vec<NodePlan>,
}

impl Run {
    /// Messages a subscriber's buffer holds: more than two windows, since a resend can double what is under way.
    pub fn buffer(&self) -> usize {
        2 * (self.in_flight + self.rig.reach() as usize) + 4
    }

    /// The kinds of message that this node takes of those that are made, in the order of the pipe.
    pub fn taken_by(&self, name: &str) -> Vec<Kind> {
        let node = self.nodes.iter().find(|node| node.name == name);
        let mut kinds = self.kinds();
        kinds.retain(|kind| node.is_some_and(|node| node.takes.contains(kind)));
        kinds
    }

    /// The kinds of message that some node takes, in the order of the pipe.
    pub fn taken(&self) -> Vec<Kind> {
        let is_taken = |kind: &Kind| self.takers(*kind).next().is_some();
        Kind::all().filter(is_taken).collect()
    }

    /// The kinds of message that are made, in the order of the pipe.
    pub fn kinds(&self) -> Vec<Kind> {
        let is_made = |kind: &Kind| self.nodes.iter().any(|n| n.makes.contains(kind));
        Kind::all().filter(is_made).collect()
    }

    /// Whether some node has several instances, whose results overtake each other.
    pub fn is_sharded(&self) -> bool {
        self.nodes.iter().any(|node| !node.shard.is_all())
    }

    /// The shards in which messages of this kind are made: one an instance, each with a service of its own.
    pub(super) fn shards_of(&self, kind: Kind) -> impl Iterator<Item = Shard> + '_ {
        let makers = self.nodes.iter().filter(move |n| n.makes.contains(&kind));
        makers.map(|node| node.shard)
    }

    /// The nodes that take this kind of message.
    pub(super) fn takers(&self, kind: Kind) -> impl Iterator<Item = &NodePlan> {
        self.nodes.iter().filter(move |n| n.takes.contains(&kind))
    }

    /// Bytes of shared memory that all scans under way need in the worst case, every pixel a zero-crossing.
    pub fn worst_case_bytes(&self) -> u64 {
        let size = self.rig.size;
        let words = |kind: Kind| kind.definition().words(size) as u64 * 8;
        let topics = self.kinds().into_iter();
        let topics = topics.flat_map(|kind| Topic::of(&self.rig, kind));
        let scan: u64 = topics.map(|topic| words(topic.kind)).sum();
        scan * (self.in_flight as u64 + self.rig.reach())
    }
}

/// What a node is told when its process starts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Start {
    /// How many times it was started before in this run.
    pub life: u32,
    /// How far the scans had come when it was started.
    pub resume: Progress,
    /// The run's whole effective configuration: the graph's keys and every node's.
    pub configuration: serde_json::Value,
    /// The graph as a Mermaid diagram.
    pub graph: String,
    /// The names of the source's scans, where they have some.
    pub scans: Vec<String>,
    /// Where a rail's frames were taken, in the source's own steps, where it had to look at all of them to know.
    pub places: Vec<f64>,
    /// By how much each of a rail's frames is off, where it was looked at.
    pub sway: Vec<Sway>,
    /// Settings that hold otherwise from a scan on.
    pub changes: Vec<Change>,
}
