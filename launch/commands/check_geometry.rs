//! `tricurve check-geometry`: from the images alone, whether rows are aligned and steps equal.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use capture::Source;
use capture::alignment::{Followed, Ready, Rows, Steps, rows, steps};
use messages::{Edge, Image, Owned};
use serde::Serialize;
use serde_json::json;

use crate::cli::CheckGeometry as Args;
use crate::graph::{Graph, Overrides};
use crate::offline::{curve_points, settings};
use crate::{Failure, Outcome};

/// Scenes of a source that are looked at: the geometry is the same in all.
const SCENES: u64 = 4;
/// A point is taken from every square of so many pixels, the one whose gradient says most about its row.
const CELL: f32 = 12.0;
/// Points followed that are enough to judge by.
const ENOUGH: usize = 30;
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
    let graph = Graph::load(None, args.profile, &overrides)?;
    let capture: capture::Settings = settings(&graph, "capture")?;
    let mut source = Source::open(&capture).map_err(|error| match error.is_wrong_use() {
        true => Failure::usage(error),
        false => Failure::failed(error),
    })?;
    if !args.json {
        for notice in source.notices() {
            crate::say!("{notice}");
        }
    }
    let report = Report::of(&measured(&graph, &mut source)?);
    match args.json {
        true => super::print_json(&report)?,
        false => super::print(&report.text())?,
    }
    Ok(match report.verdict {
        Verdict::Works | Verdict::CoversLess => Outcome::Done,
        Verdict::RectifyFirst | Verdict::Unknown => Outcome::Failed,
    })
}

/// What was followed between neighbouring views.
struct Measured {
    /// Between each view and the next.
    pairs: Vec<Vec<Followed>>,
    /// By inner view: disparities to the left and to the right.
    inner: Vec<Vec<[f64; 2]>>,
    asked: usize,
}

/// Follows points of every inner view into both its neighbours.
fn measured(graph: &Graph, source: &mut Source) -> Result<Measured, Failure> {
    let views = source.view_count();
    let mut measured = Measured {
        pairs: vec![Vec::new(); views - 1],
        inner: vec![Vec::new(); views.saturating_sub(2)],
        asked: 0,
    };
    for scan in 0..source.scenes().min(SCENES) {
        let size = source.size_of(scan);
        let mut ready = Vec::with_capacity(views);
        // Of the outer views none.
        let mut points = Vec::with_capacity(views);
        for view in 0..views {
            let mut image = Owned::<Image>::new(size);
            image
                .fill(|room| source.read(scan, view, room))
                .map_err(Failure::failed)?;
            ready.push(Ready::new(image.view().pixels, size));
            let is_inner = view > 0 && view + 1 < views;
            points.push(match is_inner {
                true => chosen(&curve_points(graph, &image)?),
                false => Vec::new(),
            });
        }
        let middle = [size.width, size.height].map(|side| (f64::from(side) - 1.0) / 2.0);
        let inner = points.iter().enumerate();
        for (view, points) in inner.filter(|(_, points)| !points.is_empty()) {
            measured.asked += points.len();
            for (point, by) in followed(&ready, view, points) {
                let from_middle = [point[0] - middle[0], point[1] - middle[1]];
                // Rows count as lower in the right one of two views.
                for (pair, rows) in [
                    (view - 1, by[0].map(|l| -l[1])),
                    (view, by[1].map(|r| r[1])),
                ] {
                    measured.pairs[pair].extend(rows.map(|rows| Followed { from_middle, rows }));
                }
                if let [Some(left), Some(right)] = by {
                    measured.inner[view - 1].push([left[0], -right[0]]);
                }
            }
        }
    }
    Ok(measured)
}

/// A point (column, row), and by how much it lies further in the left and in the right neighbour.
type Both = ([f64; 2], [Option<[f64; 2]>; 2]);

/// Follows points of a view into both neighbours, on all cores.
fn followed(ready: &[Ready], view: usize, points: &[[f64; 2]]) -> Vec<Both> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let follow = |&point: &[f64; 2]| {
        let into = |other: usize| ready[view].follow(&ready[other], point);
        (point, [into(view - 1), into(view + 1)])
    };
    let part = points.len().div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let workers: Vec<_> = points
            .chunks(part)
            .map(|part| scope.spawn(move || part.iter().map(follow).collect::<Vec<_>>()))
            .collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined.flat_map(Result::unwrap_or_default).collect()
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
    RectifyFirst,
    Unknown,
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
}

/// Rows between a view and the next.
#[derive(Debug, Serialize)]
struct Pair {
    views: [usize; 2],
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
    view: usize,
    points: usize,
    ratio: Option<f64>,
    median_px: Option<f64>,
    p95_px: Option<f64>,
    miss_px: Option<f64>,
}

impl Report {
    fn of(measured: &Measured) -> Self {
        let pairs = measured.pairs.iter().enumerate().map(|(view, followed)| {
            let rows: Option<Rows> = rows(followed);
            Pair {
                views: [view, view + 1],
                points: rows.map_or(followed.len(), |rows| rows.points),
                mistaken: rows.map_or(0, |rows| rows.mistaken),
                median_px: rows.map(|rows| rows.median_px),
                p95_px: rows.map(|rows| rows.p95_px),
                offset_px: rows.map(|rows| rows.offset_px),
                turn_degrees: rows.map(|rows| rows.per_column.to_degrees()),
                scale_percent: rows.map(|rows| rows.per_row * 100.0),
            }
        });
        let inner = measured.inner.iter().enumerate().map(|(at, disparities)| {
            let steps: Option<Steps> = steps(disparities);
            Inner {
                view: at + 1,
                points: steps.map_or(disparities.len(), |steps| steps.points),
                ratio: steps.map(|steps| steps.ratio),
                median_px: steps.map(|steps| steps.median_px),
                p95_px: steps.map(|steps| steps.p95_px),
                miss_px: steps.map(|steps| steps.miss_px),
            }
        });
        let mut report = Self {
            verdict: Verdict::Unknown,
            says: String::new(),
            asked: measured.asked,
            pairs: pairs.collect(),
            steps: inner.collect(),
        };
        (report.verdict, report.says) = report.judged();
        report
    }

    /// The worst figure decides.
    fn judged(&self) -> (Verdict, String) {
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
        match (grade(rows), grade(steps)) {
            (Verdict::Works, Verdict::Works) => (
                Verdict::Works,
                format!(
                    "matching will work: rows are aligned within {rows:.2} px and steps equal within {steps:.2} px"
                ),
            ),
            (Verdict::RectifyFirst, _) => (
                Verdict::RectifyFirst,
                format!(
                    "rectify the views first (capture.calibration): rows miss each other by {rows:.2} px"
                ),
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
            let rest = rest.map(|cell| format!("{cell:>10}")).concat();
            writeln!(text, "{first:<12}{rest}").unwrap_or_default();
        };
        line([
            "rows", "points", "mistaken", "median", "p95", "offset", "turn", "scale",
        ]);
        for pair in &self.pairs {
            line([
                &format!("{} and {}", pair.views[0], pair.views[1]),
                &pair.points.to_string(),
                &pair.mistaken.to_string(),
                &number(pair.median_px, 3),
                &number(pair.p95_px, 3),
                &number(pair.offset_px, 3),
                &(number(pair.turn_degrees, 3) + "°"),
                &(number(pair.scale_percent, 3) + "%"),
            ]);
        }
        line(["steps", "points", "ratio", "median", "p95", "miss", "", ""]);
        for inner in &self.steps {
            line([
                &format!("around {}", inner.view),
                &inner.points.to_string(),
                &number(inner.ratio, 4),
                &number(inner.median_px, 3),
                &number(inner.p95_px, 3),
                &number(inner.miss_px, 3),
                "",
                "",
            ]);
        }
        text + &self.says + "\n"
    }
}
