//! The jack: the toy, three bars at right angles with balls and points for ends, with its rubber ball on a floor.

use parry3d::math::{Pose, Rotation, Vec2, Vec3};

use super::paint;
use super::render::{Camera, Scene};
use super::solid::Part;

/// Half the length of a bar.
const REACH: f32 = 41.0;
const BALL: f32 = 11.0;

/// A bar along z with balls on both ends; they meet the bar in a fillet.
fn balls() -> Part {
    Part::default().turned(64, 96, |v| {
        // Denser towards the ends, where the profile is round.
        let height = -(v * std::f32::consts::PI).cos() * (REACH + BALL);
        let from = height.abs() - REACH;
        let ball = (BALL * BALL - from * from).max(0.0).sqrt();
        let bar = if from < 0.0 { 6.0 } else { 0.0 };
        Vec2::new(blend(ball, bar), height)
    })
}

/// A bar along z that ends in blunt points.
fn points() -> Part {
    Part::default().turned(64, 96, |v| {
        let height = -(v * std::f32::consts::PI).cos() * (REACH + BALL);
        let from = height.abs() / (REACH + BALL);
        Vec2::new(
            6.0 + 2.5 * paint::smooth(0.35, 0.75, from) - 6.3 * paint::smooth(0.7, 1.0, from),
            height,
        )
    })
}

/// The greater of two radii, rounded where they cross.
fn blend(a: f32, b: f32) -> f32 {
    const FILLET: f32 = 1.5;
    let near = (FILLET - (a - b).abs()).max(0.0);
    // Nothing is added at the tips, where the greater radius vanishes.
    let most = a.max(b);
    most + (near * near / (4.0 * FILLET)).min(most)
}

/// The jack standing on three of its ends, turned about the vertical.
pub(super) fn jack(at: [f32; 2], turn: f32) -> [(Part, Pose); 2] {
    let up = Rotation::from_rotation_arc(Vec3::ONE.normalize(), Vec3::Z);
    // The balls underneath touch the floor.
    let height = REACH / 3.0_f32.sqrt() + BALL;
    let pose = Pose::from_parts(
        Vec3::new(at[0], at[1], height),
        Rotation::from_rotation_z(turn) * up,
    );
    let onto = |axis: Vec3| Pose::from_rotation(Rotation::from_rotation_arc(Vec3::Z, axis));
    let round = balls()
        .placed(&onto(Vec3::X))
        .and(balls().placed(&onto(Vec3::Y)));
    [(round, pose), (points(), pose)]
}

pub(crate) fn scene() -> Scene {
    let mut scene = Scene::new(Camera::above(285.0, 46.0), paint::terrazzo);
    for (part, pose) in jack([-22.0, -12.0], 0.35) {
        scene = scene.with(part, pose, paint::cast);
    }
    let ball = Pose::new(Vec3::new(62.0, 34.0, 23.0), Vec3::new(0.5, 0.3, 0.0));
    scene.with(Part::ball(23.0), ball, paint::rubber).lit()
}
