//! The evaluation as tables.

use std::fmt::Write as _;

use matching::Method;

use super::{Figures, Report};

/// What a method is called.
fn name(method: Method) -> &'static str {
    match method {
        Method::ThreeView => "three-view",
        Method::TwoView => "two-view",
        Method::Point => "point",
    }
}

/// Names are as long as the longest.
fn width(report: &Report) -> usize {
    let names = report.scenes.iter().map(|scene| scene.name.chars().count());
    names.max().unwrap_or(0).max("scene".len())
}

pub(super) fn of(report: &Report) -> String {
    let mut text = String::new();
    for (at, method) in report.methods.iter().enumerate() {
        figures(report, at, *method, &mut text);
    }
    if report.methods.len() > 1 {
        mismatches(report, &mut text);
    }
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
        "{:<width$} {:>8} {:>9} {:>7} {:>7} {:>9} {:>8} {:>10}",
        "scene", "coverage", "bad-0.5 %", "bad-1 %", "bad-2 %", "median px", "points", "mismatches"
    )
    .unwrap_or_default();
    let mut line = |name: &str, [coverage, half, one, two, median]: [f64; 5], counts: [u64; 2]| {
        let [half, one, two] = [half, one, two].map(|share| 100.0 * share);
        let [points, mismatches] = counts;
        writeln!(
            text,
            "{name:<width$} {coverage:>8.3} {half:>9.2} {one:>7.2} {two:>7.2} {median:>9.3} {points:>8} {mismatches:>10}"
        )
        .unwrap_or_default();
    };
    for scene in &report.scenes {
        let Figures {
            coverage,
            bad_0_5,
            bad_1,
            bad_2,
            median,
            points,
            mismatches,
        } = scene.methods[at].result;
        let values = [coverage, bad_0_5, bad_1, bad_2, median].map(f64::from);
        line(&scene.name, values, [points, mismatches].map(u64::from));
    }
    let mean = &report.mean[at];
    if report.scenes.len() > 1 {
        line(
            "mean",
            [
                mean.coverage,
                mean.bad_0_5,
                mean.bad_1,
                mean.bad_2,
                mean.median,
            ],
            [mean.points, mean.mismatches].map(|sum| sum / report.scenes.len() as u64),
        );
    }
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
