//! A recording as one page for people: what it is, its figures, its points in space, how the run went.
//!
//! ```text
//! Recording ─► head ─► scans: figures │ space │ plots ─► accuracy ─► run: plots, ledger, settings ─► report.html
//! ```
//!
//! The page holds everything it shows, and nothing but what the recording says: the same recording gives the same
//! bytes. What cannot be read of it is said where it would stand.

mod accuracy;
mod figures;
mod map;
mod page;
mod plot;
mod scan;
mod settings;
mod space;
mod thesis;

use std::fmt::{self, Write as _};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use messages::Stage;
use messages::record::Statistics;
use png::EncodingError;
use thiserror::Error;

use self::page::{count, counted, escape, missing};
use self::plot::Series;
use crate::export::{not_onto_itself, whole};
use crate::info::{bytes, date, some_of};
use crate::{ExportError, Info, Recording};

pub use accuracy::{Mismatches, Rivals};
pub use settings::{Known, settings_in_lines};
pub use thesis::thesis;

/// Why there is no page.
#[derive(Debug, Error)]
pub enum ReportError {
    /// It cannot be written.
    #[error(transparent)]
    Write(#[from] ExportError),
    /// There is a file already.
    #[error("{} is there already; --force overwrites it", .0.display())]
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

/// Over the scans no more points are plotted: a page is no wider, and a long recording need not be read whole.
const MOST_PLOTTED: usize = 400;

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
    Text(#[from] fmt::Error),
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
            Fault::Text(error) => Self::other(error),
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
    let info = Info::of(recording);
    let compared = settings::Compared::new(&info.configuration, &wanted.known);
    let file = info.path.file_name().unwrap_or_default().to_string_lossy();
    let mut html = String::new();
    page::begin(&mut html, &file)?;
    head(&mut html, &file, &info)?;
    contents(&mut html, recording, &reported.scans)?;
    about(&mut html, recording, &info, &reported.scans)?;
    compared.head(&mut html)?;
    settings::changed(&mut html, &info.changes)?;
    html.push_str("</section>\n");
    flush(&mut html)?;
    for &scan in &reported.scans {
        let title = title(recording, scan);
        reported.unreadable_bytes += scan::section(&mut html, recording, scan, &title)?;
        flush(&mut html)?;
    }
    map::section(&mut html, recording)?;
    flush(&mut html)?;
    let (all, _) = plotted(recording);
    accuracy::section(&mut html, recording, &reported.scans, &all, rivals)?;
    flush(&mut html)?;
    run(&mut html, recording)?;
    ledger(&mut html, &info)?;
    html.push_str("<section id=\"settings\"><h2>Settings</h2>");
    settings::changes(&mut html, &info.changes)?;
    compared.tables(&mut html, &wanted.known)?;
    if !info.graph.trim().is_empty() {
        write!(
            html,
            "<details><summary>the whole graph <span>as the recording holds it</span></summary><pre>{}</pre></details>",
            escape(&info.graph)
        )?;
    }
    html.push_str("</section>\n");
    page::end(&mut html)?;
    flush(&mut html)?;
    Ok(())
}

/// The top of the page: the recording's name, and how it is in three words.
fn head(out: &mut String, file: &str, info: &Info) -> fmt::Result {
    let scans = counted(info.scans.total as u64, "scan", "scans");
    let start = info
        .start_nanos
        .map_or(String::new(), |nanos| format!(", {}", date(nanos)));
    write!(
        out,
        "<header class=\"head\"><p class=\"eyebrow\">tricurve · report of a recording</p><h1>{}</h1>\
         <p class=\"lede\">{scans} of {}{start}</p><ul class=\"badges\">",
        escape(file),
        escape(&info.source)
    )?;
    let mut badge = |is_good: bool, good: &str, bad: &str| {
        let (class, text) = if is_good {
            ("good", good)
        } else {
            ("bad", bad)
        };
        write!(out, "<li class=\"{class}\">{text}</li>")
    };
    badge(info.complete, "complete", "incomplete")?;
    match info.balanced {
        Some(is_balanced) => badge(is_balanced, "ledger balanced", "ledger not balanced")?,
        None => badge(false, "", "no ledger")?,
    }
    badge(
        info.calibrated,
        "calibrated: depths in metres",
        "not calibrated: depths up to one factor",
    )?;
    out.write_str("</ul></header>\n")
}

/// Links to the sections.
fn contents(out: &mut String, recording: &Recording, scans: &[u64]) -> fmt::Result {
    out.push_str("<nav aria-label=\"sections\"><a href=\"#recording\">Recording</a>");
    // Of very many the page itself is the list.
    for &scan in scans.iter().take(12) {
        let title = title(recording, scan);
        write!(out, "<a href=\"#scan-{scan}\">{}</a>", escape(title))?;
    }
    if map::is_there(recording) {
        out.push_str("<a href=\"#map\">Map</a>");
    }
    if accuracy::is_there(recording) {
        out.push_str("<a href=\"#accuracy\">Accuracy</a>");
    }
    out.write_str(
        "<a href=\"#run\">Run</a><a href=\"#ledger\">Ledger</a><a href=\"#settings\">Settings</a></nav>\n",
    )
}

/// What the recording is; the section is left open for its settings.
fn about(out: &mut String, recording: &Recording, info: &Info, shown: &[u64]) -> fmt::Result {
    out.push_str("<section id=\"recording\"><h2>Recording</h2>");
    let failures = info.failures();
    if !failures.is_empty() {
        out.push_str("<div class=\"alarm\" role=\"note\"><b>It is less than it should be:</b><ul>");
        for failure in &failures {
            write!(out, "<li>{}</li>", escape(failure))?;
        }
        out.push_str("</ul></div>");
    }
    out.push_str("<dl class=\"facts\">");
    let mut fact = |name: &str, value: String| {
        write!(out, "<div><dt>{name}</dt><dd>{}</dd></div>", escape(value))
    };
    fact("Source", info.source.clone())?;
    fact("Written by", format!("tricurve {}", info.version))?;
    fact("First scan", info.start_nanos.map_or("—".to_owned(), date))?;
    fact(
        "Duration",
        format!("{:.3} s of recorded time", info.duration_seconds),
    )?;
    let scans = &info.scans;
    let mut text = format!(
        "{} of {} whole",
        count(scans.whole as u64),
        count(scans.total as u64)
    );
    for (which, list) in [("partial", &scans.partial), ("missing", &scans.missing)] {
        if !list.is_empty() {
            write!(text, "; {which}: {}", some_of(list))?;
        }
    }
    fact("Scans", text)?;
    fact("Shown here", shown_scans(recording, shown))?;
    let size = info.parts.iter().map(|part| part.bytes).sum();
    let parts = counted(info.parts.len() as u64, "file", "files");
    fact("Size", format!("{} in {parts}", bytes(size)))?;
    let rig = &info.rig;
    let views: Vec<&str> = rig.views.iter().map(|view| view.name.as_str()).collect();
    fact(
        "Views",
        format!("{}; reference {}", views.join(", "), info.reference),
    )?;
    let channels: Vec<String> = rig.channels.iter().map(f32::to_string).collect();
    fact("Channels", format!("σ² = {} px²", channels.join(", ")))?;
    fact(
        "Largest image",
        format!("{} × {} px", rig.size.width, rig.size.height),
    )?;
    let camera = rig.calibration(rig.size);
    let assumed = if info.calibrated {
        ""
    } else {
        "; assumed, so that depths are right up to one factor"
    };
    fact(
        "Calibration",
        format!(
            "f {} px, c ({}, {}) px, baseline {}{assumed}",
            camera.focal_px,
            camera.cx,
            camera.cy,
            rig.shown_baseline(rig.size)
        ),
    )?;
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
    fact("Ledger", ledger)?;
    out.write_str("</dl>")
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

/// The scans that are plotted, and of how many each stands for one.
fn plotted(recording: &Recording) -> (Vec<u64>, usize) {
    let scans = recording.scans();
    let every = scans.len().div_ceil(MOST_PLOTTED).max(1);
    (scans.step_by(every).collect(), every)
}

/// One of a scan's numbers.
type Of = fn(&Statistics) -> f64;

/// How the run went, scan by scan.
fn run(out: &mut String, recording: &mut Recording) -> fmt::Result {
    out.push_str("<section id=\"run\"><h2>Run</h2>");
    let total = recording.scans().len();
    let (scans, every) = plotted(recording);
    let (mut statistics, mut unreadable) = (Vec::new(), 0u64);
    for scan in scans {
        let read = recording.scan_of(scan, |topic| topic == "statistics");
        let Ok(read) = read else {
            unreadable += 1;
            continue;
        };
        if let Some(message) = read.message("statistics") {
            match serde_json::from_slice::<Statistics>(message) {
                Ok(of_scan) => statistics.push((scan, of_scan)),
                Err(_) => unreadable += 1,
            }
        }
        recording.reuse(read);
    }
    if unreadable > 0 {
        let scans = counted(unreadable, "scan", "scans");
        missing(out, format!("The statistics of {scans} cannot be read"))?;
    }
    if statistics.is_empty() {
        missing(
            out,
            "The recording holds no statistics, so times and counts are not known",
        )?;
        return out.write_str("</section>\n");
    }
    if every > 1 {
        write!(
            out,
            "<p>Of {} scans every {every}th is plotted.</p>",
            count(total as u64)
        )?;
    }
    let numbers: Vec<u64> = statistics.iter().map(|(scan, _)| *scan).collect();
    let series = |name: &str, of: Of| Series {
        name: name.to_owned(),
        values: statistics.iter().map(|(_, of_scan)| of(of_scan)).collect(),
    };
    out.push_str("<h3>Times</h3><div class=\"grid three\">");
    let stages = [
        series("capture", |of| of.milliseconds.capture),
        series("filter", |of| of.milliseconds.filter),
        series("track", |of| of.milliseconds.track),
        series("hough", |of| of.milliseconds.hough),
        series("match", |of| of.milliseconds.r#match),
    ];
    // What took no time did not run. Rendering takes a hundred times as long as any stage and would flatten them all.
    let ran = |series: &&Series| series.values.iter().any(|value| *value > 0.0);
    if stages[..1].iter().any(|stage| ran(&stage)) {
        plot::lines(out, "capture", "ms", &numbers, &stages[..1])?;
    }
    let later: Vec<Series> = stages[1..].iter().filter(ran).cloned().collect();
    if !later.is_empty() {
        let names: Vec<&str> = later.iter().map(|stage| stage.name.as_str()).collect();
        plot::lines(out, &names.join(", "), "ms", &numbers, &later)?;
    }
    let computing = series("computing", |of| {
        let spent = of.milliseconds;
        spent.filter + spent.track + spent.hough + spent.r#match
    });
    plot::lines(out, "all of them together", "ms", &numbers, &[computing])?;
    out.push_str("</div><h3>Counts</h3><div class=\"grid three\">");
    let counts: [(&str, &str, Of); 6] = [
        ("zero-crossings", "", |of| of.edges as f64),
        ("curves", "", |of| of.curves as f64),
        ("matched curves", "", |of| of.matches as f64),
        ("points in space", "", |of| of.points as f64),
        ("pixels of known disparity", "%", |of| of.known * 100.0),
        ("recorded", "MB", |of| of.bytes as f64 / 1e6),
    ];
    for (name, unit, of) in counts {
        let counted = series(name, of);
        if ran(&&counted) {
            plot::lines(out, name, unit, &numbers, &[counted])?;
        }
    }
    out.write_str("</div></section>\n")
}

/// The order in which scans pass the nodes; those beside the pipe come last.
fn place_in_pipe(node: &str) -> usize {
    let place = Stage::ALL.iter().position(|stage| stage.name() == node);
    place.unwrap_or(Stage::ALL.len())
}

/// What every node received, published and dropped.
fn ledger(out: &mut String, info: &Info) -> fmt::Result {
    out.push_str("<section id=\"ledger\"><h2>Ledger</h2>");
    let Some(ledger) = &info.ledger else {
        missing(out, "There is no ledger: the run did not come to its end")?;
        return out.write_str("</section>\n");
    };
    let refused: u64 = ledger.refused.values().sum();
    write!(
        out,
        "<p>{} admitted, {} done, {} dropped at the door",
        counted(ledger.admitted, "scan", "scans"),
        count(ledger.done),
        count(refused)
    )?;
    for (cause, number) in &ledger.refused {
        write!(out, " ({}: {})", count(*number), escape(cause))?;
    }
    out.push_str(match info.balanced {
        Some(true) => ": balanced.</p>",
        _ => ": not balanced.</p>",
    });
    let mut nodes: Vec<_> = ledger.nodes.iter().collect();
    nodes.sort_by_key(|(node, _)| place_in_pipe(node));
    for (node, topics) in nodes {
        let is_short = |count: Option<u64>| count.is_some_and(|count| count != ledger.admitted);
        let accounts = topics.values();
        let faults = accounts
            .filter(|a| is_short(a.received) || is_short(a.published) || !a.dropped.is_empty())
            .count() as u64;
        let told = match faults {
            0 => String::new(),
            _ => format!(", {} not balanced", count(faults)),
        };
        let open = if faults > 0 { " open" } else { "" };
        write!(
            out,
            "<details{open}><summary>{} <span>{}{told}</span></summary><div class=\"wide\"><table><thead><tr><th>topic</th>\
             <th class=\"n\">received</th><th class=\"n\">published</th><th class=\"n\">twice</th><th>dropped</th>\
             <th>missing</th></tr></thead><tbody>",
            escape(node),
            counted(topics.len() as u64, "topic", "topics")
        )?;
        for (topic, account) in topics {
            let number = |value: Option<u64>| value.map_or("–".to_owned(), count);
            let dropped = account.dropped.iter();
            let dropped: Vec<String> = dropped
                .map(|(cause, number)| format!("{}: {cause}", count(*number)))
                .collect();
            let is_fault = is_short(account.received)
                || is_short(account.published)
                || !account.dropped.is_empty();
            let class = if is_fault { " class=\"fault\"" } else { "" };
            writeln!(
                out,
                "<tr{class}><td class=\"mono\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
                 <td>{}</td><td>{}</td></tr>",
                escape(topic),
                number(account.received),
                number(account.published),
                count(account.duplicates),
                escape(if dropped.is_empty() {
                    "–".to_owned()
                } else {
                    dropped.join("; ")
                }),
                escape(if account.missing.is_empty() {
                    "–".to_owned()
                } else {
                    some_of(&account.missing)
                }),
            )?;
        }
        out.push_str("</tbody></table></div></details>");
    }
    out.write_str("</section>\n")
}
