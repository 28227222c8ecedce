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
}

/// What the cameras took at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// What its images have in common in their names.
    pub name: String,
    /// The image of each camera that took one.
    pub images: Vec<Option<PathBuf>>,
}

/// An image's camera and shot, by name.
type Named = (String, String, PathBuf);

impl Shots {
    /// Finds out who took what in a folder.
    ///
    /// Images in the folder itself are of one camera; where their names are a word and a number, of as many as there are
    /// words (`left01.png`, `right01.png`). Of folders in it each holds one camera's images, or each those of one time:
    /// the cameras are the fewer.
    ///
    /// # Errors
    /// A folder without images, that cannot be read, or whose images of one camera differ in size.
    pub fn open(path: &Path) -> Result<Self, SourceError> {
        folder::check(path, None)?;
        let listing = Listing::read(path)?;
        let mut others = listing.others;
        let mut named = Vec::new();
        if listing.images.is_empty() {
            let mut folders = Vec::new();
            for inner in &listing.folders {
                let images = Listing::read(inner)?;
                others += images.others;
                if !images.images.is_empty() {
                    folders.push((folder::name(inner), images.images));
                }
            }
            named = in_folders(folders);
        } else {
            in_one(listing.images, &mut named);
        }
        if named.is_empty() {
            return Err(SourceError::Empty {
                path: path.to_owned(),
                others,
            });
        }
        Self::of(named)
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
            let size = image_file::head(&path)?.size;
            let (expected, first) = sizes[number].get_or_insert_with(|| (size, path.clone()));
            if *expected != size {
                return Err(SourceError::SizeDiffers {
                    path,
                    size,
                    first: first.clone(),
                    expected: *expected,
                });
            }
            let none = || vec![None; cameras.len()];
            let is_taken = by_name
                .get(&shot)
                .is_some_and(|images| images[number].is_some());
            // Of one name but for its ending: an image of another time.
            let shot = if is_taken { folder::name(&path) } else { shot };
            by_name.entry(shot).or_insert_with(none)[number] = Some(path);
        }
        let mut shots: Vec<Shot> = by_name
            .into_iter()
            .map(|(name, images)| Shot { name, images })
            .collect();
        shots.sort_by(|a, b| folder::natural(&a.name, &b.name).then_with(|| a.name.cmp(&b.name)));
        Ok(Self {
            cameras,
            shots,
            sizes: sizes.into_iter().flatten().map(|(size, _)| size).collect(),
        })
    }

    /// How many images there are.
    pub fn count(&self) -> usize {
        let images = self.shots.iter().flat_map(|shot| &shot.images);
        images.flatten().count()
    }
}

/// The images of one folder: of one camera, or of as many as there are words before numbers.
fn in_one(images: Vec<PathBuf>, named: &mut Vec<Named>) {
    let parts: Vec<(String, String)> = images.iter().map(|image| word_and_number(image)).collect();
    let words: BTreeSet<&str> = parts.iter().map(|(word, _)| word.as_str()).collect();
    let numbers: BTreeSet<&str> = parts.iter().map(|(_, number)| number.as_str()).collect();
    // Words that go with the same numbers, not names that happen to differ.
    let is_rig = words.len() > 1
        && words.len() < numbers.len()
        && parts
            .iter()
            .all(|(word, number)| !word.is_empty() && !number.is_empty());
    for (image, (word, number)) in images.into_iter().zip(parts) {
        named.push(match is_rig {
            true => (word, number, image),
            false => ("camera".to_owned(), stem(&image), image),
        });
    }
}

/// The images of several folders, of which each is a camera's or a shot's.
fn in_folders(folders: Vec<(String, Vec<PathBuf>)>) -> Vec<Named> {
    let most = folders.iter().map(|(_, images)| images.len()).max();
    let are_cameras = most.is_some_and(|most| folders.len() <= most);
    // Cameras may put their own word before the number they share.
    let every = |images: &[PathBuf]| {
        images
            .iter()
            .all(|image| !word_and_number(image).1.is_empty())
    };
    let by_number = are_cameras && folders.iter().all(|(_, images)| every(images));
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
    named
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// A name's last number, and what comes before it.
fn word_and_number(path: &Path) -> (String, String) {
    let stem = stem(path);
    let word = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = &stem[word.len()..];
    (
        word.trim_end_matches(['_', '-', ' ', '.']).to_owned(),
        number.to_owned(),
    )
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
        let mut named = Vec::new();
        in_one(paths(&files), &mut named);
        assert_eq!(
            names(&named),
            [
                ("left", "01"),
                ("left", "02"),
                ("left", "03"),
                ("right", "01"),
                ("right", "03")
            ]
        );
    }

    #[test]
    fn a_folder_of_other_names_is_one_camera() {
        let mut named = Vec::new();
        in_one(paths(&["a1.png", "b2.png", "near.png"]), &mut named);
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
            names(&in_folders(cameras)),
            [
                ("cam0", "001"),
                ("cam0", "002"),
                ("cam0", "003"),
                ("cam1", "001"),
                ("cam1", "003")
            ]
        );
        let shot = |name: &str| (name.to_owned(), paths(&["left.png", "right.png"]));
        let shots = vec![shot("000"), shot("001"), shot("002")];
        assert_eq!(
            names(&in_folders(shots))[..3],
            [("left", "000"), ("right", "000"), ("left", "001")]
        );
    }
}
