//! A look at views: what is no stereo is found, and what is has nothing found of it.
#![expect(clippy::unwrap_used, reason = "tests")]

use capture::look::{Finding, Look, REFUSED_PX, look, look_but};
use messages::Size;

const SIZE: Size = Size::new(400, 300);

/// A number between 0 and 1 of a place.
fn hashed(scene: u64, x: i64, y: i64) -> f64 {
    let mut hash = (x as u64)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add((y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F))
        .wrapping_add(scene.wrapping_mul(0x1656_67B1_9E37_79F9));
    hash = (hash ^ (hash >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    hash = (hash ^ (hash >> 32)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (hash >> 11) as f64 / (1u64 << 53) as f64
}

/// A gray level of a texture whose blobs are some pixels wide.
fn texture(scene: u64, x: f64, y: f64) -> f64 {
    [4.0, 9.0, 21.0]
        .into_iter()
        .zip([30.0, 50.0, 50.0])
        .map(|(wide, strong)| {
            let (x, y) = (x / wide, y / wide);
            let (column, row) = (x.floor(), y.floor());
            let smooth = |v: f64| v * v * (3.0 - 2.0 * v);
            let (right, down) = (smooth(x - column), smooth(y - row));
            let at = |i: i64, j: i64| {
                hashed(scene + wide as u64, column as i64 + i, row as i64 + j) - 0.5
            };
            let above = at(0, 0) * (1.0 - right) + at(1, 0) * right;
            let below = at(0, 1) * (1.0 - right) + at(1, 1) * right;
            strong * (above * (1.0 - down) + below * down)
        })
        .sum::<f64>()
        + 120.0
}

/// How a view was taken.
#[derive(Clone, Copy)]
struct Taken {
    scene: u64,
    /// Steps to the right.
    place: f64,
    rows: f64,
    degrees: f64,
    scale: f64,
    gain: f64,
    noise: f64,
}

fn taken(place: f64) -> Taken {
    Taken {
        scene: 1,
        place,
        rows: 0.0,
        degrees: 0.0,
        scale: 1.0,
        gain: 1.0,
        noise: 1.0,
    }
}

/// A wall, and before it a board on the left, which is nearer.
fn picture(taken: Taken, size: Size) -> Vec<u8> {
    let middle = [size.width, size.height].map(|side| (f64::from(side) - 1.0) / 2.0);
    let (sin, cos) = taken.degrees.to_radians().sin_cos();
    let mut pixels = Vec::with_capacity(size.pixels());
    for row in 0..size.height {
        for column in 0..size.width {
            let (x, y) = (f64::from(column) - middle[0], f64::from(row) - middle[1]);
            let (x, y) = (
                (cos * x + sin * y) / taken.scale + middle[0],
                (cos * y - sin * x) / taken.scale + middle[1] - taken.rows,
            );
            let near = x + 11.0 * taken.place;
            let gray = match (60.0..200.0).contains(&near) && (50.0..260.0).contains(&y) {
                true => texture(7 * taken.scene, near, y),
                false => texture(taken.scene, x + 5.0 * taken.place, y),
            };
            let salt = 1_000 + (taken.place * 8.0) as u64;
            let pair = [0, 1].map(|k| hashed(salt + k, column.into(), row.into()).max(1e-9));
            let normal = (-2.0 * pair[0].ln()).sqrt() * (std::f64::consts::TAU * pair[1]).cos();
            let gray = taken.gain * gray + taken.noise * normal;
            pixels.push(gray.round().clamp(0.0, 255.0) as u8);
        }
    }
    pixels
}

fn looked(views: &[Taken]) -> Look {
    let pictures: Vec<Vec<u8>> = views.iter().map(|view| picture(*view, SIZE)).collect();
    let views: Vec<&[u8]> = pictures.iter().map(Vec::as_slice).collect();
    look(&views, SIZE)
}

fn found(views: &[Taken]) -> Vec<Finding> {
    looked(views).findings
}

#[test]
fn of_rectified_views_nothing_is_found() {
    let right = [0.0, 1.0, 2.0].map(taken);
    let look = looked(&right);
    assert_eq!(look.findings, []);
    for pair in &look.pairs {
        let rows = pair.rows.unwrap();
        assert!(rows.off_px < 0.05 && pair.placed > 60, "{pair:?}");
        let [least, _, most] = pair.disparities_px.unwrap();
        assert!(
            (least - 5.0).abs() < 0.2 && (most - 11.0).abs() < 0.2,
            "{pair:?}"
        );
    }
    // Nor of five, of brighter and darker ones, and where noise covers nearly all.
    assert_eq!(found(&[0.0, 1.0, 2.0, 3.0, 4.0].map(taken)), []);
    let lit = [(0.0, 1.0), (1.0, 0.5), (2.0, 0.8)];
    assert_eq!(
        found(&lit.map(|(place, gain)| Taken {
            gain,
            ..taken(place)
        })),
        []
    );
    for noise in [4.0, 12.0, 40.0] {
        assert_eq!(
            found(&right.map(|view| Taken { noise, ..view })),
            [],
            "{noise}"
        );
    }
}

#[test]
fn rows_that_are_off_are_measured_within_a_tenth() {
    let wrong = |change: fn(&mut Taken)| {
        let mut views = [0.0, 1.0, 2.0].map(taken);
        change(&mut views[1]);
        let rows = found(&views).into_iter().map(|finding| match finding {
            Finding::Rows { views, rows } => (views, rows),
            other => panic!("{other:?}"),
        });
        let rows: Vec<_> = rows.collect();
        assert_eq!(rows.len(), 2, "to both sides");
        let first = rows.iter().find(|(views, _)| *views == [0, 1]);
        first.unwrap().1
    };
    for (rows, change) in [
        (0.5, (|view| view.rows = 0.5) as fn(&mut Taken)),
        (1.0, |view| view.rows = 1.0),
        (-2.0, |view| view.rows = -2.0),
        (12.0, |view| view.rows = 12.0),
    ] {
        let found = wrong(change);
        assert!((found.offset_px - rows).abs() < 0.1, "{rows}: {found:?}");
        assert!((found.off_px - rows.abs()).abs() < 0.1, "{rows}: {found:?}");
    }
    let turned = wrong(|view| view.degrees = 1.0);
    assert!(
        (turned.turn_degrees - 1.0).abs() < 0.05 && turned.off_px > 2.0,
        "{turned:?}"
    );
    let scaled = wrong(|view| view.scale = 1.01);
    assert!(
        (scaled.scale_percent - 1.0).abs() < 0.05 && scaled.off_px > REFUSED_PX,
        "{scaled:?}"
    );
    // A quarter of a row is no harm.
    let mut views = [0.0, 1.0, 2.0].map(taken);
    views[1].rows = 0.25;
    assert_eq!(found(&views), []);
}

#[test]
fn what_is_off_on_purpose_is_made_good() {
    let pictures = [0.0, 1.0, 2.0].map(|place| {
        let rows = 1.5 * place;
        picture(
            Taken {
                rows,
                ..taken(place)
            },
            SIZE,
        )
    });
    let views: Vec<&[u8]> = pictures.iter().map(Vec::as_slice).collect();
    assert_eq!(look(&views, SIZE).findings.len(), 2);
    let drift = |view: usize, _: [f64; 2]| [0.0, 1.5 * view as f64];
    assert_eq!(look_but(&views, SIZE, &drift).findings, []);
}

#[test]
fn identical_views_and_constant_ones_are_named() {
    assert_eq!(
        found(&[0.0, 0.0, 0.0].map(taken)),
        [Finding::Identical {
            views: vec![0, 1, 2]
        }]
    );
    assert_eq!(
        found(&[0.0, 1.0, 1.0].map(taken)),
        [Finding::Identical { views: vec![1, 2] }]
    );
    let flat = Taken {
        gain: 0.0,
        noise: 0.4,
        ..taken(1.0)
    };
    assert_eq!(
        found(&[taken(0.0), flat, taken(2.0)]),
        [Finding::Constant { view: 1 }]
    );
    let names = ["a.png", "b.png", "c.png"].map(str::to_owned);
    assert_eq!(
        Finding::Identical { views: vec![0, 2] }.says(&names),
        "a.png, c.png are one and the same image to the byte: give what different cameras took at one time"
    );
}

#[test]
fn a_view_of_another_scene_is_named_and_views_of_three_are_not_blamed_on_one() {
    for odd in 0..3 {
        let mut views = [0.0, 1.0, 2.0].map(taken);
        views[odd].scene = 5;
        assert_eq!(found(&views), [Finding::Odd { view: odd }], "{odd}");
    }
    let three = [1, 5, 9].map(|scene| Taken {
        scene,
        ..taken(0.0)
    });
    assert_eq!(
        found(&three),
        [
            Finding::Apart { views: [0, 1] },
            Finding::Apart { views: [1, 2] }
        ]
    );
}

#[test]
fn a_camera_that_stood_still_is_found_whatever_its_noise() {
    let mut views = [0.0, 1.0, 2.0].map(taken);
    views[2] = Taken {
        noise: 2.0,
        ..taken(1.0)
    };
    let found = found(&views);
    let [Finding::Still { views, most_px }] = &found[..] else {
        panic!("{found:?}");
    };
    assert_eq!(*views, [1, 2]);
    assert!(*most_px < 0.2, "{most_px}");
}

#[test]
fn views_in_another_order_are_put_in_their_own() {
    for order in [[2, 1, 0], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1]] {
        let views = order.map(|place| taken(f64::from(place)));
        // Which view stands leftmost, and so on.
        let expected = [0, 1, 2].map(|place| order.iter().position(|&own| own == place).unwrap());
        assert_eq!(
            found(&views),
            [Finding::Order {
                order: expected.to_vec()
            }],
            "{order:?}"
        );
    }
    let names = ["r.png", "c.png", "l.png"].map(str::to_owned);
    assert_eq!(
        Finding::Order {
            order: vec![2, 1, 0]
        }
        .says(&names),
        "the views go from right to left: from left to right they are l.png, c.png, r.png"
    );
}

#[test]
fn of_patterns_that_recur_and_of_nothing_nothing_is_said() {
    let of = |gray: &dyn Fn(f64, f64, u32) -> f64| -> Vec<Finding> {
        let pictures: Vec<Vec<u8>> = (0..3u32)
            .map(|view| {
                let at = |i: usize| (i % SIZE.width as usize, i / SIZE.width as usize);
                let all = (0..SIZE.pixels()).map(at);
                all.map(|(x, y)| gray(x as f64, y as f64, view).round() as u8)
                    .collect()
            })
            .collect();
        let views: Vec<&[u8]> = pictures.iter().map(Vec::as_slice).collect();
        look(&views, SIZE).findings
    };
    use std::f64::consts::TAU;
    for period in [9.0, 23.0, 40.0] {
        for step in [3.0, 0.9 * period, 1.7 * period] {
            let bars = |x: f64, _: f64, view: u32| {
                120.0 + 60.0 * (TAU * (x + step * f64::from(view)) / period).sin()
            };
            let tiles = |x: f64, y: f64, view: u32| {
                let across = (TAU * (x + step * f64::from(view)) / period).sin();
                120.0 + 60.0 * across * (TAU * y / period).sin()
            };
            assert_eq!(of(&bars), [], "bars of {period}, steps of {step}");
            assert_eq!(of(&tiles), [], "tiles of {period}, steps of {step}");
        }
    }
    let noise =
        |x: f64, y: f64, view: u32| 128.0 + 40.0 * (hashed(view.into(), x as i64, y as i64) - 0.5);
    assert_eq!(of(&noise), []);
}

#[test]
fn large_pictures_are_measured_in_their_own_pixels() {
    let size = Size::new(2_500, 1_100);
    let pictures = [0.0, 1.0, 2.0].map(|place| {
        let rows = if place == 1.0 { 2.0 } else { 0.0 };
        picture(
            Taken {
                rows,
                ..taken(place * 3.0)
            },
            size,
        )
    });
    let views: Vec<&[u8]> = pictures.iter().map(Vec::as_slice).collect();
    let look = look(&views, size);
    let rows = look.pairs[0].rows.unwrap();
    assert!((rows.offset_px - 2.0).abs() < 0.15, "{rows:?}");
    assert_eq!(look.findings.len(), 2, "{:?}", look.findings);
}

#[test]
fn of_strips_of_few_rows_or_columns_nobody_says_that_they_show_something_else() {
    for size in [Size::new(640, 40), Size::new(40, 480)] {
        let pictures = [0.0, 1.0, 2.0].map(|place| picture(taken(place), size));
        let views: Vec<&[u8]> = pictures.iter().map(Vec::as_slice).collect();
        let found = look(&views, size).findings;
        let is_strange =
            |finding: &Finding| matches!(finding, Finding::Apart { .. } | Finding::Odd { .. });
        assert!(!found.iter().any(is_strange), "{size}: {found:?}");
    }
}
