//! The shell on the bus: `every topic ─► rehydrate ─► full recording`, a scan at a time.

use std::path::Path;
use std::time::Instant;

use messages::bus::{Bus, Start};
use messages::ledger::Seen;
use messages::recording::Recording;

use super::{RehydrateError, Rehydrator, Settings, full_metadata, full_settings};
use crate::node::recall;
use crate::{Batch, Writer, encoder};

/// Writes every scan that is what was recorded, until told to stop.
///
/// # Errors
/// When the bus fails, the proof cannot be read, the recording cannot be written, or something is not what was recorded.
pub fn run(bus: &mut Bus, settings: Settings, start: &Start) -> Result<(), RehydrateError> {
    let mut proof = Recording::open(Path::new(&settings.file))?;
    let metadata = full_metadata(proof.metadata());
    let mut written_as = full_settings(proof.metadata());
    let left_out = written_as.without.clone();
    written_as.without.extend(&settings.without);
    let cameras = proof.channels().contains_key("synchronisation");
    let made = bus.run().kinds();
    let mut encoder = encoder(
        &metadata.rig,
        metadata.reference,
        &made,
        cameras,
        &written_as,
    );
    let mut scans = bus.joins(&bus.run().taken_by(bus.name()))?;
    let done = bus.finisher()?;
    // The whole map has the frames before those that are wanted too.
    let first = settings.scans.get(settings.lead as usize).copied();
    let first = first.unwrap_or_default();
    recall(&mut encoder, &mut proof, first)?;
    let path = Path::new(&settings.output);
    let mut writer = match start.life {
        0 => Writer::create(path, true, &metadata, &encoder, &written_as)?,
        _ => {
            let (writer, _) = Writer::resume(path, &metadata, &encoder, &written_as)?;
            if encoder.says_whole() {
                recall(&mut encoder, &mut Recording::open(path)?, u64::MAX)?;
            }
            writer
        }
    };
    let mut rehydrator = Rehydrator::new(encoder, &left_out);
    let (changes, mut noted) = (proof.changes(), 0);
    let ledger = proof.ledger();
    let mut written = Seen::default();
    written.advance(start.resume.done_below.max(settings.lead));
    let mut batch = Batch::default();
    bus.ready()?;
    while let Some(scan) = bus.next_scan(&mut scans)? {
        let number = settings.scans.get(scan.sequence as usize).copied();
        if let Some(number) = number.filter(|_| !written.contains(scan.sequence)) {
            let began = Instant::now();
            let recorded = proof.scan(number)?;
            let mut views = scan.views()?;
            rehydrator.scan(&recorded, &mut views, &mut batch)?;
            if proof.scans().next_back() == Some(number) {
                rehydrator.encoder().end(number, &mut batch);
            }
            proof.reuse(recorded);
            let held = changes.iter().filter(|change| change.from <= number);
            let held = held.count();
            if held > noted {
                noted = held;
                batch.set_changes(changes[..held].to_vec());
            }
            writer.write(&batch)?;
            written.insert(scan.sequence);
            bus.spent(began.elapsed());
        }
        done.done(scan.sequence)?;
    }
    let bytes = writer.finish(ledger.as_ref())?.bytes;
    bus.finish(&[("bytes", bytes)]);
    Ok(())
}
