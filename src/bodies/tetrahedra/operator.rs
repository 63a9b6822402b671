//! Elastic operator of a mesh of linear tetrahedra, in passes over flat arrays with one writer per entry and a fixed order of sums.
//!
//! Energy: `Σ_k V_k μ_k |dev ε̄_k|² + ½ Σ_e κ_e V_e θ̄_e²`. Smoothed elements: a domain `k` is an edge in one material with
//! `V_k = Σ V_e/6`, `F̄_k = Σ V_e F_e / Σ V_e` over the tetrahedra around it, `ε̄_k = sym(R_kᵀ F̄_k) − I`; the volume strain
//! `θ_e = tr(R_eᵀ F_e) − 3` is averaged at nodes over all materials, `θ_a = Σ V_e θ_e / Σ V_e`, and `θ̄_e` is the mean of the element's four
//! nodes. Plain elements: a domain is one tetrahedron, and `θ̄_e = θ_e`. `R` are the polar factors; their derivative adds nothing to
//! the forces on the deviator, and is omitted from the tangent as in [`crate::kernels::forces`].
//! Source: Nguyen-Thoi, Liu, Vu-Do, Nguyen-Xuan 2009 (edge-smoothed deviator, node-averaged volume); differs: volume averaged across
//! materials, and corotational. Bonet, Burton 1998 (average nodal pressure).
//! Units: u m, gradients 1/m, stress Pa, f N.

use crate::bodies::grid::element::green_lagrange;
use crate::kernels::rotations::polar;
use crate::math::{M3, Real, V3, V4, rotation_matrix, rotation_minus_identity};
use crate::mesh::PAIRS;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Fewest entries per thread of a pass.
const PARALLEL: usize = 1024;
/// No rotation.
const UPRIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// Tetrahedron: corners in positive orientation, layer.
pub type Tetrahedron = ([u32; 4], usize);

/// Constant arrays.
#[derive(Clone, Debug, Default)]
pub struct Arrays<R> {
    /// Volume averaged at nodes, deviator over edges; otherwise plain elements.
    pub smoothed: bool,
    /// `[tetrahedron]` nodes.
    pub corners: Vec<[u32; 4]>,
    /// `[tetrahedron]` gradients of the shape functions of corners 1 to 3, 1/m; that of corner 0 is minus their sum.
    pub gradients: Vec<[V3<R>; 3]>,
    /// `[tetrahedron]` volume, m³, and bulk modulus, Pa.
    pub volume: Vec<[R; 2]>,
    /// `[node + 1]` CSR offsets into `of_node`.
    pub first_of_node: Vec<u32>,
    /// Tetrahedra around each node, with the node's corner.
    pub of_node: Vec<[u32; 2]>,
    /// `[node]` 1 / sum of the volumes around it, 1/m³.
    pub per_volume: Vec<R>,
    /// `[domain + 1]` CSR offsets into `of_domain`.
    pub first_of_domain: Vec<u32>,
    /// Tetrahedra of each domain.
    pub of_domain: Vec<u32>,
    /// `[domain]` sum of the volumes, m³, and shear modulus, Pa.
    pub shear: Vec<[R; 2]>,
    /// `[tetrahedron × 6, or × 1]` domains of each tetrahedron.
    pub domains: Vec<u32>,
    /// `[node]` node's own block of the stiffness matrix at rest, N/m.
    pub block: Vec<M3<R>>,
}

/// Rotations of the tetrahedra and of the domains, as quaternions.
pub struct Rotations<R> {
    /// `[tetrahedron]`
    pub element: Vec<V4<R>>,
    /// `[domain]`
    pub domain: Vec<V4<R>>,
}

/// Lists from (owner, entry) pairs in order: CSR offsets and entries.
fn lists<T: Copy + Default>(count: usize, pairs: &[(u32, T)]) -> (Vec<u32>, Vec<T>) {
    let mut first = vec![0; count + 1];
    for (owner, _) in pairs {
        first[*owner as usize + 1] += 1;
    }
    for n in 0..count {
        first[n + 1] += first[n];
    }
    let (mut next, mut out) = (first.clone(), vec![T::default(); pairs.len()]);
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
        let count = tetrahedra.len();
        let mut out = Self { smoothed, ..Self::default() };
        for (corners, layer) in tetrahedra {
            let [x0, x1, x2, x3] = corners.map(|n| V3::of(rest[n as usize]));
            let edges = M3([x1 - x0, x2 - x0, x3 - x0]);
            let volume = edges.determinant() / 6.0;
            assert!(volume > 0.0, "tetrahedra are made in positive orientation");
            out.corners.push(*corners);
            out.gradients.push(edges.inverse().transpose().0);
            out.volume.push([volume, moduli[*layer][0]]);
        }
        let around: Vec<(u32, [u32; 2])> = (0..count)
            .flat_map(|e| (0..4).map(move |a| (e, a)))
            .map(|(e, a)| (out.corners[e][a], [e as u32, a as u32]))
            .collect();
        (out.first_of_node, out.of_node) = lists(rest.len(), &around);
        let volume_around = |i: usize| out.around(i).iter().map(|[e, _]| out.volume[*e as usize][0]).sum::<f64>();
        out.per_volume = (0..rest.len()).map(|i| volume_around(i).recip()).collect();
        // domains: edges of one material each, or the elements themselves
        let mut numbers = BTreeMap::new();
        let mut members = vec![];
        for (e, (corners, layer)) in tetrahedra.iter().enumerate() {
            let own: Vec<[u32; 2]> = if smoothed {
                PAIRS.map(|ends| ends.map(|a| corners[a])).map(|[a, b]| [a.min(b), a.max(b)]).to_vec()
            } else {
                vec![[e as u32; 2]]
            };
            for edge in own {
                let next = numbers.len() as u32;
                let domain = *numbers.entry((edge, *layer)).or_insert(next);
                if domain == next {
                    out.shear.push([0.0, moduli[*layer][1]]);
                }
                out.shear[domain as usize][0] += out.volume[e][0];
                members.push((domain, e as u32));
                out.domains.push(domain);
            }
        }
        (out.first_of_domain, out.of_domain) = lists(numbers.len(), &members);
        out.block = (0..rest.len()).into_par_iter().map(|i| out.rest_block(i)).collect();
        out
    }

    /// Gradient of the shape function of a corner, 1/m.
    fn gradient(&self, e: usize, corner: usize) -> V3<f64> {
        let g = self.gradients[e];
        if corner == 0 { V3::zero() - g[0] - g[1] - g[2] } else { g[corner - 1] }
    }

    /// The node's own block of the Hessian at rest.
    fn rest_block(&self, i: usize) -> M3<f64> {
        let mut sum = M3::zero();
        // deviator: b = ∂F̄_k/∂u_i; |dev sym(u⊗b)|² = ½|u|²|b|² + ⅙(u·b)²
        let mut of_domain = BTreeMap::new();
        let each = self.each();
        for [e, a] in self.around(i) {
            let e = *e as usize;
            for domain in &self.domains[each * e..each * (e + 1)] {
                let share = self.volume[e][0] / self.shear[*domain as usize][0];
                let b = of_domain.entry(*domain).or_insert(V3::zero());
                *b += self.gradient(e, *a as usize) * share;
            }
        }
        for (domain, b) in of_domain {
            let [volume, shear] = self.shear[domain as usize];
            let scale = self.share() * volume * shear;
            sum = sum + (M3::diagonal(V3::splat(b.dot(b))) + b.outer(b) * (1.0 / 3.0)) * scale;
        }
        // volume: t = ∂θ̄_e/∂u_i
        if !self.smoothed {
            for [e, a] in self.around(i) {
                let (g, [volume, bulk]) = (self.gradient(*e as usize, *a as usize), self.volume[*e as usize]);
                sum = sum + g.outer(g) * (bulk * volume);
            }
            return sum;
        }
        let mut at_nodes = BTreeMap::new();
        for [e, a] in self.around(i) {
            let e = *e as usize;
            for node in self.corners[e] {
                let w = at_nodes.entry(node).or_insert(V3::zero());
                *w += self.gradient(e, *a as usize) * (self.volume[e][0] * self.per_volume[node as usize]);
            }
        }
        let reached: BTreeSet<u32> =
            at_nodes.keys().flat_map(|node| self.around(*node as usize).iter().map(|[e, _]| *e)).collect();
        for e in reached {
            let of_corner = |node: &u32| at_nodes.get(node).copied().unwrap_or(V3::zero());
            let corners = &self.corners[e as usize];
            let t = corners.iter().map(of_corner).fold(V3::zero(), |s, w| s + w) * 0.25;
            let [volume, bulk] = self.volume[e as usize];
            sum = sum + t.outer(t) * (bulk * volume);
        }
        sum
    }

    /// The same arrays in another precision.
    pub fn rounded<R: Real>(&self) -> Arrays<R> {
        let vector = |v: V3<f64>| V3::of(v.f64());
        let pair = |p: &[f64; 2]| p.map(R::of);
        Arrays {
            smoothed: self.smoothed,
            corners: self.corners.clone(),
            gradients: self.gradients.iter().map(|g| g.map(vector)).collect(),
            volume: self.volume.iter().map(pair).collect(),
            first_of_node: self.first_of_node.clone(),
            of_node: self.of_node.clone(),
            per_volume: self.per_volume.iter().map(|v| R::of(*v)).collect(),
            first_of_domain: self.first_of_domain.clone(),
            of_domain: self.of_domain.clone(),
            shear: self.shear.iter().map(pair).collect(),
            domains: self.domains.clone(),
            block: self.block.iter().map(|m| M3(m.0.map(vector))).collect(),
        }
    }

    /// Elastic energy of displacements with the rotations of theirs, J.
    pub fn energy(&self, u: &[V4<f64>], corotational: bool) -> f64 {
        let moved = self.displacement_gradients(u);
        let rotations = self.rotations(&moved, corotational);
        let mut sum = 0.0;
        for (k, [volume, shear]) in self.shear.iter().enumerate() {
            let strain = self.deviator(k, &moved, &rotations, true);
            sum += self.share() * volume * shear * strain.dot(strain);
        }
        let own = self.volume_strains(&moved, &rotations, true);
        let at_nodes = if self.smoothed { self.at_nodes(&own) } else { vec![] };
        for (e, [volume, bulk]) in self.volume.iter().enumerate() {
            let theta = if self.smoothed {
                0.25 * self.corners[e].iter().map(|n| at_nodes[*n as usize]).sum::<f64>()
            } else {
                own[e]
            };
            sum += 0.5 * bulk * volume * theta * theta;
        }
        sum
    }

    /// `[tetrahedron]` Green–Lagrange strain and Cauchy stress, Pa, at displacements. The stress is the one that the element's forces come
    /// from: of smoothed elements the means over its edges (deviator) and corners (pressure), turned back by its own rotation as far as
    /// theirs differ.
    pub fn strains_and_stresses(&self, u: &[V4<f64>], corotational: bool) -> Vec<[M3<f64>; 2]> {
        let moved = self.displacement_gradients(u);
        let rotations = self.rotations(&moved, corotational);
        let all = self.stresses(&moved, &rotations, true);
        let of = |e: usize| {
            let turned = all[e] * rotation_matrix(rotations.element[e]).transpose();
            [green_lagrange(moved[e]), (turned + turned.transpose()) * (0.5 / self.volume[e][0])]
        };
        (0..all.len()).map(of).collect()
    }
}

impl<R: Real> Arrays<R> {
    /// Domains per tetrahedron.
    fn each(&self) -> usize {
        if self.smoothed { PAIRS.len() } else { 1 }
    }

    /// Share of a tetrahedron's volume that belongs to each of its domains.
    fn share(&self) -> R {
        R::one() / R::of(self.each() as f64)
    }

    /// Tetrahedra around a node, with the node's corner.
    pub fn around(&self, node: usize) -> &[[u32; 2]] {
        &self.of_node[self.first_of_node[node] as usize..self.first_of_node[node + 1] as usize]
    }

    fn members(&self, domain: usize) -> &[u32] {
        &self.of_domain[self.first_of_domain[domain] as usize..self.first_of_domain[domain + 1] as usize]
    }

    /// `[tetrahedron]` displacement gradients, from differences to corner 0.
    pub fn displacement_gradients(&self, u: &[V4<R>]) -> Vec<M3<R>> {
        let of = |(corners, g): (&[u32; 4], &[V3<R>; 3])| {
            let own = V3::from4(u[corners[0] as usize]);
            let [a, b, c] = [1, 2, 3].map(|k| V3::from4(u[corners[k] as usize]) - own);
            a.outer(g[0]) + b.outer(g[1]) + c.outer(g[2])
        };
        self.corners.par_iter().zip(&self.gradients).with_min_len(PARALLEL).map(of).collect()
    }

    /// Volume-weighted mean over tetrahedra.
    fn mean(&self, members: impl Iterator<Item = u32>, moved: &[M3<R>], per_volume: R) -> M3<R> {
        members.fold(M3::zero(), |sum, e| sum + moved[e as usize] * (self.volume[e as usize][0] * per_volume))
    }

    /// Mean displacement gradient of a domain.
    fn of_domain(&self, k: usize, moved: &[M3<R>]) -> M3<R> {
        self.mean(self.members(k).iter().copied(), moved, R::one() / self.shear[k][0])
    }

    /// Rotations at displacement gradients: polar factors, found afresh, so that no state is kept from step to step.
    pub fn rotations(&self, moved: &[M3<R>], corotational: bool) -> Rotations<R> {
        let upright = UPRIGHT.map(R::of);
        if !corotational {
            return Rotations { element: vec![upright; moved.len()], domain: vec![upright; self.shear.len()] };
        }
        let of = |h: M3<R>| polar(M3::identity() + h, upright);
        Rotations {
            element: moved.par_iter().with_min_len(PARALLEL).map(|h| of(*h)).collect(),
            domain: (0..self.shear.len())
                .into_par_iter()
                .with_min_len(PARALLEL)
                .map(|k| of(self.of_domain(k, moved)))
                .collect(),
        }
    }

    /// `dev ε̄_k`; of increments, without the strain of the rotation, where `total` is false.
    fn deviator(&self, k: usize, moved: &[M3<R>], rotations: &Rotations<R>, total: bool) -> M3<R> {
        let q = rotations.domain[k];
        let mut a = rotation_matrix(q).transpose() * self.of_domain(k, moved);
        if total {
            a = a + rotation_minus_identity(q).transpose();
        }
        let strain = (a + a.transpose()) * R::of(0.5);
        strain - M3::diagonal(V3::splat(strain.trace() / R::of(3.0)))
    }

    /// `[tetrahedron]` `θ_e`.
    fn volume_strains(&self, moved: &[M3<R>], rotations: &Rotations<R>, total: bool) -> Vec<R> {
        let of = |(h, q): (&M3<R>, &V4<R>)| {
            let theta = (rotation_matrix(*q).transpose() * *h).trace();
            if total { theta + rotation_minus_identity(*q).trace() } else { theta }
        };
        moved.par_iter().zip(&rotations.element).with_min_len(PARALLEL).map(of).collect()
    }

    /// `[node]` `θ_a`.
    fn at_nodes(&self, own: &[R]) -> Vec<R> {
        let of = |i: usize| {
            let sum =
                self.around(i).iter().fold(R::zero(), |s, [e, _]| s + self.volume[*e as usize][0] * own[*e as usize]);
            sum * self.per_volume[i]
        };
        (0..self.per_volume.len()).into_par_iter().with_min_len(PARALLEL).map(of).collect()
    }

    /// `[tetrahedron]` derivative of the energy by the displacement gradient, J.
    fn stresses(&self, moved: &[M3<R>], rotations: &Rotations<R>, total: bool) -> Vec<M3<R>> {
        // deviatoric stress of the domains
        let stress = |k: usize| {
            let strain = self.deviator(k, moved, rotations, total);
            rotation_matrix(rotations.domain[k]) * strain * (self.shear[k][1] * R::of(2.0) * self.share())
        };
        let deviatoric: Vec<M3<R>> = (0..self.shear.len()).into_par_iter().with_min_len(PARALLEL).map(stress).collect();
        // pressure: of smoothed elements to the nodes and back, the transpose of the average
        let own = self.volume_strains(moved, rotations, total);
        let pressure: Vec<R> = if self.smoothed {
            let (quarter, theta) = (R::of(0.25), self.at_nodes(&own));
            let mean = |e: usize| {
                let sum = self.corners[e].iter().fold(R::zero(), |s, n| s + theta[*n as usize]);
                self.volume[e][1] * quarter * sum
            };
            let of_elements: Vec<R> = (0..own.len()).into_par_iter().with_min_len(PARALLEL).map(mean).collect();
            let back = self.at_nodes(&of_elements);
            let gather = |e: usize| quarter * self.corners[e].iter().fold(R::zero(), |s, n| s + back[*n as usize]);
            (0..own.len()).into_par_iter().with_min_len(PARALLEL).map(gather).collect()
        } else {
            own.iter().zip(&self.volume).map(|(theta, [_, bulk])| *bulk * *theta).collect()
        };
        let each = self.each();
        let sum = |e: usize| {
            let mut sum = rotation_matrix(rotations.element[e]) * pressure[e];
            for k in &self.domains[each * e..each * (e + 1)] {
                sum = sum + deviatoric[*k as usize];
            }
            sum * self.volume[e][0]
        };
        (0..own.len()).into_par_iter().with_min_len(PARALLEL).map(sum).collect()
    }

    /// Derivative of the energy by the displacement of a node, N.
    fn gathered(&self, i: usize, stress: &[M3<R>]) -> V3<R> {
        let mut sum = V3::zero();
        for [e, a] in self.around(i) {
            let g = self.gradients[*e as usize];
            let g = if *a == 0 { -(g[0] + g[1] + g[2]) } else { g[*a as usize - 1] };
            sum += stress[*e as usize] * g;
        }
        sum
    }

    /// Internal forces at displacements with the rotations given, `[node]` N.
    pub fn forces(&self, u: &[V4<R>], rotations: &Rotations<R>, f: &mut [V4<R>]) {
        let stress = self.stresses(&self.displacement_gradients(u), rotations, true);
        f.par_iter_mut().with_min_len(PARALLEL).enumerate().for_each(|(i, f)| {
            *f = self.gathered(i, &stress).pad(R::zero());
        });
    }

    /// `K z`, `[node]` N.
    pub fn product(&self, z: &[V4<R>], rotations: &Rotations<R>, w: &mut [V4<R>]) {
        let stress = self.stresses(&self.displacement_gradients(z), rotations, false);
        w.par_iter_mut().with_min_len(PARALLEL).enumerate().for_each(|(i, w)| {
            *w = self.gathered(i, &stress).pad(R::zero());
        });
    }

    /// `[node]` mean rotations around nodes, for their blocks.
    pub fn node_rotations(&self, u: &[V4<R>], corotational: bool) -> Vec<V4<R>> {
        let upright = UPRIGHT.map(R::of);
        if !corotational {
            return vec![upright; self.per_volume.len()];
        }
        let moved = self.displacement_gradients(u);
        let of = |i: usize| {
            let around = self.around(i).iter().map(|[e, _]| *e);
            polar(M3::identity() + self.mean(around, &moved, self.per_volume[i]), upright)
        };
        (0..self.per_volume.len()).into_par_iter().with_min_len(PARALLEL).map(of).collect()
    }
}
