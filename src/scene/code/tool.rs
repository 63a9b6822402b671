//! Checks of tools made in code, and of their devices.

use super::Part;
use crate::math::elementary::acos;
use crate::scene::invalid::Result;
use crate::scene::text::{difference, normalized};
use crate::scene::tools::{MOST_SAMPLES, NORMAL_SLACK, dot, samples, too_large};
use crate::scene::{Carve, Coupling, Device, DeviceKind, Motion, Tool};

/// Checks a tool made in code.
pub(super) fn check(part: &Part, tool: &Tool) -> Result<()> {
    // mass, geometry and coupling
    part.positive("mass", &[tool.mass])?;
    part.positive("inertia", &tool.inertia)?;
    let odd = too_large(tool.inertia).map(|[largest, _]| largest);
    odd.map_or(Ok(()), |moment| Err(part.of("inertia").refuse(moment, "at most the sum of the other two moments")))?;
    let Carve { distance, pressure, .. } = tool.carve.unwrap_or_default();
    part.not_negative("tip_radius, carve.distance, carve.pressure", &[tool.tip_radius, distance, pressure])?;
    part.finite("points", tool.points.as_flattened())?;
    part.finite("mesh.positions", tool.mesh.positions.as_flattened())?;
    let vertices = tool.mesh.positions.len() as u32;
    let odd = tool.mesh.triangles.as_flattened().iter().find(|v| **v >= vertices);
    odd.map_or(Ok(()), |v| Err(part.of("mesh.triangles").refuse(v, "numbers of its vertices, from 0")))?;
    let Coupling { stiffness, damping, angular_stiffness, angular_damping } = tool.coupling;
    part.not_negative("coupling", &[stiffness, damping, angular_stiffness, angular_damping])?;
    if tool.free.is_none() {
        part.positive("coupling.stiffness, coupling.angular_stiffness", &[stiffness, angular_stiffness])?;
    }
    // hand path
    let way = part.of("trajectory");
    way.that(!tool.trajectory.is_empty(), "empty", "at least one pose")?;
    for pose in &tool.trajectory {
        way.finite("time, position", &[&[pose.time][..], &pose.position].concat())?;
        way.unit("rotation", &pose.rotation)?;
    }
    let rises = tool.trajectory.windows(2).all(|pair| pair[1].time > pair[0].time);
    way.that(rises, "times that do not rise", "times that rise")?;
    // one kind of surface
    if let Some(round) = &tool.round {
        part.of("round").positive("radius", &[round.radius])?;
        part.of("round").finite("ends", round.ends.as_flattened())?;
        part.of("round").that(tool.blade.is_none() && tool.points.is_empty(), "beside a blade or points", "alone")?;
    }
    if let Some(Motion { velocity, angular_velocity }) = &tool.free {
        part.of("free").finite("velocity, angular_velocity", &[*velocity, *angular_velocity].concat())?;
    }
    if let Some(device) = &tool.device {
        check_device(&part.of("device"), device)?;
    }
    if let Some(lines) = &tool.lines {
        let alone = tool.blade.is_none() && tool.points.is_empty() && tool.round.is_none();
        part.of("lines").that(alone, "beside a blade, points or a round surface", "alone")?;
        part.of("lines").finite("positions", lines.positions.as_flattened())?;
        part.of("lines").not_negative("radius", &[lines.radius])?;
        let count = lines.positions.len() as u32;
        let fits = lines.segments.iter().all(|[a, b]| a != b && *a < count && *b < count);
        part.of("lines.segments").that(fits, "others", "pairs of numbers of different vertices, from 0")?;
    }
    if let Some(half) = &tool.cuboid {
        part.positive("cuboid", half)?;
        let alone = tool.blade.is_none() && tool.round.is_none() && tool.lines.is_none() && tool.points.is_empty();
        part.of("cuboid").that(alone, "beside a blade, points, lines or a round surface", "alone")?;
    }
    // blade
    if let Some(blade) = &tool.blade {
        let part = part.of("blade");
        part.finite("edge", blade.edge.as_flattened())?;
        let apart = blade.edge.windows(2).all(|pair| pair[0] != pair[1]);
        part.of("edge").that(blade.edge.len() > 1 && apart, "fewer", "two or more points, each apart from the last")?;
        part.unit("normal", &blade.normal)?;
        let heel = blade.edge[blade.edge.len() - 1];
        let chord = normalized(difference(heel, blade.edge[0]));
        let angle = chord.map_or(0.0, |chord| 90.0 - acos(dot(chord, blade.normal).abs().min(1.0)).to_degrees());
        part.of("edge").that(chord.is_some(), "closed", "one whose heel is apart from its tip")?;
        part.of("normal").that(angle <= NORMAL_SLACK, format!("{angle:.1} degrees off"), "across the edge")?;
        let lengths = [blade.thickness, blade.edge_spacing, blade.flat_spacing, blade.depth];
        part.positive("thickness, edge_spacing, flat_spacing, depth", &lengths)?;
        let found = samples(&blade.edge, blade.depth, [blade.edge_spacing, blade.flat_spacing]);
        part.of("edge_spacing, flat_spacing").that(
            found <= MOST_SAMPLES,
            found,
            "such that fewer than 100000 points touch",
        )?;
    }
    Ok(())
}

fn check_device(part: &Part, device: &Device) -> Result<()> {
    part.positive("scale", &[device.scale])?;
    part.not_negative("force_scale", &[device.force_scale])?;
    part.finite("position, tool", &[device.position, device.tool].concat())?;
    part.unit("rotation", &device.rotation)?;
    part.unit("tool_rotation", &device.tool_rotation)?;
    let limits = [device.max_force, device.max_torque, device.workspace];
    let odd = limits.iter().find(|limit| limit.is_nan() || **limit < 0.0);
    odd.map_or(Ok(()), |limit| {
        Err(part.of("max_force, max_torque, workspace").refuse(limit, "numbers of at least 0, or infinite"))
    })?;
    if let DeviceKind::Hand { mass, stiffness, damping, encoder } = device.kind {
        part.of("kind").positive("mass", &[mass])?;
        part.of("kind").not_negative("stiffness, damping, encoder", &[stiffness, damping, encoder])?;
    }
    Ok(())
}
