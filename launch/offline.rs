//! The stages as plain calls, one after the other in one process: for sweeps over scenes and settings, where no scan is
//! live and nothing is recorded. What they compute is what the nodes compute, to the byte.

use capture::Source;
use evaluate::{Evaluator, Known};
use matching::ChannelView;
use messages::recording::{ReadError, Recording};
use messages::settings::Settings;
use messages::{
    Calibration, Curves, CurvesView, Edge, Edges, Evaluation, Image, Kind, MatchesView, NONE,
    Owned, Point, Score, Share, Size, Tables, Topic, Truth,
};

use crate::Failure;
use crate::chain::{OfView, OfViews};
use crate::graph::Graph;

/// What a node is told by a graph.
pub(crate) fn settings<S: Settings>(graph: &Graph, node: &str) -> Result<S, Failure> {
    let settings: S =
        serde_json::from_value(graph.settings_of(node).clone()).map_err(Failure::usage)?;
    settings.check().map_err(Failure::usage)?;
    Ok(settings)
}

/// The points on the curves of an image's finest channel, and their gradients.
pub(crate) fn curve_points(graph: &Graph, image: &Owned<Image>) -> Result<Vec<Edge>, Failure> {
    let size = image.header.size();
    let mut of_view = of_view(graph, size)?;
    of_view.begin(image.view());
    // Channels go from coarse to fine.
    let finest = graph.channels()?.len().saturating_sub(1);
    let mut curves = Owned::<Curves>::new(size);
    of_view.curves(finest, &mut curves);
    Ok(curves.view().points.to_vec())
}

/// The stages that look at one view, as the graph sets them.
fn of_view(graph: &Graph, size: Size) -> Result<OfView, Failure> {
    Ok(OfView::new(
        &settings(graph, "filter")?,
        &settings(graph, "track")?,
        &settings(graph, "hough")?,
        size,
    ))
}

/// A scan as far as its R-tables.
pub(crate) struct Tabulated {
    pub(crate) size: Size,
    pub(crate) channels: Vec<f32>,
    calibration: Calibration,
    images: Vec<Owned<Image>>,
    /// By channel, then view.
    curves: Vec<Owned<Curves>>,
    tables: Vec<Owned<Tables>>,
}

/// What was matched in a scan.
pub(crate) struct Matched(OfViews);

/// How a scan compares with the truth.
#[derive(Clone, Debug)]
pub(crate) struct Evaluated {
    /// First the result, then each channel.
    pub(crate) scores: Vec<Score>,
    pub(crate) curve: Vec<Share>,
}

impl Tabulated {
    /// Reads a scan and takes it through the stages before matching.
    pub(crate) fn of(graph: &Graph, source: &mut Source, scan: u64) -> Result<Self, Failure> {
        let channels = graph.channels()?;
        let size = source.size_of(scan);
        let mut images = Vec::new();
        for view in 0..source.view_count() {
            let mut image = Owned::<Image>::new(size);
            image
                .fill(|room| source.read(scan, view, room))
                .map_err(Failure::failed)?;
            images.push(image);
        }
        let empty = || channels.len() * images.len();
        let mut curves: Vec<_> = (0..empty()).map(|_| Owned::<Curves>::new(size)).collect();
        let mut tables: Vec<_> = (0..empty()).map(|_| Owned::<Tables>::new(size)).collect();
        let mut of_view = of_view(graph, size)?;
        for (view, image) in images.iter().enumerate() {
            of_view.begin(image.view());
            for channel in 0..channels.len() {
                let at = images.len() * channel + view;
                of_view.curves(channel, &mut curves[at]);
                of_view.tables(&curves[at], &mut tables[at]);
            }
        }
        Ok(Self {
            size,
            calibration: source.calibration().unwrap_or(Calibration::assumed(size)),
            channels,
            images,
            curves,
            tables,
        })
    }

    /// HIGH and LOW as the tracker would choose them for the finest channel of a view, in the units of the graph's filter.
    pub(crate) fn automatic_thresholds(
        &self,
        graph: &Graph,
        view: usize,
    ) -> Result<[f64; 2], Failure> {
        let own: filter::Settings = settings(graph, "filter")?;
        let absolute = filter::Settings {
            scaling: filter::Scaling::Absolute,
            ..own.clone()
        };
        let mut edges = Owned::<Edges>::new(self.size);
        let mut filter = filter::Filter::new(&absolute, self.size);
        filter.begin(self.images[view].view(), self.size);
        edges.fill(|room| {
            room.clear();
            filter.edges(self.channels.len() - 1, room);
        });
        let mut magnitudes = track::Histogram::new();
        let mut largest: f32 = 0.0;
        for edge in edges.view().edges {
            magnitudes.add(edge.magnitude);
            largest = largest.max(edge.magnitude);
        }
        let found = track::Thresholds::new(&track::Settings::default(), &magnitudes);
        let unit = match own.scaling {
            filter::Scaling::Picture if largest > 0.0 => 255.0 / largest,
            _ => 1.0,
        };
        Ok([found.high, found.low].map(|threshold| f64::from(unit * threshold)))
    }

    /// Reads from a recording what was recorded of a scan as far as its R-tables, and the truth of the reference view.
    ///
    /// # Errors
    /// When something of it was not recorded or is damaged.
    pub(crate) fn of_recording(
        recording: &mut Recording,
        scan: u64,
    ) -> Result<(Self, Vec<f32>), ReadError> {
        let codec = recording.codec().clone();
        let rig = recording.metadata().rig.clone();
        let read = recording.scan(scan)?;
        let images = Topic::of(&rig, Kind::Image);
        let images = images.iter().map(|topic| read.decode(&codec, topic));
        let images: Vec<Owned<Image>> = images.collect::<Result<_, _>>()?;
        let size = images.first().map_or(rig.size, |image| image.header.size());
        let (mut curves, mut tables) = (Vec::new(), Vec::new());
        for channel in 0..rig.channels.len() as u32 {
            let of = |kind| {
                let mut topics = Topic::of(&rig, kind);
                topics.retain(|topic| topic.channel == channel);
                topics
            };
            for topic in of(Kind::Curves) {
                curves.push(read.decode::<Curves>(&codec, &topic)?);
            }
            for topic in of(Kind::Tables) {
                tables.push(read.decode::<Tables>(&codec, &topic)?);
            }
        }
        let mut truth = Vec::new();
        for topic in Topic::of(&rig, Kind::Truth) {
            let read = read.decode::<Truth>(&codec, &topic)?;
            truth.extend_from_slice(read.view().disparity);
        }
        recording.reuse(read);
        let tabulated = Self {
            size,
            calibration: rig.calibration(size),
            channels: rig.channels,
            images,
            curves,
            tables,
        };
        Ok((tabulated, truth))
    }

    fn known<'a>(&'a self, view: usize, truth: &'a [f32]) -> Known<'a> {
        Known {
            pixels: self.images[view].view().pixels,
            truth,
            size: self.size,
        }
    }

    /// The curves of a view in a channel.
    pub(crate) fn curves(&self, view: usize, channel: usize) -> CurvesView<'_> {
        self.curves[self.views() * channel + view].view()
    }

    /// How many views it has.
    pub(crate) fn views(&self) -> usize {
        self.images.len()
    }

    /// Matches all views.
    pub(crate) fn matched(&self, settings: &matching::Settings) -> Matched {
        self.matched_in(settings, 0..self.views())
    }

    /// Matches some of the views, at least three, of which the settings' reference is one.
    pub(crate) fn matched_in(
        &self,
        settings: &matching::Settings,
        chosen: std::ops::Range<usize>,
    ) -> Matched {
        let view = |at: usize| ChannelView {
            curves: self.curves[at].view(),
            tables: self.tables[at].view(),
        };
        let (count, views) = (self.channels.len(), self.images.len());
        let of = |channel: usize| chosen.clone().map(move |at| view(views * channel + at));
        let inputs: Vec<Vec<ChannelView<'_>>> =
            (0..count).map(|channel| of(channel).collect()).collect();
        let mut of_views = OfViews::new(settings, &self.channels, self.size);
        of_views.process(&inputs, &self.calibration);
        Matched(of_views)
    }
}

impl Matched {
    /// The result's points.
    pub(crate) fn points(&self) -> &[Point] {
        self.0.points().points
    }

    /// What was matched in a channel.
    pub(crate) fn matches(&self, channel: usize) -> MatchesView<'_> {
        self.0.matches()[channel].view()
    }

    /// The surest points, as many as cover so much, compared with the truth of the reference view.
    pub(crate) fn surest(
        &self,
        scan: &Tabulated,
        evaluator: &mut Evaluator,
        view: usize,
        truth: &[f32],
        coverage: f32,
    ) -> Score {
        evaluator.surest(scan.known(view, truth), self.0.points(), coverage)
    }

    /// Compares what was matched with the truth of the reference view.
    pub(crate) fn evaluated(
        &self,
        scan: &Tabulated,
        evaluator: &mut Evaluator,
        view: usize,
        truth: &[f32],
    ) -> Evaluated {
        let known = scan.known(view, truth);
        let matches: Vec<_> = self.0.matches().iter().map(Owned::view).collect();
        let mut evaluation = Owned::<Evaluation>::new(scan.size);
        evaluation.fill(|room| evaluator.process(known, self.0.points(), &matches, room));
        let view = evaluation.view();
        debug_assert!(
            view.scores
                .first()
                .is_none_or(|score| score.channel == NONE)
        );
        Evaluated {
            scores: view.scores.to_vec(),
            curve: view.curve.to_vec(),
        }
    }
}
