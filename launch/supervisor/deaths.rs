//! What is done about nodes that die, and about a run's folder that is removed.
//!
//! ```text
//! killed, the others at work      ─► restarted; the scans under way are sent once more
//! killed while the graph starts   ─► all begin again: what it was making the others may wait for
//! its bus failed                  ─► all begin again, with nothing of what they shared before
//! killed when nobody can join     ─► the same
//! gave up                         ─► the run ends, or goes on without a guest
//! ```
//!
//! To begin again loses nothing: every node is one that can be restarted, and then all are.

use std::collections::BTreeSet;
use std::io;
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::time::{Duration, Instant};

use messages::bus::{Level, socket_of};

use super::{News, Node, Supervisor, Watcher};
use crate::rundir::Befell;
use crate::{Failure, Outcome, asks};

/// How often it is looked whether the run's folder is still there.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// How long what a killed node said last may take to arrive.
const LAST_WORDS: Duration = Duration::from_secs(5);

/// Why a node's process ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Death {
    /// Something from outside ended it.
    Killed,
    /// It could not be part of the bus, or not any more.
    OffBus,
    /// It found that it cannot do its work.
    GaveUp,
}

impl Death {
    fn of(status: Option<ExitStatus>) -> Self {
        match status.and_then(|status| status.code()) {
            Some(code) if code == i32::from(Outcome::Failed.code()) => Self::GaveUp,
            Some(code) if code == i32::from(Outcome::OffBus.code()) => Self::OffBus,
            _ => Self::Killed,
        }
    }
}

impl<W: Watcher> Supervisor<'_, W> {
    /// A node is dead: if it was killed it is restarted, if it gave up the run fails.
    pub(super) fn gone(&mut self, place: usize) -> Result<(), Failure> {
        if self.nodes[place].has_finished {
            return Ok(());
        }
        let status = end(&mut self.nodes[place]);
        if self.trouble.is_some() {
            return Ok(());
        }
        let name = self.nodes[place].name.clone();
        let how = status.map_or("is gone".to_owned(), how_it_ended);
        let death = Death::of(status);
        if death != Death::Killed && self.has_begun && self.duty.guests.contains(&name) {
            let text = format!("{name} cannot go on ({how}): the run goes on without it");
            self.say(Level::Warn, "launch", text);
            self.nodes[place].has_finished = true;
            self.noted(place);
            return Ok(());
        }
        if death == Death::GaveUp {
            let text = format!("{name} cannot go on ({how}): the run ends");
            self.fail(Outcome::Failed, &text);
            return Ok(());
        }
        self.restarts_since_progress += 1;
        if self.restarts_since_progress > self.duty.restarts {
            let restarts = self.duty.restarts;
            let (outcome, text) = match self.has_begun {
                true => (
                    Outcome::Lost,
                    format!(
                        "{name} {how}, after {restarts} restarts without a scan done: the run gives up"
                    ),
                ),
                false => (
                    Outcome::Failed,
                    format!(
                        "{name} could not be started in {restarts} attempts ({how}): the run ends"
                    ),
                ),
            };
            self.fail(outcome, &text);
            return Ok(());
        }
        *self.restarts.entry(name.clone()).or_default() += 1;
        self.look_after_folder_now();
        if self.has_begun && death == Death::Killed && !self.is_closed {
            self.say(
                Level::Warn,
                "launch",
                format!("{name} {how}: it is restarted"),
            );
            return self.restart(place);
        }
        let why = match (self.has_begun, death) {
            (false, _) => "while the graph started",
            (true, Death::OffBus) => "since what the nodes share does not work any more",
            (true, _) => "after what the nodes share was removed",
        };
        let text = format!("{name} {how} {why}: it is restarted, and all other nodes with it");
        self.say(Level::Warn, "launch", text);
        self.begin_again(place)
    }

    /// Puts a new process in the place of one that is dead.
    fn restart(&mut self, place: usize) -> Result<(), Failure> {
        if place == 0 && self.nodes[0].has_begun {
            self.played = self.playing;
        }
        let life = self.nodes[place].life + 1;
        self.nodes[place] = self.spawn(place, life)?;
        // The new one reads what was changed.
        self.noted(place);
        if place == 0 {
            // What its predecessor was told it does not know.
            self.told.clear();
        }
        self.connecting = false;
        for node in &mut self.nodes {
            node.is_connected = false;
        }
        self.moved = Instant::now();
        Ok(())
    }

    /// Ends all nodes and starts them again, with nothing of what they shared before.
    fn begin_again(&mut self, dead: usize) -> Result<(), Failure> {
        let is_at_work = |place: &usize| !self.nodes[*place].has_finished && *place != dead;
        let killed: Vec<usize> = (0..self.nodes.len()).filter(is_at_work).collect();
        for place in &killed {
            self.nodes[*place].child.kill().unwrap_or_default();
        }
        self.hear_last_words(killed.iter().copied().collect());
        for place in killed {
            end(&mut self.nodes[place]);
        }
        let cannot = |error: &dyn std::fmt::Display| {
            Failure::failed(format!("the nodes cannot begin again: {error}"))
        };
        self.duty.dir.begin_again().map_err(|e| cannot(&e))?;
        self.duty.orders.run.prefix = self.duty.dir.bus_prefix();
        let orders = self.duty.orders.write(&self.duty.dir);
        orders.map_err(|e| cannot(&e))?;
        self.is_closed = false;
        for place in 0..self.nodes.len() {
            if !self.nodes[place].has_finished {
                self.restart(place)?;
            }
        }
        Ok(())
    }

    /// Takes in what killed nodes said last: a source that let a scan in said so before anybody saw it.
    fn hear_last_words(&mut self, mut of: BTreeSet<usize>) {
        let deadline = Instant::now() + LAST_WORDS;
        let mut later = Vec::new();
        while !of.is_empty()
            && let Ok(news) = self.news.recv_deadline(deadline)
        {
            match news {
                News::Event(place, life, event) if self.nodes[place].life == life => {
                    self.event(place, event);
                }
                News::Gone(place, life) if self.nodes[place].life == life => {
                    of.remove(&place);
                }
                news => later.push(news),
            }
        }
        for news in later {
            self.teller.send(news).unwrap_or_default();
        }
    }

    /// Listens in the run's folder to what is asked from outside.
    pub(super) fn listen(&self) -> io::Result<()> {
        let told = self.teller.clone();
        asks::listen(self.duty.dir.path(), move |asked| {
            told.send(News::Asked(asked)).is_ok()
        })
    }

    /// Looks now and then whether the run's folder is still there.
    pub(super) fn look_after_folder(&mut self) {
        if Instant::now() >= self.next_look {
            self.look_after_folder_now();
        }
    }

    /// Looks whether the run's folder is still there, and makes it anew when it is not.
    pub(super) fn look_after_folder_now(&mut self) {
        self.next_look = Instant::now() + LOOK_EVERY;
        let before = self.duty.dir.path().to_owned();
        let befell = match self.duty.dir.tend() {
            Ok(None) => return,
            Ok(Some(befell)) => befell,
            Err(error) => {
                self.is_closed = true;
                let text = format!(
                    "its folder {} was removed while the graph runs, and cannot be made anew: {error}; the graph goes on, and no command finds it",
                    before.display()
                );
                self.say(Level::Warn, "launch", text);
                return;
            }
        };
        // Who took part before is not registered any more: when one dies nobody could clean up after it.
        self.is_closed = true;
        let mut made = Ok(());
        if befell.moved_to.is_some() {
            self.duty.orders.run.root = self.duty.dir.path().to_owned();
            made = self.duty.orders.write(&self.duty.dir);
        }
        if !socket_of(self.duty.dir.path()).exists() {
            made = made.and_then(|()| self.listen());
        }
        let mut text = in_words(&befell, &before);
        if let Err(error) = made {
            text = format!("{text}; commands cannot ask it anything: {error}");
        }
        self.say(Level::Warn, "launch", text);
    }
}

/// What befell the folder, what comes of it and how to prevent it.
fn in_words(befell: &Befell, folder: &std::path::Path) -> String {
    let Befell {
        what,
        moved_to,
        is_closed,
    } = befell;
    let folder = folder.display();
    let now = match moved_to {
        Some(path) => format!("it is made anew as {}", path.display()),
        None => "it is made anew".to_owned(),
    };
    let (joined, prevent) = match is_closed {
        true => (
            ", but nobody can join it until a node is restarted (`tricurve node restart`)",
            "at a logout the system removes what its user shared: `loginctl enable-linger`, or RemoveIPC=no in logind.conf",
        ),
        false => (
            "",
            "whatever removes old files there is to spare it, or XDG_RUNTIME_DIR is to be a folder that stays",
        ),
    };
    format!(
        "{what} was removed while the graph runs ({folder}): {now}, and the graph goes on{joined}; to prevent it, {prevent}"
    )
}

/// Ends a node's process, by force if it lives, and reaps it.
pub(super) fn end(node: &mut Node) -> Option<ExitStatus> {
    node.orders = None;
    if let Ok(Some(status)) = node.child.try_wait() {
        return Some(status);
    }
    // Its output has ended or it shall end at once: give it the time to exit by itself, then insist.
    let deadline = Instant::now() + Duration::from_millis(300);
    while Instant::now() < deadline {
        if let Ok(Some(status)) = node.child.try_wait() {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    node.child.kill().unwrap_or_default();
    node.child.wait().ok()
}

fn how_it_ended(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (_, Some(7)) => "was killed by SIGBUS: shared memory is full".to_owned(),
        (_, Some(signal)) => format!("was killed by signal {signal}"),
        (Some(code), None) => format!("ended with code {code}"),
        (None, None) => "ended".to_owned(),
    }
}
