//! Direct solver on the CPU: assembles and factors `A` once per step. The factor replaces the preconditioner, so the conjugate gradients
//! end after one iteration (two in f32) under their usual stopping rules.
//!
//! `A = (1 + h r_M)/h² M + (1 + r_K/h) Σ_c R_c K R_cᵀ = L Lᵀ`; a fixed axis has the identity's row and column. Nodes are eliminated by
//! nested dissection: first the two halves of a box, then the plane of nodes that separates them. The sparsity pattern is that of the whole
//! grid; a removed cell leaves zeros, so the symbolic factorisation is done once.
//! Source: George 1973 (nested dissection); Ng, Peyton 1993 (left-looking supernodal Cholesky), as implemented in the crate faer.
//! Differs: separators come from the grid geometry, not from the graph; factoring takes half to three quarters of the time with approximate
//! minimum degree. One thread factors, so that the order of sums is fixed on one machine. faer selects kernels and block sizes by processor
//! and caches, so this is the one solver of the CPU path whose bits depend on the machine. L is f64 for both precisions of the CPU path: an
//! f32 factor would have an error of its rounding times the condition number of thin stiff layers on fat. Rounding its solutions costs one
//! more iteration.
//! Memory of L: 28 MB at 24×24×5 cells, 61 MB at 14×14×23, 576 MB at 32×32×23.
//! Units: r N, z m, A N/m.

use crate::bodies::{Model, Refused};
use crate::error::Result;
use crate::kernels::linearised::{HYPERELASTIC, Rows};
use crate::kernels::{Params, corner};
use crate::math::{M3, Real, V4, rotation_matrix};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use rayon::prelude::*;

/// Boxes of at most this many nodes per side are not dissected further; 2 and 4 take as long, 6 up to a third longer.
const UNDIVIDED: usize = 3;

/// Smallest accepted pivot, relative to the diagonal entry of its row; below it is rounding error. A free body without mass leaves 1e-14
/// and less; constrained skin of Poisson 0.499 with an infinite step leaves 5e-4. A larger value rejects long slender bodies, a smaller one
/// accepts free bodies.
const SMALLEST_PIVOT: f64 = 1e-12;

/// Sparsity pattern of `A`: its lower half by columns, in elimination order.
pub struct Pattern {
    /// `[node]` position in the elimination order; row `3 permutation + axis`
    pub permutation: Vec<u32>,
    /// `[position]` node
    pub node: Vec<u32>,
    /// `[row + 1]` first entry of each column
    pub first: Vec<usize>,
    /// `[entry]` row, ascending in each column
    pub row: Vec<usize>,
}

impl Pattern {
    /// Pattern of a whole grid.
    pub fn new(params: &Params<f64>) -> Self {
        // elimination order and its inverse
        let size = [params.nodes_x, params.nodes_y, params.nodes_z].map(|n| n as usize);
        let mut node = vec![];
        dissect(params, [0; 3], size, &mut node);
        let mut permutation = vec![0; node.len()];
        node.iter().enumerate().for_each(|(p, i)| permutation[*i as usize] = p as u32);
        // rows of each column: the node itself and its later neighbours
        let (mut first, mut row) = (vec![0], vec![]);
        for (p, i) in node.iter().enumerate() {
            let at = params.node_at(*i as usize);
            let [x, y, z] = [0, 1, 2].map(|n| at[n].saturating_sub(1)..(at[n] + 2).min(size[n]));
            let around = z.flat_map(|k| {
                y.clone().flat_map({
                    let x = x.clone();
                    move |j| x.clone().map(move |i| [i, j, k])
                })
            });
            let mut later: Vec<usize> =
                around.map(|c| permutation[params.node_id(c)] as usize).filter(|q| *q > p).collect();
            later.sort_unstable();
            for axis in 0..3 {
                row.extend(3 * p + axis..3 * p + 3);
                row.extend(later.iter().flat_map(|q| 3 * q..3 * q + 3));
                first.push(row.len());
            }
        }
        Self { permutation, node, first, row }
    }

    /// Assembles the entries of `A`, N/m.
    pub fn assemble(
        &self,
        params: &Params<f64>,
        stiffness: &[M3<f64>], // [layer × 64] blocks a×8+b, N/m
        layer_of: &[u32],      // [cells_z] layer
        rotation: &[V4<f64>],  // [cell] quaternion; [cell × 3] `y`
        dofs: &[V4<f64>],      // [node] DOF mask (1 free, 0 fixed) and mass kg
        value: &mut [f64],     // [entry] N/m
    ) {
        // slice of the entries of each node's columns
        let mut rest = value;
        let mut columns = vec![];
        for p in 0..self.node.len() {
            let (own, others) = rest.split_at_mut(self.first[3 * p + 3] - self.first[3 * p]);
            columns.push(own);
            rest = others;
        }
        columns.into_par_iter().enumerate().for_each(|(p, out)| {
            let j = self.node[p] as usize;
            let at = params.node_at(j);
            let block = blocks_around(params, stiffness, layer_of, rotation, at);
            let begin = self.first[3 * p];
            for n in 0..3 {
                let column = 3 * p + n;
                for k in self.first[column]..self.first[column + 1] {
                    let (i, m) = (self.node[self.row[k] / 3] as usize, self.row[k] % 3);
                    let b = block[offset(params.node_at(i), at)].0[n].pad(0.0)[m];
                    let both_free = dofs[i][m] * dofs[j][n];
                    let [inertia, fixed] =
                        if self.row[k] == column { [params.inertia * dofs[j][3], 1.0 - dofs[j][n]] } else { [0.0; 2] };
                    out[k - begin] = (params.stiffness_factor * b + inertia) * both_free + fixed;
                }
            }
        });
    }
}

/// Nodes of a box in elimination order.
fn dissect(params: &Params<f64>, low: [usize; 3], high: [usize; 3], out: &mut Vec<u32>) {
    let length = |n: usize| high[n] - low[n];
    let across = (0..3).fold(0, |longest, n| if length(n) > length(longest) { n } else { longest });
    if length(across) <= UNDIVIDED {
        for k in low[2]..high[2] {
            for j in low[1]..high[1] {
                out.extend((low[0]..high[0]).map(|i| params.node_id([i, j, k]) as u32));
            }
        }
        return;
    }
    let middle = low[across] + length(across) / 2;
    let with = |mut corner: [usize; 3], at: usize| {
        corner[across] = at;
        corner
    };
    dissect(params, low, with(high, middle), out);
    dissect(params, with(low, middle + 1), high, out);
    dissect(params, with(low, middle), with(high, middle + 1), out);
}

/// Index of a neighbour among the 27 nodes around a node.
fn offset(neighbour: [usize; 3], at: [usize; 3]) -> usize {
    let [x, y, z] = [0, 1, 2].map(|n| neighbour[n] + 1 - at[n]);
    x + 3 * (y + 3 * z)
}

/// `Σ_c R_c K R_cᵀ` in the columns of a node, by neighbour.
fn blocks_around(
    params: &Params<f64>,
    stiffness: &[M3<f64>],
    layer_of: &[u32],
    rotation: &[V4<f64>],
    at: [usize; 3],
) -> [M3<f64>; 27] {
    let mut block = [M3::zero(); 27];
    for a in 0..8 {
        let Some(cell) = params.cell_below(at, a) else {
            continue;
        };
        let first = layer_of[at[2] - corner(a)[2]] as usize * 64;
        let r = rotation_matrix(rotation[cell]);
        let turned = r.transpose();
        let rows = (params.corotational >= HYPERELASTIC).then(|| Rows::of(params, rotation, cell));
        for b in 0..8 {
            let own = stiffness[first + 8 * b + a];
            let sum = &mut block[offset(corner(b), corner(a))];
            *sum = *sum + r * rows.map_or(own, |rows| own + rows.between(b, a)) * turned;
        }
    }
    block
}

/// System matrix of a body of hexahedra and its factor.
pub struct Direct {
    params: Params<f64>,
    stiffness: Vec<M3<f64>>,
    layer_of: Vec<u32>,
    pattern: Pattern,
    value: Vec<f64>,
    symbolic: Option<SymbolicCholesky<usize>>,
    factor: Vec<f64>,
    /// True if the factor belongs to the current state; must be reset when the state changes.
    pub current: bool,
}

impl Direct {
    /// Solver for a model's grid, not yet factored; `None` if the model does not use it.
    pub fn new(model: &Model) -> Option<Self> {
        model.hexahedra().direct.then(|| {
            let params = model.params::<f64>();
            let pattern = Pattern::new(&params);
            Self {
                params,
                stiffness: model.system_blocks(),
                layer_of: model.grid.layer_of.clone(),
                value: vec![0.0; pattern.row.len()],
                pattern,
                symbolic: None,
                factor: vec![],
                current: false,
            }
        })
    }

    /// Factors `A` for a state; the first call includes the symbolic factorisation.
    ///
    /// # Errors
    /// [`Refused::NotPositive`] with the first node whose pivot is not above its rounding; [`Refused::DirectMemory`] when there is none for L.
    pub fn factor(&mut self, rotation: &[V4<f64>], dofs: &[V4<f64>]) -> Result<()> {
        self.current = false;
        let Self { params, stiffness, layer_of, pattern, value, symbolic, factor, .. } = self;
        let no_memory = |numbers| Refused::DirectMemory { numbers };
        let size = 3 * pattern.node.len();
        let structure = SymbolicSparseColMatRef::new_checked(size, size, &pattern.first, None, &pattern.row);
        // symbolic factorisation, once
        let symbolic = match symbolic {
            Some(symbolic) => symbolic,
            None => {
                let supernodal_flop_ratio_threshold = SupernodalThreshold::FORCE_SUPERNODAL;
                let how = CholeskySymbolicParams { supernodal_flop_ratio_threshold, ..Default::default() };
                // with a given ordering, faer analyses the upper half whatever the side argument
                let upper = structure.transpose().to_col_major().map_err(|_| no_memory(pattern.row.len()))?;
                let made = factorize_symbolic_cholesky(upper.as_ref(), Side::Upper, SymmetricOrdering::Identity, how);
                symbolic.insert(made.map_err(|_| no_memory(pattern.row.len()))?)
            }
        };
        // numeric factorisation
        pattern.assemble(params, stiffness, layer_of, rotation, dofs, value);
        let count = symbolic.len_val();
        factor.try_reserve_exact(count - factor.len()).map_err(|_| no_memory(count))?;
        factor.resize(count, 0.0);
        let needed = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(needed).map_err(|_| no_memory(count))?;
        let matrix = SparseColMatRef::new(structure, &value[..]);
        let (stack, regular) = (MemStack::new(&mut memory), Default::default());
        let not_positive = |row: usize| Refused::NotPositive {
            node: params.node_at(pattern.node[row / 3] as usize),
            axis: ['x', 'y', 'z'][row % 3],
        };
        symbolic
            .factorize_numeric_llt(factor, matrix, Side::Lower, regular, Par::Seq, stack, Default::default())
            .map_err(|NonPositivePivot { index }| not_positive(index))?;
        // reject pivots of rounding size, which faer accepts
        if let Some(row) = first_bad_pivot(symbolic, factor, pattern, value) {
            return Err(not_positive(row).into());
        }
        self.current = true;
        Ok(())
    }

    /// `z = A⁻¹ r` with the factor of the last [`Direct::factor`]; returns `r·z`. May be called from any number of threads at once.
    pub fn solve<R: Real>(&self, r: &[V4<R>], z: &mut [V4<R>]) -> R {
        let symbolic = self.symbolic.as_ref().expect("a backend factors before it solves");
        let rows = |i: usize| 3 * self.pattern.permutation[i] as usize..;
        let mut x = vec![0.0; symbolic.nrows()];
        for (i, r) in r.iter().enumerate() {
            x[rows(i)].iter_mut().zip(&r[..3]).for_each(|(x, r)| *x = r.f64());
        }
        let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let column = MatMut::from_column_major_slice_mut(&mut x, symbolic.nrows(), 1);
        let stack = MemStack::new(&mut memory);
        LltRef::new(symbolic, &self.factor).solve_in_place_with_conj(Conj::No, column, Par::Seq, stack);
        let mut gamma = R::zero();
        for (i, (z, r)) in z.iter_mut().zip(r).enumerate() {
            let x = &x[rows(i)][..3];
            *z = [R::of(x[0]), R::of(x[1]), R::of(x[2]), R::zero()];
            gamma += r[0] * z[0] + r[1] * z[1] + r[2] * z[2];
        }
        gamma
    }

    /// Number of entries of L; 0 before the first factorisation.
    pub fn numbers(&self) -> usize {
        self.factor.len()
    }
}

/// First row whose pivot is rounding error.
fn first_bad_pivot(
    symbolic: &SymbolicCholesky<usize>,
    factor: &[f64],
    pattern: &Pattern,
    value: &[f64], // [entry] of A, N/m
) -> Option<usize> {
    let SymbolicCholeskyRaw::Supernodal(parts) = symbolic.raw() else {
        return None;
    };
    let l = SupernodalLltRef::new(parts, factor);
    (0..parts.n_supernodes()).find_map(|s| {
        let part = l.supernode(s);
        let pivot = |k: usize| part.val()[(k, k)].powi(2);
        let of_rounding = |k: &usize| pivot(*k) < SMALLEST_PIVOT * value[pattern.first[part.start() + k]];
        (0..part.val().ncols()).find(of_rounding).map(|k| part.start() + k)
    })
}
