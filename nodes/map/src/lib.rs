//! The map: a point that a camera on a rail sees from many places becomes one point in space.
//!
//! ```text
//! points of frame k ─► linked to those of the frames before ─► tracks ─► a line through each ─► map, growing
//! ```
//!
//! A point at a fixed place moves along its image row in proportion to the camera: u = U − D·τ, τ being the way along the
//! rail in baselines. Every frame that sees it adds a sighting (u, τ); the line through all of them, by least squares,
//! gives its column U and its disparity D, and what the sightings miss it by gives their standard deviations. The base is
//! as long as the track, which is why the map is more exact than any triple.
//!
//! What a frame adds is a function of a bounded number of frames before it, [`Settings::reach`]: a track is
//! settled, and written into the map once, when it ends or has been followed through the whole window; after that it is
//! still followed, so that nothing is written twice, but says nothing more.

#[cfg(feature = "node")]
pub mod node;
mod settled;

use messages::{Calibration, GrowingRoom, MapPoint, MapRoom, Point, Size, Sway};

use settled::Settled;

/// The version of the algorithm: one more whenever the same input and settings give other maps.
pub const VERSION: u32 = 1;

messages::settings! {
    /// How points of many frames become one.
    pub struct Settings {
        /// Frames through which a point is followed before it is settled. Twelve steps of base are six times a triple's.
        pub window: u64 = 12, in 2..=64;
        /// Sightings that a point of the map needs. Each is itself agreed on by three frames.
        pub sightings: u32 = 3, in 1..=64;
        /// Columns by which a sighting may miss what the point's own disparity predicts.
        pub miss: f32 = 0.8, in 0.05..=8;
        /// Pixels of disparity by which sightings of one point may differ.
        pub differ: f32 = 1.0, in 0.05..=16;
        /// Columns by which sightings may miss their line, root mean square, in a point of the map.
        pub residual: f32 = 0.5, in 0.05..=8;
        /// Least score of a sighting.
        pub score: f32 = 0.0, in 0..=1;
        /// Columns and pixels of disparity by which a point of the map must differ from those in its row that were settled
        /// through the last `window` frames, or were left out for this: tracks break and begin again, and channels see one
        /// contour twice. 0 keeps all. On 60 frames of leaves 0.5 leaves out a quarter.
        pub apart: f64 = 0.5, in 0..=8;
    }
}

/// Frames that a point may go unseen before its track ends.
pub const GAP: usize = 3;

impl Settings {
    /// Frames of points before a frame on which its share of the map depends.
    ///
    /// Where the frames before are not known, a track may seem to begin that goes on from there, in the first [`GAP`]
    /// frames; the last that is heard of it is when it has been followed through the window and then not been seen. After
    /// that it is remembered, not to be written again.
    pub fn reach(&self) -> u64 {
        self.window + 2 * (GAP as u64 + 1) + self.remembered()
    }

    /// Frames for which a settled point is remembered. More would leave out more and need more frames, all of which must be
    /// there to be sent again when a node dies.
    fn remembered(&self) -> u64 {
        if self.apart > 0.0 { self.window } else { 0 }
    }
}

/// Where a frame was taken, and what its disparities mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Along the rail, in metres.
    pub position_m: f64,
    /// The camera; its baseline is the unit of disparities.
    pub camera: Calibration,
    /// Rows by which the picture lies lower a baseline further to the right.
    pub drift_px: f64,
    /// By how much the frame is off, in pictures of this size.
    pub sway: Sway,
    /// The size of the picture.
    pub size: Size,
}

/// A point on its way through the frames.
#[derive(Clone, Copy, Debug)]
struct Track {
    /// Frames since its first sighting; it grows no older than the window.
    age: u64,
    is_settled: bool,
    /// Where its first sighting was, along the rail in baselines, and its column and row there.
    origin: f64,
    column: f64,
    row: f32,
    sightings: u32,
    /// Sightings that the line through the others does not explain.
    strays: u32,
    score: f32,
    /// Sums over the sightings of τ, τ², e, τ·e, e², where e is the column less the first one.
    sums: [f64; 5],
}

/// A line through a track.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// The first sighting's place along the rail, in baselines.
    origin: f64,
    /// Column and row there.
    column: f64,
    row: f64,
    disparity: f64,
    /// Standard deviation of the disparity.
    sigma: f64,
    /// What sightings miss it by, root mean square.
    residual: f64,
}

impl Line {
    /// The column at a place along the rail.
    fn column_at(&self, origin: f64) -> f64 {
        self.column - self.disparity * (origin - self.origin)
    }
}

/// Columns that a sighting is never surer than.
const LEAST_SIGMA: f64 = 0.05;

impl Track {
    fn new(point: &Point, origin: f64) -> Self {
        Self {
            age: 0,
            is_settled: false,
            origin,
            column: point.u.into(),
            row: point.v,
            sightings: 1,
            strays: 0,
            score: point.score,
            sums: [0.0; 5],
        }
    }

    /// Adds a sighting at this place and column.
    fn add(&mut self, origin: f64, column: f64, score: f32) {
        let way = origin - self.origin;
        let miss = column - self.column;
        if let Some(line) = self.line().filter(|_| self.sightings >= 4) {
            let allowed = (4.0 * line.residual).max(0.5);
            if (column - line.column_at(origin)).abs() > allowed {
                self.strays += 1;
                return;
            }
        }
        let terms = [way, way * way, miss, way * miss, miss * miss];
        for (sum, term) in self.sums.iter_mut().zip(terms) {
            *sum += term;
        }
        self.sightings += 1;
        self.score = self.score.max(score);
    }

    /// The line of least squares; `None` of sightings from one place.
    fn line(&self) -> Option<Line> {
        let n = f64::from(self.sightings);
        let [way, way2, miss, way_miss, miss2] = self.sums;
        let spread = way2 - way * way / n;
        if self.sightings < 2 || spread < 1e-9 {
            return None;
        }
        let slope = (way_miss - way * miss / n) / spread;
        let start = (miss - slope * way) / n;
        let rest = (miss2 - miss * miss / n - slope * slope * spread).max(0.0);
        let residual = (rest / n).sqrt();
        // Two of the sightings only make the line.
        let sigma = (rest / (n - 2.0).max(1.0)).sqrt().max(LEAST_SIGMA);
        Some(Line {
            origin: self.origin,
            column: self.column + start,
            row: self.row.into(),
            disparity: -slope,
            sigma: sigma / spread.sqrt(),
            residual,
        })
    }

    /// Its line, when there is enough to it for a point.
    fn sure(&self, settings: &Settings) -> Option<Line> {
        self.line().filter(|line| {
            self.sightings >= settings.sightings
                && line.residual <= f64::from(settings.residual)
                && self.strays * 2 <= self.sightings
                && line.disparity > 0.0
        })
    }

    /// The point in the rail's frame.
    fn point(&self, line: &Line, place: &Place) -> MapPoint {
        let camera = &place.camera;
        let [x, y, z] = camera.point_m(line.column, line.row, line.disparity);
        MapPoint {
            x: (x + self.origin * camera.baseline_m) as f32,
            y: y as f32,
            z: z as f32,
            sigma: (z * line.sigma / line.disparity) as f32,
            disparity: line.disparity as f32,
            score: self.score,
            sightings: self.sightings,
        }
    }
}

/// The points of a frame and the tracks that they belong to.
#[derive(Debug, Default)]
struct Frame {
    /// Place along the rail, in baselines.
    origin: f64,
    points: Vec<Point>,
    /// Their columns, side by side in memory: what is searched.
    columns: Vec<f32>,
    tracks: Vec<Track>,
    /// Whether a later frame saw the point again.
    is_continued: Vec<bool>,
    /// Where each row begins among the points, which are in raster order; and where the last ends.
    rows: Vec<u32>,
}

/// The fusion, with its memory: as many frames as a point may go unseen.
#[derive(Debug)]
pub struct Fusion {
    settings: Settings,
    /// The newest first.
    frames: Vec<Frame>,
    settled: Settled,
}

impl Fusion {
    /// Nothing seen yet.
    pub fn new(settings: &Settings) -> Self {
        let frames = std::iter::repeat_with(Frame::default).take(GAP + 2);
        Self {
            settings: settings.clone(),
            frames: frames.collect(),
            settled: Settled::default(),
        }
    }

    /// Forgets all frames.
    pub fn reset(&mut self) {
        self.frames.iter_mut().for_each(Frame::clear);
        self.settled.clear();
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Takes in the points of the next frame, in raster order: what is settled with it goes into `map`, what is still
    /// followed into `growing`.
    ///
    /// Points between two rows, on contours that run along the row, have no exact column and are left out.
    pub fn process(
        &mut self,
        points: &[Point],
        rows: u32,
        place: &Place,
        map: &mut MapRoom<'_>,
        growing: &mut GrowingRoom<'_>,
    ) {
        map.clear();
        growing.clear();
        self.frames.rotate_right(1);
        let (newest, before) = self.frames.split_at_mut(1);
        let frame = &mut newest[0];
        let origin = place.position_m / place.camera.baseline_m;
        frame.fill(points, rows, origin, &self.settings);
        if !place.sway.is_none() {
            frame.put_right(rows, place);
        }
        for index in 0..frame.points.len() {
            let point = frame.points[index];
            // Only a picture that drifts shows other points of a contour in a row.
            let slope = match place.drift_px {
                0.0 => 0.0,
                _ => frame.slope(index),
            };
            let mut track = None;
            for (gap, before) in (1..).zip(before.iter_mut().take(GAP + 1)) {
                if let Some(found) =
                    before.find(&point, slope, origin, place.drift_px, &self.settings)
                {
                    before.is_continued[found] = true;
                    let mut continued = before.tracks[found];
                    continued.age = (continued.age + gap).min(self.settings.window + 1);
                    if !continued.is_settled {
                        // The same point of the contour, had the picture not drifted.
                        let drifted = place.drift_px * (origin - continued.origin);
                        let column = f64::from(point.u) + drifted * f64::from(slope);
                        continued.add(origin, column, point.score);
                    }
                    track = Some(continued);
                    break;
                }
            }
            frame
                .tracks
                .push(track.unwrap_or_else(|| Track::new(&point, origin)));
        }
        let (known, settings) = (&mut self.settled, &self.settings);
        known.begin(origin, rows, place.drift_px, settings.remembered());
        let mut settle = |track: &Track| {
            let line = track.sure(settings);
            let is_new = |line: &Line| settings.apart == 0.0 || known.add(line, settings.apart);
            if let Some(line) = line.filter(is_new) {
                map.points.push(track.point(&line, place));
            }
        };
        for track in &mut frame.tracks {
            if !track.is_settled && track.age >= settings.window {
                track.is_settled = true;
                settle(track);
            }
        }
        // What has not been seen for so long will not be linked any more.
        let ended = &mut before[GAP];
        for (track, is_continued) in ended.tracks.iter().zip(&ended.is_continued) {
            if !track.is_settled && !is_continued {
                settle(track);
            }
        }
        ended.clear();
        let followed = std::iter::once(&*frame).chain(&before[..GAP]);
        for frame in followed {
            let open = frame.tracks.iter().zip(&frame.is_continued);
            let open = open.filter(|(track, is_continued)| !track.is_settled && !**is_continued);
            for (track, _) in open {
                if let Some(line) = track.sure(settings) {
                    growing.points.push(track.point(&line, place));
                }
            }
        }
    }
}

impl Frame {
    fn clear(&mut self) {
        self.points.clear();
        self.columns.clear();
        self.tracks.clear();
        self.is_continued.clear();
        self.rows.clear();
    }

    fn fill(&mut self, points: &[Point], rows: u32, origin: f64, settings: &Settings) {
        self.clear();
        self.origin = origin;
        let is_exact = |point: &&Point| point.v.fract() == 0.0 && point.score >= settings.score;
        self.points.extend(points.iter().filter(is_exact));
        self.index(rows);
    }

    /// Moves the points to where they would be, were the frame not off: in its row again, each along its contour.
    fn put_right(&mut self, rows: u32, place: &Place) {
        let moved = (0..self.points.len()).map(|index| {
            let point = self.points[index];
            let [right, down] = place.sway.off(place.size, point.u.into(), point.v.into());
            let row = (point.v - down as f32).round();
            let lower = row - (point.v - down as f32);
            Point {
                u: point.u - right as f32 + lower * self.slope(index),
                v: row,
                ..point
            }
        });
        let is_inside = |point: &Point| (0.0..rows as f32).contains(&point.v);
        let mut moved: Vec<Point> = moved.filter(is_inside).collect();
        moved.sort_by(|a, b| (a.v.total_cmp(&b.v)).then(a.u.total_cmp(&b.u)));
        self.points = moved;
        self.index(rows);
    }

    /// Notes where rows begin among the points.
    fn index(&mut self, rows: u32) {
        self.columns.clear();
        self.columns.extend(self.points.iter().map(|point| point.u));
        self.is_continued.clear();
        self.is_continued.resize(self.points.len(), false);
        self.rows.clear();
        let mut at = 0;
        for row in 0..=rows {
            while at < self.points.len() && self.points[at].v < row as f32 {
                at += 1;
            }
            self.rows.push(at as u32);
        }
    }

    /// The points of a row.
    fn row(&self, row: i64) -> std::ops::Range<usize> {
        let ends = usize::try_from(row)
            .ok()
            .and_then(|row| self.rows.get(row..row + 2));
        ends.map_or(0..0, |ends| ends[0] as usize..ends[1] as usize)
    }

    /// The points of a row within `reach` columns of this one.
    fn around(&self, row: i64, column: f32, reach: f32) -> std::ops::Range<usize> {
        let range = self.row(row);
        let columns = &self.columns[range.clone()];
        let first = columns.partition_point(|&other| other < column - reach);
        let within = columns[first..].iter();
        let count = within.take_while(|&&other| other <= column + reach).count();
        range.start + first..range.start + first + count
    }

    /// Columns a row along a point's contour, from the points of the same curve in the rows above and below.
    fn slope(&self, index: usize) -> f32 {
        /// Columns that a contour may move in a row, for its points to be told from others.
        const STEEPEST: f32 = 3.0;
        let point = &self.points[index];
        let beside = |row: i64| {
            let near = self.points[self.around(row, point.u, STEEPEST)].iter();
            let own =
                near.filter(|other| (other.curve, other.channel) == (point.curve, point.channel));
            own.min_by(|a, b| (a.u - point.u).abs().total_cmp(&(b.u - point.u).abs()))
        };
        let row = point.v as i64;
        match (beside(row - 1), beside(row + 1)) {
            (Some(above), Some(below)) => (below.u - above.u) / 2.0,
            (Some(above), None) => point.u - above.u,
            (None, Some(below)) => below.u - point.u,
            (None, None) => 0.0,
        }
    }

    /// The point of this frame, not seen again yet, that a later frame sees as this one.
    fn find(
        &self,
        point: &Point,
        slope: f32,
        origin: f64,
        drift_px: f64,
        settings: &Settings,
    ) -> Option<usize> {
        if self.points.is_empty() {
            return None;
        }
        // Towards where it was: against the way of the camera.
        let way = (origin - self.origin) as f32;
        let drifted = drift_px as f32 * way;
        let expected = point.u + point.disparity * way + drifted * slope;
        let near = self.around(point.v as i64, expected, settings.miss);
        let alike = near.filter(|&at| {
            let other = &self.points[at];
            !self.is_continued[at]
                && other.channel == point.channel
                && (other.disparity - point.disparity).abs() <= settings.differ
        });
        let away = |at: usize| (self.columns[at] - expected).abs();
        alike.min_by(|&a, &b| away(a).total_cmp(&away(b)))
    }
}
