//! The shell on the bus: `every topic that is computed anew ─► verify ─► findings`, a scan at a time.

use std::path::Path;

use messages::bus::{Bus, BusError, Start};
use messages::recording::{ReadError, Recording};

use super::{Findings, Settings, depth};
use crate::{Choice, Selection, SelectionError};

/// Why comparing failed.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It cannot be replayed so.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// The findings cannot be kept.
    #[error("cannot keep what was found: {0}")]
    Keep(std::io::Error),
}

/// Compares every scan until told to stop. What is found is kept in the run's folder, where a successor goes on with it.
///
/// # Errors
/// When the bus fails or the recording cannot be opened; a message that cannot be read is a finding.
pub fn run(bus: &mut Bus, settings: Settings, start: &Start) -> Result<(), VerifyError> {
    let mut recording = Recording::open(Path::new(&settings.file))?;
    let codec = recording.codec().clone();
    let rig = bus.run().rig.clone();
    let selection = Selection::of(
        &recording,
        Choice {
            from: settings.from,
            taken: bus.run().taken(),
            first: settings.first,
            end: settings.end,
            before: settings.before,
            // What was not recorded cannot be compared.
            whole: true,
        },
    )?;
    let mut scans = bus.joins(&bus.run().taken_by(bus.name()))?;
    let done = bus.finisher()?;
    let path = bus.run().root.join(Findings::FILE);
    let mut findings = match start.life {
        0 => Findings::default(),
        _ => kept(&path),
    };
    bus.ready()?;
    while let Some(scan) = bus.next_scan(&mut scans)? {
        let is_lead = scan.sequence < selection.lead as u64;
        if !is_lead && !findings.knows(scan.sequence) {
            let began = std::time::Instant::now();
            let (number, _) = selection.scan(scan.sequence);
            let recorded = recording.scan(number)?;
            let digests = recorded.digests()?.unwrap_or_default();
            for message in scan.messages() {
                let (topic, header) = (message.topic(), message.header());
                let depth = depth(&rig, settings.from, topic.kind);
                if !selection.follows(scan.sequence, depth) {
                    findings.leave_out(topic);
                    continue;
                }
                findings.compare(
                    &codec,
                    (&recorded, &digests),
                    topic,
                    &header,
                    message.any_view()?,
                );
            }
            recording.reuse(recorded);
            findings.done(scan.sequence);
            keep(&path, &findings)?;
            bus.spent(began.elapsed());
        }
        done.done(scan.sequence)?;
    }
    bus.finish(&[]);
    Ok(())
}

fn kept(path: &Path) -> Findings {
    let bytes = std::fs::read(path).unwrap_or_default();
    serde_json::from_slice(&bytes).unwrap_or_default()
}

/// Replaces the file as a whole, so that a death in between leaves the one before.
fn keep(path: &Path, findings: &Findings) -> Result<(), VerifyError> {
    let new = path.with_extension("new");
    let json = serde_json::to_vec(findings).map_err(std::io::Error::from);
    json.and_then(|json| std::fs::write(&new, json))
        .and_then(|()| std::fs::rename(&new, path))
        .map_err(VerifyError::Keep)
}
