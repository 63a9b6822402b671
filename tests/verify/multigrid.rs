//! Multigrid: how many iterations it takes, on every grid, under rotations and cuts, on every platform; and what makes it fail.

use super::setup::{Body, apart, displaced, in_long_steps, measured, model, scene};
use super::{Case, Everywhere};
use cutis::backend::Snapshot;
use cutis::bodies::grid::levels::largest;
use cutis::bodies::grid::multigrid::{Finest, Hierarchy, Operator, apply, workspaces};
use cutis::bodies::{Model, Wound};
use cutis::kernels::advance::Request;
use cutis::kernels::blocks::blocks;
use cutis::kernels::cut::Hit;
use cutis::kernels::factor::factor;
use cutis::kernels::product::{Frames, LANES, cell_groups, product};
use cutis::kernels::split_product::split_product;
use cutis::linear::{Outcome, SolverVectors, solve};
use cutis::math::V4;
use cutis::scene::{Load, LoadKind, Preconditioner, Scene};
use cutis::step::{Platform, Simulation};
use std::sync::atomic::AtomicBool;

pub const CASES: &[Case] = &[
    ("multigrid_takes_as_few_iterations_on_every_grid", table),
    ("odd_grids_take_no_more", odd_grids),
    ("iterations_at_50_kpa_do_not_grow_with_the_grid", at_50_kpa),
    ("rotations_and_a_slot_cost_little", rotations_and_slot),
    ("a_ragged_wound_costs_nothing", ragged_wound),
    ("a_wrong_bound_of_the_smoother_is_found_out", wrong_bound),
    ("the_bound_of_the_smoother_is_one", bound),
    ("shipped_tolerance_costs_less_than_a_hundredth", shipped_tolerance),
];

pub const EVERYWHERE: &[Everywhere] = &[("multigrid_iterations_are_those_of_f64", counted)];

/// Cells per layer: 5 and 23 levels.
pub const THIN: [u32; 3] = [2, 2, 1];
const THICK: [u32; 3] = [10, 10, 3];

/// A press on the skin block at a step of 10 ms, Rayleigh stiffness 0.01 s.
pub fn press(across: u32, levels: [u32; 3], poisson: f64) -> Scene {
    let mut scene = in_long_steps("verify/skin_block_045.toml");
    scene.skins[0].cells = [across, across];
    for (layer, cells) in scene.skins[0].layers.iter_mut().zip(levels) {
        (layer.cells, layer.poisson) = (cells, poisson);
    }
    scene.time.step = 0.01;
    scene.skins[0].rayleigh_stiffness = 0.01;
    scene.solver.preconditioner = Preconditioner::Multigrid;
    scene
}

fn at_rest(model: &Model) -> Vec<V4<f64>> {
    vec![[0.0, 0.0, 0.0, 1.0]; model.grid.cell_count()]
}

/// Quaternions of a dent: cells lean towards the middle by up to `degrees`, most on a ring of 4 mm.
fn dent(model: &Model, degrees: f64) -> Vec<V4<f64>> {
    let params = model.grid.params::<f64>();
    let lean = |cell| {
        let corners = params.corners(cell);
        let at = |n: usize| 0.5 * (model.rest[corners[0]][n] + model.rest[corners[6]][n]);
        let (x, y) = (at(0) / 4e-3, at(1) / 4e-3);
        let r = x.hypot(y).max(1e-9);
        let angle = degrees.to_radians() * r * (0.5 * (1.0 - r * r)).exp() * (at(2) / 2.3e-3);
        let (s, c) = (0.5 * angle).sin_cos();
        [s * y / r, -s * x / r, 0.0, c]
    };
    (0..model.grid.cell_count()).map(lean).collect()
}

/// Kills the upper half of the levels in a row of cells 10 mm long.
fn slot(model: &Model, rotation: &mut [V4<f64>]) {
    let params = model.grid.params::<f64>();
    let [_, cells_y, cells_z] = model.grid.cells;
    for (cell, q) in rotation.iter_mut().enumerate() {
        let at = params.cell_at(cell);
        let corners = params.corners(cell);
        let x = 0.5 * (model.rest[corners[0]][0] + model.rest[corners[6]][0]);
        if at[1] == cells_y / 2 && at[2] >= cells_z / 2 && x.abs() < 5e-3 {
            *q = [0.0; 4];
        }
    }
}

/// The press solved in given rotations from zero.
fn solved(model: &Model, scene: &Scene, rotation: &[V4<f64>], tolerance: f64) -> (Vec<V4<f64>>, Outcome) {
    let params = model.params::<f64>();
    let layers = &model.grid.layer_of;
    let mut dofs = model.dofs.clone();
    for (node, dofs) in dofs.iter_mut().enumerate() {
        let at = params.node_at(node);
        if (0..8).filter_map(|a| params.cell_below(at, a)).all(|c| rotation[c] == [0.0; 4]) {
            *dofs = [0.0; 4];
        }
    }
    let frames = Frames::new(&params, rotation, &[]);
    let finest =
        Finest { params: &params, dofs: &dofs, layer_of: layers, rotation, frames: &frames, split: (&[], &[]) };
    let load = model.load_at(&scene.loads, 0.0);
    let r = load.iter().zip(&dofs).map(|(l, f)| [l[0] * f[0], l[1] * f[1], l[2] * f[2], 0.0]).collect();
    by_multigrid(model, finest, true, r, tolerance)
}

/// Solution for a load from zero; `forked` has the smoother know the forks.
fn by_multigrid(
    model: &Model,
    finest: Finest<f64>,
    forked: bool,
    mut r: Vec<V4<f64>>,
    tolerance: f64,
) -> (Vec<V4<f64>>, Outcome) {
    let Finest { params, dofs, layer_of, rotation, frames, split } = finest;
    let modes = model.modes();
    let mut hierarchy = Hierarchy::<f32>::new(model).expect("multigrid");
    hierarchy.cut = forked;
    hierarchy.refresh(finest);
    let levels = hierarchy.operators(finest);
    // of grids that can be cut; a wrong bound makes others indefinite
    if !split.0.is_empty() {
        symmetric(&levels, dofs);
    }
    let mut work = workspaces::<f64, f32>(&levels);
    let request = Request {
        tolerance_squared: tolerance * tolerance,
        reference_squared: r.as_flattened().iter().map(|c| c * c).sum(),
        ..Request::default()
    };
    let [mut x, mut p, mut s, mut z, mut w] = [0; 5].map(|_| vec![[0.0; 4]; dofs.len()]);
    let mut scratch = vec![[[[0.0; LANES]; 3]; 8]; cell_groups(params)];
    let times = |z: &[V4<f64>], w: &mut [V4<f64>]| {
        let whole = product(params, &modes, layer_of, frames, dofs, z, w, &mut scratch);
        w[params.grid_nodes()..].fill([0.0; 4]);
        whole + split_product(params, &modes, layer_of, rotation, dofs, split.0, split.1, z, w)
    };
    let precondition = |r: &[V4<f64>], z: &mut [V4<f64>]| apply(&levels, &mut work, r, z);
    let vectors = SolverVectors { x: &mut x, r: &mut r, p: &mut p, s: &mut s, z: &mut z, w: &mut w };
    let outcome = solve(vectors, &request, 0.0, 200, &AtomicBool::new(false), times, precondition);
    (x, outcome)
}

/// One V-cycle in f32 alone is symmetric, and returns the product of what it was given with what it found.
fn symmetric(levels: &[Operator<f32>], dofs: &[V4<f64>]) {
    let mut random = super::setup::Random::new(11);
    let mut work = workspaces::<f32, f32>(levels);
    let mut applied = || {
        let mut r: Vec<V4<f32>> = random.field(dofs.len(), 1.0).iter().map(|r| r.map(|c| c as f32)).collect();
        r.iter_mut().zip(dofs).for_each(|(r, dofs)| (0..3).for_each(|n| r[n] *= dofs[n] as f32));
        let mut z = vec![[0.0; 4]; r.len()];
        let gamma = apply(levels, &mut work, &r, &mut z);
        (r, z, f64::from(gamma))
    };
    let dot = |a: &[V4<f32>], b: &[V4<f32>]| {
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>()
    };
    let [(r, z, gamma), (other_r, other_z, _)] = [applied(), applied()];
    let size = dot(&r, &z);
    assert!((gamma / size - 1.0).abs() < 1e-4, "r·z is {size}, {gamma} by the V-cycle");
    let [one, other] = [dot(&r, &other_z), dot(&other_r, &z)];
    assert!((one - other).abs() < 1e-4 * size, "{one} one way round and {other} the other, of {size}");
}

/// Iterations to 1e-6 on a cut body under a load at random; `forked` has the smoother know the forks.
fn iterations_on_cut(model: &Model, links: &[u32], forked: bool) -> u32 {
    let params = model.params::<f64>();
    let (layers, rotation) = (&model.grid.layer_of, at_rest(model));
    let mut wound = Wound::new(model);
    let hits: Vec<Hit<f64>> = links.iter().map(|link| Hit { segment: *link, at: 0.5 }).collect();
    wound.apply(model, &hits);
    assert_eq!((wound.totals.links, wound.totals.refused), (links.len(), 0));
    let (dofs, split) = (&wound.dofs[..], (wound.surface.parts.table(), wound.surface.parts.split_cells()));
    let frames = Frames::new(&params, &rotation, split.0);
    let finest = Finest { params: &params, dofs, layer_of: layers, rotation: &rotation, frames: &frames, split };
    let mut r = super::setup::Random::new(3).field(dofs.len(), 1.0);
    r.iter_mut().zip(dofs).for_each(|(r, dofs)| *r = [r[0] * dofs[0], r[1] * dofs[1], r[2] * dofs[2], 0.0]);
    let (_, outcome) = by_multigrid(model, finest, forked, r, 1e-6);
    assert!(outcome.converged, "{outcome:?}");
    outcome.iterations
}

/// Ragged wounds, in which many vertical edges join columns: as many iterations as without a wound, and far more if those edges are left out.
fn ragged_wound() {
    let mut model = model(&press(16, THIN, 0.45));
    model.hexahedra_mut().extra_columns = 100;
    model.dofs.resize(model.node_count(), [0.0; 4]);
    let params = model.params::<f64>();
    let whole = iterations_on_cut(&model, &[], true);
    for part in [0.2, 0.3] {
        let mut random = super::setup::Random::new(8);
        let cells = (3..13).flat_map(|y| (6..10).flat_map(move |x| (2..5).map(move |z| [x, y, z])));
        let all = cells.flat_map(|at| [0, 1, 2].map(|axis| (at, axis))).filter(|(at, axis)| at[2] < 4 || *axis < 2);
        let links: Vec<u32> = all
            .filter(|_| random.next().abs() < part)
            .map(|(at, axis)| (3 * params.cell_id(at) + axis) as u32)
            .collect();
        let [cut, counter] = [true, false].map(|forked| iterations_on_cut(&model, &links, forked));
        let count = links.len();
        measured(&format!("multigrid, {count} links severed: iterations to 1e-6"), cut.into(), whole.into());
        measured("the same without the edges between columns", counter.into(), whole.into());
        assert!(cut <= whole + 3, "{cut} with {count} links severed, {whole} without");
        // counter-test
        assert!(2 * counter > 3 * cut, "{counter} without the edges between columns, {cut} with");
    }
}

/// Iterations to 1e-3 and 1e-6.
fn iterations(scene: &Scene, rotation: impl Fn(&Model) -> Vec<V4<f64>>) -> [u32; 2] {
    let model = model(scene);
    let rotation = rotation(&model);
    [1e-3, 1e-6].map(|tolerance| {
        let (_, outcome) = solved(&model, scene, &rotation, tolerance);
        assert!(outcome.converged, "{outcome:?}");
        outcome.iterations
    })
}

fn shown(what: &str, found: [u32; 2], reference: [u32; 2]) {
    for (tolerance, k) in [("1e-3", 0), ("1e-6", 1)] {
        measured(&format!("multigrid, {what}: iterations to {tolerance}"), f64::from(found[k]), reference[k].into());
    }
}

/// Iterations to 1e-3 and 1e-6 that a prototype with an assembled Galerkin operator took, by Poisson's ratio.
const PROTOTYPE: [(f64, [u32; 2]); 2] = [(0.45, [6, 16]), (0.49, [13, 34])];

fn table() {
    for (across, levels) in [(16, THIN), (16, THICK), (32, THIN), (32, THICK)] {
        for (poisson, most) in PROTOTYPE {
            let found = iterations(&press(across, levels, poisson), at_rest);
            shown(&format!("{across}²×{} ν {poisson}", levels.iter().sum::<u32>()), found, most);
            assert!(found[0] <= most[0] && found[1] <= most[1], "{across}² {levels:?} ν {poisson}: {found:?}");
        }
    }
}

fn odd_grids() {
    let even = iterations(&press(16, THIN, 0.45), at_rest);
    for across in [3, 9, 14, 15, 17, 25, 31] {
        let found = iterations(&press(across, THIN, 0.45), at_rest);
        shown(&format!("{across}²×5 ν 0.45"), found, even);
        assert!(found[0] <= even[0] + 2 && found[1] <= even[1] + 2, "{across}²: {found:?}, 16²: {even:?}");
    }
}

/// Mean and largest number of iterations of ten steps of 5 ms to 1e-3: the neo-Hookean block, undamped, from rest under 50 kPa.
fn over_ten_steps(across: u32, levels: [u32; 3], poisson: f64, preconditioner: Preconditioner) -> [f64; 2] {
    const STEPS: u32 = 10;
    let mut scene = in_long_steps("verify/skin_block_neo_045.toml");
    scene.time.step = 5e-3;
    scene.time.duration = f64::from(STEPS) * scene.time.step;
    (scene.solver.tolerance, scene.solver.preconditioner) = (1e-3, preconditioner);
    scene.loads[0].kind = LoadKind::Pressure { pressure: 50e3, follower: false };
    scene.skins[0].cells = [across; 2];
    for (layer, cells) in scene.skins[0].layers.iter_mut().zip(levels) {
        (layer.cells, layer.poisson) = (cells, poisson);
    }
    let mut run = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let counts: Vec<f64> = (0..STEPS)
        .map(|_| {
            let report = run.step(false).unwrap_or_else(|e| panic!("{e}"));
            assert!(report.free.converged, "{:?}", report.free);
            f64::from(report.free.iterations)
        })
        .collect();
    [counts.iter().sum::<f64>() / f64::from(STEPS), counts.into_iter().fold(0.0, f64::max)]
}

/// Spread of the means and of the largest numbers over grids: measured 0.1 and 1.
const GROWS: [f64; 2] = [0.5, 2.0];

fn at_50_kpa() {
    let grids = [(20, THIN), (40, [4, 3, 1]), (64, [4, 3, 1])];
    for poisson in [0.45, 0.49] {
        let spread = |grids: &[(u32, [u32; 3])], preconditioner| {
            let found = grids.iter().map(|(across, levels)| over_ten_steps(*across, *levels, poisson, preconditioner));
            let found: Vec<[f64; 2]> = found.collect();
            for ((across, _), [mean, most]) in grids.iter().zip(&found) {
                measured(
                    &format!("{preconditioner:?}, {across}² at 50 kPa, ν {poisson}: mean of iterations"),
                    *mean,
                    0.0,
                );
                measured("the most", *most, 0.0);
            }
            [0, 1].map(|n| {
                let of = |pick: fn(f64, f64) -> f64, from| found.iter().map(|counts| counts[n]).fold(from, pick);
                of(f64::max, 0.0) - of(f64::min, f64::INFINITY)
            })
        };
        let found = spread(&grids, Preconditioner::Multigrid);
        assert!(found[0] <= GROWS[0] && found[1] <= GROWS[1], "ν {poisson}: {found:?}");
        // counter-test
        let found = spread(&grids[..2], Preconditioner::Column);
        assert!(found[0] > 10.0 * GROWS[0] && found[1] > 10.0 * GROWS[1], "columns alone, ν {poisson}: {found:?}");
    }
}

fn rotations_and_slot() {
    for (poisson, _) in PROTOTYPE {
        let scene = press(32, THIN, poisson);
        let rest = iterations(&scene, at_rest);
        let dented = iterations(&scene, |m| dent(m, 70.0));
        let slotted = iterations(&scene, |m| {
            let mut rotation = at_rest(m);
            slot(m, &mut rotation);
            rotation
        });
        shown(&format!("32²×5 ν {poisson}, 70°"), dented, rest);
        shown(&format!("32²×5 ν {poisson}, slot"), slotted, rest);
        let grows = |found: [u32; 2], factor: f64| (0..2).all(|k| f64::from(found[k]) <= factor * f64::from(rest[k]));
        assert!(grows(dented, 1.3), "ν {poisson}: {dented:?} after {rest:?}");
        assert!(grows(slotted, 2.0), "ν {poisson}: {slotted:?} after {rest:?}");
    }
}

/// Counter-test: with half the bound the polynomial grows above it, and the iterations show it.
fn wrong_bound() {
    let scene = press(16, THIN, 0.45);
    let mut model = model(&scene);
    let right = solved(&model, &scene, &at_rest(&model), 1e-6).1;
    let multigrid = model.hexahedra_mut().multigrid.as_mut().expect("multigrid");
    multigrid.largest *= 0.5;
    let wrong = solved(&model, &scene, &at_rest(&model), 1e-6).1;
    assert!(!wrong.converged || wrong.iterations > 2 * right.iterations, "{wrong:?} against {right:?}");
}

/// `λ(M⁻¹A)` by power iterations stays under the bound, and not far: a bound of twice the value would waste half the polynomial.
fn bound() {
    for poisson in [0.45, 0.49] {
        let scene = press(8, THIN, poisson);
        let model = model(&scene);
        let params = model.params::<f64>();
        let rotation = dent(&model, 70.0);
        let (layers, modes) = (&model.grid.layer_of, model.modes());
        let count = model.rest.len();
        let mut block = vec![[0.0; 4]; 4 * count];
        blocks(&params, &model.stiffness_blocks(), layers, &rotation, &model.dofs, &[], &mut block);
        factor(&params, &mut block);
        let mut scratch = vec![[[[0.0; LANES]; 3]; 8]; cell_groups(&params)];
        let frames = Frames::new(&params, &rotation, &[]);
        let mut z = super::setup::Random::new(3).field(count, 1.0);
        let mut w = vec![[0.0; 4]; count];
        let mut found = 0.0;
        for _ in 0..300 {
            let size = z.as_flattened().iter().map(|c| c * c).sum::<f64>().sqrt();
            z.iter_mut().for_each(|z| *z = z.map(|c| c / size));
            product(&params, &modes, layers, &frames, &model.dofs, &z, &mut w, &mut scratch);
            // z·w over z·Mz needs M; the growth of M⁻¹A z does not
            cutis::kernels::precondition::precondition(&params, &block, &w, &mut z);
            found = z.as_flattened().iter().map(|c| c * c).sum::<f64>().sqrt();
        }
        let bound = largest(&model.hexahedra().stiffness);
        measured(&format!("largest eigenvalue of the columns' inverse times A, ν {poisson}"), found, bound);
        assert!(found <= bound && found > 0.5 * bound, "ν {poisson}: {found} under {bound}");
    }
}

/// Iterations on a platform, to a tolerance that f32 can reach, are those of the f64 path.
fn counted(platform: &Platform) {
    for (across, levels) in [(16, THIN), (13, THIN), (16, THICK)] {
        let scene = press(across, levels, 0.45);
        let count = |platform: &Platform| {
            let model = model(&scene);
            let mut body = Body::new(platform, model.clone(), &displaced(&model, |_| [0.0; 3]), 1e-3);
            body.load(&model.load_at(&scene.loads, 0.0));
            let outcome = body.try_step();
            assert!(outcome.converged, "{outcome:?}");
            outcome.iterations
        };
        let (here, exact) = (count(platform), count(&Platform::Cpu64));
        measured(
            &format!("multigrid, {across}²×{} on {platform:?}", levels.iter().sum::<u32>()),
            here.into(),
            exact.into(),
        );
        assert!(here.abs_diff(exact) <= 1, "{platform:?}: {here} iterations, {exact} in f64");
    }
}

/// Relative L2 error of one step's displacement, from rest under 10 kPa on the middle, at the settings of the shipped scenes that cut.
fn shipped_tolerance() {
    for name in ["incision.toml", "skin_springs.toml"] {
        let mut scene = scene(name);
        scene.tools.clear();
        scene.contact = None;
        scene.loads.push(Load::on_top(&scene.skins[0], 1e4, [-2e-3; 2], [2e-3; 2]));
        let tolerance = scene.solver.tolerance;
        let step = |tolerance: f64| -> Snapshot {
            let model = model(&scene);
            let mut body = Body::new(&Platform::Cpu64, model.clone(), &displaced(&model, |_| [0.0; 3]), tolerance);
            body.load(&model.load_at(&scene.loads, 0.0));
            body.step();
            body.state()
        };
        let exact = step(1e-11);
        let error = |found: &Snapshot| apart(&found.u, &exact.u);
        for (factor, what) in [(0.1, "a tenth of the shipped"), (1.0, "shipped"), (3.0, "3 times"), (10.0, "10 times")]
        {
            measured(&format!("{name}: error of a step, {what} tolerance"), error(&step(factor * tolerance)), 0.01);
        }
        assert!(error(&step(tolerance)) < 0.01, "{name}");
        // counter-test: a step that is 2 % too long
        let mut long = step(tolerance);
        long.u.iter_mut().for_each(|u| *u = u.map(|c| 1.02 * c));
        assert!(error(&long) > 0.01);
    }
}
