//! Curves: heads in columns, points as walks over the edges, or the memory they are.

use super::edges::RecordedEdges;
use super::packed::{Packed, messages, packed, row_of_message};
use super::{
    DecodeError, Head, Others, Recorded, Said, own_head, read_own, recorded, within, words,
};
use crate::elements::{Curve, Edge};
use crate::header::Size;
use crate::message::Message as _;
use crate::payload::{Curves, CurvesRoom, CurvesView, EdgesView, Kind};
use crate::record::walks::{Heads, Walker, are_plain, write_heads};
use crate::record::wire::{Fields, Value};

pub(super) fn curves_message(
    head: &Head<'_>,
    view: CurvesView<'_>,
    edges: Option<EdgesView<'_>>,
    (walker, scratch): (&mut Walker, &mut Vec<u32>),
    out: &mut Vec<u8>,
) {
    own_head(head, out);
    let CurvesView { curves, points } = view;
    if !are_plain(curves, points.len()) {
        messages(5, curves, out);
        return packed(6, points, out);
    }
    write_heads(curves, scratch, out);
    let follow = |edges: EdgesView<'_>| walker.write(curves, points, edges.edges, head.size, out);
    if !edges.is_some_and(follow) {
        packed(6, points, out);
    }
}

impl Recorded for Curves {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        beside: Others<'_, 'a>,
        room: &mut CurvesRoom<'_>,
    ) -> Result<Size, DecodeError> {
        room.clear();
        let recorded = RecordedCurves::of(bytes, most)?;
        let curves = &mut room.curves;
        recorded.curves(|curve| {
            curves.push(curve);
            within(curves.refused())
        })?;
        let points = &mut room.points;
        recorded.points(true, beside, |more| {
            points.extend_from_slice(more);
            within(points.refused())
        })?;
        Ok(recorded.size)
    }

    fn is_sound(view: Self::View<'_>) -> bool {
        view.is_sound()
    }
}

/// The points of curves as they were recorded.
#[derive(Default)]
enum PointsAs<'a> {
    /// Walks from pixel to pixel, or none.
    #[default]
    Walks,
    /// As the memory they are.
    Memory(Packed<'a>),
    /// As indices of edges, which they were once.
    Indices(&'a [u8]),
}

/// A message of curves, as far as read.
struct RecordedCurves<'a> {
    bytes: &'a [u8],
    size: Size,
    heads: Heads<'a>,
    points: PointsAs<'a>,
}

impl<'a> RecordedCurves<'a> {
    fn of(bytes: &'a [u8], most: Size) -> Result<Self, DecodeError> {
        let mut heads = Heads::default();
        let mut points = PointsAs::default();
        let size = read_own(bytes, most, |number, value| {
            match (number, value) {
                (6, value) => points = PointsAs::Memory(Packed::read::<Edge>(value.bytes()?)?),
                (7, value) => points = PointsAs::Indices(value.bytes()?),
                (_, Value::Bytes(bytes)) => drop(heads.field(number, bytes)),
                _ => {}
            }
            Ok(())
        })?;
        Ok(Self {
            bytes,
            size,
            heads,
            points,
        })
    }

    /// Hands out the curves, whether they are columns or messages of their own.
    fn curves(
        &self,
        mut take: impl FnMut(Curve) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        for field in Fields::new(self.bytes) {
            if let (5, value) = field? {
                take(row_of_message(value.bytes()?)?)?;
            }
        }
        self.heads.curves(take)
    }

    /// Hands out the points, one after the other; what follows from the image is in them where `profiles` are wanted.
    fn points(
        &self,
        profiles: bool,
        beside: Others<'_, 'a>,
        mut take: impl FnMut(&[Edge]) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        let edges = || {
            let edges = RecordedEdges::of(recorded(Kind::Edges, beside)?, self.size)?;
            if edges.len() > self.size.pixels() {
                return Err(DecodeError::TooMany);
            }
            let mut slots = vec![Edge::default(); edges.len()];
            match profiles {
                true => edges.read(beside, &mut slots)?,
                false => edges.read_without_profiles(&mut slots)?,
            }
            Ok(slots)
        };
        match &self.points {
            PointsAs::Walks if !self.heads.walks() => Ok(()),
            PointsAs::Walks => self.heads.points(&edges()?, self.size, take),
            PointsAs::Memory(packed) => (0..)
                .map_while(|index| packed.row(index))
                .try_for_each(|edge| take(&[edge])),
            PointsAs::Indices(indices) => {
                let edges = edges()?;
                words(indices)?.try_for_each(|index| {
                    take(&[*edges.get(index as usize).ok_or(DecodeError::Unsound)?])
                })
            }
        }
    }
}

/// Curves that a message refers to.
pub(super) enum CurvesBeside<'a> {
    Read(CurvesView<'a>),
    Recorded(Vec<Curve>, Vec<Edge>),
}

impl<'a> CurvesBeside<'a> {
    /// Those beside a message; their points have no profiles.
    pub(super) fn of(most: Size, beside: Others<'_, 'a>) -> Result<Self, DecodeError> {
        let bytes = match beside(Kind::Curves) {
            Some(Said::Curves(curves)) => return Ok(Self::Read(curves)),
            Some(Said::Recorded(bytes)) => bytes,
            None => return Err(DecodeError::Alone(Kind::Curves)),
        };
        let [most_curves, most_points, ..] = Curves::capacities(most);
        let recorded = RecordedCurves::of(bytes, most)?;
        let (mut curves, mut points) = (Vec::new(), Vec::new());
        recorded.curves(|curve| {
            curves.push(curve);
            within(curves.len().saturating_sub(most_curves))
        })?;
        recorded.points(false, beside, |more| {
            points.extend_from_slice(more);
            within(points.len().saturating_sub(most_points))
        })?;
        Ok(Self::Recorded(curves, points))
    }

    pub(super) fn view(&self) -> CurvesView<'_> {
        match self {
            Self::Read(view) => *view,
            Self::Recorded(curves, points) => CurvesView { curves, points },
        }
    }
}
