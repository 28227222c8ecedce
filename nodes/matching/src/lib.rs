//! Three-view matching: R-tables become disparities.
//!
//! ```text
//! curves, R-tables of three views, coarse to fine ─► candidates ─► along curves ─► support ─► matches ─► fused points
//! ```
//!
//! The thesis compares it with two rivals, which are here too ([`Method`]): curves in two views, which is the same without
//! the third view, and zero-crossings one by one in two views. What comes out has one form.

mod along;
mod by_curve;
mod by_point;
mod candidates;
mod closed_loop;
mod course;
mod differences;
mod fuse;
mod marr_poggio;
mod misaligned;
#[cfg(feature = "node")]
pub mod node;
pub mod rail;
mod relation;
mod repetition;
mod report;
mod rivals;
mod rows;
pub mod settings;
mod sightings;
mod support;
mod surroundings;
mod triple;
mod vote;

use messages::{
    Calibration, Contrast, CurvesView, DisparityRoom, MatchesRoom, PointsRoom, Reason, Size, Sway,
    TablesView,
};

pub use messages::Reference;
pub use settings::{Assignment, Filling, Method, Settings};
pub use triple::Triple;

use along::{Along, Choice};
use candidates::Candidates;
use closed_loop::{Closed, ClosedLoop};
use marr_poggio::Regions;
use repetition::Repetition;
use rows::Rows;
use support::Support;
use surroundings::Surroundings;
use triple::Steps;

/// The version of the algorithm: one more whenever the same input and settings give other matches, disparities and points.
pub const VERSION: u32 = 2;

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

impl Range {
    fn contains(self, disparity: f32) -> bool {
        (self.least..=self.most).contains(&disparity)
    }

    /// The first and the last column at which a point at column `x` of the reference view may be in a view so many
    /// baselines `to` its right.
    fn columns(self, x: f32, to: f32) -> [f32; 2] {
        let ends = [x - to * self.most, x - to * self.least];
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    }
}

/// The matcher, with its memory: it grows to the largest scan and is reused from then on.
#[derive(Debug, Default)]
pub struct Matcher {
    settings: Settings,
    /// σ² of each channel.
    variances: Vec<f32>,
    /// Of the views, in the channel matched last.
    contrast: Contrast,
    rows: [Rows; 3],
    /// Those of further views than three, and by how many baselines each stands to the right of the reference view.
    further: Vec<(f32, Rows)>,
    candidates: Candidates,
    along: Along,
    support: Support,
    regions: Regions,
    repetition: Repetition,
    /// Working memory of the search for rivals.
    alike: Vec<(f32, f32)>,
    coarser: Surroundings,
    around: Surroundings,
    choices: Vec<Choice>,
    /// Of every point of the reference view that has no choice, why it lost it.
    lost: Vec<Reason>,
    smooth: Vec<f32>,
    closed_loop: ClosedLoop,
    /// Per curve of the reference view the loop that closed.
    closed: Vec<Option<Closed>>,
    /// Per curve of the reference view the disparities at which its partners are looked for.
    bands: Vec<course::Band>,
    /// Rows by which each view's picture lies lower than the reference view's, as far as whole curves tell.
    lower: [f32; 3],
    /// Whether no view of the triple sways.
    is_steady: bool,
    /// Curves of the reference view by which pictures out of line are told.
    asked: Vec<u32>,
    nodes: Vec<relation::Node>,
    nodes_before: Vec<relation::Node>,
    /// Curves of the near and the far view that a curve's points chose, with their numbers.
    partners: [Vec<(u32, u32)>; 2],
    fuse: fuse::Fuse,
}

impl Matcher {
    /// A matcher with these settings for channels of these σ², coarse to fine.
    pub fn new(settings: &Settings, channels: &[f32]) -> Self {
        Self {
            settings: settings.clone(),
            variances: channels.to_vec(),
            ..Self::default()
        }
    }

    /// Its settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// How contrasty the views last matched are, in the finest channel.
    pub fn contrast(&self) -> &Contrast {
        &self.contrast
    }

    /// Matches one scan of a rig: `inputs` holds the channels coarse to fine, each with its three or more views left to
    /// right, a baseline apart; `matches` has a room for each channel.
    ///
    /// Matches name the curves of the reference view and of the two next to it. Where points along curves are matched in
    /// three views, further ones bear witness too; the other methods look at those three only. Of fewer than three views
    /// nothing is written.
    pub fn process<'a>(
        &mut self,
        inputs: &[impl AsRef<[ChannelView<'a>]>],
        size: Size,
        calibration: &Calibration,
        matches: &mut [MatchesRoom<'_>],
        disparity: &mut DisparityRoom<'_>,
        points: &mut PointsRoom<'_>,
    ) {
        let count = inputs.first().map_or(0, |views| views.as_ref().len());
        if count < 3 {
            return;
        }
        let reference = self.settings.reference.index(count).min(count - 1);
        let first = reference.clamp(1, count - 2) - 1;
        let triple = Triple::of_rig(reference - first);
        self.process_all(
            (&triple, first),
            inputs,
            size,
            calibration,
            matches,
            disparity,
            points,
        );
    }

    /// Matches three views wherever they stand; the calibration's baseline is the unit of their places, and each channel
    /// has its views in their order.
    #[expect(clippy::too_many_arguments, reason = "where, what, and where to")]
    pub fn process_triple(
        &mut self,
        triple: &Triple,
        inputs: &[[ChannelView<'_>; 3]],
        size: Size,
        calibration: &Calibration,
        matches: &mut [MatchesRoom<'_>],
        disparity: &mut DisparityRoom<'_>,
        points: &mut PointsRoom<'_>,
    ) {
        self.process_all(
            (triple, 0),
            inputs,
            size,
            calibration,
            matches,
            disparity,
            points,
        );
        // Columns and rows are those of the picture; the place in space is where they should be.
        let sway = &triple.sway[triple.reference];
        if !sway.is_none() {
            for point in points.points.iter_mut() {
                let (u, v) = (f64::from(point.u), f64::from(point.v));
                let [right, down] = sway.off(size, u, v);
                let metres = calibration.point_m(u - right, v - down, point.disparity.into());
                [point.x, point.y, point.z] = metres.map(|metres| metres as f32);
            }
        }
    }

    #[expect(clippy::too_many_arguments, reason = "where, what, and where to")]
    fn process_all<'a>(
        &mut self,
        triple: (&Triple, usize),
        inputs: &[impl AsRef<[ChannelView<'a>]>],
        size: Size,
        calibration: &Calibration,
        matches: &mut [MatchesRoom<'_>],
        disparity: &mut DisparityRoom<'_>,
        points: &mut PointsRoom<'_>,
    ) {
        let range = Range {
            least: self.settings.disparity_least,
            most: self
                .settings
                .disparity_most
                .unwrap_or(size.width as f32 / 8.0),
        };
        for (channel, (views, room)) in inputs.iter().zip(matches.iter_mut()).enumerate() {
            self.match_channel(triple, views.as_ref(), size, range, channel, room);
        }
        let fill_in = self
            .settings
            .fill_in
            .then_some(self.settings.fill_in_radius);
        self.fuse.fuse(
            matches,
            triple.0.reference,
            size,
            calibration,
            fill_in,
            disparity,
            points,
        );
    }

    /// Matches a channel: `first` is the triple's first view, and those beside it are further ones, a baseline apart.
    fn match_channel(
        &mut self,
        (triple, first): (&Triple, usize),
        all: &[ChannelView<'_>],
        size: Size,
        range: Range,
        channel: usize,
        room: &mut MatchesRoom<'_>,
    ) {
        let views: &[ChannelView<'_>; 3] = &std::array::from_fn(|view| all[first + view]);
        let steps = Steps::of(triple, self.settings.method == Method::ThreeView);
        let reference = views[steps.reference].curves;
        room.clear();
        self.contrast
            .measure(all.iter().map(|view| view.curves.points));
        let used = self.rows.iter_mut().zip(views).enumerate();
        for (at, (rows, view)) in used.filter(|&(view, _)| steps.uses(view)) {
            let to_the_right = triple.places[at] - triple.places[triple.reference];
            let sway = triple.beside_reference(at);
            let gain = self.contrast.gain(first + at);
            rows.fill(view, size, triple.drift * to_the_right, &sway, gain);
            if channel == 0 {
                self.lower[at] = triple.drift * to_the_right;
            }
        }
        self.is_steady = triple.sway.iter().all(Sway::is_none);
        let own = triple.places[triple.reference];
        let by_point = steps.third && self.settings.assignment == Assignment::Point;
        let others = if by_point { all.len() - 3 } else { 0 };
        self.further.resize_with(others, || (0.0, Rows::default()));
        let is_further = |(view, _): &(usize, &ChannelView<'_>)| !(first..first + 3).contains(view);
        let seen = all.iter().enumerate().filter(is_further);
        for ((to, rows), (view, seen)) in self.further.iter_mut().zip(seen) {
            *to = view as f32 - first as f32 - own;
            let gain = self.contrast.gain(view);
            rows.fill(seen, size, triple.drift * *to, &Sway::NONE, gain);
        }
        self.choices.clear();
        self.choices.resize(reference.points.len(), Choice::NOTHING);
        self.lost.clear();
        self.lost.resize(reference.points.len(), Reason::Flat);
        self.closed.clear();
        self.closed.resize(reference.curves.len(), None);
        // The central width of the filter is w = 2·√2·σ.
        let variance = self.variances.get(channel).copied().unwrap_or(1.0);
        let width = (8.0 * variance).sqrt();
        match (self.settings.method, self.settings.assignment) {
            (Method::Point, _) => self.match_points(views, size, range, steps, width, channel > 0),
            (_, Assignment::Point) => self.assign_points(views, size, range, steps, channel > 0),
            (_, Assignment::Curve) => {
                self.assign_curves(views, size, range, steps, width, channel > 0)
            }
        }
        self.coarser.clear(size, self.settings.cell, 1.0, range);
        for (edge, choice) in reference.points.iter().zip(&self.choices) {
            if choice.is_some() {
                self.coarser.add(edge.x, edge.y, choice.disparity);
            }
        }
        self.coarser.settle();
        self.report(reference, steps, room);
    }
}
