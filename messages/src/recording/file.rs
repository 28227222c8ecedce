//! What an MCAP file holds, finished or not: by its index where it has one, else from record to record.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;

use binrw::BinRead;
use mcap::records::{self, MessageHeader, Record, op};
use mcap::{MAGIC, McapError};

use super::layout::{is_whole, parse};
use super::metadata::NAME;
use super::scans::Block;

/// Opcode and length in front of every record.
pub const RECORD_HEAD: u64 = 1 + 8;
/// No record of a scan is longer, whatever a damaged file says.
const LONGEST_RECORD: usize = 2 << 30;
/// Messages outside of chunks are read so many at once: not all of a file whose messages have one number and time.
const LONGEST_RUN: u64 = 64 << 20;
/// Records outside of chunks are small: metadata at most.
const LONGEST_SMALL_RECORD: u64 = 256 << 20;

/// A kind of message, as a file says it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileSchema {
    /// Its name, such as `foxglove.RawImage`.
    pub name: String,
    /// How it is written down: `protobuf` or `jsonschema`.
    pub encoding: String,
    /// The schema itself.
    pub data: Vec<u8>,
}

/// Everything a file holds but its messages.
#[derive(Debug, Default)]
pub struct Contents {
    /// The program that wrote it, as it names itself.
    pub library: String,
    /// By their numbers.
    pub schemas: BTreeMap<u16, FileSchema>,
    /// By their numbers.
    pub channels: BTreeMap<u16, records::Channel>,
    /// In the order they stand.
    pub chunks: Vec<records::ChunkIndex>,
    /// In the order they stand.
    pub metadata: Vec<(records::MetadataIndex, records::Metadata)>,
    /// Where they stand; they are not read.
    pub attachments: Vec<records::AttachmentIndex>,
    /// Messages a channel.
    pub counts: BTreeMap<u16, u64>,
    /// Whether the file ends as it should.
    pub is_finished: bool,
    /// Where what is whole ends; what comes after is torn, or the file's own index.
    pub whole_until: u64,
    /// Message indexes of the last chunk, of an unfinished file: they may be torn and are made again.
    pub last_indexes: Vec<records::MessageIndex>,
    /// Messages outside of chunks, in the order they stand.
    pub runs: Vec<Run>,
    /// Whether the file's own index tells where every scan is, as in files that this program wrote. Of others only reading
    /// them through does: their chunks hold what they will, and what an index says of times need not be so.
    pub is_indexed: bool,
    /// Whether its index is there but damaged.
    pub has_damaged_index: bool,
}

/// Messages outside of chunks: records that stand one after the other, all with the same number and time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Run {
    /// Where they stand.
    pub range: Range<u64>,
    /// What they have in common.
    pub group: Group,
}

/// Messages of a chunk or run that have number and time in common.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Their sequence number.
    pub sequence: u32,
    /// When they were logged, in nanoseconds since 1970.
    pub nanos: u64,
    /// Their channels, in order.
    pub channels: Vec<u16>,
}

impl Group {
    fn of(header: &MessageHeader) -> Self {
        Self {
            sequence: header.sequence,
            nanos: header.log_time,
            channels: vec![header.channel_id],
        }
    }

    /// Takes a message in, when it is of this group.
    fn takes(&mut self, header: &MessageHeader) -> bool {
        let is_of_it = (self.sequence, self.nanos) == (header.sequence, header.log_time);
        if is_of_it && let Err(place) = self.channels.binary_search(&header.channel_id) {
            self.channels.insert(place, header.channel_id);
        }
        is_of_it
    }
}

impl Contents {
    /// Looks into a file; `None` when it is not MCAP.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn of(file: &mut File) -> io::Result<Option<Self>> {
        let len = file.seek(SeekFrom::End(0))?;
        let mut magic = [0; MAGIC.len()];
        file.rewind()?;
        if len < MAGIC.len() as u64 || !file.read_exact(&mut magic).is_ok_and(|()| magic == *MAGIC)
        {
            return Ok(None);
        }
        let ending = Ending::of(file, len)?;
        let told = match &ending {
            Ending::Summary(summary) => Self::from_summary(file, len, summary)?,
            _ => None,
        };
        let mut contents = match told {
            Some(contents) => contents,
            None => Self::from_records(file, len, ending.is_there())?,
        };
        contents.has_damaged_index = matches!(ending, Ending::Damaged);
        contents.is_indexed &= contents.library.starts_with(NAME)
            && contents.runs.is_empty()
            && contents
                .chunks
                .iter()
                .all(|chunk| !chunk.message_index_offsets.is_empty());
        Ok(Some(contents))
    }

    /// By the file's own index; `None` when it leaves out what is needed.
    fn from_summary(file: &mut File, len: u64, summary: &[u8]) -> io::Result<Option<Self>> {
        let mut contents = Self {
            is_finished: true,
            is_indexed: true,
            whole_until: len,
            ..Self::default()
        };
        let (mut stats, mut metadata_indexes, mut next) = (None, Vec::new(), 0);
        while next < summary.len() {
            let Some((opcode, body)) = record_in(summary, next) else {
                return Ok(None);
            };
            next = body.end;
            match parse(opcode, &summary[body]) {
                Ok(Record::Statistics(record)) => stats = Some(record),
                Ok(Record::ChunkIndex(index)) => contents.chunks.push(index),
                Ok(Record::AttachmentIndex(index)) => contents.attachments.push(index),
                Ok(Record::MetadataIndex(index)) => metadata_indexes.push(index),
                Ok(record) => contents.define(&record),
                Err(_) => return Ok(None),
            }
        }
        let Some(stats) = stats else {
            return Ok(None);
        };
        let schemas = &contents.schemas;
        let knows_schema = |channel: &records::Channel| {
            channel.schema_id == 0 || schemas.contains_key(&channel.schema_id)
        };
        let tells_all = contents.channels.len() == stats.channel_count as usize
            && contents.channels.values().all(knows_schema)
            && contents.attachments.len() == stats.attachment_count as usize
            && contents.chunks.len() == stats.chunk_count as usize
            && metadata_indexes.len() == stats.metadata_count as usize
            && (stats.message_count == 0 || stats.chunk_count > 0);
        if !tells_all {
            return Ok(None);
        }
        if let Ok(Some(Record::Header(header))) = record_at(file, MAGIC.len() as u64, len) {
            contents.library = header.library;
        }
        let by_place = |chunk: &records::ChunkIndex| chunk.chunk_start_offset;
        contents.chunks.sort_by_key(by_place);
        contents.counts = stats.channel_message_counts;
        for index in metadata_indexes {
            if let Some(Record::Metadata(metadata)) = record_at(file, index.offset, len)? {
                contents.metadata.push((index, metadata));
            }
        }
        let is_all = contents.is_all(file, len)?;
        Ok(is_all.then_some(contents))
    }

    /// Whether there is no message outside of the chunks that are known.
    fn is_all(&self, file: &mut File, len: u64) -> io::Result<bool> {
        let chunks = self.chunks.iter().map(|chunk| {
            let length = chunk
                .chunk_length
                .saturating_add(chunk.message_index_length);
            (chunk.chunk_start_offset, length)
        });
        let metadata = self
            .metadata
            .iter()
            .map(|(index, _)| (index.offset, index.length));
        let attachments = self
            .attachments
            .iter()
            .map(|index| (index.offset, index.length));
        let known: BTreeMap<u64, u64> = chunks.chain(metadata).chain(attachments).collect();
        let mut next = MAGIC.len() as u64;
        loop {
            if let Some(length) = known.get(&next) {
                next = next.saturating_add(*length);
                continue;
            }
            match head_at(file, next, len)? {
                Some((op::DATA_END | op::FOOTER, _)) => return Ok(true),
                None | Some((op::MESSAGE | op::CHUNK, _)) => return Ok(false),
                Some((_, body)) => next = body.end,
            }
        }
    }

    /// From record to record, up to where the file is torn, or to the end of one that `ends` as it should.
    fn from_records(file: &mut File, len: u64, ends: bool) -> io::Result<Self> {
        let mut contents = Self {
            whole_until: MAGIC.len() as u64,
            ..Self::default()
        };
        let mut counted: Vec<BTreeMap<u16, u64>> = Vec::new();
        let mut is_over = false;
        loop {
            let start = contents.whole_until;
            let Some((opcode, body)) = head_at(file, start, len)? else {
                break;
            };
            let length = body.end - start;
            match opcode {
                op::DATA_END | op::FOOTER => {
                    is_over = true;
                    break;
                }
                op::MESSAGE => {
                    let Some(header) = message_header(file, &body)? else {
                        break;
                    };
                    contents.add_to_runs(&header, start..body.end);
                }
                op::CHUNK => {
                    let Some(index) = chunk_index(file, start, length)? else {
                        break;
                    };
                    contents.chunks.push(index);
                    counted.push(BTreeMap::new());
                }
                op::ATTACHMENT => match attachment_index(file, start, length)? {
                    Some(index) => contents.attachments.push(index),
                    None => break,
                },
                op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA | op::MESSAGE_INDEX => {
                    match record_at(file, start, len)? {
                        Some(Record::Header(header)) => contents.library = header.library,
                        Some(Record::Metadata(metadata)) => {
                            let name = metadata.name.clone();
                            let index = records::MetadataIndex {
                                offset: start,
                                length,
                                name,
                            };
                            contents.metadata.push((index, metadata));
                        }
                        Some(Record::Attachment { header, data, .. }) => {
                            contents.attachments.push(records::AttachmentIndex {
                                offset: start,
                                length,
                                log_time: header.log_time,
                                create_time: header.create_time,
                                data_size: data.len() as u64,
                                name: header.name,
                                media_type: header.media_type,
                            });
                        }
                        Some(Record::MessageIndex(index)) => {
                            if let (Some(chunk), Some(counts)) =
                                (contents.chunks.last_mut(), counted.last_mut())
                            {
                                chunk.message_index_offsets.insert(index.channel_id, start);
                                chunk.message_index_length += length;
                                counts.insert(index.channel_id, index.records.len() as u64);
                            }
                        }
                        Some(record) => contents.define(&record),
                        None => break,
                    }
                }
                _ => {}
            }
            contents.whole_until = body.end;
        }
        if is_over && ends {
            // What its chunks hold nobody told: they are read through.
            contents.is_finished = true;
            contents.whole_until = len;
            return Ok(contents);
        }
        contents.is_indexed = true;
        contents.look_into_chunks(file, counted)?;
        Ok(contents)
    }

    /// A message outside of chunks.
    fn add_to_runs(&mut self, header: &MessageHeader, range: Range<u64>) {
        *self.counts.entry(header.channel_id).or_default() += 1;
        if let Some(run) = self.runs.last_mut()
            && run.range.end == range.start
            && run.range.end - run.range.start < LONGEST_RUN
            && run.group.takes(header)
        {
            run.range.end = range.end;
            return;
        }
        self.runs.push(Run {
            range,
            group: Group::of(header),
        });
    }

    /// Reads every chunk and says what it holds, in their order: groups by number and time. Schemas and channels that stand
    /// only there are known from then on.
    pub(super) fn look_through(&mut self, file: &mut File) -> Vec<Result<Vec<Group>, McapError>> {
        let mut spare = Vec::new();
        let mut looked = Vec::new();
        for index in std::mem::take(&mut self.chunks) {
            let chunk = Chunk::load(file, &index, &mut spare);
            self.chunks.push(index);
            looked.push(chunk.map(|chunk| {
                chunk
                    .definitions
                    .iter()
                    .for_each(|record| self.define(record));
                let groups = chunk.groups();
                spare.push(chunk.bytes);
                groups
            }));
        }
        looked
    }

    /// Reads those chunks whose message indexes do not tell everything: the first, for the channels it defines, and
    /// the last, which must be good; what follows the last good chunk is cut.
    fn look_into_chunks(
        &mut self,
        file: &mut File,
        mut counted: Vec<BTreeMap<u16, u64>>,
    ) -> io::Result<()> {
        // Beside messages outside of chunks there is nothing that ends with the last chunk.
        while let Some(last) = self.chunks.last_mut().filter(|_| self.runs.is_empty()) {
            let end = last.chunk_start_offset + last.chunk_length;
            if let Ok(chunk) = Chunk::load(file, last, &mut Vec::new()) {
                last.message_index_offsets.clear();
                last.message_index_length = 0;
                self.last_indexes = chunk.message_indexes();
                let counts = self
                    .last_indexes
                    .iter()
                    .map(|i| (i.channel_id, i.records.len() as u64));
                counted.pop();
                counted.push(counts.collect());
                // What follows the last chunk but its indexes is what a run ended with, and it did not end.
                self.cut(end);
                break;
            }
            let start = last.chunk_start_offset;
            self.chunks.pop();
            counted.pop();
            self.cut(start);
        }
        for (index, counts) in self.chunks.clone().iter().zip(&mut counted) {
            let is_known = counts
                .keys()
                .all(|channel| self.channels.contains_key(channel));
            if counts.is_empty() || !is_known {
                let Ok(chunk) = Chunk::load(file, index, &mut Vec::new()) else {
                    continue;
                };
                chunk
                    .definitions
                    .iter()
                    .for_each(|record| self.define(record));
                if counts.is_empty() {
                    for (header, _) in &chunk.messages {
                        *counts.entry(header.channel_id).or_default() += 1;
                    }
                }
            }
        }
        for (channel, count) in counted.iter().flatten() {
            *self.counts.entry(*channel).or_default() += count;
        }
        // Of the last chunk the indexes' places are not known before they are written: the channels are.
        if let (Some(last), Some(counts)) = (self.chunks.last_mut(), counted.last()) {
            last.message_index_offsets = counts.keys().map(|channel| (*channel, 0)).collect();
        }
        Ok(())
    }

    /// Where a chunk or run stands, and how long it is.
    pub(super) fn span(&self, block: Block) -> (u64, u64) {
        match block {
            Block::Chunk(chunk) => {
                let index = &self.chunks[chunk];
                (index.chunk_start_offset, index.chunk_length)
            }
            Block::Run(run) => {
                let range = &self.runs[run].range;
                (range.start, range.end - range.start)
            }
        }
    }

    fn cut(&mut self, end: u64) {
        self.whole_until = end;
        self.metadata.retain(|(index, _)| index.offset < end);
        self.attachments.retain(|index| index.offset < end);
    }

    fn define(&mut self, record: &Record<'_>) {
        match record {
            Record::Schema { header, data } => {
                let (name, encoding) = (header.name.clone(), header.encoding.clone());
                let schema = FileSchema {
                    name,
                    encoding,
                    data: data.to_vec(),
                };
                self.schemas.insert(header.id, schema);
            }
            Record::Channel(channel) => {
                self.channels.insert(channel.id, channel.clone());
            }
            _ => {}
        }
    }
}

/// How a file ends.
enum Ending {
    /// Torn.
    Torn,
    /// As it should, without an index.
    Bare,
    /// As it should, with an index that is damaged.
    Damaged,
    /// As it should, with this index, record by record.
    Summary(Vec<u8>),
}

impl Ending {
    fn of(file: &mut File, len: u64) -> io::Result<Self> {
        const FOOTER: u64 = RECORD_HEAD + 8 + 8 + 4;
        let Some(start) = len.checked_sub(FOOTER + MAGIC.len() as u64) else {
            return Ok(Self::Torn);
        };
        let mut end = [0; FOOTER as usize + MAGIC.len()];
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(&mut end)?;
        let (footer, magic) = end.split_at(FOOTER as usize);
        let Ok(Record::Footer(record)) = parse(footer[0], &footer[RECORD_HEAD as usize..]) else {
            return Ok(Self::Torn);
        };
        if magic != MAGIC {
            return Ok(Self::Torn);
        }
        if record.summary_start == 0 {
            return Ok(Self::Bare);
        }
        let Some(length) = start.checked_sub(record.summary_start) else {
            return Ok(Self::Damaged);
        };
        if length > LONGEST_SMALL_RECORD {
            // What is left out of memory is found by walking over the records.
            return Ok(Self::Bare);
        }
        let mut summary = vec![0; length as usize];
        file.seek(SeekFrom::Start(record.summary_start))?;
        file.read_exact(&mut summary)?;
        // The sum goes as far as the footer's own fields before it.
        let mut sum = crc32fast::Hasher::new();
        sum.update(&summary);
        sum.update(&footer[..FOOTER as usize - 4]);
        let is_good = record.summary_crc == 0 || record.summary_crc == sum.finalize();
        Ok(match is_good {
            true => Self::Summary(summary),
            false => Self::Damaged,
        })
    }

    fn is_there(&self) -> bool {
        !matches!(self, Self::Torn)
    }
}

/// The head of the message whose record's body stands here; `None` when it is too short. The file stands at the body.
fn message_header(file: &mut File, body: &Range<u64>) -> io::Result<Option<MessageHeader>> {
    if body.end - body.start < MESSAGE_HEAD as u64 {
        return Ok(None);
    }
    let mut head = [0; MESSAGE_HEAD];
    file.read_exact(&mut head)?;
    Ok(MessageHeader::read_le(&mut io::Cursor::new(head)).ok())
}

/// Opcode and body of the record at this place; `None` where there is no whole record.
fn head_at(file: &mut File, start: u64, len: u64) -> io::Result<Option<(u8, Range<u64>)>> {
    let mut head = [0; RECORD_HEAD as usize];
    if len.saturating_sub(start) < RECORD_HEAD {
        return Ok(None);
    }
    file.seek(SeekFrom::Start(start))?;
    file.read_exact(&mut head)?;
    let [opcode, length @ ..] = head;
    let body = start + RECORD_HEAD;
    let end = body
        .checked_add(u64::from_le_bytes(length))
        .filter(|end| *end <= len);
    Ok(end.filter(|_| opcode != 0).map(|end| (opcode, body..end)))
}

/// The small record at this place; `None` where there is no whole and sound one.
fn record_at(file: &mut File, start: u64, len: u64) -> io::Result<Option<Record<'static>>> {
    let Some((opcode, body)) = head_at(file, start, len)? else {
        return Ok(None);
    };
    if body.end - body.start > LONGEST_SMALL_RECORD {
        return Ok(None);
    }
    let mut bytes = vec![0; (body.end - body.start) as usize];
    file.read_exact(&mut bytes)?;
    Ok(parse(opcode, &bytes).ok().map(Record::into_owned))
}

/// The index of the attachment at this place; `None` when it is not sound.
fn attachment_index(
    file: &mut File,
    offset: u64,
    length: u64,
) -> io::Result<Option<records::AttachmentIndex>> {
    if length - RECORD_HEAD > LONGEST_SMALL_RECORD {
        return Ok(None);
    }
    let mut bytes = vec![0; (length - RECORD_HEAD) as usize];
    file.seek(SeekFrom::Start(offset + RECORD_HEAD))?;
    file.read_exact(&mut bytes)?;
    if !is_whole(op::ATTACHMENT, &bytes) {
        return Ok(None);
    }
    let mut read = io::Cursor::new(&bytes);
    let header: Result<records::AttachmentHeader, _> = BinRead::read_le(&mut read);
    let data_size = u64::read_le(&mut read);
    let (Ok(header), Ok(data_size)) = (header, data_size) else {
        return Ok(None);
    };
    // Behind the data stands their checksum.
    let end = read
        .position()
        .checked_add(data_size)
        .and_then(|end| end.checked_add(4));
    Ok(
        (end == Some(bytes.len() as u64)).then_some(records::AttachmentIndex {
            offset,
            length,
            log_time: header.log_time,
            create_time: header.create_time,
            data_size,
            name: header.name,
            media_type: header.media_type,
        }),
    )
}

/// The index of the chunk at this place; `None` when its header is not sound.
fn chunk_index(
    file: &mut File,
    start: u64,
    length: u64,
) -> io::Result<Option<records::ChunkIndex>> {
    // The header with the longest name of a compression there is.
    let mut bytes = vec![0; (length - RECORD_HEAD).min(64) as usize];
    file.seek(SeekFrom::Start(start + RECORD_HEAD))?;
    file.read_exact(&mut bytes)?;
    if !is_whole(op::CHUNK, &bytes) {
        return Ok(None);
    }
    let header: Result<records::ChunkHeader, _> = BinRead::read_le(&mut io::Cursor::new(&bytes));
    let Ok(header) = header else { return Ok(None) };
    let head = 8 + 8 + 8 + 4 + 4 + header.compression.len() as u64 + 8;
    if head.checked_add(header.compressed_size) != Some(length - RECORD_HEAD) {
        return Ok(None);
    }
    Ok(Some(records::ChunkIndex {
        message_start_time: header.message_start_time,
        message_end_time: header.message_end_time,
        chunk_start_offset: start,
        chunk_length: length,
        message_index_offsets: BTreeMap::new(),
        message_index_length: 0,
        compression: header.compression,
        compressed_size: header.compressed_size,
        uncompressed_size: header.uncompressed_size,
    }))
}

/// A chunk's records, decompressed and checked.
#[derive(Debug, Default)]
pub struct Chunk {
    /// The memory the messages lie in.
    pub bytes: Vec<u8>,
    /// Header, and where in the bytes the message lies.
    pub messages: Vec<(MessageHeader, Range<usize>)>,
    /// Schemas and channels.
    definitions: Vec<Record<'static>>,
    /// For each message where in the chunk its record starts.
    offsets: Vec<u64>,
}

impl Chunk {
    /// Reads a chunk and checks it, into memory from `spare` where there is some.
    ///
    /// # Errors
    /// When it cannot be read or is damaged.
    pub fn load(
        file: &mut File,
        index: &records::ChunkIndex,
        spare: &mut Vec<Vec<u8>>,
    ) -> Result<Self, McapError> {
        let (bytes, start) = unpacked(file, index, spare)?;
        Self::of(bytes, start)
    }

    /// Reads messages that stand outside of chunks, into memory from `spare` where there is some.
    ///
    /// # Errors
    /// When they cannot be read or are damaged.
    pub(super) fn of_run(
        file: &mut File,
        run: &Range<u64>,
        spare: &mut Vec<Vec<u8>>,
    ) -> Result<Self, McapError> {
        let mut bytes = spare.pop().unwrap_or_default();
        bytes.clear();
        file.seek(SeekFrom::Start(run.start))?;
        file.take(run.end - run.start).read_to_end(&mut bytes)?;
        match bytes.len() as u64 == run.end - run.start {
            true => Self::of(bytes, 0),
            false => Err(McapError::UnexpectedEof),
        }
    }

    /// The records that begin here.
    fn of(bytes: Vec<u8>, start: usize) -> Result<Self, McapError> {
        let mut chunk = Self::default();
        let mut next = start;
        while next < bytes.len() {
            let (opcode, body) = record_in(&bytes, next).ok_or(McapError::UnexpectedEoc)?;
            let place = next;
            next = body.end;
            match opcode {
                op::MESSAGE => {
                    let message = &bytes[body.clone()];
                    let head = message
                        .get(..MESSAGE_HEAD)
                        .ok_or(McapError::UnexpectedEoc)?;
                    let header = MessageHeader::read_le(&mut io::Cursor::new(head))?;
                    let message = body.start + MESSAGE_HEAD..body.end;
                    chunk.messages.push((header, message));
                    chunk.offsets.push((place - start) as u64);
                }
                op::SCHEMA | op::CHANNEL => {
                    let record = parse(opcode, &bytes[body])?.into_owned();
                    chunk.definitions.push(record);
                }
                _ => {}
            }
        }
        chunk.bytes = bytes;
        Ok(chunk)
    }

    /// What its messages have in common.
    pub(super) fn groups(&self) -> Vec<Group> {
        let mut groups: BTreeMap<(u64, u32), BTreeSet<u16>> = BTreeMap::new();
        for (header, _) in &self.messages {
            let group = groups
                .entry((header.log_time, header.sequence))
                .or_default();
            group.insert(header.channel_id);
        }
        let group = |((nanos, sequence), channels): ((u64, u32), BTreeSet<u16>)| Group {
            sequence,
            nanos,
            channels: channels.into_iter().collect(),
        };
        groups.into_iter().map(group).collect()
    }

    fn message_indexes(&self) -> Vec<records::MessageIndex> {
        let mut by_channel: BTreeMap<u16, Vec<records::MessageIndexEntry>> = BTreeMap::new();
        for ((header, _), offset) in self.messages.iter().zip(&self.offsets) {
            let entry = records::MessageIndexEntry {
                log_time: header.log_time,
                offset: *offset,
            };
            by_channel.entry(header.channel_id).or_default().push(entry);
        }
        let index = |(channel_id, records)| records::MessageIndex {
            channel_id,
            records,
        };
        by_channel.into_iter().map(index).collect()
    }
}

/// Channel, sequence and the two times in front of every message.
pub const MESSAGE_HEAD: usize = 2 + 4 + 8 + 8;

/// The scan of a chunk's first message, without reading more of the chunk than its beginning.
///
/// # Errors
/// When it cannot be read.
pub(super) fn first_sequence(
    file: &mut File,
    index: &records::ChunkIndex,
) -> Result<Option<u32>, McapError> {
    file.seek(SeekFrom::Start(index.compressed_data_offset()?))?;
    let packed = file.take(index.compressed_size);
    let mut records: Box<dyn Read> = match index.compression.as_str() {
        "" => Box::new(packed),
        "lz4" => Box::new(lz4::Decoder::new(packed)?),
        "zstd" => Box::new(zstd::Decoder::new(packed)?),
        other => return Err(McapError::UnsupportedCompression(other.to_owned())),
    };
    let mut rest = index.uncompressed_size;
    while rest >= RECORD_HEAD {
        let mut head = [0; RECORD_HEAD as usize];
        records.read_exact(&mut head)?;
        let [opcode, length @ ..] = head;
        if opcode == op::MESSAGE {
            let mut message = [0; MESSAGE_HEAD];
            records.read_exact(&mut message)?;
            let header = MessageHeader::read_le(&mut io::Cursor::new(message))?;
            return Ok(Some(header.sequence));
        }
        let length = u64::from_le_bytes(length);
        io::copy(&mut records.by_ref().take(length), &mut io::sink())?;
        rest = rest.saturating_sub(RECORD_HEAD).saturating_sub(length);
    }
    Ok(None)
}

/// A chunk's records as they were before they were packed, and where in the memory they begin.
fn unpacked(
    file: &mut File,
    index: &records::ChunkIndex,
    spare: &mut Vec<Vec<u8>>,
) -> Result<(Vec<u8>, usize), McapError> {
    let mut room = || {
        let mut room = spare.pop().unwrap_or_default();
        room.clear();
        room
    };
    let mut packed = room();
    file.seek(SeekFrom::Start(index.chunk_start_offset))?;
    // Whatever an index says, there is no more than the file holds.
    let length = index.chunk_length.min(file.metadata()?.len());
    packed.reserve(length as usize);
    file.take(length).read_to_end(&mut packed)?;
    if packed.len() as u64 != index.chunk_length {
        return Err(McapError::UnexpectedEof);
    }
    if !packed
        .get(RECORD_HEAD as usize..)
        .is_some_and(|body| is_whole(op::CHUNK, body))
    {
        return Err(McapError::UnexpectedEof);
    }
    let mut read = io::Cursor::new(&packed);
    read.set_position(RECORD_HEAD);
    let header = records::ChunkHeader::read_le(&mut read)?;
    let start = read.position() as usize;
    let available = (packed.len() - start) as u64;
    if header.compressed_size != available {
        let header = header.compressed_size;
        return Err(McapError::BadChunkLength { header, available });
    }
    if header.uncompressed_size > LONGEST_RECORD as u64 {
        return Err(McapError::ChunkTooLarge(header.uncompressed_size));
    }
    let records: &mut dyn Read = match header.compression.as_str() {
        "" => return checked(packed, start, &header),
        "lz4" => &mut lz4::Decoder::new(&packed[start..])?,
        "zstd" => &mut zstd::Decoder::with_buffer(&packed[start..])?,
        other => return Err(McapError::UnsupportedCompression(other.to_owned())),
    };
    let mut bytes = room();
    bytes.reserve(header.uncompressed_size.min(ROOM_AT_FIRST) as usize);
    records
        .take(header.uncompressed_size)
        .read_to_end(&mut bytes)?;
    spare.push(packed);
    checked(bytes, 0, &header)
}

/// What a chunk says it unpacks to is believed up to here; more memory is taken when it is there.
const ROOM_AT_FIRST: u64 = 64 << 20;

fn checked(
    bytes: Vec<u8>,
    start: usize,
    header: &records::ChunkHeader,
) -> Result<(Vec<u8>, usize), McapError> {
    let records = &bytes[start..];
    if records.len() as u64 != header.uncompressed_size {
        return Err(McapError::UnexpectedEoc);
    }
    let saved = header.uncompressed_crc;
    // Zero says that there is none.
    if saved != 0 {
        let calculated = crc32fast::hash(records);
        if calculated != saved {
            return Err(McapError::BadChunkCrc { saved, calculated });
        }
    }
    Ok((bytes, start))
}

/// Opcode and body of the record that begins here; `None` where there is no whole one.
pub(super) fn record_in(bytes: &[u8], start: usize) -> Option<(u8, Range<usize>)> {
    let (head, rest) = bytes.get(start..)?.split_at_checked(RECORD_HEAD as usize)?;
    let (opcode, length) = head.split_first()?;
    let length = usize::try_from(u64::from_le_bytes(length.try_into().ok()?)).ok()?;
    let body = start + RECORD_HEAD as usize;
    (length <= rest.len()).then(|| (*opcode, body..body + length))
}
