//! One camera that moves along a rail: which frames there are, where each was taken, how far apart a triple's are.

use std::path::Path;

use messages::{Calibration, Size};

use crate::error::SourceError;
use crate::motion::{Picture, SPACING, moved, quantile};
use crate::pace;
use crate::positions;
use crate::settings::Settings;

/// Pairs of frames that are looked at to see how the picture moves.
const LOOKS: usize = 6;
/// By default neighbours in a triple are so far apart that nearly all disparities are less than this share of the width:
/// few points are hidden or out of the picture then, and the map gets its long base from many frames.
const MOST_OF_WIDTH: f32 = 1.0 / 32.0;
/// Frames there are for each stride that is chosen, at least: few triples make no map.
const FRAMES_A_STRIDE: u64 = 4;
/// The longest stride that is chosen, and that can be set.
const LONGEST_STRIDE: u64 = 32;
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
    pub(crate) rail: messages::Rail,
    /// What nearly all disparities lie between, in pixels a baseline, where they were looked at.
    pub(crate) disparities: Option<(f32, f32)>,
    pub(crate) calibration: Calibration,
    pub(crate) notices: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// The pictures a rail passes, in order.
#[derive(Clone, Debug)]
pub(crate) struct Passed {
    /// Which pictures of the source.
    pub(crate) order: Vec<usize>,
    /// Where each was taken, in steps or in metres.
    pub(crate) positions: Vec<f64>,
    /// Whether the source itself says where.
    pub(crate) is_described: bool,
}

/// How the picture moves along the rail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Survey {
    /// Nearly the least and nearly the greatest disparity, in pixels for one unit of position.
    disparities: (f32, f32),
    /// Rows down for one unit of position.
    drift: f32,
}

impl Rail {
    /// The rail along these pictures; `pixels` gives one of them, and `camera` the calibration of a baseline that is one
    /// unit of position, which may be metres, with what is to be said about it.
    pub(crate) fn new(
        settings: &Settings,
        mut path: Passed,
        size: Size,
        camera: impl FnOnce(bool) -> Result<(Calibration, Vec<String>), SourceError>,
        mut pixels: impl FnMut(usize) -> Result<Vec<u8>, SourceError>,
    ) -> Result<Self, SourceError> {
        if settings.speed.is_some() {
            return Err(SourceError::SpeedOfFiles);
        }
        let mut notices = Vec::new();
        let mut in_metres = false;
        if let Some(file) = &settings.positions {
            let read = positions::read(Path::new(file), path.order.len())?;
            (path.positions, in_metres) = (read.values, read.in_metres);
        }
        let (camera, mut warnings) = camera(in_metres)?;
        let is_guessed = settings.positions.is_none() && !path.is_described;
        let estimated = match is_guessed {
            true => pace::estimated(path.order.len(), size, |frame| pixels(path.order[frame]))?,
            false => None,
        };
        if let Some(estimated) = &estimated
            && !estimated.are_equal()
        {
            path.positions.clone_from(&estimated.places);
        }
        let nominal = nominal_step(&path.positions).ok_or(SourceError::NoMotion {
            frames: path.order.len(),
        })?;
        let turns = turns(&path.positions);
        if turns > 0 && settings.positions.is_some() {
            notices.push(format!("the camera turns back {turns} times"));
        }
        let longest = (path.order.len() as u64 - 1) / 2;
        let longest = longest.clamp(1, LONGEST_STRIDE);
        if let Some(stride) = settings.stride.filter(|&stride| stride > longest) {
            let frames = path.order.len();
            return Err(SourceError::Stride {
                stride,
                longest,
                frames,
            });
        }
        let mut look = |apart: usize| -> Result<Option<Survey>, SourceError> {
            survey(&path, apart, size, &mut pixels)
        };
        let near = match settings.stride {
            Some(_) if !is_guessed => None,
            _ => look(1)?,
        };
        let per_step = |(least, most): (f32, f32)| least.abs().max(most.abs()) * nominal as f32;
        let stride = settings.stride.unwrap_or_else(|| {
            let greatest = near.map_or(0.0, |near| per_step(near.disparities)).max(0.5);
            let fit = (MOST_OF_WIDTH * size.width as f32 / greatest).floor() as u64;
            fit.clamp(
                1,
                (path.order.len() as u64 / FRAMES_A_STRIDE).clamp(1, longest),
            )
        });
        let baseline = nominal * stride as f64;
        let far = match settings.drift {
            None => look((2 * stride as usize).min(path.order.len() - 1))?,
            Some(_) => None,
        };
        let drift_px = settings.drift.unwrap_or_else(|| {
            let drift = far.map_or(0.0, |far| f64::from(far.drift) * baseline);
            if drift.abs() < LEVEL_PX { 0.0 } else { drift }
        });
        if settings.stride.is_none() {
            notices.push(match stride {
                1 => "frames that follow each other are matched; set stride".to_owned(),
                _ => format!("frames {stride} apart are matched; set stride"),
            });
        }
        if (2.0 * drift_px).abs() > MOST_DRIFT_PX {
            warnings.push(format!(
                "the picture drifts {:.1} rows over a triple, and at most {MOST_DRIFT_PX} can be made good: level the camera or choose a smaller stride",
                2.0 * drift_px
            ));
        } else if drift_px != 0.0 && settings.drift.is_none() {
            notices.push(format!(
                "the picture drifts {drift_px:.2} rows a baseline, which is made good; set drift"
            ));
        }
        let step_m = camera.baseline_m;
        let calibration = Calibration {
            baseline_m: step_m * baseline,
            ..camera
        };
        let mut seen = near.or(far).map(|seen| seen.disparities);
        if is_guessed {
            // What is near moves against the camera.
            let is_to_the_left = seen.is_some_and(|(least, most)| least + most < 0.0);
            if is_to_the_left {
                path.positions.iter_mut().for_each(|place| *place = -*place);
                seen = seen.map(|(least, most)| (-most, -least));
            }
            let way = if is_to_the_left { "left" } else { "right" };
            let steps = match &estimated {
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
            };
            notices.push(format!(
                "where the frames were taken is not said: {steps}; set positions"
            ));
        }
        Ok(Self {
            positions_m: path.positions.iter().map(|place| place * step_m).collect(),
            order: path.order,
            rail: messages::Rail {
                stride,
                drift_px,
                follow: 0,
            },
            disparities: seen
                .map(|(least, most)| (least * baseline as f32, most * baseline as f32)),
            calibration,
            notices,
            warnings,
        })
    }

    /// Which picture of the source a frame is, and where it was taken; a source with fewer begins again.
    pub(crate) fn frame(&self, scan: u64) -> (usize, f64) {
        let turn = (scan % self.order.len() as u64) as usize;
        (self.order[turn], self.positions_m[turn])
    }
}

/// The distance between frames that follow each other: the median of those at which the camera moved.
fn nominal_step(positions: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = positions
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .collect();
    steps.retain(|step| *step > 0.0);
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
}

/// How often the camera turns back.
fn turns(positions: &[f64]) -> usize {
    let steps = positions.windows(2).map(|pair| pair[1] - pair[0]);
    let moves: Vec<f64> = steps.filter(|step| *step != 0.0).collect();
    moves
        .windows(2)
        .filter(|pair| pair[0] * pair[1] < 0.0)
        .count()
}

/// Looks at pairs of frames so far apart, evenly along the rail. `None` when nothing was seen to move.
fn survey(
    path: &Passed,
    apart: usize,
    size: Size,
    pixels: &mut impl FnMut(usize) -> Result<Vec<u8>, SourceError>,
) -> Result<Option<Survey>, SourceError> {
    let last = path.order.len() - apart;
    let looks = LOOKS.min(last);
    let (mut disparities, mut drifts) = (Vec::new(), Vec::new());
    for look in 0..looks {
        let at = look * (last - 1) / (looks - 1).max(1);
        let step = (path.positions[at + apart] - path.positions[at]) as f32;
        if step == 0.0 {
            continue;
        }
        let pair = [pixels(path.order[at])?, pixels(path.order[at + apart])?];
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
    fn the_nominal_step_is_the_median_of_those_that_were_made() {
        assert_eq!(nominal_step(&[0.0, 1.0, 1.0, 2.1, 1.1]), Some(1.0));
        assert_eq!(nominal_step(&[3.0, 3.0]), None);
    }

    #[test]
    fn turning_back_is_counted_whether_or_not_the_camera_pauses() {
        assert_eq!(turns(&[0.0, 1.0, 2.0, 2.0, 1.0, 0.0, 1.0]), 2);
        assert_eq!(turns(&[0.0, 1.0, 1.0, 2.0]), 0);
    }
}
