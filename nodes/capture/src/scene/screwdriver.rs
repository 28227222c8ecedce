//! The screwdriver: fluted handle, ferrule, shaft and flat blade, on a drawing, its shaft on a block of wood.

use std::f32::consts::TAU;

use parry3d::math::{Pose, Rotation, Vec3};

use super::paint;
use super::render::{Camera, Scene};
use super::solid::{Hole, Part, rectangle, regular};

const HANDLE: f32 = 88.0;
const SHAFT: f32 = 118.0;

/// The handle along z, from its end at 0: a swelling body with eight flutes.
pub(super) fn handle() -> Part {
    let radius = |height: f32| {
        let along = height / HANDLE;
        let end = (1.0 - (1.0 - (along / 0.11).min(1.0)).powi(2))
            .max(0.0)
            .sqrt();
        let neck =
            1.0 - 0.36 * paint::smooth(0.68, 0.86, along) + 0.14 * paint::smooth(0.9, 1.0, along);
        14.0 * (0.05 + 0.95 * end) * neck
    };
    let flute = |u: f32, height: f32| {
        let window = paint::smooth(8.0, 20.0, height) * (1.0 - paint::smooth(52.0, 66.0, height));
        // Narrow grooves: the print has its place between two of them.
        2.4 * window * (0.5 - 0.5 * (u * 8.0 * TAU).cos()).powi(3)
    };
    Part::default()
        .curved(160, 64, |u, v| {
            let height = v * HANDLE;
            let (sin, cos) = (u * TAU).sin_cos();
            let reach = radius(height) - flute(u, height);
            Vec3::new(reach * cos, reach * sin, height)
        })
        .turned_sharp(64, &[[0.0, 0.0], [radius(0.0), 0.0]])
        .turned_sharp(64, &[[radius(HANDLE), HANDLE], [0.0, HANDLE]])
}

/// Ferrule, shaft and blade, from the handle's front on.
pub(super) fn steel() -> Part {
    let blade = 26.0;
    let start = HANDLE + SHAFT - blade;
    let ring = |u: f32, v: f32| {
        let (sin, cos) = (u * TAU).sin_cos();
        // From round to a flat wedge: wide first, then thinner to the tip.
        let wide = 3.6 + 1.9 * paint::smooth(0.0, 0.55, v) - 0.9 * paint::smooth(0.55, 1.0, v);
        let thick = 3.6 - 2.9 * paint::smooth(0.0, 1.0, v);
        let square = 1.0 - 0.45 * paint::smooth(0.0, 0.6, v);
        let corner = |c: f32| c.signum() * c.abs().powf(square);
        Vec3::new(thick * corner(cos), wide * corner(sin), start + v * blade)
    };
    Part::default()
        .turned_sharp(
            64,
            &[
                [8.2, HANDLE],
                [8.2, HANDLE + 3.0],
                [7.0, HANDLE + 5.0],
                [7.0, HANDLE + 14.0],
                [3.6, HANDLE + 17.0],
            ],
        )
        .turned_sharp(48, &[[3.6, HANDLE + 17.0], [3.6, start]])
        .curved(64, 24, ring)
        .patch(64, 1, |u, v| {
            let rim = ring(u, 1.0);
            (
                Vec3::new(rim.x * (1.0 - v), rim.y * (1.0 - v), rim.z),
                Vec3::Z,
            )
        })
}

/// A screw standing on its head.
fn screw() -> Part {
    let hexagon = Part::default().plate(&regular(6, 9.0), &Hole::none(0.0, 0.0), 6.0);
    hexagon.turned_sharp(48, &[[4.6, 6.0], [4.6, 30.0], [3.4, 32.0], [0.0, 32.0]])
}

pub(crate) fn scene() -> Scene {
    // The handle lies on the paper, the shaft on the block.
    let (tilt, heading) = (0.155_f32, 0.62_f32);
    let forward = Vec3::new(
        heading.cos() * tilt.cos(),
        heading.sin() * tilt.cos(),
        tilt.sin(),
    );
    let turn = Rotation::from_rotation_arc(Vec3::Z, forward);
    // Turned about its own axis until the print looks up.
    let driver = Pose::from_parts(
        Vec3::new(-84.0, -50.0, 14.0),
        turn * Rotation::from_rotation_z(4.36),
    );
    let block = Part::default().plate(
        &rectangle([-15.0, -21.0], [15.0, 21.0], [0.0; 4], 2.0),
        &Hole::none(0.0, 0.0),
        26.0,
    );
    let resting = Vec3::new(36.0, 34.0, 0.0);
    let outline_turn = Vec3::Z * (heading + 0.25);
    Scene::new(Camera::above(320.0, 44.0), paint::drawing)
        .with(handle(), driver, paint::handle)
        .with(steel(), driver, paint::turned)
        .with(block, Pose::new(resting, outline_turn), paint::block)
        .with(screw(), Pose::translation(52.0, -52.0, 0.0), paint::black)
        .lit()
}
