//! Pictures as messages hold them, as gray levels.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use messages::Size;

use super::message::{Image, Raw};
use super::wire::Why;
use crate::error::{LEAST_SIDE, MOST_PIXELS};
use crate::image_file;

/// A picture's gray levels, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Gray {
    /// Of 8 bit.
    Shallow(Vec<u8>),
    /// Of up to 16, of which fewer may be in use.
    Deep(Vec<u16>),
}

/// Bits that cameras have.
const DEPTHS: [u32; 5] = [8, 10, 12, 14, 16];

/// How many bits are in use where this is the greatest level of all.
pub(super) fn bits_in_use(most: u16) -> u32 {
    let fits = |bits: &u32| u32::from(most) < 1 << bits;
    DEPTHS.into_iter().find(fits).unwrap_or(16)
}

impl Gray {
    /// The greatest level of one that is deep.
    pub(super) fn most(&self) -> Option<u16> {
        match self {
            Self::Shallow(_) => None,
            Self::Deep(levels) => levels.iter().copied().max(),
        }
    }

    /// As 8 bit, where so many bits of deep levels are in use.
    pub(super) fn scaled(self, bits: u32) -> Vec<u8> {
        match self {
            Self::Shallow(levels) => levels,
            Self::Deep(levels) => {
                let most = (1u32 << bits) - 1;
                let scaled = |level: u16| (u32::from(level).min(most) * 255 + most / 2) / most;
                levels
                    .into_iter()
                    .map(|level| scaled(level) as u8)
                    .collect()
            }
        }
    }
}

/// What a pixel is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Colours {
    /// Gray first, and so many values in all.
    Gray(usize),
    /// Red, green, blue, and so many values in all.
    Rgb(usize),
    /// Blue, green, red.
    Bgr(usize),
    /// Gray at this place of every two bytes, colours between.
    Yuv(usize),
    /// A mosaic: the colours of two rows of two pixels, 0 red, 1 green, 2 blue.
    Mosaic([usize; 4]),
}

/// The encodings that are read: colours, and bytes of a value.
const ENCODINGS: [(&str, Colours, usize); 37] = [
    ("mono8", Colours::Gray(1), 1),
    ("8UC1", Colours::Gray(1), 1),
    ("mono16", Colours::Gray(1), 2),
    ("16UC1", Colours::Gray(1), 2),
    ("rgb8", Colours::Rgb(3), 1),
    ("bgr8", Colours::Bgr(3), 1),
    ("8UC3", Colours::Bgr(3), 1),
    ("rgba8", Colours::Rgb(4), 1),
    ("bgra8", Colours::Bgr(4), 1),
    ("8UC4", Colours::Bgr(4), 1),
    ("rgb16", Colours::Rgb(3), 2),
    ("bgr16", Colours::Bgr(3), 2),
    ("16UC3", Colours::Bgr(3), 2),
    ("rgba16", Colours::Rgb(4), 2),
    ("bgra16", Colours::Bgr(4), 2),
    ("16UC4", Colours::Bgr(4), 2),
    ("8UC2", Colours::Gray(2), 1),
    ("16UC2", Colours::Gray(2), 2),
    ("yuv422", Colours::Yuv(1), 1),
    ("uyvy", Colours::Yuv(1), 1),
    ("UYVY", Colours::Yuv(1), 1),
    ("yuv422_yuy2", Colours::Yuv(0), 1),
    ("yuyv", Colours::Yuv(0), 1),
    ("YUYV", Colours::Yuv(0), 1),
    // Gray comes first, and half or all of its rows of colours after it.
    ("nv12", Colours::Gray(1), 1),
    ("nv21", Colours::Gray(1), 1),
    ("nv24", Colours::Gray(1), 1),
    ("i420", Colours::Gray(1), 1),
    ("yuv420", Colours::Gray(1), 1),
    ("bayer_rggb8", Colours::Mosaic([0, 1, 1, 2]), 1),
    ("bayer_bggr8", Colours::Mosaic([2, 1, 1, 0]), 1),
    ("bayer_gbrg8", Colours::Mosaic([1, 2, 0, 1]), 1),
    ("bayer_grbg8", Colours::Mosaic([1, 0, 2, 1]), 1),
    ("bayer_rggb16", Colours::Mosaic([0, 1, 1, 2]), 2),
    ("bayer_bggr16", Colours::Mosaic([2, 1, 1, 0]), 2),
    ("bayer_gbrg16", Colours::Mosaic([1, 2, 0, 1]), 2),
    ("bayer_grbg16", Colours::Mosaic([1, 0, 2, 1]), 2),
];

impl Colours {
    /// Values from one pixel to the next.
    fn values(self) -> usize {
        match self {
            Self::Gray(count) | Self::Rgb(count) | Self::Bgr(count) => count,
            Self::Yuv(_) => 2,
            Self::Mosaic(_) => 1,
        }
    }
}

fn encoding(name: &str) -> Option<(Colours, usize)> {
    let found = ENCODINGS.iter().find(|(known, ..)| *known == name)?;
    Some((found.1, found.2))
}

/// What is done to pictures of an encoding, to be said once.
pub(super) fn notice(name: &str) -> Option<&'static str> {
    match encoding(name)?.0 {
        Colours::Gray(_) => None,
        Colours::Mosaic(_) => Some("mosaics of colours are interpolated and made gray"),
        _ => Some("colour is converted to gray"),
    }
}

/// Why a picture that says this of itself cannot be used, if it cannot; `length` is of its bytes.
pub(super) fn refused(raw: &Raw, length: usize) -> Option<Why> {
    let Raw {
        size,
        encoding: name,
        step,
        ..
    } = raw;
    let Some((colours, bytes)) = encoding(name) else {
        return Some(format!(
            "its pixels are {name:?}, and gray, colour, Bayer and YUV pixels of 8 or 16 bit are read"
        ));
    };
    if size.width == 0 || size.height == 0 {
        return Some("it is empty".to_owned());
    }
    if let Some(why) = wrong_size(*size) {
        return Some(why);
    }
    let row = size.width as usize * colours.values() * bytes;
    let needed = (size.height as usize - 1)
        .checked_mul(*step)
        .map(|n| n + row);
    if *step < row {
        return Some(format!(
            "its rows are {step} bytes apart, and {} pixels of {name} take {row}",
            size.width
        ));
    }
    (needed.is_none_or(|needed| length < needed)).then(|| {
        format!(
            "it holds {length} bytes, and {size} pixels of {name} take {}",
            needed.unwrap_or(usize::MAX)
        )
    })
}

fn wrong_size(size: Size) -> Option<Why> {
    if size.width < LEAST_SIDE || size.height < LEAST_SIDE {
        return Some(format!(
            "it is {size} pixels, and at least {LEAST_SIDE}x{LEAST_SIDE} are needed"
        ));
    }
    let is_large = u64::from(size.width) * u64::from(size.height) > MOST_PIXELS;
    is_large.then(|| {
        format!(
            "it is {size} pixels, more than {} megapixels",
            MOST_PIXELS / 1_000_000
        )
    })
}

/// The gray levels of a whole image message.
pub(super) fn gray(image: &Image<'_>) -> Result<(Size, Gray), Why> {
    match &image.raw {
        Some(raw) => {
            if let Some(why) = refused(raw, image.data.len()) {
                return Err(why);
            }
            let (colours, bytes) = encoding(&raw.encoding).unwrap_or((Colours::Gray(1), 1));
            let levels = match bytes {
                1 => Gray::Shallow(levels(raw, colours, &image.data, |pixel: &[u8; 1]| {
                    u32::from(pixel[0])
                })),
                _ if raw.is_big => Gray::Deep(levels(raw, colours, &image.data, |pixel| {
                    u32::from(u16::from_be_bytes(*pixel))
                })),
                _ => Gray::Deep(levels(raw, colours, &image.data, |pixel| {
                    u32::from(u16::from_le_bytes(*pixel))
                })),
            };
            Ok((raw.size, levels))
        }
        None => compressed(&image.data),
    }
}

/// A gray level as it is kept.
trait Level {
    fn of(value: u32) -> Self;
}

impl Level for u8 {
    fn of(value: u32) -> Self {
        value as Self
    }
}

impl Level for u16 {
    fn of(value: u32) -> Self {
        value as Self
    }
}

/// Rec. 709, as colour images in files are converted.
fn luma([red, green, blue]: [u32; 3]) -> u32 {
    (2126 * red + 7152 * green + 722 * blue) / 10_000
}

/// The gray levels of pixels of `N` bytes a value, row by row.
fn levels<const N: usize, L: Level>(
    raw: &Raw,
    colours: Colours,
    data: &[u8],
    value: impl Fn(&[u8; N]) -> u32,
) -> Vec<L> {
    let (width, height) = (raw.size.width as usize, raw.size.height as usize);
    let row = |y: usize| -> &[[u8; N]] {
        let start = y * raw.step;
        let values = width * colours.values();
        data[start..start + values * N].as_chunks().0
    };
    let mut levels = Vec::with_capacity(width * height);
    for y in 0..height {
        let own = row(y);
        let pixels = own.chunks_exact(colours.values());
        match colours {
            Colours::Gray(_) => levels.extend(pixels.map(|p| L::of(value(&p[0])))),
            Colours::Yuv(gray) => levels.extend(pixels.map(|p| L::of(value(&p[gray])))),
            Colours::Rgb(_) => levels
                .extend(pixels.map(|p| L::of(luma([value(&p[0]), value(&p[1]), value(&p[2])])))),
            Colours::Bgr(_) => levels
                .extend(pixels.map(|p| L::of(luma([value(&p[2]), value(&p[1]), value(&p[0])])))),
            Colours::Mosaic(pattern) => {
                // Beyond a border lies what lies before it: a pixel of the same colour.
                let rows = [mirrored(y, -1, height), y, mirrored(y, 1, height)].map(row);
                for x in 0..width {
                    let columns = [mirrored(x, -1, width), x, mirrored(x, 1, width)];
                    let (mut sums, mut counts) = ([0; 3], [0; 3]);
                    for (down, row) in rows.iter().enumerate() {
                        for (right, &column) in columns.iter().enumerate() {
                            let place = ((y + down + 1) % 2) * 2 + (x + right + 1) % 2;
                            let colour = pattern[place];
                            // Of its own colour the pixel itself says all.
                            let is_middle = down == 1 && right == 1;
                            if colour != pattern[(y % 2) * 2 + x % 2] || is_middle {
                                sums[colour] += value(&row[column]);
                                counts[colour] += 1;
                            }
                        }
                    }
                    let colours = [0, 1, 2].map(|colour| {
                        let count: u32 = counts[colour];
                        (sums[colour] + count / 2) / count.max(1)
                    });
                    levels.push(L::of(luma(colours)));
                }
            }
        }
    }
    levels
}

/// The neighbour of a place on a line, mirrored at its ends.
fn mirrored(at: usize, step: isize, length: usize) -> usize {
    let last = length.saturating_sub(1);
    match at.checked_add_signed(step) {
        None => 1.min(last),
        Some(next) if next > last => last.saturating_sub(1),
        Some(next) => next,
    }
}

/// Decodes a JPEG, a PNG or any other picture that files may hold.
fn compressed(bytes: &[u8]) -> Result<(Size, Gray), Why> {
    let unreadable = |error: image::ImageError| error.to_string();
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| error.to_string())?;
    let Some(format) = reader.format() else {
        return Err(match bytes {
            [] => "it is empty".to_owned(),
            _ => "it is compressed in a way that is not known; JPEG and PNG are read".to_owned(),
        });
    };
    let mut limits = Limits::default();
    // The largest image allowed, in 16-bit colour with transparency, and the decoder's own needs.
    limits.max_alloc = Some(MOST_PIXELS * 8 + (64 << 20));
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(unreadable)?;
    let (width, height) = decoder.dimensions();
    if let Some(why) = wrong_size(Size::new(width, height)) {
        return Err(why);
    }
    if format == ImageFormat::Jpeg && !image_file::is_whole_jpeg(bytes) {
        return Err("it ends before its last row".to_owned());
    }
    let colour = decoder.color_type();
    let depth = colour.bytes_per_pixel() / colour.channel_count();
    let turn = decoder.orientation().map_err(unreadable)?;
    let mut image = DynamicImage::from_decoder(decoder).map_err(unreadable)?;
    image.apply_orientation(turn);
    let size = Size::new(image.width(), image.height());
    match depth {
        1 => Ok((size, Gray::Shallow(image.into_luma8().into_raw()))),
        2 => Ok((size, Gray::Deep(image.into_luma16().into_raw()))),
        _ => Err("it has floating-point pixels, and 8 or 16 bit are read".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use std::borrow::Cow;

    const SIZE: Size = Size {
        width: 40,
        height: 34,
    };

    fn of(encoding: &str, step: usize, is_big: bool, data: Vec<u8>) -> Result<(Size, Gray), Why> {
        gray(&Image {
            raw: Some(Raw {
                size: SIZE,
                encoding: encoding.to_owned(),
                is_big,
                step,
            }),
            length: data.len(),
            data: Cow::Owned(data),
            ..Image::default()
        })
    }

    fn level(x: usize, y: usize) -> u8 {
        (x * 5 + y * 3) as u8
    }

    /// Rows of pixels, with three bytes between them.
    fn padded(pixel: impl Fn(usize, usize) -> Vec<u8>) -> (usize, Vec<u8>) {
        let (mut data, mut step) = (Vec::new(), 0);
        for y in 0..SIZE.height as usize {
            let row: Vec<u8> = (0..SIZE.width as usize).flat_map(|x| pixel(x, y)).collect();
            step = row.len() + 3;
            data.extend(row);
            data.extend([0xee; 3]);
        }
        (step, data)
    }

    fn expected() -> Vec<u8> {
        let pixels = (0..SIZE.height as usize)
            .flat_map(|y| (0..SIZE.width as usize).map(move |x| level(x, y)));
        pixels.collect()
    }

    #[test]
    fn every_encoding_gives_the_gray_levels_it_holds() {
        for (name, colours, bytes) in ENCODINGS {
            for is_big in [false, true] {
                let (step, data) = padded(|x, y| {
                    let gray = level(x, y);
                    let values = match colours {
                        Colours::Gray(1) | Colours::Mosaic(_) => vec![gray],
                        Colours::Yuv(0) => vec![gray, 99],
                        Colours::Yuv(_) => vec![99, gray],
                        Colours::Gray(count) | Colours::Rgb(count) | Colours::Bgr(count) => {
                            vec![gray; count]
                        }
                    };
                    let of_value = |value: u8| match (bytes, is_big) {
                        (1, _) => vec![value],
                        (_, true) => vec![0, value],
                        (_, false) => vec![value, 0],
                    };
                    values.into_iter().flat_map(of_value).collect()
                });
                let (size, gray) = of(name, step, is_big, data).unwrap_or_else(|e| panic!("{e}"));
                assert_eq!(size, SIZE);
                let gray = gray.scaled(8);
                // A slope has no other values between its pixels; at the borders it is bent.
                let is_mosaic = matches!(colours, Colours::Mosaic(_));
                for (at, (gray, expected)) in gray.iter().zip(expected()).enumerate() {
                    let (x, y) = (at % 40, at / 40);
                    let is_inside = (1..39).contains(&x) && (1..33).contains(&y);
                    let off = gray.abs_diff(expected);
                    let is_wrapped = !(16..=239).contains(&expected);
                    assert!(
                        off == 0 || is_mosaic && (off <= 1 || !is_inside || is_wrapped),
                        "{name} at {x}, {y}: {gray} is not {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_mosaic_of_one_colour_is_of_that_colour_everywhere() {
        for (name, colours, bytes) in ENCODINGS {
            let Colours::Mosaic(pattern) = colours else {
                continue;
            };
            let (step, data) = padded(|x, y| {
                let value = [200, 100, 50][pattern[(y % 2) * 2 + x % 2]];
                if bytes == 1 {
                    vec![value]
                } else {
                    vec![value, 0]
                }
            });
            let (_, gray) = of(name, step, false, data).unwrap_or_else(|e| panic!("{e}"));
            let expected = luma([200, 100, 50]) as u8;
            assert!(
                gray.scaled(8).iter().all(|&gray| gray == expected),
                "{name}"
            );
        }
    }

    #[test]
    fn what_does_not_hold_its_pixels_is_refused_with_both_numbers() {
        for (name, step, length, expected) in [
            ("32FC1", 160, 5440, "\"32FC1\""),
            (
                "mono8",
                39,
                1360,
                "39 bytes apart, and 40 pixels of mono8 take 40",
            ),
            (
                "rgb8",
                120,
                4000,
                "4000 bytes, and 40x34 pixels of rgb8 take 4080",
            ),
        ] {
            let why = of(name, step, false, vec![0; length]).unwrap_err();
            assert!(why.contains(expected), "{why}");
        }
        assert!(of("mono8", usize::MAX, false, vec![0; 9]).is_err());
    }

    #[test]
    fn bits_in_use_are_those_that_cameras_have() {
        let bits = [0, 255, 256, 1023, 1024, 4095, 4096, 16_383, 16_384, 65_535].map(bits_in_use);
        assert_eq!(bits, [8, 8, 10, 10, 12, 12, 14, 14, 16, 16]);
        let deep = Gray::Deep(vec![0, 2048, 4095, 5000]);
        assert_eq!(deep.scaled(12), [0, 128, 255, 255]);
    }
}
