//! The points of matches as columns: a point of a match is a point of its curve, with a disparity.

use super::DecodeError;
use super::wire::{Fill, Varints};
use crate::elements::{Edge, MatchPoint};

/// Twice the points of curves passed over, and one for a point that was filled in, as packed varints.
const GAPS: u32 = 8;
/// Disparities, as packed floats.
const DISPARITIES: u32 = 9;
/// Scores, as packed floats.
const SCORES: u32 = 10;

/// Appends the points of matches, of which `curves` are the points of the reference view's curves; false, and nothing
/// appended, where some point is not where its curve's is, or they are not in order.
pub(super) fn write(
    points: &[MatchPoint],
    curves: &[Edge],
    gaps: &mut Vec<u32>,
    out: &mut Vec<u8>,
) -> bool {
    gaps.clear();
    let mut next = 0;
    for point in points {
        let is_there = curves.get(point.point as usize).is_some_and(|edge| {
            edge.x.to_bits() == point.x.to_bits() && edge.y.to_bits() == point.y.to_bits()
        });
        // Twice the gap is a number of 32 bits, as there is no room for more points.
        if !is_there || point.point < next || point.filled > 1 || point.point >= 1 << 31 {
            return false;
        }
        gaps.push((point.point - next) << 1 | point.filled);
        next = point.point + 1;
    }
    let mut fill = Fill(out);
    fill.varints(GAPS, gaps);
    let values: [fn(&MatchPoint) -> f32; 2] = [|point| point.disparity, |point| point.score];
    for (field, value) in [DISPARITIES, SCORES].into_iter().zip(values) {
        fill.open(field, size_of::<f32>() * points.len());
        for point in points {
            fill.0.extend_from_slice(&value(point).to_le_bytes());
        }
    }
    true
}

/// Points of matches as their columns stand in a message.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Read<'a> {
    gaps: Option<&'a [u8]>,
    disparities: &'a [u8],
    scores: &'a [u8],
}

impl<'a> Read<'a> {
    /// Takes a field; false when it is none of these points.
    pub(super) fn field(&mut self, number: u32, bytes: &'a [u8]) -> bool {
        match number {
            GAPS => self.gaps = Some(bytes),
            DISPARITIES => self.disparities = bytes,
            SCORES => self.scores = bytes,
            _ => return false,
        }
        true
    }

    /// Whether points are columns.
    pub(super) fn is_some(&self) -> bool {
        self.gaps.is_some()
    }

    /// Hands out the points, of which `curves` are those of the reference view's curves.
    pub(super) fn points(
        &self,
        curves: &[Edge],
        mut take: impl FnMut(MatchPoint) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        let (disparities, rest) = self.disparities.as_chunks();
        let (scores, more) = self.scores.as_chunks();
        if disparities.len() != scores.len() || !rest.is_empty() || !more.is_empty() {
            return Err(DecodeError::Layout("length"));
        }
        let mut gaps = Varints::new(self.gaps.unwrap_or_default());
        let mut next = 0usize;
        for (disparity, score) in disparities.iter().zip(scores) {
            let code = gaps.next()?.ok_or(DecodeError::Unsound)?;
            let at = next.saturating_add((code >> 1) as usize);
            let edge = curves.get(at).ok_or(DecodeError::Unsound)?;
            take(MatchPoint {
                x: edge.x,
                y: edge.y,
                disparity: f32::from_le_bytes(*disparity),
                score: f32::from_le_bytes(*score),
                point: at as u32,
                filled: (code & 1) as u32,
            })?;
            next = at + 1;
        }
        gaps.next()?
            .is_none()
            .then_some(())
            .ok_or(DecodeError::Unsound)
    }
}
