//! Solution of the factored columns ([`super::factor`]) for a load, with a dot product: shared by `precondition` and `relax`.
//!
//! Forward: `y_k = l_k − G_{k−1}ᵀ y_{k−1}`; backward: `s_k = D'_k⁻¹ y_k − G_k s_{k+1}`. The kernel supplies the load `l` and the use of the
//! solution `s`, as functions of one node.
//! Units: r l y N, s m.

use super::blocks::unpack;
use super::{Levels, PART};
use crate::math::{Real, V3, V4};

/// Text of the shaders.
pub const WGSL: &str = include_str!("columns.wgsl");

/// Solves the columns of one part ([`super::by_columns`]); returns the sum of `r·z`.
pub fn solve_columns<R: Real>(
    columns: usize,                                               // of all parts
    part: usize,                                                  // its number
    block: &[V4<R>],                                              // [node × 4] packed D'⁻¹, G
    r: &[V4<R>],                                                  // [node] N
    y: &mut Levels<V4<R>>,                                        // [level][column of the part] N
    pushed: impl Fn(V3<R>, V3<R>) -> V3<R>,                       // load, of r and what was in y
    mut take: impl FnMut([usize; 2], &mut V4<R>, V3<R>) -> V3<R>, // z, of level and column, its number in y, solution
) -> R {
    let mut carried = [V3::zero(); PART]; // G_{k−1}ᵀ y_{k−1}
    // forward substitution, bottom to top
    for (k, level) in y.iter_mut().enumerate() {
        for (c, y) in level.iter_mut().enumerate() {
            let i = part * PART + k * columns + c;
            let own = pushed(V3::from4(r[i]), V3::from4(*y)) - carried[c];
            *y = own.pad(R::zero());
            carried[c] = unpack(&block[i * 4..i * 4 + 4]).g.transpose() * own;
        }
    }
    // backward substitution, top to bottom
    let mut above = [V3::zero(); PART];
    let mut gamma = R::zero();
    for (k, level) in y.iter_mut().enumerate().rev() {
        for (c, y) in level.iter_mut().enumerate() {
            let i = part * PART + k * columns + c;
            let own = unpack(&block[i * 4..i * 4 + 4]);
            above[c] = own.d * V3::from4(*y) - own.g * above[c];
            gamma += V3::from4(r[i]).dot(take([k, c], y, above[c]));
        }
    }
    gamma
}
