//! A cell of a grid or a tetrahedron of a mesh at rest: shape functions, and the samples into which carving divides it.

use super::{Grid, TetrahedralParts, trilinear};
use crate::kernels::corner;
use crate::math::{M3, V3};
use std::sync::LazyLock;

/// Samples along each edge.
const SIDE: usize = 4;

/// Samples of an element: small boxes of a cell, small tetrahedra of as much volume of a tetrahedron.
pub const SAMPLES: usize = SIDE * SIDE * SIDE;

/// See the module.
#[derive(Clone, Copy)]
pub struct Element {
    /// Ids of its corners; of a tetrahedron four, then the first again, without weight.
    pub nodes: [u32; 8],
    /// Its first corner, m.
    low: [f64; 3],
    shape: Shape,
}

#[derive(Clone, Copy)]
enum Shape {
    /// Edges, m.
    Cell([f64; 3]),
    /// Edges from the first corner by columns, m, and the inverse of their matrix, which has the gradients of the shape functions as rows, 1/m.
    Tetrahedron(M3<f64>, M3<f64>),
}

impl Element {
    /// A cell.
    pub fn of_cell(grid: &Grid, cell: usize) -> Self {
        let nodes = grid.params::<f64>().corners(cell).map(|node| node as u32);
        let shape = Shape::Cell(grid.cell_edges(grid.layer(cell) as u32));
        Self { nodes, low: grid.rest(nodes[0] as usize), shape }
    }

    /// A tetrahedron, with the nodes that it has now.
    pub fn of_tetrahedron(parts: &TetrahedralParts, e: usize) -> Self {
        let [o, a, b, c] = parts.mesh().mesh.corners(e);
        let [first, second, third, fourth] = parts.corners()[e];
        let edges = M3([a, b, c].map(|x| V3::of(x) - V3::of(o)));
        let nodes = [first, second, third, fourth, first, first, first, first];
        Self { nodes, low: o, shape: Shape::Tetrahedron(edges, edges.inverse()) }
    }

    /// Natural coordinates of a position: along the edges, 0 to 1 inside of a cell, weights of corners 1 to 3 of a tetrahedron.
    fn natural(&self, at: [f64; 3]) -> [f64; 3] {
        let from = [0, 1, 2].map(|n| at[n] - self.low[n]);
        match self.shape {
            Shape::Cell(edges) => [0, 1, 2].map(|n| from[n] / edges[n]),
            Shape::Tetrahedron(_, inverse) => (inverse * V3::of(from)).f64(),
        }
    }

    /// Position of natural coordinates, m.
    fn position(&self, natural: [f64; 3]) -> [f64; 3] {
        match self.shape {
            Shape::Cell(edges) => [0, 1, 2].map(|n| self.low[n] + natural[n] * edges[n]),
            Shape::Tetrahedron(edges, _) => (V3::of(self.low) + edges * V3::of(natural)).f64(),
        }
    }

    /// How far outside of it a position is, squared, in natural coordinates.
    pub fn outside(&self, at: [f64; 3]) -> f64 {
        let natural = self.natural(at);
        let beyond = |t: f64, most: f64| (t - t.clamp(0.0, most)).powi(2);
        match self.shape {
            Shape::Cell(_) => natural.iter().map(|t| beyond(*t, 1.0)).sum(),
            Shape::Tetrahedron(..) => {
                let first = 1.0 - natural.iter().sum::<f64>();
                natural.iter().chain([&first]).map(|t| beyond(*t, f64::INFINITY)).sum()
            }
        }
    }

    /// Shape functions at a position; they extrapolate beyond it.
    pub fn weights(&self, at: [f64; 3]) -> [f64; 8] {
        let natural = self.natural(at);
        match self.shape {
            Shape::Cell(_) => trilinear(natural),
            Shape::Tetrahedron(..) => {
                let [a, b, c] = natural;
                [1.0 - a - b - c, a, b, c, 0.0, 0.0, 0.0, 0.0]
            }
        }
    }

    /// Gradients of the shape functions at a position, 1/m.
    pub fn gradients(&self, at: [f64; 3]) -> [[f64; 3]; 8] {
        match self.shape {
            Shape::Cell(edges) => {
                let natural = self.natural(at);
                let along = |a: usize, axis: usize| {
                    let sign = if corner(a)[axis] == 1 { 1.0 } else { -1.0 };
                    let side = |n: usize| if corner(a)[n] == 1 { natural[n] } else { 1.0 - natural[n] };
                    sign / edges[axis] * (0..3).filter(|n| *n != axis).map(side).product::<f64>()
                };
                std::array::from_fn(|a| [0, 1, 2].map(|axis| along(a, axis)))
            }
            Shape::Tetrahedron(_, inverse) => {
                let [a, b, c] = inverse.transpose().0;
                let mut all = [[0.0; 3]; 8];
                (all[0], all[1], all[2], all[3]) = ((V3::zero() - a - b - c).f64(), a.f64(), b.f64(), c.f64());
                all
            }
        }
    }

    /// Middle, m.
    pub fn middle(&self) -> [f64; 3] {
        match self.shape {
            Shape::Cell(_) => self.position([0.5; 3]),
            Shape::Tetrahedron(..) => self.position([0.25; 3]),
        }
    }

    /// How much what has the gradient `slope` differs over it.
    pub fn range(&self, slope: [f64; 3]) -> f64 {
        match self.shape {
            Shape::Cell(edges) => (0..3).map(|n| slope[n].abs() * edges[n]).sum(),
            Shape::Tetrahedron(edges, _) => differ(edges.0.map(|edge| edge.dot(V3::of(slope)))),
        }
    }

    /// Middle of a sample, m.
    pub fn sample(&self, k: usize) -> [f64; 3] {
        match self.shape {
            Shape::Cell(_) => self.in_sample(k, [0.5; 3]),
            Shape::Tetrahedron(..) => {
                let corners = of_tetrahedron(k);
                self.position([0, 1, 2].map(|n| 0.25 * corners.iter().map(|corner| corner[n]).sum::<f64>()))
            }
        }
    }

    /// How much what has the gradient `slope` differs over a sample.
    pub fn range_of_sample(&self, k: usize, slope: [f64; 3]) -> f64 {
        let Shape::Tetrahedron(edges, _) = self.shape else { return self.range(slope) / SIDE as f64 };
        let along = edges.0.map(|edge| edge.dot(V3::of(slope)));
        let [o, a, b, c] = of_tetrahedron(k);
        let value = |x: [f64; 3]| (0..3).map(|n| along[n] * (x[n] - o[n])).sum::<f64>();
        differ([a, b, c].map(value))
    }

    /// Position in a sample of a cell, at shares of its edges from its lowest corner, m.
    fn in_sample(&self, k: usize, shares: [f64; 3]) -> [f64; 3] {
        let at = [k % SIDE, k / SIDE % SIDE, k / SIDE / SIDE];
        self.position([0, 1, 2].map(|n| (at[n] as f64 + shares[n]) / SIDE as f64))
    }

    /// Points on top of what is left of a sample, `left` of its height if it is taken from above, m: its sides where it has lost half, or its middle.
    pub fn tops(&self, k: usize, left: f64) -> Vec<[f64; 3]> {
        let half = left < 0.5;
        match self.shape {
            Shape::Cell(_) => {
                let sides: &[f64] = if half { &[0.0, 1.0] } else { &[0.5] };
                sides.iter().map(|side| self.in_sample(k, [*side, *side, left])).collect()
            }
            Shape::Tetrahedron(..) => {
                let corners = of_tetrahedron(k).map(|natural| self.position(natural));
                let bound = |of: fn(f64, f64) -> f64| corners.iter().map(|x| x[2]).reduce(of).unwrap_or_default();
                let (low, high) = (bound(f64::min), bound(f64::max));
                let middle = self.sample(k);
                let all: &[[f64; 3]] = if half { &corners } else { &[middle] };
                all.iter().map(|x| [x[0], x[1], low + left * (high - low)]).collect()
            }
        }
    }
}

/// Largest difference between values and 0, and among them.
fn differ(values: [f64; 3]) -> f64 {
    let bound = |of: fn(f64, f64) -> f64| values.into_iter().fold(0.0, of);
    bound(f64::max) - bound(f64::min)
}

/// Natural coordinates of the corners of a sample of a tetrahedron.
fn of_tetrahedron(k: usize) -> [[f64; 3]; 4] {
    static ALL: LazyLock<Vec<[[f64; 3]; 4]>> = LazyLock::new(of_tetrahedra);
    ALL[k]
}

/// Those of all samples. A cube of 4³ boxes, each of six tetrahedra along its diagonal (Kuhn 1960), holds 64 of them in `x ≥ y ≥ z`, a
/// tetrahedron with the natural coordinates `x − y`, `y − z`, `z`.
fn of_tetrahedra() -> Vec<[[f64; 3]; 4]> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let side = SIDE as f64;
    let mut all = vec![];
    for at in 0..SAMPLES {
        for order in ORDERS {
            let mut corners = [[at % SIDE, at / SIDE % SIDE, at / SIDE / SIDE]; 4];
            for step in 1..4 {
                corners[step] = corners[step - 1];
                corners[step][order[step - 1]] += 1;
            }
            if corners.iter().all(|[x, y, z]| x >= y && y >= z) {
                all.push(corners.map(|[x, y, z]| [(x - y) as f64 / side, (y - z) as f64 / side, z as f64 / side]));
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_fill_a_tetrahedron_with_equal_volumes() {
        let volume =
            |[o, a, b, c]: [[f64; 3]; 4]| M3::<f64>([a, b, c].map(|x| V3::of(x) - V3::of(o))).determinant().abs();
        let mut all = vec![];
        for k in 0..SAMPLES {
            let corners = of_tetrahedron(k);
            assert!((volume(corners) - 1.0 / SAMPLES as f64).abs() < 1e-15, "{k}");
            let inside = |x: &[f64; 3]| x.iter().all(|t| *t >= 0.0) && x.iter().sum::<f64>() <= 1.0;
            assert!(corners.iter().all(inside), "{k}");
            all.push(corners.map(|x| x.map(|t| (4.0 * t) as u32)));
        }
        // in as many places
        all.iter_mut().for_each(|corners| corners.sort_unstable());
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), SAMPLES);
    }
}
