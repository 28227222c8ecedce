//! Disparities along a curve: dynamic programming over the candidates of its points.
//!
//! A curve tracked across a depth step has no single disparity, so each point chooses for itself, and neighbours along
//! the curve pay for disagreeing: linearly at first, capped, so that one jump is affordable.

use messages::NONE;

use crate::candidates::Candidates;
use crate::choice::Choice;

/// What changes of disparity along a curve cost.
#[derive(Clone, Debug)]
pub(crate) struct Smoothness {
    /// Cost of a point without a candidate.
    pub(crate) nothing: f32,
    /// Cost of a pixel of change.
    pub(crate) change: f32,
}

/// Most that a change costs, so that a jump is affordable. With 100, which keeps more states, 0.001 less is covered, as often
/// wrong.
pub(crate) const JUMP: f32 = 2.0;

/// Cost of going over to another curve in the near view. Without it 0.048 % of the points on the three rendered objects are
/// wrong instead of 0.033 %.
const CROSSING: f32 = 0.2;

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
    /// Chooses disparities for the points of a curve.
    pub(crate) fn choose(
        &mut self,
        points: std::ops::Range<usize>,
        candidates: &Candidates,
        smoothness: &Smoothness,
        choices: &mut [Choice],
    ) {
        let Smoothness { nothing, change } = *smoothness;
        self.states.clear();
        self.starts.clear();
        let start = State {
            cost: 0.0,
            disparity: f32::NAN,
            curve: NONE,
            back: NONE,
            candidate: NONE,
        };
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
                let curve = candidate.curves[0];
                let mut best = (f32::INFINITY, NONE);
                for back in before.clone() {
                    let state = &self.states[back];
                    // From NaN, min gives the jump.
                    let step = (change * (state.disparity - candidate.disparity).abs()
                        + if state.curve == curve { 0.0 } else { CROSSING })
                    .min(JUMP);
                    let step = if state.disparity.is_nan() { 0.0 } else { step };
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
            let least = self.states[first..]
                .iter()
                .map(|s| s.cost)
                .fold(f32::INFINITY, f32::min);
            let mut kept = first;
            for i in first..self.states.len() {
                if self.states[i].cost <= least + JUMP {
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

    fn trace(
        &self,
        points: std::ops::Range<usize>,
        candidates: &Candidates,
        best: usize,
        choices: &mut [Choice],
    ) {
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
            let chosen = &own[state.candidate as usize];
            *choice = Choice {
                disparity: chosen.disparity,
                cost: chosen.cost,
                margin: chosen.rival_among(own) - chosen.cost,
                bend: chosen.bend,
                spots: chosen.spots,
                curves: chosen.curves,
                repeats: chosen.repeats,
                ..Choice::NOTHING
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candidates::Candidate;

    fn chance(seed: usize) -> f32 {
        let mixed = (seed as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32
            / (1u64 << 24) as f32
    }

    /// What a way of choosing costs, said plainly.
    fn price(way: &[Option<Candidate>], has: &[bool], smoothness: &Smoothness) -> f32 {
        let (mut sum, mut last) = (0.0, None::<Candidate>);
        for (choice, has) in way.iter().zip(has) {
            match choice {
                Some(candidate) => {
                    sum += candidate.cost;
                    if let Some(last) = last {
                        let crossing = if last.curves[0] == candidate.curves[0] {
                            0.0
                        } else {
                            CROSSING
                        };
                        let change =
                            smoothness.change * (last.disparity - candidate.disparity).abs();
                        sum += (change + crossing).min(JUMP);
                    }
                    last = Some(*candidate);
                }
                None => sum += if *has { smoothness.nothing } else { 0.0 },
            }
        }
        sum
    }

    #[test]
    fn no_other_way_along_the_curve_is_cheaper() {
        let smoothness = Smoothness {
            nothing: 1.0,
            change: 0.5,
        };
        for seed in 0..40 {
            let lists: Vec<Vec<Candidate>> = (0..6)
                .map(|point| {
                    let count = (4.0 * chance(seed * 100 + point)) as usize;
                    let candidate = |i: usize| Candidate {
                        disparity: 6.0 * chance(seed * 1000 + point * 10 + i),
                        cost: 1.5 * chance(seed * 2000 + point * 10 + i),
                        bend: 0.0,
                        spots: [0; 2],
                        curves: [(2.0 * chance(seed * 3000 + point * 10 + i)) as u32, 0],
                        ..Candidate::FOUND
                    };
                    (0..count).map(candidate).collect()
                })
                .collect();
            let mut ways: Vec<Vec<Option<Candidate>>> = vec![Vec::new()];
            for own in &lists {
                let options: Vec<Option<Candidate>> = std::iter::once(None)
                    .chain(own.iter().copied().map(Some))
                    .collect();
                ways = ways
                    .iter()
                    .flat_map(|way| {
                        options
                            .iter()
                            .map(move |option| way.iter().copied().chain([*option]).collect())
                    })
                    .collect();
            }
            let has: Vec<bool> = lists.iter().map(|own| !own.is_empty()).collect();
            let least = ways
                .iter()
                .map(|way| price(way, &has, &smoothness))
                .fold(f32::INFINITY, f32::min);

            let candidates = Candidates::from_lists(&lists);
            let mut choices = [Choice::NOTHING; 6];
            Along::default().choose(0..6, &candidates, &smoothness, &mut choices);
            let way: Vec<Option<Candidate>> = choices
                .iter()
                .zip(&lists)
                .map(|(choice, own)| {
                    own.iter()
                        .find(|c| c.disparity == choice.disparity)
                        .copied()
                })
                .collect();
            assert!(
                (price(&way, &has, &smoothness) - least).abs() < 1e-4,
                "seed {seed}"
            );
        }
    }
}
