//! What came of comparing a replay with its recording: how much of what, and whether that is all there was to verify.

use std::collections::BTreeMap;
use std::fmt;

use messages::Kind;
use replay::verify::Findings;
use serde::Serialize;

/// What was to be compared.
#[derive(Debug, Default)]
pub(super) struct Expected {
    /// Topics that are computed anew and recorded.
    pub(super) topics: Vec<String>,
    /// Scans that came out.
    pub(super) scans: u64,
    /// Scans that were to come out.
    pub(super) wanted: u64,
    /// Scans before them that were played because they depend on them.
    pub(super) lead: u64,
    /// How many more of these there would have to be.
    pub(super) lacking: u64,
    /// Kinds of message that were played.
    pub(super) played: Vec<Kind>,
    /// Kinds of message that were computed and are not in the recording.
    pub(super) not_recorded: Vec<Kind>,
}

/// What came of comparing.
#[derive(Debug, Serialize)]
pub(super) struct Verified {
    /// Whether every message of every scan is the same to the byte, and of every topic there was one to compare.
    equal: bool,
    scans: u64,
    /// Scans that were to be compared: fewer are where the replay was ended.
    wanted: u64,
    /// Scans before these that were played because they depend on them, and not compared.
    lead: u64,
    /// Messages that were compared, of all topics.
    compared: u64,
    /// Of these, those that were compared by their digests.
    by_digest: u64,
    /// Topics that were to be verified and of which no message was compared.
    not_verified: Vec<String>,
    /// Kinds of message that were played, not computed, and not compared.
    played: Vec<&'static str>,
    /// Kinds of message that were computed, but are not in the recording, and not compared.
    not_recorded: Vec<&'static str>,
    topics: BTreeMap<String, TopicVerified>,
    #[serde(skip)]
    lacking: u64,
}

#[derive(Debug, Serialize)]
struct TopicVerified {
    /// Messages that were compared: those that are equal and those that are not.
    compared: u64,
    equal: u64,
    different: u64,
    missing: u64,
    /// Messages that were compared by their digests, since the recording is a proof.
    #[serde(skip_serializing_if = "is_none")]
    by_digest: u64,
    /// Messages of a rail's first frames, which depend on frames that are not in the recording: they are not compared.
    #[serde(skip_serializing_if = "is_none")]
    dependent: u64,
    /// What is the matter with the first message that is not equal.
    #[serde(skip_serializing_if = "Option::is_none")]
    first: Option<String>,
}

fn is_none(count: &u64) -> bool {
    *count == 0
}

impl Verified {
    pub(super) fn new(findings: Findings, expected: Expected) -> Self {
        let scans = expected.scans;
        let mut found = findings.topics;
        // What never came out is missing, not left out of the account.
        for topic in &expected.topics {
            found.entry(topic.clone()).or_default();
        }
        let topics: BTreeMap<_, _> = found
            .into_iter()
            .map(|(topic, found)| {
                let compared = TopicVerified {
                    compared: found.equal + found.different,
                    equal: found.equal,
                    different: found.different,
                    missing: scans.saturating_sub(found.equal + found.different + found.dependent),
                    by_digest: found.by_digest,
                    dependent: found.dependent,
                    first: found.first,
                };
                (topic, compared)
            })
            .collect();
        let is_vain = |(_, topic): &(&String, &TopicVerified)| topic.compared == 0;
        let not_verified = topics.iter().filter(is_vain);
        let not_verified: Vec<String> = not_verified.map(|(topic, _)| topic.clone()).collect();
        let names = |kinds: &[Kind]| kinds.iter().map(|kind| kind.name()).collect();
        Self {
            equal: scans > 0
                && scans >= expected.wanted
                && !topics.is_empty()
                && not_verified.is_empty()
                && topics
                    .values()
                    .all(|topic| topic.equal + topic.dependent == scans),
            scans,
            wanted: expected.wanted,
            lead: expected.lead,
            compared: topics.values().map(|topic| topic.compared).sum(),
            by_digest: topics.values().map(|topic| topic.by_digest).sum(),
            not_verified,
            played: names(&expected.played),
            not_recorded: names(&expected.not_recorded),
            topics,
            lacking: expected.lacking,
        }
    }

    /// Whether all that was to be verified was compared and is equal.
    pub(super) fn is_verified(&self) -> bool {
        self.equal
    }
}

impl fmt::Display for Verified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<24} {:>8} {:>7} {:>10} {:>8}",
            "topic", "compared", "equal", "different", "missing"
        )?;
        for (topic, found) in &self.topics {
            let TopicVerified {
                compared,
                equal,
                different,
                missing,
                dependent,
                first,
                ..
            } = found;
            writeln!(
                f,
                "{topic:<24} {compared:>8} {equal:>7} {different:>10} {missing:>8}"
            )?;
            if let Some(first) = first {
                writeln!(f, "    first: {first}")?;
            }
            if *dependent > 0 {
                writeln!(
                    f,
                    "    not compared: {dependent}, which depend on frames before them that are not in the recording"
                )?;
            }
        }
        if !self.not_recorded.is_empty() {
            let kinds = self.not_recorded.join(", ");
            writeln!(f, "\nnot in the recording, and not compared: {kinds}")?;
        }
        if self.by_digest > 0 {
            let topics = self.topics.iter();
            let by_digest = topics.filter(|(_, topic)| topic.by_digest > 0);
            let by_digest: Vec<&str> = by_digest.map(|(topic, _)| topic.as_str()).collect();
            writeln!(
                f,
                "\ncompared by their digests, since the recording is a proof: {} messages of {} topics, {}",
                self.by_digest,
                by_digest.len(),
                by_digest.join(", ")
            )?;
        }
        if self.lead > 0 {
            let (lead, them) = match self.lead {
                1 => ("1 frame".to_owned(), "it"),
                lead => (format!("{lead} frames"), "them"),
            };
            writeln!(
                f,
                "\n{lead} before these were played too, since these depend on {them}, and not compared"
            )?;
        }
        let played = self.played.join(", ");
        let (scans, compared) = (self.scans, self.compared);
        let others = self.topics.values();
        let differ =
            others.filter(|topic| topic.different + topic.missing > 0 && topic.compared > 0);
        if self.equal {
            let topics = self.topics.len();
            let scans = if scans == 1 {
                "1 scan"
            } else {
                &format!("{scans} scans")
            };
            return writeln!(
                f,
                "\nverified: {scans}, {compared} messages of {topics} topics, are equal to the byte; played, not \
                 computed: {played}"
            );
        }
        if differ.count() > 0 {
            writeln!(f, "\nNOT equal: what is computed is not what was recorded")?;
        }
        if scans == 0 {
            return writeln!(f, "\nNOT verified: no scan was compared");
        }
        if scans < self.wanted {
            writeln!(
                f,
                "\nNOT verified: {scans} of {} scans were compared when it was ended",
                self.wanted
            )?;
        }
        if self.not_verified.is_empty() {
            return Ok(());
        }
        let topics = self.not_verified.join(", ");
        write!(f, "\nNOT verified: no message was compared of {topics}")?;
        match self.lacking {
            0 => writeln!(f),
            lacking => writeln!(
                f,
                ": they depend on {} frames before these, of which {lacking} are not in the recording",
                self.lead + lacking
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use replay::verify::Finding;

    fn found(topics: &[(&str, u64, u64, u64)]) -> Findings {
        let finding = |&(topic, equal, different, dependent): &(&str, u64, u64, u64)| {
            let finding = Finding {
                equal,
                different,
                dependent,
                ..Finding::default()
            };
            (topic.to_owned(), finding)
        };
        Findings {
            topics: topics.iter().map(finding).collect(),
            ..Findings::default()
        }
    }

    fn of(found: Findings, topics: &[&str], scans: u64) -> Verified {
        let expected = Expected {
            topics: topics.iter().map(|topic| (*topic).to_owned()).collect(),
            scans,
            ..Expected::default()
        };
        Verified::new(found, expected)
    }

    #[test]
    fn all_that_was_expected_and_is_equal_is_verified_and_counted() {
        let verified = of(
            found(&[("edges", 3, 0, 0), ("points", 2, 0, 1)]),
            &["edges"],
            3,
        );
        assert!(verified.is_verified());
        let told = verified.to_string();
        assert!(
            told.contains("verified: 3 scans, 5 messages of 2 topics, are equal"),
            "{told}"
        );
    }

    #[test]
    fn a_topic_of_which_nothing_was_compared_is_not_verified() {
        for verified in [
            of(
                found(&[("edges", 1, 0, 0), ("points", 0, 0, 1)]),
                &["edges", "points"],
                1,
            ),
            of(found(&[("edges", 1, 0, 0)]), &["edges", "points"], 1),
        ] {
            assert!(!verified.is_verified());
            let told = verified.to_string();
            assert!(
                told.contains("NOT verified: no message was compared of points"),
                "{told}"
            );
            assert!(!told.contains("NOT equal"), "{told}");
        }
    }

    #[test]
    fn nothing_at_all_is_not_verified() {
        assert!(!of(Findings::default(), &[], 2).is_verified());
        let none = of(Findings::default(), &["edges"], 0);
        assert!(!none.is_verified());
        assert!(
            none.to_string()
                .contains("NOT verified: no scan was compared")
        );
    }

    #[test]
    fn what_differs_is_not_equal() {
        let verified = of(found(&[("edges", 2, 1, 0)]), &["edges"], 3);
        assert!(!verified.is_verified() && verified.to_string().contains("NOT equal"));
    }
}
