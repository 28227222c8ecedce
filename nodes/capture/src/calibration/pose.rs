//! Where a camera stands, as a map says it. Tools write one of two things: what maps points of a common frame to the
//! camera's (OpenCV's R and T), or its reverse, the camera's place and axes in that frame (a pose).

use glam::{DMat3, DQuat, DVec3};

use super::node::Node;
use super::{Mount, Why, rotation};

/// Which of the two.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    ToCamera,
    OfCamera,
}

/// Names of a rotation and a translation that belong together.
const PAIRS: [(&str, &str, Way); 9] = [
    ("R", "T", Way::ToCamera),
    ("R", "t", Way::ToCamera),
    ("rotation", "translation", Way::ToCamera),
    ("rotation_matrix", "translation_vector", Way::ToCamera),
    ("rotation_matrix", "translation", Way::ToCamera),
    ("rvec", "tvec", Way::ToCamera),
    ("rotation_vector", "translation_vector", Way::ToCamera),
    ("orientation", "position", Way::OfCamera),
    ("rotation", "position", Way::OfCamera),
];

/// Names of matrices of 3 or 4 rows of 4.
const MATRICES: [(&str, Way); 17] = [
    ("extrinsics", Way::ToCamera),
    ("extrinsic", Way::ToCamera),
    ("extrinsic_matrix", Way::ToCamera),
    ("RT", Way::ToCamera),
    ("Rt", Way::ToCamera),
    ("w2c", Way::ToCamera),
    ("world_to_camera", Way::ToCamera),
    ("T_cw", Way::ToCamera),
    ("pose", Way::OfCamera),
    ("camera_pose_matrix", Way::OfCamera),
    ("pose_matrix", Way::OfCamera),
    ("c2w", Way::OfCamera),
    ("camera_to_world", Way::OfCamera),
    ("local_transform", Way::OfCamera),
    ("CameraExtrinsicMat", Way::OfCamera),
    ("T_BS", Way::OfCamera),
    ("T_wc", Way::OfCamera),
];

/// The mount of a camera, where its map says it.
pub(super) fn of(entry: &Node, name: &str) -> Result<Option<Mount>, Why> {
    if let Some((turn, shift, way)) = pair(entry, name)? {
        return Ok(Some(mount(way, turn, shift)));
    }
    let named = |(key, way): (&str, Way)| Some((key.to_owned(), entry.get(key)?, way));
    let found = MATRICES.into_iter().find_map(named).or_else(|| {
        let mut entries = entry.entries().iter();
        entries.find_map(|(key, node)| Some((key.clone(), node, by_frames(key)?)))
    });
    let Some((key, node, way)) = found else {
        return Ok(None);
    };
    // Its parts may have names of their own.
    if let Some((turn, shift, own)) = pair(node, name)? {
        let way = match own {
            Way::ToCamera => way,
            Way::OfCamera => own,
        };
        return Ok(Some(mount(way, turn, shift)));
    }
    let rows = node
        .numbers()
        .map_err(|why| format!("{key} of {name} {why}"))?;
    let (&[a, b, c, x, d, e, f, y, g, h, i, z], _) = rows
        .split_first_chunk::<12>()
        .filter(|_| [12, 16].contains(&rows.len()))
        .ok_or_else(|| {
            format!(
                "{key} of {name} must be of 3 or 4 rows of 4 numbers, and holds {}",
                rows.len()
            )
        })?;
    let turn = rotation(name, &key, [a, b, c, d, e, f, g, h, i])?;
    Ok(Some(mount(way, turn, DVec3::new(x, y, z))))
}

/// A rotation and a translation by two names, and which of the two things they are.
fn pair(entry: &Node, name: &str) -> Result<Option<(DMat3, DVec3, Way)>, Why> {
    let mut lonely = None;
    for (turn, shift, way) in PAIRS {
        match (entry.get(turn), entry.get(shift)) {
            (Some(turn_node), Some(shift_node)) => {
                let turn = self::turn(turn_node, name, turn)?;
                return Ok(Some((turn, vector(shift_node, name, shift)?, way)));
            }
            (Some(_), None) => lonely = lonely.or(Some((turn, shift))),
            (None, Some(_)) => lonely = lonely.or(Some((shift, turn))),
            (None, None) => {}
        }
    }
    match lonely {
        Some((there, missing)) => Err(format!(
            "{there} of {name} is there, and {missing} is missing: they belong together"
        )),
        None => Ok(None),
    }
}

fn mount(way: Way, turn: DMat3, shift: DVec3) -> Mount {
    match way {
        Way::ToCamera => Mount::from_first(turn, shift),
        Way::OfCamera => Mount::Posed {
            turn,
            centre_m: shift,
        },
    }
}

/// `T_a_b` maps points of b to a: one of them is the camera.
fn by_frames(key: &str) -> Option<Way> {
    let (to, from) = key.strip_prefix("T_")?.split_once('_')?;
    let is_camera = |frame: &str| frame.starts_with("cam") || frame == "c" || frame == "C";
    match (is_camera(to), is_camera(from)) {
        (true, false) => Some(Way::ToCamera),
        (false, true) => Some(Way::OfCamera),
        _ => None,
    }
}

/// A rotation: a matrix, a vector whose length is the angle, or a quaternion whose parts have names.
fn turn(node: &Node, name: &str, key: &str) -> Result<DMat3, Why> {
    let numbers = node
        .numbers()
        .map_err(|why| format!("{key} of {name} {why}"))?;
    match (numbers.as_slice(), node) {
        (&[x, y, z, w], Node::Map(_)) => {
            let turn = DQuat::from_xyzw(x, y, z, w);
            let is_turn = (turn.length() - 1.0).abs() < 1e-2;
            is_turn
                .then(|| DMat3::from_quat(turn.normalize()))
                .ok_or_else(|| format!("{key} of {name} is no rotation"))
        }
        (&[x, y, z], _) => Ok(DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(
            x, y, z,
        )))),
        (numbers, _) => {
            let count = numbers.len();
            let rows = numbers.try_into().map_err(|_| {
                let order = match count {
                    4 => ", whose order is not known: write the matrix",
                    _ => "",
                };
                format!(
                    "{key} of {name} must be a matrix of 9 numbers or a rotation vector of 3, and holds {count}{order}"
                )
            })?;
            rotation(name, key, rows)
        }
    }
}

fn vector(node: &Node, name: &str, key: &str) -> Result<DVec3, Why> {
    let numbers = node
        .numbers()
        .map_err(|why| format!("{key} of {name} {why}"))?;
    let count = numbers.len();
    let three: [f64; 3] = numbers
        .try_into()
        .map_err(|_| format!("{key} of {name} must hold 3 numbers, and holds {count}"))?;
    Ok(DVec3::from_array(three))
}
