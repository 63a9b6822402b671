//! Names of the choices in a scene file, used for reading and for output in reports and studies.

use super::{Component, Correction, Element, Integrator, OutputField, Preconditioner, SurfaceFormat};

/// Elements of hexahedra.
pub const ELEMENTS: [(&str, Element); 3] =
    [("bbar", Element::Bbar), ("enhanced", Element::Enhanced), ("plain", Element::Plain)];

/// Elements of tetrahedra.
pub const TETRAHEDRA: [(&str, Element); 2] = [("tetra", Element::Tetra), ("plain_tetra", Element::PlainTetra)];

/// Integrators.
pub const INTEGRATORS: [(&str, Integrator); 5] = [
    ("implicit_euler", Integrator::ImplicitEuler),
    ("newmark", Integrator::Newmark),
    ("midpoint", Integrator::Midpoint),
    ("symplectic_euler", Integrator::SymplecticEuler),
    ("static", Integrator::Static),
];

/// Contact corrections.
pub const CORRECTIONS: [(&str, Correction); 3] =
    [("exact", Correction::Exact), ("uncoupled", Correction::Uncoupled), ("precomputed", Correction::Precomputed)];

/// Components of strain and stress; the last is for stress.
pub const COMPONENTS: [(&str, Component); 7] = [
    ("xx", Component::Entry(0, 0)),
    ("yy", Component::Entry(1, 1)),
    ("zz", Component::Entry(2, 2)),
    ("xy", Component::Entry(0, 1)),
    ("yz", Component::Entry(1, 2)),
    ("zx", Component::Entry(2, 0)),
    ("von_mises", Component::VonMises),
];

/// Fields of saved meshes.
pub const OUTPUT_FIELDS: [(&str, OutputField); 4] = [
    ("stress", OutputField::Stress),
    ("strain", OutputField::Strain),
    ("alive", OutputField::Alive),
    ("stiffness", OutputField::Stiffness),
];

/// Formats of saved surfaces.
pub const SURFACE_FORMATS: [(&str, SurfaceFormat); 3] =
    [("glb", SurfaceFormat::Glb), ("obj", SurfaceFormat::Obj), ("stl", SurfaceFormat::Stl)];

/// Preconditioners; the last two are for hexahedra, the last three not for tetrahedra.
pub const PRECONDITIONERS: [(&str, Preconditioner); 6] = [
    ("none", Preconditioner::None),
    ("jacobi", Preconditioner::Jacobi),
    ("block", Preconditioner::Block),
    ("column", Preconditioner::Column),
    ("multigrid", Preconditioner::Multigrid),
    ("direct", Preconditioner::Direct),
];

/// Name of a value; empty if it has none.
pub fn word<T: PartialEq>(table: &[(&'static str, T)], value: T) -> &'static str {
    table.iter().find(|(_, known)| *known == value).map_or("", |(word, _)| word)
}
