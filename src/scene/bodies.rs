//! Rigid bodies, walls and attachments of a scene file; bodies by name.

use super::grid::{Grid, region};
use super::invalid::{Invalid, Result};
use super::raw::{self, At, Numbers, Table};
use super::text::{SceneText, Taken, normalized, or};
use super::{Attachment, BodyId, Coupling, Motion, Plane, Pose, Round, Skin, Slide, Tool, ToolMesh, round};
use glam::{DQuat, DVec3};

/// All bodies of a scene by name.
pub(super) struct Names(Vec<(String, BodyId)>);

impl Names {
    /// Deformable bodies, tools and rigid bodies, walls.
    pub fn new(skins: &[Skin], tools: &[Tool], planes: &[Plane]) -> Self {
        let skins = skins.iter().enumerate().map(|(k, s)| (s.name.clone(), BodyId::Deformable(k)));
        let tools = tools.iter().enumerate().map(|(k, t)| (t.name.clone(), BodyId::Rigid(k)));
        let planes = planes.iter().enumerate().map(|(k, p)| (p.name.clone(), BodyId::Plane(k)));
        Self(skins.chain(tools).chain(planes).collect())
    }

    /// Body with a given name.
    pub fn find(&self, scene: &SceneText, key: &'static str, name: &At<String>) -> Result<BodyId> {
        self.among(scene, key, name, |_| true)
    }

    /// Index of the deformable body with a given name; the first one without a name.
    pub fn skin(&self, scene: &SceneText, name: &Option<At<String>>, at: std::ops::Range<usize>) -> Result<usize> {
        let found = match name {
            Some(name) => self.among(scene, "body", name, |who| matches!(who, BodyId::Deformable(_)))?,
            None => {
                let first = self.0.iter().map(|(_, who)| *who).find(|who| matches!(who, BodyId::Deformable(_)));
                let why = "the scene has no deformable body: give it a `[skin]` or a `[[block]]`";
                scene.required("skin", first, at, why)?
            }
        };
        Ok(if let BodyId::Deformable(number) = found { number } else { 0 })
    }

    /// Index of the rigid body with a given name.
    pub fn rigid(&self, scene: &SceneText, name: &At<String>) -> Result<usize> {
        let found = self.among(scene, "body", name, |who| matches!(who, BodyId::Rigid(_)))?;
        Ok(if let BodyId::Rigid(number) = found { number } else { 0 })
    }

    /// Deformable or rigid body with a given name.
    pub fn with_mass(&self, scene: &SceneText, name: &At<String>) -> Result<BodyId> {
        self.among(scene, "body", name, |who| matches!(who, BodyId::Deformable(_) | BodyId::Rigid(_)))
    }

    fn among(
        &self,
        scene: &SceneText,
        key: &'static str,
        name: &At<String>,
        fits: fn(&BodyId) -> bool,
    ) -> Result<BodyId> {
        let known: Vec<&(String, BodyId)> = self.0.iter().filter(|(_, who)| fits(who)).collect();
        let words: Vec<&str> = known.iter().map(|(word, _)| word.as_str()).collect();
        let found = known.iter().find(|(word, _)| word == name.get_ref());
        found.map(|(_, who)| *who).ok_or_else(|| scene.unknown_word(key, name, &words))
    }
}

/// Rigid bodies in the file's order; `taken` has the names of the other bodies.
pub(super) fn rigids(scene: &SceneText, raw: Vec<Table<raw::Rigid>>, taken: &mut Taken) -> Result<Vec<Tool>> {
    raw.into_iter().map(|table| rigid(scene, table, taken)).collect()
}

fn rigid(scene: &SceneText, table: Table<raw::Rigid>, taken: &mut Taken) -> Result<Tool> {
    let raw = table.keys;
    let name = scene.name("body", &raw.name, taken)?;
    let mass = scene.number(&raw::Rigid::mass_g, &raw.mass_g)?;
    // shape and inertia
    let (round, cuboid, inertia) = match (&raw.box_mm, &raw.radius_mm) {
        (Some(edges), radius) => {
            scene.needless("radius_mm", radius, "`box_mm` already gives the shape")?;
            let [a, b, c] = scene.vector(&raw::Rigid::box_mm, edges)?;
            let inertia = [b * b + c * c, a * a + c * c, a * a + b * b].map(|square| mass * square / 12.0);
            (None, Some([a, b, c].map(|edge| 0.5 * edge)), inertia)
        }
        (None, radius) => {
            let why = "a rigid body is a box (`box_mm`, its edges) or a sphere (`radius_mm`)";
            let radius = scene.required("box_mm", radius.as_ref(), table.span, why)?;
            let radius = scene.number(&raw::Rigid::radius_mm, radius)?;
            (Some(Round { radius, ends: [[0.0; 3]; 2] }), None, [0.4 * mass * radius * radius; 3])
        }
    };
    // initial pose and motion
    let position = scene.vector(&raw::Rigid::position_mm, &raw.position_mm)?;
    let turn = scene.vector_or(&raw::Rigid::turn_deg, raw.turn_deg)?;
    let turn = DVec3::from_array(turn.map(f64::to_radians));
    let velocity = scene.vector_or(&raw::Rigid::velocity_m_s, raw.velocity_m_s)?;
    let angular_velocity = scene.vector_or(&raw::Rigid::spin_rad_s, raw.spin_rad_s)?;
    Ok(Tool {
        name,
        mesh: match (&round, cuboid) {
            (Some(round), _) => round::mesh(round),
            (None, half) => block(half.unwrap_or_default()),
        },
        mass,
        inertia,
        blade: None,
        points: vec![],
        tip_radius: 0.0,
        round,
        lines: None,
        carve: None,
        cuboid,
        coupling: Coupling { stiffness: 0.0, damping: 0.0, angular_stiffness: 0.0, angular_damping: 0.0 },
        trajectory: vec![Pose { time: 0.0, position, rotation: DQuat::from_scaled_axis(turn).to_array() }],
        free: Some(Motion { velocity, angular_velocity }),
        device: None,
    })
}

/// Walls in the file's order.
pub(super) fn planes(scene: &SceneText, raw: Vec<Table<raw::Plane>>, taken: &mut Taken) -> Result<Vec<Plane>> {
    let plane = |table: Table<raw::Plane>| {
        let raw = table.keys;
        let normal = normalized(scene.vector(&raw::Plane::normal, &raw.normal)?);
        let none = || Invalid::NoDirection { at: scene.location(raw.normal.span()), key: "normal" };
        Ok(Plane {
            name: scene.name("body", &raw.name, taken)?,
            through: scene.vector(&raw::Plane::through_mm, &raw.through_mm)?,
            normal: normal.ok_or_else(none)?,
        })
    };
    raw.into_iter().map(plane).collect()
}

/// Attachments in the file's order.
pub(super) fn attachments(
    scene: &SceneText,
    raw: Vec<Table<raw::Attach>>,
    names: &Names,
    grids: &[Vec<Grid>],
) -> Result<Vec<Attachment>> {
    raw.into_iter().map(|table| attachment(scene, table, names, grids)).collect()
}

fn attachment(scene: &SceneText, table: Table<raw::Attach>, names: &Names, grids: &[Vec<Grid>]) -> Result<Attachment> {
    let (at, mut raw) = (table.span, table.keys);
    let extent = raw.extent();
    let body = names.skin(scene, &raw.body, at)?;
    let to = match &raw.to {
        Some(name) => names.find(scene, "to", name)?,
        None => BodyId::World,
    };
    if let (BodyId::Deformable(other), Some(name)) = (to, &raw.to)
        && other == body
    {
        return Err(Invalid::TiedToItself { at: scene.location(name.span()), name: name.get_ref().clone() });
    }
    let slide = match &raw.slide {
        Some(value) => Some(slide(scene, value, raw.friction.take(), raw.resistance_n.take())?),
        None => {
            let why = "what is tied along all axes does not slide; write `slide`, the direction in which it may";
            scene.needless("friction", &raw.friction, why)?;
            scene.needless("resistance_n", &raw.resistance_n, why)?;
            None
        }
    };
    Ok(Attachment { body, region: region(scene, &raw.region, extent, &grids[body])?, to, slide })
}

/// The path of an attachment.
fn slide(scene: &SceneText, along: &Numbers, friction: Option<At<f64>>, resistance: Option<At<f64>>) -> Result<Slide> {
    let direction = normalized(scene.vector(&raw::Attach::slide, along)?);
    let none = || Invalid::NoDirection { at: scene.location(along.span()), key: "slide" };
    Ok(Slide {
        direction: direction.ok_or_else(none)?,
        friction: scene.number(&raw::Attach::friction, &or(friction, 0.0))?,
        resistance: scene.number(&raw::Attach::resistance_n, &or(resistance, 0.0))?,
    })
}

/// Triangles of a box around the origin, counter-clockwise seen from outside.
fn block(half: [f64; 3]) -> ToolMesh {
    let corner = |k: u32| [0, 1, 2].map(|n| if k >> n & 1 == 1 { half[n] } else { -half[n] });
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    ToolMesh {
        positions: (0..8).map(corner).collect(),
        triangles: quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
    }
}
