//! Linearised stiffness of a hyperelastic cell beyond its small-strain matrix: that of its volume and that of its tension; text shared by
//! the shaders.
//!
//! `y ⊗ y` is the stiffness of the volume: nine numbers in the patterns 1, 2 and 4 of the cell's frame ([`super::product`]), the gradient of
//! the present volume.
//!
//! Tension `τ` resists gradients `H` of displacement by `−2τ H_ij H_ji` for each pair of axes (geometric stiffness;
//! [`super::hyperelastic::Cell::linearised`]). In a uniform gradient only the rotation is added, `τ/2 (H_ij − H_ji)²`; in the hourglass
//! patterns the bound `τ (H_ij² + H_ji²)`, which is diagonal. With `p_i = √(τ V)/(4 h_i)`, `s_a = (± p_x, ± p_y, ± p_z)` of corner `a`, lower
//! ones positive:
//!
//! `K_ab = ½ (s_a·s_b I − s_b ⊗ s_a) + Σ_P ±_a ±_b diag(k_P)`, along x `k_3 = p_y²/3`, `k_5 = p_z²/3`, `k_6 = (p_y² + p_z²)/3`,
//! `k_7 = (p_y² + p_z²)/9`; along y and z likewise.
//!
//! The numbers stand after the quaternions in the array of rotations, `[cell × 3]` rows: `y_n` and `p_n`.

use super::{Params, corner};
use crate::math::{M3, Number, Real, V3, V4};

/// Text shared by the shaders that have rotations.
pub const WGSL: &str = include_str!("linearised.wgsl");

/// `params.corotational` from which cells are hyperelastic.
pub const HYPERELASTIC: u32 = 2;

/// Rows `y`, `p` of a cell.
pub fn rows<'a, R: Real>(params: &Params<R>, rotation: &'a [V4<R>], cell: usize) -> &'a [V4<R>] {
    &rotation[params.cell_count as usize + 3 * cell..][..3]
}

/// Rows of a cell, in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rows<R> {
    /// `y` in the patterns 1, 2 and 4.
    pub volume: [V3<R>; 3],
    /// `p`
    pub tension: V3<R>,
}

impl<N: Number> Rows<N> {
    /// From how they are stored.
    #[inline(always)]
    pub fn unpacked([x, y, z]: [V4<N>; 3]) -> Self {
        Self { volume: [V3::from4(x), V3::from4(y), V3::from4(z)], tension: V3::new(x[3], y[3], z[3]) }
    }

    /// As they are stored.
    #[inline(always)]
    pub fn packed(&self) -> [V4<N>; 3] {
        let [x, y, z] = self.volume;
        [x.pad(self.tension.x), y.pad(self.tension.y), z.pad(self.tension.z)]
    }

    /// `Σ_n ± y_n` of a corner.
    #[inline(always)]
    pub fn slope(&self, a: usize) -> V3<N> {
        let sign = signs(a, self.tension.x);
        self.volume[0] * sign.x + self.volume[1] * sign.y + self.volume[2] * sign.z
    }

    /// Block of the stiffness between two corners.
    #[inline(always)]
    pub fn between(&self, a: usize, b: usize) -> M3<N> {
        let p = self.tension;
        let (of_a, of_b, half, third) = (signs(a, p.x), signs(b, p.x), p.x.like(0.5), p.x.like(1.0 / 3.0));
        let (s_a, s_b, both) = (of_a.times(p), of_b.times(p), of_a.times(of_b));
        let rotation = (s_b.outer(s_a) * p.x.like(-1.0)).plus(s_a.dot(s_b)) * half;
        // sums over the patterns of ± k_P, by the axes of their gradients
        let [xy, xz, yz] = [both.x * both.y, both.x * both.z, both.y * both.z];
        let all = xy * both.z * third;
        let zero = p.x.like(0.0);
        let squares = p.times(p) * third;
        let diagonal = V3::new(
            V3::new(zero, xy + yz + all, xz + yz + all).dot(squares),
            V3::new(xy + xz + all, zero, yz + xz + all).dot(squares),
            V3::new(xz + xy + all, yz + xy + all, zero).dot(squares),
        );
        rotation.plus_diagonal(diagonal) + self.slope(a).outer(self.slope(b))
    }
}

/// Signs of a corner in the patterns 1, 2, 4; lower corners have the positive one.
#[inline(always)]
fn signs<N: Number>(a: usize, kind: N) -> V3<N> {
    let at = corner(a);
    let sign = [1.0, -1.0];
    V3::new(kind.like(sign[at[0]]), kind.like(sign[at[1]]), kind.like(sign[at[2]]))
}

impl<R: Real> Rows<R> {
    /// Those of a cell.
    pub fn of(params: &Params<R>, rotation: &[V4<R>], cell: usize) -> Self {
        let own = rows(params, rotation, cell);
        Self::unpacked([own[0], own[1], own[2]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::product::cell_forces;
    use crate::math::random::Random;
    use crate::math::wide::OneByOne;

    /// Corner of the products, which have bits x + 2y + 4z, in VTK's order.
    const BY_BITS: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

    #[test]
    fn products_and_blocks_have_the_same_stiffness() {
        let mut random = Random::new(5);
        let mut vector = || V3::new(random.signed(), random.signed(), random.signed());
        for _ in 0..10 {
            let rows = Rows { volume: [vector(), vector(), vector()], tension: vector() };
            let z: [V3<f64>; 8] = std::array::from_fn(|_| vector());
            let none = [0.0; 3];
            let (unturned, at) = ([0.0, 0.0, 0.0, 1.0], BY_BITS.map(|a| z[a].f64()));
            let modes = [[[0.0; 3]; 3]; 8];
            let found = cell_forces(OneByOne, &modes, unturned, at, none, none, Some(rows.packed()));
            for (a, found) in BY_BITS.into_iter().zip(found) {
                let wanted = (0..8).fold(V3::zero(), |sum, b| sum + rows.between(a, b) * z[b]);
                assert!((V3::of(found) - wanted).length() < 1e-12 * wanted.length(), "{found:?}, wanted {wanted:?}");
            }
        }
    }

    /// `½ τ ∫ (H_ij − H_ji)²` over the pairs of a uniform gradient, and `τ ∫ (H_ij² + H_ji²)` of an hourglass pattern.
    #[test]
    fn tension_has_the_stated_energy() {
        let (edges, tau): ([f64; 3], f64) = ([2.0, 3.0, 0.5], 7.0);
        let volume: f64 = edges.iter().product();
        let p = edges.map(|h| (tau * volume).sqrt() / (4.0 * h));
        let rows = Rows { volume: [V3::<f64>::zero(); 3], tension: V3::of(p) };
        let twice_energy = |u: &dyn Fn([f64; 3]) -> [f64; 3]| {
            let at = |a: usize| V3::of(u([0, 1, 2].map(|n| (corner(a)[n] as f64 - 0.5) * edges[n])));
            let all = (0..8).flat_map(|a| (0..8).map(move |b| (a, b)));
            all.map(|(a, b)| at(a).dot(rows.between(a, b) * at(b))).sum::<f64>()
        };
        let close =
            |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-9 * wanted.max(1.0), "{found} {wanted}");
        close(twice_energy(&|x| [0.3 * x[1], 0.5 * x[0], 0.0]), 0.5 * tau * volume * 0.2 * 0.2);
        close(twice_energy(&|x| [0.4 * x[1], 0.4 * x[0] + 0.1 * x[2], 0.1 * x[1]]), 0.0);
        close(twice_energy(&|x| [0.2 * x[0], 0.3, x[2]]), 0.0);
        // u_z = xy: H_zx = y and H_zy = x, of mean squares h²/12
        close(twice_energy(&|x| [0.0, 0.0, x[0] * x[1]]), tau * volume * (4.0 + 9.0) / 12.0);
        // u_x = xyz: H_xy = xz and H_xz = xy
        close(twice_energy(&|x| [x[0] * x[1] * x[2], 0.0, 0.0]), tau * volume * (4.0 * 0.25 + 4.0 * 9.0) / 144.0);
    }
}
