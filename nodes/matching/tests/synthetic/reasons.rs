//! Scenes in which a curve cannot be matched, each for one reason that is known.

use std::f32::consts::FRAC_PI_2;

use matching::{Assignment, Method, Settings};
use messages::{Edge, NONE, Reason};

use crate::scene::{Scene, View, chance, moved, wavy};
use crate::{fence, many, noisy, run, ways};

fn of(method: Method, assignment: Assignment) -> Settings {
    Settings {
        method,
        assignment,
        ..Settings::default()
    }
}

/// Why the scene's only curve of the reference view is not matched.
fn reason(scene: &Scene, settings: &Settings) -> Reason {
    let found = run(scene, settings);
    assert!(found.matches.is_empty());
    let [reason] = found.reasons()[..] else {
        panic!("{:?}", found.rejected);
    };
    assert_eq!(found.rejected[0].curve, 0);
    reason
}

#[test]
fn every_curve_of_the_reference_view_is_either_matched_or_rejected() {
    let (mut gappy, _) = many();
    gappy.views[1].curves.truncate(20);
    gappy.views[1].points.truncate(20 * 36);
    for scene in [many().0, gappy, noisy(), fence().0] {
        for way in ways() {
            let found = run(&scene, &way);
            let matched = found.matches.iter().map(|found| found.curves[0]);
            let rejected = found.rejected.iter().map(|rejected| rejected.curve);
            assert!(rejected.clone().is_sorted());
            let mut all: Vec<u32> = matched.chain(rejected).collect();
            all.sort();
            let curves = scene.views[0].curves.len() as u32;
            assert_eq!(all, Vec::from_iter(0..curves), "{:?}", way.method);
            assert_eq!(found.reasons().len(), found.rejected.len());
        }
    }
}

#[test]
fn a_curve_that_one_view_alone_sees_has_no_partner() {
    for way in ways() {
        let mut scene = Scene::default();
        scene.views[0].push(&wavy(200.0, 50, 60, 7));
        assert_eq!(reason(&scene, &way), Reason::NoPartner, "{:?}", way.method);
    }
}

#[test]
fn a_curve_along_the_rows_is_too_flat() {
    let flat: Vec<Edge> = (0..60u8)
        .map(|i| Edge {
            x: 150.0 + f32::from(i),
            y: 80.5,
            magnitude: 10.0,
            orientation: FRAC_PI_2,
            ..Edge::default()
        })
        .collect();
    let mut scene = Scene::default();
    scene.add(&flat, |_| 6.0);
    for method in [Method::ThreeView, Method::TwoView, Method::Point] {
        assert_eq!(reason(&scene, &of(method, Assignment::Point)), Reason::Flat);
    }
}

#[test]
fn a_curve_that_two_views_see_is_refused_by_the_third() {
    let curve = wavy(200.0, 50, 60, 7);
    let mut scene = Scene::default();
    scene.views[0].push(&curve);
    scene.views[1].push(&moved(&curve, 9.0));
    for assignment in [Assignment::Point, Assignment::Curve] {
        let way = of(Method::ThreeView, assignment);
        assert_eq!(reason(&scene, &way), Reason::ThirdView);
    }
}

#[test]
fn a_loop_whose_ends_hardly_meet_does_not_close() {
    let curve = wavy(200.0, 50, 60, 7);
    let mut scene = Scene::default();
    // Each has enough in common with the whole curve in the middle, but they have little in common with each other.
    scene.views[0].push(&curve[..40]);
    scene.views[1].push(&moved(&curve, 9.0));
    scene.views[2].push(&moved(&curve[30..], 18.0));
    let settings = of(Method::ThreeView, Assignment::Curve);
    assert_eq!(reason(&scene, &settings), Reason::Loop);
}

#[test]
fn a_curve_is_matched_for_the_part_of_it_that_others_see() {
    let curve = wavy(200.0, 50, 60, 7);
    let mut scene = Scene::default();
    scene.views[0].push(&curve);
    for (steps, view) in (1u8..).zip(&mut scene.views[1..]) {
        view.push(&moved(&curve[20..40], 9.0 * f32::from(steps)));
    }
    let found = run(&scene, &of(Method::ThreeView, Assignment::Curve));
    assert!((found.matches[0].disparity - 9.0).abs() < 0.01);
    let seen = found.match_points.iter().filter(|point| point.filled == 0);
    assert_eq!(seen.count(), 20);
}

#[test]
fn a_curve_whose_parts_lie_at_three_disparities_gets_too_few_votes() {
    let curve = wavy(200.0, 50, 60, 7);
    let mut scene = Scene::default();
    scene.add(&curve, |row| 9.0 + 5.0 * (row / 20.0).floor());
    let settings = of(Method::ThreeView, Assignment::Curve);
    assert_eq!(reason(&scene, &settings), Reason::Votes);
}

#[test]
fn a_curve_with_other_gray_levels_is_unlike() {
    let curve = wavy(200.0, 50, 60, 7);
    let mut scene = Scene::default();
    for (steps, view) in (0u8..).zip(&mut scene.views) {
        let there = moved(&curve, 9.0 * f32::from(steps));
        // Other in form: what is only brighter or darker is the same.
        let striped = |e: &Edge| Edge {
            profile: match steps {
                0 => e.profile,
                _ => [10, 240, 10, 240, 10, 240, 10, 240],
            },
            ..*e
        };
        view.push(&there.iter().map(striped).collect::<Vec<_>>());
    }
    assert_eq!(reason(&scene, &Settings::default()), Reason::Unlike);
}

#[test]
fn a_curve_whose_disparity_jumps_from_row_to_row_has_no_run() {
    let curve = wavy(200.0, 50, 60, 7);
    let mut scene = Scene::default();
    // Cheap changes let every point choose its own; none of them is steady.
    scene.add(&curve, |row| 6.0 + 12.0 * chance(row as u32));
    let settings = Settings {
        change: 0.01,
        ..Settings::default()
    };
    assert_eq!(reason(&scene, &settings), Reason::Short);
    // Where changes cost more than points that are left out, they are left out.
    let settings = Settings {
        change: 10.0,
        nothing: 0.01,
        ..Settings::default()
    };
    assert_eq!(reason(&scene, &settings), Reason::Unsteady);
}

#[test]
fn a_grating_is_ambiguous_and_its_bars_are_not_unique() {
    let bar = |x: f32| {
        let edge = |row: u16| Edge {
            x,
            y: f32::from(row),
            magnitude: 10.0,
            orientation: 0.0,
            profile: [40, 40, 40, 40, 160, 160, 160, 160],
        };
        (20..280).map(edge).collect::<Vec<_>>()
    };
    let mut scene = Scene::default();
    for number in 0..36u8 {
        scene.add(&bar(30.3 + 10.0 * f32::from(number)), |_| 13.0);
    }
    for method in [Method::ThreeView, Method::Point] {
        let reasons = run(&scene, &of(method, Assignment::Point)).reasons();
        let ambiguous = reasons.iter().filter(|&&r| r == Reason::Ambiguous).count();
        assert!(ambiguous > 20, "{method:?}: {reasons:?}");
    }
    // Two bars here and one there: the better one has it.
    let mut pair = Scene::default();
    pair.add(&bar(200.3), |_| 13.0);
    let dark = |e: &Edge| Edge {
        x: e.x + 4.0,
        magnitude: 11.0,
        ..*e
    };
    let beside: Vec<Edge> = bar(200.3).iter().map(dark).collect();
    pair.views[0].push(&beside);
    let way = of(Method::TwoView, Assignment::Point);
    let found = run(&pair, &way);
    assert_eq!(found.matches.len(), 1);
    assert_eq!(found.matches[0].curves, [0, 0, NONE]);
    assert_eq!(found.reasons(), [Reason::NotUnique]);
}

#[test]
fn a_curve_that_its_neighbours_do_not_support_is_said_to_disagree() {
    // Among many curves of one disparity one of another.
    let mut scene = Scene::default();
    for number in 0..9u8 {
        let disparity = if number == 4 { 20.0 } else { 5.0 };
        let column = 100.0 + 8.0 * f32::from(number);
        scene.add(&wavy(column, 50, 12, number.into()), |_| disparity);
    }
    let reason = |change: fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        let found = run(&scene, &settings);
        let odd = found.rejected.iter().find(|rejected| rejected.curve == 4);
        odd.and_then(|odd| Reason::of(odd.reason))
    };
    assert_eq!(reason(|_| {}), Some(Reason::Neighbours));
    // Nothing is as sure as that.
    let sure = Settings {
        score_least: 1.0,
        ..Settings::default()
    };
    let unsure = run(&scene, &sure).reasons();
    assert_eq!(unsure[0], Reason::Unsure, "{unsure:?}");
    let by_curve = |settings: &mut Settings| {
        settings.assignment = Assignment::Curve;
        settings.curves.relation_strength = 1.0;
    };
    assert_eq!(reason(by_curve), Some(Reason::Neighbours));
}

#[test]
fn a_region_that_hardly_matches_is_named() {
    // Of ten curves side by side the near view shows one.
    let mut scene = Scene::default();
    for number in 0..10u8 {
        let curve = wavy(60.0 + 12.0 * f32::from(number), 100, 60, number.into());
        scene.add(&curve, |_| 8.0);
    }
    let one = wavy(60.0 + 12.0 * 5.0, 100, 60, 5);
    scene.views[1] = View::default();
    scene.views[1].push(&moved(&one, 8.0));
    let settings = Settings {
        disparity_most: Some(16.0),
        ..of(Method::Point, Assignment::Point)
    };
    let mut expected = [Reason::NoPartner; 10];
    expected[5] = Reason::Region;
    assert_eq!(run(&scene, &settings).reasons(), expected);
}
