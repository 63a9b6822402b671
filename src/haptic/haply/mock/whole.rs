//! Frames as the service documents them, whole: the keys that this crate's client passes over, for other clients of the stand-in.
//!
//! The stand-in has one pose and one force per arm; joints are at rest, filters and navigation are off, batteries are full.

use super::super::wire::{ArmKind, Frame, GripKind};
use serde_json::{Map, Value, json};

/// Text of a frame; `inventory` for the first one of a connection, which has configurations.
pub(super) fn text(frame: &Frame, inventory: bool) -> String {
    let mut tree = serde_json::to_value(frame).expect("strings and numbers always have a tree");
    for kind in ArmKind::ALL {
        let pushed = |entry: &Value| {
            let force = &entry["state"]["current_cursor_force"];
            ["x", "y", "z"].iter().any(|axis| force[axis].as_f64().is_some_and(|part| part != 0.0))
        };
        for entry in entries(&mut tree, kind.word()) {
            let mode = if pushed(entry) { "force" } else { "idle" };
            add(entry, "state", arm_state(mode));
            add(entry, "status", json!({ "in_use": mode == "force", "power_supply": true, "started": true }));
            if inventory {
                let config = arm_config(kind.word(), &entry["device_id"]);
                add(entry, "config", config);
            }
        }
    }
    for kind in GripKind::ALL {
        for entry in entries(&mut tree, kind.word()) {
            let (state, status) = match kind {
                GripKind::Wired => (json!({ "hall": 0, "button": false }), json!({ "error": 0 })),
                GripKind::Wireless | GripKind::Custom => (
                    json!({ "hall": 0, "battery_level": 1.0, "battery_voltage": 4.2 }),
                    json!({ "connected": true, "awake": true }),
                ),
            };
            add(entry, "state", state);
            add(entry, "state", json!({ "transform": {} }));
            add(entry, "status", status);
            if inventory {
                add(entry, "config", grip_config());
            }
        }
    }
    tree.to_string()
}

/// Answer to `GET /version`.
pub(super) fn version(version: &str) -> String {
    let tree = json!({
        "project_name": "cutis haply-mock",
        "project_version": version,
        "build_time": "1970-01-01T00:00:00Z",
        "git_branch": "",
        "git_describe": version,
        "git_hash": "",
        "git_tag": version,
    });
    tree.to_string()
}

/// Devices of a kind.
fn entries<'a>(tree: &'a mut Value, kind: &str) -> impl Iterator<Item = &'a mut Value> {
    tree.get_mut(kind).and_then(Value::as_array_mut).into_iter().flatten()
}

/// Adds keys to a table of a device; those that are there stay.
fn add(entry: &mut Value, table: &str, more: Value) {
    let (Some(table), Value::Object(more)) = (entry[table].as_object_mut(), more) else { return };
    let all: Map<String, Value> = more;
    for (key, value) in all {
        table.entry(key).or_insert(value);
    }
}

fn arm_state(mode: &str) -> Value {
    let joints = json!({ "a0": 0.0, "a1": 0.0, "a2": 0.0 });
    json!({
        "angular_position": joints,
        "angular_velocity": joints,
        "body_orientation": { "x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0 },
        "control_domain": "cartesian",
        "control_mode": mode,
        "mode": "idle",
    })
}

fn arm_config(kind: &str, id: &Value) -> Value {
    json!({
        "device_info": { "id": id, "major_version": 1, "minor_version": 0, "device_type": kind, "uuid": id },
        "port": "",
        "extended_device_id": id,
        "extended_firmware_version": "",
        "gravity_compensation": { "enabled": true, "scaling_factor": 1.0 },
        "torque_scaling": { "enabled": false },
        "home_return": { "enabled": false },
        "basis": { "permutation": "XYZ" },
        "preset": "defaults",
        "filters": { "force_gate": { "gain": 0.0 }, "damping": { "scalar": 0.0 } },
        "mount": {},
    })
}

fn grip_config() -> Value {
    json!({
        "port": "",
        "major_version": 1,
        "minor_version": 0,
        "hardware_version": 1,
        "basis": { "permutation": "XYZ" },
        "preset": "defaults",
        "mount": {},
    })
}
