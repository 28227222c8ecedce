//! Which scans of a recording are replayed, and as which.

use messages::recording::Recording;
use messages::{Kind, Stage, Topic};

/// The scans that are replayed, and their topics.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// Their topics; a scan may lack those that nobody takes.
    pub topics: Vec<Topic>,
    /// The recording's scans, in order, with their times in nanoseconds since 1970.
    pub scans: Vec<(u64, u64)>,
    /// How many scans of the range lack one of the topics.
    pub broken: usize,
    /// How many of the scans, the first ones, are played only because those after them depend on them.
    pub lead: usize,
}

/// What is to be selected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The first stage that computes anew.
    pub from: Stage,
    /// The kinds of message that somebody takes: of what is replayed, a scan must have these.
    pub taken: Vec<Kind>,
    /// The recording's scan to begin with.
    pub first: u64,
    /// The recording's scan before which to end.
    pub end: Option<u64>,
    /// How many scans before the first are replayed too, where they are there one after the other.
    pub before: u64,
    /// Whether scans must have all that was recorded of others, not only what is taken.
    pub whole: bool,
}

/// Why a recording cannot be replayed so.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SelectionError {
    /// The recording has no messages of a kind that is needed.
    #[error("to replay from {from} needs {missing}, which the recording does not hold; {possible}")]
    Cut {
        /// The cut that was wanted.
        from: &'static str,
        /// What is missing.
        missing: String,
        /// Which cuts there could be.
        possible: String,
    },
    /// No scan is left.
    #[error(
        "no whole scan to replay: the recording holds {held}, and scans {first} to {end} are wanted"
    )]
    Empty {
        /// The scans there are.
        held: String,
        /// The first wanted.
        first: u64,
        /// Where the wanted ones end.
        end: String,
    },
}

/// The kinds of message that are replayed when this stage is the first that computes anew. Images are never computed.
pub fn replayed_kinds(from: Stage) -> Vec<Kind> {
    let is_played = |kind: &Kind| {
        let stage = kind.stage();
        stage == Stage::CAPTURE || !stage.follows(from)
    };
    Kind::all().filter(is_played).collect()
}

/// The kinds of message that these stages, after this cut, need of what is replayed.
fn needed_kinds(from: Stage, stages: &[Stage]) -> Vec<Kind> {
    let mut kinds = replayed_kinds(from);
    kinds.retain(|kind| stages.iter().any(|stage| stage.takes().contains(kind)));
    kinds
}

/// Whether the recording holds what these stages, the first of which is `from`, need of those before.
///
/// # Errors
/// When it does not: with the cuts that are possible.
pub fn check_cut(
    recording: &Recording,
    from: Stage,
    stages: &[Stage],
) -> Result<(), SelectionError> {
    check_needed(recording, from, &needed_kinds(from, stages), stages)
}

fn check_needed(
    recording: &Recording,
    from: Stage,
    needed: &[Kind],
    stages: &[Stage],
) -> Result<(), SelectionError> {
    let rig = &recording.metadata().rig;
    let channels = recording.channels();
    let missing = |kinds: &[Kind]| -> Vec<String> {
        let is_missing = |topic: &&Topic| !channels.contains_key(&*topic.name);
        let among = |kind: &Kind| {
            let topics = Topic::of(rig, *kind);
            let missing = topics.iter().filter(is_missing).collect::<Vec<_>>();
            let first = &missing.first()?.name;
            Some(match missing.len() {
                1 => first.clone(),
                more => format!("{first} and {} more", more - 1),
            })
        };
        kinds.iter().filter_map(among).collect()
    };
    // What was recorded without a stage's settings cannot be computed by it.
    let configuration = &recording.metadata().configuration;
    let is_known =
        |stage: &Stage| *stage == Stage::CAPTURE || configuration.get(stage.name()).is_some();
    let mut lacking = missing(needed);
    let unknown = stages.iter().filter(|stage| !is_known(stage));
    lacking.extend(unknown.map(|stage| format!("the settings of {}", stage.name())));
    if lacking.is_empty() {
        return Ok(());
    }
    // What computes up to the points; map and evaluation need more than a recording is sure to hold.
    let after = |from: Stage| {
        let mut stages = Stage::own();
        stages.retain(|stage| stage.follows(from) && Stage::MATCH.follows(*stage));
        stages
    };
    let possible = |stage: &Stage| {
        let stages = after(*stage);
        !stages.is_empty()
            && stages.iter().all(is_known)
            && missing(&needed_kinds(*stage, &stages)).is_empty()
    };
    let stages = Stage::all().into_iter().filter(possible).map(Stage::name);
    let stages = stages.collect::<Vec<_>>().join(", ");
    Err(SelectionError::Cut {
        from: from.name(),
        missing: lacking.join(", "),
        possible: match stages.is_empty() {
            true => "it cannot be replayed from any stage".to_owned(),
            false => format!("it can be replayed from {stages}"),
        },
    })
}

impl Selection {
    /// Whether a scan of the replay comes after as many scans as it did when they were recorded, or after this many of them
    /// without a gap.
    pub fn follows(&self, tick: u64, depth: u64) -> bool {
        let number = |tick: u64| self.scan(tick).0;
        let first = tick.saturating_sub(depth);
        let is_first = number(first) == 0;
        (tick >= depth || is_first) && number(tick) - number(first) == tick - first
    }

    /// What is replayed of a recording.
    ///
    /// # Errors
    /// When the recording lacks topics that the cut needs, or no scan is left.
    pub fn of(recording: &Recording, choice: Choice) -> Result<Self, SelectionError> {
        let Choice {
            from,
            taken,
            first,
            end,
            before,
            whole,
        } = choice;
        let rig = &recording.metadata().rig;
        let topics_of = |kinds: &[Kind]| -> Vec<Topic> {
            kinds
                .iter()
                .flat_map(|&kind| Topic::of(rig, kind))
                .collect()
        };
        let channels = recording.channels();
        let kinds = replayed_kinds(from);
        let mut topics = topics_of(&kinds);
        topics.retain(|topic| channels.contains_key(&*topic.name));
        let is_needed = |kind: &Kind| kinds.contains(kind) && taken.contains(kind);
        let needed: Vec<Kind> = Kind::all().filter(is_needed).collect();
        check_needed(recording, from, &needed, &[])?;
        let range = first..end.unwrap_or(u64::MAX);
        let all = recording
            .scans()
            .filter(|scan| range.contains(scan))
            .count();
        let mut scans = recording.scans_with(&topics_of(&needed));
        let playable = scans.clone();
        if whole {
            let all = recording.whole_scans();
            scans.retain(|scan| all.binary_search(scan).is_ok());
        }
        let scans: Vec<(u64, u64)> = scans
            .into_iter()
            .filter(|scan| range.contains(scan))
            .filter_map(|scan| Some((scan, recording.nanos(scan)?)))
            .collect();
        if scans.is_empty() {
            return Err(SelectionError::Empty {
                held: recording.held(),
                first,
                end: end.map_or("the last".to_owned(), |end| {
                    end.saturating_sub(1).to_string()
                }),
            });
        }
        let broken = all - scans.len();
        let first = scans[0].0;
        let is_there = |scan: &u64| playable.binary_search(scan).is_ok();
        let lead = (first.saturating_sub(before)..first).rev();
        let lead = lead.take_while(is_there);
        let lead = lead.filter_map(|scan| Some((scan, recording.nanos(scan)?)));
        let mut lead: Vec<(u64, u64)> = lead.collect();
        lead.reverse();
        Ok(Self {
            topics,
            broken,
            lead: lead.len(),
            scans: [lead, scans].concat(),
        })
    }

    /// The recording's scan that is replayed as this one, counted from 0 and, when it begins again, further; and its
    /// time.
    pub fn scan(&self, tick: u64) -> (u64, u64) {
        let len = self.scans.len() as u64;
        let (scan, nanos) = self.scans[(tick % len) as usize];
        (scan, nanos + tick / len * self.round_nanos())
    }

    /// The first of the scans that was taken at this time or later, or the last.
    pub fn at_or_after(&self, nanos: u64) -> u64 {
        let before = self.scans.iter().position(|(_, taken)| *taken >= nanos);
        before.unwrap_or(self.scans.len().saturating_sub(1)) as u64
    }

    /// When the first scan was taken and when the last.
    pub fn span(&self) -> (u64, u64) {
        let nanos = |scan: Option<&(u64, u64)>| scan.map_or(0, |(_, nanos)| *nanos);
        (nanos(self.scans.first()), nanos(self.scans.last()))
    }

    /// What a whole round takes: from the first scan to the last, and a step as long as they are apart on average.
    pub fn round_nanos(&self) -> u64 {
        let (first, last) = match self.scans.as_slice() {
            [(_, first), .., (_, last)] => (*first, *last),
            _ => return 100_000_000,
        };
        let span = last.saturating_sub(first);
        span + span / (self.scans.len() as u64 - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_follows_those_it_depends_on_only_without_a_gap() {
        let of = |numbers: &[u64]| Selection {
            topics: Vec::new(),
            scans: numbers.iter().map(|number| (*number, *number)).collect(),
            broken: 0,
            lead: 0,
        };
        let follows = |numbers: &[u64], depth| -> Vec<bool> {
            let selection = of(numbers);
            (0..numbers.len() as u64)
                .map(|tick| selection.follows(tick, depth))
                .collect()
        };
        let gap = [3, 4, 5, 9, 10, 11];
        assert_eq!(follows(&gap, 2), [false, false, true, false, false, true]);
        assert_eq!(follows(&gap, 0), [true; 6]);
        assert_eq!(follows(&[0, 1, 2, 4], 9), [true, true, true, false]);
    }
}
