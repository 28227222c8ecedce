//! How contrasty views are: no two cameras are equally bright, and lamps flicker.

use crate::Edge;

/// Of the points that every view has, the strongest are compared: weak ones come and go with noise.
const STRONGEST: usize = 4;

/// The contrast of views in a channel, with its memory: the gradient magnitude, in gray levels a pixel, that equally many
/// of each view's curve points exceed.
#[derive(Debug, Default)]
pub struct Contrast {
    magnitudes: Vec<f32>,
    of_view: Vec<f32>,
}

impl Contrast {
    /// Compares views by their curve points.
    pub fn measure<'a>(&mut self, views: impl Iterator<Item = &'a [Edge]> + Clone) {
        let least = views.clone().map(<[Edge]>::len).min().unwrap_or(0);
        self.of_view.clear();
        for points in views {
            self.magnitudes.clear();
            self.magnitudes
                .extend(points.iter().map(|point| point.magnitude));
            let at = least / STRONGEST;
            self.of_view.push(match self.magnitudes.is_empty() {
                true => 0.0,
                false => {
                    let descending = |a: &f32, b: &f32| b.total_cmp(a);
                    *self.magnitudes.select_nth_unstable_by(at, descending).1
                }
            });
        }
    }

    /// View by view; 0 of one without points.
    pub fn of_views(&self) -> &[f32] {
        &self.of_view
    }

    /// By what a view's gray levels are multiplied to be as contrasty as the most contrasty view's.
    pub fn gain(&self, view: usize) -> f32 {
        let most = self.of_view.iter().copied().fold(0.0, f32::max);
        match self.of_view[view] > 0.0 {
            true => most / self.of_view[view],
            false => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edges(magnitudes: impl Iterator<Item = f32>) -> Vec<Edge> {
        let edge = |magnitude| Edge {
            magnitude,
            ..Edge::default()
        };
        magnitudes.map(edge).collect()
    }

    #[test]
    fn the_gain_of_a_darker_view_is_found_though_its_weak_points_are_missing() {
        let bright = edges((0..1000).map(|at| 40.0 * 0.995f32.powi(at)));
        // Below 2 gray levels a pixel nothing is found.
        let dark = edges(
            bright
                .iter()
                .map(|e| 0.4 * e.magnitude)
                .filter(|&m| m > 2.0),
        );
        assert!(dark.len() < 500);
        let mut contrast = Contrast::default();
        contrast.measure([&bright[..], &dark[..], &bright[..]].into_iter());
        let gains = [0, 1, 2].map(|view| contrast.gain(view));
        assert_eq!([gains[0], gains[2]], [1.0, 1.0]);
        assert!((gains[1] - 2.5).abs() < 1e-3, "{gains:?}");
    }

    #[test]
    fn views_without_points_have_no_gain() {
        let mut contrast = Contrast::default();
        contrast.measure([&[][..], &edges([5.0].into_iter())[..]].into_iter());
        assert_eq!([contrast.gain(0), contrast.gain(1)], [1.0, 1.0]);
    }
}
