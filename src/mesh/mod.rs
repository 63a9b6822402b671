//! The regular grid that bodies stand on: its nodes and cells, which of them hang together, and the surface around them.

mod corner;
mod grid;
mod parts;
mod point;
mod surface;

pub use corner::Corner;
pub use grid::Grid;
pub use parts::{Change, Parts};
pub use point::MaterialPoint;
pub use surface::{Edges, Quad, Surface};
