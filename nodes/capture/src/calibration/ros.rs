//! ROS `camera_info` files, one a view: K, D, R and P as `image_proc` uses them.

use glam::{DMat3, DVec3};
use serde_json::Value;

use super::{Camera, Lens, Mount, Mounted, Why, numbers, numbers_of, pinhole, rotation, size};

pub(super) fn cameras(files: &[&Value]) -> Result<Vec<Mounted>, Why> {
    let mut mounted = Vec::new();
    for (view, file) in files.iter().enumerate() {
        let name = match file.get("camera_name").and_then(Value::as_str) {
            Some(name) => format!("camera {name}"),
            None => format!("camera {view}"),
        };
        let is_alone = files.len() == 1;
        let one = camera(file, &name, is_alone).map_err(|why| format!("{why} (file {view})"))?;
        mounted.push(one);
    }
    Ok(mounted)
}

/// One camera; of one that is alone R and P say nothing, and P need not be of square pixels.
fn camera(file: &Value, name: &str, is_alone: bool) -> Result<Mounted, Why> {
    let missing = |key: &str| format!("the key {key} of a ROS camera_info file is missing");
    let side = |key: &str| file.get(key).ok_or_else(|| missing(key));
    let size = size(side("image_width")?, side("image_height")?)
        .ok_or_else(|| "image_width and image_height must be whole numbers".to_owned())?;
    let key = "camera_matrix";
    let intrinsic = numbers_of::<9>(file, key)?.ok_or_else(|| missing(key))?;
    let (focal, centre) = pinhole(name, key, intrinsic)?;
    let coefficients = file.get("distortion_coefficients").and_then(numbers);
    let coefficients = coefficients.unwrap_or_default();
    let model = file.get("distortion_model").and_then(Value::as_str);
    // A file of an undistorted camera may leave its model away.
    let model = model.unwrap_or(match coefficients.len() {
        0 => "none",
        _ => "plumb_bob",
    });
    let lens = Lens::of_model(model, &coefficients).map_err(|why| format!("{name} {why}"))?;
    let camera = Camera::new(Some(size), focal, centre, lens);
    if is_alone {
        return Ok(Mounted {
            name: name.to_owned(),
            camera,
            mount: Mount::from_first(DMat3::IDENTITY, DVec3::ZERO),
        });
    }
    let key = "rectification_matrix";
    let turn = numbers_of::<9>(file, key)?.unwrap_or([1., 0., 0., 0., 1., 0., 0., 0., 1.]);
    let turn = rotation(name, key, turn)?;
    let key = "projection_matrix";
    let projection = numbers_of::<12>(file, key)?.ok_or_else(|| missing(key))?;
    Ok(Mounted {
        name: name.to_owned(),
        camera,
        mount: rectified(name, key, turn, projection)?,
    })
}

/// The mount of a projection matrix by rows: f 0 cx −f·x / 0 f cy 0 / 0 0 1 0 of a camera that stands x metres to the right
/// of the first.
pub(super) fn rectified(
    name: &str,
    key: &str,
    turn: DMat3,
    projection: [f64; 12],
) -> Result<Mount, Why> {
    let [fx, _, cx, shift, _, fy, cy, ..] = projection;
    if fx <= 0.0 {
        return Err(format!(
            "the focal length in {key} of {name} must be positive, not {fx}"
        ));
    }
    if (fx - fy).abs() > 1e-3 * fx {
        return Err(format!(
            "the focal lengths in {key} of {name} differ, {fx} and {fy}, and pixels must be square"
        ));
    }
    Ok(Mount::Rectified {
        turn,
        focal_px: fx,
        cx,
        cy,
        place_m: -shift / fx,
    })
}
