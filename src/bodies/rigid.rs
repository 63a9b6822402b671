//! A rigid body: a tool held by a hand through a 6-DoF spring and damper, or one that nothing holds.
//!
//! Its step is implicit and exact (6×6): with Δ = (Δx, θ) the motion over the step,
//! `A Δ = m v/h + m g + K (x_hand − x) + B v_hand`, `A = m/h² + B/h + K` (and the same for rotation, with the inertia in world axes).
//! So the body's own part of a contact's compliance comes from its whole system, mass, damping and coupling, and λ equals the coupling
//! force at rest. The hand carries a tool's weight; what no hand holds has K = B = 0 and falls. Angular momentum is what is carried from
//! step to step, so a body that nothing touches keeps it to rounding however it tumbles.
//! Units: m, rad, kg, N, N·m. Source: Colgate, Stanley, Brown 1995 (virtual coupling).

use crate::math::elementary::atan2;
use crate::scene::{Blade, Coupling, Lines, Pose, Round, Tool};
use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What a sample of the tool's surface does to the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// Blunt: pushes the skin out of its way.
    Point,
    /// A piece of the cutting edge of this length, m; the piece's number along the edge.
    Edge {
        /// m
        length: f64,
        /// From the tip on.
        piece: usize,
    },
    /// Centre of a sphere along the axis of a round tool.
    Axis,
    /// Corner of a box.
    Corner,
    /// A place of one side of the blade; the sample lies in the blade's middle plane.
    Flat(Flat),
}

/// A place of a blade's side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flat {
    /// ±1 along the blade's normal.
    pub side: f64,
    /// How far it is behind the edge, m.
    pub behind: f64,
    /// Length along the edge that it stands for, m.
    pub length: f64,
}

/// A point of the tool that can touch the skin.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Tool frame, m.
    pub position: DVec3,
    /// What it does.
    pub role: Role,
}

/// Cutting edge in the tool frame.
#[derive(Clone, Debug)]
pub struct Edge {
    /// Ends of the pieces from the tip on, m.
    pub points: Vec<DVec3>,
    /// Unit: along the edge from tip to heel.
    pub along: DVec3,
    /// Unit: where the edge faces, `normal × along`.
    pub forward: DVec3,
    /// Unit: normal of the blade's plane.
    pub normal: DVec3,
    /// m
    pub half_thickness: f64,
}

/// Pieces of a capsule's axis at most: a longer needle has its centres further apart, and the skin's surface points between them.
const MOST_PIECES: f64 = 64.0;

/// A tool and its motion.
#[derive(Clone, Debug)]
pub struct Instrument {
    /// m
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// m/s
    pub velocity: DVec3,
    /// rad/s
    pub spin: DVec3,
    /// Contact samples.
    pub samples: Vec<Sample>,
    /// For tools that cut.
    pub edge: Option<Edge>,
    /// For spheres and capsules.
    pub round: Option<Round>,
    /// Half edges of a box, m.
    pub cuboid: Option<DVec3>,
    /// Radius of its contact points: a force on one is spread over a disc as under a flat punch, m; 0 of points without extent.
    pub tip_radius: f64,
    /// No hand holds it.
    pub free: bool,
    /// What pulls at its mass, m/s²: gravity, or nothing where the hand carries the weight.
    pub gravity: DVec3,
    /// For tools of points and lines; its vertices are the samples.
    pub lines: Option<Arc<Lines>>,
    /// kg
    pub mass: f64,
    /// Principal, tool axes, kg·m².
    pub inertia: DVec3,
    /// To the hand.
    pub coupling: Coupling,
    /// The blade cuts; otherwise its edge is blunt, and touches as points do.
    pub sharp: bool,
    trajectory: Arc<[Pose]>, // shared: a step keeps a copy of the tool as it was
    live: Option<Live>,
}

/// A hand that is there: where it was and where it is, with the times of the step that takes it from one to the other, s.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Live {
    from: (DVec3, DQuat),
    to: (DVec3, DQuat),
    begin: f64,
    end: f64,
}

/// The tool's system over one step.
#[derive(Clone, Copy, Debug)]
pub struct UnconstrainedMotion {
    /// m
    pub shift: DVec3,
    /// rad
    pub turn: DVec3,
    /// Inverse of the translation's system, m/N.
    pub compliance: f64,
    /// Inverse of the rotation's system, rad/(N·m).
    pub angular_compliance: DMat3,
}

impl UnconstrainedMotion {
    /// How far a force, N, and a torque, N·m, move it beyond that: shift, m, and turn, rad.
    pub fn displacement_under(&self, (force, torque): (DVec3, DVec3)) -> (DVec3, DVec3) {
        (force * self.compliance, self.angular_compliance * torque)
    }
}

/// Rotation vector of a unit quaternion, rad, at most π long.
pub fn rotation_vector(q: DQuat) -> DVec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let s = q.xyz().length();
    if s < 1e-12 { q.xyz() * 2.0 } else { q.xyz() * (2.0 * atan2(s, q.w) / s) }
}

/// The recorded hand at a time: linear between samples, resting before the first and after the last; none without samples.
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

/// What moves of a rigid body.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Motion {
    position: DVec3,
    rotation: DQuat,
    velocity: DVec3,
    spin: DVec3,
    sharp: bool,
    live: Option<Live>,
}

impl Instrument {
    /// What moves of it, now.
    pub fn motion(&self) -> Motion {
        let Self { position, rotation, velocity, spin, sharp, live, .. } = *self;
        Motion { position, rotation, velocity, spin, sharp, live }
    }

    /// Takes over what moves.
    pub fn set_motion(&mut self, motion: Motion) {
        let Motion { position, rotation, velocity, spin, sharp, live } = motion;
        (self.position, self.rotation, self.velocity, self.spin) = (position, rotation, velocity, spin);
        (self.sharp, self.live) = (sharp, live);
    }

    /// The body at the start of its trajectory.
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
            spin: DVec3::from_array(start.spin),
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

    /// From now on the hand is a live one: it goes from where it was to `to` during the step from `begin` to `end`, s. What was the end
    /// of the last step is the start of this one, so that no motion is lost.
    pub fn follow(&mut self, to: (DVec3, DQuat), begin: f64, end: f64) {
        let from = self.live.map_or_else(|| self.hand(begin), |live| live.to);
        self.live = Some(Live { from, to, begin, end });
    }

    /// The hand at a time: the live one, or the recorded one, linear between samples, resting before the first and after the last.
    pub fn hand(&self, time: f64) -> (DVec3, DQuat) {
        if let Some(Live { from, to, begin, end }) = self.live {
            let s = ((time - begin) / (end - begin)).clamp(0.0, 1.0);
            return (from.0.lerp(to.0, s), from.1.slerp(to.1, s));
        }
        along(&self.trajectory, time).unwrap_or((self.position, self.rotation))
    }

    /// Motion over a step that ends at `time`, without contact.
    pub fn unconstrained_motion(&self, time: f64, step: f64) -> UnconstrainedMotion {
        let (from, turned) = self.hand(time - step);
        let (to, target) = self.hand(time);
        let c = self.coupling;
        let stiffness = self.mass / (step * step) + c.damping / step + c.stiffness;
        let push = (self.velocity / step + self.gravity) * self.mass
            + (to - self.position) * c.stiffness
            + (to - from) * (c.damping / step);
        let inertia = self.world_inertia();
        let angular =
            inertia * (1.0 / (step * step)) + DMat3::IDENTITY * (c.angular_damping / step + c.angular_stiffness);
        let twist = inertia * self.spin * (1.0 / step)
            + rotation_vector(target * self.rotation.conjugate()) * c.angular_stiffness
            + rotation_vector(target * turned.conjugate()) * (c.angular_damping / step);
        let angular_compliance = angular.inverse();
        UnconstrainedMotion {
            shift: push / stiffness,
            turn: angular_compliance * twist,
            compliance: 1.0 / stiffness,
            angular_compliance,
        }
    }

    /// Moves by a step's motion.
    pub fn advance(&mut self, shift: DVec3, turn: DVec3, step: f64) {
        let momentum = self.world_inertia() * turn / step;
        self.position += shift;
        self.rotation = (DQuat::from_scaled_axis(turn) * self.rotation).normalize();
        self.velocity = shift / step;
        self.spin = self.world_inertia().inverse() * momentum;
    }

    /// Inertia in world axes, kg·m².
    pub fn world_inertia(&self) -> DMat3 {
        let axes = DMat3::from_quat(self.rotation);
        axes * DMat3::from_diagonal(self.inertia) * axes.transpose()
    }

    /// Largest distance of a sample from the origin of the body, its radius included, m.
    pub fn span(&self) -> f64 {
        let samples = self.samples.iter().map(|s| s.position.length());
        let lines = self.lines.as_ref().map_or(0.0, |lines| lines.radius);
        samples.fold(0.0, f64::max) + self.round.map_or(lines, |round| round.radius)
    }

    /// A point of the tool frame in the world.
    pub fn at(&self, point: DVec3) -> DVec3 {
        self.position + self.rotation * point
    }
}

/// Centres along the axis of a round tool, at most a radius apart, both ends included; a sphere has one.
fn axis_samples(round: &Round) -> Vec<Sample> {
    let [a, b] = round.ends.map(DVec3::from_array);
    let pieces = (a.distance(b) / round.radius).ceil().min(MOST_PIECES) as u32;
    let place = |k: u32| a.lerp(b, f64::from(k) / f64::from(pieces.max(1)));
    (0..=pieces).map(|k| Sample { position: place(k), role: Role::Axis }).collect()
}

fn corners(half: DVec3) -> impl Iterator<Item = Sample> {
    let sign = |bit: u32| if bit == 1 { 1.0 } else { -1.0 };
    let place = move |k: u32| half * DVec3::new(sign(k & 1), sign(k >> 1 & 1), sign(k >> 2));
    (0..8).map(move |k| Sample { position: place(k), role: Role::Corner })
}

impl Edge {
    /// Cuts the edge into pieces of the wanted length and spreads contact samples over edge and flats.
    fn new(blade: &Blade, samples: &mut Vec<Sample>) -> Self {
        let corners: Vec<DVec3> = blade.edge.iter().map(|p| DVec3::from_array(*p)).collect();
        let mut points = vec![corners[0]];
        for pair in corners.windows(2) {
            let pieces = (pair[0].distance(pair[1]) / blade.edge_spacing).round().max(1.0) as usize;
            points.extend((1..=pieces).map(|k| pair[0].lerp(pair[1], k as f64 / pieces as f64)));
        }
        let along = (corners[corners.len() - 1] - corners[0]).normalize();
        let normal = DVec3::from_array(blade.normal);
        let normal = (normal - along * normal.dot(along)).normalize();
        let forward = normal.cross(along);
        for (piece, pair) in points.windows(2).enumerate() {
            let role = Role::Edge { length: pair[0].distance(pair[1]), piece };
            samples.push(Sample { position: pair[0].lerp(pair[1], 0.5), role });
        }
        // flats: rows behind the edge, half a spacing in
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
            tool.advance(free.shift, free.turn, 0.005);
        }
        assert!((tool.position.x - 0.001).abs() < 1e-9, "{}", tool.position);
    }

    #[test]
    fn a_live_hand_goes_on_from_where_it_was() {
        let mut tool = instrument();
        let turn = DQuat::from_rotation_z(0.2);
        tool.follow((DVec3::X, turn), 0.0, 0.01);
        assert_eq!(tool.hand(0.0).0, DVec3::ZERO, "from the start of the recorded one");
        assert!((tool.hand(0.005).0 - DVec3::X * 0.5).length() < 1e-12);
        tool.follow((DVec3::Y, turn), 0.01, 0.02);
        assert_eq!(tool.hand(0.01).0, DVec3::X, "no motion is lost");
        assert_eq!(tool.hand(0.02).0, DVec3::Y);
        assert!(tool.hand(0.015).1.dot(turn).abs() > 1.0 - 1e-12);
    }

    #[test]
    fn a_constant_push_is_balanced_by_the_coupling_alone() {
        let mut tool = instrument();
        let push = DVec3::new(0.0, 0.0, 0.4);
        for k in 1..800 {
            let free = tool.unconstrained_motion(f64::from(k) * 0.005, 0.005);
            tool.advance(free.shift + push * free.compliance, free.turn, 0.005);
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
