//! The shell on the bus: `curves, tables ─► match ─► matches, disparity, points`, a scan at a time.

use messages::bus::{Bus, BusError, Filled, Joined, Outputs, Start};
use messages::{Curves, Disparity, Kind, Matches, NONE, Points, Rig, Tables};

use crate::{ChannelView, Matcher, Settings};

/// Matches every scan of which all views have come, until told to stop.
///
/// # Errors
/// When the bus fails or a message is damaged.
pub fn run(bus: &mut Bus, settings: Settings, _start: &Start) -> Result<(), BusError> {
    let mut scans = bus.joins(&[Kind::Curves, Kind::Tables])?;
    let results = bus.outputs(&[Kind::Matches, Kind::Disparity, Kind::Points])?;
    let done = bus.finisher()?;
    let rig = bus.run().rig.clone();
    let channels = rig.channels.clone();
    let mut matcher = bus.tuned(&settings, move |settings| Matcher::new(settings, &channels))?;
    let mut count = Count::default();
    bus.ready()?;
    while let Some(scan) = bus.next_scan(&mut scans)? {
        // A scan that comes again is matched again: whoever lost the first results gets the same ones.
        let matcher = matcher.at(&scan.header())?;
        match_scan(matcher, &rig, &scan, &results, &mut count)?;
        done.done(scan.sequence)?;
    }
    bus.finish(&[("matches", count.matches), ("points", count.points)]);
    Ok(())
}

#[derive(Debug, Default)]
struct Count {
    matches: u64,
    points: u64,
}

fn match_scan(
    matcher: &mut Matcher,
    rig: &Rig,
    scan: &Joined,
    results: &Outputs,
    count: &mut Count,
) -> Result<(), BusError> {
    let channels = 0..rig.channels.len() as u32;
    let cause = scan.header();
    let mut inputs = Vec::with_capacity(channels.len());
    for channel in channels.clone() {
        let view = |view| {
            let (curves, tables) = (
                scan.of(Kind::Curves, view, channel)?,
                scan.of(Kind::Tables, view, channel)?,
            );
            let view = ChannelView {
                curves: curves.view::<Curves>()?,
                tables: tables.view::<Tables>()?,
            };
            match view.curves.is_sound() && view.tables.is_sound(view.curves.points.len()) {
                true => Ok(view),
                false => Err(curves.damaged()),
            }
        };
        inputs.push([view(0)?, view(1)?, view(2)?]);
    }
    let mut matches = channels
        .map(|channel| results.loan::<Matches>(NONE, channel))
        .collect::<Result<Vec<_>, _>>()?;
    let mut disparity = results.loan::<Disparity>(NONE, NONE)?;
    let mut points = results.loan::<Points>(NONE, NONE)?;
    let (matches_filled, disparity_filled, points_filled) = {
        let mut rooms = matches
            .iter_mut()
            .map(|loan| loan.room())
            .collect::<Result<Vec<_>, _>>()?;
        let (mut disparity, mut points) = (disparity.room()?, points.room()?);
        let size = cause.size();
        matcher.process(
            &inputs,
            size,
            &rig.calibration(size),
            &mut rooms,
            &mut disparity,
            &mut points,
        );
        count.matches += rooms
            .iter()
            .map(|room| room.matches.len() as u64)
            .sum::<u64>();
        count.points += points.points.len() as u64;
        let filled: Vec<Filled> = rooms.iter().map(Filled::of::<Matches>).collect();
        (
            filled,
            Filled::of::<Disparity>(&disparity),
            Filled::of::<Points>(&points),
        )
    };
    for (loan, filled) in matches.into_iter().zip(matches_filled) {
        results.publish(loan, &cause, filled)?;
    }
    results.publish(disparity, &cause, disparity_filled)?;
    results.publish(points, &cause, points_filled)
}
