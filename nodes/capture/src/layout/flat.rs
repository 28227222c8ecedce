//! Camera and time of images that lie in one folder, by their names.

use std::collections::{BTreeMap, BTreeSet};

use super::{stamp, together};
use crate::names::{self, Counts, Field};

/// A field of names that may tell cameras from each other.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    field: usize,
    cameras: usize,
    times: usize,
    /// How much its words speak for it.
    says: i32,
}

/// Camera and time of each name, where the names of a folder's images say both; two readings, in words, where they say
/// different things.
pub(super) fn split(stems: &[String]) -> Result<Option<Vec<(String, String)>>, [String; 2]> {
    let all: Vec<Vec<Field>> = stems.iter().map(|stem| names::fields(stem)).collect();
    let kinds = |fields: &[Field]| {
        fields
            .iter()
            .map(|field| field.is_number)
            .collect::<Vec<_>>()
    };
    let Some(first) = all.first() else {
        return Ok(None);
    };
    if all.iter().any(|fields| kinds(fields) != kinds(first)) {
        let mut splits = [word_and_number, number_and_word].into_iter();
        let found = splits.find_map(|split| {
            let parts: Vec<(String, String)> = stems.iter().map(|stem| split(stem)).collect();
            (is_rig(&parts) || are_stamped(&parts, stems)).then_some(parts)
        });
        return Ok(found);
    }
    let differs = |field: &usize| all.iter().any(|fields| fields[*field] != first[*field]);
    let varying: Vec<usize> = (0..first.len()).filter(differs).collect();
    // As in cam0_left_000: what follows from a camera's field says no time.
    let follows = |other: usize, field: usize| {
        let mut of: BTreeMap<&str, &str> = BTreeMap::new();
        all.iter().all(|fields| {
            let (own, said) = (&fields[other].text, &fields[field].text);
            of.entry(said).or_insert(own) == own
        })
    };
    let parts = |field: usize| -> Vec<(String, String)> {
        let is_of_time = |other: &&usize| !follows(**other, field);
        let times: Vec<usize> = varying.iter().filter(is_of_time).copied().collect();
        let rest = |fields: &[Field]| {
            let rest = times.iter();
            rest.map(|&other| fields[other].text.as_str())
                .collect::<Vec<_>>()
                .join("_")
        };
        all.iter()
            .map(|fields| (camera_name(fields, field, &varying), rest(fields)))
            .collect()
    };
    let mut candidates: Vec<Candidate> = Vec::new();
    for &field in &varying {
        let parts = parts(field);
        let count = |of: fn(&(String, String)) -> &String| {
            parts.iter().map(of).collect::<BTreeSet<_>>().len()
        };
        let cameras: Vec<String> = parts
            .iter()
            .map(|(camera, _)| camera.clone())
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect();
        let says = match () {
            () if names::are_sides(&cameras) => 3,
            () if !first[field].is_number => 1,
            () => match names::counts(first, field, false) {
                Counts::Cameras => 2,
                Counts::Times => -1,
                Counts::Unknown if is_serial(&all, field) && !is_of_stamp(stems, &all, field) => 1,
                Counts::Unknown => 0,
            },
        };
        let is_rig = is_rig(&parts)
            || (says > 0 && are_stamped(&parts, &without(stems, &all, field)))
            || (says > 1 && are_near(&parts, stems));
        if !is_rig {
            continue;
        }
        candidates.push(Candidate {
            field,
            cameras: cameras.len(),
            times: count(|(_, time)| time),
            says,
        });
    }
    // What says most; of those that say the same the one with the fewest cameras, if there are far fewer than times.
    candidates.sort_by_key(|candidate| (-candidate.says, candidate.cameras));
    // Several fields that go with each other name the same cameras.
    let mut different: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        let is_same = |known: &Candidate| {
            follows(candidate.field, known.field) && follows(known.field, candidate.field)
        };
        if !different.iter().any(is_same) {
            different.push(candidate);
        }
    }
    let candidates = different;
    let of = |candidate: &Candidate| {
        format!("{} cameras at {} times", candidate.cameras, candidate.times)
    };
    match candidates[..] {
        [] => Ok(None),
        [one] => Ok((one.says >= 0).then(|| parts(one.field))),
        [first, second, ..]
            if first.says > second.says
                || (first.cameras >= 3 && 2 * first.cameras <= second.cameras) =>
        {
            Ok((first.says >= 0).then(|| parts(first.field)))
        }
        [first, second, ..] => Err([of(&first), of(&second)]),
    }
}

/// A camera's name: its field, with the word before a number that all have in common.
fn camera_name(fields: &[Field], at: usize, varying: &[usize]) -> String {
    let own = &fields[at];
    let before = at
        .checked_sub(1)
        .filter(|before| own.is_number && !varying.contains(before));
    let word = before
        .map(|before| &fields[before])
        .filter(|word| !word.is_number);
    format!("{}{}", word.map_or("", |word| word.text.as_str()), own.text)
}

/// Whether these are cameras that took images at the same times: each has most of its times in common with another.
fn is_rig(parts: &[(String, String)]) -> bool {
    let mut times: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (camera, time) in parts {
        times.entry(camera).or_default().insert(time);
    }
    let shares = |camera: &str, own: &BTreeSet<&str>| {
        let mut others = times.iter().filter(|(other, _)| **other != camera);
        others.any(|(_, other)| 2 * own.intersection(other).count() > own.len())
    };
    let is_whole = |(camera, time): &(String, String)| !camera.is_empty() && !time.is_empty();
    let all: BTreeSet<&str> = times.values().flatten().copied().collect();
    let different: BTreeSet<&(String, String)> = parts.iter().collect();
    all.len() > 1
        && different.len() == parts.len()
        && parts.iter().all(is_whole)
        && times.iter().all(|(camera, own)| shares(camera, own))
}

/// Whether these are cameras whose images are called after the time they were taken at, which no two have in common.
fn are_stamped(parts: &[(String, String)], stems: &[String]) -> bool {
    let mut count: BTreeMap<&str, usize> = BTreeMap::new();
    for (camera, _) in parts {
        *count.entry(camera).or_default() += 1;
    }
    let is_several = count.values().all(|count| *count > 1);
    count.len() > 1
        && is_several
        && parts.iter().all(|(camera, _)| !camera.is_empty())
        && stems.iter().all(|stem| stamp::is_sure(stem))
}

/// Whether these are cameras whose images are numbered so that most are near others', and not near each other.
fn are_near(parts: &[(String, String)], stems: &[String]) -> bool {
    let mut by_camera: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for ((camera, _), stem) in parts.iter().zip(stems) {
        by_camera.entry(camera).or_default().push(stem.clone());
    }
    let names: Vec<Vec<String>> = by_camera.into_values().collect();
    let is_several = names.len() > 1 && names.iter().all(|own| own.len() > 1);
    let numbers = || stamp::numbers(&names);
    is_several && numbers().is_some_and(|numbers| together::nearest(&numbers).is_some())
}

/// Names without the serial number that stands in a field, for it is no part of the time.
fn without(stems: &[String], all: &[Vec<Field>], field: usize) -> Vec<String> {
    if !is_serial(all, field) {
        return stems.to_vec();
    }
    let each = stems.iter().zip(all);
    each.map(|(stem, fields)| stem.replacen(&fields[field].text, "", 1))
        .collect()
}

/// Whether a field belongs to the time that all names are called after: without it they say none.
fn is_of_stamp(stems: &[String], all: &[Vec<Field>], field: usize) -> bool {
    let are_sure = |stems: &[String]| stems.iter().all(|stem| stamp::is_sure(stem));
    are_sure(stems) && !are_sure(&without(stems, all, field))
}

/// Whether a field may be the serial number of a camera: long, of one length, and no date.
fn is_serial(all: &[Vec<Field>], field: usize) -> bool {
    let length = all[0][field].text.len();
    let is_date = |text: &str| length == 8 && (text.starts_with("19") || text.starts_with("20"));
    (7..=12).contains(&length)
        && all.iter().all(|fields| {
            let text = &fields[field].text;
            text.len() == length && !is_date(text)
        })
}

/// What a name begins with, and the number that it ends with; a time with its fraction is one.
pub(super) fn word_and_number(stem: &str) -> (String, String) {
    let is_digit = |c: char| c.is_ascii_digit();
    let word = stem.trim_end_matches(is_digit);
    let before = word
        .strip_suffix('.')
        .map(|whole| whole.trim_end_matches(is_digit));
    if let Some(before) = before
        && stamp::is_sure(&word[before.len()..])
    {
        return (bare(before), stem[before.len()..].to_owned());
    }
    (bare(word), number(&stem[word.len()..]))
}

/// What stands around the first number in a name, and that.
fn number_and_word(stem: &str) -> (String, String) {
    let is_digit = |c: char| c.is_ascii_digit();
    let Some(start) = stem.find(is_digit) else {
        return (stem.to_owned(), String::new());
    };
    let digits = stem[start..]
        .find(|c| !is_digit(c))
        .unwrap_or(stem.len() - start);
    let (before, after) = (&stem[..start], &stem[start + digits..]);
    let word = if bare(after).is_empty() {
        bare(before)
    } else {
        bare(after)
    };
    (word, number(&stem[start..start + digits]))
}

/// A word without what ties it to a number.
fn bare(word: &str) -> String {
    word.trim_matches(['_', '-', ' ', '.']).to_owned()
}

/// A number without the zeros before it.
fn number(digits: &str) -> String {
    let short = digits.trim_start_matches('0');
    match (digits.is_empty(), short.is_empty()) {
        (false, true) => "0".to_owned(),
        _ => short.to_owned(),
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::layout::stem;

    fn stems(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| stem(Path::new(name))).collect()
    }

    /// Camera and time of each name.
    fn read(names: &[&str]) -> Vec<(String, String)> {
        split(&stems(names)).unwrap().unwrap_or_default()
    }

    fn said(parts: &[(String, String)]) -> Vec<(&str, &str)> {
        let each = parts.iter();
        each.map(|(camera, time)| (camera.as_str(), time.as_str()))
            .collect()
    }

    /// Names made of cameras and times.
    fn grid(cameras: &[&str], times: &[&str], name: impl Fn(&str, &str) -> String) -> Vec<String> {
        let each = times.iter();
        each.flat_map(|time| {
            cameras
                .iter()
                .map(|camera| name(camera, time))
                .collect::<Vec<_>>()
        })
        .collect()
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
        let expected = [
            ("left", "1"),
            ("left", "2"),
            ("left", "3"),
            ("right", "1"),
            ("right", "3"),
        ];
        assert_eq!(said(&read(&files)), expected);
    }

    #[test]
    fn a_folder_of_other_names_has_no_cameras() {
        for files in [
            &["a1.png", "b2.png", "near.png"][..],
            &["view0.png", "view1.png", "view2.png"],
            &["a_1_of_3.png", "a_2_of_3.png", "a_3_of_3.png"],
            &["0001_x012.5.png", "0002_x013.0.png", "0003_x013.5.png"],
            &["frame_000.png", "frame_001.png"],
        ] {
            assert!(read(files).is_empty(), "{files:?}");
        }
    }

    #[test]
    fn cameras_are_told_by_words_letters_or_numbers_wherever_they_stand() {
        type Name = fn(&str, &str) -> String;
        let sides = ["left", "centre", "right"];
        let cases: [(&[&str], Name); 9] = [
            (&sides, |camera, time| format!("{camera}_00{time}")),
            (&sides, |camera, time| format!("scan{time}_{camera}_rect")),
            (&["L", "C", "R"], |camera, time| {
                format!("00{time}-{camera}")
            }),
            (&["L", "C", "R"], |camera, time| format!("{camera}{time}")),
            (&["0", "1", "2"], |camera, time| {
                format!("cam{camera}_1{time}")
            }),
            (&["0", "1", "2"], |camera, time| {
                format!("1{time}_cam{camera}")
            }),
            (&["0", "1", "2"], |camera, time| {
                format!("frame{time}_{camera}")
            }),
            (&["0", "1", "2"], |camera, time| {
                format!("scene_{time}_view_{camera}")
            }),
            (&["red", "green", "blue"], |camera, time| {
                format!("{camera}{time}")
            }),
        ];
        for (number, (cameras, name)) in cases.into_iter().enumerate() {
            let names = grid(cameras, &["1", "2", "3", "4"], name);
            let parts = split(&names).unwrap().unwrap();
            for (place, (camera, time)) in parts.iter().enumerate() {
                let own = cameras[place % cameras.len()].to_lowercase();
                assert!(camera.ends_with(&own), "case {number}: {camera}");
                let digit = (place / cameras.len() + 1).to_string();
                assert!(time.ends_with(&digit), "case {number}: {time}");
            }
        }
    }

    #[test]
    fn what_goes_with_a_camera_says_no_time() {
        type Name = fn(usize, &str) -> String;
        const SIDES: [&str; 3] = ["left", "center", "right"];
        const SERIALS: [&str; 3] = ["7712", "8804", "9001"];
        const COLOURS: [&str; 3] = ["mono", "color", "mono"];
        let cases: [Name; 9] = [
            |camera, time| format!("cam{camera}_{}_{time}", SIDES[camera]),
            |camera, time| format!("{time}_cam{camera}_{}", SIDES[camera]),
            |camera, time| format!("{}_cam{camera}_{time}", SIDES[camera]),
            |camera, time| format!("{}{}_00{time}", SIDES[camera], camera + 1),
            |camera, time| format!("00{time}_{}{}", SIDES[camera], camera + 1),
            |camera, time| format!("SN{}_{}_{time}", SERIALS[camera], SIDES[camera]),
            |camera, time| format!("{}_{}us_{time}", SIDES[camera], 100 * (camera + 1)),
            |camera, time| format!("{}_{}_{time}", SIDES[camera], COLOURS[camera]),
            |camera, time| format!("{}_00{time}_exp1{camera}00", SIDES[camera]),
        ];
        for (number, name) in cases.into_iter().enumerate() {
            for times in [
                &["1", "2", "3"][..],
                &["1", "2"],
                &["0", "1", "2", "3", "4", "5"],
            ] {
                let names = grid(&["0", "1", "2"], times, |camera, time| {
                    name(camera.parse().unwrap(), time)
                });
                let parts = split(&names).unwrap().unwrap();
                for (place, (camera, time)) in parts.iter().enumerate() {
                    assert!(
                        camera.ends_with(SIDES[place % 3]),
                        "case {number}: {camera}"
                    );
                    assert!(time.ends_with(times[place / 3]), "case {number}: {time}");
                }
            }
        }
    }

    #[test]
    fn of_numbers_without_words_the_far_fewer_are_the_cameras_and_else_it_is_open() {
        let many: Vec<String> = (0..20).map(|time| format!("{time:03}")).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        let names = grid(&["0", "1", "2"], &many, |camera, time| {
            format!("{time}_{camera}")
        });
        let parts = split(&names).unwrap().unwrap();
        assert_eq!(
            said(&parts)[..4],
            [("0", "0"), ("1", "0"), ("2", "0"), ("0", "1")]
        );
        let names = grid(&["0", "1", "2"], &["5", "6", "7"], |camera, time| {
            format!("{time}_{camera}")
        });
        let readings = split(&names).unwrap_err();
        assert_eq!(readings, ["3 cameras at 3 times", "3 cameras at 3 times"]);
    }
}
