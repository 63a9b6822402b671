//! From what a scene asks for to an open device.

use super::device::{Device, Workspace};
use super::hand::SimulatedHand;
use super::replay::{Null, Path, Replay};
use crate::error::{Error, Result};
use crate::scene::{self, DeviceKind, Tool};

/// Opens a device for a tool.
///
/// # Errors
/// When the device cannot be had.
pub fn open(device: &scene::Device, tool: &Tool) -> Result<Box<dyn Device>> {
    let path = Path { poses: tool.trajectory.as_slice().into(), workspace: Workspace::new(device) };
    Ok(match &device.kind {
        DeviceKind::Replay => Box::new(Replay(path)),
        DeviceKind::Null => Box::new(Null(path)),
        DeviceKind::Hand { mass, stiffness, damping, encoder } => {
            Box::new(SimulatedHand::new(path, [*mass, *stiffness, *damping, *encoder]))
        }
        DeviceKind::Haply { url, .. } => {
            return Err(Error::Usage {
                what: format!(
                    "the tool \"{}\" asks for a haply device at {url}, which this program cannot open",
                    tool.name
                ),
                fix: "write kind = \"hand\", \"replay\" or \"null\" in its [tool.device]".into(),
            });
        }
    })
}
