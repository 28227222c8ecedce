//! Why a recording cannot be read.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::metadata::MetadataError;
use crate::record::DecodeError;

/// Why a recording cannot be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// It cannot be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// There is nothing in it.
    #[error("{} is empty: its writer ended before the first scan", .0.display())]
    Empty(PathBuf),
    /// It is not MCAP.
    #[error("{} is not an MCAP file", .0.display())]
    NotMcap(PathBuf),
    /// Another program's recording.
    #[error(
        "{} is an MCAP file of another program ({library}), not a recording of tricurve; its topics: {topics}",
        path.display()
    )]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The program, as the file names it.
        library: String,
        /// Its topics.
        topics: String,
    },
    /// Recordings of different rigs or settings were written into one file.
    #[error(
        "{} holds {count} recordings of different {what}, which another program merged: read those it was made of",
        path.display()
    )]
    Mixed {
        /// The file.
        path: PathBuf,
        /// How many.
        count: usize,
        /// What they differ in.
        what: &'static str,
    },
    /// Its metadata were left out, and its messages do not say what is needed either.
    #[error(
        "{} has no metadata, which another program left out, and its messages do not say {what}: rewrite it with its metadata",
        path.display()
    )]
    Silent {
        /// The file.
        path: PathBuf,
        /// What they do not say.
        what: &'static str,
    },
    /// It does not say what is needed to read it.
    #[error("cannot read {}: {source}", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// What is missing.
        source: MetadataError,
    },
    /// What it holds is damaged.
    #[error("{} is damaged at byte {offset}: {source}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// What is wrong.
        source: mcap::McapError,
    },
    /// There is no such scan.
    #[error("there is no scan {scan} in the recording; it holds {held}")]
    NoScan {
        /// The scan.
        scan: u64,
        /// Which there are.
        held: String,
    },
    /// A scan has no message of this topic.
    #[error("scan {scan} has no {topic}")]
    NoMessage {
        /// The scan.
        scan: u64,
        /// The topic.
        topic: String,
    },
    /// A message is not what its topic says.
    #[error("{topic} of scan {scan}: {source}")]
    Message {
        /// The scan.
        scan: u64,
        /// The topic.
        topic: String,
        /// What is wrong.
        source: DecodeError,
    },
}
