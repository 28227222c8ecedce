//! The thesis's pictures of every view and channel: zero-crossings, orientation, curves, disparity.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{ExtendedColorType, GrayImage, ImageFormat, Rgb, RgbImage};
use messages::record::{Colours, Span, paint};
use messages::{
    Curves, CurvesView, Edge, Edges, Image, Kind, MatchPoint, Matches, Owned, Size, Topic,
};

use super::{ExportError, whole};
use crate::{Recording, Scan};

/// Writes the pictures of a scan, and gives their paths: `000003-0-left-0-original.png`, and for every channel
/// `000003-0-left-1-30-1-zero-crossings.png` and its like, so that they sort by scan, view, channel and step.
pub(super) fn pictures(
    recording: &mut Recording,
    scan: u64,
    folder: &Path,
) -> Result<Vec<PathBuf>, ExportError> {
    let io = |source| ExportError::Io {
        path: folder.to_owned(),
        source,
    };
    fs::create_dir_all(folder).map_err(io)?;
    let read = recording.scan(scan)?;
    let codec = recording.codec();
    let rig = codec.rig();
    let mut written = Vec::new();
    let mut save = |name: String, picture: Picture| {
        let path = folder.join(format!("{scan:06}-{name}.png"));
        picture.save(&path)?;
        written.push(path);
        Ok::<_, ExportError>(())
    };
    for (view, image_topic) in Topic::of(rig, Kind::Image).iter().enumerate() {
        let image: Owned<Image> = read.decode(codec, image_topic)?;
        let size = image.header.size();
        let prefix = format!("{view}-{}", rig.views[view].name);
        save(
            format!("{prefix}-0-original"),
            Picture::gray(size, image.view().pixels.to_vec()),
        )?;
        let of_view = |kind| {
            let topics = Topic::of(rig, kind).into_iter();
            topics
                .filter(|topic| topic.view == view as u32)
                .collect::<Vec<_>>()
        };
        let channels = of_view(Kind::Edges).into_iter().zip(of_view(Kind::Curves));
        for (channel, (edges_topic, curves_topic)) in channels.enumerate() {
            let prefix = format!("{prefix}-{}-{}", channel + 1, rig.channels[channel]);
            let edges: Owned<Edges> = read.decode(codec, &edges_topic)?;
            let edges = edges.view().edges;
            save(
                format!("{prefix}-1-zero-crossings"),
                zero_crossings(size, edges),
            )?;
            save(format!("{prefix}-2-orientation"), orientation(size, edges))?;
            let curves: Owned<Curves> = read.decode(codec, &curves_topic)?;
            save(format!("{prefix}-3-curves"), segments(size, curves.view()))?;
            if view == codec.reference() {
                let picture = disparity(&read, recording, channel, size)?;
                save(format!("{prefix}-4-disparity"), picture)?;
            }
        }
    }
    Ok(written)
}

/// A picture in memory.
pub(crate) struct Picture {
    pub(crate) size: Size,
    pub(crate) colours: ExtendedColorType,
    pub(crate) bytes: Vec<u8>,
}

impl Picture {
    pub(crate) fn gray(size: Size, bytes: Vec<u8>) -> Self {
        Self {
            size,
            colours: ExtendedColorType::L8,
            bytes,
        }
    }

    pub(crate) fn rgb(size: Size, bytes: Vec<u8>) -> Self {
        Self {
            size,
            colours: ExtendedColorType::Rgb8,
            bytes,
        }
    }

    pub(crate) fn save(&self, path: &Path) -> Result<(), ExportError> {
        use std::io::Write;
        let mut png = Vec::new();
        let Size { width, height } = self.size;
        image::write_buffer_with_format(
            &mut Cursor::new(&mut png),
            &self.bytes,
            width,
            height,
            self.colours,
            ImageFormat::Png,
        )
        .map_err(|source| ExportError::Picture {
            path: path.to_owned(),
            source,
        })?;
        whole(path, |file| {
            file.write_all(&png).map_err(|source| ExportError::Io {
                path: path.to_owned(),
                source,
            })
        })
    }
}

/// The pixel a place falls on, inside the picture.
pub(crate) fn pixel(size: Size, x: f32, y: f32) -> Option<(u32, u32)> {
    let (x, y) = (x.round(), y.round());
    let inside = x >= 0.0 && y >= 0.0 && x < size.width as f32 && y < size.height as f32;
    inside.then_some((x as u32, y as u32))
}

/// The gray level at a place, or of the nearest pixel.
pub(super) fn gray_at(pixels: &[u8], size: Size, x: f32, y: f32) -> u8 {
    let x = x.round().clamp(0.0, size.width.saturating_sub(1) as f32) as usize;
    let y = y.round().clamp(0.0, size.height.saturating_sub(1) as f32) as usize;
    pixels
        .get(y * size.width as usize + x)
        .copied()
        .unwrap_or(0)
}

/// Dark where a zero-crossing is, on white.
pub(crate) fn zero_crossings(size: Size, edges: &[Edge]) -> Picture {
    let mut picture = GrayImage::from_pixel(size.width, size.height, [255].into());
    for edge in edges {
        if let Some((x, y)) = pixel(size, edge.x, edge.y) {
            picture.put_pixel(x, y, [0].into());
        }
    }
    Picture::gray(size, picture.into_raw())
}

/// The full circle of orientations as 1 to 255, on black.
pub(crate) fn orientation(size: Size, edges: &[Edge]) -> Picture {
    let mut picture = GrayImage::new(size.width, size.height);
    for edge in edges {
        if let Some((x, y)) = pixel(size, edge.x, edge.y) {
            let turn = (edge.orientation / std::f32::consts::TAU).rem_euclid(1.0);
            picture.put_pixel(x, y, [1 + (turn * 254.0) as u8].into());
        }
    }
    Picture::gray(size, picture.into_raw())
}

/// Every curve in a colour of its own, its centroid crossed, on black.
pub(crate) fn segments(size: Size, view: CurvesView<'_>) -> Picture {
    let mut picture = RgbImage::new(size.width, size.height);
    let mut put = |x: f32, y: f32, colour: [u8; 3]| {
        if let Some((x, y)) = pixel(size, x, y) {
            picture.put_pixel(x, y, Rgb(colour));
        }
    };
    for curve in view.curves {
        let colour = colour_of(curve.label);
        curve
            .points(view.points)
            .iter()
            .for_each(|edge| put(edge.x, edge.y, colour));
    }
    for curve in view.curves {
        // A cross is no larger than its curve.
        let arm: i8 = if curve.length < SHORT { 1 } else { 2 };
        for step in -arm..=arm {
            let (step, colour) = (f32::from(step), colour_of(curve.label).map(|c| c / 2 + 127));
            put(curve.x + step, curve.y, colour);
            put(curve.x, curve.y + step, colour);
        }
    }
    Picture::rgb(size, picture.into_raw())
}

/// Curves shorter than this, in pixels, have small crosses at their centroids.
const SHORT: f32 = 24.0;

/// How many labels have colours of their own: with the lighter ones of their centroids and black no more colours than a
/// picture with a palette can have.
const COLOURED: u32 = 127;

/// A colour that neighbouring labels do not share: hues a golden angle apart.
fn colour_of(label: u32) -> [u8; 3] {
    let hue = f64::from(label % COLOURED) * 0.618_033_988_749_895 * 6.0 % 6.0;
    [0.0, 2.0, 4.0].map(|third: f64| {
        let off = (hue - third).rem_euclid(6.0);
        let near = (off.min(6.0 - off) - 1.0).clamp(0.0, 1.0);
        (255.0 - 175.0 * near) as u8
    })
}

/// The disparities of a channel's matches in colours.
fn disparity(
    scan: &Scan,
    recording: &Recording,
    channel: usize,
    size: Size,
) -> Result<Picture, ExportError> {
    let topic = &Topic::of(recording.codec().rig(), Kind::Matches)[channel];
    let matches: Owned<Matches> = scan.decode(recording.codec(), topic)?;
    let mut picture = vec![f32::NAN; size.pixels()];
    for MatchPoint {
        x, y, disparity, ..
    } in matches.view().points
    {
        if let Some((x, y)) = pixel(size, *x, *y) {
            picture[y as usize * size.width as usize + x as usize] = *disparity;
        }
    }
    let mut bytes = Vec::new();
    paint(
        &Colours::new(),
        Span::of(picture.iter().copied()),
        &picture,
        &mut bytes,
    );
    Ok(Picture::rgb(size, bytes))
}
