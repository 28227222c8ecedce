//! Which names are of one camera, as `left` and `left_color` are: of two sets of cameras, or of two kinds of images.

use std::collections::BTreeSet;

use super::{
    CAMERAS, COLOURS, COMPANIONS, Counts, Field, LETTERS, PICTURES, Place, bare_names, counts,
    fields, one_camera, place, ranks, side,
};

/// Words for the kind of a camera's images: beside one such folder another one holds the same scene once more.
const KINDS: [&str; 14] = [
    "rgb", "rgbd", "color", "colour", "gray", "grey", "mono", "ir", "infra", "infrared", "nir",
    "thermal", "depth", "depths",
];
/// Words for what was done to images, which with those above may stand beside a camera's own.
const TREATED: [&str; 5] = ["raw", "rect", "rectified", "undistorted", "data"];

/// What names say of their cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Whose {
    /// Each is another one's.
    Own,
    /// These two are of one camera.
    Twins([usize; 2]),
}

/// Where each of these names says that its camera stands, if all do and not all at one side.
fn places(names: &[String]) -> Option<Vec<Place>> {
    let all = |letters: [&str; 3]| -> Option<Vec<Place>> {
        let bare = bare_names(names);
        bare.iter().find_map(|bare| {
            let places = bare.iter().map(|name| place(name, letters, 1));
            let places: Vec<Place> = places.collect::<Option<_>>()?;
            let has = |side: i32| places.iter().any(|place| place.side == side);
            (has(-1) && has(1)).then_some(places)
        })
    };
    all(["", "", ""]).or_else(|| all(LETTERS[0]))
}

/// The sides of names that all say one.
pub(super) fn sides(names: &[String]) -> Option<Vec<i32>> {
    let places = places(names)?;
    Some(places.into_iter().map(|place| place.side).collect())
}

/// The number or letter of the camera that a name says, as in `cam0_raw` and `camA`.
fn number(fields: &[Field], are_folders: bool) -> Option<(usize, String)> {
    let is_letter = |at: usize| {
        let before = at.checked_sub(1).map(|before| fields[before].text.as_str());
        !fields[at].is_number
            && fields[at].text.chars().count() == 1
            && before.is_some_and(|word| CAMERAS.contains(&word))
    };
    let is_camera = |at: &usize| match fields[*at].is_number {
        true => counts(fields, *at, are_folders) == Counts::Cameras,
        false => is_letter(*at),
    };
    let at = (0..fields.len()).rev().find(is_camera)?;
    Some((at, fields[at].text.clone()))
}

/// What these names say of their cameras by sides or numbers; `None` where they say nothing. In files' names numbers beside
/// that of the camera may be anything, as in `view1_5`.
pub(crate) fn whose(names: &[String], are_folders: bool) -> Option<Whose> {
    if let Some(places) = places(names) {
        let is_ranked = ranks(names).is_some();
        let pairs = || (0..names.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
        let same_rank = |[a, b]: &[usize; 2]| places[*a] == places[*b];
        let same_side = |[a, b]: &[usize; 2]| places[*a].side == places[*b].side;
        let pair = pairs()
            .find(same_rank)
            .or_else(|| pairs().find(same_side))
            .filter(|_| !is_ranked);
        return Some(pair.map_or(Whose::Own, Whose::Twins));
    }
    let all: Vec<Vec<Field>> = names.iter().map(|name| fields(name)).collect();
    let cameras: Vec<(usize, String)> = all
        .iter()
        .map(|fields| number(fields, are_folders))
        .collect::<Option<_>>()?;
    let different: BTreeSet<&str> = cameras.iter().map(|(_, own)| own.as_str()).collect();
    if different.len() < 2 {
        return None;
    }
    let rest = |name: usize| -> BTreeSet<&str> {
        let (at, _) = cameras[name];
        let others = all[name].iter().enumerate().filter(|(own, _)| *own != at);
        let is_word = |field: &&Field| !field.is_number && field.text.chars().count() > 1;
        let others = others.map(|(_, field)| field);
        others
            .filter(|field| !is_word(field))
            .map(|field| field.text.as_str())
            .collect()
    };
    let is_twin =
        |a: usize, b: usize| cameras[a].1 == cameras[b].1 && (are_folders || rest(a) == rest(b));
    let twins = (0..names.len()).find_map(|b| (0..b).find(|&a| is_twin(a, b)).map(|a| [a, b]));
    Some(twins.map_or(Whose::Own, Whose::Twins))
}

/// Whether a name is made of words and numbers of cameras and their images alone.
pub(super) fn is_plain(name: &str) -> bool {
    let is_of_camera = |field: &Field| {
        let word = field.text.as_str();
        let all = [
            &CAMERAS[..],
            &COMPANIONS,
            &PICTURES,
            &COLOURS,
            &KINDS,
            &TREATED,
        ];
        field.is_number
            || all.iter().any(|words| words.contains(&word))
            || side(word, ["", "", ""]).is_some()
    };
    fields(name).iter().all(is_of_camera)
}

/// Whether folders of these names are all one camera's, as `left` and `left_raw`.
pub(crate) fn are_one_cameras(names: &[String]) -> bool {
    let cameras: Option<BTreeSet<String>> = names
        .iter()
        .map(|name| one_camera(name).filter(|_| is_plain(name)))
        .collect();
    cameras.is_some_and(|cameras| cameras.len() == 1)
}

/// The word for the kind of its images by which alone a folder is called, as `rgb`, `image_raw` or `infra1`.
pub(crate) fn kind(folder: &str) -> Option<String> {
    let fields = fields(folder);
    let is_topic = |pair: &[Field]| pair[0].text == "image" && pair[1].text == "raw";
    let kind = fields.iter().find(|field| is_kind(&field.text));
    match (kind, fields.windows(2).any(is_topic), is_plain(folder)) {
        (Some(kind), _, true) => Some(kind.text.clone()),
        (None, true, true) => Some("image_raw".to_owned()),
        _ => None,
    }
}

/// Whether a word is one for the kind of a camera's images.
pub(super) fn is_kind(word: &str) -> bool {
    KINDS.contains(&word)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(names: &[&str], are_folders: bool) -> Option<Vec<String>> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        Some(match whose(&names, are_folders)? {
            Whose::Own => Vec::new(),
            Whose::Twins(twins) => twins.map(|twin| names[twin].clone()).to_vec(),
        })
    }

    #[test]
    fn two_names_of_one_side_or_number_are_of_one_camera() {
        let cases: [(&[&str], Option<&[&str]>); 12] = [
            (&["left", "centre", "right"], Some(&[])),
            (&["left2", "left1", "right1", "right2"], Some(&[])),
            (
                &["right_arm_left", "right_arm_mid", "right_arm_right"],
                Some(&[]),
            ),
            (
                &["left", "left_ir", "right", "right_ir"],
                Some(&["left", "left_ir"]),
            ),
            (&["l", "l_raw", "r"], Some(&["l", "l_raw"])),
            (
                &["rig1_left", "rig1_right", "rig2_left"],
                Some(&["rig1_left", "rig2_left"]),
            ),
            (&["cam0", "cam1", "cam10"], Some(&[])),
            (&["cam0", "cam0_raw", "cam1"], Some(&["cam0", "cam0_raw"])),
            (&["camA", "camB", "camB_raw"], Some(&["camB", "camB_raw"])),
            (&["rig_cam1_a", "rig_cam1_b"], None),
            (&["scan_1", "scan_2"], None),
            (&["left", "left_raw"], None),
        ];
        for (names, expected) in cases {
            let told = told(names, true);
            let told = told
                .as_ref()
                .map(|twins| twins.iter().map(String::as_str).collect::<Vec<_>>());
            assert_eq!(told.as_deref(), expected, "{names:?}");
        }
        // A folder's other number is a set's, a file's may be a part of a step.
        let names = ["view1", "view1_5", "view2"];
        assert_eq!(told(&names, false), Some(Vec::new()));
        assert_eq!(told(&names, true).map(|twins| twins.len()), Some(2));
    }
}
