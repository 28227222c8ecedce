//! Rectification: views as parallel cameras without distortion would see them.
//!
//! ```text
//! once:  cameras ─► common geometry ─► for every pixel of a rectified view its place in the camera's image
//! scan:  a camera's image ─► rectified view, bilinear, in fixed point
//! ```

use glam::DVec3;
use messages::{Calibration, Size};

use crate::calibration::plausible::{self, Doubt};
use crate::calibration::ros::CameraInfo;
use crate::calibration::{self, Camera, Geometry, Mounted, Why};
use crate::camera_info::Known;
use crate::error::SourceError;
use crate::settings::Settings;

/// Bits of a place between pixels: 256ths, so that a place is right within 0.002 pixels.
const BITS: u32 = 8;
const ONE: u32 = 1 << BITS;
/// Pixels at a time: their corners are fetched one by one, what is computed from them goes through vector registers.
const LANES: usize = 16;

/// Where each pixel of a rectified view comes from in a camera's image of the same size.
#[derive(Clone, Debug)]
pub struct Map {
    size: Size,
    /// Index of the upper left of the four pixels around its place.
    corners: Vec<u32>,
    /// How far beyond it the place is to the right, in 256ths of a pixel.
    right: Vec<u8>,
    /// And how far down.
    down: Vec<u8>,
    outside: usize,
}

impl Map {
    /// The map of images of this size, where `place` says column and row in the camera's image of a rectified column and
    /// row, or that the camera sees nothing there.
    ///
    /// What lies outside the camera's image repeats the nearest pixel of its rectified row: along a row nothing changes
    /// then, so no contour comes about there that could be matched. Of a row that is outside whole, all pixels repeat one of
    /// the nearest row's.
    ///
    /// # Panics
    /// When a side is shorter than two pixels.
    pub fn new(size: Size, place: impl Fn(f64, f64) -> Option<[f64; 2]>) -> Self {
        let (width, height) = (size.width as usize, size.height as usize);
        assert!(width > 1 && height > 1, "two pixels a side, not {size}");
        let last = [width, height].map(|side| (side - 1) as f64);
        let mut corners = vec![0; size.pixels()];
        let (mut right, mut down) = (vec![0; size.pixels()], vec![0; size.pixels()]);
        let mut outside = 0;
        // A pixel of every row that the camera sees, the one nearest to the row's middle.
        let mut seen_in = vec![None; height];
        let mut is_seen = vec![false; width];
        for (y, seen) in seen_in.iter_mut().enumerate() {
            let row = y * width..(y + 1) * width;
            let corners = &mut corners[row.clone()];
            let (right, down) = (&mut right[row.clone()], &mut down[row]);
            for x in 0..width {
                let found = place(x as f64, y as f64);
                let inside =
                    found.filter(|at| (0..2).all(|k| at[k] >= -0.5 && at[k] <= last[k] + 0.5));
                is_seen[x] = inside.is_some();
                if let Some(at) = inside {
                    let [column, row] = [0, 1].map(|k| {
                        // The last place there is lies a 256th before the last pixel.
                        let most = last[k] * f64::from(ONE) - 1.0;
                        (at[k] * f64::from(ONE)).round().clamp(0.0, most) as u32
                    });
                    corners[x] = (row >> BITS) * size.width + (column >> BITS);
                    (right[x], down[x]) = ((column % ONE) as u8, (row % ONE) as u8);
                }
            }
            outside += is_seen.iter().filter(|seen| !**seen).count();
            let near = |x: usize| nearest(&is_seen, x);
            *seen = near(width / 2).map(|x| (corners[x], right[x], down[x]));
            for x in 0..width {
                if let Some(other) = near(x) {
                    corners[x] = corners[other];
                    (right[x], down[x]) = (right[other], down[other]);
                }
            }
        }
        let has_seen: Vec<bool> = seen_in.iter().map(Option::is_some).collect();
        for y in (0..height).filter(|&y| !has_seen[y]) {
            let near = nearest(&has_seen, y).and_then(|near| seen_in[near]);
            let (corner, to_right, to_down) = near.unwrap_or_default();
            let row = y * width..(y + 1) * width;
            corners[row.clone()].fill(corner);
            right[row.clone()].fill(to_right);
            down[row].fill(to_down);
        }
        Self {
            size,
            corners,
            right,
            down,
            outside,
        }
    }

    /// How many pixels lie outside of what the camera sees.
    pub fn outside(&self) -> usize {
        self.outside
    }

    /// Makes the rectified view of a camera's image: both 8-bit gray, row by row. Values between pixels are bilinear,
    /// rounded once.
    ///
    /// # Panics
    /// When an image is not of the map's size.
    pub fn process(&self, source: &[u8], out: &mut [u8]) {
        let count = self.size.pixels();
        assert!(
            source.len() == count && out.len() == count,
            "images of {} pixels",
            self.size
        );
        // Pairs of neighbours above and below; one length lets one check do for all four.
        let pairs = count - self.size.width as usize;
        let (above, below) = (&source[..pairs], &source[count - pairs..]);
        let pair = |row: &[u8], corner: u32| {
            let corner = (corner as usize).min(pairs - 2);
            u16::from_le_bytes([row[corner], row[corner + 1]])
        };
        let (outs, out_rest) = out.as_chunks_mut::<LANES>();
        let (corners, corner_rest) = self.corners.as_chunks::<LANES>();
        let (rights, right_rest) = self.right.as_chunks::<LANES>();
        let (downs, down_rest) = self.down.as_chunks::<LANES>();
        for (((out, corners), right), down) in outs.iter_mut().zip(corners).zip(rights).zip(downs) {
            let (mut uppers, mut lowers) = ([0; LANES], [0; LANES]);
            for lane in 0..LANES {
                uppers[lane] = pair(above, corners[lane]);
                lowers[lane] = pair(below, corners[lane]);
            }
            for lane in 0..LANES {
                out[lane] = between(uppers[lane], lowers[lane], right[lane], down[lane]);
            }
        }
        let rest = corner_rest.iter().zip(right_rest).zip(down_rest);
        for (out, ((&corner, &right), &down)) in out_rest.iter_mut().zip(rest) {
            *out = between(pair(above, corner), pair(below, corner), right, down);
        }
    }
}

/// The value between two pairs of pixels, the left ones in the low bytes, rounded.
#[inline(always)]
fn between(upper: u16, lower: u16, right: u8, down: u8) -> u8 {
    let (right, down) = (u16::from(right), u32::from(down));
    // At most 255 times 256.
    let mix = |pair: u16| u32::from((pair & 255) * (ONE as u16 - right) + (pair >> 8) * right);
    let sum = mix(upper) * (ONE - down) + mix(lower) * down;
    ((sum + (1 << (2 * BITS - 1))) >> (2 * BITS)) as u8
}

/// The place that is set nearest to `at`, the earlier of two.
fn nearest(is_set: &[bool], at: usize) -> Option<usize> {
    if is_set.get(at).copied().unwrap_or_default() {
        return Some(at);
    }
    let before = is_set[..at].iter().rposition(|&set| set);
    let after = is_set[at..].iter().position(|&set| set).map(|far| at + far);
    match (before, after) {
        (Some(before), Some(after)) if after - at < at - before => Some(after),
        (Some(before), _) => Some(before),
        (None, after) => after,
    }
}

/// The maps of all views, and the geometry they lead to.
#[derive(Debug)]
pub(crate) struct Rectifier {
    maps: Vec<Map>,
    geometry: Geometry,
    /// What is to be said of the lenses.
    lenses: String,
    /// What speaks against the numbers.
    doubts: Vec<String>,
    /// Whether focal length and baseline are known and not assumed.
    is_to_scale: bool,
}

impl Rectifier {
    /// The rectifier that the settings ask for, when they do, for `views` views and images of these sizes.
    pub(crate) fn open(
        settings: &Settings,
        views: usize,
        sizes: &[Size],
    ) -> Result<Option<Self>, SourceError> {
        let is_rectified = settings.calibration.is_some() && settings.rectify;
        if settings.raw && !is_rectified {
            return Err(SourceError::NothingRectified);
        }
        match (&settings.calibration, &settings.camera_info) {
            (None, _) if settings.lens.is_some() => Err(SourceError::LensOfNothing),
            (None, _) => Ok(None),
            (Some(files), None) => {
                let read = calibration::read(files, views, sizes, settings.lens)?;
                let mut rectifier =
                    Self::of(&read.mounted, settings, sizes).map_err(|why| {
                        SourceError::CameraInfo {
                            path: files.into(),
                            why,
                        }
                    })?;
                rectifier.is_to_scale = read.is_to_scale;
                Ok(Some(rectifier))
            }
            (Some(_), Some(other)) => Err(SourceError::CameraInfo {
                path: other.into(),
                why: "camera_info is of images that are rectified already and calibration of images as cameras took them; set one of the two".to_owned(),
            }),
        }
    }

    /// Refuses a calibration for a source that is not rectified here, and says why.
    pub(crate) fn refuse(settings: &Settings, why: &str) -> Result<(), SourceError> {
        match &settings.calibration {
            None if settings.raw => Err(SourceError::NothingRectified),
            None if settings.lens.is_some() => Err(SourceError::LensOfNothing),
            None => Ok(()),
            Some(files) => Err(SourceError::CameraInfo {
                path: files.into(),
                why: why.to_owned(),
            }),
        }
    }

    /// The rectifier of images as they were taken, from the messages of their cameras, one a view from left to right.
    ///
    /// # Errors
    /// What is wrong with them, as the second half of a sentence.
    pub(crate) fn of_infos(
        infos: &[CameraInfo],
        settings: &Settings,
        sizes: &[Size],
    ) -> Result<Self, Why> {
        let mounted = calibration::of_infos(infos, infos.len(), sizes, settings.lens)?;
        Self::of(&mounted, settings, sizes)
    }

    /// Works out the maps.
    fn of(mounted: &[Mounted], settings: &Settings, sizes: &[Size]) -> Result<Self, Why> {
        let size = sizes.first().copied().unwrap_or_default();
        let geometry = Geometry::of(mounted, size)?;
        let mut doubts = Vec::new();
        for found in [
            plausible::focal(geometry.calibration.focal_px, size, "the focal length"),
            geometry.doubt().filter(|_| settings.baseline.is_none()),
        ] {
            match found {
                Some(Doubt::Refused(why)) => return Err(why),
                Some(Doubt::Told(why)) => doubts.push(why),
                None => {}
            }
        }
        let Calibration {
            focal_px, cx, cy, ..
        } = geometry.calibration;
        let map = |(camera, turn): (&Camera, _)| {
            Map::new(size, |x, y| {
                let ray = DVec3::new((x - cx) / focal_px, (y - cy) / focal_px, 1.0);
                camera.place(turn * ray).map(|place| place.to_array())
            })
        };
        let cameras = mounted.iter().map(|one| &one.camera);
        let maps = cameras
            .zip(geometry.turns.iter().copied())
            .map(map)
            .collect();
        Ok(Self {
            maps,
            lenses: lenses(mounted),
            geometry,
            doubts,
            is_to_scale: true,
        })
    }

    /// What is known of the rectified views.
    pub(crate) fn known(&self) -> Known {
        let Calibration {
            focal_px,
            cx,
            cy,
            baseline_m,
            ..
        } = self.geometry.calibration;
        if !self.is_to_scale {
            return Known::default();
        }
        Known {
            focal_px: Some(focal_px),
            cx: Some(cx),
            cy: Some(cy),
            // One camera has none by itself.
            baseline_m: (self.maps.len() > 1).then_some(baseline_m),
            is_distorted: false,
        }
    }

    /// Adds what the user should be told once, and what makes results less than they could be.
    pub(crate) fn remark(&self, notices: &mut Vec<String>, warnings: &mut Vec<String>) {
        notices.push(self.lenses.clone());
        self.geometry.remark(notices, warnings);
        warnings.extend_from_slice(&self.doubts);
        for (view, map) in self.maps.iter().enumerate() {
            let part = map.outside() as f64 / map.size.pixels() as f64;
            if map.outside() > 0 {
                warnings.push(format!(
                    "{} pixels of view {view} ({:.1} %) lie outside of what its camera saw, and repeat the nearest of their row",
                    map.outside(),
                    part * 100.0
                ));
            }
        }
    }
}

/// The models that lenses were taken for.
fn lenses(mounted: &[Mounted]) -> String {
    let named = |one: &Mounted| format!("{}: {}", one.name, one.lens);
    match mounted {
        [first, rest @ ..] if rest.iter().all(|one| one.lens == first.lens) => {
            let names: Vec<&str> = mounted.iter().map(|one| one.name.as_str()).collect();
            format!("the lens model of {} is {}", names.join(", "), first.lens)
        }
        all => {
            let all: Vec<String> = all.iter().map(named).collect();
            format!("lens models are of {}", all.join("; of "))
        }
    }
}

/// Makes the image of a view from what its camera took: rectified, where it is to be.
pub(crate) fn show(rectifier: Option<&Rectifier>, view: usize, taken: &[u8], out: &mut [u8]) {
    match rectifier {
        Some(rectifier) => rectifier.maps[view].process(taken, out),
        None => out.copy_from_slice(taken),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(size: Size) -> Vec<u8> {
        let value = |i: usize| (i * 37 % 251 + i / 97 % 5) as u8;
        (0..size.pixels()).map(value).collect()
    }

    /// The slow twin: bilinear in floating point, straight from the places.
    fn slow(size: Size, source: &[u8], place: impl Fn(f64, f64) -> [f64; 2]) -> Vec<f64> {
        let (width, height) = (size.width as usize, size.height as usize);
        let pixels = (0..size.pixels()).map(|i| ((i % width) as f64, (i / width) as f64));
        pixels
            .map(|(x, y)| {
                let [u, v] = place(x, y);
                let u = u.clamp(0.0, (width - 1) as f64);
                let v = v.clamp(0.0, (height - 1) as f64);
                let (column, row) = ((u as usize).min(width - 2), (v as usize).min(height - 2));
                let (right, down) = (u - column as f64, v - row as f64);
                let at = |i: usize, j: usize| f64::from(source[(row + j) * width + column + i]);
                (at(0, 0) * (1.0 - right) + at(1, 0) * right) * (1.0 - down)
                    + (at(0, 1) * (1.0 - right) + at(1, 1) * right) * down
            })
            .collect()
    }

    #[test]
    fn it_gives_what_plain_bilinear_sampling_gives() {
        let size = Size::new(83, 61);
        let place = |x: f64, y: f64| {
            [
                4.0 + 0.9 * x + 0.03 * y,
                3.0 - 0.02 * x + 0.88 * y + 1e-4 * x * y,
            ]
        };
        let map = Map::new(size, |x, y| Some(place(x, y)));
        assert_eq!(map.outside(), 0);
        let source = picture(size);
        let mut out = vec![0; size.pixels()];
        map.process(&source, &mut out);
        for (out, slow) in out.iter().zip(slow(size, &source, place)) {
            // Places are rounded to 256ths: neighbours that differ by 255 give up to one gray level.
            assert!((f64::from(*out) - slow).abs() <= 1.6, "{out} is not {slow}");
        }
    }

    #[test]
    fn a_map_that_moves_nothing_changes_nothing_but_the_last_row_and_column() {
        let size = Size::new(40, 33);
        let map = Map::new(size, |x, y| Some([x, y]));
        let source = picture(size);
        let mut out = vec![0; size.pixels()];
        map.process(&source, &mut out);
        for (i, (out, source)) in out.iter().zip(&source).enumerate() {
            let is_last = i % 40 == 39 || i / 40 == 32;
            let off = out.abs_diff(*source);
            assert!(
                off == 0 || (is_last && off <= 1),
                "{i}: {out} is not {source}"
            );
        }
    }

    #[test]
    fn outside_the_image_nothing_changes_along_a_row() {
        let size = Size::new(40, 32);
        // Eight columns at the left and five whole rows on top are not seen.
        let map = Map::new(size, |x, y| Some([x - 8.0, y - 5.0]));
        assert_eq!(map.outside(), 40 * 5 + 27 * 8);
        let mut out = vec![0; size.pixels()];
        map.process(&picture(size), &mut out);
        for row in out.chunks(40) {
            assert!(row[..9].iter().all(|value| *value == row[8]), "{row:?}");
        }
        assert!(out[..200].iter().all(|value| *value == out[0]));
    }
}
