//! Where the cameras stand and what they are: calibration, frames, log.
//!
//! Frames: `world` is the rig's place, `rig` the rig itself, both after ROS: x forward, y left, z up. Every view has
//! `<view>_optical` at its position along the baseline: x right, y down, z forward. Where the camera moves along a rail,
//! its frame moves with it, and `rail` is where it stands at position 0, with the same axes.

use super::Codec;
use super::wire::{Fields, Fill, Value};
use crate::header::{Size, Sway};
use crate::rig::Rail;

/// How much a line of the log matters; the values are those of `foxglove.Log`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// For developers.
    Debug = 1,
    /// For the user, rarely.
    Info = 2,
    /// Something works less well.
    Warning = 3,
    /// Data was lost.
    Error = 4,
}

#[cfg(feature = "bus")]
impl From<crate::bus::Level> for Level {
    fn from(level: crate::bus::Level) -> Self {
        match level {
            crate::bus::Level::Info => Self::Info,
            crate::bus::Level::Warn => Self::Warning,
            crate::bus::Level::Error => Self::Error,
        }
    }
}

/// The rig's own frame.
const RIG: &str = "rig";

/// Fields of recorded transforms that say by how much a rail's frame is off: `right_px`, `down_px`, `turn` and `scale` of
/// [`Sway`], doubles. Of a frame that is not off there are none.
pub const SWAY: [u32; 4] = [101, 102, 103, 104];

/// From the rig's axes to the optical ones: (x, y, z) right, down, forward is (−y, −z, x) of forward, left, up.
const OPTICAL_IN_RIG: [f64; 4] = [-0.5, 0.5, -0.5, 0.5];

impl Codec {
    /// Appends a view's `foxglove.CameraCalibration` for images of this size.
    ///
    /// There is no distortion (`plumb_bob` of zeros). P of a view at position p has −f·p in its fourth column, as
    /// stereo tools expect of rectified views. A camera that moves stands at `position_m`.
    pub fn calibration(
        &self,
        view: usize,
        nanos: u64,
        size: Size,
        position_m: f64,
        out: &mut Vec<u8>,
    ) {
        let camera = self.rig.calibration(size);
        let (f, cx, cy) = (camera.focal_px, camera.cx, camera.cy);
        let shift = -f * self.place_m(view, size, position_m);
        let mut fill = Fill(out);
        fill.timestamp(1, nanos);
        fill.fixed32(2, size.width);
        fill.fixed32(3, size.height);
        fill.text(4, "plumb_bob");
        fill.doubles(5, &[0.0; 5]);
        fill.doubles(6, &[f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0]);
        fill.doubles(7, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        fill.doubles(8, &[f, 0.0, cx, shift, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
        fill.text(9, &self.optical_frames[view]);
    }

    /// Where a view's camera stands, when one that moves stands at `position_m`.
    fn place_m(&self, view: usize, size: Size, position_m: f64) -> f64 {
        match self.rig.rail {
            Some(_) => position_m,
            None => self.rig.position_m(view, size),
        }
    }

    /// Appends the `foxglove.FrameTransforms` from `world` over `rig` to every view's optical frame, and to `rail` where
    /// there is one, whose camera stands at `position_m`.
    ///
    /// By how much its frame is off stands behind them, where it is: fields [`SWAY`] of the message, which readers of
    /// transforms pass over.
    pub fn transforms(
        &self,
        nanos: u64,
        size: Size,
        position_m: f64,
        sway: &Sway,
        out: &mut Vec<u8>,
    ) {
        let mut fill = Fill(out);
        let mut transform =
            |parent: &str, child: &str, translation: [f64; 3], rotation: [f64; 4]| {
                fill.message(1, |transform| {
                    transform.timestamp(1, nanos);
                    transform.text(2, parent);
                    transform.text(3, child);
                    transform.message(4, |vector| numbers(vector, &translation));
                    transform.message(5, |quaternion| numbers(quaternion, &rotation));
                });
            };
        transform("world", RIG, [0.0; 3], [0.0, 0.0, 0.0, 1.0]);
        for (view, frame) in self.optical_frames.iter().enumerate() {
            // To the right is −y of the rig.
            let translation = [0.0, -self.place_m(view, size, position_m), 0.0];
            transform(RIG, frame, translation, OPTICAL_IN_RIG);
        }
        if self.rig.rail.is_some() {
            transform(RIG, Rail::FRAME, [0.0; 3], OPTICAL_IN_RIG);
        }
        if !sway.is_none() {
            let parts = [sway.right_px, sway.down_px, sway.turn, sway.scale];
            for (field, part) in SWAY.into_iter().zip(parts) {
                fill.double(field, part);
            }
        }
    }

    /// Where the camera stood, in metres, that moves along a rail, as [`transforms`](Self::transforms) say it; `None`
    /// when they do not.
    pub fn position_in(&self, transforms: &[u8]) -> Option<f64> {
        let frame = self.optical_frames.first()?.as_bytes();
        Fields::new(transforms).find_map(|field| {
            let (1, transform) = field.ok()? else {
                return None;
            };
            let (mut child, mut right) = (&[][..], None);
            for field in Fields::new(transform.bytes().ok()?) {
                match field.ok()? {
                    (3, value) => child = value.bytes().ok()?,
                    // To the right is −y of the rig.
                    (4, vector) => right = Some(-second(vector.bytes().ok()?)),
                    _ => {}
                }
            }
            right.filter(|_| child == frame)
        })
    }

    /// By how much a rail's frame is off, as [`transforms`](Self::transforms) say it.
    pub fn sway_in(&self, transforms: &[u8]) -> Sway {
        let mut parts = [0.0; SWAY.len()];
        for (field, value) in Fields::new(transforms).flatten() {
            if let Some(part) = SWAY.iter().position(|known| *known == field) {
                parts[part] = value.double().unwrap_or_default();
            }
        }
        let [right_px, down_px, turn, scale] = parts;
        Sway {
            right_px,
            down_px,
            turn,
            scale,
        }
    }

    /// Appends a `foxglove.Log`: a line that `node` said.
    pub fn log(&self, nanos: u64, level: Level, node: &str, line: &str, out: &mut Vec<u8>) {
        let mut fill = Fill(out);
        fill.timestamp(1, nanos);
        fill.varint(2, level as u64);
        fill.text(3, line);
        fill.text(4, node);
    }
}

/// y of a `foxglove.Vector3`.
pub(super) fn second(vector: &[u8]) -> f64 {
    let is_it = |field: Result<(u32, Value<'_>), _>| match field {
        Ok((2, value)) => value.double().ok(),
        _ => None,
    };
    Fields::new(vector).find_map(is_it).unwrap_or_default()
}

fn numbers(fill: &mut Fill<'_>, values: &[f64]) {
    for (value, field) in values.iter().zip(1..) {
        fill.double(field, *value);
    }
}
