//! The rows of a step's contacts and constraints: the Jacobian `J`, the compliance `W = J C Jᵀ` (Delassus operator), the forces `Jᵀλ`.
//!
//! Each law has one to three rows, along the first axes of its contact; the rows of all contacts follow each other. With the sign + for the
//! first body and − for the second, `J` is `(axis, arm × axis)` for a rigid body, the axis at the nodes of the material point times their
//! weights for a deformable one, and zero for a wall. `W = Σ_bodies J C Jᵀ` with each body's own compliance `C`; only rows couple bodies.
//! Source: Saupin, Duriez, Cotin 2008 (contact by the compliance of the bodies, and a correction).

use crate::bodies::rigid::{Instrument, UnconstrainedMotion};
use crate::collide::Contact;
use crate::math::inner_product;
use crate::scene::BodyId;
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Signs of the two bodies of a contact.
const SIGN: [f64; 2] = [1.0, -1.0];

/// See the module.
pub(super) struct Rows<'a> {
    pub contacts: &'a [Contact],
    /// `[contact]` moment arms of its two sides, m; zero for non-rigid bodies.
    arms: Vec<[DVec3; 2]>,
    /// `[row]` contact and axis.
    of: Vec<(usize, usize)>,
}

impl<'a> Rows<'a> {
    pub fn new(contacts: &'a [Contact], tools: &[Instrument]) -> Self {
        let arm = |c: &Contact, who: BodyId| match who {
            BodyId::Rigid(number) => c.point - tools[number].position,
            _ => DVec3::ZERO,
        };
        let rows = |(number, contact): (usize, &Contact)| (0..contact.law.rows()).map(move |axis| (number, axis));
        Self {
            contacts,
            arms: contacts.iter().map(|c| c.on.map(|who| arm(c, who))).collect(),
            of: contacts.iter().enumerate().flat_map(rows).collect(),
        }
    }

    pub fn count(&self) -> usize {
        self.of.len()
    }

    /// Contact and axis number of a row.
    pub fn contact(&self, row: usize) -> (&'a Contact, usize) {
        let (contact, axis) = self.of[row];
        (&self.contacts[contact], axis)
    }

    pub fn axis(&self, row: usize) -> DVec3 {
        let (contact, axis) = self.contact(row);
        contact.axes[axis]
    }

    /// `[contact]` values along its axes; 0 along those without a row.
    pub fn by_contact(&self, values: &[f64]) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; self.contacts.len()];
        self.of.iter().zip(values).for_each(|((contact, axis), value)| out[*contact][*axis] = *value);
        out
    }

    /// Sign and side of a body in a row's contact; `None` for other bodies.
    pub fn side(&self, row: usize, who: BodyId) -> Option<(f64, usize)> {
        let side = self.contact(row).0.on.iter().position(|on| *on == who)?;
        Some((SIGN[side], side))
    }

    /// Signed axis and angular part (moment arm × axis) of a rigid body in a row.
    pub fn of_rigid(&self, row: usize, number: usize) -> Option<(DVec3, DVec3)> {
        let (sign, side) = self.side(row, BodyId::Rigid(number))?;
        let axis = self.axis(row) * sign;
        Some((axis, self.arms[self.of[row].0][side].cross(axis)))
    }

    /// Moment arm of a rigid body in a row, at the start of the step, m; zero for other bodies.
    pub fn arm_of(&self, row: usize, number: usize) -> DVec3 {
        self.side(row, BodyId::Rigid(number)).map_or(DVec3::ZERO, |(_, side)| self.arms[self.of[row].0][side])
    }

    /// Sorted nodes of a deformable body that rows act on.
    pub fn nodes(&self, body: usize) -> Vec<u32> {
        let mut nodes: Vec<u32> = self
            .contacts
            .iter()
            .flat_map(|c| c.on.iter().zip(&c.points))
            .filter(|(on, _)| **on == BodyId::Deformable(body))
            .flat_map(|(_, point)| point.nodes())
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// `[contact]` displacement of the first body relative to the second, for given motions of rigid bodies (translation, rotation) and
    /// nodes, m.
    pub fn slips(
        &self,
        rigid: impl Fn(usize) -> (DVec3, DVec3),
        node: impl Fn(usize, u32) -> DVec3,
    ) -> impl Iterator<Item = DVec3> {
        self.contacts.iter().zip(&self.arms).map(move |(contact, arms)| {
            let moved = |side: usize| match contact.on[side] {
                BodyId::Rigid(number) => {
                    let (translation, rotation) = rigid(number);
                    translation + rotation.cross(arms[side])
                }
                BodyId::Deformable(body) => {
                    contact.points[side].0.iter().map(|(id, weight)| node(body, *id) * *weight).sum()
                }
                BodyId::Plane(_) | BodyId::World => DVec3::ZERO,
            };
            moved(0) - moved(1)
        })
    }

    /// `[row]` violations at the end of the step for the given slips, m.
    pub fn violations(&self, slips: &[DVec3]) -> Vec<f64> {
        let along = |(contact, axis): &(usize, usize)| {
            self.contacts[*contact].gap[*axis] + self.contacts[*contact].axes[*axis].dot(slips[*contact])
        };
        self.of.iter().map(along).collect()
    }

    /// `Jᵀλ` on a deformable body, each node once, N.
    pub fn on_nodes(&self, body: usize, lambda: &[f64]) -> Vec<(u32, [f64; 3])> {
        let mut sum: BTreeMap<u32, DVec3> = BTreeMap::new();
        for (row, force) in lambda.iter().enumerate() {
            let (contact, _) = self.contact(row);
            // both sides: lips of a wound belong to one body
            for side in (0..2).filter(|side| contact.on[*side] == BodyId::Deformable(body)) {
                for (node, weight) in &contact.points[side].0 {
                    *sum.entry(*node).or_default() += self.axis(row) * (SIGN[side] * weight * force);
                }
            }
        }
        sum.into_iter().map(|(node, force)| (node, force.to_array())).collect()
    }

    /// Norm of the forces on a deformable body's nodes, N.
    pub fn norm_on_nodes(&self, body: usize, lambda: &[f64]) -> f64 {
        let forces = self.on_nodes(body, lambda);
        forces.iter().map(|(_, force)| DVec3::from_array(*force).length_squared()).sum::<f64>().sqrt()
    }

    /// `Jᵀλ` on a rigid body: force N, torque N·m.
    pub fn on_rigid(&self, number: usize, lambda: &[f64]) -> (DVec3, DVec3) {
        let mut sum = (DVec3::ZERO, DVec3::ZERO);
        for (row, force) in lambda.iter().enumerate() {
            if let Some((axis, angular)) = self.of_rigid(row, number) {
                sum.0 += axis * *force;
                sum.1 += angular * *force;
            }
        }
        sum
    }

    /// `W`, row-major, m/N, from the compliance blocks of deformable bodies (`between(body, i, j)`: of node `nodes[body][j]` under one newton
    /// at node `nodes[body][i]`) and rigid ones. `nodes` has those of the rows.
    pub fn compliance(
        &self,
        nodes: &[Vec<u32>],
        between: &dyn Fn(usize, usize, usize) -> DMat3,
        free: &[UnconstrainedMotion],
    ) -> Vec<f64> {
        let count = self.count();
        // `[contact][side]` numbers of the nodes, and their weights
        let numbered = |contact: &Contact| {
            [0, 1].map(|side| match contact.on[side] {
                BodyId::Deformable(body) => {
                    let number =
                        |node: &u32| nodes[body].binary_search(node).unwrap_or_else(|_| unreachable!("rows act on it"));
                    contact.points[side].0.iter().map(|(node, weight)| (number(node), *weight)).collect()
                }
                _ => vec![],
            })
        };
        let points: Vec<[Vec<(usize, f64)>; 2]> = self.contacts.iter().map(numbered).collect();
        let mut w = vec![0.0; count * count];
        let first: Vec<usize> = (0..count).filter(|row| self.of[*row].1 == 0).collect();
        for i in 0..self.contacts.len() {
            for j in 0..=i {
                let block = self.block((i, j), &points, between, free);
                for m in 0..self.contacts[i].law.rows() {
                    for n in 0..self.contacts[j].law.rows() {
                        w[(first[i] + m) * count + first[j] + n] = block[m][n];
                        w[(first[j] + n) * count + first[i] + m] = block[m][n];
                    }
                }
            }
        }
        w
    }

    /// Compliance block of contacts `i` and `j`, `[axis of i][axis of j]`: displacement along the axes of the one under forces along those of the
    /// other, m/N; the compliance is symmetric.
    fn block(
        &self,
        (i, j): (usize, usize),
        points: &[[Vec<(usize, f64)>; 2]],
        between: &dyn Fn(usize, usize, usize) -> DMat3,
        free: &[UnconstrainedMotion],
    ) -> [[f64; 3]; 3] {
        let (a, b) = (&self.contacts[i], &self.contacts[j]);
        let mut sum = [[0.0; 3]; 3];
        // all pairs of sides on the same body
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
                        let angular = p.dot(f.angular_compliance * q);
                        sum[m][n] += sign * (f.compliance * a.axes[m].dot(b.axes[n]) + angular);
                    }
                }
                BodyId::Deformable(body) => {
                    let mut compliance = DMat3::ZERO;
                    for (p, here) in &points[i][s] {
                        for (q, there) in &points[j][t] {
                            compliance += between(body, *p, *q) * (here * there);
                        }
                    }
                    for (m, n) in (0..9).map(|n| (n / 3, n % 3)) {
                        sum[m][n] += sign * b.axes[n].dot(compliance * a.axes[m]);
                    }
                }
                BodyId::Plane(_) | BodyId::World => {}
            }
        }
        sum
    }

    /// Part of one rigid body in an entry of `W`, m/N.
    pub fn rigid_part(&self, i: usize, j: usize, number: usize, free: &UnconstrainedMotion) -> f64 {
        match (self.of_rigid(i, number), self.of_rigid(j, number)) {
            (Some((a, p)), Some((b, q))) => free.compliance * a.dot(b) + p.dot(free.angular_compliance * q),
            _ => 0.0,
        }
    }
}

/// `λᵀ W λ`, N·m; 0 where rounding would make it negative.
pub(super) fn energy(w: &[f64], lambda: &[f64]) -> f64 {
    let rows = w.chunks_exact(lambda.len().max(1)).zip(lambda);
    rows.map(|(line, l)| l * inner_product(line, lambda)).sum::<f64>().max(0.0)
}
