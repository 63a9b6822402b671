//! What goes between the page and the session: commands as JSON, the scene as JSON, surface and motion in binary.
//!
//! Little-endian, each message padded to 4 bytes. **Surface** (first byte 1), sent when it changes: bytes 1 to 3 zero; `u32` number of the
//! surface, of its vertices, triangles, lines of rims and lines between cells; rest positions, `f32 × 3` m; per vertex `u8 × 4`: number of its layer over all
//! bodies, 1 in a wound's wall, two zeros; triangles, `u32 × 3`; both kinds of lines, `u32 × 2`. **Frame** (first byte 2): bytes 1 to 3 zero; `u32` number of its
//! surface and of the frame; `f32` time, s; lower corner and size of the box of displacements, `f32 × 3` m each; `u32` vertices, tools,
//! contacts; number of the quantity that colours are of in the scene's list, from 1, or 0; `f32` its largest value; `u32` vertices, triangles
//! and lines of the slice that a plane lays open; displacements as shares of that box, `u16 × 3`, padded; with a quantity, its values as shares of
//! the largest one, `u16`, padded; per tool position, quaternion, force, and position of the hand, `f32 × 13` (m, N); per contact point and
//! force, `f32 × 6`; of the slice positions, `f32 × 3`, per vertex `u8 × 4` (layer and three zeros), with a quantity values as above, triangles and
//! lines.
//!
//! Of a displacement of 6 mm, 1/65535 is 0.1 µm.

use crate::report::frames::{Faces, SkinSurface};
use crate::report::slice::Slice;
use crate::scene::{Scene, Skin};
use crate::session::{Quantity, Shown, Values};
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
    let quantity = |of: Quantity| {
        let (unit, factor) = of.unit();
        json!({ "key": of, "name": of.name(), "unit": unit, "factor": factor })
    };
    let view = &scene.view;
    json!({ "scene": {
        "title": scene.title,
        "layers": scene.skins.iter().flat_map(layers).collect::<Vec<_>>(),
        "tools": scene.tools.iter().zip(held).map(tool).collect::<Vec<_>>(),
        "eye": view.eye, "target": view.target, "field_of_view_deg": view.field_of_view,
        "step_ms": scene.time.step * 1e3, "duration_s": scene.time.duration,
        "color_map": VIRIDIS, "quantities": Quantity::ALL.map(quantity),
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
    /// `[body]` number of its first layer over all bodies
    first_layer: Vec<u32>,
}

impl Vertices {
    /// Vertices of the present surface.
    pub fn new(surface: &SkinSurface, scene: &Scene) -> Self {
        let mut first_layer = vec![0];
        for skin in &scene.skins {
            first_layer.push(first_layer[first_layer.len() - 1] + skin.layers.len() as u32);
        }
        let mut out = Self { first_layer, ..Self::default() };
        let mut numbers: BTreeMap<(u32, [u8; 2]), u32> = BTreeMap::new();
        let mut add = |faces: &Faces, wall: u8, out: &mut Self| {
            for (triangle, of) in faces.triangles.iter().zip(&faces.layers) {
                let kind = [out.layer(*of), wall];
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

    /// Number over all bodies of a body's layer.
    fn layer(&self, [body, layer]: [u32; 2]) -> u8 {
        (self.first_layer[body as usize] + layer).min(255) as u8
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
        let Shown { surface, simulation, hands, report, read, .. } = shown;
        let u = |node: &u32| surface.displacements[*node as usize];
        // the box of the displacements
        let (mut low, mut high) = ([0.0f64; 3], [0.0f64; 3]);
        for value in self.nodes.iter().map(u) {
            (low, high) =
                (std::array::from_fn(|k| low[k].min(value[k])), std::array::from_fn(|k| high[k].max(value[k])));
        }
        let size: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
        let contact = &report.contact;
        let counts = [self.nodes.len(), simulation.tools.len(), contact.contacts.len()].map(|n| n as u32);
        // head
        let mut out = Message(vec![2, 0, 0, 0]);
        out.words(&[of_surface, number, (simulation.time as f32).to_bits()]);
        out.floats(&low);
        out.floats(&size);
        out.words(&counts);
        let values = read.values.as_ref();
        let quantity = values.and_then(|values| Quantity::ALL.iter().position(|of| *of == values.of));
        out.words(&[quantity.map_or(0, |number| number as u32 + 1)]);
        let largest = values.map_or(0.0, Values::high);
        out.floats(&[largest]);
        let none = Slice::default();
        let slice = read.slice.as_ref().unwrap_or(&none);
        out.words(&[slice.positions.len(), slice.triangles.len(), slice.edges.len()].map(|n| n as u32));
        // displacements, values
        out.shares(self.nodes.iter().map(u).flat_map(|value| {
            std::array::from_fn::<f64, 3, _>(|k| if size[k] > 0.0 { (value[k] - low[k]) / size[k] } else { 0.0 })
        }));
        let share = |value: f64| if largest > 0.0 { (value / largest).clamp(0.0, 1.0) } else { 0.0 };
        if let Some(values) = values {
            out.shares(self.nodes.iter().map(|node| share(values.nodes[*node as usize])));
        }
        // tools, contacts
        for (number, tool) in simulation.tools.iter().enumerate() {
            out.floats(&tool.position.to_array());
            out.floats(&tool.rotation.to_array());
            out.floats(contact.on_tool.get(number).unwrap_or(&[0.0; 3]));
            out.floats(hands.get(number).unwrap_or(&tool.position.to_array()));
        }
        for (at, force) in contact.contacts.iter().zip(&contact.forces) {
            out.floats(&at.point.to_array());
            out.floats(&at.in_world(*force).to_array());
        }
        // the slice
        slice.positions.iter().for_each(|at| out.floats(at));
        let mut layers = vec![0; slice.positions.len()];
        for (triangle, of) in slice.triangles.iter().zip(&slice.layers) {
            triangle.iter().for_each(|vertex| layers[*vertex as usize] = self.layer(*of));
        }
        layers.into_iter().for_each(|layer| out.0.extend([layer, 0, 0, 0]));
        if let Some(values) = values {
            out.shares(values.slice.iter().map(|value| share(*value)));
        }
        out.words(slice.triangles.as_flattened());
        out.words(slice.edges.as_flattened());
        out.0
    }
}

/// A message in the making.
struct Message(Vec<u8>);

impl Message {
    fn words(&mut self, words: &[u32]) {
        words.iter().for_each(|word| self.0.extend(word.to_le_bytes()));
    }

    fn floats(&mut self, values: &[f64]) {
        values.iter().for_each(|value| self.0.extend((*value as f32).to_le_bytes()));
    }

    /// Values from 0 to 1 in 16 bits, padded.
    fn shares(&mut self, values: impl Iterator<Item = f64>) {
        values.for_each(|share| self.0.extend(((share * 65535.0).round() as u16).to_le_bytes()));
        self.0.resize(self.0.len().next_multiple_of(4), 0);
    }
}
