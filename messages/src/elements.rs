//! What the sections of messages consist of: zero-crossings, curves, R-tables, matches, points and what is said of them.

use bytemuck::{Pod, Zeroable};

use crate::row;
use crate::row::{Column, Number, Row};

/// A zero-crossing of ∇²G in one channel, with what is known about it.
///
/// The filter makes its numbers whole multiples of small steps, which floats hold exactly: what stands in shared memory is
/// what a recording holds in few bytes, to the bit.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Edge {
    /// Column, sub-pixel when the crossing lies between two columns, in 1/256.
    pub x: f32,
    /// Row, sub-pixel when the crossing lies between two rows, in 1/256; whole for a crossing along a row, and for no other.
    pub y: f32,
    /// Magnitude of the gradient there, in gray levels per pixel, in 1/256.
    pub magnitude: f32,
    /// Direction of the gradient, from dark to bright, in radians in (−π, π], 65,536 steps to the turn; 0 points to the
    /// right, π/2 down.
    pub orientation: f32,
    /// Gray levels beside the crossing, in its row, at [`Edge::PROFILE_OFFSETS`] columns from it; they follow from the view
    /// ([`profile`](crate::profile)).
    pub profile: [u8; 8],
}

impl Edge {
    /// Steps of place to a pixel. A point is matched to a fourteenth of a pixel; rounding adds a thousandth.
    pub const PIXEL_STEPS: u32 = 256;

    /// Steps of magnitude to a gray level per pixel: the largest there can be, 255, is below 65,536.
    pub const MAGNITUDE_STEPS: u32 = 256;

    /// Steps of orientation to half a turn.
    pub const HALF_TURN_STEPS: i32 = 32_768;

    /// The orientation of so many steps, from −32,767 to 32,768, in radians.
    #[inline(always)]
    pub fn orientation_of(steps: i32) -> f32 {
        // By a power of two, so that half a turn is π to the bit.
        steps as f32 * (std::f32::consts::PI / Self::HALF_TURN_STEPS as f32)
    }

    /// The whole number of steps that is nearest to an orientation in [−π, π]; −π is π.
    #[inline(always)]
    pub fn orientation_steps(orientation: f32) -> i32 {
        let half = Self::HALF_TURN_STEPS;
        let steps = whole(orientation * (half as f32 / std::f32::consts::PI));
        if steps <= -half { half } else { steps }
    }

    /// Where the samples of [`Edge::profile`] are taken, in columns from the crossing.
    pub const PROFILE_OFFSETS: [f32; 8] = [-6.0, -4.0, -2.5, -1.25, 1.25, 2.5, 4.0, 6.0];

    /// Whether this crossing was found along a row, so that its row is a whole number.
    pub fn is_in_row(&self) -> bool {
        self.y.fract() == 0.0
    }
}

/// A float of 2²³ and more has no parts left, and shows its units in its lowest bits; this one leaves room for negative
/// numbers.
const UNITS: f32 = 12_582_912.0;

/// The nearest whole number, of two the even one; right up to four million. Unlike rounding by name this does several at a
/// time on any machine.
#[inline(always)]
pub fn nearest(value: f32) -> f32 {
    (value + UNITS) - UNITS
}

/// The same as an integer, which unlike a cast does several at a time.
#[inline(always)]
pub fn whole(value: f32) -> i32 {
    ((value + UNITS).to_bits() as i32).wrapping_sub(UNITS.to_bits() as i32)
}

row! { "bytemuck";
    /// A curve: a run of points and what is common to them.
    pub struct Curve {
        /// The curve's number, its index in the list.
        pub label: u32,
        /// Index of its first point.
        pub first: u32,
        /// Number of its points.
        pub count: u32,
        /// Label of the curve it branches off, or [`NONE`](crate::NONE).
        pub parent: u32,
        /// Mean column of its points.
        pub x: f32,
        /// Mean row of its points.
        pub y: f32,
        /// Mean gradient magnitude of its points, in gray levels per pixel.
        pub magnitude: f32,
        /// Length along the curve, in pixels.
        pub length: f32,
    }
}

impl Curve {
    /// The curve's points.
    pub fn points<'a>(&self, points: &'a [Edge]) -> &'a [Edge] {
        &points[self.range()]
    }

    /// The indices of the curve's points.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + self.count as usize
    }
}

row! { "bytemuck";
    /// The R-table of one curve.
    pub struct Table {
        /// The curve's label.
        pub curve: u32,
        /// Index of its first entry.
        pub first: u32,
        /// Number of its entries.
        pub count: u32,
        /// Column of the reference point, the curve's centroid.
        pub x: f32,
        /// Row of the reference point.
        pub y: f32,
        /// Sum of the weights of its entries: what a perfect match would collect.
        pub weight: f32,
    }
}

row! { "bytemuck";
    /// One entry of an R-table; a table's entries are sorted by orientation.
    pub struct Entry {
        /// Orientation it is filed under, in radians.
        pub orientation: f32,
        /// Columns from the point to the reference point.
        pub rx: f32,
        /// Rows from the point to the reference point.
        pub ry: f32,
        /// What its vote counts.
        pub weight: f32,
        /// Index of the point among the view's curve points.
        pub point: u32,
    }
}

/// A curve of the reference view whose partners were found in the two other views.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Match {
    /// Labels of the three curves, left to right, on a rail the newest frame's first; [`NONE`](crate::NONE) of a view
    /// that took no part. Of more than three views those of [`Rig::named`](crate::Rig::named).
    pub curves: [u32; 3],
    /// Index of its first point.
    pub first: u32,
    /// Number of its points.
    pub count: u32,
    /// Votes collected by length, 0 to 1.
    pub score: f32,
    /// How far the closed loop misses its start, in pixels.
    pub residual: f32,
    /// Mean disparity in pixels.
    pub disparity: f32,
    /// Share of its neighbours in the graph that agree with it, 0 to 1.
    pub support: f32,
}

row! { "bytemuck";
    /// A point of a match, in the reference view.
    pub struct MatchPoint {
        /// Column.
        pub x: f32,
        /// Row.
        pub y: f32,
        /// Disparity between neighbouring views, in pixels.
        pub disparity: f32,
        /// Confidence, 0 to 1, higher is surer.
        pub score: f32,
        /// Index of the point among the reference view's curve points of this channel.
        pub point: u32,
        /// 0: seen in at least three views; 1: filled in along the curve.
        pub filled: u32,
    }
}

row! { "bytemuck";
    /// A curve of the reference view that was not matched.
    #[derive(Eq)]
    pub struct Rejected {
        /// Its label.
        pub curve: u32,
        /// Why, the code of a [`Reason`](crate::Reason).
        pub reason: u32,
    }
}

row! { "bytemuck";
    /// A point in space, in the reference camera's optical frame.
    pub struct Point {
        /// Metres to the right.
        pub x: f32,
        /// Metres down.
        pub y: f32,
        /// Metres forward.
        pub z: f32,
        /// Column in the reference view.
        pub u: f32,
        /// Row in the reference view.
        pub v: f32,
        /// Disparity between neighbouring views, in pixels.
        pub disparity: f32,
        /// Confidence, 0 to 1, higher is surer; of what was matched with `match.score_least` at least that.
        pub score: f32,
        /// Label of the reference view's curve in the point's channel.
        pub curve: u32,
        /// Index of the channel it comes from.
        pub channel: u32,
    }
}

row! { "bytemuck";
    /// A point that was seen from several places, in the frame of the rail.
    pub struct MapPoint {
        /// Metres to the right of where the rail begins.
        pub x: f32,
        /// Metres down.
        pub y: f32,
        /// Metres forward.
        pub z: f32,
        /// Standard deviation of its distance, in metres.
        pub sigma: f32,
        /// Disparity of a baseline, in pixels.
        pub disparity: f32,
        /// The best score of its sightings, 0 to 1, higher is surer.
        pub score: f32,
        /// Frames that saw it.
        pub sightings: u32,
    }
}

row! { "bytemuck";
    /// How points compare with the truth: those of the scan's result, or of one channel's matches.
    ///
    /// A point's error is the least difference to the truth of its row within two pixels: at an occluding contour a
    /// zero-crossing may lie on either surface.
    pub struct Score {
        /// Index of the channel, or [`NONE`](crate::NONE) for the scan's result.
        pub channel: u32,
        /// Edge pixels of the reference view (Canny) whose disparity is known.
        pub edges: u32,
        /// Those of them that have a point within one pixel.
        pub covered: u32,
        /// Points whose true disparity is known.
        pub points: u32,
        /// Points whose error exceeds half a pixel.
        pub over_half: u32,
        /// Points whose error exceeds one pixel.
        pub over_one: u32,
        /// Points whose error exceeds two pixels.
        pub over_two: u32,
        /// Points that differ by over two pixels from every truth within two rows and columns: false targets.
        pub mismatches: u32,
        /// Share of the edge pixels that are covered.
        pub coverage: f32,
        /// Share of the points whose error exceeds half a pixel.
        pub bad_half: f32,
        /// Share of the points whose error exceeds one pixel.
        pub bad_one: f32,
        /// Share of the points whose error exceeds two pixels.
        pub bad_two: f32,
        /// Median of the errors, in pixels.
        pub median: f32,
        /// Points whose error exceeds one pixel and that are on a level contour and right by one pixel within three rows: where
        /// rows are forgiven like columns these are no errors.
        pub forgiven_one: u32,
        /// The same by two pixels.
        pub forgiven_two: u32,
    }
}

impl Score {
    /// Share of the points whose error exceeds one pixel, rows forgiven like columns along level contours.
    pub fn bad_one_rows_too(&self) -> f32 {
        self.rows_too(self.over_one, self.forgiven_one)
    }

    /// The same of two pixels.
    pub fn bad_two_rows_too(&self) -> f32 {
        self.rows_too(self.over_two, self.forgiven_two)
    }

    fn rows_too(&self, over: u32, forgiven: u32) -> f32 {
        let left = f64::from(over.saturating_sub(forgiven));
        (left / f64::from(self.points.max(1))) as f32
    }
}

row! { "bytemuck";
    /// A point of the curve of error over coverage: what the surest points amount to.
    pub struct Share {
        /// Which share of all points is kept, the surest.
        pub share: f32,
        /// The least score of those kept.
        pub score: f32,
        /// Share of the edge pixels that they cover.
        pub coverage: f32,
        /// Share of them whose error exceeds one pixel.
        pub bad_one: f32,
    }
}

/// Rows some of whose members are lists, or are told twice: their columns are named by hand.
macro_rules! columns {
    ($type:ident, $about:literal: $($name:ident: $number:ident = $member:ident $(+ $skip:literal)?, $doc:literal;)+) => {
        impl Row for $type {
            const NAME: &'static str = stringify!($type);
            const ABOUT: &'static str = $about;
            const COLUMNS: &'static [Column] = &[$(Column {
                name: stringify!($name),
                about: $doc,
                offset: std::mem::offset_of!($type, $member) $(+ $skip)?,
                number: Number::$number,
            },)+];
        }
    };
}

columns! { Edge, "A zero-crossing of the Laplacian of Gaussian in one channel.":
    x: Float32 = x, "Column, in pixels.";
    y: Float32 = y, "Row, in pixels.";
    // 3-D panels want a height: the magnitude serves.
    z: Float32 = magnitude, "The magnitude again.";
    magnitude: Float32 = magnitude, "Magnitude of the gradient, in gray levels per pixel.";
    orientation: Float32 = orientation, "Direction of the gradient, from dark to bright, in radians.";
    profile_0: Uint8 = profile, "Gray level 6 columns to the left.";
    profile_1: Uint8 = profile + 1, "Gray level 4 columns to the left.";
    profile_2: Uint8 = profile + 2, "Gray level 2.5 columns to the left.";
    profile_3: Uint8 = profile + 3, "Gray level 1.25 columns to the left.";
    profile_4: Uint8 = profile + 4, "Gray level 1.25 columns to the right.";
    profile_5: Uint8 = profile + 5, "Gray level 2.5 columns to the right.";
    profile_6: Uint8 = profile + 6, "Gray level 4 columns to the right.";
    profile_7: Uint8 = profile + 7, "Gray level 6 columns to the right.";
}

columns! { Match, "A curve of the reference view and its partners in the two other views.":
    left_curve: Uint32 = curves, "Label of the left view's curve; 4294967295 where it took no part.";
    centre_curve: Uint32 = curves + 4, "Label of the centre view's curve.";
    right_curve: Uint32 = curves + 8, "Label of the right view's curve.";
    first: Uint32 = first, "Index of its first point.";
    count: Uint32 = count, "Number of its points.";
    score: Float32 = score, "Votes collected by length, 0 to 1.";
    residual: Float32 = residual, "How far the closed loop misses its start, in pixels.";
    disparity: Float32 = disparity, "Mean disparity, in pixels.";
    support: Float32 = support, "Share of its neighbours in the graph that agree with it, 0 to 1.";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_of_orientation_is_its_own_nearest_and_half_a_turn_is_pi() {
        for steps in -32_767..=32_768 {
            assert_eq!(Edge::orientation_steps(Edge::orientation_of(steps)), steps);
        }
        let pi = std::f32::consts::PI;
        assert_eq!(Edge::orientation_of(32_768), pi);
        assert_eq!(Edge::orientation_steps(-pi), 32_768);
        assert_eq!(Edge::orientation_of(0).to_bits(), 0);
    }
}
