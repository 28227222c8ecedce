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

/// By how much a frame of a rail is off from where an even motion would have put it.
///
/// What belongs at (x, y) from the middle of the picture is seen at (x + right + scale·x − turn·y, y + down + turn·x +
/// scale·y).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct Sway {
    /// Columns to the right.
    pub right_px: f64,
    /// Rows down.
    pub down_px: f64,
    /// Turn about the middle, in radians, clockwise as it is seen.
    pub turn: f64,
    /// By which part of itself the picture is larger.
    pub scale: f64,
}

impl Sway {
    /// Of a frame that is not off.
    pub const NONE: Self = Self {
        right_px: 0.0,
        down_px: 0.0,
        turn: 0.0,
        scale: 0.0,
    };

    /// Whether the frame is off at all.
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// By how many columns and rows what is seen at a column and row of a picture of this size is off.
    pub fn off(&self, size: Size, column: f64, row: f64) -> [f64; 2] {
        let x = column - (f64::from(size.width) - 1.0) / 2.0;
        let y = row - (f64::from(size.height) - 1.0) / 2.0;
        [
            self.right_px + self.scale * x - self.turn * y,
            self.down_px + self.turn * x + self.scale * y,
        ]
    }
}

impl std::ops::Sub for Sway {
    type Output = Self;

    /// By how much a frame is off beside another one that is off itself, to first order.
    fn sub(self, other: Self) -> Self {
        Self {
            right_px: self.right_px - other.right_px,
            down_px: self.down_px - other.down_px,
            turn: self.turn - other.turn,
            scale: self.scale - other.scale,
        }
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
    /// On a rail, by how much the frame is off; in every message of that frame.
    pub sway: Sway,
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
