//! Points against the truth.
//!
//! ```text
//! reference view ─► Canny's edges ─┐
//! truth ───────────────────────────┼─► coverage, errors, mismatches; error over coverage by score
//! points, matches of each channel ─┘
//! ```
//!
//! A point's error is the least difference to the truth of its row within [`NEAR`] columns, since at an occluding
//! contour a zero-crossing may lie on either surface. Coverage is the share of the edge pixels with known truth that have
//! a point within one pixel.

mod canny;
#[cfg(feature = "node")]
pub mod node;

use messages::{EvaluationRoom, MatchesView, NONE, PointsView, Score, Share, Size};

pub use canny::Canny;

/// Columns, and for mismatches rows, within which a truth counts.
pub const NEAR: i64 = 2;

/// Points of the curve of error over coverage.
pub const SHARES: usize = 20;

messages::settings! {
    /// How points are compared with the truth.
    pub struct Settings {
        /// The view the points and the truth refer to, counted from 0; set to the one `match.reference` names.
        pub view: u32 = 0, in 0..=1000000;
        /// Gradient of the edges that are to be covered where they are weak, in Sobel's units.
        pub low: f32 = 40.0, in 0..=1000;
        /// Gradient that an edge must reach somewhere.
        pub high: f32 = 100.0, in 0..=1000;
    }
}

/// A point, as far as it is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    x: f32,
    y: f32,
    disparity: f32,
    score: f32,
}

/// What a scan is compared with.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// The reference view, row by row.
    pub pixels: &'a [u8],
    /// Its true disparities between neighbouring views; NaN where unknown.
    pub truth: &'a [f32],
    /// Size of both.
    pub size: Size,
}

/// Compares scans with the truth; keeps its memory from scan to scan.
#[derive(Debug, Default)]
pub struct Evaluator {
    canny: Canny,
    /// Of every pixel whether it is an edge with known truth.
    edges: Vec<bool>,
    /// Of every pixel whether a point covers it.
    covered: Vec<bool>,
    points: Vec<Seen>,
    /// Per point its error; infinite where the truth is unknown.
    errors: Vec<f32>,
    sorted: Vec<f32>,
    order: Vec<u32>,
}

impl Evaluator {
    /// An evaluator with these settings.
    pub fn new(settings: &Settings) -> Self {
        Self {
            canny: Canny::new(settings.low, settings.high),
            ..Self::default()
        }
    }

    /// Compares the result of a scan, and what each channel matched, with the truth. Nothing is written where sizes do
    /// not fit.
    pub fn process(
        &mut self,
        known: Known<'_>,
        points: PointsView<'_>,
        matches: &[MatchesView<'_>],
        out: &mut EvaluationRoom<'_>,
    ) {
        out.scores.clear();
        out.curve.clear();
        let pixels = known.size.pixels();
        if known.pixels.len() != pixels || known.truth.len() != pixels {
            return;
        }
        self.canny.find(known.pixels, known.size, &mut self.edges);
        for (edge, truth) in self.edges.iter_mut().zip(known.truth) {
            *edge &= is_known(*truth);
        }
        self.points.clear();
        self.points.extend(points.points.iter().map(|p| Seen {
            x: p.u,
            y: p.v,
            disparity: p.disparity,
            score: p.score,
        }));
        let score = self.compare(known, NONE);
        out.scores.push(score);
        self.trace(known.size, score.edges, out);
        for (channel, matches) in (0..).zip(matches) {
            self.points.clear();
            self.points.extend(matches.points.iter().map(|p| Seen {
                x: p.x,
                y: p.y,
                disparity: p.disparity,
                score: p.score,
            }));
            let score = self.compare(known, channel);
            out.scores.push(score);
        }
    }

    /// Compares the points with the truth; their errors are kept.
    fn compare(&mut self, known: Known<'_>, channel: u32) -> Score {
        let (truth, size) = (known.truth, known.size);
        self.errors.clear();
        self.covered.clear();
        self.covered.resize(size.pixels(), false);
        let mut score = Score {
            channel,
            edges: self.edges.iter().filter(|edge| **edge).count() as u32,
            ..Score::default()
        };
        for point in &self.points {
            let error = error(truth, size, point);
            self.errors.push(error);
            score.covered += cover(&mut self.covered, &self.edges, size, point);
            if error.is_finite() {
                score.points += 1;
                score.over_half += u32::from(error > 0.5);
                score.over_one += u32::from(error > 1.0);
                score.over_two += u32::from(error > 2.0);
                score.mismatches += u32::from(error > 2.0 && is_mismatch(truth, size, point));
            }
        }
        let share = |count: u32| (f64::from(count) / f64::from(score.points.max(1))) as f32;
        score.coverage = (f64::from(score.covered) / f64::from(score.edges.max(1))) as f32;
        score.bad_half = share(score.over_half);
        score.bad_one = share(score.over_one);
        score.bad_two = share(score.over_two);
        self.sorted.clear();
        self.sorted
            .extend(self.errors.iter().filter(|error| error.is_finite()));
        score.median = median(&mut self.sorted);
        score
    }

    /// The error of the surest points over what they cover.
    fn trace(&mut self, size: Size, edges: u32, out: &mut EvaluationRoom<'_>) {
        let scores = |&i: &u32| self.points[i as usize].score;
        self.order.clear();
        self.order.extend(0..self.points.len() as u32);
        self.order.sort_by(|a, b| scores(b).total_cmp(&scores(a)));
        self.covered.fill(false);
        let (mut covered, mut known, mut bad) = (0u32, 0u32, 0u32);
        let mut next = 0;
        for step in 1..=SHARES {
            let share = step as f64 / SHARES as f64;
            let end = (self.points.len() as f64 * share).round_ties_even() as usize;
            for &index in &self.order[next..end] {
                let (point, error) = (&self.points[index as usize], self.errors[index as usize]);
                covered += cover(&mut self.covered, &self.edges, size, point);
                known += u32::from(error.is_finite());
                bad += u32::from(error.is_finite() && error > 1.0);
            }
            next = end;
            let least = end.checked_sub(1).map(|last| scores(&self.order[last]));
            out.curve.push(Share {
                share: share as f32,
                score: least.unwrap_or_default(),
                coverage: (f64::from(covered) / f64::from(edges.max(1))) as f32,
                bad_one: (f64::from(bad) / f64::from(known.max(1))) as f32,
            });
        }
    }
}

/// Zero says nothing, as in the files that truth comes from.
fn is_known(truth: f32) -> bool {
    truth > 0.0
}

/// A coordinate's pixel, inside the picture and `margin` away from its sides.
fn pixel(place: f32, len: u32, margin: i64) -> i64 {
    let most = (i64::from(len) - 1 - margin).max(0);
    (place.round_ties_even() as i64).clamp(margin.min(most), most)
}

/// How far a disparity is from the nearest truth of its row; infinite when none is known there.
fn error(truth: &[f32], size: Size, point: &Seen) -> f32 {
    let (x, y) = (
        pixel(point.x, size.width, NEAR),
        pixel(point.y, size.height, 0),
    );
    nearest(truth, size, point.disparity, x, y)
}

fn nearest(truth: &[f32], size: Size, disparity: f32, x: i64, y: i64) -> f32 {
    let columns = (x - NEAR).max(0)..=(x + NEAR).min(i64::from(size.width) - 1);
    let start = y as usize * size.width as usize;
    let row = &truth[start + *columns.start() as usize..=start + *columns.end() as usize];
    let known = row.iter().filter(|truth| is_known(**truth));
    known.fold(f32::INFINITY, |least, truth| {
        least.min((disparity - truth).abs())
    })
}

/// Whether a disparity is far from every truth around its place.
fn is_mismatch(truth: &[f32], size: Size, point: &Seen) -> bool {
    let (x, y) = (
        pixel(point.x, size.width, NEAR),
        pixel(point.y, size.height, 0),
    );
    let rows = (y - NEAR).max(0)..=(y + NEAR).min(i64::from(size.height) - 1);
    rows.into_iter()
        .all(|row| nearest(truth, size, point.disparity, x, row) > 2.0)
}

/// Covers the pixels around a point; gives how many edge pixels were not covered before.
fn cover(covered: &mut [bool], edges: &[bool], size: Size, point: &Seen) -> u32 {
    let (x, y) = (
        pixel(point.x, size.width, 0),
        pixel(point.y, size.height, 0),
    );
    let mut more = 0;
    for row in (y - 1).max(0)..=(y + 1).min(i64::from(size.height) - 1) {
        for column in (x - 1).max(0)..=(x + 1).min(i64::from(size.width) - 1) {
            let place = row as usize * size.width as usize + column as usize;
            more += u32::from(edges[place] && !covered[place]);
            covered[place] = true;
        }
    }
    more
}

/// The median; of an even number the mean of the two in the middle.
fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    let is_even = values.len().is_multiple_of(2);
    let (below, upper, _) = values.select_nth_unstable_by(middle, f32::total_cmp);
    match is_even {
        true => {
            let lower = below.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            ((f64::from(lower) + f64::from(*upper)) / 2.0) as f32
        }
        false => *upper,
    }
}
