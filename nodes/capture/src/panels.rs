//! Several views in one picture, side by side or above each other.

use std::fmt;
use std::path::{Path, PathBuf};

use messages::Size;

use crate::error::SourceError;
use crate::image_file;
use crate::layout::Layout;
use crate::levels::Levels;
use crate::motion::{Block, Costs, Picture};

/// One of the views that a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Which, from the left or from above, counted from 0.
    pub index: u32,
    /// Of how many.
    pub count: u32,
    /// Whether they lie above each other.
    pub is_row: bool,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.is_row { "row" } else { "column" };
        write!(f, "{kind} {} of {}", self.index + 1, self.count)
    }
}

impl Part {
    /// The size of a part of a picture.
    ///
    /// # Errors
    /// A picture that cannot be cut into so many parts of one size.
    pub(crate) fn size(self, path: &Path, whole: Size) -> Result<Size, SourceError> {
        let size = match self.is_row {
            true => Size::new(whole.width, whole.height / self.count),
            false => Size::new(whole.width / self.count, whole.height),
        };
        let is_even = match self.is_row {
            true => whole.height.is_multiple_of(self.count),
            false => whole.width.is_multiple_of(self.count),
        };
        match is_even {
            true => image_file::fitting(path, size),
            false => Err(SourceError::Parts {
                path: path.to_owned(),
                size: whole,
                part: self,
            }),
        }
    }

    /// Its pixels.
    pub(crate) fn of(self, whole: Size, pixels: &[u8]) -> Vec<u8> {
        let (width, index, count) = (
            whole.width as usize,
            self.index as usize,
            self.count as usize,
        );
        if self.is_row {
            let rows = whole.height as usize / count * width;
            return pixels[index * rows..][..rows].to_vec();
        }
        let columns = width / count;
        let rows = pixels.chunks_exact(width);
        rows.flat_map(|row| &row[index * columns..][..columns])
            .copied()
            .collect()
    }
}

/// Width over height from which on a picture may show several views side by side, and height over width above each other.
const WIDE: f32 = 2.0;
const HIGH: f32 = 1.4;
/// The most views that are looked for in a picture.
const MOST: u32 = 6;
/// About how many blocks are looked for in the next part, how many must have texture, and what share be found.
const BLOCKS: usize = 60;
const ENOUGH: usize = 8;
const FOUND: f32 = 0.5;
/// The part of the clearest seams' change of gray levels that seams must show.
const SEAM: f32 = 0.5;

/// How many views the pictures of a folder show, where the first of them shows the same several times.
pub(crate) fn seen(images: &[PathBuf]) -> Result<Option<Layout>, SourceError> {
    let Some(first) = images.first() else {
        return Ok(None);
    };
    let Ok(head) = image_file::head(first) else {
        // What is wrong with it is said where it is read.
        return Ok(None);
    };
    let aspect = head.size.width as f32 / head.size.height as f32;
    let is_row = aspect <= 1.0 / HIGH;
    if !is_row && aspect < WIDE {
        return Ok(None);
    }
    // How dark it is tells nothing here.
    let Ok((whole, gray)) = image_file::pixels(first, &Levels::default(), None) else {
        return Ok(None);
    };
    let pixels = gray.pixels;
    let cut = |count| {
        let share = share(first, whole, &pixels, count, is_row);
        (share >= FOUND).then(|| (count, seam(whole, &pixels, count, is_row)))
    };
    let shown: Vec<(u32, f32)> = (2..=MOST).filter_map(cut).collect();
    // Halves of four views show the same too, and so do five parts of them: where there are seams, and as many as can be.
    let best = shown.iter().map(|(_, seam)| *seam).fold(0.0, f32::max);
    let found = shown
        .into_iter()
        .rev()
        .find(|(_, seam)| *seam >= SEAM * best);
    Ok(found.map(|(count, _)| match is_row {
        true => Layout::Rows(count),
        false => Layout::Columns(count),
    }))
}

/// How much gray levels change from one part of a picture to the next, in the mean along the seam; the least of all seams.
fn seam(whole: Size, pixels: &[u8], count: u32, is_row: bool) -> f32 {
    let [width, height] = [whole.width, whole.height].map(|side| side as usize);
    let at = |along: usize, across: usize| match is_row {
        true => pixels[across * width + along],
        false => pixels[along * width + across],
    };
    let (along, across) = if is_row {
        (width, height)
    } else {
        (height, width)
    };
    let seams = (1..count as usize).map(|part| {
        let place = part * across / count as usize;
        let changes = (0..along).map(|i| u32::from(at(i, place).abs_diff(at(i, place - 1))));
        changes.sum::<u32>() as f32 / along as f32
    });
    seams.fold(f32::INFINITY, f32::min)
}

/// What share of one part of a picture is found in the next, the least of all neighbours, where it is cut into so many.
fn share(path: &Path, whole: Size, pixels: &[u8], count: u32, is_row: bool) -> f32 {
    let part = |index| {
        let part = Part {
            index,
            count,
            is_row,
        };
        Some((part.size(path, whole).ok()?, part.of(whole, pixels)))
    };
    let parts: Option<Vec<(Size, Vec<u8>)>> = (0..count).map(part).collect();
    let parts = parts.unwrap_or_default();
    let pairs = parts.windows(2).map(|pair| {
        let [first, second] = [0, 1].map(|at| Picture {
            size: pair[at].0,
            pixels: &pair[at].1,
        });
        found(&first, &second)
    });
    pairs.reduce(f32::min).unwrap_or_default()
}

/// What share of one picture is found in the same rows of another.
fn found(first: &Picture<'_>, second: &Picture<'_>) -> f32 {
    const SIDE: usize = 24;
    let (width, height) = (first.size.width as usize, first.size.height as usize);
    let spacing = ((width * height) as f32 / BLOCKS as f32).sqrt() as usize;
    let reach = (width / 4) as i32;
    let (mut costs, mut textured, mut found) = (Costs::default(), 0, 0);
    for y in (2..height.saturating_sub(SIDE)).step_by(spacing.max(SIDE)) {
        for x in (2..width.saturating_sub(SIDE)).step_by(spacing.max(SIDE)) {
            let Some(block) = Block::of(first, x, y) else {
                continue;
            };
            textured += 1;
            found += usize::from(
                block
                    .found(second, -reach..=reach, -4..=4, &mut costs)
                    .is_some(),
            );
        }
    }
    match textured >= ENOUGH {
        true => found as f32 / textured as f32,
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_cut_from_the_left_and_from_above() {
        let whole = Size::new(4, 2);
        let pixels = [0, 1, 2, 3, 4, 5, 6, 7];
        let part = |index, is_row| {
            Part {
                index,
                count: 2,
                is_row,
            }
            .of(whole, &pixels)
        };
        assert_eq!(part(0, false), [0, 1, 4, 5]);
        assert_eq!(part(1, false), [2, 3, 6, 7]);
        assert_eq!(part(1, true), [4, 5, 6, 7]);
    }
}
