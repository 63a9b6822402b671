//! Meshes: the regular grid of the skin and its surface.

mod grid;
mod surface;

pub use grid::Grid;
pub use surface::{Quad, Surface};
