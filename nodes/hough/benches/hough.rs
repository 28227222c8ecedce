//! How long making tables takes.

#[path = "../tests/snakes/mod.rs"]
mod snakes;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use hough::{Settings, Tabulator, Weight};
use messages::{Owned, Size, Tables};

fn hough(criterion: &mut Criterion) {
    let size = Size::new(512, 480);
    let mut group = criterion.benchmark_group("hough/512x480");
    for (name, curves, weight) in [
        ("10k_points", 400, Weight::Unity),
        ("10k_points_by_curvature", 400, Weight::Curvature),
        ("40k_points", 1600, Weight::Unity),
    ] {
        let curves = snakes::message(&snakes::wander(size, curves, 25, 1), size);
        let mut tabulator = Tabulator::new(
            &Settings {
                weight,
                constant: 1.0,
                ..Settings::default()
            },
            size,
        );
        let mut tables = Owned::<Tables>::new(size);
        group.throughput(Throughput::Elements(curves.view().points.len() as u64));
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let curves = black_box(curves.view());
                tables.fill(|room| tabulator.process(curves, size, room))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, hough);
criterion_main!(benches);
