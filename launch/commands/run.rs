//! `tricurve run`: runs a graph and says what came of it.

mod progress;
mod table;

use std::path::{Path, PathBuf};
use std::time::Duration;

use capture::Source;
use jiff::Timestamp;
use messages::bus::Run;
use messages::{Rig, Size};
use serde_json::Value;

use crate::cli::Run as Args;
use crate::graph::{Graph, Overrides};
use crate::node::Orders;
use crate::rundir::{self, RunDir, SHARED_MEMORY};
use crate::supervisor::{Duty, Supervisor};
use crate::{Failure, Outcome};

/// How much of the worst case, every pixel a zero-crossing of a long curve, a scan can need: white noise, which no
/// picture exceeds, has a zero-crossing at less than a third of its pixels in the finest channel allowed.
const DENSEST: f64 = 1.0 / 3.0;

/// The most scans whose names are recorded.
const NAMES: u64 = 10_000;

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let mut graph = Graph::load(args.graph.as_deref(), args.profile, &overrides(args)?)?;
    if graph
        .settings_of("capture")
        .get("start")
        .is_none_or(Value::is_null)
    {
        graph.fill_in("capture", "start", now_nanos());
    }
    let source = open_source(&graph)?;
    let rig = rig(&graph, &source)?;
    let recording = recording(&mut graph)?;
    say_notices(&source);
    // What dead runs left would only be in the way.
    rundir::clean()
        .map_err(|e| Failure::failed(format!("cannot clean up after dead runs: {e}")))?;
    let dir = RunDir::create()
        .map_err(|e| Failure::failed(format!("cannot make the run's folder: {e}")))?;
    let orders = orders(&graph, &dir, rig, &source);
    check_shared_memory(&orders.run)?;
    orders.write(dir.path()).map_err(Failure::failed)?;

    let mut progress = progress::Progress::new(args.json);
    let duty = Duty {
        nodes: orders
            .run
            .nodes
            .iter()
            .map(|node| node.name.clone())
            .collect(),
        folder: dir.path(),
        restarts: graph.settings.restarts,
        patience: Duration::from_secs_f64(graph.settings.patience),
    };
    let ran = Supervisor::run(duty, &mut progress)?;
    progress.end();
    let summary = table::Summary::new(&ran, recording.as_deref());
    match args.json {
        true => super::print_json(&summary)?,
        false => super::print(&summary.to_string())?,
    }
    Ok(ran.outcome)
}

fn overrides(args: &Args) -> Result<Overrides, Failure> {
    let mut overrides = Overrides::parse(&args.set)?;
    if let Some(source) = &args.source {
        overrides.set("capture", "source", source.as_str());
    }
    if let Some(views) = &args.views {
        overrides.set("capture", "views", views.clone());
    }
    if let Some(scans) = args.scans {
        overrides.set("capture", "scans", scans);
    }
    if let Some(delivery) = args.delivery {
        let delivery = messages::Delivery::from(delivery);
        overrides.set(
            "graph",
            "delivery",
            serde_json::to_value(delivery).map_err(Failure::failed)?,
        );
    }
    if let Some(file) = &args.record {
        overrides.set("record", "file", file.to_string_lossy().as_ref());
    }
    if args.force {
        overrides.set("record", "overwrite", true);
    }
    if args.no_record {
        overrides.without("record");
    }
    Ok(overrides)
}

fn now_nanos() -> u64 {
    u64::try_from(Timestamp::now().as_nanosecond()).unwrap_or_default()
}

/// Opens the source before any node starts: what is wrong with it is said at once.
fn open_source(graph: &Graph) -> Result<Source, Failure> {
    let settings =
        serde_json::from_value(graph.settings_of("capture").clone()).map_err(Failure::usage)?;
    Source::open(&settings).map_err(Failure::failed)
}

fn say_notices(source: &Source) {
    for notice in source.notices() {
        eprintln!("capture: {notice}");
    }
    for warning in source.warnings() {
        eprintln!("capture: warning: {warning}");
    }
}

fn rig(graph: &Graph, source: &Source) -> Result<Rig, Failure> {
    let channels = graph
        .settings_of("filter")
        .get("channels")
        .cloned()
        .unwrap_or_default();
    let channels: Vec<f32> = serde_json::from_value(channels).map_err(Failure::usage)?;
    if channels.is_empty() || !channels.is_sorted_by(|a, b| a > b) {
        let text = format!(
            "filter.channels must go from coarse to fine, each smaller than the last, not {channels:?}"
        );
        return Err(Failure::usage(text));
    }
    let count = source.view_count();
    if count != 3 {
        let text =
            format!("match takes exactly three views, not {count}: choose three with --views");
        return Err(Failure::usage(text));
    }
    let size: Size = source.size();
    Ok(Rig {
        calibration: source.calibration(),
        ..Rig::of_views(count, &channels, size)
    })
}

/// Settles where the recording goes.
fn recording(graph: &mut Graph) -> Result<Option<PathBuf>, Failure> {
    if !graph.has("record") {
        return Ok(None);
    }
    let settings = graph.settings_of("record");
    let file = settings
        .get("file")
        .and_then(Value::as_str)
        .unwrap_or_default();
    let path = match file {
        "" => {
            std::fs::create_dir_all("recordings")
                .map_err(|e| Failure::failed(format!("cannot make the folder recordings: {e}")))?;
            Path::new("recordings").join(format!(
                "tricurve-{}.mcap",
                Timestamp::now().strftime("%Y%m%d-%H%M%S")
            ))
        }
        file => PathBuf::from(file),
    };
    let path = std::path::absolute(&path).map_err(Failure::failed)?;
    graph.fill_in("record", "file", path.to_string_lossy().as_ref());
    Ok(Some(path))
}

fn orders(graph: &Graph, dir: &RunDir, rig: Rig, source: &Source) -> Orders {
    let in_flight = graph
        .settings_of("capture")
        .get("in_flight")
        .and_then(Value::as_u64);
    Orders {
        run: Run {
            root: dir.path().to_owned(),
            prefix: dir.prefix().to_owned(),
            rig,
            delivery: graph.settings.delivery,
            in_flight: in_flight.unwrap_or(1) as usize,
            nodes: graph.node_plans(),
        },
        configuration: graph.configuration(),
        graph: graph.to_mermaid(),
        scans: (0..source.scans().min(NAMES))
            .map(|scan| source.name(scan).to_owned())
            .collect(),
    }
}

/// Says before the start when shared memory could run full: the kernel would kill a node in the middle of its work.
fn check_shared_memory(run: &Run) -> Result<(), Failure> {
    let free = rundir::free_bytes()
        .map_err(|e| Failure::failed(format!("cannot look at {SHARED_MEMORY}: {e}")))?;
    let need = (run.worst_case_bytes() as f64 * DENSEST) as u64;
    if free >= need {
        return Ok(());
    }
    let each = need / run.in_flight as u64;
    let advice = match free / each.max(1) {
        0 => "make it larger (in a container: --shm-size)".to_owned(),
        fits => format!(
            "make it larger (in a container: --shm-size), or --set capture.in_flight={fits}"
        ),
    };
    Err(Failure::failed(format!(
        "{} scans of {} under way can need {:.0} MB of shared memory, {SHARED_MEMORY} has {:.0} MB free: {advice}",
        run.in_flight,
        run.rig.size,
        need as f64 / 1e6,
        free as f64 / 1e6,
    )))
}
