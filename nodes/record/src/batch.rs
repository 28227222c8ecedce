//! A scan's messages, encoded and in order: what goes from the node's thread to the writer's.

use std::ops::Range;

use mcap::records::op;
use messages::ledger::Ledger;
use messages::record::{Beside, Channel, Codec, Content, Level, Span, Statistics, Views};
use messages::{AnyView, Header, Kind, Rig, Topic};

use crate::Settings;
use messages::recording::{MESSAGE_HEAD, RECORD_HEAD};

/// The encoded messages of one scan, as the records that stand in the file; made once and used again and again.
#[derive(Debug, Default)]
pub struct Batch {
    sequence: u64,
    nanos: u64,
    is_closing: bool,
    bytes: Vec<u8>,
    records: Vec<(usize, Range<usize>)>,
}

/// What stands in front of a message's bytes: opcode, length, channel, sequence, and the two times.
const HEAD: usize = RECORD_HEAD as usize + MESSAGE_HEAD;

impl Batch {
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

    /// Bytes of all its messages.
    pub fn len(&self) -> usize {
        self.bytes.len() - HEAD * self.records.len()
    }

    /// Whether there is no message in it.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Its messages: index of the channel, and the bytes.
    pub fn messages(&self) -> impl Iterator<Item = (usize, &[u8])> {
        let message = |record: &Range<usize>| &self.bytes[record.start + HEAD..record.end];
        self.records
            .iter()
            .map(move |(channel, record)| (*channel, message(record)))
    }

    /// The records of the messages: index of the channel, and where in [`bytes`](Self::bytes).
    pub(crate) fn records(&self) -> &[(usize, Range<usize>)] {
        &self.records
    }

    /// All records, one after the other.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn begin(&mut self, sequence: u64, nanos: u64) {
        self.sequence = sequence;
        self.nanos = nanos;
        self.is_closing = false;
        self.bytes.clear();
        self.records.clear();
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
    let viewed = [Kind::Curves, Kind::Matches, Kind::Disparity, Kind::Points];
    let mut kinds = Kind::ALL.to_vec();
    kinds
        .retain(|kind| !settings.without.contains(kind) || settings.views && viewed.contains(kind));
    kinds
}

/// Encodes scans of one rig.
#[derive(Debug)]
pub struct Encoder {
    codec: Codec,
    channels: Vec<Channel>,
    views: Views,
    topics: Vec<Topic>,
}

impl Encoder {
    /// For scans of a rig whose disparities and points are those of the view with index `reference`, and of which these
    /// kinds of message are made.
    pub fn new(rig: &Rig, reference: usize, made: &[Kind], settings: &Settings) -> Self {
        let codec = Codec::new(rig.clone(), reference);
        let mut channels = codec.channels(settings.views);
        channels.retain(|channel| match &channel.content {
            Content::Data(topic) => {
                made.contains(&topic.kind) && !settings.without.contains(&topic.kind)
            }
            _ => true,
        });
        Self {
            channels,
            topics: Topic::all(rig),
            codec,
            views: Views::default(),
        }
    }

    /// Records only these topics; transforms and calibrations stay.
    pub fn only(mut self, topic: impl Fn(&str) -> bool) -> Self {
        self.channels.retain(|channel| match channel.content {
            Content::Transforms | Content::Calibration(_) => true,
            _ => topic(&channel.name),
        });
        self
    }

    /// The channels a batch's messages belong to.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The data topics of a complete scan, in order.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Encodes a scan with everything derived from it, in the order of the channels. A topic's message is known by
    /// its kind and its header's view and channel; one that is missing is left out, one that is there twice counts
    /// once.
    pub fn encode(&mut self, scan: &[(&Header, AnyView<'_>)], batch: &mut Batch) {
        let Some((first, _)) = scan.first() else {
            return batch.begin(0, 0);
        };
        let (sequence, nanos) = (first.sequence, first.capture_nanos);
        batch.begin(sequence, nanos);
        let find = |kind: Kind, view: u32, channel: u32| {
            let is_it = |header: &Header, message: AnyView<'_>| {
                message.kind() == kind
                    && (!kind.is_per_view() || header.view == view)
                    && (!kind.is_per_channel() || header.channel == channel)
            };
            scan.iter()
                .find(|(header, message)| is_it(header, *message))
        };
        let none = messages::NONE;
        let finest = self.codec.rig().channels.len().saturating_sub(1) as u32;
        let picture = match find(Kind::Disparity, none, none) {
            Some((header, AnyView::Disparity(picture))) => Some((*header, *picture)),
            _ => None,
        };
        // What the picture shows are the points: there are fewer of them than pixels.
        let span = match find(Kind::Points, none, none) {
            Some((_, AnyView::Points(points))) => {
                Span::of(points.points.iter().map(|p| p.disparity))
            }
            _ => None,
        };
        let matches = match find(Kind::Matches, none, finest) {
            Some((_, AnyView::Matches(matches))) => span.map(|span| (*matches, span)),
            _ => None,
        };
        let Self {
            codec,
            channels,
            views,
            ..
        } = self;
        // All views of a scan are of one size, and every message says it.
        let size = first.size();
        // Only what is recorded too can be referred to.
        let beside = |topic: &Topic| {
            let of = |kind| {
                let is_it = |c: &Channel| {
                    matches!(&c.content, Content::Data(other) if other.kind == kind
                        && (other.view, other.channel) == (topic.view, topic.channel))
                };
                let recorded = channels.iter().any(is_it);
                let found = find(kind, topic.view, topic.channel).filter(|_| recorded);
                found.map(|(_, message)| *message)
            };
            Beside {
                edges: match of(Kind::Edges) {
                    Some(AnyView::Edges(edges)) => Some(edges),
                    _ => None,
                },
                curves: match of(Kind::Curves) {
                    Some(AnyView::Curves(curves)) => Some(curves),
                    _ => None,
                },
            }
        };
        let mut statistics = Statistics {
            scan: sequence,
            ..Statistics::default()
        };
        for (header, message) in scan {
            statistics.add(header, *message);
        }

        for (index, channel) in channels.iter().enumerate() {
            match &channel.content {
                Content::Transforms => {
                    batch.add(index, |out| codec.transforms(nanos, size, out));
                }
                Content::Calibration(view) => {
                    batch.add(index, |out| codec.calibration(*view, nanos, size, out));
                }
                Content::Annotations(view) => {
                    let curves = find(Kind::Curves, *view as u32, finest);
                    if let Some((header, AnyView::Curves(curves))) = curves {
                        batch.add(index, |out| {
                            views.annotations(codec, header, *curves, matches, out)
                        });
                    }
                }
                Content::Picture => {
                    if let Some((header, picture)) = picture {
                        batch.add(index, |out| {
                            views.picture(codec, header, picture, span, out)
                        });
                    }
                }
                Content::Data(topic) => {
                    if let Some((header, message)) = find(topic.kind, topic.view, topic.channel) {
                        let beside = beside(topic);
                        batch.add(index, |out| {
                            codec.encode(topic, header, *message, beside, out)
                        });
                    }
                }
                Content::Statistics | Content::Ledger | Content::Log => {}
            }
        }
        statistics.bytes = batch.len() as u64;
        self.add_json(&Content::Statistics, &statistics, batch);
    }

    /// Begins the last batch, which holds no scan: what is said when all are there, at the last one's time.
    pub fn close(&self, sequence: u64, nanos: u64, batch: &mut Batch) {
        batch.begin(sequence, nanos);
        batch.is_closing = true;
    }

    /// Adds a line that `node` said to the scan's log.
    pub fn log(&self, level: Level, node: &str, line: &str, batch: &mut Batch) {
        let nanos = batch.nanos;
        if let Some(index) = self.index(&Content::Log) {
            batch.add(index, |out| self.codec.log(nanos, level, node, line, out));
        }
    }

    /// Adds the ledger as it stands with this scan.
    pub fn ledger(&self, ledger: &Ledger, batch: &mut Batch) {
        self.add_json(&Content::Ledger, ledger, batch);
    }

    fn index(&self, content: &Content) -> Option<usize> {
        self.channels
            .iter()
            .position(|channel| channel.content == *content)
    }

    fn add_json(&self, content: &Content, value: &impl serde::Serialize, batch: &mut Batch) {
        if let Some(index) = self.index(content) {
            // Plain structs of numbers and maps of strings: nothing in them can fail to serialize.
            batch.add(index, |out| drop(serde_json::to_writer(out, value)));
        }
    }
}
