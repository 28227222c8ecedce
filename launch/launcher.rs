//! Launches a graph: the run's folder, the orders for its nodes, the supervisor, and the way it goes on.

use std::time::Duration;

use messages::bus::{self, Level, Log, NodePlan, Run};
use messages::change::Change;
use messages::record::VERSIONS;
use messages::{Rig, Sway};
use serde_json::Value;

use crate::Failure;
use crate::graph::Graph;
use crate::node::Orders;
use crate::open_files;
use crate::parameters::Parameters;
use crate::progress::{Progress, Timeline};
use crate::registry::versions;
use crate::rundir::{self, RunDir};
use crate::shared_memory::{self, InFlight};
use crate::supervisor::{Duty, Ran, Supervisor, Watcher};

/// What is launched.
pub(crate) struct Launch<'a> {
    pub(crate) graph: &'a Graph,
    pub(crate) rig: Rig,
    /// The names of the source's scans.
    pub(crate) scans: Vec<String>,
    /// Where a rail's frames were taken, where the source had to look at all of them to know.
    pub(crate) places: Vec<f64>,
    /// By how much each of a rail's frames is off, where it was looked at.
    pub(crate) sway: Vec<Sway>,
    /// What was said before the start: the recording has it too.
    pub(crate) said: Vec<Log>,
    /// What the recording says besides the graph's configuration, by key.
    pub(crate) remarks: Vec<(&'static str, Value)>,
    /// Says nothing while it runs.
    pub(crate) is_quiet: bool,
    /// The time of the source's scans, where keys may control how they are played.
    pub(crate) timeline: Option<Timeline>,
    /// Settings that hold otherwise from a scan on.
    pub(crate) changes: Vec<Change>,
    /// Why the source cannot be sought in, if it cannot.
    pub(crate) no_seek: Option<&'static str>,
}

/// Runs a graph to its end; what its nodes left in the run's folder is there as long as that is held.
pub(crate) fn launch(mut launch: Launch<'_>) -> Result<(Ran, RunDir), Failure> {
    let mut progress = Progress::new(launch.is_quiet, launch.timeline.take());
    let ran = launch_before(launch, &mut progress);
    progress.end();
    ran
}

/// Runs a graph to its end, before a watcher of its own.
pub(crate) fn launch_before(
    launch: Launch<'_>,
    watcher: &mut impl Watcher,
) -> Result<(Ran, RunDir), Failure> {
    // What dead runs left would only be in the way.
    rundir::clean()
        .map_err(|e| Failure::failed(format!("cannot clean up after dead runs: {e}")))?;
    let dir = RunDir::create()
        .map_err(|e| Failure::failed(format!("cannot make the run's folder: {e}")))?;
    let Launch {
        graph,
        rig,
        scans,
        places,
        sway,
        mut said,
        remarks,
        changes,
        no_seek,
        is_quiet,
        ..
    } = launch;
    // What is set otherwise from the start on is not said while it runs.
    said.extend(changes.iter().map(|change| Log {
        level: Level::Info,
        node: change.node.clone(),
        text: change.to_string(),
    }));
    graph.check_instances(&rig)?;
    let in_flight = InFlight::of(graph.source_settings());
    let mut run = Run {
        root: dir.path().to_owned(),
        prefix: dir.bus_prefix(),
        rig,
        delivery: graph.settings.delivery,
        cameras: graph.has_cameras(),
        in_flight: in_flight.most(),
        nodes: graph.node_plans(),
    };
    if let Some(why) = shared_memory::fit(&mut run, graph, in_flight)? {
        if !is_quiet {
            crate::say!("{}: {why}", graph.source_name());
        }
        said.push(Log {
            level: Level::Info,
            node: graph.source_name().to_owned(),
            text: why,
        });
    }
    open_files::allow(&run)?;
    let mut configuration = graph.configuration();
    if let Value::Object(configuration) = &mut configuration {
        let versions = versions().filter(|(stage, _)| graph.has(stage));
        let versions = versions.map(|(stage, version)| (stage.to_owned(), version.into()));
        configuration.insert(VERSIONS.to_owned(), Value::Object(versions.collect()));
        for (key, value) in remarks {
            match (configuration.get_mut(key), value) {
                (Some(Value::Object(known)), Value::Object(more)) => {
                    for (key, value) in more {
                        known.entry(key).or_insert(value);
                    }
                }
                (_, value) => drop(configuration.insert(key.to_owned(), value)),
            }
        }
    }
    let nodes = run.nodes.iter().map(|node| node.name.clone()).collect();
    let is_guest = |node: &&NodePlan| node.takes.is_empty() && node.makes.is_empty();
    let guests = run.nodes.iter().filter(is_guest);
    let guests = guests.map(|node| node.name.clone()).collect();
    let orders = Orders {
        run,
        configuration,
        graph: graph.to_mermaid(),
        scans,
        places,
        sway,
    };
    orders
        .write(&dir)
        .and_then(|()| bus::write_changes(dir.path(), &changes))
        .map_err(|e| Failure::failed(format!("cannot write into the run's folder: {e}")))?;
    // Only of what runs: the configuration says of played stages too with which settings they computed.
    let parameters = Parameters::new(&graph.configuration(), &changes);
    let duty = Duty {
        nodes,
        dir,
        orders,
        said,
        restarts: graph.settings.restarts,
        patience: Duration::from_secs_f64(graph.settings.patience),
        parameters,
        changes,
        guests,
        no_seek,
    };
    Supervisor::run(duty, watcher)
}
