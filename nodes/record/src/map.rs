//! The map of a recording: all points that a camera on a rail settled, and those that it still followed at the end.

use messages::{Growing, Kind, Map, MapPoint, Owned, Topic};

use crate::{ReadError, Recording};

/// The points of the map, in the frame of the rail, scan by scan as they were settled; `None` when there is no map.
///
/// # Errors
/// When a scan cannot be read.
pub(crate) fn whole_map(recording: &mut Recording) -> Result<Option<Vec<MapPoint>>, ReadError> {
    let of = |recording: &Recording, kind| {
        let topic = Topic::of(&recording.metadata().rig, kind).pop();
        topic.filter(|topic| recording.holds(&topic.name))
    };
    let Some(settled) = of(recording, Kind::Map) else {
        return Ok(None);
    };
    // It may have been left out.
    let growing = of(recording, Kind::Growing);
    let mut points = Vec::new();
    let scans = recording.whole_scans();
    for &scan in &scans {
        let read: Owned<Map> = recording.read(scan, &settled)?;
        points.extend_from_slice(read.view().points);
    }
    if let (Some(&last), Some(growing)) = (scans.last(), growing) {
        match recording.read::<Growing>(last, &growing) {
            Ok(read) => points.extend_from_slice(read.view().points),
            // A proof has them of those scans only that were computed.
            Err(ReadError::NoMessage { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(Some(points))
}
