//! The shell on the bus: `source ─► door ─► images`, a scan at a time.

use std::time::{Duration, Instant};

use messages::bus::{Bus, BusError, Dones, Filled, Loan, Outputs, Progress, Request, Start};
use messages::{Delivery, Header, Image, Kind, NONE, Rig};

use crate::door::{Door, UnderWay};
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

/// How long to wait for news when nothing else is to be done.
const IDLE: Duration = Duration::from_secs(1);

/// Sends scan after scan while the door is open, until the source is exhausted or the launcher says to stop.
///
/// # Errors
/// When the bus fails or the source cannot be opened. A scan that cannot be read ends the source: what was admitted
/// before comes out.
pub fn run(bus: &mut Bus, settings: Settings, start: &Start) -> Result<(), CaptureError> {
    let mut capture = Capture {
        source: Source::open(&settings)?,
        images: bus.outputs(&[Kind::Image])?,
        dones: bus.dones()?,
        door: door(bus.run().in_flight, &start.resume),
        rig: bus.run().rig.clone(),
        start_nanos: settings.start.unwrap_or_default(),
        settings,
    };
    let is_live = bus.run().delivery == Delivery::Live;
    let total = capture.source.scans();
    let (mut failed, mut has_finished, mut is_draining) = (None, false, false);
    bus.ready()?;
    let began = Instant::now();
    let ticks_before = capture.door.next_tick();
    loop {
        let is_over = is_draining || failed.is_some() || capture.door.next_tick() >= total;
        // A camera has its own time; files are read as fast as they are done with.
        let since = (capture.door.next_tick() - ticks_before) as f64 / capture.settings.rate;
        let due = if is_live {
            began + Duration::from_secs_f64(since)
        } else {
            began
        };
        let is_due = !is_over && due <= Instant::now();
        let wait = match is_due && (is_live || capture.door.is_open()) {
            true => Duration::ZERO,
            false if is_over || !is_live => IDLE,
            false => due.saturating_duration_since(Instant::now()).min(IDLE),
        };
        match bus.request(wait)? {
            Some(Request::Stop(_)) => break,
            Some(Request::Drain) => is_draining = true,
            Some(Request::Resend) => capture.resend()?,
            Some(Request::Begin) | None => {}
        }
        if capture.hear_done()? {
            bus.progress(capture.progress(total));
        }
        if is_due && capture.door.is_open() {
            match capture.read(capture.door.next_tick()) {
                Ok(loans) => {
                    let scan = capture.door.admit();
                    // Said before it is sent: a successor knows of every scan that anybody may have seen.
                    bus.progress(capture.progress(total));
                    capture.send(scan, loans)?;
                }
                Err(CaptureError::Source(error)) => failed = Some(error.to_string()),
                Err(error) => return Err(error),
            }
        } else if is_due && is_live {
            capture.door.refuse("the door was closed");
            bus.progress(capture.progress(total));
        }
        if is_over && capture.door.is_idle() && !has_finished {
            has_finished = true;
            match &failed {
                None => bus.finish(&[("scans", capture.door.admitted())]),
                Some(why) => bus.finish_failed(why, &[("scans", capture.door.admitted())]),
            }
        }
    }
    Ok(())
}

fn door(width: usize, resume: &Progress) -> Door {
    let under_way = resume
        .under_way
        .iter()
        .map(|&(sequence, tick)| UnderWay { sequence, tick });
    Door::resume(
        width,
        under_way,
        resume.admitted,
        resume.next_tick,
        resume.refused.clone(),
    )
}

struct Capture {
    source: Source,
    images: Outputs,
    dones: Dones,
    door: Door,
    rig: Rig,
    start_nanos: u64,
    settings: Settings,
}

/// The images of one scan, read but not sent: a scan goes out whole or not at all.
type Loans = Vec<(Loan<Image>, Filled, Header)>;

impl Capture {
    /// Reads a scan of the source into shared memory.
    fn read(&mut self, tick: u64) -> Result<Loans, CaptureError> {
        let nanos = self.settings.nanos(self.start_nanos, tick);
        let mut loans = Vec::with_capacity(self.rig.views.len());
        for view in 0..self.rig.views.len() {
            let mut loan = self.images.loan::<Image>(view as u32, NONE)?;
            let (size, filled) = {
                let mut room = loan.room()?;
                let size = self.source.read(tick, view, &mut room)?;
                (size, Filled::of::<Image>(&room))
            };
            let position_m = self.rig.position_m(view, size);
            let header = Header {
                view: view as u32,
                position_m,
                ..Header::new(0, nanos, size)
            };
            loans.push((loan, filled, header));
        }
        Ok(loans)
    }

    fn send(&mut self, scan: UnderWay, loans: Loans) -> Result<(), CaptureError> {
        let done_below = self.door.done_below();
        for (loan, filled, header) in loans {
            let header = Header {
                sequence: scan.sequence,
                done_below,
                ..header
            };
            self.images.publish(loan, &header, filled)?;
        }
        Ok(())
    }

    /// Sends the scans under way once more, the oldest first.
    fn resend(&mut self) -> Result<(), CaptureError> {
        for scan in self.door.under_way().collect::<Vec<_>>() {
            let loans = self.read(scan.tick)?;
            self.send(scan, loans)?;
        }
        Ok(())
    }

    /// Lets the scans that are done out; whether there were any.
    fn hear_done(&mut self) -> Result<bool, CaptureError> {
        let mut any = false;
        while let Some(sequence) = self.dones.receive()? {
            any |= self.door.done(sequence);
        }
        self.dones.forget_below(self.door.done_below());
        Ok(any)
    }

    fn progress(&self, total: u64) -> Progress {
        Progress {
            admitted: self.door.admitted(),
            done: self.door.done_count(),
            done_below: self.door.done_below(),
            total: Some(total),
            next_tick: self.door.next_tick(),
            under_way: self
                .door
                .under_way()
                .map(|scan| (scan.sequence, scan.tick))
                .collect(),
            refused: self.door.refused().clone(),
        }
    }
}
