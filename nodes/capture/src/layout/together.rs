//! Images that were taken at one time and have no name or number in common.

use std::collections::BTreeSet;
use std::path::Path;

use super::{Piece, Table, Time, Together, stamp, stem};

impl Table {
    /// Whether all cameras took an image at any time.
    pub(super) fn has_whole(&self) -> bool {
        let is_whole = |time: &Time| time.images.iter().all(Option::is_some);
        self.times.iter().any(is_whole)
    }

    /// Puts images together that are called after the time they were taken at, where they are; whether they are.
    pub(super) fn put_together_by_stamp(&mut self) -> bool {
        let by_camera = self.by_camera();
        let Some(times) = by_stamp(&by_camera) else {
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
fn by_stamp(by_camera: &[Vec<Piece>]) -> Option<Vec<Time>> {
    let stamp = |piece: &Piece| stamp::of(&stem(&piece.path));
    let stamps: Option<Vec<Vec<f64>>> = by_camera
        .iter()
        .map(|images| images.iter().map(stamp).collect())
        .collect();
    let stamps = stamps?;
    let own = &stamps[stamps.len() / 2];
    let mut intervals: Vec<f64> = own.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_by(f64::total_cmp);
    let reach = intervals.get(intervals.len() / 2)? / 2.0;
    let nearest = |all: &[f64], at: f64| {
        let distance = |index: &usize| (all[*index] - at).abs();
        (0..all.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    let mut times = Vec::with_capacity(own.len());
    for (number, &at) in own.iter().enumerate() {
        let images = stamps.iter().zip(by_camera).map(|(theirs, images)| {
            let index = nearest(theirs, at)?;
            let is_mutual = nearest(own, theirs[index]) == Some(number);
            (is_mutual && (theirs[index] - at).abs() < reach).then(|| images[index].clone())
        });
        times.push(Time {
            name: stem(&by_camera[by_camera.len() / 2][number].path),
            images: images.collect(),
        });
    }
    // Cameras that hardly ever took something at one time did not run together.
    let whole = times
        .iter()
        .filter(|time| time.images.iter().all(Option::is_some));
    (2 * whole.count() >= times.len()).then_some(times)
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
        let times = by_stamp(&[camera(0, 9), camera(3, 4), camera(7, 1)]).unwrap();
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
            by_stamp(&[frames.clone(), frames]).is_none(),
            "these are numbers, not times"
        );
    }
}
