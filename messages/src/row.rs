//! Rows: the plain types of which messages consist, and what a stranger must know to read one.
//!
//! A row says its members once: name, meaning with unit, place and type. The recording's schema, its encoding and the text of
//! a row are made of that.

use bytemuck::Pod;

/// What a member is; the values are those of `foxglove.PackedElementField`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Number {
    /// A byte.
    Uint8 = 1,
    /// A whole number of 32 bits, without sign.
    Uint32 = 5,
    /// A number of single precision.
    Float32 = 7,
}

impl Number {
    /// How many bytes it takes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Uint8 => 1,
            Self::Uint32 | Self::Float32 => 4,
        }
    }

    /// The number that stands at the beginning of these bytes, as text.
    fn text(self, bytes: &[u8]) -> String {
        let word = || bytes.first_chunk().copied().unwrap_or_default();
        match self {
            Self::Uint8 => format!("{:?}", bytes.first().copied().unwrap_or_default()),
            Self::Uint32 => format!("{:?}", u32::from_le_bytes(word())),
            Self::Float32 => format!("{:?}", f32::from_le_bytes(word())),
        }
    }
}

/// A type that a member of a row may have.
pub trait Member {
    /// Which number it is.
    const NUMBER: Number;
}

impl Member for f32 {
    const NUMBER: Number = Number::Float32;
}

impl Member for u32 {
    const NUMBER: Number = Number::Uint32;
}

/// One member of a row.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its name.
    pub name: &'static str,
    /// What it means, with its unit.
    pub about: &'static str,
    /// Bytes before it in a row.
    pub offset: usize,
    /// What it is.
    pub number: Number,
}

/// A plain type of which a section of a message consists.
pub trait Row: Pod {
    /// Its name.
    const NAME: &'static str;
    /// What it is.
    const ABOUT: &'static str;
    /// Its members. As a message of its own, the n-th member is field n.
    const COLUMNS: &'static [Column];
}

/// What is known of a row's type without the type.
#[derive(Clone, Copy, Debug)]
pub struct RowType {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Bytes of a row.
    pub bytes: usize,
    /// Its members; of a plain number none.
    pub columns: &'static [Column],
}

impl RowType {
    /// What is known of `T`.
    pub const fn of<T: Row>() -> Self {
        Self {
            name: T::NAME,
            about: T::ABOUT,
            bytes: size_of::<T>(),
            columns: T::COLUMNS,
        }
    }

    /// A row's members as text.
    pub(crate) fn text(&self, row: &[u8]) -> String {
        let member = |column: &Column| {
            let value = row.get(column.offset..).unwrap_or_default();
            format!("{}: {}", column.name, column.number.text(value))
        };
        let members: Vec<String> = self.columns.iter().map(member).collect();
        format!("{} {{ {} }}", self.name, members.join(", "))
    }
}

/// Numbers that stand alone: pixels, disparities, indices.
macro_rules! alone {
    ($($number:ident $name:literal)+) => {$(
        impl Row for $number {
            const NAME: &'static str = $name;
            const ABOUT: &'static str = "";
            const COLUMNS: &'static [Column] = &[];
        }
    )+};
}
alone! { u8 "Uint8" u32 "Uint32" f32 "Float32" }

/// Writes a row's type: a struct whose members are `f32` and `u32`, each with its meaning and unit.
///
/// ```text
/// row! { "crate::bytemuck";
///     /// How many zero-crossings are about as strong.
///     pub struct Class {
///         /// The least magnitude in it, in gray levels per pixel.
///         pub least: f32,
///         /// Zero-crossings.
///         pub count: u32,
///     }
/// }
/// ```
///
/// The text in front says where the `bytemuck` is that makes it plain data.
#[macro_export]
macro_rules! row {
    ($bytemuck:literal; $(#[doc = $about:literal])+ $(#[derive($also:ident)])? $vis:vis struct $name:ident {
        $($(#[doc = $doc:literal])+ $at:vis $member:ident: $type:ty,)+
    }) => {
        $(#[doc = $about])+
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, $crate::bytemuck::Pod, $crate::bytemuck::Zeroable)]
        $(#[derive($also)])?
        #[bytemuck(crate = $bytemuck)]
        $vis struct $name {
            $($(#[doc = $doc])+ $at $member: $type,)+
        }

        impl $crate::row::Row for $name {
            const NAME: &'static str = stringify!($name);
            const ABOUT: &'static str = concat!($($about),+);
            const COLUMNS: &'static [$crate::row::Column] = &[$($crate::row::Column {
                name: stringify!($member),
                about: concat!($($doc),+),
                offset: ::std::mem::offset_of!($name, $member),
                number: <$type as $crate::row::Member>::NUMBER,
            },)+];
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elements::{
        Curve, Edge, Entry, MapPoint, Match, MatchPoint, Point, Rejected, Score, Share, Table,
    };

    /// Every byte of the type is told by a column.
    fn tells_all<T: Row>() {
        let mut told = vec![0; size_of::<T>()];
        for column in T::COLUMNS {
            told[column.offset..][..column.number.bytes()].fill(1);
        }
        assert!(told.iter().all(|&byte| byte == 1), "{}", T::NAME);
        assert!(!T::ABOUT.trim().is_empty(), "{}", T::NAME);
        let is_told = |column: &Column| !column.about.trim().is_empty();
        assert!(T::COLUMNS.iter().all(is_told), "{}", T::NAME);
    }

    #[test]
    fn the_columns_tell_every_byte_of_their_type() {
        tells_all::<Edge>();
        tells_all::<Curve>();
        tells_all::<Table>();
        tells_all::<Entry>();
        tells_all::<Match>();
        tells_all::<MatchPoint>();
        tells_all::<Rejected>();
        tells_all::<Point>();
        tells_all::<MapPoint>();
        tells_all::<Score>();
        tells_all::<Share>();
    }

    /// As a message of its own, word n of the type is field n.
    fn is_words<T: Row>() {
        let offsets: Vec<usize> = T::COLUMNS.iter().map(|c| c.offset).collect();
        let words: Vec<usize> = (0..size_of::<T>()).step_by(4).collect();
        assert_eq!(offsets, words, "{}", T::NAME);
        let is_word = |column: &Column| column.number.bytes() == 4;
        assert!(T::COLUMNS.iter().all(is_word), "{}", T::NAME);
    }

    #[test]
    fn types_with_messages_of_their_own_are_words_in_order() {
        is_words::<Curve>();
        is_words::<Table>();
        is_words::<Match>();
        is_words::<Rejected>();
        is_words::<Score>();
        is_words::<Share>();
    }

    #[test]
    fn the_text_of_a_row_is_what_its_type_says_of_itself() {
        let point = MatchPoint {
            x: 1.5,
            disparity: f32::NAN,
            point: 7,
            ..MatchPoint::default()
        };
        let text = RowType::of::<MatchPoint>().text(bytemuck::bytes_of(&point));
        assert_eq!(text, format!("{point:?}"));
    }
}
