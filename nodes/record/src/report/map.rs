//! The map of a camera on a rail: all its points, seen from three sides.

use messages::Point;
use messages::record::Span;

use super::Fault;
use super::page::{count, missing};
use super::space::{self, Eye};
use crate::Recording;
use crate::map::whole_map;

/// Whether the recording has a map.
pub(super) fn is_there(recording: &Recording) -> bool {
    recording.metadata().rig.rail.is_some()
}

/// The section about it; nothing where there is no rail.
pub(super) fn section(out: &mut String, recording: &mut Recording) -> Result<(), Fault> {
    if !is_there(recording) {
        return Ok(());
    }
    out.push_str("<section id=\"map\"><h2>Map</h2>");
    match whole_map(recording) {
        Ok(Some(map)) if !map.is_empty() => {
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
            let mut sightings: Vec<u32> = map.iter().map(|point| point.sightings).collect();
            let mut shares: Vec<f32> = map.iter().map(|point| point.sigma / point.z).collect();
            sightings.sort_unstable();
            shares.sort_by(f32::total_cmp);
            out.push_str(&format!(
                "<p>{} points, each seen in {} frames (median) and its distance known to {:.2} % (median of the standard \
                 deviation). x to the right along the rail, y down, z forward.</p><div class=\"grid two\">",
                count(map.len() as u64),
                sightings[map.len() / 2],
                100.0 * shares[map.len() / 2],
            ));
            let unit = match recording.metadata().rig.calibration {
                Some(camera) if camera.calibrated => "m",
                _ => "units",
            };
            let eyes = [
                ("from the rail", "true to scale", Eye::front()),
                (
                    "from above on the left",
                    "in perspective",
                    Eye::above_left(),
                ),
                (
                    "from above",
                    "true to scale; the rail is below and looks up",
                    Eye::above(),
                ),
            ];
            let span = Span::of(points.iter().map(|point| point.disparity)).map(Span::rounded);
            match span {
                Some(span) => space::views(out, &points, span, unit, &eyes)?,
                None => missing(out, "There are no points in the map")?,
            }
            out.push_str("</div>");
        }
        Ok(_) => missing(out, "There are no points in the map")?,
        Err(error) => missing(out, error)?,
    }
    out.push_str("</section>\n");
    Ok(())
}
