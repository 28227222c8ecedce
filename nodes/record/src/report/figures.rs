//! The thesis's figures as small PNG: few colours, so a palette, and no more pixels than a page can show.

use image::ExtendedColorType;
use messages::record::{Colours, Pictured, Seen, Span, Views};
use messages::{Curve, CurvesView, Edge, MatchPoint, Size};
use png::EncodingError;

use crate::compact::{Pixels, compact, encode};
use crate::export::pictures::{self, Picture};

/// The longest side of a figure in pixels; larger images are drawn at a half, a third …
const LONGEST_SIDE: u32 = 800;

/// Images narrower than this are enlarged with hard pixels.
const COARSE: u32 = 300;

/// How the figures of a scan are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sheet {
    /// Of the image.
    pub(super) full: Size,
    /// How many of its pixels make one of a figure, along each side.
    pub(super) step: u32,
}

impl Sheet {
    /// For images of this size.
    pub(super) fn of(full: Size) -> Self {
        let step = full.width.max(full.height).div_ceil(LONGEST_SIDE).max(1);
        Self { full, step }
    }

    /// The size of a figure.
    pub(super) fn size(self) -> Size {
        let side = |pixels: u32| pixels.div_ceil(self.step).max(1);
        Size::new(side(self.full.width), side(self.full.height))
    }

    /// Whether a page shows its pixels one by one.
    pub(super) fn is_coarse(self) -> bool {
        self.full.width < COARSE
    }

    /// Where a place of the image lies in a figure.
    fn place(self, x: f32, y: f32) -> (f32, f32) {
        let step = self.step as f32;
        let place = |at: f32| (at + 0.5) / step - 0.5;
        (place(x), place(y))
    }

    fn edges(self, edges: &[Edge]) -> Vec<Edge> {
        let moved = |edge: &Edge| {
            let (x, y) = self.place(edge.x, edge.y);
            Edge { x, y, ..*edge }
        };
        edges.iter().map(moved).collect()
    }

    /// The image itself; each pixel the mean of those it stands for.
    pub(super) fn original(self, pixels: &[u8]) -> Result<Vec<u8>, EncodingError> {
        let (size, step) = (self.size(), self.step as usize);
        let (width, height) = (self.full.width as usize, self.full.height as usize);
        let mut bytes = Vec::with_capacity(size.pixels());
        for y in 0..size.height as usize {
            for x in 0..size.width as usize {
                let rows = y * step..((y + 1) * step).min(height);
                let columns = x * step..((x + 1) * step).min(width);
                let count = (rows.len() * columns.len()).max(1) as u32;
                let row = |y: usize| pixels.get(y * width..).unwrap_or_default();
                let sum: u32 = rows
                    .map(|y| {
                        let run = row(y).get(columns.clone()).unwrap_or_default();
                        run.iter().map(|gray| u32::from(*gray)).sum::<u32>()
                    })
                    .sum();
                bytes.push((sum / count) as u8);
            }
        }
        encode(size, &bytes, Pixels::Gray)
    }

    /// Dark where a zero-crossing is.
    pub(super) fn zero_crossings(self, edges: &[Edge]) -> Result<Vec<u8>, EncodingError> {
        let picture = pictures::zero_crossings(self.size(), &self.edges(edges));
        compact(&picture)
    }

    /// Each zero-crossing in the hue of its orientation.
    pub(super) fn orientation(self, edges: &[Edge]) -> Result<Vec<u8>, EncodingError> {
        let picture = pictures::orientation(self.size(), &self.edges(edges));
        let circle = Colours::circle();
        let mut palette = vec![Colours::UNKNOWN];
        palette.extend((0..255u8).map(|turn| circle.of(f32::from(turn) / 255.0)));
        encode(picture.size, &picture.bytes, Pixels::Of(&palette, false))
    }

    /// Every curve in a colour of its own, its centroid crossed.
    pub(super) fn segments(self, view: CurvesView<'_>) -> Result<Vec<u8>, EncodingError> {
        let moved = |curve: &Curve| {
            let (x, y) = self.place(curve.x, curve.y);
            Curve { x, y, ..*curve }
        };
        let curves: Vec<Curve> = view.curves.iter().map(moved).collect();
        let points = self.edges(view.points);
        let view = CurvesView {
            curves: &curves,
            points: &points,
        };
        compact(&pictures::segments(self.size(), view))
    }

    /// The disparities of a channel's matches.
    pub(super) fn match_disparities(
        self,
        points: &[MatchPoint],
        span: Option<Span>,
    ) -> Result<Vec<u8>, EncodingError> {
        let places = points.iter().map(|p| {
            let (x, y) = self.place(p.x, p.y);
            (x, y, p.disparity)
        });
        self.disparities(places, span)
    }

    /// A whole disparity picture.
    pub(super) fn disparity_picture(
        self,
        disparities: &[f32],
        span: Option<Span>,
    ) -> Result<Vec<u8>, EncodingError> {
        let width = (self.full.width as usize).max(1);
        let known = disparities
            .iter()
            .enumerate()
            .filter(|(_, d)| d.is_finite());
        let places = known.map(|(at, &disparity)| {
            let (x, y) = self.place((at % width) as f32, (at / width) as f32);
            (x, y, disparity)
        });
        self.disparities(places, span)
    }

    /// A picture of points as viewers are shown it.
    pub(super) fn painted(
        self,
        pictured: Pictured,
        seen: &Seen<'_>,
    ) -> Result<Vec<u8>, EncodingError> {
        let mut rgb = Vec::new();
        Views::default().painted(self.full, pictured, seen, &mut rgb);
        let (full, _) = rgb.as_chunks::<3>();
        let (size, width) = (self.size(), self.full.width as usize);
        let mut bytes = vec![0; 3 * size.pixels()];
        let (pixels, _) = bytes.as_chunks_mut::<3>();
        // Points are few and black is nothing: none of them is left out because its neighbour is none.
        for (at, colour) in full.iter().enumerate() {
            if *colour != Colours::UNKNOWN {
                let (x, y) = (at % width, at / width);
                let step = self.step as usize;
                pixels[y / step * size.width as usize + x / step] = *colour;
            }
        }
        compact(&Picture {
            size,
            bytes,
            colours: ExtendedColorType::Rgb8,
        })
    }

    fn disparities(
        self,
        places: impl Iterator<Item = (f32, f32, f32)>,
        span: Option<Span>,
    ) -> Result<Vec<u8>, EncodingError> {
        let size = self.size();
        let mut bytes = vec![0; size.pixels()];
        for (x, y, disparity) in places {
            let inside = pictures::pixel(size, x, y);
            if let (Some((x, y)), Some(span)) = (inside, span) {
                bytes[y as usize * size.width as usize + x as usize] = shade(span, disparity);
            }
        }
        encode(size, &bytes, Pixels::Of(&shades(), false))
    }
}

/// The place of a disparity's colour among the [`shades`].
pub(super) fn shade(span: Span, disparity: f32) -> u8 {
    1 + (span.share(disparity) * 254.0) as u8
}

/// The colours of disparities, after the one of what has none.
pub(super) fn shades() -> Vec<[u8; 3]> {
    let colours = Colours::new();
    let mut palette = vec![Colours::UNKNOWN];
    palette.extend((0..255u8).map(|step| colours.of(f32::from(step) / 254.0)));
    palette
}

/// How a figure is to be shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// As it is.
    Photograph,
    /// Dark strokes on paper, light ones on a dark page.
    Ink,
    /// Single pixels in colours on black, which fade where a page shows them smaller.
    Sparse,
}

/// The classes of a figure's picture.
pub(super) fn class(sheet: Sheet, look: Look) -> &'static str {
    match (sheet.is_coarse(), look) {
        (true, Look::Ink) => "coarse ink",
        (true, _) => "coarse",
        (false, Look::Ink) => "ink",
        (false, Look::Sparse) => "sparse",
        (false, Look::Photograph) => "",
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn decoded(png: &[u8]) -> image::RgbImage {
        image::load_from_memory(png).unwrap().into_rgb8()
    }

    #[test]
    fn a_large_image_is_drawn_smaller_and_every_place_stays_in_it() {
        let sheet = Sheet::of(Size::new(2400, 1801));
        assert_eq!((sheet.step, sheet.size()), (3, Size::new(800, 601)));
        assert_eq!(sheet.place(1.0, 4.0), (0.0, 1.0));
        let gray = vec![7; sheet.full.pixels()];
        let original = decoded(&sheet.original(&gray).unwrap());
        assert_eq!(original.dimensions(), (800, 601));
        assert!(original.pixels().all(|pixel| pixel.0 == [7; 3]));
        assert_eq!(Sheet::of(Size::new(512, 480)).step, 1);
    }

    #[test]
    fn what_is_packed_shows_the_same_picture() {
        let sheet = Sheet::of(Size::new(21, 10));
        let edges = [(0.0, 0.0), (20.0, 9.0), (8.3, 4.0)].map(|(x, y)| Edge {
            x,
            y,
            ..Edge::default()
        });
        let picture = decoded(&sheet.zero_crossings(&edges).unwrap());
        let dark: Vec<_> = picture
            .enumerate_pixels()
            .filter(|(.., pixel)| pixel.0 == [0; 3])
            .map(|(x, y, _)| (x, y))
            .collect();
        assert_eq!(dark, [(0, 0), (8, 4), (20, 9)]);
        assert_eq!(picture.pixels().filter(|p| p.0 == [255; 3]).count(), 207);
    }

    #[test]
    fn near_and_far_take_the_ends_of_the_colours() {
        let span = Span::of([4.0, 12.0].into_iter()).unwrap();
        assert_eq!([4.0, 12.0].map(|d| shade(span, d)), [1, 255]);
        let sheet = Sheet::of(Size::new(2, 1));
        let picture = decoded(
            &sheet
                .disparity_picture(&[f32::NAN, 12.0], Some(span))
                .unwrap(),
        );
        assert_eq!(picture.get_pixel(0, 0).0, Colours::UNKNOWN);
        assert_eq!(picture.get_pixel(1, 0).0, Colours::new().of(1.0));
    }
}
