//! Bags as a source: what robots record, read where it lies.
//!
//! ```text
//! files ─► every message once ─► topics, stamps, places ─► views ─► Synchroniser ─► scans: where each image lies
//!   └──────────────────────────────── any image again, when it is wanted ─────────────────┘
//! ```
//!
//! [`storage`] knows files ([`mcap`], [`sqlite`]), [`wire`] and [`message`] what messages hold, [`topics`] which of them are
//! views, [`info`] what their cameras are like, [`place`] where one stood along a rail. Of images only their heads are
//! looked at when a bag is opened, and only where they lie is kept: a bag of any size takes little memory.

mod info;
mod mcap;
mod message;
mod picture;
mod place;
mod sqlite;
mod storage;
mod topics;
mod wire;

use std::path::{Path, PathBuf};

use messages::synchronisation::Synchronisation;
use messages::words::counted;
use messages::{Rig, Size};

use crate::error::SourceError;
use crate::folder::{self, Choice};
use crate::image_file;
use crate::names;
use crate::settings::{Mode, Settings};
use crate::synchronise::{Cause, Synchroniser};

pub(crate) use info::Cameras;
use info::Described;
use message::{Info, Kind, Placed};
use picture::Gray;
use place::{Along, Asked, Places};
use storage::{At, Coding, Files, Looked, Topic, Topics, Visit, Want};
use topics::Candidate;
use wire::Why;

/// How a source is called that is a bag.
const SCHEME: &str = "bag:";
/// Scans that are looked at to see how many bits are in use.
const SAMPLES: usize = 8;
/// Scans that are tried to find one that can be read.
const MOST_TRIED: usize = 100;
/// Bytes of gray levels that are kept.
const KEPT: usize = 64 << 20;
/// Topics that are named where it is unclear which are meant.
const NAMED: usize = 40;
/// Stamps before the year 2000 are of clocks that count from when they were started.
const FIRST_YEAR: u64 = 946_684_800 * 1_000_000_000;

/// The path of the bag that a source is; `None` when it is something else.
pub(crate) fn path_of(source: &str) -> Option<PathBuf> {
    if let Some(path) = source.strip_prefix(SCHEME) {
        return Some(PathBuf::from(path));
    }
    let path = Path::new(source);
    if path.is_dir() {
        let is_recorded = storage::is_recorded(path);
        let holds_bags = || storage::files_in(path).is_ok_and(|files| !files.is_empty());
        let holds_images = || {
            let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
            entries
                .map(|entry| entry.path())
                .any(|path| image_file::is_image(&path))
        };
        return (is_recorded || (holds_bags() && !holds_images())).then(|| path.to_owned());
    }
    storage::is_bag_file(path).then(|| path.to_owned())
}

/// Where an image lies, and when it was taken.
#[derive(Clone, Copy, Debug)]
struct Frame {
    stamp: u64,
    log: u64,
    at: At,
}

/// The images of one topic.
#[derive(Debug)]
struct Images {
    kind: Kind,
    coding: Coding,
    frames: Vec<Frame>,
    /// Of the first: size and encoding, where it is not compressed, and the camera's frame.
    first: Option<(Size, String)>,
    frame: String,
    /// How many say nothing of when they were taken.
    unstamped: u64,
    /// How many are of another size than the first.
    resized: u64,
    /// How many cannot be used, and why the first of them.
    damaged: u64,
    why: Option<Why>,
}

impl Images {
    fn new(kind: Kind, coding: Coding) -> Self {
        Self {
            kind,
            coding,
            frames: Vec::new(),
            first: None,
            frame: String::new(),
            unstamped: 0,
            resized: 0,
            damaged: 0,
            why: None,
        }
    }

    fn damage(&mut self, why: Why) {
        self.damaged += 1;
        self.why.get_or_insert(why);
    }

    fn take(&mut self, log: u64, at: At, bytes: &[u8]) {
        let image = match message::image(self.kind, self.coding, bytes) {
            Ok(image) => image,
            Err(why) => return self.damage(why),
        };
        match &image.raw {
            Some(raw) => {
                if let Some(why) = picture::refused(raw, image.length) {
                    return self.damage(why);
                }
                let (size, _) = self
                    .first
                    .get_or_insert_with(|| (raw.size, raw.encoding.clone()));
                if *size != raw.size {
                    self.resized += 1;
                    return;
                }
            }
            None if image.length == 0 => return self.damage("it is empty".to_owned()),
            None => {}
        }
        if self.frames.is_empty() {
            self.frame.clone_from(&image.frame);
        }
        self.unstamped += u64::from(image.stamp == 0);
        let stamp = image.stamp;
        self.frames.push(Frame { stamp, log, at });
    }
}

/// What was seen of a topic.
#[derive(Debug)]
enum Seen {
    Nothing,
    Images(Images),
    /// What the first says, and how many say something else.
    Info(Option<Info>, u64),
    Places(Places),
}

/// Sees every message of a bag once.
struct Survey {
    asked: Option<Asked>,
    seen: Vec<(Option<Kind>, Coding, Seen)>,
}

impl Survey {
    /// Whether a topic may say where the camera was.
    fn may_place(&self, kind: Kind, topic: &Topic) -> bool {
        self.asked.as_ref().is_some_and(|asked| {
            let is_meant =
                topic.name.trim_start_matches('/') == asked.topic.trim_start_matches('/');
            is_meant || (kind.is_transforms() && topic.name.ends_with("tf_static"))
        })
    }
}

impl Visit for Survey {
    fn wants(&mut self, number: usize, topic: &Topic) -> Want {
        let kind = Kind::of(topic);
        let (seen, want) = match kind {
            Some(kind) if kind.is_image() => {
                let want = match topic.coding {
                    Coding::Json => Want::Whole,
                    _ => Want::Head,
                };
                (Seen::Images(Images::new(kind, topic.coding)), want)
            }
            Some(kind) if kind.is_info() => (Seen::Info(None, 0), Want::Whole),
            Some(kind) if kind.is_place() && self.may_place(kind, topic) => {
                (Seen::Places(Places::default()), Want::Whole)
            }
            _ => (Seen::Nothing, Want::Nothing),
        };
        if number >= self.seen.len() {
            let nothing = || (None, Coding::Other, Seen::Nothing);
            self.seen.resize_with(number, nothing);
            self.seen.push((kind, topic.coding, seen));
        }
        want
    }

    fn message(&mut self, topic: usize, log: u64, at: At, bytes: &[u8]) {
        let Some((Some(kind), coding, seen)) = self.seen.get_mut(topic) else {
            return;
        };
        match seen {
            Seen::Images(images) => images.take(log, at, bytes),
            Seen::Info(first, differing) => {
                let info = Info::of(*kind, *coding, bytes).ok();
                match (&*first, info) {
                    (Some(first), Some(info)) => *differing += u64::from(*first != info),
                    (None, info) => *first = info,
                    (Some(_), None) => {}
                }
            }
            Seen::Places(places) => match Placed::of(*kind, *coding, bytes) {
                Ok(told) => places.take(log, told, self.asked.as_ref()),
                Err(_) => places.damaged += 1,
            },
            Seen::Nothing => {}
        }
    }
}

/// Size, gray levels and camera of an image.
type Decoded = (Size, Gray, String);

/// A chosen view of a bag.
#[derive(Debug)]
pub(crate) struct View {
    /// Its topic.
    pub(crate) topic: String,
    /// Which of the bag's views it is, from the left.
    pub(crate) number: u32,
    kind: Kind,
    coding: Coding,
}

/// A bag, opened: where the images of each scan lie.
#[derive(Debug)]
pub(crate) struct Bag {
    path: PathBuf,
    files: Files,
    pub(crate) views: Vec<View>,
    pub(crate) size: Size,
    /// When each scan was taken by its stamps, and where its images lie.
    scans: Vec<(u64, Vec<At>)>,
    /// When the first scan was taken, by the clock of the day; `None` where nothing says it.
    pub(crate) start: Option<u64>,
    /// What became of every image.
    pub(crate) account: Synchronisation,
    /// Of one camera along a rail, where that is told: which scans have a place, and the places, in metres.
    pub(crate) along: Option<(Vec<usize>, Vec<f64>)>,
    /// What cannot be read of it.
    pub(crate) damage: Option<String>,
    pub(crate) notices: Vec<String>,
    pub(crate) warnings: Vec<String>,
    bits: u32,
    /// Whether images are of more than 8 bit.
    is_deep: bool,
    /// Scan, view and gray levels, the newest last.
    kept: Vec<((usize, usize), Vec<u8>)>,
}

impl Bag {
    /// Opens a bag, and says what its cameras are like.
    pub(crate) fn open(path: &Path, settings: &Settings) -> Result<(Self, Cameras), SourceError> {
        let wrong = |why: Why| SourceError::Bag {
            path: path.to_owned(),
            why,
        };
        let asked = settings.position_topic.as_deref().map(Asked::of);
        let mut files = Files::open(path).map_err(wrong)?;
        let mut topics = Topics::default();
        let mut survey = Survey {
            asked: asked.clone(),
            seen: Vec::new(),
        };
        let mut looked = files.visit(&mut topics, &mut survey).map_err(wrong)?;
        let is_own = |topic: &Topic| topic.schema.starts_with("tricurve.");
        if looked.is_own || topics.iter().any(is_own) {
            return Err(SourceError::OwnRecording {
                path: path.to_owned(),
            });
        }
        let unclear = |why: Why| SourceError::BagTopics {
            path: path.to_owned(),
            why,
            held: held(&topics, settings.mode),
        };
        let chosen = chosen(&topics, &survey, settings).map_err(unclear)?;
        let (mut notices, mut warnings) = (Vec::new(), Vec::new());
        let order = match settings.mode {
            Mode::Rail => vec![0],
            Mode::Rig => {
                let choice = Choice::among(&settings.views, chosen.len(), None);
                let places: Vec<f64> = (0..chosen.len()).map(|place| place as f64).collect();
                choice.step(&path.display().to_string(), &places)?;
                if choice.why == folder::Why::FirstThree {
                    notices.push(format!(
                        "the first three of {} views are taken; choose others with --views",
                        chosen.len()
                    ));
                }
                choice.views
            }
        };
        let numbers: Vec<usize> = order.iter().map(|&view| chosen[view as usize]).collect();
        let infos = infos(&topics, &survey);
        let places = places(&topics, &mut survey, asked.as_ref());
        if let (Some(asked), Some(places)) = (&asked, &places)
            && places.damaged > 0
        {
            looked.damage(format!(
                "{} of {} cannot be read",
                counted(places.damaged, "message"),
                asked.topic
            ));
        }
        let mut images = Vec::new();
        let mut views = Vec::new();
        for (&number, &view) in numbers.iter().zip(&order) {
            let topic = topics.get(number);
            let (_, _, seen) = &mut survey.seen[number];
            let Seen::Images(own) = std::mem::replace(seen, Seen::Nothing) else {
                continue;
            };
            views.push(View {
                topic: topic.name.clone(),
                number: view,
                kind: own.kind,
                coding: own.coding,
            });
            images.push(own);
        }
        let names = names(views.len(), settings.mode);
        notices.push(table(&topics, &numbers, &images, &names));
        let is_by_log = images
            .iter()
            .any(|images| images.unstamped == images.frames.len() as u64);
        if is_by_log {
            warnings.push(
                "images carry no stamps: they are put together by when they were recorded"
                    .to_owned(),
            );
            let frames = images.iter_mut().flat_map(|images| &mut images.frames);
            frames.for_each(|frame| frame.stamp = frame.log);
        }
        for (images, view) in images.iter().zip(&views) {
            if let Some(why) = &images.why {
                looked.messages = looked.messages.saturating_sub(images.damaged);
                looked.damage(format!(
                    "{} of {} images on {} cannot be used; the first: {why}",
                    images.damaged,
                    images.damaged + images.resized + images.frames.len() as u64,
                    view.topic
                ));
            }
        }
        warnings.extend(files.unread());
        let (found, account, why) = scans(&images, settings.tolerance, &names);
        let Some((_, first)) = found.first() else {
            return Err(wrong(format!("no scan is complete: {why}")));
        };
        warnings.extend(remark(&account));
        let reference = images.len() / 2;
        let start = start(&images[reference].frames[first[reference]], &mut notices);
        let scans = found
            .iter()
            .map(|(nanos, frames)| {
                let at = |(images, &frame): (&Images, &usize)| images.frames[frame].at;
                (*nanos, images.iter().zip(frames).map(at).collect())
            })
            .collect();
        let mut bag = Self {
            path: path.to_owned(),
            files,
            size: Size::default(),
            scans,
            start,
            account,
            along: None,
            damage: damage(&looked),
            notices,
            warnings,
            bits: 16,
            is_deep: false,
            kept: Vec::new(),
            views,
        };
        if let Some(damage) = &bag.damage {
            bag.warnings.push(damage.clone());
        }
        let frames = bag.look(&images, settings.bits)?;
        if let (Some(asked), Some(places)) = (&asked, places) {
            let times: Vec<(u64, u64)> = found
                .iter()
                .map(|(_, frames)| {
                    let frame = images[0].frames[frames[0]];
                    (frame.stamp, frame.log)
                })
                .collect();
            let along = Along::of(asked, places, &times, &frames[0]).map_err(wrong)?;
            bag.notices.extend(along.notices);
            bag.warnings.extend(along.warnings);
            bag.along = Some((along.kept, along.metres));
        } else if let Some(asked) = &asked {
            return Err(unclear(format!(
                "it has nothing on {} that says where the camera was",
                asked.topic
            )));
        }
        let described = described(&bag.views, &frames, &infos, &mut bag.warnings);
        let cameras = Cameras::of(&described, bag.size, settings);
        Ok((bag, cameras))
    }

    /// The images of the first scan all of which can be read.
    fn first_readable(&mut self) -> Result<Vec<Decoded>, SourceError> {
        let mut first = None;
        for scan in 0..self.scans.len().min(MOST_TRIED) {
            let all = (0..self.views.len()).map(|view| self.decoded(scan, view));
            match all.collect::<Result<Vec<_>, _>>() {
                Ok(decoded) => return Ok(decoded),
                Err(error) => _ = first.get_or_insert(error),
            }
        }
        Err(first.unwrap_or(SourceError::Bag {
            path: self.path.clone(),
            why: "it holds no scan".to_owned(),
        }))
    }

    /// Decodes the first scan, and some others for the bits in use; gives the frame of each view's camera.
    fn look(&mut self, images: &[Images], asked: Option<u32>) -> Result<Vec<String>, SourceError> {
        let first = self.first_readable()?;
        let mut deepest = None;
        let (mut frames, mut sizes) = (Vec::new(), Vec::new());
        for ((size, gray, frame), images) in first.into_iter().zip(images) {
            deepest = deepest.max(gray.most());
            sizes.push(size);
            frames.push(frame);
            let encoding = images.first.as_ref().map(|(_, encoding)| encoding);
            let notice = encoding.and_then(|encoding| picture::notice(encoding));
            let notice = notice.map(str::to_owned);
            self.notices
                .extend(notice.filter(|text| !self.notices.contains(text)));
        }
        // Only of deep images others are looked at too; what cannot be read is told when its turn comes.
        let last = self.scans.len() - 1;
        let samples = if deepest.is_some() { SAMPLES } else { 1 };
        for sample in 1..samples {
            for view in 0..self.views.len() {
                let decoded = self.decoded(sample * last / (SAMPLES - 1), view);
                deepest = deepest.max(decoded.ok().and_then(|(_, gray, _)| gray.most()));
            }
        }
        self.size = sizes[0];
        if let Some(odd) = sizes.iter().position(|size| *size != self.size) {
            return Err(SourceError::Bag {
                path: self.path.clone(),
                why: format!(
                    "images on {} are {} pixels and those on {} are {}; all views must be of one size",
                    self.views[odd].topic, sizes[odd], self.views[0].topic, self.size
                ),
            });
        }
        if let Some(most) = deepest {
            self.bits = asked.unwrap_or_else(|| picture::bits_in_use(most));
            self.is_deep = true;
            self.notices.push(format!(
                "{} bits of 16-bit images are in use, and are scaled to 8",
                self.bits
            ));
        }
        Ok(frames)
    }

    /// Size, gray levels and camera of an image.
    fn decoded(&mut self, scan: usize, view: usize) -> Result<Decoded, SourceError> {
        let (nanos, places) = &self.scans[scan];
        let (nanos, at) = (*nanos, places[view]);
        let View {
            topic,
            kind,
            coding,
            ..
        } = &self.views[view];
        let file = folder::name(self.files.path(&at));
        let wrong = |why: Why| SourceError::BagImage {
            topic: topic.clone(),
            nanos,
            why: format!("{why} ({file})"),
        };
        let bytes = match self.files.read(&at) {
            Ok(bytes) => bytes,
            Err(why) => return Err(wrong(why)),
        };
        let image = message::image(*kind, *coding, &bytes).map_err(wrong)?;
        let frame = image.frame.clone();
        let (size, gray) = picture::gray(&image).map_err(wrong)?;
        Ok((size, gray, frame))
    }

    /// Bits in use, where images are of more than 8.
    pub(crate) fn bits(&self) -> Option<u8> {
        u8::try_from(self.bits).ok().filter(|_| self.is_deep)
    }

    /// How many scans there are.
    pub(crate) fn len(&self) -> usize {
        self.scans.len()
    }

    /// When a scan was taken, in nanoseconds of the bag's own clock.
    pub(crate) fn nanos(&self, scan: usize) -> u64 {
        self.scans[scan].0
    }

    /// The gray levels of a view of a scan, row by row.
    pub(crate) fn pixels(&mut self, scan: usize, view: usize) -> Result<&[u8], SourceError> {
        let key = (scan, view);
        if let Some(place) = self.kept.iter().position(|(known, _)| *known == key) {
            let known = self.kept.remove(place);
            self.kept.push(known);
        } else {
            let (size, gray, _) = self.decoded(scan, view)?;
            if size != self.size {
                return Err(SourceError::BagImage {
                    topic: self.views[view].topic.clone(),
                    nanos: self.nanos(scan),
                    why: format!("it is {size} pixels, and the first was {}", self.size),
                });
            }
            let mut held: usize = self.kept.iter().map(|(_, pixels)| pixels.len()).sum();
            while held + size.pixels() > KEPT && !self.kept.is_empty() {
                held -= self.kept.remove(0).1.len();
            }
            self.kept.push((key, gray.scaled(self.bits)));
        }
        Ok(self.kept.last().map_or(&[], |(_, pixels)| pixels))
    }
}

/// The topics of the views, left to right: told, or by their names.
fn chosen(topics: &Topics, survey: &Survey, settings: &Settings) -> Result<Vec<usize>, Why> {
    let shows = |(number, (_, _, seen)): (usize, &(Option<Kind>, Coding, Seen))| match seen {
        Seen::Images(images) if !images.frames.is_empty() => Some(number),
        _ => None,
    };
    let numbers: Vec<usize> = survey.seen.iter().enumerate().filter_map(shows).collect();
    let candidate = |&number: &usize| {
        let topic = topics.get(number);
        let is_compressed = survey.seen[number].0.is_some_and(Kind::is_compressed);
        Candidate {
            name: topic.name.clone(),
            is_compressed,
        }
    };
    let candidates: Vec<Candidate> = numbers.iter().map(candidate).collect();
    let damaged = survey
        .seen
        .iter()
        .enumerate()
        .find_map(|(number, (_, _, seen))| match seen {
            Seen::Images(Images {
                frames,
                why: Some(why),
                ..
            }) if frames.is_empty() => Some(format!("{}: {why}", topics.get(number).name)),
            _ => None,
        });
    let found = match (settings.topics.is_empty(), settings.mode) {
        (false, _) => topics::told(&settings.topics, &candidates),
        (true, Mode::Rig) => topics::by_name(&candidates),
        (true, Mode::Rail) => topics::alone(&candidates).map(|one| vec![one]),
    };
    let found = found.map_err(|why| match damaged {
        Some(damaged) => format!("{why}; images cannot be used on {damaged}"),
        None => why,
    })?;
    let (count, is_rail) = (found.len(), settings.mode == Mode::Rail);
    if is_rail && count != 1 {
        return Err(format!(
            "along a rail one camera moves, and topics names {count}"
        ));
    }
    Ok(found.into_iter().map(|one| numbers[one]).collect())
}

/// The topics there are, and how to choose among them.
fn held(topics: &Topics, mode: Mode) -> String {
    let mut all: Vec<&Topic> = topics.iter().collect();
    names::sort(&mut all, |topic| topic.name.clone());
    // Those that can be views first.
    all.sort_by_key(|topic| !Kind::of(topic).is_some_and(Kind::is_image));
    let named = all.iter().take(NAMED).map(|topic| {
        let coding = match (topic.coding, Kind::of(topic)) {
            (Coding::Other, _) => ", written in a way that is not read",
            _ => "",
        };
        format!("{} ({}, {}{coding})", topic.name, topic.schema, topic.count)
    });
    let named: Vec<String> = named.collect();
    let more = match all.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let how = match mode {
        Mode::Rig => "--topics left=/…,centre=/…,right=/…",
        Mode::Rail => "--topics /… and --position /…",
    };
    match named.is_empty() {
        true => "it has no topics".to_owned(),
        false => format!("choose with {how} among {}{more}", named.join(", ")),
    }
}

/// What cameras are like, by topic: the camera's frame and what is said of it, and whether that changes.
fn infos(topics: &Topics, survey: &Survey) -> Vec<(String, Info, u64)> {
    let info = |(number, (_, _, seen)): (usize, &(Option<Kind>, Coding, Seen))| match seen {
        Seen::Info(Some(info), differing) => {
            Some((topics.get(number).name.clone(), info.clone(), *differing))
        }
        _ => None,
    };
    survey.seen.iter().enumerate().filter_map(info).collect()
}

/// What was said of places on the topic that was asked for; of transforms those that never change too.
fn places(topics: &Topics, survey: &mut Survey, asked: Option<&Asked>) -> Option<Places> {
    let asked = asked?;
    let plain = |name: &str| name.trim_start_matches('/').to_owned();
    let mut found: Option<Places> = None;
    let mut still = Places::default();
    let mut is_of_transforms = false;
    for (number, (kind, _, seen)) in survey.seen.iter_mut().enumerate() {
        let Seen::Places(places) = seen else { continue };
        let places = std::mem::take(places);
        if plain(&topics.get(number).name) == plain(&asked.topic) {
            is_of_transforms |= kind.is_some_and(Kind::is_transforms);
            found.get_or_insert_default().join(places);
        } else {
            still.join(places);
        }
    }
    if let Some(found) = found.as_mut().filter(|_| is_of_transforms) {
        found.join(still);
    }
    found
}

/// What the views are called.
fn names(views: usize, mode: Mode) -> Vec<String> {
    match mode {
        Mode::Rail => vec!["moving".to_owned()],
        Mode::Rig => {
            let rig = Rig::of_views(views, &[], Size::default());
            rig.views.into_iter().map(|view| view.name).collect()
        }
    }
}

/// Which topic became which view.
fn table(topics: &Topics, numbers: &[usize], images: &[Images], names: &[String]) -> String {
    let each = numbers.iter().zip(images).zip(names);
    let each = each.map(|((&number, images), name)| {
        let topic = topics.get(number);
        let how = match &images.first {
            Some((size, encoding)) => format!(", {encoding}, {size}"),
            None => String::new(),
        };
        format!(
            "{name} is {} ({} {}{how})",
            topic.name, topic.count, topic.schema
        )
    });
    each.collect::<Vec<_>>().join("; ")
}

/// Frames of each scan, when it was taken, the account of all frames, and why there are no scans.
type Scans = (Vec<(u64, Vec<usize>)>, Synchronisation, String);

/// Puts images together by their stamps, as cameras' frames are.
fn scans(images: &[Images], tolerance_ms: f64, names: &[String]) -> Scans {
    let mut order: Vec<(u64, usize, usize)> = Vec::new();
    for (camera, images) in images.iter().enumerate() {
        let frames = images.frames.iter().enumerate();
        order.extend(frames.map(|(number, frame)| (frame.stamp, camera, number)));
    }
    order.sort_unstable();
    // All of them are here: none has to wait, and none to go for want of room.
    let mut synchroniser = Synchroniser::new(images.len(), (tolerance_ms * 1e6) as u64, usize::MAX);
    for (camera, images) in images.iter().enumerate() {
        synchroniser.refuse(camera, images.damaged, Cause::Damaged);
        synchroniser.refuse(camera, images.resized, Cause::Size);
    }
    let mut scans = Vec::new();
    for (nanos, camera, number) in order {
        synchroniser.push(camera, nanos, number);
        while let Some(scan) = synchroniser.next_scan() {
            scans.push((scan.nanos, scan.frames));
        }
    }
    let why = synchroniser.why(names);
    (0..images.len()).for_each(|camera| synchroniser.end(camera));
    while let Some(scan) = synchroniser.next_scan() {
        scans.push((scan.nanos, scan.frames));
    }
    synchroniser.finish();
    (scans, synchroniser.account(names), why)
}

/// What is to be said of images that are in no scan.
fn remark(account: &Synchronisation) -> Option<String> {
    let lost: Vec<String> = account
        .cameras
        .iter()
        .filter(|camera| camera.matched < camera.received)
        .map(|camera| {
            let causes = camera
                .dropped
                .iter()
                .map(|(cause, count)| format!("{count}: {cause}"));
            let late =
                (camera.late > 0).then(|| format!("{}: it has the stamp of another", camera.late));
            let causes: Vec<String> = causes.chain(late).collect();
            format!(
                "{} of {} of {} ({})",
                camera.received - camera.matched,
                camera.received,
                camera.name,
                causes.join("; ")
            )
        })
        .collect();
    (!lost.is_empty()).then(|| {
        format!(
            "{} {} complete, and images are in none: {}; tolerance {} ms, set capture.tolerance",
            counted(account.scans, "scan"),
            if account.scans == 1 { "is" } else { "are" },
            lost.join(", "),
            account.tolerance_ms
        )
    })
}

/// When the first scan was taken, by the clock of the day.
fn start(first: &Frame, notices: &mut Vec<String>) -> Option<u64> {
    if first.stamp >= FIRST_YEAR {
        return Some(first.stamp);
    }
    let recorded = Some(first.log).filter(|&log| log >= FIRST_YEAR);
    let from = match recorded {
        Some(_) => "the first counts as taken when it was recorded",
        None => "the first counts as taken now, or at capture.start",
    };
    notices.push(format!(
        "stamps are of a clock that was {:.3} s old, not of the day: {from}",
        first.stamp as f64 / 1e9
    ));
    recorded
}

/// What cannot be read of a bag, in a sentence.
fn damage(looked: &Looked) -> Option<String> {
    (!looked.damages.is_empty()).then(|| {
        format!(
            "the bag is damaged, {} of it can be read: {}",
            counted(looked.messages, "message"),
            looked.damages.join("; ")
        )
    })
}

/// What is said of each view's camera: beside its images, or of the same frame.
fn described(
    views: &[View],
    frames: &[String],
    infos: &[(String, Info, u64)],
    warnings: &mut Vec<String>,
) -> Vec<Described> {
    let found = |(view, frame): (&View, &String)| {
        let space = topics::namespace(&view.topic);
        let beside = infos
            .iter()
            .filter(|(name, ..)| topics::namespace(name) == space);
        let beside: Vec<_> = beside.collect();
        let of_frame =
            |&(_, info, _): &&&(String, Info, u64)| !frame.is_empty() && info.frame == *frame;
        // Several cameras may share a namespace, and a frame says which is meant.
        let one = match beside.as_slice() {
            [one] => Some(*one),
            several => several
                .iter()
                .copied()
                .find(|one| of_frame(&one))
                .or_else(|| {
                    let mut all = infos.iter().filter(|one| of_frame(&one));
                    all.next().filter(|_| all.next().is_none())
                }),
        };
        Described {
            images: view.topic.clone(),
            info: one.map(|(name, info, differing)| {
                if *differing > 0 {
                    warnings.push(format!(
                        "{name} changes {differing} times, and what it says first is taken"
                    ));
                }
                (name.clone(), info.clone())
            }),
        }
    };
    views.iter().zip(frames).map(found).collect()
}
