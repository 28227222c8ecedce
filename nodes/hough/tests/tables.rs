//! R-tables against slow twins and against what they are for.
#![expect(clippy::unwrap_used, reason = "tests")]

mod snakes;

use hough::{LEAST_WEIGHT, Settings, Tabulated, Tabulator, Weight, curvatures};
use messages::{Curve, Curves, CurvesView, Edge, Entry, Owned, Size, Table, Tables, TablesView};
use snakes::{message, wander};

const SIZE: Size = Size::new(90, 70);

fn tabulate(settings: &Settings, curves: CurvesView<'_>, size: Size) -> (Owned<Tables>, Tabulated) {
    let mut tables = Owned::<Tables>::new(size);
    let mut tabulator = Tabulator::new(settings, size);
    let tabulated = tables.fill(|room| tabulator.process(curves, size, room));
    assert!(tables.view().is_sound(curves.points.len()));
    (tables, tabulated)
}

fn by_default(curves: &Owned<Curves>) -> Owned<Tables> {
    let (tables, tabulated) = tabulate(&Settings::default(), curves.view(), SIZE);
    assert_eq!(tabulated.skipped, 0);
    tables
}

fn entries_of<'a>(view: &TablesView<'a>, table: &Table) -> &'a [Entry] {
    &view.entries[table.first as usize..][..table.count as usize]
}

fn scene() -> Owned<Curves> {
    let mut lists = wander(SIZE, 40, 30, 7);
    lists.extend(wander(SIZE, 1, 1, 8));
    lists.push(lists[3].clone());
    message(&lists, SIZE)
}

#[test]
fn tables_are_those_of_a_slow_twin() {
    let curves = scene();
    let tables = by_default(&curves);
    let (view, from) = (tables.view(), curves.view());
    assert_eq!(view.tables.len(), from.curves.len());
    for (table, curve) in view.tables.iter().zip(from.curves) {
        let mut expected: Vec<Entry> = curve
            .range()
            .map(|point| Entry {
                orientation: from.points[point].orientation,
                rx: curve.x - from.points[point].x,
                ry: curve.y - from.points[point].y,
                weight: 1.0,
                point: point as u32,
            })
            .collect();
        expected.sort_by(|a, b| {
            a.orientation
                .total_cmp(&b.orientation)
                .then(a.point.cmp(&b.point))
        });
        assert_eq!(entries_of(&view, table), expected);
        assert_eq!([table.curve, table.count], [curve.label, curve.count]);
        assert_eq!(
            [table.x, table.y, table.weight],
            [curve.x, curve.y, curve.count as f32]
        );
    }
}

#[test]
fn without_r_tables_the_index_of_rows_is_the_same() {
    let curves = scene();
    let settings = Settings {
        tables: Some(false),
        ..Settings::default()
    };
    let (bare, _) = tabulate(&settings, curves.view(), SIZE);
    let with = by_default(&curves);
    assert_eq!(bare.view().rows, with.view().rows);
    assert_eq!(bare.view().order, with.view().order);
    assert!(bare.view().tables.is_empty() && bare.view().entries.is_empty());
}

#[test]
fn the_index_of_rows_is_that_of_a_slow_twin() {
    let curves = scene();
    let tables = by_default(&curves);
    let (view, points) = (tables.view(), curves.view().points);
    assert_eq!(view.rows.len(), SIZE.height as usize + 1);
    for row in 0..SIZE.height as usize {
        let mut expected: Vec<u32> = (0..points.len() as u32)
            .filter(|&i| points[i as usize].y.floor() == row as f32)
            .collect();
        expected.sort_by(|&a, &b| {
            points[a as usize]
                .x
                .total_cmp(&points[b as usize].x)
                .then(a.cmp(&b))
        });
        assert_eq!(
            view.order[view.rows[row] as usize..view.rows[row + 1] as usize],
            expected
        );
    }
    assert_eq!(*view.rows.last().unwrap() as usize, points.len());
}

#[test]
fn all_votes_for_a_shifted_curve_meet_at_its_centroid_less_the_shift() {
    let disparity = 7.25;
    let curves = scene();
    let tables = by_default(&curves);
    let (view, from) = (tables.view(), curves.view());
    for (table, curve) in view.tables.iter().zip(from.curves) {
        let shifted: Vec<Edge> = curve
            .points(from.points)
            .iter()
            .map(|point| Edge {
                x: point.x - disparity,
                ..*point
            })
            .collect();
        // One bin a whole pixel of displacement, in the row of the centroid.
        let mut votes = vec![0.0; 200];
        for entry in entries_of(&view, table) {
            for point in shifted
                .iter()
                .filter(|point| point.orientation == entry.orientation)
            {
                let (x, y) = (point.x + entry.rx, point.y + entry.ry);
                if (y - table.y).abs() < 0.5 {
                    votes[(table.x - x + 100.0).round() as usize] += entry.weight;
                }
            }
        }
        assert!(
            votes[107] >= table.weight,
            "all points of curve {} vote for the truth",
            table.curve
        );
        assert!(votes.iter().all(|&v| v <= votes[107]));
    }
}

#[test]
fn weights_are_what_each_setting_says_and_one_on_average() {
    let curves = scene();
    let from = curves.view();
    let mean =
        from.points.iter().map(|point| point.magnitude).sum::<f32>() / from.points.len() as f32;
    let mut bends = vec![0.0; from.points.len()];
    for curve in from.curves {
        curvatures(curve.points(from.points), &mut bends[curve.range()]);
    }
    let mean_bend = bends.iter().sum::<f32>() / bends.len() as f32;
    let expected = |weight: Weight, point: usize| match weight {
        Weight::Unity => 1.0,
        Weight::Magnitude => (from.points[point].magnitude / mean).max(LEAST_WEIGHT),
        Weight::Combined => 2.5 + (from.points[point].magnitude / mean).max(LEAST_WEIGHT),
        Weight::Curvature => (bends[point] / mean_bend).max(LEAST_WEIGHT),
    };
    for weight in [
        Weight::Unity,
        Weight::Magnitude,
        Weight::Combined,
        Weight::Curvature,
    ] {
        let (tables, _) = tabulate(
            &Settings {
                weight,
                constant: 2.5,
                ..Settings::default()
            },
            from,
            SIZE,
        );
        let view = tables.view();
        for entry in view.entries {
            let expected = expected(weight, entry.point as usize);
            assert!(
                (entry.weight - expected).abs() < 1e-3 * expected,
                "{weight:?}: {} {expected}",
                entry.weight
            );
        }
        for table in view.tables {
            let sum: f32 = entries_of(&view, table)
                .iter()
                .map(|entry| entry.weight)
                .sum();
            assert!((table.weight - sum).abs() < 1e-3 * sum && sum > 0.0);
        }
    }
}

#[test]
fn a_straight_curve_of_equal_points_keeps_a_table_under_every_weight() {
    let line = vec![
        (0..20)
            .map(|i| Edge {
                x: 5.5,
                y: i as f32,
                ..Edge::default()
            })
            .collect(),
    ];
    let curves = message(&line, SIZE);
    for weight in [
        Weight::Unity,
        Weight::Magnitude,
        Weight::Combined,
        Weight::Curvature,
    ] {
        let (tables, _) = tabulate(
            &Settings {
                weight,
                constant: 1.0,
                ..Settings::default()
            },
            curves.view(),
            SIZE,
        );
        assert!(tables.view().tables[0].weight > 1.0, "{weight:?}");
    }
}

#[test]
fn damaged_points_and_curves_are_passed_over_and_counted() {
    let good = scene();
    let from = good.view();
    let mut points = from.points.to_vec();
    let mut curves = from.curves.to_vec();
    points[10].x = f32::NAN;
    points[20].y = -1.0;
    points[50].y = 69.5;
    points[60].orientation = f32::INFINITY;
    points[70].magnitude = f32::NAN;
    curves[5].first = points.len() as u32 - 3;
    curves[6].count = u32::MAX;
    curves[7].x = f32::NAN;
    curves.push(Curve {
        first: u32::MAX,
        count: u32::MAX,
        label: 99,
        ..Curve::default()
    });
    let damaged = CurvesView {
        curves: &curves,
        points: &points,
    };
    for weight in [
        Weight::Unity,
        Weight::Magnitude,
        Weight::Combined,
        Weight::Curvature,
    ] {
        let (tables, tabulated) = tabulate(
            &Settings {
                weight,
                constant: 1.0,
                ..Settings::default()
            },
            damaged,
            SIZE,
        );
        let view = tables.view();
        assert_eq!(tabulated.skipped, 5 + 4);
        assert_eq!(view.tables.len(), curves.len());
        assert_eq!(
            [0, 1, 5, 6, 7, 42].map(|table: usize| view.tables[table].count),
            [28, 29, 0, 0, 0, 0]
        );
        assert_eq!(view.order.len(), points.len() - 5);
        assert!(
            view.entries
                .iter()
                .all(|entry| (entry.rx + entry.ry + entry.weight).is_finite())
        );
    }
}

#[test]
fn the_largest_input_fits_the_room_and_what_is_more_is_counted() {
    let curves = message(&wander(SIZE, 3150, 3, 1), SIZE);
    assert_eq!(curves.view().points.len(), SIZE.pixels() / 2 * 3);
    let mut tabulator = Tabulator::new(&Settings::default(), SIZE);
    let mut tables = Owned::<Tables>::new(SIZE);
    let mut refused = |tables: &mut Owned<Tables>| {
        tables.fill(|room| {
            tabulator.process(curves.view(), SIZE, room);
            [
                room.tables.refused(),
                room.entries.refused(),
                room.rows.refused(),
                room.order.refused(),
            ]
        })
    };
    assert_eq!(refused(&mut tables), [0; 4]);
    let mut small = Owned::<Tables>::new(Size::new(40, 30));
    assert!(refused(&mut small).iter().all(|&refused| refused > 0));
    assert!(small.view().is_sound(curves.view().points.len()));
}

#[test]
fn nothing_and_the_smallest_image_are_tabulated() {
    for size in [Size::new(0, 0), Size::new(1, 1)] {
        let (tables, tabulated) = tabulate(
            &Settings::default(),
            CurvesView {
                curves: &[],
                points: &[],
            },
            size,
        );
        assert_eq!(tabulated.skipped, 0);
        assert_eq!(tables.view().rows, vec![0; size.height as usize + 1]);
    }
}

#[test]
fn the_same_curves_give_the_same_tables_whatever_came_before() {
    let (first, second) = (scene(), message(&wander(SIZE, 9, 50, 3), SIZE));
    for weight in [Weight::Unity, Weight::Curvature] {
        let settings = Settings {
            weight,
            ..Settings::default()
        };
        let mut tabulator = Tabulator::new(&settings, SIZE);
        let mut again = |curves: &Owned<Curves>| {
            let mut tables = Owned::<Tables>::new(SIZE);
            tables.fill(|room| tabulator.process(curves.view(), SIZE, room));
            tables
        };
        let (a, _, b) = (again(&first), again(&second), again(&first));
        assert_eq!(a.view(), b.view());
        assert_eq!(a.view(), tabulate(&settings, first.view(), SIZE).0.view());
    }
}
