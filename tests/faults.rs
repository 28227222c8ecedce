//! Faults: nodes killed, launchers killed, signals, a full disk. Nothing is lost silently, nothing is left behind.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::process::{Child, Command, Stdio};

use harness::{Ran, World, bytes_of, is_gone, signal, wait_until};

const SCANS: &str = "300";

/// Starts a run long enough to be disturbed, and waits until it is under way.
fn start(world: &World, scans: &str) -> Child {
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let child = world.start(&[
        "run", "--source", &source, "--scans", scans, "--record", "x.mcap", "--json",
    ]);
    wait_until("scans are recorded", || {
        bytes_of(&world.path("x.mcap")) > 1_000_000
    });
    child
}

#[track_caller]
fn holds_every_scan_once(world: &World, scans: u64) {
    let info = world.run(&["info", "x.mcap", "--json"]).done().json();
    assert_eq!(info["complete"], true, "{info}");
    assert_eq!(info["scans"]["whole"], scans, "{info}");
    assert_eq!(info["scans"]["total"], scans, "{info}");
}

/// Kills a node of a run and looks at what comes of it.
fn kill(node: &str) {
    let world = World::new();
    let child = start(&world, SCANS);
    let pid = world
        .nodes()
        .into_iter()
        .find(|(name, _)| name == node)
        .unwrap()
        .1;
    signal(pid, "KILL");
    let ran = Ran::new(child.wait_with_output().unwrap()).done();
    let summary = ran.json();
    let restarts = |n: &serde_json::Value| n["node"] == node && n["restarts"].as_u64() >= Some(1);
    assert!(
        summary["nodes"].as_array().unwrap().iter().any(restarts),
        "killed too late: {ran:?}"
    );
    assert_eq!(summary["balanced"], true, "{ran:?}");
    holds_every_scan_once(&world, 300);
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn a_killed_capture_is_restarted_and_nothing_is_lost() {
    kill("capture");
}

#[test]
fn a_killed_filter_is_restarted_and_nothing_is_lost() {
    kill("filter");
}

#[test]
fn a_killed_track_is_restarted_and_nothing_is_lost() {
    kill("track");
}

#[test]
fn a_killed_hough_is_restarted_and_nothing_is_lost() {
    kill("hough");
}

#[test]
fn a_killed_match_is_restarted_and_nothing_is_lost() {
    kill("match");
}

#[test]
fn a_killed_recorder_goes_on_in_the_next_part_and_nothing_is_lost() {
    kill("record");
}

#[test]
fn a_signal_drains_the_pipe_and_finishes_the_recording() {
    for name in ["INT", "TERM"] {
        let world = World::new();
        let child = start(&world, "100000");
        signal(child.id(), name);
        let ran = Ran::new(child.wait_with_output().unwrap()).done();
        let done = ran.json()["ledger"]["done"].as_u64().unwrap();
        assert!(done > 0 && done < 100_000, "{ran:?}");
        holds_every_scan_once(&world, done);
        assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
    }
}

#[test]
fn nodes_die_with_their_launcher_and_leave_nothing() {
    let world = World::new();
    let mut child = start(&world, "100000");
    assert_eq!(world.nodes().len(), 6);
    signal(child.id(), "KILL");
    child.wait().unwrap();
    wait_until("the nodes are gone", || world.nodes().is_empty());
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
    // What was recorded is there.
    let info = world.run(&["info", "x.mcap", "--json"]).done().json();
    assert!(info["scans"]["whole"].as_u64().unwrap() > 0, "{info}");
}

#[test]
fn a_full_disk_ends_the_run_and_what_was_written_stays_readable() {
    let world = World::new();
    let scene = world.small_scene("scene");
    std::fs::create_dir(world.path("disk")).unwrap();
    // A disk of six megabytes, in a mount namespace of its own.
    let script = "mount -t tmpfs -o size=6m none disk || exit 99
        \"$0\" run --source \"$1\" --scans 100000 --record disk/x.mcap; echo $? > code
        \"$0\" info disk/x.mcap --json > info";
    let tricurve = world.tricurve(&[]);
    let program = tricurve.get_program().to_str().unwrap();
    let run = |rights: &[&str]| {
        let mut command = Command::new("unshare");
        command
            .args(rights)
            .args(["bash", "-c", script, program, scene.to_str().unwrap()]);
        command.current_dir(tricurve.get_current_dir().unwrap());
        for (key, value) in tricurve.get_envs() {
            command.env(key, value.unwrap());
        }
        Ran::new(
            command
                .stdout(Stdio::piped())
                .stderr(Stdio::piped())
                .output()
                .unwrap(),
        )
    };
    let mut ran = run(&["--mount"]);
    if ran.code != Some(0) {
        ran = run(&["--map-root-user", "--mount"]);
    }
    if ran.code != Some(0) {
        eprintln!(
            "skipped: this system lets nobody mount a small disk: {}",
            ran.err
        );
        return;
    }
    let read = |name| std::fs::read_to_string(world.path(name)).unwrap();
    assert_eq!(read("code").trim(), "1", "{ran:?}");
    assert!(ran.err.contains("x.mcap"), "{}", ran.err);
    let info: serde_json::Value = serde_json::from_str(&read("info")).unwrap();
    assert!(info["scans"]["whole"].as_u64().unwrap() > 0, "{info}");
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn a_message_that_is_lost_on_its_way_is_missed_and_named() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run",
        "--source",
        &source,
        "--scans",
        "20",
        "--record",
        "x.mcap",
        "--set",
        "graph.patience=1",
        "--json",
    ];
    let lossy = world
        .tricurve(&run)
        .env("TRICURVE_LOSE", "curves/left/2.2:7")
        .output()
        .unwrap();
    let ran = Ran::new(lossy);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert_eq!(ran.json()["balanced"], false, "{ran:?}");
    for node in ["hough", "match"] {
        let missed = ran.err.lines().any(|line| {
            line.contains(&format!("{node} received")) && line.contains("missing scans [7]")
        });
        assert!(missed, "{node}: {}", ran.err);
    }
    let info = world.run(&["info", "x.mcap", "--check"]);
    assert_eq!(info.code, Some(3), "{info:?}");
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn clean_sweeps_up_after_a_run_whose_processes_were_all_killed() {
    let world = World::new();
    let mut child = start(&world, "100000");
    let nodes = world.nodes();
    assert_eq!(nodes.len(), 6);
    for (_, pid) in &nodes {
        signal(*pid, "STOP");
    }
    // A process that was told to stop stops soon, not at once.
    let state = |pid: u32| std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    wait_until("they have stopped", || {
        nodes.iter().all(|(_, pid)| state(*pid).contains(") T "))
    });
    signal(child.id(), "KILL");
    child.wait().unwrap();
    for (_, pid) in &nodes {
        signal(*pid, "KILL");
    }
    wait_until("the nodes are gone", || {
        nodes.iter().all(|(_, pid)| is_gone(*pid))
    });
    assert!(!world.leftovers().is_empty());
    let ran = world.run(&["clean"]).done();
    assert!(ran.out.contains("cleaned up after 1 dead run:"), "{ran:?}");
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}
