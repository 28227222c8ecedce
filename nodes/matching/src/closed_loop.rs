//! The closed loop: from the reference view to its neighbour, on to the third view, and back to where it began.
//!
//! Every step lets the R-table of the curve just found vote for the curves in a window of the next view. A loop that
//! does not close goes back and tries the next candidate; only a closed one is a match. Where two views must do, the
//! loop goes to the neighbour and straight back.

use messages::{Curve, NONE, Reason};

use crate::rows::Rows;
use crate::triple::Steps;
use crate::vote::{Ballot, Peak, Votes};
use crate::windows::{Window, Windows};
use crate::{ChannelView, Range};

/// When a loop is closed.
#[derive(Clone, Debug)]
pub(crate) struct Closing {
    /// Columns of a window.
    pub(crate) width: f32,
    /// Rows of a window.
    pub(crate) rows: f32,
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
    /// Disparity between neighbouring views.
    pub(crate) disparity: f32,
    /// The least score of its steps.
    pub(crate) score: f32,
    /// How far the loop misses its start, in pixels.
    pub(crate) residual: f32,
}

/// The search, with its memory.
#[derive(Debug, Default)]
pub(crate) struct ClosedLoop {
    windows: [Windows; 3],
    votes: Votes,
    labels: Vec<u32>,
    peaks: [Vec<Peak>; 3],
}

impl ClosedLoop {
    /// Takes in the curves of the three views.
    pub(crate) fn fill(&mut self, views: &[ChannelView<'_>; 3]) {
        for (windows, view) in self.windows.iter_mut().zip(views) {
            windows.fill(view.curves.curves);
        }
    }

    /// Looks for the partners of a curve of the reference view; gives how far the search came when there are none.
    #[expect(
        clippy::too_many_arguments,
        reason = "what is searched, where, how, and when it is found"
    )]
    pub(crate) fn close(
        &mut self,
        views: &[ChannelView<'_>; 3],
        rows: &[Rows; 3],
        label: u32,
        steps: Steps,
        range: Range,
        ballot: &Ballot,
        closing: &Closing,
    ) -> Result<Closed, Reason> {
        let around = |disparity: f32| Range {
            least: disparity - closing.residual,
            most: disparity + closing.residual,
        };
        let between = steps.to_far - steps.to_near;
        let is_voted_for = self.step(
            views,
            rows,
            (steps.reference, label),
            steps.near,
            steps.to_near,
            range,
            0,
            ballot,
            closing,
        );
        let mut reason = match is_voted_for {
            true => Reason::Votes,
            false => Reason::NoPartner,
        };
        for first in 0..self.peaks[0].len() {
            let near = self.peaks[0][first];
            let from = (steps.near, near.curve);
            if !steps.third {
                reason = Reason::Loop;
                let expected = around(near.disparity);
                let back = self.back(
                    views,
                    rows,
                    from,
                    (steps.reference, label),
                    -steps.to_near,
                    expected,
                    ballot,
                    closing,
                );
                let Some(back) = back else {
                    continue;
                };
                let residual = (near.disparity - back.disparity).abs();
                if residual <= closing.residual {
                    return Ok(Closed {
                        curves: steps.in_order(label, near.curve, NONE),
                        disparity: back.disparity,
                        score: near.score.min(back.score),
                        residual,
                    });
                }
                continue;
            }
            self.step(
                views,
                rows,
                from,
                steps.far,
                between,
                around(near.disparity),
                1,
                ballot,
                closing,
            );
            if reason != Reason::Loop {
                reason = Reason::ThirdView;
            }
            for second in 0..self.peaks[1].len() {
                reason = Reason::Loop;
                let far = self.peaks[1][second];
                let from = (steps.far, far.curve);
                let expected = around((near.disparity + far.disparity) / 2.0);
                let back = self.back(
                    views,
                    rows,
                    from,
                    (steps.reference, label),
                    -steps.to_far,
                    expected,
                    ballot,
                    closing,
                );
                let Some(back) = back else {
                    continue;
                };
                let way = steps.to_near * near.disparity + between * far.disparity;
                let residual = (way - steps.to_far * back.disparity).abs();
                if residual <= closing.residual {
                    return Ok(Closed {
                        curves: steps.in_order(label, near.curve, far.curve),
                        disparity: back.disparity,
                        score: near.score.min(far.score).min(back.score),
                        residual,
                    });
                }
            }
        }
        Err(reason)
    }

    /// The last step of the loop: where the curve it began with is found again, if it is the best.
    #[expect(
        clippy::too_many_arguments,
        reason = "from where to where, how far, and how"
    )]
    fn back(
        &mut self,
        views: &[ChannelView<'_>; 3],
        rows: &[Rows; 3],
        from: (usize, u32),
        (to, label): (usize, u32),
        steps: f32,
        range: Range,
        ballot: &Ballot,
        closing: &Closing,
    ) -> Option<Peak> {
        self.step(views, rows, from, to, steps, range, 2, ballot, closing);
        let best = self.peaks[2].first().copied();
        best.filter(|back| back.curve == label)
    }

    /// One step of the loop: the curves of view `to` that a curve may be, the best first; gives whether any got votes.
    #[expect(
        clippy::too_many_arguments,
        reason = "from where to where, how far, and how"
    )]
    fn step(
        &mut self,
        views: &[ChannelView<'_>; 3],
        rows: &[Rows; 3],
        (from, label): (usize, u32),
        to: usize,
        steps: f32,
        range: Range,
        number: usize,
        ballot: &Ballot,
        closing: &Closing,
    ) -> bool {
        let peaks = &mut self.peaks[number];
        peaks.clear();
        let Some(table) = views[from].tables.tables.get(label as usize) else {
            return false;
        };
        let entries = &views[from].tables.entries[table.first as usize..][..table.count as usize];
        let curve: &Curve = &views[from].curves.curves[label as usize];
        let ends = [curve.x - steps * range.least, curve.x - steps * range.most];
        let margin = closing.width / 2.0;
        let window = Window {
            columns: (ends[0].min(ends[1]) - margin, ends[0].max(ends[1]) + margin),
            rows: (curve.y - closing.rows / 2.0, curve.y + closing.rows / 2.0),
        };
        self.windows[to].inside(window, &mut self.labels);
        self.votes.count(
            table,
            entries,
            &views[to],
            &rows[to].curve_of,
            &self.labels,
            steps,
            range,
            ballot,
            peaks,
        );
        let is_voted_for = !peaks.is_empty();
        peaks.retain(|peak| peak.score >= closing.score);
        peaks.truncate(closing.tries);
        is_voted_for
    }
}
