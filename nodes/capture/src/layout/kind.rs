//! The ways in which images say whose they are.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// How images say whose they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// The images of a folder are one scene's views.
    Views,
    /// A folder a time, an image a camera in each.
    Times,
    /// A folder a camera, an image a time in each.
    Cameras,
    /// One folder, with a camera's word or number and one of the time in every name.
    Flat,
    /// Pictures of so many views side by side.
    Columns(u32),
    /// Pictures of so many views above each other.
    Rows(u32),
    /// The images of a folder are the frames of one camera that moves.
    Rail,
}

/// The names of layouts.
const EXPECTED: &str = "views, times, cameras, flat, columns:3, rows:3 or rail";
/// The most views in one picture.
const MOST_PARTS: u32 = 64;

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Views => f.write_str("views"),
            Self::Times => f.write_str("times"),
            Self::Cameras => f.write_str("cameras"),
            Self::Flat => f.write_str("flat"),
            Self::Columns(count) => write!(f, "columns:{count}"),
            Self::Rows(count) => write!(f, "rows:{count}"),
            Self::Rail => f.write_str("rail"),
        }
    }
}

impl FromStr for Layout {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = |count: &str| {
            count
                .parse()
                .ok()
                .filter(|count| (2..=MOST_PARTS).contains(count))
        };
        let layout = match text.split_once(':') {
            Some(("columns", count)) => parts(count).map(Self::Columns),
            Some(("rows", count)) => parts(count).map(Self::Rows),
            _ => [
                Self::Views,
                Self::Times,
                Self::Cameras,
                Self::Flat,
                Self::Rail,
            ]
            .into_iter()
            .find(|layout| layout.to_string() == text),
        };
        layout.ok_or_else(|| format!("{text:?} is no layout, expected {EXPECTED}"))
    }
}

impl Serialize for Layout {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Layout {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

impl Layout {
    /// What it makes of a folder, in words.
    pub fn describe(self) -> String {
        match self {
            Self::Views => "the views of one scene".to_owned(),
            Self::Times => "a folder a time".to_owned(),
            Self::Cameras => "a folder a camera".to_owned(),
            Self::Flat => "cameras and times by name".to_owned(),
            Self::Columns(count) => format!("{count} views side by side in a picture"),
            Self::Rows(count) => format!("{count} views above each other in a picture"),
            Self::Rail => "the frames of one camera".to_owned(),
        }
    }
}
