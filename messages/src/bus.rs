//! The bus: how nodes exchange messages between processes. The only code that names iceoryx2.
//!
//! ```text
//!                 topics: one service each, payloads written and read in place in shared memory
//!  node ─► Outputs ───────────────────────────────────────────────► Inputs ─► Bus::next ─► node
//!    ▲                 inboxes: one event service a node, rung after each message
//!    │
//!    └── commands (standard input) ── launcher ◄── events (standard output)
//! ```
//!
//! Flow control is at the door, in capture, and nowhere else: capture keeps fewer than [`Run::in_flight`] scans under
//! way and every subscriber's buffer holds more than twice that, so no buffer overflows and no publisher blocks.
//!
//! Instances of a node share its scans by number ([`Shard`]): each takes and makes the messages of its own, publishes them
//! on services of its own, and counts them in the ledger. Who joins scans of several instances gets them in order.
//!
//! A node never waits for another one, only for its inbox. A launcher that dies closes its children's standard input;
//! they then end by themselves.

mod ask;
mod control;
mod descriptors;
mod doctor;
mod drive;
mod frames;
mod gate;
mod guest;
mod inputs;
mod meter;
mod outputs;
mod ports;
mod tuned;

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, Select};
use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::*;
use serde::{Deserialize, Serialize};

use crate::change::Change;
use crate::header::{Header, Sway};
use crate::ledger::{Account, Ledger, Seen, Shard};
use crate::payload::Kind;
use crate::rig::{Delivery, Rig};
use crate::synchronisation::Synchronisation;
use crate::topic::Topic;

pub use ask::{
    Answer, Ask, LONGEST_LINE, NodeState, Parameter, State, ask, read_changes, socket_of,
    write_changes,
};
pub use control::{Command, Event, Level, Log, NodeReport, Play, Playing, Progress};
pub use descriptors::OpenFiles;
pub use doctor::Doctor;
pub use drive::{Ahead, Drive, Driven, Read};
pub use frames::{FrameIn, FramesIn, FramesOut};
pub use guest::{Guest, Hearer, LOOK_EVERY, Reports};
pub use inputs::{Inputs, Joined, Joins, Received};
pub use meter::{Meter, Percentiles};
pub use outputs::{Filled, Loan, Outputs};
pub use tuned::Tuned;

use ports::Ports;

/// One node of a run, as the others need to know it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodePlan {
    /// Its name, unique in the run: of further instances of a node with their number, as in `match.2`.
    pub name: String,
    /// Which scans are its own.
    #[serde(default)]
    pub shard: Shard,
    /// The kinds of message it takes in.
    pub takes: Vec<Kind>,
    /// The kinds of message it makes.
    pub makes: Vec<Kind>,
    /// Whether a scan is done only when this node says so.
    pub finishes: bool,
}

/// The node that this name is an instance of.
pub fn node_of(name: &str) -> &str {
    name.split_once('.').map_or(name, |(node, _)| node)
}

/// One run of a graph: what every process of it must know to meet the others and nobody else.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Folder of the run, private to the user; the bus keeps its files there.
    pub root: PathBuf,
    /// What the names of the run's shared memory begin with.
    pub prefix: String,
    /// Views, channels, sizes.
    pub rig: Rig,
    /// What happens to a scan that finds the door closed.
    pub delivery: Delivery,
    /// Whether scans come from cameras, of whose frames there is an account.
    #[serde(default)]
    pub cameras: bool,
    /// How many scans may be under way.
    pub in_flight: usize,
    /// All nodes, in the order of the pipe.
    pub nodes: Vec<NodePlan>,
}

impl Run {
    /// Messages a subscriber's buffer holds: more than two windows, since a resend can double what is under way.
    pub fn buffer(&self) -> usize {
        2 * (self.in_flight + self.rig.reach() as usize) + 4
    }

    /// The kinds of message that this node takes of those that are made, in the order of the pipe.
    pub fn taken_by(&self, name: &str) -> Vec<Kind> {
        let node = self.nodes.iter().find(|node| node.name == name);
        let mut kinds = self.kinds();
        kinds.retain(|kind| node.is_some_and(|node| node.takes.contains(kind)));
        kinds
    }

    /// The kinds of message that some node takes, in the order of the pipe.
    pub fn taken(&self) -> Vec<Kind> {
        let is_taken = |kind: &Kind| self.takers(*kind).next().is_some();
        Kind::all().filter(is_taken).collect()
    }

    /// The kinds of message that are made, in the order of the pipe.
    pub fn kinds(&self) -> Vec<Kind> {
        let is_made = |kind: &Kind| self.nodes.iter().any(|n| n.makes.contains(kind));
        Kind::all().filter(is_made).collect()
    }

    /// Whether some node has several instances, whose results overtake each other.
    pub fn is_sharded(&self) -> bool {
        self.nodes.iter().any(|node| !node.shard.is_all())
    }

    /// The shards in which messages of this kind are made: one an instance, each with a service of its own.
    fn shards_of(&self, kind: Kind) -> impl Iterator<Item = Shard> + '_ {
        let makers = self.nodes.iter().filter(move |n| n.makes.contains(&kind));
        makers.map(|node| node.shard)
    }

    /// The nodes that take this kind of message.
    fn takers(&self, kind: Kind) -> impl Iterator<Item = &NodePlan> {
        self.nodes.iter().filter(move |n| n.takes.contains(&kind))
    }

    /// Bytes of shared memory that all scans under way need in the worst case, every pixel a zero-crossing.
    pub fn worst_case_bytes(&self) -> u64 {
        let size = self.rig.size;
        let words = |kind: Kind| kind.definition().words(size) as u64 * 8;
        let topics = self.kinds().into_iter();
        let topics = topics.flat_map(|kind| Topic::of(&self.rig, kind));
        let scan: u64 = topics.map(|topic| words(topic.kind)).sum();
        scan * (self.in_flight as u64 + self.rig.reach())
    }
}

/// What a node is told when its process starts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Start {
    /// How many times it was started before in this run.
    pub life: u32,
    /// How far the scans had come when it was started.
    pub resume: Progress,
    /// The run's whole effective configuration: the graph's keys and every node's.
    pub configuration: serde_json::Value,
    /// The graph as a Mermaid diagram.
    pub graph: String,
    /// The names of the source's scans, where they have some.
    pub scans: Vec<String>,
    /// Where a rail's frames were taken, in the source's own steps, where it had to look at all of them to know.
    pub places: Vec<f64>,
    /// By how much each of a rail's frames is off, where it was looked at.
    pub sway: Vec<Sway>,
    /// Settings that hold otherwise from a scan on.
    pub changes: Vec<Change>,
}

/// Why the bus failed.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// A port or service could not be made.
    #[error("the bus could not {what}: {cause}")]
    Port {
        /// What it tried.
        what: String,
        /// What iceoryx2 said.
        cause: String,
    },
    /// A message's lengths or indices do not fit.
    #[error("scan {sequence} of {topic} is damaged: its lengths or indices do not fit")]
    Damaged {
        /// The topic.
        topic: String,
        /// The scan.
        sequence: u64,
    },
    /// So many listen already that there is room for nobody else.
    #[error(
        "a run has room for {0} listeners beside its own nodes, and they are there already: end a viewer, a recorder, a \
         `top` or a `topic`"
    )]
    Full(usize),
    /// The node is not in the run's plan.
    #[error("the run has no node named {0}")]
    Unknown(String),
}

/// Whether the bus failed in this process, of which it is a part at most once.
static HAS_FAILED: AtomicBool = AtomicBool::new(false);

/// Whether it was the bus that failed in this process: then another one in its place may fare better.
pub fn has_failed() -> bool {
    HAS_FAILED.load(Ordering::Relaxed)
}

impl BusError {
    fn port(what: impl Into<String>, cause: impl std::fmt::Debug) -> Self {
        HAS_FAILED.store(true, Ordering::Relaxed);
        Self::Port {
            what: what.into(),
            cause: format!("{cause:?}"),
        }
    }
}

/// A node's account of one topic, as it goes.
#[derive(Debug, Default)]
struct Tally {
    received: Option<Seen>,
    published: Option<Seen>,
    duplicates: u64,
    dropped: BTreeMap<String, u64>,
}

/// What a node counts, shared by its ports.
#[derive(Debug, Default)]
struct Book {
    /// The scans that are the node's own: what is seen is counted by its place among them.
    shard: Shard,
    topics: BTreeMap<String, Tally>,
    /// Scans this node has said to be done, if it is one that says so.
    done: Option<Seen>,
    /// Bytes of what all published messages hold.
    bytes: u64,
    /// Scans below this one went through the node whose place this one takes.
    done_below: u64,
    /// Whether it takes the place of one that died.
    is_successor: bool,
    meter: Meter,
    synchronisation: Option<Box<Synchronisation>>,
    warnings: Vec<String>,
    /// When the node was handed its last message or published its last one.
    mark: Option<Instant>,
}

impl Book {
    fn tally(&mut self, topic: &str) -> &mut Tally {
        self.topics.entry(topic.to_owned()).or_default()
    }

    /// Keeps account of a topic that is taken in.
    fn take_in(&mut self, topic: &str) {
        let done_below = self.shard.below(self.done_below);
        self.tally(topic)
            .received
            .get_or_insert_default()
            .advance(done_below);
    }

    /// Keeps account of a topic that is published.
    fn send_out(&mut self, topic: &str) {
        let done_below = self.shard.below(self.done_below);
        self.tally(topic)
            .published
            .get_or_insert_default()
            .advance(done_below);
        self.meter.expect_one_more();
    }

    fn received(&mut self, topic: &str, header: &Header) -> bool {
        self.advance(header.done_below);
        let place = self.shard.below(header.sequence);
        let tally = self.tally(topic);
        let is_new = tally.received.get_or_insert_default().insert(place);
        tally.duplicates += u64::from(!is_new);
        is_new
    }

    fn published(&mut self, topic: &str, sequence: u64) {
        let place = self.shard.below(sequence);
        let tally = self.tally(topic);
        tally.published.get_or_insert_default().insert(place);
    }

    fn finished(&mut self, sequence: u64) {
        let place = self.shard.below(sequence);
        self.done.get_or_insert_default().insert(place);
    }

    /// What was done before a successor had its ports it never sees, and nobody sends it again.
    fn advance(&mut self, done_below: u64) {
        if self.is_successor && done_below > self.done_below {
            self.done_below = done_below;
            let done_below = self.shard.below(done_below);
            if let Some(done) = &mut self.done {
                done.advance(done_below);
            }
            for tally in self.topics.values_mut() {
                let sets = [&mut tally.received, &mut tally.published];
                for seen in sets.into_iter().flatten() {
                    seen.advance(done_below);
                }
            }
        }
    }

    fn accounts(&self) -> BTreeMap<String, Account> {
        let account = |tally: &Tally| Account {
            shard: self.shard,
            received: tally.received.as_ref().map(Seen::count),
            published: tally.published.as_ref().map(Seen::count),
            duplicates: tally.duplicates,
            dropped: tally.dropped.clone(),
            missing: {
                let places = tally.received.iter().flat_map(Seen::missing);
                places.map(|place| self.shard.nth(place)).collect()
            },
        };
        let entry = |(name, tally): (&String, &Tally)| (name.clone(), account(tally));
        self.topics.iter().map(entry).collect()
    }
}

/// What the launcher asked of a node between two messages.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Begin: every port is connected.
    Begin,
    /// Send the scans under way once more: a node was restarted.
    Resend,
    /// Finish: take in no new scan, let the pipe drain.
    Drain,
    /// Play otherwise.
    Play(Play),
    /// Let no scan in until told to go on.
    Hold,
    /// Let scans in again.
    Go,
    /// End now; the whole run's ledger, for who records it. Without one the launcher is dead.
    Stop(Option<Box<Ledger>>),
}

/// How often a node reports its ledger.
const REPORT_EVERY: Duration = Duration::from_secs(1);

/// A node's end of the bus.
pub struct Bus {
    run: Run,
    name: String,
    ports: Ports,
    inbox: Listener<ipc::Service>,
    commands: Receiver<Command>,
    waiting: VecDeque<Request>,
    reports: ports::Reports,
    book: Rc<RefCell<Book>>,
    changes: Rc<RefCell<Vec<Change>>>,
    /// What was said and is not taken yet, and the number of the line that comes next.
    said: (VecDeque<Log>, u64),
    /// How many times the node was started before.
    life: u32,
    subscribers: Vec<Rc<ports::DataSubscriber>>,
    began: Instant,
    next_report: Instant,
}

impl std::fmt::Debug for Bus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bus")
            .field("name", &self.name)
            .field("run", &self.run)
            .finish_non_exhaustive()
    }
}

impl Bus {
    /// Joins a run as the node of this name; when it takes the place of one that died, it starts where that one stood.
    /// Commands are read from standard input, events written to standard output, so a process has one bus.
    ///
    /// # Errors
    /// When the node is not in the plan or the shared memory cannot be set up.
    pub fn join(run: Run, name: &str, start: &Start) -> Result<Self, BusError> {
        // What was done when its predecessor died was done by that.
        let successor_from = (start.life > 0).then_some(start.resume.done_below);
        let Some(plan) = run.nodes.iter().find(|node| node.name == name) else {
            return Err(BusError::Unknown(name.to_owned()));
        };
        let shard = plan.shard;
        let ports = Ports::new(&run, name)?;
        let inbox = ports.inbox(name)?;
        let commands = control::listen(&run, name)?;
        let reports = ports.reports_out()?;
        Ok(Self {
            ports,
            inbox,
            commands,
            reports,
            changes: Rc::new(RefCell::new(start.changes.clone())),
            said: (VecDeque::new(), 0),
            life: start.life,
            waiting: VecDeque::new(),
            book: Rc::new(RefCell::new(Book {
                shard,
                done_below: successor_from.unwrap_or_default(),
                is_successor: successor_from.is_some(),
                ..Book::default()
            })),
            subscribers: Vec::new(),
            began: Instant::now(),
            next_report: Instant::now() + REPORT_EVERY,
            name: name.to_owned(),
            run,
        })
    }

    /// The node's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The run.
    pub fn run(&self) -> &Run {
        &self.run
    }

    /// Subscribes to every topic of these kinds.
    ///
    /// # Errors
    /// When a subscriber cannot be made.
    pub fn inputs(&mut self, kinds: &[Kind]) -> Result<Inputs, BusError> {
        let topics = kinds
            .iter()
            .flat_map(|&kind| Topic::of(&self.run.rig, kind));
        let inputs = Inputs::new(&self.run, &self.ports, topics, Rc::clone(&self.book))?;
        self.subscribers.extend(inputs.subscribers());
        Ok(inputs)
    }

    /// Subscribes to every topic of these kinds, to be handed over scan by scan.
    ///
    /// # Errors
    /// When a subscriber cannot be made.
    pub fn joins(&mut self, kinds: &[Kind]) -> Result<Joins, BusError> {
        let inputs = self.inputs(kinds)?;
        Ok(match self.run.is_sharded() {
            true => Joins::in_order(inputs, self.book.borrow().done_below, self.run.in_flight),
            false => Joins::new(inputs),
        })
    }

    /// Publishes every topic of these kinds.
    ///
    /// # Errors
    /// When a publisher cannot be made.
    pub fn outputs(&mut self, kinds: &[Kind]) -> Result<Outputs, BusError> {
        Outputs::new(
            &self.run,
            &self.ports,
            kinds,
            |_| true,
            Rc::clone(&self.book),
        )
    }

    /// Publishes every topic of these kinds for those who listen: what no node of the run takes is published only while
    /// a guest [wants](Outputs::is_wanted) it, and no ledger counts it.
    ///
    /// # Errors
    /// When a publisher cannot be made.
    pub fn outputs_on_demand(&mut self, kinds: &[Kind]) -> Result<Outputs, BusError> {
        let is_taken = |kind| self.run.takers(kind).next().is_some();
        Outputs::new(
            &self.run,
            &self.ports,
            kinds,
            is_taken,
            Rc::clone(&self.book),
        )
    }

    /// The way to say that a scan is done.
    ///
    /// # Errors
    /// When the publisher cannot be made.
    pub fn finisher(&mut self) -> Result<Finisher, BusError> {
        let index = self.run.nodes.iter().position(|n| n.name == self.name);
        {
            let book = &mut *self.book.borrow_mut();
            let done = book.done.get_or_insert_default();
            done.advance(book.shard.below(book.done_below));
        }
        Ok(Finisher {
            book: Rc::clone(&self.book),
            publisher: self.ports.done_out()?,
            doors: self.ports.bells(
                self.run
                    .nodes
                    .iter()
                    .filter(|n| n.makes.contains(&Kind::Image)),
            )?,
            index: index.unwrap_or_default() as u64,
        })
    }

    /// Hears which scans are done; for the node at the door.
    fn dones(&mut self) -> Result<Dones, BusError> {
        let subscriber = Rc::new(self.ports.done_in()?);
        self.subscribers.push(Rc::clone(&subscriber));
        let finishes = |(i, n): (usize, &NodePlan)| n.finishes.then_some((i as u64, n.shard));
        Ok(Dones {
            subscriber,
            finishers: self
                .run
                .nodes
                .iter()
                .enumerate()
                .filter_map(finishes)
                .collect(),
            heard: BTreeMap::new(),
        })
    }

    /// Hears what all nodes report, and gets every line that is [said](Self::said); for who records it.
    ///
    /// # Errors
    /// When the subscriber cannot be made.
    pub fn hear_reports(&mut self) -> Result<ReportsIn, BusError> {
        control::say(&Event::Listens);
        Ok(ReportsIn {
            subscriber: self.ports.reports_in()?,
        })
    }

    /// A line that a node or the launcher said, in order from the first one on, whenever this node began to listen.
    pub fn said(&mut self) -> Option<Log> {
        self.said.0.pop_front()
    }

    /// The number of the first line that was not [taken](Self::said) yet.
    pub fn said_until(&self) -> u64 {
        self.said.1 - self.said.0.len() as u64
    }

    /// The lines before this number are on the disk: who takes this node's place need not record them.
    pub fn has_written(&self, lines: u64) {
        control::say(&Event::Written { lines });
    }

    /// A bell of this node's own inbox, made in the calling thread: for a thread that has news for the node.
    ///
    /// # Errors
    /// When the notifier cannot be made.
    pub fn own_bell(run: &Run, name: &str) -> Result<Bell, BusError> {
        Bell::new(run, name)
    }

    /// Tells the launcher that all ports are made, and waits for the word that everybody's are connected.
    ///
    /// # Errors
    /// When a port cannot be connected.
    pub fn ready(&mut self) -> Result<(), BusError> {
        control::say(&Event::Ports);
        let mut early = VecDeque::new();
        loop {
            match self.request(Duration::from_secs(1))? {
                Some(Request::Begin) => break,
                Some(stop @ Request::Stop(_)) => {
                    early.push_back(stop);
                    break;
                }
                Some(other) => early.push_back(other),
                None => {}
            }
        }
        // What was asked before is done now.
        early.append(&mut self.waiting);
        self.waiting = early;
        Ok(())
    }

    fn is_stopping(&self) -> bool {
        let stops = |r: &Request| matches!(r, Request::Stop(_));
        self.waiting.iter().any(stops)
    }

    /// The next message of these inputs, the oldest scan first; waits for it. `None` when the node shall stop.
    ///
    /// # Errors
    /// When a subscriber fails.
    pub fn next(&mut self, inputs: &mut Inputs) -> Result<Option<Received>, BusError> {
        loop {
            self.obey()?;
            if let Some(received) = inputs.receive()? {
                self.book.borrow_mut().mark = Some(Instant::now());
                return Ok(Some(received));
            }
            if self.is_stopping() {
                return Ok(None);
            }
            self.sleep(self.until_report())?;
        }
    }

    /// The next scan of which every input has come; waits for it. `None` when the node shall stop.
    ///
    /// # Errors
    /// When a subscriber fails.
    pub fn next_scan(&mut self, joins: &mut Joins) -> Result<Option<Joined>, BusError> {
        loop {
            self.obey()?;
            if let Some(joined) = self.scan_now(joins)? {
                return Ok(Some(joined));
            }
            if self.is_stopping() {
                return Ok(None);
            }
            self.sleep(self.until_report())?;
        }
    }

    /// A scan of which every input has come, without waiting for it.
    ///
    /// # Errors
    /// When a subscriber fails.
    pub fn scan_now(&mut self, joins: &mut Joins) -> Result<Option<Joined>, BusError> {
        let joined = joins.receive()?;
        self.book.borrow_mut().mark = Some(Instant::now());
        Ok(joined)
    }

    /// Adds what this node spent on a scan, for one that publishes nothing.
    pub fn spent(&self, duration: Duration) {
        self.book.borrow_mut().meter.scan(duration);
    }

    /// The next request of the launcher; waits up to `timeout` for it or for the inbox.
    ///
    /// # Errors
    /// When the inbox fails.
    pub fn request(&mut self, timeout: Duration) -> Result<Option<Request>, BusError> {
        self.obey()?;
        if self.waiting.is_empty() && !timeout.is_zero() {
            self.sleep(timeout.min(self.until_report()))?;
            self.obey()?;
        }
        self.book.borrow_mut().mark = Some(Instant::now());
        Ok(self.waiting.pop_front())
    }

    /// Waits until the launcher asks for something, `others` has something or the time is over; for a node that has more
    /// to hear than its inbox.
    pub fn wait_beside<T>(&self, others: &Receiver<T>, timeout: Duration) {
        let mut either = Select::new();
        either.recv(&self.commands);
        either.recv(others);
        // Which of them it is, or that it is none, is seen where they are read.
        let heard = either.ready_timeout(timeout);
        heard.map(drop).unwrap_or_default();
    }

    fn until_report(&self) -> Duration {
        self.next_report.saturating_duration_since(Instant::now())
    }

    /// Sleeps until the inbox is rung or the time is over.
    fn sleep(&self, timeout: Duration) -> Result<(), BusError> {
        if !self.commands.is_empty() {
            return Ok(());
        }
        ports::wait(&self.inbox, timeout)
    }

    /// Does what the launcher asked meanwhile, and reports when it is time to.
    fn obey(&mut self) -> Result<(), BusError> {
        while let Ok(command) = self.commands.try_recv() {
            match command {
                Command::Connect => {
                    for subscriber in &self.subscribers {
                        ports::connect(subscriber)?;
                    }
                    control::say(&Event::Connected);
                }
                Command::Begin => self.waiting.push_back(Request::Begin),
                Command::Resend => self.waiting.push_back(Request::Resend),
                Command::Drain => self.waiting.push_back(Request::Drain),
                Command::Play { play } => self.waiting.push_back(Request::Play(play)),
                Command::Hold => self.waiting.push_back(Request::Hold),
                Command::Go => self.waiting.push_back(Request::Go),
                Command::Change { before, changes } => {
                    let mut noted = self.changes.borrow_mut();
                    // Who has just started may have read them already.
                    noted.truncate(before);
                    noted.extend(changes);
                    control::say(&Event::Changed { count: noted.len() });
                }
                Command::Said { from, lines } => {
                    self.said.1 = from + lines.len() as u64;
                    self.said.0.extend(lines);
                }
                Command::Stop { ledger } => {
                    // When all are done, those a successor never saw went through its predecessor.
                    if let Some(ledger) = ledger.as_ref().filter(|l| l.done == l.admitted) {
                        self.book.borrow_mut().advance(ledger.done);
                    }
                    self.waiting.push_back(Request::Stop(ledger.map(Box::new)));
                }
            }
        }
        if self.next_report <= Instant::now() {
            self.next_report = Instant::now() + REPORT_EVERY;
            let report = self.report(&[]);
            self.tell(&Event::Report(report));
        }
        Ok(())
    }

    /// What this node has counted so far, with counts of its own.
    pub fn report(&self, counts: &[(&str, u64)]) -> NodeReport {
        let book = self.book.borrow();
        let count = |(name, count): &(&str, u64)| ((*name).to_owned(), *count);
        NodeReport {
            node: self.name.clone(),
            topics: book.accounts(),
            milliseconds: book.meter.percentiles(),
            counts: counts.iter().map(count).collect(),
            done: book.done.as_ref().map(Seen::count),
            bytes: book.bytes,
            seconds: self.began.elapsed().as_secs_f64(),
            synchronisation: book.synchronisation.clone(),
            warnings: book.warnings.clone(),
            failed: None,
            life: self.life,
        }
    }

    /// Sends the last report, with counts of its own: the node has done its work.
    pub fn finish(&self, counts: &[(&str, u64)]) {
        self.send_last(self.report(counts));
    }

    /// Sends the last report: the node did what it could, and why that was not all.
    pub fn finish_failed(&self, why: impl ToString, counts: &[(&str, u64)]) {
        self.send_last(NodeReport {
            failed: Some(why.to_string()),
            ..self.report(counts)
        });
    }

    fn send_last(&self, report: NodeReport) {
        self.tell(&Event::Finished(report));
    }

    /// Tells the launcher, and who records what nodes say.
    fn tell(&self, event: &Event) {
        self.reports.send(event);
        control::say(event);
    }

    /// What came of the cameras' frames so far: it goes into this node's reports.
    pub fn synchronised(&self, account: Synchronisation) {
        self.book.borrow_mut().synchronisation = Some(Box::new(account));
    }

    /// Says what makes results doubtful: in the log now, and in this node's reports, where a run's end repeats it.
    pub fn doubt(&self, text: impl Into<String>) {
        let text = text.into();
        self.log(Level::Warn, text.clone());
        self.book.borrow_mut().warnings.push(text);
    }

    /// Tells the launcher how far the scans have come; for the node at the door.
    fn progress(&self, progress: Progress) {
        self.book.borrow_mut().advance(progress.done_below);
        self.tell(&Event::Progress(progress));
    }

    /// Settings of all nodes that hold otherwise from a scan on, in order.
    pub fn changes(&self) -> std::cell::Ref<'_, Vec<Change>> {
        self.changes.borrow()
    }

    /// Tells the launcher how the source plays; for the node at the door.
    pub fn playing(&self, playing: Playing) {
        control::say(&Event::Playing(playing));
    }

    /// Counts a message of a topic that was lost, and why.
    pub fn dropped(&self, topic: &Topic, cause: &str) {
        let mut book = self.book.borrow_mut();
        *book
            .tally(&topic.name)
            .dropped
            .entry(cause.to_owned())
            .or_default() += 1;
    }

    /// Counts a scan with which this node did not do what it is there for, and why.
    pub fn left_out(&self, cause: &str) {
        let mut book = self.book.borrow_mut();
        *book
            .tally("scans")
            .dropped
            .entry(cause.to_owned())
            .or_default() += 1;
    }

    /// Says something to the user: error = data lost, warn = degraded, info = rare and for the user.
    pub fn log(&self, level: Level, text: impl Into<String>) {
        self.tell(&Event::Log(Log {
            level,
            node: self.name.clone(),
            text: text.into(),
        }));
    }
}

/// Tells the launcher why this process fails; for who cannot go on.
pub fn complain(level: Level, node: &str, text: impl Into<String>) {
    control::say(&Event::Log(Log {
        level,
        node: node.to_owned(),
        text: text.into(),
    }));
}

/// Says that scans are done.
pub struct Finisher {
    book: Rc<RefCell<Book>>,
    publisher: ports::DataPublisher,
    doors: Vec<Bell>,
    index: u64,
}

impl std::fmt::Debug for Finisher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Finisher")
            .field("index", &self.index)
            .finish_non_exhaustive()
    }
}

impl Finisher {
    /// This node is done with the scan.
    ///
    /// # Errors
    /// When the publisher fails.
    pub fn done(&self, sequence: u64) -> Result<(), BusError> {
        let header = Header {
            sequence,
            ..Header::default()
        };
        ports::send_words(&self.publisher, &header, &[self.index])?;
        self.doors.iter().for_each(Bell::ring);
        self.book.borrow_mut().finished(sequence);
        Ok(())
    }
}

/// Hears which scans are done.
struct Dones {
    subscriber: Rc<ports::DataSubscriber>,
    /// Who says so, and of which scans.
    finishers: Vec<(u64, Shard)>,
    heard: BTreeMap<u64, Vec<u64>>,
}

impl std::fmt::Debug for Dones {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Dones")
            .field("heard", &self.heard)
            .finish_non_exhaustive()
    }
}

impl Dones {
    /// The next scan that all finishers have said to be done, possibly one that was said before.
    fn receive(&mut self) -> Result<Option<u64>, BusError> {
        while let Some((header, finisher)) = ports::receive_word(&self.subscriber)? {
            let heard = self.heard.entry(header.sequence).or_default();
            if !heard.contains(&finisher) {
                heard.push(finisher);
            }
            let mut asked = self.finishers.iter();
            if asked.all(|(f, shard)| !shard.owns(header.sequence) || heard.contains(f)) {
                self.heard.remove(&header.sequence);
                return Ok(Some(header.sequence));
            }
        }
        Ok(None)
    }

    /// Forgets what was said of scans below this number.
    fn forget_below(&mut self, sequence: u64) {
        self.heard = self.heard.split_off(&sequence);
    }
}

/// Hears what all nodes report.
pub struct ReportsIn {
    subscriber: ports::TextSubscriber,
}

impl std::fmt::Debug for ReportsIn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ReportsIn").finish_non_exhaustive()
    }
}

impl ReportsIn {
    /// The next thing a node said.
    ///
    /// # Errors
    /// When the subscriber fails.
    pub fn receive(&mut self) -> Result<Option<Event>, BusError> {
        while let Some(text) = ports::receive_text(&self.subscriber)? {
            if let Ok(event) = serde_json::from_str(&text) {
                return Ok(Some(event));
            }
        }
        Ok(None)
    }
}

impl Ledger {
    /// Takes in what a node reports; gives back what is no account.
    pub fn hear(&mut self, event: Event) -> Option<Event> {
        match event {
            Event::Report(report) | Event::Finished(report) => {
                self.nodes.insert(report.node, report.topics);
            }
            Event::Progress(progress) => {
                self.admitted = progress.admitted;
                self.done = progress.done;
                self.refused = progress.refused;
            }
            other => return Some(other),
        }
        None
    }
}

pub use ports::Bell;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_successor_counts_as_done_what_its_predecessor_did() {
        let mut done = Seen::default();
        done.advance(5);
        let mut book = Book {
            done: Some(done),
            done_below: 5,
            is_successor: true,
            ..Book::default()
        };
        book.advance(9);
        let count = |book: &Book| book.done.as_ref().map(Seen::count);
        assert_eq!(count(&book), Some(9));
        // Said twice, as after a resend, it counts once.
        for sequence in [9, 9, 10] {
            book.finished(sequence);
        }
        assert_eq!(count(&book), Some(11));
    }
}
