//! The shell on the bus: `edges ─► track ─► curves`, a view and channel at a time.

use messages::bus::{Bus, BusError, Start};
use messages::{Curves, Edges, Kind};

use crate::{Settings, Tracker};

/// Tracks every list of zero-crossings that comes, until told to stop.
///
/// # Errors
/// When the bus fails.
pub fn run(bus: &mut Bus, settings: Settings, _start: &Start) -> Result<(), BusError> {
    let mut edges = bus.inputs(&[Kind::Edges])?;
    let curves = bus.outputs(&[Kind::Curves])?;
    let size = bus.run().rig.size;
    let mut tracker = bus.tuned(&settings, move |settings| Tracker::new(settings, size))?;
    let (mut found, mut skipped) = (0, 0);
    bus.ready()?;
    while let Some(edges) = bus.next(&mut edges)? {
        let header = edges.header();
        let view = edges.view::<Edges>()?;
        let tracker = tracker.at(&header)?;
        curves.send::<Curves>(&header, header.view, header.channel, |room| {
            skipped += tracker.process(view, header.size(), room).skipped as u64;
            found += room.curves.len() as u64;
        })?;
    }
    bus.finish(&[("curves", found), ("skipped", skipped)]);
    Ok(())
}
