//! The fence: bars of one kind before a plastered wall, bricks and a grating, seen straight from the front.
//!
//! Everything that repeats does so exactly, in fewer pixels than disparities are searched through, and reaches a border
//! of the picture, where a point's true partner lies outside and a wrong one does not. The bars come nearer from right to
//! left, and what is behind them lies at another depth on either side of where the bricks begin.

use parry3d::math::{Pose, Vec2, Vec3};

use super::paint;
use super::render::{Camera, Scene};
use super::solid::{Hole, Part, rectangle};

/// Millimetres from bar to bar, and half a bar's width.
const SPACING: f32 = 9.0;
const HALF: f32 = 1.7;

/// Bars are of sheet: thick ones would show a side to one view and not to the next.
const THICK: f32 = 0.3;

/// A slab from z = 0 up.
fn slab(low: [f32; 2], high: [f32; 2], thickness: f32) -> Part {
    let middle = (Vec2::from(low) + Vec2::from(high)) / 2.0;
    Part::default().plate(
        &rectangle(low, high, [0.0; 4], 16.0),
        &Hole::none(middle.x, middle.y),
        thickness,
    )
}

/// Two dozen bars side by side, and the beam that carries them.
fn bars() -> Part {
    let bar = |i: i32| {
        let middle = i as f32 * SPACING;
        slab([middle - HALF, 0.0], [middle + HALF, 150.0], THICK)
    };
    (-12..=12).fold(slab([-130.0, 12.0], [130.0, 17.0], THICK), |part, i| {
        part.and(bar(i))
    })
}

pub(crate) fn scene() -> Scene {
    // Nothing runs exactly along the rows or down the columns.
    let leaning = |x: f32, y: f32, z: f32| Pose::new(Vec3::new(x, y, z), Vec3::Z * 0.025);
    // The left end of the fence is nearer.
    let fence = Pose::new(Vec3::new(-4.0, 6.0, 170.0), Vec3::new(0.0, 0.3, 0.025));
    Scene::new(Camera::above(440.0, 84.0), paint::plaster)
        .with(bars(), fence, paint::painted)
        .with(
            slab([10.0, -40.0], [230.0, 230.0], 40.0),
            leaning(0.0, 0.0, 0.0),
            paint::bricks,
        )
        .with(
            slab([-230.0, -200.0], [-20.0, -64.0], 25.0),
            leaning(0.0, 0.0, 0.0),
            paint::grating,
        )
        .lit()
}
