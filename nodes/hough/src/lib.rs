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

/// The version of the algorithm: one more whenever the same input and settings give other tables.
pub const VERSION: u32 = 1;

/// The least a vote by magnitude or curvature counts, in means of the view: a straight curve keeps a table that can be
/// matched.
pub const LEAST_WEIGHT: f32 = 1.0 / 16.0;

/// What there is to say about a view besides its tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tabulated {
    /// Points that were passed over (outside the image or not numbers) and curves whose tables stay empty (their
    /// points do not exist or their centroid is no number).
    pub skipped: usize,
}

/// Turns curves into R-tables; keeps the scratch memory from frame to frame.
#[derive(Debug)]
pub struct Tabulator {
    settings: Settings,
    /// What each curve point's vote counts.
    weights: Vec<f32>,
    /// What is sorted: a value above, a point's index below.
    keys: Vec<u64>,
    /// A bit for every pixel that has a point, in whole words a row.
    taken: Vec<u64>,
    /// The first point of every pixel that has one; of others what was left there.
    first: Vec<u32>,
    /// The points of one pixel.
    shared: Vec<u64>,
}

impl Tabulator {
    /// A tabulator for images up to `max`; memory is taken into use as frames need it.
    pub fn new(settings: &Settings, max: Size) -> Self {
        let points = max.pixels() + max.pixels() / 2;
        Self {
            settings: settings.clone(),
            weights: Vec::with_capacity(points),
            keys: Vec::with_capacity(points),
            taken: Vec::with_capacity(words(max) * max.height as usize),
            first: vec![0; 64 * words(max) * max.height as usize],
            shared: Vec::with_capacity(points),
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
        let mut skipped = self.index_rows(curves.points, size, room);
        if self.settings.tables == Some(false) {
            return Tabulated { skipped };
        }
        self.weigh(curves, size);
        for curve in curves.curves {
            let mut table = Table {
                curve: curve.label,
                first: room.entries.len() as u32,
                x: curve.x,
                y: curve.y,
                ..Table::default()
            };
            match curves.points.get(curve.range()) {
                Some(points) if curve.x.is_finite() && curve.y.is_finite() => {
                    self.keys.clear();
                    for (i, point) in (curve.first..)
                        .zip(points)
                        .filter(|(_, point)| is_sound(point, size))
                    {
                        self.keys.push(key(point.orientation, i));
                    }
                    self.keys.sort_unstable();
                    self.enter(curves.points, &mut table, room);
                }
                _ => skipped += 1,
            }
            room.tables.push(table);
        }
        Tabulated { skipped }
    }

    /// Writes the entries of one table, in the order of the keys.
    fn enter(&self, points: &[Edge], table: &mut Table, room: &mut TablesRoom<'_>) {
        let slots = room.entries.grow(self.keys.len());
        for (slot, &key) in slots.iter_mut().zip(&self.keys) {
            let index = key as u32 as usize;
            let point = &points[index];
            *slot = Entry {
                orientation: point.orientation,
                rx: table.x - point.x,
                ry: table.y - point.y,
                weight: self.weights[index],
                point: index as u32,
            };
            table.weight += slot.weight;
        }
        table.count = slots.len() as u32;
    }

    /// Sorts all points by row, then column; gives the number of those passed over.
    ///
    /// Nearly every pixel has one point at most, so they are sorted by pixel: each is put where its pixel is, and those that
    /// are there are collected. Only where curves branch, or what came is damaged, do several share one.
    fn index_rows(&mut self, points: &[Edge], size: Size, room: &mut TablesRoom<'_>) -> usize {
        let starts = room.rows.grow(size.height as usize + 1);
        starts.fill(0);
        let Some((last, rows)) = starts.split_last_mut() else {
            return points.len();
        };
        // A room for smaller images has fewer rows; what lies below them is passed over.
        let size = Size::new(size.width, rows.len() as u32);
        let words = words(size);
        self.taken.clear();
        self.taken.resize(words * rows.len(), 0);
        if self.first.len() < 64 * self.taken.len() {
            self.first.resize(64 * self.taken.len(), 0);
        }
        self.keys.clear();
        let mut skipped = 0;
        for (i, point) in (0..).zip(points) {
            if !is_sound(point, size) {
                skipped += 1;
                continue;
            }
            let pixel = 64 * words * point.y as usize + point.x as usize;
            let (taken, bit) = (&mut self.taken[pixel / 64], 1 << (pixel % 64));
            if *taken & bit == 0 {
                *taken |= bit;
                self.first[pixel] = i;
            } else {
                self.keys.push(((pixel as u64) << 32) | u64::from(i));
            }
        }
        self.keys.sort_unstable();
        let pixel_of = |key: u64| (key >> 32) as usize;
        let mut further = &self.keys[..];
        for (row, start) in rows.iter_mut().enumerate() {
            *start = room.order.len() as u32;
            let taken = words * row..words * (row + 1);
            for (word, &taken) in taken.clone().zip(&self.taken[taken]) {
                let mut taken = taken;
                while taken != 0 {
                    let pixel = 64 * word + taken.trailing_zeros() as usize;
                    taken &= taken - 1;
                    let first = self.first[pixel];
                    if further.first().is_none_or(|&key| pixel_of(key) != pixel) {
                        room.order.push(first);
                        continue;
                    }
                    let count = further.iter().take_while(|key| pixel_of(**key) == pixel);
                    let (here, beyond) = further.split_at(count.count());
                    further = beyond;
                    let here = here.iter().map(|&key| key as u32);
                    let here = std::iter::once(first).chain(here);
                    self.shared.clear();
                    self.shared
                        .extend(here.map(|i| key(points[i as usize].x, i)));
                    self.shared.sort_unstable();
                    for &key in &self.shared {
                        room.order.push(key as u32);
                    }
                }
            }
        }
        *last = room.order.len() as u32;
        skipped
    }

    /// Finds what every point's vote counts.
    fn weigh(&mut self, curves: CurvesView<'_>, size: Size) {
        self.weights.clear();
        self.weights.resize(curves.points.len(), 1.0);
        let constant = match self.settings.weight {
            Weight::Unity => return,
            Weight::Combined => self.settings.constant,
            Weight::Magnitude | Weight::Curvature => 0.0,
        };
        if self.settings.weight == Weight::Curvature {
            for curve in curves.curves {
                if let (Some(points), Some(weights)) = (
                    curves.points.get(curve.range()),
                    self.weights.get_mut(curve.range()),
                ) {
                    curvatures(points, weights);
                }
            }
        } else {
            for (weight, point) in self.weights.iter_mut().zip(curves.points) {
                *weight = point.magnitude;
            }
        }
        let (mut sum, mut count) = (0.0, 0.0);
        for (weight, point) in self.weights.iter().zip(curves.points) {
            if is_sound(point, size) && weight.is_finite() {
                sum += f64::from(*weight);
                count += 1.0;
            }
        }
        let scale = if sum > 0.0 { (count / sum) as f32 } else { 0.0 };
        for weight in &mut self.weights {
            *weight = constant + (*weight * scale).max(LEAST_WEIGHT);
        }
    }
}

/// Words in which there is a bit for every pixel of a row.
fn words(size: Size) -> usize {
    (size.width as usize).div_ceil(64)
}

/// A key that sorts by value, then by index.
fn key(value: f32, index: u32) -> u64 {
    // Floats sort like their bits, once those of negative ones are turned around.
    let bits = value.to_bits();
    let sortable = if bits >> 31 == 1 {
        !bits
    } else {
        bits | (1 << 31)
    };
    (u64::from(sortable) << 32) | u64::from(index)
}

/// Whether a point lies inside the image and is made of numbers. All is looked at before anything is decided: damage is
/// rare, and one branch is less than six.
fn is_sound(point: &Edge, size: Size) -> bool {
    let inside = |place: f32, len: u32| (place >= 0.0) & (place <= len as f32 - 1.0);
    inside(point.x, size.width)
        & inside(point.y, size.height)
        & point.orientation.is_finite()
        & (point.magnitude >= 0.0)
        & (point.magnitude < f32::INFINITY)
}
