//! How a picture moves from one frame to another: blocks of texture, found again.
//!
//! Blocks with texture in both directions are looked for in the other picture, along the row and a few rows up and down,
//! by normalised correlation, and then placed between pixels by least squares (Lucas and Kanade 1981, in the inverse form of
//! Baker and Matthews 2004). Neither cares for gain and offset of the gray levels: exposure may flicker. Blocks whose best
//! place is hardly better than another one say nothing.

use std::ops::RangeInclusive;

use messages::Size;

/// Pixels a block measures.
const BLOCK: usize = 20;
/// From the corner of a block to its middle, in pixels.
pub(crate) const MIDDLE: f64 = (BLOCK as f64 - 1.0) / 2.0;
/// Pixels of a block.
const AREA: usize = BLOCK * BLOCK;
/// Rows of a block from one that is compared to the next, where it is searched for; it is placed by all of them.
const EVERY: usize = 2;
/// Pixels of a block that are compared where it is searched for.
const COMPARED: usize = AREA / EVERY;
/// Pixels from one block to the next, where all of a picture is looked at.
pub(crate) const SPACING: usize = 28;
/// Rows up and down in which a block is looked for.
const ROWS: i32 = 4;
/// Least mean gradient of a block along and across, in gray levels a pixel.
const TEXTURE: f32 = 2.0;
/// What the best place may leave unexplained of what the best elsewhere does.
const UNIQUE: f32 = 0.6;
/// What the best place may leave unexplained: one less the correlation.
const ALIKE: f32 = 0.2;
/// Steps by which a block is placed between pixels, at most, and pixels below which one was the last.
const STEPS: usize = 8;
const PLACED: f32 = 0.01;
/// Pixels from the best whole place to the place between, at most.
const NEAR: f32 = 1.5;
/// Correlations below this are of nothing: of a block without contrast.
const LEAST_VARIANCE: f32 = 0.25;

/// A picture: 8-bit gray, row by row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Picture<'a> {
    pub(crate) size: Size,
    pub(crate) pixels: &'a [u8],
}

impl Picture<'_> {
    fn row(&self, x: usize, y: usize, count: usize) -> &[u8] {
        &self.pixels[y * self.size.width as usize + x..][..count]
    }

    /// Mean absolute differences of neighbours in a block, along the row and along the column.
    fn texture(&self, x: usize, y: usize) -> [f32; 2] {
        let mut sums = [0u32; 2];
        for row in y..y + BLOCK {
            let own = self.row(x, row, BLOCK);
            let pairs = |other| own.iter().zip(other);
            let sum = |other| -> u32 {
                pairs(other)
                    .map(|(a, b): (&u8, &u8)| u32::from(a.abs_diff(*b)))
                    .sum()
            };
            sums[0] += sum(self.row(x + 1, row, BLOCK));
            sums[1] += sum(self.row(x, row + 1, BLOCK));
        }
        sums.map(|sum| sum as f32 / AREA as f32)
    }
}

/// A block of a picture, made ready to be found in others.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Column and row of its corner.
    pub(crate) at: (usize, usize),
    /// The gray levels of the rows that are compared, their mean, and the sum of their squares without it.
    gray: Vec<i16>,
    mean: f32,
    variation: f32,
    /// The same without their mean.
    contrast: Vec<f32>,
    /// What a gray level found there says of how far the place is off, in columns and in rows: the pseudo-inverse of the
    /// gradients, rid of all that gain and offset explain.
    off: [Vec<f32>; 2],
    /// Sum of the squares of `contrast`.
    squares: f32,
}

impl Block {
    /// The block with this corner, of which there must be a pixel more on every side; `None` where it has too little
    /// texture.
    pub(crate) fn of(picture: &Picture<'_>, x: usize, y: usize) -> Option<Self> {
        if picture.texture(x, y).into_iter().any(|t| t < TEXTURE) {
            return None;
        }
        let (mut all, mut slopes) = (Vec::with_capacity(AREA), [const { Vec::new() }; 2]);
        for row in y..y + BLOCK {
            let (above, below) = (
                picture.row(x, row - 1, BLOCK),
                picture.row(x, row + 1, BLOCK),
            );
            let own = picture.row(x - 1, row, BLOCK + 2);
            all.extend(own[1..=BLOCK].iter().map(|&v| i16::from(v)));
            let half = |a: u8, b: u8| (f32::from(b) - f32::from(a)) / 2.0;
            slopes[0].extend((0..BLOCK).map(|i| half(own[i], own[i + 2])));
            slopes[1].extend((0..BLOCK).map(|i| half(above[i], below[i])));
        }
        let mean_of = |gray: &[i16]| {
            gray.iter().map(|&v| i32::from(v)).sum::<i32>() as f32 / gray.len() as f32
        };
        let mean = mean_of(&all);
        let contrast: Vec<f32> = all.iter().map(|&v| f32::from(v) - mean).collect();
        let rows = all.as_chunks::<BLOCK>().0.iter().step_by(EVERY);
        let gray: Vec<i16> = rows.flatten().copied().collect();
        let mean = mean_of(&gray);
        let off = gray.iter().map(|&v| f32::from(v) - mean);
        let variation = off.map(|off| off * off).sum::<f32>();
        let squares = dot(&contrast, &contrast);
        if squares < LEAST_VARIANCE * AREA as f32 || variation <= 0.0 {
            return None;
        }
        for slope in &mut slopes {
            let middle = slope.iter().sum::<f32>() / AREA as f32;
            let share = dot(slope, &contrast) / squares;
            for (slope, contrast) in slope.iter_mut().zip(&contrast) {
                *slope -= middle + share * contrast;
            }
        }
        let [right, down] = &slopes;
        let (xx, xy, yy) = (dot(right, right), dot(right, down), dot(down, down));
        let determinant = xx * yy - xy * xy;
        // Where all gradients go one way nothing is said of the other.
        if determinant <= 0.02 * xx * yy {
            return None;
        }
        let of = |a: f32, b: f32| {
            let pairs = right.iter().zip(down);
            pairs.map(|(x, y)| (a * x + b * y) / determinant).collect()
        };
        Some(Self {
            at: (x, y),
            off: [of(yy, -xy), of(-xy, xx)],
            gray,
            contrast,
            mean,
            variation,
            squares,
        })
    }

    /// Where in another picture the block is found: how far to the right and down, of so many columns to the right and
    /// rows down as are searched.
    pub(crate) fn found(
        &self,
        other: &Picture<'_>,
        columns: RangeInclusive<i32>,
        rows: RangeInclusive<i32>,
        costs: &mut Costs,
    ) -> Option<[f32; 2]> {
        let (width, height) = (other.size.width as i32, other.size.height as i32);
        let (x, y) = (self.at.0 as i32, self.at.1 as i32);
        let clipped = |from: i32, range: RangeInclusive<i32>, side: i32| {
            let least = (from + range.start()).max(0);
            let most = (from + range.end()).min(side - BLOCK as i32);
            (least <= most).then_some((least as usize, most as usize))
        };
        let (left, right) = clipped(x, columns, width)?;
        let (top, bottom) = clipped(y, rows, height)?;
        costs.compare(self, other, [left, top], [right, bottom]);
        let (column, row) = costs.best()?;
        self.placed(other, [(left + column) as f32, (top + row) as f32])
    }

    /// Its place between pixels, from a whole one; `None` where it strays or is not alike. Gives how far it went.
    fn placed(&self, other: &Picture<'_>, start: [f32; 2]) -> Option<[f32; 2]> {
        let mut at = start;
        let last =
            [other.size.width, other.size.height].map(|side| (side as usize - BLOCK - 1) as f32);
        let mut seen = [0.0f32; AREA];
        for _ in 0..STEPS {
            if at
                .iter()
                .zip(last)
                .any(|(at, last)| *at < 0.0 || *at >= last)
            {
                return None;
            }
            let (column, row) = (at[0] as usize, at[1] as usize);
            let (right, down) = (at[0].fract(), at[1].fract());
            for (i, seen) in seen.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
                let above = other.row(column, row + i, BLOCK + 1);
                let below = other.row(column, row + i + 1, BLOCK + 1);
                for (j, seen) in seen.iter_mut().enumerate() {
                    let [a, b, c, d] =
                        [above[j], above[j + 1], below[j], below[j + 1]].map(f32::from);
                    let (top, bottom) = (a + right * (b - a), c + right * (d - c));
                    *seen = top + down * (bottom - top);
                }
            }
            let gain = dot(&self.contrast, &seen) / self.squares;
            if gain < 0.1 {
                return None;
            }
            let step = [0, 1].map(|k| dot(&self.off[k], &seen) / gain);
            at = [at[0] - step[0], at[1] - step[1]];
            if (at[0] - start[0]).abs() > NEAR || (at[1] - start[1]).abs() > NEAR {
                return None;
            }
            if step.iter().all(|step| step.abs() < PLACED) {
                let mean = seen.iter().sum::<f32>() / AREA as f32;
                let squares = dot(&seen, &seen) - AREA as f32 * mean * mean;
                let alike = gain * (self.squares / squares.max(1.0)).sqrt();
                let from = [self.at.0 as f32, self.at.1 as f32];
                return (1.0 - alike <= ALIKE).then(|| [at[0] - from[0], at[1] - from[1]]);
            }
        }
        None
    }
}

/// The sum of products, in lanes, so that it is the same whatever the compiler makes of it.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    const LANES: usize = 8;
    let mut sums = [0.0f32; LANES];
    // A block's area is a multiple of the lanes.
    let (a, b) = (a.as_chunks::<LANES>().0, b.as_chunks::<LANES>().0);
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum()
}

/// What every place that was searched leaves unexplained, with the memory that takes.
#[derive(Debug, Default)]
pub(crate) struct Costs {
    columns: usize,
    /// Row by row: one less the correlation.
    costs: Vec<f32>,
    /// Sums of the gray levels and of their squares over the block's width, for every place of every row.
    along: Vec<[u32; 2]>,
}

impl Costs {
    /// Compares a block with all places from one corner to another, both included.
    fn compare(
        &mut self,
        block: &Block,
        other: &Picture<'_>,
        [left, top]: [usize; 2],
        [right, bottom]: [usize; 2],
    ) {
        let columns = right - left + 1;
        self.columns = columns;
        self.costs.clear();
        self.along.clear();
        for y in top..bottom + BLOCK {
            let row = other.row(left, y, columns + BLOCK - 1);
            let mut sums = [0u32; 2];
            for (i, &enters) in row.iter().enumerate() {
                let enters = u32::from(enters);
                sums[0] += enters;
                sums[1] += enters * enters;
                if i + 1 >= BLOCK {
                    self.along.push(sums);
                    let leaves = u32::from(row[i + 1 - BLOCK]);
                    sums[0] -= leaves;
                    sums[1] -= leaves * leaves;
                }
            }
        }
        for y in top..=bottom {
            for x in left..=right {
                let mut product = 0i32;
                for (own, row) in block
                    .gray
                    .as_chunks::<BLOCK>()
                    .0
                    .iter()
                    .zip((y..).step_by(EVERY))
                {
                    let their = other.row(x, row, BLOCK);
                    let products = own.iter().zip(their);
                    product += products
                        .map(|(a, b)| i32::from(*a) * i32::from(*b))
                        .sum::<i32>();
                }
                let mut sums = [0u32; 2];
                for row in (0..BLOCK).step_by(EVERY) {
                    let [sum, squares] = self.along[(y - top + row) * columns + x - left];
                    sums[0] += sum;
                    sums[1] += squares;
                }
                let [sum, squares] = sums.map(|sum| sum as f32);
                let covariance = product as f32 - block.mean * sum;
                let variance = squares - sum * sum / COMPARED as f32;
                let cost = match variance < LEAST_VARIANCE * COMPARED as f32 {
                    true => 1.0,
                    false => 1.0 - covariance / (variance * block.variation).sqrt(),
                };
                self.costs.push(cost);
            }
        }
    }

    /// The column and row of the least cost, when it is inside and clearly the least.
    fn best(&self) -> Option<(usize, usize)> {
        let columns = self.columns;
        let rows = self.costs.len() / columns;
        let costs = self.costs.iter().copied().enumerate();
        let (at, least) = costs.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let (column, row) = (at % columns, at / columns);
        // So that there is a place on every side.
        let is_inside =
            (1..columns.max(1) - 1).contains(&column) && (1..rows.max(1) - 1).contains(&row);
        if !is_inside || least > ALIKE {
            return None;
        }
        let is_far =
            |at: usize| (at % columns).abs_diff(column) > 2 || (at / columns).abs_diff(row) > 2;
        let elsewhere = self.costs.iter().enumerate().filter(|(at, _)| is_far(*at));
        let second = elsewhere
            .map(|(_, &cost)| cost)
            .fold(f32::INFINITY, f32::min);
        (least <= UNIQUE * second).then_some((column, row))
    }
}

/// Where a block went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Moved {
    /// Which block: column and row of its corner.
    pub(crate) block: (usize, usize),
    /// Columns to the right.
    pub(crate) right: f32,
    /// Rows down.
    pub(crate) down: f32,
}

/// The corners of a picture's blocks, one every `spacing` pixels, with room to be looked for a few rows up and down.
pub(crate) fn corners(size: Size, spacing: usize) -> impl Iterator<Item = (usize, usize)> {
    let (width, height) = (size.width as usize, size.height as usize);
    let rows = ROWS as usize;
    let ys = (rows..height.saturating_sub(BLOCK + rows + 1)).step_by(spacing);
    ys.flat_map(move |y| {
        let xs = (1..width.saturating_sub(BLOCK + 1)).step_by(spacing);
        xs.map(move |x| (x, y))
    })
}

/// Where the blocks of a picture, one every `spacing` pixels, went in another one of the same size, at most `most` columns to
/// either side.
pub(crate) fn moved(
    from: &Picture<'_>,
    to: &Picture<'_>,
    most: usize,
    spacing: usize,
) -> Vec<Moved> {
    let mut costs = Costs::default();
    let most = most as i32;
    let found = corners(from.size, spacing).filter_map(|(x, y)| {
        let block = Block::of(from, x, y)?;
        let [right, down] = block.found(to, -most..=most, -ROWS..=ROWS, &mut costs)?;
        Some(Moved {
            block: (x, y),
            right,
            down,
        })
    });
    found.collect()
}

/// The value that a share of all is not above; `None` of nothing.
pub(crate) fn quantile(mut values: Vec<f32>, share: f64) -> Option<f32> {
    values.sort_by(f32::total_cmp);
    let last = values.len().checked_sub(1)?;
    values.get((share * last as f64).round() as usize).copied()
}

#[cfg(test)]
#[path = "../tests/texture/mod.rs"]
pub(crate) mod texture;

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::texture::wave;
    use super::*;

    const SIZE: Size = Size::new(240, 160);

    /// A smooth random texture, seen so many columns further right and rows further down.
    fn texture(right: f32, down: f32) -> Vec<u8> {
        let pixels = (0..SIZE.pixels()).map(|pixel| {
            let (x, y) = (pixel % 240, pixel / 240);
            wave(x as f64 - f64::from(right), y as f64 - f64::from(down))
        });
        pixels.collect()
    }

    fn medians(right: f32, down: f32) -> [f32; 2] {
        let (before, after) = (texture(0.0, 0.0), texture(right, down));
        let picture = |pixels| Picture { size: SIZE, pixels };
        let moved = moved(&picture(&before), &picture(&after), 30, SPACING);
        assert!(moved.len() > 10, "{}", moved.len());
        let middle = |of: fn(&Moved) -> f32| quantile(moved.iter().map(of).collect(), 0.5).unwrap();
        [middle(|m| m.right), middle(|m| m.down)]
    }

    #[test]
    fn a_shift_is_found_to_a_tenth_of_a_pixel() {
        for (right, down) in [(0.0, 0.0), (-12.0, 0.0), (7.4, 0.3), (-20.6, -1.8)] {
            let [x, y] = medians(right, down);
            assert!(
                (x - right).abs() < 0.1 && (y - down).abs() < 0.1,
                "{right} {down}: {x} {y}"
            );
        }
    }

    #[test]
    fn a_shift_is_found_however_the_exposure_changed() {
        let before = texture(0.0, 0.0);
        for (gain, offset) in [(0.8, 0.0), (1.2, 0.0), (0.6, 60.0)] {
            let after: Vec<u8> = texture(-9.3, 0.6)
                .into_iter()
                .map(|value| (f64::from(value) * gain + offset).clamp(0.0, 255.0) as u8)
                .collect();
            let picture = |pixels| Picture { size: SIZE, pixels };
            let moved = moved(&picture(&before), &picture(&after), 30, SPACING);
            assert!(moved.len() > 10, "{gain}: {}", moved.len());
            let middle =
                |of: fn(&Moved) -> f32| quantile(moved.iter().map(of).collect(), 0.5).unwrap();
            let (right, down) = (middle(|m| m.right), middle(|m| m.down));
            assert!(
                (right + 9.3).abs() < 0.05 && (down - 0.6).abs() < 0.05,
                "{gain}: {right} {down}"
            );
        }
    }

    #[test]
    fn a_picture_without_texture_says_nothing() {
        let flat = vec![90; SIZE.pixels()];
        let picture = Picture {
            size: SIZE,
            pixels: &flat,
        };
        assert_eq!(moved(&picture, &picture, 30, SPACING), []);
    }
}
