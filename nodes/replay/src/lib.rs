//! Recordings play the role of every stage before the cut.
//!
//! ```text
//! art.mcap ─► Selection ─► Clock ─► images, edges … as they were recorded ─► the stages after the cut
//! ```
//!
//! [`verify`] sits at the other end and compares what comes out with what was recorded.
//!
//! In lockstep, as fast as the door lets scans in; or at a rate, in the recording's own time.

#[cfg(feature = "node")]
pub mod node;
mod selection;
mod settings;
pub mod verify;

pub use selection::{Choice, Selection, SelectionError, check_cut, replayed_kinds};
pub use settings::Settings;
