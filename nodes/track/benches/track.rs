//! How long tracking takes.

#[path = "../tests/contours/mod.rs"]
mod contours;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use messages::{Curves, EdgesView, Owned, Size};
use track::{Settings, Tracker};

fn track(criterion: &mut Criterion) {
    let size = Size::new(512, 480);
    let mut group = criterion.benchmark_group("track/512x480");
    for (name, wavelength) in [("10k_edges", 51.0), ("40k_edges", 12.7)] {
        let edges = contours::of(size, contours::waves(wavelength));
        let mut tracker = Tracker::new(&Settings::default(), size);
        let mut curves = Owned::<Curves>::new(size);
        group.throughput(Throughput::Elements(edges.len() as u64));
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let edges = EdgesView {
                    edges: black_box(&edges),
                };
                curves.fill(|room| tracker.process(edges, size, room))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, track);
criterion_main!(benches);
