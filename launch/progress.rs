//! How a run goes on: a bar on a terminal, plain lines elsewhere.

use std::io::IsTerminal as _;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use messages::bus::{self, Level};

use crate::said::in_words;
use crate::supervisor::Watcher;

/// How often a plain line is written.
const LINE_EVERY: Duration = Duration::from_secs(2);

/// When the scans of a recording were taken, in nanoseconds since 1970.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timeline(pub(crate) Vec<u64>);

impl Timeline {
    /// How far a replay has come after so many scans, and how long a round is.
    fn position(&self, scans: u64) -> Option<String> {
        let (first, last) = (*self.0.first()?, *self.0.last()?);
        let seconds = |nanos: u64| nanos.saturating_sub(first) as f64 / 1e9;
        let len = self.0.len() as u64;
        let now = match scans {
            0 => first,
            _ => self.0[((scans - 1) % len) as usize],
        };
        Some(format!("{:.1} of {:.1} s", seconds(now), seconds(last)))
    }
}

pub(crate) struct Progress {
    bar: Option<ProgressBar>,
    is_quiet: bool,
    timeline: Option<Timeline>,
    /// What differs from playing as fast as it goes, as `paused, `.
    playing: String,
    last: bus::Progress,
    began: Option<Instant>,
    next_line: Instant,
}

impl Progress {
    pub(crate) fn new(is_quiet: bool, timeline: Option<Timeline>) -> Self {
        let on_terminal = std::io::stderr().is_terminal() && !is_quiet;
        let style = ProgressStyle::with_template("{bar:20} {pos}/{len} scans  {msg}  {elapsed}");
        let bar = on_terminal
            .then(|| ProgressBar::new(0).with_style(style.unwrap_or(ProgressStyle::default_bar())));
        Self {
            bar,
            is_quiet,
            timeline,
            playing: String::new(),
            last: bus::Progress::default(),
            began: None,
            next_line: Instant::now(),
        }
    }

    pub(crate) fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// How far it has come, in words.
    fn message(&self) -> String {
        let progress = &self.last;
        let elapsed = self
            .began
            .map_or(0.0, |began| began.elapsed().as_secs_f64());
        let rate = progress.done as f64 / elapsed.max(1e-3);
        let refused: u64 = progress.refused.values().sum();
        let dropped = if refused > 0 {
            format!(", {refused} dropped")
        } else {
            String::new()
        };
        let under_way = progress.admitted - progress.done.min(progress.admitted);
        let position = self.timeline.as_ref();
        let position = position.and_then(|timeline| timeline.position(progress.next_tick));
        let position = position.map_or(String::new(), |position| format!("{position}, "));
        let playing = &self.playing;
        format!("{playing}{position}{rate:.1} triples/s, {under_way} under way{dropped}")
    }
}

/// How a recording is played, where it is not just as fast as it goes.
fn how(playing: &bus::Playing) -> String {
    let rate = playing.rate.filter(|_| playing.is_recording);
    let rate = rate.map_or(String::new(), |rate| format!("rate {rate}, "));
    let paused = if playing.is_paused { "paused, " } else { "" };
    format!("{paused}{rate}")
}

impl Watcher for Progress {
    fn progress(&mut self, progress: &bus::Progress) {
        self.began.get_or_insert_with(Instant::now);
        self.last = progress.clone();
        let message = self.message();
        if let Some(bar) = &self.bar {
            bar.set_length(progress.total.unwrap_or(progress.admitted));
            bar.set_position(progress.done);
            bar.set_message(message);
        } else if !self.is_quiet && Instant::now() >= self.next_line {
            self.next_line = Instant::now() + LINE_EVERY;
            let total = progress
                .total
                .map_or(String::new(), |total| format!("/{total}"));
            crate::say!("{}{total} scans, {message}", progress.done);
        }
    }

    fn playing(&mut self, playing: &bus::Playing) {
        self.playing = how(playing);
        if let Some(bar) = &self.bar {
            bar.set_message(self.message());
        }
    }

    fn has_keys(&self) -> bool {
        self.timeline.is_some() && !self.is_quiet
    }

    fn say(&mut self, level: Level, node: &str, text: &str) {
        let line = in_words(level, node, text);
        match &self.bar {
            Some(bar) => bar.suspend(|| crate::say!("{line}")),
            None => crate::say!("{line}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_says_that_a_replay_is_paused_and_at_which_rate_it_plays() {
        let mut progress = Progress::new(true, None);
        let begins = |progress: &Progress, with: &str| progress.message().starts_with(with);
        assert!(begins(&progress, "0.0 triples/s"), "as fast as it goes");
        let mut playing = bus::Playing {
            is_paused: true,
            is_recording: true,
            rate: Some(2.0),
            span: None,
            next_nanos: None,
            sought_from: None,
        };
        progress.playing(&playing);
        assert!(begins(&progress, "paused, rate 2, 0.0 triples/s"));
        playing.is_paused = false;
        progress.playing(&playing);
        assert!(begins(&progress, "rate 2, "));
    }
}
