//! The scene embedded in the program, so that it runs without files.

use super::{Files, Scene, parse};
use crate::error::Result;
use std::path::Path;

const TEXT: &str = include_str!("../../scenes/incision.toml");

const FILES: &[(&str, &str)] = &[
    ("meshes/scalpel.obj", include_str!("../../scenes/meshes/scalpel.obj")),
    ("incision.csv", include_str!("../../scenes/incision.csv")),
];

/// The incision: `scenes/incision.toml` with its mesh and hand path, as of the build.
///
/// # Errors
/// As [`parse`], if the scene was invalid at build time.
pub fn incision() -> Result<Scene> {
    parse(TEXT, Path::new("scenes/incision.toml"), &Files::Embedded(FILES))
}
