//! Disparities along a curve: dynamic programming over the candidates of its points, runs, filling.
//!
//! A curve tracked across a depth step has no single disparity, so each point chooses for itself, and neighbours along
//! the curve pay for disagreeing: linearly at first, capped, so that one jump is affordable.

use messages::NONE;

use crate::candidates::{Candidate, Candidates};

/// What changes of disparity along a curve cost.
#[derive(Clone, Debug)]
pub(crate) struct Smoothness {
    /// Cost of a point without a candidate.
    pub(crate) nothing: f32,
    /// Cost of a pixel of change.
    pub(crate) change: f32,
    /// Most that a change costs.
    pub(crate) jump: f32,
    /// Cost of going over to another curve in the near view.
    pub(crate) crossing: f32,
}

/// A disparity chosen for a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// Disparity between neighbouring views, NaN for none.
    pub(crate) disparity: f32,
    /// What the candidate cost.
    pub(crate) cost: f32,
    /// How much dearer the best candidate elsewhere is.
    pub(crate) margin: f32,
    /// How far the three columns are from one straight motion, in pixels.
    pub(crate) bend: f32,
    /// Spots in the near and the far view; [`NONE`] where filled in.
    pub(crate) spots: [u32; 2],
    /// Number of points in its run.
    pub(crate) run: u32,
    /// Share of its neighbours that agree.
    pub(crate) support: f32,
}

impl Choice {
    pub(crate) const NOTHING: Self = Self {
        disparity: f32::NAN,
        cost: f32::INFINITY,
        margin: 0.0,
        bend: 0.0,
        spots: [NONE; 2],
        run: 0,
        support: 0.0,
    };

    /// Whether there is a disparity at all.
    pub(crate) fn is_some(&self) -> bool {
        !self.disparity.is_nan()
    }

    /// Whether it was seen in all three views.
    pub(crate) fn is_seen(&self) -> bool {
        self.spots[0] != NONE
    }
}

/// A way to be at a point: the disparity last chosen and what it took to get there.
#[derive(Clone, Copy, Debug)]
struct State {
    cost: f32,
    disparity: f32,
    curve: u32,
    back: u32,
    /// Index among the point's candidates, or [`NONE`] when the point chooses nothing.
    candidate: u32,
}

/// The dynamic programme, with its memory.
#[derive(Debug, Default)]
pub(crate) struct Along {
    states: Vec<State>,
    /// Where each point's states start.
    starts: Vec<u32>,
}

impl Along {
    /// Chooses disparities for the points of a curve; `near_curve` tells the curve a spot of the near view belongs to.
    pub(crate) fn choose(
        &mut self,
        points: std::ops::Range<usize>,
        candidates: &Candidates,
        smoothness: &Smoothness,
        near_curve: impl Fn(u32) -> u32,
        choices: &mut [Choice],
    ) {
        let Smoothness { nothing, change, jump, crossing } = *smoothness;
        self.states.clear();
        self.starts.clear();
        let start = State { cost: 0.0, disparity: f32::NAN, curve: NONE, back: NONE, candidate: NONE };
        self.states.push(start);
        let mut before = 0..1;
        for point in points.clone() {
            let own = candidates.of(point);
            self.starts.push(self.states.len() as u32);
            if own.is_empty() {
                // Nothing to choose, nothing to pay: the states stay as they are.
                continue;
            }
            let first = self.states.len();
            for (index, candidate) in own.iter().enumerate() {
                let curve = near_curve(candidate.spots[0]);
                let mut best = (f32::INFINITY, NONE);
                for back in before.clone() {
                    let state = &self.states[back];
                    // From NaN, min gives the jump.
                    let step = (change * (state.disparity - candidate.disparity).abs()
                        + if state.curve == curve { 0.0 } else { crossing })
                    .min(jump);
                    let step = if state.curve == NONE { 0.0 } else { step };
                    if state.cost + step < best.0 {
                        best = (state.cost + step, back as u32);
                    }
                }
                self.states.push(State {
                    cost: best.0 + candidate.cost,
                    disparity: candidate.disparity,
                    curve,
                    back: best.1,
                    candidate: index as u32,
                });
            }
            for back in before.clone() {
                let state = self.states[back];
                self.states.push(State {
                    cost: state.cost + nothing,
                    back: back as u32,
                    candidate: NONE,
                    ..state
                });
            }
            // A state dearer than a jump from the cheapest can never win again.
            let least = self.states[first..].iter().map(|s| s.cost).fold(f32::INFINITY, f32::min);
            let mut kept = first;
            for i in first..self.states.len() {
                if self.states[i].cost <= least + jump {
                    self.states[kept] = self.states[i];
                    kept += 1;
                }
            }
            self.states.truncate(kept);
            before = first..kept;
        }
        let best = before.min_by(|&a, &b| self.states[a].cost.total_cmp(&self.states[b].cost));
        self.trace(points, candidates, best.unwrap_or(0), choices);
    }

    fn trace(&self, points: std::ops::Range<usize>, candidates: &Candidates, best: usize, choices: &mut [Choice]) {
        let mut at = best;
        for point in points.clone().rev() {
            let choice = &mut choices[point];
            *choice = Choice::NOTHING;
            if at < self.starts[point - points.start] as usize {
                continue;
            }
            let state = &self.states[at];
            at = state.back as usize;
            if state.candidate == NONE {
                continue;
            }
            let own = candidates.of(point);
            let Candidate { disparity, cost, bend, spots } = own[state.candidate as usize];
            let elsewhere = own.iter().filter(|c| (c.disparity - disparity).abs() > 1.0);
            let rival = elsewhere.map(|c| c.cost).fold(1.0, f32::min);
            *choice = Choice { disparity, cost, margin: rival - cost, bend, spots, ..Choice::NOTHING };
        }
    }
}

/// What makes a run and how it is filled.
#[derive(Clone, Debug)]
pub(crate) struct Steadiness {
    /// Pixels of change between neighbours in a run.
    pub(crate) step: f32,
    /// Points without a disparity that a run may bridge.
    pub(crate) gap: usize,
    /// Points that were seen, at least, in a run that is trusted.
    pub(crate) least: usize,
    /// How much dearer, on average over a run, the best candidates elsewhere must be.
    pub(crate) margin: f32,
}

/// Forgets every choice outside runs of steady disparity, and tells the others how long their run is.
pub(crate) fn keep_runs(choices: &mut [Choice], steadiness: &Steadiness) {
    for_each_run(choices, steadiness, |choices, seen| {
        let margin: f32 = choices.iter().map(|choice| choice.margin).sum();
        if seen < steadiness.least || margin < steadiness.margin * seen as f32 {
            choices.fill(Choice::NOTHING);
        } else {
            for choice in choices.iter_mut().filter(|choice| choice.is_some()) {
                choice.run = seen as u32;
            }
        }
    });
}

/// Calls with each run, first to last seen point, and the number of points seen in it.
fn for_each_run(
    choices: &mut [Choice],
    steadiness: &Steadiness,
    mut run: impl FnMut(&mut [Choice], usize),
) {
    let mut at = 0;
    while at < choices.len() {
        if !choices[at].is_some() {
            at += 1;
            continue;
        }
        let (start, mut last, mut seen) = (at, at, 1);
        at += 1;
        while at < choices.len() && at - last <= steadiness.gap + 1 {
            if choices[at].is_some() {
                let allowed = steadiness.step;
                if (choices[at].disparity - choices[last].disparity).abs() > allowed {
                    break;
                }
                last = at;
                seen += 1;
            }
            at += 1;
        }
        at = last + 1;
        run(&mut choices[start..at], seen);
    }
}

/// Fills the gaps inside runs by interpolation along the curve.
pub(crate) fn fill_gaps(choices: &mut [Choice], steadiness: &Steadiness) {
    for_each_run(choices, steadiness, |choices, _| {
        let mut last = 0;
        for at in 1..choices.len() {
            if !choices[at].is_some() {
                continue;
            }
            let (from, to) = (choices[last], choices[at]);
            for between in last + 1..at {
                let share = (between - last) as f32 / (at - last) as f32;
                let mix = |a: f32, b: f32| a + share * (b - a);
                choices[between] = Choice {
                    disparity: mix(from.disparity, to.disparity),
                    cost: from.cost.max(to.cost),
                    margin: from.margin.min(to.margin),
                    bend: mix(from.bend, to.bend),
                    spots: [NONE; 2],
                    run: from.run,
                    support: from.support.min(to.support),
                };
            }
            last = at;
        }
    });
}

/// Replaces each seen disparity by the straight line fitted to its neighbours in the run (least squares).
pub(crate) fn straighten(choices: &mut [Choice], reach: usize, step: f32, smooth: &mut Vec<f32>) {
    smooth.clear();
    smooth.extend(choices.iter().map(|choice| choice.disparity));
    for at in 0..choices.len() {
        if !choices[at].is_some() {
            continue;
        }
        let here = smooth[at];
        let (mut n, mut t, mut tt, mut d, mut td) = (0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32);
        for near in at.saturating_sub(reach)..(at + reach + 1).min(choices.len()) {
            let disparity = smooth[near];
            if (disparity - here).abs() <= step {
                let place = near as f32 - at as f32;
                n += 1.0;
                t += place;
                tt += place * place;
                d += disparity;
                td += place * disparity;
            }
        }
        let spread = n * tt - t * t;
        choices[at].disparity = if n >= 3.0 && spread > 0.0 { (tt * d - t * td) / spread } else { here };
    }
}
