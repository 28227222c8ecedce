//! Looks at scans of live cameras as they pass: a rig that was knocked, or cabled otherwise, is told of.
//!
//! ```text
//! a scan every so often ─► a thread that looks at it ─► findings ─► what several looks in a row agree on: one sentence a kind
//! ```
//!
//! Nothing waits for it, and no scan is held back: what it finds is said, not refused.

use std::mem::{Discriminant, discriminant};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use messages::Size;

use crate::look::{Finding, look};

/// Between looks as long as nothing is sure, and afterwards: a look takes a core for a fraction of a second.
const SOON: Duration = Duration::from_secs(1);
const LATER: Duration = Duration::from_secs(60);
/// Looks that are taken soon after each other.
const FIRST: u32 = 5;

/// The looks of a run.
#[derive(Debug)]
pub(super) struct Glances {
    names: Vec<String>,
    /// Looks in a row that must agree.
    patience: u32,
    next: Instant,
    looks: u32,
    under_way: Option<JoinHandle<Vec<Finding>>>,
    /// What the last looks agree on, and how many of them.
    agreed: Option<(Discriminant<Finding>, u32)>,
    told: Vec<Discriminant<Finding>>,
}

impl Glances {
    /// For views of these names.
    pub(super) fn new(names: &[String], patience: u32) -> Self {
        Self {
            names: names.to_vec(),
            patience,
            next: Instant::now(),
            looks: 0,
            under_way: None,
            agreed: None,
            told: Vec::new(),
        }
    }

    /// Whether it is time for another look.
    pub(super) fn is_due(&self) -> bool {
        self.under_way.is_none() && Instant::now() >= self.next
    }

    /// Looks at a scan, elsewhere.
    pub(super) fn begin(&mut self, views: Vec<Vec<u8>>, size: Size) {
        self.looks += 1;
        let wait = if self.looks < FIRST { SOON } else { LATER };
        self.next = Instant::now() + wait;
        let work = move || {
            let views: Vec<&[u8]> = views.iter().map(Vec::as_slice).collect();
            look(&views, size).findings
        };
        // Where no thread is to be had there are worse things to say.
        let worker = std::thread::Builder::new().name("look".to_owned());
        self.under_way = worker.spawn(work).ok();
    }

    /// What is to be said of looks that are done; at the end the last one is waited for.
    pub(super) fn said(&mut self, is_end: bool) -> Option<String> {
        let is_done = |worker: &JoinHandle<_>| is_end || worker.is_finished();
        let worker = self.under_way.take_if(|worker| is_done(worker))?;
        let findings = worker.join().ok()?;
        self.heard(findings)
    }

    /// Takes in what a look found.
    fn heard(&mut self, findings: Vec<Finding>) -> Option<String> {
        let Some(worst) = findings.first() else {
            self.agreed = None;
            return None;
        };
        let kind = discriminant(worst);
        let before = self.agreed.filter(|(known, _)| *known == kind);
        let count = 1 + before.map_or(0, |(_, count)| count);
        self.agreed = Some((kind, count));
        if count < self.patience || self.told.contains(&kind) {
            return None;
        }
        self.told.push(kind);
        let cure = match worst {
            Finding::Rows { .. } => "; rectify them: capture.calibration",
            Finding::Order { .. } => "; name them so in capture.cameras",
            _ => "",
        };
        Some(worst.says(&self.names) + cure)
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn names() -> Vec<String> {
        ["left", "centre", "right"].map(str::to_owned).to_vec()
    }

    #[test]
    fn what_looks_in_a_row_agree_on_is_told_once() {
        let mut glances = Glances::new(&names(), 2);
        let constant = || vec![Finding::Constant { view: 1 }];
        let said: Vec<bool> = [constant(), vec![], constant(), constant(), constant()]
            .map(|findings| glances.heard(findings).is_some())
            .to_vec();
        assert_eq!(said, [false, false, false, true, false]);
        let reversed = || {
            vec![Finding::Order {
                order: vec![2, 1, 0],
            }]
        };
        assert_eq!(glances.heard(reversed()), None);
        assert_eq!(
            glances.heard(reversed()).unwrap(),
            "the views go from right to left: from left to right they are right, centre, left; name them so in capture.cameras"
        );
    }

    #[test]
    fn a_look_is_taken_elsewhere_and_waited_for_at_the_end() {
        let mut glances = Glances::new(&names(), 1);
        assert!(glances.is_due());
        let size = Size::new(64, 64);
        let view: Vec<u8> = (0..size.pixels()).map(|i| (i * 37 % 251) as u8).collect();
        glances.begin(vec![view.clone(), view.clone(), view], size);
        assert!(!glances.is_due());
        let said = glances.said(true).unwrap();
        assert!(
            said.starts_with("left, centre, right are one and the same"),
            "{said}"
        );
        assert_eq!(glances.said(true), None);
    }
}
