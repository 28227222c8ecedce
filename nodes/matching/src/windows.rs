//! Which curves of another view can be a curve's partner: those with a centroid in a window around the predicted
//! place.

use messages::Curve;

/// The curves of a view by the row of their centroid.
#[derive(Debug, Default)]
pub(crate) struct Windows {
    by_row: Vec<(f32, f32, u32)>,
}

/// A window of the plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    /// Least and greatest column.
    pub(crate) columns: (f32, f32),
    /// Least and greatest row.
    pub(crate) rows: (f32, f32),
}

impl Windows {
    /// Takes in the curves of a view.
    pub(crate) fn fill(&mut self, curves: &[Curve]) {
        self.by_row.clear();
        self.by_row.extend(
            (0..)
                .zip(curves)
                .map(|(label, curve)| (curve.y, curve.x, label)),
        );
        self.by_row
            .sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    }

    /// The labels of the curves whose centroid lies in the window.
    pub(crate) fn inside(&self, window: Window, labels: &mut Vec<u32>) {
        labels.clear();
        let start = self.by_row.partition_point(|curve| curve.0 < window.rows.0);
        let inside = self.by_row[start..]
            .iter()
            .take_while(|curve| curve.0 <= window.rows.1);
        let (left, right) = window.columns;
        labels.extend(
            inside
                .filter(|curve| (left..=right).contains(&curve.1))
                .map(|curve| curve.2),
        );
    }
}
