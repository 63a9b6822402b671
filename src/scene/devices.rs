//! Haptic loop and devices of a scene file: `[haptic]`, `[tool.device]`.

use super::invalid::{Invalid, Result};
use super::raw::{self, At, Table};
use super::text::{
    Bound, DAMPING, DEGREE, GRAM, HERTZ, MICRON, MM, N_MM, NEWTON, PLAIN, STIFFNESS, SceneText, or, or_vector, shorten,
};
use glam::{DQuat, DVec3};

/// The haptic loop.
#[derive(Clone, Copy, Debug)]
pub struct Haptic {
    /// Ticks per second.
    pub rate: f64,
}

/// Rendering method of the force on the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Rendering {
    /// Virtual coupling between hand and tool, in series with the skin.
    #[default]
    Coupling,
    /// Direct: as if the hand held the tool rigidly, so that it feels the skin's compliance only.
    Direct,
}

/// Role of a button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Nothing.
    None,
    /// The blade cuts while it is pressed, and is blunt otherwise.
    Active,
    /// While it is pressed the hand moves and the tool stays.
    Clutch,
    /// While it is pressed tool and force are frozen.
    Freeze,
}

/// Kind of a tool's device.
#[derive(Clone, Debug, PartialEq)]
pub enum DeviceKind {
    /// The tool's recorded path, which ignores forces.
    Replay,
    /// A simulated hand that follows the tool's path and yields to the force.
    Hand {
        /// kg
        mass: f64,
        /// Stiffness of the spring to the path, N/m.
        stiffness: f64,
        /// N·s/m
        damping: f64,
        /// Resolution of the encoders, m; 0 for exact ones.
        encoder: f64,
    },
    /// At rest at the start of the tool's path.
    Null,
    /// A device behind the Haply Inverse Service.
    Haply {
        /// Address of the service.
        url: String,
        /// Name of the device; empty for the first one.
        device: String,
        /// Name of the grip; empty for the first one.
        grip: String,
    },
}

/// Device that holds a tool.
#[derive(Clone, Debug)]
pub struct Device {
    /// Kind of device.
    pub kind: DeviceKind,
    /// Rendering method.
    pub rendering: Rendering,
    /// Newtons on the hand per newton on the tool.
    pub force_scale: f64,
    /// Force limit, N; infinite for the device's own.
    pub max_force: f64,
    /// Torque limit, N·m; infinite for the device's own.
    pub max_torque: f64,
    /// Largest distance of the end effector from the device's origin, m of the device; readings beyond it are invalid. Infinite for a tool
    /// without a device.
    pub workspace: f64,
    /// Position of the device's origin in the scene, m.
    pub position: [f64; 3],
    /// Rotation of the device's frame, unit quaternion.
    pub rotation: [f64; 4],
    /// Metres of the scene per metre of the device.
    pub scale: f64,
    /// Origin of the tool in the frame of the device's end effector, m.
    pub tool: [f64; 3],
    /// Rotation of the tool in that frame, unit quaternion.
    pub tool_rotation: [f64; 4],
    /// `[button]` role.
    pub buttons: Vec<Role>,
    /// Use the passivity controller.
    pub passivity: bool,
}

impl Default for Device {
    fn default() -> Self {
        Self {
            kind: DeviceKind::Replay,
            rendering: Rendering::Coupling,
            force_scale: 1.0,
            max_force: f64::INFINITY,
            max_torque: f64::INFINITY,
            workspace: f64::INFINITY,
            position: [0.0; 3],
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: 1.0,
            tool: [0.0; 3],
            tool_rotation: [0.0, 0.0, 0.0, 1.0],
            buttons: vec![],
            passivity: true,
        }
    }
}

/// Allowed ticks per second: below, a stiff contact oscillates in any hand; above, a tick has no time left for contacts.
pub(super) const RATES: [f64; 2] = [100.0, 4000.0];

/// Default workspace radius, mm: larger than that of any device, so that only faulty readings exceed it.
const WORKSPACE: f64 = 10_000.0;

/// Haptic loop; missing keys get their defaults.
pub(super) fn haptic(scene: &SceneText, raw: raw::Haptic) -> Result<Haptic> {
    let rate = or(raw.rate_hz, 1000.0);
    let found = scene.number("rate_hz", &rate, HERTZ, Bound::Positive)?;
    if !(RATES[0]..=RATES[1]).contains(&found) {
        return Err(Invalid::Number {
            at: scene.location(rate.span()),
            key: "rate_hz".to_string(),
            found,
            wanted: "a number from 100 to 4000",
            unit: HERTZ.name,
            example: 1000.0,
        });
    }
    Ok(Haptic { rate: found })
}

/// Refuses addresses other than `ws://host:port`.
fn address(scene: &SceneText, url: &At<String>) -> Result<()> {
    let found = url.get_ref();
    let refused = |problem| Err(Invalid::Url { at: scene.location(url.span()), found: shorten(found), problem });
    let Some(rest) = found.strip_prefix("ws://") else { return refused("it does not begin with ws://") };
    let authority = rest.split('/').next().unwrap_or_default();
    let Some((host, port)) = authority.rsplit_once(':') else { return refused("it has no port") };
    if host.is_empty() || !host.chars().all(|c| c.is_ascii_alphanumeric() || "-._[]:".contains(c)) {
        return refused("it has no host");
    }
    if port.parse::<u16>().is_err() { refused("its port is no number up to 65535") } else { Ok(()) }
}

#[derive(Clone, Copy, PartialEq)]
enum Word {
    Replay,
    Hand,
    Null,
    Haply,
}

/// Device of a tool.
pub(super) fn device(scene: &SceneText, table: Table<raw::Device>) -> Result<Device> {
    let raw = table.keys;
    let words = [("replay", Word::Replay), ("hand", Word::Hand), ("null", Word::Null), ("haply", Word::Haply)];
    let word = scene.choice("kind", &raw.kind, &words)?;
    let kind = kind(scene, word, &raw)?;
    let renderings = [("coupling", Rendering::Coupling), ("direct", Rendering::Direct)];
    let number = |key, value, default, unit, bound| scene.number(key, &or(value, default), unit, bound);
    let limit = |key, value: Option<At<f64>>, unit| match value {
        Some(value) => scene.number(key, &value, unit, Bound::NotNegative),
        None => Ok(f64::INFINITY),
    };
    let turned = |key, value| {
        let turn: [f64; 3] = scene.vector(key, &or_vector(value, &[0.0; 3]), DEGREE, Bound::Finite)?;
        Ok(DQuat::from_scaled_axis(DVec3::from_array(turn.map(f64::to_radians))).to_array())
    };
    Ok(Device {
        kind,
        rendering: scene.choice("rendering", &or(raw.rendering, "coupling".to_string()), &renderings)?,
        force_scale: number("force_scale", raw.force_scale, 1.0, PLAIN, Bound::Positive)?,
        max_force: limit("max_force_n", raw.max_force_n, NEWTON)?,
        max_torque: limit("max_torque_n_mm", raw.max_torque_n_mm, N_MM)?,
        workspace: number("workspace_mm", raw.workspace_mm, WORKSPACE, MM, Bound::Positive)?,
        position: scene.vector("position_mm", &or_vector(raw.position_mm, &[0.0; 3]), MM, Bound::Finite)?,
        rotation: turned("turn_deg", raw.turn_deg)?,
        scale: number("scale", raw.scale, 1.0, PLAIN, Bound::Positive)?,
        tool: scene.vector("tool_mm", &or_vector(raw.tool_mm, &[0.0; 3]), MM, Bound::Finite)?,
        tool_rotation: turned("tool_turn_deg", raw.tool_turn_deg)?,
        buttons: buttons(scene, raw.buttons.as_deref().unwrap_or_default())?,
        passivity: raw.passivity.is_none_or(|on| *on.get_ref()),
    })
}

fn kind(scene: &SceneText, word: Word, raw: &raw::Device) -> Result<DeviceKind> {
    if let (Word::Haply, Some(url)) = (word, &raw.url) {
        address(scene, url)?;
    }
    if word != Word::Hand {
        let why = "only kind = \"hand\" is a simulated hand";
        scene.needless("hand_mass_g", &raw.hand_mass_g, why)?;
        scene.needless("hand_stiffness_n_m", &raw.hand_stiffness_n_m, why)?;
        scene.needless("hand_damping_n_s_m", &raw.hand_damping_n_s_m, why)?;
        scene.needless("encoder_um", &raw.encoder_um, why)?;
    }
    if word != Word::Haply {
        let why = "only kind = \"haply\" asks a service for a device";
        scene.needless("url", &raw.url, why)?;
        scene.needless("device", &raw.device, why)?;
        scene.needless("grip", &raw.grip, why)?;
    }
    let number = |key, value: &Option<At<f64>>, default, unit, bound| {
        scene.number(key, &or(value.clone(), default), unit, bound)
    };
    let text = |value: &Option<At<String>>, default: &str| or(value.clone(), default.to_string()).into_inner();
    Ok(match word {
        Word::Replay => DeviceKind::Replay,
        Word::Null => DeviceKind::Null,
        Word::Haply => DeviceKind::Haply {
            url: text(&raw.url, "ws://localhost:10001"),
            device: text(&raw.device, ""),
            grip: text(&raw.grip, ""),
        },
        Word::Hand => DeviceKind::Hand {
            mass: number("hand_mass_g", &raw.hand_mass_g, 150.0, GRAM, Bound::Positive)?,
            stiffness: number("hand_stiffness_n_m", &raw.hand_stiffness_n_m, 300.0, STIFFNESS, Bound::Positive)?,
            damping: number("hand_damping_n_s_m", &raw.hand_damping_n_s_m, 5.0, DAMPING, Bound::NotNegative)?,
            encoder: number("encoder_um", &raw.encoder_um, 0.0, MICRON, Bound::NotNegative)?,
        },
    })
}

/// Roles in the order of the buttons, each but `none` at most once; a device has at most 32 buttons.
fn buttons(scene: &SceneText, words: &[At<String>]) -> Result<Vec<Role>> {
    let roles = [("none", Role::None), ("active", Role::Active), ("clutch", Role::Clutch), ("freeze", Role::Freeze)];
    let mut taken: Vec<(Role, usize)> = vec![];
    for word in words {
        let role = scene.choice("buttons", word, &roles)?;
        let line = scene.location(word.span()).line;
        if let Some((_, first)) = taken.iter().find(|(other, _)| *other == role && role != Role::None) {
            return Err(Invalid::Duplicate {
                at: scene.location(word.span()),
                what: "button",
                name: word.get_ref().clone(),
                first: *first,
            });
        }
        taken.push((role, line));
    }
    if let Some(word) = words.get(u32::BITS as usize) {
        let found = words.len() as u32;
        let at = scene.location(word.span());
        return Err(Invalid::Count { at, key: "buttons".into(), found, min: 0, max: u32::BITS });
    }
    Ok(taken.into_iter().map(|(role, _)| role).collect())
}
