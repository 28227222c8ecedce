//! `tricurve info`: what a recording holds.

use record::{Info, Recording};

use crate::cli::Info as Args;
use crate::{Failure, Outcome};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let recording = Recording::open(&args.file).map_err(Failure::failed)?;
    let info = Info::of(&recording);
    match args.json {
        true => super::print_json(&info)?,
        false => super::print(&info.to_string())?,
    }
    let failures = info.failures();
    if !args.check || failures.is_empty() {
        return Ok(Outcome::Done);
    }
    for failure in failures {
        crate::say!("tricurve: check: {failure}");
    }
    Ok(Outcome::Lost)
}
