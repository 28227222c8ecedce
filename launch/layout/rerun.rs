//! The layout for Rerun: a script in Python, as its users write them, since its own files are not to be written without
//! its library.

use std::path::Path;

use messages::record::{Codec, WHOLE};
use messages::{Kind, Rail};
use serde_json::Value;

use super::Focus;

/// The script, with places for what it shows.
const SCRIPT: &str = include_str!("rerun.py");

/// Where the eye stands, seen from what it looks at, in its radii: behind the cameras, to the left and above.
const FROM: [f64; 3] = [-1.5, 0.7, 0.8];

/// The views whose images and cameras are shown: of more than three those whose curves matches name.
fn views(codec: &Codec) -> Vec<&str> {
    let rig = codec.rig();
    if rig.rail.is_some() {
        return vec![Rail::VIEW];
    }
    let named = rig.named(codec.reference());
    let names = named.iter().filter_map(|&view| rig.views.get(view));
    names.map(|view| view.name.as_str()).collect()
}

/// The clouds that are shown in space.
fn clouds(codec: &Codec) -> Vec<&'static str> {
    match codec.rig().rail {
        Some(_) => vec![WHOLE, Kind::Growing.name()],
        None => vec![Kind::Points.name()],
    }
}

/// All topics that the script names.
pub(super) fn topics(codec: &Codec) -> Vec<String> {
    let of_view = |view: &&str| ["image", "calibration"].map(|of| format!("camera/{view}/{of}"));
    let views = views(codec);
    let fixed = ["tf", "disparity/picture", "log"];
    let all = fixed.into_iter().chain(clouds(codec)).map(str::to_owned);
    all.chain(views.iter().flat_map(of_view)).collect()
}

/// The script that shows a recording; without one it is to be named.
pub(super) fn script(codec: &Codec, focus: Option<&Focus>, recording: Option<&Path>) -> String {
    let ([x, y, z], radius) = focus.map_or(([1.0, 0.0, 0.0], 1.0), Focus::ball);
    let [forward, left, up] = FROM.map(|radii| radii * radius);
    let place = |[x, y, z]: [f64; 3]| format!("({x:.4}, {y:.4}, {z:.4})");
    let list = |names: Vec<String>| Value::from(names).to_string();
    let views = views(codec).into_iter().map(str::to_owned).collect();
    let points = clouds(codec)
        .iter()
        .map(|topic| format!("/{topic}"))
        .collect();
    let recording = recording.unwrap_or(Path::new("recording.mcap"));
    // Texts and lists of JSON are Python's too. A file may have any name: it is put in last.
    SCRIPT
        .replace("@views@", &list(views))
        .replace("@points@", &list(points))
        .replace("@frame@", &Value::from(codec.points_frame()).to_string())
        .replace("@eye@", &place([x + forward, y + left, z + up]))
        .replace("@target@", &place([x, y, z]))
        .replace(
            "@recording@",
            &Value::from(recording.to_string_lossy()).to_string(),
        )
}
