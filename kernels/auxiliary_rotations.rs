//! Rotations of the cells of an auxiliary grid: of each the mean of the nodes' in it, with the length that scales the cell's stiffness
//! ([`super::coarsen`]); the zero quaternion where nothing is.

use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source {
    name: "auxiliary_rotations",
    wgsl: include_str!("auxiliary_rotations.wgsl"),
    params: Params::<f32>::FIELDS,
};

/// All cells.
pub fn auxiliary_rotations<R: Real>(
    first_of_cell: &[u32],   // [cell + 1] into in_cell
    in_cell: &[u32],         // nodes
    scale: &[R],             // [cell] length of the quaternion
    node_rotation: &[V4<R>], // [node] quaternion
    rotation: &mut [V4<R>],  // [cell] quaternion
) {
    let dot = |a: V4<R>, b: V4<R>| a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    let one_cell = |(cell, out): (usize, &mut V4<R>)| {
        let mut sum = [R::zero(); 4];
        for node in &in_cell[first_of_cell[cell] as usize..first_of_cell[cell + 1] as usize] {
            let q = node_rotation[*node as usize];
            // q and −q are the same rotation
            let sign = if dot(q, sum) < R::zero() { -R::one() } else { R::one() };
            (0..4).for_each(|n| sum[n] += q[n] * sign);
        }
        let squared = dot(sum, sum);
        let length = if squared > R::zero() { scale[cell] / squared.sqrt() } else { R::zero() };
        *out = sum.map(|c| c * length);
    };
    rotation[..scale.len()].par_iter_mut().enumerate().with_min_len(super::PARALLEL).for_each(one_cell);
}
