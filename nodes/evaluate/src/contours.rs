//! Curves and matches against the true contours of a scene that knows them.
//!
//! ```text
//! true contours ─► stretches that count ─┬─► how much of them lies on tracked curves ─► Tracked
//! curves of the reference view ──────────┤     curves whose contour all views see
//! matches ───────────────────────────────┴─► matched curves, points, errors, what is covered ─► Compared
//! ```
//!
//! What is near, [`near`], grows with the channel: the coarser it is, the further zero-crossings lie from where things
//! end, and of two contours closer than that the channel sees one.

use messages::{Contour, ContourKind, CurvesView, MatchesView, Size};

use crate::{Settings, Truths};

/// Contours count from this length on, in pixels: that of the thesis's curves.
pub const LEAST_LENGTH: f32 = 32.0;

/// What share of a curve's points must lie on contours that all views see, so that it could be matched.
pub const SEEN_SHARE: f32 = 0.8;

/// How far a curve may be from the contour that it shows, in pixels: a quarter of the central width of ∇²G, 2√2σ, and no
/// less than one and a half.
pub fn near(variance: f32) -> f32 {
    (2.0 * std::f32::consts::SQRT_2 * variance.sqrt() / 4.0).max(1.5)
}

/// The sine of the angle, 45 degrees, by which directions of a curve and its contour may differ: corners are rounded.
const TURNED: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// What of a view's true contours its curves show, in a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tracked {
    /// Pixels of contours that count, of all kinds.
    pub contours: f32,
    /// Pixels of them that lie on curves.
    pub on_curves: f32,
    /// The same of each kind, in the order of [`ContourKind::ALL`].
    pub kinds: [[f32; 2]; 4],
    /// Curves.
    pub curves: u32,
    /// Those of them whose contour all views see.
    pub seen: u32,
}

/// What was matched in a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Compared {
    /// Curves that were matched.
    pub curves: u32,
    /// Those of them whose contour all views see.
    pub seen: u32,
    /// Matched curves whose disparity is off by over two pixels.
    pub wrong: u32,
    /// Points.
    pub points: u32,
    /// Points that are off by over two pixels.
    pub over_two: u32,
    /// Points that are on no shadow's border.
    pub firm: u32,
    /// Those of them that are off by over one pixel.
    pub firm_over_one: u32,
    /// Pixels of the contours that count which have a point that is right within two pixels.
    pub covered: f32,
}

/// A point of a true contour.
#[derive(Clone, Copy, Debug)]
struct Spot {
    x: f32,
    y: f32,
    /// Direction of its contour, a unit long.
    along: [f32; 2],
    disparity: f32,
    /// Pixels of contour that it stands for.
    weight: f32,
    kind: ContourKind,
    /// Whether all views see it.
    is_seen: bool,
    /// Whether it is of a stretch that is long enough.
    counts: bool,
}

/// Something with a place in the picture and a direction across its contour, in radians.
#[derive(Clone, Copy, Debug)]
struct Across {
    x: f32,
    y: f32,
    orientation: f32,
}

impl Across {
    /// How far it is from a spot of the contour that it may show; `None` where directions differ.
    fn distance(&self, spot: &Spot) -> Option<f32> {
        let (sin, cos) = self.orientation.sin_cos();
        let turned = (cos * spot.along[0] + sin * spot.along[1]).abs();
        (turned <= TURNED).then(|| (self.x - spot.x).hypot(self.y - spot.y))
    }
}

/// The true contours of a view, to compare with.
#[derive(Debug)]
pub struct Contours {
    spots: Vec<Spot>,
    /// Numbers of the spots in each cell, and where each cell's begin.
    cells: Vec<u32>,
    starts: Vec<u32>,
    columns: usize,
    rows: usize,
}

impl Contours {
    /// Pixels along the side of a cell; what is near is less.
    const CELL: f32 = 8.0;

    /// Takes in the contours of a view of this size, of a scene of so many views.
    pub fn new(settings: &Settings, contours: &[Contour], views: usize, size: Size) -> Self {
        let all = (1 << views) - 1;
        let mut spots = Vec::new();
        for contour in contours {
            stretches(settings, contour, all, &mut spots);
        }
        let side = |pixels: u32| (pixels as f32 / Self::CELL).ceil().max(1.0) as usize;
        let (columns, rows) = (side(size.width), side(size.height));
        let mut this = Self {
            spots,
            cells: Vec::new(),
            starts: vec![0; columns * rows + 1],
            columns,
            rows,
        };
        let of: Vec<usize> = this.spots.iter().map(|s| this.cell(s.x, s.y)).collect();
        for &cell in &of {
            this.starts[cell + 1] += 1;
        }
        for cell in 0..columns * rows {
            this.starts[cell + 1] += this.starts[cell];
        }
        let mut order: Vec<u32> = (0..of.len() as u32).collect();
        order.sort_by_key(|&spot| of[spot as usize]);
        this.cells = order;
        this
    }

    fn cell(&self, x: f32, y: f32) -> usize {
        let at = |place: f32, count: usize| ((place / Self::CELL).max(0.0) as usize).min(count - 1);
        at(y, self.rows) * self.columns + at(x, self.columns)
    }

    /// The spots that something near may show, and how far they are.
    fn around(&self, across: Across, near: f32) -> impl Iterator<Item = (usize, f32)> + '_ {
        let cell = self.cell(across.x, across.y);
        let (column, row) = (cell % self.columns, cell / self.columns);
        let rows = row.saturating_sub(1)..(row + 2).min(self.rows);
        let cells = rows.flat_map(move |row| {
            let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
            columns.map(move |column| row * self.columns + column)
        });
        cells
            .flat_map(|cell| {
                &self.cells[self.starts[cell] as usize..self.starts[cell + 1] as usize]
            })
            .filter_map(move |&spot| {
                let away = across.distance(&self.spots[spot as usize])?;
                (away <= near).then_some((spot as usize, away))
            })
    }

    /// The spot that something shows.
    fn nearest(&self, across: Across, near: f32) -> Option<&Spot> {
        let nearest = self
            .around(across, near)
            .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        nearest.map(|(spot, _)| &self.spots[spot])
    }

    /// Whether all views see the contour of each curve.
    fn seen(&self, curves: CurvesView<'_>, near: f32) -> Vec<bool> {
        let is_seen = |curve: &messages::Curve| {
            let points = curve.points(curves.points);
            let on = points.iter().filter(|edge| {
                let spot = self.nearest(across(edge), near);
                spot.is_some_and(|spot| spot.is_seen)
            });
            on.count() as f32 >= SEEN_SHARE * points.len() as f32
        };
        curves.curves.iter().map(is_seen).collect()
    }

    /// What of the contours a channel's curves of this view show.
    pub fn tracked(&self, curves: CurvesView<'_>, variance: f32) -> Tracked {
        let near = near(variance);
        let mut is_on = vec![false; self.spots.len()];
        for edge in curves.points {
            for (spot, _) in self.around(across(edge), near) {
                is_on[spot] = true;
            }
        }
        let mut tracked = Tracked {
            curves: curves.curves.len() as u32,
            seen: self
                .seen(curves, near)
                .iter()
                .map(|&seen| u32::from(seen))
                .sum(),
            ..Tracked::default()
        };
        for (spot, is_on) in self.spots.iter().zip(is_on).filter(|(spot, _)| spot.counts) {
            let on = if is_on { spot.weight } else { 0.0 };
            tracked.contours += spot.weight;
            tracked.on_curves += on;
            let kind = &mut tracked.kinds[spot.kind as usize];
            *kind = [kind[0] + spot.weight, kind[1] + on];
        }
        tracked
    }

    /// Compares what was matched of a channel's curves; `truths` are of the same view, and `reference` is its number.
    pub fn compared(
        &self,
        curves: CurvesView<'_>,
        matches: MatchesView<'_>,
        truths: &Truths<'_>,
        reference: usize,
        variance: f32,
    ) -> Compared {
        let near = near(variance);
        let seen = self.seen(curves, near);
        let mut is_matched = vec![false; seen.len()];
        let mut is_covered = vec![false; self.spots.len()];
        let mut out = Compared::default();
        for found in matches.matches {
            let points = &matches.points[found.first as usize..][..found.count as usize];
            let (mut sum, mut count) = (0.0, 0u32);
            for point in points {
                let across = Across {
                    x: point.x,
                    y: point.y,
                    orientation: curves.points[point.point as usize].orientation,
                };
                let mut best: Option<f32> = None;
                for (spot, _) in self.around(across, near) {
                    let off = point.disparity - self.spots[spot].disparity;
                    is_covered[spot] |= off.abs() <= 2.0;
                    if best.is_none_or(|best| off.abs() < best.abs()) {
                        best = Some(off);
                    }
                }
                let Some(off) = best.or_else(|| truths.off(point.x, point.y, point.disparity))
                else {
                    continue;
                };
                let is_shadow = self
                    .nearest(across, near)
                    .is_some_and(|spot| spot.kind == ContourKind::Shadow);
                out.points += 1;
                out.over_two += u32::from(off.abs() > 2.0);
                out.firm += u32::from(!is_shadow);
                out.firm_over_one += u32::from(!is_shadow && off.abs() > 1.0);
                (sum, count) = (sum + off, count + 1);
            }
            out.wrong += u32::from(count > 0 && (sum / count as f32).abs() > 2.0);
            if let Some(is_matched) = is_matched.get_mut(found.curves[reference] as usize) {
                *is_matched = true;
            }
        }
        for (is_matched, is_seen) in is_matched.into_iter().zip(seen) {
            out.curves += u32::from(is_matched);
            out.seen += u32::from(is_matched && is_seen);
        }
        let covered = self.spots.iter().zip(is_covered);
        let covered = covered.filter(|(spot, is_covered)| spot.counts && *is_covered);
        out.covered = covered.map(|(spot, _)| spot.weight).sum();
        out
    }
}

fn across(edge: &messages::Edge) -> Across {
    Across {
        x: edge.x,
        y: edge.y,
        orientation: edge.orientation,
    }
}

/// Adds a contour's points that have contrast; those of stretches that are long enough count.
fn stretches(settings: &Settings, contour: &Contour, all: u32, spots: &mut Vec<Spot>) {
    let points = &contour.points;
    let Some(last) = points.len().checked_sub(1).filter(|&last| last > 0) else {
        return;
    };
    let is_closed = points[0] == points[last];
    // Round a closed contour, its last point is the first again.
    let count = if is_closed { last } else { last + 1 };
    let has_contrast = |at: usize| points[at].contrast >= settings.contrast;
    // A closed contour begins behind a place without contrast, so that no stretch is cut.
    let start = match is_closed {
        true => (0..count).find(|&at| !has_contrast(at)).unwrap_or(0),
        false => 0,
    };
    let at = |step: usize| match is_closed {
        true => (start + step) % count,
        false => step,
    };
    let away = |a: usize, b: usize| (points[a].x - points[b].x).hypot(points[a].y - points[b].y);
    let steps: Vec<usize> = (0..count).collect();
    for stretch in steps.chunk_by(|&a, &b| has_contrast(at(a)) == has_contrast(at(b))) {
        if !has_contrast(at(stretch[0])) {
            continue;
        }
        // A closed contour all of which has contrast has no ends.
        let is_ring = is_closed && stretch.len() == count;
        let beside = |step: usize, back: bool| {
            let (first, last) = (stretch[0], stretch[stretch.len() - 1]);
            let beside = match (back, is_ring) {
                (true, true) => (step + count - 1) % count,
                (false, true) => (step + 1) % count,
                (true, false) => step.max(first + 1) - 1,
                (false, false) => (step + 1).min(last),
            };
            at(beside)
        };
        let weight = |step: usize| {
            (away(beside(step, true), at(step)) + away(at(step), beside(step, false))) / 2.0
        };
        let length: f32 = stretch.iter().map(|&step| weight(step)).sum();
        for &step in stretch {
            let point = &points[at(step)];
            let [before, after] = [true, false].map(|back| &points[beside(step, back)]);
            let (dx, dy) = (after.x - before.x, after.y - before.y);
            let reach = dx.hypot(dy).max(f32::MIN_POSITIVE);
            spots.push(Spot {
                x: point.x,
                y: point.y,
                along: [dx / reach, dy / reach],
                disparity: point.disparity,
                weight: weight(step),
                kind: contour.kind,
                is_seen: point.seen & all == all,
                counts: length >= LEAST_LENGTH,
            });
        }
    }
}
