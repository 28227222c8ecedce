//! `tricurve top`: how graphs that run are doing, as they go.
//!
//! It costs a graph next to nothing: it hears what nodes report once a second in any case, reads `/proc` and asks the
//! launcher. It subscribes to no topic, so no message is kept for it, however slow the terminal is.

mod figures;
mod screen;
mod text;

use std::io::IsTerminal as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::cli::Top as Args;
use crate::running::Running;
use crate::{Failure, Outcome, signals};
use figures::{Figures, Watch};

/// How often it is heard what nodes say.
const HEAR_EVERY: Duration = Duration::from_millis(20);
/// How much longer than the interval a table waits for nodes of which no two reports have come: they are busy with a
/// message, or new.
const PATIENCE: Duration = Duration::from_secs(4);

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let (mut watches, mut unwatched) = (Vec::new(), Vec::new());
    for running in Running::all(args.run.as_deref())? {
        match Watch::start(running) {
            Ok(watch) => watches.push(watch),
            Err(failure) => unwatched.push(failure),
        }
    }
    if watches.is_empty()
        && let Some(failure) = unwatched.pop()
    {
        return Err(failure);
    }
    // One that cannot be watched keeps nobody from watching the others.
    for failure in unwatched {
        crate::say!("top: {}", failure.text);
    }
    let every = Duration::from_secs_f64(args.every);
    let end = signals::flag(&signals::END)?;
    let is_live = std::io::stdout().is_terminal() && !args.once && !args.json;
    let ended = match is_live {
        true => screen::show(watches, args.run.is_none(), every, &end)?,
        false => once(watches, every, args.json, &end)?,
    };
    for run in ended {
        crate::say!("the graph {run} has ended");
    }
    Ok(Outcome::Done)
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Graphs {
    graphs: Vec<Figures>,
}

/// Prints the figures of one interval; gives the graphs that ended meanwhile.
fn once(
    mut watches: Vec<Watch>,
    every: Duration,
    json: bool,
    end: &AtomicBool,
) -> Result<Vec<String>, Failure> {
    let began = Instant::now();
    let is_over = |watches: &[Watch]| {
        let elapsed = began.elapsed();
        let is_ready = |watch: &Watch| !watch.is_alive() || watch.is_ready();
        let is_done = elapsed >= every && watches.iter().all(is_ready);
        is_done || elapsed >= every + PATIENCE || !watches.iter().any(Watch::is_alive)
    };
    while !is_over(&watches) && !end.load(Ordering::Relaxed) {
        watches.iter_mut().try_for_each(Watch::hear)?;
        std::thread::sleep(HEAR_EVERY);
    }
    let graphs: Vec<Figures> = watches.iter_mut().map(Watch::look).collect();
    let ended = graphs.iter().filter(|graph| graph.ended);
    let ended = ended.map(|graph| graph.run.clone()).collect();
    match json {
        true => super::print_json(&Graphs { graphs })?,
        false => super::print(&text::text(&graphs))?,
    }
    Ok(ended)
}
