//! OpenCV's FileStorage YAML, as its calibration samples and most scripts write it.
//!
//! Cameras are numbered from 1: `K1` (or `M1`, `cameraMatrix1`, `camera_matrix_1`), `D1` (or `distCoeffs1`,
//! `distortion_coefficients_1`), and where they stand by `R12` and `T12`, `R13` and `T13` (or from neighbour to neighbour,
//! `R23` and `T23`; `R` and `T` are those of 2): x₂ = R·x₁ + T, T in metres. Without those, `R1` … and `P1` … of a
//! rectification. Several files are read as one. Or a file a camera, with `camera_matrix`, `distortion_coefficients`, and
//! but for the first `R` and `T`.

use glam::{DMat3, DVec3};
use serde_json::Value;

use messages::Size;

use super::{Camera, Lens, Mount, Mounted, Why, numbers, numbers_of, pinhole, ros, rotation, size};

const MATRICES: [&str; 5] = ["K", "M", "cameraMatrix", "camera_matrix", "camera_matrix_"];
const DISTORTIONS: [&str; 4] = [
    "D",
    "distCoeffs",
    "distortion_coefficients",
    "distortion_coefficients_",
];

pub(super) fn cameras(files: &[&Value]) -> Result<Vec<Mounted>, Why> {
    let is_single = |file: &&Value| find(file, &MATRICES, "").is_some();
    if files.iter().all(is_single) {
        return one_a_file(files);
    }
    let mut merged = serde_json::Map::new();
    for entries in files.iter().filter_map(|file| file.as_object()) {
        merged.extend(entries.clone());
    }
    numbered(&Value::Object(merged))
}

fn one_a_file(files: &[&Value]) -> Result<Vec<Mounted>, Why> {
    let mut mounted = Vec::new();
    for (index, file) in files.iter().enumerate() {
        let name = format!("camera {}", index + 1);
        let mount = match (index, pose(file, &name, "R", "T")?) {
            (_, Some((turn, shift))) => Mount::from_first(turn, shift),
            (0, None) => Mount::from_first(DMat3::IDENTITY, DVec3::ZERO),
            _ => {
                return Err(format!(
                    "where {name} stands is not known: R and T are missing"
                ));
            }
        };
        mounted.push(Mounted {
            camera: camera(file, &name, "")?,
            mount,
            name,
        });
    }
    Ok(mounted)
}

fn numbered(file: &Value) -> Result<Vec<Mounted>, Why> {
    let mut mounted = Vec::new();
    let mut before = (DMat3::IDENTITY, DVec3::ZERO);
    for number in 1.. {
        let suffix = number.to_string();
        if find(file, &MATRICES, &suffix).is_none() {
            break;
        }
        let name = format!("camera {number}");
        let placed = match number {
            1 => Some(before),
            _ => placed(file, &name, number, before)?,
        };
        let mount = match placed {
            // The first camera's place says nothing where those of the others are not known.
            Some((turn, shift)) if number > 1 || !is_rectified(file) => {
                before = (turn, shift);
                Mount::from_first(turn, shift)
            }
            _ => rectified(file, &name, number)?,
        };
        mounted.push(Mounted {
            camera: camera(file, &name, &suffix)?,
            mount,
            name,
        });
    }
    if mounted.is_empty() {
        return Err("it holds no camera matrix; known names are K1, M1, cameraMatrix1, camera_matrix_1, and camera_matrix of a file a camera".to_owned());
    }
    Ok(mounted)
}

/// Whether only a rectification says where the cameras stand.
fn is_rectified(file: &Value) -> bool {
    file.get("P1").is_some() && ["T", "T12"].iter().all(|key| file.get(key).is_none())
}

/// What maps points of the first camera's frame to that of camera `number`.
fn placed(
    file: &Value,
    name: &str,
    number: usize,
    (turn, shift): (DMat3, DVec3),
) -> Result<Option<(DMat3, DVec3)>, Why> {
    if is_rectified(file) {
        return Ok(None);
    }
    let from = |other: usize| {
        pose(
            file,
            name,
            &format!("R{other}{number}"),
            &format!("T{other}{number}"),
        )
    };
    if let Some(pose) = from(1)? {
        return Ok(Some(pose));
    }
    if number == 2 {
        return pose(file, name, "R", "T");
    }
    let step = from(number - 1)?;
    Ok(step.map(|(by, along)| (by * turn, by * shift + along)))
}

fn pose(file: &Value, name: &str, turn: &str, shift: &str) -> Result<Option<(DMat3, DVec3)>, Why> {
    let rows = numbers_of::<9>(file, turn)?;
    let along = numbers_of::<3>(file, shift)?;
    match (rows, along) {
        (Some(rows), Some(along)) => Ok(Some((
            rotation(name, turn, rows)?,
            DVec3::from_array(along),
        ))),
        (None, None) => Ok(None),
        _ => Err(format!(
            "{turn} and {shift} belong together, and one is missing"
        )),
    }
}

fn rectified(file: &Value, name: &str, number: usize) -> Result<Mount, Why> {
    let missing = || {
        format!(
            "where {name} stands is not known: R1{number} and T1{number} are missing, and so are R{number} and P{number}"
        )
    };
    let key = format!("R{number}");
    let rows = numbers_of::<9>(file, &key)?.ok_or_else(missing)?;
    let turn = rotation(name, &key, rows)?;
    let key = format!("P{number}");
    let projection = numbers_of::<12>(file, &key)?.ok_or_else(missing)?;
    ros::rectified(name, &key, turn, projection)
}

fn camera(file: &Value, name: &str, suffix: &str) -> Result<Camera, Why> {
    let key = find(file, &MATRICES, suffix)
        .ok_or_else(|| format!("the camera matrix of {name} is missing"))?;
    let rows = numbers_of::<9>(file, &key)?
        .ok_or_else(|| format!("the camera matrix of {name} is missing"))?;
    let (focal, centre) = pinhole(name, &key, rows)?;
    let key = find(file, &DISTORTIONS, suffix).ok_or_else(|| {
        format!(
            "the distortion coefficients of {name} are missing; write zeros where there are none"
        )
    })?;
    let coefficients = file.get(&key).and_then(numbers);
    let coefficients = coefficients.ok_or_else(|| format!("{key} must hold numbers"))?;
    let is_fisheye = file.get("fisheye_model").and_then(Value::as_u64) == Some(1);
    let model = match file.get("distortion_model").and_then(Value::as_str) {
        Some(model) => model,
        None if is_fisheye => "fisheye",
        None if coefficients.len() >= 8 && coefficients[5..8].iter().any(|&k| k != 0.0) => {
            "rational_polynomial"
        }
        None => "plumb_bob",
    };
    let lens = Lens::of_model(model, &coefficients).map_err(|why| format!("{name} {why}"))?;
    Ok(Camera::new(image_size(file), focal, centre, lens))
}

/// The size of the images, where the file says it.
fn image_size(file: &Value) -> Option<Size> {
    let pairs = [
        ("image_width", "image_height"),
        ("image_Width", "image_Height"),
        ("imageWidth", "imageHeight"),
    ];
    let sides = pairs
        .iter()
        .find_map(|(width, height)| size(file.get(width)?, file.get(height)?));
    sides.or_else(|| {
        let list = ["image_size", "imageSize", "size"];
        let list = list.iter().find_map(|key| file.get(key)?.as_array())?;
        match list.as_slice() {
            [width, height] => size(width, height),
            _ => None,
        }
    })
}

/// The first of these names, each with the suffix, that the file has.
fn find(file: &Value, names: &[&str], suffix: &str) -> Option<String> {
    let mut keys = names.iter().map(|name| format!("{name}{suffix}"));
    keys.find(|key| file.get(key).is_some())
}
