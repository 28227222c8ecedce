//! Points against the truth.
//!
//! ```text
//! reference view ─► Canny's edges ─┐
//! truth ───────────────────────────┼─► coverage, errors, mismatches; error over coverage by score
//! points, matches of each channel ─┘
//! ```
//!
//! A point's error is the least difference to the truth of its row within [`NEAR`] columns, since at an occluding
//! contour a zero-crossing may lie on either surface. Along a level contour, columns forgive nothing: what is over a bound
//! there but not within [`LEVEL_ROWS`] rows is counted as forgiven beside it. Coverage is the share of the edge pixels with
//! known truth that have a point within one pixel.
//!
//! Of scenes that know their true contours, [`Contours`] says what curves and matches show of them.

mod canny;
mod contours;
#[cfg(feature = "node")]
pub mod node;

use messages::{EvaluationRoom, MatchesView, NONE, PointsView, Score, Share, Size};

pub use canny::Canny;
pub use contours::{Compared, Contours, LEAST_LENGTH, SEEN_SHARE, Tracked, merged, near};

/// The version of the algorithm: one more whenever the same input and settings give other evaluations.
pub const VERSION: u32 = 1;

/// Columns, and for mismatches rows, within which a truth counts.
pub const NEAR: i32 = 2;

/// Rows within which a truth counts too where a contour is level: within 9° of the row, where edges are found down the
/// column and not along it, so that their rows are no whole numbers.
pub const LEVEL_ROWS: i32 = 3;

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
        /// Gray levels by which the sides of a true contour must differ, without noise and blur, where it counts: of the
        /// thesis's photographs it is what its LOW, 32 of 255, is of the strongest.
        pub contrast: f32 = 16.0, in 0..=255;
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
    /// Of every pixel 1 where an edge is not covered yet.
    bare: Vec<u8>,
    /// The truth, infinite where unknown.
    truth: Vec<f32>,
    points: Vec<Seen>,
    /// Per point its error; infinite where the truth is unknown.
    errors: Vec<f32>,
    sorted: Vec<f32>,
    /// The points by their scores: a key above, the index below.
    order: Vec<u64>,
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
        if !self.begin(known, points) {
            return;
        }
        let score = self.compare(known.size, NONE);
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
            let score = self.compare(known.size, channel);
            out.scores.push(score);
        }
    }

    /// Compares the surest points with the truth, as many as cover a share of the edges: so that results that cover more
    /// and less are compared at the same coverage.
    pub fn surest(&mut self, known: Known<'_>, points: PointsView<'_>, coverage: f32) -> Score {
        if !self.begin(known, points) {
            return Score::default();
        }
        self.bare_all();
        let edges: u32 = self.bare.iter().map(|bare| u32::from(*bare)).sum();
        let wanted = f64::from(coverage) * f64::from(edges);
        self.sort();
        let (mut covered, mut kept) = (0u32, 0);
        while kept < self.order.len() && f64::from(covered) < wanted {
            let index = self.order[kept] as u32 as usize;
            covered += cover(
                &mut self.bare,
                known.size,
                Place::of(&self.points[index], known.size),
            );
            kept += 1;
        }
        let kept = self.order[..kept]
            .iter()
            .map(|&key| self.points[key as u32 as usize]);
        self.points = kept.collect();
        self.compare(known.size, NONE)
    }

    /// Takes in what is known and the points; says whether it fits.
    fn begin(&mut self, known: Known<'_>, points: PointsView<'_>) -> bool {
        let pixels = known.size.pixels();
        if known.pixels.len() != pixels || known.truth.len() != pixels {
            return false;
        }
        self.canny.find(known.pixels, known.size, &mut self.edges);
        self.truth.clear();
        for (edge, &truth) in self.edges.iter_mut().zip(known.truth) {
            // Zero says nothing, as in the files that truth comes from.
            let is_known = truth > 0.0;
            *edge &= is_known;
            self.truth
                .push(if is_known { truth } else { f32::INFINITY });
        }
        self.points.clear();
        self.points.extend(points.points.iter().map(|p| Seen {
            x: p.u,
            y: p.v,
            disparity: p.disparity,
            score: p.score,
        }));
        true
    }

    /// Orders the points, the surest first.
    fn sort(&mut self) {
        self.order.clear();
        let keys = (0..)
            .zip(&self.points)
            .map(|(i, point)| key(point.score, i));
        self.order.extend(keys);
        self.order.sort_unstable();
    }

    /// Compares the points with the truth; their errors are kept.
    fn compare(&mut self, size: Size, channel: u32) -> Score {
        self.errors.clear();
        self.bare_all();
        let mut score = Score {
            channel,
            edges: self.bare.iter().map(|bare| u32::from(*bare)).sum(),
            ..Score::default()
        };
        for point in &self.points {
            let place = Place::of(point, size);
            let off = |rows| error(&self.truth, size, point, place, rows);
            let error = off(0);
            self.errors.push(error);
            score.covered += cover(&mut self.bare, size, place);
            if error.is_finite() {
                score.points += 1;
                // Within more rows it is no greater, which is asked for where it counts.
                let least = match error > 1.0 && is_level(point.y) {
                    true => off(LEVEL_ROWS),
                    false => error,
                };
                let is_forgiven = |most: f32| error > most && least <= most;
                score.over_half += u32::from(error > 0.5);
                score.over_one += u32::from(error > 1.0);
                score.forgiven_one += u32::from(is_forgiven(1.0));
                score.forgiven_two += u32::from(is_forgiven(2.0));
                if error > 2.0 {
                    score.over_two += 1;
                    score.mismatches += u32::from(is_mismatch(&self.truth, size, point, place));
                }
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

    /// Nothing is covered.
    fn bare_all(&mut self) {
        self.bare.clear();
        self.bare
            .extend(self.edges.iter().map(|edge| u8::from(*edge)));
    }

    /// The error of the surest points over what they cover.
    fn trace(&mut self, size: Size, edges: u32, out: &mut EvaluationRoom<'_>) {
        self.bare_all();
        self.sort();
        let (mut covered, mut known, mut bad) = (0u32, 0u32, 0u32);
        let mut next = 0;
        for step in 1..=SHARES {
            let share = step as f64 / SHARES as f64;
            let end = (self.points.len() as f64 * share).round_ties_even() as usize;
            for &key in &self.order[next..end] {
                let index = key as u32 as usize;
                let error = self.errors[index];
                covered += cover(&mut self.bare, size, Place::of(&self.points[index], size));
                known += u32::from(error.is_finite());
                bad += u32::from(error.is_finite() && error > 1.0);
            }
            next = end;
            let last = end
                .checked_sub(1)
                .map(|last| self.order[last] as u32 as usize);
            let least = last.map(|last| self.points[last].score);
            out.curve.push(Share {
                share: share as f32,
                score: least.unwrap_or_default(),
                coverage: (f64::from(covered) / f64::from(edges.max(1))) as f32,
                bad_one: (f64::from(bad) / f64::from(known.max(1))) as f32,
            });
        }
    }
}

/// A key that sorts the greatest score first, of equal ones the first.
fn key(score: f32, index: u32) -> u64 {
    // Floats sort like their bits, once those of negative ones are turned around.
    let bits = score.to_bits();
    let rising = if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    };
    u64::from(!rising) << 32 | u64::from(index)
}

/// The pixel of a point.
#[derive(Clone, Copy, Debug)]
struct Place {
    x: i32,
    y: i32,
}

impl Place {
    /// Inside the picture.
    fn of(point: &Seen, size: Size) -> Self {
        let within = |place: f32, len: u32| nearest_even(place).clamp(0, len as i32 - 1);
        Self {
            x: within(point.x, size.width),
            y: within(point.y, size.height),
        }
    }

    /// So far from the sides that columns near it are inside.
    fn inside(self, size: Size) -> Self {
        let most = (size.width as i32 - 1 - NEAR).max(0);
        Self {
            x: self.x.clamp(NEAR.min(most), most),
            ..self
        }
    }
}

/// Rounds to whole numbers, halves to even ones.
fn nearest_even(place: f32) -> i32 {
    // Beyond this floats of single precision are whole: adding it rounds as arithmetic does.
    const WHOLE: f32 = 12_582_912.0;
    (place.clamp(-4e6, 4e6) + WHOLE - WHOLE) as i32
}

/// How far a disparity is from the nearest truth of its row, or of so many rows above and below too; infinite when none is
/// known there.
fn error(truth: &[f32], size: Size, point: &Seen, place: Place, rows: i32) -> f32 {
    let Place { x, y } = place.inside(size);
    let rows = (y - rows).max(0)..=(y + rows).min(size.height as i32 - 1);
    let errors = rows.map(|row| nearest(truth, size, point.disparity, x, row));
    errors.fold(f32::INFINITY, f32::min)
}

/// Whether a contour is level at a point of this row: edges along rows have whole rows, and where contours are within 9°
/// of the row they are found down the columns instead.
fn is_level(row: f32) -> bool {
    row.fract() != 0.0
}

/// The true disparities of a view.
#[derive(Clone, Copy, Debug)]
pub struct Truths<'a> {
    /// Row by row; NaN where unknown.
    pub disparity: &'a [f32],
    /// Size of the view.
    pub size: Size,
}

impl Truths<'_> {
    /// By how much a disparity exceeds the nearest truth around its place, rows forgiven as columns are where the contour
    /// is level; `None` where it is unknown.
    pub fn off(&self, x: f32, y: f32, disparity: f32) -> Option<f32> {
        let point = Seen {
            x,
            y,
            disparity,
            score: 0.0,
        };
        let place = Place::of(&point, self.size).inside(self.size);
        let reach = if is_level(y) { LEVEL_ROWS } else { 0 };
        let (width, height) = (self.size.width as i32, self.size.height as i32);
        let rows = (place.y - reach).max(0)..=(place.y + reach).min(height - 1);
        let columns = (place.x - NEAR).max(0)..=(place.x + NEAR).min(width - 1);
        let near = rows.flat_map(|row| columns.clone().map(move |column| (row, column)));
        let truths = near.map(|(row, column)| self.disparity[(row * width + column) as usize]);
        let offs = truths
            .filter(|truth| *truth > 0.0)
            .map(|truth| disparity - truth);
        offs.min_by(|a, b| a.abs().total_cmp(&b.abs()))
    }
}

fn nearest(truth: &[f32], size: Size, disparity: f32, x: i32, y: i32) -> f32 {
    let start = y as usize * size.width as usize;
    let first = (x - NEAR).max(0) as usize;
    let last = (x + NEAR).min(size.width as i32 - 1) as usize;
    let row = &truth[start + first..=start + last];
    let differences = row.iter().map(|truth| (disparity - truth).abs());
    differences.fold(f32::INFINITY, f32::min)
}

/// Whether a disparity is far from every truth around its place.
fn is_mismatch(truth: &[f32], size: Size, point: &Seen, place: Place) -> bool {
    let Place { x, y } = place.inside(size);
    let rows = (y - NEAR).max(0)..=(y + NEAR).min(size.height as i32 - 1);
    rows.into_iter()
        .all(|row| nearest(truth, size, point.disparity, x, row) > 2.0)
}

/// Covers the pixels around a place; gives how many edge pixels were not covered before.
fn cover(bare: &mut [u8], size: Size, place: Place) -> u32 {
    let Place { x, y } = place;
    let mut more = 0;
    for row in (y - 1).max(0)..=(y + 1).min(size.height as i32 - 1) {
        let start = row as usize * size.width as usize;
        let first = (x - 1).max(0) as usize;
        let last = (x + 1).min(size.width as i32 - 1) as usize;
        for bare in &mut bare[start + first..=start + last] {
            more += u32::from(*bare);
            *bare = 0;
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
