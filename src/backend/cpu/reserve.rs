//! Storage for the nodes that a cut may duplicate.
//!
//! The length of nodal arrays is the number of nodes in use ([`crate::kernels::split`]), so without a cut the reserve costs no time. Their
//! capacity includes the reserve, so a cut allocates none.

use super::CpuBackend;
use crate::math::{Real, V4, round};

/// Zeros for the nodes in use, with capacity for all.
pub(super) fn zeros<R: Real>(in_use: usize, all: usize) -> Vec<V4<R>> {
    let mut values = Vec::with_capacity(all);
    values.resize(in_use, [R::zero(); 4]);
    values
}

/// Values of the nodes in use, with capacity for all.
pub(super) fn rounded<R: Real>(all: &[V4<f64>], in_use: usize) -> Vec<V4<R>> {
    let mut values = Vec::with_capacity(all.len());
    values.extend(all.iter().take(in_use).map(round));
    values
}

/// Re-strides `[rhs][node]` for more nodes; the new ones are zero.
pub(super) fn spread<R: Real>(values: &mut Vec<V4<R>>, from: usize, to: usize) {
    let rhs_count = values.len() / from;
    values.resize(rhs_count * to, [R::zero(); 4]);
    for rhs in (0..rhs_count).rev() {
        values.copy_within(rhs * from..(rhs + 1) * from, rhs * to);
        values[rhs * to + from..(rhs + 1) * to].fill([R::zero(); 4]);
    }
}

impl<R: Real> CpuBackend<R> {
    /// Extends the arrays to the nodes in use by the table of split nodes.
    pub(super) fn take_reserve(&mut self) {
        let (from, to) = (self.node_count, self.system.nodes_in_use(&self.params));
        if to <= from {
            return;
        }
        let of_solver = [&mut self.x, &mut self.r, &mut self.p, &mut self.s, &mut self.z, &mut self.w];
        let of_state = [&mut self.u, &mut self.v, &mut self.ahead, &mut self.mean_v, &mut self.f];
        let of_body = [&mut self.dofs, &mut self.masses, &mut self.load];
        for values in of_solver.into_iter().chain(of_state).chain(of_body) {
            spread(values, from, to);
        }
        for finest in self.space.iter_mut().filter_map(|space| space.levels.first_mut()) {
            for values in [&mut finest.r, &mut finest.z, &mut finest.d, &mut finest.w] {
                spread(values, from, to);
            }
        }
        self.node_count = to;
        self.params.node_count = to as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_hand_sides_move_apart_and_what_is_new_is_zero() {
        let node = |n: usize| [n as f64, 0.0, 0.0, 1.0];
        let mut values: Vec<V4<f64>> = (0..6).map(node).collect();
        values.reserve(9);
        let room = values.as_ptr();
        spread(&mut values, 2, 5);
        let zero = [0.0; 4];
        let wanted: Vec<V4<f64>> =
            (0..3).flat_map(|rhs| [node(2 * rhs), node(2 * rhs + 1), zero, zero, zero]).collect();
        assert_eq!(values, wanted);
        assert_eq!(values.as_ptr(), room, "what was reserved is taken, nothing allocated");
    }
}
