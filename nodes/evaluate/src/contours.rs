//! Curves and matches against the true contours of a scene that knows them.
//!
//! ```text
//! true contours ─► stretches that count ─┬─► how much of them lies on tracked curves ─► Tracked
//! curves of the reference view ──────────┤     curves whose contour all views see
//! matches ───────────────────────────────┴─► matched curves, points, errors, what is covered ─► Compared
//! ```
//!
//! What is near, [`near`], grows with the channel: the coarser it is, the further zero-crossings lie from where things
//! end. Of two contours side by side and closer than 2σ a channel has one zero-crossing: the one of less contrast does not
//! count there.

use messages::{Contour, ContourKind, ContourPoint, CurvesView, MatchesView, NONE, Size};

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

/// How close to a stronger contour, in pixels, a channel shows none: two steps have one zero-crossing as long as they are
/// less than 2σ apart.
pub fn merged(variance: f32) -> f32 {
    2.0 * variance.sqrt()
}

/// The sine of the angle, 45 degrees, by which directions of a curve and its contour may differ: corners are rounded.
const TURNED: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// What of a view's true contours its curves show, in a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tracked {
    /// Pixels of contours that count, of all kinds.
    pub contours: f32,
    /// Pixels of contours that have contrast and do not count: too short, or beside a stronger one.
    pub left_out: f32,
    /// Pixels of those that count which lie on curves.
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
    /// Mean contrast of the contour around it.
    strength: f32,
    /// Pixels of contour that it stands for.
    weight: f32,
    kind: ContourKind,
    /// Whether all views see it.
    is_seen: bool,
    /// Whether it is of a stretch that is long enough, and beside no stronger one.
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

/// The true contours of a view as a channel can show them, to compare with.
#[derive(Debug)]
pub struct Contours {
    /// Those that have contrast.
    spots: Vec<Spot>,
    /// Numbers of the spots in each cell, and where each cell's begin.
    cells: Vec<u32>,
    starts: Vec<u32>,
    columns: usize,
    rows: usize,
    near: f32,
}

impl Contours {
    /// Pixels along the side of a cell; what is looked for is nearer.
    const CELL: f32 = 16.0;

    /// Takes in the contours of a view of this size, of a scene of so many views, for a channel of this σ².
    pub fn new(
        settings: &Settings,
        contours: &[Contour],
        (views, size): (usize, Size),
        variance: f32,
    ) -> Self {
        let all = (1 << views) - 1;
        let mut spots = Vec::new();
        for contour in contours {
            let has_contrast = |at: usize| contour.points[at].contrast >= settings.contrast;
            let course = Course::of(&contour.points, |_| false);
            for (step, &at) in course.order.iter().enumerate() {
                let point = &contour.points[at];
                if has_contrast(at) {
                    spots.push(Spot {
                        x: point.x,
                        y: point.y,
                        along: course.along(step),
                        disparity: point.disparity,
                        strength: course.strength(step),
                        weight: course.weight(step),
                        kind: contour.kind,
                        is_seen: point.seen & all == all,
                        counts: false,
                    });
                }
            }
        }
        let mut this = Self::sorted(spots, size, near(variance));
        this.count(settings, contours, merged(variance));
        this
    }

    fn sorted(spots: Vec<Spot>, size: Size, near: f32) -> Self {
        let side = |pixels: u32| (pixels as f32 / Self::CELL).ceil().max(1.0) as usize;
        let (columns, rows) = (side(size.width), side(size.height));
        let mut this = Self {
            spots,
            cells: Vec::new(),
            starts: vec![0; columns * rows + 1],
            columns,
            rows,
            near,
        };
        let of: Vec<usize> = this.spots.iter().map(|s| this.cell(s.x, s.y)).collect();
        for &cell in &of {
            this.starts[cell + 1] += 1;
        }
        for cell in 0..columns * rows {
            this.starts[cell + 1] += this.starts[cell];
        }
        this.cells = (0..of.len() as u32).collect();
        this.cells.sort_by_key(|&spot| of[spot as usize]);
        this
    }

    /// Says which spots count: those of stretches, long enough, of spots beside which no stronger one lies.
    fn count(&mut self, settings: &Settings, contours: &[Contour], merged: f32) {
        let is_masked = |number: usize| {
            let own = &self.spots[number];
            let across = Across {
                x: own.x,
                y: own.y,
                orientation: own.along[0].atan2(-own.along[1]),
            };
            self.around(across, merged).any(|(other, _)| {
                let there = &self.spots[other];
                let side = [there.x - own.x, there.y - own.y];
                // What lies ahead is the contour itself, or one that goes on from it.
                let ahead = side[0] * own.along[0] + side[1] * own.along[1];
                let beside = side[1] * own.along[0] - side[0] * own.along[1];
                there.strength > own.strength && beside.abs() > ahead.abs() && beside.abs() > 1.0
            })
        };
        let is_masked: Vec<bool> = (0..self.spots.len()).map(is_masked).collect();
        let mut next = 0;
        for contour in contours {
            // Numbers of the spots, in the order of the points.
            let whole = Course::of(&contour.points, |_| false);
            let mut spots = vec![None; contour.points.len()];
            for &at in &whole.order {
                if contour.points[at].contrast >= settings.contrast {
                    spots[at] = Some(next).filter(|&spot| !is_masked[spot]);
                    next += 1;
                }
            }
            let course = Course::of(&contour.points, |at| spots[at].is_none());
            let free: Vec<Option<usize>> = course.order.iter().map(|&at| spots[at]).collect();
            for stretch in free.split(Option::is_none) {
                let stretch = stretch.iter().flatten();
                let length: f32 = stretch.clone().map(|&spot| self.spots[spot].weight).sum();
                for &spot in stretch {
                    self.spots[spot].counts = length >= LEAST_LENGTH;
                }
            }
        }
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
    fn nearest(&self, across: Across) -> Option<&Spot> {
        let nearest = self
            .around(across, self.near)
            .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        nearest.map(|(spot, _)| &self.spots[spot])
    }

    /// Whether all views see the contour of each curve.
    fn seen(&self, curves: CurvesView<'_>) -> Vec<bool> {
        let is_seen = |curve: &messages::Curve| {
            let points = curve.points(curves.points);
            let on = points.iter().filter(|edge| {
                let spot = self.nearest(across(edge));
                spot.is_some_and(|spot| spot.is_seen)
            });
            on.count() as f32 >= SEEN_SHARE * points.len() as f32
        };
        curves.curves.iter().map(is_seen).collect()
    }

    /// What of the contours the channel's curves of this view show.
    pub fn tracked(&self, curves: CurvesView<'_>) -> Tracked {
        let mut is_on = vec![false; self.spots.len()];
        for edge in curves.points {
            for (spot, _) in self.around(across(edge), self.near) {
                is_on[spot] = true;
            }
        }
        let mut tracked = Tracked {
            curves: curves.curves.len() as u32,
            seen: self.seen(curves).iter().map(|&seen| u32::from(seen)).sum(),
            ..Tracked::default()
        };
        for (spot, is_on) in self.spots.iter().zip(is_on) {
            if !spot.counts {
                tracked.left_out += spot.weight;
                continue;
            }
            let on = if is_on { spot.weight } else { 0.0 };
            tracked.contours += spot.weight;
            tracked.on_curves += on;
            let kind = &mut tracked.kinds[spot.kind as usize];
            *kind = [kind[0] + spot.weight, kind[1] + on];
        }
        tracked
    }

    /// Compares what was matched of the channel's curves; `truths` are of the same view, and `reference` is its number.
    pub fn compared(
        &self,
        curves: CurvesView<'_>,
        matches: MatchesView<'_>,
        truths: &Truths<'_>,
        reference: usize,
    ) -> Compared {
        let seen = self.seen(curves);
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
                for (spot, _) in self.around(across, self.near) {
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
                    .nearest(across)
                    .is_some_and(|spot| spot.kind == ContourKind::Shadow);
                out.points += 1;
                out.over_two += u32::from(off.abs() > 2.0);
                out.firm += u32::from(!is_shadow);
                out.firm_over_one += u32::from(!is_shadow && off.abs() > 1.0);
                (sum, count) = (sum + off, count + 1);
            }
            out.wrong += u32::from(count > 0 && (sum / count as f32).abs() > 2.0);
            let label = found.curves.get(reference).copied().unwrap_or(NONE);
            if let Some(is_matched) = is_matched.get_mut(label as usize) {
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

/// A contour's points in order, gone round from behind a point that is left out if it is closed.
struct Course<'a> {
    points: &'a [ContourPoint],
    /// Which of them, in order.
    order: Vec<usize>,
    is_closed: bool,
}

impl<'a> Course<'a> {
    fn of(points: &'a [ContourPoint], is_left_out: impl Fn(usize) -> bool) -> Self {
        let last = points.len().saturating_sub(1);
        // The last point of a closed contour is the first again.
        let is_closed = last > 0 && points[0] == points[last];
        let count = if is_closed { last } else { points.len() };
        let start = match is_closed {
            true => (0..count).find(|&at| is_left_out(at)).unwrap_or(0),
            false => 0,
        };
        Self {
            points,
            order: (start..count).chain(0..start).collect(),
            is_closed,
        }
    }

    /// What lies before and after a step of the order, on the contour.
    fn beside(&self, step: usize) -> [usize; 2] {
        let count = self.order.len();
        let [before, after] = match self.is_closed {
            true => [(step + count - 1) % count, (step + 1) % count],
            false => [step.saturating_sub(1), (step + 1).min(count - 1)],
        };
        [self.order[before], self.order[after]]
    }

    fn distance(&self, a: usize, b: usize) -> f32 {
        let [a, b] = [a, b].map(|at| &self.points[at]);
        (a.x - b.x).hypot(a.y - b.y)
    }

    /// The mean contrast of as many points before as after a step, so that of two contours one is the stronger for a
    /// while.
    fn strength(&self, step: usize) -> f32 {
        const REACH: usize = 8;
        let count = self.order.len();
        let (from, to) = match self.is_closed {
            true => {
                let reach = REACH.min((count - 1) / 2);
                (step + count - reach, step + count + reach)
            }
            false => {
                let reach = REACH.min(step).min(count - 1 - step);
                (step - reach, step + reach)
            }
        };
        let around = (from..=to).map(|step| self.points[self.order[step % count]].contrast);
        around.sum::<f32>() / (to - from + 1) as f32
    }

    /// Half the way to the point before, and half that to the point after.
    fn weight(&self, step: usize) -> f32 {
        let ways = self
            .beside(step)
            .map(|at| self.distance(at, self.order[step]));
        (ways[0] + ways[1]) / 2.0
    }

    /// The direction at a step, a unit long.
    fn along(&self, step: usize) -> [f32; 2] {
        let [before, after] = self.beside(step).map(|at| &self.points[at]);
        let (dx, dy) = (after.x - before.x, after.y - before.y);
        let length = dx.hypot(dy).max(f32::MIN_POSITIVE);
        [dx / length, dy / length]
    }
}
