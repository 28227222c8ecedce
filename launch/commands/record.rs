//! `tricurve record`: records beside a graph that runs already.

use std::io::IsTerminal as _;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use messages::settings::Settings as _;
use record::{Attach, AttachError, Attached, Settings, Wish, attach};
use regex::Regex;
use signal_hook::consts::SIGUSR1;

use super::rewrite::is_like;
use crate::cli::Record as Args;
use crate::running::Running;
use crate::{Failure, Outcome, signals};

/// How often it is said how the recorder is doing.
const LINE_EVERY: Duration = Duration::from_secs(2);
/// How often it is looked whether the graph is still there.
const LOOK_EVERY: Duration = Duration::from_millis(200);

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let regex = args.regex.as_deref().map(Regex::new).transpose();
    let regex = regex.map_err(|e| Failure::usage(format!("--regex: {e}")))?;
    let topic = |name: &str| {
        let listed = args.topics.is_empty() || args.topics.iter().any(|like| is_like(name, like));
        listed && regex.as_ref().is_none_or(|regex| regex.is_match(name))
    };
    let running = Running::choose(args.run.as_deref())?;
    let orders = &running.orders;
    let settings = Settings {
        file: std::path::absolute(&args.output)
            .map_err(Failure::failed)?
            .to_string_lossy()
            .into_owned(),
        overwrite: args.force,
        max_bytes: args
            .max_size
            .map(|megabytes| megabytes.saturating_mul(1_000_000)),
        max_seconds: args.max_duration,
        // A guest ends when the disk is full, and no earlier: nothing but itself depends on it.
        leave_free: 0,
        ..Settings::default()
    };
    settings
        .check()
        .map_err(|e| Failure::usage(format!("record.{e}")))?;
    let path = Path::new(&settings.file);
    record::Writer::check(path, args.force).map_err(Failure::failed)?;
    let metadata = record::node::metadata_of(
        &orders.run.rig,
        &orders.configuration,
        orders.graph.clone(),
        orders.scans.clone(),
    );
    let mut wishes = Wishes::listen(&running, args)?;
    let recorder = Attach {
        run: &orders.run,
        metadata,
        topic: &topic,
        settings,
        scans: args.scans,
        snapshot: args.snapshot,
    };
    if !args.json {
        crate::say!("recording beside {}: Ctrl-C ends", running.name());
    }
    let attached = attach(recorder, |told| wishes.next(told)).map_err(|error| match error {
        AttachError::Bus(error) => running.cannot_join(&error),
        error => Failure::failed(error),
    })?;
    match args.json {
        true => super::print_json(&attached)?,
        false => super::print(&text(&attached))?,
    }
    Ok(match attached.missed {
        0 => Outcome::Done,
        _ => Outcome::Lost,
    })
}

fn text(attached: &Attached) -> String {
    let Attached {
        scans,
        missed,
        files,
        bytes,
        ..
    } = attached;
    let files: String = files
        .iter()
        .map(|path| format!("{}\n", path.display()))
        .collect();
    format!(
        "{scans} scans taken in, {missed} missed; {:.1} MB written\n{files}",
        *bytes as f64 / 1e6
    )
}

/// What signals, keys and the end of the graph ask for.
struct Wishes<'a> {
    running: &'a Running,
    end: Arc<AtomicBool>,
    snapshot: Arc<AtomicBool>,
    is_quiet: bool,
    /// After how many scans to end.
    scans: Option<u64>,
    next_look: Instant,
    next_line: Instant,
    gone: bool,
}

impl<'a> Wishes<'a> {
    fn listen(running: &'a Running, args: &Args) -> Result<Self, Failure> {
        let end = signals::flag(&signals::END)?;
        let snapshot = signals::flag(&[SIGUSR1])?;
        if args.snapshot.is_some() && std::io::stdin().is_terminal() {
            let snapshot = Arc::clone(&snapshot);
            let listen = move || {
                for _ in std::io::stdin().lines().map_while(Result::ok) {
                    snapshot.store(true, Ordering::Relaxed);
                }
            };
            std::thread::Builder::new()
                .name("keys".to_owned())
                .spawn(listen)
                .map_err(Failure::failed)?;
        }
        Ok(Self {
            running,
            end,
            snapshot,
            is_quiet: args.json,
            scans: args.scans,
            next_look: Instant::now(),
            next_line: Instant::now() + LINE_EVERY,
            gone: false,
        })
    }

    fn next(&mut self, told: &Attached) -> Wish {
        let now = Instant::now();
        if now >= self.next_line && !self.is_quiet {
            self.next_line = now + LINE_EVERY;
            let Attached {
                scans,
                missed,
                behind,
                ..
            } = told;
            crate::say!("{scans} scans taken in, {missed} missed, {behind} behind");
        }
        let is_all = self.scans.is_some_and(|scans| told.scans >= scans);
        if self.end.load(Ordering::Relaxed) || self.gone || is_all {
            return Wish::End;
        }
        if now >= self.next_look {
            self.next_look = now + LOOK_EVERY;
            // Once more around, for what was said last.
            self.gone = !self.running.goes_on();
            if self.gone && !self.is_quiet {
                crate::say!("record: {}", self.running.why_over());
            }
        }
        match self.snapshot.swap(false, Ordering::Relaxed) {
            true => Wish::Snapshot,
            false => Wish::Nothing,
        }
    }
}
