//! Two recordings of the same scans: what one found and the other did not.
//!
//! ```text
//! points of A ─┐                       ┌─► in both, moved, only in A, only in B
//! points of B ─┴─► partners in a pixel ┤
//! evaluations, maps, settings ─────────┴─► better, worse, the same, or neither
//! ```

mod picture;

use std::collections::BTreeMap;

use messages::record::Statistics;
use messages::{Evaluation, Image, Kind, Matches, NONE, Point, Points, Score, Size, Topic};
use serde::Serialize;
use serde_json::Value;
use thiserror::Error;

pub use picture::side_by_side;

use crate::map::whole_map;
use crate::{ReadError, Recording};

/// Pixels within which points of two recordings are of one place.
const PLACE: f32 = 1.0;

/// How much more coverage is more, and how many more errors over a pixel, as a share, are more.
const MORE_COVERAGE: f64 = 0.001;
const MORE_WRONG: f64 = 0.0001;

/// Why two recordings are not compared.
#[derive(Debug, Error)]
pub enum CompareError {
    /// One cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// One holds no points.
    #[error(
        "{0} holds no points, which are compared: record them, with record.keep = all or results"
    )]
    NoPoints(String),
    /// They refer to different views or sizes.
    #[error(
        "the points of {} are of {}, those of {} of {}: expected two recordings of the same view and size, as a replay with \
         other settings makes them", .a.0, .a.1, .b.0, .b.1
    )]
    Views {
        /// The first one and its view.
        a: (String, String),
        /// The second one and its view.
        b: (String, String),
    },
    /// They have no whole scan in common.
    #[error(
        "{a} and {b} have no scan in common: scans are compared by their numbers, which {a} has from {first_a} on and {b} \
         from {first_b} on"
    )]
    NothingInCommon {
        /// The first one.
        a: String,
        /// The second one.
        b: String,
        /// Its first scan.
        first_a: String,
        /// The other's.
        first_b: String,
    },
}

/// Whether the second of two recordings is better than the first.
///
/// Where the truth is known, more of the edges covered by over 0.001, or fewer points wrong by over a pixel by over 0.01 % of
/// them, is better, if the other of the two is not worse. Without truth it is not known which is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Every point of one is in the other, where it was, or both are as good by the truth.
    Same,
    /// By the truth.
    Better,
    /// By the truth.
    Worse,
    /// They differ, and nothing says which is better: there is no truth, or other images, or a gain has its price.
    Different,
}

/// Of the points of both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Shared {
    /// Points of the first.
    pub a: u64,
    /// Points of the second.
    pub b: u64,
    /// Points of the first that have one of the second within a pixel.
    pub both: u64,
    /// Those of them whose disparities differ by more than is asked for.
    pub moved: u64,
    /// Points of the first without a partner.
    pub only_a: u64,
    /// Points of the second without a partner.
    pub only_b: u64,
    /// Median of the differences of disparity in both, in pixels.
    pub median: f32,
    /// The greatest.
    pub most: f32,
}

/// How one compares with the truth, over its scans.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Truth {
    /// Mean share of the edge pixels covered.
    pub coverage: f64,
    /// Mean share of points wrong by over a pixel.
    pub bad_one: f64,
    /// Mean share of points wrong by over two pixels.
    pub bad_two: f64,
    /// Mean of the scans' median errors, in pixels.
    pub median: f64,
    /// Scans that say so.
    pub scans: u64,
}

/// The map of a rail.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mapped {
    /// Points in it.
    pub points: u64,
    /// Median standard deviation of their distances, in metres.
    pub sigma_m: f32,
}

/// How well the views agree on what was found; it needs no truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// Share of the points of all matches that three views or more see; the others are filled in along their curves.
    pub seen: f64,
    /// By how much matches miss where the loop through all views would close, in pixels: the mean over their points.
    pub residual: f64,
}

/// How long scans of both took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Time {
    /// The stages that are added up.
    pub stages: Vec<&'static str>,
    /// Their milliseconds a scan, the median, of the first and of the second.
    pub milliseconds: [f64; 2],
}

/// Which scan of the second recording is compared with one of the first.
#[derive(Clone, Copy, Debug, Default)]
pub enum Partners<'a> {
    /// The one of the same number.
    #[default]
    SameNumber,
    /// Scan n is a replay of the first one's scan of this number.
    Replayed(&'a [u64]),
}

impl Partners<'_> {
    /// The number in the first recording of one of the second's scans.
    fn of(self, scan: u64) -> Option<u64> {
        match self {
            Self::SameNumber => Some(scan),
            Self::Replayed(scans) => scans.get(usize::try_from(scan).ok()?).copied(),
        }
    }
}

/// What comes of comparing.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Scans in both.
    pub scans: u64,
    /// Scans only one has: of the first, of the second.
    pub only: [u64; 2],
    /// Scans whose images differ, where both hold them.
    pub other_images: u64,
    /// Settings that differ: `node.key` and both values.
    pub settings: BTreeMap<String, [Value; 2]>,
    /// Points.
    pub points: Shared,
    /// Pixels of disparity beyond which a point has moved.
    pub within: f32,
    /// The truth, where both know it.
    pub truth: Option<[Truth; 2]>,
    /// How well views agree, where both hold their matches.
    pub agreement: Option<[Agreement; 2]>,
    /// The maps, where both have one of the same scans.
    pub maps: Option<[Mapped; 2]>,
    /// How long scans took in the stages whose times both know.
    pub time: Option<Time>,
    /// Whether the second is better.
    pub verdict: Verdict,
}

/// Compares two recordings; a point has moved whose disparity differs by over `within` pixels.
///
/// # Errors
/// When one cannot be read, or they do not show the same.
pub fn compare(
    [a, b]: [&mut Recording; 2],
    within: f32,
    partners: Partners<'_>,
) -> Result<Comparison, CompareError> {
    same_view(a, b)?;
    let topics = [points_of(a)?, points_of(b)?];
    let [of_a, of_b] = [(&*a, &topics[0]), (&*b, &topics[1])].map(|(recording, topic)| {
        // What a proof does not hold is computed of each of its scans.
        match recording.is_proof() {
            true => recording.whole_scans(),
            false => recording.scans_with(std::slice::from_ref(topic)),
        }
    });
    let pair = |&of_b: &u64| {
        let scan = partners.of(of_b)?;
        of_a.binary_search(&scan).is_ok().then_some([scan, of_b])
    };
    let common: Vec<[u64; 2]> = of_b.iter().filter_map(pair).collect();
    if common.is_empty() {
        let first = |scans: &[u64]| scans.first().map_or("none".to_owned(), u64::to_string);
        return Err(CompareError::NothingInCommon {
            a: name(a),
            b: name(b),
            first_a: first(&of_a),
            first_b: first(&of_b),
        });
    }
    let mut shared = Shared::default();
    let (mut apart, mut cells) = (Vec::new(), Cells::default());
    let mut other_images = 0;
    for &[scan_a, scan_b] in &common {
        let [of_a, of_b] = [
            a.read::<Points>(scan_a, &topics[0])?,
            b.read::<Points>(scan_b, &topics[1])?,
        ];
        let size = of_a.header.size();
        let [of_a, of_b] = [of_a.view().points, of_b.view().points];
        shared.a += of_a.len() as u64;
        shared.b += of_b.len() as u64;
        cells.fill(size, of_b);
        for point in of_a {
            match cells.nearest(of_b, point) {
                Some(partner) => apart.push((point.disparity - partner.disparity).abs()),
                None => shared.only_a += 1,
            }
        }
        cells.fill(size, of_a);
        let alone = of_b
            .iter()
            .filter(|point| cells.nearest(of_a, point).is_none());
        shared.only_b += alone.count() as u64;
        other_images += u64::from(differs([a, b], [scan_a, scan_b])?);
    }
    shared.both = apart.len() as u64;
    shared.moved = apart.iter().filter(|apart| **apart > within).count() as u64;
    apart.sort_unstable_by(f32::total_cmp);
    shared.median = apart.get(apart.len() / 2).copied().unwrap_or_default();
    shared.most = apart.last().copied().unwrap_or_default();
    let only = [&of_a, &of_b].map(|scans| (scans.len() - common.len()) as u64);
    let scans = [0, 1].map(|which| common.iter().map(|pair| pair[which]).collect::<Vec<_>>());
    let truth = both(truth(a, &scans[0])?, truth(b, &scans[1])?);
    let agreement = both(agreement(a, &scans[0])?, agreement(b, &scans[1])?);
    let time = time([stage_times(a, &scans[0])?, stage_times(b, &scans[1])?]);
    // A map is of all frames.
    let maps = match only {
        [0, 0] => both(mapped(a)?, mapped(b)?),
        _ => None,
    };
    Ok(Comparison {
        scans: common.len() as u64,
        only,
        other_images,
        settings: settings(a, b),
        points: shared,
        within,
        truth,
        agreement,
        maps,
        time,
        verdict: match other_images {
            0 => verdict(&shared, truth),
            _ => Verdict::Different,
        },
    })
}

/// What both say.
fn both<T>(a: Option<T>, b: Option<T>) -> Option<[T; 2]> {
    Some([a?, b?])
}

/// Whether the second is better, by the truth where it is known.
fn verdict(points: &Shared, truth: Option<[Truth; 2]>) -> Verdict {
    let is_equal = points.moved + points.only_a + points.only_b == 0;
    let Some([a, b]) = truth.filter(|_| !is_equal) else {
        return if is_equal {
            Verdict::Same
        } else {
            Verdict::Different
        };
    };
    let (covers, errs) = (b.coverage - a.coverage, b.bad_one - a.bad_one);
    let better = covers > MORE_COVERAGE || errs < -MORE_WRONG;
    let worse = covers < -MORE_COVERAGE || errs > MORE_WRONG;
    match (better, worse) {
        (true, true) => Verdict::Different,
        (true, false) => Verdict::Better,
        (false, true) => Verdict::Worse,
        (false, false) => Verdict::Same,
    }
}

fn name(recording: &Recording) -> String {
    recording.path().display().to_string()
}

fn points_of(recording: &Recording) -> Result<Topic, CompareError> {
    let topic = Topic::of(&recording.metadata().rig, Kind::Points).swap_remove(0);
    match recording.holds(&topic.name) {
        true => Ok(topic),
        false => Err(CompareError::NoPoints(name(recording))),
    }
}

/// Refuses recordings whose points mean different pictures.
fn same_view(a: &Recording, b: &Recording) -> Result<(), CompareError> {
    let view = |recording: &Recording| {
        let rig = &recording.metadata().rig;
        let view = rig.views.get(recording.codec().reference());
        let view = view.map_or("an unknown view", |view| &view.name);
        format!("{view}, {}", rig.size)
    };
    let (of_a, of_b) = (view(a), view(b));
    match of_a == of_b {
        true => Ok(()),
        false => Err(CompareError::Views {
            a: (name(a), of_a),
            b: (name(b), of_b),
        }),
    }
}

/// Whether the reference view's images of a scan differ, where both have one.
fn differs([a, b]: [&mut Recording; 2], [of_a, of_b]: [u64; 2]) -> Result<bool, ReadError> {
    let image = |recording: &mut Recording, scan| {
        let reference = recording.codec().reference();
        let topic = Topic::of(&recording.metadata().rig, Kind::Image).swap_remove(reference);
        match recording.read::<Image>(scan, &topic) {
            Ok(image) => Ok(Some(image)),
            Err(ReadError::NoMessage { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    };
    Ok(match (image(a, of_a)?, image(b, of_b)?) {
        (Some(a), Some(b)) => a.view().pixels != b.view().pixels,
        _ => false,
    })
}

/// Settings that differ, of the nodes that made both: what says where scans come from and how they are written changes no
/// result.
fn settings(a: &Recording, b: &Recording) -> BTreeMap<String, [Value; 2]> {
    const NO_MATTER: [&str; 5] = ["record", "graph", "bridge", "replay", "changed"];
    let [a, b] = [a, b].map(|recording| recording.metadata().configuration.as_object());
    let (Some(a), Some(b)) = (a, b) else {
        return BTreeMap::new();
    };
    let mut differing = BTreeMap::new();
    for (node, of_a) in a
        .iter()
        .filter(|(node, _)| !NO_MATTER.contains(&node.as_str()))
    {
        let (Some(of_a), Some(of_b)) = (of_a.as_object(), b.get(node).and_then(Value::as_object))
        else {
            continue;
        };
        for key in of_a.keys().chain(of_b.keys()) {
            let values = [of_a, of_b].map(|keys| keys.get(key).cloned().unwrap_or_default());
            // A part of a graph has the versions of its own stages.
            let is_absent = node == "versions" && values.contains(&Value::Null);
            if values[0] != values[1] && key != "start" && !is_absent {
                differing.insert(format!("{node}.{key}"), values);
            }
        }
    }
    differing
}

/// How these scans of a recording compare with the truth.
fn truth(recording: &mut Recording, scans: &[u64]) -> Result<Option<Truth>, ReadError> {
    let Some(topic) = Topic::of(&recording.metadata().rig, Kind::Evaluation).pop() else {
        return Ok(None);
    };
    if !recording.holds(&topic.name) {
        return Ok(None);
    }
    let mut scores: Vec<Score> = Vec::new();
    for &scan in scans {
        match recording.read::<Evaluation>(scan, &topic) {
            Ok(read) => {
                let whole = read
                    .view()
                    .scores
                    .iter()
                    .filter(|score| score.channel == NONE);
                scores.extend(whole);
            }
            Err(ReadError::NoMessage { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    let mean = |of: fn(&Score) -> f32| {
        scores.iter().map(|score| f64::from(of(score))).sum::<f64>() / scores.len() as f64
    };
    Ok((!scores.is_empty()).then(|| Truth {
        coverage: mean(|score| score.coverage),
        bad_one: mean(|score| score.bad_one),
        bad_two: mean(|score| score.bad_two),
        median: mean(|score| score.median),
        scans: scores.len() as u64,
    }))
}

/// How well the views agree in these scans' matches; `None` where a recording holds none.
fn agreement(recording: &mut Recording, scans: &[u64]) -> Result<Option<Agreement>, ReadError> {
    let topics = Topic::of(&recording.metadata().rig, Kind::Matches);
    let (mut points, mut seen, mut residuals) = (0u64, 0u64, 0.0);
    for topic in topics {
        for &scan in scans {
            let read = match recording.read::<Matches>(scan, &topic) {
                Ok(read) => read,
                Err(ReadError::NoMessage { .. }) => continue,
                Err(error) => return Err(error),
            };
            let view = read.view();
            points += view.points.len() as u64;
            seen += view.points.iter().filter(|point| point.filled == 0).count() as u64;
            let missed = view.matches.iter();
            residuals += missed
                .map(|found| f64::from(found.residual) * f64::from(found.count))
                .sum::<f64>();
        }
    }
    Ok((points > 0).then(|| Agreement {
        seen: seen as f64 / points as f64,
        residual: residuals / points as f64,
    }))
}

/// A scan's milliseconds, stage by stage.
type Stages = [(&'static str, f64); 5];

/// Milliseconds of each stage, scan by scan, as far as these scans tell.
fn stage_times(recording: &mut Recording, scans: &[u64]) -> Result<Vec<Stages>, ReadError> {
    let mut times = Vec::new();
    for &scan in scans {
        let read = recording.scan_of(scan, |topic| topic == "statistics")?;
        let said = read.message("statistics");
        let said = said.and_then(|json| serde_json::from_slice::<Statistics>(json).ok());
        times.extend(said.map(|said| said.milliseconds.of_the_method()));
        recording.reuse(read);
    }
    Ok(times)
}

/// How long scans took in the stages whose times both know: a replay that begins at a later stage, or records results only,
/// knows fewer.
fn time(both: [Vec<Stages>; 2]) -> Option<Time> {
    let first = both[0].first()?;
    let is_known = |stage: &usize| {
        let knows = |times: &Vec<Stages>| times.iter().any(|of| of[*stage].1 > 0.0);
        both.iter().all(knows)
    };
    let known: Vec<usize> = (0..first.len()).filter(is_known).collect();
    let median = |times: &Vec<Stages>| {
        let sum = |of: &Stages| known.iter().map(|stage| of[*stage].1).sum::<f64>();
        let mut sums: Vec<f64> = times.iter().map(sum).collect();
        sums.sort_unstable_by(f64::total_cmp);
        sums[sums.len() / 2]
    };
    (!known.is_empty()).then(|| Time {
        stages: known.iter().map(|stage| first[*stage].0).collect(),
        milliseconds: both.each_ref().map(median),
    })
}

fn mapped(recording: &mut Recording) -> Result<Option<Mapped>, ReadError> {
    let map = whole_map(recording)?;
    Ok(map.map(|points| {
        let mut sigmas: Vec<f32> = points.iter().map(|point| point.sigma).collect();
        sigmas.sort_unstable_by(f32::total_cmp);
        Mapped {
            points: points.len() as u64,
            sigma_m: sigmas.get(sigmas.len() / 2).copied().unwrap_or_default(),
        }
    }))
}

/// Points by pixel.
#[derive(Debug, Default)]
struct Cells {
    size: Size,
    /// Pixel by pixel the first of its points, or [`NONE`].
    first: Vec<u32>,
    /// Point by point the next of its pixel.
    next: Vec<u32>,
}

impl Cells {
    fn fill(&mut self, size: Size, points: &[Point]) {
        self.size = size;
        self.first.clear();
        self.first.resize(size.pixels(), NONE);
        self.next.clear();
        for (number, point) in (0u32..).zip(points) {
            let pixel = self.pixel(point.u, point.v);
            let first = pixel.map_or(NONE, |pixel| {
                std::mem::replace(&mut self.first[pixel], number)
            });
            self.next.push(first);
        }
    }

    fn pixel(&self, x: f32, y: f32) -> Option<usize> {
        let inside =
            x >= 0.0 && y >= 0.0 && x < self.size.width as f32 && y < self.size.height as f32;
        inside.then(|| y as usize * self.size.width as usize + x as usize)
    }

    /// The point nearest to another one, of those within a pixel; of equal ones the first in its pixel.
    fn nearest<'a>(&self, points: &'a [Point], other: &Point) -> Option<&'a Point> {
        let mut nearest: Option<(f32, &Point)> = None;
        for (dx, dy) in [-1.0, 0.0, 1.0]
            .into_iter()
            .flat_map(|dy| [-1.0, 0.0, 1.0].map(|dx| (dx, dy)))
        {
            let pixel = self.pixel(other.u + PLACE * dx, other.v + PLACE * dy);
            let mut at = pixel.map_or(NONE, |pixel| self.first[pixel]);
            while at != NONE {
                let point = &points[at as usize];
                let away = (point.u - other.u).powi(2) + (point.v - other.v).powi(2);
                // Of points of several channels in one place the one that says the same.
                let worth = away + (point.disparity - other.disparity).abs().min(1.0) * 1e-3;
                if away <= PLACE * PLACE && nearest.is_none_or(|(least, _)| worth < least) {
                    nearest = Some((worth, point));
                }
                at = self.next[at as usize];
            }
        }
        nearest.map(|(_, point)| point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chance(seed: u64) -> f32 {
        let mixed = (seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32
            / (1u64 << 24) as f32
    }

    #[test]
    fn partners_are_those_of_a_twin_that_looks_at_all_points() {
        let size = Size::new(40, 30);
        let points = |seed: u64| -> Vec<Point> {
            let point = |i: u64| Point {
                u: 39.9 * chance(seed + 3 * i),
                v: 29.9 * chance(seed + 3 * i + 1),
                disparity: 9.0 * chance(seed + 3 * i + 2),
                ..Point::default()
            };
            (0..400).map(point).collect()
        };
        let (own, others) = (points(1), points(7_000));
        let mut cells = Cells::default();
        cells.fill(size, &others);
        let mut alone = 0;
        for point in &own {
            let away = |other: &&Point| {
                (other.u - point.u).powi(2)
                    + (other.v - point.v).powi(2)
                    + (other.disparity - point.disparity).abs().min(1.0) * 1e-3
            };
            let near = others
                .iter()
                .filter(|other| (other.u - point.u).hypot(other.v - point.v) <= PLACE);
            let twin = near.min_by(|a, b| away(a).total_cmp(&away(b)));
            assert_eq!(cells.nearest(&others, point), twin);
            alone += usize::from(twin.is_none());
        }
        assert!((50..350).contains(&alone), "{alone} without a partner");
    }

    #[test]
    fn better_is_more_for_no_more_errors_and_what_has_its_price_is_neither() {
        let points = Shared {
            moved: 1,
            ..Shared::default()
        };
        let truth = |coverage, bad_one| Truth {
            coverage,
            bad_one,
            bad_two: 0.0,
            median: 0.1,
            scans: 1,
        };
        let of = |coverage, bad_one| {
            verdict(&points, Some([truth(0.6, 0.003), truth(coverage, bad_one)]))
        };
        assert_eq!(of(0.61, 0.003), Verdict::Better);
        assert_eq!(of(0.6, 0.002), Verdict::Better);
        assert_eq!(of(0.59, 0.003), Verdict::Worse);
        assert_eq!(of(0.61, 0.004), Verdict::Different);
        assert_eq!(of(0.6004, 0.00303), Verdict::Same);
        assert_eq!(verdict(&points, None), Verdict::Different);
        assert_eq!(verdict(&Shared::default(), None), Verdict::Same);
    }
}
