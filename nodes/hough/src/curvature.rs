//! Curvature along a curve.

use messages::Edge;

/// Points on either side over which the turn of the gradient is measured.
const REACH: usize = 3;

/// The curvature at each point, in radians per pixel: how far the orientation turns from a few points behind to a few
/// points ahead, by the way between them; 0 for curves of a single place. `out` has one slot a point.
pub fn curvatures(points: &[Edge], out: &mut [f32]) {
    for (i, slot) in out.iter_mut().enumerate().take(points.len()) {
        let (from, to) = (i.saturating_sub(REACH), (i + REACH).min(points.len() - 1));
        let way: f32 = points[from..=to]
            .windows(2)
            .map(|pair| (pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y))
            .sum();
        let turn = turn(points[from].orientation, points[to].orientation);
        *slot = if way > 0.0 && turn.is_finite() {
            turn / way
        } else {
            0.0
        };
    }
}

/// The angle between two orientations in radians, 0 to π.
fn turn(a: f32, b: f32) -> f32 {
    let turn = (a - b).abs() % std::f32::consts::TAU;
    turn.min(std::f32::consts::TAU - turn)
}
