//! The images of several folders, each of a camera or of a time.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::flat::word_and_number;
use super::{Inner, Layout, Named, Table, shown, stamp, stem};
use crate::aside::Aside;
use crate::error::SourceError;
use crate::folder::{self, Listing};
use crate::names::{self, Counts, Field, Whose};

/// The folders in a folder that hold images; some recorders put those in a further folder inside, as in `cam0/data`. And
/// those deeper down that are not looked into.
pub(super) fn inner(
    listing: &Listing,
    aside: &mut Aside,
) -> Result<(Inner, Vec<PathBuf>), SourceError> {
    let (mut inner, mut deeper) = (Vec::new(), Vec::new());
    for folder in &listing.folders {
        let mut images = Listing::read(folder)?;
        aside.add(images.aside.clone());
        let is_described = folder::is_described(folder)?;
        if images.images.is_empty() && !is_described {
            let inside: Vec<Listing> = images
                .folders
                .iter()
                .map(|folder| Listing::read(folder))
                .collect::<Result<_, _>>()?;
            let mut with = (0..inside.len()).filter(|&at| !inside[at].images.is_empty());
            if let (Some(only), None) = (with.next(), with.next()) {
                images.folders.remove(only);
                let only = inside.into_iter().nth(only).unwrap_or_default();
                aside.add(only.aside.clone());
                images.folders.extend(only.folders);
                images.images = only.images;
            }
        }
        if !images.images.is_empty() || is_described {
            inner.push((folder.clone(), images.images));
        }
        // What is described says itself what is a view.
        if !is_described {
            deeper.extend(images.folders);
        }
    }
    Ok((inner, deeper))
}

/// The images of several folders, of which each is a camera's or a time's.
pub(super) fn read(
    folder: &Path,
    inner: Inner,
    said: Option<Layout>,
) -> Result<Table, SourceError> {
    let are_cameras = match said {
        Some(layout) => layout == Layout::Cameras,
        None => are_cameras(folder, &inner)?,
    };
    let (mut names, mut known) = (Vec::new(), BTreeSet::new());
    for (path, _) in &inner {
        let mut name = shown(&folder::name(path));
        // Names that differ in what cannot be shown.
        while !known.insert(name.clone()) {
            name.push('\'');
        }
        names.push(name);
    }
    if are_cameras {
        return Ok(of_cameras(folder, &names, &inner));
    }
    let named = names.iter().zip(&inner).flat_map(|(name, (_, images))| {
        let named = |image: &PathBuf| (stem(image), name.clone(), image.clone().into());
        images.iter().map(named).collect::<Vec<Named>>()
    });
    Ok(Table {
        folders: inner.iter().map(|(path, _)| path.clone()).collect(),
        ..Table::of(folder, Layout::Times, named.collect())
    })
}

/// The images of a folder a camera, put together by what they have in common.
fn of_cameras(folder: &Path, names: &[String], inner: &Inner) -> Table {
    let stems = stems(inner);
    let table = |keys: &[Vec<String>]| {
        let mut named: Vec<Named> = Vec::new();
        for ((name, (_, images)), keys) in names.iter().zip(inner).zip(keys) {
            let each = images.iter().zip(keys);
            named
                .extend(each.map(|(image, key)| (name.clone(), key.clone(), image.clone().into())));
        }
        Table::of(folder, Layout::Cameras, named)
    };
    let mut by_stem = table(&stems);
    if by_stem.has_whole() && shared(&stems) >= MOSTLY {
        by_stem.put_together_by_time(false);
        return by_stem;
    }
    if by_stem.put_together_by_time(true) {
        return by_stem;
    }
    // Cameras may put words of their own around what they share.
    let all = [Some(stems), numbers(inner), varying(inner)];
    let all: Vec<Vec<Vec<String>>> = all.into_iter().flatten().collect();
    if let Some(most) = all.iter().find(|keys| shared(keys) >= MOSTLY) {
        let mut table = table(most);
        table.put_together_by_time(false);
        return table;
    }
    // A few that are alike are so by chance.
    if by_stem.put_together_by_time(false) {
        return by_stem;
    }
    if let Some(some) = all.iter().find(|keys| shared(keys) > 0.0) {
        return table(some);
    }
    by_stem.put_together_by_order();
    by_stem
}

/// The share of times that several cameras must have in common for these to be their times, and not alike by chance.
const MOSTLY: f64 = 0.5;

/// The share of all keys that several folders have.
fn shared(keys: &[Vec<String>]) -> f64 {
    let mut folders: BTreeMap<&str, usize> = BTreeMap::new();
    for own in keys {
        let different: BTreeSet<&str> = own.iter().map(String::as_str).collect();
        for key in different {
            *folders.entry(key).or_default() += 1;
        }
    }
    let several = folders.values().filter(|count| **count > 1).count();
    several as f64 / folders.len().max(1) as f64
}

fn stems(inner: &Inner) -> Vec<Vec<String>> {
    let stems =
        |(_, images): &(PathBuf, Vec<PathBuf>)| images.iter().map(|image| stem(image)).collect();
    inner.iter().map(stems).collect()
}

/// The numbers that all names end with, where none is there twice in a folder.
fn numbers(inner: &Inner) -> Option<Vec<Vec<String>>> {
    if inner.iter().any(|(_, images)| has_twins(images)) {
        return None;
    }
    let number = |stem: &String| Some(word_and_number(stem).1).filter(|number| !number.is_empty());
    let own = |stems: &Vec<String>| stems.iter().map(number).collect();
    stems(inner).iter().map(own).collect()
}

/// The fields of names of one kind that differ within a folder, and those that do not.
struct Split {
    /// Of every image, in what it differs from others of its folder.
    varying: Vec<Vec<String>>,
    /// Of every folder, in what all its images agree.
    common: Vec<String>,
}

fn split(inner: &Inner) -> Option<Split> {
    let fields: Vec<Vec<Vec<Field>>> = stems(inner)
        .iter()
        .map(|stems| stems.iter().map(|stem| names::fields(stem)).collect())
        .collect();
    let first = fields.first()?.first()?;
    let kinds = |fields: &[Field]| fields.iter().map(|f| f.is_number).collect::<Vec<_>>();
    let is_alike = |own: &Vec<Field>| kinds(own) == kinds(first);
    if !fields.iter().flatten().all(is_alike) {
        return None;
    }
    let varies = |at: &usize| {
        let mut folders = fields.iter();
        folders.any(|own| own.iter().any(|image| image[*at] != own[0][*at]))
    };
    let (varying, common): (Vec<usize>, Vec<usize>) = (0..first.len()).partition(varies);
    let joined = |image: &Vec<Field>, at: &[usize]| {
        let texts: Vec<&str> = at.iter().map(|&at| image[at].text.as_str()).collect();
        texts.join("_")
    };
    (!varying.is_empty()).then(|| Split {
        varying: fields
            .iter()
            .map(|own| own.iter().map(|image| joined(image, &varying)).collect())
            .collect(),
        common: fields.iter().map(|own| joined(&own[0], &common)).collect(),
    })
}

/// In what names differ within their folder: what all images of a camera have in common is its own name.
fn varying(inner: &Inner) -> Option<Vec<Vec<String>>> {
    split(inner).map(|split| split.varying)
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
    let folders: Vec<String> = inner
        .iter()
        .map(|(path, _)| shown(&folder::name(path)))
        .collect();
    // All images of a folder name one side, and those of the others another one.
    let common = split(inner).map(|split| split.common);
    if common.as_ref().is_some_and(|own| names::are_sides(own)) {
        return Ok(true);
    }
    let whose = names::whose(&folders, true);
    let by_folder = match (names::beside_sides(&folders), call(&folders, true)) {
        (Some(_), _) => Counts::Cameras,
        (None, counts) => counts,
    };
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
    // Folders that are called after cameras are never times, unless what they hold is too.
    let is_named = whose.is_some() || names::are_one_cameras(&folders);
    match (by_folder, is_named && !all(Counts::Cameras)) {
        (Counts::Unknown, true) => return Ok(true),
        (Counts::Times, true) => return Err(readings()),
        _ => {}
    }
    if by_folder == Counts::Unknown
        && whose.is_none()
        && let Some(common) = common
        && let Some(Whose::Twins(twins)) = names::whose(&common, false)
    {
        return Err(SourceError::Twins {
            path: folder.to_owned(),
            what: "folders",
            names: twins.map(|twin| folders[twin].clone()),
        });
    }
    let are_kinds = folders.iter().all(|name| names::kind(name).is_some());
    match (by_folder, all(Counts::Cameras), all(Counts::Times)) {
        (Counts::Cameras, false, _) => Ok(true),
        (Counts::Times, _, false) => Ok(false),
        (Counts::Unknown, true, _) => Ok(false),
        (Counts::Unknown, _, true) => Ok(true),
        // Names say nothing. A rig has fewer cameras than times, and a scene few views.
        (Counts::Unknown, false, false) => match inner.len() {
            0..3 if are_kinds => Ok(true),
            0..3 if least >= 3 && most < MANY => Ok(false),
            0..3 => Ok(true),
            _ if most == 1 => Ok(true),
            folders if !are_kinds && folders > most && (most > 2 || folders >= MANY) => Ok(false),
            folders if folders < most && most >= MANY => Ok(true),
            _ => Err(readings()),
        },
        _ => Err(readings()),
    }
}

/// Whether names are those of cameras or of times.
fn call(names: &[String], are_folders: bool) -> Counts {
    if names::are_sides(names) || names.iter().all(|name| names::is_lettered(name)) {
        return Counts::Cameras;
    }
    if names.iter().all(|name| stamp::is_sure(name)) {
        return Counts::Times;
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

#[cfg(test)]
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
}
