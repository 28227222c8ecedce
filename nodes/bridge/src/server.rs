//! The server: what it offers, what viewers ask of it, and one way out for every message.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crossbeam::channel::{Receiver, Sender, bounded};
use foxglove::websocket::service::{Request, Service, ServiceSchema};
use foxglove::websocket::{
    AnyClient, Capability, ChannelView, Client, ConnectionGraph, GetParametersResponder, Parameter,
    ParameterHandler, ParameterType, ParameterValue, PlaybackCommand, PlaybackControlRequest,
    PlaybackState, PlaybackStatus, ServerListener, SetParametersResponder,
};
use foxglove::{
    ChannelBuilder, Context, PartialMetadata, RawChannel, WebSocketServer, WebSocketServerHandle,
};
use serde_json::{Value, json};

use crate::Settings;
use crate::doorman::{self, Doorman};
use crate::viewers::{Viewers, unsent};

/// Why nothing can be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The port is another program's, or another view's.
    #[error("port {port} of {host} is taken: choose another with {how}")]
    Taken {
        /// The address.
        host: String,
        /// The port.
        port: u32,
        /// What to set.
        how: &'static str,
    },
    /// It cannot be listened there.
    #[error("cannot listen at {host}:{port}: {cause}")]
    Listen {
        /// The address.
        host: String,
        /// The port.
        port: u32,
        /// What the system says.
        cause: String,
    },
    /// A topic cannot be offered.
    #[error("cannot offer {topic}: {cause}")]
    Topic {
        /// Its name.
        topic: String,
        /// What the library says.
        cause: String,
    },
}

/// What a viewer wants.
pub(crate) enum Wish {
    /// What stands in the server looked at: subscriptions, how the recording is to play, who has come. Of many such wishes
    /// one is enough.
    Look,
    /// All viewers told that these parameters are so.
    Tell(Vec<Parameter>),
    /// A service.
    Call(Call, Sender<Result<String, String>>),
}

/// What a viewer wants of the parameters.
pub(crate) enum Turn {
    /// Values: of these, or of all.
    Get(Vec<String>, GetParametersResponder),
    /// Some set otherwise.
    Set(BTreeMap<String, Value>, AnyClient, SetParametersResponder),
}

/// The services.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Call {
    Pause,
    Resume,
    Snapshot,
}

/// How a recording plays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Playback {
    pub(crate) is_playing: bool,
    pub(crate) speed: f32,
    /// Where it is, in nanoseconds since 1970.
    pub(crate) nanos: u64,
    /// Where to go on, when somebody has asked for it.
    pub(crate) seek: Option<u64>,
    pub(crate) has_ended: bool,
    /// Whether somebody has asked for something of this that is not done yet.
    pub(crate) is_asked: bool,
}

impl Playback {
    fn state(&self, did_seek: bool) -> PlaybackState {
        PlaybackState {
            status: match (self.is_playing, self.has_ended) {
                (_, true) => PlaybackStatus::Ended,
                (true, _) => PlaybackStatus::Playing,
                (false, _) => PlaybackStatus::Paused,
            },
            current_time: self.nanos,
            playback_speed: self.speed,
            did_seek,
            request_id: None,
        }
    }
}

/// A topic, and how its messages are to be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Offered {
    pub(crate) topic: String,
    /// How messages are encoded.
    pub(crate) encoding: String,
    /// The schema's name.
    pub(crate) schema: String,
    pub(crate) schema_encoding: String,
    pub(crate) schema_data: Vec<u8>,
}

/// What is offered.
pub(crate) struct Offer {
    /// What viewers call the source.
    pub(crate) name: String,
    pub(crate) topics: Vec<Offered>,
    /// Whether there are parameters and services.
    pub(crate) is_graph: bool,
    /// How the recording plays, and from when to when it goes.
    pub(crate) playback: Option<(Playback, (u64, u64))>,
    /// What to set when the port is taken.
    pub(crate) how: &'static str,
}

/// Wishes that may wait; a viewer that floods is told so.
const MOST_WISHES: usize = 256;
/// Messages that may wait for a viewer at least: answers do too, and who seeks faster than it reads them is not to be sent
/// away at once.
const LEAST_MESSAGES: usize = 256;
/// How long a service may take: longer than the launcher's answer to what it asks.
const SERVICE_PATIENCE: Duration = Duration::from_secs(60);

/// A server with its topics.
pub(crate) struct Server {
    handle: Option<WebSocketServerHandle>,
    /// What holds channels and viewers together: nobody else keeps it.
    _context: Arc<Context>,
    channels: Vec<Arc<RawChannel>>,
    wish: Sender<Wish>,
    wishes: Receiver<Wish>,
    turns: Receiver<Turn>,
    news: Arc<News>,
    playback: Arc<Mutex<Playback>>,
    is_recording: bool,
    viewers: Viewers,
    backlog: u32,
    doorman: Doorman,
    address: SocketAddr,
    told_slow: BTreeSet<SocketAddr>,
}

impl Server {
    pub(crate) fn start(settings: &Settings, offer: Offer) -> Result<Self, ServeError> {
        let context = Context::new();
        let channel = |offered: Offered| {
            let (name, encoding) = (offered.schema, offered.schema_encoding);
            let schema = foxglove::Schema::new(name, encoding, offered.schema_data);
            let channel = ChannelBuilder::new(&offered.topic)
                .context(&context)
                .message_encoding(offered.encoding)
                .schema(schema)
                .build_raw();
            channel.map_err(|error| ServeError::Topic {
                topic: offered.topic,
                cause: error.to_string(),
            })
        };
        let topics = offer.topics.into_iter();
        let channels: Vec<Arc<RawChannel>> = topics.map(channel).collect::<Result<_, _>>()?;
        let (wish, wishes) = bounded(MOST_WISHES);
        let (turn, turns) = bounded(MOST_WISHES);
        let news = Arc::new(News::default());
        let span = offer.playback.map(|(_, span)| span);
        let playback = offer.playback.map(|(playback, _)| playback);
        let playback = Arc::new(Mutex::new(playback.unwrap_or(Playback {
            is_playing: true,
            speed: 1.0,
            nanos: 0,
            seek: None,
            has_ended: false,
            is_asked: false,
        })));
        let listener = Arc::new(Listener {
            wish: wish.clone(),
            turn,
            news: Arc::clone(&news),
            playback: Arc::clone(&playback),
            span,
        });
        let mut capabilities = vec![Capability::Time];
        if offer.is_graph {
            capabilities.extend([
                Capability::Parameters,
                Capability::Services,
                Capability::ConnectionGraph,
            ]);
        }
        // Every viewer has room for the scans that may wait for it, and the one that goes out.
        let backlog = channels.len() * (settings.backlog as usize + 1);
        let hidden = doorman::hidden();
        let mut server = WebSocketServer::new()
            .name(offer.name)
            .context(&context)
            .bind(hidden.to_string(), 0)
            .message_backlog_size(backlog.max(LEAST_MESSAGES))
            .listener(Arc::clone(&listener) as Arc<dyn ServerListener>);
        if let Some((first, last)) = span {
            capabilities.push(Capability::PlaybackControl);
            server = server.playback_time_range(first, last);
        }
        if offer.is_graph {
            server = server
                .parameter_handler(listener)
                .supported_encodings(["json"])
                .services(services(&wish));
        }
        let listen = |error: &dyn std::fmt::Display| ServeError::Listen {
            host: settings.host.clone(),
            port: settings.port,
            cause: error.to_string(),
        };
        let door = TcpListener::bind((settings.host.as_str(), settings.port as u16));
        let door = door.map_err(|error| match error.kind() {
            io::ErrorKind::AddrInUse => ServeError::Taken {
                host: settings.host.clone(),
                port: settings.port,
                how: offer.how,
            },
            _ => listen(&error),
        })?;
        let address = door.local_addr().map_err(|error| listen(&error))?;
        let handle = server.capabilities(capabilities).start_blocking();
        let handle = handle.map_err(|error| listen(&error))?;
        let doorman = Doorman::stand(
            door,
            SocketAddr::new(hidden, handle.port()),
            &settings.origins,
        );
        let doorman = doorman.map_err(|error| listen(&error))?;
        Ok(Self {
            doorman,
            address,
            handle: Some(handle),
            _context: context,
            channels,
            wish,
            wishes,
            turns,
            news,
            playback,
            is_recording: span.is_some(),
            viewers: Viewers::default(),
            backlog: settings.backlog,
            told_slow: BTreeSet::new(),
        })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether somebody is connected.
    pub(crate) fn has_viewers(&self) -> bool {
        self.handle
            .as_ref()
            .is_some_and(|handle| handle.client_count() > 0)
    }

    /// What viewers want, in order.
    pub(crate) fn wishes(&self) -> &Receiver<Wish> {
        &self.wishes
    }

    /// The way to say what viewers want, for other threads.
    pub(crate) fn wish(&self) -> Sender<Wish> {
        self.wish.clone()
    }

    /// What viewers want of the parameters, in order.
    pub(crate) fn turns(&self) -> Receiver<Turn> {
        self.turns.clone()
    }

    /// Whether subscriptions came or went since this was asked last.
    pub(crate) fn has_new_subscriptions(&self) -> bool {
        self.news.subscriptions.swap(false, Ordering::AcqRel)
    }

    /// Tells viewers what time it is and how the recording plays when one has come that does not know it yet. It is to know
    /// the time before it subscribes: viewers take what comes before the first time for something of 1970.
    pub(crate) fn greet(&self, nanos: u64) {
        if self.news.viewers.swap(false, Ordering::AcqRel) {
            self.time(nanos);
            self.tell_playback(false);
        }
    }

    /// Whether somebody is subscribed to the topic with this index.
    pub(crate) fn is_wanted(&self, channel: usize) -> bool {
        self.channels[channel].has_sinks()
    }

    /// Whether somebody is subscribed to anything.
    pub(crate) fn has_subscriptions(&self) -> bool {
        self.channels.iter().any(|channel| channel.has_sinks())
    }

    /// Whether a viewer has taken all that was sent, or there is none.
    pub(crate) fn has_room(&self) -> bool {
        let unsent = self.unsent();
        unsent.is_empty() || unsent.values().any(|bytes| *bytes == 0)
    }

    /// Notes scans that did not reach the bridge, so that no viewer gets them.
    pub(crate) fn leave_out(&mut self, scans: u64) {
        self.viewers.leave_out(&self.unsent(), scans);
    }

    /// Whether a scan is to go out now, or every viewer still has scans before it.
    pub(crate) fn admit(&mut self) -> bool {
        self.viewers.admit(&self.unsent(), self.backlog)
    }

    /// The viewers, and the bytes on their way to each.
    fn unsent(&self) -> BTreeMap<SocketAddr, u64> {
        let mut unsent = unsent(self.address.port());
        unsent.retain(|viewer, _| self.doorman.knows(viewer));
        unsent
    }

    /// What is to be said now: who was not let in, and, once of each, who is too slow.
    pub(crate) fn remarks(&mut self) -> Vec<String> {
        let mut remarks: Vec<String> = self.doorman.sentences().collect();
        let is_there = |viewer: &SocketAddr| self.doorman.knows(viewer);
        self.told_slow.retain(is_there);
        for viewer in self.viewers.slow(self.backlog) {
            if self.told_slow.insert(viewer) {
                remarks.push(format!(
                    "the viewer {viewer} is too slow and does not get every scan; how many is said at the end"
                ));
            }
        }
        remarks
    }

    /// Scans that viewers did not get whole, of those they were to get.
    pub(crate) fn missed(&self) -> (u64, u64) {
        self.viewers.missed()
    }

    /// Sends a message to all who are subscribed.
    pub(crate) fn send(&self, channel: usize, nanos: u64, message: &[u8]) {
        let meta = PartialMetadata {
            log_time: Some(nanos),
        };
        self.channels[channel].log_with_meta(message, meta);
    }

    /// Tells viewers what time it is in what they see.
    pub(crate) fn time(&self, nanos: u64) {
        if let Some(handle) = &self.handle {
            handle.broadcast_time(nanos);
        }
    }

    /// How the recording plays.
    pub(crate) fn playback(&self) -> MutexGuard<'_, Playback> {
        self.playback.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells viewers how the recording plays, if it is one.
    pub(crate) fn tell_playback(&self, did_seek: bool) {
        let state = self.playback().state(did_seek);
        if let Some(handle) = self.handle.as_ref().filter(|_| self.is_recording) {
            handle.broadcast_playback_state(state);
        }
    }

    /// Tells viewers values of parameters.
    pub(crate) fn tell_parameters(&self, parameters: Vec<Parameter>) {
        if let Some(handle) = &self.handle {
            handle.publish_parameter_values(parameters);
        }
    }

    /// Tells viewers who publishes and takes what.
    pub(crate) fn tell_graph(&self, graph: ConnectionGraph) {
        if let Some(handle) = &self.handle {
            // It fails only without the capability.
            handle.publish_connection_graph(graph).unwrap_or_default();
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(handle) = self.handle.take() {
            handle.stop().wait_blocking();
        }
    }
}

/// The services: no arguments, and an answer in words.
fn services(wish: &Sender<Wish>) -> Vec<Service> {
    let answer = json!({ "type": "object", "properties": { "text": { "type": "string" } } });
    let service = |name: &str, call: Call| {
        let schema = ServiceSchema::new(format!("tricurve/{name}"))
            .with_request(
                "json",
                foxglove::Schema::new(
                    "tricurve.Nothing",
                    "jsonschema",
                    br#"{"type":"object"}"#.to_vec(),
                ),
            )
            .with_response(
                "json",
                foxglove::Schema::new(
                    "tricurve.Answer",
                    "jsonschema",
                    answer.to_string().into_bytes(),
                ),
            );
        let wish = wish.clone();
        Service::builder(format!("tricurve/{name}"), schema).blocking_handler_fn(
            move |_request: Request| -> Result<Vec<u8>, String> {
                let (reply, answer) = bounded(1);
                wish.try_send(Wish::Call(call, reply))
                    .map_err(|_| "too much is asked at once".to_owned())?;
                let text = answer
                    .recv_timeout(SERVICE_PATIENCE)
                    .map_err(|_| format!("no answer within {} s", SERVICE_PATIENCE.as_secs()))??;
                Ok(json!({ "text": text }).to_string().into_bytes())
            },
        )
    };
    vec![
        service("pause", Call::Pause),
        service("resume", Call::Resume),
        service("snapshot", Call::Snapshot),
    ]
}

/// What has come since it was looked at last.
#[derive(Debug, Default)]
struct News {
    subscriptions: AtomicBool,
    viewers: AtomicBool,
}

/// Hears viewers, on the server's threads, and hands on what they want.
struct Listener {
    wish: Sender<Wish>,
    turn: Sender<Turn>,
    news: Arc<News>,
    playback: Arc<Mutex<Playback>>,
    /// From when to when the recording goes, if it is one.
    span: Option<(u64, u64)>,
}

impl Listener {
    /// Has it looked at what stands in the server. When there is no room for the wish others wait, which do the same.
    fn look(&self) {
        drop(self.wish.try_send(Wish::Look));
    }

    fn subscriptions(&self) {
        self.news.subscriptions.store(true, Ordering::Release);
        self.look();
    }
}

impl ServerListener for Listener {
    fn on_subscribe(&self, _client: Client, _channel: ChannelView<'_>) {
        self.subscriptions();
    }

    fn on_unsubscribe(&self, _client: Client, _channel: ChannelView<'_>) {
        self.subscriptions();
    }

    fn on_client_connect(&self) {
        self.news.viewers.store(true, Ordering::Release);
        self.look();
    }

    fn on_playback_control_request(
        &self,
        request: PlaybackControlRequest,
    ) -> Option<PlaybackState> {
        let (first, last) = self.span?;
        let state = {
            let mut playback = self.playback.lock().unwrap_or_else(PoisonError::into_inner);
            playback.is_playing = request.playback_command == PlaybackCommand::Play;
            if request.playback_speed.is_finite() && request.playback_speed > 0.0 {
                playback.speed = request.playback_speed.clamp(0.001, 1000.0);
            }
            if let Some(nanos) = request.seek_time {
                let nanos = nanos.clamp(first, last);
                playback.nanos = nanos;
                playback.seek = Some(nanos);
                playback.has_ended = false;
            }
            playback.is_asked = true;
            playback.state(request.seek_time.is_some())
        };
        self.look();
        Some(state)
    }
}

impl ParameterHandler for Listener {
    fn get(
        &self,
        _client: AnyClient,
        names: Vec<String>,
        _request_id: Option<String>,
        responder: GetParametersResponder,
    ) {
        // A responder that is dropped says that it failed.
        drop(self.turn.try_send(Turn::Get(names, responder)));
    }

    fn set(
        &self,
        client: AnyClient,
        parameters: Vec<Parameter>,
        _request_id: Option<String>,
        responder: SetParametersResponder,
    ) {
        let value = |parameter: Parameter| {
            let value = parameter.value.map_or(Value::Null, json_of);
            (parameter.name, value)
        };
        let values = parameters.into_iter().map(value).collect();
        drop(self.turn.try_send(Turn::Set(values, client, responder)));
    }
}

/// A parameter's value as JSON.
fn json_of(value: ParameterValue) -> Value {
    match value {
        ParameterValue::Integer(number) => number.into(),
        ParameterValue::Float64(number) => number.into(),
        ParameterValue::Bool(on) => on.into(),
        ParameterValue::String(text) => text.into(),
        ParameterValue::Array(values) => values.into_iter().map(json_of).collect(),
        ParameterValue::Dict(table) => {
            let entry = |(key, value)| (key, json_of(value));
            Value::Object(table.into_iter().map(entry).collect())
        }
    }
}

/// A parameter as viewers know it: what a node finds by itself is the text `automatic`.
pub(crate) fn parameter_of(name: &str, value: &Value) -> Parameter {
    let value = match value {
        Value::Null => ParameterValue::String("automatic".to_owned()),
        value => value_of(value),
    };
    Parameter {
        name: name.to_owned(),
        r#type: match &value {
            ParameterValue::Float64(_) => Some(ParameterType::Float64),
            ParameterValue::Array(values) if values.iter().all(is_number) => {
                Some(ParameterType::Float64Array)
            }
            _ => None,
        },
        value: Some(value),
    }
}

fn is_number(value: &ParameterValue) -> bool {
    matches!(value, ParameterValue::Float64(_))
}

fn value_of(value: &Value) -> ParameterValue {
    match value {
        Value::Null => ParameterValue::String(String::new()),
        Value::Bool(on) => ParameterValue::Bool(*on),
        Value::Number(number) => ParameterValue::Float64(number.as_f64().unwrap_or_default()),
        Value::String(text) => ParameterValue::String(text.clone()),
        Value::Array(values) => ParameterValue::Array(values.iter().map(value_of).collect()),
        Value::Object(table) => {
            let entry = |(key, value): (&String, &Value)| (key.clone(), value_of(value));
            ParameterValue::Dict(table.iter().map(entry).collect())
        }
    }
}
