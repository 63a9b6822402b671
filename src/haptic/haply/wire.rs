//! Frames of the Inverse Service on its simulation channel, as plain structs; those of the client are in [`command`](super::command).
//!
//! Text frames of JSON; newtons, metres, m/s; quaternions x, y, z, w; right-handed axes. The service's first frame is its inventory, with
//! `config`; later ones have `state` and `status` only. Parsing is tolerant: unknown fields are ignored, a device without `state` is kept
//! without one, and missing parts of a `transform` are the identity. A number written as `null` (as JSON writers do with NaN) is read as
//! NaN, which distinguishes it from a frame of the wrong shape.
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

/// Tolerance of a quaternion's length: the rounding error of three printed digits.
const QUATERNION_SLACK: f64 = 0.01;

impl Quaternion {
    /// Normalised rotation; `None` if a number is non-finite or the length is not 1.
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

/// Workspace transform of the service; already applied to its positions.
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

/// State of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArmState {
    /// m; `None` for an arm that is led in its joints, which has no pose here and does not spoil those of others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cursor_position: Option<Vector>,
    /// m/s
    #[serde(default)]
    pub cursor_velocity: Vector,
    /// Force of the motors, N.
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
    /// True while pressed.
    pub a: bool,
    /// True while pressed.
    pub b: bool,
    /// True while pressed.
    pub c: bool,
}

impl Buttons {
    /// Bits 0, 1 and 2 for a, b and c.
    pub fn bits(self) -> u32 {
        u32::from(self.a) | u32::from(self.b) << 1 | u32::from(self.c) << 2
    }

    /// From the bits.
    pub fn of(bits: u32) -> Self {
        Self { a: bits & 1 != 0, b: bits & 2 != 0, c: bits & 4 != 0 }
    }
}

/// State of a grip.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GripState {
    /// Scalar last.
    pub orientation: Quaternion,
    /// Pressed buttons.
    #[serde(default)]
    pub buttons: Buttons,
}

/// Status fields that the client uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Status {
    /// True if the arm's position is known; absent for grips.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<bool>,
    /// True if the device accepts commands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ready: Option<bool>,
}

/// Device in a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry<S> {
    /// Name of the device, as printed on it.
    pub device_id: String,
    /// In the inventory only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub config: Option<Config>,
    /// `None` while the device has no state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<S>,
    /// Validity of the state.
    #[serde(default)]
    pub status: Status,
}

/// Configuration for a session.
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
    /// Number of this connection.
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

/// Kinds of arms.
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

    /// Its name in frames.
    pub fn word(self) -> &'static str {
        match self {
            Self::Inverse3 => "inverse3",
            Self::Inverse3x => "inverse3x",
            Self::Minverse => "minverse",
        }
    }
}

/// Kinds of grips.
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

    /// Its name in frames.
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

    /// Arms of a kind, mutable.
    pub fn arms_mut(&mut self, kind: ArmKind) -> &mut Vec<Entry<ArmState>> {
        match kind {
            ArmKind::Inverse3 => &mut self.inverse3,
            ArmKind::Inverse3x => &mut self.inverse3x,
            ArmKind::Minverse => &mut self.minverse,
        }
    }

    /// Grips of a kind, mutable.
    pub fn grips_mut(&mut self, kind: GripKind) -> &mut Vec<Entry<GripState>> {
        match kind {
            GripKind::Wired => &mut self.verse_grip,
            GripKind::Wireless => &mut self.wireless_verse_grip,
            GripKind::Custom => &mut self.custom_verse_grip,
        }
    }
}

/// Parses a frame.
///
/// # Errors
/// The parser's error if the text is not JSON or not of a frame's shape.
pub fn frame(text: &str) -> Result<Frame, serde_json::Error> {
    serde_json::from_str(text)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// First frame of a service 3.5, abridged.
    pub const INVENTORY: &str = r#"{ "session_id": 7,
      "inverse3": [ { "device_id": "049D",
        "config": { "type": "inverse3", "handedness": "right", "basis": {"permutation": "XYZ"},
                    "gravity_compensation": {"enabled": true, "scaling_factor": 1.0},
                    "filters": {"force_gate": {"gain": 0.3}, "damping": {"scalar": 0.0}} },
        "state": { "cursor_position": {"x":0,"y":-0.12,"z":0.15}, "cursor_velocity": {"x":0,"y":0,"z":0},
                   "current_cursor_force": {"x":0,"y":0,"z":0}, "body_orientation": {"x":0,"y":0,"z":0,"w":1},
                   "angular_position": {"a0":0,"a1":0,"a2":0}, "angular_velocity": {"a0":0,"a1":0,"a2":0},
                   "control_domain": "cartesian", "control_mode": "idle", "mode": "idle",
                   "transform": { } },
        "status": { "calibrated": true, "in_use": false, "power_supply": true, "ready": true, "started": true } } ],
      "wireless_verse_grip": [ { "device_id": "1402",
        "state": { "orientation": {"x":0,"y":0,"z":0,"w":1}, "buttons": {"a":false,"b":false,"c":false},
                   "hall": 0, "battery_level": 0.9 },
        "status": { "ready": true, "connected": true, "awake": true } } ] }"#;

    #[test]
    fn the_inventory_of_the_documentation_is_read() {
        let frame = frame(INVENTORY).expect("the documentation's frame");
        assert_eq!(frame.session_id, Some(7));
        let arm = &frame.inverse3[0];
        assert_eq!(arm.device_id, "049D");
        assert_eq!(arm.status, Status { calibrated: Some(true), ready: Some(true) });
        let state = arm.state.expect("it has one");
        assert_eq!(state.cursor_position.map(DVec3::from), Some(DVec3::new(0.0, -0.12, 0.15)));
        assert_eq!(state.transform, Transform::default());
        assert_eq!(arm.config.as_ref().and_then(|c| c.handedness.as_deref()), Some("right"));
        let grip = frame.wireless_verse_grip[0].state.expect("it has one");
        assert_eq!((grip.orientation.rotation(), grip.buttons.bits()), (Some(DQuat::IDENTITY), 0));
        assert!(frame.inverse3x.is_empty() && frame.minverse.is_empty() && frame.verse_grip.is_empty());
    }

    #[test]
    fn parts_of_a_transform_that_are_left_out_are_the_identity() {
        let text = INVENTORY.replace(r#""transform": { }"#, r#""transform": { "position": {"x":1,"y":2,"z":3} }"#);
        let transform = frame(&text).expect("a frame").inverse3[0].state.expect("it has one").transform;
        assert_eq!(DVec3::from(transform.position), DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(DVec3::from(transform.scale), DVec3::ONE);
        assert_eq!(transform.rotation.rotation(), Some(DQuat::IDENTITY));
    }

    #[test]
    fn arms_and_grips_of_every_kind_are_found() {
        for kind in ArmKind::ALL {
            let frame =
                frame(&INVENTORY.replace("\"inverse3\": [", &format!("\"{}\": [", kind.word()))).expect("a frame");
            assert_eq!(frame.arms(kind).len(), 1, "{kind:?}");
            assert_eq!(ArmKind::ALL.iter().map(|other| frame.arms(*other).len()).sum::<usize>(), 1);
        }
        for kind in GripKind::ALL {
            let frame = frame(&INVENTORY.replace("wireless_verse_grip", kind.word())).expect("a frame");
            assert_eq!(frame.grips(kind).len(), 1, "{kind:?}");
            assert_eq!(GripKind::ALL.iter().map(|other| frame.grips(*other).len()).sum::<usize>(), 1);
        }
    }

    #[test]
    fn a_null_is_a_number_that_is_none_and_a_missing_number_is_another_shape() {
        let null = frame(&INVENTORY.replace("-0.12", "null")).expect("a frame");
        assert!(null.inverse3[0].state.and_then(|state| state.cursor_position).expect("it has one").y.is_nan());
        assert!(frame(&INVENTORY.replace("\"y\":-0.12,", "")).is_err());
        assert!(frame(&INVENTORY.replace("-0.12", "NaN")).is_err());
        assert!(frame(&INVENTORY.replace("-0.12", "1e999")).is_err());
        assert!(frame(&INVENTORY.replace("-0.12", "\"up\"")).is_err());
        assert!(frame(&INVENTORY[..INVENTORY.len() / 2]).is_err());
    }

    #[test]
    fn a_quaternion_of_another_length_is_no_rotation() {
        let q = |w: f64| Quaternion { x: 0.0, y: 0.0, z: 0.0, w };
        assert!(q(0.995).rotation().is_some_and(|q| (q.w - 1.0).abs() < 1e-15));
        for w in [0.0, 0.9, 1.1, f64::NAN, f64::INFINITY, f64::MAX] {
            assert_eq!(q(w).rotation(), None, "{w}");
        }
    }

    #[test]
    fn buttons_are_bits_in_their_order() {
        for bits in 0..8 {
            assert_eq!(Buttons::of(bits).bits(), bits);
        }
        assert_eq!(Buttons { a: false, b: true, c: true }.bits(), 0b110);
    }
}
