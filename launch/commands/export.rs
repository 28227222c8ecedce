//! `tricurve export`: a recording's results in the formats of other trades.

use std::path::Path;

use messages::Kind;
use record::{Export, ExportError, Exported, Recording, export};
use tempfile::TempDir;

use super::proof;
use crate::cli::Export as Args;
use crate::{Failure, Outcome};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let wanted = Export {
        scan: args.scan,
        csv: args.csv.clone(),
        pfm: args.pfm.clone(),
        ply: args.ply.clone(),
        map: args.map.clone(),
        png: args.png.clone(),
        thesis: args.thesis.clone(),
    };
    if (Export {
        scan: wanted.scan,
        ..Export::default()
    }) == wanted
    {
        return Err(Failure::usage(
            "nothing to export: say what with --csv, --pfm, --ply, --map, --png or --thesis",
        ));
    }
    let mut recording = Recording::open(&args.file).map_err(Failure::failed)?;
    for note in recording.notes().iter().chain(recording.remarks()) {
        crate::say!("tricurve: {note}");
    }
    if !recording
        .metadata()
        .rig
        .calibration
        .is_some_and(|camera| camera.calibrated)
    {
        crate::say!(
            "tricurve: the cameras are not calibrated: depths are right up to one factor, shapes only with the right focal length"
        );
    }
    let _computed = match recording.is_proof() {
        true => complete(&mut recording, &wanted)?,
        false => None,
    };
    let written = export(&mut recording, &wanted).map_err(|error| match error {
        ExportError::WhichScan { .. } | ExportError::OntoItself(_) | ExportError::NoMap => {
            Failure::usage(error)
        }
        error => Failure::failed(error),
    })?;
    for Exported { path, points } in &written {
        if *points == Some(0) {
            crate::say!(
                "tricurve: {} holds no points: {}",
                path.display(),
                why_empty(path, &wanted)
            );
        }
        if path != Path::new("-") {
            super::print(&format!("{}\n", path.display()))?;
        }
    }
    let whole = recording.whole_scans();
    let mut left_out: Vec<u64> = recording.scans().collect();
    left_out.retain(|scan| args.scan.is_none() && whole.binary_search(scan).is_err());
    if let Some(first) = left_out.first() {
        crate::say!(
            "tricurve: {} of {} scans are not whole and are left out, the first is {first}: --scan exports one by itself",
            left_out.len(),
            left_out.len() + whole.len()
        );
    }
    let is_less = !left_out.is_empty() || args.scan.is_none() && recording.lacks_scans();
    Ok(match is_less {
        true => Outcome::Lost,
        false => Outcome::Done,
    })
}

/// Why a file that was written holds no points.
fn why_empty(path: &Path, wanted: &Export) -> &'static str {
    match wanted.map.as_deref() == Some(path) {
        true => "none was seen in as many triples as map.sightings asks for",
        false => "none was matched; the first frames of a rail have no triple yet",
    }
}

/// Computes what is exported of a proof and is not in it.
fn complete(recording: &mut Recording, wanted: &Export) -> Result<Option<TempDir>, Failure> {
    // Which kinds each format is made of, and whether of all scans.
    let all: Vec<Kind> = Kind::all().collect();
    let all = &all[..];
    let needs: [(bool, &[Kind], bool); 5] = [
        (wanted.csv.is_some(), &[Kind::Points], true),
        (wanted.ply.is_some(), &[Kind::Image, Kind::Points], true),
        (wanted.map.is_some(), &[Kind::Map, Kind::Growing], false),
        (wanted.png.is_some(), all, true),
        (wanted.thesis.is_some(), all, true),
    ];
    let needed: Vec<_> = needs.into_iter().filter(|(wanted, ..)| *wanted).collect();
    let mut without = Kind::all().collect::<Vec<_>>();
    without.retain(|kind| !needed.iter().any(|(_, kinds, _)| kinds.contains(kind)));
    let mut scans = match wanted.scan {
        Some(scan) => vec![scan],
        None => recording.whole_scans(),
    };
    if needed.is_empty() {
        return Ok(None);
    }
    // Of a map only what is followed at its end is not in the proof; its own points are.
    if !needed.iter().any(|(.., of_all)| *of_all) {
        scans = recording.whole_scans();
        scans.drain(..scans.len().saturating_sub(1));
    } else if wanted.pfm.is_some() {
        without.retain(|kind| *kind != Kind::Disparity);
    }
    proof::complete(recording, &scans, &without)
}
