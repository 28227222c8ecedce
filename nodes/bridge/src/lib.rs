//! Running graphs and recordings into Foxglove, over its WebSocket.
//!
//! ```text
//! running graph ─► Guest ─► Encoder ─┐                       ┌─► Foxglove, Lichtblick
//!                                    ├─► Server (loopback) ──┤
//! recording ─► Player ───────────────┘        ▲              └─► a program of yours
//!                                             └── subscriptions, parameters, services, playback control
//! ```
//!
//! A message is encoded only while somebody is subscribed to its topic, and then once for all. A viewer that is too slow
//! never holds anybody up: it gets fewer scans, whole ones, and how many it did not get is counted. What a viewer sends
//! never becomes a path or a command.

mod doorman;
#[cfg(feature = "node")]
mod live;
#[cfg(feature = "node")]
pub mod node;
mod player;
mod server;
mod settings;
mod viewers;

#[cfg(feature = "node")]
pub use live::{Live, LiveError, Viewing};
pub use player::{Player, PlayerError, Press};
pub use server::ServeError;
pub use settings::Settings;
