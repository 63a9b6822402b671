//! Variations of a scene for `cutis study`, and the reference for its errors.

use super::integrator::{integrator, stable};
use super::invalid::{Invalid, Result};
use super::raw::{self, At, List, Number, Row, Table};
use super::text::SceneText;
use super::words::{CORRECTIONS, ELEMENTS, PRECONDITIONERS, word};
use super::{Correction, Integrator, Law, Load, MATERIALS, Material, Preconditioner, Probe, Skin, Time, Tool};

/// Maximum number of values on one axis of a study.
const MOST_VALUES: usize = 20;

/// Axes of a study; an empty axis has the scene's own value only.
#[derive(Clone, Debug, Default)]
pub struct Study {
    /// Indices of the probes that errors are computed for; empty for all.
    pub probes: Vec<usize>,
    /// Known values of probes at the end of a run: (probe, value in SI). If given, errors are of these final values; otherwise they are of
    /// the history of probes and forces, compared with a run on the reference grid.
    pub known: Vec<(usize, f64)>,
    /// Duration, s; `None` for the scene's.
    pub duration: Option<f64>,
    /// Laws.
    pub laws: Vec<Law>,
    /// Preconditioners.
    pub preconditioners: Vec<Preconditioner>,
    /// Relative residuals at which solves stop.
    pub tolerances: Vec<f64>,
    /// Iteration limits of solves.
    pub iterations: Vec<u32>,
    /// Grids: factors of the scene's cells along each axis.
    pub grids: Vec<f64>,
    /// s
    pub steps: Vec<f64>,
    /// Integrators, for the laws that they are stable with; the reference uses the one of highest order.
    pub integrators: Vec<Integrator>,
    /// Contact corrections.
    pub corrections: Vec<Correction>,
    /// Grid of a quick study, as a factor of the scene's cells; 0 for the coarsest of `grids`.
    pub quick_grid: f64,
    /// Reference grid, as a factor of the scene's cells; 0 for the finest of `grids` and a grid twice as fine as the scene's.
    pub reference_grid: f64,
    /// Reference step, s; 0 for half of the shortest one.
    pub reference_step: f64,
}

/// Preconditioners by name, as far as the skins allow.
pub(super) fn preconditioners(skins: &[Skin]) -> Vec<(&'static str, Preconditioner)> {
    let springs = skins.iter().any(|skin| !skin.law.is_hexahedral() && !skin.law.is_tetrahedral());
    let goes = |which: &Preconditioner| match which {
        Preconditioner::None | Preconditioner::Jacobi | Preconditioner::Block => true,
        Preconditioner::Column => !skins.iter().any(Skin::is_without_columns),
        Preconditioner::Multigrid => !springs,
        Preconditioner::Direct => skins.iter().all(|skin| skin.law.is_hexahedral()),
    };
    PRECONDITIONERS.into_iter().filter(|(_, which)| goes(which)).collect()
}

/// Laws by name that a layer's Young's modulus and Poisson's ratio suffice for; small strain is linear if a skin's law is, otherwise
/// corotational.
fn laws(skins: &[Skin]) -> Vec<(&'static str, Law)> {
    let corotational = !skins.iter().any(|skin| matches!(skin.law, Law::Fem { corotational: false, .. }));
    let small = ELEMENTS.map(|(word, element)| (word, Law::Fem { element, corotational }));
    let large = (word(&MATERIALS, Material::NeoHookean), Law::Hyperelastic(Material::NeoHookean));
    small.into_iter().chain([large]).collect()
}

/// The checked study; `touching` is true if bodies can touch or are attached. The longest step must be a multiple of every other, so that
/// runs can be compared at its ends.
pub(super) fn study(
    scene: &SceneText,
    table: Option<Table<raw::Study>>,
    time: &Time,
    skins: &[Skin],
    tools: &[Tool],
    loads: &[Load],
    probes: &[Probe],
    touching: bool,
) -> Result<Study> {
    let raw = raw::keys(table);
    // probes and known values
    let number = |word: &At<String>| {
        let names: Vec<&str> = probes.iter().map(|probe| probe.name.as_str()).collect();
        let found = names.iter().position(|name| name == word.get_ref());
        found.ok_or_else(|| scene.unknown_word("probes", word, &names))
    };
    let mut known = vec![];
    for (word, value) in raw.known.unwrap_or_default() {
        let given = scene.number(&raw::Study::known.each(), &value)?;
        if given == 0.0 {
            let why = "errors are relative to it, so it cannot be 0: take another probe";
            return Err(Invalid::NeedlessKey { at: scene.location(value.span()), key: "known", why });
        }
        known.push((number(&word)?, given));
    }
    known.sort_by_key(|(probe, _)| *probe);
    // axes
    let young = |law| matches!(law, Law::Fem { .. } | Law::Hyperelastic(Material::NeoHookean));
    if !skins.iter().all(|skin| young(skin.law)) {
        let why = "springs and Mooney–Rivlin material have constants of their own, which other laws cannot take";
        scene.needless("laws", &raw.laws, why)?;
    }
    if skins.iter().any(|skin| skin.mesh.is_some()) {
        let why = "a mesh is not refined, and has no hexahedra: study a scene of each mesh";
        scene.needless("grids", &raw.grids, why)?;
        scene.needless("laws", &raw.laws, why)?;
        scene.needless("quick_grid", &raw.quick_grid, why)?;
        scene.needless("reference_grid", &raw.reference_grid, why)?;
    }
    if skins.iter().any(|skin| skin.embedded.is_some()) {
        let why = "a body with `embed` has a law of large strains";
        scene.needless("laws", &raw.laws, why)?;
    }
    // values along each axis
    let grids = numbers(scene, &raw::Study::grids, &raw.grids)?;
    let one = |row: Row<Number>, value: &Option<At<f64>>| match value {
        Some(value) => scene.number(&row, value),
        None => Ok(0.0),
    };
    let laws = words(scene, "laws", raw.laws, &laws(skins))?;
    // an integrator that fits a law of the study, or why it fits none
    let of_study = |word: &At<String>| {
        let integrator = integrator(scene, Some(word.clone()), &raw::Solver::default(), skins, tools, loads, touching)?;
        let mut all = skins.iter().map(|skin| skin.law).chain(laws.iter().copied());
        match all.clone().any(|law| integrator.fits(law)) {
            true => Ok(integrator),
            false => all.try_for_each(|law| stable(scene, word, integrator, law)).map(|()| integrator),
        }
    };
    let study = Study {
        probes: raw.probes.iter().flat_map(|probes| probes.get_ref()).map(number).collect::<Result<_>>()?,
        known,
        duration: raw.duration_s.as_ref().map(|t| scene.number(&raw::Study::duration_s, t)).transpose()?,
        preconditioners: words(scene, "preconditioners", raw.preconditioners, &preconditioners(skins))?,
        tolerances: numbers(scene, &raw::Study::tolerances, &raw.tolerances)?,
        iterations: match &raw.iterations {
            Some(list) => each(scene, "iterations", list, |v| scene.count(&raw::Study::iterations.each(), v))?,
            None => vec![],
        },
        grids,
        steps: numbers(scene, &raw::Study::steps_ms, &raw.steps_ms)?,
        integrators: match &raw.integrators {
            Some(list) => each(scene, "integrators", list, of_study)?,
            None => vec![],
        },
        laws,
        corrections: words(scene, "corrections", raw.corrections, &CORRECTIONS)?,
        quick_grid: one(raw::Study::quick_grid, &raw.quick_grid)?,
        reference_grid: one(raw::Study::reference_grid, &raw.reference_grid)?,
        reference_step: one(raw::Study::reference_step_ms, &raw.reference_step_ms)?,
    };
    // reference at least as fine as the finest run, steps commensurate
    let order = |key, at: &At<f64>, [lower, upper]: [f64; 2], fix| Invalid::Order {
        at: scene.location(at.span()),
        key,
        lower,
        relation: "at most",
        upper,
        fix,
    };
    if let Some(at) = raw.reference_step_ms.as_ref().filter(|_| study.reference_step > study.shortest_step(time)) {
        let bounds = [study.reference_step, study.shortest_step(time)].map(|s| s * 1e3);
        return Err(order(
            "reference_step_ms and the shortest step",
            at,
            bounds,
            "give a reference_step_ms that is no longer",
        ));
    }
    if let Some(at) = raw.reference_grid.as_ref().filter(|_| study.reference_grid < study.finest_grid()) {
        let bounds = [study.finest_grid(), study.reference_grid];
        return Err(order("the finest grid and reference_grid", at, bounds, "give a reference_grid that is as fine"));
    }
    let listed = raw.steps_ms.map(|list| list.span());
    let reference = raw.reference_step_ms.map(|step| step.span());
    study.commensurate(time).map_err(|(step, longest)| {
        let first = if step == study.reference_step { [reference, listed] } else { [listed, reference] };
        let at = scene.location(first.into_iter().flatten().next().unwrap_or(0..0));
        Invalid::StudyStep { at, step: step * 1e3, longest: longest * 1e3 }
    })?;
    Ok(study)
}

impl Study {
    /// Steps of the study's runs, including the scene's and the reference's, longest first, s.
    pub fn all_steps(&self, time: &Time) -> Vec<f64> {
        let mut all = self.steps.clone();
        all.extend([time.step, self.finest_step(time)]);
        all.sort_by(|a, b| b.total_cmp(a));
        all.dedup();
        all
    }

    /// Reference step, s.
    pub fn finest_step(&self, time: &Time) -> f64 {
        if self.reference_step > 0.0 { self.reference_step } else { self.shortest_step(time) / 2.0 }
    }

    fn shortest_step(&self, time: &Time) -> f64 {
        self.steps.iter().copied().fold(time.step, f64::min)
    }

    /// Finest grid, as a factor of the scene's cells.
    pub fn finest_grid(&self) -> f64 {
        self.grids.iter().copied().fold(1.0, f64::max)
    }

    /// First step that does not divide the longest one, and that one.
    fn commensurate(&self, time: &Time) -> std::result::Result<(), (f64, f64)> {
        let all = self.all_steps(time);
        let longest = all[0];
        let whole = |step: &f64| {
            let parts = longest / step;
            (parts - parts.round()).abs() < 1e-6 * parts
        };
        all.iter().find(|step| !whole(step)).map_or(Ok(()), |step| Err((*step, longest)))
    }
}

fn numbers(scene: &SceneText, row: &Row<List<Number>>, list: &Option<At<Vec<At<f64>>>>) -> Result<Vec<f64>> {
    let Some(list) = list else { return Ok(vec![]) };
    each(scene, row.name, list, |value| scene.number(&row.each(), value))
}

/// Values of a list of words.
pub(super) fn words<T: Copy>(
    scene: &SceneText,
    key: &'static str,
    list: Option<At<Vec<At<String>>>>,
    known: &[(&str, T)],
) -> Result<Vec<T>> {
    let Some(list) = list else { return Ok(vec![]) };
    each(scene, key, &list, |word| scene.among(key, word, known))
}

/// Each value of a list, which must be neither empty nor too long.
fn each<A, T>(
    scene: &SceneText,
    key: &'static str,
    list: &At<Vec<A>>,
    read: impl Fn(&A) -> Result<T>,
) -> Result<Vec<T>> {
    let count = list.get_ref().len();
    if count == 0 || count > MOST_VALUES {
        return Err(Invalid::Count {
            at: scene.location(list.span()),
            key: format!("values of {key}"),
            found: count as u32,
            min: 1,
            max: MOST_VALUES as u32,
        });
    }
    list.get_ref().iter().map(read).collect()
}
