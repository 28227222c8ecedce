//! The payloads: plain data in sections, written and read in place.
//!
//! A payload is up to four sections, each an array of one plain type. In shared memory every section starts where
//! the worst case of the largest configured image puts it, so a maker writes straight into the memory its readers
//! see, and nothing is ever cut short.

use std::ops::{Deref, DerefMut};

use bytemuck::{Pod, Zeroable};

use crate::header::{Header, Size};
use crate::topic::Kind;

/// The most sections a payload has.
pub const SECTIONS: usize = 4;

/// Sections start at multiples of this many bytes: a cache line.
pub const ALIGNMENT: usize = 64;

/// A zero-crossing of ∇²G in one channel, with what is known about it.
///
/// The filter makes its numbers whole multiples of small steps, which floats hold exactly: what stands in shared memory is
/// what a recording holds in few bytes, to the bit.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Edge {
    /// Column, sub-pixel when the crossing lies between two columns, in 1/256.
    pub x: f32,
    /// Row, sub-pixel when the crossing lies between two rows, in 1/256; whole for a crossing along a row, and for no other.
    pub y: f32,
    /// Magnitude of the gradient there, in gray levels per pixel, in 1/256.
    pub magnitude: f32,
    /// Direction of the gradient, from dark to bright, in radians in (−π, π], 65,536 steps to the turn; 0 points to the
    /// right, π/2 down.
    pub orientation: f32,
    /// Gray levels beside the crossing, in its row, at [`Edge::PROFILE_OFFSETS`] columns from it; they follow from the view
    /// ([`profile`](crate::profile)).
    pub profile: [u8; 8],
}

impl Edge {
    /// Steps of place to a pixel. A point is matched to a fourteenth of a pixel; rounding adds a thousandth.
    pub const PIXEL_STEPS: u32 = 256;

    /// Steps of magnitude to a gray level per pixel: the largest there can be, 255, is below 65,536.
    pub const MAGNITUDE_STEPS: u32 = 256;

    /// Steps of orientation to half a turn.
    pub const HALF_TURN_STEPS: i32 = 32_768;

    /// The orientation of so many steps, from −32,767 to 32,768, in radians.
    #[inline(always)]
    pub fn orientation_of(steps: i32) -> f32 {
        // By a power of two, so that half a turn is π to the bit.
        steps as f32 * (std::f32::consts::PI / Self::HALF_TURN_STEPS as f32)
    }

    /// The whole number of steps that is nearest to an orientation in [−π, π]; −π is π.
    #[inline(always)]
    pub fn orientation_steps(orientation: f32) -> i32 {
        let half = Self::HALF_TURN_STEPS;
        let steps = whole(orientation * (half as f32 / std::f32::consts::PI));
        if steps <= -half { half } else { steps }
    }

    /// Where the samples of [`Edge::profile`] are taken, in columns from the crossing.
    pub const PROFILE_OFFSETS: [f32; 8] = [-6.0, -4.0, -2.5, -1.25, 1.25, 2.5, 4.0, 6.0];

    /// Whether this crossing was found along a row, so that its row is a whole number.
    pub fn is_in_row(&self) -> bool {
        self.y.fract() == 0.0
    }
}

/// A float of 2²³ and more has no parts left, and shows its units in its lowest bits; this one leaves room for negative
/// numbers.
const UNITS: f32 = 12_582_912.0;

/// The nearest whole number, of two the even one; right up to four million. Unlike rounding by name this does several at a
/// time on any machine.
#[inline(always)]
pub fn nearest(value: f32) -> f32 {
    (value + UNITS) - UNITS
}

/// The same as an integer, which unlike a cast does several at a time.
#[inline(always)]
pub fn whole(value: f32) -> i32 {
    ((value + UNITS).to_bits() as i32).wrapping_sub(UNITS.to_bits() as i32)
}

/// A curve: a run of points and what is common to them.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Curve {
    /// The curve's number, its index in the list.
    pub label: u32,
    /// Index of its first point.
    pub first: u32,
    /// Number of its points.
    pub count: u32,
    /// Label of the curve it branches off, or [`NONE`](crate::NONE).
    pub parent: u32,
    /// Mean column of its points.
    pub x: f32,
    /// Mean row of its points.
    pub y: f32,
    /// Mean gradient magnitude of its points, in gray levels per pixel.
    pub magnitude: f32,
    /// Length along the curve, in pixels.
    pub length: f32,
}

impl Curve {
    /// The curve's points.
    pub fn points<'a>(&self, points: &'a [Edge]) -> &'a [Edge] {
        &points[self.range()]
    }

    /// The indices of the curve's points.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + self.count as usize
    }
}

/// The R-table of one curve.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Table {
    /// The curve's label.
    pub curve: u32,
    /// Index of its first entry.
    pub first: u32,
    /// Number of its entries.
    pub count: u32,
    /// Column of the reference point, the curve's centroid.
    pub x: f32,
    /// Row of the reference point.
    pub y: f32,
    /// Sum of the weights of its entries: what a perfect match would collect.
    pub weight: f32,
}

/// One entry of an R-table; a table's entries are sorted by orientation.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Entry {
    /// Orientation it is filed under, in radians.
    pub orientation: f32,
    /// Columns from the point to the reference point.
    pub rx: f32,
    /// Rows from the point to the reference point.
    pub ry: f32,
    /// What its vote counts.
    pub weight: f32,
    /// Index of the point among the view's curve points.
    pub point: u32,
}

/// A curve of the reference view whose partners were found in the two other views.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Match {
    /// Labels of the three curves, left to right, on a rail the newest frame's first; [`NONE`](crate::NONE) of a view
    /// that took no part. Of more than three views those of [`Rig::named`](crate::Rig::named).
    pub curves: [u32; 3],
    /// Index of its first point.
    pub first: u32,
    /// Number of its points.
    pub count: u32,
    /// Votes collected by length, 0 to 1.
    pub score: f32,
    /// How far the closed loop misses its start, in pixels.
    pub residual: f32,
    /// Mean disparity in pixels.
    pub disparity: f32,
    /// Share of its neighbours in the graph that agree with it, 0 to 1.
    pub support: f32,
}

/// A point of a match, in the reference view.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MatchPoint {
    /// Column.
    pub x: f32,
    /// Row.
    pub y: f32,
    /// Disparity between neighbouring views, in pixels.
    pub disparity: f32,
    /// Confidence, 0 to 1, higher is surer.
    pub score: f32,
    /// Index of the point among the reference view's curve points of this channel.
    pub point: u32,
    /// 0: seen in at least three views; 1: filled in along the curve.
    pub filled: u32,
}

/// A curve of the reference view that was not matched.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Rejected {
    /// Its label.
    pub curve: u32,
    /// Why, the code of a [`Reason`](crate::Reason).
    pub reason: u32,
}

/// A point in space, in the reference camera's optical frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Point {
    /// Metres to the right.
    pub x: f32,
    /// Metres down.
    pub y: f32,
    /// Metres forward.
    pub z: f32,
    /// Column in the reference view.
    pub u: f32,
    /// Row in the reference view.
    pub v: f32,
    /// Disparity between neighbouring views, in pixels.
    pub disparity: f32,
    /// Confidence, 0 to 1, higher is surer.
    pub score: f32,
    /// Label of the reference view's curve in the point's channel.
    pub curve: u32,
    /// Index of the channel it comes from.
    pub channel: u32,
}

/// A point that was seen from several places, in the frame of the rail.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MapPoint {
    /// Metres to the right of where the rail begins.
    pub x: f32,
    /// Metres down.
    pub y: f32,
    /// Metres forward.
    pub z: f32,
    /// Standard deviation of its distance, in metres.
    pub sigma: f32,
    /// Disparity of a baseline, in pixels.
    pub disparity: f32,
    /// The best score of its sightings, 0 to 1, higher is surer.
    pub score: f32,
    /// Frames that saw it.
    pub sightings: u32,
}

/// How points compare with the truth: those of the scan's result, or of one channel's matches.
///
/// A point's error is the least difference to the truth of its row within two pixels: at an occluding contour a
/// zero-crossing may lie on either surface.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Score {
    /// Index of the channel, or [`NONE`](crate::NONE) for the scan's result.
    pub channel: u32,
    /// Edge pixels of the reference view (Canny) whose disparity is known.
    pub edges: u32,
    /// Those of them that have a point within one pixel.
    pub covered: u32,
    /// Points whose true disparity is known.
    pub points: u32,
    /// Points whose error exceeds half a pixel.
    pub over_half: u32,
    /// Points whose error exceeds one pixel.
    pub over_one: u32,
    /// Points whose error exceeds two pixels.
    pub over_two: u32,
    /// Points that differ by over two pixels from every truth within two rows and columns: false targets.
    pub mismatches: u32,
    /// Share of the edge pixels that are covered.
    pub coverage: f32,
    /// Share of the points whose error exceeds half a pixel.
    pub bad_half: f32,
    /// Share of the points whose error exceeds one pixel.
    pub bad_one: f32,
    /// Share of the points whose error exceeds two pixels.
    pub bad_two: f32,
    /// Median of the errors, in pixels.
    pub median: f32,
    /// Points whose error exceeds one pixel and that are on a level contour and right by one pixel within three rows: where
    /// rows are forgiven like columns these are no errors.
    pub forgiven_one: u32,
    /// The same by two pixels.
    pub forgiven_two: u32,
}

impl Score {
    /// Share of the points whose error exceeds one pixel, rows forgiven like columns along level contours.
    pub fn bad_one_rows_too(&self) -> f32 {
        self.rows_too(self.over_one, self.forgiven_one)
    }

    /// The same of two pixels.
    pub fn bad_two_rows_too(&self) -> f32 {
        self.rows_too(self.over_two, self.forgiven_two)
    }

    fn rows_too(&self, over: u32, forgiven: u32) -> f32 {
        let left = f64::from(over.saturating_sub(forgiven));
        (left / f64::from(self.points.max(1))) as f32
    }
}

/// A point of the curve of error over coverage: what the surest points amount to.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Share {
    /// Which share of all points is kept, the surest.
    pub share: f32,
    /// The least score of those kept.
    pub score: f32,
    /// Share of the edge pixels that they cover.
    pub coverage: f32,
    /// Share of them whose error exceeds one pixel.
    pub bad_one: f32,
}

/// A list with fixed room, filled in place.
#[derive(Debug)]
pub struct List<'a, T> {
    slots: &'a mut [T],
    len: usize,
    refused: usize,
}

impl<'a, T: Copy> List<'a, T> {
    /// An empty list with room for as many elements as there are slots.
    pub fn new(slots: &'a mut [T]) -> Self {
        Self {
            slots,
            len: 0,
            refused: 0,
        }
    }

    /// Appends an element; without room for it, it is counted in [`refused`](Self::refused).
    pub fn push(&mut self, element: T) {
        if let Some(slot) = self.slots.get_mut(self.len) {
            *slot = element;
            self.len += 1;
        } else {
            self.refused += 1;
        }
    }

    /// Appends all elements, as [`push`](Self::push) does.
    pub fn extend_from_slice(&mut self, elements: &[T]) {
        let room = elements.len().min(self.slots.len() - self.len);
        self.slots[self.len..self.len + room].copy_from_slice(&elements[..room]);
        self.len += room;
        self.refused += elements.len() - room;
    }

    /// Appends `count` elements whose values are whatever lies there, to be written by the caller; fewer without room.
    pub fn grow(&mut self, count: usize) -> &mut [T] {
        let room = count.min(self.slots.len() - self.len);
        self.refused += count - room;
        let start = self.len;
        self.len += room;
        &mut self.slots[start..start + room]
    }

    /// Keeps the first `len` elements.
    pub fn truncate(&mut self, len: usize) {
        self.len = self.len.min(len);
    }

    /// Forgets all elements and the count of the refused.
    pub fn clear(&mut self) {
        self.len = 0;
        self.refused = 0;
    }

    /// Number of elements there is room for.
    pub fn capacity(&self) -> usize {
        self.slots.len()
    }

    /// Number of elements that found no room.
    pub fn refused(&self) -> usize {
        self.refused
    }
}

impl<T> Deref for List<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.slots[..self.len]
    }
}

impl<T> DerefMut for List<'_, T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.slots[..self.len]
    }
}

/// A kind of message: the names, types and worst cases of its sections.
pub trait Message: 'static {
    /// Which kind.
    const KIND: Kind;
    /// How a reader sees it.
    type View<'a>: Copy + std::fmt::Debug + Into<AnyView<'a>>;
    /// How a maker fills it.
    type Room<'a>;

    /// The most elements each section can have for an image of this size.
    fn capacities(size: Size) -> [usize; SECTIONS];

    /// The bytes of one element of each section.
    fn element_bytes() -> [usize; SECTIONS];

    /// Sees sections of these lengths in a payload laid out for images up to `size`; `None` when they exceed it.
    fn view(words: &[u64], size: Size, lens: [u32; SECTIONS]) -> Option<Self::View<'_>>;

    /// Sees the whole room of a payload laid out for images up to `size`, empty; `None` when the payload is smaller.
    fn room(words: &mut [u64], size: Size) -> Option<Self::Room<'_>>;

    /// How much of the room was filled.
    fn lens(room: &Self::Room<'_>) -> [u32; SECTIONS];

    /// How many elements found no room.
    fn refused(room: &Self::Room<'_>) -> usize;

    /// Copies what a reader sees into a maker's room.
    fn copy(view: Self::View<'_>, room: &mut Self::Room<'_>);

    /// Where each section starts, and where the last ends, in bytes, for images up to `size`.
    fn offsets(size: Size) -> [usize; SECTIONS + 1] {
        let mut offsets = [0; SECTIONS + 1];
        let bytes = Self::element_bytes();
        for (i, capacity) in Self::capacities(size).into_iter().enumerate() {
            offsets[i + 1] = (offsets[i] + capacity * bytes[i]).next_multiple_of(ALIGNMENT);
        }
        offsets
    }

    /// The words a payload needs for images up to `size`.
    fn words(size: Size) -> usize {
        Self::offsets(size)[SECTIONS] / size_of::<u64>()
    }
}

/// Where two messages of one kind differ first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// In which section.
    pub section: &'static str,
    /// At which element.
    pub element: usize,
    /// The element of one message, as text; `None` when it ends before.
    pub one: Option<String>,
    /// The element of the other.
    pub other: Option<String>,
}

/// Compares byte for byte: what is not a number equals itself.
fn difference<T: Pod + std::fmt::Debug>(
    section: &'static str,
    one: &[T],
    other: &[T],
) -> Option<Difference> {
    if bytemuck::cast_slice::<T, u8>(one) == bytemuck::cast_slice::<T, u8>(other) {
        return None;
    }
    let differs = |(a, b): (&T, &T)| bytemuck::bytes_of(a) != bytemuck::bytes_of(b);
    let element = one.iter().zip(other).position(differs);
    let element = element.unwrap_or(one.len().min(other.len()));
    let text = |list: &[T]| list.get(element).map(|value| format!("{value:?}"));
    Some(Difference {
        section,
        element,
        one: text(one),
        other: text(other),
    })
}

/// A section, as text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// What it is called.
    pub name: &'static str,
    /// How many elements it has.
    pub len: usize,
    /// How many bytes they take.
    pub bytes: usize,
    /// The first of them.
    pub first: Vec<String>,
}

fn section<T: std::fmt::Debug>(name: &'static str, elements: &[T], most: usize) -> Section {
    let text = |element: &T| format!("{element:?}");
    Section {
        name,
        len: elements.len(),
        bytes: size_of_val(elements),
        first: elements.iter().take(most).map(text).collect(),
    }
}

/// One kind of message: its three types and its line in the trait.
macro_rules! message {
    ($(#[$about:meta])* $name:ident, $view:ident, $room:ident {
        $($(#[$doc:meta])* $section:ident: $element:ty = |$size:ident| $capacity:expr,)+
    }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug)]
        pub struct $name;

        $(#[$about])*
        ///
        /// As its readers see it.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $view<'a> { $($(#[$doc])* pub $section: &'a [$element],)+ }

        $(#[$about])*
        ///
        /// As its maker fills it.
        #[derive(Debug)]
        pub struct $room<'a> { $($(#[$doc])* pub $section: List<'a, $element>,)+ }

        impl $view<'_> {
            /// Where this differs first from another message, byte for byte.
            pub fn difference(&self, other: &$view<'_>) -> Option<Difference> {
                None$(.or_else(|| difference(stringify!($section), self.$section, other.$section)))+
            }

            /// Its sections, with the first `most` elements of each.
            pub fn sections(&self, most: usize) -> Vec<Section> {
                vec![$(section(stringify!($section), self.$section, most)),+]
            }

            /// The memory of its sections, in order.
            pub fn memory(&self) -> Vec<&[u8]> {
                vec![$(bytemuck::cast_slice(self.$section)),+]
            }
        }

        impl $room<'_> {
            /// Empties every section.
            pub fn clear(&mut self) {
                $(self.$section.clear();)+
            }

            /// What has been filled in so far.
            pub fn as_view(&self) -> $view<'_> {
                $view { $($section: &self.$section,)+ }
            }
        }

        impl Message for $name {
            const KIND: Kind = Kind::$name;
            type View<'a> = $view<'a>;
            type Room<'a> = $room<'a>;

            fn capacities(size: Size) -> [usize; SECTIONS] {
                let mut all = [0; SECTIONS];
                for (slot, capacity) in all.iter_mut().zip([$({ let $size = size; $capacity }),+]) {
                    *slot = capacity;
                }
                all
            }

            fn element_bytes() -> [usize; SECTIONS] {
                let mut all = [1; SECTIONS];
                for (slot, bytes) in all.iter_mut().zip([$(size_of::<$element>()),+]) {
                    *slot = bytes;
                }
                all
            }

            fn view(words: &[u64], size: Size, lens: [u32; SECTIONS]) -> Option<$view<'_>> {
                let bytes: &[u8] = bytemuck::cast_slice(words);
                let offsets = Self::offsets(size);
                let mut sections = offsets.windows(2).zip(lens);
                Some($view { $($section: {
                    let (bounds, len) = sections.next()?;
                    let used = (len as usize).checked_mul(size_of::<$element>())?;
                    bytemuck::try_cast_slice(bytes.get(bounds[0]..bounds[1])?.get(..used)?).ok()?
                },)+ })
            }

            fn room(words: &mut [u64], size: Size) -> Option<$room<'_>> {
                let mut rest: &mut [u8] = bytemuck::cast_slice_mut(words);
                let offsets = Self::offsets(size);
                let mut sections = offsets.windows(2).zip(Self::capacities(size));
                Some($room { $($section: {
                    let (bounds, capacity) = sections.next()?;
                    let section = rest.split_off_mut(..bounds[1] - bounds[0])?;
                    let slots = section.get_mut(..capacity * size_of::<$element>())?;
                    List::new(bytemuck::try_cast_slice_mut(slots).ok()?)
                },)+ })
            }

            fn lens(room: &$room<'_>) -> [u32; SECTIONS] {
                let mut all = [0; SECTIONS];
                for (slot, len) in all.iter_mut().zip([$(room.$section.len()),+]) {
                    *slot = len as u32;
                }
                all
            }

            fn refused(room: &$room<'_>) -> usize {
                0 $(+ room.$section.refused())+
            }

            fn copy(view: $view<'_>, room: &mut $room<'_>) {
                $(room.$section.extend_from_slice(view.$section);)+
            }
        }
    };
}

message! {
    /// A view: 8 bit gray, row by row without gaps; as taken, or rectified where a calibration says how.
    Image, ImageView, ImageRoom {
        /// `height` rows of `width` pixels.
        pixels: u8 = |size| size.pixels(),
    }
}

message! {
    /// A view as its camera took it, beside the rectified one: 8 bit gray, row by row without gaps.
    Raw, RawView, RawRoom {
        /// `height` rows of `width` pixels.
        pixels: u8 = |size| size.pixels(),
    }
}

message! {
    /// The true disparities of the reference view, pixels between neighbouring views; NaN where unknown.
    Truth, TruthView, TruthRoom {
        /// `height` rows of `width` values.
        disparity: f32 = |size| size.pixels(),
    }
}

message! {
    /// The zero-crossings of a view in a channel, in raster order.
    Edges, EdgesView, EdgesRoom {
        /// At most one a pixel.
        edges: Edge = |size| size.pixels(),
    }
}

message! {
    /// The curves of a view in a channel.
    Curves, CurvesView, CurvesRoom {
        /// By label.
        curves: Curve = |size| size.pixels() / 2,
        /// Curve by curve, each in order along the curve.
        points: Edge = |size| size.pixels() + size.pixels() / 2,
    }
}

message! {
    /// The R-tables of a view in a channel, and where its curve points lie.
    Tables, TablesView, TablesRoom {
        /// One a curve, by label.
        tables: Table = |size| size.pixels() / 2,
        /// Table by table.
        entries: Entry = |size| size.pixels() + size.pixels() / 2,
        /// `height` + 1 offsets into `order`: where each row's points start and end. A point between two rows
        /// belongs to the upper.
        rows: u32 = |size| size.height as usize + 1,
        /// Indices of the curve points, row by row, left to right.
        order: u32 = |size| size.pixels() + size.pixels() / 2,
    }
}

message! {
    /// The matched curves of a channel, and why the others were not.
    Matches, MatchesView, MatchesRoom {
        /// In the order of the reference view's curves.
        matches: Match = |size| size.pixels() / 2,
        /// Match by match, along the reference view's curve.
        points: MatchPoint = |size| size.pixels() + size.pixels() / 2,
        /// All other curves of the reference view, in order; of a recording made before there were reasons, none.
        rejected: Rejected = |size| size.pixels() / 2,
    }
}

message! {
    /// The disparity picture in the reference view, pixels between neighbouring views; NaN where unknown.
    Disparity, DisparityView, DisparityRoom {
        /// `height` rows of `width` values.
        disparity: f32 = |size| size.pixels(),
    }
}

message! {
    /// The scan's result: all trusted points of all channels.
    Points, PointsView, PointsRoom {
        /// Row by row, left to right.
        points: Point = |size| size.pixels() + size.pixels() / 2,
    }
}

message! {
    /// What a frame settles of the map: every point of the map comes once.
    Map, MapView, MapRoom {
        /// In raster order of where they were seen last.
        points: MapPoint = |size| 3 * size.pixels(),
    }
}

message! {
    /// Points of the map that are still followed, as they are now.
    Growing, GrowingView, GrowingRoom {
        /// In raster order of where they were seen last, frame by frame, the newest first.
        points: MapPoint = |size| 3 * size.pixels(),
    }
}

message! {
    /// How a scan's points compare with the truth.
    Evaluation, EvaluationView, EvaluationRoom {
        /// First the scan's result, then each channel's matches, coarse to fine.
        scores: Score = |_size| 64,
        /// The result's error over its coverage, the surest points first.
        curve: Share = |_size| 64,
    }
}

/// The kinds in one type, for those who walk all topics.
macro_rules! any_view {
    ($($name:ident($view:ident))+) => {
        /// A message of any kind, as its readers see it.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum AnyView<'a> {
            $(#[doc = concat!("See [`", stringify!($name), "`].")] $name($view<'a>),)+
        }

        impl AnyView<'_> {
            /// Which kind it is.
            pub const fn kind(&self) -> Kind {
                match self {
                    $(Self::$name(_) => Kind::$name,)+
                }
            }
        }

        impl AnyView<'_> {
            /// Where two messages differ first, byte for byte; messages of different kinds differ before everything.
            pub fn difference(&self, other: &AnyView<'_>) -> Option<Difference> {
                match (self, other) {
                    $((Self::$name(one), AnyView::$name(other)) => one.difference(other),)+
                    _ => Some(Difference {
                        section: "kind",
                        element: 0,
                        one: Some(self.kind().name().to_owned()),
                        other: Some(other.kind().name().to_owned()),
                    }),
                }
            }
        }

        impl AnyView<'_> {
            /// Its sections, with the first `most` elements of each.
            pub fn sections(&self, most: usize) -> Vec<Section> {
                match self {
                    $(Self::$name(view) => view.sections(most),)+
                }
            }

            /// The memory of its sections, in order.
            pub fn memory(&self) -> Vec<&[u8]> {
                match self {
                    $(Self::$name(view) => view.memory(),)+
                }
            }
        }

        impl<'a> AnyView<'a> {
            /// Sees a payload of this kind, as [`Message::view`] does.
            pub fn of(kind: Kind, words: &'a [u64], size: Size, lens: [u32; SECTIONS]) -> Option<Self> {
                match kind {
                    $(Kind::$name => $name::view(words, size, lens).map(Self::$name),)+
                }
            }

            /// The words a payload of this kind needs for images up to `size`, as [`Message::words`].
            pub fn words(kind: Kind, size: Size) -> usize {
                match kind {
                    $(Kind::$name => $name::words(size),)+
                }
            }
        }

        $(impl<'a> From<$view<'a>> for AnyView<'a> {
            fn from(view: $view<'a>) -> Self {
                Self::$name(view)
            }
        })+
    };
}

any_view! {
    Image(ImageView)
    Raw(RawView)
    Truth(TruthView)
    Edges(EdgesView)
    Curves(CurvesView)
    Tables(TablesView)
    Matches(MatchesView)
    Disparity(DisparityView)
    Points(PointsView)
    Map(MapView)
    Growing(GrowingView)
    Evaluation(EvaluationView)
}

impl AnyView<'_> {
    /// Whether its indices stay inside it; false for a damaged message.
    pub fn is_sound(&self) -> bool {
        match self {
            Self::Curves(curves) => curves.is_sound(),
            Self::Tables(tables) => tables.is_sound(usize::MAX),
            Self::Matches(matches) => matches.is_sound(),
            Self::Image(_)
            | Self::Raw(_)
            | Self::Truth(_)
            | Self::Edges(_)
            | Self::Disparity(_)
            | Self::Points(_)
            | Self::Map(_)
            | Self::Growing(_)
            | Self::Evaluation(_) => true,
        }
    }
}

impl CurvesView<'_> {
    /// Whether every curve's points exist; false for a damaged message.
    pub fn is_sound(&self) -> bool {
        let fits = |c: &Curve| c.first as usize + c.count as usize <= self.points.len();
        self.curves.iter().all(fits)
    }
}

impl TablesView<'_> {
    /// Whether every index stays inside the message and its curves; false for a damaged message.
    pub fn is_sound(&self, points: usize) -> bool {
        let inside = |t: &Table| t.first as usize + t.count as usize <= self.entries.len();
        self.tables.iter().all(inside)
            && self.entries.iter().all(|e| (e.point as usize) < points)
            && self.order.iter().all(|&p| (p as usize) < points)
            && self.rows.is_sorted()
            && self
                .rows
                .last()
                .is_none_or(|&end| end as usize <= self.order.len())
    }
}

impl MatchesView<'_> {
    /// Whether every match's points exist; false for a damaged message.
    pub fn is_sound(&self) -> bool {
        let fits = |m: &Match| m.first as usize + m.count as usize <= self.points.len();
        self.matches.iter().all(fits)
    }
}

/// A message in memory of one's own: for replay, tests and offline work.
#[derive(Clone)]
pub struct Owned<M> {
    /// Its head.
    pub header: Header,
    words: Vec<u64>,
    room: Size,
    kind: std::marker::PhantomData<M>,
}

impl<M: Message> Owned<M> {
    /// An empty message with room for images up to `size`.
    pub fn new(size: Size) -> Self {
        Self {
            header: Header::new(0, 0, size),
            words: vec![0; M::words(size)],
            room: size,
            kind: std::marker::PhantomData,
        }
    }

    /// Lets `fill` make the payload anew, and gives back what `fill` gives.
    #[expect(
        clippy::missing_panics_doc,
        reason = "the words were made for this size"
    )]
    pub fn fill<R>(&mut self, fill: impl FnOnce(&mut M::Room<'_>) -> R) -> R {
        #[expect(clippy::expect_used, reason = "the words were made for this size")]
        let mut room = M::room(&mut self.words, self.room).expect("room for its own size");
        let result = fill(&mut room);
        self.header.lens = M::lens(&room);
        result
    }

    /// The payload.
    #[expect(clippy::missing_panics_doc, reason = "the lengths came from the room")]
    pub fn view(&self) -> M::View<'_> {
        #[expect(clippy::expect_used, reason = "the lengths came from the room")]
        M::view(&self.words, self.room, self.header.lens).expect("lengths of its own room")
    }
}

impl<M: Message> std::fmt::Debug for Owned<M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Owned")
            .field("kind", &M::KIND)
            .field("header", &self.header)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_of_orientation_is_its_own_nearest_and_half_a_turn_is_pi() {
        for steps in -32_767..=32_768 {
            assert_eq!(Edge::orientation_steps(Edge::orientation_of(steps)), steps);
        }
        let pi = std::f32::consts::PI;
        assert_eq!(Edge::orientation_of(32_768), pi);
        assert_eq!(Edge::orientation_steps(-pi), 32_768);
        assert_eq!(Edge::orientation_of(0).to_bits(), 0);
    }

    #[test]
    fn what_is_written_into_a_room_is_what_a_view_shows() {
        let mut curves = Owned::<Curves>::new(Size::new(33, 17));
        curves.fill(|room| {
            room.curves.push(Curve {
                label: 7,
                ..Curve::default()
            });
            room.points.extend_from_slice(
                &[Edge {
                    x: 1.5,
                    ..Edge::default()
                }; 3],
            );
        });
        let view = curves.view();
        assert_eq!(view.curves[0].label, 7);
        assert_eq!(view.points.len(), 3);
        assert_eq!(view.points[2].x, 1.5);
    }

    #[test]
    fn a_full_list_counts_what_it_refuses() {
        let mut slots = [0u32; 2];
        let mut list = List::new(&mut slots);
        list.push(1);
        list.extend_from_slice(&[2, 3, 4]);
        list.push(5);
        assert_eq!(&*list, &[1, 2]);
        assert_eq!(list.refused(), 3);
    }

    #[test]
    fn lengths_beyond_the_room_are_not_shown() {
        let size = Size::new(8, 4);
        let words = vec![0; Edges::words(size)];
        assert!(Edges::view(&words, size, [32, 0, 0, 0]).is_some());
        // The section may be padded up to a cache line, never beyond.
        assert!(Edges::view(&words, size, [35, 0, 0, 0]).is_none());
        assert!(Edges::view(&words, size, [u32::MAX, 0, 0, 0]).is_none());
    }

    #[test]
    fn every_section_starts_on_a_cache_line() {
        let offsets = Tables::offsets(Size::new(101, 37));
        assert!(offsets.iter().all(|offset| offset % ALIGNMENT == 0));
        assert!(offsets.is_sorted());
    }
}
