//! Live scans under way, kept where they outlive this process: files in the run's folder, which is memory.
//!
//! A scan is written before it is let in, so a successor of this process can send again whatever anybody may have seen.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use messages::Size;

use super::feed::Frame;
use crate::synchronise::Scan;

/// The folder of the scans under way.
#[derive(Debug)]
pub(crate) struct Kept {
    folder: PathBuf,
}

/// When the last scan was taken and how far apart they are, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Pace {
    pub(crate) last: u64,
    pub(crate) interval: u64,
}

/// Nanoseconds for which a restart may last.
const LONGEST: u64 = 3600 * 1_000_000_000;

impl Pace {
    /// A scan was taken.
    pub(crate) fn advance(&mut self, nanos: u64) {
        let interval = nanos.saturating_sub(self.last);
        if self.last > 0 && interval > 0 {
            // One that was dropped lies between some of them: the shorter counts more.
            self.interval = match self.interval {
                0 => interval,
                known if interval < known => (known + interval) / 2,
                known => known + (interval - known).min(known) / 16,
            };
        }
        self.last = nanos;
    }

    /// Scans that were missed before one taken at this time; where that is far ahead a clock was set, and nobody knows.
    pub(crate) fn missed(&self, nanos: u64) -> u64 {
        match (self.last, self.interval) {
            (0, _) | (_, 0) => 0,
            (last, _) if nanos.saturating_sub(last) > LONGEST => 0,
            (last, interval) => {
                let intervals = (nanos.saturating_sub(last) + interval / 2) / interval;
                intervals.saturating_sub(1)
            }
        }
    }
}

impl Kept {
    pub(crate) fn open(run: &Path) -> io::Result<Self> {
        let folder = run.join("kept");
        fs::create_dir_all(&folder)?;
        Ok(Self { folder })
    }

    fn path(&self, tick: u64) -> PathBuf {
        self.folder.join(tick.to_string())
    }

    /// A file in the folder, which is made anew when somebody removed it.
    fn create(&self, path: &Path) -> io::Result<fs::File> {
        fs::File::create(path).or_else(|error| match error.kind() {
            io::ErrorKind::NotFound => {
                fs::create_dir_all(&self.folder)?;
                fs::File::create(path)
            }
            _ => Err(error),
        })
    }

    pub(crate) fn keep(&self, tick: u64, scan: &Scan<Frame>) -> io::Result<()> {
        let mut file = io::BufWriter::new(self.create(&self.path(tick))?);
        file.write_all(&scan.nanos.to_le_bytes())?;
        for frame in &scan.frames {
            file.write_all(&frame.position_m.to_le_bytes())?;
            file.write_all(&frame.size.width.to_le_bytes())?;
            file.write_all(&frame.size.height.to_le_bytes())?;
            file.write_all(&frame.pixels)?;
        }
        file.flush()
    }

    /// A scan that was kept.
    pub(crate) fn read(&self, tick: u64) -> io::Result<Scan<Frame>> {
        let bytes = fs::read(self.path(tick))?;
        decode(&bytes).ok_or_else(|| io::Error::other("it is damaged"))
    }

    /// Lets all go but those the door still has under way.
    pub(crate) fn forget_all_but(&self, mut is_under_way: impl FnMut(u64) -> bool) {
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let tick = entry.file_name().to_string_lossy().parse();
            if tick.is_ok_and(|tick| !is_under_way(tick)) {
                // One that stays costs memory until the run is over.
                fs::remove_file(entry.path()).unwrap_or_default();
            }
        }
    }

    pub(crate) fn keep_pace(&self, pace: Pace) -> io::Result<()> {
        let bytes = [pace.last.to_le_bytes(), pace.interval.to_le_bytes()];
        self.create(&self.folder.join("pace"))?
            .write_all(&bytes.concat())
    }

    pub(crate) fn pace(&self) -> Pace {
        let bytes = fs::read(self.folder.join("pace")).unwrap_or_default();
        match bytes.as_chunks().0 {
            [last, interval] => Pace {
                last: u64::from_le_bytes(*last),
                interval: u64::from_le_bytes(*interval),
            },
            _ => Pace::default(),
        }
    }
}

fn decode(bytes: &[u8]) -> Option<Scan<Frame>> {
    let (nanos, mut rest) = bytes.split_first_chunk()?;
    let nanos = u64::from_le_bytes(*nanos);
    let mut frames = Vec::new();
    while !rest.is_empty() {
        let (position_m, after) = rest.split_first_chunk()?;
        let (width, after) = after.split_first_chunk()?;
        let (height, after) = after.split_first_chunk()?;
        let size = Size::new(u32::from_le_bytes(*width), u32::from_le_bytes(*height));
        let pixels = after.get(..size.pixels())?;
        rest = &after[size.pixels()..];
        frames.push(Frame {
            nanos,
            position_m: f64::from_le_bytes(*position_m),
            size,
            pixels: pixels.to_vec(),
        });
    }
    Some(Scan { nanos, frames })
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn a_scan_that_is_kept_is_read_back_and_goes_when_it_is_done() {
        let folder = tempfile::tempdir().unwrap();
        let kept = Kept::open(folder.path()).unwrap();
        let frame = |value: u8| Frame {
            nanos: 77,
            position_m: 0.25,
            size: Size::new(3, 2),
            pixels: vec![value; 6],
        };
        let scan = Scan {
            nanos: 77,
            frames: vec![frame(1), frame(2)],
        };
        kept.keep(4, &scan).unwrap();
        kept.keep(5, &scan).unwrap();
        let pace = Pace {
            last: 77,
            interval: 33,
        };
        kept.keep_pace(pace).unwrap();
        let successor = Kept::open(folder.path()).unwrap();
        assert_eq!(successor.read(4).unwrap(), scan);
        successor.forget_all_but(|tick| tick == 5);
        assert!(successor.read(4).is_err());
        assert_eq!(successor.read(5).unwrap(), scan);
        assert_eq!(successor.pace(), pace);
    }

    #[test]
    fn what_was_missed_is_counted_by_the_pace_before() {
        let mut pace = Pace::default();
        assert_eq!(pace.missed(1_000), 0);
        for n in 1..=100u64 {
            // Every tenth is dropped, and all come a little early or late.
            if n % 10 != 0 {
                pace.advance(1_000_000 + n * 33_000 + (n * 7919) % 3_000);
            }
        }
        assert_eq!(pace.missed(1_000_000 + 100 * 33_000), 0);
        let missed = pace.missed(1_000_000 + 130 * 33_000);
        assert!((29..=32).contains(&missed), "{missed}");
        assert_eq!(pace.missed(1_800_000_000_000_000_000), 0);
    }
}
