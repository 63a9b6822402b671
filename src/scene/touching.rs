//! What touches: rigid bodies, walls, ties, and the law of contact.

use super::{Device, Region};
use serde::{Deserialize, Serialize};

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
    /// Radius of a disc that a force on one of the points is spread over, m; 0 for points without extent, whose force falls with the cells.
    pub tip_radius: f64,
    /// The whole surface, for tools that are a sphere or a capsule; such a tool has neither blade nor points.
    pub round: Option<Round>,
    /// Points and segments, for tools that touch with those alone; such a tool has neither blade nor points, and is not round.
    pub lines: Option<Lines>,
    /// Half edges of a body that is a box around its origin, m.
    pub cuboid: Option<[f64; 3]>,
    /// Coupling to the hand; none of it for a body that no hand holds.
    pub coupling: Coupling,
    /// The recorded hand, at least one sample, times rising; the start alone of a body that no hand holds.
    pub trajectory: Vec<Pose>,
    /// What moves the hand; without one the recorded hand does, and what it would feel is found without limits or guards.
    pub device: Option<Device>,
    /// How a body that no hand holds starts; it falls. None for a tool: the hand carries its weight.
    pub free: Option<Motion>,
}

/// Motion of a rigid body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    /// m/s
    pub velocity: [f64; 3],
    /// rad/s
    pub spin: [f64; 3],
}

/// A half space that nothing enters.
#[derive(Clone, Debug)]
pub struct Plane {
    /// Name for messages and probes.
    pub name: String,
    /// A point of its surface, m.
    pub through: [f64; 3],
    /// Unit, out of the wall.
    pub normal: [f64; 3],
}

/// A body, by its kind and number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum BodyId {
    /// In [`Scene::tools`](super::Scene::tools).
    Rigid(usize),
    /// In [`Scene::skins`](super::Scene::skins).
    Deformable(usize),
    /// In [`Scene::planes`](super::Scene::planes).
    Plane(usize),
    /// The world, as the other end of a tie.
    World,
}

/// Nodes of a deformable body that are tied, both ways, to what is there at rest.
#[derive(Clone, Debug)]
pub struct Attachment {
    /// Number of the deformable body whose nodes are tied.
    pub body: usize,
    /// Which of them.
    pub region: Region,
    /// What they are tied to.
    pub to: BodyId,
    /// The path along which they slide; none for all held.
    pub slide: Option<Slide>,
}

/// A straight path, as of a thread in a hole or a runner on a rail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slide {
    /// Unit vector.
    pub direction: [f64; 3],
    /// μ: friction along it, as a share of what is held across it.
    pub friction: f64,
    /// Friction of the path itself, over all nodes of the region, N.
    pub resistance: f64,
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
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
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
    /// Columns of the body at rest, from one factor of its matrix, whatever has moved since; refused after a cut.
    Precomputed,
}

/// How contacts get their forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loop {
    /// Free motion, laws on the violations, correction.
    Constraints,
    /// A spring pushes where things overlap at the step's start, without friction; N/m.
    Penalty(f64),
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
    /// How forces are found.
    pub forces: Loop,
    /// Which correction.
    pub correction: Correction,
    /// For round tools and tools of points and lines.
    pub filter: Filter,
    /// How far normal cones are widened: sine of the angle.
    pub angle_cone: f64,
    /// Most contacts at a time, and most of the lips of each body's wound.
    pub max_contacts: u32,
    /// The lips of a wound rest on each other; otherwise they pass through. Flaps that a blade drags along fold over, and the solve of their
    /// lips may fail: for wounds of a few plain cuts.
    pub lips: bool,
    /// Relative residual at which the passes stop.
    pub tolerance: f64,
    /// Residual of the columns, relative.
    pub column_tolerance: f64,
    /// Passes of the exact correction at most; two are usual, redundant contacts take more. A step that needs more counts
    /// `contact_passes_exhausted`, if what the best pass leaves can be felt.
    pub max_passes: u32,
}
