//! Matches, and why curves were not matched.

use super::curves::CurvesBeside;
use super::packed::{messages, packed, read_message, read_packed};
use super::{DecodeError, Head, Others, Recorded, own_head, read_own, within};
use crate::header::Size;
use crate::payload::{CurvesView, Matches, MatchesRoom, MatchesView};
use crate::record::along;
use crate::record::wire::Value;

pub(super) fn matches_message(
    head: &Head<'_>,
    view: MatchesView<'_>,
    curves: Option<CurvesView<'_>>,
    scratch: &mut Vec<u32>,
    out: &mut Vec<u8>,
) {
    own_head(head, out);
    messages(5, view.matches, out);
    if !curves.is_some_and(|curves| along::write(view.points, curves.points, scratch, out)) {
        packed(6, view.points, out);
    }
    messages(7, view.rejected, out);
}

impl Recorded for Matches {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        beside: Others<'_, 'a>,
        room: &mut MatchesRoom<'_>,
    ) -> Result<Size, DecodeError> {
        room.clear();
        let mut columns = along::Read::default();
        let size = read_own(bytes, most, |number, value| match number {
            5 => read_message(value.bytes()?, &mut room.matches),
            6 => read_packed(value.bytes()?, &mut room.points),
            7 => read_message(value.bytes()?, &mut room.rejected),
            _ => {
                if let Value::Bytes(bytes) = value {
                    columns.field(number, bytes);
                }
                Ok(())
            }
        })?;
        if columns.is_some() {
            room.points.clear();
            let curves = CurvesBeside::of(most, beside)?;
            columns.points(curves.view().points, |point| {
                room.points.push(point);
                within(room.points.refused())
            })?;
        }
        Ok(size)
    }

    fn is_sound(view: Self::View<'_>) -> bool {
        view.is_sound()
    }
}
