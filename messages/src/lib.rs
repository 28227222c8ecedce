//! What tricurve's nodes say to each other.
//!
//! ```text
//! plain types (this crate without features) ─► bus (shared memory, iceoryx2) ─► record (MCAP, Foxglove)
//! ```
//!
//! Everything a node computes is a pure function of plain types: [`Header`] says which scan, view and channel a
//! message belongs to, [`payload`] holds the one table of message kinds ([`message!`] defines them, those of others
//! too), [`topic`] the one list of topics that recorder, replay and viewers walk. An algorithm depends on these only; the features `bus` and `record` add the
//! ways in and out of a process.
//!
//! Coordinates: pixels, x to the right, y down, (0, 0) is the centre of the top left pixel. Disparities are pixels
//! between *neighbouring* views and positive: a point at x in one view is at x − d in the next one to the right.

/// What the macros need: what makes rows plain data, and settings text.
#[doc(hidden)]
pub use {bytemuck, serde};

#[cfg(feature = "bus")]
pub mod bus;
pub mod calibration;
#[cfg(any(feature = "bus", feature = "record"))]
pub mod change;
pub mod clock;
pub mod contour;
pub mod contrast;
pub mod door;
pub mod elements;
pub mod header;
pub mod health;
pub mod ledger;
pub mod list;
pub mod message;
pub mod mixed;
pub mod other;
#[macro_use]
pub mod payload;
pub mod profile;
pub mod reason;
#[cfg(feature = "record")]
pub mod record;
#[cfg(feature = "record")]
pub mod recording;
pub mod rig;
pub mod row;
pub mod settings;
pub mod synchronisation;
pub mod topic;
pub mod words;

pub use calibration::Calibration;
pub use clock::Clock;
pub use contour::{Contour, ContourKind, ContourPoint};
pub use contrast::Contrast;
pub use elements::{
    Curve, Edge, Entry, MapPoint, Match, MatchPoint, Point, Rejected, Score, Share, Table,
};
pub use header::{Header, NONE, Size, Sway};
pub use list::List;
pub use message::{Definition, Difference, Message, Owned, SECTIONS, Section, SectionType};
pub use mixed::mixed;
pub use other::{Other, OtherView, RegisterError, register};
pub use payload::{
    AnyView, Curves, CurvesRoom, CurvesView, Disparity, DisparityRoom, DisparityView, Edges,
    EdgesRoom, EdgesView, Evaluation, EvaluationRoom, EvaluationView, Growing, GrowingRoom,
    GrowingView, Image, ImageRoom, ImageView, Kind, Map, MapRoom, MapView, Matches, MatchesRoom,
    MatchesView, Points, PointsRoom, PointsView, Raw, RawRoom, RawView, Tables, TablesRoom,
    TablesView, Truth, TruthRoom, TruthView,
};
pub use reason::Reason;
pub use rig::{Delivery, Rail, Reference, Rig, View};
pub use topic::{Stage, Topic};
