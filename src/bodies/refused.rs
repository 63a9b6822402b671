//! Errors of setting up or solving a body.

use super::MAX_LAYERS;
use crate::scene::{EDGE_SPACING, MOST_NODES, PRECONDITIONER, STEP};

/// See the module.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Refused {
    /// More layers than a uniform binding holds.
    #[error("{count} layers; at most {MAX_LAYERS} fit into one uniform binding; join layers of the same material")]
    Layers {
        /// Layers of the body.
        count: usize,
    },

    /// More nodes than 32-bit indices reach.
    #[error("{count} nodes; 32-bit indices reach {MOST_NODES}; use fewer cells")]
    Nodes {
        /// Nodes of the body, including the reserve for cuts.
        count: u64,
    },

    /// More quads swept by blades in a step than a GPU accepts.
    #[error("the blade sweeps {count} quads in a step; a GPU takes at most {most}; set a larger edge_spacing_mm")]
    SweptQuads {
        /// Quads of this step.
        count: usize,
        /// Most quads per step.
        most: usize,
    },

    /// More links cut in a step than a GPU reports.
    #[error("{count} links cut in one step; a GPU reports at most {most}; use a shorter step_ms")]
    CutLinks {
        /// Hits of this step.
        count: usize,
        /// Most hits per step.
        most: usize,
    },

    /// Springs with a solver for hexahedra.
    #[error("{solver} is for hexahedra; this skin is of springs; take the preconditioner {fix}")]
    SpringSolver {
        /// Solver: "multigrid" or "the direct solver".
        solver: &'static str,
        /// Preconditioner to take.
        fix: &'static str,
    },

    /// Springs that cannot be fitted to Young's modulus.
    #[error(
        "the springs of the layer `{layer}` cannot be fitted to its young_kpa: they find no equilibrium under a uniform load; give spring_stiffness_n_m, \
         or mend the mesh (`cutis mesh FILE`)"
    )]
    SpringFit {
        /// Its name.
        layer: String,
    },

    /// A probe of a strain in a mesh of springs.
    #[error(
        "the probe `{name}` asks for the strain at a point of a mesh of springs; probe displacements or forces, or save the strain of all \
         tetrahedra by [output] fields"
    )]
    SpringProbe {
        /// Its name.
        name: String,
    },

    /// Rest-shape springs on a body with consistent mass.
    #[error(
        "rest-shape springs need lumped nodal masses, and this skin's mass is consistent; take a lumped or uniform mass"
    )]
    RestSpringMass,

    /// What tetrahedra do not have.
    #[error("{what} is not for tetrahedra (element = \"tetra\" or \"plain_tetra\"); {fix}, or take element = \"bbar\"")]
    Tetrahedra {
        /// Key of [`crate::scene::Scene::lines`], or empty.
        key: &'static str,
        /// Key or part of the scene.
        what: &'static str,
        /// What to do.
        fix: &'static str,
    },

    /// A surface thinner than the cells that it is embedded in.
    #[error(
        "{at}: the surface embedded in the grid is too thin for its cells at [{:.4}, {:.4}, {:.4}] mm, where no cell beside has a part inside; use more cells",
        point[0], point[1], point[2]
    )]
    EmbeddedThin {
        /// Where the body stands.
        at: String,
        /// Point of the surface in the body's frame, mm.
        point: [f64; 3],
    },

    /// A surface whose parts and those of the cells that it cuts differ.
    #[error(
        "{at}: the surface embedded in the grid encloses {surface} separate bodies, and the cells with a part inside come in {cells}; use more cells: \
         necks and gaps have to be wider than a cell"
    )]
    EmbeddedApart {
        /// Where the body stands.
        at: String,
        /// Parts of the present cells.
        cells: usize,
        /// Parts of the surface.
        surface: usize,
    },

    /// A region of the grid without a node of the body that is embedded in it.
    #[error(
        "{at}: the region of {what} has no node of a cell with a part inside of the embedded surface; move or widen it"
    )]
    EmbeddedRegion {
        /// The scene.
        at: String,
        /// What has the region.
        what: String,
    },

    /// A point in a cell that has no part inside.
    #[error(
        "{at}: the point [{:.4}, {:.4}, {:.4}] mm of {what} lies outside of the embedded surface; move it into the body",
        point[0], point[1], point[2]
    )]
    EmbeddedPoint {
        /// The scene.
        at: String,
        /// What has the point.
        what: String,
        /// Point in the body's frame, mm.
        point: [f64; 3],
    },

    /// The direct solver on a GPU.
    #[error(
        "the direct solver runs on the CPU path, not on a GPU; run it with --backend cpu, or take the preconditioner multigrid"
    )]
    DirectOnGpu,

    /// The direct solver on a body whose nodes a blade may duplicate.
    #[error(
        "the direct solver's matrix has no room for nodes that a blade splits; take cut = \"remove\" or the preconditioner multigrid"
    )]
    DirectSplit,

    /// Not enough memory for the factor of the direct solver.
    #[error(
        "the direct solver's factor needs {} MB, which cannot be allocated; use fewer cells, or the preconditioner multigrid",
        numbers / 125_000
    )]
    DirectMemory {
        /// Entries of the factor, 8 bytes each.
        numbers: usize,
    },

    /// System that is not positive definite.
    #[error(
        "the step's matrix is not positive definite at node {node:?} of the grid (counted from 0 along x, y, z), axis {axis}: a part of the body there is unconstrained and has no mass, or positions are not finite; constrain the body, give it mass, or take a shorter step"
    )]
    NotPositive {
        /// Node along x, y, z, from 0.
        node: [usize; 3],
        /// Axis: x, y or z.
        axis: char,
    },

    /// Inverted hexahedron of a hyperelastic body, where the law has no energy.
    #[error(
        "cell {cell:?} of a hyperelastic body is inverted at the start of a step; take a shorter step_ms, let contacts and prescribed \
         displacements move less in one step, or take law = \"corotational\""
    )]
    InvertedCell {
        /// Hexahedron along x, y, z, from 0.
        cell: [usize; 3],
    },
}

impl Refused {
    /// Key of [`crate::scene::Scene::lines`] for what the scene is to change; empty where more than one key would do.
    pub fn key(&self) -> &'static str {
        match self {
            Self::SpringSolver { .. } | Self::DirectOnGpu | Self::DirectSplit | Self::DirectMemory { .. } => {
                PRECONDITIONER
            }
            Self::CutLinks { .. } | Self::NotPositive { .. } | Self::InvertedCell { .. } => STEP,
            Self::SweptQuads { .. } => EDGE_SPACING,
            Self::Layers { .. }
            | Self::Nodes { .. }
            | Self::RestSpringMass
            | Self::SpringProbe { .. }
            | Self::SpringFit { .. }
            | Self::EmbeddedThin { .. }
            | Self::EmbeddedApart { .. }
            | Self::EmbeddedRegion { .. }
            | Self::EmbeddedPoint { .. } => "",
            Self::Tetrahedra { key, .. } => key,
        }
    }
}
