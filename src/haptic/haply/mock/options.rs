//! Configuration, faults and record of a stand-in.

use super::super::wire::{ArmKind, GripKind};
use super::PORT;
use crate::scene::Pose;
use glam::DVec3;
use std::net::SocketAddr;
use std::time::Duration;

/// Event at a stand-in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A client connected from this address.
    Connected(SocketAddr),
    /// It disconnected after this many frames.
    Left(SocketAddr, u64),
}

/// Configuration of a stand-in.
#[derive(Clone, Debug)]
pub struct Options {
    /// Port; 0 for any free one.
    pub port: u16,
    /// Version stated by `/version`; before 3.5 only the key `values` sets a force.
    pub version: String,
    /// Arms by kind and name.
    pub arms: Vec<(ArmKind, String)>,
    /// Grips by kind and name; all are held by the first arm's hand, or at rest without an arm.
    pub grips: Vec<(GripKind, String)>,
    /// Path of the hands, m; at rest without one.
    pub path: Vec<Pose>,
    /// Times of the hand, s, in ascending order, with the buttons pressed from then on.
    pub buttons: Vec<(f64, u32)>,
    /// Hands stay where the last client has left them; without it they begin anew with the first client of each run.
    pub keep: bool,
    /// Faults; none by default.
    pub faults: Faults,
    /// Called for each event.
    pub tell: Option<fn(Event)>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            port: PORT,
            version: "3.5.0".into(),
            arms: vec![(ArmKind::Inverse3, "MOCK".into())],
            grips: vec![(GripKind::Wired, "GRIP".into())],
            path: Vec::new(),
            buttons: Vec::new(),
            keep: false,
            faults: Faults::default(),
            tell: None,
        }
    }
}

/// Faults to simulate; 0 and `false` for none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Faults {
    /// Connections end without a closing handshake after this many frames.
    pub drop_after: u64,
    /// Each n-th frame is cut in half.
    pub malformed_every: u64,
    /// Each n-th frame has `null` in a position, since JSON has no NaN.
    pub null_every: u64,
    /// Each n-th frame has no devices.
    pub empty_every: u64,
    /// Arms report that they are not calibrated.
    pub uncalibrated: bool,
    /// Delay before each answer.
    pub delay: Duration,
    /// Each 10th frame is preceded by this many old ones.
    pub burst: u32,
    /// Forces are ignored.
    pub deaf: bool,
    /// No inventory is sent.
    pub silent: bool,
}

/// Record of a stand-in.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// WebSocket connections.
    pub connections: u64,
    /// Connections that ended.
    pub ended: u64,
    /// Frames of clients.
    pub frames: u64,
    /// `[arm]` current force, N.
    pub forces: Vec<DVec3>,
    /// `[arm]` force of each connection's first frame, N.
    pub first_forces: Vec<Vec<DVec3>>,
    /// `[arm]` force of each ended connection's last frame, N.
    pub last_forces: Vec<Vec<DVec3>>,
    /// Number of forces released because no frame arrived.
    pub idled: u64,
    /// Largest force so far, N.
    pub peak: f64,
    /// Profile name of the last client.
    pub profile: Option<String>,
    /// Version that it required.
    pub required_version: Option<String>,
    /// Key of the last force.
    pub wording: Option<&'static str>,
}
