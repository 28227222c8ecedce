//! `tricurve compare`: did it get better?

use std::fmt::Write as _;
use std::path::Path;

use messages::Kind;
use messages::words::counted;
use record::{
    Agreement, CompareError, Comparison, Mapped, Partners, Recording, Shared, Time, Truth, Verdict,
    compare, side_by_side,
};
use serde_json::Value;
use tempfile::TempDir;

use super::proof;
use crate::cli::{Compare as Args, WITHIN};
use crate::{Failure, Outcome, former};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    if args.within.is_nan() || args.within < 0.0 {
        return Err(Failure::usage(format!(
            "--within is {}, expected pixels of disparity, 0 or more",
            args.within
        )));
    }
    let (mut a, _computed_a) = open(&args.a)?;
    let (mut b, _computed_b) = open(&args.b)?;
    let compared = compared([&mut a, &mut b], args.within, Partners::SameNumber)?;
    match args.json {
        true => super::print_json(&compared)?,
        false => super::print(&told(&compared))?,
    }
    if let Some(path) = &args.png {
        let both = || a.scans().find(|scan| b.nanos(*scan).is_some());
        let scan = args.scan.or_else(both).unwrap_or_default();
        side_by_side([&mut a, &mut b], [scan; 2], args.within, path).map_err(Failure::failed)?;
        crate::say!(
            "tricurve: scan {scan} of both, and what differs: {}",
            path.display()
        );
    }
    remark(&compared);
    Ok(outcome(&compared))
}

/// Compares a recording with what was computed anew of these of its scans.
pub(super) fn with_replayed(
    recorded: &Path,
    replayed: &Path,
    scans: &[u64],
) -> Result<Comparison, Failure> {
    let (mut a, _computed_a) = open(recorded)?;
    let (mut b, _computed_b) = open(replayed)?;
    let partners = Partners::Replayed(scans);
    compared([&mut a, &mut b], WITHIN, partners)
}

/// A recording, and what had to be computed of it.
fn open(path: &Path) -> Result<(Recording, Option<TempDir>), Failure> {
    let mut recording = Recording::open(path).map_err(Failure::failed)?;
    for note in recording.notes().iter().chain(recording.remarks()) {
        crate::say!("tricurve: {}: {note}", recording.path().display());
    }
    let mut without = Kind::all().collect::<Vec<_>>();
    without.retain(|kind| *kind != Kind::Points);
    let scans = recording.whole_scans();
    let computed = proof::complete(&mut recording, &scans, &without)?;
    Ok((recording, computed))
}

fn compared(
    both: [&mut Recording; 2],
    within: f32,
    partners: Partners<'_>,
) -> Result<Comparison, Failure> {
    let compared = compare(both, within, partners).map_err(|error| match error {
        CompareError::Read(_) => Failure::failed(error),
        error => Failure::usage(error),
    })?;
    // One of them may be of a build before.
    Ok(Comparison {
        settings: former::settled(compared.settings),
        ..compared
    })
}

/// Says what was not compared.
fn remark(compared: &Comparison) {
    if compared.only != [0; 2] {
        crate::say!(
            "tricurve: {} of the first and {} of the second are in one of them only and were not compared",
            counted(compared.only[0], "scan"),
            counted(compared.only[1], "scan")
        );
    }
    if compared.other_images > 0 {
        crate::say!(
            "tricurve: the images of {} differ: what is compared is two takes, not two settings",
            counted(compared.other_images, "scan")
        );
    }
}

/// The exit code of a verdict.
pub(super) fn outcome(compared: &Comparison) -> Outcome {
    match compared.verdict {
        Verdict::Same => Outcome::Done,
        Verdict::Better => Outcome::Better,
        Verdict::Worse => Outcome::Worse,
        Verdict::Different => Outcome::Different,
    }
}

/// As people read it.
pub(super) fn told(compared: &Comparison) -> String {
    let mut out = String::new();
    let mut line = |name: &str, a: &str, b: &str, change: &str| {
        let row = format!("  {name:<26}{a:>16}{b:>16}  {change}");
        writeln!(out, "{}", row.trim_end()).unwrap_or_default();
    };
    line("", "A", "B", "");
    let scans = compared.scans;
    line("scans of both", &scans.to_string(), &scans.to_string(), "");
    for (key, [a, b]) in &compared.settings {
        line(key, &short(a), &short(b), "");
    }
    let Shared {
        a,
        b,
        both,
        moved,
        only_a,
        only_b,
        median,
        most,
    } = compared.points;
    let share = |part: u64, of: u64| format!("{:.1} %", 100.0 * part as f64 / of.max(1) as f64);
    line(
        "points",
        &a.to_string(),
        &b.to_string(),
        &signed(b as f64 - a as f64, 0, ""),
    );
    line("in one only", &only_a.to_string(), &only_b.to_string(), "");
    line("in both", &both.to_string(), "", &share(both, a));
    line(
        &format!("moved by over {} px", compared.within),
        &moved.to_string(),
        "",
        &share(moved, both),
    );
    line(
        "moved, median; most",
        &format!("{median:.3} px"),
        &format!("{most:.2} px"),
        "",
    );
    let truth = compared.truth.iter().flat_map(|[a, b]: &[Truth; 2]| {
        [
            ("coverage", [a.coverage, b.coverage], 4, ""),
            (
                "bad-1.0",
                [a.bad_one, b.bad_one].map(|bad| 100.0 * bad),
                3,
                " %",
            ),
            (
                "bad-2.0",
                [a.bad_two, b.bad_two].map(|bad| 100.0 * bad),
                3,
                " %",
            ),
            ("median error", [a.median, b.median], 4, " px"),
        ]
    });
    let agreement = compared.agreement.iter().flat_map(|both: &[Agreement; 2]| {
        [
            (
                "seen in three views",
                both.map(|of| 100.0 * of.seen),
                2,
                " %",
            ),
            (
                "views miss each other by",
                both.map(|of| of.residual),
                3,
                " px",
            ),
        ]
    });
    let maps = compared.maps.iter().flat_map(|maps: &[Mapped; 2]| {
        [
            (
                "points of the map",
                maps.map(|map| map.points as f64),
                0,
                "",
            ),
            (
                "their σ, median",
                maps.map(|map| 1e3 * f64::from(map.sigma_m)),
                2,
                " mm",
            ),
        ]
    });
    let time = compared.time.iter().map(|time: &Time| {
        let name = match &time.stages[..] {
            [stage] => format!("time of {stage}"),
            stages => format!("time, {} to {}", stages[0], stages[stages.len() - 1]),
        };
        (name, time.milliseconds, 1, " ms")
    });
    let measured = truth.chain(agreement).chain(maps);
    let measured =
        measured.map(|(name, values, digits, unit)| (name.to_owned(), values, digits, unit));
    for (name, values, digits, unit) in measured.chain(time) {
        let [a, b] = values.map(|value| format!("{value:.digits$}{unit}"));
        line(&name, &a, &b, &signed(values[1] - values[0], digits, unit));
    }
    let verdict = match (compared.verdict, &compared.truth) {
        _ if compared.other_images > 0 => {
            "they are of other images, and nothing says which is better"
        }
        (Verdict::Same, None) => "the same: every point is in both, in its place",
        (Verdict::Same, Some(_)) => {
            "the same: coverage within 0.001 and bad-1.0 within 0.01 % of each other"
        }
        (Verdict::Better, _) => {
            "B is better: it covers more or is wrong less often, and loses nothing else"
        }
        (Verdict::Worse, _) => {
            "B is worse: it covers less or is wrong more often, and gains nothing else"
        }
        (Verdict::Different, None) => {
            "they differ, and without the truth nothing says which is better"
        }
        (Verdict::Different, Some([a, b])) if b.coverage > a.coverage => {
            "B covers more and is wrong more often"
        }
        (Verdict::Different, Some(_)) => "B covers less and is wrong less often",
    };
    writeln!(out, "{verdict}").unwrap_or_default();
    out
}

/// A difference with its sign.
fn signed(difference: f64, digits: usize, unit: &str) -> String {
    format!("{difference:+.digits$}{unit}")
}

/// A value that fits its column.
fn short(value: &Value) -> String {
    const MOST: usize = 15;
    let text = match value {
        Value::Null => "-".to_owned(),
        Value::String(text) => text.clone(),
        value => value.to_string(),
    };
    match text.chars().count() > MOST {
        true => format!(
            "…{}",
            text.chars()
                .skip(text.chars().count() - MOST + 1)
                .collect::<String>()
        ),
        false => text,
    }
}
