//! Choices written down as matches.

use messages::{CurvesView, Match, MatchPoint, MatchesRoom, NONE};

use crate::along::Choice;
use crate::{Matcher, Steps};

impl Matcher {
    /// Writes down the matched curves and their points.
    pub(crate) fn report(
        &mut self,
        reference: CurvesView<'_>,
        steps: Steps,
        room: &mut MatchesRoom<'_>,
    ) {
        for (label, curve) in (0..).zip(reference.curves) {
            let first = room.points.len() as u32;
            let (mut residual, mut disparity, mut support, mut seen) = (0.0, 0.0, 0.0, 0.0f32);
            self.partners.iter_mut().for_each(Vec::clear);
            for point in curve.range() {
                let choice = &self.choices[point];
                if !choice.is_some() {
                    continue;
                }
                disparity += choice.disparity;
                support += choice.support;
                if choice.is_seen() {
                    residual += choice.bend.abs();
                    seen += 1.0;
                    for (partners, partner) in self.partners.iter_mut().zip(choice.curves) {
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
                    score: confidence(choice),
                    point: point as u32,
                    filled: u32::from(!choice.is_seen()),
                });
            }
            let count = room.points.len() as u32 - first;
            if count == 0 {
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
            room.matches.push(match self.closed[label as usize] {
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

/// The partner most points chose.
fn most(partners: &[(u32, u32)]) -> u32 {
    let most = partners
        .iter()
        .max_by_key(|&&(curve, count)| (count, std::cmp::Reverse(curve)));
    most.map_or(NONE, |&(curve, _)| curve)
}

/// How sure a point is, 0 to 1.
fn confidence(choice: &Choice) -> f32 {
    let sure = 1.0 * choice.margin - 1.0 * choice.cost
        + (choice.run as f32).min(40.0) / 40.0
        + 2.0 * choice.support;
    1.0 / (1.0 + (-sure).exp())
}
