//! One camera as a map says it, by the names that tools have for the same thing: matrix, coefficients, model, size.

use messages::Size;

use super::node::Node;
use super::{Camera, Lens, Why};
use crate::settings::LensModel;

/// Names of a camera matrix, of its nine numbers, or of fx, fy, cx, cy.
pub(super) const MATRIX: [&str; 13] = [
    "camera_matrix",
    "cameraMatrix",
    "intrinsics",
    "intrinsic_matrix",
    "intrinsicMatrix",
    "intrinsic",
    "projection_parameters",
    "K",
    "k",
    "M",
    "mtx",
    "cam_matrix",
    "CameraMat",
];

/// Names of the coefficients of a lens.
pub(super) const COEFFICIENTS: [&str; 15] = [
    "distortion_coefficients",
    "distortion_coeffs",
    "distCoeffs",
    "dist_coeffs",
    "distortionCoefficients",
    "distortionCoeffs",
    "distortion_vector",
    "distortion_parameters",
    "distortion",
    "distCoeff",
    "DistCoeff",
    "dist",
    "D",
    "d",
    "coeffs",
];

/// Names of what a file says of a lens.
const MODEL: [&str; 7] = [
    "distortion_model",
    "distortionModel",
    "distortion_type",
    "lens_model",
    "camera_model",
    "cameraModel",
    "model_type",
];

/// What says of a camera that it is one, and nothing of its lens.
const PINHOLE: [&str; 3] = ["pinhole", "perspective", "projective"];

/// Pairs of names of a picture's width and height.
const SIDES: [(&str, &str); 6] = [
    ("image_width", "image_height"),
    ("image_Width", "image_Height"),
    ("imageWidth", "imageHeight"),
    ("img_width", "img_height"),
    ("width", "height"),
    ("cols", "rows"),
];

const SIZES: [&str; 7] = [
    "resolution",
    "image_size",
    "imageSize",
    "img_size",
    "image_resolution",
    "ImageSize",
    "size",
];

/// A lens and where its model comes from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Taken {
    pub(super) lens: Lens,
    /// The model, and who says it.
    pub(super) said: String,
}

/// Whether a map is a camera.
pub(super) fn is_camera(entry: &Node) -> bool {
    let matrix = entry.first(&MATRIX);
    let is_matrix = |node: &Node| pinhole_of(node).is_ok();
    matrix.is_some_and(|(_, node)| is_matrix(node)) || entry.has("fx")
}

/// The camera of a map, and what is said of its lens.
pub(super) fn camera(
    entry: &Node,
    name: &str,
    lens: Option<LensModel>,
) -> Result<(Camera, String), Why> {
    let ([focal, centre], _) = matrix(entry, name)?;
    let taken = self::lens(entry, name, lens)?;
    Ok((
        Camera::new(size(entry), focal, centre, taken.lens),
        taken.said,
    ))
}

/// Focal lengths and principal point, and the key that holds them.
fn matrix<'k>(entry: &Node, name: &str) -> Result<([[f64; 2]; 2], &'k str), Why> {
    let (key, node) = match entry.first(&MATRIX) {
        Some(found) => found,
        None if entry.has("fx") => ("fx", entry),
        None => return Err(format!("the camera matrix of {name} is missing")),
    };
    let (focal, centre, skew) = pinhole_of(node).map_err(|why| format!("{key} of {name} {why}"))?;
    let pinhole = super::pinhole(name, key, focal, centre, skew)?;
    Ok((pinhole, key))
}

/// Focal lengths, principal point and skew of a matrix, of a list fx, fy, cx, cy, or of a map of these.
fn pinhole_of(node: &Node) -> Result<([f64; 2], [f64; 2], f64), Why> {
    let named = |keys: [&str; 4]| {
        let numbers = keys.map(|key| node.get(key).and_then(Node::number));
        let [Some(fx), Some(fy), Some(cx), Some(cy)] = numbers else {
            return None;
        };
        Some(([fx, fy], [cx, cy], 0.0))
    };
    let by_name = named(["fx", "fy", "cx", "cy"]).or_else(|| named(["mu", "mv", "u0", "v0"]));
    if let Some(found) = by_name {
        return Ok(found);
    }
    match node.numbers()?.as_slice() {
        &[fx, skew, cx, _, fy, cy, _, _, _] => Ok(([fx, fy], [cx, cy], skew)),
        &[fx, fy, cx, cy] => Ok(([fx, fy], [cx, cy], 0.0)),
        other => Err(format!(
            "must hold 9 numbers, by rows, or fx, fy, cx and cy, and holds {}",
            other.len()
        )),
    }
}

/// What a map says of its lens: the coefficients, the model, and whether it says it.
fn lens(entry: &Node, name: &str, told: Option<LensModel>) -> Result<Taken, Why> {
    let (key, node) = match entry.first(&COEFFICIENTS) {
        Some(found) => found,
        // Some name them one by one, with the matrix's numbers.
        None if entry.has("k1") => ("k1", entry),
        None if entry.has("projection_parameters") => ("projection_parameters", &Node::Nothing),
        None if told == Some(LensModel::None) => ("", &Node::Nothing),
        None => {
            return Err(format!(
                "the distortion coefficients of {name} are missing; write zeros where there are none"
            ));
        }
    };
    let (coefficients, by_name) =
        coefficients(entry, node).map_err(|why| format!("{key} of {name} {why}"))?;
    let model = said(entry, name)?;
    let is_fisheye = |model: LensModel| model == LensModel::Equidistant;
    let of_file = match &model {
        Model::Said(model, _) => Some(*model),
        _ => None,
    };
    // Their order is not that of the other model.
    if let (Some(by_name), Some(meant)) = (by_name, told.or(of_file))
        && is_fisheye(by_name) != is_fisheye(meant)
        && meant != LensModel::None
    {
        return Err(format!(
            "the coefficients of {name} are named as those of {}, and its model is to be {}",
            by_name.name(),
            meant.name()
        ));
    }
    let model = match (model, by_name) {
        (Model::Open, Some(model)) => {
            Model::Said(model, "by the names of its coefficients".to_owned())
        }
        (model, _) => model,
    };
    taken(name, model, &coefficients, told)
}

/// The coefficients in order, and the model that their names tell.
fn coefficients(entry: &Node, node: &Node) -> Result<(Vec<f64>, Option<LensModel>), Why> {
    let all = |of: &Node, keys: &[&str]| {
        let number = |key: &&str| of.get(key).and_then(Node::number).unwrap_or(0.0);
        keys.iter().map(number).collect()
    };
    if node.has("k1") {
        let (keys, model): (&[&str], _) = match ["p1", "k4", "k5"].map(|key| node.has(key)) {
            // Only a fisheye has a fourth without those for tangential distortion.
            [false, true, false] => (&["k1", "k2", "k3", "k4"], LensModel::Equidistant),
            [_, false, _] => (&["k1", "k2", "p1", "p2", "k3"], LensModel::PlumbBob),
            _ => (
                &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
                LensModel::RationalPolynomial,
            ),
        };
        return Ok((all(node, keys), Some(model)));
    }
    // A fisheye whose numbers stand beside those of its matrix, counted from the second.
    let beside = entry.get("projection_parameters").filter(|of| of.has("k5"));
    if let Some(of) = beside {
        let four = all(of, &["k2", "k3", "k4", "k5"]);
        return Ok((four, Some(LensModel::Equidistant)));
    }
    match node {
        Node::Nothing => Ok((Vec::new(), None)),
        node => Ok((node.numbers()?, None)),
    }
}

/// What a file says of the model.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Model {
    /// Nothing.
    Open,
    /// This, and how it says it.
    Said(LensModel, String),
    /// That it is no fisheye, and how it says it.
    NoFisheye(String),
    /// A name that nobody here knows.
    Unknown(String),
}

/// The model that a map says.
fn said(entry: &Node, name: &str) -> Result<Model, Why> {
    let is_pinhole = |text: &str| PINHOLE.contains(&&*text.trim().to_ascii_lowercase());
    let mut found = Model::Open;
    for key in MODEL {
        let Some(node) = entry.get(key) else {
            continue;
        };
        let own = match (node, node.number()) {
            (Node::Nothing, _) => continue,
            (Node::Text(text), _) if is_pinhole(text) => continue,
            // Some count them: perspective, fisheye.
            (_, Some(0.0)) => Model::NoFisheye(format!("as its {key} 0 says")),
            (_, Some(1.0)) => Model::Said(LensModel::Equidistant, format!("as its {key} 1 says")),
            (Node::Text(text), _) => model(text),
            _ => return Err(format!("{key} of {name} must be a name")),
        };
        // Of a lens that does nothing its model does not matter; of a camera it does.
        if let Model::Unknown(text) = &own
            && !key.starts_with("distortion")
        {
            return Err(format!(
                "the {key} of {name} is {text:?}, and only pinhole and fisheye can be rectified"
            ));
        }
        if found == Model::Open {
            found = own;
        }
    }
    if found != Model::Open {
        return Ok(found);
    }
    let flag = entry.entries().iter().find_map(|(key, node)| {
        let is_flag = key.to_ascii_lowercase().contains("fisheye");
        Some((key, node.truth().filter(|_| is_flag)?))
    });
    Ok(match flag {
        Some((key, true)) => Model::Said(LensModel::Equidistant, format!("as its {key} says")),
        Some((key, false)) => Model::NoFisheye(format!("as its {key} says")),
        None => Model::Open,
    })
}

/// The model of a name.
pub(super) fn model(text: &str) -> Model {
    match LensModel::named(text) {
        Some(model) => Model::Said(model, "as the file says".to_owned()),
        None => Model::Unknown(text.to_owned()),
    }
}

/// The lens of these coefficients: the model that is told counts before the file's, and the file's before their number.
pub(super) fn taken(
    name: &str,
    model: Model,
    coefficients: &[f64],
    told: Option<LensModel>,
) -> Result<Taken, Why> {
    let is_zero = coefficients.iter().all(|&value| value == 0.0);
    let count = coefficients.len();
    let (model, by) = match (told, model) {
        (Some(told), _) => (told, "as capture.lens says".to_owned()),
        (None, Model::Said(model, by)) => (model, by),
        (None, Model::Open | Model::NoFisheye(_) | Model::Unknown(_)) if is_zero => {
            return Ok(Taken {
                lens: Lens::NONE,
                said: match count {
                    0 => "none, for there are no coefficients".to_owned(),
                    4 => "none, for all four coefficients are 0; of fisheyes set capture.lens=fisheye"
                        .to_owned(),
                    _ => "none, for all coefficients are 0".to_owned(),
                },
            });
        }
        (None, Model::NoFisheye(by)) => {
            let of_count = LensModel::of_count(count);
            (of_count.unwrap_or(LensModel::PlumbBob), by)
        }
        (None, Model::Open) => match LensModel::of_count(count) {
            Some(model) => (model, format!("by the number of its coefficients, {count}")),
            None if count == 4 => {
                let numbers: Vec<String> = coefficients.iter().map(f64::to_string).collect();
                return Err(format!(
                    "{name} has four distortion coefficients ({}) and no model: they may be k1, k2, p1, p2 of plumb_bob, as cv2.calibrateCamera finds them, or k1 to k4 of a fisheye, as cv2.fisheye.calibrate does; say which with capture.lens=plumb_bob or capture.lens=fisheye, or with distortion_model in the file",
                    numbers.join(", ")
                ));
            }
            None => {
                return Err(format!(
                    "{name} has {count} distortion coefficients and no model; read are 5 (plumb_bob: k1, k2, p1, p2, k3), 8, 12 and 14 (rational_polynomial), and 4 with capture.lens=plumb_bob or capture.lens=fisheye"
                ));
            }
        },
        (None, Model::Unknown(other)) => {
            return Err(format!(
                "{name} has the distortion model {other:?}; known are plumb_bob (radtan), rational_polynomial, equidistant (fisheye) and none: calibrate with one of these, or say with capture.lens which of them it is"
            ));
        }
    };
    let lens = Lens::of_model(model, coefficients).map_err(|why| format!("{name} {why}"))?;
    let said = match (model, &lens) {
        (LensModel::None, _) => format!("none, {by}"),
        (LensModel::Equidistant, _) => format!("equidistant (fisheye, k1 to k4), {by}"),
        (LensModel::PlumbBob, _) => format!("plumb_bob (k1, k2, p1, p2, k3), {by}"),
        (_, Lens::Tilted { .. }) => {
            format!("rational_polynomial with thin prism and tilt ({count} coefficients), {by}")
        }
        _ => format!("rational_polynomial (k1, k2, p1, p2, k3 to k6), {by}"),
    };
    Ok(Taken { lens, said })
}

/// The size of the pictures, where the map says it.
pub(super) fn size(entry: &Node) -> Option<Size> {
    let sides = SIDES.iter().find_map(|(width, height)| {
        let side = |key: &str| entry.get(key).and_then(Node::count);
        Some(Size::new(side(width)?, side(height)?))
    });
    sides.or_else(|| {
        let (_, node) = entry.first(&SIZES)?;
        let side = |key: &str| node.get(key).and_then(Node::count);
        if let (Some(width), Some(height)) = (side("width"), side("height")) {
            return Some(Size::new(width, height));
        }
        match node.numbers().ok()?.as_slice() {
            &[width, height] if width >= 1.0 && height >= 1.0 => {
                Some(Size::new(width as u32, height as u32))
            }
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::text;

    fn said(text: &str, told: Option<LensModel>) -> Result<String, Why> {
        let matrix = "intrinsics: {fx: 600, fy: 600, cx: 320, cy: 240}\n";
        let documents = text::documents(&format!("{matrix}{text}"))?;
        camera(&documents[0], "left", told).map(|(_, said)| said)
    }

    #[test]
    fn names_of_coefficients_tell_their_model_and_are_not_put_in_anothers_order() {
        for (text, expected) in [
            (
                "distortion: {k1: -0.2, k2: 0.1, p1: 0.001, p2: 0}\n",
                "plumb_bob",
            ),
            ("distortion: {k1: -0.2, k2: 0.1, k3: 0.01}\n", "plumb_bob"),
            ("k1: -0.2\nk2: 0.1\np1: 0\np2: 0\n", "plumb_bob"),
            (
                "distortion: {k1: 0.02, k2: 0.01, k3: 0.001, k4: 0.0001}\n",
                "equidistant",
            ),
            (
                "distortion: {k1: 1, k2: 0, p1: 0, p2: 0, k3: 0, k4: 1, k5: 0, k6: 0}\n",
                "rational",
            ),
        ] {
            let said = said(text, None).unwrap_or_default();
            assert!(said.starts_with(expected), "{text}: {said}");
        }
        let why = said(
            "distortion: {k1: 0.02, k2: 0.01, k3: 0.001, k4: 0.0001}\n",
            Some(LensModel::PlumbBob),
        );
        assert!(why.is_err_and(|why| why.contains("named as those of equidistant")));
    }

    #[test]
    fn four_zeros_are_no_distortion_and_fisheyes_are_reminded() {
        let said = said("D: [0, 0, 0, 0]\n", None).unwrap_or_default();
        assert!(said.contains("set capture.lens=fisheye"), "{said}");
    }
}
