//! Reads a recording: all its parts as one, finished or not.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::ledger::Ledger;
use crate::record::{Codec, DecodeError, Recorded, Said, TRANSFORMS};
use crate::{CurvesView, Header, Kind, Owned, Topic};
use mcap::Attachment;
use mcap::records::ChunkIndex;
use thiserror::Error;

use super::file::{Chunk, Contents, FileSchema, RECORD_HEAD, first_sequence};
use super::layout::parse;
use super::metadata::Metadata;
use super::metadata::{CHANGES, Identity, LEDGER, MetadataError, NAME, ScanOrder, changes, ledger};
use super::parts::{count_parts, part_path, stray_parts};
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
    file: File,
    /// Its length.
    pub bytes: u64,
    /// What it holds.
    pub contents: Contents,
}

/// A chunk with messages of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    part: usize,
    chunk: usize,
}

/// What is known of a scan without reading it.
#[derive(Clone, Debug, Default)]
struct Held {
    nanos: u64,
    places: Vec<Place>,
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
}

/// A recording: all its parts as one, every message once.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    metadata: Metadata,
    codec: Codec,
    /// Its files, in order.
    pub parts: Vec<Part>,
    scans: BTreeMap<u64, Held>,
    notes: Vec<String>,
    /// Memory of scans that are no longer needed.
    spare: Vec<Vec<u8>>,
    /// Bytes of chunks that could not even be begun.
    lost_bytes: u64,
}

/// Topics of which a scan may have several messages.
fn is_repeated(topic: &str) -> bool {
    topic == "log" || topic == "ledger"
}

impl Recording {
    /// Opens a recording by the path of its first part. Finished parts are not read but for their index; of
    /// unfinished ones all that is whole is there.
    ///
    /// # Errors
    /// When it is not a recording of this program, or cannot be read.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let mut notes = Vec::new();
        let first = Part::open(path)?;
        let (metadata, identity) = first.metadata()?;
        if identity.part > 0 {
            notes.push(format!(
                "{} is part {} of a recording; what its other parts hold is not here",
                path.display(),
                identity.part
            ));
        }
        let mut parts = vec![first];
        for number in 1..count_parts(path) {
            let path = part_path(path, number);
            let part = Part::open(&path);
            let belongs = part.and_then(|part| {
                let (_, of_part) = part.metadata()?;
                let expected = Identity {
                    part: identity.part + number,
                    ..identity.clone()
                };
                Ok((of_part == expected).then_some(part))
            });
            match belongs {
                Ok(Some(part)) => parts.push(part),
                Ok(None) => {
                    let path = path.display();
                    notes.push(format!(
                        "{path} belongs to another recording and is left out"
                    ));
                }
                Err(error) => notes.push(format!("a part is left out: {error}")),
            }
        }
        for part in parts.iter().filter(|part| !part.contents.is_finished) {
            let torn = part.bytes - part.contents.whole_until;
            notes.push(format!(
                "{} is unfinished: its writer ended before it; {torn} torn bytes at its end are left out",
                part.path.display()
            ));
        }
        let strays = stray_parts(path);
        let of_this = |stray: &&PathBuf| {
            let part = Part::open(stray).and_then(|part| part.metadata());
            part.is_ok_and(|(_, of_part)| of_part.recording == identity.recording)
        };
        if let Some(stray) = strays.iter().find(of_this) {
            notes.push(format!(
                "{} is missing, and {} and what comes after it is left out",
                part_path(path, count_parts(path)).display(),
                stray.display()
            ));
        }
        let codec = Codec::new(metadata.rig.clone(), metadata.reference);
        let path = path.to_owned();
        let mut recording = Self {
            path,
            metadata,
            codec,
            parts,
            scans: BTreeMap::new(),
            notes,
            spare: Vec::new(),
            lost_bytes: 0,
        };
        recording.find_scans();
        Ok(recording)
    }

    fn find_scans(&mut self) {
        for (number, part) in self.parts.iter_mut().enumerate() {
            let Part {
                path,
                file,
                contents,
                ..
            } = part;
            if let Some(order) = order(contents) {
                let mut order = order.into_iter();
                let (mut latest, mut scan) = (None, 0);
                for (chunk, index) in contents.chunks.iter().enumerate() {
                    let nanos = index.message_start_time;
                    if latest != Some(nanos) {
                        latest = Some(nanos);
                        scan = order.next().unwrap_or_default();
                    }
                    let held = self.scans.entry(scan).or_default();
                    held.nanos = nanos;
                    held.places.push(Place {
                        part: number,
                        chunk,
                    });
                }
                continue;
            }
            for (chunk, index) in contents.chunks.iter().enumerate() {
                match sequences(file, index) {
                    Ok(sequences) => {
                        for (sequence, nanos) in sequences {
                            let held = self.scans.entry(sequence).or_default();
                            held.nanos = nanos;
                            held.places.push(Place {
                                part: number,
                                chunk,
                            });
                        }
                    }
                    Err(error) => {
                        self.lost_bytes += index.chunk_length;
                        self.notes.push(format!(
                            "{} is damaged at byte {}: {error}",
                            path.display(),
                            index.chunk_start_offset
                        ));
                    }
                }
            }
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

    /// What turns its messages back.
    pub fn codec(&self) -> &Codec {
        &self.codec
    }

    /// What is wrong with it or left out of it, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Whether all its parts are finished.
    pub fn is_complete(&self) -> bool {
        self.parts.iter().all(|part| part.contents.is_finished) && self.notes.is_empty()
    }

    /// The ledger of the run, which a finished recording has.
    pub fn ledger(&self) -> Option<Ledger> {
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
        self.scans.keys().copied()
    }

    /// When a scan was taken, in nanoseconds since 1970.
    pub fn nanos(&self, scan: u64) -> Option<u64> {
        self.scans.get(&scan).map(|held| held.nanos)
    }

    /// Of every scan which topics it has.
    pub fn topics_by_scan(&self) -> impl Iterator<Item = (u64, BTreeSet<&str>)> {
        self.scans.iter().map(|(sequence, held)| {
            let topics = held.places.iter().flat_map(|place| {
                let contents = &self.parts[place.part].contents;
                let ids = contents.chunks[place.chunk].message_index_offsets.keys();
                ids.filter_map(|id| contents.channels.get(id))
                    .map(|c| c.topic.as_str())
            });
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
        for Part { contents, .. } in &self.parts {
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
        let Some(held) = self.scans.get(&sequence) else {
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
        let mut seen = BTreeSet::new();
        for place in &held.places {
            let Part {
                path,
                file,
                contents,
                ..
            } = &mut self.parts[place.part];
            let index = &contents.chunks[place.chunk];
            let topic = |id: &u16| contents.channels.get(id).map(|c| c.topic.as_str());
            if !index
                .message_index_offsets
                .keys()
                .filter_map(topic)
                .any(&wanted)
            {
                continue;
            }
            let chunk = match Chunk::load(file, index, &mut self.spare) {
                Ok(chunk) => chunk,
                Err(source) => {
                    let offset = index.chunk_start_offset;
                    let path = path.clone();
                    let error = ReadError::Damaged {
                        path,
                        offset,
                        source,
                    };
                    on_damage(error, index.chunk_length)?;
                    continue;
                }
            };
            let place = scan.chunks.len();
            for (header, range) in chunk.messages {
                let Some(topic) = topic(&header.channel_id) else {
                    continue;
                };
                let is_of_scan = u64::from(header.sequence) == sequence && wanted(topic);
                if is_of_scan && (is_repeated(topic) || seen.insert(topic.to_owned())) {
                    scan.messages.push((topic.to_owned(), place, range));
                }
            }
            scan.chunks.push(chunk.bytes);
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
        match Contents::of(&mut file).map_err(io_error)? {
            Some(contents) => Ok(Self {
                path: path.to_owned(),
                file,
                bytes,
                contents,
            }),
            None if is_beginning(&mut file, bytes) => Err(ReadError::Empty(path.to_owned())),
            None => Err(ReadError::NotMcap(path.to_owned())),
        }
    }

    fn metadata(&self) -> Result<(Metadata, Identity), ReadError> {
        let mut records = self.contents.metadata.iter().map(|(_, record)| record);
        let Some(record) = records.find(|record| record.name == NAME) else {
            let topics = self.contents.channels.values().map(|c| c.topic.as_str());
            let topics: BTreeSet<_> = topics.collect();
            let library = self.contents.library.clone();
            if topics.is_empty() && (library.is_empty() || library.starts_with(NAME)) {
                return Err(ReadError::Empty(self.path.clone()));
            }
            return Err(ReadError::Foreign {
                path: self.path.clone(),
                library,
                topics: topics.into_iter().collect::<Vec<_>>().join(", "),
            });
        };
        Metadata::from_record(record).map_err(|source| ReadError::Metadata {
            path: self.path.clone(),
            source,
        })
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

/// The scans of a finished part in the order of its chunks, each as often as the time changes from chunk to chunk.
fn order(contents: &Contents) -> Option<Vec<u64>> {
    let mut records = contents.metadata.iter().map(|(_, record)| record);
    let record = records.rfind(|record| record.name == ScanOrder::NAME)?;
    let one_time = |index: &ChunkIndex| index.message_start_time == index.message_end_time;
    let changes = |pair: &&[ChunkIndex]| pair[0].message_start_time != pair[1].message_start_time;
    let chunks = &contents.chunks;
    let count = chunks.windows(2).filter(changes).count() + usize::from(!chunks.is_empty());
    let is_told = contents.is_finished && chunks.iter().all(one_time);
    is_told.then(|| ScanOrder::from_record(record, count))?
}

/// The scans of a chunk, with their times.
fn sequences(file: &mut File, index: &ChunkIndex) -> Result<BTreeMap<u64, u64>, mcap::McapError> {
    // Our chunks hold one scan each: its first message tells it. Other programs may have packed them anew.
    if index.message_start_time == index.message_end_time {
        let first = first_sequence(file, index)?;
        return Ok(first
            .map(|s| (u64::from(s), index.message_start_time))
            .into_iter()
            .collect());
    }
    let chunk = Chunk::load(file, index, &mut Vec::new())?;
    Ok(chunk
        .messages
        .iter()
        .map(|(h, _)| (u64::from(h.sequence), h.log_time))
        .collect())
}
