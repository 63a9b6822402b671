//! Pictures of a run: the skin coloured by layer, its cells as thin lines, the walls of a wound wet with blood with a marked rim, the tools
//! in steel.

use crate::backend::Snapshot;
use crate::bodies::rigid::Instrument;
use crate::error::Result;
use crate::math::V4;
use crate::mesh::Face;
use crate::output::{Failed, replace};
use crate::scene::{Scene, Tool};
use crate::step::{Body, Simulation, StepReport};
use crate::view::{self, Camera, Effort, Image, Outline, Paint, Renderer, Surface};
use std::collections::BTreeSet;
use std::path::Path;

/// Material of the tools.
pub(super) const STEEL: [u8; 3] = [188, 194, 202];
pub(super) const STEEL_SHININESS: f64 = 90.0;
/// Highlight of moist skin.
pub const SKIN_SHININESS: f64 = 14.0;

/// Colour factors of thin lines between cells, and of the rim of a wound, where blood gathers.
pub const CELL_INK: [f32; 3] = [0.42; 3];
pub(super) const RIM_INK: [f32; 3] = [0.34, 0.03, 0.03];
/// Widths of lines, pixels: between cells of the skin, between cells of a wound's walls, along the rim.
pub const CELL_LINE: f32 = 1.0;
pub(super) const WALL_LINE: f32 = 0.6;
pub(super) const RIM_LINE: f32 = 2.0;
/// A fresh wall is wet with blood: fraction of its layer's colour; the rest is blood.
pub(super) const LAYER_SHARE: f64 = 0.62;
pub(super) const BLOOD: [u8; 3] = [128, 12, 16];
pub(super) const WET_SHININESS: f64 = 36.0;

/// Current surface of the deformable bodies. Its points have the numbers of the nodes that they belong to, those of an embedded surface
/// numbers after its body's nodes.
pub struct SkinSurface {
    /// `[node]` m
    pub positions: Vec<[f64; 3]>,
    /// `[node]` displacement of the surface, m
    pub displacements: Vec<[f64; 3]>,
    /// `[node]` m/s
    pub velocities: Vec<[f64; 3]>,
    /// Outside of the bodies.
    pub skin: Faces,
    /// Walls of wounds.
    pub walls: Faces,
    /// `[line]` node ids of the rims of wounds, where skin and walls meet
    pub rims: Vec<[u32; 2]>,
}

/// Some faces of the surface.
#[derive(Default)]
pub struct Faces {
    /// `[triangle]` node ids
    pub triangles: Vec<[u32; 3]>,
    /// `[triangle]` body and layer of the cell behind it
    pub layers: Vec<[u32; 2]>,
    /// `[triangle]` that cell, in the body's grid
    pub cells: Vec<u32>,
    /// `[line]` node ids, each edge of a face once
    pub edges: Vec<[u32; 2]>,
}

impl SkinSurface {
    /// Boundary faces of the remaining cells at displaced positions.
    pub fn new(simulation: &Simulation, state: &[Snapshot]) -> Self {
        let mut out = Self {
            positions: positions(simulation, state),
            displacements: joined(simulation, state, |s| &s.u),
            velocities: joined(simulation, state, |s| &s.v),
            skin: Faces::default(),
            walls: Faces::default(),
            rims: vec![],
        };
        let mut first = 0;
        for (number, body) in simulation.bodies.iter().enumerate() {
            let quads = body.wound.surface.all();
            for quad in &quads {
                let layer = body.model.layer(quad.cell as usize) as u32;
                let faces = if quad.wall { &mut out.walls } else { &mut out.skin };
                faces.add(quad, first, [number as u32, layer]);
            }
            out.smooth(body, &state[number], &quads, first as usize);
            first += body.model.point_count() as u32;
        }
        for faces in [&mut out.skin, &mut out.walls] {
            faces.edges.sort_unstable();
            faces.edges.dedup();
        }
        let skin = &out.skin.edges;
        out.rims = out.walls.edges.iter().filter(|edge| skin.binary_search(edge).is_ok()).copied().collect();
        out
    }

    /// Moves points of a body from its nodes to the surface corners.
    fn smooth(&mut self, body: &Body, state: &Snapshot, quads: &[Face], first: usize) {
        let mut nodes: Vec<u32> = quads.iter().flat_map(|quad| quad.nodes).collect();
        nodes.sort_unstable();
        nodes.dedup();
        for node in nodes.into_iter().map(|n| n as usize) {
            let corner = body.wound.surface.corner(node);
            let of = |values: &[V4<f64>]| corner.moved(|n| std::array::from_fn(|axis| values[n as usize][axis]));
            let (u, v, rest) = (of(&state.u), of(&state.v), body.wound.rest[node]);
            self.positions[first + node] = std::array::from_fn(|axis| rest[axis] + corner.offset[axis] + u[axis]);
            self.displacements[first + node] = u;
            self.velocities[first + node] = v;
        }
    }
}

impl Faces {
    fn add(&mut self, quad: &Face, first: u32, layer: [u32; 2]) {
        self.triangles.extend(quad.triangles().map(|t| t.map(|n| first + n)));
        self.layers.extend(quad.triangles().map(|_| layer));
        self.cells.extend(quad.triangles().map(|_| quad.cell));
        self.edges.extend(quad.edges().map(|[a, b]| [first + a.min(b), first + a.max(b)]));
    }

    /// `[triangle]` colours of the layers, mixed with another colour.
    pub(super) fn colors(&self, scene: &Scene, share: f64, other: [u8; 3]) -> Vec<[u8; 3]> {
        let color = |[body, layer]: &[u32; 2]| {
            let own = scene.skins[*body as usize].layers[*layer as usize].color;
            std::array::from_fn(|k| (share * f64::from(own[k]) + (1.0 - share) * f64::from(other[k])).round() as u8)
        };
        self.layers.iter().map(color).collect()
    }
}

/// Field over the nodes of all bodies; 0 at the points of embedded surfaces.
pub(super) fn joined(
    simulation: &Simulation,
    state: &[Snapshot],
    field: fn(&Snapshot) -> &Vec<V4<f64>>,
) -> Vec<[f64; 3]> {
    let mut out = vec![];
    for (body, state) in simulation.bodies.iter().zip(state) {
        let more = body.model.point_count() - body.model.node_count();
        out.extend(field(state).iter().map(|v| [v[0], v[1], v[2]]));
        out.extend(std::iter::repeat_n([0.0; 3], more));
    }
    out
}

/// `[node]` displaced positions of all bodies, m; those of points of embedded surfaces at rest.
pub(super) fn positions(simulation: &Simulation, state: &[Snapshot]) -> Vec<[f64; 3]> {
    let rest = simulation.bodies.iter().flat_map(|body| &body.wound.rest);
    let moved = rest.zip(joined(simulation, state, |s| &s.u));
    moved.map(|(x, u)| std::array::from_fn(|n| x[n] + u[n])).collect()
}

/// `[tool][vertex]` positions of the rigid bodies' meshes at their poses, m.
pub fn tool_positions(scene: &Scene, simulation: &Simulation) -> Vec<Vec<[f64; 3]>> {
    let moved = |(tool, now): (&Tool, &Instrument)| {
        let at = |p: &[f64; 3]| now.at(glam::DVec3::from_array(*p)).to_array();
        tool.mesh.positions.iter().map(at).collect()
    };
    scene.tools.iter().zip(&simulation.tools).map(moved).collect()
}

/// How a state is drawn.
#[derive(Clone, Debug, Default)]
pub struct Look {
    /// `[node]` colours in place of the layers'.
    pub colors: Option<Vec<[u8; 3]>>,
    /// Bodies with their layers that are left out.
    pub hidden: BTreeSet<[u32; 2]>,
    /// Without the lines between cells.
    pub plain: bool,
}

/// What of the faces is drawn.
struct Drawn {
    triangles: Vec<[u32; 3]>,
    /// `[triangle]` of the layers
    colors: Vec<[u8; 3]>,
    edges: Vec<[u32; 2]>,
    /// `[node]` whether a triangle is there
    seen: Vec<bool>,
}

impl Drawn {
    fn new(faces: &Faces, colors: Vec<[u8; 3]>, node_count: usize, look: &Look) -> Self {
        let kept = (0..faces.triangles.len()).filter(|t| !look.hidden.contains(&faces.layers[*t]));
        let (triangles, colors): (Vec<_>, Vec<_>) = kept.map(|t| (faces.triangles[t], colors[t])).unzip();
        let mut seen = vec![false; node_count];
        triangles.as_flattened().iter().for_each(|node| seen[*node as usize] = true);
        let mut out = Self { triangles, colors, edges: vec![], seen };
        if !look.plain {
            out.edges = out.among(&faces.edges);
        }
        out
    }

    /// Lines both of whose ends are drawn.
    fn among(&self, lines: &[[u32; 2]]) -> Vec<[u32; 2]> {
        lines.iter().filter(|line| line.iter().all(|node| self.seen[*node as usize])).copied().collect()
    }

    fn paint<'a>(&'a self, look: &'a Look) -> Paint<'a> {
        look.colors.as_deref().map_or(Paint::Triangles(&self.colors), Paint::Vertices)
    }
}

/// Calls `draw` with the surfaces of the deformable bodies and those of the tools, whose vertices are at `tools`.
pub fn with_surfaces<R>(
    scene: &Scene,
    skin: &SkinSurface,
    tools: &[Vec<[f64; 3]>],
    look: &Look,
    draw: impl FnOnce(&[Surface], &[Surface]) -> R,
) -> R {
    let node_count = skin.positions.len();
    let outside = Drawn::new(&skin.skin, skin.skin.colors(scene, 1.0, BLOOD), node_count, look);
    let walls = Drawn::new(&skin.walls, skin.walls.colors(scene, LAYER_SHARE, BLOOD), node_count, look);
    let rims = outside.among(&skin.rims);
    let of_skin = [
        Outline { lines: &outside.edges, width: CELL_LINE, ink: CELL_INK },
        Outline { lines: &rims, width: RIM_LINE, ink: RIM_INK },
    ];
    let of_walls = [Outline { lines: &walls.edges, width: WALL_LINE, ink: CELL_INK }];
    // walls below the skin, so that its lines are drawn last
    let bodies = [
        Surface {
            positions: &skin.positions,
            triangles: &walls.triangles,
            colors: walls.paint(look),
            smooth: true,
            outlines: &of_walls,
            shininess: WET_SHININESS,
        },
        Surface {
            positions: &skin.positions,
            triangles: &outside.triangles,
            colors: outside.paint(look),
            smooth: true,
            outlines: &of_skin,
            shininess: SKIN_SHININESS,
        },
    ];
    let triangle_count = scene.tools.iter().map(|t| t.mesh.triangles.len()).max();
    let steel = vec![STEEL; triangle_count.unwrap_or(0)];
    let mut instruments = vec![];
    for (tool, positions) in scene.tools.iter().zip(tools) {
        instruments.push(Surface {
            positions,
            triangles: &tool.mesh.triangles,
            colors: Paint::Triangles(&steel),
            smooth: true,
            outlines: &[],
            shininess: STEEL_SHININESS,
        });
    }
    draw(&bodies, &instruments)
}

/// Draws the pictures of a run: on the simulation's own device, or with the rasteriser where there is none or its textures are too small.
pub struct Painter(Option<Renderer>);

impl Painter {
    /// For the pictures of a scene.
    pub fn new(scene: &Scene, simulation: &Simulation) -> Self {
        let renderer = |(device, queue): (wgpu::Device, wgpu::Queue)| {
            let largest = device.limits().max_texture_dimension_2d;
            scene.view.size.iter().all(|side| *side <= largest).then(|| Renderer::new(device, queue, Effort::Full))
        };
        Self(simulation.gpu().map(|gpu| gpu.handles()).and_then(renderer))
    }

    /// Draws a state with the scene's camera.
    ///
    /// # Errors
    /// [`NoMemory`](view::NoMemory) when there is none for so many pixels, and when the device fails.
    pub fn draw(
        &mut self,
        scene: &Scene,
        simulation: &Simulation,
        skin: &SkinSurface,
        step: &StepReport,
    ) -> Result<Image> {
        let tools = tool_positions(scene, simulation);
        let caption = caption(scene, simulation, step);
        let lines: Vec<&str> = caption.iter().map(String::as_str).collect();
        let (camera, [width, height]) = (camera(scene), scene.view.size);
        with_surfaces(scene, skin, &tools, &Look::default(), |bodies, tools| match &mut self.0 {
            None => view::render(&[bodies, tools].concat(), &camera, width, height, &lines),
            Some(renderer) => {
                let skipped = renderer.load(&view::Drawn { clipped: bodies, whole: tools, in_front: &[] });
                renderer.draw(&camera, [width, height], None);
                let mut image = Image { skipped, ..renderer.read()? };
                view::caption(&mut image, &lines);
                Ok(image)
            }
        })
    }

    /// Draws into a PNG file, which is written atomically.
    pub(super) fn write(
        &mut self,
        scene: &Scene,
        simulation: &Simulation,
        skin: &SkinSurface,
        step: &StepReport,
        path: &Path,
    ) -> Result<()> {
        let bytes = view::png(&self.draw(scene, simulation, skin, step)?);
        replace(path, &bytes.map_err(|source| Failed::Write { path: path.to_owned(), source })?)
    }
}

/// The scene's camera.
pub fn camera(scene: &Scene) -> Camera {
    let view = scene.view;
    Camera { eye: view.eye, target: view.target, up: [0.0, 0.0, 1.0], field_of_view_deg: view.field_of_view }
}

/// What stands on a picture: time, force, cut.
pub fn caption(scene: &Scene, simulation: &Simulation, step: &StepReport) -> Vec<String> {
    let mut lines = vec![format!("time {:.3} s", step.time)];
    if scene.contact.is_some() {
        lines.push(format!("force {:.3} N", step.contact.largest_on_tools()));
    }
    if scene.tools.iter().any(|t| t.blade.is_some()) {
        let totals = simulation.totals();
        lines.push(format!("cut {:.1} mm long, {:.1} mm deep", totals.length * 1e3, totals.depth * 1e3));
    }
    lines
}
