//! A camera in a thread of its own, and the bounded way from there.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, Sender, TrySendError, bounded};
use messages::Size;

use super::gray::Picture;

/// What a camera had when it was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    /// A picture, which was handed over.
    Came,
    /// Nothing yet.
    Nothing,
    /// It sends nothing more.
    #[cfg_attr(
        not(feature = "gstreamer"),
        allow(dead_code, reason = "only files come to an end")
    )]
    End,
}

/// A camera that is open.
pub(crate) trait Camera {
    /// Waits a moment for the next picture and hands it over.
    ///
    /// # Errors
    /// When the camera has vanished or fails, in its own words.
    fn next(&mut self, take: &mut dyn FnMut(Picture<'_>)) -> Result<Next, String>;

    /// Whether what it does not send now is gone: a file is no camera.
    fn is_live(&self) -> bool {
        true
    }

    /// Frames it lost itself, since this was asked last.
    fn lost(&mut self) -> u64 {
        0
    }

    /// What is done to its pictures, to be said once.
    fn notice(&self) -> Option<String> {
        None
    }
}

/// Opens a camera, as often as needed.
pub(crate) type Open = Box<dyn Fn() -> Result<Box<dyn Camera>, String> + Send>;

/// A picture, 8-bit gray row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Frame {
    pub(crate) nanos: u64,
    /// Where the camera stood, in metres along a rail; NaN where it does not say.
    pub(crate) position_m: f64,
    pub(crate) size: Size,
    pub(crate) pixels: Vec<u8>,
}

/// What is heard of a camera.
#[derive(Debug)]
pub(crate) enum News {
    /// It is open; whether what it does not send now is gone.
    Opened { is_live: bool },
    /// A picture.
    Frame(Frame),
    /// It has vanished, and is opened again when it is back.
    Vanished(String),
    /// It is back after so long.
    Returned(Duration),
    /// It sends nothing more.
    Ended,
    /// It cannot be read on, and opening it again would begin anew.
    Failed(String),
}

/// Frames that wait between a camera's thread and who takes them in: enough for a moment of other work.
const ROOM: usize = 4;
/// How often a camera that has vanished is opened again.
const AGAIN: Duration = Duration::from_secs(1);

/// A camera's frames, as its thread hears them.
#[derive(Debug)]
pub(crate) struct Feed {
    pub(crate) news: Receiver<News>,
    overrun: Arc<AtomicU64>,
    lost: Arc<AtomicU64>,
}

impl Feed {
    /// Opens a camera in a thread of its own. Where `may_wait` frames that nobody takes hold it back; otherwise they are
    /// dropped and counted. In that thread `ring` makes what is called after each of its news.
    pub(crate) fn start<R: FnMut()>(
        name: &str,
        open: Open,
        may_wait: bool,
        ring: impl FnOnce() -> R + Send + 'static,
    ) -> std::io::Result<Self> {
        let (sender, news) = bounded(ROOM);
        let (overrun, lost) = (Arc::default(), Arc::default());
        let feed = Self {
            news,
            overrun: Arc::clone(&overrun),
            lost: Arc::clone(&lost),
        };
        let run = move || {
            let line = Line {
                sender,
                may_wait,
                overrun,
                lost,
                ring: ring(),
            };
            // Whoever listened is gone: then so is this.
            line.run(&open).unwrap_or_default();
        };
        let thread = std::thread::Builder::new().name(format!("camera {name}"));
        thread.spawn(run)?;
        Ok(feed)
    }

    /// Frames that came faster than they were taken in, since this was asked last.
    pub(crate) fn overrun(&self) -> u64 {
        self.overrun.swap(0, Ordering::Relaxed)
    }

    /// Frames the camera lost itself, since this was asked last.
    pub(crate) fn lost(&self) -> u64 {
        self.lost.swap(0, Ordering::Relaxed)
    }
}

/// The thread's end of the line.
struct Line<R> {
    sender: Sender<News>,
    may_wait: bool,
    overrun: Arc<AtomicU64>,
    lost: Arc<AtomicU64>,
    ring: R,
}

/// Nobody listens any more.
struct Gone;

impl<R: FnMut()> Line<R> {
    fn run(mut self, open: &Open) -> Result<(), ()> {
        self.serve(open).map_err(|Gone| ())
    }

    fn serve(&mut self, open: &Open) -> Result<(), Gone> {
        let mut gone_since: Option<Instant> = None;
        loop {
            let why = match open() {
                Err(why) => why,
                Ok(mut camera) => {
                    let is_live = camera.is_live();
                    self.say(News::Opened { is_live })?;
                    let why = match self.read(camera.as_mut(), &mut gone_since)? {
                        None => return self.say(News::Ended),
                        Some(why) => why,
                    };
                    if !is_live {
                        return self.say(News::Failed(why));
                    }
                    why
                }
            };
            if gone_since.is_none() {
                gone_since = Some(Instant::now());
                self.say(News::Vanished(why))?;
            }
            std::thread::sleep(AGAIN);
        }
    }

    /// Hands frames over until the camera ends, or fails: then gives why.
    fn read(
        &mut self,
        camera: &mut dyn Camera,
        gone_since: &mut Option<Instant>,
    ) -> Result<Option<String>, Gone> {
        loop {
            let mut came = None;
            let next = camera.next(&mut |picture| {
                came = Some(picture.gray().map(|pixels| Frame {
                    nanos: picture.nanos,
                    position_m: picture.position_m,
                    size: picture.size,
                    pixels,
                }));
            });
            self.lost.fetch_add(camera.lost(), Ordering::Relaxed);
            match came {
                Some(Some(frame)) => {
                    if let Some(since) = gone_since.take() {
                        self.say(News::Returned(since.elapsed()))?;
                    }
                    self.hand_over(frame)?;
                }
                // Half a picture, as when a cable is torn out.
                Some(None) => drop(self.lost.fetch_add(1, Ordering::Relaxed)),
                None => {}
            }
            match next {
                Ok(Next::End) => return Ok(None),
                Ok(Next::Came | Next::Nothing) => {}
                Err(why) => return Ok(Some(why)),
            }
        }
    }

    fn hand_over(&mut self, frame: Frame) -> Result<(), Gone> {
        if self.may_wait {
            return self.say(News::Frame(frame));
        }
        match self.sender.try_send(News::Frame(frame)) {
            Ok(()) => (self.ring)(),
            Err(TrySendError::Full(_)) => drop(self.overrun.fetch_add(1, Ordering::Relaxed)),
            Err(TrySendError::Disconnected(_)) => return Err(Gone),
        }
        Ok(())
    }

    fn say(&mut self, news: News) -> Result<(), Gone> {
        self.sender.send(news).map_err(|_| Gone)?;
        (self.ring)();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::live::gray::Layout;
    use std::sync::Mutex;

    /// A camera that sends what it was told to: frames numbered on, or trouble.
    struct Made(Arc<Mutex<Vec<Result<u64, &'static str>>>>);

    impl Camera for Made {
        fn next(&mut self, take: &mut dyn FnMut(Picture<'_>)) -> Result<Next, String> {
            match self.0.lock().unwrap().pop() {
                None => Ok(Next::End),
                Some(Err(why)) => Err(why.to_owned()),
                Some(Ok(nanos)) => {
                    take(Picture {
                        nanos,
                        position_m: f64::NAN,
                        size: Size::new(2, 1),
                        layout: Layout::Gray,
                        stride: 2,
                        bytes: &[1, 2],
                    });
                    Ok(Next::Came)
                }
            }
        }
    }

    fn start(plan: &[Result<u64, &'static str>], may_wait: bool) -> Feed {
        let plan = Arc::new(Mutex::new(plan.iter().rev().copied().collect()));
        let open: Open = Box::new(move || Ok(Box::new(Made(Arc::clone(&plan)))));
        Feed::start("left", open, may_wait, || || {}).unwrap()
    }

    #[test]
    fn a_camera_that_vanishes_is_opened_again_and_its_frames_go_on() {
        let feed = start(&[Ok(1), Err("no such device"), Ok(2)], true);
        let said: Vec<String> = feed
            .news
            .iter()
            .map(|news| match news {
                News::Opened { is_live } => format!("opened {is_live}"),
                News::Frame(frame) => format!("frame {} {:?}", frame.nanos, frame.pixels),
                News::Vanished(why) => format!("vanished: {why}"),
                News::Returned(after) => format!("back after a second: {}", after >= AGAIN),
                News::Ended => "ended".to_owned(),
                News::Failed(why) => why,
            })
            .collect();
        assert_eq!(
            said,
            [
                "opened true",
                "frame 1 [1, 2]",
                "vanished: no such device",
                "opened true",
                "back after a second: true",
                "frame 2 [1, 2]",
                "ended"
            ]
        );
    }

    #[test]
    fn frames_that_nobody_takes_are_counted_or_hold_the_camera_back() {
        let plan: Vec<_> = (0..100).map(Ok).collect();
        for may_wait in [false, true] {
            let feed = start(&plan, may_wait);
            if !may_wait {
                // Its end finds no room either, and waits.
                while feed.overrun.load(Ordering::Relaxed) < 100 - ROOM as u64 + 1 {
                    std::thread::yield_now();
                }
            }
            let frames = feed
                .news
                .iter()
                .filter(|news| matches!(news, News::Frame(_)));
            let (frames, dropped) = (frames.count() as u64, feed.overrun());
            assert_eq!(frames + dropped, 100);
            assert_eq!(dropped > 0, !may_wait);
        }
    }
}
