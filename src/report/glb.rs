//! glTF 2.0 in its binary form (`.glb`): triangle meshes with colours at their vertices. Khronos Group 2021, ISO/IEC 12113:2022.
//!
//! ```text
//! "glTF" · version 2 · length        u32 each, little-endian, as all numbers
//! length · "JSON" · the description  padded with blanks to a multiple of 4 bytes
//! length · "BIN"  · positions f32, colours f32 (linear), indices u32, of one mesh after the other
//! ```
//! Positions are metres with z up; each mesh's node turns them to glTF's y up.

use serde_json::{Value, json};
use std::collections::HashMap;

/// Component types, and targets of buffer views.
const U32: u32 = 5125;
const F32: u32 = 5126;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;
/// A quarter turn about x, from z up to y up, as quaternion x, y, z, w.
const UPRIGHT: [f64; 4] = [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2];

/// A mesh of its own.
pub(super) struct Part<'a> {
    pub name: &'a str,
    /// `[point]` m
    pub points: Vec<[f64; 3]>,
    /// `[triangle]` point ids
    pub triangles: Vec<[u32; 3]>,
    /// `[triangle]` sRGB
    pub colors: Vec<[u8; 3]>,
    /// Metal, or moist tissue.
    pub metal: bool,
}

/// A file of these meshes; those without triangles are left out. A file without any has an empty scene.
pub(super) fn bytes(parts: &[Part]) -> Vec<u8> {
    let mut out = File::default();
    parts.iter().filter(|part| !part.triangles.is_empty()).for_each(|part| out.add(part));
    out.finish()
}

#[derive(Default)]
struct File {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
}

impl File {
    /// Appends an array of elements of one shape; returns the number of its accessor.
    fn array(&mut self, data: &[u8], target: u32, mut accessor: Value) -> usize {
        accessor["bufferView"] = json!(self.views.len());
        self.views
            .push(json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": data.len(), "target": target }));
        self.binary.extend(data);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn add(&mut self, part: &Part) {
        // a point has a vertex per colour around it
        let mut known: HashMap<(u32, [u8; 3]), u32> = HashMap::new();
        let mut vertices: Vec<(u32, [u8; 3])> = vec![];
        let mut indices: Vec<u8> = vec![];
        for (ids, color) in part.triangles.iter().zip(&part.colors) {
            for id in ids {
                let vertex = *known.entry((*id, *color)).or_insert_with(|| {
                    vertices.push((*id, *color));
                    vertices.len() as u32 - 1
                });
                indices.extend(vertex.to_le_bytes());
            }
        }
        let place = |(id, _): &(u32, [u8; 3])| part.points[*id as usize].map(|c| c as f32);
        let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
        for p in vertices.iter().map(place) {
            for n in 0..3 {
                (low[n], high[n]) = (low[n].min(p[n]), high[n].max(p[n]));
            }
        }
        let floats = |values: &mut dyn Iterator<Item = [f32; 3]>| -> Vec<u8> {
            values.flatten().flat_map(f32::to_le_bytes).collect()
        };
        let positions = floats(&mut vertices.iter().map(place));
        let colors = floats(&mut vertices.iter().map(|(_, color)| color.map(linear)));
        let of_points =
            json!({ "componentType": F32, "count": vertices.len(), "type": "VEC3", "min": low, "max": high });
        let position = self.array(&positions, VERTICES, of_points);
        let of_colors = json!({ "componentType": F32, "count": vertices.len(), "type": "VEC3" });
        let color = self.array(&colors, VERTICES, of_colors);
        let of_indices = json!({ "componentType": U32, "count": indices.len() / 4, "type": "SCALAR" });
        let index = self.array(&indices, INDICES, of_indices);
        let attributes = json!({ "POSITION": position, "COLOR_0": color });
        let primitive = json!({ "attributes": attributes, "indices": index, "material": u32::from(part.metal) });
        self.nodes.push(json!({ "name": part.name, "mesh": self.meshes.len(), "rotation": UPRIGHT }));
        self.meshes.push(json!({ "name": part.name, "primitives": [primitive] }));
    }

    fn finish(self) -> Vec<u8> {
        let material = |name: &str, metallic: f64, roughness: f64| {
            json!({
                "name": name,
                "doubleSided": true,
                "pbrMetallicRoughness": { "metallicFactor": metallic, "roughnessFactor": roughness },
            })
        };
        let mut file = json!({
            "asset": { "version": "2.0", "generator": concat!("cutis ", env!("CARGO_PKG_VERSION")) },
            "scene": 0,
            "scenes": [{}],
        });
        // glTF has no empty lists
        if !self.nodes.is_empty() {
            file["scenes"] = json!([{ "nodes": (0..self.nodes.len()).collect::<Vec<_>>() }]);
            file["nodes"] = self.nodes.into();
            file["meshes"] = self.meshes.into();
            file["materials"] = json!([material("tissue", 0.0, 0.6), material("steel", 0.8, 0.35)]);
            file["accessors"] = self.accessors.into();
            file["bufferViews"] = self.views.into();
            file["buffers"] = json!([{ "byteLength": self.binary.len() }]);
        }
        let mut text = file.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let chunks = if self.binary.is_empty() { vec![] } else { vec![(b"BIN\0", &self.binary)] };
        let chunks: Vec<(&[u8; 4], &Vec<u8>)> = [(b"JSON", &text)].into_iter().chain(chunks).collect();
        let length: usize = 12 + chunks.iter().map(|(_, data)| 8 + data.len()).sum::<usize>();
        let mut out = Vec::with_capacity(length);
        out.extend(b"glTF");
        out.extend(2u32.to_le_bytes());
        out.extend((length as u32).to_le_bytes());
        for (kind, data) in chunks {
            out.extend((data.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(data);
        }
        out
    }
}

/// Linear value of an sRGB channel. IEC 61966-2-1.
fn linear(channel: u8) -> f32 {
    let c = f32::from(channel) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}
