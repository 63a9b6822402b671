//! Scenes: what is simulated, with which laws, to which tolerance.
//!
//! A scene file is TOML; every key carries its unit (`size_mm`, `young_kpa`). In memory everything is SI: m, kg, s, N, Pa.
//! [`read`] turns text into a [`Scene`] or into one error that says file, line, what was found, what was wanted and how to mend it.

mod body;
mod builtin;
mod diagnose;
mod files;
mod grid;
mod lines;
mod outputs;
mod raw;
mod read;
mod recorded;
mod region;
mod round;
mod text;
mod tools;

pub use builtin::incision;
pub use files::Files;
pub use grid::MOST_NODES;
pub use read::{parse, read};
pub use recorded::{Check, Probe, ProbeKind, TestForm, View};
pub use region::Region;

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
    /// The deformable body.
    pub skin: Skin,
    /// Constrained regions; none for a free body.
    pub boundaries: Vec<Boundary>,
    /// Dead loads.
    pub loads: Vec<Load>,
    /// Rigid tools, each driven by a hand.
    pub tools: Vec<Tool>,
    /// Contact law; `None` when the scene has no tool.
    pub contact: Option<Contact>,
    /// Values written each step to `probes.csv`.
    pub probes: Vec<Probe>,
    /// Bounds on the outcome, evaluated at the end of a run.
    pub checks: Vec<Check>,
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
            scene.skin.cells = form.cells.unwrap_or(self.skin.cells);
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

/// The deformable body: a regular grid of bricks in bonded layers, bottom at z = 0, centred on x = y = 0.
#[derive(Clone, Debug)]
pub struct Skin {
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
    /// 1/s
    pub rayleigh_mass: f64,
    /// s
    pub rayleigh_stiffness: f64,
    /// Velocity of every node at the start, m/s.
    pub velocity: [f64; 3],
    /// Displacement of every node at the start, m.
    pub displacement: [f64; 3],
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
    /// kg/m³
    pub density: f64,
    /// Cutting energy per area, J/m².
    pub toughness: f64,
    /// sRGB
    pub color: [u8; 3],
}

/// The elastic law of the skin.
#[derive(Clone, Copy, Debug)]
pub enum Law {
    /// Bricks.
    Fem {
        /// Which brick.
        element: Element,
        /// Corotational, or linear ("small") when false.
        corotational: bool,
    },
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

/// Nodes held, or moved, along chosen axes.
#[derive(Clone, Debug)]
pub struct Boundary {
    /// Which nodes.
    pub region: Region,
    /// Which of x, y, z are held.
    pub axes: [bool; 3],
    /// Displacement of the held axes from the first step on, m.
    pub displacement: [f64; 3],
}

/// A dead pressure on a rectangle of the top.
#[derive(Clone, Copy, Debug)]
pub struct Load {
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

/// A rigid tool coupled to a hand.
#[derive(Clone, Debug)]
pub struct Tool {
    /// Name for outputs.
    pub name: String,
    /// OBJ text of the mesh, already loaded.
    pub mesh: ToolMesh,
    /// kg
    pub mass: f64,
    /// Principal inertia about the tool's origin in tool axes, kg·m².
    pub inertia: [f64; 3],
    /// Blade, for tools that cut.
    pub blade: Option<Blade>,
    /// Points of the tool (tool frame, m) that touch the skin and do not cut.
    pub points: Vec<[f64; 3]>,
    /// The whole surface, for tools that are a sphere or a capsule; such a tool has neither blade nor points.
    pub round: Option<Round>,
    /// Points and segments, for tools that touch with those alone; such a tool has neither blade nor points, and is not round.
    pub lines: Option<Lines>,
    /// Coupling to the hand.
    pub coupling: Coupling,
    /// The recorded hand, at least one sample, times rising.
    pub trajectory: Vec<Pose>,
}

/// A sphere, or a capsule: all places within `radius` of a line, tool frame.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// m
    pub radius: f64,
    /// Ends of the line, m; the same point twice for a sphere.
    pub ends: [[f64; 3]; 2],
}

/// Points and straight segments of a tool in its own frame; every vertex touches as a point.
#[derive(Clone, Debug)]
pub struct Lines {
    /// `[vertex]` m
    pub positions: Vec<[f64; 3]>,
    /// `[segment]` two different vertices
    pub segments: Vec<[u32; 2]>,
    /// How far the tool's surface stands off its points and segments, m; 0 for a wire without thickness.
    pub radius: f64,
}

/// Triangles of a tool in its own frame.
#[derive(Clone, Debug)]
pub struct ToolMesh {
    /// `[vertex]` m
    pub positions: Vec<[f64; 3]>,
    /// `[triangle]` vertex ids
    pub triangles: Vec<[u32; 3]>,
}

/// The cutting part of a tool: a thin plate with one sharp edge, tool frame.
#[derive(Clone, Debug)]
pub struct Blade {
    /// Edge polyline from the tip to the heel, at least two points, m.
    pub edge: Vec<[f64; 3]>,
    /// Unit normal of the blade plane; the edge faces `normal × (heel − tip)`.
    pub normal: [f64; 3],
    /// m
    pub thickness: f64,
    /// Length of edge that one contact row stands for, m.
    pub edge_spacing: f64,
    /// Spacing of the contact points on the flats, m.
    pub flat_spacing: f64,
    /// How far the flats reach behind the edge, m.
    pub depth: f64,
}

/// 6-DoF spring and damper between hand and tool.
#[derive(Clone, Copy, Debug)]
pub struct Coupling {
    /// N/m
    pub stiffness: f64,
    /// N·s/m
    pub damping: f64,
    /// N·m/rad
    pub angular_stiffness: f64,
    /// N·m·s/rad
    pub angular_damping: f64,
}

/// A sample of a recorded hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// s
    pub time: f64,
    /// m
    pub position: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub rotation: [f64; 4],
}

/// How contact forces are corrected for the skin's compliance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    /// Loose columns of A⁻¹Jᵀ, accurate correction, repeated until the contact residual is small.
    Exact,
    /// Only the 3×3 diagonal blocks of A.
    Uncoupled,
}

/// Which of the contacts of a round tool, or of a tool of points and lines, are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// What fits the tool: `Points` for a round one, `Cones` for one of points and lines.
    Own,
    /// All of the skin's surface points that a round tool touches; all pairs of features within reach for a tool of lines.
    Points,
    /// For round tools, the nearest place alone, which is what is left of a sphere's contacts behind SOFA's LocalMinDistance.
    One,
    /// For tools of lines, pairs at a local minimum of the distance, told by the normal cones of the features.
    Cones,
}

/// Contact law and solver.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Coulomb coefficient.
    pub friction: f64,
    /// Contacts are looked for within this distance, m.
    pub alarm: f64,
    /// Resting gap of points and flats, m.
    pub distance: f64,
    /// Which correction.
    pub correction: Correction,
    /// For round tools and tools of points and lines.
    pub filter: Filter,
    /// How far normal cones are widened: sine of the angle.
    pub angle_cone: f64,
    /// Most contacts at a time.
    pub max_contacts: u32,
    /// Relative residual at which the passes stop.
    pub tolerance: f64,
    /// Residual of the columns, relative.
    pub column_tolerance: f64,
}
