//! The thesis's photographs: its three objects, one at a time, on plain matt ground in one soft light, as a camera of its
//! time sees them.
//!
//! The objects are the solids of the other scenes, dull and nearly without texture, so that what is seen is what they
//! are: where they end, where they fold, where they are painted, and where their shadows end.

use parry3d::math::{Pose, Rotation, Vec3};

use super::render::{Camera, Scene};
use super::{jack, paint, screwdriver, tab};

/// One of the three.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Object {
    Tab,
    Jack,
    Screwdriver,
}

/// How many positions the camera had: left, centre, right.
pub(crate) const POSITIONS: usize = 3;

/// Focal length in pixels: some 22 mm before a sensor of two thirds of an inch.
pub(crate) const FOCAL: f32 = 1200.0;
/// Millimetres between neighbouring positions: 32 pixels at 465 mm.
pub(crate) const STEP: f32 = 12.4;
/// Deviation, in pixels, of what lens, sensor and frame grabber blur.
const BLUR: f32 = 1.1;
/// Rows by which the pictures lie lower where the cameras are out of line: the centre one a row too low, the right one
/// a row too high.
const ROWS_LOWER: [f32; 3] = [0.0, 1.0, -1.0];

/// Where the lamp is, and half its width as the sine of an angle.
const LAMP: Vec3 = Vec3::new(-0.46, -0.34, 0.82);
const LAMP_RADIUS: f32 = 0.04;

pub(crate) fn scene(object: Object, is_misaligned: bool) -> Scene {
    let camera = |distance: f32, degrees: f32| {
        let camera = Camera::above(distance, degrees).with(FOCAL, STEP, BLUR);
        match is_misaligned {
            true => camera.out_of_line(ROWS_LOWER),
            false => camera,
        }
    };
    let on_card = |camera: Camera| Scene::new(camera, paint::card).in_soft_light(LAMP, LAMP_RADIUS);
    match object {
        Object::Tab => on_card(camera(500.0, 40.0)).with(
            tab::sheet(),
            Pose::new(Vec3::new(0.0, -20.0, 0.0), Vec3::Z * -0.42),
            paint::dull_sheet,
        ),
        Object::Jack => {
            let parts = jack::jack([0.0, -8.0], 0.35);
            parts
                .into_iter()
                .fold(on_card(camera(490.0, 46.0)), |scene, (part, pose)| {
                    scene.with(part, pose, paint::dull_cast)
                })
        }
        Object::Screwdriver => {
            // It lies on its handle and on its tip.
            let (dip, heading) = (-0.055_f32, 0.76_f32);
            let forward = Vec3::new(
                heading.cos() * dip.cos(),
                heading.sin() * dip.cos(),
                dip.sin(),
            );
            let turn = Rotation::from_rotation_arc(Vec3::Z, forward);
            let pose = Pose::from_parts(
                Vec3::new(-66.0, -50.0, 14.0),
                turn * Rotation::from_rotation_z(4.36),
            );
            on_card(camera(478.0, 46.0))
                .with(screwdriver::handle(), pose, paint::plain_handle)
                .with(screwdriver::steel(), pose, paint::dull_steel)
        }
    }
    .lit()
}
