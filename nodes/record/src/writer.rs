//! Writes batches into the parts of a recording.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, IoSlice};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use mcap::MAGIC;
use mcap::records::{self, op};
use messages::change::Change;
use messages::ledger::Ledger;
use messages::record::Channel;
use serde::Serialize;
use thiserror::Error;

use crate::batch::channel_id;
use crate::chunk::Chunker;
use crate::seal::{SealError, seal};
use crate::sink::{Disk, Sink};
use crate::summary::{Summary, raw_record, record, schema_record, write};
use crate::{Batch, Encoder, Sealed, Settings};
use messages::recording::{Contents, FileSchema};
use messages::recording::{Identity, Metadata, NAME, ScanOrder, changes_record, ledger_record};
use messages::recording::{count_parts, part_path, stray_parts};

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
    /// There is hardly any room to begin with.
    #[error(
        "cannot record to {}: its disk has {} MB free, and record.leave_free keeps {} MB; make room or record elsewhere",
        path.display(), free / 1_000_000, leave_free / 1_000_000
    )]
    NoRoom {
        /// The file.
        path: PathBuf,
        /// Bytes that are free.
        free: u64,
        /// Bytes that are left free.
        leave_free: u64,
    },
    /// There is hardly any room left.
    #[error(
        "the disk is nearly full, {} MB are left and record.leave_free keeps {} MB: {} holds all scans before this one",
        free / 1_000_000, leave_free / 1_000_000, path.display()
    )]
    NearlyFull {
        /// The file.
        path: PathBuf,
        /// Bytes that are free.
        free: u64,
        /// Bytes that are left free.
        leave_free: u64,
    },
    /// It cannot be opened or written.
    #[error("cannot record to {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// An unfinished part could not be finished.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// Writing failed before.
    #[error("the recording has ended: an earlier scan could not be written")]
    Ended,
}

impl WriteError {
    /// Whether the disk has no more room, which others need not end for.
    pub fn is_out_of_room(&self) -> bool {
        matches!(self, Self::Full(_) | Self::NearlyFull { .. })
    }
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
    sink: Sink,
    summary: Summary,
    /// Schemas and channels, until the first chunk took them in.
    definitions: Vec<u8>,
    first_nanos: Option<u64>,
    order: ScanOrder,
}

/// Opens an empty file for a part.
type Open = Box<dyn Fn(&Path) -> Result<Box<dyn Disk>, WriteError> + Send>;

/// Writes batches into the parts of a recording, each scan in chunks of its own, flushed to the system.
pub struct Writer {
    path: PathBuf,
    settings: Settings,
    metadata: Metadata,
    changes: Vec<Change>,
    identity: Identity,
    channels: Vec<Channel>,
    open: Open,
    chunker: Chunker,
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
        let existing = Self::check(path, overwrite)?;
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

    /// Begins the recording of a run, or begins it again over what a recorder left that died before any scan came. `mark` is
    /// a file of the run's own, which is there from before the recording's is: whoever dies in between leaves nothing that
    /// would be taken for somebody else's, and who dies even earlier leaves what was there before.
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn begin(
        path: &Path,
        overwrite: bool,
        mark: &Path,
        metadata: &Metadata,
        encoder: &Encoder,
        settings: &Settings,
    ) -> Result<Self, WriteError> {
        let overwrite = overwrite || mark.exists();
        Self::check(path, overwrite)?;
        File::create(mark).map(drop).unwrap_or_default();
        Self::create(path, overwrite, metadata, encoder, settings)
    }

    /// Whether a recording can be begun at this path, as far as can be told without writing; gives the files that would
    /// be overwritten.
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn check(path: &Path, overwrite: bool) -> Result<Vec<PathBuf>, WriteError> {
        check_folder(path)?;
        // A second part without a first one would be taken for the new recording's.
        let parts = (0..=count_parts(path).max(1)).map(|part| part_path(path, part));
        let mut existing: Vec<_> = parts.filter(|part| part.exists()).collect();
        let is_part = |part: &PathBuf| identity_of(part).is_some_and(|identity| identity.part > 0);
        existing.extend(stray_parts(path).into_iter().filter(is_part));
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
        // Nothing is removed while somebody still writes any of them.
        for part in &existing {
            let file = File::open(part).map_err(|source| io_error(part, source))?;
            if matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) {
                return Err(WriteError::Busy(part.clone()));
            }
        }
        Ok(existing)
    }

    /// Whether the disk on which a recording is to be begun has more room than is to be left free, once the files that it
    /// overwrites are gone.
    ///
    /// # Errors
    /// When it has not.
    pub fn check_free(
        path: &Path,
        leave_free: u64,
        overwritten: &[PathBuf],
    ) -> Result<(), WriteError> {
        let lens = overwritten
            .iter()
            .filter_map(|path| fs::metadata(path).ok());
        let freed: u64 = lens.map(|file| file.len()).sum();
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        let folder = File::open(folder.unwrap_or(Path::new("."))).ok();
        match folder.and_then(|folder| Disk::free(&folder)) {
            Some(free) if free.saturating_add(freed) < leave_free => Err(WriteError::NoRoom {
                path: path.to_owned(),
                free,
                leave_free,
            }),
            _ => Ok(()),
        }
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
        for number in 0..count_parts(path) {
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
            changes: Vec::new(),
            identity,
            channels: encoder.channels().to_vec(),
            chunker: Chunker::new(settings.compression(), settings.chunk_bytes),
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
        let mut part = Part {
            sink: Sink::new((self.open)(&path)?),
            path,
            summary: Summary::default(),
            definitions: Vec::new(),
            first_nanos: None,
            order: ScanOrder::default(),
        };
        let begun = part.define(&self.channels).and_then(|()| {
            let metadata = self.metadata.to_record(&self.identity);
            part.begin(&self.metadata, &metadata)?;
            part.add_changes(&self.changes)
        });
        if let Err(source) = begun {
            // Of a further part nothing is left that could be taken for one; what cannot be removed either is told apart by
            // holding nothing.
            if self.identity.part > 0 {
                fs::remove_file(&part.path).unwrap_or_default();
            }
            return Err(io_error(&self.path, source));
        }
        self.recorded.parts.push(part.path.clone());
        Ok(part)
    }

    /// Writes a scan and flushes it: when this returns, no death of this process loses it. Gives the bytes written.
    ///
    /// # Errors
    /// When it cannot be written; the recording then ends with the scan before it.
    pub fn write(&mut self, batch: &Batch) -> Result<u64, WriteError> {
        self.check_room(batch)?;
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
        let before = part.sink.len();
        // Before the scan from which on they hold, so that no cut parts them.
        let noted = match batch.changes().len() > self.changes.len() {
            true => {
                self.changes = batch.changes().to_vec();
                part.add_changes(&self.changes)
            }
            false => Ok(()),
        };
        if let Err(source) = noted.and_then(|()| part.write(&mut self.chunker, batch)) {
            let error = io_error(&part.path, source);
            self.give_up();
            return Err(error);
        }
        self.recorded.scans += u64::from(!batch.is_closing());
        Ok(part.sink.len() - before)
    }

    /// Ends the recording before a scan that would take of the room that is to be left free.
    fn check_room(&mut self, batch: &Batch) -> Result<(), WriteError> {
        let leave_free = self.settings.leave_free;
        let Some(part) = self.part.as_ref() else {
            return Ok(());
        };
        // What ends a recording is little, and there is room for it.
        let free = part.sink.free().filter(|_| !batch.is_closing());
        match free.filter(|&free| free < leave_free.saturating_add(batch.bytes().len() as u64)) {
            Some(free) => {
                let path = self.path.clone();
                self.close_part(None)?;
                Err(WriteError::NearlyFull {
                    path,
                    free,
                    leave_free,
                })
            }
            None => Ok(()),
        }
    }

    /// Whether the part has all it should have, and this scan belongs into the next.
    fn is_full(&self, part: &Part, batch: &Batch) -> bool {
        let Some(first) = part.first_nanos.filter(|_| !batch.is_closing()) else {
            return false;
        };
        // A clock that was set back begins a new part too.
        let seconds = batch.nanos().abs_diff(first) as f64 / 1e9;
        self.settings
            .max_bytes
            .is_some_and(|most| part.sink.len() >= most)
            || self
                .settings
                .max_seconds
                .is_some_and(|most| seconds >= most)
    }

    /// Ends the part that cannot be written any more, so that others can read what it holds.
    fn give_up(&mut self) {
        if let Some(Part { path, sink, .. }) = self.part.take() {
            self.recorded.bytes += sink.len();
            // Closes the file, which sealing wants for itself.
            drop(sink);
            // Should this fail too, the file is unfinished but whole, and `info` says so.
            drop(seal(&path));
        }
    }

    /// Finishes the recording, with the ledger where the whole run's is known; one that has ended already, because there
    /// was no room, stays as it is.
    ///
    /// # Errors
    /// When what is left cannot be written; every scan that was flushed is there nevertheless.
    pub fn finish(mut self, ledger: Option<&Ledger>) -> Result<Written, WriteError> {
        if self.part.is_some() {
            self.close_part(ledger)?;
        }
        Ok(self.recorded)
    }

    fn close_part(&mut self, ledger: Option<&Ledger>) -> Result<(), WriteError> {
        let mut part = self.part.take().ok_or(WriteError::Ended)?;
        let records = [part.order.to_record(), ledger.map(ledger_record)];
        let added = records
            .iter()
            .flatten()
            .try_for_each(|record| part.add_metadata(record));
        let ending = added.and_then(|()| part.summary.ending(part.sink.len()));
        let closed = ending.and_then(|ending| part.sink.close(&ending));
        match closed {
            Ok(len) => self.recorded.bytes += len,
            Err(source) => {
                drop(seal(&part.path));
                return Err(io_error(&part.path, source));
            }
        }
        Ok(())
    }
}

impl Part {
    /// Says which schemas and channels there are.
    fn define(&mut self, channels: &[Channel]) -> io::Result<()> {
        let mut schemas: Vec<FileSchema> = Vec::new();
        for (index, channel) in channels.iter().enumerate() {
            let schema = FileSchema {
                name: channel.schema.name.clone(),
                encoding: channel.schema.encoding.to_owned(),
                data: channel.schema.data.clone(),
            };
            let known = schemas.iter().position(|known| *known == schema);
            let place = known.unwrap_or(schemas.len());
            let schema_id = place as u16 + 1;
            if known.is_none() {
                schema_record(&mut self.definitions, schema_id, &schema)?;
                self.summary.schemas.insert(schema_id, schema.clone());
                schemas.push(schema);
            }
            let channel = records::Channel {
                id: channel_id(index),
                schema_id,
                topic: channel.name.clone(),
                message_encoding: channel.schema.message_encoding().to_owned(),
                metadata: BTreeMap::new(),
            };
            record(&mut self.definitions, op::CHANNEL, &channel)?;
            self.summary.channels.insert(channel.id, channel);
        }
        Ok(())
    }

    /// Writes what stands before the first scan: the header, what the recording says about itself, and the effective
    /// configuration once more as a file that can be taken out and run.
    fn begin(&mut self, about: &Metadata, metadata: &records::Metadata) -> io::Result<()> {
        let mut out = MAGIC.to_vec();
        let header = records::Header {
            profile: String::new(),
            library: format!("{NAME} {}", about.version),
        };
        record(&mut out, op::HEADER, &header)?;
        self.sink.append(&mut [IoSlice::new(&out)])?;
        self.add_metadata(metadata)?;
        let configuration = serde_json::to_vec_pretty(&about.configuration)?;
        self.attach("configuration.json", "application/json", &configuration)
    }

    fn add_metadata(&mut self, metadata: &records::Metadata) -> io::Result<()> {
        let mut out = Vec::new();
        record(&mut out, op::METADATA, metadata)?;
        let (offset, length, name) = (self.sink.len(), out.len() as u64, metadata.name.clone());
        self.sink.append(&mut [IoSlice::new(&out)])?;
        self.summary.metadata.push(records::MetadataIndex {
            offset,
            length,
            name,
        });
        Ok(())
    }

    /// All changes of settings so far; the last such record tells them.
    fn add_changes(&mut self, changes: &[Change]) -> io::Result<()> {
        match changes.is_empty() {
            true => Ok(()),
            false => self.add_metadata(&changes_record(changes)),
        }
    }

    fn attach(&mut self, name: &str, media_type: &str, data: &[u8]) -> io::Result<()> {
        let now = now_nanos();
        let header = records::AttachmentHeader {
            log_time: now,
            create_time: now,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
        };
        let mut body = Vec::new();
        write(&mut body, &header)?;
        body.extend_from_slice(&(data.len() as u64).to_le_bytes());
        body.extend_from_slice(data);
        body.extend_from_slice(&crc32fast::hash(&body).to_le_bytes());
        let mut out = Vec::new();
        raw_record(&mut out, op::ATTACHMENT, &body);
        let (offset, length) = (self.sink.len(), out.len() as u64);
        self.sink.append(&mut [IoSlice::new(&out)])?;
        self.summary.attachments.push(records::AttachmentIndex {
            offset,
            length,
            log_time: now,
            create_time: now,
            data_size: data.len() as u64,
            name: header.name,
            media_type: header.media_type,
        });
        Ok(())
    }

    fn write(&mut self, chunker: &mut Chunker, batch: &Batch) -> io::Result<()> {
        if batch.records().is_empty() {
            return Ok(());
        }
        self.first_nanos.get_or_insert(batch.nanos());
        self.order.push(batch.sequence(), batch.nanos());
        chunker.chunks(batch, &self.definitions, self.sink.len(), &mut self.summary)?;
        self.sink.append(&mut chunker.pieces(batch))?;
        self.definitions.clear();
        Ok(())
    }
}

/// Nanoseconds since 1970.
pub(crate) fn now_nanos() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |now| u64::try_from(now.as_nanos()).unwrap_or(u64::MAX))
}

/// What tells this recording from all others.
pub(crate) fn unique() -> String {
    format!("{:x}-{:x}", now_nanos(), std::process::id())
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
        Ok(Some(contents)) => {
            contents.chunks.is_empty() && contents.runs.is_empty() && contents.metadata.is_empty()
        }
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

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::synthetic::{self, Scan};
    use crate::{Compression, Info, Recording};
    use messages::Size;
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
        fn append(&mut self, pieces: &mut [IoSlice<'_>]) -> io::Result<()> {
            for piece in pieces {
                let here = self.file.metadata()?.len();
                let fits = (self.room - here).min(piece.len() as u64) as usize;
                self.file.append(&mut [IoSlice::new(&piece[..fits])])?;
                if fits < piece.len() {
                    return Err(io::ErrorKind::StorageFull.into());
                }
            }
            Ok(())
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
            compression: Some(Compression::None),
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
                assert_eq!(writer.finish(None).unwrap().scans, sequence);
                return sequence;
            }
        }
        0
    }

    #[test]
    fn a_recorder_that_dies_when_its_file_is_just_made_is_begun_again_and_nobody_elses_file_goes() {
        let folder = tempfile::tempdir().unwrap();
        let (path, mark) = (folder.path().join("a.mcap"), folder.path().join("begun"));
        let rig = synthetic::rig(Size::new(64, 48));
        let settings = Settings::default();
        let (encoder, metadata) = (
            synthetic::encoder(&rig, &settings),
            synthetic::metadata(&rig),
        );
        let begin = |path: &Path| Writer::begin(path, false, &mark, &metadata, &encoder, &settings);
        fs::write(&path, "somebody else's").unwrap();
        assert!(matches!(begin(&path), Err(WriteError::Exists(_))));
        assert!(!mark.exists());
        fs::remove_file(&path).unwrap();
        // Its death comes before, while and after the head is written.
        for left in [None, Some(0), Some(20)] {
            drop(begin(&path).unwrap());
            if let Some(left) = left {
                let file = OpenOptions::new().write(true).open(&path).unwrap();
                file.set_len(left).unwrap();
            }
        }
        begin(&path).unwrap().finish(None).unwrap();
        assert!(Recording::open(&path).unwrap().is_complete());
        // The mark is there when the file is not yet.
        fs::remove_file(&mark).unwrap();
        let no_name = folder.path().join("x".repeat(300));
        assert!(matches!(begin(&no_name), Err(WriteError::Io { .. })));
        assert!(mark.exists());
    }

    #[test]
    fn a_part_that_cannot_be_begun_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("parts.mcap");
        let rig = synthetic::rig(Size::new(64, 48));
        let settings = Settings {
            max_bytes: Some(1_000_000),
            ..Settings::default()
        };
        let mut encoder = synthetic::encoder(&rig, &settings);
        let first = path.clone();
        let open: Open = Box::new(move |path| {
            Ok(Box::new(Small {
                file: File::create(path).unwrap(),
                room: if path == first { u64::MAX } else { 100 },
                allocates: false,
                allocated: 0,
            }))
        });
        let identity = Identity {
            recording: "x".to_owned(),
            part: 0,
        };
        let metadata = synthetic::metadata(&rig);
        let mut writer =
            Writer::start(&path, identity, &metadata, &encoder, &settings, open).unwrap();
        let mut write = |sequence| {
            let batch = synthetic::batch(&mut encoder, &Scan::new(&rig, sequence, 6));
            writer.write(&batch)
        };
        let error = (0..).find_map(|sequence| write(sequence).err()).unwrap();
        assert!(matches!(error, WriteError::Full(_)), "{error}");
        let told = error.to_string();
        assert!(told.contains("parts.mcap holds all"), "{told}");
        let written = writer.finish(None).unwrap();
        assert_eq!(written.parts, std::slice::from_ref(&path));
        let left = fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 1, "the part that could not be begun is gone");
        let recording = Recording::open(&path).unwrap();
        assert!(recording.scans().eq(0..written.scans));
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
