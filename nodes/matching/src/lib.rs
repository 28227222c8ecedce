//! Three-view matching: R-tables become disparities.
//!
//! ```text
//! curves, R-tables of three views, coarse to fine ─► candidates ─► along curves ─► support ─► matches ─► fused points
//! ```

mod along;
mod candidates;
mod fuse;
mod rows;
pub mod settings;
mod support;
mod surroundings;

use messages::{
    Calibration, CurvesView, DisparityRoom, Match, MatchPoint, MatchesRoom, NONE, PointsRoom, Size, TablesView,
};

pub use settings::{Assignment, Reference, Settings};

use along::{Along, Choice, Smoothness, Steadiness};
use candidates::{Candidates, Likeness};
use rows::Rows;
use support::{Neighbourhood, Support};
use surroundings::Surroundings;

/// What one view says in one channel.
#[derive(Clone, Copy, Debug)]
pub struct ChannelView<'a> {
    /// Its curves.
    pub curves: CurvesView<'a>,
    /// Their R-tables, and the curve points by row.
    pub tables: TablesView<'a>,
}

/// The disparities that are searched, in pixels between neighbouring views.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Range {
    pub(crate) least: f32,
    pub(crate) most: f32,
}

/// The reference view and the way to the two others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steps {
    pub(crate) reference: usize,
    pub(crate) near: usize,
    pub(crate) far: usize,
    /// Steps to the right from the reference to the near view.
    pub(crate) to_near: f32,
    /// Steps to the right from the reference to the far view.
    pub(crate) to_far: f32,
}

impl Steps {
    fn from(reference: Reference) -> Self {
        let [reference, near, far] = match reference {
            Reference::Left => [0, 1, 2],
            Reference::Centre => [1, 0, 2],
            Reference::Right => [2, 1, 0],
        };
        let to = |view: usize| view as f32 - reference as f32;
        Self { reference, near, far, to_near: to(near), to_far: to(far) }
    }

    /// What belongs to the reference, the near and the far view, left to right.
    pub(crate) fn in_order<T: Copy + Default>(&self, reference: T, near: T, far: T) -> [T; 3] {
        let mut all = [T::default(); 3];
        all[self.reference] = reference;
        all[self.near] = near;
        all[self.far] = far;
        all
    }
}

/// The matcher, with its memory: it grows to the largest scan and is reused from then on.
#[derive(Debug, Default)]
pub struct Matcher {
    settings: Settings,
    rows: [Rows; 3],
    candidates: Candidates,
    along: Along,
    support: Support,
    coarser: Surroundings,
    earlier: Surroundings,
    choices: Vec<Choice>,
    smooth: Vec<f32>,
    fuse: fuse::Fuse,
}

impl Matcher {
    /// A matcher with these settings.
    pub fn new(settings: &Settings) -> Self {
        Self { settings: settings.clone(), ..Self::default() }
    }

    /// Matches one scan: `inputs` holds the channels coarse to fine, each with its three views left to right; `matches`
    /// has a room for each channel.
    pub fn process(
        &mut self,
        inputs: &[[ChannelView<'_>; 3]],
        size: Size,
        calibration: &Calibration,
        matches: &mut [MatchesRoom<'_>],
        disparity: &mut DisparityRoom<'_>,
        points: &mut PointsRoom<'_>,
    ) {
        let range = Range {
            least: self.settings.disparity_least,
            most: self.settings.disparity_most.unwrap_or(size.width as f32 / 8.0),
        };
        for (channel, (views, room)) in inputs.iter().zip(matches.iter_mut()).enumerate() {
            self.match_channel(views, size, range, channel > 0, room);
        }
        let steps = Steps::from(self.settings.reference);
        let fill_in = self.settings.fill_in.then_some(self.settings.fill_in_radius);
        self.fuse.fuse(matches, steps.reference, size, calibration, fill_in, disparity, points);
    }

    fn match_channel(
        &mut self,
        views: &[ChannelView<'_>; 3],
        size: Size,
        range: Range,
        has_coarser: bool,
        room: &mut MatchesRoom<'_>,
    ) {
        let s = &self.settings;
        let steps = Steps::from(s.reference);
        room.clear();
        for (rows, view) in self.rows.iter_mut().zip(views) {
            rows.fill(view);
        }
        let like = Likeness {
            turn: s.orientation_tolerance.to_radians(),
            miss: s.miss,
            flat: s.flat.to_radians().sin(),
            turn_cost: s.turn_cost,
            miss_cost: s.miss_cost,
            gray_cost: s.gray_cost,
            gray_most: s.gray_most,
            better: s.better_side / (1.0 + s.better_side),
            magnitude_cost: s.magnitude_cost,
            prior_cost: s.prior_cost,
            most: s.nothing + s.jump,
            keep: s.candidates,
        };
        let prior = (has_coarser && s.prior_cost > 0.0).then_some(&self.coarser);
        self.candidates.gather(&self.rows, steps, range, &like, prior);

        let reference = views[steps.reference];
        let edges = reference.curves.points;
        self.choices.clear();
        self.choices.resize(edges.len(), Choice::NOTHING);
        let smoothness = Smoothness { nothing: s.nothing, change: s.change, jump: s.jump, crossing: s.crossing };
        let steadiness = Steadiness { step: s.steady, gap: s.gap, least: s.run };
        let around = Neighbourhood {
            radius: s.support_radius,
            nearest: s.support_nearest,
            share: s.support_share,
            within: s.support_within,
            slope: s.support_slope,
            least: s.support_least,
        };
        for pass in 0..=s.relaxations {
            let earlier = (pass > 0).then_some(&self.earlier);
            for curve in reference.curves.curves {
                let near = &self.rows[steps.near].spots;
                let dearer = |point: usize, candidate: &candidates::Candidate| {
                    earlier.map_or(0.0, |earlier| {
                        let edge = &edges[point];
                        s.relaxation_cost * earlier.strangeness(edge.x, edge.y, candidate.disparity)
                    })
                };
                let curve_of = |spot: u32| near[spot as usize].curve;
                self.along.choose(curve.range(), &self.candidates, &smoothness, dearer, curve_of, &mut self.choices);
                keep_runs(curve.range(), edges, &mut self.choices, &steadiness);
            }
            let worth = |choice: &Choice| choice.cost - (choice.run as f32).min(32.0) / 32.0;
            for (which, view) in [steps.near, steps.far].into_iter().enumerate() {
                self.support.keep_unique(self.rows[view].spots.len(), which, &mut self.choices, worth);
            }
            if pass < s.relaxations {
                self.earlier.clear(size, s.cell, range);
                for (edge, choice) in edges.iter().zip(&self.choices) {
                    if choice.is_some() {
                        self.earlier.add(edge.x, edge.y, choice.disparity);
                    }
                }
                self.earlier.settle();
            }
        }
        if s.support_share > 0.0 {
            self.support.keep_supported(&self.rows[steps.reference], &around, &mut self.choices);
        }
        self.coarser.clear(size, s.cell, range);
        for curve in reference.curves.curves {
            keep_runs(curve.range(), edges, &mut self.choices, &steadiness);
            let (edges, choices) = (&edges[curve.range()], &mut self.choices[curve.range()]);
            if s.straighten > 0 {
                along::straighten(choices, s.straighten, s.steady, &mut self.smooth);
            }
            along::fill_gaps(edges, choices, &steadiness);
            for (edge, choice) in edges.iter().zip(choices.iter()) {
                if choice.is_some() {
                    self.coarser.add(edge.x, edge.y, choice.disparity);
                }
            }
        }
        self.coarser.settle();
        self.report(views, steps, room);
    }

    /// Writes down the matched curves and their points.
    fn report(&mut self, views: &[ChannelView<'_>; 3], steps: Steps, room: &mut MatchesRoom<'_>) {
        let reference = views[steps.reference].curves;
        for (label, curve) in (0..).zip(reference.curves) {
            let first = room.points.len() as u32;
            let (mut residual, mut disparity, mut support, mut seen) = (0.0, 0.0, 0.0, 0.0f32);
            for point in curve.range() {
                let choice = &self.choices[point];
                if !choice.is_some() {
                    continue;
                }
                let edge = &reference.points[point];
                disparity += choice.disparity;
                if choice.is_seen() {
                    residual += choice.bend.abs();
                    support += choice.support;
                    seen += 1.0;
                }
                room.points.push(MatchPoint {
                    x: edge.x,
                    y: edge.y,
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
            room.matches.push(Match {
                curves: steps.in_order(label, NONE, NONE),
                first,
                count,
                score: count as f32 / curve.count as f32,
                residual: residual / seen.max(1.0),
                disparity: disparity / count as f32,
                support: support / seen.max(1.0),
            });
        }
    }
}

fn keep_runs(range: std::ops::Range<usize>, edges: &[messages::Edge], choices: &mut [Choice], steadiness: &Steadiness) {
    along::keep_runs(&edges[range.clone()], &mut choices[range], steadiness);
}

/// How sure a point is, 0 to 1.
fn confidence(choice: &Choice) -> f32 {
    let sure = 1.0 * choice.margin - 1.0 * choice.cost + (choice.run as f32).min(40.0) / 40.0 + 2.0 * choice.support;
    1.0 / (1.0 + (-sure).exp())
}
