//! Solvers, speed and error in one run: time to 1 % displacement error of one step, multigrid against plain conjugate gradients; 25 plain
//! iterations as in SOFA; iterations of multigrid on growing grids; the direct solver. Prints Markdown; every time stands beside its error.
//!
//! `cargo bench --bench solve` runs everything; `-- cpu` omits the GPU, `-- gpu` the CPU; `-- direct`, `table`, `one-percent` run one part.

use cutis::backend::{Backend, CpuBackend, FREE, GpuBackend, Needs, Snapshot, SolveRequest, Target};
use cutis::bodies::Model;
use cutis::bodies::grid::direct::Direct;
use cutis::gpu::Gpu;
use cutis::scene::{Files, Preconditioner, parse};
use std::path::Path;
use std::sync::{Arc, LazyLock};
use std::time::Instant;

/// Relative L2 error of the displacement that is asked for.
const ERROR: f64 = 0.01;
/// Rounds whose median counts; methods take turns.
const ROUNDS: usize = 5;
/// A tolerance that no solve here reaches in f32.
const TIGHT: f64 = 1e-9;
/// Iterations that no method here needs.
const CAP: u32 = 20_000;

const SCENE: &str = r#"title = "press"
[time]
step_ms = STEP
duration_s = 1.0
[solver]
preconditioner = "none"
[skin]
size_mm = [20, 20]
cells = [ACROSS, ACROSS]
rayleigh_mass_per_s = 0.01
rayleigh_stiffness_s = 0.01
layer = [
    { name = "hypodermis", thickness_mm = 1.2, cells = L0, young_kpa = 34, poisson = NU, density_kg_m3 = 971 },
    { name = "dermis", thickness_mm = 1.0, cells = L1, young_kpa = 200, poisson = NU, density_kg_m3 = 1116 },
    { name = "epidermis", thickness_mm = 0.1, cells = L2, young_kpa = 1000, poisson = NU, density_kg_m3 = 1116 },
]
[[boundary]]
region = "bottom"
[[load]]
pressure_kpa = 10
rectangle_mm = [[-2, -2], [2, 2]]
"#;

const THIN: [u32; 3] = [2, 2, 1];
const THICK: [u32; 3] = [10, 10, 3];

/// Where a solve runs.
#[derive(Clone, Copy, PartialEq)]
enum Platform {
    F64,
    F32,
    Gpu,
}

impl Platform {
    fn name(self) -> &'static str {
        match self {
            Self::F64 => "CPU f64",
            Self::F32 => "CPU f32",
            Self::Gpu => "GPU f32",
        }
    }
}

/// A press on the skin, to be solved from rest.
#[derive(Clone, Copy)]
struct Press {
    across: u32,
    levels: [u32; 3],
    poisson: f64,
    step_ms: u32,
}

impl Press {
    fn name(&self) -> String {
        format!("{0}×{0}×{1}, ν {2}", self.across, self.levels.iter().sum::<u32>(), self.poisson)
    }

    fn model(&self, preconditioner: Preconditioner) -> (Model, Vec<[f64; 3]>) {
        let mut text = SCENE.replace("ACROSS", &self.across.to_string()).replace("NU", &self.poisson.to_string());
        text = text.replace("STEP", &self.step_ms.to_string());
        for (k, cells) in self.levels.iter().enumerate() {
            text = text.replace(&format!("L{k}"), &cells.to_string());
        }
        let mut scene = parse(&text, Path::new("press.toml"), &Files::Embedded(&[])).expect("the text is a scene");
        scene.solver.preconditioner = preconditioner;
        let model = Model::new(&scene, 0).expect("the grid is small enough");
        let load = model.load_at(&scene.loads, 0.0);
        (model, load)
    }

    fn backend(&self, platform: Platform, preconditioner: Preconditioner, cap: u32) -> Box<dyn Backend> {
        let (model, load) = self.model(preconditioner);
        let rest = vec![[0.0; 4]; model.grid.node_count()];
        let start = Snapshot { u: rest.clone(), v: rest, ..Snapshot::default() };
        let needs = Needs::default();
        let mut backend: Box<dyn Backend> = match platform {
            Platform::F64 => Box::new(CpuBackend::<f64>::new(&model, needs, cap, 0.0, &start)),
            Platform::F32 => Box::new(CpuBackend::<f32>::new(&model, needs, cap, 0.0, &start)),
            Platform::Gpu => {
                // one device for all, whose number is limited
                static DEVICE: LazyLock<Arc<Gpu>> = LazyLock::new(|| Arc::new(Gpu::open(None).expect("an adapter")));
                Box::new(GpuBackend::new(DEVICE.clone(), &model, needs, cap, 0.0, &start).expect("the grid fits"))
            }
        };
        backend.set_load(&load);
        backend
    }

    /// One step's displacement, solved until `tolerance` or the cap, and the iterations and milliseconds that it took.
    fn solve(backend: &mut dyn Backend, tolerance: f64) -> (Vec<[f64; 4]>, u32, f64) {
        backend.reset_initial_guess(&[FREE]).expect("the device works");
        let begin = Instant::now();
        backend.begin().expect("the device works");
        let wanted = [SolveRequest { rhs: FREE, target: Target::OfLoad(tolerance) }];
        let outcome = backend.solve(&wanted, &[]).expect("the device works").0[0];
        let spent = begin.elapsed().as_secs_f64() * 1e3;
        (backend.solution(FREE).expect("the device works"), outcome.iterations, spent)
    }
}

fn error(found: &[[f64; 4]], exact: &[[f64; 4]]) -> f64 {
    let square = |a: &[f64]| a.iter().map(|c| c * c).sum::<f64>();
    let difference: f64 = found.iter().zip(exact).map(|(a, b)| square(&[a[0] - b[0], a[1] - b[1], a[2] - b[2]])).sum();
    (difference / exact.iter().map(|b| square(&b[..3])).sum::<f64>()).sqrt()
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// The fewest iterations that reach the error from rest, by halving, and the tolerance that stops a solve right there.
fn loosest(press: &Press, platform: Platform, kind: Preconditioner, exact: &[[f64; 4]]) -> (u32, f64) {
    let at = |cap: u32| {
        let mut backend = press.backend(platform, kind, cap);
        backend.begin().expect("the device works");
        let wanted = [SolveRequest { rhs: FREE, target: Target::OfLoad(TIGHT) }];
        let outcome = backend.solve(&wanted, &[]).expect("the device works").0[0];
        let left = error(&backend.solution(FREE).expect("the device works"), exact);
        (left, outcome.residual / outcome.target * TIGHT)
    };
    let (mut low, mut high) = (0, 1);
    while at(high).0 > ERROR {
        (low, high) = (high, high * 2);
        assert!(high < 1 << 14, "no convergence");
    }
    while high - low > 1 {
        let middle = low.midpoint(high);
        if at(middle).0 <= ERROR { high = middle } else { low = middle }
    }
    // the residual of plain CG goes up and down: it may be as small long before
    (high, if kind == Preconditioner::None { 0.0 } else { 1.001 * at(high).1 })
}

const KINDS: [(Preconditioner, &str); 3] =
    [(Preconditioner::None, "plain CG"), (Preconditioner::Column, "columns"), (Preconditioner::Multigrid, "multigrid")];

fn to_one_percent(platforms: &[Platform], rounds: usize) {
    println!("\n## Time to 1 % displacement error (relative L2) of one step of 10 ms, from rest\n");
    println!(
        "| grid | platform | method | iterations | error % | ms (begin and solve) | plain / this |\n|---|---|---|---|---|---|---|"
    );
    for (across, poisson) in [(14, 0.45), (14, 0.49), (32, 0.45), (32, 0.49)] {
        let press = Press { across, levels: THICK, poisson, step_ms: 10 };
        let exact = Press::solve(press.backend(Platform::F64, Preconditioner::Multigrid, 500).as_mut(), 1e-10).0;
        for platform in platforms {
            // each platform has its own: residuals of different rounding may be as small some iterations earlier
            let stops = KINDS.map(|(kind, _)| loosest(&press, *platform, kind, &exact));
            let mut backends = [0, 1, 2].map(|k| press.backend(*platform, KINDS[k].0, stops[k].0));
            let mut times = [vec![], vec![], vec![]];
            let (mut errors, mut counts) = ([0.0; 3], [0; 3]);
            for _ in 0..rounds {
                for k in 0..3 {
                    let (x, count, spent) = Press::solve(backends[k].as_mut(), stops[k].1);
                    (errors[k], counts[k]) = (error(&x, &exact), count);
                    times[k].push(spent);
                }
            }
            let plain = median(times[0].clone());
            for k in 0..3 {
                let spent = median(times[k].clone());
                // plain CG in another rounding may need more iterations than are counted here, to its advantage
                let most = if k == 0 { 2.0 * ERROR } else { 1.1 * ERROR };
                assert!(errors[k] <= most, "{}: {} is off by {}", press.name(), KINDS[k].1, errors[k]);
                println!(
                    "| {} | {} | {} | {} | {:.2} | {spent:.1} | {:.1} |",
                    press.name(),
                    platform.name(),
                    KINDS[k].1,
                    counts[k],
                    100.0 * errors[k],
                    plain / spent
                );
            }
        }
    }
}

/// SOFA's default: 25 plain iterations, whatever the residual.
fn twenty_five(platforms: &[Platform]) {
    println!("\n## 25 plain iterations (SOFA: 0.20 to 0.25 µs per hexahedron and iteration on one thread)\n");
    println!("| cells | platform | µs per cell and iteration | error left % |\n|---|---|---|---|");
    for across in [14, 65] {
        let press = Press { across, levels: THICK, poisson: 0.45, step_ms: 10 };
        let exact = Press::solve(press.backend(Platform::F64, Preconditioner::Multigrid, 500).as_mut(), 1e-8).0;
        let cells = across * across * 23;
        for platform in platforms {
            let mut few = press.backend(*platform, Preconditioner::None, 1);
            let mut many = press.backend(*platform, Preconditioner::None, 26);
            let mut times = vec![];
            let mut left = 0.0;
            for _ in 0..ROUNDS {
                // the difference leaves out forces and rotations
                let start = Press::solve(few.as_mut(), 0.0).2;
                let (x, _, spent) = Press::solve(many.as_mut(), 0.0);
                left = error(&x, &exact);
                times.push((spent - start) * 1e3 / 25.0 / f64::from(cells));
            }
            println!("| {cells} | {} | {:.4} | {:.0} |", platform.name(), median(times), 100.0 * left);
        }
    }
}

/// One step of 5 ms on 14 × 14 × 23 cells to 1 % error: everything but the integration, the last pass over the nodes.
fn incision_grid(platforms: &[Platform]) {
    println!("\n## 14 × 14 × 23 cells, one whole step of 5 ms by multigrid to 1 % displacement error\n");
    println!("| grid | platform | iterations | error % | ms per step |\n|---|---|---|---|---|");
    for poisson in [0.45, 0.49] {
        let press = Press { across: 14, levels: THICK, poisson, step_ms: 5 };
        let exact = Press::solve(press.backend(Platform::F64, Preconditioner::Multigrid, 500).as_mut(), 1e-10).0;
        let (_, tolerance) = loosest(&press, Platform::F32, Preconditioner::Multigrid, &exact);
        for platform in platforms {
            let mut backend = press.backend(*platform, Preconditioner::Multigrid, CAP);
            // the first is not timed: a software adapter compiles there
            let (x, count, _) = Press::solve(backend.as_mut(), tolerance);
            let left = error(&x, &exact);
            let times = (0..4 * ROUNDS).map(|_| Press::solve(backend.as_mut(), tolerance).2).collect();
            println!(
                "| {} | {} | {count} | {:.2} | {:.1} |",
                press.name(),
                platform.name(),
                100.0 * left,
                median(times)
            );
        }
    }
}

/// Solves the press as the unconstrained motion after [`Backend::begin`]; returns ms.
fn solve_alone(backend: &mut dyn Backend, load: &[[f64; 3]], tolerance: f64) -> f64 {
    let rows: Vec<_> = load.iter().enumerate().map(|(node, f)| (FREE, node as u32, *f)).collect();
    backend.reset_initial_guess(&[FREE]).expect("the device works");
    backend.set_rows(&[FREE], &rows).expect("the device works");
    let begin = Instant::now();
    let wanted = [SolveRequest { rhs: FREE, target: Target::OfLoad(tolerance) }];
    backend.solve(&wanted, &[]).expect("the device works");
    begin.elapsed().as_secs_f64() * 1e3
}

/// Exact solves against multigrid; the first step also analyses the pattern.
fn direct(platforms: &[Platform]) {
    println!("\n## The direct solver, one step of 10 ms, against multigrid to 1e-6 (f32: 1e-5)\n");
    println!(
        "| grid | platform | factor MB | ms: first step | each step | solve alone | iterations | multigrid: ms each step | solve alone | iterations |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (across, levels, poisson) in [(24, THIN, 0.45), (14, THICK, 0.45), (14, THICK, 0.49), (32, THICK, 0.45)] {
        let press = Press { across, levels, poisson, step_ms: 10 };
        let (model, load) = press.model(Preconditioner::Direct);
        let mut factor = Direct::new(&model).expect("direct");
        let at_rest = vec![[0.0, 0.0, 0.0, 1.0]; model.grid.cell_count()];
        factor.factor(&at_rest, &model.dofs).expect("the bottom is held");
        let megabytes = factor.numbers() / 125_000;
        drop(factor);
        for platform in platforms.iter().filter(|p| **p != Platform::Gpu) {
            let tight = if *platform == Platform::F64 { 1e-6 } else { 1e-5 };
            let run = |kind: Preconditioner| {
                let mut backend = press.backend(*platform, kind, 500);
                let (x, count, first) = Press::solve(backend.as_mut(), tight);
                let each = median((0..3).map(|_| Press::solve(backend.as_mut(), tight).2).collect());
                let alone = median((0..3).map(|_| solve_alone(backend.as_mut(), &load, tight)).collect());
                (x, count, first, each, alone)
            };
            let (exact, by_cycles) = (run(Preconditioner::Direct), run(Preconditioner::Multigrid));
            let apart = error(&by_cycles.0, &exact.0);
            assert!(apart <= ERROR, "{}: the two are apart by {apart}", press.name());
            println!(
                "| {} | {} | {megabytes} | {:.0} | {:.0} | {:.1} | {} | {:.0} | {:.1} | {} |",
                press.name(),
                platform.name(),
                exact.2,
                exact.3,
                exact.4,
                exact.1,
                by_cycles.3,
                by_cycles.4,
                by_cycles.1
            );
        }
    }
}

fn table(platforms: &[Platform]) {
    println!("\n## Multigrid iterations to 1e-3 and 1e-6 (f32: 1e-5), and ms per iteration and million cells\n");
    println!("| grid | platform | iterations | ms per iteration and 10⁶ cells |\n|---|---|---|---|");
    for (across, levels) in [(16, THIN), (16, THICK), (32, THIN), (32, THICK), (64, THIN), (128, THIN)] {
        for poisson in [0.45, 0.49] {
            let press = Press { across, levels, poisson, step_ms: 10 };
            let cells = f64::from(across * across * levels.iter().sum::<u32>());
            for platform in platforms {
                let mut backend = press.backend(*platform, Preconditioner::Multigrid, 200);
                let tight = if *platform == Platform::F64 { 1e-6 } else { 1e-5 };
                let runs = [1e-3, tight].map(|t| Press::solve(backend.as_mut(), t));
                let each = runs[1].2 / f64::from(runs[1].1) / cells * 1e6;
                println!("| {} | {} | {} / {} | {each:.0} |", press.name(), platform.name(), runs[0].1, runs[1].1);
            }
        }
    }
}

fn main() {
    let only = std::env::args().skip(1).find(|a| a == "cpu" || a == "gpu");
    let mut platforms = vec![];
    if only.as_deref() != Some("gpu") {
        platforms.extend([Platform::F64, Platform::F32]);
        println!("CPU: {} threads", std::thread::available_parallelism().map_or(1, usize::from));
    }
    if only.as_deref() != Some("cpu") {
        match Gpu::open(None) {
            Ok(gpu) => {
                println!("GPU: {} ({}, {})", gpu.adapter.name, gpu.adapter.backend, gpu.adapter.driver);
                platforms.push(Platform::Gpu);
            }
            Err(e) => println!("the GPU is left out: {e}"),
        }
    }
    let part = |name: &str| std::env::args().any(|a| a == name);
    if part("direct") {
        return direct(&platforms);
    }
    if part("table") {
        return table(&platforms);
    }
    if part("one-percent") {
        return to_one_percent(&platforms, ROUNDS);
    }
    direct(&platforms);
    incision_grid(&platforms);
    twenty_five(&platforms);
    table(&platforms);
    to_one_percent(&platforms, ROUNDS);
}
