//! The tab: a bracket of bent sheet metal with a bore, holes and a slot, on a bench with its nut and washer.

use std::f32::consts::FRAC_PI_2;

use parry3d::math::{Pose, Vec3};

use super::paint;
use super::render::{Camera, Scene};
use super::solid::{Hole, Part, rectangle, regular};

/// The sheet is 60 mm wide and 3 mm thick: a foot with a slot, a fold, an upright with a bore and two holes.
pub(super) fn sheet() -> Part {
    const WIDTH: f32 = 30.0;
    const THICK: f32 = 3.0;
    let cell = |y: [f32; 2], radii: [f32; 4], hole: Hole| {
        Part::default().plate(
            &rectangle([-WIDTH, y[0]], [WIDTH, y[1]], radii, 1.5),
            &hole,
            THICK,
        )
    };
    let half = |x: [f32; 2], y: [f32; 2], hole: Hole| {
        Part::default().plate(
            &rectangle([x[0], y[0]], [x[1], y[1]], [0.0; 4], 1.5),
            &hole,
            THICK,
        )
    };
    let flat = cell(
        [-48.0, 0.0],
        [8.0, 8.0, 0.0, 0.0],
        Hole::slot(0.0, -26.0, 13.0, 5.0),
    )
    .and(bend([0.0, 14.2], WIDTH, THICK))
    .and(half(
        [-WIDTH, 0.0],
        [14.2, 40.0],
        Hole::round(-16.0, 30.0, 4.5),
    ))
    .and(half(
        [0.0, WIDTH],
        [14.2, 40.0],
        Hole::round(16.0, 30.0, 4.5),
    ))
    .and(cell(
        [40.0, 100.0],
        [0.0, 0.0, 29.0, 29.0],
        Hole::round(0.0, 70.0, 14.0),
    ));
    flat.folded(0.0, 9.0, FRAC_PI_2)
}

/// A strip of the sheet, fine enough to be folded.
fn bend(y: [f32; 2], half: f32, thick: f32) -> Part {
    let along = |v: f32| y[0] + (y[1] - y[0]) * v;
    let mut part = Part::default();
    for (z, normal) in [(0.0, Vec3::NEG_Z), (thick, Vec3::Z)] {
        part = part.patch(1, 24, |u, v| {
            (Vec3::new((u * 2.0 - 1.0) * half, along(v), z), normal)
        });
    }
    for (x, normal) in [(-half, Vec3::NEG_X), (half, Vec3::X)] {
        part = part.patch(1, 24, |u, v| (Vec3::new(x, along(v), u * thick), normal));
    }
    part
}

pub(crate) fn scene() -> Scene {
    let washer = Part::default().plate(&regular(96, 13.0), &Hole::round(0.0, 0.0, 6.5), 2.5);
    let nut = Part::default().plate(&regular(6, 11.0), &Hole::round(0.0, 0.0, 5.2), 9.0);
    Scene::new(Camera::above(290.0, 40.0), paint::bench)
        .with(
            sheet(),
            Pose::new(Vec3::new(-4.0, -12.0, 0.0), Vec3::Z * -0.42),
            paint::brushed,
        )
        .with(washer, Pose::translation(62.0, -38.0, 0.0), paint::turned)
        .with(
            nut,
            Pose::new(Vec3::new(-74.0, 10.0, 0.0), Vec3::Z * 0.3),
            paint::black,
        )
        .lit()
}
