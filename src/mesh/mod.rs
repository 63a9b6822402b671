//! Meshes: the regular grid of the skin and its surface.

mod grid;
mod parts;
mod surface;

pub use grid::Grid;
pub use parts::{Change, Corner, Parts};
pub use surface::{Edges, Quad, Surface};
