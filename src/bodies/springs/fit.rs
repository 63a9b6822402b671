//! Stiffnesses of springs by Young's moduli.
//!
//! The start is `k = E Σ_e V_e / L²` over the tetrahedra `e` around an edge of length `L` (van Gelder 1998, equation 11): if the network
//! strained evenly, its mean over all directions would be the isotropic material of modulus `E` and Poisson's ratio ¼, the only one of
//! central forces. It does not: nodes give way. The network of scenes/meshes/skin_fine.msh is 1.4 times too stiff along x and y, 2.7 times
//! too soft along z and 3.3 times in shear.
//!
//! So each layer is taken alone and loaded in twelve ways, which bound what it does in a body (Huet 1990): free under even stresses along
//! x, y, z and in shear of xy, yz, zx, and with an outside that follows even strains of these. The material's nine compliances
//! (`1/E` along, `−ν/E` across, `2 (1 + ν)/E` in shear) and nine stiffnesses are matched as well as they can be together, by Gauss–Newton's
//! method with the least change of `ln k`, squared and weighted with `k L²` at the start. A mean strain `S_ij`, of stress `i` by stress
//! `j`, changes by `∂S_ij/∂ln k_s = −k_s e_s^i e_s^j / V`, `e_s` the elongation of spring `s` and `V` the volume; a mean stress by as much upwards: these are shares of the elastic energy.
//!
//! Six rounds, of some hundred iterations of conjugate gradients for each load; more leave the errors as they are. Matching the compliances
//! alone works to any accuracy, even with a Poisson's ratio of 0.45, and is no use: between rollers such a network is a quarter too stiff, and
//! glued to a plate a third, since soft springs on the outside make up for stiff ones inside.
//!
//! Errors: `tests/engine/fitted.rs`.

use super::Springs;
use crate::bodies::Refused;
use crate::error::Result;
use crate::kernels::advance::Request;
use crate::linear::{SolverVectors, solve};
use crate::math::elementary::{exp, ln};
use crate::math::{M3, V3, V4, solve_definite};
use crate::mesh::Unstructured;
use crate::scene::Layer;
use std::sync::atomic::AtomicBool;

/// Rounds of Gauss–Newton's method.
const ROUNDS: u32 = 6;
/// Most that a round asks of a constant, relative, and that it changes the logarithm of a stiffness.
const MOST_CHANGE: [f64; 2] = [0.5, 1.0];
/// Added to the diagonal of Gauss–Newton's matrix, relative: the constants depend on each other.
const DAMPING: f64 = 0.1;
/// Residual of the solves, relative to the forces; the energy is off by its square.
const TOLERANCE: f64 = 1e-3;
/// Iterations of a solve, at most.
const MOST_ITERATIONS: u32 = 20_000;
/// Force of an even stress on an inner node, relative to those of the elements around it: rounding.
const INNER: f64 = 1e-9;

/// Components of the even stresses and strains; shears of 1 on both sides of the diagonal, and angles of 1.
const STATES: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [1, 2], [0, 2]];
/// Constants by two of these.
const MATCHED: [[usize; 2]; 9] = [[0, 0], [1, 1], [2, 2], [3, 3], [4, 4], [5, 5], [0, 1], [1, 2], [0, 2]];
/// Compliances and stiffnesses of the material with E = 1 and ν = ¼.
const COMPLIANCES: [f64; 9] = [1.0, 1.0, 1.0, 2.5, 2.5, 2.5, -0.25, -0.25, -0.25];
const STIFFNESSES: [f64; 9] = [1.2, 1.2, 1.2, 0.4, 0.4, 0.4, 0.4, 0.4, 0.4];
/// Number of both.
const COUNT: usize = 2 * MATCHED.len();

/// `[layer][spring]` for a modulus of 1 Pa, N/m per Pa.
///
/// # Errors
/// [`Refused::SpringFit`] where a solve does not end.
pub(super) fn stiffnesses(springs: &Springs, of: &Unstructured, layers: &[Layer]) -> Result<Vec<Vec<f64>>> {
    let of_layer = |(number, layer): (usize, &Layer)| {
        let mut network = Network::new(springs, of, number as u32);
        if network.fit().is_none() {
            return Err(Refused::SpringFit { layer: layer.name.clone() }.into());
        }
        let mut all = vec![0.0; springs.ends.len()];
        network.springs.iter().for_each(|spring| all[spring.number] = spring.stiffness);
        Ok(all)
    };
    layers.iter().enumerate().map(of_layer).collect()
}

/// A spring that is linear at rest.
struct Spring {
    number: usize,
    ends: [usize; 2],
    axis: V3<f64>,
    stiffness: f64, // N/m
    weight: f64,    // of a change of its logarithm: `k L²/V` at the start
}

impl Spring {
    fn elongation(&self, u: &[V4<f64>]) -> f64 {
        let [a, b] = self.ends;
        self.axis.dot(V3::from4(u[b]) - V3::from4(u[a]))
    }
}

/// Springs of a layer, of modulus 1 Pa, and its loads.
struct Network {
    springs: Vec<Spring>,
    /// `[state][node]` forces of a stress of 1 Pa, N
    stresses: Vec<Vec<V4<f64>>>,
    /// `[state][node]` displacements of a strain of 1, m
    strains: Vec<Vec<V4<f64>>>,
    /// `[node]` 1 inside, 0 outside
    inside: Vec<f64>,
    /// m³
    volume: f64,
}

impl Network {
    /// Of a layer, with the stiffnesses to start from.
    fn new(springs: &Springs, of: &Unstructured, layer: u32) -> Self {
        let mesh = &of.mesh;
        let count = mesh.nodes().len();
        let span = |spring: usize| {
            let [a, b] = springs.ends[spring].map(|node| V3::of(mesh.nodes()[node as usize]));
            b - a
        };
        let mut stiffness = vec![0.0; springs.ends.len()];
        // `∫ ∇N dV` of each node, m², with the sum of the sizes of its parts
        let mut parts = vec![(V3::zero(), 0.0); count];
        let mut volume = 0.0;
        for e in (0..mesh.tetrahedra().len()).filter(|e| mesh.layers()[*e] == layer) {
            let own = mesh.volume(e);
            volume += own;
            for spring in springs.tetrahedra.springs[e] {
                let span = span(spring as usize);
                stiffness[spring as usize] += own / span.dot(span);
            }
            let [a, b, c] = of.gradients(e).map(|gradient| gradient * own);
            for (node, g) in mesh.tetrahedra()[e].into_iter().zip([V3::zero() - a - b - c, a, b, c]) {
                let (sum, size) = &mut parts[node as usize];
                (*sum, *size) = (*sum + g, *size + g.length());
            }
        }
        let of_node = |[i, j]: [usize; 2], g: [f64; 3], half: f64| {
            let mut vector = [0.0; 4];
            if i == j {
                vector[i] = g[i];
            } else {
                (vector[i], vector[j]) = (half * g[j], half * g[i]);
            }
            vector
        };
        let stresses = STATES.map(|state| parts.iter().map(|(g, _)| of_node(state, g.f64(), 1.0)).collect());
        let strains = STATES.map(|state| mesh.nodes().iter().map(|x| of_node(state, *x, 0.5)).collect());
        let used = (0..stiffness.len()).filter(|spring| stiffness[*spring] > 0.0).map(|number| {
            let (ends, span, stiffness) =
                (springs.ends[number].map(|node| node as usize), span(number), stiffness[number]);
            let weight = stiffness * span.dot(span) / volume;
            Spring { number, ends, axis: span * (1.0 / span.length()), stiffness, weight }
        });
        let is_inside = |(g, size): &(V3<f64>, f64)| if g.length() <= INNER * size { 1.0 } else { 0.0 };
        Self {
            springs: used.collect(),
            stresses: stresses.to_vec(),
            strains: strains.to_vec(),
            inside: parts.iter().map(is_inside).collect(),
            volume,
        }
    }

    /// Fits the stiffnesses; none if a solve does not end.
    fn fit(&mut self) -> Option<()> {
        let nodes = self.inside.len();
        let everywhere = vec![1.0; nodes];
        let no_load = vec![[0.0; 4]; nodes];
        let mut by_stress = vec![no_load.clone(); STATES.len()];
        let mut by_strain = self.strains.clone();
        for _ in 0..ROUNDS {
            let inverse = self.inverse_diagonal();
            for (u, load) in by_stress.iter_mut().zip(&self.stresses) {
                self.displace(&inverse, &everywhere, load, u)?;
            }
            for u in &mut by_strain {
                self.displace(&inverse, &self.inside, &no_load, u)?;
            }
            // what each spring adds to each constant
            let of_spring = |spring: &Spring| {
                let mut shares = [0.0; COUNT];
                for (shares, loaded) in shares.chunks_exact_mut(MATCHED.len()).zip([&by_stress, &by_strain]) {
                    let elongations: Vec<f64> = loaded.iter().map(|u| spring.elongation(u)).collect();
                    for (share, [i, j]) in shares.iter_mut().zip(MATCHED) {
                        *share = spring.stiffness * elongations[i] * elongations[j] / self.volume;
                    }
                }
                shares
            };
            let mut shares: Vec<[f64; COUNT]> = self.springs.iter().map(of_spring).collect();
            // how far each constant is off, relative, in the direction in which it changes with the stiffnesses
            let (mut wrong, mut scale) = ([0.0; COUNT], [1.0; COUNT]);
            for c in 0..COUNT {
                let sum: f64 = shares.iter().map(|share| share[c]).sum();
                let (compliance, [i, j]) = (c < MATCHED.len(), MATCHED[c % MATCHED.len()]);
                let wanted = if compliance { COMPLIANCES[c] } else { STIFFNESSES[c - MATCHED.len()] };
                let falls = if compliance { 1.0 } else { -1.0 };
                (wrong[c], scale[c]) = match (i == j, compliance) {
                    (true, _) => (falls * ln(sum / wanted), 1.0 / sum),
                    (false, true) => (sum - wanted, 1.0),
                    (false, false) => (1.0 - sum / wanted, 1.0 / wanted),
                };
            }
            // least change of ln k
            let mut normal = [[0.0; COUNT]; COUNT];
            for (share, spring) in shares.iter_mut().zip(&self.springs) {
                share.iter_mut().zip(scale).for_each(|(share, scale)| *share *= scale);
                for (row, a) in normal.iter_mut().zip(&*share) {
                    row.iter_mut().zip(&*share).for_each(|(sum, b)| *sum += a * b / spring.weight);
                }
            }
            (0..COUNT).for_each(|c| normal[c][c] *= 1.0 + DAMPING);
            let [asked, most] = MOST_CHANGE;
            let weights = solve_definite(normal, wrong.map(|w| w.clamp(-asked, asked)));
            for (spring, share) in self.springs.iter_mut().zip(&shares) {
                let change: f64 = share.iter().zip(weights).map(|(share, weight)| share * weight).sum();
                spring.stiffness *= exp((change / spring.weight).clamp(-most, most));
            }
        }
        Some(())
    }

    /// `[node]` inverse of the block of a node of the matrix.
    fn inverse_diagonal(&self) -> Vec<M3<f64>> {
        let mut blocks = vec![M3::zero(); self.inside.len()];
        for spring in &self.springs {
            for node in spring.ends {
                blocks[node] = blocks[node] + spring.axis.outer(spring.axis * spring.stiffness);
            }
        }
        blocks.iter().map(|block| if *block == M3::zero() { *block } else { block.inverse() }).collect()
    }

    /// `w = K z`, N
    fn multiply(&self, z: &[V4<f64>], w: &mut [V4<f64>]) {
        w.fill([0.0; 4]);
        for spring in &self.springs {
            let [a, b] = spring.ends;
            let force = spring.axis * (spring.stiffness * spring.elongation(z));
            (w[a], w[b]) = ((V3::from4(w[a]) - force).pad(0.0), (V3::from4(w[b]) + force).pad(0.0));
        }
    }

    /// Displacements of a load, from the guess `x`, whose nodes with a `mask` of 0, not 1, stay; none if the solve does not end.
    fn displace(&self, inverse: &[M3<f64>], mask: &[f64], load: &[V4<f64>], x: &mut [V4<f64>]) -> Option<()> {
        let dot = |a: &[V4<f64>], b: &[V4<f64>]| -> f64 {
            a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
        };
        let [mut p, mut s, mut z, mut w] = [(); 4].map(|()| vec![[0.0; 4]; load.len()]);
        self.multiply(x, &mut w);
        let size = dot(load, load).max(dot(&w, &w));
        let product = |z: &[V4<f64>], w: &mut [V4<f64>]| {
            self.multiply(z, w);
            w.iter_mut().zip(mask).for_each(|(w, mask)| *w = w.map(|w| w * mask));
            dot(z, w)
        };
        let precondition = |r: &[V4<f64>], z: &mut [V4<f64>]| {
            z.iter_mut().zip(r).zip(inverse).for_each(|((z, r), inverse)| *z = (*inverse * V3::from4(*r)).pad(0.0));
            dot(r, z)
        };
        let mut r = load.to_vec();
        let vectors = SolverVectors { x, r: &mut r, p: &mut p, s: &mut s, z: &mut z, w: &mut w };
        let request = Request { tolerance_squared: TOLERANCE * TOLERANCE, use_load: 1.0, ..Request::default() };
        let never = AtomicBool::new(false);
        solve(vectors, &request, size, MOST_ITERATIONS, &never, product, precondition).converged.then_some(())
    }
}
