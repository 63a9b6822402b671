//! Regions: sets of nodes selected by their rest positions.

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
    /// z = 0, within this distance from the sides, m.
    Rim(f64),
    /// z = 0 without the rim of this width, m.
    Core(f64),
}

impl Region {
    /// True if a rest position belongs to the region; `size` and `thickness` of the skin, m.
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
            Self::All => true,
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
