//! The command line: what is asked for is given, what is wrong is said in a sentence, and the exit codes are kept.

mod harness;

use harness::World;

#[test]
fn wrong_use_ends_with_two() {
    let world = World::new();
    for arguments in [
        &["fly"][..],
        &["run", "--speed"],
        &["run", "--set", "nonsense"],
    ] {
        let ran = world.run(arguments);
        assert_eq!(ran.code, Some(2), "{ran:?}");
        assert!(!ran.err.is_empty());
    }
}

#[test]
fn a_mistyped_key_is_answered_with_the_nearest_known_one() {
    let ran = World::new().run(&["run", "--set", "track.min_pionts=4"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err
            .contains("track has no key min_pionts; do you mean track.min_points?"),
        "{}",
        ran.err
    );
}

#[test]
fn a_value_out_of_range_is_answered_with_the_range() {
    let ran = World::new().run(&["run", "--set", "capture.in_flight=1000"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("capture.in_flight must lie between 1 and"),
        "{}",
        ran.err
    );
}

#[test]
fn what_validate_prints_is_a_graph_file_that_amounts_to_the_same() {
    let world = World::new();
    let first = world
        .run(&["validate", "--set", "track.min_points=9"])
        .done()
        .out;
    std::fs::write(world.path("mine.toml"), &first).unwrap_or_default();
    assert_eq!(world.run(&["validate", "mine.toml"]).done().out, first);
    assert!(first.contains("min_points = 9"));
}

#[test]
fn the_thesis_profile_sets_the_thesis_constants() {
    let text = World::new()
        .run(&["validate", "--profile", "thesis"])
        .done()
        .out;
    for line in [
        "channels = [30.0, 20.0, 10.0]",
        "high = 64.0",
        "low = 32.0",
        "tolerance_degrees = 10.0",
        "min_points = 32",
    ] {
        assert!(text.contains(line), "{line} in\n{text}");
    }
}

#[test]
fn the_diagram_is_mermaid() {
    let text = World::new().run(&["graph"]).done().out;
    assert!(text.starts_with("flowchart LR\n"), "{text}");
    assert!(text.contains("capture -->|image| filter"), "{text}");
}

#[test]
fn a_source_that_is_not_there_is_named() {
    let ran = World::new().run(&["run", "--source", "nowhere", "--no-record"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(ran.err.contains("nowhere"), "{}", ran.err);
}

#[test]
fn a_recording_that_is_there_is_overwritten_only_by_force() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let scene = scene.to_string_lossy();
    let run = [
        "run", "--source", &scene, "--scans", "2", "--record", "x.mcap",
    ];
    world.run(&run).done();
    let ran = world.run(&run);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("x.mcap") && ran.err.contains("--force"),
        "{}",
        ran.err
    );
    world.run(&[&run[..], &["--force"]].concat()).done();
    assert!(world.leftovers().is_empty());
}

#[test]
fn what_is_no_recording_is_said_to_be_none() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let image = scene.join("view0.pgm");
    for command in [&["info"][..], &["export", "--csv", "x.csv"]] {
        let ran = world.run(&[command, &[image.to_string_lossy().as_ref()]].concat());
        assert_eq!(ran.code, Some(1), "{ran:?}");
        assert!(ran.err.contains("MCAP"), "{}", ran.err);
    }
}

#[test]
fn completions_know_the_commands() {
    let text = World::new().run(&["completions", "bash"]).done().out;
    assert!(text.contains("export") && text.contains("validate"));
}

#[test]
fn clean_says_that_there_is_nothing_to_clean() {
    assert!(
        World::new()
            .run(&["clean"])
            .done()
            .out
            .contains("nothing to clean")
    );
}
