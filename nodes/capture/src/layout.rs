//! How the images of a folder lie: which are of which camera, and which were taken at one time.
//!
//! ```text
//! folder ─► listing ─► names, counts (and, of wide pictures, what they show) ─► Table: cameras × times
//! ```
//!
//! Names come first: folders or files that are called after cameras or sides, numbers after words like `cam` or `frame`.
//! Where they leave it open the counts decide, for a rig has fewer cameras than times. What stays open is refused.

mod flat;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use flat::{split, word_and_number};

use crate::error::SourceError;
use crate::folder::{self, Listing};
use crate::names::{self, Counts, Field};
use crate::panels::{self, Part};

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
    /// Images that lie elsewhere: in folders beside images, or beside folders with more.
    pub(crate) ignored: usize,
    /// Files that are no images.
    pub(crate) others: usize,
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
    /// Finds out who took what in a folder, as is said or by itself.
    ///
    /// # Errors
    /// A folder without images or that cannot be read, or whose images can be read in two ways.
    pub(crate) fn read(path: &Path, said: Option<Layout>) -> Result<Self, SourceError> {
        let mut folder = path.to_owned();
        let mut listing = Listing::read(&folder)?;
        let mut others = listing.others;
        let mut inner = inner(&listing, &mut others)?;
        // Some recorders put a folder of their own around everything.
        while listing.images.is_empty() && !folder::is_described(&folder)? {
            let holds = |folder: &&PathBuf| {
                Listing::read(folder).is_ok_and(|inside| !inside.folders.is_empty())
            };
            let around: Vec<&PathBuf> = listing.folders.iter().filter(holds).collect();
            let only = match (&inner[..], &around[..]) {
                ([(only, _)], _) if !matches!(said, Some(Layout::Cameras | Layout::Times)) => {
                    only.clone()
                }
                ([], [only]) => (*only).clone(),
                _ => break,
            };
            folder = only;
            listing = Listing::read(&folder)?;
            others += listing.others;
            inner = self::inner(&listing, &mut others)?;
        }
        let (here, below) = (
            listing.images.len(),
            inner.iter().map(|(_, images)| images.len()).sum::<usize>(),
        );
        if here + below == 0 {
            return Err(SourceError::Empty {
                path: path.to_owned(),
                others,
            });
        }
        let is_here = match said {
            Some(Layout::Cameras | Layout::Times) => false,
            Some(_) => true,
            None => here >= below || folder::is_described(&folder)?,
        };
        if (is_here && here == 0 && !folder::is_described(&folder)?) || (!is_here && below == 0) {
            return Err(SourceError::Layout {
                path: folder,
                layout: said.unwrap_or(Layout::Views),
                why: match is_here {
                    true => "it holds no images itself, only folders with some".to_owned(),
                    false => "it holds no folders with images".to_owned(),
                },
            });
        }
        let table = match is_here {
            true => in_one(&folder, listing.images, said)?,
            false => in_folders(&folder, inner, said)?,
        };
        Ok(Self {
            ignored: if is_here { below } else { here },
            others,
            ..table
        })
    }

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
        let mut table = Self {
            layout,
            folder: folder.to_owned(),
            cameras,
            times,
            folders: Vec::new(),
            together: Together::Name,
            ignored: 0,
            others: 0,
        };
        table.put_together();
        table
    }

    /// Puts images together that have no name or number in common with any other.
    fn put_together(&mut self) {
        let is_shared = |time: &Time| time.images.iter().flatten().count() > 1;
        if self.cameras.len() < 2 || self.times.iter().any(is_shared) {
            return;
        }
        let taken = |camera: usize| -> Vec<Piece> {
            let images = self.times.iter();
            images
                .filter_map(|time| time.images[camera].clone())
                .collect()
        };
        let by_camera: Vec<Vec<Piece>> = (0..self.cameras.len()).map(taken).collect();
        if let Some(times) = by_stamp(&by_camera) {
            (self.times, self.together) = (times, Together::Stamp);
            return;
        }
        let count = by_camera[0].len();
        if by_camera.iter().any(|images| images.len() != count) {
            return;
        }
        self.together = Together::Order;
        self.times = (0..count)
            .map(|number| Time {
                name: stem(&by_camera[0][number].path),
                images: by_camera
                    .iter()
                    .map(|images| Some(images[number].clone()))
                    .collect(),
            })
            .collect();
    }
}

/// The images of several cameras, called after the time they were taken at: each with those nearest to it, and of them the
/// whole ones. `None` where their names are no such times.
fn by_stamp(by_camera: &[Vec<Piece>]) -> Option<Vec<Time>> {
    /// Digits of a time that is counted on from long ago, and not a frame's number.
    const DIGITS: usize = 9;
    let stamp = |piece: &Piece| {
        let stem = stem(&piece.path);
        let is_time = stem.len() >= DIGITS && stem.bytes().all(|b| b.is_ascii_digit() || b == b'.');
        stem.parse::<f64>().ok().filter(|_| is_time)
    };
    let stamps: Option<Vec<Vec<f64>>> = by_camera
        .iter()
        .map(|images| images.iter().map(stamp).collect())
        .collect();
    let stamps = stamps?;
    let own = &stamps[stamps.len() / 2];
    let mut intervals: Vec<f64> = own.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_by(f64::total_cmp);
    let reach = intervals.get(intervals.len() / 2)? / 2.0;
    let nearest = |all: &[f64], at: f64| {
        let distance = |index: &usize| (all[*index] - at).abs();
        (0..all.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    let mut times = Vec::with_capacity(own.len());
    for (number, &at) in own.iter().enumerate() {
        let images = stamps.iter().zip(by_camera).map(|(theirs, images)| {
            let index = nearest(theirs, at)?;
            let is_mutual = nearest(own, theirs[index]) == Some(number);
            (is_mutual && (theirs[index] - at).abs() < reach).then(|| images[index].clone())
        });
        times.push(Time {
            name: stem(&by_camera[by_camera.len() / 2][number].path),
            images: images.collect(),
        });
    }
    // Cameras that hardly ever took something at one time did not run together.
    let whole = times
        .iter()
        .filter(|time| time.images.iter().all(Option::is_some));
    (2 * whole.count() >= times.len()).then_some(times)
}

/// The folders in a folder that hold images; some recorders put those in a further folder inside, as in `cam0/data`.
fn inner(listing: &Listing, others: &mut usize) -> Result<Inner, SourceError> {
    let mut inner = Vec::new();
    for folder in &listing.folders {
        let mut images = Listing::read(folder)?;
        *others += images.others;
        if images.images.is_empty() && !folder::is_described(folder)? {
            let inside: Vec<Listing> = images
                .folders
                .iter()
                .map(|folder| Listing::read(folder))
                .collect::<Result<_, _>>()?;
            let mut with = inside
                .into_iter()
                .filter(|inside| !inside.images.is_empty());
            if let (Some(only), None) = (with.next(), with.next()) {
                *others += only.others;
                images = only;
            }
        }
        if !images.images.is_empty() || folder::is_described(folder)? {
            inner.push((folder.clone(), images.images));
        }
    }
    Ok(inner)
}

/// The images of one folder.
fn in_one(folder: &Path, images: Vec<PathBuf>, said: Option<Layout>) -> Result<Table, SourceError> {
    let plain = |layout| Table {
        layout,
        folder: folder.to_owned(),
        cameras: images.iter().map(|image| stem(image)).collect(),
        times: vec![Time {
            name: folder::name(folder),
            images: images
                .iter()
                .cloned()
                .map(|image| Some(image.into()))
                .collect(),
        }],
        folders: Vec::new(),
        together: Together::Name,
        ignored: 0,
        others: 0,
    };
    match said {
        Some(layout @ (Layout::Views | Layout::Rail)) => return Ok(plain(layout)),
        Some(layout @ (Layout::Columns(_) | Layout::Rows(_))) => {
            return Ok(in_parts(folder, images, layout));
        }
        Some(Layout::Flat) => {}
        _ if folder::is_described(folder)? => return Ok(plain(Layout::Views)),
        _ => {}
    }
    let stems: Vec<String> = images.iter().map(|image| stem(image)).collect();
    let split = split(&stems).map_err(|[first, second]| SourceError::TwoLayouts {
        path: folder.to_owned(),
        first,
        second,
        say: "--layout views for the views of one scene, --layout rail for the frames of one camera, or give each its own folder",
    })?;
    if let Some(parts) = split {
        let each = parts.into_iter().zip(images);
        let named = each.map(|((camera, time), image)| (camera, time, image.into()));
        return Ok(Table::of(folder, Layout::Flat, named.collect()));
    }
    if said == Some(Layout::Flat) {
        return Err(SourceError::Layout {
            path: folder.to_owned(),
            layout: Layout::Flat,
            why: "its names are no words or numbers of cameras that go with the same times, as in left_000, right_000".to_owned(),
        });
    }
    if let Some(layout) = panels::seen(&images)? {
        return Ok(in_parts(folder, images, layout));
    }
    Ok(plain(Layout::Views))
}

/// Pictures of several views each.
fn in_parts(folder: &Path, images: Vec<PathBuf>, layout: Layout) -> Table {
    let count = match layout {
        Layout::Columns(count) | Layout::Rows(count) => count,
        _ => 1,
    };
    let parts: Vec<Part> = (0..count)
        .map(|index| Part {
            index,
            count,
            is_row: matches!(layout, Layout::Rows(_)),
        })
        .collect();
    Table {
        layout,
        folder: folder.to_owned(),
        cameras: parts.iter().map(Part::to_string).collect(),
        times: images
            .into_iter()
            .map(|path| Time {
                name: stem(&path),
                images: parts
                    .iter()
                    .map(|&part| {
                        Some(Piece {
                            path: path.clone(),
                            part: Some(part),
                        })
                    })
                    .collect(),
            })
            .collect(),
        folders: Vec::new(),
        together: Together::Name,
        ignored: 0,
        others: 0,
    }
}

/// The images of several folders, of which each is a camera's or a time's.
fn in_folders(folder: &Path, inner: Inner, said: Option<Layout>) -> Result<Table, SourceError> {
    let are_cameras = match said {
        Some(layout) => layout == Layout::Cameras,
        None => are_cameras(folder, &inner)?,
    };
    // Cameras may put their own word before the number they share.
    let has_number = |image: &PathBuf| !word_and_number(&stem(image)).1.is_empty();
    let by_number = are_cameras
        && inner
            .iter()
            .all(|(_, images)| images.iter().all(has_number))
        && !inner.iter().any(|(_, images)| has_twins(images));
    let (mut named, mut known) = (Vec::new(), BTreeSet::new());
    for (path, images) in &inner {
        let mut name = shown(&folder::name(path));
        // Names that differ in what cannot be shown.
        while !known.insert(name.clone()) {
            name.push('\'');
        }
        for image in images {
            let own = match by_number {
                true => word_and_number(&stem(image)).1,
                false => stem(image),
            };
            let piece = image.clone().into();
            named.push(match are_cameras {
                true => (name.clone(), own, piece),
                false => (own, name.clone(), piece),
            });
        }
    }
    let layout = if are_cameras {
        Layout::Cameras
    } else {
        Layout::Times
    };
    let mut table = match are_cameras {
        true => Table::of(folder, layout, named),
        false => {
            // Times are never put together by their order: a folder is one.
            let mut table = Table::of(folder, layout, named);
            table.together = Together::Name;
            table
        }
    };
    if !are_cameras {
        table.folders = inner.into_iter().map(|(path, _)| path).collect();
    }
    Ok(table)
}

/// Whether two images end with one number, as in `a_1` and `b_1`.
fn has_twins(images: &[PathBuf]) -> bool {
    let numbers: BTreeSet<String> = images
        .iter()
        .map(|image| word_and_number(&stem(image)).1)
        .collect();
    numbers.len() < images.len()
}

/// So many are rather times than cameras.
const MANY: usize = 10;

/// Whether folders are cameras, and not times: by what they and their images are called, else by which are fewer.
fn are_cameras(folder: &Path, inner: &Inner) -> Result<bool, SourceError> {
    for (path, _) in inner {
        if folder::is_described(path)? {
            return Ok(false);
        }
    }
    let folders: Vec<String> = inner.iter().map(|(path, _)| folder::name(path)).collect();
    let by_folder = call(&folders, true);
    let by_image: Vec<Counts> = inner
        .iter()
        .map(|(_, images)| {
            call(
                &images.iter().map(|image| stem(image)).collect::<Vec<_>>(),
                false,
            )
        })
        .collect();
    let all = |counts: Counts| by_image.iter().all(|own| *own == counts);
    let most = inner
        .iter()
        .map(|(_, images)| images.len())
        .max()
        .unwrap_or_default();
    let least = inner
        .iter()
        .map(|(_, images)| images.len())
        .min()
        .unwrap_or_default();
    let readings = || SourceError::TwoLayouts {
        path: folder.to_owned(),
        first: format!("{} cameras at {most} times, a folder a camera", inner.len()),
        second: format!("{} times of {most} cameras, a folder a time", inner.len()),
        say: "--layout cameras or --layout times",
    };
    match (by_folder, all(Counts::Cameras), all(Counts::Times)) {
        (Counts::Cameras, false, _) => Ok(true),
        (Counts::Times, _, false) => Ok(false),
        (Counts::Unknown, true, _) => Ok(false),
        (Counts::Unknown, _, true) => Ok(true),
        // Names say nothing. A rig has fewer cameras than times, and a scene few views.
        (Counts::Unknown, false, false) => match inner.len() {
            0..3 if least >= 3 && most < MANY => Ok(false),
            0..3 => Ok(true),
            _ if most == 1 => Ok(true),
            folders if folders > most && (most > 2 || folders >= MANY) => Ok(false),
            folders if folders < most && most >= MANY => Ok(true),
            _ => Err(readings()),
        },
        _ => Err(readings()),
    }
}

/// Whether names are those of cameras or of times.
fn call(names: &[String], are_folders: bool) -> Counts {
    if names::are_sides(names) {
        return Counts::Cameras;
    }
    let all: Vec<Vec<Field>> = names.iter().map(|name| names::fields(name)).collect();
    let Some(first) = all.first() else {
        return Counts::Unknown;
    };
    // The number that is counted is the last one.
    let of = |fields: &Vec<Field>| match fields.iter().rposition(|field| field.is_number) {
        Some(at) => names::counts(fields, at, are_folders),
        None => Counts::Unknown,
    };
    let own = of(first);
    match all.iter().all(|fields| of(fields) == own) {
        true => own,
        false => Counts::Unknown,
    }
}

pub(crate) fn stem(path: &Path) -> String {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy());
    stem.map(|stem| shown(&stem)).unwrap_or_default()
}

/// A name without what ends a line or cannot be shown.
pub(crate) fn shown(name: &str) -> String {
    let is_odd = |c: char| c.is_control() || ['\u{2028}', '\u{2029}'].contains(&c);
    name.replace(is_odd, "\u{fffd}")
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    fn folders(names: &[&str], images: &[&str]) -> Inner {
        let inside = |name: &&str| {
            let folder = PathBuf::from("/nowhere").join(name);
            let images = images.iter().map(|image| folder.join(image)).collect();
            (folder, images)
        };
        names.iter().map(inside).collect()
    }

    fn hold(names: &[&str], images: &[&str]) -> Option<bool> {
        are_cameras(Path::new("/nowhere"), &folders(names, images)).ok()
    }

    #[test]
    fn folders_are_cameras_or_times_by_what_they_and_their_images_are_called() {
        let frames = ["000.png", "001.png", "002.png"];
        let views = ["left.png", "centre.png", "right.png"];
        for cameras in [
            ["cam0", "cam1", "cam2"],
            ["left", "centre", "right"],
            ["image_00", "image_01", "image_02"],
            ["L", "C", "R"],
        ] {
            assert_eq!(hold(&cameras, &frames), Some(true), "{cameras:?}");
        }
        for times in [
            ["scan_1", "scan_2", "scan_3"],
            ["2024-01", "2024-02", "2024-03"],
            ["a", "b", "c"],
        ] {
            assert_eq!(hold(&times, &views), Some(false), "{times:?}");
        }
        assert_eq!(hold(&["scan1", "scan2"], &frames), Some(false));
        assert_eq!(
            hold(&["x", "y", "z"], &["frame_0.png", "frame_1.png"]),
            Some(true)
        );
    }

    #[test]
    fn where_names_say_nothing_counts_decide_and_else_it_is_open() {
        let many: Vec<String> = (0..12).map(|number| format!("{number}.png")).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        let few = ["0.png", "1.png", "2.png"];
        assert_eq!(hold(&["a", "b", "c"], &many), Some(true));
        assert_eq!(hold(&many, &few), Some(false));
        assert_eq!(hold(&["a", "b"], &few), Some(false));
        assert_eq!(hold(&["a", "b", "c", "d"], &few), Some(false));
        assert_eq!(hold(&["a", "b", "c"], &few), None);
        assert_eq!(hold(&["a", "b", "c"], &["0.png"]), Some(true));
    }

    #[test]
    fn images_called_after_their_times_go_with_those_next_to_them() {
        let camera = |offset: u64, without: u64| -> Vec<Piece> {
            let times = (0..6).filter(|time| *time != without);
            let name = |time: u64| format!("{}.png", 1_700_000_000_000 + 100 * time + offset);
            times.map(|time| PathBuf::from(name(time)).into()).collect()
        };
        let times = by_stamp(&[camera(0, 9), camera(3, 4), camera(7, 1)]).unwrap();
        let whole: Vec<&str> = times
            .iter()
            .filter(|time| time.images.iter().all(Option::is_some))
            .map(|time| &time.name[10..11])
            .collect();
        assert_eq!(whole, ["0", "2", "3", "5"]);
        let frames = ["0001.png", "0002.png"]
            .map(|name| PathBuf::from(name).into())
            .to_vec();
        assert!(
            by_stamp(&[frames.clone(), frames]).is_none(),
            "these are numbers, not times"
        );
    }
}
