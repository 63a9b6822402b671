//! What a scene records of a run: probes, bounds on results, the tests' smaller form, pictures.

use super::Region;

/// A value recorded each step.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Column name.
    pub name: String,
    /// What is recorded.
    pub kind: ProbeKind,
}

/// What a probe records.
#[derive(Clone, Debug, PartialEq)]
pub enum ProbeKind {
    /// Displacement of the node nearest to a rest position along an axis (0, 1, 2), m.
    Displacement {
        /// m
        point: [f64; 3],
        /// 0, 1 or 2
        axis: usize,
    },
    /// Sum of the elastic reaction over a region along an axis, N.
    Reaction {
        /// Which nodes.
        region: Region,
        /// 0, 1 or 2
        axis: usize,
    },
}

/// Bounds on a named result: a key of the report with dots (`cut.area_mm2`), or `probes.NAME`.
#[derive(Clone, Debug)]
pub struct Check {
    /// Report key.
    pub key: String,
    /// Inclusive lower bound.
    pub min: f64,
    /// Inclusive upper bound.
    pub max: f64,
}

/// A smaller form of a scene for the tests.
#[derive(Clone, Copy, Debug)]
pub struct TestForm {
    /// Cells in x and y instead of the scene's.
    pub cells: Option<[u32; 2]>,
    /// Steps instead of the scene's duration.
    pub steps: Option<u32>,
}

/// How frames are drawn.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Frames over the whole run.
    pub frames: u32,
    /// Pixels.
    pub size: [u32; 2],
    /// Camera position, m.
    pub eye: [f64; 3],
    /// Looked-at point, m.
    pub target: [f64; 3],
    /// Vertical field of view, degrees.
    pub field_of_view: f64,
}
