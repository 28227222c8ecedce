//! Lettering and line drawings: strokes, and how far a place is from the nearest one.

use std::f32::consts::TAU;
use std::sync::LazyLock;

use parry3d::math::Vec2;

/// Letters on a grid four wide and six high: strokes of points, each point its column and its row.
const LETTERS: [(char, &str); 12] = [
    ('A', "00 26 40|12 32"),
    ('B', "00 06 36 45 44 33 03|33 42 41 30 00"),
    ('C', "45 36 16 05 01 10 30 41"),
    ('E', "46 06 00 40|03 33"),
    ('I', "20 26"),
    ('R', "00 06 36 45 44 33 03|23 40"),
    ('T', "06 46|26 20"),
    ('U', "06 01 10 30 41 46"),
    ('V', "06 20 46"),
    ('0', "10 30 41 45 36 16 05 01 10"),
    ('1', "15 26 20"),
    ('9', "10 30 41 45 36 16 05 04 13 33 44"),
];

type Stroke = [Vec2; 2];

/// A text as strokes, its lower left corner at `at`, its letters `height` high.
fn text(words: &str, at: [f32; 2], height: f32) -> Vec<Stroke> {
    let unit = height / 6.0;
    let mut strokes = Vec::new();
    for (i, letter) in words.chars().enumerate() {
        let shape = LETTERS
            .iter()
            .find(|(known, _)| *known == letter)
            .map_or("", |(_, shape)| shape);
        for run in shape.split('|') {
            let points: Vec<Vec2> = run
                .split_whitespace()
                .map(|point| {
                    let mut digits = point.bytes().map(|digit| f32::from(digit - b'0'));
                    let mut next = || digits.next().unwrap_or_default() * unit;
                    Vec2::from(at) + Vec2::new(next() + i as f32 * 5.6 * unit, next())
                })
                .collect();
            strokes.extend(joined(&points));
        }
    }
    strokes
}

/// The strokes of an open line of points.
fn joined(points: &[Vec2]) -> impl Iterator<Item = Stroke> + '_ {
    points.windows(2).map(|ends| [ends[0], ends[1]])
}

/// The strokes of a line through these points.
fn path(points: &[[f32; 2]]) -> Vec<Stroke> {
    let points: Vec<Vec2> = points.iter().map(|&p| p.into()).collect();
    joined(&points).collect()
}

/// The strokes of an arc, in turns.
fn arc(centre: [f32; 2], radius: f32, from: f32, to: f32) -> Vec<Stroke> {
    let pieces = ((to - from).abs() * 72.0).ceil() as u32;
    let point = |piece: u32| {
        let turn = from + (to - from) * piece as f32 / pieces as f32;
        Vec2::from(centre) + Vec2::from_angle(turn * TAU) * radius
    };
    joined(&(0..=pieces).map(point).collect::<Vec<_>>()).collect()
}

/// Strokes, sorted into square cells so that only the near ones are looked at.
struct Figure {
    low: Vec2,
    columns: usize,
    rows: usize,
    cells: Vec<Vec<Stroke>>,
}

impl Figure {
    /// Size of a cell in millimetres.
    const CELL: f32 = 4.0;
    /// Distances beyond this many millimetres do not matter.
    const REACH: f32 = 2.0;

    fn new(strokes: &[Stroke]) -> Self {
        let ends = || strokes.iter().flatten().copied();
        let low = ends().fold(Vec2::INFINITY, Vec2::min) - Self::REACH;
        let high = ends().fold(Vec2::NEG_INFINITY, Vec2::max) + Self::REACH;
        let count = ((high - low) / Self::CELL).ceil();
        let (columns, rows) = (count.x as usize, count.y as usize);
        let near = |index: usize| {
            let corner =
                low + Vec2::new((index % columns) as f32, (index / columns) as f32) * Self::CELL;
            let (least, most) = (corner - Self::REACH, corner + Self::CELL + Self::REACH);
            let crosses =
                |&[a, b]: &Stroke| a.min(b).cmple(most).all() && a.max(b).cmpge(least).all();
            strokes.iter().copied().filter(crosses).collect()
        };
        Self {
            low,
            columns,
            rows,
            cells: (0..columns * rows).map(near).collect(),
        }
    }

    /// Millimetres to the nearest stroke, when one is near.
    fn distance(&self, p: Vec2) -> Option<f32> {
        let cell = ((p - self.low) / Self::CELL).floor();
        let (column, row) = (cell.x as usize, cell.y as usize);
        if cell.min_element() < 0.0 || column >= self.columns || row >= self.rows {
            return None;
        }
        let strokes = self.cells[row * self.columns + column].iter();
        strokes.map(|&stroke| distance(p, stroke)).reduce(f32::min)
    }
}

/// The distance of a point from a stroke.
fn distance(p: Vec2, [a, b]: Stroke) -> f32 {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    p.distance(a + along * t)
}

/// What is stamped into the tab, in the coordinates of its unfolded sheet.
pub(crate) fn stamp(place: Vec2) -> Option<f32> {
    static STAMP: LazyLock<Figure> = LazyLock::new(|| {
        Figure::new(
            &[
                text("TAB", [-7.5, 28.0], 6.0),
                text("1990", [-9.5, 42.0], 5.0),
            ]
            .concat(),
        )
    });
    STAMP.distance(place)
}

/// What is printed along the screwdriver's handle.
pub(crate) fn print(place: Vec2) -> Option<f32> {
    static PRINT: LazyLock<Figure> =
        LazyLock::new(|| Figure::new(&text("TRICURVE", [0.0, -3.0], 6.0)));
    PRINT.distance(place)
}

/// A workshop drawing of the tab, lettered; heavy lines first, fine ones second.
pub(crate) fn drawing(place: Vec2) -> [Option<f32>; 2] {
    static LINES: LazyLock<[Figure; 2]> = LazyLock::new(|| {
        let heavy = [
            path(&[
                [-85.0, -62.0],
                [85.0, -62.0],
                [85.0, 62.0],
                [-85.0, 62.0],
                [-85.0, -62.0],
            ]),
            // Front view: the sheet with its rounded top, the bore and two holes.
            path(&[[-30.0, 14.0], [-30.0, -38.0], [-72.0, -38.0], [-72.0, 14.0]]),
            arc([-51.0, 14.0], 21.0, 0.0, 0.5),
            arc([-51.0, 14.0], 10.0, 0.0, 1.0),
            arc([-62.0, -24.0], 4.0, 0.0, 1.0),
            arc([-40.0, -24.0], 4.0, 0.0, 1.0),
            // Side view: the fold.
            path(&[[-6.0, 35.0], [-6.0, -30.0]]),
            path(&[[-2.0, 35.0], [-2.0, -28.0]]),
            path(&[[-6.0, 35.0], [-2.0, 35.0]]),
            arc([4.0, -28.0], 6.0, 0.5, 0.75),
            arc([4.0, -28.0], 10.0, 0.5, 0.75),
            path(&[[4.0, -34.0], [30.0, -34.0], [30.0, -38.0], [4.0, -38.0]]),
            // Title block.
            path(&[[14.0, -62.0], [14.0, -46.0], [85.0, -46.0]]),
            text("TRICURVE", [20.0, -58.0], 8.0),
            text("TAB", [52.0, 44.0], 11.0),
        ];
        let fine = [
            path(&[[-51.0, 42.0], [-51.0, -44.0]]),
            path(&[[-78.0, 14.0], [-24.0, 14.0]]),
            path(&[[-72.0, -40.0], [-72.0, -52.0]]),
            path(&[[-30.0, -40.0], [-30.0, -52.0]]),
            path(&[[-72.0, -50.0], [-30.0, -50.0]]),
            path(&[[-69.0, -48.8], [-72.0, -50.0], [-69.0, -51.2]]),
            path(&[[-33.0, -48.8], [-30.0, -50.0], [-33.0, -51.2]]),
            text("90", [-54.0, -48.5], 5.0),
            // A pictorial view of the folded part.
            path(&[
                [38.0, -14.0],
                [62.0, -26.0],
                [78.0, -12.0],
                [54.0, 0.0],
                [38.0, -14.0],
            ]),
            path(&[[54.0, 0.0], [54.0, 30.0], [78.0, 18.0], [78.0, -12.0]]),
            arc([66.0, 9.0], 6.0, 0.0, 1.0),
            arc([56.0, -14.0], 3.0, 0.0, 1.0),
        ];
        [Figure::new(&heavy.concat()), Figure::new(&fine.concat())]
    });
    LINES.each_ref().map(|figure| figure.distance(place))
}
