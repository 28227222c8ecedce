//! Images in files: what their heads say, and their pixels.

mod jpeg_end;
mod numbers;
mod several;

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use image::error::ImageError;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use messages::Size;

use crate::error::{LEAST_SIDE, MOST_PIXELS, SourceError};
use crate::levels::{Gray, Levels};

/// The endings of file names that are taken for images.
const ENDINGS: [&str; 11] = [
    "png", "jpg", "jpeg", "pgm", "ppm", "pnm", "pbm", "tif", "tiff", "bmp", "webp",
];
/// Bytes of a PNM's head that are looked at: comments may be long.
const PNM_HEAD: u64 = 4096;

/// Whether a file's name ends like an image's.
pub(crate) fn is_image(path: &Path) -> bool {
    let ending = path
        .extension()
        .map(|ending| ending.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
}

/// Whether a file holds several pictures, of which only the first is read.
pub(crate) fn holds_more(path: &Path) -> bool {
    let format = ImageReader::open(path).and_then(ImageReader::with_guessed_format);
    match format.ok().and_then(|reader| reader.format()) {
        Some(ImageFormat::Tiff) => numbers::holds_more(path),
        Some(format) => several::holds_more(path, format).unwrap_or_default(),
        None => false,
    }
}

/// What an image's head says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Head {
    pub(crate) size: Size,
    pub(crate) is_colour: bool,
    /// Whether it has more than 8 bit.
    pub(crate) is_deep: bool,
    pub(crate) depth: Depth,
}

/// What an image's pixels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Depth {
    /// 8 bit.
    Bytes,
    /// 16 bit, of which fewer may be used.
    Deep,
    /// Floating-point numbers, or integers of another kind.
    Numbers,
}

/// What a file of 16-bit values says of white.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum White {
    /// Nothing.
    Unsaid,
    /// What it is: values were scaled by it.
    Said,
    /// That it is 0.
    IsZero,
}

/// An image's gray levels as they are in its file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Samples {
    Bytes(Vec<u8>),
    Deep { values: Vec<u16>, white: White },
    Numbers(Vec<f32>),
}

/// A decoded image, row by row, the way up that its camera says.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Decoded {
    pub(crate) size: Size,
    pub(crate) samples: Samples,
}

/// Reads an image's head and refuses what cannot be used, before any pixel is decoded.
pub(crate) fn head(path: &Path) -> Result<Head, SourceError> {
    match open(path, None)? {
        Opened::Image(mut decoder, _) => head_of(path, &mut decoder, None),
        Opened::Numbers(file) => checked(path, file.head()),
    }
}

/// Decodes an image into 8-bit gray.
pub(crate) fn pixels(
    path: &Path,
    levels: &Levels,
    scan: Option<u64>,
) -> Result<(Size, Gray), SourceError> {
    let Decoded { size, samples } = decoded(path, scan)?;
    Ok((size, levels.gray(samples)))
}

/// Decodes an image into gray levels as they are in its file.
pub(crate) fn decoded(path: &Path, scan: Option<u64>) -> Result<Decoded, SourceError> {
    let (mut decoder, format) = match open(path, scan)? {
        Opened::Image(decoder, format) => (decoder, format),
        Opened::Numbers(file) => {
            checked(path, file.head())?;
            return file.decoded().map_err(|why| damaged(path, scan, why));
        }
    };
    let head = head_of(path, &mut decoder, scan)?;
    if format == Some(ImageFormat::Jpeg)
        && !jpeg_end::is_whole(&fs::read(path).map_err(SourceError::io(path))?)
    {
        let why = "it ends before its last row".to_owned();
        return Err(damaged(path, scan, why));
    }
    let turn = decoder.orientation().map_err(unreadable(path, scan))?;
    let mut image = DynamicImage::from_decoder(decoder).map_err(unreadable(path, scan))?;
    image.apply_orientation(turn);
    let samples = match head.depth {
        Depth::Bytes => Samples::Bytes(image.into_luma8().into_raw()),
        Depth::Deep => {
            let white = match format {
                Some(ImageFormat::Pnm) if says_white(path)? => White::Said,
                Some(ImageFormat::Tiff) if numbers::is_negative(path) => White::IsZero,
                _ => White::Unsaid,
            };
            let mut values = image.into_luma16().into_raw();
            if white == White::IsZero {
                // As they are in the file: the decoder made them positive, as if all bits were used.
                values.iter_mut().for_each(|value| *value = !*value);
            }
            Samples::Deep { values, white }
        }
        Depth::Numbers => Samples::Numbers(numbers::gray(&image.into_rgb32f())),
    };
    Ok(Decoded {
        size: head.size,
        samples,
    })
}

/// How many bits of its 16 a PNG itself calls significant.
pub(crate) fn significant_bits(path: &Path) -> Option<u8> {
    let file = BufReader::new(File::open(path).ok()?);
    let reader = png::Decoder::new(file).read_info().ok()?;
    let said = reader.info().sbit.as_deref()?;
    said.iter().copied().max()
}

/// Whether a PNM says of what fewer than 16 bits hold that it is white; then it was scaled by that.
fn says_white(path: &Path) -> Result<bool, SourceError> {
    let file = File::open(path).map_err(SourceError::io(path))?;
    Ok(greatest(BufReader::new(file.take(PNM_HEAD))).is_some_and(|most| most < 65_535))
}

/// The greatest value that the head of a PNM allows.
fn greatest(head: impl BufRead) -> Option<u32> {
    let (mut words, mut is_arbitrary) = (Vec::new(), false);
    // Only its first lines are text.
    for line in head.split(b'\n').map_while(Result::ok) {
        let line = String::from_utf8_lossy(&line);
        let text = line.split('#').next().unwrap_or_default();
        words.extend(text.split_ascii_whitespace().map(str::to_owned));
        is_arbitrary |= words.first().is_some_and(|magic| magic == "P7");
        match is_arbitrary {
            true => {
                let at = words.iter().position(|word| word == "MAXVAL");
                if let Some(said) = at.and_then(|at| words.get(at + 1)) {
                    return said.parse().ok();
                }
            }
            // Magic, width, height, greatest value.
            false if words.len() > 3 => return words[3].parse().ok(),
            false => {}
        }
    }
    None
}

/// Decodes a single-channel 16-bit image as it is; `None` for any other kind.
pub(crate) fn deep_pixels(path: &Path) -> Result<Option<(Size, Vec<u16>)>, SourceError> {
    let Opened::Image(decoder, _) = open(path, None)? else {
        return Ok(None);
    };
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
    let Opened::Image(decoder, _) = open(path, None)? else {
        return Ok(None);
    };
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

/// A file whose head was read.
enum Opened {
    Image(Box<dyn ImageDecoder>, Option<ImageFormat>),
    Numbers(Box<numbers::File>),
}

fn open(path: &Path, scan: Option<u64>) -> Result<Opened, SourceError> {
    let mut reader = ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(SourceError::io(path))?;
    let mut limits = Limits::default();
    // The largest image allowed, in 16-bit colour with transparency, and the decoder's own needs.
    limits.max_alloc = Some(MOST_PIXELS * 8 + (64 << 20));
    reader.limits(limits);
    let format = reader.format();
    match reader.into_decoder() {
        Ok(decoder) => Ok(Opened::Image(Box::new(decoder), format)),
        Err(error) => match format {
            Some(ImageFormat::Tiff) if let Some(file) = numbers::File::open(path) => {
                Ok(Opened::Numbers(Box::new(file)))
            }
            _ => Err(unreadable(path, scan)(error)),
        },
    }
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
    let bytes = colour.bytes_per_pixel() / colour.channel_count();
    let depth = match bytes {
        1 => Depth::Bytes,
        2 => Depth::Deep,
        _ => Depth::Numbers,
    };
    let head = Head {
        size,
        is_colour: colour.has_color(),
        is_deep: depth != Depth::Bytes,
        depth,
    };
    checked(path, head)
}

/// Refuses what is too small or too large.
fn checked(path: &Path, head: Head) -> Result<Head, SourceError> {
    let (size, path) = (fitting(path, head.size)?, path.to_owned());
    if u64::from(size.width) * u64::from(size.height) > MOST_PIXELS {
        return Err(SourceError::TooLarge { path, size });
    }
    Ok(head)
}

/// A size that holds a curve.
pub(crate) fn fitting(path: &Path, size: Size) -> Result<Size, SourceError> {
    match size.width < LEAST_SIDE || size.height < LEAST_SIDE {
        true => Err(SourceError::TooSmall {
            path: path.to_owned(),
            size,
        }),
        false => Ok(size),
    }
}

fn unreadable(path: &Path, scan: Option<u64>) -> impl FnOnce(ImageError) -> SourceError {
    let path = path.to_owned();
    move |error| damaged(&path, scan, error.to_string())
}

/// Whether a JPEG holds all its rows: the decoder would fill in gray for what is missing.
pub(crate) fn is_whole_jpeg(bytes: &[u8]) -> bool {
    jpeg_end::is_whole(bytes)
}

fn damaged(path: &Path, scan: Option<u64>, why: String) -> SourceError {
    SourceError::Unreadable {
        path: path.to_owned(),
        scan,
        why,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_of_a_pnm_says_what_white_is() {
        for (head, most) in [
            ("P5\n# of a camera\n640 480\n4095\n", Some(4095)),
            ("P5 640 480 1023\n", Some(1023)),
            (
                "P7\nWIDTH 4\nHEIGHT 4\nDEPTH 1\nMAXVAL 16383\nTUPLTYPE GRAYSCALE\nENDHDR\n",
                Some(16383),
            ),
            ("P5\n640", None),
        ] {
            assert_eq!(greatest(head.as_bytes()), most, "{head}");
        }
    }
}
