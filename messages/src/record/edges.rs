//! Edges as columns, six bytes each: what the filter makes are whole numbers of small steps.
//!
//! ```text
//! edge ─► pixels passed over in its row, part of a pixel, magnitude, orientation ─► four columns
//!      └► profile: none where the view's image beside gives it, else a fifth column
//! ```

use multiversion::multiversion;

use super::DecodeError;
use super::wire::{Fill, Varints};
use crate::elements::{Edge, whole};
use crate::header::Size;
use crate::profile::Steady;

/// Pixels of each row that have an edge, as packed varints.
const COUNTS: u32 = 5;
/// Twice the pixels passed over, and one for a crossing between two rows, as packed varints.
const GAPS: u32 = 6;
/// Parts of a pixel, a byte each.
const PARTS: u32 = 7;
/// Magnitudes, two bytes each.
const MAGNITUDES: u32 = 8;
/// Orientations, two bytes each.
const ORIENTATIONS: u32 = 9;
/// Profiles, eight bytes each.
const PROFILES: u32 = 10;
/// Edges that are not whole numbers of steps, as the memory they are.
pub(super) const AS_THEY_ARE: u32 = 11;

/// Edges that are taken apart together.
const BATCH: usize = 64;

/// Writes edges as columns; keeps its memory from message to message.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    counts: Vec<u32>,
    gaps: Vec<u8>,
    parts: Vec<u8>,
    magnitudes: Vec<u16>,
    orientations: Vec<i16>,
    steady: Steady,
}

impl Columns {
    /// Appends the columns of edges in raster order, one a pixel at most; false, and nothing appended, where they are not, or
    /// not whole numbers of steps. `pixels` are those of the image that stands beside them.
    pub(super) fn write(
        &mut self,
        edges: &[Edge],
        size: Size,
        pixels: Option<&[u8]>,
        out: &mut Vec<u8>,
    ) -> bool {
        if !self.take_apart(edges, size) {
            return false;
        }
        let mut fill = Fill(out);
        fill.varints(COUNTS, &self.counts);
        fill.bytes(GAPS, &self.gaps);
        fill.bytes(PARTS, &self.parts);
        fill.bytes(MAGNITUDES, bytemuck::cast_slice(&self.magnitudes));
        fill.bytes(ORIENTATIONS, bytemuck::cast_slice(&self.orientations));
        let follow = pixels.is_some_and(|pixels| {
            pixels.len() == size.pixels() && {
                self.steady.take(pixels, size);
                self.steady.gives(edges)
            }
        });
        if !follow {
            fill.open(PROFILES, 8 * edges.len());
            for edge in edges {
                fill.0.extend_from_slice(&edge.profile);
            }
        }
        true
    }

    /// Fills the columns; false where that would lose a bit.
    fn take_apart(&mut self, edges: &[Edge], size: Size) -> bool {
        if edges.len() > size.pixels() {
            return false;
        }
        self.counts.clear();
        self.counts.resize(size.height as usize, 0);
        self.gaps.clear();
        self.gaps.reserve(edges.len() + BATCH);
        self.parts.resize(edges.len(), 0);
        self.magnitudes.resize(edges.len(), 0);
        self.orientations.resize(edges.len(), 0);
        let mut apart = Apart::NONE;
        // The row that is under way, and the first column that its next edge can have.
        let (mut row, mut next, mut count) = (0, 0, 0);
        let mut start = 0;
        for edges in edges.chunks(BATCH) {
            if !apart.take(edges) {
                return false;
            }
            let end = start + edges.len();
            self.parts[start..end].copy_from_slice(&apart.part[..edges.len()]);
            self.magnitudes[start..end].copy_from_slice(&apart.magnitude[..edges.len()]);
            self.orientations[start..end].copy_from_slice(&apart.orientation[..edges.len()]);
            start = end;
            let places = apart.column.iter().zip(&apart.row).zip(&apart.is_down);
            for ((&column, &of), &is_down) in places.take(edges.len()) {
                // Neither is negative, as they were put together again.
                let (column, of) = (column as u32, of as u32);
                if of != row {
                    if of < row || of >= size.height {
                        return false;
                    }
                    self.counts[row as usize] = count;
                    (row, next, count) = (of, 0, 0);
                }
                if column < next || column >= size.width {
                    return false;
                }
                let code = u64::from(column - next) << 1 | u64::from(is_down);
                Fill(&mut self.gaps).plain_varint(code);
                next = column + 1;
                count += 1;
            }
        }
        if let Some(last) = self.counts.get_mut(row as usize) {
            *last = count;
        }
        true
    }
}

/// A batch of edges, each property for itself.
#[derive(Clone, Debug)]
struct Apart {
    column: [i32; BATCH],
    row: [i32; BATCH],
    is_down: [u8; BATCH],
    part: [u8; BATCH],
    magnitude: [u16; BATCH],
    orientation: [i16; BATCH],
}

impl Apart {
    const NONE: Self = Self {
        column: [0; BATCH],
        row: [0; BATCH],
        is_down: [0; BATCH],
        part: [0; BATCH],
        magnitude: [0; BATCH],
        orientation: [0; BATCH],
    };

    /// Takes up to [`BATCH`] edges apart; false where they cannot be put together again to the bit.
    fn take(&mut self, edges: &[Edge]) -> bool {
        take_apart(edges, self) == 0
    }
}

/// Bits that differ, or are where none can be, of edges taken apart and put together again.
#[multiversion(targets("x86_64+avx2+fma"))]
fn take_apart(edges: &[Edge], apart: &mut Apart) -> u32 {
    const STEPS: f32 = Edge::PIXEL_STEPS as f32;
    let mut values = [[0.0; BATCH]; 4];
    let [x, y, magnitude, orientation] = &mut values;
    let slots = x.iter_mut().zip(y).zip(magnitude).zip(orientation);
    for ((((x, y), magnitude), orientation), edge) in slots.zip(edges) {
        (*x, *y) = (edge.x, edge.y);
        (*magnitude, *orientation) = (edge.magnitude, edge.orientation);
    }
    let [x, y, magnitude, orientation] = &values;
    let mut wrong = 0;
    for i in 0..BATCH {
        let (left, top) = (x[i].floor(), y[i].floor());
        let (column, row) = (whole(left), whole(top));
        let (along, down) = (whole((x[i] - left) * STEPS), whole((y[i] - top) * STEPS));
        let size = whole(magnitude[i] * Edge::MAGNITUDE_STEPS as f32);
        let turn = Edge::orientation_steps(orientation[i]);
        let again = built(column, row, along, down, size, turn);
        wrong |= again.x.to_bits() ^ x[i].to_bits();
        wrong |= again.y.to_bits() ^ y[i].to_bits();
        wrong |= again.magnitude.to_bits() ^ magnitude[i].to_bits();
        wrong |= again.orientation.to_bits() ^ orientation[i].to_bits();
        // Nothing is negative, parts are less than a pixel, and one of them is none.
        wrong |= ((column | row) as u32) >> 31;
        wrong |= ((along | down) as u32) >> 8;
        wrong |= u32::from((along != 0) & (down != 0));
        wrong |= (size as u32) >> 16;
        wrong |= u32::from((turn > Edge::HALF_TURN_STEPS) | (turn <= -Edge::HALF_TURN_STEPS));
        apart.column[i] = column;
        apart.row[i] = row;
        apart.is_down[i] = u8::from(down != 0);
        apart.part[i] = (along | down) as u8;
        apart.magnitude[i] = size as u16;
        apart.orientation[i] = turn as i16;
    }
    wrong
}

/// An edge of so many steps, without its profile.
#[inline(always)]
fn built(column: i32, row: i32, along: i32, down: i32, magnitude: i32, orientation: i32) -> Edge {
    const STEP: f32 = 1.0 / Edge::PIXEL_STEPS as f32;
    Edge {
        x: column as f32 + along as f32 * STEP,
        y: row as f32 + down as f32 * STEP,
        magnitude: magnitude as f32 * (1.0 / Edge::MAGNITUDE_STEPS as f32),
        orientation: Edge::orientation_of(orientation),
        profile: [0; 8],
    }
}

/// Edges as their columns stand in a message.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Read<'a> {
    counts: &'a [u8],
    gaps: &'a [u8],
    parts: &'a [u8],
    magnitudes: &'a [u8],
    orientations: &'a [u8],
    profiles: Option<&'a [u8]>,
}

impl<'a> Read<'a> {
    /// Takes a field; false when it is none of edges.
    pub(super) fn field(&mut self, number: u32, bytes: &'a [u8]) -> bool {
        match number {
            COUNTS => self.counts = bytes,
            GAPS => self.gaps = bytes,
            PARTS => self.parts = bytes,
            MAGNITUDES => self.magnitudes = bytes,
            ORIENTATIONS => self.orientations = bytes,
            PROFILES => self.profiles = Some(bytes),
            _ => return false,
        }
        true
    }

    /// How many edges there are.
    pub(super) fn len(&self) -> usize {
        self.parts.len()
    }

    /// Whether their profiles follow from the image.
    pub(super) fn lacks_profiles(&self) -> bool {
        self.profiles.is_none() && self.len() > 0
    }

    /// Puts the edges together, as many as there are slots, which must be all of them; without profiles of their own they
    /// have none yet.
    pub(super) fn build(&self, size: Size, slots: &mut [Edge]) -> Result<(), DecodeError> {
        let (magnitudes, rest) = self.magnitudes.as_chunks();
        let (orientations, more) = self.orientations.as_chunks();
        let profiles = self.profiles.map(<[u8]>::as_chunks);
        let is_whole = rest.is_empty()
            && more.is_empty()
            && [slots.len(), magnitudes.len(), orientations.len()] == [self.len(); 3]
            && profiles.is_none_or(|(all, rest)| all.len() == self.len() && rest.is_empty());
        if !is_whole {
            return Err(DecodeError::Layout("length"));
        }
        let mut counts = Varints::new(self.counts);
        let mut gaps = Varints::new(self.gaps);
        let mut steps = self.parts.iter().zip(magnitudes).zip(orientations);
        let mut slots_left = slots.iter_mut();
        let mut row = 0;
        while let Some(count) = counts.next()? {
            if count > 0 && row >= size.height {
                return Err(DecodeError::Unsound);
            }
            let mut next = 0;
            for _ in 0..count {
                let (Some(slot), Some(((part, magnitude), orientation))) =
                    (slots_left.next(), steps.next())
                else {
                    return Err(DecodeError::Unsound);
                };
                let code = gaps.next()?.ok_or(DecodeError::Unsound)?;
                let column = (code >> 1).saturating_add(next);
                if column >= u64::from(size.width) {
                    return Err(DecodeError::Unsound);
                }
                next = column + 1;
                let (part, is_down) = (i32::from(*part), (code & 1) as i32);
                let down = part * is_down;
                let orientation = match i16::from_le_bytes(*orientation) {
                    i16::MIN => Edge::HALF_TURN_STEPS,
                    steps => i32::from(steps),
                };
                *slot = built(
                    column as i32,
                    row as i32,
                    part - down,
                    down,
                    i32::from(u16::from_le_bytes(*magnitude)),
                    orientation,
                );
            }
            row = row.saturating_add(1);
        }
        if slots_left.next().is_some() || gaps.next()?.is_some() {
            return Err(DecodeError::Unsound);
        }
        if let Some((profiles, _)) = profiles {
            for (slot, profile) in slots.iter_mut().zip(profiles) {
                slot.profile = *profile;
            }
        }
        Ok(())
    }
}
