//! The loop that every source runs in.
//!
//! ```text
//!  launcher ─► requests ─┐
//!  clock ─► is it due? ──┼─► a scan ahead ─► read ─► door ─► sent
//!  done ─► is it open? ──┘        └──────────► turned away whole, where scans are live
//! ```
//!
//! A source says what is ahead, and reads and sends it ([`Driven`]). All else is the same for every source and is here:
//! when a scan may go in, what is sent once more, pauses, rates and seeks, and how a run ends. What was asked holds from
//! the next scan on: once the source is told to hold, to drain or to pause, none goes in that did not before.

#[cfg(test)]
mod tests;

use std::time::{Duration, Instant};

use super::gate::Gate;
use super::{Bus, BusError, Level, Play, Playing, Request, Start};
use crate::clock::{Clock, jumps};
use crate::door::{Door, UnderWay};
use crate::rig::Delivery;

/// How long to wait for news when nothing else is to be done.
const IDLE: Duration = Duration::from_millis(500);
/// Why a scan is turned away that finds the door closed.
const CLOSED: &str = "the door was closed";
/// Why a scan is turned away that comes in a pause.
const PAUSED: &str = "it was paused";

/// What is ahead of a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ahead {
    /// A scan, due at its time if it has one and else now.
    Scan,
    /// Nothing yet: the inbox is rung when that changes.
    Nothing,
    /// So many scans went by that nobody can read, and why.
    Missed(&'static str, u64),
    /// Nothing more.
    End,
    /// Nothing more, and why that is not all: what was let in comes out.
    Failed(String),
}

/// What comes of reading a scan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Read<S> {
    /// The scan.
    Scan(S),
    /// This scan cannot be read and is left out, and why.
    LeftOut(&'static str),
    /// Neither this scan nor any after it can be read, and why: what was let in comes out.
    Failed(String),
}

/// A source of scans: what is its own beside the loop that it runs in.
///
/// Its scans are counted by ticks, with those that are turned away; what is let in has a number besides. `B` is the bus,
/// and something simpler in tests.
pub trait Driven<B = Bus> {
    /// A scan that is read and not sent: it goes out whole or not at all.
    type Scan;
    /// Why it fails.
    type Error: From<BusError>;

    /// When a scan was taken, in nanoseconds since 1970. `None` where scans come when they come: then time passes while the
    /// source is paused.
    fn nanos(&self, tick: u64) -> Option<u64>;

    /// Does what takes its time before the run begins.
    ///
    /// # Errors
    /// When the bus fails.
    fn prepare(&mut self, _bus: &B, _door: &Door) -> Result<(), Self::Error> {
        Ok(())
    }

    /// The run begins.
    ///
    /// # Errors
    /// When what scans come from cannot be opened.
    fn begin(&mut self, _bus: &B) -> Result<(), Self::Error> {
        Ok(())
    }

    /// What is ahead; asked as long as scans may go in.
    ///
    /// # Errors
    /// When the bus fails.
    fn ahead(&mut self, _bus: &B, _door: &Door) -> Result<Ahead, Self::Error> {
        Ok(Ahead::Scan)
    }

    /// Reads the scan ahead, which goes in next.
    ///
    /// # Errors
    /// When the bus fails.
    fn read_scan(&mut self, bus: &B, tick: u64) -> Result<Read<Self::Scan>, Self::Error>;

    /// Reads a scan that went in before.
    ///
    /// # Errors
    /// When it cannot be read again.
    fn read_again(&mut self, bus: &B, tick: u64) -> Result<Self::Scan, Self::Error>;

    /// Sends a scan. No scan below `done_below` is needed any more.
    ///
    /// # Errors
    /// When the bus fails.
    fn send_scan(
        &mut self,
        bus: &B,
        under_way: UnderWay,
        done_below: u64,
        scan: Self::Scan,
    ) -> Result<(), Self::Error>;

    /// The scan ahead was turned away.
    ///
    /// # Errors
    /// When what it leaves cannot be kept.
    fn pass_by(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }

    /// Scans came out.
    fn came_out(&mut self, _door: &Door) {}

    /// Looks at how it is doing, each time round. While it rests no scan is let in, whatever comes.
    fn look(&mut self, _bus: &B, _rests: bool) {}

    /// The last scan came out.
    fn finish(&mut self, _bus: &B) {}

    /// The first scan that was taken at this time or later, or the last; of a recording.
    fn at_or_after(&self, _nanos: u64) -> u64 {
        0
    }
}

/// How a source is driven.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drive {
    /// How many scans the source has, where that is known.
    pub scans: Option<u64>,
    /// Whether it begins again after the last one.
    pub repeats: bool,
    /// What happens to a scan that finds the door closed.
    pub delivery: Delivery,
    /// Times as fast as its scans were taken; without one as fast as the door lets them in.
    pub rate: Option<f64>,
    /// Whether it begins with a pause.
    pub is_paused: bool,
    /// When its first scan was taken and when its last, in nanoseconds since 1970, of a recording: that can be played at a
    /// rate, and sought in.
    pub span: Option<(u64, u64)>,
}

impl Drive {
    /// Lets scans of this source in until it is exhausted and they are done, and the launcher says to stop.
    ///
    /// # Errors
    /// When the bus fails, or the source does so that another process in its place may fare better.
    pub fn run<S: Driven>(
        self,
        bus: &mut Bus,
        start: &Start,
        source: &mut S,
    ) -> Result<(), S::Error> {
        let mut gate = Gate::new(bus, &start.resume, self.total())?;
        self.run_at(&mut gate, source)
    }

    fn run_at<L: Line, S: Driven<L::Bus>>(
        self,
        line: &mut L,
        source: &mut S,
    ) -> Result<(), S::Error> {
        let nanos = source.nanos(line.door().next_tick()).unwrap_or_default();
        let mut driver = Driver {
            clock: Clock::new(self.rate, self.is_paused, line.now(), nanos),
            drive: self,
            is_held: false,
            is_draining: false,
            failed: None,
            is_over: false,
            has_finished: false,
            sought_from: None,
        };
        line.playing(driver.playing(line, source));
        source.prepare(line.bus(), line.door())?;
        line.ready()?;
        source.begin(line.bus())?;
        // Until now no time has passed.
        driver.clock.jump(line.now(), nanos);
        driver.go(line, source)
    }

    /// How many scans there are to let in, where that is known.
    fn total(&self) -> Option<u64> {
        self.scans.filter(|_| !self.repeats)
    }
}

/// What the loop needs of the bus: the gate, and in tests a script.
pub(super) trait Line {
    /// What the source needs of it.
    type Bus;

    /// What the source needs.
    fn bus(&self) -> &Self::Bus;
    /// The door.
    fn door(&self) -> &Door;
    /// The time.
    fn now(&self) -> Instant;
    /// Waits until everybody is connected.
    fn ready(&mut self) -> Result<(), BusError>;
    /// The next request; waits up to `timeout` for it or for other news.
    fn request(&mut self, timeout: Duration) -> Result<Option<Request>, BusError>;
    /// Lets the scans out that are done.
    fn hear_done(&mut self) -> Result<(), BusError>;
    /// Lets the source's next scan in. That is said before anything of it is sent, so that a successor of this process
    /// knows of every scan that anybody may have seen.
    fn admit(&mut self) -> UnderWay;
    /// Turns so many of the source's next scans away, whole.
    fn refuse(&mut self, cause: &str, count: u64);
    /// Goes on with another scan of the source; the numbers go on as they do.
    fn seek(&mut self, tick: u64);
    /// Says that no scan is let in from now on.
    fn held(&self);
    /// Says how the source plays.
    fn playing(&self, playing: Playing);
    /// Says something to the user.
    fn log(&self, level: Level, text: String);
    /// Says that the source has done its work, or why that was not all of it.
    fn finish(&self, failed: Option<&str>);
}

/// What is done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// The scan ahead is let in.
    LetIn,
    /// So many scans are turned away.
    TurnAway(&'static str, u64),
    /// Nothing, for so long or until there is news.
    Wait(Duration),
    /// All is done.
    Finish,
}

/// Where the loop stands.
struct Driver {
    drive: Drive,
    clock: Clock,
    is_held: bool,
    is_draining: bool,
    failed: Option<String>,
    /// Whether nothing more goes in, by what was last seen.
    is_over: bool,
    has_finished: bool,
    /// Number of the first scan let in since the last seek.
    sought_from: Option<u64>,
}

impl Driver {
    fn go<L: Line, S: Driven<L::Bus>>(
        &mut self,
        line: &mut L,
        source: &mut S,
    ) -> Result<(), S::Error> {
        let mut wait = Duration::ZERO;
        loop {
            let mut asked = line.request(wait)?;
            while let Some(request) = asked {
                if matches!(request, Request::Stop(_)) {
                    return Ok(());
                }
                self.obey(line, source, request)?;
                asked = line.request(Duration::ZERO)?;
            }
            let done = line.door().done_count();
            line.hear_done()?;
            if line.door().done_count() > done {
                source.came_out(line.door());
            }
            wait = self.step(line, source)?;
            let rests = self.is_held || self.clock.stands() || self.is_over;
            source.look(line.bus(), rests);
        }
    }

    /// Does what the launcher asks.
    fn obey<L: Line, S: Driven<L::Bus>>(
        &mut self,
        line: &mut L,
        source: &mut S,
        request: Request,
    ) -> Result<(), S::Error> {
        match request {
            Request::Drain => self.is_draining = true,
            Request::Resend => {
                for under_way in line.door().to_resend() {
                    let scan = source.read_again(line.bus(), under_way.tick)?;
                    let done_below = line.door().needed_from();
                    source.send_scan(line.bus(), under_way, done_below, scan)?;
                }
            }
            Request::Hold => {
                self.is_held = true;
                line.held();
            }
            Request::Go => self.is_held = false,
            Request::Play(play) => {
                self.play(line, source, play);
                line.playing(self.playing(line, source));
            }
            Request::Begin | Request::Stop(_) => {}
        }
        Ok(())
    }

    /// Plays otherwise.
    fn play<L: Line, S: Driven<L::Bus>>(&mut self, line: &mut L, source: &S, play: Play) {
        let now = line.now();
        let next = source.nanos(line.door().next_tick()).unwrap_or_default();
        match play {
            Play::Pause => self.clock.pause(now, next),
            Play::Stop if !self.clock.is_paused() => self.clock.pause(now, next),
            Play::Resume if self.clock.is_paused() => self.clock.pause(now, next),
            Play::Stop | Play::Resume => {}
            Play::Step => self.clock.step(),
            // Nothing else than a recording can be played otherwise.
            _ if self.drive.span.is_none() => {}
            Play::Faster => self.clock.speed(2.0, now, next),
            Play::Slower => self.clock.speed(0.5, now, next),
            Play::Rate(rate) => self.clock.set_rate(rate, now, next),
            Play::Seek(nanos) => {
                line.seek(source.at_or_after(nanos));
                self.sought_from = Some(line.door().admitted());
                let next = source.nanos(line.door().next_tick()).unwrap_or_default();
                self.clock.jump(now, next);
            }
        }
    }

    /// How the source plays.
    fn playing<L: Line, S: Driven<L::Bus>>(&self, line: &L, source: &S) -> Playing {
        let is_paused = self.clock.is_paused();
        match self.drive.span {
            None => Playing {
                is_paused,
                ..Playing::default()
            },
            Some(span) => Playing {
                is_paused,
                is_recording: true,
                rate: self.clock.rate(),
                span: Some(span),
                next_nanos: source.nanos(line.door().next_tick()),
                sought_from: self.sought_from,
            },
        }
    }

    /// Whether no scan is let in any more, whatever the source has.
    fn is_closed(&self, door: &Door) -> bool {
        let is_past = |total: u64| door.next_tick() >= total;
        self.is_draining || self.failed.is_some() || self.drive.total().is_some_and(is_past)
    }

    /// Goes one step on; gives how long to wait for news before the next one.
    fn step<L: Line, S: Driven<L::Bus>>(
        &mut self,
        line: &mut L,
        source: &mut S,
    ) -> Result<Duration, S::Error> {
        let ahead = match self.is_closed(line.door()) {
            true => Ahead::End,
            false => source.ahead(line.bus(), line.door())?,
        };
        self.is_over = matches!(ahead, Ahead::End | Ahead::Failed(_));
        if let Ahead::Failed(why) = &ahead {
            self.failed = Some(why.clone());
        }
        let tick = line.door().next_tick();
        let nanos = source.nanos(tick);
        match self.next(&ahead, nanos, line.door(), line.now()) {
            Next::Wait(wait) => return Ok(wait),
            Next::Finish => {
                self.has_finished = true;
                source.finish(line.bus());
                line.finish(self.failed.as_deref());
                return Ok(IDLE);
            }
            Next::LetIn => match source.read_scan(line.bus(), tick)? {
                Read::Scan(scan) => {
                    let under_way = line.admit();
                    self.clock.played(
                        line.now(),
                        nanos.unwrap_or_default(),
                        next_nanos(line, source),
                    );
                    let done_below = line.door().needed_from();
                    source.send_scan(line.bus(), under_way, done_below, scan)?;
                    self.remark(line, source, tick);
                    return Ok(Duration::ZERO);
                }
                Read::LeftOut(cause) => line.refuse(cause, 1),
                Read::Failed(why) => {
                    self.failed = Some(why);
                    return Ok(Duration::ZERO);
                }
            },
            Next::TurnAway(cause, count) => {
                line.refuse(cause, count);
                if ahead == Ahead::Scan {
                    source.pass_by()?;
                }
            }
        }
        self.clock.passed(
            line.now(),
            nanos.unwrap_or_default(),
            next_nanos(line, source),
        );
        Ok(Duration::ZERO)
    }

    /// What is done with what is ahead.
    fn next(&self, ahead: &Ahead, nanos: Option<u64>, door: &Door, now: Instant) -> Next {
        let is_live = self.drive.delivery == Delivery::Live;
        match ahead {
            Ahead::End | Ahead::Failed(_) if door.is_idle() && !self.has_finished => Next::Finish,
            Ahead::End | Ahead::Failed(_) | Ahead::Nothing => Next::Wait(IDLE),
            Ahead::Missed(cause, count) => Next::TurnAway(cause, *count),
            // A hold is short, and scans wait for its end, whatever they are.
            Ahead::Scan if self.is_held => Next::Wait(IDLE),
            Ahead::Scan => match self.clock.due(nanos.unwrap_or_default()) {
                Some(due) if due > now => Next::Wait((due - now).min(IDLE)),
                Some(_) if door.is_open() => Next::LetIn,
                Some(_) if is_live => Next::TurnAway(CLOSED, 1),
                None if is_live && nanos.is_none() => Next::TurnAway(PAUSED, 1),
                Some(_) | None => Next::Wait(IDLE),
            },
        }
    }

    /// Says where a source begins again, and where its time is none that can be played.
    fn remark<L: Line, S: Driven<L::Bus>>(&self, line: &L, source: &S, tick: u64) {
        let scans = self.drive.scans.unwrap_or(u64::MAX);
        if self.drive.repeats && (tick + 1).is_multiple_of(scans) {
            let next = line.door().admitted();
            let text = format!("begins again: scans are numbered on from {next}");
            line.log(Level::Info, text);
        } else if tick + 1 < scans && self.clock.rate().is_some() {
            let (nanos, next) = (source.nanos(tick), source.nanos(tick + 1));
            if let (Some(nanos), Some(next)) = (nanos, next)
                && jumps(nanos, next)
            {
                let seconds = (next as i128 - nanos as i128) as f64 / 1e9;
                let text =
                    format!("recorded time jumps by {seconds:.0} s here, which is not waited for");
                line.log(Level::Warn, text);
            }
        }
    }
}

/// When the next scan was taken.
fn next_nanos<L: Line, S: Driven<L::Bus>>(line: &L, source: &S) -> u64 {
    source.nanos(line.door().next_tick()).unwrap_or_default()
}
