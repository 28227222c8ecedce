//! The file under the recording: what is not flushed stays in memory, what is flushed is whole.
//!
//! Before a flush writes anything, room is set aside for all of it and for the index that a finished file needs:
//! a full disk shows before a chunk is torn, and there is room left to finish.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What a sink needs of a file.
pub(crate) trait Disk: Send + std::fmt::Debug {
    /// Appends all bytes.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Sets room aside without changing the file's length; does nothing where that is unknown.
    fn allocate(&mut self, range: Range<u64>) -> io::Result<()>;

    /// Cuts the file, and gives back room set aside beyond.
    fn cut(&mut self, len: u64) -> io::Result<()>;

    /// Waits until everything has reached the disk.
    fn sync(&mut self) -> io::Result<()>;
}

impl Disk for File {
    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.write_all(bytes)
    }

    #[cfg(target_os = "linux")]
    fn allocate(&mut self, range: Range<u64>) -> io::Result<()> {
        use rustix::fs::{FallocateFlags, fallocate};
        let len = range.end - range.start;
        match fallocate(&*self, FallocateFlags::KEEP_SIZE, range.start, len) {
            Err(error) if io::Error::from(error).kind() == io::ErrorKind::StorageFull => {
                Err(error.into())
            }
            // Not every file system can.
            _ => Ok(()),
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn allocate(&mut self, _: Range<u64>) -> io::Result<()> {
        Ok(())
    }

    fn cut(&mut self, len: u64) -> io::Result<()> {
        self.set_len(len)?;
        self.seek(SeekFrom::Start(len)).map(drop)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.sync_all()
    }
}

/// Room for schemas, channels and metadata in the index.
const INDEX_BYTES: u64 = 256 << 10;
/// Room for a scan's chunks in the index.
const INDEX_BYTES_A_FLUSH: u64 = 4 << 10;
/// Room is set aside in steps of this, so that not every flush needs to ask.
const STEP: u64 = 8 << 20;

/// Collects what is written until it is flushed.
#[derive(Debug)]
pub(crate) struct Sink {
    disk: Box<dyn Disk>,
    pending: Vec<u8>,
    cursor: usize,
    flushed: u64,
    flushes: u64,
    allocated: u64,
    failed: bool,
    written: Arc<AtomicU64>,
}

impl Sink {
    /// On an empty file; `written` always tells how many bytes are flushed.
    pub(crate) fn new(disk: Box<dyn Disk>, written: Arc<AtomicU64>) -> Self {
        Self {
            disk,
            pending: Vec::new(),
            cursor: 0,
            flushed: 0,
            flushes: 0,
            allocated: 0,
            failed: false,
            written,
        }
    }

    /// Gives back room that was set aside and waits for the disk.
    pub(crate) fn close(mut self) -> io::Result<()> {
        self.flush()?;
        self.disk.cut(self.flushed)?;
        self.disk.sync()
    }

    fn commit(&mut self) -> io::Result<()> {
        let end = self.flushed + self.pending.len() as u64;
        let needed = end + INDEX_BYTES + (self.flushes + 1) * INDEX_BYTES_A_FLUSH;
        if needed > self.allocated {
            let from = self.allocated;
            self.allocated = needed + STEP;
            if self.disk.allocate(from..self.allocated).is_err() {
                self.allocated = needed;
                self.disk.allocate(from..needed)?;
            }
        }
        self.disk.append(&self.pending)?;
        self.flushed = end;
        self.flushes += 1;
        self.pending.clear();
        self.cursor = 0;
        self.written.store(end, Ordering::Relaxed);
        Ok(())
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let overwritten = bytes.len().min(self.pending.len() - self.cursor);
        let (over, new) = bytes.split_at(overwritten);
        self.pending[self.cursor..self.cursor + overwritten].copy_from_slice(over);
        self.pending.extend_from_slice(new);
        self.cursor += bytes.len();
        Ok(bytes.len())
    }

    /// Everything or nothing: when it fails the file is as it was before, and the sink takes no more.
    fn flush(&mut self) -> io::Result<()> {
        if self.failed {
            return Err(io::Error::other("an earlier write failed"));
        }
        if self.pending.is_empty() {
            return Ok(());
        }
        self.commit().inspect_err(|_| {
            self.failed = true;
            // Should even that fail, sealing cuts the torn end.
            drop(self.disk.cut(self.flushed));
        })
    }
}

impl Seek for Sink {
    /// Only what is not flushed yet can be written again.
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let end = self.flushed + self.pending.len() as u64;
        let here = self.flushed + self.cursor as u64;
        let position = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::Current(by) => here.checked_add_signed(by),
            SeekFrom::End(by) => end.checked_add_signed(by),
        };
        let position = position.filter(|position| (self.flushed..=end).contains(position));
        let position =
            position.ok_or_else(|| io::Error::other("what is flushed is not touched"))?;
        self.cursor = (position - self.flushed) as usize;
        Ok(position)
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use std::sync::Mutex;

    #[derive(Clone, Debug, Default)]
    struct Memory(Arc<Mutex<Vec<u8>>>, usize);

    impl Disk for Memory {
        fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
            let mut memory = self.0.lock().unwrap();
            let room = self.1 - memory.len();
            memory.extend_from_slice(&bytes[..room.min(bytes.len())]);
            if bytes.len() > room {
                Err(io::ErrorKind::StorageFull.into())
            } else {
                Ok(())
            }
        }

        fn allocate(&mut self, _: Range<u64>) -> io::Result<()> {
            Ok(())
        }

        fn cut(&mut self, len: u64) -> io::Result<()> {
            self.0.lock().unwrap().truncate(len as usize);
            Ok(())
        }

        fn sync(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_is_not_flushed_can_be_written_over() {
        let memory = Memory(Arc::default(), 100);
        let mut sink = Sink::new(Box::new(memory.clone()), Arc::default());
        sink.write_all(b"first").unwrap();
        sink.flush().unwrap();
        sink.write_all(b"??second").unwrap();
        assert!(memory.0.lock().unwrap().ends_with(b"first"));
        sink.seek(SeekFrom::Start(5)).unwrap();
        sink.write_all(b", ").unwrap();
        assert_eq!(sink.stream_position().unwrap(), 7);
        assert_eq!(sink.seek(SeekFrom::End(0)).unwrap(), 13);
        assert!(sink.seek(SeekFrom::Start(4)).is_err());
        sink.close().unwrap();
        assert_eq!(*memory.0.lock().unwrap(), b"first, second");
    }

    #[test]
    fn a_flush_that_fails_leaves_the_file_as_it_was_and_is_the_last() {
        let memory = Memory(Arc::default(), 8);
        let mut sink = Sink::new(Box::new(memory.clone()), Arc::default());
        sink.write_all(b"first").unwrap();
        sink.flush().unwrap();
        sink.write_all(b"second").unwrap();
        assert_eq!(sink.flush().unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(*memory.0.lock().unwrap(), b"first");
        assert!(sink.flush().is_err());
        assert!(sink.close().is_err());
        assert_eq!(*memory.0.lock().unwrap(), b"first");
    }
}
