//! Which scans are done: who says so, and who hears it.
//!
//! A node that a scan waits for says so with a [`Finisher`], or leaves it to [`Settling`].

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
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

/// Says it for a node that does not say it itself: a scan is done once all its messages were handed to the node and it asks for
/// more.
#[derive(Debug)]
pub(super) struct Settling {
    finisher: Finisher,
    /// How many messages a scan has for the node.
    messages: usize,
    /// Which of them it was handed, by scan.
    handed: BTreeMap<u64, BTreeSet<String>>,
    /// What it was handed last.
    last: Vec<(u64, String)>,
}

impl Settling {
    pub(super) fn new(finisher: Finisher, messages: usize) -> Self {
        Self {
            finisher,
            messages,
            handed: BTreeMap::new(),
            last: Vec::new(),
        }
    }

    /// The node is handed a message of a topic.
    pub(super) fn hand(&mut self, header: &Header, topic: &str) {
        self.last.push((header.sequence, topic.to_owned()));
        self.handed = self.handed.split_off(&header.done_below);
    }

    /// The node asks for more: it is done with what it was handed.
    pub(super) fn settle(&mut self) -> Result<(), BusError> {
        for (scan, topic) in self.last.drain(..) {
            let handed = self.handed.entry(scan).or_default();
            handed.insert(topic);
            if handed.len() == self.messages {
                self.handed.remove(&scan);
                self.finisher.done(scan)?;
            }
        }
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
