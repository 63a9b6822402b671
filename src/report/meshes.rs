//! Meshes of a picture: the remaining cells, the surface and the tools for ParaView, and the surface in other formats.

use super::frames::{self, BLOOD, LAYER_SHARE, STEEL, SkinSurface};
use super::glb::{self, Part};
use crate::backend::Snapshot;
use crate::error::Result;
use crate::formats::{self, Encoding, Format, Mesh};
use crate::math::V3;
use crate::mesh::Unstructured;
use crate::output::{Field, replace, write_points, write_solids, write_triangles};
use crate::scene::{Component, OutputField, Scene, SurfaceFormat};
use crate::step::{Body, ContactPoint, Simulation, StepReport};
use glam::DVec3;
use std::path::Path;

/// Fields of the cells that the scene asks for; those that it does not ask for are empty.
pub(super) struct CellFields {
    /// `[body]` fields over all cells of its grid
    bodies: Vec<OfBody>,
    stress: bool,
    strain: bool,
    alive: bool,
    stiffness: bool,
}

/// Fields over the cells of a body; those of removed cells are 0.
#[derive(Default)]
struct OfBody {
    /// `[cell]` Cauchy stress, Pa: `xx yy zz xy yz zx`
    stress: Vec<[f64; 6]>,
    /// `[cell]` Pa
    von_mises: Vec<f64>,
    /// `[cell]` Green–Lagrange strain, in the same order
    strain: Vec<[f64; 6]>,
    /// `[cell]` intact share of its links or springs
    alive: Vec<f64>,
    /// `[cell]` factor on the stiffness of its layer, by inclusions
    stiffness: Vec<f64>,
}

impl CellFields {
    pub fn new(scene: &Scene, simulation: &Simulation, state: &[Snapshot]) -> Self {
        let asked = [OutputField::Stress, OutputField::Strain, OutputField::Alive, OutputField::Stiffness];
        let [stress, strain, alive, stiffness] = asked.map(|field| scene.output.has(field));
        let of_body = |(body, state): (&Body, &Snapshot)| {
            let mut own = OfBody::default();
            if stress || strain {
                let all = body.model.mechanics().strains_and_stresses(&body.model, &body.wound, &state.u);
                // symmetric: columns are rows
                let tensors = |k: usize| all.iter().map(move |own| own[k].0.map(V3::f64));
                own.von_mises = tensors(1).map(|s| Component::VonMises.of(s)).collect();
                (own.strain, own.stress) = (tensors(0).map(six).collect(), tensors(1).map(six).collect());
            }
            if alive {
                own.alive = body.alive_shares();
            }
            if stiffness {
                own.stiffness = body.stiffness_factors();
            }
            own
        };
        Self { bodies: simulation.bodies.iter().zip(state).map(of_body).collect(), stress, strain, alive, stiffness }
    }

    /// Fields over some cells, by body and number: what is asked for, under the names in the files.
    fn of(&self, cells: &[(usize, usize)]) -> Picked {
        let mut out = Picked::default();
        for (body, cell) in cells {
            let own = &self.bodies[*body];
            if self.stress {
                out.stress.push(own.stress[*cell]);
                out.von_mises.push(own.von_mises[*cell]);
            }
            if self.strain {
                out.strain.push(own.strain[*cell]);
            }
            if self.alive {
                out.alive.push(own.alive[*cell]);
            }
            if self.stiffness {
                out.stiffness.push(own.stiffness[*cell]);
            }
        }
        (out.has_stress, out.has_strain) = (self.stress, self.strain);
        (out.has_alive, out.has_stiffness) = (self.alive, self.stiffness);
        out
    }
}

/// Fields over the cells of a file.
#[derive(Default)]
struct Picked {
    stress: Vec<[f64; 6]>,
    von_mises: Vec<f64>,
    strain: Vec<[f64; 6]>,
    alive: Vec<f64>,
    stiffness: Vec<f64>,
    has_stress: bool,
    has_strain: bool,
    has_alive: bool,
    has_stiffness: bool,
}

impl Picked {
    fn fields(&self) -> Vec<(&str, Field<'_>)> {
        let mut out = vec![];
        if self.has_stress {
            out.push(("stress_pa", Field::Tensors(&self.stress)));
            out.push(("von_mises_pa", Field::Scalars(&self.von_mises)));
        }
        if self.has_strain {
            out.push(("strain", Field::Tensors(&self.strain)));
        }
        if self.has_alive {
            out.push(("alive_share", Field::Scalars(&self.alive)));
        }
        if self.has_stiffness {
            out.push(("stiffness_factor", Field::Scalars(&self.stiffness)));
        }
        out
    }
}

fn six(t: [[f64; 3]; 3]) -> [f64; 6] {
    [t[0][0], t[1][1], t[2][2], t[0][1], t[1][2], t[2][0]]
}

/// Points kept in a file, and cells renumbered for them.
struct Kept {
    old: Vec<u32>, // in ascending order
}

impl Kept {
    /// The points that some cells are on.
    fn by<const N: usize>(cells: &[[u32; N]]) -> Self {
        let mut old: Vec<u32> = cells.as_flattened().to_vec();
        old.sort_unstable();
        old.dedup();
        Self { old }
    }

    fn of<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.old.iter().map(|n| values[*n as usize]).collect()
    }

    fn renumbered<const N: usize>(&self, cells: &[[u32; N]]) -> Vec<[u32; N]> {
        let new = |id: &u32| self.old.binary_search(id).expect("points of cells are kept") as u32;
        cells.iter().map(|cell| cell.each_ref().map(new)).collect()
    }
}

/// Remaining cells at displaced positions. Grid nodes that a cut has left without a cell stay in the file; unused duplicates, and nodes beside
/// an embedded surface, do not.
pub(super) fn write_volume(
    path: &Path,
    simulation: &Simulation,
    state: &[Snapshot],
    fields: &CellFields,
) -> Result<()> {
    let (mut cells, mut layers, mut bodies, mut old, mut numbers) = (vec![], vec![], vec![], vec![], vec![]);
    let (mut tetrahedra, mut theirs) = (vec![], vec![]); // after the cells of all grids
    let mut first = 0;
    for (number, body) in simulation.bodies.iter().enumerate() {
        let surface = &body.wound.surface;
        for (layer, corners) in surface.live_cells() {
            cells.push(corners.map(|n| first + n as u32));
            layers.push(layer as f64);
            bodies.push(number as f64);
        }
        if let Some(Unstructured { mesh, .. }) = body.model.unstructured() {
            let present = surface.present();
            let all = mesh
                .layers()
                .iter()
                .zip(surface.corners_of_tetrahedra())
                .enumerate()
                .filter(|(cell, _)| present[*cell]);
            for (cell, (layer, corners)) in all {
                theirs.push((f64::from(*layer), (number, cell)));
                tetrahedra.push(corners.map(|n| first + n));
            }
        }
        numbers.extend((0..surface.alive.len()).filter(|cell| surface.alive[*cell]).map(|cell| (number, cell)));
        let count = body.model.node_count();
        let kept = |node: &usize| surface.in_use(*node) && body.model.is_used(*node);
        old.extend((0..count).filter(kept).map(|node| first + node as u32));
        first += body.model.point_count() as u32;
    }
    layers.extend(theirs.iter().map(|(layer, _)| *layer));
    bodies.extend(theirs.iter().map(|(_, (body, _))| *body as f64));
    numbers.extend(theirs.iter().map(|(_, number)| *number));
    let (kept, more) = (Kept { old }, fields.of(&numbers));
    write_solids(
        path,
        &kept.of(&frames::positions(simulation, state)),
        &kept.renumbered(&cells),
        &kept.renumbered(&tetrahedra),
        &[
            ("displacement_m", Field::Vectors(&kept.of(&frames::joined(simulation, state, |s| &s.u)))),
            ("velocity_m_s", Field::Vectors(&kept.of(&frames::joined(simulation, state, |s| &s.v)))),
        ],
        &[vec![("layer", Field::Scalars(&layers)), ("body", Field::Scalars(&bodies))], more.fields()].concat(),
    )
}

/// `[triangle]` colours of skin and walls as in the pictures, sRGB.
fn colors(scene: &Scene, surface: &SkinSurface) -> Vec<[u8; 3]> {
    [surface.skin.colors(scene, 1.0, BLOOD), surface.walls.colors(scene, LAYER_SHARE, BLOOD)].concat()
}

/// The surface as drawn in the pictures; `wall` is 1 for a face made by a cut, `color` is sRGB, 0 to 1. Fields of cells are those of the cell
/// behind a face.
pub(super) fn write_surface(path: &Path, scene: &Scene, surface: &SkinSurface, fields: &CellFields) -> Result<()> {
    let SkinSurface { skin, walls, .. } = surface;
    let triangles = [&skin.triangles[..], &walls.triangles].concat();
    let behind = || skin.layers.iter().chain(&walls.layers);
    let (bodies, layers): (Vec<f64>, Vec<f64>) =
        behind().map(|[body, layer]| (f64::from(*body), f64::from(*layer))).unzip();
    let cells = behind().zip(skin.cells.iter().chain(&walls.cells)).map(|(l, cell)| (l[0] as usize, *cell as usize));
    let (kept, more) = (Kept::by(&triangles), fields.of(&cells.collect::<Vec<_>>()));
    let wall: Vec<f64> = (0..triangles.len()).map(|t| f64::from(t >= skin.triangles.len())).collect();
    let color: Vec<[f64; 3]> = colors(scene, surface).iter().map(|c| c.map(|c| f64::from(c) / 255.0)).collect();
    let usual = vec![
        ("layer", Field::Scalars(&layers)),
        ("body", Field::Scalars(&bodies)),
        ("wall", Field::Scalars(&wall)),
        ("color", Field::Vectors(&color)),
    ];
    write_triangles(
        path,
        &kept.of(&surface.positions),
        &kept.renumbered(&triangles),
        &[
            ("displacement_m", Field::Vectors(&kept.of(&surface.displacements))),
            ("velocity_m_s", Field::Vectors(&kept.of(&surface.velocities))),
        ],
        &[usual, more.fields()].concat(),
    )
}

/// Meshes of the rigid bodies at their poses; `body` is the number among them.
pub(super) fn write_tools(path: &Path, scene: &Scene, simulation: &Simulation) -> Result<()> {
    let (mut points, mut triangles, mut bodies) = (vec![], vec![], vec![]);
    for (number, (tool, positions)) in scene.tools.iter().zip(frames::tool_positions(scene, simulation)).enumerate() {
        let first = points.len() as u32;
        triangles.extend(tool.mesh.triangles.iter().map(|ids| ids.map(|id| first + id)));
        bodies.resize(triangles.len(), number as f64);
        points.extend(positions);
    }
    write_triangles(path, &points, &triangles, &[], &[("body", Field::Scalars(&bodies))])
}

/// Points of the step's contacts, also those without a force, with what is known of each; an arrow along `force_n` is the force on the first
/// body. `kind` is 0 for a contact, 1 for a blade's edge, 2 for an attachment, 3 for one along a path.
pub(super) fn write_contacts(path: &Path, step: &StepReport) -> Result<()> {
    let all: Vec<ContactPoint> = step.contact.points().collect();
    let vectors = |of: fn(&ContactPoint) -> DVec3| all.iter().map(|p| of(p).to_array()).collect::<Vec<_>>();
    let kinds: Vec<f64> = all.iter().map(|p| f64::from(p.kind as u8)).collect();
    let gaps: Vec<f64> = all.iter().map(|p| p.gap).collect();
    write_points(
        path,
        &vectors(|p| p.point),
        &[
            ("force_n", Field::Vectors(&vectors(|p| p.force))),
            ("normal", Field::Vectors(&vectors(|p| p.normal))),
            ("slip_m", Field::Vectors(&vectors(|p| p.slip))),
            ("gap_m", Field::Scalars(&gaps)),
            ("kind", Field::Scalars(&kinds)),
        ],
    )
}

/// The surface of the deformable bodies in another format, m; glTF has the colours of the pictures, and the tools.
pub(super) fn write_format(
    path: &Path,
    format: SurfaceFormat,
    scene: &Scene,
    simulation: &Simulation,
    surface: &SkinSurface,
) -> Result<()> {
    let triangles = [&surface.skin.triangles[..], &surface.walls.triangles].concat();
    let kept = Kept::by(&triangles);
    let (points, triangles) = (kept.of(&surface.positions), kept.renumbered(&triangles));
    let other = match format {
        SurfaceFormat::Glb => {
            let mut parts =
                vec![Part { name: "bodies", points, triangles, colors: colors(scene, surface), metal: false }];
            for (tool, positions) in scene.tools.iter().zip(frames::tool_positions(scene, simulation)) {
                let (triangles, colors) = (tool.mesh.triangles.clone(), vec![STEEL; tool.mesh.triangles.len()]);
                parts.push(Part { name: &tool.name, points: positions, triangles, colors, metal: true });
            }
            return replace(path, &glb::bytes(&parts));
        }
        SurfaceFormat::Obj => Format::Obj,
        SurfaceFormat::Stl => Format::Stl,
    };
    let mesh = Mesh { points, triangle_regions: vec![0; triangles.len()], triangles, ..Mesh::default() };
    replace(path, &formats::write(&mesh, other, Encoding::Binary, path)?)
}
