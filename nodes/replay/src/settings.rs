//! Settings of the replay node.

use messages::Stage;

use crate::Choice;

messages::settings! {
    /// What is replayed, and how fast.
    pub struct Settings {
        /// The recording; its further parts are found by their names.
        pub file: String = String::new();
        /// The first stage that computes anew; what the stages before it made is replayed.
        pub from: Stage = Stage::Capture;
        /// The recording's scan to begin with.
        pub first: u64 = 0;
        /// The recording's scan before which to end; by default all are replayed.
        pub end: Option<u64> = None;
        /// Leave out scans that lack anything that was recorded of others, not only those that lack what is replayed.
        pub whole: bool = false;
        /// Times as fast as it was recorded; by default in lockstep, as fast as the graph goes.
        pub rate: Option<f64> = None, in 0.001..=1000.0;
        /// Begin again when the last scan is out; scans go on being numbered and dated.
        pub repeat: bool = false;
        /// Begin with a pause.
        pub paused: bool = false;
        /// How many scans may be under way at once.
        pub in_flight: usize = 8, in 1..=30;
    }
}

impl Settings {
    /// Which scans these select.
    pub fn choice(&self) -> Choice {
        Choice {
            from: self.from,
            first: self.first,
            end: self.end,
            whole: self.whole,
        }
    }
}
