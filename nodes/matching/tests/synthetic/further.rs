//! More than three views.

use matching::{Matcher, Method, Reference, Settings};
use messages::Edge;

use super::scene::{Found, Scene, View, chance, moved, wavy};
use super::{SIZE, lone, many, run};

fn with_reference(view: u32) -> Settings {
    Settings {
        reference: Reference::View(view),
        ..lone()
    }
}

/// Root mean square of the errors of all points.
fn rms(found: &Found, disparity: f32) -> f32 {
    let squares = found
        .points
        .iter()
        .map(|p| (p.disparity - disparity).powi(2));
    (squares.sum::<f32>() / found.points.len() as f32).sqrt()
}

/// A curve seen in so many views, everywhere with errors of its own up to so many pixels.
fn shaken(views: usize, most: f32, disparity: f32) -> Scene {
    let mut scene = Scene::of_views(views);
    for number in 0..12u32 {
        let (column, row) = (number % 4, number / 4);
        let curve = wavy(
            120.0 + 70.0 * column as f32,
            10 + 90 * row as usize,
            80,
            number,
        );
        for (steps, view) in (0u32..).zip(&mut scene.views) {
            let seed = |e: &Edge| number * 1_000_000 + steps * 10_000 + e.y as u32;
            let shaken = |e: &Edge| Edge {
                x: e.x - steps as f32 * disparity + most * (2.0 * chance(seed(e)) - 1.0),
                ..*e
            };
            view.push(&curve.iter().map(shaken).collect::<Vec<_>>());
        }
    }
    scene
}

#[test]
fn every_view_can_be_the_reference_and_three_views_have_their_curves_named() {
    let (three, truth) = many();
    let mut scene = Scene::of_views(5);
    for (label, disparity) in truth.iter().enumerate() {
        let curve = three.views[0].curves[label].points(&three.views[0].points);
        scene.add(&moved(curve, -40.0), |_| disparity / 2.0);
    }
    for reference in 0..5u32 {
        let found = run(&scene, &with_reference(reference));
        assert_eq!(found.matches.len(), truth.len(), "reference {reference}");
        for found in &found.matches {
            assert!(found.curves[0] == found.curves[1] && found.curves[1] == found.curves[2]);
        }
        for (disparity, points) in truth.iter().zip(found.by_curve(truth.len())) {
            let off = |d: f32| (d - disparity / 2.0).abs();
            assert!(points.len() >= 34 && points.iter().all(|p| off(p.disparity) < 0.02));
        }
    }
}

#[test]
fn seven_views_measure_finer_than_three() {
    // Straightening along curves would hide what views are worth.
    let settings = Settings {
        straighten: 0,
        ..with_reference(1)
    };
    let [three, seven] = [3, 7].map(|views| rms(&run(&shaken(views, 0.15, 6.0), &settings), 6.0));
    // By least squares errors shrink with the root of the sum of squared distances from the mean place: 2 and 28.
    let expected = (2.0f32 / 28.0).sqrt();
    let seen = seven / three;
    assert!(
        (seen / expected - 1.0).abs() < 0.25,
        "{three} {seven}: {seen} of {expected}"
    );
}

#[test]
fn what_is_hidden_on_one_side_is_found_on_the_other() {
    for hidden in [[0, 1], [3, 4]] {
        let mut scene = Scene::of_views(5);
        scene.add(&wavy(200.0, 50, 60, 7), |_| 9.0);
        for view in hidden {
            scene.views[view] = View::default();
        }
        let found = run(&scene, &with_reference(2));
        assert_eq!(found.matches.len(), 1, "{hidden:?}");
        let points = &found.points;
        assert!(points.len() > 55 && points.iter().all(|p| (p.disparity - 9.0).abs() < 0.02));
    }
}

#[test]
fn what_three_views_see_by_chance_further_ones_do_not_confirm() {
    let curve = wavy(250.0, 50, 60, 7);
    // In the views next to the reference something looks just like the curve; the curve itself is a little paler.
    let decoy = |scene: &mut Scene| {
        for view in 0..3 {
            scene.views[view].push(&moved(&curve, 20.0 * view as f32 - 20.0));
        }
    };
    let paler = |scene: &mut Scene| {
        let paler = |e: &Edge, steps: usize| Edge {
            x: e.x - 6.0 * (steps as f32 - 1.0),
            magnitude: 0.9 * e.magnitude,
            ..*e
        };
        for (steps, view) in scene.views.iter_mut().enumerate().filter(|(s, _)| *s != 1) {
            view.push(&curve.iter().map(|e| paler(e, steps)).collect::<Vec<_>>());
        }
    };
    let disparity_in = |views: usize| {
        let mut scene = Scene::of_views(views);
        decoy(&mut scene);
        paler(&mut scene);
        let settings = Settings {
            margin: 0.0,
            ..with_reference(1)
        };
        let found = run(&scene, &settings);
        found.matches.iter().map(|found| found.disparity).next()
    };
    assert!(disparity_in(3).is_some_and(|d| (d - 20.0).abs() < 0.1));
    assert!(disparity_in(7).is_some_and(|d| (d - 6.0).abs() < 0.1));
}

#[test]
fn the_rivals_look_at_three_views_only() {
    let (three, _) = many();
    let mut five = Scene::of_views(5);
    for (own, view) in five.views[1..4].iter_mut().zip(three.views) {
        *own = view;
    }
    let (three, _) = many();
    for method in [Method::TwoView, Method::Point] {
        let in_method = |view: u32| Settings {
            method,
            ..with_reference(view)
        };
        let among_five = run(&five, &in_method(2));
        let alone = run(&three, &in_method(1));
        assert_eq!(among_five.match_points, alone.match_points);
        assert!(!alone.match_points.is_empty());
    }
}

#[test]
fn a_matcher_goes_from_seven_views_to_three_and_back() {
    let settings = with_reference(1);
    let mut matcher = Matcher::new(&settings, &[1.0]);
    let (seven, three) = (shaken(7, 0.1, 5.0), shaken(3, 0.1, 5.0));
    let first = seven.run(&mut matcher, SIZE);
    assert_eq!(
        three.run(&mut matcher, SIZE).points,
        run(&three, &settings).points
    );
    assert_eq!(seven.run(&mut matcher, SIZE).points, first.points);
}
