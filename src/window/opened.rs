//! What the clipping plane lays open, as it is drawn: the present cells' polygons in the colours of their layers, or of values.

use super::state::Shows;
use crate::report::frames::{CELL_INK, CELL_LINE, SKIN_SHININESS};
use crate::report::slice::Slice;
use crate::scene::Scene;
use crate::session::Values;
use crate::view::{Outline, Paint, Surface};

/// See the module.
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
