//! `tricurve recover`, `merge`, `split` and `filter`: recordings made from recordings.

use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::ops::Range;
use std::path::PathBuf;

use indicatif::{ProgressBar, ProgressStyle};
use messages::recording::Recording;
use record::{RewriteError, Rewritten, Split, Wanted, WriteError, rewrite};

use crate::cli::{Filter, Merge, Output, Recover, SplitArgs};
use crate::{Failure, Outcome, former};

pub(crate) fn recover(args: &Recover) -> Result<Outcome, Failure> {
    let written = write(
        std::slice::from_ref(&args.file),
        &args.output,
        &|_| true,
        0..u64::MAX,
        Split::default(),
    )?;
    let is_whole = written.whole == written.scans;
    Ok(match outcome(written) {
        Outcome::Done if !is_whole => Outcome::Lost,
        outcome => outcome,
    })
}

pub(crate) fn merge(args: &Merge) -> Result<Outcome, Failure> {
    let all = 0..u64::MAX;
    write(&args.files, &args.output, &|_| true, all, Split::default()).map(outcome)
}

pub(crate) fn split(args: &SplitArgs) -> Result<Outcome, Failure> {
    let split = Split {
        bytes: args.size.map(|megabytes| megabytes * 1_000_000),
        seconds: args.duration,
        scans: args.scans,
    };
    let file = std::slice::from_ref(&args.file);
    write(file, &args.output, &|_| true, 0..u64::MAX, split).map(outcome)
}

pub(crate) fn filter(args: &Filter) -> Result<Outcome, Failure> {
    let is_wanted = |topic: &str| {
        let matches = |pattern: &String| is_like(topic, pattern);
        args.topics.is_empty() || args.topics.iter().any(matches)
    };
    let scans = args.scans.map_or(0..u64::MAX, |scans| {
        scans.first..scans.end.unwrap_or(u64::MAX)
    });
    let recording = Recording::open(&args.file).map_err(Failure::failed)?;
    let channels = recording.channels();
    let is_vain = |pattern: &&String| !channels.keys().any(|topic| is_like(topic, pattern));
    if let Some(vain) = args.topics.iter().find(is_vain) {
        let topics = channels.keys().copied().collect::<Vec<_>>().join(", ");
        return Err(Failure::usage(format!(
            "no topic of the recording is like {vain}; it has {topics}"
        )));
    }
    let file = std::slice::from_ref(&args.file);
    write(file, &args.output, &is_wanted, scans, Split::default()).map(outcome)
}

/// What cannot be read or is not there is lost, whatever was to be done.
fn outcome(written: Rewritten) -> Outcome {
    match written.lacks_scans {
        false => Outcome::Done,
        true => Outcome::Lost,
    }
}

/// Whether a topic is like a pattern, in which `*` stands for anything.
pub(super) fn is_like(topic: &str, pattern: &str) -> bool {
    match pattern.split_once('*') {
        None => topic == pattern,
        Some((before, after)) => topic.strip_prefix(before).is_some_and(|rest| {
            let ends = rest.char_indices().map(|(at, _)| at).chain([rest.len()]);
            ends.into_iter().any(|at| is_like(&rest[at..], after))
        }),
    }
}

fn write(
    inputs: &[PathBuf],
    output: &Output,
    topic: &dyn Fn(&str) -> bool,
    scans: Range<u64>,
    split: Split,
) -> Result<Rewritten, Failure> {
    let bar = progress_bar(output.json);
    let mut progress = |done: usize, all: usize| {
        if let Some(bar) = &bar {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        }
    };
    let wanted = Wanted {
        topic,
        scans,
        split,
        overwrite: output.force,
        settings: &former::in_keys_of_now,
        progress: &mut progress,
    };
    let written = rewrite(inputs, &output.output, wanted);
    if let Some(bar) = &bar {
        bar.finish_and_clear();
    }
    let written = written.map_err(|error| match error {
        RewriteError::OntoItself(_) | RewriteError::Begin(WriteError::Exists(_)) => {
            Failure::usage(error)
        }
        error => Failure::failed(error),
    })?;
    match output.json {
        true => super::print_json(&written)?,
        false => super::print(&text(&written))?,
    }
    Ok(written)
}

/// A bar on a terminal; elsewhere what is written is said at the end.
pub(super) fn progress_bar(is_quiet: bool) -> Option<ProgressBar> {
    let style = ProgressStyle::with_template("{bar:32} {pos}/{len} scans  {elapsed}");
    let on_terminal = std::io::stderr().is_terminal() && !is_quiet;
    on_terminal
        .then(|| ProgressBar::new(0).with_style(style.unwrap_or(ProgressStyle::default_bar())))
}

fn text(written: &Rewritten) -> String {
    let mut text = String::new();
    for note in &written.notes {
        writeln!(text, "note: {note}").unwrap_or_default();
    }
    for (topic, count) in &written.messages {
        writeln!(text, "{topic:<26} {count:>8}").unwrap_or_default();
    }
    let Rewritten {
        scans,
        whole,
        unreadable_bytes,
        ..
    } = written;
    writeln!(
        text,
        "\n{scans} scans, {whole} of them whole; {unreadable_bytes} bytes of the input were unreadable"
    )
    .unwrap_or_default();
    for part in &written.parts {
        writeln!(text, "{}", part.display()).unwrap_or_default();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_anything() {
        assert!(is_like("edges/left/4", "edges/*"));
        assert!(is_like("edges/left/4", "*/left/*"));
        assert!(is_like("points", "points") && is_like("points", "*"));
        assert!(!is_like("points", "point") && !is_like("edges/left/4", "*/right/*"));
    }
}
