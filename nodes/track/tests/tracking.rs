//! What the tracker makes of contours that are known.
#![expect(clippy::unwrap_used, reason = "tests")]

mod contours;

use std::collections::HashMap;
use std::f32::consts::{FRAC_PI_2, PI};

use contours::{down, noise, of, together, waves};
use messages::{Curve, Curves, CurvesView, Edge, Edges, EdgesView, ImageView, NONE, Owned, Size};
use track::{Settings, Tracked, Tracker};

const SIZE: Size = Size::new(120, 100);

/// The curves of these edges.
fn track(settings: &Settings, edges: &[Edge], size: Size) -> (Owned<Curves>, Tracked) {
    let mut curves = Owned::<Curves>::new(size);
    let mut tracker = Tracker::new(settings, size);
    let tracked = curves.fill(|room| tracker.process(EdgesView { edges }, size, room));
    assert!(curves.view().is_sound());
    (curves, tracked)
}

fn by_default(edges: &[Edge]) -> Owned<Curves> {
    track(&Settings::default(), edges, SIZE).0
}

fn distance(a: &Edge, b: &Edge) -> f32 {
    (a.x - b.x).hypot(a.y - b.y)
}

fn points_of<'a>(view: &CurvesView<'a>, curve: usize) -> &'a [Edge] {
    view.curves[curve].points(view.points)
}

/// What makes an edge the same edge.
fn identity(edge: &Edge) -> [u32; 2] {
    [edge.x.to_bits(), edge.y.to_bits()]
}

#[test]
fn a_circle_is_one_closed_curve_in_order_from_its_topmost_point() {
    for radius in [4.0, 11.3, 37.0] {
        for sign in [1.0, -1.0] {
            let edges = of(SIZE, |x, y| {
                sign * (radius - (x - 60.2f32).hypot(y - 49.7)) * 5.0
            });
            let curves = by_default(&edges);
            let view = curves.view();
            assert_eq!(view.curves.len(), 1, "radius {radius}");
            assert_eq!(view.points.len(), edges.len());
            // What lists one crossing a pixel leaves gaps of a little over two pixels, here and there.
            assert!(
                view.points
                    .windows(2)
                    .all(|pair| distance(&pair[0], &pair[1]) < 2.3)
            );
            assert!(distance(&view.points[0], view.points.last().unwrap()) < 2.3);
            assert_eq!(view.points[0], edges[0]);
            // Once around, and no more: the angle grows all the way, whichever way around the bright side is.
            let angle = |edge: &Edge| (edge.y - 49.7).atan2(edge.x - 60.2);
            let turn =
                |pair: &[Edge]| (angle(&pair[1]) - angle(&pair[0]) + PI).rem_euclid(2.0 * PI) - PI;
            assert!(view.points.windows(2).all(|pair| turn(pair) * sign < 0.02));
        }
    }
}

#[test]
fn every_line_of_a_grating_is_one_curve_and_none_jumps_to_the_next() {
    for degrees in [0.0f32, 17.0, 45.0, 72.0, 90.0, 118.0, 135.0] {
        for period in [5.0, 8.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let phase = |x: f32, y: f32| (x * cos + y * sin) * 2.0 / period + 0.137;
            // A square wave, blurred as a lens blurs it.
            let edges = of(SIZE, |x, y| 40.0 * (PI * phase(x, y)).sin());
            let curves = by_default(&edges);
            let view = curves.view();
            let line = |edge: &Edge| phase(edge.x, edge.y).round() as i32;
            let mut curves_of = HashMap::<i32, usize>::new();
            for curve in view.curves {
                let lines: Vec<i32> = curve.points(view.points).iter().map(line).collect();
                assert!(lines.iter().all(|&l| l == lines[0]), "{degrees}° jumps");
                *curves_of.entry(lines[0]).or_default() += 1;
            }
            assert!(
                curves_of.values().all(|&count| count == 1),
                "{degrees}° breaks"
            );
            assert!(
                view.points.len() as f32 > 0.97 * edges.len() as f32,
                "{degrees}°, period {period}"
            );
        }
    }
}

/// A trunk down to row 50 and two arms that part from there; the bright side to the right.
fn arms() -> [Vec<Edge>; 3] {
    let slope = 0.35f32;
    [
        down(10..50, |_| (60.3, 0.0)),
        down(50..90, |y| (60.3 - slope * (y - 48.0), slope.atan())),
        down(50..90, |y| (60.3 + slope * (y - 48.0), -slope.atan())),
    ]
}

#[test]
fn a_curve_that_branches_is_followed_into_all_arms() {
    let [trunk, left, right] = arms();
    let edges = together(&[trunk, left, right]);
    let curves = by_default(&edges);
    let view = curves.view();
    assert_eq!(view.curves.len(), 2);
    let (through, branch) = match view.curves {
        [a, b] if a.count > b.count => (a, b),
        [a, b] => (b, a),
        _ => unreachable!(),
    };
    assert_eq!([through.count, branch.count], [80, 41]);
    assert_eq!([through.parent, branch.parent], [NONE, through.label]);
    // The branch begins with the point it shares, the last of the trunk.
    let shared = branch.points(view.points)[0];
    assert_eq!(shared.y, 49.0);
    assert!(through.points(view.points).contains(&shared));
}

#[test]
fn of_curves_that_merge_one_is_followed_on() {
    let upside_down = |mut edges: Vec<Edge>| {
        for edge in &mut edges {
            edge.y = 99.0 - edge.y;
            edge.orientation = -edge.orientation;
        }
        edges
    };
    let edges = together(&arms().map(upside_down));
    let curves = by_default(&edges);
    let view = curves.view();
    let counts: Vec<u32> = view.curves.iter().map(|curve| curve.count).collect();
    assert_eq!(counts.iter().sum::<u32>(), 121);
    assert_eq!(counts.iter().max(), Some(&80));
    // The other ends with the point it shares.
    let merging = view
        .curves
        .iter()
        .find(|curve| curve.parent != NONE)
        .unwrap();
    assert_eq!(merging.points(view.points).last().unwrap().y, 50.0);
}

#[test]
fn the_two_sides_of_a_thin_line_are_two_curves() {
    let edges = of(SIZE, |x, y| 30.0 - 20.0 * (x - 60.2 - 0.2 * y).abs());
    let curves = by_default(&edges);
    let view = curves.view();
    assert_eq!(view.curves.len(), 2);
    for curve in view.curves {
        let rights = curve
            .points(view.points)
            .iter()
            .filter(|edge| edge.orientation.abs() < FRAC_PI_2)
            .count();
        assert!(rights == 0 || rights == curve.count as usize);
    }
}

#[test]
fn weak_points_are_followed_from_strong_ones_only() {
    let settings = Settings {
        high: Some(6.0),
        low: Some(2.0),
        ..Settings::default()
    };
    let with = |mut edges: Vec<Edge>, magnitude: fn(f32) -> f32| {
        edges
            .iter_mut()
            .for_each(|edge| edge.magnitude = magnitude(edge.y));
        edges
    };
    let line = |x: f32| down(10..60, move |_| (x, 0.0));
    let edges = together(&[
        with(line(20.5), |y| if y < 14.0 { 7.0 } else { 3.0 }),
        with(line(40.5), |_| 5.9),
        with(line(60.5), |y| if y < 30.0 { 7.0 } else { 1.9 }),
    ]);
    let (curves, tracked) = track(&settings, &edges, SIZE);
    let view = curves.view();
    assert_eq!(
        [tracked.thresholds.high, tracked.thresholds.low],
        [6.0, 2.0]
    );
    let found: Vec<(f32, u32)> = view
        .curves
        .iter()
        .map(|curve| (curve.x, curve.count))
        .collect();
    assert_eq!(found, [(20.5, 50), (60.5, 20)]);
}

#[test]
fn a_weak_branch_of_a_strong_curve_is_followed() {
    let [mut trunk, left, mut right] = arms();
    trunk.iter_mut().for_each(|edge| edge.magnitude = 7.0);
    right.iter_mut().for_each(|edge| edge.magnitude = 3.0);
    let settings = Settings {
        high: Some(6.0),
        low: Some(2.0),
        ..Settings::default()
    };
    let (curves, _) = track(&settings, &together(&[trunk, left, right.clone()]), SIZE);
    assert_eq!(curves.view().points.len(), 121);
    let (curves, _) = track(&settings, &right, SIZE);
    assert_eq!(curves.view().curves, []);
}

#[test]
fn a_weak_curve_that_runs_into_a_strong_one_is_followed_though_it_comes_first() {
    let mut weak = down(10..40, |y| (61.1 + 0.3 * (39.0 - y), 0.3f32.atan()));
    weak.iter_mut().for_each(|edge| edge.magnitude = 3.0);
    let strong = down(20..80, |_| (60.3, 0.0));
    let settings = Settings {
        high: Some(6.0),
        low: Some(2.0),
        ..Settings::default()
    };
    let (curves, _) = track(&settings, &together(&[weak, strong]), SIZE);
    let counts: Vec<u32> = curves
        .view()
        .curves
        .iter()
        .map(|curve| curve.count)
        .collect();
    assert_eq!(counts, [31, 60]);
}

#[test]
fn short_curves_are_dropped() {
    let settings = Settings {
        min_points: 12,
        ..Settings::default()
    };
    let of_length = |x: f32, points: u32| down(20..20 + points, move |_| (x, 0.0));
    let edges = together(&[
        of_length(20.5, 11),
        of_length(40.5, 12),
        of_length(60.5, 13),
    ]);
    let (curves, _) = track(&settings, &edges, SIZE);
    let counts: Vec<u32> = curves
        .view()
        .curves
        .iter()
        .map(|curve| curve.count)
        .collect();
    assert_eq!(counts, [12, 13]);
}

#[test]
fn successive_orientations_differ_by_the_tolerance_at_most() {
    // Every tenth point the orientation turns by 30° at once.
    let edges = down(20..60, |y| {
        (60.3, ((y / 10.0).floor() * 30.0f32 - 105.0).to_radians())
    });
    for (tolerance_degrees, curves) in [(29.0, 4), (31.0, 1)] {
        let settings = Settings {
            tolerance_degrees,
            ..Settings::default()
        };
        assert_eq!(track(&settings, &edges, SIZE).0.view().curves.len(), curves);
    }
}

#[test]
fn a_gap_of_one_crossing_is_bridged_and_a_longer_one_is_not() {
    let line = down(10..60, |_| (60.3, 0.0));
    let without = |gap: std::ops::Range<usize>| {
        let mut edges = line.clone();
        edges.drain(gap);
        edges
    };
    assert_eq!(by_default(&without(20..21)).view().curves.len(), 1);
    assert_eq!(by_default(&without(20..22)).view().curves.len(), 2);
}

#[test]
fn every_edge_is_used_once_besides_the_points_branches_share() {
    for wavelength in [6.0, 9.0, 20.0] {
        let edges = of(SIZE, waves(wavelength));
        let (curves, tracked) = track(
            &Settings {
                min_points: 2,
                ..Settings::default()
            },
            &edges,
            SIZE,
        );
        let view = curves.view();
        assert_eq!(tracked.skipped, 0);
        let mut uses = HashMap::<[u32; 2], usize>::new();
        for curve in view.curves {
            let mut points = curve.points(view.points);
            if curve.parent != NONE {
                let parent = points_of(&view, curve.parent as usize);
                points = match parent.contains(&points[0]) {
                    true => &points[1..],
                    false => {
                        assert!(
                            parent.contains(points.last().unwrap()),
                            "what touches its parent shares a point"
                        );
                        &points[..points.len() - 1]
                    }
                };
            }
            points
                .iter()
                .for_each(|point| *uses.entry(identity(point)).or_default() += 1);
        }
        assert!(uses.values().all(|&count| count == 1));
        assert!(
            edges
                .iter()
                .filter(|edge| uses.contains_key(&identity(edge)))
                .count()
                == uses.len()
        );
        assert!(uses.len() as f32 > 0.9 * edges.len() as f32);
    }
}

#[test]
fn curves_are_labelled_in_raster_order_of_their_topmost_points_and_know_their_means() {
    let edges = of(SIZE, waves(12.0));
    let curves = by_default(&edges);
    let view = curves.view();
    assert!(view.curves.len() > 20);
    let topmost = |curve: &Curve| {
        let shared = usize::from(curve.parent != NONE);
        let points = curve.points(view.points);
        let own = &points[..points.len() - shared];
        own.iter().map(|edge| edge.y.floor() as u32).min()
    };
    assert!(
        view.curves
            .iter()
            .zip(&view.curves[1..])
            .all(|(a, b)| topmost(a) <= topmost(b).map(|y| y + 1))
    );
    let mut first = 0;
    for (label, curve) in (0..).zip(view.curves) {
        assert_eq!([curve.label, curve.first], [label, first]);
        first += curve.count;
        let points = curve.points(view.points);
        let mean =
            |value: fn(&Edge) -> f32| points.iter().map(value).sum::<f32>() / points.len() as f32;
        let length: f32 = points
            .windows(2)
            .map(|pair| distance(&pair[0], &pair[1]))
            .sum();
        assert!((curve.x - mean(|edge| edge.x)).abs() < 1e-3);
        assert!((curve.y - mean(|edge| edge.y)).abs() < 1e-3);
        assert!((curve.magnitude - mean(|edge| edge.magnitude)).abs() < 1e-3);
        assert!((curve.length - length).abs() < 1e-2);
    }
    assert_eq!(first as usize, view.points.len());
}

#[test]
fn points_follow_each_other_without_turning_back() {
    let edges = of(SIZE, waves(15.0));
    let curves = by_default(&edges);
    let view = curves.view();
    for curve in view.curves {
        for pair in curve.points(view.points).windows(2) {
            assert!(distance(&pair[0], &pair[1]) < 3.0);
            // The bright side is on the same hand all along: a quarter turn from the way ahead.
            let (sin, cos) = pair[0].orientation.sin_cos();
            let (dx, dy) = (pair[1].x - pair[0].x, pair[1].y - pair[0].y);
            assert!(cos * dy - sin * dx > -0.5);
        }
    }
}

/// A picture of waves with noise of one gray level, through the filter.
fn noisy_edges(seed: u64) -> Vec<Edge> {
    let mut random = noise(seed);
    let scene = waves(9.0);
    let pixels: Vec<u8> = (0..SIZE.pixels())
        .map(|i| {
            let (x, y) = (i % SIZE.width as usize, i / SIZE.width as usize);
            // Three uniform numbers of variance ⅓ add up to a nearly normal one of variance 1.
            let noise = random() + random() + random();
            (128.0 + scene(x as f32, y as f32).max(0.0) + noise).round() as u8
        })
        .collect();
    let settings = filter::Settings {
        channels: vec![1.5],
        floor: 0.0,
        ..filter::Settings::default()
    };
    let mut filter = filter::Filter::new(&settings, SIZE);
    filter.begin(ImageView { pixels: &pixels }, SIZE);
    let mut edges = Owned::<Edges>::new(SIZE);
    edges.fill(|room| filter.edges(0, room));
    edges.view().edges.to_vec()
}

#[test]
fn automatic_thresholds_and_curves_do_not_flicker_with_the_noise() {
    let frames: Vec<_> = (1..=6)
        .map(|seed| track(&Settings::default(), &noisy_edges(seed), SIZE))
        .collect();
    let lows: Vec<f32> = frames
        .iter()
        .map(|(_, tracked)| tracked.thresholds.low)
        .collect();
    let (least, most) = lows
        .iter()
        .fold((f32::MAX, 0f32), |(a, b), &low| (a.min(low), b.max(low)));
    assert!(most < 1.05 * least, "{lows:?}");
    for pair in frames.windows(2) {
        let [a, b] = [0, 1].map(|i: usize| pair[i].0.view());
        let stays = |point: &&Edge| b.points.iter().any(|other| distance(point, other) < 1.0);
        let strong: Vec<&Edge> = a
            .points
            .iter()
            .filter(|point| point.magnitude > 2.0)
            .collect();
        let staying = strong.iter().copied().filter(stays).count();
        assert!(strong.len() > 500 && staying as f32 > 0.97 * strong.len() as f32);
    }
}

#[test]
fn the_largest_input_fits_the_room_and_none_is_refused() {
    // An edge in every pixel, all going the same way, straight down: no worse case of points.
    let edges: Vec<Edge> = (0..SIZE.pixels())
        .map(|i| Edge {
            x: (i % SIZE.width as usize) as f32,
            y: (i / SIZE.width as usize) as f32,
            magnitude: 9.0,
            orientation: ((i * i) % 7) as f32 * 0.3,
            profile: [0; 8],
        })
        .collect();
    let mut tracker = Tracker::new(
        &Settings {
            min_points: 2,
            ..Settings::default()
        },
        SIZE,
    );
    let mut curves = Owned::<Curves>::new(SIZE);
    curves.fill(|room| {
        let tracked = tracker.process(EdgesView { edges: &edges }, SIZE, room);
        assert_eq!(tracked.skipped, 0);
        assert_eq!(room.curves.refused() + room.points.refused(), 0);
    });
    assert!(curves.view().is_sound() && curves.view().points.len() > edges.len() / 2);
}

#[test]
fn what_the_room_refuses_is_counted_and_the_rest_is_sound() {
    let edges = of(SIZE, waves(8.0));
    let mut tracker = Tracker::new(&Settings::default(), SIZE);
    for size in [Size::new(1, 1), Size::new(8, 8), Size::new(40, 30)] {
        let mut curves = Owned::<Curves>::new(size);
        let refused = curves.fill(|room| {
            tracker.process(EdgesView { edges: &edges }, SIZE, room);
            room.curves.refused() + room.points.refused()
        });
        assert!(refused > 0 && curves.view().is_sound());
    }
    // More curves than the room has place for, though their points would fit.
    let pairs: Vec<_> = (0..36)
        .map(|i| {
            down(i / 6 * 5..i / 6 * 5 + 2, move |_| {
                ((i % 6 * 6) as f32 + 0.5, 0.0)
            })
        })
        .collect();
    let edges = together(&pairs);
    let settings = Settings {
        min_points: 2,
        ..Settings::default()
    };
    let mut curves = Owned::<Curves>::new(Size::new(8, 8));
    let refused = curves.fill(|room| {
        Tracker::new(&settings, SIZE).process(EdgesView { edges: &edges }, SIZE, room);
        [room.curves.refused(), room.points.refused()]
    });
    assert_eq!(refused, [4, 0]);
    assert_eq!(
        [curves.view().curves.len(), curves.view().points.len()],
        [32, 64]
    );
}

#[test]
fn images_of_any_size_are_tracked_also_above_the_promised_one() {
    let mut tracker = Tracker::new(
        &Settings {
            min_points: 2,
            ..Settings::default()
        },
        Size::new(16, 16),
    );
    for size in [
        Size::new(1, 1),
        Size::new(200, 3),
        Size::new(3, 200),
        Size::new(64, 64),
    ] {
        let edges = of(size, |x, y| 8.0 * (x - y / 3.0 - 0.9));
        let mut curves = Owned::<Curves>::new(size);
        curves.fill(|room| tracker.process(EdgesView { edges: &edges }, size, room));
        assert_eq!(
            curves.view().curves.len(),
            usize::from(edges.len() > 1),
            "{size}"
        );
    }
    let mut none = Owned::<Curves>::new(Size::new(16, 16));
    none.fill(|room| tracker.process(EdgesView { edges: &[] }, Size::new(16, 16), room));
    assert_eq!(none.view().curves, []);
}

#[test]
fn the_same_edges_give_the_same_curves_whatever_came_before() {
    let [first, second] = [9.0, 14.0].map(|wavelength| of(SIZE, waves(wavelength)));
    let mut tracker = Tracker::new(&Settings::default(), SIZE);
    let mut again = |edges: &[Edge]| {
        let mut curves = Owned::<Curves>::new(SIZE);
        curves.fill(|room| tracker.process(EdgesView { edges }, SIZE, room));
        curves
    };
    let (a, _, b) = (again(&first), again(&second), again(&first));
    assert_eq!(a.view(), b.view());
    assert_eq!(a.view(), by_default(&first).view());
}

#[test]
fn damaged_edges_are_passed_over_and_counted() {
    let mut edges = of(SIZE, waves(10.0));
    let place = edges.len() / 2;
    let good = edges.remove(place);
    let expected = by_default(&edges);
    let damaged = [
        Edge {
            x: f32::NAN,
            ..good
        },
        Edge {
            y: f32::NAN,
            ..good
        },
        Edge { x: -0.5, ..good },
        Edge { x: 119.5, ..good },
        Edge { y: 99.01, ..good },
        Edge {
            y: f32::INFINITY,
            ..good
        },
        Edge {
            orientation: f32::NAN,
            ..good
        },
        Edge {
            orientation: 7.0,
            ..good
        },
        Edge {
            magnitude: f32::NAN,
            ..good
        },
        Edge {
            magnitude: f32::INFINITY,
            ..good
        },
        Edge {
            magnitude: -1.0,
            ..good
        },
        // A second one in its pixel, and one out of order.
        edges[place - 1],
        edges[0],
    ];
    for damaged in damaged {
        edges.insert(place, damaged);
        let (curves, tracked) = track(&Settings::default(), &edges, SIZE);
        assert_eq!(tracked.skipped, 1, "{damaged:?}");
        assert_eq!(curves.view(), expected.view());
        edges.remove(place);
    }
}
