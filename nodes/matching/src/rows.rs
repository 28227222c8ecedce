//! A view's curve points by image row: what every search along an epipolar line walks.

use messages::{Edge, NONE, Size, Sway};
use wide::{f32x4, f32x8, i16x8, i32x8, u8x16};

use crate::{ChannelView, Range};

/// A curve point as the search along its row sees it: all that is compared, side by side in memory.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spot {
    /// Column, sub-pixel.
    pub(crate) x: f32,
    /// Direction of the gradient in radians.
    pub(crate) orientation: f32,
    /// Magnitude of the gradient, as if all views were equally contrasty.
    pub(crate) magnitude: f32,
    /// Gray levels beside the point, in its row, whatever gain, offset or gamma the view has: from their mean, which is at
    /// 128, in sixteenths of three times the magnitude.
    pub(crate) profile: [u8; 8],
    /// The gray levels themselves, which compare within one view only …
    pub(crate) levels: [u8; 8],
    /// … and how many of those sixteenths one of them is.
    pub(crate) sixteenths: f32,
    /// Index among the view's curve points.
    pub(crate) point: u32,
    /// Label of its curve.
    pub(crate) curve: u32,
}

/// Columns a cell of the index measures.
const CELL: usize = 8;

/// The points that were found along rows, row by row, left to right.
///
/// A point between two rows has no exact column, so it is not searched for; its disparity is filled in along its
/// curve.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    /// Row by row, left to right.
    pub(crate) spots: Vec<Spot>,
    /// What most spots are told from each other by, their columns and orientations, with room for [`LANES`] more.
    columns: Vec<f32>,
    orientations: Vec<f32>,
    /// Where each row starts, and where the last ends.
    starts: Vec<u32>,
    /// Per row and cell of [`CELL`] columns the first spot at or behind the cell's start.
    cells: Vec<u32>,
    /// Cells in a row.
    per_row: usize,
    /// The curve each point belongs to.
    pub(crate) curve_of: Vec<u32>,
    /// Whether each point was found along a row.
    in_row: Vec<bool>,
}

impl Rows {
    /// Takes in the points of a view whose picture lies `lower` rows lower than the reference view's and is off by so much
    /// beside it, so that rows and columns are those of the reference view. `gain` is what makes it as contrasty as the
    /// other views.
    pub(crate) fn fill(
        &mut self,
        view: &ChannelView<'_>,
        size: Size,
        lower: f32,
        sway: &Sway,
        gain: f32,
    ) {
        let points = view.curves.points;
        self.curve_of.clear();
        self.curve_of.resize(points.len(), NONE);
        for (label, curve) in (0..).zip(view.curves.curves) {
            self.curve_of[curve.range()].fill(label);
        }
        // In the points' own order, which is memory's: what lies far apart in a row's order is near by then.
        self.in_row.clear();
        self.in_row.extend(points.iter().map(is_in_row));
        self.spots.clear();
        self.starts.clear();
        self.starts.push(0);
        self.cells.clear();
        self.per_row = size.width as usize / CELL + 1;
        let (whole, rest) = (lower.round(), lower - lower.round());
        let own_rows = view.tables.rows;
        for row in 0..own_rows.len().saturating_sub(1) as i64 {
            // Counted cell by cell, which needs no guess where one ends.
            let cells = self.cells.len();
            self.cells.resize(cells + self.per_row + 1, 0);
            let first = self.spots.len();
            let own = usize::try_from(row + whole as i64).ok();
            if !sway.is_none() {
                self.put_right(view, size, (row, lower), sway, gain);
            } else if let Some(ends) = own.and_then(|own| own_rows.get(own..own + 2)) {
                for &point in &view.tables.order[ends[0] as usize..ends[1] as usize] {
                    if self.in_row[point as usize] {
                        let edge = &points[point as usize];
                        let spot = Spot::new(edge, point, self.curve_of[point as usize], gain);
                        self.spots.push(spot.lifted(rest));
                    }
                }
            }
            let spots = &mut self.spots[first..];
            if rest != 0.0 || !sway.is_none() {
                spots.sort_by(|a, b| a.x.total_cmp(&b.x));
            }
            let cells = &mut self.cells[cells..];
            cells[0] = first as u32;
            for spot in spots {
                cells[(spot.x as usize / CELL).min(self.per_row - 1) + 1] += 1;
            }
            let mut start = 0;
            for cell in cells.iter_mut() {
                start += *cell;
                *cell = start;
            }
            self.cells.pop();
            self.starts.push(self.spots.len() as u32);
        }
        self.line_up();
    }

    /// Puts what is compared first side by side.
    fn line_up(&mut self) {
        let room = [0.0; LANES];
        self.columns.clear();
        self.columns.extend(self.spots.iter().map(|spot| spot.x));
        self.columns.extend(room);
        self.orientations.clear();
        let orientations = self.spots.iter().map(|spot| spot.orientation);
        self.orientations.extend(orientations);
        self.orientations.extend(room);
    }

    /// Adds the points that a row of the reference view shows of a view that is off: of every contour the one nearest to
    /// where the row is seen there, moved along it.
    fn put_right(
        &mut self,
        view: &ChannelView<'_>,
        size: Size,
        (row, lower): (i64, f32),
        sway: &Sway,
        gain: f32,
    ) {
        // Where the row is seen at a column.
        let seen_at =
            |column: f64| row as f64 + f64::from(lower) + sway.off(size, column, row as f64)[1];
        let ends = [0.0, f64::from(size.width)].map(seen_at);
        let (least, most) = (ends[0].min(ends[1]).round(), ends[0].max(ends[1]).round());
        for own in least as i64..=most as i64 {
            let own_rows = usize::try_from(own).ok();
            let Some(ends) = own_rows.and_then(|own| view.tables.rows.get(own..own + 2)) else {
                continue;
            };
            for &point in &view.tables.order[ends[0] as usize..ends[1] as usize] {
                if !self.in_row[point as usize] {
                    continue;
                }
                let edge = &view.curves.points[point as usize];
                let rest = seen_at(edge.x.into()) - own as f64;
                // Half a row belongs to one side only.
                if !(-0.5..0.5).contains(&rest) {
                    continue;
                }
                let right = sway.off(size, edge.x.into(), own as f64)[0];
                let mut spot = Spot::new(edge, point, self.curve_of[point as usize], gain);
                spot.x -= right as f32;
                self.spots.push(spot.lifted(rest as f32));
            }
        }
    }

    /// Number of rows.
    pub(crate) fn count(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The indices of a row's spots; none outside the image.
    pub(crate) fn row(&self, row: usize) -> std::ops::Range<usize> {
        match self.starts.get(row..row + 2) {
            Some(ends) => ends[0] as usize..ends[1] as usize,
            None => 0..0,
        }
    }

    /// Of the row's spots from column `least` on, up to column `most`, those whose orientations differ by no more than the
    /// tolerance, with their indices.
    pub(crate) fn facing(
        &self,
        row: usize,
        [least, most]: [f32; 2],
        (orientation, tolerance): (f32, f32),
    ) -> impl Iterator<Item = (usize, &Spot)> {
        let facing = Facing {
            rows: self,
            from: self.first_near(row, least),
            end: self.row(row).end,
            columns: [least, most].map(f32x4::splat),
            most,
            orientation: f32x4::splat(orientation),
            tolerance: f32x4::splat(tolerance),
            found: 0,
        };
        facing.map(|at| (at, &self.spots[at]))
    }

    /// The spots at which a point at column `x` of the reference view may be, its disparity being in the range and this
    /// view so many baselines `to` its right.
    pub(crate) fn within(
        &self,
        row: usize,
        x: f32,
        to: f32,
        range: Range,
    ) -> impl Iterator<Item = (usize, &Spot)> {
        let [least, most] = range.columns(x, to);
        self.between(row, least, most)
    }

    /// The row's spots from column `least` on, up to column `most`, with their indices.
    pub(crate) fn between(
        &self,
        row: usize,
        least: f32,
        most: f32,
    ) -> impl Iterator<Item = (usize, &Spot)> {
        let (start, end) = (self.first_near(row, least), self.row(row).end);
        let spots = self.spots[start..end]
            .iter()
            .enumerate()
            .map(move |(i, spot)| (start + i, spot));
        spots
            .skip_while(move |(_, spot)| spot.x < least)
            .take_while(move |(_, spot)| spot.x <= most)
    }

    /// A spot of the row shortly before the first one at or behind a column.
    fn first_near(&self, row: usize, column: f32) -> usize {
        // A negative column becomes the first cell, one beyond the image the last.
        let cell = (column as usize / CELL).min(self.per_row.saturating_sub(1));
        let start = self.cells.get(row * self.per_row + cell);
        start.map_or(self.row(row).end, |&start| start as usize)
    }
}

/// Spots that are looked at in one go.
const LANES: usize = 4;

/// A walk along a row that stops at spots of one orientation only.
struct Facing<'a> {
    rows: &'a Rows,
    /// The first of the spots that are looked at next.
    from: usize,
    end: usize,
    /// The least and the greatest column.
    columns: [f32x4; 2],
    most: f32,
    orientation: f32x4,
    tolerance: f32x4,
    /// One bit each of the spots looked at last that is still to be shown.
    found: u32,
}

impl Iterator for Facing<'_> {
    type Item = usize;

    #[inline]
    fn next(&mut self) -> Option<usize> {
        while self.found == 0 {
            if self.from >= self.end || self.rows.columns[self.from] > self.most {
                return None;
            }
            let lanes = |values: &[f32]| {
                let mut lanes = [0.0; LANES];
                lanes.copy_from_slice(&values[self.from..self.from + LANES]);
                f32x4::new(lanes)
            };
            let [least, most] = self.columns;
            let columns = lanes(&self.rows.columns);
            let turn = (self.orientation - lanes(&self.rows.orientations)).abs();
            // As `turn` says it.
            let half = f32x4::splat(std::f32::consts::PI);
            let turn = turn
                .simd_gt(half)
                .select(f32x4::splat(std::f32::consts::TAU) - turn, turn);
            let is_found =
                columns.simd_ge(least) & columns.simd_le(most) & turn.simd_le(self.tolerance);
            let inside = (1 << (self.end - self.from).min(LANES)) - 1;
            self.found = is_found.to_bitmask() & inside;
            self.from += LANES;
        }
        let lane = self.found.trailing_zeros() as usize;
        self.found &= self.found - 1;
        Some(self.from - LANES + lane)
    }
}

impl Spot {
    fn new(edge: &Edge, point: u32, curve: u32, gain: f32) -> Self {
        let magnitude = gain * edge.magnitude;
        let levels = wider(edge.profile);
        let sum = levels.dot(WEIGHTS).reduce_add();
        let mean = sum as f32 / SUM_OF_WEIGHTS;
        // Softened where an edge's step is hardly more than noise.
        let sixteenths = gain * 16.0 / (3.0 * magnitude + 3.0);
        let levels = f32x8::from_i32x8(i32x8::from_i16x8(levels));
        let relative = (levels - f32x8::splat(mean)) * sixteenths + f32x8::splat(MEAN + 0.5);
        let inside = relative.fast_max(f32x8::ZERO).fast_min(f32x8::splat(255.0));
        let whole = i16x8::from_i32x8_saturate(inside.fast_trunc_int());
        Self {
            x: edge.x,
            orientation: edge.orientation,
            magnitude,
            profile: whole.to_array().map(|level| level as u8),
            levels: edge.profile,
            sixteenths,
            point,
            curve,
        }
    }

    /// Where its contour crosses a row that lies so much lower, at most half a row: along the tangent, which is
    /// perpendicular to the gradient.
    fn lifted(self, rest: f32) -> Self {
        if rest == 0.0 {
            return self;
        }
        // A flat contour has no one place in a row.
        let slope = self.orientation.tan().clamp(-STEEPEST, STEEPEST);
        Self {
            x: self.x - rest * slope,
            ..self
        }
    }
}

/// What the mean of a profile is.
const MEAN: f32 = 128.0;

/// Weights of a profile's samples in its mean: the middle ones of either side are steadiest.
const WEIGHTS: i16x8 = i16x8::new([3, 6, 7, 4, 4, 7, 6, 3]);

/// What they sum up to.
const SUM_OF_WEIGHTS: f32 = 40.0;

/// Columns a row that a contour is followed to another row.
pub(crate) const STEEPEST: f32 = 4.0;

/// A profile's samples as whole numbers that differences and products fit in.
#[inline]
pub(crate) fn wider(profile: [u8; 8]) -> i16x8 {
    let mut samples = [0; 16];
    samples[..8].copy_from_slice(&profile);
    i16x8::from_u8x16_low(u8x16::new(samples))
}

/// The columns from so much before one to so much behind it.
pub(crate) fn around(column: f32, reach: f32) -> [f32; 2] {
    [column - reach, column + reach]
}

/// The angle between two orientations, in radians, 0 to π.
pub(crate) fn turn(a: f32, b: f32) -> f32 {
    let turn = (a - b).abs();
    if turn > std::f32::consts::PI {
        std::f32::consts::TAU - turn
    } else {
        turn
    }
}

/// Whether a contour with this gradient is within `flat` radians of horizontal.
pub(crate) fn is_flat(orientation: f32, flat: f32) -> bool {
    (orientation.abs() - std::f32::consts::FRAC_PI_2).abs() < flat
}

/// The same as [`Edge::is_in_row`], without a call to the mathematical library.
fn is_in_row(edge: &Edge) -> bool {
    edge.y as u32 as f32 == edge.y
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::candidates::Likeness;

    /// Spots row by row, as if a view had them.
    pub(crate) fn rows_of(size: Size, spots: impl Fn(usize) -> Vec<Spot>) -> Rows {
        let mut rows = Rows {
            per_row: size.width as usize / CELL + 1,
            starts: vec![0],
            ..Rows::default()
        };
        for row in 0..size.height as usize {
            let own = spots(row);
            let start = rows.spots.len();
            for cell in 0..rows.per_row {
                let before = own.iter().filter(|spot| (spot.x as usize / CELL) < cell);
                rows.cells.push((start + before.count()) as u32);
            }
            rows.spots.extend(own);
            rows.starts.push(rows.spots.len() as u32);
        }
        rows.line_up();
        rows
    }

    /// The default weights of what is compared.
    pub(crate) fn likeness() -> Likeness {
        Likeness::of(&crate::Settings::default())
    }

    #[test]
    fn gain_and_offset_change_nothing_that_is_compared() {
        let edge = Edge {
            x: 10.0,
            y: 3.0,
            magnitude: 12.0,
            orientation: 0.2,
            profile: [40, 44, 50, 60, 110, 122, 126, 130],
        };
        let spot = Spot::new(&edge, 0, 0, 1.0);
        for (gain, offset) in [(0.5, 0.0), (0.5, 40.0), (1.0, 60.0), (1.6, 5.0)] {
            let seen = Edge {
                magnitude: gain * edge.magnitude,
                profile: edge
                    .profile
                    .map(|level| (gain * f32::from(level) + offset).round() as u8),
                ..edge
            };
            let seen = Spot::new(&seen, 0, 0, 1.0 / gain);
            assert!((seen.magnitude - spot.magnitude).abs() < 1e-4);
            for (a, b) in spot.profile.into_iter().zip(seen.profile) {
                assert!(a.abs_diff(b) <= 1, "{:?} {:?}", spot.profile, seen.profile);
            }
        }
    }
}
