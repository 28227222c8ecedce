//! What a message is: sections of rows, written and read in place, and everything that others must know of it.
//!
//! A message is defined once, by [`message!`](crate::message!): which node makes it of what, which views and channels have one,
//! its sections with the rows in them. Its layout in shared memory, its topics, its schema and encoding in a recording, its
//! comparison and its text follow from that.
//!
//! A payload is up to four sections, each an array of one plain type. In shared memory every section starts where
//! the worst case of the largest configured image puts it, so a maker writes straight into the memory its readers
//! see, and nothing is ever cut short.

use bytemuck::Pod;

use crate::header::{Header, Size};
use crate::payload::{AnyView, Kind};
use crate::row::RowType;

/// The most sections a payload has.
pub const SECTIONS: usize = 4;

/// Sections start at multiples of this many bytes: a cache line.
pub const ALIGNMENT: usize = 64;

/// Everything that is known of a kind of message without its type.
#[derive(Debug)]
pub struct Definition {
    /// The first part of its topics' names, or all of it.
    pub name: &'static str,
    /// What its schema is called.
    pub schema: &'static str,
    /// What it is.
    pub about: &'static str,
    /// The node that makes it.
    pub stage: &'static str,
    /// The kinds of message that the node makes it of.
    pub from: &'static [Kind],
    /// Whether each view has a topic of its own.
    pub is_per_view: bool,
    /// Whether each channel has a topic of its own.
    pub is_per_channel: bool,
    /// Its sections, at most [`SECTIONS`].
    pub sections: &'static [SectionType],
}

/// A section of a kind of message.
#[derive(Debug)]
pub struct SectionType {
    /// Its name.
    pub name: &'static str,
    /// What it holds.
    pub about: &'static str,
    /// The type of its rows.
    pub row: RowType,
    /// The most rows it can have for an image of a size.
    pub capacity: fn(Size) -> usize,
}

impl Definition {
    /// The most rows each section can have for an image of this size.
    pub fn capacities(&self, size: Size) -> [usize; SECTIONS] {
        let mut all = [0; SECTIONS];
        for (slot, section) in all.iter_mut().zip(self.sections) {
            *slot = (section.capacity)(size);
        }
        all
    }

    /// The bytes of one row of each section.
    pub fn element_bytes(&self) -> [usize; SECTIONS] {
        let mut all = [1; SECTIONS];
        for (slot, section) in all.iter_mut().zip(self.sections) {
            *slot = section.row.bytes;
        }
        all
    }

    /// Where each section starts, and where the last ends, in bytes, for images up to `size`.
    pub fn offsets(&self, size: Size) -> [usize; SECTIONS + 1] {
        let mut offsets = [0; SECTIONS + 1];
        let bytes = self.element_bytes();
        for (i, capacity) in self.capacities(size).into_iter().enumerate() {
            offsets[i + 1] = (offsets[i] + capacity * bytes[i]).next_multiple_of(ALIGNMENT);
        }
        offsets
    }

    /// The words a payload needs for images up to `size`.
    pub fn words(&self, size: Size) -> usize {
        self.offsets(size)[SECTIONS] / size_of::<u64>()
    }
}

/// Whether `word` is among these, which must all be `view` or `channel`.
#[doc(hidden)]
pub const fn is_per(all: &[&str], word: &str) -> bool {
    let (mut i, mut is_there) = (0, false);
    while i < all.len() {
        assert!(
            is_same(all[i], "view") || is_same(all[i], "channel"),
            "a message is there per view, per channel, per both or once"
        );
        is_there |= is_same(all[i], word);
        i += 1;
    }
    is_there
}

const fn is_same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut i = 0;
    while i < one.len() && i < other.len() && one[i] == other[i] {
        i += 1;
    }
    i == one.len() && i == other.len()
}

/// A kind of message, with its types: how makers fill it and how readers see it. [`message!`](crate::message!) writes it.
pub trait Message: Sized + 'static {
    /// What is known of it without these types.
    const DEFINITION: &'static Definition;
    /// Which kind.
    const KIND: Kind;
    /// How a reader sees it.
    type View<'a>: Copy + std::fmt::Debug + Into<AnyView<'a>>;
    /// How a maker fills it.
    type Room<'a>;

    /// Sees sections of these lengths in a payload laid out for images up to `size`; `None` when they exceed it.
    fn view(words: &[u64], size: Size, lens: [u32; SECTIONS]) -> Option<Self::View<'_>>;

    /// Sees the whole room of a payload laid out for images up to `size`, empty; `None` when the payload is smaller.
    fn room(words: &mut [u64], size: Size) -> Option<Self::Room<'_>>;

    /// How much of the room was filled.
    fn lens(room: &Self::Room<'_>) -> [u32; SECTIONS];

    /// How many rows found no room.
    fn refused(room: &Self::Room<'_>) -> usize;

    /// Empties the room.
    fn clear(room: &mut Self::Room<'_>);

    /// Appends a row, given as its memory, to the section of this number; one of another length is refused.
    fn push(room: &mut Self::Room<'_>, section: usize, row: &[u8]);

    /// Copies what a reader sees into a maker's room.
    fn copy(view: Self::View<'_>, room: &mut Self::Room<'_>);

    /// The most rows each section can have for an image of this size.
    fn capacities(size: Size) -> [usize; SECTIONS] {
        Self::DEFINITION.capacities(size)
    }

    /// The bytes of one row of each section.
    fn element_bytes() -> [usize; SECTIONS] {
        Self::DEFINITION.element_bytes()
    }

    /// Where each section starts, and where the last ends, in bytes, for images up to `size`.
    fn offsets(size: Size) -> [usize; SECTIONS + 1] {
        Self::DEFINITION.offsets(size)
    }

    /// The words a payload needs for images up to `size`.
    fn words(size: Size) -> usize {
        Self::DEFINITION.words(size)
    }
}

/// Where two messages of one kind differ first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// In which section.
    pub section: &'static str,
    /// At which row.
    pub element: usize,
    /// The row of one message, as text; `None` when it ends before.
    pub one: Option<String>,
    /// The row of the other.
    pub other: Option<String>,
}

/// Compares byte for byte: what is not a number equals itself.
#[doc(hidden)]
pub fn difference<T: Pod + std::fmt::Debug>(
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
    /// How many rows it has.
    pub len: usize,
    /// How many bytes they take.
    pub bytes: usize,
    /// The first of them.
    pub first: Vec<String>,
}

/// A section with its first rows as text.
#[doc(hidden)]
pub fn section<T: std::fmt::Debug>(name: &'static str, elements: &[T], most: usize) -> Section {
    let text = |element: &T| format!("{element:?}");
    Section {
        name,
        len: elements.len(),
        bytes: size_of_val(elements),
        first: elements.iter().take(most).map(text).collect(),
    }
}

/// Defines a kind of message: its name, the node that makes it and of what, whether there is one per view and per channel, and
/// its sections, each with the type of its rows and the most rows that an image of a size can give.
///
/// It makes three types: the kind itself, what its readers see, and what its maker fills.
///
/// ```
/// messages::message! {
///     /// How many zero-crossings are how strong.
///     pub Strengths, StrengthsView, StrengthsRoom = "strengths" by "strengths" from [messages::Kind::Edges] per [view, channel] {
///         /// One more than 255 classes, the weakest first.
///         counts: u32 = |_size| 256,
///     }
/// }
/// use messages::{Message, Owned, Size};
/// let mut strengths = Owned::<Strengths>::new(Size::new(64, 48));
/// strengths.fill(|room| room.counts.extend_from_slice(&[3, 1, 4]));
/// assert_eq!(strengths.view().counts, [3, 1, 4]);
/// assert_eq!(Strengths::DEFINITION.sections[0].name, "counts");
/// ```
#[macro_export]
macro_rules! message {
    ($(#[doc = $about:literal])+ $vis:vis $name:ident, $view:ident, $room:ident
     = $topic:literal by $stage:literal from [$($from:expr),*] per [$($per:ident),*] { $($sections:tt)+ }) => {
        $crate::message! { @types $crate::Kind::Other($crate::Other::of(Self::DEFINITION));
            $(#[doc = $about])+ $vis $name, $view, $room = $topic by $stage from [$($from),*] per [$($per),*] { $($sections)+ }
        }

        impl<'a> From<$view<'a>> for $crate::AnyView<'a> {
            fn from(view: $view<'a>) -> Self {
                Self::Other($crate::OtherView::new(
                    <$name as $crate::Message>::DEFINITION,
                    &view.memory(),
                ))
            }
        }

        $crate::recorded! { $name }
    };

    (@types $kind:expr; $(#[doc = $about:literal])+ $vis:vis $name:ident, $view:ident, $room:ident
     = $topic:literal by $stage:literal from [$($from:expr),*] per [$($per:ident),*] {
        $($(#[doc = $doc:literal])+ $section:ident: $element:ty = |$size:ident| $capacity:expr,)+
    }) => {
        $(#[doc = $about])+
        #[derive(Clone, Copy, Debug)]
        $vis struct $name;

        $(#[doc = $about])+
        ///
        /// As its readers see it.
        #[derive(Clone, Copy, Debug, PartialEq)]
        $vis struct $view<'a> { $($(#[doc = $doc])+ pub $section: &'a [$element],)+ }

        $(#[doc = $about])+
        ///
        /// As its maker fills it.
        #[derive(Debug)]
        $vis struct $room<'a> { $($(#[doc = $doc])+ pub $section: $crate::List<'a, $element>,)+ }

        impl<'a> $view<'a> {
            /// Where this differs first from another message, byte for byte.
            pub fn difference(&self, other: &$view<'_>) -> Option<$crate::Difference> {
                None$(.or_else(|| $crate::message::difference(stringify!($section), self.$section, other.$section)))+
            }

            /// Its sections, with the first `most` rows of each.
            pub fn sections(&self, most: usize) -> Vec<$crate::Section> {
                vec![$($crate::message::section(stringify!($section), self.$section, most)),+]
            }

            /// The memory of its sections, in order.
            pub fn memory(&self) -> Vec<&'a [u8]> {
                vec![$($crate::bytemuck::cast_slice(self.$section)),+]
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

        impl $crate::Message for $name {
            const DEFINITION: &'static $crate::Definition = &$crate::Definition {
                name: $topic,
                schema: stringify!($name),
                about: concat!($($about),+),
                stage: $stage,
                from: &[$($from),*],
                is_per_view: $crate::message::is_per(&[$(stringify!($per)),*], "view"),
                is_per_channel: $crate::message::is_per(&[$(stringify!($per)),*], "channel"),
                sections: &[$($crate::SectionType {
                    name: stringify!($section),
                    about: concat!($($doc),+),
                    row: $crate::row::RowType::of::<$element>(),
                    capacity: |$size| $capacity,
                }),+],
            };
            const KIND: $crate::Kind = $kind;
            type View<'a> = $view<'a>;
            type Room<'a> = $room<'a>;

            fn view(words: &[u64], size: $crate::Size, lens: [u32; $crate::SECTIONS]) -> Option<$view<'_>> {
                let bytes: &[u8] = $crate::bytemuck::cast_slice(words);
                let offsets = Self::offsets(size);
                let mut sections = offsets.windows(2).zip(lens);
                Some($view { $($section: {
                    let (bounds, len) = sections.next()?;
                    let used = (len as usize).checked_mul(size_of::<$element>())?;
                    $crate::bytemuck::try_cast_slice(bytes.get(bounds[0]..bounds[1])?.get(..used)?).ok()?
                },)+ })
            }

            fn room(words: &mut [u64], size: $crate::Size) -> Option<$room<'_>> {
                let mut rest: &mut [u8] = $crate::bytemuck::cast_slice_mut(words);
                let offsets = Self::offsets(size);
                let mut sections = offsets.windows(2).zip(Self::capacities(size));
                Some($room { $($section: {
                    let (bounds, capacity) = sections.next()?;
                    let section = rest.split_off_mut(..bounds[1] - bounds[0])?;
                    let slots = section.get_mut(..capacity * size_of::<$element>())?;
                    $crate::List::new($crate::bytemuck::try_cast_slice_mut(slots).ok()?)
                },)+ })
            }

            fn lens(room: &$room<'_>) -> [u32; $crate::SECTIONS] {
                let mut all = [0; $crate::SECTIONS];
                for (slot, len) in all.iter_mut().zip([$(room.$section.len()),+]) {
                    *slot = len as u32;
                }
                all
            }

            fn refused(room: &$room<'_>) -> usize {
                0 $(+ room.$section.refused())+
            }

            fn clear(room: &mut $room<'_>) {
                room.clear();
            }

            fn push(room: &mut $room<'_>, section: usize, row: &[u8]) {
                let mut left = section;
                $(
                    if left == 0 {
                        return match $crate::bytemuck::try_pod_read_unaligned(row) {
                            Ok(row) => room.$section.push(row),
                            Err(_) => room.$section.refuse(),
                        };
                    }
                    left -= 1;
                )+
                _ = left;
            }

            fn copy(view: $view<'_>, room: &mut $room<'_>) {
                $(room.$section.extend_from_slice(view.$section);)+
            }
        }
    };
}

/// Makes a kind of message one that recordings hold.
#[cfg(feature = "record")]
#[doc(hidden)]
#[macro_export]
macro_rules! recorded {
    ($name:ident) => {
        impl $crate::record::Recorded for $name {}
    };
}

/// Without recordings there is nothing to do.
#[cfg(not(feature = "record"))]
#[doc(hidden)]
#[macro_export]
macro_rules! recorded {
    ($name:ident) => {};
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
    use crate::elements::{Curve, Edge};
    use crate::payload::{Curves, Edges, Tables};

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
    fn a_row_pushed_as_its_memory_is_the_row_and_one_of_another_length_is_refused() {
        let mut curves = Owned::<Curves>::new(Size::new(33, 17));
        let edge = Edge {
            y: 4.25,
            ..Edge::default()
        };
        let refused = curves.fill(|room| {
            Curves::push(room, 1, bytemuck::bytes_of(&edge));
            Curves::push(room, 0, bytemuck::bytes_of(&edge));
            Curves::refused(room)
        });
        assert_eq!(curves.view().points, [edge]);
        assert_eq!((curves.view().curves.len(), refused), (0, 1));
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
