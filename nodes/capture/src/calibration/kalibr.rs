//! Kalibr's camchain: cam0, cam1, … each with `T_cn_cnm1`, which maps points of the camera before it to its own frame.

use std::fmt::Write as _;

use glam::{DMat3, DVec3};
use messages::{Calibration, Size, Sway};
use serde_json::Value;

use super::{Camera, Lens, Mount, Mounted, Why, numbers, numbers_of, rotation, size};

pub(super) fn cameras(chain: &Value) -> Result<Vec<Mounted>, Why> {
    let mut mounted = Vec::new();
    // From the first camera's frame to the one at hand.
    let (mut turn, mut shift) = (DMat3::IDENTITY, DVec3::ZERO);
    for index in 0.. {
        let name = format!("cam{index}");
        let Some(entry) = chain.get(&name) else {
            break;
        };
        if index > 0 {
            let key = "T_cn_cnm1";
            let step = numbers_of::<16>(entry, key)
                .map_err(|why| format!("{why} ({name})"))?
                .ok_or_else(|| {
                    format!("{key} of {name} is missing: where it stands is not known")
                })?;
            let rows = [
                step[0], step[1], step[2], step[4], step[5], step[6], step[8], step[9], step[10],
            ];
            let step_turn = rotation(&name, key, rows)?;
            turn = step_turn * turn;
            shift = step_turn * shift + DVec3::new(step[3], step[7], step[11]);
        }
        mounted.push(Mounted {
            camera: camera(entry, &name)?,
            mount: Mount::from_first(turn, shift),
            name,
        });
    }
    Ok(mounted)
}

/// A camchain of the views of a rig that are rectified but for what each is still off, as [`Sway`] says; remarks stand first.
pub fn of_residual(
    sway: &[Sway],
    camera: &Calibration,
    size: Size,
    names: &[String],
    remarks: &[String],
) -> String {
    let mut text = String::new();
    let mut line = |line: String| writeln!(text, "{line}").unwrap_or_default();
    for remark in remarks {
        line(format!("# {remark}"));
    }
    let middle = [size.width, size.height].map(|side| (f64::from(side) - 1.0) / 2.0);
    let centre = [camera.cx - middle[0], camera.cy - middle[1]];
    let mut before = DMat3::IDENTITY;
    for (view, sway) in sway.iter().enumerate() {
        let focal = camera.focal_px * (1.0 + sway.scale);
        // What is seen at the principal point of an aligned picture.
        let larger = 1.0 + sway.scale;
        let cx = middle[0] + sway.right_px + larger * centre[0] - sway.turn * centre[1];
        let cy = middle[1] + sway.down_px + sway.turn * centre[0] + larger * centre[1];
        let name = names.get(view).map_or("", |name| name);
        line(format!("cam{view}:  # {name}"));
        line("  camera_model: pinhole".to_owned());
        line(format!(
            "  intrinsics: [{focal:?}, {focal:?}, {cx:?}, {cy:?}]"
        ));
        line("  distortion_model: none".to_owned());
        line("  distortion_coeffs: []".to_owned());
        line(format!("  resolution: [{}, {}]", size.width, size.height));
        let turn = DMat3::from_rotation_z(sway.turn);
        if view > 0 {
            let step = turn * before.transpose();
            let shift = turn * DVec3::new(-camera.baseline_m, 0.0, 0.0);
            line("  T_cn_cnm1:".to_owned());
            for row in 0..3 {
                let [a, b, c] = step.row(row).to_array();
                line(format!("  - [{a:?}, {b:?}, {c:?}, {:?}]", shift[row]));
            }
            line("  - [0.0, 0.0, 0.0, 1.0]".to_owned());
        }
        before = turn;
    }
    text
}

fn camera(entry: &Value, name: &str) -> Result<Camera, Why> {
    match entry.get("camera_model").and_then(Value::as_str) {
        Some("pinhole") | None => {}
        Some(other) => {
            return Err(format!(
                "the camera_model of {name} is {other:?}, and only pinhole can be rectified"
            ));
        }
    }
    let key = "intrinsics";
    let [fx, fy, cx, cy] = numbers_of::<4>(entry, key)
        .map_err(|why| format!("{why} ({name})"))?
        .ok_or_else(|| format!("{key} of {name} are missing"))?;
    if fx <= 0.0 || fy <= 0.0 {
        return Err(format!(
            "the focal lengths of {name} must be positive, not {fx} and {fy}"
        ));
    }
    let key = "distortion_coeffs";
    let coefficients = entry.get(key).and_then(numbers).unwrap_or_default();
    let model = entry.get("distortion_model").and_then(Value::as_str);
    let lens = Lens::of_model(model.unwrap_or("none"), &coefficients)
        .map_err(|why| format!("{name} {why}"))?;
    let resolution = entry.get("resolution").and_then(Value::as_array);
    let resolution = match resolution.map(Vec::as_slice) {
        Some([width, height]) => size(width, height),
        _ => None,
    };
    let resolution = resolution
        .ok_or_else(|| format!("resolution of {name} must be its width and height in pixels"))?;
    Ok(Camera::new(Some(resolution), [fx, fy], [cx, cy], lens))
}
