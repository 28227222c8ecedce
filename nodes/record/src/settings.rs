//! How a recording is written.

use messages::record::Content;
use messages::{Kind, Stage};
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

/// How much of a run is recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// Every topic.
    #[default]
    All,
    /// What comes out at the end.
    Results,
    /// What everything else can be computed from, and digests to know that it is the same.
    Proof,
}

impl Keep {
    /// Whether it records what a channel carries.
    pub(crate) fn keeps(self, content: &Content) -> bool {
        match (self, content) {
            (_, Content::Data(topic)) => self.keeps_kind(topic.kind),
            (_, Content::Digests) => self == Self::Proof,
            // Without an image there is nothing that curves could be drawn over.
            (_, Content::Annotations(_) | Content::Labels(_) | Content::Rejected(_)) => {
                self == Self::All
            }
            (_, Content::Picture(_) | Content::Legend(_) | Content::Whole) => self != Self::Proof,
            (
                _,
                Content::Transforms
                | Content::Calibration(_)
                | Content::Statistics
                | Content::Ledger
                | Content::Health
                | Content::Synchronisation
                | Content::Log,
            ) => true,
        }
    }

    /// Whether it records data of this kind. Of the results a proof holds those that are small: points and matches, which
    /// say the same once more, are larger than the images they are computed from.
    fn keeps_kind(self, kind: Kind) -> bool {
        let is_small = matches!(kind, Kind::Disparity | Kind::Map | Kind::Evaluation);
        match self {
            Self::All => true,
            Self::Results => kind.stage().follows(Stage::MATCH) || matches!(kind, Kind::Other(_)),
            Self::Proof => kind.stage() == Stage::CAPTURE || is_small,
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
        /// How much is kept: `all`; `results`, which are matches, disparities, points, map and evaluation, without images and
        /// what lies between; or `proof`, which is images, truth, disparities, map and evaluation, and of every other message
        /// its digest: `tricurve rehydrate` computes the rest anew and checks it. Of a rendered scene a scan takes 7.6, 3.5
        /// and 0.9 MB.
        pub keep: Keep = Keep::All;
        /// `none`, `lz4` or `zstd`; automatic is `lz4`, of a proof, which is mostly pictures, `zstd`. Lists of sub-pixel places hardly shrink: lz4 packs the blocks that it halves, as
        /// pictures, and leaves the others as they are. Of a rendered scene's 11.4 MB that saves 33 %, zstd saves 51 %, and
        /// the writer works 1.2 and 6 times as long as without (measured on /dev/shm).
        pub compression: Option<Compression> = None;
        /// Bytes after which a scan goes on in a new chunk: viewers that show images alone then read no more.
        pub chunk_bytes: u64 = 1_048_576, in 65_536..=1_073_741_824;
        /// Whether views for people are recorded too: curves over each image, the disparity picture in colours.
        pub views: bool = true;
        /// Whether pictures of the points' errors, where the source knows a truth, and of their confidence are recorded too, as
        /// `disparity/error` and `disparity/confidence`. Viewers of a running graph see them in any case.
        pub inspected: bool = false;
        /// Whether what can be said of matched curves is recorded over each image too, as `camera/VIEW/labels`: number,
        /// score and disparity of the longest ones. Viewers of a running graph see them in any case.
        pub labels: bool = false;
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

impl Settings {
    /// How chunks are compressed.
    pub fn compression(&self) -> Compression {
        let automatic = match self.keep {
            Keep::All | Keep::Results => Compression::Lz4,
            Keep::Proof => Compression::Zstd,
        };
        self.compression.unwrap_or(automatic)
    }

    /// Whether data of this kind is recorded where it is made.
    pub fn holds(&self, kind: Kind) -> bool {
        self.keep.keeps_kind(kind) && !self.without.contains(&kind)
    }

    /// Why these settings make no sense where these kinds of message are made.
    pub fn refused(&self, made: &[Kind]) -> Option<String> {
        let is_made = |kind: &Kind| made.contains(kind) && !self.without.contains(kind);
        match self.keep {
            Keep::Proof if !is_made(&Kind::Image) => Some(
                "record.keep = proof computes everything from the images, and they are left out: record them too, or set \
                 record.keep = results"
                    .to_owned(),
            ),
            Keep::Results if !Kind::all().any(|kind| is_made(&kind) && self.holds(kind)) => Some(
                "record.keep = results keeps matches, disparities, points, map and evaluation, and there are none of them: \
                 set record.keep = all"
                    .to_owned(),
            ),
            _ => None,
        }
    }
}
