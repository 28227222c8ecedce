//! Fusion against what was made up: points at known places, seen from a rail with noise.
#![expect(clippy::unwrap_used, reason = "tests")]

use map::{Fusion, Place, Settings};
use messages::{Calibration, Growing, Map, MapPoint, Owned, Point, Size, Sway};

const SIZE: Size = Size::new(320, 40);

const CAMERA: Calibration = Calibration {
    focal_px: 300.0,
    cx: 159.5,
    cy: 19.5,
    baseline_m: 0.05,
    calibrated: true,
};

/// A small generator with a known state: the same numbers everywhere.
struct Random(u64);

impl Random {
    /// Between −1 and 1, three times summed and scaled to a standard deviation of 1.
    fn next(&mut self) -> f64 {
        let mut one = || {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        one() + one() + one()
    }
}

/// Something to see: its place along the rail, its image row, its depth, in metres.
#[derive(Clone, Copy)]
struct Thing {
    x: f64,
    row: f32,
    z: f64,
}

fn things() -> Vec<Thing> {
    let thing = |n: u32| Thing {
        x: f64::from(n) * 0.013 - 0.8,
        row: (n * 7 % 40) as f32,
        z: 1.0 + f64::from(n * 13 % 10) * 0.1,
    };
    (0..300).map(thing).collect()
}

/// What a camera at this place sees, with this much noise in columns, in raster order.
fn seen(things: &[Thing], position_m: f64, noise: f64, random: &mut Random) -> Vec<Point> {
    let mut points: Vec<Point> = things
        .iter()
        .filter_map(|thing| {
            let u = CAMERA.cx + CAMERA.focal_px * (thing.x - position_m) / thing.z;
            let u = (u + noise * random.next()) as f32;
            let disparity = CAMERA.focal_px * CAMERA.baseline_m / thing.z + noise * random.next();
            (0.0..319.0).contains(&u).then(|| Point {
                u,
                v: thing.row,
                disparity: disparity as f32,
                score: 1.0,
                ..Point::default()
            })
        })
        .collect();
    points.sort_by(|a, b| a.v.total_cmp(&b.v).then(a.u.total_cmp(&b.u)));
    points
}

fn place(position_m: f64) -> Place {
    Place {
        position_m,
        camera: CAMERA,
        drift_px: 0.0,
        sway: Sway::NONE,
        size: SIZE,
    }
}

/// The map of a camera that goes along these places: all that is settled frame by frame, and what is still followed.
fn fused(positions: &[f64], noise: f64) -> (Vec<Vec<MapPoint>>, Vec<MapPoint>) {
    let things = things();
    let mut random = Random(7);
    let frames: Vec<_> = positions
        .iter()
        .map(|&position| (position, seen(&things, position, noise, &mut random)))
        .collect();
    fused_of(&frames, &Settings::default(), 0.0)
}

/// The map of these frames: places, and what is seen there.
fn fused_of(
    frames: &[(f64, Vec<Point>)],
    settings: &Settings,
    drift_px: f64,
) -> (Vec<Vec<MapPoint>>, Vec<MapPoint>) {
    let mut fusion = Fusion::new(settings);
    let (mut map, mut growing) = (Owned::<Map>::new(SIZE), Owned::<Growing>::new(SIZE));
    let mut settled = Vec::new();
    for (position, points) in frames {
        let place = Place {
            drift_px,
            ..place(*position)
        };
        map.fill(|map| {
            growing.fill(|growing| fusion.process(points, SIZE.height, &place, map, growing));
        });
        settled.push(map.view().points.to_vec());
    }
    (settled, growing.view().points.to_vec())
}

/// The thing that a point of the map is nearest to, relative to its depth.
fn nearest(point: &MapPoint) -> (usize, f64) {
    let distance = |thing: &Thing| {
        let y = (f64::from(thing.row) - CAMERA.cy) * thing.z / CAMERA.focal_px;
        let [x, y, z] = [
            f64::from(point.x) - thing.x,
            f64::from(point.y) - y,
            f64::from(point.z) - thing.z,
        ];
        (x * x + y * y + z * z).sqrt()
    };
    let things = things();
    let all = things.iter().map(distance).enumerate();
    all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
}

fn steps(count: u32) -> Vec<f64> {
    (0..count).map(|n| f64::from(n) * 0.02).collect()
}

#[test]
fn everything_seen_is_in_the_map_once_and_where_it_is() {
    let (settled, growing) = fused(&steps(60), 0.0);
    let all: Vec<MapPoint> = settled.into_iter().flatten().chain(growing).collect();
    let mut found: Vec<usize> = Vec::new();
    for point in &all {
        let (thing, distance) = nearest(point);
        assert!(distance < 1e-3, "{point:?} is {distance} m from anything");
        found.push(thing);
    }
    let count = found.len();
    found.sort_unstable();
    found.dedup();
    assert_eq!(found.len(), count, "some things are in the map twice");
    assert!(count >= 150, "{count}");
}

#[test]
fn many_sightings_make_a_place_more_exact_and_the_standard_deviation_says_how_exact() {
    let (settled, _) = fused(&steps(60), 0.1);
    let all: Vec<MapPoint> = settled.into_iter().flatten().collect();
    let of = |least: u32, most: u32| -> (f64, f64) {
        let with = all.iter().filter(|p| (least..=most).contains(&p.sightings));
        let pairs: Vec<(f64, f64)> = with
            .map(|point| {
                let thing = things()[nearest(point).0];
                (f64::from(point.z) - thing.z, f64::from(point.sigma))
            })
            .filter(|(error, _)| error.abs() < 0.3)
            .collect();
        assert!(pairs.len() > 10, "{least} to {most}: {}", pairs.len());
        let n = pairs.len() as f64;
        let rms = |values: &mut dyn Iterator<Item = f64>| {
            (values.map(|value| value * value).sum::<f64>() / n).sqrt()
        };
        (
            rms(&mut pairs.iter().map(|p| p.0)),
            rms(&mut pairs.iter().map(|p| p.1)),
        )
    };
    let (error, said) = of(12, 13);
    assert!(error < 0.03, "{error} m");
    assert!(
        (0.5..2.0).contains(&(said / error)),
        "said {said}, is {error}"
    );
}

#[test]
fn what_a_frame_settles_does_not_depend_on_frames_long_before() {
    let positions = steps(80);
    let (whole, _) = fused(&positions, 0.0);
    let reach = Settings::default().reach() as usize;
    let begin = 20;
    let (late, _) = fused(&positions[begin..], 0.0);
    for frame in begin + reach..80 {
        assert_eq!(late[frame - begin], whole[frame], "frame {frame}");
    }
}

/// One thing, seen in these frames, as the points of one frame each make them of it.
fn frames_of(count: usize, see: impl Fn(usize, Point) -> Vec<Point>) -> Vec<(f64, Vec<Point>)> {
    let thing = [Thing {
        x: 0.2,
        row: 9.0,
        z: 1.2,
    }];
    let positions = steps(count as u32);
    let point = |position: f64| seen(&thing, position, 0.0, &mut Random(1))[0];
    let frames = positions.iter().enumerate();
    frames
        .map(|(frame, &position)| (position, see(frame, point(position))))
        .collect()
}

/// How many points frames make with a setting of [`Settings::apart`].
fn points_apart(frames: &[(f64, Vec<Point>)], apart: f64) -> usize {
    let settings = Settings {
        apart,
        ..Settings::default()
    };
    let (settled, _) = fused_of(frames, &settings, 0.0);
    settled.iter().map(Vec::len).sum()
}

#[test]
fn what_two_channels_see_of_one_contour_is_one_point() {
    let frames = frames_of(30, |_, point| {
        let coarser = Point {
            u: point.u + 0.3,
            channel: 1,
            ..point
        };
        vec![point, coarser]
    });
    assert_eq!(
        [0.5, 0.2, 0.0].map(|apart| points_apart(&frames, apart)),
        [1, 2, 2]
    );
}

#[test]
fn a_point_that_is_lost_and_soon_seen_again_is_one_point() {
    // Unseen for four frames, which ends its track.
    let is_seen = |frame: usize| frame < 8 || (12..18).contains(&frame);
    let frames = frames_of(40, |frame, point| match is_seen(frame) {
        true => vec![point],
        false => Vec::new(),
    });
    assert_eq!([0.5, 0.0].map(|apart| points_apart(&frames, apart)), [1, 2]);
}

#[test]
fn what_was_written_before_counts_for_as_many_frames_as_reach_says_and_not_fewer() {
    let things = things();
    let (mut random, mut chance) = (Random(5), Random(11));
    let frames: Vec<(f64, Vec<Point>)> = steps(90)
        .into_iter()
        .map(|position| {
            let mut points = seen(&things, position, 0.1, &mut random);
            // Tracks break and begin again all the time.
            points.retain(|_| chance.next() > 0.4);
            (position, points)
        })
        .collect();
    let settings = Settings::default();
    let reach = settings.reach() as usize;
    let without = Settings {
        apart: 0.0,
        ..settings.clone()
    };
    let (whole, _) = fused_of(&frames, &settings, 0.0);
    let mut is_ever_other = false;
    for begin in 1..40 {
        let (late, _) = fused_of(&frames[begin..], &settings, 0.0);
        for frame in begin + without.reach() as usize..90 {
            let is_same = late[frame - begin] == whole[frame];
            assert!(is_same || frame < begin + reach, "{begin}: frame {frame}");
            is_ever_other |= !is_same;
        }
    }
    assert!(is_ever_other, "nothing is remembered");
}

#[test]
fn a_camera_that_stands_still_adds_nothing() {
    let mut positions = steps(30);
    let (moved, _) = fused(&positions, 0.0);
    positions.splice(15..15, [positions[15]; 3]);
    let (paused, growing) = fused(&positions, 0.0);
    let count = |settled: &[Vec<MapPoint>]| settled.iter().map(Vec::len).sum::<usize>();
    assert!(count(&paused) <= count(&moved) + growing.len());
}

#[test]
fn it_works_either_way() {
    let mut positions = steps(60);
    positions.reverse();
    let (settled, _) = fused(&positions, 0.0);
    let all: Vec<MapPoint> = settled.into_iter().flatten().collect();
    assert!(all.len() > 100, "{}", all.len());
    assert!(all.iter().all(|point| nearest(point).1 < 1e-3));
}
