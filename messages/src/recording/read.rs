//! Reads a recording: all its parts as one, finished or not.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::ledger::Ledger;
use crate::record::{
    Codec, DIGESTS, DecodeError, Digest, Digests, OtherOwned, Recorded, Said, TRANSFORMS,
};
use crate::{AnyView, CurvesView, Header, Kind, Owned, Topic};
use mcap::{Attachment, McapError};
use thiserror::Error;

use super::file::{Contents, FileSchema, Group, RECORD_HEAD};
use super::layout::parse;
use super::metadata::Metadata;
use super::metadata::{CHANGES, Identity, LEDGER, MetadataError, NAME, ScanOrder, changes, ledger};
use super::names::{Prefix, is_ours, is_telling};
use super::parts::{count_parts, part_path, stray_parts};
use super::rebuilt::rebuilt;
use super::scans::{Block, Key, Place, Scans, Sighting, is_repeated};
use super::shelf::Shelf;
use super::sightings::sightings;
use crate::change::Change;

/// Why a recording cannot be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// It cannot be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// There is nothing in it.
    #[error("{} is empty: its writer ended before the first scan", .0.display())]
    Empty(PathBuf),
    /// It is not MCAP.
    #[error("{} is not an MCAP file", .0.display())]
    NotMcap(PathBuf),
    /// Another program's recording.
    #[error(
        "{} is an MCAP file of another program ({library}), not a recording of tricurve; its topics: {topics}",
        path.display()
    )]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The program, as the file names it.
        library: String,
        /// Its topics.
        topics: String,
    },
    /// Recordings of different rigs or settings were written into one file.
    #[error(
        "{} holds {count} recordings of different {what}, which another program merged: read those it was made of",
        path.display()
    )]
    Mixed {
        /// The file.
        path: PathBuf,
        /// How many.
        count: usize,
        /// What they differ in.
        what: &'static str,
    },
    /// Its metadata were left out, and its messages do not say what is needed either.
    #[error(
        "{} has no metadata, which another program left out, and its messages do not say {what}: rewrite it with its metadata",
        path.display()
    )]
    Silent {
        /// The file.
        path: PathBuf,
        /// What they do not say.
        what: &'static str,
    },
    /// It does not say what is needed to read it.
    #[error("cannot read {}: {source}", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// What is missing.
        source: MetadataError,
    },
    /// What it holds is damaged.
    #[error("{} is damaged at byte {offset}: {source}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// What is wrong.
        source: mcap::McapError,
    },
    /// There is no such scan.
    #[error("there is no scan {scan} in the recording; it holds {held}")]
    NoScan {
        /// The scan.
        scan: u64,
        /// Which there are.
        held: String,
    },
    /// A scan has no message of this topic.
    #[error("scan {scan} has no {topic}")]
    NoMessage {
        /// The scan.
        scan: u64,
        /// The topic.
        topic: String,
    },
    /// A message is not what its topic says.
    #[error("{topic} of scan {scan}: {source}")]
    Message {
        /// The scan.
        scan: u64,
        /// The topic.
        topic: String,
        /// What is wrong.
        source: DecodeError,
    },
}

/// One file of a recording.
#[derive(Debug)]
pub struct Part {
    /// Where it lies.
    pub path: PathBuf,
    pub(super) file: File,
    /// Its length.
    pub bytes: u64,
    /// What it holds.
    pub contents: Contents,
    /// Of a part that others wrote what its chunks hold.
    pub(super) looked: Option<Vec<Result<Vec<Group>, McapError>>>,
    /// Its channels of topics that are none of a recording's, where others wrote it.
    foreign: BTreeSet<u16>,
    /// What its topics had in front of their names.
    prefix: Prefix,
}

/// The messages of one scan.
#[derive(Clone, Debug, Default)]
pub struct Scan {
    /// Its number.
    pub sequence: u64,
    /// When it was taken, in nanoseconds since 1970.
    pub nanos: u64,
    /// The memory of the chunks its messages lie in.
    chunks: Vec<Vec<u8>>,
    /// Topic, chunk, and where in it the message lies.
    messages: Vec<(String, usize, Range<usize>)>,
    /// Topics of which there is another message that says something else.
    pub contradicted: Vec<String>,
}

impl Scan {
    /// Its messages, topic by topic, in the order they were recorded.
    pub fn messages(&self) -> impl Iterator<Item = (&str, &[u8])> {
        self.messages
            .iter()
            .map(|(topic, chunk, range)| (topic.as_str(), &self.chunks[*chunk][range.clone()]))
    }

    /// The message of a topic.
    pub fn message(&self, topic: &str) -> Option<&[u8]> {
        self.messages()
            .find(|(name, _)| *name == topic)
            .map(|(_, bytes)| bytes)
    }

    /// The message of a data topic, read into a room; gives its header but for the lengths. Whether what the room then
    /// shows is [sound](Recorded::is_sound) is for the caller to see.
    ///
    /// `curves` are those of the topic's view and channel, where they were read before.
    ///
    /// # Errors
    /// When there is none, or it is damaged.
    pub fn decode_room<M: Recorded>(
        &self,
        codec: &Codec,
        topic: &Topic,
        curves: Option<CurvesView<'_>>,
        room: &mut M::Room<'_>,
    ) -> Result<Header, ReadError> {
        let beside = |kind| match (kind, curves) {
            (Kind::Curves, Some(curves)) => Some(Said::Curves(curves)),
            _ => self.beside(codec, topic, kind),
        };
        let bytes = self.needed(topic)?;
        let header = codec
            .decode_room::<M>(topic, self.sequence, self.nanos, bytes, &beside, room)
            .map_err(|source| self.damaged(topic, source))?;
        self.placed(codec, header)
    }

    /// The header with where the camera stood, when it is one that moves.
    fn placed(&self, codec: &Codec, header: Header) -> Result<Header, ReadError> {
        if codec.rig().rail.is_none() {
            return Ok(header);
        }
        let transforms = self.message(TRANSFORMS);
        let said =
            transforms.and_then(|said| Some((codec.position_in(said)?, codec.sway_in(said))));
        let (position_m, sway) = said.ok_or_else(|| ReadError::NoMessage {
            scan: self.sequence,
            topic: TRANSFORMS.to_owned(),
        })?;
        Ok(Header {
            position_m,
            sway,
            ..header
        })
    }

    fn beside(&self, codec: &Codec, topic: &Topic, kind: Kind) -> Option<Said<'_>> {
        let bytes = self.message(&codec.beside(topic, kind)?.name)?;
        Some(Said::Recorded(bytes))
    }

    /// The error that says a message's indices lead out of it.
    pub fn unsound(&self, topic: &Topic) -> ReadError {
        self.damaged(topic, DecodeError::Unsound)
    }

    fn damaged(&self, topic: &Topic, source: DecodeError) -> ReadError {
        ReadError::Message {
            scan: self.sequence,
            topic: topic.name.clone(),
            source,
        }
    }

    fn needed(&self, topic: &Topic) -> Result<&[u8], ReadError> {
        self.message(&topic.name)
            .ok_or_else(|| ReadError::NoMessage {
                scan: self.sequence,
                topic: topic.name.clone(),
            })
    }

    /// The message of a data topic, as its makers made it.
    ///
    /// # Errors
    /// When there is none, or it is damaged.
    pub fn decode<M: Recorded>(&self, codec: &Codec, topic: &Topic) -> Result<Owned<M>, ReadError> {
        let beside = |kind| self.beside(codec, topic, kind);
        let mut message = codec
            .decode(
                topic,
                self.sequence,
                self.nanos,
                self.needed(topic)?,
                &beside,
            )
            .map_err(|source| self.damaged(topic, source))?;
        message.header = self.placed(codec, message.header)?;
        Ok(message)
    }

    /// The message of a topic of others.
    ///
    /// # Errors
    /// When there is none, or it is damaged.
    pub fn decode_other(
        &self,
        codec: &Codec,
        topic: &Topic,
    ) -> Result<(Header, OtherOwned), ReadError> {
        let bytes = self.needed(topic)?;
        let (header, message) = codec
            .decode_other(topic, self.sequence, self.nanos, bytes)
            .map_err(|source| self.damaged(topic, source))?;
        Ok((self.placed(codec, header)?, message))
    }

    /// Shows the message of a data topic of whatever kind.
    ///
    /// # Errors
    /// When there is none, or it is damaged.
    pub fn show<R>(
        &self,
        codec: &Codec,
        topic: &Topic,
        look: impl FnOnce(&Header, AnyView<'_>) -> R,
    ) -> Result<R, ReadError> {
        macro_rules! shown {
            ($kind:ident) => {{
                let message = self.decode::<crate::$kind>(codec, topic)?;
                Ok(look(&message.header, message.view().into()))
            }};
        }
        of_kind!(topic.kind, shown, _ => {
            let (header, message) = self.decode_other(codec, topic)?;
            Ok(look(&header, AnyView::Other(message.view())))
        })
    }

    /// Its digests, where it is one of a proof.
    ///
    /// # Errors
    /// When they are damaged.
    pub fn digests(&self) -> Result<Option<Digests>, ReadError> {
        let digests = self.message(DIGESTS).map(Digests::decode).transpose();
        digests.map_err(|source| ReadError::Message {
            scan: self.sequence,
            topic: DIGESTS.to_owned(),
            source,
        })
    }

    /// Of one of a proof: its messages that are not what their digests say, and settings, where these are known, that are not
    /// those it was made with, a sentence each.
    pub fn faults(
        &self,
        codec: &Codec,
        settings: Option<&BTreeMap<String, Digest>>,
    ) -> Vec<String> {
        let scan = self.sequence;
        let digests = match self.digests() {
            Ok(Some(digests)) => digests,
            Ok(None) => return vec![format!("scan {scan} has no {DIGESTS}")],
            Err(error) => return vec![error.to_string()],
        };
        let mut faults = Vec::new();
        if let Some(name) = settings.and_then(|settings| digests.changed(settings)) {
            faults.push(match name {
                "rig" => format!(
                    "the rig (views, channels, calibration) is not the one that scan {scan} was made with: it was changed after \
                     it was recorded"
                ),
                name => format!(
                    "the settings of {name} are not those that scan {scan} was made with: they were changed after it was recorded"
                ),
            });
        }
        for topic in Topic::all(codec.rig()) {
            if self.message(&topic.name).is_none() {
                continue;
            }
            let name = &topic.name;
            let is_it = |header: &Header, view: AnyView<'_>| {
                digests.messages.get(name) == Some(&Digest::of(header, &view))
            };
            match self.show(codec, &topic, is_it) {
                Ok(true) => {}
                Ok(false) => faults.push(format!(
                    "{name} of scan {scan} is not what its digest says: one of the two was changed after it was recorded"
                )),
                Err(error) => faults.push(error.to_string()),
            }
        }
        faults
    }
}

/// A recording: all its parts as one, every message once.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    metadata: Metadata,
    codec: Codec,
    /// Its files, in order.
    pub parts: Vec<Part>,
    scans: Scans,
    notes: Vec<String>,
    remarks: Vec<String>,
    /// Whether scans of it are known to be missing.
    lacks_scans: bool,
    /// How many recordings were written into one by others.
    merged: usize,
    /// Memory of scans that are no longer needed.
    spare: Vec<Vec<u8>>,
    shelf: Shelf,
    /// Bytes of chunks that could not even be begun.
    lost_bytes: u64,
    /// Some of its scans with what it does not hold of them.
    completed: Vec<Recording>,
}

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

/// What a file says it is.
struct SaidItIs {
    metadata: Metadata,
    identity: Identity,
    /// How many recordings others merged into it.
    recordings: usize,
}

impl Part {
    fn open(path: &Path) -> Result<Self, ReadError> {
        let io_error = |source| ReadError::Io {
            path: path.to_owned(),
            source,
        };
        let mut file = File::open(path).map_err(io_error)?;
        let metadata = file.metadata().map_err(io_error)?;
        if metadata.is_dir() {
            return Err(io_error(io::ErrorKind::IsADirectory.into()));
        }
        let bytes = metadata.len();
        let mut contents = match Contents::of(&mut file).map_err(io_error)? {
            Some(contents) => contents,
            None if is_beginning(&mut file, bytes) => {
                return Err(ReadError::Empty(path.to_owned()));
            }
            None => return Err(ReadError::NotMcap(path.to_owned())),
        };
        let mut part = Self {
            path: path.to_owned(),
            looked: None,
            foreign: BTreeSet::new(),
            prefix: Prefix::default(),
            bytes,
            contents: Contents::default(),
            file,
        };
        if !contents.is_indexed {
            part.looked = Some(contents.look_through(&mut part.file));
            let topics = contents.channels.values().map(|c| c.topic.as_str());
            part.prefix = Prefix::of(topics);
            for channel in contents.channels.values_mut() {
                channel.topic = part.prefix.without(&channel.topic).to_owned();
            }
            let is_foreign = |channel: &&mcap::records::Channel| !is_ours(&channel.topic);
            let foreign = contents.channels.values().filter(is_foreign);
            part.foreign = foreign.map(|channel| channel.id).collect();
        }
        part.contents = contents;
        Ok(part)
    }

    /// The topics that a scan has in a place.
    fn topics<'a>(&'a self, place: &Place) -> impl Iterator<Item = &'a str> + use<'a> {
        let contents = &self.contents;
        let ids: Vec<u16> = match (&place.channels, place.block) {
            (Some(channels), _) => channels.to_vec(),
            (None, Block::Chunk(chunk)) => {
                let offsets = &contents.chunks[chunk].message_index_offsets;
                offsets.keys().copied().collect()
            }
            (None, Block::Run(run)) => contents.runs[run].group.channels.clone(),
        };
        let channels = ids.into_iter().filter_map(|id| contents.channels.get(&id));
        channels.map(|channel| channel.topic.as_str())
    }

    /// What it says about itself; `None` when that was left out of what is a recording otherwise.
    fn metadata(&self) -> Result<Option<SaidItIs>, ReadError> {
        let records = self.contents.metadata.iter().map(|(_, record)| record);
        let own: Vec<_> = records.filter(|record| record.name == NAME).collect();
        let mut all = Vec::new();
        for record in own {
            let said = Metadata::from_record(record).map_err(|source| ReadError::Metadata {
                path: self.path.clone(),
                source,
            })?;
            all.push(said);
        }
        let names: BTreeSet<&str> = all.iter().map(|(_, i)| i.recording.as_str()).collect();
        let recordings = names.len();
        let mixed = |what| ReadError::Mixed {
            path: self.path.clone(),
            count: recordings,
            what,
        };
        let Some((first, others)) = all.split_first() else {
            return self.without_metadata().map(|()| None);
        };
        for (other, _) in others {
            if other.rig != first.0.rig {
                return Err(mixed("rigs (views, channels, image size or calibration)"));
            }
            if other.computing() != first.0.computing() {
                return Err(mixed("settings"));
            }
        }
        let (metadata, identity) = first.clone();
        Ok(Some(SaidItIs {
            metadata,
            identity,
            recordings,
        }))
    }

    /// Whether a file without our metadata is a recording all the same.
    fn without_metadata(&self) -> Result<(), ReadError> {
        let contents = &self.contents;
        let topics = contents.channels.values().map(|c| c.topic.as_str());
        let topics: BTreeSet<_> = topics.collect();
        let library = contents.library.clone();
        if topics.is_empty() && (library.is_empty() || library.starts_with(NAME)) {
            return Err(ReadError::Empty(self.path.clone()));
        }
        // Only recordings have messages of ours.
        let mut schemas = contents.schemas.values();
        let prefix = format!("{NAME}.");
        let has_ours = schemas.any(|schema| schema.name.starts_with(&prefix));
        match has_ours || topics.iter().any(|topic| is_telling(topic)) {
            true => Ok(()),
            false => Err(ReadError::Foreign {
                path: self.path.clone(),
                library,
                topics: topics.into_iter().collect::<Vec<_>>().join(", "),
            }),
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

/// Whether a file too short to be MCAP is the beginning of one.
fn is_beginning(file: &mut File, bytes: u64) -> bool {
    use io::Seek;
    let mut read = vec![0; bytes.min(mcap::MAGIC.len() as u64) as usize];
    bytes < mcap::MAGIC.len() as u64
        && file.rewind().is_ok()
        && file.read_exact(&mut read).is_ok()
        && mcap::MAGIC.starts_with(&read)
}
