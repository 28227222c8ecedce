//! The shell on the bus: `image ─► filter ─► edges`, a view at a time.

use messages::bus::{Bus, BusError, Start};
use messages::{Edges, Image, Kind};

use crate::{Filter, Settings};

/// Filters every view that comes, until told to stop.
///
/// # Errors
/// When the bus fails.
pub fn run(bus: &mut Bus, settings: Settings, _start: &Start) -> Result<(), BusError> {
    let mut images = bus.inputs(&[Kind::Image])?;
    let edges = bus.outputs(&[Kind::Edges])?;
    let size = bus.run().rig.size;
    let mut filter = bus.tuned(&settings, move |settings| Filter::new(settings, size))?;
    let mut found = 0;
    bus.ready()?;
    while let Some(image) = bus.next(&mut images)? {
        let header = image.header();
        let filter = filter.at(&header)?;
        filter.begin(image.view::<Image>()?, header.size());
        for channel in 0..filter.channels() {
            edges.send::<Edges>(&header, header.view, channel as u32, |room| {
                filter.edges(channel, room);
                found += room.edges.len() as u64;
            })?;
        }
    }
    bus.finish(&[("edges", found)]);
    Ok(())
}
