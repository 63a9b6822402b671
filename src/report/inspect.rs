//! What a scene will allocate and run, without running anything and without an adapter.
//!
//! The body is set up by the code that sets it up on a GPU, on wgpu's device that does nothing: arrays and kernels are those of a run
//! by construction, every kernel passes wgpu's validation, and nothing is computed. Dispatches and read-backs are counted from how
//! [`crate::step`] drives the backend.

use crate::backend::GpuBackend;
use crate::bodies::Model;
use crate::error::Result;
use crate::gpu::{Gpu, Made, adapters};
use crate::scene::{Correction, Integrator, Law, ProbeKind, Scene, Skin};
use crate::step::{needs, start};
use serde::Serialize;

/// One array of the body.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Array {
    /// As the kernels call it.
    pub name: &'static str,
    /// What it is for.
    pub purpose: &'static str,
    /// How many elements.
    pub elements: u64,
    /// With padding.
    pub bytes: u64,
}

/// Memory of one purpose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// What for.
    pub purpose: &'static str,
    /// Bytes on the GPU that grow with the grid, by cell; uniforms, which do not, are left out.
    pub bytes_per_cell: f64,
}

/// Something that happens a number of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Count {
    /// What.
    pub name: &'static str,
    /// How many times,
    pub count: u32,
    /// per what.
    pub per: &'static str,
}

/// A scene laid open.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Plan {
    /// Scene file.
    pub scene: String,
    /// Nodes of the deformable bodies.
    pub nodes: usize,
    /// Cells of their grids.
    pub cells: usize,
    /// Springs; 0 for bricks.
    #[serde(rename = "springs")]
    pub spring_count: usize,
    /// Axes of nodes that nothing holds.
    pub dof: usize,
    /// Steps of the scene's duration.
    pub steps: u32,
    /// Right-hand sides that are solved together at most: free motion, correction, contact columns.
    pub right_hand_sides: usize,
    /// Arrays on the GPU.
    pub arrays: Vec<Array>,
    /// Kernels that are compiled.
    pub kernels: Vec<&'static str>,
    /// Kernel launches, body by body.
    pub dispatches: Vec<Count>,
    /// Times that the host waits for values.
    pub read_backs: Vec<Count>,
    /// The arrays by what they are for.
    pub shares: Vec<Share>,
    /// What the scene's blades add to the arrays: the cut's own, the table of split nodes, and the copies' places in all arrays of nodes.
    pub blade_bytes: u64,
    /// Sum of the arrays.
    pub device_bytes: u64,
    /// Constant arrays that the host keeps.
    pub host_bytes: u64,
}

/// Lists what a run of a scene on a GPU will hold and do.
///
/// # Errors
/// When the scene is too large for 32-bit indices, or a kernel is not valid.
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
    for number in 0..scene.skins.len() {
        add_body(&mut plan, scene, &Model::new(scene, number)?)?;
    }
    plan.shares = shares(&plan.arrays, plan.cells);
    plan.device_bytes = plan.arrays.iter().map(|a| a.bytes).sum();
    Ok(plan)
}

/// What one deformable body adds.
fn add_body(plan: &mut Plan, scene: &Scene, model: &Model) -> Result<()> {
    let (needs, solver) = (needs(scene, model), scene.solver);
    let start = start(scene, model);
    let backend = GpuBackend::new(Gpu::dry()?, model, needs, solver.max_iterations, solver.floor, &start)?;
    plan.nodes += model.own_nodes();
    plan.cells += model.cell_count();
    plan.spring_count += model.elements().spring_count;
    plan.dof += model.degrees_of_freedom();
    plan.right_hand_sides = plan.right_hand_sides.max(needs.slots());
    plan.host_bytes += model.host_bytes();
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

/// Arrays whose size does not follow the grid: uniforms, and those of the probe.
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

/// Kinds of probes that ask the backend.
fn probes(scene: &Scene) -> u32 {
    let any = |is: fn(&ProbeKind) -> bool| u32::from(scene.probes.iter().any(|p| is(&p.kind)));
    any(|k| matches!(k, ProbeKind::Reaction { .. })) + any(|k| matches!(k, ProbeKind::Displacement { .. }))
}

fn dispatches(scene: &Scene, model: &Model, [begin, iteration, split, place]: [u32; 4]) -> Vec<Count> {
    let count = |name, count, per| Count { name, count, per };
    // and integration
    let per = if model.step.explicit() { "step" } else { "iteration" };
    let mut list = vec![count("free motion", begin + 1, "step"), count("solver", iteration, per)];
    if place > 0 {
        list.push(count("place", place, "place tried"));
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
        // where the segments are before the step and after it; springs copy the nodes
        list.push(count("cut", if model.elements().spring_count > 0 { 1 } else { 3 }, "step with contact"));
    }
    list
}

fn read_backs(scene: &Scene) -> Vec<Count> {
    let count = |name, count, per| Count { name, count, per };
    let hyperelastic = |skin: &Skin| matches!(skin.law, Law::Hyperelastic(_));
    let newton = scene.contact.is_none() && scene.skins.iter().any(hyperelastic);
    let mut list = match scene.time.integrator {
        Integrator::SymplecticEuler => vec![count("queue", 1, "32 steps")],
        _ if newton => vec![count("place", 1, "place tried"), count("solver", 1, "Newton iteration")],
        _ => vec![count("solver", 1, "step")],
    };
    if newton && !scene.skins.iter().all(hyperelastic) {
        list.push(count("solver", 1, "step"));
    }
    if !newton && scene.skins.iter().any(hyperelastic) {
        list.push(count("energies", 1, "step"));
    }
    if probes(scene) > 0 {
        list.push(count("probes", probes(scene), "step"));
    }
    if let Some(law) = &scene.contact {
        list.push(count("boxes", 1, "step"));
        list.push(count("contact", 1, "step with contact"));
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
        list.push(count("cut", 1, "step with contact"));
    }
    list
}

/// The adapter that `--backend auto` takes; none for the CPU path.
pub fn automatic() -> Option<crate::gpu::Adapter> {
    adapters().into_iter().find(|a| !a.software)
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
        // displacements, velocities, forces, loads, axes and mass; rotations: 96 bytes a cell
        let state = of(&with, "state");
        assert!((96.0..110.0).contains(&state), "{with:?}");
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
}
