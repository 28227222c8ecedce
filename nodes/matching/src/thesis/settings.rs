//! The settings of the thesis's way, in the graph file under `[match.curves]`.

use serde::{Deserialize, Serialize};

/// What disparity the points of a matched curve get that have no partner of their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filling {
    /// Interpolated along the curve.
    #[default]
    Along,
    /// That of the centroid, as in the thesis.
    Centroid,
}

messages::settings! {
    /// How whole curves are matched, where `assignment = "curve"`.
    pub struct CurveSettings in "curves" {
        /// Whole curves: the disparity expected in the coarsest channel, in pixels; by default all are searched.
        pub initial_disparity: Option<f32> = None, in 0..=4096;
        /// Whole curves: columns around the expected disparity in which partners are looked for, in central widths of the
        /// filter.
        pub window_widths: f32 = 1.5, in 0.1..=100;
        /// Whole curves: rows of that window: by up to half of them the pictures of cameras out of line may lie lower or
        /// higher than the reference view's, which is measured from the curves. 0 takes them as aligned.
        pub window_rows: f32 = 24.0, in 0..=1000;
        /// Whole curves: rows by which points of flat contours that vote may differ.
        pub vote_rows: f32 = 1.0, in 0..=16;
        /// Whole curves: pixels of disparity within which votes agree.
        pub vote_cell: f32 = 1.5, in 0.1..=16;
        /// Whole curves: most that a curve's disparity changes from row to row or column to column, in pixels; 0 knows only
        /// curves of one disparity.
        pub slant_most: f32 = 0.05, in 0..=1;
        /// Whole curves: votes by length, 0 to 1, that a partner needs.
        pub score: f32 = 0.5, in 0..=1;
        /// Whole curves: pixels by which the loop may miss its start, and its steps may differ.
        pub loop_residual: f32 = 3.0, in 0.1..=64;
        /// Whole curves: pixels between the centroids of neighbours in the graph.
        pub relation_radius: f32 = 60.0, in 1..=1000;
        /// Whole curves: how strongly a round of relaxation changes a match's certainty, 0 to 1.
        pub relation_strength: f32 = 0.3, in 0..=1;
        /// Whole curves: rounds of relaxation.
        pub relation_rounds: usize = 3, in 0..=100;
        /// Whole curves: certainty after relaxation, 0 to 1, that a match needs.
        pub certainty: f32 = 0.4, in 0..=1;
        /// Whole curves: what points without a partner get: along (interpolated) or centroid (the thesis).
        pub filling: Filling = Filling::Along;
    }
}

impl CurveSettings {
    /// The constants of the thesis: windows of 1.5 w by 24 rows around an initial estimate of 32 pixels or what the coarser
    /// channel predicts. Points without a partner are interpolated along their curve, where the thesis gives them the
    /// centroid's disparity.
    pub fn thesis() -> Self {
        Self {
            initial_disparity: Some(32.0),
            window_widths: 1.5,
            window_rows: 24.0,
            score: 0.6,
            filling: Filling::Along,
            ..Self::default()
        }
    }
}
