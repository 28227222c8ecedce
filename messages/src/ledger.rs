//! The ledger: what every node received, published and dropped, topic by topic.
//!
//! Counts are of *different* scans, so that a resend after a restart changes nothing, and they survive a restart
//! without help from the node that died: its successor takes for seen every scan below
//! [`Header::done_below`](crate::Header::done_below), which went through everybody or would not be done. A node that
//! was never restarted counts only what it saw.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The set of sequences seen so far: all below `base` but those given up, and those of the next 64 whose bit is set.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    base: u64,
    mask: u64,
    /// Scans below `base` that were never seen, in order; the first few, to be named.
    given_up: Vec<u64>,
    /// How many there are.
    lost: u64,
}

impl Seen {
    /// How many scans beyond the oldest missing one are waited for before it is given up; the door keeps fewer in
    /// flight.
    pub const WINDOW: u64 = 64;
    /// How many scans that were given up are named.
    const NAMED: usize = 16;

    /// Takes for seen every scan below this number.
    pub fn advance(&mut self, done_below: u64) {
        let step = done_below.saturating_sub(self.base);
        if step > 0 {
            self.mask = self.mask.checked_shr(step.min(64) as u32).unwrap_or(0);
            self.base = done_below;
            self.settle();
        }
    }

    /// Adds a scan; false when it was there already.
    pub fn insert(&mut self, sequence: u64) -> bool {
        let Some(ahead) = sequence.checked_sub(self.base) else {
            let late = self.given_up.iter().position(|&lost| lost == sequence);
            if let Some(late) = late {
                self.given_up.remove(late);
                self.lost -= 1;
            }
            return late.is_some();
        };
        if ahead >= Self::WINDOW {
            self.give_up_below(sequence + 1 - Self::WINDOW);
            return self.insert(sequence);
        }
        let bit = 1 << ahead;
        let is_new = self.mask & bit == 0;
        self.mask |= bit;
        self.settle();
        is_new
    }

    /// Waits no longer for what is missing below this number.
    fn give_up_below(&mut self, end: u64) {
        for sequence in self.base..end {
            if !self.contains(sequence) {
                self.lost += 1;
                if self.given_up.len() < Self::NAMED {
                    self.given_up.push(sequence);
                }
            }
        }
        self.advance(end);
    }

    /// Whether a scan is in the set.
    pub fn contains(&self, sequence: u64) -> bool {
        match sequence.checked_sub(self.base) {
            None => !self.given_up.contains(&sequence),
            Some(ahead) => ahead < Self::WINDOW && self.mask & (1 << ahead) != 0,
        }
    }

    /// How many scans are in the set.
    pub fn count(&self) -> u64 {
        self.base - self.lost + u64::from(self.mask.count_ones())
    }

    /// The scans missing below the highest one seen; of those given up long ago only the first few.
    pub fn missing(&self) -> impl Iterator<Item = u64> + '_ {
        let highest = self.base + u64::from(64 - self.mask.leading_zeros());
        let waited_for = (self.base..highest).filter(|&sequence| !self.contains(sequence));
        self.given_up.iter().copied().chain(waited_for)
    }

    /// The lowest scan that is neither in the set nor given up.
    pub fn below(&self) -> u64 {
        self.base
    }

    fn settle(&mut self) {
        let run = self.mask.trailing_ones();
        self.base += u64::from(run);
        self.mask = self.mask.checked_shr(run).unwrap_or(0);
    }
}

/// The scans that are one instance's of a node: every `of`-th, from number `index` on. Nobody hands them out, so nobody can
/// lose one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// The first of them.
    pub index: u64,
    /// How many instances there are.
    pub of: u64,
}

impl Shard {
    /// All scans.
    pub const ALL: Self = Self { index: 0, of: 1 };

    /// Whether it is all scans.
    pub fn is_all(&self) -> bool {
        *self == Self::ALL
    }

    /// Whether a scan is one of them.
    pub fn owns(&self, sequence: u64) -> bool {
        sequence % self.of == self.index
    }

    /// How many of them are below a number. Of one of them it is its place among them, counted from 0.
    pub fn below(&self, sequence: u64) -> u64 {
        sequence.saturating_sub(self.index).div_ceil(self.of)
    }

    /// The scan at a place among them, counted from 0.
    pub fn nth(&self, place: u64) -> u64 {
        place * self.of + self.index
    }

    /// Whether some scan is of both.
    pub fn meets(&self, other: &Self) -> bool {
        // Numbers with two remainders exist where these agree modulo what both divisors have in common.
        let (mut common, mut rest) = (self.of, other.of);
        while rest > 0 {
            (common, rest) = (rest, common % rest);
        }
        self.index % common == other.index % common
    }
}

impl Default for Shard {
    fn default() -> Self {
        Self::ALL
    }
}

/// One node's account of one topic.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// Of which scans it is.
    #[serde(default, skip_serializing_if = "Shard::is_all")]
    pub shard: Shard,
    /// Different scans received.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub received: Option<u64>,
    /// Different scans published.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub published: Option<u64>,
    /// Scans received once more than needed, as after a restart.
    #[serde(default)]
    pub duplicates: u64,
    /// Scans lost, by cause.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub dropped: BTreeMap<String, u64>,
    /// Scans missing below the highest one seen.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<u64>,
}

/// The whole run's account.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    /// Scans that went through the door.
    pub admitted: u64,
    /// Scans that came out, finished and flushed.
    pub done: u64,
    /// Scans that never went through the door, by cause.
    #[serde(default)]
    pub refused: BTreeMap<String, u64>,
    /// By node, then topic.
    pub nodes: BTreeMap<String, BTreeMap<String, Account>>,
}

impl Ledger {
    /// What does not balance, a sentence each; empty when everything does.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if self.admitted != self.done {
            faults.push(format!(
                "{} scans were admitted, {} done",
                self.admitted, self.done
            ));
        }
        for (node, topics) in &self.nodes {
            for (topic, account) in topics {
                let both = [
                    ("received", account.received),
                    ("published", account.published),
                ];
                let owed = account.shard.below(self.admitted);
                for (verb, count) in both {
                    if let Some(count) = count.filter(|&count| count != owed) {
                        let named = account.missing.len() as u64;
                        let further = owed.saturating_sub(count).saturating_sub(named);
                        let which = match (account.missing.as_slice(), further) {
                            ([], 0) => String::new(),
                            ([], _) => ", the last ones are missing".to_owned(),
                            (missing, 0) => format!(", missing scans {missing:?}"),
                            (missing, _) => {
                                format!(", missing scans {missing:?} and {further} later")
                            }
                        };
                        faults.push(format!(
                            "{node} {verb} {count} of {owed} scans of {topic}{which}"
                        ));
                    }
                }
                for (cause, count) in &account.dropped {
                    faults.push(format!("{node} dropped {count} of {topic}: {cause}"));
                }
            }
        }
        faults
    }

    /// Whether admitted = done and every topic was published and received whole.
    pub fn is_balanced(&self) -> bool {
        self.faults().is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn seen_counts_like_a_set_whatever_the_order() {
        let mut seen = Seen::default();
        let mut twin = BTreeSet::new();
        for sequence in [0, 1, 2, 5, 4, 5, 3, 10, 9, 40, 6, 7, 8, 2, 69, 41] {
            assert_eq!(seen.insert(sequence), twin.insert(sequence), "{sequence}");
            assert_eq!(seen.count(), twin.len() as u64, "{sequence}");
        }
        assert_eq!(seen.below(), 11);
        assert!(
            seen.missing()
                .eq((11..69).filter(|s| ![40, 41].contains(s)))
        );
    }

    #[test]
    fn a_scan_that_never_comes_is_missing_for_ever() {
        let mut seen = Seen::default();
        for sequence in (0..1000).filter(|sequence| ![7, 500].contains(sequence)) {
            assert!(seen.insert(sequence));
        }
        assert_eq!(seen.count(), 998);
        assert!(seen.missing().eq([7, 500]));
        assert!(!seen.contains(7) && seen.contains(8));
        assert!(seen.insert(7), "late is better than never");
        assert!(!seen.insert(7));
        assert_eq!(seen.count(), 999);
    }

    #[test]
    fn a_restarted_node_counts_what_its_predecessor_had_seen_as_done() {
        let mut seen = Seen::default();
        seen.advance(5);
        assert!(!seen.insert(4));
        assert!(seen.insert(7));
        seen.advance(6);
        assert!(seen.insert(6));
        assert_eq!(seen.count(), 8);
        assert_eq!(seen.missing().count(), 0);
    }

    #[test]
    fn every_scan_is_in_one_shard_and_has_its_place_there() {
        for of in 1..6 {
            let shards: Vec<Shard> = (0..of).map(|index| Shard { index, of }).collect();
            for scan in 0..40 {
                let owners: Vec<_> = shards.iter().filter(|shard| shard.owns(scan)).collect();
                assert_eq!(owners.len(), 1, "{scan} of {of}");
                assert_eq!(owners[0].nth(owners[0].below(scan)), scan);
            }
            for shard in &shards {
                for end in 0..40 {
                    let below = (0..end).filter(|scan| shard.owns(*scan)).count() as u64;
                    assert_eq!(shard.below(end), below, "{shard:?} {end}");
                }
            }
            for other in (1..6).flat_map(|of| (0..of).map(move |index| Shard { index, of })) {
                for shard in &shards {
                    let meet = (0..60).any(|scan| shard.owns(scan) && other.owns(scan));
                    assert_eq!(shard.meets(&other), meet, "{shard:?} {other:?}");
                }
            }
        }
    }

    #[test]
    fn an_instance_owes_its_own_scans_only() {
        let account = |received| Account {
            shard: Shard { index: 1, of: 2 },
            received: Some(received),
            ..Account::default()
        };
        let ledger = |received| Ledger {
            admitted: 5,
            done: 5,
            nodes: [(
                "track.2".to_owned(),
                [("edges".to_owned(), account(received))].into(),
            )]
            .into(),
            ..Ledger::default()
        };
        assert!(ledger(2).is_balanced());
        assert_eq!(
            ledger(1).faults(),
            ["track.2 received 1 of 2 scans of edges, the last ones are missing"]
        );
    }

    #[test]
    fn a_ledger_that_lost_a_message_says_which() {
        let mut ledger = Ledger {
            admitted: 3,
            done: 3,
            ..Ledger::default()
        };
        let account = Account {
            received: Some(2),
            missing: vec![1],
            ..Account::default()
        };
        assert!(ledger.is_balanced());
        ledger
            .nodes
            .entry("track".into())
            .or_default()
            .insert("edges/left/20".into(), account);
        assert_eq!(
            ledger.faults(),
            ["track received 2 of 3 scans of edges/left/20, missing scans [1]"]
        );
    }
}
