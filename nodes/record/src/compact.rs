//! PNG with as few bits as the colours need.

use image::ExtendedColorType;
use messages::Size;
use png::{BitDepth, ColorType, Compression, EncodingError, Filter};

use crate::export::pictures::Picture;

/// A picture with as few bits as its colours need.
pub(crate) fn compact(picture: &Picture) -> Result<Vec<u8>, EncodingError> {
    match picture.colours {
        ExtendedColorType::Rgb8 => {
            let (pixels, _) = picture.bytes.as_chunks::<3>();
            let mut palette: Vec<[u8; 3]> = pixels.to_vec();
            palette.sort_unstable();
            palette.dedup();
            if palette.len() > 256 {
                return encode(picture.size, &picture.bytes, Pixels::Rgb);
            }
            let index = |rgb: &[u8; 3]| palette.binary_search(rgb).unwrap_or_default() as u8;
            let indices: Vec<u8> = pixels.iter().map(index).collect();
            encode(picture.size, &indices, Pixels::Of(&palette, false))
        }
        _ => {
            let is_black_and_white = picture.bytes.iter().all(|gray| [0, 255].contains(gray));
            if !is_black_and_white {
                return encode(picture.size, &picture.bytes, Pixels::Gray);
            }
            let indices: Vec<u8> = picture.bytes.iter().map(|gray| gray & 1).collect();
            encode(
                picture.size,
                &indices,
                Pixels::Of(&[[0; 3], [255; 3]], false),
            )
        }
    }
}

/// What the bytes of a picture are.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pixels<'a> {
    /// Gray levels.
    Gray,
    /// Red, green and blue.
    Rgb,
    /// Indices of these colours; whether the first is transparent.
    Of(&'a [[u8; 3]], bool),
}

/// As PNG.
pub(crate) fn encode(
    size: Size,
    bytes: &[u8],
    pixels: Pixels<'_>,
) -> Result<Vec<u8>, EncodingError> {
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, size.width, size.height);
    encoder.set_compression(Compression::High);
    let mut packed = None;
    match pixels {
        Pixels::Gray => encoder.set_color(ColorType::Grayscale),
        Pixels::Rgb => encoder.set_color(ColorType::Rgb),
        Pixels::Of(palette, is_transparent) => {
            encoder.set_color(ColorType::Indexed);
            // Indices of neighbours have nothing to do with each other: differences would only be longer.
            encoder.set_filter(Filter::NoFilter);
            encoder.set_palette(palette.concat());
            if is_transparent {
                encoder.set_trns(vec![0]);
            }
            if palette.len() <= 2 {
                encoder.set_depth(BitDepth::One);
                packed = Some(bits(size, bytes));
            }
        }
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(packed.as_deref().unwrap_or(bytes))?;
    writer.finish()?;
    Ok(png)
}

/// Eight pixels a byte, each row from a byte of its own.
fn bits(size: Size, bytes: &[u8]) -> Vec<u8> {
    let rows = bytes.chunks(size.width.max(1) as usize);
    let pack = |eight: &[u8]| {
        let bits = eight.iter().zip((0..8).rev());
        bits.fold(0, |byte, (bit, place)| byte | (bit & 1) << place)
    };
    rows.flat_map(|row| row.chunks(8).map(pack)).collect()
}
