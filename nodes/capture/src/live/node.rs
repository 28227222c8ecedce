//! The shell on the bus for cameras: `feeds ─► Synchroniser ─► door ─► images`.

use std::time::{Duration, Instant};

use messages::bus::{Ahead, Bell, Bus, Drive, Driven, Filled, Level, Outputs, Read, Start};
use messages::door::{Door, UnderWay};
use messages::synchronisation::Synchronisation;
use messages::{Delivery, Header, Image, NONE, Raw};

use super::feed::{Feed, Frame, News, Open};
use super::glance::Glances;
use super::kept::{Kept, Pace};
use super::{Way, cameras_of, opener};
use crate::exposure::Exposure;
use crate::node::CaptureError;
use crate::rectify::{Rectifier, show};
use crate::synchronise::{Cause, Scan, Synchroniser};
use crate::{Settings, SourceError};

/// Frames of a camera that wait for the others: a second of fast ones.
const WAITING: usize = 64;
/// How often the account is given, and looked at why there are no scans.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// How long no scan may come before it is said why.
const PATIENCE: Duration = Duration::from_secs(3);
/// How long no frame came of cameras of which it is said that they send nothing: it is seen a look or two late.
const QUIET: Duration = Duration::from_secs(2);
/// Scans in a row that must be ill exposed before it is said: a camera that begins looks for its exposure.
const EXPOSURE_PATIENCE: u64 = 30;
/// Looks in a row that must agree on what is wrong with the views.
const LOOKS: u32 = 3;

/// Lets scans in as the cameras take them, until they end or the launcher says to stop.
pub(crate) fn run(
    bus: &mut Bus,
    way: Way,
    settings: &Settings,
    start: &Start,
) -> Result<(), CaptureError> {
    let io = |error| SourceError::io(&bus.run().root)(error);
    let kept = Kept::open(&bus.run().root).map_err(io)?;
    let names: Vec<String> = bus.run().rig.views.iter().map(|v| v.name.clone()).collect();
    let rectifier = Rectifier::open(settings, names.len(), &[bus.run().rig.size])?;
    let delivery = bus.run().delivery;
    let patience = match delivery {
        Delivery::Live => EXPOSURE_PATIENCE.min(settings.scans.unwrap_or(u64::MAX)) as u32,
        Delivery::Lossless => 1,
    };
    let mut cameras = Cameras {
        way,
        settings,
        images: bus.outputs(&settings.makes())?,
        synchroniser: Synchroniser::new(names.len(), (settings.tolerance * 1e6) as u64, WAITING),
        feeds: Vec::new(),
        pace: kept.pace(),
        kept,
        lost: vec![0; names.len()],
        returns: vec![0; names.len()],
        is_resumed: start.life > 0,
        is_live: delivery == Delivery::Live,
        skip: 0,
        next: None,
        failed: None,
        watch: Watch::new(),
        exposure: Exposure::new(names.iter().cloned(), patience),
        // Along a rail views are frames of one camera.
        glances: bus.run().rig.rail.is_none().then(|| {
            let looks = if delivery == Delivery::Live { LOOKS } else { 1 };
            Glances::new(&names, looks)
        }),
        rectifier: rectifier.filter(|_| settings.rectify),
        motion: Motion {
            speed: settings.speed,
            start: settings.start.unwrap_or_default(),
        },
        names,
    };
    let drive = Drive {
        scans: settings.scans,
        delivery,
        ..Drive::default()
    };
    drive.run(bus, start, &mut cameras)
}

struct Cameras<'a> {
    way: Way,
    settings: &'a Settings,
    names: Vec<String>,
    feeds: Vec<Feed>,
    synchroniser: Synchroniser<Frame>,
    images: Outputs,
    kept: Kept,
    pace: Pace,
    /// Frames that each camera lost itself.
    lost: Vec<u64>,
    /// How often each returned.
    returns: Vec<u64>,
    /// Whether this process takes the place of one that died, and no scan came since.
    is_resumed: bool,
    is_live: bool,
    /// Scans of a file that went in before this process took over.
    skip: u64,
    /// The scan ahead.
    next: Option<Scan<Frame>>,
    failed: Option<String>,
    watch: Watch,
    exposure: Exposure,
    glances: Option<Glances>,
    /// Frames are kept as they came, and rectified when they go out.
    rectifier: Option<Rectifier>,
    motion: Motion,
}

/// How a camera moves along a rail.
#[derive(Clone, Copy, Debug)]
struct Motion {
    speed: Option<f64>,
    /// When it was at 0, in nanoseconds.
    start: u64,
}

impl Motion {
    /// Where a frame was taken, in metres: what it says itself, or by speed and time.
    fn position_m(&self, frame: &Frame) -> Option<f64> {
        if frame.position_m.is_finite() {
            return Some(frame.position_m);
        }
        // A camera's clock may be a little behind.
        let since = frame.nanos as i64 - self.start as i64;
        Some(self.speed? * since as f64 / 1e9)
    }
}

impl Driven for Cameras<'_> {
    type Scan = Scan<Frame>;
    type Error = CaptureError;

    /// Cameras take scans when they like.
    fn nanos(&self, _: u64) -> Option<u64> {
        None
    }

    fn begin(&mut self, bus: &Bus) -> Result<(), CaptureError> {
        for (view, camera) in cameras_of(self.way, self.settings)?.iter().enumerate() {
            let name = &self.names[view];
            let open: Open = match self.way {
                Way::Bus => super::bus::opener(bus.run().clone(), view),
                _ => opener(self.way, camera, self.settings, self.is_live)?,
            };
            let (run, node) = (bus.run().clone(), bus.name().to_owned());
            let ring = move || {
                let bell = Bus::own_bell(&run, &node).ok();
                move || bell.iter().for_each(Bell::ring)
            };
            let feed = Feed::start(name, open, !self.is_live, ring);
            self.feeds.push(feed.map_err(SourceError::Thread)?);
        }
        if self.way == Way::Bus {
            let (size, views) = (bus.run().rig.size, self.names.join(", "));
            let text = format!(
                "waiting for frames of {views}, {size}: publish them to {}",
                bus.run().root.display()
            );
            bus.log(Level::Info, text);
        }
        Ok(())
    }

    fn ahead(&mut self, bus: &Bus, door: &Door) -> Result<Ahead, CaptureError> {
        loop {
            if self.failed.is_none() {
                self.take_in(bus, door);
            }
            if self.next.is_some() {
                return Ok(Ahead::Scan);
            }
            if let Some(scan) = self.next_scan() {
                let nanos = scan.nanos;
                self.next = Some(scan);
                if std::mem::take(&mut self.is_resumed) {
                    let missed = self.pace.missed(nanos);
                    return Ok(Ahead::Missed("capture was restarted", missed));
                }
                return Ok(Ahead::Scan);
            }
            if let Some(why) = &self.failed {
                return Ok(Ahead::Failed(why.clone()));
            }
            if self.synchroniser.has_ended() {
                return Ok(Ahead::End);
            }
            // What makes room for a file's frame rings for none.
            if !self.has_news() {
                return Ok(Ahead::Nothing);
            }
        }
    }

    fn read_scan(&mut self, bus: &Bus, tick: u64) -> Result<Read<Scan<Frame>>, CaptureError> {
        let Some(scan) = self.next.take() else {
            let why = "the cameras' next scan was asked for before it came".to_owned();
            return Ok(Read::Failed(why));
        };
        // Whoever takes the place of this process must find it.
        let io = SourceError::io(&bus.run().root);
        self.kept.keep(tick, &scan).map_err(io)?;
        self.came(&scan)?;
        for (view, frame) in scan.frames.iter().enumerate() {
            if let Some(doubt) = self.exposure.look(view, &frame.pixels) {
                bus.doubt(doubt);
            }
        }
        if let Some(glances) = self.glances.as_mut().filter(|glances| glances.is_due()) {
            let size = bus.run().rig.size;
            let shown = scan.frames.iter().enumerate().map(|(view, frame)| {
                let mut pixels = vec![0; frame.pixels.len()];
                show(self.rectifier.as_ref(), view, &frame.pixels, &mut pixels);
                pixels
            });
            glances.begin(shown.collect(), size);
        }
        Ok(Read::Scan(scan))
    }

    fn read_again(&mut self, bus: &Bus, tick: u64) -> Result<Scan<Frame>, CaptureError> {
        let io = SourceError::io(&bus.run().root);
        Ok(self.kept.read(tick).map_err(io)?)
    }

    fn send_scan(
        &mut self,
        bus: &Bus,
        under_way: UnderWay,
        done_below: u64,
        scan: Scan<Frame>,
    ) -> Result<(), CaptureError> {
        let rig = &bus.run().rig;
        for (view, frame) in scan.frames.iter().enumerate() {
            let header = Header {
                view: view as u32,
                position_m: match rig.rail {
                    Some(_) => frame.position_m,
                    None => rig.position_m(view, frame.size),
                },
                done_below,
                ..Header::new(under_way.sequence, scan.nanos, frame.size)
            };
            let mut loan = self.images.loan::<Image>(view as u32, NONE)?;
            let filled = {
                let mut room = loan.room()?;
                let out = room.pixels.grow(frame.pixels.len());
                show(self.rectifier.as_ref(), view, &frame.pixels, out);
                Filled::of::<Image>(&room)
            };
            self.images.publish(loan, &header, filled)?;
            if self.settings.raw {
                let mut loan = self.images.loan::<Raw>(view as u32, NONE)?;
                let filled = {
                    let mut room = loan.room()?;
                    room.pixels.extend_from_slice(&frame.pixels);
                    Filled::of::<Raw>(&room)
                };
                self.images.publish(loan, &header, filled)?;
            }
        }
        Ok(())
    }

    fn pass_by(&mut self) -> Result<(), CaptureError> {
        match self.next.take() {
            Some(scan) => self.came(&scan),
            None => Ok(()),
        }
    }

    fn came_out(&mut self, door: &Door) {
        let needed = door.to_resend();
        let needed: Vec<u64> = needed.into_iter().map(|scan| scan.tick).collect();
        self.kept.forget_all_but(|tick| needed.contains(&tick));
    }

    fn look(&mut self, bus: &Bus, rests: bool) {
        if self.watch.is_due() {
            let account = self.account();
            let rests = rests || self.next.is_some();
            let why = || self.synchroniser.why(&self.names);
            self.watch.look(bus, account, why, rests);
        }
        self.say_glances(bus, false);
    }

    fn finish(&mut self, bus: &Bus) {
        self.say_glances(bus, true);
        if self.next.take().is_some() {
            self.synchroniser.take_back();
        }
        self.synchroniser.finish();
        bus.synchronised(self.account());
    }
}

impl Cameras<'_> {
    fn has_news(&self) -> bool {
        let mut feeds = self.feeds.iter().enumerate();
        feeds.any(|(camera, feed)| !feed.news.is_empty() && self.may_take(camera))
    }

    /// A file waits for the others, a camera does not.
    fn may_take(&self, camera: usize) -> bool {
        self.is_live || self.synchroniser.has_room(camera)
    }

    /// Takes in what the cameras have sent.
    fn take_in(&mut self, bus: &Bus, door: &Door) {
        for camera in 0..self.feeds.len() {
            let overrun = self.feeds[camera].overrun();
            self.synchroniser.refuse(camera, overrun, Cause::Overrun);
            let lost = self.feeds[camera].lost();
            if lost > 0 && self.lost[camera] == 0 {
                let text = format!("{} loses frames before they come here", self.names[camera]);
                bus.log(Level::Warn, text);
            }
            self.lost[camera] += lost;
            while self.may_take(camera)
                && let Ok(news) = self.feeds[camera].news.try_recv()
            {
                self.take(bus, door, camera, news);
            }
        }
    }

    fn take(&mut self, bus: &Bus, door: &Door, camera: usize, news: News) {
        let name = &self.names[camera];
        match news {
            News::Opened { is_live } => {
                // A file is read from its beginning: what went in before is passed over.
                if !is_live && self.is_resumed {
                    self.skip = door.next_tick();
                    self.is_resumed = false;
                }
            }
            News::Frame(frame) if frame.size != bus.run().rig.size => {
                let account = &self.synchroniser.account(&self.names).cameras[camera];
                let is_first = !account
                    .dropped
                    .contains_key(&Cause::Size.in_words(&self.names));
                if is_first {
                    let (size, expected) = (frame.size, bus.run().rig.size);
                    let text = format!(
                        "{name} sends {size} pixels, and sent {expected} at the start: such frames are dropped"
                    );
                    bus.log(Level::Error, text);
                }
                self.synchroniser.refuse(camera, 1, Cause::Size);
            }
            News::Frame(mut frame) => {
                if bus.run().rig.rail.is_some() {
                    match self.motion.position_m(&frame) {
                        Some(position_m) => frame.position_m = position_m,
                        None => {
                            self.failed
                                .get_or_insert(SourceError::NoPositions.to_string());
                            return;
                        }
                    }
                }
                self.synchroniser.push(camera, frame.nanos, frame);
            }
            News::Vanished(why) => {
                let text = format!("{name} has vanished: {why}; it is looked for every second");
                bus.log(Level::Warn, text);
            }
            News::Returned(after) => {
                self.returns[camera] += 1;
                let text = format!("{name} is back after {:.1} s", after.as_secs_f64());
                bus.log(Level::Warn, text);
            }
            News::Ended => self.synchroniser.end(camera),
            News::Failed(why) => {
                self.synchroniser.end(camera);
                self.failed = Some(format!("{name} cannot be read on: {why}"));
            }
        }
    }

    /// The next scan of the cameras, beyond those of a file that went in before.
    fn next_scan(&mut self) -> Option<Scan<Frame>> {
        while self.skip > 0 {
            self.synchroniser.next_scan()?;
            self.skip -= 1;
        }
        self.synchroniser.next_scan()
    }

    /// Says what looks at the views found.
    fn say_glances(&mut self, bus: &Bus, is_end: bool) {
        let said = self
            .glances
            .as_mut()
            .and_then(|glances| glances.said(is_end));
        if let Some(said) = said {
            bus.doubt(said);
        }
    }

    /// Notes when a scan came.
    fn came(&mut self, scan: &Scan<Frame>) -> Result<(), CaptureError> {
        self.watch.came();
        self.pace.advance(scan.nanos);
        let io = SourceError::io(std::path::Path::new("the run's folder"));
        Ok(self.kept.keep_pace(self.pace).map_err(io)?)
    }

    fn account(&self) -> Synchronisation {
        let mut account = self.synchroniser.account(&self.names);
        for (index, camera) in account.cameras.iter_mut().enumerate() {
            camera.lost = self.lost[index];
            camera.returns = self.returns[index];
        }
        account
    }
}

/// Looks how the cameras fall together, and says why where no scans come.
struct Watch {
    next: Instant,
    last: Instant,
    /// How many frames had come, and since when.
    received: (u64, Instant),
    said: Option<String>,
}

impl Watch {
    fn new() -> Self {
        Self {
            next: Instant::now() + LOOK_EVERY,
            last: Instant::now(),
            received: (0, Instant::now()),
            said: None,
        }
    }

    /// A scan came.
    fn came(&mut self) {
        self.last = Instant::now();
    }

    fn is_due(&self) -> bool {
        Instant::now() >= self.next
    }

    fn look(
        &mut self,
        bus: &Bus,
        account: Synchronisation,
        why_none: impl Fn() -> String,
        rests: bool,
    ) {
        let now = Instant::now();
        self.next = now + LOOK_EVERY;
        if rests {
            // Nobody waits for the cameras: whether scans come again is not known, and not said.
            self.last = now;
            self.said = None;
        }
        let silent = now - self.last;
        let received = account.cameras.iter().map(|camera| camera.received).sum();
        if received != self.received.0 {
            self.received = (received, now);
        }
        let is_quiet = received > 0 && now - self.received.1 >= QUIET;
        let why = (silent >= PATIENCE).then(|| match is_quiet {
            true => "no camera sends anything any more".to_owned(),
            false => why_none(),
        });
        match (&why, &self.said) {
            (Some(why), None) => {
                let seconds = silent.as_secs_f64();
                bus.log(Level::Warn, format!("no scan for {seconds:.1} s: {why}"));
            }
            (None, Some(_)) => bus.log(Level::Warn, "scans come again"),
            _ => {}
        }
        self.said.clone_from(&why);
        bus.synchronised(Synchronisation { why, ..account });
    }
}
