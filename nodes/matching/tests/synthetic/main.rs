//! Scenes of shifted curves whose disparities are known exactly.
#![expect(clippy::unwrap_used, reason = "tests")]

mod further;
mod reasons;
mod scene;

use matching::{Assignment, CurveSettings, Matcher, Method, PointSettings, Reference, Settings};
use messages::{Edge, Point, Size};
use scene::{Found, Scene, View, chance, lowered, moved, wavy};

const SIZE: Size = Size::new(400, 300);

/// The default, but of a lone curve, whose ends have few neighbours to bear witness, everything is reported.
fn lone() -> Settings {
    Settings {
        score_least: 0.9,
        ..Settings::default()
    }
}

fn run(scene: &Scene, settings: &Settings) -> Found {
    scene.run(&mut Matcher::new(settings, &[1.0]), SIZE)
}

/// Many curves, each at a disparity of its own.
fn many() -> (Scene, Vec<f32>) {
    let mut scene = Scene::default();
    let mut truth = Vec::new();
    for number in 0..48 {
        let (column, row) = (number % 8, number / 8);
        let disparity = 3.0 + 0.75 * number as f32 * 0.5;
        let curve = wavy(
            60.0 + 42.0 * column as f32,
            10 + 48 * row,
            36,
            number as u32,
        );
        truth.push(disparity);
        scene.add(&curve, |_| disparity);
    }
    (scene, truth)
}

/// Every way of matching: the method, its rivals, and what each assigns.
fn ways() -> impl Iterator<Item = Settings> {
    let curves = [Method::ThreeView, Method::TwoView].map(|method| {
        [Assignment::Point, Assignment::Curve].map(|assignment| Settings {
            method,
            assignment,
            ..lone()
        })
    });
    let points = Settings {
        method: Method::Point,
        ..lone()
    };
    curves.into_iter().flatten().chain([points])
}

#[test]
fn all_shifted_curves_are_found_and_none_is_wrong() {
    let (scene, truth) = many();
    let found = run(&scene, &lone());
    assert_eq!(found.matches.len(), truth.len());
    for (disparity, points) in truth.iter().zip(&found.by_curve(truth.len())) {
        assert!(points.len() >= 34, "{} points at {disparity}", points.len());
        assert!(
            points
                .iter()
                .all(|point| (point.disparity - disparity).abs() < 0.02),
            "{disparity}"
        );
    }
}

#[test]
fn views_of_other_gain_and_offset_find_the_same_points() {
    let (scene, truth) = many();
    let found = run(&scene, &lone());
    for (gain, offset) in [(0.4, 0.0), (0.6, 20.0), (1.0, 45.0), (1.3, 0.0)] {
        for view in 0..3 {
            let (mut other, _) = many();
            for edge in &mut other.views[view].points {
                edge.magnitude *= gain;
                edge.profile = edge
                    .profile
                    .map(|level| (gain * f32::from(level) + offset).round() as u8);
            }
            let other = run(&other, &lone());
            assert_eq!(other.matches.len(), truth.len(), "{view}: {gain}, {offset}");
            let (count, all) = (other.points.len(), found.points.len());
            assert!(count * 50 >= all * 49, "{count} of {all}");
            for (disparity, points) in truth.iter().zip(&other.by_curve(truth.len())) {
                assert!(
                    points
                        .iter()
                        .all(|p| (p.disparity - disparity).abs() < 0.02)
                );
            }
        }
    }
}

#[test]
fn whole_curves_are_found_by_votes_and_a_closed_loop_too() {
    let (scene, truth) = many();
    let found = run(
        &scene,
        &Settings {
            assignment: Assignment::Curve,
            ..Settings::default()
        },
    );
    assert_eq!(found.matches.len(), truth.len());
    for (disparity, points) in truth.iter().zip(&found.by_curve(truth.len())) {
        assert!(
            points
                .iter()
                .all(|point| (point.disparity - disparity).abs() < 0.02),
            "{disparity}"
        );
    }
    assert!(
        found
            .matches
            .iter()
            .all(|found| found.residual < 0.1 && found.score > 0.9)
    );
    assert!(
        found
            .matches
            .iter()
            .all(|found| found.curves[0] == found.curves[1] && found.curves[1] == found.curves[2])
    );
}

#[test]
fn the_thesis_profile_finds_what_lies_near_its_initial_estimate() {
    let mut scene = Scene::default();
    scene.add(&wavy(200.0, 20, 80, 1), |_| 31.0);
    scene.add(&wavy(300.0, 120, 80, 2), |_| 5.0);
    let found = scene.run(&mut Matcher::new(&Settings::thesis(), &[30.0]), SIZE);
    assert_eq!(found.matches.len(), 1);
    assert!((found.matches[0].disparity - 31.0).abs() < 0.1);
}

#[test]
fn whole_curves_find_by_how_many_rows_cameras_are_out_of_line() {
    for out in [[1.0f32, -1.0], [-1.3, 0.4], [2.5, 2.0], [0.0, 0.0]] {
        let mut scene = Scene::default();
        let mut truth = Vec::new();
        for number in 0..12 {
            let (column, row) = (number as usize % 4, number as usize / 4);
            let disparity = 24.0 + 14.0 * chance(number);
            for (view, lower) in [0.0, out[0], out[1]].into_iter().enumerate() {
                let x = 120.0 + 60.0 * column as f32;
                let seen = lowered(x, 6 + 70 * row, 60, number, lower);
                scene.views[view].push(&moved(&seen, view as f32 * disparity));
            }
            truth.push(disparity);
        }
        // Neighbours have nothing to do with each other here.
        let settings = Settings {
            curves: CurveSettings {
                relation_rounds: 0,
                ..CurveSettings::thesis()
            },
            ..Settings::thesis()
        };
        let found = scene.run(&mut Matcher::new(&settings, &[30.0]), SIZE);
        assert_eq!(found.matches.len(), truth.len(), "{out:?}");
        let most = found.match_points.iter().fold(0f32, |most, point| {
            most.max((point.disparity - truth[point.point as usize / 60]).abs())
        });
        assert!(most < 0.15, "{out:?}: {most}");
    }
}

#[test]
fn a_curve_that_two_views_propose_is_rejected_by_the_third() {
    let false_curve = wavy(200.0, 50, 60, 7);
    for assignment in [Assignment::Point, Assignment::Curve] {
        for missing in 0..3 {
            let mut scene = Scene::default();
            for view in (0..3).filter(|&view| view != missing) {
                scene.views[view].push(
                    &false_curve
                        .iter()
                        .map(|e| Edge {
                            x: e.x - 9.0 * view as f32,
                            ..*e
                        })
                        .collect::<Vec<_>>(),
                );
            }
            // In the third view it lies where one motion cannot have brought it.
            scene.views[missing].push(
                &false_curve
                    .iter()
                    .map(|e| Edge {
                        x: e.x - 9.0 * missing as f32 - 6.0,
                        ..*e
                    })
                    .collect::<Vec<_>>(),
            );
            let found = run(
                &scene,
                &Settings {
                    assignment,
                    ..Settings::default()
                },
            );
            assert!(found.points.is_empty(), "{assignment:?}, view {missing}");
        }
    }
}

#[test]
fn a_curve_across_a_depth_step_gets_two_disparities() {
    let mut scene = Scene::default();
    scene.add(&wavy(200.0, 40, 120, 3), |row| {
        if row < 100.0 { 12.0 } else { 20.0 }
    });
    let found = run(&scene, &Settings::default());
    let near = |disparity: f32| {
        found
            .points
            .iter()
            .filter(|p| (p.disparity - disparity).abs() < 0.1)
            .count()
    };
    // At the step itself half of the neighbours disagree: a few points stay unsaid.
    assert!(
        near(12.0) >= 54 && near(20.0) >= 54,
        "{} {}",
        near(12.0),
        near(20.0)
    );
    assert_eq!(near(12.0) + near(20.0), found.points.len());
    assert!(
        found
            .points
            .iter()
            .all(|p| (p.disparity < 16.0) == (p.v < 100.0))
    );
}

#[test]
fn a_horizontal_stretch_is_filled_along_the_curve() {
    let mut curve = wavy(200.0, 40, 30, 5);
    let (last, profile) = (*curve.last().unwrap(), curve[0].profile);
    // Across the columns: no exact column, so nothing to match.
    for step in 1..=8 {
        curve.push(Edge {
            x: last.x.ceil() + step as f32,
            y: last.y + 0.5,
            orientation: -std::f32::consts::FRAC_PI_2,
            magnitude: 10.0,
            profile,
        });
    }
    let down = wavy(last.x + 10.0, 70, 30, 6);
    curve.extend(down.iter().map(|e| Edge { profile, ..*e }));
    let mut scene = Scene::default();
    scene.add(&curve, |_| 11.0);
    let found = run(&scene, &lone());
    assert_eq!(found.points.len(), curve.len());
    assert!(
        found
            .points
            .iter()
            .all(|p| (p.disparity - 11.0).abs() < 0.05)
    );
    let filled = found.match_points.iter().filter(|p| p.filled == 1).count();
    assert_eq!(filled, 8);
}

#[test]
fn a_grating_is_left_alone_rather_than_mismatched() {
    let mut scene = Scene::default();
    let bar: Vec<Edge> = (20..280)
        .map(|row| Edge {
            x: 0.3,
            y: row as f32,
            magnitude: 10.0,
            orientation: 0.0,
            profile: [40, 40, 40, 40, 160, 160, 160, 160],
        })
        .collect();
    for number in 0..36 {
        let bar: Vec<Edge> = bar
            .iter()
            .map(|e| Edge {
                x: e.x + 10.0 * number as f32 + 30.0,
                ..*e
            })
            .collect();
        scene.add(&bar, |_| 13.0);
    }
    let found = run(&scene, &Settings::default());
    let wrong = found
        .points
        .iter()
        .filter(|p| (p.disparity - 13.0).abs() > 1.0)
        .count();
    assert_eq!(wrong, 0, "of {}", found.points.len());
}

#[test]
fn opposite_contrast_never_matches() {
    for way in ways() {
        let (mut scene, _) = many();
        for edge in &mut scene.views[1].points {
            edge.orientation += if edge.orientation > 0.0 {
                -std::f32::consts::PI
            } else {
                std::f32::consts::PI
            };
        }
        let found = run(&scene, &way);
        assert!(found.points.is_empty(), "{:?}", way.method);
    }
}

#[test]
fn the_central_and_the_right_view_see_the_same_as_the_left() {
    let (scene, truth) = many();
    for way in ways().filter(|way| way.assignment == Assignment::Point) {
        let left = run(&scene, &way);
        for (reference, steps) in [(Reference::Centre, 1.0), (Reference::Right, 2.0)] {
            let other = run(
                &scene,
                &Settings {
                    reference,
                    ..way.clone()
                },
            );
            // Each point for itself finds now and then a chance partner in one view and not in another.
            let is_exact = way.method != Method::Point;
            assert!(!is_exact || other.points.len() == left.points.len());
            assert!(!other.points.is_empty());
            for (curve, (a, b)) in left
                .by_curve(truth.len())
                .iter()
                .zip(other.by_curve(truth.len()))
                .enumerate()
            {
                assert!(!is_exact || a.len() == b.len());
                for a in a {
                    let Some(b) = b.iter().find(|b| b.v == a.v) else {
                        assert!(!is_exact);
                        continue;
                    };
                    assert!((a.u - steps * truth[curve] - b.u).abs() < 0.01);
                    assert!((a.disparity - b.disparity).abs() < 0.02);
                }
            }
        }
    }
}

#[test]
fn points_are_in_raster_order_and_lie_where_calibration_says() {
    let (scene, _) = many();
    let found = run(&scene, &Settings::default());
    assert!(
        found
            .points
            .is_sorted_by(|a, b| (a.v as u32, a.u) <= (b.v as u32, b.u))
    );
    let camera = messages::Calibration::assumed(SIZE);
    for point in &found.points {
        assert!((f64::from(point.z) - camera.depth_m(f64::from(point.disparity))).abs() < 1e-3);
        assert!((0.0..=1.0).contains(&point.score));
    }
    let shown = found.disparity.iter().filter(|d| !d.is_nan()).count();
    assert!(shown > 0 && shown <= found.points.len());
}

#[test]
fn the_same_scan_gives_the_same_bytes() {
    let (scene, _) = many();
    for way in ways() {
        let mut matcher = Matcher::new(&way, &[1.0]);
        let first = scene.run(&mut matcher, SIZE);
        // What came in between leaves no trace.
        Scene::default().run(&mut matcher, Size::new(64, 48));
        let again = scene.run(&mut matcher, SIZE);
        assert_eq!(first.points, again.points);
        assert_eq!(first.match_points, again.match_points);
        assert_eq!(first.matches, again.matches);
    }
}

#[test]
fn empty_scans_of_any_size_give_empty_results() {
    for way in ways() {
        let mut matcher = Matcher::new(&way, &[4.0, 1.0]);
        for size in [Size::new(32, 32), Size::new(640, 480), Size::new(33, 512)] {
            let found = Scene::default().run(&mut matcher, size);
            assert!(found.points.is_empty() && found.matches.is_empty());
            assert!(found.disparity.iter().all(|d| d.is_nan()));
        }
        // Not even an index of rows.
        let found = Scene {
            rows: false,
            ..Scene::default()
        }
        .run(&mut matcher, SIZE);
        assert!(found.points.is_empty());
    }
}

#[test]
fn a_coarser_channel_fills_in_where_the_finest_has_nothing() {
    let (mut coarse, mut fine) = (Scene::default(), Scene::default());
    coarse.add(&wavy(150.0, 20, 60, 1), |_| 8.0);
    coarse.add(&wavy(300.0, 120, 60, 2), |_| 15.0);
    fine.add(&wavy(150.0, 20, 60, 1), |_| 8.0);
    let found = scene::run_channels(
        &[&coarse, &fine],
        &mut Matcher::new(&lone(), &[4.0, 1.0]),
        SIZE,
    );
    assert!(
        found
            .points
            .iter()
            .all(|p| p.channel == u32::from(p.u < 220.0))
    );
    assert!(found.points.iter().filter(|p| p.channel == 0).count() >= 58);
    let alone = Settings {
        fill_in: false,
        ..Settings::default()
    };
    let found = scene::run_channels(
        &[&coarse, &fine],
        &mut Matcher::new(&alone, &[4.0, 1.0]),
        SIZE,
    );
    assert!(found.points.iter().all(|p| p.channel == 1));
}

#[test]
fn surer_points_have_higher_scores() {
    let (mut scene, truth) = many();
    // Half of the curves look a little different from view to view.
    for View { points, .. } in &mut scene.views[1..] {
        for edge in points.iter_mut().filter(|edge| edge.y > 150.0) {
            edge.profile = edge.profile.map(|gray| gray.saturating_add(6));
            edge.orientation += 0.1;
        }
    }
    let found = run(&scene, &Settings::default());
    let mean = |below: bool| {
        let scores: Vec<f32> = found
            .points
            .iter()
            .filter(|p| (p.v > 150.0) == below)
            .map(|p| p.score)
            .collect();
        scores.iter().sum::<f32>() / scores.len() as f32
    };
    assert_eq!(found.matches.len(), truth.len());
    assert!(mean(false) > mean(true));
}

/// Texture on one slope, trembling from view to view, and as much clutter again that no two views share.
fn noisy() -> Scene {
    let gray = [60, 60, 60, 60, 140, 140, 140, 140];
    let tremble = |seed: u32| (chance(seed) - 0.5) * 0.6;
    let mut scene = Scene::default();
    for number in 0..40u32 {
        let (column, row) = (number % 10, (number / 10) as usize);
        let curve = wavy(90.0 + 30.0 * column as f32, 5 + 70 * row, 60, number);
        for (view, seen) in (0u32..).zip(&mut scene.views) {
            let moved = |(seed, e): (u32, &Edge)| Edge {
                x: e.x - view as f32 * slope(e.y) + tremble(3 * (100 * number + seed) + view),
                magnitude: 10.0,
                profile: gray,
                ..*e
            };
            seen.push(&(0..).zip(&curve).map(moved).collect::<Vec<_>>());
        }
    }
    for number in 0..900 {
        let seed = 50_000 + 10 * number;
        let curve = wavy(
            380.0 * chance(seed),
            (280.0 * chance(seed + 1)) as usize,
            12,
            seed,
        );
        let clutter = curve.iter().map(|e| Edge {
            magnitude: 10.0,
            profile: gray,
            ..*e
        });
        scene.views[number as usize % 3].push(&clutter.collect::<Vec<_>>());
    }
    scene
}

/// The disparity of a row of the noisy scene.
fn slope(row: f32) -> f32 {
    8.0 + 0.02 * row
}

fn is_off_slope(point: &Point) -> bool {
    (point.disparity - slope(point.v)).abs() > 1.0
}

#[test]
fn points_that_are_not_sure_enough_are_not_reported() {
    let found = |score_least: f32| {
        let settings = Settings {
            score_least,
            ..Settings::default()
        };
        run(&noisy(), &settings)
    };
    let (all, sure) = (found(0.0), found(0.99));
    assert!(sure.points.iter().all(|p| p.score >= 0.99));
    let kept = all.points.iter().filter(|p| p.score >= 0.99).count();
    assert_eq!(sure.points.len(), kept);
    assert_eq!(
        sure.matches.iter().map(|m| m.count).sum::<u32>() as usize,
        sure.match_points.len()
    );
    let errors = |found: &Found| found.points.iter().filter(|p| is_off_slope(p)).count();
    let (all_wrong, sure_wrong) = (errors(&all), errors(&sure));
    assert!(
        all_wrong >= 20 && 2 * sure_wrong < all_wrong,
        "{sure_wrong} of {all_wrong}"
    );
    assert!(sure.points.len() * 10 > all.points.len() * 6);
}

#[test]
fn the_surest_half_of_a_noisy_scene_has_fewer_errors_than_the_less_sure_half() {
    for method in [Method::ThreeView, Method::TwoView] {
        let settings = Settings {
            method,
            score_least: 0.0,
            ..Settings::default()
        };
        let mut points = run(&noisy(), &settings).points;
        points.sort_by(|a, b| b.score.total_cmp(&a.score));
        let errors = |points: &[Point]| points.iter().filter(|p| is_off_slope(p)).count();
        let (sure, unsure) = points.split_at(points.len() / 2);
        let [sure, unsure] = [sure, unsure].map(errors);
        assert!(unsure >= 20, "{method:?}: {unsure} of {}", points.len());
        assert!(2 * sure < unsure, "{method:?}: {sure} and {unsure}");
    }
}

#[test]
fn where_nothing_is_ambiguous_all_methods_agree_with_the_truth() {
    // A few curves, far from each other.
    let mut scene = Scene::default();
    let disparities: Vec<f32> = (0..12).map(|number| 3.0 + 2.5 * number as f32).collect();
    for (number, &disparity) in (0..).zip(&disparities) {
        let (column, row) = (number % 3, number / 3);
        let curve = wavy(
            90.0 + 120.0 * column as f32,
            10 + 70 * row,
            60,
            number as u32,
        );
        scene.add(&curve, |_| disparity);
    }
    for way in ways() {
        let found = run(&scene, &way);
        assert_eq!(found.matches.len(), disparities.len(), "{:?}", way.method);
        for (truth, points) in disparities.iter().zip(&found.by_curve(disparities.len())) {
            assert!(points.len() >= 55, "{:?}: {}", way.method, points.len());
            assert!(points.iter().all(|p| (p.disparity - truth).abs() < 0.02));
        }
    }
}

/// Like bars, no three of them evenly spaced; each view hides a quarter of them, and light differs from bar to bar and
/// view to view.
fn fence() -> (Scene, f32) {
    let disparity = 13.0;
    let mut bars: Vec<f32> = Vec::new();
    for x in (45u16..390).map(f32::from) {
        let is_even = |a: f32| {
            let middle = (x + a) / 2.0;
            x - a < 70.0 && bars.iter().any(|b| *b != a && (b - middle).abs() < 3.5)
        };
        let is_apart = bars.last().is_none_or(|last| x - last >= 7.0);
        if is_apart && !bars.iter().any(|&a| is_even(a)) {
            bars.push(x);
        }
    }
    let mut scene = Scene::default();
    for (number, x) in (0..).zip(bars) {
        for (view, seen) in (0..).zip(&mut scene.views) {
            if chance(200 + 3 * number + view) < 0.25 {
                continue;
            }
            let light = (16.0 * chance(900 + 3 * number + view)) as u8;
            let edge = |row: usize| Edge {
                x: x - disparity * view as f32,
                y: row as f32,
                magnitude: 10.0,
                orientation: 0.0,
                profile: [40, 40, 40, 40, 160, 160, 160, 160].map(|gray| gray + light),
            };
            seen.push(&(20..280).map(edge).collect::<Vec<_>>());
        }
    }
    (scene, disparity)
}

#[test]
fn among_repeated_bars_three_views_make_no_mismatch_and_both_rivals_do() {
    let (scene, disparity) = fence();
    for way in ways() {
        let found = run(
            &scene,
            &Settings {
                disparity_least: 5.0,
                disparity_most: Some(24.0),
                ..way.clone()
            },
        );
        let is_wrong = |d: f32| (d - disparity).abs() > 2.0;
        let wrong = found
            .points
            .iter()
            .filter(|p| is_wrong(p.disparity))
            .count();
        let name = (way.method, way.assignment);
        match way.method {
            Method::ThreeView => {
                assert_eq!(wrong, 0, "{name:?}");
                assert!(found.points.len() >= 2000, "{name:?}");
            }
            Method::TwoView | Method::Point => {
                assert!(wrong >= 200, "{name:?}: {wrong} of {}", found.points.len());
            }
        }
    }
}

#[test]
fn two_views_look_neither_at_the_third_nor_for_it() {
    let (scene, truth) = many();
    let (mut alone, _) = many();
    alone.views[2] = View::default();
    for way in ways().filter(|way| way.method != Method::ThreeView) {
        let (with, without) = (run(&scene, &way), run(&alone, &way));
        assert!(with.matches.len() > truth.len() / 2, "{:?}", way.method);
        assert_eq!(with.points, without.points);
        assert!(
            with.matches
                .iter()
                .all(|found| found.curves[2] == messages::NONE)
        );
        assert!(
            with.matches
                .iter()
                .all(|found| found.curves[0] == found.curves[1])
        );
    }
}

#[test]
fn a_region_of_which_too_few_points_match_is_dropped() {
    // Of ten curves side by side the near view shows only some, and too few of one scan.
    let shown = |count: usize| {
        let mut scene = Scene::default();
        for number in 0..10 {
            let curve = wavy(60.0 + 30.0 * number as f32, 100, 60, number as u32);
            scene.add(&curve, |_| 8.0);
        }
        scene.views[1].curves.truncate(count);
        scene.views[1].points.truncate(60 * count);
        let settings = Settings {
            method: Method::Point,
            disparity_most: Some(16.0),
            ..Settings::default()
        };
        let all = Settings {
            points: PointSettings {
                matched_share: 0.0,
                ..PointSettings::default()
            },
            ..settings.clone()
        };
        [run(&scene, &settings), run(&scene, &all)].map(|found| found.points.len())
    };
    let [kept, all] = shown(10);
    assert_eq!(kept, all);
    let [kept, all] = shown(5);
    assert!(kept < all && kept > 0, "{kept} of {all}");
}
