//! Point clouds: `foxglove.PointCloud`, the rows as the memory they are.

use super::packed::{Packed, columns};
use super::{DecodeError, Head, Others, Recorded, check_size};
use crate::header::Size;
use crate::list::List;
use crate::payload::{Growing, GrowingRoom, Map, MapRoom, Points, PointsRoom};
use crate::record::Codec;
use crate::record::schema::{CLOUD_HEIGHT, CLOUD_WIDTH};
use crate::record::whole::Whole;
use crate::record::wire::Fill;
use crate::rig::Rail;
use crate::row::Row;

impl Codec {
    /// Appends the whole map so far, a `foxglove.PointCloud` in the rail's frame.
    pub(in crate::record) fn whole(
        &self,
        nanos: u64,
        size: Size,
        whole: &Whole,
        out: &mut Vec<u8>,
    ) {
        let head = Head {
            nanos,
            size,
            frame: Rail::FRAME,
        };
        cloud(&head, whole.spots(), out);
    }
}

pub(super) fn cloud<T: Row>(head: &Head<'_>, rows: &[T], out: &mut Vec<u8>) {
    let mut fill = Fill(out);
    fill.timestamp(1, head.nanos);
    fill.text(2, head.frame);
    // Some viewers take a missing pose amiss.
    fill.message(3, |pose| {
        pose.message(1, |_| {});
        pose.message(2, |orientation| orientation.double(4, 1.0));
    });
    fill.fixed32(4, size_of::<T>() as u32);
    columns::<T>(5, &mut fill);
    fill.fixed32(CLOUD_WIDTH, head.size.width);
    fill.fixed32(CLOUD_HEIGHT, head.size.height);
    fill.bytes(6, bytemuck::cast_slice(rows));
}

fn read_cloud<T: Row>(
    bytes: &[u8],
    most: Size,
    rows: &mut List<'_, T>,
) -> Result<Size, DecodeError> {
    let (packed, size) = Packed::of_cloud::<T>(bytes)?;
    check_size(size, most)?;
    rows.clear();
    packed.append(rows)?;
    Ok(size)
}

/// Kinds of message that are a cloud of points and nothing else.
macro_rules! clouds {
    ($($kind:ident($room:ident))+) => {$(
        impl Recorded for $kind {
            fn read<'a>(
                bytes: &'a [u8],
                most: Size,
                _: Others<'_, 'a>,
                room: &mut $room<'_>,
            ) -> Result<Size, DecodeError> {
                read_cloud(bytes, most, &mut room.points)
            }
        }
    )+};
}
clouds! { Points(PointsRoom) Map(MapRoom) Growing(GrowingRoom) }
