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
    gains(report, &mut text);
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

/// What more than three views are worth: errors beside those of a triple at the same coverage.
fn gains(report: &Report, text: &mut String) {
    let gains = || {
        report
            .scenes
            .iter()
            .filter_map(|scene| Some((&scene.name, scene.gain?)))
    };
    if gains().next().is_none() {
        return;
    }
    let width = width(report);
    writeln!(
        text,
        "all views beside the triple around the reference view, at the same coverage\n\
         {:<width$} {:>5} {:>8} | {:^23} | {:^23} | {:^23}\n\
         {:<width$} {:>5} {:>8} | {:>8} {:>7} {:>6} | {:>8} {:>7} {:>6} | {:>8} {:>7} {:>6}",
        "",
        "",
        "",
        "median px",
        "bad-0.5 %",
        "bad-1 %",
        "scene",
        "views",
        "coverage",
        "triple",
        "all",
        "ratio",
        "triple",
        "all",
        "ratio",
        "triple",
        "all",
        "ratio",
    )
    .unwrap_or_default();
    let mut line = |name: &str, views: &str, coverage: f64, pairs: [[f64; 2]; 3]| {
        write!(text, "{name:<width$} {views:>5} {coverage:>8.3}").unwrap_or_default();
        for ([triple, all], places) in pairs.into_iter().zip([4, 2, 2]) {
            let ratio = match triple > 0.0 {
                true => format!("{:.2}", all / triple),
                false => "-".to_owned(),
            };
            write!(text, " | {triple:>8.places$} {all:>7.places$} {ratio:>6}").unwrap_or_default();
        }
        writeln!(text).unwrap_or_default();
    };
    let mut sums = ([[0.0; 2]; 3], 0.0, 0.0);
    for (name, gain) in gains() {
        let both = |of: fn(&Figures) -> f32| [&gain.triple, &gain.all].map(|f| f64::from(of(f)));
        let pairs = [
            both(|f| f.median),
            both(|f| 100.0 * f.bad_0_5),
            both(|f| 100.0 * f.bad_1),
        ];
        for (sum, pair) in sums.0.iter_mut().flatten().zip(pairs.iter().flatten()) {
            *sum += pair;
        }
        sums.1 += f64::from(gain.coverage);
        sums.2 += 1.0;
        line(name, &gain.views.to_string(), gain.coverage.into(), pairs);
    }
    if sums.2 > 1.0 {
        let means = sums.0.map(|pair| pair.map(|sum| sum / sums.2));
        line("mean", "", sums.1 / sums.2, means);
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
