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

use messages::{Reason, Size};

use crate::along::Choice;
use crate::candidates::{self, Candidate, Likeness};
use crate::rows::is_flat;
use crate::triple::Steps;
use crate::{ChannelView, Matcher, Range};

/// Pixels of disparity within which candidates are one: a curve that branches repeats its points.
const SAME: f32 = 0.5;

impl Matcher {
    /// Finds the choices of all points of the reference view, each for itself; `width` is the filter's central width.
    pub(crate) fn match_points(
        &mut self,
        views: &[ChannelView<'_>; 3],
        size: Size,
        range: Range,
        steps: Steps,
        width: f32,
        has_coarser: bool,
    ) {
        let s = &self.settings;
        let edges = views[steps.reference].curves.points;
        // All that is alike enough is a candidate; how alike decides nothing.
        let like = Likeness {
            turn: s.orientation_tolerance.to_radians(),
            miss: s.miss,
            flat: s.flat.to_radians(),
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
            self.coarser.predict_most(reach, range);
            &self.coarser
        });
        let expected = s.initial_disparity.filter(|_| !has_coarser);
        let range_here = expected.map_or(range, |disparity| Range {
            least: (disparity - reach).max(range.least),
            most: (disparity + reach).min(range.most),
        });
        let lost = &mut self.lost;
        let reference = &self.rows[steps.reference];
        self.candidates.gather(
            reference,
            (range_here, predicted),
            &like,
            None,
            lost,
            |spot, row, range, list| {
                candidates::pairs(&self.rows, &steps, &like, (spot, row), range, list)
            },
        );

        self.around
            .clear(size, s.support_cell, s.support_within, range);
        for (point, (edge, choice)) in edges.iter().zip(&mut self.choices).enumerate() {
            if let [first, others @ ..] = self.candidates.of(point)
                && others.iter().all(|other| is_same(first, other))
            {
                *choice = chosen(first);
                self.around.add(edge.x, edge.y, choice.disparity);
            }
        }
        self.around.settle();
        for (point, (edge, choice)) in edges.iter().zip(&mut self.choices).enumerate() {
            if choice.is_some() {
                let (share, weight) = self.around.agreement(edge.x, edge.y, choice.disparity);
                (choice.support, choice.witnesses) = (share, share * weight);
                continue;
            }
            let mut best = s.majority;
            let candidates = self.candidates.of(point);
            if !candidates.is_empty() {
                lost[point] = Reason::Ambiguous;
            }
            for candidate in candidates {
                let (share, weight) =
                    self.around
                        .agreement_with(edge.x, edge.y, candidate.disparity);
                if share > best && weight >= s.support_least {
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
        if s.unique {
            // One that had no choice before one that was pulled, whose margin is zero.
            let worth = |choice: &Choice| f32::from(choice.margin == 0.0) - choice.support;
            let spots = self.rows[steps.near].spots.len();
            self.support
                .keep_unique(spots, 0, &mut self.choices, lost, worth);
        }
        if s.matched_share > 0.0 {
            self.regions.clear(size, s.cell);
            for (edge, choice) in edges.iter().zip(&self.choices) {
                if edge.is_in_row() && !is_flat(edge.orientation, like.flat) {
                    self.regions.add(edge.x, edge.y, choice.is_some());
                }
            }
            for ((edge, choice), lost) in edges.iter().zip(&mut self.choices).zip(lost) {
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

/// How many of the points of a region are matched; a region is a cell and the eight around it.
#[derive(Debug, Default)]
pub(crate) struct Regions {
    cell: f32,
    columns: usize,
    rows: usize,
    /// Points, and matched points, cell by cell.
    counts: Vec<(u32, u32)>,
}

impl Regions {
    fn clear(&mut self, size: Size, cell: f32) {
        self.cell = cell;
        self.columns = (size.width as f32 / cell).ceil() as usize + 2;
        self.rows = (size.height as f32 / cell).ceil() as usize + 2;
        self.counts.clear();
        self.counts.resize(self.columns * self.rows, (0, 0));
    }

    /// Column and row of a place's cell; there is a cell on every side of it.
    fn place(&self, x: f32, y: f32) -> (usize, usize) {
        let column = ((x / self.cell) as usize + 1).min(self.columns - 2);
        let row = ((y / self.cell) as usize + 1).min(self.rows - 2);
        (column, row)
    }

    fn add(&mut self, x: f32, y: f32, is_matched: bool) {
        let (column, row) = self.place(x, y);
        let (points, matched) = &mut self.counts[row * self.columns + column];
        *points += 1;
        *matched += u32::from(is_matched);
    }

    fn share(&self, x: f32, y: f32) -> f32 {
        let (column, row) = self.place(x, y);
        let (mut points, mut matched) = (0, 0);
        for row in row - 1..=row + 1 {
            let start = row * self.columns + column - 1;
            for cell in &self.counts[start..start + 3] {
                points += cell.0;
                matched += cell.1;
            }
        }
        matched as f32 / (points as f32).max(1.0)
    }
}
