//! Haptic loop and devices of a scene file: `[haptic]`, `[tool.device]`.

use super::invalid::{Invalid, Result};
use super::raw::{self, At, KindOfDevice, Number, Numbers, Row, Table, Vector};
use super::text::{SceneText, or, shorten};
use super::{Device, DeviceKind, Haptic, Role};
use glam::{DQuat, DVec3};

/// Allowed ticks per second: below, a stiff contact oscillates in any hand; above, a tick has no time left for contacts.
pub(super) const RATES: [f64; 2] = [raw::Haptic::rate_hz.range.low, raw::Haptic::rate_hz.range.high];

/// Haptic loop; missing keys get their defaults.
pub(super) fn haptic(scene: &SceneText, raw: raw::Haptic) -> Result<Haptic> {
    Ok(Haptic { rate: scene.within_or(&raw::Haptic::rate_hz, raw.rate_hz)? })
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

/// Device of a tool.
pub(super) fn device(scene: &SceneText, table: Table<raw::Device>) -> Result<Device> {
    let raw = table.keys;
    let word = scene.choice(&raw::Device::kind, &raw.kind)?;
    let kind = kind(scene, word, &raw)?;
    let limit = |row: Row<Number>, value: Option<At<f64>>| match value {
        Some(value) => scene.number(&row, &value),
        None => Ok(f64::INFINITY),
    };
    let turned = |row: Row<Vector<3>, [f64; 3]>, value: Option<Numbers>| {
        let turn = scene.vector_or(&row, value)?;
        Ok(DQuat::from_scaled_axis(DVec3::from_array(turn.map(f64::to_radians))).to_array())
    };
    Ok(Device {
        kind,
        rendering: scene.choice_or(&raw::Device::rendering, raw.rendering)?,
        force_scale: scene.number_or(&raw::Device::force_scale, raw.force_scale)?,
        max_force: limit(raw::Device::max_force_n, raw.max_force_n)?,
        max_torque: limit(raw::Device::max_torque_n_mm, raw.max_torque_n_mm)?,
        workspace: scene.number_or(&raw::Device::workspace_mm, raw.workspace_mm)?,
        position: scene.vector_or(&raw::Device::position_mm, raw.position_mm)?,
        rotation: turned(raw::Device::turn_deg, raw.turn_deg)?,
        scale: scene.number_or(&raw::Device::scale, raw.scale)?,
        tool: scene.vector_or(&raw::Device::tool_mm, raw.tool_mm)?,
        tool_rotation: turned(raw::Device::tool_turn_deg, raw.tool_turn_deg)?,
        buttons: buttons(scene, raw::Device::buttons.or(raw.buttons).get_ref())?,
        passivity: raw::Device::passivity.or(raw.passivity).into_inner(),
    })
}

fn kind(scene: &SceneText, word: KindOfDevice, raw: &raw::Device) -> Result<DeviceKind> {
    if let (KindOfDevice::Haply, Some(url)) = (word, &raw.url) {
        address(scene, url)?;
    }
    if word != KindOfDevice::Hand {
        let why = "only kind = \"hand\" is a simulated hand";
        scene.needless("hand_mass_g", &raw.hand_mass_g, why)?;
        scene.needless("hand_stiffness_n_m", &raw.hand_stiffness_n_m, why)?;
        scene.needless("hand_damping_n_s_m", &raw.hand_damping_n_s_m, why)?;
        scene.needless("encoder_um", &raw.encoder_um, why)?;
    }
    if word != KindOfDevice::Haply {
        let why = "only kind = \"haply\" asks a service for a device";
        scene.needless("url", &raw.url, why)?;
        scene.needless("device", &raw.device, why)?;
        scene.needless("grip", &raw.grip, why)?;
    }
    let number = |row: Row<Number>, value: &Option<At<f64>>, default| scene.number(&row, &or(value.clone(), default));
    let text = |value: &Option<At<String>>, default: &str| or(value.clone(), default.to_string()).into_inner();
    Ok(match word {
        KindOfDevice::Replay => DeviceKind::Replay,
        KindOfDevice::Null => DeviceKind::Null,
        KindOfDevice::Haply => DeviceKind::Haply {
            url: text(&raw.url, "ws://localhost:10001"),
            device: text(&raw.device, ""),
            grip: text(&raw.grip, ""),
        },
        KindOfDevice::Hand => DeviceKind::Hand {
            mass: number(raw::Device::hand_mass_g, &raw.hand_mass_g, 150.0)?,
            stiffness: number(raw::Device::hand_stiffness_n_m, &raw.hand_stiffness_n_m, 300.0)?,
            damping: number(raw::Device::hand_damping_n_s_m, &raw.hand_damping_n_s_m, 5.0)?,
            encoder: number(raw::Device::encoder_um, &raw.encoder_um, 0.0)?,
        },
    })
}

/// Roles in the order of the buttons, each but `none` at most once; a device has at most 32 buttons.
fn buttons(scene: &SceneText, words: &[At<String>]) -> Result<Vec<Role>> {
    let mut taken: Vec<(Role, usize)> = vec![];
    for word in words {
        let role = scene.choice(&raw::Device::buttons.each(), word)?;
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
