//! Which topics of a bag are which views: as they are told, else by their names.
//!
//! Topics that differ in one word only belong together when that word is a side or a number: `/left/image_rect` and
//! `/right/image_rect`, `/cam0/image_raw` and `/cam1/image_raw`.

use std::collections::BTreeMap;

use super::wire::Why;
use crate::names;

/// Words of topics that show no scene.
const NO_SCENE: [&str; 8] = [
    "depth",
    "disparity",
    "mask",
    "label",
    "labels",
    "confidence",
    "segmentation",
    "overlay",
];

/// Words for what was done to an image, which say nothing of who took it.
const TREATMENTS: [&str; 14] = [
    "image",
    "raw",
    "rect",
    "rectified",
    "color",
    "colour",
    "rgb",
    "mono",
    "gray",
    "grey",
    "compressed",
    "resized",
    "ffmpeg",
    "theora",
];

/// A topic of images.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Candidate {
    pub(super) name: String,
    pub(super) is_compressed: bool,
}

/// Where a view is, as its name says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Role {
    Side(usize),
    Number(u64),
}

impl Role {
    fn of(word: &str) -> Option<Self> {
        let side = names::side_of(word).map(|side| (side + 1) as usize);
        side.map(Self::Side)
            .or_else(|| word.parse().ok().map(Self::Number))
    }
}

/// The words of a name, in small letters; digits are words of their own.
fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut last = None;
    for letter in name.chars() {
        let kind = match letter {
            '0'..='9' => 1,
            letter if letter.is_alphabetic() => 2,
            _ => 0,
        };
        match words.last_mut() {
            Some(word) if last == Some(kind) && kind > 0 => word.extend(letter.to_lowercase()),
            _ if kind > 0 => words.push(letter.to_lowercase().collect()),
            _ => {}
        }
        last = Some(kind);
    }
    words
}

/// Whether images of a topic are rectified, by its name.
pub(super) fn is_rectified(name: &str) -> bool {
    words(name).iter().any(|word| word.starts_with("rect"))
}

/// The topic without what says how images are carried: `/left/image_rect/compressed` is `/left/image_rect`.
fn carried(name: &str) -> &str {
    name.strip_suffix("/compressed").unwrap_or(name)
}

/// The namespace of a topic.
pub(super) fn namespace(name: &str) -> &str {
    let name = carried(name);
    name.rfind('/').map_or("", |end| &name[..end])
}

/// Topics that belong together, left to right.
#[derive(Clone, Debug, PartialEq)]
struct Group {
    /// What they have in common, without words for how they were treated.
    who: Vec<String>,
    /// What is taken first where the same was recorded several ways: rectified, gray, not compressed.
    rank: (bool, bool, bool),
    members: Vec<usize>,
}

/// The topics of the views that were told, as `left=/a` or `/a`: numbers of candidates, left to right.
pub(super) fn told(told: &[String], candidates: &[Candidate]) -> Result<Vec<usize>, Why> {
    let mut views = Vec::new();
    for (place, one) in told.iter().enumerate() {
        let (view, name) = match one.split_once('=') {
            None => (None, one.trim()),
            Some((view, name)) => {
                let view = view.trim().to_lowercase();
                let role = match view.as_str() {
                    "moving" | "camera" => Role::Number(0),
                    _ => Role::of(&view).ok_or_else(|| {
                        format!("{view:?} is no view: expected left, centre, right or a number, as in left=/camera/left/image")
                    })?,
                };
                (Some(role), name.trim())
            }
        };
        let rooted = format!("/{name}");
        let found = candidates.iter().position(|one| one.name == name);
        let found = found.or_else(|| candidates.iter().position(|one| one.name == rooted));
        let found = found.ok_or_else(|| {
            let known = candidates.iter().map(|one| one.name.as_str());
            let nearest = messages::settings::nearest(name, known);
            let meant = nearest.map_or(String::new(), |name| format!(", did you mean {name}?"));
            format!("it has no images on {name}{meant}")
        })?;
        views.push((view.unwrap_or(Role::Number(place as u64)), found));
    }
    let mut places: Vec<usize> = views.iter().map(|(_, found)| *found).collect();
    places.sort_unstable();
    let is_twice = places.windows(2).any(|pair| pair[0] == pair[1]);
    views.sort_by_key(|(role, _)| match role {
        Role::Side(side) => *side as u64,
        Role::Number(number) => *number,
    });
    let is_one = views.windows(2).any(|pair| pair[0].0 == pair[1].0);
    if is_twice || is_one {
        return Err("topics names a view or a topic twice".to_owned());
    }
    Ok(views.into_iter().map(|(_, found)| found).collect())
}

/// The topics of the views of a rig by their names: numbers of candidates, left to right.
pub(super) fn by_name(candidates: &[Candidate]) -> Result<Vec<usize>, Why> {
    let all: Vec<usize> = scenes(candidates).collect();
    let mut groups = groups(candidates, &all);
    if groups.is_empty() {
        // Names that have nothing in common but a side each.
        let side = |&number: &usize| {
            let words = words(&candidates[number].name);
            let mut sides = words.iter().filter_map(|word| match Role::of(word) {
                Some(Role::Side(side)) if word.len() > 1 => Some(side),
                _ => None,
            });
            sides.next()
        };
        let mut members = all.clone();
        members.sort_by_key(side);
        let sides: Vec<Option<usize>> = members.iter().map(side).collect();
        if sides == [Some(0), Some(1), Some(2)] {
            return Ok(members);
        }
        return Err(match all.len() {
            0 => "no topic holds images that show a scene".to_owned(),
            count @ 1..3 => format!(
                "it holds images of {count} topics, and three views are matched; of one camera that moves set capture.mode to rail"
            ),
            _ => "which topics are which views is not to be seen from their names".to_owned(),
        });
    }
    groups.sort_by_key(|group| group.rank);
    let first = &groups[0];
    if groups.iter().any(|other| other.who != first.who) {
        return Err("several rigs may be meant".to_owned());
    }
    Ok(first.members.clone())
}

/// The one topic of a camera along a rail.
pub(super) fn alone(candidates: &[Candidate]) -> Result<usize, Why> {
    let mut all: Vec<usize> = scenes(candidates).collect();
    all.sort_by_key(|&number| treatment(&candidates[number], &words(&candidates[number].name)).1);
    let who = |number: usize| treatment(&candidates[number], &words(&candidates[number].name)).0;
    match all.first() {
        None => Err("no topic holds images that show a scene".to_owned()),
        Some(&first) if all.iter().all(|&other| who(other) == who(first)) => Ok(first),
        Some(_) => Err("along a rail one camera moves, and several may be meant".to_owned()),
    }
}

/// Those that show a scene.
fn scenes(candidates: &[Candidate]) -> impl Iterator<Item = usize> + '_ {
    let shows = |number: &usize| {
        let words = words(&candidates[*number].name);
        !words.iter().any(|word| NO_SCENE.contains(&word.as_str()))
    };
    (0..candidates.len()).filter(shows)
}

/// What the words of a name say of who took the image, and how it was treated.
fn treatment(candidate: &Candidate, words: &[String]) -> (Vec<String>, (bool, bool, bool)) {
    let has = |some: &[&str]| words.iter().any(|word| some.contains(&word.as_str()));
    let who = words
        .iter()
        .filter(|word| !TREATMENTS.contains(&word.as_str()))
        .cloned()
        .collect();
    let rank = (
        !is_rectified(&candidate.name),
        has(&["color", "colour", "rgb"]),
        candidate.is_compressed,
    );
    (who, rank)
}

/// What topics of a group have in common: all words but one, whether that is a side, and whether they are compressed.
type Alike = (Vec<String>, bool, bool);

/// Groups of at least three topics that differ in one word only, a side or a number.
fn groups(candidates: &[Candidate], among: &[usize]) -> Vec<Group> {
    let mut alike: BTreeMap<Alike, Vec<(Role, usize)>> = BTreeMap::new();
    for &number in among {
        let candidate = &candidates[number];
        let words = words(&candidate.name);
        for place in 0..words.len() {
            let Some(role) = Role::of(&words[place]) else {
                continue;
            };
            let mut pattern = words.clone();
            "*".clone_into(&mut pattern[place]);
            let is_side = matches!(role, Role::Side(_));
            let key = (pattern, is_side, candidate.is_compressed);
            alike.entry(key).or_default().push((role, number));
        }
    }
    let mut groups = Vec::new();
    for ((pattern, is_side, _), mut members) in alike {
        members.sort_unstable();
        let is_clear = members.windows(2).all(|pair| pair[0].0 != pair[1].0);
        if members.len() < 3 || !is_clear || (is_side && members.len() != 3) {
            continue;
        }
        let (who, rank) = treatment(&candidates[members[0].1], &pattern);
        groups.push(Group {
            who,
            rank,
            members: members.into_iter().map(|(_, number)| number).collect(),
        });
    }
    groups
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn candidates(names: &[&str]) -> Vec<Candidate> {
        let of = |name: &&str| Candidate {
            name: (*name).to_owned(),
            is_compressed: name.ends_with("/compressed"),
        };
        names.iter().map(of).collect()
    }

    fn chosen<'a>(names: &[&'a str]) -> Result<Vec<&'a str>, Why> {
        let found = by_name(&candidates(names))?;
        Ok(found.into_iter().map(|number| names[number]).collect())
    }

    #[test]
    fn sides_and_numbers_put_topics_in_order() {
        for (names, expected) in [
            (
                &[
                    "/right/image_rect",
                    "/left/image_rect",
                    "/centre/image_rect",
                ][..],
                &[
                    "/left/image_rect",
                    "/centre/image_rect",
                    "/right/image_rect",
                ][..],
            ),
            (
                &["/cam10/image_raw", "/cam9/image_raw", "/cam2/image_raw"],
                &["/cam2/image_raw", "/cam9/image_raw", "/cam10/image_raw"],
            ),
            (
                &[
                    "/rig1/cam_R/image",
                    "/rig1/cam_L/image",
                    "/rig1/cam_C/image",
                ],
                &[
                    "/rig1/cam_L/image",
                    "/rig1/cam_C/image",
                    "/rig1/cam_R/image",
                ],
            ),
            (
                &["/stereo/Left", "/mono/center_image", "/stereo/Right"],
                &["/stereo/Left", "/mono/center_image", "/stereo/Right"],
            ),
            (
                &["/camera2", "/camera0", "/camera1", "/camera3"],
                &["/camera0", "/camera1", "/camera2", "/camera3"],
            ),
        ] {
            assert_eq!(chosen(names).as_deref(), Ok(expected));
        }
    }

    #[test]
    fn what_was_recorded_several_ways_is_taken_rectified_gray_and_uncompressed() {
        let sides = ["left", "centre", "right"];
        let ways = [
            "image_raw",
            "image_raw/compressed",
            "image_rect_color",
            "image_rect",
            "image_rect/compressed",
            "depth",
        ];
        let names: Vec<String> = ways
            .iter()
            .flat_map(|way| sides.map(|side| format!("/{side}/{way}")))
            .collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        assert_eq!(
            chosen(&names).as_deref(),
            Ok(&[
                "/left/image_rect",
                "/centre/image_rect",
                "/right/image_rect"
            ][..])
        );
    }

    #[test]
    fn what_names_leave_open_is_not_guessed() {
        for names in [
            &["/a/image", "/b/image", "/c/image"][..],
            &["/left/image", "/right/image"],
            &[
                "/front/cam0",
                "/front/cam1",
                "/front/cam2",
                "/rear/cam0",
                "/rear/cam1",
                "/rear/cam2",
            ],
            &["/left/image", "/right/image", "/top/image"],
            &[],
        ] {
            assert!(chosen(names).is_err(), "{names:?}");
        }
    }

    #[test]
    fn told_topics_go_by_their_views() {
        let all = candidates(&["/a", "/b", "/c"]);
        let told = |text: &str| {
            let list: Vec<String> = text.split(',').map(str::to_owned).collect();
            told(&list, &all)
        };
        assert_eq!(told("right=/a,left=/b,centre=/c"), Ok(vec![1, 2, 0]));
        assert_eq!(told("c,b,/a"), Ok(vec![2, 1, 0]));
        assert_eq!(told("2=/a,10=/b,0=/c"), Ok(vec![2, 0, 1]));
        for (text, expected) in [
            ("left=/a,left=/b", "twice"),
            ("/a,/a", "twice"),
            ("upper=/a", "\"upper\" is no view"),
            ("/z", "no images on /z"),
        ] {
            let why = told(text).unwrap_err();
            assert!(why.contains(expected), "{why}");
        }
    }

    #[test]
    fn one_camera_is_found_however_often_it_was_recorded() {
        let all = candidates(&["/cam/image_raw/compressed", "/cam/image_raw", "/cam/depth"]);
        assert_eq!(alone(&all), Ok(1));
        assert!(alone(&candidates(&["/a/image", "/b/image"])).is_err());
    }

    #[test]
    fn the_namespace_is_that_of_the_camera() {
        assert_eq!(namespace("/left/image_rect"), "/left");
        assert_eq!(namespace("/left/image_raw/compressed"), "/left");
        assert_eq!(namespace("/image"), "");
    }
}
