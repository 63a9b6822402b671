//! Hyperelastic cells of a grid on a device ([`super::hyperelastic::Cell`]); text shared by the shaders that have them, after that of the laws.

/// Text shared by the shaders of hyperelastic cells.
pub const WGSL: &str = include_str!("hyperelastic_cells.wgsl");
