//! Frames from outside: a program that is no node of a run publishes a camera's frames to it.
//!
//! ```text
//! another program: FramesOut::send, written in place ─► service frames/VIEW ─► FramesIn ─► capture
//! ```

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::ipc;

use super::ports::{self, Bell, FrameSample, FramesPublisher, FramesSubscriber, Ports, frame};
use super::{BusError, Run};
use crate::header::{Header, Size};

/// How long a frame is waited for.
const MOMENT: Duration = Duration::from_millis(100);

/// The inbox of who takes a view's frames.
fn inbox(view: &str) -> String {
    format!("frames.{view}")
}

/// Publishes the frames of one view to a running graph whose source is `camera:bus`.
pub struct FramesOut {
    publisher: FramesPublisher,
    taker: Bell,
    view: u32,
    size: Size,
    sent: u64,
    /// Its ports live as long as their node.
    _ports: Ports,
}

impl std::fmt::Debug for FramesOut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FramesOut")
            .field("view", &self.view)
            .field("size", &self.size)
            .finish_non_exhaustive()
    }
}

impl FramesOut {
    /// Joins the run with this folder, which it says when it waits for frames, as the view of this name.
    ///
    /// # Errors
    /// When there is no such run, it has no such view, or another program publishes that view already.
    pub fn join(run: &Path, view: &str) -> Result<Self, BusError> {
        let run = read(run)?;
        let index = run.rig.views.iter().position(|known| known.name == view);
        let Some(index) = index else {
            let names = run.rig.views.iter().map(|view| view.name.as_str());
            let names = names.collect::<Vec<_>>().join(", ");
            return Err(BusError::port(
                format!("find the view {view} among {names}"),
                "no such view",
            ));
        };
        let ports = Ports::new(&run, &format!("frames.{view}.{}", std::process::id()))?;
        Ok(Self {
            publisher: ports.frames_out(view, run.rig.size)?,
            taker: ports.bell(&inbox(view))?,
            view: index as u32,
            size: run.rig.size,
            sent: 0,
            _ports: ports,
        })
    }

    /// The names of the views that a run waits for, left to right; of a rail the one that moves.
    ///
    /// # Errors
    /// A folder that is no run's.
    pub fn views(run: &Path) -> Result<Vec<String>, BusError> {
        let views = read(run)?.rig.views.into_iter();
        Ok(views.map(|view| view.name).collect())
    }

    /// The size of every frame.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Publishes a frame, taken at this time in nanoseconds since 1970: `fill` writes its pixels, 8-bit gray row by row,
    /// where they are read.
    ///
    /// # Errors
    /// When it cannot be sent.
    pub fn send(&mut self, nanos: u64, fill: impl FnOnce(&mut [u8])) -> Result<(), BusError> {
        self.send_at(nanos, f64::NAN, fill)
    }

    /// Publishes a frame of a camera that moves along a rail, taken so many metres along it, to the right.
    ///
    /// # Errors
    /// When it cannot be sent.
    pub fn send_at(
        &mut self,
        nanos: u64,
        position_m: f64,
        fill: impl FnOnce(&mut [u8]),
    ) -> Result<(), BusError> {
        let header = Header {
            view: self.view,
            position_m,
            ..Header::new(self.sent, nanos, self.size)
        };
        frame(&self.publisher, &header, fill)?;
        self.taker.ring();
        self.sent += 1;
        Ok(())
    }
}

/// The run with this folder.
fn read(folder: &Path) -> Result<Run, BusError> {
    let cannot = |why: String| BusError::port(format!("find a run in {}", folder.display()), why);
    let text = fs::read(folder.join("orders.json")).map_err(|e| cannot(e.to_string()))?;
    let mut orders: serde_json::Value =
        serde_json::from_slice(&text).map_err(|e| cannot(e.to_string()))?;
    serde_json::from_value(orders["run"].take()).map_err(|e| cannot(e.to_string()))
}

/// Hears the frames of one view that another program publishes.
pub struct FramesIn {
    subscriber: FramesSubscriber,
    inbox: Listener<ipc::Service>,
    /// Its ports live as long as their node.
    _ports: Ports,
}

impl std::fmt::Debug for FramesIn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FramesIn").finish_non_exhaustive()
    }
}

/// A frame from outside.
pub struct FrameIn(FrameSample);

impl std::fmt::Debug for FrameIn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("FrameIn").field(&self.header()).finish()
    }
}

impl FrameIn {
    /// Which it is of this view's, from 0, and when it was taken.
    pub fn header(&self) -> Header {
        self.0.user_header().header()
    }

    /// 8-bit gray, row by row.
    pub fn pixels(&self) -> &[u8] {
        self.0.payload()
    }
}

impl FramesIn {
    /// Listens to this view of a run; in the thread that calls it.
    ///
    /// # Errors
    /// When the subscriber cannot be made.
    pub fn listen(run: &Run, view: usize) -> Result<Self, BusError> {
        let name = &run.rig.views[view].name;
        let ports = Ports::new(run, &format!("frames.{name}"))?;
        Ok(Self {
            subscriber: ports.frames_in(name)?,
            inbox: ports.inbox(&inbox(name))?,
            _ports: ports,
        })
    }

    /// The next frame; waits a moment for it.
    ///
    /// # Errors
    /// When the subscriber fails.
    pub fn wait(&mut self) -> Result<Option<FrameIn>, BusError> {
        let until = Instant::now() + MOMENT;
        loop {
            let sample = self.subscriber.receive();
            if let Some(sample) = sample.map_err(|e| BusError::port("receive a frame", e))? {
                return Ok(Some(FrameIn(sample)));
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            ports::wait(&self.inbox, left)?;
        }
    }
}
