//! Recordings made from recordings: recovered, merged, split, filtered.
//!
//! ```text
//! parts, whole or damaged ─► Recording ─► scans, each topic once ─► Rewriter ─► out.mcap, out.1.mcap …
//! ```
//!
//! Messages are copied as they are, byte for byte, but for those that refer to a message that is left out: they are
//! written so that they stand alone. Metadata, attachments and schemas go into every part. The input is only read. A part gets its name when it is finished: until then it is called `.name.part`.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::ops::Range;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions};
use messages::record::{Beside, Codec, DIGESTS, Said, Schema, TRANSFORMS, VERSIONS};
use messages::recording::{
    FileSchema, Identity, Metadata, ReadError, Recording, Scan, ScanOrder, part_path,
};
use messages::{Curves, Edges, Kind, Matches, Rig, Stage, Tables, Topic};
use serde::Serialize;
use thiserror::Error;

use crate::{Compression, Keep, Settings, WriteError, Writer};

/// Why recordings could not be rewritten.
#[derive(Debug, Error)]
pub enum RewriteError {
    /// An input cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The output cannot be begun.
    #[error(transparent)]
    Begin(#[from] WriteError),
    /// The output cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: McapError,
    },
    /// The output is one of the inputs.
    #[error("{} is read and cannot be written too; choose another name", .0.display())]
    OntoItself(PathBuf),
    /// Inputs of different rigs.
    #[error(
        "{} and {} are of different rigs (views, channels, image size or calibration) and cannot be one recording",
        one.display(),
        other.display()
    )]
    Rigs {
        /// The first input.
        one: PathBuf,
        /// The one that differs.
        other: PathBuf,
    },
    /// Two inputs were computed with different settings.
    #[error(
        "{} and {} were computed with different settings of {stage}: what holds of one recording does not of the other",
        one.display(), other.display()
    )]
    Settings {
        /// The one.
        one: PathBuf,
        /// The one that differs.
        other: PathBuf,
        /// The first stage whose settings differ.
        stage: &'static str,
    },
    /// Two inputs were computed by builds whose stages have other versions.
    #[error(
        "{} and {} were computed by builds of different versions: what holds of one recording does not of the other",
        one.display(), other.display()
    )]
    Versions {
        /// The one.
        one: PathBuf,
        /// The one that differs.
        other: PathBuf,
    },
    /// Of several inputs, one has settings that changed while it was recorded.
    #[error(
        "settings were changed while {} was recorded, and that holds by its own scans' numbers: it cannot be merged with others",
        .0.display()
    )]
    Changed(PathBuf),
    /// One is a proof and another one is not.
    #[error("{} is a proof and cannot be merged with what is none: rehydrate it first", .0.display())]
    Proof(PathBuf),
    /// Nothing was chosen.
    #[error("no scan is left to write; the input holds {0}")]
    Nothing(String),
}

/// What is to be written of the inputs.
pub struct Wanted<'a> {
    /// Which topics; transforms and calibrations are kept in any case.
    pub topic: &'a dyn Fn(&str) -> bool,
    /// Which scans, by their numbers in the input.
    pub scans: Range<u64>,
    /// When a new part begins.
    pub split: Split,
    /// Whether a file that is there is overwritten.
    pub overwrite: bool,
    /// A recording's settings in the keys of this build, so that recordings of then and now can be told to be of the same.
    pub settings: &'a dyn Fn(&serde_json::Value) -> serde_json::Value,
    /// Called after each scan with how many are written, of how many.
    pub progress: &'a mut dyn FnMut(usize, usize),
}

impl std::fmt::Debug for Wanted<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Wanted")
            .field("scans", &self.scans)
            .field("split", &self.split)
            .finish_non_exhaustive()
    }
}

/// When a new part begins; never, by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Split {
    /// After so many bytes of messages.
    pub bytes: Option<u64>,
    /// After so many seconds of recorded time.
    pub seconds: Option<f64>,
    /// After so many scans.
    pub scans: Option<u64>,
}

/// What came of rewriting.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Rewritten {
    /// The parts written.
    pub parts: Vec<PathBuf>,
    /// Scans of which at least one message is written.
    pub scans: u64,
    /// Of these, those that have a message of every data topic of the recording.
    pub whole: u64,
    /// Messages by topic.
    pub messages: BTreeMap<String, u64>,
    /// Bytes of the inputs that could not be read.
    pub unreadable_bytes: u64,
    /// Scans of which there are several messages of a topic that say different things: the first is written.
    pub contradicted: u64,
    /// Whether scans of an input are missing: what cannot be read, parts that are not there, what is contradicted.
    pub lacks_scans: bool,
    /// What is the matter with the inputs, a sentence each.
    pub notes: Vec<String>,
}

/// Writes what is wanted of these recordings, one after the other, as one. Scans of parts of one recording keep their
/// numbers; those of a further recording are numbered on.
///
/// # Errors
/// When an input is no recording, or the output cannot be written; no part that is not finished is left behind.
pub fn rewrite(
    inputs: &[PathBuf],
    out: &Path,
    wanted: Wanted<'_>,
) -> Result<Rewritten, RewriteError> {
    let mut recordings = inputs
        .iter()
        .map(|path| Recording::open(path))
        .collect::<Result<Vec<_>, _>>()?;
    // What is written over is not only the first part.
    let old = Writer::check(out, wanted.overwrite)?;
    let read = recordings.iter().flat_map(|recording| &recording.parts);
    let read: Vec<PathBuf> = read.map(|part| part.path.clone()).collect();
    if let Some(part) = read_and_written(&read, old.iter().map(PathBuf::as_path).chain([out])) {
        return Err(RewriteError::OntoItself(part));
    }
    if let Some(other) = recordings
        .iter()
        .find(|other| !are_of_one_rig(other.metadata(), recordings[0].metadata()))
    {
        return Err(RewriteError::Rigs {
            one: recordings[0].path().to_owned(),
            other: other.path().to_owned(),
        });
    }
    if let Some((other, stage)) = recordings.iter().find_map(|other| {
        let stage = differing_stage(&recordings[0], other, wanted.settings)?;
        Some((other, stage))
    }) {
        let (one, other) = (recordings[0].path().to_owned(), other.path().to_owned());
        return Err(match stage {
            VERSIONS => RewriteError::Versions { one, other },
            stage => RewriteError::Settings { one, other, stage },
        });
    }
    let is_proof = |recording: &&Recording| recording.is_proof();
    if let Some(proof) = recordings.iter().find(is_proof)
        && !recordings.iter().all(|recording| recording.is_proof())
    {
        return Err(RewriteError::Proof(proof.path().to_owned()));
    }
    let is_changed = |recording: &&Recording| !recording.changes().is_empty();
    if let Some(changed) = recordings.iter().find(is_changed)
        && recordings.len() > 1
    {
        return Err(RewriteError::Changed(changed.path().to_owned()));
    }
    let is_wanted = |scan: u64| wanted.scans.contains(&scan);
    if !recordings
        .iter()
        .any(|recording| recording.scans().any(is_wanted))
    {
        let held: Vec<String> = recordings.iter().map(Recording::held).collect();
        return Err(RewriteError::Nothing(held.join("; ")));
    }
    for old in old {
        fs::remove_file(&old).map_err(|source| write_error(&old, source.into()))?;
    }
    let Some(first) = recordings.first() else {
        return Err(RewriteError::Nothing("nothing".to_owned()));
    };
    let (metadata, unknown) = common(first, &recordings);
    let frame = Frame::of(metadata, &mut recordings, wanted.topic)?;
    let chosen = |recording: &Recording| -> Vec<u64> {
        recording
            .scans()
            .filter(|scan| wanted.scans.contains(scan))
            .collect()
    };
    let all: usize = recordings
        .iter()
        .map(|recording| chosen(recording).len())
        .sum();
    let codec = Codec::new(frame.metadata.rig.clone(), frame.metadata.reference);
    let mut rewriter = Rewriter::new(out, frame, codec, wanted.split);
    rewriter.done.notes.extend(unknown);
    let mut done = 0;
    let mut offset = 0;
    for recording in &mut recordings {
        let mut next = offset;
        let whole = recording.whole_scans();
        rewriter.done.unreadable_bytes += recording.unreadable_bytes();
        rewriter.done.lacks_scans |= recording.lacks_scans();
        let before = rewriter.done.contradicted;
        for scan in chosen(recording) {
            let (mut read, unreadable) = recording.salvage(scan)?;
            rewriter.done.unreadable_bytes += unreadable;
            rewriter.done.contradicted += u64::from(!read.contradicted.is_empty());
            rewriter.done.lacks_scans |= unreadable > 0 || !read.contradicted.is_empty();
            read.sequence = scan + offset;
            next = next.max(read.sequence + 1);
            rewriter.write(&read, wanted.topic)?;
            recording.reuse(read);
            rewriter.done.whole += u64::from(unreadable == 0 && whole.binary_search(&scan).is_ok());
            done += 1;
            (wanted.progress)(done, all);
        }
        let notes = recording.notes().iter().chain(recording.remarks());
        rewriter.done.notes.extend(notes.cloned());
        let contradicted = rewriter.done.contradicted - before;
        if contradicted > 0 {
            rewriter.done.notes.push(format!(
                "{contradicted} scans of {} have two different messages of a topic, as when recordings with the same \
                 numbers and times are merged: only the first is written",
                recording.path().display()
            ));
        }
        offset = next;
    }
    if rewriter.done.scans == 0 {
        return Err(RewriteError::Nothing("none of the topics".to_owned()));
    }
    rewriter.finish()
}

/// The first file that is read and would be written too.
pub fn read_and_written<'a>(
    read: &[PathBuf],
    written: impl IntoIterator<Item = &'a Path>,
) -> Option<PathBuf> {
    let real = |path: &Path| fs::canonicalize(path).ok();
    let written: Vec<PathBuf> = written.into_iter().filter_map(real).collect();
    let is_both = |path: &&PathBuf| real(path).is_some_and(|path| written.contains(&path));
    read.iter().find(is_both).cloned()
}

/// The first stage that two recordings were computed with different settings of, as far as they say it.
fn differing_stage(
    one: &Recording,
    other: &Recording,
    settings: &dyn Fn(&serde_json::Value) -> serde_json::Value,
) -> Option<&'static str> {
    let are_proofs = one.is_proof() && other.is_proof();
    let (one, other) = (one.metadata(), other.metadata());
    if !one.knows_settings() || !other.knows_settings() {
        return None;
    }
    // Digests are of settings as they stand there.
    let said = |metadata: &Metadata| match are_proofs {
        true => metadata.configuration.clone(),
        false => settings(&metadata.configuration),
    };
    let (settings, others) = (said(one), said(other));
    let differs = |stage: &Stage| settings.get(stage.name()) != others.get(stage.name());
    let differing = Stage::computing().into_iter().find(differs);
    // Digests hold for the versions that they were made with, and no topic has messages of two kinds of filter.
    let versions = |metadata: &Metadata| metadata.configuration.get(VERSIONS).cloned();
    let (one, other) = (versions(one), versions(other));
    let stage_differs = |stage: &Stage| {
        let version = |versions: &Option<serde_json::Value>| {
            versions
                .as_ref()
                .and_then(|known| known.get(stage.name()).cloned())
        };
        matches!((version(&one), version(&other)), (Some(one), Some(other)) if one != other)
    };
    let differ = Stage::all().iter().any(stage_differs) || (are_proofs && one != other);
    differing.map(Stage::name).or(differ.then_some(VERSIONS))
}

/// A schema of ours as this build describes it, which is all that builds before described, and more: what is written anew
/// may need it.
fn described(schema: &FileSchema) -> FileSchema {
    let now = Kind::all().map(Schema::of);
    let mut same = now.filter(|now| now.name == schema.name && now.encoding == schema.encoding);
    match same.next().filter(|now| now.name.starts_with("tricurve.")) {
        Some(now) => FileSchema {
            data: now.data,
            ..schema.clone()
        },
        None => schema.clone(),
    }
}

/// Whether two recordings are of one rig, as far as they say it: what is read from messages knows nothing of triples.
fn are_of_one_rig(one: &Metadata, other: &Metadata) -> bool {
    if one.knows_settings() && other.knows_settings() {
        return one.rig == other.rig;
    }
    let camera = |rig: &Rig| {
        let camera = rig.calibration(rig.size);
        let baseline_m = if rig.rail.is_some() {
            0.0
        } else {
            camera.baseline_m
        };
        [camera.focal_px, camera.cx, camera.cy, baseline_m]
    };
    let is_near = |(one, other): (f64, f64)| (one - other).abs() <= 1e-9 * one.abs().max(1.0);
    let (one, other) = (&one.rig, &other.rig);
    let mut cameras = camera(one).into_iter().zip(camera(other));
    (&one.views, &one.channels, one.size, one.rail.is_some())
        == (
            &other.views,
            &other.channels,
            other.size,
            other.rail.is_some(),
        )
        && cameras.all(is_near)
}

/// What recordings of one rig say about themselves together: settings only where all say them. With what is to be said of
/// that.
fn common(first: &Recording, all: &[Recording]) -> (Metadata, Option<String>) {
    let knows = |recording: &&Recording| recording.metadata().knows_settings();
    let Some(unknown) = all.iter().find(|recording| !knows(recording)) else {
        return (first.metadata().clone(), None);
    };
    let fullest = all.iter().find(knows).unwrap_or(first);
    let note = format!(
        "{} does not say its settings, so that what is written says none: to replay it, give them",
        unknown.path().display()
    );
    let metadata = Metadata {
        graph: String::new(),
        configuration: serde_json::Value::Null,
        ..fullest.metadata().clone()
    };
    (metadata, Some(note))
}

/// What stands in every part besides the scans.
struct Frame {
    metadata: Metadata,
    recording: String,
    further: Vec<mcap::records::Metadata>,
    attachments: Vec<mcap::Attachment<'static>>,
    channels: Vec<Definition>,
}

/// A channel, as every part defines it.
struct Definition {
    topic: String,
    /// How its messages are encoded.
    encoding: String,
    schema: Option<FileSchema>,
}

impl Frame {
    fn of(
        metadata: Metadata,
        recordings: &mut [Recording],
        topic: &dyn Fn(&str) -> bool,
    ) -> Result<Self, RewriteError> {
        let mut frame = Self {
            metadata,
            recording: crate::writer::unique(),
            further: Vec::new(),
            attachments: Vec::new(),
            channels: Vec::new(),
        };
        let many = recordings.len() > 1;
        for recording in recordings {
            // The account of one run is not that of several.
            frame
                .further
                .extend(recording.further_metadata().filter(|_| !many).cloned());
            for attachment in recording.attachments()? {
                if frame
                    .attachments
                    .iter()
                    .all(|known| known.name != attachment.name)
                {
                    frame.attachments.push(attachment);
                }
            }
            for (name, encoding, schema) in recording.definitions() {
                let is_known = frame.channels.iter().any(|known| known.topic == name);
                if !is_known && (is_kept_always(name) || topic(name)) {
                    frame.channels.push(Definition {
                        topic: name.to_owned(),
                        encoding: encoding.to_owned(),
                        schema: schema.map(described),
                    });
                }
            }
        }
        Ok(frame)
    }
}

/// Transforms and calibrations: without them nothing is in its place.
fn is_kept_always(topic: &str) -> bool {
    topic == TRANSFORMS || topic.ends_with("/calibration")
}

/// A part being written.
struct Part {
    path: PathBuf,
    unfinished: PathBuf,
    writer: mcap::Writer<BufWriter<File>>,
    channels: BTreeMap<String, u16>,
    first_nanos: u64,
    bytes: u64,
    scans: u64,
    order: ScanOrder,
}

impl Drop for Part {
    fn drop(&mut self) {
        // Of a finished part there is nothing left under this name.
        fs::remove_file(&self.unfinished).unwrap_or_default();
    }
}

struct Rewriter {
    out: PathBuf,
    frame: Frame,
    codec: Codec,
    topics: Vec<Topic>,
    split: Split,
    part: Option<Part>,
    done: Rewritten,
}

impl Rewriter {
    fn new(out: &Path, frame: Frame, codec: Codec, split: Split) -> Self {
        Self {
            out: out.to_owned(),
            frame,
            topics: Topic::all(codec.rig()),
            codec,
            split,
            part: None,
            done: Rewritten::default(),
        }
    }

    fn write(&mut self, scan: &Scan, topic: &dyn Fn(&str) -> bool) -> Result<(), RewriteError> {
        if self
            .part
            .as_ref()
            .is_some_and(|part| self.is_full(part, scan))
        {
            self.close_part()?;
        }
        if self.part.is_none() {
            let number = self.done.parts.len() as u32;
            self.part = Some(open_part(&self.out, number, &self.frame, scan.nanos)?);
        }
        let Some(part) = &mut self.part else {
            return Ok(());
        };
        let mut any = false;
        for (name, bytes) in scan.messages() {
            let Some(&channel_id) = part
                .channels
                .get(name)
                .filter(|_| is_kept_always(name) || topic(name))
            else {
                continue;
            };
            let header = MessageHeader {
                channel_id,
                sequence: scan.sequence as u32,
                log_time: scan.nanos,
                publish_time: scan.nanos,
            };
            let changed = match self.topics.iter().find(|known| known.name == name) {
                Some(known) => alone(&mut self.codec, scan, known, topic),
                None => renumbered(name, bytes, scan.sequence),
            };
            let bytes = changed.as_deref().unwrap_or(bytes);
            part.writer
                .write_to_known_channel(&header, bytes)
                .map_err(|source| write_error(&part.path, source))?;
            part.bytes += bytes.len() as u64;
            *self.done.messages.entry(name.to_owned()).or_default() += 1;
            any = true;
        }
        // A chunk holds one scan: it is found without reading others.
        part.writer
            .flush()
            .map_err(|source| write_error(&part.path, source))?;
        part.scans += u64::from(any);
        if any {
            part.order.push(scan.sequence, scan.nanos);
        }
        self.done.scans += u64::from(any);
        Ok(())
    }

    fn is_full(&self, part: &Part, scan: &Scan) -> bool {
        let Split {
            bytes,
            seconds,
            scans,
        } = self.split;
        let elapsed = scan.nanos.abs_diff(part.first_nanos) as f64 / 1e9;
        bytes.is_some_and(|most| part.bytes >= most)
            || seconds.is_some_and(|most| elapsed >= most)
            || scans.is_some_and(|most| part.scans >= most)
    }

    fn close_part(&mut self) -> Result<(), RewriteError> {
        let Some(mut part) = self.part.take() else {
            return Ok(());
        };
        let error = |source| write_error(&part.path, source);
        if let Some(order) = part.order.to_record() {
            let order = mcap::records::Metadata {
                name: order.name,
                metadata: order.metadata,
            };
            part.writer.write_metadata(&order).map_err(error)?;
        }
        part.writer.finish().map_err(error)?;
        fs::rename(&part.unfinished, &part.path).map_err(|e| write_error(&part.path, e.into()))?;
        self.done.parts.push(part.path.clone());
        Ok(())
    }

    fn finish(mut self) -> Result<Rewritten, RewriteError> {
        self.close_part()?;
        Ok(self.done)
    }
}

/// A message that refers to one that is left out, as it stands alone. One that cannot be read stays as it is.
fn alone(
    codec: &mut Codec,
    scan: &Scan,
    topic: &Topic,
    is_kept: &dyn Fn(&str) -> bool,
) -> Option<Vec<u8>> {
    let mut names = scan.messages().map(|(name, _)| name);
    // What refers by way of others is as true as before, once these stand alone.
    if !names.any(|name| codec.refers_itself(topic, name) && !is_kept(name)) {
        return None;
    }
    let mut encoded = Vec::new();
    macro_rules! encode {
        ($kind:ident) => {{
            // One that could refer need not do so.
            let (bytes, nobody) = (scan.message(&topic.name)?, |_: Kind| None::<Said<'_>>);
            if codec
                .decode::<$kind>(topic, scan.sequence, scan.nanos, bytes, &nobody)
                .is_ok()
            {
                return None;
            }
            let read = scan.decode::<$kind>(codec, topic).ok()?;
            let (header, view) = (read.header, read.view().into());
            codec.encode(topic, &header, view, Beside::default(), &mut encoded);
        }};
    }
    match topic.kind {
        Kind::Edges => encode!(Edges),
        Kind::Curves => encode!(Curves),
        Kind::Tables => encode!(Tables),
        Kind::Matches => encode!(Matches),
        _ => return None,
    }
    Some(encoded)
}

/// The statistics of a scan that has another number now; nothing else says its number itself.
fn renumbered(topic: &str, bytes: &[u8], sequence: u64) -> Option<Vec<u8>> {
    if topic != "statistics" {
        return None;
    }
    let mut statistics: serde_json::Value = serde_json::from_slice(bytes).ok()?;
    let scan = statistics
        .get_mut("scan")
        .filter(|scan| **scan != sequence)?;
    *scan = sequence.into();
    serde_json::to_vec(&statistics).ok()
}

fn open_part(out: &Path, number: u32, frame: &Frame, nanos: u64) -> Result<Part, RewriteError> {
    let path = part_path(out, number);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let unfinished = path.with_file_name(format!(".{name}.part"));
    let error = |source: McapError| write_error(&path, source);
    let file = File::create(&unfinished).map_err(|e| error(e.into()))?;
    // What the recorder would have chosen.
    let is_proof = |definition: &Definition| definition.topic == DIGESTS;
    let keep = match frame.channels.iter().any(is_proof) {
        true => Keep::Proof,
        false => Keep::All,
    };
    let settings = Settings {
        keep,
        ..Settings::default()
    };
    let compression = match settings.compression() {
        Compression::None => None,
        Compression::Lz4 => Some(mcap::Compression::Lz4),
        Compression::Zstd => Some(mcap::Compression::Zstd),
    };
    let writer = WriteOptions::new()
        .compression(compression)
        .chunk_size(None)
        .library(format!("tricurve {}", frame.metadata.version))
        .create(BufWriter::new(file))
        .map_err(error)?;
    let mut part = Part {
        writer,
        channels: BTreeMap::new(),
        first_nanos: nanos,
        bytes: 0,
        scans: 0,
        order: ScanOrder::default(),
        unfinished: unfinished.clone(),
        path: path.clone(),
    };
    let identity = Identity {
        recording: frame.recording.clone(),
        part: number,
    };
    let own = frame.metadata.to_record(&identity);
    for record in std::iter::once(&own).chain(&frame.further) {
        let metadata = mcap::records::Metadata {
            name: record.name.clone(),
            metadata: record.metadata.clone(),
        };
        part.writer.write_metadata(&metadata).map_err(error)?;
    }
    for attachment in &frame.attachments {
        part.writer.attach(attachment).map_err(error)?;
    }
    for definition in &frame.channels {
        let schema = match &definition.schema {
            Some(FileSchema {
                name,
                encoding,
                data,
            }) => part
                .writer
                .add_schema(name, encoding, data)
                .map_err(error)?,
            None => 0,
        };
        let Definition {
            topic, encoding, ..
        } = definition;
        let id = part
            .writer
            .add_channel(schema, topic, encoding, &BTreeMap::new())
            .map_err(error)?;
        part.channels.insert(topic.clone(), id);
    }
    Ok(part)
}

fn write_error(path: &Path, source: McapError) -> RewriteError {
    match source {
        McapError::Io(source) if source.kind() == io::ErrorKind::StorageFull => {
            RewriteError::Begin(WriteError::Full(path.to_owned()))
        }
        source => RewriteError::Write {
            path: path.to_owned(),
            source,
        },
    }
}
