//! How a picture moves from one frame to another: blocks of texture, found again.
//!
//! Blocks with texture in both directions are looked for in the other picture, along the row and a few rows up and down,
//! by the least sum of absolute differences; the sub-pixel part is what gradients explain of the difference that is
//! left. Blocks whose best place is hardly better than another one say nothing.

use messages::Size;

/// Pixels a block measures.
const BLOCK: usize = 20;
/// Pixels from one block to the next, where all of a picture is looked at.
pub(crate) const SPACING: usize = 28;
/// Rows up and down in which a block is looked for.
const ROWS: i32 = 4;
/// Least mean gradient of a block along and across, in gray levels a pixel.
const TEXTURE: f32 = 2.0;
/// How much better than the best elsewhere the best place must be.
const UNIQUE: f32 = 0.75;
/// Mean absolute difference in gray levels over which nothing was found.
const ALIKE: f32 = 14.0;

/// A picture: 8-bit gray, row by row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Picture<'a> {
    pub(crate) size: Size,
    pub(crate) pixels: &'a [u8],
}

impl Picture<'_> {
    fn at(&self, x: usize, y: usize) -> u8 {
        self.pixels[y * self.size.width as usize + x]
    }

    /// Mean absolute differences of neighbours in a block, along the row and along the column.
    fn texture(&self, x: usize, y: usize) -> [f32; 2] {
        let mut sums = [0u32; 2];
        for row in y..y + BLOCK {
            for column in x..x + BLOCK {
                let own = self.at(column, row);
                sums[0] += u32::from(own.abs_diff(self.at(column + 1, row)));
                sums[1] += u32::from(own.abs_diff(self.at(column, row + 1)));
            }
        }
        sums.map(|sum| sum as f32 / (BLOCK * BLOCK) as f32)
    }

    /// Mean absolute difference of a block here to one there.
    fn difference(&self, x: usize, y: usize, other: &Picture<'_>, to_x: usize, to_y: usize) -> f32 {
        let width = self.size.width as usize;
        let mut sum = 0u32;
        for row in 0..BLOCK {
            let own = &self.pixels[(y + row) * width + x..][..BLOCK];
            let their = &other.pixels[(to_y + row) * width + to_x..][..BLOCK];
            let of_row = own.iter().zip(their);
            sum += of_row.map(|(a, b)| u32::from(a.abs_diff(*b))).sum::<u32>();
        }
        sum as f32 / (BLOCK * BLOCK) as f32
    }
}

impl Picture<'_> {
    /// How much further than to a whole place in another picture a block went, in columns and rows: what the mean of both
    /// pictures' gradients explains of their difference, by least squares (Lucas and Kanade 1981, one step).
    fn rest(&self, x: usize, y: usize, other: &Picture<'_>, to_x: usize, to_y: usize) -> [f32; 2] {
        let gradient = |picture: &Picture<'_>, x: usize, y: usize| {
            let at = |x, y| f32::from(picture.at(x, y));
            [
                (at(x + 1, y) - at(x - 1, y)) / 2.0,
                (at(x, y + 1) - at(x, y - 1)) / 2.0,
            ]
        };
        let (mut xx, mut xy, mut yy, mut xe, mut ye) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for row in 0..BLOCK {
            for column in 0..BLOCK {
                let (own, their) = ((x + column, y + row), (to_x + column, to_y + row));
                let [gx, gy] = gradient(self, own.0, own.1);
                let [hx, hy] = gradient(other, their.0, their.1);
                let (gx, gy) = ((gx + hx) / 2.0, (gy + hy) / 2.0);
                let error =
                    f32::from(other.at(their.0, their.1)) - f32::from(self.at(own.0, own.1));
                xx += gx * gx;
                xy += gx * gy;
                yy += gy * gy;
                xe += gx * error;
                ye += gy * error;
            }
        }
        let determinant = xx * yy - xy * xy;
        if determinant <= 1e-3 * xx * yy {
            return [0.0; 2];
        }
        let right = (xy * ye - yy * xe) / determinant;
        let down = (xy * xe - xx * ye) / determinant;
        [right, down].map(|rest| rest.clamp(-1.0, 1.0))
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

/// Where the blocks of a picture, one every `spacing` pixels, went in another one of the same size, at most `most` columns to
/// either side.
pub(crate) fn moved(
    from: &Picture<'_>,
    to: &Picture<'_>,
    most: usize,
    spacing: usize,
) -> Vec<Moved> {
    let (width, height) = (from.size.width as usize, from.size.height as usize);
    let mut all = Vec::new();
    let mut costs = Vec::new();
    let rows = ROWS as usize;
    for y in (rows..height.saturating_sub(BLOCK + rows + 1)).step_by(spacing) {
        for x in (1..width.saturating_sub(BLOCK + 1)).step_by(spacing) {
            if from
                .texture(x, y)
                .into_iter()
                .any(|texture| texture < TEXTURE)
            {
                continue;
            }
            let least = x.saturating_sub(most);
            let greatest = (x + most).min(width - BLOCK);
            let columns = greatest - least + 1;
            costs.clear();
            for to_y in y - rows..=y + rows {
                let cost = |to_x| from.difference(x, y, to, to_x, to_y);
                costs.extend((least..=greatest).map(cost));
            }
            let Some((column, row)) = best(&costs, columns) else {
                continue;
            };
            // It is inside, so that there is a place on every side.
            let (to_x, to_y) = (least + column, y - rows + row);
            let [along, across] = from.rest(x, y, to, to_x, to_y);
            all.push(Moved {
                block: (x, y),
                right: to_x as f32 + along - x as f32,
                down: to_y as f32 + across - y as f32,
            });
        }
    }
    all
}

/// The column and row of the least cost, when it is inside and clearly the least.
fn best(costs: &[f32], columns: usize) -> Option<(usize, usize)> {
    let rows = costs.len() / columns;
    let (at, least) = costs
        .iter()
        .copied()
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let (column, row) = (at % columns, at / columns);
    let is_inside = (1..columns - 1).contains(&column) && (1..rows - 1).contains(&row);
    if !is_inside || least > ALIKE {
        return None;
    }
    let is_far =
        |at: usize| (at % columns).abs_diff(column) > 2 || (at / columns).abs_diff(row) > 2;
    let elsewhere = costs.iter().enumerate().filter(|(at, _)| is_far(*at));
    let second = elsewhere
        .map(|(_, &cost)| cost)
        .fold(f32::INFINITY, f32::min);
    if least > UNIQUE * second {
        return None;
    }
    Some((column, row))
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
    fn a_picture_without_texture_says_nothing() {
        let flat = vec![90; SIZE.pixels()];
        let picture = Picture {
            size: SIZE,
            pixels: &flat,
        };
        assert_eq!(moved(&picture, &picture, 30, SPACING), []);
    }
}
