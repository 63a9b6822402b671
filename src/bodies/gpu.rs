//! Interface between a kind of deformable body and a device: arrays under the names that kernels use, and the dispatches of forces, product
//! and preconditioner.
//!
//! A dispatch has a fixed number of threads, or one per node or column in use. Unused duplicate nodes ([`crate::kernels::split`]) are at
//! the end of all nodal arrays. No kernel runs there, so their initial values persist: zeros in partial sums and vectors, and identity
//! blocks in the columns, which are their own factors. A workgroup that extends beyond the last node in use reads these values.

use super::Removal;
use crate::error::Result;
use crate::gpu::{Bound, Buffer, Gpu};
use crate::kernels::blocks::{Block, pack};
use crate::kernels::bounds::tile_count;
use crate::kernels::{GROUP, Params, Source};
use crate::math::{M3, V4};

/// Bound kernel and its number of threads.
pub type Dispatch = (Bound, usize);

/// Arrays by name; if a name occurs twice, the later entry is used.
#[derive(Clone, Default)]
pub struct Arrays(Vec<(&'static str, Buffer)>);

impl Arrays {
    /// Arrays under their own names.
    pub fn of(buffers: &[Buffer]) -> Self {
        Self(buffers.iter().map(|b| (b.name, b.clone())).collect())
    }
    /// Appends more arrays.
    pub fn joined(&self, more: &Self) -> Self {
        Self(self.0.iter().chain(&more.0).cloned().collect())
    }
    /// One array under another name.
    pub fn one(name: &'static str, buffer: &Buffer) -> Self {
        Self(vec![(name, buffer.clone())])
    }
    /// Array with a given name.
    pub fn get(&self, name: &str) -> Option<Buffer> {
        self.0.iter().rev().find(|(n, _)| *n == name).map(|(_, buffer)| buffer.clone())
    }
    /// Binds the arrays that a kernel names.
    ///
    /// # Errors
    /// If the kernel does not compile.
    pub fn bind(&self, gpu: &Gpu, source: &Source, more: &[(&'static str, &Buffer)]) -> Result<Bound> {
        let list: Vec<(&str, &Buffer)> =
            self.0.iter().map(|(name, buffer)| (*name, buffer)).chain(more.iter().copied()).collect();
        gpu.bind_from(source, &list)
    }
}

/// Allocates buffers and counts their bytes.
pub struct Maker<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// Total size of the buffers, bytes.
    pub bytes: u64,
    /// Buffers that change at the first cut.
    pub reserved: Reserved,
}

/// Buffers that ignore the reserve of duplicate nodes until the first one is used.
#[derive(Default)]
pub struct Reserved {
    /// Parameter blocks with their values after the first cut.
    pub blocks: Vec<(Params<f32>, Buffer)>,
    /// Partial sums over columns, whose number changes at the first cut.
    pub sums: Vec<Buffer>,
}

impl<'a> Maker<'a> {
    /// No buffers yet.
    pub fn new(gpu: &'a Gpu) -> Self {
        Self { gpu, bytes: 0, reserved: Reserved::default() }
    }
    /// Parameter block. Until the first cut it declares no duplicate columns, so kernels do not search for them.
    pub fn params(&mut self, params: &Params<f32>) -> Buffer {
        let buffer = self.uniform("params", 0, &Params { extra_columns: 0, ..*params }.words());
        if params.extra_columns > 0 {
            self.reserved.blocks.push((*params, buffer.clone()));
        }
        buffer
    }
    /// Uniform block.
    pub fn uniform(&mut self, name: &'static str, bytes: usize, data: &[u32]) -> Buffer {
        let buffer = self.gpu.uniform(name, bytes, data);
        self.bytes += buffer.bytes;
        buffer
    }
    /// Zeroed vectors.
    ///
    /// # Errors
    /// If they exceed a limit of the adapter.
    pub fn vec4(&mut self, name: &'static str, count: usize) -> Result<Buffer> {
        self.zeros::<V4<f32>>(name, count)
    }
    /// Zeroed array.
    ///
    /// # Errors
    /// If it exceeds a limit of the adapter.
    pub fn zeros<T: bytemuck::NoUninit>(&mut self, name: &'static str, count: usize) -> Result<Buffer> {
        let buffer = self.gpu.array::<T>(name, count)?;
        self.bytes += buffer.bytes;
        Ok(buffer)
    }
    /// Array of `count` values of the size of the grid, made only where the device stores them ([`Gpu::array_with`]).
    ///
    /// # Errors
    /// If it exceeds a limit of the adapter.
    pub fn with<T: bytemuck::NoUninit>(
        &mut self,
        name: &'static str,
        count: usize,
        data: impl FnOnce() -> Vec<T>,
    ) -> Result<Buffer> {
        let buffer = self.gpu.array_with(name, count, data)?;
        self.bytes += buffer.bytes;
        Ok(buffer)
    }
    /// Array with the given values.
    ///
    /// # Errors
    /// If it exceeds a limit of the adapter.
    pub fn of<T: bytemuck::NoUninit>(&mut self, name: &'static str, data: &[T]) -> Result<Buffer> {
        let buffer = self.gpu.array_of(name, data)?;
        self.bytes += buffer.bytes;
        Ok(buffer)
    }
}

/// Arrays and kernels of a body on a device. `arrays` are those of the whole body by name, `main` is its parameter block.
pub trait Recorded: Send {
    /// Arrays of this kind that kernels share by name.
    fn shared(&self) -> Arrays;
    /// `[element]` rotations of cells, or laws of springs; `None` where elements have no state.
    fn elements(&self) -> Option<Buffer>;
    /// `[node]` velocities for a consistent mass; `None` for other masses.
    fn mean_velocities(&self) -> Option<Buffer>;
    /// Elastic forces at `at`; `None` for the current displacements, which all but explicit steps use.
    ///
    /// # Errors
    /// Here and in every method: if a kernel does not compile or an array exceeds a limit of the adapter.
    fn forces(&self, gpu: &Gpu, arrays: &Arrays, main: &Buffer, at: Option<&Buffer>) -> Result<Vec<Dispatch>>;
    /// Elastic forces at `at` of a hyperelastic law whose steps are linearised, in `to`; afterwards the linearisation is as it was. `None` for
    /// other laws.
    fn forces_of_law(
        &self,
        _made: &mut Maker,
        _arrays: &Arrays,
        _at: &Buffer,
        _to: &Buffer,
    ) -> Result<Option<Vec<Dispatch>>> {
        Ok(None)
    }
    /// Diagonal and sub-diagonal blocks of `A` along z-columns; `more` overrides arrays of the body.
    fn blocks(&self, gpu: &Gpu, arrays: &Arrays, more: &[(&'static str, &Buffer)]) -> Result<Bound>;
    /// `w = A z` for the right-hand sides that the parameters select.
    fn product(
        &mut self,
        made: &mut Maker,
        arrays: &Arrays,
        params: &Params<f32>,
        main: &Buffer,
    ) -> Result<Vec<Dispatch>>;
    /// Creates the arrays of the preconditioner besides the factored columns and returns the dispatches that update it in each step; `_sums`
    /// are the arrays of the conjugate gradients that all levels share.
    fn refresh(
        &mut self,
        _made: &mut Maker,
        _arrays: &Arrays,
        _sums: &Arrays,
        _params: &Params<f32>,
        _main: &Buffer,
    ) -> Result<Vec<Dispatch>> {
        Ok(vec![])
    }
    /// `z = M⁻¹ r` where the preconditioner is more than the factored columns; `None` otherwise.
    fn precondition(&self, _made: &mut Maker, _params: &Params<f32>) -> Result<Option<Vec<Dispatch>>> {
        Ok(None)
    }
    /// Displacements of the segments' end points from the nodal displacements `_u`; `None` where the end points are nodes.
    fn points(&self, _gpu: &Gpu, _main: &Buffer, _u: &Buffer, _to: &Buffer) -> Result<Option<Dispatch>> {
        Ok(None)
    }
    /// Table of split nodes with its initial values, of tetrahedra the list of their corners; `None` where no node can be split.
    fn split(&self) -> Option<(Buffer, Vec<u32>)> {
        None
    }
    /// Has arrays of its own follow a cut, after all earlier commands were submitted.
    fn take(&self, _gpu: &Gpu, _removal: &Removal) {}
    /// Arrays of a nonlinear law, requested after all dispatches; `_x` holds the solution.
    fn nonlinear(&mut self, _made: &mut Maker, _arrays: &Arrays, _x: &Buffer) -> Result<Option<NonlinearLaw>> {
        Ok(None)
    }
}

/// Arrays and kernels of a nonlinear law.
pub struct NonlinearLaw {
    /// `τ` ([`crate::bodies::Step::elastic_at`]).
    pub elastic_at: f64,
    /// `r_K/h`
    pub damping: f64,
    /// Parameter blocks of the small-strain products: their factor is `damping` plus the shift for indefinite tangents.
    pub blocks: Vec<(Params<f32>, Buffer)>,
    /// Parameter blocks of the sums of tangent products: their factor is `elastic_at`.
    pub sums: Vec<(Params<f32>, Buffer)>,
    /// `[cell]` J
    pub energy: Buffer,
    /// The step's right-hand side, `[node]` N.
    pub b: Buffer,
    /// What Newton's method needs.
    pub search: Search,
}

/// Arrays and kernels that evaluate a trial point of the line search.
pub struct Search {
    /// Parameter block with the step length.
    pub gain: Buffer,
    /// Kernels, in order.
    pub kernels: Vec<Dispatch>,
    /// `[node]` increment at the current and at the trial point, m.
    pub dx: [Buffer; 2],
    /// `[node]` residual −∇Π at both points, N.
    pub residual_force: [Buffer; 2],
    /// `[group]` predicted decrease `−∇Π·e`, e the search direction, J.
    pub predicted_decrease: Buffer,
    /// `[group]` partial sums of Π, J, of `|∇Π|²`, N², and of the work of elastic forces and residual, J ([`crate::kernels::residual`]).
    pub potential_and_residual: Buffer,
    /// `[group]` partial sums of the squared load of the step, N².
    pub load: Buffer,
}

/// Thread count of a dispatch over the nodes in use, duplicates included.
const NODES: usize = usize::MAX;
/// The same over columns.
const COLUMNS: usize = usize::MAX - 1;
/// The same over nodes of split cells.
pub const TOUCHED: usize = usize::MAX - 2;

/// Thread count of a dispatch over the nodes of a body or of a level.
pub fn over_nodes(params: &Params<f32>) -> usize {
    if params.extra_columns > 0 { NODES } else { params.node_count as usize }
}

/// The same over columns.
pub fn over_columns(params: &Params<f32>) -> usize {
    if params.extra_columns > 0 { COLUMNS } else { params.columns() }
}

/// Parts of a body's arrays that are in use.
#[derive(Clone, Copy)]
pub struct InUse {
    /// Number of nodes, duplicates included.
    pub nodes: usize,
    columns: usize,
    touched: usize,
    tiles: usize,
}

impl InUse {
    /// Counts from the table of split nodes.
    pub fn new(params: &Params<f32>, split: &[u32]) -> Self {
        let nodes = params.nodes_in_use(split);
        Self {
            nodes,
            columns: params.columns() + params.extra_in_use(split),
            touched: if split.is_empty() { 0 } else { params.touched(split).len() },
            tiles: tile_count(&Params { node_count: nodes as u32, ..*params }),
        }
    }

    /// Number of threads for a thread count, which may be symbolic.
    pub fn threads(&self, of: usize) -> usize {
        match of {
            NODES => self.nodes,
            COLUMNS => self.columns,
            TOUCHED => self.touched,
            fixed => fixed,
        }
    }

    /// Number of threads for the bounding boxes of the tiles, and the size of the result, bytes.
    pub fn tiles(&self) -> (usize, u64) {
        (self.tiles * GROUP as usize, self.tiles as u64 * 32)
    }
}

/// Initial column blocks for `nodes` nodes: identity on the diagonal, zero below.
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
