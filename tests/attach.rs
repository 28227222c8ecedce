//! A recorder beside a graph that runs: nobody waits for it, and it says what it missed.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::process::Child;

use harness::{Ran, World, bytes_of, signal, wait_until};

/// Starts a graph that runs until it is told to stop, and waits until it does.
fn graph(world: &World) -> Child {
    let child = world.endless(&["--json"]);
    wait_until("the graph runs", || world.nodes().len() == 5);
    child
}

fn ends_balanced(graph: Child) {
    signal(graph.id(), "INT");
    let ran = Ran::new(graph.wait_with_output().unwrap()).done();
    assert_eq!(ran.json()["balanced"], true, "{ran:?}");
}

#[test]
fn a_recorder_beside_a_graph_records_what_is_wanted_and_verifies() {
    let world = World::new();
    let graph = graph(&world);
    let all = world.start(&["record", "-o", "all.mcap", "--json"]);
    let some = world.start(&["record", "-o", "some.mcap", "--regex", "^points$", "--json"]);
    wait_until("both record", || {
        bytes_of(&world.path("all.mcap")) > 3_000_000
            && bytes_of(&world.path("some.mcap")) > 100_000
    });
    for recorder in [all, some] {
        signal(recorder.id(), "INT");
        let ran = Ran::new(recorder.wait_with_output().unwrap());
        // Where the machine is busy it may miss some, and says so.
        assert!(matches!(ran.code, Some(0 | 3)), "{ran:?}");
        let report = ran.json();
        assert!(report["scans"].as_u64() > Some(0), "{report}");
        assert_eq!(report["missed"] == 0, ran.code == Some(0), "{report}");
    }
    ends_balanced(graph);
    let ran = world
        .run(&["replay", "all.mcap", "--verify", "--json"])
        .done();
    assert_eq!(ran.json()["verified"]["equal"], true);
    let info = world.run(&["info", "some.mcap", "--json"]).done().json();
    let topics = info["topics"].as_array().unwrap();
    let data = topics
        .iter()
        .filter(|topic| topic["schema"] == "foxglove.PointCloud");
    assert_eq!(data.count(), 1, "{info}");
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn a_replay_sends_what_nobody_takes_as_soon_as_a_recorder_asks_for_it() {
    let world = World::recorded("4");
    // Of what comes before the cut no node takes the images.
    let replay = world.start(&[
        "replay", "x.mcap", "--from", "match", "--loop", "--rate", "1", "--json",
    ]);
    wait_until("the replay runs", || world.nodes().len() == 2);
    let recorder = world.start(&["record", "-o", "y.mcap", "--topics", "camera/*", "--json"]);
    wait_until("images come", || bytes_of(&world.path("y.mcap")) > 300_000);
    signal(recorder.id(), "INT");
    let ran = Ran::new(recorder.wait_with_output().unwrap());
    assert!(ran.json()["scans"].as_u64() > Some(0), "{ran:?}");
    ends_balanced(replay);
}

#[test]
fn a_recorder_that_stands_still_holds_nobody_up_and_says_what_it_missed() {
    let world = World::new();
    let graph = graph(&world);
    let recorder = world.start(&["record", "-o", "x.mcap", "--json"]);
    wait_until("it records", || bytes_of(&world.path("x.mcap")) > 1_000_000);
    signal(recorder.id(), "STOP");
    // The graph goes on: more scans come out than any buffer holds.
    let probe = world.start(&["record", "-o", "probe.mcap", "--topics", "points", "--json"]);
    wait_until("the graph has gone on", || {
        let ran = world.run(&["info", "probe.mcap", "--json"]);
        ran.code == Some(0) && ran.json()["scans"]["total"].as_u64() > Some(60)
    });
    signal(probe.id(), "INT");
    probe.wait_with_output().unwrap();
    signal(recorder.id(), "CONT");
    // First what was still in its buffer, then, beyond a gap, what comes now.
    wait_until("it goes on recording", || {
        let ran = world.run(&["info", "x.mcap", "--json"]);
        ran.code == Some(0)
            && !ran.json()["scans"]["missing"]
                .as_array()
                .unwrap()
                .is_empty()
    });
    signal(recorder.id(), "INT");
    let ran = Ran::new(recorder.wait_with_output().unwrap());
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert!(ran.json()["missed"].as_u64() > Some(0), "{ran:?}");
    ends_balanced(graph);
}

#[test]
fn a_snapshot_holds_the_last_seconds() {
    let world = World::new();
    let graph = graph(&world);
    // Scans are a tenth of a second apart.
    let recorder = world.start(&["record", "-o", "x.mcap", "--snapshot", "1", "--json"]);
    let probe = world.start(&["record", "-o", "probe.mcap", "--topics", "points", "--json"]);
    wait_until("some seconds have passed", || {
        let ran = world.run(&["info", "probe.mcap", "--json"]);
        ran.code == Some(0) && ran.json()["scans"]["total"].as_u64() > Some(40)
    });
    signal(recorder.id(), "USR1");
    wait_until("it is written", || {
        world.run(&["info", "x.mcap", "--check"]).code == Some(0)
    });
    for guest in [recorder, probe] {
        signal(guest.id(), "INT");
        guest.wait_with_output().unwrap();
    }
    let info = world.run(&["info", "x.mcap", "--json"]).done().json();
    let duration = info["duration_seconds"].as_f64().unwrap();
    assert!((0.05..=1.01).contains(&duration), "{info}");
    ends_balanced(graph);
}

#[test]
fn without_a_graph_there_is_nothing_to_record() {
    let world = World::new();
    let ran = world.run(&["record", "-o", "x.mcap"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(
        ran.err.contains("no graph of yours is running"),
        "{}",
        ran.err
    );
    assert!(!world.path("x.mcap").exists());
}
