//! Loads: on parts of a skin in code, and of a scene file, where each is of one kind.

use super::bodies::Names;
use super::grid::{Grid, no_extent, region};
use super::invalid::{Invalid, Result};
use super::raw::{self, Extent, Points, Table};
use super::region::SLACK;
use super::text::{SceneText, in_mm, or};
use super::{Load, LoadKind, Region, Skin};
use std::ops::Range;

impl Load {
    /// A pressure, Pa, on a rectangle of the top of the first body from now on; its corners x, y in m.
    pub fn on_top(skin: &Skin, pressure: f64, min: [f64; 2], max: [f64; 2]) -> Self {
        Self {
            body: 0,
            region: skin.top(min, max),
            kind: LoadKind::Pressure { pressure, follower: false },
            start: 0.0,
            end: f64::INFINITY,
        }
    }

    /// Whether it is a follower pressure.
    pub fn follows(&self) -> bool {
        matches!(self.kind, LoadKind::Pressure { follower: true, .. })
    }
}

/// Whether one of these is a follower pressure that acts within a run of this duration, s.
pub(super) fn followed(loads: &[Load], duration: f64) -> bool {
    let acts = |load: &Load| load.start < duration && load.kind.numbers() != [0.0];
    loads.iter().any(|load| load.follows() && acts(load))
}

impl LoadKind {
    /// Its numbers.
    pub(super) fn numbers(&self) -> Vec<f64> {
        match *self {
            Self::Pressure { pressure, .. } => vec![pressure],
            Self::Traction(v) | Self::Force(v) => v.to_vec(),
            Self::PointForce { force, at } => [force, at].concat(),
        }
    }
}

impl Skin {
    /// Total thickness, m.
    pub fn thickness(&self) -> f64 {
        match &self.mesh {
            Some(mesh) => mesh.size()[2],
            None => self.layers.iter().map(|layer| layer.thickness).sum(),
        }
    }

    /// A rectangle of its top, by its corners x, y, m.
    pub fn top(&self, min: [f64; 2], max: [f64; 2]) -> Region {
        let corner = |[x, y]: [f64; 2]| [x, y, self.thickness()];
        Region::Box { min: corner(min), max: corner(max) }
    }

    /// True if a rest position in the body's frame, m, belongs to it.
    pub(super) fn holds(&self, at: [f64; 3]) -> bool {
        if let Some(mesh) = &self.mesh {
            return mesh.holds(at);
        }
        let [x, y] = self.size.map(|size| 0.5 * size);
        Region::Box { min: [-x, -y, 0.0], max: [x, y, self.thickness()] }.holds(at, self.size, self.thickness())
    }
}

const ONE_KIND: &str = "a load is one of pressure_kpa, traction_kpa and force_n";

pub(super) fn load(
    scene: &SceneText,
    table: Table<raw::Load>,
    names: &Names,
    skins: &[Skin],
    grids: &[Vec<Grid>],
) -> Result<Load> {
    let (at, mut raw) = (table.span, table.keys);
    let body = names.skin(scene, &raw.body, at.clone())?;
    let extent = raw.extent();
    let kind = kind(scene, &raw, at, &grids[body])?;
    let region = match kind {
        LoadKind::PointForce { .. } => {
            let why = "`at_mm` already says where the force acts";
            scene.needless("region", &raw.region, why)?;
            scene.needless("rectangle_mm", &raw.rectangle_mm, why)?;
            no_extent(scene, &extent, why)?;
            Region::All
        }
        _ => surface(scene, &raw, extent, &skins[body], &grids[body])?,
    };
    // duration
    let start = scene.number_or(&raw::Load::start_s, raw.start_s)?;
    let end = match &raw.end_s {
        Some(end) => scene.number(&raw::Load::end_s, end)?,
        None => f64::INFINITY,
    };
    if start >= end {
        return Err(Invalid::Order {
            at: scene.location(raw.end_s.map_or(0..0, |end| end.span())),
            key: "start_s and end_s",
            lower: start,
            relation: "below",
            upper: end,
            fix: "end the load after its start",
        });
    }
    Ok(Load { body, region, kind, start, end })
}

fn kind(scene: &SceneText, raw: &raw::Load, table: Range<usize>, grids: &[Grid]) -> Result<LoadKind> {
    if raw.pressure_kpa.is_some() {
        scene.needless("traction_kpa", &raw.traction_kpa, ONE_KIND)?;
    }
    if raw.pressure_kpa.is_some() || raw.traction_kpa.is_some() {
        scene.needless("force_n", &raw.force_n, ONE_KIND)?;
    }
    if raw.pressure_kpa.is_none() {
        scene.needless("follower", &raw.follower, "only a pressure follows the surface: `pressure_kpa`")?;
    }
    if raw.force_n.is_none() {
        scene.needless("at_mm", &raw.at_mm, "only a force acts at a point: `force_n`")?;
    }
    if let Some(traction) = &raw.traction_kpa {
        return Ok(LoadKind::Traction(scene.vector(&raw::Load::traction_kpa, traction)?));
    }
    if let Some(force) = &raw.force_n {
        let force = scene.vector(&raw::Load::force_n, force)?;
        return match &raw.at_mm {
            None => Ok(LoadKind::Force(force)),
            Some(at) => {
                let point = scene.vector(&raw::Load::at_mm, at)?;
                grids[0].contains(scene, point, at)?;
                Ok(LoadKind::PointForce { force, at: point })
            }
        };
    }
    let pressure = scene.required("pressure_kpa", raw.pressure_kpa.as_ref(), table, ONE_KIND)?;
    Ok(LoadKind::Pressure {
        pressure: scene.number(&raw::Load::pressure_kpa, pressure)?,
        follower: raw::Load::follower.or(raw.follower.clone()).into_inner(),
    })
}

/// Region of a load: the top, a rectangle of it, or what `region` names; each grid must have a part of a face in it.
fn surface(scene: &SceneText, raw: &raw::Load, extent: Extent, skin: &Skin, grids: &[Grid]) -> Result<Region> {
    if let Some(rectangle) = &raw.rectangle_mm {
        let why = "`rectangle_mm` already is a part of the top; for other parts of the surface take `region` alone";
        scene.needless("region", &raw.region, why)?;
        no_extent(scene, &extent, why)?;
        let region = on_top(scene, rectangle, skin)?;
        return match grids.iter().find(|grid| !grid.loads(&region)) {
            None => Ok(region),
            Some(grid) => {
                let region = "rectangle_mm".to_string();
                Err(Invalid::NoSurface { at: scene.location(rectangle.span()), grid: grid.name, region })
            }
        };
    }
    let name = or(raw.region.clone(), "top".to_string());
    let region = region(scene, &name, extent, grids)?;
    match grids.iter().find(|grid| !grid.loads(&region)) {
        None => Ok(region),
        Some(grid) => {
            Err(Invalid::NoSurface { at: scene.location(name.span()), grid: grid.name, region: name.into_inner() })
        }
    }
}

/// Rectangle inside the top, with an area.
fn on_top(scene: &SceneText, rectangle: &Points, skin: &Skin) -> Result<Region> {
    let [min, max] = scene.corners(&raw::Load::rectangle_mm, rectangle)?;
    for axis in 0..2 {
        let half = skin.size[axis] / 2.0;
        if min[axis] < -half - SLACK || max[axis] > half + SLACK {
            return Err(Invalid::LoadOutside {
                at: scene.location(rectangle.span()),
                axis: ['x', 'y'][axis],
                min: in_mm(min[axis]),
                max: in_mm(max[axis]),
                half: in_mm(half),
            });
        }
        if min[axis] >= max[axis] {
            return Err(Invalid::Order {
                at: scene.location(rectangle.span()),
                key: "rectangle_mm",
                lower: in_mm(min[axis]),
                relation: "below",
                upper: in_mm(max[axis]),
                fix: "give the rectangle an area",
            });
        }
    }
    Ok(skin.top(min, max))
}
