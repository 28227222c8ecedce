//! What a run came to, as a table or as JSON.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use matching::node::AMBIGUOUS;
use messages::Kind;
use messages::bus::{NodeReport, Percentiles};
use messages::ledger::Ledger;
use messages::synchronisation::Synchronisation;
use messages::words::counted;
use serde::Serialize;

use crate::Outcome;
use crate::supervisor::Ran;

/// One node's line.
#[derive(Debug, Serialize)]
struct NodeSummary {
    node: String,
    milliseconds: Percentiles,
    counts: BTreeMap<String, u64>,
    /// Scans that it said to be done, of a node that says so: one that is sent again is not counted again.
    #[serde(skip)]
    done: Option<u64>,
    restarts: u32,
    duplicates: u64,
}

/// What a run came to.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    scans: u64,
    seconds: f64,
    triples_per_second: f64,
    nodes: Vec<NodeSummary>,
    /// What came of the cameras' frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    synchronisation: Option<Box<Synchronisation>>,
    ledger: Ledger,
    balanced: bool,
    outcome: Outcome,
    /// What makes the results doubtful.
    warnings: Vec<String>,
    recording: Option<PathBuf>,
    /// Whether the images are in it, as they are after a live run.
    #[serde(skip)]
    has_images: bool,
    /// Whether it is of a rail.
    #[serde(skip)]
    has_map: bool,
}

impl Summary {
    pub(crate) fn new(ran: &Ran, recording: Option<&Path>) -> Self {
        let nodes = ran.reports.iter().map(|report| NodeSummary {
            milliseconds: report.milliseconds,
            counts: report.counts.clone(),
            done: report.done,
            restarts: ran.restarts.get(&report.node).copied().unwrap_or_default(),
            duplicates: report
                .topics
                .values()
                .map(|account| account.duplicates)
                .sum(),
            node: report.node.clone(),
        });
        let scans = ran.ledger.done;
        Self {
            scans,
            seconds: ran.seconds,
            triples_per_second: if ran.seconds > 0.0 {
                scans as f64 / ran.seconds
            } else {
                0.0
            },
            nodes: nodes.collect(),
            synchronisation: ran.reports.iter().find_map(|r| r.synchronisation.clone()),
            balanced: ran.ledger.is_balanced(),
            ledger: ran.ledger.clone(),
            outcome: ran.outcome,
            // Of what never began nothing is to be said.
            warnings: warnings(&ran.reports).filter(|_| scans > 0).collect(),
            recording: recording.filter(|path| path.exists()).map(Path::to_owned),
            has_images: ran.ledger.nodes.contains_key("capture"),
            has_map: ran.reports.iter().any(|report| report.node == "map"),
        }
    }
}

/// What makes the results doubtful, in the order in which it comes about.
fn warnings(reports: &[NodeReport]) -> impl Iterator<Item = String> {
    let of_nodes = reports.iter().flat_map(|report| report.warnings.clone());
    of_nodes.chain(doubts(reports))
}

/// The share of all curves that is in no match when three views show one scene, at most.
const LEAST_MATCHED: f64 = 0.02;

/// What makes the results doubtful by the nodes' counts.
fn doubts(reports: &[NodeReport]) -> impl Iterator<Item = String> {
    // A node that was restarted counts what it saw itself.
    let a_scan = |node: &str, name: &str| {
        let report = reports.iter().find(|report| report.node == node)?;
        let scans = report.milliseconds.scans.max(1) as f64;
        Some(*report.counts.get(name)? as f64 / scans)
    };
    let topics = |node: &str, kind: Kind| {
        let report = reports.iter().find(|report| report.node == node);
        let topics = report.into_iter().flat_map(|report| report.topics.keys());
        let is_kind = |topic: &&String| topic.split('/').next() == Some(kind.name());
        topics.filter(is_kind).count()
    };
    let views = topics("match", Kind::Curves) / topics("match", Kind::Matches).max(1);
    let doubt = match (a_scan("track", "curves"), a_scan("match", "matches")) {
        (Some(0.0), _) => {
            Some("no curve was found: the images are blank, or track.high and track.low too great")
        }
        // A match is a curve in each view; of a rail's frame in three.
        // What the matcher knows by itself comes first.
        _ if a_scan("match", AMBIGUOUS).is_some() => Some(
            "most curves have several partners that are alike, as where a pattern repeats itself: of these nothing is \
             reported; views less than a period apart would tell",
        ),
        (Some(curves), Some(matches)) if views.max(3) as f64 * matches < LEAST_MATCHED * curves => {
            Some(
                "next to nothing matched: are the views chosen from left to right, rectified so that rows agree, and nearer \
             than match.disparity_most?",
            )
        }
        _ => None,
    };
    doubt.map(str::to_owned).into_iter()
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Why nothing began is said elsewhere, and there is nothing to tell of it.
        if self.ledger.admitted == 0 && self.outcome == Outcome::Failed {
            return Ok(());
        }
        writeln!(
            f,
            "{} in {:.2} s: {:.1} triples/s\n",
            counted(self.scans, "scan"),
            self.seconds,
            self.triples_per_second
        )?;
        writeln!(f, "{:<10} {:>9} {:>9}   a scan", "node", "p50 ms", "p99 ms")?;
        for node in &self.nodes {
            let Percentiles {
                scans, p50, p99, ..
            } = node.milliseconds;
            // Who says that scans are done counts each once. Of what others did before a restart nobody knows, and what is
            // sent again they count again.
            let counted = match (node.restarts, node.done) {
                (0, Some(done)) => done,
                _ => scans,
            };
            let each = |count: &u64| *count as f64 / counted.max(1) as f64;
            let counts = node
                .counts
                .iter()
                .filter(|(name, count)| **count > 0 && *name != "scans");
            // What is there once a scan or less is told of all scans.
            let (often, seldom): (Vec<_>, Vec<_>) = counts.partition(|(_, n)| each(n) > 1.0);
            let often = often
                .into_iter()
                .map(|(name, n)| format!("{:.0} {name}", each(n)));
            let mut notes: Vec<String> = often.collect();
            let all = match node.restarts {
                0 => "in all",
                _ => "since its last restart",
            };
            notes.extend(
                seldom
                    .into_iter()
                    .map(|(name, n)| format!("{n} {name} {all}")),
            );
            if node.restarts > 0 {
                let times = match node.restarts {
                    1 => "once".to_owned(),
                    times => format!("{times} times"),
                };
                notes.push(format!("restarted {times}, {} duplicates", node.duplicates));
            }
            match scans {
                0 => write!(f, "{:<10} {:>9} {:>9}", node.node, "-", "-")?,
                _ => write!(f, "{:<10} {p50:>9.2} {p99:>9.2}", node.node)?,
            }
            writeln!(f, "   {}", notes.join(", "))?;
        }
        if let Some(cameras) = &self.synchronisation {
            write!(f, "\n{cameras}")?;
        }
        let Ledger {
            admitted,
            done,
            refused,
            ..
        } = &self.ledger;
        let dropped: u64 = refused.values().sum();
        write!(
            f,
            "\nledger: {admitted} admitted = {done} done, {dropped} dropped at the door"
        )?;
        for (cause, count) in refused {
            write!(f, " ({count}: {cause})")?;
        }
        writeln!(
            f,
            "; {}",
            if self.balanced {
                "balanced"
            } else {
                "NOT balanced"
            }
        )?;
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        if let Some(path) = &self.recording {
            let path = path.display();
            writeln!(f, "\nrecording: {path}")?;
            writeln!(f, "  look at it:  tricurve view {path}")?;
            writeln!(f, "  what is in:  tricurve info {path}")?;
            if self.has_images {
                // The first frames of a rail have no triple, and its map is of all.
                let (scan, map) = match self.has_map {
                    true => (self.scans.saturating_sub(1), " --map map.ply"),
                    false => (0, ""),
                };
                writeln!(
                    f,
                    "  take it out: tricurve export {path} --scan {scan} --ply points.ply --png pictures{map}"
                )?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(node: &str, scans: u64, name: &str, a_scan: u64) -> NodeReport {
        NodeReport {
            node: node.to_owned(),
            milliseconds: Percentiles {
                scans,
                ..Percentiles::default()
            },
            counts: BTreeMap::from([(name.to_owned(), scans * a_scan)]),
            ..NodeReport::default()
        }
    }

    #[test]
    fn a_matcher_that_was_restarted_late_is_not_taken_for_one_that_matches_nothing() {
        let track = report("track", 2000, "curves", 300);
        let doubts_with = |matches| {
            let reports = [track.clone(), report("match", 18, "matches", matches)];
            doubts(&reports).collect::<Vec<_>>()
        };
        assert_eq!(doubts_with(70), Vec::<String>::new());
        assert!(doubts_with(1)[0].starts_with("next to nothing matched"));
    }

    #[test]
    fn patterns_that_repeat_are_told_from_views_that_do_not_fit() {
        let track = report("track", 10, "curves", 300);
        let matcher = report("match", 10, AMBIGUOUS, 90);
        let said: Vec<String> = doubts(&[track, matcher]).collect();
        assert!(
            said.len() == 1 && said[0].contains("repeats itself"),
            "{said:?}"
        );
    }

    #[test]
    fn what_nodes_doubt_stands_before_what_their_counts_say() {
        let capture = NodeReport {
            warnings: vec!["left is nearly black".to_owned()],
            ..report("capture", 10, "scans", 1)
        };
        let said: Vec<String> = warnings(&[report("track", 10, "curves", 0), capture]).collect();
        assert_eq!(said.len(), 2, "{said:?}");
        assert_eq!(said[0], "left is nearly black");
        assert!(said[1].starts_with("no curve was found"), "{said:?}");
    }
}
