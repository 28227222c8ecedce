//! Graphs that run, as commands beside them see them: who belongs to a run, and what its processes use.

use std::fs;
use std::path::{Path, PathBuf};

use messages::bus::BusError;
use serde::Serialize;

use crate::cli::BE_NODE;
use crate::node::Orders;
use crate::rundir::{self, name_of};
use crate::{Failure, open_files};

/// A graph that runs.
#[derive(Debug)]
pub(crate) struct Running {
    pub(crate) folder: PathBuf,
    pub(crate) orders: Orders,
}

/// A process of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Process {
    pub(crate) node: String,
    pub(crate) pid: u32,
    /// How often the node was restarted.
    pub(crate) restarts: u32,
    /// As the kernel calls it: `running`, `sleeping`, `stopped`, `waiting for the disk`, `dead`.
    pub(crate) state: &'static str,
    /// Processor time it has used.
    pub(crate) cpu_seconds: f64,
    /// Memory of its own.
    pub(crate) memory_bytes: u64,
}

impl Running {
    /// The run that is meant: by its name or the beginning of it, or the only one.
    pub(crate) fn choose(wanted: Option<&str>) -> Result<Self, Failure> {
        let alive = alive()?;
        let names: Vec<String> = alive.iter().map(|run| name_of(run)).collect();
        let is_named = |wanted: &&str| names.iter().any(|name| name == wanted);
        let whole_name = wanted.filter(is_named);
        let is_meant = |run: &&PathBuf| {
            let name = name_of(run);
            match whole_name {
                Some(whole) => name == whole,
                None => wanted.is_none_or(|wanted| name.starts_with(wanted)),
            }
        };
        let meant: Vec<&PathBuf> = alive.iter().filter(is_meant).collect();
        let names = names.join(", ");
        match (meant.as_slice(), wanted) {
            ([run], _) => Self::of(run),
            _ if alive.is_empty() => Err(none()),
            ([], Some(wanted)) => Err(Failure::usage(format!(
                "no run is called {wanted:?}; there are {names}"
            ))),
            _ => Err(Failure::usage(format!(
                "several graphs run: choose one with --run, of {names}"
            ))),
        }
    }

    /// The run that is meant, or without a name all there are.
    pub(crate) fn all(wanted: Option<&str>) -> Result<Vec<Self>, Failure> {
        if wanted.is_some() {
            return Ok(vec![Self::choose(wanted)?]);
        }
        // One that is just beginning or ending has no orders yet, or no more.
        let running = alive()?.into_iter().filter_map(|run| Self::of(&run).ok());
        let running: Vec<Self> = running.collect();
        match running.is_empty() {
            true => Err(none()),
            false => Ok(running),
        }
    }

    fn of(folder: &Path) -> Result<Self, Failure> {
        let orders = Orders::read(folder).map_err(|error| {
            let name = name_of(folder);
            Failure::failed(format!(
                "the graph {name} is just beginning or ending: {error}"
            ))
        })?;
        open_files::allow_guest(&orders.run);
        Ok(Self {
            folder: folder.to_owned(),
            orders,
        })
    }

    /// Whether it is still there, and its nodes still share what a guest of it has joined.
    pub(crate) fn goes_on(&self) -> bool {
        rundir::goes_on(&self.folder, &self.orders.run.prefix)
    }

    /// Why a guest cannot join it, and what helps.
    pub(crate) fn cannot_join(&self, error: &BusError) -> Failure {
        let help = match error {
            BusError::Port { .. } => {
                "; when what its nodes share was removed, as at a logout, `tricurve node restart NODE` lets all begin again"
            }
            _ => "",
        };
        Failure::failed(format!("cannot join {}: {error}{help}", self.name()))
    }

    /// Why a guest is not heard any more, of a graph that does not go on.
    pub(crate) fn why_over(&self) -> String {
        let name = self.name();
        match rundir::is_alive(&self.folder) {
            true => format!(
                "all nodes of the graph {name} were started again: start this command again too"
            ),
            false => format!("the graph {name} has ended"),
        }
    }

    pub(crate) fn name(&self) -> String {
        name_of(&self.folder)
    }

    /// Its nodes' processes, in the order of the pipe; a node that is being restarted may have none.
    pub(crate) fn processes(&self) -> Vec<Process> {
        let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
        let found: Vec<Process> = entries
            .filter_map(|entry| self.process(&entry.path()))
            .collect();
        let nodes = self.orders.run.nodes.iter();
        nodes
            .filter_map(|node| found.iter().find(|process| process.node == node.name))
            .cloned()
            .collect()
    }

    /// The process of this folder of `/proc`, when it is a node of the run.
    fn process(&self, entry: &Path) -> Option<Process> {
        let pid = entry.file_name()?.to_str()?.parse().ok()?;
        let line = fs::read(entry.join("cmdline")).ok()?;
        let words: Vec<String> = line
            .split(|byte| *byte == 0)
            .map(|word| String::from_utf8_lossy(word).into_owned())
            .collect();
        let value = |name: &str| {
            let at = words.iter().position(|word| word == name)?;
            words.get(at + 1)
        };
        // By name: a folder that was removed may have been made anew elsewhere, since this process started.
        let is_ours = words.get(1).is_some_and(|word| word == BE_NODE)
            && value("--run").is_some_and(|run| name_of(Path::new(run)) == self.name());
        let node = words.get(2).filter(|_| is_ours)?.clone();
        // What follows the name in brackets: state, …, time in the program and in the kernel, in hundredths.
        let stat = fs::read_to_string(entry.join("stat")).ok()?;
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let ticks = |at: usize| fields.get(at).and_then(|f| f.parse::<u64>().ok());
        let status = fs::read_to_string(entry.join("status")).ok()?;
        let own = status
            .lines()
            .find_map(|line| line.strip_prefix("RssAnon:"));
        let kilobytes = own.and_then(|text| text.split_whitespace().next()?.parse::<u64>().ok());
        Some(Process {
            node,
            pid,
            restarts: value("--life")
                .and_then(|life| life.parse().ok())
                .unwrap_or(0),
            state: state(fields.first().copied().unwrap_or_default()),
            cpu_seconds: (ticks(11)? + ticks(12)?) as f64 / 100.0,
            memory_bytes: kilobytes.unwrap_or_default() * 1024,
        })
    }
}

fn alive() -> Result<Vec<PathBuf>, Failure> {
    rundir::alive().map_err(|e| Failure::failed(format!("cannot look for runs: {e}")))
}

fn none() -> Failure {
    Failure::failed("no graph of yours is running: start one with `tricurve run`")
}

/// The kernel's letter in a word.
fn state(letter: &str) -> &'static str {
    match letter {
        "R" => "running",
        "S" | "I" => "sleeping",
        "D" => "waiting for the disk",
        "T" | "t" => "stopped",
        _ => "dead",
    }
}
