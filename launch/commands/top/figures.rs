//! What a running graph says of itself, and the figures of an interval made of it.
//!
//! ```text
//! reports of nodes, one a second ─┐
//! /proc, each look ───────────────┼─► Watch ─► Figures
//! the launcher's state, asked ────┘
//! ```
//!
//! No topic is subscribed to: nodes count what they publish in any case, and say it once a second. So rates are those
//! between two reports, by the node's own clock, whatever the interval and however late the reports are read.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, Sender, unbounded};
use messages::bus::{self, Answer, Ask, Event, Guest, NodeReport, Progress, Reports, State};
use serde::Serialize;

use crate::Failure;
use crate::running::{Process, Running};

/// How often the launcher is asked how things stand.
const ASK_EVERY: Duration = Duration::from_millis(500);
/// A launcher that has not answered for so long is said to be silent, and a node's rates of so long ago are no more.
const SILENT: Duration = Duration::from_secs(4);

/// How a graph did in an interval.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct Figures {
    pub(super) run: String,
    /// The interval.
    pub(super) seconds: f64,
    pub(super) scans_done: u64,
    /// Scans of the source, where that is known.
    pub(super) scans_total: Option<u64>,
    pub(super) scans_under_way: u64,
    /// Scans turned away at the door.
    pub(super) scans_dropped: u64,
    pub(super) scans_dropped_by_cause: BTreeMap<String, u64>,
    pub(super) triples_per_second: f64,
    /// Scans let in that the graph's recorder has not written yet; none without one.
    pub(super) recorder_lag_scans: Option<u64>,
    pub(super) paused: bool,
    /// Whether the launcher does not answer.
    pub(super) launcher_silent: bool,
    /// Whether the graph has ended meanwhile.
    pub(super) ended: bool,
    /// Along the pipe.
    pub(super) nodes: Vec<NodeFigures>,
}

/// How a node did in an interval; what is not known, or does not apply, is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct NodeFigures {
    pub(super) node: String,
    /// `starting`, `running`, `stopped`, `finished`, `failed` or `gone`.
    pub(super) state: String,
    pub(super) restarts: u32,
    /// Of one core.
    pub(super) cpu_percent: Option<f64>,
    /// Memory of its own.
    pub(super) memory_megabytes: Option<f64>,
    /// How often each of its topics is published in a second.
    pub(super) hz: Option<f64>,
    pub(super) megabytes_per_second: Option<f64>,
    /// Scans of which it has all it takes and is not done with.
    pub(super) queue_scans: Option<u64>,
    /// What its process spent on a scan since it began: half took at most this.
    pub(super) p50_ms: Option<f64>,
    /// All but one in a hundred took at most this.
    pub(super) p99_ms: Option<f64>,
    /// Messages, or elements of messages, it lost.
    pub(super) drops: u64,
    pub(super) drops_by_cause: BTreeMap<String, u64>,
}

/// A report, and when it came.
#[derive(Clone, Debug)]
struct Heard {
    at: Instant,
    report: NodeReport,
}

/// What is published in a second.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rates {
    /// Of each topic; none for a node that owes none.
    hz: Option<f64>,
    megabytes: f64,
}

/// What a node reported.
#[derive(Debug, Default)]
struct Known {
    /// The newest report of the last look, or the first.
    before: Option<Heard>,
    last: Option<Heard>,
    rates: Option<Rates>,
    has_finished: bool,
}

impl Known {
    fn hear(&mut self, report: NodeReport, at: Instant) {
        let life = report.life;
        let is_same = |before: &Heard| before.report.life == life;
        let heard = Heard { at, report };
        if !self.before.as_ref().is_some_and(is_same) {
            self.before = Some(heard.clone());
            self.rates = None;
        }
        self.last = Some(heard);
    }

    /// Whether two reports of one process have come since the last look, or nothing more will.
    fn is_ready(&self) -> bool {
        let two = self.before.as_ref().zip(self.last.as_ref());
        self.has_finished || two.is_some_and(|(before, last)| between(before, last) > 0.0)
    }

    /// The rates since the last look, or those of then when no report has come since.
    fn rates(&mut self, now: Instant) -> Option<Rates> {
        let (before, last) = self.before.as_ref().zip(self.last.as_ref())?;
        if between(before, last) > 0.0 {
            self.rates = Some(rates(before, last));
            self.before = self.last.clone();
        } else if now.duration_since(last.at) > SILENT {
            self.rates = None;
        }
        self.rates
    }
}

/// The seconds between two reports of one process.
fn between(before: &Heard, last: &Heard) -> f64 {
    last.report.seconds - before.report.seconds
}

/// What was published between two reports of one process.
fn rates(before: &Heard, last: &Heard) -> Rates {
    let seconds = between(before, last);
    let published = |heard: &Heard| -> (u64, u64) {
        let topics = heard.report.topics.values();
        let counts = topics.filter_map(|account| account.published);
        counts.fold((0, 0), |(topics, all), count| (topics + 1, all + count))
    };
    let (topics, count) = published(last);
    let messages = count.saturating_sub(published(before).1) as f64;
    let bytes = last.report.bytes.saturating_sub(before.report.bytes);
    Rates {
        hz: (topics > 0).then(|| messages / topics as f64 / seconds),
        megabytes: bytes as f64 / 1e6 / seconds,
    }
}

/// Scans that a node has received whole and is not done with: not published whole, or not said to be done. Of those that
/// come in parts, as images do long before what is made of them, only the last part is waiting for the node.
fn queue(report: &NodeReport) -> Option<u64> {
    let accounts = || report.topics.values();
    let received = accounts().filter_map(|account| account.received).min()?;
    let published = accounts().filter_map(|account| account.published).min();
    let through = published.into_iter().chain(report.done).min()?;
    Some(received.saturating_sub(through))
}

/// The launcher's answers, asked for in a thread of its own: one that hangs holds nobody up.
#[derive(Debug)]
struct Asker {
    answer: Sender<Option<State>>,
    answers: Receiver<Option<State>>,
    is_asking: bool,
    next: Instant,
}

impl Asker {
    fn new() -> Self {
        let (answer, answers) = unbounded();
        Self {
            answer,
            answers,
            is_asking: false,
            next: Instant::now(),
        }
    }

    /// What was answered last since the last call; asks again when it is time to.
    fn turn(&mut self, folder: &Path, now: Instant) -> Option<State> {
        let mut state = None;
        while let Ok(answer) = self.answers.try_recv() {
            self.is_asking = false;
            state = answer.or(state);
        }
        if !self.is_asking && now >= self.next {
            self.next = now + ASK_EVERY;
            let (folder, answer) = (folder.to_owned(), self.answer.clone());
            let ask = move || {
                let state = match bus::ask(&folder, &Ask::State) {
                    Ok(Answer::State(state)) => Some(*state),
                    _ => None,
                };
                answer.send(state).unwrap_or_default();
            };
            let asking = std::thread::Builder::new().name("ask".to_owned());
            self.is_asking = asking.spawn(ask).is_ok();
        }
        state
    }
}

/// What stood at the last look.
#[derive(Debug)]
struct Look {
    at: Instant,
    /// Scans done, as soon as that is known: what was done before anybody looked was not done in the first interval.
    done: Option<u64>,
    processes: Vec<Process>,
}

/// A graph that is watched.
pub(super) struct Watch {
    pub(super) running: Running,
    reports: Reports,
    asker: Asker,
    state: State,
    /// When the launcher last answered.
    answered: Option<Instant>,
    began: Instant,
    progress: Progress,
    nodes: BTreeMap<String, Known>,
    recorder_lag: Option<u64>,
    look: Look,
}

impl Watch {
    pub(super) fn start(running: Running) -> Result<Self, Failure> {
        let name = format!("top.{}", std::process::id());
        let reports = Guest::reports(&running.orders.run, &name)
            .map_err(|error| running.cannot_join(&error))?;
        let processes = running.processes();
        let now = Instant::now();
        Ok(Self {
            running,
            reports,
            asker: Asker::new(),
            state: State::default(),
            answered: None,
            began: now,
            progress: Progress::default(),
            nodes: BTreeMap::new(),
            recorder_lag: None,
            look: Look {
                at: now,
                done: None,
                processes,
            },
        })
    }

    pub(super) fn is_alive(&self) -> bool {
        self.running.goes_on()
    }

    /// Takes in what was said meanwhile.
    pub(super) fn hear(&mut self) -> Result<(), Failure> {
        let heard = self.try_hear();
        // What cannot be heard of a graph that has ended meanwhile is no failure.
        if self.is_alive() { heard } else { Ok(()) }
    }

    fn try_hear(&mut self) -> Result<(), Failure> {
        let now = Instant::now();
        while let Some(event) = self.reports.receive().map_err(Failure::failed)? {
            match event {
                Event::Progress(progress) => self.take_progress(progress),
                Event::Report(report) => self.take_report(report, now, false),
                Event::Finished(report) => self.take_report(report, now, true),
                _ => {}
            }
        }
        if let Some(state) = self.asker.turn(&self.running.folder, now) {
            self.take_progress(state.progress.clone());
            self.state = state;
            self.answered = Some(now);
        }
        Ok(())
    }

    /// The newer one of two that came by different ways.
    fn take_progress(&mut self, progress: Progress) {
        let far = |p: &Progress| (p.admitted, p.done, p.refused.values().sum::<u64>());
        if far(&progress) >= far(&self.progress) {
            self.progress = progress;
        }
        self.look.done.get_or_insert(self.progress.done);
    }

    fn take_report(&mut self, report: NodeReport, now: Instant, has_finished: bool) {
        if report.node == "record" {
            let admitted = self.progress.admitted;
            self.recorder_lag = report.done.map(|done| admitted.saturating_sub(done));
        }
        let known = self.nodes.entry(report.node.clone()).or_default();
        known.has_finished = has_finished;
        known.hear(report, now);
    }

    /// Whether every node's rates and the launcher's state are known.
    pub(super) fn is_ready(&self) -> bool {
        let names = self.running.orders.run.nodes.iter().map(|node| &node.name);
        let is_ready = |name: &String| self.nodes.get(name).is_some_and(Known::is_ready);
        self.answered.is_some() && names.into_iter().all(is_ready)
    }

    /// The figures since the last look.
    pub(super) fn look(&mut self) -> Figures {
        let now = Instant::now();
        let processes = self.running.processes();
        let seconds = now.duration_since(self.look.at).as_secs_f64();
        let names = self.running.orders.run.nodes.iter();
        let names: Vec<String> = names.map(|node| node.name.clone()).collect();
        let nodes = names
            .into_iter()
            .map(|name| self.node(name, &processes, now, seconds))
            .collect();
        let Progress {
            admitted,
            done,
            total,
            ref refused,
            ..
        } = self.progress;
        let answered = self.answered.unwrap_or(self.began);
        let done_before = self.look.done.unwrap_or(done);
        let figures = Figures {
            run: self.running.name(),
            seconds,
            scans_done: done,
            scans_total: total,
            scans_under_way: admitted.saturating_sub(done),
            scans_dropped: refused.values().sum(),
            scans_dropped_by_cause: refused.clone(),
            triples_per_second: done.saturating_sub(done_before) as f64 / seconds.max(1e-3),
            recorder_lag_scans: self.recorder_lag,
            paused: self.state.playing.is_some_and(|playing| playing.is_paused),
            launcher_silent: now.duration_since(answered) > SILENT,
            ended: !self.is_alive(),
            nodes,
        };
        self.look = Look {
            at: now,
            done: self.look.done.map(|_| done),
            processes,
        };
        figures
    }

    fn node(
        &mut self,
        name: String,
        processes: &[Process],
        now: Instant,
        seconds: f64,
    ) -> NodeFigures {
        let process = processes.iter().find(|process| process.node == name);
        let before = process.and_then(|process| {
            let mut before = self.look.processes.iter();
            before.find(|before| before.pid == process.pid)
        });
        let cpu_seconds = process
            .zip(before)
            .map(|(process, before)| process.cpu_seconds - before.cpu_seconds);
        let told = self.state.nodes.iter().find(|node| node.name == name);
        let known = self.nodes.entry(name.clone()).or_default();
        let rates = known.rates(now);
        let report = known.last.as_ref().map(|last| &last.report);
        let mut drops_by_cause = BTreeMap::new();
        for account in report.iter().flat_map(|report| report.topics.values()) {
            for (cause, count) in &account.dropped {
                *drops_by_cause.entry(cause.clone()).or_default() += count;
            }
        }
        let has_failed = report.is_some_and(|report| report.failed.is_some());
        let state = match (process.map(|process| process.state), told) {
            _ if has_failed => "failed",
            (_, Some(told)) if told.state == "finished" => "finished",
            _ if known.has_finished => "finished",
            (None | Some("dead"), _) => "gone",
            (Some("stopped"), _) => "stopped",
            (Some(_), Some(told)) => told.state.as_str(),
            (Some(_), None) => "running",
        };
        let measured = report.filter(|report| report.milliseconds.scans > 0);
        NodeFigures {
            state: state.to_owned(),
            restarts: process
                .map(|process| process.restarts)
                .or(told.map(|told| told.restarts))
                .unwrap_or_default(),
            cpu_percent: cpu_seconds.map(|spent| 100.0 * spent / seconds.max(1e-3)),
            memory_megabytes: process.map(|process| process.memory_bytes as f64 / 1e6),
            hz: rates.and_then(|rates| rates.hz),
            megabytes_per_second: rates
                .filter(|rates| rates.hz.is_some() || rates.megabytes > 0.0)
                .map(|rates| rates.megabytes),
            queue_scans: report.and_then(queue),
            p50_ms: measured.map(|report| report.milliseconds.p50),
            p99_ms: measured.map(|report| report.milliseconds.p99),
            drops: drops_by_cause.values().sum(),
            drops_by_cause,
            node: name,
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use messages::ledger::Account;

    fn report(received: &[u64], published: &[u64], done: Option<u64>) -> NodeReport {
        let account = |received: Option<u64>, published: Option<u64>| Account {
            received,
            published,
            ..Account::default()
        };
        let taken = received.iter().map(|count| account(Some(*count), None));
        let made = published.iter().map(|count| account(None, Some(*count)));
        let named = |(index, account)| (format!("topic/{index}"), account);
        NodeReport {
            node: "track".to_owned(),
            topics: taken.chain(made).enumerate().map(named).collect(),
            bytes: 1_000_000 * published.iter().sum::<u64>(),
            done,
            ..NodeReport::default()
        }
    }

    /// A report of what the life with this number has published after so many seconds.
    fn published(life: u32, seconds: f64, published: &[u64]) -> NodeReport {
        NodeReport {
            life,
            seconds,
            ..report(&[], published, None)
        }
    }

    #[test]
    fn rates_are_those_between_two_reports_however_late_they_are_read() {
        let mut known = Known::default();
        let begin = Instant::now();
        let after = |seconds| begin + Duration::from_secs(seconds);
        assert_eq!(known.rates(begin), None);
        known.hear(published(0, 1.0, &[4, 4]), begin);
        assert!(!known.is_ready());
        known.hear(published(0, 2.0, &[8, 8]), after(3));
        known.hear(published(0, 3.0, &[14, 12]), after(3));
        assert!(known.is_ready());
        let rates = known.rates(after(3)).unwrap();
        assert_eq!((rates.hz, rates.megabytes), (Some(4.5), 9.0));
        // Until the next report these hold, but not for ever.
        assert_eq!(known.rates(after(4)), Some(rates));
        assert_eq!(known.rates(after(9)), None);
    }

    #[test]
    fn a_restarted_node_is_not_measured_against_its_predecessor() {
        let mut known = Known::default();
        let now = Instant::now();
        known.hear(published(0, 7.0, &[40]), now);
        known.hear(published(1, 1.0, &[42]), now);
        assert_eq!(known.rates(now), None);
        known.hear(published(1, 2.0, &[43]), now);
        assert_eq!(known.rates(now).unwrap().hz, Some(1.0));
    }

    #[test]
    fn a_scan_is_in_a_node_from_the_last_message_taken_to_the_last_one_made_of_it() {
        assert_eq!(queue(&report(&[7, 9], &[6, 4], None)), Some(3));
        assert_eq!(queue(&report(&[9], &[8], Some(7))), Some(2));
        assert_eq!(queue(&report(&[9], &[], Some(9))), Some(0));
        // A source has nothing waiting, and who publishes nothing and finishes nothing is never done.
        assert_eq!(queue(&report(&[], &[4], None)), None);
        assert_eq!(queue(&report(&[4], &[], None)), None);
    }
}
