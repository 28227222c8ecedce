//! Listens to what is asked of the running graph from outside, at a socket in the run's folder.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use crossbeam::channel::{RecvTimeoutError, Sender, bounded};
use messages::bus::{Answer, Ask, LONGEST_LINE, socket_of};

/// Who may ask at the same time; the folder is the user's own, and each has a thread.
const MOST_ASKERS: usize = 32;
/// How long an asker may take to say its line, and to take its answer.
const PATIENCE: Duration = Duration::from_secs(60);

/// A question, and where its answer goes.
pub(crate) type Asked = (Ask, Sender<Answer>);

/// Hands what is asked to `tell`, each from a thread of its own, until that says false.
pub(crate) fn listen(
    run: &Path,
    tell: impl Fn(Asked) -> bool + Clone + Send + 'static,
) -> io::Result<()> {
    let listener = UnixListener::bind(socket_of(run))?;
    let askers = Arc::new(AtomicUsize::new(0));
    let listen = move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let (tell, askers) = (tell.clone(), Arc::clone(&askers));
            if askers.fetch_add(1, Ordering::Relaxed) >= MOST_ASKERS {
                askers.fetch_sub(1, Ordering::Relaxed);
                continue;
            }
            let serve = move || {
                // An asker that goes away needs no answer.
                serve(&stream, &tell).unwrap_or_default();
                askers.fetch_sub(1, Ordering::Relaxed);
            };
            if std::thread::Builder::new()
                .name("asked".to_owned())
                .spawn(serve)
                .is_err()
            {
                return;
            }
        }
    };
    std::thread::Builder::new()
        .name("asks".to_owned())
        .spawn(listen)?;
    Ok(())
}

/// Answers line by line until the asker has gone.
fn serve(stream: &UnixStream, tell: &impl Fn(Asked) -> bool) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut lines = BufReader::new(stream);
    loop {
        let mut line = String::new();
        if (&mut lines).take(LONGEST_LINE).read_line(&mut line)? == 0 {
            return Ok(());
        }
        let answer = match serde_json::from_str(&line) {
            Err(error) => Answer::Refused {
                why: format!("cannot read what is asked: {error}"),
            },
            Ok(ask) => answered(ask, tell),
        };
        let mut out = serde_json::to_vec(&answer)?;
        out.push(b'\n');
        (&mut (&*stream)).write_all(&out)?;
    }
}

/// The answer, or why there is none.
fn answered(ask: Ask, tell: &impl Fn(Asked) -> bool) -> Answer {
    let patience = ask.patience();
    let (reply, answer) = bounded(1);
    // Who is not told drops the reply, as one does who ends.
    tell((ask, reply));
    answer.recv_timeout(patience).unwrap_or_else(|error| {
        let why = match error {
            RecvTimeoutError::Disconnected => "the graph is ending".to_owned(),
            RecvTimeoutError::Timeout => format!(
                "it was not done within {} s, and may still be: `tricurve top` says which node stands still",
                patience.as_secs()
            ),
        };
        Answer::Refused { why }
    })
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn a_graph_that_ends_is_told_from_one_that_takes_too_long() {
        let ends = |_| false;
        let why = |answer| match answer {
            Answer::Refused { why } => why,
            answer => format!("{answer:?}"),
        };
        assert_eq!(why(answered(Ask::State, &ends)), "the graph is ending");
        let kept = Mutex::new(None);
        let hangs = |asked| kept.lock().unwrap().replace(asked).is_none();
        let why = why(answered(Ask::State, &hangs));
        assert!(why.starts_with("it was not done within 5 s"), "{why}");
    }
}
