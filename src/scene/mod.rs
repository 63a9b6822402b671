//! Scenes: what is simulated, with which laws, to which tolerance.
//!
//! A scene file is TOML; every key carries its unit (`size_mm`, `young_kpa`). In memory everything is SI: m, kg, s, N, Pa.
//! [`read`] turns text into a [`Scene`] or into one error that says file, line, what was found, what was wanted and how to mend it.

mod bodies;
mod body;
mod builtin;
mod code;
mod devices;
mod diagnose;
mod files;
mod grid;
mod hyperelastic;
mod integrator;
mod invalid;
pub mod keys;
mod lines;
mod outputs;
mod raw;
mod read;
mod recorded;
mod region;
mod round;
mod study;
mod text;
mod tools;
mod touching;
mod words;

pub use body::Start;
pub use builtin::incision;
pub use devices::{Device, DeviceKind, Haptic, Rendering, Role};
pub use files::{COLUMNS as TRAJECTORY_COLUMNS, FORCE_COLUMNS, Files};
pub use grid::MOST_NODES;
pub use hyperelastic::{MATERIALS, Material};
pub use invalid::{Invalid, Location};
pub use read::{parse, read};
pub use recorded::{Check, Probe, ProbeKind, TestForm, View};
pub use region::Region;
pub use study::Study;
pub use touching::{
    Attachment, Blade, BodyId, Contact, Correction, Coupling, Filter, Lines, Loop, Motion, Plane, Pose, Round, Slide,
    Tool, ToolMesh,
};

pub use words::{CORRECTIONS, ELEMENTS, INTEGRATORS, PRECONDITIONERS, word};

use std::path::PathBuf;

/// A whole scene in SI units, checked: every number is finite and in its range.
#[derive(Clone, Debug)]
pub struct Scene {
    /// One line on what the scene shows.
    pub title: String,
    /// Where the text came from, for messages.
    pub file: PathBuf,
    /// Step, duration, gravity.
    pub time: Time,
    /// Linear solver of the free motion.
    pub solver: Solver,
    /// Deformable bodies: the `[skin]`, then the `[[block]]`s; none in a scene of rigid bodies alone.
    pub skins: Vec<Skin>,
    /// Constrained regions; none for a free body.
    pub boundaries: Vec<Boundary>,
    /// Regions on springs to their rest shape.
    pub anchors: Vec<Anchor>,
    /// Dead loads.
    pub loads: Vec<Load>,
    /// Rigid bodies: the `[[tool]]`s, each driven by a hand, then the `[[rigid]]`s, which nothing holds.
    pub tools: Vec<Tool>,
    /// Walls that nothing moves.
    pub planes: Vec<Plane>,
    /// What is tied to what.
    pub attachments: Vec<Attachment>,
    /// Contact law; `None` when nothing in the scene can touch and nothing is tied.
    pub contact: Option<Contact>,
    /// The haptic loop.
    pub haptic: Haptic,
    /// Values written each step to `probes.csv`.
    pub probes: Vec<Probe>,
    /// Bounds on the outcome, evaluated at the end of a run.
    pub checks: Vec<Check>,
    /// What `cutis study` varies.
    pub study: Study,
    /// A smaller form of the scene for its run in the tests.
    pub test: Option<TestForm>,
    /// Pictures.
    pub view: View,
}

impl Scene {
    /// The scene as the tests run it: with the cells and steps of its test form.
    #[must_use]
    pub fn in_test_form(&self) -> Self {
        let mut scene = self.clone();
        if let Some(form) = self.test {
            if let (Some(skin), Some(cells)) = (scene.skins.first_mut(), form.cells) {
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
    /// Parts that each step is divided into; results are of whole steps.
    pub substeps: u32,
    /// How steps are taken.
    pub integrator: Integrator,
}

/// How a step is taken ([`crate::bodies::Step`] has the formulas).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// Stable at any step, damps by itself.
    ImplicitEuler,
    /// Average acceleration: of second order, keeps the energy of a linear body.
    Newmark,
    /// Explicit: nothing is solved, steps are short.
    SymplecticEuler,
}

impl Time {
    /// Length of what is advanced at once, s.
    pub fn part(&self) -> f64 {
        self.step / f64::from(self.substeps)
    }

    /// Steps of the whole duration.
    pub fn steps(&self) -> u32 {
        (self.duration / self.step).round().max(1.0) as u32
    }
}

/// Which preconditioner the conjugate gradients use.
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
    /// A V-cycle of geometric multigrid, smoothed by columns; bricks only.
    Multigrid,
    /// A sparse Cholesky factor of the whole matrix, so that a solve is exact; bricks only, on the CPU path.
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
    /// Iterations per solve after which the solve counts as not converged.
    pub max_iterations: u32,
    /// Rounds of iterative refinement per step at most: residual in f64 on the host, correction in the backend's precision.
    pub refinements: u32,
    /// Every how many steps the true residual is computed in f64; the last step always.
    pub true_residual_every: u32,
}

/// A deformable body: a regular grid of bricks in bonded layers.
#[derive(Clone, Debug)]
pub struct Skin {
    /// `skin`, or the name of a block.
    pub name: String,
    /// Where the middle of its bottom is at rest, m.
    pub position: [f64; 3],
    /// Extent in x and y, m.
    pub size: [f64; 2],
    /// Cells in x and y.
    pub cells: [u32; 2],
    /// Layers from the bottom up, at least one.
    pub layers: Vec<Layer>,
    /// The elastic law.
    pub law: Law,
    /// Where the mass lies.
    pub mass: Mass,
    /// What a blade does to it.
    pub cut: Cut,
    /// 1/s
    pub rayleigh_mass: f64,
    /// s
    pub rayleigh_stiffness: f64,
    /// Velocity of every node at the start, m/s.
    pub velocity: [f64; 3],
    /// Displacement of every node at the start, m.
    pub displacement: [f64; 3],
    /// Shape at the start, before that displacement.
    pub start: Start,
}

/// What a blade does to a body of bricks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// It severs links between cells; nodes split where cells hang together no more, and nothing is lost.
    Split {
        /// Columns of nodes that can be split off; where they are used up nothing more is cut.
        reserve_columns: u32,
    },
    /// It removes the cell in whose half it crossed a link.
    Remove,
}

/// One layer of the skin.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Name, used by regions and outputs.
    pub name: String,
    /// m
    pub thickness: f64,
    /// Cells over the thickness.
    pub cells: u32,
    /// Pa; unused by the spring law.
    pub young: f64,
    /// 0 ≤ ν < 0.5; unused by the spring law.
    pub poisson: f64,
    /// Share of the shear modulus that the law's second constant carries, `c01/(c10 + c01)` of Mooney–Rivlin; else unused.
    pub second_share: f64,
    /// kg/m³
    pub density: f64,
    /// Elastic strain along x and y that the material has in the reference position; zero in the spring law.
    pub pre_strain: [f64; 2],
    /// Cutting energy per area, J/m².
    pub toughness: f64,
    /// sRGB
    pub color: [u8; 3],
}

/// The elastic law of the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Bricks.
    Fem {
        /// Which brick.
        element: Element,
        /// Corotational, or linear ("small") when false.
        corotational: bool,
    },
    /// Bricks of a hyperelastic material ([`crate::bodies::grid::Hyperelastic`]).
    Hyperelastic(Material),
    /// Springs between every pair of nodes of a cell, as SOFA's MeshSpringForceField makes them.
    Springs {
        /// N/m
        stiffness: f64,
        /// N·s/m
        damping: f64,
    },
}

/// Where the mass of the skin lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mass {
    /// An eighth of each cell's mass at each of its corners, as SOFA's DiagonalMass; it goes with the cell.
    Lumped,
    /// The same at every node, as SOFA's UniformMass: total mass over count of nodes. A cut takes it only with nodes that leave.
    Uniform,
    /// `∫ ρ N_a N_b dV`, spread over each cell; it goes with the cell. Bricks only.
    Consistent,
}

/// Brick element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// Trilinear, full integration; locks near incompressibility.
    Plain,
    /// Trilinear with mean dilatation.
    Bbar,
    /// Trilinear with nine inner modes.
    Enhanced,
}

/// Springs from the nodes of a region to their rest positions.
#[derive(Clone, Debug)]
pub struct Anchor {
    /// Number of the deformable body.
    pub body: usize,
    /// Which nodes.
    pub region: Region,
    /// Of each node's spring, N/m.
    pub stiffness: f64,
}

/// Nodes held, or moved, along chosen axes.
#[derive(Clone, Debug)]
pub struct Boundary {
    /// Number of the deformable body.
    pub body: usize,
    /// Which nodes.
    pub region: Region,
    /// Which of x, y, z are held.
    pub axes: [bool; 3],
    /// Displacement of the held axes from the first step on, m.
    pub displacement: [f64; 3],
    /// Turn of the held nodes about the vertical axis through the middle of the body, before that displacement, rad.
    pub turn: f64,
}

/// A dead pressure on a rectangle of the top.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    /// Number of the deformable body.
    pub body: usize,
    /// Pa, downward.
    pub pressure: f64,
    /// Rectangle on the top (x, y), m.
    pub min: [f64; 2],
    /// m
    pub max: [f64; 2],
    /// s; the load acts from here
    pub start: f64,
    /// s; until here (infinity when not given)
    pub end: f64,
}
