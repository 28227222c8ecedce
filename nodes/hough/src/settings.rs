//! What can be set about the R-tables.

use serde::{Deserialize, Serialize};

/// What the vote of a point counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Weight {
    /// Every point the same: favours long visible perimeter.
    #[default]
    Unity,
    /// Its gradient magnitude, in means of the view: favours short prominent parts.
    Magnitude,
    /// A constant plus its gradient magnitude in means of the view.
    Combined,
    /// The curvature of its curve there, in means of the view: favours corners.
    Curvature,
}

messages::settings! {
    /// How curves become R-tables.
    pub struct Settings {
        /// What the vote of a point counts: `unity` (the thesis's choice, favours long visible perimeter), `magnitude`
        /// (favours short prominent parts), `combined` (a constant plus magnitude) or `curvature` (favours corners).
        /// Magnitude and curvature are in means of the view.
        pub weight: Weight = Weight::Unity;
        /// The constant of `combined`; with 1 it counts as much as the mean magnitude.
        pub constant: f32 = 1.0, in 0.0..=1000.0;
        /// Whether R-tables are made, and not the index of points by row alone; not given (null), where the graph's matcher
        /// reads them (`match.assignment` = curve). They are a twelfth of the CPU and an eleventh of a recording.
        pub tables: Option<bool> = None;
    }
}

impl Settings {
    /// The constants of the thesis.
    pub fn thesis() -> Self {
        Self {
            weight: Weight::Unity,
            constant: 1.0,
            tables: None,
        }
    }
}
