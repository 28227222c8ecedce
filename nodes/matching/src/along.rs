//! Disparities along a curve: dynamic programming over the candidates of its points, runs, filling.
//!
//! A curve tracked across a depth step has no single disparity, so each point chooses for itself, and neighbours along
//! the curve pay for disagreeing: linearly at first, capped, so that one jump is affordable.

use messages::{NONE, Reason};

use crate::candidates::Candidates;

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
    /// How much dearer its cheapest rival is.
    pub(crate) margin: f32,
    /// How far the three columns are from one straight motion, in pixels.
    pub(crate) bend: f32,
    /// Spots in the near and the far view; [`NONE`] where it is not seen, both where filled in.
    pub(crate) spots: [u32; 2],
    /// The curves they belong to.
    pub(crate) curves: [u32; 2],
    /// Number of points in its run.
    pub(crate) run: u32,
    /// Share of its neighbours that agree.
    pub(crate) support: f32,
    /// How many they are, the near ones counting more.
    pub(crate) witnesses: f32,
    /// Whether it is part of a pattern whose next ones it is not told from.
    pub(crate) repeats: bool,
}

impl Choice {
    pub(crate) const NOTHING: Self = Self {
        disparity: f32::NAN,
        cost: f32::INFINITY,
        margin: 0.0,
        bend: 0.0,
        spots: [NONE; 2],
        curves: [NONE; 2],
        run: 0,
        support: 0.0,
        witnesses: 0.0,
        repeats: false,
    };

    /// Whether there is a disparity at all.
    pub(crate) fn is_some(&self) -> bool {
        !self.disparity.is_nan()
    }

    /// Whether it was seen in other views, and not filled in.
    pub(crate) fn is_seen(&self) -> bool {
        self.spots != [NONE; 2]
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
    /// Chooses disparities for the points of a curve.
    pub(crate) fn choose(
        &mut self,
        points: std::ops::Range<usize>,
        candidates: &Candidates,
        smoothness: &Smoothness,
        choices: &mut [Choice],
    ) {
        let Smoothness {
            nothing,
            change,
            jump,
            crossing,
        } = *smoothness;
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
                        + if state.curve == curve { 0.0 } else { crossing })
                    .min(jump);
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

/// Share of a run's points, part of a pattern, from which on the run is: of a contour before an uneven background not every
/// point is found to repeat.
const REPEATED: f32 = 0.1;

/// Forgets every choice outside runs of steady disparity, and tells the others how long their run is.
pub(crate) fn keep_runs(choices: &mut [Choice], lost: &mut [Reason], steadiness: &Steadiness) {
    for_each_run(choices, steadiness, |start, choices, seen| {
        let margin: f32 = choices.iter().map(|choice| choice.margin).sum();
        let is_short = seen < steadiness.least;
        let repeated = choices.iter().filter(|choice| choice.repeats).count();
        let is_ambiguous =
            margin < steadiness.margin * seen as f32 || repeated as f32 > REPEATED * seen as f32;
        let forgotten = is_short || is_ambiguous;
        let chosen = choices.iter_mut().zip(&mut lost[start..]);
        for (choice, lost) in chosen.filter(|(choice, _)| choice.is_some()) {
            if forgotten {
                *choice = Choice::NOTHING;
                *lost = if is_short {
                    Reason::Short
                } else {
                    Reason::Ambiguous
                };
            } else {
                choice.run = seen as u32;
            }
        }
    });
}

/// Calls with the start of each run, with the run from first to last seen point, and the number of points seen in it.
fn for_each_run(
    choices: &mut [Choice],
    steadiness: &Steadiness,
    mut run: impl FnMut(usize, &mut [Choice], usize),
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
        run(start, &mut choices[start..at], seen);
    }
}

/// Fills the gaps inside runs by interpolation along the curve.
pub(crate) fn fill_gaps(choices: &mut [Choice], steadiness: &Steadiness) {
    for_each_run(choices, steadiness, |_, choices, _| {
        let mut last = 0;
        for at in 1..choices.len() {
            if !choices[at].is_some() {
                continue;
            }
            let (from, to) = (choices[last], choices[at]);
            let steps = (at - last) as f32;
            for (step, between) in (1u16..).zip(&mut choices[last + 1..at]) {
                let share = f32::from(step) / steps;
                let mix = |a: f32, b: f32| a + share * (b - a);
                *between = Choice {
                    disparity: mix(from.disparity, to.disparity),
                    cost: from.cost.max(to.cost),
                    margin: from.margin.min(to.margin),
                    bend: mix(from.bend, to.bend),
                    spots: [NONE; 2],
                    curves: [NONE; 2],
                    run: from.run,
                    support: from.support.min(to.support),
                    witnesses: from.witnesses.min(to.witnesses),
                    repeats: false,
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
        let start = at.saturating_sub(reach);
        let end = (at + reach + 1).min(smooth.len());
        for (near, &disparity) in (start..).zip(&smooth[start..end]) {
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
        choices[at].disparity = if n >= 3.0 && spread > 0.0 {
            (tt * d - t * td) / spread
        } else {
            here
        };
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
                            smoothness.crossing
                        };
                        let change =
                            smoothness.change * (last.disparity - candidate.disparity).abs();
                        sum += (change + crossing).min(smoothness.jump);
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
            jump: 1.4,
            crossing: 0.2,
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

    fn seen(disparity: f32) -> Choice {
        Choice {
            disparity,
            spots: [0; 2],
            margin: 1.0,
            ..Choice::NOTHING
        }
    }

    const STEADY: Steadiness = Steadiness {
        step: 1.0,
        gap: 2,
        least: 3,
        margin: 0.1,
    };

    #[test]
    fn only_steady_runs_are_kept() {
        let disparities = [
            5.0,
            5.2,
            5.4,
            f32::NAN,
            f32::NAN,
            5.6,
            9.0,
            14.0,
            14.1,
            f32::NAN,
            f32::NAN,
            f32::NAN,
            14.2,
        ];
        let mut choices = disparities.map(|d| if d.is_nan() { Choice::NOTHING } else { seen(d) });
        let mut lost = [Reason::NoPartner; 13];
        keep_runs(&mut choices, &mut lost, &STEADY);
        let runs = choices.map(|choice| choice.run);
        assert_eq!(runs, [4, 4, 4, 0, 0, 4, 0, 0, 0, 0, 0, 0, 0]);
        // Points that had nothing before keep their own reason.
        let short: Vec<usize> = (0..13).filter(|&i| lost[i] == Reason::Short).collect();
        assert_eq!(short, [6, 7, 8, 12]);
    }

    #[test]
    fn runs_with_a_rival_elsewhere_are_not_kept() {
        let mut choices = [Choice {
            margin: 0.05,
            ..seen(5.0)
        }; 8];
        let mut lost = [Reason::Flat; 8];
        keep_runs(&mut choices, &mut lost, &STEADY);
        assert!(choices.iter().all(|choice| !choice.is_some()));
        assert_eq!(lost, [Reason::Ambiguous; 8]);
    }

    #[test]
    fn gaps_are_filled_by_interpolation_and_no_further() {
        let mut choices = [
            seen(4.0),
            Choice::NOTHING,
            Choice::NOTHING,
            seen(4.6),
            Choice::NOTHING,
        ];
        fill_gaps(&mut choices, &STEADY);
        assert!(
            (choices[1].disparity - 4.2).abs() < 1e-6 && (choices[2].disparity - 4.4).abs() < 1e-6
        );
        assert!(!choices[1].is_seen() && !choices[4].is_some());
    }

    #[test]
    fn a_straight_line_stays_and_noise_shrinks() {
        let line: Vec<Choice> = (0..20).map(|i| seen(7.0 + 0.1 * i as f32)).collect();
        let mut straight = line.clone();
        straighten(&mut straight, 4, 1.0, &mut Vec::new());
        assert!(
            line.iter()
                .zip(&straight)
                .all(|(a, b)| (a.disparity - b.disparity).abs() < 1e-4)
        );
        let mut noisy: Vec<Choice> = (0..200)
            .map(|i| seen(7.0 + 0.4 * (chance(i) - 0.5)))
            .collect();
        let spread = |choices: &[Choice]| {
            choices
                .iter()
                .map(|c| (c.disparity - 7.0).powi(2))
                .sum::<f32>()
        };
        let before = spread(&noisy);
        straighten(&mut noisy, 4, 1.0, &mut Vec::new());
        assert!(spread(&noisy) < before / 4.0);
    }
}
