//! Which messages of a file make a scan.
//!
//! A recording numbers its scans, and every message of a scan has its number and its time. Programs that rewrite files keep
//! the times; the numbers they keep, count anew in every channel, count through, or leave out. So the scans are found by
//! what tells all messages of a topic apart.

use std::collections::{BTreeMap, BTreeSet};

use super::names::is_ours;

/// What the messages of one scan have in common.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Key {
    /// Their number.
    #[default]
    Sequence,
    /// Their time.
    Time,
    /// Only both together: recordings with the same numbers and times were written one into the other.
    Both,
}

impl Key {
    /// What puts messages of topics that recordings do not have to a scan: numbers of others say nothing alone.
    pub(super) fn of_foreign(self) -> Self {
        match self {
            Self::Sequence => Self::Both,
            key => key,
        }
    }
}

/// Where messages lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Block {
    /// In the chunk of this index.
    Chunk(usize),
    /// Outside of chunks, in the run of this index.
    Run(usize),
}

/// A chunk or run with messages of a scan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) part: usize,
    pub(super) block: Block,
    /// The channels that the scan has messages of there; `None` where they are all that the chunk has.
    pub(super) channels: Option<Box<[u16]>>,
    /// Whether messages of other scans lie there too.
    pub(super) is_shared: bool,
}

/// Messages that have a number and a time in common, seen somewhere.
#[derive(Clone, Debug)]
pub(super) struct Sighting {
    pub(super) sequence: u64,
    pub(super) nanos: u64,
    pub(super) place: Place,
}

/// What is known of a scan without reading it.
#[derive(Clone, Debug, Default)]
pub(super) struct Held {
    /// The number its messages have in the file.
    pub(super) sequence: u64,
    pub(super) nanos: u64,
    pub(super) places: Vec<Place>,
}

/// The scans of a recording.
#[derive(Debug, Default)]
pub(super) struct Scans {
    pub(super) key: Key,
    /// By their numbers: those in the file, or, where these tell nothing, counted in order of time.
    pub(super) held: BTreeMap<u64, Held>,
}

/// Topics of which a scan may have several messages.
pub(super) fn is_repeated(topic: &str) -> bool {
    topic == "log" || topic == "ledger"
}

impl Scans {
    /// Puts together what was seen; `topics` gives the topics of a place.
    pub(super) fn of<'a, T: Iterator<Item = &'a str>>(
        sightings: Vec<Sighting>,
        topics: impl Fn(&Place) -> T,
    ) -> Self {
        let key = key(&sightings, &topics);
        // By number and by time, as far as they count.
        let mut scans: BTreeMap<(u64, u64), Held> = BTreeMap::new();
        for Sighting {
            sequence,
            nanos,
            place,
        } in sightings
        {
            let of_scan = match key {
                Key::Sequence => (0, sequence),
                Key::Time => (nanos, 0),
                Key::Both => (nanos, sequence),
            };
            let new = || Held {
                sequence,
                nanos,
                places: Vec::new(),
            };
            let held = scans.entry(of_scan).or_insert_with(new);
            // What others wrote with times of their own began with the first.
            held.nanos = held.nanos.min(nanos);
            held.add(place);
        }
        let number = |(place, held): (u64, Held)| match key {
            Key::Sequence => (held.sequence, held),
            _ => (place, held),
        };
        Self {
            key,
            held: (0..).zip(scans.into_values()).map(number).collect(),
        }
    }

    /// Numbers the scans as they say themselves, when every one does and no two say the same.
    pub(super) fn renumber(&mut self, said: &BTreeMap<u64, u64>) -> bool {
        let numbers: BTreeSet<&u64> = said.values().collect();
        let tells_all = numbers.len() == self.held.len() && said.keys().eq(self.held.keys());
        if tells_all {
            let held = std::mem::take(&mut self.held);
            self.held = held
                .into_iter()
                .filter_map(|(place, held)| Some((*said.get(&place)?, held)))
                .collect();
        }
        tells_all
    }
}

impl Held {
    /// Adds a place where messages of it lie.
    pub(super) fn add(&mut self, place: Place) {
        let is_same = |other: &&mut Place| (other.part, other.block) == (place.part, place.block);
        match self.places.last_mut().filter(is_same) {
            // Of two groups of one chunk.
            Some(Place {
                channels: Some(known),
                ..
            }) => {
                let more = place.channels.as_deref().unwrap_or_default();
                let all: BTreeSet<u16> = known.iter().chain(more).copied().collect();
                *known = all.into_iter().collect();
            }
            Some(_) => {}
            None => self.places.push(place),
        }
    }

    /// Whether a message with this number and time is of the scan.
    pub(super) fn has(&self, key: Key, sequence: u32, nanos: u64) -> bool {
        let (is_number, is_time) = (u64::from(sequence) == self.sequence, nanos == self.nanos);
        match key {
            Key::Sequence => is_number,
            Key::Time => is_time,
            Key::Both => is_number && is_time,
        }
    }
}

/// What tells the messages of every topic apart, and makes the fewest scans.
fn key<'a, T: Iterator<Item = &'a str>>(
    sightings: &[Sighting],
    topics: &impl Fn(&Place) -> T,
) -> Key {
    // As a rule every number has its time, and every time its number.
    let mut times = BTreeMap::new();
    let mut numbers = BTreeMap::new();
    let is_pair = |Sighting {
                       sequence, nanos, ..
                   }: &Sighting| {
        *times.entry(*sequence).or_insert(*nanos) == *nanos
            && *numbers.entry(*nanos).or_insert(*sequence) == *sequence
    };
    if sightings.iter().all(is_pair) {
        return Key::Sequence;
    }
    // A topic with two times under one number is of two scans; as with two numbers at one time.
    let mut by_number: BTreeMap<(&str, u64), u64> = BTreeMap::new();
    let mut by_time: BTreeMap<(&str, u64), u64> = BTreeMap::new();
    let (mut numbers_tell, mut times_tell) = (true, true);
    let (mut all_numbers, mut all_times) = (BTreeSet::new(), BTreeSet::new());
    for Sighting {
        sequence,
        nanos,
        place,
    } in sightings
    {
        let is_one_a_scan = |topic: &&str| is_ours(topic) && !is_repeated(topic);
        for topic in topics(place).filter(is_one_a_scan) {
            numbers_tell &= *by_number.entry((topic, *sequence)).or_insert(*nanos) == *nanos;
            times_tell &= *by_time.entry((topic, *nanos)).or_insert(*sequence) == *sequence;
            all_numbers.insert(*sequence);
            all_times.insert(*nanos);
        }
    }
    match (numbers_tell, times_tell) {
        (true, true) if all_numbers.len() < all_times.len() => Key::Sequence,
        (true, false) => Key::Sequence,
        (_, true) => Key::Time,
        (false, false) => Key::Both,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A message of a topic, with its number and time.
    type Seen = (&'static str, u64, u64);

    fn scans(seen: &[Seen]) -> Scans {
        let sighting = |(place, (_, sequence, nanos)): (usize, &Seen)| Sighting {
            sequence: *sequence,
            nanos: *nanos,
            place: Place {
                part: 0,
                block: Block::Run(place),
                channels: Some(Box::new([0])),
                is_shared: false,
            },
        };
        let topic = |place: &Place| match place.block {
            Block::Run(run) => std::iter::once(seen[run].0),
            Block::Chunk(_) => std::iter::once(""),
        };
        let sightings = seen.iter().enumerate().map(sighting).collect();
        Scans::of(sightings, topic)
    }

    /// The times of the scans, by their numbers, and how many messages each has.
    fn found(seen: &[Seen]) -> (Key, Vec<(u64, u64, usize)>) {
        let scans = scans(seen);
        let scan = |(number, held): (&u64, &Held)| (*number, held.nanos, held.places.len());
        (scans.key, scans.held.iter().map(scan).collect())
    }

    #[test]
    fn scans_go_by_their_numbers_in_whatever_order_they_stand() {
        let seen = [
            ("points", 8, 30),
            ("tf", 7, 20),
            ("tf", 8, 30),
            ("points", 7, 20),
        ];
        let expected = (Key::Sequence, vec![(7, 20, 2), (8, 30, 2)]);
        assert_eq!(found(&seen), expected);
    }

    #[test]
    fn scans_of_one_time_are_told_apart_by_their_numbers() {
        let seen = [
            ("points", 0, 5),
            ("tf", 0, 5),
            ("points", 1, 5),
            ("tf", 1, 5),
        ];
        assert_eq!(found(&seen), (Key::Sequence, vec![(0, 5, 2), (1, 5, 2)]));
    }

    #[test]
    fn without_numbers_scans_go_by_their_times() {
        let none = [
            ("points", 0, 20),
            ("tf", 0, 20),
            ("points", 0, 30),
            ("tf", 0, 30),
        ];
        let by_channel = [
            ("tf", 0, 20),
            ("points", 0, 20),
            ("tf", 1, 30),
            ("points", 1, 30),
            ("log", 0, 30),
            ("log", 1, 30),
        ];
        let through = [
            ("tf", 0, 20),
            ("points", 1, 20),
            ("tf", 2, 30),
            ("points", 3, 30),
        ];
        for (seen, last) in [(&none[..], 2), (&by_channel, 4), (&through, 2)] {
            let expected = (Key::Time, vec![(0, 20, 2), (1, 30, last)]);
            assert_eq!(found(seen), expected, "{seen:?}");
        }
    }

    #[test]
    fn messages_with_times_of_their_own_are_one_scan_by_their_number() {
        let seen = [
            ("tf", 0, 20),
            ("points", 0, 21),
            ("tf", 1, 30),
            ("points", 1, 32),
        ];
        assert_eq!(found(&seen), (Key::Sequence, vec![(0, 20, 2), (1, 30, 2)]));
    }

    #[test]
    fn of_two_recordings_in_one_every_scan_is_there() {
        let apart = [
            ("points", 0, 20),
            ("points", 1, 30),
            ("points", 0, 70),
            ("points", 1, 80),
        ];
        assert_eq!(found(&apart).1.len(), 4);
        let crossed = [
            ("points", 0, 20),
            ("points", 1, 30),
            ("points", 1, 20),
            ("points", 2, 30),
        ];
        assert_eq!(found(&crossed).0, Key::Both);
        assert_eq!(found(&crossed).1.len(), 4);
    }

    #[test]
    fn scans_keep_the_numbers_they_say_themselves_when_all_do() {
        let mut scans = scans(&[("points", 0, 20), ("points", 0, 30)]);
        assert!(!scans.renumber(&BTreeMap::from([(0, 60)])));
        assert!(!scans.renumber(&BTreeMap::from([(0, 60), (1, 60)])));
        assert!(scans.renumber(&BTreeMap::from([(0, 60), (1, 61)])));
        assert!(scans.held.keys().eq(&[60, 61]));
    }
}
