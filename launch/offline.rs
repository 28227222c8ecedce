//! The stages as plain calls, one after the other in one process: for sweeps over scenes and settings, where no scan is
//! live and nothing is recorded. What they compute is what the nodes compute, to the byte.

use capture::Source;
use evaluate::{Evaluator, Known};
use matching::{ChannelView, Matcher};
use messages::recording::{ReadError, Recording};
use messages::settings::Settings;
use messages::{
    Calibration, Curves, CurvesView, Disparity, Edge, Edges, Evaluation, Image, Kind, Matches,
    MatchesView, Message, NONE, Owned, Point, Points, Score, Share, Size, Tables, Topic, Truth,
};

use crate::Failure;
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
    let mut filter = filter::Filter::new(&settings(graph, "filter")?, size);
    let mut tracker = track::Tracker::new(&settings(graph, "track")?, size);
    let mut edges = Owned::<Edges>::new(size);
    filter.begin(image.view(), size);
    // Channels go from coarse to fine.
    let finest = graph.channels()?.len().saturating_sub(1);
    edges.fill(|room| {
        room.clear();
        filter.edges(finest, room);
    });
    let mut curves = Owned::<Curves>::new(size);
    curves.fill(|room| tracker.process(edges.view(), size, room));
    Ok(curves.view().points.to_vec())
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
pub(crate) struct Matched {
    /// By channel.
    matches: Vec<Owned<Matches>>,
    points: Owned<Points>,
}

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
        let filter: filter::Settings = settings(graph, "filter")?;
        let channels = graph.channels()?;
        let size = source.size_of(scan);
        let mut tabulated = Self {
            size,
            calibration: source.calibration().unwrap_or(Calibration::assumed(size)),
            images: Vec::new(),
            curves: Vec::new(),
            tables: Vec::new(),
            channels,
        };
        let mut tracker = track::Tracker::new(&settings(graph, "track")?, size);
        let mut tabulator = hough::Tabulator::new(&settings(graph, "hough")?, size);
        let mut filter = filter::Filter::new(&filter, size);
        for view in 0..source.view_count() {
            let mut image = Owned::<Image>::new(size);
            image
                .fill(|room| source.read(scan, view, room))
                .map_err(Failure::failed)?;
            tabulated.images.push(image);
        }
        let mut edges = Owned::<Edges>::new(size);
        let mut by_view = Vec::new();
        for image in &tabulated.images {
            filter.begin(image.view(), size);
            let mut channels = Vec::new();
            for channel in 0..tabulated.channels.len() {
                edges.fill(|room| {
                    room.clear();
                    filter.edges(channel, room);
                });
                let mut curves = Owned::<Curves>::new(size);
                curves.fill(|room| tracker.process(edges.view(), size, room));
                let mut tables = Owned::<Tables>::new(size);
                tables.fill(|room| tabulator.process(curves.view(), size, room));
                channels.push((curves, tables));
            }
            by_view.push(channels.into_iter());
        }
        for _ in 0..tabulated.channels.len() {
            for (curves, tables) in by_view.iter_mut().filter_map(Iterator::next) {
                tabulated.curves.push(curves);
                tabulated.tables.push(tables);
            }
        }
        Ok(tabulated)
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
        let size = self.size;
        let view = |at: usize| ChannelView {
            curves: self.curves[at].view(),
            tables: self.tables[at].view(),
        };
        let (count, views) = (self.channels.len(), self.images.len());
        let of = |channel: usize| chosen.clone().map(move |at| view(views * channel + at));
        let inputs: Vec<Vec<ChannelView<'_>>> =
            (0..count).map(|channel| of(channel).collect()).collect();
        let mut words = vec![vec![0u64; Matches::words(size)]; count];
        let mut rooms: Vec<_> = words
            .iter_mut()
            .filter_map(|words| Matches::room(words, size))
            .collect();
        let mut disparity = Owned::<Disparity>::new(size);
        let mut points = Owned::<Points>::new(size);
        let mut matcher = Matcher::new(settings, &self.channels);
        disparity.fill(|disparity| {
            points.fill(|points| {
                matcher.process(
                    &inputs,
                    size,
                    &self.calibration,
                    &mut rooms,
                    disparity,
                    points,
                );
            });
        });
        let owned = |room: &messages::MatchesRoom<'_>| {
            let mut matches = Owned::<Matches>::new(size);
            matches.fill(|out| Matches::copy(room.as_view(), out));
            matches
        };
        Matched {
            matches: rooms.iter().map(owned).collect(),
            points,
        }
    }
}

impl Matched {
    /// The result's points.
    pub(crate) fn points(&self) -> &[Point] {
        self.points.view().points
    }

    /// What was matched in a channel.
    pub(crate) fn matches(&self, channel: usize) -> MatchesView<'_> {
        self.matches[channel].view()
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
        evaluator.surest(scan.known(view, truth), self.points.view(), coverage)
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
        let matches: Vec<_> = self.matches.iter().map(Owned::view).collect();
        let mut evaluation = Owned::<Evaluation>::new(scan.size);
        evaluation.fill(|room| evaluator.process(known, self.points.view(), &matches, room));
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
