//! What is asked of a running graph from outside: how it is set, to set it otherwise, to pause.
//!
//! The launcher listens at a socket in the run's folder, which is private to its user: a line of JSON is an [`Ask`], the
//! line that comes back its [`Answer`].

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::change::Change;

use super::{Play, Playing, Progress};

/// The longest line that is read, in bytes.
pub const LONGEST_LINE: u64 = 1 << 20;
/// How long an answer may take.
const PATIENCE: Duration = Duration::from_secs(10);

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
        /// By name, as `match.score`.
        values: BTreeMap<String, Value>,
    },
    /// Play otherwise.
    Play {
        /// How.
        play: Play,
    },
    /// Write the scans that come now to a file of their own.
    Snapshot,
}

/// What comes back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "lowercase")]
pub enum Answer {
    /// How everything is.
    State(Box<State>),
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
    /// As `match.score`.
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
    let mut stream = UnixStream::connect(socket_of(run))?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut line = serde_json::to_vec(ask)?;
    line.push(b'\n');
    stream.write_all(&line)?;
    let mut answer = String::new();
    BufReader::new(stream)
        .take(LONGEST_LINE)
        .read_line(&mut answer)?;
    Ok(serde_json::from_str(&answer)?)
}
