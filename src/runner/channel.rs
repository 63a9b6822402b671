//! A tool's device, with the servo between it and the simulation.

use super::{RING, Refused};
use crate::error::Result;
use crate::haptic::Hand;
use crate::haptic::device::{Device, Limits, Workspace};
use crate::haptic::devices::open;
use crate::haptic::replay::{Recorder, Row};
use crate::haptic::servo::{Servo, Settings};
use crate::scene::{DeviceKind, Scene, device_of};
use crate::step::Simulation;
use rtrb::Consumer;
use std::collections::BTreeMap;

/// Most rows for which memory is reserved at the start; a larger problem reallocates once.
const MOST_ROWS: usize = 600;

/// See the module.
pub(super) struct Channel {
    pub servo: Servo,
    pub device: Box<dyn Device>,
    /// The device moves the tool; false if the tool follows its trajectory.
    pub moves: bool,
}

/// Devices and servos of the tools held by a hand, at rest. Under the wall clock those without a device are guarded too. `attached` devices
/// replace the scene's. With `rows` each device is recorded.
pub(super) fn channels(
    scene: &Scene,
    simulation: &Simulation,
    live: bool,
    mut attached: BTreeMap<usize, Box<dyn Device>>,
    mut rows: Option<&mut Vec<(usize, Consumer<Row>)>>,
) -> Result<Vec<Channel>> {
    let times = [1.0 / scene.haptic.rate, scene.time.step];
    let others = scene.skins.len() + scene.planes.len() + scene.tools.len();
    let most = scene.contact.map_or(0, |c| 3 * c.max_contacts as usize * others).min(MOST_ROWS);
    let held = simulation.tools.iter().zip(&scene.tools).take_while(|(tool, _)| !tool.free);
    let mut out = vec![];
    // the attached device, or the scene's
    for (number, (tool, asked)) in held.enumerate() {
        let spec = asked.device.clone().unwrap_or_default();
        let own = attached.remove(&number);
        let moves = own.is_some() || asked.device.is_some();
        let mut device = match own {
            Some(device) => device,
            None if !live && matches!(spec.kind, DeviceKind::Haply { .. }) => {
                let at = scene.at(&device_of(&asked.name));
                return Err(Refused::NeedsWallClock { at, tool: asked.name.clone() }.into());
            }
            None => open(&spec, asked)?,
        };
        // record it
        if let Some(rows) = &mut rows {
            let ticks = (RING * scene.haptic.rate) as usize;
            let (recorder, written) = Recorder::new(device, Workspace::new(&spec), ticks);
            device = Box::new(recorder);
            rows.push((number, written));
        }
        // settings of the servo; a trajectory has no force limits
        let unlimited = Limits { force: f64::INFINITY, torque: f64::INFINITY };
        let can = if moves { device.limits() } else { unlimited };
        let plain = Settings::new(&spec, tool.coupling, can, times);
        let guarded = moves || live;
        let passivity = plain.passivity && guarded;
        let settings = Settings { guarded, passivity, resolution: device.resolution(), rows: most, ..plain };
        let (position, rotation) = tool.hand(0.0);
        out.push(Channel { servo: Servo::new(settings, Hand { position, rotation }), device, moves });
    }
    Ok(out)
}
