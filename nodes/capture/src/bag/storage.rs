//! The files of a bag, whatever they are: which topics there are, all messages once, and any message again.
//!
//! ```text
//! FOLDER with metadata.yaml ─┐
//! FILE.mcap, FILE.db3 ───────┴─► Files ─► visit: every message once ─► At ─► read: its bytes, at any time
//! ```

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::mcap::Mcap;
use super::sqlite::{self, Sqlite};
use super::wire::Why;
use crate::folder;
use crate::folder::read_plain;
use crate::names;

/// Bytes of a message that are looked at where its beginning says enough: a header, a name or two, some numbers.
pub(super) const HEAD: usize = 1024;

/// What rosbag2 writes beside the files.
const METADATA: &str = "metadata.yaml";

/// How messages are written down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    Cdr,
    Ros1,
    Protobuf,
    Json,
    Other,
}

impl Coding {
    pub(super) fn of(name: &str) -> Self {
        match name {
            "cdr" => Self::Cdr,
            "ros1" => Self::Ros1,
            "protobuf" => Self::Protobuf,
            "json" => Self::Json,
            _ => Self::Other,
        }
    }
}

/// One topic of a bag.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Topic {
    pub(super) name: String,
    /// The name of its messages' type.
    pub(super) schema: String,
    pub(super) coding: Coding,
    pub(super) count: u64,
}

/// The topics of a bag, those of all files together.
#[derive(Clone, Debug, Default)]
pub(super) struct Topics(Vec<Topic>);

impl Topics {
    /// The topic's number.
    pub(super) fn add(&mut self, name: &str, schema: &str, coding: Coding) -> usize {
        let schema = schema.replace("/msg/", "/");
        let is_known =
            |topic: &Topic| topic.name == name && topic.schema == schema && topic.coding == coding;
        self.0.iter().position(is_known).unwrap_or_else(|| {
            self.0.push(Topic {
                name: name.to_owned(),
                schema,
                coding,
                count: 0,
            });
            self.0.len() - 1
        })
    }

    pub(super) fn get(&self, number: usize) -> &Topic {
        &self.0[number]
    }

    pub(super) fn count(&mut self, number: usize) {
        self.0[number].count += 1;
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Topic> {
        self.0.iter()
    }
}

/// Where a message lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct At {
    /// The number of its file.
    pub(super) file: usize,
    /// Of MCAP where its chunk begins, 0 without one.
    pub(super) chunk: u64,
    /// Where its bytes begin, or its row in the database.
    pub(super) start: u64,
    pub(super) length: u64,
}

/// What is wanted of a topic's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Want {
    Nothing,
    /// At least the first [`HEAD`] bytes.
    Head,
    Whole,
}

/// Sees every message once.
pub(super) trait Visit {
    /// What is wanted of a topic, by its number.
    fn wants(&mut self, number: usize, topic: &Topic) -> Want;
    fn message(&mut self, topic: usize, log_time: u64, at: At, bytes: &[u8]);
}

/// What going through a bag came to.
#[derive(Clone, Debug, Default)]
pub(super) struct Looked {
    /// Messages that can be read, of all topics.
    pub(super) messages: u64,
    /// Those of a topic that nothing names.
    pub(super) unnamed: u64,
    /// What cannot be read, a sentence's second half each.
    pub(super) damages: Vec<String>,
    /// Whether tricurve wrote it.
    pub(super) is_own: bool,
}

impl Looked {
    pub(super) fn damage(&mut self, what: String) {
        self.damages.push(what);
    }
}

#[derive(Debug)]
enum Stored {
    Mcap(Mcap),
    Sqlite(Sqlite),
}

/// The files of a bag.
#[derive(Debug)]
pub(super) struct Files {
    files: Vec<(PathBuf, Stored)>,
    /// What was found amiss before any message was read.
    damages: Vec<String>,
    /// Those that lie in its folder, and that what rosbag2 says of it does not name.
    unnamed: Vec<String>,
    /// How many messages there should be, by topic, and in all.
    told: Option<Told>,
}

#[derive(Debug)]
struct Told {
    count: u64,
    topics: Vec<(String, u64)>,
}

/// What rosbag2 says of a bag in its `metadata.yaml`.
#[derive(Debug, Deserialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Information {
    relative_file_paths: Vec<String>,
    message_count: Option<u64>,
    topics_with_message_count: Vec<Counted>,
}

#[derive(Debug, Deserialize)]
struct Counted {
    topic_metadata: Named,
    message_count: u64,
}

#[derive(Debug, Deserialize)]
struct Named {
    name: String,
}

/// Whether a file's name ends like a bag's.
pub(super) fn is_bag_file(path: &Path) -> bool {
    let ends = |ending: &str| ending_of(path) == ending;
    ["mcap", "db3", "bag"].into_iter().any(ends)
        || packed_twin(path).is_some_and(|twin| is_bag_file(&twin))
}

fn ending_of(path: &Path) -> String {
    let ending = path.extension().map(OsStr::to_string_lossy);
    ending.unwrap_or_default().to_lowercase()
}

/// What a file is called once it is unpacked, when it is packed as a whole.
fn packed_twin(path: &Path) -> Option<PathBuf> {
    let is_packed = ["zstd", "zst", "lz4", "gz"].contains(&&*ending_of(path));
    is_packed.then(|| path.with_extension(""))
}

/// Whether rosbag2 says that a folder is a bag.
pub(super) fn is_recorded(folder: &Path) -> bool {
    let text = read_plain(&folder.join(METADATA));
    text.is_ok_and(|text| text.contains("rosbag2_bagfile_information"))
}

/// The bag files that lie in a folder, in the order of their names.
pub(super) fn files_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if is_bag_file(&path) && path.is_file() {
            files.push(path);
        }
    }
    names::sort(&mut files, |file| folder::name(file));
    Ok(files)
}

impl Files {
    /// Opens a file, or all files of a folder.
    pub(super) fn open(path: &Path) -> Result<Self, Why> {
        let io = |error: io::Error| error.to_string();
        let facts = fs::metadata(path).map_err(io)?;
        if !facts.is_dir() {
            return Ok(Self {
                files: vec![(path.to_owned(), stored(path)?)],
                damages: Vec::new(),
                unnamed: Vec::new(),
                told: None,
            });
        }
        let (mut damages, mut told) = (Vec::new(), None);
        let metadata = path.join(METADATA);
        let named = match read_plain(&metadata) {
            Ok(text) => match serde_saphyr::from_str::<Metadata>(&text) {
                Ok(read) => {
                    let read = read.rosbag2_bagfile_information;
                    told = read.message_count.map(|count| Told {
                        count,
                        topics: read
                            .topics_with_message_count
                            .into_iter()
                            .map(|one| (one.topic_metadata.name, one.message_count))
                            .collect(),
                    });
                    Some(read.relative_file_paths)
                }
                Err(_) => {
                    damages.push(format!(
                        "{METADATA} cannot be read, and all bag files beside it are taken"
                    ));
                    None
                }
            },
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                damages.push(format!(
                    "it has no {METADATA}, as of a recorder that was not ended, and all bag files in it are taken"
                ));
                None
            }
            Err(error) => return Err(format!("its {METADATA} cannot be read: {error}")),
        };
        let mut paths = Vec::new();
        for name in named.iter().flatten() {
            match found(path, Path::new(name)) {
                Some(found) => paths.push(found),
                None => damages.push(format!("{name}, which {METADATA} names, is missing")),
            }
        }
        let mut unnamed = Vec::new();
        match named.as_ref().is_none_or(Vec::is_empty) {
            true => paths = files_in(path).map_err(io)?,
            false => {
                // A file that was unpacked may still lie there as it was.
                let is_known = |file: &PathBuf| {
                    let twin = packed_twin(file);
                    let is_twin = |known: &PathBuf| packed_twin(known).as_ref() == Some(file);
                    paths.contains(file)
                        || twin.is_some_and(|twin| paths.contains(&twin))
                        || paths.iter().any(is_twin)
                };
                let others = files_in(path).map_err(io)?.into_iter();
                let others = others.filter(|file| !is_known(file));
                unnamed.extend(others.map(|file| folder::name(&file)));
            }
        }
        if paths.is_empty() {
            return Err(match damages.first() {
                Some(damage) if named.is_some() => match unnamed.is_empty() {
                    true => format!("{damage}, and nothing else is there"),
                    false => format!(
                        "{damage}; give {} itself if that is meant",
                        unnamed.join(" or ")
                    ),
                },
                _ => "it holds no .mcap and no .db3 file".to_owned(),
            });
        }
        let mut files = Vec::new();
        for path in paths {
            match stored(&path) {
                Ok(stored) => files.push((path, stored)),
                Err(why) if files.is_empty() && damages.is_empty() => {
                    return Err(format!("of {}: {why}", folder::name(&path)));
                }
                Err(why) => damages.push(format!("{}: {why}", folder::name(&path))),
            }
        }
        match files.is_empty() {
            false => Ok(Self {
                files,
                damages,
                unnamed,
                told,
            }),
            true => Err(damages.join("; ")),
        }
    }

    /// What is to be said of files that are not read.
    pub(super) fn unread(&self) -> Option<String> {
        let (is, it) = match self.unnamed.len() {
            0 => return None,
            1 => ("is", "it"),
            _ => ("are", "each"),
        };
        Some(format!(
            "{} {is} not read, for {METADATA} does not name {}: give {it} by itself, or run `ros2 bag reindex`",
            self.unnamed.join(", "),
            if is == "is" { "it" } else { "them" }
        ))
    }

    /// Goes through all messages once.
    pub(super) fn visit(
        &mut self,
        topics: &mut Topics,
        visit: &mut dyn Visit,
    ) -> Result<Looked, Why> {
        let mut looked = Looked::default();
        let (is_several, mut packed) = (self.files.len() > 1, Vec::new());
        let mut unpacking = Unpacking {
            visit,
            packed: &mut packed,
        };
        for (number, (path, stored)) in self.files.iter_mut().enumerate() {
            let mut own = Looked::default();
            match stored {
                Stored::Mcap(file) => {
                    file.visit(number, topics, &mut unpacking, &mut own)
                        .map_err(|error| error.to_string())?;
                    file.forget();
                }
                Stored::Sqlite(file) => file.visit(number, topics, &mut unpacking, &mut own)?,
            }
            looked.messages += own.messages;
            looked.unnamed += own.unnamed;
            looked.is_own |= own.is_own;
            let named = own.damages.into_iter().map(|damage| match is_several {
                true => format!("{}: {damage}", folder::name(path)),
                false => damage,
            });
            looked.damages.extend(named);
        }
        // Messages that rosbag2 packed one by one say nothing before they are unpacked.
        for (topic, log_time, at) in packed {
            match self.read(&at) {
                Ok(bytes) => visit.message(topic, log_time, at, &bytes),
                Err(why) => looked.damage(why),
            }
        }
        looked.damages.splice(0..0, self.damages.drain(..));
        if looked.unnamed > 0 {
            looked.damage(format!(
                "{} messages are of topics that nothing names",
                looked.unnamed
            ));
        }
        self.compare(topics, &mut looked);
        Ok(looked)
    }

    /// Compares what was found with what the recorder said at its end.
    fn compare(&self, topics: &Topics, looked: &mut Looked) {
        let Some(told) = &self.told else { return };
        for (name, count) in &told.topics {
            let of_topic = topics.iter().filter(|topic| topic.name == *name);
            let found: u64 = of_topic.map(|topic| topic.count).sum();
            if found < *count {
                looked.damage(format!(
                    "{found} of the {count} messages of {name} that {METADATA} tells are there"
                ));
            }
        }
        if told.topics.is_empty() && looked.messages < told.count {
            looked.damage(format!(
                "{} of the {} messages that {METADATA} tells are there",
                looked.messages, told.count
            ));
        }
    }

    /// The bytes of a message, unpacked.
    pub(super) fn read(&mut self, at: &At) -> Result<Vec<u8>, Why> {
        // What was read of files far from this one is not wanted again soon.
        for (number, (_, stored)) in self.files.iter_mut().enumerate() {
            if let Stored::Mcap(file) = stored
                && number.abs_diff(at.file) > 1
            {
                file.forget();
            }
        }
        let bytes = match &mut self.files[at.file].1 {
            Stored::Mcap(file) => file.read(at),
            Stored::Sqlite(file) => file.read(at),
        }?;
        match is_packed(&bytes) {
            false => Ok(bytes),
            true => zstd::stream::decode_all(&bytes[..])
                .map_err(|error| format!("it cannot be decompressed ({error})")),
        }
    }

    /// The file that a message lies in.
    pub(super) fn path(&self, at: &At) -> &Path {
        &self.files[at.file].0
    }
}

/// A message that is a zstd frame, as rosbag2 writes them with `--compression-mode message`. No message of ROS or protobuf
/// begins so.
fn is_packed(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x28, 0xb5, 0x2f, 0xfd])
}

/// Keeps packed messages back.
struct Unpacking<'a> {
    visit: &'a mut dyn Visit,
    packed: &'a mut Vec<(usize, u64, At)>,
}

impl Visit for Unpacking<'_> {
    fn wants(&mut self, number: usize, topic: &Topic) -> Want {
        self.visit.wants(number, topic)
    }

    fn message(&mut self, topic: usize, log_time: u64, at: At, bytes: &[u8]) {
        match is_packed(bytes) {
            true => self.packed.push((topic, log_time, at)),
            false => self.visit.message(topic, log_time, at, bytes),
        }
    }
}

/// Where a file lies that `metadata.yaml` names: some recorders wrote the folder's name before it, and files that were packed
/// may be unpacked since.
fn found(folder: &Path, name: &Path) -> Option<PathBuf> {
    let plain = folder.join(name.file_name()?);
    let unpacked = packed_twin(&plain);
    let places = unpacked.into_iter().chain([folder.join(name), plain]);
    places.into_iter().find(|path| path.is_file())
}

/// Opens a file by what it begins with.
fn stored(path: &Path) -> Result<Stored, Why> {
    let io = |error: io::Error| error.to_string();
    let mut file = File::open(path).map_err(io)?;
    let mut magic = Vec::new();
    file.by_ref().take(16).read_to_end(&mut magic).map_err(io)?;
    if magic.is_empty() {
        return Err("it is empty".to_owned());
    }
    if magic == sqlite::MAGIC {
        return Sqlite::open(path).map(Stored::Sqlite);
    }
    if magic.starts_with(b"#ROSBAG V") {
        return Err(
            "it is a bag of ROS 1; `mcap convert FILE.bag FILE.mcap`, or `rosbags-convert`, makes one that is read"
                .to_owned(),
        );
    }
    let twin = packed_twin(path).filter(|_| is_packed(&magic));
    if twin.is_some() || is_packed(&magic) {
        return Err(
            "it is packed as a whole; unpack it with `zstd -d`, and give the folder or the unpacked file"
                .to_owned(),
        );
    }
    match Mcap::open(file).map_err(io)? {
        Some(file) => Ok(Stored::Mcap(file)),
        None => Err("it is neither an MCAP file nor an SQLite database of rosbag2".to_owned()),
    }
}
