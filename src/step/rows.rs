//! The rows of a step's contacts and ties: what they move, how that gives, and which forces they are.
//!
//! Row `3k + n` is axis `n` of contact `k`. With the sign + for the first of its bodies and − for the second, `J` of a rigid body is
//! `(axis, arm × axis)`, of a deformable one the axis at the nodes of its spot by their weights, of a wall nothing. `W = Σ_bodies J C Jᵀ`
//! with each body's own compliance `C`; only rows couple bodies.

use crate::bodies::rigid::{Instrument, UnconstrainedMotion};
use crate::collide::Contact;
use crate::scene::BodyId;
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Signs of the two bodies of a contact.
const SIGN: [f64; 2] = [1.0, -1.0];

/// Two places of one body give against each other at least this share of what they give each for itself. What a flap's lips move together is
/// thousands of times what parts them, and the difference of columns that are loose and aged may be negative; passes take the true one.
const APART: f64 = 1e-3;

/// See the module.
pub(super) struct Rows<'a> {
    pub contacts: &'a [Contact],
    arms: Vec<[DVec3; 2]>,
}

impl<'a> Rows<'a> {
    pub fn new(contacts: &'a [Contact], tools: &[Instrument]) -> Self {
        let arm = |c: &Contact, who: BodyId| match who {
            BodyId::Rigid(number) => c.point - tools[number].position,
            _ => DVec3::ZERO,
        };
        Self { contacts, arms: contacts.iter().map(|c| c.on.map(|who| arm(c, who))).collect() }
    }

    pub fn count(&self) -> usize {
        3 * self.contacts.len()
    }

    pub fn axis(&self, row: usize) -> DVec3 {
        self.contacts[row / 3].axes[row % 3]
    }

    /// Sign and place of a rigid body in a row's contact.
    pub fn side(&self, row: usize, who: BodyId) -> Option<(f64, usize)> {
        let side = self.contacts[row / 3].on.iter().position(|on| *on == who)?;
        Some((SIGN[side], side))
    }

    /// Signed axis and lever of a rigid body in a row.
    pub fn of_rigid(&self, row: usize, number: usize) -> Option<(DVec3, DVec3)> {
        let (sign, side) = self.side(row, BodyId::Rigid(number))?;
        let axis = self.axis(row) * sign;
        Some((axis, self.arms[row / 3][side].cross(axis)))
    }

    /// Nodes of a deformable body that the rows act on, sorted.
    pub fn nodes(&self, body: usize) -> Vec<u32> {
        let mut nodes: Vec<u32> = self
            .contacts
            .iter()
            .flat_map(|c| c.on.iter().zip(&c.surface_points))
            .filter(|(on, _)| **on == BodyId::Deformable(body))
            .flat_map(|(_, spot)| spot.nodes())
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// `[contact]` how far the first body moves over the second when rigid bodies move by (shift, turn) and nodes by vectors, m.
    pub fn slips(
        &self,
        rigid: impl Fn(usize) -> (DVec3, DVec3),
        node: impl Fn(usize, u32) -> DVec3,
    ) -> impl Iterator<Item = DVec3> {
        self.contacts.iter().zip(&self.arms).map(move |(contact, arms)| {
            let moved = |side: usize| match contact.on[side] {
                BodyId::Rigid(number) => {
                    let (shift, turn) = rigid(number);
                    shift + turn.cross(arms[side])
                }
                BodyId::Deformable(body) => {
                    contact.surface_points[side].0.iter().map(|(id, weight)| node(body, *id) * *weight).sum()
                }
                BodyId::Plane(_) | BodyId::World => DVec3::ZERO,
            };
            moved(0) - moved(1)
        })
    }

    /// `[row]` violations at the step's end, by how far the bodies of each contact have moved over each other, m.
    pub fn violations(&self, slips: &[DVec3]) -> Vec<f64> {
        let of = |row: usize| self.contacts[row / 3].gap[row % 3] + self.axis(row).dot(slips[row / 3]);
        (0..self.count()).map(of).collect()
    }

    /// `Jᵀλ` on a deformable body, nodes each once, N.
    pub fn on_nodes(&self, body: usize, lambda: &[f64]) -> Vec<(u32, [f64; 3])> {
        let mut sum: BTreeMap<u32, DVec3> = BTreeMap::new();
        for (row, force) in lambda.iter().enumerate() {
            let contact = &self.contacts[row / 3];
            // both sides: the lips of a wound are of one body
            for side in (0..2).filter(|side| contact.on[*side] == BodyId::Deformable(body)) {
                for (node, weight) in &contact.surface_points[side].0 {
                    *sum.entry(*node).or_default() += self.axis(row) * (SIGN[side] * weight * force);
                }
            }
        }
        sum.into_iter().map(|(node, force)| (node, force.to_array())).collect()
    }

    /// `Jᵀλ` on a rigid body: force N, torque N·m.
    pub fn on_rigid(&self, number: usize, lambda: &[f64]) -> (DVec3, DVec3) {
        let mut sum = (DVec3::ZERO, DVec3::ZERO);
        for (row, force) in lambda.iter().enumerate() {
            if let Some((axis, lever)) = self.of_rigid(row, number) {
                sum.0 += axis * *force;
                sum.1 += lever * *force;
            }
        }
        sum
    }

    /// `W` by rows, from how nodes of a body give under each other (`between(body, a, b)`: b under a newton at a) and the rigid systems.
    pub fn compliance(&self, between: &dyn Fn(usize, u32, u32) -> DMat3, free: &[UnconstrainedMotion]) -> Vec<f64> {
        let count = self.count();
        let mut w = vec![0.0; count * count];
        for i in 0..self.contacts.len() {
            for j in 0..=i {
                let block = self.block(i, j, between, free);
                for (m, n) in (0..9).map(|n| (n / 3, n % 3)) {
                    w[(3 * i + m) * count + 3 * j + n] = block[m][n];
                    w[(3 * j + n) * count + 3 * i + m] = block[m][n];
                }
            }
        }
        w
    }

    /// What the rows of contact `j` do to those of `i`.
    fn block(
        &self,
        i: usize,
        j: usize,
        between: &dyn Fn(usize, u32, u32) -> DMat3,
        free: &[UnconstrainedMotion],
    ) -> [[f64; 3]; 3] {
        let (a, b) = (&self.contacts[i], &self.contacts[j]);
        let mut sum = [[0.0; 3]; 3];
        let mut whole = [0.0; 3]; // what the sides give each for itself
        for (s, t) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            if a.on[s] != b.on[t] {
                continue;
            }
            let sign = SIGN[s] * SIGN[t];
            match a.on[s] {
                BodyId::Rigid(number) => {
                    let f = &free[number];
                    for (m, n) in (0..9).map(|n| (n / 3, n % 3)) {
                        let (p, q) = (self.arms[i][s].cross(a.axes[m]), self.arms[j][t].cross(b.axes[n]));
                        let turned = p.dot(f.angular_compliance * q);
                        sum[m][n] += sign * (f.compliance * a.axes[m].dot(b.axes[n]) + turned);
                    }
                }
                BodyId::Deformable(body) => {
                    let mut give = DMat3::ZERO;
                    for (p, here) in &a.surface_points[s].0 {
                        for (q, there) in &b.surface_points[t].0 {
                            give += between(body, *p, *q) * (here * there);
                        }
                    }
                    for (m, n) in (0..9).map(|n| (n / 3, n % 3)) {
                        sum[m][n] += sign * b.axes[n].dot(give * a.axes[m]);
                        whole[m] += if m == n && s == t { b.axes[n].dot(give * a.axes[m]) } else { 0.0 };
                    }
                }
                BodyId::Plane(_) | BodyId::World => {}
            }
        }
        if i == j && a.on[0] == a.on[1] {
            (0..3).for_each(|m| sum[m][m] = sum[m][m].max(APART * whole[m]));
        }
        sum
    }

    /// A rigid body's own part of `W`.
    pub fn rigid_part(&self, i: usize, j: usize, number: usize, free: &UnconstrainedMotion) -> f64 {
        match (self.of_rigid(i, number), self.of_rigid(j, number)) {
            (Some((a, p)), Some((b, q))) => free.compliance * a.dot(b) + p.dot(free.angular_compliance * q),
            _ => 0.0,
        }
    }
}

/// Values along a contact's axes as a vector.
pub(super) fn in_world(contact: &Contact, along: &[f64]) -> DVec3 {
    contact.axes[0] * along[0] + contact.axes[1] * along[1] + contact.axes[2] * along[2]
}

/// `λᵀ W λ`, N·m.
pub(super) fn energy(w: &[f64], lambda: &[f64]) -> f64 {
    let rows = w.chunks_exact(lambda.len().max(1)).zip(lambda);
    rows.map(|(line, l)| l * line.iter().zip(lambda).map(|(w, m)| w * m).sum::<f64>()).sum::<f64>().max(0.0)
}
