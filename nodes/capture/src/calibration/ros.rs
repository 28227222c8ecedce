//! ROS's `CameraInfo`, however it came: as `camera_calibration` writes it, as `ros2 topic echo` and `rostopic echo` print
//! it, or as a message's numbers. K, D, R and P as `image_proc` uses them.

use glam::{DMat3, DVec3};
use messages::Size;

use super::node::Node;
use super::{Camera, Mount, Mounted, Why, entry, foreign, kitti, rotation};
use crate::settings::LensModel;

/// A `CameraInfo`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CameraInfo {
    /// The camera's name, or the frame it sees in.
    pub(crate) name: Option<String>,
    /// Of its pictures, where it is said.
    pub(crate) size: Option<Size>,
    /// `plumb_bob`, `rational_polynomial`, `equidistant`.
    pub(crate) distortion_model: Option<String>,
    /// Coefficients of the lens.
    pub(crate) d: Vec<f64>,
    /// Camera matrix of the pictures as they are taken, by rows.
    pub(crate) k: [f64; 9],
    /// Rotation of the rectification, by rows.
    pub(crate) r: [f64; 9],
    /// Projection of the rectified pictures, by rows; all zeros where it is not known.
    pub(crate) p: [f64; 12],
}

const IDENTITY: [f64; 9] = [1., 0., 0., 0., 1., 0., 0., 0., 1.];

/// The names of a message's matrices, in files, in ROS 2 and in ROS 1.
const P: [&str; 3] = ["projection_matrix", "p", "P"];
const K: [&str; 3] = ["camera_matrix", "k", "K"];
const R: [&str; 3] = ["rectification_matrix", "r", "R"];
const D: [&str; 3] = ["distortion_coefficients", "d", "D"];

/// Whether it is such a map.
pub(crate) fn is(file: &Node) -> bool {
    let has = |keys: &[&str]| file.first(keys).is_some();
    let is_message = file.has("header") || file.has("camera_name");
    has(&K) && (has(&P) || (is_message && !file.has("T")))
}

/// Whether it is meant to be such a map: KITTI's files have the same numbers under other names.
pub(crate) fn is_message(file: &Node) -> bool {
    kitti::infos(file).is_none()
}

/// The different ones among these documents; the last may have been cut off.
///
/// # Errors
/// What is wrong with one.
pub(crate) fn infos(documents: &[Node]) -> Result<Vec<CameraInfo>, Why> {
    if let [file] = documents
        && let Some(infos) = kitti::infos(file)
    {
        return infos;
    }
    let mut found: Vec<CameraInfo> = Vec::new();
    for (at, document) in documents.iter().enumerate() {
        let known = [&K[..], &P, &["header", "camera_name"]].concat();
        if at == 0 && document.first(&known).is_none() {
            if let Some(why) = foreign::of_keys(document) {
                return Err(why);
            }
            let keys = document.entries().iter().take(8);
            let keys: Vec<&str> = keys.map(|(key, _)| key.as_str()).collect();
            return Err(format!(
                "it is no ROS camera_info: it holds {}; what other tools find out about the cameras of images as they were taken is capture.calibration",
                keys.join(", ")
            ));
        }
        let is_last = at > 0 && at + 1 == documents.len();
        match CameraInfo::of(document) {
            Ok(info) if !found.contains(&info) => found.push(info),
            Err(why) if !is_last => return Err(why),
            Ok(_) | Err(_) => {}
        }
    }
    Ok(found)
}

impl CameraInfo {
    /// What a map says.
    fn of(file: &Node) -> Result<Self, Why> {
        let missing = |key: &str| format!("the key {key} of a ROS camera_info file is missing");
        let matrix = |keys: &[&'static str; 3]| file.first(keys).map(|(key, _)| key);
        let sides = entry::size(file);
        if sides.is_none() {
            let has = |key: &str| file.has(key);
            if has("image_width") != has("image_height") || has("width") != has("height") {
                return Err(missing(match has("image_width") || has("width") {
                    true => "image_height",
                    false => "image_width",
                }));
            }
            if has("image_width") || has("width") {
                return Err("image_width and image_height must be whole numbers".to_owned());
            }
        }
        let k = matrix(&K).ok_or_else(|| missing(K[0]))?;
        let k = file.numbers_of::<9>(k)?.ok_or_else(|| missing(k))?;
        let r = matrix(&R)
            .map(|key| file.numbers_of::<9>(key))
            .transpose()?;
        let p = matrix(&P)
            .map(|key| file.numbers_of::<12>(key))
            .transpose()?;
        let d = match file.first(&D) {
            Some((key, node)) if *node != Node::Nothing => {
                node.numbers().map_err(|why| format!("{key} {why}"))?
            }
            _ => Vec::new(),
        };
        let text = |keys: &[&str]| {
            let (_, node) = file.first(keys)?;
            node.text().map(str::to_owned)
        };
        let frame = file.get("header").and_then(|header| header.get("frame_id"));
        let name = text(&["camera_name"]).or_else(|| frame?.text().map(str::to_owned));
        let info = Self {
            name: name.filter(|name| !name.is_empty()),
            size: sides,
            // An older `camera_calibration` has another key.
            distortion_model: text(&["distortion_model", "camera_model"]),
            d,
            k,
            r: r.flatten().unwrap_or(IDENTITY),
            p: p.flatten().unwrap_or([0.0; 12]),
        };
        let number = |of: &str, key: &str| {
            let inner = file.get(of)?.get(key)?.number();
            inner.filter(|number| *number > 0.0)
        };
        let top = |key: &str| file.get(key).and_then(Node::number).filter(|n| *n > 1.0);
        let side = |key: &str| number("roi", key).unwrap_or_default();
        Ok(info.of_region(
            [side("x_offset"), side("y_offset")],
            [side("width"), side("height")],
            ["binning_x", "binning_y"].map(|key| top(key).unwrap_or(1.0)),
        ))
    }

    /// The same of pictures that show a part of what the sensor sees, `from` a column and row on and so wide and high, where
    /// that is not all, with so many pixels binned into one.
    pub(crate) fn of_region(mut self, from: [f64; 2], sides: [f64; 2], binning: [f64; 2]) -> Self {
        if let Some(size) = &mut self.size {
            let whole = [size.width, size.height].map(f64::from);
            let seen = [0, 1].map(|axis| match sides[axis] {
                0.0 => whole[axis],
                side => side,
            });
            let shown = [0, 1].map(|axis| (seen[axis] / binning[axis]).floor() as u32);
            *size = Size::new(shown[0], shown[1]);
        }
        let change = |rows: &mut [f64], columns: usize| {
            for (axis, binning) in binning.into_iter().enumerate() {
                let row = &mut rows[axis * columns..(axis + 1) * columns];
                // A picture without P has none of a part either.
                if row.iter().any(|value| *value != 0.0) {
                    row[2] -= from[axis];
                    row.iter_mut().for_each(|value| *value /= binning);
                }
            }
        };
        change(&mut self.k, 3);
        change(&mut self.p, 4);
        self
    }

    /// What it is called in sentences.
    pub(crate) fn called(&self, view: usize) -> String {
        match &self.name {
            Some(name) => format!("camera {name}"),
            None => format!("camera {view}"),
        }
    }

    /// Whether it holds nothing, as drivers publish it of cameras that nobody calibrated.
    fn is_empty(&self) -> bool {
        self.k[0] == 0.0 && self.k[4] == 0.0
    }

    /// Focal length, principal point and P[3] of the rectified pictures.
    ///
    /// # Errors
    /// A projection that is missing, of pixels that are not square, or of no focal length.
    pub(crate) fn projection(&self, name: &str) -> Result<Projection, Why> {
        if self.is_empty() && self.p[0] == 0.0 {
            return Err(uncalibrated(name));
        }
        if self.p == [0.0; 12] {
            return Err(format!(
                "the key {} of a ROS camera_info file is missing",
                P[0]
            ));
        }
        Projection::of(name, self.p)
    }

    /// The camera; of one that is alone R and P say nothing, and P need not be of square pixels.
    fn mounted(
        &self,
        view: usize,
        is_alone: bool,
        lens: Option<LensModel>,
    ) -> Result<Mounted, Why> {
        let name = self.called(view);
        if self.is_empty() {
            return Err(uncalibrated(&name));
        }
        let [fx, skew, cx, _, fy, cy, ..] = self.k;
        let [focal, centre] = super::pinhole(&name, K[0], [fx, fy], [cx, cy], skew)?;
        let model = match self.distortion_model.as_deref() {
            Some(model) if !model.is_empty() => entry::model(model),
            _ => entry::Model::Open,
        };
        let taken = entry::taken(&name, model, &self.d, lens)?;
        let mount = match is_alone {
            true => Mount::from_first(DMat3::IDENTITY, DVec3::ZERO),
            false => {
                let turn = rotation(&name, R[0], self.r)?;
                self.projection(&name)?.mount(turn)
            }
        };
        Ok(Mounted {
            camera: Camera::new(self.size, focal, centre, taken.lens),
            lens: taken.said,
            name,
            mount,
        })
    }
}

fn uncalibrated(name: &str) -> Why {
    format!("{name} was not calibrated when it was written: its camera matrix is all zeros")
}

/// What rectified pictures are projected with: f 0 cx −f·x / 0 f cy 0 / 0 0 1 0 of a camera that stands x metres to the
/// right of the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Projection {
    pub(crate) focal_px: f64,
    pub(crate) centre: [f64; 2],
    /// P[3], −f·x.
    pub(crate) shift: f64,
}

impl Projection {
    /// The projection of a matrix by rows.
    ///
    /// # Errors
    /// Pixels that are not square, no focal length, or cameras above each other.
    pub(crate) fn of(name: &str, rows: [f64; 12]) -> Result<Self, Why> {
        let [fx, _, cx, shift, _, fy, cy, below, ..] = rows;
        if fx <= 0.0 {
            return Err(format!(
                "the focal length of {name} must be positive, not {fx}"
            ));
        }
        if (fx - fy).abs() > 1e-3 * fx {
            return Err(format!(
                "the focal lengths of {name} differ, {fx} and {fy}, and pixels must be square"
            ));
        }
        if below.abs() > shift.abs() {
            return Err(format!(
                "the projection of {name} puts the cameras above each other (P[7] is {below}), and they must stand beside each other: turn the images by 90° and calibrate these"
            ));
        }
        Ok(Self {
            focal_px: fx,
            centre: [cx, cy],
            shift,
        })
    }

    /// How a camera is mounted that is rectified to it by this rotation.
    pub(crate) fn mount(self, turn: DMat3) -> Mount {
        let [cx, cy] = self.centre;
        Mount::Rectified {
            turn,
            focal_px: self.focal_px,
            cx,
            cy,
            place_m: -self.shift / self.focal_px,
        }
    }
}

/// The cameras, left to right.
pub(crate) fn cameras(infos: &[CameraInfo], lens: Option<LensModel>) -> Result<Vec<Mounted>, Why> {
    let one = |(view, info): (usize, &CameraInfo)| {
        let mounted = info.mounted(view, infos.len() == 1, lens);
        mounted.map_err(|why| match infos.len() {
            1 => why,
            _ => format!("{why} (file {view})"),
        })
    };
    infos.iter().enumerate().map(one).collect()
}
