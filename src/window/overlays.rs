//! What is drawn beside the surface: the cells that the clipping plane lays open, and contact forces as arrows.

use super::state::Shows;
use crate::report::frames::{CELL_INK, CELL_LINE, SKIN_SHININESS};
use crate::report::slice::Slice;
use crate::scene::Scene;
use crate::session::Values;
use crate::view::{Outline, Paint, Surface};
use glam::DVec3;

/// What the clipping plane lays open, as it is drawn: the present cells' polygons in the colours of their layers, or of values.
pub struct Opened<'a> {
    positions: &'a [[f64; 3]],
    triangles: Vec<[u32; 3]>,
    /// `[triangle]`, or with `of_vertices` `[vertex]`
    colors: Vec<[u8; 3]>,
    of_vertices: bool,
    edges: Vec<[u32; 2]>,
}

impl<'a> Opened<'a> {
    /// Without the layers that are hidden; `color` is that of a value.
    pub fn new(
        slice: &'a Slice,
        scene: &Scene,
        shows: &Shows,
        values: Option<&Values>,
        color: impl Fn(f64) -> [u8; 3],
    ) -> Self {
        let kept: Vec<usize> =
            (0..slice.triangles.len()).filter(|t| !shows.hidden.contains(&slice.layers[*t])).collect();
        let triangles: Vec<[u32; 3]> = kept.iter().map(|t| slice.triangles[*t]).collect();
        let of_layer = |[body, layer]: [u32; 2]| scene.skins[body as usize].layers[layer as usize].color;
        let (colors, of_vertices) = match values {
            None => (kept.iter().map(|t| of_layer(slice.layers[*t])).collect(), false),
            Some(values) => (values.slice.iter().map(|value| color(*value)).collect(), true),
        };
        let mut edges = vec![];
        if shows.cells {
            let mut seen = vec![false; slice.positions.len()];
            triangles.as_flattened().iter().for_each(|vertex| seen[*vertex as usize] = true);
            edges.extend(slice.edges.iter().filter(|[a, _]| seen[*a as usize]));
        }
        Self { positions: &slice.positions, triangles, colors, of_vertices, edges }
    }

    /// Lines between its cells.
    pub fn lines(&self) -> [Outline<'_>; 1] {
        [Outline { lines: &self.edges, width: CELL_LINE, ink: CELL_INK }]
    }

    /// The surface; `lines` are [`Opened::lines`].
    pub fn surface<'b>(&'b self, lines: &'b [Outline<'b>]) -> Surface<'b> {
        let colors = if self.of_vertices { Paint::Vertices(&self.colors) } else { Paint::Triangles(&self.colors) };
        let Self { positions, triangles, .. } = self;
        Surface { positions, triangles, colors, smooth: false, outlines: lines, shininess: SKIN_SHININESS }
    }
}

/// Length of an arrow per force, m/N: a contact point of a blade bears some 10 mN.
const LENGTH: f64 = 0.05;
/// Shortest arrow that is drawn, m.
const SHORTEST: f64 = 1e-5;
/// Width of a head as a share of the camera's distance, its length in widths, the shaft's width as a share of it.
const HEAD: f64 = 0.006;
const HEAD_LENGTH: f64 = 3.0;
const SHAFT: f64 = 0.35;
/// Sides of an arrow.
const SIDES: u32 = 8;
/// Colour, sRGB.
pub const BLUE: [u8; 3] = [11, 98, 164];

/// Contact forces as arrows: mesh of all of them.
#[derive(Default)]
pub struct Arrows {
    /// `[vertex]` m
    pub positions: Vec<[f64; 3]>,
    /// `[triangle]` vertex ids
    pub triangles: Vec<[u32; 3]>,
}

impl Arrows {
    /// Arrows from points (m) along forces (N), as wide as a camera at this distance (m) wants them.
    pub fn new(forces: &[[[f64; 3]; 2]], distance: f64) -> Self {
        let mut out = Self::default();
        for [point, force] in forces {
            let along = DVec3::from(*force) * LENGTH;
            if along.is_finite() && along.length() > SHORTEST {
                out.add((*point).into(), along, HEAD * distance);
            }
        }
        out
    }

    /// A shaft, then a cone; both open below, where nobody looks.
    fn add(&mut self, from: DVec3, along: DVec3, width: f64) {
        let (length, axis) = (along.length(), along.normalize());
        let (u, v) = axis.any_orthonormal_pair();
        let neck = from + axis * (length - (HEAD_LENGTH * width).min(0.6 * length));
        let mut ring = |center: DVec3, radius: f64| {
            let first = self.positions.len() as u32;
            self.positions.extend((0..SIDES).map(|k| {
                let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / f64::from(SIDES)).sin_cos();
                (center + (u * cos + v * sin) * radius).to_array()
            }));
            first
        };
        let rings = [ring(from, 0.5 * SHAFT * width), ring(neck, 0.5 * SHAFT * width), ring(neck, 0.5 * width)];
        let tip = self.positions.len() as u32;
        self.positions.push((from + along).to_array());
        for k in 0..SIDES {
            let next = (k + 1) % SIDES;
            let [a, b, c] = rings;
            self.triangles.push([a + k, a + next, b + k]);
            self.triangles.push([b + k, a + next, b + next]);
            self.triangles.push([c + k, c + next, tip]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arrow_is_as_long_as_its_force_and_none_has_none() {
        let arrows = Arrows::new(&[[[0.0, 0.0, 0.01], [0.0, 0.0, 0.5]], [[0.0; 3], [0.0; 3]]], 0.05);
        let high = arrows.positions.iter().map(|p| p[2]).fold(f64::MIN, f64::max);
        assert!((high - 0.035).abs() < 1e-12 && arrows.triangles.len() == 3 * SIDES as usize, "{high}");
        assert!(Arrows::new(&[[[0.0; 3], [f64::NAN, 0.0, 0.0]]], 0.05).positions.is_empty());
    }
}
