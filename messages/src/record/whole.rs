//! The whole map so far, thinned: what a viewer shows of a rail wherever it seeks to.

use crate::elements::MapPoint;
use crate::mixed;
use crate::payload::MapView;
use crate::row;

/// The topic that says it.
pub const WHOLE: &str = "map/whole";

/// Frames from one message to the next: what was settled meanwhile is in the frames' own maps.
const EVERY: u64 = 8;

/// Points that it has at most.
const MOST: usize = 50_000;

row! { "bytemuck";
    /// A point of the map, as far as pictures need it.
    pub(super) struct Spot {
        /// Metres to the right of where the rail begins.
        pub(super) x: f32,
        /// Metres down.
        pub(super) y: f32,
        /// Metres forward.
        pub(super) z: f32,
        /// Standard deviation of its distance, in metres.
        pub(super) sigma: f32,
        /// Disparity of a baseline, in pixels.
        pub(super) disparity: f32,
    }
}

/// The map so far.
///
/// Of more points than it may have it keeps those whose lot ends in so many zeros: which these are does not depend on when
/// they came, so that a recorder that was begun again says what it would have said.
#[derive(Debug, Default)]
pub(super) struct Whole {
    /// The newest frame in it.
    newest: Option<u64>,
    /// Zeros that lots need.
    zeros: u32,
    lots: Vec<u64>,
    spots: Vec<Spot>,
}

impl Whole {
    /// Takes in what a frame has settled; frames come in order, and one that has been there changes nothing.
    pub(super) fn add(&mut self, frame: u64, map: MapView<'_>) {
        if self.newest.is_some_and(|newest| newest >= frame) {
            return;
        }
        self.newest = Some(frame);
        for (index, point) in (0..).zip(map.points) {
            let lot = mixed(frame << 24 ^ index);
            if lot.trailing_zeros() >= self.zeros {
                self.lots.push(lot);
                self.spots.push(Spot::of(point));
            }
        }
        while self.spots.len() > MOST {
            self.zeros += 1;
            let is_kept = |lot: &u64| lot.trailing_zeros() >= self.zeros;
            let mut lots = self.lots.iter();
            self.spots.retain(|_| lots.next().is_some_and(is_kept));
            self.lots.retain(is_kept);
        }
    }

    /// Whether it is to be said with this frame.
    pub(super) fn is_due(&self, frame: u64) -> bool {
        frame % EVERY == EVERY - 1
    }

    /// Its points.
    pub(super) fn spots(&self) -> &[Spot] {
        &self.spots
    }
}

impl Spot {
    fn of(point: &MapPoint) -> Self {
        Self {
            x: point.x,
            y: point.y,
            z: point.z,
            sigma: point.sigma,
            disparity: point.disparity,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(number: u64, count: usize) -> Vec<MapPoint> {
        let point = |index: usize| MapPoint {
            x: number as f32,
            y: index as f32,
            ..MapPoint::default()
        };
        (0..count).map(point).collect()
    }

    #[test]
    fn few_points_are_all_there_and_a_frame_that_comes_again_counts_once() {
        let mut whole = Whole::default();
        for number in [0, 1, 1, 0, 2] {
            whole.add(
                number,
                MapView {
                    points: &frame(number, 100),
                },
            );
        }
        assert_eq!(whole.spots().len(), 300);
    }

    #[test]
    fn of_many_points_a_fair_share_of_every_frame_stays_whenever_they_came() {
        let mut whole = Whole::default();
        for number in 0..100 {
            whole.add(
                number,
                MapView {
                    points: &frame(number, 4000),
                },
            );
        }
        let spots = whole.spots();
        assert!((MOST / 3..=MOST).contains(&spots.len()), "{}", spots.len());
        for number in 0..100 {
            let of_frame = spots.iter().filter(|spot| spot.x == number as f32).count();
            assert!((100..900).contains(&of_frame), "{number}: {of_frame}");
        }
        // It is the points whose lots end in so many zeros, as few zeros as there is room for.
        let of_zeros = |zeros: u32| {
            let all = (0..100u64).flat_map(|frame| (0..4000u64).map(move |index| (frame, index)));
            let lot = |(frame, index): &(u64, u64)| mixed(frame << 24 ^ index);
            all.filter(move |at| lot(at).trailing_zeros() >= zeros)
        };
        let is_at = |(spot, (frame, index)): (&Spot, (u64, u64))| {
            (spot.x, spot.y) == (frame as f32, index as f32)
        };
        assert_eq!(of_zeros(whole.zeros).count(), spots.len());
        assert!(spots.iter().zip(of_zeros(whole.zeros)).all(is_at));
        assert!(of_zeros(whole.zeros - 1).count() > MOST);
    }
}
