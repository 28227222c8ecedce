//! tricurve: depth on the edges of a scene, from three or more views at equal steps.
//!
//! [`Pipeline`] is the whole chain in one process: images in, points out.
//!
//! ```text
//! images ─► filter (∇²G, zero-crossings) ─► track (curves) ─► hough (tables) ─► match (three views and more) ─► points
//! ```
//!
//! With the feature `program`, which is on by default, this crate is the program `tricurve` as well: it runs the same
//! stages as processes that exchange frames in shared memory, records them, plays them back and shows them. A library user
//! turns it off and pulls neither bus nor recordings nor a command line:
//!
//! ```toml
//! tricurve = { path = "…", default-features = false }
//! ```

mod pipeline;

pub use messages::{Calibration, MatchPoint, MatchesView, Point, Rig, Size};
pub use pipeline::{Found, Pipeline, PipelineError, Settings};

/// The settings of each stage.
pub mod settings {
    pub use filter::Settings as Filter;
    pub use hough::Settings as Hough;
    pub use matching::Settings as Matching;
    pub use track::Settings as Track;
}

/// Says a line to the user on standard error. A terminal that is gone is no reason to fail: the run still has to end in
/// good order.
#[cfg(feature = "program")]
macro_rules! say {
    ($($line:tt)*) => {{
        use std::io::Write as _;
        let line = format!($($line)*) + "\n";
        let mut err = std::io::stderr().lock();
        let folded = $crate::fold::folded(&line, &err);
        err.write_all(folded.as_bytes()).unwrap_or_default();
    }};
}
#[cfg(feature = "program")]
pub(crate) use say;

#[cfg(feature = "program")]
mod asks;
#[cfg(feature = "program")]
mod cli;
#[cfg(feature = "program")]
mod commands;
#[cfg(feature = "program")]
mod fold;
#[cfg(feature = "program")]
mod former;
#[cfg(feature = "program")]
mod graph;
#[cfg(feature = "program")]
mod instances;
#[cfg(feature = "program")]
mod keys;
#[cfg(feature = "program")]
mod launcher;
#[cfg(feature = "program")]
mod layout;
#[cfg(feature = "program")]
mod look;
#[cfg(feature = "program")]
mod node;
#[cfg(feature = "program")]
mod offline;
#[cfg(feature = "program")]
mod open_files;
#[cfg(feature = "program")]
mod parameters;
#[cfg(feature = "program")]
mod profile;
#[cfg(feature = "program")]
mod program;
#[cfg(feature = "program")]
mod progress;
#[cfg(feature = "program")]
mod registry;
#[cfg(feature = "program")]
mod rundir;
#[cfg(feature = "program")]
mod running;
#[cfg(feature = "program")]
mod said;
#[cfg(feature = "program")]
mod shared_memory;
#[cfg(feature = "program")]
mod signals;
#[cfg(feature = "program")]
mod snapshot;
#[cfg(feature = "program")]
mod supervisor;

#[cfg(feature = "program")]
pub(crate) use program::{Failure, Outcome};
#[cfg(feature = "program")]
pub use program::{main, whole_graph};
