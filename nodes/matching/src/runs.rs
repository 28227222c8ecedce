//! Runs of steady disparity along a curve: which are trusted, how they are smoothed, how their gaps are filled.

use messages::{NONE, Reason};

use crate::choice::Choice;

/// Pixels of disparity by which neighbours in a run differ at most. 2 change nothing, 0.5 cover 0.002 less.
const STEP: f32 = 1.0;

/// What makes a run and how it is filled.
#[derive(Clone, Debug)]
pub(crate) struct Steadiness {
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
pub(crate) fn keep(choices: &mut [Choice], lost: &mut [Reason], steadiness: &Steadiness) {
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
                if (choices[at].disparity - choices[last].disparity).abs() > STEP {
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

/// Replaces each seen disparity by the straight line fitted to its neighbours in the run, `reach` points to either side
/// (least squares).
pub(crate) fn straighten(choices: &mut [Choice], reach: usize, smooth: &mut Vec<f32>) {
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
            if (disparity - here).abs() <= STEP {
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

    fn chance(seed: usize) -> f32 {
        let mixed = (seed as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32
            / (1u64 << 24) as f32
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
        keep(&mut choices, &mut lost, &STEADY);
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
        keep(&mut choices, &mut lost, &STEADY);
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
        straighten(&mut straight, 4, &mut Vec::new());
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
        straighten(&mut noisy, 4, &mut Vec::new());
        assert!(spread(&noisy) < before / 4.0);
    }
}
