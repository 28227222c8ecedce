//! How the images of a folder lie: which are of which camera, and which were taken at one time.
//!
//! ```text
//! folder ─► listing ─► names, counts (and, of wide pictures, what they show) ─► Table: cameras × times
//! ```
//!
//! Names come first: folders or files that are called after cameras or sides, numbers after words like `cam` or `frame`.
//! Where they leave it open the counts decide, for a rig has fewer cameras than times. What stays open is refused.

mod flat;
mod folders;
mod kind;
mod one_folder;
mod search;
mod stamp;
mod together;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use unicode_normalization::UnicodeNormalization as _;

use crate::aside::Aside;
use crate::folder;
use crate::names;
use crate::panels::Part;

pub use kind::Layout;

/// An image, or a part of one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Its file.
    pub path: PathBuf,
    /// Which part of it, where it shows several views.
    pub part: Option<Part>,
}

impl From<PathBuf> for Piece {
    fn from(path: PathBuf) -> Self {
        Self { path, part: None }
    }
}

/// Who took what at which time.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    pub(crate) layout: Layout,
    /// Where it was found: the folder itself or the only one in it that holds images.
    pub(crate) folder: PathBuf,
    /// The cameras' names, left to right; of views of one scene the images'.
    pub(crate) cameras: Vec<String>,
    /// In order.
    pub(crate) times: Vec<Time>,
    /// Folders of times, where it is those.
    pub(crate) folders: Vec<PathBuf>,
    pub(crate) together: Together,
    /// Images that go with none of the camera in the middle, put together by the times they are called after.
    pub(crate) alone: Vec<PathBuf>,
    /// Images that lie elsewhere: in folders beside images, or beside folders with more.
    pub(crate) ignored: usize,
    /// Files that are left out.
    pub(crate) aside: Aside,
}

/// What was taken at one time.
#[derive(Clone, Debug)]
pub(crate) struct Time {
    /// What its images have in common in their names.
    pub(crate) name: String,
    /// The image of each camera that took one.
    pub(crate) images: Vec<Option<Piece>>,
}

/// By what images were put together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Together {
    /// By what they have in common in their names.
    #[default]
    Name,
    /// Each with those next to it in time, which is what they are called after.
    Stamp,
    /// By their order, for no two have anything in common.
    Order,
}

/// An image's camera and time, by name.
type Named = (String, String, Piece);

/// The folders that hold images, each with its name and its images.
type Inner = Vec<(PathBuf, Vec<PathBuf>)>;

impl Table {
    /// A table of images with their cameras and times.
    fn of(folder: &Path, layout: Layout, named: Vec<Named>) -> Self {
        let different: BTreeSet<&str> = named.iter().map(|(camera, ..)| camera.as_str()).collect();
        let mut cameras: Vec<String> = different.into_iter().map(str::to_owned).collect();
        names::sort_cameras(&mut cameras, String::clone);
        let mut by_name: BTreeMap<String, Vec<Option<Piece>>> = BTreeMap::new();
        for (camera, time, piece) in named {
            let Some(number) = cameras.iter().position(|known| *known == camera) else {
                continue;
            };
            let is_taken = by_name
                .get(&time)
                .is_some_and(|images| images[number].is_some());
            // Of one name but for its ending: an image of another time.
            let time = match is_taken {
                true => format!("{time}/{}", shown(&folder::name(&piece.path))),
                false => time,
            };
            by_name
                .entry(time)
                .or_insert_with(|| vec![None; cameras.len()])[number] = Some(piece);
        }
        let times = by_name.into_iter();
        let mut times: Vec<Time> = times.map(|(name, images)| Time { name, images }).collect();
        names::sort(&mut times, |time| time.name.clone());
        Self {
            layout,
            folder: folder.to_owned(),
            cameras,
            times,
            folders: Vec::new(),
            together: Together::Name,
            alone: Vec::new(),
            ignored: 0,
            aside: Aside::default(),
        }
    }
}

pub(crate) fn stem(path: &Path) -> String {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy());
    stem.map(|stem| shown(&stem)).unwrap_or_default()
}

/// A name without what ends a line or cannot be shown, its accents in one way: some systems write `ä` as two signs.
pub(crate) fn shown(name: &str) -> String {
    let is_odd = |c: char| c.is_control() || ['\u{2028}', '\u{2029}'].contains(&c);
    name.nfc().collect::<String>().replace(is_odd, "\u{fffd}")
}
