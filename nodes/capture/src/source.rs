//! One source of scans, whatever it is made of.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

use messages::settings::{self, Settings as _};
use messages::synchronisation::Synchronisation;
use messages::{Calibration, Contour, ImageRoom, RawRoom, Size, Sway};

use crate::bag::{self, Bag};
use crate::calibration::plausible::{self, Doubt, metres};
use crate::camera_info::{self, Known};
use crate::error::SourceError;
use crate::folder::{self, Album, Choice, Found, Shot, Why};
use crate::image_file;
use crate::layout::Layout;
use crate::levels::{self, Levels};
#[cfg(feature = "node")]
use crate::live;
#[cfg(feature = "node")]
use crate::rail;
use crate::rail::{Passed, Rail, Unit};
use crate::rectify::{Rectifier, show};
use crate::scene::{self, Object, Rendered};
use crate::sensor::Sensor;
use crate::settings::{Mode, Settings};
use crate::truth::Truth;

/// Scans of a rendered scene, when the settings do not say how many.
const RENDERED_SCANS: u64 = 30;

/// Where scans come from: opened once, read at any scan.
pub struct Source {
    kind: Kind,
    /// When it is one camera that moves: a scan is a frame.
    rail: Option<Rail>,
    scans: u64,
    calibration: Option<Calibration>,
    /// Makes parallel views of images as cameras took them.
    rectifier: Option<Rectifier>,
    /// Of images in a folder: that, and how they lie in it.
    folder: Option<(PathBuf, Layout)>,
    notices: Vec<String>,
    warnings: Vec<String>,
    /// Bits in use, where images are filed in 16.
    bits: Option<u8>,
}

enum Kind {
    Rendered {
        scenes: Vec<Rendered>,
        sensor: Sensor,
    },
    Folders {
        albums: Vec<Album>,
        kept: Kept,
    },
    Bag(Box<Bag>),
    #[cfg(feature = "node")]
    Cameras(live::Known),
}

/// A chosen view of a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Its file's name, with the folder where others have the same, or the position of a rendered scene.
    pub name: String,
    /// Which of the source's views it is, counted from 0.
    pub number: u32,
    /// Where its camera stands along the rail, in the source's own steps.
    pub position_steps: f64,
}

impl Source {
    /// Opens a source and checks all that can be known before the start; the first scan of a folder is decoded whole.
    ///
    /// # Errors
    /// What is wrong with the source or the settings, in one sentence.
    pub fn open(settings: &Settings) -> Result<Self, SourceError> {
        Self::open_at(settings, &[], &[])
    }

    /// Opens a source that told [`Self::places`] and [`Self::sways`] when it was opened before, and need not look at all its
    /// pictures again.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_at(
        settings: &Settings,
        places: &[f64],
        sway: &[Sway],
    ) -> Result<Self, SourceError> {
        settings.check()?;
        if settings.sway == Some(true) && settings.mode == Mode::Rig {
            return Err(SourceError::SwayOf {
                what: "a rig, of which check-geometry -o writes what capture.calibration makes good",
            });
        }
        #[cfg(feature = "node")]
        if let Some(way) = live::Way::of(&settings.source)? {
            if settings.sway == Some(true) {
                let what = "a live camera";
                return Err(SourceError::SwayOf { what });
            }
            return Self::cameras(live::look(way, settings)?, settings);
        }
        if let Some(path) = bag::path_of(&settings.source) {
            return Self::bag(&path, settings, (places, sway));
        }
        for (key, is_set) in [
            ("topics", !settings.topics.is_empty()),
            ("position_topic", settings.position_topic.is_some()),
        ] {
            if is_set {
                let source_name = settings.source.clone();
                return Err(SourceError::OfBags { key, source_name });
            }
        }
        match settings.source.strip_prefix("scene:") {
            Some(name) => Self::rendered(name, settings),
            None => Self::folders(Path::new(&settings.source), settings, (places, sway)),
        }
    }

    fn rendered(name: &str, settings: &Settings) -> Result<Self, SourceError> {
        let objects = Object::named(name);
        let Some(&first) = objects.first() else {
            let nearest = settings::nearest(name, Object::names());
            return Err(SourceError::UnknownScene {
                name: name.to_owned(),
                nearest,
            });
        };
        Rectifier::refuse(
            settings,
            "rendered scenes are rectified already; leave calibration away",
        )?;
        if settings.mode == Mode::Rail {
            return Self::rendered_rail(&objects, settings);
        }
        // A rail of five positions has no triple of its own: its first three are meant.
        let choice = Choice::among(&settings.views, first.positions(), None);
        let positions: Vec<f64> = (0..first.positions())
            .map(|position| position as f64)
            .collect();
        let step = choice.step(&settings.source, &positions)?;
        let views = choice.views.len();
        let calibrated = calibration(settings, first.camera(step), views, &[scene::SIZE])?;
        let scenes = objects
            .into_iter()
            .map(|object| Rendered::new(object, &choice.views))
            .collect();
        Ok(Self {
            kind: Kind::Rendered {
                scenes,
                sensor: Sensor::new(settings.noise, settings.seed),
            },
            rail: None,
            folder: None,
            scans: settings.scans.unwrap_or(RENDERED_SCANS),
            calibration: calibrated.camera,
            rectifier: None,
            notices: calibrated.notices,
            warnings: calibrated.warnings,
            bits: None,
        })
    }

    /// A camera that goes there and back along a rendered scene.
    fn rendered_rail(objects: &[Object], settings: &Settings) -> Result<Self, SourceError> {
        let &[object] = objects else {
            return Err(SourceError::OneScene {
                scene: settings.source.clone(),
                count: objects.len(),
            });
        };
        let last = object.positions() - 1;
        let order: Vec<usize> = (0..last).chain((1..=last).rev()).collect();
        let passed = Passed {
            own_steps: order.iter().map(|&position| position as f64).collect(),
            places: None,
            sway: Some(Vec::new()),
            order,
            is_described: true,
            in_metres: false,
            is_either_way: false,
        };
        // Its few positions leave no choice, and it is level.
        let settled = Settings {
            stride: settings.stride.or(Some(1)),
            drift: settings.drift.or(Some(0.0)),
            ..settings.clone()
        };
        let camera = |in_metres| unit_camera(settings, in_metres, object.camera(1.0), scene::SIZE);
        let rail = Rail::new(&settled, passed, scene::SIZE, camera, |_| Ok(Vec::new()))?;
        let positions: Vec<u32> = (0..=last as u32).collect();
        Ok(Self {
            kind: Kind::Rendered {
                scenes: vec![Rendered::new(object, &positions)],
                sensor: Sensor::new(settings.noise, settings.seed),
            },
            folder: None,
            scans: settings.scans.unwrap_or(RENDERED_SCANS),
            calibration: Some(rail.calibration),
            rectifier: None,
            notices: rail.notices.clone(),
            warnings: rail.warnings.clone(),
            rail: Some(rail),
            bits: None,
        })
    }

    #[cfg(feature = "node")]
    fn cameras(known: live::Known, settings: &Settings) -> Result<Self, SourceError> {
        let rectifier = Rectifier::open(settings, known.views.len(), &[known.size])?;
        let of_rectified = rectifier.as_ref().map(Rectifier::known).unwrap_or_default();
        let own = match known.rail {
            // What the settings say is from frame to frame, and wanted from one member of a triple to the next.
            Some(live) => Settings {
                baseline: Some(live.step_m * live.rail.stride as f64),
                ..settings.clone()
            },
            None => settings.clone(),
        };
        let views = known.views.len();
        let calibrated = calibration(&own, of_rectified, views, &[known.size])?;
        let (mut notices, mut warnings) = (known.notices.clone(), calibrated.warnings);
        notices.extend(calibrated.notices);
        if let Some(live) = known.rail {
            let step_m = live.step_m * live.rail.stride as f64;
            notices.push(rail::said_of_step(step_m));
            warnings.extend(plausible::baseline(step_m, plausible::Said::Rail).map(Doubt::why));
        }
        if let Some(rectifier) = &rectifier {
            rectifier.remark(&mut notices, &mut warnings);
        }
        Ok(Self {
            scans: settings.scans.unwrap_or(u64::MAX),
            calibration: calibrated.camera,
            notices,
            warnings,
            kind: Kind::Cameras(known),
            folder: None,
            rail: None,
            rectifier: None,
            bits: None,
        })
    }

    /// How images lie in a folder, of a source that is one.
    pub fn layout(&self) -> Option<Layout> {
        self.folder.as_ref().map(|(_, layout)| *layout)
    }

    /// The files of a scan's chosen views, left to right, as from the source's folder; of a rail its frame's.
    pub fn files(&self, scan: u64) -> Vec<String> {
        let (Kind::Folders { albums, .. }, Some((root, _))) = (&self.kind, &self.folder) else {
            return Vec::new();
        };
        let (scene, frame) = self.place(scan, 0);
        let shots = &albums[scene].shots;
        let shots = match self.rail {
            Some(_) => &shots[frame..=frame],
            None => &shots[..],
        };
        shots.iter().map(|shot| shot.file(root)).collect()
    }

    /// Whether it sends each frame once, when it likes: then it cannot be read, only run.
    pub fn is_cameras(&self) -> bool {
        match &self.kind {
            Kind::Rendered { .. } | Kind::Folders { .. } | Kind::Bag(_) => false,
            #[cfg(feature = "node")]
            Kind::Cameras(_) => true,
        }
    }

    fn bag(
        path: &Path,
        settings: &Settings,
        known: (&[f64], &[Sway]),
    ) -> Result<Self, SourceError> {
        let ways = [
            settings.position_topic.is_some(),
            settings.positions.is_some(),
            settings.speed.is_some(),
        ];
        if settings.mode == Mode::Rig && settings.position_topic.is_some() {
            return Err(SourceError::PositionOfRig);
        }
        if settings.mode == Mode::Rail && ways.into_iter().filter(|&way| way).count() > 1 {
            return Err(SourceError::PositionsTwice);
        }
        let (mut bag, cameras) = Bag::open(path, settings)?;
        let sizes = [bag.size];
        let is_told = settings.calibration.is_some() || settings.camera_info.is_some();
        let (rectifier, own) = match is_told {
            true => {
                bag.notices
                    .push("the bag's camera_info is not used: another is set".to_owned());
                (
                    Rectifier::open(settings, bag.views.len(), &sizes)?,
                    Known::default(),
                )
            }
            false => {
                bag.notices.extend(cameras.notices);
                bag.warnings.extend(cameras.warnings);
                (cameras.rectifier, cameras.known)
            }
        };
        if settings.raw && (rectifier.is_none() || !settings.rectify) {
            return Err(SourceError::NothingRectified);
        }
        let own = rectifier.as_ref().map_or(own, Rectifier::known);
        if let Some(rectifier) = rectifier.as_ref().filter(|_| is_told) {
            rectifier.remark(&mut bag.notices, &mut bag.warnings);
        }
        let rectifier = rectifier.filter(|_| settings.rectify);
        let rail = match settings.mode {
            Mode::Rig => None,
            Mode::Rail => Some(bag_rail(
                &mut bag,
                settings,
                own,
                rectifier.as_ref(),
                known,
            )?),
        };
        let calibrated = match &rail {
            Some(rail) => Calibrated {
                camera: Some(rail.calibration),
                has_baseline: true,
                notices: rail.notices.clone(),
                warnings: rail.warnings.clone(),
            },
            None => calibration(settings, own, bag.views.len(), &sizes)?,
        };
        let (mut notices, mut warnings) = (bag.notices.clone(), bag.warnings.clone());
        notices.extend(calibrated.notices);
        warnings.extend(calibrated.warnings);
        let scans = rail.as_ref().map_or(bag.len(), |rail| rail.order.len());
        Ok(Self {
            scans: settings.scans.unwrap_or(scans as u64),
            calibration: calibrated.camera,
            rectifier,
            folder: None,
            notices,
            warnings,
            rail,
            bits: bag.bits(),
            kind: Kind::Bag(Box::new(bag)),
        })
    }

    /// When a scan was taken, in nanoseconds after the first; `None` of a source without times of its own.
    pub fn nanos_after_start(&self, scan: u64) -> Option<u64> {
        let Kind::Bag(bag) = &self.kind else {
            return None;
        };
        let (count, last) = (self.scenes(), self.scenes().saturating_sub(1));
        let picture = |scan: u64| match &self.rail {
            Some(rail) => rail.frame(scan).0,
            None => scan as usize,
        };
        let first = bag.nanos(picture(0));
        let after = |scan: u64| bag.nanos(picture(scan)).saturating_sub(first);
        // Begun again, it goes on as it went.
        let again = match last {
            0 => 1_000_000_000,
            _ => after(last) + after(last) / last,
        };
        Some(
            (scan / count)
                .saturating_mul(again)
                .saturating_add(after(scan % count)),
        )
    }

    /// When the first scan was taken, in nanoseconds since 1970, where the source knows it.
    pub fn start(&self) -> Option<u64> {
        match &self.kind {
            Kind::Bag(bag) => bag.start,
            _ => None,
        }
    }

    /// What became of every image of a bag.
    pub fn account(&self) -> Option<&Synchronisation> {
        match &self.kind {
            Kind::Bag(bag) => Some(&bag.account),
            _ => None,
        }
    }

    /// The topics of a bag that are its views, left to right.
    pub fn topics(&self) -> Option<Vec<String>> {
        match &self.kind {
            Kind::Bag(bag) => Some(bag.views.iter().map(|view| view.topic.clone()).collect()),
            _ => None,
        }
    }

    /// What cannot be read of a source that is damaged.
    pub fn damage(&self) -> Option<&str> {
        match &self.kind {
            Kind::Bag(bag) => bag.damage.as_deref(),
            _ => None,
        }
    }

    fn folders(
        path: &Path,
        settings: &Settings,
        known: (&[f64], &[Sway]),
    ) -> Result<Self, SourceError> {
        folder::check(path, settings::nearest(&settings.source, Object::names()))?;
        if settings.layout == Some(Layout::Rail) && settings.mode == Mode::Rig {
            return Err(SourceError::RailLayout);
        }
        let found = folder::open(path, &settings.views, settings.mode, settings.layout)?;
        if settings.mode == Mode::Rail {
            return Self::folder_rail(path, found, settings, known);
        }
        let Found {
            albums,
            layout,
            notices: found,
            warnings: doubted,
        } = found;
        let sizes: Vec<Size> = albums.iter().map(|album| album.size).collect();
        let rectifier = Rectifier::open(settings, albums[0].shots.len(), &sizes)?;
        let own = rectifier.as_ref().map(Rectifier::known);
        let views = albums[0].shots.len();
        let calibrated = calibration(settings, own.unwrap_or_default(), views, &sizes)?;
        let levels = levels_of(&albums, settings)?;
        let (mut notices, mut warnings) = (notices(&albums, &levels.notices), calibrated.warnings);
        notices.extend(calibrated.notices);
        notices.extend(found);
        warnings.extend(doubted);
        if let Some(rectifier) = &rectifier {
            rectifier.remark(&mut notices, &mut warnings);
        }
        let mut kept = Kept::new(levels.levels);
        for view in 0..albums[0].shots.len() {
            kept.pixels(&albums, 0, view, None)?;
        }
        warnings.extend(kept.doubt.take());
        Ok(Self {
            rail: None,
            scans: settings.scans.unwrap_or(albums.len() as u64),
            calibration: calibrated.camera,
            rectifier: rectifier.filter(|_| settings.rectify),
            notices,
            warnings,
            bits: levels.bits,
            kind: Kind::Folders { albums, kept },
            folder: Some((path.to_owned(), layout)),
        })
    }

    /// The images of a folder as the frames of one camera.
    fn folder_rail(
        path: &Path,
        found: Found,
        settings: &Settings,
        (places, sway): (&[f64], &[Sway]),
    ) -> Result<Self, SourceError> {
        let Found { albums, layout, .. } = found;
        let [album] = &albums[..] else {
            return Err(SourceError::OneScene {
                scene: settings.source.clone(),
                count: albums.len(),
            });
        };
        let own_steps = album.shots.iter().map(|shot| shot.position);
        let passed = Passed {
            order: (0..album.shots.len()).collect(),
            own_steps: own_steps.collect(),
            places: match places.len() == album.shots.len() {
                true => Some(places.to_vec()),
                false => None,
            },
            sway: (sway.len() == album.shots.len()).then(|| sway.to_vec()),
            is_described: album.is_described,
            in_metres: false,
            is_either_way: false,
        };
        let size = album.size;
        let read = found.warnings;
        let rectifier = Rectifier::open(settings, 1, &[size])?;
        let own = rectifier.as_ref().map(Rectifier::known);
        let camera = |in_metres| unit_camera(settings, in_metres, own.unwrap_or_default(), size);
        let levels = levels_of(&albums, settings)?;
        let (mut notices, mut warnings) = (notices(&albums, &levels.notices), read);
        if let Some(rectifier) = &rectifier {
            rectifier.remark(&mut notices, &mut warnings);
        }
        let rectifier = rectifier.filter(|_| settings.rectify);
        let mut kept = Kept::new(levels.levels);
        let pixels = |frame| {
            let taken = kept.pixels(&albums, 0, frame, None)?;
            let mut pixels = vec![0; taken.len()];
            show(rectifier.as_ref(), 0, taken, &mut pixels);
            Ok(pixels)
        };
        let rail = Rail::new(settings, passed, size, camera, pixels)?;
        notices.extend_from_slice(&rail.notices);
        warnings.extend_from_slice(&rail.warnings);
        warnings.extend(kept.doubt.take());
        Ok(Self {
            scans: settings.scans.unwrap_or(rail.order.len() as u64),
            calibration: Some(rail.calibration),
            rectifier,
            notices,
            warnings,
            bits: levels.bits,
            rail: Some(rail),
            kind: Kind::Folders { albums, kept },
            folder: Some((path.to_owned(), layout)),
        })
    }

    /// The rail, when it is one camera that moves.
    pub fn rail(&self) -> Option<messages::Rail> {
        match &self.kind {
            #[cfg(feature = "node")]
            Kind::Cameras(known) => known.rail.map(|live| live.rail),
            _ => self.rail.as_ref().map(|rail| rail.rail),
        }
    }

    /// Where the camera of a rail stood when it took a frame, in metres.
    pub fn position_m(&self, scan: u64) -> Option<f64> {
        Some(self.rail.as_ref()?.frame(scan).1)
    }

    /// By how much a scan is off, of a rail that sways.
    pub fn sway(&self, scan: u64) -> Sway {
        let rail = self.rail.as_ref();
        rail.map_or(Sway::NONE, |rail| rail.sway(scan))
    }

    /// By how much each of a rail's frames is off, where all of them were looked at.
    pub fn sways(&self) -> Option<&[Sway]> {
        self.rail.as_ref()?.sway.as_deref()
    }

    /// Where a rail's frames were taken, in the source's own steps, where only looking at all of them told.
    pub fn places(&self) -> Option<&[f64]> {
        self.rail.as_ref()?.places.as_deref()
    }

    /// What nearly all disparities of a rail lie between, in pixels a baseline, where its pictures were looked at.
    pub fn disparities(&self) -> Option<(f32, f32)> {
        self.rail.as_ref()?.disparities
    }

    /// Which scene and which of its chosen views a view of a scan shows.
    fn place(&self, scan: u64, view: usize) -> (usize, usize) {
        match (&self.rail, &self.kind) {
            (Some(rail), _) => (0, rail.frame(scan).0),
            (None, Kind::Rendered { scenes, .. }) => (turn(scan, scenes), view),
            (None, Kind::Folders { albums, .. }) => (turn(scan, albums), view),
            (None, Kind::Bag(bag)) => ((scan % bag.len() as u64) as usize, view),
            #[cfg(feature = "node")]
            (None, Kind::Cameras(_)) => (0, view),
        }
    }

    /// How many scans there are; a source that holds fewer begins again.
    pub fn scans(&self) -> u64 {
        self.scans
    }

    /// How many views each scan has.
    pub fn view_count(&self) -> usize {
        match self.rail {
            Some(_) => 1,
            None => self.views(0).len(),
        }
    }

    /// The chosen views of a scan, left to right; of a rail all its frames.
    pub fn views(&self, scan: u64) -> Vec<Place> {
        let (scene, _) = self.place(scan, 0);
        match &self.kind {
            Kind::Rendered { scenes, .. } => scenes[scene]
                .positions
                .iter()
                .map(|&position| Place {
                    name: format!("position {position}"),
                    number: position,
                    position_steps: position.into(),
                })
                .collect(),
            Kind::Folders { albums, .. } => {
                let Album { shots, choice, .. } = &albums[scene];
                let different: BTreeSet<String> = shots.iter().map(Shot::name).collect();
                let root = self.folder.as_ref().map(|(root, _)| root.as_path());
                // Where each camera has a folder its files may have the names of the others'.
                let root = root.filter(|_| different.len() < shots.len());
                shots
                    .iter()
                    .zip(&choice.views)
                    .map(|(shot, &number)| Place {
                        name: root.map_or_else(|| shot.name(), |root| shot.file(root)),
                        number,
                        position_steps: shot.position,
                    })
                    .collect()
            }
            Kind::Bag(bag) => bag
                .views
                .iter()
                .map(|view| Place {
                    name: view.topic.clone(),
                    number: view.number,
                    position_steps: view.number.into(),
                })
                .collect(),
            #[cfg(feature = "node")]
            Kind::Cameras(known) => known
                .views
                .iter()
                .zip(0..)
                .map(|((_, camera), number)| Place {
                    name: camera.clone(),
                    number,
                    position_steps: number.into(),
                })
                .collect(),
        }
    }

    /// A name for what a scan shows: the rendered object's, or its folder's; of a rail the frame's.
    pub fn name(&self, scan: u64) -> String {
        let (scene, frame) = self.place(scan, 0);
        match (&self.kind, &self.rail) {
            (Kind::Rendered { scenes, .. }, None) => scenes[scene].object.name().to_owned(),
            (Kind::Rendered { scenes, .. }, Some(_)) => {
                format!("{} from position {frame}", scenes[scene].object.name())
            }
            #[cfg(feature = "node")]
            (Kind::Cameras(_), _) => "cameras".to_owned(),
            (Kind::Bag(bag), _) => {
                let nanos = bag.nanos(if self.rail.is_some() { frame } else { scene });
                format!("{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000)
            }
            (Kind::Folders { albums, .. }, None) => albums[scene].name.clone(),
            (Kind::Folders { albums, .. }, Some(_)) => {
                folder::name(&albums[scene].shots[frame].path)
            }
        }
    }

    /// The size of a scan's images.
    pub fn size_of(&self, scan: u64) -> Size {
        match &self.kind {
            Kind::Rendered { .. } => scene::SIZE,
            Kind::Folders { albums, .. } => albums[self.place(scan, 0).0].size,
            Kind::Bag(bag) => bag.size,
            #[cfg(feature = "node")]
            Kind::Cameras(known) => known.size,
        }
    }

    /// The size that holds the images of every scan.
    pub fn size(&self) -> Size {
        match &self.kind {
            Kind::Rendered { .. } => scene::SIZE,
            Kind::Folders { albums, .. } => albums
                .iter()
                .fold(Size::default(), |size, album| size.union(album.size)),
            Kind::Bag(bag) => bag.size,
            #[cfg(feature = "node")]
            Kind::Cameras(known) => known.size,
        }
    }

    /// The calibration, when anything is known: a rendered scene knows its own, settings and the `camera_info` file
    /// come before it. Its baseline is the distance between neighbouring chosen views.
    pub fn calibration(&self) -> Option<Calibration> {
        self.calibration
    }

    /// What the user should be told once: conversions, chosen views, ignored files.
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// What makes results less than they could be: a missing calibration.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Bits in use of images that are filed in 16, by which they are scaled to 8; `None` where there are none. Settings
    /// that say so make whoever opens the source again take the same.
    pub fn bits(&self) -> Option<u8> {
        self.bits
    }

    /// What is to be said of the images that were read since: once a source, of one that holds more than what is in use.
    pub fn take_doubt(&mut self) -> Option<String> {
        match &mut self.kind {
            Kind::Folders { kept, .. } => kept.doubt.take(),
            _ => None,
        }
    }

    /// Writes a chosen view of a scan into the room, 8-bit gray row by row, and says its size. The same scan and view
    /// always give the same bytes.
    ///
    /// # Errors
    /// An image that cannot be decoded, or that is no longer of the size it had when the source was opened.
    ///
    /// # Panics
    /// When there is no such view.
    pub fn read(
        &mut self,
        scan: u64,
        view: usize,
        out: &mut ImageRoom<'_>,
    ) -> Result<Size, SourceError> {
        out.clear();
        let (shown, shot) = self.place(scan, view);
        let is_rail = self.rail.is_some();
        match &mut self.kind {
            Kind::Bag(bag) => {
                let size = bag.size;
                let taken = bag_pixels(bag, is_rail, shown, shot)?;
                let out = out.pixels.grow(taken.len());
                show(self.rectifier.as_ref(), view, taken, out);
                Ok(size)
            }
            Kind::Rendered { scenes, sensor } => {
                let scene = &scenes[shown];
                let position = scene.positions[shot];
                let room = out.pixels.grow(scene::SIZE.pixels());
                sensor.expose(
                    scene.picture(shot),
                    scene::SIZE.width as usize,
                    scan,
                    position.into(),
                    room,
                );
                Ok(scene::SIZE)
            }
            Kind::Folders { albums, kept } => {
                let taken = kept.pixels(albums, shown, shot, Some(scan))?;
                let out = out.pixels.grow(taken.len());
                show(self.rectifier.as_ref(), view, taken, out);
                Ok(albums[shown].size)
            }
            #[cfg(feature = "node")]
            Kind::Cameras(_) => Err(SourceError::SentOnce),
        }
    }

    /// Writes a chosen view of a scan into the room as its camera took it, where [`read`](Self::read) rectifies it.
    ///
    /// # Errors
    /// As [`read`](Self::read); and of a source whose views are not rectified.
    ///
    /// # Panics
    /// When there is no such view.
    pub fn read_raw(
        &mut self,
        scan: u64,
        view: usize,
        out: &mut RawRoom<'_>,
    ) -> Result<Size, SourceError> {
        out.clear();
        let (shown, shot) = self.place(scan, view);
        let is_rail = self.rail.is_some();
        match &mut self.kind {
            Kind::Bag(bag) if self.rectifier.is_some() => {
                let size = bag.size;
                let taken = bag_pixels(bag, is_rail, shown, shot)?;
                out.pixels.extend_from_slice(taken);
                Ok(size)
            }
            Kind::Folders { albums, kept } if self.rectifier.is_some() => {
                let taken = kept.pixels(albums, shown, shot, Some(scan))?;
                out.pixels.extend_from_slice(taken);
                Ok(albums[shown].size)
            }
            Kind::Rendered { .. } | Kind::Folders { .. } | Kind::Bag(_) => {
                Err(SourceError::NothingRectified)
            }
            #[cfg(feature = "node")]
            Kind::Cameras(_) => Err(SourceError::SentOnce),
        }
    }

    /// The true disparities of a chosen view of a scan, per step between neighbouring chosen views, when they are
    /// known: exact for rendered scenes, for folders what `scene.json` names.
    ///
    /// # Errors
    /// A ground truth file that cannot be read or does not fit.
    ///
    /// # Panics
    /// When there is no such view.
    pub fn truth(&self, scan: u64, view: usize) -> Result<Option<Truth>, SourceError> {
        let (scene, view) = self.place(scan, view);
        let mut truth = match &self.kind {
            Kind::Rendered { scenes, .. } => Some(scenes[scene].truth(view)),
            // What is filed is of the images as they were taken.
            Kind::Folders { .. } if self.rectifier.is_some() => None,
            Kind::Folders { albums, .. } => filed_truth(&albums[scene], view)?,
            Kind::Bag(_) => None,
            #[cfg(feature = "node")]
            Kind::Cameras(_) => None,
        };
        // Of a rail it is known for a step, and wanted for a baseline.
        if let (Some(rail), Some(truth)) = (&self.rail, &mut truth) {
            let steps = rail.own_steps as f32;
            truth.disparity.iter_mut().for_each(|value| *value *= steps);
        }
        Ok(truth)
    }
}

impl Source {
    /// How many different scenes there are: scan n shows scene n modulo this.
    pub fn scenes(&self) -> u64 {
        if let Some(rail) = &self.rail {
            return rail.order.len() as u64;
        }
        match &self.kind {
            Kind::Rendered { scenes, .. } => scenes.len() as u64,
            Kind::Folders { albums, .. } => albums.len() as u64,
            Kind::Bag(bag) => bag.len() as u64,
            #[cfg(feature = "node")]
            Kind::Cameras(_) => 1,
        }
    }

    /// The true contours of a chosen view of a scan, of the thesis's photographs.
    ///
    /// # Panics
    /// When there is no such view.
    pub fn contours(&self, scan: u64, view: usize) -> Option<Vec<Contour>> {
        let (scene, view) = self.place(scan, view);
        match (&self.kind, &self.rail) {
            (Kind::Rendered { scenes, .. }, None) => scenes[scene].contours(view),
            _ => None,
        }
    }

    /// Whether the true disparities of a chosen view are known in some scan.
    pub fn knows_truth(&self, view: usize) -> bool {
        match &self.kind {
            Kind::Rendered { .. } => true,
            Kind::Folders { .. } if self.rectifier.is_some() => false,
            Kind::Folders { albums, .. } if self.rail.is_some() => {
                let shots = albums.iter().flat_map(|album| &album.shots);
                shots.into_iter().any(|shot| shot.truth.is_some())
            }
            Kind::Folders { albums, .. } => {
                let knows =
                    |album: &Album| album.shots.get(view).is_some_and(|s| s.truth.is_some());
                albums.iter().any(knows)
            }
            Kind::Bag(_) => false,
            #[cfg(feature = "node")]
            Kind::Cameras(_) => false,
        }
    }
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Source")
            .field("scans", &self.scans)
            .field("size", &self.size())
            .field("calibration", &self.calibration)
            .finish_non_exhaustive()
    }
}

/// The rail that a bag's camera moved along.
fn bag_rail(
    bag: &mut Bag,
    settings: &Settings,
    own: Known,
    rectifier: Option<&Rectifier>,
    (places, sway): (&[f64], &[Sway]),
) -> Result<Rail, SourceError> {
    let (size, first) = (bag.size, bag.nanos(0));
    let seconds = |frame: usize| (bag.nanos(frame) - first) as f64 / 1e9;
    let (order, metres) = match (&bag.along, settings.speed) {
        (Some((kept, metres)), _) => (kept.clone(), Some(metres.clone())),
        (None, speed) => {
            let all: Vec<usize> = (0..bag.len()).collect();
            let metres = speed.map(|speed| all.iter().map(|&at| speed * seconds(at)).collect());
            (all, metres)
        }
    };
    let frames = order.len();
    if frames < 3 {
        return Err(SourceError::TooFewViews {
            path: settings.source.clone().into(),
            found: frames,
        });
    }
    let is_described = metres.is_some();
    let passed = Passed {
        own_steps: metres.unwrap_or_else(|| (0..frames).map(|at| at as f64).collect()),
        order,
        places: (places.len() == frames).then(|| places.to_vec()),
        sway: (sway.len() == frames).then(|| sway.to_vec()),
        is_described,
        in_metres: is_described,
        is_either_way: bag.along.is_some(),
    };
    // The speed is in the places already.
    let settled = Settings {
        speed: None,
        ..settings.clone()
    };
    let camera = |in_metres| unit_camera(settings, in_metres, own, size);
    Rail::new(&settled, passed, size, camera, |frame| {
        let taken = bag.pixels(frame, 0)?;
        let mut pixels = vec![0; taken.len()];
        show(rectifier, 0, taken, &mut pixels);
        Ok(pixels)
    })
}

/// The gray levels of what a place names: of a rail a frame, else a view of a scan.
fn bag_pixels(
    bag: &mut Bag,
    is_rail: bool,
    shown: usize,
    shot: usize,
) -> Result<&[u8], SourceError> {
    match is_rail {
        true => bag.pixels(shot, 0),
        false => bag.pixels(shown, shot),
    }
}

/// Which of the source's scenes a scan shows: they take turns.
fn turn<T>(scan: u64, scenes: &[T]) -> usize {
    (scan % scenes.len() as u64) as usize
}

/// The calibration, and what is to be said of it.
#[derive(Debug, Default)]
struct Calibrated {
    camera: Option<Calibration>,
    /// Whether how far apart views are taken is known.
    has_baseline: bool,
    notices: Vec<String>,
    warnings: Vec<String>,
}

/// The calibration of so many views of these sizes, and what is missing: single settings count before the file, the file
/// before what the source knows. Of one view how far it moves is looked at elsewhere.
fn calibration(
    settings: &Settings,
    own: Known,
    views: usize,
    sizes: &[Size],
) -> Result<Calibrated, SourceError> {
    let filed = match &settings.camera_info {
        Some(files) => camera_info::read(files, views, sizes, settings.baseline.is_some())?,
        None => camera_info::Read {
            known: own,
            ..camera_info::Read::default()
        },
    };
    let (mut notices, mut warnings) = (filed.notices, Vec::new());
    let known = Known::or(settings, filed.known);
    let size = sizes
        .iter()
        .fold(Size::default(), |most, &size| most.union(size));
    let taken = known
        .calibration(size)
        .unwrap_or(Calibration::assumed(size));
    let (focal, baseline) = (taken.focal_px, taken.baseline_m);
    let unknown = match (known.focal_px, known.baseline_m) {
        (Some(_), Some(_)) => None,
        (None, Some(_)) => Some(format!(
            "the focal length is unknown, {focal} px are assumed; set capture.focal"
        )),
        (Some(_), None) => Some(format!(
            "the baseline is unknown, {baseline} m are assumed; set capture.baseline"
        )),
        (None, None) => Some(format!(
            "no calibration, {focal} px and {baseline} m are assumed; set capture.focal and capture.baseline, capture.camera_info or capture.calibration"
        )),
    };
    let unknown = unknown.map(|why| format!("depths are in arbitrary units: {why}"));
    warnings.extend(unknown);
    // ROS keeps the raw camera's distortion beside the rectified images' projection.
    if known.is_distorted {
        warnings.push(
            "the camera_info is of a lens that distorts: the images must be rectified, as image_rect topics are"
                .to_owned(),
        );
    }
    warnings.extend(filed.warnings);
    if let Some(focal_px) = settings.focal {
        match plausible::focal(focal_px, size, "capture.focal") {
            Some(Doubt::Refused(why)) => return Err(SourceError::Implausible(why)),
            Some(Doubt::Told(why)) => warnings.push(why),
            None => {}
        }
    }
    if settings.cx.or(settings.cy).is_some() {
        let what = "the principal point (capture.cx, capture.cy)";
        warnings.extend(plausible::centre([taken.cx, taken.cy], size, what).map(Doubt::why));
    }
    if known.focal_px.is_some() && known.cx.and(known.cy).is_none() {
        let (cx, cy) = (taken.cx, taken.cy);
        notices.push(match (known.cx, known.cy) {
            (Some(_), None) => format!(
                "capture.cy is not said: the middle of the picture is taken, {cy}"
            ),
            (None, Some(_)) => format!(
                "capture.cx is not said: the middle of the picture is taken, {cx}"
            ),
            _ => format!(
                "the principal point is not said: the middle of the picture is taken, {cx}, {cy}; set capture.cx and capture.cy"
            ),
        });
    }
    let is_filed = settings.camera_info.is_some() || settings.calibration.is_some();
    let is_said = settings.baseline.is_some() || (is_filed && filed.known.baseline_m.is_some());
    if views > 1 && is_said {
        let of_file = filed.known.baseline_m.filter(|_| is_filed);
        notices.push(said_of_baseline(baseline, views));
        warnings.extend(
            settings
                .baseline
                .and_then(|set_m| doubt_of(set_m, of_file, views)),
        );
        warnings.extend(settings.baseline.and_then(|set_m| {
            plausible::baseline(set_m, plausible::Said::Setting).map(Doubt::why)
        }));
    }
    Ok(Calibrated {
        camera: known.calibration(size),
        has_baseline: known.baseline_m.is_some(),
        notices,
        warnings,
    })
}

/// How far apart the views of a rig are taken: from one to the next, and from the first to the last, which people give
/// instead.
fn said_of_baseline(baseline_m: f64, views: usize) -> String {
    format!(
        "baseline {} from view to view, {} from the first to the last of {views}",
        metres(baseline_m),
        metres(baseline_m * (views - 1) as f64)
    )
}

/// What is to be said where a baseline is set and files have another.
fn doubt_of(set_m: f64, filed_m: Option<f64>, views: usize) -> Option<String> {
    let is_near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.02;
    let filed_m = filed_m.filter(|&filed_m| !is_near(set_m, filed_m))?;
    let hint = match is_near(set_m, filed_m * (views - 1) as f64) {
        true => ": what is set is that from the first to the last; leave it away",
        false => "",
    };
    Some(format!(
        "capture.baseline, {} from view to view, counts before the {} of the files{hint}",
        metres(set_m),
        metres(filed_m)
    ))
}

/// The calibration for a baseline of one unit of position along a rail, and what is missing.
fn unit_camera(
    settings: &Settings,
    in_metres: bool,
    own: Known,
    size: Size,
) -> Result<Unit, SourceError> {
    let unused = settings.baseline.filter(|_| in_metres);
    let settings = Settings {
        baseline: if in_metres {
            Some(1.0)
        } else {
            settings.baseline
        },
        ..settings.clone()
    };
    let mut calibrated = calibration(&settings, own, 1, &[size])?;
    if let Some(unused) = unused {
        calibrated.warnings.push(format!(
            "positions are in metres, so baseline, set to {unused} m, says nothing; leave it away"
        ));
    }
    Ok(Unit {
        camera: calibrated.camera.unwrap_or(Calibration::assumed(size)),
        is_known: calibrated.has_baseline,
        notices: calibrated.notices,
        warnings: calibrated.warnings,
    })
}

/// What is to be said once about folders of images.
fn notices(albums: &[Album], of_levels: &[String]) -> Vec<String> {
    let mut notices = Vec::new();
    for why in [Why::FirstTriple, Why::FirstThree] {
        let chosen: Vec<&Album> = albums
            .iter()
            .filter(|album| album.choice.why == why)
            .collect();
        let Some(first) = chosen.first() else {
            continue;
        };
        let (reason, rather) = match why {
            Why::FirstTriple => ("the first triple that scene.json lists", ""),
            // Whoever forgot it sees three frames matched, and nothing amiss.
            _ => (
                "the first three of more",
                "; if they are frames of one camera that moves, --layout rail",
            ),
        };
        let differ = chosen
            .iter()
            .any(|album| album.choice.views != first.choice.views);
        let views: Vec<String> = first.choice.views.iter().map(u32::to_string).collect();
        notices.push(match (differ, albums.len()) {
            (true, _) => {
                format!("of each scene, {reason} is taken; choose others with --views{rather}")
            }
            (false, 1) => format!(
                "views {} are taken, {reason}; choose others with --views{rather}",
                views.join(",")
            ),
            (false, _) => format!(
                "views {} of each scene are taken, {reason}; choose others with --views{rather}",
                views.join(",")
            ),
        });
    }
    if albums.iter().any(|album| album.is_colour) {
        notices.push("colour images are converted to gray".to_owned());
    }
    notices.extend_from_slice(of_levels);
    match albums.iter().map(|album| album.others).sum() {
        0 => {}
        1 => notices.push("one file of another type is ignored".to_owned()),
        others => notices.push(format!("{others} files of other types are ignored")),
    }
    notices
}

/// What is used of the gray levels of these folders' images.
fn levels_of(albums: &[Album], settings: &Settings) -> Result<levels::Found, SourceError> {
    let asked = settings.bits.and_then(|bits| u8::try_from(bits).ok());
    let shots = albums.iter().flat_map(|album| &album.shots);
    let files: Vec<&Path> = match asked.is_some() || albums.iter().any(|album| album.is_deep) {
        true => shots.map(|shot| shot.path.as_path()).collect(),
        false => Vec::new(),
    };
    let first_scan = match settings.mode {
        Mode::Rig => albums[0].shots.len(),
        Mode::Rail => 1,
    };
    levels::found(&files, first_scan, asked)
}

/// The truth that is filed for a view.
fn filed_truth(album: &Album, view: usize) -> Result<Option<Truth>, SourceError> {
    let Some(file) = &album.shots[view].truth else {
        return Ok(None);
    };
    let (size, mut disparity) = file.read()?;
    if size != album.size {
        return Err(SourceError::GroundTruth {
            path: file.path.clone(),
            why: format!("it is {size} pixels and its view is {}", album.size),
        });
    }
    let step = album.step as f32;
    disparity.iter_mut().for_each(|value| *value *= step);
    let views = album.shots.len();
    Ok(Some(Truth::from_disparity(size, disparity, view, views)))
}

/// Decoded images, so that reading one again costs a copy; those unused for longest make room for others.
struct Kept {
    levels: Levels,
    /// By scene and view.
    images: BTreeMap<(usize, usize), Image>,
    bytes: usize,
    reads: u64,
    /// What is to be said of the first image that goes beyond white.
    doubt: Option<String>,
    has_doubted: bool,
}

struct Image {
    pixels: Vec<u8>,
    last_read: u64,
}

impl Kept {
    /// The most bytes kept: some hundred images of a megapixel.
    const MOST: usize = 256 << 20;

    fn new(levels: Levels) -> Self {
        Self {
            levels,
            images: BTreeMap::new(),
            bytes: 0,
            reads: 0,
            doubt: None,
            has_doubted: false,
        }
    }

    /// The pixels of a view; `scan` is named when they cannot be had.
    fn pixels(
        &mut self,
        albums: &[Album],
        album: usize,
        view: usize,
        scan: Option<u64>,
    ) -> Result<&[u8], SourceError> {
        let key = (album, view);
        if !self.images.contains_key(&key) {
            let Shot { path, part, .. } = &albums[album].shots[view];
            let (mut size, gray) = image_file::pixels(path, &self.levels, scan)?;
            if let Some(beyond) = gray.beyond.filter(|_| !self.has_doubted) {
                self.has_doubted = true;
                self.doubt = Some(self.levels.doubt(path, scan, beyond));
            }
            let mut pixels = gray.pixels;
            let expected = albums[album].size;
            if let Some(part) = part {
                pixels = part.of(size, &pixels);
                size = part.size(path, size)?;
            }
            if size != expected {
                return Err(SourceError::Changed {
                    path: path.clone(),
                    scan: scan.unwrap_or_default(),
                    size,
                    expected,
                });
            }
            self.make_room(pixels.len());
            self.bytes += pixels.len();
            self.images.insert(
                key,
                Image {
                    pixels,
                    last_read: 0,
                },
            );
        }
        self.reads += 1;
        let reads = self.reads;
        let image = self.images.get_mut(&key).map(|image| {
            image.last_read = reads;
            &*image.pixels
        });
        Ok(image.unwrap_or_default())
    }

    /// Forgets images until so many bytes more are no more than allowed.
    fn make_room(&mut self, bytes: usize) {
        while self.bytes + bytes > Self::MOST {
            let oldest = self
                .images
                .iter()
                .min_by_key(|(_, image)| image.last_read)
                .map(|(&key, _)| key);
            let Some(image) = oldest.and_then(|key| self.images.remove(&key)) else {
                break;
            };
            self.bytes -= image.pixels.len();
        }
    }
}
