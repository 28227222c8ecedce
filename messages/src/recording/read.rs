//! Reads a recording: all its parts as one, finished or not.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use mcap::Attachment;

use super::error::ReadError;
use super::file::{FileSchema, RECORD_HEAD};
use super::layout::parse;
use super::metadata::{CHANGES, LEDGER, Metadata, NAME, ScanOrder, changes, ledger};
use super::part::Part;
use super::scan::Scan;
use super::scans::{Scans, is_repeated};
use super::shelf::Shelf;
use crate::change::Change;
use crate::ledger::Ledger;
use crate::record::{Codec, DIGESTS, Digest, Digests, Recorded};
use crate::{Owned, Topic};

/// A recording: all its parts as one, every message once.
#[derive(Debug)]
pub struct Recording {
    pub(super) path: PathBuf,
    pub(super) metadata: Metadata,
    pub(super) codec: Codec,
    /// Its files, in order.
    pub parts: Vec<Part>,
    pub(super) scans: Scans,
    pub(super) notes: Vec<String>,
    pub(super) remarks: Vec<String>,
    /// Whether scans of it are known to be missing.
    pub(super) lacks_scans: bool,
    /// How many recordings were written into one by others.
    pub(super) merged: usize,
    /// Memory of scans that are no longer needed.
    pub(super) spare: Vec<Vec<u8>>,
    pub(super) shelf: Shelf,
    /// Bytes of chunks that could not even be begun.
    pub(super) lost_bytes: u64,
    /// Some of its scans with what it does not hold of them.
    pub(super) completed: Vec<Recording>,
}

impl Recording {
    /// The path of its first part.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it says about itself.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Takes these settings for its own, where it says none; with what they say of a rail.
    pub fn suppose(&mut self, configuration: serde_json::Value) {
        let said = |key: &str| {
            configuration
                .get("capture")
                .and_then(|table| table.get(key))
        };
        if let Some(rail) = &mut self.metadata.rig.rail {
            rail.stride = said("stride")
                .and_then(|s| s.as_u64())
                .unwrap_or(rail.stride);
            rail.drift_px = said("drift")
                .and_then(|d| d.as_f64())
                .unwrap_or(rail.drift_px);
        }
        self.metadata.configuration = configuration;
        let Metadata { rig, reference, .. } = &self.metadata;
        self.codec = Codec::new(rig.clone(), *reference);
    }

    /// Whether it is a proof: of what it does not hold it has the digests.
    pub fn is_proof(&self) -> bool {
        self.channels().contains_key(DIGESTS)
    }

    /// What a scan of it was made with, by what it says now.
    pub fn settings_of(&self, scan: u64) -> BTreeMap<String, Digest> {
        let Metadata {
            configuration, rig, ..
        } = &self.metadata;
        Digests::of_settings(configuration, rig, &self.changes(), scan)
    }

    /// Of a proof the topics whose messages it holds or has digests of, as its first scan that can be read says.
    pub fn proven(&mut self) -> BTreeSet<String> {
        let scans: Vec<u64> = match self.is_proof() {
            true => self.scans().collect(),
            false => Vec::new(),
        };
        let said = scans.into_iter().find_map(|scan| {
            let scan = self.scan_of(scan, |topic| topic == DIGESTS).ok()?;
            let digests = scan.digests().ok().flatten();
            self.reuse(scan);
            digests
        });
        said.unwrap_or_default().messages.into_keys().collect()
    }

    /// Reads these scans from now on out of another recording that holds more of them.
    pub fn complete(&mut self, fuller: Self) {
        self.completed.push(fuller);
    }

    /// Whether it has messages of this topic, of all scans or of those that are read out of a fuller recording.
    pub fn holds(&self, topic: &str) -> bool {
        let holds = |recording: &Self| recording.channels().contains_key(topic);
        holds(self) || self.completed.iter().any(holds)
    }

    /// What turns its messages back.
    pub fn codec(&self) -> &Codec {
        &self.codec
    }

    /// What is wrong with it or left out of it, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// How it was read, where that is not as this program writes it, a sentence each: nothing is missing for that.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Whether scans are known to be missing, or cannot be read: what is made of it is then less than it was.
    pub fn lacks_scans(&self) -> bool {
        self.lacks_scans || self.unreadable_bytes() > 0
    }

    /// Whether all its parts are finished.
    pub fn is_complete(&self) -> bool {
        self.parts.iter().all(|part| part.contents.is_finished) && self.notes.is_empty()
    }

    /// The ledger of the run, which a finished recording has; the account of one run is not that of several.
    pub fn ledger(&self) -> Option<Ledger> {
        if self.merged > 1 {
            return None;
        }
        let records = self.parts.iter().flat_map(|part| &part.contents.metadata);
        records
            .filter(|(_, record)| record.name == LEDGER)
            .filter_map(|(_, r)| ledger(r))
            .next_back()
    }

    /// The settings that were changed while it was recorded, in order, by its own scans' numbers; without those that hold
    /// for none of its scans.
    pub fn changes(&self) -> Vec<Change> {
        let records = self.parts.iter().flat_map(|part| &part.contents.metadata);
        let told = records
            .filter(|(_, record)| record.name == CHANGES)
            .filter_map(|(_, r)| changes(r));
        // Every record tells all that were made until then.
        let mut changes = told.max_by_key(Vec::len).unwrap_or_default();
        let last = self.scans().next_back();
        changes.retain(|change| last.is_some_and(|last| change.from <= last));
        changes
    }

    /// The scans it holds, in order.
    pub fn scans(&self) -> impl DoubleEndedIterator<Item = u64> + ExactSizeIterator {
        self.scans.held.keys().copied()
    }

    /// When a scan was taken, in nanoseconds since 1970.
    pub fn nanos(&self, scan: u64) -> Option<u64> {
        self.scans.held.get(&scan).map(|held| held.nanos)
    }

    /// Of every scan which topics it has.
    pub fn topics_by_scan(&self) -> impl Iterator<Item = (u64, BTreeSet<&str>)> {
        self.scans.held.iter().map(|(sequence, held)| {
            let places = held.places.iter();
            let topics = places.flat_map(|place| self.parts[place.part].topics(place));
            (*sequence, topics.collect())
        })
    }

    /// The scans that have a message of every data topic of the recording, in order.
    pub fn whole_scans(&self) -> Vec<u64> {
        let recorded = self.channels();
        let mut data = Topic::all(&self.metadata.rig);
        data.retain(|topic| recorded.contains_key(&*topic.name));
        match data.is_empty() {
            true => Vec::new(),
            false => self.scans_with(&data),
        }
    }

    /// The scans that have a message of each of these topics, in order.
    pub fn scans_with(&self, wanted: &[Topic]) -> Vec<u64> {
        let has_all = |topics: &BTreeSet<&str>| wanted.iter().all(|t| topics.contains(&*t.name));
        let scans = self.topics_by_scan();
        scans
            .filter(|(_, topics)| has_all(topics))
            .map(|(scan, _)| scan)
            .collect()
    }

    /// All channels there are: topic, message encoding, schema.
    pub fn channels(&self) -> BTreeMap<&str, (&str, Option<&FileSchema>)> {
        let mut channels = BTreeMap::new();
        for Part { contents, .. } in &self.parts {
            for channel in contents.channels.values() {
                let schema = contents.schemas.get(&channel.schema_id);
                channels.insert(&*channel.topic, (&*channel.message_encoding, schema));
            }
        }
        channels
    }

    /// Reads a scan: all its messages.
    ///
    /// # Errors
    /// When it is not there, or damaged.
    pub fn scan(&mut self, scan: u64) -> Result<Scan, ReadError> {
        self.scan_of(scan, |_| true)
    }

    /// Reads of a scan the messages of the topics that are wanted, and no more of the file than holds them.
    ///
    /// # Errors
    /// When it is not there, or damaged.
    pub fn scan_of(
        &mut self,
        sequence: u64,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<Scan, ReadError> {
        self.scan_where(sequence, wanted, |error, _| Err(error))
    }

    /// Reads of a scan what can be read, and how many bytes cannot.
    ///
    /// # Errors
    /// When there is no such scan, or the system fails.
    pub fn salvage(&mut self, sequence: u64) -> Result<(Scan, u64), ReadError> {
        let mut unreadable = 0;
        let scan = self.scan_where(
            sequence,
            |_| true,
            |_, bytes| {
                unreadable += bytes;
                Ok(())
            },
        )?;
        Ok((scan, unreadable))
    }

    /// Bytes that belong to no scan: torn ends, and chunks of which not even the beginning can be read.
    pub fn unreadable_bytes(&self) -> u64 {
        let torn = |part: &Part| match part.contents.is_finished {
            true => 0,
            false => part.bytes - part.contents.whole_until,
        };
        self.parts.iter().map(torn).sum::<u64>() + self.lost_bytes
    }

    /// Its channels in the order they are defined: topic, message encoding, schema.
    pub fn definitions(&self) -> Vec<(&str, &str, Option<&FileSchema>)> {
        let mut definitions: Vec<(&str, &str, Option<&FileSchema>)> = Vec::new();
        let fuller = self.completed.iter().flat_map(|fuller| &fuller.parts);
        for Part { contents, .. } in self.parts.iter().chain(fuller) {
            for channel in contents.channels.values() {
                if definitions
                    .iter()
                    .all(|(topic, ..)| *topic != channel.topic)
                {
                    let schema = contents.schemas.get(&channel.schema_id);
                    definitions.push((&channel.topic, &channel.message_encoding, schema));
                }
            }
        }
        definitions
    }

    /// Its metadata besides what it says about itself.
    pub fn further_metadata(&self) -> impl Iterator<Item = &mcap::records::Metadata> {
        let records = self.parts.iter().flat_map(|part| &part.contents.metadata);
        records
            .map(|(_, record)| record)
            .filter(|record| record.name != NAME && record.name != ScanOrder::NAME)
    }

    /// Its attachments, those of the same name once.
    ///
    /// # Errors
    /// When one cannot be read.
    pub fn attachments(&mut self) -> Result<Vec<Attachment<'static>>, ReadError> {
        let mut attachments: Vec<Attachment<'static>> = Vec::new();
        for part in &mut self.parts {
            for index in &part.contents.attachments {
                if attachments.iter().any(|known| known.name == index.name) {
                    continue;
                }
                let attachment = attachment_at(&mut part.file, index);
                attachments.push(attachment.map_err(|source| ReadError::Damaged {
                    path: part.path.clone(),
                    offset: index.offset,
                    source,
                })?);
            }
        }
        Ok(attachments)
    }

    /// Reads a scan; what is damaged, and how many bytes that is, is for `on_damage` to judge.
    fn scan_where(
        &mut self,
        sequence: u64,
        wanted: impl Fn(&str) -> bool,
        mut on_damage: impl FnMut(ReadError, u64) -> Result<(), ReadError>,
    ) -> Result<Scan, ReadError> {
        let has_it = |fuller: &&mut Self| fuller.scans.held.contains_key(&sequence);
        if let Some(fuller) = self.completed.iter_mut().find(has_it) {
            return fuller.scan_where(sequence, wanted, on_damage);
        }
        let key = self.scans.key;
        let Some(held) = self.scans.held.get(&sequence) else {
            return Err(ReadError::NoScan {
                scan: sequence,
                held: self.held(),
            });
        };
        let mut scan = Scan {
            sequence,
            nanos: held.nanos,
            ..Scan::default()
        };
        let mut seen: BTreeMap<String, usize> = BTreeMap::new();
        for place in &held.places {
            let part = &mut self.parts[place.part];
            if !part.topics(place).any(&wanted) {
                continue;
            }
            let loaded = self
                .shelf
                .load(&mut part.file, &part.contents, place, &mut self.spare);
            let chunk = match loaded {
                Ok(chunk) => chunk,
                Err(source) => {
                    let (offset, bytes) = part.contents.span(place.block);
                    let path = part.path.clone();
                    let error = ReadError::Damaged {
                        path,
                        offset,
                        source,
                    };
                    on_damage(error, bytes)?;
                    continue;
                }
            };
            let mut taken = Vec::new();
            for (header, range) in chunk.messages() {
                let Some(channel) = part.contents.channels.get(&header.channel_id) else {
                    continue;
                };
                let topic = &channel.topic;
                let key = match part.foreign.contains(&header.channel_id) {
                    true => key.of_foreign(),
                    false => key,
                };
                if held.has(key, header.sequence, header.log_time) && wanted(topic) {
                    taken.push((topic.clone(), range.clone()));
                }
            }
            let (bytes, ranges) = chunk.take(taken.iter().map(|(_, range)| range), &mut self.spare);
            let at = scan.chunks.len();
            scan.chunks.push(bytes);
            for ((topic, _), range) in taken.into_iter().zip(ranges) {
                if let Some(&known) = seen.get(&topic) {
                    let (_, chunk, first) = &scan.messages[known];
                    if scan.chunks[*chunk][first.clone()] != scan.chunks[at][range]
                        && self.codec.is_data(&topic)
                    {
                        scan.contradicted.push(topic);
                    }
                    continue;
                }
                if !is_repeated(&topic) {
                    seen.insert(topic.clone(), scan.messages.len());
                }
                scan.messages.push((topic, at, range));
            }
        }
        Ok(scan)
    }

    /// Takes back the memory of a scan, for the next one that is read.
    pub fn reuse(&mut self, scan: Scan) {
        self.spare.extend(scan.chunks);
    }

    /// Reads one message of a data topic.
    ///
    /// # Errors
    /// When it is not there, or damaged.
    pub fn read<M: Recorded>(&mut self, scan: u64, topic: &Topic) -> Result<Owned<M>, ReadError> {
        let codec = self.codec.clone();
        self.scan_of(scan, |name| name == topic.name || codec.refers(topic, name))?
            .decode(&codec, topic)
    }

    /// The scans there are, in words.
    pub fn held(&self) -> String {
        let mut runs: Vec<(u64, u64)> = Vec::new();
        for scan in self.scans() {
            match runs.last_mut() {
                Some((_, last)) if *last + 1 == scan => *last = scan,
                _ => runs.push((scan, scan)),
            }
        }
        let words = runs.iter().map(|(first, last)| match last - first {
            0 => first.to_string(),
            _ => format!("{first} to {last}"),
        });
        let words: Vec<_> = words.collect();
        if words.is_empty() {
            "none".to_owned()
        } else {
            words.join(", ")
        }
    }
}

/// Reads an attachment.
fn attachment_at(
    file: &mut File,
    index: &mcap::records::AttachmentIndex,
) -> Result<Attachment<'static>, mcap::McapError> {
    use io::Seek;
    file.seek(io::SeekFrom::Start(index.offset + RECORD_HEAD))?;
    let mut body = Vec::new();
    let length = index.length.saturating_sub(RECORD_HEAD);
    file.by_ref().take(length).read_to_end(&mut body)?;
    match parse(mcap::records::op::ATTACHMENT, &body)? {
        mcap::records::Record::Attachment { header, data, .. } => Ok(Attachment {
            log_time: header.log_time,
            create_time: header.create_time,
            name: header.name,
            media_type: header.media_type,
            data: data.into_owned().into(),
        }),
        _ => Err(mcap::McapError::UnexpectedEof),
    }
}
