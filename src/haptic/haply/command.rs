//! What a client says to the Inverse Service: a force for one tick, and in the first frame who it is. And which version hears it how.
//!
//! A command holds until the next frame; a device without one is idle. Before version 3.5 a force stood in `values`, since then in
//! `vector`. Source: as in [`wire`](super::wire).

use super::wire::{ArmKind, Vector};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A frame of the client.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Command {
    /// In the first frame alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub session: Option<Session>,
    /// Commands to arms, by kind.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inverse3: Vec<Order>,
    /// To arms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inverse3x: Vec<Order>,
    /// To arms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub minverse: Vec<Order>,
}

impl Command {
    /// A force on one arm, N, in the words of a version.
    pub fn force(kind: ArmKind, device: &str, force: DVec3, version: Version) -> Self {
        let vector = Some(Vector::from(force));
        let set = if version >= Version::VECTOR {
            SetForce { vector, values: None }
        } else {
            SetForce { vector: None, values: vector }
        };
        let order = Order { device_id: device.into(), commands: Commands { set_cursor_force: Some(set) } };
        let mut command = Self::default();
        match kind {
            ArmKind::Inverse3 => command.inverse3.push(order),
            ArmKind::Inverse3x => command.inverse3x.push(order),
            ArmKind::Minverse => command.minverse.push(order),
        }
        command
    }

    /// Commands to arms of a kind.
    pub fn orders(&self, kind: ArmKind) -> &[Order] {
        match kind {
            ArmKind::Inverse3 => &self.inverse3,
            ArmKind::Inverse3x => &self.inverse3x,
            ArmKind::Minverse => &self.minverse,
        }
    }
}

/// Commands to a device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// Which.
    pub device_id: String,
    /// What.
    #[serde(default)]
    pub commands: Commands,
}

/// Commands that the client gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Commands {
    /// Until the next frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub set_cursor_force: Option<SetForce>,
}

/// A force, N: `vector` from version 3.5 on, `values` before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SetForce {
    /// From 3.5 on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vector: Option<Vector>,
    /// Before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<Vector>,
}

/// What the first frame asks of the session.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Session {
    /// Its settings.
    pub configure: Configure,
}

/// Settings of a session.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Configure {
    /// Who the client is.
    pub profile: Profile,
}

/// Who the client is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Profile {
    /// Shown in Haply's hub.
    pub name: String,
    /// Such as ">=3.5".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub required_version: Option<String>,
}

/// Version of the service.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// The first number.
    pub major: u32,
    /// The second.
    pub minor: u32,
}

impl Version {
    /// The oldest that speaks these frames; 3.0 has others, on port 10000.
    pub const OLDEST: Self = Self { major: 3, minor: 1 };
    /// The first that takes a force as `vector`.
    pub const VECTOR: Self = Self { major: 3, minor: 5 };

    /// Of "3.5.0" or "3.5.0.0".
    pub fn of(text: &str) -> Option<Self> {
        let mut parts = text.trim().trim_start_matches('v').split('.').map(|part| part.parse().ok());
        Some(Self { major: parts.next()??, minor: parts.next()?? })
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

/// The answer to `GET /version`, bare or, where asked for, in the service's envelope.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct About {
    /// Such as "3.5.0.0".
    pub project_version: Option<String>,
    /// Such as "3.5.0".
    pub git_tag: Option<String>,
    /// The envelope's content.
    pub data: Option<Box<About>>,
}

impl About {
    /// The version as it was said.
    pub fn said(&self) -> Option<&str> {
        let own = self.project_version.as_deref().or(self.git_tag.as_deref());
        own.or_else(|| self.data.as_ref().and_then(|inner| inner.said()))
    }
}
