//! Cameras and video files through GStreamer: whatever a pipeline gives, made gray by it.

use std::sync::OnceLock;
use std::time::{SystemTime, UNIX_EPOCH};

use gstreamer as gst;
use gstreamer_app as gst_app;
use gstreamer_video as gst_video;

use gst::prelude::*;
use gst_video::prelude::*;
use messages::Size;

use super::feed::{Camera, Next};
use super::gray::{Layout, Picture};

/// What makes any video gray, and its names.
const TAIL: &str = "videoconvert name=tricurve_gray dither=none ! video/x-raw,format=GRAY8 ! appsink name=tricurve_frames max-buffers=4";
const GRAY: &str = "tricurve_gray";
const FRAMES: &str = "tricurve_frames";

/// What GStreamer says of a frame without a number.
const NO_OFFSET: u64 = u64::MAX;

/// How long to wait for a frame before it is looked whether the pipeline has failed.
const MOMENT: gst::ClockTime = gst::ClockTime::from_mseconds(100);
/// How long to wait for what a pipeline says of its failure.
const WORDS: gst::ClockTime = gst::ClockTime::from_seconds(1);

/// When all pipelines of this process begin: by their clock, and in nanoseconds since 1970.
static BEGIN: OnceLock<(gst::ClockTime, u64)> = OnceLock::new();

fn begin() -> (gst::ClockTime, u64) {
    *BEGIN.get_or_init(|| {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let nanos = since.unwrap_or_default().as_nanos() as u64;
        (gst::SystemClock::obtain().time(), nanos)
    })
}

/// Starts a pipeline. Its frames are dated by the clock that all pipelines share; those of a file by the file, whose first
/// moment is `start_nanos`, in nanoseconds since 1970, and it is read `in_time`, or as fast as its frames are taken.
///
/// # Errors
/// What GStreamer says.
pub(crate) fn open(
    pipeline: &str,
    start_nanos: u64,
    in_time: bool,
) -> Result<Box<dyn Camera>, String> {
    gst::init().map_err(|error| error.to_string())?;
    let parsed = gst::parse::launch(&format!("{pipeline} ! {TAIL}"));
    let parsed = parsed.map_err(|error| error.message().to_owned())?;
    let pipeline = parsed
        .downcast::<gst::Pipeline>()
        .map_err(|_| "it is no pipeline".to_owned())?;
    let part = |name| {
        pipeline
            .by_name(name)
            .ok_or("it has lost its end".to_owned())
    };
    let sink = part(FRAMES)?.downcast::<gst_app::AppSink>();
    let sink = sink.map_err(|_| "it has lost its end".to_owned())?;
    let (base, nanos) = begin();
    let mut camera = Pipeline {
        converter: part(GRAY)?,
        sink,
        begin_nanos: start_nanos,
        is_live: false,
        last_offset: None,
        lost: 0,
        pipeline,
    };
    camera.pipeline.use_clock(Some(&gst::SystemClock::obtain()));
    camera.pipeline.set_start_time(gst::ClockTime::NONE);
    camera.pipeline.set_base_time(base);
    // Who is live needs not be told to keep the time.
    camera.sink.set_property("sync", in_time);
    let started = camera.pipeline.set_state(gst::State::Paused);
    let started = started.map_err(|_| camera.words())?;
    if started == gst::StateChangeSuccess::NoPreroll {
        camera.sink.set_property("sync", false);
        camera.is_live = true;
        camera.begin_nanos = nanos;
    }
    let playing = camera.pipeline.set_state(gst::State::Playing);
    playing.map_err(|_| camera.words())?;
    Ok(Box::new(camera))
}

struct Pipeline {
    pipeline: gst::Pipeline,
    converter: gst::Element,
    sink: gst_app::AppSink,
    /// When running time is zero, in nanoseconds since 1970.
    begin_nanos: u64,
    is_live: bool,
    /// The number that the source gave its last frame.
    last_offset: Option<u64>,
    lost: u64,
}

impl Pipeline {
    /// What the pipeline says of its failure, if it has failed.
    fn failure(&self, wait: gst::ClockTime) -> Option<String> {
        let message = self
            .pipeline
            .bus()?
            .timed_pop_filtered(wait, &[gst::MessageType::Error])?;
        let gst::MessageView::Error(error) = message.view() else {
            return None;
        };
        let who = error.src().map_or("GStreamer".into(), |src| src.name());
        let what = error.error();
        // The details' first line is a place in GStreamer's own code.
        let details = error
            .debug()
            .map(|debug| debug.to_string())
            .unwrap_or_default();
        let details: Vec<&str> = details.lines().skip(1).map(str::trim).collect();
        let details = match details.as_slice() {
            [] => String::new(),
            lines => format!(" ({})", lines.join("; ")),
        };
        Some(format!("{who}: {}{details}", what.message()))
    }

    fn words(&self) -> String {
        let words = self.failure(WORDS);
        words.unwrap_or("GStreamer cannot start it, and does not say why".to_owned())
    }

    fn count_lost(&mut self, buffer: &gst::BufferRef) {
        let offset = buffer.offset();
        if offset == NO_OFFSET {
            return;
        }
        if let Some(last) = self.last_offset
            && self.is_live
        {
            self.lost += offset.saturating_sub(last + 1);
        }
        self.last_offset = Some(offset);
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // Nothing can be done about a pipeline that does not stop.
        self.pipeline
            .set_state(gst::State::Null)
            .map_or_else(|_| (), |_| ());
    }
}

impl Camera for Pipeline {
    fn next(&mut self, take: &mut dyn FnMut(Picture<'_>)) -> Result<Next, String> {
        let Some(sample) = self.sink.try_pull_sample(MOMENT) else {
            if let Some(why) = self.failure(gst::ClockTime::ZERO) {
                return Err(why);
            }
            return Ok(match self.sink.is_eos() {
                true => Next::End,
                false => Next::Nothing,
            });
        };
        let damaged = |what: &str| format!("it sends frames without {what}");
        let caps = sample.caps().ok_or_else(|| damaged("a format"))?;
        let format = gst_video::VideoInfo::from_caps(caps).map_err(|_| damaged("a size"))?;
        let buffer = sample.buffer().ok_or_else(|| damaged("pixels"))?;
        self.count_lost(buffer);
        let segment = sample
            .segment()
            .and_then(|segment| segment.downcast_ref::<gst::ClockTime>());
        let running = segment.zip(buffer.pts());
        let running = running.and_then(|(segment, pts)| segment.to_running_time(pts));
        let running = running.ok_or_else(|| damaged("times"))?;
        let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(buffer, &format)
            .map_err(|_| damaged("readable pixels"))?;
        take(Picture {
            nanos: self.begin_nanos + running.nseconds(),
            position_m: f64::NAN,
            size: Size::new(format.width(), format.height()),
            layout: Layout::Gray,
            stride: frame.plane_stride()[0].unsigned_abs() as usize,
            bytes: frame.plane_data(0).map_err(|_| damaged("pixels"))?,
        });
        Ok(Next::Came)
    }

    fn is_live(&self) -> bool {
        self.is_live
    }

    fn lost(&mut self) -> u64 {
        std::mem::take(&mut self.lost)
    }

    fn notice(&self) -> Option<String> {
        let caps = self.converter.static_pad("sink")?.current_caps()?;
        let format = gst_video::VideoInfo::from_caps(&caps).ok()?;
        let depth = format.comp_depth(0);
        match (format.format_info().is_gray(), depth) {
            (true, ..=8) => None,
            (true, bits) => Some(format!("{bits}-bit pixels are scaled to 8 bit")),
            (false, ..=8) => Some(format!("colour ({}) is converted to gray", format.format())),
            (false, bits) => Some(format!(
                "{bits}-bit colour ({}) is converted to 8-bit gray",
                format.format()
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::live::feed::{Feed, Frame, News, Open};
    use crate::synchronise::{Scan, Synchroniser};
    use crate::{Settings, Source, SourceError};
    use std::path::Path;
    use std::time::{Duration, Instant};

    const START: u64 = 1_700_000_000_000_000_000;
    const SMALL: &str = "video/x-raw,width=64,height=48,framerate=30/1";

    fn names() -> Vec<String> {
        ["left", "centre", "right"].map(str::to_owned).to_vec()
    }

    fn settings(pipelines: &[&str]) -> Settings {
        Settings {
            source: "camera:gstreamer".to_owned(),
            cameras: pipelines.iter().map(|text| (*text).to_owned()).collect(),
            start: Some(START),
            ..Settings::default()
        }
    }

    /// A camera that loses some frames and is not sure of the time.
    struct Shaky {
        camera: Box<dyn Camera>,
        random: u64,
    }

    impl Shaky {
        fn below(&mut self, end: u64) -> u64 {
            self.random = self
                .random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.random >> 33) % end
        }
    }

    impl Camera for Shaky {
        fn next(&mut self, take: &mut dyn FnMut(Picture<'_>)) -> Result<Next, String> {
            let (is_lost, jitter) = (self.below(10) == 0, self.below(8_000_000));
            self.camera.next(&mut |picture| {
                let nanos = picture.nanos + jitter;
                if !is_lost {
                    take(Picture { nanos, ..picture });
                }
            })
        }
    }

    /// Everything that these pipelines send, and what becomes of it.
    struct Seen {
        times: Vec<Vec<u64>>,
        scans: Vec<Scan<Frame>>,
        synchroniser: Synchroniser<Frame>,
    }

    fn play(openers: Vec<Open>, tolerance: u64) -> Seen {
        let count = openers.len();
        let feeds: Vec<Feed> = openers
            .into_iter()
            .map(|open| Feed::start("test", open, true, || || {}).unwrap())
            .collect();
        let mut synchroniser = Synchroniser::new(count, tolerance, 1000);
        let (mut times, mut scans, mut ended) = (vec![Vec::new(); count], Vec::new(), 0);
        let since = Instant::now();
        while ended < count {
            assert!(since.elapsed() < Duration::from_secs(60), "it hangs");
            for (camera, feed) in feeds.iter().enumerate() {
                match feed.news.recv_timeout(Duration::from_millis(1)) {
                    Ok(News::Frame(frame)) => {
                        times[camera].push(frame.nanos);
                        synchroniser.push(camera, frame.nanos, frame);
                    }
                    Ok(News::Ended) => {
                        synchroniser.end(camera);
                        ended += 1;
                    }
                    Ok(News::Opened { .. }) | Err(_) => {}
                    Ok(other) => panic!("{other:?}"),
                }
                scans.extend(std::iter::from_fn(|| synchroniser.next_scan()));
            }
        }
        synchroniser.finish();
        Seen {
            times,
            scans,
            synchroniser,
        }
    }

    #[test]
    fn the_account_of_three_shaky_cameras_at_30_hz_adds_up() {
        let openers = (0..3u64).map(|camera| -> Open {
            let text =
                format!("videotestsrc is-live=true num-buffers=90 pattern={camera} ! {SMALL}");
            Box::new(move || {
                Ok(Box::new(Shaky {
                    camera: open(&text, START, false)?,
                    random: camera,
                }))
            })
        });
        let tolerance = 17_000_000;
        let seen = play(openers.collect(), tolerance);
        let account = seen.synchroniser.account(&names());
        for (camera, times) in account.cameras.iter().zip(&seen.times) {
            assert!(camera.is_balanced(), "{camera:?}");
            assert_eq!(camera.received, times.len() as u64);
            assert!((60..90).contains(&camera.received), "{camera:?}");
            assert_eq!(
                (camera.matched, camera.waiting, camera.late),
                (account.scans, 0, 0)
            );
        }
        // Each slot of a thirtieth of a second in which all three have a frame is a scan: they begin within a few
        // milliseconds of each other, and are shaken by less than a quarter of it.
        assert!(account.scans >= 40, "{account}");
        for scan in &seen.scans {
            for frame in &scan.frames {
                assert!(frame.nanos.abs_diff(scan.nanos) <= tolerance);
            }
        }
        assert_eq!(seen.scans.len() as u64, account.scans);
        // Run with --nocapture to see it.
        eprintln!("{account}");
    }

    fn film(folder: &Path, name: &str, frames: u32) -> String {
        let path = folder.join(name);
        let text = format!(
            "videotestsrc num-buffers={frames} pattern=ball ! {SMALL} ! jpegenc ! avimux ! filesink location={}",
            path.display()
        );
        let pipeline = gst::parse::launch(&text).unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        let end = [gst::MessageType::Eos, gst::MessageType::Error];
        let message = pipeline
            .bus()
            .unwrap()
            .timed_pop_filtered(gst::ClockTime::NONE, &end);
        assert_eq!(message.unwrap().type_(), gst::MessageType::Eos);
        pipeline.set_state(gst::State::Null).unwrap();
        format!("filesrc location={} ! decodebin", path.display())
    }

    #[test]
    fn three_video_files_give_every_frame_in_their_own_time_whichever_is_read_first() {
        gst::init().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let films = ["a.avi", "b.avi", "c.avi"].map(|name| film(folder.path(), name, 20));
        let openers = films
            .clone()
            .map(|text| -> Open { Box::new(move || open(&text, START, false)) });
        let seen = play(openers.into(), 1_000_000);
        assert_eq!(seen.scans.len(), 20);
        for (n, scan) in seen.scans.iter().enumerate() {
            let expected = START + n as u64 * 1_000_000_000 / 30;
            assert!(
                scan.nanos.abs_diff(expected) < 1_000_000,
                "{n}: {}",
                scan.nanos
            );
            assert_eq!(scan.frames[0].size, Size::new(64, 48));
            // The same ball in all three, and it moves.
            assert_eq!(scan.frames[0].pixels, scan.frames[2].pixels);
        }
        assert_ne!(
            seen.scans[0].frames[0].pixels,
            seen.scans[19].frames[0].pixels
        );
        let source = Source::open(&settings(&films.each_ref().map(String::as_str))).unwrap();
        assert!(source.is_cameras());
        assert_eq!((source.size(), source.view_count()), (Size::new(64, 48), 3));
        assert_eq!(
            source.notices()[0],
            "left: colour (I420) is converted to gray"
        );
    }

    #[test]
    fn what_gstreamer_says_of_a_pipeline_that_fails_is_passed_on() {
        let good = format!("videotestsrc ! {SMALL}");
        for (pipeline, words) in [
            ("nosuchsrc", "no element \"nosuchsrc\""),
            ("videotestsrc nosuch=1", "no property \"nosuch\""),
            ("v4l2src device=/dev/video99", "/dev/video99"),
            ("filesrc location=/nosuch.avi ! decodebin", "/nosuch.avi"),
            ("videotestsrc ! video/x-raw,width=16,height=16", "16x16"),
            (
                "videotestsrc ! video/x-raw,width=96,height=48",
                "left are 64x48",
            ),
        ] {
            let error = Source::open(&settings(&[&good, pipeline, &good])).unwrap_err();
            let text = error.to_string();
            assert!(text.contains(words), "{pipeline}: {text}");
            assert!(!text.contains('\n') && text.len() < 400, "{text}");
        }
        let none = Source::open(&settings(&[])).unwrap_err();
        assert!(matches!(none, SourceError::NoCameras { .. }), "{none}");
    }

    #[test]
    fn deep_and_coloured_video_becomes_gray_and_it_is_said() {
        for (format, notice) in [
            ("GRAY8", None),
            ("GRAY16_LE", Some("16-bit pixels are scaled to 8 bit")),
            ("GRAY10_LE32", Some("10-bit pixels are scaled to 8 bit")),
            ("BGR", Some("colour (BGR) is converted to gray")),
            (
                "I420_12LE",
                Some("12-bit colour (I420_12LE) is converted to 8-bit gray"),
            ),
        ] {
            let text = format!(
                "videotestsrc num-buffers=2 pattern=gradient ! video/x-raw,format={format},width=64,height=64"
            );
            let mut camera = open(&text, START, false).unwrap();
            let mut gray = Vec::new();
            while gray.is_empty() {
                let next = camera
                    .next(&mut |picture| gray = picture.gray().unwrap())
                    .unwrap();
                assert_ne!(next, Next::End);
            }
            assert_eq!(camera.notice().as_deref(), notice, "{format}");
            // From black above to white below, as far as the test picture goes.
            let (top, bottom) = (gray[32], gray[63 * 64 + 32]);
            assert!(top < 25 && bottom > 225, "{format}: {top} to {bottom}");
        }
    }
}
