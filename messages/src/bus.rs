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
//! Instances of a node share its scans by number ([`Shard`](crate::ledger::Shard)): each takes and makes the messages of its own, publishes them
//! on services of its own, and counts them in the ledger. Who joins scans of several instances gets them in order.
//!
//! A node never waits for another one, only for its inbox. A launcher that dies closes its children's standard input;
//! they then end by themselves.

mod ask;
mod book;
mod control;
mod descriptors;
mod doctor;
mod done;
mod drive;
mod error;
mod frames;
mod gate;
mod guest;
mod inputs;
mod meter;
mod outputs;
mod ports;
mod reports;
mod run;
mod tuned;

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, Select};
use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::*;

use crate::change::Change;
use crate::ledger::{Ledger, Seen};
use crate::payload::Kind;
use crate::synchronisation::Synchronisation;
use crate::topic::Topic;

pub use ask::{
    Answer, Ask, LONGEST_LINE, NodeState, Parameter, State, ask, read_changes, socket_of,
    write_changes,
};
pub use control::{Command, Event, Level, Log, NodeReport, Play, Playing, Progress};
pub use descriptors::OpenFiles;
pub use doctor::Doctor;
pub use done::Finisher;
pub use drive::{Ahead, Drive, Driven, Read};
pub use error::{BusError, has_failed};
pub use frames::{FrameIn, FramesIn, FramesOut};
pub use guest::{Guest, Hearer, LOOK_EVERY, Reports};
pub use inputs::{Inputs, Joined, Joins, Received};
pub use meter::{Meter, Percentiles};
pub use outputs::{Filled, Loan, Outputs};
pub use ports::Bell;
pub use reports::ReportsIn;
pub use run::{NodePlan, Run, Start, node_of};
pub use tuned::Tuned;

use book::Book;
use done::{Dones, Settling};
use ports::Ports;

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
    /// How many messages a scan has for the node.
    taken: usize,
    /// Says for the node when a scan is done, where it is one that scans wait for and does not say so.
    settling: Option<Settling>,
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
            taken: 0,
            settling: None,
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
        self.taken += topics.clone().count();
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
        let mut nodes = self.run.nodes.iter();
        let is_waited_for = nodes.any(|node| node.name == self.name && node.finishes);
        if is_waited_for && self.book.borrow().done.is_none() {
            self.settling = Some(Settling::new(self.finisher()?, self.taken));
        }
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
        self.settle()?;
        loop {
            self.obey()?;
            if let Some(received) = inputs.receive()? {
                self.hand(std::slice::from_ref(&received));
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
        self.settle()?;
        let joined = joins.receive()?;
        if let Some(joined) = &joined {
            self.hand(joined.messages());
        }
        self.book.borrow_mut().mark = Some(Instant::now());
        Ok(joined)
    }

    /// The node was handed these.
    fn hand(&mut self, messages: &[Received]) {
        if let Some(settling) = &mut self.settling {
            for message in messages {
                settling.hand(&message.header(), &message.topic().name);
            }
        }
    }

    /// The node asks for more, and is done with what it was handed.
    fn settle(&mut self) -> Result<(), BusError> {
        self.settling.as_mut().map_or(Ok(()), Settling::settle)
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
