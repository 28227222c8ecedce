//! Looking at a graph that runs: its topics, its nodes.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::process::Child;

use harness::{Ran, World, signal, wait_until};

/// Starts a graph that runs until it is told to stop, and waits until it does.
fn graph(world: &World) -> Child {
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run",
        "--source",
        &source,
        "--scans",
        "1000000",
        "--no-record",
        "--json",
    ];
    let child = world.start(&run);
    wait_until("the graph runs", || world.nodes().len() == 5);
    child
}

fn ends_balanced(graph: Child) {
    signal(graph.id(), "INT");
    let ran = Ran::new(graph.wait_with_output().unwrap()).done();
    assert_eq!(ran.json()["balanced"], true, "{ran:?}");
}

#[test]
fn topics_are_listed_measured_and_printed_while_the_graph_runs() {
    let world = World::new();
    let graph = graph(&world);
    let list = world.run(&["topic", "list", "--json"]).done().json();
    let topics = list.as_array().unwrap();
    assert_eq!(topics.len(), 35, "{list}");
    let points = topics.iter().find(|t| t["topic"] == "points").unwrap();
    assert_eq!(points["maker"], "match");
    assert_eq!(points["schema"], "foxglove.PointCloud");
    let tables = topics
        .iter()
        .find(|t| t["topic"] == "tables/left/4")
        .unwrap();
    assert_eq!(tables["takers"], serde_json::json!(["match"]));
    let hz = ["topic", "hz", "points", "--seconds", "3", "--json"];
    let rate = world.run(&hz).done().json();
    assert!(
        rate["messages"].as_u64() > Some(1) && rate["hz"].as_f64() > Some(0.5),
        "{rate}"
    );
    assert!(rate["megabytes_per_second"].as_f64() > Some(0.0), "{rate}");
    let echo = [
        "topic",
        "echo",
        "matches/1",
        "--count",
        "2",
        "--elements",
        "1",
        "--json",
    ];
    let ran = world.run(&echo).done();
    let lines: Vec<serde_json::Value> = ran
        .out
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 2, "{ran:?}");
    assert!(lines[0]["scan"].as_u64() < lines[1]["scan"].as_u64());
    assert_eq!(lines[0]["sections"][0]["name"], "matches");
    assert_eq!(
        lines[0]["sections"][0]["first"].as_array().unwrap().len(),
        1
    );
    let info = world.run(&["topic", "info", "edges/left/1"]).done();
    assert!(
        info.out.contains("made by   filter") && info.out.contains("taken by  track"),
        "{info:?}"
    );
    let wrong = world.run(&["topic", "hz", "pionts"]);
    assert_eq!(wrong.code, Some(2), "{wrong:?}");
    assert!(wrong.err.contains("do you mean points?"), "{}", wrong.err);
    ends_balanced(graph);
}

#[test]
fn a_node_that_is_restarted_by_hand_loses_nothing() {
    let world = World::new();
    let graph = graph(&world);
    // Nothing is restarted before the graph has begun.
    world
        .run(&["topic", "echo", "points", "--count", "1"])
        .done();
    let nodes = || world.run(&["node", "list", "--json"]).done().json();
    let names: Vec<String> = nodes()
        .as_array()
        .unwrap()
        .iter()
        .map(|node| node["node"].as_str().unwrap().to_owned())
        .collect();
    assert_eq!(names, ["capture", "filter", "track", "hough", "match"]);
    world.run(&["node", "restart", "track"]).done();
    wait_until("it is there again", || nodes()[2]["restarts"] == 1);
    assert!(nodes()[2]["memory_bytes"].as_u64() > Some(100_000));
    let wrong = world.run(&["node", "restart", "trak"]);
    assert_eq!(wrong.code, Some(2), "{wrong:?}");
    assert!(
        wrong.err.contains("it has capture, filter"),
        "{}",
        wrong.err
    );
    ends_balanced(graph);
}

#[test]
fn without_a_graph_that_is_said() {
    let world = World::new();
    for command in [["topic", "list"], ["node", "list"]] {
        let ran = world.run(&command);
        assert_eq!(ran.code, Some(1), "{ran:?}");
        assert!(
            ran.err.contains("start one with `tricurve run`"),
            "{}",
            ran.err
        );
    }
}
