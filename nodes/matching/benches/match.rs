//! How long the match stage takes for three views in three channels.

use criterion::{Criterion, criterion_group, criterion_main};
use matching::{Assignment, ChannelView, Matcher, Method, Settings};
use messages::{
    Calibration, Curves, Disparity, Edges, Image, Matches, MatchesRoom, Message, Owned, Points,
    Size, Tables,
};

const SIZE: Size = Size::new(512, 480);

/// A textured plane that recedes downwards: smoothed noise, seen from three places.
fn view(steps: f32) -> Vec<u8> {
    let noise = |x: i64, y: i64| {
        let mixed = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32
            / (1u64 << 24) as f32
    };
    let smooth = |x: f32, y: f32, cell: f32| {
        let (x, y) = (x / cell, y / cell);
        let (left, top) = (x.floor(), y.floor());
        let (s, t) = (x - left, y - top);
        let (s, t) = (s * s * (3.0 - 2.0 * s), t * t * (3.0 - 2.0 * t));
        let at = |dx: i64, dy: i64| noise(left as i64 + dx, top as i64 + dy);
        let (above, below) = (
            at(0, 0) + s * (at(1, 0) - at(0, 0)),
            at(0, 1) + s * (at(1, 1) - at(0, 1)),
        );
        above + t * (below - above)
    };
    let pixel = |i: usize| {
        let (x, y) = (
            (i % SIZE.width as usize) as f32,
            (i / SIZE.width as usize) as f32,
        );
        let x = x + steps * (8.0 + 24.0 * y / SIZE.height as f32);
        (40.0 + 120.0 * smooth(x, y, 17.0) + 60.0 * smooth(x + 1000.0, y, 7.0)) as u8
    };
    (0..SIZE.pixels()).map(pixel).collect()
}

fn three_channels(criterion: &mut Criterion) {
    let filter_settings = filter::Settings::default();
    let mut filter = filter::Filter::new(&filter_settings, SIZE);
    let mut tracker = track::Tracker::new(&track::Settings::default(), SIZE);
    let mut tabulator = hough::Tabulator::new(&hough::Settings::default(), SIZE);
    let channels = filter_settings.channels;
    let (mut image, mut edges) = (Owned::<Image>::new(SIZE), Owned::<Edges>::new(SIZE));
    let mut made: Vec<Vec<(Owned<Curves>, Owned<Tables>)>> =
        channels.iter().map(|_| Vec::new()).collect();
    for steps in 0..3 {
        image.fill(|room| {
            room.clear();
            room.pixels.extend_from_slice(&view(steps as f32));
        });
        filter.begin(image.view(), SIZE);
        for (channel, made) in made.iter_mut().enumerate() {
            edges.fill(|room| {
                room.clear();
                filter.edges(channel, room);
            });
            let (mut curves, mut tables) = (Owned::new(SIZE), Owned::new(SIZE));
            curves.fill(|room| tracker.process(edges.view(), SIZE, room));
            tables.fill(|room| tabulator.process(Owned::view(&curves), SIZE, room));
            made.push((curves, tables));
        }
    }
    let inputs: Vec<[ChannelView<'_>; 3]> = made
        .iter()
        .map(|views| {
            [0, 1, 2].map(|v| ChannelView {
                curves: views[v].0.view(),
                tables: views[v].1.view(),
            })
        })
        .collect();
    let mut words: Vec<Vec<u64>> = channels
        .iter()
        .map(|_| vec![0; Matches::words(SIZE)])
        .collect();
    let mut rooms: Vec<MatchesRoom<'_>> = words
        .iter_mut()
        .filter_map(|words| Matches::room(words, SIZE))
        .collect();
    let (mut disparity, mut points) = (Owned::<Disparity>::new(SIZE), Owned::<Points>::new(SIZE));
    let calibration = Calibration::assumed(SIZE);
    for (name, settings) in [
        ("three-view", Settings::default()),
        (
            "three-view-curve",
            Settings {
                assignment: Assignment::Curve,
                ..Settings::default()
            },
        ),
        (
            "two-view",
            Settings {
                method: Method::TwoView,
                ..Settings::default()
            },
        ),
        (
            "point",
            Settings {
                method: Method::Point,
                ..Settings::default()
            },
        ),
    ] {
        let mut matcher = Matcher::new(&settings, &channels);
        criterion.bench_function(&format!("match/512x480/{name}"), |bench| {
            bench.iter(|| {
                disparity.fill(|disparity| {
                    points.fill(|points| {
                        matcher.process(&inputs, SIZE, &calibration, &mut rooms, disparity, points)
                    });
                });
            });
        });
    }
}

criterion_group!(benches, three_channels);
criterion_main!(benches);
