//! Three-view matching: R-tables become disparities.
//!
//! ```text
//! curves, R-tables of three views, coarse to fine ─► candidates ─► along curves ─► runs ─► matches ─► fused points
//! ```
//!
//! [`Matcher`] is the door. By default every point along a curve chooses for itself, as `method.rs` does it step by step. Two
//! guests have rooms and settings of their own: the thesis's whole curves (`thesis`, [`CurveSettings`]) and Marr and Poggio's
//! points alone (`points`, [`PointSettings`]). What comes out has one form.

// The default method.
mod along;
mod candidates;
mod choice;
mod method;
mod repetition;
mod rivals;
mod rows;
mod runs;
mod sightings;
mod support;
mod surroundings;
// What all methods share.
mod fuse;
#[cfg(feature = "node")]
pub mod node;
pub mod rail;
mod report;
pub mod settings;
mod triple;
// The guests.
mod points;
mod thesis;

use messages::{
    Calibration, Contrast, CurvesView, DisparityRoom, MatchesRoom, PointsRoom, Reason, Size, Sway,
    TablesView,
};

pub use messages::Reference;
pub use points::settings::PointSettings;
pub use settings::{Assignment, Method, Settings};
pub use thesis::settings::{CurveSettings, Filling};
pub use triple::Triple;

use candidates::Candidates;
use choice::Choice;
use method::AlongCurves;
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

/// Pixels a cell measures in which neighbours are counted, …
pub(crate) const NEIGHBOURS_CELL: f32 = 8.0;

/// … and pixels of disparity within which they agree.
pub(crate) const NEIGHBOURS_WITHIN: f32 = 1.0;

/// Pixels a cell measures in which a coarser channel's disparities are collected. From 8 to 32 coverage changes by less than
/// 0.001.
const COARSER_CELL: f32 = 16.0;

/// A channel of three views that is matched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task<'a> {
    pub(crate) views: &'a [ChannelView<'a>; 3],
    pub(crate) size: Size,
    pub(crate) range: Range,
    pub(crate) steps: Steps,
    /// Central width of the channel's filter, in pixels.
    pub(crate) width: f32,
    pub(crate) has_coarser: bool,
}

/// What every method works with, and what it fills: a choice for every point of the reference view.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    /// Of the views, in the channel matched last.
    pub(crate) contrast: Contrast,
    pub(crate) rows: [Rows; 3],
    pub(crate) candidates: Candidates,
    pub(crate) support: Support,
    /// What the next coarser channel found.
    pub(crate) coarser: Surroundings,
    pub(crate) around: Surroundings,
    pub(crate) choices: Vec<Choice>,
    /// Of every point of the reference view that has no choice, why it lost it.
    pub(crate) lost: Vec<Reason>,
}

/// The matcher, with its memory: it grows to the largest scan and is reused from then on.
#[derive(Debug, Default)]
pub struct Matcher {
    settings: Settings,
    /// σ² of each channel.
    variances: Vec<f32>,
    shared: Shared,
    /// Those of further views than three, and by how many baselines each stands to the right of the reference view.
    further: Vec<(f32, Rows)>,
    along_curves: AlongCurves,
    curves: thesis::Curves,
    points: points::Points,
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
        &self.shared.contrast
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
        self.fuse.fuse(
            matches,
            triple.0.reference,
            size,
            calibration,
            self.settings.fill_in,
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
        let shared = &mut self.shared;
        shared
            .contrast
            .measure(all.iter().map(|view| view.curves.points));
        if channel == 0 {
            self.curves.begin(triple);
        }
        let used = shared.rows.iter_mut().zip(views).enumerate();
        for (at, (rows, view)) in used.filter(|&(view, _)| steps.uses(view)) {
            let to_the_right = triple.places[at] - triple.places[triple.reference];
            let sway = triple.beside_reference(at);
            let gain = shared.contrast.gain(first + at);
            rows.fill(view, size, triple.drift * to_the_right, &sway, gain);
        }
        shared.choices.clear();
        shared
            .choices
            .resize(reference.points.len(), Choice::NOTHING);
        shared.lost.clear();
        shared.lost.resize(reference.points.len(), Reason::Flat);
        // The central width of the filter is w = 2·√2·σ.
        let variance = self.variances.get(channel).copied().unwrap_or(1.0);
        let task = Task {
            views,
            size,
            range,
            steps,
            width: (8.0 * variance).sqrt(),
            has_coarser: channel > 0,
        };
        match (self.settings.method, self.settings.assignment) {
            (Method::ThreeView | Method::TwoView, Assignment::Point) => {
                self.fill_further((triple, first), all, size);
                self.along_curves
                    .assign(&task, &self.further, &self.settings, &mut self.shared);
            }
            (Method::ThreeView | Method::TwoView, Assignment::Curve) => {
                self.curves.clear(reference);
                self.curves.assign(&task, &self.settings, &mut self.shared);
            }
            (Method::Point, _) => self.points.assign(&task, &self.settings, &mut self.shared),
        }
        let Shared {
            coarser, choices, ..
        } = &mut self.shared;
        coarser.clear(size, COARSER_CELL, 1.0, range);
        for (edge, choice) in reference.points.iter().zip(choices) {
            if choice.is_some() {
                coarser.add(edge.x, edge.y, choice.disparity);
            }
        }
        coarser.settle();
        self.report(reference, steps, room);
    }

    /// Takes in the views beside the three, where the third view has a say.
    fn fill_further(
        &mut self,
        (triple, first): (&Triple, usize),
        all: &[ChannelView<'_>],
        size: Size,
    ) {
        let others = match self.settings.method {
            Method::ThreeView => all.len() - 3,
            Method::TwoView | Method::Point => 0,
        };
        let own = triple.places[triple.reference];
        self.further.resize_with(others, || (0.0, Rows::default()));
        let is_further = |(view, _): &(usize, &ChannelView<'_>)| !(first..first + 3).contains(view);
        let seen = all.iter().enumerate().filter(is_further);
        for ((to, rows), (view, seen)) in self.further.iter_mut().zip(seen) {
            *to = view as f32 - first as f32 - own;
            let gain = self.shared.contrast.gain(view);
            rows.fill(seen, size, triple.drift * *to, &Sway::NONE, gain);
        }
    }
}
