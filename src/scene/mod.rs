//! Scenes: bodies, laws, motions and tolerances of a simulation.
//!
//! A scene file is TOML; every key carries its unit (`size_mm`, `young_kpa`). In memory everything is SI: m, kg, s, N, Pa. [`read`] turns
//! text into a [`Scene`], or into one error that states file, line, what was found, what was wanted and how to fix it.

#[macro_use]
mod raw;

mod bodies;
mod body;
mod code;
mod devices;
mod embedded;
mod files;
mod grid;
mod hyperelastic;
mod integrator;
mod invalid;
pub mod keys;
mod limits;
mod loads;
mod notes;
mod obj;
mod outputs;
mod read;
mod recorded;
mod region;
mod round;
mod study;
mod tetrahedral;
mod text;
mod tools;
mod touching;
mod words;

pub use body::Start;
pub use embedded::{ClosedSurface, Leak};
#[cfg(feature = "program")]
pub(crate) use files::bytes_of;
pub use files::{COLUMNS as TRAJECTORY_COLUMNS, FORCE_COLUMNS, Files};
pub use hyperelastic::{Fibres, MATERIALS, Material};
pub use invalid::{Invalid, Location};
pub use limits::{MOST_NODES, free};
pub use read::{incision, parse, read};
pub use recorded::{
    Check, Component, FIXED_COLUMNS, Output, OutputField, Probe, ProbeKind, SurfaceFormat, TestForm, View,
};
pub use region::{ACROSS, CellFace, Group, Region, Spans, TrianglePart, share_of};
pub use study::Study;
pub use tetrahedral::{Defect, TetrahedralMesh};
pub use text::nearest;
pub use touching::{
    Attachment, Blade, BodyId, Carve, Contact, Correction, Coupling, Device, DeviceKind, Filter, Haptic, Lines, Loop,
    Motion, Plane, Pose, Rendering, Role, Round, Slide, Tool, ToolMesh,
};

pub use words::{COMPONENTS, CORRECTIONS, ELEMENTS, INTEGRATORS, PRECONDITIONERS, TETRAHEDRA, word};

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// A complete scene in SI units. [`Scene::check`] tests that every number is finite and in its range.
#[derive(Clone, Debug)]
pub struct Scene {
    /// One-line description.
    pub title: String,
    /// Source of the text, for messages.
    pub file: PathBuf,
    /// Lines of that text where keys stand that can be refused once the scene has been read; none for scenes made in code.
    pub lines: BTreeMap<String, usize>,
    /// Step, duration, gravity.
    pub time: Time,
    /// Linear solver of the unconstrained motion.
    pub solver: Solver,
    /// Deformable bodies: the `[skin]`, then the `[[block]]`s; none in a scene of rigid bodies alone.
    pub skins: Vec<Skin>,
    /// Dirichlet conditions on regions; none for a free body.
    pub boundaries: Vec<Boundary>,
    /// Regions with rest-shape springs.
    pub rest_springs: Vec<RestSpring>,
    /// Regions of bodies with another stiffness than their layers.
    pub inclusions: Vec<Inclusion>,
    /// Loads on surfaces.
    pub loads: Vec<Load>,
    /// Rigid bodies: the `[[tool]]`s, each held by a hand, then the `[[rigid]]`s, which are free.
    pub tools: Vec<Tool>,
    /// Fixed walls.
    pub planes: Vec<Plane>,
    /// Bilateral constraints between bodies.
    pub attachments: Vec<Attachment>,
    /// Contact law; `None` if nothing can touch and there are no attachments.
    pub contact: Option<Contact>,
    /// Haptic loop.
    pub haptic: Haptic,
    /// Values written each step to `probes.csv`.
    pub probes: Vec<Probe>,
    /// Bounds on results, evaluated at the end of a run.
    pub checks: Vec<Check>,
    /// Variations for `cutis study`.
    pub study: Study,
    /// Smaller form of the scene for the tests.
    pub test: Option<TestForm>,
    /// Pictures.
    pub view: View,
    /// What is saved with them beside the usual.
    pub output: Output,
}

/// Key of [`Scene::lines`] for the step.
pub const STEP: &str = "step_ms";

/// Key of [`Scene::lines`] for a check.
pub fn check_of(key: &str) -> String {
    format!("check {key}")
}

/// Key of [`Scene::lines`] for a tool's device.
pub fn device_of(tool: &str) -> String {
    format!("device of {tool}")
}

/// Key of [`Scene::lines`] for an attachment, by its number.
pub fn attach_of(number: usize) -> String {
    format!("attach {number}")
}

/// Key of [`Scene::lines`] for the preconditioner.
pub const PRECONDITIONER: &str = "preconditioner";

/// Key of [`Scene::lines`] for the pieces of a blade's edge: of the first tool that has one.
pub const EDGE_SPACING: &str = "edge_spacing_mm";

/// Key of [`Scene::lines`] for a body's cells.
pub fn cells_of(body: &str) -> String {
    format!("cells of {body}")
}

/// Key of [`Scene::lines`] for the room that a body's cuts have.
pub fn reserve_of(body: &str) -> String {
    format!("cut_reserve_columns of {body}")
}

impl Scene {
    /// Name of a body; `world` for the world.
    ///
    /// # Panics
    /// For a body that the scene does not have.
    pub fn body_name(&self, body: BodyId) -> &str {
        match body {
            BodyId::Rigid(number) => &self.tools[number].name,
            BodyId::Deformable(number) => &self.skins[number].name,
            BodyId::Plane(number) => &self.planes[number].name,
            BodyId::World => "world",
        }
    }

    /// Where a key stands, for messages: the file, with the line if that is known.
    pub fn at(&self, key: &str) -> String {
        match self.lines.get(key) {
            Some(line) => format!("{}:{line}", self.file.display()),
            None => self.file.display().to_string(),
        }
    }

    /// Whether steps of hyperelastic bodies are solved by Newton's method: where asked for; by the midpoint rule, whose steps are of second
    /// order only so; and in static steps where nothing may touch. Not with follower pressures: the potential that it minimises is of loads
    /// that stay, and a body under their pressure turns or buckles.
    pub fn newton(&self) -> bool {
        !self.has_followers() && self.time.integrator.newton(self.solver.newton, self.contact.is_some())
    }

    /// Whether steps are solved in full without Newton's method, as those with contact or follower pressures and of hyperelastic tetrahedra are
    /// where `solver.newton` asks for it: again with what their linearisation leaves of the law ([`crate::kernels::defect`]), until law,
    /// contact and pressures hold together. Static steps always are.
    pub fn in_full(&self) -> bool {
        let implicit = self.time.integrator == Integrator::ImplicitEuler;
        let of_tetrahedra = self.skins.iter().any(|skin| matches!(skin.law, Law::LargeTetra { .. }));
        let large = self.skins.iter().any(hyperelastic::large_strain);
        self.solver.newton && implicit && (of_tetrahedra || large && (self.contact.is_some() || self.has_followers()))
    }

    /// Whether steps of hyperelastic bodies end in the balance of the law, by Newton's method or in full.
    pub(crate) fn balances_law(&self) -> bool {
        let hyperelastic = self.skins.iter().any(|skin| matches!(skin.law, Law::Hyperelastic(_)));
        self.in_full() || hyperelastic && self.newton()
    }

    /// Whether a follower pressure acts within the run.
    pub(crate) fn has_followers(&self) -> bool {
        loads::followed(&self.loads, self.time.duration)
    }

    /// Why `solver.newton` does not go with the rest of the scene, if so.
    pub(crate) fn unfit_for_newton(&self) -> Option<&'static str> {
        let correction = self.contact.map(|contact| contact.correction);
        hyperelastic::unfit_for_newton(&self.skins, correction, self.has_followers(), self.time.integrator)
    }

    /// Whether a tool carves space out of a deformable body.
    pub fn carves_space(&self, body: usize) -> bool {
        let carves = |tool: &Tool| tool.carve.is_some_and(|carve| !carve.whole_cells);
        self.skins[body].has_space_to_carve() && self.tools.iter().any(carves)
    }

    /// The scene as run by the tests: with the cells and steps of its test form.
    #[must_use]
    pub fn in_test_form(&self) -> Self {
        let mut scene = self.clone();
        if let Some(form) = self.test {
            if let (Some(skin), Some(cells)) = (scene.skins.first_mut().filter(|skin| skin.mesh.is_none()), form.cells)
            {
                skin.cells = cells;
            }
            scene.time.duration = form.steps.map_or(self.time.duration, |n| f64::from(n) * self.time.step);
        }
        scene
    }
}

/// Time stepping.
#[derive(Clone, Copy, Debug)]
pub struct Time {
    /// s
    pub step: f64,
    /// s
    pub duration: f64,
    /// m/s²
    pub gravity: [f64; 3],
    /// Number of substeps per step; results are of whole steps.
    pub substeps: u32,
    /// Integrator.
    pub integrator: Integrator,
}

/// Time integrator (formulas in [`crate::bodies::Step`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// Unconditionally stable, with numerical damping.
    ImplicitEuler,
    /// Average acceleration: second order, conserves the energy of a linear body.
    Newmark,
    /// Implicit midpoint rule with the energy of the step conserved: second order, for linear and hyperelastic bodies.
    Midpoint,
    /// Explicit: no solve, but a small critical step.
    SymplecticEuler,
    /// No inertia and no damping: each step ends in static balance.
    Static,
}

impl Integrator {
    /// Whether it is stable with a law, as far as the step goes: steps of second order that are solved by one linear system gain energy without
    /// bound where the law is not linear ([`crate::bodies::Step`]).
    pub fn fits(self, law: Law) -> bool {
        let linear = matches!(law, Law::Fem { corotational: false, .. });
        match self {
            Self::Newmark => linear,
            Self::Midpoint => linear || matches!(law, Law::Hyperelastic(_)),
            Self::ImplicitEuler | Self::SymplecticEuler | Self::Static => true,
        }
    }

    /// See [`Scene::newton`]: whether it is `asked` for, and whether bodies may touch.
    fn newton(self, asked: bool, touching: bool) -> bool {
        match self {
            Self::Midpoint => true,
            Self::Static => !touching,
            _ => asked && !touching,
        }
    }
}

impl Time {
    /// Length of a substep, s.
    pub fn part(&self) -> f64 {
        self.step / f64::from(self.substeps)
    }

    /// Steps of its duration, where they are more than can be counted.
    pub(super) fn too_many_steps(&self) -> Option<f64> {
        Some(self.duration / self.step).filter(|steps| *steps > f64::from(u32::MAX))
    }

    /// Number of steps.
    pub fn steps(&self) -> u32 {
        (self.duration / self.step).round().max(1.0) as u32
    }
}

/// Preconditioner of the conjugate gradients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preconditioner {
    /// Plain CG.
    None,
    /// The diagonal.
    Jacobi,
    /// 3×3 blocks of the nodes.
    Block,
    /// Block-tridiagonal along each z-column of nodes.
    Column,
    /// One V-cycle of geometric multigrid with column smoothing; of tetrahedra on an auxiliary grid, beside node blocks.
    Multigrid,
    /// Sparse Cholesky factor of the complete matrix, for direct solves; hexahedra only, CPU path only.
    Direct,
}

/// Linear solver settings.
#[derive(Clone, Copy, Debug)]
pub struct Solver {
    /// The preconditioner.
    pub preconditioner: Preconditioner,
    /// Residual relative to the step's load.
    pub tolerance: f64,
    /// Absolute floor of the residual, N.
    pub floor: f64,
    /// Iteration limit, after which a solve counts as not converged.
    pub max_iterations: u32,
    /// Hyperelastic bodies: solve each step to its nonlinear balance instead of one linear system: by Newton's method
    /// ([`Scene::newton`]), or with its contact ([`Scene::in_full`]).
    pub newton: bool,
    /// Maximum rounds of iterative refinement per step: residual in f64 on the host, correction in the backend's precision.
    pub refinements: u32,
    /// Interval, in steps, of the true residual in f64; the last step always has one.
    pub true_residual_every: u32,
}

/// A deformable body: a regular grid of hexahedra in bonded layers, the part of one within a closed surface, or the tetrahedra of a mesh.
#[derive(Clone, Debug)]
pub struct Skin {
    /// `skin`, or the name of a block.
    pub name: String,
    /// Rest position of the centre of its bottom face, m.
    pub position: [f64; 3],
    /// Extent in x and y, m; of a mesh that of its bounding box.
    pub size: [f64; 2],
    /// Cells in x and y; 0 of a mesh.
    pub cells: [u32; 2],
    /// Layers from the bottom up, at least one; of a mesh those that its tetrahedra name.
    pub layers: Vec<Layer>,
    /// Tetrahedra in place of a grid.
    pub mesh: Option<Arc<TetrahedralMesh>>,
    /// Surface of the body within its grid, which then is the box around it.
    pub embedded: Option<Arc<ClosedSurface>>,
    /// The elastic law.
    pub law: Law,
    /// Mass discretisation.
    pub mass: Mass,
    /// Effect of a blade.
    pub cut: Cut,
    /// 1/s
    pub rayleigh_mass: f64,
    /// s
    pub rayleigh_stiffness: f64,
    /// Initial velocity of every node, m/s.
    pub velocity: [f64; 3],
    /// Initial displacement of every node, m.
    pub displacement: [f64; 3],
    /// Initial shape, before that displacement.
    pub start: Start,
}

impl Skin {
    /// Whether tools that carve remove its cells, or its tetrahedra.
    pub fn can_be_carved(&self) -> bool {
        !matches!(self.law, Law::Springs { .. }) && self.cut == Cut::Remove && self.embedded.is_none()
    }

    /// Whether its springs may break by themselves.
    pub fn breaks(&self) -> bool {
        self.layers.iter().any(|layer| layer.break_strain.is_finite())
    }

    /// Whether tools may carve space out of it that is finer than its cells: out of hexahedra of a large-strain law, whose cells have factors on
    /// their stiffness and mass, and out of smoothed tetrahedra.
    pub fn has_space_to_carve(&self) -> bool {
        let smoothed = matches!(
            self.law,
            Law::Fem { element: Element::Tetra, .. } | Law::LargeTetra { element: Element::Tetra, .. }
        );
        self.can_be_carved() && (smoothed || matches!(self.law, Law::Hyperelastic(_)))
    }

    /// Whether its nodes are in no columns of a grid that a preconditioner for columns could take.
    pub fn is_without_columns(&self) -> bool {
        self.law.is_tetrahedral() || self.mesh.is_some()
    }
}

/// Effect of a blade on a body of hexahedra or of tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Severs links between cells and duplicates the nodes between disconnected cells; no volume is lost.
    Split {
        /// Reserve of duplicate node columns; when it is used up, links stay intact.
        reserve_columns: u32,
    },
    /// Removes the cell in whose half the blade crossed a link.
    Remove,
}

/// One layer of the skin.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Name, used by regions and outputs.
    pub name: String,
    /// m; 0 of a mesh.
    pub thickness: f64,
    /// Cells over the thickness; 0 of a mesh.
    pub cells: u32,
    /// Pa; of springs only where they are fitted to it.
    pub young: f64,
    /// 0 ≤ ν < 0.5; unused by the spring law.
    pub poisson: f64,
    /// Fraction of the shear modulus in the law's second constant, `c01/(c10 + c01)` of Mooney–Rivlin; otherwise unused.
    pub second_share: f64,
    /// Collagen fibres; only of [`Material::Holzapfel`].
    pub fibres: Fibres,
    /// kg/m³
    pub density: f64,
    /// Elastic strain along x and y in the reference shape (pre-strain); zero for springs.
    pub pre_strain: [f64; 2],
    /// Cutting energy per area, J/m².
    pub toughness: f64,
    /// Strain beyond which a spring breaks, infinite where none does; only of [`Law::Springs`].
    pub break_strain: f64,
    /// sRGB
    pub color: [u8; 3],
}

/// Elastic law of a skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Linear elastic hexahedra.
    Fem {
        /// Element type.
        element: Element,
        /// Corotational; otherwise linear (`small`).
        corotational: bool,
    },
    /// Hyperelastic hexahedra ([`crate::bodies::grid::Hyperelastic`]).
    Hyperelastic(Material),
    /// Hyperelastic tetrahedra ([`crate::kernels::tetrahedra_laws`]).
    LargeTetra {
        /// Law; one without fibres.
        material: Material,
        /// [`Element::Tetra`] or [`Element::PlainTetra`].
        element: Element,
    },
    /// Springs between all pairs of nodes of a cell, or along the edges of a mesh, as in SOFA's MeshSpringForceField.
    Springs {
        /// Of each, N/m; `None`, of a mesh: such that it has its layers' Young's moduli.
        stiffness: Option<f64>,
        /// N·s/m
        damping: f64,
    },
}

impl Law {
    /// Whether it has tetrahedra.
    pub fn is_tetrahedral(self) -> bool {
        matches!(self, Self::Fem { element: Element::Tetra | Element::PlainTetra, .. } | Self::LargeTetra { .. })
    }

    /// Whether a body of the tetrahedra of a mesh may have it.
    pub fn is_of_mesh(self) -> bool {
        self.is_tetrahedral() || matches!(self, Self::Springs { .. })
    }

    /// Whether it has hexahedra.
    pub fn is_hexahedral(self) -> bool {
        !self.is_tetrahedral() && !matches!(self, Self::Springs { .. })
    }
}

/// Mass discretisation of a skin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mass {
    /// An eighth of each cell's mass at each of its corners, as in SOFA's DiagonalMass; it is removed with the cell.
    Lumped,
    /// The same mass at every node (total mass over node count), as in SOFA's UniformMass. A cut removes it only with nodes that leave the
    /// system.
    Uniform,
    /// `∫ ρ N_a N_b dV` over each cell; it is removed with the cell. Hexahedra only.
    Consistent,
}

/// Element of small strains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// Trilinear, full integration; locks near incompressibility.
    Plain,
    /// Trilinear with mean dilatation.
    Bbar,
    /// Trilinear with nine incompatible modes.
    Enhanced,
    /// Tetrahedra with the deviator smoothed over edges and the volume at nodes.
    Tetra,
    /// Plain linear tetrahedra; lock near incompressibility.
    PlainTetra,
}

/// Rest-shape springs at the nodes of a region.
#[derive(Clone, Debug)]
pub struct RestSpring {
    /// Index of the deformable body.
    pub body: usize,
    /// Nodes.
    pub region: Region,
    /// Stiffness per node, N/m.
    pub stiffness: f64,
}

/// Part of a deformable body with another stiffness than its layers, such as a nodule. It has their Poisson's ratios, densities, fibres and
/// toughness; a cell that it fills in part is stiffened in part.
#[derive(Clone, Debug)]
pub struct Inclusion {
    /// Index of the deformable body; hexahedra of a hyperelastic law.
    pub body: usize,
    /// [`Region::Sphere`] or [`Region::Box`]. Where regions overlap, the last one counts.
    pub region: Region,
    /// Young's modulus, Pa.
    pub young: f64,
}

/// Dirichlet conditions: nodes fixed or displaced along chosen axes.
#[derive(Clone, Debug)]
pub struct Boundary {
    /// Index of the deformable body.
    pub body: usize,
    /// Nodes.
    pub region: Region,
    /// Constrained axes among x, y, z.
    pub axes: [bool; 3],
    /// Prescribed displacement of these axes from the first step on, m.
    pub displacement: [f64; 3],
    /// Rotation of the nodes about the vertical axis through the centre of the body, before that displacement, rad.
    pub rotation: f64,
    /// Displacement over time on top of both, linear between the poses' times; rotations are unused. Empty: none.
    pub path: Vec<Pose>,
}

impl Boundary {
    /// Whether a vector has a part along an axis that is not held.
    fn leaves(&self, by: &[f64; 3]) -> bool {
        (0..3).any(|n| !self.axes[n] && by[n] != 0.0)
    }
}

impl Default for Boundary {
    /// The bottom of the first body held at rest.
    fn default() -> Self {
        Self { body: 0, region: Region::Bottom, axes: [true; 3], displacement: [0.0; 3], rotation: 0.0, path: vec![] }
    }
}

/// A load on the outer surface of a deformable body; one that does not follow is a dead load.
#[derive(Clone, Debug)]
pub struct Load {
    /// Index of the deformable body.
    pub body: usize,
    /// Parts of the surface at rest; unused by a force at a point.
    pub region: Region,
    /// Kind and magnitude.
    pub kind: LoadKind,
    /// Start of the load, s
    pub start: f64,
    /// End of the load, s (default infinity)
    pub end: f64,
}

/// Kind of a [`Load`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadKind {
    /// Along the inward normal.
    Pressure {
        /// Pa
        pressure: f64,
        /// Normal and area of the shape at the start of each step; otherwise those at rest.
        follower: bool,
    },
    /// Force per area at rest, Pa.
    Traction([f64; 3]),
    /// Total force, spread evenly over the area at rest, N.
    Force([f64; 3]),
    /// Force at a material point.
    PointForce {
        /// N
        force: [f64; 3],
        /// Rest position in the body's frame, m.
        at: [f64; 3],
    },
}
