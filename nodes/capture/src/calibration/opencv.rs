//! OpenCV's FileStorage, as its calibration samples and most scripts write it.
//!
//! Cameras are numbered from 1, or from 0: `K1` (or `M1`, `cameraMatrix1`, `camera_matrix_1`), `D1` (or `distCoeffs1`,
//! `distortion_coefficients_1`), and where they stand by `R12` and `T12`, `R13` and `T13` (or from neighbour to neighbour,
//! `R23` and `T23`; `R` and `T` are those of the second): x₂ = R·x₁ + T, T in metres. Without those, `R1` … and `P1` … of a
//! rectification. Several files are read as one.

use glam::{DMat3, DVec3};

use super::node::Node;
use super::ros::Projection;
use super::{Mount, Mounted, Why, entry, rotation};
use crate::settings::LensModel;

const MATRICES: [&str; 9] = [
    "K",
    "M",
    "cameraMatrix",
    "camera_matrix",
    "camera_matrix_",
    "intrinsic_matrix_",
    "mtx",
    "K_",
    "M_",
];
const COEFFICIENTS: [&str; 9] = [
    "D",
    "distCoeffs",
    "distortion_coefficients",
    "distortion_coefficients_",
    "dist_coeffs_",
    "dist",
    "dist_",
    "D_",
    "distCoeffs_",
];

/// The number of the first camera, where cameras are numbered.
pub(super) fn first(file: &Node) -> Option<usize> {
    [0, 1]
        .into_iter()
        .find(|number| find(file, &MATRICES, *number).is_some())
}

/// Whether a file says where cameras stand, whose matrices another holds.
pub(super) fn is_extrinsic(file: &Node) -> bool {
    let keys = ["T", "T12", "T01", "P1", "P0"];
    file.first(&keys).is_some()
}

/// The cameras of these files.
pub(super) fn cameras(files: &[&Node], lens: Option<LensModel>) -> Result<Vec<Mounted>, Why> {
    let entries = files.iter().flat_map(|file| file.entries().iter().cloned());
    let file = Node::Map(entries.collect());
    let base = first(&file).unwrap_or(1);
    let mut mounted = Vec::new();
    let mut before = (DMat3::IDENTITY, DVec3::ZERO);
    for number in base.. {
        let Some(matrix) = find(&file, &MATRICES, number) else {
            break;
        };
        let name = format!("camera {number}");
        let placed = match number == base {
            true => Some(before),
            false => placed(&file, &name, [base, number], before)?,
        };
        let is_rectified = is_rectified(&file, base);
        let mount = match placed {
            // The first camera's place says nothing where those of the others are not known.
            Some((turn, shift)) if number > base || !is_rectified => {
                before = (turn, shift);
                Mount::from_first(turn, shift)
            }
            _ => rectified(&file, &name, [base, number])?,
        };
        let own = one(&file, matrix, number);
        let (camera, lens) = entry::camera(&own, &name, lens)?;
        mounted.push(Mounted {
            name,
            camera,
            lens,
            mount,
        });
    }
    if mounted.is_empty() {
        return Err("it says where cameras stand, and holds no camera matrix; known names are K1, M1, cameraMatrix1 and camera_matrix_1: give the file that holds them too, separated by a comma".to_owned());
    }
    Ok(mounted)
}

/// What the file says of one camera, by the names of a map a camera; what is not numbered is of all.
fn one(file: &Node, matrix: &Node, number: usize) -> Node {
    let mut entries = vec![("camera_matrix".to_owned(), matrix.clone())];
    if let Some(coefficients) = find(file, &COEFFICIENTS, number) {
        entries.push(("distortion_coefficients".to_owned(), coefficients.clone()));
    }
    let is_of_all = |key: &str| {
        let names = [&entry::MATRIX[..], &entry::COEFFICIENTS].concat();
        !names.contains(&key)
    };
    let others = file.entries().iter().filter(|(key, _)| is_of_all(key));
    entries.extend(others.cloned());
    Node::Map(entries)
}

/// Whether only a rectification says where the cameras stand.
fn is_rectified(file: &Node, base: usize) -> bool {
    let both = format!("T{base}{}", base + 1);
    file.has(&format!("P{base}")) && !file.has("T") && !file.has(&both)
}

/// What maps points of the first camera's frame to that of camera `number`.
fn placed(
    file: &Node,
    name: &str,
    [base, number]: [usize; 2],
    (turn, shift): (DMat3, DVec3),
) -> Result<Option<(DMat3, DVec3)>, Why> {
    if is_rectified(file, base) {
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
    if let Some(pose) = from(base)? {
        return Ok(Some(pose));
    }
    if number == base + 1 {
        return pose(file, name, "R", "T");
    }
    let step = from(number - 1)?;
    Ok(step.map(|(by, along)| (by * turn, by * shift + along)))
}

fn pose(file: &Node, name: &str, turn: &str, shift: &str) -> Result<Option<(DMat3, DVec3)>, Why> {
    let rows = file.numbers_of::<9>(turn)?;
    let along = file.numbers_of::<3>(shift)?;
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

fn rectified(file: &Node, name: &str, [base, number]: [usize; 2]) -> Result<Mount, Why> {
    let missing = || {
        format!(
            "where {name} stands is not known: R{base}{number} and T{base}{number} are missing, and so are R{number} and P{number}"
        )
    };
    let key = format!("R{number}");
    let rows = file.numbers_of::<9>(&key)?.ok_or_else(missing)?;
    let turn = rotation(name, &key, rows)?;
    let key = format!("P{number}");
    let projection = file.numbers_of::<12>(&key)?.ok_or_else(missing)?;
    Ok(Projection::of(name, projection)?.mount(turn))
}

/// The value of the first of these names, each with the number, that the file has.
fn find<'a>(file: &'a Node, names: &[&str], number: usize) -> Option<&'a Node> {
    names
        .iter()
        .find_map(|name| file.get(&format!("{name}{number}")))
}
