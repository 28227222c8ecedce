//! Rows as messages, word by word, and rows as the memory they are with their layout beside it.

use bytemuck::Pod;

use super::{DecodeError, within};
use crate::header::Size;
use crate::list::List;
use crate::record::plain;
use crate::record::schema::{CLOUD_HEIGHT, CLOUD_WIDTH};
use crate::record::wire::{Fields, Fill, Value, varint_len};
use crate::row::{Column, Row};

pub(super) fn messages<T: Row>(field: u32, rows: &[T], out: &mut Vec<u8>) {
    plain::write_rows(field, size_of::<T>(), bytemuck::cast_slice(rows), out);
}

pub(super) fn read_message<T: Row>(
    bytes: &[u8],
    rows: &mut List<'_, T>,
) -> Result<(), DecodeError> {
    rows.push(row_of_message(bytes)?);
    within(rows.refused())
}

pub(super) fn row_of_message<T: Row>(bytes: &[u8]) -> Result<T, DecodeError> {
    let mut row = T::zeroed();
    plain::read_row(bytes, bytemuck::bytes_of_mut(&mut row))?;
    Ok(row)
}

// ---- rows as packed memory ----

pub(super) fn packed<T: Row>(field: u32, rows: &[T], out: &mut Vec<u8>) {
    let data: &[u8] = bytemuck::cast_slice(rows);
    let described: usize = T::COLUMNS.iter().map(|column| 2 + column_len(column)).sum();
    let mut fill = Fill(out);
    fill.open(
        field,
        described + 5 + 1 + varint_len(data.len() as u64) + data.len(),
    );
    columns::<T>(1, &mut fill);
    fill.fixed32(2, size_of::<T>() as u32);
    fill.bytes(3, data);
}

/// A `foxglove.PackedElementField` for every column.
pub(super) fn columns<T: Row>(field: u32, fill: &mut Fill<'_>) {
    for column in T::COLUMNS {
        fill.open(field, column_len(column));
        fill.text(1, column.name);
        fill.fixed32(2, column.offset as u32);
        fill.varint(3, column.number as u64);
    }
}

fn column_len(column: &Column) -> usize {
    (2 + column.name.len()) + 5 + 2
}

pub(super) fn read_packed<T: Row>(bytes: &[u8], rows: &mut List<'_, T>) -> Result<(), DecodeError> {
    Packed::read::<T>(bytes)?.append(rows)
}

/// Packed memory and its description, as far as read.
#[derive(Default)]
pub(super) struct Packed<'a> {
    pub(super) columns: usize,
    stride: u32,
    pub(super) data: &'a [u8],
}

impl<'a> Packed<'a> {
    /// Reads a `tricurve.Packed`.
    pub(super) fn read<T: Row>(bytes: &'a [u8]) -> Result<Self, DecodeError> {
        let mut packed = Self::default();
        for field in Fields::new(bytes) {
            match field? {
                (1, value) => packed.column::<T>(value.bytes()?)?,
                (2, value) => packed.stride = value.fixed32()?,
                (3, value) => packed.data = value.bytes()?,
                _ => {}
            }
        }
        packed.check::<T>()
    }

    /// Reads a `foxglove.PointCloud`, and the image size it says.
    pub(super) fn of_cloud<T: Row>(bytes: &'a [u8]) -> Result<(Self, Size), DecodeError> {
        let mut size = Size::default();
        let mut packed = Self::default();
        for field in Fields::new(bytes) {
            match field? {
                (4, value) => packed.stride = value.fixed32()?,
                (5, value) => packed.column::<T>(value.bytes()?)?,
                (6, value) => packed.data = value.bytes()?,
                (CLOUD_WIDTH, value) => size.width = value.fixed32()?,
                (CLOUD_HEIGHT, value) => size.height = value.fixed32()?,
                _ => {}
            }
        }
        Ok((packed.check::<T>()?, size))
    }

    /// Checks the description of the next column.
    fn column<T: Row>(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        let (mut name, mut offset, mut number) = (&[][..], 0, 0);
        for field in Fields::new(bytes) {
            match field? {
                (1, value) => name = value.bytes()?,
                (2, value) => offset = value.fixed32()?,
                (3, Value::Varint(value)) => number = value,
                _ => {}
            }
        }
        let is_ours = T::COLUMNS.get(self.columns).is_some_and(|c| {
            c.name.as_bytes() == name && c.offset == offset as usize && c.number as u64 == number
        });
        self.columns += 1;
        if is_ours {
            Ok(())
        } else {
            Err(DecodeError::Layout("columns"))
        }
    }

    fn check<T: Row>(self) -> Result<Self, DecodeError> {
        if self.columns != T::COLUMNS.len() || self.stride as usize != size_of::<T>() {
            return Err(DecodeError::Layout("columns"));
        }
        if !self.data.len().is_multiple_of(size_of::<T>()) {
            return Err(DecodeError::Layout("length"));
        }
        Ok(self)
    }

    pub(super) fn append<T: Row>(&self, rows: &mut List<'_, T>) -> Result<(), DecodeError> {
        append(self.data, rows)
    }

    /// One row.
    pub(super) fn row<T: Row>(&self, index: usize) -> Option<T> {
        let start = index.checked_mul(size_of::<T>())?;
        let bytes = self.data.get(start..)?.get(..size_of::<T>())?;
        Some(bytemuck::pod_read_unaligned(bytes))
    }
}

/// Appends elements that stand in memory as they are.
pub(super) fn append<T: Pod>(bytes: &[u8], list: &mut List<'_, T>) -> Result<(), DecodeError> {
    if !bytes.len().is_multiple_of(size_of::<T>()) {
        return Err(DecodeError::Layout("length"));
    }
    let slots: &mut [u8] = bytemuck::cast_slice_mut(list.grow(bytes.len() / size_of::<T>()));
    if slots.len() != bytes.len() {
        return Err(DecodeError::TooMany);
    }
    slots.copy_from_slice(bytes);
    Ok(())
}
