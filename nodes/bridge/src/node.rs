//! The shell: a running graph's own bridge to viewers. It takes nothing from the pipe: it is a guest like others.

use std::time::Duration;

use messages::Reference;
use messages::bus::{Bus, Level, Request, Run, Start};
use serde_json::Value;

use crate::Settings;
use crate::live::{Live, LiveError, Viewing};

/// Shows the graph to viewers until told to stop.
///
/// # Errors
/// When nothing can be served, or the bus fails.
pub fn run(bus: &mut Bus, settings: Settings, start: &Start) -> Result<(), LiveError> {
    let run = bus.run().clone();
    let mut viewing = Viewing::start(&Live {
        run: &run,
        reference: reference_of(&run, &start.configuration),
        settings: &settings,
        how: "--set bridge.port=8766",
    })?;
    let address = viewing.address();
    bus.log(
        Level::Info,
        format!("viewers find the graph at ws://{address}"),
    );
    if !address.ip().is_loopback() {
        let text = "everybody on the network can see all images and turn all parameters: nobody is asked for a password";
        bus.log(Level::Warn, text);
    }
    bus.ready()?;
    loop {
        viewing.wait_beside(bus);
        viewing.turn()?;
        for remark in viewing.remarks() {
            bus.log(Level::Warn, remark);
        }
        if let Some(Request::Stop(_)) = bus.request(Duration::ZERO)? {
            break;
        }
    }
    let (missed, offered) = viewing.missed();
    if missed > 0 {
        let text = format!(
            "viewers did not get {missed} of {offered} scans whole: they, or the bridge, were too slow"
        );
        bus.log(Level::Warn, text);
    }
    bus.finish(&[("offered", offered), ("missed", missed)]);
    Ok(())
}

/// Index of the view that disparities and points belong to.
pub fn reference_of(run: &Run, configuration: &Value) -> usize {
    Reference::of(configuration).index(run.rig.views.len())
}
