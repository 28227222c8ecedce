//! What a run came to, as a table or as JSON.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use messages::bus::Percentiles;
use messages::ledger::Ledger;
use serde::Serialize;

use crate::supervisor::Ran;

/// One node's line.
#[derive(Debug, Serialize)]
struct NodeSummary {
    node: String,
    milliseconds: Percentiles,
    counts: BTreeMap<String, u64>,
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
    ledger: Ledger,
    balanced: bool,
    recording: Option<PathBuf>,
}

impl Summary {
    pub(crate) fn new(ran: &Ran, recording: Option<&Path>) -> Self {
        let nodes = ran.reports.iter().map(|report| NodeSummary {
            milliseconds: report.milliseconds,
            counts: report.counts.clone(),
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
            balanced: ran.ledger.is_balanced(),
            ledger: ran.ledger.clone(),
            recording: recording.map(Path::to_owned),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} scans in {:.2} s: {:.1} triples/s\n",
            self.scans, self.seconds, self.triples_per_second
        )?;
        writeln!(f, "{:<10} {:>9} {:>9}   a scan", "node", "p50 ms", "p99 ms")?;
        for node in &self.nodes {
            let Percentiles {
                scans, p50, p99, ..
            } = node.milliseconds;
            let each = |count: &u64| *count as f64 / self.scans.max(1) as f64;
            let counts = node
                .counts
                .iter()
                .filter(|(name, count)| **count > 0 && *name != "scans");
            let mut notes: Vec<String> = counts
                .map(|(name, n)| format!("{:.0} {name}", each(n)))
                .collect();
            if node.restarts > 0 {
                notes.push(format!(
                    "restarted {} times, {} duplicates",
                    node.restarts, node.duplicates
                ));
            }
            match scans {
                0 => write!(f, "{:<10} {:>9} {:>9}", node.node, "-", "-")?,
                _ => write!(f, "{:<10} {p50:>9.2} {p99:>9.2}", node.node)?,
            }
            writeln!(f, "   {}", notes.join(", "))?;
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
        if let Some(path) = &self.recording {
            let path = path.display();
            writeln!(f, "\nrecording: {path}")?;
            writeln!(
                f,
                "  look at it:  open it in Foxglove or Lichtblick, or: rerun {path}"
            )?;
            writeln!(f, "  what is in:  tricurve info {path}")?;
            writeln!(
                f,
                "  take it out: tricurve export {path} --csv points.csv --ply points.ply --png pictures"
            )?;
        }
        Ok(())
    }
}
