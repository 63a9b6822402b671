//! The direct solver: its matrix against the product, its solutions against multigrid, and what it says when there is none.

use super::Case;
use super::dense::{hold_some, multiply, random_rotations, small, without_dead};
use super::setup::{Random, apart, displaced, measured, model};
use cutis::backend::{FREE, Needs, SolveRequest, Target, on_cpu};
use cutis::bodies::grid::direct::{Direct, Pattern};
use cutis::bodies::{Model, Refused, Removal};
use cutis::error::Error;
use cutis::kernels::Params;
use cutis::kernels::advance::Request;
use cutis::linear::{Outcome, SolverVectors, solve};
use cutis::math::{Real, V4, norm, widen};
use cutis::scene::Element::{Bbar, Enhanced, Plain};
use cutis::scene::Mass::{Consistent, Lumped, Uniform};
use cutis::scene::{Element, Law, Mass, Preconditioner, Scene};
use std::sync::atomic::AtomicBool;

pub const CASES: &[Case] = &[
    ("assembled_matrix_is_the_product", assembled_is_product),
    ("direct_solution_is_that_of_multigrid", as_multigrid),
    ("one_iteration_is_exact", one_iteration),
    ("a_system_without_solution_is_an_error", no_solution),
];

const KINDS: [(Element, Mass); 5] =
    [(Plain, Lumped), (Bbar, Lumped), (Bbar, Uniform), (Bbar, Consistent), (Enhanced, Consistent)];

/// A small body; the step is so short that inertia is as large as stiffness.
fn of(element: Element, mass: Mass, preconditioner: Preconditioner) -> Scene {
    let mut scene = small(element);
    scene.skins[0].mass = mass;
    scene.time.step = 1e-5;
    scene.solver.preconditioner = preconditioner;
    scene
}

/// A body with held axes, turned cells, and a cut that takes nodes at a corner with it.
fn state(element: Element, mass: Mass) -> (Model, Vec<V4<f64>>) {
    let mut model = model(&of(element, mass, Preconditioner::Direct));
    hold_some(&mut model);
    let mut rotation = random_rotations(&model, &mut Random::new(21));
    rotation[0] = [0.0; 4];
    let mut model = without_dead(&model, &rotation);
    let params = model.params::<f64>();
    for node in 0..model.rest.len() {
        let at = params.node_at(node);
        if (0..8).filter_map(|a| params.cell_below(at, a)).all(|c| rotation[c] == [0.0; 4]) {
            model.dofs[node] = [0.0; 4];
        }
    }
    (model, rotation)
}

/// A field that is zero on held axes.
fn field(model: &Model, seed: u64) -> Vec<V4<f64>> {
    let mut z = Random::new(seed).field(model.rest.len(), 1e-3);
    for (z, dofs) in z.iter_mut().zip(&model.dofs) {
        (0..3).for_each(|n| z[n] *= dofs[n]);
    }
    z
}

/// `A z` by the assembled lower half.
fn assembled(params: &Params<f64>, model: &Model, rotation: &[V4<f64>], z: &[V4<f64>]) -> Vec<V4<f64>> {
    let pattern = Pattern::new(params);
    let mut value = vec![f64::NAN; pattern.row.len()];
    let stiffness = model.system_blocks();
    pattern.assemble(params, &stiffness, &model.grid.layer_of, rotation, &model.dofs, &mut value);
    let mut w = vec![[0.0; 4]; z.len()];
    for column in 0..3 * z.len() {
        let (j, n) = (pattern.node[column / 3] as usize, column % 3);
        for k in pattern.first[column]..pattern.first[column + 1] {
            let (i, m) = (pattern.node[pattern.row[k] / 3] as usize, pattern.row[k] % 3);
            w[i][m] += value[k] * z[j][n];
            if pattern.row[k] != column {
                w[j][n] += value[k] * z[i][m];
            }
        }
    }
    w
}

fn assembled_is_product() {
    // sums of 8 cells × 24 products, twice
    const BOUND: f64 = 400.0 * f64::EPSILON;
    for (element, mass) in KINDS {
        let (model, rotation) = state(element, mass);
        let params = model.params();
        let z = field(&model, 4);
        let mut w = vec![[0.0; 4]; z.len()];
        multiply(&params, &model, &rotation, &z, &mut w);
        let error = apart(&assembled(&params, &model, &rotation, &z), &w);
        measured(&format!("assembled {element:?} {mass:?} against the product"), error, 0.0);
        assert!(error < BOUND, "{element:?} {mass:?}: {error:e}");
        // counter-tests: without mass, without one cell, with one entry off
        let massless = Params { inertia: 0.0, ..params };
        let mut whole = rotation.clone();
        whole[1] = [0.0, 0.0, 0.0, 1.0];
        let mut other = model.clone();
        other.hexahedra_mut().stiffness[2][20][5] *= 1.0 + 1e-6;
        let wrong = [
            assembled(&massless, &model, &rotation, &z),
            assembled(&params, &model, &whole, &z),
            assembled(&params, &other, &rotation, &z),
        ];
        for (k, wrong) in wrong.iter().enumerate() {
            assert!(apart(wrong, &w) > 10.0 * BOUND, "{element:?} {mass:?} {k}: {:e}", apart(wrong, &w));
        }
    }
}

/// One step's increment of a turned, strained, cut, partly held body, by a whole backend.
fn increment<R: Real>(scene: &Scene, tolerance: f64) -> (Vec<V4<f64>>, Outcome) {
    let mut model = model(scene);
    hold_some(&mut model);
    // 40° about z and some strain
    let (s, c) = 40f64.to_radians().sin_cos();
    let start = displaced(&model, |[x, y, z]| {
        [(c - 1.0) * x - s * y + 0.1 * z, s * x + (c - 1.0) * y, 0.05 * x * (1.0 + 40.0 * y)]
    });
    let mut backend = on_cpu(size_of::<R>() == size_of::<f32>(), &model, Needs::default(), 5000, 0.0, &start);
    backend
        .set_load(&Random::new(8).field(model.rest.len(), 1e-3).iter().map(|f| [f[0], f[1], f[2]]).collect::<Vec<_>>());
    // the cells' rotations are there before a cut
    backend.begin().expect("the CPU works");
    let mut rotation = vec![[0.0, 0.0, 0.0, 1.0]; model.grid.cell_count()];
    let gone = [0, 5, model.grid.cell_count() / 2];
    gone.iter().for_each(|cell| rotation[*cell] = [0.0; 4]);
    let mut left = without_dead(&model, &rotation);
    left.dofs[0] = [0.0; 4];
    let dofs: Vec<(u32, V4<f64>)> = left.dofs.iter().enumerate().map(|(k, f)| (k as u32, *f)).collect();
    let removal = Removal { cells: gone.map(|c| c as u32).to_vec(), dofs, ..Removal::default() };
    backend.remove(&removal).expect("the CPU works");
    backend.begin().expect("the CPU works");
    let wanted = [SolveRequest { rhs: FREE, target: Target::OfLoad(tolerance) }];
    let outcome = backend.solve(&wanted, &[]).expect("the matrix is regular").0[0];
    (backend.solution(FREE).expect("the CPU works"), outcome)
}

fn as_multigrid() {
    const BOUND: f64 = 1e-9;
    for (element, mass) in KINDS {
        for corotational in [true, false] {
            let with = |preconditioner| {
                let mut scene = of(element, mass, preconditioner);
                scene.skins[0].law = Law::Fem { element, corotational };
                scene.time.step = 1e-3;
                scene
            };
            let (by_cycles, slow) = increment::<f64>(&with(Preconditioner::Multigrid), 1e-12);
            let (exact, quick) = increment::<f64>(&with(Preconditioner::Direct), 1e-12);
            let name = format!("{element:?} {mass:?} corotational {corotational}");
            assert!(slow.converged && quick.converged, "{name}: {slow:?}, {quick:?}");
            assert!(quick.iterations <= 2 && slow.iterations > 5, "{name}: {quick:?}, {slow:?}");
            measured(&format!("direct against multigrid, {name}"), apart(&exact, &by_cycles), BOUND);
            assert!(apart(&exact, &by_cycles) < BOUND, "{name}: {:e}", apart(&exact, &by_cycles));
            // counter-test: a step that is a millionth longer
            let mut longer = with(Preconditioner::Direct);
            longer.time.step *= 1.0 + 1e-6;
            assert!(apart(&increment::<f64>(&longer, 1e-12).0, &by_cycles) > BOUND, "{name}");
        }
    }
}

/// Conjugate gradients by a factor, at most `cap` iterations; the true residual that is left, relative to the load.
fn residual_after(cap: u32, model: &Model, rotation: &[V4<f64>], factored: &Direct) -> f64 {
    let params = model.params();
    let b = field(model, 9);
    let zeros = || vec![[0.0; 4]; b.len()];
    let (mut x, mut r, mut p, mut s, mut z, mut w) = (zeros(), b.clone(), zeros(), zeros(), zeros(), zeros());
    let request = Request { reference_squared: norm(&b).powi(2), ..Request::default() };
    solve(
        SolverVectors { x: &mut x, r: &mut r, p: &mut p, s: &mut s, z: &mut z, w: &mut w },
        &request,
        0.0,
        cap,
        &AtomicBool::new(false),
        |z: &[V4<f64>], w: &mut [V4<f64>]| multiply(&params, model, rotation, z, w),
        |r: &[V4<f64>], z: &mut [V4<f64>]| factored.solve(r, z),
    );
    multiply(&params, model, rotation, &x, &mut w);
    apart(&w, &b)
}

fn one_iteration() {
    const BOUND: f64 = 1e-10;
    for (element, mass) in KINDS {
        let (model, rotation) = state(element, mass);
        let mut direct = Direct::new(&model).expect("the scene asks for it");
        direct.factor(&rotation, &model.dofs).expect("inertia makes it positive");
        let left = residual_after(1, &model, &rotation, &direct);
        measured(&format!("residual after one iteration, {element:?} {mass:?}"), left, BOUND);
        assert!(left < BOUND, "{element:?} {mass:?}: {left:e}");
        // counter-test: the factor of another state
        let mut before = rotation.clone();
        before[7] = before[8];
        direct.factor(&before, &model.dofs).expect("inertia makes it positive");
        let stale = residual_after(1, &model, &rotation, &direct);
        assert!(stale > 1e4 * BOUND, "{element:?} {mass:?}: {stale:e}");
    }
    for step in [1e-5, 1e-2] {
        let mut scene = of(Bbar, Lumped, Preconditioner::Direct);
        scene.time.step = step;
        let (rounded, outcome) = increment::<f32>(&scene, 1e-5);
        let (exact, _) = increment::<f64>(&scene, 1e-10);
        assert!(outcome.converged && outcome.iterations <= 2, "step {step} s in f32: {outcome:?}");
        let error = apart(&widen(&rounded), &exact);
        measured(&format!("increment in f32, step {step} s"), error, 1e-3);
        assert!(error < 1e-3, "step {step} s: {error:e}");
    }
}

fn no_solution() {
    // a body without mass that nothing holds: six motions cost nothing
    let mut scene = of(Bbar, Lumped, Preconditioner::Direct);
    scene.time.step = 1e-2;
    let mut free_body = model(&scene);
    free_body.dofs.iter_mut().for_each(|f| f[3] = 0.0);
    for seed in 0..20 {
        let mut random = Random::new(seed);
        let rotation: Vec<_> = (0..free_body.grid.cell_count()).map(|_| random.quaternion()).collect();
        let turned = vec![rotation[0]; rotation.len()];
        let found = Direct::new(&free_body).expect("direct").factor(&turned, &free_body.dofs);
        assert!(matches!(found, Err(Error::Body(Refused::NotPositive { .. }))), "seed {seed}: {found:?}");
    }
    // counter-test: held at the bottom, nearly incompressible, in layers of very different stiffness, inertia next to nothing
    let mut hard = super::setup::in_long_steps("verify/skin_block_0499.toml");
    hard.solver.preconditioner = Preconditioner::Direct;
    let hard = model(&hard);
    let whole = vec![[0.0, 0.0, 0.0, 1.0]; hard.grid.cell_count()];
    Direct::new(&hard).expect("direct").factor(&whole, &hard.dofs).expect("the bottom is held");
    // a node that a cut has left alone, but that is not taken out
    let mut alone = model(&scene);
    alone.dofs[0][3] = 0.0;
    let mut rotation = vec![[0.0, 0.0, 0.0, 1.0]; alone.grid.cell_count()];
    let mut direct = Direct::new(&alone).expect("direct");
    direct.factor(&rotation, &alone.dofs).expect("whole");
    rotation[0] = [0.0; 4];
    let error = direct.factor(&rotation, &alone.dofs).expect_err("no stiffness and no mass");
    assert!(matches!(error, Error::Body(Refused::NotPositive { node: [0, 0, 0], .. })), "{error}");
    assert!(error.to_string().contains("constrain the body") && error.exit_code() == 2, "{error}");
    // positions that are no numbers
    rotation[0] = [f64::NAN; 4];
    let error = direct.factor(&rotation, &alone.dofs).expect_err("no number");
    assert!(matches!(error, Error::Body(Refused::NotPositive { .. })), "{error}");
    // mended
    rotation[0] = [0.0, 0.0, 0.0, 1.0];
    direct.factor(&rotation, &alone.dofs).expect("whole again");
}
