//! Recordings as they lie on disk: what a file says about itself, its parts as one, and every scan's messages back out.
//!
//! ```text
//! art.mcap, art.1.mcap … ─► Contents ─► Recording ─► Scan ─► Codec::decode ─► Owned<X>, the same bytes
//! ```
//!
//! Who writes them is the node `record`; everybody who reads them, reads them here.

mod error;
mod file;
mod layout;
mod metadata;
mod names;
mod open;
mod part;
mod parts;
mod read;
mod rebuilt;
mod scan;
mod scans;
mod shelf;
mod sightings;

pub use error::ReadError;
pub use file::{Chunk, Contents, FileSchema, Group, MESSAGE_HEAD, RECORD_HEAD, Run};
pub use metadata::{
    Identity, Metadata, MetadataError, NAME, ScanOrder, changes_record, ledger_record,
};
pub use part::Part;
pub use parts::{count_parts, part_path, stray_parts};
pub use read::Recording;
pub use scan::Scan;
