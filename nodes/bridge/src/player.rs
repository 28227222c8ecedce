//! A recording for viewers: played, paused and sought in as they say, scan by scan, as it was recorded.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use messages::record::WHOLE;
use messages::recording::{ReadError, Recording};

use crate::Settings;
use crate::server::{Offer, Offered, Playback, ServeError, Server};

/// Why a recording cannot be played to viewers.
#[derive(Debug, thiserror::Error)]
pub enum PlayerError {
    /// It cannot be served.
    #[error(transparent)]
    Serve(#[from] ServeError),
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// There is nothing to show.
    #[error("{0} holds no scan")]
    Empty(String),
}

/// How often viewers are told where it is, and it is looked whether to end.
const TICK: Duration = Duration::from_millis(40);

/// Scans before one that is sought in which the last of what is not said with every scan is looked for.
const MOST_BEFORE: usize = 64;

/// How long after the newest subscription the first play begins: viewers subscribe to topic after topic.
const SETTLED: Duration = Duration::from_millis(300);

/// What whoever serves it wants of how it plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Press {
    /// Stop, or go on; after the end from the beginning.
    Pause,
    /// Show the next scan, and stop there.
    Step,
    /// Show the one before, and stop there.
    Back,
    /// Play twice as fast.
    Faster,
    /// Play half as fast.
    Slower,
}

/// A recording, shown to viewers, and where it is.
pub struct Player {
    server: Server,
    clock: Instant,
    /// Until somebody has subscribed time stands still, so that whoever comes late sees all.
    is_awaited: bool,
    /// When somebody subscribed last.
    subscribed: Option<Instant>,
    film: Film,
}

impl std::fmt::Debug for Player {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Player").field(&self.film).finish()
    }
}

impl Player {
    /// Begins to serve a recording, at its first scan.
    ///
    /// # Errors
    /// When nothing can be served, or the recording holds nothing.
    pub fn start(
        recording: Recording,
        settings: &Settings,
        is_paused: bool,
        how: &'static str,
    ) -> Result<Self, PlayerError> {
        let film = Film::new(recording)?;
        let playback = Playback {
            is_playing: !is_paused,
            speed: 1.0,
            nanos: film.first(),
            seek: Some(film.first()),
            has_ended: false,
            is_asked: false,
        };
        let offer = Offer {
            name: film.recording.path().display().to_string(),
            topics: film.topics(),
            is_graph: false,
            playback: Some((playback, (film.first(), film.last()))),
            how,
        };
        Ok(Self {
            server: Server::start(settings, offer)?,
            clock: Instant::now(),
            is_awaited: true,
            subscribed: None,
            film,
        })
    }

    /// Where viewers find it.
    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// What is to be said now of viewers: who was not let in, and who is too slow.
    pub fn remarks(&mut self) -> Vec<String> {
        self.server.remarks()
    }

    /// Scans that viewers did not get whole, of those they were to get.
    pub fn missed(&self) -> (u64, u64) {
        self.server.missed()
    }

    /// Does what viewers want and shows what is due; waits a moment when there is nothing.
    ///
    /// # Errors
    /// When the recording cannot be read.
    pub fn turn(&mut self) -> Result<(), PlayerError> {
        let timeout = self.film.until_next(&self.server).min(TICK);
        // What is wished stands in the server: here it is only waited for.
        if self.server.wishes().recv_timeout(timeout).is_ok() {
            self.server.wishes().try_iter().for_each(drop);
        }
        let nanos = self.server.playback().nanos;
        self.server.greet(nanos);
        let now = Instant::now();
        let has_new = self.server.has_new_subscriptions();
        if has_new && self.server.has_subscriptions() {
            self.subscribed = Some(now);
        }
        let has_settled = self.subscribed.is_some_and(|since| now - since >= SETTLED);
        self.is_awaited &= !has_settled && !self.server.playback().is_asked;
        // Whoever comes while nothing moves sees where it stands.
        self.film.is_due |= has_new && !self.film.was_playing;
        self.film
            .play(&mut self.server, now - self.clock, self.is_awaited)?;
        self.clock = now;
        Ok(())
    }

    /// Plays otherwise, and tells viewers so. Gives what it does now, in words.
    pub fn press(&mut self, press: Press) -> String {
        self.is_awaited = false;
        let is_sought = {
            let mut playback = self.server.playback();
            let sought = match press {
                Press::Pause => {
                    playback.is_playing = !playback.is_playing;
                    (playback.is_playing && playback.has_ended).then_some(0)
                }
                Press::Step => Some((self.film.shown + 1).min(self.film.scans.len() - 1)),
                Press::Back => Some(self.film.shown.saturating_sub(1)),
                Press::Faster | Press::Slower => {
                    let factor = if press == Press::Faster { 2.0 } else { 0.5 };
                    playback.speed = (playback.speed * factor).clamp(0.001, 1000.0);
                    None
                }
            };
            if let Some(scan) = sought {
                playback.is_playing &= press == Press::Pause;
                playback.nanos = self.film.scans[scan].1;
                playback.seek = Some(playback.nanos);
                playback.has_ended = false;
            }
            sought.is_some()
        };
        self.server.tell_playback(is_sought);
        self.state()
    }

    /// What it does, in words: whether it plays, where it is, and how fast.
    pub fn state(&self) -> String {
        let playback = self.server.playback();
        let at = self.film.scan_at(playback.nanos);
        let does = match (playback.is_playing, playback.has_ended) {
            (_, true) => "at its end",
            (true, _) => "playing",
            (false, _) => "paused",
        };
        format!(
            "{does}: scan {} of {}, {:.1} of {:.1} s, rate {}",
            at + 1,
            self.film.scans.len(),
            playback.nanos.saturating_sub(self.film.first()) as f64 / 1e9,
            (self.film.last() - self.film.first()) as f64 / 1e9,
            playback.speed
        )
    }

    /// Whether it waits for somebody to subscribe before it begins.
    pub fn is_awaited(&self) -> bool {
        self.is_awaited && self.server.playback().is_playing
    }
}

/// A recording, and where it is.
#[derive(Debug)]
struct Film {
    recording: Recording,
    /// Scans with their times, in order of time.
    scans: Vec<(u64, u64)>,
    /// Index of each topic.
    indices: BTreeMap<String, usize>,
    /// The scan that was shown last.
    shown: usize,
    /// Whether that one is to be shown as soon as a viewer has room for it: of many seeks at once the last one counts.
    is_due: bool,
    /// Whether that one was left out, since no viewer had room for it.
    is_left_out: bool,
    was_playing: bool,
}

impl Film {
    fn new(recording: Recording) -> Result<Self, PlayerError> {
        let nanos = |scan| Some((scan, recording.nanos(scan)?));
        let mut scans: Vec<(u64, u64)> = recording.scans().filter_map(nanos).collect();
        scans.sort_by_key(|(scan, nanos)| (*nanos, *scan));
        if scans.is_empty() {
            return Err(PlayerError::Empty(recording.path().display().to_string()));
        }
        let definitions = recording.definitions();
        let names = definitions.iter().map(|(topic, ..)| (*topic).to_owned());
        Ok(Self {
            indices: names.zip(0..).collect(),
            scans,
            shown: 0,
            is_due: false,
            is_left_out: false,
            was_playing: false,
            recording,
        })
    }

    /// When its first scan was taken, in nanoseconds since 1970.
    fn first(&self) -> u64 {
        self.scans.first().map_or(0, |(_, nanos)| *nanos)
    }

    /// When its last scan was taken.
    fn last(&self) -> u64 {
        self.scans.last().map_or(0, |(_, nanos)| *nanos)
    }

    /// The scan to be seen at a time: the last one taken until then, or the first.
    fn scan_at(&self, nanos: u64) -> usize {
        let until = self.scans.partition_point(|(_, taken)| *taken <= nanos);
        until.saturating_sub(1)
    }

    fn topics(&self) -> Vec<Offered> {
        let definitions = self.recording.definitions();
        let offered = |(topic, encoding, schema): (&str, &str, Option<&_>)| {
            let schema: Option<&messages::recording::FileSchema> = schema;
            Offered {
                topic: topic.to_owned(),
                encoding: encoding.to_owned(),
                schema: schema.map_or(String::new(), |schema| schema.name.clone()),
                schema_encoding: schema.map_or(String::new(), |schema| schema.encoding.clone()),
                schema_data: schema.map_or(Vec::new(), |schema| schema.data.clone()),
            }
        };
        definitions.into_iter().map(offered).collect()
    }

    /// How long until the next scan is due.
    fn until_next(&self, server: &Server) -> Duration {
        let playback = server.playback();
        let next = self.scans.get(self.shown + 1);
        match (next, playback.is_playing) {
            (Some((_, nanos)), true) => {
                let ahead = nanos.saturating_sub(playback.nanos);
                Duration::from_secs_f64(ahead as f64 / 1e9 / f64::from(playback.speed))
            }
            _ => TICK,
        }
    }

    /// Lets so much time pass, unless viewers are waited for, and shows what then is to be seen.
    fn play(
        &mut self,
        server: &mut Server,
        elapsed: Duration,
        is_awaited: bool,
    ) -> Result<(), PlayerError> {
        let last = self.last();
        let is_sought = server.playback().seek.is_some();
        // What was sought last is to be seen first, while that is on its way others may be sought.
        if is_sought && !server.has_room() {
            return Ok(());
        }
        let (target, is_sought, is_playing) = {
            let mut playback = server.playback();
            let seek = playback.seek.take();
            playback.is_asked = false;
            let is_playing = playback.is_playing && !is_awaited;
            if let Some(nanos) = seek {
                playback.nanos = nanos.clamp(self.first(), last);
            } else if is_playing && playback.has_ended {
                // Played again after its end: from the beginning.
                playback.nanos = self.first();
                playback.has_ended = false;
            } else if is_playing && self.was_playing {
                let passed = elapsed.as_secs_f64() * f64::from(playback.speed) * 1e9;
                playback.nanos = playback.nanos.saturating_add(passed as u64).min(last);
            }
            (playback.nanos, seek.is_some(), is_playing)
        };
        self.was_playing = is_playing;
        let scan = self.scan_at(target);
        if is_sought || scan < self.shown {
            self.shown = scan;
            self.is_due = true;
        } else {
            // Every scan on the way, unless viewers have not taken those before.
            while self.shown < scan {
                self.shown += 1;
                match server.admit() {
                    true => self.show(server)?,
                    false => self.is_left_out = true,
                }
            }
        }
        // Where it stops is seen, even by who was too slow for it.
        let is_due = self.is_due || self.is_left_out && !is_playing;
        if is_due && server.has_room() {
            self.show(server)?;
        }
        if is_playing {
            server.time(target);
        }
        if is_playing && target >= last && !is_sought {
            {
                let mut playback = server.playback();
                playback.is_playing = false;
                playback.has_ended = true;
            }
            self.was_playing = false;
            server.tell_playback(false);
        }
        Ok(())
    }

    /// Sends the scan that is to be seen, as far as somebody is subscribed.
    fn show(&mut self, server: &mut Server) -> Result<(), PlayerError> {
        let is_sought = self.is_due;
        (self.is_due, self.is_left_out) = (false, false);
        let (scan, nanos) = self.scans[self.shown];
        let is_wanted = |topic: &str| {
            let index = self.indices.get(topic);
            index.is_some_and(|index| server.is_wanted(*index))
        };
        let wanted: Vec<bool> = self.indices.keys().map(|topic| is_wanted(topic)).collect();
        server.time(nanos);
        if !wanted.contains(&true) {
            return Ok(());
        }
        let scan = self.recording.scan_of(scan, |topic| is_wanted(topic))?;
        for (topic, message) in scan.messages() {
            if let Some(index) = self.indices.get(topic) {
                server.send(*index, nanos, message);
            }
        }
        // Of what is not said with every scan whoever came here by a seek sees the last there was.
        let is_said = scan.messages().any(|(topic, _)| topic == WHOLE);
        self.recording.reuse(scan);
        let whole = self.indices.get(WHOLE).copied();
        if let Some(index) = whole.filter(|index| is_sought && !is_said && server.is_wanted(*index))
        {
            self.show_whole(index, server)?;
        }
        Ok(())
    }

    /// Sends the last map that the scans before had.
    fn show_whole(&mut self, index: usize, server: &mut Server) -> Result<(), PlayerError> {
        let before = self.scans[..self.shown].iter().rev();
        for &(scan, nanos) in before.take(MOST_BEFORE) {
            let scan = self.recording.scan_of(scan, |topic| topic == WHOLE)?;
            let whole = scan.message(WHOLE).map(<[u8]>::to_vec);
            self.recording.reuse(scan);
            if let Some(whole) = whole {
                server.send(index, nanos, &whole);
                break;
            }
        }
        Ok(())
    }
}
