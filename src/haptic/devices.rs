//! Opens the devices that a scene names.

use super::device::{Device, Workspace};
use super::hand::SimulatedHand;
#[cfg(feature = "haply")]
use super::haply;
use super::replay::{Null, Path, Replay};
use crate::error::Result;
use crate::scene::{self, DeviceKind, Tool};

/// Opens a device for a tool.
///
/// # Errors
/// If the device is not available.
pub fn open(device: &scene::Device, tool: &Tool) -> Result<Box<dyn Device>> {
    let path = Path { poses: tool.trajectory.as_slice().into(), workspace: Workspace::new(device) };
    Ok(match &device.kind {
        DeviceKind::Replay => Box::new(Replay(path)),
        DeviceKind::Null => Box::new(Null(path)),
        DeviceKind::Hand { mass, stiffness, damping, encoder } => {
            Box::new(SimulatedHand::new(path, [*mass, *stiffness, *damping, *encoder]))
        }
        #[cfg(not(feature = "haply"))]
        DeviceKind::Haply { .. } => {
            return Err(super::Refused::NotBuilt { tool: tool.name.clone() }.into());
        }
        #[cfg(feature = "haply")]
        DeviceKind::Haply { url, device: arm, grip } => {
            let named = |name: &String| (!name.is_empty()).then(|| name.clone());
            let mut settings = haply::Settings { url: url.clone(), ..haply::Settings::default() };
            (settings.device, settings.grip) = (named(arm), named(grip));
            if device.max_force.is_finite() {
                settings.limits.force = device.max_force;
            }
            Box::new(haply::open(&settings)?)
        }
    })
}
