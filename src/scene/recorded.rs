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

/// Quantity of a probe, at the end of a step. Points and regions are of the rest shape, in the body's own frame; axes and components are the
/// world's.
#[derive(Clone, Debug, PartialEq)]
pub enum ProbeKind {
    /// Displacement of a material point along an axis (0, 1, 2), m: that of a node, or interpolated in the cell that contains the point. A
    /// point outside the body counts as the nearest one of its box.
    Displacement {
        /// Index of the deformable body.
        body: usize,
        /// m
        point: [f64; 3],
        /// 0, 1 or 2
        axis: usize,
    },
    /// Mean displacement of a region's nodes along an axis, each node by the volume of the cells around it, m.
    MeanDisplacement {
        /// Index of the deformable body.
        body: usize,
        /// Nodes.
        region: Region,
        /// 0, 1 or 2
        axis: usize,
    },
    /// Force that boundary conditions and rest-shape springs exert on a region's nodes along an axis, N (`step/probes.rs` has the sum).
    Reaction {
        /// Index of the deformable body.
        body: usize,
        /// Nodes.
        region: Region,
        /// 0, 1 or 2
        axis: usize,
    },
    /// Mean contact pressure on a region of the surface: normal forces of contacts on its nodes over the present area of the faces whose
    /// four nodes it contains, Pa.
    Pressure {
        /// Index of the deformable body.
        body: usize,
        /// Nodes.
        region: Region,
    },
    /// Component of the Green–Lagrange strain `(FᵀF − I)/2` at a material point.
    Strain {
        /// Index of the deformable body.
        body: usize,
        /// m
        point: [f64; 3],
        /// Component of the tensor; not [`Component::VonMises`].
        component: Component,
    },
    /// Component of the Cauchy stress at a material point, Pa; not of springs.
    Stress {
        /// Index of the deformable body.
        body: usize,
        /// m
        point: [f64; 3],
        /// Component of the tensor, or its equivalent stress.
        component: Component,
    },
    /// Volume of a body's present cells, m³.
    Volume {
        /// Index of the deformable body.
        body: usize,
    },
    /// Change of the volume of a body's present cells, relative to their volume at rest.
    VolumeChange {
        /// Index of the deformable body.
        body: usize,
    },
    /// Position of the centre of mass along an axis, m.
    CentreOfMass {
        /// Deformable or rigid body.
        of: BodyId,
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
    /// Angular velocity of a rigid body about an axis, rad/s.
    Spin {
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

/// Columns of `probes.csv` beside those of the probes: the first one, and the last ones of a scene with contact.
pub const FIXED_COLUMNS: [&str; 4] = ["time_s", "contacts", "contact_force_n", "links_cut"];

impl Probe {
    /// Name of its column in `probes.csv`.
    pub fn column(&self) -> String {
        format!("{}_{}", self.name, self.kind.unit())
    }
}

impl ProbeKind {
    /// Unit of its values, as in the column's name.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Displacement { .. }
            | Self::MeanDisplacement { .. }
            | Self::CentreOfMass { .. }
            | Self::Position { .. } => "m",
            Self::Velocity { .. } => "m_s",
            Self::Spin { .. } => "rad_s",
            Self::Reaction { .. } | Self::Force { .. } => "n",
            Self::Pressure { .. } | Self::Stress { .. } => "pa",
            Self::Volume { .. } => "m3",
            Self::VolumeChange { .. } | Self::Strain { .. } => "ratio",
        }
    }

    /// Body that it is of.
    pub fn body(&self) -> BodyId {
        match self {
            Self::Displacement { body, .. }
            | Self::MeanDisplacement { body, .. }
            | Self::Reaction { body, .. }
            | Self::Pressure { body, .. }
            | Self::Strain { body, .. }
            | Self::Stress { body, .. }
            | Self::Volume { body }
            | Self::VolumeChange { body } => BodyId::Deformable(*body),
            Self::Position { body, .. } | Self::Velocity { body, .. } | Self::Spin { body, .. } => BodyId::Rigid(*body),
            Self::CentreOfMass { of, .. } => *of,
            Self::Force { on, .. } => *on,
        }
    }

    /// True if it is of all nodes of a deformable body.
    pub fn of_whole(&self) -> bool {
        matches!(
            self,
            Self::Volume { .. } | Self::VolumeChange { .. } | Self::CentreOfMass { of: BodyId::Deformable(_), .. }
        )
    }

    /// Nodes that it is of: the body's index and the region; none for other kinds.
    pub fn region(&self) -> Option<(usize, &Region)> {
        match self {
            Self::MeanDisplacement { body, region, .. }
            | Self::Reaction { body, region, .. }
            | Self::Pressure { body, region } => Some((*body, region)),
            _ => None,
        }
    }
}

/// Component of a symmetric tensor in world axes, or an invariant of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// Row and column, 0 to 2.
    Entry(usize, usize),
    /// `√(3/2 s:s)`, `s` the deviator.
    VonMises,
}

impl Component {
    /// Its value of a symmetric tensor.
    pub fn of(self, tensor: [[f64; 3]; 3]) -> f64 {
        if let Self::Entry(i, j) = self {
            return tensor[i][j];
        }
        let mean = (tensor[0][0] + tensor[1][1] + tensor[2][2]) / 3.0;
        let deviator = |i: usize, j: usize| tensor[i][j] - if i == j { mean } else { 0.0 };
        let squares = (0..9).map(|n| deviator(n / 3, n % 3).powi(2)).sum::<f64>();
        (1.5 * squares).sqrt()
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
    /// Widening of both bounds, in cell widths of the first skin (the smaller of x and y; of a mesh those of
    /// [`TetrahedralMesh::cell_width`](super::TetrahedralMesh::cell_width)): a length in mm is known to within a cell.
    pub cells: f64,
}

impl Check {
    /// Bounds for the grid of a skin, in the report's units.
    pub fn bounds(&self, skins: &[Skin]) -> [f64; 2] {
        let of_grid = |skin: &Skin| {
            let [x, y] = [0, 1].map(|axis| skin.size[axis] / f64::from(skin.cells[axis]));
            x.min(y)
        };
        let of = |skin: &Skin| skin.mesh.as_ref().map_or_else(|| of_grid(skin), |mesh| mesh.cell_width());
        let width = 1e3 * skins.first().map_or(0.0, of);
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

/// Fields of the saved meshes beside displacement, velocity, layer and body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputField {
    /// Cauchy stress and its von Mises invariant, at the middle of each cell.
    Stress,
    /// Green–Lagrange strain, at the middle of each cell.
    Strain,
    /// Share of a cell's links, or of the springs in it, that are intact; of its volume that is inside of an embedded surface.
    Alive,
    /// Factor of a cell on the stiffness of its layer, by inclusions and by the share of it inside of an embedded surface.
    Stiffness,
}

/// Format of saved surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceFormat {
    /// glTF 2.0, binary, with colours and the tools.
    Glb,
    /// Wavefront OBJ.
    Obj,
    /// STL, binary.
    Stl,
}

impl SurfaceFormat {
    /// Ending of its files.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Glb => "glb",
            Self::Obj => "obj",
            Self::Stl => "stl",
        }
    }
}

/// What is saved with each picture beside the usual; each has its cost, and is left out unless asked for.
#[derive(Clone, Debug, Default)]
pub struct Output {
    /// More fields of the meshes.
    pub fields: Vec<OutputField>,
    /// More formats of the surface.
    pub surfaces: Vec<SurfaceFormat>,
}

impl Output {
    /// Whether a field is asked for.
    pub fn has(&self, field: OutputField) -> bool {
        self.fields.contains(&field)
    }
}
