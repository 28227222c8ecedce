//! What names of files and folders say: their order, the side a camera stands at, the fields they are made of.

mod twins;

use std::cmp::Ordering;
use std::collections::BTreeSet;

pub(crate) use twins::{Whose, are_one_cameras, kind, whose};
use twins::{is_kind, is_plain};

/// A piece of a name, as people read it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Piece {
    Number(Number),
    Text(String),
}

/// A number of any length.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Number {
    is_negative: bool,
    /// Without zeros before it.
    whole: String,
    /// Without zeros after it.
    fraction: String,
}

impl Ord for Number {
    fn cmp(&self, other: &Self) -> Ordering {
        let size = |number: &Self| {
            (
                number.whole.len(),
                number.whole.clone(),
                number.fraction.clone(),
            )
        };
        match (self.is_negative, other.is_negative) {
            (false, false) => size(self).cmp(&size(other)),
            (true, true) => size(other).cmp(&size(self)),
            (own, _) => own.cmp(&false).reverse(),
        }
    }
}

impl PartialOrd for Number {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// How the names of a set are to be read: one by itself does not say whether its `-` is a minus and its `.` a point.
struct Reading {
    has_decimals: bool,
    /// What stands before the first digit of a name: after it a `-` is a minus, for others of the set have none there.
    bare: BTreeSet<String>,
}

impl Reading {
    fn of(names: &[String]) -> Self {
        let before = |name: &String| {
            let first = name.find(|c: char| c.is_ascii_digit())?;
            Some(name[..first].to_lowercase())
        };
        let mut own = Self {
            has_decimals: true,
            bare: names.iter().filter_map(before).collect(),
        };
        // Numbers with points are counted through, as in 1.9 and 1.10, where two would be one decimal.
        let mut all: Vec<Vec<Piece>> = names.iter().map(|name| own.pieces(name)).collect();
        let count = all.len();
        all.sort();
        all.dedup();
        let different: BTreeSet<String> = names.iter().map(|name| name.to_lowercase()).collect();
        own.has_decimals = all.len() == count.min(different.len());
        own
    }

    fn pieces(&self, name: &str) -> Vec<Piece> {
        let name = name.to_lowercase();
        let chars: Vec<(usize, char)> = name.char_indices().collect();
        let digit = |at: usize| chars.get(at).is_some_and(|(_, c)| c.is_ascii_digit());
        let (mut pieces, mut text, mut at) = (Vec::new(), String::new(), 0);
        while let Some(&(byte, c)) = chars.get(at) {
            let is_negative = c == '-' && digit(at + 1) && self.is_minus(&name[..byte]);
            if !is_negative && !c.is_ascii_digit() {
                text.push(c);
                at += 1;
                continue;
            }
            if !text.is_empty() {
                pieces.push(Piece::Text(std::mem::take(&mut text)));
            }
            at += usize::from(is_negative);
            let run = |at: &mut usize| {
                let from = *at;
                while digit(*at) {
                    *at += 1;
                }
                chars[from..*at].iter().map(|(_, c)| *c).collect::<String>()
            };
            let is_after_point = byte > 0 && name[..byte].ends_with(['.', ',']) && !is_negative;
            let whole = run(&mut at);
            let mut fraction = String::new();
            let point = |at: usize| chars.get(at).is_some_and(|(_, c)| ['.', ','].contains(c));
            if self.has_decimals && !is_after_point && point(at) && digit(at + 1) {
                let mut end = at + 1;
                let digits = run(&mut end);
                // 2024.11.29 is no number.
                if !(point(end) && digit(end + 1)) {
                    (fraction, at) = (digits, end);
                }
            }
            let whole = whole.trim_start_matches('0').to_owned();
            let fraction = fraction.trim_end_matches('0').to_owned();
            pieces.push(Piece::Number(Number {
                is_negative: is_negative && !(whole.is_empty() && fraction.is_empty()),
                whole,
                fraction,
            }));
        }
        if !text.is_empty() {
            pieces.push(Piece::Text(text));
        }
        pieces
    }

    /// Whether a `-` after this and before a digit is a minus, and no hyphen.
    fn is_minus(&self, before: &str) -> bool {
        match before.chars().next_back() {
            None | Some('_' | ' ' | '=' | '(' | '+') => true,
            Some(last) => last.is_alphabetic() && self.bare.contains(before),
        }
    }
}

/// Sorts by name as people do: numbers by their value, letters whether large or small.
pub(crate) fn sort<T>(items: &mut [T], name: impl Fn(&T) -> String) {
    let names: Vec<String> = items.iter().map(&name).collect();
    let reading = Reading::of(&names);
    items.sort_by_cached_key(|item| {
        let name = name(item);
        (reading.pieces(&name), name)
    });
}

/// Words for the left, the middle and the right.
const SIDES: [&[&str]; 3] = [
    &[
        "left",
        "lft",
        "gauche",
        "links",
        "linke",
        "linker",
        "linkes",
        "izquierda",
        "izquierdo",
        "izq",
        "sinistra",
        "sinistro",
        "sx",
        "esquerda",
        "esquerdo",
        "lewa",
        "lewy",
        "leftmost",
        "levy",
        "vlevo",
        "vanster",
        "vänster",
        "venstre",
        "vasen",
        "lijevo",
        "levo",
        "левая",
        "левый",
        "левое",
        "лево",
        "слева",
        "左",
        "왼쪽",
        "좌측",
    ],
    &[
        "centre",
        "center",
        "central",
        "centro",
        "centrale",
        "centr",
        "ctr",
        "middle",
        "mid",
        "milieu",
        "mitte",
        "mittel",
        "mittlere",
        "medio",
        "mezzo",
        "meio",
        "midden",
        "srodek",
        "środek",
        "front",
        "stred",
        "mitten",
        "midten",
        "keski",
        "orta",
        "центр",
        "центральная",
        "центральный",
        "середина",
        "中",
        "中央",
        "中间",
        "가운데",
        "중앙",
    ],
    &[
        "right",
        "rightmost",
        "rgt",
        "droite",
        "droit",
        "rechts",
        "rechte",
        "rechter",
        "rechtes",
        "derecha",
        "derecho",
        "destra",
        "destro",
        "dx",
        "direita",
        "direito",
        "prawa",
        "prawy",
        "pravy",
        "vpravo",
        "hoger",
        "höger",
        "hoyre",
        "høyre",
        "oikea",
        "desno",
        "sağ",
        "правая",
        "правый",
        "правое",
        "право",
        "справа",
        "右",
        "오른쪽",
        "우측",
    ],
];

/// Letters for them, as languages have them: left, middle, right.
const LETTERS: [[&str; 3]; 5] = [
    ["l", "cm", "r"],
    ["g", "cm", "d"],
    ["i", "cm", "d"],
    ["s", "cm", "d"],
    ["e", "cm", "d"],
];

/// Words that say that a camera stands further out than the next one.
const OUTER: [&str; 6] = ["far", "outer", "extreme", "outermost", "wide", "aussen"];
/// What may stand together with the word for a side, as in `leftcam`.
const COMPANIONS: [&str; 18] = [
    "cam",
    "camera",
    "kamera",
    "caméra",
    "camara",
    "камера",
    "img",
    "image",
    "view",
    "eye",
    "lens",
    "ir",
    "mono",
    "カメラ",
    "相机",
    "相機",
    "眼",
    "카메라",
];
/// What the camera in colour between two gray ones is called after.
const COLOURS: [&str; 4] = ["rgb", "color", "colour", "rgbd"];

/// Words after which a number is that of a camera.
const CAMERAS: [&str; 16] = [
    "cam", "camera", "cameras", "kamera", "caméra", "camara", "view", "views", "vue", "lens",
    "sensor", "eye", "device", "dev", "im", "col",
];
/// Words after which a number is that of a time.
const TIMES: [&str; 21] = [
    "frame",
    "frames",
    "scan",
    "scene",
    "time",
    "t",
    "shot",
    "set",
    "take",
    "sample",
    "capture",
    "seq",
    "sequence",
    "run",
    "step",
    "timestamp",
    "stamp",
    "n",
    "no",
    "trigger",
    "szene",
];
/// Words after which a number is that of a set of cameras or images, and not of one of them.
const SETS: [&str; 9] = [
    "session",
    "sessions",
    "rig",
    "recording",
    "rec",
    "trial",
    "part",
    "day",
    "dataset",
];
/// Words for pictures: a folder of this name with a number is a camera's, and a file's number may be anything.
const PICTURES: [&str; 6] = ["image", "images", "img", "picture", "photo", "bild"];

/// A field of a name: a run of letters or of digits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Field {
    /// In small letters; of a number without zeros before it.
    pub(crate) text: String,
    pub(crate) is_number: bool,
}

/// The fields of a name, with what stands between them left out. Small and large letters are fields of their own where
/// they meet as in `camLeft`.
pub(crate) fn fields(name: &str) -> Vec<Field> {
    let (mut fields, mut own) = (Vec::new(), String::new());
    let mut last: Option<char> = None;
    let mut close = |own: &mut String| {
        let text = std::mem::take(own);
        let is_number = text.starts_with(|c: char| c.is_ascii_digit());
        let text = match is_number {
            true => {
                let short = text.trim_start_matches('0');
                if short.is_empty() { "0" } else { short }.to_owned()
            }
            false => text.to_lowercase(),
        };
        if !text.is_empty() {
            fields.push(Field { text, is_number });
        }
    };
    for c in name.chars() {
        let goes_on = last.is_some_and(|last| match () {
            () if c.is_ascii_digit() => last.is_ascii_digit(),
            () if !c.is_alphabetic() => false,
            () => last.is_alphabetic() && !(last.is_lowercase() && c.is_uppercase()),
        });
        if !goes_on {
            close(&mut own);
        }
        if c.is_alphanumeric() {
            own.push(c);
        }
        last = Some(c);
    }
    close(&mut own);
    fields
}

/// What a number stands for, by the word before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Counts {
    Cameras,
    Times,
    Unknown,
}

/// What a field of these, a number, counts.
pub(crate) fn counts(fields: &[Field], at: usize, is_folder: bool) -> Counts {
    let before = fields[..at].last().filter(|field| !field.is_number);
    let word = before.map_or("", |field| field.text.as_str());
    match () {
        () if CAMERAS.contains(&word) || (is_folder && PICTURES.contains(&word)) => Counts::Cameras,
        () if TIMES.contains(&word) => Counts::Times,
        () => Counts::Unknown,
    }
}

/// The side a word names: −1 left, 0 the middle, 1 right.
fn side(word: &str, letters: [&str; 3]) -> Option<i32> {
    let is = |own: &&str| {
        let rest = match word.strip_prefix(own) {
            Some(rest) => Some(rest),
            None => word.strip_suffix(own),
        };
        word == *own
            // Where words are not set apart one character is a word.
            || ((own.chars().count() > 3 || !own.is_ascii())
                && rest.is_some_and(|rest| COMPANIONS.contains(&rest)))
    };
    let is_letter = |own: &str| word.chars().count() == 1 && own.contains(word);
    let of = (0..3).find(|&side| SIDES[side].iter().any(is) || is_letter(letters[side]))?;
    Some(of as i32 - 1)
}

/// The side a word or a letter names.
pub(crate) fn side_of(word: &str) -> Option<i32> {
    side(word, LETTERS[0])
}

/// Whether a number after this word is that of a set or a time.
fn is_of_set(word: &str) -> bool {
    SETS.contains(&word) || TIMES.contains(&word)
}

/// Where a name says that its camera stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    /// −1 left, 0 the middle, 1 right.
    side: i32,
    /// How far to the right of the middle, in cameras.
    rank: i32,
}

fn place(name: &str, letters: [&str; 3], first: i32) -> Option<Place> {
    let fields = fields(name);
    let sides: BTreeSet<i32> = fields
        .iter()
        .filter(|field| !field.is_number)
        .filter_map(|field| side(&field.text, letters))
        .collect();
    // What is called left of the centre is left.
    let side = match (sides.contains(&-1), sides.contains(&1)) {
        (true, true) => return None,
        (true, false) => -1,
        (false, true) => 1,
        (false, false) => *sides.first()?,
    };
    let is_outer = fields
        .iter()
        .any(|field| OUTER.contains(&field.text.as_str()));
    let is_of_set = |at: &usize| {
        let before = at.checked_sub(1).map(|before| &fields[before].text);
        before.is_some_and(|word| is_of_set(word))
    };
    let number = (0..fields.len())
        .rev()
        .find(|at| fields[*at].is_number && !is_of_set(at))
        .and_then(|at| fields[at].text.parse::<u16>().ok());
    let number = number.map_or(1, |number| i32::from(number) + 1 - first);
    let rank = match (side, is_outer) {
        (0, _) => 0,
        (side, true) => side * (number + 1),
        (side, false) => side * number,
    };
    Some(Place { side, rank })
}

/// The order from left to right of cameras whose names all say on which side they stand, each on another.
fn ranks(names: &[String]) -> Option<Vec<i32>> {
    let has_zero = |name: &String| {
        let fields = fields(name);
        fields
            .last()
            .is_some_and(|last| last.is_number && last.text == "0")
    };
    let first = i32::from(!names.iter().any(has_zero));
    bare_names(names).into_iter().find_map(|mut bare| {
        if let Some(between) = in_colour(&bare) {
            SIDES[1][0].clone_into(&mut bare[between]);
        }
        LETTERS.into_iter().find_map(|letters| {
            let ranks: Option<Vec<i32>> = bare
                .iter()
                .map(|name| Some(place(name, letters, first)?.rank))
                .collect();
            let ranks = ranks?;
            let different: BTreeSet<i32> = ranks.iter().copied().collect();
            (different.len() == names.len() && different.len() > 1).then_some(ranks)
        })
    })
}

/// The names without the numbers that all have, for without a number of its own a side is one; and, as in `right_arm_left`
/// and `right_arm_right`, without what else all have.
fn bare_names(names: &[String]) -> [Vec<String>; 2] {
    let numbers = common_numbers(names);
    let all: Vec<Vec<Field>> = names.iter().map(|name| fields(name)).collect();
    let mut common = all.iter().skip(1).fold(
        all.first().cloned().unwrap_or_default(),
        |mut common, own| {
            let mut rest = own.clone();
            common.retain(|field| match rest.iter().position(|other| other == field) {
                Some(at) => {
                    rest.remove(at);
                    true
                }
                None => false,
            });
            common
        },
    );
    // The number after such a word is none of a side's.
    common.retain(|field| !is_of_set(&field.text));
    let differing = |own: &Vec<Field>| {
        let mut kept = own.clone();
        for field in &common {
            if let Some(at) = kept.iter().position(|other| other == field) {
                kept.remove(at);
            }
        }
        joined(kept)
    };
    [
        names.iter().map(|name| without(name, &numbers)).collect(),
        all.iter().map(differing).collect(),
    ]
}

/// Of three names, one that says left and one that says right, the third if it is that of a camera in colour.
fn in_colour(names: &[String]) -> Option<usize> {
    let [_, _, _] = names else {
        return None;
    };
    let unsaid = beside_sides(names)?;
    let is_colour = fields(unsaid)
        .iter()
        .any(|field| COLOURS.contains(&field.text.as_str()));
    names.iter().position(|name| is_colour && name == unsaid)
}

/// Numbers that every name has.
fn common_numbers(names: &[String]) -> BTreeSet<String> {
    let numbers = |name: &String| -> BTreeSet<String> {
        let fields = fields(name);
        let numbers = fields.into_iter().filter(|field| field.is_number);
        numbers.map(|field| field.text).collect()
    };
    let mut all = names.iter().map(numbers);
    let first = all.next().unwrap_or_default();
    all.fold(first, |common, own| {
        common.intersection(&own).cloned().collect()
    })
}

/// The name, in fields, without these numbers.
fn without(name: &str, numbers: &BTreeSet<String>) -> String {
    let fields = fields(name);
    let kept = fields
        .into_iter()
        .filter(|field| !(field.is_number && numbers.contains(&field.text)));
    joined(kept)
}

/// A name of these fields.
fn joined(fields: impl IntoIterator<Item = Field>) -> String {
    let texts = fields.into_iter().map(|field| field.text);
    texts.collect::<Vec<_>>().join("_")
}

/// Whether these names say from left to right in which order their cameras stand; of one side only they are rather counted.
pub(crate) fn are_sides(names: &[String]) -> bool {
    ranks(names).is_some_and(|ranks| {
        let sides: BTreeSet<i32> = ranks.into_iter().map(i32::signum).collect();
        sides.len() > 1
    })
}

/// Whether these names say in words alone, each another place, where cameras stand: then they are all of one time.
pub(crate) fn are_places(names: &[String]) -> bool {
    let common = common_numbers(names);
    let is_word = |name: &String| !without(name, &common).contains(|c: char| c.is_ascii_digit());
    are_sides(names) && names.iter().all(is_word)
}

/// Whether a name is a word for a camera and one letter, as in `camA`.
pub(crate) fn is_lettered(name: &str) -> bool {
    match &fields(name)[..] {
        [.., word, letter] => {
            CAMERAS.contains(&word.text.as_str())
                && !letter.is_number
                && letter.text.chars().count() == 1
        }
        _ => false,
    }
}

/// Puts cameras in order: from left to right where all say where they stand, those of one side by name, else all by name.
pub(crate) fn sort_cameras<T>(items: &mut Vec<T>, name: impl Fn(&T) -> String) {
    sort(items, &name);
    let names: Vec<String> = items.iter().map(&name).collect();
    if let Some(ranks) = ranks(&names).or_else(|| twins::sides(&names)) {
        let mut ranked: Vec<(i32, T)> = ranks.into_iter().zip(items.drain(..)).collect();
        ranked.sort_by_key(|(rank, _)| *rank);
        items.extend(ranked.into_iter().map(|(_, item)| item));
    }
}

/// Of names some of which say left and right and others no side at all, one that does not.
pub(crate) fn beside_sides(names: &[String]) -> Option<&String> {
    let sides = |name: &String| -> BTreeSet<i32> {
        let fields = fields(name);
        let of = fields
            .iter()
            .filter_map(|field| side(&field.text, ["", "", ""]));
        of.collect()
    };
    let all: Vec<BTreeSet<i32>> = names.iter().map(sides).collect();
    let any = |side: i32| all.iter().any(|own| own.contains(&side));
    let without = all.iter().position(BTreeSet::is_empty)?;
    (any(-1) && any(1)).then(|| &names[without])
}

/// The camera that a folder's or a file's name says alone, as `cam0`, `left` or `image_02` do; `None` where it may be
/// anything.
pub(crate) fn one_camera(name: &str) -> Option<String> {
    /// Words after which a number is a device's; after others of [`CAMERAS`] it may be that of a scene.
    const DEVICES: [&str; 9] = [
        "cam", "camera", "kamera", "caméra", "camara", "sensor", "eye", "device", "image",
    ];
    let fields = fields(name);
    // Words of two letters may be anything.
    let is_side =
        |field: &Field| field.text.chars().count() > 2 && side(&field.text, ["", "", ""]).is_some();
    let device = |pair: &[Field]| {
        let is_device = DEVICES.contains(&pair[0].text.as_str()) && pair[1].is_number;
        is_device.then(|| format!("{}{}", pair[0].text, pair[1].text))
    };
    let side = fields.iter().find(|field| is_side(field));
    side.map(|side| side.text.clone())
        .or_else(|| fields.windows(2).find_map(device))
}

/// The camera that took all images of a folder, where its name or theirs say one, or the kind of one's images, and what
/// differs in theirs is no camera's. Words for kinds in files' names count beside pictures of depth only.
pub(crate) fn only_camera(folder: &str, stems: &[String], has_depth: bool) -> Option<String> {
    let all: Vec<Vec<Field>> = stems.iter().map(|stem| fields(stem)).collect();
    let (first, rest) = all.split_first()?;
    let kinds = |fields: &[Field]| fields.iter().map(|f| f.is_number).collect::<Vec<_>>();
    if rest.is_empty() || rest.iter().any(|own| kinds(own) != kinds(first)) {
        return None;
    }
    let varies = |at: &usize| rest.iter().any(|own| own[*at] != first[*at]);
    let counts_times = (0..first.len())
        .filter(varies)
        .all(|at| first[at].is_number && counts(first, at, false) != Counts::Cameras);
    if !counts_times {
        return None;
    }
    // What stands alike in all names; what differs keeps its place.
    let text = |at: usize| match varies(&at) {
        true => "x",
        false => first[at].text.as_str(),
    };
    let common: Vec<&str> = (0..first.len()).map(text).collect();
    // Folders are called anything: only one that is called after nothing else is a camera's.
    one_camera(&common.join("_"))
        .or_else(|| one_camera(folder).filter(|_| is_plain(folder)))
        .or_else(|| kind(folder))
        .or_else(|| {
            let mut kinds = common.iter().filter(|word| is_kind(word));
            kinds
                .next()
                .filter(|_| has_depth)
                .map(|word| (*word).to_owned())
        })
}

/// The same, of names among which nothing else says where they stand.
pub(crate) fn without_side(names: &[String]) -> Option<&String> {
    beside_sides(names).filter(|_| ranks(names).is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sorted<const N: usize>(names: [&str; N]) -> [&str; N] {
        let mut names = names;
        sort(&mut names, |name| (*name).to_owned());
        names
    }

    fn in_a_row<const N: usize>(names: [&'static str; N]) -> Vec<&'static str> {
        let mut names = names.to_vec();
        names.sort_unstable();
        sort_cameras(&mut names, |name| (*name).to_owned());
        names
    }

    #[test]
    fn names_are_sorted_by_the_value_of_their_numbers() {
        let names = [
            "view10", "view9", "b", "view1b", "view01", "view1", "a2x10", "a2x9",
        ];
        let expected = [
            "a2x9", "a2x10", "b", "view01", "view1", "view1b", "view9", "view10",
        ];
        assert_eq!(sorted(names), expected);
    }

    #[test]
    fn numbers_too_large_for_any_type_are_still_compared() {
        let (small, large) = ("9".repeat(40), "1".to_owned() + &"0".repeat(40));
        assert_eq!(sorted([&large, &small]), [&small, &large]);
    }

    #[test]
    fn large_and_small_letters_are_the_same() {
        assert_eq!(
            sorted(["img_2", "IMG_3", "IMG_1"]),
            ["IMG_1", "img_2", "IMG_3"]
        );
    }

    #[test]
    fn a_minus_and_a_point_belong_to_the_number() {
        assert_eq!(
            sorted(["0.5", "-0.5", "1.5", "-1.5", "-10"]),
            ["-10", "-1.5", "-0.5", "0.5", "1.5"]
        );
        assert_eq!(
            sorted(["x2", "x-1", "x0", "x-2", "x1"]),
            ["x-2", "x-1", "x0", "x1", "x2"]
        );
        assert_eq!(
            sorted(["pos_0.25", "pos_-3", "pos_0.3"]),
            ["pos_-3", "pos_0.25", "pos_0.3"]
        );
    }

    #[test]
    fn a_hyphen_before_every_number_is_no_minus_and_a_counted_point_none_either() {
        assert_eq!(
            sorted(["img-3", "img-1", "img-2"]),
            ["img-1", "img-2", "img-3"]
        );
        assert_eq!(sorted(["1.10", "1.9", "1.1"]), ["1.1", "1.9", "1.10"]);
        assert_eq!(
            sorted(["2024.11.9", "2024.11.10", "2024.2.1"]),
            ["2024.2.1", "2024.11.9", "2024.11.10"]
        );
    }

    #[test]
    fn sides_are_put_from_left_to_right_in_words_and_letters() {
        for names in [
            ["left", "centre", "right"],
            ["gauche", "centre", "droite"],
            ["links", "mitte", "rechts"],
            ["izquierda", "centro", "derecha"],
            ["sinistra", "centro", "destra"],
            ["esquerda", "meio", "direita"],
            ["L", "C", "R"],
            ["L", "M", "R"],
            ["G", "C", "D"],
            ["scan7_l", "scan7_c", "scan7_r"],
            ["camLeft", "camCenter", "camRight"],
            ["leftcam", "middlecam", "rightcam"],
            ["000-L", "000-C", "000-R"],
            ["LEFT_12", "Middle_12", "right_12"],
            ["左", "中", "右"],
        ] {
            assert_eq!(in_a_row(names), names);
        }
    }

    #[test]
    fn more_than_three_sides_go_out_from_the_middle() {
        for names in [
            ["left2", "left1", "centre", "right1", "right2"],
            ["l1", "l0", "c", "r0", "r1"],
            [
                "cam_far_left",
                "cam_left",
                "cam_centre",
                "cam_right",
                "cam_far_right",
            ],
            [
                "outer_left",
                "inner_left",
                "mid",
                "inner_right",
                "outer_right",
            ],
        ] {
            assert_eq!(in_a_row(names), names);
        }
    }

    #[test]
    fn a_folder_of_one_cameras_images_is_known_by_its_name_or_theirs() {
        let of =
            |folder: &str, names: [&str; 3]| only_camera(folder, &names.map(str::to_owned), false);
        let numbers = ["000", "001", "002"];
        let cases = [
            ("cam0", numbers, Some("cam0")),
            ("camera_1", numbers, Some("camera1")),
            ("image_02", numbers, Some("image2")),
            ("left", numbers, Some("left")),
            ("scan", ["cam0_000", "cam0_001", "cam0_002"], Some("cam0")),
            ("scan", ["left_5", "left_6", "left_7"], Some("left")),
            (
                "scan",
                ["camera_1_frame_0", "camera_1_frame_1", "camera_1_frame_2"],
                Some("camera1"),
            ),
            ("scan", numbers, None),
            ("scan", ["image_1_3", "image_2_3", "image_3_3"], None),
            ("scan3", ["view0", "view1", "view2"], None),
            ("cam0", ["view0", "view1", "view2"], None),
            ("left", ["cam0", "cam1", "cam2"], None),
            ("left", ["left", "centre", "right"], None),
            ("scene_1", ["im0", "im1", "im2"], None),
            ("bright", numbers, None),
            (".tmpBhbjDx", numbers, None),
            ("rgb", numbers, Some("rgb")),
            ("infra1", numbers, Some("infra")),
            ("color_raw", numbers, Some("color")),
            ("image_raw", numbers, Some("image_raw")),
            ("color_wheel", numbers, None),
            ("images", numbers, None),
            ("rgb", ["view0", "view1", "view2"], None),
            ("dx", numbers, None),
            ("turn_left_test", numbers, None),
            ("left_camera", numbers, Some("left")),
            ("2024_cam1", numbers, Some("cam1")),
        ];
        for (folder, names, expected) in cases {
            assert_eq!(of(folder, names).as_deref(), expected, "{folder} {names:?}");
        }
    }

    #[test]
    fn words_that_only_hold_a_side_are_none() {
        for word in [
            "bright",
            "upright",
            "cleft",
            "righteous",
            "card",
            "l",
            "decenter",
        ] {
            assert!(side(word, ["", "", ""]).is_none(), "{word}");
        }
        assert_eq!(
            in_a_row(["bright", "dark", "left"]),
            ["bright", "dark", "left"]
        );
    }

    #[test]
    fn a_name_without_a_side_beside_two_with_one_is_found() {
        let names = |names: [&str; 3]| names.map(str::to_owned);
        let open = names(["left", "right", "disparity"]);
        assert_eq!(beside_sides(&open), Some(&open[2]));
        assert_eq!(beside_sides(&names(["left", "mid", "right"])), None);
        assert_eq!(beside_sides(&names(["a", "b", "left"])), None);
    }
}
