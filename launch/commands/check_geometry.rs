//! `tricurve check-geometry`: from the images alone, whether rows are aligned and steps equal.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use capture::alignment::{Followed, Ready, Rows, Sighted, Steps, residual, rows, steps};
use capture::look::Finding;
use capture::{Mode, Source};
use messages::{Calibration, Edge, Image, Owned, Rail, Sway};
use serde::Serialize;
use serde_json::json;

use crate::cli::CheckGeometry as Args;
use crate::graph::{Graph, Overrides};
use crate::look::{Found, Looked, Stand, rows_of};
use crate::offline::{curve_points, settings};
use crate::{Failure, Outcome};

/// Scenes of a source, or triples of a rail, that are looked at: the geometry is the same in all.
const SCENES: u64 = 4;
/// A point is taken from every square of so many pixels, the one whose gradient says most about its row.
const CELL: f32 = 12.0;
/// Points followed that are enough to judge by.
const ENOUGH: usize = 30;
/// Pixels by which something must move from view to view.
const LEAST_MOTION: f64 = 1.0;
/// Pixels up to which a miss is no harm, at the 95th percentile.
const GOOD: f64 = 0.3;
/// Pixels up to which matching still works, with less covered.
const FAIR: f64 = 1.0;

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let mut overrides = Overrides::parse(&args.set)?;
    overrides.set("capture", "source", args.source.clone());
    if let Some(views) = &args.views {
        overrides.set("capture", "views", json!(views));
    }
    overrides.lay(args.layout);
    let graph = Graph::load(None, args.profile, &overrides)?;
    let capture: capture::Settings = settings(&graph, "capture")?;
    if let Some(output) = &args.output {
        check_output(args, output, &capture)?;
    }
    let mut source = Source::open(&capture).map_err(|error| match error.is_wrong_use() {
        true => Failure::usage(error),
        false => Failure::failed(error),
    })?;
    if !args.json {
        if let Some(table) = super::input::table(&source) {
            crate::say!("{table}");
        }
        for notice in source.notices() {
            crate::say!("{notice}");
        }
        // That there is no calibration goes without saying here, unless the frames' places were just said by it.
        let of_units = "depths are in arbitrary units";
        for warning in source.warnings() {
            if source.rail().is_some() || !warning.starts_with(of_units) {
                crate::say!("warning: {warning}");
            }
        }
    }
    if let Some(why) = super::run::too_few_for_a_map(&graph, &source).filter(|_| !args.json) {
        crate::say!("warning: {why}");
    }
    let rows = rows_of(&source, SCENES);
    let looked = Looked::at_rows(&mut source, &rows, capture.calibration.is_some());
    let measured = measured(&graph, &mut source, &rows)?;
    let report = Report::of(&measured, &looked);
    let on_output = args.output.as_deref() == Some(Path::new("-"));
    match args.json {
        true => super::print_json(&report)?,
        // Nothing else where the file itself goes.
        false if on_output => crate::say!("{}", report.text().trim_end()),
        false => super::print(&report.text())?,
    }
    if let Some(output) = &args.output {
        write(output, &measured, &report, &source)?;
        if !args.json && !on_output {
            let file = output.display();
            crate::say!(
                "{file}: tricurve run --source {} --set capture.calibration={file}",
                args.source
            );
        }
    }
    Ok(match report.verdict {
        Verdict::Works | Verdict::CoversLess => Outcome::Done,
        _ => Outcome::Failed,
    })
}

/// Whether what is left to correct can be written, before anything is worked out.
fn check_output(args: &Args, output: &Path, capture: &capture::Settings) -> Result<(), Failure> {
    if capture.mode == Mode::Rail {
        return Err(Failure::usage(
            "--output is of a rig: along a rail by how much each frame is off is made good by itself (capture.sway)",
        ));
    }
    if capture.calibration.is_some() {
        return Err(Failure::usage(
            "--output is of views as they are read, and these are rectified: leave capture.calibration away, or give it the rectified images",
        ));
    }
    if args.json && output == Path::new("-") {
        return Err(Failure::usage(
            "the calibration and the JSON cannot both go to standard output: give --output a file",
        ));
    }
    super::calibrate::check_output(output, args.force)
}

/// Writes what is left to correct in each view.
fn write(
    output: &Path,
    measured: &Measured,
    report: &Report,
    source: &Source,
) -> Result<(), Failure> {
    let Some(residual) = &measured.residual else {
        return Err(Failure::failed(
            "nothing is written: too few points could be followed to say what is left to correct",
        ));
    };
    let size = source.size();
    let known = source.calibration();
    let camera = known.unwrap_or(Calibration::assumed(size));
    let mut remarks = vec![format!(
        "tricurve {}: what is left to correct in each view, from {} points",
        env!("CARGO_PKG_VERSION"),
        report.pairs.iter().map(|pair| pair.points).sum::<usize>()
    )];
    if known.is_none_or(|known| !known.calibrated) {
        remarks.push(format!(
            "focal length ({} px) and baseline ({} m from view to view) are assumed: depths are in arbitrary units",
            camera.focal_px, camera.baseline_m
        ));
    }
    let names: Vec<String> = source.views(0).into_iter().map(|view| view.name).collect();
    let text = capture::of_residual(residual, &camera, size, &names, &remarks);
    super::calibrate::write(output, &text)
}

/// What was followed between neighbours, by their names.
#[derive(Default)]
struct Measured {
    /// Between each view and the next; of a rail, whose views are all of one camera, between any.
    pairs: Vec<(String, Vec<Followed>)>,
    /// Around each inner view, or frame of a rail: disparities to the left and to the right, in pixels a baseline.
    inner: Vec<(String, Vec<[f64; 2]>)>,
    asked: usize,
    is_rail: bool,
    /// By how much each view of a rig is off.
    residual: Option<Vec<Sway>>,
    /// The views' numbers.
    numbers: Vec<u32>,
}

/// What goes by a name, which may be new.
fn named<T>(all: &mut Vec<(String, Vec<T>)>, name: String) -> &mut Vec<T> {
    let known = all.iter().position(|(known, _)| *known == name);
    let at = known.unwrap_or_else(|| {
        all.push((name, Vec::new()));
        all.len() - 1
    });
    &mut all[at].1
}

/// Follows points of every inner view into both its neighbours.
fn measured(graph: &Graph, source: &mut Source, rows: &[Vec<Stand>]) -> Result<Measured, Failure> {
    let rail = source.rail();
    let drift = rail.map_or(0.0, |rail| rail.drift_px);
    let mut measured = Measured {
        is_rail: rail.is_some(),
        ..Measured::default()
    };
    let mut sighted: Vec<Sighted> = Vec::new();
    for row in rows {
        // As they are asked for with --views.
        let numbers: Vec<u32> = source
            .views(row[0].scan)
            .into_iter()
            .map(|place| place.number)
            .collect();
        let mut images = Vec::with_capacity(row.len());
        for stand in row {
            let mut image = Owned::<Image>::new(source.size_of(stand.scan));
            image
                .fill(|room| source.read(stand.scan, stand.view, room))
                .map_err(Failure::failed)?;
            images.push(image);
        }
        let size = source.size_of(row[0].scan);
        let ready: Vec<Ready> = images
            .iter()
            .map(|image| Ready::new(image.view().pixels, size))
            .collect();
        let middle = [size.width, size.height].map(|side| (f64::from(side) - 1.0) / 2.0);
        for view in 1..images.len() - 1 {
            let points = chosen(&curve_points(graph, &images[view])?);
            measured.asked += points.len();
            let mut both = vec![[None; 2]; points.len()];
            let from = sighted.len();
            sighted.extend(points.iter().map(|at| Sighted {
                from: view,
                at: [at[0] - middle[0], at[1] - middle[1]],
                seen: Vec::new(),
            }));
            for (side, other) in [view - 1, view + 1].into_iter().enumerate() {
                let step = row[other].place - row[view].place;
                let between = match rail {
                    Some(Rail { stride: 1, .. }) => "frames".to_owned(),
                    Some(Rail { stride, .. }) => format!("{stride} frames"),
                    None => {
                        let [before, after] = [view.min(other), view.max(other)];
                        format!("{} and {}", numbers[before], numbers[after])
                    }
                };
                let pair = named(&mut measured.pairs, between);
                let found = followed(&ready[view], &ready[other], &points);
                let all = points.iter().zip(found).zip(&mut both);
                for (((at, found), both), sighted) in all.zip(&mut sighted[from..]) {
                    let Some(moved) = found else {
                        continue;
                    };
                    sighted.seen.push((other, moved));
                    // As it is matched: with what sways made good.
                    let off = |stand: usize, [x, y]: [f64; 2]| {
                        source.sway(row[stand].scan).off(size, x, y)
                    };
                    let own = off(view, *at);
                    let there = off(other, [at[0] + moved[0], at[1] + moved[1]]);
                    let [columns, rows] = [0, 1].map(|k| moved[k] - (there[k] - own[k]));
                    pair.push(Followed {
                        from_middle: [at[0] - middle[0], at[1] - middle[1]],
                        // Rows count as lower in the right one of two views.
                        rows: rows * step.signum() - drift * step.abs(),
                    });
                    both[side] = Some(-columns / step);
                }
            }
            let around = match rail {
                Some(_) => row[view].scan.to_string(),
                None => numbers[view].to_string(),
            };
            named(&mut measured.inner, around).extend(
                both.into_iter()
                    .filter_map(|[left, right]| Some([left?, right?])),
            );
        }
    }
    // Views of one size are of the same cameras.
    let size = source.size();
    let is_one_size = (0..source.scenes()).all(|scan| source.size_of(scan) == size);
    if rail.is_none() && is_one_size {
        measured.residual = residual(size, source.view_count(), &sighted);
        let views = source.views(0).into_iter();
        measured.numbers = views.map(|view| view.number).collect();
    }
    Ok(measured)
}

/// Nearly the least and nearly the greatest of all disparities.
fn disparities(measured: &Measured) -> Option<[f64; 2]> {
    let all = measured.inner.iter().flat_map(|(_, both)| both);
    let mut all: Vec<f64> = all.map(|[left, right]| (left + right) / 2.0).collect();
    all.sort_by(f64::total_cmp);
    let last = all.len().checked_sub(1)?;
    Some([0.02, 0.98].map(|share| all[(share * last as f64).round() as usize]))
}

/// By how many columns and rows points lie further in another view, on all cores; `None` where they were not found again.
fn followed(from: &Ready, to: &Ready, points: &[[f64; 2]]) -> Vec<Option<[f64; 2]>> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let part = points.len().div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let workers: Vec<_> = points
            .chunks(part)
            .map(|part| {
                scope.spawn(move || {
                    part.iter()
                        .map(|&point| from.follow(to, point))
                        .collect::<Vec<_>>()
                })
            })
            .collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined
            .flat_map(|found| found.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}

/// Of the points on curves, in every cell the one whose gradient goes up or down most.
fn chosen(points: &[Edge]) -> Vec<[f64; 2]> {
    let mut cells: BTreeMap<(i32, i32), &Edge> = BTreeMap::new();
    let worth = |edge: &Edge| (edge.magnitude * edge.orientation.sin()).abs();
    for edge in points {
        let cell = ((edge.y / CELL) as i32, (edge.x / CELL) as i32);
        let best = cells.entry(cell).or_insert(edge);
        if worth(edge) > worth(best) {
            *best = edge;
        }
    }
    let place = |edge: &Edge| [edge.x, edge.y].map(f64::from);
    cells.into_values().map(place).collect()
}

/// What the figures amount to.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Verdict {
    Works,
    CoversLess,
    Reversed,
    OutOfOrder,
    Constant,
    Identical,
    OddView,
    NothingInCommon,
    NoStep,
    RectifyFirst,
    Unknown,
}

impl Verdict {
    /// What makes a scan no stereo at all; `None` of rows that are off, which are measured thoroughly.
    fn of(finding: &Finding) -> Option<Self> {
        Some(match finding {
            Finding::Constant { .. } => Self::Constant,
            Finding::Identical { .. } => Self::Identical,
            Finding::Odd { .. } => Self::OddView,
            Finding::Apart { .. } => Self::NothingInCommon,
            Finding::Still { .. } => Self::NoStep,
            Finding::Order { order } if order.is_sorted_by(|a, b| a > b) => Self::Reversed,
            Finding::Order { .. } => Self::OutOfOrder,
            Finding::Rows { .. } => return None,
        })
    }
}

#[derive(Debug, Serialize)]
struct Report {
    verdict: Verdict,
    /// The verdict in a sentence.
    says: String,
    /// Points that were to be followed.
    asked: usize,
    pairs: Vec<Pair>,
    steps: Vec<Inner>,
    /// Of a rig, by how much each view is off beside the mean of all.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    residual: Vec<Residual>,
    /// Nearly the least and nearly the greatest disparity, in pixels a step.
    disparities_px: Option<[f64; 2]>,
    /// What makes a scan no stereo, of each that was looked at.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    no_stereo: Vec<Found>,
    #[serde(skip)]
    is_rail: bool,
}

/// By how much a view is off.
#[derive(Debug, Serialize)]
struct Residual {
    view: u32,
    right_px: f64,
    down_px: f64,
    turn_degrees: f64,
    scale_percent: f64,
}

/// Rows between a view and the next.
#[derive(Debug, Serialize)]
struct Pair {
    between: String,
    points: usize,
    mistaken: usize,
    median_px: Option<f64>,
    p95_px: Option<f64>,
    offset_px: Option<f64>,
    turn_degrees: Option<f64>,
    scale_percent: Option<f64>,
}

/// Steps on both sides of a view.
#[derive(Debug, Serialize)]
struct Inner {
    around: String,
    points: usize,
    ratio: Option<f64>,
    shift_px: Option<f64>,
    median_px: Option<f64>,
    p95_px: Option<f64>,
    miss_px: Option<f64>,
}

impl Report {
    /// What the columns of the text mean.
    const KEY: &str = "
in pixels, of points followed from view to view; p95: 95 of 100 are below
rows: how far a point lies off its row (median, p95), by an offset, a turn and a
      scale of the right view; mistaken: found in a wrong place and left out
steps: left disparity = ratio * right disparity + shift, and what differs still;
       miss: by how much unequal steps put a match in the third view off

";

    fn of(measured: &Measured, looked: &Looked) -> Self {
        let pairs = measured.pairs.iter().map(|(between, followed)| {
            let rows: Option<Rows> = rows(followed);
            Pair {
                between: between.clone(),
                points: rows.map_or(followed.len(), |rows| rows.points),
                mistaken: rows.map_or(0, |rows| rows.mistaken),
                median_px: rows.map(|rows| rows.median_px),
                p95_px: rows.map(|rows| rows.p95_px),
                offset_px: rows.map(|rows| rows.offset_px),
                turn_degrees: rows.map(|rows| rows.per_column.to_degrees()),
                scale_percent: rows.map(|rows| rows.per_row * 100.0),
            }
        });
        let inner = measured.inner.iter().map(|(around, disparities)| {
            let steps: Option<Steps> = steps(disparities);
            Inner {
                around: around.clone(),
                points: steps.map_or(disparities.len(), |steps| steps.points),
                ratio: steps.map(|steps| steps.ratio),
                shift_px: steps.map(|steps| steps.shift_px),
                median_px: steps.map(|steps| steps.median_px),
                p95_px: steps.map(|steps| steps.p95_px),
                miss_px: steps.map(|steps| steps.miss_px),
            }
        });
        let sways = measured.residual.iter().flatten();
        let residual = measured
            .numbers
            .iter()
            .zip(sways)
            .map(|(view, sway)| Residual {
                view: *view,
                right_px: sway.right_px,
                down_px: sway.down_px,
                turn_degrees: sway.turn.to_degrees(),
                scale_percent: sway.scale * 100.0,
            });
        let mut report = Self {
            verdict: Verdict::Unknown,
            says: String::new(),
            asked: measured.asked,
            pairs: pairs.collect(),
            steps: inner.collect(),
            residual: residual.collect(),
            disparities_px: disparities(measured),
            no_stereo: looked.no_stereo().cloned().collect(),
            is_rail: measured.is_rail,
        };
        (report.verdict, report.says) = report.judged();
        report
    }

    /// What is wrong with how the views follow each other.
    fn disorder(&self) -> Option<(Verdict, String)> {
        let [least, most] = self.disparities_px?;
        if least.abs().max(most.abs()) < LEAST_MOTION {
            let text = "hardly anything moves from view to view: are they of one place?";
            return Some((Verdict::Unknown, text.to_owned()));
        }
        (most < -LEAST_MOTION).then(|| {
            let text = format!(
                "everything moves to the right, by {:.1} to {:.1} px a step: the views go from right to left, or positions count the other way; reverse them",
                -most, -least
            );
            (Verdict::Reversed, text)
        })
    }

    /// The worst figure decides.
    fn judged(&self) -> (Verdict, String) {
        let first = self.no_stereo.first();
        if let Some((found, verdict)) =
            first.and_then(|found| Some((found, Verdict::of(&found.finding)?)))
        {
            return (verdict, found.says.clone());
        }
        let least = self.pairs.iter().map(|pair| pair.points);
        let least = least
            .chain(self.steps.iter().map(|inner| inner.points))
            .min();
        let worst =
            |values: &mut dyn Iterator<Item = Option<f64>>| values.flatten().fold(0.0, f64::max);
        let rows = worst(&mut self.pairs.iter().map(|pair| pair.p95_px));
        let steps = worst(&mut self.steps.iter().map(|inner| inner.miss_px));
        let grade = |px: f64| match px {
            px if px < GOOD => Verdict::Works,
            px if px <= FAIR => Verdict::CoversLess,
            _ => Verdict::RectifyFirst,
        };
        if least.is_none_or(|points| points < ENOUGH) {
            // Rows that are off by much are the likeliest reason, and a few points tell.
            let hint = match grade(rows) {
                Verdict::Works => "the views show too little in common, or too little structure",
                _ => "what could be followed is misaligned: rectify the views first",
            };
            return (
                Verdict::Unknown,
                format!("too few points could be followed to judge by: {hint}"),
            );
        }
        if let Some(disorder) = self.disorder() {
            return disorder;
        }
        match (grade(rows), grade(steps)) {
            (Verdict::Works, Verdict::Works) => (
                Verdict::Works,
                format!(
                    "matching will work: rows are aligned within {rows:.2} px and steps equal within {steps:.2} px"
                ),
            ),
            (Verdict::RectifyFirst, _) => (
                Verdict::RectifyFirst,
                // No calibration says how a camera is turned against its rail.
                match self.is_rail {
                    true => format!(
                        "level the camera along its way, or turn the images: rows miss each other by {rows:.2} px, and only a drift of up to 2 rows over a triple is made good"
                    ),
                    false => format!(
                        "rectify the views first (capture.calibration): rows miss each other by {rows:.2} px"
                    ),
                },
            ),
            (_, Verdict::RectifyFirst) => (
                Verdict::RectifyFirst,
                format!(
                    "the steps must be equal, and these make a point miss by {steps:.2} px: mend the rig, choose other views, or rectify"
                ),
            ),
            _ => (
                Verdict::CoversLess,
                format!(
                    "matching will work but cover less: rows miss each other by {rows:.2} px, steps by {steps:.2} px"
                ),
            ),
        }
    }

    fn text(&self) -> String {
        let number = |value: Option<f64>, digits: usize| {
            value.map_or("–".to_owned(), |value| format!("{value:.digits$}"))
        };
        let mut text = String::new();
        let mut line = |cells: [&str; 8]| {
            let [first, rest @ ..] = cells;
            let rest = rest.map(|cell| format!("{cell:>9}")).concat();
            writeln!(text, "{}", format!("{first:<14}{rest}").trim_end()).unwrap_or_default();
        };
        line([
            "rows", "points", "mistaken", "median", "p95", "offset", "turn", "scale",
        ]);
        for pair in &self.pairs {
            line([
                &pair.between,
                &pair.points.to_string(),
                &pair.mistaken.to_string(),
                &number(pair.median_px, 3),
                &number(pair.p95_px, 3),
                &number(pair.offset_px, 3),
                &(number(pair.turn_degrees, 3) + "°"),
                &(number(pair.scale_percent, 3) + "%"),
            ]);
        }
        line([
            "steps", "points", "ratio", "shift", "median", "p95", "miss", "",
        ]);
        for inner in &self.steps {
            line([
                &format!("around {}", inner.around),
                &inner.points.to_string(),
                &number(inner.ratio, 4),
                &number(inner.shift_px, 3),
                &number(inner.median_px, 3),
                &number(inner.p95_px, 3),
                &number(inner.miss_px, 3),
                "",
            ]);
        }
        if !self.residual.is_empty() {
            line(["left over", "right", "down", "turn", "scale", "", "", ""]);
        }
        for view in &self.residual {
            line([
                &format!("view {}", view.view),
                &number(Some(view.right_px), 3),
                &number(Some(view.down_px), 3),
                &(number(Some(view.turn_degrees), 3) + "°"),
                &(number(Some(view.scale_percent), 3) + "%"),
                "",
                "",
                "",
            ]);
        }
        text += Self::KEY;
        // One of them is what it amounts to.
        for found in self.no_stereo.iter().skip(1) {
            text += &format!("{}\n", found.says);
        }
        text + &self.says + "\n"
    }
}
