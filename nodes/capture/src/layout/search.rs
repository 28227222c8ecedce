//! Where in a folder the images lie that are meant: in itself, or in those inside.

use std::path::{Path, PathBuf};

use super::{Inner, Layout, Table, folders, one_folder};
use crate::error::SourceError;
use crate::folder::{self, Listing};

/// Folders inside each other that are looked into, and folders in all: whoever gives a whole disk is not to wait for it.
const DEEPEST: usize = 6;
const MOST_FOLDERS: usize = 2000;

impl Table {
    /// Finds out who took what in a folder, as is said or by itself.
    ///
    /// # Errors
    /// A folder without images or that cannot be read, or whose images can be read in two ways.
    pub(crate) fn read(path: &Path, said: Option<Layout>) -> Result<Self, SourceError> {
        let mut folder = path.to_owned();
        let mut listing = Listing::read(&folder)?;
        let mut aside = listing.aside.clone();
        let (mut inner, mut deeper) = folders::inner(&listing, &mut aside)?;
        // Some recorders put folders of their own around everything.
        while listing.images.is_empty() && !folder::is_described(&folder)? {
            let is_said = matches!(said, Some(Layout::Cameras | Layout::Times));
            if is_said && !inner.is_empty() {
                break;
            }
            let only = match &inner[..] {
                [(only, _)] => only.clone(),
                [] => match &holding(&folder)[..] {
                    [] => break,
                    [only] => only.clone(),
                    several => return Err(deep(&folder, several)),
                },
                _ => break,
            };
            folder = only;
            listing = Listing::read(&folder)?;
            aside.add(listing.aside.clone());
            deeper.retain(|other| !other.starts_with(&folder));
            let (own, more) = folders::inner(&listing, &mut aside)?;
            inner = own;
            deeper.extend(more);
        }
        let (here, below) = (
            listing.images.len(),
            inner.iter().map(|(_, images)| images.len()).sum::<usize>(),
        );
        if here + below == 0 {
            return Err(SourceError::Empty {
                path: path.to_owned(),
                others: aside.others(),
                endings: aside.endings(),
            });
        }
        let is_here = match said {
            Some(Layout::Cameras | Layout::Times) => false,
            Some(_) => true,
            None => are_here(here, &inner) || folder::is_described(&folder)?,
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
        let mut left = MOST_FOLDERS;
        let deeper = deeper
            .iter()
            .map(|inside| count(inside, DEEPEST, &mut left));
        let deeper: usize = match folder::is_described(&folder)? {
            true => 0,
            false => deeper.sum(),
        };
        let table = match is_here {
            true => one_folder::read(&folder, listing.images, said)?,
            false => folders::read(&folder, inner, said)?,
        };
        Ok(Self {
            ignored: deeper + if is_here { below } else { here },
            aside,
            ..table
        })
    }
}

/// Whether the images of a folder are meant, of which there are so many, and not those in the folders inside it.
fn are_here(here: usize, inner: &Inner) -> bool {
    /// A single folder is no rig and no row of times: beside the views of a scene it holds something else.
    const VIEWS: usize = 3;
    let below: usize = inner.iter().map(|(_, images)| images.len()).sum();
    here >= below || (here >= VIEWS && inner.len() == 1)
}

/// The folders in a folder that hold images, however deep.
fn holding(folder: &Path) -> Vec<PathBuf> {
    let mut left = MOST_FOLDERS;
    let folders = Listing::read(folder).map_or(Vec::new(), |listing| listing.folders);
    let mut found = folders;
    found.retain(|inside| holds(inside, DEEPEST, &mut left).is_some());
    found
}

/// A folder with images in this one, or this one.
fn holds(folder: &Path, deeper: usize, left: &mut usize) -> Option<PathBuf> {
    *left = left.checked_sub(1)?;
    // Who may not be read by us holds nothing for us.
    let listing = Listing::read(folder).ok()?;
    if !listing.images.is_empty() {
        return Some(folder.to_owned());
    }
    let deeper = deeper.checked_sub(1)?;
    let mut inside = listing.folders.iter();
    inside.find_map(|folder| holds(folder, deeper, left))
}

/// How many images a folder and those inside it hold.
fn count(folder: &Path, deeper: usize, left: &mut usize) -> usize {
    let (Some(rest), Some(deeper)) = (left.checked_sub(1), deeper.checked_sub(1)) else {
        return 0;
    };
    *left = rest;
    let Ok(listing) = Listing::unsorted(folder) else {
        return 0;
    };
    let inside = listing.folders.iter();
    listing.images.len()
        + inside
            .map(|inside| count(inside, deeper, left))
            .sum::<usize>()
}

/// Images in folders of several folders.
fn deep(folder: &Path, several: &[PathBuf]) -> SourceError {
    let mut left = MOST_FOLDERS;
    let first = several.iter();
    let first = first.filter_map(|inside| holds(inside, DEEPEST, &mut left));
    let relative = |path: PathBuf| {
        let inside = path.strip_prefix(folder).map(Path::to_owned);
        super::shown(&inside.unwrap_or(path).to_string_lossy())
    };
    SourceError::Deep {
        path: folder.to_owned(),
        folders: first.map(relative).collect(),
    }
}
