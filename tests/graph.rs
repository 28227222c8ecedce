//! The whole graph: what goes in comes out, once, and the same every time.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::collections::BTreeMap;
use std::path::Path;

use harness::{Ran, World};

/// Every message of the data topics, by topic and scan.
fn messages(path: &Path) -> BTreeMap<(String, u32), Vec<u8>> {
    let file = std::fs::read(path).unwrap();
    let mut all = BTreeMap::new();
    for message in mcap::MessageStream::new(&file).unwrap() {
        let message = message.unwrap();
        let topic = message.channel.topic.clone();
        // These carry wall-clock figures.
        if !["statistics", "ledger", "log"].contains(&topic.as_str()) {
            let key = (topic, message.sequence);
            assert_eq!(message.log_time, message.publish_time);
            assert!(
                all.insert(key.clone(), message.data.into_owned()).is_none(),
                "{key:?} twice"
            );
        }
    }
    all
}

#[test]
fn two_runs_with_the_same_start_give_the_same_bytes_on_every_data_topic() {
    let world = World::new();
    let scene = world.small_scene("scene");
    for name in ["a.mcap", "b.mcap"] {
        let source = scene.to_string_lossy();
        let start = "capture.start=1700000000000000000";
        world
            .run(&[
                "run", "--source", &source, "--scans", "12", "--record", name, "--set", start,
            ])
            .done();
    }
    let (a, b) = (
        messages(&world.path("a.mcap")),
        messages(&world.path("b.mcap")),
    );
    assert!(a.len() > 12 * 30, "{}", a.len());
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (key, bytes) in &a {
        assert_eq!(bytes, &b[key], "{key:?}");
    }
}

#[test]
fn two_graphs_run_at_once_without_meeting() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let start = |name| {
        world.start(&[
            "run", "--source", &source, "--scans", "40", "--record", name, "--json",
        ])
    };
    let both = ["a.mcap", "b.mcap"].map(start);
    for child in both {
        let ran = Ran::new(child.wait_with_output().unwrap()).done();
        assert_eq!(ran.json()["ledger"]["done"], 40, "{ran:?}");
        assert_eq!(ran.json()["balanced"], true, "{ran:?}");
    }
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn a_recording_says_what_it_holds_and_gives_its_points() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    world
        .run(&[
            "run", "--source", &source, "--scans", "3", "--record", "x.mcap",
        ])
        .done();
    let info = world.run(&["info", "x.mcap", "--json"]).done().json();
    assert_eq!(info["complete"], true, "{info}");
    world
        .run(&[
            "export", "x.mcap", "--scan", "1", "--csv", "x.csv", "--pfm", "x.pfm", "--ply",
            "x.ply", "--png", "pictures",
        ])
        .done();
    let csv = std::fs::read_to_string(world.path("x.csv")).unwrap();
    let mut lines = csv.lines();
    assert_eq!(
        lines.next(),
        Some("scan,view,channel,curve,x,y,disparity,score,depth")
    );
    let disparities: Vec<f64> = lines
        .map(|line| line.split(',').nth(6).unwrap().parse().unwrap())
        .collect();
    assert!(disparities.len() > 200, "{}", disparities.len());
    let wrong = disparities
        .iter()
        .filter(|d| (**d - 4.0).abs() > 0.5)
        .count();
    assert_eq!(wrong, 0, "of {}", disparities.len());
    assert!(harness::bytes_of(&world.path("x.pfm")) > 160 * 120 * 4);
    assert!(std::fs::read_dir(world.path("pictures")).unwrap().count() >= 3);
}

#[test]
fn of_ten_thousand_points_of_the_rendered_scenes_at_most_one_is_off_by_over_two_pixels() {
    let world = World::new();
    let scenes = ["tab", "jack", "screwdriver"];
    world
        .run(&[
            "run",
            "--source",
            "scene:all",
            "--scans",
            "3",
            "--record",
            "x.mcap",
        ])
        .done();
    world.run(&["export", "x.mcap", "--csv", "x.csv"]).done();
    let settings = capture::Settings::default();
    let source = capture::Source::open(&settings).unwrap();
    let csv = std::fs::read_to_string(world.path("x.csv")).unwrap();
    let truths: Vec<_> = (0..3)
        .map(|scan| source.truth(scan, 0).unwrap().unwrap())
        .collect();
    let size = source.size();
    let (width, height) = (size.width as usize, size.height as usize);
    let (mut counts, mut wrong) = ([0; 3], Vec::new());
    for line in csv.lines().skip(1) {
        let fields: Vec<f64> = line
            .split(',')
            .map(|f| f.parse().unwrap_or(f64::NAN))
            .collect();
        let (scan, x, y, disparity) = (fields[0] as usize, fields[4], fields[5], fields[6]);
        // An edge at an occlusion may belong to either side: the nearest truth within two pixels counts.
        let near = |at: f64, k: i32, len: usize| {
            (at.round() + f64::from(k)).clamp(0.0, len as f64 - 1.0) as usize
        };
        let nearest = (-2..=2)
            .flat_map(|down| {
                (-2..=2).map(move |right| (near(x, right, width), near(y, down, height)))
            })
            .map(|(column, row)| {
                (disparity - f64::from(truths[scan].disparity[row * width + column])).abs()
            })
            .fold(f64::INFINITY, f64::min);
        if nearest > 2.0 {
            wrong.push(format!(
                "{}: off by {nearest:.2} px at ({x:.1}, {y:.1})",
                scenes[scan]
            ));
        }
        counts[scan] += 1;
    }
    let all: usize = counts.iter().sum();
    assert!(
        10_000 * wrong.len() <= all,
        "{} of {counts:?}: {wrong:#?}",
        wrong.len()
    );
    assert!(counts.iter().all(|&points| points > 2000), "{counts:?}");
}

#[test]
fn live_delivery_drops_whole_scans_and_counts_them() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let ran = world
        .run(
            &[
                "run",
                "--source",
                &source,
                "--scans",
                "300",
                "--no-record",
                "--delivery",
                "live",
                "--json",
            ]
            .into_iter()
            .chain(["--set", "capture.rate=5000", "--set", "capture.in_flight=1"])
            .collect::<Vec<_>>(),
        )
        .done();
    let ledger = &ran.json()["ledger"];
    let (admitted, done) = (
        ledger["admitted"].as_u64().unwrap(),
        ledger["done"].as_u64().unwrap(),
    );
    let refused: u64 = ledger["refused"]
        .as_object()
        .unwrap()
        .values()
        .map(|n| n.as_u64().unwrap())
        .sum();
    assert_eq!(admitted, done);
    assert_eq!(admitted + refused, 300);
    assert!(refused > 0, "{ledger}");
}
