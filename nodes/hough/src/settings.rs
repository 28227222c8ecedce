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
    /// A constant plus its magnitude.
    Combined,
    /// The curvature there, in means of the view: favours corners.
    Curvature,
}

messages::settings! {
    /// How curves become R-tables.
    pub struct Settings {
        /// What the vote of a point counts: `unity`, `magnitude`, `combined` or `curvature`.
        pub weight: Weight = Weight::Unity;
        /// The constant of `combined`; at 1 the constant and the mean magnitude count the same.
        pub constant: f32 = 1.0, in 0.0..=1000.0;
    }
}

impl Settings {
    /// The constants of the thesis.
    pub fn thesis() -> Self {
        Self {
            weight: Weight::Unity,
            constant: 1.0,
        }
    }
}
