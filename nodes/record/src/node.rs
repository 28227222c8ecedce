//! The shell on the bus: `all topics ─► record ─► MCAP`, a scan at a time.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use messages::bus::{
    self, Bell, Bus, BusError, Doctor, Event, Finisher, Joined, Joins, Log, ReportsIn, Request,
    Start,
};
use messages::ledger::{Ledger, Seen};
use messages::record::{Digests, Level, WHOLE};
use messages::recording::{ReadError, Recording};
use messages::{Kind, Map, Owned, Reference, Rig, Topic};

use crate::writer::now_nanos;
use crate::{
    Batch, Encoder, Metadata, Report, SealError, Settings, WriteError, Writer, WriterThread,
    Written, encoder, spawn,
};

/// Why recording failed.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// An unfinished part cannot be finished.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// The system gives no thread.
    #[error("cannot start the writer's thread: {0}")]
    Thread(std::io::Error),
}

/// How often the ledger goes into the recording.
const LEDGER_EVERY: Duration = Duration::from_secs(1);

/// In the run's folder: the recording is begun.
const BEGUN: &str = "recording";

/// Scans that are encoded before the disk has taken them: one that is being written, one that waits, one in the making.
/// More that came while the disk was slow would cost memory, and stay where they are meanwhile: in shared memory.
const BATCHES: usize = 3;

/// Records every scan of which all topics have come, until told to stop.
///
/// # Errors
/// When the bus fails, a message is damaged, or the file cannot be written; what was written stays readable.
pub fn run(bus: &mut Bus, settings: Settings, start: &Start) -> Result<(), RecordError> {
    let mut scans = bus.joins(&bus.run().taken_by(bus.name()))?;
    let mut heard = bus.hear_reports()?;
    let done = bus.finisher()?;
    let metadata = metadata(bus, start);
    let made = bus.run().kinds();
    let mut encoder = encoder(
        &metadata.rig,
        metadata.reference,
        &made,
        bus.run().cameras,
        &settings,
    );
    let writer = open(bus, &settings, &metadata, &encoder, start)?;
    if start.resume.admitted > 0
        && encoder.says_whole()
        && let Err(error) = Recording::open(Path::new(&settings.file))
            .and_then(|mut recording| recall(&mut encoder, &mut recording, u64::MAX))
    {
        let text = format!("{WHOLE} has only what is settled from now on: {error}");
        bus.log(bus::Level::Warn, text);
    }
    let thread = spawn(writer, notify(bus)).map_err(RecordError::Thread)?;
    let done_below = start.resume.done_below.max(settings.skip);
    let mut recorder = Recorder::new(encoder, thread, done, done_below);
    recorder.made_with = recorder.encoder.proves().then_some(metadata);
    bus.ready()?;
    let recorded = record(bus, &mut recorder, &mut scans, &mut heard);
    // Whatever has happened, what was handed to the writer is written, and the file gets its end.
    let finished = recorder.finish(bus, recorded.as_ref().ok().and_then(Option::as_ref));
    recorded?;
    bus.finish(&[("bytes", finished?.bytes)]);
    Ok(())
}

/// Records until told to stop; gives the run's ledger when the launcher knows it.
fn record(
    bus: &mut Bus,
    recorder: &mut Recorder,
    scans: &mut Joins,
    heard: &mut ReportsIn,
) -> Result<Option<Ledger>, RecordError> {
    let mut ending = None;
    loop {
        recorder.hear_writer(bus)?;
        while let Some(event) = heard.receive()? {
            recorder.hear_node(event);
        }
        while let Some(line) = bus.said() {
            recorder.log.push(line);
        }
        if recorder.under_way.len() < BATCHES
            && let Some(scan) = bus.scan_now(scans)?
        {
            recorder.take(bus, &scan)?;
            continue;
        }
        if let Some(ledger) = ending.take_if(|_| recorder.under_way.is_empty()) {
            return Ok(ledger);
        }
        if let Some(Request::Stop(ledger)) = bus.request(Duration::from_secs(1))? {
            let with_own = |mut ledger: Box<Ledger>| {
                ledger
                    .nodes
                    .insert(bus.name().to_owned(), bus.report(&[]).topics);
                *ledger
            };
            ending = Some(ledger.map(with_own));
        }
    }
}

fn metadata(bus: &Bus, start: &Start) -> Metadata {
    let (graph, scans) = (start.graph.clone(), start.scans.clone());
    metadata_of(&bus.run().rig, &start.configuration, graph, scans)
}

/// What the recording of a run says about itself.
pub fn metadata_of(
    rig: &Rig,
    configuration: &serde_json::Value,
    graph: String,
    scans: Vec<String>,
) -> Metadata {
    let setting = |node: &str, key: &str| {
        configuration
            .get(node)?
            .get(key)?
            .as_str()
            .map(str::to_owned)
    };
    let rig = rig.clone();
    let reference = Reference::of(configuration).index(rig.views.len());
    Metadata {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        graph,
        configuration: configuration.clone(),
        reference,
        source: setting("capture", "source")
            .or_else(|| setting("replay", "file"))
            .unwrap_or_default(),
        scans,
        rig,
    }
}

/// Begins the recording, or goes on with it in its next part after a recorder that died.
fn open(
    bus: &Bus,
    settings: &Settings,
    metadata: &Metadata,
    encoder: &Encoder,
    start: &Start,
) -> Result<Writer, WriteError> {
    let path = Path::new(&settings.file);
    if start.resume.admitted == 0 {
        let mark = bus.run().root.join(BEGUN);
        return Writer::begin(path, settings.overwrite, &mark, metadata, encoder, settings);
    }
    let (writer, sealed) = Writer::resume(path, metadata, encoder, settings)?;
    for part in sealed.iter().filter(|part| !part.was_finished) {
        let (messages, cut) = (part.messages, part.cut_bytes);
        let text = format!(
            "finished the part of a dead recorder: {messages} messages kept, {cut} torn bytes cut"
        );
        bus.log(bus::Level::Info, text);
    }
    Ok(writer)
}

/// Lets the whole map have what a recording holds of it already, of the frames before this one.
///
/// # Errors
/// When that cannot be read.
pub(crate) fn recall(
    encoder: &mut Encoder,
    recording: &mut Recording,
    before: u64,
) -> Result<(), ReadError> {
    if !encoder.says_whole() {
        return Ok(());
    }
    let maps = Topic::of(&recording.metadata().rig, Kind::Map);
    for scan in recording.scans_with(&maps) {
        for topic in maps.iter().filter(|_| scan < before) {
            let map: Owned<Map> = recording.read(scan, topic)?;
            encoder.recall(scan, map.view());
        }
    }
    Ok(())
}

thread_local! {
    /// The bell of the node's inbox, as the writer's thread has it.
    static BELL: OnceCell<Option<Bell>> = const { OnceCell::new() };
}

/// Rings this node's inbox from the writer's thread.
fn notify(bus: &Bus) -> impl FnMut() + Send + 'static + use<> {
    let (run, name) = (bus.run().clone(), bus.name().to_owned());
    move || {
        BELL.with(|bell| {
            let bell = bell.get_or_init(|| Bus::own_bell(&run, &name).ok());
            bell.iter().for_each(Bell::ring);
        });
    }
}

struct Recorder {
    encoder: Encoder,
    thread: WriterThread,
    done: Finisher,
    /// Batches to be used again.
    spare: Vec<Batch>,
    /// Scans handed to the writer, what encoding each took, and up to which line it holds what was said.
    under_way: BTreeMap<u64, (Duration, u64)>,
    /// Scans written and flushed.
    flushed: Seen,
    /// Number and time of the last scan handed to the writer.
    last: Option<(u64, u64)>,
    /// What was said since the last scan.
    log: Vec<Log>,
    /// The lines before this one are on the disk.
    written: u64,
    /// Whether recording has stopped, because the disk has no more room.
    has_stopped: bool,
    /// How many changes of settings are in the recording.
    noted: usize,
    ledger: Ledger,
    health: Doctor,
    next_ledger: Instant,
    /// Of a proof what says with which settings scans are made, and for how many changes the encoder knows it.
    made_with: Option<Metadata>,
    settled: Option<usize>,
}

impl Recorder {
    fn new(encoder: Encoder, thread: WriterThread, done: Finisher, done_below: u64) -> Self {
        let mut flushed = Seen::default();
        flushed.advance(done_below);
        Self {
            encoder,
            thread,
            done,
            flushed,
            last: None,
            spare: Vec::new(),
            under_way: BTreeMap::new(),
            log: Vec::new(),
            written: 0,
            has_stopped: false,
            noted: 0,
            ledger: Ledger::default(),
            health: Doctor::default(),
            next_ledger: Instant::now() + LEDGER_EVERY,
            made_with: None,
            settled: None,
        }
    }

    /// Lets the digests of a proof say with which settings a scan was made.
    fn settle(&mut self, bus: &Bus, scan: u64) {
        let Some(made_with) = &self.made_with else {
            return;
        };
        let changes = bus.changes();
        let held = changes.iter().filter(|change| change.from <= scan).count();
        if self.settled != Some(held) {
            self.settled = Some(held);
            let Metadata {
                configuration, rig, ..
            } = made_with;
            let settings = Digests::of_settings(configuration, rig, &changes, scan);
            self.encoder.settle(settings);
        }
    }

    /// Takes a whole scan in: encodes it and hands it to the writer.
    fn take(&mut self, bus: &Bus, scan: &Joined) -> Result<(), BusError> {
        if self.flushed.contains(scan.sequence) {
            // Whoever asks again has not heard that it is done.
            return self.done.done(scan.sequence);
        }
        if self.under_way.contains_key(&scan.sequence) {
            return Ok(());
        }
        if self.has_stopped {
            return self.leave_out(bus, scan.sequence);
        }
        let began = Instant::now();
        self.settle(bus, scan.sequence);
        let views = scan.views()?;
        let mut batch = self.spare.pop().unwrap_or_default();
        self.encoder.encode(&views, &mut batch);
        if self.last.is_none() {
            let (version, from) = (env!("CARGO_PKG_VERSION"), scan.sequence);
            let line = format!("tricurve {version} records from scan {from} on");
            self.encoder.log(Level::Info, bus.name(), &line, &mut batch);
        }
        self.last = Some((batch.sequence(), batch.nanos()));
        let changes = bus.changes();
        if changes.len() > self.noted {
            self.noted = changes.len();
            batch.set_changes(changes.clone());
        }
        drop(changes);
        self.write_log(&mut batch);
        if self.next_ledger <= Instant::now() {
            self.next_ledger = Instant::now() + LEDGER_EVERY;
            self.ledger
                .nodes
                .insert(bus.name().to_owned(), bus.report(&[]).topics);
            self.encoder.ledger(&self.ledger, &mut batch);
            self.health.hear(&Event::Report(bus.report(&[])));
            self.encoder
                .health(self.health.say(Instant::now()), &mut batch);
            let cameras = self.health.synchronisation();
            self.encoder.synchronisation(cameras, &mut batch);
        }
        self.thread.write(batch);
        let encoded = (began.elapsed(), bus.said_until());
        self.under_way.insert(scan.sequence, encoded);
        Ok(())
    }

    /// Hands to the writer what was said since the last scan and how the run's ledger came out, and finishes the
    /// recording.
    fn finish(mut self, bus: &Bus, ledger: Option<&Ledger>) -> Result<Written, WriteError> {
        // Why no scan came is worth recording too.
        let is_worth_it = self.last.is_some() || !self.log.is_empty();
        if is_worth_it && !self.has_stopped {
            let mut batch = self.spare.pop().unwrap_or_default();
            let (sequence, nanos) = self.last.unwrap_or_else(|| (0, now_nanos()));
            batch.close(sequence, nanos);
            self.write_log(&mut batch);
            if self.last.is_some() {
                self.encoder.end(sequence, &mut batch);
            }
            if let Some(ledger) = ledger {
                self.encoder.ledger(ledger, &mut batch);
                for fault in ledger.faults() {
                    self.encoder.log(Level::Error, "ledger", &fault, &mut batch);
                }
            }
            self.health.hear(&Event::Report(bus.report(&[])));
            self.encoder
                .health(self.health.say(Instant::now()), &mut batch);
            let cameras = self.health.synchronisation();
            self.encoder.synchronisation(cameras, &mut batch);
            self.thread.write(batch);
        }
        self.thread.finish(ledger)
    }

    fn write_log(&mut self, batch: &mut Batch) {
        for Log { level, node, text } in self.log.drain(..) {
            self.encoder.log(level.into(), &node, &text, batch);
        }
    }

    /// Lets a scan go that is not recorded.
    fn leave_out(&mut self, bus: &Bus, sequence: u64) -> Result<(), BusError> {
        bus.left_out("the disk has no more room");
        self.flushed.insert(sequence);
        self.done.done(sequence)
    }

    /// Takes in what a node reported or said.
    fn hear_node(&mut self, event: Event) {
        self.health.hear(&event);
        // Lines come from the launcher, which knows them all.
        self.ledger.hear(event);
    }

    /// Says which scans are written and flushed.
    fn hear_writer(&mut self, bus: &Bus) -> Result<(), RecordError> {
        while let Ok(report) = self.thread.reports().try_recv() {
            let Report {
                sequence,
                result,
                batch,
                duration,
            } = report;
            self.spare.push(batch);
            match result {
                Err(error) if error.is_out_of_room() => {
                    self.has_stopped = true;
                    let text = format!("{error}; the graph goes on, and nothing more is recorded");
                    bus.log(bus::Level::Warn, text);
                }
                Err(WriteError::Ended) if self.has_stopped => {}
                result => {
                    result?;
                }
            }
            if self.has_stopped {
                self.under_way.remove(&sequence);
                self.leave_out(bus, sequence)?;
                continue;
            }
            let (encoding, said) = self.under_way.remove(&sequence).unwrap_or_default();
            if said > self.written {
                self.written = said;
                bus.has_written(said);
            }
            bus.spent(encoding + duration);
            self.flushed.insert(sequence);
            self.done.done(sequence)?;
        }
        Ok(())
    }
}
