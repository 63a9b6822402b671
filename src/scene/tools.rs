//! Tools and contact of a scene file.

use super::devices::device;
use super::files::{Files, trajectory};
use super::invalid::{Invalid, Result};
use super::obj::{self, angle_cone, filter, lines};
use super::raw::{self, At, Table};
use super::round::{path, round};
use super::text::{SceneText, Taken, difference, normalized, or};
use super::{Blade, Carve, Contact, Correction, Coupling, Loop, Pose, Skin, Tool, ToolMesh};
use crate::formats::obj::Obj;
use crate::math::elementary::{acos, hypot};
use std::ops::Range;

/// Allowed deviation of a blade's normal from the right angle to its edge, degrees. A blade's plane contains its edge; the tolerance admits
/// slightly bent edges. With a larger one the flats would visibly leave the cutting plane.
pub(super) const NORMAL_SLACK: f64 = 6.0;

/// Maximum contact samples of a blade: a scalpel has a few hundred, and detection visits each in every step.
pub(super) const MOST_SAMPLES: f64 = 1e5;

/// Share by which a moment of inertia may exceed the sum of the others: digits of a file.
const ROUNDED: f64 = 1e-3;

/// Tools in the file's order, with their meshes and trajectories.
pub(super) fn tools(
    scene: &SceneText,
    files: &Files,
    raw: Vec<Table<raw::Tool>>,
    taken: &mut Taken,
) -> Result<Vec<Tool>> {
    raw.into_iter()
        .map(|table| {
            let name = scene.name("tool", &table.keys.name, taken)?;
            tool(scene, files, name, table)
        })
        .collect()
}

fn tool(scene: &SceneText, files: &Files, name: String, table: Table<raw::Tool>) -> Result<Tool> {
    let (at, raw) = (table.span, table.keys);
    let round = raw.round.as_ref().map(|table| round(scene, &table.keys)).transpose()?;
    let lines = raw.lines.as_ref().map(|table| lines(scene, files, &table.keys)).transpose()?;
    alone(scene, &raw)?;
    let points = raw.points_mm.as_ref().map(|points| scene.points(&raw::Tool::points_mm, points));
    let tip_radius = tip_radius(scene, &raw)?;
    let trajectory = hand(scene, files, &raw, at.clone())?;
    let mesh = match (&raw.mesh, &round) {
        (None, Some(round)) => {
            scene.needless("mesh_unit_mm", &raw.mesh_unit_mm, "there is no `mesh`")?;
            super::round::mesh(round)
        }
        _ => loaded(scene, files, &raw, at)?,
    };
    Ok(Tool {
        name,
        mesh,
        mass: scene.number(&raw::Tool::mass_g, &raw.mass_g)?,
        inertia: inertia(scene, &raw.inertia_g_mm2)?,
        blade: raw.blade.map(|table| blade(scene, table.keys)).transpose()?,
        points: points.transpose()?.unwrap_or_default(),
        tip_radius,
        round,
        lines,
        carve: raw.carve.map(|table| carve(scene, table.keys)).transpose()?,
        cuboid: None,
        coupling: coupling(scene, raw::keys(raw.coupling))?,
        trajectory,
        device: raw.device.map(|table| device(scene, table)).transpose()?,
        free: None,
    })
}

/// A tool touches either with its blade and points, or with one surface, or with its lines.
fn alone(scene: &SceneText, raw: &raw::Tool) -> Result<()> {
    let why = match (&raw.round, &raw.lines) {
        (None, None) => return Ok(()),
        (Some(_), _) => "a tool with a `round` table touches with that surface",
        (None, Some(_)) => "a tool with a `lines` table touches with the points and lines of its file",
    };
    scene.needless("points_mm", &raw.points_mm, why)?;
    let span = |table: &Option<Table<raw::Lines>>| table.as_ref().map(|t| t.span.clone());
    let lines = span(&raw.lines).filter(|_| raw.round.is_some()).map(|span| ("lines", span));
    match raw.blade.as_ref().map(|table| ("blade", table.span.clone())).or(lines) {
        Some((key, span)) => Err(Invalid::NeedlessKey { at: scene.location(span), key, why }),
        None => Ok(()),
    }
}

/// Radius of the tool's points, m.
fn tip_radius(scene: &SceneText, raw: &raw::Tool) -> Result<f64> {
    if raw.points_mm.is_none() {
        scene.needless("tip_radius_mm", &raw.tip_radius_mm, "there is no `points_mm`")?;
    }
    scene.number(&raw::Tool::tip_radius_mm, &or(raw.tip_radius_mm.clone(), 0.0))
}

/// Mesh file of a tool.
fn loaded(scene: &SceneText, files: &Files, raw: &raw::Tool, table: Range<usize>) -> Result<ToolMesh> {
    let unit = scene.number(&raw::Tool::mesh_unit_mm, &or(raw.mesh_unit_mm.clone(), 1.0))?;
    let why = "a tool without a `round` table has no shape of its own to be drawn";
    let name = scene.required("mesh", raw.mesh.as_ref(), table, why)?;
    let (path, text) = files.text(scene, "mesh", name)?;
    obj::triangles(&Obj::read(&text, &path).map_err(Invalid::Mesh)?, unit)
}

/// Hand path of a tool, from its file or from the scene.
fn hand(scene: &SceneText, files: &Files, raw: &raw::Tool, table: Range<usize>) -> Result<Vec<Pose>> {
    if raw.trajectory.is_some() {
        scene.needless("path_mm", &raw.path_mm, "`trajectory` already gives the hand")?;
    } else if let Some(points) = &raw.path_mm {
        return path(scene, &raw::Tool::path_mm, points);
    }
    let why = "a tool needs a hand: a file here, or rows [t_s, x, y, z] in `path_mm`";
    let name = scene.required("trajectory", raw.trajectory.as_ref(), table, why)?;
    let (path, text) = files.text(scene, "trajectory", name)?;
    trajectory(&text, &path)
}

fn coupling(scene: &SceneText, raw: raw::Coupling) -> Result<Coupling> {
    Ok(Coupling {
        stiffness: scene.number_or(&raw::Coupling::stiffness_n_m, raw.stiffness_n_m)?,
        damping: scene.number_or(&raw::Coupling::damping_n_s_m, raw.damping_n_s_m)?,
        angular_stiffness: scene.number_or(&raw::Coupling::angular_stiffness_n_m_rad, raw.angular_stiffness_n_m_rad)?,
        angular_damping: scene.number_or(&raw::Coupling::angular_damping_n_m_s_rad, raw.angular_damping_n_m_s_rad)?,
    })
}

fn carve(scene: &SceneText, raw: raw::Carve) -> Result<Carve> {
    Ok(Carve {
        distance: scene.number_or(&raw::Carve::distance_mm, raw.distance_mm)?,
        pressure: scene.number_or(&raw::Carve::pressure_kpa, raw.pressure_kpa)?,
        whole_cells: raw::Carve::whole_cells.or(raw.whole_cells).into_inner(),
    })
}

/// Principal moments of inertia, kg·m²; none is more than the other two together.
fn inertia(scene: &SceneText, raw: &raw::Numbers) -> Result<[f64; 3]> {
    let moments = scene.vector(&raw::Tool::inertia_g_mm2, raw)?;
    let in_g_mm2 = |moment: f64| (moment * 1e15).round() / 1e6;
    match too_large(moments) {
        Some([largest, others]) => Err(Invalid::Inertia {
            at: scene.location(raw.span()),
            largest: in_g_mm2(largest),
            others: in_g_mm2(others),
        }),
        None => Ok(moments),
    }
}

/// The largest moment of inertia and the sum of the others, where no body has such moments.
pub(super) fn too_large(moments: [f64; 3]) -> Option<[f64; 2]> {
    let (largest, sum) = (moments.into_iter().fold(0.0, f64::max), moments.iter().sum::<f64>());
    let others = sum - largest;
    (largest > others * (1.0 + ROUNDED)).then_some([largest, others])
}

/// First tool that carves and cannot, by its number, with the reason and the remedy.
pub(super) fn unfit_to_carve(skins: &[Skin], tools: &[Tool], correction: Correction) -> Option<(usize, &'static str)> {
    tools.iter().enumerate().find_map(|(number, tool)| Some((number, unfit(skins, tool, tool.carve?, correction)?)))
}

/// Why a tool cannot carve, and the remedy.
fn unfit(skins: &[Skin], tool: &Tool, carve: Carve, correction: Correction) -> Option<&'static str> {
    let radius = tool.round.map_or(0.0, |round| round.radius) + carve.distance;
    let edge = |skin: &Skin| match &skin.mesh {
        Some(mesh) => mesh.cell_width(),
        None => (0..2).map(|n| skin.size[n] / f64::from(skin.cells[n])).fold(0.0, f64::max),
    };
    let coarse = |skin: &Skin| skin.has_space_to_carve() && 2.0 * radius < edge(skin);
    if tool.blade.is_some() {
        Some("the tool has a blade, which cuts; take another tool")
    } else if correction == Correction::Precomputed {
        Some("correction = \"precomputed\" has the compliance of the whole body; take \"exact\"")
    } else if !skins.iter().any(Skin::can_be_carved) {
        Some(
            "it carves hexahedra or tetrahedra; write cut = \"remove\" in the [skin] or [[block]] that it carves, of these",
        )
    } else if carve.whole_cells {
        None
    } else if skins.iter().any(|skin| skin.can_be_carved() && !skin.has_space_to_carve()) {
        Some(
            "space is carved out of hexahedra with a large-strain law and out of smoothed tetrahedra; write whole_cells = true for the others",
        )
    } else if carve.distance <= 0.0 || skins.iter().any(coarse) {
        Some(
            "what it takes at a contact, a ball of its radius and distance_mm, is smaller than a cell; write whole_cells = true, a larger \
             distance_mm or more cells",
        )
    } else {
        None
    }
}

fn blade(scene: &SceneText, raw: raw::Blade) -> Result<Blade> {
    let edge = scene.points(&raw::Blade::edge_mm, &raw.edge_mm)?;
    // edge: consecutive points must differ
    let apart = edge.windows(2).take_while(|pair| pair[0] != pair[1]).count();
    if edge.len() < 2 || apart + 1 < edge.len() {
        return Err(Invalid::BladeEdge {
            at: scene.location(raw.edge_mm.span()),
            found: if edge.is_empty() { 0 } else { apart + 1 },
        });
    }
    // normal: nearly perpendicular to the chord of the edge
    let normal = raw::Blade::normal.or(raw.normal);
    let direction = normalized(scene.vector(&raw::Blade::normal, &normal)?);
    let chord = normalized(difference(edge[edge.len() - 1], edge[0]));
    let angle = match (direction, chord) {
        (Some(direction), Some(chord)) => acos(dot(direction, chord).abs().min(1.0)).to_degrees(),
        _ => 0.0,
    };
    // depth and spacing, with a limit on the samples
    let (edge_mm, depth) = (raw.edge_mm.span(), scene.number_or(&raw::Blade::depth_mm, raw.depth_mm)?);
    let spacing = [
        scene.number_or(&raw::Blade::edge_spacing_mm, raw.edge_spacing_mm)?,
        scene.number_or(&raw::Blade::flat_spacing_mm, raw.flat_spacing_mm)?,
    ];
    let found = samples(&edge, depth, spacing);
    if found > MOST_SAMPLES {
        return Err(Invalid::BladeSamples { at: scene.location(edge_mm), found, most: MOST_SAMPLES });
    }
    let right = direction.filter(|_| 90.0 - angle <= NORMAL_SLACK);
    Ok(Blade {
        edge,
        normal: right.ok_or_else(|| Invalid::BladeNormal {
            at: scene.location(normal.span()),
            angle,
            allowed: NORMAL_SLACK,
        })?,
        thickness: scene.number(&raw::Blade::thickness_mm, &raw.thickness_mm)?,
        edge_spacing: spacing[0],
        flat_spacing: spacing[1],
        depth,
    })
}

/// Number of contact samples of a blade, as distributed by [`Instrument`](crate::bodies::rigid::Instrument) over edge and flats.
pub(super) fn samples(edge: &[[f64; 3]], depth: f64, [along, flat]: [f64; 2]) -> f64 {
    let lengths = || edge.windows(2).map(|pair| difference(pair[1], pair[0])).map(|d| hypot(hypot(d[0], d[1]), d[2]));
    let pieces: f64 = lengths().map(|length| (length / along).round().max(1.0)).sum();
    pieces + 2.0 * (lengths().sum::<f64>() / flat).floor() * (depth / flat).floor().max(1.0)
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Most ticks of a step: 100 s at 1 kHz. Each is a row of `haptic.csv`, of some 100 bytes.
const MOST_TICKS: f64 = 1e5;

/// Refuses steps with too many ticks.
pub(super) fn ticks(scene: &SceneText, step_ms: Range<usize>, step: f64, rate: f64, tools: &[Tool]) -> Result<()> {
    let (ticks, held) = (step * rate, tools.iter().any(|tool| tool.free.is_none()));
    if !held || ticks <= MOST_TICKS {
        return Ok(());
    }
    Err(Invalid::TooManyTicks { at: scene.location(step_ms), step, ticks, rate, most: MOST_TICKS })
}

/// Contact law; missing keys get their defaults.
pub(super) fn contact(scene: &SceneText, raw: raw::Contact, tools: &[Tool]) -> Result<Contact> {
    let filter = filter(scene, raw.filter, tools)?;
    Ok(Contact {
        friction: scene.number_or(&raw::Contact::friction, raw.friction)?,
        alarm: scene.number_or(&raw::Contact::alarm_mm, raw.alarm_mm)?,
        distance: scene.number_or(&raw::Contact::distance_mm, raw.distance_mm)?,
        forces: forces(scene, raw.forces, raw.penalty_n_m)?,
        correction: scene.choice_or(&raw::Contact::correction, raw.correction)?,
        filter,
        angle_cone: angle_cone(scene, raw.angle_cone, filter, tools)?,
        max_contacts: scene.count_or(&raw::Contact::max_contacts, raw.max_contacts)?,
        lips: raw::Contact::lips.or(raw.lips).into_inner(),
        tolerance: scene.number_or(&raw::Contact::tolerance, raw.tolerance)?,
        column_tolerance: scene.number_or(&raw::Contact::column_tolerance, raw.column_tolerance)?,
        max_passes: scene.count_or(&raw::Contact::max_passes, raw.max_passes)?,
    })
}

fn forces(scene: &SceneText, forces: Option<At<String>>, stiffness: Option<At<f64>>) -> Result<Loop> {
    let forces = raw::Contact::forces.or(forces);
    if scene.choice(&raw::Contact::forces, &forces)? {
        let why = "forces = \"penalty\" asks for the spring's stiffness";
        let stiffness = scene.required("penalty_n_m", stiffness, forces.span(), why)?;
        return Ok(Loop::Penalty(scene.number(&raw::Contact::penalty_n_m, &stiffness)?));
    }
    scene.needless("penalty_n_m", &stiffness, "it belongs to forces = \"penalty\"")?;
    Ok(Loop::Constraints)
}
