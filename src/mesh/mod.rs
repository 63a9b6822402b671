//! The regular grid of a body: nodes and cells, their connectivity under cuts, and the surface.

mod corner;
mod grid;
mod parts;
mod point;
mod surface;

pub use corner::Corner;
pub use grid::Grid;
pub use parts::{Change, FRAGMENT, Parts};
pub use point::{MaterialPoint, trilinear};
pub use surface::{Edges, Quad, Surface};
