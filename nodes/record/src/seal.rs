//! Gives an unfinished file its end: what is torn is cut, what is whole gets the index that viewers want.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use mcap::records::op;
use serde::Serialize;
use thiserror::Error;

use crate::summary::{Summary, record};
use messages::recording::Contents;

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

/// Everything that follows the last chunk of a finished file: its message indexes, and the file's index.
fn ending(mut contents: Contents) -> io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let end = contents.whole_until;
    if let Some(last) = contents.chunks.last_mut() {
        last.message_index_offsets.clear();
        for index in &contents.last_indexes {
            last.message_index_offsets
                .insert(index.channel_id, end + out.len() as u64);
            record(&mut out, op::MESSAGE_INDEX, index)?;
        }
        last.message_index_length = out.len() as u64;
    }
    let mut summary = Summary {
        schemas: contents.schemas,
        channels: contents.channels,
        counts: contents.counts,
        metadata: contents
            .metadata
            .into_iter()
            .map(|(index, _)| index)
            .collect(),
        attachments: contents.attachments,
        ..Summary::default()
    };
    for chunk in &contents.chunks {
        summary.chunks.add(chunk)?;
    }
    let ending = summary.ending(end + out.len() as u64)?;
    out.extend_from_slice(&ending);
    Ok(out)
}
