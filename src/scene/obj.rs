//! What a scene takes of Wavefront OBJ files: triangles, segments and points of tools, in metres; and tools of points and lines, the `v`,
//! `l` and `p` lines of such a file, with their contact filter.
//!
//! Polylines (`l 1 2 3`) become segments between consecutive vertices; `p 1 2` adds points that are on no line. Faces are skipped, so the
//! same file may show the tool.

use super::files::Files;
use super::invalid::{Invalid, Location, Result};
use super::raw::{self, At};
use super::text::{SceneText, or, shorten};
use super::{Filter, Lines, Tool, ToolMesh};
use crate::formats::obj::Obj;
use std::collections::BTreeMap;

/// Segments of the polylines.
fn segments(obj: &Obj) -> Result<Vec<[usize; 2]>> {
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
fn points(obj: &Obj) -> Result<Vec<usize>> {
    Ok(obj.lists("p", 1).map_err(Invalid::Mesh)?.into_iter().flat_map(|(ids, _)| ids).collect())
}

/// Position of a vertex, m; `unit` is one unit of the file in m.
fn position(obj: &Obj, id: usize, unit: f64) -> Result<[f64; 3]> {
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

/// Points and segments of a tool.
pub(super) fn lines(scene: &SceneText, files: &Files, raw: &raw::Lines) -> Result<Lines> {
    let unit = scene.number_or(&raw::Lines::mesh_unit_mm, raw.mesh_unit_mm.clone())?;
    let radius = scene.number_or(&raw::Lines::radius_mm, raw.radius_mm.clone())?;
    let (path, text) = files.text(scene, "mesh", &raw.mesh)?;
    let file = Obj::read(&text, &path).map_err(Invalid::Mesh)?;
    let (points, segments) = (points(&file)?, segments(&file)?);
    let mut ids = [&points[..], segments.as_flattened()].concat();
    ids.sort_unstable();
    ids.dedup();
    if ids.is_empty() {
        return Err(Invalid::LinesEmpty { path });
    }
    let positions = ids.iter().map(|id| position(&file, *id, unit)).collect::<Result<_>>()?;
    let number = |id: usize| ids.partition_point(|known| *known < id) as u32;
    let segments = segments.iter().map(|ends| ends.map(number)).collect();
    Ok(Lines { positions, segments, radius })
}

/// Contact filter of the scene; it must suit all tools.
pub(super) fn filter(scene: &SceneText, word: Option<At<String>>, tools: &[Tool]) -> Result<Filter> {
    let Some(word) = word else {
        return Ok(Filter::Own);
    };
    let filter = scene.choice(&raw::Contact::filter, &word)?;
    let unfit = |tool: &&Tool| match filter {
        Filter::One => tool.lines.is_some(),
        Filter::Cones => tool.round.is_some(),
        Filter::Points | Filter::Own => false,
    };
    let misfit = |tool: &Tool, fits| Invalid::FilterTool {
        at: scene.location(word.span()),
        filter: word.get_ref().clone(),
        tool: tool.name.clone(),
        fits,
    };
    match tools.iter().find(unfit) {
        Some(tool) if filter == Filter::One => {
            Err(misfit(tool, "tools with a `round` table, and this one has `lines`"))
        }
        Some(tool) => Err(misfit(tool, "tools with a `lines` table, and this one is `round`")),
        None => Ok(filter),
    }
}

/// Widening of the normal cones of [`Filter::Cones`]; an error if the key has no effect.
pub(super) fn angle_cone(scene: &SceneText, raw: Option<At<f64>>, filter: Filter, tools: &[Tool]) -> Result<f64> {
    if !tools.iter().any(|tool| tool.lines.is_some()) {
        scene.needless("angle_cone", &raw, "no tool has a `lines` table")?;
    }
    if filter == Filter::Points {
        scene.needless("angle_cone", &raw, "filter = \"points\" looks at no cones")?;
    }
    scene.number(&raw::Contact::angle_cone, &or(raw, 0.02))
}
