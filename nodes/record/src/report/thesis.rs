//! The thesis's figures as one page, beside the truth.

use std::io::{BufWriter, Write as _};
use std::path::Path;

use super::page::{self, Shown, count, escape, missing, picture};
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
    use std::fmt::Write as _;
    let info = Info::of(recording);
    let file = info.path.file_name().unwrap_or_default().to_string_lossy();
    let mut html = String::new();
    page::begin(&mut html, &format!("{file}: the thesis's figures"))?;
    let per_object = per_object(recording);
    write!(
        html,
        "<header class=\"head\"><p class=\"eyebrow\">tricurve · the thesis's figures</p><h1>{}</h1>\
         <p class=\"lede\">B.1 to B.{}: {} figures of each object. They are drawn from the recording; what they show is \
         what the nodes sent each other.</p></header>\n<nav aria-label=\"sections\">",
        escape(&file),
        count((per_object * objects.len()) as u64),
        per_object
    )?;
    for (scan, object) in objects {
        write!(html, "<a href=\"#scan-{scan}\">{}</a>", escape(object))?;
    }
    if accuracy::is_there(recording) {
        html.push_str("<a href=\"#accuracy\">Accuracy</a>");
    }
    html.push_str("</nav>\n");
    for (at, object) in objects.iter().enumerate() {
        let (scan, name) = object;
        write!(
            html,
            "<section id=\"scan-{scan}\"><h2>{}</h2>",
            escape(name)
        )?;
        match figures(recording, object, 1 + at * per_object) {
            Ok(figures) => {
                for figure in figures {
                    let title = figure.title();
                    let caption = figure.step.caption();
                    let shown = Shown {
                        class: "",
                        alt: &format!("{title}: {caption}"),
                        caption: &format!("<b>{}</b>: {caption}.", escape(&title)),
                    };
                    let png = compact(&figure.picture)?;
                    picture(&mut html, &png, figure.picture.size, &shown)?;
                }
            }
            Err(error) => missing(&mut html, error)?,
        }
        html.push_str("</section>\n");
        flush(&mut html)?;
    }
    let scans: Vec<u64> = objects.iter().map(|(scan, _)| *scan).collect();
    accuracy::section(&mut html, recording, &scans, &[], rivals)?;
    page::end(&mut html)?;
    flush(&mut html)?;
    Ok(())
}
