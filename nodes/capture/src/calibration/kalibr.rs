//! Kalibr's camchain: cam0, cam1, … each with `T_cn_cnm1`, which maps points of the camera before it to its own frame.

use std::fmt::Write as _;

use glam::{DMat3, DVec3};
use messages::{Calibration, Size, Sway};

use super::node::Node;
use super::{Camera, Mount, Mounted, Why, entry, pose, rotation};
use crate::settings::LensModel;

/// Whether it is such a file.
pub(super) fn is(file: &Node) -> bool {
    file.get("cam0").is_some_and(|cam| cam.has("intrinsics"))
}

/// In the map of the first camera: its focal length and the steps are assumed. Kalibr's own readers pass it over.
const ASSUMED: (&str, &str) = ("units", "arbitrary");

/// Whether a file says that its focal length and baseline are assumed.
pub(super) fn is_assumed(file: &Node) -> bool {
    let said = file.get("cam0").and_then(|cam| cam.get(ASSUMED.0));
    said.and_then(Node::text) == Some(ASSUMED.1)
}

pub(super) fn cameras(chain: &Node, lens: Option<LensModel>) -> Result<Vec<Mounted>, Why> {
    // Without the steps from camera to camera, where all stand in the frame of an inertial unit or a body says the same.
    let mut each = (0..).map_while(|index| chain.get(&format!("cam{index}")));
    let is_posed = |cam: &Node| !cam.has("T_cn_cnm1") && matches!(pose::of(cam, ""), Ok(Some(_)));
    let has_steps = !each.all(is_posed);
    let mut mounted = Vec::new();
    // From the first camera's frame to the one at hand.
    let (mut turn, mut shift) = (DMat3::IDENTITY, DVec3::ZERO);
    for index in 0.. {
        let name = format!("cam{index}");
        let Some(entry) = chain.get(&name) else {
            break;
        };
        let posed = match has_steps {
            true => None,
            false => pose::of(entry, &name)?,
        };
        if index > 0 && posed.is_none() {
            let key = "T_cn_cnm1";
            let step = entry
                .numbers_of::<16>(key)
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
        let (camera, lens) = camera(entry, &name, lens)?;
        mounted.push(Mounted {
            camera,
            lens,
            mount: posed.unwrap_or(Mount::from_first(turn, shift)),
            name,
        });
    }
    Ok(mounted)
}

/// A camchain of the views of a rig that are rectified but for what each is still off, as [`Sway`] says; remarks stand first.
/// Where the camera is not calibrated it says so, and depths stay in arbitrary units.
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
        if view == 0 && !camera.calibrated {
            line(format!("  {}: {}", ASSUMED.0, ASSUMED.1));
        }
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

/// A camera: its model and the lens's are said apart.
fn camera(cam: &Node, name: &str, lens: Option<LensModel>) -> Result<(Camera, String), Why> {
    let key = "distortion_coeffs";
    let (camera, said) = match cam {
        // Of a lens that does nothing nothing need be said.
        Node::Map(entries) if !cam.has(key) => {
            let mut entries = entries.clone();
            entries.push((key.to_owned(), Node::Nothing));
            entry::camera(&Node::Map(entries), name, lens)?
        }
        cam => entry::camera(cam, name, lens)?,
    };
    if camera.size.is_none() {
        return Err(format!(
            "resolution of {name} must be its width and height in pixels"
        ));
    }
    Ok((camera, said))
}
