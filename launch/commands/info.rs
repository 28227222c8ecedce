//! `tricurve info`: what a recording holds.

use messages::Topic;
use record::{Info, Recording, settings_in_lines};
use serde::Serialize;

use super::proof;
use super::report::known;
use crate::cli::Info as Args;
use crate::{Failure, Outcome};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let mut recording = Recording::open(&args.file).map_err(Failure::failed)?;
    let mut info = Info::of(&recording);
    info.settings = settings_in_lines(&info.configuration, &known()?, args.settings);
    let check = args.check.then(|| Check::of(&mut recording, &info));
    let check = check.transpose()?;
    match (args.json, &check) {
        (true, check) => super::print_json(&Told { info: &info, check })?,
        (false, None) => super::print(&info.to_string())?,
        (false, Some(check)) => {
            let checked: String = check
                .checked
                .iter()
                .zip(std::iter::once("checked").chain(std::iter::repeat("")))
                .map(|(what, name)| format!("  {name:<13} {what}\n"))
                .collect();
            super::print(&format!("{info}\n{checked}"))?;
        }
    }
    let failures = check.map_or_else(Vec::new, |check| check.failures);
    for failure in &failures {
        crate::say!("tricurve: check: {failure}");
    }
    Ok(match failures.is_empty() {
        true => Outcome::Done,
        false => Outcome::Lost,
    })
}

/// What is told as JSON.
#[derive(Serialize)]
struct Told<'a> {
    #[serde(flatten)]
    info: &'a Info,
    #[serde(skip_serializing_if = "Option::is_none")]
    check: &'a Option<Check>,
}

/// What was checked, and what does not hold.
#[derive(Debug, Serialize)]
struct Check {
    /// What was looked at, a sentence each.
    checked: Vec<String>,
    /// What does not hold, a sentence each.
    failures: Vec<String>,
}

impl Check {
    /// Reads all of it.
    fn of(recording: &mut Recording, info: &Info) -> Result<Self, Failure> {
        let scans: Vec<u64> = recording.scans().collect();
        let (mut messages, mut bytes, mut first) = (0, 0, None);
        let mut contradicted = Vec::new();
        for &scan in &scans {
            let (read, lost) = recording.salvage(scan).map_err(Failure::failed)?;
            messages += read.messages().count();
            if !read.contradicted.is_empty() {
                contradicted.push(scan);
            }
            recording.reuse(read);
            if lost > 0 {
                bytes += lost;
                first.get_or_insert(scan);
            }
        }
        let mut failures = info.failures();
        let mut faults = Vec::new();
        if info.proof {
            let knows_settings = recording.metadata().knows_settings();
            for &scan in &scans {
                match proof::faults_of(recording, scan, knows_settings) {
                    Ok(found) => faults.extend(found),
                    Err(failure) => faults.push(failure.text),
                }
            }
        }
        failures.extend(faults);
        failures.extend(first.map(|scan| {
            format!(
                "{bytes} bytes are damaged, the first in scan {scan}: recover writes what is readable"
            )
        }));
        if let Some(scan) = contradicted.first() {
            failures.push(format!(
                "{} scans have two different messages of a topic, the first is scan {scan}: recordings with the same \
                 numbers and times were merged",
                contradicted.len()
            ));
        }
        let contents = recording.parts.iter().map(|part| &part.contents);
        let chunks: usize = contents.clone().map(|contents| contents.chunks.len()).sum();
        let runs: usize = contents.map(|contents| contents.runs.len()).sum();
        let sums = match (chunks, runs) {
            (chunks, 0) => format!("and the checksums of their {chunks} chunks compared"),
            (0, _) => "which stand outside of chunks and have no checksums".to_owned(),
            (chunks, _) => format!(
                "and the checksums of {chunks} chunks compared; some stand outside of chunks and have none"
            ),
        };
        let held = recording.channels();
        let topics = Topic::all(&recording.metadata().rig);
        let topics = topics
            .iter()
            .filter(|topic| held.contains_key(&*topic.name))
            .count();
        let cameras = recording.metadata().rig.views.len();
        let mut checked = vec![
            format!(
                "all {messages} messages of {} scans were read, {sums}",
                scans.len()
            ),
            format!("whether each scan has a message of each of the {topics} data topics recorded"),
            format!(
                "whether numbers are missing among the scans: {}",
                recording.held()
            ),
            "whether files are unfinished, torn, damaged or missing".to_owned(),
            format!("whether the calibration of each of {cameras} cameras is there"),
            "whether the run came to its end, and its ledger balances".to_owned(),
        ];
        if info.proof {
            checked.push(
                "whether what it holds and its settings are what the digests say; what it does not hold was not computed"
                    .to_owned(),
            );
        }
        Ok(Self { checked, failures })
    }
}
