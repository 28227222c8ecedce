//! The shell on the bus: `source ─► door ─► images`, a scan at a time.

use std::collections::VecDeque;

use messages::bus::{Bus, BusError, Drive, Driven, Filled, Level, Loan, Outputs, Read, Start};
use messages::door::{Door, UnderWay};
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
    let delivery = bus.run().delivery;
    let drive = Drive {
        scans: Some(source.scans()),
        delivery,
        // A camera has its own time; files are read as fast as they are done with.
        rate: (delivery == Delivery::Live).then_some(1.0),
        ..Drive::default()
    };
    if let Some(account) = source.account() {
        bus.synchronised(account.clone());
    }
    let mut capture = Capture {
        source,
        images: bus.outputs(&settings.makes())?,
        truths: VecDeque::new(),
        // A file is as it is.
        exposure: Exposure::new(bus.run().rig.views.iter().map(|view| view.name.clone()), 1),
        doubts: Vec::new(),
        unreadable: 0,
        rig: bus.run().rig.clone(),
        start_nanos: settings.start.unwrap_or_default(),
        settings,
    };
    drive.run(bus, start, &mut capture)
}

struct Capture {
    source: Source,
    images: Outputs,
    /// The truth of the scenes read last, by scene.
    truths: VecDeque<(u64, Vec<f32>)>,
    exposure: Exposure,
    /// What is to be said of how views are exposed.
    doubts: Vec<String>,
    /// Scans that could not be read.
    unreadable: u64,
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

impl Driven for Capture {
    type Scan = Loans;
    type Error = CaptureError;

    /// By the source's own times, or by its rate.
    fn nanos(&self, tick: u64) -> Option<u64> {
        Some(self.taken_nanos(tick))
    }

    /// Renders or decodes before a camera's time begins what is kept from the first time on. What cannot be read is told
    /// when its turn comes.
    fn prepare(&mut self, bus: &Bus, door: &Door) -> Result<(), CaptureError> {
        if bus.run().delivery == Delivery::Lossless {
            return Ok(());
        }
        let first = door.next_tick();
        let scenes = self.source.scenes().min(PREPARED);
        for tick in first..self.source.scans().min(first + scenes) {
            match self.read(tick) {
                Ok(_) | Err(CaptureError::Source(_)) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn read_scan(&mut self, bus: &Bus, tick: u64) -> Result<Read<Loans>, CaptureError> {
        let read = self.read(tick);
        self.doubts.drain(..).for_each(|doubt| bus.doubt(doubt));
        match read {
            Ok(loans) => Ok(Read::Scan(loans)),
            Err(CaptureError::Source(error)) if error.is_of_one_scan() => {
                if self.unreadable < NAMED_UNREADABLE {
                    bus.log(Level::Error, format!("{error}: its scan is left out"));
                }
                self.unreadable += 1;
                Ok(Read::LeftOut(UNREADABLE))
            }
            Err(CaptureError::Source(error)) => Ok(Read::Failed(error.to_string())),
            Err(error) => Err(error),
        }
    }

    fn read_again(&mut self, _: &Bus, tick: u64) -> Result<Loans, CaptureError> {
        self.read(tick)
    }

    fn send_scan(
        &mut self,
        _: &Bus,
        under_way: UnderWay,
        done_below: u64,
        loans: Loans,
    ) -> Result<(), CaptureError> {
        let numbered = |header: Header| Header {
            sequence: under_way.sequence,
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
}

impl Capture {
    /// When a scan was taken.
    fn taken_nanos(&self, tick: u64) -> u64 {
        match self.source.nanos_after_start(tick) {
            Some(after) => self.start_nanos.saturating_add(after),
            None => self.settings.nanos(self.start_nanos, tick),
        }
    }

    /// Reads a scan of the source into shared memory.
    fn read(&mut self, tick: u64) -> Result<Loans, CaptureError> {
        let nanos = self.taken_nanos(tick);
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
}
