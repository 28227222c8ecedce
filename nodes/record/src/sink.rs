//! The file under the recording: everything that is written to it is whole.
//!
//! Before anything is written, room is set aside for all of it and for the index that a finished file needs: a full
//! disk shows before a chunk is torn, and there is room left to finish.

use std::fs::File;
use std::io::{self, IoSlice, Seek, SeekFrom, Write};
use std::ops::Range;

/// What a sink needs of a file.
pub(crate) trait Disk: Send + std::fmt::Debug {
    /// Appends all pieces.
    fn append(&mut self, pieces: &mut [IoSlice<'_>]) -> io::Result<()>;

    /// Sets room aside without changing the file's length; does nothing where that is unknown.
    fn allocate(&mut self, range: Range<u64>) -> io::Result<()>;

    /// Cuts the file, and gives back room set aside beyond.
    fn cut(&mut self, len: u64) -> io::Result<()>;

    /// Waits until everything has reached the disk.
    fn sync(&mut self) -> io::Result<()>;

    /// Bytes that others may still write to the same disk, where that is known.
    fn free(&self) -> Option<u64> {
        None
    }

    /// Has these bytes written to the disk soon, and forgets those that are: they are not read again.
    fn forget(&mut self, _: Range<u64>) {}
}

impl Disk for File {
    fn append(&mut self, mut pieces: &mut [IoSlice<'_>]) -> io::Result<()> {
        // Empty pieces would look like an end.
        IoSlice::advance_slices(&mut pieces, 0);
        while !pieces.is_empty() {
            match self.write_vectored(pieces) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(written) => IoSlice::advance_slices(&mut pieces, written),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
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

    #[cfg(target_os = "linux")]
    fn free(&self) -> Option<u64> {
        let disk = rustix::fs::fstatvfs(self).ok()?;
        // Some, in memory or over a network, do not say how large they are.
        (disk.f_blocks > 0).then(|| disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Where memory is taken from a host, a page used before costs a fifth of one that was never touched; and what is
    /// on its way to the disk need not be waited for at the end.
    #[cfg(target_os = "linux")]
    fn forget(&mut self, range: Range<u64>) {
        use rustix::fs::{Advice, fadvise};
        let len = std::num::NonZeroU64::new(range.end - range.start);
        // Advice: nothing is lost when it is not taken.
        fadvise(&*self, range.start, len, Advice::DontNeed).unwrap_or_default();
    }
}

/// Room for schemas, channels and metadata in the index.
const INDEX_BYTES: u64 = 256 << 10;
/// Room for a scan's chunks in the index.
const INDEX_BYTES_A_SCAN: u64 = 4 << 10;
/// Room is set aside in steps of this, so that not every flush needs to ask.
const STEP: u64 = 8 << 20;

/// How many appends may be on their way to the disk before they are forgotten.
const LATEST: usize = 4;

/// Appends to a file, all or nothing.
#[derive(Debug)]
pub(crate) struct Sink {
    disk: Box<dyn Disk>,
    len: u64,
    appends: u64,
    allocated: u64,
    /// Where the latest appends end, the oldest first.
    latest: [u64; LATEST],
    failed: bool,
}

impl Sink {
    /// On an empty file.
    pub(crate) fn new(disk: Box<dyn Disk>) -> Self {
        Self {
            disk,
            len: 0,
            appends: 0,
            allocated: 0,
            latest: [0; LATEST],
            failed: false,
        }
    }

    /// How long the file is.
    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// Bytes that are free on its disk, where that is known.
    pub(crate) fn free(&self) -> Option<u64> {
        self.disk.free()
    }

    /// Appends all pieces. When that fails the file is as it was before, and the sink takes no more.
    pub(crate) fn append(&mut self, pieces: &mut [IoSlice<'_>]) -> io::Result<()> {
        if self.failed {
            return Err(io::Error::other("an earlier write failed"));
        }
        let end = self.len + pieces.iter().map(|piece| piece.len() as u64).sum::<u64>();
        let appended = self.reserve(end).and_then(|()| self.disk.append(pieces));
        match appended {
            Ok(()) => {
                // What was written is on its way now, and what was on its way has mostly come there.
                self.disk.forget(self.len..end);
                self.disk.forget(self.latest[0]..self.latest[1]);
                self.latest.rotate_left(1);
                self.latest[LATEST - 1] = end;
                self.len = end;
                self.appends += 1;
            }
            Err(_) => {
                self.failed = true;
                // Should even that fail, sealing cuts the torn end.
                drop(self.disk.cut(self.len));
            }
        }
        appended
    }

    /// Sets room aside for a file of this length and its index.
    fn reserve(&mut self, end: u64) -> io::Result<()> {
        let needed = end + INDEX_BYTES + (self.appends + 1) * INDEX_BYTES_A_SCAN;
        if needed > self.allocated {
            let from = self.allocated;
            self.allocated = needed + STEP;
            if self.disk.allocate(from..self.allocated).is_err() {
                self.allocated = needed;
                self.disk.allocate(from..needed)?;
            }
        }
        Ok(())
    }

    /// Appends the last bytes, for which room was set aside, gives back what is left of it and waits for the disk.
    pub(crate) fn close(mut self, ending: &[u8]) -> io::Result<u64> {
        if self.failed {
            return Err(io::Error::other("an earlier write failed"));
        }
        let appended = self.disk.append(&mut [IoSlice::new(ending)]);
        if appended.is_err() {
            drop(self.disk.cut(self.len));
        }
        appended?;
        let len = self.len + ending.len() as u64;
        self.disk.cut(len)?;
        self.disk.sync()?;
        Ok(len)
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use std::sync::{Arc, Mutex};

    #[derive(Clone, Debug, Default)]
    struct Memory(Arc<Mutex<Vec<u8>>>, usize);

    impl Disk for Memory {
        fn append(&mut self, pieces: &mut [IoSlice<'_>]) -> io::Result<()> {
            let mut memory = self.0.lock().unwrap();
            for byte in pieces.iter().flat_map(|piece| piece.iter()) {
                if memory.len() == self.1 {
                    return Err(io::ErrorKind::StorageFull.into());
                }
                memory.push(*byte);
            }
            Ok(())
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
    fn an_append_that_fails_leaves_the_file_as_it_was_and_is_the_last() {
        let memory = Memory(Arc::default(), 8);
        let mut sink = Sink::new(Box::new(memory.clone()));
        sink.append(&mut [IoSlice::new(b"fi"), IoSlice::new(b"rst")])
            .unwrap();
        let error = sink.append(&mut [IoSlice::new(b"second")]).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert_eq!(*memory.0.lock().unwrap(), b"first");
        assert!(sink.append(&mut [IoSlice::new(b"x")]).is_err());
        assert!(sink.close(b"x").is_err());
        assert_eq!(*memory.0.lock().unwrap(), b"first");
    }

    #[test]
    fn all_pieces_reach_the_file() {
        let mut file = tempfile::tempfile().unwrap();
        let many: Vec<Vec<u8>> = (0..3000u32)
            .map(|i| vec![i as u8; i as usize % 5])
            .collect();
        let mut pieces: Vec<_> = many.iter().map(|piece| IoSlice::new(piece)).collect();
        file.append(&mut pieces).unwrap();
        let mut read = Vec::new();
        file.rewind().unwrap();
        io::Read::read_to_end(&mut file, &mut read).unwrap();
        assert!(read == many.concat());
    }
}
