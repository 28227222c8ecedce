//! Cameras: sources that send frames when they like, each from a thread of its own.
//!
//! ```text
//! camera ─► gray ─► feed (bounded) ─┐
//! camera ─► gray ─► feed ───────────┼─► Synchroniser ─► door ─► images
//! camera ─► gray ─► feed ───────────┘                    └────► kept while under way, to be sent again
//! ```

mod feed;
mod frames;
mod gray;
#[cfg(feature = "gstreamer")]
mod gstreamer;
mod kept;
pub(crate) mod node;
#[cfg(feature = "v4l")]
mod v4l;

use std::time::{Duration, Instant};

use messages::{Rig, Size};

use crate::error::{LEAST_SIDE, MOST_PIXELS, SourceError};
use crate::settings::Settings;
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
    Frames,
}

impl Way {
    /// The way that a source names, if it is one to cameras.
    pub(crate) fn of(source: &str) -> Option<Self> {
        match source {
            "gstreamer" => Some(Self::GStreamer),
            "v4l" => Some(Self::V4l),
            "frames" => Some(Self::Frames),
            _ => None,
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
    pub(crate) notices: Vec<String>,
}

/// Opens every camera for its first frame, and closes it.
pub(crate) fn look(way: Way, settings: &Settings) -> Result<Known, SourceError> {
    let cameras = cameras_of(way, settings)?;
    let rig = Rig::of_views(cameras.len(), &[], Size::default());
    let names = rig.views.into_iter().map(|view| view.name);
    let views: Vec<(String, String)> = names.zip(cameras).collect();
    if way == Way::Frames {
        let (Some(width), Some(height)) = (settings.width, settings.height) else {
            return Err(SourceError::NoSize);
        };
        let size = checked(Size::new(width, height), "capture.width and capture.height")?;
        return Ok(Known {
            size,
            views,
            notices: Vec::new(),
        });
    }
    let mut notices = Vec::new();
    let mut first: Option<(Size, &str)> = None;
    for (name, camera) in &views {
        let wrong = |why: String| SourceError::Camera {
            name: name.clone(),
            camera: camera.clone(),
            why,
        };
        let mut camera = opener(way, camera, settings)?().map_err(wrong)?;
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
        notices,
    })
}

/// What each view is seen by, left to right.
fn cameras_of(way: Way, settings: &Settings) -> Result<Vec<String>, SourceError> {
    let cameras = settings.cameras.clone();
    match (way, cameras.is_empty()) {
        (Way::Frames, true) => Ok(vec!["another program".to_owned(); 3]),
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

/// What opens a camera, now and whenever it has vanished.
fn opener(way: Way, camera: &str, settings: &Settings) -> Result<Open, SourceError> {
    let (camera, start_nanos) = (camera.to_owned(), settings.start.unwrap_or_default());
    let missing = |packages| SourceError::NeedsFeature {
        source_name: settings.source.clone(),
        packages,
    };
    match way {
        #[cfg(feature = "gstreamer")]
        Way::GStreamer => Ok(Box::new(move || gstreamer::open(&camera, start_nanos))),
        #[cfg(not(feature = "gstreamer"))]
        Way::GStreamer => {
            let _: (String, u64) = (camera, start_nanos);
            Err(missing(
                " (with libgstreamer1.0-dev and libgstreamer-plugins-base1.0-dev installed)",
            ))
        }
        #[cfg(feature = "v4l")]
        Way::V4l => Ok(Box::new(move || v4l::open(&camera))),
        #[cfg(not(feature = "v4l"))]
        Way::V4l => Err(missing("")),
        // They are heard on the bus, which only a running node has.
        Way::Frames => Err(SourceError::SentOnce),
    }
}
