//! Recordings made from recordings: recovered, split, merged, filtered, checked.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use harness::{World, signal, wait_until};

/// A world with a recording of so many scans of a small scene.
#[track_caller]
fn verifies(world: &World, name: &str, scans: u64) {
    let ran = world.run(&["replay", name, "--verify", "--json"]).done();
    let verified = &ran.json()["verified"];
    assert_eq!(
        (&verified["equal"], &verified["scans"]),
        (&true.into(), &scans.into())
    );
}

#[test]
fn what_is_recovered_of_a_truncated_recording_verifies_wherever_it_was_cut() {
    let world = World::recorded("4");
    let bytes = std::fs::read(world.path("x.mcap")).unwrap();
    let mut whole_seen = Vec::new();
    for cut in (1..=20).map(|k| bytes.len() * k / 20 - 13 * k) {
        std::fs::write(world.path("cut.mcap"), &bytes[..cut]).unwrap();
        let ran = world.run(&["recover", "cut.mcap", "-o", "y.mcap", "--force", "--json"]);
        if ran.code == Some(1) {
            assert!(
                ran.err.contains("no scan is left") || ran.err.contains("is empty"),
                "{ran:?}"
            );
            continue;
        }
        assert_eq!(ran.code, Some(3), "cut at {cut}: {ran:?}");
        let report = ran.json();
        let whole = report["whole"].as_u64().unwrap();
        assert!(report["unreadable_bytes"].as_u64() > Some(0), "{report}");
        if whole > 0 {
            verifies(&world, "y.mcap", whole);
        }
        whole_seen.push(whole);
        assert_eq!(
            std::fs::read(world.path("cut.mcap")).unwrap().len(),
            cut,
            "the input is only read"
        );
    }
    assert!(
        whole_seen.is_sorted() && whole_seen.last() >= Some(&3),
        "{whole_seen:?}"
    );
}

#[test]
fn a_damaged_chunk_costs_its_scan_and_no_other() {
    let world = World::recorded("5");
    let mut bytes = std::fs::read(world.path("x.mcap")).unwrap();
    let middle = bytes.len() / 2;
    for byte in &mut bytes[middle..middle + 64] {
        *byte ^= 0x5a;
    }
    std::fs::write(world.path("bad.mcap"), &bytes).unwrap();
    let check = world.run(&["info", "bad.mcap", "--check"]);
    assert_eq!(check.code, Some(3), "{check:?}");
    assert!(check.err.contains("bytes are damaged"), "{check:?}");
    let ran = world.run(&["recover", "bad.mcap", "-o", "y.mcap", "--json"]);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert_eq!(ran.json()["whole"], 4, "{ran:?}");
    verifies(&world, "y.mcap", 4);
    let check = world.run(&["info", "y.mcap", "--check"]);
    assert_eq!(check.code, Some(3), "{check:?}");
}

#[test]
fn a_whole_recording_is_recovered_as_it_is() {
    let world = World::recorded("3");
    world.run(&["recover", "x.mcap", "-o", "y.mcap"]).done();
    verifies(&world, "y.mcap", 3);
    world.run(&["info", "y.mcap", "--check"]).done();
    let [one, other] =
        ["x.mcap", "y.mcap"].map(|name| world.run(&["export", name, "--csv", "-"]).done().out);
    assert!(one.len() > 1000 && one == other);
}

#[test]
fn parts_are_read_as_one_and_merge_into_one() {
    let world = World::recorded("6");
    world
        .run(&["split", "x.mcap", "--scans", "2", "-o", "s.mcap"])
        .done();
    for part in ["s.mcap", "s.1.mcap", "s.2.mcap"] {
        assert!(world.path(part).exists(), "{part}");
    }
    verifies(&world, "s.mcap", 6);
    world.run(&["info", "s.mcap", "--check"]).done();
    world.run(&["recover", "s.mcap", "-o", "one.mcap"]).done();
    verifies(&world, "one.mcap", 6);

    world
        .run(&["merge", "x.mcap", "s.mcap", "-o", "both.mcap"])
        .done();
    verifies(&world, "both.mcap", 12);
    let info = world.run(&["info", "both.mcap", "--json"]).done().json();
    assert_eq!(info["scans"]["missing"], serde_json::json!([]), "{info}");

    std::fs::remove_file(world.path("s.1.mcap")).unwrap();
    let check = world.run(&["info", "s.mcap", "--check"]);
    assert_eq!(check.code, Some(3), "{check:?}");
    assert!(check.err.contains("s.1.mcap is missing"), "{}", check.err);
}

#[test]
fn a_filter_keeps_what_is_wanted_and_what_puts_it_in_its_place() {
    let world = World::recorded("4");
    let arguments = [
        "filter",
        "x.mcap",
        "--topics",
        "points,edges/left/*",
        "--scans",
        "1..3",
        "-o",
        "f.mcap",
        "--json",
    ];
    let report = world.run(&arguments).done().json();
    let topics: Vec<&String> = report["messages"].as_object().unwrap().keys().collect();
    assert_eq!(
        topics,
        [
            "camera/centre/calibration",
            "camera/left/calibration",
            "camera/right/calibration",
            "edges/left/1",
            "edges/left/2",
            "edges/left/4",
            "points",
            "tf",
        ]
    );
    assert!(
        report["messages"]
            .as_object()
            .unwrap()
            .values()
            .all(|count| count == 2)
    );
    let ran = world.run(&["filter", "x.mcap", "--scans", "9..", "-o", "none.mcap"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(!world.path("none.mcap").exists());
}

#[test]
fn what_a_filter_leaves_refers_to_nothing_that_it_left_out() {
    let world = World::recorded("3");
    let topics = "curves/*,tables/*,matches/*,disparity,points";
    let filter = [
        "filter", "x.mcap", "--topics", topics, "-o", "f.mcap", "--json",
    ];
    world.run(&filter).done();
    let ran = world.run(&["replay", "f.mcap", "--from", "hough", "--verify", "--json"]);
    let verified = &ran.done().json()["verified"];
    assert_eq!(verified["equal"], true, "{verified}");
    assert_eq!(verified["topics"].as_object().unwrap().len(), 14);
    let ran = world.run(&["replay", "f.mcap", "--from", "track"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    let told = "needs edges/left/4 and 8 more, which the recording does not hold; it can be replayed from hough, match";
    assert!(ran.err.contains(told), "{}", ran.err);
    let ran = world.run(&["filter", "x.mcap", "--topics", "curve", "-o", "g.mcap"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("no topic of the recording is like curve"),
        "{}",
        ran.err
    );
}

#[test]
fn nothing_is_overwritten_that_is_read_or_not_to_be() {
    let world = World::recorded("2");
    let before = std::fs::read(world.path("x.mcap")).unwrap();
    let ran = world.run(&["recover", "x.mcap", "-o", "x.mcap", "--force"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    let ran = world.run(&["export", "x.mcap", "--csv", "x.mcap"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    std::fs::write(world.path("y.mcap"), "mine").unwrap();
    let ran = world.run(&["recover", "x.mcap", "-o", "y.mcap"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert_eq!(std::fs::read(world.path("x.mcap")).unwrap(), before);
    assert_eq!(std::fs::read(world.path("y.mcap")).unwrap(), b"mine");
}

#[test]
fn what_is_no_recording_is_told_in_a_sentence() {
    let world = World::new();
    std::fs::write(world.path("text.mcap"), "just text, and no recording").unwrap();
    for command in [
        ["info", "text.mcap"].as_slice(),
        &["replay", "text.mcap"],
        &["recover", "text.mcap", "-o", "y.mcap"],
        &["export", "text.mcap", "--csv", "y.csv"],
    ] {
        let ran = world.run(command);
        assert_eq!(ran.code, Some(1), "{ran:?}");
        assert_eq!(
            ran.err,
            "tricurve: text.mcap is not an MCAP file\n".replace(
                "text.mcap",
                if command[0] == "replay" {
                    world.path("text.mcap").to_str().unwrap().to_owned().leak()
                } else {
                    "text.mcap"
                }
            ),
            "{command:?}"
        );
    }
}

#[test]
fn a_recorder_killed_over_and_over_leaves_every_scan_once() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let child = world.start(&[
        "run", "--source", &source, "--scans", "500", "--record", "x.mcap", "--json",
    ]);
    let recorder = || {
        let nodes = world.nodes();
        nodes
            .iter()
            .find(|(name, _)| name == "record")
            .map(|(_, pid)| *pid)
    };
    for kill in 0..20u32 {
        // Once it has begun a part of its own.
        let part = match kill {
            0 => world.path("x.mcap"),
            n => world.path(&format!("x.{n}.mcap")),
        };
        wait_until("the recorder records", || {
            harness::bytes_of(&part) > 100_000
        });
        if let Some(pid) = recorder() {
            signal(pid, "KILL");
        }
    }
    let ran = harness::Ran::new(child.wait_with_output().unwrap()).done();
    let report = ran.json();
    assert_eq!(report["ledger"]["done"], 500, "{ran:?}");
    let info = world
        .run(&["info", "x.mcap", "--check", "--json"])
        .done()
        .json();
    assert_eq!(info["scans"]["whole"], 500, "{info}");
    assert!(info["parts"].as_array().unwrap().len() > 15, "{info}");
    verifies(&world, "x.mcap", 500);
}
