//! The nodes and cells of a body, their connectivity under cuts, and the surface: of a regular grid, of a closed surface embedded in one, or
//! of a mesh of tetrahedra. An embedded surface is not cut.

mod corner;
mod element;
mod embedded;
mod embedding;
mod face;
mod grid;
mod links;
mod loose;
mod parts;
mod pit;
mod point;
mod surface;
mod tetrahedra;
mod tetrahedral;
mod unstructured;

pub use corner::Corner;
pub use element::SAMPLES;
pub use embedded::{Embedded, Misfit};
pub use face::Face;
pub use grid::Grid;
pub use links::Links;
pub(crate) use loose::parted;
pub use parts::{Change, FRAGMENT, Parts};
pub use pit::{Carved, Distance, LEAST, Pit, TOP, Thinned, Tissue};
pub use point::{MaterialPoint, trilinear};
pub use surface::{Edges, Surface};
pub use tetrahedra::{PAIRS, PER_CELL};
pub use tetrahedral::{EDGES, Severed, TetrahedralParts};
pub use unstructured::{Outside, Unstructured};
