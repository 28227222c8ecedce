//! The images of one folder: the views of a scene, several cameras' by name, or several views in each.

use std::path::{Path, PathBuf};

use super::flat::split;
use super::{Layout, Piece, Table, Time, Together, stem};
use crate::aside::Aside;
use crate::error::SourceError;
use crate::folder;
use crate::names;
use crate::panels::{self, Part};

/// The images of one folder.
pub(super) fn read(
    folder: &Path,
    images: Vec<PathBuf>,
    said: Option<Layout>,
) -> Result<Table, SourceError> {
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
        alone: Vec::new(),
        ignored: 0,
        aside: Aside::default(),
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
    // As in left_outer, left_inner, right_inner, right_outer.
    if said.is_none() && names::are_places(&stems) {
        return Ok(plain(Layout::Views));
    }
    let split = split(&stems).map_err(|[first, second]| SourceError::TwoLayouts {
        path: folder.to_owned(),
        first,
        second,
        say: "--layout views for the views of one scene, --layout rail for the frames of one camera, or give each its own folder",
    })?;
    if let Some(parts) = split {
        let each = parts.into_iter().zip(images);
        let named = each.map(|((camera, time), image)| (camera, time, image.into()));
        let mut table = Table::of(folder, Layout::Flat, named.collect());
        table.put_together_by_time(false);
        return Ok(table);
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
        alone: Vec::new(),
        ignored: 0,
        aside: Aside::default(),
    }
}
