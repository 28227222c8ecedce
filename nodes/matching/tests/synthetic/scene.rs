//! Curves made up point by point, and what the matcher makes of them.

use matching::{ChannelView, Matcher};
use messages::{
    Calibration, Curve, Curves, Disparity, Edge, Match, MatchPoint, Matches, MatchesRoom, Message,
    NONE, Owned, Point, Points, Reason, Rejected, Size, Tables,
};

/// The curves of one view.
#[derive(Default)]
pub(crate) struct View {
    pub(crate) curves: Vec<Curve>,
    pub(crate) points: Vec<Edge>,
}

/// Views at equal steps, left to right.
pub(crate) struct Scene {
    pub(crate) views: Vec<View>,
    /// Whether the tables have an index of rows.
    pub(crate) rows: bool,
}

/// What came out.
pub(crate) struct Found {
    pub(crate) matches: Vec<Match>,
    pub(crate) match_points: Vec<MatchPoint>,
    pub(crate) rejected: Vec<Rejected>,
    pub(crate) points: Vec<Point>,
    pub(crate) disparity: Vec<f32>,
}

/// A number that looks random, from 0 to 1, the same for the same seed.
pub(crate) fn chance(seed: u32) -> f32 {
    let mut z = (seed as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

/// A curve that runs down, one point a row, with gray levels of its own that change slowly along it.
pub(crate) fn wavy(x: f32, row: usize, rows: usize, seed: u32) -> Vec<Edge> {
    lowered(x, row, rows, seed, 0.0)
}

/// The same in a picture that lies so many rows lower: the rows it is crossed by are the same, the places are not.
pub(crate) fn lowered(x: f32, row: usize, rows: usize, seed: u32, lower: f32) -> Vec<Edge> {
    let (phase, wave) = (6.3 * chance(seed), 0.05 + 0.1 * chance(seed + 1000));
    let point = |i: usize| {
        let angle = phase + wave * (i as f32 - lower);
        let slope = 5.0 * wave * angle.cos();
        let gray =
            |k: usize| (40.0 + 150.0 * chance(seed * 8 + k as u32) + 20.0 * angle.sin()) as u8;
        Edge {
            x: x + 5.0 * angle.sin(),
            y: (row + i) as f32,
            magnitude: 8.0 + 8.0 * chance(seed + 2000),
            orientation: (-slope).atan2(1.0),
            profile: std::array::from_fn(gray),
        }
    };
    (0..rows).map(point).collect()
}

/// A curve elsewhere, so many pixels to the left.
pub(crate) fn moved(curve: &[Edge], by: f32) -> Vec<Edge> {
    curve.iter().map(|e| Edge { x: e.x - by, ..*e }).collect()
}

impl Default for Scene {
    fn default() -> Self {
        Self::of_views(3)
    }
}

impl View {
    pub(crate) fn push(&mut self, points: &[Edge]) {
        let count = points.len() as f32;
        let mean = |of: fn(&Edge) -> f32| points.iter().map(of).sum::<f32>() / count;
        self.curves.push(Curve {
            label: self.curves.len() as u32,
            first: self.points.len() as u32,
            count: points.len() as u32,
            parent: NONE,
            x: mean(|e| e.x),
            y: mean(|e| e.y),
            magnitude: mean(|e| e.magnitude),
            length: count,
        });
        self.points.extend_from_slice(points);
    }
}

impl Scene {
    pub(crate) fn of_views(count: usize) -> Self {
        Self {
            views: std::iter::repeat_with(View::default).take(count).collect(),
            rows: true,
        }
    }

    /// Adds a curve to all views, moved by the disparity of each row.
    pub(crate) fn add(&mut self, points: &[Edge], disparity: impl Fn(f32) -> f32) {
        for (steps, view) in self.views.iter_mut().enumerate() {
            let moved = |e: &Edge| Edge {
                x: e.x - steps as f32 * disparity(e.y),
                ..*e
            };
            view.push(&points.iter().map(moved).collect::<Vec<_>>());
        }
    }

    pub(crate) fn run(&self, matcher: &mut Matcher, size: Size) -> Found {
        run_channels(&[self], matcher, size)
    }

    /// The messages the matcher would receive.
    pub(crate) fn messages(&self, size: Size) -> Vec<(Owned<Curves>, Owned<Tables>)> {
        let mut tabulator = hough::Tabulator::new(&hough::Settings::default(), size);
        let messages = |view: &View| {
            let (mut curves, mut tables) = (Owned::<Curves>::new(size), Owned::<Tables>::new(size));
            curves.fill(|room| {
                room.clear();
                room.curves.extend_from_slice(&view.curves);
                room.points.extend_from_slice(&view.points);
            });
            if self.rows {
                tables.fill(|room| tabulator.process(curves.view(), size, room));
            }
            (curves, tables)
        };
        self.views.iter().map(messages).collect()
    }
}

pub(crate) fn run_channels(channels: &[&Scene], matcher: &mut Matcher, size: Size) -> Found {
    let messages: Vec<_> = channels.iter().map(|scene| scene.messages(size)).collect();
    let views: Vec<Vec<ChannelView<'_>>> = messages
        .iter()
        .map(|views| {
            let seen = views.iter().map(|(curves, tables)| ChannelView {
                curves: curves.view(),
                tables: tables.view(),
            });
            seen.collect()
        })
        .collect();
    let mut words: Vec<Vec<u64>> = channels
        .iter()
        .map(|_| vec![0; Matches::words(size)])
        .collect();
    let mut rooms: Vec<MatchesRoom<'_>> = words
        .iter_mut()
        .map(|words| Matches::room(words, size).unwrap())
        .collect();
    let (mut disparity, mut points) = (Owned::<Disparity>::new(size), Owned::<Points>::new(size));
    let calibration = Calibration::assumed(size);
    disparity.fill(|disparity| {
        points.fill(|points| {
            matcher.process(&views, size, &calibration, &mut rooms, disparity, points)
        });
    });
    let finest = rooms.last().unwrap();
    Found {
        matches: finest.matches.to_vec(),
        match_points: finest.points.to_vec(),
        rejected: finest.rejected.to_vec(),
        points: points.view().points.to_vec(),
        disparity: disparity.view().disparity.to_vec(),
    }
}

impl Found {
    /// Why the curves were not matched that were not, in order.
    pub(crate) fn reasons(&self) -> Vec<Reason> {
        let reason = |rejected: &Rejected| Reason::of(rejected.reason).unwrap();
        self.rejected.iter().map(reason).collect()
    }

    /// The points of each curve of the reference view.
    pub(crate) fn by_curve(&self, curves: usize) -> Vec<Vec<Point>> {
        let own = |curve: usize| {
            self.points
                .iter()
                .filter(|p| p.curve == curve as u32)
                .copied()
                .collect()
        };
        (0..curves).map(own).collect()
    }
}
