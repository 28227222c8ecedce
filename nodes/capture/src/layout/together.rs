//! Images that were taken at one time and have no name or number in common.

use std::collections::BTreeSet;
use std::path::Path;

use super::{Piece, Table, Time, Together, stamp, stem};

impl Table {
    /// Whether all cameras took an image at any time.
    pub(super) fn has_whole(&self) -> bool {
        whole(&self.times) > 0
    }

    /// Puts images together that are called after the time they were taken at, where they are and more go together so than
    /// by name; whether they are. Only dates and long numbers are surely times.
    pub(super) fn put_together_by_time(&mut self, is_sure: bool) -> bool {
        if whole(&self.times) == self.times.len() {
            return false;
        }
        let by_camera = self.by_camera();
        let times = by_time(&by_camera, is_sure).filter(|times| whole(times) > whole(&self.times));
        let Some(times) = times else {
            return false;
        };
        let taken: BTreeSet<&Path> = times
            .iter()
            .flat_map(|time| time.images.iter().flatten())
            .map(|piece| piece.path.as_path())
            .collect();
        let all = by_camera.iter().flatten().map(|piece| &piece.path);
        self.alone = all
            .filter(|path| !taken.contains(path.as_path()))
            .cloned()
            .collect();
        (self.times, self.together) = (times, Together::Stamp);
        true
    }

    /// Puts images together by their order, where each camera has as many.
    pub(super) fn put_together_by_order(&mut self) {
        let by_camera = self.by_camera();
        let count = by_camera[0].len();
        if by_camera.iter().any(|images| images.len() != count) {
            return;
        }
        self.together = Together::Order;
        self.times = (0..count)
            .map(|number| Time {
                name: stem(&by_camera[0][number].path),
                images: by_camera
                    .iter()
                    .map(|images| Some(images[number].clone()))
                    .collect(),
            })
            .collect();
    }

    /// The images of each camera, in order.
    fn by_camera(&self) -> Vec<Vec<Piece>> {
        let taken = |camera: usize| {
            let images = self.times.iter();
            images
                .filter_map(|time| time.images[camera].clone())
                .collect()
        };
        (0..self.cameras.len()).map(taken).collect()
    }
}

/// The images of several cameras, called after the time they were taken at: each with those nearest to it, and of them the
/// whole ones. `None` where their names are no such times.
fn by_time(by_camera: &[Vec<Piece>], is_sure: bool) -> Option<Vec<Time>> {
    let names: Vec<Vec<String>> = by_camera
        .iter()
        .map(|images| images.iter().map(|piece| stem(&piece.path)).collect())
        .collect();
    let stamps: Option<Vec<Vec<f64>>> = names
        .iter()
        .map(|own| own.iter().map(|name| stamp::of(name)).collect())
        .collect();
    let numbers = || stamp::numbers(&names).filter(|_| !is_sure);
    let near = nearest(&stamps.or_else(numbers)?)?;
    let time = |(name, near): (&String, Vec<Option<usize>>)| Time {
        name: name.clone(),
        images: near
            .into_iter()
            .zip(by_camera)
            .map(|(at, images)| at.map(|at| images[at].clone()))
            .collect(),
    };
    Some(names[names.len() / 2].iter().zip(near).map(time).collect())
}

/// For each time of the camera in the middle what the others took nearest to it, where that is each other's nearest and
/// less than half an interval away; `None` where cameras hardly ever took something at one time.
pub(super) fn nearest(stamps: &[Vec<f64>]) -> Option<Vec<Vec<Option<usize>>>> {
    // Of each camera its times in their order, with their places.
    let sorted: Vec<Vec<(f64, usize)>> = stamps
        .iter()
        .map(|own| {
            let mut own: Vec<(f64, usize)> = own.iter().copied().zip(0..).collect();
            own.sort_by(|a, b| a.0.total_cmp(&b.0));
            own
        })
        .collect();
    let (own, own_sorted) = (stamps.get(stamps.len() / 2)?, &sorted[sorted.len() / 2]);
    let mut intervals: Vec<f64> = own_sorted
        .windows(2)
        .map(|pair| pair[1].0 - pair[0].0)
        .collect();
    intervals.sort_by(f64::total_cmp);
    let reach = intervals.get(intervals.len() / 2)? / 2.0;
    let nearest = |all: &[(f64, usize)], at: f64| {
        let after = all.partition_point(|(time, _)| *time < at);
        let around = all[after.saturating_sub(1)..].iter().take(2);
        let distance = |(time, _): &&(f64, usize)| (time - at).abs();
        let found = around.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        found.map(|(_, index)| *index)
    };
    let near = |(number, &at): (usize, &f64)| -> Vec<Option<usize>> {
        let of = |(theirs, sorted): (&Vec<f64>, &Vec<(f64, usize)>)| {
            let index = nearest(sorted, at)?;
            let is_mutual = nearest(own_sorted, theirs[index]) == Some(number);
            (is_mutual && (theirs[index] - at).abs() < reach).then_some(index)
        };
        stamps.iter().zip(&sorted).map(of).collect()
    };
    let times: Vec<Vec<Option<usize>>> = own.iter().enumerate().map(near).collect();
    let whole = times.iter().filter(|near| near.iter().all(Option::is_some));
    (2 * whole.count() >= times.len()).then_some(times)
}

/// How many of these times have an image of every camera.
fn whole(times: &[Time]) -> usize {
    let is_whole = |time: &&Time| time.images.iter().all(Option::is_some);
    times.iter().filter(is_whole).count()
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn images_called_after_their_times_go_with_those_next_to_them() {
        let camera = |offset: u64, without: u64| -> Vec<Piece> {
            let times = (0..6).filter(|time| *time != without);
            let name = |time: u64| format!("{}.png", 1_700_000_000_000 + 100 * time + offset);
            times.map(|time| PathBuf::from(name(time)).into()).collect()
        };
        let times = by_time(&[camera(0, 9), camera(3, 4), camera(7, 1)], true).unwrap();
        let whole: Vec<&str> = times
            .iter()
            .filter(|time| time.images.iter().all(Option::is_some))
            .map(|time| &time.name[10..11])
            .collect();
        assert_eq!(whole, ["0", "2", "3", "5"]);
        let frames = ["0001.png", "0002.png"]
            .map(|name| PathBuf::from(name).into())
            .to_vec();
        assert!(
            by_time(&[frames.clone(), frames], true).is_none(),
            "these are numbers, not times"
        );
    }
}
