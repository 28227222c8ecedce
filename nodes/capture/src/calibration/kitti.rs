//! KITTI's files: `calib.txt`, which has the projections `P0`, `P1`, … of images that are rectified, and
//! `calib_cam_to_cam.txt`, which has each camera as it was before too. One camera a number, left to right.

use messages::Size;

use super::node::Node;
use super::ros::CameraInfo;
use super::{Why, entry};

const IDENTITY: [f64; 9] = [1., 0., 0., 0., 1., 0., 0., 0., 1.];

/// Whether it has projections alone, of images that are rectified.
pub(super) fn is_rectified(file: &Node) -> bool {
    let is_projection = |key| matches!(file.numbers_of::<12>(key), Ok(Some(_)));
    // OpenCV's own have rotations beside them.
    is_projection("P0") && !file.has("R0") && !file.has("R1")
}

/// Whether it has cameras before and after they were rectified.
pub(super) fn is_raw(file: &Node) -> bool {
    file.has("P_rect_00") && file.has("K_00")
}

/// The cameras of such a file; `None` of any other.
///
/// # Errors
/// A part that is missing or has another number of numbers.
pub(super) fn infos(file: &Node) -> Option<Result<Vec<CameraInfo>, Why>> {
    match () {
        () if is_rectified(file) => Some(rectified(file)),
        () if is_raw(file) => Some(raw(file)),
        () => None,
    }
}

fn rectified(file: &Node) -> Result<Vec<CameraInfo>, Why> {
    let mut found = Vec::new();
    for number in 0.. {
        let name = format!("P{number}");
        let Some(p) = file.numbers_of::<12>(&name)? else {
            break;
        };
        found.push(CameraInfo {
            name: Some(name),
            size: None,
            distortion_model: None,
            d: Vec::new(),
            k: [p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]],
            r: IDENTITY,
            p,
        });
    }
    Ok(found)
}

fn raw(file: &Node) -> Result<Vec<CameraInfo>, Why> {
    let mut found = Vec::new();
    for number in 0.. {
        let name = format!("{number:02}");
        let key = |what: &str| format!("{what}_{name}");
        let missing = |what: &str| format!("the key {} is missing", key(what));
        let Some(p) = file.numbers_of::<12>(&key("P_rect"))? else {
            break;
        };
        let k = file.numbers_of::<9>(&key("K"))?;
        let d = file.numbers_of::<5>(&key("D"))?;
        let r = file.numbers_of::<9>(&key("R_rect"))?;
        let size = file.numbers_of::<2>(&key("S_rect"))?;
        found.push(CameraInfo {
            size: size.map(|[width, height]| Size::new(width as u32, height as u32)),
            distortion_model: Some("plumb_bob".to_owned()),
            d: d.ok_or_else(|| missing("D"))?.to_vec(),
            k: k.ok_or_else(|| missing("K"))?,
            r: r.ok_or_else(|| missing("R_rect"))?,
            p,
            name: Some(name),
        });
    }
    Ok(found)
}

/// The cameras as they were before they were rectified, whose images have another size than after.
pub(super) fn before(file: &Node) -> Result<Vec<CameraInfo>, Why> {
    let mut found = raw(file)?;
    for info in &mut found {
        let name = info.name.as_deref().unwrap_or_default();
        let own = file.get(&format!("S_{name}")).cloned();
        let own = own.map(|node| Node::Map(vec![("image_size".to_owned(), node)]));
        info.size = own.as_ref().and_then(entry::size);
    }
    Ok(found)
}
