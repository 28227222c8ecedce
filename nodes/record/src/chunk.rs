//! A batch's records become chunks: the pieces that are written, and what the file's index says of them.

use std::collections::BTreeMap;
use std::io::{self, IoSlice, Write};
use std::ops::Range;

use mcap::records::{self, op};

use crate::batch::channel_id;
use crate::file::RECORD_HEAD;
use crate::summary::{Summary, record, write};
use crate::{Batch, Compression};

/// Cuts batches into chunks and compresses them; keeps its memory from batch to batch.
#[derive(Debug)]
pub(crate) struct Chunker {
    compression: Compression,
    chunk_bytes: usize,
    /// Everything but the batch's own bytes: headers, indexes, compressed chunks.
    made: Vec<u8>,
    pieces: Vec<Piece>,
}

/// A piece of what is written.
#[derive(Clone, Debug)]
enum Piece {
    Made(Range<usize>),
    Batch(Range<usize>),
}

impl Chunker {
    pub(crate) fn new(compression: Compression, chunk_bytes: u64) -> Self {
        let chunk_bytes = usize::try_from(chunk_bytes).unwrap_or(usize::MAX);
        Self {
            compression,
            chunk_bytes,
            made: Vec::new(),
            pieces: Vec::new(),
        }
    }

    /// Makes chunks of a batch for a file that is `start` bytes long, and adds them to its summary. The first begins
    /// with `definitions`, the records of schemas and channels, where they are still to be written.
    pub(crate) fn chunks(
        &mut self,
        batch: &Batch,
        definitions: &[u8],
        start: u64,
        summary: &mut Summary,
    ) -> io::Result<()> {
        self.made.clear();
        self.pieces.clear();
        let mut position = start;
        let mut records = batch.records();
        let mut prefix = definitions;
        while !records.is_empty() {
            let mut bytes = prefix.len();
            let is_full = |(_, record): &&(usize, Range<usize>)| {
                let is_full = bytes >= self.chunk_bytes;
                bytes += record.len();
                !is_full
            };
            let count = records.iter().take_while(is_full).count().max(1);
            let (of_chunk, rest) = records.split_at(count);
            records = rest;
            position += self.chunk(batch, of_chunk, prefix, position, summary)?;
            prefix = &[];
        }
        Ok(())
    }

    /// What is to be written.
    pub(crate) fn pieces<'a>(&'a self, batch: &'a Batch) -> Vec<IoSlice<'a>> {
        let slice = |piece: &Piece| match piece {
            Piece::Made(range) => IoSlice::new(&self.made[range.clone()]),
            Piece::Batch(range) => IoSlice::new(&batch.bytes()[range.clone()]),
        };
        self.pieces.iter().map(slice).collect()
    }

    /// Makes a chunk that will stand at `position`, and gives the bytes that it and its indexes take.
    fn chunk(
        &mut self,
        batch: &Batch,
        of_chunk: &[(usize, Range<usize>)],
        prefix: &[u8],
        position: u64,
        summary: &mut Summary,
    ) -> io::Result<u64> {
        let (Some((_, first)), Some((_, last))) = (of_chunk.first(), of_chunk.last()) else {
            return Ok(0);
        };
        let range = first.start..last.end;
        let content = [prefix, &batch.bytes()[range.clone()]];
        let mut crc = crc32fast::Hasher::new();
        content.iter().for_each(|part| crc.update(part));
        let uncompressed_size = content.iter().map(|part| part.len() as u64).sum();
        let packed = match self.compression {
            Compression::None => None,
            Compression::Lz4 => shrinks(content[1])?.then(|| lz4(content)).transpose()?,
            Compression::Zstd => Some(zstd(content)?),
        };

        let header = records::ChunkHeader {
            message_start_time: batch.nanos(),
            message_end_time: batch.nanos(),
            uncompressed_size,
            uncompressed_crc: crc.finalize(),
            compression: match (&packed, self.compression) {
                (Some(_), Compression::Zstd) => "zstd".to_owned(),
                (Some(_), _) => "lz4".to_owned(),
                (None, _) => String::new(),
            },
            compressed_size: packed
                .as_ref()
                .map_or(uncompressed_size, |packed| packed.len() as u64),
        };
        let mut head = Vec::new();
        write(&mut head, &header)?;
        let body = head.len() as u64 + header.compressed_size;
        let start = self.made.len();
        self.made.push(op::CHUNK);
        self.made.extend_from_slice(&body.to_le_bytes());
        self.made.extend_from_slice(&head);
        match packed {
            Some(packed) => {
                self.made.extend_from_slice(&packed);
                self.pieces.push(Piece::Made(start..self.made.len()));
            }
            None => {
                self.made.extend_from_slice(prefix);
                self.pieces.push(Piece::Made(start..self.made.len()));
                self.pieces.push(Piece::Batch(range.clone()));
            }
        }
        let chunk_length = RECORD_HEAD + body;

        let mut by_channel: BTreeMap<u16, Vec<records::MessageIndexEntry>> = BTreeMap::new();
        for (channel, record) in of_chunk {
            let offset = (prefix.len() + record.start - range.start) as u64;
            let entry = records::MessageIndexEntry {
                log_time: batch.nanos(),
                offset,
            };
            by_channel
                .entry(channel_id(*channel))
                .or_default()
                .push(entry);
        }
        let start = self.made.len();
        let mut message_index_offsets = BTreeMap::new();
        for (channel_id, records) in by_channel {
            *summary.counts.entry(channel_id).or_default() += records.len() as u64;
            let offset = position + chunk_length + (self.made.len() - start) as u64;
            message_index_offsets.insert(channel_id, offset);
            let index = records::MessageIndex {
                channel_id,
                records,
            };
            record(&mut self.made, op::MESSAGE_INDEX, &index)?;
        }
        let message_index_length = (self.made.len() - start) as u64;
        self.pieces.push(Piece::Made(start..self.made.len()));
        summary.chunks.add(&records::ChunkIndex {
            message_start_time: header.message_start_time,
            message_end_time: header.message_end_time,
            chunk_start_offset: position,
            chunk_length,
            message_index_offsets,
            message_index_length,
            compression: header.compression,
            compressed_size: header.compressed_size,
            uncompressed_size,
        })?;
        Ok(chunk_length + message_index_length)
    }
}

/// Whether lz4 saves an eighth at least, judged by samples: what it hardly shrinks is not worth its time.
fn shrinks(content: &[u8]) -> io::Result<bool> {
    const SAMPLE: usize = 4096;
    let (mut before, mut after) = (0, 0);
    for start in (0..content.len()).step_by((content.len() / 8).max(SAMPLE)) {
        let sample = &content[start..content.len().min(start + SAMPLE)];
        before += sample.len();
        after += lz4::block::compress(sample, None, false)?.len();
    }
    Ok(after < before - before / 8)
}

fn lz4(content: [&[u8]; 2]) -> io::Result<Vec<u8>> {
    // MCAP's readers want no sums of lz4's own: the chunk has one.
    let mut encoder = lz4::EncoderBuilder::new()
        .level(0)
        .block_checksum(lz4::liblz4::BlockChecksum::NoBlockChecksum)
        .build(Vec::new())?;
    content
        .iter()
        .try_for_each(|part| encoder.write_all(part))?;
    let (packed, result) = encoder.finish();
    result.map(|()| packed)
}

fn zstd(content: [&[u8]; 2]) -> io::Result<Vec<u8>> {
    let mut encoder = zstd::Encoder::new(Vec::new(), 1)?;
    content
        .iter()
        .try_for_each(|part| encoder.write_all(part))?;
    encoder.finish()
}
