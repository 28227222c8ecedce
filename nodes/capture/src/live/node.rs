//! The shell on the bus for cameras: `feeds ─► Synchroniser ─► door ─► images`.

use std::time::{Duration, Instant};

use messages::bus::{Bell, Bus, Filled, Gate, Level, Outputs, Request, Start};
use messages::door::UnderWay;
use messages::synchronisation::Synchronisation;
use messages::{Delivery, Header, Image, NONE, Raw};

use super::feed::{Feed, Frame, News, Open};
use super::glance::Glances;
use super::kept::{Kept, Pace};
use super::{Way, cameras_of, opener};
use crate::exposure::Exposure;
use crate::node::{CaptureError, Pause};
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
/// How long to wait for news when nothing else is to be done.
const IDLE: Duration = Duration::from_millis(500);

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
        images: bus.outputs(&settings.makes())?,
        is_raw_asked: settings.raw,
        gate: bus.gate(&start.resume, settings.scans)?,
        synchroniser: Synchroniser::new(names.len(), (settings.tolerance * 1e6) as u64, WAITING),
        feeds: Vec::new(),
        pace: kept.pace(),
        kept,
        lost: vec![0; names.len()],
        returns: vec![0; names.len()],
        is_resumed: start.life > 0,
        is_live: delivery == Delivery::Live,
        skip: 0,
        failed: None,
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
    let mut pause = Pause::default();
    bus.playing(pause.playing());
    bus.ready()?;
    cameras.open(bus, way, settings)?;
    let total = settings.scans.unwrap_or(u64::MAX);
    let (mut has_finished, mut is_draining, mut is_held) = (false, false, false);
    let mut next: Option<Scan<Frame>> = None;
    let mut watch = Watch::new();
    loop {
        let is_over = is_draining
            || cameras.failed.is_some()
            || cameras.gate.door().next_tick() >= total
            || (next.is_none() && cameras.synchroniser.has_ended());
        let may_wait = !cameras.is_live || is_held;
        let is_stuck = next.is_some() || is_over;
        let is_busy = !is_stuck && cameras.has_news();
        match bus.request(if is_busy { Duration::ZERO } else { IDLE })? {
            Some(Request::Stop(_)) => break,
            Some(Request::Drain) => is_draining = true,
            Some(Request::Resend) => cameras.resend(bus)?,
            Some(Request::Hold) => {
                is_held = true;
                cameras.gate.held();
            }
            Some(Request::Go) => is_held = false,
            Some(Request::Play(play)) => {
                pause.play(play, Instant::now());
                bus.playing(pause.playing());
            }
            Some(Request::Begin) | None => {}
        }
        cameras.hear_done(bus)?;
        if !is_over {
            cameras.take_in(bus);
            while cameras.gate.door().next_tick() < total {
                let Some(scan) = next.take().or_else(|| cameras.next(bus)) else {
                    break;
                };
                if !is_held && pause.lets_go() && cameras.gate.door().is_open() {
                    pause.went();
                    watch.came();
                    cameras.admit(bus, &scan)?;
                } else if may_wait {
                    next = Some(scan);
                    break;
                } else {
                    let cause = match pause.lets_go() {
                        true => "the door was closed",
                        false => "it was paused",
                    };
                    watch.came();
                    cameras.gate.refuse(bus, cause);
                    cameras.pass(&scan)?;
                }
            }
        }
        let is_paused = is_held || !pause.lets_go() || next.is_some();
        watch.look(bus, &cameras, is_over || is_paused);
        cameras.say_glances(bus, is_over);
        if is_over && cameras.gate.door().is_idle() && !has_finished {
            has_finished = true;
            if next.take().is_some() {
                cameras.synchroniser.take_back();
            }
            cameras.synchroniser.finish();
            bus.synchronised(cameras.account());
            let counts = [("scans", cameras.gate.door().admitted())];
            match &cameras.failed {
                None => bus.finish(&counts),
                Some(why) => bus.finish_failed(why, &counts),
            }
        }
    }
    Ok(())
}

struct Cameras {
    names: Vec<String>,
    feeds: Vec<Feed>,
    synchroniser: Synchroniser<Frame>,
    images: Outputs,
    gate: Gate,
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
    failed: Option<String>,
    exposure: Exposure,
    glances: Option<Glances>,
    /// Frames are kept as they came, and rectified when they go out.
    rectifier: Option<Rectifier>,
    /// Whether images are published as they were taken too.
    is_raw_asked: bool,
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

impl Cameras {
    fn open(&mut self, bus: &Bus, way: Way, settings: &Settings) -> Result<(), CaptureError> {
        for (view, camera) in cameras_of(way, settings)?.iter().enumerate() {
            let name = &self.names[view];
            let open: Open = match way {
                Way::Bus => super::bus::opener(bus.run().clone(), view),
                _ => opener(way, camera, settings, self.is_live)?,
            };
            let (run, node) = (bus.run().clone(), bus.name().to_owned());
            let ring = move || {
                let bell = Bus::own_bell(&run, &node).ok();
                move || bell.iter().for_each(Bell::ring)
            };
            let feed = Feed::start(name, open, !self.is_live, ring);
            self.feeds.push(feed.map_err(SourceError::Thread)?);
        }
        if way == Way::Bus {
            let (size, views) = (bus.run().rig.size, self.names.join(", "));
            let text = format!(
                "waiting for frames of {views}, {size}: publish them to {}",
                bus.run().root.display()
            );
            bus.log(Level::Info, text);
        }
        Ok(())
    }

    fn has_news(&self) -> bool {
        let mut feeds = self.feeds.iter().enumerate();
        feeds.any(|(camera, feed)| !feed.news.is_empty() && self.may_take(camera))
    }

    /// A file waits for the others, a camera does not.
    fn may_take(&self, camera: usize) -> bool {
        self.is_live || self.synchroniser.has_room(camera)
    }

    /// Takes in what the cameras have sent.
    fn take_in(&mut self, bus: &Bus) {
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
                self.take(bus, camera, news);
            }
        }
    }

    fn take(&mut self, bus: &Bus, camera: usize, news: News) {
        let name = &self.names[camera];
        match news {
            News::Opened { is_live } => {
                // A file is read from its beginning: what went in before is passed over.
                if !is_live && self.is_resumed {
                    self.skip = self.gate.door().next_tick();
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

    /// The next scan that is to go in.
    fn next(&mut self, bus: &Bus) -> Option<Scan<Frame>> {
        let mut scan = self.synchroniser.next_scan()?;
        while self.skip > 0 {
            self.skip -= 1;
            scan = self.synchroniser.next_scan()?;
        }
        if std::mem::take(&mut self.is_resumed) {
            let missed = self.pace.missed(scan.nanos);
            self.gate.refuse_scans(bus, "capture was restarted", missed);
        }
        Some(scan)
    }

    fn admit(&mut self, bus: &Bus, scan: &Scan<Frame>) -> Result<(), CaptureError> {
        // Whoever takes the place of this process must find it.
        let tick = self.gate.door().next_tick();
        let io = SourceError::io(&bus.run().root);
        self.kept.keep(tick, scan).map_err(io)?;
        self.pass(scan)?;
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
        let under_way = self.gate.admit(bus);
        self.send(bus, under_way, scan)
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
    fn pass(&mut self, scan: &Scan<Frame>) -> Result<(), CaptureError> {
        self.pace.advance(scan.nanos);
        let io = SourceError::io(std::path::Path::new("the run's folder"));
        Ok(self.kept.keep_pace(self.pace).map_err(io)?)
    }

    fn send(&self, bus: &Bus, under_way: UnderWay, scan: &Scan<Frame>) -> Result<(), CaptureError> {
        let rig = &bus.run().rig;
        let done_below = self.gate.door().needed_from();
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
            if self.is_raw_asked {
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

    /// Sends the scans under way once more, and those they depend on, the oldest first.
    fn resend(&mut self, bus: &Bus) -> Result<(), CaptureError> {
        for under_way in self.gate.door().to_resend() {
            let io = SourceError::io(&bus.run().root);
            let scan = self.kept.read(under_way.tick).map_err(io)?;
            self.send(bus, under_way, &scan)?;
        }
        Ok(())
    }

    fn hear_done(&mut self, bus: &Bus) -> Result<(), CaptureError> {
        let done = self.gate.door().done_count();
        self.gate.hear_done(bus)?;
        if self.gate.door().done_count() > done {
            let needed = self.gate.door().to_resend();
            let needed: Vec<u64> = needed.into_iter().map(|scan| scan.tick).collect();
            self.kept.forget_all_but(|tick| needed.contains(&tick));
        }
        Ok(())
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

    fn look(&mut self, bus: &Bus, cameras: &Cameras, is_waiting: bool) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        self.next = now + LOOK_EVERY;
        if is_waiting {
            // Nobody waits for the cameras: whether scans come again is not known, and not said.
            self.last = now;
            self.said = None;
        }
        let silent = now - self.last;
        let account = cameras.account();
        let received = account.cameras.iter().map(|camera| camera.received).sum();
        if received != self.received.0 {
            self.received = (received, now);
        }
        let is_quiet = received > 0 && now - self.received.1 >= QUIET;
        let why = (silent >= PATIENCE).then(|| match is_quiet {
            true => "no camera sends anything any more".to_owned(),
            false => cameras.synchroniser.why(&cameras.names),
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
