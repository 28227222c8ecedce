//! Cameras: frames that come when they like, from a program of another's making and, with the feature `gstreamer`, from
//! pipelines.
#![expect(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod harness;

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use harness::{Ran, World, bytes_of, signal, wait_until};
use messages::recording::Recording;
use messages::{Kind, Points, Topic};
use serde_json::Value;

/// The example, which is built with the tests.
fn command(run: &PathBuf) -> Command {
    let tests = std::env::current_exe().unwrap();
    let program = tests
        .parent()
        .unwrap()
        .parent()
        .unwrap()
        .join("examples/publish");
    let mut command = Command::new(program);
    command.arg(run).stdout(Stdio::null());
    command
}

fn publisher(run: &PathBuf) -> Child {
    let publisher = command(run).spawn();
    publisher.expect("built before: cargo build --example publish")
}

/// Waits until so many bytes more are recorded.
fn grows_by(world: &World, bytes: u64) {
    let before = bytes_of(&world.path("x.mcap"));
    wait_until("scans are recorded", || {
        bytes_of(&world.path("x.mcap")) > before + bytes
    });
}

/// Every frame of every camera is accounted for; gives the scans made.
#[track_caller]
fn adds_up(summary: &Value) -> u64 {
    let account = &summary["synchronisation"];
    let scans = account["scans"].as_u64().unwrap();
    let cameras = account["cameras"].as_array().unwrap();
    assert_eq!(cameras.len(), 3, "{summary}");
    for camera in cameras {
        let count = |key: &str| camera[key].as_u64().unwrap();
        let dropped: u64 = camera["dropped"]
            .as_object()
            .unwrap()
            .values()
            .filter_map(Value::as_u64)
            .sum();
        let known = count("matched") + count("late") + dropped + count("waiting");
        assert_eq!(count("received"), known, "{camera}");
        assert_eq!(count("matched"), scans, "{camera}");
        assert_eq!(count("waiting"), 0, "{camera}");
    }
    scans
}

const BUS: [&str; 12] = [
    "run",
    "--source",
    "camera:bus",
    "--set",
    "capture.width=160",
    "--set",
    "capture.height=120",
    "--delivery",
    "live",
    "--record",
    "x.mcap",
    "--json",
];

#[test]
fn another_program_publishes_its_frames_and_they_are_matched() {
    let world = World::new();
    let run = world.start(&[&BUS[..], &["--scans", "40"]].concat());
    let mut publisher = publisher(&world.waiting_run());
    let ran = Ran::new(run.wait_with_output().unwrap()).done();
    assert!(publisher.wait().unwrap().success());
    let summary = ran.json();
    assert_eq!(summary["balanced"], true, "{summary}");
    let ledger = &summary["ledger"];
    let refused = ledger["refused"].as_object().unwrap().values();
    let refused: u64 = refused.filter_map(Value::as_u64).sum();
    assert_eq!(ledger["admitted"], 40, "{summary}");
    assert_eq!(adds_up(&summary), 40 + refused, "{summary}");
    let info = world.run(&["info", "x.mcap", "--json"]).done().json();
    assert_eq!(info["scans"]["whole"], summary["ledger"]["done"], "{info}");
    let matches = summary["nodes"].as_array().unwrap().iter();
    let matches = matches.filter_map(|node| node["counts"]["matches"].as_u64());
    assert!(matches.sum::<u64>() > 0, "{summary}");
    assert!(world.leftovers().is_empty(), "{:?}", world.leftovers());
}

#[test]
fn a_killed_capture_loses_no_scan_that_was_let_in_and_counts_those_that_went_by() {
    let world = World::new();
    let run = world.start(&BUS);
    let mut publisher = publisher(&world.waiting_run());
    wait_until("scans are recorded", || {
        bytes_of(&world.path("x.mcap")) > 10_000_000
    });
    let capture = |(name, _): &(String, u32)| name == "capture";
    let (_, killed) = world.nodes().into_iter().find(capture).unwrap();
    signal(killed, "KILL");
    wait_until("capture is restarted", || {
        world
            .nodes()
            .iter()
            .any(|node| capture(node) && node.1 != killed)
    });
    let so_far = bytes_of(&world.path("x.mcap"));
    wait_until("scans are recorded again", || {
        bytes_of(&world.path("x.mcap")) > so_far + 10_000_000
    });
    signal(run.id(), "INT");
    let ran = Ran::new(run.wait_with_output().unwrap()).done();
    assert!(publisher.wait().unwrap().success());
    let summary = ran.json();
    assert_eq!(summary["balanced"], true, "{summary}");
    let missed = &summary["ledger"]["refused"]["capture was restarted"];
    // On an idle machine it may be back before the next frames come: then none went by.
    let recording = Recording::open(&world.path("x.mcap")).unwrap();
    let times: Vec<u64> = recording
        .scans()
        .filter_map(|scan| recording.nanos(scan))
        .collect();
    let mut apart: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    apart.sort_unstable();
    let (usual, most) = (apart[apart.len() / 2], apart[apart.len() - 1]);
    if most > 3 * usual {
        assert!(missed.as_u64() >= Some(1), "{summary}");
    }
    let info = world.run(&["info", "x.mcap", "--json"]).done().json();
    assert_eq!(info["scans"]["whole"], summary["ledger"]["done"], "{info}");
    adds_up(&summary);
}

#[test]
fn a_program_that_dies_and_comes_back_is_missed_and_goes_on() {
    let world = World::new();
    let run = world.start_telling(&BUS, "told");
    let told = || fs::read_to_string(world.path("told")).unwrap();
    let waiting = world.waiting_run();
    let mut first = publisher(&waiting);
    grows_by(&world, 5_000_000);
    let third = command(&waiting).stderr(Stdio::piped()).output().unwrap();
    let said = String::from_utf8_lossy(&third.stderr);
    assert!(
        !third.status.success() && said.contains("another program publishes this view already"),
        "{third:?}"
    );
    signal(first.id(), "KILL");
    assert!(!first.wait().unwrap().success());
    wait_until("it is missed", || {
        told().contains("no camera sends anything any more")
    });
    let mut second = publisher(&waiting);
    wait_until("it is back", || told().contains("scans come again"));
    grows_by(&world, 5_000_000);
    signal(run.id(), "INT");
    let summary = Ran::new(run.wait_with_output().unwrap()).done().json();
    assert!(second.wait().unwrap().success());
    assert_eq!(summary["balanced"], true, "{summary}");
    adds_up(&summary);
}

#[test]
fn a_camera_that_moves_is_matched_while_it_does_and_killed_nodes_change_nothing() {
    let world = World::new();
    let rail = [
        "--set",
        "capture.mode=rail",
        "--set",
        "capture.baseline=0.01",
    ];
    let run = world.start(&[&BUS[..], &rail].concat());
    let mut publisher = publisher(&world.waiting_run());
    grows_by(&world, 5_000_000);
    for killed in ["capture", "match", "map"] {
        let node = |(name, _): &(String, u32)| name == killed;
        let (_, pid) = world.nodes().into_iter().find(node).unwrap();
        signal(pid, "KILL");
        grows_by(&world, 5_000_000);
    }
    signal(run.id(), "INT");
    let ran = Ran::new(run.wait_with_output().unwrap()).done();
    assert!(publisher.wait().unwrap().success());
    let summary = ran.json();
    assert_eq!(summary["balanced"], true, "{summary}");
    for killed in ["capture", "match", "map"] {
        let mut nodes = summary["nodes"].as_array().unwrap().iter();
        let node = nodes.find(|node| node["node"] == killed).unwrap();
        assert_eq!(node["restarts"], 1, "{killed}: {summary}");
    }
    let mut recording = Recording::open(&world.path("x.mcap")).unwrap();
    let topics = Topic::of(&recording.metadata().rig, Kind::Points);
    // However many frames between were dropped: disparities are those of a centimetre.
    let (mut points, mut right, mut last) = (0, 0, f64::NEG_INFINITY);
    for scan in recording.scans().collect::<Vec<_>>() {
        let read = recording.read::<Points>(scan, &topics[0]).unwrap();
        let disparities = read.view().points.iter().map(|point| point.disparity);
        points += disparities.clone().count();
        right += disparities.filter(|d| (d - 6.0).abs() < 0.2).count();
        assert!(
            read.header.position_m > last,
            "scan {scan} at {}",
            read.header.position_m
        );
        last = read.header.position_m;
    }
    assert!(right * 100 > points * 95, "{right} of {points}");
    assert!(points > 1000, "{points}");
    let verify = ["replay", "x.mcap", "--from", "match", "--verify", "--json"];
    let verified = world.run(&verify).done().json();
    assert_eq!(verified["verified"]["equal"], true, "{verified}");
}

#[test]
fn cameras_without_what_they_need_are_refused_with_a_sentence() {
    let world = World::new();
    for (arguments, words) in [
        (
            &["run", "--source", "camera:bus"][..],
            "set capture.width and capture.height",
        ),
        #[cfg(not(feature = "gstreamer"))]
        (
            &[
                "run",
                "--source",
                "camera:gstreamer",
                "--set",
                "capture.cameras=['a','b','c']",
            ],
            "--features gstreamer",
        ),
        #[cfg(not(feature = "v4l"))]
        (
            &[
                "run",
                "--source",
                "camera:v4l",
                "--set",
                "capture.cameras=['a','b','c']",
            ],
            "--features v4l",
        ),
        (&["run", "--source", "camera:gstreamer"], "capture.cameras"),
        (
            &[&BUS[..], &["--set", "capture.mode=rail"]].concat(),
            "set capture.baseline",
        ),
        (
            &[&BUS[..], &["--set", "capture.cameras=['a','b']"]].concat(),
            "at least three views",
        ),
        (
            &[
                "run",
                "--source",
                "camera:gstreamer",
                "--set",
                "capture.mode=rail",
                "--set",
                "capture.cameras=['a']",
            ],
            "set capture.speed",
        ),
        (&["evaluate", "camera:bus"], "cameras send each frame once"),
        (&["run", "--source", "camera:bsu"], "camera:bus"),
    ] {
        let ran = world.run(arguments);
        assert_eq!(ran.code, Some(2), "{ran:?}");
        assert!(ran.err.contains(words), "{ran:?}");
    }
}

#[cfg(feature = "gstreamer")]
mod gstreamer {
    use super::*;

    /// At 30 Hz, of which the first loses some frames.
    const SHAKY: &str = "capture.cameras=[\
        'videotestsrc is-live=true pattern=smpte ! video/x-raw,width=160,height=120,framerate=30/1 ! identity drop-probability=0.1',\
        'videotestsrc is-live=true pattern=smpte ! video/x-raw,width=160,height=120,framerate=30/1',\
        'videotestsrc is-live=true pattern=smpte ! video/x-raw,width=160,height=120,framerate=30/1']";

    #[test]
    fn three_live_pipelines_are_put_together_and_the_topic_says_how() {
        let world = World::new();
        let ran = world
            .run(&[
                "run",
                "--source",
                "camera:gstreamer",
                "--set",
                SHAKY,
                "--delivery",
                "live",
                "--scans",
                "90",
                "--record",
                "x.mcap",
                "--json",
            ])
            .done();
        let summary = ran.json();
        assert_eq!(summary["balanced"], true, "{summary}");
        assert!(adds_up(&summary) >= 90);
        let left = &summary["synchronisation"]["cameras"][0];
        assert!(left["lost"].as_u64() > Some(0), "{left}");
        let info = world.run(&["info", "x.mcap", "--json"]).done().json();
        let topics = info["topics"].as_array().unwrap();
        let topic = topics
            .iter()
            .find(|topic| topic["topic"] == "synchronisation");
        assert!(topic.unwrap()["count"].as_u64() >= Some(2), "{info}");
    }

    /// From files, one of which goes on in another size after forty frames.
    const CHANGING: &str = "capture.cameras=[\
        'videotestsrc num-buffers=80 ! video/x-raw,width=160,height=120,framerate=30/1',\
        'concat name=c videotestsrc num-buffers=40 ! video/x-raw,width=160,height=120,framerate=30/1 ! c. \
         videotestsrc num-buffers=40 ! video/x-raw,width=80,height=60,framerate=30/1 ! c. c.',\
        'videotestsrc num-buffers=80 ! video/x-raw,width=160,height=120,framerate=30/1']";

    #[test]
    fn frames_that_change_their_size_are_left_out_and_counted() {
        let world = World::new();
        let ran = world.run(&[
            "run",
            "--source",
            "camera:gstreamer",
            "--set",
            CHANGING,
            "--record",
            "x.mcap",
            "--json",
        ]);
        let summary = ran.json();
        assert_eq!(summary["balanced"], true, "{summary}");
        assert_eq!(adds_up(&summary), 40, "{summary}");
        let changed = &summary["synchronisation"]["cameras"][1]["dropped"];
        let why = "it had another size than at the start";
        assert_eq!(changed[why], 40, "{summary}");
        world.run(&["info", "--check", "x.mcap"]).done();
    }
}
