//! The time that a name says: counted on from long ago, or a date and the time of day.

/// Digits of a time that is counted on from long ago, and not a frame's number.
const DIGITS: usize = 9;

/// The time that a name says, in a unit that names of its kind have in common.
pub(super) fn of(name: &str) -> Option<f64> {
    let is_time = name.len() >= DIGITS && name.bytes().all(|b| b.is_ascii_digit() || b == b'.');
    if is_time && date(name).is_none() {
        return name.parse().ok();
    }
    date(name).or_else(|| counted(name))
}

/// Whether a name says a time and nothing else can be meant: a date, or seconds to nanoseconds of this age.
pub(super) fn is_sure(name: &str) -> bool {
    let runs = runs(name);
    let is_age = |(digits, _): &&(&str, bool)| {
        [10, 13, 16, 19].contains(&digits.len()) && digits.starts_with('1')
    };
    date(name).is_some() || runs.iter().filter(is_age).count() == 1
}

/// The one number in which the names of each camera's images differ, with what follows its point.
pub(super) fn numbers(names: &[Vec<String>]) -> Option<Vec<Vec<f64>>> {
    let all: Vec<Vec<Vec<f64>>> = names
        .iter()
        .map(|own| own.iter().map(|name| decimals(name)).collect())
        .collect();
    let first = all.first()?.first()?.len();
    if all.iter().flatten().any(|own| own.len() != first) {
        return None;
    }
    let varies = |at: &usize| {
        let mut cameras = all.iter();
        cameras.any(|own| own.iter().any(|numbers| numbers[*at] != own[0][*at]))
    };
    let mut varying = (0..first).filter(varies);
    let (at, None) = (varying.next()?, varying.next()) else {
        return None;
    };
    let of = |own: &Vec<Vec<f64>>| own.iter().map(|numbers| numbers[at]).collect();
    Some(all.iter().map(of).collect())
}

/// The numbers in a name; two runs of digits with a point between them are one.
fn decimals(name: &str) -> Vec<f64> {
    let runs = runs(name);
    let mut found = Vec::new();
    let mut at = 0;
    while let Some((digits, _)) = runs.get(at) {
        let fraction = runs
            .get(at + 1)
            .filter(|(_, is_after_point)| *is_after_point);
        let text = fraction.map_or((*digits).to_owned(), |(more, _)| format!("{digits}.{more}"));
        found.extend(text.parse::<f64>());
        at += 1 + usize::from(fraction.is_some());
    }
    found
}

/// Runs of digits in a name, and whether a point stands before each.
fn runs(name: &str) -> Vec<(&str, bool)> {
    let mut found = Vec::new();
    let mut rest = name;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let digits = rest[start..]
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(rest.len() - start);
        found.push((&rest[start..start + digits], rest[..start].ends_with('.')));
        rest = &rest[start + digits..];
    }
    found
}

/// A number that is long enough to be a time, and what follows its point; there may be words around it.
fn counted(name: &str) -> Option<f64> {
    let runs = runs(name);
    let mut long = runs
        .iter()
        .enumerate()
        .filter(|(_, (digits, _))| digits.len() >= DIGITS);
    let (at, (digits, _)) = long.next()?;
    if long.next().is_some() {
        return None;
    }
    match runs.get(at + 1) {
        Some((fraction, true)) => format!("{digits}.{fraction}").parse().ok(),
        _ => digits.parse().ok(),
    }
}

/// Seconds of a date and the time of day after it, with or without marks between their parts, and with a fraction.
fn date(name: &str) -> Option<f64> {
    let runs: Vec<&str> = runs(name).into_iter().map(|(digits, _)| digits).collect();
    (0..runs.len()).find_map(|from| date_at(&runs[from..]))
}

fn date_at(runs: &[&str]) -> Option<f64> {
    let (day, rest) = match *runs {
        [both, ref rest @ ..] if [14, 17, 20].contains(&both.len()) => {
            return seconds(&both[..8], &both[8..14], fraction(&both[14..], rest));
        }
        [day, ref rest @ ..] if day.len() == 8 => (day.to_owned(), rest),
        [year, month, day, ref rest @ ..]
            if year.len() == 4 && month.len() == 2 && day.len() == 2 =>
        {
            (format!("{year}{month}{day}"), rest)
        }
        _ => return None,
    };
    match *rest {
        [time, ref rest @ ..] if [6, 9, 12].contains(&time.len()) => {
            seconds(&day, &time[..6], fraction(&time[6..], rest))
        }
        [hour, minute, second, ref rest @ ..]
            if [hour, minute, second].iter().all(|part| part.len() == 2) =>
        {
            seconds(&day, &format!("{hour}{minute}{second}"), fraction("", rest))
        }
        _ => None,
    }
}

/// What stands behind the seconds, if it is longer than the number of a camera.
fn fraction(own: &str, rest: &[&str]) -> f64 {
    let digits = match (own, rest) {
        ("", [next, ..]) if [3, 6, 9].contains(&next.len()) => next,
        (own, _) => own,
    };
    format!("0.{digits}0").parse().unwrap_or_default()
}

/// Seconds of `YYYYMMDD` and `HHMMSS`, where they are such.
fn seconds(day: &str, time: &str, fraction: f64) -> Option<f64> {
    let part = |text: &str, from: usize, to: usize, least: i64, most: i64| {
        let value: i64 = text.get(from..to)?.parse().ok()?;
        (least..=most).contains(&value).then_some(value)
    };
    let (year, month) = (part(day, 0, 4, 1970, 2199)?, part(day, 4, 6, 1, 12)?);
    let date = part(day, 6, 8, 1, 31)?;
    let (hour, minute) = (part(time, 0, 2, 0, 23)?, part(time, 2, 4, 0, 59)?);
    let second = part(time, 4, 6, 0, 60)?;
    // Days since 1970: years begin in March, so that the day that some have more is the last.
    let (year, month) = match month {
        1 | 2 => (year - 1, month + 9),
        _ => (year, month - 3),
    };
    let days = 365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + date - 1;
    let days = days - 719_468;
    Some((days * 86_400 + hour * 3600 + minute * 60 + second) as f64 + fraction)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn a_date_with_the_time_of_day_is_a_time_however_it_is_written() {
        let expected = 1_712_495_270.25;
        for name in [
            "2024-04-07_13-07-50.250",
            "20240407_130750.250000_rgb",
            "test_fl09_C_20240407_130750250_ir",
            "20240407130750250",
            "2024-04-07T13:07:50.250Z",
            "IMG_20240407_130750_250",
            "Basler_acA1920-40gm__22543210__20240407_130750250_0012",
        ] {
            assert_eq!(of(name).unwrap(), expected, "{name}");
        }
        assert_eq!(of("19700101_000000").unwrap(), 0.0);
        assert_eq!(
            of("20240229-235959").unwrap() + 1.0,
            of("20240301-000000").unwrap()
        );
        assert_eq!(of("20240407_139950"), None, "there are no 99 minutes");
    }

    #[test]
    fn a_long_number_is_a_time_and_a_short_one_a_frame() {
        for (name, expected) in [
            ("1403636579763555584", Some(1_403_636_579_763_555_584.0)),
            ("1305031102.175304", Some(1_305_031_102.175304)),
            (
                "out_Infrared 1_1556123456789.125",
                Some(1_556_123_456_789.125),
            ),
            ("left_1623412341234", Some(1_623_412_341_234.0)),
            ("frame_000123", None),
            ("12345678", None),
            ("left", None),
        ] {
            assert_eq!(of(name), expected, "{name}");
        }
    }
}
