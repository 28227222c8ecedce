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
        // In 32 bits the conversion is quick; what lies outside finds no pixel.
        let pixel = |edge: &Edge| {
            let (x, y) = (i64::from(edge.x as i32), i64::from(edge.y as i32));
            (y * i64::from(size.width) + x) as usize
        };
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
                curves
                    .points
                    .get(entry.point as usize)
                    .is_some_and(|point| {
                        let said = entry_of(table.x, table.y, point, entry);
                        said.orientation.to_bits() == entry.orientation.to_bits()
                            && said.rx.to_bits() == entry.rx.to_bits()
                            && said.ry.to_bits() == entry.ry.to_bits()
                    })
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
    let is_row = |(row, bounds): (u32, &[u32])| {
        let indices = view
            .order
            .get(bounds[0] as usize..bounds[1] as usize)
            .unwrap_or_default();
        let mut before = (f32::NEG_INFINITY, 0);
        indices.iter().all(|&index| {
            points.get(index as usize).is_some_and(|point| {
                let here = (point.x, index);
                let rises = row_of(point) == row && before < here;
                before = here;
                rises
            })
        })
    };
    *first == 0
        && *last as usize == view.order.len()
        && view.order.len() == points.len()
        && view.rows.is_sorted()
        && (0..).zip(view.rows.windows(2)).all(is_row)
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
    for (index, point) in (0..).zip(points) {
        let row = row_of(point) as usize;
        let slot = next.get_mut(row)?;
        if *slot >= *rows.get(row + 1)? {
            return None;
        }
        *keys.get_mut(*slot as usize)? = key(point.x, index);
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

/// A key that sorts by value, then by index.
fn key(value: f32, index: u32) -> u64 {
    // Adding zero makes one of the two zeros. Floats sort like their bits, once those of negative ones are turned.
    let bits = (value + 0.0).to_bits();
    let sortable = if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    };
    u64::from(sortable) << 32 | u64::from(index)
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
            )
        };
        assert!(follows(&made, &points));
        assert!(!follows(&[2, 1, 0, 4, 3], &points));
        assert!(!follows(&[1, 2, 0, 3, 4], &points));
        assert!(!follows(&[1, 2, 4, 0, 3], &points));
        assert!(!follows(&[1, 1, 0, 4, 3], &points));
        let mut strange = points;
        strange[3].x = f32::NAN;
        assert!(!follows(&made, &strange));
        assert!(order(&rows, &strange, &mut made).is_some());
        assert!(order(&[0, 1, 3, 5], &points, &mut made).is_none());
    }
}
