//! Compressible neo-Hookean bricks: energy, forces and tangent of a cell and of a grid, in f64.
//!
//! `W = μ/2 (I₁ − 3 − 2 ln J) + λ/2 (ln J̄)²` per volume at rest, `F = I + Σ_a u_a ⊗ ∇N_a` at 2×2×2 Gauss points, `J = det F`, and in the
//! volumetric term the mean dilatation `J̄ = v/V` of the cell (Q1/P0: one pressure a cell), so that nearly incompressible layers do not
//! lock. `v = ∫ det F dV` is exact at these points. With `G_a = ∇N_a`, `g_a = F⁻ᵀ G_a`, `c_a = ∂v/∂u_a = Σ w J g_a`, `p = λ ln J̄/J̄`:
//!
//! `f_a = Σ w μ (F G_a − g_a) + p c_a`,
//! `K_ab = Σ w [μ (G_a·G_b I + g_b ⊗ g_a) + p J (g_a ⊗ g_b − g_b ⊗ g_a)] + λ (1 − ln J̄)/(V J̄²) c_a ⊗ c_b`.
//!
//! Both follow from the one potential, so `K` is symmetric; it need not be positive. At rest it is the linear brick with its λ-part
//! taken at the mean. Displacement gradients stand for `F`, and `J − 1` for `J`, so that small strains lose no digits.
//! Source: Simo, Taylor, Pister 1985 (mean dilatation at finite strain); Bonet, Wood 2008, sections 6.4 and 8.6 (law, tangent).
//! Differs: the mean in the λ-term alone, not in a modified F, which keeps the law's own form of the μ-term.
//!
//! The other laws beside it: centre of the skin block (20×20×5 cells, ν 0.45, no gravity) under a pressure on its middle
//! (tests/verify/neo_hookean.rs holds these):
//!
//! | pressure kPa | neo-Hookean mm | corotational | small strain |
//! | --- | --- | --- | --- |
//! | 1 | −0.0193 | +1.7 % | +0.9 % |
//! | 10 | −0.1868 | +13.7 % | +4.2 % |
//! | 50 | −0.7893 | +174 % | +23 % |
//!
//! Corotational stress is linear in the stretch, so what is pressed together does not stiffen: at 50 kPa nothing holds the middle of
//! 2.3 mm of skin until cells are all but gone.
//! Units: u m, edges m, λ μ Pa, W J, f N, K N/m.

use super::element::{Matrix, gradients, lame};
use crate::kernels::{PARALLEL, Params, corner};
use crate::math::V4;
use crate::mesh::Grid;
use crate::scene::{Law, Scene, Skin};
use rayon::prelude::*;

type Matrix3 = [[f64; 3]; 3];

/// A cell's force on its corners, N.
pub type Forces = [[f64; 3]; 8];

/// What the law needs of a layer.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    /// Edges of a cell, m.
    pub edges: [f64; 3],
    /// Pa
    pub lambda: f64,
    /// Pa
    pub mu: f64,
}

/// State of a Gauss point: displacement gradient, `J − 1`, gradients at rest and pushed forward.
struct Point {
    h: Matrix3,
    growth: f64,
    rest: [[f64; 3]; 8],
    now: [[f64; 3]; 8],
}

/// A cell under displacements of its corners; `None` when it is inside out somewhere.
pub struct Cell {
    points: [Point; 8],
    weight: f64,
    mean_growth: f64,
    material: Material,
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `det(I + h) − 1` and `(I + h)⁻ᵀ`; `None` where the determinant is not positive.
fn deformed(h: &Matrix3) -> Option<(f64, Matrix3)> {
    let minor = |i: usize, j: usize| h[i][i] * h[j][j] - h[i][j] * h[j][i];
    let third = h[0][0] * minor(1, 2) - h[0][1] * (h[1][0] * h[2][2] - h[1][2] * h[2][0])
        + h[0][2] * (h[1][0] * h[2][1] - h[1][1] * h[2][0]);
    let growth = h[0][0] + h[1][1] + h[2][2] + minor(0, 1) + minor(0, 2) + minor(1, 2) + third;
    if growth.is_nan() || growth <= -1.0 {
        return None;
    }
    let f: Matrix3 = std::array::from_fn(|i| std::array::from_fn(|j| h[i][j] + if i == j { 1.0 } else { 0.0 }));
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        f[a][c] * f[b][d] - f[a][d] * f[b][c]
    };
    Some((growth, std::array::from_fn(|i| std::array::from_fn(|j| cofactor(i, j) / (1.0 + growth)))))
}

impl Cell {
    /// From the corners' displacements.
    pub fn new(material: Material, u: &[[f64; 3]; 8]) -> Option<Self> {
        let g = 1.0 / 3.0f64.sqrt();
        let point = |a: usize| {
            let rest = gradients(material.edges, corner(a).map(|o| g * (2.0 * o as f64 - 1.0)));
            let entry = |i: usize, j: usize| (0..8).map(|b| u[b][i] * rest[b][j]).sum();
            let h = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
            let (growth, back) = deformed(&h)?;
            let now = rest.map(|gradient| back.map(|row| dot(row, gradient)));
            Some(Point { h, growth, rest, now })
        };
        let points: Vec<Point> = (0..8).map(point).collect::<Option<_>>()?;
        let points: [Point; 8] = points.try_into().ok()?;
        let mean_growth = points.iter().map(|p| p.growth).sum::<f64>() / 8.0;
        let weight = material.edges.iter().product::<f64>() / 8.0;
        Some(Self { points, weight, mean_growth, material })
    }

    /// J
    pub fn energy(&self) -> f64 {
        let Material { lambda, mu, .. } = self.material;
        let shear = |p: &Point| {
            let trace: f64 = (0..3).map(|i| p.h[i][i]).sum();
            let squares: f64 = p.h.iter().flatten().map(|h| h * h).sum();
            0.5 * mu * (2.0 * trace + squares - 2.0 * p.growth.ln_1p())
        };
        let bulk = 0.5 * lambda * self.mean_growth.ln_1p().powi(2);
        self.weight * (self.points.iter().map(shear).sum::<f64>() + 8.0 * bulk)
    }

    /// `∂v/∂u_a`, m².
    fn growing(&self) -> [[f64; 3]; 8] {
        let along =
            |a: usize, i: usize| self.points.iter().map(|p| self.weight * (1.0 + p.growth) * p.now[a][i]).sum::<f64>();
        std::array::from_fn(|a| std::array::from_fn(|i| along(a, i)))
    }

    /// `λ ln J̄/J̄`, Pa.
    fn pressure(&self) -> f64 {
        self.material.lambda * self.mean_growth.ln_1p() / (1.0 + self.mean_growth)
    }

    /// Forces that the corners must be held with, N.
    pub fn forces(&self) -> Forces {
        let (growing, pressure) = (self.growing(), self.pressure());
        let mut out = growing.map(|c| c.map(|c| pressure * c));
        for p in &self.points {
            for (a, force) in out.iter_mut().enumerate() {
                for i in 0..3 {
                    // F G − g = h G + (G − g)
                    let stretch = dot(p.h[i], p.rest[a]) + p.rest[a][i] - p.now[a][i];
                    force[i] += self.weight * self.material.mu * stretch;
                }
            }
        }
        out
    }

    /// 24×24 tangent, row and column `3a + i`, N/m.
    pub fn tangent(&self) -> Matrix {
        let (growing, pressure) = (self.growing(), self.pressure());
        let Material { lambda, mu, edges } = self.material;
        let volume = edges.iter().product::<f64>();
        let mean = 1.0 + self.mean_growth;
        let stiff = lambda * (1.0 - self.mean_growth.ln_1p()) / (volume * mean * mean);
        let mut k = [[0.0; 24]; 24];
        for a in 0..8 {
            for b in 0..=a {
                let mut block = [[0.0; 3]; 3];
                for p in &self.points {
                    let shear = self.weight * mu;
                    let turning = self.weight * pressure * (1.0 + p.growth);
                    let straight = shear * dot(p.rest[a], p.rest[b]);
                    for i in 0..3 {
                        block[i][i] += straight;
                        for j in 0..3 {
                            block[i][j] += (shear - turning) * p.now[b][i] * p.now[a][j];
                            block[i][j] += turning * p.now[a][i] * p.now[b][j];
                        }
                    }
                }
                for (i, j) in (0..9).map(|n| (n / 3, n % 3)) {
                    let entry = block[i][j] + stiff * growing[a][i] * growing[b][j];
                    k[3 * a + i][3 * b + j] = entry;
                    k[3 * b + j][3 * a + i] = entry;
                }
            }
        }
        k
    }
}

/// Displacements of a cell's corners.
pub fn corners_of(params: &Params<f64>, u: &[V4<f64>], cell: usize) -> [[f64; 3]; 8] {
    params.corners(cell).map(|n| [u[n][0], u[n][1], u[n][2]])
}

/// A grid of such cells.
#[derive(Clone, Debug)]
pub struct NeoHookean {
    /// `[layer]`
    pub layers: Vec<Material>,
    /// `[cells_z]` layer
    pub layer_of: Vec<u32>,
    /// Steps are solved by Newton's method; else each is one linearisation.
    pub newton: bool,
}

impl NeoHookean {
    /// Of a scene's body with that law.
    pub(super) fn of(scene: &Scene, skin: &Skin, grid: &Grid) -> Option<Self> {
        let layer = |(index, layer): (usize, &crate::scene::Layer)| {
            let (lambda, mu) = lame(layer.young, layer.poisson);
            Material { edges: grid.cell_edges(index as u32), lambda, mu }
        };
        matches!(skin.law, Law::NeoHookean).then(|| Self {
            layers: skin.layers.iter().enumerate().map(layer).collect(),
            layer_of: grid.layer_of.clone(),
            newton: scene.contact.is_none(),
        })
    }

    /// A cell under nodal displacements.
    pub fn cell(&self, params: &Params<f64>, u: &[V4<f64>], cell: usize) -> Option<Cell> {
        let layer = self.layer_of[params.cell_at(cell)[2]] as usize;
        Cell::new(self.layers[layer], &corners_of(params, u, cell))
    }

    /// Energy of all cells, J; `None` when one is inside out.
    pub fn energy(&self, params: &Params<f64>, u: &[V4<f64>]) -> Option<f64> {
        let one = |cell| self.cell(params, u, cell).map(|c| c.energy());
        let each: Option<Vec<f64>> =
            (0..params.cell_count as usize).into_par_iter().with_min_len(PARALLEL / 8).map(one).collect();
        Some(each?.iter().sum())
    }

    /// `[node]` forces that nodes must be held with, N; the number of a cell that is inside out as the error.
    pub fn forces(&self, params: &Params<f64>, u: &[V4<f64>]) -> Result<Vec<V4<f64>>, usize> {
        let one = |cell| self.cell(params, u, cell).map(|c| c.forces()).ok_or(cell);
        let cells = (0..params.cell_count as usize).into_par_iter().with_min_len(PARALLEL / 8);
        Ok(gather(params, &cells.map(one).collect::<Result<Vec<_>, _>>()?))
    }

    /// `K_T z`, one tangent at a time, `[node]` N; no cell may be inside out.
    pub fn tangent_product(&self, params: &Params<f64>, u: &[V4<f64>], z: &[V4<f64>]) -> Vec<V4<f64>> {
        let one = |cell| {
            let k = self.cell(params, u, cell).map_or([[0.0; 24]; 24], |c| c.tangent());
            times(&k, &corners_of(params, z, cell))
        };
        let cells = (0..params.cell_count as usize).into_par_iter().with_min_len(PARALLEL / 8);
        gather(params, &cells.map(one).collect::<Vec<_>>())
    }
}

/// `K z` of a cell.
pub fn times(k: &Matrix, z: &[[f64; 3]; 8]) -> Forces {
    let z = z.as_flattened();
    std::array::from_fn(|a| std::array::from_fn(|i| k[3 * a + i].iter().zip(z).map(|(k, z)| k * z).sum()))
}

/// Sums of cells' forces at the nodes, `[node]` N, each in one order.
pub fn gather(params: &Params<f64>, cells: &[Forces]) -> Vec<V4<f64>> {
    let one = |node: usize| {
        let c = params.node_at(node);
        let mut sum = [0.0; 4];
        for a in 0..8 {
            if let Some(cell) = params.cell_below(c, a) {
                (0..3).for_each(|n| sum[n] += cells[cell][a][n]);
            }
        }
        sum
    };
    (0..params.node_count as usize).into_par_iter().with_min_len(PARALLEL).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOFT: Material = Material { edges: [1.1e-3, 0.9e-3, 0.4e-3], lambda: 9e4, mu: 1e4 };

    /// Numbers in −1…1 (Knuth's MMIX generator).
    fn random(seed: u64, size: f64) -> [[f64; 3]; 8] {
        let mut state = seed;
        let mut one = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            size * ((state >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
        };
        std::array::from_fn(|_| std::array::from_fn(|_| one()))
    }

    fn moved(u: &[[f64; 3]; 8], d: &[[f64; 3]; 8], by: f64) -> Cell {
        let at = std::array::from_fn(|a| std::array::from_fn(|i| u[a][i] + by * d[a][i]));
        Cell::new(SOFT, &at).expect("no corner has come far")
    }

    fn product(a: &Forces, b: &[[f64; 3]; 8]) -> f64 {
        a.iter().zip(b).map(|(a, b)| dot(*a, *b)).sum()
    }

    #[test]
    fn force_is_the_energys_slope_and_tangent_the_forces() {
        for seed in 1..20 {
            // strains up to 60 %
            let (u, d) = (random(seed, 8e-5), random(seed + 100, 1e-4));
            let here = Cell::new(SOFT, &u).expect("not inside out");
            let (step, scale) = (1e-4, here.tangent().iter().flatten().fold(0.0f64, |m, k| m.max(k.abs())));
            let slope = (moved(&u, &d, step).energy() - moved(&u, &d, -step).energy()) / (2.0 * step);
            let wanted = product(&here.forces(), &d);
            assert!((slope - wanted).abs() < 1e-6 * scale * 1e-8, "seed {seed}: {slope:e}, wanted {wanted:e}");
            let (after, before) = (moved(&u, &d, step).forces(), moved(&u, &d, -step).forces());
            let wanted = times(&here.tangent(), &d);
            let (mut off, mut rest_off) = (0.0f64, 0.0f64);
            let at_rest = times(&moved(&u, &u, -1.0).tangent(), &d);
            for (a, i) in (0..24).map(|n| (n / 3, n % 3)) {
                let slope = (after[a][i] - before[a][i]) / (2.0 * step);
                off = off.max((slope - wanted[a][i]).abs() / (scale * 1e-4));
                rest_off = rest_off.max((slope - at_rest[a][i]).abs() / (scale * 1e-4));
            }
            assert!(off < 1e-5, "seed {seed}: {off:e}");
            // counter-test: the tangent at rest is another one
            assert!(rest_off > 1e-2, "seed {seed}: {rest_off:e}");
        }
    }

    #[test]
    fn rigid_motion_costs_nothing_and_turns_forces() {
        let (s, c) = 1.1f64.sin_cos();
        let turn = |x: [f64; 3]| [c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]];
        let strained = random(7, 6e-5);
        let at = |a: usize| -> [f64; 3] { std::array::from_fn(|n| (corner(a)[n] as f64 - 0.5) * SOFT.edges[n]) };
        let carried = |u: &[[f64; 3]; 8]| -> [[f64; 3]; 8] {
            std::array::from_fn(|a| {
                let x = at(a);
                let y = turn(std::array::from_fn(|n| x[n] + u[a][n]));
                std::array::from_fn(|n| y[n] - x[n] + 0.02)
            })
        };
        let still = Cell::new(SOFT, &carried(&[[0.0; 3]; 8])).expect("a rotation");
        let volume: f64 = SOFT.edges.iter().product();
        assert!(still.energy().abs() < 1e-12 * volume * SOFT.lambda, "{:e}", still.energy());
        let (old, new) = (Cell::new(SOFT, &strained), Cell::new(SOFT, &carried(&strained)));
        let (old, new) = (old.expect("little strain"), new.expect("the same strain"));
        assert!((old.energy() / new.energy() - 1.0).abs() < 1e-9);
        for (a, b) in old.forces().iter().zip(new.forces()) {
            let wanted = turn(*a);
            assert!((0..3).all(|n| (wanted[n] - b[n]).abs() < 1e-9), "{wanted:?} {b:?}");
        }
    }

    #[test]
    fn a_cell_that_is_inside_out_is_none() {
        let mut u = [[0.0; 3]; 8];
        (4..8).for_each(|a| u[a][2] = -1.01 * SOFT.edges[2]);
        assert!(Cell::new(SOFT, &u).is_none());
        assert!(Cell::new(SOFT, &[[f64::NAN; 3]; 8]).is_none());
    }

    #[test]
    fn at_rest_the_tangent_is_the_small_strain_brick_in_constant_strain() {
        let tangent = Cell::new(SOFT, &[[0.0; 3]; 8]).expect("at rest").tangent();
        let young = SOFT.mu * (3.0 * SOFT.lambda + 2.0 * SOFT.mu) / (SOFT.lambda + SOFT.mu);
        let poisson = 0.5 * SOFT.lambda / (SOFT.lambda + SOFT.mu);
        let small = super::super::element::stiffness(SOFT.edges, young, poisson, crate::scene::Element::Bbar);
        let gradient = [[0.3, 0.2, -0.1], [0.5, -0.4, 0.7], [0.1, 0.6, 0.2]];
        let u: [[f64; 3]; 8] = std::array::from_fn(|a| {
            let x: [f64; 3] = std::array::from_fn(|n| corner(a)[n] as f64 * SOFT.edges[n]);
            gradient.map(|row| dot(row, x))
        });
        let (found, wanted) = (times(&tangent, &u), times(&small, &u));
        let scale = wanted.iter().flatten().fold(0.0f64, |m, f| m.max(f.abs()));
        for (f, w) in found.iter().flatten().zip(wanted.iter().flatten()) {
            assert!((f - w).abs() < 1e-12 * scale, "{f:e} {w:e}");
        }
    }
}
