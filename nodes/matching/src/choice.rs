//! What is chosen for a point: its disparity, and what speaks for it.

use messages::NONE;

/// A disparity chosen for a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// Disparity between neighbouring views, NaN for none.
    pub(crate) disparity: f32,
    /// What the candidate cost.
    pub(crate) cost: f32,
    /// How much dearer its cheapest rival is.
    pub(crate) margin: f32,
    /// How far the three columns are from one straight motion, in pixels.
    pub(crate) bend: f32,
    /// Spots in the near and the far view; [`NONE`] where it is not seen, both where filled in.
    pub(crate) spots: [u32; 2],
    /// The curves they belong to.
    pub(crate) curves: [u32; 2],
    /// Number of points in its run.
    pub(crate) run: u32,
    /// Share of its neighbours that agree.
    pub(crate) support: f32,
    /// How many they are, the near ones counting more.
    pub(crate) witnesses: f32,
    /// Whether it is part of a pattern whose next ones it is not told from.
    pub(crate) repeats: bool,
}

impl Choice {
    pub(crate) const NOTHING: Self = Self {
        disparity: f32::NAN,
        cost: f32::INFINITY,
        margin: 0.0,
        bend: 0.0,
        spots: [NONE; 2],
        curves: [NONE; 2],
        run: 0,
        support: 0.0,
        witnesses: 0.0,
        repeats: false,
    };

    /// Whether there is a disparity at all.
    pub(crate) fn is_some(&self) -> bool {
        !self.disparity.is_nan()
    }

    /// Whether it was seen in other views, and not filled in.
    pub(crate) fn is_seen(&self) -> bool {
        self.spots != [NONE; 2]
    }
}
