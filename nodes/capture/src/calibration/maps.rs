//! A map a camera, each with its matrix, its coefficients and where it stands: several in one file, by name or in a list, or
//! a file each; and the matrices of all cameras stacked, as OpenCV's multi-view sample writes them.

use glam::{DMat3, DVec3};

use super::node::Node;
use super::{Mount, Mounted, Why, entry, pose};
use crate::names;
use crate::settings::LensModel;

/// A camera's name and its map.
pub(super) type Entry = (String, Node);

/// Where a list or a map of cameras stands.
const LISTS: [&str; 4] = ["cameras", "Cameras", "sensors", "camera"];

/// The cameras' maps in a file, numbered ones in the order of their numbers and others in its own, where it has them.
pub(super) fn within(file: &Node) -> Option<Vec<Entry>> {
    if let Some(entries) = stacked(file) {
        return Some(entries);
    }
    let inner = LISTS.iter().find_map(|key| match file.get(key)? {
        Node::List(list) => {
            let name = |(at, node): (usize, &Node)| {
                let own = ["name", "camera_name", "id"];
                let own = own.iter().find_map(|key| node.get(key)?.text());
                let name = own.map_or_else(|| format!("camera {at}"), str::to_owned);
                (name, node.clone())
            };
            Some(list.iter().enumerate().map(name).collect::<Vec<Entry>>())
        }
        map @ Node::Map(_) if !entry::is_camera(map) => Some(map.entries().to_vec()),
        _ => None,
    });
    let is_list = |key: &str| matches!(file.get(key), Some(Node::List(_)));
    let is_map = !LISTS.iter().any(|key| is_list(key));
    let found = inner.unwrap_or_else(|| file.entries().to_vec());
    let mut found: Vec<Entry> = found
        .into_iter()
        .filter(|(_, node)| entry::is_camera(node))
        .collect();
    if is_map && found.iter().all(|(name, _)| is_numbered(name)) {
        names::sort(&mut found, |(name, _)| name.clone());
    }
    (!found.is_empty()).then_some(found)
}

fn is_numbered(name: &str) -> bool {
    name.contains(|c: char| c.is_ascii_digit())
}

/// The cameras of stacked matrices: `Ks`, `distortions`, `Rs` or `rvecs`, and `Ts`.
fn stacked(file: &Node) -> Option<Vec<Entry>> {
    let matrices = file.get("Ks")?.numbers().ok()?;
    let count = matrices.len() / 9;
    let part = |keys: &[&str], camera: usize| {
        let numbers = file.first(keys)?.1.numbers().ok()?;
        let each = numbers.len() / count.max(1);
        let own = numbers.get(camera * each..(camera + 1) * each)?;
        Some(Node::List(own.iter().copied().map(Node::Number).collect()))
    };
    let keys: [(&str, &[&str]); 6] = [
        ("K", &["Ks"]),
        ("D", &["distortions", "Ds", "dists"]),
        ("R", &["Rs", "rvecs"]),
        ("T", &["Ts", "tvecs"]),
        ("image_size", &["image_sizes", "imageSizes"]),
        ("is_fisheye", &["is_fisheye", "models"]),
    ];
    let camera = |at: usize| {
        let entries = keys.iter().filter_map(|(key, from)| {
            let node = part(from, at)?;
            let node = match node {
                Node::List(mut one) if *key == "is_fisheye" => one.pop()?,
                node => node,
            };
            Some(((*key).to_owned(), node))
        });
        (format!("camera {at}"), Node::Map(entries.collect()))
    };
    Some((0..count).map(camera).collect())
}

/// The cameras of these maps. The first one's frame is that of the others where it does not say where it stands.
pub(super) fn cameras(entries: &[Entry], lens: Option<LensModel>) -> Result<Vec<Mounted>, Why> {
    let mut mounted = Vec::new();
    for (at, (name, node)) in entries.iter().enumerate() {
        let (camera, lens) = entry::camera(node, name, lens)?;
        let mount = match (at, pose::of(node, name)?) {
            (_, Some(mount)) => mount,
            (0, None) => Mount::from_first(DMat3::IDENTITY, DVec3::ZERO),
            _ => {
                return Err(format!(
                    "where {name} stands is not known: R and T, which map points of the first camera's frame to its own, are missing, and so is a pose"
                ));
            }
        };
        mounted.push(Mounted {
            name: name.clone(),
            camera,
            lens,
            mount,
        });
    }
    Ok(mounted)
}

/// The cameras from left to right, where their names do not number them.
pub(super) fn in_row(mounted: Vec<Mounted>) -> Vec<Mounted> {
    match mounted.iter().any(|one| is_numbered(&one.name)) {
        true => mounted,
        false => from_left(mounted),
    }
}

/// The cameras from left to right, by where they stand.
pub(super) fn from_left(mut mounted: Vec<Mounted>) -> Vec<Mounted> {
    let posed = |one: &Mounted| match one.mount {
        Mount::Posed { turn, centre_m } => (turn, centre_m),
        Mount::Rectified { turn, place_m, .. } => (turn, DVec3::X * place_m),
    };
    let right: DVec3 = mounted.iter().map(|one| posed(one).0 * DVec3::X).sum();
    mounted.sort_by(|a, b| {
        let [a, b] = [a, b].map(|one| right.dot(posed(one).1));
        a.total_cmp(&b)
    });
    mounted
}
