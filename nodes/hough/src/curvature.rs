//! Curvature along a curve.

use std::f32::consts::TAU;

use messages::Edge;

/// Points on either side over which the turn is measured.
const REACH: usize = 3;

/// The curvature at each point of a curve, in radians per pixel: how far the orientation turns between the points
/// three before and three after it (at its ends fewer), by the way between them.
///
/// The orientation of the gradient is smoother than the direction from point to point. A curve that stays in one
/// place has curvature 0.
///
/// # Panics
/// When `out` is shorter than `points`.
pub fn curvatures(points: &[Edge], out: &mut [f32]) {
    for i in 0..points.len() {
        let nearby = &points[i.saturating_sub(REACH)..points.len().min(i + REACH + 1)];
        let way: f32 = nearby
            .windows(2)
            .map(|pair| [pair[1].x - pair[0].x, pair[1].y - pair[0].y])
            .map(|[dx, dy]| (dx * dx + dy * dy).sqrt())
            .sum();
        let turn = turn(nearby[0].orientation, nearby[nearby.len() - 1].orientation);
        out[i] = if way > 0.0 { turn / way } else { 0.0 };
    }
}

/// The angle between two orientations, from 0 to π.
fn turn(a: f32, b: f32) -> f32 {
    let turn = (a - b).abs() % TAU;
    turn.min(TAU - turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along(count: usize, place: impl Fn(f32) -> [f32; 3]) -> Vec<f32> {
        let points: Vec<Edge> = (0..count)
            .map(|i| place(i as f32))
            .map(|[x, y, orientation]| Edge {
                x,
                y,
                orientation,
                ..Edge::default()
            })
            .collect();
        let mut out = vec![f32::NAN; count];
        curvatures(&points, &mut out);
        out
    }

    #[test]
    fn a_circle_has_the_inverse_of_its_radius_everywhere() {
        for radius in [3.0f32, 10.0, 50.0] {
            // Once around and a little more, through the jump of the angle from π to −π.
            let at = |i: f32| {
                let angle =
                    (i / radius + std::f32::consts::PI).rem_euclid(TAU) - std::f32::consts::PI;
                [radius * angle.cos(), radius * angle.sin(), angle]
            };
            for curvature in along((7.0 * radius) as usize, at) {
                assert!(
                    (curvature * radius - 1.0).abs() < 0.05,
                    "{curvature} at {radius}"
                );
            }
        }
    }

    #[test]
    fn a_straight_line_has_none_and_a_corner_much() {
        let bent = along(21, |i| match i {
            i if i <= 10.0 => [i, 0.0, 0.0],
            i => [10.0, i - 10.0, std::f32::consts::FRAC_PI_2],
        });
        assert_eq!([bent[0], bent[6], bent[14], bent[20]], [0.0; 4]);
        assert!((bent[10] - std::f32::consts::FRAC_PI_2 / 6.0).abs() < 1e-6);
    }

    #[test]
    fn a_curve_of_one_place_has_none() {
        assert_eq!(along(1, |_| [3.0, 4.0, 1.0]), [0.0]);
        assert_eq!(along(5, |i| [3.0, 4.0, i]), [0.0; 5]);
        assert_eq!(along(0, |_| [0.0; 3]), [0.0; 0]);
    }
}
