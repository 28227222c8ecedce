//! The thesis's table: what each method shows of the true contours, an object and a channel a line.

use std::fmt::Write as _;

use evaluate::{Compared, Contours, Tracked, Truths};
use matching::Method;
use messages::{Contour, ContourKind};
use serde::Serialize;

use super::{Report, text};
use crate::offline::{Matched, Tabulated};

/// What curves and matches show of a scene's true contours.
#[derive(Debug, Serialize)]
pub(super) struct ContoursReport {
    /// As each channel can show them.
    #[serde(skip)]
    contours: Vec<Contours>,
    /// A channel each, coarse to fine.
    curves: Vec<CurvesReport>,
    /// A method each, in the order of the report's, and of each a channel each.
    methods: Vec<Vec<MatchesReport>>,
}

/// The curves of a channel.
#[derive(Debug, Serialize)]
struct CurvesReport {
    sigma_squared: f32,
    /// Pixels of true contours that count.
    contours_px: f32,
    /// Pixels of others that have contrast: too short, or beside a stronger one.
    left_out_px: f32,
    /// Share of those that count which lies on curves.
    on_curves: f32,
    silhouettes: Kind,
    creases: Kind,
    marks: Kind,
    shadows: Kind,
    curves: u32,
    /// Curves whose contour all views see.
    curves_seen: u32,
}

/// The true contours of a kind.
#[derive(Debug, Serialize)]
struct Kind {
    contours_px: f32,
    /// Share of them that lies on curves; nothing where there are none.
    on_curves: Option<f32>,
}

/// The matches of a channel.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct MatchesReport {
    /// Curves that were matched.
    curves: u32,
    /// Those of them whose contour all views see.
    curves_seen: u32,
    /// Those that are off by over two pixels as a whole.
    curves_over_2: u32,
    points: u32,
    /// Points off by over two pixels.
    points_over_2: u32,
    /// Points that are on no shadow's border, and those of them off by over one pixel.
    firm_points: u32,
    firm_points_over_1: u32,
    /// Pixels of the true contours that count which have a point that is right within two pixels.
    covered_px: f32,
}

impl From<Compared> for MatchesReport {
    fn from(compared: Compared) -> Self {
        Self {
            curves: compared.curves,
            curves_seen: compared.seen,
            curves_over_2: compared.wrong,
            points: compared.points,
            points_over_2: compared.over_two,
            firm_points: compared.firm,
            firm_points_over_1: compared.firm_over_one,
            covered_px: compared.covered,
        }
    }
}

impl CurvesReport {
    fn new(sigma_squared: f32, tracked: Tracked) -> Self {
        let kind = |kind: ContourKind| {
            let [contours_px, on] = tracked.kinds[kind as usize];
            Kind {
                contours_px,
                on_curves: (contours_px > 0.0).then_some(on / contours_px),
            }
        };
        Self {
            sigma_squared,
            contours_px: tracked.contours,
            left_out_px: tracked.left_out,
            on_curves: share(tracked.on_curves, tracked.contours),
            silhouettes: kind(ContourKind::Silhouette),
            creases: kind(ContourKind::Crease),
            marks: kind(ContourKind::Mark),
            shadows: kind(ContourKind::Shadow),
            curves: tracked.curves,
            curves_seen: tracked.seen,
        }
    }
}

impl ContoursReport {
    /// What the curves of a scan's view show.
    pub(super) fn new(
        settings: &evaluate::Settings,
        of_view: &[Contour],
        scan: &Tabulated,
        view: usize,
    ) -> Self {
        let size = (scan.views(), scan.size);
        let contours: Vec<Contours> = (scan.channels.iter())
            .map(|&variance| Contours::new(settings, of_view, size, variance))
            .collect();
        let tracked = contours.iter().zip(&scan.channels).enumerate();
        let tracked = tracked.map(|(channel, (contours, &variance))| {
            CurvesReport::new(variance, contours.tracked(scan.curves(view, channel)))
        });
        Self {
            curves: tracked.collect(),
            methods: Vec::new(),
            contours,
        }
    }

    /// Adds what a method matched in it.
    pub(super) fn compare(
        &mut self,
        matched: &Matched,
        scan: &Tabulated,
        view: usize,
        truth: &[f32],
    ) {
        let truths = Truths {
            disparity: truth,
            size: scan.size,
        };
        let compared = self.contours.iter().enumerate().map(|(channel, contours)| {
            let (curves, matches) = (scan.curves(view, channel), matched.matches(channel));
            MatchesReport::from(contours.compared(curves, matches, &truths, view))
        });
        let compared = compared.collect();
        self.methods.push(compared);
    }
}

fn share(part: f32, whole: f32) -> f32 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

/// A share in per cent, or a dash.
fn percent(share: Option<f32>) -> String {
    share.map_or("-".to_owned(), |share| format!("{:.1}", 100.0 * share))
}

fn share_of(part: u32, whole: u32) -> Option<f32> {
    (whole > 0).then(|| part as f32 / whole as f32)
}

/// Both tables, when a scene knows its true contours.
pub(super) fn text(report: &Report, text: &mut String) {
    let scenes = report.scenes.iter();
    let known: Vec<(&str, &ContoursReport)> = scenes
        .filter_map(|scene| Some((&*scene.name, scene.contours.as_ref()?)))
        .collect();
    if known.is_empty() {
        return;
    }
    let width = text::width(report);
    tracked(&known, width, text);
    matched(&known, &report.methods, width, text);
}

fn tracked(known: &[(&str, &ContoursReport)], width: usize, text: &mut String) {
    let mut put = |line: std::fmt::Arguments<'_>| {
        text.write_fmt(line).unwrap_or_default();
        text.push('\n');
    };
    put(format_args!(
        "\ntrue contours of 32 px and more: what share of them lies on tracked curves, in %; left out is what is shorter or beside a stronger one"
    ));
    put(format_args!(
        "{:<width$} {:>4} {:>11} {:>8} {:>6} {:>11} {:>7} {:>6} {:>7} | {:>6} {:>11}",
        "scene",
        "σ²",
        "contours px",
        "left out",
        "all",
        "silhouettes",
        "creases",
        "marks",
        "shadows",
        "curves",
        "seen by all"
    ));
    for (name, report) in known {
        for curves in &report.curves {
            let kinds = [
                &curves.silhouettes,
                &curves.creases,
                &curves.marks,
                &curves.shadows,
            ];
            let [silhouettes, creases, marks, shadows] = kinds.map(|kind| percent(kind.on_curves));
            put(format_args!(
                "{name:<width$} {:>4} {:>11.0} {:>8.0} {:>6} {silhouettes:>11} {creases:>7} {marks:>6} {shadows:>7} | {:>6} {:>11}",
                curves.sigma_squared,
                curves.contours_px,
                curves.left_out_px,
                percent(Some(curves.on_curves)),
                curves.curves,
                curves.curves_seen,
            ));
        }
    }
}

fn matched(known: &[(&str, &ContoursReport)], methods: &[Method], width: usize, text: &mut String) {
    let mut put = |line: std::fmt::Arguments<'_>| {
        text.write_fmt(line).unwrap_or_default();
        text.push('\n');
    };
    put(format_args!(
        "\nthe thesis's table: curves matched of those whose contour all views see, and points, against the true contours"
    ));
    put(format_args!(
        "{:<width$} {:>4} {:<10} {:>14} {:>6} {:>7} {:>7} | {:>7} {:>7} {:>7} {:>8} | {:>8}",
        "scene",
        "σ²",
        "method",
        "matched",
        "%",
        "curves",
        "> 2 px",
        "points",
        "> 2 px",
        "%",
        "> 1 px %",
        "covers %"
    ));
    let mut sums = vec![(0u32, 0.0f32, MatchesReport::default()); methods.len()];
    let mut line = |name: &str, channel: &str, method: Method, of: (u32, f32, MatchesReport)| {
        let (seen, contours_px, report) = of;
        // Points by themselves are no curves.
        let is_curves = method != Method::Point;
        let or_dash = |text: String| if is_curves { text } else { "-".to_owned() };
        put(format_args!(
            "{name:<width$} {channel:>4} {:<10} {:>14} {:>6} {:>7} {:>7} | {:>7} {:>7} {:>7} {:>8} | {:>8}",
            text::name(method),
            or_dash(format!("{} of {seen}", report.curves_seen)),
            or_dash(percent(share_of(report.curves_seen, seen))),
            or_dash(report.curves.to_string()),
            or_dash(report.curves_over_2.to_string()),
            report.points,
            report.points_over_2,
            percent(share_of(report.points_over_2, report.points)),
            percent(share_of(report.firm_points_over_1, report.firm_points)),
            percent(Some(share(report.covered_px, contours_px))),
        ));
    };
    for (name, report) in known {
        for (channel, curves) in report.curves.iter().enumerate() {
            for (at, &method) in methods.iter().enumerate() {
                let own = report.methods[at][channel];
                let of = (curves.curves_seen, curves.contours_px, own);
                line(name, &curves.sigma_squared.to_string(), method, of);
                let (seen, contours_px, sum) = &mut sums[at];
                *seen += of.0;
                *contours_px += of.1;
                sum.add(&own);
            }
        }
    }
    for (&method, sum) in methods.iter().zip(sums) {
        line("all", "all", method, sum);
    }
}

impl MatchesReport {
    fn add(&mut self, other: &Self) {
        self.curves += other.curves;
        self.curves_seen += other.curves_seen;
        self.curves_over_2 += other.curves_over_2;
        self.points += other.points;
        self.points_over_2 += other.points_over_2;
        self.firm_points += other.firm_points;
        self.firm_points_over_1 += other.firm_points_over_1;
        self.covered_px += other.covered_px;
    }
}
