//! Rigid bodies: a tool held by a hand through a 6-DoF virtual coupling (spring and damper), or a free body.
//!
//! The step is implicit and solved exactly: with the motion Δ = (Δx, θ) over the step, `A Δ = m v/h + m g + K (x_hand − x) + B v_hand`,
//! `A = m/h² + B/h + K` (the same for rotation, with the inertia in world axes). The body's part of the Delassus operator therefore
//! includes mass, damping and coupling, and at rest λ equals the coupling force. The hand carries a tool's weight. A free body has K = B =
//! 0 and falls. Angular momentum is the quantity carried from step to step, so a body without contact conserves it to rounding in any
//! rotation.
//! Units: m, rad, kg, N, N·m. Source: Colgate, Stanley, Brown 1995 (virtual coupling).

use super::Energy;
use crate::math::elementary::atan2;
use crate::scene::{Blade, Coupling, Lines, Pose, Round, Tool};
use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Role of a contact sample on a tool's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// Blunt point: pushes the skin aside.
    Point,
    /// Piece of the cutting edge.
    Edge {
        /// Length of the piece, m
        length: f64,
        /// Number of the piece, counted from the tip.
        piece: usize,
    },
    /// Centre of a sphere along the axis of a round tool.
    Axis,
    /// Corner of a box.
    Corner,
    /// Point of one flat side of the blade; the sample lies in the blade's middle plane.
    Flat(Flat),
}

/// Point of a blade's flat side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flat {
    /// Side: ±1 along the blade's normal.
    pub side: f64,
    /// Distance behind the edge, m.
    pub behind: f64,
    /// Length along the edge that the point represents, m.
    pub length: f64,
}

/// Point of a tool that can touch the skin.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Tool frame, m.
    pub position: DVec3,
    /// Role in contact.
    pub role: Role,
}

/// Cutting edge in the tool frame.
#[derive(Clone, Debug)]
pub struct Edge {
    /// End points of the pieces, starting at the tip, m.
    pub points: Vec<DVec3>,
    /// Unit vector along the edge, from tip to heel.
    pub along: DVec3,
    /// Unit vector that the edge faces, `normal × along`.
    pub forward: DVec3,
    /// Unit normal of the blade's plane.
    pub normal: DVec3,
    /// m
    pub half_thickness: f64,
}

/// Maximum number of pieces of a capsule's axis. The centres of a longer needle are further apart; the skin's surface points cover the
/// gaps.
const MOST_PIECES: f64 = 64.0;

/// Tool and its motion.
#[derive(Clone, Debug)]
pub struct Instrument {
    /// m
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// m/s
    pub velocity: DVec3,
    /// rad/s
    pub angular_velocity: DVec3,
    /// Contact samples.
    pub samples: Vec<Sample>,
    /// Cutting edge, for tools with a blade.
    pub edge: Option<Edge>,
    /// Shape of a sphere or capsule.
    pub round: Option<Round>,
    /// Half edges of a box, m.
    pub cuboid: Option<DVec3>,
    /// Radius of the contact points, m: a force on one is spread over a disc, with the pressure of a flat punch; 0 for points without
    /// extent.
    pub tip_radius: f64,
    /// True if no hand holds the body.
    pub free: bool,
    /// Acceleration by gravity, m/s²; zero where the hand carries the weight.
    pub gravity: DVec3,
    /// Shape of a tool made of points and lines; its vertices are the samples.
    pub lines: Option<Arc<Lines>>,
    /// kg
    pub mass: f64,
    /// Principal moments in tool axes, kg·m².
    pub inertia: DVec3,
    /// Virtual coupling to the hand.
    pub coupling: Coupling,
    /// True if the blade cuts; otherwise its edge is blunt and makes contact like points.
    pub sharp: bool,
    trajectory: Arc<[Pose]>, // shared, because a step keeps a copy of the tool's previous state
    live: Option<Live>,
}

/// Live hand pose: previous and current pose, and the begin and end of the step to interpolate over, s.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Live {
    from: (DVec3, DQuat),
    to: (DVec3, DQuat),
    begin: f64,
    end: f64,
}

/// Motion of a tool over one step without contact, with its compliance.
#[derive(Clone, Copy, Debug)]
pub struct UnconstrainedMotion {
    /// Translation, m
    pub translation: DVec3,
    /// Rotation vector, rad
    pub rotation: DVec3,
    /// Compliance of the translation, m/N.
    pub compliance: f64,
    /// Compliance of the rotation, rad/(N·m).
    pub angular_compliance: DMat3,
}

impl UnconstrainedMotion {
    /// Additional translation, m, and rotation vector, rad, under a force, N, and a torque, N·m.
    pub fn displacement_under(&self, (force, torque): (DVec3, DVec3)) -> (DVec3, DVec3) {
        (force * self.compliance, self.angular_compliance * torque)
    }
}

/// Rotation vector of a unit quaternion, rad, of length at most π.
pub fn rotation_vector(q: DQuat) -> DVec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let s = q.xyz().length();
    if s < 1e-12 { q.xyz() * 2.0 } else { q.xyz() * (2.0 * atan2(s, q.w) / s) }
}

/// Recorded hand pose at a time: linear between samples, constant before the first and after the last; `None` without samples.
pub fn along(poses: &[Pose], time: f64) -> Option<(DVec3, DQuat)> {
    let next = poses.partition_point(|p| p.time <= time);
    let pose = |p: &Pose| (DVec3::from_array(p.position), DQuat::from_array(p.rotation));
    let Some(b) = poses.get(next) else {
        return poses.last().map(pose);
    };
    let Some(a) = next.checked_sub(1).map(|k| &poses[k]) else {
        return Some(pose(b));
    };
    let s = (time - a.time) / (b.time - a.time);
    let ((pa, qa), (pb, qb)) = (pose(a), pose(b));
    Some((pa.lerp(pb, s), qa.slerp(qb, s)))
}

/// State of a rigid body.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Motion {
    position: DVec3,
    rotation: DQuat,
    velocity: DVec3,
    angular_velocity: DVec3,
    sharp: bool,
    live: Option<Live>,
}

impl Instrument {
    /// Current state.
    pub fn motion(&self) -> Motion {
        let Self { position, rotation, velocity, angular_velocity, sharp, live, .. } = *self;
        Motion { position, rotation, velocity, angular_velocity, sharp, live }
    }

    /// Sets the state.
    pub fn set_motion(&mut self, motion: Motion) {
        let Motion { position, rotation, velocity, angular_velocity, sharp, live } = motion;
        (self.position, self.rotation, self.velocity, self.angular_velocity) =
            (position, rotation, velocity, angular_velocity);
        (self.sharp, self.live) = (sharp, live);
    }

    /// Body at the start of its trajectory.
    pub fn new(tool: &Tool, gravity: [f64; 3]) -> Self {
        let first = tool.trajectory.first().copied().unwrap_or(Pose {
            time: 0.0,
            position: [0.0; 3],
            rotation: [0.0, 0.0, 0.0, 1.0],
        });
        let point = |p: &[f64; 3]| Sample { position: DVec3::from_array(*p), role: Role::Point };
        let mut samples: Vec<Sample> = tool.points.iter().map(point).collect();
        let edge = tool.blade.as_ref().map(|blade| Edge::new(blade, &mut samples));
        samples.extend(tool.round.iter().flat_map(axis_samples));
        samples.extend(tool.lines.iter().flat_map(|lines| lines.positions.iter().map(point)));
        let cuboid = tool.cuboid.map(DVec3::from_array);
        samples.extend(cuboid.iter().flat_map(|half| corners(*half)));
        let start = tool.free.unwrap_or_default();
        Self {
            position: DVec3::from_array(first.position),
            rotation: DQuat::from_array(first.rotation),
            velocity: DVec3::from_array(start.velocity),
            angular_velocity: DVec3::from_array(start.angular_velocity),
            samples,
            edge,
            round: tool.round,
            cuboid,
            tip_radius: tool.tip_radius,
            free: tool.free.is_some(),
            gravity: if tool.free.is_some() { DVec3::from_array(gravity) } else { DVec3::ZERO },
            lines: tool.lines.clone().map(Arc::new),
            mass: tool.mass,
            inertia: DVec3::from_array(tool.inertia),
            coupling: tool.coupling,
            sharp: true,
            trajectory: tool.trajectory.as_slice().into(),
            live: None,
        }
    }

    /// Switches to a live hand that moves from its last pose to `to` during the step from `begin` to `end`, s. The end of the last step is
    /// the start of this one, so no motion is lost.
    pub fn follow(&mut self, to: (DVec3, DQuat), begin: f64, end: f64) {
        let from = self.live.map_or_else(|| self.hand(begin), |live| live.to);
        self.live = Some(Live { from, to, begin, end });
    }

    /// Hand pose at a time: the live one, or the recorded one (linear between samples, constant before the first and after the last).
    pub fn hand(&self, time: f64) -> (DVec3, DQuat) {
        if let Some(Live { from, to, begin, end }) = self.live {
            let s = ((time - begin) / (end - begin)).clamp(0.0, 1.0);
            return (from.0.lerp(to.0, s), from.1.slerp(to.1, s));
        }
        along(&self.trajectory, time).unwrap_or((self.position, self.rotation))
    }

    /// Motion without contact over a step that ends at `time`.
    pub fn unconstrained_motion(&self, time: f64, step: f64) -> UnconstrainedMotion {
        // hand pose at both ends of the step
        let (from, turned) = self.hand(time - step);
        let (to, target) = self.hand(time);
        let c = self.coupling;
        // translation: (m/h² + b/h + k) Δx = m (v/h + g) + k (hand − x) + b/h Δhand
        let stiffness = self.mass / (step * step) + c.damping / step + c.stiffness;
        let push = (self.velocity / step + self.gravity) * self.mass
            + (to - self.position) * c.stiffness
            + (to - from) * (c.damping / step);
        // rotation: the same with the inertia in world axes and rotation vectors
        let inertia = self.world_inertia();
        let angular =
            inertia * (1.0 / (step * step)) + DMat3::IDENTITY * (c.angular_damping / step + c.angular_stiffness);
        let twist = inertia * self.angular_velocity * (1.0 / step)
            + rotation_vector(target * self.rotation.conjugate()) * c.angular_stiffness
            + rotation_vector(target * turned.conjugate()) * (c.angular_damping / step);
        let angular_compliance = angular.inverse();
        UnconstrainedMotion {
            translation: push / stiffness,
            rotation: angular_compliance * twist,
            compliance: 1.0 / stiffness,
            angular_compliance,
        }
    }

    /// Applies the motion of a step.
    pub fn advance(&mut self, translation: DVec3, rotation: DVec3, step: f64) {
        let momentum = self.world_inertia() * rotation / step;
        self.position += translation;
        self.rotation = (DQuat::from_scaled_axis(rotation) * self.rotation).normalize();
        self.velocity = translation / step;
        self.angular_velocity = self.world_inertia().inverse() * momentum;
    }

    /// Inertia in world axes, kg·m².
    pub fn world_inertia(&self) -> DMat3 {
        let axes = DMat3::from_quat(self.rotation);
        axes * DMat3::from_diagonal(self.inertia) * axes.transpose()
    }

    /// Kinetic energy, and the potential of its weight, which is 0 at the origin, J.
    pub fn energy(&self) -> Energy {
        let kinetic = self.velocity.length_squared() * self.mass
            + self.angular_velocity.dot(self.world_inertia() * self.angular_velocity);
        let potential = -self.mass * self.gravity.dot(self.position);
        Energy { kinetic: 0.5 * kinetic, potential, weight: potential.abs(), ..Energy::default() }
    }

    /// Largest distance of the surface from the body's origin, m.
    pub fn span(&self) -> f64 {
        let samples = self.samples.iter().map(|s| s.position.length());
        let lines = self.lines.as_ref().map_or(0.0, |lines| lines.radius);
        samples.fold(0.0, f64::max) + self.round.map_or(lines, |round| round.radius)
    }

    /// World position of a point of the tool frame, m.
    pub fn at(&self, point: DVec3) -> DVec3 {
        self.position + self.rotation * point
    }
}

/// Centres along the axis of a round tool, both ends included: at most a radius apart, unless [`MOST_PIECES`] limits them. A sphere has
/// one.
fn axis_samples(round: &Round) -> Vec<Sample> {
    let [a, b] = round.ends.map(DVec3::from_array);
    let pieces = (a.distance(b) / round.radius).ceil().min(MOST_PIECES) as u32;
    let position = |k: u32| a.lerp(b, f64::from(k) / f64::from(pieces.max(1)));
    (0..=pieces).map(|k| Sample { position: position(k), role: Role::Axis }).collect()
}

fn corners(half: DVec3) -> impl Iterator<Item = Sample> {
    let sign = |bit: u32| if bit == 1 { 1.0 } else { -1.0 };
    let position = move |k: u32| half * DVec3::new(sign(k & 1), sign(k >> 1 & 1), sign(k >> 2));
    (0..8).map(move |k| Sample { position: position(k), role: Role::Corner })
}

impl Edge {
    /// Divides the edge into pieces of the given spacing and adds contact samples on edge and flats.
    fn new(blade: &Blade, samples: &mut Vec<Sample>) -> Self {
        // end points of the pieces
        let corners: Vec<DVec3> = blade.edge.iter().map(|p| DVec3::from_array(*p)).collect();
        let mut points = vec![corners[0]];
        for pair in corners.windows(2) {
            let pieces = (pair[0].distance(pair[1]) / blade.edge_spacing).round().max(1.0) as usize;
            points.extend((1..=pieces).map(|k| pair[0].lerp(pair[1], k as f64 / pieces as f64)));
        }
        // frame of the blade
        let [along, normal, forward] = blade.frame();
        // one sample in the middle of each piece
        for (piece, pair) in points.windows(2).enumerate() {
            let role = Role::Edge { length: pair[0].distance(pair[1]), piece };
            samples.push(Sample { position: pair[0].lerp(pair[1], 0.5), role });
        }
        // flats: rows of samples behind the edge, offset by half a spacing
        let length: f64 = points.windows(2).map(|p| p[0].distance(p[1])).sum();
        let (columns, rows) = (
            (length / blade.flat_spacing).floor() as usize,
            (blade.depth / blade.flat_spacing).floor().max(1.0) as usize,
        );
        for row in 0..rows {
            for column in 0..columns {
                let behind = (row as f64 + 0.5) * blade.depth / rows as f64;
                let s = (column as f64 + 0.5) * blade.flat_spacing;
                let position = points[0] + along * s - forward * behind;
                for side in [1.0, -1.0] {
                    samples
                        .push(Sample { position, role: Role::Flat(Flat { side, behind, length: blade.flat_spacing }) });
                }
            }
        }
        Self { points, along, forward, normal, half_thickness: 0.5 * blade.thickness }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instrument() -> Instrument {
        let pose = |time, x| Pose { time, position: [x, 0.0, 0.0], rotation: [0.0, 0.0, 0.0, 1.0] };
        Instrument::new(
            &Tool {
                name: "t".into(),
                mesh: crate::scene::ToolMesh { positions: vec![], triangles: vec![] },
                mass: 0.02,
                inertia: [1e-6, 2e-6, 3e-6],
                blade: Some(Blade {
                    edge: vec![[0.0; 3], [0.004, 0.0, 0.004]],
                    normal: [0.0, 1.0, 0.0],
                    thickness: 4e-4,
                    edge_spacing: 4e-4,
                    flat_spacing: 1e-3,
                    depth: 2e-3,
                }),
                points: vec![],
                tip_radius: 0.0,
                round: None,
                lines: None,
                cuboid: None,
                carve: None,
                free: None,
                device: None,
                coupling: Coupling { stiffness: 1000.0, damping: 5.0, angular_stiffness: 1.0, angular_damping: 0.01 },
                trajectory: vec![pose(0.0, 0.0), pose(0.01, 0.001)],
            },
            [0.0, 0.0, -9.81],
        )
    }

    #[test]
    fn a_tool_left_alone_comes_to_rest_at_the_hand() {
        let mut tool = instrument();
        for k in 1..400 {
            let free = tool.unconstrained_motion(f64::from(k) * 0.005, 0.005);
            tool.advance(free.translation, free.rotation, 0.005);
        }
        assert!((tool.position.x - 0.001).abs() < 1e-9, "{}", tool.position);
    }

    #[test]
    fn a_live_hand_goes_on_from_where_it_was() {
        let mut tool = instrument();
        let rotation = DQuat::from_rotation_z(0.2);
        tool.follow((DVec3::X, rotation), 0.0, 0.01);
        assert_eq!(tool.hand(0.0).0, DVec3::ZERO, "from the start of the recorded one");
        assert!((tool.hand(0.005).0 - DVec3::X * 0.5).length() < 1e-12);
        tool.follow((DVec3::Y, rotation), 0.01, 0.02);
        assert_eq!(tool.hand(0.01).0, DVec3::X, "no motion is lost");
        assert_eq!(tool.hand(0.02).0, DVec3::Y);
        assert!(tool.hand(0.015).1.dot(rotation).abs() > 1.0 - 1e-12);
    }

    #[test]
    fn a_constant_push_is_balanced_by_the_coupling_alone() {
        let mut tool = instrument();
        let push = DVec3::new(0.0, 0.0, 0.4);
        for k in 1..800 {
            let free = tool.unconstrained_motion(f64::from(k) * 0.005, 0.005);
            tool.advance(free.translation + push * free.compliance, free.rotation, 0.005);
        }
        assert!((tool.position.z - 0.4e-3).abs() < 1e-9, "{}", tool.position);
    }

    #[test]
    fn the_edge_faces_forward_and_down() {
        let edge = instrument().edge.unwrap();
        let s = 0.5f64.sqrt();
        assert!((edge.forward - DVec3::new(s, 0.0, -s)).length() < 1e-12);
        assert_eq!(edge.points.len(), 15);
    }
}
