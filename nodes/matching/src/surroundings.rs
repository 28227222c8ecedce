//! What is known about the disparities around a place, from a coarser channel or an earlier pass.
//!
//! A coarse grid of cells, each with a short histogram of disparities, smoothed over neighbouring cells and bins: a
//! candidate is strange where many points are known around it and few of them share its disparity.

use messages::Size;

use crate::Range;

/// Weight of the known points around a cell from which on they predict: ten in the cell itself.
const ENOUGH: f32 = 40.0;

/// Counts of disparities by place.
#[derive(Debug, Default)]
pub(crate) struct Surroundings {
    cell: f32,
    bin: f32,
    least: f32,
    columns: usize,
    rows: usize,
    bins: usize,
    counts: Vec<f32>,
    spread: Vec<f32>,
    smooth: Vec<f32>,
    totals: Vec<f32>,
    ranges: Vec<Range>,
}

impl Surroundings {
    /// Empties the grid and lays it out for an image.
    pub(crate) fn clear(&mut self, size: Size, cell: f32, bin: f32, range: Range) {
        self.cell = cell;
        self.bin = bin;
        self.least = range.least;
        self.columns = (size.width as f32 / cell).ceil() as usize + 2;
        self.rows = (size.height as f32 / cell).ceil() as usize + 2;
        self.bins = ((range.most - range.least) / self.bin).ceil() as usize + 4;
        self.counts.clear();
        self.counts
            .resize(self.columns * self.rows * self.bins, 0.0);
    }

    fn index(&self, x: f32, y: f32) -> usize {
        let column = ((x / self.cell) as usize + 1).min(self.columns - 1);
        let row = ((y / self.cell) as usize + 1).min(self.rows - 1);
        (row * self.columns + column) * self.bins
    }

    fn bin(&self, disparity: f32) -> f32 {
        ((disparity - self.least) / self.bin + 1.5).clamp(1.0, self.bins as f32 - 2.0)
    }

    /// Takes in a point.
    pub(crate) fn add(&mut self, x: f32, y: f32, disparity: f32) {
        let place = self.index(x, y) + self.bin(disparity) as usize;
        self.counts[place] += 1.0;
    }

    /// Spreads the counts over the neighbouring cells and bins; after this the grid can be asked.
    pub(crate) fn settle(&mut self) {
        let (bins, line) = (self.bins, self.columns * self.bins);
        self.spread.clear();
        self.spread.resize(self.counts.len(), 0.0);
        self.smooth.clear();
        self.smooth.resize(self.counts.len(), 0.0);
        self.totals.clear();
        self.totals.resize(self.columns * self.rows, 0.0);
        tent(&self.counts, &mut self.spread, bins);
        tent(&self.spread, &mut self.smooth, line);
        for (cell, total) in self.smooth.chunks_exact(bins).zip(&mut self.totals) {
            *total = cell.iter().sum();
        }
        self.spread.copy_from_slice(&self.smooth);
        for (to, from) in self
            .smooth
            .chunks_exact_mut(bins)
            .zip(self.spread.chunks_exact(bins))
        {
            for (to, from) in to[1..].iter_mut().zip(from) {
                *to += from;
            }
            for (to, from) in to.iter_mut().zip(&from[1..]) {
                *to += from;
            }
        }
    }

    /// Share of the known points around a place that agree with a point's disparity, and their weight; the point
    /// itself, which must be one of them, does not count.
    pub(crate) fn agreement(&self, x: f32, y: f32, disparity: f32) -> (f32, f32) {
        // A point's own weight in its own cell: 2 · 2.
        self.agreement_beside(4.0, x, y, disparity)
    }

    /// The same for a point that is not one of those known.
    pub(crate) fn agreement_with(&self, x: f32, y: f32, disparity: f32) -> (f32, f32) {
        self.agreement_beside(0.0, x, y, disparity)
    }

    fn agreement_beside(&self, own: f32, x: f32, y: f32, disparity: f32) -> (f32, f32) {
        let cell = self.index(x, y);
        let total = self.totals[cell / self.bins] - own;
        let agree = self.smooth[cell + self.bin(disparity) as usize] - own;
        (if total > 0.0 { agree / total } else { 0.0 }, total / 4.0)
    }

    /// The disparities to search around a place: those known there and a margin, or, where little is known, all.
    pub(crate) fn range(&self, x: f32, y: f32) -> Range {
        self.ranges[self.index(x, y) / self.bins]
    }

    /// Finds what [`range`](Self::range) answers, cell by cell.
    pub(crate) fn predict(&mut self, margin: f32, range: Range) {
        self.ranges.clear();
        for (cell, total) in self.smooth.chunks_exact(self.bins).zip(&self.totals) {
            let first = cell.iter().position(|&count| count > 0.0);
            let last = cell.iter().rposition(|&count| count > 0.0);
            self.ranges.push(match (first, last) {
                (Some(first), Some(last)) if *total >= ENOUGH => {
                    let disparity = |bin: usize| self.least + (bin as f32 - 1.5) * self.bin;
                    Range {
                        least: (disparity(first + 1) - margin).max(range.least),
                        most: (disparity(last) + margin).min(range.most),
                    }
                }
                _ => range,
            });
        }
    }

    /// The same, but only within `reach` of the disparity that most points share around a place.
    pub(crate) fn predict_most(&mut self, reach: f32, range: Range) {
        self.ranges.clear();
        for (cell, total) in self.smooth.chunks_exact(self.bins).zip(&self.totals) {
            let most = (0..self.bins).max_by(|&a, &b| cell[a].total_cmp(&cell[b]).then(b.cmp(&a)));
            self.ranges.push(match most {
                Some(most) if *total >= ENOUGH => {
                    let disparity = self.least + (most as f32 - 1.0) * self.bin;
                    Range {
                        least: (disparity - reach).max(range.least),
                        most: (disparity + reach).min(range.most),
                    }
                }
                _ => range,
            });
        }
    }

    /// The average disparity known around a place.
    pub(crate) fn average(&self, x: f32, y: f32) -> Option<f32> {
        let cell = self.index(x, y);
        let counts = &self.smooth[cell..cell + self.bins];
        let (mut all, mut sum) = (0.0, 0.0);
        for (bin, count) in counts.iter().enumerate() {
            all += count;
            sum += count * (self.least + (bin as f32 - 1.0) * self.bin);
        }
        (all > 0.0).then(|| sum / all)
    }
}

/// Weighs every value and its neighbours `step` before and behind by 1, 2, 1.
fn tent(from: &[f32], to: &mut [f32], step: usize) {
    let inner = from.len().saturating_sub(2 * step);
    let triples = from.iter().zip(&from[step..]).zip(&from[2 * step..]);
    for (to, ((before, own), behind)) in to[step..step + inner].iter_mut().zip(triples) {
        *to = before + 2.0 * own + behind;
    }
}
