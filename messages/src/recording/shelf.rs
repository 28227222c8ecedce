//! Chunks that hold messages of several scans: read once, and kept for the scans that follow.

use std::fs::File;
use std::ops::Range;

use mcap::McapError;
use mcap::records::MessageHeader;

use super::file::{Chunk, Contents};
use super::scans::{Block, Place};

/// Unpacked bytes that are kept; one chunk is, whatever its size.
const MOST_BYTES: usize = 128 << 20;

/// The chunks that were needed last, the latest at the end.
#[derive(Debug, Default)]
pub(super) struct Shelf {
    chunks: Vec<((usize, Block), Chunk)>,
}

/// A chunk, of one scan or on the shelf for several.
pub(super) enum Loaded<'a> {
    /// One that nobody else needs.
    Own(Chunk),
    /// One that stays.
    Kept(&'a Chunk),
}

impl Shelf {
    /// The chunk or run at a place, read into memory from `spare` where there is some.
    pub(super) fn load(
        &mut self,
        file: &mut File,
        contents: &Contents,
        place: &Place,
        spare: &mut Vec<Vec<u8>>,
    ) -> Result<Loaded<'_>, McapError> {
        let mut read = |spare: &mut Vec<Vec<u8>>| match place.block {
            Block::Chunk(chunk) => Chunk::load(file, &contents.chunks[chunk], spare),
            Block::Run(run) => Chunk::of_run(file, &contents.runs[run].range, spare),
        };
        if !place.is_shared {
            return read(spare).map(Loaded::Own);
        }
        let name = (place.part, place.block);
        let chunk = match self.chunks.iter().position(|(known, _)| *known == name) {
            Some(at) => self.chunks.remove(at).1,
            None => read(spare)?,
        };
        let size = |chunks: &[(_, Chunk)]| -> usize {
            let sizes = chunks
                .iter()
                .map(|(_, chunk): &(_, Chunk)| chunk.bytes.len());
            sizes.sum()
        };
        while !self.chunks.is_empty() && size(&self.chunks) + chunk.bytes.len() > MOST_BYTES {
            self.chunks.remove(0);
        }
        self.chunks.push((name, chunk));
        let last = self.chunks.last().map(|(_, chunk)| Loaded::Kept(chunk));
        last.ok_or(McapError::UnexpectedEof)
    }
}

impl Loaded<'_> {
    /// Its messages: header, and where in it they lie.
    pub(super) fn messages(&self) -> &[(MessageHeader, Range<usize>)] {
        match self {
            Self::Own(chunk) => &chunk.messages,
            Self::Kept(chunk) => &chunk.messages,
        }
    }

    /// Memory with these messages, and where in it they lie.
    pub(super) fn take<'a>(
        self,
        ranges: impl Iterator<Item = &'a Range<usize>>,
        spare: &mut Vec<Vec<u8>>,
    ) -> (Vec<u8>, Vec<Range<usize>>) {
        match self {
            Self::Own(chunk) => (chunk.bytes, ranges.cloned().collect()),
            Self::Kept(chunk) => {
                let mut bytes = spare.pop().unwrap_or_default();
                bytes.clear();
                let copy = |range: &Range<usize>| {
                    let start = bytes.len();
                    bytes.extend_from_slice(&chunk.bytes[range.clone()]);
                    start..bytes.len()
                };
                let ranges = ranges.map(copy).collect();
                (bytes, ranges)
            }
        }
    }
}
