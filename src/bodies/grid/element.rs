//! 24×24 stiffness matrix of a box-shaped hexahedron, computed once per layer on the CPU.
//!
//! `K = ∫ Bᵀ C B dV` with 2×2×2 Gauss points; C is Hooke's matrix with engineering shear strains (order xx yy zz xy yz zx). Plain:
//! trilinear displacements. B-bar: the volumetric part of B is averaged over the cell, so nearly incompressible layers do not lock (Hughes
//! 1980; mean dilatation, Nagtegaal, Parks, Rice 1974). Enhanced: nine incompatible modes `(1 − ξ²) e_i`, one per direction and axis,
//! eliminated by static condensation, `K_uu − K_ua K_aa⁻¹ K_au`, so that a cell bends without shear locking (Wilson, Taylor, Doherty,
//! Ghaboussi 1973). Over a box their mean strain is zero, so the patch test is passed without the correction that other shapes need
//! (Taylor, Beresford, Wilson 1976), and they equal the enhanced assumed strains of Simo, Rifai 1990.
//!
//! Error of the skin block's centre displacement (tests/verify/skin_block.rs), %, at ν 0.45, 0.49, 0.499:
//!
//! | cells | plain | B-bar | enhanced |
//! | --- | --- | --- | --- |
//! | 20×20×5 | −6.7, −31.4, −75.7 | +2.0, +1.7, +1.4 | +1.9, +0.5, −6.9 |
//! | 40×40×8 | −2.6, −14.6, −55.2 | +0.8, +0.9, +0.8 | +0.8, +0.7, −0.2 |
//!
//! B-bar is the default: it is the only one of the three that is accurate at every ν. Enhanced hexahedra are better at 0.49, but flat cells
//! stiffen towards 0.5.
//! Units: edges m, Young's modulus Pa, K N/m. Row and column `3a + i` are corner `a` (VTK order), axis `i`.

use crate::kernels::corner;
use crate::kernels::momentum::share;
use crate::kernels::product::Modes;
use crate::math::{M3, Real, V3};
use crate::scene::{Element, Layer};

/// 24×24 matrix by rows.
pub type Matrix = [[f64; 24]; 24];

/// Lamé constants (λ, μ) from Young's modulus and Poisson's ratio, Pa.
pub fn lame(young: f64, poisson: f64) -> (f64, f64) {
    let lambda = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    (lambda, young / (2.0 * (1.0 + poisson)))
}

/// `√(π E′ G / 2)` of a layer, N/m^1.5: see [`crate::bodies::Model::splitting`].
pub fn splitting(layer: &Layer) -> f64 {
    let modulus = layer.young / (1.0 - layer.poisson * layer.poisson);
    (std::f64::consts::FRAC_PI_2 * modulus * layer.toughness).sqrt()
}

/// Elastic strain of the rest shape along x, y and z (and 0) of a layer with in-plane strain `[e_x, e_y]`: `e_z = −ν/(1 − ν) (e_x + e_y)`,
/// so that the stress across the plane is zero.
pub fn pre_strain([x, y]: [f64; 2], poisson: f64) -> [f64; 4] {
    [x, y, -poisson / (1.0 - poisson) * (x + y), 0.0]
}

/// Gradients of the eight shape functions at natural coordinates in −1…1, 1/m.
pub fn gradients(h: [f64; 3], at: [f64; 3]) -> [[f64; 3]; 8] {
    std::array::from_fn(|a| {
        let sign = corner(a).map(|o| 2.0 * o as f64 - 1.0);
        let factor: [f64; 3] = std::array::from_fn(|n| 1.0 + sign[n] * at[n]);
        [
            sign[0] * factor[1] * factor[2] / (4.0 * h[0]),
            factor[0] * sign[1] * factor[2] / (4.0 * h[1]),
            factor[0] * factor[1] * sign[2] / (4.0 * h[2]),
        ]
    })
}

/// Displacement gradient at a point of a hexahedron with edges `h`, natural coordinates in 0…1, for the displacements of its corners, m.
pub fn displacement_gradient(h: [f64; 3], u: &[V3<f64>; 8], point: [f64; 3]) -> M3<f64> {
    let all = gradients(h, point.map(|t| 2.0 * t - 1.0));
    (1..8).fold(M3::zero(), |sum, a| sum + (u[a] - u[0]).outer(V3::of(all[a])))
}

/// `(FᵀF − I)/2` of a displacement gradient `F − I`, without the cancellation of the ones.
pub fn green_lagrange(gradient: M3<f64>) -> M3<f64> {
    (gradient + gradient.transpose() + gradient.transpose() * gradient) * 0.5
}

/// Natural coordinates of the Gauss points.
fn gauss_points() -> impl Iterator<Item = [f64; 3]> {
    let g = 1.0 / 3.0f64.sqrt();
    (0..8).map(move |a| corner(a).map(|o| g * (2.0 * o as f64 - 1.0)))
}

/// Gradients of the three incompatible modes `1 − ξ²`, 1/m.
fn inner_gradients(h: [f64; 3], at: [f64; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|d| std::array::from_fn(|n| if n == d { -4.0 * at[d] / h[d] } else { 0.0 }))
}

/// Strains of displacements along x, y, z with shape-function gradient `d`; the volumetric part uses the gradient `mean`.
fn strain(d: [f64; 3], mean: [f64; 3]) -> [[f64; 6]; 3] {
    let [x, y, z] = d;
    let mut b = [[0.0, 0.0, 0.0, y, 0.0, z], [0.0, 0.0, 0.0, x, z, 0.0], [0.0, 0.0, 0.0, 0.0, y, x]];
    for i in 0..3 {
        b[i][..3].fill((mean[i] - d[i]) / 3.0);
        b[i][i] += d[i];
    }
    b
}

/// Stiffness matrix of a hexahedron with edges `h`.
pub fn stiffness(h: [f64; 3], young: f64, poisson: f64, element: Element) -> Matrix {
    // Hooke's matrix
    let (lambda, mu) = lame(young, poisson);
    let mut c = [[0.0; 6]; 6];
    for i in 0..3 {
        for j in 0..3 {
            c[i][j] = lambda;
        }
        c[i][i] += 2.0 * mu;
        c[i + 3][i + 3] = mu;
    }
    // over a box the mean gradient is the one at the centre
    let mean = gradients(h, [0.0; 3]);
    let weight = h[0] * h[1] * h[2] / 8.0;
    // sum over Gauss points of Bᵀ C B
    let mut k = [[0.0; 24 + INNER]; 24 + INNER];
    for at in gauss_points() {
        let d = gradients(h, at);
        let dilatation = if element == Element::Bbar { &mean } else { &d };
        let mut b: Vec<[f64; 6]> = d.iter().zip(dilatation).flat_map(|(d, mean)| strain(*d, *mean)).collect();
        if element == Element::Enhanced {
            b.extend(inner_gradients(h, at).into_iter().flat_map(|d| strain(d, d)));
        }
        for (col, strain) in b.iter().enumerate() {
            let stress: [f64; 6] = std::array::from_fn(|i| (0..6).map(|j| c[i][j] * strain[j]).sum());
            for (row, strain) in b.iter().enumerate() {
                k[row][col] += weight * (0..6).map(|i| strain[i] * stress[i]).sum::<f64>();
            }
        }
    }
    if element == Element::Enhanced {
        condense(&mut k);
    }
    std::array::from_fn(|row| std::array::from_fn(|col| k[row][col]))
}

/// Number of incompatible modes of an enhanced hexahedron.
const INNER: usize = 9;

/// Static condensation of the incompatible modes, last first; their block is positive definite.
fn condense(k: &mut [[f64; 24 + INNER]; 24 + INNER]) {
    for p in (24..24 + INNER).rev() {
        let pivot = k[p];
        for row in k.iter_mut().take(p) {
            let share = row[p] / pivot[p];
            row.iter_mut().zip(&pivot).take(p).for_each(|(entry, other)| *entry -= share * other);
        }
    }
}

/// Lumped minus consistent mass of a hexahedron, `m (δ_ab − share_ab) I`, for a corner mass `m`, kg. Its row sums are zero: in a rigid
/// translation both have the same inertia.
pub fn lumping(corner_mass: f64) -> Matrix {
    std::array::from_fn(|row| {
        std::array::from_fn(|col| {
            let own = if row == col { 1.0 } else { 0.0 };
            if row % 3 == col % 3 { corner_mass * (own - share::<f64>(row / 3, col / 3)) } else { 0.0 }
        })
    })
}

/// Mirror blocks `B = H K H / 64` of an element matrix (see `kernels::product`): block `P` couples the x-displacement in sign pattern
/// `P⊕1`, y in `P⊕2` and z in `P⊕4`.
pub fn modes(k: &Matrix) -> [[[f64; 3]; 3]; 8] {
    let sign = |pattern: usize, a: usize| {
        let o = corner(a);
        let bits = o[0] + 2 * o[1] + 4 * o[2];
        if (pattern & bits).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 }
    };
    std::array::from_fn(|parity| {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let (p, q) = (parity ^ (1 << i), parity ^ (1 << j));
                let pair = |a: usize, b: usize| sign(p, a) * k[3 * a + i][3 * b + j] * sign(q, b);
                (0..64).map(|ab| pair(ab / 8, ab % 8)).sum::<f64>() / 64.0
            })
        })
    })
}

/// `[layer × 64]` 3×3 blocks `a×8+b` of matrices.
pub fn blocks<R: Real>(stiffness: &[Matrix]) -> Vec<M3<R>> {
    let block =
        |k: &Matrix, a: usize, b: usize| M3([0, 1, 2].map(|j| V3::of([0, 1, 2].map(|i| k[3 * a + i][3 * b + j]))));
    stiffness.iter().flat_map(|k| (0..64).map(move |ab| block(k, ab / 8, ab % 8))).collect()
}

/// `[layer]` mirror blocks of matrices.
pub fn rounded_modes<R: Real>(stiffness: &[Matrix]) -> Vec<Modes<R>> {
    stiffness.iter().map(|k| modes(k).map(|b| b.map(|row| row.map(R::of)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: [f64; 3] = [0.8e-3, 0.5e-3, 0.1e-3];

    #[test]
    fn constant_strain_has_its_exact_energy() {
        let (young, poisson) = (2e5, 0.45);
        let (lambda, mu) = lame(young, poisson);
        let g = [[0.01, 0.003, 0.0], [-0.002, 0.02, 0.004], [0.001, 0.0, -0.015]];
        let mut u = [0.0; 24];
        for a in 0..8 {
            let x: [f64; 3] = std::array::from_fn(|n| corner(a)[n] as f64 * H[n]);
            for i in 0..3 {
                u[3 * a + i] = (0..3).map(|j| g[i][j] * x[j]).sum();
            }
        }
        let trace: f64 = (0..3).map(|i| g[i][i]).sum();
        let mut density = 0.5 * lambda * trace * trace;
        for i in 0..3 {
            for j in 0..3 {
                let e = 0.5 * (g[i][j] + g[j][i]);
                density += mu * e * e;
            }
        }
        let exact = density * H[0] * H[1] * H[2];
        for element in [Element::Plain, Element::Bbar, Element::Enhanced] {
            let k = stiffness(H, young, poisson, element);
            let energy: f64 = (0..24).map(|r| 0.5 * u[r] * (0..24).map(|c| k[r][c] * u[c]).sum::<f64>()).sum();
            assert!((energy / exact - 1.0).abs() < 1e-12, "{element:?}: {energy} against {exact}");
        }
    }

    #[test]
    fn mirror_blocks_hold_the_whole_matrix() {
        let bits = |a: usize| corner(a)[0] + 2 * corner(a)[1] + 4 * corner(a)[2];
        let sign = |p: usize, a: usize| if (p & bits(a)).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
        for element in [Element::Plain, Element::Bbar, Element::Enhanced] {
            let k = stiffness(H, 1.0, 0.45, element);
            let b = modes(&k);
            let scale: f64 = (0..24).map(|i| k[i][i]).fold(0.0, f64::max);
            for (row, col) in (0..576).map(|n| (n / 24, n % 24)) {
                let (a, i, c, j) = (row / 3, row % 3, col / 3, col % 3);
                let sum: f64 = (0..8).map(|p| sign(p ^ (1 << i), a) * b[p][i][j] * sign(p ^ (1 << j), c)).sum();
                assert!((sum - k[row][col]).abs() < 1e-13 * scale, "{element:?} {row} {col}");
            }
        }
    }

    #[test]
    fn six_rigid_motions_and_no_more_cost_nothing() {
        for element in [Element::Plain, Element::Bbar, Element::Enhanced] {
            let k = stiffness(H, 1.0, 0.45, element);
            let scale: f64 = (0..24).map(|i| k[i][i]).fold(0.0, f64::max);
            // symmetric elimination counts the pivots that stay above rounding
            let mut m = k;
            let mut rank = 0;
            for _ in 0..24 {
                let p = (0..24).max_by(|a, b| m[*a][*a].total_cmp(&m[*b][*b])).unwrap();
                if m[p][p] < 1e-9 * scale {
                    break;
                }
                rank += 1;
                let row = m[p];
                for i in 0..24 {
                    let f = row[i] / row[p];
                    for j in 0..24 {
                        m[i][j] -= f * row[j];
                    }
                }
            }
            assert_eq!(rank, 18, "{element:?}");
            for i in 0..24 {
                for j in 0..24 {
                    assert!((k[i][j] - k[j][i]).abs() < 1e-12 * scale);
                }
            }
        }
    }
}
