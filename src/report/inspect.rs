//! Lists what a scene will allocate and run, without running anything and without an adapter; and whether it fits into memory.
//!
//! The body is set up by the code for GPUs on wgpu's no-op device: arrays and kernels are those of a run by construction, every kernel
//! passes wgpu's validation, and nothing is computed. The model has counts in place of its arrays ([`Model::of_sizes`]), so the memory of
//! this does not grow with the grid. Dispatches and read-backs are counted from the way [`crate::step`] drives the backend.
//!
//! [`fits`] tells from the number of nodes, before any memory is taken. The bytes of a node are the least that were measured (peak resident
//! memory of one step, 78,000 to 214,000 nodes of hexahedra, linear law, columns as preconditioner); other laws, multigrid and exact
//! factors take more. A scene that is refused cannot fit; one that passes may still meet an error of its own later. Where the system does
//! not tell what is free (it does on Linux), nothing is refused.

use super::Refused;
use crate::backend::{GpuBackend, Snapshot};
use crate::bodies::Model;
use crate::bodies::tetrahedra::with_meshes;
use crate::error::Result;
use crate::gpu::{Gpu, Made, adapters};
use crate::scene::{BodyId, Correction, Cut, Integrator, Law, ProbeKind, Scene, Skin, cells_of, free, reserve_of};
use crate::step::{Platform, needs};
use serde::Serialize;

/// Array of a body.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Array {
    /// Name in the kernels.
    pub name: &'static str,
    /// Purpose.
    pub purpose: &'static str,
    /// Number of elements.
    pub elements: u64,
    /// Size with padding, bytes.
    pub bytes: u64,
}

/// Memory of one purpose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// Purpose.
    pub purpose: &'static str,
    /// GPU memory that grows with the grid, bytes per cell; without uniforms, which do not.
    pub bytes_per_cell: f64,
}

/// Number of occurrences of something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Count {
    /// Name.
    pub name: &'static str,
    /// Number of occurrences,
    pub count: u32,
    /// per this unit.
    pub per: &'static str,
}

/// Resources of a scene.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Plan {
    /// Scene file.
    pub scene: String,
    /// Nodes of the deformable bodies.
    pub nodes: usize,
    /// Cells of their grids.
    pub cells: usize,
    /// Springs; 0 for hexahedra.
    #[serde(rename = "springs")]
    pub spring_count: usize,
    /// Unconstrained degrees of freedom.
    pub dof: usize,
    /// Number of steps.
    pub steps: u32,
    /// Maximum number of right-hand sides solved together: unconstrained motion, correction, compliance columns.
    pub right_hand_sides: usize,
    /// Arrays on the GPU.
    pub arrays: Vec<Array>,
    /// Compiled kernels.
    pub kernels: Vec<&'static str>,
    /// Kernel launches, body by body.
    pub dispatches: Vec<Count>,
    /// Times that the host waits for values.
    pub read_backs: Vec<Count>,
    /// Memory by purpose.
    pub shares: Vec<Share>,
    /// Memory added by the scene's blades: arrays of the cut, the table of split nodes, and the reserve of duplicates in all nodal arrays,
    /// bytes.
    pub blade_bytes: u64,
    /// Total size of the arrays, bytes.
    pub device_bytes: u64,
    /// Constant arrays on the host, bytes.
    pub host_bytes: u64,
}

/// Lists the resources of a run of a scene on a GPU.
///
/// # Errors
/// If the scene is too large for 32-bit indices, or a kernel is invalid.
pub fn inspect(scene: &Scene) -> Result<Plan> {
    scene.check()?;
    let mut plan = all_bodies(scene)?;
    if cuts(scene) {
        let mut blunt = scene.clone();
        blunt.tools.iter_mut().for_each(|tool| tool.blade = None);
        plan.blade_bytes = plan.device_bytes - all_bodies(&blunt)?.device_bytes;
    }
    Ok(plan)
}

fn all_bodies(scene: &Scene) -> Result<Plan> {
    let mut plan = Plan {
        scene: scene.file.display().to_string(),
        steps: scene.time.steps(),
        read_backs: read_backs(scene),
        ..Plan::default()
    };
    let scene = &*with_meshes(scene)?;
    for number in 0..scene.skins.len() {
        add_body(&mut plan, scene, &Model::of_sizes(scene, number)?)?;
    }
    plan.shares = shares(&plan.arrays, plan.cells);
    plan.device_bytes = plan.arrays.iter().map(|a| a.bytes).sum();
    Ok(plan)
}

/// Adds one deformable body.
fn add_body(plan: &mut Plan, scene: &Scene, model: &Model) -> Result<()> {
    let (needs, solver) = (needs(scene, model), scene.solver);
    plan.nodes += model.own_nodes();
    plan.cells += model.cell_count();
    plan.spring_count += model.elements().spring_count;
    plan.dof += model.degrees_of_freedom();
    plan.right_hand_sides = plan.right_hand_sides.max(needs.right_hand_sides());
    plan.host_bytes += model.host_bytes();
    let empty = Snapshot::default();
    let backend = GpuBackend::new(Gpu::dry()?, model, needs, solver.max_iterations, solver.floor, &empty)?;
    let made = backend.gpu().arrays().into_iter();
    plan.arrays.extend(made.map(|Made { name, purpose, elements, bytes }| Array { name, purpose, elements, bytes }));
    for kernel in backend.gpu().kernels() {
        if !plan.kernels.contains(&kernel) {
            plan.kernels.push(kernel);
        }
    }
    plan.dispatches.extend(dispatches(scene, model, backend.launches()));
    Ok(())
}

/// Arrays whose size does not depend on the grid: uniforms, and those of the probe.
const CONSTANT: [&str; 8] = ["params", "stiffness", "modes", "shape", "material", "pre_strain", "cases", "errors"];

fn shares(arrays: &[Array], cells: usize) -> Vec<Share> {
    let mut out: Vec<Share> = vec![];
    for array in arrays.iter().filter(|a| !CONSTANT.contains(&a.name)) {
        let bytes_per_cell = array.bytes as f64 / cells as f64;
        match out.iter_mut().find(|s| s.purpose == array.purpose) {
            Some(share) => share.bytes_per_cell += bytes_per_cell,
            None => out.push(Share { purpose: array.purpose, bytes_per_cell }),
        }
    }
    out
}

fn cuts(scene: &Scene) -> bool {
    scene.tools.iter().any(|t| t.blade.is_some())
}

/// Number of nodal arrays that probes read from the backend at chosen nodes: displacements, and velocities for the damping in reactions.
fn probes(scene: &Scene) -> u32 {
    let any = |is: fn(&ProbeKind) -> bool| u32::from(scene.probes.iter().any(|p| is(&p.kind)));
    let at_nodes = |k: &ProbeKind| {
        !k.of_whole() && matches!(k.body(), BodyId::Deformable(_)) && !matches!(k, ProbeKind::Force { .. })
    };
    any(at_nodes) + any(|k| matches!(k, ProbeKind::Reaction { .. }))
}

/// Whether probes read the displacements of whole bodies.
fn whole(scene: &Scene) -> bool {
    scene.probes.iter().any(|p| p.kind.of_whole())
}

fn dispatches(scene: &Scene, model: &Model, [begin, iteration, split, trial]: [u32; 4]) -> Vec<Count> {
    let count = |name, count, per| Count { name, count, per };
    // and the integration
    let per = if model.step.explicit() { "step" } else { "iteration" };
    let mut list = vec![count("free motion", begin + 1, "step"), count("solver", iteration, per)];
    if trial > 0 {
        list.push(count("line search", trial, "trial point"));
    }
    if split > 0 {
        list.push(count("split cells", split, "iteration after a cut"));
    }
    if probes(scene) > 0 {
        list.push(count("probes", probes(scene), "step"));
    }
    if let Some(law) = &scene.contact {
        list.push(count("boxes", 1, "step"));
        match law.correction {
            // positions, values out; rows in, values out
            Correction::Exact => {
                list.push(count("contact", 2, "step with contact"));
                list.push(count("compliance", 2, "two nodes that the tools newly reach"));
                list.push(count("correction", 2, "pass"));
            }
            // positions, values out; rows in, values out
            Correction::Precomputed => {
                list.push(count("contact", 2, "step with contact"));
                list.push(count("correction", 2, "pass"));
            }
            // positions, values out, blocks, correction in
            Correction::Uncoupled => list.push(count("contact", 4, "step with contact")),
        }
    }
    if cuts(scene) {
        // segment positions before and after the step; springs copy the nodes
        list.push(count("cut", if model.elements().spring_count > 0 { 1 } else { 3 }, "step with contact"));
    }
    list
}

fn read_backs(scene: &Scene) -> Vec<Count> {
    let count = |name, count, per| Count { name, count, per };
    let hyperelastic = |skin: &Skin| matches!(skin.law, Law::Hyperelastic(_));
    let newton = scene.newton() && scene.skins.iter().any(hyperelastic);
    let mut list = match scene.time.integrator {
        Integrator::SymplecticEuler => vec![count("queue", 1, "32 steps")],
        _ if newton => vec![count("line search", 1, "trial point"), count("solver", 1, "Newton iteration")],
        _ if scene.in_full() => vec![count("solver", 1, "solve of a step, 2 to 4 times")],
        _ => vec![count("solver", 1, "step")],
    };
    if newton && !scene.skins.iter().all(hyperelastic) {
        list.push(count("solver", 1, "step"));
    }
    if scene.has_followers() {
        // their nodes at its start, and the increment so far
        list.push(count("pressures", 1, "solve of a step"));
    }
    if probes(scene) > 0 || scene.contact.is_some() {
        // probes, what the next search for contacts asks for, and what was cut
        list.push(count("state", 1, "step"));
    }
    if whole(scene) {
        list.push(count("displacements", 1, "step and body"));
    }
    let ends = scene.time.duration;
    if scene.contact.is_none() && scene.loads.iter().any(|load| load.start > 0.0 || load.end < ends) {
        list.push(count("loads", 1, "step in which a load changes")); // for their work
    }
    if let Some(law) = &scene.contact {
        list.push(count("contact", 1, "step whose tools come near other faces"));
        match law.correction {
            Correction::Exact => {
                list.push(count("compliance", 1, "two nodes that the tools newly reach"));
                list.push(count("correction", 1, "pass"));
            }
            Correction::Precomputed => list.push(count("correction", 1, "pass")),
            Correction::Uncoupled => list.push(count("blocks", 1, "step with contact")),
        }
    }
    if cuts(scene) {
        list.push(count("cut", 1, "step that severs links or springs"));
    }
    list
}

/// Adapter of `--backend auto`; `None` for the CPU path.
pub fn automatic() -> Option<crate::gpu::Adapter> {
    adapters().into_iter().find(|a| !a.software)
}

/// What is to be done with a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To step it on the CPU path in f64.
    Double,
    /// To step it on the CPU path in f32.
    Single,
    /// To set it up for a GPU, without stepping it here.
    SetUp,
}

impl From<&Platform> for Purpose {
    fn from(platform: &Platform) -> Self {
        match platform {
            Platform::Cpu64 => Self::Double,
            Platform::Cpu32 => Self::Single,
            Platform::Gpu(_) => Self::SetUp,
        }
    }
}

impl Purpose {
    /// Bytes of a node of the grid, and of one in the reserve of a cut.
    fn of_node(self, skin: &Skin, contact: bool) -> [u64; 2] {
        let springs = matches!(skin.law, Law::Springs { .. });
        match (self, springs, contact) {
            (Self::SetUp, ..) => [180, 400],
            (_, true, _) => [4000, 0],
            (Self::Double, _, false) => [1300, 1000],
            (Self::Double, _, true) => [2600, 1000],
            (Self::Single, _, false) => [1000, 700],
            (Self::Single, _, true) => [1700, 700],
        }
    }
}

/// Refuses a scene that cannot fit.
///
/// # Errors
/// [`Refused::Memory`], with the key that takes the most.
pub fn fits(scene: &Scene, purpose: Purpose) -> Result<()> {
    let Some(free) = free() else { return Ok(()) };
    let cuts = scene.tools.iter().any(|tool| tool.blade.is_some());
    let (mut wanted, mut largest) = (0, (0, String::new(), ""));
    for skin in &scene.skins {
        let z = 1 + skin.layers.iter().map(|layer| u64::from(layer.cells)).sum::<u64>();
        let columns = (u64::from(skin.cells[0]) + 1) * (u64::from(skin.cells[1]) + 1);
        let (nodes, key) = match &skin.mesh {
            Some(mesh) => (mesh.nodes().len() as u64, "the number of tetrahedra in mesh"),
            None => (columns * z, "cells"),
        };
        let reserve = match skin.cut {
            Cut::Split { reserve_columns } if cuts => u64::from(reserve_columns),
            _ => 0,
        };
        let of_column = if skin.is_without_columns() { 1 } else { z };
        let [of_grid, of_reserve] = purpose.of_node(skin, scene.contact.is_some());
        let parts = [
            (nodes * of_grid, cells_of(&skin.name), key),
            (reserve * of_column * of_reserve, reserve_of(&skin.name), "cut_reserve_columns"),
        ];
        for part in parts {
            wanted += part.0;
            largest = if part.0 > largest.0 { part } else { largest };
        }
    }
    if wanted <= free {
        return Ok(());
    }
    Err(Refused::Memory { at: scene.at(&largest.1), wanted, free, key: largest.2 }.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Cut, Preconditioner, incision};

    /// Bytes per cell by purpose, on 64 × 64 × 23 cells without tools.
    fn shares_of(preconditioner: Preconditioner) -> Vec<Share> {
        let mut scene = incision().expect("the embedded scene is valid");
        scene.skins[0].cells = [64, 64];
        for (layer, cells) in scene.skins[0].layers.iter_mut().zip([10, 10, 3]) {
            layer.cells = cells;
        }
        (scene.contact, scene.tools) = (None, vec![]);
        scene.solver.preconditioner = preconditioner;
        inspect(&scene).expect("a dry device takes any grid").shares
    }

    #[test]
    fn multigrid_takes_less_than_200_bytes_a_cell() {
        let of = |shares: &[Share], purpose: &str| {
            shares.iter().filter(|s| s.purpose == purpose).map(|s| s.bytes_per_cell).sum::<f64>()
        };
        let with = shares_of(Preconditioner::Multigrid);
        let own = of(&with, "multigrid");
        assert!(own > 0.0 && own + of(&with, "columns") < 200.0, "{with:?}");
        // displacements, velocities, forces, loads, axes and mass; rotations and stiffness of the volume: 144 bytes a cell
        let state = of(&with, "state");
        assert!((144.0..160.0).contains(&state), "{with:?}");
        assert_eq!(of(&shares_of(Preconditioner::Column), "multigrid"), 0.0);
    }

    #[test]
    fn a_blade_takes_memory_with_its_reserve_and_a_blunt_tool_none() {
        let mut scene = incision().expect("the embedded scene is valid");
        let mut blade_bytes = |reserve_columns: u32| {
            scene.skins[0].cut = Cut::Split { reserve_columns };
            inspect(&scene).expect("a dry device takes the scene")
        };
        let [small, large] = [100, 200].map(&mut blade_bytes);
        assert!(small.blade_bytes > 0);
        // displacements, velocities, forces, loads, masses, blocks of columns, CG vectors of eight right-hand sides: over 1 kB a node
        let copies = 100 * 6;
        assert!(large.blade_bytes - small.blade_bytes > 1000 * copies, "{} {}", small.blade_bytes, large.blade_bytes);
        scene.tools.iter_mut().for_each(|tool| tool.blade = None);
        let blunt = inspect(&scene).expect("a dry device takes the scene");
        assert_eq!(blunt.blade_bytes, 0);
        assert_eq!(blunt.device_bytes, small.device_bytes - small.blade_bytes);
        assert!(!blunt.kernels.iter().any(|k| ["cut", "duplicate", "split_product"].contains(k)));
    }

    #[test]
    fn the_largest_part_is_the_one_to_lower() {
        let mut scene = incision().expect("the embedded scene is valid");
        fits(&scene, Purpose::Double).expect("it is small");
        let words = |scene: &Scene| fits(scene, Purpose::Double).map_err(|e| e.to_string());
        scene.skins[0].cut = Cut::Split { reserve_columns: u32::MAX };
        let Err(reserve) = words(&scene) else { return assert!(free().is_none()) };
        assert!(reserve.contains("cut_reserve_columns"), "{reserve}");
        scene.skins[0].cells = [1 << 20; 2];
        scene.skins[0].cut = Cut::Remove;
        assert!(words(&scene).expect_err("no machine has it").ends_with("lower cells, or close what takes memory"));
    }
}
