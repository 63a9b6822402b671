//! Regions: sets of nodes selected by their rest positions, or by a group of a mesh.

use std::sync::Arc;

/// Tolerance for rounding between lengths in mm and node positions in m; a billionth of a metre is far below any cell.
pub(super) const SLACK: f64 = 1e-9;

/// A set of nodes.
#[derive(Clone, Debug, PartialEq)]
pub enum Region {
    /// z = 0.
    Bottom,
    /// z = thickness.
    Top,
    /// The four vertical faces.
    Sides,
    /// The two faces x = ±size/2.
    SidesX,
    /// The two faces y = ±size/2.
    SidesY,
    /// The face x = −size/2.
    SideXMin,
    /// The face x = size/2.
    SideXMax,
    /// The face y = −size/2.
    SideYMin,
    /// The face y = size/2.
    SideYMax,
    /// Every node.
    All,
    /// Inside the box (rest positions, boundary included), m.
    Box {
        /// m
        min: [f64; 3],
        /// m
        max: [f64; 3],
    },
    /// Inside the sphere (rest positions, boundary included), m.
    Sphere {
        /// m
        centre: [f64; 3],
        /// m
        radius: f64,
    },
    /// Within this distance from a plane, on either side, m.
    Plane {
        /// Point of the plane, m.
        through: [f64; 3],
        /// Unit normal.
        normal: [f64; 3],
        /// m
        within: f64,
    },
    /// Nodes of a physical group of a mesh; none of a grid.
    Group(Group),
    /// z = 0, within this distance from the sides, m.
    Rim(f64),
    /// z = 0 without the rim of this width, m.
    Core(f64),
}

/// Named nodes of a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    name: String,
    nodes: Arc<[u32]>, // in ascending order, each once
}

impl Group {
    /// Nodes by their ids, in any order.
    pub fn new(name: String, mut nodes: Vec<u32>) -> Self {
        nodes.sort_unstable();
        nodes.dedup();
        Self { name, nodes: nodes.into() }
    }

    /// Name of the physical group; its number where it has none.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Node ids in ascending order.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// True if a node belongs to it.
    pub fn holds(&self, node: usize) -> bool {
        self.nodes.binary_search(&(node as u32)).is_ok()
    }
}

/// Rectangle in a face: intervals along its two axes, in shares of its edges, 0 to 1.
pub type Spans = [[f64; 2]; 2];

/// Face of a cell, perpendicular to an axis.
#[derive(Clone, Copy, Debug)]
pub struct CellFace {
    /// Normal axis.
    pub axis: usize,
    /// Its corner with the least coordinates, m.
    pub low: [f64; 3],
    /// Edges of its cell, m.
    pub edge: [f64; 3],
}

/// The two axes across each axis.
pub const ACROSS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// Pieces of an edge of a face of which each belongs to a curved or slanted region as its middle does. A disc of the diameter of an edge has
/// its area within 1 %; with twice as many pieces the difference is a third, at four times the cost.
const PIECES: u32 = 16;

impl CellFace {
    /// Position in it at shares of its edges, m.
    fn at(&self, shares: [f64; 2]) -> [f64; 3] {
        let mut p = self.low;
        for (n, share) in ACROSS[self.axis].into_iter().zip(shares) {
            p[n] += share * self.edge[n];
        }
        p
    }

    /// True if it lies outside a ball as a whole.
    fn beyond(&self, centre: &[f64; 3], radius: f64) -> bool {
        let to_interval = |n: usize| {
            let high = self.low[n] + if n == self.axis { 0.0 } else { self.edge[n] };
            (self.low[n] - centre[n]).max(centre[n] - high).max(0.0)
        };
        (0..3).map(|n| to_interval(n).powi(2)).sum::<f64>() > (radius + SLACK).powi(2)
    }
}

impl Region {
    /// Parts of a face that belong to the region; exact for boxes and for whole faces of the body.
    pub fn parts_of(&self, face: &CellFace, size: [f64; 2], thickness: f64) -> Vec<Spans> {
        let holds = |shares| self.holds(face.at(shares), size, thickness);
        match self {
            Self::Box { min, max } => {
                let plane = face.low[face.axis];
                if plane < min[face.axis] - SLACK || plane > max[face.axis] + SLACK {
                    return vec![];
                }
                let spans = ACROSS[face.axis].map(|n| {
                    let share = |bound: f64| ((bound - face.low[n]) / face.edge[n]).clamp(0.0, 1.0);
                    [share(min[n]), share(max[n])]
                });
                if spans.iter().all(|[from, to]| from < to) { vec![spans] } else { vec![] }
            }
            Self::Sphere { centre, radius } if face.beyond(centre, *radius) => vec![],
            Self::Sphere { .. } | Self::Plane { .. } | Self::Rim(_) | Self::Core(_) => {
                let piece = |k: u32| [k, k + 1].map(|end| f64::from(end) / f64::from(PIECES));
                let middle = |[from, to]: [f64; 2]| 0.5 * (from + to);
                let pieces = (0..PIECES * PIECES).map(|k| [piece(k % PIECES), piece(k / PIECES)]);
                pieces.filter(|spans| holds(spans.map(middle))).collect()
            }
            _ if holds([0.5; 2]) => vec![[[0.0, 1.0]; 2]],
            _ => vec![],
        }
    }

    /// True if a rest position belongs to the region; `size` and `thickness` of the skin, m. A group has nodes, whatever their positions.
    pub fn holds(&self, p: [f64; 3], size: [f64; 2], thickness: f64) -> bool {
        let to_side = |n: usize| 0.5 * size[n] - p[n].abs();
        let from = |q: &[f64; 3]| [0, 1, 2].map(|n| p[n] - q[n]);
        let at_bottom = p[2] <= SLACK;
        match self {
            Self::Bottom => at_bottom,
            Self::Top => p[2] >= thickness - SLACK,
            Self::SidesX => to_side(0) <= SLACK,
            Self::SidesY => to_side(1) <= SLACK,
            Self::Sides => to_side(0).min(to_side(1)) <= SLACK,
            Self::SideXMin => 0.5 * size[0] + p[0] <= SLACK,
            Self::SideXMax => 0.5 * size[0] - p[0] <= SLACK,
            Self::SideYMin => 0.5 * size[1] + p[1] <= SLACK,
            Self::SideYMax => 0.5 * size[1] - p[1] <= SLACK,
            Self::All => true,
            Self::Group(_) => false,
            Self::Box { min, max } => (0..3).all(|n| p[n] >= min[n] - SLACK && p[n] <= max[n] + SLACK),
            Self::Sphere { centre, radius } => from(centre).iter().map(|c| c * c).sum::<f64>().sqrt() <= radius + SLACK,
            Self::Plane { through, normal, within } => {
                from(through).iter().zip(normal).map(|(d, n)| d * n).sum::<f64>().abs() <= within + SLACK
            }
            Self::Rim(margin) => at_bottom && to_side(0).min(to_side(1)) <= margin + SLACK,
            Self::Core(margin) => at_bottom && to_side(0).min(to_side(1)) > margin + SLACK,
        }
    }

    /// Coordinate along `axis` at which a line through a point is deepest inside the region, or nearest to it; 0 if all or only the line's
    /// ends are equivalent.
    pub(super) fn position_along(&self, axis: usize, through: [f64; 3]) -> f64 {
        match self {
            Self::Sphere { centre, .. } => centre[axis],
            Self::Plane { through: q, normal, .. } if normal[axis] != 0.0 => {
                let others: f64 = (0..3).filter(|n| *n != axis).map(|n| (through[n] - q[n]) * normal[n]).sum();
                q[axis] - others / normal[axis]
            }
            Self::Box { min, max } => 0.5 * (min[axis] + max[axis]),
            _ => 0.0,
        }
    }
}
