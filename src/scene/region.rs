//! Regions: sets of nodes selected by their rest positions, or by a group of a mesh.

use glam::DVec3;
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

/// Part of a triangle: the barycentric coordinates of the part's corners.
pub type TrianglePart = [[f64; 3]; 3];

/// All of a triangle.
const WHOLE: TrianglePart = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Share of a triangle that a part of it has.
pub fn share_of(part: &TrianglePart) -> f64 {
    let [a, b, c] = part.map(DVec3::from_array);
    a.dot(b.cross(c)).abs()
}

/// Share of a triangle below which a part of it is rounding.
const NO_PART: f64 = 1e-12;

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

/// Equal parts of a triangle, [`PIECES`] along each edge: those turned as it is, and those between them.
fn pieces() -> impl Iterator<Item = TrianglePart> {
    let at = |i: u32, j: u32| {
        let [p, q] = [i, j].map(|n| f64::from(n) / f64::from(PIECES));
        [1.0 - p - q, p, q]
    };
    let rows = |first: u32| (first..PIECES).flat_map(|i| (0..PIECES - i).map(move |j| (i, j)));
    let turned = rows(0).map(move |(i, j)| [at(i, j), at(i + 1, j), at(i, j + 1)]);
    turned.chain(rows(1).map(move |(i, j)| [at(i, j), at(i, j + 1), at(i - 1, j + 1)]))
}

/// Parts of a triangle in a box, cut side by side (Sutherland, Hodgman 1974).
fn parts_in_box(corners: [[f64; 3]; 3], min: &[f64; 3], max: &[f64; 3]) -> Vec<TrianglePart> {
    let mut polygon = WHOLE.to_vec();
    for (axis, bound, sign) in (0..3).flat_map(|n| [(n, min[n], 1.0), (n, max[n], -1.0)]) {
        let within = corners.map(|corner| sign * (corner[axis] - bound));
        // touching is inside, whatever the rounding
        if within.iter().all(|depth| *depth >= -SLACK) {
            continue;
        }
        let depth = |at: &[f64; 3]| (0..3).map(|k| at[k] * within[k]).sum::<f64>();
        let mut left = vec![];
        for (k, to) in polygon.iter().enumerate() {
            let from = &polygon[(k + polygon.len() - 1) % polygon.len()];
            let [before, after] = [depth(from), depth(to)];
            if (before < 0.0) != (after < 0.0) {
                let t = before / (before - after);
                left.push([0, 1, 2].map(|n| from[n] + t * (to[n] - from[n])));
            }
            if after >= 0.0 {
                left.push(*to);
            }
        }
        polygon = left;
    }
    let fan = (2..polygon.len()).map(|k| [polygon[0], polygon[k - 1], polygon[k]]);
    fan.filter(|part| share_of(part) > NO_PART).collect()
}

/// True if the box around a triangle lies outside a ball.
fn beyond_ball(corners: &[[f64; 3]; 3], centre: &[f64; 3], radius: f64) -> bool {
    let to_interval = |n: usize| {
        let [a, b, c] = corners.map(|corner| corner[n]);
        (a.min(b).min(c) - centre[n]).max(centre[n] - a.max(b).max(c)).max(0.0)
    };
    (0..3).map(|n| to_interval(n).powi(2)).sum::<f64>() > (radius + SLACK).powi(2)
}

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

    /// Parts of a triangle of the surface that belong to the region, by its corners at rest, m, and which of these belong to it: exact for boxes, of
    /// curved and slanted regions the 16 × 16 parts whose middles they hold, of others the whole triangle if they hold its corners.
    pub fn parts_of_triangle(
        &self,
        corners: [[f64; 3]; 3],
        inside: [bool; 3],
        size: [f64; 2],
        thickness: f64,
    ) -> Vec<TrianglePart> {
        let all = inside == [true; 3];
        match self {
            Self::Box { .. } | Self::Sphere { .. } | Self::Plane { .. } | Self::Core(_) if all => vec![WHOLE],
            Self::Box { min, max } => parts_in_box(corners, min, max),
            Self::Sphere { centre, radius } if beyond_ball(&corners, centre, *radius) => vec![],
            Self::Sphere { .. } | Self::Plane { .. } | Self::Rim(_) | Self::Core(_) => {
                let holds = |part: &TrianglePart| {
                    let middle = [0, 1, 2].map(|k| part.iter().map(|corner| corner[k]).sum::<f64>() / 3.0);
                    let at = [0, 1, 2].map(|n| (0..3).map(|k| middle[k] * corners[k][n]).sum());
                    self.holds(at, size, thickness)
                };
                pieces().filter(holds).collect()
            }
            _ if all => vec![WHOLE],
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
