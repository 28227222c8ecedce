//! A recorder beside a running graph: a guest, for whom nobody waits.
//!
//! ```text
//! running graph ─► Guest ─► Encoder ─► WriterThread ─► file, with what it missed
//!                              └─► the last seconds in memory ─► a file when asked
//! ```

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use messages::bus::{
    Answer, Ask, BusError, Guest, Joined, LOOK_EVERY, Log, Run, ask, read_changes,
};
use messages::ledger::Ledger;

use crate::{
    Batch, Encoder, Metadata, Settings, WriteError, Writer, WriterThread, encoder, part_path, spawn,
};

/// Why recording beside a graph failed.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The system gives no thread.
    #[error("cannot start the writer's thread: {0}")]
    Thread(std::io::Error),
}

/// What is recorded, and where.
pub struct Attach<'a> {
    /// The running graph.
    pub run: &'a Run,
    /// What the recording says about itself.
    pub metadata: Metadata,
    /// Which topics; transforms and calibrations are recorded in any case.
    pub topic: &'a dyn Fn(&str) -> bool,
    /// File, compression, when a new part begins.
    pub settings: Settings,
    /// End after so many scans.
    pub scans: Option<u64>,
    /// Keep so many seconds in memory, and write them when asked.
    pub snapshot: Option<f64>,
}

impl std::fmt::Debug for Attach<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Attach")
            .field("run", &self.run)
            .field("settings", &self.settings)
            .field("snapshot", &self.snapshot)
            .finish_non_exhaustive()
    }
}

/// What somebody wants of the recorder between two scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Go on.
    Nothing,
    /// Write the last seconds now.
    Snapshot,
    /// Come to an end.
    End,
}

/// How the recorder is doing.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Attached {
    /// Scans taken in.
    pub scans: u64,
    /// Scans missed since the first, because the recorder was too slow.
    pub missed: u64,
    /// Scans taken in that are not written yet.
    pub behind: u64,
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Bytes written.
    pub bytes: u64,
}

/// Scans that may wait for the disk before further ones are missed: the graph's memory is not held for them, only ours.
const MOST_BEHIND: u64 = 64;

/// Records beside a running graph until `wish` says to end; `wish` is called again and again with how it goes.
///
/// # Errors
/// When the run has no room for a guest, or the file cannot be written.
pub fn attach(
    attach: Attach<'_>,
    mut wish: impl FnMut(&Attached) -> Wish,
) -> Result<Attached, AttachError> {
    let Attach {
        run,
        metadata,
        topic,
        settings,
        scans,
        snapshot,
    } = attach;
    let made = run.kinds();
    let encoder = encoder(
        &metadata.rig,
        metadata.reference,
        &made,
        run.cameras,
        &settings,
    )
    .only(topic);
    let path = PathBuf::from(&settings.file);
    let mut guest = Guest::join(run, &format!("record.{}", std::process::id()), &made)?;
    let keep = match snapshot {
        Some(seconds) => Keep::Memory(Box::new(Memory {
            seconds,
            kept: VecDeque::new(),
            path,
            settings,
            metadata,
        })),
        None => {
            let writer = Writer::create(&path, settings.overwrite, &metadata, &encoder, &settings)?;
            Keep::File(spawn(writer, || {}).map_err(AttachError::Thread)?)
        }
    };
    let mut recorder = Recorder {
        root: run.root.clone(),
        noted: 0,
        last: None,
        said: Said::default(),
        encoder,
        keep,
        spare: Vec::new(),
        told: Attached::default(),
    };
    loop {
        let mut any = false;
        while recorder.told.behind < MOST_BEHIND
            && scans.is_none_or(|most| recorder.told.scans < most)
            && let Some(scan) = guest.scan_now()?
        {
            any = true;
            recorder.take(&scan)?;
        }
        recorder.told.missed = guest.missed();
        recorder.hear_writer()?;
        recorder.said.hear(run);
        match wish(&recorder.told) {
            Wish::Nothing if any => {}
            Wish::Nothing => std::thread::sleep(LOOK_EVERY),
            Wish::Snapshot => recorder.snapshot()?,
            Wish::End => return recorder.finish(),
        }
    }
}

/// Where scans are kept.
enum Keep {
    File(WriterThread),
    Memory(Box<Memory>),
}

/// The last seconds.
struct Memory {
    seconds: f64,
    kept: VecDeque<Batch>,
    path: PathBuf,
    settings: Settings,
    metadata: Metadata,
}

/// Keeps a scan beside those of the last seconds, and gives those that were taken too long before it; or after it, where a
/// player sought back or a clock was set back.
fn keep(kept: &mut VecDeque<Batch>, seconds: f64, batch: Batch) -> Vec<Batch> {
    let now = batch.nanos();
    let is_of_now = |kept: &Batch| kept.nanos().abs_diff(now) as f64 <= seconds * 1e9;
    let gone = kept.iter().take_while(|kept| !is_of_now(kept)).count();
    let gone = kept.drain(..gone).collect();
    kept.push_back(batch);
    gone
}

/// How often the launcher is asked what was said.
const ASK_EVERY: Duration = Duration::from_secs(1);

/// What was said in the run, from the first line on.
#[derive(Debug, Default)]
struct Said {
    /// What is not in the recording yet.
    lines: Vec<Log>,
    /// The next line that is to be asked for.
    next: u64,
    asked: Option<Instant>,
}

impl Said {
    /// Asks the launcher, now and then.
    fn hear(&mut self, run: &Run) {
        if self.asked.is_some_and(|asked| asked.elapsed() < ASK_EVERY) {
            return;
        }
        self.asked = Some(Instant::now());
        // A launcher that has ended says nothing more.
        while let Ok(Answer::Said { from, lines }) = ask(&run.root, &Ask::Said { from: self.next })
            && !lines.is_empty()
        {
            self.next = from + lines.len() as u64;
            self.lines.extend(lines);
        }
    }

    fn write(&mut self, encoder: &Encoder, batch: &mut Batch) {
        for Log { level, node, text } in self.lines.drain(..) {
            encoder.log(level.into(), &node, &text, batch);
        }
    }
}

struct Recorder {
    /// The run's folder.
    root: PathBuf,
    /// How many changes of settings are in the recording.
    noted: usize,
    /// Number and time of the last scan handed to the writer.
    last: Option<(u64, u64)>,
    said: Said,
    encoder: Encoder,
    keep: Keep,
    spare: Vec<Batch>,
    told: Attached,
}

impl Recorder {
    fn take(&mut self, scan: &Joined) -> Result<(), AttachError> {
        let views = scan.views()?;
        let mut batch = self.spare.pop().unwrap_or_default();
        self.encoder.encode(&views, &mut batch);
        let changes = read_changes(&self.root);
        // A snapshot's scans come and go: each must know.
        if changes.len() > self.noted {
            if let Keep::File(_) = self.keep {
                self.noted = changes.len();
            }
            batch.set_changes(changes);
        }
        self.told.scans += 1;
        match &mut self.keep {
            Keep::File(thread) => {
                self.told.behind += 1;
                self.last = Some((batch.sequence(), batch.nanos()));
                self.said.write(&self.encoder, &mut batch);
                thread.write(batch);
            }
            Keep::Memory(memory) => {
                let gone = keep(&mut memory.kept, memory.seconds, batch);
                self.spare.extend(gone);
            }
        }
        Ok(())
    }

    fn hear_writer(&mut self) -> Result<(), AttachError> {
        if let Keep::File(thread) = &self.keep {
            for report in thread.reports().try_iter() {
                self.told.bytes += report.result?;
                self.told.behind -= 1;
                self.spare.push(report.batch);
            }
        }
        Ok(())
    }

    /// Writes the last seconds to the next file that is free.
    fn snapshot(&mut self) -> Result<(), AttachError> {
        let Keep::Memory(memory) = &mut self.keep else {
            return Ok(());
        };
        let path = free_name(&memory.path);
        let overwrite = memory.settings.overwrite && path == memory.path;
        let mut writer = Writer::create(
            &path,
            overwrite,
            &memory.metadata,
            &self.encoder,
            &memory.settings,
        )?;
        for batch in &memory.kept {
            writer.write(batch)?;
        }
        let account = account(memory.kept.len() as u64);
        self.told.bytes += writer.finish(Some(&account))?.bytes;
        self.told.files.push(path);
        Ok(())
    }

    fn finish(mut self) -> Result<Attached, AttachError> {
        match self.keep {
            Keep::Memory(_) => Ok(self.told),
            Keep::File(thread) => {
                if let Some((sequence, nanos)) = self.last
                    && !self.said.lines.is_empty()
                {
                    let mut batch = self.spare.pop().unwrap_or_default();
                    batch.close(sequence, nanos);
                    self.said.write(&self.encoder, &mut batch);
                    thread.write(batch);
                }
                let written = thread.finish(Some(&account(self.told.scans)))?;
                self.told.behind = 0;
                self.told.bytes = written.bytes;
                self.told.files = written.parts;
                Ok(self.told)
            }
        }
    }
}

/// What a guest has seen is no account of the run: it says how many scans were recorded, and that this was all.
fn account(scans: u64) -> Ledger {
    Ledger {
        admitted: scans,
        done: scans,
        ..Ledger::default()
    }
}

/// The path itself, or with a number before its extension, and a dash, so that it is taken for no part of another.
fn free_name(path: &Path) -> PathBuf {
    if !path.exists() {
        return path.to_owned();
    }
    let numbered = |number: u32| {
        let part = part_path(path, number);
        let name = part.file_name().unwrap_or_default().to_string_lossy();
        let name = name.replacen(&format!(".{number}"), &format!("-{number}"), 1);
        part.with_file_name(name)
    };
    (1..)
        .map(numbered)
        .find(|path| !path.exists())
        .unwrap_or_else(|| path.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_seconds_are_kept_and_no_more_when_time_goes_back() {
        let mut all = VecDeque::new();
        let mut keep = |second: u64| {
            keep(&mut all, 10.0, Batch::taken_at(second * 1_000_000_000));
            let kept = all.iter().map(|batch| batch.nanos() / 1_000_000_000);
            kept.collect::<Vec<_>>()
        };
        for second in 1000..1030 {
            keep(second);
        }
        assert_eq!(keep(1030), (1020..=1030).collect::<Vec<_>>());
        assert_eq!(keep(400), [400]);
        assert_eq!(keep(401), [400, 401]);
        // A little is no other place.
        assert_eq!(keep(399), [400, 401, 399]);
    }
}
