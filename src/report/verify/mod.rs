//! Known answers: runs scenes whose answer is known from elsewhere, and states reference, result and error side by side.
//!
//! A [`Case`] is data: a scene of `scenes/verify` (embedded in the program) with changes, what is read of its run, the reference with its
//! source, and the bound that the error is held to. The error is relative: `(ours − reference) / size`, where the size is the reference or,
//! for references of 0, stated. A bound is what the project asks of itself and not what a run happens to give: a case that misses it is
//! shown with its figure, and the command ends with exit code 1.
//!
//! In f32 (CPU path or GPU) solves stop at [`SINGLE_TOLERANCE`] instead of the scene's tighter tolerance, and bounds are widened by
//! [`SINGLE_BOUND`]. On a GPU, multigrid takes the place of a sparse factor.
//! Static steps of the elastica and at ν 0.4999 are beyond f32: they end with 1e-3 and 2e-3 of the forces left, more than the
//! tolerance, and their rows say so.

mod cases;
mod files;

pub use cases::CASES;
pub use files::{open, write};

use super::Refused;
use super::inspect::{self, Purpose};
use super::study::{element_word, grid_words};
use crate::error::{Error, Result};
use crate::scene::{BodyId, Integrator, Law, LoadKind, MATERIALS, Preconditioner, Probe, ProbeKind, Scene, word};
use crate::step::{Platform, Simulation, StepReport};
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::time::Instant;

/// Relative residual that a solve in f32 is asked for at most: below it the rounding of displacements, 6e-8 of themselves, is left.
pub const SINGLE_TOLERANCE: f64 = 1e-5;
/// What f32 may add to a relative error: that tolerance times 100, the ratio of error to residual of the stiffest case here.
pub const SINGLE_BOUND: f64 = 1e-3;

/// Change of a scene by a case, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Cells along x and y, and of each layer, of the first body.
    Cells([u32; 2], &'static [u32]),
    /// Law of every deformable body; with one of tetrahedra the solver's preconditioner is blocks.
    Law(Law),
    /// Poisson's ratio of every layer.
    Poisson(f64),
    /// Share of the second constant of Mooney–Rivlin in every layer.
    SecondShare(f64),
    /// Density of the uppermost layer, kg/m³.
    TopDensity(f64),
    /// Pressure of every load, Pa.
    Pressure(f64),
    /// Coefficient of friction.
    Friction(f64),
    /// Last position of the first tool along z, m.
    ToolDown(f64),
}

impl Change {
    fn make(self, scene: &mut Scene) {
        let layers = |scene: &mut Scene, set: &dyn Fn(&mut crate::scene::Layer)| {
            scene.skins.iter_mut().flat_map(|skin| &mut skin.layers).for_each(set);
        };
        match self {
            Self::Cells(across, levels) => {
                let Some(skin) = scene.skins.first_mut() else { return };
                skin.cells = across;
                skin.layers.iter_mut().zip(levels).for_each(|(layer, cells)| layer.cells = *cells);
            }
            Self::Law(law) => {
                scene.skins.iter_mut().for_each(|skin| skin.law = law);
                if law.is_tetrahedral() {
                    scene.solver.preconditioner = Preconditioner::Block;
                }
            }
            Self::Poisson(ratio) => layers(scene, &|layer| layer.poisson = ratio),
            Self::SecondShare(share) => layers(scene, &|layer| layer.second_share = share),
            Self::TopDensity(density) => {
                let top = scene.skins.iter_mut().filter_map(|skin| skin.layers.last_mut());
                top.for_each(|layer| layer.density = density);
            }
            Self::Pressure(pressure) => scene.loads.iter_mut().for_each(|load| {
                if let LoadKind::Pressure { pressure: present, .. } = &mut load.kind {
                    *present = pressure;
                }
            }),
            Self::Friction(friction) => scene.contact.iter_mut().for_each(|contact| contact.friction = friction),
            Self::ToolDown(z) => {
                let last = scene.tools.first_mut().and_then(|tool| tool.trajectory.last_mut());
                last.into_iter().for_each(|pose| pose.position[2] = z);
            }
        }
    }
}

/// What is read of a run, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measure {
    /// Last value of a probe of the scene.
    Probe(&'static str),
    /// Last displacement of a material point of the first body, m, by its rest position, m, and axis.
    At([f64; 3], usize),
    /// Change of the first body's volume at the end, m³.
    VolumeChange,
    /// Rate of change of a probe over all steps but the first, 1/s.
    Rate(&'static str),
    /// Strongest frequency of a probe, Hz ([`frequency`]).
    Frequency(&'static str),
    /// Energy of the deformable bodies at the end over that at the start.
    EnergyKept,
    /// Force on the first tool at the end, N.
    ForceOnTool,
    /// Work of the first tool against the force on it, J.
    WorkOfTool,
}

/// A known answer.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// What is computed.
    pub name: &'static str,
    /// Scene, by its file's name in `scenes/verify` without `.toml`.
    pub scene: &'static str,
    /// Changes of the scene, in this order.
    pub changes: &'static [Change],
    /// What is read.
    pub measure: Measure,
    /// What is read, in words.
    pub what: &'static str,
    /// Unit of the table, and how many of them an SI unit is.
    pub unit: (&'static str, f64),
    /// Known answer, SI.
    pub reference: f64,
    /// Where it is from.
    pub source: &'static str,
    /// What errors are relative to, SI; 0 for the reference.
    pub size: f64,
    /// Largest relative error that passes; infinite where the law is not that of the reference and the error is shown for comparison.
    pub bound: f64,
    /// It belongs to the short form.
    pub quick: bool,
}

/// A case with its result.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: Case,
    /// What was found, SI, or why there is none.
    pub found: std::result::Result<f64, String>,
    /// Relative error that passes on this platform.
    pub bound: f64,
    /// Cells of the grid, `20 × 20 × 5`; of several bodies with `+` in between; `rigid` without one.
    pub cells: String,
    /// Law and element; empty of rigid bodies.
    pub law: String,
    /// Length of a step, s, and their number; 0 s for static steps.
    pub steps: (f64, u32),
    /// Warnings of the run by name.
    pub warnings: BTreeMap<&'static str, u64>,
    /// Wall time, s.
    pub seconds: f64,
}

impl Row {
    /// Relative error; none without a result.
    pub fn error(&self) -> Option<f64> {
        let size = if self.case.size > 0.0 { self.case.size } else { self.case.reference };
        Some((*self.found.as_ref().ok()? - self.case.reference) / size)
    }

    /// Whether the error is within its bound.
    pub fn holds(&self) -> bool {
        self.bound == f64::INFINITY || self.error().is_some_and(|error| error.abs() <= self.bound)
    }
}

/// All cases that were run, with the machine.
#[derive(Clone, Debug)]
pub struct Page {
    /// Device in words: adapter or threads, driver, precision.
    pub device: String,
    /// Version of this program.
    pub version: &'static str,
    /// Whether it is the short form.
    pub quick: bool,
    /// Rows, in the order run.
    pub rows: Vec<Row>,
}

impl Page {
    /// Rows beyond their bound.
    pub fn missed(&self) -> Vec<&Row> {
        self.rows.iter().filter(|row| !row.holds()).collect()
    }
}

/// Runs all cases, or those of the short form; calls `begin` with the number of each, their number, and its case.
///
/// # Errors
/// Without a fitting adapter, or if a case cannot fit into memory. What else fails in one case is its result.
pub fn verify(platform: &Platform, quick: bool, begin: &mut dyn FnMut(usize, usize, &Case)) -> Result<Page> {
    let mut page = Page { device: String::new(), version: env!("CARGO_PKG_VERSION"), quick, rows: vec![] };
    let wanted: Vec<&Case> = CASES.iter().filter(|case| case.quick || !quick).collect();
    // refused before the first run
    wanted.iter().try_for_each(|case| case.fits(platform))?;
    for (number, case) in wanted.iter().enumerate() {
        begin(number, wanted.len(), case);
        let scene = case.scene()?;
        if page.device.is_empty() && !scene.skins.is_empty() {
            let device = Simulation::new(&scene, platform)?.device(); // without an adapter there is no page
            let words = [device.backend, device.precision, &device.adapter, &device.driver];
            page.device = words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(", ");
        }
        page.rows.push(case.run(&scene, platform));
    }
    Ok(page)
}

impl Case {
    /// Refuses a case that cannot fit into memory: nobody can change its scene.
    fn fits(&self, platform: &Platform) -> Result<()> {
        inspect::fits(&self.scene()?, Purpose::from(platform)).map_err(|error| match error {
            Error::Report(Refused::Memory { wanted, free, .. }) => {
                Refused::CaseMemory { case: self.name, wanted, free }.into()
            }
            error => error,
        })
    }

    /// Its scene, changed.
    ///
    /// # Errors
    /// If the scene or its changes are invalid.
    pub fn scene(&self) -> Result<Scene> {
        let mut scene = cases::scene(self.scene)?;
        self.changes.iter().for_each(|change| change.make(&mut scene));
        let kind = match self.measure {
            Measure::At(point, axis) => Some(ProbeKind::Displacement { body: 0, point, axis }),
            Measure::VolumeChange => Some(ProbeKind::VolumeChange { body: 0 }),
            _ => None,
        };
        scene.probes.extend(kind.map(|kind| Probe { name: self.what.into(), kind }));
        scene.check()?;
        Ok(scene)
    }

    /// Runs a scene, its own or one that was changed further, on a platform.
    pub fn run(&self, scene: &Scene, platform: &Platform) -> Row {
        let mut scene = scene.clone();
        let single = *platform != Platform::Cpu64 && !scene.skins.is_empty();
        if single {
            scene.solver.tolerance = scene.solver.tolerance.max(SINGLE_TOLERANCE);
        }
        if matches!(platform, Platform::Gpu(_)) && scene.solver.preconditioner == Preconditioner::Direct {
            scene.solver.preconditioner = Preconditioner::Multigrid; // a factor is the CPU path's
        }
        let time = Instant::now();
        let mut warnings = BTreeMap::new();
        let found = self.found(&scene, platform, &mut warnings).map_err(|error| error.to_string());
        let step = if scene.time.integrator == Integrator::Static { 0.0 } else { scene.time.step };
        Row {
            case: *self,
            found,
            bound: if single { self.bound + SINGLE_BOUND } else { self.bound },
            cells: grid_words(&scene),
            law: law(&scene),
            steps: (step, scene.time.steps()),
            warnings,
            seconds: time.elapsed().as_secs_f64(),
        }
    }

    fn found(&self, scene: &Scene, platform: &Platform, warnings: &mut BTreeMap<&'static str, u64>) -> Result<f64> {
        let probe = self.probe(scene)?;
        let mut simulation = Simulation::new(scene, platform)?;
        let energy = |simulation: &mut Simulation| -> Result<f64> {
            let states = simulation.snapshots()?;
            Ok(simulation.measure(&states).map_or(f64::NAN, |measured| measured.energy.total()))
        };
        let start = if self.measure == Measure::EnergyKept { energy(&mut simulation)? } else { 0.0 };
        let (mut work, mut samples, mut last) = (0.0, vec![], StepReport::default());
        for _ in 0..scene.time.steps() {
            let before = simulation.tools.first().map(|tool| tool.position);
            last = simulation.step(false)?;
            for (name, count) in &last.warnings {
                *warnings.entry(name).or_default() += u64::from(*count);
            }
            samples.extend(probe.map(|probe| last.probes[probe]));
            if let (Some(before), Some(force)) = (before, last.contact.on_tool.first()) {
                work -= DVec3::from_array(*force).dot(simulation.tools[0].position - before);
            }
        }
        let end = samples.last().copied().unwrap_or(f64::NAN);
        let over = (samples.len() as f64 - 1.0) * scene.time.step;
        Ok(match self.measure {
            Measure::Probe(_) | Measure::At(..) => end,
            Measure::VolumeChange => end * scene.skins.first().map_or(f64::NAN, volume),
            Measure::Rate(_) => (end - samples.first().copied().unwrap_or(f64::NAN)) / over,
            Measure::Frequency(_) => frequency(&samples, scene.time.step),
            Measure::EnergyKept => energy(&mut simulation)? / start,
            Measure::ForceOnTool => last.contact.force(BodyId::Rigid(0), None).length(),
            Measure::WorkOfTool => work,
        })
    }

    /// Number of the probe that is read, if any.
    fn probe(&self, scene: &Scene) -> Result<Option<usize>> {
        let name = match self.measure {
            Measure::Probe(name) | Measure::Rate(name) | Measure::Frequency(name) => name,
            Measure::At(..) | Measure::VolumeChange => self.what,
            Measure::EnergyKept | Measure::ForceOnTool | Measure::WorkOfTool => return Ok(None),
        };
        let found = scene.probes.iter().position(|probe| probe.name == name);
        let unknown = || Refused::UnknownProbe { path: scene.file.clone(), name: name.into() };
        Ok(Some(found.ok_or_else(unknown)?))
    }
}

/// Rest volume of a body, m³.
fn volume(skin: &crate::scene::Skin) -> f64 {
    skin.size[0] * skin.size[1] * skin.layers.iter().map(|layer| layer.thickness).sum::<f64>()
}

fn law(scene: &Scene) -> String {
    let Some(skin) = scene.skins.first() else { return String::new() };
    match skin.law {
        Law::Fem { corotational: true, .. } => format!("corotational, {}", element_word(skin.law)),
        Law::Fem { .. } => format!("linear, {}", element_word(skin.law)),
        Law::LargeTetra { material, .. } => format!("{}, {}", word(&MATERIALS, material), element_word(skin.law)),
        _ => element_word(skin.law).into(),
    }
}

/// Strongest frequency of a signal sampled every `step` s, Hz: the maximum of `|Σ w x e^(−iωt)|` with Hann's window `w`, of the signal less its
/// mean, by bisection around the highest of the frequencies that the length of the signal tells apart. NaN for fewer than four samples.
pub fn frequency(samples: &[f64], step: f64) -> f64 {
    let n = samples.len();
    if n < 4 {
        return f64::NAN;
    }
    let mean = samples.iter().sum::<f64>() / n as f64;
    let window = |k: usize| 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / n as f64).cos();
    let power = |frequency: f64| {
        let sum = samples.iter().enumerate().fold([0.0; 2], |[re, im], (k, x)| {
            let (sin, cos) = (TAU * frequency * step * k as f64).sin_cos();
            let x = (x - mean) * window(k);
            [re + x * cos, im + x * sin]
        });
        sum[0] * sum[0] + sum[1] * sum[1]
    };
    let spacing = 1.0 / (n as f64 * step);
    let highest = (1..n / 2).map(|k| k as f64 * spacing).max_by(|a, b| power(*a).total_cmp(&power(*b)));
    let Some(highest) = highest else { return f64::NAN };
    let [mut low, mut high] = [highest - spacing, highest + spacing];
    while high - low > 1e-9 * highest {
        let third = (high - low) / 3.0;
        if power(low + third) < power(high - third) { low += third } else { high -= third }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frequency_of_a_sum_is_that_of_its_strongest_part() {
        let signal = |k: i32| {
            let t = f64::from(k) * 1e-3;
            3.0 + (TAU * 7.3 * t + 0.4).sin() + 0.1 * (TAU * 45.0 * t).cos()
        };
        let samples: Vec<f64> = (0..1000).map(signal).collect();
        let found = frequency(&samples, 1e-3);
        assert!((found / 7.3 - 1.0).abs() < 1e-4, "{found}");
        assert!(frequency(&samples[..3], 1e-3).is_nan());
    }

    #[test]
    fn errors_are_relative_to_the_size_of_a_case() {
        let row = |found: std::result::Result<f64, String>, size: f64, bound: f64| Row {
            case: Case { reference: if size > 0.0 { 0.0 } else { -2.0 }, size, ..CASES[0] },
            found,
            bound,
            cells: String::new(),
            law: String::new(),
            steps: (0.0, 1),
            warnings: BTreeMap::new(),
            seconds: 0.0,
        };
        let within = row(Ok(-2.1), 0.0, 0.06);
        assert!((within.error().unwrap() - 0.05).abs() < 1e-12, "too large is positive");
        assert!(within.holds() && !row(Ok(-2.1), 0.0, 0.04).holds());
        assert_eq!(row(Ok(0.5), 10.0, 0.1).error(), Some(0.05));
        assert!(!row(Ok(f64::NAN), 0.0, 1.0).holds() && !row(Err("no".into()), 0.0, 1.0).holds());
        assert!(row(Err("no".into()), 0.0, f64::INFINITY).holds());
    }
}
