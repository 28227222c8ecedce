//! `tricurve export`: a recording's results in the formats of other trades.

use std::path::Path;

use record::{Export, ExportError, Exported, Recording, export};

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
        crate::say!("tricurve: the cameras are not calibrated: depths are right up to one factor");
    }
    let written = export(&mut recording, &wanted).map_err(|error| match error {
        ExportError::WhichScan { .. } | ExportError::OntoItself(_) | ExportError::NoMap => {
            Failure::usage(error)
        }
        error => Failure::failed(error),
    })?;
    for Exported { path, points } in &written {
        if *points == Some(0) {
            crate::say!(
                "tricurve: {} holds no points: none was matched; `tricurve info` says how many each scan has",
                path.display()
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
