//! Whether a region's points find partners at all: where too few do, the images are not in register.

use messages::Size;

/// How many of the points of a region are matched; a region is a cell and the eight around it.
#[derive(Debug, Default)]
pub(super) struct Regions {
    cell: f32,
    columns: usize,
    rows: usize,
    /// Points, and matched points, cell by cell.
    counts: Vec<(u32, u32)>,
}

impl Regions {
    /// Lays cells of so many pixels out over an image, all empty.
    pub(super) fn clear(&mut self, size: Size, cell: f32) {
        self.cell = cell;
        self.columns = (size.width as f32 / cell).ceil() as usize + 2;
        self.rows = (size.height as f32 / cell).ceil() as usize + 2;
        self.counts.clear();
        self.counts.resize(self.columns * self.rows, (0, 0));
    }

    /// Column and row of a place's cell; there is a cell on every side of it.
    fn place(&self, x: f32, y: f32) -> (usize, usize) {
        let column = ((x / self.cell) as usize + 1).min(self.columns - 2);
        let row = ((y / self.cell) as usize + 1).min(self.rows - 2);
        (column, row)
    }

    /// Takes in a point.
    pub(super) fn add(&mut self, x: f32, y: f32, is_matched: bool) {
        let (column, row) = self.place(x, y);
        let (points, matched) = &mut self.counts[row * self.columns + column];
        *points += 1;
        *matched += u32::from(is_matched);
    }

    /// Share of the points around a place that are matched.
    pub(super) fn share(&self, x: f32, y: f32) -> f32 {
        let (column, row) = self.place(x, y);
        let (mut points, mut matched) = (0, 0);
        for row in row - 1..=row + 1 {
            let start = row * self.columns + column - 1;
            for cell in &self.counts[start..start + 3] {
                points += cell.0;
                matched += cell.1;
            }
        }
        matched as f32 / (points as f32).max(1.0)
    }
}
