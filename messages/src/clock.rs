//! When a source's next scan is due.

use std::time::{Duration, Instant};

/// Nanoseconds between scans that are no wait any more but another time.
const LONGEST_WAIT: i128 = 3600 * 1_000_000_000;

/// Maps a source's time to now: at a rate, with pauses, or in lockstep, when everything is due at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    rate: Option<f64>,
    paused: bool,
    /// Scans to let through although it is paused.
    steps: u32,
    /// A moment of both times.
    anchor: (Instant, u64),
}

impl Clock {
    /// A clock that shows `nanos` of the source's time now.
    pub fn new(rate: Option<f64>, paused: bool, now: Instant, nanos: u64) -> Self {
        Self {
            rate,
            paused,
            steps: 0,
            anchor: (now, nanos),
        }
    }

    /// When a scan of this time is due; `None` while it is paused.
    pub fn due(&self, nanos: u64) -> Option<Instant> {
        let (instant, anchor) = self.anchor;
        match self.rate {
            _ if self.steps > 0 => Some(instant),
            _ if self.paused => None,
            None => Some(instant),
            Some(rate) => {
                let ahead = nanos.saturating_sub(anchor) as f64 / 1e9 / rate;
                Some(instant + Duration::from_secs_f64(ahead))
            }
        }
    }

    /// A scan of this time went out, and one of that time is next.
    pub fn played(&mut self, now: Instant, nanos: u64, next_nanos: u64) {
        if self.steps > 0 {
            self.steps -= 1;
            self.anchor = (now, nanos);
        }
        self.passed(now, nanos, next_nanos);
    }

    /// A scan of this time went out or was left out, and one of that time is next. Where time goes back or far ahead between
    /// them, as where a clock was set or a recording begins again, the next one is due at once.
    pub fn passed(&mut self, now: Instant, nanos: u64, next_nanos: u64) {
        if jumps(nanos, next_nanos) {
            self.anchor = (now, next_nanos);
        }
    }

    /// Pauses, or goes on with the scan of this time.
    pub fn pause(&mut self, now: Instant, next_nanos: u64) {
        self.paused = !self.paused;
        self.anchor = (now, next_nanos);
    }

    /// Lets one scan through, and pauses.
    pub fn step(&mut self) {
        self.paused = true;
        self.steps += 1;
    }

    /// Changes the rate by a factor; from lockstep to the source's own.
    pub fn speed(&mut self, factor: f64, now: Instant, next_nanos: u64) {
        let rate = self.rate.map_or(1.0, |rate| rate * factor);
        self.set_rate(rate, now, next_nanos);
    }

    /// Changes the rate, which lies between a thousandth and a thousand.
    pub fn set_rate(&mut self, rate: f64, now: Instant, next_nanos: u64) {
        self.rate = Some(rate.clamp(0.001, 1000.0));
        self.anchor = (now, next_nanos);
    }

    /// Goes on with a scan of this time, now.
    pub fn jump(&mut self, now: Instant, next_nanos: u64) {
        self.anchor = (now, next_nanos);
    }

    /// The rate, or `None` in lockstep.
    pub fn rate(&self) -> Option<f64> {
        self.rate
    }

    /// Whether it is paused.
    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// Whether it is paused and lets no scan through.
    pub fn stands(&self) -> bool {
        self.paused && self.steps == 0
    }
}

/// Whether the time from a scan to the next is none that anybody waited.
pub fn jumps(nanos: u64, next_nanos: u64) -> bool {
    !(0..=LONGEST_WAIT).contains(&(next_nanos as i128 - nanos as i128))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    #[test]
    fn where_time_jumps_the_next_scan_is_due_at_once_and_the_rate_holds_after_it() {
        let begun = Instant::now();
        for next in [5 * SECOND, 100_000 * SECOND] {
            let mut clock = Clock::new(Some(1.0), false, begun, 10 * SECOND);
            let now = begun + Duration::from_secs(90);
            clock.played(now, 100 * SECOND, next);
            assert_eq!(clock.due(next), Some(now));
            assert_eq!(clock.due(next + SECOND), Some(now + Duration::from_secs(1)));
        }
        // Half an hour somebody may have waited.
        let mut clock = Clock::new(Some(1.0), false, begun, 0);
        clock.played(begun, 0, 1800 * SECOND);
        assert_eq!(
            clock.due(1800 * SECOND),
            Some(begun + Duration::from_secs(1800))
        );
    }

    #[test]
    fn at_twice_the_rate_a_scan_is_due_in_half_the_time() {
        let now = Instant::now();
        let clock = Clock::new(Some(2.0), false, now, 5 * SECOND);
        assert_eq!(clock.due(15 * SECOND), Some(now + Duration::from_secs(5)));
        assert_eq!(clock.due(SECOND), Some(now), "what is late is due at once");
        assert_eq!(Clock::new(None, false, now, 0).due(99 * SECOND), Some(now));
    }

    #[test]
    fn a_pause_shifts_what_is_due_and_a_step_lets_one_scan_through() {
        let now = Instant::now();
        let mut clock = Clock::new(Some(1.0), false, now, 0);
        clock.pause(now, SECOND);
        assert_eq!(clock.due(SECOND), None);
        clock.step();
        assert!(clock.due(SECOND).is_some());
        clock.played(now, SECOND, 2 * SECOND);
        assert_eq!(clock.due(2 * SECOND), None);
        let later = now + Duration::from_secs(60);
        clock.pause(later, 2 * SECOND);
        assert_eq!(clock.due(3 * SECOND), Some(later + Duration::from_secs(1)));
    }

    #[test]
    fn a_change_of_rate_counts_from_where_it_is() {
        let now = Instant::now();
        let mut clock = Clock::new(None, false, now, 0);
        clock.speed(2.0, now, 0);
        assert_eq!(clock.rate(), Some(1.0));
        clock.speed(0.5, now, 4 * SECOND);
        assert_eq!(clock.due(5 * SECOND), Some(now + Duration::from_secs(2)));
    }
}
