//! A scan's messages, encoded and in order: what goes from the node's thread to the writer's.

use std::ops::Range;

use mcap::records::op;
use messages::change::Change;
use messages::record::{Codec, Encoder, Shown, Sink};
use messages::{Kind, Rig};

use crate::{Keep, Settings};
use messages::recording::{MESSAGE_HEAD, RECORD_HEAD};

/// The encoded messages of one scan, as the records that stand in the file; made once and used again and again.
#[derive(Debug, Default)]
pub struct Batch {
    sequence: u64,
    nanos: u64,
    is_closing: bool,
    /// The settings changed so far, when there are more than with the scan before.
    changes: Vec<Change>,
    bytes: Vec<u8>,
    records: Vec<(usize, Range<usize>)>,
}

/// What stands in front of a message's bytes: opcode, length, channel, sequence, and the two times.
const HEAD: usize = RECORD_HEAD as usize + MESSAGE_HEAD;

impl Batch {
    /// An empty one.
    #[cfg(test)]
    pub(crate) fn taken_at(nanos: u64) -> Self {
        Self {
            nanos,
            ..Self::default()
        }
    }

    /// The scan.
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// When it was taken, in nanoseconds since 1970.
    pub fn nanos(&self) -> u64 {
        self.nanos
    }

    /// Whether it holds no scan, only what is said when all are there.
    pub(crate) fn is_closing(&self) -> bool {
        self.is_closing
    }

    /// Its messages: index of the channel, and the bytes.
    pub fn messages(&self) -> impl Iterator<Item = (usize, &[u8])> {
        let message = |record: &Range<usize>| &self.bytes[record.start + HEAD..record.end];
        self.records
            .iter()
            .map(move |(channel, record)| (*channel, message(record)))
    }

    /// Says which settings hold otherwise from some scan on: all that is known.
    pub fn set_changes(&mut self, changes: Vec<Change>) {
        self.changes = changes;
    }

    /// The settings changed so far, when there are more than with the scan before.
    pub(crate) fn changes(&self) -> &[Change] {
        &self.changes
    }

    /// The records of the messages: index of the channel, and where in [`bytes`](Self::bytes).
    pub(crate) fn records(&self) -> &[(usize, Range<usize>)] {
        &self.records
    }

    /// All records, one after the other.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Begins the last batch, which holds no scan: what is said when all are there, at the last one's time.
    pub(crate) fn close(&mut self, sequence: u64, nanos: u64) {
        self.begin(sequence, nanos);
        self.is_closing = true;
    }
}

impl Sink for Batch {
    fn begin(&mut self, sequence: u64, nanos: u64) {
        self.sequence = sequence;
        self.nanos = nanos;
        self.is_closing = false;
        self.changes.clear();
        self.bytes.clear();
        self.records.clear();
    }

    fn nanos(&self) -> u64 {
        self.nanos
    }

    fn len(&self) -> usize {
        self.bytes.len() - HEAD * self.records.len()
    }

    fn add(&mut self, channel: usize, encode: impl FnOnce(&mut Vec<u8>)) {
        let start = self.bytes.len();
        self.bytes.push(op::MESSAGE);
        self.bytes.extend_from_slice(&[0; size_of::<u64>()]);
        self.bytes
            .extend_from_slice(&channel_id(channel).to_le_bytes());
        self.bytes
            .extend_from_slice(&(self.sequence as u32).to_le_bytes());
        // log_time and publish_time.
        self.bytes.extend_from_slice(&self.nanos.to_le_bytes());
        self.bytes.extend_from_slice(&self.nanos.to_le_bytes());
        encode(&mut self.bytes);
        let end = self.bytes.len();
        let length = (end - start) as u64 - RECORD_HEAD;
        self.bytes[start + 1..start + RECORD_HEAD as usize].copy_from_slice(&length.to_le_bytes());
        self.records.push((channel, start..end));
    }
}

/// The number in the file of the channel with this index.
pub(crate) fn channel_id(index: usize) -> u16 {
    index as u16 + 1
}

/// The kinds of message that a recording with these settings is made of: what it holds, and what its views show.
pub fn taken_kinds(settings: &Settings) -> Vec<Kind> {
    // What is drawn over an image is drawn only where that is recorded.
    let is_drawn = settings.keep == Keep::All;
    let is_pictured = (settings.views || settings.inspected) && settings.keep != Keep::Proof;
    let is_shown = |kind: &Kind| match kind {
        Kind::Curves | Kind::Matches => {
            is_drawn && (settings.views || settings.labels || settings.rejected)
        }
        Kind::Disparity | Kind::Points => is_pictured,
        _ => false,
    };
    // Of what a proof does not hold it says the digest.
    let is_said = |kind: &Kind| {
        let is_proven = settings.keep == Keep::Proof && !settings.without.contains(kind);
        is_proven || settings.holds(*kind)
    };
    let mut kinds = Kind::all().collect::<Vec<_>>();
    kinds.retain(|kind| is_said(kind) || is_shown(kind));
    kinds
}

/// What encodes the scans of a rig for a recording with these settings: disparities and points are those of the view
/// with index `reference`, these kinds of message are made, and `cameras` says whether scans come from cameras.
pub fn encoder(
    rig: &Rig,
    reference: usize,
    made: &[Kind],
    cameras: bool,
    settings: &Settings,
) -> Encoder {
    let codec = Codec::new(rig.clone(), reference);
    let shown = Shown {
        views: settings.views,
        inspected: settings.inspected,
        labels: settings.labels,
        rejected: settings.rejected,
        cameras,
        digests: settings.keep == Keep::Proof,
    };
    let mut held = made.to_vec();
    held.retain(|kind| settings.holds(*kind));
    let mut channels = codec.channels_of(shown, &held);
    channels.retain(|channel| settings.keep.keeps(&channel.content));
    Encoder::new(codec, channels)
}
