//! Recordings that other programs rewrote: whatever these left out or changed, every scan is read, and none is lost.
#![expect(clippy::unwrap_used, reason = "tests")]

mod synthetic;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::ops::Range;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use messages::{Points, Size, Topic};
use record::{Batch, Info, Recording, Settings, Split, Wanted, Writer, rewrite};
use synthetic::{START, STEP, Scan, metadata};

const SIZE: Size = Size::new(64, 48);

/// A folder with a recording of these scans in it, `own.mcap`.
struct Given {
    folder: tempfile::TempDir,
    batches: BTreeMap<u64, Batch>,
    names: Vec<String>,
}

impl Given {
    fn new(scans: Range<u64>) -> Self {
        let rig = synthetic::rig(SIZE);
        let settings = Settings::default();
        let folder = tempfile::tempdir().unwrap();
        let mut encoder = synthetic::encoder(&rig, &settings);
        let path = folder.path().join("own.mcap");
        let mut writer =
            Writer::create(&path, false, &metadata(&rig), &encoder, &settings).unwrap();
        let mut batches = BTreeMap::new();
        for scan in scans {
            let batch = synthetic::batch(&mut encoder, &Scan::new(&rig, scan, 6));
            writer.write(&batch).unwrap();
            batches.insert(scan, batch);
        }
        writer.finish(None).unwrap();
        let names = encoder
            .channels()
            .iter()
            .map(|channel| channel.name.clone());
        Self {
            names: names.collect(),
            folder,
            batches,
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The recording, as somebody rewrites it.
    fn rewritten(&self, name: &str, how: &How) -> PathBuf {
        let path = self.path(name);
        how.write(&[self.path("own.mcap")], &path);
        path
    }

    /// Every message of every scan is there, to the byte, and nothing besides.
    #[track_caller]
    fn assert_is(&self, path: &Path, what: &str) {
        let mut recording = Recording::open(path).unwrap();
        assert!(
            recording.scans().eq(self.batches.keys().copied()),
            "{what}: {}",
            recording.held()
        );
        assert_eq!(recording.whole_scans().len(), self.batches.len(), "{what}");
        assert!(
            recording.notes().is_empty(),
            "{what}: {:?}",
            recording.notes()
        );
        assert!(!recording.lacks_scans(), "{what}");
        for (&scan, batch) in &self.batches {
            let read = recording.scan(scan).unwrap();
            assert_eq!(read.nanos, START + scan * STEP, "{what}");
            for (channel, bytes) in batch.messages() {
                let topic = &self.names[channel];
                assert!(
                    read.message(topic) == Some(bytes),
                    "{what}: {topic} of scan {scan}"
                );
            }
            assert_eq!(
                read.messages().count(),
                batch.messages().count(),
                "{what}: {scan}"
            );
            assert!(read.contradicted.is_empty(), "{what}");
        }
    }
}

/// A message to be written: its topic, what numbers and dates it, and its bytes.
struct Sent {
    topic: String,
    encoding: String,
    schema: (String, String, Vec<u8>),
    header: MessageHeader,
    data: Vec<u8>,
}

/// Changes messages, leaves some out, or puts them in another order.
type Change = Box<dyn Fn(&mut Vec<Sent>)>;

/// How somebody rewrites recordings.
struct How {
    options: WriteOptions,
    keeps_metadata: bool,
    change: Change,
    /// Topics get a channel of their own every so many messages.
    channel_every: usize,
    keeps_schemas: bool,
}

impl Default for How {
    fn default() -> Self {
        Self {
            options: WriteOptions::new().library("another program"),
            keeps_metadata: true,
            change: Box::new(|_| {}),
            channel_every: usize::MAX,
            keeps_schemas: true,
        }
    }
}

impl How {
    fn with(options: impl FnOnce(WriteOptions) -> WriteOptions) -> Self {
        let mut how = Self::default();
        how.options = options(how.options);
        how
    }

    fn changing(change: impl Fn(&mut Vec<Sent>) + 'static) -> Self {
        Self {
            change: Box::new(change),
            ..Self::default()
        }
    }

    fn renaming(prefix: &'static str) -> Self {
        Self::changing(move |sent| {
            sent.iter_mut()
                .for_each(|message| message.topic.insert_str(0, prefix));
        })
    }

    fn numbering(number: impl Fn(usize, usize) -> usize + 'static) -> Self {
        Self::changing(move |sent| {
            let mut counts: BTreeMap<String, usize> = BTreeMap::new();
            for (place, message) in sent.iter_mut().enumerate() {
                let count = counts.entry(message.topic.clone()).or_default();
                message.header.sequence = number(place, *count) as u32;
                *count += 1;
            }
        })
    }

    fn write(&self, from: &[PathBuf], to: &Path) {
        let file = BufWriter::new(File::create(to).unwrap());
        let mut writer = self.options.clone().create(file).unwrap();
        let mut sent = Vec::new();
        for from in from {
            let bytes = fs::read(from).unwrap();
            for message in mcap::MessageStream::new(&bytes).unwrap() {
                let message = message.unwrap();
                let schema = message.channel.schema.clone().unwrap();
                sent.push(Sent {
                    topic: message.channel.topic.clone(),
                    encoding: message.channel.message_encoding.clone(),
                    schema: (
                        schema.name.clone(),
                        schema.encoding.clone(),
                        schema.data.to_vec(),
                    ),
                    header: MessageHeader {
                        channel_id: 0,
                        sequence: message.sequence,
                        log_time: message.log_time,
                        publish_time: message.publish_time,
                    },
                    data: message.data.to_vec(),
                });
            }
            if self.keeps_metadata {
                let contents = mcap::Summary::read(&bytes).unwrap().unwrap();
                for index in &contents.metadata_indexes {
                    let metadata = mcap::read::metadata(&bytes, index).unwrap();
                    writer.write_metadata(&metadata).unwrap();
                }
            }
        }
        (self.change)(&mut sent);
        let mut channels: BTreeMap<(String, usize), u16> = BTreeMap::new();
        for (place, message) in sent.into_iter().enumerate() {
            let Sent {
                topic,
                encoding,
                schema: (name, of, data),
                ..
            } = &message;
            let turn = place / self.channel_every;
            let new = || {
                let schema = match self.keeps_schemas {
                    true => writer.add_schema(name, of, data).unwrap(),
                    false => 0,
                };
                let turn = BTreeMap::from([("turn".to_owned(), turn.to_string())]);
                writer.add_channel(schema, topic, encoding, &turn).unwrap()
            };
            let channel_id = *channels.entry((topic.clone(), turn)).or_insert_with(new);
            let header = MessageHeader {
                channel_id,
                ..message.header
            };
            writer
                .write_to_known_channel(&header, &message.data)
                .unwrap();
        }
        writer.finish().unwrap();
    }
}

/// A writer of plain records, as simple as files may be.
fn nothing_besides(options: WriteOptions) -> WriteOptions {
    options
        .emit_summary_records(false)
        .emit_summary_offsets(false)
        .emit_statistics(false)
        .emit_message_indexes(false)
        .emit_chunk_indexes(false)
        .emit_attachment_indexes(false)
        .emit_metadata_indexes(false)
        .repeat_channels(false)
        .repeat_schemas(false)
}

/// In a fixed but wild order.
fn shuffle(sent: &mut [Sent]) {
    let mut state = 5u64;
    for place in (1..sent.len()).rev() {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        sent.swap(place, (state >> 33) as usize % (place + 1));
    }
}

/// Ways of writing a recording anew that lose nothing.
fn ways() -> Vec<(&'static str, How)> {
    let mut ways = vec![
        ("as it is", How::default()),
        (
            "no message indexes",
            How::with(|o| o.emit_message_indexes(false)),
        ),
        (
            "no chunk indexes",
            How::with(|o| o.emit_chunk_indexes(false)),
        ),
        ("no statistics", How::with(|o| o.emit_statistics(false))),
        ("no summary", How::with(nothing_besides)),
        ("no chunks", How::with(|o| o.use_chunks(false))),
        (
            "no chunks, no summary",
            How::with(|o| nothing_besides(o.use_chunks(false))),
        ),
        (
            "nothing repeated",
            How::with(|o| o.repeat_channels(false).repeat_schemas(false)),
        ),
        (
            "no metadata indexes",
            How::with(|o| o.emit_metadata_indexes(false)),
        ),
        ("not compressed", How::with(|o| o.compression(None))),
        ("lz4", How::with(|o| o.compression(Some(Compression::Lz4)))),
        ("one chunk", How::with(|o| o.chunk_size(None))),
        ("a chunk a message", How::with(|o| o.chunk_size(Some(1)))),
        (
            "under our name, in one chunk",
            How::with(|o| o.library("tricurve 0.1.0").chunk_size(None)),
        ),
        (
            "under our name, a chunk a message",
            How::with(|o| o.library("tricurve 0.1.0").chunk_size(Some(1))),
        ),
        (
            "channels over and over",
            How {
                channel_every: 7,
                ..How::default()
            },
        ),
        (
            "no schemas",
            How {
                keeps_schemas: false,
                ..How::default()
            },
        ),
        ("backwards", How::changing(|sent| sent.reverse())),
        ("in a wild order", How::changing(|sent| shuffle(sent))),
        (
            "topic by topic",
            How::changing(|sent| sent.sort_by(|a, b| a.topic.cmp(&b.topic))),
        ),
        ("with a slash", How::renaming("/")),
        ("under a name", How::renaming("/tricurve/")),
        ("twice", How::default()),
        ("no numbers", How::numbering(|_, _| 0)),
        ("numbers a channel", How::numbering(|_, count| count)),
        ("numbers throughout", How::numbering(|place, _| place)),
        (
            "dated anew",
            How::changing(|sent| {
                let mut latest: BTreeMap<u32, u64> = BTreeMap::new();
                for message in sent {
                    let time = latest.entry(message.header.sequence);
                    let time = time.or_insert(message.header.log_time);
                    message.header.log_time = *time;
                    *time += 1;
                }
            }),
        ),
    ];
    let backwards = How {
        options: WriteOptions::new()
            .library("tricurve 0.1.0")
            .chunk_size(Some(1)),
        ..How::changing(|sent| sent.reverse())
    };
    ways.push(("under our name, backwards", backwards));
    let all = How {
        options: nothing_besides(WriteOptions::new().use_chunks(false)),
        ..How::changing(|sent| {
            shuffle(sent);
            for message in sent {
                message.topic.insert_str(0, "/robot/1/");
                message.header.sequence = 0;
            }
        })
    };
    ways.push(("all at once", all));
    ways
}

#[test]
fn however_a_recording_is_rewritten_every_scan_is_read_to_the_byte() {
    let given = Given::new(3..9);
    for (what, how) in ways() {
        let path = given.path("new.mcap");
        let times = if what == "twice" { 2 } else { 1 };
        how.write(&vec![given.path("own.mcap"); times], &path);
        given.assert_is(&path, what);
        let recording = Recording::open(&path).unwrap();
        assert_eq!(
            recording.metadata(),
            &metadata(&synthetic::rig(SIZE)),
            "{what}"
        );
    }
}

#[test]
fn no_rewriting_of_what_others_rewrote_loses_a_scan() {
    let given = Given::new(0..4);
    for (what, how) in ways() {
        let path = given.rewritten("new.mcap", &how);
        for (inputs, scans) in [
            (vec![path.clone()], 4),
            (vec![path.clone(), given.path("own.mcap")], 8),
            (vec![given.path("own.mcap"), path.clone()], 8),
        ] {
            let wanted = Wanted {
                topic: &|_| true,
                scans: 0..u64::MAX,
                split: Split::default(),
                overwrite: true,
                settings: &serde_json::Value::clone,
                progress: &mut |_, _| {},
            };
            let out = given.path("out.mcap");
            let done = rewrite(&inputs, &out, wanted).unwrap();
            assert_eq!((done.scans, done.whole), (scans, scans), "{what}");
            assert!(!done.lacks_scans, "{what}");
            let written = Recording::open(&out).unwrap();
            assert!(written.scans().eq(0..scans), "{what}: {}", written.held());
            assert!(
                written.remarks().is_empty(),
                "{what}: {:?}",
                written.remarks()
            );
        }
    }
}

#[test]
fn without_metadata_the_rig_is_what_the_messages_say_and_the_settings_are_not_known() {
    let given = Given::new(0..3);
    for (what, mut how) in ways() {
        how.keeps_metadata = false;
        let path = given.rewritten("new.mcap", &how);
        given.assert_is(&path, what);
        let mut recording = Recording::open(&path).unwrap();
        let expected = metadata(&synthetic::rig(SIZE));
        assert_eq!(recording.metadata().rig, expected.rig, "{what}");
        assert_eq!(recording.metadata().reference, expected.reference, "{what}");
        assert!(!recording.metadata().knows_settings(), "{what}");
        let told = recording.remarks().join("; ");
        assert!(told.contains("the settings are not known"), "{told}");
        let topic = Topic::all(&expected.rig)
            .into_iter()
            .find(|topic| topic.name == "points");
        let topic = topic.unwrap();
        let mut own = Recording::open(&given.path("own.mcap")).unwrap();
        let points = |recording: &mut Recording| {
            let points = recording.read::<Points>(2, &topic).unwrap();
            bytemuck::cast_slice::<_, u8>(points.view().points).to_vec()
        };
        assert!(points(&mut recording) == points(&mut own), "{what}");
        let info = Info::of(&recording).to_string();
        assert!(info.contains("settings      not known"), "{info}");
    }
}

#[test]
fn a_part_without_numbers_has_those_that_its_statistics_say() {
    let given = Given::new(60..64);
    let path = given.rewritten("new.mcap", &How::numbering(|_, _| 0));
    given.assert_is(&path, "no numbers");
    let mut how = How::numbering(|_, _| 0);
    let zero = how.change;
    how.change = Box::new(move |sent| {
        zero(sent);
        sent.retain(|message| message.topic != "statistics");
    });
    let path = given.rewritten("bare.mcap", &how);
    let recording = Recording::open(&path).unwrap();
    assert!(recording.scans().eq(0..4), "{}", recording.held());
    let told = recording.remarks().join("; ");
    assert!(told.contains("counted in order of time"), "{told}");
}

#[test]
fn recordings_that_others_merged_into_one_are_all_there() {
    let [one, other] = [Given::new(0..3), Given::new(0..3)];
    let path = one.path("both.mcap");
    let later = How::changing(|sent| {
        for message in sent.iter_mut() {
            message.header.log_time += 10 * STEP;
        }
    });
    later.write(&[other.path("own.mcap")], &other.path("later.mcap"));
    How::default().write(&[one.path("own.mcap"), other.path("later.mcap")], &path);
    let mut recording = Recording::open(&path).unwrap();
    assert!(recording.scans().eq(0..6), "{}", recording.held());
    assert_eq!(recording.whole_scans().len(), 6);
    assert_eq!(recording.ledger(), None);
    for scan in 0..6 {
        let read = recording.scan(scan).unwrap();
        let (channel, bytes) = one.batches[&(scan % 3)].messages().next().unwrap();
        assert!(read.message(&one.names[channel]) == Some(bytes), "{scan}");
    }
}

#[test]
fn scans_that_contradict_each_other_are_told_of() {
    let given = Given::new(0..3);
    let how = How::changing(|sent| {
        let half = sent.len() / 2;
        let is_it = |message: &&mut Sent| message.topic == "points" && message.header.sequence == 1;
        let message = sent[half..].iter_mut().find(is_it).unwrap();
        *message.data.last_mut().unwrap() ^= 1;
    });
    let path = given.path("both.mcap");
    how.write(&[given.path("own.mcap"), given.path("own.mcap")], &path);
    let mut recording = Recording::open(&path).unwrap();
    assert_eq!(recording.scan(1).unwrap().contradicted, ["points"]);
    assert!(recording.scan(2).unwrap().contradicted.is_empty());
    let wanted = Wanted {
        topic: &|_| true,
        scans: 0..u64::MAX,
        split: Split::default(),
        overwrite: true,
        settings: &serde_json::Value::clone,
        progress: &mut |_, _| {},
    };
    let done = rewrite(&[path], &given.path("out.mcap"), wanted).unwrap();
    assert_eq!((done.contradicted, done.lacks_scans), (1, true));
    assert!(
        done.notes
            .iter()
            .any(|note| note.contains("two different messages"))
    );
}

#[test]
fn topics_of_other_programs_make_no_scans() {
    let given = Given::new(0..4);
    let how = How::changing(|sent| {
        for count in 0..40 {
            sent.push(Sent {
                topic: "/cmd_vel".to_owned(),
                encoding: "json".to_owned(),
                schema: (
                    "a.Twist".to_owned(),
                    "jsonschema".to_owned(),
                    b"{}".to_vec(),
                ),
                header: MessageHeader {
                    channel_id: 0,
                    sequence: count,
                    log_time: START + 7 + u64::from(count) * STEP / 10,
                    publish_time: START,
                },
                data: b"{}".to_vec(),
            });
        }
    });
    let path = given.rewritten("new.mcap", &how);
    given.assert_is(&path, "beside others");
    let told = Recording::open(&path).unwrap().remarks().join("; ");
    assert!(told.contains("left out: /cmd_vel"), "{told}");
}

#[test]
fn two_recordings_by_their_topics_names_are_not_read_as_one_in_silence() {
    let given = Given::new(0..3);
    let how = How::changing(|sent| {
        let half = sent.len() / 2;
        for (place, message) in sent.iter_mut().enumerate() {
            let prefix = if place < half { "/a/" } else { "/b/" };
            message.topic.insert_str(0, prefix);
        }
    });
    let path = given.path("both.mcap");
    how.write(&[given.path("own.mcap"), given.path("own.mcap")], &path);
    let recording = Recording::open(&path).unwrap();
    assert!(recording.lacks_scans() && !recording.is_complete());
    assert!(
        recording.notes()[0].contains("/b/"),
        "{:?}",
        recording.notes()
    );
}

#[test]
fn cut_anywhere_a_file_without_chunks_or_indexes_gives_what_is_whole() {
    let given = Given::new(0..5);
    for how in [
        How::with(|o| o.use_chunks(false)),
        How::with(|o| nothing_besides(o.use_chunks(false))),
        How::with(|o| nothing_besides(o.chunk_size(Some(20_000)))),
    ] {
        let path = given.rewritten("new.mcap", &how);
        let bytes = fs::read(&path).unwrap();
        let mut most = 0;
        for part in 1..20 {
            let cut = bytes.len() * part / 20;
            fs::write(&path, &bytes[..cut]).unwrap();
            let Ok(mut recording) = Recording::open(&path) else {
                continue;
            };
            assert!(!recording.is_complete(), "{cut}");
            let whole: Vec<u64> = recording.whole_scans();
            for scan in whole.iter().copied().filter(|scan| *scan < 5) {
                let read = recording.scan(scan).unwrap();
                for (topic, message) in read.messages() {
                    let is_it = |(channel, _): &(usize, &[u8])| given.names[*channel] == topic;
                    let (_, expected) = given.batches[&scan].messages().find(is_it).unwrap();
                    assert!(message == expected, "{topic} of {scan}");
                }
            }
            // Cut within its first scan, a file does not say which topics that was to have.
            assert!(whole.len() >= most || recording.scans().len() == 1, "{cut}");
            most = whole.len();
        }
        assert!(most >= 3, "{most}");
    }
}

#[test]
fn damaged_files_of_others_are_told_and_never_panic() {
    let given = Given::new(0..2);
    let mut state = 11u64;
    let mut random = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for keeps_metadata in [true, false] {
        for mut how in [
            How::with(|o| o.use_chunks(false)),
            How::with(|o| nothing_besides(o.chunk_size(Some(5_000)).compression(None))),
            How::with(|o| o.chunk_size(None).emit_message_indexes(false)),
        ] {
            how.keeps_metadata = keeps_metadata;
            let path = given.rewritten("new.mcap", &how);
            let good = fs::read(&path).unwrap();
            for round in 0..60 {
                let mut bad = good.clone();
                let at = match round % 3 {
                    0 => random(3000.min(bad.len())),
                    1 => bad.len() - 1 - random(3000.min(bad.len() - 1)),
                    _ => random(bad.len()),
                };
                bad[at] ^= 1 << random(8);
                fs::write(&path, &bad).unwrap();
                let Ok(mut recording) = Recording::open(&path) else {
                    continue;
                };
                assert!(!Info::of(&recording).to_string().is_empty());
                for scan in recording.scans().collect::<Vec<_>>() {
                    drop(recording.salvage(scan));
                }
            }
        }
    }
}

/// Dates every chunk by its first message alone, as some writers do.
fn date_by_the_first(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let mut start = mcap::MAGIC.len();
    while start + 9 < bytes.len() {
        let opcode = bytes[start];
        let body = start + 9;
        let length = u64::from_le_bytes(bytes[start + 1..body].try_into().unwrap()) as usize;
        if [mcap::records::op::CHUNK, mcap::records::op::CHUNK_INDEX].contains(&opcode) {
            bytes.copy_within(body..body + 8, body + 8);
        }
        if opcode == mcap::records::op::FOOTER {
            // There is no checksum of the index then.
            bytes[body + 16..body + 20].fill(0);
            break;
        }
        start = body + length;
    }
    fs::write(path, bytes).unwrap();
}

#[test]
fn chunks_that_are_dated_wrongly_are_read_whoever_says_to_have_written_them() {
    let given = Given::new(0..5);
    for library in ["another program", "tricurve 0.1.0"] {
        for size in [
            1, 3_000, 10_000, 20_000, 30_000, 40_000, 50_000, 60_000, 80_000,
        ] {
            let how = How::with(|o| o.library(library).chunk_size(Some(size)));
            let path = given.rewritten("new.mcap", &how);
            date_by_the_first(&path);
            given.assert_is(&path, &format!("{library}, {size}"));
        }
    }
}

#[test]
fn a_damaged_index_is_told_of_and_costs_nothing() {
    let given = Given::new(0..3);
    let path = given.path("own.mcap");
    let mut bytes = fs::read(&path).unwrap();
    let at = bytes.len() - 60;
    bytes[at] ^= 0x11;
    fs::write(&path, &bytes).unwrap();
    let mut recording = Recording::open(&path).unwrap();
    assert!(
        recording.notes()[0].contains("damaged index"),
        "{:?}",
        recording.notes()
    );
    assert!(!recording.lacks_scans() && recording.scans().eq(0..3));
    for scan in 0..3 {
        let read = recording.scan(scan).unwrap();
        assert_eq!(
            read.messages().count(),
            given.batches[&scan].messages().count()
        );
    }
}
