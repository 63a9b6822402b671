//! Haply's Inverse3 by way of Haply's Inverse Service, and a [stand-in](mock) of that service for work without the device.
//!
//! The service runs beside the program and owns the device. Its simulation channel is a WebSocket (port 10001) in lock step: after one
//! inventory it sends exactly one state frame per frame of the client, so the client's rate is the loop's rate, and a force holds until
//! the next frame. The frames are in [`wire`] and [`command`].
//!
//! ```text
//! haptic loop ──write──▶ [newest force] ──▶ I/O thread ──one frame──▶ service ──▶ Inverse3
//!             ◀──read─── [newest state] ◀── (the socket) ◀─one frame──
//! ```
//!
//! [`open`] waits for the inventory, picks an arm and a grip, and starts the thread. [`Client`] is the loop's end: [`read`](super::device::Device::read)
//! and [`write`](super::device::Device::write) touch cells with the newest value, and never wait, lock or allocate. The thread sends when the loop has
//! written, and takes every frame that has come before it sends again, so nothing piles up before a slow peer or after a burst.
//!
//! What keeps the hand safe: a force goes out only while the loop writes (50 ms after its last word the thread sends zero), only after a
//! sound state of the connection in use, and never above the device's [`Limits`]. A lost connection is taken up again, by and by. What
//! was not as it should be is counted in [`Trouble`], and nothing of it is ever used as a pose.
//!
//! Positions, velocities and forces are in the service's application space, with the basis and workspace transform that the service is
//! set to; [`Workspace`](super::device::Workspace) places that space in the scene. Orientation and buttons come from the grip. An arm
//! alone has none of either: its rotation is the identity.
//!
//! Not known from a real device, as none was at hand: the force at which an Inverse3 saturates, its highest rate, and whether a service
//! before 3.5 answers `/version` on the channel's port. So the force limit is a setting, its default (2 N) is what NVIDIA's Isaac Lab
//! clips to, and a version can be [stated](Settings::version).

mod client;
pub mod command;
pub mod mock;
mod refused;
mod session;
mod trouble;
pub mod wire;

pub use client::Client;
pub use refused::Refused;
pub use trouble::Trouble;

use super::device::Limits;
use crate::error::Result;
use command::Version;
use std::time::Duration;

/// The service's simulation channel as it comes.
pub const URL: &str = "ws://localhost:10001";

/// Force limit without better knowledge, N: the clip of NVIDIA Isaac Lab's Haply device.
pub const FORCE_LIMIT: f64 = 2.0;

/// Step of the position, m; assumed, as the service does not tell it.
pub const RESOLUTION: f64 = 1e-5;

/// How long [`open`] waits for the service: for each of connection, version and inventory.
pub const PATIENCE: Duration = Duration::from_secs(2);

/// After this time without a word of the loop no force is sent; 50 ticks of a loop of 1 kHz.
pub const DEAD_MAN: Duration = Duration::from_millis(50);

/// What to open.
#[derive(Clone, Debug)]
pub struct Settings {
    /// `ws://host:port`
    pub url: String,
    /// The arm's name; the first one when none is given.
    pub device: Option<String>,
    /// The grip's name; the first one when none is given, and none if there is none.
    pub grip: Option<String>,
    /// What forces are cut to.
    pub limits: Limits,
    /// The service's version, for one that does not tell; asked of the service when none is given.
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

/// A device that is connected and speaks.
///
/// # Errors
/// When nothing listens there, what listens is no Inverse Service, its version is too old, or the device is not there.
pub fn open(settings: &Settings) -> Result<Client> {
    Client::open(settings)
}
