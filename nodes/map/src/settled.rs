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
    /// Row by row the columns at that place, and the disparities.
    rows: Vec<Vec<(f64, f64)>>,
}

impl Settled {
    /// Begins a frame; of those before as many as `remembered` are known with it.
    pub(crate) fn begin(&mut self, origin: f64, rows: u32, remembered: u64) {
        let mut frame = match self.frames.len() as u64 > remembered {
            true => self.frames.pop_front().unwrap_or_default(),
            false => Frame::default(),
        };
        frame.origin = origin;
        frame.rows.iter_mut().for_each(Vec::clear);
        frame.rows.resize_with(rows as usize, Vec::new);
        self.frames.push_back(frame);
    }

    /// Adds a line, and says whether it is new: whether none of those known in its row is within `apart` columns and
    /// pixels of disparity of it.
    ///
    /// One that is not new is remembered all the same: while a contour is seen its lines follow each other, and the
    /// last of them may be the only one that is still remembered.
    pub(crate) fn add(&mut self, line: &Line, row: usize, apart: f64) -> bool {
        let is_near = |frame: &Frame| {
            let column = line.column_at(frame.origin);
            let known = frame.rows.get(row).into_iter().flatten();
            known.into_iter().any(|&(other, disparity)| {
                (other - column).abs() <= apart && (disparity - line.disparity).abs() <= apart
            })
        };
        let is_new = !self.frames.iter().any(is_near);
        if let Some(newest) = self.frames.back_mut() {
            let column = line.column_at(newest.origin);
            if let Some(row) = newest.rows.get_mut(row) {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn line(column: f64, disparity: f64) -> Line {
        Line {
            origin: 2.0,
            column,
            disparity,
            sigma: 0.01,
            residual: 0.1,
        }
    }

    #[test]
    fn a_line_is_new_where_none_like_it_was_settled_in_its_row_of_late() {
        let mut settled = Settled::default();
        settled.begin(2.0, 10, 2);
        assert!(settled.add(&line(50.0, 8.0), 3, 0.5));
        assert!(!settled.add(&line(50.4, 8.2), 3, 0.5), "beside it");
        assert!(settled.add(&line(50.4, 8.2), 4, 0.5), "another row");
        assert!(settled.add(&line(50.4, 9.0), 3, 0.5), "another depth");
        assert!(settled.add(&line(52.0, 8.0), 3, 0.5), "another column");
    }

    #[test]
    fn lines_are_compared_where_the_camera_was() {
        let mut settled = Settled::default();
        settled.begin(2.0, 10, 2);
        settled.add(&line(50.0, 8.0), 3, 0.5);
        settled.begin(5.0, 10, 2);
        // The same place in space, seen first from three baselines further on, its column 24 px less.
        let later = Line {
            origin: 5.0,
            ..line(26.1, 8.0)
        };
        assert!(!settled.add(&later, 3, 0.5));
    }

    #[test]
    fn a_line_is_known_for_as_many_frames_as_are_remembered_after_its_own_or_its_likes_are_settled()
    {
        let mut settled = Settled::default();
        settled.begin(0.0, 10, 2);
        assert!(settled.add(&line(50.0, 8.0), 3, 0.5));
        for _ in 0..3 {
            settled.begin(0.0, 10, 2);
            settled.begin(0.0, 10, 2);
            assert!(!settled.add(&line(50.0, 8.0), 3, 0.5));
        }
        (0..3).for_each(|_| settled.begin(0.0, 10, 2));
        assert!(settled.add(&line(50.0, 8.0), 3, 0.5));
    }
}
