//! Views that are exposed so that little can be seen in them are told of.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use std::path::Path;

use harness::World;

/// Rewrites a view of a small scene: the same picture with other gray levels, of 8 bits or of 16.
fn change(view: &Path, most: u32, level: impl Fn(u32) -> u32) {
    let file = std::fs::read(view).unwrap();
    let head = b"P5\n160 120\n255\n".len();
    let mut changed = format!("P5\n160 120\n{most}\n").into_bytes();
    for &gray in &file[head..] {
        let level = level(gray.into()).min(most);
        match most {
            255 => changed.push(level as u8),
            _ => changed.extend((level as u16).to_be_bytes()),
        }
    }
    std::fs::write(view, changed).unwrap();
}

/// What a run of three scans of this source says at its end, and on the way.
fn told(world: &World, source: &str, scans: &str) -> (Vec<String>, String) {
    let run = [
        "run",
        "--source",
        source,
        "--scans",
        scans,
        "--no-record",
        "--json",
    ];
    let ran = world.run(&run).done();
    let warnings = ran.json()["warnings"].clone();
    (serde_json::from_value(warnings).unwrap(), ran.err)
}

#[test]
fn a_saturated_and_a_black_view_are_told_of_once_on_the_way_and_at_the_end() {
    let world = World::new();
    let scene = world.small_scene("scene");
    change(&scene.join("view1.pgm"), 255, |gray| 2 * gray);
    // Ten bits in files of sixteen.
    change(&scene.join("view2.pgm"), 65535, |gray| 4 * gray);
    let (warnings, log) = told(&world, &scene.to_string_lossy(), "3");
    let said: Vec<&String> = warnings
        .iter()
        .filter(|said| said.contains("of its pixels"))
        .collect();
    assert_eq!(said.len(), 2, "{warnings:?}");
    assert!(
        said[0].starts_with("centre is saturated: ")
            && said[0].ends_with("lower its exposure or gain"),
        "{said:?}"
    );
    assert!(
        said[1].starts_with("right is nearly black: 100 % of its pixels are below 16"),
        "{said:?}"
    );
    for said in said {
        assert_eq!(log.matches(said.as_str()).count(), 1, "{log}");
    }
}

#[test]
fn of_rendered_scenes_and_ordinary_pictures_nothing_is_told() {
    let world = World::new();
    let scene = world.small_scene("scene");
    for (source, scans) in [("scene:all", "4"), (&*scene.to_string_lossy(), "1")] {
        assert_eq!(
            told(&world, source, scans).0,
            Vec::<String>::new(),
            "{source}"
        );
    }
}

#[test]
fn a_frame_of_a_rail_that_is_saturated_is_told_of() {
    let world = World::new();
    let rail = world.small_rail("rail", 0..8);
    change(&rail.join("view5.pgm"), 255, |gray| 2 * gray);
    let source = rail.to_string_lossy();
    let run = [
        "run",
        "--source",
        &source,
        "--set",
        "capture.mode=rail",
        "--no-record",
    ];
    let ran = world.run(&run).done();
    assert!(
        ran.out.contains("warning: moving is saturated: "),
        "{ran:?}"
    );
}
