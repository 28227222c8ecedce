//! The settings of Marr and Poggio's points, in the graph file under `[match.points]`.

messages::settings! {
    /// How zero-crossings are matched one by one, where `method = "point"`.
    pub struct PointSettings in "points" {
        /// Points alone: the disparity expected in the coarsest channel, in pixels; by default all are searched.
        pub initial_disparity: Option<f32> = None, in 0..=4096;
        /// Points alone: central widths of the filter searched to either side of what the coarser channel knows. Within
        /// half of one false targets are rare, within one every other point has one (Marr and Poggio 1979).
        pub reach_widths: f32 = 1.0, in 0.1..=100;
        /// Points alone: share of the unambiguous matches around a point that must agree on one of its candidates.
        pub majority: f32 = 0.5, in 0..=1;
        /// Points alone: share of a region's points that must be matched, or all of them are dropped; 0 keeps all. Of
        /// unrelated images 70 % match by chance (Marr and Poggio 1979).
        pub matched_share: f32 = 0.7, in 0..=1;
    }
}
