//! A recording as one page for people: what it is, its figures, its points in space, how the run went.
//!
//! ```text
//! Recording ─► head ─► map ─► measured │ set ─► scans: figures │ space │ plots ─► accuracy ─► run │ ledger
//!                                                                                          └─► report.html
//! ```
//!
//! The page holds everything it shows, and nothing but what the recording says: the same recording gives the same
//! bytes. What cannot be read of it is said where it would stand.

mod accuracy;
mod figures;
mod legend;
mod map;
mod page;
mod plot;
mod run;
mod scan;
mod settings;
mod space;
mod thesis;

use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use maud::{Markup, html};
use png::EncodingError;
use thiserror::Error;

use self::accuracy::Scores;
use self::page::{Album, Figure, count, counted};
use self::run::Run;
use crate::export::{not_onto_itself, whole};
use crate::info::{bytes, date, some_of};
use crate::{ExportError, Info, Recording};

pub use accuracy::{Mismatches, Rivals};
pub use settings::{Known, MEASURED, settings_in_lines};
pub use thesis::thesis;

/// Why there is no page.
#[derive(Debug, Error)]
pub enum ReportError {
    /// It cannot be written.
    #[error(transparent)]
    Write(#[from] ExportError),
    /// There is a file already.
    #[error("{} exists; --force overwrites it", .0.display())]
    Exists(PathBuf),
    /// None of the scans that were asked for is there.
    #[error("no scan of the recording is among those asked for; it holds {0}")]
    NoScan(String),
}

/// What the page shall show.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    /// The scans; without it the first of each scene, at most [four](MOST_SCENES).
    pub scans: Option<std::ops::Range<u64>>,
    /// Whether a file that is there is overwritten.
    pub overwrite: bool,
    /// What is known of the settings.
    pub known: Known,
}

/// What came of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reported {
    /// The scans shown.
    pub scans: Vec<u64>,
    /// Bytes of them that could not be read.
    pub unreadable_bytes: u64,
}

/// How many scenes are shown when nobody says which scans.
pub const MOST_SCENES: usize = 4;

/// Writes the page. `rivals` is asked what other methods make of the scans shown, where there is a truth to tell.
///
/// # Errors
/// When it cannot be written, or must not be; it is there whole or not at all.
pub fn report(
    recording: &mut Recording,
    wanted: &Page,
    path: &Path,
    rivals: &mut Rivals<'_>,
) -> Result<Reported, ReportError> {
    not_onto_itself(recording, path)?;
    // A pipe or the standard output has nothing to lose.
    if !wanted.overwrite && path.is_file() {
        return Err(ReportError::Exists(path.to_owned()));
    }
    let scans = shown(recording, wanted)?;
    let mut reported = Reported {
        scans,
        unreadable_bytes: 0,
    };
    whole(path, |file| {
        let mut file = BufWriter::new(file);
        write(recording, wanted, &mut reported, rivals, &mut |html| {
            file.write_all(html.as_bytes())?;
            html.clear();
            Ok(())
        })
        .and_then(|()| Ok(file.flush()?))
        .map_err(|fault: Fault| ExportError::Io {
            path: path.to_owned(),
            source: fault.into(),
        })
    })?;
    Ok(reported)
}

/// Why a part of the page cannot be made. Text in memory takes everything, so that only the file can fail, or a picture
/// too large for its format.
#[derive(Debug, Error)]
enum Fault {
    #[error(transparent)]
    Picture(#[from] EncodingError),
    #[error(transparent)]
    File(#[from] std::io::Error),
}

impl From<Fault> for std::io::Error {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::File(error) => error,
            Fault::Picture(error) => error.into(),
        }
    }
}

/// The scans that the page shows.
///
/// # Errors
/// When none of those that are asked for is there.
pub fn shown(recording: &Recording, wanted: &Page) -> Result<Vec<u64>, ReportError> {
    if let Some(range) = &wanted.scans {
        let scans: Vec<u64> = recording
            .scans()
            .filter(|scan| range.contains(scan))
            .collect();
        return match scans.is_empty() {
            true => Err(ReportError::NoScan(recording.held())),
            false => Ok(scans),
        };
    }
    let whole = recording.whole_scans();
    let all = match whole.is_empty() {
        true => recording.scans().collect(),
        false => whole,
    };
    if recording.metadata().rig.rail.is_some() {
        // Every frame has a name of its own: some along the way, and not the first ones, which have no triple.
        let parts = 1..=MOST_SCENES.min(all.len());
        let last = all.len() - 1;
        return Ok(parts.map(|part| all[part * last / MOST_SCENES]).collect());
    }
    let mut chosen: Vec<u64> = Vec::new();
    for scan in all {
        let is_shown = |shown: &u64| name(recording, *shown) == name(recording, scan);
        if chosen.len() < MOST_SCENES && !chosen.iter().any(is_shown) {
            chosen.push(scan);
        }
    }
    Ok(chosen)
}

/// The name of a scan's scene, when it has one.
fn name(recording: &Recording, scan: u64) -> Option<&str> {
    let names = &recording.metadata().scans;
    names.get(usize::try_from(scan).ok()?).map(String::as_str)
}

/// A scan as headings call it.
fn title(recording: &Recording, scan: u64) -> String {
    match name(recording, scan) {
        Some(name) => format!("Scan {scan}: {name}"),
        None => format!("Scan {scan}"),
    }
}

/// Makes the page section by section, and hands each over when it is done: a picture takes a thousand times the memory
/// of its text.
fn write(
    recording: &mut Recording,
    wanted: &Page,
    reported: &mut Reported,
    rivals: &mut Rivals<'_>,
    flush: &mut dyn FnMut(&mut String) -> std::io::Result<()>,
) -> Result<(), Fault> {
    let mut put = |part: Markup| {
        let mut html = part.into_string();
        page::printable(&mut html);
        flush(&mut html)
    };
    let info = Info::of(recording);
    let compared = settings::Compared::new(&info.configuration, &wanted.known);
    let file = info.path.file_name().unwrap_or_default().to_string_lossy();
    let mut album = Album::default();
    put(page::begin(&file))?;
    put(head(&file, &info))?;
    put(page::navigation(&sections(recording, &reported.scans)))?;
    put(map::section(&mut album, recording)?)?;
    let run = Run::read(recording);
    let scores = Scores::read(recording, &run::plotted(recording).0);
    let figures = [run.figures(), scores.figures()].concat();
    put(measured(recording, &info, &reported.scans, &figures))?;
    put(compared.section(&info.changes, &info.graph, &wanted.known))?;
    for &scan in &reported.scans {
        let title = title(recording, scan);
        let (section, unreadable) = scan::section(&mut album, recording, scan, &title)?;
        reported.unreadable_bytes += unreadable;
        put(section)?;
    }
    put(accuracy::section(
        recording,
        &reported.scans,
        &scores,
        rivals,
    ))?;
    put(run.section())?;
    put(run::ledger(&info))?;
    put(page::end())?;
    Ok(())
}

/// The top of the page: the recording's name, how it is in three words, and what is wrong with it.
fn head(file: &str, info: &Info) -> Markup {
    let scans = counted(info.scans.total as u64, "scan", "scans");
    let ledger = match info.balanced {
        Some(true) => (true, "ledger balanced"),
        Some(false) => (false, "ledger not balanced"),
        None => (false, "no ledger"),
    };
    let badges = [
        match info.complete {
            true => (true, "complete"),
            false => (false, "incomplete"),
        },
        ledger,
        match info.calibrated {
            true => (true, "calibrated: depths in metres"),
            false => (false, "not calibrated: depths up to one factor"),
        },
    ];
    let failures = info.failures();
    html! {
        header.head {
            p.eyebrow { "tricurve · report of a recording" }
            h1 { (file) }
            p.lede {
                (scans) " of " (info.source)
                @if let Some(nanos) = info.start_nanos { ", " (date(nanos)) }
            }
            ul.badges {
                @for (is_good, text) in badges { li class=(if is_good { "good" } else { "bad" }) { (text) } }
            }
            @if !failures.is_empty() {
                div.alarm role="note" {
                    b { "It is less than it should be:" }
                    ul { @for failure in &failures { li { (failure) } } }
                }
            }
        }
        "\n"
    }
}

/// The sections that the page has, in their order.
fn sections(recording: &Recording, scans: &[u64]) -> Vec<(String, String)> {
    let named = |id: &str, name: &str| (id.to_owned(), name.to_owned());
    let mut all = Vec::new();
    all.extend(map::is_there(recording).then(|| named("map", "Map")));
    all.extend([named("measured", "Measured"), named("settings", "Settings")]);
    // Of very many the page itself is the list.
    let scans = scans.iter().take(12);
    all.extend(scans.map(|&scan| (format!("scan-{scan}"), title(recording, scan))));
    all.extend(accuracy::is_there(recording).then(|| named("accuracy", "Accuracy")));
    all.extend([named("run", "Run"), named("ledger", "Ledger")]);
    all
}

/// What was measured, and with which cameras.
fn measured(recording: &Recording, info: &Info, shown: &[u64], figures: &[Figure]) -> Markup {
    let scans = &info.scans;
    let mut held = format!(
        "{} of {} whole",
        count(scans.whole as u64),
        count(scans.total as u64)
    );
    for (which, list) in [("partial", &scans.partial), ("missing", &scans.missing)] {
        if !list.is_empty() {
            held += &format!("; {which}: {}", some_of(list));
        }
    }
    let size = info.parts.iter().map(|part| part.bytes).sum();
    let parts = counted(info.parts.len() as u64, "file", "files");
    let rig = &info.rig;
    let views: Vec<&str> = rig.views.iter().map(|view| view.name.as_str()).collect();
    let channels: Vec<String> = rig.channels.iter().map(f32::to_string).collect();
    let camera = rig.calibration(rig.size);
    let assumed = match info.calibrated {
        true => "",
        false => {
            "; assumed, so that depths are right up to one factor, and shapes only with the right focal length"
        }
    };
    let ledger = match (&info.ledger, info.balanced) {
        (Some(ledger), Some(is_balanced)) => format!(
            "{} admitted, {} done, {}",
            count(ledger.admitted),
            count(ledger.done),
            if is_balanced {
                "balanced"
            } else {
                "not balanced"
            }
        ),
        _ => "none: the run did not come to its end".to_owned(),
    };
    let facts = [
        ("Source", info.source.clone()),
        ("First scan", info.start_nanos.map_or("—".to_owned(), date)),
        (
            "Duration",
            format!("{:.3} s of recorded time", info.duration_seconds),
        ),
        ("Scans", held),
        ("Shown here", shown_scans(recording, shown)),
        ("Ledger", ledger),
        (
            "Views",
            format!("{}; reference {}", views.join(", "), info.reference),
        ),
        (
            "Largest image",
            format!("{} × {} px", rig.size.width, rig.size.height),
        ),
        ("Channels", format!("σ² = {} px²", channels.join(", "))),
        (
            "Calibration",
            format!(
                "f {} px, c ({}, {}) px, baseline {}{assumed}",
                camera.focal_px,
                camera.cx,
                camera.cy,
                rig.shown_baseline(rig.size)
            ),
        ),
        ("Size", format!("{} in {parts}", bytes(size))),
        ("Written by", format!("tricurve {}", info.version)),
    ];
    html! {
        section #measured {
            h2 { "What was measured" }
            @if !figures.is_empty() {
                @if info.scans.total > 1 { p { "Medians over the scans:" } }
                (page::numbers(figures))
            }
            dl.facts { @for (name, value) in facts { div { dt { (name) } dd { (value) } } } }
            (settings::changed(&info.changes))
        }
        "\n"
    }
}

/// Which scans are shown, of how many.
fn shown_scans(recording: &Recording, shown: &[u64]) -> String {
    let total = recording.scans().len();
    match shown.len() {
        0 => "none: there is no scan".to_owned(),
        all if all == total => match total {
            1 => "the one scan".to_owned(),
            _ => format!("all {total} scans"),
        },
        _ => format!(
            "{} {} of {}; --scans A..B shows others",
            if shown.len() == 1 { "scan" } else { "scans" },
            some_of(shown),
            count(total as u64)
        ),
    }
}
