//! Arrays of the elastic operator of a mesh of linear tetrahedra, and its passes on the CPU path ([`crate::kernels::tetrahedra`]).
//!
//! A cut gives tetrahedra other nodes or removes them ([`Arrays::change`]). An edge whose tetrahedra have parted is then two domains. Volumes,
//! domains and blocks are recomputed around the change alone; the lists of nodes and domains are rebuilt for the whole body where
//! tetrahedra have got other nodes. A removed tetrahedron stays in its arrays, with one node as all of its corners, without gradients, volume or
//! moduli, and in the lists until they are rebuilt: it takes part in every pass and adds nothing.

use crate::bodies::ElementPoint;
use crate::kernels::tetrahedra::{deviator, displacement_gradient, matrix, mean};
use crate::kernels::{
    Params, polar, tetrahedra_domains, tetrahedra_forces, tetrahedra_means, tetrahedra_plain, tetrahedra_pressures,
    tetrahedra_product, tetrahedra_rotations, tetrahedra_smoothed, tetrahedra_strains, tetrahedra_volumes,
};
use crate::math::{M3, Real, V3, V4, round};
use crate::mesh::PAIRS;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// The arrays, as the kernels read them.
pub use crate::kernels::tetrahedra::{Arrays, Changes, Patches};

/// Tetrahedron: corners in positive orientation, layer.
pub type Tetrahedron = ([u32; 4], usize);

/// Part of a height by which a point may lie outside a tetrahedron that contains it: twice that by which a scene's may lie outside a mesh.
const OUTSIDE: f64 = 2e-6;

/// Volume, m³, and modulus, Pa, of a domain that is not in use: without a modulus it has no stress.
const UNUSED: [f64; 2] = [1.0, 0.0];

/// True for the corners of a removed tetrahedron.
pub fn is_removed(corners: &[u32; 4]) -> bool {
    corners[0] == corners[1]
}

/// Rotations of the tetrahedra and of the domains, as quaternions; of a hyperelastic law its linearisation ([`crate::kernels::tetrahedra_laws`]).
#[derive(Clone)]
pub struct Rotations<R> {
    /// `[tetrahedron]`
    pub element: Vec<V4<R>>,
    /// `[domain]`
    pub domain: Vec<V4<R>>,
    /// `[tetrahedron × 3]` `∂J/∂F`; fourth numbers: volume m³, stiffness of the volume Pa, 0.
    pub cofactor: Vec<V4<R>>,
    /// `[domain]`
    pub frame: Vec<V4<R>>,
}

/// Purpose of a linearisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum For<R> {
    /// Steps with this factor of the stiffness, [`Params::stiffness_factor`].
    Steps(R),
    /// Damping, which is not stiffened.
    Damping,
}

/// Lists from (owner, entry) pairs in order: CSR offsets and entries.
fn lists(count: usize, pairs: &[(u32, u32)]) -> (Vec<u32>, Vec<u32>) {
    let mut first = vec![0; count + 1];
    for (owner, _) in pairs {
        first[*owner as usize + 1] += 1;
    }
    for n in 0..count {
        first[n + 1] += first[n];
    }
    let (mut next, mut out) = (first.clone(), vec![0; pairs.len()]);
    for (owner, entry) in pairs {
        let at = &mut next[*owner as usize];
        out[*at as usize] = *entry;
        *at += 1;
    }
    (first, out)
}

impl Arrays<f64> {
    /// Arrays of a mesh: `rest` `[node]` m, `moduli` `[layer]` bulk and shear modulus, Pa.
    pub fn new(rest: &[[f64; 3]], tetrahedra: &[Tetrahedron], moduli: &[[f64; 2]], smoothed: bool) -> Self {
        let mut out = Self { smoothed, ..Self::default() };
        for (corners, layer) in tetrahedra {
            let [x0, x1, x2, x3] = corners.map(|n| V3::of(rest[n as usize]));
            let edges = M3([x1 - x0, x2 - x0, x3 - x0]);
            let volume = edges.determinant() / 6.0;
            assert!(volume > 0.0, "tetrahedra are made in positive orientation");
            let [a, b, c] = edges.inverse().transpose().0;
            let [bulk, shear] = moduli[*layer];
            out.corners.push(*corners);
            out.gradients.extend([a.pad(volume), b.pad(bulk), c.pad(shear)]);
        }
        let corners = out.corners.as_flattened().iter().enumerate();
        let around: Vec<(u32, u32)> = corners.map(|(entry, node)| (*node, entry as u32)).collect();
        (out.first_of_node, out.of_node) = lists(rest.len(), &around);
        let volume_around = |i: usize| out.around(i).map(|(e, _)| out.volume(e)).sum::<f64>();
        out.per_volume = (0..rest.len()).map(|i| volume_around(i).recip()).collect();
        if smoothed {
            out.add_domains(tetrahedra, moduli);
        }
        let blocks: Vec<[V4<f64>; 2]> = (0..rest.len()).into_par_iter().map(|i| out.block(i)).collect();
        out.rest_block = blocks.into_flattened();
        out
    }

    /// Room for the nodes and domains that cuts add, which are not in use.
    pub fn reserve(&mut self, nodes: usize, domains: usize) {
        let count = self.per_volume.len() + nodes;
        self.first_of_node.resize(count + 1, self.of_node.len() as u32);
        self.per_volume.resize(count, 0.0);
        self.rest_block.resize(2 * count, [0.0; 4]);
        if self.smoothed {
            let count = self.shear.len() + domains;
            self.first_of_domain.resize(count + 1, self.of_domain.len() as u32);
            self.shear.resize(count, UNUSED);
        }
    }

    /// Gives tetrahedra other corners, or removes them (all corners the same), and others the volumes that are left of them, m³.
    pub fn change(&mut self, changes: &[(u32, [u32; 4])], volumes: &[(u32, f64)]) -> Changes {
        let mut touched: BTreeSet<u32> = BTreeSet::new(); // nodes
        for (e, volume) in volumes {
            let at = *e as usize;
            touched.extend(self.corners[at]);
            self.gradients[3 * at][3] = *volume;
        }
        for (e, corners) in changes {
            let at = *e as usize;
            touched.extend(self.corners[at].iter().chain(corners));
            self.corners[at] = *corners;
            if is_removed(corners) {
                self.gradients[3 * at..3 * at + 3].fill([0.0; 4]);
            }
        }
        let mut tetrahedra: BTreeSet<u32> =
            changes.iter().map(|(e, _)| *e).chain(volumes.iter().map(|(e, _)| *e)).collect();
        let domains = if self.smoothed { self.divide_domains(&mut tetrahedra) } else { vec![] };
        // removed tetrahedra may stay in the lists: they add zeros
        let lists = !changes.iter().all(|(_, corners)| is_removed(corners));
        if lists {
            self.set_lists();
        }
        for i in &touched {
            let volume: f64 = self.around(*i as usize).map(|(e, _)| self.volume(e)).sum();
            self.per_volume[*i as usize] = if volume > 0.0 { volume.recip() } else { 0.0 };
        }
        // a block depends on the nodes of the tetrahedra around its own
        let around = touched.iter().flat_map(|i| self.around(*i as usize)).flat_map(|(e, _)| self.corners[e]);
        let nodes: BTreeSet<u32> = around.chain(touched.iter().copied()).collect();
        Changes { tetrahedra: tetrahedra.into_iter().collect(), nodes: nodes.into_iter().collect(), domains, lists }
    }

    /// Finds the blocks of some nodes anew.
    pub fn set_blocks(&mut self, nodes: &[u32]) {
        let blocks: Vec<[V4<f64>; 2]> = nodes.par_iter().map(|i| self.block(*i as usize)).collect();
        for (i, block) in nodes.iter().zip(blocks) {
            self.rest_block[2 * *i as usize..2 * *i as usize + 2].copy_from_slice(&block);
        }
    }

    /// The operator by the corners of all tetrahedra, and the shares that are left of them; by those of the body as it is if there are none.
    pub fn by_corners(&self, corners: &[u32], shares: &[f64]) -> Cow<'_, Self> {
        let (corners, _) = corners.as_chunks();
        let other = (0u32..).zip(corners).zip(&self.corners).filter(|((_, now), own)| now != own);
        let changes: Vec<(u32, [u32; 4])> = other.map(|((e, now), _)| (e, *now)).collect();
        let thinned = shares.iter().enumerate().filter(|(_, share)| **share > 0.0 && **share < 1.0);
        let volumes: Vec<(u32, f64)> = thinned.map(|(e, share)| (e as u32, share * self.volume(e))).collect();
        if changes.is_empty() && volumes.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut out = self.clone();
        out.change(&changes, &volumes);
        Cow::Owned(out)
    }

    /// Puts the lists of the nodes and of the domains in order.
    fn set_lists(&mut self) {
        let present = || self.corners.iter().enumerate().filter(|(_, corners)| !is_removed(corners));
        let corner = |(e, corners): (usize, &[u32; 4])| {
            let of = *corners;
            (0..4).map(move |a| (of[a], (4 * e + a) as u32))
        };
        let around: Vec<(u32, u32)> = present().flat_map(corner).collect();
        let of_nodes = lists(self.per_volume.len(), &around);
        if self.smoothed {
            let edge = |(e, _): (usize, &[u32; 4])| (0..6).map(move |k| (6 * e + k, 4 * e as u32));
            let members: Vec<(u32, u32)> =
                present().flat_map(edge).map(|(at, entry)| (self.domains[at], entry)).collect();
            (self.first_of_domain, self.of_domain) = lists(self.shear.len(), &members);
        }
        (self.first_of_node, self.of_node) = of_nodes;
    }

    /// Divides the domains of tetrahedra with other corners by the edges that they are now; returns those with other members, and adds the
    /// tetrahedra that are of others.
    fn divide_domains(&mut self, changed: &mut BTreeSet<u32>) -> Vec<u32> {
        let mut out: BTreeSet<u32> =
            changed.iter().flat_map(|e| &self.domains[6 * *e as usize..6 * (*e as usize + 1)]).copied().collect();
        let in_use = self.first_of_domain.windows(2).rposition(|w| w[0] < w[1]).map_or(0, |k| k + 1);
        let mut next = in_use as u32;
        for domain in out.clone() {
            let modulus = self.shear[domain as usize][1];
            let members =
                self.first_of_domain[domain as usize] as usize..self.first_of_domain[domain as usize + 1] as usize;
            let mut numbers: Vec<([u32; 2], u32)> = vec![];
            self.shear[domain as usize] = UNUSED;
            for at in members {
                let e = (self.of_domain[at] / 4) as usize;
                if is_removed(&self.corners[e]) {
                    continue;
                }
                let own = (6 * e..6 * e + 6).find(|at| self.domains[*at] == domain);
                let own = own.unwrap_or_else(|| unreachable!("it is a member"));
                let [a, b] = PAIRS[own - 6 * e].map(|a| self.corners[e][a]);
                let key = [a.min(b), a.max(b)];
                let known = numbers.iter().find(|(of, _)| *of == key).map(|known| known.1);
                let number = known.unwrap_or_else(|| {
                    // the first edge keeps the number
                    let number = if numbers.is_empty() { domain } else { next };
                    next += u32::from(!numbers.is_empty());
                    numbers.push((key, number));
                    assert!((number as usize) < self.shear.len(), "a cut divides no more edges than it has room for");
                    self.shear[number as usize] = [0.0, modulus];
                    number
                });
                self.shear[number as usize][0] += self.volume(e);
                if std::mem::replace(&mut self.domains[own], number) != number {
                    changed.insert(e as u32);
                    out.insert(number);
                }
            }
        }
        out.into_iter().collect()
    }

    /// Domains: edges of one material each.
    fn add_domains(&mut self, tetrahedra: &[Tetrahedron], moduli: &[[f64; 2]]) {
        let (mut numbers, mut members) = (BTreeMap::new(), vec![]);
        for (e, (corners, layer)) in tetrahedra.iter().enumerate() {
            for [a, b] in PAIRS.map(|ends| ends.map(|a| corners[a])) {
                let next = numbers.len() as u32;
                let domain = *numbers.entry(([a.min(b), a.max(b)], *layer)).or_insert(next);
                if domain == next {
                    self.shear.push([0.0, moduli[*layer][1]]);
                }
                self.shear[domain as usize][0] += self.volume(e);
                members.push((domain, 4 * e as u32));
                self.domains.push(domain);
            }
        }
        (self.first_of_domain, self.of_domain) = lists(numbers.len(), &members);
    }

    /// Volume of a tetrahedron, m³.
    pub fn volume(&self, e: usize) -> f64 {
        self.gradients[3 * e][3]
    }

    /// Nodes and those of as many rings of tetrahedra around them, in ascending order.
    pub fn reached(&self, nodes: Vec<u32>, rings: usize) -> Vec<u32> {
        let mut all: BTreeSet<u32> = nodes.into_iter().collect();
        for _ in 0..rings {
            all = all.iter().flat_map(|i| self.around(*i as usize)).flat_map(|(e, _)| self.corners[e]).collect();
        }
        all.into_iter().collect()
    }

    /// Tetrahedra that contain a rest position, with the weights of their corners 1 to 3 there; `rest` `[node]` m.
    pub fn element_points(&self, rest: &[[f64; 3]], at: V3<f64>) -> Vec<ElementPoint> {
        let inside = |(e, corners): (usize, &[u32; 4])| {
            let from = at - V3::of(rest[corners[0] as usize]);
            let weights = matrix(&self.gradients, e).0.map(|gradient| gradient.dot(from));
            let least = weights.iter().fold(1.0 - weights.iter().sum::<f64>(), |least, weight| least.min(*weight));
            (least >= -OUTSIDE && !is_removed(corners)).then_some((e, weights))
        };
        self.corners.iter().enumerate().filter_map(inside).collect()
    }

    /// Gradient of the shape function of a corner, 1/m.
    fn gradient(&self, e: usize, corner: usize) -> V3<f64> {
        let g = matrix(&self.gradients, e).0;
        if corner == 0 { V3::zero() - g[0] - g[1] - g[2] } else { g[corner - 1] }
    }

    /// The node's own block of the Hessian at rest, by its six numbers.
    fn block(&self, i: usize) -> [V4<f64>; 2] {
        let sum = if self.smoothed { self.smoothed_block(i) } else { self.plain_block(i) };
        let [x, y, z] = sum.0;
        [[x.x, x.y, x.z, y.y], [y.z, z.z, 0.0, 0.0]]
    }

    fn plain_block(&self, i: usize) -> M3<f64> {
        let mut sum = M3::zero();
        for (e, a) in self.around(i) {
            let (g, [bulk, shear]) = (self.gradient(e, a), [1, 2].map(|n| self.gradients[3 * e + n][3]));
            sum = sum + (of_deviator(g) * shear + g.outer(g) * bulk) * self.volume(e);
        }
        sum
    }

    fn smoothed_block(&self, i: usize) -> M3<f64> {
        let mut sum = M3::zero();
        // deviator: b = ∂F̄_k/∂u_i
        let mut of_domain = BTreeMap::new();
        for (e, a) in self.around(i) {
            for domain in &self.domains[6 * e..6 * (e + 1)] {
                let share = self.volume(e) / self.shear[*domain as usize][0];
                *of_domain.entry(*domain).or_insert(V3::zero()) += self.gradient(e, a) * share;
            }
        }
        for (domain, b) in of_domain {
            let volume = self.shear[domain as usize][0];
            // of any that is there: they are of one material
            let members = self.first_of_domain[domain as usize]..self.first_of_domain[domain as usize + 1];
            let shear = members.map(|at| self.gradients[3 * (self.of_domain[at as usize] / 4) as usize + 2][3]);
            let shear = shear.fold(0.0, f64::max);
            sum = sum + of_deviator(b) * (volume * shear / 6.0);
        }
        // volume: t = ∂θ̄_e/∂u_i
        let mut at_nodes = BTreeMap::new();
        for (e, a) in self.around(i) {
            for node in self.corners[e] {
                let w = at_nodes.entry(node).or_insert(V3::zero());
                *w += self.gradient(e, a) * (self.volume(e) * self.per_volume[node as usize]);
            }
        }
        let reached: BTreeSet<usize> =
            at_nodes.keys().flat_map(|node| self.around(*node as usize).map(|(e, _)| e)).collect();
        for e in reached {
            let of_corner = |node: &u32| at_nodes.get(node).copied().unwrap_or(V3::zero());
            let t = self.corners[e].iter().map(of_corner).fold(V3::zero(), |s, w| s + w) * 0.25;
            sum = sum + t.outer(t) * (self.gradients[3 * e + 1][3] * self.volume(e));
        }
        sum
    }

    /// The same arrays in another precision.
    pub fn rounded<R: Real>(&self) -> Arrays<R> {
        Arrays {
            smoothed: self.smoothed,
            corners: self.corners.clone(),
            gradients: self.gradients.iter().map(round).collect(),
            first_of_node: self.first_of_node.clone(),
            of_node: self.of_node.clone(),
            per_volume: self.per_volume.iter().map(|v| R::of(*v)).collect(),
            first_of_domain: self.first_of_domain.clone(),
            of_domain: self.of_domain.clone(),
            shear: self.shear.iter().map(round).collect(),
            domains: self.domains.clone(),
            rest_block: self.rest_block.iter().map(round).collect(),
            laws: self.laws.iter().map(round).collect(),
            patches: Patches {
                corners: self.patches.corners.clone(),
                first: self.patches.first.clone(),
                members: self.patches.members.clone(),
                per_volume: self.patches.per_volume.iter().map(|v| R::of(*v)).collect(),
            },
        }
    }

    /// Elastic energy of displacements with the rotations of theirs, J.
    pub fn energy(&self, u: &[V4<f64>], corotational: bool) -> f64 {
        if self.is_hyperelastic() {
            return self.energy_of_law(u);
        }
        let (rotations, total) = (self.rotations(u, corotational), 1);
        let strain = self.strains(total, u, &rotations.element);
        let mut sum = 0.0;
        let mut nodal = vec![0.0; self.per_volume.len()];
        if self.smoothed {
            self.volumes(&strain, &mut nodal);
        }
        for (e, corners) in self.corners.iter().enumerate() {
            let [volume, bulk, shear] = [0, 1, 2].map(|n| self.gradients[3 * e + n][3]);
            let theta = if self.smoothed {
                0.25 * corners.iter().map(|n| nodal[*n as usize]).sum::<f64>()
            } else {
                let deviator = deviator(matrix(&strain, e), rotations.element[e], total);
                sum += volume * shear * deviator.dot(deviator);
                strain[3 * e][3]
            };
            sum += 0.5 * bulk * volume * theta * theta;
        }
        for (k, [volume, shear]) in self.shear.iter().enumerate() {
            let members = &self.of_domain[self.first_of_domain[k] as usize..self.first_of_domain[k + 1] as usize];
            let (gradient, _) = mean(&self.gradients, members, &strain, 1.0 / *volume);
            let deviator = deviator(gradient, rotations.domain[k], total);
            sum += volume * shear / 6.0 * deviator.dot(deviator);
        }
        sum
    }
}

/// Second derivative of `|dev sym(u ⊗ b)|² = ½ |u|² |b|² + ⅙ (u·b)²`.
fn of_deviator(b: V3<f64>) -> M3<f64> {
    M3::diagonal(V3::splat(b.dot(b))) + b.outer(b) * (1.0 / 3.0)
}

/// Patches of the tetrahedra, lists of their members (offsets and entries), and 1/volume, 1/m³.
type OfPatches<'a, R> = (&'a [[u32; 4]], &'a [u32], &'a [u32], &'a [R]);

impl<R: Real> Arrays<R> {
    /// Takes what a cut has changed in the same arrays in f64.
    pub fn take(&mut self, from: &Arrays<f64>, changes: &Changes) {
        for e in changes.tetrahedra.iter().map(|e| *e as usize) {
            self.corners[e] = from.corners[e];
            (3 * e..3 * e + 3).for_each(|at| self.gradients[at] = round(&from.gradients[at]));
            if self.smoothed {
                self.domains[6 * e..6 * e + 6].copy_from_slice(&from.domains[6 * e..6 * e + 6]);
            }
        }
        for i in changes.nodes.iter().map(|i| *i as usize) {
            self.per_volume[i] = R::of(from.per_volume[i]);
            (2 * i..2 * i + 2).for_each(|at| self.rest_block[at] = round(&from.rest_block[at]));
        }
        changes.domains.iter().for_each(|k| self.shear[*k as usize] = round(&from.shear[*k as usize]));
        if changes.lists {
            self.first_of_node.clone_from(&from.first_of_node);
            self.of_node.clone_from(&from.of_node);
            self.first_of_domain.clone_from(&from.first_of_domain);
            self.of_domain.clone_from(&from.of_domain);
        }
    }

    /// Tetrahedra around a node, with the node's corner.
    pub fn around(&self, node: usize) -> impl Iterator<Item = (usize, usize)> {
        let own = &self.of_node[self.first_of_node[node] as usize..self.first_of_node[node + 1] as usize];
        own.iter().map(|entry| ((entry / 4) as usize, (entry % 4) as usize))
    }

    /// `[tetrahedron]` displacement gradients.
    pub fn displacement_gradients(&self, u: &[V4<R>]) -> Vec<M3<R>> {
        let of = |(e, corners): (usize, &[u32; 4])| displacement_gradient(&self.gradients, e, *corners, u);
        self.corners.iter().enumerate().map(of).collect()
    }

    /// Rotations at displacements: polar factors, or none of small strains.
    pub fn rotations(&self, u: &[V4<R>], corotational: bool) -> Rotations<R> {
        if self.is_hyperelastic() {
            return self.linearised(u, For::Steps(R::one()));
        }
        let upright = polar::UPRIGHT.map(R::of);
        let (mut element, mut domain) = (vec![upright; self.corners.len()], vec![upright; self.shear.len()]);
        if corotational {
            tetrahedra_rotations::tetrahedra_rotations(&self.corners, &self.gradients, u, &mut element);
            self.means(u, &self.first_of_domain, &self.of_domain, &mut domain);
        }
        Rotations { element, domain, cofactor: vec![], frame: vec![] }
    }

    /// What volumes are averaged over: nodes, or patches of their own.
    pub(super) fn patches(&self) -> OfPatches<'_, R> {
        match self.patches.corners.is_empty() {
            true => (&self.corners, &self.first_of_node, &self.of_node, &self.per_volume),
            false => (&self.patches.corners, &self.patches.first, &self.patches.members, &self.patches.per_volume),
        }
    }

    /// Their number.
    pub(super) fn patch_count(&self) -> usize {
        self.patches().3.len()
    }

    /// Parts of `scratch`: strains of the tetrahedra, then their forces; stresses of the domains; volume strains and pressures of the patches.
    pub(super) fn divided<'a>(&self, scratch: &'a mut [R]) -> [&'a mut [R]; 4] {
        let (of_elements, rest) = scratch.split_at_mut(4 * self.gradients.len());
        let (stress, rest) = rest.split_at_mut(12 * self.shear.len());
        let (strain, rest) = rest.split_at_mut(self.patch_count());
        [of_elements, stress, strain, &mut rest[..self.patch_count()]]
    }

    /// `[node]` mean rotations around nodes, for their blocks.
    pub fn node_rotations(&self, u: &[V4<R>], corotational: bool) -> Vec<V4<R>> {
        let mut out = vec![polar::UPRIGHT.map(R::of); self.per_volume.len()];
        if corotational {
            self.means(u, &self.first_of_node, &self.of_node, &mut out);
        }
        out
    }

    /// Rotations of the mean deformation gradients of lists of tetrahedra.
    fn means(&self, u: &[V4<R>], first: &[u32], members: &[u32], out: &mut [V4<R>]) {
        // displacement gradients do not depend on the rotations
        let strain = self.strains(0, u, &vec![polar::UPRIGHT.map(R::of); self.corners.len()]);
        tetrahedra_means::tetrahedra_means(&self.gradients, first, members, &strain, out);
    }

    /// `[tetrahedron × 3]` displacement gradients and volume strains.
    fn strains(&self, total: u32, z: &[V4<R>], element: &[V4<R>]) -> Vec<V4<R>> {
        let params = Params { total, ..Params::default() };
        let mut out = vec![[R::zero(); 4]; self.gradients.len()];
        tetrahedra_strains::tetrahedra_strains(&params, &self.corners, &self.gradients, element, z, &mut out);
        out
    }

    /// Scratch memory of the passes, one array for each right-hand side.
    pub fn scratch(&self) -> Vec<R> {
        vec![R::zero(); self.scratch_len()]
    }

    /// Its length.
    pub fn scratch_len(&self) -> usize {
        4 * (self.gradients.len() + 3 * self.shear.len()) + 2 * self.patch_count()
    }

    /// `[patch]` volume strains.
    pub(super) fn volumes(&self, strain: &[V4<R>], out: &mut [R]) {
        let (_, first, members, per_volume) = self.patches();
        tetrahedra_volumes::tetrahedra_volumes(&self.gradients, first, members, per_volume, strain, out);
    }

    /// `[tetrahedron × 3]` forces at corners 1 to 3, N, in `scratch`; `total` is that of [`Params`].
    pub(super) fn corner_forces<'a>(
        &self,
        total: u32,
        z: &[V4<R>],
        rotations: &Rotations<R>,
        scratch: &'a mut [R],
    ) -> &'a mut [V4<R>] {
        // hyperelastic ones have their own
        if self.is_hyperelastic() {
            return match total {
                0 => self.changes_of_law(z, rotations, scratch),
                _ => self.forces_of_law(z, For::Damping, &mut self.unlinearised(), scratch),
            };
        }
        let params = Params { total, ..Params::default() };
        let Self { corners, gradients, first_of_node, of_node, first_of_domain, of_domain, per_volume, .. } = self;
        let element = &rotations.element;
        let [of_elements, stress, strain, pressure] = self.divided(scratch);
        let of_elements = of_elements.as_chunks_mut().0;
        // plain: each element by itself
        if !self.smoothed {
            tetrahedra_plain::tetrahedra_plain(&params, corners, gradients, element, z, of_elements);
            return of_elements;
        }
        // smoothed: strains of elements, then the shear of the domains and the pressure of the nodes
        let stress = stress.as_chunks_mut().0;
        tetrahedra_strains::tetrahedra_strains(&params, corners, gradients, element, z, of_elements);
        tetrahedra_domains::tetrahedra_domains(
            &params,
            gradients,
            first_of_domain,
            of_domain,
            &self.shear,
            &rotations.domain,
            of_elements,
            stress,
        );
        self.volumes(of_elements, strain);
        tetrahedra_pressures::tetrahedra_pressures(
            corners,
            gradients,
            first_of_node,
            of_node,
            per_volume,
            strain,
            pressure,
        );
        // both as forces at the corners
        let domains = &self.domains;
        tetrahedra_smoothed::tetrahedra_smoothed(corners, gradients, element, domains, stress, pressure, of_elements);
        of_elements
    }

    /// Internal forces at displacements with the rotations given, `[node]` N; `scratch` as of [`Self::scratch`].
    pub fn forces(&self, u: &[V4<R>], rotations: &Rotations<R>, f: &mut [V4<R>], scratch: &mut [R]) {
        let forces = self.corner_forces(1, u, rotations, scratch);
        tetrahedra_forces::tetrahedra_forces(&self.first_of_node, &self.of_node, forces, f);
    }

    /// `K z`, `[node]` N.
    pub fn product(&self, z: &[V4<R>], rotations: &Rotations<R>, w: &mut [V4<R>], scratch: &mut [R]) {
        let forces = self.corner_forces(0, z, rotations, scratch);
        tetrahedra_forces::tetrahedra_forces(&self.first_of_node, &self.of_node, forces, w);
    }

    /// `w = A z`, `[node]` N; `dofs` has the DOF masks and masses, `scratch` as of [`Self::scratch`]. Returns `z·w`.
    pub fn system_product(
        &self,
        params: &Params<R>,
        dofs: &[V4<R>],
        z: &[V4<R>],
        rotations: &Rotations<R>,
        w: &mut [V4<R>],
        scratch: &mut [R],
    ) -> R {
        let forces = self.corner_forces(0, z, rotations, scratch);
        tetrahedra_product::tetrahedra_product(params, &self.first_of_node, &self.of_node, forces, dofs, z, w)
    }
}
