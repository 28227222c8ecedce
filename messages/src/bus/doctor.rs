//! Follows how a running graph is doing, from what its nodes report.

use std::time::Instant;

use super::{Event, NodeReport, Progress};
use crate::health::{Health, NodeHealth};
use crate::synchronisation::Synchronisation;

/// Listens to reports and says how the graph is.
#[derive(Debug)]
pub struct Doctor {
    health: Health,
    synchronisation: Option<Box<Synchronisation>>,
    /// When it was said last, and how many scans were done then.
    last: (Instant, u64),
}

impl Default for Doctor {
    fn default() -> Self {
        Self {
            health: Health::default(),
            synchronisation: None,
            last: (Instant::now(), 0),
        }
    }
}

impl Doctor {
    /// Takes in what a node reports.
    pub fn hear(&mut self, event: &Event) {
        match event {
            Event::Progress(Progress {
                admitted,
                done,
                refused,
                ..
            }) => {
                self.health.admitted = *admitted;
                self.health.done = *done;
                self.health.under_way = admitted.saturating_sub(*done);
                self.health.dropped = refused.values().sum();
            }
            Event::Report(report) => self.take(report, "running"),
            Event::Finished(report) => {
                let state = report.failed.as_ref().map_or("finished", |_| "failed");
                self.take(report, state);
            }
            _ => {}
        }
    }

    fn take(&mut self, report: &NodeReport, state: &str) {
        if report.synchronisation.is_some() {
            self.synchronisation.clone_from(&report.synchronisation);
        }
        let node = NodeHealth {
            state: state.to_owned(),
            restarts: report.life,
            p50: report.milliseconds.p50,
            p99: report.milliseconds.p99,
        };
        self.health.nodes.insert(report.node.clone(), node);
    }

    /// What came of the cameras' frames, where the source is cameras.
    pub fn synchronisation(&self) -> Option<&Synchronisation> {
        self.synchronisation.as_deref()
    }

    /// How the graph is, now.
    pub fn say(&mut self, now: Instant) -> &Health {
        let (since, done) = self.last;
        let seconds = now.saturating_duration_since(since).as_secs_f64();
        if seconds > 0.0 {
            let more = self.health.done.saturating_sub(done);
            self.health.triples_per_second = more as f64 / seconds;
            self.last = (now, self.health.done);
        }
        &self.health
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn the_rate_is_that_since_it_was_asked_last() {
        let mut doctor = Doctor::default();
        let begin = doctor.last.0;
        let progress = |done| {
            Event::Progress(Progress {
                admitted: done + 3,
                done,
                ..Progress::default()
            })
        };
        doctor.hear(&progress(40));
        let health = doctor.say(begin + Duration::from_secs(2));
        assert_eq!((health.triples_per_second, health.under_way), (20.0, 3));
        doctor.hear(&progress(45));
        let health = doctor.say(begin + Duration::from_secs(3));
        assert_eq!(health.triples_per_second, 5.0);
    }

    #[test]
    fn a_node_that_failed_is_not_one_that_finished() {
        let mut doctor = Doctor::default();
        let report = |failed: Option<&str>| NodeReport {
            node: "match".to_owned(),
            failed: failed.map(str::to_owned),
            life: 2,
            ..NodeReport::default()
        };
        for (event, state) in [
            (Event::Report(report(None)), "running"),
            (Event::Finished(report(None)), "finished"),
            (Event::Finished(report(Some("no"))), "failed"),
        ] {
            doctor.hear(&event);
            let health = doctor.say(Instant::now());
            assert_eq!(health.nodes["match"].state, state);
            assert_eq!(health.nodes["match"].restarts, 2);
        }
    }
}
