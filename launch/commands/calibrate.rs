//! `tricurve calibrate`: what cameras are like and where they stand, from images of a board.

use std::fmt::Write as _;
use std::io::{IsTerminal as _, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use capture::SourceError;
use capture::calibrate::{
    Beside, Board, Calibrated, Found, LeftOut, Observed, Reader, Shots, Sure, calibrate,
};
use capture::{Layout, Piece};
use indicatif::{ProgressBar, ProgressStyle};
use messages::words::counted;
use serde_json::{Value, json};

use crate::cli::Calibrate as Args;
use crate::{Failure, Outcome};

/// Pixels that corners miss by, from which on the other kind of lens is tried too.
const DOUBTFUL_PX: f64 = 0.2;
/// The part of that which the other kind must leave to be told.
const BETTER: f64 = 0.7;

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    if !args.folder.is_dir() {
        return Err(Failure::usage(format!(
            "there is no folder {}: give the one that holds the images of the board",
            args.folder.display()
        )));
    }
    let board = match (args.marker, &args.dictionary) {
        (Some(marker), Some(dictionary)) => {
            Board::charuco(args.board, args.square, marker, dictionary)
        }
        _ => Board::chessboard(args.board, args.square),
    };
    let board = board.map_err(Failure::usage)?;
    check_outputs(args)?;
    let shots = Shots::open(&args.folder, args.layout).map_err(failure)?;
    tell(&shots, &board, args);
    let observed = observe(&board, &shots, args.json);
    let mut calibrated = calibrate(&board, args.model.into(), &observed)
        .map_err(|why| Failure::failed(format!("{}: {why}", args.folder.display())))?;
    compare(&board, &observed, &mut calibrated);
    let remarks = [
        format!(
            "tricurve {}: {} of {}",
            env!("CARGO_PKG_VERSION"),
            summary(&shots),
            board.describe()
        ),
        format!("corners miss by {:.3} px (rms)", calibrated.rms_px()),
    ];
    let written = write(&args.output, &calibrated.to_kalibr(&remarks));
    let picture = args.picture.as_ref();
    let drawn = picture.map(|path| write(path, &calibrated.to_svg()));
    match args.json {
        true => super::print_json(&to_json(&calibrated, &shots, args))?,
        // Nothing else where the file itself goes.
        false if args.output == Path::new("-") => {
            crate::say!("{}", text(&calibrated, args).trim_end())
        }
        false => super::print(&text(&calibrated, args))?,
    }
    // What was found out is told even where it could not be written.
    written?;
    drawn.transpose()?;
    Ok(Outcome::Done)
}

/// Whether the files can be written, before anything is worked out.
fn check_outputs(args: &Args) -> Result<(), Failure> {
    if args.json && args.output == Path::new("-") {
        return Err(Failure::usage(
            "the cameras and the JSON cannot both go to standard output: give --output a file",
        ));
    }
    if args.picture.as_ref() == Some(&args.output) {
        return Err(Failure::usage(
            "--output and --picture name one file, and each needs its own",
        ));
    }
    let mut wanted = std::iter::once(&args.output).chain(&args.picture);
    wanted.try_for_each(|path| check_output(path, args.force))
}

/// Whether a file can be written.
pub(super) fn check_output(path: &Path, force: bool) -> Result<(), Failure> {
    let parent = path.parent().filter(|parent| *parent != Path::new(""));
    let why = match () {
        () if path == Path::new("-") => return Ok(()),
        () if path.is_dir() => "cannot be written: it is a folder",
        () if parent.is_some_and(|parent| !parent.is_dir()) => {
            "cannot be written: its folder is not there"
        }
        () if path.exists() && !force => "exists; give another name, or --force to replace it",
        () => return Ok(()),
    };
    Err(Failure::usage(format!("{} {why}", path.display())))
}

/// Says how the images were understood.
fn tell(shots: &Shots, board: &Board, args: &Args) {
    if !args.json {
        crate::say!("{}; board: {}", summary(shots), board.describe());
    }
    if shots.ignored > 0 {
        crate::say!(
            "tricurve: {} that {} elsewhere in {} {} ignored",
            counted(shots.ignored, "image"),
            if shots.ignored == 1 { "lies" } else { "lie" },
            args.folder.display(),
            if shots.ignored == 1 { "is" } else { "are" }
        );
    }
    for left_out in &shots.left_out {
        crate::say!("tricurve: {left_out}");
    }
    if shots.is_by_order {
        crate::say!(
            "tricurve: no two images have a number or name in common: they are put together by their order"
        );
    }
}

fn failure(error: SourceError) -> Failure {
    match error {
        SourceError::SizeDiffers {
            path,
            size,
            first,
            expected,
        } => Failure::failed(format!(
            "{} has {size} pixels and {} {expected}: the images of one camera must be of one size",
            path.display(),
            first.display()
        )),
        error if error.is_wrong_use() => Failure::usage(error),
        error => Failure::failed(error),
    }
}

pub(super) fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let written = record::whole(path, |file| {
        file.write_all(text.as_bytes())
            .map_err(|source| record::ExportError::Io {
                path: path.to_owned(),
                source,
            })
    });
    written.map_err(Failure::failed)
}

fn summary(shots: &Shots) -> String {
    let images = match shots.count() {
        1 => "1 image".to_owned(),
        count => format!("{count} images"),
    };
    let how = match shots.layout {
        Layout::Flat => ", by name".to_owned(),
        layout => format!(", {}", layout.describe()),
    };
    match shots.cameras.as_slice() {
        [_] => format!("1 camera, {images}"),
        cameras => format!(
            "{} cameras{how} ({}), {images} at {}",
            cameras.len(),
            cameras.join(", "),
            counted(shots.shots.len(), "time")
        ),
    }
}

/// Looks for the board in every image, on all cores.
fn observe<'a>(board: &Board, shots: &'a Shots, is_quiet: bool) -> Observed<'a> {
    let style = ProgressStyle::with_template("{bar:32} {pos}/{len} images  {elapsed}");
    let on_terminal = std::io::stderr().is_terminal() && !is_quiet;
    let bar = on_terminal.then(|| {
        ProgressBar::new(shots.count() as u64)
            .with_style(style.unwrap_or(ProgressStyle::default_bar()))
    });
    let images = shots.shots.iter().flat_map(|shot| &shot.images).flatten();
    let images: Vec<&Piece> = images.collect();
    let files: Vec<&Path> = images.iter().map(|piece| piece.path.as_path()).collect();
    let reader = Reader::new(&files);
    let next = AtomicUsize::new(0);
    let look = || {
        let mut found = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(&piece) = images.get(index) else {
                return found;
            };
            // One that cannot be read is told with those on which no board is found.
            let sighting = match reader.read(piece) {
                Ok((size, pixels)) => board.find(size, &pixels),
                Err(error) => Err(error.to_string()),
            };
            if let Some(bar) = &bar {
                bar.inc(1);
            }
            found.push((index, sighting));
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut found = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(look)).collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined
            .flat_map(|found| found.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect::<Vec<_>>()
    });
    if let Some(bar) = &bar {
        bar.finish_and_clear();
    }
    found.sort_by_key(|(index, _)| *index);
    let mut found = found.into_iter().map(|(_, sighting)| sighting);
    let mut by_shot = Vec::with_capacity(shots.shots.len());
    for shot in &shots.shots {
        let mut of_shot = Vec::with_capacity(shot.images.len());
        for image in &shot.images {
            of_shot.push(image.as_ref().and_then(|_| found.next()));
        }
        by_shot.push(of_shot);
    }
    Observed {
        shots,
        found: by_shot,
    }
}

/// Says whether the other kind of lens explains what was seen better.
fn compare(board: &Board, observed: &Observed<'_>, calibrated: &mut Calibrated) {
    let own = calibrated.rms_px();
    if own < DOUBTFUL_PX {
        return;
    }
    let other = calibrated.model.other();
    let Ok(tried) = calibrate(board, other, observed) else {
        return;
    };
    // Not by leaving out what it does not explain.
    if tried.rms_px() < BETTER * own && tried.corners() >= calibrated.corners() {
        calibrated.warnings.push(format!(
            "with --model {} corners would miss by {:.2} px instead of {own:.2}",
            other.name(),
            tried.rms_px()
        ));
    }
}

fn text(calibrated: &Calibrated, args: &Args) -> String {
    let mut text = String::new();
    let mut line = |line: String| writeln!(text, "{line}").unwrap_or_default();
    let pair = |[first, second]: &[Sure; 2], digits: usize| {
        format!(
            "{:.1}±{:.digits$}, {:.1}±{:.digits$}",
            first.value, first.std, second.value, second.std
        )
    };
    line(format!(
        "{:<14}{:>9}{:>12}{:>9}{:>9}  {:<28}{:<28}{:>8}",
        "camera",
        "images",
        "corners",
        "rms px",
        "p95 px",
        "focal length px",
        "principal point px",
        "covered"
    ));
    for camera in &calibrated.cameras {
        let images = format!("{}/{}", camera.used[0], camera.used[1]);
        let corners = format!("{}/{}", camera.corners[0], camera.corners[1]);
        line(format!(
            "{:<14}{images:>9}{corners:>12}{:>9.3}{:>9.3}  {:<28}{:<28}{:>6.0} %",
            camera.name,
            camera.rms_px,
            camera.p95_px,
            pair(&camera.focal, 2),
            pair(&camera.centre, 2),
            camera.covered() * 100.0
        ));
    }
    if !calibrated.beside.is_empty() {
        line(format!(
            "\n{:<26}{:>9}{:>12}{:>12}{:>16}{:>16}",
            "beside each other", "times", "apart mm", "turned", "rows median px", "rows p95 px"
        ));
    }
    for beside in &calibrated.beside {
        let rows = beside.rows_px.map(|rows| rows.map(|px| format!("{px:.3}")));
        let [median, p95] = rows.unwrap_or_else(|| ["–", "–"].map(str::to_owned));
        line(format!(
            "{:<26}{:>9}{:>12.2}{:>11.2}°{median:>16}{p95:>16}",
            beside.between.join(", "),
            beside.together,
            beside.apart_m * 1e3,
            beside.turned_degrees
        ));
    }
    if !calibrated.left_out.is_empty() {
        line("\nnot used:".to_owned());
    }
    for LeftOut {
        camera, shot, why, ..
    } in &calibrated.left_out
    {
        line(match calibrated.cameras.len() {
            1 => format!("  {shot}: {why}"),
            _ => format!("  {shot}, {camera}: {why}"),
        });
    }
    for notice in &calibrated.notices {
        line(format!("\n{notice}"));
    }
    for warning in &calibrated.warnings {
        line(format!("warning: {warning}"));
    }
    let file = args.output.display();
    let how = match calibrated.cameras.len() {
        // What cannot be rectified cannot be run.
        _ if calibrated.notices.is_empty() => None,
        1 => Some(" --set capture.mode=rail"),
        3 => Some(""),
        _ => Some(" --views all"),
    };
    line(match how {
        _ if args.output == Path::new("-") => String::new(),
        Some(how) => {
            format!("\n{file}: tricurve run --source FOLDER --set capture.calibration={file}{how}")
        }
        None => format!("\n{file}: written, but not for tricurve run: see the warnings"),
    });
    if let Some(picture) = &args.picture {
        line(format!(
            "{}: every corner and by how much it misses",
            picture.display()
        ));
    }
    text
}

fn to_json(calibrated: &Calibrated, shots: &Shots, args: &Args) -> Value {
    let sure = |all: &[Sure]| {
        let values: Vec<f64> = all.iter().map(|sure| sure.value).collect();
        let stds: Vec<f64> = all.iter().map(|sure| sure.std).collect();
        json!({ "values": values, "std": stds })
    };
    let camera = |found: &Found| {
        json!({
            "name": found.name,
            "size": [found.size.width, found.size.height],
            "images_used": found.used[0],
            "images": found.used[1],
            "corners_used": found.corners[0],
            "corners": found.corners[1],
            "focal_px": sure(&found.focal),
            "centre_px": sure(&found.centre),
            "distortion": sure(&found.lens),
            "rms_px": found.rms_px,
            "median_px": found.median_px,
            "p95_px": found.p95_px,
            "covered": found.covered(),
        })
    };
    let beside = |beside: &Beside| {
        json!({
            "between": beside.between,
            "times": beside.together,
            "apart_m": beside.apart_m,
            "turned_degrees": beside.turned_degrees,
            "rows_median_px": beside.rows_px.map(|rows| rows[0]),
            "rows_p95_px": beside.rows_px.map(|rows| rows[1]),
        })
    };
    let left_out =
        |out: &LeftOut| json!({ "camera": out.camera, "shot": out.shot, "why": out.why });
    json!({
        "file": args.output.display().to_string(),
        "times": shots.shots.len(),
        "model": calibrated.model.name(),
        "rms_px": calibrated.rms_px(),
        "cameras": calibrated.cameras.iter().map(camera).collect::<Vec<_>>(),
        "beside": calibrated.beside.iter().map(beside).collect::<Vec<_>>(),
        "left_out": calibrated.left_out.iter().map(left_out).collect::<Vec<_>>(),
        "notices": calibrated.notices,
        "warnings": calibrated.warnings,
    })
}
