//! Haply's Inverse3, connected through Haply's Inverse Service, and a [stand-in](mock) of that service for work without the device.
//!
//! The service runs beside the program and owns the device. Its simulation channel is a WebSocket (port 10001) in lock step: after one
//! inventory it sends exactly one state frame per frame of the client. The client's rate is therefore the loop's rate, and a force is held
//! until the next frame. The frames are in [`wire`] and [`command`].
//!
//! ```text
//! haptic loop ──write──▶ [newest force] ──▶ I/O thread ──one frame──▶ service ──▶ Inverse3
//!             ◀──read─── [newest state] ◀── (the socket) ◀─one frame──
//! ```
//!
//! [`open`] waits for the inventory, selects an arm and a grip, and starts the thread. [`Client`] is the loop's end:
//! [`read`](super::device::Device::read) and [`write`](super::device::Device::write) access buffers with the newest value, and never wait,
//! lock or allocate. The thread sends when the loop has written, and receives all pending frames before it sends again, so nothing queues
//! up behind a slow peer or after a burst.
//!
//! Safety of the hand: a force is sent only while the loop writes (after 50 ms of silence the thread sends zero), only after a valid state
//! on the connection in use, and never above the device's [`Limits`]. A lost connection is re-established with increasing delays. Irregular
//! frames are counted in [`Trouble`] and never used as a pose.
//!
//! Positions, velocities and forces are in the service's application space, with the basis and workspace transform configured in the
//! service; [`Workspace`](super::device::Workspace) places that space in the scene. Orientation and buttons come from the grip. An arm
//! alone has neither: its rotation is the identity.
//!
//! Not verified with a real device, as none was available: the force at which an Inverse3 saturates, its highest rate, and whether a
//! service before 3.5 answers `/version` on the channel's port. The force limit is therefore a setting with the default of NVIDIA's Isaac
//! Lab (2 N), and a version can be [stated](Settings::version).

mod client;
pub mod command;
pub mod mock;
mod session;
pub mod wire;

pub use client::{Client, Trouble};
pub use session::Refused;

use super::device::Limits;
use crate::error::Result;
use command::Version;
use std::time::Duration;

/// Default address of the service's simulation channel.
pub const URL: &str = "ws://localhost:10001";

/// Default force limit, N: the value of NVIDIA Isaac Lab's Haply device.
pub const FORCE_LIMIT: f64 = 2.0;

/// Resolution of positions, m; assumed, since the service does not state it.
pub const RESOLUTION: f64 = 1e-5;

/// Timeout of [`open`] for each of connection, version and inventory.
pub const PATIENCE: Duration = Duration::from_secs(2);

/// No force is sent after this time without a write of the loop: 50 ticks at 1 kHz.
pub const DEAD_MAN: Duration = Duration::from_millis(50);

/// Settings of a connection.
#[derive(Clone, Debug)]
pub struct Settings {
    /// `ws://host:port`
    pub url: String,
    /// Name of the arm; the first one by default.
    pub device: Option<String>,
    /// Name of the grip; by default the first one, if any.
    pub grip: Option<String>,
    /// Limits of the forces sent.
    pub limits: Limits,
    /// Version of the service, for one that does not state it; by default the service is asked.
    pub version: Option<Version>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            url: URL.into(),
            device: None,
            grip: None,
            limits: Limits { force: FORCE_LIMIT, torque: 0.0 },
            version: None,
        }
    }
}

/// Opens a connection to a device.
///
/// # Errors
/// If nothing listens at the address, the peer is no Inverse Service, its version is too old, or the device is missing.
pub fn open(settings: &Settings) -> Result<Client> {
    Client::open(settings)
}
