//! What DepthAI keeps of the cameras of an OAK: one a socket, with the place of another in its frame, in centimetres.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};

use super::node::Node;
use super::{Camera, Mount, Mounted, Why, entry, maps, rotation};
use crate::settings::LensModel;

const METRES: f64 = 0.01;
/// Sockets from one to another: more go round in a circle.
const LONGEST: usize = 32;

/// Whether it is such a file.
pub(super) fn is(file: &Node) -> bool {
    matches!(file.get("cameraData"), Some(Node::List(_)))
}

/// A camera, and what maps points of its frame to that of another one.
struct Socket<'a> {
    camera: &'a Node,
    to: Option<i64>,
    turn: DMat3,
    shift: DVec3,
}

/// The cameras, left to right.
pub(super) fn cameras(file: &Node, lens: Option<LensModel>) -> Result<Vec<Mounted>, Why> {
    let sockets = sockets(file)?;
    let mut mounted = Vec::new();
    for (number, own) in &sockets {
        let name = format!("socket {number}");
        let node = Node::Map(
            [
                ("camera_matrix", "intrinsicMatrix"),
                ("distortion_coefficients", "distortionCoeff"),
            ]
            .into_iter()
            .filter_map(|(known, key)| Some((known.to_owned(), own.camera.get(key)?.clone())))
            .chain(own.camera.entries().iter().filter_map(|(key, node)| {
                let known = match key.as_str() {
                    "width" | "height" => key.as_str(),
                    // 0 is perspective, 1 a fisheye.
                    "cameraType" => "model_type",
                    _ => return None,
                };
                Some((known.to_owned(), node.clone()))
            }))
            .collect(),
        );
        let (camera, said): (Camera, String) = entry::camera(&node, &name, lens)?;
        let (turn, centre_m) = pose(&sockets, *number)?;
        mounted.push(Mounted {
            name,
            camera,
            lens: said,
            mount: Mount::Posed { turn, centre_m },
        });
    }
    Ok(maps::from_left(mounted))
}

fn sockets(file: &Node) -> Result<BTreeMap<i64, Socket<'_>>, Why> {
    let Some(Node::List(list)) = file.get("cameraData") else {
        return Ok(BTreeMap::new());
    };
    let mut sockets = BTreeMap::new();
    for pair in list {
        let (number, camera) = match pair {
            Node::List(pair) if let [number, camera] = &pair[..] => (number.number(), camera),
            _ => (None, pair),
        };
        let Some(number) = number else {
            return Err(
                "cameraData must hold pairs of a socket's number and its camera".to_owned(),
            );
        };
        let name = format!("socket {number}");
        let extrinsics = camera.get("extrinsics").unwrap_or(&Node::Nothing);
        let to = extrinsics.get("toCameraSocket").and_then(Node::number);
        let to = to.map(|to| to as i64).filter(|to| *to >= 0);
        let (turn, shift) = match to {
            None => (DMat3::IDENTITY, DVec3::ZERO),
            Some(_) => {
                let missing = |key: &str| format!("{key} of {name} is missing");
                let key = "rotationMatrix";
                let rows = extrinsics.numbers_of::<9>(key)?;
                let turn = rotation(&name, key, rows.ok_or_else(|| missing(key))?)?;
                let shift = |key| extrinsics.numbers_of::<3>(key);
                let measured = shift("translation")?.ok_or_else(|| missing("translation"))?;
                // Of boards that nobody calibrated only what they were drawn with is known.
                let shift = match measured == [0.0; 3] {
                    true => shift("specTranslation")?.unwrap_or(measured),
                    false => measured,
                };
                (turn, METRES * DVec3::from_array(shift))
            }
        };
        let socket = Socket {
            camera,
            to,
            turn,
            shift,
        };
        sockets.insert(number as i64, socket);
    }
    Ok(sockets)
}

/// What maps points of a camera's frame to that of the one at the end of its way.
fn pose(sockets: &BTreeMap<i64, Socket<'_>>, from: i64) -> Result<(DMat3, DVec3), Why> {
    let (mut turn, mut shift) = (DMat3::IDENTITY, DVec3::ZERO);
    let mut at = from;
    for _ in 0..LONGEST {
        let own = sockets.get(&at).ok_or_else(|| {
            format!("where socket {from} stands is not known: it says that by socket {at}, which is not there")
        })?;
        let Some(to) = own.to else {
            return Ok((turn, shift));
        };
        (turn, shift) = (own.turn * turn, own.turn * shift + own.shift);
        at = to;
    }
    Err(format!(
        "where socket {from} stands is not known: sockets say it of each other in a circle"
    ))
}
