//! Edges: columns of whole numbers, or the memory they are.

use super::images::raw_pixels;
use super::packed::{Packed, packed};
use super::{DecodeError, Head, Others, Recorded, check_size, own_head, read_own, recorded};
use crate::elements::Edge;
use crate::header::Size;
use crate::payload::{Edges, EdgesRoom, EdgesView, ImageView, Kind};
use crate::profile::Steady;
use crate::record::edges::{self, Columns};
use crate::record::wire::{Fields, Value};

pub(super) fn edges_message(
    head: &Head<'_>,
    view: EdgesView<'_>,
    image: Option<ImageView<'_>>,
    columns: &mut Columns,
    out: &mut Vec<u8>,
) {
    own_head(head, out);
    let pixels = image.map(|image| image.pixels);
    if !columns.write(view.edges, head.size, pixels, out) {
        packed(edges::AS_THEY_ARE, view.edges, out);
    }
}

impl Recorded for Edges {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        beside: Others<'_, 'a>,
        room: &mut EdgesRoom<'_>,
    ) -> Result<Size, DecodeError> {
        room.clear();
        let recorded = RecordedEdges::of(bytes, most)?;
        let slots = room.edges.grow(recorded.len());
        recorded.read(beside, slots)?;
        Ok(recorded.size)
    }
}

/// Edges as they were recorded: as columns, or as the memory they are.
enum EdgesAs<'a> {
    Columns(edges::Read<'a>),
    Memory(Packed<'a>),
}

/// A message of edges, as far as read.
pub(super) struct RecordedEdges<'a> {
    size: Size,
    edges: EdgesAs<'a>,
}

impl<'a> RecordedEdges<'a> {
    pub(super) fn of(bytes: &'a [u8], most: Size) -> Result<Self, DecodeError> {
        // Edges were clouds of points once, whose third field is a pose; ours is a width.
        let is_cloud =
            |field: Result<(u32, Value<'_>), _>| matches!(field, Ok((3, Value::Bytes(_))));
        if Fields::new(bytes).any(is_cloud) {
            let (packed, size) = Packed::of_cloud::<Edge>(bytes)?;
            check_size(size, most)?;
            let edges = EdgesAs::Memory(packed);
            return Ok(Self { size, edges });
        }
        let mut columns = edges::Read::default();
        let mut memory = None;
        let size = read_own(bytes, most, |number, value| {
            match value {
                Value::Bytes(bytes) if number == edges::AS_THEY_ARE => {
                    memory = Some(Packed::read::<Edge>(bytes)?);
                }
                Value::Bytes(bytes) => drop(columns.field(number, bytes)),
                _ => {}
            }
            Ok(())
        })?;
        let edges = match memory {
            Some(packed) => EdgesAs::Memory(packed),
            None => EdgesAs::Columns(columns),
        };
        Ok(Self { size, edges })
    }

    pub(super) fn len(&self) -> usize {
        match &self.edges {
            EdgesAs::Columns(columns) => columns.len(),
            EdgesAs::Memory(packed) => packed.data.len() / size_of::<Edge>(),
        }
    }

    /// Reads all edges, or says that there is no room for them.
    pub(super) fn read(
        &self,
        beside: Others<'_, 'a>,
        slots: &mut [Edge],
    ) -> Result<(), DecodeError> {
        self.read_without_profiles(slots)?;
        if let EdgesAs::Columns(columns) = &self.edges
            && columns.lacks_profiles()
        {
            let image = recorded(Kind::Image, beside)?;
            let (size, pixels) = raw_pixels::<u8>(image, self.size, "mono8")?;
            if size != self.size {
                return Err(DecodeError::Layout("image size"));
            }
            let mut steady = Steady::new(size);
            steady.take(pixels, size);
            steady.fill(slots);
        }
        Ok(())
    }

    /// The same; what follows from the image is left out.
    pub(super) fn read_without_profiles(&self, slots: &mut [Edge]) -> Result<(), DecodeError> {
        if slots.len() < self.len() {
            return Err(DecodeError::TooMany);
        }
        match &self.edges {
            EdgesAs::Columns(columns) => columns.build(self.size, slots),
            EdgesAs::Memory(packed) => {
                let memory: &mut [u8] = bytemuck::cast_slice_mut(slots);
                memory.copy_from_slice(packed.data);
                Ok(())
            }
        }
    }
}
