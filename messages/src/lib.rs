//! What tricurve's nodes say to each other.
//!
//! ```text
//! plain types (this crate without features) ─► bus (shared memory, iceoryx2) ─► record (MCAP, Foxglove)
//! ```
//!
//! Everything a node computes is a pure function of plain types: [`Header`] says which scan, view and channel a
//! message belongs to, [`payload`] holds the one table of message kinds, [`topic`] the one list of topics that
//! recorder, replay and viewers walk. An algorithm depends on these only; the features `bus` and `record` add the
//! ways in and out of a process.
//!
//! Coordinates: pixels, x to the right, y down, (0, 0) is the centre of the top left pixel. Disparities are pixels
//! between *neighbouring* views and positive: a point at x in one view is at x − d in the next one to the right.

#[cfg(feature = "bus")]
pub mod bus;
pub mod calibration;
#[cfg(any(feature = "bus", feature = "record"))]
pub mod change;
pub mod clock;
pub mod contour;
pub mod contrast;
pub mod door;
pub mod header;
pub mod health;
pub mod ledger;
pub mod mixed;
pub mod payload;
pub mod profile;
pub mod reason;
#[cfg(feature = "record")]
pub mod record;
#[cfg(feature = "record")]
pub mod recording;
pub mod rig;
pub mod settings;
pub mod synchronisation;
pub mod topic;
pub mod words;

pub use calibration::Calibration;
pub use clock::Clock;
pub use contour::{Contour, ContourKind, ContourPoint};
pub use contrast::Contrast;
pub use header::{Header, NONE, Size, Sway};
pub use mixed::mixed;
pub use payload::{
    AnyView, Curve, Curves, CurvesRoom, CurvesView, Difference, Disparity, DisparityRoom,
    DisparityView, Edge, Edges, EdgesRoom, EdgesView, Entry, Evaluation, EvaluationRoom,
    EvaluationView, Growing, GrowingRoom, GrowingView, Image, ImageRoom, ImageView, List, Map,
    MapPoint, MapRoom, MapView, Match, MatchPoint, Matches, MatchesRoom, MatchesView, Message,
    Owned, Point, Points, PointsRoom, PointsView, Raw, RawRoom, RawView, Rejected, Score, Section,
    Share, Table, Tables, TablesRoom, TablesView, Truth, TruthRoom, TruthView,
};
pub use reason::Reason;
pub use rig::{Delivery, Rail, Reference, Rig, View};
pub use topic::{Kind, Stage, Topic};
