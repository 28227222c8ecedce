//! Whether a JPEG is there to its last row: decoders fill in gray for what is missing.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader};

/// Bytes that are put behind data that ends without a mark: many times what a block takes.
const FILLER: usize = 512;

/// Whether a JPEG's data goes on to its end mark, or lacks nothing but that.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    // Segments, each with its length, up to the first scan's data; thumbnails are inside them.
    let mut at = 2;
    while let Some(&[0xff, kind, high, low]) = bytes.get(at..at + 4) {
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
        if kind == 0xda {
            break;
        }
    }
    let data = bytes.get(at..).unwrap_or_default();
    data.windows(2).any(|pair| pair == [0xff, 0xd9]) || (!data.is_empty() && lacks_no_row(bytes))
}

/// Whether the picture is the same whatever follows: then no row waits for more.
fn lacks_no_row(bytes: &[u8]) -> bool {
    let kept = bytes.iter().rposition(|&byte| byte != 0xff);
    let kept = &bytes[..kept.map_or(0, |last| last + 1)];
    let followed_by = |filler: u8| -> Option<DynamicImage> {
        let mut whole = kept.to_vec();
        whole.resize(kept.len() + FILLER, filler);
        whole.extend([0xff, 0xd9]);
        let reader = ImageReader::with_format(Cursor::new(whole), ImageFormat::Jpeg);
        reader.decode().ok()
    };
    match (followed_by(0x00), followed_by(0x5a)) {
        (Some(one), Some(other)) => one == other,
        _ => false,
    }
}
