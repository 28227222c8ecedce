//! The data messages: into protobuf and back without loss.

use bytemuck::Pod;
use thiserror::Error;

use super::Codec;
use super::along;
use super::edges::{self, Columns};
use super::plain::{self, OtherOwned};
use super::refer::{
    entries_follow, entry_of, order, order_follows, rows, rows_follow, sorted_entries,
    tables_follow,
};
use super::schema::{CLOUD_HEIGHT, CLOUD_WIDTH};
use super::walks::{Heads, Walker, are_plain, write_heads};
use super::whole::Whole;
use super::wire::{Fields, Fill, Value, varint_len};
use crate::elements::{Curve, Edge, Entry};
use crate::header::{Header, NONE, Size};
use crate::list::List;
use crate::message::{Message, Owned};
use crate::payload::{
    AnyView, Curves, CurvesRoom, CurvesView, Disparity, DisparityRoom, Edges, EdgesRoom, EdgesView,
    Evaluation, Growing, GrowingRoom, Image, ImageRoom, ImageView, Kind, Map, MapRoom, Matches,
    MatchesRoom, MatchesView, Points, PointsRoom, Raw, RawRoom, Tables, TablesRoom, TablesView,
    Truth, TruthRoom,
};
use crate::profile::Steady;
use crate::rig::Rail;
use crate::row::{Column, Row};
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

/// A kind of message that can be read back from a recording: as it is [encoded plainly](super::plain), unless it says
/// otherwise.
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

// ---- images ----

fn raw_image<T: Pod>(head: &Head<'_>, encoding: &str, pixels: &[T], out: &mut Vec<u8>) {
    let step = head.size.width * size_of::<T>() as u32;
    raw_image_head(head.nanos, head.frame, head.size, encoding, step, out);
    Fill(out).bytes(6, bytemuck::cast_slice(pixels));
}

/// A `foxglove.RawImage` up to its data, which is field 6.
pub(super) fn raw_image_head(
    nanos: u64,
    frame: &str,
    size: Size,
    encoding: &str,
    step: u32,
    out: &mut Vec<u8>,
) {
    let mut fill = Fill(out);
    fill.timestamp(1, nanos);
    fill.fixed32(2, size.width);
    fill.fixed32(3, size.height);
    fill.text(4, encoding);
    fill.fixed32(5, step);
    fill.text(7, frame);
}

fn read_raw_image<T: Pod>(
    bytes: &[u8],
    most: Size,
    encoding: &str,
    pixels: &mut List<'_, T>,
) -> Result<Size, DecodeError> {
    let (size, data) = raw_pixels::<T>(bytes, most, encoding)?;
    pixels.clear();
    append(data, pixels)?;
    Ok(size)
}

/// The memory of an image's pixels, and their size.
fn raw_pixels<'a, T: Pod>(
    bytes: &'a [u8],
    most: Size,
    encoding: &str,
) -> Result<(Size, &'a [u8]), DecodeError> {
    let mut size = Size::default();
    let (mut step, mut said, mut data) = (0, &[][..], &[][..]);
    for field in Fields::new(bytes) {
        match field? {
            (2, value) => size.width = value.fixed32()?,
            (3, value) => size.height = value.fixed32()?,
            (4, value) => said = value.bytes()?,
            (5, value) => step = value.fixed32()?,
            (6, value) => data = value.bytes()?,
            _ => {}
        }
    }
    check_size(size, most)?;
    if said != encoding.as_bytes() {
        return Err(DecodeError::Layout("pixel encoding"));
    }
    if step as usize != size.width as usize * size_of::<T>() {
        return Err(DecodeError::Layout("row step"));
    }
    if data.len() != size.pixels() * size_of::<T>() {
        return Err(DecodeError::Layout("number of pixels"));
    }
    Ok((size, data))
}

impl Recorded for Image {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        _: Others<'_, 'a>,
        room: &mut ImageRoom<'_>,
    ) -> Result<Size, DecodeError> {
        read_raw_image(bytes, most, "mono8", &mut room.pixels)
    }
}

impl Recorded for Raw {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        _: Others<'_, 'a>,
        room: &mut RawRoom<'_>,
    ) -> Result<Size, DecodeError> {
        read_raw_image(bytes, most, "mono8", &mut room.pixels)
    }
}

impl Recorded for Truth {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        _: Others<'_, 'a>,
        room: &mut TruthRoom<'_>,
    ) -> Result<Size, DecodeError> {
        read_raw_image(bytes, most, "32FC1", &mut room.disparity)
    }
}

impl Recorded for Disparity {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        _: Others<'_, 'a>,
        room: &mut DisparityRoom<'_>,
    ) -> Result<Size, DecodeError> {
        read_raw_image(bytes, most, "32FC1", &mut room.disparity)
    }
}

// ---- point clouds ----

impl Codec {
    /// Appends the whole map so far, a `foxglove.PointCloud` in the rail's frame.
    pub(super) fn whole(&self, nanos: u64, size: Size, whole: &Whole, out: &mut Vec<u8>) {
        let head = Head {
            nanos,
            size,
            frame: Rail::FRAME,
        };
        cloud(&head, whole.spots(), out);
    }
}

fn cloud<T: Row>(head: &Head<'_>, rows: &[T], out: &mut Vec<u8>) {
    let mut fill = Fill(out);
    fill.timestamp(1, head.nanos);
    fill.text(2, head.frame);
    // Some viewers take a missing pose amiss.
    fill.message(3, |pose| {
        pose.message(1, |_| {});
        pose.message(2, |orientation| orientation.double(4, 1.0));
    });
    fill.fixed32(4, size_of::<T>() as u32);
    columns::<T>(5, &mut fill);
    fill.fixed32(CLOUD_WIDTH, head.size.width);
    fill.fixed32(CLOUD_HEIGHT, head.size.height);
    fill.bytes(6, bytemuck::cast_slice(rows));
}

fn read_cloud<T: Row>(
    bytes: &[u8],
    most: Size,
    rows: &mut List<'_, T>,
) -> Result<Size, DecodeError> {
    let (packed, size) = Packed::of_cloud::<T>(bytes)?;
    check_size(size, most)?;
    rows.clear();
    packed.append(rows)?;
    Ok(size)
}

impl Recorded for Edges {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        beside: Others<'_, 'a>,
        room: &mut EdgesRoom<'_>,
    ) -> Result<Size, DecodeError> {
        room.clear();
        let recorded = RecordedEdges::of(bytes, most)?;
        let slots = room.edges.grow(recorded.len());
        recorded.read(beside, slots)?;
        Ok(recorded.size)
    }
}

/// Edges as they were recorded: as columns, or as the memory they are.
enum EdgesAs<'a> {
    Columns(edges::Read<'a>),
    Memory(Packed<'a>),
}

/// A message of edges, as far as read.
struct RecordedEdges<'a> {
    size: Size,
    edges: EdgesAs<'a>,
}

impl<'a> RecordedEdges<'a> {
    fn of(bytes: &'a [u8], most: Size) -> Result<Self, DecodeError> {
        // Edges were clouds of points once, whose third field is a pose; ours is a width.
        let is_cloud =
            |field: Result<(u32, Value<'_>), _>| matches!(field, Ok((3, Value::Bytes(_))));
        if Fields::new(bytes).any(is_cloud) {
            let (packed, size) = Packed::of_cloud::<Edge>(bytes)?;
            check_size(size, most)?;
            let edges = EdgesAs::Memory(packed);
            return Ok(Self { size, edges });
        }
        let mut columns = edges::Read::default();
        let mut memory = None;
        let size = read_own(bytes, most, |number, value| {
            match value {
                Value::Bytes(bytes) if number == edges::AS_THEY_ARE => {
                    memory = Some(Packed::read::<Edge>(bytes)?);
                }
                Value::Bytes(bytes) => drop(columns.field(number, bytes)),
                _ => {}
            }
            Ok(())
        })?;
        let edges = match memory {
            Some(packed) => EdgesAs::Memory(packed),
            None => EdgesAs::Columns(columns),
        };
        Ok(Self { size, edges })
    }

    fn len(&self) -> usize {
        match &self.edges {
            EdgesAs::Columns(columns) => columns.len(),
            EdgesAs::Memory(packed) => packed.data.len() / size_of::<Edge>(),
        }
    }

    /// Reads all edges, or says that there is no room for them.
    fn read(&self, beside: Others<'_, 'a>, slots: &mut [Edge]) -> Result<(), DecodeError> {
        self.read_without_profiles(slots)?;
        if let EdgesAs::Columns(columns) = &self.edges
            && columns.lacks_profiles()
        {
            let image = recorded(Kind::Image, beside)?;
            let (size, pixels) = raw_pixels::<u8>(image, self.size, "mono8")?;
            if size != self.size {
                return Err(DecodeError::Layout("image size"));
            }
            let mut steady = Steady::new(size);
            steady.take(pixels, size);
            steady.fill(slots);
        }
        Ok(())
    }

    /// The same; what follows from the image is left out.
    fn read_without_profiles(&self, slots: &mut [Edge]) -> Result<(), DecodeError> {
        if slots.len() < self.len() {
            return Err(DecodeError::TooMany);
        }
        match &self.edges {
            EdgesAs::Columns(columns) => columns.build(self.size, slots),
            EdgesAs::Memory(packed) => {
                let memory: &mut [u8] = bytemuck::cast_slice_mut(slots);
                memory.copy_from_slice(packed.data);
                Ok(())
            }
        }
    }
}

/// Kinds of message that are a cloud of points and nothing else.
macro_rules! clouds {
    ($($kind:ident($room:ident))+) => {$(
        impl Recorded for $kind {
            fn read<'a>(
                bytes: &'a [u8],
                most: Size,
                _: Others<'_, 'a>,
                room: &mut $room<'_>,
            ) -> Result<Size, DecodeError> {
                read_cloud(bytes, most, &mut room.points)
            }
        }
    )+};
}
clouds! { Points(PointsRoom) Map(MapRoom) Growing(GrowingRoom) }

// ---- our own messages ----

fn own_head(head: &Head<'_>, out: &mut Vec<u8>) {
    let mut fill = Fill(out);
    fill.timestamp(1, head.nanos);
    fill.text(2, head.frame);
    fill.fixed32(3, head.size.width);
    fill.fixed32(4, head.size.height);
}

fn edges_message(
    head: &Head<'_>,
    view: EdgesView<'_>,
    image: Option<ImageView<'_>>,
    columns: &mut Columns,
    out: &mut Vec<u8>,
) {
    own_head(head, out);
    let pixels = image.map(|image| image.pixels);
    if !columns.write(view.edges, head.size, pixels, out) {
        packed(edges::AS_THEY_ARE, view.edges, out);
    }
}

fn curves_message(
    head: &Head<'_>,
    view: CurvesView<'_>,
    edges: Option<EdgesView<'_>>,
    (walker, scratch): (&mut Walker, &mut Vec<u32>),
    out: &mut Vec<u8>,
) {
    own_head(head, out);
    let CurvesView { curves, points } = view;
    if !are_plain(curves, points.len()) {
        messages(5, curves, out);
        return packed(6, points, out);
    }
    write_heads(curves, scratch, out);
    let follow = |edges: EdgesView<'_>| walker.write(curves, points, edges.edges, head.size, out);
    if !edges.is_some_and(follow) {
        packed(6, points, out);
    }
}

/// What of R-tables follows from curves is said by a field of this number, which is 1 then.
const TABLES_FOLLOW: u32 = 11;
/// The same of the index by rows.
const ROWS_FOLLOW: u32 = 12;

fn tables_message(
    head: &Head<'_>,
    view: TablesView<'_>,
    curves: Option<CurvesView<'_>>,
    places: &mut Vec<u64>,
    out: &mut Vec<u8>,
) {
    own_head(head, out);
    let weights = |out: &mut Vec<u8>| {
        let is_one = |entry: &Entry| entry.weight.to_bits() == 1f32.to_bits();
        if !view.entries.iter().all(is_one) {
            let mut fill = Fill(out);
            fill.open(10, size_of::<f32>() * view.entries.len());
            for entry in view.entries {
                fill.0.extend_from_slice(&entry.weight.to_le_bytes());
            }
        }
    };
    if curves.is_some_and(|curves| tables_follow(view, curves)) {
        Fill(out).varint(TABLES_FOLLOW, 1);
        weights(out);
    } else {
        messages(5, view.tables, out);
        if curves.is_some_and(|curves| entries_follow(view, curves)) {
            let mut fill = Fill(out);
            fill.open(9, size_of::<u32>() * view.entries.len());
            for entry in view.entries {
                fill.0.extend_from_slice(&entry.point.to_le_bytes());
            }
            weights(out);
        } else {
            packed(6, view.entries, out);
        }
    }
    let order_follows = curves.is_some_and(|curves| order_follows(view, curves.points, places));
    if order_follows && rows_follow(view, head.size) {
        return Fill(out).varint(ROWS_FOLLOW, 1);
    }
    Fill(out).bytes(7, bytemuck::cast_slice(view.rows));
    if !order_follows {
        Fill(out).bytes(8, bytemuck::cast_slice(view.order));
    }
}

fn matches_message(
    head: &Head<'_>,
    view: MatchesView<'_>,
    curves: Option<CurvesView<'_>>,
    scratch: &mut Vec<u32>,
    out: &mut Vec<u8>,
) {
    own_head(head, out);
    messages(5, view.matches, out);
    if !curves.is_some_and(|curves| along::write(view.points, curves.points, scratch, out)) {
        packed(6, view.points, out);
    }
    messages(7, view.rejected, out);
}

impl Recorded for Curves {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        beside: Others<'_, 'a>,
        room: &mut CurvesRoom<'_>,
    ) -> Result<Size, DecodeError> {
        room.clear();
        let recorded = RecordedCurves::of(bytes, most)?;
        let curves = &mut room.curves;
        recorded.curves(|curve| {
            curves.push(curve);
            within(curves.refused())
        })?;
        let points = &mut room.points;
        recorded.points(true, beside, |more| {
            points.extend_from_slice(more);
            within(points.refused())
        })?;
        Ok(recorded.size)
    }

    fn is_sound(view: Self::View<'_>) -> bool {
        view.is_sound()
    }
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

/// The points of curves as they were recorded.
#[derive(Default)]
enum PointsAs<'a> {
    /// Walks from pixel to pixel, or none.
    #[default]
    Walks,
    /// As the memory they are.
    Memory(Packed<'a>),
    /// As indices of edges, which they were once.
    Indices(&'a [u8]),
}

/// A message of curves, as far as read.
struct RecordedCurves<'a> {
    bytes: &'a [u8],
    size: Size,
    heads: Heads<'a>,
    points: PointsAs<'a>,
}

impl<'a> RecordedCurves<'a> {
    fn of(bytes: &'a [u8], most: Size) -> Result<Self, DecodeError> {
        let mut heads = Heads::default();
        let mut points = PointsAs::default();
        let size = read_own(bytes, most, |number, value| {
            match (number, value) {
                (6, value) => points = PointsAs::Memory(Packed::read::<Edge>(value.bytes()?)?),
                (7, value) => points = PointsAs::Indices(value.bytes()?),
                (_, Value::Bytes(bytes)) => drop(heads.field(number, bytes)),
                _ => {}
            }
            Ok(())
        })?;
        Ok(Self {
            bytes,
            size,
            heads,
            points,
        })
    }

    /// Hands out the curves, whether they are columns or messages of their own.
    fn curves(
        &self,
        mut take: impl FnMut(Curve) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        for field in Fields::new(self.bytes) {
            if let (5, value) = field? {
                take(row_of_message(value.bytes()?)?)?;
            }
        }
        self.heads.curves(take)
    }

    /// Hands out the points, one after the other; what follows from the image is in them where `profiles` are wanted.
    fn points(
        &self,
        profiles: bool,
        beside: Others<'_, 'a>,
        mut take: impl FnMut(&[Edge]) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        let edges = || {
            let edges = RecordedEdges::of(recorded(Kind::Edges, beside)?, self.size)?;
            if edges.len() > self.size.pixels() {
                return Err(DecodeError::TooMany);
            }
            let mut slots = vec![Edge::default(); edges.len()];
            match profiles {
                true => edges.read(beside, &mut slots)?,
                false => edges.read_without_profiles(&mut slots)?,
            }
            Ok(slots)
        };
        match &self.points {
            PointsAs::Walks if !self.heads.walks() => Ok(()),
            PointsAs::Walks => self.heads.points(&edges()?, self.size, take),
            PointsAs::Memory(packed) => (0..)
                .map_while(|index| packed.row(index))
                .try_for_each(|edge| take(&[edge])),
            PointsAs::Indices(indices) => {
                let edges = edges()?;
                words(indices)?.try_for_each(|index| {
                    take(&[*edges.get(index as usize).ok_or(DecodeError::Unsound)?])
                })
            }
        }
    }
}

/// Curves that a message refers to.
enum CurvesBeside<'a> {
    Read(CurvesView<'a>),
    Recorded(Vec<Curve>, Vec<Edge>),
}

impl<'a> CurvesBeside<'a> {
    /// Those beside a message; their points have no profiles.
    fn of(most: Size, beside: Others<'_, 'a>) -> Result<Self, DecodeError> {
        let bytes = match beside(Kind::Curves) {
            Some(Said::Curves(curves)) => return Ok(Self::Read(curves)),
            Some(Said::Recorded(bytes)) => bytes,
            None => return Err(DecodeError::Alone(Kind::Curves)),
        };
        let [most_curves, most_points, ..] = Curves::capacities(most);
        let recorded = RecordedCurves::of(bytes, most)?;
        let (mut curves, mut points) = (Vec::new(), Vec::new());
        recorded.curves(|curve| {
            curves.push(curve);
            within(curves.len().saturating_sub(most_curves))
        })?;
        recorded.points(false, beside, |more| {
            points.extend_from_slice(more);
            within(points.len().saturating_sub(most_points))
        })?;
        Ok(Self::Recorded(curves, points))
    }

    fn view(&self) -> CurvesView<'_> {
        match self {
            Self::Read(view) => *view,
            Self::Recorded(curves, points) => CurvesView { curves, points },
        }
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

impl Recorded for Tables {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        beside: Others<'_, 'a>,
        room: &mut TablesRoom<'_>,
    ) -> Result<Size, DecodeError> {
        room.clear();
        let (mut points, mut weights, mut has_order) = (None, None, false);
        let (mut tables_follow, mut rows_follow) = (false, false);
        let size = read_own(bytes, most, |number, value| match number {
            5 => read_message(value.bytes()?, &mut room.tables),
            6 => read_packed(value.bytes()?, &mut room.entries),
            7 => append(value.bytes()?, &mut room.rows),
            8 => {
                has_order = true;
                append(value.bytes()?, &mut room.order)
            }
            9 => {
                points = Some(words(value.bytes()?)?);
                Ok(())
            }
            10 => {
                weights = Some(words(value.bytes()?)?);
                Ok(())
            }
            TABLES_FOLLOW => {
                tables_follow = value == Value::Varint(1);
                Ok(())
            }
            ROWS_FOLLOW => {
                rows_follow = value == Value::Varint(1);
                Ok(())
            }
            _ => Ok(()),
        })?;
        if points.is_none() && !tables_follow && has_order {
            return Ok(size);
        }
        let curves = CurvesBeside::of(most, beside)?;
        let curves = curves.view();
        let mut next_weight = || match &mut weights {
            Some(weights) => weights
                .next()
                .map(f32::from_bits)
                .ok_or(DecodeError::Unsound),
            None => Ok(1.0),
        };
        if tables_follow {
            room.tables.clear();
            room.entries.clear();
            sorted_entries(curves, &mut next_weight, room)?;
        } else if let Some(mut points) = points {
            for table in room.tables.iter() {
                for point in points.by_ref().take(table.count as usize) {
                    let given = Entry {
                        point,
                        weight: next_weight()?,
                        ..Entry::default()
                    };
                    let point = curves
                        .points
                        .get(point as usize)
                        .ok_or(DecodeError::Unsound)?;
                    room.entries.push(entry_of(table.x, table.y, point, &given));
                }
            }
            if points.next().is_some() {
                return Err(DecodeError::Unsound);
            }
        }
        within(room.entries.refused() + room.tables.refused())?;
        if rows_follow {
            let rows = rows(curves.points, size).ok_or(DecodeError::Unsound)?;
            room.rows.clear();
            room.rows.extend_from_slice(&rows);
            within(room.rows.refused())?;
        }
        if !has_order {
            let mut by_row = Vec::new();
            order(&room.rows, curves.points, &mut by_row).ok_or(DecodeError::Unsound)?;
            append(bytemuck::cast_slice(&by_row), &mut room.order)?;
        }
        Ok(size)
    }

    fn is_sound(view: Self::View<'_>) -> bool {
        // The curve points themselves are another message's; no index can exceed all there can be.
        view.is_sound(usize::MAX)
    }
}

impl Recorded for Matches {
    fn read<'a>(
        bytes: &'a [u8],
        most: Size,
        beside: Others<'_, 'a>,
        room: &mut MatchesRoom<'_>,
    ) -> Result<Size, DecodeError> {
        room.clear();
        let mut columns = along::Read::default();
        let size = read_own(bytes, most, |number, value| match number {
            5 => read_message(value.bytes()?, &mut room.matches),
            6 => read_packed(value.bytes()?, &mut room.points),
            7 => read_message(value.bytes()?, &mut room.rejected),
            _ => {
                if let Value::Bytes(bytes) = value {
                    columns.field(number, bytes);
                }
                Ok(())
            }
        })?;
        if columns.is_some() {
            room.points.clear();
            let curves = CurvesBeside::of(most, beside)?;
            columns.points(curves.view().points, |point| {
                room.points.push(point);
                within(room.points.refused())
            })?;
        }
        Ok(size)
    }

    fn is_sound(view: Self::View<'_>) -> bool {
        view.is_sound()
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

// ---- rows as messages: word n is field n + 1 ----

fn messages<T: Row>(field: u32, rows: &[T], out: &mut Vec<u8>) {
    plain::write_rows(field, size_of::<T>(), bytemuck::cast_slice(rows), out);
}

fn read_message<T: Row>(bytes: &[u8], rows: &mut List<'_, T>) -> Result<(), DecodeError> {
    rows.push(row_of_message(bytes)?);
    within(rows.refused())
}

fn row_of_message<T: Row>(bytes: &[u8]) -> Result<T, DecodeError> {
    let mut row = T::zeroed();
    plain::read_row(bytes, bytemuck::bytes_of_mut(&mut row))?;
    Ok(row)
}

// ---- rows as packed memory ----

fn packed<T: Row>(field: u32, rows: &[T], out: &mut Vec<u8>) {
    let data: &[u8] = bytemuck::cast_slice(rows);
    let described: usize = T::COLUMNS.iter().map(|column| 2 + column_len(column)).sum();
    let mut fill = Fill(out);
    fill.open(
        field,
        described + 5 + 1 + varint_len(data.len() as u64) + data.len(),
    );
    columns::<T>(1, &mut fill);
    fill.fixed32(2, size_of::<T>() as u32);
    fill.bytes(3, data);
}

/// A `foxglove.PackedElementField` for every column.
fn columns<T: Row>(field: u32, fill: &mut Fill<'_>) {
    for column in T::COLUMNS {
        fill.open(field, column_len(column));
        fill.text(1, column.name);
        fill.fixed32(2, column.offset as u32);
        fill.varint(3, column.number as u64);
    }
}

fn column_len(column: &Column) -> usize {
    (2 + column.name.len()) + 5 + 2
}

fn read_packed<T: Row>(bytes: &[u8], rows: &mut List<'_, T>) -> Result<(), DecodeError> {
    Packed::read::<T>(bytes)?.append(rows)
}

/// Packed memory and its description, as far as read.
#[derive(Default)]
struct Packed<'a> {
    columns: usize,
    stride: u32,
    data: &'a [u8],
}

impl<'a> Packed<'a> {
    /// Reads a `tricurve.Packed`.
    fn read<T: Row>(bytes: &'a [u8]) -> Result<Self, DecodeError> {
        let mut packed = Self::default();
        for field in Fields::new(bytes) {
            match field? {
                (1, value) => packed.column::<T>(value.bytes()?)?,
                (2, value) => packed.stride = value.fixed32()?,
                (3, value) => packed.data = value.bytes()?,
                _ => {}
            }
        }
        packed.check::<T>()
    }

    /// Reads a `foxglove.PointCloud`, and the image size it says.
    fn of_cloud<T: Row>(bytes: &'a [u8]) -> Result<(Self, Size), DecodeError> {
        let mut size = Size::default();
        let mut packed = Self::default();
        for field in Fields::new(bytes) {
            match field? {
                (4, value) => packed.stride = value.fixed32()?,
                (5, value) => packed.column::<T>(value.bytes()?)?,
                (6, value) => packed.data = value.bytes()?,
                (CLOUD_WIDTH, value) => size.width = value.fixed32()?,
                (CLOUD_HEIGHT, value) => size.height = value.fixed32()?,
                _ => {}
            }
        }
        Ok((packed.check::<T>()?, size))
    }

    /// Checks the description of the next column.
    fn column<T: Row>(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        let (mut name, mut offset, mut number) = (&[][..], 0, 0);
        for field in Fields::new(bytes) {
            match field? {
                (1, value) => name = value.bytes()?,
                (2, value) => offset = value.fixed32()?,
                (3, Value::Varint(value)) => number = value,
                _ => {}
            }
        }
        let is_ours = T::COLUMNS.get(self.columns).is_some_and(|c| {
            c.name.as_bytes() == name && c.offset == offset as usize && c.number as u64 == number
        });
        self.columns += 1;
        if is_ours {
            Ok(())
        } else {
            Err(DecodeError::Layout("columns"))
        }
    }

    fn check<T: Row>(self) -> Result<Self, DecodeError> {
        if self.columns != T::COLUMNS.len() || self.stride as usize != size_of::<T>() {
            return Err(DecodeError::Layout("columns"));
        }
        if !self.data.len().is_multiple_of(size_of::<T>()) {
            return Err(DecodeError::Layout("length"));
        }
        Ok(self)
    }

    fn append<T: Row>(&self, rows: &mut List<'_, T>) -> Result<(), DecodeError> {
        append(self.data, rows)
    }

    /// One row.
    fn row<T: Row>(&self, index: usize) -> Option<T> {
        let start = index.checked_mul(size_of::<T>())?;
        let bytes = self.data.get(start..)?.get(..size_of::<T>())?;
        Some(bytemuck::pod_read_unaligned(bytes))
    }
}

/// Appends elements that stand in memory as they are.
fn append<T: Pod>(bytes: &[u8], list: &mut List<'_, T>) -> Result<(), DecodeError> {
    if !bytes.len().is_multiple_of(size_of::<T>()) {
        return Err(DecodeError::Layout("length"));
    }
    let slots: &mut [u8] = bytemuck::cast_slice_mut(list.grow(bytes.len() / size_of::<T>()));
    if slots.len() != bytes.len() {
        return Err(DecodeError::TooMany);
    }
    slots.copy_from_slice(bytes);
    Ok(())
}
