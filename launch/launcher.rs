//! Launches a graph: the run's folder, the orders for its nodes, the supervisor, and the way it goes on.

use std::time::Duration;

use messages::bus::{self, NodePlan, Run};
use messages::change::Change;
use messages::{Rig, Sway};
use serde_json::Value;

use crate::Failure;
use crate::graph::Graph;
use crate::node::Orders;
use crate::parameters::Parameters;
use crate::progress::{Progress, Timeline};
use crate::rundir::{self, RunDir, SHARED_MEMORY};
use crate::supervisor::{Duty, Ran, Supervisor, Watcher};

/// How much of the worst case, every pixel a zero-crossing of a long curve, a scan can need: white noise, which no
/// picture exceeds, has a zero-crossing at less than a third of its pixels in the finest channel allowed.
const DENSEST: f64 = 1.0 / 3.0;

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
        remarks,
        changes,
        no_seek,
        ..
    } = launch;
    let in_flight = graph.source_settings().get("in_flight");
    let run = Run {
        root: dir.path().to_owned(),
        prefix: dir.prefix().to_owned(),
        rig,
        delivery: graph.settings.delivery,
        cameras: graph.has_cameras(),
        in_flight: in_flight.and_then(Value::as_u64).unwrap_or(1) as usize,
        nodes: graph.node_plans(),
    };
    check_shared_memory(&run)?;
    let mut configuration = graph.configuration();
    if let Value::Object(configuration) = &mut configuration {
        for (key, value) in remarks {
            configuration.insert(key.to_owned(), value);
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
    orders.write(dir.path()).map_err(Failure::failed)?;
    bus::write_changes(dir.path(), &changes)
        .map_err(|e| Failure::failed(format!("cannot write into the run's folder: {e}")))?;
    let parameters = Parameters::new(&orders.configuration, &changes);
    let duty = Duty {
        nodes,
        folder: dir.path(),
        restarts: graph.settings.restarts,
        patience: Duration::from_secs_f64(graph.settings.patience),
        parameters,
        changes,
        guests,
        no_seek,
    };
    let ran = Supervisor::run(duty, watcher)?;
    Ok((ran, dir))
}

/// Says before the start when shared memory could run full: the kernel would kill a node in the middle of its work.
fn check_shared_memory(run: &Run) -> Result<(), Failure> {
    let free = rundir::free_bytes()
        .map_err(|e| Failure::failed(format!("cannot look at {SHARED_MEMORY}: {e}")))?;
    let need = (run.worst_case_bytes() as f64 * DENSEST) as u64;
    if free >= need {
        return Ok(());
    }
    let reach = run.rig.reach();
    let each = need / (run.in_flight as u64 + reach);
    let advice = match (free / each.max(1)).saturating_sub(reach) {
        0 if reach > 0 => "make it larger (in a container: --shm-size), or --set map.apart=0, a shorter map.window, or leave [map] away in a graph file".to_owned(),
        0 => "make it larger (in a container: --shm-size)".to_owned(),
        fits => format!(
            "make it larger (in a container: --shm-size), or --set capture.in_flight={fits}"
        ),
    };
    let depended_on = match reach {
        0 => String::new(),
        _ => format!(" and {reach} before them that they depend on"),
    };
    Err(Failure::failed(format!(
        "{} scans of {} under way{depended_on} can need {:.0} MB of shared memory, {SHARED_MEMORY} has {:.0} MB free: {advice}",
        run.in_flight,
        run.rig.size,
        need as f64 / 1e6,
        free as f64 / 1e6,
    )))
}
