//! Messages of a client to the Inverse Service: a force for one tick, and in the first frame the client's profile; depending on the
//! version.
//!
//! A command holds until the next frame; a device without one is idle. The key of a force is `values` before version 3.5 and `vector`
//! since.
//! Source: as in [`wire`](super::wire).

use super::wire::{ArmKind, Vector};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A frame of the client.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Command {
    /// In the first frame only.
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
    /// Force on one arm, N, in the format of a version.
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
    /// Name of the device.
    pub device_id: String,
    /// Commands.
    #[serde(default)]
    pub commands: Commands,
}

/// Commands of the client.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Commands {
    /// Force, held until the next frame.
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

/// Session request of the first frame.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Session {
    /// Settings of the session.
    pub configure: Configure,
}

/// Settings of a session.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Configure {
    /// Profile of the client.
    pub profile: Profile,
}

/// Profile of a client.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Profile {
    /// Name shown in Haply's hub.
    pub name: String,
    /// Required version, such as ">=3.5".
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
    /// Oldest version with these frames; 3.0 has others, on port 10000.
    pub const OLDEST: Self = Self { major: 3, minor: 1 };
    /// First version with the key `vector`.
    pub const VECTOR: Self = Self { major: 3, minor: 5 };

    /// From "3.5.0" or "3.5.0.0".
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
    /// Stated version.
    pub fn said(&self) -> Option<&str> {
        let own = self.project_version.as_deref().or(self.git_tag.as_deref());
        own.or_else(|| self.data.as_ref().and_then(|inner| inner.said()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn written(command: &Command) -> Value {
        serde_json::to_value(command).expect("a tree")
    }

    #[test]
    fn the_first_frame_is_the_documentations() {
        let mut command = Command::force(ArmKind::Inverse3, "049D", DVec3::new(0.0, 0.0, 1.5), Version::VECTOR);
        let profile = Profile { name: "org.example.incision".into(), required_version: Some(">=3.5".into()) };
        command.session = Some(Session { configure: Configure { profile } });
        let wanted = json!({
            "session": { "configure": { "profile": { "name": "org.example.incision", "required_version": ">=3.5" } } },
            "inverse3": [ { "device_id": "049D",
                "commands": { "set_cursor_force": { "vector": {"x": 0.0, "y": 0.0, "z": 1.5} } } } ]
        });
        assert_eq!(written(&command), wanted);
        assert_eq!(serde_json::from_value::<Command>(wanted).expect("it is one"), command);
    }

    #[test]
    fn a_force_is_called_values_before_3_5_and_vector_since() {
        for (version, word, other) in
            [("3.4.9", "values", "vector"), ("3.5.0", "vector", "values"), ("4.0", "vector", "values")]
        {
            let version = Version::of(version).expect("a version");
            let set = &written(&Command::force(ArmKind::Minverse, "A", DVec3::X, version))["minverse"][0]["commands"];
            assert_eq!(set["set_cursor_force"][word]["x"], 1.0, "{version}");
            assert!(set["set_cursor_force"].get(other).is_none(), "{version}");
        }
    }

    #[test]
    fn versions_are_ordered_by_their_numbers() {
        let of = |text| Version::of(text).expect("a version");
        assert!(of("3.10.0") > of("3.5.0.0") && of("3.0.5") < Version::OLDEST && of("v3.1") == Version::OLDEST);
        for none in ["", "3", "x.y", "3.x", "-3.5", "99999999999.0"] {
            assert_eq!(Version::of(none), None, "{none}");
        }
    }

    #[test]
    fn the_version_is_found_bare_and_in_its_envelope() {
        let bare = r#"{"git_tag": "3.5.0", "project_name": "haply-inverse-service", "project_version": "3.5.0.0"}"#;
        for text in [bare.to_string(), format!(r#"{{"ok": true, "data": {bare}}}"#)] {
            assert_eq!(serde_json::from_str::<About>(&text).expect("it is one").said(), Some("3.5.0.0"));
        }
        assert_eq!(serde_json::from_str::<About>(r#"{"ok": false, "error": "no"}"#).expect("it is one").said(), None);
    }
}
