//! Recordings of builds before: what they hold is read as it was, and what this build computes otherwise is said.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::path::Path;

use harness::{Ran, World};

/// A world with a recording of a build before, as `x.mcap`.
///
/// `edges_as_clouds` holds one scan with everything, its edges as clouds of points in floats, its curves and tables as
/// indices; beside it lies what that build exported. `proof_of_filter_1` is the proof of the same scan. `fifty_three_keys` is of
/// its images, by the last build whose matcher had so many.
fn world_of(recording: &str) -> World {
    let world = World::new();
    std::fs::copy(fixture(&format!("{recording}.mcap")), world.path("x.mcap")).unwrap();
    world
}

fn fixture(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
}

/// It says, in one sentence, that another build recorded it, and calls nothing damaged.
#[track_caller]
fn assert_says_version(ran: &Ran) {
    let told = "filter was version 1 and is 2 here: another build recorded it, and what this one computes is not what was \
                recorded";
    let lines = ran.err.lines().filter(|line| line.contains(told)).count();
    assert_eq!(lines, 1, "{ran:?}");
    assert!(
        !ran.err.contains("damaged") && !ran.out.contains("damaged"),
        "{ran:?}"
    );
}

#[test]
fn edges_that_were_recorded_as_clouds_are_read_by_every_command() {
    let world = world_of("edges_as_clouds");
    let check = world.run(&["info", "x.mcap", "--check"]).done();
    assert!(check.out.contains("foxglove.PointCloud"), "{check:?}");
    let csv = world.run(&["export", "x.mcap", "--csv", "-"]).done().out;
    assert_eq!(
        csv,
        std::fs::read_to_string(fixture("edges_as_clouds.csv")).unwrap()
    );
    world
        .run(&[
            "export", "x.mcap", "--scan", "0", "--png", "pictures", "--ply", "x.ply",
        ])
        .done();
    world.run(&["report", "x.mcap", "-o", "x.html"]).done();
    // What is not the filter's is computed as it was, to the byte, from what the filter of then made.
    for stage in ["track", "hough", "match"] {
        let ran = world
            .run(&["replay", "x.mcap", "--from", stage, "--verify", "--json"])
            .done();
        assert_eq!(ran.json()["verified"]["equal"], true, "{stage}: {ran:?}");
    }
    // Recorded again it holds the same, and parts of it stand alone.
    world
        .run(&["replay", "x.mcap", "--from", "track", "--record", "y.mcap"])
        .done();
    world
        .run(&[
            "filter",
            "x.mcap",
            "--topics",
            "curves/*,tables/*,matches/*,points",
            "-o",
            "z.mcap",
        ])
        .done();
    for again in ["y.mcap", "z.mcap"] {
        world.run(&["info", again, "--check"]).done();
        assert_eq!(
            world.run(&["export", again, "--csv", "-"]).done().out,
            csv,
            "{again}"
        );
        let ran = world
            .run(&["replay", again, "--from", "match", "--verify", "--json"])
            .done();
        assert_eq!(ran.json()["verified"]["equal"], true, "{again}: {ran:?}");
    }
}

#[test]
fn what_an_older_filter_made_is_said_to_be_of_another_version() {
    let world = world_of("edges_as_clouds");
    let ran = world.run(&["replay", "x.mcap", "--from", "filter", "--verify"]);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert_says_version(&ran);

    let world = world_of("proof_of_filter_1");
    world.run(&["info", "x.mcap", "--check"]).done();
    let ran = world.run(&["rehydrate", "x.mcap", "-o", "full.mcap"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert_says_version(&ran);
    assert!(!world.path("full.mcap").exists());
}

#[test]
fn recordings_of_two_filters_are_not_merged() {
    let world = world_of("edges_as_clouds");
    world
        .run(&["replay", "x.mcap", "--from", "filter", "--record", "y.mcap"])
        .done();
    let ran = world.run(&["merge", "x.mcap", "y.mcap", "-o", "z.mcap"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(
        ran.err
            .contains("were computed by builds of different versions"),
        "{ran:?}"
    );
}

#[test]
fn a_recording_of_the_build_before_verifies_whole_and_is_merged_with_one_of_this() {
    let world = world_of("fifty_three_keys");
    let ran = world
        .run(&["replay", "x.mcap", "--verify", "--json"])
        .done();
    let verified = &ran.json()["verified"];
    assert_eq!(verified["equal"], true, "{ran:?}");
    assert_eq!(verified["not_verified"], serde_json::json!([]), "{ran:?}");
    assert!(!ran.err.contains("version"), "{ran:?}");
    world
        .run(&["replay", "x.mcap", "--record", "y.mcap"])
        .done();
    let merge = ["merge", "x.mcap", "y.mcap", "-o", "z.mcap"];
    world.run(&merge).done();
    let other = [
        "replay",
        "x.mcap",
        "--record",
        "w.mcap",
        "--set",
        "match.gap=3",
    ];
    world.run(&other).done();
    let ran = world.run(&["merge", "x.mcap", "w.mcap", "-o", "v.mcap"]);
    assert!(ran.err.contains("different settings of match"), "{ran:?}");
}

#[test]
fn settings_that_were_called_otherwise_are_carried_over_and_told() {
    let world = world_of("edges_as_clouds");
    // All of them are what is a constant by now, or have another name: nothing is lost, and nothing said.
    let ran = world
        .run(&["replay", "x.mcap", "--from", "match", "--json"])
        .done();
    assert!(!ran.err.contains("when it was recorded"), "{ran:?}");
    assert_eq!(ran.json()["changed"], serde_json::json!({}), "{ran:?}");
    let told = world.run(&["info", "x.mcap", "--settings"]).done().out;
    assert!(told.contains("match.relation_radius = 60"), "{told}");
    // Set anew they are called what they are called now.
    let set = |key: &str| world.run(&["replay", "x.mcap", "--from", "match", "--set", key]);
    let refused = set("match.score=0.6");
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(
        refused
            .err
            .contains("match.score is called match.curves.score now"),
        "{refused:?}"
    );
    set("match.curves.score=0.6").done();
}
