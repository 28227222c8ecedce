//! Why the bus failed.

use std::sync::atomic::{AtomicBool, Ordering};

/// Why the bus failed.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// A port or service could not be made.
    #[error("the bus could not {what}: {cause}")]
    Port {
        /// What it tried.
        what: String,
        /// What iceoryx2 said.
        cause: String,
    },
    /// A message's lengths or indices do not fit.
    #[error("scan {sequence} of {topic} is damaged: its lengths or indices do not fit")]
    Damaged {
        /// The topic.
        topic: String,
        /// The scan.
        sequence: u64,
    },
    /// So many listen already that there is room for nobody else.
    #[error(
        "a run has room for {0} listeners beside its own nodes, and they are there already: end a viewer, a recorder, a \
         `top` or a `topic`"
    )]
    Full(usize),
    /// The node is not in the run's plan.
    #[error("the run has no node named {0}")]
    Unknown(String),
}

/// Whether the bus failed in this process, of which it is a part at most once.
static HAS_FAILED: AtomicBool = AtomicBool::new(false);

/// Whether it was the bus that failed in this process: then another one in its place may fare better.
pub fn has_failed() -> bool {
    HAS_FAILED.load(Ordering::Relaxed)
}

impl BusError {
    pub(super) fn port(what: impl Into<String>, cause: impl std::fmt::Debug) -> Self {
        HAS_FAILED.store(true, Ordering::Relaxed);
        Self::Port {
            what: what.into(),
            cause: format!("{cause:?}"),
        }
    }
}
