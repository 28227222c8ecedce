//! Writes the scans that come now to a file of their own, beside the running graph: a recorder of its own, so that the run
//! waits for nothing.

use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crossbeam::channel::Sender;
use jiff::Timestamp;
use messages::bus::Answer;
use rustix::process::{Pid, Signal, kill_process};

/// Scans a snapshot holds.
const SCANS: &str = "1";
/// How long it may take until a scan comes.
const PATIENCE: Duration = Duration::from_secs(30);

/// Takes a snapshot of the run with this folder; the answer comes when it is written.
///
/// # Errors
/// The answer, when it cannot be begun.
pub(crate) fn take(run: &Path, reply: &Sender<Answer>) -> Result<(), Answer> {
    let refused = |error: &dyn std::fmt::Display| Answer::Refused {
        why: format!("cannot take a snapshot: {error}"),
    };
    std::fs::create_dir_all("recordings").map_err(|e| refused(&e))?;
    let now = Timestamp::now().strftime("%Y%m%d-%H%M%S-%3f");
    let file = Path::new("recordings").join(format!("snapshot-{now}.mcap"));
    let name = run.file_name().unwrap_or_default();
    let mut child = Command::new(std::env::current_exe().map_err(|e| refused(&e))?)
        .args(["record", "--json", "--scans", SCANS, "--output"])
        .arg(&file)
        .arg("--run")
        .arg(name)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| refused(&e))?;
    let reply = reply.clone();
    let wait = move || {
        let deadline = Instant::now() + PATIENCE;
        let status = loop {
            match child.try_wait() {
                Ok(Some(status)) => break Some(status),
                Ok(None) if Instant::now() < deadline => {
                    std::thread::sleep(Duration::from_millis(20));
                }
                _ => break None,
            }
        };
        let answer = match status {
            Some(status) if status.success() => Answer::Done {
                text: file.display().to_string(),
            },
            Some(_) => {
                let mut said = String::new();
                if let Some(out) = &mut child.stderr {
                    out.read_to_string(&mut said).map(drop).unwrap_or_default();
                }
                let why = said.trim().to_owned();
                Answer::Refused { why }
            }
            None => {
                if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
                    kill_process(pid, Signal::INT).unwrap_or_default();
                }
                child.wait().map(drop).unwrap_or_default();
                std::fs::remove_file(&file).unwrap_or_default();
                let why = "no scan came in time".to_owned();
                Answer::Refused { why }
            }
        };
        reply.send(answer).unwrap_or_default();
    };
    std::thread::Builder::new()
        .name("snapshot".to_owned())
        .spawn(wait)
        .map_err(|e| refused(&e))?;
    Ok(())
}
