//! How a run goes on: a bar on a terminal, plain lines elsewhere.

use std::io::IsTerminal as _;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use messages::bus::{self, Level};

use crate::supervisor::Watcher;

/// How often a plain line is written.
const LINE_EVERY: Duration = Duration::from_secs(2);

pub(crate) struct Progress {
    bar: Option<ProgressBar>,
    is_quiet: bool,
    began: Option<Instant>,
    next_line: Instant,
}

impl Progress {
    pub(crate) fn new(is_quiet: bool) -> Self {
        let on_terminal = std::io::stderr().is_terminal() && !is_quiet;
        let style = ProgressStyle::with_template("{bar:32} {pos}/{len} scans  {msg}  {elapsed}");
        let bar = on_terminal
            .then(|| ProgressBar::new(0).with_style(style.unwrap_or(ProgressStyle::default_bar())));
        Self {
            bar,
            is_quiet,
            began: None,
            next_line: Instant::now(),
        }
    }

    pub(crate) fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Watcher for Progress {
    fn progress(&mut self, progress: &bus::Progress) {
        let began = *self.began.get_or_insert_with(Instant::now);
        let rate = progress.done as f64 / began.elapsed().as_secs_f64().max(1e-3);
        let refused: u64 = progress.refused.values().sum();
        let dropped = if refused > 0 {
            format!(", {refused} dropped")
        } else {
            String::new()
        };
        let under_way = progress.admitted - progress.done.min(progress.admitted);
        let message = format!("{rate:.1} triples/s, {under_way} under way{dropped}");
        if let Some(bar) = &self.bar {
            bar.set_length(progress.total.unwrap_or(progress.admitted));
            bar.set_position(progress.done);
            bar.set_message(message);
        } else if !self.is_quiet && Instant::now() >= self.next_line {
            self.next_line = Instant::now() + LINE_EVERY;
            let total = progress
                .total
                .map_or(String::new(), |total| format!("/{total}"));
            eprintln!("{}{total} scans, {message}", progress.done);
        }
    }

    fn say(&mut self, level: Level, node: &str, text: &str) {
        let line = match level {
            Level::Info => format!("{node}: {text}"),
            Level::Warn => format!("{node}: warning: {text}"),
            Level::Error => format!("{node}: error: {text}"),
        };
        match &self.bar {
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
    }
}
