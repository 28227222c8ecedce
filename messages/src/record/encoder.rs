//! From a scan's messages to what recorder and viewers take: every topic encoded, and what is derived from it.

use std::collections::BTreeMap;

use super::pictures::Seen;
use super::whole::Whole;
use super::{
    Beside, Channel, Codec, Content, Digest, Digests, Histogram, Level, Span, Statistics, Views,
};
use crate::header::{Header, NONE, Size};
use crate::health::Health;
use crate::ledger::Ledger;
use crate::payload::Kind;
use crate::payload::{AnyView, MapView};
use crate::synchronisation::Synchronisation;
use crate::topic::Topic;

/// Takes the encoded messages of one scan after the other.
pub trait Sink {
    /// A scan begins: its number, and when it was taken, in nanoseconds since 1970.
    fn begin(&mut self, sequence: u64, nanos: u64);
    /// When the scan was taken.
    fn nanos(&self) -> u64;
    /// Whether the message of the channel with this index is to be encoded.
    fn wants(&self, _channel: usize) -> bool {
        true
    }
    /// Lets a message of the channel with this index be appended.
    fn add(&mut self, channel: usize, encode: impl FnOnce(&mut Vec<u8>));
    /// Bytes of the scan's messages so far.
    fn len(&self) -> usize;
    /// Whether the scan has no message so far.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Encodes scans of one rig.
#[derive(Debug)]
pub struct Encoder {
    codec: Codec,
    channels: Vec<Channel>,
    views: Views,
    topics: Vec<Topic>,
    refers: bool,
    /// What the next scan was made with.
    settings: BTreeMap<String, Digest>,
    /// The map so far, and of which size its frames are.
    whole: Whole,
    size: Size,
}

impl Encoder {
    /// For scans of a rig whose disparities and points are those of the view with index `reference`: into these channels
    /// of [`Codec::channels`], where messages refer to others that have a channel too.
    pub fn new(codec: Codec, channels: Vec<Channel>) -> Self {
        Self {
            channels,
            topics: Topic::all(codec.rig()),
            codec,
            views: Views::default(),
            refers: true,
            settings: BTreeMap::new(),
            whole: Whole::default(),
            size: Size::default(),
        }
    }

    /// Takes in what was settled with a frame before those that are encoded: the whole map has it too.
    pub fn recall(&mut self, frame: u64, map: MapView<'_>) {
        self.whole.add(frame, map);
    }

    /// Whether it says what the whole map is.
    pub fn says_whole(&self) -> bool {
        self.index(&Content::Whole).is_some()
    }

    /// Adds to the last scan what is said every few of them only, unless it has it.
    pub fn end(&self, sequence: u64, sink: &mut impl Sink) {
        let nanos = sink.nanos();
        let is_due = self.whole.is_due(sequence);
        if let Some(index) = self
            .index(&Content::Whole)
            .filter(|index| !is_due && sink.wants(*index))
        {
            sink.add(index, |out| {
                self.codec.whole(nanos, self.size, &self.whole, out)
            });
        }
    }

    /// Says what the scans from now on are made with, as [`Digests::of_settings`] gives it: digests say it too.
    pub fn settle(&mut self, settings: BTreeMap<String, Digest>) {
        self.settings = settings;
    }

    /// Whether it makes [`Digests`].
    pub fn proves(&self) -> bool {
        self.index(&Content::Digests).is_some()
    }

    /// Lets every message stand alone: none refers to another one.
    pub fn standing_alone(mut self) -> Self {
        self.refers = false;
        self
    }

    /// Only these topics; transforms and calibrations stay.
    pub fn only(mut self, topic: impl Fn(&str) -> bool) -> Self {
        self.channels.retain(|channel| match channel.content {
            Content::Transforms | Content::Calibration(_) => true,
            _ => topic(&channel.name),
        });
        self
    }

    /// The channels that messages belong to.
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
    pub fn encode(&mut self, scan: &[(Header, AnyView<'_>)], sink: &mut impl Sink) {
        let Some((first, _)) = scan.first() else {
            return sink.begin(0, 0);
        };
        let (sequence, nanos) = (first.sequence, first.capture_nanos);
        sink.begin(sequence, nanos);
        let find = |kind: Kind, view: u32, channel: u32| {
            let is_it = |header: &Header, message: AnyView<'_>| {
                message.kind() == kind
                    && (!kind.is_per_view() || header.view == view)
                    && (!kind.is_per_channel() || header.channel == channel)
            };
            scan.iter()
                .find(|(header, message)| is_it(header, *message))
        };
        let none = NONE;
        let finest = self.codec.rig().channels.len().saturating_sub(1) as u32;
        let points = match find(Kind::Points, none, none) {
            Some((_, AnyView::Points(points))) => Some(*points),
            _ => None,
        };
        // What the disparity picture shows are the points: there are fewer of them than pixels.
        let span = points.and_then(|points| Span::of(points.points.iter().map(|p| p.disparity)));
        let span = span.map(Span::rounded);
        let seen = Seen {
            disparity: match find(Kind::Disparity, none, none) {
                Some((_, AnyView::Disparity(picture))) => Some(picture.disparity),
                _ => None,
            },
            points,
            truth: match find(Kind::Truth, none, none) {
                Some((_, AnyView::Truth(truth))) => Some(truth.disparity),
                _ => None,
            },
            span,
        };
        let matches = match find(Kind::Matches, none, finest) {
            Some((_, AnyView::Matches(matches))) => Some(*matches),
            _ => None,
        };
        let Self {
            codec,
            channels,
            views,
            refers,
            topics,
            settings,
            whole,
            size: of_last,
        } = self;
        let refers = *refers;
        // All views of a scan are of one size, and every message says it.
        let size = first.size();
        *of_last = size;
        // So they say where the camera stood, when it is one that moves.
        let (position_m, sway) = (first.position_m, first.sway);
        // Only what is recorded too can be referred to.
        let beside = |codec: &Codec, topic: &Topic| {
            let of = |kind| {
                let other = codec.beside(topic, kind).filter(|_| refers)?;
                let is_it = |c: &Channel| matches!(&c.content, Content::Data(t) if t == other);
                let found = find(kind, other.view, other.channel)?;
                channels.iter().any(is_it).then_some(found.1)
            };
            Beside {
                image: match of(Kind::Image) {
                    Some(AnyView::Image(image)) => Some(image),
                    _ => None,
                },
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
        if let Some((_, AnyView::Map(map))) = find(Kind::Map, none, none) {
            whole.add(sequence, *map);
        }
        let mut statistics = Statistics {
            scan: sequence,
            ..Statistics::default()
        };
        for (header, message) in scan {
            statistics.add(header, *message);
        }
        statistics.histogram = points
            .zip(span)
            .map(|(points, span)| Histogram::of(points.points, span));
        let of_finest = scan.iter().filter(|(header, _)| header.channel == finest);
        let curves = of_finest.filter_map(|(_, message)| match message {
            AnyView::Curves(curves) => Some(curves.points),
            _ => None,
        });
        statistics.compare(&curves.collect::<Vec<_>>());

        for (index, channel) in channels.iter().enumerate() {
            if !sink.wants(index) {
                continue;
            }
            match &channel.content {
                Content::Transforms => {
                    sink.add(index, |out| {
                        codec.transforms(nanos, size, position_m, &sway, out)
                    });
                }
                Content::Calibration(view) => {
                    sink.add(index, |out| {
                        codec.calibration(*view, nanos, size, position_m, out);
                    });
                }
                Content::Annotations(view) => {
                    let curves = find(Kind::Curves, *view as u32, finest);
                    if let Some((header, AnyView::Curves(curves))) = curves {
                        let matches = matches.zip(span);
                        sink.add(index, |out| {
                            views.annotations(codec, header, *curves, matches, out)
                        });
                    }
                }
                Content::Labels(view) => {
                    let curves = find(Kind::Curves, *view as u32, finest);
                    if let (Some((header, AnyView::Curves(curves))), Some(matches), Some(span)) =
                        (curves, matches, span)
                    {
                        sink.add(index, |out| {
                            views.labels(codec, header, *curves, (matches, span), out)
                        });
                    }
                }
                Content::Rejected(view) => {
                    let curves = find(Kind::Curves, *view as u32, finest);
                    if let (Some((header, AnyView::Curves(curves))), Some(matches)) =
                        (curves, matches)
                    {
                        sink.add(index, |out| {
                            views.rejected(codec, header, *curves, matches, out)
                        });
                    }
                }
                Content::Picture(pictured) if seen.has(*pictured) => {
                    sink.add(index, |out| {
                        views.picture(codec, first, *pictured, &seen, out)
                    });
                }
                Content::Legend(pictured) if seen.has(*pictured) => {
                    sink.add(index, |out| {
                        views.legend(codec, first, *pictured, span, out)
                    });
                }
                Content::Picture(_) | Content::Legend(_) => {}
                Content::Whole => {
                    if whole.is_due(sequence) {
                        sink.add(index, |out| codec.whole(nanos, size, whole, out));
                    }
                }
                Content::Data(topic) => {
                    if let Some((header, message)) = find(topic.kind, topic.view, topic.channel) {
                        let beside = beside(codec, topic);
                        sink.add(index, |out| {
                            codec.encode(topic, header, *message, beside, out)
                        });
                    }
                }
                Content::Digests => {
                    let of = |topic: &Topic| find(topic.kind, topic.view, topic.channel);
                    let known = topics.iter().filter_map(|topic| Some((topic, of(topic)?)));
                    let digest = |(topic, (header, message)): (&Topic, &(Header, AnyView<'_>))| {
                        (topic.name.clone(), Digest::of(header, message))
                    };
                    let digests = Digests {
                        messages: known.map(digest).collect(),
                        settings: settings.clone(),
                    };
                    sink.add(index, |out| digests.encode(nanos, out));
                }
                Content::Statistics
                | Content::Ledger
                | Content::Health
                | Content::Synchronisation
                | Content::Log => {}
            }
        }
        let views = codec.rig().views.len() as u64;
        statistics.matched = match statistics.curves {
            0 => 0.0,
            curves => (views * statistics.matches) as f64 / curves as f64,
        };
        statistics.bytes = sink.len() as u64;
        self.add_json(&Content::Statistics, &statistics, sink);
    }

    /// Adds a line that `node` said to the scan's log.
    pub fn log(&self, level: Level, node: &str, line: &str, sink: &mut impl Sink) {
        let nanos = sink.nanos();
        if let Some(index) = self.index(&Content::Log).filter(|index| sink.wants(*index)) {
            sink.add(index, |out| self.codec.log(nanos, level, node, line, out));
        }
    }

    /// Adds the ledger as it stands with this scan.
    pub fn ledger(&self, ledger: &Ledger, sink: &mut impl Sink) {
        self.add_json(&Content::Ledger, ledger, sink);
    }

    /// Adds how the graph is doing.
    pub fn health(&self, health: &Health, sink: &mut impl Sink) {
        self.add_json(&Content::Health, health, sink);
    }

    /// Adds what came of the cameras' frames, where the source is cameras.
    pub fn synchronisation(&self, account: Option<&Synchronisation>, sink: &mut impl Sink) {
        if let Some(account) = account {
            self.add_json(&Content::Synchronisation, account, sink);
        }
    }

    fn index(&self, content: &Content) -> Option<usize> {
        self.channels
            .iter()
            .position(|channel| channel.content == *content)
    }

    fn add_json(&self, content: &Content, value: &impl serde::Serialize, sink: &mut impl Sink) {
        if let Some(index) = self.index(content).filter(|index| sink.wants(*index)) {
            // Plain structs of numbers and maps of strings: nothing in them can fail to serialize.
            sink.add(index, |out| drop(serde_json::to_writer(out, value)));
        }
    }
}
