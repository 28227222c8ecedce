//! A recording's results in the formats of other trades: CSV, PFM, PLY, PNG.

pub(crate) mod pictures;

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use messages::{Disparity, Image, Kind, Owned, Points, Size, Topic};
use thiserror::Error;

use messages::record::{Colours, Span};
use messages::recording::Part;

use crate::map::whole_map;
use crate::{ReadError, Recording};

/// Why an export failed. What it was about to write is not there.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A picture cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: image::ImageError,
    },
    /// One file is to hold one scan, and there are several.
    #[error("{what} holds one scan, and the recording has {held}; choose one with --scan")]
    WhichScan {
        /// The format.
        what: &'static str,
        /// The scans there are.
        held: String,
    },
    /// The file is one of the recording's own.
    #[error("{} is part of the recording that is exported; choose another name", .0.display())]
    OntoItself(PathBuf),
    /// There is no scan at all.
    #[error("the recording holds no whole scan")]
    NoScan,
    /// There is no map.
    #[error(
        "the recording holds no map: that is made of one camera that moves, with --set capture.mode=rail"
    )]
    NoMap,
}

/// What is to be exported.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Export {
    /// The scan; without it all, where the format has room for them.
    pub scan: Option<u64>,
    /// Points, a line each.
    pub csv: Option<PathBuf>,
    /// The disparity picture of one scan.
    pub pfm: Option<PathBuf>,
    /// The points of one scan in metres.
    pub ply: Option<PathBuf>,
    /// The map of all scans, in metres, in the frame of the rail.
    pub map: Option<PathBuf>,
    /// The pictures of every view and channel.
    pub png: Option<PathBuf>,
    /// The thesis's figures.
    pub thesis: Option<PathBuf>,
}

/// A file that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// Where.
    pub path: PathBuf,
    /// How many points it holds, where it is of points.
    pub points: Option<usize>,
}

/// Exports, and gives the files written.
///
/// # Errors
/// When the recording cannot be read or a file not written; a file is there whole or not at all.
pub fn export(recording: &mut Recording, wanted: &Export) -> Result<Vec<Exported>, ExportError> {
    let scans = match wanted.scan {
        // That it is not there shows when it is read.
        Some(scan) => vec![scan],
        None => recording.whole_scans(),
    };
    if scans.is_empty() {
        return Err(ExportError::NoScan);
    }
    let only = |what, recording: &Recording| match scans.as_slice() {
        [scan] => Ok(*scan),
        _ => Err(ExportError::WhichScan {
            what,
            held: recording.held(),
        }),
    };
    for (what, path) in [("a PFM file", &wanted.pfm), ("a PLY file", &wanted.ply)] {
        if path.is_some() {
            only(what, recording)?;
        }
    }
    let files = [&wanted.csv, &wanted.pfm, &wanted.ply, &wanted.map];
    for path in files.into_iter().flatten() {
        not_onto_itself(recording, path)?;
    }
    let mut written = Vec::new();
    let file = |path: &Path, points| Exported {
        path: path.to_owned(),
        points,
    };
    if let Some(path) = &wanted.csv {
        let points = csv(recording, &scans, path)?;
        written.push(file(path, Some(points)));
    }
    if let Some(path) = &wanted.pfm {
        pfm(recording, only("a PFM file", recording)?, path)?;
        written.push(file(path, None));
    }
    if let Some(path) = &wanted.ply {
        let points = ply(recording, only("a PLY file", recording)?, path)?;
        written.push(file(path, Some(points)));
    }
    if let Some(path) = &wanted.map {
        let points = map_ply(recording, path)?;
        written.push(file(path, Some(points)));
    }
    if let Some(folder) = &wanted.png {
        for scan in &scans {
            let pictures = pictures::pictures(recording, *scan, folder)?;
            written.extend(pictures.iter().map(|path| file(path, None)));
        }
    }
    if let Some(folder) = &wanted.thesis {
        let figures = crate::thesis::export(recording, folder)?;
        written.extend(figures.iter().map(|path| file(path, None)));
    }
    Ok(written)
}

/// The first line of the CSV.
pub const CSV_HEADER: &str = "scan,view,channel,curve,x,y,disparity,score,depth";

/// Writes the points of these scans, a line each: x and y are pixels of the reference view, the channel is its σ².
fn csv(recording: &mut Recording, scans: &[u64], path: &Path) -> Result<usize, ExportError> {
    let topic = topic(recording, Kind::Points);
    let rig = recording.metadata().rig.clone();
    let view = &rig.views[recording.codec().reference()].name;
    let mut count = 0;
    whole(path, |file| {
        let mut out = BufWriter::new(file);
        let io = |source| ExportError::Io {
            path: path.to_owned(),
            source,
        };
        writeln!(out, "{CSV_HEADER}").map_err(io)?;
        for &scan in scans {
            let points: Owned<Points> = recording.read(scan, &topic)?;
            count += points.view().points.len();
            for p in points.view().points {
                let channel = rig
                    .channels
                    .get(p.channel as usize)
                    .copied()
                    .unwrap_or(f32::NAN);
                let (curve, u, v, d, score, z) = (p.curve, p.u, p.v, p.disparity, p.score, p.z);
                writeln!(
                    out,
                    "{scan},{view},{channel},{curve},{u},{v},{d},{score},{z}"
                )
                .map_err(io)?;
            }
        }
        out.flush().map_err(io)
    })?;
    Ok(count)
}

/// Writes a disparity picture as Middlebury does: little endian, rows from the bottom, infinity where unknown.
fn pfm(recording: &mut Recording, scan: u64, path: &Path) -> Result<(), ExportError> {
    let topic = topic(recording, Kind::Disparity);
    let picture: Owned<Disparity> = recording.read(scan, &topic)?;
    let Size { width, height } = picture.header.size();
    let mut bytes = format!("Pf\n{width} {height}\n-1\n").into_bytes();
    for row in picture
        .view()
        .disparity
        .chunks_exact((width as usize).max(1))
        .rev()
    {
        let value = |d: &f32| if d.is_finite() { *d } else { f32::INFINITY };
        bytes.extend(row.iter().flat_map(|d| value(d).to_le_bytes()));
    }
    whole(path, |file| {
        file.write_all(&bytes).map_err(|source| ExportError::Io {
            path: path.to_owned(),
            source,
        })
    })
}

/// Writes the points in metres in the reference camera's optical frame, with the gray level of the reference view.
fn ply(recording: &mut Recording, scan: u64, path: &Path) -> Result<usize, ExportError> {
    let points = topic(recording, Kind::Points);
    let reference = recording.codec().reference();
    let images = Topic::of(&recording.metadata().rig, Kind::Image);
    let codec = recording.codec().clone();
    let is_wanted = |name: &str| {
        let mut topics = [&points, &images[reference]].into_iter();
        topics.any(|topic| topic.name == name || codec.refers(topic, name))
    };
    let read = recording.scan_of(scan, is_wanted)?;
    // Of results alone there is no image: their points are white.
    let image: Option<Owned<Image>> = match recording.holds(&images[reference].name) {
        true => Some(read.decode(recording.codec(), &images[reference])?),
        false => None,
    };
    let points: Owned<Points> = read.decode(recording.codec(), &points)?;

    let rig = &recording.metadata().rig;
    let size = points.header.size();
    let camera = rig.calibration(size);
    let units = match camera.calibrated {
        true => "calibrated: metres",
        false => {
            "not calibrated: depths are right up to one factor, shapes only with the right focal length"
        }
    };
    let count = points.view().points.len();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\n\
         comment tricurve {}, scan {scan}\n\
         comment {units}; f {} px, c ({}, {}), b {} m\n\
         comment optical frame of view {}: x right, y down, z forward\n\
         element vertex {count}\n\
         property float x\nproperty float y\nproperty float z\n\
         property float disparity\nproperty float score\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         end_header\n",
        recording.metadata().version,
        camera.focal_px,
        camera.cx,
        camera.cy,
        camera.baseline_m,
        rig.views[reference].name,
    )
    .into_bytes();
    for p in points.view().points {
        let gray = |image: &Owned<Image>| pictures::gray_at(image.view().pixels, size, p.u, p.v);
        let gray = image.as_ref().map_or(u8::MAX, gray);
        bytes.extend(
            [p.x, p.y, p.z, p.disparity, p.score]
                .into_iter()
                .flat_map(f32::to_le_bytes),
        );
        bytes.extend([gray; 3]);
    }
    whole(path, |file| {
        file.write_all(&bytes).map_err(|source| ExportError::Io {
            path: path.to_owned(),
            source,
        })
    })?;
    Ok(count)
}

/// Writes the points of the map in metres in the frame of the rail, coloured by their disparity.
fn map_ply(recording: &mut Recording, path: &Path) -> Result<usize, ExportError> {
    let points = whole_map(recording)?.ok_or(ExportError::NoMap)?;
    let calibrated = recording
        .metadata()
        .rig
        .calibration
        .is_some_and(|c| c.calibrated);
    let units = match calibrated {
        true => "calibrated: metres",
        false => {
            "not calibrated: depths are right up to one factor, shapes only with the right focal length"
        }
    };
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\n\
         comment tricurve {}, map\n\
         comment {units}\n\
         comment frame of the rail: x right along it, y down, z forward\n\
         element vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         property float sigma\nproperty uint sightings\nproperty float score\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         end_header\n",
        recording.metadata().version,
        points.len(),
    )
    .into_bytes();
    let span = Span::of(points.iter().map(|point| point.disparity)).map(Span::rounded);
    let colours = Colours::default();
    for p in &points {
        bytes.extend(
            [p.x, p.y, p.z, p.sigma]
                .into_iter()
                .flat_map(f32::to_le_bytes),
        );
        bytes.extend(p.sightings.to_le_bytes());
        bytes.extend(p.score.to_le_bytes());
        bytes.extend(colours.of(span.map_or(0.0, |span| span.share(p.disparity))));
    }
    whole(path, |file| {
        file.write_all(&bytes).map_err(|source| ExportError::Io {
            path: path.to_owned(),
            source,
        })
    })?;
    Ok(points.len())
}

/// The one topic of a kind that has one.
fn topic(recording: &Recording, kind: Kind) -> Topic {
    Topic::of(&recording.metadata().rig, kind).swap_remove(0)
}

/// Refuses a file that is part of the recording.
pub(crate) fn not_onto_itself(recording: &Recording, path: &Path) -> Result<(), ExportError> {
    let is_it = |part: &Part| is_same_file(&part.path, path);
    match recording.parts.iter().any(is_it) {
        true => Err(ExportError::OntoItself(path.to_owned())),
        false => Ok(()),
    }
}

fn is_same_file(one: &Path, other: &Path) -> bool {
    let real = |path: &Path| fs::canonicalize(path).ok();
    real(one).is_some_and(|one| real(other) == Some(one))
}

/// Writes a file beside its place and moves it there: it is whole, or it is not there. What is no plain file, such as a
/// pipe, is written to as it is; `-` is standard output.
///
/// # Errors
/// What `write` says, or the system of the file.
pub fn whole(
    path: &Path,
    write: impl FnOnce(&mut File) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    if path == Path::new("-") {
        return whole(Path::new("/dev/stdout"), write);
    }
    // A link is followed, not replaced.
    let real = fs::canonicalize(path);
    let path = real.as_deref().unwrap_or(path);
    if fs::metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir()) {
        let opened = fs::OpenOptions::new().write(true).open(path);
        return write(&mut opened.map_err(|source| ExportError::Io {
            path: path.to_owned(),
            source,
        })?);
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!(".{name}.{}.part", std::process::id()));
    let io = |source| ExportError::Io {
        path: path.to_owned(),
        source,
    };
    let mut file = File::create(&beside).map_err(io)?;
    let written = write(&mut file)
        .and_then(|()| file.sync_all().map_err(io))
        .and_then(|()| fs::rename(&beside, path).map_err(io));
    if written.is_err() {
        // What stays behind if even that fails is named after what it is.
        drop(fs::remove_file(&beside));
    }
    written
}
