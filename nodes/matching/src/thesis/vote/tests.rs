use super::*;
use messages::{Curve, CurvesView, Edge, Size, Sway, TablesView};

const SIZE: Size = Size::new(100, 40);

fn chance(seed: u32) -> f32 {
    let mixed = (u64::from(seed) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32 / (1u64 << 24) as f32
}

/// A view of curves, with its index of rows and its R-tables.
struct Seen {
    curves: Vec<Curve>,
    points: Vec<Edge>,
    tables: Vec<Table>,
    entries: Vec<Entry>,
    rows: Vec<u32>,
    order: Vec<u32>,
}

impl Seen {
    fn of(lines: &[Vec<Edge>]) -> Self {
        let points: Vec<Edge> = lines.iter().flatten().copied().collect();
        let (mut curves, mut tables, mut entries) = (Vec::new(), Vec::new(), Vec::new());
        for (label, line) in (0..).zip(lines) {
            let mean = |of: fn(&Edge) -> f32| line.iter().map(of).sum::<f32>() / line.len() as f32;
            let (x, y) = (mean(|e| e.x), mean(|e| e.y));
            let (first, count) = (entries.len() as u32, line.len() as u32);
            curves.push(Curve {
                label,
                first,
                count,
                x,
                y,
                ..Curve::default()
            });
            let weight = line.len() as f32;
            tables.push(Table {
                curve: label,
                first,
                count,
                x,
                y,
                weight,
            });
            entries.extend((first..).zip(line).map(|(point, edge)| Entry {
                orientation: edge.orientation,
                rx: x - edge.x,
                ry: y - edge.y,
                weight: 1.0,
                point,
            }));
        }
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|i| &points[i as usize]);
            (a.y as u32).cmp(&(b.y as u32)).then(a.x.total_cmp(&b.x))
        });
        let before = |row: u32| points.iter().filter(|p| (p.y as u32) < row).count() as u32;
        let rows = (0..=SIZE.height).map(before).collect();
        Self {
            curves,
            points,
            tables,
            entries,
            rows,
            order,
        }
    }

    fn view(&self) -> ChannelView<'_> {
        ChannelView {
            curves: CurvesView {
                curves: &self.curves,
                points: &self.points,
            },
            tables: TablesView {
                tables: &self.tables,
                entries: &self.entries,
                rows: &self.rows,
                order: &self.order,
            },
        }
    }
}

/// The peaks of a curve of one view in another one.
fn peaks(
    label: u32,
    from: &Seen,
    to: &Seen,
    steps: f32,
    range: Range,
    ballot: &Ballot,
) -> Vec<Peak> {
    let [(from, a), (to, b)] = [from, to].map(|seen| {
        let mut rows = Rows::default();
        rows.fill(&seen.view(), SIZE, 0.0, &Sway::NONE, 1.0);
        (seen, rows)
    });
    let places = |seen: &Seen| -> Vec<(f32, f32)> {
        let place = |e: &Edge| (if e.is_in_row() { e.y } else { -1.0 }, e.x);
        seen.points.iter().map(place).collect()
    };
    let [of_a, of_b] = [from, to].map(places);
    let from = Side {
        view: from.view(),
        rows: &a,
        lower: 0.0,
        places: &of_a,
    };
    let to = Side {
        view: to.view(),
        rows: &b,
        lower: 0.0,
        places: &of_b,
    };
    let mut peaks = Vec::new();
    let way = Way {
        from: &from,
        to: &to,
        steps,
        band: &Band::level(range),
        ballot,
    };
    Votes::default().count(label, &way, 0.0, &mut peaks);
    peaks
}

const BALLOT: Ballot = Ballot {
    turn: 0.6,
    flat: 0.05,
    rows: 1.0,
    lanes: Lanes {
        width: 1.5,
        slope: 0.0,
    },
};

const RANGE: Range = Range {
    least: 0.0,
    most: 25.0,
};

#[test]
fn votes_are_those_of_every_entry_against_every_point_of_its_row() {
    let scatter = |seed: u32, from: f32| -> Vec<Vec<Edge>> {
        let point = |i: u32| Edge {
            x: from + 60.0 * chance(3 * i + seed),
            y: (39.0 * chance(3 * i + 1 + seed)).floor(),
            orientation: 3.0 - 6.0 * chance(3 * i + 2 + seed),
            ..Edge::default()
        };
        (0..3)
            .map(|k| (80 * k..80 * k + 80).map(point).collect())
            .collect()
    };
    let (from, to) = (Seen::of(&scatter(0, 20.0)), Seen::of(&scatter(9000, 10.0)));
    for (steps, label) in [(1.0, 0), (2.0, 1), (-1.0, 2), (0.5, 0)] {
        let found = peaks(label, &from, &to, steps, RANGE, &BALLOT);
        assert_eq!(found.len(), 3, "every curve got some votes");
        assert!(found.is_sorted_by(|a, b| a.votes >= b.votes));
        for peak in found {
            let agrees = |e: &&Edge| {
                to.points[to.curves[peak.curve as usize].range()]
                    .iter()
                    .any(|q| {
                        let flat = [e.orientation, q.orientation].map(|o| is_flat(o, BALLOT.flat));
                        let off = (e.x - q.x) / steps - peak.course.disparity;
                        flat == [false; 2]
                            && q.y == e.y
                            && turn(q.orientation, e.orientation) <= BALLOT.turn
                            && RANGE.contains((e.x - q.x) / steps)
                            && off.abs() <= 0.75
                    })
            };
            let own = &from.points[from.curves[label as usize].range()];
            let twin = own.iter().filter(agrees).count() as f32;
            let flat = own
                .iter()
                .filter(|e| is_flat(e.orientation, BALLOT.flat))
                .count() as f32;
            assert!(
                (twin..=twin + flat).contains(&peak.votes),
                "{twin} {flat} {peak:?}"
            );
            assert_eq!(peak.score, peak.votes / 80.0);
        }
    }
}

/// A contour that runs along the rows, from one column to another.
fn flat(row: f32, columns: std::ops::Range<u32>) -> Vec<Edge> {
    let point = |x: u32| Edge {
        x: x as f32,
        y: row,
        orientation: std::f32::consts::FRAC_PI_2,
        ..Edge::default()
    };
    columns.map(point).collect()
}

#[test]
fn a_flat_curve_is_found_by_its_centroid_if_it_is_as_long() {
    let from = Seen::of(&[flat(10.5, 40..80)]);
    let to = Seen::of(&[flat(10.75, 30..70), flat(10.25, 40..60), flat(20.5, 30..70)]);
    let found = peaks(0, &from, &to, 1.0, RANGE, &BALLOT);
    assert_eq!(
        found.len(),
        1,
        "the second is half as long, the third lies elsewhere"
    );
    assert_eq!((found[0].curve, found[0].course.disparity), (0, 10.0));
    assert_eq!(found[0].score, 1.0);
}

#[test]
fn a_nearly_flat_curve_that_ends_elsewhere_along_its_line_is_not_taken_by_its_centroid() {
    let falling = |line: f32, columns: std::ops::Range<u32>| -> Vec<Edge> {
        let point = |x: u32| Edge {
            x: x as f32,
            y: 10.05 + 0.17 * (x as f32 - line),
            orientation: std::f32::consts::FRAC_PI_2 - 0.17,
            ..Edge::default()
        };
        columns.map(point).collect()
    };
    let from = Seen::of(&[falling(40.0, 40..80)]);
    let same = Seen::of(&[falling(30.0, 30..70)]);
    let found = peaks(0, &from, &same, 1.0, RANGE, &BALLOT);
    assert_eq!((found.len(), found[0].course.disparity), (1, 10.0));
    let further = Seen::of(&[falling(30.0, 32..72)]);
    assert_eq!(peaks(0, &from, &further, 1.0, RANGE, &BALLOT), []);
}

#[test]
fn a_curve_that_is_partly_hidden_has_all_the_votes_of_what_is_left_of_it() {
    let line = |rows: std::ops::Range<u32>, x: f32| -> Vec<Edge> {
        rows.map(|row| Edge {
            x,
            y: row as f32,
            ..Edge::default()
        })
        .collect()
    };
    let whole = Seen::of(&[line(2..38, 50.0)]);
    let hidden = Seen::of(&[line(20..38, 42.0)]);
    for (from, to, steps) in [(&whole, &hidden, 1.0), (&hidden, &whole, -1.0)] {
        let found = peaks(0, from, to, steps, RANGE, &BALLOT);
        assert_eq!((found[0].votes, found[0].score), (18.0, 1.0));
        assert!((found[0].course.disparity - 8.0).abs() < 0.2, "{found:?}");
    }
}
