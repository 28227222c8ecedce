//! The shell on the bus: `recording ─► door ─► every topic before the cut`, a scan at a time.

use std::path::Path;
use std::time::{Duration, Instant};

use messages::bus::{
    Bus, BusError, Filled, Gate, Level, Loan, Outputs, Play, Playing, Request, Start,
};
use messages::door::UnderWay;
use messages::record::{Codec, Recorded};
use messages::recording::{ReadError, Recording, Scan};
use messages::{Curves, CurvesView, Header, Kind, Tables, Topic};

use crate::clock::jumps;
use crate::{Clock, Selection, SelectionError, Settings};

/// Why replaying failed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It cannot be replayed so.
    #[error(transparent)]
    Selection(#[from] SelectionError),
}

/// How long to wait for news when nothing else is to be done.
const IDLE: Duration = Duration::from_secs(1);

/// Sends scan after scan when it is due and the door is open, until the recording ends or the launcher says to stop.
///
/// # Errors
/// When the bus fails or the recording cannot be opened. A scan that cannot be read ends the replay: what was admitted
/// before comes out.
pub fn run(bus: &mut Bus, settings: Settings, start: &Start) -> Result<(), ReplayError> {
    let recording = Recording::open(Path::new(&settings.file))?;
    let selection = Selection::of(&recording, settings.choice(bus.run().taken()))?;
    let count = selection.scans.len() as u64;
    let total = (!settings.repeat).then_some(count);
    let mut replay = Replay {
        outputs: bus.outputs_on_demand(&settings.kinds())?,
        gate: bus.gate(&start.resume, total)?,
        codec: recording.codec().clone(),
        sought_from: None,
        selection,
        recording,
    };
    let (mut failed, mut has_finished, mut is_draining) = (None, false, false);
    let clock = || {
        let (now, next) = (Instant::now(), replay.next_nanos());
        Clock::new(settings.rate, settings.paused, now, next)
    };
    bus.playing(replay.playing(&clock()));
    bus.ready()?;
    let mut clock = clock();
    let mut is_held = false;
    loop {
        let tick = replay.gate.door().next_tick();
        let is_over = is_draining || failed.is_some() || total.is_some_and(|total| tick >= total);
        let due = clock.due(replay.next_nanos());
        let due = due.filter(|_| !is_over && !is_held);
        let is_due = due.is_some_and(|due| due <= Instant::now());
        let wait = match due {
            Some(due) if !is_due => due.saturating_duration_since(Instant::now()).min(IDLE),
            Some(_) if replay.gate.door().is_open() => Duration::ZERO,
            _ => IDLE,
        };
        match bus.request(wait)? {
            Some(Request::Stop(_)) => break,
            Some(Request::Drain) => is_draining = true,
            Some(Request::Resend) => replay.resend()?,
            Some(Request::Play(play)) => {
                let (now, next) = (Instant::now(), replay.next_nanos());
                match play {
                    Play::Pause => clock.pause(now, next),
                    Play::Stop if !clock.is_paused() => clock.pause(now, next),
                    Play::Resume if clock.is_paused() => clock.pause(now, next),
                    Play::Stop | Play::Resume => {}
                    Play::Step => clock.step(),
                    Play::Faster => clock.speed(2.0, now, next),
                    Play::Slower => clock.speed(0.5, now, next),
                    Play::Rate(rate) => clock.set_rate(rate, now, next),
                    Play::Seek(nanos) => {
                        replay.gate.seek(bus, replay.selection.at_or_after(nanos));
                        replay.sought_from = Some(replay.gate.door().admitted());
                        clock.jump(now, replay.next_nanos());
                    }
                }
                bus.playing(replay.playing(&clock));
                continue;
            }
            Some(Request::Hold) => {
                is_held = true;
                replay.gate.held();
                continue;
            }
            Some(Request::Go) => is_held = false,
            Some(Request::Begin) | None => {}
        }
        replay.gate.hear_done(bus)?;
        if is_due && replay.gate.door().is_open() && !is_draining {
            match replay.read(tick) {
                Ok((scan, topics)) => {
                    let nanos = replay.selection.scan(tick).1;
                    let under_way = replay.gate.admit(bus);
                    clock.played(Instant::now(), nanos, replay.next_nanos());
                    replay.send(under_way, &scan, &topics)?;
                    replay.recording.reuse(scan);
                    let begins_again = settings.repeat && (tick + 1).is_multiple_of(count);
                    if begins_again {
                        let next = replay.gate.door().admitted();
                        let text = format!("begins again: scans are numbered on from {next}");
                        bus.log(Level::Info, text);
                    } else if tick + 1 < count && clock.rate().is_some() {
                        remark_jump(bus, nanos, replay.next_nanos());
                    }
                }
                Err(error) => failed = Some(error.to_string()),
            }
        }
        if is_over && replay.gate.door().is_idle() && !has_finished {
            has_finished = true;
            let counts = [("scans", replay.gate.door().admitted())];
            match &failed {
                None => bus.finish(&counts),
                Some(why) => bus.finish_failed(why, &counts),
            }
        }
    }
    Ok(())
}

/// Says where the recorded time is none that can be played.
fn remark_jump(bus: &Bus, nanos: u64, next_nanos: u64) {
    if jumps(nanos, next_nanos) {
        let seconds = (next_nanos as i128 - nanos as i128) as f64 / 1e9;
        let text = format!("recorded time jumps by {seconds:.0} s here, which is not waited for");
        bus.log(Level::Warn, text);
    }
}

struct Replay {
    recording: Recording,
    selection: Selection,
    codec: Codec,
    outputs: Outputs,
    gate: Gate,
    /// Number of the first scan let in since the last seek.
    sought_from: Option<u64>,
}

impl Replay {
    fn playing(&self, clock: &Clock) -> Playing {
        let (first, last) = self.selection.span();
        Playing {
            is_paused: clock.is_paused(),
            is_recording: true,
            rate: clock.rate(),
            span: Some((first, last)),
            next_nanos: Some(self.next_nanos()),
            sought_from: self.sought_from,
        }
    }

    fn next_nanos(&self) -> u64 {
        self.selection.scan(self.gate.door().next_tick()).1
    }

    /// Reads a scan as far as somebody listens, and says to what.
    fn read(&mut self, tick: u64) -> Result<(Scan, Vec<Topic>), ReadError> {
        let (number, _) = self.selection.scan(tick);
        let mut topics = self.selection.topics.clone();
        topics.retain(|topic| self.outputs.is_wanted(topic));
        let is_wanted = |name: &str| {
            let needs = |topic: &Topic| topic.name == name || self.codec.refers(topic, name);
            topics.iter().any(needs)
        };
        let scan = self.recording.scan_of(number, is_wanted)?;
        // What a guest would like to hear need not be there.
        topics.retain(|topic| self.outputs.is_owed(topic) || scan.message(&topic.name).is_some());
        Ok((scan, topics))
    }

    fn send(&self, under_way: UnderWay, scan: &Scan, topics: &[Topic]) -> Result<(), ReplayError> {
        let of = |kind: Kind, like: &Topic| {
            let is_it =
                |t: &&Topic| t.kind == kind && (t.view, t.channel) == (like.view, like.channel);
            topics.iter().find(is_it)
        };
        for topic in topics {
            macro_rules! published {
                ($kind:ident) => {
                    self.publish::<messages::$kind>(topic, under_way, scan)?
                };
            }
            match topic.kind {
                Kind::Curves => {
                    let tables = of(Kind::Tables, topic);
                    self.publish_curves(topic, tables, under_way, scan)?;
                }
                // They go out with their curves.
                Kind::Tables if of(Kind::Curves, topic).is_some() => {}
                kind => messages::of_kind!(kind, published, _ => {
                    self.publish_other(topic, under_way, scan)?;
                }),
            }
        }
        Ok(())
    }

    /// Publishes a recorded message of others.
    fn publish_other(
        &self,
        topic: &Topic,
        under_way: UnderWay,
        scan: &Scan,
    ) -> Result<(), ReplayError> {
        let (header, message) = scan.decode_other(&self.codec, topic)?;
        let header = self.as_played(header, under_way);
        Ok(self.outputs.send_other(&header, message.view())?)
    }

    /// Publishes a recorded message, written into shared memory as it is read.
    fn publish<M: Recorded>(
        &self,
        topic: &Topic,
        under_way: UnderWay,
        scan: &Scan,
    ) -> Result<(), ReplayError> {
        let mut loan = self.outputs.loan::<M>(topic.view, topic.channel)?;
        let (header, filled) = self.fill(&mut loan, topic, under_way, scan, None)?;
        Ok(self.outputs.publish(loan, &header, filled)?)
    }

    /// Publishes curves and with them the tables that refer to them, so that these need not read them again.
    fn publish_curves(
        &self,
        topic: &Topic,
        tables: Option<&Topic>,
        under_way: UnderWay,
        scan: &Scan,
    ) -> Result<(), ReplayError> {
        let mut loan = self.outputs.loan::<Curves>(topic.view, topic.channel)?;
        let (header, filled) = self.fill(&mut loan, topic, under_way, scan, None)?;
        if let Some(tables) = tables {
            let mut their = self.outputs.loan::<Tables>(tables.view, tables.channel)?;
            let curves = loan.view(&filled);
            let (header, filled) = self.fill(&mut their, tables, under_way, scan, curves)?;
            self.outputs.publish(their, &header, filled)?;
        }
        Ok(self.outputs.publish(loan, &header, filled)?)
    }

    /// Reads a message into shared memory.
    fn fill<M: Recorded>(
        &self,
        loan: &mut Loan<M>,
        topic: &Topic,
        under_way: UnderWay,
        scan: &Scan,
        curves: Option<CurvesView<'_>>,
    ) -> Result<(Header, Filled), ReplayError> {
        let (header, filled) = {
            let mut room = loan.room()?;
            let header = scan.decode_room::<M>(&self.codec, topic, curves, &mut room)?;
            (header, Filled::of::<M>(&room))
        };
        if !loan.view(&filled).is_some_and(M::is_sound) {
            return Err(scan.unsound(topic).into());
        }
        Ok((self.as_played(header, under_way), filled))
    }

    /// A recorded message's header as that of a scan under way.
    fn as_played(&self, header: Header, under_way: UnderWay) -> Header {
        let (_, nanos) = self.selection.scan(under_way.tick);
        Header {
            sequence: under_way.sequence,
            capture_nanos: nanos,
            done_below: self.gate.door().needed_from(),
            ..header
        }
    }

    /// Sends the scans under way once more, the oldest first.
    fn resend(&mut self) -> Result<(), ReplayError> {
        for under_way in self.gate.door().to_resend() {
            let (scan, topics) = self.read(under_way.tick)?;
            self.send(under_way, &scan, &topics)?;
            self.recording.reuse(scan);
        }
        Ok(())
    }
}
