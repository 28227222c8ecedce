//! What a message need not repeat, because another one of its scan says it already: a curve's points are edges, an
//! R-table's entries are points of curves. Whoever writes a reference has made sure that it gives back every bit.

use crate::header::Size;
use crate::payload::{CurvesView, Edge, Entry, TablesView};

/// Finds edges in a list in raster order; keeps its memory from list to list.
#[derive(Clone, Debug, Default)]
pub(super) struct Finder {
    /// Of every pixel an edge there. What earlier lists left does no harm: every find is compared.
    by_pixel: Vec<u32>,
}

/// Edges of one pixel stand this near to each other in the list.
const NEIGHBOURS: [i64; 5] = [0, -1, 1, -2, 2];

impl Finder {
    /// Appends of every point the index of the edge it is; false, when some point is no edge.
    pub(super) fn refer(
        &mut self,
        points: &[Edge],
        edges: &[Edge],
        size: Size,
        out: &mut Vec<u8>,
    ) -> bool {
        if self.by_pixel.len() < size.pixels() {
            self.by_pixel.resize(size.pixels(), 0);
        }
        let pixel = |edge: &Edge| edge.y as usize * size.width as usize + edge.x as usize;
        for (index, edge) in (0..).zip(edges) {
            if let Some(slot) = self.by_pixel.get_mut(pixel(edge)) {
                *slot = index;
            }
        }
        out.reserve(points.len() * size_of::<u32>());
        points.iter().all(|point| {
            let near = self.by_pixel.get(pixel(point)).copied().unwrap_or(0);
            let found = NEIGHBOURS
                .iter()
                .map(|by| i64::from(near) + by)
                .find(|&index| {
                    let edge = usize::try_from(index)
                        .ok()
                        .and_then(|index| edges.get(index));
                    edge.is_some_and(|edge| is_same(edge, point))
                });
            if let Some(index) = found {
                out.extend_from_slice(&(index as u32).to_le_bytes());
            }
            found.is_some()
        })
    }
}

/// Whether two edges are equal to the bit.
fn is_same(a: &Edge, b: &Edge) -> bool {
    let words = |edge: &Edge| bytemuck::cast::<Edge, [u64; 3]>(*edge);
    words(a) == words(b)
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
                let point = curves.points.get(entry.point as usize);
                let said = point.map(|point| entry_of(table.x, table.y, point, entry));
                let words = |entry: &Entry| bytemuck::cast::<Entry, [u32; 5]>(*entry);
                said.is_some_and(|said| words(&said) == words(entry))
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

/// Whether `order` is what [`order`] makes of these rows and points.
pub(super) fn order_follows(view: TablesView<'_>, points: &[Edge]) -> bool {
    let [first, .., last] = view.rows else {
        return false;
    };
    let rises = |row: u32, before: u32, after: u32| match (
        points.get(before as usize),
        points.get(after as usize),
    ) {
        (Some(a), Some(b)) => {
            a.y.floor() == row as f32
                && b.y.floor() == row as f32
                && (a.x < b.x || a.x == b.x && before < after)
        }
        _ => false,
    };
    let is_row = |(row, bounds): (u32, &[u32])| {
        let indices = view
            .order
            .get(bounds[0] as usize..bounds[1] as usize)
            .unwrap_or_default();
        let alone = indices.first().is_none_or(|&index| {
            points
                .get(index as usize)
                .is_some_and(|point| point.y.floor() == row as f32 && !point.x.is_nan())
        });
        alone && indices.windows(2).all(|pair| rises(row, pair[0], pair[1]))
    };
    *first == 0
        && *last as usize == view.order.len()
        && view.order.len() == points.len()
        && view.rows.is_sorted()
        && (0..).zip(view.rows.windows(2)).all(is_row)
}

/// The indices of all points, row by row, each row from left to right: `rows` says where the rows begin and end.
/// `None` when the rows are not those of the points.
pub(super) fn order(rows: &[u32], points: &[Edge], order: &mut Vec<u32>) -> Option<()> {
    order.clear();
    order.resize(points.len(), 0);
    let mut next = rows.to_vec();
    for (index, point) in (0..).zip(points) {
        let row = point.y as usize;
        let slot = next.get_mut(row)?;
        if *slot >= *rows.get(row + 1)? {
            return None;
        }
        *order.get_mut(*slot as usize)? = index;
        *slot += 1;
    }
    for bounds in rows.windows(2) {
        let row = order.get_mut(bounds[0] as usize..bounds[1] as usize)?;
        row.sort_by(|&a, &b| {
            points[a as usize]
                .x
                .total_cmp(&points[b as usize].x)
                .then(a.cmp(&b))
        });
    }
    Some(())
}
