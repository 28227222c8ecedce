//! Writes the scans that come now to a file of their own, beside the running graph: a recorder of its own, so that the run
//! waits for nothing.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use crossbeam::channel::{Sender, bounded};
use jiff::Timestamp;
use messages::bus::Answer;
use rustix::process::{Pid, Signal, kill_process};

/// Scans a snapshot holds.
const SCANS: &str = "1";
/// How long it may take until a scan comes; less than [`Ask::patience`](messages::bus::Ask::patience) of a snapshot.
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
    let child = Command::new(std::env::current_exe().map_err(|e| refused(&e))?)
        .args(["record", "--json", "--scans", SCANS, "--output"])
        .arg(&file)
        .arg("--run")
        .arg(name)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| refused(&e))?;
    let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
    let reply = reply.clone();
    let wait = move || {
        let (teller, ended) = bounded(1);
        std::thread::scope(|scope| {
            scope.spawn(move || teller.send(child.wait_with_output()));
            let ended_in_time = ended.recv_timeout(PATIENCE);
            if ended_in_time.is_err()
                && let Some(pid) = pid
            {
                kill_process(pid, Signal::INT).unwrap_or_default();
            }
            let answer = match ended_in_time {
                Ok(Ok(output)) if output.status.success() => Answer::Done {
                    text: file.display().to_string(),
                },
                Ok(Ok(output)) => {
                    let why = String::from_utf8_lossy(&output.stderr).trim().to_owned();
                    Answer::Refused { why }
                }
                Ok(Err(error)) => refused(&error),
                Err(_) => {
                    ended.recv().map(drop).unwrap_or_default();
                    std::fs::remove_file(&file).unwrap_or_default();
                    let why = format!("no scan came within {} s", PATIENCE.as_secs());
                    Answer::Refused { why }
                }
            };
            reply.send(answer).unwrap_or_default();
        });
    };
    std::thread::Builder::new()
        .name("snapshot".to_owned())
        .spawn(wait)
        .map_err(|e| refused(&e))?;
    Ok(())
}
