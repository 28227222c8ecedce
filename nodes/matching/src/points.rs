//! Point matching in two views, the older rival: every zero-crossing for itself, coarse to fine.
//!
//! After Marr and Poggio (A computational theory of human stereo vision, 1979) as Grimson built it (A computer
//! implementation of a theory of human stereo vision, 1981; Computational experiments with a feature based stereo
//! algorithm, 1985, whose figural continuity is left to the methods that match curves):
//!
//! - A partner lies in the same row, has the same sign of contrast and roughly the same orientation. Grimson sorts
//!   orientations into twelve sectors of 30°; here gradients, which carry the sign, may differ by the tolerance that all
//!   methods share.
//! - It is looked for within one central width of the filter to either side of what the coarser channel found around the
//!   point, in the coarsest channel in the whole range.
//! - A single candidate is a match. Of several the one is taken that most of the unambiguous matches nearby agree with
//!   ("pulling"); without such a majority the point is left out.
//! - No item has two disparities: of several points that claim one partner the one stays that its neighbours agree with.
//! - Where too few of a region's points find a partner, the images are not in register there, and all are dropped.

mod regions;
pub(crate) mod settings;

use messages::Reason;

use crate::candidates::{self, Candidate, Likeness};
use crate::choice::Choice;
use crate::rows::is_flat;
use crate::{Range, Settings, Shared, Task};
use regions::Regions;

/// Pixels of disparity within which candidates are one: a curve that branches repeats its points.
const SAME: f32 = 0.5;

/// Weight of the unambiguous matches around a point below which they pull it nowhere: those in its own cell count 4, those
/// in the cells beside it less, and the sum is divided by 4.
const FEW: f32 = 4.0;

/// Pixels a cell of a region measures.
const CELL: f32 = 16.0;

/// The matcher of points alone, with its memory.
#[derive(Debug, Default)]
pub(crate) struct Points {
    regions: Regions,
}

impl Points {
    /// Finds the choices of all points of the reference view, each for itself.
    pub(crate) fn assign(&mut self, task: &Task<'_>, settings: &Settings, shared: &mut Shared) {
        let (all, s) = (settings, &settings.points);
        let &Task {
            views,
            size,
            range,
            steps,
            width,
            has_coarser,
        } = task;
        let Shared {
            rows,
            candidates: found,
            support,
            coarser,
            around,
            choices,
            lost,
            ..
        } = shared;
        let edges = views[steps.reference].curves.points;
        // All that is alike enough is a candidate; how alike decides nothing.
        let like = Likeness {
            turn: all.orientation_tolerance.to_radians(),
            miss: all.miss,
            flat: all.flat.to_radians(),
            turn_cost: 1.0,
            miss_cost: 0.0,
            unseen_cost: 0.0,
            gray_cost: 0.0,
            gray_most: 0.0,
            better: 1.0,
            magnitude_cost: 0.0,
            nothing: f32::INFINITY,
            most: f32::INFINITY,
            keep: usize::MAX,
        };
        let reach = s.reach_widths * width;
        let predicted = has_coarser.then(|| {
            coarser.predict_most(reach, range);
            &*coarser
        });
        let expected = s.initial_disparity.filter(|_| !has_coarser);
        let range_here = expected.map_or(range, |disparity| Range {
            least: (disparity - reach).max(range.least),
            most: (disparity + reach).min(range.most),
        });
        let reference = &rows[steps.reference];
        found.gather(
            reference,
            (range_here, predicted),
            &like,
            None,
            lost,
            |spot, row, range, list| {
                candidates::pairs(rows, &steps, &like, (spot, row), range, list)
            },
        );

        around.clear(
            size,
            crate::NEIGHBOURS_CELL,
            crate::NEIGHBOURS_WITHIN,
            range,
        );
        for (point, (edge, choice)) in edges.iter().zip(&mut *choices).enumerate() {
            if let [first, others @ ..] = found.of(point)
                && others.iter().all(|other| is_same(first, other))
            {
                *choice = chosen(first);
                around.add(edge.x, edge.y, choice.disparity);
            }
        }
        around.settle();
        for (point, (edge, choice)) in edges.iter().zip(&mut *choices).enumerate() {
            if choice.is_some() {
                let (share, weight) = around.agreement(edge.x, edge.y, choice.disparity);
                (choice.support, choice.witnesses) = (share, share * weight);
                continue;
            }
            let mut best = s.majority;
            let candidates = found.of(point);
            if !candidates.is_empty() {
                lost[point] = Reason::Ambiguous;
            }
            for candidate in candidates {
                let (share, weight) = around.agreement_with(edge.x, edge.y, candidate.disparity);
                if share > best && weight >= FEW {
                    best = share;
                    *choice = Choice {
                        margin: 0.0,
                        support: share,
                        witnesses: share * weight,
                        ..chosen(candidate)
                    };
                }
            }
        }
        if all.unique {
            // One that had no choice before one that was pulled, whose margin is zero.
            let worth = |choice: &Choice| f32::from(choice.margin == 0.0) - choice.support;
            let spots = rows[steps.near].spots.len();
            support.keep_unique(spots, 0, choices, lost, worth);
        }
        if s.matched_share > 0.0 {
            self.regions.clear(size, CELL);
            for (edge, choice) in edges.iter().zip(&*choices) {
                if edge.is_in_row() && !is_flat(edge.orientation, like.flat) {
                    self.regions.add(edge.x, edge.y, choice.is_some());
                }
            }
            for ((edge, choice), lost) in edges.iter().zip(&mut *choices).zip(lost) {
                if choice.is_some() && self.regions.share(edge.x, edge.y) < s.matched_share {
                    *choice = Choice::NOTHING;
                    *lost = Reason::Region;
                }
            }
        }
    }
}

fn is_same(a: &Candidate, b: &Candidate) -> bool {
    (a.disparity - b.disparity).abs() <= SAME
}

fn chosen(candidate: &Candidate) -> Choice {
    Choice {
        disparity: candidate.disparity,
        cost: candidate.cost,
        margin: 1.0,
        bend: 0.0,
        spots: candidate.spots,
        curves: candidate.curves,
        run: 1,
        support: 0.0,
        witnesses: 0.0,
        repeats: false,
    }
}
