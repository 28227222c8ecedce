//! One file of a recording.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read as _, Seek as _};
use std::path::{Path, PathBuf};

use mcap::McapError;

use super::error::ReadError;
use super::file::{Contents, Group};
use super::metadata::{Identity, Metadata, NAME};
use super::names::{Prefix, is_ours, is_telling};
use super::scans::{Block, Place};

/// One file of a recording.
#[derive(Debug)]
pub struct Part {
    /// Where it lies.
    pub path: PathBuf,
    pub(super) file: File,
    /// Its length.
    pub bytes: u64,
    /// What it holds.
    pub contents: Contents,
    /// Of a part that others wrote what its chunks hold.
    pub(super) looked: Option<Vec<Result<Vec<Group>, McapError>>>,
    /// Its channels of topics that are none of a recording's, where others wrote it.
    pub(super) foreign: BTreeSet<u16>,
    /// What its topics had in front of their names.
    pub(super) prefix: Prefix,
}

/// What a file says it is.
pub(super) struct SaidItIs {
    pub(super) metadata: Metadata,
    pub(super) identity: Identity,
    /// How many recordings others merged into it.
    pub(super) recordings: usize,
}

impl Part {
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let io_error = |source| ReadError::Io {
            path: path.to_owned(),
            source,
        };
        let mut file = File::open(path).map_err(io_error)?;
        let metadata = file.metadata().map_err(io_error)?;
        if metadata.is_dir() {
            return Err(io_error(io::ErrorKind::IsADirectory.into()));
        }
        let bytes = metadata.len();
        let mut contents = match Contents::of(&mut file).map_err(io_error)? {
            Some(contents) => contents,
            None if is_beginning(&mut file, bytes) => {
                return Err(ReadError::Empty(path.to_owned()));
            }
            None => return Err(ReadError::NotMcap(path.to_owned())),
        };
        let mut part = Self {
            path: path.to_owned(),
            looked: None,
            foreign: BTreeSet::new(),
            prefix: Prefix::default(),
            bytes,
            contents: Contents::default(),
            file,
        };
        if !contents.is_indexed {
            part.looked = Some(contents.look_through(&mut part.file));
            let topics = contents.channels.values().map(|c| c.topic.as_str());
            part.prefix = Prefix::of(topics);
            for channel in contents.channels.values_mut() {
                channel.topic = part.prefix.without(&channel.topic).to_owned();
            }
            let is_foreign = |channel: &&mcap::records::Channel| !is_ours(&channel.topic);
            let foreign = contents.channels.values().filter(is_foreign);
            part.foreign = foreign.map(|channel| channel.id).collect();
        }
        part.contents = contents;
        Ok(part)
    }

    /// The topics that a scan has in a place.
    pub(super) fn topics<'a>(&'a self, place: &Place) -> impl Iterator<Item = &'a str> + use<'a> {
        let contents = &self.contents;
        let ids: Vec<u16> = match (&place.channels, place.block) {
            (Some(channels), _) => channels.to_vec(),
            (None, Block::Chunk(chunk)) => {
                let offsets = &contents.chunks[chunk].message_index_offsets;
                offsets.keys().copied().collect()
            }
            (None, Block::Run(run)) => contents.runs[run].group.channels.clone(),
        };
        let channels = ids.into_iter().filter_map(|id| contents.channels.get(&id));
        channels.map(|channel| channel.topic.as_str())
    }

    /// What it says about itself; `None` when that was left out of what is a recording otherwise.
    pub(super) fn metadata(&self) -> Result<Option<SaidItIs>, ReadError> {
        let records = self.contents.metadata.iter().map(|(_, record)| record);
        let own: Vec<_> = records.filter(|record| record.name == NAME).collect();
        let mut all = Vec::new();
        for record in own {
            let said = Metadata::from_record(record).map_err(|source| ReadError::Metadata {
                path: self.path.clone(),
                source,
            })?;
            all.push(said);
        }
        let names: BTreeSet<&str> = all.iter().map(|(_, i)| i.recording.as_str()).collect();
        let recordings = names.len();
        let mixed = |what| ReadError::Mixed {
            path: self.path.clone(),
            count: recordings,
            what,
        };
        let Some((first, others)) = all.split_first() else {
            return self.without_metadata().map(|()| None);
        };
        for (other, _) in others {
            if other.rig != first.0.rig {
                return Err(mixed("rigs (views, channels, image size or calibration)"));
            }
            if other.computing() != first.0.computing() {
                return Err(mixed("settings"));
            }
        }
        let (metadata, identity) = first.clone();
        Ok(Some(SaidItIs {
            metadata,
            identity,
            recordings,
        }))
    }

    /// Whether a file without our metadata is a recording all the same.
    fn without_metadata(&self) -> Result<(), ReadError> {
        let contents = &self.contents;
        let topics = contents.channels.values().map(|c| c.topic.as_str());
        let topics: BTreeSet<_> = topics.collect();
        let library = contents.library.clone();
        if topics.is_empty() && (library.is_empty() || library.starts_with(NAME)) {
            return Err(ReadError::Empty(self.path.clone()));
        }
        // Only recordings have messages of ours.
        let mut schemas = contents.schemas.values();
        let prefix = format!("{NAME}.");
        let has_ours = schemas.any(|schema| schema.name.starts_with(&prefix));
        match has_ours || topics.iter().any(|topic| is_telling(topic)) {
            true => Ok(()),
            false => Err(ReadError::Foreign {
                path: self.path.clone(),
                library,
                topics: topics.into_iter().collect::<Vec<_>>().join(", "),
            }),
        }
    }
}

/// Whether a file too short to be MCAP is the beginning of one.
fn is_beginning(file: &mut File, bytes: u64) -> bool {
    let mut read = vec![0; bytes.min(mcap::MAGIC.len() as u64) as usize];
    bytes < mcap::MAGIC.len() as u64
        && file.rewind().is_ok()
        && file.read_exact(&mut read).is_ok()
        && mcap::MAGIC.starts_with(&read)
}
