//! Settings: one table a node says its keys, types, defaults, ranges and meanings once.
//!
//! The table makes the plain struct with its `Default`, the list of keys that messages about unknown keys and
//! `--help` walk, and the check of ranges.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap;

/// One key of a node's settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Its name; that of one in a table of its own begins with the table's and a dot.
    pub name: &'static str,
    /// What it means, with its unit.
    pub about: &'static str,
    /// Its type, as the table of settings writes it.
    pub kind: &'static str,
    /// The least and the greatest value allowed, where it is a number or a list of numbers.
    pub range: Option<(f64, f64)>,
}

impl Key {
    /// Whether it takes whole numbers only.
    pub fn is_whole(&self) -> bool {
        matches!(self.taken().0, "u32" | "u64" | "usize")
    }

    /// What it takes, in words; not of a choice between names, which only its type knows.
    pub fn takes(&self) -> Option<String> {
        let (kind, is_optional) = self.taken();
        let what = match kind {
            "f32" | "f64" => "a number",
            _ if self.is_whole() => "a whole number",
            "bool" => "true or false",
            "String" => "a text",
            _ => match kind.strip_prefix("Vec<") {
                Some("String>") => "a list of texts",
                Some("f32>" | "f64>") => "a list of numbers",
                Some("u32>" | "u64>" | "usize>") => "a list of whole numbers",
                _ => return None,
            },
        };
        let range = self
            .range
            .map(|(least, most)| format!(" from {least} to {most}"));
        let or = if is_optional { ", or automatic" } else { "" };
        Some(format!("{what}{}{or}", range.unwrap_or_default()))
    }

    /// The type of a value that is set, and whether it need not be.
    fn taken(&self) -> (&'static str, bool) {
        let inner = self.kind.strip_prefix("Option<");
        match inner.and_then(|inner| inner.strip_suffix('>')) {
            Some(inner) => (inner, true),
            None => (self.kind, false),
        }
    }
}

/// A value that is out of range.
#[derive(Clone, Debug, PartialEq)]
pub struct OutOfRange {
    /// The key.
    pub key: &'static str,
    /// The value it was given.
    pub value: f64,
    /// The least and the greatest value allowed.
    pub range: (f64, f64),
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (least, most) = self.range;
        write!(
            f,
            "{} must lie between {least} and {most}, not {}",
            self.key, self.value
        )
    }
}

impl std::error::Error for OutOfRange {}

/// A value whose numbers can be checked against a range.
pub trait Ranged {
    /// The first number outside the range.
    fn outside(&self, range: (f64, f64)) -> Option<f64>;
}

macro_rules! numbers {
    ($($number:ty)*) => {$(
        impl Ranged for $number {
            fn outside(&self, (least, most): (f64, f64)) -> Option<f64> {
                let value = *self as f64;
                (!(least..=most).contains(&value)).then_some(value)
            }
        }
    )*};
}
numbers!(f32 f64 u32 u64 usize);

impl<T: Ranged> Ranged for Option<T> {
    fn outside(&self, range: (f64, f64)) -> Option<f64> {
        self.as_ref()?.outside(range)
    }
}

impl<T: Ranged> Ranged for Vec<T> {
    fn outside(&self, range: (f64, f64)) -> Option<f64> {
        self.iter().find_map(|element| element.outside(range))
    }
}

/// What every node's settings can say about themselves.
pub trait Settings: Default + serde::Serialize + serde::de::DeserializeOwned {
    /// All keys, in order, those of tables last.
    const KEYS: &'static [Key];

    /// Checks every value against its range.
    ///
    /// # Errors
    /// The first value that is out of range.
    fn check(&self) -> Result<(), OutOfRange>;

    /// Writes every key down, those of tables too.
    ///
    /// # Errors
    /// What the writer fails with.
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error>;

    /// Takes the value of a key, and says whether there is such a key.
    ///
    /// # Errors
    /// When the value is not one of the key's.
    fn take<'de, M: MapAccess<'de>>(&mut self, key: &str, map: &mut M) -> Result<bool, M::Error>;
}

/// Reads settings from a map of their keys; those it does not name are as they are by default.
#[derive(Debug)]
pub struct Reader<S>(pub PhantomData<S>);

impl<'de, S: Settings> Visitor<'de> for Reader<S> {
    type Value = S;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table of settings")
    }

    fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<S, M::Error> {
        let mut settings = S::default();
        while let Some(key) = map.next_key::<String>()? {
            if !settings.take(&key, &mut map)? {
                return Err(M::Error::custom(format!("there is no key {key}")));
            }
        }
        Ok(settings)
    }
}

/// How many keys lists hold.
pub const fn count(lists: &[&[Key]]) -> usize {
    let (mut sum, mut at) = (0, 0);
    while at < lists.len() {
        sum += lists[at].len();
        at += 1;
    }
    sum
}

/// The keys of lists in one, which has room for as many as [`count`] says.
pub const fn joined<const N: usize>(lists: &[&[Key]]) -> [Key; N] {
    let mut all = [Key {
        name: "",
        about: "",
        kind: "",
        range: None,
    }; N];
    let (mut list, mut at) = (0, 0);
    while list < lists.len() {
        let mut key = 0;
        while key < lists[list].len() {
            all[at] = lists[list][key];
            (key, at) = (key + 1, at + 1);
        }
        list += 1;
    }
    all
}

/// Writes a node's settings: each line a key with its meaning, type, default and, for numbers, range; then tables of further
/// keys, which are written down as `table.key`.
///
/// ```
/// messages::settings! {
///     /// Who is let in.
///     pub struct Guests in "guests" {
///         /// How many at most.
///         pub most: usize = 2, in 0..=9;
///     }
/// }
/// messages::settings! {
///     /// How the door works.
///     pub struct Door {
///         /// Scans under way at once.
///         pub in_flight: usize = 8, in 1..=32;
///         /// What the door is called.
///         pub name: String = "front".to_owned();
///     }
///     tables {
///         /// Who is let in.
///         pub guests: Guests;
///     }
/// }
/// use messages::settings::Settings;
/// assert_eq!(Door::default().in_flight, 8);
/// let wide = Door { in_flight: 99, ..Door::default() };
/// assert_eq!(wide.check().unwrap_err().to_string(), "in_flight must lie between 1 and 32, not 99");
/// let crowded: Door = serde_json::from_str(r#"{"guests.most": 12}"#).unwrap();
/// assert_eq!(crowded.check().unwrap_err().to_string(), "guests.most must lie between 0 and 9, not 12");
/// ```
#[macro_export]
macro_rules! settings {
    ($(#[$about:meta])* pub struct $name:ident in $table:literal $($rest:tt)*) => {
        $crate::settings!(@of [$table] $(#[$about])* pub struct $name $($rest)*);
    };
    ($(#[$about:meta])* pub struct $name:ident $($rest:tt)*) => {
        $crate::settings!(@of [] $(#[$about])* pub struct $name $($rest)*);
    };
    (@of $table:tt $(#[$about:meta])* pub struct $name:ident {
        $(#[doc = $doc:literal] $(#[doc = $more:literal])* pub $key:ident: $type:ty = $default:expr $(, in $least:literal ..= $most:literal)?;)*
    } $(tables {
        $($(#[$of:meta])* pub $own:ident: $inner:ty;)*
    })?) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $(#[doc = $doc] $(#[doc = $more])* pub $key: $type,)*
            $($($(#[$of])* pub $own: $inner,)*)?
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default,)* $($($own: <$inner>::default(),)*)? }
            }
        }

        impl $crate::serde::Serialize for $name {
            fn serialize<S: $crate::serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                let mut map = serializer.serialize_map(None)?;
                $crate::settings::Settings::put(self, &mut map)?;
                $crate::serde::ser::SerializeMap::end(map)
            }
        }

        impl<'de> $crate::serde::Deserialize<'de> for $name {
            fn deserialize<D: $crate::serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_map($crate::settings::Reader(std::marker::PhantomData))
            }
        }

        impl $crate::settings::Settings for $name {
            const KEYS: &'static [$crate::settings::Key] = {
                const LISTS: &[&[$crate::settings::Key]] = &[
                    &[$($crate::settings::Key {
                        name: $crate::settings!(@name $table $key),
                        about: concat!($doc $(, $more)*),
                        kind: stringify!($type),
                        range: $crate::settings!(@range $($least, $most)?),
                    },)*],
                    $($(<$inner as $crate::settings::Settings>::KEYS,)*)?
                ];
                &$crate::settings::joined::<{ $crate::settings::count(LISTS) }>(LISTS)
            };

            fn check(&self) -> Result<(), $crate::settings::OutOfRange> {
                $($crate::settings!(@check self $table $key $($least, $most)?);)*
                $($($crate::settings::Settings::check(&self.$own)?;)*)?
                Ok(())
            }

            fn put<M: $crate::serde::ser::SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
                $(map.serialize_entry($crate::settings!(@name $table $key), &self.$key)?;)*
                $($($crate::settings::Settings::put(&self.$own, map)?;)*)?
                Ok(())
            }

            fn take<'de, M: $crate::serde::de::MapAccess<'de>>(&mut self, key: &str, map: &mut M) -> Result<bool, M::Error> {
                $(if key == $crate::settings!(@name $table $key) {
                    self.$key = map.next_value()?;
                    return Ok(true);
                })*
                $($(if $crate::settings::Settings::take(&mut self.$own, key, map)? {
                    return Ok(true);
                })*)?
                Ok(false)
            }
        }
    };
    (@name [] $key:ident) => { stringify!($key) };
    (@name [$table:literal] $key:ident) => { concat!($table, ".", stringify!($key)) };
    (@range) => { None };
    (@range $least:literal, $most:literal) => { Some(($least as f64, $most as f64)) };
    (@check $self:ident $table:tt $key:ident) => {};
    (@check $self:ident $table:tt $key:ident $least:literal, $most:literal) => {
        let range = ($least as f64, $most as f64);
        if let Some(value) = $crate::settings::Ranged::outside(&$self.$key, range) {
            return Err($crate::settings::OutOfRange {
                key: $crate::settings!(@name $table $key),
                value,
                range,
            });
        }
    };
}

/// The known name nearest to a mistyped one, when it is near enough to be meant.
pub fn nearest<'a>(typed: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    known
        .into_iter()
        .map(|name| (strsim::jaro_winkler(typed, name), name))
        .filter(|(likeness, _)| *likeness > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    #![expect(unreachable_pub, reason = "the macro makes public types")]
    use super::*;

    crate::settings! {
        /// A table in another one.
        pub struct Inner in "inner" {
            /// Pixels.
            pub reach: f32 = 0.4, in 0..=9;
        }
    }

    crate::settings! {
        /// One with a table.
        pub struct Outer {
            /// Pixels.
            pub reach: f32 = 1.0, in 0..=99;
        }
        tables {
            /// The other one.
            pub inner: Inner;
        }
    }

    #[test]
    fn the_keys_of_a_table_are_written_with_its_name_and_read_back() {
        let names: Vec<_> = Outer::KEYS.iter().map(|k| k.name).collect();
        assert_eq!(names, ["reach", "inner.reach"]);
        let text = serde_json::to_string(&Outer::default()).unwrap_or_default();
        assert_eq!(text, r#"{"reach":1.0,"inner.reach":0.4}"#);
        let read: Outer = serde_json::from_str(r#"{"inner.reach":12}"#).unwrap_or_default();
        assert_eq!((read.reach, read.inner.reach), (1.0, 12.0));
        assert_eq!(read.check().map_err(|e| e.key), Err("inner.reach"));
        assert!(serde_json::from_str::<Outer>(r#"{"inner.rech":1}"#).is_err());
    }

    crate::settings! {
        /// For the tests.
        pub struct Sample {
            /// Square pixels.
            pub channels: Vec<f32> = vec![8.0, 2.0], in 0.5..=400.0;
            /// By hand, or automatic.
            pub high: Option<f32> = None, in 0..=255;
            /// A switch.
            pub mirror: bool = true;
        }
    }

    #[test]
    fn defaults_are_in_range_and_keys_are_listed() {
        assert_eq!(Sample::default().check(), Ok(()));
        let names: Vec<_> = Sample::KEYS.iter().map(|k| k.name).collect();
        assert_eq!(names, ["channels", "high", "mirror"]);
        assert_eq!(Sample::KEYS[0].range, Some((0.5, 400.0)));
        assert_eq!(Sample::KEYS[2].range, None);
    }

    #[test]
    fn a_key_says_in_words_what_it_takes() {
        let takes = |key: usize| Sample::KEYS[key].takes().unwrap_or_default();
        assert_eq!(takes(0), "a list of numbers from 0.5 to 400");
        assert_eq!(takes(1), "a number from 0 to 255, or automatic");
        assert_eq!(takes(2), "true or false");
        let whole = Key {
            kind: "Option<usize>",
            ..Sample::KEYS[2]
        };
        assert!(whole.is_whole());
        assert_eq!(
            whole.takes().as_deref(),
            Some("a whole number, or automatic")
        );
    }

    #[test]
    fn a_number_out_of_range_is_named_wherever_it_stands() {
        let list = Sample {
            channels: vec![8.0, 500.0],
            ..Sample::default()
        };
        assert_eq!(list.check().map_err(|e| e.value), Err(500.0));
        let option = Sample {
            high: Some(f32::NAN),
            ..Sample::default()
        };
        assert!(option.check().is_err());
    }

    #[test]
    fn unknown_keys_are_refused_and_the_nearest_known_one_is_found() {
        assert!(serde_json::from_str::<Sample>(r#"{"chanels": [1.0]}"#).is_err());
        let known = || Sample::KEYS.iter().map(|k| k.name);
        assert_eq!(nearest("chanels", known()), Some("channels"));
        assert_eq!(nearest("zzz", known()), None);
    }
}
