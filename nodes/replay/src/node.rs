//! The shell on the bus: `recording ─► door ─► every topic before the cut`, a scan at a time.

use std::path::Path;

use messages::bus::{Bus, BusError, Drive, Driven, Filled, Loan, Outputs, Read, Start};
use messages::door::UnderWay;
use messages::record::{Codec, Recorded};
use messages::recording::{ReadError, Recording, Scan};
use messages::{Curves, CurvesView, Delivery, Header, Kind, Tables, Topic};

use crate::{Selection, SelectionError, Settings};

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

/// Sends scan after scan when it is due and the door is open, until the recording ends or the launcher says to stop.
///
/// # Errors
/// When the bus fails or the recording cannot be opened. A scan that cannot be read ends the replay: what was admitted
/// before comes out.
pub fn run(bus: &mut Bus, settings: Settings, start: &Start) -> Result<(), ReplayError> {
    let recording = Recording::open(Path::new(&settings.file))?;
    let selection = Selection::of(&recording, settings.choice(bus.run().taken()))?;
    let drive = Drive {
        scans: Some(selection.scans.len() as u64),
        repeats: settings.repeat,
        // A recording waits, at whatever rate it is played.
        delivery: Delivery::Lossless,
        rate: settings.rate,
        is_paused: settings.paused,
        span: Some(selection.span()),
    };
    let mut replay = Replay {
        outputs: bus.outputs_on_demand(&settings.kinds())?,
        codec: recording.codec().clone(),
        done_below: 0,
        selection,
        recording,
    };
    drive.run(bus, start, &mut replay)
}

struct Replay {
    recording: Recording,
    selection: Selection,
    codec: Codec,
    outputs: Outputs,
    /// No scan below this number is needed any more.
    done_below: u64,
}

impl Driven for Replay {
    type Scan = (Scan, Vec<Topic>);
    type Error = ReplayError;

    fn nanos(&self, tick: u64) -> Option<u64> {
        Some(self.selection.scan(tick).1)
    }

    fn read_scan(&mut self, _: &Bus, tick: u64) -> Result<Read<Self::Scan>, ReplayError> {
        Ok(match self.read(tick) {
            Ok(scan) => Read::Scan(scan),
            Err(error) => Read::Failed(error.to_string()),
        })
    }

    fn read_again(&mut self, _: &Bus, tick: u64) -> Result<Self::Scan, ReplayError> {
        Ok(self.read(tick)?)
    }

    fn send_scan(
        &mut self,
        _: &Bus,
        under_way: UnderWay,
        done_below: u64,
        (scan, topics): Self::Scan,
    ) -> Result<(), ReplayError> {
        self.done_below = done_below;
        self.send(under_way, &scan, &topics)?;
        self.recording.reuse(scan);
        Ok(())
    }

    fn at_or_after(&self, nanos: u64) -> u64 {
        self.selection.at_or_after(nanos)
    }
}

impl Replay {
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
            done_below: self.done_below,
            ..header
        }
    }
}
