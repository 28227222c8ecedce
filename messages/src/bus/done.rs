//! Which scans are done: who says so, and who hears it.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use super::BusError;
use super::book::Book;
use super::ports::{self, Bell};
use crate::header::Header;
use crate::ledger::Shard;

/// Says that scans are done.
pub struct Finisher {
    pub(super) book: Rc<RefCell<Book>>,
    pub(super) publisher: ports::DataPublisher,
    pub(super) doors: Vec<Bell>,
    pub(super) index: u64,
}

impl std::fmt::Debug for Finisher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Finisher")
            .field("index", &self.index)
            .finish_non_exhaustive()
    }
}

impl Finisher {
    /// This node is done with the scan.
    ///
    /// # Errors
    /// When the publisher fails.
    pub fn done(&self, sequence: u64) -> Result<(), BusError> {
        let header = Header {
            sequence,
            ..Header::default()
        };
        ports::send_words(&self.publisher, &header, &[self.index])?;
        self.doors.iter().for_each(Bell::ring);
        self.book.borrow_mut().finished(sequence);
        Ok(())
    }
}

/// Hears which scans are done.
pub(super) struct Dones {
    pub(super) subscriber: Rc<ports::DataSubscriber>,
    /// Who says so, and of which scans.
    pub(super) finishers: Vec<(u64, Shard)>,
    pub(super) heard: BTreeMap<u64, Vec<u64>>,
}

impl std::fmt::Debug for Dones {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Dones")
            .field("heard", &self.heard)
            .finish_non_exhaustive()
    }
}

impl Dones {
    /// The next scan that all finishers have said to be done, possibly one that was said before.
    pub(super) fn receive(&mut self) -> Result<Option<u64>, BusError> {
        while let Some((header, finisher)) = ports::receive_word(&self.subscriber)? {
            let heard = self.heard.entry(header.sequence).or_default();
            if !heard.contains(&finisher) {
                heard.push(finisher);
            }
            let mut asked = self.finishers.iter();
            if asked.all(|(f, shard)| !shard.owns(header.sequence) || heard.contains(f)) {
                self.heard.remove(&header.sequence);
                return Ok(Some(header.sequence));
            }
        }
        Ok(None)
    }

    /// Forgets what was said of scans below this number.
    pub(super) fn forget_below(&mut self, sequence: u64) {
        self.heard = self.heard.split_off(&sequence);
    }
}
