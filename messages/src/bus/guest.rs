//! A guest: listens to a running graph without being part of it. Nobody waits for a guest; what it is too slow for is
//! lost to it alone.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use super::ports::Ports;
use super::{Book, BusError, Inputs, Joined, Joins, Run};
use crate::topic::Kind;

/// How often a guest looks for messages: no node rings a guest.
pub const LOOK_EVERY: Duration = Duration::from_millis(5);

/// A guest's end of the bus.
pub struct Guest {
    joins: Joins,
    /// The scan that should come next.
    next: Option<u64>,
    missed: u64,
    /// Its ports live as long as their node.
    _ports: Ports,
}

impl std::fmt::Debug for Guest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Guest")
            .field("next", &self.next)
            .field("missed", &self.missed)
            .finish_non_exhaustive()
    }
}

impl Guest {
    /// Joins a run under a name of its own and listens to every topic of these kinds.
    ///
    /// # Errors
    /// When the run has no room for a further guest, or is over.
    pub fn join(run: &Run, name: &str, kinds: &[Kind]) -> Result<Self, BusError> {
        let ports = Ports::new(run, name)?;
        let book = Rc::new(RefCell::new(Book::default()));
        let inputs = Inputs::new(run, &ports, kinds, book)?;
        Ok(Self {
            joins: Joins::new(inputs),
            next: None,
            missed: 0,
            _ports: ports,
        })
    }

    /// A scan of which every message has come, each once; without waiting.
    ///
    /// # Errors
    /// When a subscriber fails.
    pub fn scan_now(&mut self) -> Result<Option<Joined>, BusError> {
        while let Some(scan) = self.joins.receive()? {
            let expected = *self.next.get_or_insert(scan.sequence);
            if scan.sequence >= expected {
                self.missed += scan.sequence - expected;
                self.next = Some(scan.sequence + 1);
                return Ok(Some(scan));
            }
        }
        Ok(None)
    }

    /// How many scans since the first were missed, because this guest was too slow or a message did not reach it.
    pub fn missed(&self) -> u64 {
        self.missed
    }
}
