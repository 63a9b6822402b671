//! The seam between a kind of deformable body and a device: its arrays by the names that kernels use, and the dispatches of its forces, its
//! product and its preconditioner.
//!
//! A dispatch takes a fixed number of threads, or one for each node or column that is in use. What no copy has been taken for yet
//! ([`crate::kernels::split`]) is at the end of all arrays over nodes. Nothing runs there, so what the first step finds there stays: zeros in
//! partial sums and vectors, and in the columns' blocks the identity, which factors to itself; a workgroup that reaches past the last
//! node in use meets that.

use crate::error::Result;
use crate::gpu::{Bound, Buffer, Gpu};
use crate::kernels::blocks::{Block, pack};
use crate::kernels::bounds::tile_count;
use crate::kernels::{GROUP, Params, Source};
use crate::math::{M3, V4};

/// A kernel with its arrays, and how many threads it takes.
pub type Dispatch = (Bound, usize);

/// Arrays by name; of two with one name the later counts.
#[derive(Clone, Default)]
pub struct Arrays(Vec<(&'static str, Buffer)>);

impl Arrays {
    /// Arrays under their own names.
    pub fn of(buffers: &[Buffer]) -> Self {
        Self(buffers.iter().map(|b| (b.name, b.clone())).collect())
    }
    /// These and more.
    pub fn joined(&self, more: &Self) -> Self {
        Self(self.0.iter().chain(&more.0).cloned().collect())
    }
    /// One array under another name.
    pub fn one(name: &'static str, buffer: &Buffer) -> Self {
        Self(vec![(name, buffer.clone())])
    }
    /// The array of a name.
    pub fn get(&self, name: &str) -> Option<Buffer> {
        self.0.iter().rev().find(|(n, _)| *n == name).map(|(_, buffer)| buffer.clone())
    }
    /// Binds what a kernel names.
    ///
    /// # Errors
    /// When the kernel does not compile.
    pub fn bind(&self, gpu: &Gpu, source: &Source, more: &[(&'static str, &Buffer)]) -> Result<Bound> {
        let list: Vec<(&str, &Buffer)> =
            self.0.iter().map(|(name, buffer)| (*name, buffer)).chain(more.iter().copied()).collect();
        gpu.bind_from(source, &list)
    }
}

/// Makes buffers and adds up their bytes.
pub struct Maker<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// Of all that was made.
    pub bytes: u64,
    /// What changes with the first cut.
    pub reserved: Reserved,
}

/// What does not know of a reserve of copies until the first of them is taken.
#[derive(Default)]
pub struct Reserved {
    /// Parameter blocks, as they will be.
    pub blocks: Vec<(Params<f32>, Buffer)>,
    /// Sums over columns, which are counted otherwise then.
    pub sums: Vec<Buffer>,
}

impl<'a> Maker<'a> {
    /// Nothing made yet.
    pub fn new(gpu: &'a Gpu) -> Self {
        Self { gpu, bytes: 0, reserved: Reserved::default() }
    }
    /// A parameter block. Until the first cut it knows of no reserve of copies, so that no kernel looks for one.
    pub fn params(&mut self, params: &Params<f32>) -> Buffer {
        let buffer = self.uniform("params", 0, &Params { extra_columns: 0, ..*params }.words());
        if params.extra_columns > 0 {
            self.reserved.blocks.push((*params, buffer.clone()));
        }
        buffer
    }
    /// A uniform block.
    pub fn uniform(&mut self, name: &'static str, bytes: usize, data: &[u32]) -> Buffer {
        let buffer = self.gpu.uniform(name, bytes, data);
        self.bytes += buffer.bytes;
        buffer
    }
    /// Zeroed vectors.
    ///
    /// # Errors
    /// When they pass a limit of the adapter.
    pub fn vec4(&mut self, name: &'static str, count: usize) -> Result<Buffer> {
        let buffer = self.gpu.array::<V4<f32>>(name, count)?;
        self.bytes += buffer.bytes;
        Ok(buffer)
    }
    /// An array of these values.
    ///
    /// # Errors
    /// When it passes a limit of the adapter.
    pub fn of<T: bytemuck::NoUninit>(&mut self, name: &'static str, data: &[T]) -> Result<Buffer> {
        let buffer = self.gpu.array_of(name, data)?;
        self.bytes += buffer.bytes;
        Ok(buffer)
    }
}

/// Arrays and kernels of a body on a device. `arrays` are those of the whole body by name, `main` is its parameter block.
pub trait Recorded {
    /// Its own arrays that kernels share by name.
    fn shared(&self) -> Arrays;
    /// `[element]` rotations of cells, or law of springs.
    fn elements(&self) -> Buffer;
    /// `[node]` velocities that a consistent mass sees; none of another.
    fn mean_velocities(&self) -> Option<Buffer>;
    /// Elastic forces at `at`, which is where the body is unless the step is explicit.
    ///
    /// # Errors
    /// When a kernel does not compile, as every method here, or an array passes a limit of the adapter.
    fn forces(&self, gpu: &Gpu, arrays: &Arrays, main: &Buffer, at: Option<&Buffer>) -> Result<Vec<Dispatch>>;
    /// Diagonal and sub-diagonal blocks of `A` along columns, with `more` in place of the body's arrays.
    fn blocks(&self, gpu: &Gpu, arrays: &Arrays, more: &[(&'static str, &Buffer)]) -> Result<Bound>;
    /// `w = A z` for the slots that the parameters say.
    fn product(
        &mut self,
        made: &mut Maker,
        arrays: &Arrays,
        params: &Params<f32>,
        main: &Buffer,
    ) -> Result<Vec<Dispatch>>;
    /// Makes what the preconditioner has beside the columns' factors, and lists what refreshes it in each step; `sums` are the arrays of
    /// the conjugate gradients that all levels share.
    fn refresh(
        &mut self,
        made: &mut Maker,
        arrays: &Arrays,
        sums: &Arrays,
        params: &Params<f32>,
        main: &Buffer,
    ) -> Result<Vec<Dispatch>>;
    /// `z = M⁻¹ r` by more than the columns' factors; none where these are all.
    fn precondition(&self, made: &mut Maker, params: &Params<f32>) -> Result<Option<Vec<Dispatch>>>;
    /// Displacements of the points that segments end at, of the body's nodes at `u`; none where these are the nodes themselves.
    fn points(&self, gpu: &Gpu, main: &Buffer, u: &Buffer, to: &Buffer) -> Result<Option<Dispatch>>;
    /// Table of split nodes as it is at first; none where no node can be split.
    fn split(&self) -> Option<(Buffer, Vec<u32>)>;
    /// What a law that is not linear needs beside, once all dispatches were asked for; `x` has the solution.
    fn nonlinear(&mut self, made: &mut Maker, arrays: &Arrays, x: &Buffer) -> Result<Option<NonlinearLaw>>;
}

/// Arrays and kernels of a law that is not linear.
pub struct NonlinearLaw {
    /// Share of the change of forces over a step that it sees.
    pub end_share: f64,
    /// `r_K/h`
    pub damping: f64,
    /// Parameter blocks of the small-strain products, which have `damping` and what is added to tangents that are not positive.
    pub blocks: Vec<(Params<f32>, Buffer)>,
    /// `[cell]` J
    pub energy: Buffer,
    /// The step's right-hand side, `[node]` N.
    pub b: Buffer,
    /// What Newton's method needs; none where a step is one linearisation.
    pub search: Option<Search>,
}

/// Arrays and kernels that say what a point on the way to a step's solution is worth.
pub struct Search {
    /// Parameter block with the share of the direction.
    pub gain: Buffer,
    /// In their order.
    pub kernels: Vec<Dispatch>,
    /// `[node]` increment where it stands, and what was tried, m.
    pub dx: [Buffer; 2],
    /// `[node]` −∇Π of both, N.
    pub rest: [Buffer; 2],
    /// `[group]` `−∇Π·e`, J.
    pub promise: Buffer,
    /// `[group]` share of Π, J, and `|∇Π|²`, N².
    pub balance: Buffer,
    /// `[group]` squares of the step's load, N².
    pub load: Buffer,
}

/// Threads of a dispatch over the nodes in use, copies too.
const NODES: usize = usize::MAX;
/// The same over columns.
const COLUMNS: usize = usize::MAX - 1;
/// The same over the nodes of split cells.
pub const TOUCHED: usize = usize::MAX - 2;

/// Threads of a dispatch over the nodes of a body or of a level.
pub fn over_nodes(params: &Params<f32>) -> usize {
    if params.extra_columns > 0 { NODES } else { params.node_count as usize }
}

/// The same over columns.
pub fn over_columns(params: &Params<f32>) -> usize {
    if params.extra_columns > 0 { COLUMNS } else { params.columns() }
}

/// What of a body is in use.
#[derive(Clone, Copy)]
pub struct InUse {
    /// Nodes, copies too.
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
pub fn untouched(nodes: usize) -> Vec<V4<f32>> {
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
