//! Which file became which view, position and scan: said at every start, and recorded.

use std::fmt::Write as _;

use capture::Source;
use serde_json::{Value, json};

/// Scans, or frames of a rail, that are shown at each end of more.
const SHOWN: u64 = 2;
/// Characters of a file's name that are shown.
const NAME: usize = 44;
/// The most scans whose files are recorded.
const RECORDED: u64 = 10_000;

/// What a recording keeps of it: how the images lay, and the files of each scan's views.
pub(super) fn recorded(source: &Source) -> Option<Value> {
    let layout = source.layout()?;
    let scenes = source.scenes();
    let files: Vec<Vec<String>> = (0..scenes.min(RECORDED))
        .map(|scan| source.files(scan))
        .collect();
    let views = match source.rail() {
        Some(_) => Vec::new(),
        None => source.views(0),
    };
    let views: Vec<Value> = views
        .iter()
        .zip(view_names(views.len()))
        .map(|(view, name)| json!({ "view": name, "number": view.number, "position_steps": view.position_steps }))
        .collect();
    Some(json!({ "layout": layout.to_string(), "views": views, "scenes": scenes, "files": files }))
}

/// The names of so many views, left to right.
fn view_names(count: usize) -> Vec<String> {
    match count {
        3 => ["left", "centre", "right"].map(str::to_owned).to_vec(),
        _ => (0..count).map(|view| view.to_string()).collect(),
    }
}

/// How a source was read; of a rendered scene and of cameras there is nothing to say.
pub(super) fn table(source: &Source) -> Option<String> {
    let layout = source.layout()?;
    let scenes = source.scenes();
    let mut text = String::new();
    let what = match (source.rail(), scenes) {
        (Some(_), frames) => format!("{frames} frames"),
        (None, 1) => format!("1 scan of {} views", source.view_count()),
        (None, scans) => format!("{scans} scans of {} views", source.view_count()),
    };
    let mut line = |line: String| writeln!(text, "{}", line.trim_end()).unwrap_or_default();
    line(format!("read as {} ({layout}): {what}", layout.describe()));
    // The first and the last ones; where only one would be left out it is shown.
    let shown: Vec<Option<u64>> = match scenes {
        0..=5 => (0..scenes).map(Some).collect(),
        _ => {
            let first = (0..SHOWN).map(Some);
            first
                .chain([None])
                .chain((scenes - SHOWN..scenes).map(Some))
                .collect()
        }
    };
    if source.rail().is_some() {
        for scan in shown {
            line(match scan {
                Some(scan) => {
                    let place = source
                        .position_m(scan)
                        .map_or(String::new(), |place| format!("{place:>12.4} m"));
                    format!(
                        "  frame {scan:<7} {:<NAME$}{place}",
                        short(&source.files(scan).join(", "))
                    )
                }
                None => "  …".to_owned(),
            });
        }
        return Some(text.trim_end().to_owned());
    }
    let columns: Vec<Vec<String>> = shown
        .iter()
        .map(|scan| match scan {
            Some(scan) => {
                let files = source.files(*scan);
                let heading = format!("scan {scan}");
                std::iter::once(heading)
                    .chain(files.iter().map(|file| short(file)))
                    .collect()
            }
            None => vec!["…".to_owned(); source.view_count() + 1],
        })
        .collect();
    let widths: Vec<usize> = columns
        .iter()
        .map(|column| {
            column
                .iter()
                .map(|cell| cell.chars().count())
                .max()
                .unwrap_or_default()
        })
        .collect();
    let row = |number: usize| {
        let cells = columns.iter().zip(&widths);
        let cells = cells.map(|(column, width)| format!("  {:<width$}", column[number]));
        cells.collect::<String>()
    };
    line(format!("  {:<8}{:>5}{}", "view", "place", row(0)));
    let views = source.views(0);
    for (number, (view, name)) in views.iter().zip(view_names(views.len())).enumerate() {
        line(format!(
            "  {name:<8}{:>5}{}",
            view.position_steps,
            row(number + 1)
        ));
    }
    Some(text.trim_end().to_owned())
}

/// The end of a name that is too long.
fn short(name: &str) -> String {
    let length = name.chars().count();
    match length > NAME {
        true => std::iter::once('…')
            .chain(name.chars().skip(length - NAME + 1))
            .collect(),
        false => name.to_owned(),
    }
}
