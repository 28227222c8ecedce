//! More than three views: run, recorded, replayed, shown and compared with the triple.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use harness::World;

#[test]
fn five_views_are_run_recorded_shown_and_verified() {
    let world = World::new();
    let run = [
        "run",
        "--source",
        "scene:jack",
        "--views",
        "all",
        "--set",
        "match.reference=centre",
    ];
    let ran = world.run(&[&run[..], &["--scans", "2", "--record", "x.mcap"]].concat());
    ran.done();
    let info = world
        .run(&["info", "x.mcap", "--check", "--json"])
        .done()
        .json();
    let topics = info["topics"].as_array().unwrap();
    for view in 0..5 {
        let name = format!("camera/{view}/image");
        let topic = topics.iter().find(|topic| topic["topic"] == name.as_str());
        assert_eq!(topic.unwrap()["count"], 2, "{name}");
    }
    for from in ["capture", "match"] {
        let verify = ["replay", "x.mcap", "--from", from, "--verify", "--json"];
        let verified = world.run(&verify).done().json();
        assert_eq!(verified["verified"]["equal"], true, "{verified}");
    }
    let beyond = [
        "replay",
        "x.mcap",
        "--from",
        "match",
        "--set",
        "match.reference=5",
    ];
    let ran = world.run(&beyond);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err
            .contains("match.reference is view 5, and there are 5 views"),
        "{ran:?}"
    );
    let checked = world.run(&["view", "x.mcap", "--check"]).done();
    assert!(checked.out.contains("0 missing"), "{checked:?}");
    world.run(&["report", "x.mcap", "-o", "x.html"]).done();
}

#[test]
fn five_views_measure_better_than_three_at_the_same_coverage() {
    let world = World::new();
    let evaluate = [
        "evaluate",
        "scene:all",
        "--views",
        "all",
        "--reference",
        "centre",
        "--json",
    ];
    let report = world.run(&evaluate).done().json();
    // The thesis's objects; the fence, the last, is made to be mistaken.
    for scene in &report["scenes"].as_array().unwrap()[..3] {
        let gain = &scene["gain"];
        assert_eq!(gain["views"], 5);
        assert!(gain["coverage"].as_f64().unwrap() > 0.75, "{gain}");
        for figure in ["median", "bad_0_5"] {
            let of = |which: &str| gain[which][figure].as_f64().unwrap();
            assert!(of("all") <= 0.75 * of("triple"), "{figure}: {gain}");
        }
    }
}

#[test]
fn views_and_references_that_are_not_there_are_refused() {
    let world = World::new();
    for (arguments, expected) in [
        (
            &["--views", "all", "--set", "match.reference=5"][..],
            "match.reference is view 5, and there are 5 views, counted from 0",
        ),
        (
            &["--set", "match.reference=middle"],
            "match.reference is left, centre, right or a view's number, counted from 0, not \"middle\"",
        ),
        (
            &["--views", "every"],
            "\"every\" is no list of views, expected all, or numbers counted from 0 with commas between, as in 1,3,5",
        ),
        (&["--views", "0,1,3,4"], "steps"),
    ] {
        let ran = world.run(&[&["run", "--scans", "1"], arguments].concat());
        assert_eq!(ran.code, Some(2), "{ran:?}");
        assert!(ran.err.contains(expected), "{}", ran.err);
    }
}
