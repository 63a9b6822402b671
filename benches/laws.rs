//! All material laws side by side, error and time of the same run: the skin block under its weight and 1, 10 and 50 kPa on 4 × 4 mm, ν 0.45 and
//! 0.49, on 20 × 20 × 5 cells, in steps of 5 ms until it is at rest, on the CPU path in f64 and f32. The laws take turns step by step, so that
//! other work on the machine falls on all of them. Prints the table of `benches/results/laws.md`.
//!
//! `cargo bench --bench laws`

use cutis::report::verify::{CASES, Change};
use cutis::scene::{Element, Fibres, Integrator, Law, Material, Probe, ProbeKind, Scene};
use cutis::step::{Platform, Simulation};
use std::time::Instant;

/// Rounds whose median counts.
const ROUNDS: usize = 5;
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
    /// `[step]` displacement of the centre at its end, m.
    u: Vec<f64>,
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

/// Runs all ways once, a step of each in turn.
fn round(scenes: &[Scene], platform: &Platform, first: usize) -> Vec<Run> {
    let mut simulations: Vec<Simulation> =
        scenes.iter().map(|scene| Simulation::new(scene, platform).expect("the scene is valid")).collect();
    let mut runs = vec![Run::default(); scenes.len()];
    for step in 0..STEPS {
        for turn in 0..scenes.len() {
            let k = (turn + first + step as usize) % scenes.len();
            if step >= scenes[k].time.steps() {
                continue;
            }
            let begin = Instant::now();
            let report = simulations[k].step(false).expect("it runs");
            runs[k].seconds.push(begin.elapsed().as_secs_f64());
            assert!(report.free.converged, "{}, step {step}", WAYS[k].name);
            runs[k].iterations += report.free.iterations;
            runs[k].u.push(report.probes[0]);
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

fn found(scenes: &[Scene], platform: &Platform) -> Vec<Found> {
    let rounds: Vec<Vec<Run>> = (0..ROUNDS).map(|first| round(scenes, platform, first)).collect();
    let of = |k: usize| {
        let Run { u, iterations, .. } = &rounds[0][k];
        let last = u[u.len() - 1];
        if !WAYS[k].still() {
            let added = (last / u[u.len() - 2] - 1.0).abs();
            assert!(added < REST, "{} is not at rest: {added:e}", WAYS[k].name);
        }
        let counts = [MOVING, STEPS as usize];
        let ratio = |n: usize, round: &Vec<Run>| round[k].per_step(n) / round[COROTATIONAL].per_step(n);
        Found {
            u: last,
            iterations: f64::from(*iterations) / u.len() as f64,
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

/// Prints the lines of a load; what a neo-Hookean step takes, corotational = 1, in f64 and f32, each of the moving steps and of all.
fn lines(name: &str, pressure: f64, poisson: f64) -> [[f64; 2]; 2] {
    let (block, reference) = block(name, pressure, poisson);
    let scenes: Vec<Scene> = WAYS.iter().map(|way| way.scene(&block)).collect();
    let [double, single] = [Platform::Cpu64, Platform::Cpu32].map(|platform| found(&scenes, &platform));
    for (k, way) in WAYS.iter().enumerate() {
        let balance = way.balance(&block);
        let (d, s) = (&double[k], &single[k]);
        let off = |u: f64, from: f64| 100.0 * (u / from - 1.0);
        let own =
            if way.still() { "–".into() } else { format!("{:+.3}, {:+.3}", off(d.u, balance), off(s.u, balance)) };
        let time = |n: usize| {
            let (d, s) = ([d.ratios[n], d.steps[n]], [s.ratios[n], s.steps[n]]);
            let ms = if k == COROTATIONAL { format!(" ({:.1}, {:.1} ms)", d[1], s[1]) } else { String::new() };
            format!("{:.2}, {:.2}{ms}", d[0], s[0])
        };
        println!(
            "| {poisson} | {} | {} | {:.4} | {:+.1} | {own} | {:.1}, {:.1} | {} | {} |",
            pressure / 1e3,
            way.name,
            1e3 * d.u,
            off(d.u, reference),
            d.iterations,
            s.iterations,
            if way.still() { "–".into() } else { time(0) },
            time(1)
        );
    }
    let off = |k: usize, from: f64| (double[k].u / from - 1.0).abs();
    assert!(off(NEO_HOOKEAN, reference) < ON_THIS_GRID, "its time means nothing");
    assert!(pressure < 50e3 || off(COROTATIONAL, reference) > 0.5, "another law is not noticed");
    assert!(off(WITHOUT_FIBRES, double[NEO_HOOKEAN].u) < 1e-6, "without fibres it is the neo-Hookean law");
    assert!(off(WITH_FIBRES, double[NEO_HOOKEAN].u) > 1e-3, "fibres are not noticed");
    [double, single].map(|found| found[NEO_HOOKEAN].ratios)
}

fn main() {
    println!("CPU: {} threads\n", std::thread::available_parallelism().map_or(1, usize::from));
    println!(
        "| ν | kPa | law | u_z of the centre, mm | off the neo-Hookean reference % | off the law's own balance %: f64, f32 | iterations per step: f64, f32 | time per step, corotational = 1, first {MOVING} steps: f64, f32 | all {STEPS}: f64, f32 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let ratios = LOADS.map(|(name, pressure, poisson)| lines(name, pressure, poisson));
    for (n, which) in ["first", "all"].into_iter().enumerate() {
        let of = |ratios: &[[f64; 2]; 2]| ratios.map(|precision| precision[n]);
        let mut all: Vec<f64> = ratios.iter().flat_map(of).collect();
        all.sort_by(f64::total_cmp);
        let held = all.iter().filter(|ratio| **ratio <= PRICE).count();
        println!(
            "\nneo-Hookean over corotational, {which} steps: {:.2} to {:.2}; at most {PRICE} in {held} of {}",
            all[0],
            all[all.len() - 1],
            all.len()
        );
    }
}
