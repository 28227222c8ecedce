//! MCAP files of any program, read from record to record: neither indexes, chunks nor a summary are needed.
//!
//! Of messages only the beginning is looked at, except in chunks that are compressed; what a message holds is read when it
//! is wanted, with its chunk, whose checksum is checked then.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::FileExt;
use std::rc::Rc;

use super::storage::{At, Coding, HEAD, Looked, Topics, Visit, Want};
use super::wire::Why;

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// Opcode and length in front of every record.
const RECORD_HEAD: u64 = 9;
/// Channel, number and two times in front of every message.
const MESSAGE_HEAD: usize = 2 + 4 + 8 + 8;
/// What is read at once where only beginnings matter.
const WINDOW: usize = 64 << 10;
/// The longest record that is looked at whole: schemas and channels.
const LONGEST_SMALL: u64 = 64 << 20;
/// The most bytes a chunk may hold, whatever a damaged file says.
const LONGEST_CHUNK: u64 = 4 << 30;
/// Chunks that are not compressed and longer are not read whole to check them.
const LONGEST_CHECKED: u64 = 64 << 20;
/// Bytes of chunks that are kept.
const KEPT: usize = 64 << 20;

mod op {
    pub(super) const FOOTER: u8 = 0x02;
    pub(super) const SCHEMA: u8 = 0x03;
    pub(super) const CHANNEL: u8 = 0x04;
    pub(super) const MESSAGE: u8 = 0x05;
    pub(super) const CHUNK: u8 = 0x06;
    pub(super) const CHUNK_INDEX: u8 = 0x08;
    pub(super) const STATISTICS: u8 = 0x0b;
    pub(super) const METADATA: u8 = 0x0c;
}

/// One MCAP file.
#[derive(Debug)]
pub(super) struct Mcap {
    file: File,
    length: u64,
    /// The latest chunks, the newest last.
    chunks: Vec<(u64, Rc<Vec<u8>>)>,
}

/// What is known while a file is gone through.
struct Pass<'a> {
    topics: &'a mut Topics,
    visit: &'a mut dyn Visit,
    looked: &'a mut Looked,
    number: usize,
    schemas: HashMap<u16, (String, String)>,
    channels: HashMap<u16, (usize, Want)>,
}

/// The records of a stretch of bytes, as far as they are here.
trait Stretch {
    /// So many bytes at a place, or fewer where it ends.
    fn get(&mut self, at: u64, count: usize) -> io::Result<&[u8]>;
}

impl Stretch for &[u8] {
    fn get(&mut self, at: u64, count: usize) -> io::Result<&[u8]> {
        let rest = usize::try_from(at)
            .ok()
            .and_then(|at| self.split_at_checked(at));
        let rest = rest.map_or(&[][..], |(_, rest)| rest);
        Ok(&rest[..count.min(rest.len())])
    }
}

/// A file, of which a window is held.
struct Window<'a> {
    file: &'a File,
    start: u64,
    held: Vec<u8>,
    /// Where the file is taken to end.
    end: u64,
}

impl<'a> Window<'a> {
    fn new(file: &'a File, end: u64) -> Self {
        Self {
            file,
            start: 0,
            held: Vec::new(),
            end,
        }
    }
}

impl Stretch for Window<'_> {
    fn get(&mut self, at: u64, count: usize) -> io::Result<&[u8]> {
        let count = count.min(usize::try_from(self.end.saturating_sub(at)).unwrap_or(count));
        let is_held = at >= self.start && at + count as u64 <= self.start + self.held.len() as u64;
        if !is_held {
            let most = self.end.saturating_sub(at).min(WINDOW.max(count) as u64);
            self.held.resize(most as usize, 0);
            self.start = at;
            let read = read_up_to(self.file, &mut self.held, at)?;
            self.held.truncate(read);
        }
        let from = (at - self.start) as usize;
        let to = (from + count).min(self.held.len());
        Ok(&self.held[from.min(to)..to])
    }
}

fn read_up_to(file: &File, out: &mut [u8], at: u64) -> io::Result<usize> {
    let mut read = 0;
    while read < out.len() {
        match file.read_at(&mut out[read..], at + read as u64) {
            Ok(0) => break,
            Ok(more) => read += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(read)
}

/// Fields of a record, little end first.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (number, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*number)
    }

    fn u16(&mut self) -> Option<u16> {
        self.number().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.number().map(u64::from_le_bytes)
    }

    fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let (text, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(String::from_utf8_lossy(text).into_owned())
    }
}

/// What stands in front of a chunk's records.
#[derive(Debug)]
struct ChunkHead {
    uncompressed: u64,
    sum: u32,
    compression: String,
    compressed: u64,
    /// Where the records begin in the file.
    start: u64,
}

impl ChunkHead {
    /// Of the chunk whose record begins here.
    fn of(bytes: &[u8], record: u64) -> Option<Self> {
        let mut fields = Fields(bytes);
        fields.number::<16>()?;
        let (uncompressed, sum) = (fields.u64()?, fields.u32()?);
        let compression = fields.text()?;
        let compressed = fields.u64()?;
        let head = (bytes.len() - fields.0.len()) as u64;
        Some(Self {
            uncompressed,
            sum,
            compression,
            compressed,
            start: record + RECORD_HEAD + head,
        })
    }

    /// The longest there can be: names of compressions are short.
    const LONGEST: usize = 8 + 8 + 8 + 4 + 4 + 64 + 8;
}

/// How a stretch of records ended.
enum End {
    /// As it should.
    Whole,
    /// Here, with what is no whole record.
    Torn(u64),
}

impl Mcap {
    /// Opens a file; `None` when it is not MCAP.
    pub(super) fn open(file: File) -> io::Result<Option<Self>> {
        let length = file.metadata()?.len();
        let mut magic = [0; MAGIC.len()];
        let read = read_up_to(&file, &mut magic, 0)?;
        Ok((read == MAGIC.len() && magic == MAGIC).then_some(Self {
            file,
            length,
            chunks: Vec::new(),
        }))
    }

    /// Goes through all messages once.
    pub(super) fn visit(
        &mut self,
        number: usize,
        topics: &mut Topics,
        visit: &mut dyn Visit,
        looked: &mut Looked,
    ) -> io::Result<()> {
        let messages = looked.messages;
        let mut pass = Pass {
            topics,
            visit,
            looked,
            number,
            schemas: HashMap::new(),
            channels: HashMap::new(),
        };
        let mut start = MAGIC.len() as u64;
        let summary =
            loop {
                match self.records(start, &mut pass)? {
                    (End::Whole, said) => break said.map(|count| (count, Vec::new())),
                    (End::Torn(at), _) => {
                        // A file that ends as it should says where its chunks are: what follows the damage is found again.
                        let summary = self.summary()?;
                        let next = summary.as_ref().and_then(|(_, chunks)| {
                            let after = chunks.partition_point(|&chunk| chunk <= at);
                            chunks.get(after).copied()
                        });
                        let size = self.length;
                        match next {
                        Some(next) => pass.looked.damage(format!(
                            "bytes {at} to {next} are damaged"
                        )),
                        None if summary.is_none() => pass.looked.damage(format!(
                            "it is torn at byte {at} of {size}, as of a recorder that was not ended"
                        )),
                        None => pass.looked.damage(format!("it is damaged from byte {at} on")),
                    }
                        match next {
                            Some(next) => start = next,
                            None => break summary,
                        }
                    }
                }
            };
        let read = pass.looked.messages - messages;
        if let Some((count, _)) = summary.filter(|(count, _)| *count > read) {
            looked.damage(format!("{read} of its {count} messages can be read"));
        }
        Ok(())
    }

    /// Goes through the records of the file from here on, up to the footer; gives how many messages there should be.
    fn records(&mut self, start: u64, pass: &mut Pass<'_>) -> io::Result<(End, Option<u64>)> {
        let file = self.file.try_clone()?;
        let mut window = Window::new(&file, self.length);
        let (mut at, mut said) = (start, None);
        loop {
            let Some((opcode, length)) = record(&mut window, at)? else {
                return Ok((End::Torn(at), said));
            };
            let body = at + RECORD_HEAD;
            let end = body.checked_add(length).filter(|end| *end <= self.length);
            match opcode {
                op::FOOTER if end.is_some() => return Ok((End::Whole, said)),
                op::STATISTICS => said = Fields(window.get(body, 8)?).u64(),
                op::CHUNK => {
                    let head = ChunkHead::of(window.get(body, ChunkHead::LONGEST)?, at);
                    match head {
                        Some(head) if end.is_none_or(|end| head.start + head.compressed == end) => {
                            self.chunk(at, &head, pass, end.is_none())?
                        }
                        _ => return Ok((End::Torn(at), said)),
                    }
                }
                op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA if end.is_some() => {
                    pass.record(&mut window, opcode, at, length, None)?;
                }
                _ => {}
            }
            match end {
                Some(end) => at = end,
                None => return Ok((End::Torn(at), said)),
            }
        }
    }

    /// Goes through the records of a chunk.
    fn chunk(
        &mut self,
        at: u64,
        head: &ChunkHead,
        pass: &mut Pass<'_>,
        is_torn: bool,
    ) -> io::Result<()> {
        if head.compression.is_empty() {
            let file = self.file.try_clone()?;
            let end = (head.start + head.compressed).min(self.length);
            let mut window = Window::new(&file, end);
            pass.records(&mut window, head.start..end, at, is_torn)
        } else {
            match self.load(at, head) {
                Ok(bytes) => {
                    let end = bytes.len() as u64;
                    pass.records(&mut &bytes[..], 0..end, at, is_torn)
                }
                Err(why) => {
                    pass.looked.damage(format!("the chunk at byte {at}: {why}"));
                    Ok(())
                }
            }
        }
    }

    /// How many messages the summary tells, and where the chunks are; `None` of a file that does not end as it should.
    fn summary(&self) -> io::Result<Option<(u64, Vec<u64>)>> {
        const FOOTER: u64 = RECORD_HEAD + 8 + 8 + 4;
        let mut window = Window::new(&self.file, self.length);
        let Some(footer) = self.length.checked_sub(FOOTER + MAGIC.len() as u64) else {
            return Ok(None);
        };
        if window.get(self.length - MAGIC.len() as u64, MAGIC.len())? != MAGIC {
            return Ok(None);
        }
        let start = match record(&mut window, footer)? {
            Some((op::FOOTER, _)) => Fields(window.get(footer + RECORD_HEAD, 8)?).u64(),
            _ => None,
        };
        let Some(mut at) = start.filter(|start| (1..footer).contains(start)) else {
            return Ok(None);
        };
        let (mut count, mut chunks) = (None, Vec::new());
        while let Some((opcode, length)) = record(&mut window, at)?.filter(|_| at < footer) {
            let body = at + RECORD_HEAD;
            match opcode {
                op::STATISTICS => count = Fields(window.get(body, 8)?).u64(),
                op::CHUNK_INDEX => chunks.extend(Fields(window.get(body + 16, 8)?).u64()),
                _ => {}
            }
            let Some(next) = body.checked_add(length) else {
                break;
            };
            at = next;
        }
        chunks.sort_unstable();
        Ok(count.map(|count| (count, chunks)))
    }

    /// A chunk's records, decompressed and checked; of one that the file's end cuts off, what is there.
    fn load(&mut self, at: u64, head: &ChunkHead) -> Result<Rc<Vec<u8>>, Why> {
        if let Some(place) = self.chunks.iter().position(|(known, _)| *known == at) {
            let chunk = self.chunks.remove(place);
            let bytes = Rc::clone(&chunk.1);
            self.chunks.push(chunk);
            return Ok(bytes);
        }
        if head.uncompressed.max(head.compressed) > LONGEST_CHUNK {
            return Err("it would be larger than memory allows".to_owned());
        }
        let here = self.length.saturating_sub(head.start).min(head.compressed);
        let is_torn = here < head.compressed;
        let mut packed = vec![0; here as usize];
        let read = read_up_to(&self.file, &mut packed, head.start).map_err(|e| e.to_string())?;
        packed.truncate(read);
        let (bytes, failed) = match head.compression.as_str() {
            "" => (packed, None),
            "zstd" => match zstd::stream::read::Decoder::new(&packed[..]) {
                Ok(decoder) => unpacked(decoder, head.uncompressed),
                Err(error) => (Vec::new(), Some(error.to_string())),
            },
            "lz4" => match lz4::Decoder::new(&packed[..]) {
                Ok(decoder) => unpacked(decoder, head.uncompressed),
                Err(error) => (Vec::new(), Some(error.to_string())),
            },
            other => {
                return Err(format!(
                    "it is compressed with {other:?}, and zstd and lz4 are read"
                ));
            }
        };
        if !is_torn {
            if let Some(why) = failed {
                return Err(format!("it cannot be decompressed ({why})"));
            }
            if head.sum != 0 && crc32fast::hash(&bytes) != head.sum {
                return Err("its checksum is not that of its bytes".to_owned());
            }
        }
        let bytes = Rc::new(bytes);
        self.chunks.push((at, Rc::clone(&bytes)));
        let mut held: usize = self.chunks.iter().map(|(_, bytes)| bytes.len()).sum();
        while held > KEPT && self.chunks.len() > 1 {
            held -= self.chunks.remove(0).1.len();
        }
        Ok(bytes)
    }

    /// Keeps no chunks.
    pub(super) fn forget(&mut self) {
        self.chunks.clear();
    }

    /// The bytes of a message.
    pub(super) fn read(&mut self, at: &At) -> Result<Vec<u8>, Why> {
        let io = |error: io::Error| error.to_string();
        let torn = || "the file ends before it".to_owned();
        if at.chunk > 0 {
            let mut bytes = vec![0; ChunkHead::LONGEST];
            let read = read_up_to(&self.file, &mut bytes, at.chunk + RECORD_HEAD).map_err(io)?;
            let head = ChunkHead::of(&bytes[..read], at.chunk).ok_or_else(torn)?;
            let is_plain = head.compression.is_empty();
            if !is_plain || head.compressed <= LONGEST_CHECKED {
                let start = if is_plain {
                    at.start - head.start
                } else {
                    at.start
                };
                let chunk = self.load(at.chunk, &head)?;
                let range = start as usize..(start + at.length) as usize;
                return Ok(chunk.get(range).ok_or_else(torn)?.to_vec());
            }
        }
        let mut bytes = vec![0; at.length as usize];
        let read = read_up_to(&self.file, &mut bytes, at.start).map_err(io)?;
        match read == bytes.len() {
            true => Ok(bytes),
            false => Err(torn()),
        }
    }
}

/// Decompresses as far as it goes, and says what ended it.
fn unpacked(reader: impl Read, length: u64) -> (Vec<u8>, Option<String>) {
    let mut bytes = Vec::with_capacity(length.min(LONGEST_SMALL) as usize);
    let failed = reader.take(length).read_to_end(&mut bytes).err();
    let why = match failed {
        None if bytes.len() as u64 != length => Some(format!("{} bytes of {length}", bytes.len())),
        failed => failed.map(|error| error.to_string()),
    };
    (bytes, why)
}

/// Opcode and length of the record that begins here; `None` where there is none.
fn record(stretch: &mut dyn Stretch, at: u64) -> io::Result<Option<(u8, u64)>> {
    let head = stretch.get(at, RECORD_HEAD as usize)?;
    let Some((&[opcode], rest)) = head.split_first_chunk() else {
        return Ok(None);
    };
    let length = Fields(rest).u64();
    Ok(length
        .filter(|_| opcode != 0)
        .map(|length| (opcode, length)))
}

impl Pass<'_> {
    /// The records in a chunk, which may be torn.
    fn records(
        &mut self,
        stretch: &mut dyn Stretch,
        range: std::ops::Range<u64>,
        chunk: u64,
        is_torn: bool,
    ) -> io::Result<()> {
        let mut at = range.start;
        while at < range.end {
            let found = record(stretch, at)?;
            let end = found.and_then(|(_, length)| (at + RECORD_HEAD).checked_add(length));
            match (found, end.filter(|end| *end <= range.end)) {
                (Some((opcode, length)), Some(end)) => {
                    self.record(stretch, opcode, at, length, Some(chunk))?;
                    at = end;
                }
                _ => {
                    if !is_torn {
                        let text = format!("the chunk at byte {chunk} holds what is no record");
                        self.looked.damage(text);
                    }
                    break;
                }
            }
        }
        Ok(())
    }

    fn record(
        &mut self,
        stretch: &mut dyn Stretch,
        opcode: u8,
        at: u64,
        length: u64,
        chunk: Option<u64>,
    ) -> io::Result<()> {
        let body = at + RECORD_HEAD;
        match opcode {
            op::SCHEMA if length <= LONGEST_SMALL => {
                let mut fields = Fields(stretch.get(body, length as usize)?);
                if let (Some(id), Some(name), Some(encoding)) =
                    (fields.u16(), fields.text(), fields.text())
                {
                    self.schemas.insert(id, (name, encoding));
                }
            }
            op::CHANNEL if length <= LONGEST_SMALL => {
                let mut fields = Fields(stretch.get(body, length as usize)?);
                if let (Some(id), Some(schema), Some(topic), Some(encoding)) =
                    (fields.u16(), fields.u16(), fields.text(), fields.text())
                {
                    let named = self.schemas.get(&schema);
                    let schema = named.map_or("", |(name, _)| name);
                    let topic = self.topics.add(&topic, schema, Coding::of(&encoding));
                    let want = self.visit.wants(topic, self.topics.get(topic));
                    self.channels.insert(id, (topic, want));
                }
            }
            op::METADATA if length <= LONGEST_SMALL => {
                let name = Fields(stretch.get(body, length as usize)?).text();
                self.looked.is_own |= name.as_deref() == Some("tricurve");
            }
            op::MESSAGE => {
                let mut fields = Fields(stretch.get(body, MESSAGE_HEAD)?);
                let (Some(id), Some(_), Some(log_time), Some(_)) =
                    (fields.u16(), fields.u32(), fields.u64(), fields.u64())
                else {
                    return Ok(());
                };
                self.looked.messages += 1;
                let Some(&(topic, want)) = self.channels.get(&id) else {
                    self.looked.unnamed += 1;
                    return Ok(());
                };
                self.topics.count(topic);
                let start = body + MESSAGE_HEAD as u64;
                let length = length.saturating_sub(MESSAGE_HEAD as u64);
                let wanted = match want {
                    Want::Nothing => return Ok(()),
                    Want::Head => length.min(HEAD as u64),
                    Want::Whole => length,
                };
                let at = At {
                    file: self.number,
                    chunk: chunk.unwrap_or_default(),
                    start,
                    length,
                };
                let bytes = stretch.get(start, wanted as usize)?;
                self.visit.message(topic, log_time, at, bytes);
            }
            _ => {}
        }
        Ok(())
    }
}
