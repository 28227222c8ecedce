//! `tricurve run`: runs a graph and says what came of it.

pub(super) mod table;

use std::path::{Path, PathBuf};

use capture::node::UNREADABLE;
use capture::{Source, Views};
use jiff::Timestamp;
use messages::bus::Level;
use messages::ledger::Ledger;
use messages::words::counted;
use messages::{Delivery, Rail, Rig, Size, Sway};
use record::MEASURED;
use serde_json::{Value, json};

use crate::cli::Run as Args;
use crate::graph::{Graph, Overrides};
use crate::launcher::{Launch, launch};
use crate::look::Looked;
use crate::profile::Profile;
use crate::said::Early;
use crate::{Failure, Outcome};

/// The most scans whose names are recorded.
const NAMES: u64 = 10_000;

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let Planned {
        graph,
        mut source,
        rig,
        scans,
        places,
        sway,
        recording,
        mut said,
    } = plan(args.graph.as_deref(), args.profile, &overrides(args)?)?;
    if let Some(table) = super::input::table(&source) {
        said.say(Level::Info, "capture", table);
    }
    say_notices(&source, &mut said);
    look(&graph, &mut source, args.force_unrectified, &mut said)?;
    let (mut ran, _) = launch(Launch {
        graph: &graph,
        rig,
        scans,
        places,
        sway,
        said: said.lines(),
        remarks: super::input::recorded(&source)
            .map(|input| ("input", input))
            .into_iter()
            .chain([(MEASURED, json!(graph.measured()))])
            .collect(),
        is_quiet: args.json,
        timeline: None,
        changes: Vec::new(),
        no_seek: None,
    })?;
    ran.outcome = with_losses(ran.outcome, &source, &ran.ledger);
    let summary = table::Summary::new(&ran, recording.as_deref());
    match args.json {
        true => super::print_json(&summary)?,
        false => super::print(&summary.to_string())?,
    }
    Ok(ran.outcome)
}

/// What a run came to whose source could not be read whole: that is not known to those who did what there was.
fn with_losses(outcome: Outcome, source: &Source, ledger: &Ledger) -> Outcome {
    if outcome != Outcome::Done {
        return outcome;
    }
    if let Some(damage) = source.damage() {
        crate::say!("capture: data was lost: {damage}");
        return Outcome::Lost;
    }
    match ledger.refused.get(UNREADABLE) {
        Some(count) => {
            crate::say!(
                "capture: data was lost: {} could not be read",
                counted(*count, "scan")
            );
            Outcome::Lost
        }
        None => Outcome::Done,
    }
}

/// A graph that is ready to be launched, and what its launch needs besides.
pub(super) struct Planned {
    pub(super) graph: Graph,
    pub(super) source: Source,
    pub(super) rig: Rig,
    /// The names of the source's scans.
    pub(super) scans: Vec<String>,
    /// Where a rail's frames were taken, where the source had to look at all of them to know.
    pub(super) places: Vec<f64>,
    /// By how much each of a rail's frames is off, where it was looked at.
    pub(super) sway: Vec<Sway>,
    pub(super) recording: Option<PathBuf>,
    /// What was said of it.
    pub(super) said: Early,
}

/// Settles what only a run knows: its source, whether that knows the truth, the rig, where the recording goes.
pub(super) fn plan(
    file: Option<&Path>,
    profile: Profile,
    overrides: &Overrides,
) -> Result<Planned, Failure> {
    let mut graph = Graph::load(file, profile, overrides)?;
    if !graph.has("capture") {
        let text = "the graph has no [capture]: recordings are replayed with `tricurve replay`";
        return Err(Failure::usage(text));
    }
    let start = graph.settings_of("capture").get("start");
    let is_start_open = start.is_none_or(Value::is_null);
    if is_start_open {
        graph.fill_in("capture", "start", now_nanos());
    }
    let source = open_source(&graph)?;
    let mut said = Early::default();
    if let Some(start) = source.start().filter(|_| is_start_open) {
        graph.fill_in("capture", "start", start);
    }
    settle_topics(&mut graph, &source);
    settle_rail(&mut graph, &source, &mut said);
    // So that nobody has to find it out again, and that it is recorded.
    if let Some(bits) = source.bits() {
        graph.fill_in_measured("capture", "bits", bits);
    }
    settle_truth(&mut graph, &source)?;
    let rig = rig(&graph, &source)?;
    let recording = recording(&mut graph)?;
    // A live run drops scans, as does a bag that cannot be read whole, and then numbers no longer tell which of the source's
    // they are.
    let named = match graph.settings.delivery {
        Delivery::Lossless if !source.is_cameras() && source.account().is_none() => {
            source.scans().min(NAMES)
        }
        _ => 0,
    };
    let scans = (0..named).map(|scan| source.name(scan)).collect();
    let places = source.places().unwrap_or_default().to_vec();
    let sway = source.sways().unwrap_or_default().to_vec();
    Ok(Planned {
        graph,
        source,
        rig,
        scans,
        places,
        sway,
        recording,
        said,
    })
}

fn overrides(args: &Args) -> Result<Overrides, Failure> {
    let mut overrides = Overrides::parse(&args.set)?;
    // A flag that takes nothing: what follows it is taken for a graph file.
    let is_views = |file: &PathBuf| {
        file.to_str()
            .is_some_and(|text| text.parse::<Views>().is_ok())
    };
    if let Some(file) = args
        .graph
        .as_ref()
        .filter(|file| is_views(file) && !file.exists())
    {
        return Err(Failure::usage(format!(
            "there is no graph file {file}; which views are taken is said with --views {file}",
            file = file.display()
        )));
    }
    if let Some(file) = args.graph.as_ref().filter(|file| file.is_dir()) {
        return Err(Failure::usage(format!(
            "{file} is a folder, and a graph file is expected here; images are given with --source {file}",
            file = file.display()
        )));
    }
    if args.view {
        overrides.with("bridge");
    }
    if let Some(source) = &args.source {
        overrides.set("capture", "source", source.as_str());
    }
    if let Some(views) = &args.views {
        overrides.set("capture", "views", json!(views));
    }
    overrides.lay(args.layout);
    if args.rail {
        overrides.set("capture", "mode", "rail");
    }
    if !args.topics.is_empty() {
        overrides.set("capture", "topics", json!(args.topics));
    }
    if let Some(position) = &args.position {
        overrides.set("capture", "position_topic", position.as_str());
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
        let Some(file) = file.to_str() else {
            let text = format!(
                "--record expects a path that is UTF-8, not {}",
                file.display()
            );
            return Err(Failure::usage(text));
        };
        overrides.set("record", "file", file);
    }
    if args.force {
        overrides.set("record", "overwrite", true);
    }
    if let Some(megabytes) = args.max_size {
        overrides.set("record", "max_bytes", megabytes.saturating_mul(1_000_000));
    }
    if let Some(seconds) = args.max_duration {
        overrides.set("record", "max_seconds", seconds);
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
    Source::open(&settings).map_err(|error| match error.is_wrong_use() {
        true => Failure::usage(error),
        false => Failure::failed(error),
    })
}

/// Settles which topics of a bag are its views, so that it is recorded.
fn settle_topics(graph: &mut Graph, source: &Source) {
    if let Some(topics) = source.topics() {
        graph.fill_in_measured("capture", "topics", json!(topics));
        graph.fill_in_measured("capture", "views", json!("all"));
    }
}

/// Settles what was found out about the rail, so that nobody has to find it out again, and that it is recorded.
fn settle_rail(graph: &mut Graph, source: &Source, said: &mut Early) {
    let Some(rail) = source.rail() else {
        graph.remove("map");
        return;
    };
    graph.fill_in_measured("capture", "stride", rail.stride);
    graph.fill_in_measured("capture", "drift", rail.drift_px);
    if let Some(why) = too_few_for_a_map(graph, source) {
        said.say(Level::Warn, "map", why);
    }
    // What lies behind the plane that the pictures were aligned to moves with the camera.
    let least = graph.settings_of("match").get("disparity_least");
    let is_default = least.and_then(Value::as_f64) == Some(0.0);
    if let Some((least, most)) = source.disparities()
        && least < -1.0
        && is_default
    {
        let least = (least - 0.25 * (most - least)).floor();
        let text = format!(
            "disparities go down to {least} px and are searched from there; match.disparity_least says another"
        );
        said.say(Level::Info, "match", text);
        graph.fill_in_measured("match", "disparity_least", f64::from(least));
    }
}

/// Why a rail's frames make no map, if there are too few of them.
pub(super) fn too_few_for_a_map(graph: &Graph, source: &Source) -> Option<String> {
    let sightings = graph.settings_of("map").get("sightings")?.as_u64()?;
    let (rail, frames) = (source.rail()?, source.scans());
    // The first triple is there with its third frame, and every further frame brings one.
    let least = 2 * rail.stride + sightings;
    (frames < least).then(|| {
        format!(
            "{frames} frames make no map: a point enters it once {sightings} triples have seen it (map.sightings), and at \
             stride {} that takes {least} frames",
            rail.stride
        )
    })
}

/// Lets results be evaluated where the source knows the truth, and nowhere else.
fn settle_truth(graph: &mut Graph, source: &Source) -> Result<(), Failure> {
    let view = graph.reference(source.view_count())?;
    if !graph.has("match") || !source.knows_truth(view) {
        graph.remove("evaluate");
    }
    if graph.has("evaluate") {
        graph.fill_in("capture", "truth", view);
        graph.fill_in("evaluate", "view", view);
    }
    Ok(())
}

fn say_notices(source: &Source, said: &mut Early) {
    for notice in source.notices() {
        said.say(Level::Info, "capture", notice.to_string());
    }
    for warning in source.warnings() {
        said.say(Level::Warn, "capture", warning.to_string());
    }
}

/// Looks at the first scans before anything runs: says what is wrong with them, and refuses what cannot be matched.
fn look(
    graph: &Graph,
    source: &mut Source,
    is_forced: bool,
    said: &mut Early,
) -> Result<(), Failure> {
    let capture = graph.settings_of("capture");
    let spec = capture.get("source").and_then(Value::as_str);
    let spec = spec.unwrap_or_default();
    // Rendered scenes are rectified; of nothing that is not matched rows need be aligned.
    if spec.starts_with("scene:") || !graph.has("match") {
        return Ok(());
    }
    let is_set = |key| capture.get(key).is_some_and(|value| !value.is_null());
    let judged = Looked::at(source, is_set("calibration")).judged(spec);
    for warning in judged.warnings {
        said.say(Level::Warn, "capture", warning);
    }
    match judged.refusal {
        Some(why) if is_forced => said.say(Level::Warn, "capture", why),
        Some(why) => {
            let text = format!("{why} (--force-unrectified runs nevertheless)");
            return Err(Failure::failed(text));
        }
        None => {}
    }
    Ok(())
}

fn rig(graph: &Graph, source: &Source) -> Result<Rig, Failure> {
    let channels = graph.channels()?;
    if let Some(rail) = source.rail() {
        let reference = graph.settings_of("match").get("reference");
        if reference.is_some_and(|reference| reference != "left" && reference != 0) {
            let text = "on a rail results belong to the newest frame: leave match.reference alone";
            return Err(Failure::usage(text));
        }
        let rail = Rail {
            follow: graph.follow()?,
            ..rail
        };
        return Ok(Rig {
            calibration: source.calibration(),
            ..Rig::of_rail(rail, &channels, source.size())
        });
    }
    let count = source.view_count();
    if count < 3 {
        let text = format!(
            "at least three views are matched, not {count}; of one camera that moves: --layout rail"
        );
        return Err(Failure::usage(text));
    }
    let size: Size = source.size();
    Ok(Rig {
        calibration: source.calibration(),
        ..Rig::of_views(count, &channels, size)
    })
}

/// Settles where the recording goes.
pub(super) fn recording(graph: &mut Graph) -> Result<Option<PathBuf>, Failure> {
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
            let now = Timestamp::now().strftime("%Y%m%d-%H%M%S-%3f");
            Path::new("recordings").join(format!("tricurve-{now}.mcap"))
        }
        file => PathBuf::from(file),
    };
    let path = std::path::absolute(&path).map_err(Failure::failed)?;
    let overwrite = settings.get("overwrite").and_then(Value::as_bool);
    let existing = record::Writer::check(&path, overwrite.unwrap_or_default());
    let existing = existing.map_err(|error| match error {
        record::WriteError::Exists(_) => Failure::usage(error),
        error => Failure::failed(error),
    })?;
    let leave_free = settings.get("leave_free").and_then(Value::as_u64);
    record::Writer::check_free(&path, leave_free.unwrap_or_default(), &existing)
        .map_err(Failure::failed)?;
    graph.fill_in("record", "file", path.to_string_lossy().as_ref());
    Ok(Some(path))
}
