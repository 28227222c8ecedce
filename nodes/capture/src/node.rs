//! The shell on the bus: `source ─► door ─► images`, a scan at a time.

use std::time::{Duration, Instant};

use messages::bus::{Bus, BusError, Filled, Gate, Loan, Outputs, Request, Start};
use messages::door::UnderWay;
use messages::{Delivery, Header, Image, Kind, NONE, Rig};

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
    let source = Source::open(&settings)?;
    let total = source.scans();
    let mut capture = Capture {
        source,
        images: bus.outputs(&[Kind::Image])?,
        gate: bus.gate(&start.resume, Some(total))?,
        rig: bus.run().rig.clone(),
        start_nanos: settings.start.unwrap_or_default(),
        settings,
    };
    let is_live = bus.run().delivery == Delivery::Live;
    let (mut failed, mut has_finished, mut is_draining) = (None, false, false);
    bus.ready()?;
    let began = Instant::now();
    let ticks_before = capture.gate.door().next_tick();
    loop {
        let is_over = is_draining || failed.is_some() || capture.gate.door().next_tick() >= total;
        // A camera has its own time; files are read as fast as they are done with.
        let since = (capture.gate.door().next_tick() - ticks_before) as f64 / capture.settings.rate;
        let due = if is_live {
            began + Duration::from_secs_f64(since)
        } else {
            began
        };
        let is_due = !is_over && due <= Instant::now();
        let wait = match is_due && (is_live || capture.gate.door().is_open()) {
            true => Duration::ZERO,
            false if is_over || !is_live => IDLE,
            false => due.saturating_duration_since(Instant::now()).min(IDLE),
        };
        match bus.request(wait)? {
            Some(Request::Stop(_)) => break,
            Some(Request::Drain) => is_draining = true,
            Some(Request::Resend) => match capture.resend() {
                Err(CaptureError::Source(error)) => failed = Some(error.to_string()),
                resent => resent?,
            },
            Some(Request::Begin | Request::Play(_)) | None => {}
        }
        capture.gate.hear_done(bus)?;
        if is_due && capture.gate.door().is_open() {
            match capture.read(capture.gate.door().next_tick()) {
                Ok(loans) => {
                    let scan = capture.gate.admit(bus);
                    capture.send(scan, loans)?;
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

struct Capture {
    source: Source,
    images: Outputs,
    gate: Gate,
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
        let done_below = self.gate.door().done_below();
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
        for scan in self.gate.door().under_way().collect::<Vec<_>>() {
            let loans = self.read(scan.tick)?;
            self.send(scan, loans)?;
        }
        Ok(())
    }
}
