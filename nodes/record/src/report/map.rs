//! The map of a camera on a rail: all its points, seen from three sides.

use maud::{Markup, html};
use messages::Point;
use messages::record::Span;

use super::Fault;
use super::legend;
use super::page::{Album, count, missing};
use super::plot::brief;
use super::space::{self, Eye};
use crate::Recording;
use crate::map::whole_map;

/// Whether the recording has a map.
pub(super) fn is_there(recording: &Recording) -> bool {
    recording.metadata().rig.rail.is_some()
}

/// The section about it; nothing where there is no rail.
pub(super) fn section(album: &mut Album, recording: &mut Recording) -> Result<Markup, Fault> {
    if !is_there(recording) {
        return Ok(html! {});
    }
    let map = match whole_map(recording) {
        Ok(map) => map.unwrap_or_default(),
        Err(error) => return Ok(framed(&missing(error))),
    };
    let points: Vec<Point> = map
        .iter()
        .map(|point| Point {
            x: point.x,
            y: point.y,
            z: point.z,
            disparity: point.disparity,
            ..Point::default()
        })
        .collect();
    // One near object does not take all colours for itself.
    let span = Span::of(points.iter().map(|point| point.disparity)).map(Span::rounded);
    let Some(span) = span else {
        return Ok(framed(&missing("There are no points in the map")));
    };
    let mut sightings: Vec<u32> = map.iter().map(|point| point.sightings).collect();
    let mut shares: Vec<f32> = map.iter().map(|point| point.sigma / point.z).collect();
    sightings.sort_unstable();
    shares.sort_by(f32::total_cmp);
    let share = brief(100.0 * f64::from(shares[map.len() / 2]));
    let rig = &recording.metadata().rig;
    let camera = rig.calibration(rig.size);
    let legend = legend::disparities(span, &camera);
    let eyes = [
        ("from the rail", "one scale for both axes", Eye::front()),
        (
            "from above on the left",
            "in perspective",
            Eye::above_left(),
        ),
        (
            "from above",
            "one scale for both axes; the rail is below and looks up",
            Eye::above(),
        ),
    ];
    let views = space::views(album, &points, span, legend::unit(&camera), &legend, &eyes)?;
    Ok(framed(&html! {
        p {
            (count(map.len() as u64)) " points, each seen in " (sightings[map.len() / 2])
            " frames (median) and its distance known to " (share)
            " % (median of the standard deviation). x to the right along the rail, y down, z forward."
        }
        (views)
    }))
}

fn framed(all: &Markup) -> Markup {
    html! { section #map { h2 { "Map" } (all) } "\n" }
}
