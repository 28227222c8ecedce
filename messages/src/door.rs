//! The door: the only place where the flow of scans is held back.

use std::collections::{BTreeMap, VecDeque};

/// A scan under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnderWay {
    /// Its number.
    pub sequence: u64,
    /// Which scan of the source it is; more than its number when scans were refused.
    pub tick: u64,
}

/// Lets a scan in while fewer than `width` are under way, and knows which are done.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Door {
    width: usize,
    /// How many scans before a scan its results depend on.
    reach: u64,
    under_way: VecDeque<UnderWay>,
    /// Scans that are done, and that others under way or to come depend on.
    past: VecDeque<UnderWay>,
    admitted: u64,
    done: u64,
    next_tick: u64,
    refused: BTreeMap<String, u64>,
}

impl Door {
    /// A door through which nobody has gone.
    pub fn new(width: usize) -> Self {
        Self {
            width,
            ..Self::default()
        }
    }

    /// The same where a scan's results depend on so many scans before it.
    pub fn reaching(self, reach: u64) -> Self {
        Self { reach, ..self }
    }

    /// A door as an earlier capture process left it.
    pub fn resume(
        width: usize,
        past: impl IntoIterator<Item = UnderWay>,
        under_way: impl IntoIterator<Item = UnderWay>,
        admitted: u64,
        next_tick: u64,
        refused: BTreeMap<String, u64>,
    ) -> Self {
        let under_way: VecDeque<UnderWay> = under_way.into_iter().collect();
        let done = admitted - (under_way.len() as u64).min(admitted);
        Self {
            width,
            reach: 0,
            under_way,
            past: past.into_iter().collect(),
            admitted,
            done,
            next_tick,
            refused,
        }
    }

    /// Whether a scan may go in.
    pub fn is_open(&self) -> bool {
        self.under_way.len() < self.width
    }

    /// Whether no scan is under way.
    pub fn is_idle(&self) -> bool {
        self.under_way.is_empty()
    }

    /// Lets the source's next scan in and numbers it.
    pub fn admit(&mut self) -> UnderWay {
        let scan = UnderWay {
            sequence: self.admitted,
            tick: self.next_tick,
        };
        self.under_way.push_back(scan);
        self.admitted += 1;
        self.next_tick += 1;
        scan
    }

    /// Turns so many of the source's next scans away, whole.
    pub fn refuse(&mut self, cause: &str, count: u64) {
        if count > 0 {
            *self.refused.entry(cause.to_owned()).or_default() += count;
            self.next_tick += count;
        }
    }

    /// Goes on with another scan of the source.
    pub fn seek(&mut self, tick: u64) {
        self.next_tick = tick;
    }

    /// A scan came out; false when it had come out before.
    pub fn done(&mut self, sequence: u64) -> bool {
        let place = self
            .under_way
            .iter()
            .position(|scan| scan.sequence == sequence);
        let Some(scan) = place.and_then(|place| self.under_way.remove(place)) else {
            return false;
        };
        self.done += 1;
        if self.reach > 0 {
            let later = self.past.partition_point(|past| past.sequence < sequence);
            self.past.insert(later, scan);
            let needed = self.needed_from();
            self.past.retain(|past| past.sequence >= needed);
        }
        true
    }

    /// Scans that are done and that others depend on, in order.
    pub fn past(&self) -> impl Iterator<Item = UnderWay> + '_ {
        self.past.iter().copied()
    }

    /// All scans that must be sent once more when somebody lost what was sent: those under way, and those before that
    /// they depend on, in order.
    pub fn to_resend(&self) -> Vec<UnderWay> {
        let mut scans: Vec<UnderWay> = self.past().chain(self.under_way()).collect();
        scans.sort_unstable_by_key(|scan| scan.sequence);
        scans
    }

    /// No scan below this number is needed any more: it is done, and so are all that depend on it.
    pub fn needed_from(&self) -> u64 {
        self.done_below().saturating_sub(self.reach)
    }

    /// The scans under way, in order.
    pub fn under_way(&self) -> impl Iterator<Item = UnderWay> + '_ {
        self.under_way.iter().copied()
    }

    /// Every scan below this number is done.
    pub fn done_below(&self) -> u64 {
        self.under_way
            .front()
            .map_or(self.admitted, |scan| scan.sequence)
    }

    /// Scans that went in.
    pub fn admitted(&self) -> u64 {
        self.admitted
    }

    /// Scans that came out.
    pub fn done_count(&self) -> u64 {
        self.done
    }

    /// The source's next scan.
    pub fn next_tick(&self) -> u64 {
        self.next_tick
    }

    /// Scans turned away, by cause.
    pub fn refused(&self) -> &BTreeMap<String, u64> {
        &self.refused
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_door_closes_when_as_many_scans_are_under_way_as_it_is_wide() {
        let mut door = Door::new(2);
        door.admit();
        assert!(door.is_open());
        door.admit();
        assert!(!door.is_open());
        assert!(door.done(1));
        assert!(door.is_open());
        assert_eq!(door.done_below(), 0);
        assert!(door.done(0));
        assert_eq!((door.done_below(), door.done_count()), (2, 2));
    }

    #[test]
    fn a_scan_is_done_once() {
        let mut door = Door::new(4);
        door.admit();
        assert!(door.done(0));
        assert!(!door.done(0));
        assert_eq!(door.done_count(), 1);
    }

    #[test]
    fn refused_scans_leave_no_gap_in_the_numbers() {
        let mut door = Door::new(1);
        door.admit();
        door.refuse("the door was closed", 1);
        door.done(0);
        assert_eq!(
            door.admit(),
            UnderWay {
                sequence: 1,
                tick: 2
            }
        );
        assert_eq!(door.refused().values().sum::<u64>(), 1);
    }

    #[test]
    fn what_later_scans_depend_on_is_sent_again_with_them() {
        let mut door = Door::new(4).reaching(2);
        for sequence in 0..6 {
            door.admit();
            door.done(sequence);
        }
        door.admit();
        door.admit();
        door.done(7);
        let sequences = |door: &Door| -> Vec<u64> {
            let scans = door.to_resend().into_iter();
            scans.map(|scan| scan.sequence).collect()
        };
        assert_eq!(sequences(&door), [4, 5, 6, 7]);
        assert_eq!(door.needed_from(), 4);
        door.done(6);
        assert_eq!((sequences(&door), door.needed_from()), (vec![6, 7], 6));
    }

    #[test]
    fn a_resumed_door_goes_on_where_the_last_one_stood() {
        let mut door = Door::new(3);
        for _ in 0..3 {
            door.admit();
        }
        door.done(1);
        let resumed = Door::resume(
            3,
            door.past(),
            door.under_way(),
            door.admitted(),
            door.next_tick(),
            door.refused().clone(),
        );
        assert_eq!(resumed, door);
    }
}
