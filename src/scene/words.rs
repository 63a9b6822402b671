//! Names of the choices in a scene file, as its tables declare them, for output in reports and studies.

use super::raw::{Contact, Probe, Skin, Solver, Time};
use super::{Component, Correction, Element, Integrator, Preconditioner};

type Words<T, const N: usize> = [(&'static str, T); N];

/// All words of a choice.
const fn all<T: Copy, const N: usize>(words: &[(&'static str, T)]) -> Words<T, N> {
    assert!(words.len() == N);
    *words.first_chunk().expect("as many")
}

/// Elements of hexahedra.
pub const ELEMENTS: Words<Element, 3> = *Skin::element.range.0.first_chunk().expect("the first three");

/// Elements of tetrahedra.
pub const TETRAHEDRA: Words<Element, 2> = *Skin::element.range.0.last_chunk().expect("the last two");

/// Integrators.
pub const INTEGRATORS: Words<Integrator, 5> = all(Time::integrator.range.0);

/// Contact corrections.
pub const CORRECTIONS: Words<Correction, 3> = all(Contact::correction.range.0);

/// Components of strain and stress; the last is for stress.
pub const COMPONENTS: Words<Component, 7> = all(Probe::component.range.0);

/// Preconditioners; the last two are for hexahedra, the last three not for tetrahedra.
pub const PRECONDITIONERS: Words<Preconditioner, 6> = all(Solver::preconditioner.range.0);

/// Name of a value; empty if it has none.
pub fn word<T: PartialEq>(table: &[(&'static str, T)], value: T) -> &'static str {
    table.iter().find(|(_, known)| *known == value).map_or("", |(word, _)| word)
}
