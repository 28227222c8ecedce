//! A proof becomes the full recording it stands for.
//!
//! ```text
//! every topic, computed anew ─┐
//!                             ├─► digests equal? ─► Batch ─► Writer ─► full recording
//! the proof ──────────────────┘
//! ```
//!
//! What is computed is encoded as the recorder would have encoded it; what only the run itself knew, such as its log and its
//! times, is taken from the proof as it stands there.

#[cfg(feature = "node")]
pub mod node;

use messages::record::{Channel, Content, DIGESTS, Digest, Encoder, Sink};
use messages::recording::{ReadError, Scan};
use messages::{AnyView, Header, Kind, Topic};
use thiserror::Error;

use crate::{Batch, Metadata, WriteError};

messages::settings! {
    /// Which proof becomes which full recording.
    pub struct Settings {
        /// The proof; its further parts are found by their names.
        pub file: String = String::new();
        /// The full recording.
        pub output: String = String::new();
        /// The proof's scans as they are played, in order.
        pub scans: Vec<u64> = Vec::new();
        /// How many of them, the first ones, are played only because those after them depend on them.
        pub lead: u64 = 0, in 0..=1e6;
        /// Kinds of message that are not written.
        pub without: Vec<Kind> = Vec::new();
    }
}

/// Why a proof does not become a full recording.
#[derive(Debug, Error)]
pub enum RehydrateError {
    /// The bus failed.
    #[cfg(feature = "node")]
    #[error(transparent)]
    Bus(#[from] messages::bus::BusError),
    /// The proof cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The full recording cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// An unfinished part cannot be finished.
    #[error(transparent)]
    Seal(#[from] crate::SealError),
    /// A message that is computed is not the one that was made.
    #[error(
        "{topic} of scan {scan} is not what was recorded: its digest is {recorded}, and that of what is computed is {computed}; \
         images, settings and versions are as they were recorded, so that the digest was changed, or this machine computes \
         otherwise than the one that recorded it"
    )]
    Differs {
        /// The topic.
        topic: String,
        /// The scan.
        scan: u64,
        /// The digest that was recorded.
        recorded: Digest,
        /// That of what is computed.
        computed: Digest,
    },
    /// What is derived from the rig is not what was recorded.
    #[error(
        "{topic} of scan {scan} is not what its rig says: it was changed after it was recorded"
    )]
    Changed {
        /// The topic.
        topic: String,
        /// The scan.
        scan: u64,
    },
    /// A message that is computed has no digest.
    #[error("scan {scan} has no digest of {topic}: it was left out after it was recorded")]
    Missing {
        /// The topic.
        topic: String,
        /// The scan.
        scan: u64,
    },
}

/// What the full recording says about itself: what the proof says, but for how much is kept.
pub fn full_metadata(proof: &Metadata) -> Metadata {
    let mut full = proof.clone();
    if let Some(table) = full
        .configuration
        .get_mut("record")
        .and_then(serde_json::Value::as_object_mut)
    {
        table.insert("keep".to_owned(), "all".into());
    }
    full
}

/// How the full recording is written: as the run that the proof is of would have written it.
pub fn full_settings(proof: &Metadata) -> crate::Settings {
    let own = full_metadata(proof).configuration.get("record").cloned();
    let own = own.and_then(|own| serde_json::from_value(own).ok());
    own.unwrap_or_default()
}

/// The kinds of message that a full recording is made of and its proof says nothing of: they are left out of both, but drawn.
pub fn unproven(proof: &Metadata) -> Vec<Kind> {
    let settings = full_settings(proof);
    let mut kinds = crate::taken_kinds(&settings);
    kinds.retain(|kind| settings.without.contains(kind));
    kinds
}

/// Puts scans together from what is computed anew and what the proof holds.
#[derive(Debug)]
pub struct Rehydrator {
    encoder: Encoder,
    /// The topics that there are digests of.
    proven: Vec<Topic>,
}

impl Rehydrator {
    /// Into the channels of this encoder, of a proof that says nothing of these kinds: what is drawn may be made of them.
    pub fn new(encoder: Encoder, without: &[Kind]) -> Self {
        let mut proven = encoder.topics().to_vec();
        proven.retain(|topic| !without.contains(&topic.kind));
        Self { proven, encoder }
    }

    /// What it encodes into.
    pub fn encoder(&self) -> &Encoder {
        &self.encoder
    }

    /// Puts a scan together and checks it: `computed` are its messages but for their number, which is the proof's.
    ///
    /// # Errors
    /// When what is computed is not what was recorded; the batch is then worthless.
    pub fn scan(
        &mut self,
        proof: &Scan,
        computed: &mut [(Header, AnyView<'_>)],
        batch: &mut Batch,
    ) -> Result<(), RehydrateError> {
        let scan = proof.sequence;
        let digests = proof.digests()?.unwrap_or_default();
        for topic in &self.proven {
            let is_it = |(header, view): &&(Header, AnyView<'_>)| {
                view.kind() == topic.kind
                    && (!topic.kind.is_per_view() || header.view == topic.view)
                    && (!topic.kind.is_per_channel() || header.channel == topic.channel)
            };
            let Some((header, view)) = computed.iter().find(is_it) else {
                continue;
            };
            let topic = topic.name.clone();
            let computed = Digest::of(header, view);
            match digests.messages.get(&topic) {
                Some(recorded) if *recorded == computed => {}
                Some(&recorded) => {
                    return Err(RehydrateError::Differs {
                        topic,
                        scan,
                        recorded,
                        computed,
                    });
                }
                None => return Err(RehydrateError::Missing { topic, scan }),
            }
        }
        for (header, _) in computed.iter_mut() {
            header.sequence = scan;
        }
        let channels = self.encoder.channels().to_vec();
        let mut whole = Whole {
            batch,
            channels: &channels,
            made: vec![false; channels.len()],
            proof,
            changed: None,
        };
        self.encoder.encode(computed, &mut whole);
        let Whole { made, changed, .. } = whole;
        if let Some(topic) = changed {
            return Err(RehydrateError::Changed { topic, scan });
        }
        for (name, bytes) in proof.messages().filter(|(name, _)| *name != DIGESTS) {
            let index = channels.iter().position(|channel| channel.name == name);
            if let Some(index) = index.filter(|index| !made[*index]) {
                batch.add(index, |out| out.extend_from_slice(bytes));
            }
        }
        Ok(())
    }
}

/// Takes what is encoded anew, with what the run itself knew.
struct Whole<'a> {
    batch: &'a mut Batch,
    channels: &'a [Channel],
    /// Which of the channels have their message.
    made: Vec<bool>,
    proof: &'a Scan,
    /// A topic whose message in the proof is not what it is made of.
    changed: Option<String>,
}

impl Sink for Whole<'_> {
    fn begin(&mut self, sequence: u64, nanos: u64) {
        self.batch.begin(sequence, nanos);
    }

    fn nanos(&self) -> u64 {
        self.batch.nanos()
    }

    fn add(&mut self, channel: usize, encode: impl FnOnce(&mut Vec<u8>)) {
        let Channel { name, content, .. } = &self.channels[channel];
        let recorded = self.proof.message(name);
        self.made[channel] = true;
        match content {
            Content::Transforms | Content::Calibration(_) => {
                let mut made = Vec::new();
                encode(&mut made);
                if recorded.is_some_and(|recorded| recorded != made) {
                    self.changed.get_or_insert_with(|| name.clone());
                }
                self.batch.add(channel, |out| out.append(&mut made));
            }
            Content::Statistics => {
                let mut made = Vec::new();
                encode(&mut made);
                let timed = recorded.and_then(|recorded| timed(&made, recorded));
                let made = timed.unwrap_or(made);
                self.batch.add(channel, |out| out.extend_from_slice(&made));
            }
            _ => self.batch.add(channel, encode),
        }
    }

    fn len(&self) -> usize {
        self.batch.len()
    }
}

/// Statistics with the times that the run took, not those of computing it anew: they stand last. As text, since numbers that
/// are read and written again may lose their last digit.
fn timed(made: &[u8], recorded: &[u8]) -> Option<Vec<u8>> {
    const TIMES: &[u8] = b"\"milliseconds\":";
    let times = |text: &[u8]| text.windows(TIMES.len()).rposition(|part| part == TIMES);
    let (made, recorded) = (&made[..times(made)?], &recorded[times(recorded)?..]);
    Some([made, recorded].concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::record::Statistics;

    #[test]
    fn statistics_are_those_that_are_computed_with_the_times_of_the_run() -> serde_json::Result<()>
    {
        let of = |known, capture| {
            let mut statistics = Statistics {
                known,
                ..Statistics::default()
            };
            statistics.milliseconds.capture = capture;
            serde_json::to_vec(&statistics)
        };
        let known = 0.1 + 0.2;
        assert_eq!(
            timed(&of(known, 1.0)?, &of(0.5, 7.25)?),
            Some(of(known, 7.25)?)
        );
        assert_eq!(timed(&of(known, 1.0)?, b"{}"), None);
        Ok(())
    }
}
