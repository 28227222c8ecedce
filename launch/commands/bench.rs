//! `tricurve bench`: what it costs a graph to be recorded and viewed, and what several instances of its stages bring.
//!
//! The same graph runs without observers, with its recorder, with a viewer, with both, and with a bridge that nobody is
//! connected to; again and again in turn, so that a machine which is slower for a while is so for all of them. A round's
//! figures are compared with that round's graph without observers, and of these ratios the median counts.
//!
//! Measured is the graph as it goes: from where every scene of the source was read once and the viewer sees scans, to
//! where no further scan is let in.

mod instances;
mod viewer;

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use messages::bus::{Level, Progress};
use messages::{Rig, Sway};
use serde::Serialize;

use super::run::{Planned, plan};
use crate::cli::Bench as Args;
use crate::graph::{Graph, Overrides, parsed};
use crate::launcher::{Launch, launch_before};
use crate::running::{Process, Running};
use crate::supervisor::{Ran, Watcher};
use crate::{Failure, Outcome, rundir, signals};
use viewer::{Taken, Viewer};

/// The most scans before those that are measured: of more scenes than that not all are read before.
const MOST_BEFORE: u64 = 8;
/// Scans of a source that is to last until enough was seen.
const ENOUGH: u64 = 1_000_000;
/// Scans that are measured, and for how long at least, where nothing else is wanted.
const LEAST: (u64, Duration) = (20, Duration::from_secs(4));
/// How long a viewer may see nothing.
const PATIENCE: Duration = Duration::from_secs(60);
/// Where the bridge is to be found, as it says itself.
const ADDRESS: &str = "ws://";

/// Who looks at the graph.
#[derive(Clone, Copy, Debug)]
struct Observers {
    name: &'static str,
    has_recorder: bool,
    has_bridge: bool,
    has_viewer: bool,
}

/// All that is compared; the first is what the others are compared with, the last shows what a bridge alone costs.
const OBSERVERS: [Observers; 5] = [
    observers("none", false, false, false),
    observers("recorder", true, false, false),
    observers("viewer", false, true, true),
    observers("recorder and viewer", true, true, true),
    observers("bridge alone", false, true, false),
];

const fn observers(
    name: &'static str,
    has_recorder: bool,
    has_bridge: bool,
    has_viewer: bool,
) -> Observers {
    Observers {
        name,
        has_recorder,
        has_bridge,
        has_viewer,
    }
}

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    if args.instances {
        return instances::run(args);
    }
    let stop = signals::flag(&signals::END)?;
    let place = Place::make()?;
    let mut measured: [Vec<Measured>; OBSERVERS.len()] = Default::default();
    for round in 0..args.rounds as usize {
        // Who comes after whom is different in every round.
        for turn in 0..OBSERVERS.len() {
            let index = (round + turn) % OBSERVERS.len();
            let observers = OBSERVERS[index];
            let once = measure(args, observers, &place);
            if stop.load(Ordering::Relaxed) {
                return Err(interrupted());
            }
            let once = once?;
            if !args.json {
                let (round, rounds) = (round + 1, args.rounds);
                let Measured { rate, .. } = once;
                crate::say!(
                    "round {round} of {rounds}, {}: {rate:.2} triples/s",
                    observers.name
                );
            }
            measured[index].push(once);
        }
    }
    let compared = Compared::new(args, &measured);
    match args.json {
        true => super::print_json(&compared)?,
        false => super::print(&compared.to_string())?,
    }
    Ok(Outcome::Done)
}

/// A folder for recordings, where recordings are in any case: on the same disk. It goes with what is in it.
struct Place {
    folder: PathBuf,
    /// Whether the folder of recordings was made for it.
    is_first: bool,
}

impl Place {
    fn make() -> Result<Self, Failure> {
        let recordings = Path::new("recordings");
        let is_first = !recordings.exists();
        let folder = recordings.join(format!(".bench-{}", std::process::id()));
        fs::create_dir_all(&folder).map_err(|e| {
            Failure::failed(format!("cannot make the folder {}: {e}", folder.display()))
        })?;
        Ok(Self { folder, is_first })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        // Best effort: somebody else may have put something there meanwhile.
        fs::remove_dir_all(&self.folder).unwrap_or_default();
        if self.is_first {
            fs::remove_dir("recordings").unwrap_or_default();
        }
    }
}

/// What came of one run.
#[derive(Clone, Debug)]
struct Measured {
    /// Scans a second.
    rate: f64,
    /// Scans it is the rate of.
    scans: u64,
    /// What the viewer took in the whole run, and how many of these scans.
    viewed: Option<(Taken, u64)>,
    /// Processor time the bridge used, and in which time.
    bridge: Option<(f64, f64)>,
    recorded_bytes: Option<u64>,
}

fn measure(args: &Args, observers: Observers, place: &Place) -> Result<Measured, Failure> {
    let file = place.folder.join("x.mcap");
    let mut overrides = Overrides::parse(&args.set)?;
    overrides.set("capture", "source", args.source.as_str());
    match observers.has_recorder {
        true => {
            overrides.set("record", "file", file.to_string_lossy().as_ref());
            overrides.set("record", "overwrite", true);
        }
        false => overrides.without("record"),
    }
    if observers.has_bridge {
        overrides.with("bridge");
        overrides.set("bridge", "port", 0);
    }
    let Planned {
        mut graph,
        source,
        rig,
        places,
        sway,
        ..
    } = plan(None, args.profile, &overrides)?;
    graph.fill_in("capture", "scans", ENOUGH);
    let mut observed = Observed {
        observers,
        before: source.scenes().clamp(1, MOST_BEFORE),
        least: match args.scans {
            Some(scans) => (scans, Duration::ZERO),
            None => LEAST,
        },
        began: None,
        first: None,
        seen: None,
        viewers: Vec::new(),
        trouble: None,
    };
    let ran = launched(&graph, (rig, places, sway), &mut observed)?;
    let recorded_bytes = observers
        .has_recorder
        .then(|| fs::metadata(&file).map_or(0, |meta| meta.len()));
    // What is still to be written of it must not slow the next run.
    fs::remove_file(&file).unwrap_or_default();
    if let Some(text) = observed.trouble {
        return Err(Failure::failed(text));
    }
    let name = observers.name;
    let Some(seen) = observed.seen.filter(|_| ran.outcome == Outcome::Done) else {
        return Err(ended_early(&ran, &format!("; observers: {name}")));
    };
    let taken = observed.viewers.into_iter().map(Viewer::end).reduce(add);
    Ok(Measured {
        rate: seen.scans as f64 / seen.seconds,
        scans: seen.scans,
        viewed: taken.map(|taken| (taken, seen.viewed)),
        bridge: seen.bridge_cpu.map(|cpu| (cpu, seen.seconds)),
        recorded_bytes,
    })
}

/// Runs a graph that is measured, quietly.
fn launched(
    graph: &Graph,
    (rig, places, sway): (Rig, Vec<f64>, Vec<Sway>),
    watcher: &mut impl Watcher,
) -> Result<Ran, Failure> {
    let launch = Launch {
        graph,
        rig,
        scans: Vec::new(),
        places,
        sway,
        said: Vec::new(),
        remarks: Vec::new(),
        is_quiet: true,
        timeline: None,
        changes: Vec::new(),
        no_seek: None,
    };
    Ok(launch_before(launch, watcher)?.0)
}

/// Why there is nothing to tell when the user ends it.
fn interrupted() -> Failure {
    Failure {
        outcome: Outcome::Aborted,
        text: "interrupted: nothing was measured to the end".to_owned(),
    }
}

/// Why a run that ended tells nothing.
fn ended_early(ran: &Ran, of: &str) -> Failure {
    let done = ran.ledger.done;
    Failure {
        outcome: match ran.outcome {
            Outcome::Done => Outcome::Aborted,
            other => other,
        },
        text: format!("the graph ended after {done} scans, before enough was seen{of}"),
    }
}

fn add(one: Taken, other: Taken) -> Taken {
    Taken {
        channels: one.channels.max(other.channels),
        messages: one.messages + other.messages,
        bytes: one.bytes + other.bytes,
        scans: one.scans + other.scans,
    }
}

/// How things stood at a moment.
struct Moment {
    at: Instant,
    /// Scans done.
    done: u64,
    /// Scans the viewer has taken.
    viewed: u64,
    /// The bridge that nobody is connected to.
    bridge: Option<Process>,
}

/// What was seen between two moments.
struct Seen {
    seconds: f64,
    scans: u64,
    viewed: u64,
    bridge_cpu: Option<f64>,
}

/// Watches a run that is measured.
struct Observed {
    observers: Observers,
    /// Scans before those that are measured.
    before: u64,
    /// Scans that are measured, and for how long at least.
    least: (u64, Duration),
    /// When the first scan went in.
    began: Option<Instant>,
    /// Where measuring begins.
    first: Option<Moment>,
    seen: Option<Seen>,
    viewers: Vec<Viewer>,
    trouble: Option<String>,
}

impl Observed {
    fn moment(&self, done: u64) -> Moment {
        let is_alone = self.observers.has_bridge && !self.observers.has_viewer;
        Moment {
            at: Instant::now(),
            done,
            viewed: self.viewed(),
            bridge: is_alone.then(find_bridge).flatten(),
        }
    }

    fn viewed(&self) -> u64 {
        self.viewers.iter().map(|viewer| viewer.taken().scans).sum()
    }
}

/// The bridge's process.
fn find_bridge() -> Option<Process> {
    // Runs are named after their launcher, and this process has one at a time.
    let running = Running::choose(Some(&rundir::beginning_of(std::process::id()))).ok()?;
    let mut processes = running.processes().into_iter();
    processes.find(|process| process.node == "bridge")
}

impl Watcher for Observed {
    fn progress(&mut self, progress: &Progress) {
        let began = *self.began.get_or_insert_with(Instant::now);
        if progress.done < self.before || self.has_enough() {
            return;
        }
        let Some(first) = &self.first else {
            if !self.observers.has_viewer || self.viewed() > 0 {
                self.first = Some(self.moment(progress.done));
            } else if began.elapsed() > PATIENCE {
                self.trouble = Some("the viewer sees no scan".to_owned());
            }
            return;
        };
        let (scans, time) = self.least;
        if progress.done >= first.done + scans && first.at.elapsed() >= time {
            let last = self.moment(progress.done);
            let cpu = |moment: &Moment| moment.bridge.as_ref().map(|bridge| bridge.cpu_seconds);
            let scans = last.done - first.done;
            self.seen = Some(Seen {
                seconds: last.at.duration_since(first.at).as_secs_f64(),
                scans,
                // It may get some only now that were done before.
                viewed: (last.viewed - first.viewed).min(scans),
                bridge_cpu: cpu(&last).zip(cpu(first)).map(|(last, first)| last - first),
            });
        }
    }

    fn has_enough(&self) -> bool {
        self.seen.is_some() || self.trouble.is_some()
    }

    fn has_keys(&self) -> bool {
        false
    }

    /// The bridge says where it is before it is ready, and no scan goes in before all are.
    fn say(&mut self, level: Level, node: &str, text: &str) {
        if node == "bridge" {
            let address = text.split_once(ADDRESS).map(|(_, address)| address.trim());
            if let Some(address) = address.filter(|_| self.observers.has_viewer) {
                match Viewer::connect(address) {
                    Ok(viewer) => self.viewers.push(viewer),
                    Err(text) => self.trouble = Some(text),
                }
            }
            // That a viewer is too slow is among the figures.
            if level != Level::Error {
                return;
            }
        }
        if level != Level::Info {
            crate::say!("{node}: {text}");
        }
    }
}

/// The middle and the ends of several figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
struct Spread {
    median: f64,
    min: f64,
    max: f64,
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let len = values.len();
        let at = |index: usize| values.get(index).copied().unwrap_or_default();
        Self {
            median: (at(len.saturating_sub(1) / 2) + at(len / 2)) / 2.0,
            min: at(0),
            max: at(len.saturating_sub(1)),
        }
    }
}

/// How the graph did before some observers.
#[derive(Clone, Debug, Serialize)]
struct Row {
    observers: &'static str,
    /// Scans that were measured, in all rounds.
    scans: u64,
    triples_per_second: Spread,
    /// To the graph without observers in the same round.
    ratio: Spread,
    /// Recorded in all rounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    recorded_megabytes: Option<f64>,
    /// What a viewer took in all rounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    viewer: Option<ViewerRow>,
}

/// What a viewer took in all rounds.
#[derive(Clone, Debug, Serialize)]
struct ViewerRow {
    channels: u64,
    messages: u64,
    megabytes: f64,
    /// Scans it saw of those that were measured.
    scans: u64,
}

/// What it came to.
#[derive(Debug, Serialize)]
struct Compared {
    profile: String,
    source: String,
    rounds: u32,
    rows: Vec<Row>,
    /// A bridge that nobody is connected to.
    bridge_alone: Row,
    /// Of one core.
    bridge_alone_cpu_percent: Option<f64>,
}

impl Compared {
    fn new(args: &Args, measured: &[Vec<Measured>]) -> Self {
        let base = &measured[0];
        let row = |(observers, runs): (&Observers, &Vec<Measured>)| {
            let ratios = runs
                .iter()
                .zip(base)
                .map(|(run, base)| run.rate / base.rate);
            let bytes = runs.iter().filter_map(|run| run.recorded_bytes);
            let bytes = bytes.reduce(|all, more| all + more);
            let taken = runs.iter().filter_map(|run| Some(run.viewed?.0));
            let scans = runs.iter().filter_map(|run| Some(run.viewed?.1)).sum();
            Row {
                observers: observers.name,
                scans: runs.iter().map(|run| run.scans).sum(),
                triples_per_second: Spread::of(runs.iter().map(|run| run.rate)),
                ratio: Spread::of(ratios),
                recorded_megabytes: bytes.map(|bytes| bytes as f64 / 1e6),
                viewer: taken.reduce(add).map(|taken| ViewerRow {
                    channels: taken.channels,
                    messages: taken.messages,
                    megabytes: taken.bytes as f64 / 1e6,
                    scans,
                }),
            }
        };
        let mut rows: Vec<Row> = OBSERVERS.iter().zip(measured).map(row).collect();
        let last = measured.len() - 1;
        let spent = measured[last].iter().filter_map(|run| run.bridge);
        let spent = spent.reduce(|(cpu, time), (more_cpu, more)| (cpu + more_cpu, time + more));
        Self {
            profile: args.profile.name(),
            source: args.source.clone(),
            rounds: args.rounds,
            bridge_alone: rows.remove(last),
            rows,
            bridge_alone_cpu_percent: spent.map(|(cpu, seconds)| 100.0 * cpu / seconds),
        }
    }
}

impl fmt::Display for Compared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            profile,
            source,
            rounds,
            ..
        } = self;
        writeln!(
            f,
            "{source} with the {profile} profile, {rounds} times in turn\n"
        )?;
        writeln!(
            f,
            "{:<20} {:>6} {:>9} {:>7} {:>7} {:>6}   besides",
            "observers", "scans", "triples/s", "min", "max", "ratio"
        )?;
        for row in self.rows.iter().chain([&self.bridge_alone]) {
            let Spread { median, min, max } = row.triples_per_second;
            let ratio = row.ratio.median;
            write!(
                f,
                "{:<20} {:>6} {median:>9.2} {min:>7.2} {max:>7.2} {ratio:>6.3}",
                row.observers, row.scans
            )?;
            let recorded = row.recorded_megabytes;
            let recorded = recorded.map(|megabytes| format!("{megabytes:.0} MB recorded"));
            let viewed = row.viewer.as_ref().map(|viewer| {
                format!(
                    "{} scans and {:.0} MB viewed on {} channels",
                    viewer.scans, viewer.megabytes, viewer.channels
                )
            });
            let is_alone = std::ptr::eq(row, &self.bridge_alone);
            let idle = self.bridge_alone_cpu_percent.filter(|_| is_alone);
            let idle = idle.map(|percent| format!("the bridge uses {percent:.1} % of a core"));
            let besides: Vec<String> = [recorded, viewed, idle].into_iter().flatten().collect();
            match besides.is_empty() {
                true => writeln!(f)?,
                false => writeln!(f, "   {}", besides.join(", "))?,
            }
        }
        writeln!(
            f,
            "\ntriples/s: the median of all rounds; ratio: to the same round's graph without observers, the median"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::Profile;

    #[test]
    fn the_median_of_an_even_number_lies_between_the_two_in_the_middle() {
        let spread = |values: &[f64]| Spread::of(values.iter().copied());
        let of = |median, min, max| Spread { median, min, max };
        assert_eq!(spread(&[3.0, 1.0, 2.0]), of(2.0, 1.0, 3.0));
        assert_eq!(spread(&[4.0, 1.0, 2.0, 3.0]), of(2.5, 1.0, 4.0));
        assert_eq!(spread(&[]), Spread::default());
    }

    #[test]
    fn a_machine_that_slows_down_changes_no_ratio() {
        let run = |rate: f64| Measured {
            rate,
            scans: 9,
            viewed: None,
            bridge: Some((0.01, 10.0)),
            recorded_bytes: None,
        };
        let args = Args {
            observers: true,
            instances: false,
            source: "scene:all".to_owned(),
            scans: Some(3),
            rounds: 3,
            profile: Profile::Default,
            set: Vec::new(),
            json: false,
        };
        let rounds = |share: f64| [8.0, 2.0, 4.0].map(|rate| run(share * rate)).to_vec();
        let compared = Compared::new(&args, &[1.0, 0.5, 0.75, 0.25, 1.0].map(rounds));
        let ratios: Vec<f64> = compared.rows.iter().map(|row| row.ratio.median).collect();
        assert_eq!(ratios, [1.0, 0.5, 0.75, 0.25]);
        assert_eq!(compared.rows[1].ratio.min, compared.rows[1].ratio.max);
        assert_eq!(compared.bridge_alone_cpu_percent, Some(0.1));
        assert!(compared.to_string().contains("uses 0.1 % of a core"));
    }
}
