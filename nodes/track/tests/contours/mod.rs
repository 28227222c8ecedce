//! Made-up zero-crossings: where a function of the plane changes its sign.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test and bench uses its part"
)]

use messages::{Edge, Size};

/// The zero-crossings of `f`, dark where it is negative, chosen as the filter chooses: cuts of rows unless the contour
/// is nearly horizontal; cuts of columns where it is flatter than 45° and no cut of a row is near; at most one a pixel,
/// in raster order, placed by linear interpolation. The gradient is f's own.
pub fn of(size: Size, f: impl Fn(f32, f32) -> f32) -> Vec<Edge> {
    // With a margin of one pixel.
    let (width, height) = (size.width as usize, size.height as usize);
    let stride = width + 2;
    let values: Vec<f32> = (0..stride * (height + 2))
        .map(|i| f((i % stride) as f32 - 1.0, (i / stride) as f32 - 1.0))
        .collect();
    let cuts = |a: f32, b: f32| (a < 0.0) != (b < 0.0);
    let mut edges = Vec::new();
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let at = |dx: usize, dy: usize| values[(y + dy) * stride + x + dx];
        let (here, right, below) = (at(1, 1), at(2, 1), at(1, 2));
        let (along, down) = (
            (right - here).abs(),
            0.25 * (below + at(2, 2) - at(1, 0) - at(2, 0)).abs(),
        );
        let row = x + 1 < width && cuts(here, right) && down <= 6.0 * along;

        let (along, down) = (
            0.25 * (right + at(2, 2) - at(0, 1) - at(0, 2)).abs(),
            (below - here).abs(),
        );
        let (near, beside) = match here.abs() < below.abs() {
            true => (here, [at(0, 1), right]),
            false => (below, [at(0, 2), at(2, 2)]),
        };
        let near_row = beside
            .into_iter()
            .any(|beside| cuts(near, beside) && near.abs() <= beside.abs());
        let doubled = near_row && down <= 6.0 * along;
        let column = y + 1 < height && cuts(here, below) && down > along && !doubled && !row;

        let place = |other: f32| (here / (here - other)).min(0.999);
        let (x, y) = match (row, column) {
            (true, _) => (x as f32 + place(right), y as f32),
            (_, true) => (x as f32, y as f32 + place(below)),
            _ => continue,
        };
        let (gx, gy) = (f(x + 0.5, y) - f(x - 0.5, y), f(x, y + 0.5) - f(x, y - 0.5));
        edges.push(Edge {
            x,
            y,
            magnitude: gx.hypot(gy),
            orientation: gy.atan2(gx),
            profile: [0; 8],
        });
    }
    edges
}

/// A sum of plane waves, about `wavelength` long, in directions and phases that look random and never change: contours
/// like those of a textured surface, some ten gray levels high.
pub fn waves(wavelength: f32) -> impl Fn(f32, f32) -> f32 {
    let waves: Vec<[f32; 3]> = (1..=12)
        .map(|i| {
            let direction = i as f32 * 2.399_963;
            let omega = std::f32::consts::TAU / wavelength * (0.6 + 0.07 * i as f32);
            [
                omega * direction.cos(),
                omega * direction.sin(),
                (i * i) as f32,
            ]
        })
        .collect();
    move |x, y| {
        waves
            .iter()
            .map(|[wx, wy, phase]| 4.0 * (wx * x + wy * y + phase).sin())
            .sum()
    }
}

/// Crossings of rows, one in each row of `rows`, at the columns and with the orientations that `at` gives.
pub fn down(rows: std::ops::Range<u32>, at: impl Fn(f32) -> (f32, f32)) -> Vec<Edge> {
    rows.map(|row| {
        let (x, orientation) = at(row as f32);
        Edge {
            x,
            y: row as f32,
            magnitude: 10.0,
            orientation,
            profile: [0; 8],
        }
    })
    .collect()
}

/// Several lists in raster order.
pub fn together(lists: &[Vec<Edge>]) -> Vec<Edge> {
    let mut edges = lists.concat();
    edges.sort_by(|a, b| {
        a.y.floor()
            .total_cmp(&b.y.floor())
            .then(a.x.total_cmp(&b.x))
    });
    edges
}

/// Numbers from −1 to 1 that look random and never change.
pub fn noise(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
}
