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
mod picture;
mod shots;
mod solve;
mod start;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use glam::{DMat3, DVec2, DVec3};
use messages::Size;

pub use board::{Board, Sighting};
pub use shots::{Folders, Layout, Shot, Shots};

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
/// The same before all are solved together: near boards show most how roughly cameras are known until then.
const STRANGE_AT_FIRST: (f64, f64) = (8.0, 3.0);
/// The part of a camera's images, or corners, that do not fit from which on that is told.
const MANY_MISFITS: f64 = 0.05;
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
    fit.check()?;
    fit.together(intrinsics, places)?;
    // What does not fit drags the rest with it, so the worst is taken out first. It ends: every round takes something.
    loop {
        let task = fit.seen();
        fit.estimate = fit.task(&task).solve(fit.estimate.clone());
        if !fit.drop_misfits() {
            return fit.report();
        }
        fit.check()?;
        fit.check_together()?;
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
                        is_misfit: false,
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

    /// Whether every camera saw the board together with others often enough to say where it stands.
    fn check_together(&self) -> Result<(), String> {
        for (camera, name) in self.shots.cameras.iter().enumerate().skip(1) {
            let both = |of: &&Vec<Option<Sighting>>| {
                of[camera].is_some() && of.iter().flatten().count() > 1
            };
            let together = self.used.iter().filter(both).count();
            if together < LEAST_SIGHTINGS {
                return Err(self.misfit(name, together, self.taken(camera)));
            }
        }
        Ok(())
    }

    fn misfit(&self, name: &str, fitting: usize, taken: usize) -> String {
        format!(
            "what {name} saw of the board fits what others saw in {fitting} of {taken} images only, and at least {LEAST_SIGHTINGS} are needed: images of one time must have one name or number, and cameras must not move against each other"
        )
    }

    /// How many images a camera took.
    fn taken(&self, camera: usize) -> usize {
        let shots = self.shots.shots.iter();
        shots.filter(|shot| shot.images[camera].is_some()).count()
    }

    /// Whether every camera saw enough.
    fn check(&self) -> Result<(), String> {
        for (camera, name) in self.shots.cameras.iter().enumerate() {
            let sightings = self.used.iter().filter(|of| of[camera].is_some()).count();
            if sightings < LEAST_SIGHTINGS {
                let taken = self.taken(camera);
                if taken < LEAST_SIGHTINGS {
                    return Err(format!(
                        "{name} took {taken} images, and at least {LEAST_SIGHTINGS}, better {ENOUGH_SIGHTINGS} or more, are needed"
                    ));
                }
                let out = self.left_out.iter().filter(|out| out.camera == *name);
                if out.clone().filter(|out| out.is_misfit).count() >= LEAST_SIGHTINGS {
                    return Err(self.misfit(name, sightings, taken));
                }
                // The reason that most have.
                let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
                out.for_each(|out| *reasons.entry(&out.why).or_default() += 1);
                let usual = reasons.into_iter().max_by_key(|(_, count)| *count);
                let usual = usual.map_or(String::new(), |(why, count)| {
                    format!(" (in {count}: {why})")
                });
                return Err(format!(
                    "the board of {} is to be used in {sightings} of {taken} images of {name}{usual}, and at least {LEAST_SIGHTINGS}, better {ENOUGH_SIGHTINGS} or more, are needed: {}",
                    self.board.describe(),
                    self.board.doubt()
                ));
            }
        }
        Ok(())
    }

    /// Each camera by itself: its numbers, and by shot where the board was in its frame.
    #[expect(clippy::type_complexity, reason = "two lists, one a camera")]
    fn alone(&mut self) -> Result<(Vec<[f64; INTRINSIC]>, Vec<Vec<Option<Pose>>>), String> {
        let mut all = (Vec::new(), Vec::new());
        for (camera, name) in self.shots.cameras.iter().enumerate() {
            let size = self.shots.sizes[camera];
            let own: Vec<&Sighting> = self
                .used
                .iter()
                .filter_map(|of| of[camera].as_ref())
                .collect();
            let found = start::alone(self.model, size, self.board, &own, LEAST_SIGHTINGS);
            let (numbers, places) = found.ok_or_else(|| {
                format!("no focal length explains what {name} saw of the board: is --model right?")
            })?;
            let mut places = places.into_iter();
            let by_shot = self.used.iter();
            let by_shot: Vec<Option<Pose>> = by_shot
                .map(|of| of[camera].as_ref().and_then(|_| places.next().flatten()))
                .collect();
            let unexplained = (0..by_shot.len()).filter(|&shot| by_shot[shot].is_none());
            let unexplained: Vec<usize> = unexplained
                .filter(|&shot| self.used[shot][camera].is_some())
                .collect();
            for shot in unexplained {
                self.leave_out(
                    shot,
                    camera,
                    "no place of the board explains its corners".to_owned(),
                );
            }
            all.0.push(numbers);
            all.1.push(by_shot);
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
        let mounts = start::mounts(&places).map_err(|apart| {
            let names = |is_apart: bool| {
                let cameras = self.shots.cameras.iter().enumerate();
                let these = cameras.filter(|(camera, _)| apart.contains(camera) == is_apart);
                these.map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(", ")
            };
            format!(
                "{} never saw the board together with {}: how they stand to each other is not known; hold the board where neighbours see it together, and give images of one time one name or number",
                names(true),
                names(false)
            )
        })?;
        self.estimate.intrinsics = intrinsics;
        self.estimate.mounts = mounts;
        // By the camera whose word fits what all saw best.
        for shot in 0..self.used.len() {
            let seen: Vec<Seen> = self.seen_in(shot).collect();
            let said = places.iter().zip(&self.estimate.mounts);
            let said = said.filter_map(|(of, mount)| Some(mount.inverse().after(of[shot]?)));
            let miss = |board: Pose| {
                let mut estimate = self.estimate.clone();
                estimate.boards[shot] = board;
                (self.task(&seen).cost(&estimate), board)
            };
            let best = said.map(miss).min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, board)) = best {
                self.estimate.boards[shot] = board;
            }
        }
        // Shots that were not taken at one time would pull the cameras apart. How these stand is only roughly known.
        while self.drop_strange(STRANGE_AT_FIRST) {}
        self.check()?;
        self.check_together()
    }

    /// All corners in use.
    fn seen(&self) -> Vec<Seen> {
        (0..self.used.len())
            .flat_map(|shot| self.seen_in(shot))
            .collect()
    }

    /// The corners in use of one shot.
    fn seen_in(&self, shot: usize) -> impl Iterator<Item = Seen> {
        let each = self.used[shot].iter().enumerate();
        each.flat_map(move |(camera, sighting)| {
            let corners = sighting.iter().flat_map(|own| &own.corners);
            corners.map(move |(&corner, &at)| Seen {
                camera,
                shot,
                point: self.board.place(corner),
                at,
            })
        })
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
    fn drop_strange(&mut self, (times, px): (f64, f64)) -> bool {
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
        let is_strange = worst > px && worst > times * usual;
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
            is_misfit: true,
        });
    }

    /// Takes out what does not fit; says whether there was anything.
    fn drop_misfits(&mut self) -> bool {
        if self.drop_strange(STRANGE) {
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
                let is_most = sighting.count() as f64 >= LEAST_FITTING * sighting.found as f64;
                if sighting.count() < before && !(is_most && sighting.tells_a_place()) {
                    poor.push((
                        shot,
                        camera,
                        sighting.found - sighting.count(),
                        sighting.found,
                    ));
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
        let sure = task.sure(estimate).ok_or(
            "what was seen does not determine the cameras: tilt the board by 30° and more to all sides, in 10 images or more",
        )?;
        let misses = task.misses(estimate);
        let mut warnings = Vec::new();
        let mut cameras = Vec::new();
        for (camera, name) in self.shots.cameras.iter().enumerate() {
            let own = seen.iter().zip(&misses);
            let own = own.filter(|(seen, _)| seen.camera == camera);
            let own: Vec<[DVec2; 2]> = own
                .filter_map(|(seen, miss)| Some([seen.at, (*miss)?]))
                .collect();
            let sightings = self.used.iter().filter_map(|of| of[camera].as_ref());
            let taken = self.taken(camera);
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
                used: [sightings.clone().count(), taken],
                corners: [own.len(), sightings.map(|own| own.found).sum()],
                focal: [of(0), of(1)],
                centre: [of(2), of(3)],
                lens: [of(4), of(5), of(6), of(7)],
                rms_px: (squares / own.len().max(1) as f64).sqrt(),
                median_px: quantile(&far, 0.5),
                p95_px: quantile(&far, 0.95),
                misses: own,
            };
            found.check(&mut warnings)?;
            let out = self.left_out.iter().filter(|out| out.camera == *name);
            let misfits = out.filter(|out| out.is_misfit).count();
            if misfits as f64 > MANY_MISFITS * taken as f64 {
                warnings.push(format!(
                    "{misfits} of {taken} images of {name} do not fit the others: did it move or change, or were images of one time taken at several?"
                ));
            }
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
        if sizes.len() == 2 {
            warnings.push("two cameras are no triple: at least three are matched".to_owned());
            return None;
        }
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
            (!off.is_empty()).then(|| [0.5, 0.95].map(|share| quantile(&off, share)))
        });
        Beside {
            between: pair.map(|camera| self.shots.cameras[camera].clone()),
            apart_m: step.shift.length(),
            turned_degrees: (step.turn * DVec3::Z).angle_between(DVec3::Z).to_degrees(),
            together: both.len(),
            rows_px: rows.flatten(),
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

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

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
                    images: vec![Some("x".into()); 3],
                })
                .collect(),
            sizes: vec![SIZE; 3],
            layout: Layout::FolderACamera,
            is_by_order: false,
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
