//! What a recording holds, for people and for programs.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use messages::Rig;
use messages::change::Change;
use messages::ledger::Ledger;
use messages::record::Shown;
use serde::Serialize;

use crate::Recording;

/// What a recording holds.
#[derive(Clone, Debug, Serialize)]
pub struct Info {
    /// The path of its first part.
    pub path: PathBuf,
    /// Whether all its parts are finished and nothing is left out.
    pub complete: bool,
    /// What is wrong with it, a sentence each.
    pub notes: Vec<String>,
    /// How it was read, where others rewrote it, a sentence each: nothing is missing for that.
    pub remarks: Vec<String>,
    /// Version and build of the program that wrote it.
    pub version: String,
    /// Where its scans come from.
    pub source: String,
    /// Whether it is a proof: of what it does not hold it has the digests.
    pub proof: bool,
    /// Whether depths are in metres; without a calibration they are right up to one factor.
    pub calibrated: bool,
    /// Its files.
    pub parts: Vec<PartInfo>,
    /// Its scans.
    pub scans: ScansInfo,
    /// When its first scan was taken, in nanoseconds since 1970.
    pub start_nanos: Option<u64>,
    /// From its first scan to its last.
    pub duration_seconds: f64,
    /// Its topics, in the order of a scan.
    pub topics: Vec<TopicInfo>,
    /// The views, channels and calibration.
    pub rig: Rig,
    /// Name of the view that disparities and points belong to.
    pub reference: String,
    /// The effective configuration, as it was when the run began.
    pub configuration: serde_json::Value,
    /// The lines in which it is printed; none unless they are given.
    #[serde(skip)]
    pub settings: Vec<String>,
    /// The settings that were changed while it was recorded, in order.
    pub changes: Vec<Change>,
    /// The graph.
    pub graph: String,
    /// The run's account, when it came to its end.
    pub ledger: Option<Ledger>,
    /// Whether that account balances.
    pub balanced: Option<bool>,
    /// What in it does not balance, a sentence each.
    pub faults: Vec<String>,
}

/// No more changes are printed: a slider that is drawn makes hundreds. JSON has all.
const MOST_CHANGES: usize = 50;
/// No more missing scans are named: a damaged number must not fill the memory.
const MOST_NAMED: usize = 1000;

/// One file of a recording.
#[derive(Clone, Debug, Serialize)]
pub struct PartInfo {
    /// Its path.
    pub path: PathBuf,
    /// Its length.
    pub bytes: u64,
    /// Whether it ends as it should.
    pub finished: bool,
}

/// The scans of a recording.
#[derive(Clone, Debug, Serialize)]
pub struct ScansInfo {
    /// All of which there is something.
    pub total: usize,
    /// Those that have a message of every data topic.
    pub whole: usize,
    /// Those that have not.
    pub partial: Vec<u64>,
    /// Numbers missing between the first and the last; of very many only the first.
    pub missing: Vec<u64>,
    /// The scans' names, where they have some.
    pub names: Vec<String>,
}

/// One topic of a recording.
#[derive(Clone, Debug, Serialize)]
pub struct TopicInfo {
    /// Its name.
    pub topic: String,
    /// Its messages' schema.
    pub schema: String,
    /// How they are encoded: `protobuf` or `json`.
    pub encoding: String,
    /// How many there are, each scan's counted once.
    pub count: u64,
    /// Messages in a second of recorded time; zero of one message alone.
    pub rate_hz: f64,
}

impl Info {
    /// Of a recording, from its index alone.
    pub fn of(recording: &Recording) -> Self {
        let metadata = recording.metadata();
        let whole = recording.whole_scans();
        let scans: Vec<u64> = recording.scans().collect();
        let nanos = |scan: Option<&u64>| scan.and_then(|&scan| recording.nanos(scan));
        let (start, end) = (nanos(scans.first()), nanos(scans.last()));
        let duration = end.unwrap_or(0).saturating_sub(start.unwrap_or(0)) as f64 / 1e9;
        let ledger = recording.ledger();
        let faults = ledger.as_ref().map_or_else(Vec::new, Ledger::faults);
        let camera = metadata.rig.calibration;
        let gaps = scans.windows(2).flat_map(|pair| pair[0] + 1..pair[1]);
        Self {
            path: recording.path().to_owned(),
            complete: recording.is_complete() && ledger.is_some(),
            notes: recording.notes().to_vec(),
            remarks: recording.remarks().to_vec(),
            version: metadata.version.clone(),
            source: metadata.source.clone(),
            proof: recording.is_proof(),
            calibrated: camera.is_some_and(|camera| camera.calibrated),
            parts: recording
                .parts
                .iter()
                .map(|part| PartInfo {
                    path: part.path.clone(),
                    bytes: part.bytes,
                    finished: part.contents.is_finished,
                })
                .collect(),
            scans: ScansInfo {
                total: scans.len(),
                whole: whole.len(),
                partial: scans
                    .iter()
                    .copied()
                    .filter(|s| whole.binary_search(s).is_err())
                    .collect(),
                missing: gaps.take(MOST_NAMED).collect(),
                names: metadata.scans.clone(),
            },
            start_nanos: start,
            duration_seconds: duration,
            topics: topics(recording, duration),
            rig: metadata.rig.clone(),
            reference: metadata.rig.views[metadata.reference].name.clone(),
            configuration: metadata.configuration.clone(),
            settings: Vec::new(),
            changes: recording.changes(),
            graph: metadata.graph.clone(),
            balanced: ledger.as_ref().map(|_| faults.is_empty()),
            ledger,
            faults,
        }
    }
}

impl Info {
    /// What makes the recording less than it should be, a sentence each: whether it is complete, its scans whole and
    /// without gaps, its cameras known, its ledger balanced.
    pub fn failures(&self) -> Vec<String> {
        let mut failures = self.notes.clone();
        if self.ledger.is_none() {
            let why = match self.configuration.is_object() {
                true => "the run did not come to its end: there is no ledger",
                false => "nobody knows whether the run came to its end: there is no ledger",
            };
            failures.push(why.to_owned());
        }
        failures.extend(self.faults.iter().cloned());
        let scans = &self.scans;
        if scans.total == 0 {
            failures.push("there are no scans".to_owned());
        }
        if !scans.partial.is_empty() {
            failures.push(format!("scans {} lack messages", some_of(&scans.partial)));
        }
        if !scans.missing.is_empty() {
            failures.push(format!("scans {} are missing", some_of(&scans.missing)));
        }
        for view in &self.rig.views {
            let name = format!("camera/{}/calibration", view.name);
            let count = self.topics.iter().find(|topic| topic.topic == name);
            if count.is_none_or(|topic| topic.count == 0) {
                failures.push(format!("there is no {name}"));
            }
        }
        failures
    }
}

fn topics(recording: &Recording, duration: f64) -> Vec<TopicInfo> {
    let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
    for (_, topics) in recording.topics_by_scan() {
        for topic in topics {
            *counts.entry(topic).or_default() += 1;
        }
    }
    let places = recording.codec().channels(Shown::RECORDED);
    let place = |topic: &str| places.iter().position(|channel| channel.name == topic);
    let mut all: Vec<_> = recording.channels().into_iter().collect();
    all.sort_by_key(|(topic, _)| (place(topic).unwrap_or(usize::MAX), *topic));
    let info =
        |(topic, (encoding, schema)): (&str, (&str, Option<&messages::recording::FileSchema>))| {
            let count = counts.get(topic).copied().unwrap_or(0);
            let steps = count.saturating_sub(1) as f64;
            TopicInfo {
                topic: topic.to_owned(),
                schema: schema.map_or(String::new(), |schema| schema.name.clone()),
                encoding: encoding.to_owned(),
                count,
                rate_hz: if duration > 0.0 {
                    steps / duration
                } else {
                    0.0
                },
            }
        };
    all.into_iter().map(info).collect()
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let complete = if self.complete {
            "complete"
        } else {
            "INCOMPLETE"
        };
        writeln!(f, "{}: {complete}", self.path.display())?;
        for note in &self.notes {
            writeln!(f, "  ! {note}")?;
        }
        for remark in &self.remarks {
            writeln!(f, "  · {remark}")?;
        }
        if self.parts.len() > 1 || self.parts.iter().any(|part| !part.finished) {
            for part in &self.parts {
                let state = if part.finished {
                    "finished"
                } else {
                    "unfinished"
                };
                writeln!(
                    f,
                    "  {} {}, {state}",
                    part.path.display(),
                    bytes(part.bytes)
                )?;
            }
        }
        let line = |f: &mut fmt::Formatter<'_>, name: &str, value: &str| {
            writeln!(f, "  {name:<13} {value}")
        };
        let or_not = |known: &str, text: String| match known.is_empty() {
            true => "not known".to_owned(),
            false => text,
        };
        let by = or_not(&self.version, format!("tricurve {}", self.version));
        line(f, "written by", &by)?;
        if self.proof {
            line(
                f,
                "proof",
                "of what is not in it there are digests: `tricurve rehydrate` computes it and writes a full recording",
            )?;
        }
        line(f, "source", &or_not(&self.source, self.source.clone()))?;
        line(
            f,
            "size",
            &bytes(self.parts.iter().map(|part| part.bytes).sum()),
        )?;
        let start = self.start_nanos.map_or_else(|| "—".to_owned(), date);
        line(f, "start", &start)?;
        line(f, "duration", &format!("{:.3} s", self.duration_seconds))?;
        let mut scans = format!("{} of {} whole", self.scans.whole, self.scans.total);
        for (which, list) in [
            ("partial", &self.scans.partial),
            ("missing", &self.scans.missing),
        ] {
            if !list.is_empty() {
                scans += &format!("; {which}: {}", some_of(list));
            }
        }
        line(f, "scans", &scans)?;
        let names: Vec<_> = self
            .rig
            .views
            .iter()
            .map(|view| view.name.as_str())
            .collect();
        line(
            f,
            "views",
            &format!("{}; reference {}", names.join(", "), self.reference),
        )?;
        let channels: Vec<_> = self.rig.channels.iter().map(f32::to_string).collect();
        line(f, "channels", &format!("σ² {}", channels.join(", ")))?;
        let camera = self.rig.calibration(self.rig.size);
        let calibration = format!(
            "f {} px, c ({}, {}), b {}{}",
            camera.focal_px,
            camera.cx,
            camera.cy,
            self.rig.shown_baseline(self.rig.size),
            if self.calibrated {
                ""
            } else {
                " (assumed: depths are right up to one factor)"
            },
        );
        line(f, "calibration", &calibration)?;
        let ledger = match self.balanced {
            Some(true) => "balanced".to_owned(),
            Some(false) => format!("NOT BALANCED: {}", self.faults.join("; ")),
            None if self.configuration.is_object() => {
                "none: the run did not come to its end".to_owned()
            }
            None => "none".to_owned(),
        };
        line(f, "ledger", &ledger)?;
        if !self.configuration.is_object() {
            line(f, "settings", "not known")?;
        }
        let names = std::iter::once("settings").chain(std::iter::repeat(""));
        for (name, setting) in names.zip(&self.settings) {
            line(f, name, setting)?;
        }
        for change in self.changes.iter().take(MOST_CHANGES) {
            line(f, "changed", &change.to_string())?;
        }
        let more = self.changes.len().saturating_sub(MOST_CHANGES);
        if more > 0 {
            line(f, "changed", &format!("and {more} times more"))?;
        }

        let width = self
            .topics
            .iter()
            .map(|t| t.topic.len())
            .max()
            .unwrap_or(0)
            .max(5);
        let schema = self
            .topics
            .iter()
            .map(|t| t.schema.len())
            .max()
            .unwrap_or(0)
            .max(6);
        writeln!(
            f,
            "\n  {:<width$}  {:<schema$}  {:<8} {:>6} {:>7}",
            "topic", "schema", "encoding", "count", "rate Hz"
        )?;
        for t in &self.topics {
            writeln!(
                f,
                "  {:<width$}  {:<schema$}  {:<8} {:>6} {:>7.2}",
                t.topic, t.schema, t.encoding, t.count, t.rate_hz
            )?;
        }
        Ok(())
    }
}

/// The first few of a list.
pub(crate) fn some_of(list: &[u64]) -> String {
    let shown: Vec<_> = list.iter().take(10).map(u64::to_string).collect();
    let more = if list.len() > 10 {
        format!(" and {} more", list.len() - 10)
    } else {
        String::new()
    };
    shown.join(", ") + &more
}

pub(crate) fn bytes(count: u64) -> String {
    let count = count as f64;
    match count {
        c if c >= 1e9 => format!("{:.2} GB", c / 1e9),
        c if c >= 1e6 => format!("{:.1} MB", c / 1e6),
        c if c >= 1e3 => format!("{:.1} kB", c / 1e3),
        c => format!("{c} B"),
    }
}

/// A time in nanoseconds since 1970 as people write it.
pub(crate) fn date(nanos: u64) -> String {
    jiff::Timestamp::from_nanosecond(i128::from(nanos)).map_or_else(
        |_| format!("{nanos} ns"),
        |time| time.strftime("%Y-%m-%d %H:%M:%S%.3f UTC").to_string(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        assert_eq!(
            date(1_700_000_000_123_000_000),
            "2023-11-14 22:13:20.123 UTC"
        );
        assert_eq!(date(u64::MAX), "2554-07-21 23:34:33.709 UTC");
    }

    #[test]
    fn lists_and_sizes_are_short() {
        assert_eq!(some_of(&[1, 5]), "1, 5");
        assert!(some_of(&(0..20).collect::<Vec<_>>()).ends_with("8, 9 and 10 more"));
        assert_eq!(
            [bytes(12), bytes(1_500), bytes(2_500_000_000)],
            ["12 B", "1.5 kB", "2.50 GB"]
        );
    }
}
