//! Folders as people have them: every command reads one in the same way, says how, and the recording knows it.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::fs;
use std::path::PathBuf;

use harness::World;

/// The same small scene from three cameras of which each has a folder, at four times.
fn folder_a_camera(world: &World) -> PathBuf {
    let scene = world.small_scene("scene");
    let rig = world.path("rig");
    for camera in 0..3 {
        let folder = rig.join(format!("cam{camera}"));
        fs::create_dir_all(&folder).unwrap();
        for time in 8..12 {
            let image = scene.join(format!("view{camera}.pgm"));
            fs::copy(image, folder.join(format!("{time:04}.pgm"))).unwrap();
        }
    }
    rig
}

#[test]
fn which_file_became_which_view_and_scan_is_said_and_recorded_and_kept_by_a_replay() {
    let world = World::new();
    folder_a_camera(&world);
    let ran = world
        .run(&["run", "--source", "rig", "--record", "x.mcap"])
        .done();
    for line in [
        "read as a folder a camera (cameras): 4 scans of 3 views",
        "  view    place  scan 0         scan 1         scan 2         scan 3",
        "  left        0  cam0/0008.pgm  cam0/0009.pgm  cam0/0010.pgm  cam0/0011.pgm",
        "  right       2  cam2/0008.pgm  cam2/0009.pgm  cam2/0010.pgm  cam2/0011.pgm",
    ] {
        assert!(ran.err.contains(line), "{line}\n{}", ran.err);
    }
    let input = |file: &str| {
        let info = world.run(&["info", file, "--json"]).done().json();
        info["configuration"]["input"].clone()
    };
    let recorded = input("x.mcap");
    assert_eq!(recorded["layout"], "cameras");
    assert_eq!(recorded["views"][1]["view"], "centre");
    assert_eq!(recorded["files"][2][1], "cam1/0010.pgm");
    let replay = [
        "replay", "x.mcap", "--from", "match", "--verify", "--record", "y.mcap",
    ];
    world.run(&replay).done();
    assert_eq!(input("y.mcap"), recorded);
}

#[test]
fn every_command_reads_a_folder_in_the_same_way() {
    let world = World::new();
    folder_a_camera(&world);
    let table = "read as a folder a camera (cameras): 4 scans of 3 views";
    let checked = world.run(&["check-geometry", "rig"]).done();
    assert!(checked.err.contains(table), "{}", checked.err);
    // Three cameras at four times, of which none saw a board.
    let calibrated = world.run(&["calibrate", "rig", "--board", "9x6", "--square", "0.03"]);
    assert_eq!(calibrated.code, Some(1), "{calibrated:?}");
    let said = "3 cameras, a folder a camera (cam0, cam1, cam2), 12 images at 4 times";
    assert!(calibrated.err.contains(said), "{}", calibrated.err);
    let tuned = world
        .run(&["tune", "rig", "--sweep", "match.gap=6,10", "--json"])
        .done();
    assert_eq!(tuned.json()["scenes"], 4, "{}", tuned.out);
    // And in another one where that is said: a camera that stands still is no rail that could be checked.
    let said = world.run(&["check-geometry", "rig/cam0", "--layout", "rail"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.err
            .contains("the frames of one camera (rail): 4 frames"),
        "{}",
        said.err
    );
}

#[test]
fn what_can_be_read_in_two_ways_is_refused_and_can_be_said() {
    let world = World::new();
    let scene = world.small_scene("scene");
    for folder in ["a", "b", "c"] {
        let folder = world.path("open").join(folder);
        fs::create_dir_all(&folder).unwrap();
        for view in 0..3 {
            fs::copy(
                scene.join(format!("view{view}.pgm")),
                folder.join(format!("{view}.pgm")),
            )
            .unwrap();
        }
    }
    for command in [
        &["run", "--no-record", "--source", "open"][..],
        &["tune", "open"],
        &["check-geometry", "open"],
    ] {
        let ran = world.run(command);
        assert_eq!(ran.code, Some(2), "{ran:?}");
        assert!(
            ran.err
                .contains("say which with --layout cameras or --layout times"),
            "{}",
            ran.err
        );
    }
    let times = [
        "run",
        "--no-record",
        "--source",
        "open",
        "--layout",
        "times",
    ];
    let ran = world.run(&times).done();
    assert!(
        ran.err
            .contains("  left        0  a/0.pgm  b/0.pgm  c/0.pgm"),
        "{}",
        ran.err
    );
}

#[test]
fn views_that_are_given_where_a_graph_file_belongs_are_told_from_one() {
    let world = World::new();
    let ran = world.run(&["run", "--view", "1,3,5"]);
    assert_eq!(ran.code, Some(2));
    assert!(
        ran.err
            .contains("which views are taken is said with --views 1,3,5"),
        "{}",
        ran.err
    );
}

#[test]
fn of_a_pattern_that_repeats_nothing_is_reported_and_that_is_why() {
    let world = World::new();
    let folder = world.path("grating");
    fs::create_dir_all(&folder).unwrap();
    for view in 0..3u32 {
        let mut image = b"P5\n320 120\n255\n".to_vec();
        // Bars of 8 px, each view 5 px further to the left.
        image.extend((0..320 * 120).map(|at| {
            let column = at % 320 + 5 * view;
            if column / 8 % 2 == 0 { 60 } else { 180 }
        }));
        fs::write(folder.join(format!("{view}.pgm")), image).unwrap();
    }
    let source = folder.to_string_lossy();
    let run = [
        "run",
        "--source",
        &source,
        "--scans",
        "2",
        "--no-record",
        "--force-unrectified",
    ];
    let ran = world.run(&run).done();
    assert!(
        ran.out.contains("as where a pattern repeats itself")
            && ran.out.contains("ambiguous curves"),
        "{ran:?}"
    );
    assert!(!ran.out.contains("next to nothing matched"), "{ran:?}");
}
