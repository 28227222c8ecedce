//! The closed loop: from the reference view to its neighbour, on to the third view, and back to where it began.
//!
//! Every step lets the R-table of the curve just found vote for the curves of the next view. A loop that does not close
//! goes back and tries the next candidate; only a closed one is a match. Where two views must do, the loop goes to the
//! neighbour and straight back.

use messages::{NONE, Reason};

use super::course::{Band, Course};
use super::vote::{Ballot, Lowered, Peak, Side, Votes, Way};
use crate::ChannelView;
use crate::rows::Rows;
use crate::triple::Steps;

/// When a loop is closed.
#[derive(Clone, Debug)]
pub(crate) struct Closing {
    /// Score a step needs.
    pub(crate) score: f32,
    /// Pixels by which the loop may miss its start, and by which its steps may differ.
    pub(crate) residual: f32,
    /// Candidates tried at each step.
    pub(crate) tries: usize,
}

/// Curves, one in each view, that lead to one another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Closed {
    /// Their labels, left to right; [`NONE`] for a view that has no say.
    pub(crate) curves: [u32; 3],
    /// Disparity between neighbouring views, as the longest step saw it.
    pub(crate) course: Course,
    /// The least score of its steps.
    pub(crate) score: f32,
    /// How far the loop misses its start, in pixels.
    pub(crate) residual: f32,
}

/// The search, with its memory.
#[derive(Debug, Default)]
pub(crate) struct ClosedLoop {
    votes: Votes,
    peaks: [Vec<Peak>; 3],
    /// Per view and point its row and column in the reference view's rows.
    places: [Vec<(f32, f32)>; 3],
}

/// The three views as a search sees them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Views<'a> {
    pub(crate) views: &'a [ChannelView<'a>; 3],
    pub(crate) rows: &'a [Rows; 3],
    /// Rows by which each picture lies lower than the reference view's.
    pub(crate) lower: [f32; 3],
}

impl ClosedLoop {
    /// Takes in one view's points by row.
    pub(crate) fn fill(&mut self, view: usize, points: usize, rows: &Rows) {
        let places = &mut self.places[view];
        places.clear();
        places.resize(points, (-1.0, 0.0));
        for row in 0..rows.count() {
            for spot in &rows.spots[rows.row(row)] {
                places[spot.point as usize] = (row as f32, spot.x);
            }
        }
    }

    /// The views, one by one.
    pub(crate) fn sides<'a>(&'a self, views: Views<'a>) -> [Side<'a>; 3] {
        sides(&self.places, views)
    }

    /// How well the votes of a curve of the reference view agree with one course in the view `to`, and what they say about
    /// that view's rows.
    pub(crate) fn agreement(
        &mut self,
        views: Views<'_>,
        (reference, label): (usize, u32),
        (to, steps): (usize, f32),
        band: &Band,
        ballot: &Ballot,
    ) -> Lowered {
        let sides = sides(&self.places, views);
        let way = Way {
            from: &sides[reference],
            to: &sides[to],
            steps,
            band,
            ballot,
        };
        self.votes.agreement(label, &way)
    }

    /// Looks for the partners of a curve of the reference view; gives how far the search came when there are none.
    pub(crate) fn close(
        &mut self,
        views: Views<'_>,
        label: u32,
        steps: Steps,
        expected: &Band,
        ballot: &Ballot,
        closing: &Closing,
    ) -> Result<Closed, Reason> {
        let Self {
            votes,
            peaks: [nears, fars, backs],
            places,
        } = self;
        let sides = sides(places, views);
        let curve = &views.views[steps.reference].curves.curves[label as usize];
        let here = |course: Course| course.at(curve.y, curve.x);
        let mut step = |(from, label), to, steps, band: &Band, peaks: &mut Vec<Peak>| {
            let way = Way {
                from: &sides[from],
                to: &sides[to],
                steps,
                band,
                ballot,
            };
            votes.count(label, &way, closing.score, peaks);
            let is_voted_for = !peaks.is_empty();
            peaks.retain(|peak: &Peak| peak.score >= closing.score);
            peaks.truncate(closing.tries);
            is_voted_for
        };
        let around = |course| Band::around(course, closing.residual);
        let between = steps.to_far - steps.to_near;
        let start = (steps.reference, label);
        let is_voted_for = step(start, steps.near, steps.to_near, expected, nears);
        let mut reason = match is_voted_for {
            true => Reason::Votes,
            false => Reason::NoPartner,
        };
        for near in nears {
            let from = (steps.near, near.curve);
            if !steps.third {
                reason = Reason::Loop;
                let to = steps.reference;
                let course = near.course.seen_from(steps.to_near);
                step(from, to, -steps.to_near, &around(course), backs);
                let own = |back: &&Peak| back.curve == label;
                let Some(back) = backs.iter().find(own) else {
                    continue;
                };
                let course = back.course.seen_from(-steps.to_near);
                let residual = (here(near.course) - here(course)).abs();
                if residual <= closing.residual {
                    return Ok(Closed {
                        curves: steps.in_order(label, near.curve, NONE),
                        course,
                        score: near.score.min(back.score),
                        residual,
                    });
                }
                continue;
            }
            let course = near.course.seen_from(steps.to_near);
            step(from, steps.far, between, &around(course), fars);
            if reason != Reason::Loop {
                reason = Reason::ThirdView;
            }
            for far in fars.iter() {
                reason = Reason::Loop;
                let from = (steps.far, far.curve);
                let to = steps.reference;
                let course = far.course.seen_from(between);
                step(from, to, -steps.to_far, &around(course), backs);
                let own = |back: &&Peak| back.curve == label;
                let Some(back) = backs.iter().find(own) else {
                    continue;
                };
                let course = back.course.seen_from(-steps.to_far);
                let second = here(far.course.seen_from(-steps.to_near));
                let way = steps.to_near * here(near.course) + between * second;
                let residual = (way - steps.to_far * here(course)).abs();
                if residual <= closing.residual {
                    return Ok(Closed {
                        curves: steps.in_order(label, near.curve, far.curve),
                        course,
                        score: near.score.min(far.score).min(back.score),
                        residual,
                    });
                }
            }
        }
        Err(reason)
    }
}

/// The views, one by one.
fn sides<'a>(places: &'a [Vec<(f32, f32)>; 3], views: Views<'a>) -> [Side<'a>; 3] {
    std::array::from_fn(|view| Side {
        view: views.views[view],
        rows: &views.rows[view],
        lower: views.lower[view],
        places: &places[view],
    })
}
