//! What a scene asks for at the end: probes, checks and pictures.

use super::grid::Grid;
use super::raw::{self, At, Table};
use super::region::region;
use super::text::{Bound, DEGREE, MM, PLAIN, SceneText, in_mm, or, or_vector};
use super::{Check, Probe, ProbeKind, Skin, View};
use crate::error::{Error, Result};
use std::collections::BTreeMap;

/// Direction from the skin to the camera: from the front right, 30 degrees above.
const VIEW_DIRECTION: [f64; 3] = [0.5, -0.7, 0.51];
/// Free space around the patch in the default picture.
const VIEW_MARGIN: f64 = 1.1;
/// Largest picture side; above it GPUs refuse the texture.
const LARGEST_PICTURE: u32 = 8192;
/// Smallest and largest field of view in degrees; beyond them the picture is noise or a fisheye.
const FIELD_OF_VIEW: [f64; 2] = [1.0, 150.0];

/// Probes in the file's order.
pub(super) fn probes(scene: &SceneText, raw: Vec<Table<raw::Probe>>, grids: &[Grid]) -> Result<Vec<Probe>> {
    let mut names = Vec::new();
    raw.into_iter()
        .map(|table| {
            let name = scene.name("probe", &table.keys.name, &mut names)?;
            let kind = probe_kind(scene, table, grids)?;
            Ok(Probe { name, kind })
        })
        .collect()
}

fn probe_kind(scene: &SceneText, table: Table<raw::Probe>, grids: &[Grid]) -> Result<ProbeKind> {
    let mut raw = table.keys;
    let extent = raw.extent();
    let axis = or(raw.axis, "z".to_string());
    let axis = scene.choice("axis", &axis, &[("x", 0), ("y", 1), ("z", 2)])?;
    if scene.choice("kind", &raw.kind, &[("displacement", true), ("reaction", false)])? {
        let why = "kind = \"displacement\" asks for the point of a node";
        scene.needless("region", &raw.region, why)?;
        scene.needless("box_mm", &extent.box_mm, why)?;
        let point_text = scene.required("point_mm", raw.point_mm, table.span, why)?;
        let point: [f64; 3] = scene.vector("point_mm", &point_text, MM, Bound::Finite)?;
        return match grids[0].beyond(point) {
            None => Ok(ProbeKind::Displacement { point, axis }),
            Some((axis, [min, max])) => Err(Error::PointOutside {
                at: scene.place(point_text.span()),
                axis: ['x', 'y', 'z'][axis],
                found: in_mm(point[axis]),
                min: in_mm(min),
                max: in_mm(max),
            }),
        };
    }
    let why = "kind = \"reaction\" asks for a region";
    scene.needless("point_mm", &raw.point_mm, why)?;
    let word = scene.required("region", raw.region, table.span, why)?;
    let region = region(scene, &word, extent, grids)?;
    Ok(ProbeKind::Reaction { region, axis })
}

/// Checks in the file's order; one on a probe must name one that is there.
pub(super) fn checks(
    scene: &SceneText,
    raw: BTreeMap<At<String>, Table<raw::Check>>,
    probes: &[Probe],
) -> Result<Vec<Check>> {
    let mut rows: Vec<_> = raw.into_iter().collect();
    rows.sort_by_key(|(key, _)| key.span().start);
    rows.into_iter().map(|(key, table)| check(scene, key, table.keys, probes)).collect()
}

fn check(scene: &SceneText, key: At<String>, raw: raw::Check, probes: &[Probe]) -> Result<Check> {
    let names: Vec<&str> = probes.iter().map(|probe| probe.name.as_str()).collect();
    if let Some(name) = key.get_ref().strip_prefix("probes.").filter(|name| !names.contains(name)) {
        return Err(scene.unknown_word("probe", &At::new(key.span(), name.to_string()), &names));
    }
    let bounds = [("min", raw.min, f64::NEG_INFINITY), ("max", raw.max, f64::INFINITY)];
    if bounds.iter().all(|(_, value, _)| value.is_none()) {
        let why = "a check needs `min`, `max` or both";
        return scene.required("min", None, key.span(), why);
    }
    let [min, max] = bounds.map(|(name, value, open)| match value {
        Some(value) => scene.number(name, &value, PLAIN, Bound::Finite),
        None => Ok(open),
    });
    let (min, max) = (min?, max?);
    if min > max {
        return Err(Error::Order {
            at: scene.place(key.span()),
            key: "min and max",
            lower: min,
            relation: "at most",
            upper: max,
            fix: "swap the bounds",
        });
    }
    let key = key.into_inner();
    Ok(Check { key, min, max })
}

/// The picture; by default the camera stands where the sphere around the patch fills the field of view.
pub(super) fn view(scene: &SceneText, table: Option<Table<raw::View>>, skin: &Skin) -> Result<View> {
    let span = table.as_ref().map_or(0..0, |table| table.span.clone());
    let raw = raw::keys(table);
    let angle = or(raw.field_of_view_deg, 30.0);
    let field_of_view = scene.number("field_of_view_deg", &angle, DEGREE, Bound::Positive)?;
    if !(FIELD_OF_VIEW[0]..=FIELD_OF_VIEW[1]).contains(&field_of_view) {
        return Err(Error::Number {
            at: scene.place(angle.span()),
            key: "field_of_view_deg".to_string(),
            found: field_of_view,
            wanted: "a number from 1 to 150",
            unit: DEGREE.name,
            example: 30.0,
        });
    }
    let size = scene.counts("size_px", &or_vector(raw.size_px, &[960, 640]), [1, LARGEST_PICTURE])?;
    let point = |key, value: Option<raw::Numbers>, default: [f64; 3]| match value {
        Some(value) => scene.vector(key, &value, MM, Bound::Finite),
        None => Ok(default),
    };
    let thickness: f64 = skin.layers.iter().map(|layer| layer.thickness).sum();
    let target = point("target_mm", raw.target_mm, [0.0, 0.0, thickness / 2.0])?;
    let radius = skin.size[0].hypot(skin.size[1]).hypot(thickness) / 2.0;
    let narrow = f64::from(size[0].min(size[1])) / f64::from(size[1]);
    let half_angle = (narrow * (field_of_view / 2.0).to_radians().tan()).atan();
    let distance = VIEW_MARGIN * radius / half_angle.sin();
    let [x, y, z] = VIEW_DIRECTION.map(|part| part * distance);
    let eye = [target[0] + x, target[1] + y, target[2] + z];
    let eye = point("eye_mm", raw.eye_mm, eye)?;
    if eye == target {
        return Err(Error::ViewPoint { at: scene.place(span) });
    }
    Ok(View { frames: scene.count("frames", &or(raw.frames, 8), [0, u32::MAX])?, size, eye, target, field_of_view })
}
