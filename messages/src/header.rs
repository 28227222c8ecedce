//! Who a message is: scan, view, channel, time, place.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Stands for "does not apply" in [`Header::view`], [`Header::channel`] and in every index.
pub const NONE: u32 = u32::MAX;

/// Width and height of an image in pixels.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
)]
pub struct Size {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Size {
    /// A size from columns and rows.
    pub const fn new(width: u32, height: u32) -> Self {
        Self { width, height }
    }

    /// The number of pixels.
    pub const fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The smallest size that holds both.
    pub fn union(self, other: Self) -> Self {
        Self::new(self.width.max(other.width), self.height.max(other.height))
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// The head of every message.
///
/// A message is identified by its topic and [`sequence`](Self::sequence): results are pure functions of inputs and
/// configuration, so making one twice gives the same bytes. The last two fields belong to the transport: they vary
/// from run to run and are never recorded with the message.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Header {
    /// Scan number, from 0 without gaps.
    pub sequence: u64,
    /// When the scan was taken, in nanoseconds since 1970; set once by capture.
    pub capture_nanos: u64,
    /// Where the view's camera stands along the baseline, in metres; on a rail where it stood when the frame was taken,
    /// in every message of that frame.
    pub position_m: f64,
    /// Index of the view, left to right, or [`NONE`].
    pub view: u32,
    /// Index of the channel, coarse to fine, or [`NONE`].
    pub channel: u32,
    /// Columns of the image this came from.
    pub width: u32,
    /// Rows of the image this came from.
    pub height: u32,
    /// Elements in each section of the payload.
    pub lens: [u32; 4],
    /// Transport: every scan below this number is done everywhere, and so is every scan that depends on it.
    pub done_below: u64,
    /// Transport: nanoseconds its maker spent on it.
    pub elapsed_nanos: u64,
}

impl Header {
    /// The head of a message of this scan, with every other field zero or [`NONE`].
    pub fn new(sequence: u64, capture_nanos: u64, size: Size) -> Self {
        Self {
            sequence,
            capture_nanos,
            width: size.width,
            height: size.height,
            view: NONE,
            channel: NONE,
            ..Self::zeroed()
        }
    }

    /// The image size.
    pub const fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }
}

impl Default for Header {
    fn default() -> Self {
        Self::new(0, 0, Size::default())
    }
}
