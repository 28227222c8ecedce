//! What was settled of late: a point of the map is written once, though its track breaks, or two channels follow it.

use std::collections::VecDeque;

use crate::Line;

/// The lines settled with the last frames, written or not.
#[derive(Debug, Default)]
pub(crate) struct Settled {
    /// The newest last.
    frames: VecDeque<Frame>,
}

/// Those settled with one frame.
#[derive(Debug, Default)]
struct Frame {
    /// Place along the rail, in baselines.
    origin: f64,
    /// Rows by which the picture lies lower a baseline further to the right.
    drift_px: f64,
    /// Row by row, as they are at that place, the columns there and the disparities.
    rows: Vec<Vec<(f64, f64)>>,
}

impl Settled {
    /// Begins a frame; of those before as many as `remembered` are known with it.
    pub(crate) fn begin(&mut self, origin: f64, rows: u32, drift_px: f64, remembered: u64) {
        let mut frame = match self.frames.len() as u64 > remembered {
            true => self.frames.pop_front().unwrap_or_default(),
            false => Frame::default(),
        };
        (frame.origin, frame.drift_px) = (origin, drift_px);
        frame.rows.iter_mut().for_each(Vec::clear);
        frame.rows.resize_with(rows as usize, Vec::new);
        self.frames.push_back(frame);
    }

    /// Adds a line, and says whether it is new: whether none of those known in its row is within `apart` columns and
    /// pixels of disparity of it.
    ///
    /// One that is not new is remembered all the same: while a contour is seen its lines follow each other, and the
    /// last of them may be the only one that is still remembered.
    pub(crate) fn add(&mut self, line: &Line, apart: f64) -> bool {
        let is_near = |frame: &Frame| {
            let column = line.column_at(frame.origin);
            let known = frame.row_of(line).and_then(|row| frame.rows.get(row));
            known.into_iter().flatten().any(|&(other, disparity)| {
                (other - column).abs() <= apart && (disparity - line.disparity).abs() <= apart
            })
        };
        let is_new = !self.frames.iter().any(is_near);
        if let Some(newest) = self.frames.back_mut() {
            let column = line.column_at(newest.origin);
            let row = newest.row_of(line);
            if let Some(row) = row.and_then(|row| newest.rows.get_mut(row)) {
                row.push((column, line.disparity));
            }
        }
        is_new
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        self.frames.clear();
    }
}

impl Frame {
    /// The row in which a line's place in space is seen here; `None` above the picture.
    fn row_of(&self, line: &Line) -> Option<usize> {
        let row = line.row + self.drift_px * (self.origin - line.origin);
        (row > -0.5).then(|| row.round() as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(column: f64, disparity: f64) -> Line {
        Line {
            origin: 2.0,
            column,
            row: 3.0,
            disparity,
            sigma: 0.01,
            residual: 0.1,
        }
    }

    #[test]
    fn a_line_is_new_where_none_like_it_was_settled_in_its_row_of_late() {
        let mut settled = Settled::default();
        settled.begin(2.0, 10, 0.0, 2);
        assert!(settled.add(&line(50.0, 8.0), 0.5));
        assert!(!settled.add(&line(50.4, 8.2), 0.5), "beside it");
        let below = Line {
            row: 4.0,
            ..line(50.4, 8.2)
        };
        assert!(settled.add(&below, 0.5), "another row");
        assert!(settled.add(&line(50.4, 9.0), 0.5), "another depth");
        assert!(settled.add(&line(52.0, 8.0), 0.5), "another column");
    }

    #[test]
    fn lines_are_compared_where_the_camera_was() {
        let mut settled = Settled::default();
        let drift_px = 0.4;
        settled.begin(2.0, 10, drift_px, 2);
        settled.add(&line(50.0, 8.0), 0.5);
        settled.begin(5.0, 10, drift_px, 2);
        // The same place in space, seen first from three baselines further on, its column 24 px less and its row 1.2 more.
        let later = Line {
            origin: 5.0,
            row: 4.2,
            ..line(26.1, 8.0)
        };
        assert!(!settled.add(&later, 0.5));
    }

    #[test]
    fn a_line_is_known_for_as_many_frames_as_are_remembered_after_its_own_or_its_likes_are_settled()
    {
        let mut settled = Settled::default();
        let begin = |settled: &mut Settled| settled.begin(0.0, 10, 0.0, 2);
        begin(&mut settled);
        assert!(settled.add(&line(50.0, 8.0), 0.5));
        for _ in 0..3 {
            begin(&mut settled);
            begin(&mut settled);
            assert!(!settled.add(&line(50.0, 8.0), 0.5));
        }
        (0..3).for_each(|_| begin(&mut settled));
        assert!(settled.add(&line(50.0, 8.0), 0.5));
    }
}
