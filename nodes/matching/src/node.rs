//! The shell on the bus: `curves, tables ─► match ─► matches, disparity, points`, a scan at a time.

use std::collections::BTreeMap;

use messages::bus::{Bus, BusError, Filled, Joined, Level, Outputs, Start};
use messages::{
    Contrast, Curves, Disparity, Header, Kind, Matches, MatchesRoom, NONE, Points, Rail, Reason,
    Rig, Tables,
};

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
    let mut uneven = Uneven::default();
    let mut frames = rig.rail.map(|rail| (rail, Frames::new(rail)));
    bus.ready()?;
    while let Some(scan) = bus.next_scan(&mut scans)? {
        // A scan that comes again is matched again: whoever lost the first results gets the same ones.
        let header = scan.header();
        let Some((rail, frames)) = &mut frames else {
            let matcher = matcher.at(&header)?;
            let found = Found::Scan(&scan);
            match_views(matcher, &rig, &header, found, &results, &mut count)?;
            uneven.tell(bus, &rig, matcher.contrast());
            done.done(scan.sequence)?;
            continue;
        };
        frames.push(scan.sequence, scan, header.done_below);
        while let Some((sequence, turn)) = frames.next(header.done_below) {
            let Some((header, found)) = of_frame(&rig, rail, frames, sequence, turn) else {
                continue;
            };
            let matcher = matcher.at(&header)?;
            match_views(matcher, &rig, &header, found, &results, &mut count)?;
            done.done(sequence)?;
        }
    }
    let mut counts = vec![
        ("matches".to_owned(), count.matches),
        ("points".to_owned(), count.points),
    ];
    // Where a pattern repeats itself it is most of them; elsewhere it is none of anybody's business.
    if 2 * count.ambiguous > count.curves {
        counts.push((AMBIGUOUS.to_owned(), count.ambiguous));
    }
    let without = count.without.iter();
    counts.extend(without.map(|(why, count)| (format!("frames without a triple: {why}"), *count)));
    let counts: Vec<(&str, u64)> = counts
        .iter()
        .map(|(what, count)| (&**what, *count))
        .collect();
    bus.finish(&counts);
    Ok(())
}

/// What the count of curves is called that have several partners which are alike, where these are most of them.
pub const AMBIGUOUS: &str = "ambiguous curves";

#[derive(Debug, Default)]
struct Count {
    matches: u64,
    points: u64,
    /// Curves of the reference view, …
    curves: u64,
    /// … and those of them that have several partners which are alike.
    ambiguous: u64,
    /// Frames on a rail that have no triple.
    without: BTreeMap<NoTriple, u64>,
    /// The first scan that is not counted yet: one that is sent again counts once.
    next: u64,
}

impl Count {
    fn add(
        &mut self,
        sequence: u64,
        rooms: &[MatchesRoom<'_>],
        points: u64,
        without: Option<NoTriple>,
    ) {
        if sequence < self.next {
            return;
        }
        self.next = sequence + 1;
        for room in rooms {
            let alike = room.rejected.iter().filter(|curve| {
                matches!(
                    Reason::of(curve.reason),
                    Some(Reason::Ambiguous | Reason::NotUnique)
                )
            });
            self.matches += room.matches.len() as u64;
            self.curves += (room.matches.len() + room.rejected.len()) as u64;
            self.ambiguous += alike.count() as u64;
        }
        self.points += points;
        if let Some(why) = without {
            *self.without.entry(why).or_default() += 1;
        }
    }
}

/// Whether it was said that a rig's views are unevenly bright.
#[derive(Debug, Default)]
struct Uneven {
    is_told: bool,
}

impl Uneven {
    /// Contrast beside that of the most contrasty view from which on nothing is said.
    const EVEN: f32 = 0.9;
    /// Contrast below which a view's weak edges are lost, or the others' bright ones.
    const POOR: f32 = 0.35;

    /// Says once how much less contrasty views are than the most contrasty one.
    fn tell(&mut self, bus: &Bus, rig: &Rig, contrast: &Contrast) {
        if self.is_told {
            return;
        }
        let of_views = contrast.of_views();
        let best = (0..of_views.len()).max_by(|&a, &b| of_views[a].total_cmp(&of_views[b]));
        let Some(best) = best.filter(|&best| of_views[best] > 0.0) else {
            return;
        };
        let share = |view: usize| of_views[view] / of_views[best];
        let name = |view: usize| &rig.views[view].name;
        let uneven = (0..of_views.len()).filter(|&view| share(view) < Self::EVEN);
        let uneven: Vec<String> = uneven
            .map(|view| format!("{} is {:.2} of {}", name(view), share(view), name(best)))
            .collect();
        if uneven.is_empty() {
            return;
        }
        self.is_told = true;
        let uneven = uneven.join(", ");
        match (0..of_views.len()).any(|view| share(view) < Self::POOR) {
            true => bus.doubt(format!(
                "{uneven} in contrast, too little to find its weak edges: expose all cameras alike"
            )),
            false => bus.log(
                Level::Info,
                format!(
                    "{uneven} in contrast; it is made good, and thresholds are each view's own"
                ),
            ),
        }
    }
}

/// What is matched.
#[derive(Clone, Copy)]
enum Found<'a> {
    /// All views of a rig's scan.
    Scan(&'a Joined),
    /// A camera's frames along a rail, the newest first.
    Frames(Triple, [&'a Joined; 3]),
    /// Nothing, and why: the results are empty.
    Nothing(NoTriple),
}

/// What a frame whose turn it is is matched with.
fn of_frame<'a>(
    rig: &Rig,
    rail: &Rail,
    frames: &'a Frames<Joined>,
    sequence: u64,
    turn: Turn,
) -> Option<(Header, Found<'a>)> {
    let frame = frames.get(sequence)?;
    let header = frame.header();
    let Turn::Match([near, far]) = turn else {
        return Some((header, Found::Nothing(NoTriple::TooEarly)));
    };
    let frames = [frame, frames.get(near)?, frames.get(far)?];
    let places_m = frames.map(|frame| frame.header().position_m);
    let baseline_m = rig.calibration(header.size()).baseline_m;
    let found = match rail::triple(rail, places_m, baseline_m) {
        Ok(triple) => {
            let sway = frames.map(|frame| frame.header().sway);
            Found::Frames(Triple { sway, ..triple }, frames)
        }
        Err(why) => Found::Nothing(why),
    };
    Some((header, found))
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
        Found::Nothing(_) => Vec::new(),
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
                matcher.process_triple(&triple, &triples, size, &calibration, out.0, out.1, out.2)
            }
            Found::Nothing(_) => disparity.disparity.grow(size.pixels()).fill(f32::NAN),
        }
        let without = match found {
            Found::Nothing(why) => Some(why),
            _ => None,
        };
        count.add(cause.sequence, &rooms, points.points.len() as u64, without);
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
