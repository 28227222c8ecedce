//! One camera that moves along a rail: which frames there are, where each was taken, how far apart a triple's are.

use std::path::Path;

use messages::{Calibration, Size, Sway};

use crate::calibration::plausible::{self, Doubt, Said, metres};
use crate::error::SourceError;
use crate::motion::{Picture, SPACING, moved, quantile};
use crate::pace::{self, Estimated};
use crate::positions;
use crate::settings::Settings;
use crate::sway;

/// Pairs of frames that are looked at to see how the picture moves.
const LOOKS: usize = 6;
/// By default neighbours in a triple are so far apart that nearly all disparities are less than this share of the width:
/// few points are hidden or out of the picture then, and the map gets its long base from many frames.
const MOST_OF_WIDTH: f32 = 1.0 / 32.0;
/// Frames there are for each stride that is chosen, at least: few triples make no map.
const FRAMES_A_STRIDE: u64 = 4;
/// The longest stride that is chosen, and that can be set.
const LONGEST_STRIDE: u64 = 32;
/// Share of the usual step up to which the camera counts as standing still: an encoder trembles, an estimate errs.
const STILL: f64 = 0.1;
/// Pixels by which something moves between neighbours in a triple where the camera moves.
const LEAST_MOTION_PX: f32 = 1.0;
/// Rows a baseline of drift that are taken for level: the estimate itself is no better.
const LEVEL_PX: f64 = 0.05;
/// Rows over a whole triple that can be made good.
const MOST_DRIFT_PX: f64 = 2.0;

/// The rail of a source.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rail {
    /// Of each frame in turn, which of the source's pictures it is.
    pub(crate) order: Vec<usize>,
    /// Where each was taken, in metres.
    pub(crate) positions_m: Vec<f64>,
    /// The same in the source's own steps, where only looking at all the pictures told.
    pub(crate) places: Option<Vec<f64>>,
    /// By how much each frame is off, where all the pictures were looked at.
    pub(crate) sway: Option<Vec<Sway>>,
    /// Steps of the source's own in a baseline.
    pub(crate) own_steps: f64,
    pub(crate) rail: messages::Rail,
    /// What nearly all disparities lie between, in pixels a baseline, where they were looked at.
    pub(crate) disparities: Option<(f32, f32)>,
    pub(crate) calibration: Calibration,
    pub(crate) notices: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// What is known of a camera whose baseline is one unit of position.
#[derive(Clone, Debug)]
pub(crate) struct Unit {
    pub(crate) camera: Calibration,
    /// Whether the length of a unit is known.
    pub(crate) is_known: bool,
    pub(crate) notices: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// The pictures a rail passes, in order.
#[derive(Clone, Debug)]
pub(crate) struct Passed {
    /// Which pictures of the source.
    pub(crate) order: Vec<usize>,
    /// Where each was taken, in the source's own steps.
    pub(crate) own_steps: Vec<f64>,
    /// The same, where it was estimated before.
    pub(crate) places: Option<Vec<f64>>,
    /// By how much each frame is off, where it was estimated before.
    pub(crate) sway: Option<Vec<Sway>>,
    /// Whether the source itself says where.
    pub(crate) is_described: bool,
    /// Whether it says so in metres.
    pub(crate) in_metres: bool,
    /// Whether it leaves open which way is to the right: then the images say it.
    pub(crate) is_either_way: bool,
}

/// How the picture moves along the rail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Survey {
    /// Nearly the least and nearly the greatest disparity, in pixels for one unit of position.
    disparities: (f32, f32),
    /// Rows down for one unit of position.
    drift: f32,
}

impl Survey {
    /// What is near moves against the camera.
    fn is_to_the_left(&self) -> bool {
        self.disparities.0 + self.disparities.1 < 0.0
    }

    /// Nearly the least and nearly the greatest disparity over so many units of position.
    fn over(&self, units: f32) -> (f32, f32) {
        (self.disparities.0 * units, self.disparities.1 * units)
    }

    /// The same for positions that count the other way.
    fn mirrored(self) -> Self {
        let (least, most) = self.disparities;
        Self {
            disparities: (-most, -least),
            drift: -self.drift,
        }
    }
}

impl Rail {
    /// The rail along these pictures; `pixels` gives one of them, and `camera` the calibration of a baseline that is one
    /// unit of position, which may be metres, with what is to be said about it.
    pub(crate) fn new(
        settings: &Settings,
        path: Passed,
        size: Size,
        camera: impl FnOnce(bool) -> Result<Unit, SourceError>,
        mut pixels: impl FnMut(usize) -> Result<Vec<u8>, SourceError>,
    ) -> Result<Self, SourceError> {
        if settings.speed.is_some() {
            return Err(SourceError::SpeedOfFiles);
        }
        let frames = path.order.len();
        let (mut notices, mut in_metres) = (Vec::new(), path.in_metres);
        let is_told = settings.positions.is_some() || path.places.is_some();
        let is_guessed = !is_told && !path.is_described;
        // Which way the camera goes is seen where nobody says it.
        let is_way_open = is_guessed || (!is_told && path.is_either_way);
        let mut positions = path.places.unwrap_or_else(|| path.own_steps.clone());
        if let Some(file) = &settings.positions {
            let read = positions::read(Path::new(file), frames)?;
            (positions, in_metres) = (read.values, read.in_metres);
        }
        let Unit {
            camera,
            is_known,
            notices: of_camera,
            mut warnings,
        } = camera(in_metres)?;
        notices.extend(of_camera);
        let mut estimated = None;
        let most = pace::most_frames(size);
        if is_guessed && frames > most {
            warnings.push(format!(
                "where {frames} frames were taken is not estimated from the images, at most {most} are: pauses and turns are not known; capture.positions says where they were taken"
            ));
        } else if is_guessed {
            estimated = pace::estimated(frames, size, |frame| pixels(path.order[frame]))?;
        }
        if let Some(estimated) = estimated
            .as_ref()
            .filter(|estimated| !estimated.are_equal())
        {
            positions.clone_from(&estimated.places);
        }
        let nominal = usual_step(&positions).ok_or(SourceError::NoMotion { frames })?;
        let turns = turns(&positions, nominal);
        if turns > 0 && (settings.positions.is_some() || path.in_metres) {
            notices.push(format!("the camera turns back {turns} times"));
        }
        let longest = ((frames as u64 - 1) / 2).clamp(1, LONGEST_STRIDE);
        if let Some(stride) = settings.stride.filter(|&stride| stride > longest) {
            return Err(SourceError::Stride {
                stride,
                longest,
                frames,
            });
        }
        let mut look = |positions: &[f64], apart: usize| {
            survey(
                &path.order,
                positions,
                STILL * nominal,
                apart,
                size,
                &mut pixels,
            )
        };
        let mut near = match settings.stride {
            Some(_) if !is_way_open => None,
            _ => look(&positions, 1)?,
        };
        let stride = settings.stride.unwrap_or_else(|| match near {
            Some(near) => fitting_stride(&near, nominal, size, frames as u64).min(longest),
            None => 1,
        });
        let mut far = match settings.drift {
            // It may be all that shows which way the camera goes.
            Some(_) if !is_way_open || near.is_some() => None,
            _ => look(&positions, (2 * stride as usize).min(frames - 1))?,
        };
        let is_to_the_left = is_way_open && near.or(far).is_some_and(|seen| seen.is_to_the_left());
        if is_to_the_left {
            positions.iter_mut().for_each(|place| *place = -*place);
            near = near.map(Survey::mirrored);
            far = far.map(Survey::mirrored);
            if !is_guessed {
                notices.push(
                    "its places count to the left, by the images, and their sign is changed"
                        .to_owned(),
                );
            }
        }
        let baseline = nominal * stride as f64;
        let level = |drift: f64| if drift.abs() < LEVEL_PX { 0.0 } else { drift };
        let mut drift_px = settings
            .drift
            .unwrap_or_else(|| level(far.map_or(0.0, |far| f64::from(far.drift) * baseline)));
        let is_in_reach = settings.sway == Some(true) || frames <= most;
        let sway = match path.sway {
            _ if settings.sway == Some(false) => None,
            Some(known) => Some(known),
            None if !is_in_reach => {
                notices.push(format!(
                    "by how much {frames} frames sway is not looked at, at most {most} are; set capture.sway to true"
                ));
                None
            }
            None => {
                let looked = sway::Looked {
                    size,
                    positions: &positions,
                    stride: stride as usize,
                    drift: drift_px / baseline,
                };
                let found = sway::found(&looked, |frame| pixels(path.order[frame]))?;
                if let Some(found) = found.as_ref().filter(|found| !found.sway.is_empty()) {
                    notices.push(format!(
                        "the rail sways by {:.2} px from frame to frame, which is made good in the places of its curves; capture.sway=false leaves it",
                        found.px
                    ));
                    // All frames tell more than the few that were looked at.
                    if settings.drift.is_none() {
                        drift_px = level(drift_px + found.drift * baseline);
                    }
                }
                let sway = found.map_or(Vec::new(), |found| found.sway);
                match sway.is_empty() {
                    true => Some(vec![Sway::NONE; frames]),
                    false => Some(sway),
                }
            }
        };
        if settings.stride.is_none() {
            notices.push(match stride {
                1 => "frames that follow each other are matched; capture.stride chooses others"
                    .to_owned(),
                _ => format!("frames {stride} apart are matched; capture.stride chooses others"),
            });
            if near.is_none() {
                warnings.push(
                    "how far things move from frame to frame could not be seen, so stride is a guess: set capture.stride so that they move by at most an eighth of the width"
                        .to_owned(),
                );
            }
        }
        if (2.0 * drift_px).abs() > MOST_DRIFT_PX {
            warnings.push(format!(
                "the picture drifts {:.1} rows over a triple, and at most {MOST_DRIFT_PX} can be made good: level the camera or choose a smaller stride",
                2.0 * drift_px
            ));
        } else if drift_px != 0.0 && settings.drift.is_none() {
            notices.push(format!(
                "the picture drifts {drift_px:.2} rows a baseline, which is made good; capture.drift says another"
            ));
        }
        let disparities = near.or(far).map(|seen| seen.over(baseline as f32));
        warnings.extend(disparities.and_then(doubt));
        if is_guessed {
            notices.push(format!(
                "where the frames were taken is not said: {}; capture.positions says it",
                said_of_steps(estimated.as_ref(), is_to_the_left)
            ));
        }
        let step_m = camera.baseline_m;
        if is_known {
            let step_m = step_m * baseline;
            notices.push(said_of_step(step_m));
            warnings.extend(plausible::baseline(step_m, Said::Rail).map(Doubt::why));
        }
        Ok(Self {
            positions_m: positions.iter().map(|place| place * step_m).collect(),
            places: is_way_open.then_some(positions),
            own_steps: usual_step(&path.own_steps).unwrap_or(1.0) * stride as f64,
            order: path.order,
            sway,
            rail: messages::Rail {
                stride,
                drift_px,
                follow: 0,
            },
            disparities,
            calibration: Calibration {
                baseline_m: step_m * baseline,
                ..camera
            },
            notices,
            warnings,
        })
    }

    /// By how much a frame is off.
    pub(crate) fn sway(&self, scan: u64) -> Sway {
        let turn = (scan % self.order.len() as u64) as usize;
        let known = self.sway.as_ref().and_then(|sway| sway.get(turn));
        known.copied().unwrap_or(Sway::NONE)
    }

    /// Which picture of the source a frame is, and where it was taken; a source with fewer begins again.
    pub(crate) fn frame(&self, scan: u64) -> (usize, f64) {
        let turn = (scan % self.order.len() as u64) as usize;
        (self.order[turn], self.positions_m[turn])
    }
}

/// How far the camera moves from one frame of a triple to the next.
pub(crate) fn said_of_step(step_m: f64) -> String {
    format!(
        "baseline {} from one frame of a triple to the next, {} from its first to its last",
        metres(step_m),
        metres(2.0 * step_m)
    )
}

/// What the pictures say against it that anything can be matched: by disparities in pixels a baseline.
fn doubt((least, most): (f32, f32)) -> Option<String> {
    let fastest = least.abs().max(most.abs());
    if fastest < LEAST_MOTION_PX {
        return Some(format!(
            "hardly anything moves between the frames of a triple ({fastest:.1} px at most): does the camera move?"
        ));
    }
    (most < -LEAST_MOTION_PX).then(|| {
        format!(
            "everything moves with the camera, by {:.1} to {:.1} px, as where positions count the other way: change their sign",
            -most, -least
        )
    })
}

/// What is said of steps of which nobody else says anything.
fn said_of_steps(estimated: Option<&Estimated>, is_to_the_left: bool) -> String {
    let way = if is_to_the_left { "left" } else { "right" };
    match estimated {
        Some(estimated) if estimated.are_equal() => {
            format!("the images show equal steps to the {way}")
        }
        Some(estimated) => {
            let (least, most) = estimated.steps();
            format!(
                "estimated from the images, steps to the {way} are {least:.2} to {most:.2} of the usual one"
            )
        }
        None => format!("equal steps to the {way} are assumed"),
    }
}

/// The longest stride at which nearly all disparities are less than [`MOST_OF_WIDTH`].
fn fitting_stride(seen: &Survey, nominal: f64, size: Size, frames: u64) -> u64 {
    let (least, most) = seen.disparities;
    let greatest = least.abs().max(most.abs()) * nominal as f32;
    let fit = (MOST_OF_WIDTH * size.width as f32 / greatest.max(0.5)).floor() as u64;
    fit.min(frames / FRAMES_A_STRIDE).max(1)
}

/// The distance between frames that follow each other: the median of those at which the camera moved. `None` when it did
/// not.
pub(crate) fn usual_step(positions: &[f64]) -> Option<f64> {
    let steps = positions.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    // Where half of the way is gone: an encoder trembles while the camera rests, and that is no way.
    let half = steps.iter().sum::<f64>() / 2.0;
    let mut gone = 0.0;
    let is_half = |step: &&f64| {
        gone += **step;
        gone >= half
    };
    let typical = *steps.iter().find(is_half)?;
    steps.retain(|step| *step > STILL * typical);
    steps.get(steps.len() / 2).copied()
}

/// How often the camera turns back.
fn turns(positions: &[f64], nominal: f64) -> usize {
    let steps = positions.windows(2).map(|pair| pair[1] - pair[0]);
    let moves: Vec<f64> = steps.filter(|step| step.abs() > STILL * nominal).collect();
    moves
        .windows(2)
        .filter(|pair| pair[0] * pair[1] < 0.0)
        .count()
}

/// Looks at pairs of frames so far apart, evenly along the rail, of those between which the camera moved by more than
/// `still`. `None` when nothing was seen to move.
fn survey(
    order: &[usize],
    positions: &[f64],
    still: f64,
    apart: usize,
    size: Size,
    pixels: &mut impl FnMut(usize) -> Result<Vec<u8>, SourceError>,
) -> Result<Option<Survey>, SourceError> {
    let step = |at: usize| positions[at + apart] - positions[at];
    let moving: Vec<usize> = (0..order.len() - apart)
        .filter(|&at| step(at).abs() > still)
        .collect();
    let looks = LOOKS.min(moving.len());
    let (mut disparities, mut drifts) = (Vec::new(), Vec::new());
    for look in 0..looks {
        let at = moving[look * (moving.len() - 1) / (looks - 1).max(1)];
        let step = step(at) as f32;
        let pair = [pixels(order[at])?, pixels(order[at + apart])?];
        let picture = |pixels| Picture { size, pixels };
        let reach = (size.width as usize / 6).max(8);
        for found in moved(&picture(&pair[0]), &picture(&pair[1]), reach, SPACING) {
            disparities.push(-found.right / step);
            drifts.push(found.down / step);
        }
    }
    // A few blocks may be wrong, and a few say nothing of the scene.
    const ENOUGH: usize = 20;
    if disparities.len() < ENOUGH {
        return Ok(None);
    }
    let ends = (
        quantile(disparities.clone(), 0.02),
        quantile(disparities, 0.98),
    );
    let (Some(least), Some(most), Some(drift)) = (ends.0, ends.1, quantile(drifts, 0.5)) else {
        return Ok(None);
    };
    Ok(Some(Survey {
        disparities: (least, most),
        drift,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_step_is_the_median_of_those_that_were_made() {
        assert_eq!(usual_step(&[0.0, 1.0, 1.0, 2.1, 1.1]), Some(1.0));
        assert_eq!(usual_step(&[3.0, 3.0]), None);
    }

    #[test]
    fn turning_back_is_counted_whether_or_not_the_camera_pauses() {
        assert_eq!(turns(&[0.0, 1.0, 2.0, 2.0, 1.0, 0.0, 1.0], 1.0), 2);
        assert_eq!(turns(&[0.0, 1.0, 1.0, 2.0], 1.0), 0);
    }
}
