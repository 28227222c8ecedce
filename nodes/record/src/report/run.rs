//! How the run went: times and counts scan by scan, and the ledger.

use maud::{Markup, html};
use messages::Stage;
use messages::ledger::Account;
use messages::record::Statistics;

use super::page::{Figure, count, counted, missing, table};
use super::plot::{self, Quantity, Series};
use crate::info::some_of;
use crate::{Info, Recording};

/// Over the scans no more points are plotted: a page is no wider, and a long recording need not be read whole.
const MOST_PLOTTED: usize = 400;

/// The scans that are plotted, and of how many each stands for one.
pub(super) fn plotted(recording: &Recording) -> (Vec<u64>, usize) {
    let scans = recording.scans();
    let every = scans.len().div_ceil(MOST_PLOTTED).max(1);
    (scans.step_by(every).collect(), every)
}

/// One of a scan's numbers.
type Of = fn(&Statistics) -> f64;

/// What the scans say of themselves.
pub(super) struct Run {
    scans: Vec<u64>,
    statistics: Vec<Statistics>,
    /// Scans whose statistics cannot be read.
    unreadable: u64,
    /// Of how many scans one is plotted.
    every: usize,
    total: usize,
}

impl Run {
    /// Of the scans that are plotted.
    pub(super) fn read(recording: &mut Recording) -> Self {
        let (scans, every) = plotted(recording);
        let mut run = Self {
            scans: Vec::new(),
            statistics: Vec::new(),
            unreadable: 0,
            every,
            total: recording.scans().len(),
        };
        for scan in scans {
            let read = recording.scan_of(scan, |topic| topic == "statistics");
            let Ok(read) = read else {
                run.unreadable += 1;
                continue;
            };
            if let Some(message) = read.message("statistics") {
                match serde_json::from_slice::<Statistics>(message) {
                    Ok(of_scan) => {
                        run.scans.push(scan);
                        run.statistics.push(of_scan);
                    }
                    Err(_) => run.unreadable += 1,
                }
            }
            recording.reuse(read);
        }
        run
    }

    fn series(&self, name: &str, of: Of) -> Series {
        Series {
            name: name.to_owned(),
            values: self.statistics.iter().map(of).collect(),
        }
    }

    /// What is to be seen at once: medians over the scans.
    pub(super) fn figures(&self) -> Vec<Figure> {
        let numbers: [(&str, Of, &str); 3] = [
            ("Points in space, each scan", |of| of.points as f64, ""),
            ("Pixels with a disparity", |of| of.known * 100.0, "%"),
            ("Computing, each scan", computing, "ms"),
        ];
        let figures = numbers.into_iter().filter_map(|(name, of, unit)| {
            let values = self.series(name, of).values;
            // What was not recorded was not counted.
            let is_known = values.iter().any(|value| *value > 0.0);
            Some(Figure {
                name: name.to_owned(),
                value: plot::median(&values).filter(|_| is_known)?,
                unit: unit.to_owned(),
            })
        });
        figures.collect()
    }

    /// The section about it.
    pub(super) fn section(&self) -> Markup {
        html! {
            section #run {
                h2 { "Run" }
                @if self.unreadable > 0 {
                    (missing(format_args!(
                        "The statistics of {} cannot be read",
                        counted(self.unreadable, "scan", "scans")
                    )))
                }
                @if self.statistics.is_empty() {
                    (missing("The recording holds no statistics, so times and counts are not known"))
                } @else {
                    @if self.every > 1 {
                        p { "Of " (count(self.total as u64)) " scans every " (self.every) "th is plotted." }
                    }
                    h3 { "Times" }
                    div.plots { (self.times()) }
                    h3 { "Counts" }
                    div.plots { (self.counts()) }
                }
            }
            "\n"
        }
    }

    fn times(&self) -> Markup {
        let time = Quantity::of("time", "ms");
        let capture = self.series("capture", |of| of.milliseconds.capture);
        let later = [
            self.series("filter", |of| of.milliseconds.filter),
            self.series("track", |of| of.milliseconds.track),
            self.series("hough", |of| of.milliseconds.hough),
            self.series("match", |of| of.milliseconds.r#match),
        ];
        let later: Vec<Series> = later.into_iter().filter(ran).collect();
        let names: Vec<&str> = later.iter().map(|stage| stage.name.as_str()).collect();
        let all = self.series("computing", computing);
        html! {
            // Rendering takes a hundred times as long as any stage and would flatten them all.
            @if ran(&capture) { (plot::lines("capture", time, &self.scans, &[capture])) }
            @if !later.is_empty() { (plot::lines(&names.join(", "), time, &self.scans, &later)) }
            (plot::lines("all of them together", time, &self.scans, &[all]))
        }
    }

    fn counts(&self) -> Markup {
        let counts: [(&str, Quantity<'_>, Of); 6] = [
            (
                "zero-crossings",
                Quantity::counted("zero-crossings"),
                |of| of.edges as f64,
            ),
            ("curves", Quantity::counted("curves"), |of| of.curves as f64),
            ("matched curves", Quantity::counted("curves"), |of| {
                of.matches as f64
            }),
            ("points in space", Quantity::counted("points"), |of| {
                of.points as f64
            }),
            (
                "pixels of known disparity",
                Quantity::of("pixels", "%"),
                |of| of.known * 100.0,
            ),
            (
                "recorded, before compression",
                Quantity::of("size", "MB"),
                |of| of.bytes as f64 / 1e6,
            ),
        ];
        html! {
            @for (name, up, of) in counts {
                @let counted = self.series(name, of);
                @if ran(&counted) { (plot::lines(name, up, &self.scans, &[counted])) }
            }
        }
    }
}

/// What took no time did not run, and what was not recorded was not counted.
fn ran(series: &Series) -> bool {
    series.values.iter().any(|value| *value > 0.0)
}

/// What the stages after the camera took together, in milliseconds.
fn computing(of: &Statistics) -> f64 {
    let spent = of.milliseconds;
    spent.filter + spent.track + spent.hough + spent.r#match
}

/// The order in which scans pass the nodes; those beside the pipe come last.
pub(super) fn place_in_pipe(node: &str) -> usize {
    let stages = Stage::all();
    let place = stages.iter().position(|stage| stage.name() == node);
    place.unwrap_or(stages.len())
}

/// What every node received, published and dropped.
pub(super) fn ledger(info: &Info) -> Markup {
    let Some(ledger) = &info.ledger else {
        return html! {
            section #ledger {
                h2 { "Ledger" }
                (missing("There is no ledger: the run did not come to its end"))
            }
            "\n"
        };
    };
    let refused: u64 = ledger.refused.values().sum();
    let mut nodes: Vec<_> = ledger.nodes.iter().collect();
    nodes.sort_by_key(|(node, _)| place_in_pipe(node));
    let is_short = |count: Option<u64>| count.is_some_and(|count| count != ledger.admitted);
    let is_fault = |account: &Account| {
        is_short(account.received) || is_short(account.published) || !account.dropped.is_empty()
    };
    let columns = [
        ("topic", false),
        ("received", true),
        ("published", true),
        ("twice", true),
        ("dropped", false),
        ("missing", false),
    ];
    let number = |value: Option<u64>| value.map_or("–".to_owned(), count);
    let row = |topic: &str, account: &Account| {
        let dropped = account.dropped.iter();
        let dropped: Vec<String> = dropped
            .map(|(cause, number)| format!("{}: {cause}", count(*number)))
            .collect();
        html! {
            tr.fault[is_fault(account)] {
                td.mono { (topic) }
                td.n { (number(account.received)) }
                td.n { (number(account.published)) }
                td.n { (count(account.duplicates)) }
                td { @if dropped.is_empty() { "–" } @else { (dropped.join("; ")) } }
                td { @if account.missing.is_empty() { "–" } @else { (some_of(&account.missing)) } }
            }
            "\n"
        }
    };
    html! {
        section #ledger {
            h2 { "Ledger" }
            p {
                (counted(ledger.admitted, "scan", "scans")) " admitted, " (count(ledger.done)) " done, "
                (count(refused)) " dropped at the door"
                @for (cause, number) in &ledger.refused { " (" (count(*number)) ": " (cause) ")" }
                @if info.balanced == Some(true) { ": balanced." } @else { ": not balanced." }
            }
            @for (node, topics) in nodes {
                @let faults = topics.values().filter(|account| is_fault(account)).count() as u64;
                details open[faults > 0] {
                    summary {
                        (node) " "
                        span {
                            (counted(topics.len() as u64, "topic", "topics"))
                            @if faults > 0 { ", " (count(faults)) " not balanced" }
                        }
                    }
                    (table(&columns, &html! { @for (topic, account) in topics { (row(topic, account)) } }))
                }
            }
        }
        "\n"
    }
}
