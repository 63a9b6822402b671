//! Linear tetrahedra: of a mesh file, or six to each cell of a grid, with the same nodes ([`Grid::tetrahedra`]). Smoothed elements, which do
//! not lock, and plain ones, which do ([`crate::kernels::tetrahedra`]).
//!
//! Error of the skin block's centre displacement on 20×20×5 cells (tests/verify/tetrahedra.rs), %, at ν 0.45, 0.49, 0.499:
//! smoothed +9, +7, −2; plain −26, −54, −88. Hexahedra of mean dilatation have +2, +2, +1. Error of the force on the probe of
//! scenes/skin_tetra.toml on irregular meshes of 768, 2592 and 6144 tetrahedra (tests/engine/meshes.rs), %: smoothed +24, +9, −2; plain, on the
//! last, +45.
//!
//! In a grid, contact, loads and probes see the faces of the cells, whose shape functions share the tetrahedra's nodes, and masses are those
//! of the cells. Of a mesh they see the triangles of its outside, and each tetrahedron gives its corners a quarter of its mass.

pub mod cpu;
mod gpu;
pub mod operator;

use super::gpu::{Maker, Recorded};
use super::{Elements, Holds, Kind, Mechanics, Model, Moved, Refused, Removal, Segments, Snapshot, Solved, Wound};
use crate::bodies::grid::element;
use crate::bodies::grid::local::beyond;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::kernels::cut::Hit;
use crate::kernels::{GROUP, Params};
use crate::math::{M3, V3, V4};
use crate::mesh::{Grid, PER_CELL};
use crate::scene::{Element, Integrator, Law, Layer, Mass, PRECONDITIONER, Preconditioner, ProbeKind, Scene};
use operator::Arrays;

/// Arrays of a body of tetrahedra.
#[derive(Clone, Debug, Default)]
pub struct Tetrahedra {
    /// The elastic operator; empty in a model of sizes.
    pub arrays: Arrays<f64>,
    /// Rotations of elements and edges; otherwise small strains.
    pub corotational: bool,
    /// Smoothed elements; otherwise plain ones.
    pub smoothed: bool,
}

/// Refuses a scene of tetrahedra with what is for other elements.
///
/// # Errors
/// [`Refused::Tetrahedra`].
pub(super) fn check(scene: &Scene, body: usize) -> Result<()> {
    let skin = &scene.skins[body];
    let of_key = |key, what, fix| Err(Refused::Tetrahedra { key, what, fix }.into());
    let refuse = |what, fix| of_key("", what, fix);
    let of_cells = |kind: &ProbeKind| match kind {
        ProbeKind::Reaction { body: of, .. }
        | ProbeKind::Strain { body: of, .. }
        | ProbeKind::Stress { body: of, .. } => *of == body,
        _ => false,
    };
    match scene.solver.preconditioner {
        Preconditioner::None | Preconditioner::Jacobi | Preconditioner::Block => {}
        _ => return of_key(PRECONDITIONER, "this preconditioner", "take \"block\""),
    }
    if scene.time.integrator == Integrator::SymplecticEuler {
        return refuse("integrator = \"symplectic_euler\"", "take \"implicit_euler\"");
    }
    if skin.mass == Mass::Consistent {
        return refuse("mass = \"consistent\"", "take \"lumped\"");
    }
    if skin.layers.iter().any(|layer| layer.pre_strain != [0.0; 2]) {
        return refuse("pre_strain", "leave it out");
    }
    if scene.tools.iter().any(|tool| tool.blade.is_some()) {
        return refuse("a blade", "take a tool without one");
    }
    if scene.probes.iter().any(|probe| of_cells(&probe.kind)) {
        return refuse(
            "a probe of a reaction, strain or stress",
            "probe displacements or the tools' forces, or save the field by [output] fields",
        );
    }
    Ok(())
}

impl Tetrahedra {
    /// Without the arrays of the grid's size.
    pub(super) fn of_law(law: Law) -> Self {
        let (smoothed, corotational) = match law {
            Law::Fem { element, corotational } => (element == Element::Tetra, corotational),
            _ => (true, true),
        };
        Self { arrays: Arrays::default(), corotational, smoothed }
    }

    /// Fills the arrays: `rest` has the nodes of the grid or of its mesh, m.
    pub(super) fn fill(&mut self, grid: &Grid, rest: &[[f64; 3]], layers: &[Layer]) {
        let moduli: Vec<[f64; 2]> = layers
            .iter()
            .map(|layer| {
                let (lambda, mu) = element::lame(layer.young, layer.poisson);
                [lambda + 2.0 / 3.0 * mu, mu]
            })
            .collect();
        self.arrays = Arrays::new(rest, &grid.tetrahedra(), &moduli, self.smoothed);
    }

    /// Number of domains of the deviator: edges, once per material; none of plain elements.
    pub(super) fn domain_count(&self, grid: &Grid) -> usize {
        match self.smoothed {
            false => 0,
            // a model of sizes has no arrays
            true if self.arrays.shear.is_empty() => grid.tetrahedron_edges(),
            true => self.arrays.shear.len(),
        }
    }
}

impl Mechanics for Tetrahedra {
    fn elements(&self, model: &Model) -> Elements {
        Elements { tetrahedron_count: model.grid.tetrahedron_count(), ..Elements::default() }
    }

    fn around_nodes(&self, _: &Model) -> Vec<u32> {
        self.arrays.first_of_node.windows(2).map(|w| w[1] - w[0]).collect()
    }

    fn rotation_count(&self, _: &Model) -> usize {
        0
    }

    fn segments(&self, model: &Model) -> Segments {
        Segments { ends: vec![], rest: model.rest.clone() }
    }

    fn segment_count(&self, _: &Model) -> usize {
        0
    }

    fn point_count(&self, model: &Model) -> usize {
        model.own_nodes()
    }

    fn extra_columns(&self) -> usize {
        0
    }

    fn corotational(&self) -> u32 {
        u32::from(self.corotational)
    }

    fn product_groups(&self, model: &Model) -> usize {
        model.own_nodes().div_ceil(GROUP as usize)
    }

    fn exact(&self) -> Kind {
        Kind::Tetrahedra(Box::new(self.clone()))
    }

    fn host_bytes(&self, model: &Model) -> usize {
        let (nodes, count) = (model.own_nodes(), model.grid.tetrahedron_count());
        // corners and gradients; lists of the nodes, 1/volume and block
        let of_elements = size_of::<[u32; 4]>() + 3 * size_of::<V4<f64>>() + 4 * size_of::<u32>();
        let of_nodes = size_of::<u32>() + size_of::<f64>() + 2 * size_of::<V4<f64>>();
        let own = count * of_elements + nodes * of_nodes + size_of::<u32>();
        if !self.smoothed {
            return own;
        }
        // lists of the domains, both ways; volume and modulus
        let lists = count * 12 * size_of::<u32>() + size_of::<u32>();
        own + lists + self.domain_count(&model.grid) * (size_of::<[f64; 2]>() + size_of::<u32>())
    }

    fn energy(&self, _: &Model, u: &[V4<f64>], _: &[V4<f64>], _: &[u32], _: &[V4<f64>]) -> f64 {
        self.arrays.energy(u, self.corotational)
    }

    fn linearised(&self, _: &Model) -> bool {
        false
    }

    fn forces_and_product(
        &self,
        model: &Model,
        solved: &Solved,
        at: &[V4<f64>],
        in_system: &[V4<f64>],
    ) -> [Vec<V4<f64>>; 2] {
        let zeros = vec![[0.0; 4]; at.len()];
        let (mut f, mut w) = (zeros.clone(), zeros);
        let rotations = self.arrays.rotations(&solved.start.u, self.corotational);
        let scratch = &mut self.arrays.scratch();
        self.arrays.forces(at, &rotations, &mut f, scratch);
        self.arrays.system_product(&model.params(), in_system, &solved.dx, &rotations, &mut w, scratch);
        [f, w]
    }

    fn rotations(&self, _: &Model, _: &Snapshot) -> Vec<V4<f64>> {
        vec![]
    }

    /// Of the whole body, since the volume at a node depends on nodes two elements away: scenes that ask for fewer nodes are refused.
    fn forces_at(&self, model: &Model, _: &Wound, nodes: &[u32], moved: &Moved) -> Vec<[f64; 3]> {
        let (u, v): (Vec<_>, Vec<_>) = (0..model.own_nodes()).map(moved).map(|[u, v]| (u.pad(0.0), v.pad(0.0))).unzip();
        let rotations = self.arrays.rotations(&u, self.corotational);
        let (mut f, mut damping) = (vec![[0.0; 4]; u.len()], vec![[0.0; 4]; u.len()]);
        let scratch = &mut self.arrays.scratch();
        self.arrays.forces(&u, &rotations, &mut f, scratch);
        self.arrays.product(&v, &rotations, &mut damping, scratch);
        let sum = |node: &u32| {
            let i = *node as usize;
            (V3::from4(f[i]) + V3::from4(damping[i]) * model.step.rayleigh_stiffness).f64()
        };
        nodes.iter().map(sum).collect()
    }

    fn strain_and_stress(&self, _: &Model, _: usize, _: &[V3<f64>; 8], _: [f64; 3]) -> [M3<f64>; 2] {
        unreachable!("scenes with probes of strain and stress in tetrahedra are refused")
    }

    /// Of a cell of a grid the means over its tetrahedra.
    fn strains_and_stresses(&self, model: &Model, _: &Wound, u: &[V4<f64>]) -> Vec<[M3<f64>; 2]> {
        let all = self.arrays.strains_and_stresses(u, self.corotational);
        if model.unstructured().is_some() {
            return all;
        }
        let (six, _) = all.as_chunks::<PER_CELL>();
        let mean = |own: &[[M3<f64>; 2]; PER_CELL]| {
            [0, 1].map(|k| own.iter().fold(M3::zero(), |sum, own| sum + own[k]) * (1.0 / PER_CELL as f64))
        };
        six.iter().map(mean).collect()
    }

    /// Nothing cuts or carves them.
    fn alive_share(&self, _: &Model, _: &Wound, _: usize) -> f64 {
        1.0
    }

    fn count_cells(&self, model: &Model, state: &Snapshot, holds: &Holds) -> u32 {
        let gradients = self.arrays.displacement_gradients(&state.u);
        let of = |(e, h): &(usize, &M3<f64>)| holds(model.grid.tetrahedron_layer(*e), M3::identity() + **h);
        gradients.iter().enumerate().filter(of).count() as u32
    }

    fn beyond_law(&self, _: usize, gradient: M3<f64>) -> bool {
        beyond(gradient - M3::identity(), self.corotational)
    }

    fn stays(&self, _: &Model, _: &[V4<f64>], _: &[V4<f64>], _: usize) -> bool {
        true
    }

    fn cut(&self, _: &Model, _: &mut Wound, _: &[Hit<f64>]) -> Removal {
        Removal::default()
    }

    fn pieces(&self, _: &Wound) -> Option<usize> {
        None
    }

    fn mass_left(&self, _: &Model, wound: &Wound) -> f64 {
        wound.mass_of_nodes()
    }

    fn splitting(&self, _: &Layer) -> f64 {
        f64::INFINITY
    }

    fn recorded(&self, _: &Model, made: &mut Maker, _: &Buffer, params: &Params<f32>) -> Result<Box<dyn Recorded>> {
        Ok(Box::new(gpu::Tetrahedra::new(self, made, params)?))
    }
}
