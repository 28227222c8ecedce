//! How good the results are, where the recording holds an evaluation against the truth.

use std::fmt::{self, Write as _};

use messages::{Evaluation, Kind, Owned, Score, Topic};

use super::page::{count, escape, missing};
use super::plot::{self, Series};
use super::title;
use crate::Recording;

/// False targets of several methods in one scan, found out beside the recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mismatches {
    /// What the methods are called.
    pub methods: Vec<String>,
    /// By channel, and last of the result: for each method how many mismatches of how many points with known truth.
    pub rows: Vec<(String, Vec<(u32, u32)>)>,
}

/// Gives a scan's mismatches, where they can be found out.
pub type Rivals<'a> = dyn FnMut(&mut Recording, u64) -> Option<Mismatches> + 'a;

/// The section, when there is an evaluation: figures of the scans shown, and of all scans over time.
pub(super) fn section(
    out: &mut String,
    recording: &mut Recording,
    shown: &[u64],
    plotted: &[u64],
    rivals: &mut Rivals<'_>,
) -> fmt::Result {
    if !is_there(recording) {
        return Ok(());
    }
    let Some(topic) = Topic::of(&recording.metadata().rig, Kind::Evaluation).pop() else {
        return Ok(());
    };
    out.push_str(
        "<section id=\"accuracy\"><h2>Accuracy</h2><p>Against the truth of the reference view. Coverage: share of its edge \
         pixels (Canny) with known truth that have a point within one pixel. Bad: share of the points whose disparity is \
         off by more than so many pixels from every truth within two columns; rows too: and, along level contours, within three \
         rows. Mismatches: points off by over two pixels from every truth around them, false \
         targets.</p>",
    );
    for &scan in shown {
        write!(out, "<h3>{}</h3>", escape(title(recording, scan)))?;
        match recording.read::<Evaluation>(scan, &topic) {
            Ok(evaluation) => {
                out.push_str("<div class=\"grid two\">");
                scores(out, recording, &evaluation)?;
                surest(out, &evaluation)?;
                out.push_str("</div>");
            }
            Err(error) => missing(out, error)?,
        }
        if let Some(mismatches) = rivals(recording, scan) {
            table_of(out, &mismatches)?;
        }
    }
    let mut results: Vec<(u64, Score)> = Vec::new();
    for &scan in plotted {
        let read = recording.read::<Evaluation>(scan, &topic);
        let first = read
            .ok()
            .and_then(|read| read.view().scores.first().copied());
        results.extend(first.map(|score| (scan, score)));
    }
    if results.len() > 1 {
        let numbers: Vec<u64> = results.iter().map(|(scan, _)| *scan).collect();
        let series = |name: &str, of: fn(&Score) -> f64| Series {
            name: name.to_owned(),
            values: results.iter().map(|(_, score)| of(score)).collect(),
        };
        out.push_str("<h3>Over all scans</h3><div class=\"grid three\">");
        let coverage = series("coverage", |score| 100.0 * f64::from(score.coverage));
        plot::lines(out, "coverage", "%", &numbers, &[coverage])?;
        let bad = [
            series("over 0.5 px", |score| 100.0 * f64::from(score.bad_half)),
            series("over 1 px", |score| 100.0 * f64::from(score.bad_one)),
            series("over 2 px", |score| 100.0 * f64::from(score.bad_two)),
        ];
        plot::lines(out, "points that are off", "%", &numbers, &bad)?;
        let median = series("median", |score| f64::from(score.median));
        plot::lines(out, "median error", "px", &numbers, &[median])?;
        out.push_str("</div>");
    }
    out.write_str("</section>\n")
}

/// Whether the recording has such a section.
pub(super) fn is_there(recording: &Recording) -> bool {
    recording.channels().contains_key(Kind::Evaluation.name())
}

/// The figures of the result and of each channel.
fn scores(out: &mut String, recording: &Recording, evaluation: &Owned<Evaluation>) -> fmt::Result {
    out.push_str(
        "<div class=\"wide\"><table><thead><tr><th>channel</th><th class=\"n\">coverage</th><th class=\"n\">bad 0.5 %</th>\
         <th class=\"n\">bad 1 %</th><th class=\"n\">bad 2 %</th><th class=\"n\">rows too: bad 1 %</th>\
         <th class=\"n\">bad 2 %</th><th class=\"n\">median px</th><th class=\"n\">points</th>\
         <th class=\"n\">mismatches</th></tr></thead><tbody>",
    );
    let channels = &recording.metadata().rig.channels;
    for score in evaluation.view().scores {
        let channel = match channels.get(score.channel as usize) {
            Some(variance) => format!("σ² = {variance}"),
            None => "all".to_owned(),
        };
        let percent = |share: f32| format!("{:.2}", 100.0 * share);
        writeln!(
            out,
            "<tr><td>{channel}</td><td class=\"n\">{:.3}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
             <td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{:.3}</td>\
             <td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            score.coverage,
            percent(score.bad_half),
            percent(score.bad_one),
            percent(score.bad_two),
            percent(score.bad_one_rows_too()),
            percent(score.bad_two_rows_too()),
            score.median,
            count(score.points.into()),
            count(score.mismatches.into()),
        )?;
    }
    out.write_str("</tbody></table></div>")
}

/// What the surest points amount to.
fn surest(out: &mut String, evaluation: &Owned<Evaluation>) -> fmt::Result {
    out.push_str(
        "<div class=\"wide\"><table><thead><tr><th class=\"n\">surest %</th><th class=\"n\">score from</th>\
         <th class=\"n\">coverage</th><th class=\"n\">bad 1 %</th></tr></thead><tbody>",
    );
    for share in evaluation.view().curve.iter().skip(3).step_by(4) {
        writeln!(
            out,
            "<tr><td class=\"n\">{:.0}</td><td class=\"n\">{:.3}</td><td class=\"n\">{:.3}</td>\
             <td class=\"n\">{:.2}</td></tr>",
            100.0 * share.share,
            share.score,
            share.coverage,
            100.0 * share.bad_one,
        )?;
    }
    out.write_str("</tbody></table></div>")
}

/// The thesis's table.
fn table_of(out: &mut String, mismatches: &Mismatches) -> fmt::Result {
    out.push_str(
        "<p>Mismatches of three methods on the same curves, as the thesis compares them:</p><div class=\"wide\"><table>\
         <thead><tr><th>channel</th>",
    );
    for method in &mismatches.methods {
        write!(out, "<th class=\"n\">{}</th>", escape(method))?;
    }
    out.push_str("</tr></thead><tbody>");
    for (channel, cells) in &mismatches.rows {
        write!(out, "<tr><td>{}</td>", escape(channel))?;
        for (wrong, points) in cells {
            let (wrong, points) = (count((*wrong).into()), count((*points).into()));
            write!(out, "<td class=\"n\">{wrong} of {points}</td>")?;
        }
        out.push_str("</tr>");
    }
    out.write_str("</tbody></table></div>")
}
