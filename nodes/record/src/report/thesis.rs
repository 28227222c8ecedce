//! The thesis's figures as one page, beside the truth.

use std::io::{BufWriter, Write as _};
use std::path::Path;

use maud::{Markup, html};

use super::accuracy::Scores;
use super::page::{self, Album, Shown, count, missing};
use super::{Fault, ReportError, Rivals, accuracy};
use crate::compact::compact;
use crate::export::{ExportError, not_onto_itself, whole};
use crate::thesis::{figures, objects, per_object};
use crate::{Info, Recording};

/// Writes the page of the thesis's figures, and gives the scans shown.
///
/// # Errors
/// When it cannot be written, or must not be; it is there whole or not at all.
pub fn thesis(
    recording: &mut Recording,
    path: &Path,
    overwrite: bool,
    rivals: &mut Rivals<'_>,
) -> Result<Vec<u64>, ReportError> {
    not_onto_itself(recording, path)?;
    if !overwrite && path.is_file() {
        return Err(ReportError::Exists(path.to_owned()));
    }
    let objects = objects(recording);
    let Some(first) = objects.first() else {
        return Err(ExportError::NoScan.into());
    };
    // A recording without images, or without what is drawn over them, has no figures at all.
    figures(recording, first, 1)?;
    whole(path, |file| {
        let mut file = BufWriter::new(file);
        write(recording, &objects, rivals, &mut |html| {
            file.write_all(html.as_bytes())?;
            html.clear();
            Ok(())
        })
        .and_then(|()| Ok(file.flush()?))
        .map_err(|fault| ExportError::Io {
            path: path.to_owned(),
            source: fault.into(),
        })
    })?;
    Ok(objects.into_iter().map(|(scan, _)| scan).collect())
}

fn write(
    recording: &mut Recording,
    objects: &[(u64, String)],
    rivals: &mut Rivals<'_>,
    flush: &mut dyn FnMut(&mut String) -> std::io::Result<()>,
) -> Result<(), Fault> {
    let mut put = |part: Markup| {
        let mut html = part.into_string();
        page::printable(&mut html);
        flush(&mut html)
    };
    let info = Info::of(recording);
    let file = info.path.file_name().unwrap_or_default().to_string_lossy();
    let per_object = per_object(recording);
    let mut sections: Vec<(String, String)> = objects
        .iter()
        .map(|(scan, object)| (format!("scan-{scan}"), object.clone()))
        .collect();
    if accuracy::is_there(recording) {
        sections.push(("accuracy".to_owned(), "Accuracy".to_owned()));
    }
    put(page::begin(&format!("{file}: the thesis's figures")))?;
    put(html! {
        header.head {
            p.eyebrow { "tricurve · the thesis's figures" }
            h1 { (file) }
            p.lede {
                "B.1 to B." (count((per_object * objects.len()) as u64)) ": " (per_object)
                " figures of each object. They are drawn from the recording; what they show is what the nodes sent each \
                 other."
            }
        }
        "\n"
        (page::navigation(&sections))
    })?;
    let mut album = Album::default();
    for (at, object) in objects.iter().enumerate() {
        let (scan, name) = object;
        let shown = match figures(recording, object, 1 + at * per_object) {
            Ok(figures) => {
                let mut shown = Vec::new();
                for figure in figures {
                    let title = figure.title();
                    let caption = figure.step.caption();
                    let of = Shown {
                        class: "",
                        alt: &format!("{title}: {caption}"),
                        caption: html! { b { (title) } ": " (caption) "." },
                    };
                    let png = compact(&figure.picture)?;
                    shown.push(album.picture(&png, figure.picture.size, of));
                }
                shown
            }
            Err(error) => vec![missing(error)],
        };
        put(html! {
            section id={ "scan-" (scan) } {
                h2 { (name) }
                div.sheets { @for figure in &shown { (figure) } }
            }
            "\n"
        })?;
    }
    let scans: Vec<u64> = objects.iter().map(|(scan, _)| *scan).collect();
    let none = Scores::read(recording, &[]);
    put(accuracy::section(recording, &scans, &none, rivals))?;
    put(page::end())?;
    Ok(())
}
