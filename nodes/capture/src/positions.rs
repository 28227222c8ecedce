//! Where a camera stood along its rail when it took each frame: a file that an encoder or a robot wrote.
//!
//! One line a frame, numbers separated by commas, semicolons or white space; the first line names the columns. One of
//! them is `position_m`, `position_mm`, `position_um` or `position_steps`; a column `frame`, if there is one, counts the
//! frames from 0. Other columns are ignored, and so are empty lines and lines that begin with `#`.

use std::fs;
use std::path::Path;

use crate::error::SourceError;

/// Names of columns, and how many metres one of their units is; steps have no length.
const UNITS: [(&str, Option<f64>); 4] = [
    ("position_m", Some(1.0)),
    ("position_mm", Some(1e-3)),
    ("position_um", Some(1e-6)),
    ("position_steps", None),
];

/// The positions of all frames.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Positions {
    /// In order.
    pub(crate) values: Vec<f64>,
    /// Whether they are metres, or steps of unknown length.
    pub(crate) in_metres: bool,
}

/// Reads a file of positions, at least `frames` of them.
pub(crate) fn read(path: &Path, frames: usize) -> Result<Positions, SourceError> {
    let text = fs::read_to_string(path).map_err(SourceError::io(path))?;
    parse(&text, frames).map_err(|why| SourceError::Positions {
        path: path.to_owned(),
        why,
    })
}

fn parse(text: &str, frames: usize) -> Result<Positions, String> {
    // Spreadsheets put a byte order mark before it.
    let text = text.trim_start_matches('\u{feff}');
    let cells = |line: &str| -> Vec<String> {
        let split = line.split(|c: char| c == ',' || c == ';' || c.is_whitespace());
        let cells = split.filter(|cell| !cell.is_empty());
        cells
            .map(|cell| cell.trim_matches('"').to_owned())
            .collect()
    };
    let is_said =
        |(_, line): &(usize, &str)| !line.trim().is_empty() && !line.trim().starts_with('#');
    let mut lines = (1..).zip(text.lines()).filter(is_said);
    let names = || UNITS.map(|(name, _)| name).join(", ");
    let (_, head) = lines.next().ok_or_else(|| "it is empty".to_owned())?;
    let head = cells(head);
    let unit = |name: &String| UNITS.iter().find(|(known, _)| known == name);
    let found = head
        .iter()
        .enumerate()
        .find_map(|(at, name)| Some((at, unit(name)?)));
    let Some((column, &(_, metres))) = found else {
        return Err(format!(
            "its first line must name a column with its unit, one of {}; it says {:?}",
            names(),
            head.join(",")
        ));
    };
    let counter = head.iter().position(|name| name == "frame");
    let mut values = Vec::new();
    // What comes after the last frame is of no frame.
    for (number, line) in lines {
        if values.len() == frames {
            break;
        }
        let cells = cells(line);
        if cells.len() > head.len() {
            return Err(format!(
                "line {number} has {} values, and the first line names {}; numbers are written with a point, as in 12.5",
                cells.len(),
                match head.len() {
                    1 => "1 column".to_owned(),
                    columns => format!("{columns} columns"),
                }
            ));
        }
        let value = |column: usize| -> Result<f64, String> {
            let cell = cells.get(column).map_or("", |cell| cell);
            let value = cell.parse().ok().filter(|value: &f64| value.is_finite());
            value.ok_or_else(|| {
                format!(
                    "line {number} must have a number in column {}, not {cell:?}",
                    column + 1
                )
            })
        };
        if let Some(counter) = counter {
            let frame = value(counter)?;
            if frame != values.len() as f64 {
                return Err(format!(
                    "line {number} must be of frame {}, not {frame}: frames are counted from 0 without gaps",
                    values.len()
                ));
            }
        }
        values.push(value(column)? * metres.unwrap_or(1.0));
    }
    if values.len() < frames {
        return Err(format!(
            "it says where {} frames were taken, and there are {frames}",
            values.len()
        ));
    }
    Ok(Positions {
        values,
        in_metres: metres.is_some(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_in_the_head() {
        let read = |text| parse(text, 2).map(|positions| (positions.values, positions.in_metres));
        assert_eq!(read("position_mm\n0\n2.5\n"), Ok((vec![0.0, 0.0025], true)));
        assert_eq!(
            read("frame;position_m;t\n0;1;9\n\n# x\n1;0.5;9\n7"),
            read("position_m\n1\n0.5")
        );
        assert_eq!(read("position_steps\n0\n-1"), Ok((vec![0.0, -1.0], false)));
        let of_a_spreadsheet = "\u{feff}frame;position_mm\r\n0;0\r\n1;2.5\r\n";
        assert_eq!(read(of_a_spreadsheet), Ok((vec![0.0, 0.0025], true)));
    }

    #[test]
    fn what_is_wrong_is_said_in_a_sentence() {
        for (text, expected) in [
            ("", "it is empty"),
            (
                "0\n1\n2",
                "its first line must name a column with its unit, one of position_m, position_mm, position_um, position_steps; it says \"0\"",
            ),
            (
                "position_m\n1",
                "it says where 1 frames were taken, and there are 2",
            ),
            (
                "position_m\n1\nx",
                "line 3 must have a number in column 1, not \"x\"",
            ),
            (
                "frame,position_m\n0,1\n2,3",
                "line 3 must be of frame 1, not 2: frames are counted from 0 without gaps",
            ),
            (
                "frame;position_mm\n0;0,0\n1;12,5",
                "line 2 has 3 values, and the first line names 2 columns; numbers are written with a point, as in 12.5",
            ),
            (
                "position_m\n1\nnan",
                "line 3 must have a number in column 1, not \"nan\"",
            ),
        ] {
            assert_eq!(parse(text, 2), Err(expected.to_owned()), "{text:?}");
        }
    }
}
