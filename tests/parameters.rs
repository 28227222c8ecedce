//! Parameters that are set while a graph runs: from which scan on they hold, and that a recording says so.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::process::Child;

use harness::{Ran, World, signal, wait_until};
use messages::recording::Recording;
use serde_json::Value;

/// Starts a graph that records until it is told to stop, and waits until scans are done.
fn graph(world: &World) -> Child {
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run", "--source", &source, "--scans", "1000000", "--record", "x.mcap", "--json",
    ];
    let child = world.start(&run);
    wait_until("scans are recorded", || {
        harness::bytes_of(&world.path("x.mcap")) > 4_000_000
    });
    child
}

/// Sets a parameter, and says from which scan on it holds.
fn set(world: &World, what: &str) -> u64 {
    let said = world.run(&["param", "set", what]).done().out;
    let from = said.trim().strip_prefix("it holds from scan ").unwrap();
    from.strip_suffix(" on").unwrap().parse().unwrap()
}

fn end(graph: Child) -> Ran {
    signal(graph.id(), "INT");
    Ran::new(graph.wait_with_output().unwrap()).done()
}

/// Matches of all channels in a scan of a recording, as its statistics say.
fn matches(world: &World, name: &str, scans: std::ops::Range<u64>) -> Vec<u64> {
    let mut recording = Recording::open(&world.path(name)).unwrap();
    let count = |scan| {
        let scan = recording
            .scan_of(scan, |topic| topic == "statistics")
            .unwrap();
        let statistics: Value =
            serde_json::from_slice(scan.message("statistics").unwrap()).unwrap();
        statistics["matches"].as_u64().unwrap()
    };
    scans.map(count).collect()
}

fn wait_for_more(world: &World) {
    let before = harness::bytes_of(&world.path("x.mcap"));
    wait_until("more scans are recorded", || {
        harness::bytes_of(&world.path("x.mcap")) > before + 4_000_000
    });
}

#[test]
fn a_parameter_holds_from_one_scan_on_and_the_recording_verifies() {
    let world = World::new();
    let graph = graph(&world);
    let points = world.run(&["param", "get", "track.min_points"]).done().out;
    let from = set(&world, "track.min_points=60");
    wait_for_more(&world);
    let back = set(&world, &format!("track.min_points={}", points.trim()));
    wait_for_more(&world);
    end(graph);
    assert!(0 < from && from < back, "{from} {back}");
    let all = matches(&world, "x.mcap", 0..back + 1);
    let (before, between) = all.split_at(from as usize);
    // The scene stands still: every scan of a setting has the same matches.
    assert!(
        before.iter().all(|count| count == &before[0] && *count > 0),
        "{all:?}"
    );
    let (between, after) = between.split_at((back - from) as usize);
    assert!(between.iter().all(|count| count < &before[0]), "{all:?}");
    assert_eq!(after[0], before[0]);
    let changes = Recording::open(&world.path("x.mcap")).unwrap().changes();
    assert_eq!(
        changes.iter().map(|c| c.from).collect::<Vec<_>>(),
        [from, back]
    );
    // Whoever looks at the recording is told so.
    let info = world.run(&["info", "x.mcap", "--json"]).done().json();
    assert_eq!(info["changes"][1]["from"], back, "{info}");
    let info = world.run(&["info", "x.mcap"]).done().out;
    let told = format!("changed       track.min_points is 60 from scan {from} on");
    assert!(info.contains(&told), "{info}");
    world
        .run(&["report", "x.mcap", "--scans", "0..1", "-o", "x.html"])
        .done();
    let page = std::fs::read_to_string(world.path("x.html")).unwrap();
    assert!(page.contains("Settings were changed 2 times"), "{page}");
    assert!(page.contains(&format!(
        "<tr><td class=\"n\">{from}</td><td class=\"mono\">track.min_points</td>"
    )));
    let verify = ["replay", "x.mcap", "--verify", "--json"];
    assert_eq!(world.run(&verify).done().json()["verified"]["equal"], true);
    // From a scan in the middle too, and of a part of it.
    let middle = format!("{}..{}", from.saturating_sub(2), back + 2);
    for stage in ["filter", "match"] {
        let verify = [
            "replay", "x.mcap", "--from", stage, "--scans", &middle, "--verify", "--json",
        ];
        assert_eq!(world.run(&verify).done().json()["verified"]["equal"], true);
    }
    let split = ["split", "x.mcap", "--scans", "40", "-o", "parts.mcap"];
    world.run(&split).done();
    let verify = ["replay", "parts.mcap", "--verify", "--json"];
    assert_eq!(world.run(&verify).done().json()["verified"]["equal"], true);
    let cut = format!("{from}..{back}");
    // What is set on the command line holds throughout.
    let points = format!("track.min_points={}", points.trim());
    let replay = [
        "replay", "x.mcap", "--scans", &cut, "--set", &points, "--record", "y.mcap",
    ];
    world.run(&replay).done();
    assert_eq!(matches(&world, "y.mcap", 0..1), [before[0]]);
    let error = world.run(&["replay", "x.mcap", "--loop"]);
    assert_eq!(error.code, Some(2), "{error:?}");
    assert!(
        error.err.contains("cannot be played in a loop"),
        "{error:?}"
    );
}

#[test]
fn nodes_that_die_know_what_was_changed_when_they_come_back() {
    let world = World::new();
    let graph = graph(&world);
    for (node, what) in [
        ("match", "match.curves.score=1.0"),
        ("capture", "track.length=12"),
        ("record", "match.curves.score=0.5"),
        ("track", "match.curves.score=0.9"),
    ] {
        let nodes = world.nodes();
        let (_, pid) = nodes.iter().find(|(name, _)| name == node).unwrap();
        signal(*pid, "KILL");
        let what = match what.starts_with("track") {
            true => parameter_of_track(&world),
            false => what.to_owned(),
        };
        set(&world, &what);
        wait_until("the node is back", || world.nodes().len() == 6);
    }
    wait_until("another part is recorded", || {
        harness::bytes_of(&world.path("x.1.mcap")) > 4_000_000
    });
    end(graph);
    let recording = Recording::open(&world.path("x.mcap")).unwrap();
    assert_eq!(recording.changes().len(), 4);
    let verify = ["replay", "x.mcap", "--verify", "--json"];
    assert_eq!(world.run(&verify).done().json()["verified"]["equal"], true);
}

/// A setting of track that takes a number, one more than it is.
fn parameter_of_track(world: &World) -> String {
    let list = world.run(&["param", "list", "--json"]).done().json();
    let is_count = |p: &&Value| {
        p["name"].as_str().unwrap().starts_with("track.") && p["value"].as_u64().is_some()
    };
    let parameters = list.as_array().unwrap();
    let parameter = parameters.iter().find(is_count).unwrap();
    let name = parameter["name"].as_str().unwrap();
    format!("{name}={}", parameter["value"].as_u64().unwrap() + 1)
}

#[test]
fn what_no_scan_of_a_recording_was_made_with_is_not_in_it() {
    let world = World::new();
    let graph = graph(&world);
    let from = set(&world, "track.min_points=60");
    wait_for_more(&world);
    end(graph);
    let before = format!("0..{from}");
    let filter = ["filter", "x.mcap", "--scans", &before, "-o", "before.mcap"];
    world.run(&filter).done();
    let changes = |name: &str| Recording::open(&world.path(name)).unwrap().changes();
    assert_eq!(changes("before.mcap"), []);
    let after = format!("{from}..{}", from + 2);
    let filter = ["filter", "x.mcap", "--scans", &after, "-o", "after.mcap"];
    world.run(&filter).done();
    assert_eq!(changes("after.mcap").len(), 1);
    // What holds for all scans holds in every round.
    for name in ["before.mcap", "after.mcap"] {
        let replay = world.start(&["replay", name, "--loop", "--json"]);
        let hears = ["topic", "echo", "points", "--count", "1"];
        wait_until("it plays", || world.run(&hears).code == Some(0));
        end(replay);
    }
}

/// A graph that nothing records, which viewers could look at.
fn graph_with_a_bridge(world: &World, set: &str) -> Child {
    let child = world.endless(&["--view", "--set", "bridge.port=0", "--set", set]);
    wait_until("the graph runs", || {
        let hears = ["topic", "echo", "points", "--count", "1"];
        world.nodes().len() == 6 && world.run(&hears).code == Some(0)
    });
    child
}

/// The process of a node.
fn pid_of(world: &World, node: &str) -> u32 {
    let nodes = world.nodes();
    let found = nodes.iter().find(|(name, _)| name == node);
    found.unwrap().1
}

#[test]
fn a_bridge_that_stands_still_holds_no_change_up() {
    let world = World::new();
    let graph = graph_with_a_bridge(&world, "graph.patience=600");
    let bridge = pid_of(&world, "bridge");
    signal(bridge, "STOP");
    let from = set(&world, "track.min_points=60");
    assert!(set(&world, "track.min_points=61") >= from);
    world
        .run(&["topic", "echo", "points", "--count", "1"])
        .done();
    signal(bridge, "CONT");
    let ran = end(graph);
    assert!(!ran.err.contains("restarted"), "{ran:?}");
}

#[test]
fn a_stage_that_stands_still_while_something_is_set_is_ended_and_comes_back() {
    let world = World::new();
    let graph = graph_with_a_bridge(&world, "graph.patience=2");
    let stage = pid_of(&world, "hough");
    signal(stage, "STOP");
    set(&world, "track.min_points=60");
    wait_until("another one is there", || {
        let is_another = |(name, pid): &(String, u32)| name == "hough" && *pid != stage;
        world.nodes().iter().any(is_another)
    });
    let ran = end(graph);
    let said = "hough has not noted what was set within 2 s: it is ended";
    assert!(ran.err.contains(said), "{ran:?}");
    assert!(ran.out.contains("balanced"), "{ran:?}");
}

#[test]
fn what_cannot_be_set_is_refused_and_the_old_value_stays() {
    let world = World::new();
    let graph = graph(&world);
    let score = || {
        world
            .run(&["param", "get", "match.curves.score"])
            .done()
            .out
    };
    let before = score();
    // What holds for the whole run can be looked at.
    let channels = world.run(&["param", "get", "filter.channels"]).done();
    assert!(channels.out.starts_with('['), "{channels:?}");
    assert!(channels.err.contains("cannot be set while it goes on"));
    for (what, why) in [
        ("match.curves.score=9", "must lie between 0 and 1, not 9"),
        (
            "match.curves.score=high",
            "match.curves.score is a number from 0 to 1, not \"high\"",
        ),
        ("match.curves.scor=0.5", "do you mean match.curves.score?"),
        (
            "filter.channels=[3.0]",
            "cannot be changed while the graph runs",
        ),
        (
            "record.file=/etc/passwd",
            "cannot be changed while the graph runs",
        ),
        ("score", "expects node.key=value"),
    ] {
        let refused = world.run(&["param", "set", what]);
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.err.contains(why), "{what}: {refused:?}");
    }
    assert_eq!(score(), before);
    let said = world.run(&[
        "param",
        "set",
        &format!("match.curves.score={}", before.trim()),
    ]);
    assert_eq!(said.done().out, "it is so already\n");
    end(graph);
}
