//! How good the results are, where the recording holds an evaluation against the truth.

use maud::{Markup, html};
use messages::{Evaluation, Kind, Owned, Score, Topic};

use super::page::{Figure, count, missing, percent, table};
use super::plot::{self, Quantity, Series};
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

/// The scores of the results of many scans.
pub(super) struct Scores(Vec<(u64, Score)>);

impl Scores {
    /// Of these scans.
    pub(super) fn read(recording: &mut Recording, scans: &[u64]) -> Self {
        let topic = Topic::of(&recording.metadata().rig, Kind::Evaluation).pop();
        let (true, Some(topic)) = (is_there(recording), topic) else {
            return Self(Vec::new());
        };
        let mut scores = Vec::new();
        for &scan in scans {
            let read = recording.read::<Evaluation>(scan, &topic);
            let first = read
                .ok()
                .and_then(|read| read.view().scores.first().copied());
            scores.extend(first.map(|score| (scan, score)));
        }
        Self(scores)
    }

    /// One number of each scan.
    fn of(&self, of: impl Fn(&Score) -> f64) -> Vec<f64> {
        self.0.iter().map(|(_, score)| of(score)).collect()
    }

    /// What is to be seen at once: medians over the scans.
    pub(super) fn figures(&self) -> Vec<Figure> {
        let figure = |name: &str, values: Vec<f64>, unit: &str| {
            Some(Figure {
                name: name.to_owned(),
                value: plot::median(&values)?,
                unit: unit.to_owned(),
            })
        };
        [
            figure("Edges covered", self.of(coverage), "%"),
            figure(
                "Points off by over 1 px",
                self.of(|score| 100.0 * f64::from(score.bad_one)),
                "%",
            ),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// Their plots, of two scans or more.
    fn plots(&self) -> Markup {
        if self.0.len() < 2 {
            return html! {};
        }
        let scans: Vec<u64> = self.0.iter().map(|(scan, _)| *scan).collect();
        let series = |name: &str, of: fn(&Score) -> f64| Series {
            name: name.to_owned(),
            values: self.of(of),
        };
        let covered = series("coverage", coverage);
        let bad = [
            series("over 0.5 px", |score| 100.0 * f64::from(score.bad_half)),
            series("over 1 px", |score| 100.0 * f64::from(score.bad_one)),
            series("over 2 px", |score| 100.0 * f64::from(score.bad_two)),
        ];
        let median = series("median", |score| f64::from(score.median));
        html! {
            h3 { "Over all scans" }
            div.plots {
                (plot::lines("Coverage", Quantity::of("covered edges", "%"), &scans, &[covered]))
                (plot::lines("Points that are off", Quantity::of("points", "%"), &scans, &bad))
                (plot::lines("Median error", Quantity::of("error", "px"), &scans, &[median]))
            }
        }
    }
}

fn coverage(score: &Score) -> f64 {
    100.0 * f64::from(score.coverage)
}

/// The section, when there is an evaluation: figures of the scans shown, and of all scans over time.
pub(super) fn section(
    recording: &mut Recording,
    shown: &[u64],
    scores: &Scores,
    rivals: &mut Rivals<'_>,
) -> Markup {
    let topic = Topic::of(&recording.metadata().rig, Kind::Evaluation).pop();
    let (true, Some(topic)) = (is_there(recording), topic) else {
        return html! {};
    };
    let mut scans = Vec::new();
    for &scan in shown {
        let tables = match recording.read::<Evaluation>(scan, &topic) {
            Ok(evaluation) => {
                html! { (table_of_scores(recording, &evaluation)) (surest(&evaluation)) }
            }
            Err(error) => missing(error),
        };
        let mismatches = rivals(recording, scan);
        scans.push(html! {
            h3 { (title(recording, scan)) }
            (tables)
            @if let Some(mismatches) = mismatches { (table_of_methods(&mismatches)) }
        });
    }
    html! {
        section #accuracy {
            h2 { "Accuracy" }
            p {
                "Against the truth of the reference view. Coverage: share of its edge pixels (Canny) with known truth that \
                 have a point within one pixel. Bad: share of the points whose disparity is off by more than so many pixels \
                 from every truth within two columns; rows too: and, along level contours, within three rows. Mismatches: \
                 points off by over two pixels from every truth around them, false targets."
            }
            @for scan in &scans { (scan) }
            (scores.plots())
        }
        "\n"
    }
}

/// Whether the recording has such a section.
pub(super) fn is_there(recording: &Recording) -> bool {
    recording.channels().contains_key(Kind::Evaluation.name())
}

/// The figures of the result and of each channel.
fn table_of_scores(recording: &Recording, evaluation: &Owned<Evaluation>) -> Markup {
    let channels = &recording.metadata().rig.channels;
    let columns = [
        ("channel", false),
        ("coverage, %", true),
        ("bad 0.5 px, %", true),
        ("bad 1 px, %", true),
        ("bad 2 px, %", true),
        ("rows too: bad 1 px, %", true),
        ("rows too: bad 2 px, %", true),
        ("median, px", true),
        ("points", true),
        ("mismatches", true),
    ];
    let rows = html! {
        @for score in evaluation.view().scores {
            tr {
                td {
                    @match channels.get(score.channel as usize) {
                        Some(variance) => { "σ² = " (variance) }
                        None => { "all" }
                    }
                }
                @for share in [
                    score.coverage,
                    score.bad_half,
                    score.bad_one,
                    score.bad_two,
                    score.bad_one_rows_too(),
                    score.bad_two_rows_too(),
                ] {
                    td.n { (percent(share)) }
                }
                td.n { (format_args!("{:.3}", score.median)) }
                td.n { (count(score.points.into())) }
                td.n { (count(score.mismatches.into())) }
            }
            "\n"
        }
    };
    table(&columns, &rows)
}

/// What the surest points amount to.
fn surest(evaluation: &Owned<Evaluation>) -> Markup {
    let columns = [
        ("surest points, %", true),
        ("score from", true),
        ("coverage, %", true),
        ("bad 1 px, %", true),
    ];
    let rows = html! {
        @for share in evaluation.view().curve.iter().skip(3).step_by(4) {
            tr {
                td.n { (format_args!("{:.0}", 100.0 * share.share)) }
                td.n { (format_args!("{:.3}", share.score)) }
                td.n { (percent(share.coverage)) }
                td.n { (percent(share.bad_one)) }
            }
            "\n"
        }
    };
    html! { h4 { "The surest points alone" } (table(&columns, &rows)) }
}

/// The thesis's table.
fn table_of_methods(mismatches: &Mismatches) -> Markup {
    let methods = mismatches.methods.iter();
    let methods = methods.map(|method| (method.as_str(), true));
    let columns: Vec<(&str, bool)> = [("channel", false)].into_iter().chain(methods).collect();
    let rows = html! {
        @for (channel, cells) in &mismatches.rows {
            tr {
                td { (channel) }
                @for (wrong, points) in cells {
                    td.n { (count((*wrong).into())) " of " (count((*points).into())) }
                }
            }
            "\n"
        }
    };
    html! {
        h4 { "Mismatches of three methods on the same curves, as the thesis compares them" }
        (table(&columns, &rows))
    }
}
