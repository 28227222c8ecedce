//! Three views of a scene: where they stand, and how columns that belong together give a disparity.

use messages::Sway;

/// Where the three views of a triple stand, and which of them the results belong to.
///
/// A point with disparity d (pixels a baseline) seen at column x in the reference view is expected at x − t·d in a view
/// t baselines to its right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triple {
    /// Index of the reference view.
    pub reference: usize,
    /// Baselines to the right of any one place at which each view stands.
    pub places: [f32; 3],
    /// Rows by which the picture lies lower, a baseline further to the right.
    pub drift: f32,
    /// By how much each view's picture is off.
    pub sway: [Sway; 3],
}

impl Triple {
    /// Of a rig's three views that lie next to each other, a baseline apart and level.
    pub fn of_rig(reference: usize) -> Self {
        Self {
            reference,
            places: [0.0, 1.0, 2.0],
            drift: 0.0,
            sway: [Sway::NONE; 3],
        }
    }

    /// By how much a view's picture is off beside the reference view's.
    pub(crate) fn beside_reference(&self, view: usize) -> Sway {
        self.sway[view] - self.sway[self.reference]
    }
}

/// The reference view and the way to the two others, of which the near one comes first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steps {
    pub(crate) reference: usize,
    pub(crate) near: usize,
    pub(crate) far: usize,
    /// Baselines to the right from the reference to the near view.
    pub(crate) to_near: f32,
    /// Baselines to the right from the reference to the far view.
    pub(crate) to_far: f32,
    /// Whether the far view has a say.
    pub(crate) third: bool,
    /// What each view's column counts in the disparity: the slope of the line through all three, by least squares.
    slope: [f32; 3],
    /// What each view's column counts in the bend: by how much the middle one misses the line through the outer ones.
    bend: [f32; 3],
}

impl Steps {
    pub(crate) fn of(triple: &Triple, third: bool) -> Self {
        let Triple {
            reference, places, ..
        } = *triple;
        let to = |view: usize| places[view] - places[reference];
        let [one, other] = match reference {
            0 => [1, 2],
            1 => [0, 2],
            _ => [1, 0],
        };
        let (near, far) = match to(other).abs() < to(one).abs() {
            true => (other, one),
            false => (one, other),
        };
        let mean = places.iter().sum::<f32>() / 3.0;
        let spread: f32 = places.iter().map(|t| (t - mean) * (t - mean)).sum();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| places[a].total_cmp(&places[b]));
        let [left, middle, right] = order;
        let share = (places[middle] - places[left]) / (places[right] - places[left]);
        let mut bend = [0.0; 3];
        (bend[left], bend[middle], bend[right]) = (share - 1.0, 1.0, -share);
        Self {
            reference,
            near,
            far,
            to_near: to(near),
            to_far: to(far),
            third,
            slope: places.map(|t| (mean - t) / spread),
            bend,
        }
    }

    /// What belongs to the reference, the near and the far view, in the order of the views.
    pub(crate) fn in_order<T: Copy + Default>(&self, reference: T, near: T, far: T) -> [T; 3] {
        let mut all = [T::default(); 3];
        all[self.reference] = reference;
        all[self.near] = near;
        all[self.far] = far;
        all
    }

    /// Disparity and bend of a point seen at these columns of the three views, in their order.
    #[inline]
    pub(crate) fn measure(&self, columns: [f32; 3]) -> (f32, f32) {
        let sum = |by: &[f32; 3]| by[0] * columns[0] + by[1] * columns[1] + by[2] * columns[2];
        (sum(&self.slope), sum(&self.bend))
    }

    /// Whether a view is looked at.
    pub(crate) fn uses(&self, view: usize) -> bool {
        self.third || view != self.far
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns at which a point is seen, exactly.
    fn seen(triple: &Triple, x: f32, disparity: f32) -> [f32; 3] {
        triple.places.map(|t| x - t * disparity)
    }

    #[test]
    fn a_point_that_moves_straight_has_its_disparity_and_no_bend_wherever_the_views_stand() {
        for places in [
            [0.0, 1.0, 2.0],
            [0.0, -1.0, -2.0],
            [5.0, 4.25, 3.0],
            [-1.0, 0.5, 0.75],
        ] {
            for reference in 0..3 {
                let triple = Triple {
                    reference,
                    places,
                    drift: 0.0,
                    sway: [Sway::NONE; 3],
                };
                let steps = Steps::of(&triple, true);
                let (disparity, bend) = steps.measure(seen(&triple, 300.0, 12.5));
                assert!((disparity - 12.5).abs() < 1e-3, "{places:?} {disparity}");
                assert!(bend.abs() < 1e-3, "{places:?} {bend}");
                assert!(steps.to_near.abs() <= steps.to_far.abs());
            }
        }
    }

    #[test]
    fn on_a_rig_the_outer_views_give_the_disparity_and_the_middle_one_the_bend() {
        for reference in 0..3 {
            let steps = Steps::of(&Triple::of_rig(reference), true);
            let (disparity, bend) = steps.measure([100.25, 80.5, 60.0]);
            assert_eq!(disparity, (100.25 - 60.0) / 2.0);
            assert_eq!(bend, 80.5 - (100.25 + 60.0) / 2.0);
        }
    }
}
