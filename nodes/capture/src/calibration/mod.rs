//! Cameras as calibration tools write them down, and the common parallel geometry they are rectified to.
//!
//! ```text
//! YAML, JSON, XML, plain text ─► Node ─┬─ ROS camera_info, one a view ─┐
//!                                      ├─ Kalibr camchain ─────────────┤
//!                                      ├─ KITTI, DepthAI ──────────────┤
//!                                      ├─ OpenCV, numbered ────────────┼─► cameras: lens, sensor, where they stand ─► Geometry:
//!                                      └─ a map a camera ──────────────┘   one parallel camera a view
//! ```

mod depthai;
mod entry;
mod foreign;
mod geometry;
mod kalibr;
mod kitti;
mod lens;
mod maps;
mod node;
mod opencv;
pub(crate) mod plausible;
mod pose;
pub(crate) mod ros;
pub(crate) mod text;

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};
use messages::Size;
use messages::words::counted;

use crate::error::SourceError;
use crate::settings::LensModel;

pub(crate) use geometry::{Geometry, MOST_UNEQUAL};
pub use kalibr::of_residual;
pub use lens::{Camera, Lens};
use node::Node;

/// A camera and how its rectified twin looks.
#[derive(Clone, Debug)]
pub(crate) struct Mounted {
    /// What the file calls it.
    pub(crate) name: String,
    pub(crate) camera: Camera,
    /// The model that its lens was taken for, and who says it.
    pub(crate) lens: String,
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
pub(crate) type Why = String;

/// What calibration files hold.
#[derive(Debug)]
pub(crate) struct Read {
    pub(crate) mounted: Vec<Mounted>,
    /// Whether lengths are metres; of views that only are to be aligned focal length and baseline may be assumed.
    pub(crate) is_to_scale: bool,
}

/// Reads the cameras of `views` views from calibration files, separated by commas.
///
/// # Errors
/// Files that cannot be read or make no sense, a wrong number of cameras, another resolution than the images', numbers
/// that no camera has.
pub(crate) fn read(
    files: &str,
    views: usize,
    sizes: &[Size],
    lens: Option<LensModel>,
) -> Result<Read, SourceError> {
    let whole = PathBuf::from(files);
    let paths: Vec<PathBuf> = paths(files).collect();
    let mut read = Vec::new();
    for path in &paths {
        let text = text::read(path)?;
        let documents = text::documents(&text).map_err(wrong(path))?;
        let kind = documents.first().and_then(Kind::of);
        let kind = kind.ok_or_else(|| wrong(path)(nothing_known(&documents)))?;
        read.push((kind, documents));
    }
    let mounted = cameras(&read, lens).map_err(wrong(&whole))?;
    let is_message = read.iter().all(|(kind, _)| *kind == Kind::Ros);
    if is_message && mounted.len() == 1 && views > 1 {
        return Err(wrong(&whole)(format!(
            "it describes one camera ({}), and there are {views} views: of images as they were taken give a camera_info a view, left to right, separated by commas; of images that are rectified already set capture.camera_info instead",
            mounted[0].name
        )));
    }
    check(&mounted, views, sizes).map_err(wrong(&whole))?;
    let mut all = read.iter().flat_map(|(_, documents)| documents);
    Ok(Read {
        mounted,
        is_to_scale: !all.any(kalibr::is_assumed),
    })
}

/// The cameras of messages, which must be one a view and of the images as they were taken.
///
/// # Errors
/// As [`read`].
pub(crate) fn of_infos(
    infos: &[ros::CameraInfo],
    views: usize,
    sizes: &[Size],
    lens: Option<LensModel>,
) -> Result<Vec<Mounted>, Why> {
    let mounted = ros::cameras(infos, lens)?;
    check(&mounted, views, sizes)?;
    Ok(mounted)
}

/// The files of a list with commas.
pub(crate) fn paths(files: &str) -> impl Iterator<Item = PathBuf> {
    let names = files.split(',').map(str::trim).filter(|f| !f.is_empty());
    names.map(PathBuf::from)
}

fn cameras(read: &[(Kind, Vec<Node>)], lens: Option<LensModel>) -> Result<Vec<Mounted>, Why> {
    let Some((kind, _)) = read.first() else {
        return Err("it names no file".to_owned());
    };
    if read.iter().any(|(other, _)| other != kind) {
        return Err("files of different tools cannot be mixed".to_owned());
    }
    let all = read.iter().flat_map(|(_, documents)| documents);
    let all: Vec<&Node> = all.collect();
    match kind {
        // Cameras that were calibrated one by one, and posed afterwards.
        Kind::Ros if all.len() > 1 && all.iter().all(|file| is_posed(file)) => alone(&all, lens),
        Kind::Ros => {
            let mut infos = Vec::new();
            for (_, documents) in read {
                infos.extend(ros::infos(documents)?);
            }
            ros::cameras(&infos, lens)
        }
        Kind::Kalibr => match *all {
            [chain] => kalibr::cameras(chain, lens),
            _ => Err("a Kalibr camchain holds all cameras; give one file".to_owned()),
        },
        Kind::Kitti => match *all {
            [file] if kitti::is_raw(file) => ros::cameras(&kitti::before(file)?, lens),
            [_] => Err("it is KITTI's calib.txt, of images that are rectified already: set capture.camera_info to it, and not capture.calibration".to_owned()),
            _ => Err("a calib_cam_to_cam.txt holds all cameras; give one file".to_owned()),
        },
        Kind::DepthAi => match *all {
            [file] => depthai::cameras(file, lens),
            _ => Err("a calibration of DepthAI holds all cameras; give one file".to_owned()),
        },
        Kind::Numbered => opencv::cameras(&all, lens),
        Kind::Maps => {
            let entries = all.iter().filter_map(|file| maps::within(file)).flatten();
            let mounted = maps::cameras(&entries.collect::<Vec<_>>(), lens)?;
            Ok(maps::in_row(mounted))
        }
        Kind::Alone => alone(&all, lens),
    }
}

/// Whether a file says where its camera stands.
fn is_posed(file: &Node) -> bool {
    matches!(pose::of(file, ""), Ok(Some(_)))
}

/// A camera a file.
fn alone(files: &[&Node], lens: Option<LensModel>) -> Result<Vec<Mounted>, Why> {
    let entry = |(at, file): (usize, &&Node)| {
        let own = file.get("camera_name").and_then(Node::text);
        let name = own.map_or_else(|| format!("camera {}", at + 1), str::to_owned);
        (name, (*file).clone())
    };
    let entries: Vec<maps::Entry> = files.iter().enumerate().map(entry).collect();
    maps::cameras(&entries, lens)
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
            plausible::camera(name, camera, size)?;
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

/// How a file describes cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Ros,
    Kalibr,
    Kitti,
    DepthAi,
    /// OpenCV's names, with numbers.
    Numbered,
    /// A map a camera.
    Maps,
    /// One camera, not rectified.
    Alone,
}

impl Kind {
    fn of(file: &Node) -> Option<Self> {
        // The first that fits: a message is a map with a matrix too.
        match file {
            _ if kalibr::is(file) => Some(Self::Kalibr),
            _ if kitti::is_rectified(file) || kitti::is_raw(file) => Some(Self::Kitti),
            _ if depthai::is(file) => Some(Self::DepthAi),
            _ if ros::is(file) => Some(Self::Ros),
            _ if opencv::first(file).is_some() => Some(Self::Numbered),
            _ if entry::is_camera(file) => Some(Self::Alone),
            _ if maps::within(file).is_some() => Some(Self::Maps),
            _ if opencv::is_extrinsic(file) => Some(Self::Numbered),
            _ => None,
        }
    }
}

/// What is said of a file that describes no camera: what it holds, and what is read.
fn nothing_known(documents: &[Node]) -> Why {
    if let Some(why) = documents.iter().find_map(foreign::of_keys) {
        return why;
    }
    let keys = documents.iter().flat_map(Node::entries);
    let mut keys: Vec<&str> = keys.map(|(key, _)| key.as_str()).take(9).collect();
    if keys.len() > 8 {
        keys[8] = "…";
    }
    format!(
        "it describes no camera that is known here: it holds {}; read are ROS camera_info (camera_matrix or k, distortion_coefficients or d, projection_matrix or p), Kalibr's camchain (cam0 with intrinsics, cam1, …), OpenCV's numbered matrices (K1 and D1, K2 and D2, R12 and T12, …), a map or a file a camera (camera_matrix, distortion_coefficients, R and T), KITTI's calib_cam_to_cam.txt and DepthAI's JSON",
        keys.join(", ")
    )
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

/// The focal lengths and the principal point of a camera matrix.
fn pinhole(
    name: &str,
    key: &str,
    focal: [f64; 2],
    centre: [f64; 2],
    skew: f64,
) -> Result<[[f64; 2]; 2], Why> {
    let [fx, fy] = focal;
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
    Ok([focal, centre])
}
