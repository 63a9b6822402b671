//! Limits of grids and meshes.

/// Maximum number of nodes with 32-bit indices: the largest array has 64 numbers per node.
pub const MOST_NODES: u32 = u32::MAX / 64;

/// Largest ratio of the edges of a cell, or of a tetrahedron's longest edge and least height: the condition of the system grows with its
/// square, and beyond 10⁴ the solvers no longer reach a tolerance of 10⁻⁹ in f64 (a patch of one strain, pulled over layers 10³ to 10⁹ times
/// as thick as cells are wide).
pub(super) const LONGEST: f64 = 1e4;
