//! What capture costs a view: making a rendered picture once, and reading or rectifying it ever after.
#![expect(clippy::unwrap_used, reason = "benchmarks")]

use capture::{Camera, Lens, Map, Settings, Source};
use criterion::{Criterion, criterion_group, criterion_main};
use messages::{Image, Owned, Size};

fn source(object: &str) -> Source {
    let source = format!("scene:{object}");
    Source::open(&Settings {
        source,
        ..Settings::default()
    })
    .unwrap()
}

fn benches(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("capture");
    let mut image = Owned::<Image>::new(source("tab").size());
    group.sample_size(10);
    for object in ["tab", "jack", "screwdriver", "fence"] {
        group.bench_function(format!("render_three_views/{object}/512x480"), |bencher| {
            bencher.iter(|| {
                let mut source = source(object);
                for view in 0..3 {
                    image.fill(|room| source.read(0, view, room)).unwrap();
                }
            });
        });
    }
    group.sample_size(100);
    let mut source = source("tab");
    let mut scan = 0;
    group.bench_function("read_view/rendered/512x480", |bencher| {
        bencher.iter(|| {
            scan += 1;
            image.fill(|room| source.read(scan, 1, room)).unwrap()
        });
    });
    group.finish();
}

/// The map of a lens with barrel distortion, a little to the side.
fn map(size: Size) -> Map {
    let centre = [f64::from(size.width) / 2.0, f64::from(size.height) / 2.0];
    let lens = Lens::Rational {
        radial: [-0.25, 0.1, 0.0, 0.0, 0.0, 0.0],
        tangential: [0.001, -0.0005],
    };
    let camera = Camera::new(None, [600.0; 2], centre, lens);
    Map::new(size, |x, y| {
        let at = [x - centre[0] + 3.0, y - centre[1] + 0.05 * x, 650.0];
        camera.project(at)
    })
}

fn rectify(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("rectify");
    for size in [Size::new(512, 480), Size::new(1920, 1200)] {
        let map = map(size);
        let value = |i: usize| (i * 37 % 251) as u8;
        let source: Vec<u8> = (0..size.pixels()).map(value).collect();
        let mut out = vec![0; size.pixels()];
        group.bench_function(size.to_string(), |bencher| {
            bencher.iter(|| map.process(&source, &mut out));
        });
    }
    group.sample_size(10);
    let size = Size::new(512, 480);
    group.bench_function(format!("map/{size}"), |bencher| {
        bencher.iter(|| self::map(size));
    });
    group.finish();
}

criterion_group!(capture, benches, rectify);
criterion_main!(capture);
