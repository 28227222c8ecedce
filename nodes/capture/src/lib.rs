//! Where scans come from.
//!
//! ```text
//! rendered scenes ─┐
//! a scene's folder ─┼─► Source ─► scan n, view v: size and pixels (and, where it is known, the truth)
//! folders of them ─┘       └────► calibration, names, notices
//!
//! cameras ─► Synchroniser ─► scans, as they come
//! ```
//!
//! A [`Source`] is opened once, which checks all that can be known before the start: every head of every image, sizes,
//! counts, the calibration. From then on [`Source::read`] gives any view of any scan, in any order and as often as
//! wanted, always the same bytes: what was lost with a node that died is simply read again.

pub mod alignment;
mod aside;
mod bag;
#[cfg(feature = "calibrate")]
pub mod calibrate;
mod calibration;
mod camera_info;
mod description;
mod error;
#[cfg(feature = "node")]
mod exposure;
mod folder;
mod image_file;
mod layout;
mod levels;
#[cfg(feature = "node")]
mod live;
pub mod look;
mod middlebury;
mod motion;
mod names;
#[cfg(feature = "node")]
pub mod node;
mod pace;
mod panels;
mod positions;
mod rail;
mod rectify;
mod scene;
mod sensor;
mod settings;
mod source;
mod sway;
pub mod synchronise;
mod truth;

pub use calibration::{Camera, Lens, of_residual};
pub use error::{LEAST_SIDE, MOST_PIXELS, SourceError};
pub use layout::{Layout, Piece};
pub use panels::Part;
pub use rectify::Map;
pub use settings::{LensModel, Mode, Settings, Views};
pub use source::{Place, Source};
pub use truth::Truth;
