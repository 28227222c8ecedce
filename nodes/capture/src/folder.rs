//! Folders of images: which files are views, which of them are taken, in what order.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use messages::Size;
use messages::words::counted;

use crate::aside::{self, Aside};
use crate::description::Description;
use crate::error::SourceError;
use crate::image_file::{self, Head};
use crate::layout::{self, Layout, Piece, Table, Time, Together};
use crate::middlebury;
use crate::names::{self, Whose};
use crate::panels::Part;
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
    /// Which part of the picture, where it shows several views.
    pub(crate) part: Option<Part>,
    pub(crate) position: f64,
    pub(crate) truth: Option<TruthFile>,
}

impl Shot {
    /// Its file's name, and which part of it.
    pub(crate) fn name(&self) -> String {
        self.with_part(name(&self.path))
    }

    /// Its path from a folder, and which part of it.
    pub(crate) fn file(&self, root: &Path) -> String {
        let path = self.path.strip_prefix(root).unwrap_or(&self.path);
        self.with_part(layout::shown(&path.to_string_lossy()))
    }

    fn with_part(&self, name: String) -> String {
        match self.part {
            Some(part) => format!("{name}, {part}"),
            None => name,
        }
    }
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
    /// What is neither.
    pub(crate) aside: Aside,
}

impl Listing {
    pub(crate) fn read(folder: &Path) -> Result<Self, SourceError> {
        let mut listing = Self::unsorted(folder)?;
        names::sort_cameras(&mut listing.images, |image| layout::stem(image));
        names::sort(&mut listing.folders, |folder| name(folder));
        Ok(listing)
    }

    /// The same in any order, for who only counts.
    pub(crate) fn unsorted(folder: &Path) -> Result<Self, SourceError> {
        let mut listing = Self::default();
        for entry in fs::read_dir(folder).map_err(SourceError::io(folder))? {
            let path = entry.map_err(SourceError::io(folder))?.path();
            let is_hidden = path
                .file_name()
                .is_some_and(|name| aside::is_hidden(&name.to_string_lossy()));
            match () {
                () if is_hidden => {}
                () if path.is_dir() => listing.folders.push(path),
                // Neither pipes nor devices, of which none ends.
                () if image_file::is_image(&path) && path.is_file() => listing.images.push(path),
                () => listing.aside.add_other(path),
            }
        }
        listing.images.sort();
        // What is described says itself what is a view.
        if !is_described(folder)? {
            listing.aside.take_images(&mut listing.images);
            let has_images = !listing.images.is_empty();
            listing.aside.take_folders(&mut listing.folders, has_images);
        }
        Ok(listing)
    }
}

/// Scenes of a folder, and how they were found in it.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub(crate) albums: Vec<Album>,
    pub(crate) layout: Layout,
    /// What is to be said of how images were put together.
    pub(crate) notices: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// The text of a file that is looked for by its name: a pipe of that name has no end.
pub(crate) fn read_plain(path: &Path) -> io::Result<String> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is no plain file"));
    }
    fs::read_to_string(path)
}

/// Whether a folder's own files say which of them are views: a `scene.json`, or a layout of Middlebury's.
pub(crate) fn is_described(folder: &Path) -> Result<bool, SourceError> {
    Ok(Description::is_in(folder) || middlebury::layout(folder)?.is_some())
}

/// Opens the scenes that a folder holds, however they lie in it, and checks the head of every chosen image.
pub(crate) fn open(
    folder: &Path,
    asked: &Views,
    mode: Mode,
    said: Option<Layout>,
) -> Result<Found, SourceError> {
    let is_rail = mode == Mode::Rail;
    let said = said.or(is_rail
        .then_some(Layout::Rail)
        .filter(|_| is_described(folder).unwrap_or_default()));
    let table = Table::read(folder, said)?;
    if said.is_none() && !is_rail && table.layout == Layout::Views {
        one_cameras(&table)?;
    }
    let (mut notices, mut warnings) = (table.aside.sentences(folder), Vec::new());
    match (table.ignored, table.layout) {
        (0, _) => {}
        (ignored, layout) => warnings.push(format!(
            "{} that {} elsewhere in {} {} not taken: read as {} ({})",
            counted(ignored, "image"),
            if ignored == 1 { "lies" } else { "lie" },
            folder.display(),
            if ignored == 1 { "is" } else { "are" },
            layout.describe(),
            "--layout says another"
        )),
    }
    let albums = match table.layout {
        Layout::Views | Layout::Rail => {
            let listing = Listing::read(&table.folder)?;
            album(&table.folder, &listing, asked, mode)?
                .into_iter()
                .collect()
        }
        layout if is_rail => {
            return Err(SourceError::RailOfRig {
                path: table.folder.clone(),
                layout,
                cameras: table.cameras,
                times: table.times.len(),
            });
        }
        Layout::Times if !is_regular(&table)? => {
            let mut albums = Vec::new();
            for folder in &table.folders {
                albums.extend(album(folder, &Listing::read(folder)?, asked, mode)?);
            }
            albums
        }
        _ => in_turn(&table, asked, &mut notices, &mut warnings)?,
    };
    let mut albums: Vec<Album> = albums;
    let Some(first) = albums.first_mut() else {
        return Err(SourceError::Empty {
            path: folder.to_owned(),
            others: table.aside.others(),
            endings: table.aside.endings(),
        });
    };
    let several = |shot: &&Shot| image_file::holds_more(&shot.path);
    if let Some(shot) = first.shots.iter().find(several) {
        warnings.push(format!(
            "{} holds several pictures, of which the first is taken: save each in a file of its own",
            shot.file(folder)
        ));
    }
    first.others = table
        .aside
        .others()
        .saturating_sub(usize::from(first.is_described));
    let expected = first.shots.len();
    if let Some(album) = albums.iter().find(|album| album.shots.len() != expected) {
        return Err(SourceError::ViewCount {
            path: album.path.clone(),
            found: album.shots.len(),
            expected,
        });
    }
    Ok(Found {
        albums,
        layout: table.layout,
        notices,
        warnings,
    })
}

/// Refuses a folder whose names say that one camera took its images, one after the other.
fn one_cameras(table: &Table) -> Result<(), SourceError> {
    /// Folders that recorders put inside those of cameras.
    const INSIDE: [&str; 5] = ["data", "images", "frames", "rgb", "image_raw"];
    let whole = fs::canonicalize(&table.folder).unwrap_or_else(|_| table.folder.clone());
    let around = whole
        .parent()
        .filter(|_| INSIDE.contains(&name(&whole).as_str()));
    let has_depth = table.aside.has_depth_in(&table.folder);
    let mut folders = around.into_iter().chain([whole.as_path()]);
    let camera =
        folders.find_map(|folder| names::only_camera(&name(folder), &table.cameras, has_depth));
    match camera {
        Some(camera) if !is_described(&table.folder)? => Err(SourceError::TwoLayouts {
            path: table.folder.clone(),
            first: format!("the images of one camera ({camera})"),
            second: "the views of one scene".to_owned(),
            say: "--layout views if they are a scene's, --layout rail if one camera moved, or give the folder that \
                  holds those of all cameras",
        }),
        _ => Ok(()),
    }
}

/// Whether the folders of times name their images alike, so that a name is a camera's, and none describes itself.
fn is_regular(table: &Table) -> Result<bool, SourceError> {
    let most = table
        .times
        .iter()
        .map(|time| time.images.iter().flatten().count())
        .max();
    for folder in &table.folders {
        if is_described(folder)? {
            return Ok(false);
        }
    }
    Ok(table.cameras.len() >= 3 && most == Some(table.cameras.len()))
}

/// The scans of a rig's cameras: every time at which all that are chosen took an image.
fn in_turn(
    table: &Table,
    asked: &Views,
    notices: &mut Vec<String>,
    warnings: &mut Vec<String>,
) -> Result<Vec<Album>, SourceError> {
    let count = table.cameras.len();
    if count < 3 {
        return Err(SourceError::TooFewCameras {
            path: table.folder.clone(),
            layout: table.layout,
            cameras: table.cameras.clone(),
            times: table.times.len(),
        });
    }
    if let Some(name) = names::without_side(&table.cameras)
        && *asked == Views::These(Vec::new())
    {
        return Err(SourceError::Side {
            path: table.folder.clone(),
            name: name.clone(),
        });
    }
    if !matches!(asked, Views::These(asked) if !asked.is_empty()) {
        let (are_folders, what) = match table.layout {
            Layout::Cameras => (true, "folders"),
            _ => (false, "images"),
        };
        own_cameras(&table.folder, &table.cameras, are_folders, what)?;
    }
    let choice = Choice::among(asked, count, None);
    let positions: Vec<f64> = (0..count).map(|camera| camera as f64).collect();
    let step = choice.step(&table.folder.display().to_string(), &positions)?;
    let (mut albums, mut lacking) = (Vec::new(), Vec::new());
    for time in &table.times {
        let pieces = choice
            .views
            .iter()
            .map(|&view| time.images[view as usize].as_ref());
        let pieces: Option<Vec<&Piece>> = pieces.collect();
        match pieces {
            Some(pieces) => albums.push(of_time(table, time, &pieces, &choice, step)?),
            None => lacking.push(time),
        }
    }
    if let Some(first) = lacking.first() {
        let camera = choice
            .views
            .iter()
            .find(|&&view| first.images[view as usize].is_none());
        let camera = camera.map_or("", |&view| table.cameras[view as usize].as_str());
        if albums.is_empty() {
            return Err(SourceError::NeverTogether {
                path: table.folder.clone(),
                cameras: table.cameras.clone(),
                time: first.name.clone(),
                camera: camera.to_owned(),
            });
        }
        warnings.push(format!(
            "{} of {} {} left out, for not all cameras took an image: {} lacks {camera}'s{}",
            counted(lacking.len(), "time"),
            table.times.len(),
            if lacking.len() > 1 { "are" } else { "is" },
            first.name,
            if lacking.len() > 1 { " for one" } else { "" }
        ));
    }
    if let Some(first) = table.alone.first() {
        warnings.push(format!(
            "{} {} left out, for {} no partner in time: the first is {}",
            counted(table.alone.len(), "image"),
            if table.alone.len() > 1 { "are" } else { "is" },
            if table.alone.len() > 1 {
                "they have"
            } else {
                "it has"
            },
            layout::shown(
                &first
                    .strip_prefix(&table.folder)
                    .unwrap_or(first)
                    .to_string_lossy()
            )
        ));
    }
    match table.together {
        Together::Name => {}
        Together::Stamp => notices.push("images are put together by the times they are called after".to_owned()),
        Together::Order => warnings.push(
            "no two images have a name or number in common: they are put together by their order, which one missing image puts wrong"
                .to_owned(),
        ),
    }
    Ok(albums)
}

/// Refuses names of which two are of one camera.
fn own_cameras(
    path: &Path,
    cameras: &[String],
    are_folders: bool,
    what: &'static str,
) -> Result<(), SourceError> {
    match names::whose(cameras, are_folders) {
        Some(Whose::Twins(twins)) => Err(SourceError::Twins {
            path: path.to_owned(),
            what,
            names: twins.map(|twin| cameras[twin].clone()),
        }),
        _ => Ok(()),
    }
}

/// What the chosen cameras took at one time.
fn of_time(
    table: &Table,
    time: &Time,
    pieces: &[&Piece],
    choice: &Choice,
    step: f64,
) -> Result<Album, SourceError> {
    let shots = pieces.iter().zip(&choice.views).map(|(piece, &view)| Shot {
        path: piece.path.clone(),
        part: piece.part,
        position: view.into(),
        truth: None,
    });
    let path = match table.layout {
        Layout::Times => table.folder.join(&time.name),
        _ => table.folder.clone(),
    };
    Album {
        path,
        name: time.name.clone(),
        shots: shots.collect(),
        choice: choice.clone(),
        size: Size::default(),
        step,
        is_described: false,
        is_colour: false,
        is_deep: false,
        others: 0,
    }
    .checked()
}

impl Album {
    /// With what the heads of its images say, which must be of one size.
    fn checked(mut self) -> Result<Self, SourceError> {
        let mut heads = Vec::with_capacity(self.shots.len());
        for shot in &self.shots {
            let head = image_file::head(&shot.path)?;
            heads.push(match shot.part {
                Some(part) => Head {
                    size: part.size(&shot.path, head.size)?,
                    ..head
                },
                None => head,
            });
        }
        self.size = heads[0].size;
        if let Some(odd) = heads.iter().position(|head| head.size != self.size) {
            return Err(SourceError::SizeDiffers {
                path: self.shots[odd].path.clone(),
                size: heads[odd].size,
                first: self.shots[0].path.clone(),
                expected: self.size,
            });
        }
        self.is_colour = heads.iter().any(|head| head.is_colour);
        self.is_deep = heads.iter().any(|head| head.is_deep);
        Ok(self)
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
    let others = listing.aside.others() - usize::from(described.is_some());
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
        None if let Some(name) = unsided(listing)
            .filter(|_| mode == Mode::Rig && *asked == Views::These(Vec::new())) =>
        {
            return Err(SourceError::Side {
                path: folder.to_owned(),
                name,
            });
        }
        None => {
            if mode == Mode::Rig && !matches!(asked, Views::These(asked) if !asked.is_empty()) {
                let stems: Vec<String> = listing.images.iter().map(|i| layout::stem(i)).collect();
                own_cameras(folder, &stems, false, "images")?;
            }
            (
                listing.images.clone(),
                (0..listing.images.len()).map(|i| i as f64).collect(),
                None,
                Vec::new(),
            )
        }
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
        part: None,
        position: positions[view as usize],
        truth: truths
            .iter()
            .find(|(known, _)| *known == view as usize)
            .map(|(_, truth)| truth.clone()),
    };
    let album = Album {
        path: folder.to_owned(),
        name: name(folder),
        shots: choice.views.iter().map(shot).collect(),
        choice,
        size: Size::default(),
        step,
        is_described,
        is_colour: false,
        is_deep: false,
        others,
    };
    album.checked().map(Some)
}

/// An image that says no side where others say left and right.
fn unsided(listing: &Listing) -> Option<String> {
    let stems: Vec<String> = listing
        .images
        .iter()
        .map(|image| layout::stem(image))
        .collect();
    let stem = names::without_side(&stems)?;
    let image = listing
        .images
        .iter()
        .find(|image| layout::stem(image) == *stem);
    image.map(|image| name(image))
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
