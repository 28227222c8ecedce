//! The gate: the door, and the way to it and from it over the bus.

use std::time::{Duration, Instant};

use super::drive::Line;
use super::{Bus, BusError, Dones, Event, Level, Playing, Progress, Request, control};
use crate::door::{Door, UnderWay};

/// The door of a running graph: hears which scans are done, and tells the launcher how far the scans have come.
#[derive(Debug)]
pub(super) struct Gate<'a> {
    bus: &'a mut Bus,
    door: Door,
    dones: Dones,
    total: Option<u64>,
}

impl<'a> Gate<'a> {
    /// The run's gate, as an earlier process left it; for the one node that lets scans in. `total` is how many scans
    /// its source has, when that is known.
    ///
    /// # Errors
    /// When the subscriber cannot be made.
    pub(super) fn new(
        bus: &'a mut Bus,
        resume: &Progress,
        total: Option<u64>,
    ) -> Result<Self, BusError> {
        let scan = |&(sequence, tick): &(u64, u64)| UnderWay { sequence, tick };
        let door = Door::resume(
            bus.run().in_flight,
            resume.past.iter().map(scan),
            resume.under_way.iter().map(scan),
            resume.admitted,
            resume.next_tick,
            resume.refused.clone(),
        )
        .reaching(bus.run().rig.reach());
        Ok(Self {
            dones: bus.dones()?,
            bus,
            door,
            total,
        })
    }

    /// Tells how far the scans have come.
    fn tell(&self) {
        let scans = |scans: &mut dyn Iterator<Item = UnderWay>| {
            scans.map(|scan| (scan.sequence, scan.tick)).collect()
        };
        self.bus.progress(Progress {
            admitted: self.door.admitted(),
            done: self.door.done_count(),
            done_below: self.door.done_below(),
            total: self.total,
            next_tick: self.door.next_tick(),
            under_way: scans(&mut self.door.under_way()),
            past: scans(&mut self.door.past()),
            refused: self.door.refused().clone(),
        });
    }
}

impl Line for Gate<'_> {
    type Bus = Bus;

    fn bus(&self) -> &Bus {
        self.bus
    }

    fn door(&self) -> &Door {
        &self.door
    }

    fn now(&self) -> Instant {
        Instant::now()
    }

    fn ready(&mut self) -> Result<(), BusError> {
        self.bus.ready()
    }

    fn request(&mut self, timeout: Duration) -> Result<Option<Request>, BusError> {
        self.bus.request(timeout)
    }

    fn hear_done(&mut self) -> Result<(), BusError> {
        let mut any = false;
        while let Some(sequence) = self.dones.receive()? {
            any |= self.door.done(sequence);
        }
        self.dones.forget_below(self.door.done_below());
        if any {
            self.tell();
        }
        Ok(())
    }

    fn admit(&mut self) -> UnderWay {
        let scan = self.door.admit();
        self.tell();
        scan
    }

    fn refuse(&mut self, cause: &str, count: u64) {
        self.door.refuse(cause, count);
        self.tell();
    }

    fn seek(&mut self, tick: u64) {
        self.door.seek(tick);
        self.tell();
    }

    fn held(&self) {
        control::say(&Event::Held {
            admitted: self.door.admitted(),
        });
    }

    fn playing(&self, playing: Playing) {
        self.bus.playing(playing);
    }

    fn log(&self, level: Level, text: String) {
        self.bus.log(level, text);
    }

    fn finish(&self, failed: Option<&str>) {
        let counts = [("scans", self.door.admitted())];
        match failed {
            None => self.bus.finish(&counts),
            Some(why) => self.bus.finish_failed(why, &counts),
        }
    }
}
