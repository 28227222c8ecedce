//! Which images are of which camera, and which were taken at one time.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use messages::Size;

use crate::error::SourceError;
use crate::folder::{self, Listing};
use crate::image_file;

/// The images of a folder, by camera and by time.
#[derive(Clone, Debug, PartialEq)]
pub struct Shots {
    /// The cameras' names, left to right.
    pub cameras: Vec<String>,
    /// What was taken at one time, in order.
    pub shots: Vec<Shot>,
    /// The sizes of the cameras' images.
    pub sizes: Vec<Size>,
    /// How the images say whose they are.
    pub layout: Layout,
    /// Whether images were put together by their order, for no two have a name or number in common.
    pub is_by_order: bool,
    /// Images that lie elsewhere: in folders beside images, or beside folders with more.
    pub ignored: usize,
}

/// What the cameras took at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// What its images have in common in their names.
    pub name: String,
    /// The image of each camera that took one.
    pub images: Vec<Option<PathBuf>>,
}

/// How images say whose they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// They are all of one camera.
    Alone,
    /// By a word in their names.
    Words,
    /// By their folder.
    FolderACamera,
    /// By their own names, in a folder a time.
    FolderATime,
}

/// What folders in a folder hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Folders {
    /// The cameras are the fewer, for there are more times than cameras.
    #[default]
    Fewer,
    /// Each the images of one camera.
    Cameras,
    /// Each the images of one time.
    Times,
}

/// An image's camera and shot, by name.
type Named = (String, String, PathBuf);

/// The folder in which some tools keep a camera's images.
const INNER: &str = "data";

impl Shots {
    /// Finds out who took what in a folder.
    ///
    /// Images in the folder itself are of one camera; where their names are a word and a number, of as many as there are
    /// words (`left01.png` or `01_left.png`). Folders in it hold a camera's images each, or those of one time.
    ///
    /// # Errors
    /// A folder without images, that cannot be read, or whose images of one camera differ in size.
    pub fn open(path: &Path, folders: Folders) -> Result<Self, SourceError> {
        folder::check(path, None)?;
        let listing = Listing::read(path)?;
        let mut others = listing.others;
        let mut inner: Vec<(String, Vec<PathBuf>)> = Vec::new();
        for folder in &listing.folders {
            let mut images = Listing::read(folder)?;
            let data = folder.join(INNER);
            if images.images.is_empty() && data.is_dir() {
                images = Listing::read(&data)?;
            }
            others += images.others;
            if !images.images.is_empty() {
                let mut name = shown(&folder::name(folder));
                // Names that differ in what cannot be shown.
                while inner.iter().any(|(known, _)| *known == name) {
                    name.push('\'');
                }
                inner.push((name, images.images));
            }
        }
        let (here, below) = (
            listing.images.len(),
            inner.iter().map(|(_, images)| images.len()).sum(),
        );
        let (layout, named) = match here >= below {
            true => in_one(listing.images),
            false => in_folders(inner, folders),
        };
        if named.is_empty() {
            return Err(SourceError::Empty {
                path: path.to_owned(),
                others,
            });
        }
        Ok(Self {
            layout,
            ignored: here.min(below),
            ..Self::of(named)?
        })
    }

    fn of(named: Vec<Named>) -> Result<Self, SourceError> {
        let names: BTreeSet<&str> = named.iter().map(|(camera, ..)| camera.as_str()).collect();
        let mut cameras: Vec<PathBuf> = names.into_iter().map(PathBuf::from).collect();
        folder::sort(&mut cameras);
        let cameras: Vec<String> = cameras
            .into_iter()
            .map(|name| name.to_string_lossy().into_owned())
            .collect();
        let mut by_name: BTreeMap<String, Vec<Option<PathBuf>>> = BTreeMap::new();
        let mut sizes: Vec<Option<(Size, PathBuf)>> = vec![None; cameras.len()];
        for (camera, shot, path) in named {
            let Some(number) = cameras.iter().position(|known| *known == camera) else {
                continue;
            };
            // One that cannot be read is found out, and named, when it is looked at.
            if let Ok(size) = image_file::head(&path).map(|head| head.size) {
                let (expected, first) = sizes[number].get_or_insert_with(|| (size, path.clone()));
                if *expected != size {
                    return Err(SourceError::SizeDiffers {
                        path,
                        size,
                        first: first.clone(),
                        expected: *expected,
                    });
                }
            }
            let none = || vec![None; cameras.len()];
            let is_taken = by_name
                .get(&shot)
                .is_some_and(|images| images[number].is_some());
            // Of one name but for its ending: an image of another time.
            let shot = match is_taken {
                true => format!("{shot}/{}", shown(&folder::name(&path))),
                false => shot,
            };
            by_name.entry(shot).or_insert_with(none)[number] = Some(path);
        }
        let mut shots: Vec<Shot> = by_name
            .into_iter()
            .map(|(name, images)| Shot { name, images })
            .collect();
        shots.sort_by(|a, b| folder::natural(&a.name, &b.name).then_with(|| a.name.cmp(&b.name)));
        // A camera of which no image can be read has no size; what is wrong with its first one says why.
        let mut known = Vec::with_capacity(sizes.len());
        for (camera, size) in sizes.into_iter().enumerate() {
            let first = || shots.iter().find_map(|shot| shot.images[camera].as_deref());
            known.push(match (size, first()) {
                (Some((size, _)), _) => size,
                (None, Some(path)) => image_file::head(path)?.size,
                (None, None) => Size::default(),
            });
        }
        let mut shots = Self {
            cameras,
            shots,
            sizes: known,
            layout: Layout::Alone,
            is_by_order: false,
            ignored: 0,
        };
        shots.by_order();
        Ok(shots)
    }

    /// Puts images together by their order where no two have a name or number in common, as where times are their names,
    /// and all cameras took as many.
    fn by_order(&mut self) {
        let cameras = self.cameras.len();
        let taken = |camera: usize| {
            let images = self
                .shots
                .iter()
                .filter_map(|shot| shot.images[camera].clone());
            images.collect::<Vec<PathBuf>>()
        };
        let by_camera: Vec<Vec<PathBuf>> = (0..cameras).map(taken).collect();
        let is_shared = self
            .shots
            .iter()
            .any(|shot| shot.images.iter().flatten().count() > 1);
        let count = by_camera[0].len();
        if cameras < 2 || is_shared || by_camera.iter().any(|images| images.len() != count) {
            return;
        }
        self.is_by_order = true;
        self.shots = (0..count)
            .map(|number| Shot {
                name: stem(&by_camera[0][number]),
                images: by_camera
                    .iter()
                    .map(|images| Some(images[number].clone()))
                    .collect(),
            })
            .collect();
    }

    /// How many images there are.
    pub fn count(&self) -> usize {
        let images = self.shots.iter().flat_map(|shot| &shot.images);
        images.flatten().count()
    }
}

/// The images of one folder: of one camera, or of as many as there are words beside numbers.
fn in_one(images: Vec<PathBuf>) -> (Layout, Vec<Named>) {
    let splits = [word_and_number, number_and_word].into_iter();
    let mut splits = splits.map(|split| images.iter().map(|image| split(image)).collect());
    let rig = splits.find(|parts: &Vec<(String, String)>| is_rig(parts));
    let layout = match rig {
        Some(_) => Layout::Words,
        None => Layout::Alone,
    };
    let parts = rig.unwrap_or_else(|| {
        let alone = images
            .iter()
            .map(|image| ("camera".to_owned(), stem(image)));
        alone.collect()
    });
    let each = parts.into_iter().zip(images);
    let named = each.map(|((camera, shot), image)| (camera, shot, image));
    (layout, named.collect())
}

/// Whether these are words that go with the same numbers: each has most of its numbers in common with another.
fn is_rig(parts: &[(String, String)]) -> bool {
    let mut numbers: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (word, number) in parts {
        numbers.entry(word).or_default().insert(number);
    }
    let shares = |word: &str, own: &BTreeSet<&str>| {
        let mut others = numbers.iter().filter(|(other, _)| **other != word);
        others.any(|(_, other)| 2 * own.intersection(other).count() > own.len())
    };
    let is_whole = |(word, number): &(String, String)| !word.is_empty() && !number.is_empty();
    let all: BTreeSet<&str> = numbers.values().flatten().copied().collect();
    all.len() > 1
        && parts.iter().all(is_whole)
        && numbers.iter().all(|(word, own)| shares(word, own))
}

/// The images of several folders, of which each is a camera's or a shot's.
fn in_folders(folders: Vec<(String, Vec<PathBuf>)>, hold: Folders) -> (Layout, Vec<Named>) {
    let most = folders.iter().map(|(_, images)| images.len()).max();
    let are_cameras = match hold {
        Folders::Fewer => most.is_some_and(|most| folders.len() <= most),
        Folders::Cameras => true,
        Folders::Times => false,
    };
    // Cameras may put their own word before the number they share.
    let has_number = |image: &PathBuf| !word_and_number(image).1.is_empty();
    let by_number = are_cameras
        && folders
            .iter()
            .all(|(_, images)| images.iter().all(has_number));
    let mut named = Vec::new();
    for (folder, images) in folders {
        for image in images {
            let own = match by_number {
                true => word_and_number(&image).1,
                false => stem(&image),
            };
            named.push(match are_cameras {
                true => (folder.clone(), own, image),
                false => (own, folder.clone(), image),
            });
        }
    }
    match are_cameras {
        true => (Layout::FolderACamera, named),
        false => (Layout::FolderATime, named),
    }
}

fn stem(path: &Path) -> String {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy());
    stem.map(|stem| shown(&stem)).unwrap_or_default()
}

/// A name without what ends a line or cannot be shown.
fn shown(name: &str) -> String {
    let is_odd = |c: char| c.is_control() || ['\u{2028}', '\u{2029}'].contains(&c);
    name.replace(is_odd, "\u{fffd}")
}

/// What a name begins with, and the number that it ends with.
fn word_and_number(path: &Path) -> (String, String) {
    let stem = stem(path);
    let word = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    (bare(word), number(&stem[word.len()..]))
}

/// What stands around the first number in a name, and that.
fn number_and_word(path: &Path) -> (String, String) {
    let stem = stem(path);
    let is_digit = |c: char| c.is_ascii_digit();
    let Some(start) = stem.find(is_digit) else {
        return (stem, String::new());
    };
    let digits = stem[start..]
        .find(|c| !is_digit(c))
        .unwrap_or(stem.len() - start);
    let (before, after) = (&stem[..start], &stem[start + digits..]);
    let word = if bare(after).is_empty() {
        bare(before)
    } else {
        bare(after)
    };
    (word, number(&stem[start..start + digits]))
}

/// A word without what ties it to a number.
fn bare(word: &str) -> String {
    word.trim_matches(['_', '-', ' ', '.']).to_owned()
}

/// A number without the zeros before it.
fn number(digits: &str) -> String {
    let short = digits.trim_start_matches('0');
    match (digits.is_empty(), short.is_empty()) {
        (false, true) => "0".to_owned(),
        _ => short.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(named: &[Named]) -> Vec<(&str, &str)> {
        let each = named.iter();
        each.map(|(camera, shot, _)| (camera.as_str(), shot.as_str()))
            .collect()
    }

    fn paths(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn a_folder_of_words_with_numbers_is_a_camera_a_word() {
        let files = [
            "left01.png",
            "left02.png",
            "left03.png",
            "right01.png",
            "right03.png",
        ];
        let named = in_one(paths(&files)).1;
        assert_eq!(
            names(&named),
            [
                ("left", "1"),
                ("left", "2"),
                ("left", "3"),
                ("right", "1"),
                ("right", "3")
            ]
        );
    }

    #[test]
    fn a_folder_of_other_names_is_one_camera() {
        let named = in_one(paths(&["a1.png", "b2.png", "near.png"])).1;
        assert!(named.iter().all(|(camera, ..)| camera == "camera"));
        assert_eq!(names(&named)[2].1, "near");
    }

    #[test]
    fn of_folders_the_fewer_are_the_cameras() {
        let cameras = vec![
            (
                "cam0".to_owned(),
                paths(&["l_001.png", "l_002.png", "l_003.png"]),
            ),
            ("cam1".to_owned(), paths(&["r_001.png", "r_003.png"])),
        ];
        assert_eq!(
            names(&in_folders(cameras, Folders::Fewer).1),
            [
                ("cam0", "1"),
                ("cam0", "2"),
                ("cam0", "3"),
                ("cam1", "1"),
                ("cam1", "3")
            ]
        );
        let shot = |name: &str| (name.to_owned(), paths(&["left.png", "right.png"]));
        let shots = vec![shot("000"), shot("1"), shot("2")];
        assert_eq!(
            names(&in_folders(shots, Folders::Fewer).1)[..3],
            [("left", "000"), ("right", "000"), ("left", "1")]
        );
    }

    #[test]
    fn a_word_may_stand_before_or_after_the_number_and_numbers_may_have_zeros() {
        let after = [
            "img00_left.png",
            "img00_right.png",
            "img01_left.png",
            "img01_right.png",
            "img2_left.png",
        ];
        assert_eq!(
            names(&in_one(paths(&after)).1)[2..],
            [("left", "1"), ("right", "1"), ("left", "2")]
        );
        let before = [
            "cam0-08.png",
            "cam1_8.png",
            "cam0-09.png",
            "cam1_9.png",
            "cam1_10.png",
        ];
        assert_eq!(
            names(&in_one(paths(&before)).1)[..2],
            [("cam0", "8"), ("cam1", "8")]
        );
        let alone = ["a_1_of_3.png", "a_2_of_3.png", "a_3_of_3.png"];
        assert!(
            names(&in_one(paths(&alone)).1)
                .iter()
                .all(|(camera, _)| *camera == "camera")
        );
    }

    #[test]
    fn what_folders_hold_can_be_said() {
        let shot = |name: &str| (name.to_owned(), paths(&["a.png", "b.png", "c.png"]));
        let folders = || vec![shot("x"), shot("y")];
        assert_eq!(
            names(&in_folders(folders(), Folders::Fewer).1)[0],
            ("x", "a")
        );
        assert_eq!(
            names(&in_folders(folders(), Folders::Times).1)[0],
            ("a", "x")
        );
        let folders = || vec![shot("w"), shot("x"), shot("y"), shot("z")];
        assert_eq!(
            names(&in_folders(folders(), Folders::Fewer).1)[0],
            ("a", "w")
        );
        assert_eq!(
            names(&in_folders(folders(), Folders::Cameras).1)[0],
            ("w", "a")
        );
    }

    #[test]
    fn images_with_no_name_in_common_are_put_together_by_their_order() {
        let shot = |name: &str, camera: usize| {
            let mut images = vec![None; 2];
            images[camera] = Some(PathBuf::from(name));
            Shot {
                name: name.to_owned(),
                images,
            }
        };
        let mut shots = Shots {
            cameras: vec!["a".to_owned(), "b".to_owned()],
            shots: vec![
                shot("100", 0),
                shot("101", 1),
                shot("200", 0),
                shot("202", 1),
            ],
            sizes: vec![Size::new(64, 48); 2],
            layout: Layout::Alone,
            is_by_order: false,
            ignored: 0,
        };
        shots.by_order();
        assert!(shots.is_by_order);
        let both = |shot: &Shot| {
            shot.images
                .iter()
                .flatten()
                .map(|p| stem(p))
                .collect::<Vec<_>>()
        };
        assert_eq!(
            shots.shots.iter().map(both).collect::<Vec<_>>(),
            [["100", "101"], ["200", "202"]]
        );
    }
}
