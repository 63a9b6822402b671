//! What goes between the page and the session: commands as JSON, the scene as JSON, surface and motion in binary.
//!
//! Little-endian, each message padded to 4 bytes. **Surface** (first byte 1), sent when it changes: bytes 1 to 3 zero; `u32` number of the
//! surface, of its vertices, triangles, lines of rims and lines between cells; rest positions, `f32 × 3` m; per vertex `u8 × 4`: number of its layer over all
//! bodies, 1 in a wound's wall, two zeros; triangles, `u32 × 3`; both kinds of lines, `u32 × 2`. **Frame** (first byte 2): bytes 1 to 3 zero; `u32` number of its
//! surface and of the frame; `f32` time, s; lower corner and size of the box of displacements, `f32 × 3` m each; `u32` vertices, tools,
//! contacts; displacements as shares of that box, `u16 × 3`, padded; per tool position, quaternion, force, and position of the hand, `f32 ×
//! 13` (m, N); per contact point and force, `f32 × 6`.
//!
//! Of a displacement of 6 mm, 1/65535 is 0.1 µm.

use crate::report::frames::{Faces, SkinSurface};
use crate::scene::{Scene, Skin};
use crate::session::Shown;
use crate::view::VIRIDIS;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Longest command, bytes.
pub const LONGEST: usize = 1 << 12;

/// The scene for the page: layers with their colours, tools with their meshes, camera, colour map.
pub fn scene(scene: &Scene, held: &[bool]) -> Value {
    let layers = |skin: &Skin| -> Vec<Value> {
        skin.layers.iter().map(|layer| json!({ "name": layer.name, "color": layer.color })).collect()
    };
    let tool = |(tool, held): (&crate::scene::Tool, &bool)| {
        json!({
            "name": tool.name, "held": held, "cuts": tool.blade.is_some(),
            "positions": tool.mesh.positions, "triangles": tool.mesh.triangles,
        })
    };
    let view = &scene.view;
    json!({ "scene": {
        "title": scene.title,
        "layers": scene.skins.iter().flat_map(layers).collect::<Vec<_>>(),
        "tools": scene.tools.iter().zip(held).map(tool).collect::<Vec<_>>(),
        "eye": view.eye, "target": view.target, "field_of_view_deg": view.field_of_view,
        "step_ms": scene.time.step * 1e3, "duration_s": scene.time.duration,
        "color_map": VIRIDIS,
        "friction": scene.contact.map(|contact| contact.friction), "tolerance": scene.solver.tolerance,
    }})
}

/// Vertices of a surface: one per node and layer, another one in the walls of wounds, so that colours and normals have creases there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vertices {
    /// `[vertex]` node
    nodes: Vec<u32>,
    /// `[vertex]` layer over all bodies, and 1 in a wound's wall
    kinds: Vec<[u8; 2]>,
    /// `[triangle]` vertices
    triangles: Vec<[u32; 3]>,
    /// `[line]` vertices of rims, and of edges of cells
    lines: [Vec<[u32; 2]>; 2],
}

impl Vertices {
    /// Vertices of the present surface.
    pub fn new(surface: &SkinSurface, scene: &Scene) -> Self {
        let mut first_layer = vec![0];
        for skin in &scene.skins {
            first_layer.push(first_layer[first_layer.len() - 1] + skin.layers.len() as u32);
        }
        let mut out = Self::default();
        let mut numbers: BTreeMap<(u32, [u8; 2]), u32> = BTreeMap::new();
        let mut add = |faces: &Faces, wall: u8, out: &mut Self| {
            for (triangle, [body, layer]) in faces.triangles.iter().zip(&faces.layers) {
                let kind = [(first_layer[*body as usize] + layer).min(255) as u8, wall];
                let corners = triangle.map(|node| {
                    *numbers.entry((node, kind)).or_insert_with(|| {
                        out.nodes.push(node);
                        out.kinds.push(kind);
                        out.nodes.len() as u32 - 1
                    })
                });
                out.triangles.push(corners);
            }
        };
        add(&surface.skin, 0, &mut out);
        add(&surface.walls, 1, &mut out);
        // a line's nodes may have several vertices; any of them is where the node is
        let mut any = BTreeMap::new();
        for (vertex, node) in out.nodes.iter().enumerate() {
            any.insert(*node, vertex as u32);
        }
        let line = |[a, b]: &[u32; 2]| Some([*any.get(a)?, *any.get(b)?]);
        let cells = surface.skin.edges.iter().chain(&surface.walls.edges);
        out.lines = [surface.rims.iter().filter_map(line).collect(), cells.filter_map(line).collect()];
        out
    }

    /// Message with the surface, number `number`.
    pub fn message(&self, number: u32, surface: &SkinSurface) -> Vec<u8> {
        let [rims, cells] = &self.lines;
        let counts = [self.nodes.len(), self.triangles.len(), rims.len(), cells.len()].map(|n| n as u32);
        let mut out: Vec<u8> = vec![1, 0, 0, 0];
        out.extend(number.to_le_bytes());
        counts.iter().for_each(|count| out.extend(count.to_le_bytes()));
        for node in self.nodes.iter().map(|n| *n as usize) {
            let (x, u) = (surface.positions[node], surface.displacements[node]);
            (0..3).for_each(|k| out.extend(((x[k] - u[k]) as f32).to_le_bytes()));
        }
        self.kinds.iter().for_each(|[layer, wall]| out.extend([*layer, *wall, 0, 0]));
        let words = self.triangles.as_flattened().iter().chain(rims.as_flattened()).chain(cells.as_flattened());
        words.for_each(|word| out.extend(word.to_le_bytes()));
        out
    }

    /// Message with the present motion: the frame's number, the surface's, and the last step's report.
    pub fn frame(&self, [number, of_surface]: [u32; 2], shown: &Shown) -> Vec<u8> {
        let Shown { surface, simulation, hands, report, .. } = shown;
        let u = |node: &u32| surface.displacements[*node as usize];
        // the box of the displacements
        let (mut low, mut high) = ([0.0f64; 3], [0.0f64; 3]);
        for value in self.nodes.iter().map(u) {
            (low, high) =
                (std::array::from_fn(|k| low[k].min(value[k])), std::array::from_fn(|k| high[k].max(value[k])));
        }
        let size: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
        let mut out: Vec<u8> = vec![2, 0, 0, 0];
        let contact = &report.contact;
        let counts = [self.nodes.len(), simulation.tools.len(), contact.contacts.len()].map(|n| n as u32);
        for word in [of_surface, number, (simulation.time as f32).to_bits()] {
            out.extend(word.to_le_bytes());
        }
        low.iter().chain(&size).for_each(|v| out.extend((*v as f32).to_le_bytes()));
        counts.iter().for_each(|count| out.extend(count.to_le_bytes()));
        // displacements as shares of the box
        for value in self.nodes.iter().map(u) {
            for k in 0..3 {
                let share = if size[k] > 0.0 { (value[k] - low[k]) / size[k] } else { 0.0 };
                out.extend(((share * 65535.0).round() as u16).to_le_bytes());
            }
        }
        out.resize(out.len().next_multiple_of(4), 0);
        let mut put = |values: &[f64]| values.iter().for_each(|v| out.extend((*v as f32).to_le_bytes()));
        for (number, tool) in simulation.tools.iter().enumerate() {
            put(&tool.position.to_array());
            put(&tool.rotation.to_array());
            put(contact.on_tool.get(number).unwrap_or(&[0.0; 3]));
            put(hands.get(number).unwrap_or(&tool.position.to_array()));
        }
        for (at, force) in contact.contacts.iter().zip(&contact.forces) {
            put(&at.point.to_array());
            put(&at.in_world(*force).to_array());
        }
        out
    }
}
