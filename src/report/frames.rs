//! Pictures of a run: the skin coloured by layer, wound walls included, its cells as thin lines, the tools in steel.

use super::collect::force_on_tools;
use crate::backend::Snapshot;
use crate::error::Result;
use crate::instrument::Instrument;
use crate::scene::{Scene, Tool};
use crate::step::{Simulation, StepReport};
use crate::view::{self, Camera, Image, Surface};
use std::path::Path;

/// Looks of the tools.
const STEEL: [u8; 3] = [188, 194, 202];
const STEEL_SHININESS: f64 = 90.0;
/// Highlight of moist skin.
const SKIN_SHININESS: f64 = 14.0;

/// The surface of the deformable bodies as it is now.
pub struct SkinSurface {
    /// `[node]` m
    pub positions: Vec<[f64; 3]>,
    /// `[triangle]` node ids
    pub triangles: Vec<[u32; 3]>,
    /// `[triangle]` body and layer of the cell behind it
    pub layers: Vec<[u32; 2]>,
    /// `[line]` node ids, each edge of a boundary face once
    pub edges: Vec<[u32; 2]>,
}

impl SkinSurface {
    /// Boundary faces of the live cells at displaced positions.
    pub fn new(simulation: &Simulation, state: &[Snapshot]) -> Self {
        let positions = positions(simulation, state);
        let (mut triangles, mut layers, mut edges) = (vec![], vec![], vec![]);
        let mut first = 0;
        for (number, body) in simulation.bodies.iter().enumerate() {
            let grid = &body.model.grid;
            let params = grid.params::<f64>();
            for quad in body.wound.surface.all() {
                let level = params.cell_at(quad.cell as usize)[2];
                triangles.extend(quad.triangles().map(|t| t.map(|n| first + n)));
                layers.extend([[number as u32, grid.layer_of[level]]; 2]);
                let n = quad.nodes.map(|n| first + n);
                let sides = [[0, 1], [1, 2], [2, 3], [3, 0]];
                edges.extend(sides.map(|[a, b]: [usize; 2]| [n[a].min(n[b]), n[a].max(n[b])]));
            }
            first += body.model.node_count() as u32;
        }
        edges.sort_unstable();
        edges.dedup();
        Self { positions, triangles, layers, edges }
    }
}

/// `[node]` displaced positions of all bodies, m.
pub(super) fn positions(simulation: &Simulation, state: &[Snapshot]) -> Vec<[f64; 3]> {
    let bodies = simulation.bodies.iter().zip(state);
    let moved = bodies.flat_map(|(body, state)| body.wound.rest.iter().zip(&state.u));
    moved.map(|(x, u)| std::array::from_fn(|n| x[n] + u[n])).collect()
}

/// Draws the scene as its view says.
pub fn draw(scene: &Scene, simulation: &Simulation, skin: &SkinSurface, step: &StepReport) -> Image {
    let color = |[body, layer]: &[u32; 2]| scene.skins[*body as usize].layers[*layer as usize].color;
    let colors: Vec<[u8; 3]> = skin.layers.iter().map(color).collect();
    let place = |(tool, now): (&Tool, &Instrument)| {
        let at = |p: &[f64; 3]| now.at(glam::DVec3::from_array(*p)).to_array();
        tool.mesh.positions.iter().map(at).collect::<Vec<_>>()
    };
    let tools: Vec<Vec<[f64; 3]>> = scene.tools.iter().zip(&simulation.tools).map(place).collect();
    let triangle_count = scene.tools.iter().map(|t| t.mesh.triangles.len()).max();
    let steel = vec![STEEL; triangle_count.unwrap_or(0)];
    let mut surfaces = vec![Surface {
        positions: &skin.positions,
        triangles: &skin.triangles,
        colors: &colors,
        smooth: true,
        edges: true,
        outline: &skin.edges,
        shininess: SKIN_SHININESS,
    }];
    for (tool, positions) in scene.tools.iter().zip(&tools) {
        surfaces.push(Surface {
            positions,
            triangles: &tool.mesh.triangles,
            colors: &steel,
            smooth: true,
            edges: false,
            outline: &[],
            shininess: STEEL_SHININESS,
        });
    }
    let view = scene.view;
    let camera =
        Camera { eye: view.eye, target: view.target, up: [0.0, 0.0, 1.0], field_of_view_deg: view.field_of_view };
    let caption = caption(scene, simulation, step);
    let lines: Vec<&str> = caption.iter().map(String::as_str).collect();
    view::render(&surfaces, &camera, view.size[0], view.size[1], &lines)
}

fn caption(scene: &Scene, simulation: &Simulation, step: &StepReport) -> Vec<String> {
    let mut lines = vec![format!("time {:.3} s", step.time)];
    if scene.contact.is_some() {
        lines.push(format!("force {:.3} N", force_on_tools(step)));
    }
    if scene.tools.iter().any(|t| t.blade.is_some()) {
        let totals = simulation.totals();
        lines.push(format!("cut {:.1} mm long, {:.1} mm deep", totals.length * 1e3, totals.depth * 1e3));
    }
    lines
}

/// Draws into a PNG file.
pub(super) fn write(
    scene: &Scene,
    simulation: &Simulation,
    skin: &SkinSurface,
    step: &StepReport,
    path: &Path,
) -> Result<()> {
    view::write_png(&draw(scene, simulation, skin, step), path)
}
