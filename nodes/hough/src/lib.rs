//! Generalized Hough transform: every curve becomes an R-table.
//!
//! ```text
//! curves ─► per curve: vectors to its centroid, filed by orientation ─► tables
//!       └─► all points, row by row, left to right ────────────────────┘
//! ```
//!
//! The reference point of a curve is its centroid c. Each point e with orientation θ files the vector r = c − e under
//! θ (Ballard). In another view a point with orientation near θ votes for a reference point at e + r; the peak of the
//! votes is where the curve lies there. The index of all points by row lets the matcher go through the few rows that
//! can be right.

mod curvature;
#[cfg(feature = "node")]
pub mod node;
mod settings;

pub use curvature::curvatures;
pub use settings::{Settings, Weight};

use messages::{CurvesView, Edge, Entry, Size, Table, TablesRoom};

/// The least a vote counts, in means of the view: a straight curve keeps a table that can be matched.
pub const LEAST_WEIGHT: f32 = 1.0 / 16.0;

/// What there is to say about a view besides its tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tabulated {
    /// Points that were passed over: outside the image, not a number, or claimed by a curve but not there.
    pub skipped: usize,
}

/// Turns curves into R-tables; keeps the scratch memory from frame to frame.
#[derive(Debug)]
pub struct Tabulator {
    settings: Settings,
    /// What each curve point's vote counts.
    weights: Vec<f32>,
    /// Sort keys: the value to sort by above, the point's index below.
    keys: Vec<u64>,
}

impl Tabulator {
    /// A tabulator for images up to `max`; memory is taken into use as frames need it.
    pub fn new(settings: &Settings, max: Size) -> Self {
        let points = max.pixels() + max.pixels() / 2;
        Self {
            settings: settings.clone(),
            weights: Vec::with_capacity(points),
            keys: Vec::with_capacity(points),
        }
    }

    /// Makes the tables of the curves of an image of this size; the room is filled anew.
    pub fn process(
        &mut self,
        curves: CurvesView<'_>,
        size: Size,
        room: &mut TablesRoom<'_>,
    ) -> Tabulated {
        room.tables.clear();
        room.entries.clear();
        room.rows.clear();
        room.order.clear();
        let skipped = self.index_rows(curves.points, size, room);
        self.weigh(curves, size);
        let mut missing = 0;
        for curve in curves.curves {
            let end = curve.first as usize + curve.count as usize;
            let sound = end <= curves.points.len() && curve.x.is_finite() && curve.y.is_finite();
            missing += if sound { 0 } else { curve.count as usize };
            let range = if sound { curve.range() } else { 0..0 };

            self.keys.clear();
            for point in range {
                if is_sound(&curves.points[point], size) {
                    self.keys.push(key(curves.points[point].orientation, point));
                }
            }
            self.keys.sort_unstable();

            let first = room.entries.len();
            let mut weight = 0.0;
            for &key in &self.keys {
                let point = key as u32;
                let e = &curves.points[point as usize];
                let entry = Entry {
                    orientation: e.orientation,
                    rx: curve.x - e.x,
                    ry: curve.y - e.y,
                    weight: self.weights[point as usize],
                    point,
                };
                weight += entry.weight;
                room.entries.push(entry);
            }
            room.tables.push(Table {
                curve: curve.label,
                first: first as u32,
                count: (room.entries.len() - first) as u32,
                x: curve.x,
                y: curve.y,
                weight,
            });
        }
        Tabulated {
            skipped: skipped + missing,
        }
    }

    /// Sorts all points by row and column; gives the number of points passed over.
    fn index_rows(&mut self, points: &[Edge], size: Size, room: &mut TablesRoom<'_>) -> usize {
        let rows = room.rows.grow(size.height as usize + 1);
        rows.fill(0);
        self.keys.clear();
        for point in points {
            if is_sound(point, size) {
                if let Some(count) = rows.get_mut(point.y as usize + 1) {
                    *count += 1;
                }
                self.keys.push(0);
            }
        }
        for row in 1..rows.len() {
            rows[row] += rows[row - 1];
        }
        let placed = self.keys.len();
        let skipped = points.len() - placed;
        // Place each point at the next free key of its row; afterwards each start has moved to its row's end.
        for (i, point) in points.iter().enumerate() {
            if is_sound(point, size) {
                let next = &mut rows[point.y as usize];
                self.keys[*next as usize] = key(point.x, i);
                *next += 1;
            }
        }
        rows.copy_within(..size.height as usize, 1);
        rows[0] = 0;
        for row in rows.windows(2) {
            self.keys[row[0] as usize..row[1] as usize].sort_unstable();
        }
        for &key in &self.keys {
            room.order.push(key as u32);
        }
        skipped
    }

    /// Finds what every point's vote counts.
    fn weigh(&mut self, curves: CurvesView<'_>, size: Size) {
        self.weights.clear();
        self.weights.resize(curves.points.len(), 1.0);
        let constant = match self.settings.weight {
            Weight::Unity => return,
            Weight::Magnitude => {
                self.weigh_by_magnitude(curves.points, size);
                0.0
            }
            Weight::Combined => {
                self.weigh_by_magnitude(curves.points, size);
                self.settings.constant
            }
            Weight::Curvature => {
                self.weights.fill(0.0);
                for curve in curves.curves {
                    if let Some(weights) = self.weights.get_mut(curve.range()) {
                        curvatures(&curves.points[curve.range()], weights);
                    }
                }
                0.0
            }
        };
        let (mut sum, mut count) = (0.0, 0.0);
        for weight in &self.weights {
            if weight.is_finite() {
                sum += f64::from(*weight);
                count += 1.0;
            }
        }
        let scale = if sum > 0.0 { (count / sum) as f32 } else { 0.0 };
        for weight in &mut self.weights {
            *weight = constant + (*weight * scale).max(LEAST_WEIGHT);
        }
    }

    fn weigh_by_magnitude(&mut self, points: &[Edge], size: Size) {
        for (weight, point) in self.weights.iter_mut().zip(points) {
            *weight = if is_sound(point, size) {
                point.magnitude
            } else {
                0.0
            };
        }
    }
}

/// A key that sorts by value, then by index.
fn key(value: f32, index: usize) -> u64 {
    // Floats sort like their bits, once those of negative ones are turned around.
    let bits = value.to_bits();
    let sortable = if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    };
    u64::from(sortable) << 32 | index as u64
}

/// Whether a point lies inside the image and is made of numbers.
fn is_sound(point: &Edge, size: Size) -> bool {
    let inside = |place: f32, len: u32| place >= 0.0 && place <= len as f32 - 1.0;
    inside(point.x, size.width)
        && inside(point.y, size.height)
        && point.orientation.is_finite()
        && (0.0..f32::INFINITY).contains(&point.magnitude)
}
