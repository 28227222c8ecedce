//! Images in files: what their heads say, and their pixels as 8-bit gray.

use std::fs;
use std::path::Path;

use image::error::ImageError;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use messages::Size;

use crate::error::{LEAST_SIDE, MOST_PIXELS, SourceError};

/// The endings of file names that are taken for images.
const ENDINGS: [&str; 9] = [
    "png", "jpg", "jpeg", "pgm", "ppm", "pnm", "pbm", "tif", "tiff",
];

/// Whether a file's name ends like an image's.
pub(crate) fn is_image(path: &Path) -> bool {
    let ending = path
        .extension()
        .map(|ending| ending.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
}

/// What an image's head says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Head {
    pub(crate) size: Size,
    pub(crate) is_colour: bool,
    pub(crate) is_deep: bool,
}

/// Reads an image's head and refuses what cannot be used, before any pixel is decoded.
pub(crate) fn head(path: &Path) -> Result<Head, SourceError> {
    let (mut decoder, _) = open(path, None)?;
    head_of(path, &mut decoder, None)
}

/// Decodes an image into 8-bit gray, row by row, the way up that its camera says.
pub(crate) fn pixels(path: &Path, scan: Option<u64>) -> Result<(Size, Vec<u8>), SourceError> {
    let (mut decoder, format) = open(path, scan)?;
    let head = head_of(path, &mut decoder, scan)?;
    if format == Some(ImageFormat::Jpeg)
        && !is_whole_jpeg(&fs::read(path).map_err(SourceError::io(path))?)
    {
        let why = "it ends before its last row".to_owned();
        return Err(SourceError::Unreadable {
            path: path.to_owned(),
            scan,
            why,
        });
    }
    let turn = decoder.orientation().map_err(unreadable(path, scan))?;
    let mut image = DynamicImage::from_decoder(decoder).map_err(unreadable(path, scan))?;
    image.apply_orientation(turn);
    Ok((head.size, image.into_luma8().into_raw()))
}

/// Decodes a single-channel 16-bit image as it is; `None` for any other kind.
pub(crate) fn deep_pixels(path: &Path) -> Result<Option<(Size, Vec<u16>)>, SourceError> {
    let (decoder, _) = open(path, None)?;
    match DynamicImage::from_decoder(decoder).map_err(unreadable(path, None))? {
        DynamicImage::ImageLuma16(image) => Ok(Some((
            Size::new(image.width(), image.height()),
            image.into_raw(),
        ))),
        _ => Ok(None),
    }
}

/// Decodes an 8-bit gray image as it is; `None` for one of any other depth or in colour.
pub(crate) fn gray_pixels(path: &Path) -> Result<Option<(Size, Vec<u8>)>, SourceError> {
    let (decoder, _) = open(path, None)?;
    let image = DynamicImage::from_decoder(decoder).map_err(unreadable(path, None))?;
    let size = Size::new(image.width(), image.height());
    Ok(match image {
        DynamicImage::ImageLuma8(image) => Some((size, image.into_raw())),
        // Some sets hold their gray levels three times over.
        DynamicImage::ImageRgb8(image) if image.pixels().all(|p| p[0] == p[1] && p[0] == p[2]) => {
            Some((size, image.pixels().map(|p| p[0]).collect()))
        }
        _ => None,
    })
}

fn open(
    path: &Path,
    scan: Option<u64>,
) -> Result<(impl ImageDecoder, Option<ImageFormat>), SourceError> {
    let mut reader = ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(SourceError::io(path))?;
    let mut limits = Limits::default();
    // The largest image allowed, in 16-bit colour with transparency, and the decoder's own needs.
    limits.max_alloc = Some(MOST_PIXELS * 8 + (64 << 20));
    reader.limits(limits);
    let format = reader.format();
    Ok((
        reader.into_decoder().map_err(unreadable(path, scan))?,
        format,
    ))
}

fn head_of(
    path: &Path,
    decoder: &mut impl ImageDecoder,
    scan: Option<u64>,
) -> Result<Head, SourceError> {
    let (width, height) = decoder.dimensions();
    let is_lying = matches!(
        decoder.orientation().map_err(unreadable(path, scan))?,
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    );
    let size = if is_lying {
        Size::new(height, width)
    } else {
        Size::new(width, height)
    };
    let colour = decoder.color_type();
    let path = || path.to_owned();
    if size.width < LEAST_SIDE || size.height < LEAST_SIDE {
        return Err(SourceError::TooSmall { path: path(), size });
    }
    if u64::from(size.width) * u64::from(size.height) > MOST_PIXELS {
        return Err(SourceError::TooLarge { path: path(), size });
    }
    let bytes = colour.bytes_per_pixel() / colour.channel_count();
    if bytes > 2 {
        return Err(SourceError::FloatingPoint { path: path() });
    }
    Ok(Head {
        size,
        is_colour: colour.has_color(),
        is_deep: bytes == 2,
    })
}

fn unreadable(path: &Path, scan: Option<u64>) -> impl FnOnce(ImageError) -> SourceError {
    let path = path.to_owned();
    move |error| SourceError::Unreadable {
        path,
        scan,
        why: error.to_string(),
    }
}

/// Whether a JPEG's data goes on to its end mark: the decoder would fill in gray for what is missing.
pub(crate) fn is_whole_jpeg(bytes: &[u8]) -> bool {
    // Segments, each with its length, up to the first scan's data; thumbnails are inside them.
    let mut at = 2;
    while let Some(&[0xff, kind, high, low]) = bytes.get(at..at + 4) {
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
        if kind == 0xda {
            break;
        }
    }
    let data = bytes.get(at..).unwrap_or_default();
    data.windows(2).any(|pair| pair == [0xff, 0xd9])
}
