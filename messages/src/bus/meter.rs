//! How long a node works on a scan.

use std::time::Duration;

use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};

/// Milliseconds a node works on a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// Scans measured.
    pub scans: u64,
    /// Half of the scans took at most this.
    pub p50: f64,
    /// All but one in a hundred took at most this.
    pub p99: f64,
    /// None took more.
    pub max: f64,
}

/// The scans whose messages are being made at the same time; the door keeps fewer in flight.
const OPEN: usize = 64;

/// The longest time told apart, in microseconds.
const HOUR: u64 = 3_600_000_000;

/// Adds up the time spent on the messages of each scan.
pub struct Meter {
    messages_a_scan: u32,
    open: [(u64, u32, Duration); OPEN],
    microseconds: Histogram<u64>,
}

impl std::fmt::Debug for Meter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Meter").field(&self.percentiles()).finish()
    }
}

impl Default for Meter {
    fn default() -> Self {
        #[expect(clippy::expect_used, reason = "these bounds are valid")]
        let microseconds = Histogram::new_with_bounds(1, HOUR, 3).expect("valid bounds");
        Self {
            messages_a_scan: 0,
            open: [(u64::MAX, 0, Duration::ZERO); OPEN],
            microseconds,
        }
    }
}

impl Meter {
    /// One more message belongs to each scan.
    pub(super) fn expect_one_more(&mut self) {
        self.messages_a_scan += 1;
    }

    /// Adds the time spent on one message of a scan.
    pub(super) fn add(&mut self, sequence: u64, elapsed: Duration) {
        let slot = &mut self.open[sequence as usize % OPEN];
        if slot.0 != sequence {
            *slot = (sequence, 0, Duration::ZERO);
        }
        slot.1 += 1;
        slot.2 += elapsed;
        if slot.1 == self.messages_a_scan {
            let spent = slot.2;
            slot.0 = u64::MAX;
            self.scan(spent);
        }
    }

    /// Adds the time spent on a whole scan.
    pub fn scan(&mut self, spent: Duration) {
        self.microseconds
            .saturating_record(spent.as_micros() as u64);
    }

    /// What was measured so far.
    pub fn percentiles(&self) -> Percentiles {
        let milliseconds = |q| self.microseconds.value_at_quantile(q) as f64 / 1000.0;
        Percentiles {
            scans: self.microseconds.len(),
            p50: milliseconds(0.5),
            p99: milliseconds(0.99),
            max: self.microseconds.max() as f64 / 1000.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_counts_when_all_its_messages_are_made_whatever_the_order() {
        let mut meter = Meter::default();
        meter.expect_one_more();
        meter.expect_one_more();
        let millisecond = Duration::from_millis(1);
        for sequence in [0, 1, 1, 0, 2] {
            meter.add(sequence, millisecond);
        }
        let measured = meter.percentiles();
        assert_eq!(measured.scans, 2);
        assert!((measured.p50 - 2.0).abs() < 0.01, "{measured:?}");
    }
}
