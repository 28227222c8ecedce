//! Where the frames of a rail were taken, from the images alone: how far blocks of texture go from frame to frame.
//!
//! How far a block goes depends on how far it is away and on how far the camera moved; the ratio of two ways of the *same*
//! block only on the camera. So every frame's place follows from those before it, up to one scale, whatever the scene looks
//! like. Errors add up along the rail: an encoder knows better.

use std::collections::BTreeMap;

use messages::Size;

use crate::error::SourceError;
use crate::motion::{Picture, SPACING, moved, quantile};
use crate::rail::usual_step;

/// Blocks that are enough to judge by.
const ENOUGH: usize = 12;
/// Pixels that nearly nothing moves by when the camera stands still.
const STILL_PX: f32 = 0.5;
/// Pixels the median block must have gone for a frame to be what later ones are compared with.
const FAR_PX: f32 = 6.0;
/// Share of the usual step by which steps may differ that are taken for equal: an estimate is no better.
const EQUAL: f64 = 0.08;
/// The same in pixels of the median block, where steps are small, and the most that comes to.
const EQUAL_PX: f64 = 0.2;
const MOST_EQUAL: f64 = 0.4;
/// How far blocks may disagree on a step, as a share of it, standard error, for it to be believed.
const UNSURE: f64 = 0.02;

/// Frames that follow each other and of which nothing can be told, at most.
const MOST_UNKNOWN: u32 = 3;
/// Pixels of all frames whose places are estimated, at most, or frames if those are more: every one is searched before the
/// first is matched, a thousand of these in some seconds.
const MOST_PIXELS: usize = 1000 * 640 * 512;
const MOST_FRAMES: usize = 500;

/// Of how many frames places are estimated at most.
pub(crate) fn most_frames(size: Size) -> usize {
    (MOST_PIXELS / size.pixels().max(1)).max(MOST_FRAMES)
}

/// How far each block went, in columns to the left, by its place.
type Ways = BTreeMap<(usize, usize), f32>;

/// Places along a rail, in usual steps.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Estimated {
    /// Of every frame.
    pub(crate) places: Vec<f64>,
    /// Share of the usual step by which steps may differ that are taken for equal.
    pub(crate) equal: f64,
}

impl Estimated {
    /// The least and the greatest step from one frame to the next.
    pub(crate) fn steps(&self) -> (f64, f64) {
        let steps = self.places.windows(2).map(|pair| pair[1] - pair[0]);
        steps.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), step| {
            (least.min(step), most.max(step))
        })
    }

    /// Whether all steps are equal, as far as can be told.
    pub(crate) fn are_equal(&self) -> bool {
        let (least, most) = self.steps();
        least > 1.0 - self.equal && most < 1.0 + self.equal
    }
}

/// A frame with which later ones are compared.
struct Anchor {
    pixels: Vec<u8>,
    place: f64,
    /// Columns to the left that each block goes when the camera moves by one.
    disparities: Ways,
}

/// The search for blocks, no wider than it need be.
struct Search {
    size: Size,
    /// How far they went at most, the last time.
    longest: f32,
    /// How many were found.
    found: usize,
}

impl Search {
    fn new(size: Size) -> Self {
        Self {
            size,
            longest: f32::INFINITY,
            found: 0,
        }
    }

    fn ways(&mut self, from: &[u8], to: &[u8]) -> Ways {
        let picture = |pixels| Picture {
            size: self.size,
            pixels,
        };
        // Large pictures have blocks enough far apart.
        let spacing = SPACING.max(self.size.width as usize / 12);
        let within = |reach: usize| -> Ways {
            let found = moved(&picture(from), &picture(to), reach, spacing);
            let way = found.into_iter().map(|way| (way.block, -way.right));
            way.collect()
        };
        let whole = (self.size.width as usize / 8).max(8);
        let narrow = (1.5 * self.longest + 4.0) as usize;
        let mut ways = within(narrow.min(whole));
        // The camera may have gone further than before.
        if narrow < whole && 4 * ways.len() < 3 * self.found {
            ways = within(whole);
        }
        self.found = ways.len();
        let far = quantile(ways.values().map(|way| way.abs()).collect(), 0.98);
        self.longest = far.unwrap_or(f32::INFINITY);
        ways
    }
}

/// Estimates where so many frames were taken; `pixels` gives one of them. `None` where the images do not tell.
pub(crate) fn estimated(
    frames: usize,
    size: Size,
    mut pixels: impl FnMut(usize) -> Result<Vec<u8>, SourceError>,
) -> Result<Option<Estimated>, SourceError> {
    let mut search = Search::new(size);
    let mut places = vec![0.0];
    let mut anchor = Anchor {
        pixels: pixels(0)?,
        place: 0.0,
        disparities: BTreeMap::new(),
    };
    // Until the camera has moved nothing is known of the scene: ways from the first frame.
    let mut before: Vec<Ways> = Vec::new();
    let (mut last_step, mut in_a_row) = (0.0, 0);
    // Pixels that the median block goes when the camera moves by one.
    let mut speeds = Vec::new();
    for frame in 1..frames {
        let here = pixels(frame)?;
        let seen = search.ways(&anchor.pixels, &here);
        let median = quantile(seen.values().map(|way| way.abs()).collect(), 0.5);
        let median = median.unwrap_or_default();
        if anchor.disparities.is_empty() && median < FAR_PX && frame + 1 < frames {
            before.push(seen);
            continue;
        }
        let measured = if anchor.disparities.is_empty() {
            if median < STILL_PX || seen.len() < ENOUGH {
                return Ok(None);
            }
            // The whole way so far is the unit, for now.
            for way in before.drain(..) {
                let Some(place) = ratio(&way, &seen) else {
                    return Ok(None);
                };
                places.push(place);
            }
            anchor.disparities = seen;
            Some(1.0)
        } else {
            ratio(&seen, &anchor.disparities).map(|way| anchor.place + way)
        };
        // Where blocks do not agree, as in a blurred frame, the camera is taken to go on as it did.
        let latest = places[frame - 1];
        in_a_row = if measured.is_some() { 0 } else { in_a_row + 1 };
        if in_a_row > MOST_UNKNOWN {
            return Ok(None);
        }
        let place = measured.unwrap_or(latest + last_step);
        last_step = place - latest;
        places.push(place);
        if measured.is_some() && (median >= FAR_PX || frame + 1 == frames) {
            speeds.push(median / (place - anchor.place).abs() as f32);
        }
        if measured.is_some() && median >= FAR_PX {
            let back = search.ways(&here, &anchor.pixels);
            let way = (place - anchor.place) as f32;
            let disparities = back.into_iter().map(|(block, back)| (block, -back / way));
            anchor = Anchor {
                disparities: disparities.collect(),
                pixels: here,
                place,
            };
        }
    }
    Ok(quantile(speeds, 0.5).and_then(|speed| in_usual_steps(&places, f64::from(speed))))
}

/// How far the camera moved for blocks to go these ways: the median of what each says that goes far enough to tell; `None`
/// where too few do, or they do not agree.
fn ratio(ways: &Ways, disparities: &Ways) -> Option<f64> {
    let said = ways.iter().filter_map(|(block, way)| {
        let disparity = disparities.get(block).filter(|d| d.abs() > 1.0)?;
        Some(way / disparity)
    });
    let said: Vec<f32> = said.collect();
    if said.len() < ENOUGH {
        return None;
    }
    let at = |share| quantile(said.clone(), share).map(f64::from);
    let (low, middle, high) = (at(0.25)?, at(0.5)?, at(0.75)?);
    // Of a normal distribution the quartiles are 1.35 standard deviations apart.
    let error = (high - low) / 1.35 / (said.len() as f64).sqrt();
    (error <= UNSURE * middle.abs().max(1.0)).then_some(middle)
}

/// The places in units of the usual step: the median of those at which the camera moved; the median block goes so many
/// pixels for a unit. `None` when it did not move.
fn in_usual_steps(places: &[f64], speed: f64) -> Option<Estimated> {
    let usual = usual_step(places)?;
    // What is left of a step where the camera stood still is the estimate's own.
    let mut place = 0.0;
    let mut settled = vec![0.0];
    for pair in places.windows(2) {
        let step = (pair[1] - pair[0]) / usual;
        place += if step.abs() < EQUAL { 0.0 } else { step };
        settled.push(place);
    }
    let equal = (EQUAL_PX / (speed * usual)).clamp(EQUAL, MOST_EQUAL);
    Some(Estimated {
        places: settled,
        equal,
    })
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::motion::texture::wave;

    const SIZE: Size = Size::new(320, 200);

    /// A ground that lies nearer further down, from a place along a rail.
    fn picture(place: f64) -> Vec<u8> {
        let pixels = (0..SIZE.pixels()).map(|pixel| {
            let (x, y) = ((pixel % 320) as f64, (pixel / 320) as f64);
            wave(x + place * (6.0 + 0.02 * y), y)
        });
        pixels.collect()
    }

    fn of(places: &[f64]) -> Option<Estimated> {
        estimated(places.len(), SIZE, |frame| Ok(picture(places[frame]))).unwrap()
    }

    #[test]
    fn unequal_steps_pauses_and_a_turn_are_estimated_up_to_their_scale() {
        let places = [0.0, 1.0, 2.0, 3.5, 4.5, 4.5, 5.3, 6.3, 5.3, 4.3, 3.3, 2.3];
        for sign in [1.0, -1.0] {
            let moved: Vec<f64> = places.iter().map(|place| sign * place).collect();
            let estimated = of(&moved).unwrap();
            assert!(!estimated.are_equal());
            // Which way is forward nobody knows.
            for (place, truth) in estimated.places.iter().zip(places) {
                assert!(
                    (place - truth).abs() < 0.1,
                    "{place} {truth}: {estimated:?}"
                );
            }
        }
    }

    #[test]
    fn a_camera_that_stands_still_first_and_creeps_is_followed_too() {
        let mut places = vec![0.0; 20];
        places.extend((1..20).map(f64::from));
        let estimated = of(&places).unwrap();
        assert!(!estimated.are_equal());
        for (place, truth) in estimated.places.iter().zip(&places) {
            assert!((place - truth).abs() < 0.1, "{estimated:?}");
        }
        // A tenth of that from frame to frame, and a rest in the middle.
        let creeping = (0..60u32).map(|frame| frame.min(30) + frame.saturating_sub(40));
        let places: Vec<f64> = creeping.map(f64::from).collect();
        let slow: Vec<f64> = places.iter().map(|place| 0.15 * place).collect();
        let estimated = of(&slow).unwrap();
        for (place, truth) in estimated.places.iter().zip(&places) {
            assert!(
                (place - truth).abs() < 1.0,
                "{place} {truth}: {estimated:?}"
            );
        }
    }

    #[test]
    fn one_frame_that_tells_nothing_does_no_harm() {
        let places: Vec<f64> = (0..12).map(f64::from).collect();
        let frames = |frame: usize| match frame {
            5 => Ok(vec![90; SIZE.pixels()]),
            _ => Ok(picture(places[frame])),
        };
        let estimated = estimated(12, SIZE, frames).unwrap().unwrap();
        assert!(estimated.are_equal(), "{estimated:?}");
    }

    #[test]
    fn equal_steps_are_equal_and_short_ones_too() {
        for step in [1.0, 0.3] {
            let places: Vec<f64> = (0..14).map(|frame| f64::from(frame) * step).collect();
            let estimated = of(&places).unwrap();
            assert!(estimated.are_equal(), "{step}: {:?}", estimated.steps());
        }
    }

    #[test]
    fn a_camera_that_stands_still_and_pictures_without_texture_tell_nothing() {
        assert_eq!(of(&[2.0; 6]), None);
        let flat = estimated(5, SIZE, |_| Ok(vec![90; SIZE.pixels()])).unwrap();
        assert_eq!(flat, None);
    }
}
