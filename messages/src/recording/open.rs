//! Opens a recording: finds its parts, and the scans in them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::error::ReadError;
use super::metadata::{Identity, Metadata};
use super::names::is_ours;
use super::part::Part;
use super::parts::{count_parts, part_path, stray_parts};
use super::read::Recording;
use super::rebuilt::rebuilt;
use super::scans::{Key, Scans, Sighting};
use super::shelf::Shelf;
use super::sightings::sightings;
use crate::record::Codec;

impl Recording {
    /// Opens a recording by the path of its first part. Finished parts that this program wrote are not read but for their
    /// index; of unfinished ones all that is whole is there. What other programs rewrote is read through.
    ///
    /// # Errors
    /// When it is not a recording of this program, or cannot be read.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let first = Part::open(path)?;
        let said = first.metadata()?;
        let mut recording = Self {
            path: path.to_owned(),
            metadata: Metadata::unknown(),
            codec: Codec::new(Metadata::unknown().rig, 0),
            parts: vec![first],
            scans: Scans::default(),
            notes: Vec::new(),
            remarks: Vec::new(),
            lacks_scans: false,
            merged: 1,
            spare: Vec::new(),
            shelf: Shelf::default(),
            lost_bytes: 0,
            completed: Vec::new(),
        };
        recording.find_parts(said.as_ref().map(|said| &said.identity))?;
        recording.look_at_parts();
        recording.find_scans();
        recording.metadata = match said {
            Some(said) => {
                recording.merged = said.recordings;
                if said.recordings > 1 {
                    let count = said.recordings;
                    recording.remarks.push(format!(
                        "{count} recordings were merged into it by another program: scans that had the same number are numbered on"
                    ));
                }
                said.metadata
            }
            None => {
                recording.remarks.push(
                    "its metadata were left out when another program wrote it: views, channels, image size and cameras are \
                     those that its messages say, and the settings are not known"
                        .to_owned(),
                );
                rebuilt(&mut recording)?
            }
        };
        let Metadata { rig, reference, .. } = &recording.metadata;
        recording.codec = Codec::new(rig.clone(), *reference);
        recording.remark_others();
        Ok(recording)
    }

    /// Says which of its messages are of nodes that this program does not have.
    fn remark_others(&mut self) {
        let mut others: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (topic, (_, schema)) in self.channels() {
            let name = schema.and_then(|schema| schema.name.strip_prefix("tricurve."));
            let node = name.and_then(|name| Some(name.split_once('.')?.0));
            if let Some(node) = node.filter(|_| !self.codec.is_data(topic)) {
                let topics = others.entry(node.to_owned()).or_default();
                topics.insert(topic.to_owned());
            }
        }
        for (node, topics) in others {
            let first = topics.first().cloned().unwrap_or_default();
            let more = match topics.len() {
                1 => String::new(),
                many => format!(" and {} more", many - 1),
            };
            self.remarks.push(format!(
                "{first}{more}: made by the node {node}, which this program does not have; it can copy these messages, and \
                 neither play nor compare them"
            ));
        }
    }

    /// Adds the further parts, and says which cannot be.
    fn find_parts(&mut self, identity: Option<&Identity>) -> Result<(), ReadError> {
        let path = self.path.clone();
        if let Some(identity) = identity.filter(|identity| identity.part > 0) {
            self.notes.push(format!(
                "{} is part {} of a recording; what its other parts hold is not here",
                path.display(),
                identity.part
            ));
        }
        for number in 1..count_parts(&path) {
            let path = part_path(&path, number);
            let part = Part::open(&path);
            let belongs = part.and_then(|part| {
                let said = part.metadata()?;
                let expected = identity.map(|identity| Identity {
                    part: identity.part + number,
                    ..identity.clone()
                });
                let of_part = said.map(|said| said.identity);
                Ok(match (of_part, expected) {
                    (Some(of_part), Some(expected)) if of_part == expected => Some(Ok(part)),
                    (Some(_), Some(_)) => None,
                    _ => Some(Err(())),
                })
            });
            match belongs {
                Ok(Some(Ok(part))) => self.parts.push(part),
                Ok(Some(Err(()))) => {
                    self.lacks_scans = true;
                    self.notes.push(format!(
                        "nothing says whether {} belongs to it, since metadata were left out when it was rewritten: it is left \
                         out; read it by itself",
                        path.display()
                    ));
                }
                Ok(None) => self.notes.push(format!(
                    "{} belongs to another recording and is left out",
                    path.display()
                )),
                Err(error) => {
                    self.lacks_scans = true;
                    self.notes.push(format!("a part is left out: {error}"));
                }
            }
        }
        let strays = stray_parts(&path);
        let of_this = |stray: &&PathBuf| {
            let part = Part::open(stray).and_then(|part| part.metadata());
            part.is_ok_and(|said| {
                let (of_part, identity) = (said.map(|said| said.identity), identity);
                of_part.is_some_and(|of_part| {
                    identity.is_some_and(|identity| of_part.recording == identity.recording)
                })
            })
        };
        if let Some(stray) = strays.iter().find(of_this) {
            self.lacks_scans = true;
            self.notes.push(format!(
                "{} is missing, and {} and what comes after it is left out",
                part_path(&path, count_parts(&path)).display(),
                stray.display()
            ));
        }
        Ok(())
    }

    /// Says what is to be said of how the parts were written.
    fn look_at_parts(&mut self) {
        for part in &self.parts {
            let path = part.path.display();
            if !part.contents.is_finished {
                let torn = part.bytes - part.contents.whole_until;
                self.notes.push(format!(
                    "{path} is unfinished: its writer ended before it; {torn} torn bytes at its end are left out",
                ));
            }
            if part.contents.has_damaged_index {
                self.notes.push(format!(
                    "{path} has a damaged index; what it holds was found by reading it"
                ));
            }
            if !part.prefix.common.is_empty() {
                let prefix = &part.prefix.common;
                self.remarks.push(format!(
                    "topics in {path} are named {prefix}…, which is left out here"
                ));
            }
            if !part.prefix.others.is_empty() {
                self.lacks_scans = true;
                let (common, others) = (&part.prefix.common, part.prefix.others.join("…, "));
                self.notes.push(format!(
                    "{path} holds several recordings, by their topics' names {common}… and {others}…: only those of \
                     {common}… are read as one"
                ));
            }
        }
    }

    fn find_scans(&mut self) {
        let mut seen = Vec::new();
        for (number, part) in self.parts.iter_mut().enumerate() {
            for sighting in sightings(number, part) {
                match sighting {
                    Ok(sighting) => seen.push(sighting),
                    Err((offset, bytes, error)) => {
                        self.lost_bytes += bytes;
                        self.notes.push(format!(
                            "{} is damaged at byte {offset}: {error}",
                            part.path.display(),
                        ));
                    }
                }
            }
        }
        let parts = &self.parts;
        // Topics that only other programs have make no scan.
        let is_ours = |sighting: &Sighting| {
            let part = &parts[sighting.place.part];
            part.foreign.is_empty() || part.topics(&sighting.place).any(is_ours)
        };
        let (own, foreign) = seen.into_iter().partition(is_ours);
        self.scans = Scans::of(own, |place| parts[place.part].topics(place));
        self.number_by_statistics();
        self.add_foreign(foreign);
    }

    /// The numbers of these scans, where their own statistics say them.
    fn numbers_said(&mut self, scans: &[u64]) -> BTreeMap<u64, u64> {
        let said = |&scan: &u64| {
            let read = self.scan_of(scan, |topic| topic == "statistics").ok()?;
            let value: serde_json::Value =
                serde_json::from_slice(read.message("statistics")?).ok()?;
            self.reuse(read);
            Some((scan, value.get("scan")?.as_u64()?))
        };
        scans.iter().filter_map(said).collect()
    }

    /// Where numbers in the file tell nothing, or others than they were, the scans' own statistics may.
    fn number_by_statistics(&mut self) {
        let scans: Vec<u64> = self.scans.held.keys().copied().collect();
        let (Some(first), Some(last)) = (scans.first(), scans.last()) else {
            return;
        };
        let goes_by_numbers = self.scans.key == Key::Sequence;
        if goes_by_numbers {
            if self.parts.iter().all(|part| part.contents.is_indexed) {
                return;
            }
            let mut said = self.numbers_said(&[*first, *last]).into_iter();
            if said.all(|(number, said)| number == said) {
                return;
            }
        }
        let numbers = self.numbers_said(&scans);
        match self.scans.renumber(&numbers) {
            true => self.remarks.push(
                "its messages do not have the scans' numbers any more: those that the statistics say are taken".to_owned(),
            ),
            false if goes_by_numbers => {}
            false => self.remarks.push(
                "its messages do not have the scans' numbers any more: scans are counted in order of time, from 0".to_owned(),
            ),
        }
    }

    /// Messages of topics that recordings do not have go with the scan of their number and time, where there is one.
    fn add_foreign(&mut self, sightings: Vec<Sighting>) {
        if sightings.is_empty() {
            return;
        }
        let key = self.scans.key;
        let place = |sequence: u64, nanos: u64| match key {
            Key::Time => (nanos, 0),
            _ => (nanos, sequence),
        };
        let scans = self.scans.held.iter();
        let by_place: BTreeMap<(u64, u64), u64> = scans
            .map(|(number, held)| (place(held.sequence, held.nanos), *number))
            .collect();
        let mut left_out = BTreeSet::new();
        for sighting in sightings {
            let number = by_place.get(&place(sighting.sequence, sighting.nanos));
            match number.and_then(|number| self.scans.held.get_mut(number)) {
                Some(held) => held.add(sighting.place),
                None => left_out.extend(self.parts[sighting.place.part].topics(&sighting.place)),
            }
        }
        if !left_out.is_empty() {
            let topics = left_out.into_iter().collect::<Vec<_>>().join(", ");
            self.remarks.push(format!(
                "messages of other programs are of no scan and are left out: {topics}"
            ));
        }
    }
}
