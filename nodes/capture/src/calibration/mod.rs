//! Cameras as calibration tools write them down, and the common parallel geometry they are rectified to.
//!
//! ```text
//! ROS camera_info, one a view ─┐
//! Kalibr camchain ─────────────┼─► cameras: lens, sensor, where they stand ─► Geometry: one parallel camera a view
//! OpenCV FileStorage ──────────┘
//! ```

mod geometry;
mod kalibr;
mod lens;
mod opencv;
mod ros;

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};
use messages::Size;
use serde_json::Value;

use crate::error::SourceError;

pub(crate) use geometry::Geometry;
pub use kalibr::of_residual;
pub use lens::{Camera, Lens};

/// A camera and how its rectified twin looks.
#[derive(Clone, Debug)]
pub(crate) struct Mounted {
    /// What the file calls it.
    pub(crate) name: String,
    pub(crate) camera: Camera,
    pub(crate) mount: Mount,
}

/// How a camera is mounted.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Mount {
    /// Where it stands and looks in the first camera's frame.
    Posed {
        /// Turns a direction from the camera's frame into the first camera's.
        turn: DMat3,
        /// Its centre, in metres.
        centre_m: DVec3,
    },
    /// What the calibration tool has rectified it to.
    Rectified {
        /// Turns a direction from the camera's frame into the rectified one.
        turn: DMat3,
        /// Focal length, column and row of the principal point of the rectified image, in pixels.
        focal_px: f64,
        cx: f64,
        cy: f64,
        /// Where it stands along the rectified rows, in metres to the right of the first.
        place_m: f64,
    },
}

impl Mount {
    /// A camera that maps points of the first camera's frame to its own by `rotation` and `translation`.
    pub(crate) fn from_first(rotation: DMat3, translation: DVec3) -> Self {
        let turn = rotation.transpose();
        Self::Posed {
            turn,
            centre_m: -(turn * translation),
        }
    }
}

/// What is wrong with a calibration, as the second half of a sentence.
type Why = String;

/// Reads the cameras of `views` views from calibration files: of ROS and of OpenCV several, separated by commas.
///
/// # Errors
/// Files that cannot be read or make no sense, a wrong number of cameras, another resolution than the images'.
pub(crate) fn read(files: &str, views: usize, sizes: &[Size]) -> Result<Vec<Mounted>, SourceError> {
    let paths = files.split(',').map(str::trim).filter(|f| !f.is_empty());
    let paths: Vec<PathBuf> = paths.map(PathBuf::from).collect();
    let whole = PathBuf::from(files);
    let mut documents = Vec::new();
    for path in &paths {
        let text = std::fs::read_to_string(path).map_err(SourceError::io(path))?;
        documents.push(Document::parse(&text).map_err(wrong(path))?);
    }
    let is_all = |kind: Kind| documents.iter().all(|document| document.kind == kind);
    let values: Vec<&Value> = documents.iter().map(|document| &document.value).collect();
    let mounted = match &*values {
        [] => Err("it names no file".to_owned()),
        [chain] if is_all(Kind::Kalibr) => kalibr::cameras(chain),
        [_, ..] if is_all(Kind::OpenCv) => opencv::cameras(&values),
        [_, ..] if is_all(Kind::Ros) => ros::cameras(&values),
        [_, ..] if is_all(Kind::Kalibr) => {
            Err("a Kalibr camchain holds all cameras; give one file".to_owned())
        }
        _ => Err("files of different tools cannot be mixed".to_owned()),
    };
    let mounted = mounted.map_err(wrong(&whole))?;
    check(&mounted, views, sizes).map_err(wrong(&whole))?;
    Ok(mounted)
}

/// The cameras of `camera_info` that came otherwise than in files, under the keys such files have, left to right; of images
/// of this size.
///
/// # Errors
/// What is wrong with them, as the second half of a sentence.
pub(crate) fn of_infos(infos: &[Value], size: Size) -> Result<Vec<Mounted>, Why> {
    let mounted = ros::cameras(&infos.iter().collect::<Vec<_>>())?;
    check(&mounted, infos.len(), &[size])?;
    Ok(mounted)
}

fn wrong(path: &Path) -> impl FnOnce(Why) -> SourceError {
    let path = path.to_owned();
    move |why| SourceError::CameraInfo { path, why }
}

/// The first size and one that is another.
fn differing(sizes: &[Size]) -> Option<(Size, Size)> {
    let (first, others) = sizes.split_first()?;
    let other = others.iter().find(|size| *size != first)?;
    Some((*first, *other))
}

/// Checks that there is a camera a view, calibrated for images of these sizes.
fn check(mounted: &[Mounted], views: usize, sizes: &[Size]) -> Result<(), Why> {
    let names: Vec<&str> = mounted.iter().map(|one| one.name.as_str()).collect();
    if mounted.len() != views {
        return Err(format!(
            "it describes {} ({}), and there {}; it must describe one camera a view, left to right (capture.views, or --views, says which)",
            counted(mounted.len(), "camera"),
            names.join(", "),
            match views {
                1 => "is 1 view".to_owned(),
                _ => format!("are {views} views"),
            }
        ));
    }
    if let Some((first, other)) = differing(sizes) {
        return Err(format!(
            "one calibration is for images of one size, and there are scans of {first} and of {other} pixels: run them one by one"
        ));
    }
    for Mounted { name, camera, .. } in mounted {
        for &size in sizes {
            match camera.size {
                Some(calibrated) if calibrated != size => {
                    return Err(format!(
                        "{name} is calibrated for images of {calibrated} pixels, and these are {size}"
                    ));
                }
                _ => {}
            }
            // Where the file does not say the size, a principal point far from the middle gives another one away.
            let [cx, cy] = camera.centre;
            let is_near = |c: f64, side: u32| (0.25..0.75).contains(&(c / f64::from(side)));
            if !is_near(cx, size.width) || !is_near(cy, size.height) {
                return Err(format!(
                    "{name} has its principal point at {cx:.1}, {cy:.1}, far from the middle of images of {size} pixels: is it calibrated for another resolution?"
                ));
            }
        }
    }
    Ok(())
}

/// Which tool wrote a file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Ros,
    Kalibr,
    OpenCv,
}

/// A calibration file, parsed.
#[derive(Debug)]
struct Document {
    kind: Kind,
    value: Value,
}

impl Document {
    fn parse(text: &str) -> Result<Self, Why> {
        // OpenCV opens its files with a directive that is no YAML, and tags its matrices.
        let is_opencv = text.starts_with("%YAML:") || text.contains("!!opencv-matrix");
        let body = match text.split_once('\n') {
            Some((first, rest)) if first.starts_with("%YAML") => rest,
            _ => text,
        };
        let body = body.replace("!!opencv-matrix", "");
        let value: Value = serde_saphyr::from_str(&body).map_err(|error| {
            // The parser draws the place under its first line; one line will do.
            let why = error.to_string();
            format!("it is no YAML ({})", why.lines().next().unwrap_or_default())
        })?;
        let has = |key: &str| value.get(key).is_some();
        let kind = if is_opencv {
            Kind::OpenCv
        } else if has("cam0") {
            Kind::Kalibr
        } else if has("projection_matrix") || has("camera_matrix") {
            Kind::Ros
        } else {
            return Err(
                "it is neither a ROS camera_info nor a Kalibr camchain nor an OpenCV FileStorage file"
                    .to_owned(),
            );
        };
        Ok(Self { kind, value })
    }
}

/// The numbers of a list, of a matrix with `data`, or of a list of rows.
fn numbers(value: &Value) -> Option<Vec<f64>> {
    let list = value.get("data").unwrap_or(value).as_array()?;
    let mut numbers = Vec::with_capacity(list.len());
    for element in list {
        match element {
            Value::Array(row) => {
                for number in row {
                    numbers.push(number.as_f64()?);
                }
            }
            number => numbers.push(number.as_f64()?),
        }
    }
    numbers.iter().all(|n| n.is_finite()).then_some(numbers)
}

/// The numbers of a key, so many of them.
fn numbers_of<const N: usize>(value: &Value, key: &str) -> Result<Option<[f64; N]>, Why> {
    let Some(entry) = value.get(key) else {
        return Ok(None);
    };
    let found = numbers(entry).ok_or_else(|| format!("{key} must hold {N} numbers"))?;
    let count = found.len();
    match found.try_into() {
        Ok(numbers) => Ok(Some(numbers)),
        Err(_) => Err(format!("{key} must hold {N} numbers, and holds {count}")),
    }
}

/// The matrix whose rows these numbers are.
fn matrix(rows: [f64; 9]) -> DMat3 {
    DMat3::from_cols_array(&rows).transpose()
}

/// The rotation whose rows these numbers are, rid of rounding.
fn rotation(name: &str, key: &str, rows: [f64; 9]) -> Result<DMat3, Why> {
    let given = matrix(rows);
    let off = given * given.transpose() - DMat3::IDENTITY;
    let most = off
        .to_cols_array()
        .into_iter()
        .fold(0.0, |most: f64, v| most.max(v.abs()));
    if most > 1e-2 || given.determinant() < 0.0 {
        return Err(format!("{key} of {name} is no rotation"));
    }
    Ok(DMat3::from_quat(DQuat::from_mat3(&given).normalize()))
}

/// The focal lengths and the principal point of a camera matrix, by rows.
fn pinhole(name: &str, key: &str, rows: [f64; 9]) -> Result<([f64; 2], [f64; 2]), Why> {
    let [fx, skew, cx, _, fy, cy, ..] = rows;
    if fx <= 0.0 || fy <= 0.0 {
        return Err(format!(
            "the focal lengths of {name} must be positive, not {fx} and {fy}"
        ));
    }
    if skew.abs() > 1e-3 * fx {
        return Err(format!(
            "{key} of {name} has a skew of {skew}, and pixels must be square"
        ));
    }
    Ok(([fx, fy], [cx, cy]))
}

/// `1 camera`, `2 cameras`.
fn counted(count: usize, what: &str) -> String {
    match count {
        1 => format!("1 {what}"),
        _ => format!("{count} {what}s"),
    }
}

fn size(width: &Value, height: &Value) -> Option<Size> {
    let side = |value: &Value| u32::try_from(value.as_u64()?).ok();
    Some(Size::new(side(width)?, side(height)?))
}
