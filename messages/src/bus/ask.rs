//! What is asked of a running graph from outside: how it is set, to set it otherwise, to pause.
//!
//! The launcher listens at a socket in the run's folder, which is private to its user: a line of JSON is an [`Ask`], the
//! line that comes back its [`Answer`]. Who waits for somebody waits longer than that one does in turn: a snapshot gives up
//! before the launcher, the launcher before who asks, and who asks before a viewer that asked it.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::change::Change;

use super::{Log, Play, Playing, Progress};

/// The longest line that is read, in bytes.
pub const LONGEST_LINE: u64 = 1 << 20;
/// How much longer who asks waits than the launcher takes at most.
const LEEWAY: Duration = Duration::from_secs(5);

/// What is asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase")]
pub enum Ask {
    /// How is everything?
    State,
    /// The same, as soon as the source has said how it plays.
    Source,
    /// Set parameters otherwise, from the next scan on: all of these or none.
    Set {
        /// By name, as `match.gap`.
        values: BTreeMap<String, Value>,
    },
    /// Play otherwise.
    Play {
        /// How.
        play: Play,
    },
    /// Write the scans that come now to a file of their own.
    Snapshot,
    /// What was said?
    Said {
        /// From the line of this number on.
        from: u64,
    },
}

impl Ask {
    /// How long the launcher may take; after that it says what it is waiting for.
    pub fn patience(&self) -> Duration {
        Duration::from_secs(match self {
            Self::State | Self::Play { .. } | Self::Said { .. } => 5,
            Self::Source => 10,
            Self::Snapshot => 40,
            // Nodes that do not note it are ended after `graph.patience`, and others take their places.
            Self::Set { .. } => 90,
        })
    }
}

/// What comes back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "lowercase")]
pub enum Answer {
    /// How everything is.
    State(Box<State>),
    /// What was said, as much of it as goes into one answer.
    Said {
        /// The number of the first line: a later one than was asked for where older ones are not kept.
        from: u64,
        /// The lines.
        lines: Vec<Log>,
    },
    /// It is done, and what came of it.
    Done {
        /// In words.
        text: String,
    },
    /// It is not done, and why.
    Refused {
        /// In words.
        why: String,
    },
}

/// How a graph is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// What can be set while it runs.
    pub parameters: Vec<Parameter>,
    /// How its source plays.
    pub playing: Option<Playing>,
    /// How far the scans have come.
    pub progress: Progress,
    /// Its nodes along the pipe.
    pub nodes: Vec<NodeState>,
}

/// A node as the launcher knows it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NodeState {
    /// Its name.
    pub name: String,
    /// `starting`, `running`, or `finished`.
    pub state: String,
    /// How often it was restarted.
    pub restarts: u32,
}

/// A setting that can be changed while the graph runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// As `match.gap`.
    pub name: String,
    /// What it is now; null for what the node finds by itself.
    pub value: Value,
    /// What it means.
    pub about: String,
    /// The least and the greatest value allowed, of a number or each number of a list.
    pub range: Option<(f64, f64)>,
}

/// Where a run's changes of settings stand.
fn changes_of(run: &Path) -> PathBuf {
    run.join("changes.json")
}

/// Notes the settings that were changed in the run with this folder, before any node hears of them.
///
/// # Errors
/// When the file cannot be written.
pub fn write_changes(run: &Path, changes: &[Change]) -> io::Result<()> {
    let unnamed = run.join(".changes.json");
    fs::write(&unnamed, serde_json::to_vec(changes)?)?;
    fs::rename(unnamed, changes_of(run))
}

/// The settings that were changed in the run with this folder: complete for every scan that anybody has seen.
pub fn read_changes(run: &Path) -> Vec<Change> {
    let text = fs::read(changes_of(run)).unwrap_or_default();
    serde_json::from_slice(&text).unwrap_or_default()
}

/// Where a run's launcher listens.
pub fn socket_of(run: &Path) -> PathBuf {
    run.join("ask")
}

/// Asks the launcher of the run with this folder.
///
/// # Errors
/// When the launcher is gone or does not answer in time.
pub fn ask(run: &Path, ask: &Ask) -> io::Result<Answer> {
    let patience = ask.patience() + LEEWAY;
    let mut stream = UnixStream::connect(socket_of(run))?;
    stream.set_read_timeout(Some(patience))?;
    stream.set_write_timeout(Some(patience))?;
    let mut line = serde_json::to_vec(ask)?;
    line.push(b'\n');
    let mut answer = String::new();
    let asked = stream.write_all(&line).and_then(|()| {
        BufReader::new(stream)
            .take(LONGEST_LINE)
            .read_line(&mut answer)
    });
    match asked {
        Ok(0) => {
            let why = "it is ending, or too many ask at once";
            Err(io::Error::new(io::ErrorKind::UnexpectedEof, why))
        }
        Ok(_) => Ok(serde_json::from_str(&answer)?),
        // The system's word for a time that is over says nothing to a user.
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
            let why = format!("nothing came within {} s", patience.as_secs());
            Err(io::Error::new(io::ErrorKind::TimedOut, why))
        }
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use std::os::unix::net::UnixListener;

    use super::*;

    #[test]
    fn a_launcher_that_hangs_up_is_told_in_words() {
        let run = std::env::temp_dir().join(format!("tricurve-ask-{}", std::process::id()));
        fs::create_dir_all(&run).unwrap();
        let launcher = UnixListener::bind(socket_of(&run)).unwrap();
        let hang_up = std::thread::spawn(move || {
            let (stream, _) = launcher.accept().unwrap();
            BufReader::new(stream)
                .read_line(&mut String::new())
                .unwrap();
        });
        let error = ask(&run, &Ask::State).unwrap_err();
        hang_up.join().unwrap();
        fs::remove_dir_all(&run).unwrap();
        assert_eq!(error.to_string(), "it is ending, or too many ask at once");
    }
}
