//! How a recording is written.

use messages::Kind;
use serde::{Deserialize, Serialize};

/// How chunks are compressed; every reader opens all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// Not at all.
    None,
    /// Fast: what hardly shrinks is left as it is.
    #[default]
    Lz4,
    /// Small.
    Zstd,
}

impl Compression {
    /// Its name in the file.
    pub(crate) fn mcap_name(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Lz4 => "lz4",
            Self::Zstd => "zstd",
        }
    }
}

messages::settings! {
    /// How a recording is written.
    pub struct Settings {
        /// Where to record; empty for a file named by the time in the folder recordings.
        pub file: String = String::new();
        /// Whether a recording that is there already is overwritten, with all its parts.
        pub overwrite: bool = false;
        /// `none`, `lz4` or `zstd`. Lists of sub-pixel places hardly shrink: lz4 packs the blocks that it halves, as
        /// pictures, and leaves the others as they are. Of a rendered scene's 13.8 MB that saves 7 %, zstd saves 32 %, and
        /// the writer works 1.2 and 6 times as long as without (measured on /dev/shm).
        pub compression: Compression = Compression::Lz4;
        /// Bytes after which a scan goes on in a new chunk: viewers that show images alone then read no more.
        pub chunk_bytes: u64 = 1_048_576, in 65_536..=1_073_741_824;
        /// Whether views for people are recorded too: curves over each image, the disparity picture in colours.
        pub views: bool = true;
        /// Whether curves that were not matched are recorded over each image too, by reason and with it in words, as
        /// `camera/VIEW/rejected`. Viewers of a running graph see them in any case.
        pub rejected: bool = false;
        /// Kinds of data that are left out: `edges`, `curves`, `tables` … What is left out cannot be replayed from.
        pub without: Vec<Kind> = Vec::new();
        /// Bytes of the disk that are left free: a scan that would take of them is not recorded any more. The recording
        /// then ends as it should, the graph goes on, and at the end it is said what is missing.
        pub leave_free: u64 = 200_000_000, in 0..=1e15;
        /// Bytes after which the next scan goes into a new part; without it size does not matter.
        pub max_bytes: Option<u64> = None, in 1_000_000..=1e12;
        /// Seconds of recorded time after which the next scan goes into a new part; without it time does not matter.
        pub max_seconds: Option<f64> = None, in 0.1..=1e9;
        /// Scans at the beginning that are not recorded: a replay plays them only because those after them depend on them.
        pub skip: u64 = 0, in 0..=1e15;
    }
}
