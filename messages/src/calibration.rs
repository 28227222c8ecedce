//! The camera: focal length, principal point, baseline.

use serde::{Deserialize, Serialize};

use crate::header::Size;

/// A pinhole camera and the step between neighbouring positions; all views share it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Focal length in pixels.
    pub focal_px: f64,
    /// Column of the principal point in pixels.
    pub cx: f64,
    /// Row of the principal point in pixels.
    pub cy: f64,
    /// Distance between neighbouring camera positions in metres.
    pub baseline_m: f64,
    /// Whether it is known; false for the stated default, whose depths are in arbitrary units.
    #[serde(default = "yes")]
    pub calibrated: bool,
}

fn yes() -> bool {
    true
}

impl Calibration {
    /// What is assumed of an unknown camera: a focal length of one image width (a horizontal field of view of 53°),
    /// the principal point in the middle, steps of 0.1 m. Depths are then right up to one factor.
    pub fn assumed(size: Size) -> Self {
        Self {
            focal_px: f64::from(size.width),
            cx: (f64::from(size.width) - 1.0) / 2.0,
            cy: (f64::from(size.height) - 1.0) / 2.0,
            baseline_m: 0.1,
            calibrated: false,
        }
    }

    /// Depth in metres of a disparity in pixels between neighbouring views: Z = f·b / d.
    pub fn depth_m(&self, disparity: f64) -> f64 {
        self.focal_px * self.baseline_m / disparity
    }

    /// The point in the optical frame (x right, y down, z forward, metres) seen at column `u`, row `v`.
    pub fn point_m(&self, u: f64, v: f64, disparity: f64) -> [f64; 3] {
        let z = self.depth_m(disparity);
        [
            (u - self.cx) * z / self.focal_px,
            (v - self.cy) * z / self.focal_px,
            z,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_projects_back_to_where_it_was_seen() {
        let camera = Calibration {
            focal_px: 600.0,
            cx: 255.5,
            cy: 239.5,
            baseline_m: 0.05,
            calibrated: true,
        };
        let [x, y, z] = camera.point_m(100.25, 300.0, 12.0);
        assert!((z - 600.0 * 0.05 / 12.0).abs() < 1e-12);
        assert!((camera.focal_px * x / z + camera.cx - 100.25).abs() < 1e-9);
        assert!((camera.focal_px * y / z + camera.cy - 300.0).abs() < 1e-9);
        // One step to the right the same point appears one disparity to the left.
        let next = camera.focal_px * (x - camera.baseline_m) / z + camera.cx;
        assert!((next - (100.25 - 12.0)).abs() < 1e-9);
    }
}
