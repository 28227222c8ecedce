//! Settings of the replay node.

use messages::{Kind, Stage};

use crate::{Choice, replayed_kinds};

messages::settings! {
    /// What is replayed, and how fast.
    pub struct Settings {
        /// The recording; its further parts are found by their names.
        pub file: String = String::new();
        /// The first stage that computes anew; what the stages before it made is replayed.
        pub from: Stage = Stage::CAPTURE;
        /// Kinds of message of the stages before that the recording does not hold: they are not replayed.
        pub without: Vec<Kind> = Vec::new();
        /// The recording's scan to begin with.
        pub first: u64 = 0;
        /// The recording's scan before which to end; by default all are replayed.
        pub end: Option<u64> = None;
        /// How many scans before these are played too where they are there, since what is computed of these depends on them.
        pub before: u64 = 0, in 0..=1e6;
        /// Leave out scans that lack anything that was recorded of others, not only those that lack what is replayed.
        pub whole: bool = false;
        /// Times as fast as it was recorded; by default in lockstep, as fast as the graph goes.
        pub rate: Option<f64> = None, in 0.001..=1000.0;
        /// Begin again when the last scan is out; scans go on being numbered and dated.
        pub repeat: bool = false;
        /// Begin with a pause.
        pub paused: bool = false;
        /// How many scans may be under way at once; by itself eight, or as many as shared memory has room for.
        pub in_flight: Option<usize> = None, in 1..=30;
    }
}

impl Settings {
    /// The kinds of message that are replayed.
    pub fn kinds(&self) -> Vec<Kind> {
        let mut kinds = replayed_kinds(self.from);
        kinds.retain(|kind| !self.without.contains(kind));
        kinds
    }

    /// Which scans these select where these kinds of message are taken.
    pub fn choice(&self, taken: Vec<Kind>) -> Choice {
        Choice {
            from: self.from,
            taken,
            first: self.first,
            end: self.end,
            before: self.before,
            whole: self.whole,
        }
    }
}
