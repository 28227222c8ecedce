//! What is used of all that was seen, and what it amounts to: begun camera by camera, then worked out together, again and
//! again without what does not fit.

use std::collections::BTreeMap;

use glam::{DMat3, DVec2, DVec3};

use super::board::{Board, Sighting};
use super::shots::Shots;
use super::solve::{self, Estimate, INTRINSIC, Pose, Seen, Task};
use super::start::{self, Alone};
use super::{
    Beside, Calibrated, ENOUGH_SIGHTINGS, Found, LeftOut, MANY_MISFITS, Model, Observed, Sure,
};
use crate::alignment::quantile;
use crate::calibration::plausible::{self, Doubt, Said};
use crate::calibration::{Camera, Geometry, Mount, Mounted};

/// Sightings of a camera that can tell anything.
const LEAST_SIGHTINGS: usize = 3;
/// Standard deviations from where a corner belongs beyond which it is a mistake, and pixels within which it never is.
const MISTAKEN: (f64, f64) = (6.0, 0.3);
/// How many times farther off than most a sighting is that does not belong, and pixels within which it does.
const STRANGE: (f64, f64) = (4.0, 0.6);
/// The same before all are solved together: near boards show most how roughly cameras are known until then.
const STRANGE_AT_FIRST: (f64, f64) = (8.0, 3.0);
/// The part of a sighting's corners that must fit.
const LEAST_FITTING: f64 = 0.5;

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
    let alone = fit.alone()?;
    fit.check()?;
    fit.together(alone)?;
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

    /// Each camera by itself, its places by shot.
    fn alone(&mut self) -> Result<Vec<Alone>, String> {
        let mut all = Vec::new();
        for (camera, name) in self.shots.cameras.iter().enumerate() {
            let size = self.shots.sizes[camera];
            let is_used = |shot: &usize| self.used[*shot][camera].is_some();
            let shots: Vec<usize> = (0..self.used.len()).filter(is_used).collect();
            let own: Vec<&Sighting> = shots
                .iter()
                .filter_map(|&shot| self.used[shot][camera].as_ref())
                .collect();
            let found = start::alone(self.model, size, self.board, &own, LEAST_SIGHTINGS);
            let Alone { numbers, places } = found.ok_or_else(|| {
                format!("no focal length explains what {name} saw of the board: is --model right?")
            })?;
            let mut by_shot = vec![None; self.used.len()];
            for (shot, place) in shots.into_iter().zip(places) {
                by_shot[shot] = place;
                if place.is_none() {
                    let why = "no place of the board explains its corners";
                    self.leave_out(shot, camera, why.to_owned());
                }
            }
            all.push(Alone {
                numbers,
                places: by_shot,
            });
        }
        Ok(all)
    }

    /// Which way up each camera saw the board, where they stand, and where the board was.
    fn together(&mut self, alone: Vec<Alone>) -> Result<(), String> {
        let cameras = alone.into_iter().map(|one| (one.numbers, one.places));
        let (intrinsics, mut places): (Vec<_>, Vec<_>) = cameras.unzip();
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
                lens: self.model.name().to_owned(),
                mount: Mount::from_first(
                    DMat3::from_quat(estimate.mounts[camera].turn),
                    estimate.mounts[camera].shift,
                ),
            })
            .collect();
        match Geometry::of(&mounted, sizes[0]) {
            Ok(geometry) => {
                geometry.remark(notices, warnings);
                let step_m = geometry.calibration.baseline_m;
                let doubt = plausible::baseline(step_m, Said::File).map(Doubt::why);
                warnings.extend(doubt.map(|why| format!("{why}; --square is in metres")));
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
