//! Recordings and running graphs for viewers, as far as it needs no viewer; `tests/viewers.py` is one.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};

use harness::terminal::AtTerminal;
use harness::{Ran, World, signal, wait_until};
use serde_json::{Value, json};

#[test]
fn a_recording_has_all_that_the_layout_shows_and_so_has_a_running_graph() {
    let world = World::recorded("4");
    let check = world.run(&["view", "x.mcap", "--check", "--json"]).done();
    assert_eq!(check.json()["missing"], serde_json::json!([]), "{check:?}");
    // A folder of images knows no truth.
    assert_eq!(check.json()["without_truth"].as_array().unwrap().len(), 2);
    let graph = world.endless(&[]);
    wait_until("the graph runs", || world.nodes().len() == 5);
    let check = world.run(&["view", "--check", "--json"]).done();
    assert_eq!(check.json()["missing"], serde_json::json!([]), "{check:?}");
    signal(graph.id(), "INT");
    Ran::new(graph.wait_with_output().unwrap()).done();
}

#[test]
fn a_graph_with_other_channels_has_all_that_its_own_layout_shows() {
    let world = World::new();
    let graph = world.endless(&["--profile", "thesis"]);
    wait_until("the graph runs", || world.nodes().len() == 5);
    world.run(&["view", "--check"]).done();
    signal(graph.id(), "INT");
    Ran::new(graph.wait_with_output().unwrap()).done();
}

#[test]
fn what_the_layout_shows_and_a_recording_lacks_is_told_by_panel_and_topic() {
    let world = World::recorded("3");
    let without = [
        "filter",
        "x.mcap",
        "--topics",
        "camera/*,health,log",
        "-o",
        "y.mcap",
    ];
    world.run(&without).done();
    let check = world.run(&["view", "y.mcap", "--check"]);
    assert_eq!(check.code, Some(3), "{check:?}");
    for missing in [
        "3D!space shows the topic points",
        "Image!disparity shows the topic disparity/picture",
        "Plot!latency shows the topic statistics",
    ] {
        assert!(check.err.contains(missing), "{missing}: {check:?}");
    }
    assert!(!check.err.contains("camera/left/annotations"), "{check:?}");
}

#[test]
fn a_layout_of_ones_own_fails_the_check_for_a_strange_panel_a_missing_field_and_an_empty_panel() {
    let world = World::recorded("6");
    for viewer in ["foxglove", "lichtblick"] {
        let made = world
            .run(&["view", "x.mcap", "--layout", "--for", viewer])
            .done();
        let layout: Value = serde_json::from_str(&made.out).unwrap();
        let check = |layout: &Value| {
            fs::write(world.path("own.json"), layout.to_string()).unwrap();
            let check = format!("--check={}", world.path("own.json").display());
            world.run(&["view", "x.mcap", &check, "--for", viewer])
        };
        check(&layout).done();
        let fails = |what: &str, change: &dyn Fn(&mut Value)| {
            let mut layout = layout.clone();
            change(&mut layout);
            let check = check(&layout);
            assert_eq!(check.code, Some(3), "{what}: {check:?}");
            assert!(check.err.contains(what), "{what}: {check:?}");
        };
        fails("TeleopLidar!a is a panel that", &|layout| {
            layout["configById"]["TeleopLidar!a"] = json!({ "topicPath": "points" });
        });
        fails("has no such field", &|layout| {
            let path = r#""matches/0.8".matches[0].speed"#;
            layout["configById"]["Plot!a"] = json!({ "paths": [{ "value": path }] });
        });
        fails("Plot!a shows nothing", &|layout| {
            layout["configById"]["Plot!a"] = json!({ "paths": [] });
        });
        fails("Tab!a shows nothing", &|layout| {
            layout["configById"]["Tab!a"] = json!({ "activeTabIdx": 0, "tabs": [] });
        });
        // A place in the tree for which there are no settings.
        fails("Image!a shows nothing", &|layout| {
            let tree = layout["layout"].take();
            layout["layout"] = json!({ "first": tree, "second": "Image!a", "direction": "row" });
        });
    }
}

#[test]
fn a_port_that_is_taken_is_told_with_what_to_change() {
    let world = World::recorded("2");
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let view = world.run(&["view", "x.mcap", "--port", &port]);
    assert_eq!(view.code, Some(1), "{view:?}");
    assert!(
        view.err
            .contains(&format!("port {port} of 127.0.0.1 is taken")),
        "{view:?}"
    );
    assert!(view.err.contains("--port"), "{view:?}");
    let scene = world.path("scene").to_string_lossy().into_owned();
    let set = format!("bridge.port={port}");
    let run = [
        "run",
        "--source",
        &scene,
        "--no-record",
        "--view",
        "--set",
        &set,
    ];
    let run = world.run(&run);
    assert_eq!(run.code, Some(1), "{run:?}");
    assert!(
        run.err.contains("is taken") && run.err.contains("bridge.port"),
        "{run:?}"
    );
    // Of what never began there is nothing more to say.
    assert_eq!(run.out, "", "{run:?}");
    assert!(!run.err.contains("no curve was found"), "{run:?}");
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn a_view_listens_until_it_is_told_to_end() {
    let world = World::recorded("2");
    let wrong = world.run(&["view", "x.mcap", "--host", "no such host"]);
    assert_eq!(wrong.code, Some(2), "{wrong:?}");
    assert!(wrong.err.contains("expected an address"), "{wrong:?}");
    let mut view = world.start(&["view", "x.mcap", "--port", "0", "--host", "localhost"]);
    let lines = BufReader::new(view.stdout.take().unwrap()).lines();
    let server = lines
        .map_while(Result::ok)
        .find_map(|line| Some(line.trim().strip_prefix("server")?.trim().to_owned()))
        .unwrap();
    let address = server.strip_prefix("ws://").unwrap();
    assert!(address.starts_with("127.0.0.1:"), "{address}");
    TcpStream::connect(address).unwrap();
    signal(view.id(), "INT");
    assert!(view.wait().unwrap().success());
}

#[test]
fn a_view_that_others_may_see_says_how_they_come_to_it() {
    let world = World::recorded("2");
    let start = ["view", "x.mcap", "--port", "0", "--host", "0.0.0.0"];
    let mut view = world.start(&start);
    let lines = BufReader::new(view.stdout.take().unwrap()).lines();
    let said: Vec<String> = lines.map_while(Result::ok).take(10).collect();
    signal(view.id(), "INT");
    assert!(view.wait().unwrap().success());
    let line = |with: &str| said.iter().find(|line| line.contains(with));
    let port = line("  server").unwrap().rsplit(':').next().unwrap();
    let here = format!("  server      ws://localhost:{port}");
    assert_eq!(line("  server"), Some(&here));
    assert!(
        line("elsewhere").unwrap().contains("in a desktop viewer"),
        "{said:?}"
    );
    assert!(
        line(&format!("ssh -L {port}:localhost:{port} ")).is_some(),
        "{said:?}"
    );
}

#[test]
fn a_run_goes_on_without_its_bridge_and_comes_back_with_one() {
    let world = World::new();
    let graph = world.endless(&["--view", "--set", "bridge.port=0", "--json"]);
    let bridge = || world.nodes().into_iter().find(|(name, _)| name == "bridge");
    wait_until("the bridge is there", || world.nodes().len() == 6);
    let hears = ["topic", "echo", "points", "--count", "1"];
    world.run(&hears).done();
    let (_, before) = bridge().unwrap();
    signal(before, "KILL");
    wait_until("another bridge is there", || {
        bridge().is_some_and(|(_, now)| now != before)
    });
    world.run(&hears).done();
    signal(graph.id(), "INT");
    let ran = Ran::new(graph.wait_with_output().unwrap()).done();
    assert_eq!(ran.json()["balanced"], true, "{ran:?}");
}

#[test]
fn keys_play_a_recording_that_is_viewed_and_say_what_it_does() {
    let world = World::recorded("4");
    let mut view = AtTerminal::start(&world, &["view", "x.mcap", "--port", "0"]);
    wait_until("it waits for a viewer", || {
        view.has_shown("begins to play when a viewer subscribes")
    });
    assert!(view.takes_keys_raw());
    for (keys, said) in [
        (" ", "paused: scan 1 of 4, 0.0 of "),
        ("\x1b[C", "paused: scan 2 of 4, "),
        ("\x1b[C", "paused: scan 3 of 4, "),
        ("\x1b[D", "paused: scan 2 of 4, "),
        ("\x1b[A", "s, rate 2"),
        ("\x1b[B\x1b[B", "s, rate 0.5"),
        (" ", "playing: scan 2 of 4, "),
    ] {
        view.keys.write_all(keys.as_bytes()).unwrap();
        wait_until(said, || view.has_shown(said));
    }
    view.keys.write_all(b"q").unwrap();
    view.ends();
}
