//! R-tables: what does not follow from the curves.

use super::curves::CurvesBeside;
use super::packed::{append, messages, packed, read_message, read_packed};
use super::{DecodeError, Head, Others, Recorded, own_head, read_own, within, words};
use crate::elements::Entry;
use crate::header::Size;
use crate::payload::{CurvesView, Tables, TablesRoom, TablesView};
use crate::record::refer::{
    entries_follow, entry_of, order, order_follows, rows, rows_follow, sorted_entries,
    tables_follow,
};
use crate::record::wire::{Fill, Value};

/// What of R-tables follows from curves is said by a field of this number, which is 1 then.
const TABLES_FOLLOW: u32 = 11;
/// The same of the index by rows.
const ROWS_FOLLOW: u32 = 12;

pub(super) fn tables_message(
    head: &Head<'_>,
    view: TablesView<'_>,
    curves: Option<CurvesView<'_>>,
    places: &mut Vec<u64>,
    out: &mut Vec<u8>,
) {
    own_head(head, out);
    let weights = |out: &mut Vec<u8>| {
        let is_one = |entry: &Entry| entry.weight.to_bits() == 1f32.to_bits();
        if !view.entries.iter().all(is_one) {
            let mut fill = Fill(out);
            fill.open(10, size_of::<f32>() * view.entries.len());
            for entry in view.entries {
                fill.0.extend_from_slice(&entry.weight.to_le_bytes());
            }
        }
    };
    if curves.is_some_and(|curves| tables_follow(view, curves)) {
        Fill(out).varint(TABLES_FOLLOW, 1);
        weights(out);
    } else {
        messages(5, view.tables, out);
        if curves.is_some_and(|curves| entries_follow(view, curves)) {
            let mut fill = Fill(out);
            fill.open(9, size_of::<u32>() * view.entries.len());
            for entry in view.entries {
                fill.0.extend_from_slice(&entry.point.to_le_bytes());
            }
            weights(out);
        } else {
            packed(6, view.entries, out);
        }
    }
    let order_follows = curves.is_some_and(|curves| order_follows(view, curves.points, places));
    if order_follows && rows_follow(view, head.size) {
        return Fill(out).varint(ROWS_FOLLOW, 1);
    }
    Fill(out).bytes(7, bytemuck::cast_slice(view.rows));
    if !order_follows {
        Fill(out).bytes(8, bytemuck::cast_slice(view.order));
    }
}

impl Recorded for Tables {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        beside: Others<'_, 'a>,
        room: &mut TablesRoom<'_>,
    ) -> Result<Size, DecodeError> {
        room.clear();
        let (mut points, mut weights, mut has_order) = (None, None, false);
        let (mut tables_follow, mut rows_follow) = (false, false);
        let size = read_own(bytes, most, |number, value| match number {
            5 => read_message(value.bytes()?, &mut room.tables),
            6 => read_packed(value.bytes()?, &mut room.entries),
            7 => append(value.bytes()?, &mut room.rows),
            8 => {
                has_order = true;
                append(value.bytes()?, &mut room.order)
            }
            9 => {
                points = Some(words(value.bytes()?)?);
                Ok(())
            }
            10 => {
                weights = Some(words(value.bytes()?)?);
                Ok(())
            }
            TABLES_FOLLOW => {
                tables_follow = value == Value::Varint(1);
                Ok(())
            }
            ROWS_FOLLOW => {
                rows_follow = value == Value::Varint(1);
                Ok(())
            }
            _ => Ok(()),
        })?;
        if points.is_none() && !tables_follow && has_order {
            return Ok(size);
        }
        let curves = CurvesBeside::of(most, beside)?;
        let curves = curves.view();
        let mut next_weight = || match &mut weights {
            Some(weights) => weights
                .next()
                .map(f32::from_bits)
                .ok_or(DecodeError::Unsound),
            None => Ok(1.0),
        };
        if tables_follow {
            room.tables.clear();
            room.entries.clear();
            sorted_entries(curves, &mut next_weight, room)?;
        } else if let Some(mut points) = points {
            for table in room.tables.iter() {
                for point in points.by_ref().take(table.count as usize) {
                    let given = Entry {
                        point,
                        weight: next_weight()?,
                        ..Entry::default()
                    };
                    let point = curves
                        .points
                        .get(point as usize)
                        .ok_or(DecodeError::Unsound)?;
                    room.entries.push(entry_of(table.x, table.y, point, &given));
                }
            }
            if points.next().is_some() {
                return Err(DecodeError::Unsound);
            }
        }
        within(room.entries.refused() + room.tables.refused())?;
        if rows_follow {
            let rows = rows(curves.points, size).ok_or(DecodeError::Unsound)?;
            room.rows.clear();
            room.rows.extend_from_slice(&rows);
            within(room.rows.refused())?;
        }
        if !has_order {
            let mut by_row = Vec::new();
            order(&room.rows, curves.points, &mut by_row).ok_or(DecodeError::Unsound)?;
            append(bytemuck::cast_slice(&by_row), &mut room.order)?;
        }
        Ok(size)
    }

    fn is_sound(view: Self::View<'_>) -> bool {
        // The curve points themselves are another message's; no index can exceed all there can be.
        view.is_sound(usize::MAX)
    }
}
