//! Letters in pictures, eight pixels high.

use font8x8::UnicodeFonts as _;
use font8x8::{BASIC_FONTS, GREEK_FONTS, LATIN_FONTS};
use image::{Rgb, RgbImage};

/// Pixels of a letter, along each side.
pub(super) const LETTER: u32 = 8;

/// Writes a line; what does not fit is cut off at the picture's end, and letters that are not known are left blank.
pub(super) fn write(picture: &mut RgbImage, left: u32, top: u32, text: &str, colour: [u8; 3]) {
    for (place, letter) in (0..).zip(text.chars()) {
        let glyph = BASIC_FONTS
            .get(letter)
            .or_else(|| LATIN_FONTS.get(letter))
            .or_else(|| GREEK_FONTS.get(letter));
        for (row, bits) in (0..).zip(glyph.unwrap_or_default()) {
            for column in (0..LETTER).filter(|column| bits >> column & 1 == 1) {
                let (x, y) = (left + place * LETTER + column, top + row);
                if x < picture.width() && y < picture.height() {
                    picture.put_pixel(x, y, Rgb(colour));
                }
            }
        }
    }
}
