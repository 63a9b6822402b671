//! Variants of a study: the settings to run, and the scene of each.

use super::super::StudyUnfit as Unfit;
use crate::error::Result;
use crate::mesh::Grid;
use crate::scene::{
    Correction, Cut, ELEMENTS, Integrator, Law, MATERIALS, MOST_NODES, Mass, Material, Preconditioner, Region, Scene,
    Skin, TETRAHEDRA, word,
};
use crate::step::Platform;

/// Relative residual that counts as an exact solve.
const EXACT: f64 = 1e-9;
/// Contact residual that counts as an exact step.
const EXACT_CONTACT: f64 = 1e-5;
/// Most unknowns solved exactly by a sparse factor; beyond, its fill costs more than conjugate gradients to [`EXACT`].
const FACTORED: usize = 20_000;

/// Stopping criterion of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// Residual relative to the step's load.
    Tolerance(f64),
    /// Fixed number of iterations, whatever the residual.
    Iterations(u32),
    /// Exact, by a factor.
    Exact,
}

/// Point of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Material law with its element, or springs.
    pub law: Law,
    /// Preconditioner of the conjugate gradients.
    pub preconditioner: Preconditioner,
    /// Stopping criterion.
    pub stop: Stop,
    /// Refinement relative to the scene's grid.
    pub refinement: f64,
    /// Time step, s.
    pub step: f64,
    /// Time integrator.
    pub integrator: Integrator,
    /// Contact correction; none without contact.
    pub correction: Option<Correction>,
    /// Backend and precision.
    pub platform: Platform,
}

/// Name: `bbar`, `enhanced`, `plain`, a hyperelastic law or `springs`.
pub fn element_word(law: Law) -> &'static str {
    match law {
        Law::Fem { element, .. } => word(&[&ELEMENTS[..], &TETRAHEDRA].concat(), element),
        Law::Hyperelastic(material) => word(&MATERIALS, material),
        Law::LargeTetra { element, .. } => word(&TETRAHEDRA, element),
        Law::Springs { .. } => "springs",
    }
}

/// Cells of the grids, `20 × 20 × 5`, or `1200 tetrahedra`; of several bodies with `+` in between; `rigid` without a deformable one.
pub fn grid_words(scene: &Scene) -> String {
    let of = |skin: &Skin| {
        if let Some(mesh) = &skin.mesh {
            return format!("{} tetrahedra", mesh.tetrahedra().len());
        }
        let levels: u32 = skin.layers.iter().map(|layer| layer.cells).sum();
        format!("{} × {} × {levels}", skin.cells[0], skin.cells[1])
    };
    let all: Vec<String> = scene.skins.iter().map(of).collect();
    if all.is_empty() { "rigid".into() } else { all.join(" + ") }
}

/// The most complete law that the constants of a scene's layers suffice for: large strain, for the tetrahedra of a mesh with their own elements. None for
/// springs, which no other law can take the constants of, and with a consistent mass, which hyperelastic bodies do not have.
pub fn most_complete(scene: &Scene) -> Option<Law> {
    let complete = |skin: &Skin| match skin.law {
        Law::Hyperelastic(_) => Some(skin.law),
        Law::Fem { .. } if skin.mass == Mass::Consistent => None,
        Law::Fem { element, .. } if skin.mesh.is_some() => {
            Some(Law::LargeTetra { material: Material::NeoHookean, element })
        }
        Law::Fem { .. } => Some(Law::Hyperelastic(Material::NeoHookean)),
        Law::LargeTetra { material, .. } if skin.mesh.is_none() => Some(Law::Hyperelastic(material)),
        Law::LargeTetra { .. } => Some(skin.law),
        Law::Springs { .. } => None,
    };
    let first = complete(scene.skins.first()?)?;
    scene.skins.iter().all(|skin| complete(skin) == Some(first)).then_some(first)
}

/// The scene's own setting on the CPU path in f64.
pub fn own(scene: &Scene) -> Setting {
    Setting {
        law: scene.skins[0].law,
        preconditioner: scene.solver.preconditioner,
        stop: stop(scene.solver.preconditioner, Stop::Tolerance(scene.solver.tolerance)),
        refinement: 1.0,
        step: scene.time.step,
        integrator: scene.time.integrator,
        correction: scene.contact.map(|contact| contact.correction),
        platform: Platform::Cpu64,
    }
}

fn stop(preconditioner: Preconditioner, wanted: Stop) -> Stop {
    if preconditioner == Preconditioner::Direct { Stop::Exact } else { wanted }
}

/// Setting varied by a quick study: the scene's own, on the grid stated for it or the coarsest of the study.
pub fn quick(scene: &Scene) -> Setting {
    let coarsest = scene.study.grids.iter().copied().fold(1.0, f64::min);
    let grid = if scene.study.quick_grid > 0.0 { scene.study.quick_grid } else { coarsest };
    Setting { refinement: grid, ..own(scene) }
}

/// Whether an integrator is stable in a setting with a law; in its own one each of a scene's bodies keeps its law.
pub fn fits(scene: &Scene, law: Law, integrator: Integrator) -> bool {
    match law == scene.skins[0].law {
        true => scene.skins.iter().all(|skin| integrator.fits(skin.law)),
        false => integrator.fits(law),
    }
}

/// All pairs of two lists.
fn both<A: Copy, B: Copy>(a: &[A], b: &[B]) -> Vec<(A, B)> {
    a.iter().flat_map(|a| b.iter().map(move |b| (*a, *b))).collect()
}

/// Axes of the study.
pub struct Axes {
    laws: Vec<Law>,
    preconditioners: Vec<Preconditioner>,
    stops: Vec<Stop>,
    grids: Vec<f64>,
    steps: Vec<f64>,
    integrators: Vec<Integrator>,
    corrections: Vec<Option<Correction>>,
    platforms: Vec<Platform>,
}

fn or_own<T: Clone>(list: &[T], own: T) -> Vec<T> {
    if list.is_empty() { vec![own] } else { list.to_vec() }
}

impl Axes {
    /// Axes stated in the scene, its own value for others; `gpu` is an adapter to run on as well.
    pub fn new(scene: &Scene, gpu: Option<&Platform>) -> Self {
        let (study, own) = (&scene.study, own(scene));
        let mut stops: Vec<Stop> = study.tolerances.iter().copied().map(Stop::Tolerance).collect();
        stops.extend(study.iterations.iter().copied().map(Stop::Iterations));
        let tolerance = Stop::Tolerance(scene.solver.tolerance);
        let corrections: Vec<_> = study.corrections.iter().copied().map(Some).collect();
        let mut platforms = vec![Platform::Cpu64, Platform::Cpu32];
        platforms.extend(gpu.cloned());
        Self {
            laws: or_own(&study.laws, own.law),
            integrators: or_own(&study.integrators, own.integrator),
            preconditioners: or_own(&study.preconditioners, own.preconditioner),
            stops: or_own(&stops, tolerance),
            grids: or_own(&study.grids, 1.0),
            steps: or_own(&study.steps, own.step),
            corrections: or_own(&corrections, own.correction),
            platforms,
        }
    }

    /// The scene's own setting, then every valid combination: a factor needs the CPU path in f64 and has no tolerance, and an integrator is of
    /// the laws that it is stable with.
    pub fn all(&self, scene: &Scene, own: &Setting) -> Vec<Setting> {
        let mut out: Vec<Setting> = vec![own.clone()];
        let mut add = |setting: Setting| {
            let factor = setting.preconditioner == Preconditioner::Direct && setting.platform != Platform::Cpu64;
            if !factor && fits(scene, setting.law, setting.integrator) && !out.contains(&setting) {
                out.push(setting);
            }
        };
        for platform in &self.platforms {
            for (grid, step) in both(&self.grids, &self.steps) {
                for (law, correction) in both(&self.laws, &self.corrections) {
                    for (integrator, preconditioner) in both(&self.integrators, &self.preconditioners) {
                        for wanted in self.stops.iter().copied() {
                            let (stop, platform) = (stop(preconditioner, wanted), platform.clone());
                            add(Setting {
                                law,
                                preconditioner,
                                stop,
                                refinement: grid,
                                step,
                                integrator,
                                correction,
                                platform,
                            });
                        }
                    }
                }
            }
        }
        out
    }

    /// A setting, then those that differ from it along one axis only, on no finer grid.
    pub fn star(&self, scene: &Scene, own: &Setting) -> Vec<Setting> {
        let mut out = vec![own.clone()];
        let one = || own.clone();
        let laws = self.laws.iter().filter(|v| fits(scene, **v, own.integrator));
        out.extend(laws.map(|v| Setting { law: *v, ..one() }));
        let integrators = self.integrators.iter().filter(|v| fits(scene, own.law, **v));
        out.extend(integrators.map(|v| Setting { integrator: *v, ..one() }));
        let solved = |v: &Preconditioner| Setting { preconditioner: *v, stop: stop(*v, own.stop), ..one() };
        out.extend(self.preconditioners.iter().map(solved));
        if own.stop != Stop::Exact {
            out.extend(self.stops.iter().map(|v| Setting { stop: *v, ..one() }));
        }
        out.extend(self.grids.iter().filter(|v| **v <= own.refinement).map(|v| Setting { refinement: *v, ..one() }));
        out.extend(self.steps.iter().map(|v| Setting { step: *v, ..one() }));
        out.extend(self.corrections.iter().map(|v| Setting { correction: *v, ..one() }));
        if own.preconditioner != Preconditioner::Direct {
            out.extend(self.platforms.iter().map(|v| Setting { platform: v.clone(), ..one() }));
        }
        let mut once: Vec<Setting> = vec![];
        for setting in out {
            if !once.contains(&setting) {
                once.push(setting);
            }
        }
        once
    }
}

/// The scene on another grid: `factor` times its cells along each axis, at least one per layer.
///
/// # Errors
/// [`Unfit`] if that is no whole number along x or y, a region holds no node there, or a probe lies between nodes; of a mesh for every factor
/// but 1.
pub fn on_grid(scene: &Scene, factor: f64) -> Result<Scene> {
    let mut out = scene.clone();
    // cells and reserve of each body
    for skin in &mut out.skins {
        if skin.mesh.is_some() {
            if factor != 1.0 {
                return Err(Unfit::Mesh { factor }.of(scene).into());
            }
            continue;
        }
        for cells in &mut skin.cells {
            let wanted = f64::from(*cells) * factor;
            if (wanted - wanted.round()).abs() > 1e-9 || !(1.0..=f64::from(u32::MAX)).contains(&wanted) {
                return Err(Unfit::PartsOfCells { factor, cells: *cells, refined: wanted }.of(scene).into());
            }
            *cells = wanted.round() as u32;
        }
        for layer in &mut skin.layers {
            layer.cells = (f64::from(layer.cells) * factor).round().max(1.0) as u32;
        }
        if let (Cut::Split { reserve_columns }, true) = (&mut skin.cut, factor > 1.0) {
            *reserve_columns = (f64::from(*reserve_columns) * factor).ceil() as u32;
        }
    }
    // refuse grids with too many nodes, regions without a node, probes between nodes
    let nodes = |skin: &Skin| {
        if let Some(mesh) = &skin.mesh {
            return mesh.nodes().len() as f64;
        }
        let z: f64 = skin.layers.iter().map(|l| f64::from(l.cells)).sum();
        (f64::from(skin.cells[0]) + 1.0) * (f64::from(skin.cells[1]) + 1.0) * (z + 1.0)
    };
    if out.skins.iter().map(nodes).sum::<f64>() > f64::from(MOST_NODES) {
        return Err(Unfit::Nodes { factor }.of(scene).into());
    }
    let grids: Vec<Grid> = out.skins.iter().map(Grid::new).collect();
    let empty = |body: usize, region: &Region| {
        let grid: &Grid = &grids[body];
        !(0..grid.node_count()).any(|node| grid.contains(region, node))
    };
    let regions = scene.boundaries.iter().map(|b| (b.body, &b.region));
    let on_rest_springs = scene.rest_springs.iter().map(|a| (a.body, &a.region));
    let probed = scene.probes.iter().filter(|p| measured(scene, &p.name)).filter_map(|p| p.kind.region());
    if regions.chain(on_rest_springs).chain(probed).any(|(body, region)| empty(body, region)) {
        return Err(Unfit::EmptyRegion { factor }.of(scene).into());
    }
    Ok(out)
}

/// Whether errors are taken of this probe.
fn measured(scene: &Scene, name: &str) -> bool {
    let number = scene.probes.iter().position(|p| p.name == name);
    let study = &scene.study;
    match study.known.is_empty() {
        true => study.probes.is_empty() || study.probes.iter().any(|p| Some(*p) == number),
        false => study.known.iter().any(|(p, _)| Some(*p) == number),
    }
}

/// The scene of a setting, over `duration` s; with `exactly`, contact is solved as accurately as possible.
///
/// # Errors
/// As [`on_grid`].
pub fn scene_of(scene: &Scene, setting: &Setting, duration: f64, exactly: bool) -> Result<Scene> {
    let mut out = on_grid(scene, setting.refinement)?;
    // in its own setting each of a scene's bodies keeps its law
    if setting.law != scene.skins[0].law {
        out.skins.iter_mut().for_each(|skin| skin.law = setting.law);
    }
    out.time.integrator = setting.integrator;
    (out.time.step, out.time.duration) = (setting.step, duration);
    out.solver.preconditioner = setting.preconditioner;
    match setting.stop {
        Stop::Tolerance(tolerance) => out.solver.tolerance = tolerance,
        Stop::Iterations(most) => (out.solver.tolerance, out.solver.max_iterations) = (EXACT, most),
        Stop::Exact => out.solver.tolerance = EXACT,
    }
    // an exact step of large strain is one in balance, where nothing may touch
    let large = out.skins.iter().any(|skin| matches!(skin.law, Law::Hyperelastic(_)));
    let implicit = out.time.integrator == Integrator::ImplicitEuler;
    out.solver.newton |= exactly && large && implicit && out.contact.is_none();
    if out.balances_law() {
        out.solver.refinements = 0;
    }
    if let (Some(contact), Some(correction)) = (&mut out.contact, setting.correction) {
        contact.correction = correction;
        if exactly {
            contact.tolerance = contact.tolerance.min(EXACT_CONTACT);
        }
    }
    out.solver.newton &= out.unfit_for_newton().is_none();
    Ok(out)
}

/// Approximate number of cells of all bodies on a grid.
pub fn cells(scene: &Scene, grid: f64) -> f64 {
    let of = |skin: &Skin| {
        if let Some(mesh) = &skin.mesh {
            return mesh.tetrahedra().len() as f64;
        }
        let z: f64 = skin.layers.iter().map(|l| (f64::from(l.cells) * grid).max(1.0)).sum();
        f64::from(skin.cells[0]) * f64::from(skin.cells[1]) * grid * grid * z
    };
    scene.skins.iter().map(of).sum()
}

/// The same element, grid and step, solved exactly in f64.
pub fn exact(scene: &Scene, setting: &Setting) -> Setting {
    let hexahedra = scene.skins.iter().all(|skin| skin.law.is_hexahedral());
    let splits = scene.tools.iter().any(|t| t.blade.is_some());
    let unknowns = |skin: &Skin| {
        let [x, y] = skin.cells.map(|n| f64::from(n) * setting.refinement + 1.0);
        let z: f64 = skin.layers.iter().map(|l| (f64::from(l.cells) * setting.refinement).max(1.0)).sum();
        (3.0 * x * y * (z + 1.0)) as usize
    };
    let few = scene.skins.iter().map(unknowns).sum::<usize>() <= FACTORED;
    let (preconditioner, stop) = match (hexahedra, few && !splits) {
        (true, true) => (Preconditioner::Direct, Stop::Exact),
        (true, false) => (Preconditioner::Multigrid, Stop::Tolerance(EXACT)),
        (false, _) if scene.skins.iter().any(Skin::is_without_columns) => {
            (Preconditioner::Block, Stop::Tolerance(EXACT))
        }
        (false, _) => (Preconditioner::Column, Stop::Tolerance(EXACT)),
    };
    let correction = setting.correction.map(|_| Correction::Exact);
    Setting { preconditioner, stop, correction, platform: Platform::Cpu64, ..setting.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Element;
    use std::path::Path;

    #[test]
    fn tetrahedra_of_a_mesh_have_large_strain_with_their_own_elements() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/skin_tetra.toml");
        let mut scene = crate::scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
        let mut of = |law| {
            scene.skins[0].law = law;
            most_complete(&scene)
        };
        let large = |material| Law::LargeTetra { material, element: Element::Tetra };
        let small = Law::Fem { element: Element::Tetra, corotational: true };
        assert_eq!(of(small), Some(large(Material::NeoHookean)));
        assert_eq!(of(large(Material::MooneyRivlin)), Some(large(Material::MooneyRivlin)));
        assert_eq!(of(Law::Springs { stiffness: Some(1.0), damping: 0.0 }), None);
    }
}
