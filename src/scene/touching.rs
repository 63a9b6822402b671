//! Rigid bodies, their devices, walls, attachments and the contact law.

use super::Region;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A rigid tool coupled to a hand.
#[derive(Clone, Debug)]
pub struct Tool {
    /// Name for outputs.
    pub name: String,
    /// Triangle mesh, loaded.
    pub mesh: ToolMesh,
    /// kg
    pub mass: f64,
    /// Principal inertia about the tool's origin in tool axes, kg·m².
    pub inertia: [f64; 3],
    /// Blade, for tools that cut.
    pub blade: Option<Blade>,
    /// Blunt contact points of the tool (tool frame, m).
    pub points: Vec<[f64; 3]>,
    /// Radius of the disc over which a force on such a point is spread, m; 0 for points without extent, whose force depends on the cell
    /// size.
    pub tip_radius: f64,
    /// Surface of a sphere or capsule; such a tool has neither blade nor points.
    pub round: Option<Round>,
    /// Points and segments of a tool that touches with these only; such a tool has neither blade nor points nor a round surface.
    pub lines: Option<Lines>,
    /// Removal of the tissue that the tool touches, for tools that carve.
    pub carve: Option<Carve>,
    /// Half edges of a box around the body's origin, m.
    pub cuboid: Option<[f64; 3]>,
    /// Virtual coupling to the hand; zero for a free body.
    pub coupling: Coupling,
    /// Recorded hand path, at least one sample, in ascending order of times; for a free body only its initial pose.
    pub trajectory: Vec<Pose>,
    /// Haptic device that moves the hand; without one the recorded path does, and its force is computed without limits or guards.
    pub device: Option<Device>,
    /// Initial motion of a free body, which is subject to gravity. `None` for a tool, whose weight the hand carries.
    pub free: Option<Motion>,
}

/// Removal of the tissue that a tool touches, at the end of each step.
#[derive(Clone, Copy, Debug)]
pub struct Carve {
    /// Reach from the tool's surface within which a contact removes tissue, m.
    pub distance: f64,
    /// Normal force of a contact per area of its face below which it removes nothing, Pa.
    pub pressure: f64,
    /// Whole cells behind the faces that it touches, as by SOFA's CarvingManager, in place of the space that it reaches.
    pub whole_cells: bool,
}

impl Default for Carve {
    fn default() -> Self {
        Self { distance: 1e-4, pressure: 0.0, whole_cells: false }
    }
}

/// Motion of a rigid body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    /// m/s
    pub velocity: [f64; 3],
    /// rad/s
    pub angular_velocity: [f64; 3],
}

/// A fixed half space.
#[derive(Clone, Debug)]
pub struct Plane {
    /// Name for messages and probes.
    pub name: String,
    /// Point of its surface, m.
    pub through: [f64; 3],
    /// Unit normal, out of the wall.
    pub normal: [f64; 3],
}

/// Kind and index of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum BodyId {
    /// In [`Scene::tools`](super::Scene::tools).
    Rigid(usize),
    /// In [`Scene::skins`](super::Scene::skins).
    Deformable(usize),
    /// In [`Scene::planes`](super::Scene::planes).
    Plane(usize),
    /// The world, as the other end of an attachment.
    World,
}

/// Nodes of a deformable body attached by bilateral constraints to another body, at their rest positions.
#[derive(Clone, Debug)]
pub struct Attachment {
    /// Index of the deformable body whose nodes are attached.
    pub body: usize,
    /// Nodes.
    pub region: Region,
    /// Body that they are attached to.
    pub to: BodyId,
    /// Path along which they slide; `None` for all directions fixed.
    pub slide: Option<Slide>,
}

/// A straight path, as of a thread in a hole or a runner on a rail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slide {
    /// Unit vector.
    pub direction: [f64; 3],
    /// μ: friction along it, as a share of the constraint force across it.
    pub friction: f64,
    /// Friction of the path itself, over all nodes of the region, N.
    pub resistance: f64,
}

/// A sphere or capsule: all points within `radius` of a line segment, tool frame.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// m
    pub radius: f64,
    /// End points of the segment, m; equal for a sphere.
    pub ends: [[f64; 3]; 2],
}

/// Points and straight segments of a tool in its own frame; every vertex is a contact point.
#[derive(Clone, Debug)]
pub struct Lines {
    /// `[vertex]` m
    pub positions: Vec<[f64; 3]>,
    /// `[segment]` two distinct vertices
    pub segments: Vec<[u32; 2]>,
    /// Distance of the tool's surface from its points and segments, m; 0 for a thin wire.
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

/// Blade of a tool: a thin plate with one sharp edge, tool frame.
#[derive(Clone, Debug)]
pub struct Blade {
    /// Edge polyline from the tip to the heel, at least two points, m.
    pub edge: Vec<[f64; 3]>,
    /// Unit normal of the blade's plane; the edge faces `normal × (heel − tip)`.
    pub normal: [f64; 3],
    /// m
    pub thickness: f64,
    /// Length of edge per contact sample, m.
    pub edge_spacing: f64,
    /// Spacing of the contact points on the flats, m.
    pub flat_spacing: f64,
    /// Depth of the flats behind the edge, m.
    pub depth: f64,
}

impl Blade {
    /// Unit vectors in the tool frame: along the edge from tip to heel, normal of the plane, and the way that the edge faces.
    pub fn frame(&self) -> [DVec3; 3] {
        let end = |point: Option<&[f64; 3]>| point.map_or(DVec3::ZERO, |p| DVec3::from_array(*p));
        let along = (end(self.edge.last()) - end(self.edge.first())).normalize();
        let normal = DVec3::from_array(self.normal);
        let normal = (normal - along * normal.dot(along)).normalize();
        [along, normal, normal.cross(along)]
    }
}

/// Virtual coupling: 6-DoF spring and damper between hand and tool.
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

/// Sample of a hand path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// s
    pub time: f64,
    /// m
    pub position: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub rotation: [f64; 4],
}

/// Contact correction for the skin's compliance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    /// Columns of A⁻¹Jᵀ to a loose tolerance and an accurate correction, iterated until the contact residual is small.
    Exact,
    /// Uses only the 3×3 diagonal blocks of A.
    Uncoupled,
    /// Columns of the body in its rest shape, from one factorisation, independent of its later motion; not available with a blade.
    Precomputed,
}

/// Computation of contact forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loop {
    /// Constraints: unconstrained motion, contact law on the violations, correction.
    Constraints,
    /// Penalty springs on overlaps at the start of the step, without friction; N/m.
    Penalty(f64),
}

/// Contact filter of a round tool, or of a tool of points and lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// Default of the tool: `Points` for a round one, `Cones` for one of points and lines.
    Own,
    /// All surface points of the skin that a round tool touches; all pairs of features in range for a tool of lines.
    Points,
    /// For round tools, the nearest point only, which is what SOFA's LocalMinDistance leaves of a sphere's contacts.
    One,
    /// For tools of lines, pairs at a local minimum of the distance, selected by the normal cones of the features.
    Cones,
}

/// Contact law and solver.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Coulomb coefficient.
    pub friction: f64,
    /// Detection distance of contacts, m.
    pub alarm: f64,
    /// Gap at rest of points and flats, m.
    pub distance: f64,
    /// Computation of forces.
    pub forces: Loop,
    /// Contact correction.
    pub correction: Correction,
    /// Contact filter of round tools and tools of points and lines.
    pub filter: Filter,
    /// Widening of the normal cones: sine of the angle.
    pub angle_cone: f64,
    /// Maximum number of contacts at a time, and of lip contacts of each wound.
    pub max_contacts: u32,
    /// Contact between the lips of wounds; otherwise they pass through each other.
    pub lips: bool,
    /// Relative residual at which the passes stop.
    pub tolerance: f64,
    /// Relative residual of the compliance columns.
    pub column_tolerance: f64,
    /// Maximum passes of the exact correction; two are usual, redundant contacts take more. A step that needs more counts as
    /// `contact_passes_exhausted` if the best pass leaves a perceptible residual.
    pub max_passes: u32,
}

/// The haptic loop.
#[derive(Clone, Copy, Debug)]
pub struct Haptic {
    /// Ticks per second.
    pub rate: f64,
}

/// Rendering method of the force on the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Rendering {
    /// Virtual coupling between hand and tool, in series with the skin.
    #[default]
    Coupling,
    /// Direct: as if the hand held the tool rigidly, so that it feels the skin's compliance only.
    Direct,
}

/// Role of a button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Nothing.
    None,
    /// The blade cuts while it is pressed, and is blunt otherwise.
    Active,
    /// While it is pressed the hand moves and the tool stays.
    Clutch,
    /// While it is pressed tool and force are frozen.
    Freeze,
}

/// Kind of a tool's device.
#[derive(Clone, Debug, PartialEq)]
pub enum DeviceKind {
    /// The tool's recorded path, which ignores forces.
    Replay,
    /// A simulated hand that follows the tool's path and yields to the force.
    Hand {
        /// kg
        mass: f64,
        /// Stiffness of the spring to the path, N/m.
        stiffness: f64,
        /// N·s/m
        damping: f64,
        /// Resolution of the encoders, m; 0 for exact ones.
        encoder: f64,
    },
    /// At rest at the start of the tool's path.
    Null,
    /// A device behind the Haply Inverse Service.
    Haply {
        /// Address of the service.
        url: String,
        /// Name of the device; empty for the first one.
        device: String,
        /// Name of the grip; empty for the first one.
        grip: String,
    },
}

/// Device that holds a tool.
#[derive(Clone, Debug)]
pub struct Device {
    /// Kind of device.
    pub kind: DeviceKind,
    /// Rendering method.
    pub rendering: Rendering,
    /// Newtons on the hand per newton on the tool.
    pub force_scale: f64,
    /// Force limit, N; infinite for the device's own.
    pub max_force: f64,
    /// Torque limit, N·m; infinite for the device's own.
    pub max_torque: f64,
    /// Largest distance of the end effector from the device's origin, m of the device; readings beyond it are invalid. Infinite for a tool
    /// without a device, whose trajectory may lead anywhere.
    pub workspace: f64,
    /// Position of the device's origin in the scene, m.
    pub position: [f64; 3],
    /// Rotation of the device's frame, unit quaternion.
    pub rotation: [f64; 4],
    /// Metres of the scene per metre of the device.
    pub scale: f64,
    /// Origin of the tool in the frame of the device's end effector, m.
    pub tool: [f64; 3],
    /// Rotation of the tool in that frame, unit quaternion.
    pub tool_rotation: [f64; 4],
    /// `[button]` role.
    pub buttons: Vec<Role>,
    /// Use the passivity controller.
    pub passivity: bool,
}

impl Default for Device {
    fn default() -> Self {
        Self {
            kind: DeviceKind::Replay,
            rendering: Rendering::Coupling,
            force_scale: 1.0,
            max_force: f64::INFINITY,
            max_torque: f64::INFINITY,
            workspace: f64::INFINITY,
            position: [0.0; 3],
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: 1.0,
            tool: [0.0; 3],
            tool_rotation: [0.0, 0.0, 0.0, 1.0],
            buttons: vec![],
            passivity: true,
        }
    }
}
