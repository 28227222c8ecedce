//! `tricurve replay`: plays a recording into the stages after a cut.

mod given;
mod verified;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

use messages::bus::Level;
use messages::change::Change;
use messages::record::VERSIONS;
use messages::recording::Recording;
use messages::{Kind, Rig, Stage, Topic};
use record::{Comparison, MEASURED};
use replay::verify::{Findings, depth};
use replay::{Choice, Selection, check_cut, replayed_kinds};
use serde::Serialize;
use serde_json::{Map, Value, json};

use self::verified::{Expected, Verified};
use super::run::{recording, table};
use super::{compare, proof};
use crate::cli::Replay as Args;
use crate::graph::{Graph, Overrides, reads_tables};
use crate::launcher::{Launch, launch};
use crate::profile::Profile;
use crate::progress::Timeline;
use crate::said::Early;
use crate::{Failure, Outcome, former};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    if args.compare && !Stage::MATCH.follows(args.from) {
        return Err(Failure::usage(format!(
            "--compare compares points, and from {} on none are computed: --from match, or an earlier stage",
            args.from.name()
        )));
    }
    if !args.compare || args.record.is_some() {
        return play(args, true);
    }
    // What is compared is recorded for a while.
    let folder = proof::folder()?;
    let mut args = args.clone();
    args.record = Some(folder.path().join("replayed.mcap"));
    args.set.push("record.keep=results".to_owned());
    play(&args, false)
}

/// Plays, and says what came of it; a recording that does not stay is not told of.
fn play(args: &Args, stays: bool) -> Result<Outcome, Failure> {
    let mut said = Early::default();
    let Plan {
        mut graph,
        source,
        recorded,
        proven,
        rig,
        selection,
        set,
        not_recorded,
        before,
        is_less,
    } = Plan::of(args, None, &mut said)?;
    let from = args.from;
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
    if args.compare && !is_held(&source, Kind::Points) && !is_proven(&source, &proven, Kind::Points)
    {
        return Err(Failure::usage(format!(
            "{} holds no points, with which those computed anew could be compared",
            args.file.display()
        )));
    }
    let (new_settings, not_carried) =
        recorded_changes(args.repeat, &set, &graph, &source, &selection)?;
    for why in not_carried {
        said.say(Level::Warn, "replay", why);
    }
    let no_seek = match (&new_recording, args.verify, new_settings.is_empty()) {
        (Some(_), ..) => Some("a replay that is recorded cannot be sought in"),
        (_, true, _) => Some("a replay that is verified cannot be sought in"),
        (.., false) => {
            Some("settings were changed while it was recorded: a replay cannot be sought in")
        }
        _ => None,
    };
    let changed = changes(&graph, &recorded);
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
        // Which files the images were is as true of what is made of them now.
        remarks: std::iter::once(("changed", json!(changed)))
            .chain(
                ["input", MEASURED]
                    .into_iter()
                    .filter_map(|key| Some((key, recorded.get(key)?.clone()))),
            )
            .chain(played(&graph, &recorded))
            .collect(),
        is_quiet: args.json,
        timeline: Some(Timeline(
            selection.scans.iter().map(|(_, nanos)| *nanos).collect(),
        )),
        changes: new_settings,
        no_seek,
    })?;
    let summary = table::Summary::new(&ran, new_recording.as_deref().filter(|_| stays));
    let verified = args.verify.then(|| {
        let found = std::fs::read(dir.path().join(Findings::FILE)).unwrap_or_default();
        let findings: Findings = serde_json::from_slice(&found).unwrap_or_default();
        let missing = not_held(&source, from);
        let mut played = replayed_kinds(from);
        played.retain(|kind| !missing.contains(kind));
        let expected = Expected {
            topics: expected(&source, &proven, &graph),
            scans: ran.ledger.done.saturating_sub(selection.lead as u64),
            wanted: (selection.scans.len() - selection.lead) as u64,
            lead: selection.lead as u64,
            lacking: before.min(selection.scans[selection.lead].0) - selection.lead as u64,
            played,
            not_recorded,
        };
        Verified::new(findings, expected)
    });
    let compared = match (&new_recording, ran.outcome) {
        (Some(new), Outcome::Done) if args.compare => {
            // Those before the first one wanted are not recorded, but counted.
            let scans: Vec<u64> = selection.scans.iter().map(|(scan, _)| *scan).collect();
            Some(compare::with_replayed(&args.file, new, &scans)?)
        }
        _ => None,
    };
    let outcome = match (&verified, ran.outcome) {
        (Some(verified), Outcome::Done) if !verified.is_verified() => Outcome::Lost,
        (_, Outcome::Done) if is_less => Outcome::Lost,
        (_, Outcome::Done) => compared.as_ref().map_or(Outcome::Done, compare::outcome),
        (_, outcome) => outcome,
    };
    let report = Report {
        summary,
        changed,
        verified,
        compared,
    };
    match args.json {
        true => super::print_json(&report)?,
        false => super::print(&report.to_string())?,
    }
    Ok(outcome)
}

/// What is to be played, and the graph that it is played into.
pub(super) struct Plan {
    pub(super) graph: Graph,
    pub(super) source: Recording,
    /// The configuration that it was recorded with, in the keys of this build.
    recorded: Value,
    /// Of a proof the topics that it has digests of.
    proven: BTreeSet<String>,
    pub(super) rig: Rig,
    pub(super) selection: Selection,
    /// What is set otherwise than it was recorded.
    set: Vec<String>,
    /// Kinds of message that are computed and not in the recording.
    not_recorded: Vec<Kind>,
    /// How many frames before a frame it depends on.
    before: u64,
    /// Whether something of the part that is wanted is not there.
    pub(super) is_less: bool,
}

impl Plan {
    /// Settles what is played; `sink` is a node more, which takes what is computed.
    pub(super) fn of(
        args: &Args,
        sink: Option<(&'static str, Value)>,
        said: &mut Early,
    ) -> Result<Self, Failure> {
        let path = std::path::absolute(&args.file).map_err(Failure::failed)?;
        let mut source = Recording::open(&path).map_err(Failure::failed)?;
        let knows_settings = source.metadata().knows_settings();
        let proven = source.proven();
        for note in source.notes().iter().chain(source.remarks()) {
            said.say(Level::Info, "replay", note.to_string());
        }
        let set = given::settings(args, &mut source)?;
        let (from, to) = (args.from, args.to);
        if let Some(to) = to.filter(|to| !to.follows(from)) {
            let (from, to) = (from.name(), to.name());
            let text = format!(
                "--to {to} takes nothing of what --from {from} makes: nothing would be computed"
            );
            return Err(Failure::usage(text));
        }
        let stages = computing(&source, from, to);
        check_cut(&source, from, &stages).map_err(Failure::failed)?;
        let (first, end) = range(args, &source);
        let is_part = first > 0 || end.is_some();
        let (recorded, not_carried) = former::carried(&source.metadata().configuration);
        let recorded = &recorded;
        let not_recorded = not_recorded(&source, &stages, &proven);
        let is_computing = |why: &String| {
            let mut names = stages.iter().map(|stage| stage.name());
            names.any(|name| why.starts_with(&format!("{name}.")))
        };
        let not_carried = not_carried.into_iter().filter(is_computing);
        for why in proof::other_versions(recorded, &stages)
            .into_iter()
            .chain(not_carried)
        {
            match sink {
                Some(_) => return Err(Failure::failed(why)),
                None => said.say(Level::Warn, "replay", why),
            }
        }
        let mut graph = graph(args, &set, &stages, (first, end), &path, recorded, sink)?;
        graph.fill_in("verify", "without", json!(not_recorded));
        let left_out = graph.settings_of("rehydrate").get("without");
        let left_out = left_out.and_then(|kinds| serde_json::from_value(kinds.clone()).ok());
        let left_out: Vec<Kind> = left_out.unwrap_or_default();
        let mut without = Kind::all().collect::<Vec<_>>();
        let unproven = record::rehydrate::unproven(source.metadata());
        let is_wanted = |kind: &Kind| {
            let is_known = is_proven(&source, &proven, *kind) || unproven.contains(kind);
            is_known && !left_out.contains(kind)
        };
        without.retain(|kind| !is_wanted(kind));
        graph.fill_in("rehydrate", "without", json!(without));
        let is_other = |name: &str, key: &str| {
            let then = recorded.get(name).and_then(|table| table.get(key));
            graph.has(name) && graph.settings_of(name).get(key) != then
        };
        if graph.has("evaluate") && is_other("match", "reference") {
            let text = "the recorded truth is of another reference view: nothing is evaluated";
            said.say(Level::Info, "replay", text);
            graph.remove("evaluate");
        }
        let rig = rig(&graph, &source)?;
        // What is verified or compared along a rail depends on frames before: they are played too.
        let computed = Kind::all().filter(|kind| graph.has(kind.stage().name()));
        let depths = computed.map(|kind| depth(&rig, from, kind));
        let before = depths.max().unwrap_or(0);
        let before = match args.verify || args.compare {
            true => before,
            false => 0,
        };
        let choice = Choice {
            from,
            taken: graph.taken(),
            first,
            end,
            before,
            whole: args.verify,
        };
        for node in ["replay", "verify"] {
            graph.fill_in(node, "before", before);
        }
        graph.fill_in("replay", "without", json!(not_held(&source, from)));
        let selection = Selection::of(&source, choice).map_err(Failure::failed)?;
        let played = selection.scans.len() - selection.lead;
        if selection.broken > 0 {
            let (broken, all) = (selection.broken, selection.broken + played);
            let text = format!("{broken} of {all} scans are not whole and are left out");
            said.say(Level::Warn, "replay", text);
        }
        if source.is_proof() && (args.verify || graph.has("rehydrate")) {
            let scans: Vec<u64> = selection.scans.iter().map(|(scan, _)| *scan).collect();
            proof::check(&mut source, &scans, knows_settings, args.json)?;
        }
        graph.fill_in("record", "skip", selection.lead as u64);
        // What is not there of the part that is wanted is missing from what comes out.
        let is_less = selection.broken > 0 || !is_part && source.lacks_scans();
        Ok(Self {
            graph,
            recorded: recorded.clone(),
            source,
            proven,
            rig,
            selection,
            set,
            not_recorded,
            before,
            is_less,
        })
    }
}

/// The settings that were changed while it was recorded, of the stages that compute, by the numbers of the scans as they
/// are played, and a sentence for each that this build cannot change. What is set on the command line holds throughout.
pub(super) fn recorded_changes(
    repeats: bool,
    set: &[String],
    graph: &Graph,
    source: &Recording,
    selection: &Selection,
) -> Result<(Vec<Change>, Vec<String>), Failure> {
    let lines = set;
    let is_set = |change: &Change| {
        let name = format!("{}.{}", change.node, change.key);
        let set = |line: &String| {
            line.split_once('=')
                .is_some_and(|(key, _)| key.trim() == name)
        };
        lines.iter().any(set)
    };
    let mut changes = source.changes();
    changes.retain(|change| graph.has(&change.node));
    let (mut changes, not_carried) = former::carried_changes(changes);
    changes.retain(|change| !is_set(change));
    let place = |change: &Change| {
        let before = |(scan, _): &(u64, u64)| *scan < change.from;
        selection.scans.partition_point(before)
    };
    changes.retain(|change| place(change) < selection.scans.len());
    // What holds from the first scan on holds in every round.
    if let Some(change) = changes.iter().find(|change| place(change) > 0)
        && repeats
    {
        return Err(Failure::usage(format!(
            "{change}: it cannot be played in a loop; --set that key, or leave --loop out"
        )));
    }
    for change in &mut changes {
        change.from = place(change) as u64;
    }
    Ok((changes, not_carried))
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

/// The kinds of message that these stages make and the recording holds nothing of, not even digests.
fn not_recorded(source: &Recording, stages: &[Stage], proven: &BTreeSet<String>) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = stages.iter().flat_map(|stage| stage.makes()).collect();
    kinds.retain(|kind| !is_held(source, *kind) && !is_proven(source, proven, *kind));
    kinds
}

/// Whether there are digests of a topic of this kind.
fn is_proven(source: &Recording, proven: &BTreeSet<String>, kind: Kind) -> bool {
    let topics = Topic::of(&source.metadata().rig, kind);
    topics.iter().any(|topic| proven.contains(&topic.name))
}

/// Whether the recording has a topic of this kind.
fn is_held(source: &Recording, kind: Kind) -> bool {
    let channels = source.channels();
    let topics = Topic::of(&source.metadata().rig, kind);
    topics
        .iter()
        .any(|topic| channels.contains_key(&*topic.name))
}

/// The stages that compute: those of the recording's own graph from the cut on, no evaluation without a truth, and a map and
/// what others make only where there was one.
fn computing(source: &Recording, from: Stage, to: Option<Stage>) -> Vec<Stage> {
    let knows_truth = !not_held(source, from).contains(&Kind::Truth);
    let configuration = &source.metadata().configuration;
    let was_there = |stage: Stage| configuration.get(stage.name()).is_some();
    let is_rail = source.metadata().rig.rail.is_some();
    let own = Stage::own();
    let computes = |stage: &Stage| {
        let is_there = match *stage {
            Stage::EVALUATE => knows_truth && was_there(*stage),
            Stage::MAP => is_rail && was_there(*stage),
            other => own.contains(&other) || was_there(other),
        };
        is_there && stage.follows(from) && to.is_none_or(|to| to.follows(*stage))
    };
    Stage::computing().into_iter().filter(computes).collect()
}

/// The settings and versions of the stages that do not compute: what they made, and for which view, is as it was recorded.
fn played(graph: &Graph, recorded: &Value) -> impl Iterator<Item = (&'static str, Value)> {
    let mut stages = Stage::computing();
    stages.retain(|stage| !graph.has(stage.name()));
    let versions = recorded.get(VERSIONS).and_then(Value::as_object);
    let versions: Map<String, Value> = stages
        .iter()
        .filter_map(|stage| {
            Some((
                stage.name().to_owned(),
                versions?.get(stage.name())?.clone(),
            ))
        })
        .collect();
    let tables: Vec<_> = stages
        .iter()
        .filter_map(|stage| Some((stage.name(), recorded.get(stage.name())?.clone())))
        .collect();
    tables.into_iter().chain([(VERSIONS, versions.into())])
}

/// The topics that are computed anew and that the recording holds, or has digests of.
fn expected(source: &Recording, proven: &BTreeSet<String>, graph: &Graph) -> Vec<String> {
    let channels = source.channels();
    let is_computed = |topic: &Topic| {
        let stage = topic.kind.stage();
        let is_known = channels.contains_key(&*topic.name) || proven.contains(&topic.name);
        stage != Stage::CAPTURE && graph.has(stage.name()) && is_known
    };
    let mut topics = Topic::all(&source.metadata().rig);
    topics.retain(is_computed);
    topics.into_iter().map(|topic| topic.name).collect()
}

/// The recording's own graph, from the cut on.
fn graph(
    args: &Args,
    set: &[String],
    stages: &[Stage],
    (first, end): (u64, Option<u64>),
    path: &Path,
    recorded: &Value,
    sink: Option<(&'static str, Value)>,
) -> Result<Graph, Failure> {
    let from = args.from;
    let mut tables = Map::new();
    let names = stages.iter().map(|stage| stage.name());
    for name in names.chain(["graph"]) {
        if let Some(table) = recorded.get(name) {
            tables.insert(name.to_owned(), without_nulls(table));
        }
    }
    // Recordings of before points of a map were held apart hold all of them.
    if let Some(Value::Object(map)) = tables.get_mut(Stage::MAP.name()) {
        map.entry("apart").or_insert(json!(0.0));
    }
    // Recordings of before R-tables were made only where they are read hold them all; where they hold none, the matcher of
    // this replay, if it has one, decides again.
    let matches = stages.contains(&Stage::MATCH);
    if let Some(Value::Object(hough)) = tables.get_mut(Stage::HOUGH.name()) {
        let made = hough.entry("tables").or_insert(json!(true)) == &json!(true);
        if matches && !made {
            hough.remove("tables");
        }
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
    match sink {
        Some((name, table)) => {
            tables.insert(name.to_owned(), table);
        }
        None if args.verify => {
            tables.insert("verify".to_owned(), verify);
        }
        None => {}
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
    let overrides = Overrides::parse(set)?;
    for (node, key) in overrides
        .keys()
        .filter(|(node, _)| !tables.contains_key(*node))
    {
        if node == Stage::CAPTURE.name() {
            return Err(Failure::usage(format!(
                "{node}.{key} was settled when the recording was made, and a replay has no capture: run again on the source"
            )));
        }
        if let Some(why) = why_not(args, node) {
            return Err(Failure::usage(format!("{node}.{key} is set, but {why}")));
        }
    }
    let graph = Graph::of_tables(tables, Profile::Default, &overrides)
        .map_err(|text| Failure::usage(format!("the recording's graph: {text}")))?;
    let made = |hough: &Value| hough.get("tables") != Some(&json!(false));
    let matching = graph.settings_of(Stage::MATCH.name());
    if graph.has(Stage::MATCH.name())
        && !graph.has(Stage::HOUGH.name())
        && !recorded.get(Stage::HOUGH.name()).is_none_or(made)
        && reads_tables(matching).map_err(Failure::usage)?
    {
        return Err(Failure::usage(
            "match.assignment = curve reads R-tables, and none were recorded: replay --from hough makes them",
        ));
    }
    Ok(graph)
}

/// Why a node that there is has no part in a replay; `None` of one that nobody knows.
fn why_not(args: &Args, node: &str) -> Option<String> {
    let (from, to) = (args.from, args.to);
    let stage = Stage::named(node);
    let after = to.filter(|to| !stage.is_none_or(|stage| to.follows(stage)));
    Some(match (stage, node) {
        (Some(stage), _) if !stage.follows(from) => format!(
            "a replay from {} plays what {node} made as it was recorded: replay --from {node}",
            from.name()
        ),
        (Some(_), _) => match after {
            Some(to) => format!(
                "a replay to {} does not compute {node}: replay --to {node}",
                to.name()
            ),
            None => format!("the recording was made without {node}"),
        },
        (None, "record") => "nothing is recorded: replay --record FILE".to_owned(),
        (None, "bridge") => "nothing is shown: replay --view".to_owned(),
        (None, "verify") => "nothing is verified: replay --verify".to_owned(),
        (None, _) => return None,
    })
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
        let names = || Kind::all().map(Kind::name);
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
        left_out.extend(Kind::all().filter(is_unwanted));
        left_out.sort_unstable();
        left_out.dedup();
    }
    Ok(left_out)
}

/// What is set otherwise than in the recording: by key, the value then and now.
fn changes(graph: &Graph, recorded: &Value) -> BTreeMap<String, [Value; 2]> {
    let now = graph.configuration();
    let mut changes = BTreeMap::new();
    for name in Stage::computing().into_iter().map(Stage::name) {
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
    #[serde(skip_serializing_if = "Option::is_none")]
    compared: Option<Comparison>,
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
        if let Some(verified) = &self.verified {
            write!(f, "\n{verified}")?;
        }
        match &self.compared {
            Some(compared) => write!(
                f,
                "\nA as it was recorded, B as it was played:\n{}",
                compare::told(compared)
            ),
            None => Ok(()),
        }
    }
}
