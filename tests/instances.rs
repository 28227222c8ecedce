//! Stages in several instances: the same messages as of one, whoever of them dies.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::process::Child;

use harness::{Ran, World, bytes_of, signal, wait_until};
use messages::recording::Recording;

/// Stages in so many instances.
const SPLIT: [&[&str]; 3] = [
    &["--set", "match.instances=2"],
    &[
        "--set",
        "filter.instances=3",
        "--set",
        "track.instances=2",
        "--set",
        "hough.instances=3",
        "--set",
        "match.instances=3",
    ],
    &[
        "--set",
        "filter.instances=5",
        "--set",
        "track.instances=5",
        "--set",
        "hough.instances=2",
        "--set",
        "match.instances=5",
        "--set",
        "evaluate.instances=5",
    ],
];

/// What was made of each scan: topic and message.
fn made(world: &World, name: &str) -> Vec<Vec<(String, Vec<u8>)>> {
    let mut recording = Recording::open(&world.path(name)).unwrap();
    assert!(recording.is_complete(), "{:?}", recording.notes());
    let scans: Vec<u64> = recording.whole_scans();
    // What is measured while it runs differs from run to run.
    let is_measured = |topic: &str| ["statistics", "ledger", "health", "log"].contains(&topic);
    let mut made = Vec::new();
    for scan in scans {
        let read = recording.scan(scan).unwrap();
        let messages = read.messages().filter(|(topic, _)| !is_measured(topic));
        let mut messages: Vec<(String, Vec<u8>)> = messages
            .map(|(topic, bytes)| (topic.to_owned(), bytes.to_vec()))
            .collect();
        messages.sort();
        made.push(messages);
        recording.reuse(read);
    }
    made
}

#[test]
fn recordings_of_any_number_of_instances_hold_the_same_messages() {
    let world = World::new();
    let run = |name: &str, more: &[&str]| {
        let run = [
            "run",
            "--source",
            "scene:tab",
            "--scans",
            "7",
            "--set",
            "capture.start=1",
            "--json",
            "--record",
            name,
        ];
        let ran = world.run(&[&run, more].concat()).done();
        assert_eq!(ran.json()["balanced"], true, "{ran:?}");
        made(&world, name)
    };
    let one = run("one.mcap", &[]);
    assert_eq!(one.len(), 7);
    assert!(one.iter().all(|scan| scan.len() > 20));
    for (number, split) in SPLIT.iter().enumerate() {
        assert!(run(&format!("{number}.mcap"), split) == one, "{split:?}");
    }
    let verify = [&["replay", "0.mcap", "--verify", "--json"], SPLIT[1]].concat();
    let ran = world.run(&verify).done();
    assert_eq!(ran.json()["verified"]["equal"], true, "{ran:?}");
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

/// Starts a recorded graph of many instances, and waits until it is under way.
fn start(world: &World, scans: &str, file: &str) -> Child {
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run", "--source", &source, "--scans", scans, "--record", file, "--json",
    ];
    let child = world.start(&[&run, SPLIT[1]].concat());
    wait_until("scans are recorded", || {
        bytes_of(&world.path(file)) > 1_000_000
    });
    child
}

fn pid_of(world: &World, node: &str) -> u32 {
    let nodes = world.nodes();
    nodes.iter().find(|(name, _)| name == node).unwrap().1
}

#[test]
fn instances_that_are_killed_are_restarted_and_every_scan_is_there_once() {
    let world = World::new();
    let child = start(&world, "400", "x.mcap");
    for node in ["track.2", "match.3", "filter", "hough.2", "match"] {
        signal(pid_of(&world, node), "KILL");
        let before = bytes_of(&world.path("x.mcap"));
        wait_until("it goes on", || {
            bytes_of(&world.path("x.mcap")) > before + 300_000
        });
    }
    let ran = Ran::new(child.wait_with_output().unwrap()).done();
    let summary = ran.json();
    assert_eq!(summary["balanced"], true, "{ran:?}");
    let nodes = summary["nodes"].as_array().unwrap();
    let restarted = nodes.iter().filter(|node| node["restarts"] == 1);
    assert_eq!(restarted.count(), 5, "{ran:?}");
    assert_eq!(made(&world, "x.mcap").len(), 400);
    let verify = ["replay", "x.mcap", "--verify", "--json"];
    let verified = world.run(&verify).done().json();
    assert_eq!(verified["verified"]["scans"], 400, "{verified}");
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn a_recorder_beside_several_instances_gets_every_scan_in_order_and_one_is_restarted_by_its_name() {
    let world = World::new();
    let graph = start(&world, "1000000", "own.mcap");
    let ran = world.run(&["node", "restart", "match.2"]).done();
    assert!(ran.out.contains("match.2 ends"), "{ran:?}");
    let beside = world.start(&["record", "-o", "beside.mcap", "--json"]);
    wait_until("it records", || {
        bytes_of(&world.path("beside.mcap")) > 3_000_000
    });
    signal(beside.id(), "INT");
    let ran = Ran::new(beside.wait_with_output().unwrap());
    assert!(matches!(ran.code, Some(0 | 3)), "{ran:?}");
    assert_eq!(ran.json()["missed"] == 0, ran.code == Some(0), "{ran:?}");
    let mut recording = Recording::open(&world.path("beside.mcap")).unwrap();
    let scans: Vec<u64> = recording.scans().collect();
    assert!(scans.len() > 5 && scans.is_sorted(), "{scans:?}");
    assert_eq!(recording.whole_scans(), scans);
    recording.scan(scans[0]).unwrap();
    signal(graph.id(), "INT");
    let ran = Ran::new(graph.wait_with_output().unwrap()).done();
    assert_eq!(ran.json()["balanced"], true, "{ran:?}");
}

#[test]
fn along_a_rail_and_of_other_nodes_several_instances_are_refused_in_a_sentence() {
    let world = World::new();
    let frames = world.small_rail("frames", 0..6);
    let source = frames.to_string_lossy();
    let run = ["run", "--source", &source, "--rail", "--no-record"];
    let ran = world.run(&[&run, SPLIT[0]].concat());
    assert_eq!(ran.code, Some(2), "{ran:?}");
    let told = "match.instances is 2, and along a rail every stage takes one frame after the other: leave it at 1";
    assert!(ran.err.contains(told), "{}", ran.err);
    let ran = world.run(&["run", "--set", "record.instances=2"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("record has no key instances"),
        "{}",
        ran.err
    );
}
