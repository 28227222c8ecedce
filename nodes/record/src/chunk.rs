//! A batch's records become chunks: the pieces that are written, and what the file's index says of them.

use std::collections::BTreeMap;
use std::io::{self, IoSlice, Write};
use std::ops::Range;

use lz4::block::{compress_bound, compress_to_buffer};
use mcap::records::{self, op};

use crate::batch::channel_id;
use crate::summary::{Summary, record, write};
use crate::{Batch, Compression};
use messages::recording::RECORD_HEAD;

/// Cuts batches into chunks and compresses them; keeps its memory from batch to batch.
#[derive(Debug)]
pub(crate) struct Chunker {
    compression: Compression,
    chunk_bytes: usize,
    /// Everything but the batch's own bytes: heads, indexes, what was compressed.
    made: Vec<u8>,
    /// How much of it is among the pieces.
    pushed: usize,
    /// How many of the batch's own bytes are among the pieces.
    batch_bytes: usize,
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
        Self {
            compression,
            chunk_bytes: usize::try_from(chunk_bytes).unwrap_or(usize::MAX),
            made: Vec::new(),
            pushed: 0,
            batch_bytes: 0,
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
        (self.pushed, self.batch_bytes) = (0, 0);
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
            self.chunk(batch, of_chunk, prefix, start, summary)?;
            prefix = &[];
        }
        self.push_made();
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

    /// How much is to be written so far.
    fn len(&self) -> u64 {
        (self.made.len() + self.batch_bytes) as u64
    }

    /// What was made since the last piece is one.
    fn push_made(&mut self) {
        self.pieces.push(Piece::Made(self.pushed..self.made.len()));
        self.pushed = self.made.len();
    }

    /// Next comes this part of the batch.
    fn push_batch(&mut self, range: Range<usize>) {
        self.push_made();
        self.batch_bytes += range.len();
        self.pieces.push(Piece::Batch(range));
    }

    /// Makes a chunk of these records, with its message indexes, for a file that was `start` bytes long.
    fn chunk(
        &mut self,
        batch: &Batch,
        of_chunk: &[(usize, Range<usize>)],
        prefix: &[u8],
        start: u64,
        summary: &mut Summary,
    ) -> io::Result<()> {
        let (Some((_, first)), Some((_, last))) = (of_chunk.first(), of_chunk.last()) else {
            return Ok(());
        };
        let range = first.start..last.end;
        let content = &batch.bytes()[range.clone()];
        let mut crc = crc32fast::Hasher::new();
        crc.update(prefix);
        crc.update(content);
        let mut header = records::ChunkHeader {
            message_start_time: batch.nanos(),
            message_end_time: batch.nanos(),
            uncompressed_size: (prefix.len() + content.len()) as u64,
            uncompressed_crc: crc.finalize(),
            compression: self.compression.mcap_name().to_owned(),
            compressed_size: 0,
        };
        let chunk_start = self.len();
        let head = self.made.len();
        write_head(&mut self.made, &header, 0)?;
        let body = self.len();
        match self.compression {
            Compression::None => {
                self.made.extend_from_slice(prefix);
                self.push_batch(range.clone());
            }
            Compression::Lz4 => {
                self.made.extend_from_slice(&FRAME_HEAD);
                self.lz4(prefix, None)?;
                self.lz4(content, Some(range.start))?;
                self.made.extend_from_slice(&FRAME_END);
            }
            Compression::Zstd => {
                let mut encoder = zstd::Encoder::new(&mut self.made, 1)?;
                encoder.write_all(prefix)?;
                encoder.write_all(content)?;
                encoder.finish()?;
            }
        }
        // Now that the lengths are known the head is written over.
        header.compressed_size = self.len() - body;
        let chunk_length = self.len() - chunk_start;
        let mut written = Vec::new();
        write_head(&mut written, &header, chunk_length - RECORD_HEAD)?;
        self.made[head..head + written.len()].copy_from_slice(&written);

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
        let indexes = self.len();
        let mut message_index_offsets = BTreeMap::new();
        for (channel_id, records) in by_channel {
            *summary.counts.entry(channel_id).or_default() += records.len() as u64;
            message_index_offsets.insert(channel_id, start + self.len());
            let index = records::MessageIndex {
                channel_id,
                records,
            };
            record(&mut self.made, op::MESSAGE_INDEX, &index)?;
        }
        summary.chunks.add(&records::ChunkIndex {
            message_start_time: header.message_start_time,
            message_end_time: header.message_end_time,
            chunk_start_offset: start + chunk_start,
            chunk_length,
            message_index_offsets,
            message_index_length: self.len() - indexes,
            compression: header.compression,
            compressed_size: header.compressed_size,
            uncompressed_size: header.uncompressed_size,
        })
    }

    /// Appends blocks of an lz4 frame: those that shrink are compressed, the others stay as they are. `at` is where
    /// in the batch the content lies, if it is the batch's.
    fn lz4(&mut self, content: &[u8], at: Option<usize>) -> io::Result<()> {
        let mut rest = content;
        let mut position = 0;
        while !rest.is_empty() {
            // The first block is small and holds the heads of messages, which shrink in any case: every chunk is
            // smaller for it.
            let size = if position == 0 { FIRST_BLOCK } else { BLOCK };
            let (block, after) = rest.split_at(size.min(rest.len()));
            if position == 0 || shrinks(block)? {
                self.compressed_block(block)?;
            } else {
                self.made
                    .extend_from_slice(&(block.len() as u32 | STORED).to_le_bytes());
                match at {
                    Some(at) => self.push_batch(at + position..at + position + block.len()),
                    None => self.made.extend_from_slice(block),
                }
            }
            position += block.len();
            rest = after;
        }
        Ok(())
    }

    fn compressed_block(&mut self, block: &[u8]) -> io::Result<()> {
        let head = self.made.len();
        let start = head + size_of::<u32>();
        self.made.resize(start + compress_bound(block.len())?, 0);
        let packed = compress_to_buffer(block, None, false, &mut self.made[start..])?;
        let mut length = packed as u32;
        self.made.truncate(start + packed);
        if packed >= block.len() {
            length = block.len() as u32 | STORED;
            self.made.truncate(start);
            self.made.extend_from_slice(block);
        }
        self.made[head..start].copy_from_slice(&length.to_le_bytes());
        Ok(())
    }
}

/// Head of an lz4 frame of independent blocks of up to 4 MiB without checksums: magic, flags, block size, and a
/// checksum of the last two ("LZ4 Frame Format Description", 1.6).
const FRAME_HEAD: [u8; 7] = [0x04, 0x22, 0x4d, 0x18, 0x60, 0x70, 0x73];
const FRAME_END: [u8; 4] = [0; 4];
/// In the length of a block: it stands there as it is.
const STORED: u32 = 1 << 31;
const FIRST_BLOCK: usize = 16 << 10;
const BLOCK: usize = 256 << 10;

/// Whether lz4 halves a block, judged by a sample from its middle: what it shrinks less is not worth its time.
fn shrinks(block: &[u8]) -> io::Result<bool> {
    const SAMPLE: usize = 4096;
    let start = block.len().saturating_sub(SAMPLE) / 2;
    let sample = &block[start..block.len().min(start + SAMPLE)];
    let mut packed = [0; 2 * SAMPLE];
    Ok(compress_to_buffer(sample, None, false, &mut packed)? < sample.len() / 2)
}

fn write_head(out: &mut Vec<u8>, header: &records::ChunkHeader, length: u64) -> io::Result<()> {
    out.push(op::CHUNK);
    out.extend_from_slice(&length.to_le_bytes());
    write(out, header)
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use std::io::Read;

    /// Bytes of which some blocks shrink and some do not.
    fn mixed(len: usize) -> Vec<u8> {
        let mut state = 1u64;
        let mut byte = |i: usize| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            if (i / 300_000).is_multiple_of(2) {
                (state >> 56) as u8
            } else {
                7
            }
        };
        (0..len).map(&mut byte).collect()
    }

    #[test]
    fn every_lz4_reader_reads_our_frames() {
        for len in [
            0,
            1,
            FIRST_BLOCK,
            FIRST_BLOCK + 1,
            FIRST_BLOCK + BLOCK,
            5_000_000,
        ] {
            let content = mixed(len);
            let mut chunker = Chunker::new(Compression::Lz4, 1 << 20);
            chunker.made.extend_from_slice(&FRAME_HEAD);
            chunker.lz4(&content, None).unwrap();
            chunker.made.extend_from_slice(&FRAME_END);
            let mut read = Vec::new();
            lz4::Decoder::new(&*chunker.made)
                .unwrap()
                .read_to_end(&mut read)
                .unwrap();
            assert!(read == content, "{len}");
            assert!(len < 1_000_000 || chunker.made.len() < len * 2 / 3);
        }
    }
}
