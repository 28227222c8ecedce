//! Results against the truth: as a topic of a run, and as a command.
#![expect(clippy::unwrap_used, reason = "tests")]

mod harness;

use harness::World;
use messages::recording::Recording;
use messages::{Evaluation, Kind, Owned, Topic};

fn evaluations(world: &World, file: &str) -> Vec<Owned<Evaluation>> {
    let mut recording = Recording::open(&world.path(file)).unwrap();
    let topic = Topic::of(&recording.metadata().rig, Kind::Evaluation).swap_remove(0);
    let scans: Vec<u64> = recording.scans().collect();
    let read = |scan| recording.read::<Evaluation>(scan, &topic).unwrap();
    scans.into_iter().map(read).collect()
}

#[test]
fn what_repeats_is_left_alone_from_wherever_it_is_seen() {
    let world = World::new();
    for reference in ["left", "centre", "right"] {
        let evaluate = [
            "evaluate",
            "scene:fence",
            "--reference",
            reference,
            "--json",
        ];
        let report = world.run(&evaluate).done().json();
        let fence = &report["scenes"][0]["methods"][0];
        // The walls before and behind which the patterns stand are found, and nothing is taken for its neighbour.
        assert!(fence["points"].as_u64().unwrap() > 20_000, "{fence}");
        assert!(fence["bad_1"].as_f64().unwrap() < 0.005, "{fence}");
        assert!(fence["mismatches"].as_u64().unwrap() <= 5, "{fence}");
    }
}

#[test]
fn the_topic_and_the_command_say_the_same() {
    let world = World::new();
    let run = ["run", "--scans", "3", "--record", "x.mcap"];
    world.run(&run).done();
    let evaluate = [
        "evaluate",
        "scene:all",
        "--against",
        "point,two-view",
        "--json",
    ];
    let report = world.run(&evaluate).done().json();
    let recorded = evaluations(&world, "x.mcap");
    assert_eq!(recorded.len(), 3);
    for (scene, recorded) in report["scenes"].as_array().unwrap().iter().zip(&recorded) {
        let of = |figures: &serde_json::Value, key: &str| figures[key].as_f64().unwrap() as f32;
        let method = &scene["methods"][0];
        let channels = method["channels"].as_array().unwrap();
        let figures: Vec<_> = std::iter::once(method).chain(channels).collect();
        let scores = recorded.view().scores;
        assert_eq!(figures.len(), scores.len());
        for (figures, score) in figures.into_iter().zip(scores) {
            assert_eq!(of(figures, "coverage"), score.coverage, "{scene}");
            assert_eq!(of(figures, "bad_1"), score.bad_one);
            assert_eq!(of(figures, "median"), score.median);
            assert_eq!(figures["points"], score.points);
            assert_eq!(figures["mismatches"], score.mismatches);
            // The method's claim: hardly a false target in any channel of the thesis's objects.
            assert!(score.mismatches <= 2, "{scene}");
        }
        let curve = method["curve"].as_array().unwrap();
        let shares = recorded.view().curve;
        assert_eq!(curve.len(), shares.len());
        assert_eq!(of(&curve[9], "coverage"), shares[9].coverage);
        assert!(scores[0].coverage > 0.7 && scores[0].points > 10_000);
    }
    // Of the thesis's objects; the fence, the last, is made to be mistaken.
    let mismatches = |method: usize| {
        let of = |scene: &serde_json::Value| scene["methods"][method]["mismatches"].as_u64();
        let scenes = report["scenes"].as_array().unwrap();
        scenes[..3].iter().filter_map(of).sum::<u64>()
    };
    assert_eq!(
        report["methods"],
        serde_json::json!(["three-view", "point", "two-view"])
    );
    assert!(
        mismatches(1) > 1000 && mismatches(0) < mismatches(2),
        "{report}"
    );
    let again = world.run(&["replay", "x.mcap", "--from", "match", "--verify", "--json"]);
    let verified = &again.done().json()["verified"];
    assert_eq!(verified["equal"], true, "{verified}");
    assert_eq!(verified["topics"]["evaluation"]["equal"], 3);
    let other = [
        "replay",
        "x.mcap",
        "--from",
        "match",
        "--set",
        "match.reference=centre",
    ];
    let ran = world.run(&other).done();
    assert!(
        ran.err
            .contains("of another reference view: nothing is evaluated"),
        "{ran:?}"
    );
}

#[test]
fn without_a_truth_nothing_is_evaluated_and_nothing_amiss() {
    let world = World::recorded("2");
    let info = world
        .run(&["info", "x.mcap", "--check", "--json"])
        .done()
        .json();
    let topics = info["topics"].as_array().unwrap();
    let is_there = |name: &str| topics.iter().any(|topic| topic["topic"] == name);
    assert!(
        is_there("points") && !is_there("truth") && !is_there("evaluation"),
        "{info}"
    );
    let ran = world.run(&["evaluate", "scene"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(
        ran.err.contains("no truth is known of these views"),
        "{}",
        ran.err
    );
    let ran = world.run(&["evaluate", "nowhere"]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(ran.err.contains("nowhere"), "{}", ran.err);
}

#[test]
fn tuning_gives_the_same_front_every_time_with_or_without_truth() {
    let world = World::new();
    let sweep = ["tune", "scene:tab", "--sweep", "match.run=3,9", "--json"];
    let without = world.run(&sweep).done().json();
    assert_eq!(without, world.run(&sweep).done().json());
    let lines = without["combinations"].as_array().unwrap();
    assert_eq!(lines.len(), 2);
    assert!(lines[0]["coverage"].as_f64() <= lines[1]["coverage"].as_f64());
    assert!(
        lines[0]["bad_1"].is_null() && lines[0]["contradicted"].is_f64(),
        "{without}"
    );
    let with = world
        .run(&[&sweep[..], &["--truth"]].concat())
        .done()
        .json();
    let lines = with["combinations"].as_array().unwrap();
    assert!(lines.iter().all(|line| line["bad_1"].is_f64()), "{with}");
    assert!(lines.iter().any(|line| line["on_front"] == true));
    let ran = world.run(&[
        "tune",
        "scene:tab",
        "--sweep",
        "match.orientation_tolerence=20",
    ]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(
        ran.err.contains("do you mean match.orientation_tolerance?"),
        "{}",
        ran.err
    );
}

#[test]
fn the_thesiss_photographs_are_compared_with_their_true_contours() {
    let world = World::new();
    let evaluate = [
        "evaluate",
        "scene:thesis",
        "--profile",
        "thesis",
        "--against",
        "point,two-view",
    ];
    let report = world
        .run(&[&evaluate[..], &["--json"]].concat())
        .done()
        .json();
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let (mut seen, mut matched, mut wrong) = (0.0, 0.0, [0.0; 3]);
    for scene in report["scenes"].as_array().unwrap() {
        let contours = &scene["contours"];
        let channels = contours["curves"].as_array().unwrap();
        let variances: Vec<f64> = channels
            .iter()
            .map(|channel| number(&channel["sigma_squared"]))
            .collect();
        assert_eq!(variances, [30.0, 20.0, 10.0]);
        for (at, channel) in channels.iter().enumerate() {
            let counted = number(&channel["contours_px"]);
            assert!(counted > 900.0, "{scene}");
            assert!(number(&channel["on_curves"]) > 0.85, "{scene}");
            let three_view = &contours["methods"][0][at];
            seen += number(&channel["curves_seen"]);
            matched += number(&three_view["curves_seen"]);
            assert!(number(&three_view["points"]) > 400.0, "{scene}");
            assert!(number(&three_view["covered_px"]) > 0.7 * counted, "{scene}");
            // The thesis's claim: all that is matched in three views is right.
            assert_eq!(three_view["points_over_2"], 0, "{scene}");
            assert_eq!(three_view["curves_over_2"], 0, "{scene}");
            assert!(
                number(&three_view["firm_points_over_1"])
                    <= 0.02 * number(&three_view["firm_points"]),
                "{scene}"
            );
            for (method, wrong) in wrong.iter_mut().enumerate() {
                *wrong += number(&contours["methods"][method][at]["points_over_2"]);
            }
        }
    }
    assert!(matched > 0.85 * seen, "{matched} of {seen}");
    // And its rivals', in the order they are asked for, is not.
    assert!(
        wrong[0] == 0.0 && wrong[1] > 0.0 && wrong[2] > 0.0,
        "{wrong:?}"
    );
    let said = world.run(&evaluate).done().out;
    let table = said.split("the thesis's table").nth(1).unwrap();
    let lines = |method: &str| table.lines().filter(|line| line.contains(method)).count();
    // Nine sets, and all together.
    assert_eq!(
        ["three-view", "point ", "two-view"].map(lines),
        [10, 10, 10]
    );
}

#[test]
fn cameras_out_of_line_keep_the_thesiss_claim_whichever_view_is_the_reference() {
    let world = World::new();
    for reference in ["left", "centre", "right"] {
        let report = world
            .run(&[
                "evaluate",
                "scene:thesis-screwdriver-misaligned",
                "--profile",
                "thesis",
                "--set",
                &format!("match.reference={reference}"),
                "--json",
            ])
            .done()
            .json();
        let contours = &report["scenes"][0]["contours"];
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        for (channel, three_view) in contours["curves"]
            .as_array()
            .unwrap()
            .iter()
            .zip(contours["methods"][0].as_array().unwrap())
        {
            let covered = number(&three_view["covered_px"]) / number(&channel["contours_px"]);
            assert!(covered > 0.8, "{reference}: {covered}");
            assert_eq!(three_view["points_over_2"], 0, "{reference}");
            assert_eq!(three_view["curves_over_2"], 0, "{reference}");
        }
    }
}
