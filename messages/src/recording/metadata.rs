//! What a recording says about itself, before its first message.

use std::collections::BTreeMap;

use crate::change::Change;
use crate::ledger::Ledger;
use crate::{Rig, Size, Stage};
use mcap::records;
use thiserror::Error;

/// The name of the metadata record.
pub const NAME: &str = "tricurve";
/// The name of the record with the ledger, at the end.
pub(super) const LEDGER: &str = "tricurve.ledger";
/// The name of the record with the settings that were changed.
pub(super) const CHANGES: &str = "tricurve.changes";
/// What this program writes and reads.
const FORMAT: &str = "1";

/// What a recording says about itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    /// Version and build of the program.
    pub version: String,
    /// The graph, as its file or as Mermaid.
    pub graph: String,
    /// The effective configuration.
    pub configuration: serde_json::Value,
    /// Views, channels, calibration, largest image.
    pub rig: Rig,
    /// Index of the view that disparities and points belong to.
    pub reference: usize,
    /// Where the scans come from.
    pub source: String,
    /// The scans' names, where they have some.
    pub scans: Vec<String>,
}

/// What tells the parts of one recording from those of another.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// A name of its own, made up when the recording began.
    pub recording: String,
    /// Which part, from 0.
    pub part: u32,
}

/// Why a recording's metadata says nothing.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MetadataError {
    /// A key is not there.
    #[error("its metadata does not say its {0}")]
    Missing(&'static str),
    /// A key's value is not what it should be.
    #[error("its metadata's {0} is not readable")]
    Unreadable(&'static str),
    /// A later program wrote it.
    #[error("it is written in format {0}, and this program reads format {FORMAT}; use a newer one")]
    Format(String),
}

impl Metadata {
    /// Of a recording that says nothing about itself.
    pub(super) fn unknown() -> Self {
        Self {
            version: String::new(),
            graph: String::new(),
            configuration: serde_json::Value::Null,
            rig: Rig::of_views(0, &[], Size::new(0, 0)),
            reference: 0,
            source: String::new(),
            scans: Vec::new(),
        }
    }

    /// Whether it says with which settings its scans were computed.
    pub fn knows_settings(&self) -> bool {
        self.configuration.is_object()
    }

    /// The settings of the stages that compute, in their order.
    pub fn computing(&self) -> Vec<(&'static str, Option<&serde_json::Value>)> {
        let stages = Stage::computing().into_iter().map(Stage::name);
        stages
            .map(|stage| (stage, self.configuration.get(stage)))
            .collect()
    }

    /// As the record that stands in the file.
    pub fn to_record(&self, identity: &Identity) -> records::Metadata {
        let calibrated = self.rig.calibration.is_some_and(|camera| camera.calibrated);
        let reference = self.rig.views.get(self.reference);
        let pairs = [
            ("format", FORMAT.to_owned()),
            ("version", self.version.clone()),
            ("graph", self.graph.clone()),
            ("configuration", self.configuration.to_string()),
            ("rig", json(&self.rig)),
            (
                "reference",
                reference.map_or(String::new(), |view| view.name.clone()),
            ),
            ("source", self.source.clone()),
            ("scans", json(&self.scans)),
            ("calibrated", calibrated.to_string()),
            ("recording", identity.recording.clone()),
            ("part", identity.part.to_string()),
        ];
        let pairs = pairs.map(|(key, value)| (key.to_owned(), value));
        records::Metadata {
            name: NAME.to_owned(),
            metadata: BTreeMap::from(pairs),
        }
    }

    /// Back from its record.
    ///
    /// # Errors
    /// When something is missing, unreadable or of a later format.
    pub fn from_record(record: &records::Metadata) -> Result<(Self, Identity), MetadataError> {
        let text = |key: &'static str| {
            record
                .metadata
                .get(key)
                .cloned()
                .ok_or(MetadataError::Missing(key))
        };
        let format = text("format")?;
        if format != FORMAT {
            return Err(MetadataError::Format(format));
        }
        let rig: Rig = parse("rig", &text("rig")?)?;
        if !is_possible(&rig) {
            return Err(MetadataError::Unreadable("rig"));
        }
        let name = text("reference")?;
        let reference = rig.views.iter().position(|view| view.name == name);
        let metadata = Self {
            version: text("version")?,
            graph: text("graph")?,
            configuration: parse("configuration", &text("configuration")?)?,
            reference: reference.ok_or(MetadataError::Unreadable("reference"))?,
            source: text("source")?,
            scans: parse("scans", &text("scans")?)?,
            rig,
        };
        let part = text("part")?
            .parse()
            .map_err(|_| MetadataError::Unreadable("part"))?;
        Ok((
            metadata,
            Identity {
                recording: text("recording")?,
                part,
            },
        ))
    }
}

/// Which scans a part holds, in the order they stand, so that nobody has to look into its chunks to know.
///
/// A chunk's index says its time, not its scan. As long as scans that follow each other have different times, the times
/// of the chunks and this order together say which chunk is of which scan.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScanOrder {
    /// First and last scan of runs without gaps.
    runs: Vec<(u64, u64)>,
    latest: Option<(u64, u64)>,
    is_ambiguous: bool,
}

impl ScanOrder {
    /// The name of the metadata record.
    pub const NAME: &str = "tricurve.scans";

    /// A scan of this time was written.
    pub fn push(&mut self, sequence: u64, nanos: u64) {
        if self.latest == Some((sequence, nanos)) {
            return;
        }
        self.is_ambiguous |= self.latest.is_some_and(|(_, latest)| latest == nanos);
        self.latest = Some((sequence, nanos));
        match self.runs.last_mut() {
            Some((_, last)) if *last + 1 == sequence => *last = sequence,
            _ => self.runs.push((sequence, sequence)),
        }
    }

    /// Its record, when it tells everything.
    pub fn to_record(&self) -> Option<records::Metadata> {
        let runs = self
            .runs
            .iter()
            .map(|(first, last)| format!("{first}-{last}"));
        let metadata = BTreeMap::from([("order".to_owned(), runs.collect::<Vec<_>>().join(","))]);
        (!self.is_ambiguous && !self.runs.is_empty()).then(|| records::Metadata {
            name: Self::NAME.to_owned(),
            metadata,
        })
    }

    /// The scans in its record, in order, when there are so many.
    pub fn from_record(record: &records::Metadata, count: usize) -> Option<Vec<u64>> {
        let mut scans = Vec::new();
        for run in record.metadata.get("order")?.split(',') {
            let (first, last) = run.split_once('-')?;
            let run = first.parse::<u64>().ok()?..=last.parse::<u64>().ok()?;
            // Damaged numbers must not fill the memory.
            scans.extend(run.take(count + 1 - scans.len().min(count)));
        }
        (scans.len() == count).then_some(scans)
    }
}

/// More of anything than a rig has; a damaged number must not fill the memory.
pub(super) fn is_possible(rig: &Rig) -> bool {
    const MOST: usize = 256;
    const MOST_SIDE: u32 = 1 << 20;
    const MOST_PIXELS: u64 = 1 << 28;
    let Size { width, height } = rig.size;
    let sides = 1..=MOST_SIDE;
    sides.contains(&width)
        && sides.contains(&height)
        && u64::from(width) * u64::from(height) <= MOST_PIXELS
        && (1..=MOST).contains(&rig.views.len())
        && (1..=MOST).contains(&rig.channels.len())
}

/// The ledger's record.
pub fn ledger_record(ledger: &Ledger) -> records::Metadata {
    let metadata = BTreeMap::from([("ledger".to_owned(), json(ledger))]);
    records::Metadata {
        name: LEDGER.to_owned(),
        metadata,
    }
}

/// The record of all changes of settings so far.
pub fn changes_record(changes: &[Change]) -> records::Metadata {
    let metadata = BTreeMap::from([("changes".to_owned(), json(&changes))]);
    records::Metadata {
        name: CHANGES.to_owned(),
        metadata,
    }
}

/// The changes in their record.
pub(super) fn changes(record: &records::Metadata) -> Option<Vec<Change>> {
    serde_json::from_str(record.metadata.get("changes")?).ok()
}

/// The ledger in its record.
pub(super) fn ledger(record: &records::Metadata) -> Option<Ledger> {
    serde_json::from_str(record.metadata.get("ledger")?).ok()
}

fn json(value: &impl serde::Serialize) -> String {
    // Plain data: nothing in it can fail to serialize.
    serde_json::to_string(value).unwrap_or_default()
}

fn parse<T: serde::de::DeserializeOwned>(
    key: &'static str,
    text: &str,
) -> Result<T, MetadataError> {
    serde_json::from_str(text).map_err(|_| MetadataError::Unreadable(key))
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn metadata() -> Metadata {
        Metadata {
            version: "0.1.0".to_owned(),
            graph: "graph LR".to_owned(),
            configuration: serde_json::json!({ "filter": { "channels": [30.0] } }),
            rig: Rig::of_views(3, &[30.0, 1.5], Size::new(64, 48)),
            reference: 1,
            source: "scene:tab".to_owned(),
            scans: vec!["tab".to_owned()],
        }
    }

    #[test]
    fn metadata_comes_back() {
        let identity = Identity {
            recording: "a1".to_owned(),
            part: 2,
        };
        let record = metadata().to_record(&identity);
        assert_eq!(
            Metadata::from_record(&record).unwrap(),
            (metadata(), identity)
        );
        assert_eq!(record.metadata["calibrated"], "false");
    }

    #[test]
    fn what_is_missing_or_strange_is_named() {
        let mut record = metadata().to_record(&Identity::default());
        record.metadata.insert("rig".to_owned(), "{}".to_owned());
        let error = Metadata::from_record(&record).unwrap_err();
        assert_eq!(error, MetadataError::Unreadable("rig"));
        record.metadata.remove("rig");
        assert_eq!(
            Metadata::from_record(&record).unwrap_err(),
            MetadataError::Missing("rig")
        );
        record.metadata.insert("format".to_owned(), "9".to_owned());
        let error = Metadata::from_record(&record).unwrap_err().to_string();
        assert!(error.contains("format 9"), "{error}");
    }

    #[test]
    fn the_order_of_scans_comes_back_unless_times_do_not_tell_it() {
        let mut order = ScanOrder::default();
        for (sequence, nanos) in [(3, 10), (4, 20), (4, 20), (9, 30), (5, 40)] {
            order.push(sequence, nanos);
        }
        let record = order.to_record().unwrap();
        assert_eq!(ScanOrder::from_record(&record, 4), Some(vec![3, 4, 9, 5]));
        assert_eq!(ScanOrder::from_record(&record, 3), None);
        assert_eq!(ScanOrder::from_record(&record, 5), None);
        order.push(6, 40);
        assert_eq!(order.to_record(), None);
        let mut damaged = record.clone();
        damaged
            .metadata
            .insert("order".to_owned(), "0-18446744073709551615".to_owned());
        assert_eq!(ScanOrder::from_record(&damaged, 4), None);
    }
}
