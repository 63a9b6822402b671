//! Sets of nodes by where they are at rest.

use super::grid::{Grid, SLACK};
use super::raw::{At, Extent, Points};
use super::text::{Bound, MM, PLAIN, SceneText};
use super::tools::unit;
use crate::error::{Error, Result};

/// A set of nodes.
#[derive(Clone, Debug, PartialEq)]
pub enum Region {
    /// z = 0.
    Bottom,
    /// z = thickness.
    Top,
    /// The four vertical faces.
    Sides,
    /// The two faces x = ±size/2.
    SidesX,
    /// The two faces y = ±size/2.
    SidesY,
    /// Every node.
    All,
    /// Inside the box (rest positions, boundary included), m.
    Box {
        /// m
        min: [f64; 3],
        /// m
        max: [f64; 3],
    },
    /// Inside the sphere (rest positions, boundary included), m.
    Sphere {
        /// m
        centre: [f64; 3],
        /// m
        radius: f64,
    },
    /// No farther from a plane than `within`, on either side, m.
    Plane {
        /// A point of it, m.
        through: [f64; 3],
        /// Unit.
        normal: [f64; 3],
        /// m
        within: f64,
    },
    /// z = 0, no farther than this from the sides, m.
    Rim(f64),
    /// z = 0 without that rim, m.
    Core(f64),
}

impl Region {
    /// Whether a place of the skin at rest belongs to it; `size` of the patch and its `thickness`, m.
    pub fn holds(&self, p: [f64; 3], size: [f64; 2], thickness: f64) -> bool {
        let to_side = |n: usize| 0.5 * size[n] - p[n].abs();
        let from = |q: &[f64; 3]| [0, 1, 2].map(|n| p[n] - q[n]);
        let at_bottom = p[2] <= SLACK;
        match self {
            Self::Bottom => at_bottom,
            Self::Top => p[2] >= thickness - SLACK,
            Self::SidesX => to_side(0) <= SLACK,
            Self::SidesY => to_side(1) <= SLACK,
            Self::Sides => to_side(0).min(to_side(1)) <= SLACK,
            Self::All => true,
            Self::Box { min, max } => (0..3).all(|n| p[n] >= min[n] - SLACK && p[n] <= max[n] + SLACK),
            Self::Sphere { centre, radius } => from(centre).iter().map(|c| c * c).sum::<f64>().sqrt() <= radius + SLACK,
            Self::Plane { through, normal, within } => {
                from(through).iter().zip(normal).map(|(d, n)| d * n).sum::<f64>().abs() <= within + SLACK
            }
            Self::Rim(margin) => at_bottom && to_side(0).min(to_side(1)) <= margin + SLACK,
            Self::Core(margin) => at_bottom && to_side(0).min(to_side(1)) > margin + SLACK,
        }
    }

    /// Where a line along an axis through a place is deepest inside the region, or nearest to it; 0 where all or only the line's ends
    /// are as good.
    pub(super) fn place_along(&self, axis: usize, through: [f64; 3]) -> f64 {
        match self {
            Self::Sphere { centre, .. } => centre[axis],
            Self::Plane { through: q, normal, .. } if normal[axis] != 0.0 => {
                let others: f64 = (0..3).filter(|n| *n != axis).map(|n| (through[n] - q[n]) * normal[n]).sum();
                q[axis] - others / normal[axis]
            }
            Self::Box { min, max } => 0.5 * (min[axis] + max[axis]),
            _ => 0.0,
        }
    }
}

/// The named region; it must hold a node of each grid.
pub(super) fn region(scene: &SceneText, name: &At<String>, extent: Extent, grids: &[Grid]) -> Result<Region> {
    let known = [
        ("bottom", Some(Region::Bottom)),
        ("top", Some(Region::Top)),
        ("sides", Some(Region::Sides)),
        ("sides_x", Some(Region::SidesX)),
        ("sides_y", Some(Region::SidesY)),
        ("all", Some(Region::All)),
        ("box", None),
        ("sphere", None),
        ("plane", None),
        ("bottom_rim", None),
        ("bottom_core", None),
    ];
    let words: Vec<(&str, (&str, &Option<Region>))> = known.iter().map(|(word, of)| (*word, (*word, of))).collect();
    let (word, whole) = scene.choice("region", name, &words)?;
    let Extent { box_mm, centre_mm, radius_mm, through_mm, normal, within_mm, margin_mm } = &extent;
    if word != "box" {
        scene.needless("box_mm", box_mm, "it belongs to region = \"box\"")?;
    }
    if word != "sphere" {
        scene.needless("centre_mm", centre_mm, "it belongs to region = \"sphere\"")?;
        scene.needless("radius_mm", radius_mm, "it belongs to region = \"sphere\"")?;
    }
    if word != "plane" {
        scene.needless("through_mm", through_mm, "it belongs to region = \"plane\"")?;
        scene.needless("normal", normal, "it belongs to region = \"plane\"")?;
        scene.needless("within_mm", within_mm, "it belongs to region = \"plane\"")?;
    }
    if !word.starts_with("bottom_") {
        scene.needless("margin_mm", margin_mm, "it belongs to region = \"bottom_rim\" and \"bottom_core\"")?;
    }
    if let Some(region) = whole {
        return Ok(region.clone());
    }
    let region = match word {
        "box" => return within_box(scene, name, box_mm, grids),
        "sphere" => {
            let why = "region = \"sphere\" asks for centre_mm = [x,y,z] and radius_mm";
            let centre = scene.required("centre_mm", centre_mm.as_ref(), name.span(), why)?;
            let radius = scene.required("radius_mm", radius_mm.as_ref(), name.span(), why)?;
            Region::Sphere {
                centre: scene.vector("centre_mm", centre, MM, Bound::Finite)?,
                radius: scene.number("radius_mm", radius, MM, Bound::Positive)?,
            }
        }
        "plane" => {
            let why = "region = \"plane\" asks for through_mm = [x,y,z], normal = [x,y,z] and within_mm";
            let through = scene.required("through_mm", through_mm.as_ref(), name.span(), why)?;
            let normal = scene.required("normal", normal.as_ref(), name.span(), why)?;
            let within = scene.required("within_mm", within_mm.as_ref(), name.span(), why)?;
            let direction = unit(scene.vector("normal", normal, PLAIN, Bound::Finite)?);
            let none = || Error::NoDirection { at: scene.place(normal.span()), key: "normal" };
            Region::Plane {
                through: scene.vector("through_mm", through, MM, Bound::Finite)?,
                normal: direction.ok_or_else(none)?,
                within: scene.number("within_mm", within, MM, Bound::NotNegative)?,
            }
        }
        _ => {
            let why = "the rim is what lies within margin_mm of the sides, the core the rest";
            let margin = scene.required("margin_mm", margin_mm.as_ref(), name.span(), why)?;
            let margin = scene.number("margin_mm", margin, MM, Bound::NotNegative)?;
            if word == "bottom_rim" { Region::Rim(margin) } else { Region::Core(margin) }
        }
    };
    for grid in grids {
        if !grid.holds(&region) {
            return Err(Error::NoNode { at: scene.place(name.span()), grid: grid.name, region: word.into() });
        }
    }
    Ok(region)
}

fn within_box(scene: &SceneText, name: &At<String>, corners: &Option<Points>, grids: &[Grid]) -> Result<Region> {
    let why = "region = \"box\" asks for box_mm = [[x,y,z],[x,y,z]]";
    let corners = scene.required("box_mm", corners.as_ref(), name.span(), why)?;
    let [min, max] = scene.corners::<3>("box_mm", corners)?;
    for grid in grids {
        grid.holds_node(scene, corners, min, max)?;
    }
    Ok(Region::Box { min, max })
}
