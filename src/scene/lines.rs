//! Tools of points and lines: the `v`, `l` and `p` lines of a Wavefront OBJ, and their contact filter.
//!
//! Polylines (`l 1 2 3`) become segments between consecutive vertices; `p 1 2` adds points that are on no line. Indices count from 1, or
//! back from the last vertex if negative; anything after a slash is ignored. All other lines (faces, normals, groups) are skipped, so the
//! same file may show the tool. tobj converts polylines with three vertices to triangles, so it is not used here.

use super::diagnose::shorten;
use super::files::Files;
use super::invalid::{Invalid, Location, Result};
use super::raw::{self, At};
use super::text::{Bound, MM, SceneText, or};
use super::{Filter, Lines, Tool};
use std::collections::BTreeMap;
use std::path::Path;

/// Points and segments of a tool.
pub(super) fn lines(scene: &SceneText, files: &Files, raw: &raw::Lines) -> Result<Lines> {
    let unit = scene.number("mesh_unit_mm", &or(raw.mesh_unit_mm.clone(), 1.0), MM, Bound::Positive)?;
    let radius = scene.number("radius_mm", &or(raw.radius_mm.clone(), 0.0), MM, Bound::NotNegative)?;
    let (path, text) = files.text(scene, "mesh", &raw.mesh)?;
    let file = read(&text, &path)?;
    let mut used = BTreeMap::new(); // vertices in use, by their number in the file
    for (id, at) in file.points.iter().chain(file.segments.iter().flatten()) {
        used.entry(*id).or_insert_with(|| at.clone());
    }
    if used.is_empty() {
        return Err(Invalid::LinesEmpty { path });
    }
    let mut positions = vec![];
    for (id, at) in &used {
        let position = file.vertices[*id].map(|coordinate| coordinate * unit);
        if !position.iter().all(|coordinate| (*coordinate as f32).is_finite()) {
            return Err(Invalid::LinesVertex { at: at.clone(), vertex: id + 1, position: file.vertices[*id] });
        }
        positions.push(position);
    }
    let ids: Vec<usize> = used.into_keys().collect();
    let number = |id: usize| ids.partition_point(|known| *known < id) as u32;
    let mut segments = vec![];
    for [(a, at), (b, _)] in &file.segments {
        if file.vertices[*a] == file.vertices[*b] {
            return Err(Invalid::LinesShort { at: at.clone(), a: a + 1, b: b + 1 });
        }
        segments.push([number(*a), number(*b)]);
    }
    Ok(Lines { positions, segments, radius })
}

/// Points and lines of an OBJ; ids from 0, each with the line that names it.
#[derive(Default)]
struct Obj {
    vertices: Vec<[f64; 3]>,
    points: Vec<(usize, Location)>,
    segments: Vec<[(usize, Location); 2]>,
}

fn read(text: &str, path: &Path) -> Result<Obj> {
    let mut obj = Obj::default();
    for (k, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let at = Location::new(path, k + 1);
        let mut words = line.split('#').next().unwrap_or("").split_whitespace();
        match words.next() {
            Some("v") => obj.vertices.push(vertex(&at, line, words)?),
            Some("p") => {
                for word in words {
                    obj.points.push((index(&at, word, obj.vertices.len())?, at.clone()));
                }
            }
            Some("l") => {
                let ids: Vec<usize> = words.map(|word| index(&at, word, obj.vertices.len())).collect::<Result<_>>()?;
                if ids.len() < 2 {
                    return Err(Invalid::LinesLone { at, found: ids.len() });
                }
                obj.segments.extend(ids.windows(2).map(|pair| [pair[0], pair[1]].map(|id| (id, at.clone()))));
            }
            _ => {}
        }
    }
    Ok(obj)
}

/// Coordinates of a `v` line; a weight or a colour may follow them.
fn vertex<'a>(at: &Location, line: &str, words: impl Iterator<Item = &'a str>) -> Result<[f64; 3]> {
    let numbers = words.take(3).map(|word| word.parse::<f64>().ok().filter(|number| number.is_finite()));
    let numbers: Option<Vec<f64>> = numbers.collect();
    let found = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    found.ok_or_else(|| Invalid::LinesNumber { at: at.clone(), found: shorten(line.trim()) })
}

fn index(at: &Location, word: &str, count: usize) -> Result<usize> {
    let number = word.split('/').next().and_then(|first| first.parse::<i64>().ok());
    let found = number.and_then(|number| match number {
        1.. => usize::try_from(number - 1).ok(),
        0 => None,
        _ => count.checked_sub(usize::try_from(number.unsigned_abs()).ok()?),
    });
    let known = found.filter(|id| *id < count);
    known.ok_or_else(|| Invalid::LinesIndex { at: at.clone(), found: shorten(word), count })
}

/// Contact filter of the scene; it must suit all tools.
pub(super) fn filter(scene: &SceneText, word: Option<At<String>>, tools: &[Tool]) -> Result<Filter> {
    let Some(word) = word else {
        return Ok(Filter::Own);
    };
    let known = [("points", Filter::Points), ("one", Filter::One), ("cones", Filter::Cones)];
    let filter = scene.choice("filter", &word, &known)?;
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
    scene.number("angle_cone", &or(raw, 0.02), super::text::PLAIN, Bound::NotNegative)
}
