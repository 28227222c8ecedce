//! What a node counts of what it takes and sends.

use std::collections::BTreeMap;
use std::time::Instant;

use super::meter::Meter;
use crate::header::Header;
use crate::ledger::{Account, Seen, Shard};
use crate::synchronisation::Synchronisation;

/// A node's account of one topic, as it goes.
#[derive(Debug, Default)]
pub(super) struct Tally {
    pub(super) received: Option<Seen>,
    pub(super) published: Option<Seen>,
    pub(super) duplicates: u64,
    pub(super) dropped: BTreeMap<String, u64>,
}

/// What a node counts, shared by its ports.
#[derive(Debug, Default)]
pub(super) struct Book {
    /// The scans that are the node's own: what is seen is counted by its place among them.
    pub(super) shard: Shard,
    pub(super) topics: BTreeMap<String, Tally>,
    /// Scans this node has said to be done, if it is one that says so.
    pub(super) done: Option<Seen>,
    /// Bytes of what all published messages hold.
    pub(super) bytes: u64,
    /// Scans below this one went through the node whose place this one takes.
    pub(super) done_below: u64,
    /// Whether it takes the place of one that died.
    pub(super) is_successor: bool,
    pub(super) meter: Meter,
    pub(super) synchronisation: Option<Box<Synchronisation>>,
    pub(super) warnings: Vec<String>,
    /// When the node was handed its last message or published its last one.
    pub(super) mark: Option<Instant>,
}

impl Book {
    pub(super) fn tally(&mut self, topic: &str) -> &mut Tally {
        self.topics.entry(topic.to_owned()).or_default()
    }

    /// Keeps account of a topic that is taken in.
    pub(super) fn take_in(&mut self, topic: &str) {
        let done_below = self.shard.below(self.done_below);
        self.tally(topic)
            .received
            .get_or_insert_default()
            .advance(done_below);
    }

    /// Keeps account of a topic that is published.
    pub(super) fn send_out(&mut self, topic: &str) {
        let done_below = self.shard.below(self.done_below);
        self.tally(topic)
            .published
            .get_or_insert_default()
            .advance(done_below);
        self.meter.expect_one_more();
    }

    pub(super) fn received(&mut self, topic: &str, header: &Header) -> bool {
        self.advance(header.done_below);
        let place = self.shard.below(header.sequence);
        let tally = self.tally(topic);
        let is_new = tally.received.get_or_insert_default().insert(place);
        tally.duplicates += u64::from(!is_new);
        is_new
    }

    pub(super) fn published(&mut self, topic: &str, sequence: u64) {
        let place = self.shard.below(sequence);
        let tally = self.tally(topic);
        tally.published.get_or_insert_default().insert(place);
    }

    pub(super) fn finished(&mut self, sequence: u64) {
        let place = self.shard.below(sequence);
        self.done.get_or_insert_default().insert(place);
    }

    /// What was done before a successor had its ports it never sees, and nobody sends it again.
    pub(super) fn advance(&mut self, done_below: u64) {
        if self.is_successor && done_below > self.done_below {
            self.done_below = done_below;
            let done_below = self.shard.below(done_below);
            if let Some(done) = &mut self.done {
                done.advance(done_below);
            }
            for tally in self.topics.values_mut() {
                let sets = [&mut tally.received, &mut tally.published];
                for seen in sets.into_iter().flatten() {
                    seen.advance(done_below);
                }
            }
        }
    }

    pub(super) fn accounts(&self) -> BTreeMap<String, Account> {
        let account = |tally: &Tally| Account {
            shard: self.shard,
            received: tally.received.as_ref().map(Seen::count),
            published: tally.published.as_ref().map(Seen::count),
            duplicates: tally.duplicates,
            dropped: tally.dropped.clone(),
            missing: {
                let places = tally.received.iter().flat_map(Seen::missing);
                places.map(|place| self.shard.nth(place)).collect()
            },
        };
        let entry = |(name, tally): (&String, &Tally)| (name.clone(), account(tally));
        self.topics.iter().map(entry).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_successor_counts_as_done_what_its_predecessor_did() {
        let mut done = Seen::default();
        done.advance(5);
        let mut book = Book {
            done: Some(done),
            done_below: 5,
            is_successor: true,
            ..Book::default()
        };
        book.advance(9);
        let count = |book: &Book| book.done.as_ref().map(Seen::count);
        assert_eq!(count(&book), Some(9));
        // Said twice, as after a resend, it counts once.
        for sequence in [9, 9, 10] {
            book.finished(sequence);
        }
        assert_eq!(count(&book), Some(11));
    }
}
