//! Every topic into MCAP, and back out.
//!
//! ```text
//! samples of a scan ─► Encoder ─► Batch ─► WriterThread ─► art.mcap, art.1.mcap …
//!                                                              │
//!                       info, export, report, replay ◄─ Recording ◄────┘
//! ```
//!
//! A scan is encoded on the node's thread, and compressed, written and flushed on another: when its
//! [`Report`] comes back, no death of the process loses it. What a dead writer leaves behind is finished by
//! [`seal`]; [`Recording`] reads it either way.

#[cfg(feature = "node")]
mod attach;
mod batch;
mod chunk;
mod compact;
mod compare;
mod export;
mod info;
mod map;
#[cfg(feature = "node")]
pub mod node;
pub mod rehydrate;
mod report;
mod rewrite;
mod seal;
mod settings;
mod sink;
mod summary;
mod thesis;
mod thread;
mod writer;

pub use messages::recording::{Metadata, MetadataError, ReadError, Recording, Scan, part_path};

#[cfg(feature = "node")]
pub use attach::{Attach, AttachError, Attached, Wish, attach};
pub use batch::{Batch, encoder, taken_kinds};
pub use compare::{
    Agreement, CompareError, Comparison, Mapped, Partners, Shared, Time, Truth, Verdict, compare,
    side_by_side,
};
pub use export::{CSV_HEADER, Export, ExportError, Exported, export, whole};
pub use info::{Info, PartInfo, ScansInfo, TopicInfo};
pub use messages::record::{Encoder, Sink};
pub use report::{
    Known, MEASURED, MOST_SCENES, Mismatches, Page, ReportError, Reported, Rivals, report,
    settings_in_lines, shown, thesis,
};
pub use rewrite::{RewriteError, Rewritten, Split, Wanted, read_and_written, rewrite};
pub use seal::{SealError, Sealed, seal};
pub use settings::{Compression, Keep, Settings};
pub use thesis::objects;
pub use thread::{Report, WriterThread, spawn};
pub use writer::{WriteError, Writer, Written};

#[cfg(test)]
extern crate self as record;

#[cfg(test)]
#[path = "../tests/synthetic/mod.rs"]
mod synthetic;
