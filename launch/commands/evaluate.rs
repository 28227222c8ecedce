//! `tricurve evaluate`: scenes with ground truth, a line each: coverage, errors, mismatches.

mod contours;
mod scenes;
mod text;

use std::collections::BTreeMap;
use std::io::IsTerminal as _;
use std::sync::Mutex;

use evaluate::Evaluator;
use indicatif::{ProgressBar, ProgressStyle};
use matching::Method;
use messages::{Reference, Score};
use serde::Serialize;
use serde_json::json;

use crate::cli::Evaluate as Args;
use crate::graph::{Graph, Overrides};
use crate::offline::{Evaluated, Matched, Tabulated, settings};
use crate::{Failure, Outcome};

use contours::ContoursReport;
pub(crate) use scenes::{Scene, Skipped, with_images, with_truth};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let mut overrides = Overrides::parse(&args.set)?;
    if let Some(views) = &args.views {
        overrides.set("capture", "views", json!(views));
    }
    overrides.lay(args.layout);
    if let Some(reference) = &args.reference {
        overrides.set("match", "reference", json!(reference));
    }
    let graph = Graph::load(None, args.profile, &overrides)?;
    // Of more views than three the reference may be any: without being asked, one whose truth is known.
    let said = graph.settings_of("match").get("reference");
    let is_asked = args.reference.is_some() || said.is_some_and(|said| said != "left");
    let view = |scene: &Scene| match scene.first_known() {
        Some(known) if scene.views > 3 && !is_asked => Ok(known),
        _ => graph.reference(scene.views),
    };
    let (scenes, mut skipped) = with_truth(&graph, &args.sources, view)?;
    let own: matching::Settings = settings(&graph, "match")?;
    let methods: Vec<Method> = std::iter::once(own.method)
        .chain(args.against.iter().map(|method| Method::from(*method)))
        .collect();
    let bar = progress(scenes.len(), args.json);
    let results = each(&scenes, |scene| {
        let result = view(scene).and_then(|view| evaluated(&graph, &own, &methods, scene, view));
        if let Some(bar) = &bar {
            bar.inc(1);
        }
        result
    });
    if let Some(bar) = &bar {
        bar.finish_and_clear();
    }
    let scenes = good(&scenes, results, &mut skipped)?;
    let is_lost = skipped.iter().any(|skipped| skipped.is_lost);
    let report = Report::new(&graph, &methods, scenes, skipped)?;
    match args.json {
        true => super::print_json(&report)?,
        false => super::print(&text::of(&report))?,
    }
    Ok(match is_lost {
        false => Outcome::Done,
        true => Outcome::Lost,
    })
}

/// Does something for every scene, on all cores; results come in the order of the scenes.
pub(crate) fn each<T: Send>(scenes: &[Scene], work: impl Fn(&Scene) -> T + Sync) -> Vec<T> {
    let next = Mutex::new(0..scenes.len());
    let done = Mutex::new(BTreeMap::new());
    let take = || next.lock().ok().and_then(|mut next| next.next());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads.min(scenes.len()) {
            scope.spawn(|| {
                while let Some(index) = take() {
                    let result = work(&scenes[index]);
                    if let Ok(mut done) = done.lock() {
                        done.insert(index, result);
                    }
                }
            });
        }
    });
    done.into_inner()
        .unwrap_or_default()
        .into_values()
        .collect()
}

/// The results there are; scenes that failed are left out, and said.
///
/// # Errors
/// When nothing is left.
pub(crate) fn good<T>(
    scenes: &[Scene],
    results: Vec<Result<T, Failure>>,
    skipped: &mut Vec<Skipped>,
) -> Result<Vec<T>, Failure> {
    let mut good = Vec::with_capacity(results.len());
    for (scene, result) in scenes.iter().zip(results) {
        match result {
            Ok(result) => good.push(result),
            Err(failure) => skipped.push(Skipped {
                name: scene.name.clone(),
                is_wrong_use: failure.outcome == Outcome::Usage,
                is_lost: failure.outcome != Outcome::Usage,
                why: failure.text,
            }),
        }
    }
    scenes::nothing_left(good.len(), skipped)?;
    Ok(good)
}

fn evaluated(
    graph: &Graph,
    own: &matching::Settings,
    methods: &[Method],
    scene: &Scene,
    view: usize,
) -> Result<SceneReport, Failure> {
    let (mut source, truth) = scene.open(graph, view)?;
    scene.say_look(graph, &mut source);
    let scan = Tabulated::of(graph, &mut source, scene.scan)?;
    let of_evaluate: evaluate::Settings = settings(graph, "evaluate")?;
    let mut evaluator = Evaluator::new(&of_evaluate);
    let contours = source.contours(scene.scan, view);
    let mut contours =
        contours.map(|contours| ContoursReport::new(&of_evaluate, &contours, &scan, view));
    let settings = |method: Method| matching::Settings {
        method,
        reference: Reference::View(view as u32),
        ..own.clone()
    };
    let (mut results, mut gain) = (Vec::new(), None);
    for &method in methods {
        let matched = scan.matched(&settings(method));
        let result = matched.evaluated(&scan, &mut evaluator, view, &truth);
        if let Some(contours) = &mut contours {
            contours.compare(&matched, &scan, view, &truth);
        }
        if method == Method::ThreeView && scene.views > 3 {
            gain = Some(Gain::of(
                &scan,
                &matched,
                &settings(method),
                &mut evaluator,
                &truth,
            ));
        }
        results.push(result);
    }
    let compared = results.iter().filter_map(|result| result.scores.first());
    if compared.into_iter().all(|score| score.edges == 0) {
        return Err(Failure::failed("its truth is known of no edge"));
    }
    Ok(SceneReport {
        name: scene.name.clone(),
        is_rendered: scene.is_rendered,
        view,
        methods: results.into_iter().map(MethodReport::from).collect(),
        gain,
        contours,
    })
}

pub(crate) fn progress(len: usize, is_quiet: bool) -> Option<ProgressBar> {
    let style = ProgressStyle::with_template("{bar:32} {pos}/{len} scenes  {elapsed}");
    let on_terminal = std::io::stderr().is_terminal() && !is_quiet;
    on_terminal.then(|| {
        ProgressBar::new(len as u64).with_style(style.unwrap_or(ProgressStyle::default_bar()))
    })
}

/// What came of evaluating.
#[derive(Debug, Serialize)]
struct Report {
    /// The methods, each scene's results in their order.
    methods: Vec<Method>,
    /// σ² of the channels, coarse to fine.
    channels: Vec<f32>,
    scenes: Vec<SceneReport>,
    /// Means over the scenes, a method each.
    mean: Vec<MethodMean>,
    skipped: Vec<Skipped>,
}

#[derive(Debug, Serialize)]
struct SceneReport {
    name: String,
    is_rendered: bool,
    /// Index of the reference view among the chosen ones.
    view: usize,
    methods: Vec<MethodReport>,
    /// What more than three views are worth.
    #[serde(skip_serializing_if = "Option::is_none")]
    gain: Option<Gain>,
    /// What curves and matches show of the true contours, of scenes that know them.
    #[serde(skip_serializing_if = "Option::is_none")]
    contours: Option<ContoursReport>,
}

/// All views beside the triple around the reference view, the surest points of each, as many as cover the same. Errors
/// are of disparities between neighbouring views.
#[derive(Clone, Copy, Debug, Serialize)]
struct Gain {
    views: usize,
    coverage: f32,
    triple: Figures,
    all: Figures,
}

impl Gain {
    fn of(
        scan: &Tabulated,
        all: &Matched,
        settings: &matching::Settings,
        evaluator: &mut Evaluator,
        truth: &[f32],
    ) -> Self {
        let views = scan.views();
        let view = settings.reference.index(views);
        let first = view.clamp(1, views - 2) - 1;
        let triple = matching::Settings {
            reference: Reference::View((view - first) as u32),
            ..settings.clone()
        };
        let triple = scan.matched_in(&triple, first..first + 3);
        let mut surest = |matched: &Matched, coverage: f32| {
            matched.surest(scan, evaluator, view, truth, coverage)
        };
        let coverage = [all, &triple].map(|matched| surest(matched, 1.0).coverage);
        let coverage = coverage[0].min(coverage[1]);
        Self {
            views,
            coverage,
            triple: Figures::from(&surest(&triple, coverage)),
            all: Figures::from(&surest(all, coverage)),
        }
    }
}

/// Figures of the scan's result, of each channel, and of the surest points.
#[derive(Debug, Serialize)]
struct MethodReport {
    #[serde(flatten)]
    result: Figures,
    channels: Vec<Figures>,
    curve: Vec<ShareReport>,
}

/// A [`Score`] under the names its users know.
#[derive(Clone, Copy, Debug, Serialize)]
struct Figures {
    coverage: f32,
    bad_0_5: f32,
    bad_1: f32,
    bad_2: f32,
    /// As `bad_1` and `bad_2`, with rows forgiven like columns along level contours.
    bad_1_rows_too: f32,
    bad_2_rows_too: f32,
    median: f32,
    points: u32,
    mismatches: u32,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct ShareReport {
    share: f32,
    score: f32,
    coverage: f32,
    bad_1: f32,
}

#[derive(Debug, Serialize)]
struct MethodMean {
    coverage: f64,
    bad_0_5: f64,
    bad_1: f64,
    bad_2: f64,
    bad_1_rows_too: f64,
    bad_2_rows_too: f64,
    median: f64,
    /// Sums over the scenes.
    points: u64,
    mismatches: u64,
    curve: Vec<ShareReport>,
}

impl From<&Score> for Figures {
    fn from(score: &Score) -> Self {
        Self {
            coverage: score.coverage,
            bad_0_5: score.bad_half,
            bad_1: score.bad_one,
            bad_2: score.bad_two,
            bad_1_rows_too: score.bad_one_rows_too(),
            bad_2_rows_too: score.bad_two_rows_too(),
            median: score.median,
            points: score.points,
            mismatches: score.mismatches,
        }
    }
}

impl From<Evaluated> for MethodReport {
    fn from(evaluated: Evaluated) -> Self {
        let mut scores = evaluated.scores.iter().map(Figures::from);
        let nothing = Figures::from(&Score::default());
        Self {
            result: scores.next().unwrap_or(nothing),
            channels: scores.collect(),
            curve: evaluated
                .curve
                .iter()
                .map(|step| ShareReport {
                    share: step.share,
                    score: step.score,
                    coverage: step.coverage,
                    bad_1: step.bad_one,
                })
                .collect(),
        }
    }
}

impl Report {
    fn new(
        graph: &Graph,
        methods: &[Method],
        scenes: Vec<SceneReport>,
        skipped: Vec<Skipped>,
    ) -> Result<Self, Failure> {
        let mean = (0..methods.len()).map(|method| mean(&scenes, method));
        Ok(Self {
            methods: methods.to_vec(),
            channels: graph.channels()?,
            mean: mean.collect(),
            scenes,
            skipped,
        })
    }
}

/// The mean of a method's figures over the scenes.
fn mean(scenes: &[SceneReport], method: usize) -> MethodMean {
    let results = || scenes.iter().map(|scene| &scene.methods[method]);
    let count = scenes.len().max(1) as f64;
    let of = |value: fn(&Figures) -> f32| {
        results().map(|r| f64::from(value(&r.result))).sum::<f64>() / count
    };
    let steps = results().map(|r| r.curve.len()).min().unwrap_or_default();
    let step = |at: usize| {
        let of = |value: fn(&ShareReport) -> f32| {
            (results()
                .map(|r| f64::from(value(&r.curve[at])))
                .sum::<f64>()
                / count) as f32
        };
        ShareReport {
            share: of(|s| s.share),
            score: of(|s| s.score),
            coverage: of(|s| s.coverage),
            bad_1: of(|s| s.bad_1),
        }
    };
    MethodMean {
        coverage: of(|f| f.coverage),
        bad_0_5: of(|f| f.bad_0_5),
        bad_1: of(|f| f.bad_1),
        bad_2: of(|f| f.bad_2),
        bad_1_rows_too: of(|f| f.bad_1_rows_too),
        bad_2_rows_too: of(|f| f.bad_2_rows_too),
        median: of(|f| f.median),
        points: results().map(|r| u64::from(r.result.points)).sum(),
        mismatches: results().map(|r| u64::from(r.result.mismatches)).sum(),
        curve: (0..steps).map(step).collect(),
    }
}
