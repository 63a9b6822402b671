//! All material laws side by side, error and time of the same run: the skin block under its weight and 1, 10 and 50 kPa on 4 × 4 mm, ν 0.45 and
//! 0.49, on 20 × 20 × 5 cells, in steps of 5 ms until it is at rest; and the block pressed by a smooth sphere in steps of 20 ms, by the corotational
//! and the neo-Hookean law. On the CPU path in f64 and f32, and on the first adapter, if there is one. The laws take turns step by step, so
//! that other work on the machine falls on all of them. Prints the tables of `benches/results/laws.md`.
//!
//! `cargo bench --bench laws`

use cutis::gpu::adapters;
use cutis::report::verify::{CASES, Case, Change};
use cutis::scene::{Element, Fibres, Integrator, Law, Material, Probe, ProbeKind, Scene};
use cutis::step::{Platform, Simulation, StepReport};
use std::time::Instant;

/// Rounds whose median counts, on the CPU path and on an adapter.
const ROUNDS: usize = 5;
const ROUNDS_ON_GPU: usize = 3;
/// Steps of 5 ms: Rayleigh damping of 0.01 s leaves 1.5⁻⁴⁰ = 1e-7 of a motion.
const STEPS: u32 = 40;
/// Steps from the start with the larger part of the motion, whose time is shown beside that of all.
const MOVING: usize = 10;
/// Largest part of the displacement that the last step may add, what solves to 1e-3 leave: at rest.
const REST: f64 = 1e-3;
/// A neo-Hookean step is to take at most so many times a corotational one.
const PRICE: f64 = 2.0;
/// Largest error of the neo-Hookean law on this grid: 4.1 % under 50 kPa.
const ON_THIS_GRID: f64 = 0.05;
/// Loads: name of the case that has the reference, pressure, Pa, and Poisson's ratio.
const LOADS: [(&str, f64, f64); 6] = [
    ("skin block, 1 kPa, ν 0.45", 1e3, 0.45),
    ("skin block, 10 kPa, ν 0.45", 10e3, 0.45),
    ("skin block, 50 kPa, ν 0.45", 50e3, 0.45),
    ("skin block, 1 kPa, ν 0.49", 1e3, 0.49),
    ("skin block, 10 kPa, ν 0.49", 10e3, 0.49),
    ("skin block, 50 kPa, ν 0.49", 50e3, 0.49),
];
/// Grid of the case that a sphere presses, as of the others.
const GRID: Change = Change::Cells([20, 20], &[2, 2, 1]);
/// Names of the cases that have a sphere and its reference.
const SPHERES: [&str; 4] = [
    "sphere R 2 mm, 0.575 mm into skin, ν 0.45",
    "sphere R 2 mm, 0.575 mm into skin, ν 0.49",
    "sphere R 2 mm, 1.15 mm into skin, ν 0.45",
    "sphere R 2 mm, 1.15 mm into skin, ν 0.49",
];
/// Length of their steps and of the run, s: the sphere goes down in the first second and is held.
const SPHERE_STEP: f64 = 0.02;
const SPHERE_END: f64 = 1.4;
/// Largest error of the neo-Hookean force on this grid: 3.1 %.
const OF_THE_SPHERE: f64 = 0.05;
/// Places in [`WAYS`].
const COROTATIONAL: usize = 1;
const NEO_HOOKEAN: usize = 2;
const WITHOUT_FIBRES: usize = 6;
const WITH_FIBRES: usize = 7;

/// A law, and how its steps are solved.
struct Way {
    name: &'static str,
    law: Law,
    newton: bool,
    fibres: bool,
    integrator: Integrator,
}

const fn way(name: &'static str, law: Law) -> Way {
    Way { name, law, newton: false, fibres: false, integrator: Integrator::ImplicitEuler }
}

const fn small_strain(corotational: bool) -> Law {
    Law::Fem { element: Element::Bbar, corotational }
}

const WAYS: [Way; 8] = [
    way("linear", small_strain(false)),
    way("corotational", small_strain(true)),
    way("neo-Hookean (the default)", Law::Hyperelastic(Material::NeoHookean)),
    Way { newton: true, ..way("neo-Hookean, Newton's method in each step", Law::Hyperelastic(Material::NeoHookean)) },
    Way {
        integrator: Integrator::Static,
        ..way("neo-Hookean, one static step", Law::Hyperelastic(Material::NeoHookean))
    },
    way("Mooney–Rivlin", Law::Hyperelastic(Material::MooneyRivlin)),
    way("Holzapfel without fibres", Law::Hyperelastic(Material::Holzapfel)),
    Way { fibres: true, ..way("Holzapfel with fibres", Law::Hyperelastic(Material::Holzapfel)) },
];

impl Way {
    /// The block of a case, which has its grid, its load and its weight, by this law.
    fn scene(&self, block: &Scene) -> Scene {
        let mut scene = block.clone();
        (scene.time.step, scene.time.integrator) = (5e-3, self.integrator);
        scene.time.duration = scene.time.step * f64::from(if self.still() { 1 } else { STEPS });
        // what a scene file has by default
        (scene.solver.tolerance, scene.solver.floor) = (1e-3, 1e-10);
        scene.solver.newton = self.newton;
        let skin = &mut scene.skins[0];
        (skin.law, skin.rayleigh_mass, skin.rayleigh_stiffness) = (self.law, 0.01, 0.01);
        for layer in &mut skin.layers {
            layer.second_share = if self.law == Law::Hyperelastic(Material::MooneyRivlin) { 0.25 } else { 0.0 };
        }
        if self.fibres {
            // of human dermis, as in scenes/verify/langer.toml
            let aside = 35f64.to_radians();
            skin.layers[1].fibres =
                Fibres { stiffness: 150e3, growth: 1.2, dispersion: 0.1, families: [aside, -aside] };
        }
        scene
    }

    fn still(&self) -> bool {
        self.integrator == Integrator::Static
    }

    /// Displacement of the centre in the static balance of this law on this grid, m.
    fn balance(&self, block: &Scene) -> f64 {
        let mut scene = Way { integrator: Integrator::Static, ..*self }.scene(block);
        (scene.solver.tolerance, scene.solver.floor) = (1e-8, 0.0);
        let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene is valid");
        simulation.step(false).expect("there is a balance").probes[0]
    }
}

/// A run of a law.
#[derive(Clone, Default)]
struct Run {
    /// `[step]` what is read at its end: displacement of the centre, m, or force on the sphere, N.
    values: Vec<f64>,
    /// `[step]` s
    seconds: Vec<f64>,
    /// Of conjugate gradients, of all steps.
    iterations: u32,
}

impl Run {
    /// Mean time of the first `count` steps, or of all where there are fewer, s.
    fn per_step(&self, count: usize) -> f64 {
        let first = &self.seconds[..count.min(self.seconds.len())];
        first.iter().sum::<f64>() / first.len() as f64
    }
}

/// What is read of a step.
type Read = fn(&StepReport) -> f64;

/// Displacement of the centre, m.
const CENTRE: Read = |report| report.probes[0];
/// Upward force on the sphere, N.
const FORCE: Read = |report| report.contact.on_tool[0][2];

/// Runs all scenes once, a step of each in turn.
fn round(scenes: &[Scene], platform: &Platform, first: usize, read: Read) -> Vec<Run> {
    let mut simulations: Vec<Simulation> =
        scenes.iter().map(|scene| Simulation::new(scene, platform).expect("the scene is valid")).collect();
    let mut runs = vec![Run::default(); scenes.len()];
    let steps = scenes.iter().map(|scene| scene.time.steps()).max().unwrap_or(0);
    for step in 0..steps {
        for turn in 0..scenes.len() {
            let k = (turn + first + step as usize) % scenes.len();
            if step >= scenes[k].time.steps() {
                continue;
            }
            let begin = Instant::now();
            let report = simulations[k].step(false).expect("it runs");
            runs[k].seconds.push(begin.elapsed().as_secs_f64());
            assert!(report.free.converged, "{:?}, step {step}", scenes[k].skins[0].law);
            runs[k].iterations += report.free.iterations;
            runs[k].values.push(read(&report));
        }
    }
    runs
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Results of a way on a platform.
struct Found {
    /// m
    u: f64,
    /// Of conjugate gradients, per step.
    iterations: f64,
    /// Time of a step relative to a corotational one, of the moving steps and of all, medians of the rounds.
    ratios: [f64; 2],
    /// The same, ms.
    steps: [f64; 2],
}

/// Rounds of scenes on a platform.
fn rounds(scenes: &[Scene], platform: &Platform, read: Read) -> Vec<Vec<Run>> {
    let count = if matches!(platform, Platform::Gpu(_)) { ROUNDS_ON_GPU } else { ROUNDS };
    (0..count).map(|first| round(scenes, platform, first, read)).collect()
}

fn found(scenes: &[Scene], platform: &Platform) -> Vec<Found> {
    let rounds = rounds(scenes, platform, CENTRE);
    let of = |k: usize| {
        let Run { values, iterations, .. } = &rounds[0][k];
        let last = values[values.len() - 1];
        if !WAYS[k].still() {
            let added = (last / values[values.len() - 2] - 1.0).abs();
            assert!(added < REST, "{} is not at rest: {added:e}", WAYS[k].name);
        }
        let counts = [MOVING, STEPS as usize];
        let ratio = |n: usize, round: &Vec<Run>| round[k].per_step(n) / round[COROTATIONAL].per_step(n);
        Found {
            u: last,
            iterations: f64::from(*iterations) / values.len() as f64,
            ratios: counts.map(|n| median(rounds.iter().map(|round| ratio(n, round)).collect())),
            steps: counts.map(|n| 1e3 * median(rounds.iter().map(|round| round[k].per_step(n)).collect())),
        }
    };
    (0..scenes.len()).map(of).collect()
}

/// The block of a load, with its probe, and the displacement of the centre by the neo-Hookean law, converged on finer elements, m.
fn block(name: &str, pressure: f64, poisson: f64) -> (Scene, f64) {
    let neo_hookean = |law: &Change| *law == Change::Law(WAYS[NEO_HOOKEAN].law);
    let case = CASES.iter().find(|case| case.name == name && case.changes.iter().any(neo_hookean));
    let case = case.expect("it is a known answer");
    let mut scene = case.scene().expect("its scene is valid");
    let point = [0.0, 0.0, 2.3e-3];
    scene.probes = vec![Probe { name: "u_z".into(), kind: ProbeKind::Displacement { body: 0, point, axis: 2 } }];
    let skin = &scene.skins[0];
    let levels: Vec<u32> = skin.layers.iter().map(|layer| layer.cells).collect();
    assert!(skin.cells == [20, 20] && levels == [2, 2, 1] && skin.layers.iter().all(|l| l.poisson == poisson));
    let loaded = format!("{:?}", scene.loads);
    assert!(loaded.contains(&format!("pressure: {pressure:?}")), "{loaded}");
    (scene, case.reference)
}

/// Joins a value of each platform.
fn joined<T>(of: &[T], word: impl Fn(&T) -> String) -> String {
    of.iter().map(word).collect::<Vec<_>>().join(", ")
}

fn off(value: f64, from: f64) -> f64 {
    100.0 * (value / from - 1.0)
}

/// Prints the lines of a load; what a neo-Hookean step takes, corotational = 1, on each platform, of the moving steps and of all.
fn lines(name: &str, pressure: f64, poisson: f64, platforms: &[Platform]) -> Vec<[f64; 2]> {
    let (block, reference) = block(name, pressure, poisson);
    let scenes: Vec<Scene> = WAYS.iter().map(|way| way.scene(&block)).collect();
    let found: Vec<Vec<Found>> = platforms.iter().map(|platform| found(&scenes, platform)).collect();
    let double = &found[0];
    for (k, way) in WAYS.iter().enumerate() {
        let balance = way.balance(&block);
        let own = joined(&found, |found| format!("{:+.3}", off(found[k].u, balance)));
        let time = |n: usize| {
            let ms = joined(&found, |found| format!("{:.1}", found[k].steps[n]));
            let ms = if k == COROTATIONAL { format!(" ({ms} ms)") } else { String::new() };
            joined(&found, |found| format!("{:.2}", found[k].ratios[n])) + &ms
        };
        println!(
            "| {poisson} | {} | {} | {:.4} | {:+.1} | {} | {} | {} | {} |",
            pressure / 1e3,
            way.name,
            1e3 * double[k].u,
            off(double[k].u, reference),
            if way.still() { "–".into() } else { own },
            joined(&found, |found| format!("{:.1}", found[k].iterations)),
            if way.still() { "–".into() } else { time(0) },
            time(1)
        );
    }
    let off = |k: usize, from: f64| (double[k].u / from - 1.0).abs();
    assert!(off(NEO_HOOKEAN, reference) < ON_THIS_GRID, "its time means nothing");
    assert!(pressure < 50e3 || off(COROTATIONAL, reference) > 0.5, "another law is not noticed");
    assert!(off(WITHOUT_FIBRES, double[NEO_HOOKEAN].u) < 1e-6, "without fibres it is the neo-Hookean law");
    assert!(off(WITH_FIBRES, double[NEO_HOOKEAN].u) > 1e-3, "fibres are not noticed");
    found.iter().map(|found| found[NEO_HOOKEAN].ratios).collect()
}

/// The case of a sphere on this grid, by the neo-Hookean law.
fn pressed(name: &str) -> &'static Case {
    let wanted = [Change::Law(WAYS[NEO_HOOKEAN].law), GRID];
    let case = CASES.iter().find(|case| case.name == name && wanted.iter().all(|change| case.changes.contains(change)));
    case.expect("it is a known answer")
}

/// Prints the lines of a sphere; what a neo-Hookean step takes on each platform, corotational = 1.
fn sphere_lines(name: &str, platforms: &[Platform]) -> Vec<f64> {
    let case = pressed(name);
    let scene = |way: usize| {
        let mut scene = case.scene().expect("its scene is valid");
        (scene.time.integrator, scene.time.step, scene.time.duration) =
            (Integrator::ImplicitEuler, SPHERE_STEP, SPHERE_END);
        // what a scene file has by default
        (scene.solver.tolerance, scene.solver.floor) = (1e-3, 1e-10);
        let skin = &mut scene.skins[0];
        (skin.law, skin.rayleigh_mass, skin.rayleigh_stiffness) = (WAYS[way].law, 0.01, 0.01);
        scene
    };
    let ways = [COROTATIONAL, NEO_HOOKEAN];
    let scenes = ways.map(scene);
    let all: Vec<Vec<Vec<Run>>> = platforms.iter().map(|platform| rounds(&scenes, platform, FORCE)).collect();
    let last = |runs: &[Run], k: usize| runs[k].values.last().copied().unwrap_or(f64::NAN);
    let per_step = |runs: &[Run], k: usize| runs[k].per_step(usize::MAX);
    let ratio = |rounds: &[Vec<Run>], k: usize| {
        median(rounds.iter().map(|runs| per_step(runs, k) / per_step(runs, 0)).collect())
    };
    for (k, way) in ways.iter().enumerate() {
        let ms = joined(&all, |rounds| {
            format!("{:.1}", 1e3 * median(rounds.iter().map(|runs| per_step(runs, k)).collect()))
        });
        println!(
            "| {name} | {} | {:.4} | {} | {} | {} | {ms} |",
            WAYS[*way].name,
            last(&all[0][0], k),
            joined(&all, |rounds| format!("{:+.1}", off(last(&rounds[0], k), case.reference))),
            joined(&all, |rounds| {
                let run = &rounds[0][k];
                format!("{:.1}", f64::from(run.iterations) / run.values.len() as f64)
            }),
            joined(&all, |rounds| format!("{:.2}", ratio(rounds, k))),
        );
    }
    for rounds in &all {
        let errors = [0, 1].map(|k| (last(&rounds[0], k) / case.reference - 1.0).abs());
        assert!(errors[1] < OF_THE_SPHERE, "its time means nothing: {errors:?}");
        assert!(errors[0] > 2.0 * OF_THE_SPHERE, "another law is not noticed: {errors:?}");
    }
    all.iter().map(|rounds| ratio(rounds, 1)).collect()
}

/// Prints the range of ratios.
fn summed(which: &str, mut ratios: Vec<f64>) {
    ratios.sort_by(f64::total_cmp);
    let held = ratios.iter().filter(|ratio| **ratio <= PRICE).count();
    println!(
        "\nneo-Hookean over corotational, {which}: {:.2} to {:.2}; at most {PRICE} in {held} of {}",
        ratios[0],
        ratios[ratios.len() - 1],
        ratios.len()
    );
}

fn main() {
    let mut platforms = vec![Platform::Cpu64, Platform::Cpu32];
    let mut names = String::from("f64, f32");
    println!("CPU: {} threads", std::thread::available_parallelism().map_or(1, usize::from));
    match adapters().first() {
        Some(adapter) => {
            println!("GPU: {} ({}, {})", adapter.name, adapter.backend, adapter.driver);
            platforms.push(Platform::Gpu(None));
            names += ", GPU";
        }
        None => println!("no adapter: the GPU is left out"),
    }
    println!(
        "\n| ν | kPa | law | u_z of the centre, mm | off the neo-Hookean reference % | off the law's own balance %: {names} | iterations per step: {names} | time per step, corotational = 1, first {MOVING} steps: {names} | all {STEPS}: {names} |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let ratios: Vec<[f64; 2]> =
        LOADS.iter().flat_map(|(name, pressure, poisson)| lines(name, *pressure, *poisson, &platforms)).collect();
    for (n, which) in ["first steps", "all steps"].into_iter().enumerate() {
        summed(which, ratios.iter().map(|ratio| ratio[n]).collect());
    }
    println!(
        "\n| sphere | law | force, N | off the neo-Hookean reference %: {names} | iterations per step: {names} | time per step, corotational = 1: {names} | ms: {names} |"
    );
    println!("|---|---|---|---|---|---|---|");
    let ratios = SPHERES.iter().flat_map(|name| sphere_lines(name, &platforms)).collect();
    summed("pressed by a sphere", ratios);
}
