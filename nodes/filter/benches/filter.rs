//! What the filter costs: `cargo bench -p filter`.

use criterion::{Criterion, criterion_group, criterion_main};
use filter::{Filter, Settings};
use messages::{Edges, ImageView, Owned, Size};

/// Three views of a textured surface with noise, as scenes have: waves of many lengths, and a few sharp borders.
fn views(size: Size) -> Vec<Vec<u8>> {
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let waves: Vec<[f32; 4]> = (0..40)
        .map(|i| {
            let frequency = 0.03 * 1.08f32.powi(i);
            let angle = 3.15 * random();
            [
                frequency * angle.cos(),
                frequency * angle.sin(),
                6.3 * random(),
                14.0 / (1.0 + 0.05 * i as f32),
            ]
        })
        .collect();
    let brightness = |x: f32, y: f32| {
        let waves: f32 = waves
            .iter()
            .map(|[u, v, phase, high]| high * (u * x + v * y + phase).sin())
            .sum();
        let border = if ((x / 90.0).sin() + (y / 70.0).cos()) > 0.3 {
            40.0
        } else {
            -20.0
        };
        110.0 + 0.6 * waves + border
    };
    let mut view = |shift: f32| {
        let pixels = (0..size.pixels()).map(|i| (i % size.width as usize, i / size.width as usize));
        pixels
            .map(|(x, y)| (brightness(x as f32 + shift, y as f32) + 4.0 * (random() - 0.5)) as u8)
            .collect()
    };
    [0.0, 12.3, 24.6].map(&mut view).into()
}

fn bench(criterion: &mut Criterion) {
    let coarse = Settings {
        smoothing: None,
        ..Settings {
            channels: vec![30.0, 20.0, 10.0],
            ..Settings::default()
        }
    };
    let sets = [
        ("three_channels", Settings::default()),
        (
            "three_channels_8_4_1.5",
            Settings {
                channels: vec![8.0, 4.0, 1.5],
                ..Settings::default()
            },
        ),
        ("three_channels_30_20_10", coarse),
        ("three_channels_thesis", Settings::thesis()),
    ];
    for (width, height) in [(512, 480), (640, 512), (695, 555), (1920, 1080)] {
        let size = Size::new(width, height);
        let views = views(size);
        let mut room = Owned::<Edges>::new(size);
        for (name, settings) in &sets {
            if width > 640 && *name != "three_channels" {
                continue;
            }
            let mut filter = Filter::new(settings, size);
            criterion.bench_function(&format!("filter/{name}/{size}"), |bencher| {
                bencher.iter(|| {
                    for pixels in &views {
                        filter.begin(ImageView { pixels }, size);
                        for channel in 0..filter.channels() {
                            room.fill(|room| filter.edges(channel, room));
                        }
                    }
                });
            });
        }
        let mut filter = Filter::new(&Settings::default(), size);
        criterion.bench_function(&format!("filter/spectrum/{size}"), |bencher| {
            bencher.iter(|| filter.begin(ImageView { pixels: &views[0] }, size));
        });
        criterion.bench_function(&format!("filter/laplacian/{size}"), |bencher| {
            bencher.iter(|| filter.filtered(2).count());
        });
        criterion.bench_function(&format!("filter/edges/{size}"), |bencher| {
            bencher.iter(|| room.fill(|room| filter.edges(2, room)));
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = bench
}
criterion_main!(benches);
