//! Pictures made for the tests.
#![allow(dead_code, reason = "every test file uses its part")]

use messages::Size;

/// The pixel seen at `p` when mirrors stand on the outer edges of the pixels 0 and `n` − 1.
pub(crate) fn mirrored(mut p: isize, n: isize) -> usize {
    while p < 0 || p >= n {
        p = if p < 0 { -1 - p } else { 2 * n - 1 - p };
    }
    p as usize
}

/// Pixels without any relation, the same for the same seed.
pub(crate) fn noise(size: Size, seed: u64) -> Vec<u8> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as u8
    };
    (0..size.pixels()).map(|_| next()).collect()
}

/// The picture of a scene whose brightness in the plane is known, each pixel the mean of its area.
pub(crate) fn taken(size: Size, brightness: impl Fn(f64, f64) -> f64) -> Vec<u8> {
    const FINE: usize = 16;
    let sample = |p: usize, i: usize| p as f64 - 0.5 + (i as f64 + 0.5) / FINE as f64;
    let pixel = |index: usize| {
        let (x, y) = (index % size.width as usize, index / size.width as usize);
        let all = (0..FINE * FINE).map(|i| brightness(sample(x, i % FINE), sample(y, i / FINE)));
        (all.sum::<f64>() / (FINE * FINE) as f64).round() as u8
    };
    (0..size.pixels()).map(pixel).collect()
}

/// Noise that hangs together over a few pixels, as real pictures do.
pub(crate) fn texture(size: Size, seed: u64) -> Vec<u8> {
    let (width, height) = (size.width as isize, size.height as isize);
    let mut values: Vec<f64> = noise(size, seed).into_iter().map(f64::from).collect();
    for _ in 0..3 {
        let at = |x: isize, y: isize| {
            values[mirrored(y, height) * size.width as usize + mirrored(x, width)]
        };
        values = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| {
                (0..9)
                    .map(|i| at(x + i % 3 - 1, y + i / 3 - 1))
                    .sum::<f64>()
                    / 9.0
            })
            .collect();
    }
    values
        .into_iter()
        .map(|v| ((v - 127.5) * 5.0 + 127.5).clamp(0.0, 255.0) as u8)
        .collect()
}
