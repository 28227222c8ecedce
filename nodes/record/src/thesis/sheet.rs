//! The contact sheet: every figure small, a column an object.

use image::{Rgb, RgbImage};
use messages::Size;

use super::lettering::{LETTER, write};
use super::{Figure, Step, colour_at};
use crate::export::pictures::Picture;

/// Every how many pixels of a figure one of the sheet is drawn, along each side.
const STEP: u32 = 3;

/// Pixels around the figures.
const MARGIN: u32 = 12;

const PAPER: [u8; 3] = [245; 3];
const INK: [u8; 3] = [30; 3];

/// A figure as the sheet shows it.
pub(crate) struct Small {
    title: String,
    picture: RgbImage,
}

impl Small {
    /// Draws a figure smaller: of thin lines on paper or on black the pixel that stands out stays, of photographs and
    /// whole disparity pictures the mean.
    pub(crate) fn of(figure: &Figure) -> Self {
        let Size { width, height } = figure.picture.size;
        let cell = |x: u32, y: u32| {
            let rows = y * STEP..((y + 1) * STEP).min(height);
            rows.flat_map(move |y| (x * STEP..((x + 1) * STEP).min(width)).map(move |x| (x, y)))
                .map(|(x, y)| colour_at(&figure.picture, x, y))
        };
        let sum = |colour: &[u8; 3]| colour.iter().map(|&c| u32::from(c)).sum::<u32>();
        let picture = RgbImage::from_fn(width.div_ceil(STEP), height.div_ceil(STEP), |x, y| {
            let colour = match figure.step {
                Step::Original => mean(cell(x, y)),
                Step::ZeroCrossings => cell(x, y).min_by_key(sum).unwrap_or(PAPER),
                _ => cell(x, y).max_by_key(sum).unwrap_or(PAPER),
            };
            Rgb(colour)
        });
        let step = match figure.step {
            Step::Original => "",
            step => step.name(),
        };
        Self {
            title: format!("{} {step}", figure.title()),
            picture,
        }
    }
}

fn mean(colours: impl Iterator<Item = [u8; 3]>) -> [u8; 3] {
    let (mut sums, mut count) = ([0u32; 3], 0);
    for colour in colours {
        for (sum, c) in sums.iter_mut().zip(colour) {
            *sum += u32::from(c);
        }
        count += 1;
    }
    sums.map(|sum| (sum / count.max(1)) as u8)
}

/// All figures, a column an object, each under its number.
pub(crate) fn contact_sheet(objects: &[Vec<Small>]) -> Picture {
    let title = LETTER + MARGIN / 2;
    let widest = |object: &Vec<Small>| object.iter().map(|small| small.picture.width()).max();
    let highest = |row: usize| {
        let row = objects.iter().filter_map(move |object| object.get(row));
        row.map(|small| small.picture.height()).max().unwrap_or(0)
    };
    let columns: Vec<u32> = objects.iter().map(|o| widest(o).unwrap_or(0)).collect();
    let rows = objects.iter().map(Vec::len).max().unwrap_or(0);
    let heights: Vec<u32> = (0..rows).map(|row| highest(row) + title).collect();
    let width = columns.iter().map(|width| width + MARGIN).sum::<u32>() + MARGIN;
    let height = heights.iter().map(|height| height + MARGIN).sum::<u32>() + MARGIN;
    let mut sheet = RgbImage::from_pixel(width, height, Rgb(PAPER));
    let mut left = MARGIN;
    for (object, width) in objects.iter().zip(columns) {
        let mut top = MARGIN;
        for (small, height) in object.iter().zip(&heights) {
            write(&mut sheet, left, top, &small.title, INK);
            let (x, y) = (i64::from(left), i64::from(top + title));
            image::imageops::replace(&mut sheet, &small.picture, x, y);
            top += height + MARGIN;
        }
        left += width + MARGIN;
    }
    let size = Size::new(sheet.width(), sheet.height());
    Picture::rgb(size, sheet.into_raw())
}
