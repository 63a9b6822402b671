//! Reads a scene text into a [`Scene`] in SI units.
//!
//! `raw` holds the tables as TOML has them, with units, ranges and defaults of their keys; `text` explains TOML errors, checks and converts
//! values, `region` with `grid` reads regions; `body`, `bodies`, `loads`, `tools` with `files`, and `outputs` read their tables. Small
//! tables are read here.

use super::bodies::{self, Names};
use super::files::{Files, toml_of};
use super::grid::{self, Grid, region};
use super::invalid::{Invalid, Result};
use super::raw::{self, At, Table};
use super::text::{SceneText, Taken, or, tables};
use super::{
    Boundary, Correction, EDGE_SPACING, Inclusion, Integrator, Law, Mass, PRECONDITIONER, RestSpring, STEP, Scene,
    Skin, Solver, TestForm, Time, attach_of, body, cells_of, check_of, device_of, devices, hyperelastic, integrator,
    loads, outputs, reserve_of, round, study, tools,
};
use crate::error;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// Reads a scene file; the files that it names are relative to its folder.
///
/// # Errors
/// [`Error::Scene`](error::Error::Scene) with [`Invalid`].
pub fn read(path: &Path) -> error::Result<Scene> {
    let text = toml_of(path).map_err(|reason| Invalid::SceneRead { path: path.to_path_buf(), reason })?;
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    parse(&text, path, &Files::Folder(folder))
}

/// Reads a scene from its text; `file` is its name in messages, `files` provides the files that it names.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, file: &Path, files: &Files) -> error::Result<Scene> {
    Ok(scene(text, file, files)?)
}

fn scene(text: &str, file: &Path, files: &Files) -> Result<Scene> {
    let scene = SceneText::new(file, text.trim_start_matches('\u{feff}'));
    let text = scene.text;
    if text.trim().is_empty() {
        return Err(Invalid::EmptyScene { path: file.to_path_buf() });
    }
    let raw = tables(&scene)?;
    // lines for what is refused after reading
    let mut lines = BTreeMap::new();
    let mut stands = |key: String, span: &Range<usize>| {
        lines.insert(key, scene.line(span));
    };
    stands(STEP.into(), &raw.time.keys.step_ms.span());
    for table in raw.skin.iter().chain(&raw.block) {
        let name = table.keys.name.as_ref().map_or("skin", |name| name.get_ref());
        let extent = table.keys.cells.as_ref().map(At::span).or(table.keys.mesh.as_ref().map(At::span));
        stands(cells_of(name), &extent.unwrap_or(table.span.clone()));
        table.keys.cut_reserve_columns.iter().for_each(|reserve| stands(reserve_of(name), &reserve.span()));
    }
    for tool in &raw.tool {
        let device = tool.keys.device.iter();
        device.for_each(|device| stands(device_of(tool.keys.name.get_ref()), &device.span));
    }
    for blade in raw.tool.iter().rev().flat_map(|tool| &tool.keys.blade) {
        let spacing = blade.keys.edge_spacing_mm.as_ref();
        stands(EDGE_SPACING.into(), &spacing.map_or(blade.span.clone(), |spacing| spacing.span()));
    }
    raw.attach.iter().enumerate().for_each(|(number, table)| stands(attach_of(number), &table.span));
    let preconditioner = raw.solver.iter().flat_map(|table| &table.keys.preconditioner);
    preconditioner.for_each(|word| stands(PRECONDITIONER.into(), &word.span()));
    raw.check.keys().for_each(|key| stands(check_of(key.get_ref()), &key.span()));
    // bodies
    let mut taken = Taken::new();
    let mut skins = Vec::new();
    if let Some(table) = raw.skin {
        skins.push(body::skin(&scene, files, table, None)?);
    }
    let has_skin = !skins.is_empty();
    if has_skin {
        taken.insert("skin".to_string(), 0..0);
    }
    for table in raw.block {
        skins.push(body::skin(&scene, files, table, Some(&mut taken))?);
    }
    // rigid bodies and walls
    let carve = |tool: &raw::Table<raw::Tool>| tool.keys.carve.as_ref().map(|table| table.span.clone());
    let carving: Vec<_> = raw.tool.iter().map(carve).collect();
    let mut tools = tools::tools(&scene, files, raw.tool, &mut taken)?;
    tools.extend(bodies::rigids(&scene, raw.rigid, &mut taken)?);
    let planes = bodies::planes(&scene, raw.plane, &mut taken)?;
    if skins.is_empty() && tools.is_empty() {
        return Err(Invalid::NoBodies { path: file.to_path_buf() });
    }
    // grids of the scene and of its test form, and everything that refers to bodies by name
    let test = raw.test.map(|table| test_form(&scene, table.keys, skins.first().filter(|_| has_skin))).transpose()?;
    let grids: Vec<Vec<Grid>> =
        skins.iter().enumerate().map(|(k, skin)| grid::grids(skin, &test.filter(|_| has_skin && k == 0))).collect();
    let names = Names::new(&skins, &tools, &planes);
    let attachments = bodies::attachments(&scene, raw.attach, &names, &grids)?;
    let probes = outputs::probes(&scene, raw.probe, &names, &grids)?;
    let boundaries = raw.boundary.into_iter().map(|table| boundary(&scene, table, &names, &grids));
    let loads = raw.load.into_iter().map(|table| loads::load(&scene, table, &names, &skins, &grids));
    let loads = loads.collect::<Result<Vec<_>>>()?;
    // contact, integrator and what does not go together
    let raw_contact = raw::keys(raw.contact);
    let correction_at = raw_contact.correction.as_ref().map(At::span).unwrap_or_default();
    let contact = tools::contact(&scene, raw_contact, &tools)?;
    let touching = !tools.is_empty() || !attachments.is_empty() || skins.len() > 1 || !planes.is_empty();
    if contact.correction == Correction::Uncoupled && !attachments.is_empty() {
        return Err(Invalid::UncoupledTies { at: scene.location(correction_at) });
    }
    let changes = tools.iter().any(|tool| tool.blade.is_some()) || skins.iter().any(Skin::breaks);
    if contact.correction == Correction::Precomputed && changes {
        return Err(Invalid::PrecomputedCut { at: scene.location(correction_at) });
    }
    // carving, the integrator and its laws
    if let Some((number, what)) = tools::unfit_to_carve(&skins, &tools, contact.correction) {
        let at = scene.location(carving[number].clone().expect("only a tool with this table carves"));
        return Err(Invalid::Carving { at, tool: tools[number].name.clone(), what });
    }
    let mut time_keys = raw.time.keys;
    let raw_solver = raw::keys(raw.solver);
    let word = time_keys.integrator.take();
    let integrator = integrator::integrator(&scene, word.clone(), &raw_solver, &skins, &tools, &loads, touching)?;
    for (word, skin) in word.iter().flat_map(|word| skins.iter().map(move |skin| (word, skin))) {
        integrator::stable(&scene, word, integrator, skin.law)?;
    }
    // steps and ticks
    let step_ms = time_keys.step_ms.span();
    let time = time(&scene, time_keys, integrator)?;
    let (correction, followed) = (touching.then_some(contact.correction), loads::followed(&loads, time.duration));
    hyperelastic::fits(&scene, &skins, correction, followed, integrator, &raw_solver)?;
    let haptic = devices::haptic(&scene, raw::keys(raw.haptic))?;
    tools::ticks(&scene, step_ms, time.step, haptic.rate, &tools)?;
    // the remaining tables
    let study = study::study(&scene, raw.study, &time, &skins, &tools, &loads, &probes, touching)?;
    let made = Scene {
        title: raw.title.into_inner(),
        file: file.to_path_buf(),
        lines,
        solver: solver(&scene, raw_solver, &skins)?,
        boundaries: boundaries.collect::<Result<_>>()?,
        rest_springs: rest_springs(&scene, raw.rest_spring, &names, &skins, &grids)?,
        inclusions: inclusions(&scene, raw.inclusion, &names, &skins, &grids, integrator)?,
        loads,
        contact: touching.then_some(contact),
        haptic,
        checks: outputs::checks(&scene, raw.check, &probes)?,
        view: outputs::view(&scene, raw.view, &skins, &tools)?,
        output: outputs::output(&scene, raw.output)?,
        study,
        time,
        skins,
        tools,
        planes,
        attachments,
        probes,
        test,
    };
    made.parts()?;
    Ok(made)
}

fn time(scene: &SceneText, raw: raw::Time, integrator: Integrator) -> Result<Time> {
    let time = Time {
        step: scene.number(&raw::Time::step_ms, &raw.step_ms)?,
        duration: scene.number(&raw::Time::duration_s, &raw.duration_s)?,
        gravity: scene.vector_or(&raw::Time::gravity_m_s2, raw.gravity_m_s2)?,
        substeps: scene.count_or(&raw::Time::substeps, raw.substeps)?,
        integrator,
    };
    if time.step > time.duration {
        return Err(Invalid::Order {
            at: scene.location(raw.duration_s.span()),
            key: "step_ms (here in s) and duration_s",
            lower: time.step,
            relation: "at most",
            upper: time.duration,
            fix: "run for at least one step; steps are in ms, the duration in s",
        });
    }
    if let Some(steps) = time.too_many_steps() {
        return Err(Invalid::TooManySteps { at: scene.location(raw.duration_s.span()), steps, most: u32::MAX });
    }
    Ok(time)
}

fn solver(scene: &SceneText, raw: raw::Solver, skins: &[Skin]) -> Result<Solver> {
    let preconditioners = study::preconditioners(skins);
    let tetrahedra = skins.iter().any(Skin::is_without_columns);
    let hexahedra = skins.iter().all(|skin| skin.law.is_hexahedral());
    let best = if tetrahedra { "block" } else { ["column", "multigrid"][usize::from(hexahedra)] };
    let preconditioner = or(raw.preconditioner, best.to_string());
    Ok(Solver {
        preconditioner: scene.among("preconditioner", &preconditioner, &preconditioners)?,
        tolerance: scene.number_or(&raw::Solver::tolerance, raw.tolerance)?,
        floor: scene.number_or(&raw::Solver::floor_n, raw.floor_n)?,
        max_iterations: scene.count_or(&raw::Solver::max_iterations, raw.max_iterations)?,
        newton: raw::Solver::newton.or(raw.newton).into_inner(),
        refinements: scene.count_or(&raw::Solver::refinements, raw.refinements)?,
        true_residual_every: scene.count_or(&raw::Solver::true_residual_every, raw.true_residual_every)?,
    })
}

fn boundary(scene: &SceneText, table: Table<raw::Boundary>, names: &Names, grids: &[Vec<Grid>]) -> Result<Boundary> {
    let (at, mut raw) = (table.span, table.keys);
    let body = names.skin(scene, &raw.body, at)?;
    let extent = raw.extent();
    // axes
    let letters = raw::Boundary::axes.or(raw.axes);
    let mut axes = [false; 3];
    let mut known = !letters.get_ref().is_empty();
    for letter in letters.get_ref().chars() {
        match "xyz".find(letter) {
            Some(axis) if !axes[axis] => axes[axis] = true,
            _ => known = false,
        }
    }
    if !known {
        return Err(Invalid::Axes { at: scene.location(letters.span()), found: letters.into_inner() });
    }
    if let (Some(turn), [x, y, _]) = (&raw.turn_deg, axes)
        && !(x && y)
    {
        return Err(Invalid::TurnAxes { at: scene.location(turn.span()), axes: letters.into_inner() });
    }
    // motion, along these axes alone
    let path = |rows| round::path(scene, &raw::Boundary::path_mm, rows);
    let path = raw.path_mm.as_ref().map_or(Ok(vec![]), path)?;
    let [displaced, driven] = [raw.displacement_mm.as_ref().map(At::span), raw.path_mm.as_ref().map(At::span)];
    let made = Boundary {
        body,
        region: region(scene, &raw.region, extent, &grids[body])?,
        axes,
        displacement: scene.vector_or(&raw::Boundary::displacement_mm, raw.displacement_mm)?,
        rotation: scene.number_or(&raw::Boundary::turn_deg, raw.turn_deg)?.to_radians(),
        path,
    };
    let along_path = made.path.iter().any(|pose| made.leaves(&pose.position));
    for (key, span, leaves) in
        [("displacement_mm", displaced, made.leaves(&made.displacement)), ("path_mm", driven, along_path)]
    {
        if let Some(span) = span.filter(|_| leaves) {
            let why = "it moves along an axis that `axes` does not hold";
            return Err(Invalid::NeedlessKey { at: scene.location(span), key, why });
        }
    }
    Ok(made)
}

/// Regions with rest-shape springs.
fn rest_springs(
    scene: &SceneText,
    list: Vec<Table<raw::RestSpring>>,
    names: &Names,
    skins: &[Skin],
    grids: &[Vec<Grid>],
) -> Result<Vec<RestSpring>> {
    let one = |table: Table<raw::RestSpring>| {
        let mut raw = table.keys;
        let body = names.skin(scene, &raw.body, table.span.clone())?;
        if skins[body].mass == Mass::Consistent {
            return Err(Invalid::RestSpringMass { at: scene.location(table.span) });
        }
        let extent = raw.extent();
        Ok(RestSpring {
            body,
            region: region(scene, &raw.region, extent, &grids[body])?,
            stiffness: scene.number(&raw::RestSpring::stiffness_n_m, &raw.stiffness_n_m)?,
        })
    };
    list.into_iter().map(one).collect()
}

/// Regions with another stiffness.
fn inclusions(
    scene: &SceneText,
    list: Vec<Table<raw::Inclusion>>,
    names: &Names,
    skins: &[Skin],
    grids: &[Vec<Grid>],
    integrator: Integrator,
) -> Result<Vec<Inclusion>> {
    let one = |table: Table<raw::Inclusion>| {
        let mut raw = table.keys;
        let body = names.skin(scene, &raw.body, table.span.clone())?;
        let refused = |span, why| Err(Invalid::Inclusion { at: scene.location(span), why });
        if !matches!(skins[body].law, Law::Hyperelastic(_)) {
            return refused(
                table.span,
                "its body has a small-strain law, springs or tetrahedra; give it a hyperelastic law",
            );
        }
        if integrator == Integrator::SymplecticEuler {
            return refused(table.span, "symplectic Euler steps have no inclusions; take implicit Euler steps");
        }
        if !raw::Inclusion::region.range.0.iter().any(|(word, _)| word == raw.region.get_ref()) {
            return refused(raw.region.span(), "its region is no solid; take \"sphere\" or \"box\"");
        }
        let extent = raw.extent();
        let region = region(scene, &raw.region, extent, &grids[body])?;
        Ok(Inclusion { body, region, young: scene.number(&raw::Inclusion::young_kpa, &raw.young_kpa)? })
    };
    list.into_iter().map(one).collect()
}

fn test_form(scene: &SceneText, raw: raw::Test, skin: Option<&Skin>) -> Result<TestForm> {
    let cells = match (&raw.cells, skin) {
        (Some(value), Some(skin)) if skin.mesh.is_none() => {
            let cells = scene.counts(&raw::Test::cells, value)?;
            let layers: Vec<At<u32>> = skin.layers.iter().map(|layer| At::new(value.span(), layer.cells)).collect();
            grid::numbered(scene, cells, &layers, value)?;
            let everywhere = vec![value.span(); layers.len()];
            grid::not_slender(scene, (skin.size, value.span()), cells, &skin.layers, &everywhere)?;
            Some(cells)
        }
        (cells, _) => {
            scene.needless("cells", cells, "there is no `[skin]` of a grid whose cells could be others")?;
            None
        }
    };
    let steps = raw.steps.map(|steps| scene.count(&raw::Test::steps, &steps));
    Ok(TestForm { cells, steps: steps.transpose()? })
}

/// The scene embedded in the program, so that it runs without files.
const TEXT: &str = include_str!("../../scenes/incision.toml");

const FILES: &[(&str, &str)] = &[
    ("meshes/scalpel.obj", include_str!("../../scenes/meshes/scalpel.obj")),
    ("incision.csv", include_str!("../../scenes/incision.csv")),
];

/// The incision: `scenes/incision.toml` with its mesh and hand path, as of the build.
///
/// # Errors
/// As [`parse`], if the scene was invalid at build time.
pub fn incision() -> error::Result<Scene> {
    parse(TEXT, Path::new("scenes/incision.toml"), &Files::Embedded(FILES))
}
