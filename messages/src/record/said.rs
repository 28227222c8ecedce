//! What messages say of the rig themselves: enough to read a recording whose metadata were left out.

use std::collections::BTreeMap;

use super::schema::{CLOUD_HEIGHT, CLOUD_WIDTH};
use super::wire::{Fields, Value};
use crate::header::Size;

/// What a `foxglove.CameraCalibration` says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSaid {
    /// The image's size.
    pub size: Size,
    /// Focal length in pixels.
    pub focal_px: f64,
    /// Column of the principal point in pixels.
    pub cx: f64,
    /// Row of the principal point in pixels.
    pub cy: f64,
    /// Where the camera stands along the baseline, in metres.
    pub place_m: f64,
}

impl CameraSaid {
    /// Of a message; `None` where it is damaged or says less.
    pub fn of(calibration: &[u8]) -> Option<Self> {
        let (mut k, mut p) = (Vec::new(), Vec::new());
        for field in Fields::new(calibration) {
            match field.ok()? {
                (6, value) => k = doubles(value)?,
                (8, value) => p = doubles(value)?,
                _ => {}
            }
        }
        let [focal_px, _, cx, _, _, cy, ..] = *k.as_slice() else {
            return None;
        };
        // Minus nothing is nothing.
        let shift = *p.get(3)?;
        let place_m = if shift == 0.0 { 0.0 } else { -shift / focal_px };
        Some(Self {
            size: size_said("foxglove.CameraCalibration", calibration)?,
            focal_px,
            cx,
            cy,
            place_m,
        })
    }
}

/// The size of the image that a message of this schema is of.
pub fn size_said(schema: &str, message: &[u8]) -> Option<Size> {
    let (width, height) = match schema {
        "foxglove.CameraCalibration" | "foxglove.RawImage" => (2, 3),
        "foxglove.PointCloud" => (CLOUD_WIDTH, CLOUD_HEIGHT),
        _ if schema.starts_with("tricurve.") => (3, 4),
        _ => return None,
    };
    let mut size = Size::default();
    for field in Fields::new(message) {
        match field.ok()? {
            (number, value) if number == width => size.width = value.fixed32().ok()?,
            (number, value) if number == height => size.height = value.fixed32().ok()?,
            _ => {}
        }
    }
    (size.width > 0 && size.height > 0).then_some(size)
}

/// The frame that an image or a cloud of points is in.
pub fn frame_said(schema: &str, message: &[u8]) -> Option<String> {
    let frame = match schema {
        "foxglove.RawImage" => 7,
        "foxglove.PointCloud" => 2,
        _ => return None,
    };
    let text = Fields::new(message).find_map(|field| match field {
        Ok((number, Value::Bytes(text))) if number == frame => Some(text),
        _ => None,
    });
    String::from_utf8(text?.to_vec()).ok()
}

/// Where the frames of a `foxglove.FrameTransforms` stand to the right of their parents, in metres.
pub fn places_said(transforms: &[u8]) -> BTreeMap<String, f64> {
    let place = |transform: Value<'_>| {
        let (mut child, mut right) = (String::new(), 0.0);
        for field in Fields::new(transform.bytes().ok()?) {
            match field.ok()? {
                (3, value) => child = String::from_utf8(value.bytes().ok()?.to_vec()).ok()?,
                // To the right is −y of the rig.
                (4, vector) => right = 0.0 - super::scene::second(vector.bytes().ok()?),
                _ => {}
            }
        }
        Some((child, right))
    };
    let transforms = Fields::new(transforms).filter_map(|field| match field {
        Ok((1, transform)) => place(transform),
        _ => None,
    });
    transforms.collect()
}

/// Packed doubles.
fn doubles(value: Value<'_>) -> Option<Vec<f64>> {
    let (numbers, rest) = value.bytes().ok()?.as_chunks();
    rest.is_empty().then(|| {
        numbers
            .iter()
            .map(|bytes| f64::from_le_bytes(*bytes))
            .collect()
    })
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::header::Sway;
    use crate::record::Codec;
    use crate::{Calibration, Rig};

    #[test]
    fn what_is_written_of_cameras_and_places_is_what_is_read() {
        let size = Size::new(64, 48);
        let camera = Calibration {
            focal_px: 600.25,
            cx: 31.5,
            cy: 20.125,
            baseline_m: 0.07,
            calibrated: true,
        };
        let rig = Rig {
            calibration: Some(camera),
            ..Rig::of_views(3, &[8.0], size)
        };
        let codec = Codec::new(rig, 0);
        for (view, place) in [0.0, 0.07, 0.14].into_iter().enumerate() {
            let mut message = Vec::new();
            codec.calibration(view, 1, size, 0.0, &mut message);
            let said = CameraSaid::of(&message).unwrap();
            assert_eq!((said.size, said.focal_px), (size, 600.25));
            assert_eq!((said.cx, said.cy), (31.5, 20.125));
            assert!((said.place_m - place).abs() < 1e-12, "{said:?}");
            assert_eq!(CameraSaid::of(&message[..9]), None);
        }
        let mut message = Vec::new();
        codec.transforms(1, size, 0.0, &Sway::default(), &mut message);
        let places = places_said(&message);
        assert_eq!(places["left_optical"], 0.0);
        assert_eq!(places["right_optical"], 0.14);
    }
}
