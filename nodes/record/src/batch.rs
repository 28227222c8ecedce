//! A scan's messages, encoded and in order: what goes from the node's thread to the writer's.

use std::ops::Range;

use messages::ledger::Ledger;
use messages::record::{Channel, Codec, Content, Level, Span, Statistics, Views};
use messages::{AnyView, Header, Kind, Rig, Topic};

use crate::Settings;

/// The encoded messages of one scan; made once and used again and again.
#[derive(Debug, Default)]
pub struct Batch {
    sequence: u64,
    nanos: u64,
    bytes: Vec<u8>,
    messages: Vec<(usize, Range<usize>)>,
}

impl Batch {
    /// The scan.
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// When it was taken, in nanoseconds since 1970.
    pub fn nanos(&self) -> u64 {
        self.nanos
    }

    /// Bytes of all its messages.
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Whether there is no message in it.
    pub fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    /// Its messages: index of the channel, and the bytes.
    pub fn messages(&self) -> impl Iterator<Item = (usize, &[u8])> {
        self.messages
            .iter()
            .map(|(channel, range)| (*channel, &self.bytes[range.clone()]))
    }

    fn begin(&mut self, sequence: u64, nanos: u64) {
        self.sequence = sequence;
        self.nanos = nanos;
        self.bytes.clear();
        self.messages.clear();
    }

    fn add(&mut self, channel: usize, encode: impl FnOnce(&mut Vec<u8>)) {
        let start = self.bytes.len();
        encode(&mut self.bytes);
        self.messages.push((channel, start..self.bytes.len()));
    }
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
    /// For scans of a rig whose disparities and points are those of the view with index `reference`.
    pub fn new(rig: &Rig, reference: usize, settings: &Settings) -> Self {
        let codec = Codec::new(rig.clone(), reference);
        Self {
            channels: codec.channels(settings.views),
            topics: Topic::all(rig),
            codec,
            views: Views::default(),
        }
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
        let span = picture.and_then(|(_, picture)| Span::of(picture.disparity));
        let matches = match find(Kind::Matches, none, finest) {
            Some((_, AnyView::Matches(matches))) => span.map(|span| (*matches, span)),
            _ => None,
        };
        let size_of = |view: usize| {
            find(Kind::Image, view as u32, none).map_or(self.codec.rig().size, |(h, _)| h.size())
        };
        let mut statistics = Statistics {
            scan: sequence,
            ..Statistics::default()
        };
        for (header, message) in scan {
            statistics.add(header, *message);
        }

        let (codec, views) = (&self.codec, &mut self.views);
        for (index, channel) in self.channels.iter().enumerate() {
            match &channel.content {
                Content::Transforms => {
                    batch.add(index, |out| {
                        codec.transforms(nanos, size_of(codec.reference()), out)
                    });
                }
                Content::Calibration(view) => {
                    batch.add(index, |out| {
                        codec.calibration(*view, nanos, size_of(*view), out)
                    });
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
                        batch.add(index, |out| codec.encode(topic, header, *message, out));
                    }
                }
                Content::Statistics | Content::Ledger | Content::Log => {}
            }
        }
        statistics.bytes = batch.len() as u64;
        self.add_json(&Content::Statistics, &statistics, batch);
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
