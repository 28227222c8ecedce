//! How a running graph is doing, to plot: how fast, what was lost, how each node is.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// How a graph is doing at a moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Health {
    /// Scans that went through the door.
    pub admitted: u64,
    /// Scans that are done.
    pub done: u64,
    /// Scans under way.
    pub under_way: u64,
    /// Scans that were turned away at the door.
    pub dropped: u64,
    /// Scans done a second, since the last time it was said.
    pub triples_per_second: f64,
    /// Each node.
    pub nodes: BTreeMap<String, NodeHealth>,
}

/// How a node is doing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NodeHealth {
    /// `running`, `finished` or `failed`.
    pub state: String,
    /// How often it was restarted.
    pub restarts: u32,
    /// Half of its scans took at most this, in milliseconds.
    pub p50: f64,
    /// All but one in a hundred took at most this.
    pub p99: f64,
}
