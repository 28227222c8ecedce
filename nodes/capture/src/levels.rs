//! Gray levels of images that have more than 8 bit, and what of them is used.
//!
//! ```text
//! the first scan's images, and some of the others ─► greatest value, bits that are never set ─► bits in use ─► 8-bit gray
//! ```
//!
//! Cameras of 10, 12 and 14 bit are mostly filed in 16, in the lower ones: scaled by 16 they would be nearly black. How many
//! bits are used is found out once, for all views and the whole run, so that gray levels of all images can be compared. It
//! depends on nothing but the files and is told ([`Found::bits`]), so that whoever opens them again takes the same.

use std::path::Path;

use crate::error::SourceError;
use crate::image_file::{self, Decoded, Depth, Samples, White};

/// Images beyond the first scan's that are looked at, evenly over all, at most.
const OTHERS: usize = 24;
/// Pixels of them, at most: a look should cost no more than a second.
const MOST_PIXELS: usize = 32_000_000;
/// Bits that cameras have, in a file of 16.
const BITS: [u8; 4] = [8, 10, 12, 14];
/// The greatest value from which on something is seen: below it all bits would be taken for noise.
const LEAST: u16 = 64;
/// The lowest bits that, when none of them ever changes, say that a value was shifted up into all 16.
const SHIFTED: u32 = 2;
/// What white may be where pixels are numbers.
const WHITES: [f32; 6] = [1.0, 255.0, 1023.0, 4095.0, 16_383.0, 65_535.0];
/// What is taken for white may be exceeded by so many times: numbers that were interpolated overshoot, and lights outshine.
const OVERSHOOT: f32 = 1.25;
/// Up to here numbers are taken to go from 0 to 1: where white is 255 this is black.
const OF_ONE: f32 = 4.0;
/// Nearly all numbers: what a few lights exceed is no white.
const NEARLY_ALL: f64 = 0.995;
/// Share of white to which numbers may go below 0.
const BELOW: f32 = 0.1;

/// What becomes white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Levels {
    /// Bits in use of images of 16.
    bits: u8,
    /// White of those whose pixels are numbers.
    white: f32,
}

/// What was found out, and what is to be said of it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Found {
    pub(crate) levels: Levels,
    /// Bits in use, where there are images of 16.
    pub(crate) bits: Option<u8>,
    pub(crate) notices: Vec<String>,
}

/// An image as 8-bit gray.
#[derive(Clone, Debug)]
pub(crate) struct Gray {
    pub(crate) pixels: Vec<u8>,
    /// Its greatest value, where that is more than white.
    pub(crate) beyond: Option<f32>,
}

impl Default for Levels {
    fn default() -> Self {
        Self {
            bits: 16,
            white: 1.0,
        }
    }
}

impl Levels {
    /// An image's samples as 8-bit gray; what exceeds white is white.
    pub(crate) fn gray(&self, samples: Samples) -> Gray {
        match samples {
            Samples::Bytes(pixels) => Gray {
                pixels,
                beyond: None,
            },
            Samples::Deep { values, white } => {
                let bits = if white == White::Said { 16 } else { self.bits };
                let is_negative = white == White::IsZero;
                let white = (1u32 << bits) - 1;
                let most = values.iter().copied().max().unwrap_or_default();
                let scaled = |value: u16| (u32::from(value).min(white) * 255 + white / 2) / white;
                let mut pixels: Vec<u8> = values.into_iter().map(|v| scaled(v) as u8).collect();
                if is_negative {
                    pixels.iter_mut().for_each(|gray| *gray = u8::MAX - *gray);
                }
                Gray {
                    pixels,
                    beyond: (u32::from(most) > white).then_some(most.into()),
                }
            }
            Samples::Numbers(values) => {
                let most = values.iter().copied().filter(|v| v.is_finite());
                let most = most.fold(0.0, f32::max);
                // What is no number repeats the one before it, so that no contour comes about that could be matched.
                let mut last = 0.0;
                let scaled = |value: f32| {
                    if value.is_finite() {
                        last = value;
                    }
                    (last / self.white * 255.0).round() as u8
                };
                Gray {
                    pixels: values.into_iter().map(scaled).collect(),
                    beyond: (most > OVERSHOOT * self.white).then_some(most),
                }
            }
        }
    }

    /// What is to be said of an image that goes beyond white.
    pub(crate) fn doubt(&self, path: &Path, scan: Option<u64>, beyond: f32) -> String {
        let file = path.display();
        let scan = scan.map_or(String::new(), |scan| format!(" (scan {scan})"));
        if beyond.fract() == 0.0 && beyond <= 65_535.0 && self.bits < 16 {
            let needs = 32 - (beyond as u32).leading_zeros();
            return format!(
                "{file}{scan} holds up to {beyond}, more than {} bit, which are in use of 16: what is brighter is white, in later images too; set capture.bits={needs}",
                self.bits
            );
        }
        format!(
            "{file}{scan} holds up to {beyond}, more than {}, which is taken for white: what is brighter is white, in later images too",
            self.white
        )
    }
}

/// What is seen of images of 16 bit.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Deep {
    most: u16,
    /// All bits that are ever set, and all that always are.
    ever: u16,
    always: u16,
    /// Whether every value is a byte twice over, as where 8 bit were made 16.
    is_doubled: bool,
    /// Bits that the files themselves call significant.
    said: Option<u8>,
}

impl Deep {
    fn of(values: &[u16]) -> Self {
        Self {
            most: values.iter().copied().max().unwrap_or_default(),
            ever: values.iter().fold(0, |ever, value| ever | value),
            always: values.iter().fold(u16::MAX, |always, value| always & value),
            is_doubled: values.iter().all(|value| value >> 8 == value & 0xff),
            said: None,
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            most: self.most.max(other.most),
            ever: self.ever | other.ever,
            always: self.always & other.always,
            is_doubled: self.is_doubled && other.is_doubled,
            said: self.said.max(other.said),
        }
    }

    /// Whether values fill all 16 bits from the top, whatever camera they are of.
    fn is_shifted(&self) -> bool {
        self.is_doubled || (self.ever ^ self.always).trailing_zeros() >= SHIFTED
    }

    /// Bits in use.
    fn bits(&self) -> u8 {
        let holds = |bits: u8| u32::from(self.most) < 1 << bits;
        if self.is_shifted() {
            return 16;
        }
        // PNG wants significant bits to be the upper ones, and then the lower are copies or nothing; where they are
        // the lower ones, no value is greater than they hold.
        if let Some(said) = self.said.filter(|&said| said >= 8 && holds(said)) {
            return said;
        }
        if self.most < LEAST {
            return 16;
        }
        BITS.into_iter().find(|&bits| holds(bits)).unwrap_or(16)
    }

    /// What is said of it.
    fn notice(&self, bits: u8) -> String {
        let most = self.most;
        match bits {
            16 if most >= 1 << 14 => "16-bit images are scaled to 8 bit".to_owned(),
            16 if most < LEAST => format!(
                "16-bit images are scaled to 8 bit, and hold at most {most} of 65535: they are black, or use fewer bits; set capture.bits"
            ),
            16 => format!(
                "16-bit images are scaled to 8 bit, and hold at most {most} of 65535: their lowest bits say that they are dark, not that fewer bits are used; set capture.bits"
            ),
            bits => format!(
                "16-bit images hold at most {most}: they are taken for {bits} bit and scaled to 8, all alike; set capture.bits (16 where they are only dark)"
            ),
        }
    }
}

/// What is seen of images whose pixels are numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Numbers {
    least: f32,
    /// What nearly all are not above.
    nearly_most: f32,
}

impl Numbers {
    /// `None` where none is a number.
    fn of(values: &[f32]) -> Option<Self> {
        let mut finite: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let last = finite.len().checked_sub(1)?;
        let at = (NEARLY_ALL * last as f64).round() as usize;
        let (_, nearly_most, _) = finite.select_nth_unstable_by(at, f32::total_cmp);
        let nearly_most = *nearly_most;
        let least = finite.into_iter().fold(f32::INFINITY, f32::min);
        Some(Self { least, nearly_most })
    }

    fn and(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            nearly_most: self.nearly_most.max(other.nearly_most),
        }
    }

    /// What is taken for white; `None` where nothing fits.
    fn white(&self) -> Option<f32> {
        let most = self.nearly_most;
        let is_of_one = most > 0.0 && most <= OF_ONE;
        let mut rest = WHITES.into_iter().skip(1);
        let white = match is_of_one {
            true => Some(1.0),
            false => rest.find(|white| most > 0.0 && most <= OVERSHOOT * white),
        };
        white.filter(|white| self.least >= -BELOW * white)
    }
}

/// Finds out what is used of gray levels, from the first scan's images, which are the first of the files, and some others.
pub(crate) fn found(
    files: &[&Path],
    first_scan: usize,
    asked: Option<u8>,
) -> Result<Found, SourceError> {
    let mut found = Found {
        levels: Levels {
            bits: asked.unwrap_or(16),
            ..Levels::default()
        },
        bits: None,
        notices: Vec::new(),
    };
    let (mut deep, mut numbers, mut is_full) = (None::<Deep>, None::<Numbers>, false);
    let mut pixels = 0;
    for (file, must_be) in looked_at(files, first_scan) {
        let is_settled = asked.is_some() || deep.is_some_and(|deep| deep.most >= 1 << 14);
        let enough = |depth| match depth {
            Depth::Bytes => true,
            Depth::Deep => is_settled && deep.is_some(),
            Depth::Numbers => false,
        };
        if !must_be && pixels > MOST_PIXELS {
            break;
        }
        // What is wrong with a later image is said when its turn comes.
        let looked = image_file::head(file).and_then(|head| match enough(head.depth) {
            true => Ok(None),
            false => image_file::decoded(file, None).map(Some),
        });
        let Decoded { size, samples } = match looked {
            Ok(Some(decoded)) => decoded,
            Ok(None) => continue,
            Err(error) if must_be => return Err(error),
            Err(_) => continue,
        };
        if !must_be {
            pixels += size.pixels();
        }
        match samples {
            Samples::Bytes(_) => {}
            Samples::Deep {
                white: White::Said, ..
            } => is_full = true,
            Samples::Deep { values, .. } => {
                let seen = Deep {
                    said: image_file::significant_bits(file),
                    ..Deep::of(&values)
                };
                deep = Some(deep.map_or(seen, |deep| deep.and(seen)));
            }
            Samples::Numbers(values) => {
                let seen = Numbers::of(&values);
                let is_good = |seen: &Numbers| seen.white().is_some();
                if must_be && !seen.as_ref().is_some_and(is_good) {
                    return Err(SourceError::Numbers {
                        path: file.to_owned(),
                        range: seen.map(|seen| [seen.least, seen.nearly_most]),
                    });
                }
                if let Some(seen) = seen.filter(is_good) {
                    numbers = Some(numbers.map_or(seen, |numbers| numbers.and(seen)));
                }
            }
        }
    }
    if let Some(deep) = deep {
        let bits = asked.unwrap_or_else(|| deep.bits());
        found.levels.bits = bits;
        found.bits = Some(bits);
        found.notices.push(match asked {
            Some(bits) => format!(
                "16-bit images are taken for {bits} bit, as capture.bits says, and scaled to 8"
            ),
            None => deep.notice(bits),
        });
    } else if is_full {
        found
            .notices
            .push("16-bit images are scaled to 8 bit".to_owned());
    }
    if let Some(white) = numbers.and_then(|numbers| numbers.white()) {
        found.levels.white = white;
        found.notices.push(format!(
            "images whose pixels are numbers are scaled to 8 bit: 0 is black and {white} is white, in all alike"
        ));
    }
    if asked.is_some() && deep.is_none() {
        found.notices.push(
            "capture.bits says nothing here: it is of 16-bit images that do not say themselves what white is"
                .to_owned(),
        );
    }
    Ok(found)
}

/// The first scan's files, which must be good, and some of the others.
fn looked_at<'a>(
    files: &'a [&'a Path],
    first_scan: usize,
) -> impl Iterator<Item = (&'a Path, bool)> {
    let (first, rest) = files.split_at(first_scan.min(files.len()));
    let apart = rest.len().div_ceil(OTHERS).max(1);
    // The last of every stretch: a camera's first images are its darkest.
    let others = rest.chunks(apart).filter_map(|part| part.last());
    let first = first.iter().map(|file| (*file, true));
    first.chain(others.map(|file| (*file, false)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deep(values: &[u16]) -> Deep {
        Deep::of(values)
    }

    #[test]
    fn the_greatest_value_of_all_says_how_many_bits_are_used() {
        for (most, bits) in [
            (u16::MAX, 16),
            (16_384, 16),
            (16_383, 14),
            (4_096, 14),
            (4_095, 12),
            (1_024, 12),
            (1_023, 10),
            (256, 10),
            (255, 8),
            (64, 8),
        ] {
            assert_eq!(deep(&[3, 1, most]).bits(), bits, "{most}");
        }
    }

    #[test]
    fn the_darkest_images_are_not_made_brighter() {
        assert_eq!(deep(&[3, 1, 63]).bits(), 16);
        assert_eq!(deep(&[0; 9]).bits(), 16);
    }

    #[test]
    fn values_that_were_shifted_up_or_doubled_are_dark_and_not_of_few_bits() {
        let twelve: Vec<u16> = [3u16, 17, 200, 255].map(|value| value << 4).to_vec();
        assert_eq!(deep(&twelve).bits(), 16);
        let eight: Vec<u16> = [3u16, 17, 20].map(|value| value * 257).to_vec();
        assert_eq!(deep(&eight).bits(), 16);
        // Films are filled up so.
        let filled: Vec<u16> = twelve.iter().map(|value| value | 7).collect();
        assert_eq!(deep(&filled).bits(), 16);
        // One image that uses the lowest bits is enough.
        assert_eq!(deep(&twelve).and(deep(&[1001])).bits(), 12);
    }

    #[test]
    fn what_a_file_calls_significant_counts_where_it_can_be_so() {
        let said = |values: &[u16], said| {
            Deep {
                said: Some(said),
                ..Deep::of(values)
            }
            .bits()
        };
        assert_eq!(said(&[7, 200], 12), 12);
        assert_eq!(said(&[7, 900], 11), 11);
        // The upper bits, as PNG wants it.
        assert_eq!(said(&[7 << 4, 200 << 4], 12), 16);
        assert_eq!(said(&[7, 5_000], 12), 14);
    }

    #[test]
    fn white_of_numbers_is_the_least_that_holds_nearly_all() {
        let white = |values: &[f32]| Numbers::of(values).and_then(|numbers| numbers.white());
        for (most, expected) in [
            (0.02, 1.0),
            (1.0, 1.0),
            (1.3, 1.0),
            (90.0, 255.0),
            (256.0, 255.0),
            (1_000.0, 1_023.0),
            (4_095.0, 4_095.0),
            (60_000.0, 65_535.0),
        ] {
            assert_eq!(white(&[0.0, f32::NAN, most]), Some(expected), "{most}");
        }
        // A light among many.
        let mut lit = vec![0.5; 1000];
        lit[7] = 300.0;
        assert_eq!(white(&lit), Some(1.0));
        for bad in [&[f32::NAN; 3][..], &[0.0; 4], &[-1.0, 1.0], &[1e9, 2e9]] {
            assert_eq!(white(bad), None, "{bad:?}");
        }
    }

    #[test]
    fn what_exceeds_white_is_white_and_told() {
        let levels = Levels {
            bits: 10,
            white: 1.0,
        };
        let of = |values: &[u16]| {
            levels.gray(Samples::Deep {
                values: values.to_vec(),
                white: White::Unsaid,
            })
        };
        assert_eq!(of(&[0, 512, 1023]).pixels, [0, 128, 255]);
        assert_eq!(of(&[0, 512, 1023]).beyond, None);
        let gray = of(&[4000, 1023, 65_535]);
        assert_eq!((gray.pixels, gray.beyond), (vec![255; 3], Some(65_535.0)));
        let doubt = levels.doubt(Path::new("a.png"), Some(3), 4000.0);
        assert!(doubt.contains("a.png (scan 3)") && doubt.ends_with("set capture.bits=12"));
        let numbers = levels.gray(Samples::Numbers(vec![-0.1, 0.5, 1.1, f32::NAN]));
        assert_eq!(numbers.pixels, [0, 128, 255, 255]);
    }

    #[test]
    fn the_first_scan_and_some_of_all_others_are_looked_at() {
        let files: Vec<String> = (0..303).map(|n| n.to_string()).collect();
        let files: Vec<&Path> = files.iter().map(Path::new).collect();
        let looked: Vec<_> = looked_at(&files, 3).collect();
        assert!(looked.len() <= 3 + OTHERS && looked.len() > 20);
        assert_eq!(looked.iter().filter(|(_, must_be)| *must_be).count(), 3);
        assert_eq!(looked.last(), Some(&(Path::new("302"), false)));
        assert_eq!(looked_at(&files[..2], 3).count(), 2);
    }
}
