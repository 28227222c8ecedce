//! Recordings from end to end: what was written is read, in parts, after deaths, and by a full disk.
#![expect(clippy::unwrap_used, reason = "tests")]

mod synthetic;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use messages::ledger::{Account, Ledger};
use messages::record::Sink as _;
use messages::record::{Level, Statistics};
use messages::{Curves, Image, Kind, Points, Rig, Size, Topic};
use record::{
    Batch, Compression, Encoder, Info, ReadError, Recording, Settings, WriteError, Writer, Written,
    part_path, seal, spawn,
};
use synthetic::{START, STEP, Scan, metadata};

const SIZE: Size = Size::new(64, 48);

fn rig() -> Rig {
    synthetic::rig(SIZE)
}

fn scan(sequence: u64) -> Scan {
    Scan::new(&rig(), sequence, 6)
}

/// A folder, and a recording's path in it.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("discs.mcap");
    (folder, path)
}

fn encode(encoder: &mut Encoder, sequence: u64) -> Batch {
    synthetic::batch(encoder, &scan(sequence))
}

fn create(path: &Path, settings: &Settings) -> (Writer, Encoder) {
    let encoder = synthetic::encoder(&rig(), settings);
    let writer = Writer::create(path, false, &metadata(&rig()), &encoder, settings).unwrap();
    (writer, encoder)
}

fn ledger(scans: u64) -> Ledger {
    Ledger {
        admitted: scans,
        done: scans,
        ..Ledger::default()
    }
}

/// Records these scans and finishes.
fn record(path: &Path, settings: &Settings, scans: std::ops::Range<u64>) -> Written {
    let (mut writer, mut encoder) = create(path, settings);
    for sequence in scans.clone() {
        writer.write(&encode(&mut encoder, sequence)).unwrap();
    }
    writer.finish(Some(&ledger(scans.end))).unwrap()
}

/// What the first scans encode to.
fn expected(sequence: u64) -> &'static Batch {
    static BATCHES: OnceLock<Vec<Batch>> = OnceLock::new();
    let encode_all = || {
        let mut encoder = synthetic::encoder(&rig(), &Settings::default());
        (0..16)
            .map(|sequence| encode(&mut encoder, sequence))
            .collect()
    };
    &BATCHES.get_or_init(encode_all)[sequence as usize]
}

/// Every message of these scans is there, to the byte.
fn assert_holds(recording: &mut Recording, scans: impl IntoIterator<Item = u64>) {
    let encoder = synthetic::encoder(&rig(), &Settings::default());
    for sequence in scans {
        let expected = expected(sequence);
        let read = recording.scan(sequence).unwrap();
        assert_eq!(read.nanos, START + sequence * STEP);
        for (channel, bytes) in expected.messages() {
            let name = &encoder.channels()[channel].name;
            assert!(
                read.message(name) == Some(bytes),
                "{name} of scan {sequence}"
            );
        }
        assert_eq!(
            read.messages().count(),
            expected.messages().count(),
            "scan {sequence}"
        );
    }
}

#[test]
fn what_was_recorded_is_read_with_every_compression_and_chunk_size() {
    for compression in [Compression::None, Compression::Lz4, Compression::Zstd] {
        for chunk_bytes in [65_536, 1 << 20] {
            let (_folder, path) = folder();
            let settings = Settings {
                compression: Some(compression),
                chunk_bytes,
                ..Settings::default()
            };
            let written = record(&path, &settings, 0..4);
            assert_eq!((written.scans, written.parts), (4, vec![path.clone()]));
            assert_eq!(written.bytes, fs::metadata(&path).unwrap().len());
            let mut recording = Recording::open(&path).unwrap();
            assert!(recording.is_complete());
            assert!(recording.scans().eq(0..4));
            assert_holds(&mut recording, 0..4);
            assert_eq!(recording.metadata(), &metadata(&rig()));
            assert_eq!(recording.ledger(), Some(ledger(4)));
        }
    }
}

#[test]
fn large_images_are_read_back_with_every_compression() {
    let rig = synthetic::rig(Size::new(3000, 1600));
    let scan = Scan::new(&rig, 0, 3);
    for compression in [Compression::None, Compression::Lz4, Compression::Zstd] {
        let (_folder, path) = folder();
        let settings = Settings {
            compression: Some(compression),
            ..Settings::default()
        };
        let mut encoder = synthetic::encoder(&rig, &settings);
        let mut writer =
            Writer::create(&path, false, &metadata(&rig), &encoder, &settings).unwrap();
        writer
            .write(&synthetic::batch(&mut encoder, &scan))
            .unwrap();
        writer.finish(None).unwrap();
        let mut recording = Recording::open(&path).unwrap();
        let topic = &Topic::of(&rig, Kind::Image)[0];
        assert!(recording.read::<Image>(0, topic).unwrap().view().pixels == scan.image());
        foreign_reader_accepts(&path, encoder.channels().len() as u64 - 3);
    }
}

#[test]
fn what_is_left_out_is_not_recorded_and_nothing_refers_to_it() {
    let (_folder, path) = folder();
    let without = vec![Kind::Edges, Kind::Tables];
    record(
        &path,
        &Settings {
            without,
            ..Settings::default()
        },
        0..2,
    );
    let mut recording = Recording::open(&path).unwrap();
    assert_eq!(recording.whole_scans(), [0, 1]);
    let names: Vec<_> = Info::of(&recording)
        .topics
        .into_iter()
        .map(|t| t.topic)
        .collect();
    assert!(
        !names
            .iter()
            .any(|name| name.starts_with("edges") || name.starts_with("tables"))
    );
    for topic in &Topic::of(&rig(), Kind::Curves) {
        assert!(
            !recording
                .read::<Curves>(1, topic)
                .unwrap()
                .view()
                .points
                .is_empty()
        );
    }
}

#[test]
fn data_comes_back_as_its_makers_made_it() {
    let (_folder, path) = folder();
    record(&path, &Settings::default(), 0..2);
    let mut recording = Recording::open(&path).unwrap();
    let topic = &Topic::of(&rig(), Kind::Points)[0];
    let points = recording.read::<Points>(1, topic).unwrap();
    assert_eq!(points.view().points, scan(1).points());
    assert_eq!(points.header.sequence, 1);
    assert_eq!(points.header.size(), SIZE);
    let error = recording.read::<Points>(7, topic).unwrap_err().to_string();
    assert_eq!(
        error,
        "there is no scan 7 in the recording; it holds 0 to 1"
    );
    let error = recording.read::<Curves>(1, topic).unwrap_err();
    assert!(matches!(error, ReadError::Message { .. }), "{error}");
}

#[test]
fn statistics_log_and_ledger_are_recorded_with_their_scan() {
    let (_folder, path) = folder();
    let (mut writer, mut encoder) = create(&path, &Settings::default());
    let mut batch = encode(&mut encoder, 5);
    encoder.log(Level::Warning, "track", "few curves", &mut batch);
    encoder.log(Level::Info, "track", "many curves", &mut batch);
    encoder.ledger(&ledger(5), &mut batch);
    writer.write(&batch).unwrap();
    writer.finish(None).unwrap();
    let mut recording = Recording::open(&path).unwrap();
    let read = recording.scan(5).unwrap();
    assert_eq!(
        read.messages().filter(|(topic, _)| *topic == "log").count(),
        2
    );
    let read_ledger: Ledger = serde_json::from_slice(read.message("ledger").unwrap()).unwrap();
    assert_eq!(read_ledger, ledger(5));
    let numbers: Statistics = serde_json::from_slice(read.message("statistics").unwrap()).unwrap();
    assert_eq!(
        (numbers.scan, numbers.points),
        (5, scan(5).points().len() as u64)
    );
    assert!((numbers.milliseconds.filter - 6.0).abs() < 0.01);
    assert!(numbers.known > 0.0 && numbers.disparity.unwrap() > 1.0);
}

#[test]
fn without_views_only_data_and_scene_are_recorded() {
    let (_folder, path) = folder();
    record(
        &path,
        &Settings {
            views: false,
            ..Settings::default()
        },
        0..1,
    );
    let info = Info::of(&Recording::open(&path).unwrap());
    assert!(info.complete);
    let topics: Vec<_> = info.topics.iter().map(|t| &*t.topic).collect();
    assert!(topics.contains(&"camera/left/calibration") && topics.contains(&"points"));
    assert!(!topics.contains(&"camera/left/annotations") && !topics.contains(&"disparity/picture"));
}

#[test]
fn rejected_curves_are_recorded_over_the_images_only_when_asked_for() {
    let topics = |views: bool, rejected: bool| {
        let (_folder, path) = folder();
        let settings = Settings {
            views,
            rejected,
            ..Settings::default()
        };
        record(&path, &settings, 0..2);
        let info = Info::of(&Recording::open(&path).unwrap());
        assert!(info.complete);
        let topics = info.topics.into_iter();
        let is_over_an_image = |topic: &str| topic.starts_with("camera/");
        let topics = topics.filter(|topic| {
            topic.schema == "foxglove.ImageAnnotations" && is_over_an_image(&topic.topic)
        });
        topics
            .map(|topic| (topic.topic, topic.count))
            .collect::<Vec<_>>()
    };
    let of = |what: &str| {
        ["left", "centre", "right"].map(|view| (format!("camera/{view}/{what}"), 2u64))
    };
    assert!(!Settings::default().rejected);
    assert_eq!(topics(true, false), of("annotations"));
    assert_eq!(topics(false, true), of("rejected"));
    let both = [of("annotations"), of("rejected")].concat();
    assert_eq!(topics(true, true), both);
}

#[test]
fn what_is_only_shown_is_taken_though_it_is_left_out() {
    let taken = |views: bool, rejected: bool| {
        let without = vec![Kind::Curves, Kind::Matches, Kind::Points, Kind::Tables];
        let settings = Settings {
            views,
            rejected,
            without,
            ..Settings::default()
        };
        let kinds = record::taken_kinds(&settings);
        [Kind::Curves, Kind::Matches, Kind::Points, Kind::Tables].map(|kind| kinds.contains(&kind))
    };
    assert_eq!(taken(false, false), [false; 4]);
    assert_eq!(taken(true, false), [true, true, true, false]);
    assert_eq!(taken(false, true), [true, true, false, false]);
}

/// Wants messages of some channels only, and counts them by channel.
struct Picky<F>(F, Vec<usize>);

impl<F: Fn(usize) -> bool> messages::record::Sink for Picky<F> {
    fn begin(&mut self, _sequence: u64, _nanos: u64) {}

    fn nanos(&self) -> u64 {
        START
    }

    fn wants(&self, channel: usize) -> bool {
        (self.0)(channel)
    }

    fn add(&mut self, channel: usize, encode: impl FnOnce(&mut Vec<u8>)) {
        let mut message = Vec::new();
        encode(&mut message);
        assert!(!message.is_empty());
        self.1.push(channel);
    }

    fn len(&self) -> usize {
        0
    }
}

#[test]
fn what_nobody_wants_is_not_encoded() {
    let settings = Settings {
        rejected: true,
        ..Settings::default()
    };
    let mut encoder = synthetic::encoder(&rig(), &settings);
    let channels: Vec<String> = encoder.channels().iter().map(|c| c.name.clone()).collect();
    let is_rejected = |channel: usize| channels[channel].ends_with("/rejected");
    let mut without = Picky(|channel| !is_rejected(channel), Vec::new());
    encoder.encode(&scan(0).messages(), &mut without);
    assert!(without.1.len() > 20 && !without.1.iter().any(|&channel| is_rejected(channel)));
    let mut only = Picky(is_rejected, Vec::new());
    encoder.encode(&scan(0).messages(), &mut only);
    assert_eq!(only.1.len(), 3);
}

#[test]
fn every_message_carries_its_scans_time_and_number() {
    let (_folder, path) = folder();
    record(&path, &Settings::default(), 0..3);
    let bytes = fs::read(&path).unwrap();
    let messages: Vec<_> = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(|message| message.unwrap())
        .collect();
    assert!(!messages.is_empty());
    for message in &messages {
        let time = START + u64::from(message.sequence) * STEP;
        assert_eq!((message.log_time, message.publish_time), (time, time));
    }
    // In order, so that a viewer that seeks sees one whole scan.
    assert!(messages.is_sorted_by_key(|message| message.log_time));
}

// ---- existing files ----

#[test]
fn an_existing_recording_is_not_overwritten_unless_told() {
    let (folder, path) = folder();
    let settings = Settings {
        max_seconds: Some(0.1),
        ..Settings::default()
    };
    record(&path, &settings, 0..9);
    assert!(part_path(&path, 2).exists());
    let encoder = synthetic::encoder(&rig(), &settings);
    let create = |overwrite, path: &Path| {
        Writer::create(path, overwrite, &metadata(&rig()), &encoder, &settings)
    };
    let before = fs::read(&path).unwrap();
    let error = create(false, &path).unwrap_err();
    assert!(
        matches!(&error, WriteError::Exists(p) if *p == path),
        "{error}"
    );
    assert!(error.to_string().contains("--force"));
    assert!(fs::read(&path).unwrap() == before);
    // Parts of an old recording would be taken for the new one's.
    fs::remove_file(&path).unwrap();
    assert!(matches!(
        create(false, &path).unwrap_err(),
        WriteError::Exists(_)
    ));
    fs::write(&path, before).unwrap();
    create(true, &path).unwrap().finish(None).unwrap();
    assert!(!part_path(&path, 1).exists() && !part_path(&path, 2).exists());

    let stranger = part_path(&path, 1);
    fs::write(&stranger, "mine").unwrap();
    assert!(matches!(
        create(true, &path).unwrap_err(),
        WriteError::NotAPart(_)
    ));
    assert_eq!(fs::read(&stranger).unwrap(), b"mine");
    assert!(matches!(
        create(true, folder.path()).unwrap_err(),
        WriteError::NotAFile(_)
    ));
    let nowhere = folder.path().join("no/where.mcap");
    let error = create(false, &nowhere).unwrap_err().to_string();
    assert!(error.contains("there is no folder"), "{error}");
}

#[test]
fn a_recording_that_is_being_written_is_left_alone() {
    let (_folder, path) = folder();
    let (mut writer, mut encoder) = create(&path, &Settings::default());
    writer.write(&encode(&mut encoder, 0)).unwrap();
    let other = Writer::create(
        &path,
        true,
        &metadata(&rig()),
        &encoder,
        &Settings::default(),
    );
    assert!(matches!(other.unwrap_err(), WriteError::Busy(_)));
    assert!(
        seal(&path)
            .unwrap_err()
            .to_string()
            .contains("still being written")
    );
    // What is flushed can be read meanwhile.
    assert_holds(&mut Recording::open(&path).unwrap(), 0..1);
    writer.finish(None).unwrap();
    assert_holds(&mut Recording::open(&path).unwrap(), 0..1);
}

// ---- parts ----

#[test]
fn a_clock_that_is_set_back_begins_a_new_part() {
    let (_folder, path) = folder();
    let settings = Settings {
        max_seconds: Some(60.0),
        ..Settings::default()
    };
    let (mut writer, mut encoder) = create(&path, &settings);
    for sequence in 0..6 {
        let set_back = if sequence < 3 { 0 } else { 3_600_000_000_000 };
        let nanos = START + sequence * STEP - set_back;
        let scan = Scan::taken_at(&rig(), nanos, sequence, 6);
        writer
            .write(&synthetic::batch(&mut encoder, &scan))
            .unwrap();
    }
    let written = writer.finish(Some(&ledger(6))).unwrap();
    assert_eq!((written.scans, written.parts.len()), (6, 2));
    let recording = Recording::open(&path).unwrap();
    assert!(recording.is_complete());
    assert_eq!(recording.scans().count(), 6);
}

#[test]
fn a_recording_is_split_by_time_and_by_size_and_read_as_one() {
    let by_time = Settings {
        max_seconds: Some(0.1),
        ..Settings::default()
    };
    let by_size = Settings {
        max_bytes: Some(1_000_000),
        compression: Some(Compression::None),
        ..Settings::default()
    };
    for (settings, scans) in [(by_time, 9), (by_size, 12)] {
        let (_folder, path) = folder();
        let written = record(&path, &settings, 0..scans);
        assert!(written.parts.len() >= 2, "{written:?}");
        assert_eq!(written.scans, scans);
        let sum: u64 = written
            .parts
            .iter()
            .map(|p| fs::metadata(p).unwrap().len())
            .sum();
        assert_eq!(written.bytes, sum);
        let mut recording = Recording::open(&path).unwrap();
        assert!(recording.is_complete());
        assert_holds(&mut recording, 0..scans);
        assert_eq!(recording.ledger(), Some(ledger(scans)));
        let info = Info::of(&recording);
        assert_eq!(
            (info.scans.whole, info.parts.len()),
            (scans as usize, written.parts.len())
        );
        // Each part says for itself where the cameras stand.
        for part in &written.parts {
            let alone = fs::read(part).unwrap();
            let mut topics = mcap::MessageStream::new(&alone)
                .unwrap()
                .map(|m| m.unwrap().channel.topic.clone());
            assert!(topics.any(|topic| topic == "tf"));
        }
    }
}

#[test]
fn a_killed_recorder_goes_on_in_the_next_part_and_duplicates_count_once() {
    let (_folder, path) = folder();
    let settings = Settings::default();
    let (mut writer, mut encoder) = create(&path, &settings);
    for sequence in 0..4 {
        writer.write(&encode(&mut encoder, sequence)).unwrap();
    }
    die(writer, &path, 0);

    // The scans in flight are sent again, and some of them were flushed already.
    let (mut writer, sealed) =
        Writer::resume(&path, &metadata(&rig()), &encoder, &settings).unwrap();
    assert_eq!((sealed.len(), sealed[0].was_finished), (1, false));
    for sequence in 2..7 {
        writer.write(&encode(&mut encoder, sequence)).unwrap();
    }
    let written = writer.finish(Some(&ledger(7))).unwrap();
    assert_eq!(written.parts, [path.clone(), part_path(&path, 1)]);
    let mut recording = Recording::open(&path).unwrap();
    assert!(recording.is_complete(), "{:?}", recording.notes());
    assert!(recording.scans().eq(0..7));
    assert_holds(&mut recording, 0..7);
    let info = Info::of(&recording);
    assert!(
        info.topics
            .iter()
            .filter(|t| !["log", "ledger", "health"].contains(&t.topic.as_str()))
            .all(|t| t.count == 7)
    );

    // A part alone says that it is one.
    let part = Recording::open(&part_path(&path, 1)).unwrap();
    assert!(part.notes()[0].contains("part 1"), "{:?}", part.notes());
}

/// Ends a writer as kill -9 does: nothing more reaches the file, `torn` bytes of what was next are there.
fn die(writer: Writer, path: &Path, torn: usize) {
    let mut whole = fs::read(path).unwrap();
    drop(writer);
    whole.extend(std::iter::repeat_n(6, torn));
    fs::write(path, whole).unwrap();
}

#[test]
fn a_recorder_killed_before_its_first_scan_begins_again() {
    for len in [0, 5, 60] {
        let (_folder, path) = folder();
        let (writer, mut encoder) = create(&path, &Settings::default());
        let begun = fs::read(&path).unwrap();
        drop(writer);
        fs::write(&path, &begun[..len]).unwrap();
        let error = Recording::open(&path).unwrap_err();
        assert!(matches!(error, ReadError::Empty(_)), "{len}: {error}");
        let resumed = Writer::resume(&path, &metadata(&rig()), &encoder, &Settings::default());
        let (mut writer, _) = resumed.unwrap();
        writer.write(&encode(&mut encoder, 0)).unwrap();
        writer.finish(None).unwrap();
        assert_holds(&mut Recording::open(&path).unwrap(), 0..1);
        assert!(!part_path(&path, 1).exists());
    }
}

#[test]
fn another_recordings_part_is_left_out_and_said() {
    let (_folder, path) = folder();
    record(&path, &Settings::default(), 0..2);
    let (_other_folder, other) = folder();
    let settings = Settings {
        max_seconds: Some(0.1),
        ..Settings::default()
    };
    record(&other, &settings, 0..9);
    fs::copy(part_path(&other, 1), part_path(&path, 1)).unwrap();
    let recording = Recording::open(&path).unwrap();
    assert!(recording.scans().eq(0..2));
    assert!(recording.notes()[0].contains("belongs to another recording"));
    assert!(!recording.is_complete());
    let resumed = Writer::resume(
        &path,
        &metadata(&rig()),
        &synthetic::encoder(&rig(), &settings),
        &settings,
    );
    assert!(matches!(resumed.unwrap_err(), WriteError::NotAPart(_)));
}

fn folder_of(path: &Path) -> Vec<String> {
    let names = fs::read_dir(path)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.collect();
    names.sort();
    names
}

// ---- torn files ----

/// A file that three scans were flushed to, and where each flush ended.
fn unfinished(settings: &Settings) -> (Vec<u8>, Vec<usize>) {
    let (_folder, path) = folder();
    let (mut writer, mut encoder) = create(&path, settings);
    let mut ends = vec![fs::metadata(&path).unwrap().len() as usize];
    for sequence in 0..3 {
        writer.write(&encode(&mut encoder, sequence)).unwrap();
        ends.push(fs::metadata(&path).unwrap().len() as usize);
    }
    let bytes = fs::read(&path).unwrap();
    drop(writer);
    (bytes, ends)
}

#[test]
fn cut_anywhere_every_scan_that_was_flushed_is_read_and_survives_sealing() {
    for (compression, chunk_bytes) in [
        (Compression::Lz4, 1 << 20),
        (Compression::None, 65_536),
        (Compression::Zstd, 65_536),
    ] {
        let settings = Settings {
            compression: Some(compression),
            chunk_bytes,
            ..Settings::default()
        };
        let (bytes, ends) = unfinished(&settings);
        // Everywhere near the flushes, and here and there between.
        let near = ends.iter().flat_map(|&end| {
            (end.saturating_sub(40)..end + 40)
                .step_by(7)
                .chain([end - 1, end, end + 1, end + 9])
        });
        let between = (ends[0]..bytes.len()).step_by(bytes.len() / 40);
        for cut in near
            .chain(between)
            .filter(|cut| (ends[0]..=bytes.len()).contains(cut))
        {
            let whole = ends[1..].iter().filter(|end| **end <= cut).count() as u64;
            let (_folder, path) = folder();
            fs::write(&path, &bytes[..cut]).unwrap();
            let mut torn = Recording::open(&path).unwrap();
            assert!(!torn.is_complete());
            assert_holds(&mut torn, 0..whole);
            let scans: Vec<u64> = torn.scans().collect();
            let whole_scans = torn.whole_scans();
            assert!(whole_scans.len() as u64 >= whole, "{cut}");

            let sealed = seal(&path).unwrap();
            assert_eq!(sealed.kept_bytes + sealed.cut_bytes, cut as u64);
            let mut recording = Recording::open(&path).unwrap();
            assert!(recording.is_complete(), "{cut}: {:?}", recording.notes());
            assert_holds(&mut recording, 0..whole);
            assert!(recording.scans().eq(scans), "{cut}");
            assert_eq!(recording.whole_scans(), whole_scans, "{cut}");
            assert!(seal(&path).unwrap().was_finished);
            foreign_reader_accepts(&path, sealed.messages);
        }
    }
}

/// The plain mcap crate reads the file's index, and with it as many messages as it says, checking every sum.
fn foreign_reader_accepts(path: &Path, messages: u64) {
    let bytes = fs::read(path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let stats = summary.stats.as_ref().unwrap();
    assert_eq!(stats.message_count, messages);
    assert_eq!(
        mcap::MessageStream::new(&bytes)
            .unwrap()
            .inspect(|m| assert!(m.is_ok()))
            .count() as u64,
        messages
    );
    let mut indexed = 0;
    for chunk in &summary.chunk_indexes {
        #[expect(clippy::iter_over_hash_type, reason = "the order does not matter")]
        for (channel, entries) in summary.read_message_indexes(&bytes, chunk).unwrap() {
            for entry in entries {
                let message = summary.seek_message(&bytes, chunk, &entry).unwrap();
                assert_eq!(message.channel.id, channel.id);
                assert_eq!(message.log_time, entry.log_time);
                indexed += 1;
            }
        }
    }
    assert_eq!(indexed, messages);
    for index in &summary.metadata_indexes {
        assert_eq!(
            mcap::read::metadata(&bytes, index).unwrap().name,
            index.name
        );
    }
}

#[test]
fn a_file_cut_while_it_was_finished_is_sealed() {
    let (_folder, path) = folder();
    record(&path, &Settings::default(), 0..3);
    let bytes = fs::read(&path).unwrap();
    let unfinished = unfinished(&Settings::default()).0.len();
    for cut in (unfinished..bytes.len())
        .step_by(97)
        .chain([bytes.len() - 1])
    {
        fs::write(&path, &bytes[..cut]).unwrap();
        assert_holds(&mut Recording::open(&path).unwrap(), 0..3);
        let sealed = seal(&path).unwrap();
        assert_holds(&mut Recording::open(&path).unwrap(), 0..3);
        foreign_reader_accepts(&path, sealed.messages);
    }
}

#[test]
fn a_tail_of_zeros_or_noise_is_cut() {
    let (bytes, _) = unfinished(&Settings::default());
    for tail in [
        vec![0; 5000],
        vec![6; 5000],
        vec![255; 10],
        b"\x06\xff\0\0\0\0\0\0\0".repeat(40),
    ] {
        let (_folder, path) = folder();
        fs::write(&path, [&*bytes, &*tail].concat()).unwrap();
        assert_holds(&mut Recording::open(&path).unwrap(), 0..3);
        let sealed = seal(&path).unwrap();
        assert!(sealed.cut_bytes > 0);
        assert_holds(&mut Recording::open(&path).unwrap(), 0..3);
        foreign_reader_accepts(&path, sealed.messages);
    }
}

#[test]
fn a_last_chunk_whose_bytes_never_reached_the_disk_is_cut() {
    let settings = Settings::default();
    let (mut bytes, ends) = unfinished(&settings);
    // As after a power failure: the length is there, the bytes are not.
    let middle = (ends[2] + ends[3]) / 2;
    bytes[middle..].fill(0);
    let (_folder, path) = folder();
    fs::write(&path, bytes).unwrap();
    assert_holds(&mut Recording::open(&path).unwrap(), 0..2);
    let sealed = seal(&path).unwrap();
    foreign_reader_accepts(&path, sealed.messages);
    assert_holds(&mut Recording::open(&path).unwrap(), 0..2);
}

#[test]
fn damaged_files_are_told_and_never_panic() {
    let (_folder, path) = folder();
    record(
        &path,
        &Settings {
            compression: Some(Compression::None),
            ..Settings::default()
        },
        0..2,
    );
    let good = fs::read(&path).unwrap();
    let mut state = 7u64;
    let mut random = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 33) as usize
    };
    for round in 0..300 {
        let mut bad = good.clone();
        // The beginning and the end hold what everything else hangs on.
        let at = match round % 3 {
            0 => random() % 2000,
            1 => bad.len() - 1 - random() % 4000,
            _ => random() % bad.len(),
        };
        bad[at] ^= 1 << (random() % 8);
        if round % 5 == 0 {
            bad.truncate(random() % bad.len());
        }
        fs::write(&path, &bad).unwrap();
        if let Ok(mut recording) = Recording::open(&path) {
            let info = Info::of(&recording);
            assert!(!info.to_string().is_empty());
            for sequence in recording.scans().collect::<Vec<_>>() {
                drop(recording.scan(sequence));
            }
        }
        drop(seal(&path));
    }
}

// ---- bad input ----

#[test]
fn what_is_not_a_recording_is_told_in_words() {
    let (folder, path) = folder();
    let error = |path: &Path| Recording::open(path).unwrap_err().to_string();
    assert!(error(&path).contains("cannot read"), "{}", error(&path));
    assert!(
        error(folder.path()).contains("directory"),
        "{}",
        error(folder.path())
    );
    fs::write(&path, b"").unwrap();
    assert!(error(&path).contains("is empty"), "{}", error(&path));
    fs::write(&path, b"P5 12 12 255 ............").unwrap();
    assert!(
        error(&path).contains("is not an MCAP file"),
        "{}",
        error(&path)
    );

    let mut foreign = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    let schema = foreign.add_schema("a.Twist", "jsonschema", b"{}").unwrap();
    let channel = foreign
        .add_channel(schema, "/cmd_vel", "json", &Default::default())
        .unwrap();
    let header = mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    foreign.write_to_known_channel(&header, b"{}").unwrap();
    foreign.finish().unwrap();
    drop(foreign);
    let told = error(&path);
    assert!(
        told.contains("another program") && told.contains("/cmd_vel"),
        "{told}"
    );
}

// ---- info ----

#[test]
fn info_tells_what_there_is() {
    let (_folder, path) = folder();
    let (mut writer, mut encoder) = create(&path, &Settings::default());
    for sequence in [0, 1, 2, 4] {
        writer.write(&encode(&mut encoder, sequence)).unwrap();
    }
    let mut unbalanced = ledger(4);
    let account = Account {
        received: Some(3),
        missing: vec![3],
        ..Account::default()
    };
    unbalanced
        .nodes
        .entry("record".into())
        .or_default()
        .insert("points".into(), account);
    writer.finish(Some(&unbalanced)).unwrap();

    let info = Info::of(&Recording::open(&path).unwrap());
    assert!(info.complete && info.calibrated);
    assert_eq!(
        (info.scans.total, info.scans.whole, &*info.scans.missing),
        (4, 4, &[3][..])
    );
    assert_eq!(
        (info.balanced, info.start_nanos),
        (Some(false), Some(START))
    );
    assert!((info.duration_seconds - 4.0 * STEP as f64 / 1e9).abs() < 1e-9);
    let points = info.topics.iter().find(|t| t.topic == "points").unwrap();
    assert_eq!((&*points.schema, points.count), ("foxglove.PointCloud", 4));
    assert!((points.rate_hz - 3.0 / info.duration_seconds).abs() < 1e-9);
    let text = info.to_string();
    for part in [
        "complete",
        "4 of 4 whole; missing: 3",
        "2023-11-14",
        "NOT BALANCED",
        "tricurve.Curves",
        "channels",
    ] {
        assert!(text.contains(part), "{part}:\n{text}");
    }
    let json: serde_json::Value = serde_json::to_value(&info).unwrap();
    assert_eq!(json["scans"]["missing"][0], 3);
    assert_eq!(json["configuration"]["filter"]["channels"][0], 8.0);
}

// ---- the writer's thread ----

#[test]
fn the_thread_reports_every_scan_and_gives_its_batch_back() {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    let (_folder, path) = folder();
    let (writer, mut encoder) = create(&path, &Settings::default());
    let notified = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&notified);
    let thread = spawn(writer, move || {
        count.fetch_add(1, Ordering::SeqCst);
    })
    .unwrap();
    let mut batch = Batch::default();
    for sequence in 0..5 {
        encoder.encode(&scan(sequence).messages(), &mut batch);
        thread.write(std::mem::take(&mut batch));
        let report = thread.reports().recv().unwrap();
        assert_eq!(report.sequence, sequence);
        assert!(report.result.unwrap() > 0);
        batch = report.batch;
    }
    let written = thread.finish(Some(&ledger(5))).unwrap();
    assert_eq!((written.scans, notified.load(Ordering::SeqCst)), (5, 5));
    assert_holds(&mut Recording::open(&path).unwrap(), 0..5);
}

#[test]
fn encoding_again_and_again_takes_no_more_memory() {
    let mut encoder = synthetic::encoder(&rig(), &Settings::default());
    let mut batch = encode(&mut encoder, 0);
    let first = batch.len();
    encoder.encode(&scan(0).messages(), &mut batch);
    assert_eq!(batch.len(), first);
    encoder.encode(&[], &mut batch);
    assert!(batch.is_empty());
}

#[test]
fn nothing_but_the_recording_is_left_in_the_folder() {
    let (folder, path) = folder();
    record(&path, &Settings::default(), 0..2);
    assert_eq!(folder_of(folder.path()), ["discs.mcap"]);
}
