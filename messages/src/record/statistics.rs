//! A scan in numbers, to plot.

use serde::{Deserialize, Serialize};

use crate::contrast::Contrast;
use crate::elements::{Edge, Point};
use crate::header::Header;
use crate::payload::AnyView;

use super::Span;

/// Milliseconds a scan took in each stage, all views and channels together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub struct Milliseconds {
    /// To fetch its frames.
    pub capture: f64,
    /// To find its zero-crossings.
    pub filter: f64,
    /// To track its curves.
    pub track: f64,
    /// To make its R-tables.
    pub hough: f64,
    /// To match its curves.
    pub r#match: f64,
    /// To fuse its points with those of the frames before, on a rail.
    #[serde(default)]
    pub map: f64,
    /// To compare its points with the truth.
    #[serde(default)]
    pub evaluate: f64,
}

impl Milliseconds {
    /// Of the stages from images to points and the map, which is all but fetching and judging; 0 of one that is not known.
    pub fn of_the_method(&self) -> [(&'static str, f64); 5] {
        [
            ("filter", self.filter),
            ("track", self.track),
            ("hough", self.hough),
            ("match", self.r#match),
            ("map", self.map),
        ]
    }
}

/// Steps of a [`Histogram`].
const STEPS: usize = 24;

/// How many points of a scan have which disparity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Histogram {
    /// The middle of each step, in pixels, …
    pub disparity: [f64; STEPS],
    /// … and how many points lie in it. Those beyond the first and the last step count there.
    pub points: [u32; STEPS],
}

impl Histogram {
    /// Of these points, in steps that the span is divided into.
    pub fn of(points: &[Point], span: Span) -> Self {
        let (least, most) = span.ends();
        let (least, most) = (f64::from(least), f64::from(most));
        let mut counts = [0; STEPS];
        for point in points {
            let step = (span.share(point.disparity) * STEPS as f32) as usize;
            counts[step.min(STEPS - 1)] += 1;
        }
        Self {
            disparity: std::array::from_fn(|step| {
                let middle = least + (most - least) * (step as f64 + 0.5) / STEPS as f64;
                (middle * 1e3).round() / 1e3
            }),
            points: counts,
        }
    }
}

/// What there is to plot of a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Its number.
    pub scan: u64,
    /// Zero-crossings in all views and channels.
    pub edges: u64,
    /// Curves in all views and channels.
    pub curves: u64,
    /// Points of those curves.
    pub curve_points: u64,
    /// Matched curves in all channels.
    pub matches: u64,
    /// Points of those matches.
    pub match_points: u64,
    /// Points in space.
    pub points: u64,
    /// Share of the reference view's pixels whose disparity is known.
    pub known: f64,
    /// Share of the curves, of all views and channels, that are matched.
    #[serde(default)]
    pub matched: f64,
    /// Mean disparity of the points in space, in pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disparity: Option<f64>,
    /// Gradient magnitude that a quarter of the curve points exceed, in gray levels a pixel, in the finest channel: of the
    /// least contrasty view …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contrast_least: Option<f64>,
    /// … and of the most contrasty one. The same view on a rail, where it tells how the light changes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contrast_most: Option<f64>,
    /// On a rail, points of the map that it settles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settled: Option<u64>,
    /// On a rail, points of the map that are still followed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub growing: Option<u64>,
    /// How the disparities of its points are spread.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub histogram: Option<Histogram>,
    /// Bytes of its messages.
    pub bytes: u64,
    /// What it took.
    pub milliseconds: Milliseconds,
}

impl Statistics {
    /// Compares the views of the finest channel by their curve points.
    pub fn compare(&mut self, views: &[&[Edge]]) {
        let mut contrast = Contrast::default();
        contrast.measure(views.iter().copied());
        let known = contrast.of_views().iter().copied().map(f64::from);
        self.contrast_least = known.clone().min_by(f64::total_cmp);
        self.contrast_most = known.max_by(f64::total_cmp);
    }

    /// Adds a message to the scan's numbers.
    pub fn add(&mut self, header: &Header, view: AnyView<'_>) {
        let milliseconds = header.elapsed_nanos as f64 / 1e6;
        let spent = &mut self.milliseconds;
        match view {
            AnyView::Image(_) | AnyView::Raw(_) | AnyView::Truth(_) => {
                spent.capture += milliseconds;
            }
            AnyView::Map(map) => {
                spent.map += milliseconds;
                self.settled = Some(map.points.len() as u64);
            }
            AnyView::Growing(growing) => {
                spent.map += milliseconds;
                self.growing = Some(growing.points.len() as u64);
            }
            // Only our own stages have a part in these numbers.
            AnyView::Other(_) => {}
            AnyView::Evaluation(_) => spent.evaluate += milliseconds,
            AnyView::Edges(edges) => {
                spent.filter += milliseconds;
                self.edges += edges.edges.len() as u64;
            }
            AnyView::Curves(curves) => {
                spent.track += milliseconds;
                self.curves += curves.curves.len() as u64;
                self.curve_points += curves.points.len() as u64;
            }
            AnyView::Tables(_) => spent.hough += milliseconds,
            AnyView::Matches(matches) => {
                spent.r#match += milliseconds;
                self.matches += matches.matches.len() as u64;
                self.match_points += matches.points.len() as u64;
            }
            AnyView::Disparity(picture) => {
                spent.r#match += milliseconds;
                let known = picture.disparity.iter().filter(|d| d.is_finite()).count();
                self.known = known as f64 / picture.disparity.len().max(1) as f64;
            }
            AnyView::Points(points) => {
                spent.r#match += milliseconds;
                let count = points.points.len();
                let sum: f64 = points.points.iter().map(|p| f64::from(p.disparity)).sum();
                self.points = count as u64;
                self.disparity = (count > 0).then(|| sum / count as f64);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_in_one_step_of_the_histogram_those_beyond_in_the_outermost() {
        let disparities = (0..100).map(|i| 10.0 + i as f32 / 10.0);
        let span = Span::of(disparities.clone()).map(Span::rounded);
        let points: Vec<Point> = disparities
            .chain([2.0, 90.0])
            .map(|disparity| Point {
                disparity,
                ..Point::default()
            })
            .collect();
        let Some(span) = span else {
            panic!("there are disparities")
        };
        let Histogram { disparity, points } = Histogram::of(&points, span);
        assert_eq!(points.iter().sum::<u32>(), 102);
        assert!(points[0] >= 5 && points[STEPS - 1] >= 5, "{points:?}");
        assert!(disparity.is_sorted() && disparity[0] > 9.9, "{disparity:?}");
    }
}
