//! Proofs: recordings that hold digests of what they do not hold.
//!
//! ```text
//! proof ─► check: versions, settings, images ─► replay into the node rehydrate ─► full recording, for good or for a while
//! ```

use std::path::{Path, PathBuf};

use messages::record::VERSIONS;
use messages::recording::Recording;
use messages::{Kind, Stage};
use replay::verify::depth;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::replay::{Plan, recorded_changes};
use super::rewrite::progress_bar;
use crate::cli::{Replay, Scans};
use crate::launcher::{Launch, launch};
use crate::registry::versions;
use crate::said::Early;
use crate::{Failure, Outcome};

/// How many faults are named.
const MOST_NAMED: usize = 5;

/// Why what these stages compute here need not be what they computed when it was recorded, in one sentence.
pub(super) fn other_versions(recorded: &Value, stages: &[Stage]) -> Option<String> {
    let then = recorded.get(VERSIONS)?;
    let is_computing = |stage: &str| stages.iter().any(|known| known.name() == stage);
    let differing = versions().filter(|(stage, _)| is_computing(stage));
    let differing = differing.filter_map(|(stage, now)| {
        let then = then.get(stage)?;
        (*then != now).then(|| format!("{stage} was version {then} and is {now} here"))
    });
    let differing: Vec<String> = differing.collect();
    (!differing.is_empty()).then(|| {
        format!(
            "{}: another build recorded it, and what this one computes is not what was recorded",
            differing.join(", ")
        )
    })
}

/// Whether these scans of a proof are what they were when they were recorded, as far as it holds them.
///
/// # Errors
/// When they are not: what was changed.
pub(super) fn check(
    proof: &mut Recording,
    scans: &[u64],
    knows_settings: bool,
    is_quiet: bool,
) -> Result<(), Failure> {
    let bar = progress_bar(is_quiet);
    if let Some(bar) = &bar {
        bar.set_length(scans.len() as u64);
    }
    let mut faults = Vec::new();
    for &scan in scans {
        faults.extend(faults_of(proof, scan, knows_settings)?);
        if let Some(bar) = &bar {
            bar.inc(1);
        }
        if faults.len() >= MOST_NAMED {
            break;
        }
    }
    if let Some(bar) = &bar {
        bar.finish_and_clear();
    }
    match faults.is_empty() {
        true => Ok(()),
        false => Err(Failure::failed(faults.join("\n  "))),
    }
}

/// What of a scan is not what it was when it was recorded.
pub(super) fn faults_of(
    proof: &mut Recording,
    scan: u64,
    knows_settings: bool,
) -> Result<Vec<String>, Failure> {
    let settings = knows_settings.then(|| proof.settings_of(scan));
    let read = proof.scan(scan).map_err(Failure::failed)?;
    let faults = read.faults(proof.codec(), settings.as_ref());
    proof.reuse(read);
    Ok(faults)
}

/// What of a proof becomes which full recording.
pub(super) struct Wanted<'a> {
    /// The proof.
    pub(super) file: &'a Path,
    /// Which of its scans.
    pub(super) scans: Option<Scans>,
    /// Kinds of message that are left out.
    pub(super) without: &'a [Kind],
    /// The full recording; what lies there is overwritten.
    pub(super) output: &'a Path,
    /// Whether nothing is said of how it goes on.
    pub(super) is_quiet: bool,
}

/// A full recording that was made of a proof.
pub(super) struct Rehydrated {
    /// How many scans it has.
    pub(super) scans: u64,
    /// Whether something of the part that was wanted is not there.
    pub(super) is_less: bool,
}

/// Makes a full recording of a proof.
///
/// # Errors
/// When what is computed is not what was recorded, or the recording cannot be written; what was written is then no recording
/// of the whole.
pub(super) fn rehydrate(wanted: &Wanted<'_>) -> Result<Rehydrated, Failure> {
    let mut said = Early::default();
    let path = std::path::absolute(wanted.file).map_err(Failure::failed)?;
    let args = Replay {
        verify: true,
        json: wanted.is_quiet,
        ..Replay::of(path.clone(), wanted.scans)
    };
    let own = json!({ "file": path, "output": wanted.output, "without": wanted.without });
    let Plan {
        mut graph,
        source,
        rig,
        selection,
        is_less,
        ..
    } = Plan::of(&args, Some(("rehydrate", own)), &mut said)?;
    let lead = selection.lead as u64;
    let deepest = Kind::all().filter(|kind| {
        let stage = kind.stage().name();
        graph.has(stage) && !wanted.without.contains(kind)
    });
    let deepest = deepest.map(|kind| depth(&rig, Stage::CAPTURE, kind));
    let deepest = deepest.max().unwrap_or(0);
    let all = lead..selection.scans.len() as u64;
    let follows = |tick: &u64| selection.follows(*tick, deepest);
    if let Some(tick) = all.clone().find(|tick| !follows(tick)) {
        let can = all.skip_while(|tick| !follows(tick));
        let can: Vec<u64> = can.take_while(follows).collect();
        let (scan, _) = selection.scan(tick);
        let of = |tick: &u64| selection.scan(*tick).0;
        let others = match (can.first().map(of), can.last().map(of)) {
            (Some(first), Some(last)) => format!("it can be done of --scans {first}..{}", last + 1),
            _ => "it cannot be done of any".to_owned(),
        };
        return Err(Failure::failed(format!(
            "scan {scan} depends on {deepest} frames before it, and not all of them are in the recording: {others}"
        )));
    }
    let scans: Vec<u64> = selection.scans.iter().map(|(scan, _)| *scan).collect();
    graph.fill_in("rehydrate", "scans", json!(scans));
    graph.fill_in("rehydrate", "lead", lead);
    let (changes, not_carried) = recorded_changes(false, &[], &graph, &source, &selection)?;
    if let Some(why) = not_carried.into_iter().next() {
        return Err(Failure::failed(why));
    }
    let (ran, _) = launch(Launch {
        graph: &graph,
        rig,
        scans: Vec::new(),
        places: Vec::new(),
        sway: Vec::new(),
        said: said.lines(),
        remarks: Vec::new(),
        is_quiet: wanted.is_quiet,
        timeline: None,
        changes,
        no_seek: None,
    })?;
    let not_whole = |outcome, text: String| Err(Failure { outcome, text });
    let (done, all) = (ran.ledger.done, scans.len() as u64);
    match ran.outcome {
        Outcome::Done if done == all => Ok(Rehydrated {
            scans: done - lead,
            is_less,
        }),
        Outcome::Done => not_whole(
            Outcome::Failed,
            format!("it was ended after {done} of {all} scans: nothing is written"),
        ),
        outcome => not_whole(outcome, "nothing is written".to_owned()),
    }
}

/// Computes of a proof what it does not hold of these scans, but for the kinds that nobody asks for, and lets them be read
/// out of that; what is returned must live as long as they are read. Of what is no proof nothing is done.
///
/// # Errors
/// As [`rehydrate`].
pub(super) fn complete(
    recording: &mut Recording,
    scans: &[u64],
    without: &[Kind],
) -> Result<Option<TempDir>, Failure> {
    if !recording.is_proof() {
        return Ok(None);
    }
    let folder = folder()?;
    let file: PathBuf = recording.path().to_owned();
    for (number, run) in scans.chunk_by(|one, next| one + 1 == *next).enumerate() {
        let (Some(&first), Some(&last)) = (run.first(), run.last()) else {
            continue;
        };
        let output = folder.path().join(format!("{number}.mcap"));
        rehydrate(&Wanted {
            file: &file,
            scans: Some(Scans {
                first,
                end: Some(last + 1),
            }),
            without,
            output: &output,
            is_quiet: true,
        })?;
        let fuller = Recording::open(&output).map_err(Failure::failed)?;
        recording.complete(fuller);
    }
    Ok(Some(folder))
}

/// A folder for what is computed for a while.
pub(super) fn folder() -> Result<TempDir, Failure> {
    tempfile::tempdir()
        .map_err(|e| Failure::failed(format!("cannot make a folder for what is computed: {e}")))
}
