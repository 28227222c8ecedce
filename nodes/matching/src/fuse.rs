//! One result of all channels: the finest, and coarser ones where it has nothing.

use messages::{Calibration, DisparityRoom, MatchesRoom, NONE, Point, PointsRoom, Size};

/// The fusion, with its memory.
#[derive(Debug, Default)]
pub(crate) struct Fuse {
    /// For every pixel the channel that has a point there, or [`NONE`].
    taken: Vec<u32>,
    /// For every pixel the score of the point whose disparity it shows.
    scores: Vec<f32>,
    unsorted: Vec<Point>,
    /// Column and index of every point, row by row.
    keys: Vec<u64>,
    ends: Vec<u32>,
}

impl Fuse {
    /// Fills the disparity picture and the list of points; `channels` are coarse to fine, each with its matches and
    /// the label of the reference view's curve in each.
    #[expect(
        clippy::too_many_arguments,
        reason = "what is fused, in which view, and where to"
    )]
    pub(crate) fn fuse(
        &mut self,
        channels: &[MatchesRoom<'_>],
        reference: usize,
        size: Size,
        calibration: &Calibration,
        fill_in: bool,
        disparity: &mut DisparityRoom<'_>,
        points: &mut PointsRoom<'_>,
    ) {
        let (width, height) = (size.width as usize, size.height as usize);
        self.taken.clear();
        self.taken.resize(size.pixels(), NONE);
        self.scores.clear();
        self.scores.resize(size.pixels(), f32::NEG_INFINITY);
        disparity.clear();
        points.clear();
        let picture = disparity.disparity.grow(size.pixels());
        picture.fill(f32::NAN);
        let finest = channels.len().saturating_sub(1);
        for (channel, matches) in channels.iter().enumerate().rev() {
            if channel < finest && !fill_in {
                break;
            }
            for found in matches.matches.iter() {
                for point in
                    &matches.points[found.first as usize..(found.first + found.count) as usize]
                {
                    let (column, row) = ((point.x + 0.5) as usize, (point.y + 0.5) as usize);
                    if column >= width || row >= height || point.disparity <= 0.0 {
                        continue;
                    }
                    let pixel = row * width + column;
                    if self.taken[pixel] != NONE && self.taken[pixel] != channel as u32 {
                        continue;
                    }
                    self.taken[pixel] = channel as u32;
                    let place = (
                        f64::from(point.x),
                        f64::from(point.y),
                        f64::from(point.disparity),
                    );
                    let [x, y, z] = calibration
                        .point_m(place.0, place.1, place.2)
                        .map(|metres| metres as f32);
                    points.points.push(Point {
                        x,
                        y,
                        z,
                        u: point.x,
                        v: point.y,
                        disparity: point.disparity,
                        score: point.score,
                        curve: found.curves[reference],
                        channel: channel as u32,
                    });
                    if let Some(shown) = picture
                        .get_mut(pixel)
                        .filter(|_| point.score > self.scores[pixel])
                    {
                        *shown = point.disparity;
                        self.scores[pixel] = point.score;
                    }
                }
            }
        }
        self.sort(height, points);
    }

    /// Sorts row by row, left to right.
    fn sort(&mut self, height: usize, points: &mut PointsRoom<'_>) {
        self.unsorted.clear();
        self.unsorted.extend_from_slice(&points.points);
        let row = |point: &Point| point.v as usize;
        // Where each row's points start, and then, as they are put there, where they end.
        self.ends.clear();
        self.ends.resize(height, 0);
        for point in &self.unsorted {
            self.ends[row(point)] += 1;
        }
        let mut start = 0;
        for end in &mut self.ends {
            (*end, start) = (start, start + *end);
        }
        self.keys.clear();
        self.keys.resize(self.unsorted.len(), 0);
        for (index, point) in (0..).zip(&self.unsorted) {
            let end = &mut self.ends[row(point)];
            // Coordinates are not negative, so their bits sort as they do.
            self.keys[*end as usize] = (u64::from(point.u.to_bits()) << 32) | index;
            *end += 1;
        }
        let mut start = 0;
        for &end in &self.ends {
            self.keys[start..end as usize].sort_unstable();
            start = end as usize;
        }
        for (sorted, &key) in points.points.iter_mut().zip(&self.keys) {
            *sorted = self.unsorted[key as u32 as usize];
        }
    }
}
