//! J. Canny's edges (PAMI 8(6), 1986), in whole numbers as OpenCV's `Canny(image, low, high, L2gradient=True)` finds them,
//! so that coverage means the same edges everywhere.

use messages::Size;

/// Finds edges; keeps its memory from image to image.
#[derive(Clone, Debug, Default)]
pub struct Canny {
    /// Squares of the thresholds.
    low: i32,
    high: i32,
    /// Gradients across and down, side by side in memory: at most 1,020, so that many are found at a time.
    across: Vec<i16>,
    down: Vec<i16>,
    /// Down each column, and once more beyond both ends of the row: the sum weighted as in the kernel, and …
    sums: Vec<i16>,
    /// … the difference.
    steps: Vec<i16>,
    /// Squares of the magnitudes, with a border of zeros.
    magnitudes: Vec<i32>,
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
        let square = |threshold: f32| f64::from(threshold).powi(2).floor() as i32;
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
        for gradients in [&mut self.across, &mut self.down] {
            gradients.clear();
            gradients.resize(size.pixels(), 0);
        }
        // Beyond its sides there is no gradient.
        self.magnitudes.clear();
        self.magnitudes.resize((width + 2) * (height + 2), 0);
        let (sums, steps) = (&mut self.sums, &mut self.steps);
        sums.resize(width + 2, 0);
        steps.resize(width + 2, 0);
        for y in 0..height {
            let row = |y: usize| &pixels[y * width..][..width];
            let rows = row(y.saturating_sub(1))
                .iter()
                .zip(row(y))
                .zip(row((y + 1).min(height - 1)));
            for ((sum, step), ((above, here), below)) in
                sums[1..].iter_mut().zip(&mut steps[1..]).zip(rows)
            {
                let [above, here, below] = [above, here, below].map(|gray| i16::from(*gray));
                (*sum, *step) = (above + 2 * here + below, below - above);
            }
            for column in [&mut *sums, &mut *steps] {
                (column[0], column[width + 1]) = (column[1], column[width]);
            }
            let across = &mut self.across[y * width..][..width];
            for ((across, left), right) in across.iter_mut().zip(&*sums).zip(&sums[2..]) {
                *across = right - left;
            }
            let down = &mut self.down[y * width..][..width];
            let beside = steps.iter().zip(&steps[1..]).zip(&steps[2..]);
            for (down, ((left, here), right)) in down.iter_mut().zip(beside) {
                *down = left + 2 * here + right;
            }
            let magnitudes = &mut self.magnitudes[(y + 1) * (width + 2) + 1..][..width];
            for (magnitude, (across, down)) in magnitudes.iter_mut().zip(across.iter().zip(down)) {
                let [across, down] = [*across, *down].map(i32::from);
                *magnitude = across * across + down * down;
            }
        }
    }

    /// Keeps the maxima across their edge; the strong ones begin edges.
    fn thin(&mut self, size: Size, edges: &mut [bool]) {
        let (width, height) = (size.width as usize, size.height as usize);
        let stride = width + 2;
        self.weak.clear();
        self.weak.resize(size.pixels(), false);
        self.pending.clear();
        for y in 0..height {
            for x in 0..width {
                let at = (y + 1) * stride + x + 1;
                let here = self.magnitudes[at];
                if here <= self.low {
                    continue;
                }
                let place = y * width + x;
                let [dx, dy] = [self.across[place], self.down[place]].map(i32::from);
                let (across, down) = (i64::from(dx.abs()), i64::from(dy.abs()) << SHIFT);
                let flat = across * TANGENT;
                let steep = flat + (across << (SHIFT + 1));
                let [before, after] = if down < flat {
                    [at - 1, at + 1]
                } else if down > steep {
                    [at - stride, at + stride]
                } else if (dx ^ dy) < 0 {
                    [at - stride + 1, at + stride - 1]
                } else {
                    [at - stride - 1, at + stride + 1]
                };
                let [before, after] = [before, after].map(|near| self.magnitudes[near]);
                // Of two equal neighbours across or down the first is the crest, on a slant none.
                let is_slanted = down >= flat && down <= steep;
                if here > before && (here > after || here == after && !is_slanted) {
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
