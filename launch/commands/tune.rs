//! `tricurve tune`: sweeps settings over scenes, and prints which of them cover most at which error.
//!
//! The error is that against the truth, or, where none is known, how often the results in two reference views of the same
//! triple contradict each other.

mod agreement;
mod picture;
mod sweep;

use std::fmt::Write as _;

use evaluate::Evaluator;
use serde::Serialize;
use serde_json::{Value, json};

use super::calibrate::write;
use super::evaluate::{Scene, Skipped, each, good, progress, with_images, with_truth};
use crate::cli::Tune as Args;
use crate::graph::{Graph, Overrides};
use crate::offline::{Tabulated, settings};
use crate::{Failure, Outcome};

use agreement::disagreement;
use picture::Marks;
use sweep::{Axis, combinations};

/// What is swept when nothing is said: what moves most along the front of the default settings.
const AXES: [&str; 2] = [
    "match.score_least=0,0.97,0.99,0.995",
    "match.gray_cost=0.06,0.08,0.12",
];

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let axes = match args.sweep.is_empty() {
        true => AXES.map(Axis::parse).into_iter().collect(),
        false => args.sweep.iter().map(|text| Axis::parse(text)).collect(),
    };
    let axes: Vec<Axis> = axes_of(axes)?;
    let combinations = combinations(&axes)?;
    let base = overrides(args)?;
    // Every combination is checked before the first is tried.
    let graphs = combinations
        .iter()
        .map(|values| graph(args, &base, &axes, values))
        .collect::<Result<Vec<Graph>, Failure>>()?;
    let view = |scene: &Scene| graphs[0].reference(scene.views);
    let (scenes, mut skipped) = match args.truth {
        true => with_truth(&graphs[0], &args.sources, view)?,
        false => with_images(&graphs[0], &args.sources)?,
    };
    let bar = progress(scenes.len(), args.json);
    let results = each(&scenes, |scene| {
        let measured = measure(&graphs, scene, args.truth);
        if let Some(bar) = &bar {
            bar.inc(1);
        }
        measured
    });
    if let Some(bar) = &bar {
        bar.finish_and_clear();
    }
    let by_scene = good(&scenes, results, &mut skipped)?;
    let report = Report::new(&axes, combinations, &by_scene, skipped);
    if let Some(path) = &args.picture {
        let first = by_scene.iter().filter_map(|scene| scene.first());
        let automatic: Vec<[f64; 2]> = first.map(|measured| measured.automatic).collect();
        let marks = marks(args, &base, &axes, &automatic)?;
        write(path, &picture::svg(&axes, &report.combinations, &marks))?;
    }
    match args.json {
        true => super::print_json(&report)?,
        false => super::print(&report.text())?,
    }
    Ok(Outcome::Done)
}

/// What a picture of the sweep marks: the settings without it, and where the automatic thresholds lie, if those are swept.
fn marks(
    args: &Args,
    base: &Overrides,
    axes: &[Axis],
    automatic: &[[f64; 2]],
) -> Result<Marks, Failure> {
    let graph = Graph::load(None, args.profile, base)?;
    let set = |axis: &Axis| graph.settings_of(&axis.node)[&axis.key].clone();
    let swept: Vec<String> = axes.iter().take(2).map(Axis::name).collect();
    let mean = |which: usize| {
        let sum: f64 = automatic.iter().map(|thresholds| thresholds[which]).sum();
        sum / automatic.len().max(1) as f64
    };
    Ok(Marks {
        set: axes.iter().map(set).collect(),
        automatic: (swept == ["track.high", "track.low"]).then(|| [mean(0), mean(1)]),
    })
}

fn axes_of(axes: Vec<Result<Axis, String>>) -> Result<Vec<Axis>, Failure> {
    axes.into_iter()
        .collect::<Result<_, _>>()
        .map_err(Failure::usage)
}

fn overrides(args: &Args) -> Result<Overrides, Failure> {
    let mut overrides = Overrides::parse(&args.set)?;
    if let Some(views) = &args.views {
        overrides.set("capture", "views", json!(views));
    }
    overrides.lay(args.layout);
    if let Some(reference) = &args.reference {
        overrides.set("match", "reference", json!(reference));
    }
    Ok(overrides)
}

/// The graph with these values on the axes, every setting checked.
fn graph(args: &Args, base: &Overrides, axes: &[Axis], values: &[Value]) -> Result<Graph, Failure> {
    let mut overrides = base.clone();
    for (axis, value) in axes.iter().zip(values) {
        overrides.set(&axis.node, &axis.key, value.clone());
    }
    Graph::load(None, args.profile, &overrides)
}

/// What was measured of one scene with one combination.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    /// Share of the edge pixels that are covered: of all, or of those whose truth is known.
    coverage: f64,
    /// Share of the points that are off by over a pixel, where the truth is known.
    bad_1: Option<f64>,
    /// Points off by over two pixels, where the truth is known.
    mismatches: Option<u32>,
    /// Share of the points that the other reference view contradicts.
    contradicted: f64,
    /// The automatic HIGH and LOW of the finest channel, in the units of its magnitudes.
    automatic: [f64; 2],
}

/// Measures a scene with every combination. What comes before matching is done once where it is the same.
fn measure(graphs: &[Graph], scene: &Scene, has_truth: bool) -> Result<Vec<Measured>, Failure> {
    let mut before: Option<(Vec<Value>, Tabulated)> = None;
    let mut automatic = [0.0; 2];
    // Opened once: what is swept comes after it.
    let mut source = scene.source(&graphs[0])?;
    scene.say_look(&graphs[0], &mut source);
    let view = graphs[0].reference(scene.views)?;
    let truth = match has_truth {
        true => Some(scene.open(&graphs[0], view)?.1),
        false => None,
    };
    let mut measured = Vec::with_capacity(graphs.len());
    for graph in graphs {
        let stages = ["filter", "track", "hough"].map(|node| graph.settings_of(node).clone());
        if !before.as_ref().is_some_and(|(known, _)| *known == stages) {
            let scan = Tabulated::of(graph, &mut source, scene.scan)?;
            if before.is_none() {
                automatic = scan.automatic_thresholds(graph, view)?;
            }
            before = Some((stages.to_vec(), scan));
        }
        let Some((_, scan)) = &before else {
            continue;
        };
        let own: matching::Settings = settings(graph, "match")?;
        let matched = scan.matched(&own);
        let other = scan.matched(&agreement::elsewhere(&own, scene.views));
        // Where the truth is not known, all edges are to be covered.
        let everywhere = || vec![1.0; scan.size.pixels()];
        let known = truth.clone().unwrap_or_else(everywhere);
        let mut evaluator = Evaluator::new(&settings(graph, "evaluate")?);
        let evaluated = matched.evaluated(scan, &mut evaluator, view, &known);
        let score = evaluated.scores.first().copied().unwrap_or_default();
        measured.push(Measured {
            coverage: score.coverage.into(),
            bad_1: has_truth.then_some(score.bad_one.into()),
            mismatches: has_truth.then_some(score.mismatches),
            automatic,
            contradicted: disagreement(
                matched.points(),
                other.points(),
                agreement::steps(&own, scene.views),
                scan.size,
            ),
        });
    }
    Ok(measured)
}

/// What came of a sweep.
#[derive(Debug, Serialize)]
struct Report {
    /// `node.key` of what was swept.
    axes: Vec<String>,
    /// From the least coverage to the greatest.
    combinations: Vec<Line>,
    /// How well contradictions rank the combinations as the truth does: Spearman's coefficient, 1 for the same order.
    #[serde(skip_serializing_if = "Option::is_none")]
    rank_correlation: Option<f64>,
    scenes: usize,
    skipped: Vec<Skipped>,
}

/// A combination, means over the scenes.
#[derive(Clone, Debug, Serialize)]
struct Line {
    values: Vec<Value>,
    coverage: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    bad_1: Option<f64>,
    /// Of all scenes.
    #[serde(skip_serializing_if = "Option::is_none")]
    mismatches: Option<u32>,
    contradicted: f64,
    /// Whether no other combination covers as much with fewer errors.
    on_front: bool,
}

impl Line {
    fn error(&self) -> f64 {
        self.bad_1.unwrap_or(self.contradicted)
    }
}

impl Report {
    fn new(
        axes: &[Axis],
        combinations: Vec<Vec<Value>>,
        by_scene: &[Vec<Measured>],
        skipped: Vec<Skipped>,
    ) -> Self {
        let count = by_scene.len().max(1) as f64;
        let mean = |at: usize, value: fn(&Measured) -> f64| {
            by_scene.iter().map(|scene| value(&scene[at])).sum::<f64>() / count
        };
        let has_truth = by_scene.iter().flatten().all(|m| m.bad_1.is_some());
        let line = |(at, values): (usize, Vec<Value>)| Line {
            values,
            coverage: mean(at, |m| m.coverage),
            bad_1: has_truth.then(|| mean(at, |m| m.bad_1.unwrap_or_default())),
            mismatches: by_scene.iter().map(|scene| scene[at].mismatches).sum(),
            contradicted: mean(at, |m| m.contradicted),
            on_front: false,
        };
        let mut lines: Vec<Line> = combinations.into_iter().enumerate().map(line).collect();
        for at in 0..lines.len() {
            let is_better = |other: &Line| {
                let here = &lines[at];
                let (covers, errs) = (other.coverage - here.coverage, other.error() - here.error());
                covers >= 0.0 && errs <= 0.0 && (covers > 0.0 || errs < 0.0)
            };
            lines[at].on_front = !lines.iter().any(is_better);
        }
        lines.sort_by(|a, b| a.coverage.total_cmp(&b.coverage));
        let truth: Vec<f64> = lines.iter().filter_map(|line| line.bad_1).collect();
        let stand_in: Vec<f64> = lines.iter().map(|line| line.contradicted).collect();
        Self {
            axes: axes.iter().map(Axis::name).collect(),
            rank_correlation: (has_truth && lines.len() > 2).then(|| spearman(&truth, &stand_in)),
            combinations: lines,
            scenes: by_scene.len(),
            skipped,
        }
    }

    fn text(&self) -> String {
        let mut text = String::new();
        let widths: Vec<usize> = self.axes.iter().map(|axis| axis.len().max(8)).collect();
        for (axis, width) in self.axes.iter().zip(&widths) {
            write!(text, "{axis:>width$} ").unwrap_or_default();
        }
        let has_truth = self.combinations.iter().any(|line| line.bad_1.is_some());
        let bad = if has_truth { " bad-1 %" } else { "" };
        writeln!(text, "coverage{bad} contradicted %").unwrap_or_default();
        for line in &self.combinations {
            for (value, width) in line.values.iter().zip(&widths) {
                write!(text, "{:>width$} ", value.to_string()).unwrap_or_default();
            }
            write!(text, "{:>8.3}", line.coverage).unwrap_or_default();
            if let Some(bad) = line.bad_1 {
                write!(text, " {:>7.2}", 100.0 * bad).unwrap_or_default();
            }
            let front = if line.on_front { "  on the front" } else { "" };
            writeln!(text, " {:>14.3}{front}", 100.0 * line.contradicted).unwrap_or_default();
        }
        writeln!(text, "\nmeans of {} scenes", self.scenes).unwrap_or_default();
        if let Some(rank) = self.rank_correlation {
            writeln!(
                text,
                "contradictions rank the settings as the truth does with a correlation of {rank:.2} (Spearman)"
            )
            .unwrap_or_default();
        }
        for skipped in &self.skipped {
            writeln!(text, "skipped: {}: {}", skipped.name, skipped.why).unwrap_or_default();
        }
        text
    }
}

/// Spearman's rank correlation; equal values share their mean rank.
fn spearman(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (ranks(a), ranks(b));
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let product = |x: &[f64], y: &[f64]| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - mean) * (y - mean)).sum()
    };
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    match scale > 0.0 {
        true => product(&a, &b) / scale,
        false => 0.0,
    }
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let rank = |value: &f64| {
        let below = values.iter().filter(|other| *other < value).count();
        let equal = values.iter().filter(|other| *other == value).count();
        below as f64 + (equal as f64 - 1.0) / 2.0
    };
    values.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_correlate_whatever_the_scale_and_equal_values_share_theirs() {
        assert!((spearman(&[1.0, 2.0, 30.0], &[0.1, 0.5, 0.6]) - 1.0).abs() < 1e-12);
        assert!((spearman(&[1.0, 2.0, 30.0], &[3.0, 2.0, 1.0]) + 1.0).abs() < 1e-12);
        assert_eq!(ranks(&[5.0, 1.0, 5.0]), [1.5, 0.0, 1.5]);
        assert_eq!(spearman(&[1.0, 1.0], &[1.0, 2.0]), 0.0);
    }

    #[test]
    fn the_front_is_what_nothing_beats_in_both() {
        let of = |coverage: f64, bad: f64| Measured {
            coverage,
            bad_1: Some(bad),
            mismatches: Some(0),
            contradicted: bad,
            automatic: [1.0, 0.5],
        };
        let scene = vec![of(0.5, 0.01), of(0.6, 0.02), of(0.55, 0.03), of(0.6, 0.02)];
        let values = vec![vec![]; 4];
        let report = Report::new(&[], values, &[scene], Vec::new());
        let front: Vec<(f64, bool)> = report
            .combinations
            .iter()
            .map(|line| (line.coverage, line.on_front))
            .collect();
        assert_eq!(
            front,
            [(0.5, true), (0.55, false), (0.6, true), (0.6, true)]
        );
        assert_eq!(report.rank_correlation, Some(1.0));
    }
}
