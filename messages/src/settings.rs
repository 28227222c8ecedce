//! Settings: one table a node says its keys, types, defaults, ranges and meanings once.
//!
//! The table makes the plain struct with its `Default`, the list of keys that messages about unknown keys and
//! `--help` walk, and the check of ranges.

use std::fmt;

/// One key of a node's settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// Its name.
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
    /// All keys, in order.
    const KEYS: &'static [Key];

    /// Checks every value against its range.
    ///
    /// # Errors
    /// The first value that is out of range.
    fn check(&self) -> Result<(), OutOfRange>;
}

/// Writes a node's settings: each line a key with its meaning, type, default and, for numbers, range.
///
/// ```
/// messages::settings! {
///     /// How the door works.
///     pub struct Door {
///         /// Scans under way at once.
///         pub in_flight: usize = 8, in 1..=32;
///         /// What the door is called.
///         pub name: String = "front".to_owned();
///     }
/// }
/// use messages::settings::Settings;
/// assert_eq!(Door::default().in_flight, 8);
/// let wide = Door { in_flight: 99, ..Door::default() };
/// assert_eq!(wide.check().unwrap_err().to_string(), "in_flight must lie between 1 and 32, not 99");
/// ```
#[macro_export]
macro_rules! settings {
    ($(#[$about:meta])* pub struct $($table:tt)+) => {
        $crate::settings! { "serde"; $(#[$about])* pub struct $($table)+ }
    };
    // In front stands where serde is.
    ($serde:literal; $(#[$about:meta])* pub struct $name:ident {
        $(#[doc = $doc:literal] $(#[doc = $more:literal])* pub $key:ident: $type:ty = $default:expr $(, in $least:literal ..= $most:literal)?;)*
    }) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, $crate::serde::Serialize, $crate::serde::Deserialize)]
        #[serde(crate = $serde, deny_unknown_fields, default)]
        pub struct $name {
            $(#[doc = $doc] $(#[doc = $more])* pub $key: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default,)* }
            }
        }

        impl $crate::settings::Settings for $name {
            const KEYS: &'static [$crate::settings::Key] = &[$($crate::settings::Key {
                name: stringify!($key),
                about: concat!($doc $(, $more)*),
                kind: stringify!($type),
                range: $crate::settings!(@range $($least, $most)?),
            },)*];

            fn check(&self) -> Result<(), $crate::settings::OutOfRange> {
                $($crate::settings!(@check self $key $($least, $most)?);)*
                Ok(())
            }
        }
    };
    (@range) => { None };
    (@range $least:literal, $most:literal) => { Some(($least as f64, $most as f64)) };
    (@check $self:ident $key:ident) => {};
    (@check $self:ident $key:ident $least:literal, $most:literal) => {
        let range = ($least as f64, $most as f64);
        if let Some(value) = $crate::settings::Ranged::outside(&$self.$key, range) {
            return Err($crate::settings::OutOfRange { key: stringify!($key), value, range });
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
            ..Sample::KEYS[2].clone()
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
