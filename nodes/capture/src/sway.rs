//! By how much the frames of a rail are off from where an even motion would have put them, from the images alone.
//!
//! ```text
//! blocks of every frame, followed into later ones ─► rows: down, turn, scale ─► columns: right ─► Sway of every frame
//! ```
//!
//! A point that a camera on an ideal rail passes stays in its row, whatever its depth: what rows say is the sway alone. In
//! its row it moves in proportion to the camera, at a pace that depends on its depth; whoever is seen in three frames or
//! more says by how much they miss that. Everything is linear in what is sought and binds frames only that a triple
//! reaches, so that it is solved at once for the whole rail, by least squares with weights that leave out what was mistaken.
//!
//! What changes slowly along the rail is not told from how the camera went: a constant, or what grows evenly, is a matter of
//! places and drift. Nothing in the images speaks against it, so that a weak pull towards none decides.

use std::collections::VecDeque;

use messages::{Size, Sway};

use crate::error::SourceError;
use crate::motion::{Block, Costs, MIDDLE, Picture, SPACING, corners, quantile};

/// Pixels of sway from one frame to the next, root mean square over picture and rail, below which a rail is steady: the
/// estimate itself is off by less than half of that, and matching does not mind.
const STEADY_PX: f64 = 0.07;
/// Blocks across a picture, at most.
const ACROSS: usize = 12;
/// Rows up and down in which a block is looked for.
const ROWS: i32 = 3;
/// Columns about where a block is expected.
const COLUMNS: i32 = 3;
/// Pixels by which a frame may be off in columns, for a block to be found in a later one.
const MOST_PX: f32 = 0.7;
/// Blocks that are enough to tell where a frame is, on average.
const ENOUGH: usize = 8;
/// Standard deviation of the pull towards no sway, in pixels.
const PULL_PX: f64 = 1.0;
/// Rounds in which weights settle.
const ROUNDS: usize = 8;
/// What is missed by more than so many standard deviations counts for nothing (Tukey's biweight).
const MISTAKEN: f64 = 4.7;
/// Pixels that a block is never surer than.
const LEAST_SIGMA_PX: f64 = 0.02;

/// What was found of a rail's frames.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Found {
    /// Of every frame; none of a steady rail.
    pub(crate) sway: Vec<Sway>,
    /// By how much frames are off from one to the next, root mean square, in pixels.
    pub(crate) px: f64,
    /// Rows by which the picture lies lower for one unit of position, beside the drift that was known.
    pub(crate) drift: f64,
}

/// The rail whose frames are looked at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Looked<'a> {
    pub(crate) size: Size,
    /// Where each frame was taken.
    pub(crate) positions: &'a [f64],
    /// Frames from one member of a triple to the next.
    pub(crate) stride: usize,
    /// Rows by which the picture lies lower for one unit of position.
    pub(crate) drift: f64,
}

impl Looked<'_> {
    /// Frames between those that are compared: neighbours, and those of a triple.
    fn gaps(&self) -> Vec<usize> {
        let mut gaps = vec![1, self.stride.max(2), (2 * self.stride).max(2)];
        gaps.dedup();
        gaps.retain(|&gap| gap < self.positions.len());
        gaps
    }

    fn way(&self, from: usize, to: usize) -> f64 {
        self.positions[to] - self.positions[from]
    }
}

/// A point that was followed from a frame or view into others.
#[derive(Clone, Debug, PartialEq)]
pub struct Sighted {
    /// From which.
    pub from: usize,
    /// Its column and row there, from the middle of the picture.
    pub at: [f64; 2],
    /// Into which others, and by how many columns and rows further it was seen there.
    pub seen: Vec<(usize, [f64; 2])>,
}

/// By how much each of a rig's views, a baseline apart, is off beside the mean of all; `None` where too little was followed.
///
/// Beside what a place further to the right explains columns can be off only by what is not in proportion to it.
pub fn residual(size: Size, views: usize, followed: &[Sighted]) -> Option<Vec<Sway>> {
    let positions: Vec<f64> = (0..views).map(|view| view as f64).collect();
    let looked = Looked {
        size,
        positions: &positions,
        stride: 1,
        drift: 0.0,
    };
    let is_seen = |view: usize| {
        let sees = |sighted: &&Sighted| {
            sighted.from == view || sighted.seen.iter().any(|(other, _)| *other == view)
        };
        followed.iter().filter(sees).count() >= ENOUGH
    };
    // Of two views that an inner one is seen in, each may lie two further than the other.
    (views >= 3 && (0..views).all(is_seen)).then(|| solved(&looked, followed, 2))
}

/// A frame whose blocks are looked for in later ones.
struct Base {
    frame: usize,
    blocks: Vec<(Block, Sighted)>,
}

/// Looks at all frames; `pixels` gives one of them. `None` where they do not tell.
pub(crate) fn found(
    looked: &Looked<'_>,
    mut pixels: impl FnMut(usize) -> Result<Vec<u8>, SourceError>,
) -> Result<Option<Found>, SourceError> {
    let followed = follow(looked, &mut pixels)?;
    let frames = looked.positions.len();
    if frames < 3 || followed.len() < ENOUGH * frames {
        return Ok(None);
    }
    Ok(Some(solve(looked, &followed)))
}

/// Follows blocks of every frame into those that it is compared with.
fn follow(
    looked: &Looked<'_>,
    pixels: &mut impl FnMut(usize) -> Result<Vec<u8>, SourceError>,
) -> Result<Vec<Sighted>, SourceError> {
    let Looked { size, .. } = *looked;
    let gaps = looked.gaps();
    let longest = gaps.iter().copied().max().unwrap_or_default();
    let spacing = SPACING.max(size.width as usize / ACROSS);
    let middle = [size.width, size.height].map(|side| (f64::from(side) - 1.0) / 2.0);
    let mut bases: VecDeque<Base> = VecDeque::new();
    let mut all = Vec::new();
    let mut costs = Costs::default();
    // Columns that blocks went for a unit of position, nearly the least and nearly the greatest.
    let mut pace: Option<[f32; 2]> = None;
    for frame in 0..looked.positions.len() {
        let here = pixels(frame)?;
        let picture = Picture {
            size,
            pixels: &here,
        };
        // The nearest first: what it says helps to find blocks of those before.
        for base in bases.iter_mut().rev() {
            if !gaps.contains(&(frame - base.frame)) {
                continue;
            }
            let way = looked.way(base.frame, frame);
            let drifted = (looked.drift * way).round() as i32;
            let rows = drifted - ROWS..=drifted + ROWS;
            let mut paces = Vec::new();
            for (block, followed) in &mut base.blocks {
                let columns = expected(looked, followed, frame, pace);
                if let Some(moved) = block.found(&picture, columns, rows.clone(), &mut costs) {
                    followed.seen.push((frame, moved.map(f64::from)));
                    paces.push(moved[0] / way as f32);
                }
            }
            if frame - base.frame == 1
                && paces.len() >= ENOUGH
                && paces.iter().all(|p| p.is_finite())
            {
                let ends = [0.02, 0.98].map(|share| quantile(paces.clone(), share));
                if let [Some(least), Some(most)] = ends {
                    pace = Some([least, most]);
                }
            }
        }
        while bases
            .front()
            .is_some_and(|base| frame - base.frame >= longest)
        {
            all.extend(bases.pop_front());
        }
        let blocks = corners(size, spacing).filter_map(|(x, y)| {
            let block = Block::of(&picture, x, y)?;
            let followed = Sighted {
                from: frame,
                at: [x as f64 + MIDDLE - middle[0], y as f64 + MIDDLE - middle[1]],
                seen: Vec::new(),
            };
            Some((block, followed))
        });
        bases.push_back(Base {
            frame,
            blocks: blocks.collect(),
        });
    }
    all.extend(bases);
    let all = all.into_iter().flat_map(|base| base.blocks);
    let all = all.map(|(_, followed)| followed);
    Ok(all.filter(|followed| !followed.seen.is_empty()).collect())
}

/// The columns in which a block is looked for in a frame.
fn expected(
    looked: &Looked<'_>,
    followed: &Sighted,
    frame: usize,
    pace: Option<[f32; 2]>,
) -> std::ops::RangeInclusive<i32> {
    let way = looked.way(followed.from, frame);
    let last = followed
        .seen
        .last()
        .map(|&(to, moved)| (looked.way(followed.from, to), moved));
    if let Some((before, moved)) = last.filter(|(before, _)| *before != 0.0) {
        let longer = way / before;
        let column = (moved[0] * longer).round() as i32;
        let reach = COLUMNS + (f64::from(MOST_PX) * longer.abs()).ceil() as i32;
        return column - reach..=column + reach;
    }
    let Some(pace) = pace else {
        let most = (looked.size.width as i32 / 6).max(8);
        return -most..=most;
    };
    let ends = pace.map(|pace| pace * way as f32);
    let (least, most) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    least.floor() as i32 - COLUMNS..=most.ceil() as i32 + COLUMNS
}

/// The sway of all frames from what was followed.
fn solve(looked: &Looked<'_>, followed: &[Sighted]) -> Found {
    let reach = looked.gaps().into_iter().max().unwrap_or_default();
    let mut sway = solved(looked, followed, reach);
    let trend = |of: fn(&Sway) -> f64| {
        let values: Vec<f64> = sway.iter().map(of).collect();
        line(looked.positions, &values)
    };
    let (right, down) = (trend(|sway| sway.right_px), trend(|sway| sway.down_px));
    for (sway, place) in sway.iter_mut().zip(looked.positions) {
        sway.right_px -= right[0] + right[1] * place;
        sway.down_px -= down[0] + down[1] * place;
    }
    let px = size_px(&sway, arm(looked.size), looked.stride);
    if px < STEADY_PX {
        sway.clear();
    }
    Found {
        sway,
        px,
        drift: down[1],
    }
}

/// Pixels that a turn by one moves the picture, root mean square.
fn arm(size: Size) -> f64 {
    let Size { width, height } = size;
    ((f64::from(width).powi(2) + f64::from(height).powi(2)) / 12.0).sqrt()
}

/// By how much each frame or view is off, where what was followed binds only those so near each other.
fn solved(looked: &Looked<'_>, followed: &[Sighted], reach: usize) -> Vec<Sway> {
    let frames = looked.positions.len();
    // So that all unknowns are pixels.
    let arm = arm(looked.size);
    let by_rows = rows(looked, followed, arm, frames, reach);
    let mut sway: Vec<Sway> = by_rows
        .as_chunks::<3>()
        .0
        .iter()
        .map(|&[down, turn, scale]| Sway {
            right_px: 0.0,
            down_px: down,
            turn: turn / arm,
            scale: scale / arm,
        })
        .collect();
    let by_columns = columns(looked, followed, &sway, reach);
    for (sway, right) in sway.iter_mut().zip(by_columns) {
        sway.right_px = right;
    }
    sway
}

/// By how much frames are off from the mean of those a stride before and after, as of frames that are off independently of
/// each other.
fn size_px(sway: &[Sway], arm: f64, stride: usize) -> f64 {
    let apart = match 2 * stride < sway.len() {
        true => stride,
        false => 1,
    };
    let off = (apart..sway.len().saturating_sub(apart)).map(|at| {
        let [before, here, after] = [at - apart, at, at + apart].map(|at| {
            let Sway {
                right_px,
                down_px,
                turn,
                scale,
            } = sway[at];
            [right_px, down_px, turn * arm, scale * arm]
        });
        let parts = (0..4).map(|k| here[k] - (before[k] + after[k]) / 2.0);
        parts.map(|part| part * part).sum::<f64>() / 1.5
    });
    let count = off.clone().count().max(1);
    (off.sum::<f64>() / count as f64).sqrt()
}

/// Offset and slope of the least-squares line of values over places.
fn line(places: &[f64], values: &[f64]) -> [f64; 2] {
    let n = places.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
    let (place, value) = (mean(places), mean(values));
    let both = || places.iter().zip(values);
    let spread: f64 = places.iter().map(|p| (p - place) * (p - place)).sum();
    let product: f64 = both().map(|(p, v)| (p - place) * (v - value)).sum();
    let slope = if spread > 0.0 { product / spread } else { 0.0 };
    [value - slope * place, slope]
}

/// Down, turn and scale of every frame, in pixels, from the rows of what was followed.
///
/// Turn and scale act where a block is halfway: what they have in common in both frames is no sway but how the camera is
/// turned against its rail, and is left to the drift.
fn rows(
    looked: &Looked<'_>,
    followed: &[Sighted],
    arm: f64,
    frames: usize,
    reach: usize,
) -> Vec<f64> {
    const UNKNOWNS: usize = 3;
    let sightings = followed.iter().flat_map(|block| {
        block.seen.iter().map(move |&(to, moved)| {
            let halfway = [0, 1].map(|k| (block.at[k] + moved[k] / 2.0) / arm);
            let rows = moved[1] - looked.drift * looked.way(block.from, to);
            ([block.from, to], [1.0, halfway[0], halfway[1]], rows)
        })
    });
    let sightings: Vec<_> = sightings.collect();
    let miss = |known: &[f64]| -> Vec<f64> {
        let of = |([from, to], factors, rows): &([usize; 2], [f64; 3], f64)| {
            let explained = |frame: &usize| -> f64 {
                let own = &known[UNKNOWNS * frame..][..UNKNOWNS];
                own.iter().zip(factors).map(|(a, b)| a * b).sum()
            };
            rows - (explained(to) - explained(from))
        };
        sightings.iter().map(of).collect()
    };
    let mut known = vec![0.0; UNKNOWNS * frames];
    for _ in 0..ROUNDS {
        let misses = miss(&known);
        let sigma = deviation(&misses);
        let mut band = Band::new(UNKNOWNS * frames, UNKNOWNS * (reach + 1));
        band.pull(sigma / PULL_PX);
        for (([from, to], factors, rows), miss) in sightings.iter().zip(&misses) {
            let weight = biweight(*miss / sigma);
            if weight == 0.0 {
                continue;
            }
            let factor = |(i, factor): (usize, &f64)| {
                [(UNKNOWNS * from + i, -factor), (UNKNOWNS * to + i, *factor)]
            };
            let terms: Vec<(usize, f64)> = factors.iter().enumerate().flat_map(factor).collect();
            band.add(&terms, *rows, weight);
        }
        known = band.solved();
    }
    known
}

/// To which frame, how far the camera went on the way, and by how many columns a block moved.
type Way = (usize, f64, f64);

/// Right of every frame, in pixels, from the columns of what was followed into two or more, once turn and scale are known.
fn columns(looked: &Looked<'_>, followed: &[Sighted], sway: &[Sway], reach: usize) -> Vec<f64> {
    let frames = sway.len();
    // Of every block the ways of the camera, and the columns it went.
    let blocks = followed.iter().filter(|block| block.seen.len() > 1);
    let blocks = blocks.map(|block| {
        let own = &sway[block.from];
        let seen = block.seen.iter().map(|&(to, moved)| {
            let there = &sway[to];
            let halfway = [0, 1].map(|k| block.at[k] + moved[k] / 2.0);
            let known =
                (there.scale - own.scale) * halfway[0] - (there.turn - own.turn) * halfway[1];
            (to, looked.way(block.from, to), moved[0] - known)
        });
        (block.from, seen.collect::<Vec<_>>())
    });
    let blocks: Vec<(usize, Vec<Way>)> = blocks.collect();
    // What is left of a block's columns when its own pace is taken away.
    let rid = |ways: &[Way], columns: &[f64]| -> Vec<f64> {
        let squares: f64 = ways.iter().map(|(_, way, _)| way * way).sum();
        let product: f64 = ways.iter().zip(columns).map(|((_, w, _), c)| w * c).sum();
        let pace = if squares > 0.0 {
            product / squares
        } else {
            0.0
        };
        let rest = ways
            .iter()
            .zip(columns)
            .map(|((_, way, _), c)| c - pace * way);
        rest.collect()
    };
    let miss = |known: &[f64]| -> Vec<f64> {
        let of = |(from, ways): &(usize, Vec<(usize, f64, f64)>)| {
            let off = |(to, _, columns): &(usize, f64, f64)| columns - (known[*to] - known[*from]);
            let off: Vec<f64> = ways.iter().map(off).collect();
            let rest = rid(ways, &off);
            // As many are independent as there are, less the pace.
            let squares: f64 = rest.iter().map(|rest| rest * rest).sum();
            (squares / (ways.len() - 1) as f64).sqrt()
        };
        blocks.iter().map(of).collect()
    };
    let mut known = vec![0.0; frames];
    for _ in 0..ROUNDS {
        let misses = miss(&known);
        let sigma = deviation(&misses);
        let mut band = Band::new(frames, reach + 1);
        band.pull(sigma / PULL_PX);
        for ((from, ways), miss) in blocks.iter().zip(&misses) {
            let weight = biweight(*miss / sigma);
            if weight == 0.0 {
                continue;
            }
            let columns: Vec<f64> = ways.iter().map(|(_, _, columns)| *columns).collect();
            let rest = rid(ways, &columns);
            let squares: f64 = ways.iter().map(|(_, way, _)| way * way).sum();
            for ((at, way, _), rest) in ways.iter().zip(rest) {
                // Row of the projection that takes the pace away.
                let mut terms = vec![(*from, 0.0)];
                for (to, other, _) in ways {
                    let own = if to == at { 1.0 } else { 0.0 };
                    let share = match squares > 0.0 {
                        true => own - way * other / squares,
                        false => own,
                    };
                    terms[0].1 -= share;
                    terms.push((*to, share));
                }
                band.add(&terms, rest, weight);
            }
        }
        known = band.solved();
    }
    known
}

/// Standard deviation of values that miss none, from their median: a few that are mistaken do not matter.
fn deviation(misses: &[f64]) -> f64 {
    let mut off: Vec<f64> = misses.iter().map(|miss| miss.abs()).collect();
    let middle = off.len() / 2;
    if off.is_empty() {
        return LEAST_SIGMA_PX;
    }
    let (_, median, _) = off.select_nth_unstable_by(middle, f64::total_cmp);
    (1.4826 * *median).max(LEAST_SIGMA_PX)
}

/// Tukey's weight of what is missed by so many standard deviations.
fn biweight(miss: f64) -> f64 {
    let share = miss / MISTAKEN;
    (1.0 - share * share).max(0.0).powi(2)
}

/// Normal equations of least squares in which unknowns are bound only to those near them.
struct Band {
    /// How many unknowns behind one it may be bound to, and itself.
    width: usize,
    /// By unknown: its products with itself and those behind it.
    products: Vec<f64>,
    right: Vec<f64>,
}

impl Band {
    fn new(unknowns: usize, width: usize) -> Self {
        Self {
            width,
            products: vec![0.0; unknowns * width],
            right: vec![0.0; unknowns],
        }
    }

    /// Says of every unknown that it is about zero, by so much.
    fn pull(&mut self, by: f64) {
        for own in self.products.chunks_exact_mut(self.width) {
            own[0] += by * by;
        }
    }

    /// Says that the sum of unknowns with factors is this.
    fn add(&mut self, terms: &[(usize, f64)], value: f64, weight: f64) {
        for &(one, by) in terms {
            self.right[one] += weight * by * value;
            for &(other, and) in terms.iter().filter(|(other, _)| *other >= one) {
                self.products[one * self.width + other - one] += weight * by * and;
            }
        }
    }

    /// The unknowns, by Cholesky's decomposition. The pull makes all pivots positive.
    fn solved(mut self) -> Vec<f64> {
        let (count, width) = (self.right.len(), self.width);
        let products = &mut self.products;
        for i in 0..count {
            let pivot = products[i * width].max(f64::MIN_POSITIVE).sqrt();
            let bound = width.min(count - i);
            for value in &mut products[i * width..][..bound] {
                *value /= pivot;
            }
            for j in 1..bound {
                let by = products[i * width + j];
                if by == 0.0 {
                    continue;
                }
                for k in j..bound {
                    products[(i + j) * width + k - j] -= by * products[i * width + k];
                }
            }
        }
        let mut solved = self.right;
        for i in 0..count {
            solved[i] /= products[i * width];
            for j in 1..width.min(count - i) {
                solved[i + j] -= products[i * width + j] * solved[i];
            }
        }
        for i in (0..count).rev() {
            for j in 1..width.min(count - i) {
                solved[i] -= products[i * width + j] * solved[i + j];
            }
            solved[i] /= products[i * width];
        }
        solved
    }
}
