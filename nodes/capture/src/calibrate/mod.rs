//! Calibration: what cameras are like and where they stand, from images of a board that is held before them.
//!
//! ```text
//! folder ─► Shots ─► Board::find, each image ─► Sightings ─► calibrate ─► Calibrated ─► Kalibr's camchain
//! ```
//!
//! Each camera is worked out by itself first, by Zhang's method (*A flexible new technique for camera calibration*, 2000);
//! then all together with where they stand, so that what all saw at one time has one place. Corners, and whole sightings,
//! that do not fit are left out; sightings are named, corners counted.

mod board;
mod fit;
mod picture;
mod shots;
mod solve;
mod start;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use glam::{DMat3, DVec2};
use messages::Size;

pub use board::{Board, Sighting};
pub use fit::calibrate;
pub use shots::{Shot, Shots};

use crate::error::SourceError;
use crate::image_file;
use crate::layout::Piece;
use crate::levels::{self, Levels};
use solve::Pose;

/// Sightings of a camera that tell enough.
const ENOUGH_SIGHTINGS: usize = 10;
/// The part of a camera's images, or corners, that do not fit from which on that is told.
const MANY_MISFITS: f64 = 0.05;
/// Parts of its width and height that a picture is divided into to see how much of it corners cover.
const CELLS: [u32; 2] = [8, 6];
/// The part of a picture that corners should cover.
const COVERED: f64 = 0.6;
/// Focal lengths that are less sure than this part of themselves are told, or refused.
const UNSURE: [f64; 2] = [0.005, 0.05];

/// What a lens does, as Kalibr names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// Radial and tangential distortion, k1, k2, p1, p2: OpenCV's and ROS's `plumb_bob`.
    Radtan,
    /// A fisheye, k1 to k4.
    Equidistant,
}

impl Model {
    /// Kalibr's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Radtan => "radtan",
            Self::Equidistant => "equidistant",
        }
    }

    /// The other one.
    pub fn other(self) -> Self {
        match self {
            Self::Radtan => Self::Equidistant,
            Self::Equidistant => Self::Radtan,
        }
    }
}

/// What an image shows of the board, or why that is nothing.
pub type Look = Result<Sighting, String>;

/// What was seen of the board: sightings by shot, then by camera; why an image has none.
#[derive(Clone, Debug)]
pub struct Observed<'a> {
    /// Who took what.
    pub shots: &'a Shots,
    /// Of each shot, of each camera: `None` where it took no image.
    pub found: Vec<Vec<Option<Look>>>,
}

/// A value and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sure {
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// What a camera is like.
#[derive(Clone, Debug)]
pub struct Found {
    /// Its name.
    pub name: String,
    /// The size of its images.
    pub size: Size,
    /// Images of the board that were used, of so many that it took.
    pub used: [usize; 2],
    /// Corners that were used, of so many that were found in those images.
    pub corners: [usize; 2],
    /// Focal lengths along columns and rows, in pixels.
    pub focal: [Sure; 2],
    /// Column and row of the principal point, in pixels; the middle of the first pixel is at 0.
    pub centre: [Sure; 2],
    /// The coefficients of its lens.
    pub lens: [Sure; 4],
    /// Pixels between where corners are seen and where they ought to be: root mean square, median, 95th percentile.
    pub rms_px: f64,
    /// The median.
    pub median_px: f64,
    /// The 95th percentile.
    pub p95_px: f64,
    /// Where corners are seen, and by how much farther right and lower they ought to be.
    pub misses: Vec<[DVec2; 2]>,
}

/// How a camera stands beside the one before it.
#[derive(Clone, Debug)]
pub struct Beside {
    /// The two cameras' names.
    pub between: [String; 2],
    /// Metres between them.
    pub apart_m: f64,
    /// The angle between their axes, in degrees.
    pub turned_degrees: f64,
    /// Shots in which both saw the board.
    pub together: usize,
    /// Rows between where they see the same corners when they are rectified: median and 95th percentile, in pixels.
    pub rows_px: Option<[f64; 2]>,
}

/// An image that was not used.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// The camera's name.
    pub camera: String,
    /// The shot's.
    pub shot: String,
    /// Why.
    pub why: String,
    /// Whether the board was found, but not where it ought to be.
    pub is_misfit: bool,
}

/// What was found out.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The kind of lens.
    pub model: Model,
    /// The cameras, left to right.
    pub cameras: Vec<Found>,
    /// How each but the first stands beside the one before it.
    pub beside: Vec<Beside>,
    /// Images that were not used, in order.
    pub left_out: Vec<LeftOut>,
    /// What makes it less than it could be, in sentences.
    pub warnings: Vec<String>,
    /// What the rectified views will be like.
    pub notices: Vec<String>,
    mounts: Vec<Pose>,
}

/// Reads images as 8-bit gray: those of 16 bit are scaled by the bits in use, all of them alike.
#[derive(Clone, Copy, Debug)]
pub struct Reader {
    levels: Levels,
}

impl Reader {
    /// Looks at some of these images; what is wrong with one is said when it is read.
    pub fn new(files: &[&Path]) -> Self {
        let found = levels::found(files, 0, None);
        Self {
            levels: found.map_or(Levels::default(), |found| found.levels),
        }
    }

    /// Reads an image: its size and its pixels, row by row.
    ///
    /// # Errors
    /// A file that cannot be read or is no such image.
    pub fn read(&self, piece: &Piece) -> Result<(Size, Vec<u8>), SourceError> {
        let (size, gray) = image_file::pixels(&piece.path, &self.levels, None)?;
        match piece.part {
            Some(part) => Ok((part.size(&piece.path, size)?, part.of(size, &gray.pixels))),
            None => Ok((size, gray.pixels)),
        }
    }
}

impl Found {
    /// The part of the picture that corners cover.
    pub fn covered(&self) -> f64 {
        let all = CELLS[0] * CELLS[1];
        1.0 - self.empty_cells().count() as f64 / f64::from(all)
    }

    /// Cells of the picture in which no corner was seen, row by row.
    fn empty_cells(&self) -> impl Iterator<Item = u32> {
        let [columns, rows] = CELLS;
        let part = |at: f64, side: u32, cells: u32| {
            let most = f64::from(cells) - 1.0;
            ((at + 0.5) / f64::from(side) * f64::from(cells)).clamp(0.0, most) as u32
        };
        let cell = |[at, _]: &[DVec2; 2]| {
            part(at.y, self.size.height, rows) * columns + part(at.x, self.size.width, columns)
        };
        let seen: BTreeSet<u32> = self.misses.iter().map(cell).collect();
        (0..columns * rows).filter(move |cell| !seen.contains(cell))
    }

    /// Whether it can be used, and what makes it less than it could be.
    fn check(&self, warnings: &mut Vec<String>) -> Result<(), String> {
        let name = &self.name;
        let unsure = self.focal.map(|focal| focal.std / focal.value.abs());
        let unsure = unsure[0].max(unsure[1]);
        if unsure.is_nan() || unsure > UNSURE[1] || self.focal.iter().any(|f| f.value <= 0.0) {
            return Err(format!(
                "{} ({name}: {:.0} ± {:.0} px)",
                unclear(),
                self.focal[0].value,
                self.focal[0].std
            ));
        }
        if unsure > UNSURE[0] {
            warnings.push(format!(
                "the focal length of {name} is known to {:.1} % only: tilt the board more, by 30° and more to all sides",
                unsure * 100.0
            ));
        }
        let sides = [self.size.width, self.size.height].map(f64::from);
        let is_far = |(centre, side): (&Sure, f64)| !(0.25..0.75).contains(&(centre.value / side));
        if self.centre.iter().zip(sides).any(is_far) {
            warnings.push(format!(
                "the principal point of {name} lies at {:.0}, {:.0}, far from the middle: hold the board into all corners, and tilt it more",
                self.centre[0].value, self.centre[1].value
            ));
        }
        if self.used[0] < ENOUGH_SIGHTINGS {
            warnings.push(format!(
                "{name} saw the board in {} images only; {ENOUGH_SIGHTINGS} to 30 are usual",
                self.used[0]
            ));
        }
        let covered = self.covered();
        if covered < COVERED {
            warnings.push(format!(
                "corners cover {:.0} % of what {name} sees, and elsewhere its lens is guessed: hold the board into the corners too",
                covered * 100.0
            ));
        }
        let [kept, found] = self.corners;
        if ((found - kept.min(found)) as f64) > MANY_MISFITS * found as f64 {
            warnings.push(format!(
                "of {found} corners that {name} saw {} are blurred or do not fit: is the board flat, did all stand still, were zoom and focus the same in all images?",
                found - kept.min(found)
            ));
        }
        if self.rms_px > 1.0 {
            warnings.push(format!(
                "corners of {name} miss by {:.1} px: is the board flat, is --model right, did it stand still?",
                self.rms_px
            ));
        }
        Ok(())
    }
}

fn unclear() -> String {
    "the images do not tell the focal length: tilt the board by 30° and more to all sides, in 10 images or more"
        .to_owned()
}

impl Calibrated {
    /// Corners of all cameras that were used.
    pub fn corners(&self) -> usize {
        self.cameras.iter().map(|camera| camera.corners[0]).sum()
    }

    /// Pixels that the corners of all cameras miss by, root mean square.
    pub fn rms_px(&self) -> f64 {
        let square = |camera: &Found| camera.rms_px.powi(2) * camera.corners[0] as f64;
        let squares: f64 = self.cameras.iter().map(square).sum();
        (squares / self.corners().max(1) as f64).sqrt()
    }

    /// The cameras as Kalibr's camchain, which `capture.calibration` reads; `remarks` stand above them.
    pub fn to_kalibr(&self, remarks: &[String]) -> String {
        let mut text = String::new();
        let mut line = |line: String| writeln!(text, "{line}").unwrap_or_default();
        for remark in remarks {
            line(format!("# {remark}"));
        }
        let list = |values: &mut dyn Iterator<Item = f64>| {
            let values: Vec<String> = values.map(|value| format!("{value:?}")).collect();
            format!("[{}]", values.join(", "))
        };
        for (number, camera) in self.cameras.iter().enumerate() {
            line(format!("cam{number}:  # {}", camera.name));
            line("  camera_model: pinhole".to_owned());
            let numbers = camera.focal.iter().chain(&camera.centre);
            line(format!(
                "  intrinsics: {}",
                list(&mut numbers.map(|sure| sure.value))
            ));
            line(format!("  distortion_model: {}", self.model.name()));
            let lens = list(&mut camera.lens.iter().map(|sure| sure.value));
            line(format!("  distortion_coeffs: {lens}"));
            let Size { width, height } = camera.size;
            line(format!("  resolution: [{width}, {height}]"));
            if number > 0 {
                let step = self.mounts[number].after(self.mounts[number - 1].inverse());
                let turn = DMat3::from_quat(step.turn);
                line("  T_cn_cnm1:".to_owned());
                for row in 0..3 {
                    let values = turn.row(row).to_array().into_iter();
                    line(format!(
                        "  - {}",
                        list(&mut values.chain([step.shift[row]]))
                    ));
                }
                line("  - [0.0, 0.0, 0.0, 1.0]".to_owned());
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::{DQuat, DVec3};

    use super::*;
    use crate::layout::Layout;

    const SIZE: Size = Size::new(640, 480);

    /// Noise of a twentieth of a pixel, the same always.
    fn noise(seed: &mut u64) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            sum += (*seed >> 11) as f64 / (1_u64 << 53) as f64;
        }
        0.05 * sum
    }

    /// What three cameras 60 mm apart see of a board held at these distances, tilted to all sides.
    fn observed(board: &Board, far_m: &[f64], seed: u64) -> (Shots, Vec<Vec<Option<Look>>>) {
        let mut seed = seed;
        let lens = [-0.2, 0.06, 0.0005, -0.0008];
        let numbers = |c: f64| {
            [
                600.0 + c,
                601.0 + c,
                318.0 + c,
                242.0 - c,
                lens[0],
                lens[1],
                lens[2],
                lens[3],
            ]
        };
        let cameras = [0.0, 1.0, 2.0].map(|c| solve::camera(Model::Radtan, SIZE, &numbers(c)));
        let part = |i: usize, way: f64| (i as f64 * way).rem_euclid(1.0) * 2.0 - 1.0;
        let mut found = Vec::new();
        for (i, far) in far_m.iter().enumerate() {
            let turn = DQuat::from_rotation_y(0.6 * part(i, 0.4142))
                * DQuat::from_rotation_x(0.6 * part(i, 0.2361));
            let at = DVec3::new(
                0.06 + 0.2 * far * part(i, 0.7549),
                0.15 * far * part(i, 0.5698),
                *far,
            );
            let mut shot = Vec::new();
            for (view, camera) in cameras.iter().enumerate() {
                let mut corners = BTreeMap::new();
                for corner in (0..9).flat_map(|u| (0..6).map(move |v| [u, v])) {
                    let middle = board.place([8, 5]) / 2.0;
                    let point =
                        turn * (board.place(corner) - middle) + at - DVec3::X * 0.06 * view as f64;
                    if let Some(place) = camera.place(point) {
                        corners.insert(
                            corner,
                            place + DVec2::new(noise(&mut seed), noise(&mut seed)),
                        );
                    }
                }
                let found = corners.len();
                shot.push(Some(Ok(Sighting { corners, found })));
            }
            found.push(shot);
        }
        let shots = Shots {
            cameras: ["left", "centre", "right"].map(str::to_owned).to_vec(),
            shots: (0..far_m.len())
                .map(|i| Shot {
                    name: i.to_string(),
                    images: vec![Some(std::path::PathBuf::from("x").into()); 3],
                })
                .collect(),
            sizes: vec![SIZE; 3],
            layout: Layout::Cameras,
            is_by_order: false,
            left_out: Vec::new(),
            ignored: 0,
        };
        (shots, found)
    }

    fn board() -> Board {
        Board::chessboard([9, 6], 0.027).unwrap_or_else(|why| unreachable!("{why}"))
    }

    fn calibrated(board: &Board, shots: &Shots, found: Vec<Vec<Option<Look>>>) -> Calibrated {
        let observed = Observed { shots, found };
        calibrate(board, Model::Radtan, &observed).unwrap_or_else(|why| unreachable!("{why}"))
    }

    #[test]
    fn near_boards_are_kept_however_roughly_cameras_are_known_at_first() {
        let board = board();
        for seed in 1..7 {
            let far: Vec<f64> = (0..24)
                .map(|i| {
                    if i % 6 == 0 {
                        0.42
                    } else {
                        1.0 + 0.06 * f64::from(i)
                    }
                })
                .collect();
            let (shots, found) = observed(&board, &far, seed);
            let calibrated = calibrated(&board, &shots, found);
            assert_eq!(calibrated.left_out, [], "{seed}");
            let steps: Vec<f64> = calibrated
                .beside
                .iter()
                .map(|beside| beside.apart_m)
                .collect();
            assert!(
                steps.iter().all(|step| (step - 0.06).abs() < 2e-4),
                "{steps:?}"
            );
        }
    }

    #[test]
    fn a_sighting_that_no_board_explains_is_left_out_and_named_and_the_rest_is_used() {
        let board = board();
        let far: Vec<f64> = (0..16).map(|i| 0.5 + 0.03 * f64::from(i)).collect();
        let (shots, mut found) = observed(&board, &far, 3);
        // Corners numbered at random.
        let Some(Ok(sighting)) = &mut found[4][1] else {
            unreachable!("it is seen")
        };
        let places: Vec<DVec2> = sighting.corners.values().copied().collect();
        for (index, place) in sighting.corners.values_mut().enumerate() {
            *place = places[(index * 23 + 7) % places.len()];
        }
        let calibrated = calibrated(&board, &shots, found);
        let named: Vec<(&str, &str)> = calibrated
            .left_out
            .iter()
            .map(|out| (out.camera.as_str(), out.shot.as_str()))
            .collect();
        assert_eq!(named, [("centre", "4")], "{:?}", calibrated.left_out);
        assert!((calibrated.cameras[1].focal[0].value - 601.0).abs() < 1.0);
    }

    #[test]
    fn corners_that_are_not_where_they_belong_are_left_out_and_counted() {
        let board = board();
        let far: Vec<f64> = (0..16).map(|i| 0.5 + 0.03 * f64::from(i)).collect();
        let (shots, mut found) = observed(&board, &far, 5);
        for shot in found.iter_mut().take(5) {
            let Some(Ok(sighting)) = &mut shot[1] else {
                unreachable!("it is seen")
            };
            if let Some(place) = sighting.corners.get_mut(&[3, 2]) {
                *place += DVec2::new(0.9, -0.7);
            }
        }
        let calibrated = calibrated(&board, &shots, found);
        let [left, centre, _] = &*calibrated.cameras else {
            unreachable!("there are three")
        };
        let all = 16 * 9 * 6;
        assert_eq!((left.corners, centre.corners), ([all, all], [all - 5, all]));
        assert_eq!(calibrated.left_out, []);
    }

    #[test]
    fn standard_deviations_say_how_far_off_values_are() {
        let board = board();
        let far: Vec<f64> = (0..14).map(|i| 0.45 + 0.03 * f64::from(i)).collect();
        let mut squares = Vec::new();
        for seed in 1..13 {
            let (shots, found) = observed(&board, &far, seed * 977);
            let calibrated = calibrated(&board, &shots, found);
            for (camera, truth) in calibrated.cameras.iter().zip([600.0, 601.0, 602.0]) {
                let focal = camera.focal[0];
                squares.push(((focal.value - truth) / focal.std).powi(2));
            }
        }
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!((0.6..1.5).contains(&rms), "{rms}");
    }
}
