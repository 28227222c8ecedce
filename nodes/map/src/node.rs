//! The shell on the bus: `points ─► map ─► map, growing`, a frame at a time.

use messages::bus::{Bus, BusError, Filled, Start};
use messages::{Growing, Kind, Map, NONE, Points, Stage};

use crate::{Fusion, Place, Settings};

/// Takes in the points of every frame in order, until told to stop.
///
/// # Errors
/// When the bus fails or a message is damaged.
pub fn run(bus: &mut Bus, settings: Settings, _start: &Start) -> Result<(), BusError> {
    let mut frames = bus.joins(&Stage::MAP.takes())?;
    let results = bus.outputs(&[Kind::Map, Kind::Growing])?;
    let done = bus.finisher()?;
    let rig = bus.run().rig.clone();
    let triple = rig.rail.map_or(0, |rail| rail.reach());
    // What it depends on cannot be changed on the way.
    let reach = settings.reach();
    let mut fusion = bus.tuned(&settings, Fusion::new)?;
    // The frame that is to come, and the first one that all it depends on was seen before.
    let (mut next, mut whole_from) = (0, 0);
    // Points, and the frame from which on they are to be counted: one that is sent again counts once.
    let (mut count, mut counted_from) = (0, 0);
    bus.ready()?;
    while let Some(frame) = bus.next_scan(&mut frames)? {
        let header = frame.header();
        // What is sent once more begins with the first frame that is matched of those that are needed. A later one that
        // was here came twice on its way: as it was sent first, and with all the others once more.
        let first_sent = header.done_below + triple;
        if frame.sequence < next && frame.sequence > first_sent {
            done.done(frame.sequence)?;
            continue;
        }
        if frame.sequence != next {
            // Frames come again because somebody lost them: with all those before that they depend on.
            fusion.all().for_each(Fusion::reset);
            whole_from = match frame.sequence {
                0 => 0,
                first => first + reach,
            };
        }
        next = frame.sequence + 1;
        let fusion = fusion.at(&header)?;
        let place = Place {
            position_m: header.position_m,
            camera: rig.calibration(header.size()),
            drift_px: rig.rail.map_or(0.0, |rail| rail.drift_px),
            sway: header.sway,
            size: header.size(),
        };
        let points = frame.of(Kind::Points, NONE, NONE)?.view::<Points>()?;
        let mut map = results.loan::<Map>(NONE, NONE)?;
        let mut growing = results.loan::<Growing>(NONE, NONE)?;
        let filled = {
            let (mut map, mut growing) = (map.room()?, growing.room()?);
            fusion.process(points.points, header.height, &place, &mut map, &mut growing);
            if frame.sequence >= whole_from.max(counted_from) {
                count += map.points.len() as u64;
                counted_from = frame.sequence + 1;
            }
            (Filled::of::<Map>(&map), Filled::of::<Growing>(&growing))
        };
        if frame.sequence >= whole_from {
            results.publish(map, &header, filled.0)?;
            results.publish(growing, &header, filled.1)?;
            done.done(frame.sequence)?;
        }
    }
    bus.finish(&[("points", count)]);
    Ok(())
}
