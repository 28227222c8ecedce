//! What is known about the disparities around a place, from a coarser channel or an earlier pass.
//!
//! A coarse grid of cells, each with a short histogram of disparities, smoothed over neighbouring cells and bins: a
//! candidate is strange where many points are known around it and few of them share its disparity.

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
    smooth: Vec<f32>,
    totals: Vec<f32>,
}

impl Surroundings {
    /// Empties the grid and lays it out for an image.
    pub(crate) fn clear(&mut self, size: messages::Size, cell: f32, range: crate::Range) {
        self.cell = cell;
        self.bin = 1.0;
        self.least = range.least;
        self.columns = (size.width as f32 / cell).ceil() as usize + 2;
        self.rows = (size.height as f32 / cell).ceil() as usize + 2;
        self.bins = ((range.most - range.least) / self.bin).ceil() as usize + 4;
        self.counts.clear();
        self.counts.resize(self.columns * self.rows * self.bins, 0.0);
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
        self.smooth.clear();
        self.smooth.resize(self.counts.len(), 0.0);
        self.totals.clear();
        self.totals.resize(self.columns * self.rows, 0.0);
        for row in 1..self.rows - 1 {
            for column in 1..self.columns - 1 {
                let here = row * line + column * bins;
                for (dy, dx) in (0..3).flat_map(|dy| (0..3).map(move |dx| (dy, dx))) {
                    let there = here + dy * line + dx * bins - line - bins;
                    let weight = [1.0, 2.0, 1.0][dy] * [1.0, 2.0, 1.0][dx];
                    let (from, to) = (&self.counts[there..there + bins], &mut self.smooth[here..here + bins]);
                    for (to, from) in to.iter_mut().zip(from) {
                        *to += weight * from;
                    }
                }
                let cell = &mut self.smooth[here..here + bins];
                self.totals[row * self.columns + column] = cell.iter().sum();
                let mut before = 0.0;
                for i in 0..bins - 1 {
                    let own = cell[i];
                    cell[i] = before + own + cell[i + 1];
                    before = own;
                }
            }
        }
    }

    /// How little the surroundings know of this disparity: 0 where they agree or nothing is known, up to 1.
    pub(crate) fn strangeness(&self, x: f32, y: f32, disparity: f32) -> f32 {
        let cell = self.index(x, y);
        let total = self.totals[cell / self.bins];
        if total <= 0.0 {
            return 0.0;
        }
        let share = self.smooth[cell + self.bin(disparity) as usize] / total;
        // Few known points say little; a fifth of them agreeing is enough: several surfaces may meet here.
        let known = total / (total + 16.0);
        known * (1.0 - 5.0 * share).max(0.0)
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
