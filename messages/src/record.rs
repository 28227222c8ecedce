//! The recording's encodings: every topic as protobuf or JSON that others can read, and the data back from it.
//!
//! ```text
//! Header + XView ─► Codec::encode ─► protobuf, schema embedded ─► Codec::decode ─► Owned<X>, the same bytes
//! ```
//!
//! Data topics are lossless. Edges are columns of small whole numbers, which they are where they are made; what is no
//! such number goes in as the memory it is, its layout declared field by field beside it, and small records are messages
//! of their own. What another message of the scan says already is not said again: the gray levels beside edges follow from
//! the image, curves name their edges, R-tables the points of their curves. Topics for people (curves over each image, the disparity picture in colours, why
//! curves were rejected) and about the scene (calibration, frames) are derived from the data.

mod along;
mod annotations;
mod codec;
mod comments;
mod edges;
mod encoder;
mod overlay;
mod pictures;
mod plain;
mod proof;
mod refer;
mod said;
mod scene;
mod schema;
mod statistics;
mod views;
mod walks;
mod whole;
mod wire;

pub use codec::{Beside, DecodeError, Recorded, Said};
pub use encoder::{Encoder, Sink};
pub use pictures::{Pictured, Seen};
pub use plain::OtherOwned;
pub use proof::{DIGESTS, Digest, Digests, VERSIONS};
pub use said::{CameraSaid, frame_said, places_said, size_said};
pub use scene::{Level, SWAY};
pub use schema::Schema;
pub use statistics::{Histogram, Milliseconds, Statistics};
pub use views::{Colours, Span, Views, paint};
pub use whole::WHOLE;

/// The topic that says where everything stands.
pub const TRANSFORMS: &str = "tf";

use crate::header::NONE;
use crate::payload::Kind;
use crate::rig::{Rail, Rig};
use crate::topic::Topic;

/// What a recording's channel carries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Content {
    /// The frames from `world` to every camera.
    Transforms,
    /// The calibration of the view with this index.
    Calibration(usize),
    /// The messages of a data topic.
    Data(Topic),
    /// The curves of the view with this index, drawn over its image.
    Annotations(usize),
    /// What can be said of matched curves over a view's image, by its index.
    Labels(usize),
    /// The curves of the view with this index that were not matched, and why, drawn over its image.
    Rejected(usize),
    /// A picture in the reference view.
    Picture(Pictured),
    /// What its colours mean, over it.
    Legend(Pictured),
    /// On a rail the whole map so far, thinned, every few frames.
    Whole,
    /// [`Statistics`] of each scan.
    Statistics,
    /// The [`Digests`] of each scan.
    Digests,
    /// The [`Ledger`](crate::ledger::Ledger).
    Ledger,
    /// The [`Health`](crate::health::Health) of the running graph.
    Health,
    /// The [`Synchronisation`](crate::synchronisation::Synchronisation) of cameras.
    Synchronisation,
    /// What the nodes have to say.
    Log,
}

/// Which topics for people there are besides the data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shown {
    /// Curves over each image, the disparity picture in colours.
    pub views: bool,
    /// Pictures of the points' errors and confidence.
    pub inspected: bool,
    /// Number, score and disparity of matched curves, over each image.
    pub labels: bool,
    /// Curves that were not matched, over each image.
    pub rejected: bool,
    /// What came of the frames of cameras.
    pub cameras: bool,
    /// Digests, in a proof.
    pub digests: bool,
}

impl Shown {
    /// All that a graph that runs has.
    pub const ALL: Self = Self {
        views: true,
        inspected: true,
        labels: true,
        rejected: true,
        cameras: true,
        digests: false,
    };
    /// All that a recording may have.
    pub const RECORDED: Self = Self {
        digests: true,
        ..Self::ALL
    };
}

/// A channel of a recording: a topic and how its messages are to be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// The topic's name.
    pub name: String,
    /// What it carries.
    pub content: Content,
    /// How its messages are to be read.
    pub schema: Schema,
}

/// Turns messages of one rig into what is recorded, and back.
#[derive(Clone, Debug)]
pub struct Codec {
    rig: Rig,
    reference: usize,
    optical_frames: Vec<String>,
    topics: Vec<Topic>,
    columns: edges::Columns,
    walker: walks::Walker,
    scratch: Vec<u32>,
    places: Vec<u64>,
}

impl Codec {
    /// For the messages of a rig whose disparities and points are those of the view with index `reference`, or of
    /// the last view when there are fewer.
    pub fn new(rig: Rig, reference: usize) -> Self {
        let optical = rig
            .views
            .iter()
            .map(|view| format!("{}_optical", view.name));
        Self {
            optical_frames: optical.collect(),
            reference: reference.min(rig.views.len().saturating_sub(1)),
            topics: Topic::all(&rig),
            columns: edges::Columns::default(),
            walker: walks::Walker::default(),
            scratch: Vec::new(),
            places: Vec::new(),
            rig,
        }
    }

    /// The topic of another kind that messages of a topic may refer to: of the same channel where it has channels, of the
    /// same view where it has views, and of the reference view where the topic has none.
    pub fn beside(&self, topic: &Topic, kind: Kind) -> Option<&Topic> {
        let view = match topic.view {
            NONE => self.reference as u32,
            view => view,
        };
        let is_it = |other: &&Topic| {
            other.kind == kind
                && (other.view == view || !kind.is_per_view())
                && (other.channel == topic.channel || !kind.is_per_channel())
        };
        self.topics.iter().find(is_it)
    }

    /// Whether messages of this topic may refer to those of the topic of this name, at once or by way of others.
    pub fn refers(&self, topic: &Topic, name: &str) -> bool {
        // Only there it stands where a camera that moves was.
        if name == TRANSFORMS && self.rig.rail.is_some() {
            return true;
        }
        refer::referred(topic.kind).iter().any(|&kind| {
            let is_it = |other: &Topic| other.name == name || self.refers(other, name);
            self.beside(topic, kind).is_some_and(is_it)
        })
    }

    /// Whether messages of this topic may themselves refer to those of the topic of this name.
    pub fn refers_itself(&self, topic: &Topic, name: &str) -> bool {
        let is_it = |kind: &Kind| self.beside(topic, *kind).is_some_and(|t| t.name == name);
        refer::referred(topic.kind).iter().any(is_it)
    }

    /// Whether the topic of this name is one of data.
    pub fn is_data(&self, name: &str) -> bool {
        self.topics.iter().any(|topic| topic.name == name)
    }

    /// The frames that transforms name: `world`, `rig`, every view's optical one, and that of a rail.
    pub fn frames(&self) -> impl Iterator<Item = &str> {
        let optical = self.optical_frames.iter().map(String::as_str);
        let rail = self.rig.rail.map(|_| Rail::FRAME);
        ["world", "rig"].into_iter().chain(optical).chain(rail)
    }

    /// The frame that points are given in: of a moving camera, that of the whole map.
    pub fn points_frame(&self) -> &str {
        match self.rig.rail {
            Some(_) => Rail::FRAME,
            None => &self.optical_frames[self.reference],
        }
    }

    /// The rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Which of the three labels of a match is a curve of this view: of more than three views only three are named.
    pub fn named(&self, view: usize) -> Option<usize> {
        let named = self.rig.named(self.reference);
        named.iter().position(|&named| named == view)
    }

    /// Index of the view that disparities and points belong to.
    pub fn reference(&self) -> usize {
        self.reference
    }

    /// Those of [all channels](Self::channels) that carry something where these kinds of message are made.
    pub fn channels_of(&self, shown: Shown, made: &[Kind]) -> Vec<Channel> {
        let mut channels = self.channels(shown);
        channels.retain(|channel| match &channel.content {
            Content::Data(topic) => made.contains(&topic.kind),
            Content::Whole => made.contains(&Kind::Map),
            // Only some sources know a truth.
            Content::Picture(Pictured::Error) | Content::Legend(Pictured::Error) => {
                made.contains(&Kind::Truth)
            }
            _ => true,
        });
        channels
    }

    /// All channels of a recording, in the order a scan's messages stand in it: what viewers show comes first, so
    /// that they find it together.
    pub fn channels(&self, shown: Shown) -> Vec<Channel> {
        let channel = |name: String, content, schema| Channel {
            name,
            content,
            schema,
        };
        let camera = |view: usize, what| format!("camera/{}/{what}", self.rig.views[view].name);
        let views = 0..self.rig.views.len();

        let mut all = vec![channel(
            TRANSFORMS.to_owned(),
            Content::Transforms,
            Schema::transforms(),
        )];
        all.extend(views.clone().map(|view| {
            channel(
                camera(view, "calibration"),
                Content::Calibration(view),
                Schema::calibration(),
            )
        }));
        if shown.views {
            all.extend(views.clone().map(|view| {
                let name = camera(view, "annotations");
                channel(name, Content::Annotations(view), Schema::annotations())
            }));
        }
        if shown.labels {
            all.extend(views.clone().map(|view| {
                let name = camera(view, "labels");
                channel(name, Content::Labels(view), Schema::annotations())
            }));
        }
        if shown.rejected {
            all.extend(views.map(|view| {
                let name = camera(view, "rejected");
                channel(name, Content::Rejected(view), Schema::annotations())
            }));
        }
        for pictured in Pictured::ALL {
            let is_shown = match pictured {
                Pictured::Disparity => shown.views,
                Pictured::Error | Pictured::Confidence => shown.inspected,
            };
            if is_shown {
                let (picture, legend) = (Content::Picture(pictured), Content::Legend(pictured));
                let name = pictured.topic();
                all.push(channel(name.to_owned(), picture, Schema::image()));
                let name = format!("{name}/legend");
                all.push(channel(name, legend, Schema::annotations()));
            }
        }
        if shown.views && self.rig.rail.is_some() {
            let schema = Schema::of(Kind::Map);
            all.push(channel(WHOLE.to_owned(), Content::Whole, schema));
        }
        all.push(channel(
            "statistics".to_owned(),
            Content::Statistics,
            Schema::statistics(),
        ));
        if shown.digests {
            all.push(channel(
                DIGESTS.to_owned(),
                Content::Digests,
                Schema::digests(),
            ));
        }
        all.push(channel(
            "ledger".to_owned(),
            Content::Ledger,
            Schema::ledger(),
        ));
        all.push(channel(
            "health".to_owned(),
            Content::Health,
            Schema::health(),
        ));
        if shown.cameras {
            all.push(channel(
                "synchronisation".to_owned(),
                Content::Synchronisation,
                Schema::synchronisation(),
            ));
        }
        all.push(channel("log".to_owned(), Content::Log, Schema::log()));
        all.extend(Topic::all(&self.rig).into_iter().map(|topic| {
            channel(
                topic.name.clone(),
                Content::Data(topic.clone()),
                Schema::of(topic.kind),
            )
        }));
        all
    }
}
