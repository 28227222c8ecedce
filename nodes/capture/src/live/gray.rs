//! Pictures as cameras send them, as 8-bit gray.

use messages::Size;

/// How a picture's pixels lie in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    not(feature = "v4l"),
    allow(dead_code, reason = "what other cameras send is made gray on the way")
)]
pub(crate) enum Layout {
    /// A byte a pixel.
    Gray,
    /// Two bytes a pixel, the lower first, of which so many bits count: 9 to 16.
    Deep(u32),
    /// Two pixels in four bytes: gray, blue, gray, red.
    Yuyv,
    /// Two pixels in four bytes: blue, gray, red, gray.
    Uyvy,
    /// Red, green, blue.
    Rgb,
    /// Blue, green, red.
    Bgr,
}

impl Layout {
    /// Bytes of a pixel.
    fn bytes(self) -> usize {
        match self {
            Self::Gray => 1,
            Self::Deep(_) | Self::Yuyv | Self::Uyvy => 2,
            Self::Rgb | Self::Bgr => 3,
        }
    }

    /// What is done to it, to be said once.
    #[cfg_attr(not(feature = "v4l"), allow(dead_code, reason = "as above"))]
    pub(crate) fn notice(self) -> Option<String> {
        match self {
            Self::Gray => None,
            Self::Deep(bits) => Some(format!("{bits}-bit pixels are scaled to 8 bit")),
            Self::Yuyv | Self::Uyvy | Self::Rgb | Self::Bgr => {
                Some("colour is converted to gray".to_owned())
            }
        }
    }
}

/// A picture as a camera sent it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Picture<'a> {
    /// When it was taken, in nanoseconds since 1970.
    pub(crate) nanos: u64,
    /// Where, in metres along a rail; NaN where that is not said.
    pub(crate) position_m: f64,
    pub(crate) size: Size,
    pub(crate) layout: Layout,
    /// Bytes from one row to the next.
    pub(crate) stride: usize,
    pub(crate) bytes: &'a [u8],
}

impl Picture<'_> {
    /// Its pixels, row by row; `None` when it holds fewer bytes than its size needs.
    pub(crate) fn gray(&self) -> Option<Vec<u8>> {
        let (width, height) = (self.size.width as usize, self.size.height as usize);
        let row = width * self.layout.bytes();
        let last = self.stride.checked_mul(height.checked_sub(1)?)?;
        if self.stride < row || self.bytes.len() < last + row {
            return None;
        }
        let mut gray = Vec::with_capacity(width * height);
        for start in (0..height).map(|y| y * self.stride) {
            let row = &self.bytes[start..start + row];
            match self.layout {
                Layout::Gray => gray.extend_from_slice(row),
                Layout::Deep(bits) => {
                    gray.extend(row.as_chunks().0.iter().map(|&p| shallow(p, bits)))
                }
                Layout::Yuyv => gray.extend(row.iter().step_by(2)),
                Layout::Uyvy => gray.extend(row.iter().skip(1).step_by(2)),
                Layout::Rgb => {
                    gray.extend(row.as_chunks().0.iter().map(|&[r, g, b]| luma(r, g, b)))
                }
                Layout::Bgr => {
                    gray.extend(row.as_chunks().0.iter().map(|&[b, g, r]| luma(r, g, b)))
                }
            }
        }
        Some(gray)
    }
}

/// The nearest of 256 gray levels.
fn shallow(pixel: [u8; 2], bits: u32) -> u8 {
    let most = (1u32 << bits) - 1;
    let value = u32::from(u16::from_le_bytes(pixel)).min(most);
    ((value * 255 + most / 2) / most) as u8
}

/// Rec. 709, as colour images in files are converted.
fn luma(red: u8, green: u8, blue: u8) -> u8 {
    let [red, green, blue] = [red, green, blue].map(u32::from);
    ((2126 * red + 7152 * green + 722 * blue) / 10_000) as u8
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn gray(layout: Layout, stride: usize, bytes: &[u8]) -> Option<Vec<u8>> {
        let picture = Picture {
            nanos: 0,
            position_m: f64::NAN,
            size: Size::new(2, 2),
            layout,
            stride,
            bytes,
        };
        picture.gray()
    }

    #[test]
    fn every_layout_gives_the_gray_levels_it_holds() {
        let cases: [(Layout, &[u8], [u8; 4]); 6] = [
            (Layout::Gray, &[1, 2, 3, 4], [1, 2, 3, 4]),
            (Layout::Yuyv, &[1, 128, 2, 128, 3, 0, 4, 0], [1, 2, 3, 4]),
            (Layout::Uyvy, &[128, 1, 128, 2, 0, 3, 0, 4], [1, 2, 3, 4]),
            (
                Layout::Deep(10),
                &[0, 0, 0xff, 3, 0, 2, 4, 0],
                [0, 255, 128, 1],
            ),
            (
                Layout::Rgb,
                &[255, 255, 255, 255, 0, 0, 0, 255, 0, 0, 0, 255],
                [255, 54, 182, 18],
            ),
            (
                Layout::Bgr,
                &[255, 255, 255, 0, 0, 255, 0, 255, 0, 255, 0, 0],
                [255, 54, 182, 18],
            ),
        ];
        for (layout, bytes, expected) in cases {
            let stride = bytes.len() / 2;
            assert_eq!(gray(layout, stride, bytes).unwrap(), expected, "{layout:?}");
        }
    }

    #[test]
    fn every_depth_reaches_from_black_to_white_in_even_steps() {
        for bits in 9..=16 {
            let most = (1u64 << bits) - 1;
            for value in 0..=most {
                let exact = value as f64 * 255.0 / most as f64;
                let pixel = (value as u16).to_le_bytes();
                assert!((f64::from(shallow(pixel, bits)) - exact).abs() <= 0.5);
            }
            // Bits that should not be set make no wrong picture.
            assert_eq!(shallow([0xff, 0xff], bits), 255);
        }
    }

    #[test]
    fn rows_may_be_padded_and_the_last_one_need_not_be() {
        assert_eq!(
            gray(Layout::Gray, 3, &[1, 2, 99, 3, 4]).unwrap(),
            [1, 2, 3, 4]
        );
        assert_eq!(gray(Layout::Gray, 3, &[1, 2, 99, 3]), None);
        assert_eq!(gray(Layout::Yuyv, 3, &[0; 100]), None);
    }
}
