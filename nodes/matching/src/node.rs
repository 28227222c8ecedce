//! The shell on the bus: `curves, tables ─► match ─► matches, disparity, points`, a scan at a time.

use std::collections::BTreeMap;

use messages::bus::{Bus, BusError, Filled, Joined, Outputs, Start};
use messages::{Curves, Disparity, Header, Kind, Matches, NONE, Points, Rig, Tables};

use crate::rail::{self, Frames, NoTriple, Turn};
use crate::{ChannelView, Matcher, Settings, Triple};

/// Matches every scan of which all views have come, on a rail every frame with those before it, until told to stop.
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
    let mut frames = rig.rail.map(|rail| (rail, Frames::new(rail)));
    bus.ready()?;
    while let Some(scan) = bus.next_scan(&mut scans)? {
        // A scan that comes again is matched again: whoever lost the first results gets the same ones.
        let Some((rail, frames)) = &mut frames else {
            let header = scan.header();
            let matcher = matcher.at(&header)?;
            let triple = Triple::of_rig(matcher.settings().reference);
            let views = [0, 1, 2].map(|view| (&scan, view));
            let found = Some((&triple, views));
            match_triple(matcher, &rig, &header, found, &results, &mut count)?;
            done.done(scan.sequence)?;
            continue;
        };
        let needed_from = scan.header().done_below;
        frames.push(scan.sequence, scan, needed_from);
        while let Some((sequence, turn)) = frames.next(needed_from) {
            let Some(scan) = frames.get(sequence) else {
                continue;
            };
            let header = scan.header();
            let baseline_m = rig.calibration(header.size()).baseline_m;
            let found = match turn {
                Turn::First => Err(NoTriple::TooEarly),
                Turn::Match(before) => {
                    let [Some(near), Some(far)] = before.map(|frame| frames.get(frame)) else {
                        continue;
                    };
                    let scans = [scan, near, far];
                    let places_m = scans.map(|scan| scan.header().position_m);
                    let found = rail::triple(rail, places_m, baseline_m);
                    found.map(|triple| (triple, scans.map(|scan| (scan, 0))))
                }
            };
            let matcher = matcher.at(&header)?;
            let views = match &found {
                Ok((triple, views)) => Some((triple, *views)),
                Err(why) => {
                    *count.without.entry(*why).or_default() += 1;
                    None
                }
            };
            match_triple(matcher, &rig, &header, views, &results, &mut count)?;
            done.done(sequence)?;
        }
    }
    let mut counts = vec![
        ("matches".to_owned(), count.matches),
        ("points".to_owned(), count.points),
    ];
    let without = count.without.iter();
    counts.extend(without.map(|(why, count)| (format!("frames without a triple: {why}"), *count)));
    let counts: Vec<(&str, u64)> = counts
        .iter()
        .map(|(what, count)| (&**what, *count))
        .collect();
    bus.finish(&counts);
    Ok(())
}

#[derive(Debug, Default)]
struct Count {
    matches: u64,
    points: u64,
    /// Frames on a rail that have no triple.
    without: BTreeMap<NoTriple, u64>,
}

/// Matches three views, each of a scan; without them the results are empty.
fn match_triple(
    matcher: &mut Matcher,
    rig: &Rig,
    cause: &Header,
    found: Option<(&Triple, [(&Joined, u32); 3])>,
    results: &Outputs,
    count: &mut Count,
) -> Result<(), BusError> {
    let channels = 0..rig.channels.len() as u32;
    let mut inputs = Vec::with_capacity(channels.len());
    for channel in channels.clone() {
        if let Some((_, [one, two, three])) = found {
            let view = |(scan, view)| channel_view(scan, view, channel);
            inputs.push([view(one)?, view(two)?, view(three)?]);
        }
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
        match found {
            Some((triple, _)) => matcher.process_triple(
                triple,
                &inputs,
                size,
                &rig.calibration(size),
                &mut rooms,
                &mut disparity,
                &mut points,
            ),
            None => disparity.disparity.grow(size.pixels()).fill(f32::NAN),
        }
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
        results.publish(loan, cause, filled)?;
    }
    results.publish(disparity, cause, disparity_filled)?;
    results.publish(points, cause, points_filled)
}

/// What a view of a scan says in a channel.
fn channel_view(scan: &Joined, view: u32, channel: u32) -> Result<ChannelView<'_>, BusError> {
    let curves = scan.of(Kind::Curves, view, channel)?;
    let tables = scan.of(Kind::Tables, view, channel)?;
    let view = ChannelView {
        curves: curves.view::<Curves>()?,
        tables: tables.view::<Tables>()?,
    };
    match view.curves.is_sound() && view.tables.is_sound(view.curves.points.len()) {
        true => Ok(view),
        false => Err(curves.damaged()),
    }
}
