//! Writes batches into the parts of a recording.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use mcap::WriteOptions;
use mcap::records::MessageHeader;
use messages::ledger::Ledger;
use messages::record::Channel;
use serde::Serialize;
use thiserror::Error;

use crate::file::Contents;
use crate::metadata::{Identity, Metadata, NAME, ledger_record};
use crate::parts::{count, part_path};
use crate::seal::{SealError, seal};
use crate::settings::Compression;
use crate::sink::{Disk, Sink};
use crate::{Batch, Encoder, Sealed, Settings};

/// Why a recording cannot be written.
#[derive(Debug, Error)]
pub enum WriteError {
    /// It would overwrite a file.
    #[error("{} exists; --force overwrites it", .0.display())]
    Exists(PathBuf),
    /// There is something else than a file.
    #[error("cannot record to {}: it is not a file", .0.display())]
    NotAFile(PathBuf),
    /// What would be taken for a part of the recording is something else.
    #[error("{} would be taken for a part of this recording and is none; move it away", .0.display())]
    NotAPart(PathBuf),
    /// Somebody else writes it.
    #[error("cannot record to {}: another process is writing it", .0.display())]
    Busy(PathBuf),
    /// Its folder does not exist.
    #[error("cannot record to {}: there is no folder {}", path.display(), folder.display())]
    NoFolder {
        /// The file.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
    },
    /// There is no room left.
    #[error("the disk is full: {} holds all scans before this one", .0.display())]
    Full(PathBuf),
    /// It cannot be opened or written.
    #[error("cannot record to {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file's writer refuses.
    #[error("cannot record to {}: {source}", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// What it says.
        source: mcap::McapError,
    },
    /// An unfinished part could not be finished.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// Writing failed before.
    #[error("the recording has ended: an earlier scan could not be written")]
    Ended,
}

/// What was recorded.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Written {
    /// Its parts, in order.
    pub parts: Vec<PathBuf>,
    /// Bytes of all parts that this writer wrote.
    pub bytes: u64,
    /// Scans that this writer wrote.
    pub scans: u64,
}

/// A part that is being written.
struct Part {
    path: PathBuf,
    mcap: mcap::Writer<Sink>,
    /// Of every channel its number in this file.
    ids: Vec<u16>,
    /// Bytes flushed.
    written: Arc<AtomicU64>,
    first_nanos: Option<u64>,
}

/// Opens an empty file for a part.
type Open = Box<dyn Fn(&Path) -> Result<Box<dyn Disk>, WriteError> + Send>;

/// Writes batches into the parts of a recording, each scan in chunks of its own, flushed to the system.
pub struct Writer {
    path: PathBuf,
    settings: Settings,
    metadata: Metadata,
    identity: Identity,
    channels: Vec<Channel>,
    open: Open,
    part: Option<Part>,
    recorded: Written,
}

impl std::fmt::Debug for Writer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Writer")
            .field("path", &self.path)
            .field("identity", &self.identity)
            .finish()
    }
}

impl Writer {
    /// Begins a recording. What it overwrites goes with all its parts.
    ///
    /// # Errors
    /// When the path exists and is not to be overwritten, or cannot be written.
    pub fn create(
        path: &Path,
        overwrite: bool,
        metadata: &Metadata,
        encoder: &Encoder,
        settings: &Settings,
    ) -> Result<Self, WriteError> {
        check_folder(path)?;
        // A second part without a first one would be taken for the new recording's.
        let parts = (0..=count(path).max(1)).map(|part| part_path(path, part));
        let existing: Vec<_> = parts.filter(|part| part.exists()).collect();
        for part in &existing {
            if !overwrite {
                return Err(WriteError::Exists(part.clone()));
            }
            if part.is_dir() {
                return Err(WriteError::NotAFile(part.clone()));
            }
            if part != path && identity_of(part).is_none_or(|identity| identity.part == 0) {
                return Err(WriteError::NotAPart(part.clone()));
            }
        }
        for part in existing.iter().filter(|part| *part != path) {
            fs::remove_file(part).map_err(|source| io_error(part, source))?;
        }
        let identity = Identity {
            recording: unique(),
            part: 0,
        };
        Self::start(
            path,
            identity,
            metadata,
            encoder,
            settings,
            Box::new(open_file),
        )
    }

    /// Goes on with a recording whose writer died: finishes what it left unfinished, and opens the next part. Without
    /// anything to go on with, begins it.
    ///
    /// # Errors
    /// When what is there is not the recording's, or cannot be written.
    pub fn resume(
        path: &Path,
        metadata: &Metadata,
        encoder: &Encoder,
        settings: &Settings,
    ) -> Result<(Self, Vec<Sealed>), WriteError> {
        check_folder(path)?;
        let mut sealed = Vec::new();
        let mut identity = Identity {
            recording: unique(),
            part: 0,
        };
        for number in 0..count(path) {
            let part = part_path(path, number);
            match identity_of(&part) {
                Some(of_part) => {
                    if number == 0 {
                        identity.recording = of_part.recording;
                    } else if of_part.recording != identity.recording {
                        return Err(WriteError::NotAPart(part));
                    }
                    sealed.push(seal(&part)?);
                    identity.part = number + 1;
                }
                // Its writer died before it wrote anything: it is begun again.
                None if holds_nothing(&part) => break,
                None => return Err(WriteError::NotAPart(part)),
            }
        }
        let open = Box::new(open_file);
        let mut writer = Self::start(path, identity.clone(), metadata, encoder, settings, open)?;
        let before = (0..identity.part).map(|part| part_path(path, part));
        writer.recorded.parts.splice(0..0, before);
        Ok((writer, sealed))
    }

    fn start(
        path: &Path,
        identity: Identity,
        metadata: &Metadata,
        encoder: &Encoder,
        settings: &Settings,
        open: Open,
    ) -> Result<Self, WriteError> {
        let mut writer = Self {
            path: path.to_owned(),
            settings: settings.clone(),
            metadata: metadata.clone(),
            identity,
            channels: encoder.channels().to_vec(),
            open,
            part: None,
            recorded: Written::default(),
        };
        writer.part = Some(writer.open_part()?);
        Ok(writer)
    }

    /// The recording's path, that of its first part.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn open_part(&mut self) -> Result<Part, WriteError> {
        let path = part_path(&self.path, self.identity.part);
        if self.identity.part > 0 && path.exists() && !holds_nothing(&path) {
            return Err(WriteError::NotAPart(path));
        }
        let written = Arc::new(AtomicU64::new(0));
        let sink = Sink::new((self.open)(&path)?, Arc::clone(&written));
        // Level 1 is zstd's fastest, level 0 lz4's.
        let (compression, level) = match self.settings.compression {
            Compression::None => (None, 0),
            Compression::Lz4 => (Some(mcap::Compression::Lz4), 0),
            Compression::Zstd => (Some(mcap::Compression::Zstd), 1),
        };
        let begin = || {
            let mut mcap = WriteOptions::new()
                .library(format!("tricurve {}", self.metadata.version))
                .compression(compression)
                .compression_level(level)
                .compression_threads(0)
                .chunk_size(Some(self.settings.chunk_bytes))
                .create(sink)?;
            mcap.write_metadata(&self.metadata.to_record(&self.identity))?;
            mcap.flush()?;
            let mut ids = Vec::new();
            for channel in &self.channels {
                let schema = &channel.schema;
                let id = mcap.add_schema(&schema.name, schema.encoding, &schema.data)?;
                let encoding = schema.message_encoding();
                ids.push(mcap.add_channel(id, &channel.name, encoding, &BTreeMap::new())?);
            }
            Ok((mcap, ids))
        };
        let (mcap, ids) = begin().map_err(|source| mcap_error(&path, source))?;
        self.recorded.parts.push(path.clone());
        Ok(Part {
            path,
            mcap,
            ids,
            written,
            first_nanos: None,
        })
    }

    /// Writes a scan and flushes it: when this returns, no death of this process loses it. Gives the bytes written.
    ///
    /// # Errors
    /// When it cannot be written; the recording then ends with the scan before it.
    pub fn write(&mut self, batch: &Batch) -> Result<u64, WriteError> {
        if self
            .part
            .as_ref()
            .is_some_and(|part| self.is_full(part, batch))
        {
            self.close_part(None)?;
            self.identity.part += 1;
            self.part = Some(self.open_part()?);
        }
        let part = self.part.as_mut().ok_or(WriteError::Ended)?;
        let before = part.written.load(Ordering::Relaxed);
        let result = part.write(batch);
        let bytes = part.written.load(Ordering::Relaxed) - before;
        if let Err(source) = result {
            let path = part.path.clone();
            self.give_up(&path);
            return Err(mcap_error(&path, source));
        }
        self.recorded.scans += 1;
        Ok(bytes)
    }

    /// Whether the part has all it should have, and this scan belongs into the next.
    fn is_full(&self, part: &Part, batch: &Batch) -> bool {
        let Some(first) = part.first_nanos else {
            return false;
        };
        let seconds = batch.nanos().saturating_sub(first) as f64 / 1e9;
        self.settings
            .max_bytes
            .is_some_and(|most| part.written.load(Ordering::Relaxed) >= most)
            || self
                .settings
                .max_seconds
                .is_some_and(|most| seconds >= most)
    }

    /// Ends the part that cannot be written any more, so that others can read what it holds.
    fn give_up(&mut self, path: &Path) {
        if let Some(part) = self.part.take() {
            self.recorded.bytes += part.written.load(Ordering::Relaxed);
            // The sink takes nothing more; this only closes the file.
            drop(part);
        }
        // Should this fail too, the file is unfinished but whole, and `info` says so.
        drop(seal(path));
    }

    /// Finishes the recording, with the ledger where the whole run's is known.
    ///
    /// # Errors
    /// When what is left cannot be written; every scan that was flushed is there nevertheless.
    pub fn finish(mut self, ledger: Option<&Ledger>) -> Result<Written, WriteError> {
        self.close_part(ledger)?;
        Ok(self.recorded)
    }

    fn close_part(&mut self, ledger: Option<&Ledger>) -> Result<(), WriteError> {
        let mut part = self.part.take().ok_or(WriteError::Ended)?;
        let mut end = || {
            if let Some(ledger) = ledger {
                part.mcap.write_metadata(&ledger_record(ledger))?;
            }
            part.mcap.finish()
        };
        let ended = end();
        let (path, written) = (part.path.clone(), Arc::clone(&part.written));
        let closed = ended.and_then(|_| Ok(part.mcap.into_inner().close()?));
        self.recorded.bytes += written.load(Ordering::Relaxed);
        closed.map_err(|source| {
            drop(seal(&path));
            mcap_error(&path, source)
        })
    }
}

impl Part {
    fn write(&mut self, batch: &Batch) -> Result<(), mcap::McapError> {
        self.first_nanos.get_or_insert(batch.nanos());
        for (channel, bytes) in batch.messages() {
            let header = MessageHeader {
                channel_id: self.ids[channel],
                sequence: batch.sequence() as u32,
                log_time: batch.nanos(),
                publish_time: batch.nanos(),
            };
            self.mcap.write_to_known_channel(&header, bytes)?;
        }
        self.mcap.flush()
    }
}

/// What tells this recording from all others.
fn unique() -> String {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |now| now.as_nanos());
    format!("{now:x}-{:x}", std::process::id())
}

fn check_folder(path: &Path) -> Result<(), WriteError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    match folder.filter(|folder| !folder.is_dir()) {
        Some(folder) => Err(WriteError::NoFolder {
            path: path.to_owned(),
            folder: folder.to_owned(),
        }),
        None if path.is_dir() => Err(WriteError::NotAFile(path.to_owned())),
        None => Ok(()),
    }
}

fn open_file(path: &Path) -> Result<Box<dyn Disk>, WriteError> {
    let open = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(path);
    let file = open.map_err(|source| io_error(path, source))?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(WriteError::Busy(path.to_owned())),
        Err(TryLockError::Error(source)) => return Err(io_error(path, source)),
    }
    file.set_len(0).map_err(|source| io_error(path, source))?;
    Ok(Box::new(file))
}

/// Whose part a file is; `None` when it is nobody's.
fn identity_of(path: &Path) -> Option<Identity> {
    let contents = Contents::of(&mut File::open(path).ok()?).ok()??;
    let mut records = contents.metadata.iter().map(|(_, record)| record);
    let (_, identity) = Metadata::from_record(records.find(|record| record.name == NAME)?).ok()?;
    Some(identity)
}

/// Whether a file's writer died before it wrote its metadata.
fn holds_nothing(path: &Path) -> bool {
    let contents = File::open(path).and_then(|mut file| Contents::of(&mut file));
    match contents {
        Ok(Some(contents)) => contents.chunks.is_empty() && contents.metadata.is_empty(),
        Ok(None) => fs::metadata(path).is_ok_and(|file| file.len() < mcap::MAGIC.len() as u64),
        Err(_) => false,
    }
}

fn io_error(path: &Path, source: io::Error) -> WriteError {
    let path = path.to_owned();
    match source.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
            WriteError::Full(path)
        }
        _ => WriteError::Io { path, source },
    }
}

fn mcap_error(path: &Path, source: mcap::McapError) -> WriteError {
    match source {
        mcap::McapError::Io(source) => io_error(path, source),
        source => WriteError::Mcap {
            path: path.to_owned(),
            source,
        },
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::synthetic::{self, Scan};
    use crate::{Info, Recording};
    use messages::Size;
    use std::io::Write;
    use std::ops::Range;

    /// A disk with so much room, which it may or may not set aside.
    #[derive(Debug)]
    struct Small {
        file: File,
        room: u64,
        allocates: bool,
        allocated: u64,
    }

    impl Disk for Small {
        fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
            let here = self.file.metadata()?.len();
            let fits = (self.room - here).min(bytes.len() as u64) as usize;
            self.file.write_all(&bytes[..fits])?;
            if fits < bytes.len() {
                Err(io::ErrorKind::StorageFull.into())
            } else {
                Ok(())
            }
        }

        fn allocate(&mut self, range: Range<u64>) -> io::Result<()> {
            if self.allocates && range.end > self.room {
                return Err(io::ErrorKind::StorageFull.into());
            }
            self.allocated = range.end;
            Ok(())
        }

        fn cut(&mut self, len: u64) -> io::Result<()> {
            Disk::cut(&mut self.file, len)
        }

        fn sync(&mut self) -> io::Result<()> {
            self.file.sync()
        }
    }

    /// Records onto a small disk until it is full, and gives how many scans were written.
    fn fill(path: &Path, room: u64, allocates: bool) -> u64 {
        let rig = synthetic::rig(Size::new(64, 48));
        let settings = Settings {
            compression: Compression::None,
            ..Settings::default()
        };
        let mut encoder = synthetic::encoder(&rig, &settings);
        let open: Open = Box::new(move |path| {
            let file = File::create(path).unwrap();
            Ok(Box::new(Small {
                file,
                room,
                allocates,
                allocated: 0,
            }))
        });
        let metadata = synthetic::metadata(&rig);
        let identity = Identity {
            recording: "x".to_owned(),
            part: 0,
        };
        let mut writer =
            Writer::start(path, identity, &metadata, &encoder, &settings, open).unwrap();
        for sequence in 0.. {
            let batch = synthetic::batch(&mut encoder, &Scan::new(&rig, sequence, 6));
            if let Err(error) = writer.write(&batch) {
                assert!(matches!(error, WriteError::Full(_)), "{error}");
                let told = error.to_string();
                assert!(told.contains("disk is full"), "{told}");
                assert!(matches!(writer.write(&batch), Err(WriteError::Ended)));
                assert!(matches!(writer.finish(None), Err(WriteError::Ended)));
                return sequence;
            }
        }
        0
    }

    #[test]
    fn on_a_full_disk_all_scans_written_stay_readable_and_the_file_is_finished() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("full.mcap");
        for (allocates, room) in [
            (true, 1_200_000),
            (true, 1_234_567),
            (false, 900_000),
            (false, 812_345),
        ] {
            let scans = fill(&path, room, allocates);
            assert!(scans > 1);
            let mut recording = Recording::open(&path).unwrap();
            assert!(recording.is_complete(), "{:?}", recording.notes());
            assert!(recording.scans().eq(0..scans));
            for scan in 0..scans {
                recording.scan(scan).unwrap();
            }
            assert_eq!(Info::of(&recording).scans.whole as u64, scans);
            // Where room can be set aside, there was enough for the index too.
            let len = fs::metadata(&path).unwrap().len();
            assert!(!allocates || len <= room, "{len} of {room}");
        }
    }
}
