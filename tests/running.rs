//! Looking at a graph that runs: its topics, its nodes, how it is doing, what looking costs.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::io::{Read as _, Write as _};
use std::process::Child;

use harness::terminal::AtTerminal;
use harness::{Ran, World, signal, wait_until};
use serde_json::Value;

/// Starts a graph that runs until it is told to stop, and waits until it does.
fn graph(world: &World) -> Child {
    let before = world.nodes().len();
    let child = world.endless(&["--json"]);
    wait_until("the graph runs", || world.nodes().len() == before + 5);
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
    assert_eq!(topics.len(), 25, "{list}");
    let points = topics.iter().find(|t| t["topic"] == "points").unwrap();
    assert_eq!(points["maker"], "match");
    assert_eq!(points["schema"], "foxglove.PointCloud");
    let tables = topics
        .iter()
        .find(|t| t["topic"] == "tables/left/2.2")
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
        "matches/0.8",
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
    let info = world.run(&["topic", "info", "edges/left/0.8"]).done();
    assert!(
        info.out.contains("made by   filter") && info.out.contains("taken by  track"),
        "{info:?}"
    );
    let wrong = world.run(&["topic", "hz", "pionts"]);
    assert_eq!(wrong.code, Some(2), "{wrong:?}");
    assert!(wrong.err.contains("do you mean points?"), "{}", wrong.err);
    let derived = world.run(&["topic", "echo", "health"]);
    assert_eq!(derived.code, Some(2), "{derived:?}");
    assert!(derived.err.contains("tricurve view"), "{derived:?}");
    ends_balanced(graph);
}

#[test]
fn an_echo_ends_with_who_reads_it() {
    let world = World::new();
    let graph = graph(&world);
    let mut echo = world.start(&["topic", "echo", "points"]);
    let mut read = [0; 10];
    let mut out = echo.stdout.take().unwrap();
    out.read_exact(&mut read).unwrap();
    drop(out);
    let ran = Ran::new(echo.wait_with_output().unwrap()).done();
    assert_eq!(ran.err, "");
    ends_balanced(graph);
}

#[test]
fn when_no_further_one_can_listen_that_is_said_with_how_many_can() {
    let world = World::new();
    let graph = graph(&world);
    world
        .run(&["topic", "echo", "points", "--count", "1"])
        .done();
    let mut listeners = Vec::new();
    let refused = loop {
        let mut echo = world.start(&["topic", "echo", "points"]);
        let mut out = echo.stdout.take().unwrap();
        if out.read(&mut [0; 10]).unwrap() == 0 {
            break Ran::new(echo.wait_with_output().unwrap());
        }
        listeners.push((echo, out));
        assert!(listeners.len() < 20);
    };
    assert_eq!(refused.code, Some(1), "{refused:?}");
    assert!(
        refused.err.contains("a run has room for 6 listeners"),
        "{refused:?}"
    );
    for (mut listener, out) in listeners {
        drop(out);
        listener.wait().unwrap();
    }
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
    for command in [
        &["topic", "list"][..],
        &["node", "list"],
        &["top"],
        &["top", "--once", "--json"],
    ] {
        let ran = world.run(command);
        assert_eq!(ran.code, Some(1), "{ran:?}");
        assert!(
            ran.err.contains("start one with `tricurve run`"),
            "{}",
            ran.err
        );
    }
}

/// The figures of the only graph that `top` shows.
fn only(top: &Value) -> &Value {
    let graphs = top["graphs"].as_array().unwrap();
    assert_eq!(graphs.len(), 1, "{top}");
    &graphs[0]
}

#[test]
fn top_names_every_node_with_sane_figures() {
    let world = World::new();
    let graph = graph(&world);
    world
        .run(&["topic", "echo", "points", "--count", "1"])
        .done();
    let json = world.run(&["top", "--once", "--json"]).done().json();
    let seen = only(&json);
    for (key, most) in [
        ("seconds", 10.0),
        ("triples_per_second", 1e4),
        ("scans_done", 1e6),
    ] {
        let value = seen[key].as_f64().unwrap();
        assert!(value > 0.0 && value < most, "{key}: {seen}");
    }
    assert_eq!(seen["scans_total"], 1_000_000);
    assert_eq!(seen["scans_dropped"], 0);
    assert_eq!(seen["recorder_lag_scans"], Value::Null);
    for (key, value) in [
        ("paused", false),
        ("launcher_silent", false),
        ("ended", false),
    ] {
        assert_eq!(seen[key], value, "{key}: {seen}");
    }
    let nodes = seen["nodes"].as_array().unwrap();
    let names: Vec<&str> = nodes.iter().map(|n| n["node"].as_str().unwrap()).collect();
    assert_eq!(names, ["capture", "filter", "track", "hough", "match"]);
    for node in nodes {
        assert_eq!(node["state"], "running", "{node}");
        assert_eq!((&node["restarts"], &node["drops"]), (&0.into(), &0.into()));
        for (key, most) in [
            ("hz", 1e4),
            ("megabytes_per_second", 1e5),
            ("memory_megabytes", 1e4),
            ("p99_ms", 1e5),
        ] {
            let value = node[key].as_f64().unwrap();
            assert!(value > 0.0 && value < most, "{key}: {node}");
        }
        // Processor time is counted in hundredths of a second.
        let cpu = node["cpu_percent"].as_f64().unwrap();
        assert!((0.0..10_000.0).contains(&cpu), "{node}");
        assert!(node["p50_ms"].as_f64() <= node["p99_ms"].as_f64(), "{node}");
        let queue = node["queue_scans"].as_u64();
        assert_eq!(queue.is_none(), node["node"] == "capture", "{node}");
        assert!(queue.unwrap_or_default() <= 64, "{node}");
    }
    let table = world.run(&["top", "--every", "0.5"]).done().out;
    assert_eq!(table.lines().count(), 8, "{table}");
    assert!(table.contains(" triples/s\n"), "{table}");
    let wrong = world.run(&["top", "--every", "0"]);
    assert_eq!(wrong.code, Some(2), "{wrong:?}");
    ends_balanced(graph);
}

/// A number as the names of runs begin with it.
fn to_base_36(number: u32) -> String {
    let digit = |number: u32| char::from_digit(number % 36, 36).unwrap();
    match number / 36 {
        0 => digit(number).to_string(),
        higher => format!("{}{}", to_base_36(higher), digit(number)),
    }
}

#[test]
fn of_two_graphs_top_shows_both_and_every_command_takes_the_one_that_is_named() {
    let world = World::new();
    let graphs = [graph(&world), graph(&world)];
    let both = world.run(&["top", "--once", "--json"]).done().json();
    assert_eq!(both["graphs"].as_array().unwrap().len(), 2, "{both}");
    // A run's name begins with its launcher's process.
    let begins = graphs
        .each_ref()
        .map(|graph| format!("{}-", to_base_36(graph.id())));
    for begin in &begins {
        let with_name = |arguments: &[&str]| world.run(&[arguments, &["--run", begin]].concat());
        let top = with_name(&["top", "--once", "--json", "--every", "0.5"]).done();
        let run = only(&top.json())["run"].as_str().unwrap().to_owned();
        assert!(run.starts_with(begin), "{run}");
        for arguments in [
            &["topic", "list"][..],
            &["topic", "info", "points"],
            &["topic", "hz", "points", "--seconds", "0.5"],
            &["topic", "echo", "points", "--count", "1"],
            &["node", "list"],
        ] {
            with_name(arguments).done();
        }
    }
    let restart = ["node", "restart", "track", "--run", &begins[1]];
    world.run(&restart).done();
    let restarts = |begin: &str| {
        let list = ["node", "list", "--json", "--run", begin];
        world.run(&list).done().json()[2]["restarts"].clone()
    };
    wait_until("it is there again", || restarts(&begins[1]) == 1);
    assert_eq!(restarts(&begins[0]), 0);
    for arguments in [
        &["topic", "list"][..],
        &["node", "list"],
        &["node", "restart", "track"],
    ] {
        let ran = world.run(arguments);
        assert_eq!(ran.code, Some(2), "{ran:?}");
        assert!(ran.err.contains("choose one with --run, of "), "{ran:?}");
    }
    let wrong = world.run(&["top", "--run", "nobody"]);
    assert_eq!(wrong.code, Some(2), "{wrong:?}");
    assert!(
        wrong.err.contains("no run is called \"nobody\""),
        "{wrong:?}"
    );
    for graph in graphs {
        ends_balanced(graph);
    }
}

#[test]
fn top_gives_the_terminal_back_whatever_ends_it() {
    let world = World::new();
    let graph = graph(&world);
    let start = || {
        let top = AtTerminal::start(&world, &["top", "--every", "0.2"]);
        wait_until("the graph is shown", || top.has_shown("triples/s"));
        assert!(top.takes_keys_raw());
        top
    };
    for keys in ["q", "\x1b", "\x03"] {
        let mut top = start();
        top.keys.write_all(keys.as_bytes()).unwrap();
        top.ends_well();
    }
    let top = start();
    signal(top.program.id(), "TERM");
    top.ends_well();
    // A node is restarted by key, when that is confirmed.
    let mut top = start();
    top.keys.write_all(b"\x1b[Bry").unwrap();
    let nodes = || world.run(&["node", "list", "--json"]).done().json();
    wait_until("it is there again", || nodes()[1]["restarts"] == 1);
    ends_balanced(graph);
    wait_until("that is said", || top.has_shown(" has ended"));
    top.ends_well();
}

/// What a short bench of a small scene finds.
fn bench(world: &World, what: &str) -> Value {
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let bench = [
        "bench", what, "--scans", "3", "--rounds", "1", "--source", &source, "--json",
    ];
    world.run(&bench).done().json()
}

#[test]
fn a_bench_compares_the_graph_with_and_without_observers() {
    let world = World::new();
    let json = bench(&world, "--observers");
    let rows = json["rows"].as_array().unwrap();
    let observers: Vec<&str> = rows
        .iter()
        .map(|row| row["observers"].as_str().unwrap())
        .collect();
    assert_eq!(
        observers,
        ["none", "recorder", "viewer", "recorder and viewer"]
    );
    for row in rows.iter().chain([&json["bridge_alone"]]) {
        let rate = &row["triples_per_second"];
        assert!(rate["median"].as_f64() > Some(0.0), "{row}");
        assert!(row["ratio"]["median"].as_f64() > Some(0.0), "{row}");
    }
    assert_eq!(rows[0]["ratio"]["median"], 1.0);
    for row in &rows[2..] {
        let viewer = &row["viewer"];
        assert!(viewer["channels"].as_u64() > Some(35), "{row}");
        assert!(viewer["messages"].as_u64() > Some(35), "{row}");
        assert!(viewer["megabytes"].as_f64() > Some(0.1), "{row}");
    }
    assert!(rows[1]["recorded_megabytes"].as_f64() > Some(0.1));
    assert!(
        !world.path("recordings").exists(),
        "it leaves nothing behind"
    );
    let wrong = world.run(&["bench"]);
    assert_eq!(wrong.code, Some(2), "{wrong:?}");
    assert!(wrong.err.contains("--observers"), "{wrong:?}");
}

#[test]
fn a_bench_compares_numbers_of_instances_and_predicts_more_cores() {
    let world = World::new();
    let json = bench(&world, "--instances");
    let rows = json["rows"].as_array().unwrap();
    let instances = |row: &Value| row["instances"].as_str().unwrap().to_owned();
    assert_eq!(instances(&rows[0]), "1");
    assert_eq!(instances(rows.last().unwrap()), "auto");
    for row in rows {
        assert!(
            row["triples_per_second"]["median"].as_f64() > Some(0.0),
            "{row}"
        );
        let [p50, p99] = ["latency_p50_ms", "latency_p99_ms"].map(|key| row[key].as_f64());
        assert!(p50 > Some(0.0) && p99 >= p50, "{row}");
        assert!(row["limit_per_second"].as_f64() > Some(0.0), "{row}");
    }
    assert_eq!(rows[1]["stages"]["match"], 2, "{json}");
    let cores: Vec<_> = json["predicted"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| &row["cores"])
        .collect();
    assert_eq!(cores, [4, 8, 16]);
}
