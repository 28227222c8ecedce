//! What launcher and nodes say to each other: one JSON line each, over the node's standard input and output.

use std::collections::BTreeMap;
use std::io::{BufRead, Write};
use std::time::Duration;

use crossbeam::channel::{Receiver, unbounded};
use serde::{Deserialize, Serialize};

use super::meter::Percentiles;
use super::{Bell, BusError, Run};
use crate::change::Change;
use crate::ledger::{Account, Ledger};
use crate::synchronisation::Synchronisation;

/// What the launcher tells a node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "command", rename_all = "lowercase")]
pub enum Command {
    /// New publishers are there: connect, and answer [`Event::Connected`].
    Connect,
    /// Everybody is connected: begin.
    Begin,
    /// Send the scans under way once more.
    Resend,
    /// Take in no new scan; say [`Event::Finished`] when the last one is done.
    Drain,
    /// Play otherwise; for the source.
    Play {
        /// How.
        play: Play,
    },
    /// Let no scan in, and answer [`Event::Held`]; for the source.
    Hold,
    /// Let scans in again.
    Go,
    /// Settings hold otherwise from a scan on that is not let in yet: note it, and answer [`Event::Changed`].
    Change {
        /// How many there were before.
        before: usize,
        /// Which.
        changes: Vec<Change>,
    },
    /// Lines were said, by anybody of the run: record them, and say [`Event::Written`] when they are on the disk. For who
    /// said [`Event::Listens`].
    Said {
        /// The number of the first of them.
        from: u64,
        /// The lines.
        lines: Vec<Log>,
    },
    /// End.
    Stop {
        /// The whole run's account.
        ledger: Option<Ledger>,
    },
}

/// How the source is to go on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Play {
    /// Stop playing if it plays, else go on.
    Pause,
    /// Stop playing.
    Stop,
    /// Go on playing.
    Resume,
    /// One scan, then pause.
    Step,
    /// At twice the rate.
    Faster,
    /// At half the rate.
    Slower,
    /// At this rate; a recording only.
    Rate(f64),
    /// With the first scan at or after this time, in nanoseconds since 1970; a recording only.
    Seek(u64),
}

/// How the source plays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Playing {
    /// Whether it is paused.
    pub is_paused: bool,
    /// Whether it is a recording that can be played at a rate, and sought in.
    pub is_recording: bool,
    /// At which rate; without one as fast as it goes, or as the camera takes them.
    pub rate: Option<f64>,
    /// When the first scan of the recording was taken and when the last, in nanoseconds since 1970.
    pub span: Option<(u64, u64)>,
    /// When the next scan was taken, where it is known beforehand.
    pub next_nanos: Option<u64>,
    /// Number of the first scan let in since it was last sought in; those before it are of another place.
    #[serde(default)]
    pub sought_from: Option<u64>,
}

/// How grave a log line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Rare, and for the user.
    Info,
    /// Something is degraded.
    Warn,
    /// Data was lost.
    Error,
}

/// A log line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Log {
    /// How grave it is.
    pub level: Level,
    /// Which node says it.
    pub node: String,
    /// What it says.
    pub text: String,
}

/// How far the scans have come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Scans that went through the door.
    pub admitted: u64,
    /// Every scan below this number is done.
    pub done_below: u64,
    /// Scans that are done.
    pub done: u64,
    /// Scans in all, when that is known.
    pub total: Option<u64>,
    /// The source's next scan.
    pub next_tick: u64,
    /// The scans under way, and which scan of the source each is.
    pub under_way: Vec<(u64, u64)>,
    /// Scans that are done and that others depend on, likewise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub past: Vec<(u64, u64)>,
    /// Scans that never went through the door, by cause.
    #[serde(default)]
    pub refused: BTreeMap<String, u64>,
}

/// What a node has counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NodeReport {
    /// Which node.
    pub node: String,
    /// Its account of each topic.
    pub topics: BTreeMap<String, Account>,
    /// How long it works on a scan.
    pub milliseconds: Percentiles,
    /// Counts of its own.
    pub counts: BTreeMap<String, u64>,
    /// Different scans it has said to be done, if it is one that says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub done: Option<u64>,
    /// Bytes its process has published: what messages hold, not the room they had.
    #[serde(default)]
    pub bytes: u64,
    /// How long its process had been part of the run, in seconds.
    #[serde(default)]
    pub seconds: f64,
    /// How many times it was started before in this run.
    #[serde(default)]
    pub life: u32,
    /// What came of the cameras' frames; of the node that takes them in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub synchronisation: Option<Box<Synchronisation>>,
    /// What makes results doubtful.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Why it could not do all of its work.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

/// What a node tells the launcher.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "lowercase")]
pub enum Event {
    /// All its ports are made.
    Ports,
    /// Its ports are connected to everybody's.
    Connected,
    /// How far the scans have come; from the door.
    Progress(Progress),
    /// No scan is let in, and so many were; from the door.
    Held {
        /// Scans let in.
        admitted: u64,
    },
    /// Changes are noted, so many in all.
    Changed {
        /// How many.
        count: usize,
    },
    /// How the source plays from now on.
    Playing(Playing),
    /// What it has counted so far.
    Report(NodeReport),
    /// Something for the user.
    Log(Log),
    /// It records what is said and wants all lines, those of before too.
    Listens,
    /// What was said before the line of this number is recorded.
    Written {
        /// The number.
        lines: u64,
    },
    /// It has done its work: the last report.
    Finished(NodeReport),
}

/// Says something to the launcher. When nobody listens the launcher is dead, and standard input tells so.
pub(super) fn say(event: &Event) {
    if let Ok(mut line) = serde_json::to_vec(event) {
        line.push(b'\n');
        let mut out = std::io::stdout().lock();
        drop(out.write_all(&line).and_then(|()| out.flush()));
    }
}

/// How long a node may take to end after its launcher died.
const FAREWELL: Duration = Duration::from_secs(5);

/// Reads the launcher's commands in a thread of its own, which rings the node's inbox for each.
pub(super) fn listen(run: &Run, name: &str) -> Result<Receiver<Command>, BusError> {
    let (commands, receiver) = unbounded();
    let (run, name) = (run.clone(), name.to_owned());
    let listen = move || {
        let bell = Bell::new(&run, &name);
        let ring = || bell.iter().for_each(Bell::ring);
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if let Ok(command) = serde_json::from_str(&line) {
                if commands.send(command).is_err() {
                    return;
                }
                ring();
            }
        }
        // The launcher is gone, and its children go with it: in good order if they can, in any case soon.
        drop(commands.send(Command::Stop { ledger: None }));
        ring();
        std::thread::sleep(FAREWELL);
        #[expect(clippy::exit, reason = "an orphan must not outlive its launcher")]
        std::process::exit(1);
    };
    std::thread::Builder::new()
        .name("commands".to_owned())
        .spawn(listen)
        .map_err(|e| BusError::port("listen to the launcher", e))?;
    Ok(receiver)
}
