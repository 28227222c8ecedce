//! A viewer as Foxglove is one: it subscribes to every channel of a bridge, takes every message and throws it away.

use std::collections::BTreeSet;
use std::net::TcpStream;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use serde::Deserialize;
use serde_json::json;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket, client};

/// The protocol, as the bridge speaks it.
const SUBPROTOCOL: &str = "foxglove.sdk.v1";
/// How long the bridge may take to offer its channels.
const PATIENCE: Duration = Duration::from_secs(10);
/// The first byte of a message of a channel; a subscription's number of four bytes follows.
const MESSAGE_DATA: u8 = 1;

/// What a viewer took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Taken {
    /// Channels it was subscribed to.
    pub(super) channels: u64,
    pub(super) messages: u64,
    pub(super) bytes: u64,
    /// Messages of the channel of points, which every scan has: scans it saw.
    pub(super) scans: u64,
}

/// A viewer that is connected.
#[derive(Debug)]
pub(super) struct Viewer {
    thread: JoinHandle<()>,
    taken: Arc<Mutex<Taken>>,
}

/// What a server says in words, as far as a viewer needs to know.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Said {
    Advertise {
        channels: Vec<Channel>,
    },
    #[serde(other)]
    Other,
}

#[derive(Debug, Deserialize)]
struct Channel {
    id: u32,
    topic: String,
}

impl Viewer {
    /// Connects to the bridge at this address, and is subscribed to all it offers when this is done.
    pub(super) fn connect(address: &str) -> Result<Self, String> {
        let cannot = |error: String| format!("cannot view the graph at {address}: {error}");
        let begin = || -> Result<_, Box<dyn std::error::Error>> {
            let stream = TcpStream::connect(address)?;
            stream.set_nodelay(true)?;
            stream.set_read_timeout(Some(PATIENCE))?;
            let mut request = format!("ws://{address}/").into_client_request()?;
            request.headers_mut().insert(
                "Sec-WebSocket-Protocol",
                HeaderValue::from_static(SUBPROTOCOL),
            );
            let config = WebSocketConfig::default()
                .max_message_size(None)
                .max_frame_size(None);
            let (mut socket, _) =
                client::client_with_config(request, stream, Some(config)).map_err(Box::new)?;
            let mut session = Session::default();
            while session.subscribed.is_empty() {
                let message = socket.read()?;
                session.take(&mut socket, &message)?;
            }
            // From now on it waits for as long as the graph runs.
            socket.get_ref().set_read_timeout(None)?;
            Ok((socket, session))
        };
        let (mut socket, mut session) = begin().map_err(|error| cannot(error.to_string()))?;
        let taken = Arc::clone(&session.taken);
        let view = move || {
            // The bridge closes the connection when the graph ends.
            while let Ok(message) = socket.read() {
                if session.take(&mut socket, &message).is_err() {
                    break;
                }
            }
        };
        let thread = std::thread::Builder::new().name("viewer".to_owned());
        let thread = thread.spawn(view).map_err(|e| cannot(e.to_string()))?;
        Ok(Self { thread, taken })
    }

    /// What it took so far.
    pub(super) fn taken(&self) -> Taken {
        *self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What it took, when the graph has ended.
    pub(super) fn end(self) -> Taken {
        let taken = Arc::clone(&self.taken);
        // One that panicked took what it took until then.
        self.thread.join().unwrap_or_default();
        *taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A viewer's side of a connection.
#[derive(Debug, Default)]
struct Session {
    subscribed: BTreeSet<u32>,
    /// The channel of points.
    points: Option<u32>,
    taken: Arc<Mutex<Taken>>,
}

impl Session {
    fn take(
        &mut self,
        socket: &mut WebSocket<TcpStream>,
        message: &Message,
    ) -> Result<(), Box<dyn std::error::Error>> {
        match message {
            Message::Text(text) => {
                if let Said::Advertise { channels } = serde_json::from_str(text)? {
                    let subscription =
                        |channel: &Channel| json!({ "id": channel.id, "channelId": channel.id });
                    let all: Vec<_> = channels.iter().map(subscription).collect();
                    let subscribe = json!({ "op": "subscribe", "subscriptions": all });
                    socket.send(Message::text(subscribe.to_string()))?;
                    for channel in channels {
                        self.subscribed.insert(channel.id);
                        if channel.topic.trim_start_matches('/') == "points" {
                            self.points = Some(channel.id);
                        }
                    }
                }
            }
            Message::Binary(bytes) => self.count(bytes),
            _ => {}
        }
        Ok(())
    }

    fn count(&self, bytes: &[u8]) {
        if let Some((&MESSAGE_DATA, rest)) = bytes.split_first() {
            let subscription = rest.first_chunk().map(|id| u32::from_le_bytes(*id));
            let is_scan = subscription.is_some() && subscription == self.points;
            let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
            taken.channels = self.subscribed.len() as u64;
            taken.messages += 1;
            taken.bytes += bytes.len() as u64;
            taken.scans += u64::from(is_scan);
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(
        clippy::unwrap_used,
        clippy::result_large_err,
        reason = "tests, and how tungstenite wants it"
    )]
    use super::*;
    use std::net::TcpListener;
    use tungstenite::handshake::server::{Request, Response};

    #[test]
    fn a_viewer_subscribes_to_all_it_is_offered_and_counts_what_comes() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let serve = move || {
            let (stream, _) = listener.accept().unwrap();
            let speaks = |_: &Request, mut response: Response| {
                let protocol = HeaderValue::from_static(SUBPROTOCOL);
                response
                    .headers_mut()
                    .insert("Sec-WebSocket-Protocol", protocol);
                Ok(response)
            };
            let mut socket = tungstenite::accept_hdr(stream, speaks).unwrap();
            for said in [
                r#"{"op":"serverInfo","name":"x"}"#,
                r#"{"op":"advertise","channels":[{"id":3,"topic":"/points","schema":""},{"id":4,"topic":"/log"}]}"#,
            ] {
                socket.send(Message::text(said)).unwrap();
            }
            let asked = socket.read().unwrap().into_text().unwrap();
            for bytes in [[1, 3, 0, 0, 0, 9], [1, 4, 0, 0, 0, 9], [2, 3, 0, 0, 0, 9]] {
                socket.send(Message::binary(bytes.to_vec())).unwrap();
            }
            socket.close(None).unwrap();
            while socket.read().is_ok() {}
            asked.to_string()
        };
        let server = std::thread::spawn(serve);
        let taken = Viewer::connect(&address).unwrap().end();
        let asked: serde_json::Value = serde_json::from_str(&server.join().unwrap()).unwrap();
        assert_eq!(
            asked["subscriptions"],
            json!([{"id": 3, "channelId": 3}, {"id": 4, "channelId": 4}])
        );
        let expected = Taken {
            channels: 2,
            messages: 2,
            bytes: 12,
            scans: 1,
        };
        assert_eq!(taken, expected);
    }
}
