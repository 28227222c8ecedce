//! Where the frames of a rail were taken, from the images alone: how far blocks of texture go from frame to frame.
//!
//! How far a block goes depends on how far it is away and on how far the camera moved; the ratio of two ways of the *same*
//! block only on the camera. So every frame's place follows from those before it, up to one scale, whatever the scene looks
//! like. Errors add up along the rail: an encoder knows better.

use std::collections::BTreeMap;

use messages::Size;

use crate::error::SourceError;
use crate::motion::{Picture, SPACING, moved, quantile};

/// Blocks that are enough to judge by.
const ENOUGH: usize = 12;
/// Pixels that nearly nothing moves by when the camera stands still.
const STILL_PX: f32 = 0.5;
/// Pixels the median block must have gone for a frame to be what later ones are compared with.
const FAR_PX: f32 = 6.0;
/// Share of the usual step by which steps may differ that are taken for equal: an estimate is no better.
const EQUAL: f64 = 0.08;
/// How far blocks may disagree on a step, as a share of it, standard error, for it to be believed.
const UNSURE: f64 = 0.02;

/// How far each block went, in columns to the left, by its place.
type Ways = BTreeMap<(usize, usize), f32>;

/// Places along a rail, in usual steps.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Estimated {
    /// Of every frame.
    pub(crate) places: Vec<f64>,
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
        least > 1.0 - EQUAL && most < 1.0 + EQUAL
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
    for frame in 1..frames {
        let here = pixels(frame)?;
        let seen = search.ways(&anchor.pixels, &here);
        let Some(median) = quantile(seen.values().map(|way| way.abs()).collect(), 0.5) else {
            return Ok(None);
        };
        if seen.len() < ENOUGH {
            return Ok(None);
        }
        if anchor.disparities.is_empty() {
            if median < FAR_PX && frame + 1 < frames {
                before.push(seen);
                continue;
            }
            if median < STILL_PX {
                return Ok(None);
            }
            // The way so far is the unit, for now.
            let place = (before.len() + 1) as f64;
            let unit = seen.into_iter();
            let unit: Ways = unit
                .map(|(block, way)| (block, way / place as f32))
                .collect();
            for (seen, usual) in before.drain(..).zip(1u16..) {
                places.push(ratio(&seen, &unit).unwrap_or(usual.into()));
            }
            places.push(place);
            anchor.disparities = unit;
        } else {
            // What blocks do not agree on goes on as before.
            let before = places[frame - 1] + usual_step(&places);
            let seen = ratio(&seen, &anchor.disparities);
            places.push(seen.map_or(before, |way| anchor.place + way));
        }
        let place = places[frame];
        if median >= FAR_PX {
            let way = (place - anchor.place) as f32;
            let back = search.ways(&here, &anchor.pixels);
            let disparities = back.into_iter().map(|(block, back)| (block, -back / way));
            anchor = Anchor {
                disparities: disparities.collect(),
                pixels: here,
                place,
            };
        }
    }
    Ok(in_usual_steps(places))
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

/// The median of the steps so far.
fn usual_step(places: &[f64]) -> f64 {
    let steps = places.windows(2).map(|pair| (pair[1] - pair[0]) as f32);
    quantile(steps.collect(), 0.5).map_or(1.0, f64::from)
}

/// The places in units of the usual step: the median of those at which the camera moved. `None` when it did not.
fn in_usual_steps(places: Vec<f64>) -> Option<Estimated> {
    let steps = places.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let longest = steps.clone().fold(0.0, f64::max);
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.1 * longest).collect();
    steps.sort_by(f64::total_cmp);
    let usual = *steps.get(steps.len() / 2)?;
    // What is left of a step where the camera stood still is the estimate's own.
    let mut place = 0.0;
    let mut settled = vec![0.0];
    for pair in places.windows(2) {
        let step = (pair[1] - pair[0]) / usual;
        place += if step.abs() < EQUAL { 0.0 } else { step };
        settled.push(place);
    }
    Some(Estimated { places: settled })
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    const SIZE: Size = Size::new(320, 200);

    /// Waves that no block finds twice, on a ground that lies nearer further down, from a place along a rail.
    fn picture(place: f64) -> Vec<u8> {
        let waves = [
            (0.31, 0.12, 0.4),
            (0.07, 0.43, 1.9),
            (0.53, -0.29, 0.7),
            (0.19, 0.22, 2.6),
            (-0.41, 0.37, 3.1),
            (0.23, -0.61, 5.0),
        ];
        let pixels = (0..SIZE.pixels()).map(|pixel| {
            let (x, y) = ((pixel % 320) as f64, (pixel / 320) as f64);
            let x = x + place * (6.0 + 0.02 * y);
            let value: f64 = waves
                .iter()
                .map(|(a, b, c)| (a * x + b * y + c).sin())
                .sum();
            (127.0 + 20.0 * value).clamp(0.0, 255.0) as u8
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
