//! Tetrahedra and embedded surfaces beside hexahedra, on the CPU path in f64; prints Markdown. Every table has its error beside its times, which
//! are ratios to hexahedra in the same run.
//!
//! 1. Error of the skin block's centre (10 kPa, ν 0.45, static, against 27-node hexahedra, converged) and time of the step, on finer and finer
//!    grids, until it is within 1 %. The embedded block is turned by 30°, so that its sides cut cells; it is 9 mm or more from the load to them.
//! 2. An iteration of plain conjugate gradients on those bodies (a product and its sums), per degree of freedom.
//! 3. Removal of a cell: the call, and what the step after it takes more, on bodies of growing width.
//! 4. Memory of a simulation per node, each in a process of its own (Linux).
//!
//! `cargo bench --bench tetrahedra -- 1 3` makes the first and the third table alone.

use cutis::mesh::Grid;
use cutis::scene::{
    ClosedSurface, Cut, Element, Integrator, Law, Material, Preconditioner, Scene, Skin, TetrahedralMesh, read,
};
use cutis::step::{Platform, Simulation};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Displacement of the centre, m: 27-node hexahedra, converged (`cutis verify`).
const CENTRE: f64 = -0.1836e-3;
const ENOUGH: f64 = 0.01;
/// Cells across and of each layer.
const GRIDS: [(u32, [u32; 3]); 5] =
    [(20, [2, 2, 1]), (28, [3, 3, 1]), (40, [4, 3, 1]), (56, [6, 5, 1]), (80, [8, 7, 1])];
/// Angle of the embedded block, rad.
const TURNED: f64 = std::f64::consts::PI / 6.0;
const ROUNDS: usize = 7;

/// Kind of the body.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Hexahedra,
    Embedded,
    Smoothed,
    Plain,
}

const KINDS: [(Kind, &str); 4] = [
    (Kind::Hexahedra, "hexahedra"),
    (Kind::Embedded, "embedded, 30° aslant"),
    (Kind::Smoothed, "tetrahedra, smoothed"),
    (Kind::Plain, "tetrahedra, plain"),
];

/// The block of 20 × 20 × 2.3 mm turned about z, with the loaded square on its top as triangles of their own.
fn turned_block() -> ClosedSurface {
    let (sin, cos) = TURNED.sin_cos();
    let (edge, inner) = (10e-3, 2e-3);
    let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let turn = |[x, y]: [f64; 2]| [edge * (x * cos - y * sin), edge * (x * sin + y * cos)];
    let mut points: Vec<[f64; 3]> = vec![];
    for z in [0.0, 2.3e-3] {
        points.extend(square.map(turn).map(|[x, y]| [x, y, z]));
    }
    points.extend(square.map(|[x, y]| [inner * x, inner * y, 2.3e-3]));
    let mut triangles: Vec<[u32; 3]> = vec![[0, 2, 1], [0, 3, 2], [8, 9, 10], [8, 10, 11]];
    for k in 0..4 {
        let next = (k + 1) % 4;
        triangles.extend([[k, next, 4 + next], [k, 4 + next, 4 + k]]);
        triangles.extend([[4 + k, 4 + next, 8 + next], [4 + k, 8 + next, 8 + k]]);
    }
    ClosedSurface::new(points, triangles).unwrap_or_else(|leak| panic!("{leak}"))
}

fn block(kind: Kind, (across, levels): (u32, [u32; 3])) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/verify/skin_block_neo_045.toml");
    let mut scene = read(&file).expect("the shipped scene is valid");
    scene.time.integrator = Integrator::Static;
    (scene.solver.tolerance, scene.solver.floor) = (1e-6, 0.0);
    scene.study = Default::default();
    let skin = &mut scene.skins[0];
    skin.cells = [across; 2];
    skin.layers.iter_mut().zip(levels).for_each(|(layer, cells)| layer.cells = cells);
    let material = Material::NeoHookean;
    skin.law = match kind {
        Kind::Hexahedra | Kind::Embedded => Law::Hyperelastic(material),
        Kind::Smoothed => Law::LargeTetra { material, element: Element::Tetra },
        Kind::Plain => Law::LargeTetra { material, element: Element::PlainTetra },
    };
    if kind == Kind::Embedded {
        let surface = turned_block();
        skin.size = [surface.size()[0], surface.size()[1]];
        skin.cells = [(f64::from(across) * skin.size[0] / 20e-3).round() as u32; 2];
        skin.embedded = Some(Arc::new(surface));
        skin.cut = Cut::Remove;
    }
    scene
}

fn started(scene: &Scene) -> Simulation {
    Simulation::new(scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"))
}

/// Relative error of the centre after a static step, time of the step, s, and iterations.
fn pressed(scene: &Scene) -> (f64, f64, u32) {
    let mut simulation = started(scene);
    let begun = Instant::now();
    let report = simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
    let seconds = begun.elapsed().as_secs_f64();
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    (report.probes[0] / CENTRE - 1.0, seconds, report.free.iterations)
}

fn to_one_per_cent() {
    println!("| body | cells across | nodes | error of the centre | step, s | of the coarsest hexahedra's time |");
    println!("|---|---|---|---|---|---|");
    let mut unit = 0.0;
    for (kind, name) in KINDS {
        for grid in GRIDS {
            let scene = block(kind, grid);
            let (error, seconds, _) = pressed(&scene);
            if unit == 0.0 {
                unit = seconds;
            }
            let nodes = started(&scene).bodies[0].model.own_nodes();
            let [x, y] = scene.skins[0].cells;
            println!("| {name} | {x} × {y} | {nodes} | {:+.2} % | {seconds:.2} | {:.1} |", 1e2 * error, seconds / unit);
            if error.abs() < ENOUGH {
                break;
            }
        }
    }
}

fn median(mut of: Vec<f64>) -> f64 {
    of.sort_by(f64::total_cmp);
    of[of.len() / 2]
}

/// Time of a dynamic step from rest that ends after so many iterations of plain conjugate gradients, s.
fn iterated(scene: &Scene, iterations: u32) -> f64 {
    let mut scene = scene.clone();
    (scene.time.integrator, scene.time.step, scene.time.duration) = (Integrator::ImplicitEuler, 5e-3, 5e-3);
    (scene.solver.preconditioner, scene.solver.newton) = (Preconditioner::None, false);
    (scene.solver.max_iterations, scene.solver.tolerance) = (iterations, 1e-14);
    let mut simulation = started(&scene);
    let begun = Instant::now();
    let report = simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
    let seconds = begun.elapsed().as_secs_f64();
    assert_eq!(report.free.iterations, iterations, "the step ended before");
    seconds
}

fn products() {
    println!("\n| body | degrees of freedom | ns per iteration and degree of freedom | of hexahedra |");
    println!("|---|---|---|---|");
    let grid = (40, [4, 3, 1]);
    let scenes = KINDS.map(|(kind, name)| (block(kind, grid), name));
    let (few, many) = (20, 100);
    let mut times = [const { vec![] }; KINDS.len()];
    for _ in 0..ROUNDS {
        for (times, (scene, _)) in times.iter_mut().zip(&scenes) {
            let more = iterated(scene, many) - iterated(scene, few);
            times.push(more / f64::from(many - few));
        }
    }
    let mut unit = 0.0;
    for (times, (scene, name)) in times.into_iter().zip(&scenes) {
        let unknowns = started(scene).bodies[0].model.degrees_of_freedom();
        let each = median(times) / unknowns as f64;
        if unit == 0.0 {
            unit = each;
        }
        println!("| {name} | {unknowns} | {:.1} | {:.2} |", each * 1e9, each / unit);
    }
}

/// The tetrahedra of a grid as a mesh.
fn mesh(raster: &Skin) -> TetrahedralMesh {
    let grid = Grid::new(raster);
    let nodes = (0..grid.node_count()).map(|node| grid.rest(node)).collect();
    let tetrahedra: Vec<[u32; 4]> = grid.tetrahedra().into_iter().map(|(corners, _)| corners).collect();
    let layers = vec![0; tetrahedra.len()];
    TetrahedralMesh::new(nodes, tetrahedra, layers).unwrap_or_else(|defect| panic!("{defect}"))
}

/// Removal of cells of the top, one after the other: time of each call and of the step after it above that of a step, µs.
fn removals() {
    println!("\n| body | cells | removal, µs | of the narrowest | the step after it, of a step without |");
    println!("|---|---|---|---|---|");
    for (kind, name) in [KINDS[0], KINDS[2]] {
        let mut unit = 0.0;
        for across in [20, 40, 80] {
            let mut scene = block(kind, (across, [2, 2, 1]));
            let skin = &mut scene.skins[0];
            (skin.size, skin.cut) = ([1e-3 * f64::from(across); 2], Cut::Remove);
            if kind == Kind::Smoothed {
                let mesh = mesh(skin);
                skin.layers.truncate(1);
                (skin.cells, skin.layers[0].thickness, skin.layers[0].cells) = ([0; 2], 0.0, 0);
                skin.mesh = Some(Arc::new(mesh));
            }
            (scene.time.integrator, scene.time.step, scene.time.duration) = (Integrator::ImplicitEuler, 5e-3, 1.0);
            (scene.solver.tolerance, scene.solver.newton) = (1e-2, false);
            scene.solver.preconditioner = Preconditioner::Block;
            let mut simulation = started(&scene);
            let volume = |simulation: &Simulation| simulation.totals().volume;
            let step = |simulation: &mut Simulation| {
                let begun = Instant::now();
                simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
                begun.elapsed().as_secs_f64()
            };
            for _ in 0..5 {
                step(&mut simulation);
            }
            let (mut calls, mut plain, mut after) = (vec![], vec![], vec![]);
            let cells = simulation.bodies[0].model.cell_count();
            for k in 0..3 * ROUNDS {
                plain.push(step(&mut simulation));
                // in the upper layer, far from each other
                let cell = (cells - cells / 10 - 50 * k) as u32;
                let (before, begun) = (volume(&simulation), Instant::now());
                let removed = simulation.bodies[0].carve(&[cell]).unwrap_or_else(|e| panic!("{e}"));
                calls.push(begun.elapsed().as_secs_f64());
                assert!(removed >= 1 && volume(&simulation) > before, "cell {cell} has not gone");
                after.push(step(&mut simulation));
            }
            let call = median(calls);
            if unit == 0.0 {
                unit = call;
            }
            println!(
                "| {name} | {cells} | {:.0} | {:.2} | {:.2} |",
                call * 1e6,
                call / unit,
                median(after) / median(plain)
            );
        }
    }
}

/// Resident memory of this process, bytes; none beside Linux.
fn resident() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS"))?;
    Some(1024.0 * line.split_whitespace().nth(1)?.parse::<f64>().ok()?)
}

const PRECONDITIONERS: [(Preconditioner, &str); 2] =
    [(Preconditioner::Block, "block"), (Preconditioner::Multigrid, "multigrid")];

/// Nodes of a body, and what a simulation of it adds to the memory of this process, bytes, which has freed nothing before.
fn added(row: usize) -> (usize, f64) {
    let (kind, preconditioner) = (KINDS[row / 2].0, PRECONDITIONERS[row % 2].0);
    let mut scene = block(kind, (100, [6, 5, 1]));
    scene.solver.preconditioner = preconditioner;
    (scene.time.integrator, scene.time.step) = (Integrator::ImplicitEuler, 5e-3);
    (scene.solver.tolerance, scene.solver.newton) = (1e-2, false);
    let before = resident().unwrap_or(f64::NAN);
    let mut simulation = started(&scene);
    simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
    (simulation.bodies[0].model.own_nodes(), resident().unwrap_or(f64::NAN) - before)
}

/// The name of the process of a row.
const ROW: &str = "row";

fn memory() {
    println!("\n| body | preconditioner | nodes | bytes per node | of hexahedra |");
    println!("|---|---|---|---|---|");
    let mut unit = 0.0;
    let this = std::env::current_exe().expect("a program");
    for row in 0..2 * KINDS.len() {
        let said =
            std::process::Command::new(&this).args([ROW, &row.to_string()]).output().expect("a process of its own");
        let said = String::from_utf8_lossy(&said.stdout);
        let numbers: Vec<f64> = said.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let [nodes, bytes] = numbers[..] else { panic!("{said}") };
        if unit == 0.0 {
            unit = bytes / nodes;
        }
        let (name, word) = (KINDS[row / 2].1, PRECONDITIONERS[row % 2].1);
        println!("| {name} | {word} | {nodes} | {:.0} | {:.2} |", bytes / nodes, bytes / nodes / unit);
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    if let [row, number] = &words[..]
        && row == ROW
    {
        let (nodes, bytes) = added(number.parse().expect("a number"));
        println!("{nodes} {bytes}");
        return;
    }
    let tables: [fn(); 4] = [to_one_per_cent, products, removals, memory];
    for (number, table) in tables.into_iter().enumerate() {
        if words.is_empty() || words.contains(&(number + 1).to_string()) {
            table();
        }
    }
}
