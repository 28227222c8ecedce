//! `tricurve clean`: removes what dead runs left behind.

use crate::{Failure, Outcome, rundir};

pub(crate) fn run() -> Result<Outcome, Failure> {
    let (runs, bytes) =
        rundir::clean().map_err(|e| Failure::failed(format!("cannot clean: {e}")))?;
    let text = match runs {
        0 => "nothing to clean: no dead run left anything\n".to_owned(),
        _ => format!(
            "cleaned up after {runs} dead {}: {:.1} MB of shared memory\n",
            if runs == 1 { "run" } else { "runs" },
            bytes as f64 / 1e6
        ),
    };
    super::print(&text)?;
    Ok(Outcome::Done)
}
