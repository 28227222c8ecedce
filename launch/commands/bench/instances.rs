//! What it brings that stages run in several instances: throughput, latency, and the part that limits them.
//!
//! The same graph runs with one, two, … instances of every stage, and with what `auto` makes of this machine, again and again
//! in turn. What each stage's processes used of the processor in the runs with one instance says what more cores would do.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::sync::atomic::Ordering;
use std::thread::available_parallelism;
use std::time::Instant;

use messages::bus::{Level, Progress, node_of};
use serde::Serialize;

use super::{LEAST, MOST_BEFORE, Spread};
use crate::cli::Bench as Args;
use crate::commands::run::{Planned, plan};
use crate::graph::{Graph, Overrides};
use crate::instances::{self, STAGES};
use crate::running::Running;
use crate::supervisor::Watcher;
use crate::{Failure, Outcome, rundir, signals};

/// Instances of every stage that are measured at most, however many cores there are.
const MOST: u64 = 4;
/// Machines that are predicted for.
const CORES: [usize; 3] = [4, 8, 16];

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let stop = signals::flag(&signals::END)?;
    let cores = available_parallelism().map_or(1, usize::from);
    let counts = (1..=(cores as u64).clamp(2, MOST)).map(|count| count.to_string());
    let counts: Vec<String> = counts.chain(["auto".to_owned()]).collect();
    let mut measured: Vec<Vec<Measured>> = counts.iter().map(|_| Vec::new()).collect();
    for round in 0..args.rounds as usize {
        // Who comes after whom is different in every round.
        for turn in 0..counts.len() {
            let index = (round + turn) % counts.len();
            let once = measure(args, &counts[index]);
            if stop.load(Ordering::Relaxed) {
                return Err(super::interrupted());
            }
            let once = once?;
            if !args.json {
                crate::say!(
                    "round {} of {}, instances {}: {:.2} triples/s",
                    round + 1,
                    args.rounds,
                    counts[index],
                    once.rate
                );
            }
            measured[index].push(once);
        }
    }
    let compared = Compared::new(args, cores, &counts, &measured);
    match args.json {
        true => super::super::print_json(&compared)?,
        false => super::super::print(&compared.to_string())?,
    }
    Ok(Outcome::Done)
}

/// What came of one run.
#[derive(Clone, Debug)]
struct Measured {
    /// The stages' instances.
    instances: BTreeMap<&'static str, u64>,
    /// Scans a second.
    rate: f64,
    /// Milliseconds from where a scan is let in to where it is done, of each.
    latencies: Vec<f64>,
    /// Milliseconds of processor time a scan, of each node.
    cpu: BTreeMap<String, f64>,
}

fn measure(args: &Args, count: &str) -> Result<Measured, Failure> {
    let mut overrides = Overrides::parse(&args.set)?;
    overrides.set("capture", "source", args.source.as_str());
    overrides.without("record");
    let parts = Graph::load(None, args.profile, &overrides)?;
    for stage in STAGES.into_iter().filter(|stage| parts.has(stage)) {
        overrides.set(stage, instances::KEY.name, super::parsed(count));
    }
    let Planned {
        mut graph,
        source,
        rig,
        places,
        sway,
        ..
    } = plan(None, args.profile, &overrides)?;
    graph.fill_in("capture", "scans", super::ENOUGH);
    let mut timed = Timed {
        before: source.scenes().clamp(1, MOST_BEFORE),
        least: args.scans.unwrap_or(LEAST.0),
        is_timed: args.scans.is_none(),
        let_in: VecDeque::new(),
        first: None,
        last: None,
        latencies: Vec::new(),
    };
    let of = |stage: &&'static str| (*stage, graph.instances_of(stage));
    let instances = STAGES
        .iter()
        .filter(|stage| graph.has(stage))
        .map(of)
        .collect();
    let ran = super::launched(&graph, (rig, places, sway), &mut timed)?;
    let (Some(first), Some(last), Outcome::Done) = (timed.first, timed.last, ran.outcome) else {
        return Err(super::ended_early(&ran, ""));
    };
    let scans = (last.done - first.done) as f64;
    let spent = |(node, cpu): (&String, &f64)| {
        let before = first.cpu.get(node).copied().unwrap_or_default();
        (node.clone(), 1e3 * (cpu - before) / scans)
    };
    Ok(Measured {
        instances,
        rate: scans / last.at.duration_since(first.at).as_secs_f64(),
        latencies: timed.latencies,
        cpu: last.cpu.iter().map(spent).collect(),
    })
}

/// How things stood at a moment.
struct Moment {
    at: Instant,
    done: u64,
    /// Seconds of processor time that the processes of each node have used.
    cpu: BTreeMap<String, f64>,
}

impl Moment {
    fn now(done: u64) -> Self {
        // Runs are named after their launcher, and this process has one at a time.
        let running = Running::choose(Some(&rundir::beginning_of(std::process::id()))).ok();
        let mut cpu = BTreeMap::new();
        for process in running.into_iter().flat_map(|running| running.processes()) {
            *cpu.entry(node_of(&process.node).to_owned()).or_default() += process.cpu_seconds;
        }
        Self {
            at: Instant::now(),
            done,
            cpu,
        }
    }
}

/// Watches a run that is measured.
struct Timed {
    /// Scans before those that are measured.
    before: u64,
    /// Scans that are measured at least.
    least: u64,
    /// Whether they are measured for some time at least.
    is_timed: bool,
    /// When scans were let in that are not done, from which number on.
    let_in: VecDeque<(u64, Instant)>,
    first: Option<Moment>,
    last: Option<Moment>,
    latencies: Vec<f64>,
}

impl Watcher for Timed {
    fn progress(&mut self, progress: &Progress) {
        let now = Instant::now();
        let next = self
            .let_in
            .back()
            .map_or(progress.done_below, |(scan, _)| scan + 1);
        self.let_in
            .extend((next..progress.admitted).map(|scan| (scan, now)));
        while let Some((scan, at)) = self.let_in.front().copied()
            && scan < progress.done_below
        {
            self.let_in.pop_front();
            if self.first.is_some() && self.last.is_none() {
                self.latencies
                    .push(1e3 * now.duration_since(at).as_secs_f64());
            }
        }
        match &self.first {
            None if progress.done >= self.before => self.first = Some(Moment::now(progress.done)),
            Some(first) if self.last.is_none() => {
                let is_long = !self.is_timed || first.at.elapsed() >= LEAST.1;
                if is_long && progress.done >= first.done + self.least {
                    self.last = Some(Moment::now(progress.done));
                }
            }
            _ => {}
        }
    }

    fn has_enough(&self) -> bool {
        self.last.is_some()
    }

    fn has_keys(&self) -> bool {
        false
    }

    fn say(&mut self, level: Level, node: &str, text: &str) {
        if level != Level::Info {
            crate::say!("{node}: {text}");
        }
    }
}

/// The graph with so many instances.
#[derive(Clone, Debug, Serialize)]
struct Row {
    /// Of every stage, or `auto`.
    instances: String,
    /// Those of each stage.
    stages: BTreeMap<&'static str, u64>,
    triples_per_second: Spread,
    /// To the graph with one instance in the same round.
    ratio: Spread,
    /// From where a scan is let in to where it is done.
    latency_p50_ms: f64,
    latency_p99_ms: f64,
    /// The stage whose instances have least time left, and the most scans a second that they can do.
    slowest: String,
    limit_per_second: f64,
}

/// What the times of the stages say of a machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Predicted {
    cores: usize,
    instances: BTreeMap<&'static str, u64>,
    triples_per_second: f64,
    /// What limits it: a stage, or the cores.
    limit: String,
}

/// What it came to.
#[derive(Debug, Serialize)]
struct Compared {
    profile: String,
    source: String,
    rounds: u32,
    cores: usize,
    rows: Vec<Row>,
    /// Milliseconds of processor time a scan, of each node, with one instance.
    cpu_ms: BTreeMap<String, f64>,
    predicted: Vec<Predicted>,
}

/// The stage whose instances need most time for a scan, and how many scans a second they can do.
fn slowest(
    cpu_ms: &BTreeMap<String, f64>,
    instances: &BTreeMap<&'static str, u64>,
) -> (String, f64) {
    let of = |(node, ms): (&String, &f64)| {
        let count = instances.get(node.as_str()).copied().unwrap_or(1);
        (node.clone(), 1e3 * count as f64 / ms.max(1e-6))
    };
    let least = cpu_ms.iter().map(of).min_by(|a, b| a.1.total_cmp(&b.1));
    least.unwrap_or_default()
}

/// What so many cores can do, each stage having the instances that `auto` gives it there.
fn predicted(cpu_ms: &BTreeMap<String, f64>, cores: usize) -> Predicted {
    let known = STAGES
        .into_iter()
        .filter(|stage| cpu_ms.contains_key(*stage));
    let instances = known
        .map(|stage| (stage, instances::fitting(stage, cores)))
        .collect();
    let (stage, of_stage) = slowest(cpu_ms, &instances);
    let of_cores = 1e3 * cores as f64 / cpu_ms.values().sum::<f64>().max(1e-6);
    let is_full = of_cores < of_stage;
    Predicted {
        cores,
        instances,
        triples_per_second: of_cores.min(of_stage),
        limit: if is_full { "cores".to_owned() } else { stage },
    }
}

impl Compared {
    fn new(args: &Args, cores: usize, counts: &[String], measured: &[Vec<Measured>]) -> Self {
        let base = &measured[0];
        let mut cpu_ms = BTreeMap::new();
        for node in base.iter().flat_map(|run| run.cpu.keys()) {
            let spent = base.iter().filter_map(|run| run.cpu.get(node).copied());
            cpu_ms.insert(node.clone(), Spread::of(spent).median);
        }
        let row = |(count, runs): (&String, &Vec<Measured>)| {
            let both = runs.iter().zip(base);
            let mut latencies: Vec<f64> = runs
                .iter()
                .flat_map(|run| run.latencies.iter().copied())
                .collect();
            latencies.sort_by(f64::total_cmp);
            let share = |share: f64| {
                let last = latencies.len().saturating_sub(1) as f64;
                latencies
                    .get((share * last).round() as usize)
                    .copied()
                    .unwrap_or_default()
            };
            let stages = runs
                .first()
                .map(|run| run.instances.clone())
                .unwrap_or_default();
            let (slowest, limit_per_second) = slowest(&cpu_ms, &stages);
            Row {
                instances: count.clone(),
                stages,
                triples_per_second: Spread::of(runs.iter().map(|run| run.rate)),
                ratio: Spread::of(both.map(|(run, base)| run.rate / base.rate)),
                latency_p50_ms: share(0.5),
                latency_p99_ms: share(0.99),
                slowest,
                limit_per_second,
            }
        };
        Self {
            profile: args.profile.name(),
            source: args.source.clone(),
            rounds: args.rounds,
            cores,
            rows: counts.iter().zip(measured).map(row).collect(),
            predicted: CORES.map(|cores| predicted(&cpu_ms, cores)).to_vec(),
            cpu_ms,
        }
    }
}

/// Instances of the stages that have several, in words.
fn in_words(instances: &BTreeMap<&'static str, u64>) -> String {
    let several = STAGES.into_iter().filter_map(|stage| {
        let count = instances.get(stage).filter(|count| **count > 1)?;
        Some(format!("{stage} {count}"))
    });
    let several: Vec<String> = several.collect();
    match several.is_empty() {
        true => "one each".to_owned(),
        false => several.join(", "),
    }
}

impl fmt::Display for Compared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            profile,
            source,
            rounds,
            cores,
            ..
        } = self;
        writeln!(
            f,
            "{source} with the {profile} profile on {cores} cores, {rounds} times in turn, not recorded\n"
        )?;
        writeln!(
            f,
            "{:<10} {:>9} {:>6} {:>8} {:>8}   slowest part",
            "instances", "triples/s", "ratio", "p50 ms", "p99 ms"
        )?;
        for row in &self.rows {
            writeln!(
                f,
                "{:<10} {:>9.2} {:>6.3} {:>8.0} {:>8.0}   {}, at most {:.1}/s",
                row.instances,
                row.triples_per_second.median,
                row.ratio.median,
                row.latency_p50_ms,
                row.latency_p99_ms,
                row.slowest,
                row.limit_per_second,
            )?;
        }
        let mut cpu: Vec<(&String, &f64)> = self.cpu_ms.iter().collect();
        cpu.sort_by(|a, b| b.1.total_cmp(a.1));
        let cpu: Vec<String> = cpu
            .iter()
            .map(|(node, ms)| format!("{node} {ms:.1}"))
            .collect();
        writeln!(f, "\nprocessor time a scan, ms: {}", cpu.join(", "))?;
        writeln!(f, "\npredicted from these times, not measured:")?;
        for row in &self.predicted {
            writeln!(
                f,
                "{:>4} cores {:>9.1} triples/s, limited by {:<9} {}",
                row.cores,
                row.triples_per_second,
                row.limit,
                in_words(&row.instances)
            )?;
        }
        writeln!(
            f,
            "\ntriples/s: the median of all rounds; ratio: to one instance in the same round, the median; p50, p99: from where\na scan is let in to where it is done"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_predicted_is_limited_by_the_slowest_stage_or_by_the_cores() {
        let cpu: BTreeMap<String, f64> = [("track", 100.0), ("match", 60.0)]
            .map(|(node, ms)| (node.to_owned(), ms))
            .into();
        // Track's two instances can do 20 scans a second, match's three 50, the cores 25.
        let four = predicted(&cpu, 4);
        assert_eq!(in_words(&four.instances), "track 2, match 3");
        assert_eq!(
            (four.limit.as_str(), four.triples_per_second),
            ("track", 20.0)
        );
        let busy: BTreeMap<String, f64> =
            [("match".to_owned(), 10.0), ("evaluate".to_owned(), 9.0)].into();
        let two = predicted(&busy, 1);
        assert_eq!(two.limit, "cores");
        assert!((two.triples_per_second - 1000.0 / 19.0).abs() < 1e-9);
    }
}
