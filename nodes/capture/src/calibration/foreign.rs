//! Files of tools that describe no three cameras, or not so that they could be rectified: what each is, and what to do.

use super::Why;
use super::node::Node;

/// Signs of files that are no YAML, and what is to be said of them.
const TEXTS: [(&str, &str); 5] = [
    (
        "[LEFT_CAM_",
        "it is the calibration of a ZED, which has two cameras, and three views are needed; of one of the two along a rail, with images as the SDK rectifies them, set capture.focal, capture.cx and capture.cy to the fx, cx and cy of its camera_info",
    ),
    (
        "Camera-system parameters:",
        "it is Kalibr's report; give the camchain that Kalibr writes beside it (…camchain….yaml)",
    ),
    (
        "# Camera list with one line of data per camera",
        "it is COLMAP's list of cameras, which does not say where they stand; write a map a camera instead, with camera_matrix, distortion_coefficients, R and T",
    ),
    (
        "\"image_prefix\"",
        "it is COLMAP's description of a rig, without the cameras' own numbers; write a map a camera instead, with camera_matrix, distortion_coefficients, R and T",
    ),
    (
        "fc = [",
        "it is a script of MATLAB's toolbox; write its numbers as YAML, a map a camera: camera_matrix (fc and cc), distortion_coefficients (kc), R and T",
    ),
];

/// What is to be said of a text that no reader knows.
pub(super) fn of_text(text: &str) -> Option<Why> {
    let known = TEXTS.iter().find(|(sign, _)| text.contains(sign));
    known.map(|(_, why)| (*why).to_owned())
}

/// What is to be said of a file whose keys no reader knows: of two rectified views or of one camera, with its numbers as
/// settings.
pub(super) fn of_keys(file: &Node) -> Option<Why> {
    let number = |key: &str| file.get(key).and_then(Node::number);
    let first = file.numbers_of::<9>("cam0").ok().flatten();
    if let (Some([f, _, cx, _, _, cy, ..]), Some(baseline_mm)) = (first, number("baseline")) {
        return Some(format!(
            "it is Middlebury's, of two rectified views: set capture.focal={f}, capture.cx={cx}, capture.cy={cy} and, where its baseline is that of neighbouring views, capture.baseline={} (it says millimetres)",
            baseline_mm / 1000.0
        ));
    }
    let prefix = ["Camera", "Camera1"];
    let prefix = prefix
        .into_iter()
        .find(|own| file.has(&format!("{own}.fx")))?;
    let own = |key: &str| number(&format!("{prefix}.{key}"));
    let (f, cx, cy) = (own("fx")?, own("cx")?, own("cy")?);
    let baseline = match number("Camera.bf") {
        Some(bf) => format!(
            ", and capture.baseline={} (Camera.bf / Camera.fx) where it is that of neighbouring views",
            bf / f
        ),
        None => String::new(),
    };
    Some(format!(
        "it is a settings file of ORB-SLAM: of rectified images set capture.focal={f}, capture.cx={cx}, capture.cy={cy}{baseline}; of others write a map a camera instead, with camera_matrix, distortion_coefficients, R and T"
    ))
}
