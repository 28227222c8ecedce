//! Folders of images: which files are views, which of them are taken, in what order.

use std::cmp::Ordering;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use messages::Size;

use crate::description::Description;
use crate::error::SourceError;
use crate::image_file::{self, Head};
use crate::middlebury;
use crate::settings::{Mode, Views};
use crate::truth::{Encoding, TruthFile};

/// The images of one scene, in a folder.
#[derive(Clone, Debug)]
pub(crate) struct Album {
    pub(crate) path: PathBuf,
    /// The folder's name.
    pub(crate) name: String,
    /// The chosen views, left to right.
    pub(crate) shots: Vec<Shot>,
    pub(crate) choice: Choice,
    pub(crate) size: Size,
    /// Steps between neighbouring chosen views; of a rail one.
    pub(crate) step: f64,
    /// Whether it is said where the views were taken.
    pub(crate) is_described: bool,
    /// Whether any chosen image is in colour, and whether any has 16 bit.
    pub(crate) is_colour: bool,
    pub(crate) is_deep: bool,
    /// Files that are no images.
    pub(crate) others: usize,
}

/// One chosen view.
#[derive(Clone, Debug)]
pub(crate) struct Shot {
    pub(crate) path: PathBuf,
    pub(crate) position: f64,
    pub(crate) truth: Option<TruthFile>,
}

/// Which views were chosen, and why these.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choice {
    pub(crate) views: Vec<u32>,
    pub(crate) why: Why,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Why {
    Asked,
    All,
    FirstTriple,
    FirstThree,
}

impl Choice {
    /// The views asked for, or a sensible choice among `count` views.
    pub(crate) fn among(asked: &Views, count: usize, triple: Option<&[u32]>) -> Self {
        let (views, why) = match (asked, triple) {
            (Views::All, _) => ((0..count as u32).collect(), Why::Asked),
            (Views::These(asked), _) if !asked.is_empty() => (asked.clone(), Why::Asked),
            _ if count == 3 => (vec![0, 1, 2], Why::All),
            (_, Some(triple)) => (triple.to_vec(), Why::FirstTriple),
            (_, None) => (vec![0, 1, 2], Why::FirstThree),
        };
        Self { views, why }
    }

    /// The frames asked for, or all.
    fn of_frames(asked: &Views, count: usize) -> Self {
        match asked {
            Views::These(asked) if !asked.is_empty() => Self {
                views: asked.clone(),
                why: Why::Asked,
            },
            _ => Self {
                views: (0..count as u32).collect(),
                why: Why::All,
            },
        }
    }

    /// Whether these are at least three views of a scene of so many, in order.
    fn check(&self, scene: &str, count: usize) -> Result<(), SourceError> {
        let chosen = &self.views;
        if chosen.len() < 3 {
            return Err(SourceError::TooFewChosen {
                chosen: chosen.clone(),
            });
        }
        if !chosen.is_sorted_by(|a, b| a < b) {
            return Err(SourceError::ViewOrder {
                chosen: chosen.clone(),
            });
        }
        match chosen.iter().find(|&&view| view as usize >= count) {
            Some(&view) => Err(SourceError::NoSuchView {
                scene: scene.to_owned(),
                view,
                count,
            }),
            None => Ok(()),
        }
    }

    /// The step between the chosen views, when the choice makes sense for a scene of views at these positions.
    pub(crate) fn step(&self, scene: &str, positions: &[f64]) -> Result<f64, SourceError> {
        self.check(scene, positions.len())?;
        let (chosen, scene) = (&self.views, scene.to_owned());
        let places: Vec<f64> = chosen
            .iter()
            .map(|&view| positions[view as usize])
            .collect();
        let step = places[1] - places[0];
        if places
            .windows(2)
            .any(|pair| (pair[1] - pair[0] - step).abs() > 1e-6 * step)
        {
            return Err(SourceError::UnequalSteps {
                scene,
                chosen: chosen.clone(),
                positions: places,
            });
        }
        Ok(step)
    }
}

/// What a folder holds, by type.
#[derive(Debug, Default)]
pub(crate) struct Listing {
    /// In the order of views.
    pub(crate) images: Vec<PathBuf>,
    pub(crate) folders: Vec<PathBuf>,
    pub(crate) others: usize,
}

impl Listing {
    pub(crate) fn read(folder: &Path) -> Result<Self, SourceError> {
        let mut listing = Self::default();
        for entry in fs::read_dir(folder).map_err(SourceError::io(folder))? {
            let path = entry.map_err(SourceError::io(folder))?.path();
            let is_hidden = path
                .file_name()
                .is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
            match () {
                () if is_hidden => {}
                () if path.is_dir() => listing.folders.push(path),
                () if image_file::is_image(&path) => listing.images.push(path),
                () => listing.others += 1,
            }
        }
        sort(&mut listing.images);
        listing.folders.sort_by(|a, b| by_name(a, b));
        Ok(listing)
    }
}

/// Opens a folder of images, or a folder of such folders, and checks the head of every chosen image.
pub(crate) fn open(folder: &Path, asked: &Views, mode: Mode) -> Result<Vec<Album>, SourceError> {
    let listing = Listing::read(folder)?;
    if let Some(album) = album(folder, &listing, asked, mode)? {
        return Ok(vec![album]);
    }
    let mut albums: Vec<Album> = Vec::new();
    let mut others = listing.others;
    for folder in &listing.folders {
        let inner = Listing::read(folder)?;
        match album(folder, &inner, asked, mode)? {
            Some(album) => albums.push(album),
            None => others += inner.others,
        }
    }
    let Some(first) = albums.first_mut() else {
        return Err(SourceError::Empty {
            path: folder.to_owned(),
            others,
        });
    };
    first.others += others;
    let expected = first.shots.len();
    match albums.iter().find(|album| album.shots.len() != expected) {
        Some(album) => Err(SourceError::ViewCount {
            path: album.path.clone(),
            found: album.shots.len(),
            expected,
        }),
        None => Ok(albums),
    }
}

/// The scene in a folder; `None` when it holds neither images nor a description.
fn album(
    folder: &Path,
    listing: &Listing,
    asked: &Views,
    mode: Mode,
) -> Result<Option<Album>, SourceError> {
    let described = Description::read(folder)?;
    let others = listing.others - usize::from(described.is_some());
    let is_described = described.is_some();
    let (files, positions, triple, truths) = match described {
        Some(own) => (
            own.views
                .iter()
                .map(|view| folder.join(&view.file))
                .collect(),
            own.positions(),
            own.triples
                .into_iter()
                .map(|triple| triple.views)
                .find(|views| views.len() >= 3),
            own.ground_truth
                .into_iter()
                .map(|truth| {
                    let path = folder.join(&truth.file);
                    let encoding = Encoding::Deep;
                    (truth.view as usize, TruthFile { path, encoding })
                })
                .collect(),
        ),
        None if let Some(layout) = middlebury::layout(folder)? => {
            (layout.files, layout.positions, None, layout.truths)
        }
        None if listing.images.is_empty() => return Ok(None),
        None => (
            listing.images.clone(),
            (0..listing.images.len()).map(|i| i as f64).collect(),
            None,
            Vec::new(),
        ),
    };
    if files.len() < 3 {
        return Err(SourceError::TooFewViews {
            path: folder.to_owned(),
            found: files.len(),
        });
    }
    let scene = folder.display().to_string();
    let (choice, step) = match mode {
        Mode::Rig => {
            let choice = Choice::among(asked, files.len(), triple.as_deref());
            let step = choice.step(&scene, &positions)?;
            (choice, step)
        }
        Mode::Rail => {
            let choice = Choice::of_frames(asked, files.len());
            choice.check(&scene, files.len())?;
            (choice, 1.0)
        }
    };
    let shot = |&view: &u32| Shot {
        path: files[view as usize].clone(),
        position: positions[view as usize],
        truth: truths
            .iter()
            .find(|(known, _)| *known == view as usize)
            .map(|(_, truth)| truth.clone()),
    };
    let shots: Vec<Shot> = choice.views.iter().map(shot).collect();
    let heads = shots
        .iter()
        .map(|shot| image_file::head(&shot.path))
        .collect::<Result<Vec<Head>, _>>()?;
    let size = heads[0].size;
    if let Some(odd) = heads.iter().position(|head| head.size != size) {
        return Err(SourceError::SizeDiffers {
            path: shots[odd].path.clone(),
            size: heads[odd].size,
            first: shots[0].path.clone(),
            expected: size,
        });
    }
    Ok(Some(Album {
        path: folder.to_owned(),
        name: name(folder),
        shots,
        choice,
        size,
        step,
        is_described,
        is_colour: heads.iter().any(|head| head.is_colour),
        is_deep: heads.iter().any(|head| head.is_deep),
        others,
    }))
}

/// Whether this is a folder that can be looked into.
pub(crate) fn check(path: &Path, nearest: Option<&'static str>) -> Result<(), SourceError> {
    match fs::metadata(path) {
        Ok(facts) if facts.is_dir() => Ok(()),
        Ok(_) => Err(SourceError::NotAFolder {
            path: path.to_owned(),
        }),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(SourceError::NotFound {
            path: path.to_owned(),
            nearest,
        }),
        Err(error) => Err(SourceError::Io {
            path: path.to_owned(),
            error,
        }),
    }
}

/// The last part of a path; of one like `..` that of the folder meant.
pub(crate) fn name(path: &Path) -> String {
    let last = |path: &Path| {
        path.file_name()
            .map(|name| name.to_string_lossy().into_owned())
    };
    last(path)
        .or_else(|| last(&path.canonicalize().ok()?))
        .unwrap_or_else(|| path.display().to_string())
}

/// Puts views, or cameras, in their order: by name, and three of which one is called left and one right by side.
pub(crate) fn sort(views: &mut [PathBuf]) {
    views.sort_by(|a, b| by_name(a, b));
    sort_by_side(views);
}

fn by_name(a: &Path, b: &Path) -> Ordering {
    let name = |path: &Path| {
        path.file_name()
            .map(|name| name.to_string_lossy().into_owned())
            .unwrap_or_default()
    };
    natural(&name(a), &name(b)).then_with(|| a.cmp(b))
}

/// Words for the sides, left to right.
const SIDES: [&[&str]; 3] = [
    &["left"],
    &["centre", "center", "central", "middle"],
    &["right"],
];

/// Three images of which one is called left, one right and one after the middle go in that order.
fn sort_by_side(images: &mut [PathBuf]) {
    let side = |path: &PathBuf| {
        let name = path.file_stem()?.to_string_lossy().to_lowercase();
        SIDES
            .iter()
            .position(|words| words.iter().any(|word| name.contains(word)))
    };
    let mut sides: Vec<_> = images.iter().map(side).collect();
    sides.sort_unstable();
    if sides == [Some(0), Some(1), Some(2)] {
        images.sort_by_key(side);
    }
}

/// Compares names as people do: runs of digits by their value, so that `view10` comes after `view9`.
pub(crate) fn natural(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    loop {
        let (first, second) = (piece(a), piece(b));
        let by_value = |digits: &str| digits.trim_start_matches('0').to_owned();
        let order = match (is_number(first), is_number(second)) {
            (true, true) => {
                let (first, second) = (by_value(first), by_value(second));
                first
                    .len()
                    .cmp(&second.len())
                    .then_with(|| first.cmp(&second))
            }
            _ => first.cmp(second),
        };
        if order != Ordering::Equal || first.is_empty() {
            return order;
        }
        (a, b) = (&a[first.len()..], &b[second.len()..]);
    }
}

fn is_number(piece: &str) -> bool {
    piece.starts_with(|c: char| c.is_ascii_digit())
}

/// The run of digits, or of other characters, that a name starts with.
fn piece(name: &str) -> &str {
    let digits = is_number(name);
    &name[..name
        .find(|c: char| c.is_ascii_digit() != digits)
        .unwrap_or(name.len())]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_sorted_by_the_value_of_their_numbers() {
        let mut names = [
            "view10.png",
            "view9.png",
            "b.png",
            "view1b.png",
            "view01.png",
            "view1.png",
            "a2x10",
            "a2x9",
        ];
        names.sort_by(|a, b| natural(a, b).then_with(|| a.cmp(b)));
        assert_eq!(
            names,
            [
                "a2x9",
                "a2x10",
                "b.png",
                "view01.png",
                "view1.png",
                "view1b.png",
                "view9.png",
                "view10.png"
            ]
        );
    }

    #[test]
    fn numbers_too_large_for_any_type_are_still_compared() {
        let (small, large) = ("9".repeat(40), "1".to_owned() + &"0".repeat(40));
        assert_eq!(natural(&small, &large), Ordering::Less);
    }
}
