//! Starts the nodes, watches them, restarts the dead, ends the run and balances its ledger.
//!
//! ```text
//! assembling: all have ports ─► connect all ─► all connected ─► begin  (again after each restart, then: resend)
//! running:    until capture has finished: source exhausted or drained, every admitted scan done
//! ending:     stop node by node along the pipe; the recorder comes last and gets the whole ledger
//! ```

mod asked;
mod deaths;
mod telling;

use std::collections::{BTreeMap, VecDeque};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStdin, Command as Process, Stdio};
use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, unbounded};
use messages::bus::{Answer, Command, Event, Level, Log, NodeReport, Play, Playing, Progress};
use messages::change::Change;
use messages::ledger::Ledger;

use crate::asks::Asked;
use crate::cli::BE_NODE;
use crate::keys::{self, Key, Keys};
use crate::node::Orders;
use crate::parameters::Parameters;
use crate::rundir::RunDir;
use crate::said::Sayings;
use crate::{Failure, Outcome};
use asked::{Pending, Told};
use deaths::end;

/// What the supervisor is told.
pub(crate) struct Duty {
    /// The nodes' names, along the pipe.
    pub(crate) nodes: Vec<String>,
    /// The run's folder.
    pub(crate) dir: RunDir,
    /// What lies in it for the nodes.
    pub(crate) orders: Orders,
    /// What was said before the start.
    pub(crate) said: Vec<Log>,
    /// Restarts allowed before the next scan is done.
    pub(crate) restarts: u32,
    /// How long nothing may move.
    pub(crate) patience: Duration,
    /// What can be set while it runs.
    pub(crate) parameters: Parameters,
    /// Settings that hold otherwise from a scan on.
    pub(crate) changes: Vec<Change>,
    /// The nodes that take nothing from the pipe and give it nothing: it goes on without them.
    pub(crate) guests: Vec<String>,
    /// Why the source cannot be sought in, if it cannot.
    pub(crate) no_seek: Option<&'static str>,
}

/// What a run came to.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) outcome: Outcome,
    pub(crate) ledger: Ledger,
    /// Each node's last report, along the pipe.
    pub(crate) reports: Vec<NodeReport>,
    /// How often each node was restarted.
    pub(crate) restarts: BTreeMap<String, u32>,
    /// From the first word to begin to the last scan done.
    pub(crate) seconds: f64,
}

/// Sees how a run goes on.
pub(crate) trait Watcher {
    /// How far the scans have come.
    fn progress(&mut self, progress: &Progress);
    /// How the source plays from now on.
    fn playing(&mut self, _playing: &Playing) {}
    /// Whether keys control how the run goes on.
    fn has_keys(&self) -> bool;
    /// Something to tell the user.
    fn say(&mut self, level: Level, node: &str, text: &str);
    /// Whether what was to be seen was seen: then no further scan goes in, and the pipe drains.
    fn has_enough(&self) -> bool {
        false
    }
}

/// What happens to the supervisor.
enum News {
    Event(usize, u32, Event),
    /// A node's standard output ended: it is dead.
    Gone(usize, u32),
    Signal,
    Key(Key),
    Asked(Asked),
}

struct Node {
    name: String,
    child: Child,
    orders: Option<ChildStdin>,
    life: u32,
    has_ports: bool,
    is_connected: bool,
    has_begun: bool,
    /// The next line it is to get of what is said, if it records that.
    listens: Option<u64>,
    report: Option<NodeReport>,
    has_finished: bool,
}

impl Node {
    fn tell(&mut self, command: &Command) {
        // A node that cannot be told is dead, and its death is heard elsewhere.
        if let (Some(orders), Ok(mut line)) = (&mut self.orders, serde_json::to_vec(command)) {
            line.push(b'\n');
            orders
                .write_all(&line)
                .and_then(|()| orders.flush())
                .unwrap_or_default();
        }
    }
}

/// How long a node may take to make its ports, or to end.
const GRACE: Duration = Duration::from_secs(60);

pub(crate) struct Supervisor<'a, W> {
    duty: Duty,
    watcher: &'a mut W,
    nodes: Vec<Node>,
    news: Receiver<News>,
    teller: Sender<News>,
    progress: Progress,
    restarts: BTreeMap<String, u32>,
    restarts_since_progress: u32,
    connecting: bool,
    /// Whether the graph as a whole has begun once.
    has_begun: bool,
    /// Whether no process can join any more: what its nodes share was removed.
    is_closed: bool,
    next_look: Instant,
    said: Sayings,
    signals: u32,
    is_draining: bool,
    moved: Instant,
    has_resent: bool,
    playing: Option<Playing>,
    /// How the source played that died, for its successor.
    played: Option<Playing>,
    /// Changes that wait until those on their way have arrived.
    queued: Vec<(Vec<Change>, Sender<Answer>)>,
    pending: Option<Pending>,
    /// Who waits for the source to say how it plays.
    curious: Vec<Sender<Answer>>,
    /// What the source was told to play otherwise and has not answered yet, in order.
    told: VecDeque<Told>,
    /// How the run ends, when it ends badly; why was said.
    trouble: Option<Outcome>,
}

impl<'a, W: Watcher> Supervisor<'a, W> {
    /// Runs the nodes until all scans are done, a signal ends them or something fails for good.
    /// Gives back the run's folder too: what nodes left there is there as long as that is held.
    pub(crate) fn run(duty: Duty, watcher: &'a mut W) -> Result<(Ran, RunDir), Failure> {
        let (teller, news) = unbounded();
        let signals = signals(&teller)?;
        let keys = watcher
            .has_keys()
            .then(|| listen_to_keys(&teller))
            .flatten();
        if keys.is_some() {
            watcher.say(Level::Info, "launch", keys::HELP);
        }
        let mut said = Sayings::default();
        said.take_in(&duty.said);
        let mut supervisor = Self {
            duty,
            watcher,
            nodes: Vec::new(),
            news,
            teller,
            progress: Progress::default(),
            restarts: BTreeMap::new(),
            restarts_since_progress: 0,
            connecting: false,
            has_begun: false,
            is_closed: false,
            next_look: Instant::now(),
            said,
            signals: 0,
            is_draining: false,
            moved: Instant::now(),
            has_resent: false,
            playing: None,
            played: None,
            queued: Vec::new(),
            pending: None,
            curious: Vec::new(),
            told: VecDeque::new(),
            trouble: None,
        };
        supervisor
            .listen()
            .map_err(|e| Failure::failed(format!("cannot listen in the run's folder: {e}")))?;
        let result = supervisor.supervise();
        for node in &mut supervisor.nodes {
            end(node);
        }
        signals.close();
        drop(keys);
        Ok((result?, supervisor.duty.dir))
    }

    fn supervise(&mut self) -> Result<Ran, Failure> {
        for place in 0..self.duty.nodes.len() {
            let node = self.spawn(place, 0)?;
            self.nodes.push(node);
        }
        let mut began = None;
        while self.trouble.is_none() && !self.nodes[0].has_finished {
            self.hear(Duration::from_millis(500))?;
            if began.is_none() && self.nodes[0].has_begun {
                began = Some(Instant::now());
            }
            if self.signals > 1 {
                let seconds = began.map_or(0.0, |began| began.elapsed().as_secs_f64());
                return Ok(self.result(Outcome::Aborted, seconds));
            }
            if !self.is_draining && self.watcher.has_enough() {
                self.drain();
            }
            self.check_patience();
        }
        let seconds = began.map_or(0.0, |began| began.elapsed().as_secs_f64());
        self.end_all()?;
        let mut result = self.result(Outcome::Done, seconds);
        if let Some(outcome) = self.trouble {
            result.outcome = outcome;
        }
        if result.reports.iter().any(|report| report.failed.is_some()) {
            result.outcome = Outcome::Failed;
        }
        for fault in result.ledger.faults() {
            self.watcher.say(Level::Error, "ledger", &fault);
            if result.outcome == Outcome::Done {
                result.outcome = Outcome::Lost;
            }
        }
        Ok(result)
    }

    fn spawn(&self, place: usize, life: u32) -> Result<Node, Failure> {
        let name = self.duty.nodes[place].clone();
        let cannot =
            |e: std::io::Error| Failure::failed(format!("cannot start the node {name}: {e}"));
        let mut child = Process::new(std::env::current_exe().map_err(cannot)?)
            .args([BE_NODE, &name, "--life", &life.to_string()])
            .arg("--resume")
            .arg(
                serde_json::to_string(&self.progress)
                    .map_err(std::io::Error::from)
                    .map_err(cannot)?,
            )
            .arg("--run")
            .arg(self.duty.dir.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            // Its own process group: a terminal's Ctrl-C is for the launcher, which ends the nodes in order.
            .process_group(0)
            .spawn()
            .map_err(cannot)?;
        let orders = child.stdin.take();
        let out = child.stdout.take();
        let teller = self.teller.clone();
        let listen = move || {
            for line in out
                .into_iter()
                .flat_map(|out| BufReader::new(out).lines())
                .map_while(Result::ok)
            {
                if let Ok(event) = serde_json::from_str(&line)
                    && teller.send(News::Event(place, life, event)).is_err()
                {
                    return;
                }
            }
            teller.send(News::Gone(place, life)).unwrap_or_default();
        };
        std::thread::Builder::new()
            .name(format!("hear {name}"))
            .spawn(listen)
            .map_err(cannot)?;
        Ok(Node {
            name,
            child,
            orders,
            life,
            has_ports: false,
            is_connected: false,
            has_begun: false,
            listens: None,
            report: None,
            has_finished: false,
        })
    }

    /// Lets no further scan in.
    fn drain(&mut self) {
        self.is_draining = true;
        self.nodes[0].tell(&Command::Drain);
    }

    /// Takes in what happens, at most for this long.
    fn hear(&mut self, timeout: Duration) -> Result<(), Failure> {
        match self.news.recv_timeout(timeout) {
            Ok(News::Event(place, life, event)) if self.nodes[place].life == life => {
                self.event(place, event)
            }
            Ok(News::Gone(place, life)) if self.nodes[place].life == life => self.gone(place)?,
            Ok(News::Key(Key::Play(play))) => self.tell_to_play(play, None),
            Ok(News::Asked((ask, reply))) => self.asked(ask, reply),
            Ok(News::Signal | News::Key(Key::End)) => {
                self.signals += 1;
                if self.signals == 1 {
                    let text = "stopping: the pipe drains; once more aborts";
                    self.say(Level::Info, "launch", text);
                    self.drain();
                }
            }
            Ok(_) | Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
        }
        self.look_after_folder();
        self.assemble();
        Ok(())
    }

    fn event(&mut self, place: usize, event: Event) {
        match event {
            Event::Ports => self.nodes[place].has_ports = true,
            Event::Connected => self.nodes[place].is_connected = true,
            Event::Log(Log { level, node, text }) => self.say(level, &node, text),
            Event::Listens => self.listens(place),
            Event::Written { lines } => self.said.written(lines),
            Event::Progress(progress) => {
                if progress.done_below > self.progress.done_below {
                    self.restarts_since_progress = 0;
                }
                if progress != self.progress {
                    self.moved = Instant::now();
                    self.has_resent = false;
                    self.watcher.progress(&progress);
                    self.progress = progress;
                }
            }
            Event::Report(report) => {
                if self.nodes[place]
                    .report
                    .as_ref()
                    .is_none_or(|last| last.topics != report.topics)
                {
                    self.moved = Instant::now();
                }
                self.nodes[place].report = Some(report);
            }
            Event::Finished(report) => {
                if let Some(why) = &report.failed {
                    self.say(Level::Error, &report.node, why.as_str());
                }
                self.nodes[place].report = Some(report);
                self.nodes[place].has_finished = true;
                self.noted(place);
            }
            Event::Playing(playing) => self.playing(playing),
            Event::Held { admitted } => self.held(admitted),
            Event::Changed { count } if count >= self.duty.changes.len() => self.noted(place),
            Event::Changed { .. } => {}
        }
    }

    /// Brings all nodes to where everybody is connected and has begun.
    fn assemble(&mut self) {
        let live = || self.nodes.iter().filter(|n| !n.has_finished);
        if self.nodes.len() < self.duty.nodes.len() || live().all(|n| n.has_begun && n.is_connected)
        {
            return;
        }
        let all_have_ports = live().all(|n| n.has_ports);
        let all_are_connected = live().all(|n| n.is_connected);
        if !self.connecting && all_have_ports {
            self.connecting = true;
            for node in &mut self.nodes {
                node.tell(&Command::Connect);
            }
        }
        if self.connecting && all_are_connected {
            self.connecting = false;
            // Now all is there that they share: whatever is removed from now on can be made anew.
            self.look_after_folder_now();
            let is_restart = std::mem::replace(&mut self.has_begun, true);
            self.play_on();
            // The door opens last.
            for node in self.nodes.iter_mut().rev().filter(|n| !n.has_begun) {
                // Until changes on their way have arrived it stays closed.
                if self.pending.is_some() {
                    node.tell(&Command::Hold);
                }
                node.tell(&Command::Begin);
                node.has_begun = true;
            }
            if is_restart {
                self.nodes[0].tell(&Command::Resend);
            }
            if self.is_draining {
                self.nodes[0].tell(&Command::Drain);
            }
        }
    }

    /// Has a new source play as the one before it was told to.
    fn play_on(&mut self) {
        let Some(played) = self.played.take() else {
            return;
        };
        if let Some(rate) = played.rate {
            self.tell_to_play(Play::Rate(rate), None);
        }
        let state = if played.is_paused {
            Play::Stop
        } else {
            Play::Resume
        };
        self.tell_to_play(state, None);
    }

    /// When nothing moves, sends the scans under way once more; when that does not help, gives up.
    fn check_patience(&mut self) {
        let idle = self.moved.elapsed();
        let under_way = self.progress.admitted - self.progress.done.min(self.progress.admitted);
        // A guest that gave up is missed by nobody.
        let mut present = self.nodes.iter().filter(|n| !n.has_finished);
        let assembled = present.all(|n| n.has_begun && n.is_connected);
        if assembled {
            self.end_who_does_not_note();
        }
        if !assembled && idle > GRACE.max(self.duty.patience) {
            let silent = self
                .nodes
                .iter()
                .filter(|n| !n.has_finished && (!n.has_ports || !n.is_connected));
            let names: Vec<&str> = silent.map(|n| n.name.as_str()).collect();
            let text = format!("{} did not get ready: the run ends", names.join(", "));
            self.fail(Outcome::Failed, &text);
        } else if assembled && under_way > 0 && idle > 4 * self.duty.patience {
            let text = format!("nothing moves with {under_way} scans under way: the run gives up");
            self.fail(Outcome::Lost, &text);
        } else if assembled && under_way > 0 && idle > self.duty.patience && !self.has_resent {
            self.has_resent = true;
            let text = "nothing moves: the scans under way are sent once more";
            self.say(Level::Warn, "launch", text);
            self.nodes[0].tell(&Command::Resend);
        }
    }

    /// Stops the nodes one by one along the pipe. One that is killed meanwhile is restarted, so that it ends in order.
    fn end_all(&mut self) -> Result<(), Failure> {
        // Who records what is said comes last.
        let mut places: Vec<usize> = (0..self.nodes.len()).collect();
        places.sort_by_key(|place| self.nodes[*place].listens.is_some());
        for place in places {
            if self.nodes[place].listens.is_some() {
                self.say_totals();
            }
            let ledger = self.ledger();
            let mut told = None;
            let deadline = Instant::now() + GRACE;
            loop {
                if told != Some(self.nodes[place].life) {
                    told = Some(self.nodes[place].life);
                    self.nodes[place].tell(&Command::Stop {
                        ledger: Some(ledger.clone()),
                    });
                }
                let is_over = !matches!(self.nodes[place].child.try_wait(), Ok(None));
                if is_over && (self.nodes[place].has_finished || self.trouble.is_some()) {
                    break;
                }
                if self.signals > 1 {
                    self.fail(Outcome::Aborted, "aborted before everything had ended");
                    return Ok(());
                }
                if Instant::now() > deadline {
                    let text = format!(
                        "{} did not end in time and was killed",
                        self.nodes[place].name
                    );
                    self.fail(Outcome::Failed, &text);
                    break;
                }
                self.hear(Duration::from_millis(20))?;
            }
            end(&mut self.nodes[place]);
        }
        self.say_totals();
        Ok(())
    }

    fn ledger(&self) -> Ledger {
        let topics = |node: &Node| Some((node.name.clone(), node.report.as_ref()?.topics.clone()));
        Ledger {
            admitted: self.progress.admitted,
            done: self.progress.done,
            refused: self.progress.refused.clone(),
            nodes: self
                .nodes
                .iter()
                .filter_map(topics)
                .filter(|(_, topics)| !topics.is_empty())
                .collect(),
        }
    }

    fn result(&self, outcome: Outcome, seconds: f64) -> Ran {
        Ran {
            outcome,
            ledger: self.ledger(),
            reports: self.nodes.iter().filter_map(|n| n.report.clone()).collect(),
            restarts: self.restarts.clone(),
            seconds,
        }
    }
}

fn listen_to_keys(teller: &Sender<News>) -> Option<Keys> {
    let teller = teller.clone();
    Keys::listen(move |key| teller.send(News::Key(key)).unwrap_or_default())
}

/// Hears SIGINT, SIGTERM and SIGHUP, which mean the same.
fn signals(teller: &Sender<News>) -> Result<signal_hook::iterator::Handle, Failure> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let cannot = |e| Failure::failed(format!("cannot listen to signals: {e}"));
    let mut heard = vec![SIGINT, SIGTERM];
    // One that is to outlive its terminal does not hear that the terminal is gone.
    heard.extend((!crate::signals::is_ignored(SIGHUP)).then_some(SIGHUP));
    let mut signals = signal_hook::iterator::Signals::new(heard).map_err(cannot)?;
    let handle = signals.handle();
    let teller = teller.clone();
    let listen = move || {
        for _ in signals.forever() {
            if teller.send(News::Signal).is_err() {
                return;
            }
        }
    };
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(listen)
        .map_err(cannot)?;
    Ok(handle)
}
