//! 24×24 stiffness of a box-shaped brick, computed once per layer on the CPU.
//!
//! `K = ∫ Bᵀ C B dV` by 2×2×2 Gauss points; C is Hooke's matrix with engineering shear strains (order xx yy zz xy yz zx).
//! Plain: trilinear displacements. B-bar: the volumetric part of B is its mean over the cell, so nearly incompressible layers do not
//! lock (Hughes 1980; mean dilatation, Nagtegaal, Parks, Rice 1974).
//! Units: edges m, Young's modulus Pa, K N/m. Row and column `3a + i` are corner `a` (VTK order), axis `i`.

use crate::kernels::corner;
use crate::kernels::product::Modes;
use crate::math::{M3, Real, V3};
use crate::scene::Element;

/// 24×24 matrix by rows.
pub type Matrix = [[f64; 24]; 24];

/// Lamé constants (λ, μ) of Young's modulus and Poisson's ratio, Pa.
pub fn lame(young: f64, poisson: f64) -> (f64, f64) {
    let lambda = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    (lambda, young / (2.0 * (1.0 + poisson)))
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

/// Natural coordinates of the Gauss points.
fn gauss_points() -> impl Iterator<Item = [f64; 3]> {
    let g = 1.0 / 3.0f64.sqrt();
    (0..8).map(move |a| corner(a).map(|o| g * (2.0 * o as f64 - 1.0)))
}

/// Strain–displacement matrix from gradients, its volumetric part taken from `mean`.
fn strain(d: &[[f64; 3]; 8], mean: &[[f64; 3]; 8]) -> [[f64; 24]; 6] {
    let mut b = [[0.0; 24]; 6];
    for a in 0..8 {
        let [x, y, z] = d[a];
        for i in 0..3 {
            let spread = (mean[a][i] - d[a][i]) / 3.0;
            for row in b.iter_mut().take(3) {
                row[3 * a + i] = spread;
            }
            b[i][3 * a + i] += d[a][i];
        }
        (b[3][3 * a], b[3][3 * a + 1]) = (y, x);
        (b[4][3 * a + 1], b[4][3 * a + 2]) = (z, y);
        (b[5][3 * a + 2], b[5][3 * a]) = (x, z);
    }
    b
}

/// Stiffness of a brick with edges `h`.
pub fn stiffness(h: [f64; 3], young: f64, poisson: f64, element: Element) -> Matrix {
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
    let mut k = [[0.0; 24]; 24];
    for at in gauss_points() {
        let d = gradients(h, at);
        let b = match element {
            Element::Plain => strain(&d, &d),
            Element::Bbar => strain(&d, &mean),
        };
        for col in 0..24 {
            let stress: [f64; 6] = std::array::from_fn(|i| (0..6).map(|j| c[i][j] * b[j][col]).sum());
            for row in 0..24 {
                k[row][col] += weight * (0..6).map(|i| b[i][row] * stress[i]).sum::<f64>();
            }
        }
    }
    k
}

/// The mirror blocks `B = H K H / 64` of a brick's matrix (see `kernels::product`): block `P` couples the x-displacement in sign pattern
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
        for element in [Element::Plain, Element::Bbar] {
            let k = stiffness(H, young, poisson, element);
            let energy: f64 = (0..24).map(|r| 0.5 * u[r] * (0..24).map(|c| k[r][c] * u[c]).sum::<f64>()).sum();
            assert!((energy / exact - 1.0).abs() < 1e-12, "{element:?}: {energy} against {exact}");
        }
    }

    #[test]
    fn mirror_blocks_hold_the_whole_matrix() {
        let bits = |a: usize| corner(a)[0] + 2 * corner(a)[1] + 4 * corner(a)[2];
        let sign = |p: usize, a: usize| if (p & bits(a)).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
        for element in [Element::Plain, Element::Bbar] {
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
        for element in [Element::Plain, Element::Bbar] {
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
