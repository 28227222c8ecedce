//! Runs the whole chain on three images and writes the matched points.
//!
//! ```text
//! scene FOLDER 1,3,5 [--csv FILE] [--png FILE] [--thesis] [--time ROUNDS] [--set filter.channels=[4,2,1]] [--set method=two-view] ...
//! ```
//!
//! The folder holds `view0.png`, `view1.png`, … Prints how long each stage took and what was found.
#![expect(clippy::print_stdout, reason = "an example talks to the terminal")]

use std::error::Error;
use std::fmt::Write as _;
use std::time::Instant;

use matching::{ChannelView, Matcher};
use messages::settings::Settings;
use messages::{
    Calibration, Curves, Disparity, Edges, Image, Matches, MatchesRoom, Message, Owned, Points,
    Size, Tables,
};
use serde_json::Value;

/// A node's settings as JSON with some keys replaced.
fn settings<S: Settings>(node: &str, base: S, overrides: &[String]) -> Result<S, Box<dyn Error>> {
    let mut json = serde_json::to_value(base)?;
    for text in overrides {
        let (key, value) = text.split_once('=').ok_or("--set node.key=value")?;
        // A key alone is the matcher's.
        let (owner, key) = key.split_once('.').unwrap_or(("match", key));
        if owner == node {
            json[key] =
                serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.to_owned()));
        }
    }
    let settings: S = serde_json::from_value(json)?;
    settings.check()?;
    Ok(settings)
}

fn main() -> Result<(), Box<dyn Error>> {
    let (mut places, mut overrides) = (Vec::new(), Vec::new());
    let (mut csv, mut png, mut thesis, mut rounds) = (None, None, false, None);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--set" => overrides.extend(arguments.next()),
            "--csv" => csv = arguments.next(),
            "--png" => png = arguments.next(),
            "--thesis" => thesis = true,
            "--time" => rounds = Some(arguments.next().ok_or("--time ROUNDS")?.parse()?),
            _ => places.push(argument),
        }
    }
    let [folder, views] = places.as_slice() else {
        return Err(
            "scene FOLDER 1,3,5 [--csv FILE] [--png FILE] [--thesis] [--set node.key=value] [--time ROUNDS]".into(),
        );
    };
    fn profile<S: Default>(thesis: bool, literal: S) -> S {
        if thesis { literal } else { S::default() }
    }
    let filter_settings = settings(
        "filter",
        profile(thesis, filter::Settings::thesis()),
        &overrides,
    )?;
    let track_settings = settings(
        "track",
        profile(thesis, track::Settings::thesis()),
        &overrides,
    )?;
    let hough_settings = settings(
        "hough",
        profile(thesis, hough::Settings::thesis()),
        &overrides,
    )?;
    let match_settings = settings(
        "match",
        profile(thesis, matching::Settings::thesis()),
        &overrides,
    )?;

    let mut images = Vec::new();
    for view in views.split(',') {
        images.push(image::open(format!("{folder}/view{view}.png"))?.into_luma8());
    }
    let first = images.first().ok_or("three views are needed")?;
    let size = Size::new(first.width(), first.height());
    if images.len() != 3
        || images
            .iter()
            .any(|image| image.dimensions() != first.dimensions())
    {
        return Err("three views of one size are needed".into());
    }

    let channels = filter_settings.channels.clone();
    let mut filter = filter::Filter::new(&filter_settings, size);
    let mut tracker = track::Tracker::new(&track_settings, size);
    let mut tabulator = hough::Tabulator::new(&hough_settings, size);
    let mut matcher = Matcher::new(&match_settings, &channels);
    let (mut image, mut edges) = (Owned::<Image>::new(size), Owned::<Edges>::new(size));
    let mut curves: Vec<_> = (0..3 * channels.len())
        .map(|_| Owned::<Curves>::new(size))
        .collect();
    let mut tables: Vec<_> = (0..3 * channels.len())
        .map(|_| Owned::<Tables>::new(size))
        .collect();
    let mut words: Vec<Vec<u64>> = channels
        .iter()
        .map(|_| vec![0; Matches::words(size)])
        .collect();
    let mut rooms: Vec<MatchesRoom<'_>> = words
        .iter_mut()
        .filter_map(|words| Matches::room(words, size))
        .collect();
    let (mut disparity, mut points) = (Owned::<Disparity>::new(size), Owned::<Points>::new(size));

    // The second time round every page of memory is in place.
    for round in ["cold", "warm"] {
        let mut seconds = [0.0; 4];
        let mut clock = Instant::now();
        let mut lap = |stage: usize| {
            seconds[stage] += clock.elapsed().as_secs_f64();
            clock = Instant::now();
        };
        for (view, pixels) in images.iter().enumerate() {
            image.fill(|room| {
                room.clear();
                room.pixels.extend_from_slice(pixels.as_raw());
            });
            lap(3);
            filter.begin(image.view(), size);
            for channel in 0..channels.len() {
                let at = 3 * channel + view;
                edges.fill(|room| {
                    room.clear();
                    filter.edges(channel, room);
                });
                lap(0);
                curves[at].fill(|room| tracker.process(edges.view(), size, room));
                lap(1);
                tables[at].fill(|room| tabulator.process(curves[at].view(), size, room));
                lap(2);
            }
        }
        let inputs = inputs(&curves, &tables);
        let found = (&mut rooms[..], &mut disparity, &mut points);
        let matching = matched(&mut matcher, &inputs, size, found);
        let [filter, track, hough, _] = seconds.map(|seconds| 1e3 * seconds);
        println!(
            "{round}: filter {filter:.1} ms, track {track:.1} ms, hough {hough:.1} ms, match {:.1} ms",
            1e3 * matching
        );
    }
    if let Some(rounds) = rounds {
        let inputs = inputs(&curves, &tables);
        // The least of many rounds: what else the machine does only adds.
        let mut least = f64::INFINITY;
        for _ in 0..rounds {
            let found = (&mut rooms[..], &mut disparity, &mut points);
            least = least.min(matched(&mut matcher, &inputs, size, found));
        }
        println!("match, least of {rounds} rounds: {:.1} ms", 1e3 * least);
    }
    for (channel, room) in channels.iter().zip(&rooms) {
        println!(
            "channel {channel}: {} curves matched, {} points",
            room.matches.len(),
            room.points.len()
        );
    }
    println!("{} points", points.view().points.len());
    if let Some(path) = csv {
        let mut text = String::from("scan,view,channel,curve,x,y,disparity,score,depth\n");
        for p in points.view().points {
            writeln!(
                text,
                "0,{},{},{},{},{},{},{},{}",
                match_settings.reference.index(3),
                channels[p.channel as usize],
                p.curve,
                p.u,
                p.v,
                p.disparity,
                p.score,
                p.z
            )?;
        }
        std::fs::write(path, text)?;
    }
    if let Some(path) = png {
        picture(disparity.view().disparity, size).save(path)?;
    }
    Ok(())
}

/// What the matcher is given: of every channel its three views.
fn inputs<'a>(
    curves: &'a [Owned<Curves>],
    tables: &'a [Owned<Tables>],
) -> Vec<[ChannelView<'a>; 3]> {
    let view = |at: usize| ChannelView {
        curves: curves[at].view(),
        tables: tables[at].view(),
    };
    let channels = 0..curves.len() / 3;
    channels
        .map(|channel| [0, 1, 2].map(|v| view(3 * channel + v)))
        .collect()
}

/// Where the matcher's results go.
type Found<'a, 'b> = (
    &'a mut [MatchesRoom<'b>],
    &'a mut Owned<Disparity>,
    &'a mut Owned<Points>,
);

/// Matches the scan once, and says how many seconds that took.
fn matched(
    matcher: &mut Matcher,
    inputs: &[[ChannelView<'_>; 3]],
    size: Size,
    (rooms, disparity, points): Found<'_, '_>,
) -> f64 {
    let calibration = Calibration::assumed(size);
    let start = Instant::now();
    disparity.fill(|disparity| {
        points.fill(|points| matcher.process(inputs, size, &calibration, rooms, disparity, points));
    });
    start.elapsed().as_secs_f64()
}

/// The disparity picture in colours, near red, far blue, unknown black.
fn picture(disparity: &[f32], size: Size) -> image::RgbImage {
    let known = disparity.iter().copied().filter(|d| d.is_finite());
    let (least, most) = known.fold((f32::INFINITY, 0f32), |(a, b), d| (a.min(d), b.max(d)));
    let colour = |d: f32| {
        let t = (d - least) / (most - least).max(1e-6);
        let hill = |centre: f32| (255.0 * (1.5 - 4.0 * (t - centre).abs()).clamp(0.0, 1.0)) as u8;
        image::Rgb(if d.is_finite() {
            [hill(0.75), hill(0.5), hill(0.25)]
        } else {
            [0; 3]
        })
    };
    image::RgbImage::from_fn(size.width, size.height, |x, y| {
        colour(disparity[(y * size.width + x) as usize])
    })
}
