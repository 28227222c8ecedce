//! Pictures in the reference view for people: disparities, errors and confidence in colours, each with a legend.

use std::fmt;

use super::annotations::{Labels, Sheet, opaque};
use super::codec::raw_image_head;
use super::views::paint;
use super::wire::Fill;
use super::{Codec, Colours, Span, Views};
use crate::elements::Point;
use crate::header::{Header, Size};
use crate::payload::Kind;
use crate::payload::PointsView;

/// What a picture shows in colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Pictured {
    /// The disparity of each pixel where it is known, blue far and red near.
    Disparity,
    /// How far each point is from the truth, blue right and red off by two pixels or more; gray where no truth is known.
    Error,
    /// How likely each point is off by over a pixel, as its score says, blue unlikely and red likely.
    Confidence,
}

/// Errors in pixels that are shown as the worst.
const WORST_ERROR: f32 = 2.0;
/// Columns within which a truth counts: at an occluding contour a zero-crossing may lie on either surface.
const NEAR: i64 = 2;
/// Chances to be wrong that the colours of confidence are spread over, in even steps of their logarithm.
const CHANCES: [f32; 2] = [0.001, 0.1];
/// Where there is a point and no truth.
const NO_TRUTH: [u8; 3] = [90, 90, 90];
/// Where legends have a line, as shares of the colours.
const STEPS: [f32; 5] = [1.0, 0.75, 0.5, 0.25, 0.0];

impl Pictured {
    /// All there are.
    pub const ALL: [Self; 3] = [Self::Disparity, Self::Error, Self::Confidence];

    /// The topic of its pictures.
    pub fn topic(self) -> &'static str {
        match self {
            Self::Disparity => "disparity/picture",
            Self::Error => "disparity/error",
            Self::Confidence => "disparity/confidence",
        }
    }

    /// What a share of its colours means, 0 the first and 1 the last, which stands for all that is more. Of disparities
    /// their [`Span`] says it.
    pub fn meaning(self, share: f32) -> impl fmt::Display {
        fmt::from_fn(move |f| match self {
            Self::Disparity => Ok(()),
            Self::Error => write!(f, "{} px", share * WORST_ERROR),
            Self::Confidence => {
                let [least, most] = CHANCES;
                let percent = 100.0 * least * (most / least).powf(share);
                write!(f, "{percent:.*} %", usize::from(percent < 3.0))
            }
        })
    }

    /// What it is made of.
    pub fn kinds(self) -> &'static [Kind] {
        match self {
            Self::Disparity => &[Kind::Disparity, Kind::Points],
            Self::Error => &[Kind::Points, Kind::Truth],
            Self::Confidence => &[Kind::Points],
        }
    }
}

/// What pictures are made of, of one scan.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen<'a> {
    /// The disparity picture.
    pub disparity: Option<&'a [f32]>,
    /// The points in space.
    pub points: Option<PointsView<'a>>,
    /// The true disparities.
    pub truth: Option<&'a [f32]>,
    /// What the colours of disparities are spread over.
    pub span: Option<Span>,
}

impl Seen<'_> {
    /// Whether there is what a picture shows.
    pub(super) fn has(&self, pictured: Pictured) -> bool {
        match pictured {
            Pictured::Disparity => self.disparity.is_some(),
            Pictured::Error => self.points.is_some() && self.truth.is_some(),
            Pictured::Confidence => self.points.is_some(),
        }
    }
}

impl Views {
    /// Appends a picture in colours, a `foxglove.RawImage` rgb8 in the reference view; it is black where what it shows is
    /// not there.
    pub fn picture(
        &self,
        codec: &Codec,
        header: &Header,
        pictured: Pictured,
        seen: &Seen<'_>,
        out: &mut Vec<u8>,
    ) {
        let (size, frame) = (header.size(), &codec.optical_frames[codec.reference]);
        let step = 3 * size.width;
        raw_image_head(header.capture_nanos, frame, size, "rgb8", step, out);
        Fill(out).open(6, 3 * size.pixels());
        self.painted(size, pictured, seen, out);
    }

    /// Appends a picture's pixels, three bytes each; they are black where what it shows is not there.
    pub fn painted(&self, size: Size, pictured: Pictured, seen: &Seen<'_>, out: &mut Vec<u8>) {
        let colours = &self.colours;
        let points = seen.points.map_or(&[][..], |points| points.points);
        match pictured {
            Pictured::Disparity => {
                paint(colours, seen.span, seen.disparity.unwrap_or_default(), out);
            }
            Pictured::Error => {
                let truth = seen.truth.unwrap_or_default();
                let colour = |error: f32| colours.of((error / WORST_ERROR).min(1.0));
                dots(size, points, out, |point| {
                    error(truth, size, point).map_or(NO_TRUTH, colour)
                });
            }
            Pictured::Confidence => {
                dots(size, points, out, |point| colours.of(doubt(point.score)));
            }
        }
    }

    /// Appends what the colours of a picture mean, a `foxglove.ImageAnnotations`.
    pub(super) fn legend(
        &mut self,
        codec: &Codec,
        header: &Header,
        pictured: Pictured,
        span: Option<Span>,
        out: &mut Vec<u8>,
    ) {
        let Self {
            colours, labels, ..
        } = self;
        let mut sheet = Sheet::new(header.capture_nanos, out);
        labels.begin(header.size());
        match (pictured, span) {
            (Pictured::Disparity, Some(span)) => {
                disparities(codec, span, colours, labels, &mut sheet);
            }
            (Pictured::Disparity, None) => {}
            (Pictured::Error | Pictured::Confidence, _) => {
                let is_of = match pictured {
                    Pictured::Error => "off",
                    _ => "wrong",
                };
                tell(colours, labels, &mut sheet, |share, text| {
                    write!(text, "{}", pictured.meaning(share))?;
                    match share < 1.0 {
                        true => Ok(()),
                        false => write!(text, " {is_of} or more"),
                    }
                });
            }
        }
        sheet.finish();
    }
}

/// Adds to a legend what the colours of disparities mean: in pixels, and of calibrated cameras in metres.
pub(super) fn disparities(
    codec: &Codec,
    span: Span,
    colours: &Colours,
    labels: &mut Labels,
    sheet: &mut Sheet<'_>,
) {
    let (least, most) = span.ends();
    let camera = codec.rig().calibration.filter(|camera| camera.calibrated);
    tell(colours, labels, sheet, |share, text| {
        let disparity = least + share * (most - least);
        write!(text, "{disparity:.1} px")?;
        match camera.map(|camera| camera.depth_m(disparity.into())) {
            Some(depth) if depth > 0.0 => write!(text, ", {depth:.*} m", decimals(depth)),
            _ => Ok(()),
        }
    });
}

/// Adds a line to a legend for each step of the colours.
fn tell(
    colours: &Colours,
    labels: &mut Labels,
    sheet: &mut Sheet<'_>,
    line: impl Fn(f32, &mut dyn fmt::Write) -> fmt::Result,
) {
    for share in STEPS {
        let line = fmt::from_fn(|f| line(share, f));
        labels.tell(sheet, format_args!("{line}"), opaque(colours.of(share)));
    }
}

/// Decimals that a depth in metres is shown with: three digits that say something.
fn decimals(depth_m: f64) -> usize {
    (2 - depth_m.log10().floor() as i32).clamp(0, 3) as usize
}

/// Paints points on black.
fn dots(size: Size, points: &[Point], out: &mut Vec<u8>, colour: impl Fn(&Point) -> [u8; 3]) {
    let start = out.len();
    out.resize(start + 3 * size.pixels(), 0);
    for point in points {
        if let Some(pixel) = pixel(size, point) {
            let at = start + 3 * pixel;
            out[at..at + 3].copy_from_slice(&colour(point));
        }
    }
}

/// Where a point lies among the pixels of its view.
fn pixel(size: Size, point: &Point) -> Option<usize> {
    let (x, y) = (point.u.round(), point.v.round());
    let is_inside = (0.0..size.width as f32).contains(&x) && (0.0..size.height as f32).contains(&y);
    is_inside.then(|| y as usize * size.width as usize + x as usize)
}

/// How far a point is from the nearest truth of its row, in pixels of disparity.
fn error(truth: &[f32], size: Size, point: &Point) -> Option<f32> {
    let at = pixel(size, point)? as i64;
    let width = i64::from(size.width);
    let (first, last) = (at / width * width, at / width * width + width - 1);
    let near = (at - NEAR).max(first)..=(at + NEAR).min(last);
    let known = near.filter_map(|at| truth.get(at as usize));
    let errors = known.map(|truth| (truth - point.disparity).abs());
    errors
        .filter(|error| error.is_finite())
        .min_by(f32::total_cmp)
}

/// Where the chance that a point of this score is wrong lies among the colours.
fn doubt(score: f32) -> f32 {
    let [least, most] = CHANCES;
    let chance = (1.0 - score).clamp(least, most);
    (chance / least).ln() / (most / least).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(u: f32, v: f32, disparity: f32, score: f32) -> Point {
        Point {
            u,
            v,
            disparity,
            score,
            ..Point::default()
        }
    }

    #[test]
    fn the_error_of_a_point_is_to_the_nearest_truth_of_its_row_and_of_no_other() {
        let size = Size::new(8, 2);
        let mut truth = vec![f32::NAN; 16];
        truth[7] = 4.0;
        truth[8] = 5.0;
        let at = |u, v, disparity| error(&truth, size, &point(u, v, disparity, 1.0));
        assert_eq!(at(5.2, 0.0, 4.5), Some(0.5));
        assert_eq!(at(2.0, 0.6, 4.5), Some(0.5));
        assert_eq!(at(4.4, 0.0, 4.0), None, "too far");
        assert_eq!(at(1.0, 0.0, 5.0), None, "the row below begins there");
        assert_eq!(at(8.0, 0.0, 5.0), None, "outside");
    }

    #[test]
    fn the_surer_a_point_the_bluer_it_is() {
        assert_eq!(doubt(1.0), 0.0);
        assert_eq!(doubt(0.5), 1.0);
        assert!((doubt(0.99) - 0.5).abs() < 1e-3);
    }

    #[test]
    fn points_are_painted_where_they_are_and_nowhere_else() {
        let mut out = vec![7];
        let size = Size::new(3, 2);
        let points = [point(1.4, 0.6, 1.0, 1.0), point(-0.6, 0.0, 1.0, 1.0)];
        dots(size, &points, &mut out, |_| [1, 2, 3]);
        let mut expected = vec![7];
        expected.extend([0; 18]);
        expected[13..16].copy_from_slice(&[1, 2, 3]);
        assert_eq!(out, expected);
    }
}
