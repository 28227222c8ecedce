//! A picture to follow blocks in.
#![allow(
    unreachable_pub,
    reason = "shared by tests inside and outside of the crate"
)]

/// A gray level of a smooth texture, in which no block is found twice.
pub fn wave(x: f64, y: f64) -> u8 {
    let waves = [
        (0.31, 0.12, 0.4),
        (0.07, 0.43, 1.9),
        (0.53, -0.29, 0.7),
        (0.19, 0.22, 2.6),
        (-0.41, 0.37, 3.1),
        (0.23, -0.61, 5.0),
    ];
    let value = waves.iter().map(|(a, b, c)| (a * x + b * y + c).sin());
    (127.0 + 20.0 * value.sum::<f64>()).clamp(0.0, 255.0) as u8
}
