//! Where the points of a recording lie, so that a layout can look at them.

use messages::record::{Colours, Span};
use messages::recording::{ReadError, Recording};
use messages::{Kind, Map, Owned, Points, Topic};
use serde_json::{Value, json};

/// Scans that are looked at, spread over the recording, …
const SCANS: usize = 12;
/// … and points of each.
const POINTS: usize = 5000;
/// The share of the points that may lie outside, on either side: strays are not to make all others small.
const STRAY: f64 = 0.02;
/// How many times the radius of what is looked at the eye stands away: as far as it fills the panel.
const AWAY: f64 = 2.1;

/// What to look at.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Focus {
    /// Its middle in the frame `world`, in metres: forward, to the left, up.
    middle: [f64; 3],
    /// Half its diagonal, in metres.
    radius: f64,
    /// What colours are spread over: the disparities, in pixels, …
    disparity: Span,
    /// … and the standard deviations of a map's points, in metres.
    sigma: Option<Span>,
}

impl Focus {
    /// Where most points of a recording lie, and the cameras, which stand at the origin; none of a recording without points.
    pub(crate) fn of(recording: &mut Recording) -> Result<Option<Self>, ReadError> {
        let rig = &recording.metadata().rig;
        let is_map = rig.rail.is_some();
        let kind = if is_map { Kind::Map } else { Kind::Points };
        let Some(topic) = Topic::of(rig, kind).pop() else {
            return Ok(None);
        };
        let scans = recording.scans_with(std::slice::from_ref(&topic));
        // Right, down, forward, disparity, standard deviation.
        let mut places: Vec<[f32; 5]> = Vec::new();
        for &scan in scans.iter().step_by(scans.len().div_ceil(SCANS).max(1)) {
            match is_map {
                true => {
                    let map: Owned<Map> = recording.read(scan, &topic)?;
                    let points = map.view().points;
                    take(points, &mut places, |p| {
                        [p.x, p.y, p.z, p.disparity, p.sigma]
                    });
                }
                false => {
                    let found: Owned<Points> = recording.read(scan, &topic)?;
                    let points = found.view().points;
                    take(points, &mut places, |p| [p.x, p.y, p.z, p.disparity, 0.0]);
                }
            }
        }
        Ok(Self::on(&places, is_map))
    }

    fn on(places: &[[f32; 5]], is_map: bool) -> Option<Self> {
        let spread = |of: usize| Span::of(places.iter().map(move |place| place[of]));
        let disparity = spread(3)?.rounded();
        let span = |axis: usize| {
            let mut values: Vec<f32> = places.iter().map(|place| place[axis]).collect();
            values.sort_unstable_by(f32::total_cmp);
            let last = (values.len() - 1) as f64;
            [STRAY, 1.0 - STRAY].map(|share| f64::from(values[(share * last).round() as usize]))
        };
        let with_cameras = |[least, most]: [f64; 2]| [least.min(0.0), most.max(0.0)];
        let [right, down, forward] = [0, 1, 2].map(|axis| with_cameras(span(axis)));
        let middle = |[least, most]: [f64; 2]| 0.5 * (least + most);
        let half = |[least, most]: [f64; 2]| 0.5 * (most - least);
        Some(Self {
            middle: [middle(forward), -middle(right), -middle(down)],
            radius: half(right).hypot(half(down)).hypot(half(forward)),
            disparity,
            sigma: spread(4).filter(|_| is_map).map(Span::rounded),
        })
    }

    /// The middle and the radius of what to look at.
    pub(super) fn ball(&self) -> ([f64; 3], f64) {
        (self.middle, self.radius)
    }

    /// Turns a layout's panels in space there, and spreads their colours.
    pub(super) fn apply(&self, layout: &mut Value) {
        for panel in ["3D!space", "3D!deviation"] {
            if let Some(space) = layout.pointer_mut(&format!("/configById/{panel}")) {
                self.turn(space);
            }
        }
    }

    fn turn(&self, space: &mut Value) {
        // A tenth of a millimetre is enough for the eye.
        let short = |metres: f64| (metres * 1e4).round() / 1e4;
        let middle = self.middle.map(short);
        if let Some(camera) = space.pointer_mut("/cameraState") {
            camera["distance"] = json!(short(AWAY * self.radius));
            camera["target"] = json!(middle);
            camera["targetOffset"] = json!(middle);
            camera["near"] = json!(short(0.05 * self.radius).max(1e-4));
        }
        if let Some(grid) = space.pointer_mut("/layers/grid") {
            // A grid of whole powers of ten.
            let size = 10f64.powf((4.0 * self.radius).log10().ceil());
            grid["size"] = json!(size);
        }
        let topics = space.pointer_mut("/topics").and_then(Value::as_object_mut);
        for topic in topics.into_iter().flat_map(|topics| topics.values_mut()) {
            let spread = match topic.get("colorField").and_then(Value::as_str) {
                // No picture shows deviations, and none is below zero.
                Some("sigma") => self.sigma.map(|span| span.ends().into()),
                // Viewers use all of the colours, pictures a part of them: this makes them the same.
                Some(_) => Some(Colours::whole_range(self.disparity.ends().into())),
                None => None,
            };
            if let Some([least, most]) = spread {
                topic["minValue"] = json!(least);
                topic["maxValue"] = json!(most);
            } else if topic.get("distance").is_some() {
                // A camera: as long as a tenth of the way to what it sees.
                topic["distance"] = json!(short(0.1 * self.radius));
                topic["width"] = json!(0.002 * self.radius);
            }
        }
    }
}

/// Takes as many points as are looked at, spread over all.
fn take<P>(points: &[P], places: &mut Vec<[f32; 5]>, place: impl Fn(&P) -> [f32; 5]) {
    let every = points.len().div_ceil(POINTS).max(1);
    let taken = points.iter().step_by(every).map(place);
    places.extend(taken.filter(|place| place.iter().all(|value| value.is_finite())));
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn the_middle_lies_between_the_cameras_and_most_points_and_strays_do_not_move_it() {
        let mut places: Vec<[f32; 5]> = (0..1000)
            .map(|i| {
                [
                    0.1 + 0.0002 * i as f32,
                    -0.1,
                    1.0,
                    20.0 + 0.01 * i as f32,
                    0.0,
                ]
            })
            .collect();
        places.push([500.0, -300.0, 9000.0, 64.0, 0.0]);
        let focus = Focus::on(&places, false).unwrap();
        let [forward, left, up] = focus.middle;
        assert!((forward - 0.5).abs() < 1e-6, "{focus:?}");
        assert!(
            (left + 0.148).abs() < 1e-3 && (up - 0.05).abs() < 1e-6,
            "{focus:?}"
        );
        assert!((focus.radius - 0.525).abs() < 5e-3, "{focus:?}");
        assert_eq!(focus.disparity.ends(), (20.0, 30.0));
        assert_eq!(Focus::on(&[], false), None);
    }
}
