//! How many threads a dispatch takes: a fixed number, or one for each node or column that is in use.
//!
//! What no copy has been taken for yet ([`crate::kernels::split`]) is at the end of all arrays over nodes. Nothing runs there, so what the
//! first step finds there stays: zeros in partial sums and vectors, and in the columns' blocks the identity, which factors to itself; a
//! workgroup that reaches past the last node in use meets that.

use crate::kernels::blocks::{Block, pack};
use crate::kernels::bounds::tile_count;
use crate::kernels::{GROUP, Params};
use crate::math::{M3, V4};

/// Threads of a dispatch over the nodes in use, copies too.
const NODES: usize = usize::MAX;
/// The same over columns.
const COLUMNS: usize = usize::MAX - 1;
/// The same over the nodes of split cells.
pub(super) const TOUCHED: usize = usize::MAX - 2;

/// Threads of a dispatch over the nodes of a body or of a level.
pub(super) fn over_nodes(params: &Params<f32>) -> usize {
    if params.extra_columns > 0 { NODES } else { params.node_count as usize }
}

/// The same over columns.
pub(super) fn over_columns(params: &Params<f32>) -> usize {
    if params.extra_columns > 0 { COLUMNS } else { params.columns() }
}

/// What of a body is in use.
#[derive(Clone, Copy)]
pub(super) struct InUse {
    pub nodes: usize,
    columns: usize,
    touched: usize,
    tiles: usize,
}

impl InUse {
    /// By the table of split nodes.
    pub fn new(params: &Params<f32>, split: &[u32]) -> Self {
        let nodes = params.nodes_in_use(split);
        Self {
            nodes,
            columns: params.columns() + params.extra_in_use(split),
            touched: if split.is_empty() { 0 } else { params.touched(split).len() },
            tiles: tile_count(&Params { node_count: nodes as u32, ..*params }),
        }
    }

    /// Threads of a dispatch.
    pub fn threads(&self, of: usize) -> usize {
        match of {
            NODES => self.nodes,
            COLUMNS => self.columns,
            TOUCHED => self.touched,
            fixed => fixed,
        }
    }

    /// Threads of the boxes of the tiles, and the bytes that they leave.
    pub fn tiles(&self) -> (usize, u64) {
        (self.tiles * GROUP as usize, self.tiles as u64 * 32)
    }
}

/// Blocks of columns that nothing has run over, of so many nodes.
pub(super) fn untouched(nodes: usize) -> Vec<V4<f32>> {
    std::iter::repeat_n(pack(Block { d: M3::identity(), g: M3::zero() }), nodes).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::split::{BUNDLE, NONE};

    #[test]
    fn an_uncut_body_is_launched_as_one_without_a_reserve() {
        let grid = Params::<f32> { nodes_x: 9, nodes_y: 7, nodes_z: 4, cells_x: 8, cells_y: 6, ..Params::default() };
        let alone = Params { node_count: 252, ..grid };
        let extra = BUNDLE as u32 + 8;
        let reserved = Params { node_count: 252 + 4 * extra, extra_columns: extra, ..grid };
        let mut table = vec![NONE; reserved.layout().words];
        let of = |params: &Params<f32>, table: &[u32]| {
            let in_use = InUse::new(params, table);
            (in_use.threads(over_nodes(params)), in_use.threads(over_columns(params)), in_use.tiles())
        };
        assert_eq!(of(&reserved, &table), of(&alone, &[]));
        assert_eq!(of(&alone, &[]), (252, 63, (64, 32)));
        table[0] = 5; // the first copy's column: its bundle comes with it
        assert_eq!(of(&reserved, &table), (252 + 4 * BUNDLE, 63 + BUNDLE, (64 * 5, 32 * 5)));
    }
}
