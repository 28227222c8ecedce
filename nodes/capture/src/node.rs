//! The shell on the bus: `source ─► door ─► images`, a scan at a time.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use messages::bus::{
    Bus, BusError, Filled, Gate, Level, Loan, Outputs, Play, Playing, Request, Start,
};
use messages::door::UnderWay;
use messages::{Delivery, Header, Image, NONE, Raw, Rig};

use crate::exposure::Exposure;
use crate::live::{self, Way};
use crate::{Settings, Source, SourceError};

/// Why capture failed.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The source failed.
    #[error(transparent)]
    Source(#[from] SourceError),
}

/// Why scans are turned away whose images cannot be read, while those after them can.
pub const UNREADABLE: &str = "an image cannot be read";
/// How many such scans are named.
const NAMED_UNREADABLE: u64 = 5;
/// How long to wait for news when nothing else is to be done.
const IDLE: Duration = Duration::from_secs(1);

/// Sends scan after scan while the door is open, until the source is exhausted or the launcher says to stop.
///
/// # Errors
/// When the bus fails or the source cannot be opened. A scan that cannot be read ends the source: what was admitted
/// before comes out.
pub fn run(bus: &mut Bus, settings: Settings, start: &Start) -> Result<(), CaptureError> {
    if let Some(way) = Way::of(&settings.source)? {
        return live::node::run(bus, way, &settings, start);
    }
    let source = Source::open_at(&settings, &start.places, &start.sway)?;
    let total = source.scans();
    let mut capture = Capture {
        source,
        images: bus.outputs(&settings.makes())?,
        truths: VecDeque::new(),
        // A file is as it is.
        exposure: Exposure::new(bus.run().rig.views.iter().map(|view| view.name.clone()), 1),
        doubts: Vec::new(),
        gate: bus.gate(&start.resume, Some(total))?,
        rig: bus.run().rig.clone(),
        start_nanos: settings.start.unwrap_or_default(),
        settings,
    };
    let is_live = bus.run().delivery == Delivery::Live;
    let (mut failed, mut has_finished, mut is_draining) = (None, false, false);
    let (mut pause, mut is_held) = (Pause::default(), false);
    let mut unreadable = 0u64;
    if let Some(account) = capture.source.account() {
        bus.synchronised(account.clone());
    }
    bus.playing(pause.playing());
    if is_live {
        capture.prepare()?;
    }
    bus.ready()?;
    let mut began = Instant::now();
    let first_nanos = capture.nanos(capture.gate.door().next_tick());
    loop {
        let is_over = is_draining || failed.is_some() || capture.gate.door().next_tick() >= total;
        // A camera has its own time; files are read as fast as they are done with.
        let since = capture
            .nanos(capture.gate.door().next_tick())
            .saturating_sub(first_nanos);
        let due = if is_live {
            began + Duration::from_nanos(since)
        } else {
            began
        };
        let may_go = !is_over && !is_held && pause.lets_go();
        let is_due = may_go && due <= Instant::now();
        let wait = match is_due && (is_live || capture.gate.door().is_open()) {
            true => Duration::ZERO,
            false if !may_go || !is_live => IDLE,
            false => due.saturating_duration_since(Instant::now()).min(IDLE),
        };
        match bus.request(wait)? {
            Some(Request::Stop(_)) => break,
            Some(Request::Drain) => is_draining = true,
            // What cannot be read again is lost to those who wait for it.
            Some(Request::Resend) => capture.resend()?,
            Some(Request::Hold) => {
                is_held = true;
                capture.gate.held();
            }
            Some(Request::Go) => is_held = false,
            Some(Request::Play(play)) => {
                // A camera's time does not pass while it is paused.
                began += pause.play(play, Instant::now());
                bus.playing(pause.playing());
            }
            Some(Request::Begin) | None => {}
        }
        capture.gate.hear_done(bus)?;
        // What was asked meanwhile holds for the next scan already.
        let is_due = is_due && !is_held && pause.lets_go();
        if is_due && capture.gate.door().is_open() {
            pause.went();
            let read = capture.read(capture.gate.door().next_tick());
            capture.doubts.drain(..).for_each(|doubt| bus.doubt(doubt));
            match read {
                Ok(loans) => {
                    let scan = capture.gate.admit(bus);
                    capture.send(scan, loans)?;
                }
                Err(CaptureError::Source(error)) if error.is_of_one_scan() => {
                    if unreadable < NAMED_UNREADABLE {
                        bus.log(Level::Error, format!("{error}: its scan is left out"));
                    }
                    unreadable += 1;
                    capture.gate.refuse(bus, UNREADABLE);
                }
                Err(CaptureError::Source(error)) => failed = Some(error.to_string()),
                Err(error) => return Err(error),
            }
        } else if is_due && is_live {
            capture.gate.refuse(bus, "the door was closed");
        }
        if is_over && capture.gate.door().is_idle() && !has_finished {
            has_finished = true;
            match &failed {
                None => bus.finish(&[("scans", capture.gate.door().admitted())]),
                Some(why) => bus.finish_failed(why, &[("scans", capture.gate.door().admitted())]),
            }
        }
    }
    Ok(())
}

/// Whether scans go out.
#[derive(Debug, Default)]
pub(crate) struct Pause {
    since: Option<Instant>,
    /// Scans to let out although it is paused.
    steps: u32,
}

impl Pause {
    pub(crate) fn lets_go(&self) -> bool {
        self.since.is_none() || self.steps > 0
    }

    /// A scan went out.
    pub(crate) fn went(&mut self) {
        self.steps = self.steps.saturating_sub(1);
    }

    /// Pauses or goes on; gives how long it was paused.
    pub(crate) fn play(&mut self, play: Play, now: Instant) -> Duration {
        let since = self.since;
        match play {
            Play::Pause => self.since = since.is_none().then_some(now),
            Play::Stop => self.since = since.or(Some(now)),
            Play::Resume => self.since = None,
            Play::Step => {
                self.since = since.or(Some(now));
                self.steps += 1;
            }
            Play::Faster | Play::Slower | Play::Rate(_) | Play::Seek(_) => {}
        }
        match (since, self.since) {
            (Some(since), None) => now.saturating_duration_since(since),
            _ => Duration::ZERO,
        }
    }

    pub(crate) fn playing(&self) -> Playing {
        Playing {
            is_paused: self.since.is_some(),
            ..Playing::default()
        }
    }
}

struct Capture {
    source: Source,
    images: Outputs,
    /// The truth of the scenes read last, by scene.
    truths: VecDeque<(u64, Vec<f32>)>,
    exposure: Exposure,
    /// What is to be said of how views are exposed.
    doubts: Vec<String>,
    gate: Gate,
    rig: Rig,
    start_nanos: u64,
    settings: Settings,
}

/// The messages of one scan, read but not sent: a scan goes out whole or not at all.
struct Loans {
    images: Vec<(Loan<Image>, Filled, Header)>,
    /// As they were taken, where that is asked for.
    raw: Vec<(Loan<Raw>, Filled, Header)>,
    truth: Option<(Loan<messages::Truth>, Filled, Header)>,
}

/// Bytes of truths that are kept, of a rail's frames or of scenes that take turns, and how many are kept at least.
const TRUTHS: usize = 64 << 20;
const LEAST_TRUTHS: usize = 4;

/// Scans that are read before the camera's time begins, at most: all scenes that take turns when rendered.
const PREPARED: u64 = 8;

impl Capture {
    /// When a scan was taken: by the source's own times, or by its rate.
    fn nanos(&self, tick: u64) -> u64 {
        match self.source.nanos_after_start(tick) {
            Some(after) => self.start_nanos.saturating_add(after),
            None => self.settings.nanos(self.start_nanos, tick),
        }
    }

    /// Renders or decodes before the camera's time begins what is kept from the first time on. What cannot be read is told
    /// when its turn comes.
    fn prepare(&mut self) -> Result<(), CaptureError> {
        let first = self.gate.door().next_tick();
        let scenes = self.source.scenes().min(PREPARED);
        for tick in first..self.source.scans().min(first + scenes) {
            match self.read(tick) {
                Ok(_) | Err(CaptureError::Source(_)) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Reads a scan of the source into shared memory.
    fn read(&mut self, tick: u64) -> Result<Loans, CaptureError> {
        let nanos = self.nanos(tick);
        let mut images = Vec::with_capacity(self.rig.views.len());
        let mut raw = Vec::new();
        for view in 0..self.rig.views.len() {
            let mut loan = self.images.loan::<Image>(view as u32, NONE)?;
            let (size, filled) = {
                let mut room = loan.room()?;
                let size = self.source.read(tick, view, &mut room)?;
                self.doubts.extend(self.source.take_doubt());
                self.doubts.extend(self.exposure.look(view, &room.pixels));
                (size, Filled::of::<Image>(&room))
            };
            let on_rail = self.source.position_m(tick);
            let position_m = on_rail.unwrap_or_else(|| self.rig.position_m(view, size));
            let header = Header {
                view: view as u32,
                position_m,
                sway: self.source.sway(tick),
                ..Header::new(0, nanos, size)
            };
            images.push((loan, filled, header));
            if self.settings.raw {
                let mut loan = self.images.loan::<Raw>(view as u32, NONE)?;
                let filled = {
                    let mut room = loan.room()?;
                    self.source.read_raw(tick, view, &mut room)?;
                    Filled::of::<Raw>(&room)
                };
                raw.push((loan, filled, header));
            }
        }
        let truth = match self.settings.truth {
            Some(view) => Some(self.read_truth(tick, view, nanos)?),
            None => None,
        };
        Ok(Loans { images, raw, truth })
    }

    /// Writes the truth of a scan into shared memory: NaN everywhere when nothing is known.
    fn read_truth(
        &mut self,
        tick: u64,
        view: usize,
        nanos: u64,
    ) -> Result<(Loan<messages::Truth>, Filled, Header), CaptureError> {
        let (scene, size) = (tick % self.source.scenes(), self.source.size_of(tick));
        if !self.truths.iter().any(|(known, _)| *known == scene) {
            let truth = self.source.truth(tick, view)?;
            let unknown = || vec![f32::NAN; size.pixels()];
            let disparity = truth.map_or_else(unknown, |truth| truth.disparity);
            self.truths.push_front((scene, disparity));
            let kept = self.truths.iter().scan(0, |bytes, (_, truth)| {
                *bytes += size_of_val(&**truth);
                Some(*bytes)
            });
            let kept = kept.take_while(|&bytes| bytes <= TRUTHS).count();
            self.truths.truncate(kept.max(LEAST_TRUTHS));
        }
        let mut loan = self.images.loan::<messages::Truth>(NONE, NONE)?;
        let filled = {
            let mut room = loan.room()?;
            let known = self.truths.iter().find(|(known, _)| *known == scene);
            if let Some((_, disparity)) = known {
                room.disparity.extend_from_slice(disparity);
            }
            Filled::of::<messages::Truth>(&room)
        };
        let header = Header {
            position_m: self.source.position_m(tick).unwrap_or_default(),
            sway: self.source.sway(tick),
            ..Header::new(0, nanos, size)
        };
        Ok((loan, filled, header))
    }

    fn send(&mut self, scan: UnderWay, loans: Loans) -> Result<(), CaptureError> {
        let done_below = self.gate.door().needed_from();
        let numbered = |header: Header| Header {
            sequence: scan.sequence,
            done_below,
            ..header
        };
        for (loan, filled, header) in loans.images {
            self.images.publish(loan, &numbered(header), filled)?;
        }
        for (loan, filled, header) in loans.raw {
            self.images.publish(loan, &numbered(header), filled)?;
        }
        if let Some((loan, filled, header)) = loans.truth {
            self.images.publish(loan, &numbered(header), filled)?;
        }
        Ok(())
    }

    /// Sends the scans under way once more, the oldest first.
    fn resend(&mut self) -> Result<(), CaptureError> {
        for scan in self.gate.door().to_resend() {
            let loans = self.read(scan.tick)?;
            self.send(scan, loans)?;
        }
        Ok(())
    }
}
