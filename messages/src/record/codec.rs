//! The data messages: into protobuf and back without loss.

mod clouds;
mod curves;
mod edges;
mod images;
mod matches;
mod packed;
mod tables;

use thiserror::Error;

use self::clouds::cloud;
use self::curves::curves_message;
use self::edges::edges_message;
use self::images::raw_image;
pub(super) use self::images::raw_image_head;
use self::matches::matches_message;
use self::tables::tables_message;
use super::Codec;
use super::plain::{self, OtherOwned};
use super::wire::{Fields, Fill, Value};
use crate::header::{Header, NONE, Size};
use crate::message::{Message, Owned};
use crate::payload::{AnyView, CurvesView, EdgesView, Evaluation, ImageView, Kind};
use crate::rig::Rail;
use crate::topic::Topic;

#[cfg(target_endian = "big")]
compile_error!("recordings hold memory as it is, which must be little endian");

/// Why a recorded message is not what it should be.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum DecodeError {
    /// It is not protobuf, or its fields have other types.
    #[error("the message is damaged: it is not the protobuf its schema describes")]
    Malformed,
    /// It is laid out in another way than ours.
    #[error("the message's {0} is not as tricurve writes it")]
    Layout(&'static str),
    /// Its image is larger than the largest of the recording.
    #[error("the message is of a {0} image, larger than the recording's largest, {1}")]
    Size(Size, Size),
    /// It has more elements than an image of this size can give.
    #[error("the message has more elements than an image of its size can give")]
    TooMany,
    /// Its indices point outside it.
    #[error("the message is damaged: its indices point outside of it")]
    Unsound,
    /// It refers to another message of its scan, which is not there.
    #[error("the message is not whole without the {} of its scan, which the recording lacks", .0.name())]
    Alone(Kind),
}

/// What an encoded message says besides its payload.
struct Head<'a> {
    nanos: u64,
    size: Size,
    frame: &'a str,
}

impl Codec {
    /// Appends a data message to `out`, as its topic's schema describes it.
    ///
    /// Scan number and time are not part of it: they are the recording's `sequence` and `log_time`. What a message of
    /// the same scan, `beside` it, says already is referred to where that loses nothing.
    pub fn encode(
        &mut self,
        topic: &Topic,
        header: &Header,
        view: AnyView<'_>,
        beside: Beside<'_>,
        out: &mut Vec<u8>,
    ) {
        let frame = match (topic.kind, self.rig.views.get(topic.view as usize)) {
            (Kind::Map | Kind::Growing, _) => Rail::FRAME,
            (_, Some(_)) => &self.optical_frames[topic.view as usize],
            (_, None) => &self.optical_frames[self.reference],
        };
        let head = Head {
            nanos: header.capture_nanos,
            size: header.size(),
            frame,
        };
        match view {
            AnyView::Image(image) => raw_image(&head, "mono8", image.pixels, out),
            AnyView::Raw(image) => raw_image(&head, "mono8", image.pixels, out),
            AnyView::Edges(edges) => {
                edges_message(&head, edges, beside.image, &mut self.columns, out);
            }
            AnyView::Curves(curves) => {
                let scratch = (&mut self.walker, &mut self.scratch);
                curves_message(&head, curves, beside.edges, scratch, out);
            }
            AnyView::Tables(tables) => {
                tables_message(&head, tables, beside.curves, &mut self.places, out);
            }
            AnyView::Matches(matches) => {
                matches_message(&head, matches, beside.curves, &mut self.scratch, out);
            }
            AnyView::Disparity(picture) => raw_image(&head, "32FC1", picture.disparity, out),
            AnyView::Points(points) => cloud(&head, points.points, out),
            AnyView::Map(map) => cloud(&head, map.points, out),
            AnyView::Growing(growing) => cloud(&head, growing.points, out),
            AnyView::Truth(truth) => raw_image(&head, "32FC1", truth.disparity, out),
            AnyView::Evaluation(_) | AnyView::Other(_) => {
                own_head(&head, out);
                plain::write(topic.kind.definition(), view.memory(), out);
            }
        }
    }

    /// Reads a message back, with its header: `sequence` and `nanos` are the recording's `sequence` and `log_time`,
    /// view, channel and position are the topic's.
    ///
    /// `beside` gives another kind's message of the same scan, view and channel.
    ///
    /// # Errors
    /// When the bytes are not what [`encode`](Self::encode) makes of a message of this topic and rig.
    pub fn decode<'a, M: Recorded>(
        &self,
        topic: &Topic,
        sequence: u64,
        nanos: u64,
        bytes: &'a [u8],
        beside: Others<'_, 'a>,
    ) -> Result<Owned<M>, DecodeError> {
        let mut message = Owned::new(self.rig.size);
        self.decode_into(topic, sequence, nanos, bytes, beside, &mut message)?;
        Ok(message)
    }

    /// [`decode`](Self::decode) into a message made before with [`Owned::new`] of the rig's size.
    ///
    /// # Errors
    /// As [`decode`](Self::decode); the message is then worthless.
    pub fn decode_into<'a, M: Recorded>(
        &self,
        topic: &Topic,
        sequence: u64,
        nanos: u64,
        bytes: &'a [u8],
        beside: Others<'_, 'a>,
        message: &mut Owned<M>,
    ) -> Result<(), DecodeError> {
        let header =
            message.fill(|room| self.decode_room::<M>(topic, sequence, nanos, bytes, beside, room));
        let lens = message.header.lens;
        message.header = Header { lens, ..header? };
        match M::is_sound(message.view()) {
            true => Ok(()),
            false => Err(DecodeError::Unsound),
        }
    }

    /// [`decode`](Self::decode) into a room, which may lie in shared memory; gives the header but for the lengths.
    /// Whether what the room then shows is [sound](Recorded::is_sound) is for the caller to see.
    ///
    /// # Errors
    /// As [`decode`](Self::decode); the room is then worthless.
    pub fn decode_room<'a, M: Recorded>(
        &self,
        topic: &Topic,
        sequence: u64,
        nanos: u64,
        bytes: &'a [u8],
        beside: Others<'_, 'a>,
        room: &mut M::Room<'_>,
    ) -> Result<Header, DecodeError> {
        if topic.kind != M::KIND {
            return Err(DecodeError::Layout("kind"));
        }
        let size = M::read(bytes, self.rig.size, beside, room)?;
        Ok(self.header_of(topic, sequence, nanos, size))
    }

    /// Reads a message of others back, with its header, as [`decode`](Self::decode) does.
    ///
    /// # Errors
    /// When the bytes are not what [`encode`](Self::encode) makes of a message of this topic and rig.
    pub fn decode_other(
        &self,
        topic: &Topic,
        sequence: u64,
        nanos: u64,
        bytes: &[u8],
    ) -> Result<(Header, OtherOwned), DecodeError> {
        let (message, size) = OtherOwned::read(topic.kind.definition(), bytes, self.rig.size)?;
        let lens = message.view().lens();
        let header = self.header_of(topic, sequence, nanos, size);
        Ok((Header { lens, ..header }, message))
    }

    fn header_of(&self, topic: &Topic, sequence: u64, nanos: u64, size: Size) -> Header {
        let position_m = match topic.view {
            NONE => 0.0,
            view => self.rig.position_m(view as usize, size),
        };
        Header {
            position_m,
            view: topic.view,
            channel: topic.channel,
            ..Header::new(sequence, nanos, size)
        }
    }
}

/// Messages of one scan, view and channel that another one may refer to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside<'a> {
    /// The view's image, for edges.
    pub image: Option<ImageView<'a>>,
    /// The edges, for curves.
    pub edges: Option<EdgesView<'a>>,
    /// The curves, for R-tables; for matches those of the reference view.
    pub curves: Option<CurvesView<'a>>,
}

/// A message that another one of its scan, view and channel refers to.
#[derive(Clone, Copy, Debug)]
pub enum Said<'a> {
    /// As it was recorded.
    Recorded(&'a [u8]),
    /// Curves that were read before.
    Curves(CurvesView<'a>),
}

/// Gives another kind's message.
type Others<'o, 'a> = &'o dyn Fn(Kind) -> Option<Said<'a>>;

/// A kind of message that can be read back from a recording. Unless it says otherwise it is encoded plainly: every row a
/// message, every section a list of them.
pub trait Recorded: Message {
    /// Reads a payload into the room, and gives the image size it belongs to, which is at most `most`.
    ///
    /// # Errors
    /// When the bytes are not what was written.
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        _beside: Others<'_, 'a>,
        room: &mut Self::Room<'_>,
    ) -> Result<Size, DecodeError> {
        plain::read_into::<Self>(bytes, most, room)
    }

    /// Whether its indices stay inside it.
    fn is_sound(_view: Self::View<'_>) -> bool {
        true
    }
}

fn own_head(head: &Head<'_>, out: &mut Vec<u8>) {
    let mut fill = Fill(out);
    fill.timestamp(1, head.nanos);
    fill.text(2, head.frame);
    fill.fixed32(3, head.size.width);
    fill.fixed32(4, head.size.height);
}

/// Whether nothing was refused.
fn within(refused: usize) -> Result<(), DecodeError> {
    match refused {
        0 => Ok(()),
        _ => Err(DecodeError::TooMany),
    }
}

/// The bytes of a message that this one refers to.
fn recorded<'a>(kind: Kind, beside: Others<'_, 'a>) -> Result<&'a [u8], DecodeError> {
    match beside(kind) {
        Some(Said::Recorded(bytes)) => Ok(bytes),
        Some(Said::Curves(_)) | None => Err(DecodeError::Alone(kind)),
    }
}

/// The words of a packed field.
fn words(bytes: &[u8]) -> Result<impl Iterator<Item = u32>, DecodeError> {
    let (words, rest) = bytes.as_chunks();
    if rest.is_empty() {
        Ok(words.iter().map(|word| u32::from_le_bytes(*word)))
    } else {
        Err(DecodeError::Layout("length"))
    }
}

impl Recorded for Evaluation {}

pub(super) fn read_own<'a>(
    bytes: &'a [u8],
    most: Size,
    mut section: impl FnMut(u32, Value<'a>) -> Result<(), DecodeError>,
) -> Result<Size, DecodeError> {
    let mut size = Size::default();
    for field in Fields::new(bytes) {
        match field? {
            (3, value) => size.width = value.fixed32()?,
            (4, value) => size.height = value.fixed32()?,
            (number, value) => section(number, value)?,
        }
    }
    check_size(size, most)?;
    Ok(size)
}

fn check_size(size: Size, most: Size) -> Result<(), DecodeError> {
    if size.width > most.width || size.height > most.height {
        return Err(DecodeError::Size(size, most));
    }
    Ok(())
}
