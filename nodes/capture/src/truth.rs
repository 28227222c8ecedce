//! Ground truth: what a perfect result would be.

use std::path::PathBuf;

use messages::Size;

use crate::error::SourceError;
use crate::image_file;

/// A file of true disparities.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TruthFile {
    pub(crate) path: PathBuf,
    pub(crate) encoding: Encoding,
}

/// How disparities per step are written down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Encoding {
    /// A 16-bit gray picture of 256 times the disparity, 0 where unknown.
    Deep,
    /// An 8-bit gray picture; what a gray level is worth, 0 where unknown.
    Gray { per_value: f32 },
    /// A portable float map of the disparity itself, not finite where unknown.
    Pfm,
}

impl TruthFile {
    /// The disparities per step, NaN where unknown.
    pub(crate) fn read(&self) -> Result<(Size, Vec<f32>), SourceError> {
        let wrong = |why: &str| SourceError::GroundTruth {
            path: self.path.clone(),
            why: why.to_owned(),
        };
        let known = |value: f32, per_value: f32| match value {
            0.0 => f32::NAN,
            value => value * per_value,
        };
        match self.encoding {
            Encoding::Deep => {
                let (size, values) = image_file::deep_pixels(&self.path)?.ok_or_else(|| {
                    wrong("it must be 16-bit gray, 256 times the disparity per step")
                })?;
                let values = values.into_iter().map(|v| known(v.into(), 1.0 / 256.0));
                Ok((size, values.collect()))
            }
            Encoding::Gray { per_value } => {
                let (size, values) = image_file::gray_pixels(&self.path)?
                    .ok_or_else(|| wrong("it must be an 8-bit gray picture"))?;
                let values = values.into_iter().map(|v| known(v.into(), per_value));
                Ok((size, values.collect()))
            }
            Encoding::Pfm => {
                let bytes = std::fs::read(&self.path).map_err(SourceError::io(&self.path))?;
                pfm(&bytes).ok_or_else(|| wrong("it must be a gray portable float map (Pf)"))
            }
        }
    }
}

/// Reads a gray portable float map, whose rows go from bottom to top.
fn pfm(bytes: &[u8]) -> Option<(Size, Vec<f32>)> {
    let mut rest = bytes;
    let mut word = || {
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let after = &rest[start..];
        let end = after.iter().position(u8::is_ascii_whitespace)?;
        // One white space ends the head.
        rest = &after[end + 1..];
        std::str::from_utf8(&after[..end]).ok()
    };
    if word()? != "Pf" {
        return None;
    }
    let (width, height) = (word()?.parse().ok()?, word()?.parse().ok()?);
    let scale: f32 = word()?.parse().ok()?;
    let size = Size::new(width, height);
    let (values, _) = rest.as_chunks::<4>();
    if values.len() != size.pixels() || values.is_empty() {
        return None;
    }
    // A negative scale says that the lowest byte comes first.
    let value = |bytes: &[u8; 4]| match scale < 0.0 {
        true => f32::from_le_bytes(*bytes),
        false => f32::from_be_bytes(*bytes),
    };
    let rows = values.chunks(size.width as usize).rev().flatten();
    let known = |v: f32| if v.is_finite() { v } else { f32::NAN };
    Some((size, rows.map(|bytes| known(value(bytes))).collect()))
}

/// The true disparities of one view, and which of its points all chosen views see.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Size of the view.
    pub size: Size,
    /// Pixels between neighbouring chosen views, row by row; NaN where unknown.
    pub disparity: Vec<f32>,
    /// Whether all chosen views see the point of this pixel; false where the disparity is unknown.
    pub visible: Vec<bool>,
}

impl Truth {
    /// Truth from disparities alone, seen in chosen view `view` of `views`: a point is hidden where it leaves the
    /// picture or where one of smaller depth lands within half a pixel of it.
    pub(crate) fn from_disparity(
        size: Size,
        disparity: Vec<f32>,
        view: usize,
        views: usize,
    ) -> Self {
        let width = size.width as usize;
        let mut visible: Vec<bool> = disparity.iter().map(|d| !d.is_nan()).collect();
        let mut nearest = vec![f32::NEG_INFINITY; width];
        for (row, visible) in disparity.chunks(width).zip(visible.chunks_mut(width)) {
            for steps in (0..views)
                .filter(|&other| other != view)
                .map(|other| other as f32 - view as f32)
            {
                let land = |x: usize, disparity: f32| {
                    let column = (x as f32 - steps * disparity).round();
                    (0.0..width as f32)
                        .contains(&column)
                        .then_some(column as usize)
                };
                nearest.fill(f32::NEG_INFINITY);
                for (x, &disparity) in row.iter().enumerate() {
                    if let Some(column) = land(x, disparity) {
                        nearest[column] = nearest[column].max(disparity);
                    }
                }
                for (x, (&disparity, visible)) in row.iter().zip(&mut *visible).enumerate() {
                    // Points of one surface may share a column.
                    *visible &=
                        land(x, disparity).is_some_and(|column| disparity > nearest[column] - 1.0);
                }
            }
        }
        Self {
            size,
            disparity,
            visible,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_near_strip_hides_what_lies_behind_it_in_the_other_views() {
        // Ground at disparity 1, and at columns 10 to 13 a strip at disparity 5.
        let size = Size::new(32, 1);
        let strip = 10..14;
        let disparity = (0..32)
            .map(|x| if strip.contains(&x) { 5.0 } else { 1.0 })
            .collect();
        let truth = Truth::from_disparity(size, disparity, 0, 3);
        let hidden: Vec<usize> = (0..32).filter(|&x| !truth.visible[x]).collect();
        // In view 1 the strip lands on columns 5 to 8, where ground from 6 to 9 lands; in view 2 on 0 to 3, where
        // ground from 2 to 5 lands. Ground columns 0 and 1 leave the picture.
        assert_eq!(hidden, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    }

    #[test]
    fn unknown_points_are_not_visible() {
        let truth = Truth::from_disparity(Size::new(3, 1), vec![0.0, f32::NAN, 0.0], 1, 3);
        assert_eq!(truth.visible, [true, false, true]);
    }
}
