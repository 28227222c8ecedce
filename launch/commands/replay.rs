//! `tricurve replay`: plays a recording into the stages after a cut.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use messages::bus::Level;
use messages::change::Change;
use messages::recording::Recording;
use messages::{Kind, Rig, Stage, Topic};
use replay::verify::Findings;
use replay::{Choice, Selection, check_cut, replayed_kinds};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::run::{recording, table};
use crate::cli::{Profile, Replay as Args};
use crate::graph::{Graph, Overrides};
use crate::launcher::{Launch, launch};
use crate::progress::Timeline;
use crate::said::Early;
use crate::{Failure, Outcome};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let path = std::path::absolute(&args.file).map_err(Failure::failed)?;
    let source = Recording::open(&path).map_err(Failure::failed)?;
    let mut said = Early::default();
    for note in source.notes() {
        said.say(Level::Info, "replay", note.to_string());
    }
    let from = Stage::from(args.from);
    let to = Stage::from(args.to);
    if to < from {
        let (from, to) = (from.name(), to.name());
        let text = format!("--to {to} comes before --from {from}: nothing would be computed");
        return Err(Failure::usage(text));
    }
    let stages = computing(&source, from, to);
    check_cut(&source, from, &stages).map_err(Failure::failed)?;
    let (first, end) = range(args, &source);
    let recorded = &source.metadata().configuration;
    let not_recorded = not_recorded(&source, &stages);
    let mut graph = graph(args, &stages, first, end, &path, recorded)?;
    graph.fill_in("verify", "without", json!(not_recorded));
    let is_other = |name: &str, key: &str| {
        let then = recorded.get(name).and_then(|table| table.get(key));
        graph.has(name) && graph.settings_of(name).get(key) != then
    };
    if graph.has("evaluate") && is_other("match", "reference") {
        let text = "the recorded truth is of another reference view: nothing is evaluated";
        said.say(Level::Info, "replay", text);
        graph.remove("evaluate");
    }
    let choice = Choice {
        from,
        taken: graph.taken(),
        first,
        end,
        whole: args.verify,
    };
    graph.fill_in("replay", "without", json!(not_held(&source, from)));
    let selection = Selection::of(&source, choice).map_err(Failure::failed)?;
    if selection.broken > 0 {
        let (broken, all) = (selection.broken, selection.broken + selection.scans.len());
        let text = format!("{broken} of {all} scans are not whole and are left out");
        said.say(Level::Warn, "replay", text);
    }
    let new_recording = recording(&mut graph)?;
    if let Some(new) = &new_recording {
        let old = record::Writer::check(new, args.force).map_err(Failure::failed)?;
        let read: Vec<_> = source.parts.iter().map(|part| part.path.clone()).collect();
        let written = old.iter().map(|path| path.as_path()).chain([new.as_path()]);
        if let Some(both) = record::read_and_written(&read, written) {
            let text = format!("{} is played and cannot be written too", both.display());
            return Err(Failure::usage(text));
        }
    }
    let new_settings = recorded_changes(args, &graph, &source, &selection)?;
    let no_seek = match (&new_recording, args.verify, new_settings.is_empty()) {
        (Some(_), ..) => Some("a replay that is recorded cannot be sought in"),
        (_, true, _) => Some("a replay that is verified cannot be sought in"),
        (.., false) => {
            Some("settings were changed while it was recorded: a replay cannot be sought in")
        }
        _ => None,
    };
    let changed = changes(&graph, recorded);
    let rig = rig(&graph, &source)?;
    let names = &source.metadata().scans;
    let name = |&(scan, _): &(u64, u64)| {
        let turn = scan.checked_rem(names.len() as u64)?;
        names.get(turn as usize).cloned()
    };
    let (ran, dir) = launch(Launch {
        graph: &graph,
        rig,
        scans: selection.scans.iter().map_while(name).collect(),
        places: Vec::new(),
        sway: Vec::new(),
        said: said.lines(),
        remarks: vec![("changed", json!(changed))],
        is_quiet: args.json,
        timeline: Some(Timeline(
            selection.scans.iter().map(|(_, nanos)| *nanos).collect(),
        )),
        changes: new_settings,
        no_seek,
    })?;
    let summary = table::Summary::new(&ran, new_recording.as_deref());
    let verified = args.verify.then(|| {
        let found = std::fs::read(dir.path().join(Findings::FILE)).unwrap_or_default();
        let findings = serde_json::from_slice(&found).unwrap_or_default();
        let missing = not_held(&source, from);
        let mut played = replayed_kinds(from);
        played.retain(|kind| !missing.contains(kind));
        Verified::new(findings, ran.ledger.done, &played, &not_recorded)
    });
    let outcome = match (&verified, ran.outcome) {
        (Some(verified), Outcome::Done) if !verified.equal => Outcome::Lost,
        (_, outcome) => outcome,
    };
    let report = Report {
        summary,
        changed,
        verified,
    };
    match args.json {
        true => super::print_json(&report)?,
        false => super::print(&report.to_string())?,
    }
    Ok(outcome)
}

/// The settings that were changed while it was recorded, of the stages that compute, by the numbers of the scans as they
/// are played. What is set on the command line holds throughout.
fn recorded_changes(
    args: &Args,
    graph: &Graph,
    source: &Recording,
    selection: &Selection,
) -> Result<Vec<Change>, Failure> {
    let is_set = |change: &Change| {
        let name = format!("{}.{}", change.node, change.key);
        let set = |line: &String| {
            line.split_once('=')
                .is_some_and(|(key, _)| key.trim() == name)
        };
        args.set.iter().any(set)
    };
    let mut changes = source.changes();
    changes.retain(|change| graph.has(&change.node) && !is_set(change));
    let place = |change: &Change| {
        let before = |(scan, _): &(u64, u64)| *scan < change.from;
        selection.scans.partition_point(before)
    };
    changes.retain(|change| place(change) < selection.scans.len());
    // What holds from the first scan on holds in every round.
    if let Some(change) = changes.iter().find(|change| place(change) > 0)
        && args.repeat
    {
        return Err(Failure::usage(format!(
            "{change}: it cannot be played in a loop; --set that key, or leave --loop out"
        )));
    }
    for change in &mut changes {
        change.from = place(change) as u64;
    }
    Ok(changes)
}

/// Which scans are wanted, by number or by time.
fn range(args: &Args, source: &Recording) -> (u64, Option<u64>) {
    if let Some(scans) = args.scans {
        return (scans.first, scans.end);
    }
    let times: Vec<(u64, u64)> = source
        .scans()
        .filter_map(|scan| Some((scan, source.nanos(scan)?)))
        .collect();
    let Some(&(_, start)) = times.first() else {
        return (0, None);
    };
    let at_or_after = |time: u64| times.iter().find(|(_, nanos)| *nanos >= time);
    let after = |seconds: f64| start.saturating_add((seconds.max(0.0) * 1e9) as u64);
    let begin = after(args.start_offset.unwrap_or(0.0));
    let behind = times.last().map_or(0, |(scan, _)| scan + 1);
    let first = at_or_after(begin).map_or(behind, |(scan, _)| *scan);
    let end = args.duration.and_then(|seconds| {
        let end = begin.saturating_add((seconds.max(0.0) * 1e9) as u64);
        at_or_after(end).map(|(scan, _)| *scan)
    });
    (first, end)
}

/// The kinds of message before the cut of which the recording holds nothing.
fn not_held(source: &Recording, from: Stage) -> Vec<Kind> {
    let mut kinds = replayed_kinds(from);
    kinds.retain(|kind| !is_held(source, *kind));
    kinds
}

/// The kinds of message that these stages make and the recording holds nothing of.
fn not_recorded(source: &Recording, stages: &[Stage]) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = stages.iter().flat_map(|stage| stage.makes()).collect();
    kinds.retain(|kind| !is_held(source, *kind));
    kinds
}

/// Whether the recording has a topic of this kind.
fn is_held(source: &Recording, kind: Kind) -> bool {
    let channels = source.channels();
    let topics = Topic::of(&source.metadata().rig, kind);
    topics
        .iter()
        .any(|topic| channels.contains_key(&*topic.name))
}

/// The stages that compute: those of the recording's own graph from the cut on, no evaluation without a truth, and a map
/// only where one was made.
fn computing(source: &Recording, from: Stage, to: Stage) -> Vec<Stage> {
    let knows_truth = !not_held(source, from).contains(&Kind::Truth);
    let configuration = &source.metadata().configuration;
    let is_evaluated = knows_truth && configuration.get(Stage::Evaluate.name()).is_some();
    let is_mapped = configuration.get(Stage::Map.name()).is_some();
    let computes = |stage: &Stage| {
        let is_there = match stage {
            Stage::Evaluate => is_evaluated,
            Stage::Map => is_mapped,
            _ => true,
        };
        is_there && (from..=to).contains(stage)
    };
    Stage::ALL.into_iter().skip(1).filter(computes).collect()
}

/// The recording's own graph, from the cut on.
fn graph(
    args: &Args,
    stages: &[Stage],
    first: u64,
    end: Option<u64>,
    path: &Path,
    recorded: &Value,
) -> Result<Graph, Failure> {
    let from = Stage::from(args.from);
    let mut tables = Map::new();
    let names = stages.iter().map(|stage| stage.name());
    for name in names.chain(["graph"]) {
        if let Some(table) = recorded.get(name) {
            tables.insert(name.to_owned(), without_nulls(table));
        }
    }
    // Recordings of before points of a map were held apart hold all of them.
    if let Some(Value::Object(map)) = tables.get_mut(Stage::Map.name()) {
        map.entry("apart").or_insert(json!(0.0));
    }
    // What a live run may drop a replay may not.
    if let Some(Value::Object(graph)) = tables.get_mut("graph") {
        graph.insert("delivery".to_owned(), json!("lossless"));
    }
    let mut source = json!({
        "file": path, "from": from, "first": first, "whole": args.verify, "paused": args.start_paused, "repeat": args.repeat,
    });
    let mut verify = json!({ "file": path, "from": from, "first": first });
    if let Some(end) = end {
        source["end"] = end.into();
        verify["end"] = end.into();
    }
    if let Some(rate) = args.rate {
        source["rate"] = rate.into();
    }
    tables.insert("replay".to_owned(), source);
    if args.verify {
        tables.insert("verify".to_owned(), verify);
    }
    if let Some(file) = &args.record {
        let record = json!({
            "file": file, "overwrite": args.force, "without": left_out(args, from)?,
        });
        tables.insert("record".to_owned(), record);
    }
    if args.view {
        tables.insert("bridge".to_owned(), json!({}));
    }
    let overrides = Overrides::parse(&args.set)?;
    if let Some(key) = overrides.key_of("capture") {
        return Err(Failure::usage(format!(
            "capture.{key} was settled when the recording was made, and a replay has no capture: run again on the source"
        )));
    }
    Graph::of_tables(tables, Profile::Default, &overrides)
        .map_err(|text| Failure::usage(format!("the recording's graph: {text}")))
}

/// A table without the keys that are not set, as in a graph file.
fn without_nulls(table: &Value) -> Value {
    match table {
        Value::Object(table) => table
            .iter()
            .filter(|(_, value)| !value.is_null())
            .map(|(key, value)| (key.clone(), value.clone()))
            .collect::<Map<_, _>>()
            .into(),
        other => other.clone(),
    }
}

/// The kinds that the new recording leaves out: what is not made anew, or not wanted.
fn left_out(args: &Args, from: Stage) -> Result<Vec<Kind>, Failure> {
    let mut left_out = replayed_kinds(from);
    if let Some(topics) = &args.topics {
        let names = || Kind::ALL.into_iter().map(Kind::name);
        if let Some(unknown) = topics
            .iter()
            .find(|topic| !names().any(|name| name == **topic))
        {
            let known = names().collect::<Vec<_>>().join(", ");
            return Err(Failure::usage(format!(
                "there are no topics {unknown}; there are {known}"
            )));
        }
        let is_wanted = |kind: &Kind| topics.iter().any(|topic| topic == kind.name());
        if let Some(played) = left_out.iter().find(|kind| is_wanted(kind)) {
            let (topic, from) = (played.name(), from.name());
            return Err(Failure::usage(format!(
                "{topic} is played, not made anew, in a replay from {from}: only what is made anew is recorded"
            )));
        }
        let is_unwanted = |kind: &Kind| !is_wanted(kind);
        left_out.extend(Kind::ALL.into_iter().filter(is_unwanted));
        left_out.sort_unstable();
        left_out.dedup();
    }
    Ok(left_out)
}

/// What is set otherwise than in the recording: by key, the value then and now.
fn changes(graph: &Graph, recorded: &Value) -> BTreeMap<String, [Value; 2]> {
    let now = graph.configuration();
    let mut changes = BTreeMap::new();
    for name in Stage::ALL.into_iter().skip(1).map(Stage::name) {
        let (Some(Value::Object(table)), Some(then)) = (now.get(name), recorded.get(name)) else {
            continue;
        };
        for (key, value) in table {
            let then = then.get(key).unwrap_or(&Value::Null);
            if then != value {
                changes.insert(format!("{name}.{key}"), [then.clone(), value.clone()]);
            }
        }
    }
    changes
}

/// The recording's rig, in the channels that the filter now has.
fn rig(graph: &Graph, source: &Recording) -> Result<Rig, Failure> {
    let mut recorded = source.metadata().rig.clone();
    if let Some(rail) = &mut recorded.rail {
        rail.follow = graph.follow()?;
    }
    graph.reference(recorded.views.len())?;
    if !graph.has("filter") {
        return Ok(recorded);
    }
    let channels = graph.channels()?;
    let same = Rig::of_views(recorded.views.len(), &channels, recorded.size);
    Ok(Rig {
        channels: same.channels,
        ..recorded
    })
}

/// What came of a replay.
#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    summary: table::Summary,
    /// Settings that are not the recording's: then and now.
    changed: BTreeMap<String, [Value; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    verified: Option<Verified>,
}

/// What came of comparing.
#[derive(Debug, Serialize)]
struct Verified {
    /// Whether every message of every scan is the same to the byte.
    equal: bool,
    scans: u64,
    /// Kinds of message that were played, not computed, and not compared.
    played: Vec<&'static str>,
    /// Kinds of message that were computed, but are not in the recording, and not compared.
    not_recorded: Vec<&'static str>,
    topics: BTreeMap<String, TopicVerified>,
}

#[derive(Debug, Serialize)]
struct TopicVerified {
    equal: u64,
    different: u64,
    missing: u64,
    /// Messages of a rail's first frames, which depend on frames that are not replayed: they are not compared.
    #[serde(skip_serializing_if = "is_none")]
    dependent: u64,
    /// What is the matter with the first message that is not equal.
    #[serde(skip_serializing_if = "Option::is_none")]
    first: Option<String>,
}

fn is_none(count: &u64) -> bool {
    *count == 0
}

impl Verified {
    fn new(findings: Findings, scans: u64, played: &[Kind], not_recorded: &[Kind]) -> Self {
        let topics: BTreeMap<_, _> = findings
            .topics
            .into_iter()
            .map(|(topic, found)| {
                let compared = TopicVerified {
                    equal: found.equal,
                    different: found.different,
                    missing: scans.saturating_sub(found.equal + found.different + found.dependent),
                    dependent: found.dependent,
                    first: found.first,
                };
                (topic, compared)
            })
            .collect();
        Self {
            equal: scans > 0
                && !topics.is_empty()
                && topics.values().any(|topic| topic.equal > 0)
                && topics
                    .values()
                    .all(|topic| topic.equal + topic.dependent == scans),
            scans,
            played: played.iter().map(|kind| kind.name()).collect(),
            not_recorded: not_recorded.iter().map(|kind| kind.name()).collect(),
            topics,
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.summary)?;
        if !self.changed.is_empty() {
            writeln!(f, "\nset otherwise than when it was recorded:")?;
            for (key, [then, now]) in &self.changed {
                writeln!(f, "  {key}: {now}, was {then}")?;
            }
        }
        let Some(verified) = &self.verified else {
            return Ok(());
        };
        writeln!(
            f,
            "\n{:<24} {:>7} {:>10} {:>8}",
            "topic", "equal", "different", "missing"
        )?;
        for (topic, found) in &verified.topics {
            let TopicVerified {
                equal,
                different,
                missing,
                dependent,
                first,
            } = found;
            writeln!(f, "{topic:<24} {equal:>7} {different:>10} {missing:>8}")?;
            if let Some(first) = first {
                writeln!(f, "    first: {first}")?;
            }
            if *dependent > 0 {
                writeln!(
                    f,
                    "    not compared: {dependent}, which depend on frames before those that are replayed"
                )?;
            }
        }
        let played = verified.played.join(", ");
        if !verified.not_recorded.is_empty() {
            let kinds = verified.not_recorded.join(", ");
            writeln!(f, "\nnot in the recording, and not compared: {kinds}")?;
        }
        match verified.equal {
            true => writeln!(
                f,
                "\nverified: {} scans are equal to the byte on {} topics; played, not computed: {played}",
                verified.scans,
                verified.topics.len()
            ),
            false => writeln!(f, "\nNOT equal: what is computed is not what was recorded"),
        }
    }
}
