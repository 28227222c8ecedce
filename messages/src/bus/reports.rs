//! What nodes report, as the recorder and viewers hear it.

use super::ports;
use super::{BusError, Event};
use crate::ledger::Ledger;

/// Hears what all nodes report.
pub struct ReportsIn {
    pub(super) subscriber: ports::TextSubscriber,
}

impl std::fmt::Debug for ReportsIn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ReportsIn").finish_non_exhaustive()
    }
}

impl ReportsIn {
    /// The next thing a node said.
    ///
    /// # Errors
    /// When the subscriber fails.
    pub fn receive(&mut self) -> Result<Option<Event>, BusError> {
        while let Some(text) = ports::receive_text(&self.subscriber)? {
            if let Ok(event) = serde_json::from_str(&text) {
                return Ok(Some(event));
            }
        }
        Ok(None)
    }
}

impl Ledger {
    /// Takes in what a node reports; gives back what is no account.
    pub fn hear(&mut self, event: Event) -> Option<Event> {
        match event {
            Event::Report(report) | Event::Finished(report) => {
                self.nodes.insert(report.node, report.topics);
            }
            Event::Progress(progress) => {
                self.admitted = progress.admitted;
                self.done = progress.done;
                self.refused = progress.refused;
            }
            other => return Some(other),
        }
        None
    }
}
