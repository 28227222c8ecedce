//! Calibration: what cameras are like and where they stand, from images of a board that is held before them.
//!
//! ```text
//! folder ─► Shots ─► Board::find, each image ─► Sightings ─► calibrate ─► Calibrated ─► Kalibr's camchain
//! ```
//!
//! Each camera is worked out by itself first, by Zhang's method (*A flexible new technique for camera calibration*, 2000);
//! then all together with where they stand, so that what all saw at one time has one place. Corners, and whole sightings,
//! that do not fit are left out, and named.

mod board;
mod picture;
mod shots;
mod solve;
mod start;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use glam::{DMat3, DVec2, DVec3};
use messages::Size;

pub use board::{Board, Sighting};
pub use shots::{Shot, Shots};

use crate::calibration::{Camera, Geometry, Mount, Mounted};
use crate::error::SourceError;
use crate::image_file;
use solve::{Estimate, INTRINSIC, Pose, Seen, Task};

/// Sightings of a camera that can tell anything.
const LEAST_SIGHTINGS: usize = 3;
/// Sightings of a camera that tell enough.
const ENOUGH_SIGHTINGS: usize = 10;
/// Standard deviations from where a corner belongs beyond which it is a mistake, and pixels within which it never is.
const MISTAKEN: (f64, f64) = (6.0, 0.3);
/// How many times farther off than most a sighting is that does not belong, and pixels within which it does.
const STRANGE: (f64, f64) = (4.0, 0.6);
/// The part of a sighting's corners that must fit.
const LEAST_FITTING: f64 = 0.5;
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
    /// Corners that were used.
    pub corners: usize,
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

/// What is used of all that was seen, and what it amounts to.
struct Fit<'a> {
    board: &'a Board,
    model: Model,
    shots: &'a Shots,
    /// By shot, then camera.
    used: Vec<Vec<Option<Sighting>>>,
    estimate: Estimate,
    left_out: Vec<LeftOut>,
}

/// Reads an image as 8-bit gray: its size and its pixels, row by row.
///
/// # Errors
/// A file that cannot be read or is no such image.
pub fn read(path: &Path) -> Result<(Size, Vec<u8>), SourceError> {
    image_file::pixels(path, None)
}

/// Works out the cameras.
///
/// # Errors
/// Too little seen, or nothing that explains it, in a sentence that says what to do.
pub fn calibrate(
    board: &Board,
    model: Model,
    observed: &Observed<'_>,
) -> Result<Calibrated, String> {
    let mut fit = Fit::begin(board, model, observed);
    fit.check()?;
    let (intrinsics, places) = fit.alone()?;
    fit.together(intrinsics, places)?;
    // What does not fit drags the rest with it, so the worst is taken out first. It ends: every round takes something.
    loop {
        let task = fit.seen();
        fit.estimate = fit.task(&task).solve(fit.estimate.clone());
        if !fit.drop_misfits() {
            return fit.report();
        }
        fit.check()?;
    }
}

impl<'a> Fit<'a> {
    fn begin(board: &'a Board, model: Model, observed: &Observed<'a>) -> Self {
        let shots = observed.shots;
        let mut left_out = Vec::new();
        let mut used = Vec::with_capacity(observed.found.len());
        for (shot, found) in shots.shots.iter().zip(&observed.found) {
            let each = found.iter().zip(&shots.cameras).map(|(found, camera)| {
                match found {
                    Some(Ok(sighting)) => return Some(sighting.clone()),
                    Some(Err(why)) => left_out.push(LeftOut {
                        camera: camera.clone(),
                        shot: shot.name.clone(),
                        why: why.clone(),
                    }),
                    None => {}
                }
                None
            });
            used.push(each.collect());
        }
        Self {
            board,
            model,
            shots,
            used,
            estimate: Estimate {
                intrinsics: Vec::new(),
                mounts: Vec::new(),
                boards: vec![Pose::NONE; shots.shots.len()],
            },
            left_out,
        }
    }

    /// Whether every camera saw enough.
    fn check(&self) -> Result<(), String> {
        for (camera, name) in self.shots.cameras.iter().enumerate() {
            let sightings = self.used.iter().filter(|of| of[camera].is_some()).count();
            if sightings < LEAST_SIGHTINGS {
                let taken = self.shots.shots.iter();
                let taken = taken.filter(|shot| shot.images[camera].is_some()).count();
                let first = self.left_out.iter().find(|out| out.camera == *name);
                let why =
                    first.map_or(String::new(), |out| format!(" ({}: {})", out.shot, out.why));
                return Err(format!(
                    "the board of {} is to be used in {sightings} of {taken} images of {name}{why}, and at least {LEAST_SIGHTINGS}, better {ENOUGH_SIGHTINGS} or more, are needed: is --board right, and is the whole board in the picture?",
                    self.board.describe()
                ));
            }
        }
        Ok(())
    }

    /// Each camera by itself: its numbers, and by shot where the board was in its frame.
    #[expect(clippy::type_complexity, reason = "two lists, one a camera")]
    fn alone(&self) -> Result<(Vec<[f64; INTRINSIC]>, Vec<Vec<Option<Pose>>>), String> {
        let mut all = (Vec::new(), Vec::new());
        for (camera, name) in self.shots.cameras.iter().enumerate() {
            let size = self.shots.sizes[camera];
            let own: Vec<&Sighting> = self
                .used
                .iter()
                .filter_map(|of| of[camera].as_ref())
                .collect();
            let (numbers, places) =
                start::alone(self.model, size, self.board, &own).ok_or_else(|| {
                    format!(
                        "no focal length explains what {name} saw of the board: is --model right?"
                    )
                })?;
            let mut places = places.into_iter();
            let by_shot = self.used.iter();
            let by_shot = by_shot.map(|of| of[camera].as_ref().and_then(|_| places.next()));
            all.0.push(numbers);
            all.1.push(by_shot.collect());
        }
        Ok(all)
    }

    /// Which way up each camera saw the board, where they stand, and where the board was.
    fn together(
        &mut self,
        intrinsics: Vec<[f64; INTRINSIC]>,
        mut places: Vec<Vec<Option<Pose>>>,
    ) -> Result<(), String> {
        let ways = self.board.ways();
        for (shot, used) in self.used.iter_mut().enumerate() {
            let Some(first) = places.iter().find_map(|of| of[shot]) else {
                continue;
            };
            for (camera, sighting) in used.iter_mut().enumerate() {
                let (Some(sighting), Some(place)) = (sighting, &mut places[camera][shot]) else {
                    continue;
                };
                // Cameras in a row look the same way: the one that turns least between them is the board's.
                let renamed = ways.iter().map(|&way| {
                    let renamed = self.board.renamed(*place, way);
                    (renamed.turn.angle_between(first.turn), way, renamed)
                });
                if let Some((_, way, renamed)) = renamed.min_by(|a, b| a.0.total_cmp(&b.0)) {
                    *sighting = self.board.renumbered(sighting, way);
                    *place = renamed;
                }
            }
        }
        let mounts = start::mounts(&places).map_err(|camera| {
            format!(
                "{} saw the board at no time when another camera did: where it stands is not known; hold the board where neighbours see it together, and give images of one time one name or number",
                self.shots.cameras[camera]
            )
        })?;
        // By the camera that saw most of it.
        for (shot, board) in self.estimate.boards.iter_mut().enumerate() {
            let seen = self.used[shot].iter().enumerate();
            let seen = seen.filter_map(|(camera, own)| Some((own.as_ref()?.count(), camera)));
            if let Some((_, camera)) =
                seen.max_by_key(|&(count, camera)| (count, usize::MAX - camera))
                && let Some(place) = places[camera][shot]
            {
                *board = mounts[camera].inverse().after(place);
            }
        }
        self.estimate.intrinsics = intrinsics;
        self.estimate.mounts = mounts;
        // Shots that were not taken at one time would pull the cameras apart.
        while self.drop_strange() {}
        self.check()
    }

    /// All corners in use.
    fn seen(&self) -> Vec<Seen> {
        let mut seen = Vec::new();
        for (shot, used) in self.used.iter().enumerate() {
            for (camera, sighting) in used.iter().enumerate() {
                let corners = sighting.iter().flat_map(|own| &own.corners);
                seen.extend(corners.map(|(&corner, &at)| Seen {
                    camera,
                    shot,
                    point: self.board.place(corner),
                    at,
                }));
            }
        }
        seen
    }

    fn task<'b>(&'b self, seen: &'b [Seen]) -> Task<'b> {
        Task {
            model: self.model,
            sizes: &self.shots.sizes,
            seen,
            free: [true; INTRINSIC],
        }
    }

    /// Takes out a sighting that is much farther off than most, the worst; says whether there was one.
    fn drop_strange(&mut self) -> bool {
        let seen = self.seen();
        let misses = self.task(&seen).misses(&self.estimate);
        let mut sums: Vec<Vec<(f64, usize)>> =
            vec![vec![(0.0, 0); self.shots.cameras.len()]; self.used.len()];
        for (one, miss) in seen.iter().zip(misses) {
            let (sum, count) = &mut sums[one.shot][one.camera];
            *sum += miss.map_or(f64::INFINITY, DVec2::length_squared);
            *count += 1;
        }
        let mut each = Vec::new();
        for (shot, of) in sums.iter().enumerate() {
            for (camera, &(sum, count)) in of.iter().enumerate().filter(|(_, of)| of.1 > 0) {
                each.push(((sum / count as f64).sqrt(), shot, camera));
            }
        }
        each.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (Some(&(usual, ..)), Some(&(worst, shot, camera))) =
            (each.get(each.len() / 2), each.last())
        else {
            return false;
        };
        let is_strange = worst > STRANGE.1 && worst > STRANGE.0 * usual;
        if is_strange {
            let others = self.used[shot].iter().flatten().count() > 1;
            let hint = match others {
                true => ": was it taken at the same time as the others?",
                false => "",
            };
            self.leave_out(
                shot,
                camera,
                format!("its corners miss by {worst:.1} px{hint}"),
            );
        }
        is_strange
    }

    fn leave_out(&mut self, shot: usize, camera: usize, why: String) {
        self.used[shot][camera] = None;
        self.left_out.push(LeftOut {
            camera: self.shots.cameras[camera].clone(),
            shot: self.shots.shots[shot].name.clone(),
            why,
        });
    }

    /// Takes out what does not fit; says whether there was anything.
    fn drop_misfits(&mut self) -> bool {
        if self.drop_strange() {
            return true;
        }
        let seen = self.seen();
        let misses = self.task(&seen).misses(&self.estimate);
        let far: Vec<f64> = misses
            .into_iter()
            .map(|miss| miss.map_or(f64::INFINITY, DVec2::length))
            .collect();
        // The median of distances in a plane is 1.18 standard deviations along either axis.
        let most = (MISTAKEN.0 * quantile(&far, 0.5) / 1.177).max(MISTAKEN.1);
        let mut has_any = false;
        let mut next = far.into_iter();
        let mut poor = Vec::new();
        for (shot, used) in self.used.iter_mut().enumerate() {
            for (camera, sighting) in used.iter_mut().enumerate() {
                let Some(sighting) = sighting else { continue };
                let before = sighting.count();
                sighting
                    .corners
                    .retain(|_, _| next.next().is_some_and(|far| far <= most));
                has_any |= sighting.count() < before;
                if (sighting.count() as f64) < LEAST_FITTING * before as f64 {
                    poor.push((shot, camera, before - sighting.count(), before));
                }
            }
        }
        for (shot, camera, off, of) in poor {
            self.leave_out(
                shot,
                camera,
                format!("{off} of its {of} corners do not fit"),
            );
        }
        has_any
    }

    fn report(mut self) -> Result<Calibrated, String> {
        let seen = self.seen();
        let estimate = &self.estimate;
        let task = self.task(&seen);
        let sure = task.sure(estimate).ok_or_else(unclear)?;
        let misses = task.misses(estimate);
        let mut warnings = Vec::new();
        let mut cameras = Vec::new();
        for (camera, name) in self.shots.cameras.iter().enumerate() {
            let own = seen.iter().zip(&misses);
            let own = own.filter(|(seen, _)| seen.camera == camera);
            let own: Vec<[DVec2; 2]> = own
                .filter_map(|(seen, miss)| Some([seen.at, (*miss)?]))
                .collect();
            let used = self.used.iter().filter(|of| of[camera].is_some()).count();
            let taken = self.shots.shots.iter();
            let taken = taken.filter(|shot| shot.images[camera].is_some()).count();
            let numbers = &estimate.intrinsics[camera];
            let of = |index: usize| Sure {
                value: numbers[index],
                std: sure[camera][index],
            };
            let far: Vec<f64> = own.iter().map(|[_, miss]| miss.length()).collect();
            let squares: f64 = far.iter().map(|far| far * far).sum();
            let found = Found {
                name: name.clone(),
                size: self.shots.sizes[camera],
                used: [used, taken],
                corners: own.len(),
                focal: [of(0), of(1)],
                centre: [of(2), of(3)],
                lens: [of(4), of(5), of(6), of(7)],
                rms_px: (squares / own.len().max(1) as f64).sqrt(),
                median_px: quantile(&far, 0.5),
                p95_px: quantile(&far, 0.95),
                misses: own,
            };
            found.check(&mut warnings)?;
            cameras.push(found);
        }
        let mut notices = Vec::new();
        let geometry = self.geometry(&mut notices, &mut warnings);
        let beside = (1..cameras.len())
            .map(|camera| self.beside(camera, geometry.as_ref()))
            .collect();
        let order = |out: &LeftOut| {
            let shot = self.shots.shots.iter().position(|s| s.name == out.shot);
            let camera = self.shots.cameras.iter().position(|c| *c == out.camera);
            (shot, camera)
        };
        self.left_out.sort_by_key(order);
        Ok(Calibrated {
            model: self.model,
            cameras,
            beside,
            left_out: self.left_out,
            warnings,
            notices,
            mounts: self.estimate.mounts,
        })
    }

    /// What the cameras are rectified to, where that can be.
    fn geometry(&self, notices: &mut Vec<String>, warnings: &mut Vec<String>) -> Option<Geometry> {
        let (sizes, estimate) = (&self.shots.sizes, &self.estimate);
        if sizes.iter().any(|size| *size != sizes[0]) {
            warnings
                .push("the cameras' images differ in size, and such are not matched".to_owned());
            return None;
        }
        let each = self.shots.cameras.iter().enumerate();
        let mounted: Vec<Mounted> = each
            .map(|(camera, name)| Mounted {
                name: name.clone(),
                camera: solve::camera(self.model, sizes[camera], &estimate.intrinsics[camera]),
                mount: Mount::from_first(
                    DMat3::from_quat(estimate.mounts[camera].turn),
                    estimate.mounts[camera].shift,
                ),
            })
            .collect();
        match Geometry::of(&mounted, sizes[0]) {
            Ok(geometry) => {
                geometry.remark(notices, warnings);
                Some(geometry)
            }
            Err(why) => {
                warnings.push(format!(
                    "these cameras cannot be rectified to views of one row: {why}"
                ));
                None
            }
        }
    }

    fn beside(&self, camera: usize, geometry: Option<&Geometry>) -> Beside {
        let pair = [camera - 1, camera];
        let [before, own] = pair.map(|camera| self.estimate.mounts[camera]);
        let step = own.after(before.inverse());
        let both = self.used.iter();
        let both: Vec<[&Sighting; 2]> = both
            .filter_map(|of| Some([of[camera - 1].as_ref()?, of[camera].as_ref()?]))
            .collect();
        let rows = geometry.map(|geometry| {
            let cameras = pair.map(|camera| {
                solve::camera(
                    self.model,
                    self.shots.sizes[camera],
                    &self.estimate.intrinsics[camera],
                )
            });
            let row = |side: usize, at: DVec2| {
                let ray = geometry.turns[pair[side]].transpose() * direction(&cameras[side], at)?;
                Some(ray.y / ray.z * geometry.calibration.focal_px)
            };
            let corners = both.iter().flat_map(|[a, b]| {
                let shared = a.corners.iter();
                shared.filter_map(|(corner, &at)| Some([at, *b.corners.get(corner)?]))
            });
            let off = corners.filter_map(|[a, b]| Some((row(0, a)? - row(1, b)?).abs()));
            let off: Vec<f64> = off.collect();
            [0.5, 0.95].map(|share| quantile(&off, share))
        });
        Beside {
            between: pair.map(|camera| self.shots.cameras[camera].clone()),
            apart_m: step.shift.length(),
            turned_degrees: (step.turn * DVec3::Z).angle_between(DVec3::Z).to_degrees(),
            together: both.len(),
            rows_px: rows,
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

/// The direction in which a camera sees a place of its image: by Newton's method, from the middle.
fn direction(camera: &Camera, at: DVec2) -> Option<DVec3> {
    let mut ideal = DVec2::ZERO;
    const STEP: f64 = 1e-6;
    for _ in 0..50 {
        let of = |ideal: DVec2| camera.place(ideal.extend(1.0));
        let off = of(ideal)? - at;
        let across = (of(ideal + DVec2::X * STEP)? - of(ideal - DVec2::X * STEP)?) / (2.0 * STEP);
        let down = (of(ideal + DVec2::Y * STEP)? - of(ideal - DVec2::Y * STEP)?) / (2.0 * STEP);
        let determinant = across.x * down.y - across.y * down.x;
        let by = DVec2::new(
            down.y * off.x - down.x * off.y,
            across.x * off.y - across.y * off.x,
        ) / determinant;
        // Not beyond what the lens's model holds for.
        ideal -= by.clamp_length_max(0.3);
        if by.length() < 1e-10 {
            return Some(ideal.extend(1.0));
        }
    }
    None
}

/// The value that this share of all is below; 0 of none.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    sorted
        .get((share * last as f64).round() as usize)
        .copied()
        .unwrap_or_default()
}

impl Calibrated {
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
