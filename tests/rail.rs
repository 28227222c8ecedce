//! One camera that moves along a rail: every frame is worked on once, and whoever is killed, the results are the same.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;
#[path = "../nodes/capture/tests/texture/mod.rs"]
mod texture;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use harness::{Ran, World, bytes_of, signal, texture, wait_until};
use messages::recording::Recording;
use messages::{Evaluation, Kind, Map, Owned, Size, Sway, Topic, Truth};
use serde_json::Value;
use texture::wave;

const RAIL: [&str; 1] = ["--rail"];
const START: [&str; 2] = ["--set", "capture.start=1700000000000000000"];

/// Starts a run along a rail into this recording.
fn arguments<'a>(source: &'a str, file: &'a str) -> Vec<&'a str> {
    let run = ["run", "--source", source, "--record", file, "--json"];
    run.into_iter().chain(RAIL).chain(START).collect()
}

/// Every message of the data topics, by topic and scan.
fn messages(path: &Path) -> BTreeMap<(String, u32), Vec<u8>> {
    let mut all = BTreeMap::new();
    let parts = (0..100).map(|part| match part {
        0 => path.to_owned(),
        part => {
            let name = path.file_stem().unwrap().to_string_lossy();
            path.with_file_name(format!("{name}.{part}.mcap"))
        }
    });
    for part in parts.take_while(|part| part.exists()) {
        let file = std::fs::read(part).unwrap();
        let cut_or_not = mcap::read::Options::IgnoreEndMagic.into();
        for message in mcap::MessageStream::new_with_options(&file, cut_or_not).unwrap() {
            // Of a part whose writer was killed, what stands after the cut is in the next one.
            let Ok(message) = message else { break };
            let topic = message.channel.topic.clone();
            if !["statistics", "ledger", "health", "log"].contains(&topic.as_str()) {
                all.insert((topic, message.sequence), message.data.into_owned());
            }
        }
    }
    all
}

fn published(summary: &Value, topic: &str) -> u64 {
    let nodes = summary["ledger"]["nodes"].as_object().unwrap();
    let counts = nodes
        .values()
        .filter_map(|node| node[topic]["published"].as_u64());
    counts.sum()
}

#[test]
fn every_frame_is_filtered_tracked_and_tabulated_once_and_serves_in_three_triples() {
    let world = World::new();
    let rail = world.small_rail("rail", 0..12);
    let source = rail.to_string_lossy().into_owned();
    let summary = world.run(&arguments(&source, "x.mcap")).done().json();
    for topic in [
        "camera/moving/image",
        "edges/moving/0.8",
        "curves/moving/0.8",
        "tables/moving/0.8",
    ] {
        assert_eq!(published(&summary, topic), 12, "{topic}: {summary}");
    }
    for topic in ["matches/0.8", "points", "map", "map/growing"] {
        assert_eq!(published(&summary, topic), 12, "{topic}: {summary}");
    }
    assert_eq!(summary["balanced"], true, "{summary}");
}

#[test]
fn whoever_is_killed_the_results_are_the_same_to_the_byte() {
    let world = World::new();
    let rail = world.small_rail("rail", 0..300);
    let source = rail.to_string_lossy().into_owned();
    world.run(&arguments(&source, "whole.mcap")).done();
    let expected = messages(&world.path("whole.mcap"));
    for node in ["capture", "filter", "hough", "match", "map", "record"] {
        let file = format!("{node}.mcap");
        let child = world.start(&arguments(&source, &file));
        // Well along the rail, so that what is lost depends on frames that are done.
        wait_until("frames are recorded", || {
            bytes_of(&world.path(&file)) > bytes_of(&world.path("whole.mcap")) / 3
        });
        let nodes = world.nodes();
        let (_, pid) = nodes.iter().find(|(name, _)| name == node).unwrap();
        signal(*pid, "KILL");
        let ran = Ran::new(child.wait_with_output().unwrap()).done();
        let summary = ran.json();
        assert_eq!(summary["balanced"], true, "{node}: {ran:?}");
        let restarts = |n: &Value| n["node"] == node && n["restarts"].as_u64() >= Some(1);
        let nodes = summary["nodes"].as_array().unwrap();
        assert!(
            nodes.iter().any(restarts),
            "{node} was killed too late: {ran:?}"
        );
        let found = messages(&world.path(&file));
        assert!(found.keys().eq(expected.keys()), "{node}");
        for (key, bytes) in &expected {
            assert!(*bytes == found[key], "{node}: {key:?} differs");
        }
    }
}

#[test]
fn a_recording_of_a_rail_is_replayed_to_the_byte_from_every_stage() {
    let world = World::new();
    let rail = world.small_rail("rail", 0..32);
    let source = rail.to_string_lossy().into_owned();
    let own = ["--set", "capture.stride=2", "--set", "map.window=4"];
    world
        .run(&[&arguments(&source, "x.mcap")[..], &own].concat())
        .done();
    for stage in ["capture", "filter", "track", "hough", "match", "map"] {
        let verified = ["replay", "x.mcap", "--from", stage, "--verify", "--json"];
        let report = world.run(&verified).done().json();
        assert_eq!(report["verified"]["equal"], true, "{stage}: {report}");
        assert_eq!(
            report["verified"]["topics"]["map"]["equal"], 32,
            "{stage}: {report}"
        );
    }
    let stride = ["replay", "x.mcap", "--set", "capture.stride=2"];
    let ran = world.run(&stride);
    assert!(
        ran.code == Some(2)
            && ran
                .err
                .contains("capture.stride was settled when the recording was made"),
        "{ran:?}"
    );
    // What its first frames depend on is not in it: those are not compared, and all others are.
    let cut = ["filter", "x.mcap", "--scans", "4..32", "-o", "cut.mcap"];
    world.run(&cut).done();
    let ran = world.run(&["replay", "cut.mcap", "--verify", "--json"]);
    let verified = &ran.done().json()["verified"];
    assert_eq!(verified["equal"], true, "{verified}");
    for (topic, equal, dependent) in [
        ("curves/moving/2.2", 28, Value::Null),
        ("points", 24, 4.into()),
        // Of the points of twice the window and eight frames before it.
        ("map", 8, 20.into()),
    ] {
        let found = &verified["topics"][topic];
        assert_eq!(
            (&found["equal"], &found["dependent"]),
            (&equal.into(), &dependent),
            "{topic}: {verified}"
        );
    }
}

#[test]
fn a_part_of_a_rail_is_verified_with_the_frames_before_it_or_not_at_all() {
    let world = World::new();
    let rail = world.small_rail("rail", 0..40);
    let source = rail.to_string_lossy().into_owned();
    let own = ["--set", "capture.stride=2", "--set", "map.window=4"];
    world
        .run(&[&arguments(&source, "x.mcap")[..], &own].concat())
        .done();
    let part = [
        "replay", "x.mcap", "--scans", "30..32", "--verify", "--json",
    ];
    for (stage, lead) in [("capture", 20), ("match", 20), ("map", 16)] {
        let report = world
            .run(&[&part[..], &["--from", stage]].concat())
            .done()
            .json();
        let verified = &report["verified"];
        assert_eq!(
            (&verified["equal"], &verified["scans"], &verified["lead"]),
            (&true.into(), &2.into(), &lead.into()),
            "{stage}: {verified}"
        );
        for topic in verified["topics"].as_object().unwrap().values() {
            assert_eq!(topic["compared"], 2, "{stage}: {verified}");
        }
    }
    // What is recorded beside it is the part alone.
    let record = ["--record", "y.mcap"];
    world.run(&[&part[..], &record].concat()).done();
    let info = world.run(&["info", "y.mcap", "--json"]).done().json();
    assert_eq!(info["scans"]["total"], 2, "{info}");
    // At the beginning there is nothing before.
    let first = ["replay", "x.mcap", "--scans", "1..3", "--verify", "--json"];
    let verified = &world.run(&first).done().json()["verified"];
    assert_eq!(
        (&verified["equal"], &verified["lead"]),
        (&true.into(), &1.into())
    );
    // Where the frames before are not in the file, nothing is claimed of what depends on them.
    world
        .run(&["filter", "x.mcap", "--scans", "30..32", "-o", "cut.mcap"])
        .done();
    let ran = world.run(&["replay", "cut.mcap", "--verify"]);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    let told = "NOT verified: no message was compared of disparity, map, map/growing, matches/0.8, matches/2.2, \
                points: they depend on 20 frames before these, of which 20 are not in the recording";
    assert!(ran.out.contains(told), "{}", ran.out);
    let ran = world.run(&["replay", "cut.mcap", "--to", "hough", "--verify"]);
    assert_eq!(ran.code, Some(0), "{ran:?}");
}

#[test]
fn a_replay_computes_what_takes_from_its_cut_and_plays_the_rest() {
    let world = World::new();
    let rail = ["--source", "scene:tab", "--set", "capture.mode=rail"];
    let run = ["run", "--scans", "8", "--record", "x.mcap"];
    world.run(&[&run[..], &rail].concat()).done();
    let computed = |cut: &[&str]| -> Vec<String> {
        let ran = world.run(&[&["replay", "x.mcap", "--verify", "--json"], cut].concat());
        let topics = ran.done().json()["verified"]["topics"].clone();
        topics.as_object().unwrap().keys().cloned().collect()
    };
    // Map and evaluation both take points, and neither takes the other's.
    assert_eq!(computed(&["--from", "map"]), ["map", "map/growing"]);
    assert_eq!(computed(&["--from", "evaluate"]), ["evaluation"]);
    let evaluated = computed(&["--from", "match", "--to", "evaluate"]);
    let told = [
        "disparity",
        "evaluation",
        "matches/0.8",
        "matches/2.2",
        "points",
    ];
    assert_eq!(evaluated, told);
    let ran = world.run(&["replay", "x.mcap", "--from", "map", "--to", "evaluate"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(ran.err.contains("nothing would be computed"), "{ran:?}");
}

#[test]
fn a_part_of_a_rail_is_compared_with_the_frames_before_it_and_without_its_map() {
    let world = World::new();
    let rail = world.small_rail("rail", 0..12);
    let source = rail.to_string_lossy().into_owned();
    world.run(&arguments(&source, "x.mcap")).done();
    let compare =
        |more: &[&str]| world.run(&[&["replay", "x.mcap", "--compare", "--json"], more].concat());
    let json = compare(&["--scans", "6..9", "--from", "match"])
        .done()
        .json();
    let compared = &json["compared"];
    assert_eq!(compared["scans"], 3, "{json}");
    assert_eq!(compared["verdict"], "same", "{json}");
    assert!(compared["points"]["a"].as_u64() > Some(0), "{json}");
    assert!(compared["maps"].is_null(), "{json}");
    let json = compare(&["--from", "match"]).done().json();
    assert!(json["compared"]["maps"].is_array(), "{json}");
    let ran = compare(&["--from", "map"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("from map on none are computed"),
        "{}",
        ran.err
    );
}

#[test]
fn too_few_frames_for_a_map_are_said_before_and_after() {
    let world = World::new();
    let rail = world.small_rail("rail", 0..4);
    let source = rail.to_string_lossy().into_owned();
    let ran = world.run(&["check-geometry", &source, "--layout", "rail"]);
    let told = "4 frames make no map: a point enters it once 3 triples have seen it";
    assert!(ran.err.contains(told), "{}", ran.err);
    let ran = world.run(&["run", "--source", &source, "--rail", "--record", "x.mcap"]);
    assert!(ran.done().err.contains(told));
    let ran = world.run(&["export", "x.mcap", "--map", "map.ply"]).done();
    assert!(
        ran.err
            .contains("as many triples as map.sightings asks for"),
        "{}",
        ran.err
    );
    let ran = world.run(&["run", &source]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("images are given with --source"),
        "{}",
        ran.err
    );
}

#[test]
fn the_map_of_a_rendered_scene_is_right() {
    let world = World::new();
    let mut run = arguments("scene:jack", "x.mcap");
    run.extend(["--scans", "30"]);
    let summary = world.run(&run).done().json();
    // Points of single triples, against the exact truth of their own frame.
    let nodes = summary["nodes"].as_array().unwrap();
    let evaluate = nodes
        .iter()
        .find(|node| node["node"] == "evaluate")
        .unwrap();
    assert!(
        evaluate["counts"]["compared"].as_u64() > Some(100_000),
        "{evaluate}"
    );
    world.run(&["export", "x.mcap", "--map", "map.ply"]).done();
    let ply = std::fs::read(world.path("map.ply")).unwrap();
    let count = vertices_of(&ply).0;
    assert!(count > 10_000, "{count} points");
    let near = share_near_truth(&world.path("x.mcap"), &ply);
    assert!(near > 0.98, "{near} of the map lie where the scene does");
    // The camera passes the same places again and again: what is seen again is no new point.
    let of_one_frame = summary_points(&nodes[..]);
    assert!(
        (count as f64) < 4.0 * of_one_frame,
        "{count} points in the map, {of_one_frame} in a frame"
    );
}

/// Which part of a map's points lies within a fiftieth of the depth that the truth of a frame has there: a third of a pixel and more.
fn share_near_truth(recording: &Path, ply: &[u8]) -> f64 {
    let mut recording = Recording::open(recording).unwrap();
    let rig = recording.metadata().rig.clone();
    let topic = Topic::of(&rig, Kind::Truth).remove(0);
    // Five positions there are, and back.
    let truths: Vec<Owned<Truth>> = (0..5)
        .map(|scan| recording.read(scan, &topic).unwrap())
        .collect();
    let camera = rig.calibration(truths[0].header.size());
    let is_near = |x: f64, y: f64, z: f64| {
        truths.iter().any(|truth| {
            let size = truth.header.size();
            let column = camera.focal_px * (x - truth.header.position_m) / z + camera.cx;
            let row = camera.focal_px * y / z + camera.cy;
            let around = [0.0, 1.0]
                .into_iter()
                .flat_map(|right| [0.0, 1.0].map(|down| (right, down)));
            let mut depths = around.filter_map(|(right, down)| {
                let (column, row) = (column.floor() + right, row.floor() + down);
                let is_inside = (0.0..f64::from(size.width)).contains(&column)
                    && (0.0..f64::from(size.height)).contains(&row);
                let pixel = row as usize * size.width as usize + column as usize;
                let disparity = is_inside.then(|| truth.view().disparity[pixel])?;
                Some(camera.focal_px * camera.baseline_m / f64::from(disparity))
            });
            depths.any(|depth| (depth - z).abs() < 0.02 * depth)
        })
    };
    let (count, vertices) = vertices_of(ply);
    let near = vertices.filter(|[x, y, z]| is_near(*x, *y, *z));
    near.count() as f64 / count as f64
}

/// How many points a map's file holds, and where each is, in metres.
fn vertices_of(ply: &[u8]) -> (usize, impl Iterator<Item = [f64; 3]>) {
    const VERTEX: usize = 6 * 4 + 3;
    let head = String::from_utf8_lossy(&ply[..ply.len().min(600)]).into_owned();
    let count = head
        .lines()
        .find_map(|line| line.strip_prefix("element vertex "));
    let count: usize = count.unwrap().parse().unwrap();
    let vertices = ply[ply.len() - count * VERTEX..].chunks_exact(VERTEX);
    let number = |vertex: &[u8], at: usize| {
        f64::from(f32::from_le_bytes(
            vertex[4 * at..][..4].try_into().unwrap(),
        ))
    };
    let at = move |vertex: &[u8]| [0, 1, 2].map(|axis| number(vertex, axis));
    (count, vertices.map(at))
}

/// Points a frame, on average.
fn summary_points(nodes: &[Value]) -> f64 {
    let of_match = nodes.iter().find(|node| node["node"] == "match").unwrap();
    of_match["counts"]["points"].as_f64().unwrap() / 30.0
}

/// Writes the frames of a rail, each exposed by its own factor: a textured wall that goes 4 px to the left from one to the
/// next, and slabs before it that go 6 px, with a noise of one gray level; and where they were taken, and their truth.
fn exposed_rail(world: &World, name: &str, exposures: &[f64]) -> String {
    const WIDTH: u32 = 320;
    const HEIGHT: u32 = 200;
    let folder = world.path(name);
    std::fs::create_dir_all(&folder).unwrap();
    let (mut views, mut truths) = (Vec::new(), Vec::new());
    for (frame, exposure) in (0u32..).zip(exposures) {
        let mut picture = format!("P5\n{WIDTH} {HEIGHT}\n255\n").into_bytes();
        let mut truth = format!("P5\n{WIDTH} {HEIGHT}\n65535\n").into_bytes();
        for (y, x) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (y, x))) {
            let on_slab = x + 6 * frame;
            let is_slab = (50..150).contains(&y) && on_slab / 90 % 2 == 1;
            let (disparity, gray) = match is_slab {
                true => (6, texture(on_slab + 1000, y + 500)),
                false => (4, texture(x + 4 * frame, y)),
            };
            let noise = texture(1 + 8 * (x + 331 * frame), 1 + 8 * y) % 3;
            let gray = 40.0 + 0.6 * f64::from(gray) + f64::from(noise) - 1.0;
            picture.push((exposure * gray).round() as u8);
            truth.extend((256 * disparity as u16).to_be_bytes());
        }
        let (of_picture, of_truth) = (format!("view{frame}.pgm"), format!("gt{frame}.pgm"));
        std::fs::write(folder.join(&of_picture), picture).unwrap();
        std::fs::write(folder.join(&of_truth), truth).unwrap();
        views.push(serde_json::json!({ "file": of_picture, "position_steps": frame }));
        truths.push(serde_json::json!({ "file": of_truth, "view": frame }));
    }
    let scene = serde_json::json!({ "views": views, "ground_truth": truths });
    std::fs::write(folder.join("scene.json"), scene.to_string()).unwrap();
    folder.to_string_lossy().into_owned()
}

/// What came of a rail.
#[derive(Debug)]
struct Came {
    /// Points of all frames, and of the map.
    points: f64,
    of_map: f64,
    /// Of the frames' points: the share off by over a pixel, and the mean of the frames' median errors in pixels.
    bad: f64,
    median: f64,
    /// Share of the map that lies farther than a twentieth of the depth from both surfaces.
    astray: f64,
}

fn along(world: &World, name: &str, exposures: &[f64]) -> Came {
    let source = exposed_rail(world, name, exposures);
    let (file, map) = (format!("{name}.mcap"), format!("{name}.ply"));
    let mut run = arguments(&source, &file);
    run.extend(["--set", "capture.focal=500"]);
    run.extend(["--set", "capture.baseline=0.01"]);
    let summary = world.run(&run).done().json();
    let count = |node: &str, name: &str| {
        let nodes = summary["nodes"].as_array().unwrap();
        let of_node = nodes.iter().find(|summary| summary["node"] == node);
        of_node.unwrap()["counts"][name].as_f64().unwrap()
    };
    let mut recording = Recording::open(&world.path(&file)).unwrap();
    let rail = recording.metadata().rig.rail.unwrap();
    let topic = Topic::of(&recording.metadata().rig, Kind::Evaluation).remove(0);
    let (mut known, mut wrong, mut medians) = (0.0, 0.0, Vec::new());
    for scan in recording.scans().collect::<Vec<u64>>() {
        let frame = recording.read::<Evaluation>(scan, &topic).unwrap();
        let score = frame.view().scores[0];
        if score.points > 0 {
            known += f64::from(score.points);
            wrong += f64::from(score.over_one);
            medians.push(f64::from(score.median));
        }
    }
    world.run(&["export", &file, "--map", &map]).done();
    let ply = std::fs::read(world.path(&map)).unwrap();
    let (of_map, vertices) = vertices_of(&ply);
    // A baseline is a triple's.
    let depth = |disparity: f64| 500.0 * 0.01 / (disparity * rail.stride as f64);
    let astray = vertices.filter(|[_, _, z]| {
        let is_near = |disparity| (z - depth(disparity)).abs() < 0.05 * depth(disparity);
        !is_near(4.0) && !is_near(6.0)
    });
    Came {
        points: count("match", "points"),
        of_map: of_map as f64,
        bad: wrong / known,
        median: medians.iter().sum::<f64>() / medians.len() as f64,
        astray: astray.count() as f64 / of_map as f64,
    }
}

/// Exposures that go up and down by a fifth, from one frame to the next by up to two fifths.
const FLICKER: [f64; 7] = [1.0, 0.8, 1.2, 0.93, 1.14, 0.86, 1.07];

#[test]
fn light_that_flickers_by_a_fifth_costs_a_rail_next_to_no_points_and_no_accuracy() {
    let world = World::new();
    let of = |name: &str, exposure: &dyn Fn(usize) -> f64| {
        let exposures: Vec<f64> = (0..24).map(exposure).collect();
        along(&world, name, &exposures)
    };
    let steady = of("steady", &|_| 1.0);
    assert!(
        steady.points > 20_000.0 && steady.of_map > 2_000.0,
        "{steady:?}"
    );
    assert!(steady.bad < 0.01 && steady.astray < 0.2, "{steady:?}");
    let flickering = of("flickering", &|frame| FLICKER[frame % FLICKER.len()]);
    // A cloud, or a camera that finds its exposure: half of the light goes within the run.
    let dimming = of("dimming", &|frame| 1.0 - frame as f64 / 46.0);
    for (name, lit) in [("flickering", flickering), ("dimming", dimming)] {
        let both = format!("{name}: {lit:?}, steady: {steady:?}");
        assert!(lit.points >= 0.9 * steady.points, "{both}");
        assert!(lit.of_map >= 0.9 * steady.of_map, "{both}");
        // Of few wrong points one more or less says nothing.
        assert!(lit.bad <= 1.2 * steady.bad + 0.0005, "{both}");
        assert!(lit.astray <= 1.2 * steady.astray + 0.0005, "{both}");
        assert!(lit.median <= 1.2 * steady.median, "{both}");
    }
}

#[test]
fn positions_come_from_a_file_and_what_is_wrong_with_it_is_said() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy().into_owned();
    let with = |text: &str| {
        std::fs::write(world.path("encoder.csv"), text).unwrap();
        let mut run = arguments(&source, "x.mcap");
        run.extend(["--force", "--set", "capture.positions=encoder.csv"]);
        world.run(&run)
    };
    let ran = with("position_mm\n0\n10\n20\n").done();
    assert_eq!(ran.json()["balanced"], true, "{ran:?}");
    let info = world.run(&["info", "x.mcap", "--json"]).done().json();
    assert_eq!(info["rig"]["calibration"]["baseline_m"], 0.01, "{info}");
    for (text, said) in [
        (
            "position_mm\n0\n10\n",
            "it says where 2 frames were taken, and there are 3",
        ),
        ("position\n0\n1\n2\n", "must name a column with its unit"),
        ("position_m\n1\n1\n1\n", "the camera does not move"),
    ] {
        let ran = with(text);
        assert_ne!(ran.code, Some(0), "{ran:?}");
        assert!(ran.err.contains(said), "{ran:?}");
        assert_eq!(ran.err.lines().count(), 1, "{ran:?}");
    }
}

#[test]
fn a_rail_passes_one_scene() {
    let world = World::new();
    let ran = world.run(&arguments("scene:all", "x.mcap"));
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(ran.err.contains("choose one of them"), "{ran:?}");
}

#[test]
fn a_rail_whose_matcher_dies_again_and_again_does_not_stand_still() {
    let world = World::new();
    let rail = world
        .small_rail("rail", 0..8)
        .to_string_lossy()
        .into_owned();
    let run = world.start(&[
        "run",
        "--source",
        &rail,
        "--set",
        "capture.mode=rail",
        "--scans",
        "1000000",
        "--no-record",
    ]);
    let scans_done = || {
        let ran = world.run(&["top", "--once", "--json"]);
        let graphs: Option<serde_json::Value> = serde_json::from_str(&ran.out).ok();
        graphs.and_then(|top| top["graphs"][0]["scans_done"].as_u64())
    };
    wait_until("the graph runs", || scans_done() > Some(20));
    for node in ["match", "match", "filter", "match", "map", "match"] {
        let of_name = |(name, _): &(String, u32)| name == node;
        let (_, pid) = world.nodes().into_iter().find(of_name).unwrap();
        signal(pid, "KILL");
        let (before, since) = (scans_done().unwrap_or_default(), Instant::now());
        // A graph that stands still is sent its scans once more after a minute.
        while scans_done() < Some(before + 60) {
            assert!(
                since.elapsed() < Duration::from_secs(25),
                "{node} was killed"
            );
        }
    }
    signal(run.id(), "INT");
    let ran = Ran::new(run.wait_with_output().unwrap()).done();
    assert!(ran.out.contains("; balanced"), "{ran:?}");
}

/// Pixels by which a row of the swaying ground moves for a step to the right: it is nearer further down.
fn pace(row: f64) -> f64 {
    5.0 + row / 100.0
}

/// A folder of frames of a ground, each off by something of its own: up to 0.7 px, and turned and scaled a little.
fn swaying_rail(world: &World, name: &str, frames: usize) -> PathBuf {
    let (width, height) = (320u32, 200u32);
    let size = Size::new(width, height);
    let folder = world.path(name);
    std::fs::create_dir_all(&folder).unwrap();
    let mut state = 9u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24) * 1.4 - 0.7
    };
    for frame in 0..frames {
        let sway = Sway {
            right_px: random(),
            down_px: random(),
            turn: 0.002 * random(),
            scale: 0.002 * random(),
        };
        let mut image = format!("P5\n{width} {height}\n255\n").into_bytes();
        for pixel in 0..width * height {
            let seen = [pixel % width, pixel / width].map(f64::from);
            // Where what is seen here belongs, by a few rounds.
            let mut at = seen;
            for _ in 0..4 {
                let [right, down] = sway.off(size, at[0], at[1]);
                at = [seen[0] - right, seen[1] - down];
            }
            image.push(wave(at[0] + frame as f64 * pace(at[1]), at[1]));
        }
        std::fs::write(folder.join(format!("{frame:03}.pgm")), image).unwrap();
    }
    folder
}

/// The median error of a map's disparities, in pixels, and how many points there are.
fn map_error(recording: &Path) -> (f64, usize) {
    let mut recording = Recording::open(recording).unwrap();
    let rig = recording.metadata().rig.clone();
    let camera = rig.calibration(rig.size);
    let topic = Topic::of(&rig, Kind::Map).remove(0);
    let mut errors = Vec::new();
    for scan in 0..24 {
        let map: Owned<Map> = recording.read(scan, &topic).unwrap();
        errors.extend(map.view().points.iter().map(|point| {
            let row = camera.focal_px * f64::from(point.y) / f64::from(point.z) + camera.cy;
            (f64::from(point.disparity) - pace(row)).abs()
        }));
    }
    errors.sort_by(f64::total_cmp);
    (errors[errors.len() / 2], errors.len())
}

#[test]
fn a_rail_that_sways_is_matched_more_and_its_map_is_twice_as_exact_and_replayed_to_the_byte() {
    let world = World::new();
    let rail = swaying_rail(&world, "rail", 24);
    let source = rail.to_string_lossy().into_owned();
    let mut matched = Vec::new();
    for (file, sway) in [("on.mcap", "null"), ("off.mcap", "false")] {
        let positions: String = (0..24).map(|frame| format!("{}\n", 10 * frame)).collect();
        std::fs::write(world.path("mm.csv"), format!("position_mm\n{positions}")).unwrap();
        let set = format!("capture.sway={sway}");
        let own = [
            "--set",
            "capture.stride=1",
            "--set",
            "capture.positions=mm.csv",
        ];
        let mut run = [&arguments(&source, file)[..], &own].concat();
        if sway == "false" {
            run.extend(["--set", &set]);
        }
        let ran = world.run(&run).done();
        assert_eq!(
            ran.err.contains("the rail sways by 0."),
            sway == "null",
            "{ran:?}"
        );
        let summary = ran.json();
        let nodes = summary["nodes"].as_array().unwrap();
        let of_match = nodes.iter().find(|node| node["node"] == "match").unwrap();
        matched.push(of_match["counts"]["points"].as_u64().unwrap());
        for stage in ["capture", "match", "map"] {
            let verified = ["replay", file, "--from", stage, "--verify", "--json"];
            let report = world.run(&verified).done().json();
            assert_eq!(report["verified"]["equal"], true, "{stage}: {report}");
        }
    }
    let [on, off] = ["on.mcap", "off.mcap"].map(|file| map_error(&world.path(file)));
    assert!(matched[0] > matched[1], "{matched:?}");
    // Where frames are off, some of what is one place is mapped as two.
    assert!(
        10 * on.1 > 9 * off.1 && 2.0 * on.0 < off.0,
        "{on:?} {off:?}"
    );
}

#[test]
fn sway_of_a_rig_is_refused_in_a_sentence() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let ran = world.run(&["run", "--source", &source, "--set", "capture.sway=true"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err
            .contains("capture.sway is of one camera along a rail"),
        "{ran:?}"
    );
    assert_eq!(ran.err.lines().count(), 1, "{ran:?}");
}
