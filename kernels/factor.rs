//! Factors the block-tridiagonal matrix of each z-column in place: block LDLᵀ, no pivoting (the blocks are positive definite).
//!
//! From the bottom up: `D'_k = D_k − U_{k−1}ᵀ D'_{k−1}⁻¹ U_{k−1}`, stored as `D'_k⁻¹` and `G_k = D'_k⁻¹ U_k`. With `U = 0` this inverts the
//! node blocks, so one kernel serves every preconditioner. Blocks are inverted by their own LDLᵀ, with an error of `ε cond(D')`. Cofactors
//! have an error of `ε cond(D')²`, and in f32 at ν = 0.4999 give an indefinite preconditioner.
//! Source: Golub, Van Loan 2013, section 4.5 (block tridiagonal systems).

use super::blocks::{Block, pack, unpack};
use super::columns::by_component;
use super::{PART, Params, Source, by_columns, parts_at_once};
use crate::math::{M3, Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source { name: "factor", wgsl: include_str!("factor.wgsl"), params: Params::<f32>::FIELDS };

/// Factors all columns.
pub fn factor<R: Real>(
    params: &Params<R>,
    block: &mut [V4<R>], // [node × 4] D, U in, packed; D'⁻¹, G out, by component
) {
    for (first, set) in params.column_sets() {
        factor_set(&set, &mut block[first * 4..(first + set.node_count as usize) * 4]);
    }
}

/// Inverse of a symmetric positive definite matrix: `m = L D Lᵀ`, `m⁻¹ = L⁻ᵀ D⁻¹ L⁻¹`.
pub fn inverse_of_definite<R: Real>(m: M3<R>) -> M3<R> {
    let one = R::one();
    let [a, b, c] = m.0;
    let i0 = one / a.x;
    let (l10, l20) = (b.x * i0, c.x * i0);
    let rest = c.y - l10 * c.x;
    let i1 = one / (b.y - l10 * b.x);
    let l21 = rest * i1;
    let i2 = one / (c.z - l20 * c.x - l21 * rest);
    let n20 = l10 * l21 - l20; // of L⁻¹, as −l10 and −l21
    let (yz, xz) = (-l21 * i2, n20 * i2);
    let (yy, xy) = (i1 - l21 * yz, -l10 * i1 - l21 * xz);
    let xx = i0 + l10 * l10 * i1 + n20 * xz;
    M3([V3::new(xx, xy, xz), V3::new(xy, yy, yz), V3::new(xz, yz, i2)])
}

fn factor_set<R: Real>(params: &Params<R>, block: &mut [V4<R>]) {
    let columns = params.columns();
    let one_part = |block: &mut [&mut [[V4<R>; 4]]]| {
        let mut below = [M3::zero(); PART]; // Uᵀ D'⁻¹ U of the node below
        for level in block {
            for (c, packed) in level.iter_mut().enumerate() {
                let own = unpack(packed.as_slice());
                let d = inverse_of_definite(own.d - below[c]);
                let g = d * own.g;
                below[c] = own.g.transpose() * g;
                *packed = pack(Block { d, g });
            }
            by_component(level.as_flattened_mut());
        }
    };
    let (mut pieces, levels) = by_columns(block.as_chunks_mut::<4>().0, columns);
    pieces.par_chunks_exact_mut(levels).with_min_len(parts_at_once(params)).for_each(one_part);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of `m⁻¹ m` from the identity, in f64, relative to the largest entry of the rows.
    fn off(m: M3<f32>, inverse: M3<f32>) -> f64 {
        let wide = |m: M3<f32>| M3::<f64>(m.0.map(|c| V3::of(c.f64())));
        let product = wide(inverse) * wide(m);
        let difference = |(i, c): (usize, &V3<f64>)| {
            let c = c.f64();
            (0..3).map(|j| (c[j] - f64::from(u8::from(i == j))).abs()).fold(0.0, f64::max)
        };
        product.0.iter().enumerate().map(difference).fold(0.0, f64::max)
    }

    #[test]
    fn a_block_of_a_nearly_incompressible_cell_is_inverted_in_f32() {
        // λ g gᵀ + μ I with λ/μ = 2·10⁵, as from a corner of a flat cell at ν = 0.4999
        let g = V3::new(0.3f32, 0.4, 0.866);
        let m = g.outer(g) * 2e5 + M3::identity();
        let found = off(m, inverse_of_definite(m));
        assert!(found < 0.1, "{found}");
        // cofactors cancel twice
        let by_cofactors = off(m, m.inverse());
        assert!(by_cofactors > 1.0, "{by_cofactors}");
    }
}
