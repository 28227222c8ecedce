//! Where a camera stood along its rail, from what a bag says of where something was.
//!
//! ```text
//! Odometry, poses, transforms ─► places in space ─► least-squares line ─► metres along it
//! joints, numbers ─────────────────────────────────────────────────────► metres
//! ```
//!
//! Between two places the camera is taken to move evenly. Which way along the line is to the right no message says.

use std::collections::BTreeMap;

use glam::{DMat3, DQuat, DVec3};

use super::message::Placed;
use super::wire::Why;

/// Gaps between places so many times the usual one are told.
const LONG_GAP: u64 = 5;
/// Places off their line by more of its length are told.
const MOST_OFF: f64 = 0.02;

/// How to say which topic, and what of it: `/odom`, `/tf:camera`, `/tf:world>camera`, `/joint_states:slide`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Asked {
    pub(super) topic: String,
    pub(super) within: Option<String>,
    pub(super) what: Option<String>,
}

impl Asked {
    pub(super) fn of(text: &str) -> Self {
        let (topic, rest) = match text.split_once(':') {
            Some((topic, rest)) => (topic, Some(rest.trim())),
            None => (text, None),
        };
        let rest = rest.filter(|rest| !rest.is_empty());
        let (within, what) = match rest.map(|rest| rest.split_once('>').ok_or(rest)) {
            Some(Ok((within, what))) => (Some(within), Some(what)),
            Some(Err(what)) => (None, Some(what)),
            None => (None, None),
        };
        let owned = |text: &str| plain(text.trim());
        Self {
            topic: topic.trim().to_owned(),
            within: within.map(owned),
            what: what.map(owned),
        }
    }
}

/// Everything that was said of places.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    /// By what is there: in which frame, and when it was where.
    things: BTreeMap<String, (String, Samples)>,
    /// Whether single numbers are said.
    is_scalar: bool,
    /// Whether any message says when it was so.
    is_stamped: bool,
    /// Messages that could not be read.
    pub(super) damaged: u64,
}

impl Places {
    /// Takes in what a message says that was recorded then.
    pub(super) fn take(&mut self, log: u64, told: Vec<Placed>, asked: Option<&Asked>) {
        let wanted = asked.and_then(|asked| asked.what.as_ref());
        let is_several = told.len() > 1;
        for one in told {
            let what = plain(&one.what);
            self.is_scalar |= one.is_scalar;
            self.is_stamped |= one.stamp.is_some_and(|stamp| stamp > 0);
            // Of joints that nobody asked for the name is enough: a robot says a lot of them.
            let is_idle = match wanted {
                Some(wanted) => *wanted != what,
                None => is_several,
            };
            let (within, samples) = self.things.entry(what).or_default();
            if one.is_scalar && is_idle && !samples.0.is_empty() {
                continue;
            }
            if *within != plain(&one.within) {
                *within = plain(&one.within);
            }
            if one.place.is_finite() && one.turn.is_finite() {
                samples.0.push(Sample {
                    nanos: one.stamp.unwrap_or_default(),
                    log,
                    place: one.place,
                    turn: one.turn,
                });
            }
        }
    }

    /// Takes in what other messages said.
    pub(super) fn join(&mut self, other: Self) {
        for (what, (within, samples)) in other.things {
            let own = self.things.entry(what).or_default();
            own.0 = within;
            own.1.0.extend(samples.0);
        }
        self.is_scalar |= other.is_scalar;
        self.is_stamped |= other.is_stamped;
        self.damaged += other.damaged;
    }
}

fn plain(name: &str) -> String {
    name.trim_start_matches('/').to_owned()
}

/// A sample of one thing's place in another.
#[derive(Clone, Copy, Debug)]
struct Sample {
    nanos: u64,
    /// When it was recorded.
    log: u64,
    place: DVec3,
    turn: DQuat,
}

/// The places of one thing, by time.
#[derive(Clone, Debug, Default)]
struct Samples(Vec<Sample>);

impl Samples {
    fn sort(&mut self, is_by_log: bool) {
        if is_by_log {
            let log = |sample: &mut Sample| sample.nanos = sample.log;
            self.0.iter_mut().for_each(log);
        }
        self.0.sort_by_key(|sample| sample.nanos);
        self.0.dedup_by_key(|sample| sample.nanos);
        // What never moves was there at any time, however often it is said.
        let is_still =
            |pair: &[Sample]| pair[0].place == pair[1].place && pair[0].turn == pair[1].turn;
        if self.0.windows(2).all(is_still) {
            self.0.truncate(1);
        }
    }

    /// Where it was, `None` before the first and after the last place.
    fn at(&self, nanos: u64) -> Option<(DVec3, DQuat)> {
        let after = self.0.partition_point(|sample| sample.nanos < nanos);
        let next = self.0.get(after)?;
        if next.nanos == nanos {
            return Some((next.place, next.turn));
        }
        let before = self.0.get(after.checked_sub(1)?)?;
        let part = (nanos - before.nanos) as f64 / (next.nanos - before.nanos) as f64;
        Some((
            before.place.lerp(next.place, part),
            before.turn.slerp(next.turn, part),
        ))
    }

    /// The gap around a time, where it is longer than usual.
    fn long_gap(&self, nanos: u64, usual: u64) -> Option<u64> {
        let after = self.0.partition_point(|sample| sample.nanos < nanos);
        let before = self.0.get(after.checked_sub(1)?)?;
        let gap = self.0.get(after)?.nanos - before.nanos;
        (gap > LONG_GAP * usual.max(1)).then_some(gap)
    }

    fn usual_gap(&self) -> u64 {
        let gaps = self.0.windows(2).map(|pair| pair[1].nanos - pair[0].nanos);
        let mut gaps: Vec<u64> = gaps.collect();
        gaps.sort_unstable();
        gaps.get(gaps.len() / 2).copied().unwrap_or_default()
    }
}

/// Where something was at any time, and how that is said.
#[derive(Debug)]
struct Path {
    /// From the thing outwards: each within the next.
    links: Vec<Samples>,
    is_scalar: bool,
    /// Whether its times are those of the recording.
    is_by_log: bool,
    what: String,
}

impl Path {
    fn at(&self, nanos: u64) -> Option<DVec3> {
        let mut place = DVec3::ZERO;
        for link in &self.links {
            let (shift, turn) = match &link.0[..] {
                [one] => (one.place, one.turn),
                _ => link.at(nanos)?,
            };
            place = turn * place + shift;
        }
        Some(place)
    }
}

/// Where the frames of a camera were taken.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Along {
    /// Which of the frames have a place, by their numbers.
    pub(super) kept: Vec<usize>,
    /// In metres along the rail; which way is to the right is not said.
    pub(super) metres: Vec<f64>,
    pub(super) notices: Vec<String>,
    pub(super) warnings: Vec<String>,
}

impl Along {
    /// Of frames of which each says when it was taken and when it was recorded, and of which camera.
    pub(super) fn of(
        asked: &Asked,
        places: Places,
        frames: &[(u64, u64)],
        camera: &str,
    ) -> Result<Self, Why> {
        let path = path(asked, places, camera)?;
        let (mut kept, mut found) = (Vec::new(), Vec::new());
        let time = |&(stamp, log): &(u64, u64)| if path.is_by_log { log } else { stamp };
        for (number, frame) in frames.iter().enumerate() {
            if let Some(place) = path.at(time(frame)) {
                kept.push(number);
                found.push(place);
            }
        }
        let (count, topic) = (frames.len(), &asked.topic);
        if found.len() < 3 {
            return Err(format!(
                "{topic} says where {} of the {count} frames were taken: their times do not lie between those of its places",
                found.len()
            ));
        }
        let (mut notices, mut warnings) = (Vec::new(), Vec::new());
        if found.len() < count {
            warnings.push(format!(
                "{} of {count} frames were taken before or after {topic} says where, and are left out",
                count - found.len()
            ));
        }
        let moving = path.links.iter().max_by_key(|link| link.0.len());
        if let Some(link) = moving {
            let usual = link.usual_gap();
            let gaps = kept
                .iter()
                .filter_map(|&frame| link.long_gap(time(&frames[frame]), usual));
            let gaps: Vec<u64> = gaps.collect();
            if let Some(longest) = gaps.iter().max() {
                warnings.push(format!(
                    "{topic} is silent for up to {:.2} s where {} frames were taken: the camera is taken to have moved evenly",
                    *longest as f64 / 1e9,
                    gaps.len()
                ));
            }
        }
        let (metres, axis) = match path.is_scalar {
            true => (found.iter().map(|place| place.x).collect(), None),
            false => {
                let line = Line::of(&found);
                (
                    found.iter().map(|&place| line.along(place)).collect(),
                    Some(line),
                )
            }
        };
        let metres: Vec<f64> = metres;
        let ends = metres
            .iter()
            .fold((f64::MAX, f64::MIN), |(least, most), &at| {
                (least.min(at), most.max(at))
            });
        let length = ends.1 - ends.0;
        let what = &path.what;
        let clock = if path.is_by_log {
            ", by when it was recorded"
        } else {
            ""
        };
        notices.push(match axis {
            None => format!(
                "places are those of {what}, taken for metres: {length:.4} m from end to end{clock}"
            ),
            Some(Line { way, off, .. }) => {
                // A zero has no sign.
                let way = way.to_array().map(|part| (part * 1e4).round() / 1e4 + 0.0);
                if off > MOST_OFF * length {
                    warnings.push(format!(
                        "the places of {what} lie {:.1} mm off their line (root mean square), over {length:.3} m: a rail is straight",
                        off * 1e3
                    ));
                }
                format!(
                    "places are those of {what} along their line ({:.4}, {:.4}, {:.4}): {length:.4} m from end to end, {:.2} mm off it (root mean square){clock}",
                    way[0],
                    way[1],
                    way[2], off * 1e3
                )
            }
        });
        Ok(Self {
            kept,
            metres,
            notices,
            warnings,
        })
    }
}

/// The path that was asked for.
fn path(asked: &Asked, places: Places, camera: &str) -> Result<Path, Why> {
    let topic = &asked.topic;
    let Places {
        mut things,
        is_scalar,
        is_stamped,
        ..
    } = places;
    let is_by_log = !is_stamped;
    things
        .values_mut()
        .for_each(|(_, samples)| samples.sort(is_by_log));
    things.retain(|_, (_, samples)| !samples.0.is_empty());
    if things.is_empty() {
        return Err(format!("{topic} says nothing of where anything was"));
    }
    let names = things
        .keys()
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(", ");
    let camera = plain(camera);
    let what = match &asked.what {
        Some(what) => what.clone(),
        None if things.contains_key(&camera) => camera,
        None if things.len() == 1 => things.keys().next().cloned().unwrap_or_default(),
        None => {
            return Err(format!(
                "{topic} says where several things were ({names}): name one, as in {topic}:{}",
                things.keys().next().map_or("", String::as_str)
            ));
        }
    };
    let (mut links, mut at, mut within) = (Vec::new(), what.clone(), String::new());
    while let Some((parent, samples)) = things.remove(&at) {
        links.push(samples);
        within.clone_from(&parent);
        at = parent;
        if asked.within.as_ref() == Some(&at) {
            break;
        }
    }
    if links.is_empty() {
        return Err(format!(
            "{topic} does not say where {what:?} was; it tells of {names}"
        ));
    }
    if let Some(wanted) = asked.within.as_ref().filter(|wanted| **wanted != within) {
        return Err(format!(
            "{topic} does not say where {what:?} was within {wanted:?}; the last it tells of is {within:?}"
        ));
    }
    let named = match (what.is_empty(), within.is_empty()) {
        (true, _) => topic.clone(),
        (false, true) => format!("{topic}, {what}"),
        (false, false) => format!("{topic}, {what} within {within}"),
    };
    Ok(Path {
        links,
        is_scalar,
        is_by_log,
        what: named,
    })
}

/// The least-squares line through places.
#[derive(Clone, Copy, Debug)]
struct Line {
    middle: DVec3,
    way: DVec3,
    /// How far places are off it, root mean square.
    off: f64,
}

impl Line {
    fn of(places: &[DVec3]) -> Self {
        let count = places.len() as f64;
        let middle = places.iter().sum::<DVec3>() / count;
        let spread = |place: &DVec3| {
            let from = *place - middle;
            DMat3::from_cols(from * from.x, from * from.y, from * from.z)
        };
        let spread = places
            .iter()
            .map(spread)
            .fold(DMat3::ZERO, |sum, one| sum + one);
        // The greatest axis: every squaring makes it stand out more from the others.
        let mut power = spread;
        for _ in 0..40 {
            let most = power
                .to_cols_array()
                .into_iter()
                .fold(0.0, |a: f64, b| a.max(b.abs()));
            if most == 0.0 {
                break;
            }
            power *= 1.0 / most;
            power = power * power;
        }
        let columns = [power.x_axis, power.y_axis, power.z_axis];
        let longest = columns
            .into_iter()
            .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let way = longest.unwrap_or_default().normalize_or(DVec3::X);
        // The way the camera goes first.
        let reach = places.last().zip(places.first());
        let way = match reach.map(|(last, first)| (*last - *first).dot(way)) {
            Some(along) if along < 0.0 => -way,
            _ => way,
        };
        let off = places
            .iter()
            .map(|place| {
                (*place - middle)
                    .reject_from_normalized(way)
                    .length_squared()
            })
            .sum::<f64>();
        Self {
            middle,
            way,
            off: (off / count).sqrt(),
        }
    }

    fn along(&self, place: DVec3) -> f64 {
        (place - self.middle).dot(self.way)
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    const MS: u64 = 1_000_000;

    fn placed(stamp: u64, what: &str, within: &str, place: DVec3) -> (u64, Placed) {
        let one = Placed {
            stamp: Some(stamp),
            what: what.to_owned(),
            within: within.to_owned(),
            place,
            turn: DQuat::IDENTITY,
            is_scalar: false,
        };
        (stamp + 7 * MS, one)
    }

    fn along(asked: &str, told: Vec<(u64, Placed)>, frames: &[u64]) -> Result<Along, Why> {
        let frames: Vec<(u64, u64)> = frames.iter().map(|&at| (at, at + 3 * MS)).collect();
        let asked = Asked::of(asked);
        let mut places = Places::default();
        for (log, one) in told {
            places.take(log, vec![one], Some(&asked));
        }
        Along::of(&asked, places, &frames, "camera")
    }

    #[test]
    fn frames_lie_between_the_places_before_and_after_them() {
        let way = DVec3::new(2.0, -1.0, 2.0) / 3.0;
        let told = (0..11).map(|n| placed(n * 20 * MS, "base", "odom", way * (n as f64) * 0.1));
        let found = along(
            "/odom",
            told.collect(),
            &[5 * MS, 50 * MS, 200 * MS, 210 * MS],
        )
        .unwrap();
        assert_eq!(found.kept, [0, 1, 2]);
        let from_first: Vec<f64> = found.metres.iter().map(|m| m - found.metres[0]).collect();
        for (metres, expected) in from_first.iter().zip([0.0, 0.225, 0.975]) {
            assert!((metres - expected).abs() < 1e-12, "{found:?}");
        }
        assert!(
            found.notices[0].contains("(0.6667, -0.3333, 0.6667)"),
            "{found:?}"
        );
        assert!(found.warnings[0].contains("1 of 4 frames"), "{found:?}");
    }

    #[test]
    fn transforms_are_joined_from_the_camera_outwards() {
        let mut told: Vec<_> = [0, 40]
            .map(|at| placed(at * MS, "camera", "base", DVec3::new(0.1, 0.0, 0.5)))
            .into();
        told.extend((0..5).map(|n| placed(n * 100 * MS, "base", "odom", DVec3::X * n as f64)));
        told.extend((0..5).map(|n| placed(n * 100 * MS, "odom", "map", DVec3::X * 0.5 * n as f64)));
        let frames = [0, 100 * MS, 250 * MS];
        for (asked, step) in [
            ("/tf", 1.5),
            ("/tf:map>camera", 1.5),
            ("/tf:odom>camera", 1.0),
        ] {
            let found = along(asked, told.clone(), &frames).unwrap();
            let step_found = found.metres[1] - found.metres[0];
            assert!((step_found - step).abs() < 1e-9, "{asked}: {found:?}");
        }
        let why = along("/tf:arm", told.clone(), &frames).unwrap_err();
        assert!(why.contains("base, camera, odom"), "{why}");
        assert!(along("/tf:world>camera", told, &frames).is_err());
    }

    #[test]
    fn numbers_without_times_go_by_when_they_were_recorded() {
        let told: Vec<(u64, Placed)> = (0..5)
            .map(|n| {
                let place = DVec3::X * (n as f64);
                let (_, mut one) = placed(0, "", "", place);
                (one.stamp, one.is_scalar) = (None, true);
                (n * 10 * MS, one)
            })
            .collect();
        let found = along("/slide", told, &[2 * MS, 12 * MS, 22 * MS]).unwrap();
        assert_eq!(found.metres, [0.5, 1.5, 2.5]);
    }

    #[test]
    fn what_is_far_off_a_line_or_silent_is_told() {
        let told: Vec<_> = (0..40)
            .filter(|n| !(10..20).contains(n))
            .map(|n| {
                let turn = n as f64 / 40.0;
                placed(
                    n * 10 * MS,
                    "base",
                    "odom",
                    DVec3::new(turn.cos(), turn.sin(), 0.0),
                )
            })
            .collect();
        let frames: Vec<u64> = (0..39).map(|n| n * 10 * MS).collect();
        let found = along("/odom", told, &frames).unwrap();
        let said = found.warnings.join("; ");
        assert!(
            said.contains("off their line") && said.contains("silent for up to 0.11 s"),
            "{said}"
        );
    }

    #[test]
    fn places_of_another_time_are_refused() {
        let told = (0..5).map(|n| placed(n * 10 * MS, "base", "odom", DVec3::X * n as f64));
        let why = along("/odom", told.collect(), &[9_000 * MS; 4]).unwrap_err();
        assert!(why.contains("0 of the 4 frames"), "{why}");
    }
}
