//! Signals that only set a flag, for commands that look at it between two steps.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};

use crate::Failure;

/// What asks a command to come to its end.
pub(crate) const END: [i32; 4] = [SIGINT, SIGTERM, SIGHUP, SIGQUIT];

/// A flag that any of these signals sets, from now on.
pub(crate) fn flag(signals: &[i32]) -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in signals {
        signal_hook::flag::register(*signal, Arc::clone(&flag))
            .map_err(|e| Failure::failed(format!("cannot listen to signals: {e}")))?;
    }
    Ok(flag)
}
