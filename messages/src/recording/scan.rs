//! One scan of a recording: its messages, and what they say.

use std::collections::BTreeMap;
use std::ops::Range;

use super::error::ReadError;
use crate::record::{
    Codec, DIGESTS, DecodeError, Digest, Digests, OtherOwned, Recorded, Said, TRANSFORMS, VERSIONS,
};
use crate::{AnyView, CurvesView, Header, Kind, Owned, Stage, Topic};

/// The messages of one scan.
#[derive(Clone, Debug, Default)]
pub struct Scan {
    /// Its number.
    pub sequence: u64,
    /// When it was taken, in nanoseconds since 1970.
    pub nanos: u64,
    /// The memory of the chunks its messages lie in.
    pub(super) chunks: Vec<Vec<u8>>,
    /// Topic, chunk, and where in it the message lies.
    pub(super) messages: Vec<(String, usize, Range<usize>)>,
    /// Topics of which there is another message that says something else.
    pub contradicted: Vec<String>,
}

impl Scan {
    /// Its messages, topic by topic, in the order they were recorded.
    pub fn messages(&self) -> impl Iterator<Item = (&str, &[u8])> {
        self.messages
            .iter()
            .map(|(topic, chunk, range)| (topic.as_str(), &self.chunks[*chunk][range.clone()]))
    }

    /// The message of a topic.
    pub fn message(&self, topic: &str) -> Option<&[u8]> {
        self.messages()
            .find(|(name, _)| *name == topic)
            .map(|(_, bytes)| bytes)
    }

    /// The message of a data topic, read into a room; gives its header but for the lengths. Whether what the room then
    /// shows is [sound](Recorded::is_sound) is for the caller to see.
    ///
    /// `curves` are those of the topic's view and channel, where they were read before.
    ///
    /// # Errors
    /// When there is none, or it is damaged.
    pub fn decode_room<M: Recorded>(
        &self,
        codec: &Codec,
        topic: &Topic,
        curves: Option<CurvesView<'_>>,
        room: &mut M::Room<'_>,
    ) -> Result<Header, ReadError> {
        let beside = |kind| match (kind, curves) {
            (Kind::Curves, Some(curves)) => Some(Said::Curves(curves)),
            _ => self.beside(codec, topic, kind),
        };
        let bytes = self.needed(topic)?;
        let header = codec
            .decode_room::<M>(topic, self.sequence, self.nanos, bytes, &beside, room)
            .map_err(|source| self.damaged(topic, source))?;
        self.placed(codec, header)
    }

    /// The header with where the camera stood, when it is one that moves.
    fn placed(&self, codec: &Codec, header: Header) -> Result<Header, ReadError> {
        if codec.rig().rail.is_none() {
            return Ok(header);
        }
        let transforms = self.message(TRANSFORMS);
        let said =
            transforms.and_then(|said| Some((codec.position_in(said)?, codec.sway_in(said))));
        let (position_m, sway) = said.ok_or_else(|| ReadError::NoMessage {
            scan: self.sequence,
            topic: TRANSFORMS.to_owned(),
        })?;
        Ok(Header {
            position_m,
            sway,
            ..header
        })
    }

    fn beside(&self, codec: &Codec, topic: &Topic, kind: Kind) -> Option<Said<'_>> {
        let bytes = self.message(&codec.beside(topic, kind)?.name)?;
        Some(Said::Recorded(bytes))
    }

    /// The error that says a message's indices lead out of it.
    pub fn unsound(&self, topic: &Topic) -> ReadError {
        self.damaged(topic, DecodeError::Unsound)
    }

    fn damaged(&self, topic: &Topic, source: DecodeError) -> ReadError {
        ReadError::Message {
            scan: self.sequence,
            topic: topic.name.clone(),
            source,
        }
    }

    fn needed(&self, topic: &Topic) -> Result<&[u8], ReadError> {
        self.message(&topic.name)
            .ok_or_else(|| ReadError::NoMessage {
                scan: self.sequence,
                topic: topic.name.clone(),
            })
    }

    /// The message of a data topic, as its makers made it.
    ///
    /// # Errors
    /// When there is none, or it is damaged.
    pub fn decode<M: Recorded>(&self, codec: &Codec, topic: &Topic) -> Result<Owned<M>, ReadError> {
        let beside = |kind| self.beside(codec, topic, kind);
        let mut message = codec
            .decode(
                topic,
                self.sequence,
                self.nanos,
                self.needed(topic)?,
                &beside,
            )
            .map_err(|source| self.damaged(topic, source))?;
        message.header = self.placed(codec, message.header)?;
        Ok(message)
    }

    /// The message of a topic of others.
    ///
    /// # Errors
    /// When there is none, or it is damaged.
    pub fn decode_other(
        &self,
        codec: &Codec,
        topic: &Topic,
    ) -> Result<(Header, OtherOwned), ReadError> {
        let bytes = self.needed(topic)?;
        let (header, message) = codec
            .decode_other(topic, self.sequence, self.nanos, bytes)
            .map_err(|source| self.damaged(topic, source))?;
        Ok((self.placed(codec, header)?, message))
    }

    /// Shows the message of a data topic of whatever kind.
    ///
    /// # Errors
    /// When there is none, or it is damaged.
    pub fn show<R>(
        &self,
        codec: &Codec,
        topic: &Topic,
        look: impl FnOnce(&Header, AnyView<'_>) -> R,
    ) -> Result<R, ReadError> {
        macro_rules! shown {
            ($kind:ident) => {{
                let message = self.decode::<crate::$kind>(codec, topic)?;
                Ok(look(&message.header, message.view().into()))
            }};
        }
        of_kind!(topic.kind, shown, _ => {
            let (header, message) = self.decode_other(codec, topic)?;
            Ok(look(&header, AnyView::Other(message.view())))
        })
    }

    /// Its digests, where it is one of a proof.
    ///
    /// # Errors
    /// When they are damaged.
    pub fn digests(&self) -> Result<Option<Digests>, ReadError> {
        let digests = self.message(DIGESTS).map(Digests::decode).transpose();
        digests.map_err(|source| ReadError::Message {
            scan: self.sequence,
            topic: DIGESTS.to_owned(),
            source,
        })
    }

    /// Of one of a proof: its messages that are not what their digests say, and settings, where these are known, that are not
    /// those it was made with, a sentence each.
    pub fn faults(
        &self,
        codec: &Codec,
        settings: Option<&BTreeMap<String, Digest>>,
    ) -> Vec<String> {
        let scan = self.sequence;
        let digests = match self.digests() {
            Ok(Some(digests)) => digests,
            Ok(None) => return vec![format!("scan {scan} has no {DIGESTS}")],
            Err(error) => return vec![error.to_string()],
        };
        let mut faults = Vec::new();
        if let Some(name) = settings.and_then(|settings| digests.changed(settings)) {
            faults.push(match name {
                "rig" => format!(
                    "the rig (views, channels, calibration) is not the one that scan {scan} was made with: it was changed after \
                     it was recorded"
                ),
                VERSIONS => format!(
                    "the versions of the stages are not those that scan {scan} was made with: they were changed after it was \
                     recorded, or a node that made it is not in this program"
                ),
                name if Stage::named(name).is_none() => format!(
                    "scan {scan} was made with the node {name}, which this program does not have: use the program that \
                     recorded it"
                ),
                name => format!(
                    "the settings of {name} are not those that scan {scan} was made with: they were changed after it was recorded"
                ),
            });
        }
        for topic in Topic::all(codec.rig()) {
            if self.message(&topic.name).is_none() {
                continue;
            }
            let name = &topic.name;
            let is_it = |header: &Header, view: AnyView<'_>| {
                digests.messages.get(name) == Some(&Digest::of(header, &view))
            };
            match self.show(codec, &topic, is_it) {
                Ok(true) => {}
                Ok(false) => faults.push(format!(
                    "{name} of scan {scan} is not what its digest says: one of the two was changed after it was recorded"
                )),
                Err(error) => faults.push(error.to_string()),
            }
        }
        faults
    }
}
