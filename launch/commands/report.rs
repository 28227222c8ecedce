//! `tricurve report`: a recording as one page.

use std::path::Path;

use clap::ValueEnum;
use evaluate::Evaluator;
use matching::Method;
use messages::Score;
use messages::settings::{Key, Settings as _};
use record::{ExportError, Known, Mismatches, Page, Recording, ReportError, report, thesis};
use serde_json::{Map, Value};

use super::proof;
use crate::cli::Report as Args;
use crate::graph::{self, GRAPH};
use crate::offline::Tabulated;
use crate::profile::Profile;
use crate::registry::nodes;
use crate::{Failure, Outcome, former};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let mut recording = Recording::open(&args.file).map_err(Failure::failed)?;
    for note in recording.notes().iter().chain(recording.remarks()) {
        crate::say!("tricurve: {note}");
    }
    let refused = |error| match error {
        ReportError::Exists(_) | ReportError::Write(ExportError::OntoItself(_)) => {
            Failure::usage(error)
        }
        error => Failure::failed(error),
    };
    let page = Page {
        scans: args
            .scans
            .map(|scans| scans.first..scans.end.unwrap_or(u64::MAX)),
        overwrite: args.force,
        known: known()?,
    };
    // What a proof does not hold of the scans that are shown is computed.
    let mut shown = match args.output {
        Some(_) => record::shown(&recording, &page).map_err(refused)?,
        None => Vec::new(),
    };
    if args.thesis.is_some() {
        shown.extend(
            record::objects(&recording)
                .into_iter()
                .map(|(scan, _)| scan),
        );
    }
    shown.sort_unstable();
    shown.dedup();
    let _computed = proof::complete(&mut recording, &shown, &[])?;
    if let Some(path) = &args.thesis {
        thesis(&mut recording, path, args.force, &mut mismatches).map_err(refused)?;
        said(path)?;
    }
    let Some(output) = &args.output else {
        return Ok(Outcome::Done);
    };
    let reported = report(&mut recording, &page, output, &mut mismatches).map_err(refused)?;
    said(output)?;
    match reported.unreadable_bytes {
        0 => Ok(Outcome::Done),
        bytes => {
            crate::say!("tricurve: {bytes} bytes of the scans shown are damaged");
            Ok(Outcome::Lost)
        }
    }
}

/// Says which page was written, unless it went to standard output.
fn said(path: &Path) -> Result<(), Failure> {
    match path == Path::new("-") {
        true => Ok(()),
        false => super::print(&format!("{}\n", path.display())),
    }
}

/// False targets of the three methods in a scan, matched anew with the recording's own settings; nothing where it does
/// not hold all that takes.
fn mismatches(recording: &mut Recording, scan: u64) -> Option<Mismatches> {
    let configuration = &recording.metadata().configuration;
    // What cannot be carried over says how points along curves are matched; the table is for the thesis's curves.
    let (configuration, _) = former::carried(configuration);
    let own = configuration.get("match")?.clone();
    let own: matching::Settings = serde_json::from_value(own).ok()?;
    let evaluate = configuration.get("evaluate").cloned().unwrap_or_default();
    let evaluate: evaluate::Settings = serde_json::from_value(evaluate).unwrap_or_default();
    let view = evaluate.view as usize;
    let (scan, truth) = Tabulated::of_recording(recording, scan).ok()?;
    if scan.views() < 3 || view >= scan.views() {
        return None;
    }
    let mut evaluator = Evaluator::new(&evaluate);
    let by_method: Vec<Vec<Score>> = METHODS
        .iter()
        .map(|(_, method)| {
            let settings = matching::Settings {
                method: *method,
                ..own.clone()
            };
            let matched = scan.matched(&settings);
            matched
                .evaluated(&scan, &mut evaluator, view, &truth)
                .scores
        })
        .collect();
    let row = |name: String, at: usize| {
        let cells = by_method.iter().filter_map(|scores| scores.get(at));
        let cells = cells.map(|score| (score.mismatches, score.points));
        (name, cells.collect())
    };
    let channels = scan.channels.iter().zip(1..);
    let mut rows: Vec<_> = channels
        .map(|(variance, at)| row(format!("σ² = {variance}"), at))
        .collect();
    rows.push(row("all".to_owned(), 0));
    Some(Mismatches {
        methods: METHODS
            .map(|(name, method)| match method {
                Method::ThreeView if scan.views() > 3 => format!("curves, {} views", scan.views()),
                _ => name.to_owned(),
            })
            .to_vec(),
        rows,
    })
}

/// The methods of the thesis's table.
const METHODS: [(&str, Method); 3] = [
    ("points, two views", Method::Point),
    ("curves, two views", Method::TwoView),
    ("curves, three views", Method::ThreeView),
];

/// What the registry says of settings: their values in every profile, and what they mean.
pub(super) fn known() -> Result<Known, Failure> {
    let own = serde_json::to_value(graph::Settings::default()).map_err(Failure::failed)?;
    let settings = |profile: Profile| {
        let of_nodes = nodes().iter();
        // A recording may be of a build before, and say keys of before.
        let of_nodes = of_nodes.map(|node| {
            let settings = former::with_former(node.name, (node.settings)(profile));
            (node.name.to_owned(), settings)
        });
        let all: Map<String, Value> = of_nodes.chain([(GRAPH.to_owned(), own.clone())]).collect();
        Value::Object(all)
    };
    let meaning = |node: &str, key: &Key| {
        let place = (node.to_owned(), key.name.to_owned());
        (place, key.about.to_owned())
    };
    let of_nodes = nodes()
        .iter()
        .flat_map(|node| node.keys.iter().map(|key| meaning(node.name, key)));
    let of_before =
        former::all().map(|(node, key, told)| ((node.to_owned(), key.to_owned()), told));
    let of_graph = graph::Settings::KEYS.iter().map(|key| meaning(GRAPH, key));
    Ok(Known {
        profiles: Profile::value_variants()
            .iter()
            .map(|profile| (profile.name(), settings(*profile)))
            .collect(),
        meanings: of_nodes.chain(of_graph).chain(of_before).collect(),
    })
}
