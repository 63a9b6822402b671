//! Linear tetrahedra: energy, arrays, and what their kernels share.
//!
//! Energy: `Σ_k V_k μ_k |dev ε̄_k|² + ½ Σ_e κ_e V_e θ̄_e²`. Smoothed elements: a domain `k` is an edge in one material with
//! `V_k = Σ V_e/6`, `F̄_k = Σ V_e F_e / Σ V_e` over the tetrahedra around it, `ε̄_k = sym(R_kᵀ F̄_k) − I`; the volume strain
//! `θ_e = tr(R_eᵀ F_e) − 3` is averaged at nodes over all materials, `θ_a = Σ V_e θ_e / Σ V_e`, and `θ̄_e` is the mean of the element's four
//! nodes. Plain elements: a domain is one tetrahedron, and `θ̄_e = θ_e`. `R` are the polar factors; their derivative adds nothing to
//! the forces on the deviator, and is omitted from the tangent as in [`super::forces`]. Forces of all displacements
//! (`params.total = 1`) have the strain of the rotation itself, `sym(Rᵀ) − I`; products with increments have not.
//! Source: Nguyen-Thoi, Liu, Vu-Do, Nguyen-Xuan 2009 (edge-smoothed deviator, node-averaged volume); differs: volume averaged across
//! materials, and corotational. Bonet, Burton 1998 (average nodal pressure).
//!
//! Passes of smoothed elements, each with one writer per entry and a fixed order of sums: `tetrahedra_strains` → `tetrahedra_domains`,
//! `tetrahedra_volumes` → `tetrahedra_pressures` → `tetrahedra_smoothed`; of plain ones `tetrahedra_plain`. Then `tetrahedra_forces` or
//! `tetrahedra_product` at the nodes.
//!
//! `gradients`: `[tetrahedron × 3]` gradients of the shape functions of corners 1 to 3, 1/m; fourth numbers: volume m³, bulk modulus Pa,
//! shear modulus Pa. The gradient of corner 0 is minus their sum. Units: u m, stress Pa, f N.

use crate::math::{M3, Real, V3, V4, rotation_matrix, rotation_minus_identity};

/// Text shared by the shaders that read `gradients`.
pub const WGSL: &str = include_str!("tetrahedra.wgsl");

/// Fewest tetrahedra, domains or nodes per thread of a pass on the CPU path.
pub const FEWEST: usize = 1024;

/// Arrays of a mesh, as the kernels read them; a cut changes them ([`crate::bodies::tetrahedra::operator`]).
#[derive(Clone, Debug, Default)]
pub struct Arrays<R> {
    /// Volume averaged at nodes, deviator over edges; otherwise plain elements, whose arrays of domains are empty
    /// or, of a hyperelastic law, have a domain for each tetrahedron.
    pub smoothed: bool,
    /// `[tetrahedron]` nodes.
    pub corners: Vec<[u32; 4]>,
    /// `[tetrahedron × 3]` gradients of the shape functions of corners 1 to 3, 1/m; fourth numbers: volume m³, bulk and shear modulus Pa.
    pub gradients: Vec<V4<R>>,
    /// `[node + 1]` CSR offsets into `of_node`.
    pub first_of_node: Vec<u32>,
    /// Tetrahedra around each node: 4 × tetrahedron + the node's corner.
    pub of_node: Vec<u32>,
    /// `[node]` 1 / sum of the volumes around it, 1/m³.
    pub per_volume: Vec<R>,
    /// `[domain + 1]` CSR offsets into `of_domain`.
    pub first_of_domain: Vec<u32>,
    /// Tetrahedra of each domain: 4 × tetrahedron.
    pub of_domain: Vec<u32>,
    /// `[domain]` sum of the volumes, m³, and shear modulus, Pa, or, of a hyperelastic law, layer.
    pub shear: Vec<[R; 2]>,
    /// `[tetrahedron × 6]` domains of each tetrahedron.
    pub domains: Vec<u32>,
    /// `[node × 2]` node's own block of the stiffness matrix at rest, N/m: xx xy xz yy; yz zz.
    pub rest_block: Vec<V4<R>>,
    /// `[layer]` κ, two constants, Pa, and the code of a hyperelastic law ([`super::tetrahedra_laws`]), whose κ is the bulk modulus in
    /// `gradients`; empty of small strains.
    pub laws: Vec<V4<R>>,
    /// Patches of plain elements of a hyperelastic law.
    pub patches: Patches<R>,
}

/// What volumes of plain elements are averaged over: each tetrahedron is a patch of its own. Empty of smoothed elements, whose patches are nodes.
#[derive(Clone, Debug, Default)]
pub struct Patches<R> {
    /// `[tetrahedron]` patches, all the same.
    pub corners: Vec<[u32; 4]>,
    /// `[patch + 1]` CSR offsets into `members`.
    pub first: Vec<u32>,
    /// 4 × tetrahedron.
    pub members: Vec<u32>,
    /// `[patch]` 1 / volume, 1/m³.
    pub per_volume: Vec<R>,
}

/// Parts of the arrays that a cut has changed, each in ascending order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Tetrahedra with other corners, domains or volumes, or that were removed.
    pub tetrahedra: Vec<u32>,
    /// Nodes with another volume or block.
    pub nodes: Vec<u32>,
    /// Domains with other tetrahedra or volumes.
    pub domains: Vec<u32>,
    /// The lists of nodes and domains have changed, everywhere.
    pub lists: bool,
}

/// Three columns of a matrix in an array, 48 bytes.
#[inline(always)]
pub fn matrix<R: Real>(columns: &[V4<R>], at: usize) -> M3<R> {
    M3([0, 1, 2].map(|n| V3::from4(columns[3 * at + n])))
}

/// Mean of the columns and of the first fourth number of a domain's tetrahedra: `members` has 4 × tetrahedron, `per_volume` is one over the
/// sum of their volumes, 1/m³.
pub fn mean<R: Real>(gradients: &[V4<R>], members: &[u32], columns: &[V4<R>], per_volume: R) -> (M3<R>, R) {
    members.iter().fold((M3::zero(), R::zero()), |(sum, number), entry| {
        let e = (entry / 4) as usize;
        let weight = gradients[3 * e][3] * per_volume;
        (sum + matrix(columns, e) * weight, number + columns[3 * e][3] * weight)
    })
}

/// Displacement gradient of a tetrahedron, from differences to corner 0.
#[inline(always)]
pub fn displacement_gradient<R: Real>(gradients: &[V4<R>], e: usize, corners: [u32; 4], u: &[V4<R>]) -> M3<R> {
    let own = V3::from4(u[corners[0] as usize]);
    let [a, b, c] = [1, 2, 3].map(|k| V3::from4(u[corners[k] as usize]) - own);
    let g = matrix(gradients, e).0;
    a.outer(g[0]) + b.outer(g[1]) + c.outer(g[2])
}

/// Deviatoric strain of a displacement gradient with the rotation `q`; of increments where `total` is 0.
#[inline(always)]
pub fn deviator<R: Real>(gradient: M3<R>, q: V4<R>, total: u32) -> M3<R> {
    let mut a = rotation_matrix(q).transpose() * gradient;
    if total == 1 {
        a = a + rotation_minus_identity(q).transpose();
    }
    let strain = (a + a.transpose()) * R::of(0.5);
    strain - M3::diagonal(V3::splat(strain.trace() * R::of(1.0 / 3.0)))
}

/// Volume strain of a displacement gradient with the rotation `q`; of increments where `total` is 0.
#[inline(always)]
pub fn volume_strain<R: Real>(gradient: M3<R>, q: V4<R>, total: u32) -> R {
    let theta = rotation_matrix(q).dot(gradient);
    if total == 1 { theta + rotation_minus_identity(q).trace() } else { theta }
}
