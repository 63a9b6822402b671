//! Recorded results of a scene: probes, bounds, the tests' smaller form, pictures.

use super::{BodyId, Region, Skin};

/// A value recorded each step.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Column name.
    pub name: String,
    /// Recorded quantity.
    pub kind: ProbeKind,
}

/// Quantity of a probe.
#[derive(Clone, Debug, PartialEq)]
pub enum ProbeKind {
    /// Displacement of the node nearest to a rest position along an axis (0, 1, 2), m.
    Displacement {
        /// Index of the deformable body.
        body: usize,
        /// m
        point: [f64; 3],
        /// 0, 1 or 2
        axis: usize,
    },
    /// Sum of the elastic reactions over a region along an axis, N.
    Reaction {
        /// Index of the deformable body.
        body: usize,
        /// Nodes.
        region: Region,
        /// 0, 1 or 2
        axis: usize,
    },
    /// Position of a rigid body along an axis, m.
    Position {
        /// Index of the rigid body.
        body: usize,
        /// 0, 1 or 2
        axis: usize,
    },
    /// Velocity of a rigid body along an axis, m/s.
    Velocity {
        /// Index of the rigid body.
        body: usize,
        /// 0, 1 or 2
        axis: usize,
    },
    /// Force on a body along an axis from one other body, or from all in contact with it or attached to it, N.
    Force {
        /// Body on which the force acts.
        on: BodyId,
        /// Body that exerts it; `None` for all.
        from: Option<BodyId>,
        /// 0, 1 or 2
        axis: usize,
    },
}

impl ProbeKind {
    /// Unit of its values, as in the column's name.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Displacement { .. } | Self::Position { .. } => "m",
            Self::Velocity { .. } => "m_s",
            Self::Reaction { .. } | Self::Force { .. } => "n",
        }
    }
}

/// Bounds on a result, given by its report key with dots (`cut.area_mm2`), or `probes.NAME`.
#[derive(Clone, Debug)]
pub struct Check {
    /// Report key.
    pub key: String,
    /// Inclusive lower bound.
    pub min: f64,
    /// Inclusive upper bound.
    pub max: f64,
    /// Widening of both bounds, in cell widths of the first skin (the smaller of x and y): a length in mm is known to within a cell.
    pub cells: f64,
}

impl Check {
    /// Bounds for the grid of a skin, in the report's units.
    pub fn bounds(&self, skins: &[Skin]) -> [f64; 2] {
        let widths = skins.first().map(|skin| [0, 1].map(|axis| skin.size[axis] / f64::from(skin.cells[axis])));
        let width = widths.map_or(0.0, |[x, y]| 1e3 * x.min(y));
        [self.min - self.cells * width, self.max + self.cells * width]
    }
}

/// A smaller form of a scene for the tests.
#[derive(Clone, Copy, Debug)]
pub struct TestForm {
    /// Cells in x and y instead of the scene's.
    pub cells: Option<[u32; 2]>,
    /// Steps instead of the scene's duration.
    pub steps: Option<u32>,
}

/// Pictures of a run.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Number of pictures in the whole run.
    pub frames: u32,
    /// Size, pixels.
    pub size: [u32; 2],
    /// Camera position, m.
    pub eye: [f64; 3],
    /// Point that the camera looks at, m.
    pub target: [f64; 3],
    /// Vertical field of view, degrees.
    pub field_of_view: f64,
}
