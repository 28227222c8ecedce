//! The evaluation as tables.

use std::fmt::Write as _;

use matching::Method;

use super::{Figures, Gain, Report, SceneReport};

/// What a method is called.
pub(super) fn name(method: Method) -> &'static str {
    match method {
        Method::ThreeView => "three-view",
        Method::TwoView => "two-view",
        Method::Point => "point",
    }
}

/// Names are as long as the longest.
pub(super) fn width(report: &Report) -> usize {
    let names = report.scenes.iter().map(|scene| scene.name.chars().count());
    names.max().unwrap_or(0).max("scene".len())
}

pub(super) fn of(report: &Report) -> String {
    let mut text = String::new();
    for (at, method) in report.methods.iter().enumerate() {
        figures(report, at, *method, &mut text);
    }
    gains(report, &mut text);
    if report.methods.len() > 1 {
        mismatches(report, &mut text);
    }
    super::contours::text(report, &mut text);
    for skipped in &report.skipped {
        writeln!(text, "skipped: {}: {}", skipped.name, skipped.why).unwrap_or_default();
    }
    text
}

fn figures(report: &Report, at: usize, method: Method, text: &mut String) {
    let width = width(report);
    let title = name(method);
    writeln!(text, "{title}").unwrap_or_default();
    writeln!(
        text,
        "{:<width$} {:>8} {:>9} {:>7} {:>7} {:>9} {:>8} {:>10} | {:>7} {:>7}",
        "scene",
        "coverage",
        "bad-0.5 %",
        "bad-1 %",
        "bad-2 %",
        "median px",
        "points",
        "mismatches",
        "bad-1 %",
        "bad-2 %"
    )
    .unwrap_or_default();
    let mut line = |name: &str, [coverage, median]: [f64; 2], bad: [f64; 5], counts: [u64; 2]| {
        let [half, one, two, fair_one, fair_two] = bad.map(|share| 100.0 * share);
        let [points, mismatches] = counts;
        writeln!(
            text,
            "{name:<width$} {coverage:>8.3} {half:>9.2} {one:>7.2} {two:>7.2} {median:>9.3} {points:>8} {mismatches:>10} | {fair_one:>7.2} {fair_two:>7.2}"
        )
        .unwrap_or_default();
    };
    for scene in &report.scenes {
        let Figures {
            coverage,
            bad_0_5,
            bad_1,
            bad_2,
            bad_1_rows_too,
            bad_2_rows_too,
            median,
            points,
            mismatches,
        } = scene.methods[at].result;
        let bad = [bad_0_5, bad_1, bad_2, bad_1_rows_too, bad_2_rows_too];
        line(
            &scene.name,
            [coverage, median].map(f64::from),
            bad.map(f64::from),
            [points, mismatches].map(u64::from),
        );
    }
    let mean = &report.mean[at];
    if report.scenes.len() > 1 {
        line(
            "mean",
            [mean.coverage, mean.median],
            [
                mean.bad_0_5,
                mean.bad_1,
                mean.bad_2,
                mean.bad_1_rows_too,
                mean.bad_2_rows_too,
            ],
            [mean.points, mean.mismatches].map(|sum| sum / report.scenes.len() as u64),
        );
    }
    writeln!(
        text,
        "left of the bar a truth counts within two columns (score.py's rule), right of it also within three rows along level contours"
    )
    .unwrap_or_default();
    writeln!(
        text,
        "\nthe surest points, mean: share kept, coverage, bad-1 %"
    )
    .unwrap_or_default();
    for step in mean.curve.iter().skip(1).step_by(2) {
        let (share, bad) = (100.0 * step.share, 100.0 * step.bad_1);
        writeln!(text, "{share:>5.0} % {:>8.3} {bad:>7.2}", step.coverage).unwrap_or_default();
    }
    writeln!(text).unwrap_or_default();
}

/// What more than three views are worth: errors beside those of a triple at the same coverage.
fn gains(report: &Report, text: &mut String) {
    /// A figure of both, its title and decimal places.
    type Column = (fn(&Figures) -> f64, &'static str, usize);
    const COLUMNS: [Column; 3] = [
        (|f| f.median.into(), "median px", 4),
        (|f| 100.0 * f64::from(f.bad_0_5), "bad-0.5 %", 2),
        (|f| 100.0 * f64::from(f.bad_1), "bad-1 %", 2),
    ];
    let with_gain = |scene: &SceneReport| Some((scene.name.clone(), scene.view, scene.gain?));
    let gains: Vec<_> = report.scenes.iter().filter_map(with_gain).collect();
    if gains.is_empty() {
        return;
    }
    let width = width(report);
    let lead = |name: &str, [views, reference, coverage]: [&str; 3]| {
        format!("{name:<width$} {views:>5} {reference:>9} {coverage:>8}")
    };
    let head = lead("scene", ["views", "reference", "coverage"]);
    let titles = COLUMNS
        .map(|(_, title, _)| format!(" | {title:^23}"))
        .concat();
    let pair = format!(" | {:>8} {:>7} {:>6}", "triple", "all", "ratio").repeat(COLUMNS.len());
    writeln!(
        text,
        "all views beside the triple around the reference view, at the same coverage\n{:indent$}{titles}\n{head}{pair}",
        "",
        indent = head.len()
    )
    .unwrap_or_default();
    let mut line = |lead: String, pairs: [[f64; 2]; COLUMNS.len()]| {
        text.push_str(&lead);
        for ([triple, all], (_, _, places)) in pairs.into_iter().zip(COLUMNS) {
            let ratio = match triple > 0.0 {
                true => format!("{:.2}", all / triple),
                false => "-".to_owned(),
            };
            write!(text, " | {triple:>8.places$} {all:>7.places$} {ratio:>6}").unwrap_or_default();
        }
        text.push('\n');
    };
    let both = |gain: &Gain| COLUMNS.map(|(of, ..)| [of(&gain.triple), of(&gain.all)]);
    for (name, view, gain) in &gains {
        let [views, view] = [gain.views, *view].map(|number| number.to_string());
        let coverage = format!("{:.3}", gain.coverage);
        line(lead(name, [&views, &view, &coverage]), both(gain));
    }
    if gains.len() > 1 {
        let mean = |of: &dyn Fn(&Gain) -> f64| {
            gains.iter().map(|(_, _, gain)| of(gain)).sum::<f64>() / gains.len() as f64
        };
        let coverage = format!("{:.3}", mean(&|gain| gain.coverage.into()));
        let means = COLUMNS.map(|(of, ..)| [mean(&|g| of(&g.triple)), mean(&|g| of(&g.all))]);
        line(lead("mean", ["", "", &coverage]), means);
    }
    text.push('\n');
}

/// Mismatches of all methods side by side: of rendered scenes in every channel, of others in the result.
fn mismatches(report: &Report, text: &mut String) {
    let width = width(report);
    let methods = || report.methods.iter().map(|method| name(*method));
    writeln!(text, "mismatches, of points whose truth is known").unwrap_or_default();
    write!(text, "{:<width$} {:>7}", "scene", "channel").unwrap_or_default();
    for method in methods() {
        write!(text, " {method:>16}").unwrap_or_default();
    }
    writeln!(text).unwrap_or_default();
    let mut line = |name: &str, channel: &str, figures: &[Figures]| {
        write!(text, "{name:<width$} {channel:>7}").unwrap_or_default();
        for Figures {
            mismatches, points, ..
        } in figures
        {
            let cell = format!("{mismatches} of {points}");
            write!(text, " {cell:>16}").unwrap_or_default();
        }
        writeln!(text).unwrap_or_default();
    };
    for scene in &report.scenes {
        if scene.is_rendered {
            for (channel, variance) in report.channels.iter().enumerate() {
                let figures = scene.methods.iter().filter_map(|m| m.channels.get(channel));
                let figures: Vec<Figures> = figures.copied().collect();
                line(&scene.name, &variance.to_string(), &figures);
            }
        }
        let results: Vec<Figures> = scene.methods.iter().map(|m| m.result).collect();
        line(&scene.name, "all", &results);
    }
    let total = |at: usize| report.mean[at].mismatches;
    write!(text, "{:<width$} {:>7}", "sum", "all").unwrap_or_default();
    for at in 0..report.methods.len() {
        write!(text, " {:>16}", total(at)).unwrap_or_default();
    }
    writeln!(text).unwrap_or_default();
}
