//! The stages as plain calls with their memory: what the library, sweeps over settings and reports are put together of.
//! What they compute is what the nodes compute, to the byte.

use matching::{ChannelView, Matcher};
use messages::{
    Calibration, Curves, Disparity, Edges, ImageView, Matches, MatchesRoom, Message as _, Owned,
    Points, PointsView, Size, Tables,
};

/// The stages that look at one view alone: filter ─► track ─► hough.
pub(crate) struct OfView {
    size: Size,
    filter: filter::Filter,
    tracker: track::Tracker,
    tabulator: hough::Tabulator,
    edges: Owned<Edges>,
}

impl OfView {
    /// With these settings, for images of this size.
    pub(crate) fn new(
        filter: &filter::Settings,
        track: &track::Settings,
        hough: &hough::Settings,
        size: Size,
    ) -> Self {
        Self {
            size,
            filter: filter::Filter::new(filter, size),
            tracker: track::Tracker::new(track, size),
            tabulator: hough::Tabulator::new(hough, size),
            edges: Owned::new(size),
        }
    }

    /// Takes in a view, for all its channels.
    pub(crate) fn begin(&mut self, image: ImageView<'_>) {
        self.filter.begin(image, self.size);
    }

    /// The curves of a channel of the view taken in.
    pub(crate) fn curves(&mut self, channel: usize, curves: &mut Owned<Curves>) {
        self.edges.fill(|room| {
            room.clear();
            self.filter.edges(channel, room);
        });
        curves.fill(|room| self.tracker.process(self.edges.view(), self.size, room));
    }

    /// The R-tables of curves.
    pub(crate) fn tables(&mut self, curves: &Owned<Curves>, tables: &mut Owned<Tables>) {
        tables.fill(|room| self.tabulator.process(curves.view(), self.size, room));
    }
}

/// The stage that brings views together, match, with what it found last.
pub(crate) struct OfViews {
    size: Size,
    matcher: Matcher,
    words: Vec<Vec<u64>>,
    /// By channel.
    matches: Vec<Owned<Matches>>,
    disparity: Owned<Disparity>,
    points: Owned<Points>,
    /// Memory for what is borrowed while views are matched.
    rooms: Vec<MatchesRoom<'static>>,
}

impl OfViews {
    /// With these settings, for these channels of images of this size.
    pub(crate) fn new(settings: &matching::Settings, channels: &[f32], size: Size) -> Self {
        let count = channels.len();
        Self {
            size,
            matcher: Matcher::new(settings, channels),
            words: vec![vec![0; Matches::words(size)]; count],
            matches: (0..count).map(|_| Owned::new(size)).collect(),
            disparity: Owned::new(size),
            points: Owned::new(size),
            rooms: Vec::new(),
        }
    }

    /// Matches views: of each channel, coarse to fine, all of them from left to right.
    pub(crate) fn process<'a>(
        &mut self,
        inputs: &[impl AsRef<[ChannelView<'a>]>],
        calibration: &Calibration,
    ) {
        let size = self.size;
        let mut rooms = emptied(std::mem::take(&mut self.rooms));
        let words = self.words.iter_mut();
        rooms.extend(words.filter_map(|words| Matches::room(words, size)));
        let (matcher, points) = (&mut self.matcher, &mut self.points);
        self.disparity.fill(|disparity| {
            points.fill(|points| {
                matcher.process(inputs, size, calibration, &mut rooms, disparity, points);
            });
        });
        for (room, matches) in rooms.iter().zip(&mut self.matches) {
            matches.fill(|out| Matches::copy(room.as_view(), out));
        }
        self.rooms = emptied(rooms);
    }

    /// The trusted points of all channels.
    pub(crate) fn points(&self) -> PointsView<'_> {
        self.points.view()
    }

    /// The disparity picture.
    pub(crate) fn disparity(&self) -> &[f32] {
        self.disparity.view().disparity
    }

    /// What was matched in each channel, coarse to fine.
    pub(crate) fn matches(&self) -> &[Owned<Matches>] {
        &self.matches
    }
}

/// A list's memory for a list of the same type but for what it borrows.
pub(crate) fn emptied<A, B>(mut list: Vec<A>) -> Vec<B> {
    list.clear();
    // Collected in place: types of one layout keep the memory.
    list.into_iter().filter_map(|_| None).collect()
}
