//! The shell on the bus: `reference view, truth, matches, points ─► evaluate ─► evaluation`, a scan at a time.

use messages::bus::{Bus, BusError, Joined, Outputs, Start};
use messages::{Evaluation, Image, Kind, Matches, NONE, Points, Stage, Truth};

use crate::{Evaluator, Known, Settings};

/// Compares every scan of which all has come, until told to stop.
///
/// # Errors
/// When the bus fails or a message is damaged.
pub fn run(bus: &mut Bus, settings: Settings, _start: &Start) -> Result<(), BusError> {
    let mut scans = bus.joins(&Stage::EVALUATE.takes())?;
    let results = bus.outputs(&[Kind::Evaluation])?;
    let done = bus.finisher()?;
    let channels = bus.run().rig.channels.len() as u32;
    let mut evaluator = bus.tuned(&settings, Evaluator::new)?;
    let mut count = Count::default();
    bus.ready()?;
    while let Some(scan) = bus.next_scan(&mut scans)? {
        evaluate(
            evaluator.at(&scan.header())?,
            settings.view,
            channels,
            &scan,
            &results,
            &mut count,
        )?;
        done.done(scan.sequence)?;
    }
    bus.finish(&[
        ("compared", count.compared),
        ("mismatches", count.mismatches),
    ]);
    Ok(())
}

#[derive(Debug, Default)]
struct Count {
    compared: u64,
    mismatches: u64,
    /// The first scan that is not counted yet: one that is sent again counts once.
    next: u64,
}

fn evaluate(
    evaluator: &mut Evaluator,
    view: u32,
    channels: u32,
    scan: &Joined,
    results: &Outputs,
    count: &mut Count,
) -> Result<(), BusError> {
    let cause = scan.header();
    let (image, truth) = (
        scan.of(Kind::Image, view, NONE)?,
        scan.of(Kind::Truth, NONE, NONE)?,
    );
    let known = Known {
        pixels: image.view::<Image>()?.pixels,
        truth: truth.view::<Truth>()?.disparity,
        size: cause.size(),
    };
    let points = scan.of(Kind::Points, NONE, NONE)?.view::<Points>()?;
    let mut matches = Vec::with_capacity(channels as usize);
    for channel in 0..channels {
        matches.push(scan.of(Kind::Matches, NONE, channel)?.view::<Matches>()?);
    }
    results.send::<Evaluation>(&cause, NONE, NONE, |room| {
        evaluator.process(known, points, &matches, room);
        if let Some(score) = room.scores.first()
            && cause.sequence >= count.next
        {
            count.next = cause.sequence + 1;
            count.compared += u64::from(score.points);
            count.mismatches += u64::from(score.mismatches);
        }
    })
}
