//! Replay: what a recording holds is computed again from any stage, equal to the byte.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use harness::{Ran, World, signal, wait_until};

/// A world with a recording of so many scans of a small scene.
#[test]
fn from_every_stage_on_a_replay_is_equal_to_the_byte() {
    let world = World::recorded("6");
    for (stage, topics) in [
        ("capture", 22),
        ("filter", 22),
        ("track", 16),
        ("hough", 10),
        ("match", 4),
    ] {
        let ran = world.run(&["replay", "x.mcap", "--from", stage, "--verify", "--json"]);
        let verified = &ran.done().json()["verified"];
        assert_eq!(verified["equal"], true, "{stage}: {verified}");
        let compared = verified["topics"].as_object().unwrap();
        assert_eq!(compared.len(), topics, "{stage}: {compared:?}");
        assert!(compared.values().all(|topic| topic["equal"] == 6));
    }
}

#[test]
fn a_setting_that_changes_results_is_told_and_not_passed() {
    let world = World::recorded("3");
    let ran = world.run(&[
        "replay",
        "x.mcap",
        "--from",
        "match",
        "--set",
        "match.nothing=0.3",
        "--verify",
        "--json",
    ]);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    let report = ran.json();
    assert_eq!(report["changed"]["match.nothing"][1], 0.3, "{report}");
    let points = &report["verified"]["topics"]["points"];
    assert_eq!(points["different"], 3, "{points}");
    let first = points["first"].as_str().unwrap();
    assert!(first.starts_with("scan 0, points["), "{first}");
}

#[test]
fn what_is_set_of_a_node_that_has_no_part_in_the_replay_is_refused_with_the_way() {
    let world = World::recorded("2");
    for (arguments, told) in [
        (
            ["--from", "match", "--set", "filter.floor=2"],
            "filter.floor is set, but a replay from match plays what filter made as it was recorded: replay --from filter",
        ),
        (
            ["--to", "hough", "--set", "match.gap=2"],
            "match.gap is set, but a replay to hough does not compute match: replay --to match",
        ),
        (
            ["--from", "match", "--set", "record.views=false"],
            "record.views is set, but nothing is recorded: replay --record FILE",
        ),
        (
            ["--from", "match", "--set", "match.assignment=curve"],
            "match.assignment = curve reads R-tables, and none were recorded: replay --from hough makes them",
        ),
    ] {
        let ran = world.run(&[&["replay", "x.mcap"][..], &arguments].concat());
        assert_eq!(ran.code, Some(2), "{ran:?}");
        assert!(ran.err.contains(told), "{ran:?}");
        assert_eq!(ran.err.lines().count(), 1, "{ran:?}");
    }
}

#[test]
fn what_is_played_is_of_the_view_and_the_settings_that_it_was_made_with() {
    let world = World::new();
    let run = ["run", "--source", "scene:tab", "--scans", "2", "--record"];
    let set = ["x.mcap", "--set", "match.reference=centre"];
    world.run(&[&run[..], &set].concat()).done();
    let cut = ["replay", "x.mcap", "--from", "evaluate", "--record"];
    world.run(&[&cut[..], &["y.mcap"]].concat()).done();
    let json = |file: &str| world.run(&["info", file, "--json"]).done().json();
    let (made, played) = (json("x.mcap"), json("y.mcap"));
    assert_eq!(played["reference"], made["reference"]);
    for table in ["match", "filter", "versions"] {
        let tables = (
            &played["configuration"][table],
            &made["configuration"][table],
        );
        assert_eq!(tables.0, tables.1);
    }
    // Of profiles that are as near, the one is named that is chosen where nobody chooses.
    let text = world.run(&["info", "y.mcap"]).done().out;
    assert!(text.contains("profile default"), "{text}");
}

#[test]
fn a_replay_whose_matcher_reads_r_tables_makes_them() {
    let world = World::recorded("2");
    let set = ["--set", "match.assignment=curve", "--json"];
    let ran = world.run(&[&["replay", "x.mcap", "--from", "hough"][..], &set].concat());
    let report = ran.done().json();
    assert_eq!(report["changed"]["hough.tables"][1], true, "{report}");
}

#[test]
fn what_was_compared_is_counted() {
    let world = World::recorded("3");
    let ran = world.run(&["replay", "x.mcap", "--from", "match", "--verify", "--json"]);
    let verified = &ran.done().json()["verified"];
    assert_eq!(verified["compared"], 12, "{verified}");
    assert_eq!(verified["not_verified"], serde_json::json!([]));
    assert_eq!(verified["topics"]["points"]["compared"], 3);
    let ran = world
        .run(&["replay", "x.mcap", "--from", "match", "--verify"])
        .done();
    let told = "verified: 3 scans, 12 messages of 4 topics, are equal to the byte";
    assert!(ran.out.contains(told), "{}", ran.out);
}

#[test]
fn other_channels_have_no_counterpart_in_the_recording() {
    let world = World::recorded("2");
    let ran = world.run(&[
        "replay",
        "x.mcap",
        "--set",
        "filter.channels=[8, 2]",
        "--verify",
        "--json",
    ]);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    let report = ran.json();
    let topic = &report["verified"]["topics"]["edges/left/8"];
    assert_eq!(topic["missing"], 2, "{report}");
}

#[test]
fn only_what_is_computed_anew_is_recorded_with_what_was_changed() {
    let world = World::recorded("4");
    world
        .run(&[
            "replay",
            "x.mcap",
            "--from",
            "match",
            "--scans",
            "1..3",
            "--set",
            "match.gray_cost=0.2",
            "--record",
            "y.mcap",
        ])
        .done();
    let info = world.run(&["info", "y.mcap", "--json"]).done().json();
    assert_eq!(info["scans"]["whole"], 2, "{info}");
    let change = &info["configuration"]["changed"]["match.gray_cost"];
    assert_eq!(change[1], 0.2, "{info}");
    let topics = info["topics"].as_array().unwrap();
    let count = |name: &str| {
        let topic = topics.iter().find(|topic| topic["topic"] == name);
        topic.map(|topic| topic["count"].as_u64().unwrap())
    };
    assert_eq!(count("points"), Some(2));
    assert_eq!(count("tf"), Some(2));
    assert_eq!(count("edges/left/0.8"), None);
    assert_eq!(count("camera/left/image"), None);
    let ran = world.run(&["replay", "y.mcap", "--from", "track"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(
        ran.err.contains("cannot be replayed from any stage"),
        "{}",
        ran.err
    );
}

#[test]
fn a_part_of_a_recording_without_the_stages_after_says_which_cut_is_possible() {
    let world = World::recorded("2");
    world
        .run(&[
            "replay", "x.mcap", "--to", "filter", "--record", "y.mcap", "--topics", "edges",
        ])
        .done();
    let ran = world.run(&["replay", "x.mcap", "--to", "hough"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(ran.err.contains("nothing would be done"), "{}", ran.err);
}

#[test]
fn a_replay_in_its_own_time_that_goes_on_for_ever_numbers_its_scans_on_and_ends_in_good_order() {
    let world = World::recorded("5");
    let child = world.start(&[
        "replay", "x.mcap", "--rate", "50", "--loop", "--record", "y.mcap", "--json",
    ]);
    wait_until("more than a round is recorded", || {
        let ran = world.run(&["info", "y.mcap", "--json"]);
        ran.code == Some(0) && ran.json()["scans"]["total"].as_u64() > Some(12)
    });
    signal(child.id(), "INT");
    let ran = Ran::new(child.wait_with_output().unwrap()).done();
    assert!(
        ran.err
            .contains("begins again: scans are numbered on from 5"),
        "{}",
        ran.err
    );
    let info = world.run(&["info", "y.mcap", "--json"]).done().json();
    assert_eq!(info["complete"], true, "{info}");
    assert_eq!(info["scans"]["missing"], serde_json::json!([]), "{info}");
    assert_eq!(info["scans"]["total"], ran.json()["scans"], "{info}");
}

#[test]
fn a_verification_that_is_ended_early_has_not_verified_the_recording() {
    let world = World::recorded("60");
    let child = world.start(&["replay", "x.mcap", "--verify", "--rate", "1"]);
    wait_until("it plays", || {
        let ran = world.run(&["topic", "list"]);
        ran.code == Some(0)
    });
    signal(child.id(), "INT");
    let ran = Ran::new(child.wait_with_output().unwrap());
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert!(ran.out.contains("NOT verified:"), "{}", ran.out);
    assert!(!ran.out.contains("equal to the byte"), "{}", ran.out);
}

#[test]
fn a_verifier_and_a_replay_that_are_killed_lose_nothing() {
    let world = World::recorded("150");
    for node in ["replay", "verify"] {
        let child = world.start(&["replay", "x.mcap", "--rate", "15", "--verify", "--json"]);
        let pid = || {
            let nodes = world.nodes();
            nodes
                .iter()
                .find(|(name, _)| name == node)
                .map(|(_, pid)| *pid)
        };
        wait_until("the first scans are compared", || {
            let runs = std::fs::read_dir(world.runtime().join("tricurve"));
            let mut runs = runs.into_iter().flatten().flatten();
            runs.any(|run| run.path().join("verify.json").exists())
        });
        signal(pid().unwrap(), "KILL");
        let ran = Ran::new(child.wait_with_output().unwrap()).done();
        let report = ran.json();
        let restarted = |n: &serde_json::Value| n["node"] == node && n["restarts"] == 1;
        assert!(
            report["nodes"].as_array().unwrap().iter().any(restarted),
            "{ran:?}"
        );
        assert_eq!(report["verified"]["equal"], true, "{ran:?}");
    }
}
