//! Kernels: each is one computation on flat arrays, written twice: `name.wgsl` for the GPU and its Rust twin `name.rs`, generic over f32
//! and f64.
//!
//! A twin has the shader's name, argument names and order of operations; it documents formula, units and source. Grid kernels share one
//! parameter block, [`Params`]. Arrays over right-hand sides are `[rhs][node]`: number 0 is the unconstrained motion, 1 the contact
//! correction, the others are compliance columns. The zero quaternion marks a cell that a cut has removed; on coarse multigrid levels a
//! quaternion shorter than one scales its cell's stiffness.
//!
//! The whole project uses one corner order for hexahedra, VTK's: 0–3 counter-clockwise at the bottom, 4–7 above them.

pub mod accelerate;
pub mod advance;
pub mod ahead;
pub mod auxiliary_correction;
pub mod auxiliary_restriction;
pub mod auxiliary_rotations;
pub mod blocks;
pub mod bounds;
pub mod centres;
pub mod coarsen;
pub mod collect;
pub mod collect_product;
pub mod collected;
pub mod columns;
pub mod compensated;
pub mod converge;
pub mod cut;
pub mod defect;
pub mod deformation;
pub mod duplicate;
pub mod factor;
pub mod forces;
pub mod gather;
pub mod gathered;
pub mod holzapfel;
pub mod hyperelastic;
pub mod hyperelastic_cells;
pub mod hyperelastic_forces;
pub mod hyperelastic_tangent;
pub mod integrate;
pub mod linearised;
pub mod momentum;
pub mod mooney_rivlin;
pub mod neo_hookean;
pub mod polar;
pub mod precondition;
pub mod prescribe;
pub mod probe;
pub mod product;
pub mod prolongation;
pub mod relax;
pub mod residual;
pub mod rest_springs;
pub mod restriction;
pub mod rhs;
pub mod rotations;
pub mod scatter;
pub mod split;
pub mod split_product;
pub mod springs;
pub mod springs_blocks;
pub mod springs_product;
pub mod tetrahedra;
pub mod tetrahedra_blocks;
pub mod tetrahedra_centres;
pub mod tetrahedra_changes;
pub mod tetrahedra_deformations;
pub mod tetrahedra_domains;
pub mod tetrahedra_forces;
pub mod tetrahedra_frames;
pub mod tetrahedra_large;
pub mod tetrahedra_laws;
pub mod tetrahedra_means;
pub mod tetrahedra_plain;
pub mod tetrahedra_pressed;
pub mod tetrahedra_pressures;
pub mod tetrahedra_product;
pub mod tetrahedra_rotations;
pub mod tetrahedra_smoothed;
pub mod tetrahedra_strains;
pub mod tetrahedra_volumes;
pub mod trial_point;
pub mod update;

use crate::math::Real;

/// Text shared by all shaders: `Params`, `Thread`, corners, quaternions, reductions.
pub const COMMON: &str = include_str!("common.wgsl");

/// Complete text of a kernel: the common part, the shared texts that its bindings and calls ask for, and its own.
pub fn text(source: &Source) -> String {
    let mut out = COMMON.to_string();
    let shared = [
        ("> split: array", &[split::WGSL][..]),
        ("> rotation: array", &[linearised::WGSL][..]),
        ("> material: array", &hyperelastic::WGSL[..]),
        ("> material: array", &[hyperelastic_cells::WGSL]),
        ("> laws: array", &hyperelastic::WGSL[..]),
        ("read_write> cofactor: array", &[deformation::WGSL]),
        ("read> corner_force: array", &[collected::WGSL][..]),
        ("read> partial_residual: array", &[compensated::WGSL][..]),
        ("read_write> partial_gamma: array", &[columns::WGSL][..]),
        (" polar(", &[polar::WGSL][..]),
        ("> gradients: array", &[tetrahedra::WGSL][..]),
        ("read> tetrahedron_force: array", &[gathered::WGSL][..]),
    ];
    for (asked, texts) in shared {
        if source.wgsl.contains(asked) {
            texts.iter().for_each(|text| out = format!("{out}\n{text}"));
        }
    }
    out + "\n" + source.wgsl
}

/// Shader text with the data that naga cannot read from it.
#[derive(Debug)]
pub struct Source {
    /// Entry point and file name.
    pub name: &'static str,
    /// WGSL without the common part.
    pub wgsl: &'static str,
    /// Field names of the uniform `params`, one 4-byte scalar each, in order.
    pub params: &'static [&'static str],
}

/// Every kernel.
pub const ALL: &[&Source] = &[
    &accelerate::SOURCE,
    &advance::SOURCE,
    &ahead::SOURCE,
    &auxiliary_correction::SOURCE,
    &auxiliary_restriction::SOURCE,
    &auxiliary_rotations::SOURCE,
    &blocks::SOURCE,
    &bounds::SOURCE,
    &centres::SOURCE,
    &coarsen::SOURCE,
    &collect::SOURCE,
    &collect_product::SOURCE,
    &converge::SOURCE,
    &cut::SOURCE,
    &defect::SOURCE,
    &duplicate::SOURCE,
    &factor::SOURCE,
    &forces::SOURCE,
    &gather::SOURCE,
    &hyperelastic_forces::SOURCE,
    &hyperelastic_tangent::SOURCE,
    &integrate::SOURCE,
    &momentum::SOURCE,
    &precondition::SOURCE,
    &prescribe::SOURCE,
    &probe::SOURCE,
    &product::SOURCE,
    &prolongation::SOURCE,
    &restriction::SOURCE,
    &rhs::SOURCE,
    &rotations::SOURCE,
    &scatter::SOURCE,
    &relax::SOURCE,
    &residual::SOURCE,
    &rest_springs::SOURCE,
    &split_product::SOURCE,
    &springs::SOURCE,
    &springs_blocks::SOURCE,
    &springs_product::SOURCE,
    &tetrahedra_blocks::SOURCE,
    &tetrahedra_centres::SOURCE,
    &tetrahedra_changes::SOURCE,
    &tetrahedra_deformations::SOURCE,
    &tetrahedra_domains::SOURCE,
    &tetrahedra_forces::SOURCE,
    &tetrahedra_frames::SOURCE,
    &tetrahedra_large::SOURCE,
    &tetrahedra_laws::SOURCE,
    &tetrahedra_means::SOURCE,
    &tetrahedra_plain::SOURCE,
    &tetrahedra_pressed::SOURCE,
    &tetrahedra_pressures::SOURCE,
    &tetrahedra_product::SOURCE,
    &tetrahedra_rotations::SOURCE,
    &tetrahedra_smoothed::SOURCE,
    &tetrahedra_strains::SOURCE,
    &tetrahedra_volumes::SOURCE,
    &trial_point::SOURCE,
    &update::SOURCE,
];

macro_rules! params {
    ($(#[$doc:meta])* { $($(#[$udoc:meta])* $u:ident: u32,)* } { $($(#[$rdoc:meta])* $r:ident: real,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct Params<R> { $($(#[$udoc])* pub $u: u32,)* $($(#[$rdoc])* pub $r: R,)* }

        impl<R: Real> Params<R> {
            /// Field names in the order of [`Params::words`].
            pub const FIELDS: &'static [&'static str] = &[$(stringify!($u),)* $(stringify!($r),)*];
            /// The block as the shaders read it: one 4-byte word per field.
            pub fn words(&self) -> Vec<u32> {
                vec![$(self.$u,)* $((self.$r.f64() as f32).to_bits(),)*]
            }
            /// The same in another precision.
            pub fn rounded<S: Real>(&self) -> Params<S> {
                Params { $($u: self.$u,)* $($r: S::of(self.$r.f64()),)* }
            }
        }
    };
}

params! {
    /// Parameters of the body and the step for all grid kernels.
    {
        /// Nodes along x.
        nodes_x: u32,
        /// Nodes along y.
        nodes_y: u32,
        /// Nodes along z.
        nodes_z: u32,
        /// Number of nodes, with the duplicates (`split`).
        node_count: u32,
        /// Cells along x.
        cells_x: u32,
        /// Cells along y.
        cells_y: u32,
        /// Cells along z.
        cells_z: u32,
        /// Number of cells.
        cell_count: u32,
        /// 0 none, 1 Jacobi, 2 block, 3 column (the multigrid smoother works by columns).
        preconditioner: u32,
        /// 0 linear, 1 corotational, 2 and 3 hyperelastic ([`hyperelastic::STIFFENED`], [`hyperelastic::NEWTON`]).
        corotational: u32,
        /// Number of right-hand sides of the running solve.
        rhs_count: u32,
        /// First right-hand side of the running solve.
        first_rhs: u32,
        /// Partial sums of the product per right-hand side.
        product_groups: u32,
        /// 1: the smoother starts from zero.
        fresh: u32,
        /// 1: compensated sums work on this device (`probe`).
        compensated: u32,
        /// Always 0, unknown to the shader compiler.
        zero: u32,
        /// Columns of duplicate nodes, in addition to the grid's.
        extra_columns: u32,
        /// Capacity of the table for split cells.
        split_cells: u32,
        /// Capacity of the table for nodes of split cells.
        touched_nodes: u32,
        /// Number of tetrahedra.
        tetrahedron_count: u32,
        /// Number of domains of smoothed tetrahedra.
        domain_count: u32,
        /// 1: strains of tetrahedra are those of all displacements, 0: of increments ([`tetrahedra`]).
        total: u32,
        /// Padding to a multiple of 16 bytes.
        pad: u32,
        /// Padding.
        pad_1: u32,
        /// Padding.
        pad_2: u32,
    }
    {
        /// Factor of `M` in `A`: `(1 + h r_M)/h²` in implicit Euler, 1/s² (others: `bodies::Step`).
        inertia: real,
        /// Factor of `K` in `A`: `1 + r_K/h` in implicit Euler.
        stiffness_factor: real,
        /// `h`, s.
        step: real,
        /// Coefficient of `M v/h` in the right-hand side: 1 in implicit Euler.
        momentum_factor: real,
        /// Velocity factor: change of velocity over a step relative to the change to the mean velocity; 1 in implicit Euler.
        velocity_factor: real,
        /// Lead time of the displacements at which elastic forces are evaluated, s (`ahead`).
        lead_time: real,
        /// Gravity, m/s².
        gravity_x: real,
        /// Gravity, m/s².
        gravity_y: real,
        /// Gravity, m/s².
        gravity_z: real,
        /// Factor of the smoother's previous change.
        keep: real,
        /// Factor of `M⁻¹ r` in the smoother.
        gain: real,
    }
}

/// Threads per workgroup of every kernel but `advance` and `converge`.
pub const GROUP: u32 = 64;

/// Number of z-columns that a thread of the CPU path processes together.
pub const PART: usize = 32;

/// Minimum number of elements per thread of the CPU path; fewer are not worth distributing: with 2048, corrections of the incision's 3750
/// nodes took 1.3 times as long on two threads as on one.
pub const PARALLEL: usize = 8192;

/// Splits a nodal array into parts of [`PART`] z-columns for threads: `[part × level]` pieces, and the number of levels.
pub fn by_columns<T>(array: &mut [T], columns: usize) -> (Vec<&mut [T]>, usize) {
    debug_assert!(array.len().is_multiple_of(columns), "a node of each column at each level");
    let (parts, levels) = (columns.div_ceil(PART), (array.len() / columns).max(1));
    let mut pieces: Vec<&mut [T]> = vec![];
    pieces.resize_with(parts * levels, Default::default);
    for (k, level) in array.chunks_exact_mut(columns).enumerate() {
        for (part, piece) in level.chunks_mut(PART).enumerate() {
            pieces[part * levels + k] = piece;
        }
    }
    (pieces, levels)
}

/// Minimum number of nodes of the columns that a thread solves, which cost 5 ns each. Products and column solves follow each other at once:
/// where both are split, the other threads stay awake between them. On two threads 3750 nodes take 0.86 of the time, with columns alone 1.05.
const COLUMN_NODES: usize = 1500;

/// Number of parts of [`by_columns`] that a thread takes at least.
pub fn parts_at_once<R>(params: &Params<R>) -> usize {
    (COLUMN_NODES / (PART * params.nodes_z as usize)).max(1)
}

/// Offset (0 or 1) of a corner along x, y, z.
pub fn corner(a: usize) -> [usize; 3] {
    [(a + 1) >> 1 & 1, a >> 1 & 1, a >> 2]
}

impl<R: Real> Params<R> {
    /// Grid coordinates of a node.
    pub fn node_at(&self, node: usize) -> [usize; 3] {
        let (x, y) = (self.nodes_x as usize, self.nodes_y as usize);
        [node % x, node / x % y, node / (x * y)]
    }
    /// Node id at grid coordinates.
    pub fn node_id(&self, c: [usize; 3]) -> usize {
        c[0] + self.nodes_x as usize * (c[1] + self.nodes_y as usize * c[2])
    }
    /// Cell id at grid coordinates.
    pub fn cell_id(&self, c: [usize; 3]) -> usize {
        c[0] + self.cells_x as usize * (c[1] + self.cells_y as usize * c[2])
    }
    /// Grid coordinates of a cell.
    pub fn cell_at(&self, cell: usize) -> [usize; 3] {
        let (x, y) = (self.cells_x as usize, self.cells_y as usize);
        [cell % x, cell / x % y, cell / (x * y)]
    }
    /// Ids of the eight corners of a cell.
    pub fn corners(&self, cell: usize) -> [usize; 8] {
        let c = self.cell_at(cell);
        std::array::from_fn(|a| {
            let o = corner(a);
            self.node_id([c[0] + o[0], c[1] + o[1], c[2] + o[2]])
        })
    }
    /// Length of the array of rotations: a quaternion for each cell, and three rows for each hyperelastic one ([`linearised`]).
    pub fn frames(&self) -> usize {
        let rows = if self.corotational >= linearised::HYPERELASTIC { 4 } else { 1 };
        rows * self.cell_count as usize
    }

    /// Cells along x, y, z of the next coarser level: pairs along x and y; the last one stays single if the number is odd.
    pub fn coarse_cells(&self) -> [usize; 3] {
        [self.cells_x.div_ceil(2) as usize, self.cells_y.div_ceil(2) as usize, self.cells_z as usize]
    }
    /// Cell whose corner `a` is the node at `c`, if it is in the grid.
    pub fn cell_below(&self, c: [usize; 3], a: usize) -> Option<usize> {
        let o = corner(a);
        let at = [c[0].checked_sub(o[0])?, c[1].checked_sub(o[1])?, c[2].checked_sub(o[2])?];
        let inside = at[0] < self.cells_x as usize && at[1] < self.cells_y as usize && at[2] < self.cells_z as usize;
        inside.then(|| self.cell_id(at))
    }
}
