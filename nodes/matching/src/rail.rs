//! Triples of one camera that moves along a rail: which frames form them, and what is kept of those before.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use messages::{Rail, Sway};

use crate::Triple;

/// Why a frame has no triple.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoTriple {
    /// Fewer frames came before it than its triple reaches back.
    TooEarly,
    /// The camera stood still.
    Still,
    /// The camera turned back between its frames.
    TurnedBack,
    /// One of the two steps is over [`MOST_UNEQUAL`] times the other.
    Unequal,
    /// The steps are over [`LONGEST`] baselines.
    TooFar,
}

impl fmt::Display for NoTriple {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooEarly => "too few frames before",
            Self::Still => "the camera stood still",
            Self::TurnedBack => "the camera turned back",
            Self::Unequal => "unequal steps",
            Self::TooFar => "too far apart",
        })
    }
}

/// Baselines that a step must measure: of shorter ones the disparities say little.
pub const SHORTEST: f64 = 0.25;
/// Baselines that a step may measure: the disparities of longer ones are out of the range that is searched.
pub const LONGEST: f64 = 2.5;
/// How many times longer one step may be than the other.
pub const MOST_UNEQUAL: f64 = 3.0;

/// The triple of frames that stand at these places along the rail, in metres, the newest first, for which the results are;
/// `baseline_m` is the unit of its disparities.
///
/// # Errors
/// Why they are none.
pub fn triple(rail: &Rail, places_m: [f64; 3], baseline_m: f64) -> Result<Triple, NoTriple> {
    let place = |index: usize| (places_m[index] - places_m[0]) / baseline_m;
    let steps = [place(1), place(2) - place(1)];
    let [short, long] = match steps.map(f64::abs) {
        [one, other] if one > other => [other, one],
        ordered => ordered,
    };
    if long < SHORTEST {
        return Err(NoTriple::Still);
    }
    if short > 0.0 && steps[0] * steps[1] < 0.0 {
        return Err(NoTriple::TurnedBack);
    }
    if short < SHORTEST || long > MOST_UNEQUAL * short {
        return Err(NoTriple::Unequal);
    }
    if long > LONGEST {
        return Err(NoTriple::TooFar);
    }
    Ok(Triple {
        reference: 0,
        places: [0.0, place(1) as f32, place(2) as f32],
        drift: rail.drift_px as f32,
        sway: [Sway::NONE; 3],
    })
}

/// What is to be done with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Its results are empty: it has no frames before it.
    First,
    /// Match it with these two frames before it.
    Match([u64; 2]),
}

/// The frames that later ones are matched with, and those that wait for earlier ones.
#[derive(Debug)]
pub struct Frames<F> {
    rail: Rail,
    kept: BTreeMap<u64, F>,
    waiting: BTreeSet<u64>,
    /// Those that have had their turn and have not come again.
    turned: BTreeSet<u64>,
}

impl<F> Frames<F> {
    /// No frame yet.
    pub fn new(rail: Rail) -> Self {
        Self {
            rail,
            kept: BTreeMap::new(),
            waiting: BTreeSet::new(),
            turned: BTreeSet::new(),
        }
    }

    /// Takes in a frame, which may come again; those below `needed_from` are needed no more.
    ///
    /// Frames are large, and whoever is behind this stage may need far more of them to be sent again than a triple reaches
    /// back: of those that have had their turn only so many are kept.
    pub fn push(&mut self, sequence: u64, frame: F, needed_from: u64) {
        // Who comes again comes with all after it.
        self.turned.split_off(&sequence);
        self.turned = self.turned.split_off(&needed_from);
        let is_open = |frame: &u64| !self.turned.contains(frame);
        let open = (needed_from..).find(is_open).unwrap_or(needed_from);
        let kept_from = open.saturating_sub(self.rail.reach()).max(needed_from);
        self.kept = self.kept.split_off(&kept_from);
        self.waiting = self.waiting.split_off(&needed_from);
        if sequence >= needed_from {
            self.kept.insert(sequence, frame);
            self.waiting.insert(sequence);
        }
    }

    /// The next frame whose turn it is. One that only later frames need, because it is done itself, has none; one whose
    /// predecessors are still to come waits for them.
    pub fn next(&mut self, needed_from: u64) -> Option<(u64, Turn)> {
        let reach = self.rail.reach();
        let turn = |&sequence: &u64| {
            let Some(first) = sequence.checked_sub(reach) else {
                return Some((sequence, Some(Turn::First)));
            };
            let before = [sequence - self.rail.stride, first];
            match before.iter().all(|frame| self.kept.contains_key(frame)) {
                true => Some((sequence, Some(Turn::Match(before)))),
                // It came again only for the sake of later ones.
                false if first < needed_from => Some((sequence, None)),
                false => None,
            }
        };
        loop {
            let (sequence, turn) = self.waiting.iter().find_map(turn)?;
            self.waiting.remove(&sequence);
            self.turned.insert(sequence);
            if let Some(turn) = turn {
                return Some((sequence, turn));
            }
        }
    }

    /// A frame that is kept.
    pub fn get(&self, sequence: u64) -> Option<&F> {
        self.kept.get(&sequence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAIL: Rail = Rail {
        stride: 2,
        drift_px: 0.0,
        follow: 0,
    };

    fn turns(frames: &mut Frames<()>, needed_from: u64) -> Vec<(u64, Turn)> {
        std::iter::from_fn(|| frames.next(needed_from)).collect()
    }

    #[test]
    fn every_frame_is_matched_with_the_frames_one_and_two_strides_before() {
        let mut frames = Frames::new(RAIL);
        let mut all = Vec::new();
        for sequence in 0..7 {
            frames.push(sequence, (), 0);
            all.extend(turns(&mut frames, 0));
        }
        let first = (0..4).map(|sequence| (sequence, Turn::First));
        let rest = (4..7).map(|sequence| (sequence, Turn::Match([sequence - 2, sequence - 4])));
        assert_eq!(all, first.chain(rest).collect::<Vec<_>>());
    }

    #[test]
    fn a_frame_waits_for_those_before_it() {
        let mut frames = Frames::new(RAIL);
        for sequence in [4, 0] {
            frames.push(sequence, (), 0);
        }
        assert_eq!(turns(&mut frames, 0), [(0, Turn::First)]);
        frames.push(2, (), 0);
        let expected = [(2, Turn::First), (4, Turn::Match([2, 0]))];
        assert_eq!(turns(&mut frames, 0), expected);
    }

    #[test]
    fn frames_that_come_again_for_the_sake_of_later_ones_are_not_matched_themselves() {
        let mut frames = Frames::new(RAIL);
        let mut all = Vec::new();
        for sequence in 6..12 {
            frames.push(sequence, (), 6);
            all.extend(turns(&mut frames, 6));
        }
        let expected = [(10, Turn::Match([8, 6])), (11, Turn::Match([9, 7]))];
        assert_eq!(all, expected);
    }

    #[test]
    fn what_is_needed_no_more_is_forgotten() {
        let mut frames = Frames::new(RAIL);
        for sequence in 0..100u64 {
            frames.push(sequence, (), sequence.saturating_sub(6));
            turns(&mut frames, sequence.saturating_sub(6));
            assert!(frames.kept.len() <= 7);
        }
    }

    #[test]
    fn of_frames_that_had_their_turn_no_more_are_kept_than_a_triple_reaches_back() {
        let mut frames = Frames::new(RAIL);
        for sequence in 0..100u64 {
            frames.push(sequence, (), sequence.saturating_sub(40));
            assert_eq!(turns(&mut frames, sequence.saturating_sub(40)).len(), 1);
            assert!(frames.kept.len() <= 5, "{:?}", frames.kept);
        }
        // Somebody else died: all that are needed come again, and have their turn again.
        let needed_from = 60;
        let mut all = Vec::new();
        for sequence in needed_from..110 {
            frames.push(sequence, (), needed_from);
            all.extend(turns(&mut frames, needed_from));
            // Beside them the last ones of before, until they come again.
            assert!(frames.kept.len() <= 10, "{:?}", frames.kept);
        }
        let expected = (64..110).map(|frame| (frame, Turn::Match([frame - 2, frame - 4])));
        assert_eq!(all, expected.collect::<Vec<_>>());
    }

    #[test]
    fn a_frame_that_comes_twice_on_its_way_holds_no_other_up() {
        let mut frames = Frames::new(RAIL);
        let mut had = Vec::new();
        for sequence in 0..60u64 {
            let needed_from = sequence.saturating_sub(10);
            frames.push(sequence, (), needed_from);
            had.extend(turns(&mut frames, needed_from));
            if sequence % 7 == 6 {
                frames.push(sequence - 5, (), needed_from);
                had.extend(turns(&mut frames, needed_from));
            }
            assert!(
                had.iter().any(|(turned, _)| *turned == sequence),
                "{sequence}"
            );
        }
        for sequence in 60..80 {
            frames.push(sequence, (), sequence - 10);
            turns(&mut frames, sequence - 10);
        }
        assert!(frames.kept.len() <= 5, "{:?}", frames.kept);
    }

    #[test]
    fn triples_go_either_way_and_at_steps_that_are_not_quite_equal() {
        let right = triple(&RAIL, [2.0, 1.0, 0.0], 1.0);
        assert_eq!(right.map(|t| t.places), Ok([0.0, -1.0, -2.0]));
        let left = triple(&RAIL, [0.0, 1.0, 2.0], 1.0);
        assert_eq!(left.map(|t| t.places), Ok([0.0, 1.0, 2.0]));
        let unequal = triple(&RAIL, [2.5, 1.0, 0.0], 1.0);
        assert_eq!(unequal.map(|t| t.places), Ok([0.0, -1.5, -2.5]));
    }

    #[test]
    fn a_camera_that_stands_still_or_turns_back_makes_no_triple() {
        let why = |places| triple(&RAIL, places, 1.0).err();
        assert_eq!(why([3.0, 3.0, 3.0]), Some(NoTriple::Still));
        assert_eq!(why([3.1, 3.0, 3.05]), Some(NoTriple::Still));
        assert_eq!(why([0.0, 1.0, 0.0]), Some(NoTriple::TurnedBack));
        assert_eq!(why([1.0, 0.0, 0.0]), Some(NoTriple::Unequal));
        assert_eq!(why([4.0, 1.0, 0.0]), Some(NoTriple::TooFar));
        assert_eq!(why([5.0, 1.0, 0.0]), Some(NoTriple::Unequal));
    }
}
