//! Bags: what is read from them, how it is put together, and what is said where something is amiss.
#![expect(clippy::unwrap_used, reason = "tests")]

mod bag;
mod texture;

use std::fs;
use std::path::{Path, PathBuf};

use bag::{
    Camera, Cdr, Pixels, Written, camera_info, compressed, image, joints, mcap, mcap_with,
    metadata, number, odometry, packed, pose, transforms, written,
};
use capture::{Mode, Settings, Source, SourceError, Views};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use mcap::{Compression, WriteOptions};
use messages::{Image, Owned, Size};
use tempfile::TempDir;
use texture::wave;

const START: u64 = 1_700_000_000_000_000_000;
const MS: u64 = 1_000_000;
const SIZE: (u32, u32) = (48, 36);
const SIDES: [&str; 3] = ["left", "centre", "right"];

/// What a view shows in a scan.
fn gray(scan: u64, view: usize) -> Vec<u8> {
    let pixels = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y)));
    let level = |(x, y): (u32, u32)| (x * 5 + y * 3 + scan as u32 * 17 + view as u32 * 31) as u8;
    pixels.map(level).collect()
}

/// An image of a view, 2 ms later than the view before.
fn shot(topic: &str, scan: u64, view: usize) -> Written {
    let nanos = START + scan * 100 * MS + view as u64 * 2 * MS;
    let pixels = Pixels {
        encoding: "mono8",
        size: SIZE,
        step: SIZE.0,
        is_big: false,
        data: &gray(scan, view),
    };
    image(topic, nanos, pixels)
}

fn topic(view: usize) -> String {
    format!("/{}/image_rect", SIDES[view])
}

/// Three cameras of so many scans.
fn rig(scans: u64) -> Vec<Written> {
    let scans = (0..scans).flat_map(|scan| (0..3).map(move |view| shot(&topic(view), scan, view)));
    scans.collect()
}

/// A folder that is gone after the test.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A bag in one MCAP file.
    fn of(all: &[Written]) -> Self {
        let folder = Self::new();
        mcap(&folder.file("bag.mcap"), all);
        folder
    }

    fn settings(&self) -> Settings {
        settings(&self.file("bag.mcap"))
    }

    fn open(&self) -> Result<Source, SourceError> {
        Source::open(&self.settings())
    }

    fn refusal(&self, settings: &Settings) -> String {
        let error = Source::open(settings).unwrap_err().to_string();
        error.replace(self.0.path().to_str().unwrap(), "~")
    }
}

fn settings(path: &Path) -> Settings {
    Settings {
        source: format!("bag:{}", path.display()),
        ..Settings::default()
    }
}

fn read(source: &mut Source, scan: u64, view: usize) -> Vec<u8> {
    let mut out = Owned::<Image>::new(source.size());
    out.fill(|room| source.read(scan, view, room)).unwrap();
    out.view().pixels.to_vec()
}

/// Every scan shows what was recorded, in any order.
fn assert_shows(source: &mut Source, scans: u64) {
    assert_eq!(source.scans(), scans);
    assert_eq!(source.size(), Size::new(SIZE.0, SIZE.1));
    for scan in (0..scans).rev().chain(0..scans) {
        for view in 0..3 {
            assert_eq!(
                read(source, scan, view),
                gray(scan, view),
                "scan {scan}, view {view}"
            );
        }
    }
}

fn said(source: &Source) -> String {
    [source.notices(), source.warnings()].concat().join("\n")
}

/// Writes a database as rosbag2 does.
fn db3(path: &Path, all: &[Written]) {
    let database = rusqlite::Connection::open(path).unwrap();
    database
        .execute_batch(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, \
             serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
             CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, \
             timestamp INTEGER NOT NULL, data BLOB NOT NULL);
             CREATE INDEX timestamp_idx ON messages (timestamp ASC);",
        )
        .unwrap();
    let mut topics = Vec::new();
    for one in all {
        let known = topics.iter().position(|known| *known == one.topic);
        let topic = known.unwrap_or_else(|| {
            topics.push(one.topic.clone());
            let row = (topics.len() as i64, &one.topic, one.schema, one.coding, "");
            let insert = "INSERT INTO topics VALUES (?1, ?2, ?3, ?4, ?5)";
            database.execute(insert, row).unwrap();
            topics.len() - 1
        });
        let insert = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
        let row = (topic as i64 + 1, one.log as i64, &one.bytes);
        database.execute(insert, row).unwrap();
    }
}

#[test]
fn every_container_gives_the_same_scans() {
    let all = rig(4);
    let folder = Folder::new();
    let options: [(&str, WriteOptions); 6] = [
        ("plain.mcap", WriteOptions::new().compression(None)),
        ("zstd.mcap", packed(Compression::Zstd)),
        ("lz4.mcap", packed(Compression::Lz4).chunk_size(Some(3000))),
        ("chunkless.mcap", WriteOptions::new().use_chunks(false)),
        (
            "unindexed.mcap",
            packed(Compression::Zstd)
                .chunk_size(Some(4000))
                .emit_message_indexes(false)
                .emit_chunk_indexes(false),
        ),
        (
            "without_summary.mcap",
            WriteOptions::new()
                .compression(None)
                .emit_summary_records(false),
        ),
    ];
    for (name, options) in options {
        let path = folder.file(name);
        mcap_with(&path, &all, options);
        let mut source = Source::open(&settings(&path)).unwrap();
        assert_eq!(source.damage(), None, "{name}");
        assert_shows(&mut source, 4);
    }
    db3(&folder.file("bag.db3"), &all);
    // The plain path of a bag is one too.
    let mut source = Source::open(&Settings {
        source: folder.file("bag.db3").display().to_string(),
        ..Settings::default()
    })
    .unwrap();
    assert_eq!(source.damage(), None);
    assert_shows(&mut source, 4);
}

#[test]
fn a_folder_of_several_files_is_one_bag_whatever_its_metadata_calls_them() {
    let all = rig(4);
    for (storage, write) in [("mcap", mcap as fn(&Path, &[Written])), ("sqlite3", db3)] {
        let ending = if storage == "mcap" { "mcap" } else { "db3" };
        for prefix in ["", "some_bag/"] {
            let folder = Folder::new();
            let names = [0, 1].map(|part| format!("bag_{part}.{ending}"));
            write(&folder.file(&names[0]), &all[..5]);
            write(&folder.file(&names[1]), &all[5..]);
            let told = names.map(|name| format!("{prefix}{name}"));
            metadata(folder.0.path(), &[&told[0], &told[1]], storage, &all);
            let mut source = Source::open(&Settings {
                source: folder.0.path().display().to_string(),
                ..Settings::default()
            })
            .unwrap();
            assert_eq!(source.damage(), None);
            assert_shows(&mut source, 4);
        }
    }
}

#[test]
fn messages_that_were_packed_one_by_one_are_unpacked() {
    let mut all = rig(3);
    for one in &mut all {
        one.bytes = zstd::stream::encode_all(&one.bytes[..], 3).unwrap();
    }
    let folder = Folder::of(&all);
    db3(&folder.file("bag.db3"), &all);
    assert_shows(&mut folder.open().unwrap(), 3);
    let mut source = Source::open(&settings(&folder.file("bag.db3"))).unwrap();
    assert_shows(&mut source, 3);
}

#[test]
fn times_are_those_of_the_stamps_and_go_on_when_a_bag_begins_again() {
    let folder = Folder::of(&rig(3));
    let source = folder.open().unwrap();
    // The centre camera's.
    assert_eq!(source.start(), Some(START + 2 * MS));
    let after: Vec<u64> = (0..5)
        .map(|scan| source.nanos_after_start(scan).unwrap() / MS)
        .collect();
    assert_eq!(after, [0, 100, 200, 300, 400]);
}

#[test]
fn frames_that_belong_to_no_scan_are_counted_by_cause() {
    let mut all = rig(10);
    // The right camera misses scan 2, and the centre one comes far too late in scan 5.
    all.retain(|one| one.bytes != shot(&topic(2), 2, 2).bytes);
    for one in &mut all {
        if one.bytes == shot(&topic(1), 5, 1).bytes {
            *one = image(
                &topic(1),
                START + 550 * MS,
                Pixels {
                    encoding: "mono8",
                    size: SIZE,
                    step: SIZE.0,
                    is_big: false,
                    data: &gray(5, 1),
                },
            );
        }
    }
    // One of another size, and one that holds less than it says.
    let odd = Pixels {
        encoding: "mono8",
        size: (64, 36),
        step: 64,
        is_big: false,
        data: &[0; 64 * 36],
    };
    all.push(image(&topic(0), START + 2_000 * MS, odd));
    all.push(image(
        &topic(0),
        START + 2_100 * MS,
        Pixels {
            data: &[0; 9],
            ..odd
        },
    ));
    let folder = Folder::of(&all);
    let source = folder.open().unwrap();
    assert_eq!(source.scans(), 8);
    let account = source.account().unwrap();
    assert!(account.cameras.iter().all(|camera| camera.is_balanced()));
    let [left, centre, right] = &account.cameras[..] else {
        panic!("{account}");
    };
    assert_eq!((left.received, left.matched, left.dropped()), (12, 8, 4));
    assert_eq!((centre.received, centre.matched), (10, 8));
    assert_eq!((right.received, right.matched), (9, 8));
    assert_eq!(left.dropped["it cannot be read"], 1);
    assert_eq!(left.dropped["it had another size than at the start"], 1);
    let said = said(&source);
    assert!(
        said.contains("8 scans are complete, and images are in none: 4 of 12 of left"),
        "{said}"
    );
    assert!(
        said.contains(
            "the bag is damaged, 30 messages of it can be read: 1 of 12 images on /left/image_rect cannot be used"
        ),
        "{said}"
    );
}

#[test]
fn an_offset_beyond_the_tolerance_is_explained_and_can_be_allowed() {
    let all: Vec<Written> = (0..10)
        .flat_map(|scan| {
            [0, 0, 30]
                .into_iter()
                .enumerate()
                .map(move |(view, offset)| {
                    image(
                        &topic(view),
                        START + (scan * 100 + offset) * MS,
                        Pixels {
                            encoding: "mono8",
                            size: SIZE,
                            step: SIZE.0,
                            is_big: false,
                            data: &gray(scan, view),
                        },
                    )
                })
        })
        .collect();
    let folder = Folder::of(&all);
    let refusal = folder.refusal(&folder.settings());
    assert!(
        refusal.starts_with(
            "the bag ~/bag.mcap: no scan is complete: right's frames come 30.0 ms after centre's"
        ),
        "{refusal}"
    );
    let wide = Settings {
        tolerance: 40.0,
        ..folder.settings()
    };
    assert_shows(&mut Source::open(&wide).unwrap(), 10);
}

#[test]
fn images_without_stamps_go_by_when_they_were_recorded() {
    let mut all = Vec::new();
    for (number, mut one) in rig(3).into_iter().enumerate() {
        let (scan, view) = (number as u64 / 3, number % 3);
        one.bytes = image(
            &one.topic,
            0,
            Pixels {
                encoding: "mono8",
                size: SIZE,
                step: SIZE.0,
                is_big: false,
                data: &gray(scan, view),
            },
        )
        .bytes;
        all.push(one);
    }
    let folder = Folder::of(&all);
    let mut source = folder.open().unwrap();
    assert!(
        said(&source).contains("images carry no stamps"),
        "{}",
        said(&source)
    );
    assert_eq!(source.start(), Some(START + 5 * MS));
    assert_shows(&mut source, 3);
}

#[test]
fn stamps_of_a_clock_that_counts_from_its_start_never_become_1970() {
    let early = |scan: u64, view: usize| {
        let mut one = image(
            &topic(view),
            653_560 * MS + scan * 33 * MS,
            Pixels {
                encoding: "mono8",
                size: SIZE,
                step: SIZE.0,
                is_big: false,
                data: &gray(scan, view),
            },
        );
        one.log = START + scan * 33 * MS;
        one
    };
    let all: Vec<Written> = (0..3)
        .flat_map(|scan| (0..3).map(move |view| early(scan, view)))
        .collect();
    let source = Folder::of(&all).open().unwrap();
    assert_eq!(source.start(), Some(START));
    assert!(
        said(&source).contains("a clock that was 653.560 s old"),
        "{}",
        said(&source)
    );
}

#[test]
fn compressed_images_are_decoded() {
    let scan = |encode: &dyn Fn(&[u8]) -> Vec<u8>| -> Vec<Written> {
        let one = |view| {
            let topic = format!("/cam{view}/image_raw/compressed");
            compressed(&topic, START, &encode(&gray(0, view)))
        };
        (0..3).map(one).collect()
    };
    let png = |levels: &[u8]| {
        let mut out = Vec::new();
        let encoder = PngEncoder::new(&mut out);
        encoder
            .write_image(levels, SIZE.0, SIZE.1, ExtendedColorType::L8)
            .unwrap();
        out
    };
    let jpeg = |levels: &[u8]| {
        let mut out = Vec::new();
        let encoder = JpegEncoder::new_with_quality(&mut out, 100);
        encoder
            .write_image(levels, SIZE.0, SIZE.1, ExtendedColorType::L8)
            .unwrap();
        out
    };
    assert_shows(&mut Folder::of(&scan(&png)).open().unwrap(), 1);
    let mut source = Folder::of(&scan(&jpeg)).open().unwrap();
    for view in 0..3 {
        let expected = image::load_from_memory(&jpeg(&gray(0, view))).unwrap();
        assert_eq!(read(&mut source, 0, view), expected.into_luma8().into_raw());
    }
    // One that breaks off is not filled in with gray.
    let torn = |levels: &[u8]| {
        let whole = jpeg(levels);
        whole[..whole.len() * 2 / 3].to_vec()
    };
    let folder = Folder::of(&scan(&torn));
    let refusal = folder.refusal(&folder.settings());
    assert!(refusal.contains("it ends before its last row"), "{refusal}");
}

#[test]
fn deep_images_are_scaled_by_the_bits_in_use_in_all_views() {
    for (most, bits) in [(1023u32, 10), (4095, 12), (16_383, 14), (65_535, 16)] {
        let deep = |scan: u64, view: usize| {
            let value = |level: &u8| (u32::from(*level) * most / 255) as u16;
            let data: Vec<u8> = gray(scan, view)
                .iter()
                .map(value)
                .flat_map(u16::to_be_bytes)
                .collect();
            image(
                &topic(view),
                START + scan * 100 * MS,
                Pixels {
                    encoding: "mono16",
                    size: SIZE,
                    step: SIZE.0 * 2,
                    is_big: true,
                    data: &data,
                },
            )
        };
        let all: Vec<Written> = (0..3)
            .flat_map(|scan| (0..3).map(move |view| (scan, view)))
            .map(|(scan, view)| deep(scan, view))
            .collect();
        let mut source = Folder::of(&all).open().unwrap();
        assert!(
            said(&source).contains(&format!("{bits} bits of 16-bit images are in use")),
            "{}",
            said(&source)
        );
        assert_shows(&mut source, 3);
    }
}

/// A minimal writer of protobuf.
fn field(number: u64, bytes: &[u8]) -> Vec<u8> {
    let mut out = varint(number << 3 | 2);
    out.extend(varint(bytes.len() as u64));
    out.extend(bytes);
    out
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut out = Vec::new();
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
    out
}

fn fixed(number: u64, value: u32) -> Vec<u8> {
    [varint(number << 3 | 5), value.to_le_bytes().to_vec()].concat()
}

fn protobuf_image(view: usize) -> Vec<u8> {
    let time = [varint(1 << 3), varint(START / 1_000_000_000)].concat();
    [
        field(1, &time),
        fixed(2, SIZE.0),
        fixed(3, SIZE.1),
        field(4, b"mono8"),
        fixed(5, SIZE.0),
        field(6, &gray(0, view)),
        field(7, SIDES[view].as_bytes()),
    ]
    .concat()
}

fn protobuf_calibration(view: usize) -> Vec<u8> {
    let doubles = |number, values: &[f64]| {
        let bytes: Vec<u8> = values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        field(number, &bytes)
    };
    let shift = -70.0 * view as f64;
    [
        fixed(2, SIZE.0),
        fixed(3, SIZE.1),
        doubles(6, &[700., 0., 24., 0., 700., 18., 0., 0., 1.]),
        doubles(7, &[1., 0., 0., 0., 1., 0., 0., 0., 1.]),
        doubles(
            8,
            &[700., 0., 24., shift, 0., 700., 18., 0., 0., 0., 1., 0.],
        ),
        field(9, SIDES[view].as_bytes()),
    ]
    .concat()
}

#[test]
fn foxglove_images_and_calibrations_are_read_from_protobuf_and_json() {
    use base64::Engine as _;
    let of = |view: usize, name: &str, schema, coding, bytes| Written {
        topic: format!("/{}/{name}", SIDES[view]),
        schema,
        coding,
        log: START,
        bytes,
    };
    let protobuf = (0..3).flat_map(|view| {
        let (image, calibration) = (protobuf_image(view), protobuf_calibration(view));
        [
            of(view, "image", "foxglove.RawImage", "protobuf", image),
            of(
                view,
                "calibration",
                "foxglove.CameraCalibration",
                "protobuf",
                calibration,
            ),
        ]
    });
    let json = (0..3).flat_map(|view| {
        let data = base64::prelude::BASE64_STANDARD.encode(gray(0, view));
        let image = format!(
            r#"{{"timestamp":{{"sec":1700000000,"nsec":5}},"frame_id":"c","width":48,"height":36,"encoding":"mono8","step":48,"data":"{data}"}}"#
        );
        let calibration = format!(
            r#"{{"frame_id":"c","width":48,"height":36,"distortion_model":"","D":[],"K":[700,0,24,0,700,18,0,0,1],"R":[1,0,0,0,1,0,0,0,1],"P":[700,0,24,{},0,700,18,0,0,0,1,0]}}"#,
            -70.0 * view as f64
        );
        [
            of(view, "image", "foxglove.RawImage", "json", image.into_bytes()),
            of(view, "calibration", "foxglove.CameraCalibration", "json", calibration.into_bytes()),
        ]
    });
    for all in [protobuf.collect::<Vec<_>>(), json.collect()] {
        let mut source = Folder::of(&all).open().unwrap();
        assert_shows(&mut source, 1);
        let calibration = source.calibration().unwrap();
        assert!(calibration.calibrated);
        assert_eq!(
            (calibration.focal_px, calibration.cx, calibration.cy),
            (700.0, 24.0, 18.0)
        );
        assert!((calibration.baseline_m - 0.1).abs() < 1e-12);
    }
}

#[test]
fn images_of_ros_1_in_mcap_are_read() {
    let one = |view: usize| {
        let mut bytes = Vec::new();
        let text = |bytes: &mut Vec<u8>, text: &str| {
            bytes.extend((text.len() as u32).to_le_bytes());
            bytes.extend(text.as_bytes());
        };
        // A counter, seconds, nanoseconds.
        for number in [7, 1_700_000_000, 5] {
            bytes.extend(u32::to_le_bytes(number));
        }
        text(&mut bytes, "c");
        bytes.extend(SIZE.1.to_le_bytes());
        bytes.extend(SIZE.0.to_le_bytes());
        text(&mut bytes, "mono8");
        bytes.push(0);
        bytes.extend(SIZE.0.to_le_bytes());
        let data = gray(0, view);
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(data);
        Written {
            coding: "ros1",
            ..written(&topic(view), "sensor_msgs/Image", START, bytes)
        }
    };
    let all: Vec<Written> = (0..3).map(one).collect();
    assert_shows(&mut Folder::of(&all).open().unwrap(), 1);
}

fn with_infos(name: &str, camera: impl Fn(usize) -> (Vec<f64>, [f64; 4])) -> Vec<Written> {
    let mut all = Vec::new();
    for (view, side) in SIDES.into_iter().enumerate() {
        let (d, p) = camera(view);
        let camera = Camera {
            size: SIZE,
            k: [60.0, 24.0, 18.0],
            d: &d,
            p,
        };
        all.push(camera_info(
            &format!("/{}/camera_info", side),
            START,
            camera,
        ));
        all.push(shot(&format!("/{}/{name}", side), 0, view));
    }
    all
}

#[test]
fn camera_info_beside_rectified_images_is_the_calibration() {
    // What D says of the lens is of the images before.
    let all = with_infos("image_rect", |view| {
        (
            vec![-0.3, 0.1, 0.0, 0.0, 0.0],
            [55.0, 23.0, 17.0, -5.5 * view as f64],
        )
    });
    let mut source = Folder::of(&all).open().unwrap();
    let calibration = source.calibration().unwrap();
    assert_eq!(
        (calibration.focal_px, calibration.cx, calibration.cy),
        (55.0, 23.0, 17.0)
    );
    assert!((calibration.baseline_m - 0.1).abs() < 1e-12);
    assert!(calibration.calibrated);
    assert_eq!(read(&mut source, 0, 1), gray(0, 1));
}

#[test]
fn images_as_cameras_took_them_are_rectified_by_their_camera_info() {
    let all = with_infos("image_raw", |view| {
        (
            vec![-0.05, 0.0, 0.0, 0.0, 0.0],
            [55.0, 24.0, 18.0, -5.5 * view as f64],
        )
    });
    let folder = Folder::of(&all);
    let mut source = folder.open().unwrap();
    let calibration = source.calibration().unwrap();
    assert_eq!(calibration.focal_px, 55.0);
    assert!(
        said(&source).contains("rectified by /left/camera_info"),
        "{}",
        said(&source)
    );
    let rectified = read(&mut source, 0, 1);
    assert_ne!(rectified, gray(0, 1));
    // As files of the same numbers rectify them.
    let files = SIDES.map(|side| folder.file(&format!("{side}.yaml")));
    for (view, file) in files.iter().enumerate() {
        let text = format!(
            "image_width: 48\nimage_height: 36\ncamera_name: {view}\ndistortion_model: plumb_bob\ncamera_matrix: {{data: [60, 0, 24, 0, 60, 18, 0, 0, 1]}}\ndistortion_coefficients: {{data: [-0.05, 0, 0, 0, 0]}}\nrectification_matrix: {{data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}\nprojection_matrix: {{data: [55, 0, 24, {}, 0, 55, 18, 0, 0, 0, 1, 0]}}\n",
            -5.5 * view as f64
        );
        fs::write(file, text).unwrap();
    }
    let filed = files
        .each_ref()
        .map(|file| file.display().to_string())
        .join(",");
    let mut by_files = Source::open(&Settings {
        calibration: Some(filed),
        ..folder.settings()
    })
    .unwrap();
    assert_eq!(read(&mut by_files, 0, 1), rectified);
    let mut untouched = Source::open(&Settings {
        rectify: false,
        ..folder.settings()
    })
    .unwrap();
    assert_eq!(read(&mut untouched, 0, 1), gray(0, 1));
}

#[test]
fn camera_info_that_says_nothing_is_not_used_and_told() {
    for (d, p, expected) in [
        // Calibrated each by itself: nothing says how far apart they are.
        (
            vec![0.1, 0.0, 0.0, 0.0, 0.0],
            [55.0, 24.0, 18.0, 0.0],
            "cannot be rectified by their camera_info",
        ),
        (vec![], [0.0, 0.0, 0.0, 0.0], "no camera_info is used"),
    ] {
        let name = if d.is_empty() {
            "image_rect"
        } else {
            "image_raw"
        };
        let all = with_infos(name, |_| (d.clone(), p));
        let source = Folder::of(&all).open().unwrap();
        assert!(said(&source).contains(expected), "{}", said(&source));
        assert!(source.calibration().is_none_or(|known| !known.calibrated));
    }
}

#[test]
fn camera_info_of_which_drivers_fill_in_a_part_only_is_used_as_far_as_it_goes() {
    // P alone, of images that are rectified without their topics saying so.
    let all: Vec<Written> = (0..3)
        .flat_map(|view| {
            let camera = Camera {
                size: SIZE,
                k: [0.0; 3],
                d: &[],
                p: [55.0, 24.0, 18.0, -5.5 * view as f64],
            };
            let info = camera_info(&format!("/{}/camera_info", SIDES[view]), START, camera);
            [info, shot(&format!("/{}/image", SIDES[view]), 0, view)]
        })
        .collect();
    let mut source = Folder::of(&all).open().unwrap();
    assert_eq!(source.calibration().unwrap().focal_px, 55.0);
    assert_eq!(read(&mut source, 0, 1), gray(0, 1));
    // K alone: nothing says how views are rectified, and nothing is divided by zero.
    let all = with_infos("image_raw", |_| (vec![0.1, 0.0, 0.0, 0.0, 0.0], [0.0; 4]));
    let source = Folder::of(&all).open().unwrap();
    assert_eq!(source.calibration().unwrap().focal_px, 60.0);
    assert!(
        said(&source).contains("set capture.calibration"),
        "{}",
        said(&source)
    );
}

#[test]
fn what_is_unclear_is_refused_with_what_there_is() {
    let names = ["/a/image", "/b/image", "/c/image"];
    let all: Vec<Written> = names
        .iter()
        .zip(0..)
        .map(|(name, view)| shot(name, 0, view))
        .collect();
    let folder = Folder::of(&all);
    assert_eq!(
        folder.refusal(&folder.settings()),
        "the bag ~/bag.mcap: which topics are which views is not to be seen from their names; choose with --topics \
         left=/…,centre=/…,right=/… among /a/image (sensor_msgs/Image, 1), /b/image (sensor_msgs/Image, 1), /c/image \
         (sensor_msgs/Image, 1)"
    );
    let told = |topics: &str| Settings {
        topics: topics.split(',').map(str::to_owned).collect(),
        ..folder.settings()
    };
    let mut source = Source::open(&told("right=/c/image,left=a/image,centre=/b/image")).unwrap();
    assert_shows(&mut source, 1);
    assert_eq!(source.topics().unwrap(), names);
    let refusal = folder.refusal(&told("left=/a/imag,centre=/b/image,right=/c/image"));
    assert!(
        refusal.contains("no images on /a/imag, did you mean /a/image?"),
        "{refusal}"
    );
    assert!(
        Source::open(&told("left=/a/image"))
            .unwrap_err()
            .is_wrong_use()
    );
}

#[test]
fn of_more_than_three_views_some_can_be_chosen() {
    let all: Vec<Written> = (0..5)
        .map(|view| shot(&format!("/cam{view}/image"), 0, view))
        .collect();
    let folder = Folder::of(&all);
    for (views, expected) in [
        (Views::These(Vec::new()), vec![0, 1, 2]),
        (Views::These(vec![0, 2, 4]), vec![0, 2, 4]),
        (Views::All, vec![0, 1, 2, 3, 4]),
    ] {
        let mut source = Source::open(&Settings {
            views,
            ..folder.settings()
        })
        .unwrap();
        assert_eq!(source.view_count(), expected.len());
        for (view, &number) in expected.iter().enumerate() {
            assert_eq!(read(&mut source, 0, view), gray(0, number));
        }
    }
}

#[test]
fn a_torn_bag_says_what_was_read_and_is_read_as_far_as_it_goes() {
    let all = rig(20);
    let folder = Folder::new();
    for (name, options) in [
        (
            "plain.mcap",
            WriteOptions::new().compression(None).chunk_size(Some(8000)),
        ),
        (
            "zstd.mcap",
            packed(Compression::Zstd).chunk_size(Some(8000)),
        ),
        ("chunkless.mcap", WriteOptions::new().use_chunks(false)),
        ("one_chunk.mcap", WriteOptions::new().compression(None)),
    ] {
        let path = folder.file(name);
        mcap_with(&path, &all, options);
        let whole = fs::read(&path).unwrap();
        fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        let mut source = Source::open(&settings(&path)).unwrap();
        let damage = source.damage().unwrap().to_owned();
        assert!(damage.contains("torn at byte"), "{damage}");
        let scans = source.scans();
        assert!((4..16).contains(&scans), "{name}: {scans}");
        for scan in 0..scans {
            assert_eq!(read(&mut source, scan, 2), gray(scan, 2), "{name}");
        }
    }
    let path = folder.file("bag.db3");
    db3(&path, &all);
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() * 2 / 3]).unwrap();
    let mut source = Source::open(&settings(&path)).unwrap();
    let damage = source.damage().unwrap().to_owned();
    assert!(damage.contains("its database is damaged"), "{damage}");
    assert!(source.scans() >= 4, "{}", source.scans());
    assert_eq!(read(&mut source, 3, 1), gray(3, 1));
}

#[test]
fn a_damaged_chunk_is_left_out_and_what_follows_is_read() {
    let all = rig(20);
    let folder = Folder::new();
    let path = folder.file("bag.mcap");
    mcap_with(
        &path,
        &all,
        packed(Compression::Zstd).chunk_size(Some(8000)),
    );
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    for byte in &mut bytes[middle..middle + 20] {
        *byte ^= 0x55;
    }
    fs::write(&path, &bytes).unwrap();
    let mut source = Source::open(&settings(&path)).unwrap();
    assert!(source.damage().is_some());
    let scans = source.scans();
    assert!((10..20).contains(&scans), "{scans}");
    assert_eq!(read(&mut source, scans - 1, 0), gray(19, 0));
    // Lengths that lead nowhere: the file's own index says where to go on.
    let mut bytes = fs::read(&path).unwrap();
    let records = bytes[..middle]
        .windows(9)
        .rposition(|head| head[0] == 6 && head[4..] == [0; 5]);
    bytes[records.unwrap() + 4..][..4].fill(0x7f);
    fs::write(&path, &bytes).unwrap();
    let source = Source::open(&settings(&path)).unwrap();
    assert!(source.scans() >= 8, "{}", source.scans());
    assert!(source.damage().is_some());
}

#[test]
fn an_image_in_a_damaged_chunk_is_told_when_its_turn_comes_and_the_others_are_read() {
    let all = rig(6);
    let folder = Folder::new();
    let path = folder.file("bag.mcap");
    let options = WriteOptions::new().compression(None).chunk_size(Some(2000));
    mcap_with(&path, &all, options);
    let mut bytes = fs::read(&path).unwrap();
    for (scan, view) in [(3, 1usize), (0, 2)] {
        let wanted = shot(&topic(view), scan, view).bytes;
        let at = bytes
            .windows(wanted.len())
            .position(|window| window == wanted);
        bytes[at.unwrap() + wanted.len() - 100] ^= 1;
    }
    fs::write(&path, &bytes).unwrap();
    let mut source = Source::open(&settings(&path)).unwrap();
    let mut out = Owned::<Image>::new(source.size());
    let error = out.fill(|room| source.read(3, 1, room)).unwrap_err();
    assert!(error.is_of_one_scan());
    let text = error.to_string();
    assert!(
        text.contains("/centre/image_rect") && text.contains("checksum"),
        "{text}"
    );
    assert_eq!(read(&mut source, 4, 1), gray(4, 1));
}

#[test]
fn what_is_missing_of_a_folder_is_told() {
    let all = rig(6);
    let folder = Folder::new();
    mcap(&folder.file("bag_0.mcap"), &all[..9]);
    mcap(&folder.file("bag_1.mcap"), &all[9..]);
    let damage = || {
        let source = Source::open(&settings(folder.0.path())).unwrap();
        (
            source.scans(),
            source.damage().unwrap_or_default().to_owned(),
        )
    };
    // A recorder that was killed writes no metadata.
    let (scans, told) = damage();
    assert_eq!(scans, 6);
    assert!(told.contains("has no metadata.yaml"), "{told}");
    metadata(folder.0.path(), &["bag_0.mcap", "bag_1.mcap"], "mcap", &all);
    assert_eq!(damage(), (6, String::new()));
    fs::remove_file(folder.file("bag_1.mcap")).unwrap();
    let (scans, told) = damage();
    assert_eq!(scans, 3);
    assert!(
        told.contains("bag_1.mcap, which metadata.yaml names, is missing"),
        "{told}"
    );
    assert!(
        told.contains("3 of the 6 messages of /left/image_rect"),
        "{told}"
    );
    // Half a database is not taken for a whole one.
    fs::write(folder.file("bag_1.mcap"), b"").unwrap();
    let (scans, told) = damage();
    assert_eq!(scans, 3);
    assert!(told.contains("bag_1.mcap: it is empty"), "{told}");
}

#[test]
fn an_image_that_cannot_be_used_is_damage_of_the_bag() {
    let short = |size: (u32, u32)| {
        let pixels = Pixels {
            encoding: "mono8",
            size,
            step: size.0,
            is_big: false,
            data: &gray(2, 1)[..9],
        };
        image(&topic(1), START + 202 * MS, pixels)
    };
    for odd in [short(SIZE), short((0, 0))] {
        let mut all = rig(4);
        all[7] = odd;
        let source = Folder::of(&all).open().unwrap();
        assert_eq!(source.scans(), 3);
        let damage = source.damage().unwrap_or_default();
        assert!(
            damage.contains("1 of 4 images on /centre/image_rect cannot be used; the first: it "),
            "{damage}"
        );
        assert!(source.warnings().contains(&damage.to_owned()));
    }
}

#[test]
fn a_torn_png_or_jpeg_is_told_when_its_turn_comes() {
    let jpeg = |levels: &[u8]| {
        let mut out = Vec::new();
        let encoder = JpegEncoder::new_with_quality(&mut out, 90);
        let written = encoder.write_image(levels, SIZE.0, SIZE.1, ExtendedColorType::L8);
        written.map(|()| out).unwrap()
    };
    let png = |levels: &[u8]| {
        let mut out = Vec::new();
        let encoder = PngEncoder::new(&mut out);
        let written = encoder.write_image(levels, SIZE.0, SIZE.1, ExtendedColorType::L8);
        written.map(|()| out).unwrap()
    };
    for encode in [&jpeg as &dyn Fn(&[u8]) -> Vec<u8>, &png] {
        let scans = (0..4).flat_map(|scan| (0..3).map(move |view| (scan, view)));
        let all: Vec<Written> = scans
            .map(|(scan, view)| {
                let mut bytes = encode(&gray(scan, view));
                if (scan, view) == (2, 1) {
                    bytes.truncate(bytes.len() / 2);
                }
                let nanos = START + scan * 100 * MS + view as u64 * 2 * MS;
                compressed(&format!("/cam{view}/image_raw/compressed"), nanos, &bytes)
            })
            .collect();
        let mut source = Folder::of(&all).open().unwrap();
        let mut out = Owned::<Image>::new(source.size());
        let error = out.fill(|room| source.read(2, 1, room)).unwrap_err();
        assert!(error.is_of_one_scan(), "{error}");
        out.fill(|room| source.read(3, 1, room)).unwrap();
    }
}

#[test]
fn a_bag_file_that_the_metadata_does_not_name_is_told_of() {
    let all = rig(6);
    let folder = Folder::new();
    mcap(&folder.file("bag_0.mcap"), &all[..9]);
    metadata(folder.0.path(), &["bag_0.mcap"], "mcap", &all[..9]);
    let said = |folder: &Folder| {
        let source = Source::open(&settings(folder.0.path())).unwrap();
        assert_eq!(source.scans(), 3);
        assert_eq!(source.damage(), None);
        let mut warnings = source.warnings().iter();
        warnings
            .find(|warning| warning.contains("not read"))
            .cloned()
    };
    assert_eq!(said(&folder), None);
    // One that was unpacked is the same.
    fs::write(folder.file("bag_0.mcap.zstd"), [0x28, 0xb5, 0x2f, 0xfd]).unwrap();
    assert_eq!(said(&folder), None);
    mcap(&folder.file("bag_1.mcap"), &all[9..]);
    let told = "bag_1.mcap is not read, for metadata.yaml does not name it: give it by itself, or run `ros2 bag reindex`";
    assert_eq!(said(&folder).as_deref(), Some(told));
    fs::remove_file(folder.file("bag_0.mcap")).unwrap();
    fs::remove_file(folder.file("bag_0.mcap.zstd")).unwrap();
    let refusal = folder.refusal(&settings(folder.0.path()));
    assert!(
        refusal.contains("bag_0.mcap, which metadata.yaml names, is missing; give bag_1.mcap itself if that is meant"),
        "{refusal}"
    );
}

#[test]
fn what_is_no_bag_that_is_read_says_what_to_do() {
    let folder = Folder::new();
    for (name, bytes, expected) in [
        (
            "old.bag",
            &b"#ROSBAG V2.0\n..."[..],
            "it is a bag of ROS 1; `mcap convert",
        ),
        (
            "bag_0.mcap.zstd",
            &[0x28, 0xb5, 0x2f, 0xfd, 1][..],
            "it is packed as a whole; unpack it with `zstd -d`",
        ),
        (
            "no.mcap",
            b"hello, this is text",
            "it is neither an MCAP file nor an SQLite database",
        ),
        ("empty.mcap", b"", "it is empty"),
    ] {
        fs::write(folder.file(name), bytes).unwrap();
        let refusal = folder.refusal(&Settings {
            source: folder.file(name).display().to_string(),
            ..Settings::default()
        });
        assert!(refusal.contains(expected), "{refusal}");
    }
    assert!(
        folder
            .refusal(&settings(&folder.file("gone.mcap")))
            .contains("gone.mcap: ")
    );
    let folder = Folder::of(&[number("/speed", START, 1.0)]);
    let refusal = folder.refusal(&folder.settings());
    assert!(
        refusal.contains("no topic holds images")
            && refusal.contains("/speed (std_msgs/Float64, 1)"),
        "{refusal}"
    );
}

#[test]
fn settings_of_bags_are_refused_for_anything_else() {
    for settings in [
        Settings {
            topics: vec!["/a".to_owned()],
            ..Settings::default()
        },
        Settings {
            position_topic: Some("/odom".to_owned()),
            ..Settings::default()
        },
    ] {
        let error = Source::open(&settings).unwrap_err();
        assert!(
            error.is_wrong_use() && error.to_string().contains("is of bags"),
            "{error}"
        );
    }
    let folder = Folder::of(&rig(3));
    let refusal = folder.refusal(&Settings {
        position_topic: Some("/odom".to_owned()),
        ..folder.settings()
    });
    assert!(refusal.contains("set capture.mode to rail"), "{refusal}");
}

const WIDTH: u32 = 320;
const HEIGHT: u32 = 200;
/// Metres from one frame of a rail to the next.
const STEP: f64 = 0.01;

/// A rail's frames, each 5 px and more further on than the last.
fn passed(frames: u64) -> Vec<Written> {
    let frame = |n: u64| {
        let place = n as f64;
        let pixels =
            (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (f64::from(x), f64::from(y))));
        let level = |(x, y): (f64, f64)| wave(x + place * (5.0 + y / 100.0), y);
        let data: Vec<u8> = pixels.map(level).collect();
        image(
            "/camera/image_rect",
            START + n * 100 * MS,
            Pixels {
                encoding: "mono8",
                size: (WIDTH, HEIGHT),
                step: WIDTH,
                is_big: false,
                data: &data,
            },
        )
    };
    (0..frames).map(frame).collect()
}

fn on_rail(folder: &Folder, position: &str) -> Settings {
    Settings {
        mode: Mode::Rail,
        position_topic: Some(position.to_owned()),
        sway: Some(false),
        ..folder.settings()
    }
}

#[test]
fn every_kind_of_message_says_where_a_rails_frames_were_taken() {
    let along = [0.6, 0.0, 0.8];
    // Samples of their own times, from before the first frame to after the last.
    let samples: Vec<(u64, f64)> = (0..48)
        .map(|n| {
            (
                START - 50 * MS + n * 30 * MS,
                (n as f64 * 30.0 - 50.0) / 100.0 * STEP,
            )
        })
        .collect();
    let at = |metres: f64| along.map(|part| part * metres);
    let mut all = passed(12);
    for &(nanos, metres) in &samples {
        all.push(odometry("/odom", nanos, at(metres)));
        all.push(pose("/pose", nanos, at(metres)));
        // A base that goes the other way.
        all.push(odometry("/back", nanos, at(-metres)));
        all.push(transforms(
            "/tf",
            nanos,
            &[
                ("odom", "base", at(metres)),
                ("odom", "arm", [metres.sin(), 9.0, 1.0]),
            ],
        ));
        all.push(joints(
            "/joints",
            nanos,
            &[("turn", 1.0), ("slide", metres)],
        ));
        all.push(number("/slide", nanos + 3 * MS, metres));
    }
    all.push(transforms(
        "/tf_static",
        START,
        &[("base", "/camera/image_rect_frame", [0.1, 0.2, 0.3])],
    ));
    let folder = Folder::of(&all);
    for position in [
        "/odom",
        "pose",
        "/back",
        "/tf",
        "/tf:base",
        "/tf:odom>base",
        "/joints:slide",
        "/slide",
    ] {
        let source = Source::open(&on_rail(&folder, position)).unwrap();
        assert_eq!(source.scans(), 12, "{position}");
        let first = source.position_m(0).unwrap();
        for frame in 0..12 {
            let metres = source.position_m(frame).unwrap() - first;
            let expected = STEP * frame as f64;
            assert!(
                (metres - expected).abs() < 1e-6,
                "{position}, frame {frame}: {metres} is not {expected}"
            );
        }
        let rail = source.rail().unwrap();
        let baseline = source.calibration().unwrap().baseline_m;
        assert!(
            (baseline - STEP * rail.stride as f64).abs() < 1e-6,
            "{position}: {baseline}"
        );
    }
    let refusal = folder.refusal(&on_rail(&folder, "/joints"));
    assert!(
        refusal.contains("several things were (slide, turn)"),
        "{refusal}"
    );
    let refusal = folder.refusal(&on_rail(&folder, "/nothing"));
    assert!(refusal.contains("it has nothing on /nothing"), "{refusal}");
    // A successor is told what was found out, and finds the same.
    let source = Source::open(&on_rail(&folder, "/back")).unwrap();
    let again = Source::open_at(&on_rail(&folder, "/back"), source.places().unwrap(), &[]).unwrap();
    assert_eq!(again.position_m(7), source.position_m(7));
}

#[test]
fn a_rails_frames_without_a_place_are_left_out_and_told() {
    let mut all = passed(12);
    all.extend((0..10).map(|n| {
        odometry(
            "/odom",
            START + (n * 100 + 150) * MS,
            [STEP * (n as f64 + 1.5), 0.0, 0.0],
        )
    }));
    let folder = Folder::of(&all);
    let source = Source::open(&on_rail(&folder, "/odom")).unwrap();
    assert_eq!(source.scans(), 9);
    assert!(
        said(&source).contains("3 of 12 frames were taken before or after /odom says where"),
        "{}",
        said(&source)
    );
    // Times are those of the frames that are left.
    assert_eq!(source.nanos_after_start(1), Some(100 * MS));
}

#[test]
fn a_rail_of_which_nothing_says_where_is_looked_at_as_a_folder_is() {
    let folder = Folder::of(&passed(12));
    let source = Source::open(&Settings {
        mode: Mode::Rail,
        ..folder.settings()
    })
    .unwrap();
    assert_eq!(source.scans(), 12);
    assert!(
        said(&source).contains("where the frames were taken is not said"),
        "{}",
        said(&source)
    );
    // Or by a speed: frames have their times.
    let source = Source::open(&Settings {
        mode: Mode::Rail,
        speed: Some(0.1),
        ..folder.settings()
    })
    .unwrap();
    let metres = source.position_m(5).unwrap() - source.position_m(0).unwrap();
    assert!((metres - 0.05).abs() < 1e-9, "{metres}");
}

#[test]
fn damaged_bytes_anywhere_make_no_panic_and_no_silence() {
    let folder = Folder::new();
    let all = rig(4);
    let plain = folder.file("plain.mcap");
    mcap_with(
        &plain,
        &all,
        WriteOptions::new().compression(None).chunk_size(Some(4000)),
    );
    let base = folder.file("base.db3");
    db3(&base, &all);
    let path = folder.file("bag.mcap");
    for whole in [fs::read(&plain).unwrap(), fs::read(&base).unwrap()] {
        for place in (0..whole.len()).step_by(211) {
            let mut bytes = whole.clone();
            bytes[place] ^= 0xff;
            fs::write(&path, &bytes).unwrap();
            let Ok(mut source) = Source::open(&settings(&path)) else {
                continue;
            };
            let scans = source.scans();
            for scan in 0..scans {
                for view in 0..3 {
                    let mut out = Owned::<Image>::new(source.size());
                    let read = out.fill(|room| source.read(scan, view, room));
                    read.map(|_| ()).unwrap_or_default();
                }
            }
        }
    }
}

#[test]
fn a_message_in_either_byte_order_says_the_same() {
    let one = |view: usize, is_big: bool| {
        let data = gray(0, view);
        let bytes = Cdr::new(is_big)
            .header(START, "odd")
            .u32(SIZE.1)
            .u32(SIZE.0)
            .text("8UC1")
            .u8(0)
            .u32(SIZE.0)
            .data(&data)
            .done();
        written(&topic(view), "sensor_msgs/msg/Image", START, bytes)
    };
    let all = [one(0, true), one(1, false), one(2, true)];
    assert_shows(&mut Folder::of(&all).open().unwrap(), 1);
}
