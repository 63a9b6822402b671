//! Outputs of a scene: probes, checks and pictures.

use super::bodies::Names;
use super::grid::{Grid, no_extent, region};
use super::invalid::{Invalid, Result};
use super::raw::{self, At, Extent, KindOfProbe, Row, Table, Vector};
use super::study::words;
use super::text::{SceneText, Taken};
use super::{BodyId, COMPONENTS, Check, FIXED_COLUMNS, Output, Probe, ProbeKind, Skin, Tool, View};
use crate::math::elementary::{atan, hypot, sin, tan};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Direction from the skin to the camera: from the front right, 30 degrees above.
const VIEW_DIRECTION: [f64; 3] = [0.5, -0.7, 0.51];
/// Margin around the bodies in the default picture.
const VIEW_MARGIN: f64 = 1.1;
/// Largest side of a picture; GPUs reject larger textures.
pub(super) const LARGEST_PICTURE: u32 = raw::View::size_px.range.0.max;

/// Probes in the file's order.
pub(super) fn probes(
    scene: &SceneText,
    raw: Vec<Table<raw::Probe>>,
    bodies: &Names,
    grids: &[Vec<Grid>],
) -> Result<Vec<Probe>> {
    let mut names = Taken::new();
    let mut columns = BTreeSet::from(FIXED_COLUMNS.map(String::from));
    raw.into_iter()
        .map(|table| {
            let span = table.keys.name.span();
            let name = scene.name("probe", &table.keys.name, &mut names)?;
            let kind = probe_kind(scene, table, bodies, grids)?;
            let probe = Probe { name, kind };
            // the columns of others end with their unit too
            match columns.insert(probe.column()) {
                true => Ok(probe),
                false => {
                    Err(Invalid::Column { at: scene.location(span), name: probe.name.clone(), column: probe.column() })
                }
            }
        })
        .collect()
}

impl KindOfProbe {
    fn at_point(self) -> bool {
        matches!(self, Self::Displacement | Self::Strain | Self::Stress)
    }

    fn of_region(self) -> bool {
        matches!(self, Self::MeanDisplacement | Self::Reaction | Self::Pressure)
    }

    fn of_tensor(self) -> bool {
        matches!(self, Self::Strain | Self::Stress)
    }

    fn along_axis(self) -> bool {
        !self.of_tensor() && !matches!(self, Self::Pressure | Self::Volume | Self::VolumeChange)
    }
}

const OF_REGION: &str = "kind = \"reaction\", \"mean_displacement\" and \"pressure\" ask for a region";
const AT_POINT: &str = "kind = \"displacement\", \"strain\" and \"stress\" ask for a point";
const OF_TENSOR: &str = "kind = \"strain\" and \"stress\" ask for a component";

fn probe_kind(scene: &SceneText, table: Table<raw::Probe>, bodies: &Names, grids: &[Vec<Grid>]) -> Result<ProbeKind> {
    let (at, mut raw) = (table.span, table.keys);
    let extent = raw.extent();
    let kind = scene.choice(&raw::Probe::kind, &raw.kind)?;
    // keys of the other kinds
    if !kind.along_axis() {
        let why = "a volume or a pressure has no direction, and strain and stress take `component`";
        scene.needless("axis", &raw.axis, why)?;
    }
    if !kind.at_point() {
        scene.needless(
            "point_mm",
            &raw.point_mm,
            "only kind = \"displacement\", \"strain\" and \"stress\" ask for a point",
        )?;
    }
    if !kind.of_tensor() {
        scene.needless("component", &raw.component, "only kind = \"strain\" and \"stress\" ask for a component")?;
    }
    if !kind.of_region() {
        let why = "only kind = \"reaction\", \"mean_displacement\" and \"pressure\" ask for a region";
        scene.needless("region", &raw.region, why)?;
        no_extent(scene, &extent, why)?;
    }
    if kind != KindOfProbe::Force {
        scene.needless("from", &raw.from, "only kind = \"force\" asks from whom")?;
    }
    let axis = scene.choice_or(&raw::Probe::axis, raw.axis.take())?;
    // probe of a named body, or of a deformable one
    let named = || scene.required("body", raw.body.as_ref(), at.clone(), "this kind of probe is of a named body");
    Ok(match kind {
        KindOfProbe::Position => ProbeKind::Position { body: bodies.rigid(scene, named()?)?, axis },
        KindOfProbe::Velocity => ProbeKind::Velocity { body: bodies.rigid(scene, named()?)?, axis },
        KindOfProbe::Spin => ProbeKind::Spin { body: bodies.rigid(scene, named()?)?, axis },
        KindOfProbe::Force => {
            let on = bodies.find(scene, "body", named()?)?;
            let from = raw.from.as_ref().map(|name| bodies.find(scene, "from", name)).transpose()?;
            ProbeKind::Force { on, from, axis }
        }
        KindOfProbe::CentreOfMass => match &raw.body {
            Some(name) => ProbeKind::CentreOfMass { of: bodies.with_mass(scene, name)?, axis },
            None => ProbeKind::CentreOfMass { of: BodyId::Deformable(bodies.skin(scene, &None, at)?), axis },
        },
        _ => return skin_probe(scene, kind, axis, raw, extent, at, bodies, grids),
    })
}

fn skin_probe(
    scene: &SceneText,
    kind: KindOfProbe,
    axis: usize,
    raw: raw::Probe,
    extent: Extent,
    at: Range<usize>,
    bodies: &Names,
    grids: &[Vec<Grid>],
) -> Result<ProbeKind> {
    let body = bodies.skin(scene, &raw.body, at.clone())?;
    match kind {
        KindOfProbe::Volume => return Ok(ProbeKind::Volume { body }),
        KindOfProbe::VolumeChange => return Ok(ProbeKind::VolumeChange { body }),
        _ => {}
    }
    if kind.of_region() {
        let word = scene.required("region", raw.region, at, OF_REGION)?;
        let region = region(scene, &word, extent, &grids[body])?;
        return Ok(match kind {
            KindOfProbe::Pressure => {
                let without = grids[body].iter().find(|grid| !grid.holds_face(&region));
                if let Some(Grid { name: grid, .. }) = without {
                    let region = word.get_ref().clone();
                    return Err(Invalid::NoFace { at: scene.location(word.span()), grid, region });
                }
                ProbeKind::Pressure { body, region }
            }
            KindOfProbe::MeanDisplacement => ProbeKind::MeanDisplacement { body, region, axis },
            _ => ProbeKind::Reaction { body, region, axis },
        });
    }
    // of a point: inside the body
    let point_text = scene.required("point_mm", raw.point_mm, at.clone(), AT_POINT)?;
    let point = scene.vector(&raw::Probe::point_mm, &point_text)?;
    grids[body][0].contains(scene, point, &point_text)?;
    if kind == KindOfProbe::Displacement {
        return Ok(ProbeKind::Displacement { body, point, axis });
    }
    let word = scene.required("component", raw.component, at, OF_TENSOR)?;
    let known = if kind == KindOfProbe::Stress { &COMPONENTS[..] } else { &COMPONENTS[..6] };
    let component = scene.among("component", &word, known)?;
    Ok(match kind {
        KindOfProbe::Stress => ProbeKind::Stress { body, point, component },
        _ => ProbeKind::Strain { body, point, component },
    })
}

/// Checks in the file's order; one on a probe must name an existing one.
pub(super) fn checks(
    scene: &SceneText,
    raw: BTreeMap<At<String>, Table<raw::Check>>,
    probes: &[Probe],
) -> Result<Vec<Check>> {
    let mut rows: Vec<_> = raw.into_iter().collect();
    rows.sort_by_key(|(key, _)| key.span().start);
    let names: BTreeSet<&str> = probes.iter().map(|probe| probe.name.as_str()).collect();
    rows.into_iter().map(|(key, table)| check(scene, key, table.keys, probes, &names)).collect()
}

fn check(
    scene: &SceneText,
    key: At<String>,
    raw: raw::Check,
    probes: &[Probe],
    names: &BTreeSet<&str>,
) -> Result<Check> {
    if let Some(name) = key.get_ref().strip_prefix("probes.").filter(|name| !names.contains(name)) {
        let names: Vec<&str> = probes.iter().map(|probe| probe.name.as_str()).collect();
        return Err(scene.unknown_word("probe", &At::new(key.span(), name.to_string()), &names));
    }
    let bounds = [(raw::Check::min, raw.min, f64::NEG_INFINITY), (raw::Check::max, raw.max, f64::INFINITY)];
    if bounds.iter().all(|(_, value, _)| value.is_none()) {
        let why = "a check needs `min`, `max` or both";
        return scene.required("min", None, key.span(), why);
    }
    let [min, max] = bounds.map(|(row, value, open)| match value {
        Some(value) => scene.number(&row, &value),
        None => Ok(open),
    });
    let (min, max) = (min?, max?);
    if min > max {
        return Err(Invalid::Order {
            at: scene.location(key.span()),
            key: "min and max",
            lower: min,
            relation: "at most",
            upper: max,
            fix: "swap the bounds",
        });
    }
    if !key.get_ref().ends_with("_mm") {
        scene.needless("cells", &raw.cells, "it widens the bounds of a length, whose key ends in `_mm`")?;
    }
    let cells = raw.cells.map_or(Ok(0.0), |cells| scene.number(&raw::Check::cells, &cells))?;
    Ok(Check { key: key.into_inner(), min, max, cells })
}

/// Picture settings; by default the camera's distance makes the sphere around all bodies fill the field of view.
pub(super) fn view(scene: &SceneText, table: Option<Table<raw::View>>, skins: &[Skin], tools: &[Tool]) -> Result<View> {
    let span = table.as_ref().map_or(0..0, |table| table.span.clone());
    let raw = raw::keys(table);
    let field_of_view = scene.within_or(&raw::View::field_of_view_deg, raw.field_of_view_deg)?;
    let size = scene.counts(&raw::View::size_px, &raw::View::size_px.or(raw.size_px))?;
    let point = |row: Row<Vector<3>>, value: Option<raw::Numbers>, default: [f64; 3]| match value {
        Some(value) => scene.vector(&row, &value),
        None => Ok(default),
    };
    let (centre, radius) = sphere_around(skins, tools);
    let target = point(raw::View::target_mm, raw.target_mm, centre)?;
    let narrow = f64::from(size[0].min(size[1])) / f64::from(size[1]);
    let half_angle = atan(narrow * tan((field_of_view / 2.0).to_radians()));
    let distance = VIEW_MARGIN * radius / sin(half_angle);
    let [x, y, z] = VIEW_DIRECTION.map(|part| part * distance);
    let eye = [target[0] + x, target[1] + y, target[2] + z];
    let eye = point(raw::View::eye_mm, raw.eye_mm, eye)?;
    if eye == target {
        return Err(Invalid::ViewPoint { at: scene.location(span) });
    }
    Ok(View { frames: scene.count_or(&raw::View::frames, raw.frames)?, size, eye, target, field_of_view })
}

/// What is saved with the pictures.
pub(super) fn output(scene: &SceneText, table: Option<Table<raw::Output>>) -> Result<Output> {
    let raw = raw::keys(table);
    Ok(Output {
        fields: words(scene, "fields", raw.fields, raw::Output::fields.range.0.0)?,
        surfaces: words(scene, "surface", raw.surface, raw::Output::surface.range.0.0)?,
    })
}

/// Bounding sphere (centre and radius) of the deformable bodies; without any, of the free bodies, m.
fn sphere_around(skins: &[Skin], tools: &[Tool]) -> ([f64; 3], f64) {
    let mut ends = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    let mut add = |p: [f64; 3]| {
        for n in 0..3 {
            ends[0][n] = ends[0][n].min(p[n]);
            ends[1][n] = ends[1][n].max(p[n]);
        }
    };
    for skin in skins {
        let thickness = skin.thickness();
        let [x, y, z] = skin.position;
        let half = skin.size.map(|size| size / 2.0);
        add([x - half[0], y - half[1], z]);
        add([x + half[0], y + half[1], z + thickness]);
    }
    if skins.is_empty() {
        for tool in tools {
            let start = tool.trajectory[0].position;
            let reach = tool.mesh.positions.iter().map(|p| hypot(hypot(p[0], p[1]), p[2])).fold(0.0, f64::max);
            add(start.map(|c| c - reach));
            add(start.map(|c| c + reach));
        }
    }
    let [low, high] = ends;
    let size = [0, 1, 2].map(|n| high[n] - low[n]);
    ([0, 1, 2].map(|n| (low[n] + high[n]) / 2.0), hypot(hypot(size[0], size[1]), size[2]) / 2.0)
}
