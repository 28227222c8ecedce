//! Calibration from ROS `camera_info` of rectified images, and from single settings on top of it.

use std::path::{Path, PathBuf};

use messages::{Calibration, Size};

use crate::calibration::plausible::{self, Doubt, Said};
use crate::calibration::ros::{self, CameraInfo, Projection};
use crate::calibration::{self, MOST_UNEQUAL, Why, text};
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

/// What is known, and what is to be said of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Read {
    pub(crate) known: Known,
    pub(crate) notices: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// Reads ROS `camera_info` files, which must describe rectified images of these sizes: of one camera, that next to the
/// first, or of all views. `is_said` where `capture.baseline` says how far apart these are.
pub(crate) fn read(
    files: &str,
    views: usize,
    sizes: &[Size],
    is_said: bool,
) -> Result<Read, SourceError> {
    let wrong = |path: &Path, why: String| SourceError::CameraInfo {
        path: PathBuf::from(path),
        why,
    };
    let mut infos = Vec::new();
    for path in calibration::paths(files) {
        let text = text::read(&path)?;
        let found = text::documents(&text).and_then(|documents| {
            let found = ros::infos(&documents)?;
            // KITTI's projections are of images of any size.
            let needs_size = documents.iter().any(ros::is_message);
            match found.iter().any(|info| needs_size && info.size.is_none()) {
                true => Err("the key image_width of a ROS camera_info file is missing".to_owned()),
                false => Ok(found),
            }
        });
        infos.extend(found.map_err(|why| wrong(&path, why))?);
    }
    of(&infos, views, sizes, is_said).map_err(|why| wrong(Path::new(files), why))
}

/// What messages say that describe rectified images of these sizes: of one camera, that next to the first, or of all views.
///
/// Of a camera that stands to the right of the first the projection matrix holds −f·b at the end of its first row, b being
/// the distance between the two.
///
/// # Errors
/// Messages that contradict each other, are of other images, or hold what no camera has.
pub(crate) fn of(
    infos: &[CameraInfo],
    views: usize,
    sizes: &[Size],
    is_said: bool,
) -> Result<Read, Why> {
    if infos.is_empty() {
        return Err("it names no file".to_owned());
    }
    if infos.len() > 1 && infos.len() != views {
        return Err(format!(
            "it describes {} cameras, and there are {views} views: give the camera_info of the camera next to the first, or one a view, left to right; of a file of more cameras leave in it only those",
            infos.len()
        ));
    }
    let mut read = Read::default();
    let mut projections: Vec<Projection> = Vec::new();
    for (view, info) in infos.iter().enumerate() {
        let name = info.called(view);
        let calibrated = info.size.or(sizes.first().copied()).unwrap_or_default();
        let own = info.projection(&name)?;
        let differs = sizes.iter().find(|&&size| size != calibrated);
        if let Some(size) = differs.filter(|_| info.size.is_some()) {
            return Err(format!(
                "{name} is for images of {calibrated} pixels, and these are {size}"
            ));
        }
        if let Some(first) = projections.first() {
            let is_off = |a: f64, b: f64| (a - b).abs() > 0.01;
            let is_other = is_off(own.focal_px, first.focal_px)
                || (0..2).any(|axis| is_off(own.centre[axis], first.centre[axis]));
            if is_other {
                return Err(format!(
                    "the projection of {name} has f {}, c {}, {}, and that of the first {}, {}, {}: they must be of one rectification",
                    own.focal_px,
                    own.centre[0],
                    own.centre[1],
                    first.focal_px,
                    first.centre[0],
                    first.centre[1]
                ));
            }
        } else {
            let size = calibrated;
            doubt(
                plausible::focal(own.focal_px, size, "its focal length"),
                &mut read,
            )?;
            doubt(
                plausible::centre(own.centre, size, "its principal point"),
                &mut read,
            )?;
        }
        projections.push(own);
    }
    let first = projections[0];
    let shift = match *projections {
        [one] if one.shift > 0.0 => {
            read.notices.push(format!(
                "P[3] of camera_info is positive ({}), as of a camera that stands to the left of the first: its size alone is taken",
                one.shift
            ));
            -one.shift
        }
        [one] => one.shift,
        _ => step_of(&projections)?,
    };
    let step_m = -shift / first.focal_px;
    // The left camera's is zero: the baseline is then unknown.
    let baseline_m = (shift != 0.0).then_some(step_m);
    if let (Some(step_m), false) = (baseline_m, is_said) {
        let said = Said::Projection {
            shift: projections.get(1).unwrap_or(&first).shift,
            focal_px: first.focal_px,
        };
        doubt(plausible::baseline(step_m, said), &mut read)?;
    }
    let [cx, cy] = first.centre;
    read.notices.push(format!(
        "of camera_info are taken: focal length {} px, principal point {cx}, {cy}{}",
        first.focal_px,
        match baseline_m {
            Some(_) => "",
            None => "; the baseline is not, for P[3] is 0, as of a left camera",
        }
    ));
    read.known = Known {
        focal_px: Some(first.focal_px),
        cx: Some(cx),
        cy: Some(cy),
        baseline_m,
        is_distorted: infos
            .iter()
            .any(|info| info.d.iter().any(|&value| value != 0.0)),
    };
    Ok(read)
}

/// P[3] of a camera beside the first, where all stand at equal steps.
fn step_of(projections: &[Projection]) -> Result<f64, Why> {
    let shifts: Vec<f64> = projections.iter().map(|one| one.shift).collect();
    let shown = || {
        shifts
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(", ")
    };
    let mean = (shifts[shifts.len() - 1] - shifts[0]) / (shifts.len() - 1) as f64;
    let mut steps = shifts.windows(2).map(|pair| pair[1] - pair[0]);
    if mean >= 0.0 {
        return Err(format!(
            "P[3] of the views is {}, and from left to right it must fall: −f·x of a camera that stands x to the right of the first",
            shown()
        ));
    }
    if steps.any(|step| (step / mean - 1.0).abs() > MOST_UNEQUAL) {
        return Err(format!(
            "P[3] of the views is {}, so that they stand at unequal steps, and their steps must be equal",
            shown()
        ));
    }
    Ok(mean)
}

/// Refuses, or notes what is to be said.
fn doubt(doubt: Option<Doubt>, read: &mut Read) -> Result<(), Why> {
    match doubt {
        Some(Doubt::Refused(why)) => return Err(why),
        Some(Doubt::Told(why)) => read.warnings.push(why),
        None => {}
    }
    Ok(())
}
