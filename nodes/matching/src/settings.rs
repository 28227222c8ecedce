//! The node's settings.

use messages::Reference;
use serde::{Deserialize, Serialize};

use crate::{CurveSettings, PointSettings};

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

messages::settings! {
    /// How views are matched. Figures are means of sixteen Middlebury scenes, views 1,3,5: the share of edge pixels that is
    /// covered, and the share of points that are wrong by more than 1 px.
    pub struct Settings {
        /// The view that results refer to: left, centre, right, or a view's number, counted from 0.
        pub reference: Reference = Reference::Left;
        /// Which views decide and what is matched: three-view (curves), or one of the rivals it is compared with: two-view
        /// (curves, without the third view) or point (zero-crossings one by one, in two views).
        pub method: Method = Method::ThreeView;
        /// What is assigned where curves are matched: point (each point along a curve) or curve (the thesis).
        pub assignment: Assignment = Assignment::Point;
        /// Least disparity between neighbouring views, in pixels. Below 0 lies what is behind the plane that images were
        /// aligned to.
        pub disparity_least: f32 = 0.0, in -4096.0..=4096.0;
        /// Greatest disparity between neighbouring views, in pixels; by default an eighth of the image's width.
        pub disparity_most: Option<f32> = None, in 0..=4096;
        /// Degrees by which the gradients of partners may differ.
        pub orientation_tolerance: f32 = 25.0, in 1..=90;
        /// Pixels by which a point of the far view may lie beside where the near one predicts it.
        pub miss: f32 = 0.8, in 0.1..=8;
        /// Degrees from horizontal up to which a contour is filled in along its curve instead of matched. 9 cover 0.012
        /// less, as often wrong.
        pub flat: f32 = 2.0, in 0..=80;
        /// Cost of partners whose gradients differ by `orientation_tolerance`; all costs are of the unit of `nothing`. Without
        /// it 0.30 % of the points are wrong instead of 0.27 %.
        pub turn_cost: f32 = 0.6, in 0..=10;
        /// Cost of gray levels beside partners that differ by a sixteenth of three times the edge's gradient. Without it 0.29 %
        /// of the points are wrong instead of 0.27 %.
        pub gray_cost: f32 = 0.08, in 0..=10;
        /// Cost of partners of which one has twice the other's gradient. Without it 0.30 % of the points are wrong instead of
        /// 0.27 %.
        pub magnitude_cost: f32 = 0.3, in 0..=10;
        /// Cost of a point that chooses no partner. A higher one covers more and is wrong more often: 0.9 covers 0.002 less than
        /// 1.0 with 0.01 % less wrong.
        pub nothing: f32 = 1.0, in 0..=10;
        /// Cost of a pixel of change in disparity from one point of a curve to the next. Without it 0.28 % of the points are
        /// wrong instead of 0.27 %.
        pub change: f32 = 1.0, in 0..=10;
        /// Pixels of disparity searched beyond what the next coarser channel knows around a point. Without it every channel
        /// searches the whole range, which takes longer and covers 0.003 less.
        pub prediction_margin: Option<f32> = Some(4.0), in 0..=1000;
        /// Points without a partner that a run along a curve bridges, and that are filled in. 6 cover 0.017 less, 16 are
        /// wrong more often (0.29 % against 0.27 %).
        pub gap: usize = 10, in 0..=64;
        /// Least number of points with a partner in a run of steady disparity. From 8 to 3 coverage grows by 0.04 without
        /// more errors.
        pub run: usize = 3, in 1..=256;
        /// How much dearer, in the unit of `nothing` and on average over a run, the best partners at other disparities must be.
        /// With 0 0.002 more is covered, as often wrong; where `repetition` is 1 as well, half as many again of a grating's
        /// points are wrong.
        pub margin: f32 = 0.1, in 0..=10;
        /// Share of the points around a place that recur at one distance along their rows, from which on they are a pattern,
        /// and left alone unless its ends tell them apart. 1 looks neither for patterns nor for rivals out of sight, which
        /// saves a sixth of a run's CPU.
        pub repetition: f32 = 0.16, in 0..=1;
        /// Whether of several points that land on one place of another view only the best is kept. Without it 281 points are
        /// off by more than 2 px instead of 278, of 950,000.
        pub unique: bool = true;
        /// Points to either side along a curve to which a line is fitted for a disparity; 0 keeps it as measured, with a median
        /// error of 0.073 px instead of 0.069 px.
        pub straighten: usize = 4, in 0..=16;
        /// Least chance, 0 to 1, that a point is right within a pixel: others are not reported. 0 reports all; 0.98 covers
        /// 0.006 more and is wrong a sixteenth more often.
        pub score_least: f32 = 0.985, in 0..=1;
        /// Whether coarser channels fill in where finer ones have nothing. Without it 0.026 less is covered.
        pub fill_in: bool = true;
    }
    tables {
        /// How whole curves are matched.
        pub curves: CurveSettings;
        /// How points alone are matched.
        pub points: PointSettings;
    }
}

impl Settings {
    /// Whether R-tables are read, and not the index of points by row alone.
    pub fn reads_tables(&self) -> bool {
        self.assignment == Assignment::Curve && self.method != Method::Point
    }

    /// The constants of the thesis: curves are assigned, not points, orientations within 10°.
    pub fn thesis() -> Self {
        Self {
            reference: Reference::Left,
            assignment: Assignment::Curve,
            orientation_tolerance: 10.0,
            curves: CurveSettings::thesis(),
            points: PointSettings {
                initial_disparity: CurveSettings::thesis().initial_disparity,
                ..PointSettings::default()
            },
            ..Self::default()
        }
    }
}
