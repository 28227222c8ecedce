//! Signals that only set a flag, for commands that look at it between two steps.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};

use crate::Failure;

/// What asks a command to come to its end.
pub(crate) const END: [i32; 4] = [SIGINT, SIGTERM, SIGHUP, SIGQUIT];

/// Whether this process was started with a signal ignored, as `nohup` does for one that is to outlive its terminal.
pub(crate) fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// A flag that any of these signals sets, from now on.
pub(crate) fn flag(signals: &[i32]) -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in signals {
        signal_hook::flag::register(*signal, Arc::clone(&flag))
            .map_err(|e| Failure::failed(format!("cannot listen to signals: {e}")))?;
    }
    Ok(flag)
}
