//! `tricurve report`: a recording as one page.

use std::path::Path;

use messages::settings::{Key, Settings as _};
use record::{ExportError, Known, Page, Recording, ReportError, report};
use serde_json::{Map, Value};

use crate::cli::{Profile, Report as Args};
use crate::graph::{self, GRAPH};
use crate::registry::NODES;
use crate::{Failure, Outcome};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let mut recording = Recording::open(&args.file).map_err(Failure::failed)?;
    for note in recording.notes() {
        crate::say!("tricurve: {note}");
    }
    let page = Page {
        scans: args
            .scans
            .map(|scans| scans.first..scans.end.unwrap_or(u64::MAX)),
        overwrite: args.force,
        known: known()?,
    };
    let reported = report(&mut recording, &page, &args.output).map_err(|error| match error {
        ReportError::Exists(_) | ReportError::Write(ExportError::OntoItself(_)) => {
            Failure::usage(error)
        }
        error => Failure::failed(error),
    })?;
    if args.output != Path::new("-") {
        super::print(&format!("{}\n", args.output.display()))?;
    }
    match reported.unreadable_bytes {
        0 => Ok(Outcome::Done),
        bytes => {
            crate::say!("tricurve: {bytes} bytes of the scans shown are damaged");
            Ok(Outcome::Lost)
        }
    }
}

/// What the registry says of settings: their values in every profile, and what they mean.
fn known() -> Result<Known, Failure> {
    let own = serde_json::to_value(graph::Settings::default()).map_err(Failure::failed)?;
    let settings = |profile: Profile| {
        let nodes = NODES.iter();
        let nodes = nodes.map(|node| (node.name.to_owned(), (node.settings)(profile)));
        let all: Map<String, Value> = nodes.chain([(GRAPH.to_owned(), own.clone())]).collect();
        Value::Object(all)
    };
    let profiles = [("default", Profile::Default), ("thesis", Profile::Thesis)];
    let meaning = |node: &str, key: &Key| {
        let place = (node.to_owned(), key.name.to_owned());
        (place, key.about.to_owned())
    };
    let of_nodes = NODES
        .iter()
        .flat_map(|node| node.keys.iter().map(|key| meaning(node.name, key)));
    let of_graph = graph::Settings::KEYS.iter().map(|key| meaning(GRAPH, key));
    Ok(Known {
        profiles: profiles
            .map(|(name, profile)| (name.to_owned(), settings(profile)))
            .to_vec(),
        meanings: of_nodes.chain(of_graph).collect(),
    })
}
