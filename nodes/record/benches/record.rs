//! How long recording takes: encoding a scan, writing and flushing it by compression, and reading it back.
#![expect(clippy::unwrap_used, reason = "a bench may panic")]

#[path = "../tests/synthetic/mod.rs"]
mod synthetic;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use messages::Size;
use messages::record::Sink as _;
use record::{Batch, Compression, Recording, Settings, Writer};
use synthetic::{Scan, metadata};

fn record(criterion: &mut Criterion) {
    let rig = synthetic::rig(Size::new(512, 480));
    let scan = Scan::new(&rig, 0, 400);
    let mut encoder = synthetic::encoder(&rig, &Settings::default());
    let mut batch = Batch::default();
    encoder.encode(&scan.messages(), &mut batch);

    let mut group = criterion.benchmark_group("record/512x480");
    group.throughput(Throughput::Bytes(batch.len() as u64));
    let messages = scan.messages();
    group.bench_function("encode", |bencher| {
        bencher.iter(|| encoder.encode(&messages, &mut batch));
    });
    for (name, compression) in [
        ("none", Compression::None),
        ("lz4", Compression::Lz4),
        ("zstd", Compression::Zstd),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let settings = Settings {
            compression: Some(compression),
            ..Settings::default()
        };
        let create = |number: u32| {
            let path = folder.path().join(format!("{number}.mcap"));
            Writer::create(&path, false, &metadata(&rig), &encoder, &settings).unwrap()
        };
        let mut scans = 0;
        group.bench_function(format!("write_and_flush/{name}"), |bencher| {
            // Every so often a new file for the old one, so that no disk fills up.
            let mut writer = create(scans);
            bencher.iter(|| {
                writer.write(&batch).unwrap();
                scans += 1;
                if scans % 64 == 0 {
                    std::fs::remove_file(writer.path()).unwrap();
                    writer = create(scans);
                }
            });
            std::fs::remove_file(writer.path()).unwrap();
            scans += 1;
        });
        let mut writer = create(scans + 1);
        let path = writer.path().to_owned();
        writer.write(&batch).unwrap();
        writer.finish(None).unwrap();
        let mut recording = Recording::open(&path).unwrap();
        group.bench_function(format!("read/{name}"), |bencher| {
            bencher.iter(|| recording.scan(0).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, record);
criterion_main!(benches);
