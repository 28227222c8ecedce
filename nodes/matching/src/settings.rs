//! The node's settings.

use messages::Reference;
use serde::{Deserialize, Serialize};

/// How many views decide, and what is compared: the three methods of the thesis's mismatch table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Curves, and the third view confirms or rejects what two propose.
    #[default]
    ThreeView,
    /// Curves, but only the reference view and its neighbour are looked at.
    TwoView,
    /// Zero-crossings one by one, in the reference view and its neighbour (Marr, Poggio and Grimson).
    Point,
}

/// What is assigned to what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Assignment {
    /// Every point along a curve chooses its partners for itself, and pays for disagreeing with its neighbours.
    #[default]
    Point,
    /// Whole curves, as in the thesis: R-table votes, a closed loop, then differences row by row.
    Curve,
}

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
    /// How curves are matched.
    pub struct Settings {
        /// The view the results refer to: left, centre, right, or a view's number, counted from 0.
        pub reference: Reference = Reference::Left;
        /// How: three-view, or one of the rivals it is compared with: two-view (curves, without the third view) or point
        /// (zero-crossings one by one, two views).
        pub method: Method = Method::ThreeView;
        /// What is assigned where curves are matched: point (each point along a curve) or curve (the thesis).
        pub assignment: Assignment = Assignment::Point;
        /// Least disparity between neighbouring views, in pixels; what lies behind the plane that images were aligned to has
        /// negative ones.
        pub disparity_least: f32 = 0.0, in -4096.0..=4096.0;
        /// Greatest disparity between neighbouring views, in pixels; by default an eighth of the image's width.
        pub disparity_most: Option<f32> = None, in 0..=4096;
        /// Degrees by which gradients of partners may differ.
        pub orientation_tolerance: f32 = 25.0, in 1..=90;
        /// Pixels by which the far view may miss what the near one predicts.
        pub miss: f32 = 0.8, in 0.1..=8;
        /// Degrees from horizontal up to which a contour is filled in along the curve instead of matched. 9 cover 0.015
        /// less at equal errors.
        pub flat: f32 = 2.0, in 0..=80;
        /// Candidates kept a point.
        pub candidates: usize = 8, in 1..=32;
        /// Cost of the greatest turn allowed; a point without a candidate costs `nothing`.
        pub turn_cost: f32 = 0.6, in 0..=10;
        /// More than three views: cost of being seen in none of those in which a point should be.
        pub unseen_cost: f32 = 1.0, in 0..=10;
        /// Cost of the greatest miss allowed.
        pub miss_cost: f32 = 0.2, in 0..=10;
        /// Cost of a sixteenth of an edge's own step by which gray levels beside it differ.
        pub gray_cost: f32 = 0.08, in 0..=10;
        /// Most that gray levels cost.
        pub gray_most: f32 = 2.0, in 0..=10;
        /// How many times more the better side of an edge weighs than the worse one.
        pub better_side: f32 = 4.0, in 1..=100;
        /// Cost of a doubled gradient magnitude.
        pub magnitude_cost: f32 = 0.3, in 0..=10;
        /// Cost of a point that chooses no candidate. More cover more and are wrong more
        /// often: 0.9 covers 0.002 less than 1.0 with 0.01 % less wrong.
        pub nothing: f32 = 1.0, in 0..=10;
        /// Cost of a pixel of change in disparity along a curve.
        pub change: f32 = 1.0, in 0..=10;
        /// Most that a change along a curve costs.
        pub jump: f32 = 2.0, in 0..=100;
        /// Cost of going over to another curve in the neighbouring view.
        pub crossing: f32 = 0.2, in 0..=10;
        /// Pixels of disparity searched beyond what the next coarser channel knows around a point; without it every
        /// channel searches the whole range.
        pub prediction_margin: Option<f32> = Some(4.0), in 0..=1000;
        /// Pixels a cell measures in which the coarser channel's disparities are collected.
        pub cell: f32 = 16.0, in 4..=128;
        /// Pixels of disparity between neighbours in a run of steady disparity.
        pub steady: f32 = 1.0, in 0.1..=16;
        /// Points without a disparity that a run bridges, and that are filled in. 6 cover 0.017 less, 16 are wrong more
        /// often (0.29 % against 0.27 %).
        pub gap: usize = 10, in 0..=64;
        /// Points seen in a run that is trusted. From 8 to 3 coverage of real scenes grows by 0.04 without more errors.
        pub run: usize = 3, in 1..=256;
        /// How much dearer, on average over a run, the best candidates at other disparities must be: a repeated texture
        /// is left alone.
        pub margin: f32 = 0.1, in 0..=10;
        /// Share of the points around a place that recur at one distance along their rows, from which on they are a
        /// pattern, and left alone unless its ends tell them apart; with 1 neither patterns nor rivals out of sight are
        /// looked for, which saves a sixth of a run's CPU.
        pub repetition: f32 = 0.16, in 0..=1;
        /// Whether of several points that land on one place of another view only the best is kept.
        pub unique: bool = true;
        /// Points to either side to which a line is fitted for a disparity; 0 keeps it as measured.
        pub straighten: usize = 4, in 0..=16;
        /// Share of them that must agree; 0 asks nobody. Where `score_least` asks too it changes little.
        pub support_share: f32 = 0.7, in 0..=1;
        /// Pixels of disparity within which neighbours agree.
        pub support_within: f32 = 1.0, in 0.1..=16;
        /// Pixels of disparity more, a pixel of distance.
        pub support_slope: f32 = 0.1, in 0..=2;
        /// Neighbours there must be.
        pub support_least: f32 = 4.0, in 0..=256;
        /// Pixels a cell measures in which neighbours are counted.
        pub support_cell: f32 = 8.0, in 4..=128;
        /// Least chance to be right within a pixel of a point that is reported, where points along curves choose for
        /// themselves; 0 reports all. 0.98 covers 0.006 more and is wrong a sixteenth more often.
        pub score_least: f32 = 0.985, in 0..=1;
        /// Pixels around a finer channel's points that coarser ones leave alone. 2 cover 0.02 less at equal errors.
        pub fill_in_radius: usize = 0, in 0..=32;
        /// Whether coarser channels fill in at all.
        pub fill_in: bool = true;
        /// Assignment of curves: the disparity expected in the coarsest channel, in pixels; by default all are searched.
        pub initial_disparity: Option<f32> = None, in 0..=4096;
        /// Assignment of curves: columns around the expected disparity in which partners are looked for, in central widths
        /// of the filter.
        pub window_widths: f32 = 1.5, in 0.1..=100;
        /// Assignment of curves: rows of that window: by up to half of them the pictures of cameras out of line may lie
        /// lower or higher than the reference view's, which is measured from the curves. 0 takes them as aligned.
        pub window_rows: f32 = 24.0, in 0..=1000;
        /// Assignment of curves: rows by which points of flat contours that vote may differ.
        pub vote_rows: f32 = 1.0, in 0..=16;
        /// Assignment of curves: pixels of disparity within which votes agree.
        pub vote_cell: f32 = 1.5, in 0.1..=16;
        /// Assignment of curves: most that a curve's disparity changes from row to row or column to column, in pixels; 0 knows
        /// only curves of one disparity.
        pub slant_most: f32 = 0.05, in 0..=1;
        /// Assignment of curves: votes by length that a partner needs.
        pub score: f32 = 0.5, in 0..=1;
        /// Assignment of curves: pixels by which the loop may miss its start, and its steps may differ.
        pub loop_residual: f32 = 3.0, in 0.1..=64;
        /// Assignment of curves: pixels between the centroids of neighbours in the graph.
        pub relation_radius: f32 = 60.0, in 1..=1000;
        /// Assignment of curves: how strongly a round of relaxation changes a match's certainty.
        pub relation_strength: f32 = 0.3, in 0..=1;
        /// Assignment of curves: rounds of relaxation.
        pub relation_rounds: usize = 3, in 0..=100;
        /// Assignment of curves: certainty after relaxation, 0 to 1, that a match needs.
        pub certainty: f32 = 0.4, in 0..=1;
        /// Assignment of curves: what points without a partner get: along (interpolated) or centroid (the thesis).
        pub filling: Filling = Filling::Along;
        /// Method point: central widths of the filter searched to either side of what the coarser channel knows. Within
        /// half of one false targets are rare, within one every other point has one (Marr and Poggio 1979).
        pub reach_widths: f32 = 1.0, in 0.1..=100;
        /// Method point: share of the unambiguous matches around a point that must agree on one of its candidates.
        pub majority: f32 = 0.5, in 0..=1;
        /// Method point: share of a region's points that must be matched, or all of them are dropped; 0 keeps all. Of
        /// unrelated images 70 % match by chance (Marr and Poggio 1979).
        pub matched_share: f32 = 0.7, in 0..=1;
    }
}

impl Settings {
    /// Whether R-tables are read, and not the index of points by row alone.
    pub fn reads_tables(&self) -> bool {
        self.assignment == Assignment::Curve && self.method != Method::Point
    }

    /// The constants of the thesis: curves are assigned, not points; windows of 1.5 w by 24 rows around an initial
    /// estimate of 32 pixels or what the coarser channel predicts; orientations within 10°. Points without a partner are
    /// interpolated along their curve, where the thesis gives them the centroid's disparity.
    pub fn thesis() -> Self {
        Self {
            reference: Reference::Left,
            assignment: Assignment::Curve,
            initial_disparity: Some(32.0),
            window_widths: 1.5,
            window_rows: 24.0,
            score: 0.6,
            orientation_tolerance: 10.0,
            filling: Filling::Along,
            ..Self::default()
        }
    }
}
