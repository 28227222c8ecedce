//! Cameras: sources that send frames when they like, each from a thread of its own.
//!
//! ```text
//! camera ─► gray ─► feed (bounded) ─┐
//! camera ─► gray ─► feed ───────────┼─► Synchroniser ─► door ─► images
//! camera ─► gray ─► feed ───────────┘                    └────► kept while under way, to be sent again
//! ```

mod bus;
mod feed;
mod glance;
mod gray;
#[cfg(feature = "gstreamer")]
mod gstreamer;
mod kept;
pub(crate) mod node;
#[cfg(feature = "v4l")]
mod v4l;

use std::time::{Duration, Instant};

use messages::{Rail, Rig, Size};

use crate::error::{LEAST_SIDE, MOST_PIXELS, SourceError};
use crate::settings::{Mode, Settings};
use feed::{Camera, Next, Open};

/// How long a camera may take to send its first frame.
const FIRST: Duration = Duration::from_secs(15);

/// The ways to cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// A GStreamer pipeline each.
    GStreamer,
    /// A Video4Linux device each.
    V4l,
    /// Another program that publishes them.
    Bus,
}

impl Way {
    /// The way that a source names, if it is one to cameras.
    ///
    /// # Errors
    /// When it is one that nobody knows.
    pub(crate) fn of(source: &str) -> Result<Option<Self>, SourceError> {
        match source.strip_prefix("camera:") {
            None => Ok(None),
            Some("gstreamer") => Ok(Some(Self::GStreamer)),
            Some("v4l") => Ok(Some(Self::V4l)),
            Some("bus") => Ok(Some(Self::Bus)),
            Some(way) => Err(SourceError::UnknownWay {
                way: way.to_owned(),
            }),
        }
    }
}

/// What is known of cameras before they run.
#[derive(Clone, Debug)]
pub(crate) struct Known {
    /// The size of every frame.
    pub(crate) size: Size,
    /// The views, left to right, and what each is seen by.
    pub(crate) views: Vec<(String, String)>,
    /// Where it is one that moves.
    pub(crate) rail: Option<LiveRail>,
    pub(crate) notices: Vec<String>,
}

/// A camera that moves along a rail while it is matched: nothing can be looked at beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LiveRail {
    pub(crate) rail: Rail,
    /// From frame to frame, in metres.
    pub(crate) step_m: f64,
}

impl LiveRail {
    fn new(
        way: Way,
        settings: &Settings,
        notices: &mut Vec<String>,
    ) -> Result<Option<Self>, SourceError> {
        if settings.mode != Mode::Rail {
            return Ok(None);
        }
        if settings.positions.is_some() {
            return Err(SourceError::PositionsOfCamera);
        }
        if way != Way::Bus && settings.speed.is_none() {
            return Err(SourceError::NoPositions);
        }
        let by_speed = settings.speed.map(|speed| speed.abs() / settings.rate);
        let step_m = settings.baseline.or(by_speed).filter(|step| *step > 0.0);
        let step_m = step_m.ok_or(SourceError::NoStep)?;
        if settings.baseline.is_none() {
            notices.push(format!(
                "at this speed and rate the camera moves {step_m} m from frame to frame; capture.baseline says another"
            ));
        }
        let stride = settings.stride.unwrap_or(1);
        if settings.stride.is_none() {
            notices.push(
                "frames that follow each other are matched; capture.stride chooses others"
                    .to_owned(),
            );
        }
        let rail = Rail {
            stride,
            drift_px: settings.drift.unwrap_or_default(),
            follow: 0,
        };
        Ok(Some(Self { rail, step_m }))
    }
}

/// Opens every camera for its first frame, and closes it.
pub(crate) fn look(way: Way, settings: &Settings) -> Result<Known, SourceError> {
    if settings.truth.is_some() {
        return Err(SourceError::NoTruth);
    }
    let cameras = cameras_of(way, settings)?;
    let mut notices = Vec::new();
    let rail = LiveRail::new(way, settings, &mut notices)?;
    let rig = match rail {
        Some(live) => Rig::of_rail(live.rail, &[], Size::default()),
        None => Rig::of_views(cameras.len(), &[], Size::default()),
    };
    let names = rig.views.into_iter().map(|view| view.name);
    let views: Vec<(String, String)> = names.zip(cameras).collect();
    if way == Way::Bus {
        let (Some(width), Some(height)) = (settings.width, settings.height) else {
            return Err(SourceError::NoSize);
        };
        let size = checked(Size::new(width, height), "capture.width and capture.height")?;
        return Ok(Known {
            size,
            views,
            rail,
            notices,
        });
    }
    let mut first: Option<(Size, &str)> = None;
    for (name, camera) in &views {
        let wrong = |why: String| SourceError::Camera {
            name: name.clone(),
            camera: camera.clone(),
            why,
        };
        let mut camera = opener(way, camera, settings, false)?().map_err(wrong)?;
        let size = first_size(camera.as_mut()).map_err(wrong)?;
        checked(size, &format!("what {name} sends"))?;
        notices.extend(camera.notice().map(|notice| format!("{name}: {notice}")));
        match first {
            None => first = Some((size, name)),
            Some((expected, first)) if expected != size => {
                let why = format!(
                    "its frames are {size} pixels and those of {first} are {expected}: all cameras must send one size"
                );
                return Err(wrong(why));
            }
            Some(_) => {}
        }
    }
    let (size, _) = first.unwrap_or_default();
    Ok(Known {
        size,
        views,
        rail,
        notices,
    })
}

/// What each view is seen by, left to right.
fn cameras_of(way: Way, settings: &Settings) -> Result<Vec<String>, SourceError> {
    let cameras = settings.cameras.clone();
    let is_rail = settings.mode == Mode::Rail;
    if is_rail && cameras.len() > 1 {
        let count = cameras.len();
        return Err(SourceError::OneCamera { count });
    }
    match (way, cameras.is_empty()) {
        (Way::Bus, true) => {
            let count = if is_rail { 1 } else { 3 };
            Ok(vec!["another program".to_owned(); count])
        }
        (Way::GStreamer | Way::V4l, true) => Err(SourceError::NoCameras {
            source_name: settings.source.clone(),
            each: match way {
                Way::V4l => "a device like /dev/video0",
                _ => "a pipeline like \"v4l2src device=/dev/video0\"",
            },
        }),
        (_, false) => Ok(cameras),
    }
}

fn checked(size: Size, what: &str) -> Result<Size, SourceError> {
    let is_small = size.width < LEAST_SIDE || size.height < LEAST_SIDE;
    let is_large = u64::from(size.width) * u64::from(size.height) > MOST_PIXELS;
    match is_small || is_large {
        false => Ok(size),
        true => Err(SourceError::CameraSize {
            what: what.to_owned(),
            size,
        }),
    }
}

/// The size of a camera's first frame.
fn first_size(camera: &mut dyn Camera) -> Result<Size, String> {
    let since = Instant::now();
    let mut size = None;
    while since.elapsed() < FIRST {
        let next = camera.next(&mut |picture| size = Some(picture.size))?;
        match (size, next) {
            (Some(size), _) => return Ok(size),
            (None, Next::End) => return Err("it ended before its first frame".to_owned()),
            (None, _) => {}
        }
    }
    Err(format!("it sent no frame within {} s", FIRST.as_secs()))
}

/// What opens a camera, now and whenever it has vanished; a file is read `in_time`, or as fast as it goes.
#[cfg_attr(
    not(all(feature = "gstreamer", feature = "v4l")),
    allow(unused_variables, reason = "each way needs its part")
)]
fn opener(way: Way, camera: &str, settings: &Settings, in_time: bool) -> Result<Open, SourceError> {
    let (camera, start_nanos) = (camera.to_owned(), settings.start.unwrap_or_default());
    match way {
        #[cfg(feature = "gstreamer")]
        Way::GStreamer => Ok(Box::new(move || {
            gstreamer::open(&camera, start_nanos, in_time)
        })),
        #[cfg(not(feature = "gstreamer"))]
        Way::GStreamer => Err(SourceError::NeedsFeature {
            feature: "gstreamer",
            packages: ", with libgstreamer1.0-dev and libgstreamer-plugins-base1.0-dev installed",
        }),
        #[cfg(feature = "v4l")]
        Way::V4l => {
            let size = settings.width.zip(settings.height);
            let size = size.map(|(width, height)| Size::new(width, height));
            Ok(Box::new(move || v4l::open(&camera, size)))
        }
        #[cfg(not(feature = "v4l"))]
        Way::V4l => Err(SourceError::NeedsFeature {
            feature: "v4l",
            packages: "",
        }),
        // They are heard on the bus, which only a running node has.
        Way::Bus => Err(SourceError::SentOnce),
    }
}
