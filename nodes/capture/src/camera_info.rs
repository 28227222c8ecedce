//! Calibration from a ROS `camera_info` file, and from single settings on top of it.

use std::path::{Path, PathBuf};

use messages::{Calibration, Size};
use serde::Deserialize;

use crate::error::SourceError;
use crate::settings::Settings;

/// What is known of the camera; each part may be missing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Known {
    pub(crate) focal_px: Option<f64>,
    pub(crate) cx: Option<f64>,
    pub(crate) cy: Option<f64>,
    pub(crate) baseline_m: Option<f64>,
    /// Whether the lens distorts: images must be rectified before.
    pub(crate) is_distorted: bool,
}

impl Known {
    /// What the settings say, and where they say nothing, what is known otherwise.
    pub(crate) fn or(settings: &Settings, otherwise: Self) -> Self {
        Self {
            focal_px: settings.focal.or(otherwise.focal_px),
            cx: settings.cx.or(otherwise.cx),
            cy: settings.cy.or(otherwise.cy),
            baseline_m: settings.baseline.or(otherwise.baseline_m),
            is_distorted: otherwise.is_distorted,
        }
    }

    /// The calibration for images of this size, with the stated default for what is missing; `None` when nothing is
    /// known. It counts as calibrated when focal length and baseline are known: the principal point's default, the
    /// middle of the picture, only moves points sideways.
    pub(crate) fn calibration(self, size: Size) -> Option<Calibration> {
        let assumed = Calibration::assumed(size);
        (self != Self::default()).then(|| Calibration {
            focal_px: self.focal_px.unwrap_or(assumed.focal_px),
            cx: self.cx.unwrap_or(assumed.cx),
            cy: self.cy.unwrap_or(assumed.cy),
            baseline_m: self.baseline_m.unwrap_or(assumed.baseline_m),
            calibrated: self.focal_px.is_some() && self.baseline_m.is_some(),
        })
    }
}

/// The keys of a `camera_info` file that matter here.
#[derive(Debug, Deserialize)]
struct CameraInfo {
    image_width: Option<u32>,
    image_height: Option<u32>,
    camera_matrix: Option<Matrix>,
    distortion_coefficients: Option<Matrix>,
    projection_matrix: Option<Matrix>,
}

#[derive(Debug, Deserialize)]
struct Matrix {
    data: Vec<f64>,
}

/// Reads a ROS `camera_info` file, which must describe rectified images of these sizes.
///
/// Of a right camera the projection matrix holds −f·b at the end of its first row, b being the distance to the left
/// one.
pub(crate) fn read(path: &Path, sizes: &[Size]) -> Result<Known, SourceError> {
    let wrong = |why: String| SourceError::CameraInfo {
        path: PathBuf::from(path),
        why,
    };
    let text = std::fs::read_to_string(path).map_err(SourceError::io(path))?;
    let info: CameraInfo = serde_saphyr::from_str(&text).map_err(|error| {
        // The parser draws the place under its first line; one line will do.
        wrong(format!(
            "it is no camera_info YAML ({})",
            error.to_string().lines().next().unwrap_or_default()
        ))
    })?;
    let missing = |key: &str| {
        wrong(format!(
            "the key {key} of a ROS camera_info file is missing"
        ))
    };
    let width = info.image_width.ok_or_else(|| missing("image_width"))?;
    let height = info.image_height.ok_or_else(|| missing("image_height"))?;
    let intrinsic = info
        .camera_matrix
        .ok_or_else(|| missing("camera_matrix"))?
        .data;
    let projection = info
        .projection_matrix
        .ok_or_else(|| missing("projection_matrix"))?
        .data;
    for (key, matrix, count) in [
        ("camera_matrix", &intrinsic, 9),
        ("projection_matrix", &projection, 12),
    ] {
        if matrix.len() != count || !matrix.iter().all(|value| value.is_finite()) {
            return Err(wrong(format!(
                "{key} must hold {count} numbers, and holds {}",
                matrix.len()
            )));
        }
    }
    let calibrated = Size::new(width, height);
    if let Some(size) = sizes.iter().find(|&&size| size != calibrated) {
        return Err(wrong(format!(
            "it is for images of {calibrated} pixels, and these are {size}"
        )));
    }
    let is_distorted = info
        .distortion_coefficients
        .is_some_and(|matrix| matrix.data.iter().any(|&value| value != 0.0));
    let [fx, fy] = [projection[0], projection[5]];
    if fx <= 0.0 {
        return Err(wrong(format!(
            "its focal length must be positive, not {fx}"
        )));
    }
    if (fx - fy).abs() > 1e-3 * fx {
        return Err(wrong(format!(
            "its focal lengths differ, {fx} and {fy}, and pixels must be square"
        )));
    }
    Ok(Known {
        focal_px: Some(fx),
        cx: Some(projection[2]),
        cy: Some(projection[6]),
        // The left camera's is zero: the baseline is then unknown.
        baseline_m: (projection[3] != 0.0).then(|| (projection[3] / fx).abs()),
        is_distorted,
    })
}
