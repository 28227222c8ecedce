//! The plain types as the recording describes them: name, place and type of every member.

use std::mem::offset_of;

use bytemuck::Pod;

use super::whole::Spot;
use crate::payload::{
    Curve, Edge, Entry, MapPoint, Match, MatchPoint, Point, Rejected, Score, Share, Table,
};

/// What a member is; the values are those of `foxglove.PackedElementField`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Number {
    Uint8 = 1,
    Uint32 = 5,
    Float32 = 7,
}

/// One member of a plain type.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    pub(super) name: &'static str,
    pub(super) offset: usize,
    pub(super) number: Number,
}

/// A plain type that stands in a recording, as packed memory or as a message of its own.
pub(super) trait Row: Pod {
    /// Its message's name.
    const NAME: &'static str;
    /// Its members. As a message of its own, the n-th member is field n + 1.
    const COLUMNS: &'static [Column];
}

macro_rules! row {
    ($type:ident { $($name:ident: $number:ident = $member:ident $(+ $skip:literal)?,)+ }) => {
        impl Row for $type {
            const NAME: &'static str = stringify!($type);
            const COLUMNS: &'static [Column] = &[$(Column {
                name: stringify!($name),
                offset: offset_of!($type, $member) $(+ $skip)?,
                number: Number::$number,
            },)+];
        }
    };
}

row! { Edge {
    x: Float32 = x,
    y: Float32 = y,
    // 3-D panels want a height: the magnitude serves.
    z: Float32 = magnitude,
    magnitude: Float32 = magnitude,
    orientation: Float32 = orientation,
    profile_0: Uint8 = profile,
    profile_1: Uint8 = profile + 1,
    profile_2: Uint8 = profile + 2,
    profile_3: Uint8 = profile + 3,
    profile_4: Uint8 = profile + 4,
    profile_5: Uint8 = profile + 5,
    profile_6: Uint8 = profile + 6,
    profile_7: Uint8 = profile + 7,
} }

row! { Curve {
    label: Uint32 = label,
    first: Uint32 = first,
    count: Uint32 = count,
    parent: Uint32 = parent,
    x: Float32 = x,
    y: Float32 = y,
    magnitude: Float32 = magnitude,
    length: Float32 = length,
} }

row! { Table {
    curve: Uint32 = curve,
    first: Uint32 = first,
    count: Uint32 = count,
    x: Float32 = x,
    y: Float32 = y,
    weight: Float32 = weight,
} }

row! { Entry {
    orientation: Float32 = orientation,
    rx: Float32 = rx,
    ry: Float32 = ry,
    weight: Float32 = weight,
    point: Uint32 = point,
} }

row! { Match {
    left_curve: Uint32 = curves,
    centre_curve: Uint32 = curves + 4,
    right_curve: Uint32 = curves + 8,
    first: Uint32 = first,
    count: Uint32 = count,
    score: Float32 = score,
    residual: Float32 = residual,
    disparity: Float32 = disparity,
    support: Float32 = support,
} }

row! { MatchPoint {
    x: Float32 = x,
    y: Float32 = y,
    disparity: Float32 = disparity,
    score: Float32 = score,
    point: Uint32 = point,
    filled: Uint32 = filled,
} }

row! { Rejected {
    curve: Uint32 = curve,
    reason: Uint32 = reason,
} }

row! { Point {
    x: Float32 = x,
    y: Float32 = y,
    z: Float32 = z,
    u: Float32 = u,
    v: Float32 = v,
    disparity: Float32 = disparity,
    score: Float32 = score,
    curve: Uint32 = curve,
    channel: Uint32 = channel,
} }

row! { MapPoint {
    x: Float32 = x,
    y: Float32 = y,
    z: Float32 = z,
    sigma: Float32 = sigma,
    disparity: Float32 = disparity,
    score: Float32 = score,
    sightings: Uint32 = sightings,
} }

row! { Spot {
    x: Float32 = x,
    y: Float32 = y,
    z: Float32 = z,
    sigma: Float32 = sigma,
    disparity: Float32 = disparity,
} }

row! { Score {
    channel: Uint32 = channel,
    edges: Uint32 = edges,
    covered: Uint32 = covered,
    points: Uint32 = points,
    over_half: Uint32 = over_half,
    over_one: Uint32 = over_one,
    over_two: Uint32 = over_two,
    mismatches: Uint32 = mismatches,
    coverage: Float32 = coverage,
    bad_half: Float32 = bad_half,
    bad_one: Float32 = bad_one,
    bad_two: Float32 = bad_two,
    median: Float32 = median,
    forgiven_one: Uint32 = forgiven_one,
    forgiven_two: Uint32 = forgiven_two,
} }

row! { Share {
    share: Float32 = share,
    score: Float32 = score,
    coverage: Float32 = coverage,
    bad_one: Float32 = bad_one,
} }

#[cfg(test)]
mod tests {
    use super::*;

    /// Every byte of the type is told by a column.
    fn tells_all<T: Row>() {
        let mut told = vec![0; size_of::<T>()];
        for column in T::COLUMNS {
            let bytes = if column.number == Number::Uint8 { 1 } else { 4 };
            told[column.offset..][..bytes].fill(1);
        }
        assert!(told.iter().all(|&byte| byte == 1), "{}", T::NAME);
    }

    #[test]
    fn the_columns_tell_every_byte_of_their_type() {
        tells_all::<Edge>();
        tells_all::<Curve>();
        tells_all::<Table>();
        tells_all::<Entry>();
        tells_all::<Match>();
        tells_all::<MatchPoint>();
        tells_all::<Rejected>();
        tells_all::<Point>();
        tells_all::<MapPoint>();
        tells_all::<Spot>();
        tells_all::<Score>();
        tells_all::<Share>();
    }

    /// As a message of its own, word n of the type is field n + 1.
    fn is_words<T: Row>() {
        let offsets: Vec<usize> = T::COLUMNS.iter().map(|c| c.offset).collect();
        let words: Vec<usize> = (0..size_of::<T>()).step_by(4).collect();
        assert_eq!(offsets, words, "{}", T::NAME);
        assert!(
            T::COLUMNS.iter().all(|c| c.number != Number::Uint8),
            "{}",
            T::NAME
        );
    }

    #[test]
    fn types_with_messages_of_their_own_are_words_in_order() {
        is_words::<Curve>();
        is_words::<Table>();
        is_words::<Match>();
        is_words::<Rejected>();
        is_words::<Score>();
        is_words::<Share>();
    }
}
