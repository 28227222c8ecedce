//! J. Canny's edges (PAMI 8(6), 1986), in whole numbers as OpenCV's `Canny(image, low, high, L2gradient=True)` finds them,
//! so that coverage means the same edges everywhere.

use messages::Size;

/// Finds edges; keeps its memory from image to image.
#[derive(Clone, Debug, Default)]
pub struct Canny {
    /// Squares of the thresholds.
    low: i64,
    high: i64,
    gradients: Vec<(i32, i32)>,
    /// Squares of the magnitudes.
    magnitudes: Vec<i64>,
    /// Edge pixels whose neighbours are still to be looked at.
    pending: Vec<usize>,
    /// Maxima above the low threshold.
    weak: Vec<bool>,
}

/// tan 22.5° in 15 bits behind the point.
const TANGENT: i64 = 13573;
const SHIFT: u32 = 15;

impl Canny {
    /// Edges are maxima of the gradient above `low` that hang together with one above `high`, in Sobel's units.
    pub fn new(low: f32, high: f32) -> Self {
        let square = |threshold: f32| f64::from(threshold).powi(2).floor() as i64;
        Self {
            low: square(low),
            high: square(high),
            ..Self::default()
        }
    }

    /// Says of every pixel whether it is an edge.
    pub fn find(&mut self, pixels: &[u8], size: Size, edges: &mut Vec<bool>) {
        edges.clear();
        edges.resize(size.pixels(), false);
        if size.width < 2 || size.height < 2 || pixels.len() != size.pixels() {
            return;
        }
        self.sobel(pixels, size);
        self.thin(size, edges);
        let (width, height) = (size.width as usize, size.height as usize);
        while let Some(place) = self.pending.pop() {
            let (x, y) = (place % width, place / width);
            for row in y.saturating_sub(1)..=(y + 1).min(height - 1) {
                for column in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                    let near = row * width + column;
                    if self.weak[near] && !edges[near] {
                        edges[near] = true;
                        self.pending.push(near);
                    }
                }
            }
        }
    }

    /// Gradients by 3×3 Sobel; beyond its sides the picture goes on as its last row and column.
    fn sobel(&mut self, pixels: &[u8], size: Size) {
        let (width, height) = (size.width as usize, size.height as usize);
        self.gradients.clear();
        self.magnitudes.clear();
        for y in 0..height {
            let row = |y: usize| &pixels[y * width..][..width];
            let (above, here, below) = (
                row(y.saturating_sub(1)),
                row(y),
                row((y + 1).min(height - 1)),
            );
            let sum = |x: usize| i32::from(above[x]) + 2 * i32::from(here[x]) + i32::from(below[x]);
            let difference = |x: usize| i32::from(below[x]) - i32::from(above[x]);
            for x in 0..width {
                let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
                let dx = sum(right) - sum(left);
                let dy = difference(left) + 2 * difference(x) + difference(right);
                self.gradients.push((dx, dy));
                self.magnitudes
                    .push(i64::from(dx) * i64::from(dx) + i64::from(dy) * i64::from(dy));
            }
        }
    }

    /// Keeps the maxima across their edge; the strong ones begin edges.
    fn thin(&mut self, size: Size, edges: &mut [bool]) {
        let (width, height) = (size.width as i64, size.height as i64);
        self.weak.clear();
        self.weak.resize(size.pixels(), false);
        self.pending.clear();
        let at = |x: i64, y: i64| {
            let is_inside = (0..width).contains(&x) && (0..height).contains(&y);
            // Beyond its sides there is no gradient.
            if is_inside {
                self.magnitudes[(y * width + x) as usize]
            } else {
                0
            }
        };
        for y in 0..height {
            for x in 0..width {
                let place = (y * width + x) as usize;
                let here = self.magnitudes[place];
                if here <= self.low {
                    continue;
                }
                let (dx, dy) = self.gradients[place];
                let (across, down) = (i64::from(dx.abs()), i64::from(dy.abs()) << SHIFT);
                let flat = across * TANGENT;
                let steep = flat + (across << (SHIFT + 1));
                let is_maximum = if down < flat {
                    here > at(x - 1, y) && here >= at(x + 1, y)
                } else if down > steep {
                    here > at(x, y - 1) && here >= at(x, y + 1)
                } else {
                    let side = if (dx ^ dy) < 0 { -1 } else { 1 };
                    here > at(x - side, y - 1) && here > at(x + side, y + 1)
                };
                if is_maximum {
                    self.weak[place] = true;
                    if here > self.high {
                        edges[place] = true;
                        self.pending.push(place);
                    }
                }
            }
        }
    }
}
