//! Deformable bodies of a scene file: laws and layers.

use super::embedded::{self, ClosedSurface};
use super::files::Files;
use super::grid;
use super::hyperelastic;
use super::invalid::{Invalid, Result};
use super::raw::{self, At, Number, Row, Table};
use super::tetrahedral::{self, Wanted};
use super::text::{SceneText, Taken, or};
use super::words::TETRAHEDRA;
use super::{Cut, Element, Law, Layer, MOST_NODES, Mass, Material, Skin, TetrahedralMesh};
use crate::math::elementary::cbrt;
use std::ops::Range;
use std::sync::Arc;

/// Initial shape of a body; constrained nodes have their prescribed displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Undeformed.
    Rest,
    /// Random displacement of each coordinate of each node, uniform up to `amplitude`.
    Random {
        /// m
        amplitude: f64,
        /// Seed of the random numbers.
        seed: u32,
    },
    /// All nodes in the plane of the bottom.
    Flat,
    /// The cell in the middle of the body is inverted: its corners are at the positions of the opposite ones.
    Inverted,
    /// Twisted about the vertical axis through the centre: the bottom is fixed, the top rotated by this angle, rad, linear in between.
    Twist(f64),
}

/// Colours of bottom, middle and top layers: fat, dermis, epidermis (sRGB).
const PALETTE: [[u8; 3]; 3] = [[242, 211, 138], [217, 136, 128], [232, 185, 160]];

/// A body; missing keys get their defaults. A block has a position and a name that is not among `taken`; the skin has neither.
pub(super) fn skin(
    scene: &SceneText,
    files: &Files,
    table: Table<raw::Skin>,
    taken: Option<&mut Taken>,
) -> Result<Skin> {
    let raw = table.keys;
    // name and position
    let (name, position) = match taken {
        Some(taken) => {
            let word =
                scene.required("name", raw.name.as_ref(), table.span.clone(), "a block is called by its name")?;
            let why = "a block stands where it is put: the middle of its bottom";
            let position = scene.required("position_mm", raw.position_mm.as_ref(), table.span.clone(), why)?;
            (scene.name("body", word, taken)?, scene.vector(&raw::Skin::position_mm, position)?)
        }
        None => {
            let why = "the `[skin]` is called skin and stands at the origin; other bodies are `[[block]]`s";
            scene.needless("name", &raw.name, why)?;
            scene.needless("position_mm", &raw.position_mm, why)?;
            ("skin".to_string(), [0.0; 3])
        }
    };
    // law, initial shape, mass
    let law = law(scene, &raw, table.span.clone())?;
    let start = start(scene, &raw, table.span.clone())?;
    let mass = mass(scene, &raw, &law)?;
    if raw.layer.is_empty() {
        return Err(Invalid::NoLayers { at: scene.location(table.span) });
    }
    // the form that its nodes come from: a mesh of tetrahedra, a closed surface, or a grid alone
    let mesh = mesh(scene, files, &raw)?;
    let embedded = embedded(scene, files, &raw, &law)?;
    let form = match (&mesh, &embedded) {
        (Some(_), _) => Form::Tetrahedra,
        (None, Some(surface)) if raw.layer.len() == 1 => Form::Surface(surface.size()[2]),
        (None, _) => Form::Grid,
    };
    // layers with default colours
    let count = raw.layer.len();
    let mut names = Taken::new();
    let span = |thickness: &Option<At<f64>>| thickness.as_ref().map_or(0..0, At::span);
    let thicknesses: Vec<_> = raw.layer.iter().map(|layer| span(&layer.keys.thickness_mm)).collect();
    let counts: Vec<At<u32>> = raw.layer.iter().filter_map(|layer| layer.keys.cells.clone()).collect();
    let layers = raw.layer.into_iter().enumerate().map(|(i, layer_table)| {
        let from_top = count - 1 - i;
        let color = match (i, from_top) {
            (_, 0) => PALETTE[2],
            (0, 2..) => PALETTE[0],
            _ => PALETTE[1],
        };
        let name = scene.name("layer", &layer_table.keys.name, &mut names)?;
        layer(scene, layer_table, name, color, &law, &form)
    });
    let layers = layers.collect::<Result<Vec<_>>>()?;
    // size and cells of the grid, around the surface if there is one
    let (size, cells) = match &mesh {
        Some(mesh) => (std::array::from_fn(|axis| mesh.size()[axis]), [0; 2]),
        None => {
            let why = "a grid asks for it; a body of tetrahedra from a file has `mesh` in its place";
            let cells_text = scene.required("cells", raw.cells.as_ref(), table.span.clone(), why)?;
            let cells = scene.counts(&raw::Skin::cells, cells_text)?;
            grid::numbered(scene, cells, &counts, cells_text)?;
            let (size, size_at) = match (&raw.size_mm, &embedded) {
                (None, Some(surface)) => (std::array::from_fn(|axis| surface.size()[axis]), cells_text.span()),
                (size_text, _) => {
                    let size_text = scene.required("size_mm", size_text.as_ref(), table.span.clone(), why)?;
                    (scene.vector(&raw::Skin::size_mm, size_text)?, size_text.span())
                }
            };
            grid::not_slender(scene, (size, size_at.clone()), cells, &layers, &thicknesses)?;
            if let Some(surface) = &embedded {
                let thickness = layers.iter().map(|layer| layer.thickness).sum();
                if let Some(found) = embedded::beyond(surface, size, thickness) {
                    let of_layers = thicknesses.iter().find(|span| !span.is_empty()).cloned();
                    let at = if found.0 == 'z' { of_layers.unwrap_or(size_at) } else { size_at };
                    return Err(embedded::too_small(scene.location(at), found));
                }
            }
            (size, cells)
        }
    };
    // how cuts change it, with room for duplicated nodes
    let cut = match (&mesh, &embedded) {
        (_, Some(_)) => Cut::Remove,
        (Some(mesh), None) => cut(scene, &raw.cut, &raw.cut_reserve_columns, &law, room_of_mesh(mesh.nodes().len()))?,
        (None, None) if law.is_tetrahedral() => {
            let z = 1 + layers.iter().map(|layer| layer.cells as usize).sum::<usize>();
            let nodes = z * (cells[0] as usize + 1) * (cells[1] as usize + 1);
            cut(scene, &raw.cut, &raw.cut_reserve_columns, &law, room_of_mesh(nodes))?
        }
        (None, None) => cut(scene, &raw.cut, &raw.cut_reserve_columns, &law, room_of_grid(cells))?,
    };
    reserved(scene, cut, cells, &layers, &raw.cut_reserve_columns)?;
    Ok(Skin {
        mesh: mesh.map(Arc::new),
        embedded: embedded.map(Arc::new),
        name,
        position,
        size,
        cells,
        layers,
        law,
        mass,
        cut,
        rayleigh_mass: scene.number_or(&raw::Skin::rayleigh_mass_per_s, raw.rayleigh_mass_per_s)?,
        rayleigh_stiffness: scene.number_or(&raw::Skin::rayleigh_stiffness_s, raw.rayleigh_stiffness_s)?,
        velocity: scene.vector_or(&raw::Skin::velocity_m_s, raw.velocity_m_s)?,
        displacement: scene.vector_or(&raw::Skin::displacement_mm, raw.displacement_mm)?,
        start,
    })
}

/// The tetrahedra of a body of a mesh file, which has no keys of a grid; none of a grid.
fn mesh(scene: &SceneText, files: &Files, raw: &raw::Skin) -> Result<Option<TetrahedralMesh>> {
    let layers = || raw.layer.iter().map(|layer| &layer.keys);
    let Some(name) = &raw.mesh else {
        scene.needless("mesh_unit_mm", &raw.mesh_unit_mm, "there is no `mesh`")?;
        scene.needless("embed", &raw.embed, "there is no `mesh` to embed in the grid")?;
        let why = "only a mesh has groups: the body's `mesh`";
        return layers().try_for_each(|layer| scene.needless("group", &layer.group, why)).map(|()| None);
    };
    if raw.embed.is_some() {
        return Ok(None);
    }
    let why = "the body's `mesh` already gives it";
    scene.needless("size_mm", &raw.size_mm, why)?;
    scene.needless("cells", &raw.cells, why)?;
    for layer in layers() {
        scene.needless("thickness_mm", &layer.thickness_mm, why)?;
        scene.needless("cells", &layer.cells, why)?;
    }
    let unit = scene.number(&raw::Skin::mesh_unit_mm, &or(raw.mesh_unit_mm.clone(), 1.0))?;
    let wanted: Vec<Wanted> = layers().map(|layer| Wanted { name: &layer.name, group: &layer.group }).collect();
    tetrahedral::read(scene, files, name, unit, &wanted).map(Some)
}

/// The surface of a mesh file that is embedded in the body's grid; none of other bodies.
fn embedded(scene: &SceneText, files: &Files, raw: &raw::Skin, law: &Law) -> Result<Option<ClosedSurface>> {
    let (Some(name), Some(word)) = (&raw.mesh, &raw.embed) else { return Ok(None) };
    scene.choice(&raw::Skin::embed, word)?;
    let refuse = |text: Option<&At<String>>, key: &str, fix| {
        let text = text.unwrap_or(word);
        let what =
            if text.get_ref() == word.get_ref() { key.into() } else { format!("{key} = \"{}\"", text.get_ref()) };
        Err(Invalid::Embedded { at: scene.location(text.span()).to_string(), what, fix })
    };
    if !matches!(law, Law::Hyperelastic(_)) {
        let fix = "leave it out, or take one of the laws of large strains (`cutis keys law`)";
        return refuse(raw.law.as_ref(), "law", fix);
    }
    if let Some(mass) = raw.mass.as_ref().filter(|mass| mass.get_ref() != "lumped") {
        return refuse(
            Some(mass),
            "mass",
            "leave it out: each node has the mass of what is inside of the cells around it",
        );
    }
    let why = "the group of a layer is of tetrahedra; with `embed` layers are z-ranges of the grid";
    raw.layer.iter().try_for_each(|layer| scene.needless("group", &layer.keys.group, why))?;
    let why = "a body with `embed` is not cut";
    scene.needless("cut", &raw.cut, why)?;
    scene.needless("cut_reserve_columns", &raw.cut_reserve_columns, why)?;
    let unit = scene.number(&raw::Skin::mesh_unit_mm, &or(raw.mesh_unit_mm.clone(), 1.0))?;
    embedded::read(scene, files, name, unit).map(Some)
}

fn law(scene: &SceneText, raw: &raw::Skin, table: Range<usize>) -> Result<Law> {
    // constants of springs, and whose law they belong to
    let number = |row: Row<Number>, value: &Option<At<f64>>| match value {
        Some(value) => scene.number(&row, value).map(Some),
        None => Ok(None),
    };
    let stiffness = number(raw::Skin::spring_stiffness_n_m, &raw.spring_stiffness_n_m)?;
    let damping = number(raw::Skin::spring_damping_n_s_m, &raw.spring_damping_n_s_m)?;
    let element = |default: &str, known: &[(&str, Element)]| {
        scene.among("element", &or(raw.element.clone(), default.to_string()), known)
    };
    // springs
    let network = || {
        let damping =
            scene.required("spring_damping_n_s_m", damping, table.clone(), "law = \"springs\" asks for it")?;
        if raw.mesh.is_none() {
            let why = "law = \"springs\" of a grid asks for it; those of a `mesh` may be fitted to young_kpa";
            scene.required("spring_stiffness_n_m", stiffness, table.clone(), why)?;
        }
        Ok(Law::Springs { stiffness, damping })
    };
    if or(raw.law.clone(), String::new()).get_ref() != "springs" {
        let why = "it belongs to law = \"springs\"";
        scene.needless("spring_stiffness_n_m", &raw.spring_stiffness_n_m, why)?;
        scene.needless("spring_damping_n_s_m", &raw.spring_damping_n_s_m, why)?;
    }
    if raw.mesh.is_some() && raw.embed.is_none() {
        let element = element("tetra", &TETRAHEDRA)?;
        let of_springs = Law::Springs { stiffness: None, damping: 0.0 };
        let name = raw::Skin::law.or(raw.law.clone());
        let known = [&hyperelastic::laws_of_tetrahedra(element)[..], &[("springs", of_springs)]].concat();
        let law = scene.among("law", &name, &known)?;
        if !matches!(law, Law::Springs { .. }) {
            return Ok(law);
        }
        let why = "law = \"springs\" has springs along the edges of the mesh; elements belong to the other laws";
        scene.needless("element", &raw.element, why)?;
        return network();
    }
    let element = element("bbar", raw::Skin::element.range.0)?;
    let name = raw::Skin::law.or(raw.law.clone());
    let mut law = scene.among("law", &name, &hyperelastic::laws(element))?;
    if let (Law::Hyperelastic(material), Element::Tetra | Element::PlainTetra) = (law, element)
        && material != Material::Holzapfel
        && raw.embed.is_none()
    {
        law = Law::LargeTetra { material, element };
    }
    match law {
        Law::Springs { .. } => network(),
        Law::Fem { .. } | Law::LargeTetra { .. } => Ok(law),
        Law::Hyperelastic(_) => {
            let why = "a hyperelastic law (the default is \"neo_hookean\") has hexahedra of mean dilatation, or, without fibres, \"tetra\" and \
                       \"plain_tetra\"; others belong to law = \"corotational\" or \"linear\"";
            scene.needless("element", &raw.element, why)?;
            Ok(law)
        }
    }
}

/// Reads `start` and its keys.
fn start(scene: &SceneText, raw: &raw::Skin, table: Range<usize>) -> Result<Start> {
    let word = scene.choice_or(&raw::Skin::start, raw.start.clone())?;
    if word != "random" {
        scene.needless("start_mm", &raw.start_mm, "it belongs to start = \"random\"")?;
        scene.needless("start_seed", &raw.start_seed, "it belongs to start = \"random\"")?;
    }
    if word != "twist" {
        scene.needless("start_deg", &raw.start_deg, "it belongs to start = \"twist\"")?;
    }
    Ok(match word {
        "random" => {
            let why = "start = \"random\" puts nodes off their rest positions by up to start_mm";
            let amplitude = scene.required("start_mm", raw.start_mm.clone(), table, why)?;
            Start::Random {
                amplitude: scene.number(&raw::Skin::start_mm, &amplitude)?,
                seed: scene.count(&raw::Skin::start_seed, &or(raw.start_seed.clone(), 1))?,
            }
        }
        "flat" => Start::Flat,
        "inside_out" => Start::Inverted,
        "twist" => {
            let why = "start = \"twist\" turns the top by start_deg";
            let angle = scene.required("start_deg", raw.start_deg.clone(), table, why)?;
            Start::Twist(scene.number(&raw::Skin::start_deg, &angle)?.to_radians())
        }
        _ => Start::Rest,
    })
}

/// Default reserve of a grid: two cuts across the complete body in either direction.
fn room_of_grid(cells: [u32; 2]) -> u32 {
    cells[0].saturating_add(cells[1]).saturating_add(2).saturating_mul(2)
}

/// Default reserve of a mesh: as many nodes as four planes through a cube of it have.
fn room_of_mesh(nodes: usize) -> u32 {
    let across = cbrt(nodes as f64).ceil();
    (4.0 * across * across) as u32
}

fn cut(scene: &SceneText, word: &Option<At<String>>, reserve: &Option<At<u32>>, law: &Law, enough: u32) -> Result<Cut> {
    if matches!(law, Law::Springs { .. }) {
        let why = "a blade removes springs, of a `mesh` too; only hexahedra and tetrahedra are split";
        scene.needless("cut", word, why)?;
        scene.needless("cut_reserve_columns", reserve, why)?;
        return Ok(Cut::Remove);
    }
    if scene.choice_or(&raw::Skin::cut, word.clone())? {
        scene.needless("cut_reserve_columns", reserve, "cut = \"remove\" splits nothing")?;
        return Ok(Cut::Remove);
    }
    let reserve = or(reserve.clone(), enough);
    Ok(Cut::Split { reserve_columns: scene.count(&raw::Skin::cut_reserve_columns, &reserve)? })
}

/// The reserve of a cut must be numbered with the grid.
fn reserved(scene: &SceneText, cut: Cut, cells: [u32; 2], layers: &[Layer], key: &Option<At<u32>>) -> Result<()> {
    let (Cut::Split { reserve_columns }, Some(key)) = (cut, key) else { return Ok(()) };
    let nodes = 1 + layers.iter().map(|layer| u64::from(layer.cells)).sum::<u64>();
    let grid = (u64::from(cells[0]) + 1) * (u64::from(cells[1]) + 1);
    let most = u64::from(MOST_NODES) / nodes - grid;
    if u64::from(reserve_columns) <= most {
        return Ok(());
    }
    Err(Invalid::Count {
        at: scene.location(key.span()),
        key: "cut_reserve_columns".into(),
        found: reserve_columns,
        min: 1,
        max: most as u32,
    })
}

fn mass(scene: &SceneText, raw: &raw::Skin, law: &Law) -> Result<Mass> {
    let name = raw::Skin::mass.or(raw.mass.clone());
    let mass = scene.choice(&raw::Skin::mass, &name)?;
    if mass == Mass::Consistent && !matches!(law, Law::Fem { .. }) {
        return Err(Invalid::Mass { at: scene.location(name.span()), found: name.get_ref().clone() });
    }
    Ok(mass)
}

/// What gives a layer its thickness.
enum Form {
    /// Its keys.
    Grid,
    /// Nothing: tetrahedra have no layers by height.
    Tetrahedra,
    /// Its keys, or, where they do not, the height of a surface, m.
    Surface(f64),
}

/// A layer; of tetrahedra without thickness and cells.
fn layer(
    scene: &SceneText,
    table: Table<raw::Layer>,
    name: String,
    color: [u8; 3],
    law: &Law,
    form: &Form,
) -> Result<Layer> {
    let (at, raw) = (table.span.clone(), table.keys);
    if matches!(law, Law::Springs { .. }) {
        let why = "springs are at rest where the scene puts them; pre-strain belongs to hexahedra";
        scene.needless("pre_strain", &raw.pre_strain, why)?;
    }
    // material, then the cells of a grid
    let constants = hyperelastic::constants(scene, &raw, law, table.span)?;
    let fibres = hyperelastic::fibres(scene, &raw, law)?;
    let (thickness, cells) = if let Form::Tetrahedra = form {
        (0.0, 0)
    } else {
        let why = "a layer of a grid asks for it";
        let thickness = match (form, &raw.thickness_mm) {
            (Form::Surface(height), None) => *height,
            (_, text) => {
                let text = scene.required("thickness_mm", text.as_ref(), at.clone(), why)?;
                scene.number(&raw::Layer::thickness_mm, text)?
            }
        };
        let cells = scene.required("cells", raw.cells.as_ref(), at, why)?;
        (thickness, scene.count(&raw::Layer::cells, cells)?)
    };
    // springs break
    if !matches!(law, Law::Springs { .. }) {
        scene.needless("break_strain", &raw.break_strain, "springs break, of law = \"springs\"")?;
    }
    let limit = |text: &At<f64>| scene.number(&raw::Layer::break_strain, text);
    let break_strain = raw.break_strain.as_ref().map_or(Ok(f64::INFINITY), limit)?;
    Ok(Layer {
        name,
        thickness,
        cells,
        young: constants.young,
        poisson: constants.poisson,
        second_share: constants.second_share,
        fibres,
        density: scene.number(&raw::Layer::density_kg_m3, &raw.density_kg_m3)?,
        pre_strain: scene.vector_or(&raw::Layer::pre_strain, raw.pre_strain)?,
        toughness: scene.number_or(&raw::Layer::toughness_kj_m2, raw.toughness_kj_m2)?,
        break_strain,
        color: raw.color.map_or(Ok(color), |text| srgb(scene, &text))?,
    })
}

fn srgb(scene: &SceneText, text: &At<String>) -> Result<[u8; 3]> {
    let digits = text.get_ref().strip_prefix('#').unwrap_or("");
    let plain = digits.len() == 6 && digits.chars().all(|digit| digit.is_ascii_hexdigit());
    match u32::from_str_radix(digits, 16) {
        Ok(value) if plain => Ok([(value >> 16) as u8, (value >> 8) as u8, value as u8]),
        _ => Err(Invalid::Color { at: scene.location(text.span()), found: text.get_ref().clone() }),
    }
}
