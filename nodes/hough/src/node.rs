//! The shell on the bus: `curves ─► hough ─► tables`, a view and channel at a time.

use messages::bus::{Bus, BusError, Start};
use messages::{Curves, Kind, Tables};

use crate::{Settings, Tabulator};

/// Makes the R-tables of every list of curves that comes, until told to stop.
///
/// # Errors
/// When the bus fails or a list of curves is damaged.
pub fn run(bus: &mut Bus, settings: Settings, _start: &Start) -> Result<(), BusError> {
    let mut curves = bus.inputs(&[Kind::Curves])?;
    let tables = bus.outputs(&[Kind::Tables])?;
    let size = bus.run().rig.size;
    let mut tabulator = bus.tuned(&settings, move |settings| Tabulator::new(settings, size))?;
    let (mut made, mut skipped) = (0, 0);
    bus.ready()?;
    while let Some(curves) = bus.next(&mut curves)? {
        let header = curves.header();
        let view = curves.view::<Curves>()?;
        if !view.is_sound() {
            return Err(curves.damaged());
        }
        let tabulator = tabulator.at(&header)?;
        tables.send::<Tables>(&header, header.view, header.channel, |room| {
            skipped += tabulator.process(view, header.size(), room).skipped as u64;
            made += room.tables.len() as u64;
        })?;
    }
    bus.finish(&[("tables", made), ("skipped", skipped)]);
    Ok(())
}
