//! What capture costs a view: making a rendered picture once, and reading it ever after.
#![expect(clippy::unwrap_used, reason = "benchmarks")]

use capture::{Settings, Source};
use criterion::{Criterion, criterion_group, criterion_main};
use messages::{Image, Owned};

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
    for object in ["tab", "jack", "screwdriver"] {
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

criterion_group!(capture, benches);
criterion_main!(capture);
