//! Checks in f64 on the CPU: elastic energy, and the true residual of a step that some backend has solved.

use super::{Model, NeoHookean, rate};
use crate::kernels::forces::rest_corner;
use crate::kernels::product::{LANES, cell_groups, product};
use crate::kernels::split::split_cells;
use crate::kernels::split_product::split_product;
use crate::kernels::{ahead, anchors, forces, momentum, rhs, rotations, springs, springs_product};
use crate::math::{V3, V4, norm, rotation_matrix, rotation_minus_identity};
use crate::scene::Mass;

/// Elastic energy of a displacement field, J: `½ Σ_c d_cᵀ K d_c`, `d = Rᵀ(X + u) − X + e∘X` with the strain `e` at rest; for springs `½ Σ k ε²`.
/// Anchors add `½ Σ k |u|²`; a neo-Hookean body has its own law, and no
/// bound where it is inside out. `rotation` as the kernels keep it (0 for dead cells), `law` of the springs as cut so far.
pub fn elastic_energy(model: &Model, u: &[V4<f64>], rotation: &[V4<f64>], split: &[u32], law: &[V4<f64>]) -> f64 {
    let anchored = model.anchors.energy(u, |node| model.stays(rotation, law, node));
    if let Some(s) = &model.springs {
        let stretch = |[a, b]: [u32; 2]| {
            let rest = |n: u32| V3::of(model.rest[n as usize]);
            let span = rest(b) - rest(a);
            let shift = V3::from4(u[b as usize]) - V3::from4(u[a as usize]);
            springs::elongation(span, shift, (span + shift).length())
        };
        return anchored
            + s.ends.iter().zip(law).map(|(ends, law)| 0.5 * law[1] * (law[0] + stretch(*ends)).powi(2)).sum::<f64>();
    }
    let params = model.params::<f64>();
    if let Some(law) = &model.neo_hookean {
        return anchored + law.energy(&params, u).unwrap_or(f64::INFINITY);
    }
    let mut energy = anchored;
    for (cell, q) in rotation.iter().enumerate().filter(|(_, q)| **q != [0.0; 4]) {
        let layer = model.grid.layer_of[params.cell_at(cell)[2]] as usize;
        let h = V3::from4(model.shape[layer]);
        let e = model.pre_strain[layer];
        let (back, turn) = (rotation_matrix(*q).transpose(), rotation_minus_identity(*q).transpose());
        let mut d = [0.0; 24];
        for (a, node) in params.corner_nodes(split, cell).into_iter().enumerate() {
            let x = rest_corner(h, a);
            let local = (back * V3::from4(u[node]) + turn * x).f64();
            for (i, x) in x.f64().into_iter().enumerate() {
                d[3 * a + i] = local[i] + e[i] * x;
            }
        }
        let k = &model.stiffness[layer];
        energy += (0..24).map(|r| 0.5 * d[r] * (0..24).map(|c| k[r][c] * d[c]).sum::<f64>()).sum::<f64>();
    }
    energy
}

/// What a backend held at a step's start, with what it found.
#[derive(Clone, Debug, Default)]
pub struct Solved {
    /// `[node]` displacement at the start, m.
    pub u: Vec<V4<f64>>,
    /// `[node]` velocity at the start, m/s.
    pub v: Vec<V4<f64>>,
    /// `[cell]` rotations at the start (0 for dead cells).
    pub rotation: Vec<V4<f64>>,
    /// Table of split nodes.
    pub split: Vec<u32>,
    /// `[node]` free axes and mass.
    pub free: Vec<V4<f64>>,
    /// `[spring]` law.
    pub law: Vec<V4<f64>>,
    /// `[node]` dead loads, N.
    pub load: Vec<V4<f64>>,
    /// `[node]` contact forces of the step, N.
    pub contact: Vec<V4<f64>>,
    /// `[node]` displacement increment that was found, m.
    pub dx: Vec<V4<f64>>,
}

/// `|b + Jᵀλ − A Δx|` relative to the step's load (free motion's load and contact force), everything in f64.
pub fn true_residual(model: &Model, solved: &Solved) -> f64 {
    let (rest, load) = residual(model, solved);
    if load == 0.0 { 0.0 } else { norm(&rest) / load }
}

/// Forces of a neo-Hookean body at the step's start, and what of their change over the step it sees: by Newton's method the law's own, else
/// the tangent's. NaN where a cell is inside out.
fn at_neo_hookean(model: &Model, law: &NeoHookean, solved: &Solved, f: &mut [V4<f64>]) -> Vec<V4<f64>> {
    let params = model.params::<f64>();
    let nowhere = vec![[f64::NAN; 4]; f.len()];
    f.copy_from_slice(&law.forces(&params, &solved.u).unwrap_or_else(|_| nowhere.clone()));
    let mut change = if law.newton {
        let end: Vec<V4<f64>> =
            solved.u.iter().zip(&solved.dx).map(|(u, d)| std::array::from_fn(|n| u[n] + d[n])).collect();
        let mut end = law.forces(&params, &end).unwrap_or(nowhere);
        end.iter_mut().zip(f).for_each(|(e, f)| (0..3).for_each(|n| e[n] -= f[n]));
        end
    } else {
        law.tangent_product(&params, &solved.u, &solved.dx)
    };
    change.iter_mut().for_each(|c| *c = c.map(|c| c * model.step.end_share()));
    change
}

/// `sum += P more`, `P` the free axes.
fn add(sum: &mut [V4<f64>], more: &[V4<f64>], free: &[V4<f64>]) {
    for ((sum, more), free) in sum.iter_mut().zip(more).zip(free) {
        (0..3).for_each(|n| sum[n] += more[n] * free[n]);
    }
}

/// `b + Jᵀλ − A Δx`, `[node]` N, and the norm of the step's load, N, everything in f64.
pub fn residual(model: &Model, solved: &Solved) -> (Vec<V4<f64>>, f64) {
    let params = model.params::<f64>();
    let count = solved.u.len();
    let zeros = vec![[0.0; 4]; count];
    let (mut f, mut b, mut w) = (zeros.clone(), zeros.clone(), zeros);
    let shapes = model.shapes::<f64>();
    let in_system = model.anchors.all_in_system(rate(&model.step), &solved.free);
    let mut at = solved.u.clone(); // where elastic forces are taken
    ahead::ahead(&params, &solved.u, &solved.v, &mut at);
    if let Some(s) = &model.springs {
        let rest: Vec<V4<f64>> = model.rest.iter().map(|r| V3::of(*r).pad(0.0)).collect();
        let mut tangent = vec![[0.0; 4]; s.half.len() * 2];
        springs::springs(&params, &rest, &at, &s.first, &s.half, &solved.law, &mut f, &mut tangent);
        springs_product::springs_product(&params, &s.first, &s.half, &tangent, &in_system, &solved.dx, &mut w);
    } else {
        let blocks = model.stiffness_blocks::<f64>();
        let layers = &model.grid.layer_of;
        let mut rotation = solved.rotation.clone();
        if model.corotational {
            rotations::rotations(&params, &shapes, layers, &solved.split, &solved.u, &mut rotation);
        }
        let (pre_strains, split) = (model.pre_strains(), &solved.split);
        forces::forces(&params, &shapes, &pre_strains, &blocks, layers, split, &at, &rotation, &mut f);
        let mut scratch = vec![[[[0.0; LANES]; 3]; 8]; cell_groups(&params)];
        let mut params = params;
        if model.neo_hookean.is_some() {
            params.stiffness_factor -= model.step.end_share();
        }
        let (modes, split) = (model.modes(), &solved.split);
        product(&params, &modes, layers, &rotation, &in_system, split, &solved.dx, &mut w, &mut scratch);
        let cells = split_cells(&params, split);
        if !cells.is_empty() {
            split_product(&params, &modes, layers, &rotation, &in_system, split, &cells, &solved.dx, &mut w);
        }
        if let Some(law) = &model.neo_hookean {
            let change = at_neo_hookean(model, law, solved, &mut f);
            add(&mut w, &change, &solved.free);
        }
    }
    let mut mean_v = solved.v.clone();
    if model.mass == Mass::Consistent {
        let layers = &model.grid.layer_of;
        momentum::momentum(
            &params,
            &shapes,
            layers,
            &solved.split,
            &solved.rotation,
            &solved.free,
            &solved.v,
            &mut mean_v,
        );
    }
    let mut load = rhs::rhs(&params, &f, &mean_v, &solved.free, &solved.load, &mut b);
    anchors::anchors(&model.anchors.nodes, &model.anchors.stiffness, &solved.free, &at, &mut b);
    for i in 0..count {
        for n in 0..3 {
            let contact = solved.contact[i][n] * solved.free[i][n];
            load += contact * contact;
            b[i][n] += contact - w[i][n];
        }
    }
    (b, load.sqrt())
}
