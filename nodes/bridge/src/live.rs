//! A running graph for viewers: a guest of the graph, for whom nobody waits.

use std::collections::{BTreeMap, VecDeque};
use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant};

use crossbeam::channel::Select;
use foxglove::websocket::{ConnectionGraph, Parameter};
use messages::bus::{
    self, Answer, Ask, Bus, BusError, Doctor, Event, Guest, Joined, LOOK_EVERY, Log, Play, Playing,
    Reports, Run, State,
};
use messages::ledger::Ledger;
use messages::record::{Channel, Codec, Content, Encoder, Level, Shown, Sink};
use messages::{AnyView, Kind, Topic};
use serde_json::Value;

use crate::Settings;
use crate::server::{Call, Offer, Offered, Playback, ServeError, Server, Turn, Wish, parameter_of};

/// Why a running graph cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// It cannot be served.
    #[error(transparent)]
    Serve(#[from] ServeError),
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The system gives no thread.
    #[error("cannot start a thread: {0}")]
    Thread(std::io::Error),
}

/// What is shown, and how.
#[derive(Debug)]
pub struct Live<'a> {
    /// The running graph.
    pub run: &'a Run,
    /// Index of the view that disparities and points belong to.
    pub reference: usize,
    /// Where viewers find it.
    pub settings: &'a Settings,
    /// What to set when the port is taken.
    pub how: &'static str,
}

/// How often it is looked who listens, how things stand and what is said, while nobody is subscribed to a scan's topics.
const IDLE: Duration = Duration::from_millis(200);
/// Lines that are kept for who comes later.
const MOST_SAID: usize = 200;
/// How often viewers are told how things stand.
const STATE_EVERY: Duration = Duration::from_secs(1);

/// Turns parameters as viewers want, in a thread of its own: the launcher answers when every node has noted it, and scans
/// are shown meanwhile.
fn turn_parameters(run: &Run, server: &Server) -> Result<(), LiveError> {
    let (turns, wish, root) = (server.turns(), server.wish(), run.root.clone());
    let known = move |names: &[String]| -> Vec<Parameter> {
        let all = match bus::ask(&root, &Ask::State) {
            Ok(Answer::State(state)) => state.parameters,
            _ => Vec::new(),
        };
        let is_asked = |name: &String| names.is_empty() || names.contains(name);
        let asked = all.iter().filter(|parameter| is_asked(&parameter.name));
        asked.map(|p| parameter_of(&p.name, &p.value)).collect()
    };
    let root = run.root.clone();
    let serve = move || {
        while let Ok(first) = turns.recv() {
            let mut sets = Vec::new();
            // What has come meanwhile is set together: a slider that is drawn asks for much.
            for turn in std::iter::once(first).chain(turns.try_iter()) {
                match turn {
                    Turn::Get(names, responder) => responder.respond(known(&names)),
                    Turn::Set(values, client, responder) => sets.push((values, client, responder)),
                }
            }
            let mut all = BTreeMap::new();
            all.extend(sets.iter().flat_map(|(values, ..)| values.clone()));
            let is_done = sets.len() > 1 && set(&root, all).is_none();
            for (values, client, responder) in sets {
                let names: Vec<String> = values.keys().cloned().collect();
                let refused = (!is_done).then(|| set(&root, values)).flatten();
                if let Some(why) = refused {
                    client.send_error(why);
                }
                // What was not taken shows its old value again.
                let now = known(&names);
                responder.respond(now.clone());
                if wish.send(Wish::Tell(now)).is_err() {
                    return;
                }
            }
        }
    };
    let thread = std::thread::Builder::new().name("parameters".to_owned());
    thread.spawn(serve).map(drop).map_err(LiveError::Thread)
}

/// Sets parameters otherwise; gives why not.
fn set(run: &Path, values: BTreeMap<String, Value>) -> Option<String> {
    match bus::ask(run, &Ask::Set { values }) {
        Ok(Answer::Refused { why }) => Some(why),
        Ok(Answer::Done { .. } | Answer::State(_) | Answer::Said { .. }) => None,
        Err(error) => Some(format!("the launcher does not answer: {error}")),
    }
}

/// How things stand, as the launcher says.
fn state_of(run: &Run, ask: &Ask) -> Option<State> {
    match bus::ask(&run.root, ask) {
        Ok(Answer::State(state)) => Some(*state),
        _ => None,
    }
}

fn playback_of(playing: &Playing, nanos: u64) -> Playback {
    Playback {
        is_playing: !playing.is_paused,
        speed: playing.rate.unwrap_or(1.0) as f32,
        nanos,
        seek: None,
        has_ended: false,
        is_asked: false,
    }
}

/// Who publishes and who takes which topic.
fn graph_of(run: &Run, channels: &[Channel]) -> ConnectionGraph {
    let mut graph = ConnectionGraph::new();
    for channel in channels {
        let Content::Data(Topic { kind, .. }) = &channel.content else {
            graph.set_published_topic(&channel.name, ["bridge"]);
            continue;
        };
        let named = |is: &dyn Fn(&bus::NodePlan) -> bool| -> Vec<String> {
            let nodes = run.nodes.iter().filter(|node| is(node));
            nodes.map(|node| node.name.clone()).collect()
        };
        let makers = named(&|node| node.makes.contains(kind));
        let takers = named(&|node| node.takes.contains(kind));
        graph.set_published_topic(&channel.name, makers);
        graph.set_subscribed_topic(&channel.name, takers);
    }
    for name in ["pause", "resume", "snapshot"] {
        graph.set_advertised_service(format!("tricurve/{name}"), ["launch"]);
    }
    graph
}

/// The kinds of message that what a channel carries is made of.
fn needs(content: &Content, made: &[Kind]) -> Vec<Kind> {
    let mut kinds = match content {
        Content::Data(topic) => vec![topic.kind],
        Content::Annotations(_) | Content::Labels(_) => {
            vec![Kind::Curves, Kind::Matches, Kind::Points]
        }
        Content::Rejected(_) => vec![Kind::Curves, Kind::Matches],
        Content::Picture(pictured) | Content::Legend(pictured) => pictured.kinds().to_vec(),
        Content::Whole => vec![Kind::Map],
        Content::Statistics => made.to_vec(),
        // They are said with every scan, whatever it holds.
        Content::Transforms | Content::Calibration(_) => made.iter().take(1).copied().collect(),
        Content::Digests
        | Content::Ledger
        | Content::Health
        | Content::Synchronisation
        | Content::Log => vec![],
    };
    kinds.retain(|kind| made.contains(kind));
    kinds
}

/// A running graph, shown to viewers.
pub struct Viewing<'a> {
    run: &'a Run,
    encoder: Encoder,
    out: Out,
    /// Joined while somebody is subscribed to what a scan holds.
    guest: Option<Guest>,
    kinds: Vec<Kind>,
    reports: Reports,
    ledger: Ledger,
    health: Doctor,
    state: State,
    /// What was said last, for who comes later.
    said: VecDeque<(Level, String, String)>,
    is_log_wanted: bool,
    next_state: Instant,
    /// Whether a scan had come when it was looked last: then there may be more.
    has_more: bool,
    /// Number and time of the last scan that was to be shown.
    last: Option<(u64, u64)>,
    /// Number of the first scan of where a viewer has sought, until that is shown.
    sought: Option<u64>,
    /// How many guests there were: each needs a name of its own.
    guests: u64,
}

impl std::fmt::Debug for Viewing<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Viewing")
            .field("run", &self.run)
            .field("kinds", &self.kinds)
            .finish_non_exhaustive()
    }
}

impl<'a> Viewing<'a> {
    /// Begins to serve.
    ///
    /// # Errors
    /// When nothing can be served, or the run has no room for a further guest.
    pub fn start(live: &Live<'a>) -> Result<Self, LiveError> {
        let Live {
            run,
            reference,
            settings,
            how,
        } = *live;
        let codec = Codec::new(run.rig.clone(), reference);
        let shown = Shown {
            cameras: run.cameras,
            ..Shown::ALL
        };
        let channels = codec.channels_of(shown, &run.kinds());
        // What is offered depends on how the source plays.
        let state = state_of(run, &Ask::Source).unwrap_or_default();
        let offered = |channel: &Channel| Offered {
            topic: channel.name.clone(),
            encoding: channel.schema.message_encoding().to_owned(),
            schema: channel.schema.name.clone(),
            schema_encoding: channel.schema.encoding.to_owned(),
            schema_data: channel.schema.data.clone(),
        };
        let playback = state.playing.and_then(|playing| {
            let span = playing.span.filter(|_| playing.is_recording)?;
            Some((playback_of(&playing, span.0), span))
        });
        let name = run.root.file_name().unwrap_or_default();
        let offer = Offer {
            name: format!("tricurve {}", name.to_string_lossy()),
            topics: channels.iter().map(offered).collect(),
            is_graph: true,
            playback,
            how,
        };
        let server = Server::start(settings, offer)?;
        server.tell_graph(graph_of(run, &channels));
        turn_parameters(run, &server)?;
        let mut viewing = Self {
            run,
            encoder: Encoder::new(codec, channels).standing_alone(),
            out: Out {
                server,
                nanos: 0,
                bytes: 0,
                message: Vec::new(),
            },
            guest: None,
            kinds: Vec::new(),
            reports: Guest::reports(run, &format!("view.{}.reports", std::process::id()))?,
            ledger: Ledger::default(),
            health: Doctor::default(),
            state,
            said: VecDeque::new(),
            is_log_wanted: false,
            next_state: Instant::now(),
            has_more: false,
            last: None,
            sought: None,
            guests: 0,
        };
        viewing.choose()?;
        Ok(viewing)
    }

    /// Where viewers find it.
    pub fn address(&self) -> SocketAddr {
        self.out.server.address()
    }

    /// What is to be said now of viewers: who was not let in, and who is too slow.
    pub fn remarks(&mut self) -> Vec<String> {
        self.out.server.remarks()
    }

    /// Scans that viewers did not get whole, of those they were to get.
    pub fn missed(&self) -> (u64, u64) {
        self.out.server.missed()
    }

    /// Waits a moment, or until viewers want something.
    pub fn wait(&self) {
        let mut wishes = Select::new();
        wishes.recv(self.out.server.wishes());
        let heard = wishes.ready_timeout(self.patience());
        heard.map(drop).unwrap_or_default();
    }

    /// Waits a moment, or until viewers or the launcher want something.
    pub(crate) fn wait_beside(&self, bus: &Bus) {
        bus.wait_beside(self.out.server.wishes(), self.patience());
    }

    fn patience(&self) -> Duration {
        match (self.has_more, self.out.server.has_subscriptions()) {
            (true, _) => Duration::ZERO,
            (false, true) => LOOK_EVERY,
            (false, false) => IDLE,
        }
    }

    /// Does what viewers want and sends what has come, of scans one, so that neither waits for the other.
    ///
    /// # Errors
    /// When the bus fails or a message is damaged.
    pub fn turn(&mut self) -> Result<(), LiveError> {
        while let Ok(wish) = self.out.server.wishes().try_recv() {
            self.hear(wish)?;
        }
        if self.out.server.has_new_subscriptions() {
            self.choose()?;
            self.say_again();
        }
        let nanos = self.nanos();
        self.out.server.greet(nanos);
        self.play();
        let scan = self.next_scan()?;
        self.has_more = scan.is_some();
        if let Some(scan) = scan {
            self.show(&scan)?;
        }
        while let Some(event) = self.reports.receive()? {
            self.report(event);
        }
        if self.next_state <= Instant::now() && self.out.server.has_viewers() {
            self.next_state = Instant::now() + STATE_EVERY;
            self.tell_state();
        }
        Ok(())
    }

    /// The oldest scan that waits on the bus, which holds as many as can be under way: who gets a processor now and then
    /// only, because the graph has them all, shows those that came meanwhile.
    fn next_scan(&mut self) -> Result<Option<Joined>, BusError> {
        let Some(guest) = &mut self.guest else {
            return Ok(None);
        };
        let before = guest.missed();
        let scan = guest.scan_now()?;
        let missed = guest.missed() - before;
        if missed > 0 {
            self.out.server.leave_out(missed);
        }
        Ok(scan)
    }

    fn hear(&mut self, wish: Wish) -> Result<(), LiveError> {
        match wish {
            // What stands in the server is looked at in any case, however many of them come.
            Wish::Look => {}
            Wish::Tell(parameters) => self.out.server.tell_parameters(parameters),
            Wish::Call(call, reply) => {
                let ask = match call {
                    Call::Pause => Ask::Play { play: Play::Stop },
                    Call::Resume => Ask::Play { play: Play::Resume },
                    Call::Snapshot => Ask::Snapshot,
                };
                // A snapshot takes its time, and scans go on meanwhile.
                let root = self.run.root.clone();
                let answer = move || {
                    let answer = match bus::ask(&root, &ask) {
                        Ok(Answer::Done { text }) => Ok(text),
                        Ok(Answer::Refused { why }) => Err(why),
                        Ok(Answer::State(_) | Answer::Said { .. }) => Ok(String::new()),
                        Err(error) => Err(format!("the launcher does not answer: {error}")),
                    };
                    reply.send(answer).unwrap_or_default();
                };
                std::thread::Builder::new()
                    .name("call".to_owned())
                    .spawn(answer)
                    .map(drop)
                    .unwrap_or_default();
            }
        }
        Ok(())
    }

    /// Lets the replay that is the source play as a viewer wants, if one does.
    fn play(&mut self) {
        let (playback, seek) = {
            let mut playback = self.out.server.playback();
            if !std::mem::take(&mut playback.is_asked) {
                return;
            }
            let seek = playback.seek.take();
            (*playback, seek)
        };
        let before = self.state.playing.unwrap_or_default();
        let mut plays = Vec::new();
        plays.extend(seek.map(Play::Seek));
        let speed = f64::from(playback.speed);
        if before.rate.unwrap_or(1.0) != speed {
            plays.push(Play::Rate(speed));
        }
        plays.push(match playback.is_playing {
            true => Play::Resume,
            false => Play::Stop,
        });
        // Sought in while it is paused, it shows where it is.
        if seek.is_some() && !playback.is_playing {
            plays.push(Play::Step);
        }
        for play in plays {
            match bus::ask(&self.run.root, &Ask::Play { play }) {
                Ok(Answer::Refused { why }) => self.log(Level::Warning, "bridge", &why),
                // The source has done so: how it plays is what the launcher says now.
                Ok(Answer::Done { .. } | Answer::State(_) | Answer::Said { .. }) => {}
                Err(error) => {
                    let line = format!("the launcher does not answer: {error}");
                    self.log(Level::Warning, "bridge", &line);
                }
            }
        }
        let Some(state) = state_of(self.run, &Ask::State) else {
            return;
        };
        let sought = state.playing.and_then(|playing| playing.sought_from);
        let is_sought = sought != before.sought_from;
        self.hear_state(state);
        if is_sought && self.guest.is_some() {
            // What is still on its way is of where it was, and told is where it is when that is seen.
            self.sought = sought;
            return;
        }
        if !is_sought {
            let span = self.state.playing.and_then(|playing| playing.span);
            let shown = self.last.map(|(_, nanos)| nanos);
            let stands = shown.or(span.map(|(first, _)| first));
            let mut playback = self.out.server.playback();
            playback.nanos = stands.unwrap_or(playback.nanos);
        }
        self.out.server.tell_playback(is_sought);
    }

    /// Listens to what somebody is subscribed to, and to nothing else but the map: whoever comes later sees all of it.
    fn choose(&mut self) -> Result<(), LiveError> {
        let made = self.run.kinds();
        let mut kinds = needs(&Content::Whole, &made);
        for (index, channel) in self.encoder.channels().iter().enumerate() {
            if self.out.server.is_wanted(index) {
                kinds.extend(needs(&channel.content, &made));
            }
        }
        kinds.sort_unstable();
        kinds.dedup();
        if kinds == self.kinds {
            return Ok(());
        }
        self.guest = None;
        if !kinds.is_empty() {
            self.guests += 1;
            let name = format!("view.{}.{}", std::process::id(), self.guests);
            self.guest = Some(Guest::join(self.run, &name, &kinds)?);
        }
        self.kinds = kinds;
        Ok(())
    }

    /// Sends a scan, as far as somebody is subscribed and has taken those before.
    fn show(&mut self, scan: &Joined) -> Result<(), BusError> {
        if self.sought.is_some_and(|sought| scan.sequence < sought) {
            return Ok(());
        }
        let nanos = scan.header().capture_nanos;
        self.last = Some((scan.sequence, nanos));
        {
            let mut playback = self.out.server.playback();
            // Where somebody has just asked to be it will be soon.
            if playback.seek.is_none() {
                playback.nanos = nanos;
            }
        }
        let views = scan.views()?;
        for (_, message) in &views {
            if let AnyView::Map(map) = message {
                self.encoder.recall(scan.sequence, *map);
            }
        }
        if self.out.server.has_subscriptions() && self.out.server.admit() {
            self.out.server.time(nanos);
            self.encoder.encode(&views, &mut self.out);
        }
        if self.sought.take().is_some() {
            self.out.server.tell_playback(true);
        }
        Ok(())
    }

    /// Takes in what a node reports or says.
    fn report(&mut self, event: Event) {
        if let Event::Log(Log { level, node, text }) = &event {
            self.log((*level).into(), node, text);
        }
        self.health.hear(&event);
        self.ledger.hear(event);
    }

    /// What time it is in what is seen: that of the last scan, or of the first one that will come.
    fn nanos(&self) -> u64 {
        let last = self.last.map(|(_, nanos)| nanos);
        let next = || self.state.playing?.next_nanos;
        last.or_else(next).unwrap_or_else(now_nanos)
    }

    fn begin(&mut self) {
        let sequence = self.last.map_or(0, |(sequence, _)| sequence);
        self.out.begin(sequence, self.nanos());
    }

    fn log(&mut self, level: Level, node: &str, line: &str) {
        if self.said.len() >= MOST_SAID {
            self.said.pop_front();
        }
        self.said
            .push_back((level, node.to_owned(), line.to_owned()));
        self.begin();
        self.encoder.log(level, node, line, &mut self.out);
    }

    /// Whoever comes to the log late reads what was said last.
    fn say_again(&mut self) {
        let mut channels = self.encoder.channels().iter();
        let log = channels.position(|channel| channel.content == Content::Log);
        let is_wanted = log.is_some_and(|log| self.out.server.is_wanted(log));
        if is_wanted && !self.is_log_wanted {
            self.begin();
            if self.said.is_empty() {
                let line = format!("{} is shown", self.run.prefix.trim_end_matches('_'));
                self.encoder
                    .log(Level::Info, "bridge", &line, &mut self.out);
            }
            for (level, node, line) in &self.said {
                self.encoder.log(*level, node, line, &mut self.out);
            }
        }
        self.is_log_wanted = is_wanted;
    }

    /// Tells how things stand: the account, parameters that others have set, how the source plays.
    fn tell_state(&mut self) {
        self.begin();
        self.encoder.ledger(&self.ledger, &mut self.out);
        self.encoder
            .health(self.health.say(Instant::now()), &mut self.out);
        let cameras = self.health.synchronisation();
        self.encoder.synchronisation(cameras, &mut self.out);
        let Some(state) = state_of(self.run, &Ask::State) else {
            return;
        };
        let playing = self.state.playing;
        self.hear_state(state);
        let is_told_later = self.sought.is_some() || self.out.server.playback().is_asked;
        if self.state.playing != playing && !is_told_later {
            self.out.server.tell_playback(false);
        }
    }

    /// Takes in what the launcher says of parameters, which others may have set, and of how the source plays.
    fn hear_state(&mut self, state: State) {
        let is_new = |parameter: &&bus::Parameter| !self.state.parameters.contains(parameter);
        let changed = state.parameters.iter().filter(is_new);
        let changed: Vec<_> = changed.map(|p| parameter_of(&p.name, &p.value)).collect();
        if !changed.is_empty() {
            self.out.server.tell_parameters(changed);
        }
        if let Some(playing) = state.playing.filter(|playing| playing.is_recording) {
            let mut playback = self.out.server.playback();
            // What somebody has asked for since it is not yet.
            if !playback.is_asked {
                playback.is_playing = !playing.is_paused;
                playback.speed = playing.rate.unwrap_or(1.0) as f32;
            }
        }
        self.state = state;
    }
}

fn now_nanos() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |since| since.as_nanos() as u64)
}

/// Sends what is encoded, topic by topic.
struct Out {
    server: Server,
    nanos: u64,
    bytes: usize,
    /// Memory for one message, used again and again.
    message: Vec<u8>,
}

impl Sink for Out {
    fn begin(&mut self, _sequence: u64, nanos: u64) {
        self.nanos = nanos;
        self.bytes = 0;
    }

    fn nanos(&self) -> u64 {
        self.nanos
    }

    fn wants(&self, channel: usize) -> bool {
        self.server.is_wanted(channel)
    }

    fn add(&mut self, channel: usize, encode: impl FnOnce(&mut Vec<u8>)) {
        self.message.clear();
        encode(&mut self.message);
        self.bytes += self.message.len();
        self.server.send(channel, self.nanos, &self.message);
    }

    fn len(&self) -> usize {
        self.bytes
    }
}
