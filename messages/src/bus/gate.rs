//! The gate: the door, and the way to it and from it over the bus.

use super::{Bus, BusError, Dones, Event, Progress, control};
use crate::door::{Door, UnderWay};

/// The door of a running graph: hears which scans are done, and tells the launcher how far the scans have come.
#[derive(Debug)]
pub struct Gate {
    door: Door,
    dones: Dones,
    total: Option<u64>,
}

impl Bus {
    /// The run's gate, as an earlier process left it; for the one node that lets scans in. `total` is how many scans
    /// its source has, when that is known.
    ///
    /// # Errors
    /// When the subscriber cannot be made.
    pub fn gate(&mut self, resume: &Progress, total: Option<u64>) -> Result<Gate, BusError> {
        let scan = |&(sequence, tick): &(u64, u64)| UnderWay { sequence, tick };
        let door = Door::resume(
            self.run().in_flight,
            resume.past.iter().map(scan),
            resume.under_way.iter().map(scan),
            resume.admitted,
            resume.next_tick,
            resume.refused.clone(),
        )
        .reaching(self.run().rig.reach());
        Ok(Gate {
            door,
            dones: self.dones()?,
            total,
        })
    }
}

impl Gate {
    /// The door.
    pub fn door(&self) -> &Door {
        &self.door
    }

    /// Lets the source's next scan in. That is said before anything of it is sent, so that a successor of this process
    /// knows of every scan that anybody may have seen.
    pub fn admit(&mut self, bus: &Bus) -> UnderWay {
        let scan = self.door.admit();
        self.tell(bus);
        scan
    }

    /// Turns the source's next scan away, whole.
    pub fn refuse(&mut self, bus: &Bus, cause: &str) {
        self.refuse_scans(bus, cause, 1);
    }

    /// Turns so many of the source's next scans away, whole.
    pub fn refuse_scans(&mut self, bus: &Bus, cause: &str, count: u64) {
        self.door.refuse(cause, count);
        self.tell(bus);
    }

    /// Lets the scans out that are done.
    ///
    /// # Errors
    /// When the subscriber fails.
    pub fn hear_done(&mut self, bus: &Bus) -> Result<(), BusError> {
        let mut any = false;
        while let Some(sequence) = self.dones.receive()? {
            any |= self.door.done(sequence);
        }
        self.dones.forget_below(self.door.done_below());
        if any {
            self.tell(bus);
        }
        Ok(())
    }

    /// Tells the launcher that no scan is let in from now on.
    pub fn held(&self) {
        control::say(&Event::Held {
            admitted: self.door.admitted(),
        });
    }

    /// Goes on with another scan of the source; the numbers go on as they do.
    pub fn seek(&mut self, bus: &Bus, tick: u64) {
        self.door.seek(tick);
        self.tell(bus);
    }

    /// Tells how far the scans have come.
    fn tell(&self, bus: &Bus) {
        let scans = |scans: &mut dyn Iterator<Item = UnderWay>| {
            scans.map(|scan| (scan.sequence, scan.tick)).collect()
        };
        bus.progress(Progress {
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
