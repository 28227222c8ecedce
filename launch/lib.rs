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

mod chain;
mod pipeline;

pub use messages::{self, message};
pub use messages::{Calibration, MatchPoint, MatchesView, Point, Rig, Size};
pub use pipeline::{Found, Pipeline, PipelineError, Settings};

/// The settings of each stage.
pub mod settings {
    pub use filter::Settings as Filter;
    pub use hough::Settings as Hough;
    pub use matching::Settings as Matching;
    pub use track::Settings as Track;
}

/// Writes the settings of a node of one's own: each line a key with its meaning, type, default and, for numbers, range. What
/// is wrong in a graph file is refused with that in words.
///
/// ```
/// tricurve::settings! {
///     /// What counts as strong.
///     pub struct Settings {
///         /// Gray levels per pixel from which on a zero-crossing is strong.
///         pub strong: f32 = 8.0, in 0..=255;
///     }
/// }
/// assert_eq!(Settings::default().strong, 8.0);
/// ```
#[macro_export]
macro_rules! settings {
    ($($table:tt)+) => {
        $crate::messages::settings! { $($table)+ }
    };
}

/// Writes the type of a row of a message of one's own: a struct of `f32` and `u32`, each member with its meaning and unit,
/// which recordings and viewers are told.
///
/// ```
/// tricurve::row! {
///     /// Zero-crossings of about one strength.
///     pub struct Class {
///         /// The least of their magnitudes, in gray levels per pixel.
///         pub least: f32,
///         /// How many there are.
///         pub count: u32,
///     }
/// }
/// tricurve::message! {
///     /// How strong the zero-crossings of a view are.
///     pub Histogram, HistogramView, HistogramRoom
///         = "histogram" by "histogram" from [tricurve::messages::Kind::Edges] per [view, channel] {
///         /// Weakest first.
///         classes: Class = |_size| 8,
///     }
/// }
/// ```
#[macro_export]
macro_rules! row {
    ($($row:tt)+) => {
        $crate::messages::row! { "::tricurve::messages::bytemuck"; $($row)+ }
    };
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
pub use program::whole_graph;
#[cfg(feature = "program")]
pub(crate) use program::{Failure, Outcome};
#[cfg(feature = "program")]
pub use registry::{App, NodeType};
