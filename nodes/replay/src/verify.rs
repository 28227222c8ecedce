//! Compares what is computed with what was recorded, byte for byte.
//!
//! ```text
//! every topic that is computed anew ─┐
//!                                    ├─► equal? ─► Findings
//! the recording ─────────────────────┘
//! ```

#[cfg(feature = "node")]
pub mod node;

use std::collections::BTreeMap;

use messages::record::{Codec, Digest, Digests};
use messages::recording::Scan;
use messages::{AnyView, Difference, Header, Kind, Rig, Stage, Topic};
use serde::{Deserialize, Serialize};

messages::settings! {
    /// What is compared with what.
    pub struct Settings {
        /// The recording; its further parts are found by their names.
        pub file: String = String::new();
        /// The first stage that computes anew.
        pub from: Stage = Stage::CAPTURE;
        /// The recording's scan that is replayed first.
        pub first: u64 = 0;
        /// The recording's scan before which the replay ends.
        pub end: Option<u64> = None;
        /// How many scans before these are played too where they are there: they are not compared.
        pub before: u64 = 0, in 0..=1e6;
        /// Kinds of message that the recording does not hold: they are not compared.
        pub without: Vec<Kind> = Vec::new();
    }
}

/// What came of comparing, by topic.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// By topic, as named in the recording.
    pub topics: BTreeMap<String, Finding>,
    /// The scans compared last, by their numbers in the replay: one that is sent again counts once.
    pub latest: Vec<u64>,
}

/// What came of comparing one topic.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// Messages that are the same to the byte.
    pub equal: u64,
    /// Messages that are not.
    pub different: u64,
    /// Of both, messages that the recording holds the digest of, and not themselves.
    #[serde(default)]
    pub by_digest: u64,
    /// Messages that were not recorded, or cannot be read.
    pub missing: u64,
    /// Messages that depend on scans before them that are not replayed: of a rail's first frames.
    #[serde(default)]
    pub dependent: u64,
    /// What is the matter with the first of those that are not equal.
    pub first: Option<String>,
}

/// How many scans before a scan its messages of a kind depend on, in a replay from this stage.
pub fn depth(rig: &Rig, from: Stage, kind: Kind) -> u64 {
    let Some(rail) = rig.rail else {
        return 0;
    };
    // Points that are played depend on nothing any more.
    let reach = if Stage::MATCH.follows(from) {
        rail.reach()
    } else {
        0
    };
    match kind.stage() {
        Stage::MAP => reach + rail.follow,
        stage if stage.follows(Stage::MATCH) => reach,
        _ => 0,
    }
}

impl Findings {
    /// The file in the run's folder in which a verifier leaves them after each scan.
    pub const FILE: &str = "verify.json";
    /// More scans than can be under way, along a rail with those that they depend on.
    const LATEST: usize = 256;

    /// Whether a scan of the replay was compared.
    pub fn knows(&self, sequence: u64) -> bool {
        self.latest.contains(&sequence)
    }

    /// A scan of the replay is compared.
    pub fn done(&mut self, sequence: u64) {
        if self.latest.len() == Self::LATEST {
            self.latest.remove(0);
        }
        self.latest.push(sequence);
    }

    /// Leaves out a message that depends on scans that are not replayed.
    pub fn leave_out(&mut self, topic: &Topic) {
        let finding = self.topics.entry(topic.name.clone()).or_default();
        finding.dependent += 1;
    }

    /// Compares a message with the recorded one of its topic, or with its digest where only that was recorded.
    pub fn compare(
        &mut self,
        codec: &Codec,
        (recorded, digests): (&Scan, &Digests),
        topic: &Topic,
        header: &Header,
        computed: AnyView<'_>,
    ) {
        let finding = self.topics.entry(topic.name.clone()).or_default();
        let scan = recorded.sequence;
        if let Some(digest) = digests.messages.get(&topic.name)
            && recorded.message(&topic.name).is_none()
        {
            let computed = Digest::of(header, &computed);
            finding.by_digest += 1;
            if *digest == computed {
                finding.equal += 1;
            } else {
                finding.different += 1;
                let text = format!(
                    "scan {scan}: its digest was {digest}, that of what is computed is {computed}"
                );
                finding.first.get_or_insert(text);
            }
            return;
        }
        let trouble = recorded.show(codec, topic, |own, message| {
            compare((own, message), (header, computed))
        });
        let text = match trouble {
            Ok(None) => {
                finding.equal += 1;
                return;
            }
            Ok(Some(Difference {
                section,
                element,
                one,
                other,
            })) => {
                finding.different += 1;
                let [recorded, computed] =
                    [one, other].map(|value| value.unwrap_or_else(|| "nothing more".to_owned()));
                format!(
                    "scan {scan}, {section}[{element}]: recorded {recorded}, computed {computed}"
                )
            }
            Err(error) => {
                finding.missing += 1;
                error.to_string()
            }
        };
        finding.first.get_or_insert(text);
    }
}

/// Where a message differs first from the recorded one: size and place before the payload.
fn compare(
    (own, recorded): (&Header, AnyView<'_>),
    (header, computed): (&Header, AnyView<'_>),
) -> Option<Difference> {
    let head = |header: &Header| (header.size(), header.position_m.to_bits(), header.sway);
    if head(own) != head(header) {
        let text = |header: &Header| {
            let place = format!("{} at {} m", header.size(), header.position_m);
            Some(match header.sway.is_none() {
                true => place,
                false => format!("{place}, off by {:?}", header.sway),
            })
        };
        return Some(Difference {
            section: "header",
            element: 0,
            one: text(own),
            other: text(header),
        });
    }
    recorded.difference(&computed)
}
