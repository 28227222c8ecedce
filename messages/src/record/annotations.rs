//! `foxglove.ImageAnnotations`: strips, dots and texts over an image.
//!
//! Foxglove counts image coordinates from the corner of the top left pixel, our points from its centre: half a pixel is
//! added to every place.

use std::fmt::{self, Write as _};
use std::ops::Range;

use super::wire::{Fill, varint_len};
use crate::elements::Curve;
use crate::header::Size;

/// Red, green, blue and opacity, 0 to 1.
pub(super) type Colour = [f64; 4];

/// An opaque colour.
pub(super) fn opaque(rgb: [u8; 3]) -> Colour {
    let [r, g, b] = rgb.map(|c| f64::from(c) / 255.0);
    [r, g, b, 1.0]
}

/// Behind texts: dark enough for every colour to be read, and the image is still seen.
const BACKGROUND: Colour = [0.0, 0.0, 0.0, 0.7];

/// What is read best on a colour: black or white.
fn ink_on([red, green, blue, _]: Colour) -> Colour {
    // How bright an eye takes the three for (ITU-R BT.601).
    match 0.299 * red + 0.587 * green + 0.114 * blue > 0.5 {
        true => [0.0, 0.0, 0.0, 1.0],
        false => [1.0; 4],
    }
}

/// Around dots, so that they are seen on their own curve.
const RIM: Colour = [0.0, 0.0, 0.0, 0.8];

// What stands in an annotation has a known length, head and all, so that nothing is moved once it is written.
const KIND: usize = 2;
const POINT: usize = 2 + 2 * DOUBLE;
const COLOUR: usize = 2 + 4 * DOUBLE;
const DOUBLE: usize = 1 + size_of::<f64>();

/// How points of a `foxglove.PointsAnnotation` are drawn.
#[derive(Clone, Copy)]
enum Style {
    Points = 1,
    LineStrip = 3,
}

/// A message of annotations in the making. Each has the image's time, to the nanosecond: viewers show none that has
/// another, and fail over one that has none.
#[derive(Debug)]
pub(super) struct Sheet<'a> {
    fill: Fill<'a>,
    nanos: u64,
    /// The field of an annotation's time, head and all, and how much of it there is.
    time: ([u8; 24], usize),
}

impl<'a> Sheet<'a> {
    /// Over an image of this time.
    pub(super) fn new(nanos: u64, out: &'a mut Vec<u8>) -> Self {
        let (start, mut time) = (out.len(), [0; 24]);
        Fill(out).timestamp(1, nanos);
        let written = out.drain(start..);
        let len = written.len();
        time.iter_mut()
            .zip(written)
            .for_each(|(slot, byte)| *slot = byte);
        Self {
            fill: Fill(out),
            nanos,
            time: (time, len),
        }
    }

    /// A line through these points.
    pub(super) fn strip(&mut self, points: &[[f32; 2]], colour: Colour) {
        self.points(Style::LineStrip, POINT * points.len());
        points.iter().for_each(|point| self.place(3, *point));
        self.colour(4, colour);
        self.fill.double(7, 1.0);
    }

    /// A dot of its own colour with a dark rim at each of these places, in two annotations for all: they are listed
    /// twice.
    pub(super) fn dots(&mut self, dots: impl Iterator<Item = ([f32; 2], Colour)> + Clone) {
        let count = dots.clone().count();
        if count == 0 {
            return;
        }
        self.points(Style::Points, POINT * count);
        dots.clone().for_each(|(point, _)| self.place(3, point));
        self.colour(4, RIM);
        self.fill.double(7, 1.4);

        self.points(Style::Points, (POINT + COLOUR) * count);
        for (point, colour) in dots {
            self.place(3, point);
            self.colour(5, colour);
        }
        self.colour(4, RIM);
        self.fill.double(7, 0.8);
    }

    /// A text whose lower left corner is here, of this colour before that one.
    fn text(&mut self, corner: [f32; 2], text: &str, height: f32, [ink, paper]: [Colour; 2]) {
        let text_len = 1 + varint_len(text.len() as u64) + text.len();
        self.open(3, POINT + text_len + DOUBLE + 2 * COLOUR);
        self.place(2, corner);
        self.fill.text(3, text);
        self.fill.double(4, height.into());
        self.colour(5, ink);
        self.colour(6, paper);
    }

    /// The last there is to say.
    pub(super) fn finish(mut self) {
        self.fill.timestamp(5, self.nanos);
    }

    /// Begins points of which so many bytes, a colour and a thickness follow.
    fn points(&mut self, style: Style, bytes: usize) {
        self.open(2, KIND + bytes + COLOUR + DOUBLE);
        self.fill.varint(2, style as u64);
    }

    /// Begins an annotation of which so many bytes follow its time.
    fn open(&mut self, field: u32, bytes: usize) {
        let (time, len) = (self.time.0, self.time.1);
        self.fill.open(field, len + bytes);
        self.fill.0.reserve(len + bytes);
        self.fill.0.extend_from_slice(&time[..len]);
    }

    fn place(&mut self, field: u8, [x, y]: [f32; 2]) {
        let mut point = [0; POINT];
        point[..3].copy_from_slice(&[field << 3 | 2, POINT as u8 - 2, 1 << 3 | 1]);
        point[3..11].copy_from_slice(&(f64::from(x) + 0.5).to_le_bytes());
        point[11] = 2 << 3 | 1;
        point[12..].copy_from_slice(&(f64::from(y) + 0.5).to_le_bytes());
        self.fill.0.extend_from_slice(&point);
    }

    fn colour(&mut self, field: u8, colour: Colour) {
        let mut bytes = [0; COLOUR];
        bytes[..2].copy_from_slice(&[field << 3 | 2, COLOUR as u8 - 2]);
        for ((slot, value), number) in bytes[2..].chunks_exact_mut(DOUBLE).zip(colour).zip(1..) {
            slot[0] = number << 3 | 1;
            slot[1..].copy_from_slice(&value.to_le_bytes());
        }
        self.fill.0.extend_from_slice(&bytes);
    }
}

/// Texts that do not cover each other; keeps its memory from image to image.
#[derive(Debug, Default)]
pub(super) struct Labels {
    /// A line's height, in pixels of the image: of labels, …
    height: f32,
    /// … and of the legend.
    legend: f32,
    /// How far down the legend reaches.
    told: f32,
    places: Places,
    text: String,
}

/// Pixels between a text and what is beside it.
const GAP: f32 = 3.0;

impl Labels {
    /// Begins anew over an image of this size. A line is a forty-eighth of it high, in the legend a thirtieth, and enough to be
    /// read in a small one.
    pub(super) fn begin(&mut self, size: Size) {
        self.height = (size.height as f32 / 48.0).max(8.0);
        self.legend = (size.height as f32 / 30.0).max(8.0);
        self.told = GAP;
        self.places.clear(size);
    }

    fn compose(&mut self, text: fmt::Arguments<'_>) {
        self.text.clear();
        // A string takes whatever there is to say.
        self.text.write_fmt(text).unwrap_or_default();
    }

    /// How wide so many letters are, in most fonts.
    pub(super) fn width_of(&self, letters: usize) -> f32 {
        0.6 * self.height * letters as f32
    }

    /// Adds a line on a colour to the legend in the upper left corner. To be done before curves are named.
    pub(super) fn tell(&mut self, sheet: &mut Sheet<'_>, text: fmt::Arguments<'_>, colour: Colour) {
        self.compose(text);
        let height = self.legend;
        self.told += 1.2 * height;
        let corner = [GAP, self.told];
        let extent = [
            self.width_of(self.text.len()) * height / self.height,
            height,
        ];
        self.places.mark(corner, extent, self.height / 2.0);
        sheet.text(corner, &self.text, height, [ink_on(colour), colour]);
    }

    /// Writes beside a curve's centroid, where there is room, with half a line to the next text; nothing when the curve
    /// is shorter than this share of the text, which would hide it. Whether it did.
    pub(super) fn name(
        &mut self,
        sheet: &mut Sheet<'_>,
        curve: &Curve,
        share: f32,
        text: fmt::Arguments<'_>,
        colour: Colour,
    ) -> bool {
        self.compose(text);
        let (width, height) = (self.width_of(self.text.len()), self.height);
        if curve.length < share * width {
            return false;
        }
        let bottom = curve.y + height / 2.0;
        let sides = [curve.x + GAP, curve.x - GAP - width].map(|left| [left, bottom]);
        let places = &mut self.places;
        let is_free = |&at: &[f32; 2]| places.take(at, [width, height], height / 2.0);
        let corner = sides.into_iter().find(is_free);
        if let Some(corner) = corner {
            sheet.text(corner, &self.text, height, [colour, BACKGROUND]);
        }
        corner.is_some()
    }
}

/// Which parts of an image texts have taken; keeps its memory from image to image.
#[derive(Debug, Default)]
struct Places {
    size: Size,
    columns: usize,
    taken: Vec<bool>,
}

impl Places {
    /// Pixels a cell measures.
    const CELL: usize = 4;

    /// Frees all of an image of this size.
    fn clear(&mut self, size: Size) {
        self.size = size;
        self.columns = (size.width as usize).div_ceil(Self::CELL);
        self.taken.clear();
        let rows = (size.height as usize).div_ceil(Self::CELL);
        self.taken.resize(self.columns * rows, false);
    }

    /// Takes a box with this lower left corner, and so much around it; false when it is not all inside the image, or not
    /// all free.
    fn take(&mut self, corner: [f32; 2], extent: [f32; 2], around: f32) -> bool {
        let ([left, bottom], [width, height]) = (corner, extent);
        let (right, top) = (left + width, bottom - height);
        let (most_right, most_bottom) = (self.size.width as f32, self.size.height as f32);
        let is_inside = left >= 0.0 && right < most_right && top >= 0.0 && bottom < most_bottom;
        let is_free = is_inside && {
            let [columns, mut rows] = self.cells(corner, extent, 0.0);
            rows.all(|row| !self.taken[row * self.columns..][columns.clone()].contains(&true))
        };
        if is_free {
            self.mark(corner, extent, around);
        }
        is_free
    }

    /// Takes what there is of a box and so much around it.
    fn mark(&mut self, corner: [f32; 2], extent: [f32; 2], around: f32) {
        let [columns, rows] = self.cells(corner, extent, around);
        for row in rows {
            self.taken[row * self.columns..][columns.clone()].fill(true);
        }
    }

    /// The columns and rows of cells that a box and so much around it lie in.
    fn cells(
        &self,
        [left, bottom]: [f32; 2],
        [width, height]: [f32; 2],
        around: f32,
    ) -> [Range<usize>; 2] {
        // What is below zero is in the first cell.
        let cell = |at: f32| at as usize / Self::CELL;
        let cells = |from: f32, to: f32, most: usize| {
            cell(from - around).min(most)..(cell(to + around) + 1).min(most)
        };
        let rows = self.taken.len() / self.columns.max(1);
        [
            cells(left, left + width, self.columns),
            cells(bottom - height, bottom, rows),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_taken_once_and_only_inside_the_image() {
        let mut places = Places::default();
        places.clear(Size::new(101, 37));
        let label = [20.0, 8.0];
        assert!(places.take([0.0, 8.0], label, 0.0));
        assert!(!places.take([0.0, 8.0], label, 0.0));
        assert!(!places.take([18.0, 14.0], label, 0.0), "they overlap");
        assert!(places.take([24.0, 8.0], label, 4.0), "they do not");
        assert!(!places.take([24.0, 17.0], label, 0.0), "it is too near");
        assert!(places.take([80.9, 36.9], label, 9.0));
        for outside in [[-1.0, 20.0], [82.0, 20.0], [60.0, 7.0], [40.0, 37.0]] {
            assert!(!places.take(outside, label, 0.0), "{outside:?}");
        }
        assert!(!places.take([f32::NAN, 20.0], label, 0.0));
        assert!(!places.take([f32::INFINITY, 20.0], label, 0.0));
        places.clear(Size::new(101, 37));
        assert!(places.take([0.0, 8.0], label, 0.0));
        places.mark([90.0, 60.0], [500.0, 30.0], 0.0);
        assert!(
            !places.take([80.0, 36.0], label, 0.0),
            "it is taken as far as there is any"
        );
        places.clear(Size::new(0, 0));
        places.mark([3.0, 9.0], label, 4.0);
        assert!(!places.take([0.0, 0.0], [0.0, 0.0], 0.0));
    }
}
