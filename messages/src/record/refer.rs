//! What a message need not repeat, because another one of its scan says it already: a curve's points are edges, an
//! R-table's entries and a match's points are points of curves. Whoever writes a reference has made sure that it gives back every bit.

use super::DecodeError;
use crate::elements::{Curve, Edge, Entry, Table};
use crate::header::Size;
use crate::payload::{CurvesView, Kind, TablesRoom, TablesView};

/// The kinds of message that one of this kind may refer to.
pub(super) const fn referred(kind: Kind) -> &'static [Kind] {
    match kind {
        Kind::Edges => &[Kind::Image],
        Kind::Curves => &[Kind::Edges],
        Kind::Tables | Kind::Matches => &[Kind::Curves],
        _ => &[],
    }
}

/// Whether the entries stand table by table, and each says of its point what the point says itself.
pub(super) fn entries_follow(view: TablesView<'_>, curves: CurvesView<'_>) -> bool {
    let mut next = 0;
    let stand_in_order = view.tables.iter().all(|table| {
        let is_next = table.first == next;
        next = table.first.wrapping_add(table.count);
        is_next
    });
    let mut rest = view.entries;
    stand_in_order
        && next as usize == view.entries.len()
        && view.tables.iter().all(|table| {
            let entries = rest.split_off(..table.count as usize).unwrap_or_default();
            entries.iter().all(|entry| {
                curves
                    .points
                    .get(entry.point as usize)
                    .is_some_and(|point| is_entry(entry, table, point))
            })
        })
}

/// The entry of a point in the table of a curve with this centroid; weight and index are the given entry's.
pub(super) fn entry_of(x: f32, y: f32, point: &Edge, given: &Entry) -> Entry {
    Entry {
        orientation: point.orientation,
        rx: x - point.x,
        ry: y - point.y,
        ..*given
    }
}

/// Whether the tables are what [`sorted_entries`] makes of these curves and the entries' weights.
pub(super) fn tables_follow(view: TablesView<'_>, curves: CurvesView<'_>) -> bool {
    let mut rest = view.entries;
    let mut next = 0;
    let is_its = |(table, curve): (&Table, &Curve)| {
        let Some(entries) = rest.split_off(..table.count as usize) else {
            return false;
        };
        let is_next = table.first == next
            && (table.curve, table.count) == (curve.label, curve.count)
            && (table.x.to_bits(), table.y.to_bits()) == (curve.x.to_bits(), curve.y.to_bits());
        next = table.first.wrapping_add(table.count);
        let (mut before, mut weight) = (None, 0.0);
        // As many as the curve has points, all different, and all its own: they are all of them.
        let is_sorted = entries.iter().all(|entry| {
            let Some(point) = curves.points.get(entry.point as usize) else {
                return false;
            };
            let key = filed(point, entry.point);
            let rises = before < Some(key) && curve.range().contains(&(entry.point as usize));
            (before, weight) = (Some(key), weight + entry.weight);
            rises && is_entry(entry, table, point)
        });
        is_next && is_sorted && weight.to_bits() == table.weight.to_bits()
    };
    view.tables.len() == curves.curves.len()
        && view.tables.iter().zip(curves.curves).all(is_its)
        && rest.is_empty()
}

/// Whether an entry says of its point what the point says itself.
fn is_entry(entry: &Entry, table: &Table, point: &Edge) -> bool {
    let said = entry_of(table.x, table.y, point, entry);
    said.orientation.to_bits() == entry.orientation.to_bits()
        && said.rx.to_bits() == entry.rx.to_bits()
        && said.ry.to_bits() == entry.ry.to_bits()
}

/// A key that sorts a table's points by orientation, then by index.
fn filed(point: &Edge, index: u32) -> u64 {
    u64::from(sortable(point.orientation.to_bits())) << 32 | u64::from(index)
}

/// Makes a table of every curve, its entries sorted by orientation; `weight` gives theirs, one after the other.
pub(super) fn sorted_entries(
    curves: CurvesView<'_>,
    mut weight: impl FnMut() -> Result<f32, DecodeError>,
    room: &mut TablesRoom<'_>,
) -> Result<(), DecodeError> {
    let mut keys = Vec::new();
    for curve in curves.curves {
        let points = curves.points.get(curve.range());
        let points = points.ok_or(DecodeError::Unsound)?;
        keys.clear();
        keys.extend(
            (curve.first..)
                .zip(points)
                .map(|(index, point)| filed(point, index)),
        );
        keys.sort_unstable();
        let mut table = Table {
            curve: curve.label,
            first: room.entries.len() as u32,
            count: curve.count,
            x: curve.x,
            y: curve.y,
            weight: 0.0,
        };
        for &key in &keys {
            let given = Entry {
                point: key as u32,
                weight: weight()?,
                ..Entry::default()
            };
            table.weight += given.weight;
            let point = &curves.points[key as u32 as usize];
            room.entries.push(entry_of(curve.x, curve.y, point, &given));
        }
        if room.entries.refused() > 0 {
            return Err(DecodeError::TooMany);
        }
        room.tables.push(table);
    }
    Ok(())
}

/// Whether there are as many rows as an image of this size has: where the order follows, they then do too.
pub(super) fn rows_follow(view: TablesView<'_>, size: Size) -> bool {
    view.rows.len() == size.height as usize + 1
}

/// Where the points of each row begin and end among all points by rows; `None` where one lies below the image.
pub(super) fn rows(points: &[Edge], size: Size) -> Option<Vec<u32>> {
    let mut rows = vec![0; size.height as usize + 1];
    for point in points {
        *rows.get_mut(row_of(point) as usize + 1)? += 1;
    }
    let mut sum = 0;
    for row in &mut rows {
        sum += *row;
        *row = sum;
    }
    Some(rows)
}

/// Whether `order` is what [`order`] makes of these rows and points; `places` is memory to work in.
pub(super) fn order_follows(view: TablesView<'_>, points: &[Edge], places: &mut Vec<u64>) -> bool {
    let [first, .., last] = view.rows else {
        return false;
    };
    let is_whole = *first == 0
        && *last as usize == view.order.len()
        && view.order.len() == points.len()
        && view.rows.is_sorted();
    if !is_whole {
        return false;
    }
    // Points are looked at in any order: what they are sorted by is put close together before.
    places.clear();
    places.extend(
        points
            .iter()
            .map(|point| u64::from(row_of(point)) << 32 | column_of(point)),
    );
    let place = |index: u32| places.get(index as usize).copied();
    // Whether there is anything wrong is told at the end: no branch.
    let mut before = (0, 0);
    let (mut wrong, mut is_first) = (false, true);
    for &index in view.order {
        let here = (place(index).unwrap_or_default(), index);
        let rises = (before.0 < here.0) | ((before.0 == here.0) & (before.1 < index));
        wrong |= (index as usize >= places.len()) | (!rises & !is_first);
        (before, is_first) = (here, false);
    }
    // In order as they are, a row has no others when its first and its last are its own.
    let is_row = |(row, bounds): (u64, &[u32])| {
        let of = |at: u32| view.order.get(at as usize).and_then(|&index| place(index));
        let is_its = |at| of(at).is_some_and(|place| place >> 32 == row);
        bounds[0] == bounds[1] || (is_its(bounds[0]) && is_its(bounds[1] - 1))
    };
    !wrong && (0..).zip(view.rows.windows(2)).all(is_row)
}

/// The row a point belongs to: of two rows the upper.
fn row_of(point: &Edge) -> u32 {
    point.y as u32
}

/// The indices of all points, row by row, each row from left to right, of equal ones the lower index first: `rows`
/// says where the rows begin and end. `None` when the rows are not those of the points.
pub(super) fn order(rows: &[u32], points: &[Edge], order: &mut Vec<u32>) -> Option<()> {
    let mut keys = vec![0; points.len()];
    let mut next = rows.to_vec();
    for (index, point) in (0u32..).zip(points) {
        let row = row_of(point) as usize;
        let slot = next.get_mut(row)?;
        if *slot >= *rows.get(row + 1)? {
            return None;
        }
        *keys.get_mut(*slot as usize)? = column_of(point) << 32 | u64::from(index);
        *slot += 1;
    }
    for bounds in rows.windows(2) {
        keys.get_mut(bounds[0] as usize..bounds[1] as usize)?
            .sort_unstable();
    }
    order.clear();
    order.extend(keys.iter().map(|&key| key as u32));
    Some(())
}

/// What a point is sorted by in its row.
fn column_of(point: &Edge) -> u64 {
    // Adding zero makes one of the two zeros.
    u64::from(sortable((point.x + 0.0).to_bits()))
}

/// A float's bits, so that they sort like floats: those of negative ones are turned.
fn sortable(bits: u32) -> u32 {
    if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32, y: f32) -> Edge {
        Edge {
            x,
            y,
            ..Edge::default()
        }
    }

    #[test]
    fn an_order_that_is_said_to_follow_is_the_one_that_is_made() {
        let points = [
            at(3.0, 0.5),
            at(0.0, 0.0),
            at(-0.0, 0.9),
            at(1.0, 2.0),
            at(0.5, 2.7),
        ];
        let rows = [0, 3, 3, 5];
        let mut made = Vec::new();
        assert_eq!(order(&rows, &points, &mut made), Some(()));
        // The two zeros are equal: the lower index comes first.
        assert_eq!(made, [1, 2, 0, 4, 3]);
        let follows = |order: &[u32], points: &[Edge]| {
            order_follows(
                TablesView {
                    tables: &[],
                    entries: &[],
                    rows: &rows,
                    order,
                },
                points,
                &mut Vec::new(),
            )
        };
        assert!(follows(&made, &points));
        assert!(!follows(&[2, 1, 0, 4, 3], &points));
        assert!(!follows(&[1, 2, 0, 3, 4], &points));
        assert!(!follows(&[1, 2, 4, 0, 3], &points));
        assert!(!follows(&[1, 1, 0, 4, 3], &points));
        assert!(!follows(&[1, 2, 0, 4, 5], &points));
        assert!(!follows(&[1, 2, 0, 4], &points));
        let mut strange = points;
        strange[3].x = f32::NAN;
        // What is no number has its place in the order too.
        let mut of_strange = Vec::new();
        assert!(order(&rows, &strange, &mut of_strange).is_some());
        assert!(follows(&of_strange, &strange));
        assert_eq!(follows(&made, &strange), made == of_strange);
        strange[3].y = f32::NAN;
        assert!(!follows(&made, &strange));
        assert!(order(&[0, 1, 3, 5], &points, &mut made).is_none());
    }
}
