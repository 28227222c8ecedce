//! Two recordings compared.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use harness::World;

const SCENES: [&str; 4] = ["run", "--scans", "3", "--record"];

fn recorded(world: &World, name: &str, set: &[&str]) {
    world.run(&[&SCENES[..], &[name], set].concat()).done();
}

#[test]
fn a_recording_is_the_same_as_itself_and_as_its_proof_and_not_as_one_of_other_settings() {
    let world = World::new();
    recorded(&world, "a.mcap", &[]);
    recorded(&world, "p.mcap", &["--set", "record.keep=proof"]);
    for other in ["a.mcap", "p.mcap"] {
        let ran = world.run(&["compare", "a.mcap", other, "--json"]);
        assert_eq!(ran.code, Some(0), "{ran:?}");
        let told = ran.json();
        assert_eq!(told["verdict"], "same", "{told}");
        assert_eq!(told["points"]["moved"], 0);
        assert_eq!(told["points"]["both"], told["points"]["a"]);
        assert_eq!(told["settings"], serde_json::json!({}));
    }
    // What is surer of itself covers less and errs less: neither better nor worse.
    let replay = [
        "replay",
        "a.mcap",
        "--from",
        "match",
        "--set",
        "match.score_least=0.999",
        "--record",
        "b.mcap",
    ];
    world.run(&replay).done();
    let ran = world.run(&["compare", "a.mcap", "b.mcap", "--json"]);
    assert_eq!(ran.code, Some(12), "{ran:?}");
    let told = ran.json();
    assert_eq!(
        told["settings"],
        serde_json::json!({ "match.score_least": [0.985, 0.999] })
    );
    let (a, b) = (&told["truth"][0], &told["truth"][1]);
    assert!(a["coverage"].as_f64() > b["coverage"].as_f64(), "{told}");
    assert!(a["bad_one"].as_f64() > b["bad_one"].as_f64(), "{told}");
    assert!(told["points"]["only_a"].as_u64() > Some(1000), "{told}");
    // Curves that break at every bend are short, lose points and err more.
    let replay = [
        "replay",
        "a.mcap",
        "--from",
        "track",
        "--set",
        "track.tolerance_degrees=25",
        "--record",
        "c.mcap",
    ];
    world.run(&replay).done();
    let worse = world.run(&["compare", "a.mcap", "c.mcap"]);
    let better = world.run(&["compare", "c.mcap", "a.mcap"]);
    assert_eq!(
        (worse.code, better.code),
        (Some(11), Some(10)),
        "{worse:?} {better:?}"
    );
    assert!(worse.out.contains("B is worse") && better.out.contains("B is better"));
    assert!(
        worse.out.lines().all(|line| line.chars().count() <= 80),
        "{}",
        worse.out
    );
}

#[test]
fn a_replay_says_by_itself_whether_other_settings_made_it_better() {
    let world = World::new();
    recorded(&world, "a.mcap", &[]);
    let before = std::fs::read_dir(world.path(".")).unwrap().count();
    let curves = ["--from", "track", "--set", "track.tolerance_degrees=25"];
    let worse = world.run(&[&["replay", "a.mcap", "--compare"], &curves[..]].concat());
    assert_eq!(worse.code, Some(11), "{worse:?}");
    for told in [
        "track.tolerance_degrees: 25, was 90.0",
        "A as it was recorded, B as it was played",
        "seen in three views",
        "time of match",
        "B is worse",
    ] {
        assert!(worse.out.contains(told), "{told}: {worse:?}");
    }
    let left = std::fs::read_dir(world.path(".")).unwrap().count();
    assert_eq!(left, before, "nothing is left of it");
    // Of a part, scans are those that were played; and what is recorded is compared too.
    let part = ["replay", "a.mcap", "--scans", "1..3", "--compare", "--json"];
    let same = world.run(&[&part[..], &["--record", "b.mcap"]].concat());
    assert_eq!(same.code, Some(0), "{same:?}");
    let told = &same.json()["compared"];
    assert_eq!(told["verdict"], "same", "{told}");
    assert_eq!(told["scans"], 2, "{told}");
    assert_eq!(told["agreement"][0], told["agreement"][1], "{told}");
    assert!(world.path("b.mcap").exists());
    // Without points there is nothing to compare with.
    let without = ["filter", "a.mcap", "--topics", "camera/*", "-o", "c.mcap"];
    world.run(&without).done();
    let refused = world.run(&["replay", "c.mcap", "--compare"]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(refused.err.contains("holds no points"), "{refused:?}");
}

#[test]
fn a_picture_shows_both_and_what_differs_beside_them() {
    let world = World::new();
    recorded(&world, "a.mcap", &[]);
    recorded(&world, "b.mcap", &["--set", "match.score_least=0.999"]);
    let ran = world.run(&[
        "compare", "a.mcap", "b.mcap", "--scan", "1", "--png", "ab.png",
    ]);
    assert_eq!(ran.code, Some(12), "{ran:?}");
    let picture = image::open(world.path("ab.png")).unwrap().to_rgb8();
    assert_eq!((picture.width(), picture.height()), (3 * 512 + 8, 480));
    let of = |colour: [u8; 3]| picture.pixels().filter(|pixel| pixel.0 == colour).count();
    // Most of what differs is what the second is not sure enough of.
    let (only_a, only_b) = (of([255, 60, 50]), of([70, 150, 255]));
    assert!(only_a > 1000 && only_b < only_a / 2, "{only_a} {only_b}");
    assert!(of([90, 90, 90]) > 5_000);
}

#[test]
fn two_takes_are_not_two_settings_and_what_cannot_be_compared_is_refused() {
    let world = World::new();
    recorded(&world, "a.mcap", &[]);
    recorded(&world, "b.mcap", &["--set", "capture.seed=2"]);
    let ran = world.run(&["compare", "a.mcap", "b.mcap"]);
    assert_eq!(ran.code, Some(12), "{ran:?}");
    assert!(
        ran.err
            .contains("the images of 3 scans differ: what is compared is two takes"),
        "{ran:?}"
    );
    recorded(&world, "c.mcap", &["--set", "match.reference=centre"]);
    let filter = ["filter", "a.mcap", "--topics", "disparity", "-o", "d.mcap"];
    world.run(&filter).done();
    let filter = ["filter", "a.mcap", "--scans", "2..3", "-o", "e.mcap"];
    world.run(&filter).done();
    for (other, told) in [
        (
            "c.mcap",
            "the points of a.mcap are of left, 512x480, those of c.mcap of centre, 512x480: expected two recordings",
        ),
        ("d.mcap", "d.mcap holds no points"),
    ] {
        let ran = world.run(&["compare", "a.mcap", other]);
        assert_eq!(ran.code, Some(2), "{ran:?}");
        assert!(ran.err.contains(told), "{ran:?}");
    }
    let ran = world.run(&["compare", "a.mcap", "e.mcap"]);
    assert_eq!(ran.code, Some(0), "{ran:?}");
    assert!(
        ran.err
            .contains("2 scans of the first and 0 scans of the second"),
        "{ran:?}"
    );
}

#[test]
fn maps_of_a_rail_are_compared_by_their_points_and_how_sure_these_are() {
    let world = World::new();
    let rail = world
        .small_rail("rail", 0..8)
        .to_string_lossy()
        .into_owned();
    let run = ["run", "--source", &rail, "--layout", "rail", "--record"];
    world.run(&[&run[..], &["a.mcap"]].concat()).done();
    world
        .run(&[&run[..], &["b.mcap", "--set", "match.nothing=0.4"]].concat())
        .done();
    let ran = world.run(&["compare", "a.mcap", "b.mcap", "--json"]);
    let told = ran.json();
    assert!(
        told["maps"][0]["points"].as_u64() > told["maps"][1]["points"].as_u64(),
        "{told}"
    );
    assert!(told["maps"][0]["sigma_m"].as_f64() > Some(0.0), "{told}");
}
