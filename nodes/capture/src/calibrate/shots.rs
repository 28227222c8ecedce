//! Which images are of which camera, and which were taken at one time: a board's, held before cameras.

use std::path::Path;

use messages::Size;

use crate::error::SourceError;
use crate::folder;
use crate::image_file;
use crate::layout::{Layout, Piece, Table, Together, stem};

/// The images of a folder, by camera and by time.
#[derive(Clone, Debug, PartialEq)]
pub struct Shots {
    /// The cameras' names, left to right.
    pub cameras: Vec<String>,
    /// What was taken at one time, in order.
    pub shots: Vec<Shot>,
    /// The sizes of the cameras' images.
    pub sizes: Vec<Size>,
    /// How the images lie in their folder.
    pub layout: Layout,
    /// Whether images were put together by their order, for no two have a name or number in common.
    pub is_by_order: bool,
    /// Images that lie elsewhere: in folders beside images, or beside folders with more.
    pub ignored: usize,
    /// What is to be said of images that are no views.
    pub left_out: Vec<String>,
}

/// What the cameras took at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// What its images have in common in their names.
    pub name: String,
    /// The image of each camera that took one.
    pub images: Vec<Option<Piece>>,
}

impl Shots {
    /// Finds out who took what in a folder, as a run does; only that the images of a folder that say nothing of several
    /// cameras are of one, and not the views of a scene.
    ///
    /// # Errors
    /// A folder without images, that cannot be read, whose images can be read in two ways, or whose images of one camera
    /// differ in size.
    pub fn open(path: &Path, said: Option<Layout>) -> Result<Self, SourceError> {
        folder::check(path, None)?;
        let table = Table::read(path, said)?;
        let is_alone = matches!(table.layout, Layout::Views | Layout::Rail);
        let (cameras, shots) = match is_alone {
            true => {
                let images = table
                    .times
                    .into_iter()
                    .flat_map(|time| time.images)
                    .flatten();
                let shot = |image: Piece| Shot {
                    name: stem(&image.path),
                    images: vec![Some(image)],
                };
                (vec!["camera".to_owned()], images.map(shot).collect())
            }
            false => {
                let shot = |time: crate::layout::Time| Shot {
                    name: time.name,
                    images: time.images,
                };
                let shots: Vec<Shot> = table.times.into_iter().map(shot).collect();
                (table.cameras, shots)
            }
        };
        Ok(Self {
            sizes: sizes(cameras.len(), &shots)?,
            cameras,
            shots,
            layout: table.layout,
            is_by_order: table.together == Together::Order,
            ignored: table.ignored,
            left_out: table.aside.sentences(path),
        })
    }

    /// How many images there are.
    pub fn count(&self) -> usize {
        let images = self.shots.iter().flat_map(|shot| &shot.images);
        images.flatten().count()
    }
}

/// The size of each camera's images.
fn sizes(cameras: usize, shots: &[Shot]) -> Result<Vec<Size>, SourceError> {
    let mut sizes = Vec::with_capacity(cameras);
    for camera in 0..cameras {
        let images = || shots.iter().filter_map(|shot| shot.images[camera].as_ref());
        let mut known: Option<(Size, &Piece)> = None;
        for piece in images() {
            // One that cannot be read is found out, and named, when it is looked at.
            let Ok(size) = size(piece) else { continue };
            let (expected, first) = *known.get_or_insert((size, piece));
            if expected != size {
                return Err(SourceError::SizeDiffers {
                    path: piece.path.clone(),
                    size,
                    first: first.path.clone(),
                    expected,
                });
            }
        }
        // A camera of which no image can be read has no size; what is wrong with its first one says why.
        sizes.push(match (known, images().next()) {
            (Some((size, _)), _) => size,
            (None, Some(first)) => size(first)?,
            (None, None) => Size::default(),
        });
    }
    Ok(sizes)
}

fn size(piece: &Piece) -> Result<Size, SourceError> {
    let whole = image_file::head(&piece.path)?.size;
    match piece.part {
        Some(part) => part.size(&piece.path, whole),
        None => Ok(whole),
    }
}
