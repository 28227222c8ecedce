//! `tricurve info`: what a recording holds.

use record::{Info, Recording};

use crate::cli::Info as Args;
use crate::{Failure, Outcome};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let mut recording = Recording::open(&args.file).map_err(Failure::failed)?;
    let info = Info::of(&recording);
    match args.json {
        true => super::print_json(&info)?,
        false => super::print(&info.to_string())?,
    }
    if !args.check {
        return Ok(Outcome::Done);
    }
    let mut failures = info.failures();
    failures.extend(unreadable(&mut recording)?);
    if failures.is_empty() {
        return Ok(Outcome::Done);
    }
    for failure in failures {
        crate::say!("tricurve: check: {failure}");
    }
    Ok(Outcome::Lost)
}

/// Reads every chunk, and says what cannot be read.
fn unreadable(recording: &mut Recording) -> Result<Option<String>, Failure> {
    let scans: Vec<u64> = recording.scans().collect();
    let (mut bytes, mut first) = (0, None);
    for scan in scans {
        let (read, lost) = recording.salvage(scan).map_err(Failure::failed)?;
        recording.reuse(read);
        if lost > 0 {
            bytes += lost;
            first.get_or_insert(scan);
        }
    }
    Ok(first.map(|scan| {
        format!(
            "{bytes} bytes are damaged, the first in scan {scan}: recover writes what is readable"
        )
    }))
}
