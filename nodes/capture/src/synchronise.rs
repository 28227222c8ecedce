//! Which frames of several free-running cameras belong together: those nearest to each other in time.
//!
//! ```text
//! frames of each camera, in its order ─► Synchroniser ─► one frame of every camera, or why not
//!                                             └────────► the account: nothing is lost silently
//! ```
//!
//! One camera is the reference. A frame of it and one of another camera are *partners* when each is the nearest to the
//! other among all frames of the other's camera; of two equally near the earlier one counts. A reference frame becomes a
//! scan when it has a partner in every other camera and none is farther than the tolerance. So what becomes a scan depends
//! on the frames' times alone, and not on the order in which the cameras are heard; that is known once every camera has
//! sent a later frame, about one interval after the scan was taken.
//!
//! There is no clock here and nothing waits: a camera that sends nothing more makes the others' frames wait until there
//! is no room, and then the oldest one goes.

use std::collections::{BTreeMap, VecDeque};

use hdrhistogram::Histogram;
use messages::synchronisation::{CameraAccount, OFFSET_BOUNDS_MS, Synchronisation};

/// One frame of every camera, in their order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scan<F> {
    /// When the reference camera's frame was taken, in nanoseconds.
    pub nanos: u64,
    /// The frames.
    pub frames: Vec<F>,
}

/// Why a frame became part of no scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// Nothing of this camera is near enough in time.
    Alone(usize),
    /// What is nearest of this camera is nearer to another frame.
    Taken(usize),
    /// It has partners, but this camera has none to complete the scan.
    Incomplete(usize),
    /// There was no more room to wait for this camera.
    Silent(usize),
    /// The scan was complete, but nobody took it in time.
    NotTaken,
    /// This camera has come to its end.
    Ended(usize),
    /// Its own camera's clock went back.
    ClockWentBack,
    /// It is not of the size that the camera's frames had at the start.
    Size,
    /// It cannot be read.
    Damaged,
    /// It came faster than frames are taken in.
    Overrun,
    /// The run came to its end first.
    Over,
}

impl Cause {
    pub(crate) fn in_words(self, names: &[String]) -> String {
        match self {
            Self::Alone(camera) => format!("{} had none within the tolerance", names[camera]),
            Self::Taken(camera) => format!("{} had one nearer to it", names[camera]),
            Self::Incomplete(camera) => format!("{} did not complete the scan", names[camera]),
            Self::Silent(camera) => format!("{} was silent", names[camera]),
            Self::NotTaken => "the scan was not taken in time".to_owned(),
            Self::Ended(camera) => format!("{} had ended", names[camera]),
            Self::ClockWentBack => "its clock went back".to_owned(),
            Self::Size => "it had another size than at the start".to_owned(),
            Self::Damaged => "it cannot be read".to_owned(),
            Self::Overrun => "frames came faster than they are taken in".to_owned(),
            Self::Over => "the run ended".to_owned(),
        }
    }
}

/// A camera silent for this long, in nanoseconds, while others go on is named when no scans come.
const SILENCE: u64 = 1_000_000_000;
/// How many of the latest offsets the median is of.
const LATEST: usize = 63;
/// The longest tolerance that is told apart, in microseconds.
const HOUR: u64 = 3_600_000_000;

struct Waiting<F> {
    nanos: u64,
    frame: F,
}

struct Camera<F> {
    waiting: VecDeque<Waiting<F>>,
    /// When its last frame was taken, whatever became of it.
    last: Option<u64>,
    /// When the last frame that waits no more was taken: all before the waiting ones.
    gone: Option<u64>,
    has_ended: bool,
    received: u64,
    matched: u64,
    late: u64,
    late_in_a_row: usize,
    dropped: BTreeMap<Cause, u64>,
    offsets: [u64; OFFSET_BOUNDS_MS.len() + 1],
    /// Offsets of the latest frames, in nanoseconds.
    latest: VecDeque<i64>,
}

impl<F> Camera<F> {
    fn new() -> Self {
        Self {
            waiting: VecDeque::new(),
            last: None,
            gone: None,
            has_ended: false,
            received: 0,
            matched: 0,
            late: 0,
            late_in_a_row: 0,
            dropped: BTreeMap::new(),
            offsets: [0; OFFSET_BOUNDS_MS.len() + 1],
            latest: VecDeque::new(),
        }
    }

    /// Whether no frame before or at this time will come any more.
    fn is_past(&self, nanos: u64) -> bool {
        self.has_ended || self.last.is_some_and(|last| last >= nanos)
    }

    fn count(&mut self, cause: Cause) {
        *self.dropped.entry(cause).or_default() += 1;
    }

    fn pop(&mut self) -> Option<Waiting<F>> {
        let first = self.waiting.pop_front();
        self.gone = first.as_ref().map(|first| first.nanos).or(self.gone);
        first
    }

    fn drop_first(&mut self, cause: Cause) {
        if self.pop().is_some() {
            self.count(cause);
        }
    }

    fn note(&mut self, offset: i64) {
        let milliseconds = offset as f64 / 1e6;
        let place = OFFSET_BOUNDS_MS.partition_point(|&bound| bound <= milliseconds);
        self.offsets[place] += 1;
        if self.latest.len() == LATEST {
            self.latest.pop_front();
        }
        self.latest.push_back(offset);
    }

    fn median(&self) -> Option<i64> {
        let mut latest: Vec<i64> = self.latest.iter().copied().collect();
        latest.sort_unstable();
        latest.get(latest.len() / 2).copied()
    }
}

/// What one camera has for a reference frame.
enum Partner {
    /// It cannot be known yet: the camera with this index has to send more.
    Unknown(usize),
    /// The waiting frame at this place.
    At(usize, i64),
    /// Nothing of its own: what is nearest, if anything, is so far away.
    None(Option<i64>),
}

/// Puts frames of several cameras together.
pub struct Synchroniser<F> {
    cameras: Vec<Camera<F>>,
    reference: usize,
    /// Nanoseconds.
    tolerance: u64,
    capacity: usize,
    scans: u64,
    /// Microseconds by which the farthest partner of each reference frame was off.
    needed: Histogram<u64>,
}

impl<F> std::fmt::Debug for Synchroniser<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Synchroniser")
            .field("cameras", &self.cameras.len())
            .field("scans", &self.scans)
            .finish_non_exhaustive()
    }
}

impl<F> Synchroniser<F> {
    /// For so many cameras, of which the middle one is the reference: partners are at most `tolerance` nanoseconds from
    /// its frame, and of each camera at most `capacity` frames wait.
    ///
    /// # Panics
    /// Without a camera, or with room for fewer than two frames.
    pub fn new(cameras: usize, tolerance: u64, capacity: usize) -> Self {
        assert!(
            cameras > 0 && capacity > 1,
            "one camera and two frames at least"
        );
        #[expect(clippy::expect_used, reason = "these bounds are valid")]
        let needed = Histogram::new_with_bounds(1, HOUR, 3).expect("valid bounds");
        Self {
            cameras: (0..cameras).map(|_| Camera::new()).collect(),
            reference: cameras / 2,
            tolerance,
            capacity,
            scans: 0,
            needed,
        }
    }

    /// The camera by whose frames the others' are chosen.
    pub fn reference(&self) -> usize {
        self.reference
    }

    /// Whether a frame of this camera makes no other one go.
    pub fn has_room(&self, camera: usize) -> bool {
        self.cameras[camera].waiting.len() < self.capacity
    }

    /// A camera sends a frame, taken at this time.
    pub fn push(&mut self, camera: usize, nanos: u64, frame: F) {
        let own = &mut self.cameras[camera];
        own.received += 1;
        if own.last.is_some_and(|last| nanos <= last) {
            own.late_in_a_row += 1;
            if own.late_in_a_row <= self.capacity {
                own.late += 1;
                return;
            }
            // One frame may be late; when all are, the clock was set.
            while !own.waiting.is_empty() {
                own.drop_first(Cause::ClockWentBack);
            }
            own.gone = None;
        }
        own.late_in_a_row = 0;
        own.last = Some(nanos);
        if own.waiting.len() == self.capacity {
            let cause = match self.awaited() {
                Some(awaited) if self.cameras[awaited].has_ended => Cause::Ended(awaited),
                Some(awaited) => Cause::Silent(awaited),
                None => Cause::NotTaken,
            };
            self.cameras[camera].drop_first(cause);
        }
        let frame = Waiting { nanos, frame };
        self.cameras[camera].waiting.push_back(frame);
    }

    /// A camera sent a frame that cannot be used.
    pub fn refuse(&mut self, camera: usize, count: u64, cause: Cause) {
        if count > 0 {
            let own = &mut self.cameras[camera];
            own.received += count;
            *own.dropped.entry(cause).or_default() += count;
        }
    }

    /// A camera sends nothing more.
    pub fn end(&mut self, camera: usize) {
        self.cameras[camera].has_ended = true;
    }

    /// Whether no further scan can come, once [`next_scan`](Self::next_scan) gives none.
    pub fn has_ended(&self) -> bool {
        self.cameras
            .iter()
            .any(|camera| camera.has_ended && camera.waiting.is_empty())
    }

    /// Nothing waits any longer: the run is over.
    pub fn finish(&mut self) {
        let ended = self.cameras.iter().position(|camera| camera.has_ended);
        let cause = ended.map_or(Cause::Over, Cause::Ended);
        for (index, camera) in self.cameras.iter_mut().enumerate() {
            let cause = if ended == Some(index) {
                Cause::Over
            } else {
                cause
            };
            while !camera.waiting.is_empty() {
                camera.drop_first(cause);
            }
        }
    }

    /// The scan that was given last did not go in, because the run ended.
    pub fn take_back(&mut self) {
        self.scans -= 1;
        for camera in &mut self.cameras {
            camera.matched -= 1;
            camera.count(Cause::Over);
        }
    }

    /// The next scan that is complete beyond doubt.
    pub fn next_scan(&mut self) -> Option<Scan<F>> {
        loop {
            self.settle();
            let nanos = self.cameras[self.reference].waiting.front()?.nanos;
            let partners: Vec<Partner> = (0..self.cameras.len())
                .map(|camera| self.partner(camera, nanos))
                .collect();
            if partners.iter().any(|p| matches!(p, Partner::Unknown(_))) {
                return None;
            }
            if let Some(scan) = self.decide(nanos, &partners) {
                return Some(scan);
            }
        }
    }

    /// Lets the first reference frame become a scan, or go.
    fn decide(&mut self, nanos: u64, partners: &[Partner]) -> Option<Scan<F>> {
        let (mut farthest, mut are_all_there, mut missing) = (0, true, None);
        for (camera, partner) in partners.iter().enumerate() {
            let (offset, is_own) = match partner {
                Partner::At(_, offset) => (Some(*offset), true),
                Partner::None(offset) => (*offset, false),
                Partner::Unknown(_) => (None, false),
            };
            if let Some(offset) = offset.filter(|_| camera != self.reference) {
                self.cameras[camera].note(offset);
            }
            are_all_there &= is_own;
            let distance = offset.map_or(u64::MAX, i64::unsigned_abs);
            farthest = farthest.max(distance);
            let is_near = distance <= self.tolerance;
            if !(is_own && is_near) && missing.is_none() {
                missing = Some(match (is_near, self.cameras[camera].has_ended) {
                    (true, _) => Cause::Taken(camera),
                    (false, true) if self.cameras[camera].waiting.is_empty() => {
                        Cause::Ended(camera)
                    }
                    (false, _) => Cause::Alone(camera),
                });
            }
        }
        if are_all_there {
            self.needed.saturating_record(farthest.div_ceil(1000));
        }
        let Some(cause) = missing else {
            let mut frames = Vec::with_capacity(partners.len());
            for (camera, partner) in self.cameras.iter_mut().zip(partners) {
                let Partner::At(place, _) = partner else {
                    continue;
                };
                // Those before it are nearer to no later frame of the reference camera.
                for _ in 0..*place {
                    camera.drop_first(Cause::Taken(self.reference));
                }
                if let Some(taken) = camera.pop() {
                    camera.matched += 1;
                    frames.push(taken.frame);
                }
            }
            self.scans += 1;
            return Some(Scan { nanos, frames });
        };
        let lacking = match cause {
            Cause::Taken(camera) | Cause::Ended(camera) | Cause::Alone(camera) => camera,
            _ => self.reference,
        };
        self.cameras[self.reference].drop_first(cause);
        for (index, partner) in partners.iter().enumerate() {
            // Whoever is nearest to this frame is nearest to no later one.
            if let Partner::At(place, offset) = partner
                && index != self.reference
            {
                let is_near = offset.unsigned_abs() <= self.tolerance;
                let cause = match is_near {
                    true => Cause::Incomplete(lacking),
                    false => Cause::Alone(self.reference),
                };
                for _ in 0..*place {
                    self.cameras[index].drop_first(Cause::Taken(self.reference));
                }
                self.cameras[index].drop_first(cause);
            }
        }
        None
    }

    /// Lets frames go that no frame of the reference camera will want any more.
    fn settle(&mut self) {
        let reference = &self.cameras[self.reference];
        let (first, gone) = (reference.waiting.front().map(|f| f.nanos), reference.gone);
        let is_over = reference.has_ended && first.is_none();
        for index in 0..self.cameras.len() {
            let tolerance = self.tolerance;
            let camera = &mut self.cameras[index];
            while index != self.reference
                && let Some(own) = camera.waiting.front().map(|f| f.nanos)
            {
                let second = camera.waiting.get(1).map(|f| f.nanos);
                // The next reference frame has another one that is nearer, and so has every later one; or there is none.
                let is_passed = first.is_some_and(|first| {
                    second.is_some_and(|second| {
                        second.abs_diff(first) < own.abs_diff(first) && own < first
                    })
                });
                if !is_passed && !is_over {
                    break;
                }
                let nearest = [first, gone].into_iter().flatten();
                let nearest = nearest.map(|reference| reference.abs_diff(own)).min();
                let cause = match nearest {
                    Some(distance) if distance <= tolerance => Cause::Taken(self.reference),
                    _ if is_over => Cause::Ended(self.reference),
                    _ => Cause::Alone(self.reference),
                };
                camera.drop_first(cause);
            }
        }
    }

    /// What a camera has for the first waiting frame of the reference camera.
    fn partner(&self, index: usize, nanos: u64) -> Partner {
        if index == self.reference {
            return Partner::At(0, 0);
        }
        let camera = &self.cameras[index];
        if !camera.is_past(nanos) {
            return Partner::Unknown(index);
        }
        // The nearest, the earlier one of two.
        let after = camera.waiting.partition_point(|f| f.nanos <= nanos);
        let before = after
            .checked_sub(1)
            .map(|place| (Some(place), camera.waiting[place].nanos));
        let before = before.or(camera.gone.filter(|_| after == 0).map(|gone| (None, gone)));
        let next = camera.waiting.get(after).map(|f| (Some(after), f.nanos));
        let nearest = [before, next].into_iter().flatten();
        let Some((place, own)) = nearest.min_by_key(|(_, own)| own.abs_diff(nanos)) else {
            return Partner::None(None);
        };
        let offset = own as i64 - nanos as i64;
        let Some(place) = place else {
            // It is another's already.
            return Partner::None(Some(offset));
        };
        let distance = own.abs_diff(nanos);
        let reference = &self.cameras[self.reference];
        let rival = match own <= nanos {
            true => reference.gone.map(|gone| own.abs_diff(gone) <= distance),
            false => match reference.waiting.get(1) {
                Some(next) => Some(next.nanos.abs_diff(own) < distance),
                None if reference.has_ended => None,
                None => return Partner::Unknown(self.reference),
            },
        };
        match rival {
            Some(true) => Partner::None(Some(offset)),
            _ => Partner::At(place, offset),
        }
    }

    /// The camera that has to send more before the next scan is known.
    fn awaited(&self) -> Option<usize> {
        let Some(first) = self.cameras[self.reference].waiting.front() else {
            return Some(self.reference);
        };
        let partners = (0..self.cameras.len()).map(|camera| self.partner(camera, first.nanos));
        let mut unknown = partners.filter_map(|partner| match partner {
            Partner::Unknown(camera) => Some(camera),
            Partner::At(..) | Partner::None(_) => None,
        });
        unknown.next()
    }

    /// Why no scans come, in a sentence: a camera that is silent, offsets beyond the tolerance, a clock that is off.
    pub fn why(&self, names: &[String]) -> String {
        let newest = self.cameras.iter().filter_map(|camera| camera.last).max();
        let Some(newest) = newest else {
            return "no camera has sent anything yet".to_owned();
        };
        let milliseconds = |nanos: u64| nanos as f64 / 1e6;
        let tolerance = milliseconds(self.tolerance);
        let reference = &names[self.reference];
        for (camera, name) in self.cameras.iter().zip(names) {
            let Some(last) = camera.last else {
                return match camera.received {
                    0 => format!("{name} has sent nothing yet"),
                    received => format!("none of the {received} frames of {name} can be used"),
                };
            };
            let behind = newest - last;
            if camera.has_ended {
                return format!("{name} has come to its end");
            }
            if camera.late_in_a_row > 0 {
                return format!(
                    "{name} sends frames that are older than those before them: its clock went back"
                );
            }
            if behind > SILENCE {
                let seconds = behind as f64 / 1e9;
                return format!(
                    "{name} is silent, or its clock is behind: its last frame is {seconds:.1} s older than the others'"
                );
            }
        }
        let farthest = self
            .cameras
            .iter()
            .zip(names)
            .filter_map(|(camera, name)| Some((camera.median()?, name)))
            .max_by_key(|(median, _)| median.unsigned_abs());
        match farthest {
            Some((median, name)) if median.unsigned_abs() > self.tolerance => {
                let (by, how) = (milliseconds(median.unsigned_abs()), side(median));
                format!(
                    "{name}'s frames come {by:.1} ms {how} {reference}'s, and the tolerance is {tolerance} ms: trigger the cameras together, or set capture.tolerance"
                )
            }
            Some(_) => "too many frames are lost on the way: see what was dropped".to_owned(),
            None => "the frames of all cameras are still awaited".to_owned(),
        }
    }

    /// What came of every frame so far; the cameras are called by these names.
    pub fn account(&self, names: &[String]) -> Synchronisation {
        let account = |(camera, name): (&Camera<F>, &String)| CameraAccount {
            name: name.clone(),
            received: camera.received,
            matched: camera.matched,
            late: camera.late,
            dropped: camera
                .dropped
                .iter()
                .map(|(cause, count)| (cause.in_words(names), *count))
                .collect(),
            waiting: camera.waiting.len() as u64,
            offsets: camera.offsets.to_vec(),
            median_ms: camera.median().map(|median| median as f64 / 1e6),
            ..CameraAccount::default()
        };
        let needed = self.needed.value_at_quantile(0.99) as f64 / 1000.0;
        Synchronisation {
            scans: self.scans,
            tolerance_ms: self.tolerance as f64 / 1e6,
            tolerance_for_99_ms: (!self.needed.is_empty() && self.cameras.len() > 1)
                .then_some(needed),
            bounds_ms: OFFSET_BOUNDS_MS.to_vec(),
            reference: names[self.reference].clone(),
            cameras: self.cameras.iter().zip(names).map(account).collect(),
            why: None,
        }
    }
}

fn side(offset: i64) -> &'static str {
    if offset < 0 { "before" } else { "after" }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    const MILLISECOND: u64 = 1_000_000;

    fn names(count: usize) -> Vec<String> {
        match count {
            3 => ["left", "centre", "right"].map(str::to_owned).to_vec(),
            _ => (0..count).map(|camera| camera.to_string()).collect(),
        }
    }

    /// A seeded generator: the same numbers in every run.
    struct Random(u64);

    impl Random {
        fn below(&mut self, end: u64) -> u64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) % end
        }
    }

    /// The slow obvious twin: looks at every frame for every frame, after all have come.
    fn twin(frames: &[Vec<u64>], tolerance: u64) -> Vec<Vec<u64>> {
        let nearest = |times: &[u64], to: u64| {
            let mut best: Option<u64> = None;
            for &time in times {
                if best.is_none_or(|best| time.abs_diff(to) < best.abs_diff(to)) {
                    best = Some(time);
                }
            }
            best
        };
        let reference = &frames[frames.len() / 2];
        let mut scans = Vec::new();
        for &time in reference {
            let mut scan = Vec::new();
            for camera in frames {
                let partner = nearest(camera, time)
                    .filter(|&own| nearest(reference, own) == Some(time))
                    .filter(|own| own.abs_diff(time) <= tolerance);
                scan.extend(partner);
            }
            if scan.len() == frames.len() {
                scans.push(scan);
            }
        }
        scans
    }

    /// What the cameras of a made-up rig send, in the order it arrives: (camera, nanoseconds).
    fn arrivals(random: &mut Random, cameras: usize, count: u64) -> Vec<(usize, u64)> {
        let interval = 33 * MILLISECOND;
        let mut all = Vec::new();
        for camera in 0..cameras {
            let phase = random.below(interval);
            let own = interval + random.below(3) * MILLISECOND - MILLISECOND;
            let jitter = 1 + random.below(20) * MILLISECOND;
            let drop_outs = random.below(20);
            for n in 0..count {
                let time = 1_000 * MILLISECOND + phase + n * own + random.below(jitter);
                let is_lost = random.below(100) < drop_outs;
                // Some frames are long on their way.
                let arrival = time + random.below(8) * random.below(10) * MILLISECOND;
                if !is_lost {
                    all.push((arrival, camera, time));
                }
            }
        }
        all.sort_unstable();
        all.into_iter()
            .map(|(_, camera, time)| (camera, time))
            .collect()
    }

    fn assert_balanced(synchroniser: &Synchroniser<u64>, count: usize) -> Synchronisation {
        let account = synchroniser.account(&names(count));
        for camera in &account.cameras {
            assert!(camera.is_balanced(), "{camera:?}");
            assert_eq!(camera.matched, account.scans, "{camera:?}");
        }
        account
    }

    #[test]
    fn scans_are_those_of_the_slow_twin_whatever_the_jitter_and_the_drop_outs() {
        let mut random = Random(7);
        let (mut scans, mut late, mut received) = (0, 0, 0);
        for round in 0..300 {
            let cameras = 1 + round % 4;
            let tolerance = random.below(20) * MILLISECOND;
            let arrivals = arrivals(&mut random, cameras, 60);
            let mut synchroniser = Synchroniser::new(cameras, tolerance, 1000);
            let (mut accepted, mut made) = (vec![Vec::new(); cameras], Vec::new());
            for &(camera, time) in &arrivals {
                synchroniser.push(camera, time, time);
                if accepted[camera].last().is_none_or(|&last| time > last) {
                    accepted[camera].push(time);
                }
                while let Some(scan) = synchroniser.next_scan() {
                    assert_eq!(scan.nanos, scan.frames[cameras / 2]);
                    made.push(scan.frames);
                }
                assert_balanced(&synchroniser, cameras);
            }
            (0..cameras).for_each(|camera| synchroniser.end(camera));
            while let Some(scan) = synchroniser.next_scan() {
                made.push(scan.frames);
            }
            assert_eq!(made, twin(&accepted, tolerance), "round {round}");
            synchroniser.finish();
            let account = assert_balanced(&synchroniser, cameras);
            for (index, camera) in account.cameras.iter().enumerate() {
                let sent = arrivals.iter().filter(|(of, _)| *of == index).count() as u64;
                assert_eq!((camera.received, camera.waiting), (sent, 0));
                assert_eq!(camera.received - camera.late, accepted[index].len() as u64);
                late += camera.late;
            }
            scans += account.scans;
            received += arrivals.len();
        }
        assert!(
            scans > 2_000 && late > 100,
            "{scans} scans, {late} late of {received}"
        );
    }

    #[test]
    fn scans_do_not_depend_on_which_camera_is_heard_first() {
        let mut random = Random(3);
        for _ in 0..50 {
            let mut in_time = arrivals(&mut random, 3, 40);
            in_time.sort_by_key(|(_, time)| *time);
            let run = |order: &[(usize, u64)]| {
                let mut synchroniser = Synchroniser::new(3, 10 * MILLISECOND, 1000);
                order
                    .iter()
                    .for_each(|&(camera, time)| synchroniser.push(camera, time, time));
                (0..3).for_each(|camera| synchroniser.end(camera));
                std::iter::from_fn(|| synchroniser.next_scan()).collect::<Vec<_>>()
            };
            let together = run(&in_time);
            in_time.sort_by_key(|(camera, _)| *camera);
            assert_eq!(run(&in_time), together);
        }
    }

    #[test]
    fn the_tolerance_for_99_of_100_is_one_by_which_they_match() {
        let mut random = Random(11);
        let frames: Vec<(usize, u64)> = (0..400u64)
            .flat_map(|n| [(0, n), (1, n), (2, n)])
            .map(|(camera, n)| {
                (
                    camera,
                    (n + 1) * 33 * MILLISECOND + random.below(6 * MILLISECOND),
                )
            })
            .collect();
        let run = |tolerance| {
            let mut synchroniser = Synchroniser::new(3, tolerance, 1000);
            for &(camera, time) in &frames {
                synchroniser.push(camera, time, time);
            }
            (0..3).for_each(|camera| synchroniser.end(camera));
            while synchroniser.next_scan().is_some() {}
            synchroniser.account(&names(3))
        };
        let needed = run(MILLISECOND).tolerance_for_99_ms.unwrap();
        assert!((3.0..6.0).contains(&needed), "{needed}");
        let microseconds = |ms: f64| (ms * 1e3) as u64 * 1000;
        // To the three digits of the histogram.
        assert!(run(microseconds(needed * 1.002)).scans >= 396);
        assert!(run(microseconds(needed * 0.9)).scans < 396);
    }

    #[test]
    fn a_camera_that_falls_silent_is_named_and_memory_stays_bounded() {
        let mut synchroniser = Synchroniser::new(3, 5 * MILLISECOND, 8);
        for n in 0..100u64 {
            let time = (n + 1) * 33 * MILLISECOND;
            for camera in 0..if n < 10 { 3 } else { 2 } {
                synchroniser.push(camera, time, time);
            }
            while synchroniser.next_scan().is_some() {}
            let account = assert_balanced(&synchroniser, 3);
            assert!(account.cameras.iter().all(|camera| camera.waiting <= 8));
        }
        let account = synchroniser.account(&names(3));
        assert_eq!(account.scans, 10);
        assert_eq!(account.cameras[0].dropped["right was silent"], 82);
        assert_eq!(account.cameras[1].dropped["right was silent"], 82);
        let why = synchroniser.why(&names(3));
        assert!(
            why.starts_with("right is silent, or its clock is behind: its last frame is 3.0 s"),
            "{why}"
        );
        // It returns, and scans form again.
        for n in 100..105u64 {
            let time = (n + 1) * 33 * MILLISECOND;
            (0..3).for_each(|camera| synchroniser.push(camera, time, time));
        }
        let again = std::iter::from_fn(|| synchroniser.next_scan()).count();
        assert_eq!(again, 5);
        assert_balanced(&synchroniser, 3);
    }

    #[test]
    fn an_offset_beyond_the_tolerance_is_explained() {
        let mut synchroniser = Synchroniser::new(3, 5 * MILLISECOND, 16);
        for n in 1..40u64 {
            for (camera, offset) in [(0, 0), (1, 0), (2, 12)] {
                let time = (33 * n + offset) * MILLISECOND;
                synchroniser.push(camera, time, time);
            }
            assert_eq!(synchroniser.next_scan(), None);
        }
        let account = assert_balanced(&synchroniser, 3);
        assert_eq!(account.scans, 0);
        assert_eq!(account.tolerance_for_99_ms.map(f64::round), Some(12.0));
        assert!(account.cameras[1].dropped["right had none within the tolerance"] > 30);
        assert!(account.cameras[0].dropped["right did not complete the scan"] > 30);
        // 12 ms lies between 10 and 20.
        let at = account
            .bounds_ms
            .iter()
            .position(|&bound| bound == 20.0)
            .unwrap();
        assert!(account.cameras[2].offsets[at] > 30, "{account:?}");
        assert_eq!(
            synchroniser.why(&names(3)),
            "right's frames come 12.0 ms after centre's, and the tolerance is 5 ms: trigger the cameras together, or set \
             capture.tolerance"
        );
    }

    #[test]
    fn a_clock_that_was_set_back_stops_a_camera_only_for_a_while() {
        let mut synchroniser = Synchroniser::new(1, 0, 4);
        for time in [1_000, 2_000, 3_000, 10, 20, 30, 40, 50, 60] {
            synchroniser.push(0, time, time);
            while synchroniser.next_scan().is_some() {}
        }
        let account = assert_balanced(&synchroniser, 1);
        assert_eq!((account.scans, account.cameras[0].late), (5, 4));
    }

    #[test]
    fn one_camera_alone_makes_every_frame_a_scan_at_once() {
        let mut synchroniser = Synchroniser::new(1, 0, 2);
        for time in 1..=5u64 {
            synchroniser.push(0, time, time);
            assert_eq!(synchroniser.next_scan().map(|scan| scan.nanos), Some(time));
        }
        assert!(!synchroniser.has_ended());
        synchroniser.end(0);
        assert!(synchroniser.has_ended());
    }

    #[test]
    fn what_waits_when_the_run_ends_is_accounted_for() {
        let mut synchroniser = Synchroniser::new(3, MILLISECOND, 8);
        for camera in [0, 1] {
            synchroniser.push(camera, 5, 5);
        }
        synchroniser.refuse(2, 3, Cause::Size);
        synchroniser.finish();
        let account = assert_balanced(&synchroniser, 3);
        assert_eq!(account.cameras[0].dropped["the run ended"], 1);
        assert_eq!(account.cameras[2].received, 3);

        let mut synchroniser = Synchroniser::new(3, MILLISECOND, 8);
        for time in [5, 5_000_000] {
            (0..3).for_each(|camera| synchroniser.push(camera, time, time));
        }
        assert!(synchroniser.next_scan().is_some());
        synchroniser.take_back();
        synchroniser.finish();
        let account = assert_balanced(&synchroniser, 3);
        assert_eq!(account.scans, 0);
        assert!(
            account
                .cameras
                .iter()
                .all(|camera| camera.dropped["the run ended"] == 2)
        );
    }
}
