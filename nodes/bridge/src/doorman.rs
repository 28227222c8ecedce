//! The doorman: who may look.
//!
//! Every web page that a browser shows can connect to a port of this machine, and would see all images and turn all
//! parameters. Browsers say which page it is (`Origin`, RFC 6455 section 10.2), programs say none. The server's library
//! does not ask, so it listens where no page can guess, at a random address of the loopback, and the doorman in front of it
//! lets through whose origin is welcome. Others get 403, and a sentence is said.

use std::collections::BTreeSet;
use std::hash::{BuildHasher, RandomState};
use std::io::{self, Read, Write};
use std::net::{IpAddr, Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, Sender, bounded};

/// Pages of public viewers, and what their desktop applications say: they are loaded from files.
const VIEWERS: &[&str] = &[
    "https://app.foxglove.dev",
    "https://lichtblick-suite.github.io",
    "file://",
];

/// Bytes that a request may have before its headers end.
const LONGEST_HEAD: usize = 16 * 1024;
/// Headers that a request may have.
const MOST_HEADERS: usize = 64;
/// How long a request may take to be said.
const PATIENCE: Duration = Duration::from_secs(10);
/// Connections at once; further ones are closed.
const MOST_CONNECTIONS: usize = 64;
/// Sentences that may wait to be said; further ones are left out.
const MOST_SENTENCES: usize = 64;

/// Stands at the door until dropped.
#[derive(Debug)]
pub(crate) struct Doorman {
    address: SocketAddr,
    house: Arc<House>,
    sentences: Receiver<String>,
    thread: Option<JoinHandle<()>>,
}

/// What all connections share.
#[derive(Debug)]
struct House {
    /// Where the server is.
    server: SocketAddr,
    /// Origins that are welcome besides.
    origins: Vec<String>,
    /// Who has been let in.
    guests: Mutex<BTreeSet<SocketAddr>>,
    say: Sender<String>,
    is_closed: AtomicBool,
}

/// Where the server may listen that nobody knows: any address of the loopback, where the system has more than one.
pub(crate) fn hidden() -> IpAddr {
    if !cfg!(target_os = "linux") {
        return Ipv4Addr::LOCALHOST.into();
    }
    let [a, b, c, ..] = RandomState::new().hash_one("server").to_ne_bytes();
    // Neither the network's own address nor that of all.
    Ipv4Addr::new(127, a, b, c.clamp(2, 254)).into()
}

impl Doorman {
    /// Lets viewers from where `door` listens to the server.
    pub(crate) fn stand(
        door: TcpListener,
        server: SocketAddr,
        origins: &[String],
    ) -> io::Result<Self> {
        let (say, sentences) = bounded(MOST_SENTENCES);
        let house = Arc::new(House {
            server,
            origins: origins.to_vec(),
            guests: Mutex::default(),
            say,
            is_closed: AtomicBool::new(false),
        });
        let address = door.local_addr()?;
        let thread = thread::Builder::new().name("doorman".to_owned()).spawn({
            let house = Arc::clone(&house);
            move || house.keep(&door)
        })?;
        Ok(Self {
            address,
            house,
            sentences,
            thread: Some(thread),
        })
    }

    /// Whether somebody has been let in.
    pub(crate) fn knows(&self, guest: &SocketAddr) -> bool {
        self.house.guests().contains(guest)
    }

    /// What is to be said of those who were not let in.
    pub(crate) fn sentences(&self) -> impl Iterator<Item = String> + '_ {
        self.sentences.try_iter()
    }
}

impl Drop for Doorman {
    fn drop(&mut self) {
        self.house.is_closed.store(true, Ordering::Release);
        // It waits for somebody to come.
        let woken = TcpStream::connect_timeout(&reachable(self.address), Duration::from_secs(1));
        if let (Ok(_), Some(thread)) = (woken, self.thread.take()) {
            // A panic has been told where it happened.
            thread.join().unwrap_or_default();
        }
    }
}

/// Where something that listens at all addresses is found.
fn reachable(address: SocketAddr) -> SocketAddr {
    let ip = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => std::net::Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, address.port())
}

impl House {
    fn guests(&self) -> MutexGuard<'_, BTreeSet<SocketAddr>> {
        self.guests.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes whoever comes, each on a thread of its own.
    fn keep(self: &Arc<Self>, door: &TcpListener) {
        let connections = Arc::new(());
        loop {
            let Ok((viewer, address)) = door.accept() else {
                // Too many open files, or a connection that broke off: others may come.
                thread::sleep(Duration::from_millis(10));
                continue;
            };
            if self.is_closed.load(Ordering::Acquire) {
                return;
            }
            if Arc::strong_count(&connections) > MOST_CONNECTIONS {
                continue;
            }
            let (house, connection) = (Arc::clone(self), Arc::clone(&connections));
            let spawned = thread::Builder::new()
                .name("viewer".to_owned())
                .spawn(move || {
                    // Whatever breaks, it is the end of this connection only.
                    house.receive(&viewer, address).unwrap_or_default();
                    viewer.shutdown(Shutdown::Both).unwrap_or_default();
                    house.guests().remove(&address);
                    drop(connection);
                });
            if let Err(error) = spawned {
                self.tell(format!(
                    "a viewer at {address} could not be let in: {error}"
                ));
            }
        }
    }

    fn tell(&self, sentence: String) {
        // Whoever knocks without end is not told of without end.
        self.say.try_send(sentence).unwrap_or_default();
    }

    /// Asks who it is, and carries what is said from one to the other.
    fn receive(&self, viewer: &TcpStream, address: SocketAddr) -> io::Result<()> {
        let asked = head(viewer)?.and_then(|head| Some((origins(&head)?, head)));
        let Some((origins, head)) = asked else {
            return refuse(viewer, "400 Bad Request", "This is no WebSocket request.");
        };
        if let Some(stranger) = origins
            .iter()
            .find(|origin| !is_welcome(origin, &self.origins))
        {
            self.tell(format!(
                "a page of {stranger} wanted to look and was refused: if it is your viewer, add --origin {stranger}, or to \
                 bridge.origins in the graph file"
            ));
            return refuse(
                viewer,
                "403 Forbidden",
                "Pages of this origin may not look: tricurve view --origin allows it.",
            );
        }
        let mut server = TcpStream::connect(self.server)?;
        for stream in [viewer, &server] {
            stream.set_nodelay(true)?;
        }
        viewer.set_read_timeout(None)?;
        server.write_all(&head)?;
        self.guests().insert(address);
        let (mut from, mut to) = (server.try_clone()?, viewer.try_clone()?);
        let answers = thread::Builder::new()
            .name("answers".to_owned())
            .spawn(move || {
                io::copy(&mut from, &mut to).unwrap_or_default();
                to.shutdown(Shutdown::Both).unwrap_or_default();
            })?;
        let mut viewer = viewer;
        io::copy(&mut viewer, &mut server).unwrap_or_default();
        server.shutdown(Shutdown::Both)?;
        answers.join().unwrap_or_default();
        Ok(())
    }
}

/// What is said before the request's body; nothing where it is too long or breaks off.
fn head(mut viewer: &TcpStream) -> io::Result<Option<Vec<u8>>> {
    let until = Instant::now() + PATIENCE;
    let (mut head, mut part) = (Vec::new(), [0; 2048]);
    loop {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() || head.len() > LONGEST_HEAD {
            return Ok(None);
        }
        viewer.set_read_timeout(Some(left))?;
        let count = viewer.read(&mut part)?;
        head.extend_from_slice(&part[..count]);
        if head.windows(4).any(|end| end == b"\r\n\r\n") {
            return Ok(Some(head));
        }
        if count == 0 {
            return Ok(None);
        }
    }
}

/// The origins that a request's head names, if it is one.
fn origins(head: &[u8]) -> Option<Vec<String>> {
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    let is_whole = request.parse(head).ok()?.is_complete();
    let named = request.headers.iter();
    let named = named.filter(|header| header.name.eq_ignore_ascii_case("origin"));
    let origins = named.map(|header| String::from_utf8_lossy(header.value).trim().to_owned());
    is_whole.then(|| origins.collect())
}

/// Whether pages of an origin may look: those of this machine, those of public viewers, and those named.
fn is_welcome(origin: &str, named: &[String]) -> bool {
    let same = |known: &str| {
        known
            .trim_end_matches('/')
            .eq_ignore_ascii_case(origin.trim_end_matches('/'))
    };
    is_local(origin)
        || VIEWERS.iter().any(|viewer| same(viewer))
        || named.iter().any(|known| known == "*" || same(known))
}

/// Whether an origin is a page that this machine serves.
fn is_local(origin: &str) -> bool {
    let rest = ["http://", "https://"]
        .iter()
        .find_map(|scheme| origin.strip_prefix(scheme));
    let Some(authority) = rest else {
        return false;
    };
    let (host, port) = match authority.rsplit_once(':') {
        Some((host, port)) if !port.contains(']') => (host, port),
        _ => (authority, "80"),
    };
    let name = host.trim_start_matches('[').trim_end_matches(']');
    let is_loopback = name.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback());
    port.parse::<u16>().is_ok() && (is_loopback || name.eq_ignore_ascii_case("localhost"))
}

/// Sends somebody away.
fn refuse(mut viewer: &TcpStream, status: &str, why: &str) -> io::Result<()> {
    let length = why.len() + 1;
    let answer = format!(
        "HTTP/1.1 {status}\r\nContent-Type: text/plain\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{why}\n"
    );
    viewer.write_all(answer.as_bytes())
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    /// A doorman before a server that sends back what it gets.
    fn door(origins: &[&str]) -> Doorman {
        let server = TcpListener::bind((hidden(), 0)).unwrap();
        let address = server.local_addr().unwrap();
        thread::spawn(move || {
            for stream in server.incoming() {
                let mut stream = stream.unwrap();
                thread::spawn(move || {
                    let mut back = stream.try_clone().unwrap();
                    io::copy(&mut stream, &mut back).unwrap_or_default();
                });
            }
        });
        let door = TcpListener::bind("127.0.0.1:0").unwrap();
        let origins: Vec<String> = origins.iter().map(|&origin| origin.to_owned()).collect();
        Doorman::stand(door, address, &origins).unwrap()
    }

    fn ask(door: &Doorman, headers: &str) -> (TcpStream, String) {
        let mut stream = TcpStream::connect(door.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(stream, "GET / HTTP/1.1\r\nHost: here\r\n{headers}\r\n").unwrap();
        let mut answer = [0; 4096];
        let count = stream.read(&mut answer).unwrap();
        let answer = String::from_utf8_lossy(&answer[..count]).into_owned();
        (stream, answer)
    }

    #[test]
    fn programs_this_machines_pages_and_viewers_are_let_in_and_what_they_say_comes_through() {
        let door = door(&["https://viewer.example:8443/"]);
        for origin in [
            "",
            "Origin: http://localhost:8080\r\n",
            "Origin: http://127.0.0.5\r\n",
            "Origin: http://[::1]:8080\r\n",
            "Origin: https://app.foxglove.dev\r\n",
            "origin: https://lichtblick-suite.github.io\r\n",
            "Origin: file://\r\n",
            "Origin: https://viewer.example:8443\r\n",
        ] {
            let (mut stream, answer) = ask(&door, origin);
            assert!(answer.starts_with("GET / "), "{origin}: {answer}");
            assert!(door.knows(&stream.local_addr().unwrap()));
            stream.write_all(&[7; 100_000]).unwrap();
            let mut back = vec![0; 100_000];
            stream.read_exact(&mut back).unwrap();
            assert!(back.iter().all(|&byte| byte == 7));
        }
        assert_eq!(door.sentences().count(), 0);
    }

    #[test]
    fn pages_of_strangers_get_403_and_are_told_of() {
        let door = door(&[]);
        for stranger in [
            "https://evil.example",
            "null",
            "http://localhost.evil.example",
            "http://127.0.0.1.evil.example",
            "http://evil.example:80@localhost:1",
            "https://app.foxglove.dev.evil.example",
            "https://viewer.example:8443",
            "http://[::1].evil.example",
            "localhost",
        ] {
            let (stream, answer) = ask(&door, &format!("Origin: {stranger}\r\n"));
            assert!(answer.starts_with("HTTP/1.1 403 "), "{stranger}: {answer}");
            assert!(!door.knows(&stream.local_addr().unwrap()));
            let said: Vec<String> = door.sentences().collect();
            assert!(said.len() == 1 && said[0].contains(stranger), "{said:?}");
        }
        // One of two is a stranger's.
        let both = "Origin: http://localhost\r\nOrigin: https://evil.example\r\n";
        assert!(ask(&door, both).1.starts_with("HTTP/1.1 403 "));
    }

    #[test]
    fn what_is_no_request_gets_400_and_the_door_stays_open() {
        let door = door(&[]);
        let long = format!("X: {}\r\n", "x".repeat(2 * LONGEST_HEAD));
        let many = "X: y\r\n".repeat(2 * MOST_HEADERS);
        for headers in [long, many, "no header\r\n".to_owned()] {
            let mut stream = TcpStream::connect(door.address).unwrap();
            let request = format!("GET / HTTP/1.1\r\n{headers}\r\n");
            // It may be refused before it has said all.
            stream.write_all(request.as_bytes()).unwrap_or_default();
            let mut answer = String::new();
            stream.read_to_string(&mut answer).unwrap_or_default();
            assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 400 "));
            assert!(!door.knows(&stream.local_addr().unwrap()));
        }
        assert!(ask(&door, "").1.starts_with("GET / "));
    }

    #[test]
    fn where_one_side_ends_the_other_hears_of_it() {
        let door = door(&[]);
        let (stream, _) = ask(&door, "");
        let address = stream.local_addr().unwrap();
        drop(stream);
        let until = Instant::now() + PATIENCE;
        while door.knows(&address) {
            assert!(Instant::now() < until, "the guest has gone");
            thread::sleep(Duration::from_millis(5));
        }
    }
}
