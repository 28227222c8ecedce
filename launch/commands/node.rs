//! `tricurve node`: the nodes of a graph that runs.

use std::fmt::Write as _;

use rustix::process::{Pid, Signal, kill_process};

use crate::cli::{NodeArgs, NodeCommand};
use crate::running::{Process, Running};
use crate::{Failure, Outcome};

pub(crate) fn run(args: &NodeArgs) -> Result<Outcome, Failure> {
    let running = Running::choose(args.asked.run.as_deref())?;
    match &args.command {
        NodeCommand::List => list(&running, args.asked.json)?,
        NodeCommand::Restart { node } => restart(&running, node)?,
    }
    Ok(Outcome::Done)
}

fn list(running: &Running, json: bool) -> Result<(), Failure> {
    let processes = running.processes();
    if json {
        return super::print_json(&processes);
    }
    let mut text = format!(
        "{:<10} {:>8} {:>8} {:<20} {:>8} {:>9}\n",
        "node", "process", "restarts", "state", "CPU s", "memory MB"
    );
    for Process {
        node,
        pid,
        restarts,
        state,
        cpu_seconds,
        memory_bytes,
    } in processes
    {
        let megabytes = memory_bytes as f64 / 1e6;
        writeln!(
            text,
            "{node:<10} {pid:>8} {restarts:>8} {state:<20} {cpu_seconds:>8.2} {megabytes:>9.1}"
        )
        .unwrap_or_default();
    }
    super::print(&text)
}

/// Ends a node at once; the launcher starts it again, and what was under way is sent once more.
fn restart(running: &Running, name: &str) -> Result<(), Failure> {
    let processes = running.processes();
    let Some(process) = processes.iter().find(|process| process.node == name) else {
        let names: Vec<&str> = processes.iter().map(|p| p.node.as_str()).collect();
        return Err(Failure::usage(format!(
            "the run has no node {name}; it has {}",
            names.join(", ")
        )));
    };
    end(process)?;
    super::print(&format!("{name} ends and is started again\n"))
}

/// Ends a node's process at once.
pub(super) fn end(process: &Process) -> Result<(), Failure> {
    let pid = i32::try_from(process.pid).ok().and_then(Pid::from_raw);
    let pid = pid.ok_or_else(|| Failure::failed("the node is gone"))?;
    let name = &process.node;
    kill_process(pid, Signal::KILL)
        .map_err(|error| Failure::failed(format!("cannot end {name}: {error}")))
}
