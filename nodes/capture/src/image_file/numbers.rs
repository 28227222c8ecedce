//! TIFFs whose pixels are numbers: floating-point ones, and integers of other kinds than 8 and 16 bit.

use std::io::BufReader;
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer, Rgb, Rgb32FImage};
use messages::Size;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::{Decoded, Depth, Head, Samples};
use crate::error::MOST_PIXELS;

/// How much red, green and blue weigh: ITU-R BT.709, as of other images.
const WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Whether a TIFF holds another picture of the same size; smaller ones are previews.
pub(super) fn holds_more(path: &Path) -> bool {
    let second = || {
        let file = BufReader::new(std::fs::File::open(path).ok()?);
        let mut decoder = Decoder::new(file).ok()?;
        let first = decoder.dimensions().ok()?;
        if !decoder.more_images() {
            return None;
        }
        decoder.next_image().ok()?;
        Some(decoder.dimensions().ok()? == first)
    };
    second().unwrap_or_default()
}

/// A TIFF of one or more numbers a pixel.
pub(super) struct File {
    decoder: Decoder<BufReader<std::fs::File>>,
    size: Size,
    turn: Orientation,
    channels: usize,
}

impl File {
    /// `None` of what is no such file.
    pub(super) fn open(path: &Path) -> Option<Self> {
        let file = BufReader::new(std::fs::File::open(path).ok()?);
        let mut limits = Limits::default();
        limits.decoding_buffer_size = MOST_PIXELS as usize * 8;
        limits.intermediate_buffer_size = limits.decoding_buffer_size;
        let mut decoder = Decoder::new(file).ok()?.with_limits(limits);
        let (width, height) = decoder.dimensions().ok()?;
        let kind = decoder.colortype().ok()?;
        let channels = match kind {
            tiff::ColorType::Gray(16 | 32 | 64) => 1,
            tiff::ColorType::GrayA(16 | 32 | 64) => 2,
            tiff::ColorType::RGB(16 | 32 | 64) => 3,
            tiff::ColorType::RGBA(16 | 32 | 64) => 4,
            _ => return None,
        };
        let turn = decoder.find_tag_unsigned::<u8>(Tag::Orientation);
        let turn = turn.ok().flatten().and_then(Orientation::from_exif);
        Some(Self {
            decoder,
            size: Size::new(width, height),
            turn: turn.unwrap_or(Orientation::NoTransforms),
            channels,
        })
    }

    pub(super) fn head(&self) -> Head {
        let Size { width, height } = self.size;
        let is_lying = matches!(
            self.turn,
            Orientation::Rotate90
                | Orientation::Rotate270
                | Orientation::Rotate90FlipH
                | Orientation::Rotate270FlipH
        );
        Head {
            size: match is_lying {
                true => Size::new(height, width),
                false => self.size,
            },
            is_colour: self.channels > 2,
            is_deep: true,
            depth: Depth::Numbers,
        }
    }

    pub(super) fn decoded(mut self) -> Result<Decoded, String> {
        let size = self.head().size;
        let values = self.decoder.read_image().map_err(|e| e.to_string())?;
        let values = floats(values).ok_or("its pixels are of a kind that is not read")?;
        // Of planes that follow each other the first is read.
        let channels = match values.len() == self.size.pixels() {
            true => 1,
            false => self.channels,
        };
        let mut gray: Vec<f32> = values.chunks_exact(channels).map(weighed).collect();
        if gray.len() != self.size.pixels() {
            return Err("it holds fewer pixels than its head says".to_owned());
        }
        if self.turn != Orientation::NoTransforms {
            let Size { width, height } = self.size;
            let threefold = gray.iter().flat_map(|&value| [value; 3]).collect();
            let image: Option<Rgb32FImage> =
                ImageBuffer::<Rgb<f32>, _>::from_raw(width, height, threefold);
            let mut image = DynamicImage::from(image.unwrap_or_default());
            image.apply_orientation(self.turn);
            gray = image.into_rgb32f().pixels().map(|pixel| pixel[0]).collect();
        }
        Ok(Decoded {
            size,
            samples: Samples::Numbers(gray),
        })
    }
}

/// Whether a TIFF says that white is 0.
pub(super) fn is_negative(path: &Path) -> bool {
    let said = || {
        let file = BufReader::new(std::fs::File::open(path).ok()?);
        let mut decoder = Decoder::new(file).ok()?;
        let said = decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation);
        said.ok().flatten()
    };
    said() == Some(0)
}

/// The gray levels of a picture in colour.
pub(super) fn gray(image: &Rgb32FImage) -> Vec<f32> {
    image.pixels().map(|pixel| weighed(&pixel.0)).collect()
}

/// A pixel's gray level.
fn weighed(pixel: &[f32]) -> f32 {
    match pixel {
        // What is gray is as it is, to the last bit.
        [red, green, blue, ..] if red == green && green == blue => *red,
        [red, green, blue, ..] => red * WEIGHTS[0] + green * WEIGHTS[1] + blue * WEIGHTS[2],
        _ => pixel[0],
    }
}

fn floats(values: DecodingResult) -> Option<Vec<f32>> {
    let of_float = |value: f64| value as f32;
    Some(match values {
        DecodingResult::F16(values) => values.into_iter().map(|v| v.to_f32()).collect(),
        DecodingResult::F32(values) => values,
        DecodingResult::F64(values) => values.into_iter().map(of_float).collect(),
        DecodingResult::U16(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::U32(values) => values.into_iter().map(|v| v as f32).collect(),
        DecodingResult::I16(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::I32(values) => values.into_iter().map(|v| v as f32).collect(),
        _ => return None,
    })
}
