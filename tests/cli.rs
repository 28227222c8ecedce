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
fn manual_pages_are_written_of_every_command() {
    let world = World::new();
    world.run(&["man", "pages"]).done();
    let help = world.run(&["--help"]).done().out;
    let commands = help.split("Commands:").nth(1).unwrap_or_default();
    let commands = commands.split("Options:").next().unwrap_or_default();
    let names = commands
        .lines()
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next())
        .filter(|name| !name.is_empty() && *name != "help");
    let mut count = 0;
    for name in names {
        let page = std::fs::read_to_string(world.path(&format!("pages/tricurve-{name}.1")));
        assert!(page.is_ok_and(|page| page.contains("OPTIONS")), "{name}");
        count += 1;
    }
    assert!(count > 15, "{count} commands");
}

#[test]
fn info_names_the_profile_and_what_was_set_otherwise_and_on_request_every_setting() {
    let world = World::new();
    let scene = world.small_scene("scene");
    let source = scene.to_string_lossy();
    let run = [
        "run", "--source", &source, "--scans", "1", "--force", "--record", "x.mcap",
    ];
    let settings = |more: &[&str], info: &[&str]| {
        world.run(&[&run, more].concat()).done();
        let told = world.run(&[&["info", "x.mcap"], info].concat()).done().out;
        let from = told.split_once("  settings      ").map(|(_, rest)| rest);
        let until = from.and_then(|rest| rest.split_once("\n\n"));
        until.map_or(told.clone(), |(settings, _)| settings.to_owned())
    };
    let fast = settings(&["--profile", "fast", "--set", "match.gap=8"], &[]);
    assert!(fast.starts_with("profile fast, but for\n"), "{fast}");
    assert!(fast.contains("match.gap = 8"), "{fast}");
    assert!(!fast.contains("filter."), "{fast}");
    let all = settings(&["--set", "match.gap=8"], &["--settings"]);
    assert!(all.contains("match.gap = 8  (usually 10)"), "{all}");
    assert!(all.contains("filter.floor = 0.4\n"), "{all}");
    assert!(all.lines().count() > 60, "{all}");
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
