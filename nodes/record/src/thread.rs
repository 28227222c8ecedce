//! The writer's thread: compresses, writes and flushes while the node encodes the next scan.

use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, Sender, unbounded};
use messages::ledger::Ledger;

use crate::writer::Written;
use crate::{Batch, WriteError, Writer};

/// A scan is written and flushed, or cannot be.
#[derive(Debug)]
pub struct Report {
    /// The scan.
    pub sequence: u64,
    /// Bytes it takes in the file.
    pub result: Result<u64, WriteError>,
    /// What compressing, writing and flushing took.
    pub duration: Duration,
    /// The batch, to be used again.
    pub batch: Batch,
}

/// A writer at work in a thread of its own.
#[derive(Debug)]
pub struct WriterThread {
    batches: Sender<Batch>,
    reports: Receiver<Report>,
    thread: JoinHandle<Writer>,
}

/// Lets a writer work in a thread of its own; `notify` is called in it after each report.
///
/// # Errors
/// When the system gives no thread.
pub fn spawn(
    mut writer: Writer,
    mut notify: impl FnMut() + Send + 'static,
) -> std::io::Result<WriterThread> {
    // The door bounds how many scans are under way.
    let (batches, jobs) = unbounded::<Batch>();
    let (done, reports) = unbounded();
    let work = move || {
        for batch in jobs {
            let start = Instant::now();
            let result = writer.write(&batch);
            let (sequence, duration) = (batch.sequence(), start.elapsed());
            // Nobody listens any more when the node is about to finish: what is written is written.
            drop(done.send(Report {
                sequence,
                result,
                duration,
                batch,
            }));
            notify();
        }
        writer
    };
    let thread = std::thread::Builder::new()
        .name("record".to_owned())
        .spawn(work)?;
    Ok(WriterThread {
        batches,
        reports,
        thread,
    })
}

impl WriterThread {
    /// Hands over a scan.
    pub fn write(&self, batch: Batch) {
        // The thread ends when this sender does, not before.
        drop(self.batches.send(batch));
    }

    /// What became of the scans handed over, in order.
    pub fn reports(&self) -> &Receiver<Report> {
        &self.reports
    }

    /// Waits until all scans are written, then finishes the recording.
    ///
    /// # Errors
    /// As [`Writer::write`] and [`Writer::finish`].
    pub fn finish(self, ledger: Option<&Ledger>) -> Result<Written, WriteError> {
        drop(self.batches);
        match self.thread.join() {
            Ok(writer) => {
                for report in self.reports.try_iter() {
                    report.result?;
                }
                writer.finish(ledger)
            }
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}
