//! Files beside images that are no views: of other types, made of views, or the same once more.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use crate::image_file;
use crate::layout::stem;
use crate::names;

/// Folders that systems and their programs put everywhere.
const OF_SYSTEMS: [&str; 5] = [
    "__MACOSX",
    "@eaDir",
    "$RECYCLE.BIN",
    "System Volume Information",
    "lost+found",
];

/// Words for what is made of images, in the names of files and folders beside them.
const MADE: [&str; 32] = [
    "gt",
    "truth",
    "groundtruth",
    "depth",
    "depths",
    "disp",
    "disps",
    "disparity",
    "disparities",
    "mask",
    "masks",
    "seg",
    "segmentation",
    "segmentations",
    "semantic",
    "semantics",
    "label",
    "labels",
    "normals",
    "thumb",
    "thumbs",
    "thumbnail",
    "thumbnails",
    "confidence",
    "occlusion",
    "occlusions",
    "flow",
    "annotation",
    "annotations",
    "overlay",
    "preview",
    "previews",
];

/// Those of them for what a camera of depth gives beside each image.
const DEPTH: [&str; 2] = ["depth", "depths"];

/// Endings from those without loss to the others: of an image in several, the first is taken.
const BEST: [&str; 6] = ["png", "tif", "tiff", "pgm", "ppm", "bmp"];

/// Views that must remain where images are set aside.
const LEAST: usize = 3;

/// What is left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Aside {
    /// Files that are no images.
    others: BTreeSet<PathBuf>,
    /// Images and folders of them whose names say that they are made of others.
    made: BTreeSet<PathBuf>,
    /// Images that are there once more, with another ending.
    twins: BTreeSet<PathBuf>,
}

/// Whether a file or folder is none of the user's.
pub(crate) fn is_hidden(name: &str) -> bool {
    name.starts_with('.') || OF_SYSTEMS.contains(&name)
}

impl Aside {
    /// A file of another type.
    pub(crate) fn add_other(&mut self, path: PathBuf) {
        self.others.insert(path);
    }

    /// How many files of other types there are.
    pub(crate) fn others(&self) -> usize {
        self.others.len()
    }

    /// What these end with.
    pub(crate) fn endings(&self) -> Vec<String> {
        let endings = self.others.iter().filter_map(|path| path.extension());
        let endings: BTreeSet<String> = endings
            .map(|ending| format!(".{}", ending.to_string_lossy()))
            .collect();
        endings.into_iter().collect()
    }

    /// What is left out of another folder too.
    pub(crate) fn add(&mut self, other: Self) {
        self.others.extend(other.others);
        self.made.extend(other.made);
        self.twins.extend(other.twins);
    }

    /// Takes out of a folder's images those that are no views, where enough remain.
    pub(crate) fn take_images(&mut self, images: &mut Vec<PathBuf>) {
        let (made, others): (Vec<PathBuf>, Vec<PathBuf>) =
            images.drain(..).partition(|image| is_made(&stem(image)));
        *images = match others.len() >= LEAST {
            true => {
                self.made.extend(made);
                others
            }
            false => others.into_iter().chain(made).collect(),
        };
        let mut best: BTreeMap<OsString, (usize, PathBuf)> = BTreeMap::new();
        for image in &*images {
            let name = image.file_stem().unwrap_or_default().to_owned();
            let own = (rank(image), image.clone());
            match best.get_mut(&name) {
                Some(known) if own < *known => *known = own,
                Some(_) => {}
                None => {
                    best.insert(name, own);
                }
            }
        }
        let is_best = |image: &PathBuf| {
            let best = best.get(image.file_stem().unwrap_or_default());
            best.is_none_or(|(_, best)| best == image)
        };
        let (others, twins): (Vec<PathBuf>, Vec<PathBuf>) = images.drain(..).partition(is_best);
        *images = match others.len() >= LEAST {
            true => {
                self.twins.extend(twins);
                others
            }
            false => others.into_iter().chain(twins).collect(),
        };
    }

    /// Takes out of a folder's folders those whose names say that what they hold is made of images, which lie beside them or
    /// in the other folders.
    pub(crate) fn take_folders(&mut self, folders: &mut Vec<PathBuf>, has_images: bool) {
        let is_made = |folder: &PathBuf| is_made(&crate::folder::name(folder));
        if has_images || !folders.iter().all(is_made) {
            let made = folders.extract_if(.., |folder| is_made(folder));
            self.made.extend(made.filter(|folder| holds_images(folder)));
        }
    }

    /// Whether pictures of depth were left out of a folder.
    pub(crate) fn has_depth_in(&self, folder: &Path) -> bool {
        let is_depth = |image: &PathBuf| {
            let mut fields = names::fields(&stem(image)).into_iter();
            fields.any(|field| DEPTH.contains(&field.text.as_str()))
        };
        let mut made = self.made.iter();
        made.any(|image| image.parent() == Some(folder) && image.is_file() && is_depth(image))
    }

    /// What is to be said of what was left out of this folder.
    pub(crate) fn sentences(&self, root: &Path) -> Vec<String> {
        let some = |paths: &BTreeSet<PathBuf>| {
            let named: Vec<String> = paths
                .iter()
                .take(3)
                .map(|path| {
                    let inside = path.strip_prefix(root).unwrap_or(path);
                    crate::layout::shown(&inside.to_string_lossy())
                })
                .collect();
            let more = if paths.len() > named.len() {
                ", …"
            } else {
                ""
            };
            format!("{}{more}", named.join(", "))
        };
        let mut said = Vec::new();
        if !self.made.is_empty() {
            said.push(format!(
                "left out for their names, which say that they were made of images: {}; rename them if they are views",
                some(&self.made)
            ));
        }
        if !self.twins.is_empty() {
            said.push(format!(
                "left out because the same name is there with another ending: {}",
                some(&self.twins)
            ));
        }
        said
    }
}

/// Whether a folder holds images, or a folder in it does.
fn holds_images(folder: &Path) -> bool {
    let inside = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
    let is_image = |entry: fs::DirEntry| image_file::is_image(&entry.path());
    inside(folder).any(|entry| {
        let path = entry.path();
        image_file::is_image(&path) || (path.is_dir() && inside(&path).any(is_image))
    })
}

/// Whether a name says that its image was made of others.
fn is_made(name: &str) -> bool {
    let mut fields = names::fields(name).into_iter();
    fields.any(|field| MADE.contains(&field.text.as_str()))
}

/// How much speaks against the ending of an image.
fn rank(path: &Path) -> usize {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    let ending = ending.to_lowercase();
    let place = BEST.iter().position(|best| *best == ending);
    place.unwrap_or(BEST.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left(names: &[&str]) -> (Vec<String>, Aside) {
        let mut images: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
        let mut aside = Aside::default();
        aside.take_images(&mut images);
        let shown = images.iter().map(|image| image.display().to_string());
        (shown.collect(), aside)
    }

    #[test]
    fn what_is_called_after_what_is_made_of_images_is_no_view_where_three_others_are() {
        let (kept, aside) = left(&["l.png", "c.png", "r.png", "l_depth.png", "leftMask.png"]);
        assert_eq!(kept, ["l.png", "c.png", "r.png"]);
        assert!(aside.sentences(Path::new(""))[0].contains("l_depth.png, leftMask.png"));
        let few = ["left.png", "right.png", "depth.png"];
        assert_eq!(
            left(&few),
            (few.map(str::to_owned).to_vec(), Aside::default())
        );
        let all = ["depth0.png", "depth1.png", "depth2.png"];
        assert_eq!(left(&all).0, all);
    }

    #[test]
    fn of_an_image_with_two_endings_the_one_without_loss_is_taken() {
        let (kept, aside) = left(&["a.jpg", "a.png", "b.jpg", "b.png", "c.jpg", "c.png"]);
        assert_eq!(kept, ["a.png", "b.png", "c.png"]);
        assert_eq!(aside.twins.len(), 3);
        let mixed = ["left.png", "centre.jpg", "right.bmp"];
        assert_eq!(left(&mixed).0, mixed);
    }
}
