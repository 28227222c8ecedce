//! Curves as walks from pixel to pixel: where a pixel has one edge, a curve's point is the edge of its pixel.
//!
//! ```text
//! curves ─► counts, parents, means ─► columns
//! points ─► pixel where each curve starts, a step of (−8 … 7, −8 … 7) pixels from point to point ─► a byte a point
//! ```

use super::DecodeError;
use super::wire::{Fill, Varints};
use crate::elements::{Curve, Edge};
use crate::header::{NONE, Size};

/// Points of each curve, as packed varints.
const COUNTS: u32 = 8;
/// Each curve's parent and one more, or 0, as packed varints.
const PARENTS: u32 = 9;
/// Each curve's means and its length, as packed floats.
const MEANS: [u32; 4] = [10, 11, 12, 13];
/// From the pixel where the curve before starts to the one where this one does, in raster order, as packed zigzag varints.
const STARTS: u32 = 14;
/// From a point's pixel to the next one's: rows in the upper four bits, columns in the lower, each in two's complement.
const STEPS: u32 = 15;

/// A step goes less far than this to the right or down, and not farther to the left or up.
const REACH: i32 = 8;

/// Whether curves are numbered in order, stand one after the other, and none is empty.
pub(super) fn are_plain(curves: &[Curve], points: usize) -> bool {
    let mut next = 0;
    let is_next = |(label, curve): (u32, &Curve)| {
        let is_next = curve.label == label && curve.first as usize == next && curve.count > 0;
        next += curve.count as usize;
        is_next
    };
    (0..).zip(curves).all(is_next) && next == points
}

/// Appends plain curves as columns.
pub(super) fn write_heads(curves: &[Curve], scratch: &mut Vec<u32>, out: &mut Vec<u8>) {
    let mut fill = Fill(out);
    scratch.clear();
    scratch.extend(curves.iter().map(|curve| curve.count));
    fill.varints(COUNTS, scratch);
    scratch.clear();
    scratch.extend(curves.iter().map(|curve| curve.parent.wrapping_add(1)));
    fill.varints(PARENTS, scratch);
    let means: [fn(&Curve) -> f32; 4] = [|c| c.x, |c| c.y, |c| c.magnitude, |c| c.length];
    for (field, mean) in MEANS.into_iter().zip(means) {
        fill.open(field, size_of::<f32>() * curves.len());
        for curve in curves {
            fill.0.extend_from_slice(&mean(curve).to_le_bytes());
        }
    }
}

/// Writes points as walks; keeps its memory from message to message.
#[derive(Clone, Debug, Default)]
pub(super) struct Walker {
    /// Of every pixel an edge there. What earlier lists left does no harm: every find is compared.
    by_pixel: Vec<u32>,
    /// Of every point.
    pixels: Vec<u32>,
    starts: Vec<u32>,
    steps: Vec<u8>,
}

impl Walker {
    /// Appends the points of plain curves; false, and nothing appended, where some point is not the edge of its pixel or a
    /// step too long.
    pub(super) fn write(
        &mut self,
        curves: &[Curve],
        points: &[Edge],
        edges: &[Edge],
        size: Size,
        out: &mut Vec<u8>,
    ) -> bool {
        // All is looked at before anything is decided, so that memory is waited for once and not point by point.
        let (width, height) = (size.width, size.height);
        let mut wrong = edges.is_empty() && !points.is_empty();
        let mut pixel_of = |edge: &Edge| {
            // In 32 bits the conversion is quick; what is negative there is large as it is here.
            let (x, y) = (edge.x as i32, edge.y as i32);
            let inside = (x as u32) < width && (y as u32) < height;
            wrong |= !inside;
            if inside { (x, y) } else { (0, 0) }
        };
        let index_of = |(x, y): (i32, i32)| y as usize * width as usize + x as usize;
        self.by_pixel
            .resize(self.by_pixel.len().max(size.pixels()).max(1), 0);
        for (index, edge) in (0..).zip(edges) {
            self.by_pixel[index_of(pixel_of(edge))] = index;
        }
        self.starts.clear();
        self.steps.clear();
        self.steps.reserve(points.len());
        self.pixels.clear();
        self.pixels.reserve(points.len());
        let (mut rest, mut start, mut too_long) = (points, 0, 0);
        for curve in curves {
            let Some([first, further @ ..]) = rest.split_off(..curve.count as usize) else {
                return false;
            };
            let (mut x, mut y) = pixel_of(first);
            let index = index_of((x, y)) as u32;
            let by = index.wrapping_sub(start) as i32;
            start = index;
            self.starts.push(((by << 1) ^ (by >> 31)) as u32);
            self.pixels.push(index);
            for point in further {
                let pixel = pixel_of(point);
                let (dx, dy) = (pixel.0 - x, pixel.1 - y);
                too_long |= ((dx + REACH) | (dy + REACH)) as u32 >> 4;
                self.steps.push(((dy << 4) | (dx & 15)) as u8);
                self.pixels.push(index_of(pixel) as u32);
                (x, y) = pixel;
            }
        }
        if wrong || too_long != 0 {
            return false;
        }
        let last = edges.len().saturating_sub(1);
        let differ = points
            .iter()
            .zip(&self.pixels)
            .fold(0, |differ, (point, pixel)| {
                let index = self.by_pixel[*pixel as usize] as usize;
                let edge = &edges[index.min(last)];
                differ | difference(point, edge)
            });
        if differ != 0 {
            return false;
        }
        let mut fill = Fill(out);
        fill.varints(STARTS, &self.starts);
        fill.bytes(STEPS, &self.steps);
        true
    }
}

/// The bits in which two edges differ.
fn difference(a: &Edge, b: &Edge) -> u64 {
    let words = |edge: &Edge| bytemuck::cast::<Edge, [u64; 3]>(*edge);
    let ([a, b, c], [d, e, f]) = (words(a), words(b));
    (a ^ d) | (b ^ e) | (c ^ f)
}

/// Curves as their columns stand in a message.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Heads<'a> {
    counts: &'a [u8],
    parents: &'a [u8],
    means: [&'a [u8]; 4],
    starts: &'a [u8],
    steps: Option<&'a [u8]>,
}

impl<'a> Heads<'a> {
    /// Takes a field; false when it is none of curves as columns.
    pub(super) fn field(&mut self, number: u32, bytes: &'a [u8]) -> bool {
        match number {
            COUNTS => self.counts = bytes,
            PARENTS => self.parents = bytes,
            STARTS => self.starts = bytes,
            STEPS => self.steps = Some(bytes),
            _ => match MEANS.iter().position(|field| *field == number) {
                Some(mean) => self.means[mean] = bytes,
                None => return false,
            },
        }
        true
    }

    /// Whether points are walks.
    pub(super) fn walks(&self) -> bool {
        self.steps.is_some()
    }

    /// Hands out the curves.
    pub(super) fn curves(
        &self,
        mut take: impl FnMut(Curve) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        let mut counts = Varints::new(self.counts);
        let mut parents = Varints::new(self.parents);
        let mut means = self.means;
        let (mut label, mut first) = (0, 0u32);
        while let Some(count) = counts.next()? {
            let count = u32::try_from(count).map_err(|_| DecodeError::Unsound)?;
            let parent = parents.next()?.ok_or(DecodeError::Unsound)?;
            let parent = u32::try_from(parent).map_err(|_| DecodeError::Unsound)?;
            let mut mean = |of: usize| {
                let bytes = means[of].split_off(..size_of::<f32>());
                let bytes = bytes.and_then(|bytes| bytes.first_chunk());
                bytes
                    .map(|bytes| f32::from_le_bytes(*bytes))
                    .ok_or(DecodeError::Unsound)
            };
            take(Curve {
                label,
                first,
                count,
                parent: parent.wrapping_sub(1),
                x: mean(0)?,
                y: mean(1)?,
                magnitude: mean(2)?,
                length: mean(3)?,
            })?;
            (label, first) = (
                label + 1,
                first.checked_add(count).ok_or(DecodeError::Unsound)?,
            );
        }
        let is_over = parents.next()?.is_none() && means.iter().all(|mean| mean.is_empty());
        is_over.then_some(()).ok_or(DecodeError::Unsound)
    }

    /// Hands out the points, each the edge of its pixel.
    pub(super) fn points(
        &self,
        edges: &[Edge],
        size: Size,
        mut take: impl FnMut(&[Edge]) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        let (width, height) = (i64::from(size.width), i64::from(size.height));
        let index_of = |x: i64, y: i64| {
            let inside = x >= 0 && y >= 0 && x < width && y < height;
            inside.then_some((y * width + x) as usize)
        };
        let mut by_pixel = vec![NONE; size.pixels()];
        for (index, edge) in (0..).zip(edges) {
            let pixel = index_of(i64::from(edge.x as i32), i64::from(edge.y as i32));
            by_pixel[pixel.ok_or(DecodeError::Unsound)?] = index;
        }
        let edge_of = |pixel: usize| {
            let index = by_pixel.get(pixel).ok_or(DecodeError::Unsound)?;
            edges
                .get(*index as usize)
                .copied()
                .ok_or(DecodeError::Unsound)
        };
        let mut counts = Varints::new(self.counts);
        let mut starts = Varints::new(self.starts);
        let mut steps = self.steps.unwrap_or_default().iter();
        let mut start = 0i64;
        while let Some(count) = counts.next()? {
            let Some(further) = count.checked_sub(1) else {
                return Err(DecodeError::Unsound);
            };
            let code = starts.next()?.ok_or(DecodeError::Unsound)?;
            let code = i64::try_from(code).map_err(|_| DecodeError::Unsound)?;
            start = start.wrapping_add((code >> 1) ^ -(code & 1));
            let first = usize::try_from(start).map_err(|_| DecodeError::Unsound)?;
            take(&[edge_of(first)?])?;
            // There was an edge, so that the picture has a width.
            let (mut x, mut y) = (start % width, start / width);
            for _ in 0..further {
                let step = *steps.next().ok_or(DecodeError::Unsound)? as i8;
                y += i64::from(step >> 4);
                x += i64::from(step << 4 >> 4);
                let pixel = index_of(x, y).ok_or(DecodeError::Unsound)?;
                take(&[edge_of(pixel)?])?;
            }
        }
        let is_over = starts.next()?.is_none() && steps.next().is_none();
        is_over.then_some(()).ok_or(DecodeError::Unsound)
    }
}
