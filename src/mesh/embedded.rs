//! A closed surface embedded in a grid: cells carry the share of their volume that is inside, and the surface moves with the cells that its
//! points lie in.
//!
//! A cell with the share `s` of its volume inside has `max(s, 1/100)` times the stiffness of its layer, and gives its corners the mass
//! `ρ ∫ N_a dV` of what is inside, so that mass and its first moments are those of the body. Cells with less than 10⁻⁴ are gone from the start with what they hold (10⁻⁸ of an ellipsoid on 32 cells), with
//! the nodes that no other cell has.
//!
//! The integrals are exact to rounding: triangles are cut along the cells' planes, and each piece adds what is below it in its column of cells if
//! it faces up, and takes it away if it faces down. A surface that overlaps itself counts once in each cell.
//!
//! A point of the surface in a present cell has the displacement `u = Σ_a N_a(ξ) u_a` of its corners, and a force on it acts on them by the
//! same weights. A point in a cell that is gone moves with the nearest present cell, beyond it by less than a cell; a surface thinner than
//! that is refused.
//!
//! Source: Parvizian, Düster, Rank 2007 (finite cell method: cells beyond the body's boundary, of less stiffness); Lee, Sifakis, Terzopoulos 2009
//! (surfaces embedded in a lattice of hexahedra). Here a cut cell keeps one stiffness matrix, times its share, in place of an integral over
//! what is inside: right where a cell's strain is uniform, and otherwise to first order in the cell width (tests/engine/embedded.rs: 4 and 16 cells across a
//! beam −7 and −0.6 % of its bend; 8 and 24 along a cushion −6 and −1.7 % of its sag).

use super::Face;
use crate::scene::{ClosedSurface, Group};
use std::sync::Arc;

/// Least factor on the stiffness of a present cell: less makes the system worse conditioned, more makes slivers stiff.
const SOFTEST: f64 = 1e-2;

/// See the module.
#[derive(Clone, Debug)]
pub struct Embedded {
    /// The surface.
    pub surface: Arc<ClosedSurface>,
    /// `[cell]` share of its volume inside, 0 for cells that are gone.
    pub share: Vec<f64>,
    /// `[node]` mass, kg; 0 for nodes without a present cell.
    pub mass: Vec<f64>,
    /// `[point of the surface]` its nodes.
    pub nodes: Vec<[u32; 8]>,
    /// `[point of the surface]` weights of its nodes.
    pub weights: Vec<[f64; 8]>,
    /// Triangles, on points that are numbered after the nodes.
    pub outside: Vec<Face>,
    /// `[triangle]` box around it and the present cells that are nearer to it than to others, at rest, m.
    pub behind: Vec<[[f64; 3]; 2]>,
    /// How far displacements of points exceed the range of those of their nodes, in parts of that range.
    pub beyond: f64,
    /// The surface's groups as the nodes that their points move with.
    pub groups: Vec<Group>,
    /// What is wrong with it.
    pub misfit: Option<Misfit>,
}

/// Why a grid cannot carry a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Misfit {
    /// A point of the surface, m, has no present cell beside it.
    Thin([f64; 3]),
    /// Number of parts that present cells come in, and of those that the surface has.
    Apart(usize, usize),
}

impl Embedded {
    /// Factor of a cell on the stiffness of its layer; 0 for one that is gone.
    pub fn factor(&self, cell: usize) -> f64 {
        if self.share[cell] > 0.0 { self.share[cell].max(SOFTEST) } else { 0.0 }
    }

    /// Size of the arrays, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.surface.points())
            + size_of_val(self.surface.triangles())
            + size_of_val(&self.share[..])
            + size_of_val(&self.mass[..])
            + size_of_val(&self.nodes[..])
            + size_of_val(&self.weights[..])
            + size_of_val(&self.outside[..])
            + size_of_val(&self.behind[..])
    }
}
