//! Images: `foxglove.RawImage`, as the memory they are.

use bytemuck::Pod;

use super::packed::append;
use super::{DecodeError, Head, Others, Recorded, check_size};
use crate::header::Size;
use crate::list::List;
use crate::payload::{Disparity, DisparityRoom, Image, ImageRoom, Raw, RawRoom, Truth, TruthRoom};
use crate::record::wire::{Fields, Fill};

pub(super) fn raw_image<T: Pod>(head: &Head<'_>, encoding: &str, pixels: &[T], out: &mut Vec<u8>) {
    let step = head.size.width * size_of::<T>() as u32;
    raw_image_head(head.nanos, head.frame, head.size, encoding, step, out);
    Fill(out).bytes(6, bytemuck::cast_slice(pixels));
}

/// A `foxglove.RawImage` up to its data, which is field 6.
pub(in crate::record) fn raw_image_head(
    nanos: u64,
    frame: &str,
    size: Size,
    encoding: &str,
    step: u32,
    out: &mut Vec<u8>,
) {
    let mut fill = Fill(out);
    fill.timestamp(1, nanos);
    fill.fixed32(2, size.width);
    fill.fixed32(3, size.height);
    fill.text(4, encoding);
    fill.fixed32(5, step);
    fill.text(7, frame);
}

fn read_raw_image<T: Pod>(
    bytes: &[u8],
    most: Size,
    encoding: &str,
    pixels: &mut List<'_, T>,
) -> Result<Size, DecodeError> {
    let (size, data) = raw_pixels::<T>(bytes, most, encoding)?;
    pixels.clear();
    append(data, pixels)?;
    Ok(size)
}

/// The memory of an image's pixels, and their size.
pub(super) fn raw_pixels<'a, T: Pod>(
    bytes: &'a [u8],
    most: Size,
    encoding: &str,
) -> Result<(Size, &'a [u8]), DecodeError> {
    let mut size = Size::default();
    let (mut step, mut said, mut data) = (0, &[][..], &[][..]);
    for field in Fields::new(bytes) {
        match field? {
            (2, value) => size.width = value.fixed32()?,
            (3, value) => size.height = value.fixed32()?,
            (4, value) => said = value.bytes()?,
            (5, value) => step = value.fixed32()?,
            (6, value) => data = value.bytes()?,
            _ => {}
        }
    }
    check_size(size, most)?;
    if said != encoding.as_bytes() {
        return Err(DecodeError::Layout("pixel encoding"));
    }
    if step as usize != size.width as usize * size_of::<T>() {
        return Err(DecodeError::Layout("row step"));
    }
    if data.len() != size.pixels() * size_of::<T>() {
        return Err(DecodeError::Layout("number of pixels"));
    }
    Ok((size, data))
}

/// Kinds of message that are an image and nothing else: the section it is in, and its encoding.
macro_rules! images {
    ($($kind:ident($room:ident) $section:ident $encoding:literal;)+) => {$(
        impl Recorded for $kind {
            fn read<'a>(
                bytes: &'a [u8],
                most: Size,
                _: Others<'_, 'a>,
                room: &mut $room<'_>,
            ) -> Result<Size, DecodeError> {
                read_raw_image(bytes, most, $encoding, &mut room.$section)
            }
        }
    )+};
}
images! {
    Image(ImageRoom) pixels "mono8";
    Raw(RawRoom) pixels "mono8";
    Truth(TruthRoom) disparity "32FC1";
    Disparity(DisparityRoom) disparity "32FC1";
}
