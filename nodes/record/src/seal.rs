//! Gives an unfinished file its end: what is torn is cut, what is whole gets the index that viewers want.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use binrw::{BinWrite, Endian};
use mcap::MAGIC;
use mcap::records::{self, op};
use serde::Serialize;
use thiserror::Error;

use crate::file::Contents;

/// What sealing did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Sealed {
    /// Whether the file was finished already, and was left as it is.
    pub was_finished: bool,
    /// Chunks kept.
    pub chunks: u64,
    /// Messages kept.
    pub messages: u64,
    /// Bytes kept.
    pub kept_bytes: u64,
    /// Torn bytes cut off at the end.
    pub cut_bytes: u64,
}

/// Why a file could not be sealed.
#[derive(Debug, Error)]
pub enum SealError {
    /// It cannot be opened, read or written.
    #[error("cannot repair {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Somebody else writes it.
    #[error("cannot repair {}: it is still being written", .0.display())]
    Busy(PathBuf),
    /// It is not MCAP.
    #[error("cannot repair {}: it is not an MCAP file", .0.display())]
    NotMcap(PathBuf),
}

/// Finishes an unfinished file in place. All whole chunks stay as they are and are not read, but for the first and the
/// last: the last is checked, and cut when it is torn.
///
/// # Errors
/// When the file is not MCAP, is being written, or cannot be changed; it then holds what it held.
pub fn seal(path: &Path) -> Result<Sealed, SealError> {
    let io_error = |source| SealError::Io {
        path: path.to_owned(),
        source,
    };
    let mut file = OpenOptions::new()
        .read(true)
        .write(true)
        .open(path)
        .map_err(io_error)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(SealError::Busy(path.to_owned())),
        Err(TryLockError::Error(source)) => return Err(io_error(source)),
    }
    let contents = Contents::of(&mut file).map_err(io_error)?;
    let contents = contents.ok_or_else(|| SealError::NotMcap(path.to_owned()))?;
    let len = file.seek(SeekFrom::End(0)).map_err(io_error)?;
    let mut sealed = Sealed {
        was_finished: contents.is_finished,
        chunks: contents.chunks.len() as u64,
        messages: contents.counts.values().sum(),
        kept_bytes: contents.whole_until,
        cut_bytes: len - contents.whole_until,
    };
    if !contents.is_finished {
        sealed.cut_bytes = len.saturating_sub(contents.whole_until);
        finish(&mut file, contents).map_err(io_error)?;
    }
    Ok(sealed)
}

fn finish(file: &mut File, contents: Contents) -> io::Result<()> {
    let end = contents.whole_until;
    // Cutting first gives back the room that the index needs.
    file.set_len(end)?;
    file.seek(SeekFrom::Start(end))?;
    let result = ending(contents).and_then(|ending| file.write_all(&ending));
    if result.is_err() {
        file.set_len(end)?;
    }
    result.and_then(|()| file.sync_all())
}

/// Everything that follows the last chunk of a finished file.
fn ending(mut contents: Contents) -> io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let end = contents.whole_until;
    let here = |out: &Vec<u8>| end + out.len() as u64;

    if let Some(last) = contents.chunks.last_mut() {
        last.message_index_offsets.clear();
        for index in &contents.last_indexes {
            last.message_index_offsets
                .insert(index.channel_id, here(&out));
            record(&mut out, op::MESSAGE_INDEX, index)?;
        }
        last.message_index_length = out.len() as u64;
    }
    // Zero says that nobody knows the sum: nobody read all of the file.
    record(
        &mut out,
        op::DATA_END,
        &records::DataEnd {
            data_section_crc: 0,
        },
    )?;

    let summary = out.len();
    let summary_start = here(&out);
    let mut groups = Vec::new();
    let mut group = |out: &mut Vec<u8>, group_opcode, fill: &mut Fill<'_>| -> io::Result<()> {
        let group_start = end + out.len() as u64;
        fill(out)?;
        let group_length = end + out.len() as u64 - group_start;
        if group_length > 0 {
            groups.push(records::SummaryOffset {
                group_opcode,
                group_start,
                group_length,
            });
        }
        Ok(())
    };
    group(&mut out, op::SCHEMA, &mut |out| {
        contents.schemas.iter().try_for_each(|(id, schema)| {
            let mut body = Vec::new();
            let (name, encoding) = (schema.name.clone(), schema.encoding.clone());
            write(
                &mut body,
                &records::SchemaHeader {
                    id: *id,
                    name,
                    encoding,
                },
            )?;
            body.extend_from_slice(&(schema.data.len() as u32).to_le_bytes());
            body.extend_from_slice(&schema.data);
            raw_record(out, op::SCHEMA, &body);
            Ok(())
        })
    })?;
    group(&mut out, op::CHANNEL, &mut |out| {
        contents
            .channels
            .values()
            .try_for_each(|channel| record(out, op::CHANNEL, channel))
    })?;
    let (starts, ends) = (
        contents.chunks.iter().map(|c| c.message_start_time).min(),
        contents.chunks.iter().map(|c| c.message_end_time).max(),
    );
    let statistics = records::Statistics {
        message_count: contents.counts.values().sum(),
        schema_count: contents.schemas.len() as u16,
        channel_count: contents.channels.len() as u32,
        attachment_count: 0,
        metadata_count: contents.metadata.len() as u32,
        chunk_count: contents.chunks.len() as u32,
        message_start_time: starts.unwrap_or(0),
        message_end_time: ends.unwrap_or(0),
        channel_message_counts: contents.counts,
    };
    group(&mut out, op::STATISTICS, &mut |out| {
        record(out, op::STATISTICS, &statistics)
    })?;
    group(&mut out, op::CHUNK_INDEX, &mut |out| {
        contents
            .chunks
            .iter()
            .try_for_each(|chunk| record(out, op::CHUNK_INDEX, chunk))
    })?;
    group(&mut out, op::METADATA_INDEX, &mut |out| {
        let indexes = contents.metadata.iter().map(|(index, _)| index);
        indexes
            .clone()
            .try_for_each(|index| record(out, op::METADATA_INDEX, index))
    })?;
    let summary_offset_start = here(&out);
    for offset in &groups {
        record(&mut out, op::SUMMARY_OFFSET, offset)?;
    }

    // The sum covers the footer up to itself.
    let footer = records::Footer {
        summary_start,
        summary_offset_start,
        summary_crc: 0,
    };
    record(&mut out, op::FOOTER, &footer)?;
    out.truncate(out.len() - size_of::<u32>());
    let crc = crc32fast::hash(&out[summary..]);
    out.extend_from_slice(&crc.to_le_bytes());
    out.extend_from_slice(MAGIC);
    Ok(out)
}

type Fill<'a> = dyn FnMut(&mut Vec<u8>) -> io::Result<()> + 'a;

fn write<R>(out: &mut Vec<u8>, record: &R) -> io::Result<()>
where
    R: for<'a> BinWrite<Args<'a> = ()>,
{
    let mut out = Cursor::new(out);
    record
        .write_options(&mut out, Endian::Little, ())
        .map_err(io::Error::other)
}

fn record<R>(out: &mut Vec<u8>, opcode: u8, record: &R) -> io::Result<()>
where
    R: for<'a> BinWrite<Args<'a> = ()>,
{
    let mut body = Vec::new();
    write(&mut body, record)?;
    raw_record(out, opcode, &body);
    Ok(())
}

fn raw_record(out: &mut Vec<u8>, opcode: u8, body: &[u8]) {
    out.push(opcode);
    out.extend_from_slice(&(body.len() as u64).to_le_bytes());
    out.extend_from_slice(body);
}
