//! Files of several pictures: animations, and PNM files one after the other.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use image::ImageFormat;
use image::codecs::webp::WebPDecoder;

/// Whether a file of a format other than TIFF holds another picture behind the first.
pub(super) fn holds_more(path: &Path, format: ImageFormat) -> Option<bool> {
    let mut file = BufReader::new(File::open(path).ok()?);
    match format {
        ImageFormat::Png => {
            let reader = png::Decoder::new(file).read_info().ok()?;
            let animation = reader.info().animation_control();
            Some(animation.is_some_and(|animation| animation.num_frames > 1))
        }
        ImageFormat::WebP => WebPDecoder::new(file).ok().map(|own| own.has_animation()),
        ImageFormat::Pnm => {
            let pixels = binary_pixels(&mut file)?;
            let at = file.stream_position().ok()?.checked_add(pixels)?;
            file.seek(SeekFrom::Start(at)).ok()?;
            let mut behind = Vec::new();
            file.take(64).read_to_end(&mut behind).ok()?;
            let behind = behind.trim_ascii_start();
            Some(matches!(behind, [b'P', b'1'..=b'7', next, ..] if next.is_ascii_whitespace()))
        }
        _ => None,
    }
}

/// Reads the head of a binary PNM, and says how many bytes of pixels follow.
fn binary_pixels(file: &mut impl Read) -> Option<u64> {
    let magic = word(file).ok()?;
    if magic == "P7" {
        return arbitrary_pixels(file);
    }
    let mut number = || word(file).ok()?.parse::<u64>().ok();
    let (width, height) = (number()?, number()?);
    let channels = match magic.as_str() {
        "P4" => return width.div_ceil(8).checked_mul(height),
        "P5" => 1,
        "P6" => 3,
        _ => return None,
    };
    let most = number()?;
    bytes([width, height, channels], most)
}

/// The same of the rest of a head whose lines are named.
fn arbitrary_pixels(file: &mut impl Read) -> Option<u64> {
    let (mut sides, mut most) = ([1u64; 3], None);
    loop {
        let key = word(file).ok()?;
        let mut number = || word(file).ok()?.parse::<u64>().ok();
        match key.as_str() {
            "ENDHDR" => return bytes(sides, most?),
            "WIDTH" => sides[0] = number()?,
            "HEIGHT" => sides[1] = number()?,
            "DEPTH" => sides[2] = number()?,
            "MAXVAL" => most = Some(number()?),
            "" => return None,
            _ => {}
        }
    }
}

/// The bytes of so many values, the greatest of which may be this.
fn bytes(sides: [u64; 3], most: u64) -> Option<u64> {
    let each = if most > 255 { 2 } else { 1 };
    let [width, height, channels] = sides;
    let values = width.checked_mul(height)?.checked_mul(channels)?;
    values.checked_mul(each)
}

/// The next word of a head, with the one space behind it; comments are no words.
fn word(file: &mut impl Read) -> io::Result<String> {
    const LONGEST: usize = 64;
    let (mut word, mut is_comment) = (String::new(), false);
    let mut byte = [0];
    while word.len() < LONGEST && file.read(&mut byte)? > 0 {
        match byte[0] {
            b'\n' if is_comment => is_comment = false,
            _ if is_comment => {}
            b'#' => is_comment = true,
            space if space.is_ascii_whitespace() && word.is_empty() => {}
            space if space.is_ascii_whitespace() => break,
            other => word.push(char::from(other)),
        }
    }
    Ok(word)
}
