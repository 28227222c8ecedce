//! The common parallel geometry: for every view a camera without distortion, all with one focal length and one principal
//! point, their axes parallel and their rows along the line they stand on.

use glam::{DMat3, DVec2, DVec3};
use messages::{Calibration, Size};

use super::plausible::{self, Doubt, Said};
use super::{Mount, Mounted, Why};

/// Steps that differ by more of their mean are refused: the third view would confirm nothing.
pub(crate) const MOST_UNEQUAL: f64 = 0.1;
/// Steps that differ by more of their mean are told.
const TOLD_UNEQUAL: f64 = 0.002;
/// Views that show less than this part of what the middle of a picture shows are refused.
const LEAST_PART: f64 = 0.25;

/// What views are rectified to.
#[derive(Clone, Debug)]
pub(crate) struct Geometry {
    pub(crate) calibration: Calibration,
    /// Turns a direction from the rectified frame (x along the line of the cameras, y down, z forward) into each
    /// camera's own.
    pub(crate) turns: Vec<DMat3>,
    /// Where each camera stands along the line, in metres from the first.
    pub(crate) places_m: Vec<f64>,
    /// The farthest that a camera stands off the line, in metres.
    pub(crate) off_line_m: f64,
    /// Focal length of the cameras, their mean, in pixels.
    own_focal_px: f64,
    /// Whether a calibration tool has made it.
    is_given: bool,
}

impl Geometry {
    /// The geometry of these cameras, left to right, for images of this size.
    pub(crate) fn of(mounted: &[Mounted], size: Size) -> Result<Self, Why> {
        let focals = mounted.iter().flat_map(|one| one.camera.focal);
        let own_focal_px = focals.sum::<f64>() / (2 * mounted.len()) as f64;
        if let [one] = mounted {
            return Self::of_one(one, own_focal_px, size);
        }
        let posed = mounted.iter().filter_map(|one| match one.mount {
            Mount::Posed { turn, centre_m } => Some((turn, centre_m)),
            Mount::Rectified { .. } => None,
        });
        let posed: Vec<(DMat3, DVec3)> = posed.collect();
        let geometry = match posed.len() == mounted.len() {
            true => Self::computed(mounted, &posed, own_focal_px, size)?,
            false => Self::given(mounted, own_focal_px)?,
        };
        let steps = geometry.steps_m();
        let shown = || {
            let places = geometry.places_m.iter().map(|m| format!("{:.1}", m * 1e3));
            places.collect::<Vec<_>>().join(", ")
        };
        if steps.iter().any(|&step| step <= 0.0) {
            return Err(format!(
                "its cameras ({}) stand at {} mm along their line, and views go from left to right: list them in that order; or are poses the other way round? R and T map points of the first camera's frame to each camera's own",
                names(mounted),
                shown()
            ));
        }
        if geometry.unequal() > MOST_UNEQUAL {
            return Err(format!(
                "its cameras stand at {} mm along their line, and their steps must be equal",
                shown()
            ));
        }
        Ok(geometry)
    }

    /// The geometry of one camera that moves along a rail. How it is turned against its way no file says: it keeps its axes,
    /// and only its lens is made straight.
    fn of_one(one: &Mounted, own_focal_px: f64, size: Size) -> Result<Self, Why> {
        let turns = vec![DMat3::IDENTITY];
        let window = Window::shared(std::slice::from_ref(one), &turns, size, own_focal_px)
            .ok_or("its camera sees nothing in the middle of its images")?;
        let (focal_px, [cx, cy]) = window.projection(own_focal_px, size);
        Ok(Self {
            calibration: calibration(focal_px, cx, cy, &[0.0]),
            turns,
            places_m: vec![0.0],
            off_line_m: 0.0,
            own_focal_px,
            is_given: false,
        })
    }

    /// The rectification that the calibration tool has made.
    fn given(mounted: &[Mounted], own_focal_px: f64) -> Result<Self, Why> {
        let mut first = None;
        let (mut turns, mut places_m) = (Vec::new(), Vec::new());
        for Mounted { name, mount, .. } in mounted {
            let &Mount::Rectified {
                turn,
                focal_px,
                cx,
                cy,
                place_m,
            } = mount
            else {
                return Err("some of its cameras are rectified and others are not".to_owned());
            };
            let own = [focal_px, cx, cy];
            let common = *first.get_or_insert(own);
            if own.iter().zip(&common).any(|(a, b)| (a - b).abs() > 0.01) {
                return Err(format!(
                    "the projection of {name} has f {focal_px}, c {cx}, {cy}, and that of the first {}, {}, {}: they must be of one rectification",
                    common[0], common[1], common[2]
                ));
            }
            turns.push(turn.transpose());
            places_m.push(place_m);
        }
        let [focal_px, cx, cy] = first.unwrap_or([own_focal_px, 0.0, 0.0]);
        if places_m.iter().all(|&place| place == 0.0) {
            return Err("its projections hold no distances between the cameras (the fourth number is 0 in all): calibrate them together".to_owned());
        }
        let start = places_m[0];
        places_m.iter_mut().for_each(|place| *place -= start);
        Ok(Self {
            calibration: calibration(focal_px, cx, cy, &places_m),
            turns,
            places_m,
            off_line_m: 0.0,
            own_focal_px,
            is_given: true,
        })
    }

    /// A parallel geometry for cameras that stand about in a row: x along the least-squares line through their centres, z
    /// the mean of their axes made perpendicular to it.
    fn computed(
        mounted: &[Mounted],
        posed: &[(DMat3, DVec3)],
        own_focal_px: f64,
        size: Size,
    ) -> Result<Self, Why> {
        let count = posed.len() as f64;
        let middle = posed.iter().map(|(_, centre)| *centre).sum::<DVec3>() / count;
        let along = line(posed, middle).ok_or("its cameras all stand at one place")?;
        let mean = |axis: DVec3| posed.iter().map(|(turn, _)| *turn * axis).sum::<DVec3>() / count;
        let (right, forward) = (mean(DVec3::X), mean(DVec3::Z));
        if along.dot(right).abs() < 0.5 {
            return Err("its cameras do not stand in a row beside each other".to_owned());
        }
        let along = along * along.dot(right).signum();
        let z = (forward - along * forward.dot(along)).normalize_or_zero();
        let y = z.cross(along);
        // Columns: the rectified axes in the first camera's frame.
        let axes = DMat3::from_cols(along, y, z);
        let turns: Vec<DMat3> = posed
            .iter()
            .map(|(turn, _)| turn.transpose() * axes)
            .collect();
        let from = |centre: DVec3| along.dot(centre - posed[0].1);
        let places_m: Vec<f64> = posed.iter().map(|(_, centre)| from(*centre)).collect();
        let off = |centre: DVec3| (centre - middle).reject_from_normalized(along).length();
        let off_line_m = posed.iter().map(|(_, c)| off(*c)).fold(0.0, f64::max);
        let window = Window::shared(mounted, &turns, size, own_focal_px)
            .ok_or("its cameras see nothing in common")?;
        let (focal_px, [cx, cy]) = window.projection(own_focal_px, size);
        Ok(Self {
            calibration: calibration(focal_px, cx, cy, &places_m),
            turns,
            places_m,
            off_line_m,
            own_focal_px,
            is_given: false,
        })
    }

    /// Distances between neighbouring cameras, in metres.
    pub(crate) fn steps_m(&self) -> Vec<f64> {
        self.places_m
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .collect()
    }

    /// The farthest that a step is from their mean, as a part of it.
    pub(crate) fn unequal(&self) -> f64 {
        let mean = self.calibration.baseline_m;
        let off = self
            .steps_m()
            .into_iter()
            .map(|step| (step / mean - 1.0).abs());
        off.fold(0.0, f64::max)
    }

    /// What speaks against how far apart the cameras stand.
    pub(crate) fn doubt(&self) -> Option<Doubt> {
        let step_m = self.calibration.baseline_m;
        let said = match self.is_given {
            true => Said::Projection {
                shift: -step_m * self.calibration.focal_px,
                focal_px: self.calibration.focal_px,
            },
            false => Said::File,
        };
        // One camera stands at one place.
        (self.turns.len() > 1).then(|| plausible::baseline(step_m, said))?
    }

    /// Adds what the user should be told of it, and what makes results less than they could be.
    pub(crate) fn remark(&self, notices: &mut Vec<String>, warnings: &mut Vec<String>) {
        let Calibration {
            focal_px,
            baseline_m,
            ..
        } = self.calibration;
        if self.turns.len() == 1 {
            notices.push(format!(
                "frames are rectified: focal length {focal_px:.1} px (the camera's {:.1})",
                self.own_focal_px
            ));
            return;
        }
        notices.push(format!(
            "views are rectified: focal length {focal_px:.1} px (the cameras' {:.1}), steps of {:.2} mm, equal within {:.2} %, centres within {:.2} mm of their line",
            self.own_focal_px,
            baseline_m * 1e3,
            self.unequal() * 1e2,
            self.off_line_m * 1e3
        ));
        if self.unequal() > TOLD_UNEQUAL {
            warnings.push(format!(
                "the steps between the cameras differ from their mean by up to {:.1} %, and equal ones are matched: a disparity of 50 px misses by {:.1} px in the third view; `tricurve check-geometry` says whether that will do",
                self.unequal() * 1e2,
                self.unequal() * 50.0
            ));
        }
        if self.off_line_m > 0.01 * baseline_m {
            warnings.push(format!(
                "the cameras stand up to {:.2} mm off their line: near points miss their rows by what no rotation mends",
                self.off_line_m * 1e3
            ));
        }
    }
}

fn names(mounted: &[Mounted]) -> String {
    let names: Vec<&str> = mounted.iter().map(|one| one.name.as_str()).collect();
    names.join(", ")
}

fn calibration(focal_px: f64, cx: f64, cy: f64, places_m: &[f64]) -> Calibration {
    let steps = places_m.len().saturating_sub(1).max(1) as f64;
    let reach = places_m.last().zip(places_m.first());
    Calibration {
        focal_px,
        cx,
        cy,
        baseline_m: reach.map_or(0.0, |(last, first)| (last - first) / steps),
        calibrated: true,
    }
}

/// Direction of the least-squares line through centres with this middle: the main axis of their covariance, by repeated
/// multiplication.
fn line(posed: &[(DMat3, DVec3)], middle: DVec3) -> Option<DVec3> {
    let first = posed.first()?.1;
    let last = posed.last()?.1;
    let mut along = (last - first).try_normalize()?;
    for _ in 0..64 {
        let next: DVec3 = posed
            .iter()
            .map(|(_, centre)| (*centre - middle) * along.dot(*centre - middle))
            .sum();
        along = next.try_normalize()?;
    }
    Some(along)
}

/// Column and row of the middle of a picture.
fn middle_of(size: Size) -> [f64; 2] {
    [size.width, size.height].map(|side| (f64::from(side) - 1.0) / 2.0)
}

/// The part of the plane z = 1 that fills the rectified pictures.
#[derive(Clone, Copy, Debug)]
struct Window {
    middle: DVec2,
    /// The focal length at which it does.
    focal_px: f64,
}

impl Window {
    /// The largest window of the picture's shape that all cameras see whole.
    ///
    /// The middle is found by a pattern search: along either axis, by steps that are halved when no move helps.
    fn shared(mounted: &[Mounted], turns: &[DMat3], size: Size, focal_px: f64) -> Option<Self> {
        let half = DVec2::from(middle_of(size));
        let last = half * 2.0;
        let sees = |x: f64, y: f64| {
            mounted.iter().zip(turns).all(|(one, turn)| {
                let place = one.camera.place(*turn * DVec3::new(x, y, 1.0));
                place.is_some_and(|p| p.cmpge(DVec2::ZERO).all() && p.cmple(last).all())
            })
        };
        const SIDE: usize = 16;
        // Whether all see the border of a window of half the size `scale` times that of the picture in pixels.
        let sees_all = |middle: DVec2, scale: f64| {
            (0..=SIDE).all(|i| {
                let part = 2.0 * i as f64 / SIDE as f64 - 1.0;
                [
                    DVec2::new(part, -1.0),
                    DVec2::new(part, 1.0),
                    DVec2::new(-1.0, part),
                    DVec2::new(1.0, part),
                ]
                .into_iter()
                .all(|corner| {
                    let at = middle + corner * half * scale;
                    sees(at.x, at.y)
                })
            })
        };
        let largest = |middle: DVec2| {
            let (mut least, mut most) = (0.0, 4.0 / focal_px);
            for _ in 0..22 {
                let scale = (least + most) / 2.0;
                match sees_all(middle, scale) {
                    true => least = scale,
                    false => most = scale,
                }
            }
            least
        };
        let mut middle = DVec2::ZERO;
        let mut scale = largest(middle);
        let mut move_by = 0.1;
        while move_by > 1e-5 {
            let moves = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y];
            let tried = moves
                .map(|by| middle + by * move_by)
                .map(|at| (at, largest(at)));
            let best = tried.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
            match best {
                Some((at, larger)) if larger > scale => (middle, scale) = (at, larger),
                _ => move_by /= 2.0,
            }
        }
        // A hair's breadth inside, for rounding.
        let focal = 1.0 / (scale * (1.0 - 1e-4));
        (focal * LEAST_PART < focal_px).then_some(Self {
            middle,
            focal_px: focal,
        })
    }

    /// Focal length and principal point of pictures that show it: as fine as the cameras see in the middle, or finer where
    /// pixels would lie outside of what they see.
    fn projection(&self, own_focal_px: f64, size: Size) -> (f64, [f64; 2]) {
        let focal_px = self.focal_px.max(own_focal_px);
        let [cx, cy] = (DVec2::from(middle_of(size)) - focal_px * self.middle).to_array();
        (focal_px, [cx, cy])
    }
}
