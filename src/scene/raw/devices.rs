//! `[haptic]` and `[tool.device]` as TOML has them.

use super::{At, Numbers};

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::scene) struct Haptic {
    pub rate_hz: Option<At<f64>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::scene) struct Device {
    pub kind: At<String>,
    pub rendering: Option<At<String>>,
    pub force_scale: Option<At<f64>>,
    pub max_force_n: Option<At<f64>>,
    pub max_torque_n_mm: Option<At<f64>>,
    pub workspace_mm: Option<At<f64>>,
    pub position_mm: Option<Numbers>,
    pub turn_deg: Option<Numbers>,
    pub scale: Option<At<f64>>,
    pub tool_mm: Option<Numbers>,
    pub tool_turn_deg: Option<Numbers>,
    pub buttons: Option<Vec<At<String>>>,
    pub passivity: Option<At<bool>>,
    pub hand_mass_g: Option<At<f64>>,
    pub hand_stiffness_n_m: Option<At<f64>>,
    pub hand_damping_n_s_m: Option<At<f64>>,
    pub encoder_um: Option<At<f64>>,
    pub url: Option<At<String>>,
    pub device: Option<At<String>>,
    pub grip: Option<At<String>>,
}
