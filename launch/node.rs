//! The other side of the launcher: this process is one node of a run.

use std::error::Error;
use std::path::Path;

use messages::Sway;
use messages::bus::{
    self, Bus, Level, NodePlan, Progress, Run, Start, complain, node_of, read_changes,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::rundir::{RunDir, Share};
use crate::{Outcome, cli, registry};

/// What the launcher leaves in the run's folder for its nodes.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Orders {
    pub(crate) run: Run,
    pub(crate) configuration: Value,
    /// The graph as a Mermaid diagram.
    pub(crate) graph: String,
    /// The names of the source's scans.
    pub(crate) scans: Vec<String>,
    /// Where a rail's frames were taken, where the source had to look at all of them to know.
    pub(crate) places: Vec<f64>,
    /// By how much each of a rail's frames is off, where it was looked at.
    pub(crate) sway: Vec<Sway>,
}

impl Orders {
    const FILE: &str = "orders.json";

    pub(crate) fn write(&self, dir: &RunDir) -> std::io::Result<()> {
        dir.write(Self::FILE, &serde_json::to_vec(self)?)
    }

    pub(crate) fn read(folder: &Path) -> Result<Self, Box<dyn Error>> {
        Ok(serde_json::from_slice(&std::fs::read(
            folder.join(Self::FILE),
        )?)?)
    }
}

/// Lets this process run when the graph's own do not need the processor.
pub(crate) fn give_way() {
    const NICENESS: i32 = 10;
    // Where that is not allowed it goes on as it is.
    rustix::process::nice(NICENESS)
        .map(drop)
        .unwrap_or_default();
}

/// Is the node until it shall stop.
pub(crate) fn run(args: &cli::Node) -> Outcome {
    match try_run(args) {
        Ok(()) => Outcome::Done,
        // The launcher tries again, and says so.
        Err(error) if bus::has_failed() => {
            complain(Level::Warn, &args.name, error.to_string());
            Outcome::OffBus
        }
        Err(error) => {
            complain(Level::Error, &args.name, error.to_string());
            Outcome::Failed
        }
    }
}

fn try_run(args: &cli::Node) -> Result<(), Box<dyn Error>> {
    // Dropped last: the bus leaves the folder before this process does.
    let _share = Share::enter(&args.run)?;
    let orders = Orders::read(&args.run)?;
    let node = registry::find(node_of(&args.name))
        .ok_or_else(|| format!("there is no node {}", args.name))?;
    let settings = orders
        .configuration
        .get(node.name)
        .cloned()
        .unwrap_or_default();
    // Who only looks on gives way to the pipe.
    let is_guest = |plan: &NodePlan| plan.takes.is_empty() && plan.makes.is_empty();
    let plan = orders.run.nodes.iter().find(|plan| plan.name == args.name);
    if plan.is_some_and(is_guest) {
        give_way();
    }
    let resume: Progress = match &args.resume {
        Some(json) => serde_json::from_str(json)?,
        None => Progress::default(),
    };
    let Orders {
        run,
        configuration,
        graph,
        scans,
        places,
        sway,
    } = orders;
    let start = Start {
        life: args.life,
        resume,
        configuration,
        graph,
        scans,
        places,
        sway,
        changes: read_changes(&args.run),
    };
    let mut bus = Bus::join(run, &args.name, &start)?;
    (node.run)(&mut bus, &settings, &start)
}
