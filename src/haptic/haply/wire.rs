//! What the Inverse Service says on its simulation channel, as plain structs; what is said to it is in [`command`](super::command).
//!
//! Text frames of JSON; newtons, metres, m/s; quaternions x, y, z, w; right-handed axes. The service's first frame is its inventory, with
//! `config`; later ones have `state` and `status` alone. Reading is tolerant: unknown fields are passed over, a device without `state` is
//! kept without one, and parts of a `transform` that are left out are the identity. A number written as `null` (as JSON writers do with
//! NaN) is read as NaN, so that it is told from a frame of the wrong shape.
//! Source: docs.haply.co, Inverse Service 3.5, "WebSocket Protocol", "Control Commands", "HTTP".

use glam::{DQuat, DVec3};
use serde::{Deserialize, Deserializer, Serialize};

/// A number, or NaN for `null`.
fn number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

/// A vector in the device's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector {
    /// Along x.
    #[serde(deserialize_with = "number")]
    pub x: f64,
    /// Along y.
    #[serde(deserialize_with = "number")]
    pub y: f64,
    /// Along z.
    #[serde(deserialize_with = "number")]
    pub z: f64,
}

impl From<DVec3> for Vector {
    fn from(v: DVec3) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

impl From<Vector> for DVec3 {
    fn from(v: Vector) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

/// A quaternion, scalar last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// Along x.
    #[serde(deserialize_with = "number")]
    pub x: f64,
    /// Along y.
    #[serde(deserialize_with = "number")]
    pub y: f64,
    /// Along z.
    #[serde(deserialize_with = "number")]
    pub z: f64,
    /// The scalar.
    #[serde(deserialize_with = "number")]
    pub w: f64,
}

/// Allowed departure of a quaternion's length from 1: what three printed digits leave.
const QUATERNION_SLACK: f64 = 0.01;

impl Quaternion {
    /// The rotation, of length 1; none when a number is none or the length is not 1.
    pub fn rotation(self) -> Option<DQuat> {
        let q = DQuat::from_xyzw(self.x, self.y, self.z, self.w);
        ((q.length() - 1.0).abs() <= QUATERNION_SLACK).then(|| q.normalize())
    }
}

impl From<DQuat> for Quaternion {
    fn from(q: DQuat) -> Self {
        Self { x: q.x, y: q.y, z: q.z, w: q.w }
    }
}

/// Workspace transform of the service, already in the positions that it says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Transform {
    /// m
    pub position: Vector,
    /// Scalar last.
    pub rotation: Quaternion,
    /// Per axis.
    pub scale: Vector,
}

impl Default for Transform {
    fn default() -> Self {
        Self { position: Vector::default(), rotation: DQuat::IDENTITY.into(), scale: DVec3::ONE.into() }
    }
}

/// What an arm says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArmState {
    /// m
    pub cursor_position: Vector,
    /// m/s
    pub cursor_velocity: Vector,
    /// What the motors give, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current_cursor_force: Option<Vector>,
    /// Workspace transform.
    #[serde(default)]
    pub transform: Transform,
}

/// Buttons of a grip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Buttons {
    /// Down.
    pub a: bool,
    /// Down.
    pub b: bool,
    /// Down.
    pub c: bool,
}

impl Buttons {
    /// Bits 0, 1 and 2 for a, b and c.
    pub fn bits(self) -> u32 {
        u32::from(self.a) | u32::from(self.b) << 1 | u32::from(self.c) << 2
    }

    /// The other way round.
    pub fn of(bits: u32) -> Self {
        Self { a: bits & 1 != 0, b: bits & 2 != 0, c: bits & 4 != 0 }
    }
}

/// What a grip says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GripState {
    /// Scalar last.
    pub orientation: Quaternion,
    /// Which are down.
    #[serde(default)]
    pub buttons: Buttons,
}

/// What the client uses of a device's status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Status {
    /// Where the arm is, is known; not said by grips.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<bool>,
    /// Takes commands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ready: Option<bool>,
}

/// A device of a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry<S> {
    /// Name of the device, as printed on it.
    pub device_id: String,
    /// In the inventory alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub config: Option<Config>,
    /// None while the device says nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<S>,
    /// Whether what it says can be used.
    #[serde(default)]
    pub status: Status,
}

/// What is fixed for a session.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Config {
    /// "inverse3" and so on.
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// "right" or "left".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub handedness: Option<String>,
}

/// A frame of the service.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Frame {
    /// Of this connection.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub session_id: Option<u64>,
    /// Arms, by kind.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inverse3: Vec<Entry<ArmState>>,
    /// Arms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inverse3x: Vec<Entry<ArmState>>,
    /// Arms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub minverse: Vec<Entry<ArmState>>,
    /// Grips, by kind.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub verse_grip: Vec<Entry<GripState>>,
    /// Grips.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wireless_verse_grip: Vec<Entry<GripState>>,
    /// Grips.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub custom_verse_grip: Vec<Entry<GripState>>,
}

/// Kinds of arms, by their word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmKind {
    /// `inverse3`
    Inverse3,
    /// `inverse3x`
    Inverse3x,
    /// `minverse`
    Minverse,
}

impl ArmKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Inverse3, Self::Inverse3x, Self::Minverse];

    /// Its word in frames.
    pub fn word(self) -> &'static str {
        match self {
            Self::Inverse3 => "inverse3",
            Self::Inverse3x => "inverse3x",
            Self::Minverse => "minverse",
        }
    }
}

/// Kinds of grips, by their word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GripKind {
    /// `verse_grip`
    Wired,
    /// `wireless_verse_grip`
    Wireless,
    /// `custom_verse_grip`
    Custom,
}

impl GripKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Wired, Self::Wireless, Self::Custom];

    /// Its word in frames.
    pub fn word(self) -> &'static str {
        match self {
            Self::Wired => "verse_grip",
            Self::Wireless => "wireless_verse_grip",
            Self::Custom => "custom_verse_grip",
        }
    }
}

impl Frame {
    /// Arms of a kind.
    pub fn arms(&self, kind: ArmKind) -> &[Entry<ArmState>] {
        match kind {
            ArmKind::Inverse3 => &self.inverse3,
            ArmKind::Inverse3x => &self.inverse3x,
            ArmKind::Minverse => &self.minverse,
        }
    }

    /// Grips of a kind.
    pub fn grips(&self, kind: GripKind) -> &[Entry<GripState>] {
        match kind {
            GripKind::Wired => &self.verse_grip,
            GripKind::Wireless => &self.wireless_verse_grip,
            GripKind::Custom => &self.custom_verse_grip,
        }
    }

    /// Arms of a kind, to add to.
    pub fn arms_mut(&mut self, kind: ArmKind) -> &mut Vec<Entry<ArmState>> {
        match kind {
            ArmKind::Inverse3 => &mut self.inverse3,
            ArmKind::Inverse3x => &mut self.inverse3x,
            ArmKind::Minverse => &mut self.minverse,
        }
    }

    /// Grips of a kind, to add to.
    pub fn grips_mut(&mut self, kind: GripKind) -> &mut Vec<Entry<GripState>> {
        match kind {
            GripKind::Wired => &mut self.verse_grip,
            GripKind::Wireless => &mut self.wireless_verse_grip,
            GripKind::Custom => &mut self.custom_verse_grip,
        }
    }
}

/// A frame from its text.
///
/// # Errors
/// The parser's words when the text is not JSON or not of a frame's shape.
pub fn frame(text: &str) -> Result<Frame, serde_json::Error> {
    serde_json::from_str(text)
}
