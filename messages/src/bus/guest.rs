//! A guest: listens to a running graph without being part of it. Nobody waits for a guest; what it is too slow for is
//! lost to it alone.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use super::ports::Ports;
use super::{Book, BusError, Event, Inputs, Joined, Joins, Received, ReportsIn, Run};
use crate::payload::Kind;
use crate::topic::Topic;

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
        let ports = Ports::of_guest(run, name)?;
        let book = Rc::new(RefCell::new(Book::default()));
        let topics = kinds.iter().flat_map(|&kind| Topic::of(&run.rig, kind));
        let inputs = Inputs::new(run, &ports, topics, book)?;
        let joins = match run.is_sharded() {
            true => Joins::in_order(inputs, 0, run.in_flight),
            false => Joins::new(inputs),
        };
        Ok(Self {
            joins,
            next: None,
            missed: 0,
            _ports: ports,
        })
    }

    /// Hears what the nodes of a run report, under a name of its own.
    ///
    /// # Errors
    /// When the run has no room for a further guest, or is over.
    pub fn reports(run: &Run, name: &str) -> Result<Reports, BusError> {
        let ports = Ports::of_guest(run, name)?;
        Ok(Reports {
            reports: ReportsIn {
                subscriber: ports.reports_in()?,
            },
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

/// A guest that hears what nodes report.
pub struct Reports {
    reports: ReportsIn,
    /// Its ports live as long as their node.
    _ports: Ports,
}

impl std::fmt::Debug for Reports {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reports").finish_non_exhaustive()
    }
}

impl Reports {
    /// The next thing a node said; without waiting.
    ///
    /// # Errors
    /// When the subscriber fails.
    pub fn receive(&mut self) -> Result<Option<Event>, BusError> {
        self.reports.receive()
    }
}

/// A guest that hears single topics, message by message, and what nodes report.
pub struct Hearer {
    inputs: Inputs,
    reports: ReportsIn,
    /// Its ports live as long as their node.
    _ports: Ports,
}

impl std::fmt::Debug for Hearer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Hearer").field(&self.inputs).finish()
    }
}

impl Hearer {
    /// Joins a run under a name of its own and listens to these topics.
    ///
    /// # Errors
    /// When the run has no room for a further guest, or is over.
    pub fn join(run: &Run, name: &str, topics: &[Topic]) -> Result<Self, BusError> {
        let ports = Ports::of_guest(run, name)?;
        let book = Rc::new(RefCell::new(Book::default()));
        let inputs = Inputs::new(run, &ports, topics.iter().cloned(), book)?;
        let reports = ReportsIn {
            subscriber: ports.reports_in()?,
        };
        Ok(Self {
            inputs,
            reports,
            _ports: ports,
        })
    }

    /// The message of the oldest scan among those that have come; without waiting.
    ///
    /// # Errors
    /// When a subscriber fails.
    pub fn message_now(&mut self) -> Result<Option<Received>, BusError> {
        self.inputs.receive()
    }

    /// What a node reported; without waiting.
    ///
    /// # Errors
    /// When the subscriber fails.
    pub fn report_now(&mut self) -> Result<Option<Event>, BusError> {
        self.reports.receive()
    }
}
