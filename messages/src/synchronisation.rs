//! How well the frames of several cameras fall together in time: every frame is accounted for.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

/// Between which offsets frames are counted together, in milliseconds: before the first, between two neighbours, after
/// the last.
pub const OFFSET_BOUNDS_MS: [f64; 16] = [
    -50.0, -20.0, -10.0, -5.0, -2.0, -1.0, -0.5, -0.1, 0.1, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0,
];

/// What came of the frames of all cameras so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Synchronisation {
    /// Scans made of one frame of every camera.
    pub scans: u64,
    /// How far from the reference camera's frame the others' may be, in milliseconds.
    pub tolerance_ms: f64,
    /// The tolerance by which 99 of 100 would have become scans, of those of the reference camera's frames that have a
    /// frame of their own in every other camera; in milliseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance_for_99_ms: Option<f64>,
    /// The offsets between which [`CameraAccount::offsets`] counts, in milliseconds.
    pub bounds_ms: Vec<f64>,
    /// The camera by whose frames the others' are chosen.
    pub reference: String,
    /// Each camera, in the order of the views.
    pub cameras: Vec<CameraAccount>,
    /// Why no scans come at the moment, where none do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// What came of one camera's frames: received = matched + late + dropped + waiting.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraAccount {
    /// The view.
    pub name: String,
    /// Frames that came.
    pub received: u64,
    /// Frames that became part of a scan.
    pub matched: u64,
    /// Frames that came after a later one of the same camera.
    pub late: u64,
    /// Frames that became part of no scan, by cause.
    pub dropped: BTreeMap<String, u64>,
    /// Frames of which it is not known yet.
    pub waiting: u64,
    /// Frames the camera itself says to have lost; they never came.
    #[serde(default)]
    pub lost: u64,
    /// How often it vanished and returned.
    #[serde(default)]
    pub returns: u64,
    /// How many of its frames nearest to one of the reference camera came how much later than that.
    pub offsets: Vec<u64>,
    /// Half of the latest ones came at most this much later than the reference camera's, in milliseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub median_ms: Option<f64>,
}

impl CameraAccount {
    /// Whether every frame is accounted for.
    pub fn is_balanced(&self) -> bool {
        self.received == self.matched + self.late + self.dropped() + self.waiting
    }

    /// Frames that became part of no scan.
    pub fn dropped(&self) -> u64 {
        self.dropped.values().sum()
    }
}

/// As a table, a line a camera, and what the tolerance should have been.
impl fmt::Display for Synchronisation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<10} {:>9} {:>9} {:>9} {:>9} {:>9}   offset ms",
            "camera", "received", "matched", "late", "dropped", "waiting"
        )?;
        for camera in &self.cameras {
            let median = match camera.median_ms {
                _ if camera.name == self.reference => "reference".to_owned(),
                Some(median) => format!("{median:+.1}"),
                None => "-".to_owned(),
            };
            write!(
                f,
                "{:<10} {:>9} {:>9} {:>9} {:>9} {:>9}   {median}",
                camera.name,
                camera.received,
                camera.matched,
                camera.late,
                camera.dropped(),
                camera.waiting
            )?;
            for (cause, count) in &camera.dropped {
                write!(f, "; {count}: {cause}")?;
            }
            if camera.lost > 0 {
                write!(f, "; {} lost by the camera itself", camera.lost)?;
            }
            if camera.returns > 0 {
                write!(f, "; returned {} times", camera.returns)?;
            }
            writeln!(f)?;
        }
        let tolerance = self.tolerance_ms;
        match self.tolerance_for_99_ms {
            Some(needed) => writeln!(
                f,
                "tolerance {tolerance} ms; {needed:.1} ms would have matched 99 % of what has a partner"
            ),
            None => writeln!(f, "tolerance {tolerance} ms"),
        }?;
        match &self.why {
            Some(why) => writeln!(f, "no scans: {why}"),
            None => Ok(()),
        }
    }
}
