//! Made-up curves.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test and bench uses its part"
)]

use messages::{Curve, Curves, Edge, Owned, Size};

/// Numbers from 0 to 1 that look random and never change.
pub fn numbers(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Curves of `count` points each that wander about an image, one pixel a step and never out of it.
pub fn wander(size: Size, curves: u32, count: u32, seed: u64) -> Vec<Vec<Edge>> {
    let mut number = numbers(seed);
    let wander = |_| {
        let (width, height) = (size.width as f32 - 1.0, size.height as f32 - 1.0);
        let (mut x, mut y) = (number() * width, number() * height);
        let mut direction = number() * 6.0;
        let mut step = |_| {
            direction += number() - 0.5;
            (x, y) = (
                (x + direction.cos()).clamp(0.0, width),
                (y + direction.sin()).clamp(0.0, height),
            );
            let turned = direction - std::f32::consts::FRAC_PI_2;
            // As zero-crossings are: on a row or on a column.
            if number() < 0.5 {
                y = y.round()
            } else {
                x = x.round()
            }
            Edge {
                x,
                y,
                magnitude: 1.0 + 9.0 * number(),
                orientation: turned.sin().atan2(turned.cos()),
                profile: [0; 8],
            }
        };
        (0..count).map(&mut step).collect()
    };
    (0..curves).map(wander).collect()
}

/// A message of these curves, with centroids as the tracker finds them.
pub fn message(lists: &[Vec<Edge>], size: Size) -> Owned<Curves> {
    let mut curves = Owned::<Curves>::new(size);
    curves.fill(|room| {
        for (label, points) in (0..).zip(lists) {
            let mean = |value: fn(&Edge) -> f32| {
                points.iter().map(value).sum::<f32>() / points.len() as f32
            };
            room.curves.push(Curve {
                label,
                first: room.points.len() as u32,
                count: points.len() as u32,
                x: mean(|point| point.x),
                y: mean(|point| point.y),
                magnitude: mean(|point| point.magnitude),
                ..Curve::default()
            });
            room.points.extend_from_slice(points);
        }
    });
    curves
}
