//! The thesis's figures, made of a recording: for every object its three photographs, and of every channel what the
//! filter, the tracker and the matcher made of them.
//!
//! The thesis numbers them B.1 to B.39: thirteen an object (tab, jack, screwdriver), four a channel after the photographs.
//! Each figure here is a strip of pictures side by side. What an object with more or fewer channels has is numbered on.

mod lettering;
mod sheet;

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use image::{ExtendedColorType, Rgb, RgbImage};
use messages::record::{Colours, Span};
use messages::{Curves, Edge, Edges, Image, Kind, MatchPoint, Matches, Owned, Size, Topic, Truth};

use crate::compact::compact;
use crate::export::pictures::{self, Picture, pixel};
use crate::export::{ExportError, whole};
use crate::{MOST_SCENES, Recording, Scan};

pub(crate) use sheet::contact_sheet;

/// What a figure shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    Original,
    ZeroCrossings,
    Orientation,
    Segments,
    Disparity,
}

impl Step {
    /// Those of a channel.
    const OF_A_CHANNEL: [Self; 4] = [
        Self::ZeroCrossings,
        Self::Orientation,
        Self::Segments,
        Self::Disparity,
    ];

    /// Its name in a file's name.
    const fn name(self) -> &'static str {
        match self {
            Self::Original => "original",
            Self::ZeroCrossings => "zero-crossings",
            Self::Orientation => "orientation",
            Self::Segments => "segments",
            Self::Disparity => "disparity",
        }
    }

    /// What its pictures are, from left to right.
    pub(crate) const fn caption(self) -> &'static str {
        match self {
            Self::Original => "the photographs, in the order of the camera's positions",
            Self::ZeroCrossings => "zero-crossings of ∇²G, in the same three views",
            Self::Orientation => {
                "gradients at the zero-crossings: above, the full circle in hues; below, the half circle of the thesis's \
                 listing as gray levels 1 to 255, in which opposite contrasts look alike"
            }
            Self::Segments => {
                "curve segments, each in a colour of its own, their centroids crossed"
            }
            Self::Disparity => {
                "disparities of the matched curves; the truth in the same places; the truth everywhere"
            }
        }
    }
}

/// A figure.
pub(crate) struct Figure {
    /// Its number after the B.
    pub(crate) number: usize,
    /// Which object it is of.
    pub(crate) object: String,
    /// σ² of its channel; the photographs have none.
    pub(crate) variance: Option<f32>,
    pub(crate) step: Step,
    /// The strip.
    pub(crate) picture: Picture,
}

impl Figure {
    /// What stands before its caption.
    pub(crate) fn title(&self) -> String {
        let Self { number, object, .. } = self;
        match self.variance {
            Some(variance) => format!("B.{number} {object}, σ² = {variance}"),
            None => format!("B.{number} {object}"),
        }
    }

    fn file_name(&self) -> String {
        let Self { number, object, .. } = self;
        let channel = self.variance.map_or(String::new(), |v| format!("-{v}"));
        let plain = |c: char| if c.is_alphanumeric() { c } else { '-' };
        let object: String = object.chars().map(plain).collect();
        format!("B.{number:02}-{object}{channel}-{}.png", self.step.name())
    }
}

/// The objects of a recording: the first whole scan of each scene, at most [four](MOST_SCENES), and its name.
pub fn objects(recording: &Recording) -> Vec<(u64, String)> {
    let names = &recording.metadata().scans;
    let name = |scan: u64| usize::try_from(scan).ok().and_then(|scan| names.get(scan));
    let mut objects: Vec<u64> = Vec::new();
    for scan in recording.whole_scans() {
        let is_new = objects.iter().all(|&known| name(known) != name(scan));
        if objects.len() < MOST_SCENES && is_new {
            objects.push(scan);
        }
    }
    let called = |scan| name(scan).map_or_else(|| format!("scan {scan}"), Clone::clone);
    objects
        .into_iter()
        .map(|scan| (scan, called(scan)))
        .collect()
}

/// How many figures an object has.
pub(crate) fn per_object(recording: &Recording) -> usize {
    1 + Step::OF_A_CHANNEL.len() * recording.metadata().rig.channels.len()
}

/// The figures of an object, the first of which has this number.
///
/// # Errors
/// When something of it was not recorded or is damaged.
pub(crate) fn figures(
    recording: &mut Recording,
    (scan, object): &(u64, String),
    first: usize,
) -> Result<Vec<Figure>, ExportError> {
    let read = recording.scan(*scan)?;
    let codec = recording.codec();
    let rig = codec.rig();
    let mut figures = Vec::new();
    let mut add = |variance, step, picture| {
        figures.push(Figure {
            number: first + figures.len(),
            object: object.clone(),
            variance,
            step,
            picture,
        });
    };
    let images = Topic::of(rig, Kind::Image).into_iter();
    let images = images.map(|topic| read.decode::<Image>(codec, &topic));
    let images: Vec<Owned<Image>> = images.collect::<Result<_, _>>()?;
    let Some(size) = images.first().map(|image| image.header.size()) else {
        return Ok(Vec::new());
    };
    let photographs: Vec<Picture> = images
        .iter()
        .map(|image| Picture::gray(image.header.size(), image.view().pixels.to_vec()))
        .collect();
    add(None, Step::Original, strip(&photographs));
    let truth = truth(&read, recording);
    let matches = Topic::of(rig, Kind::Matches).into_iter();
    let matches = matches.map(|topic| read.decode::<Matches>(codec, &topic));
    let matches: Vec<Owned<Matches>> = matches.collect::<Result<_, _>>()?;
    // One range of colours an object, so that its channels compare.
    let span = match &truth {
        Some(truth) => Span::of(truth.iter().copied()),
        None => {
            let points = matches.iter().flat_map(|matches| matches.view().points);
            Span::of(points.map(|point| point.disparity))
        }
    };
    let of_channel = |kind, channel: usize| {
        let topics = Topic::of(rig, kind).into_iter();
        topics.filter(move |topic| topic.channel == channel as u32)
    };
    for ((channel, &variance), matches) in rig.channels.iter().enumerate().zip(&matches) {
        let edges = of_channel(Kind::Edges, channel);
        let edges = edges.map(|topic| read.decode::<Edges>(codec, &topic));
        let edges: Vec<Owned<Edges>> = edges.collect::<Result<_, _>>()?;
        let curves = of_channel(Kind::Curves, channel);
        let curves = curves.map(|topic| read.decode::<Curves>(codec, &topic));
        let curves: Vec<Owned<Curves>> = curves.collect::<Result<_, _>>()?;
        for step in Step::OF_A_CHANNEL {
            let of_edges = |draw: fn(Size, &[Edge]) -> Picture| -> Vec<Picture> {
                let draw = |edges: &Owned<Edges>| draw(size, edges.view().edges);
                edges.iter().map(draw).collect()
            };
            let picture = match step {
                Step::Original => continue,
                Step::ZeroCrossings => strip(&of_edges(pictures::zero_crossings)),
                Step::Orientation => below(
                    &strip(&of_edges(full_circle)),
                    &strip(&of_edges(half_circle)),
                ),
                Step::Segments => {
                    let draw = |curves: &Owned<Curves>| pictures::segments(size, curves.view());
                    strip(&curves.iter().map(draw).collect::<Vec<_>>())
                }
                Step::Disparity => strip(&disparities(
                    size,
                    matches.view().points,
                    truth.as_deref(),
                    span,
                )),
            };
            add(Some(variance), step, picture);
        }
    }
    recording.reuse(read);
    Ok(figures)
}

/// The truth of the reference view, where the source knew it.
fn truth(scan: &Scan, recording: &Recording) -> Option<Vec<f32>> {
    let codec = recording.codec();
    let topic = Topic::of(codec.rig(), Kind::Truth).pop()?;
    let truth: Owned<Truth> = scan.decode(codec, &topic).ok()?;
    Some(truth.view().disparity.to_vec())
}

/// The full circle of orientations in hues, on black.
fn full_circle(size: Size, edges: &[Edge]) -> Picture {
    let circle = Colours::circle();
    dots(size, edges, |orientation| {
        circle.of((orientation / std::f32::consts::TAU).rem_euclid(1.0))
    })
}

/// The half circle of the thesis's listing as gray levels 1 to 255, on black.
fn half_circle(size: Size, edges: &[Edge]) -> Picture {
    dots(size, edges, |orientation| {
        let turn = (orientation / std::f32::consts::PI).rem_euclid(1.0);
        [1 + (254.0 * turn) as u8; 3]
    })
}

/// A dot at each zero-crossing in the colour of its orientation.
fn dots(size: Size, edges: &[Edge], colour: impl Fn(f32) -> [u8; 3]) -> Picture {
    let mut picture = RgbImage::new(size.width, size.height);
    for edge in edges {
        if let Some((x, y)) = pixel(size, edge.x, edge.y) {
            picture.put_pixel(x, y, Rgb(colour(edge.orientation)));
        }
    }
    Picture::rgb(size, picture.into_raw())
}

/// What was found, the truth where it was found, and the truth.
fn disparities(
    size: Size,
    points: &[MatchPoint],
    truth: Option<&[f32]>,
    span: Option<Span>,
) -> Vec<Picture> {
    let colours = Colours::new();
    let paint = |disparity: f32| match span {
        Some(span) if disparity.is_finite() => colours.of(span.share(disparity)),
        _ => Colours::UNKNOWN,
    };
    let draw = |of: &dyn Fn(u32, u32, f32) -> f32| {
        let mut picture = RgbImage::from_pixel(size.width, size.height, Rgb(Colours::UNKNOWN));
        for point in points {
            if let Some((x, y)) = pixel(size, point.x, point.y) {
                picture.put_pixel(x, y, Rgb(paint(of(x, y, point.disparity))));
            }
        }
        Picture::rgb(size, picture.into_raw())
    };
    let mut drawn = vec![draw(&|_, _, found| found)];
    if let Some(truth) = truth {
        let known = |x: u32, y: u32| {
            let at = y as usize * size.width as usize + x as usize;
            truth.get(at).copied().unwrap_or(f32::NAN)
        };
        drawn.push(draw(&|x, y, found| nearest(size, &known, x, y, found)));
        let whole = RgbImage::from_fn(size.width, size.height, |x, y| Rgb(paint(known(x, y))));
        drawn.push(Picture::rgb(size, whole.into_raw()));
    }
    drawn
}

/// Columns beside a point among whose truths it has its choice: a contour lies between two surfaces.
const BESIDE: u32 = 2;

/// Of the true disparities beside a place the one nearest to what was found.
fn nearest(size: Size, known: &dyn Fn(u32, u32) -> f32, x: u32, y: u32, found: f32) -> f32 {
    let columns = x.saturating_sub(BESIDE)..(x + BESIDE + 1).min(size.width);
    columns
        .map(|x| known(x, y))
        .filter(|truth| truth.is_finite())
        .min_by(|a, b| (a - found).abs().total_cmp(&(b - found).abs()))
        .unwrap_or(f32::NAN)
}

/// Pixels between the pictures of a strip, and their colour.
const GAP: u32 = 8;
const BETWEEN: [u8; 3] = [128; 3];

/// Pictures side by side.
fn strip(pictures: &[Picture]) -> Picture {
    let width: u32 = pictures
        .iter()
        .map(|picture| picture.size.width + GAP)
        .sum();
    let height = pictures.iter().map(|picture| picture.size.height).max();
    let size = Size::new(width.saturating_sub(GAP), height.unwrap_or(0));
    let mut whole = RgbImage::from_pixel(size.width, size.height, Rgb(BETWEEN));
    let mut left = 0;
    for picture in pictures {
        put(&mut whole, picture, left, 0);
        left += picture.size.width + GAP;
    }
    Picture::rgb(size, whole.into_raw())
}

/// One strip below another.
fn below(above: &Picture, below: &Picture) -> Picture {
    let size = Size::new(
        above.size.width.max(below.size.width),
        above.size.height + GAP + below.size.height,
    );
    let mut whole = RgbImage::from_pixel(size.width, size.height, Rgb(BETWEEN));
    put(&mut whole, above, 0, 0);
    put(&mut whole, below, 0, above.size.height + GAP);
    Picture::rgb(size, whole.into_raw())
}

fn put(whole: &mut RgbImage, picture: &Picture, left: u32, top: u32) {
    for y in 0..picture.size.height {
        for x in 0..picture.size.width {
            whole.put_pixel(left + x, top + y, Rgb(colour_at(picture, x, y)));
        }
    }
}

/// The colour of a picture's pixel.
fn colour_at(picture: &Picture, x: u32, y: u32) -> [u8; 3] {
    let at = y as usize * picture.size.width as usize + x as usize;
    match picture.colours {
        ExtendedColorType::Rgb8 => {
            let (pixels, _) = picture.bytes.as_chunks::<3>();
            pixels.get(at).copied().unwrap_or_default()
        }
        _ => [picture.bytes.get(at).copied().unwrap_or(0); 3],
    }
}

/// Writes every figure of a recording and a contact sheet of them all into a folder, and gives their paths.
pub(crate) fn export(
    recording: &mut Recording,
    folder: &Path,
) -> Result<Vec<PathBuf>, ExportError> {
    let objects = objects(recording);
    if objects.is_empty() {
        return Err(ExportError::NoScan);
    }
    fs::create_dir_all(folder).map_err(|source| ExportError::Io {
        path: folder.to_owned(),
        source,
    })?;
    let mut written = Vec::new();
    let mut small = Vec::new();
    for (at, object) in objects.iter().enumerate() {
        let figures = figures(recording, object, 1 + at * per_object(recording))?;
        for figure in &figures {
            let path = folder.join(figure.file_name());
            save(&path, &figure.picture)?;
            written.push(path);
        }
        small.push(figures.iter().map(sheet::Small::of).collect());
    }
    let path = folder.join("contact-sheet.png");
    save(&path, &contact_sheet(&small))?;
    written.push(path);
    Ok(written)
}

fn save(path: &Path, picture: &Picture) -> Result<(), ExportError> {
    let io = |source| ExportError::Io {
        path: path.to_owned(),
        source,
    };
    let png = compact(picture).map_err(|error| io(error.into()))?;
    whole(path, |file| file.write_all(&png).map_err(io))
}
