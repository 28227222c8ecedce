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
            match_views(
                matcher,
                &rig,
                &header,
                Found::Scan(&scan),
                &results,
                &mut count,
            )?;
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
                    found.map(|triple| (triple, scans))
                }
            };
            let matcher = matcher.at(&header)?;
            let found = match &found {
                Ok((triple, views)) => Found::Frames(triple, *views),
                Err(why) => {
                    *count.without.entry(*why).or_default() += 1;
                    Found::Nothing
                }
            };
            match_views(matcher, &rig, &header, found, &results, &mut count)?;
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

/// What is matched.
#[derive(Clone, Copy)]
enum Found<'a> {
    /// All views of a rig's scan.
    Scan(&'a Joined),
    /// A camera's frames along a rail, the newest first.
    Frames(&'a Triple, [&'a Joined; 3]),
    /// Nothing: the results are empty.
    Nothing,
}

/// Matches the views of a scan, or frames.
fn match_views(
    matcher: &mut Matcher,
    rig: &Rig,
    cause: &Header,
    found: Found<'_>,
    results: &Outputs,
    count: &mut Count,
) -> Result<(), BusError> {
    let channels = 0..rig.channels.len() as u32;
    let views = match found {
        Found::Scan(scan) => (0..rig.views.len() as u32)
            .map(|view| (scan, view))
            .collect(),
        Found::Frames(_, frames) => frames.map(|frame| (frame, 0)).to_vec(),
        Found::Nothing => Vec::new(),
    };
    let mut inputs = Vec::with_capacity(channels.len());
    for channel in channels.clone() {
        let views = views
            .iter()
            .map(|&(scan, view)| channel_view(scan, view, channel));
        inputs.push(views.collect::<Result<Vec<_>, _>>()?);
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
        let calibration = rig.calibration(size);
        let triples = inputs
            .iter()
            .filter_map(|views| <[_; 3]>::try_from(&views[..]).ok());
        let triples: Vec<[ChannelView<'_>; 3]> = triples.collect();
        let out = (&mut rooms[..], &mut disparity, &mut points);
        match found {
            Found::Scan(_) => matcher.process(&inputs, size, &calibration, out.0, out.1, out.2),
            Found::Frames(triple, _) => {
                matcher.process_triple(triple, &triples, size, &calibration, out.0, out.1, out.2)
            }
            Found::Nothing => disparity.disparity.grow(size.pixels()).fill(f32::NAN),
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
