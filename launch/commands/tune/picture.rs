//! A sweep as one picture: a cell a combination, coloured by what it covers, with its errors written in it.
//!
//! The first two settings swept are a field's columns and rows; of the others each combination has a field of its own. A
//! frame marks what the profile sets, a ring where the automatic thresholds of these scenes lie.

use std::fmt::Write as _;

use messages::record::Colours;
use serde_json::Value;

use super::Line;
use super::sweep::Axis;
use crate::parameters::is_same;

/// Side lengths of a cell, in pixels.
const CELL: [f64; 2] = [86.0, 46.0];

/// Room around a field for its title and the values of its axes.
const LEFT: f64 = 84.0;
const TOP: f64 = 64.0;
const BELOW: f64 = 44.0;
const GAP: f64 = 26.0;

/// Most that a row of fields is wide.
const WIDEST: f64 = 1500.0;

/// What is marked in the picture.
#[derive(Clone, Debug, Default)]
pub(super) struct Marks {
    /// Per axis what the profile and `--set` say.
    pub(super) set: Vec<Value>,
    /// The automatic HIGH and LOW of the scenes' finest channels, means, in the units that are swept.
    pub(super) automatic: Option<[f64; 2]>,
}

/// Draws the combinations of at least one axis.
pub(super) fn svg(axes: &[Axis], lines: &[Line], marks: &Marks) -> String {
    let one = [Value::Null];
    let columns = axes.first().map_or(&one[..], Axis::values);
    let rows = axes.get(1).map_or(&one[..], Axis::values);
    let rest = axes.get(2..).unwrap_or_default();
    let mut fields: Vec<&[Value]> = Vec::new();
    for line in lines {
        let own = line.values.get(2..).unwrap_or_default();
        if !fields.contains(&own) {
            fields.push(own);
        }
    }
    // In the order in which the values were given.
    let place = |axis: &Axis, value: &Value| axis.values().iter().position(|v| v == value);
    fields.sort_by_key(|own| {
        let places = rest.iter().zip(*own);
        places
            .map(|(axis, value)| place(axis, value))
            .collect::<Vec<_>>()
    });
    let field = [
        LEFT + CELL[0] * columns.len() as f64 + GAP,
        TOP + CELL[1] * rows.len() as f64 + BELOW,
    ];
    let across = ((WIDEST / field[0]) as usize).clamp(1, fields.len().max(1));
    let down = fields.len().div_ceil(across);
    let (width, height) = (field[0] * across as f64, field[1] * down as f64 + 54.0);
    let most = lines.iter().map(|line| line.coverage).fold(0.01, f64::max);
    let mut out = String::new();
    let mut put = |text: String| out.push_str(&text);
    put(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
         height=\"{height:.0}\" font-family=\"system-ui, sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    ));
    let colours = Colours::new();
    for (at, own) in fields.iter().enumerate() {
        let left = field[0] * (at % across) as f64 + LEFT;
        let top = field[1] * (at / across) as f64 + TOP;
        let title: Vec<String> = rest
            .iter()
            .zip(*own)
            .map(|(axis, value)| format!("{} = {value}", axis.name()))
            .collect();
        put(text(left, top - 42.0, "start", "#111", &title.join(", ")));
        let middle = left + CELL[0] * columns.len() as f64 / 2.0;
        let name = |axis: usize| axes.get(axis).map_or(String::new(), Axis::name);
        put(text(middle, top - 24.0, "middle", "#555", &name(0)));
        put(text(left - 8.0, top - 7.0, "end", "#555", &name(1)));
        for (column, value) in columns.iter().enumerate() {
            let x = left + CELL[0] * (column as f64 + 0.5);
            put(text(x, top - 7.0, "middle", "#111", &shown(value)));
        }
        for (row, value) in rows.iter().enumerate() {
            let y = top + CELL[1] * (row as f64 + 0.5) + 4.0;
            put(text(left - 8.0, y, "end", "#111", &shown(value)));
        }
        for line in lines {
            let is_here = line.values.get(2..).unwrap_or_default() == *own;
            let column = columns.iter().position(|v| Some(v) == line.values.first());
            let row = match axes.len() {
                0 | 1 => Some(0),
                _ => rows.iter().position(|v| Some(v) == line.values.get(1)),
            };
            let (true, Some(column), Some(row)) = (is_here, column, row) else {
                continue;
            };
            let [x, y] = [left + CELL[0] * column as f64, top + CELL[1] * row as f64];
            let share = line.coverage / most;
            let [r, g, b] = colours.of(share as f32);
            let bright = 0.3 * f64::from(r) + 0.6 * f64::from(g) + 0.1 * f64::from(b);
            let ink = if bright > 140.0 { "#111" } else { "#fff" };
            let is_set = line.values.len() == marks.set.len()
                && line
                    .values
                    .iter()
                    .zip(&marks.set)
                    .all(|(a, b)| is_same(a, b));
            put(format!(
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"#{r:02x}{g:02x}{b:02x}\" \
                 stroke=\"{}\" stroke-width=\"{}\"/>\n",
                x + 2.0,
                y + 2.0,
                CELL[0] - 4.0,
                CELL[1] - 4.0,
                if is_set { "#d4145a" } else { "none" },
                if is_set { 4 } else { 0 },
            ));
            let centre = x + CELL[0] / 2.0;
            put(text(
                centre,
                y + 20.0,
                "middle",
                ink,
                &format!("{:.3}", line.coverage),
            ));
            let errors = match line.mismatches {
                Some(mismatches) => format!("{mismatches} wrong"),
                None => format!("{:.2} %", 100.0 * line.error()),
            };
            put(text(centre, y + 37.0, "middle", ink, &errors));
        }
        if let Some(automatic) = marks.automatic {
            let [high, low] = automatic;
            let x = left + CELL[0] * along(columns, high);
            let y = top + CELL[1] * along(rows, low);
            put(format!(
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"11\" fill=\"none\" stroke=\"#000\" stroke-width=\"5\"/>\
                 <circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"11\" fill=\"none\" stroke=\"#fff\" stroke-width=\"2\"/>\n"
            ));
        }
    }
    let mut legend = String::from("colour and first number: coverage; below: ");
    let has_truth = lines.iter().any(|line| line.mismatches.is_some());
    legend.push_str(match has_truth {
        true => "points of all scenes that are off by over 2 px",
        false => "points that the other reference view contradicts",
    });
    legend.push_str("; framed: as set");
    if let Some([high, low]) = marks.automatic {
        write!(
            legend,
            "; ring: automatic thresholds, {high:.1} and {low:.1}"
        )
        .unwrap_or_default();
    }
    put(text(12.0, height - 20.0, "start", "#333", &legend));
    put("</svg>\n".to_owned());
    out
}

fn text(x: f64, y: f64, anchor: &str, fill: &str, text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    format!(
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"{fill}\">{text}</text>\n"
    )
}

/// A value as an axis shows it.
fn shown(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// Where a number lies among the values of an axis, in cells: between their middles by its logarithm, at the edge where it is
/// beyond them.
fn along(values: &[Value], number: f64) -> f64 {
    let numbers: Vec<f64> = values.iter().filter_map(Value::as_f64).collect();
    let (Some(&first), Some(&last)) = (numbers.first(), numbers.last()) else {
        return 0.5;
    };
    let beyond = |end: f64| {
        if first <= last {
            number <= end
        } else {
            number >= end
        }
    };
    if beyond(first) {
        return if number == first { 0.5 } else { 0.0 };
    }
    for (at, pair) in numbers.windows(2).enumerate() {
        if beyond(pair[1]) {
            let share = (number / pair[0]).ln() / (pair[1] / pair[0]).ln();
            return at as f64 + 0.5 + share.clamp(0.0, 1.0);
        }
    }
    numbers.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_number_lies_between_the_middles_of_its_neighbours_or_at_the_edge() {
        let values = [json!(8), json!(32), json!(128)];
        for (number, place) in [
            (8.0, 0.5),
            (16.0, 1.0),
            (32.0, 1.5),
            (64.0, 2.0),
            (4.0, 0.0),
            (200.0, 3.0),
        ] {
            assert!((along(&values, number) - place).abs() < 1e-9, "{number}");
        }
    }

    #[test]
    fn every_combination_has_its_cell_and_what_is_set_a_frame() {
        let axes = [
            "track.high=32,64",
            "track.low=16,32",
            "track.tolerance_degrees=3,10",
        ];
        let axes: Vec<Axis> = axes
            .iter()
            .filter_map(|text| Axis::parse(text).ok())
            .collect();
        let mut lines = Vec::new();
        for (high, low, angle) in [32, 64].into_iter().flat_map(|high| {
            [16, 32]
                .into_iter()
                .flat_map(move |low| [3, 10].map(|angle| (high, low, angle)))
        }) {
            lines.push(Line {
                values: vec![json!(high), json!(low), json!(angle)],
                coverage: f64::from(high + low + angle) / 200.0,
                bad_1: Some(0.0),
                mismatches: Some(angle),
                contradicted: 0.0,
                on_front: false,
            });
        }
        let marks = Marks {
            set: vec![json!(64), json!(32), json!(10)],
            automatic: Some([40.0, 20.0]),
        };
        let drawn = svg(&axes, &lines, &marks);
        assert_eq!(drawn.matches("<rect ").count(), 1 + 8);
        assert_eq!(drawn.matches("#d4145a").count(), 1);
        assert_eq!(
            drawn.matches("<circle ").count(),
            2 * 2,
            "a ring in either field"
        );
        assert_eq!(drawn.matches("track.tolerance_degrees = 10").count(), 1);
        assert_eq!(drawn.matches(">10 wrong<").count(), 4);
    }
}
