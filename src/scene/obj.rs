//! What a scene takes of Wavefront OBJ files: triangles, segments and points of tools, in metres.

use super::ToolMesh;
use super::diagnose::shorten;
use super::invalid::{Invalid, Location, Result};
use crate::formats::obj::Obj;
use std::collections::BTreeMap;

/// Segments of the polylines.
pub(super) fn segments(obj: &Obj) -> Result<Vec<[usize; 2]>> {
    let mut segments = vec![];
    for (ids, line) in obj.lists("l", 2).map_err(Invalid::Mesh)? {
        for pair in ids.windows(2) {
            if obj.vertices[pair[0]] == obj.vertices[pair[1]] {
                let at = Location::new(obj.path, line);
                return Err(Invalid::LinesShort { at, a: pair[0] + 1, b: pair[1] + 1 });
            }
            segments.push([pair[0], pair[1]]);
        }
    }
    Ok(segments)
}

/// Points.
pub(super) fn points(obj: &Obj) -> Result<Vec<usize>> {
    Ok(obj.lists("p", 1).map_err(Invalid::Mesh)?.into_iter().flat_map(|(ids, _)| ids).collect())
}

/// Position of a vertex, m; `unit` is one unit of the file in m.
pub(super) fn position(obj: &Obj, id: usize, unit: f64) -> Result<[f64; 3]> {
    let position = obj.vertices[id].map(|coordinate| coordinate * unit);
    if position.iter().all(|coordinate| (*coordinate as f32).is_finite()) {
        return Ok(position);
    }
    let (line, text) = obj.line(id);
    Err(Invalid::ObjFar { at: Location::new(obj.path, line), found: shorten(text) })
}

/// The faces as triangle fans, on the vertices that they use.
pub(super) fn triangles(obj: &Obj, unit: f64) -> Result<ToolMesh> {
    let mut used = BTreeMap::new(); // number of each vertex in use, in the order of use
    let mut mesh = ToolMesh { positions: vec![], triangles: vec![] };
    for (ids, _) in obj.lists("f", 3).map_err(Invalid::Mesh)? {
        let mut corners = vec![];
        for id in ids {
            if let std::collections::btree_map::Entry::Vacant(new) = used.entry(id) {
                new.insert(mesh.positions.len() as u32);
                mesh.positions.push(position(obj, id, unit)?);
            }
            corners.push(used[&id]);
        }
        mesh.triangles.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
    }
    match mesh.triangles.is_empty() {
        true => Err(Invalid::MeshEmpty { path: obj.path.to_path_buf() }),
        false => Ok(mesh),
    }
}
