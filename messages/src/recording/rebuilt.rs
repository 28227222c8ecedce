//! What a recording says about itself, from its messages alone: for files whose metadata others left out.

use std::collections::{BTreeMap, BTreeSet};

use super::error::ReadError;
use super::metadata::{Metadata, is_possible};
use super::names::schema_of;
use super::read::Recording;
use super::scan::Scan;
use crate::record::{CameraSaid, Codec, TRANSFORMS, frame_said, places_said, size_said};
use crate::rig::{Rail, Rig, View};
use crate::{Calibration, Kind, Owned, Points, Size, Topic};

/// Frames from one member of a triple to the next are looked for up to so many.
const MOST_STRIDE: u64 = 64;

/// Puts together what the messages say.
///
/// # Errors
/// When they do not say which views there are, or how large images are.
pub(super) fn rebuilt(recording: &mut Recording) -> Result<Metadata, ReadError> {
    let schemas: BTreeMap<String, String> = recording
        .definitions()
        .into_iter()
        .map(|(topic, _, schema)| {
            let said = schema.map(|schema| schema.name.clone());
            (topic.to_owned(), said.unwrap_or_else(|| schema_of(topic)))
        })
        .collect();
    let path = recording.path().to_owned();
    let silent = |what| ReadError::Silent {
        path: path.clone(),
        what,
    };
    let Names { views, channels } = Names::of(schemas.keys());
    if views.is_empty() {
        return Err(silent("which views there are"));
    }
    let Some(size) = largest(recording, &schemas) else {
        return Err(silent("how large its images are"));
    };
    let is_rail = views.len() == 1 && views.contains(Rail::VIEW);
    let rig = match is_rail {
        true => rail(recording, channels, size),
        false => rig(recording, &views, channels, size),
    };
    if !is_possible(&rig) {
        return Err(silent("a possible rig"));
    }
    Ok(Metadata {
        version: String::new(),
        reference: reference(recording, &schemas, &rig),
        rig,
        ..Metadata::unknown()
    })
}

/// What topics are called after.
#[derive(Debug, Default, PartialEq)]
struct Names {
    views: BTreeSet<String>,
    /// Coarse to fine.
    channels: Vec<f32>,
}

impl Names {
    fn of<'a>(topics: impl Iterator<Item = &'a String>) -> Self {
        let mut names = Self::default();
        for topic in topics {
            let parts: Vec<&str> = topic.split('/').collect();
            let (view, channel) = match parts.as_slice() {
                ["camera", view, _] => (Some(*view), None),
                ["edges" | "curves" | "tables", view, channel] => (Some(*view), Some(*channel)),
                ["matches", channel] => (None, Some(*channel)),
                _ => continue,
            };
            names.views.extend(view.map(str::to_owned));
            let channel = channel.and_then(|channel| channel.parse::<f32>().ok());
            names.channels.extend(channel);
        }
        names.channels.sort_by(|a, b| b.total_cmp(a));
        names.channels.dedup();
        names
    }
}

/// The largest image of any scan.
fn largest(recording: &mut Recording, schemas: &BTreeMap<String, String>) -> Option<Size> {
    // Calibrations are small and tell it of every scan; where there are none, anything does.
    let is_calibration = |topic: &&String| topic.ends_with("/calibration");
    let mut asked: BTreeSet<&String> = schemas.keys().filter(is_calibration).collect();
    if asked.is_empty() {
        asked = schemas.keys().collect();
    }
    let scans: Vec<u64> = recording.scans().collect();
    let mut largest: Option<Size> = None;
    for scan in scans {
        let Ok(read) = recording.scan_of(scan, |topic| asked.contains(&topic.to_owned())) else {
            continue;
        };
        for (topic, message) in read.messages() {
            let schema = schemas.get(topic).map_or("", String::as_str);
            let said = size_said(schema, message);
            let pixels = |size: &Size| u64::from(size.width) * u64::from(size.height);
            largest = said.into_iter().chain(largest).max_by_key(pixels);
        }
        recording.reuse(read);
    }
    largest
}

/// The first scan that has this topic, as far as that.
fn first_with(recording: &mut Recording, topic: &str) -> Option<Scan> {
    let has_it = |(scan, topics): (u64, BTreeSet<&str>)| topics.contains(topic).then_some(scan);
    let scan = recording.topics_by_scan().find_map(has_it)?;
    recording.scan_of(scan, |name| name == topic).ok()
}

/// What the camera of a view says.
fn camera(recording: &mut Recording, view: &str) -> Option<CameraSaid> {
    let topic = format!("camera/{view}/calibration");
    let scan = first_with(recording, &topic)?;
    CameraSaid::of(scan.message(&topic)?)
}

/// Several cameras in a row.
fn rig(recording: &mut Recording, views: &BTreeSet<String>, channels: Vec<f32>, size: Size) -> Rig {
    let cameras: BTreeMap<&String, CameraSaid> = views
        .iter()
        .filter_map(|view| Some((view, camera(recording, view)?)))
        .collect();
    let transforms = first_with(recording, TRANSFORMS);
    let transforms = transforms
        .as_ref()
        .and_then(|scan| scan.message(TRANSFORMS));
    let said = transforms.map_or_else(BTreeMap::new, places_said);
    let place = |view: &String| {
        let frame = said.get(&format!("{view}_optical")).copied();
        frame.or_else(|| Some(cameras.get(view)?.place_m))
    };
    let mut placed: Vec<(Option<f64>, &String)> = views.iter().map(|v| (place(v), v)).collect();
    match placed.iter().all(|(place, _)| place.is_some()) {
        true => placed.sort_by(|a, b| a.0.unwrap_or(0.0).total_cmp(&b.0.unwrap_or(0.0))),
        // Names tell it too.
        false => placed.sort_by_key(|(_, view)| by_name(view)),
    }
    let first = placed.first().and_then(|(place, _)| *place);
    let second = placed.get(1).and_then(|(place, _)| *place);
    let baseline_m = first.zip(second).map(|(first, second)| second - first);
    let view = |(index, (place, name)): (usize, &(Option<f64>, &String))| {
        let steps = place.zip(first).zip(baseline_m);
        let steps = steps.map(|((place, first), baseline)| (place - first) / baseline);
        let steps = steps.filter(|steps| steps.is_finite());
        View {
            name: (*name).clone(),
            position_steps: steps.map_or(index as f64, whole),
        }
    };
    let views: Vec<View> = placed.iter().enumerate().map(view).collect();
    let camera = cameras.into_values().next().zip(baseline_m);
    let calibration = camera.map(|(camera, baseline_m)| calibration(&camera, baseline_m));
    Rig {
        views,
        calibration: calibration.filter(|camera| camera.calibrated),
        ..Rig::of_views(0, &channels, size)
    }
}

/// One camera along a rail.
fn rail(recording: &mut Recording, channels: Vec<f32>, size: Size) -> Rig {
    let camera = camera(recording, Rail::VIEW);
    let calibration = camera.map(|camera| calibration(&camera, 0.1));
    let calibration = calibration.unwrap_or(Calibration::assumed(size));
    let mut rig = Rig {
        calibration: Some(calibration),
        ..Rig::of_rail(
            Rail {
                stride: 1,
                ..Rail::default()
            },
            &channels,
            size,
        )
    };
    if let Some((stride, baseline_m)) = triple(recording, &rig) {
        rig.rail = Some(Rail {
            stride,
            ..Rail::default()
        });
        rig.calibration = Some(Calibration {
            baseline_m,
            ..calibration
        });
    }
    rig
}

/// How many frames apart those of a triple are, and how far: a point's depth and disparity tell it.
fn triple(recording: &mut Recording, rig: &Rig) -> Option<(u64, f64)> {
    let codec = Codec::new(rig.clone(), 0);
    let topic = Topic::of(rig, Kind::Points).pop()?;
    let focal_px = rig.calibration(rig.size).focal_px;
    let scans: Vec<u64> = recording.scans().collect();
    let mut places: BTreeMap<u64, f64> = BTreeMap::new();
    for scan in scans {
        let is_wanted = |name: &str| name == topic.name || name == TRANSFORMS;
        let Ok(read) = recording.scan_of(scan, is_wanted) else {
            continue;
        };
        let transforms = read.message(TRANSFORMS);
        if let Some(place) = transforms.and_then(|said| codec.position_in(said)) {
            places.insert(scan, place);
        }
        let points: Option<Owned<Points>> = read.decode(&codec, &topic).ok();
        let point = points.and_then(|points| points.view().points.first().copied());
        recording.reuse(read);
        let Some(point) = point.filter(|point| point.disparity > 0.0) else {
            continue;
        };
        let baseline = f64::from(point.z) * f64::from(point.disparity) / focal_px;
        let here = *places.get(&scan)?;
        let apart = |stride: u64| {
            let there = places.get(&scan.checked_sub(stride)?)?;
            Some((stride, (here - there).abs()))
        };
        let off = |(_, apart): &(u64, f64)| (apart - baseline).abs();
        let all = (1..=MOST_STRIDE).filter_map(apart);
        return all.min_by(|a, b| off(a).total_cmp(&off(b)));
    }
    None
}

fn calibration(camera: &CameraSaid, baseline_m: f64) -> Calibration {
    let assumed = Calibration::assumed(camera.size);
    let said = Calibration {
        focal_px: camera.focal_px,
        cx: camera.cx,
        cy: camera.cy,
        baseline_m,
        calibrated: false,
    };
    let is_assumed = (said.baseline_m - assumed.baseline_m).abs() < 1e-12
        && (said.focal_px, said.cx, said.cy) == (assumed.focal_px, assumed.cx, assumed.cy);
    Calibration {
        calibrated: !is_assumed,
        ..said
    }
}

/// The view that disparities and points are of, as their frame says.
fn reference(recording: &mut Recording, schemas: &BTreeMap<String, String>, rig: &Rig) -> usize {
    let said = ["points", "disparity"].into_iter().find_map(|topic| {
        let scan = first_with(recording, topic)?;
        let frame = frame_said(schemas.get(topic)?, scan.message(topic)?)?;
        let is_it = |view: &View| frame == format!("{}_optical", view.name);
        rig.views.iter().position(is_it)
    });
    said.unwrap_or(0)
}

/// From left to right, by name.
fn by_name(view: &str) -> (u32, String) {
    let known = ["left", "centre", "right"]
        .iter()
        .position(|name| *name == view);
    let place = known.map(|at| at as u32).or_else(|| view.parse().ok());
    (place.unwrap_or(u32::MAX), view.to_owned())
}

/// A number that is hardly off a whole one as that.
fn whole(steps: f64) -> f64 {
    match (steps - steps.round()).abs() < 1e-9 {
        true => steps.round(),
        false => steps,
    }
}
