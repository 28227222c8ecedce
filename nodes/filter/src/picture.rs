//! A real image with mirrored margins, so that the neighbours of every pixel exist.

use messages::Size;

/// Columns to the left of the image; a multiple of the widest vector, so that rows start where one may.
const LEFT: usize = 8;
/// Columns to the right of the image at least, and rows below it.
const AFTER: usize = 2;
/// Rows above the image.
const ABOVE: usize = 1;

/// A real image of up to a size, with margins that mirror it.
#[derive(Debug, Default)]
pub(crate) struct Picture {
    width: usize,
    height: usize,
    stride: usize,
    values: Vec<f32>,
}

impl Picture {
    /// Prepares for an image of this size; what it shows is whatever it showed.
    pub(crate) fn resize(&mut self, size: Size) {
        self.width = size.width as usize;
        self.height = size.height as usize;
        self.stride = (LEFT + self.width + AFTER).next_multiple_of(LEFT);
        let needed = self.stride * (ABOVE + self.height + AFTER);
        if self.values.len() < needed {
            self.values.resize(needed, 0.0);
        }
    }

    /// Row `y`, from one pixel before the image to two after it; rows −1, `height` and `height` + 1 exist too.
    pub(crate) fn row(&self, y: isize) -> &[f32] {
        let start = (y + ABOVE as isize) as usize * self.stride + LEFT;
        &self.values[start - 1..start + self.width + AFTER]
    }

    /// The values from row `y` − 1 to row `y` + 2 with their margins, where among them the first pixel of row `y` is,
    /// and how far rows are apart.
    pub(crate) fn around(&self, y: usize) -> (&[f32], usize, usize) {
        let rows =
            &self.values[(y + ABOVE - 1) * self.stride..(y + ABOVE + AFTER + 1) * self.stride];
        (rows, self.stride + LEFT, self.stride)
    }

    /// The pixels of row `y`.
    pub(crate) fn pixels(&self, y: usize) -> &[f32] {
        &self.row(y as isize)[1..=self.width]
    }

    /// The pixels of row `y` and, when there is one, of the row after it, for writing.
    pub(crate) fn pair_mut(&mut self, y: usize) -> (&mut [f32], Option<&mut [f32]>) {
        let start = (y + ABOVE) * self.stride;
        let (first, second) = self.values[start..start + 2 * self.stride].split_at_mut(self.stride);
        let pixels = LEFT..LEFT + self.width;
        let second = (y + 1 < self.height).then(|| &mut second[pixels.clone()]);
        (&mut first[pixels], second)
    }

    /// Fills the margins with the image's reflection in its borders.
    pub(crate) fn mirror(&mut self) {
        let Self {
            width,
            height,
            stride,
            ..
        } = *self;
        for row in self
            .values
            .chunks_exact_mut(stride)
            .skip(ABOVE)
            .take(height)
        {
            row[LEFT - 1] = row[LEFT];
            for i in 0..AFTER {
                row[LEFT + width + i] = row[LEFT + width - 1 - i];
            }
        }
        let mut copy = |from: usize, to: usize| {
            let start = (from + ABOVE) * stride;
            self.values.copy_within(start..start + stride, to * stride);
        };
        copy(0, 0);
        for i in 0..AFTER {
            copy(height - 1 - i, ABOVE + height + i);
        }
    }
}

/// The pixel of 0 … `n` − 1 seen at `p` when mirrors stand on the outer edges of the first and the last.
pub(crate) fn mirrored(p: isize, n: usize) -> usize {
    let p = p.rem_euclid(2 * n as isize) as usize;
    p.min(2 * n - 1 - p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mirror_repeats_the_border_pixel_and_walks_back() {
        let seen: Vec<usize> = (-4..8).map(|p| mirrored(p, 3)).collect();
        assert_eq!(seen, [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
    }

    #[test]
    fn every_neighbour_of_a_pixel_is_the_mirrored_pixel() {
        let size = Size::new(5, 3);
        let mut picture = Picture::default();
        picture.resize(size);
        for y in (0..3).step_by(2) {
            let (first, second) = picture.pair_mut(y);
            for (x, value) in first.iter_mut().enumerate() {
                *value = (10 * y + x) as f32;
            }
            for (x, value) in second.into_iter().flatten().enumerate() {
                *value = (10 * (y + 1) + x) as f32;
            }
        }
        picture.mirror();
        for y in -1..5 {
            for x in -1..7 {
                let expected = (10 * mirrored(y, 3) + mirrored(x, 5)) as f32;
                assert_eq!(picture.row(y)[(x + 1) as usize], expected, "({x}, {y})");
            }
        }
    }
}
