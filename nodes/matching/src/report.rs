//! Choices written down as matches, and why there are no others.

use messages::{CurvesView, Match, MatchPoint, MatchesRoom, NONE, Reason, Rejected};

use crate::choice::Choice;
use crate::triple::Steps;
use crate::{Assignment, Matcher, Method};

impl Matcher {
    /// Writes down the matched curves and their points, and of the others why they are not matched.
    pub(crate) fn report(
        &mut self,
        reference: CurvesView<'_>,
        steps: Steps,
        room: &mut MatchesRoom<'_>,
    ) {
        let by_point =
            self.settings.method != Method::Point && self.settings.assignment == Assignment::Point;
        let least = if by_point {
            self.settings.score_least
        } else {
            0.0
        };
        for (label, curve) in (0..).zip(reference.curves) {
            let first = room.points.len() as u32;
            let (mut residual, mut disparity, mut support, mut seen) = (0.0, 0.0, 0.0, 0.0f32);
            self.partners.iter_mut().for_each(Vec::clear);
            let choices = &self.shared.choices[curve.range()];
            for (at, (point, choice)) in curve.range().zip(choices).enumerate() {
                if !choice.is_some() {
                    continue;
                }
                let score = confidence(choice, change(choices, at));
                if score < least {
                    self.shared.lost[point] = Reason::Unsure;
                    continue;
                }
                disparity += choice.disparity;
                support += choice.support;
                if choice.is_seen() {
                    residual += choice.bend.abs();
                    seen += 1.0;
                    let partners = self.partners.iter_mut().zip(choice.curves);
                    for (partners, partner) in partners.filter(|(_, partner)| *partner != NONE) {
                        match partners.iter_mut().find(|known| known.0 == partner) {
                            Some(known) => known.1 += 1,
                            None => partners.push((partner, 1)),
                        }
                    }
                }
                room.points.push(MatchPoint {
                    x: reference.points[point].x,
                    y: reference.points[point].y,
                    disparity: choice.disparity,
                    score,
                    point: point as u32,
                    filled: u32::from(!choice.is_seen()),
                });
            }
            let count = room.points.len() as u32 - first;
            if count == 0 {
                room.rejected.push(Rejected {
                    curve: label,
                    reason: most_frequent(&self.shared.lost[curve.range()]).code(),
                });
                continue;
            }
            let found = Match {
                curves: steps.in_order(label, most(&self.partners[0]), most(&self.partners[1])),
                first,
                count,
                score: count as f32 / curve.count as f32,
                residual: residual / seen.max(1.0),
                disparity: disparity / count as f32,
                support: support / count as f32,
            };
            room.matches.push(match self.curves.closed(label) {
                Some(closed) => Match {
                    curves: closed.curves,
                    score: closed.score,
                    residual: closed.residual,
                    ..found
                },
                None => found,
            });
        }
    }
}

/// What most of a curve's points failed: points too flat to be searched for count when there are no others.
fn most_frequent(lost: &[Reason]) -> Reason {
    let mut counts = [0u32; Reason::ALL.len()];
    for reason in lost {
        counts[*reason as usize - 1] += 1;
    }
    counts[Reason::Flat as usize - 1] = 0;
    let counted = Reason::ALL.into_iter().zip(counts);
    let most = counted.max_by_key(|&(_, count)| count);
    most.filter(|&(_, count)| count > 0)
        .map_or(Reason::Flat, |(reason, _)| reason)
}

/// The partner most points chose.
fn most(partners: &[(u32, u32)]) -> u32 {
    let most = partners
        .iter()
        .max_by_key(|&&(curve, count)| (count, std::cmp::Reverse(curve)));
    most.map_or(NONE, |&(curve, _)| curve)
}

/// Points to either side along the curve over which [`change`] looks.
const REACH: usize = 8;

/// How much the disparity changes along the curve within [`REACH`] points of one, a pixel at most.
fn change(choices: &[Choice], at: usize) -> f32 {
    // On either side the farthest known, which may be the point itself.
    let start = at.saturating_sub(REACH);
    let end = choices.len().min(at + REACH + 1);
    let before = choices[start..=at].iter().find(|choice| choice.is_some());
    let after = choices[at..end].iter().rfind(|choice| choice.is_some());
    let most = [before, after]
        .into_iter()
        .flatten()
        .map(|far| (far.disparity - choices[at].disparity).abs())
        .fold(0.0, f32::max);
    most.min(1.0)
}

/// How likely a point is right within a pixel: a logistic regression.
///
/// Fitted to the errors over 1 px among 1,000,000 fused points of fourteen Middlebury scenes (2005/06, half size, views
/// 1,3,5, each scene of equal weight; without Midd1 and Midd2, most of whose errors are the truth's). A scene left out of
/// the fit is ranked as well: area under the curve 0.89. Of points said to be wrong with a chance of 0.02, 0.06, 0.17,
/// 0.5, 1.6, 6.7 % there were 0.02, 0.02, 0.16, 0.7, 2.0, 5.0 % wrong.
///
/// Witnesses count most: a false match finds few neighbours that agree with it by chance. Points of long runs are wrong
/// more often than their neighbours and their cost tell, because the longest contours are those of occluding edges; cost and
/// run together cover 0.003 more at equal errors. What else was asked and told nothing more: bend, turns, either side's gray
/// levels, the angle to horizontal, and whether and how far a point is filled in, beyond the lesser margin and support of
/// the two it lies between. Stronger edges are wrong more often too, but they are what is covered.
///
/// The other ways of matching share the order, not the chance.
fn confidence(choice: &Choice, change: f32) -> f32 {
    let run = choice.run.clamp(1, LONG) as f32;
    let odds = 1.81 * (1.0 + choice.witnesses).ln() - 8.17 * (1.0 - choice.support)
        + 1.40 * choice.margin
        - 0.27 * change
        - 0.98 * choice.cost
        - 0.71 * run.ln()
        + 2.05;
    1.0 / (1.0 + (-odds).exp())
}

/// Points of a run from which on it is a long one.
const LONG: u32 = 32;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn witnesses_support_margin_likeness_and_steadiness_each_make_a_point_surer() {
        let plain = Choice {
            disparity: 5.0,
            margin: 0.5,
            support: 0.9,
            witnesses: 12.0,
            cost: 0.2,
            run: 20,
            ..Choice::NOTHING
        };
        let surer = [
            (
                Choice {
                    witnesses: 13.0,
                    ..plain
                },
                0.2,
            ),
            (
                Choice {
                    support: 0.95,
                    ..plain
                },
                0.2,
            ),
            (
                Choice {
                    margin: 0.6,
                    ..plain
                },
                0.2,
            ),
            (Choice { cost: 0.1, ..plain }, 0.2),
            (Choice { run: 19, ..plain }, 0.2),
            (plain, 0.1),
        ];
        let score = confidence(&plain, 0.2);
        assert!(score > 0.5);
        for (choice, change) in surer {
            let surer = confidence(&choice, change);
            assert!(surer > score && surer <= 1.0, "{choice:?}, {change}");
        }
    }

    #[test]
    fn the_reason_is_what_most_points_failed_and_of_equals_the_later() {
        use Reason::{Flat, NoPartner, ThirdView, Unsure};
        assert_eq!(
            most_frequent(&[NoPartner, ThirdView, NoPartner, Unsure]),
            NoPartner
        );
        assert_eq!(
            most_frequent(&[Unsure, NoPartner, Unsure, NoPartner]),
            Unsure
        );
        assert_eq!(most_frequent(&[Flat, Flat, Flat, ThirdView]), ThirdView);
        assert_eq!(most_frequent(&[Flat, Flat]), Flat);
        assert_eq!(most_frequent(&[]), Flat);
    }

    #[test]
    fn a_change_is_seen_on_either_side_and_across_gaps() {
        let at = |disparity: f32| Choice {
            disparity,
            ..Choice::NOTHING
        };
        let mut choices = [at(5.0); 20];
        assert_eq!(change(&choices, 10), 0.0);
        choices[18] = at(5.5);
        choices[2] = Choice::NOTHING;
        choices[3] = at(5.25);
        assert_eq!([9, 10, 11].map(|i| change(&choices, i)), [0.0, 0.5, 0.25]);
        choices[18] = at(9.0);
        assert_eq!(change(&choices, 10), 1.0);
    }
}
