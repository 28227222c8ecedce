//! Where the cameras stand and what they are: calibration, frames, log.
//!
//! Frames: `world` is the rig's place, `rig` the rig itself, both after ROS: x forward, y left, z up. Every view has
//! `<view>_optical` at its position along the baseline: x right, y down, z forward. Edges, which have no depth, live
//! in `<view>_pixels`, which is joined to nothing: x right, y down, in pixels.

use super::Codec;
use super::wire::Fill;
use crate::header::Size;

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

/// From the rig's axes to the optical ones: (x, y, z) right, down, forward is (−y, −z, x) of forward, left, up.
const OPTICAL_IN_RIG: [f64; 4] = [-0.5, 0.5, -0.5, 0.5];

impl Codec {
    /// Appends a view's `foxglove.CameraCalibration` for images of this size.
    ///
    /// There is no distortion (`plumb_bob` of zeros). P of a view at position p has −f·p in its fourth column, as
    /// stereo tools expect of rectified views.
    pub fn calibration(&self, view: usize, nanos: u64, size: Size, out: &mut Vec<u8>) {
        let camera = self.rig.calibration(size);
        let (f, cx, cy) = (camera.focal_px, camera.cx, camera.cy);
        let shift = -f * self.rig.position_m(view, size);
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

    /// Appends the `foxglove.FrameTransforms` from `world` over `rig` to every view's optical frame.
    pub fn transforms(&self, nanos: u64, size: Size, out: &mut Vec<u8>) {
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
        transform("world", "rig", [0.0; 3], [0.0, 0.0, 0.0, 1.0]);
        for (view, frame) in self.optical_frames.iter().enumerate() {
            // To the right is −y of the rig.
            let translation = [0.0, -self.rig.position_m(view, size), 0.0];
            transform("rig", frame, translation, OPTICAL_IN_RIG);
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

fn numbers(fill: &mut Fill<'_>, values: &[f64]) {
    for (value, field) in values.iter().zip(1..) {
        fill.double(field, *value);
    }
}
