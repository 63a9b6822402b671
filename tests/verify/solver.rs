//! Conjugate gradients and preconditioners against a dense solve; and what they say when there is no solution.

use super::Case;
use super::dense::{Dense, hold_some, multiply, small};
use super::setup::{Body, Random, block, displaced, in_long_steps, measured, model};
use cutis::bodies::Model;
use cutis::kernels::advance::Request;
use cutis::kernels::blocks::blocks;
use cutis::kernels::factor::factor;
use cutis::kernels::precondition::precondition;
use cutis::linear::{Outcome, SolverVectors, solve};
use cutis::math::V4;
use cutis::scene::Element::Bbar;
use cutis::scene::Mass::{self, Consistent, Lumped};
use cutis::scene::Preconditioner;
use cutis::step::{Platform, Simulation};
use std::sync::atomic::AtomicBool;

pub const CASES: &[Case] = &[
    ("every_preconditioner_finds_the_dense_solution", dense_solution),
    ("column_factor_is_exact_for_one_free_column", one_column),
    ("indefinite_matrix_is_not_converged", indefinite),
    ("non_finite_numbers_are_not_converged", non_finite),
    ("too_few_iterations_are_not_converged", too_few),
    ("unconverged_step_is_a_warning", warned),
];

const TOLERANCE: f64 = 1e-12;

/// `A x = b` by CG at the model's preconditioner; `product_of` is what CG is told `A` is.
fn cg(model: &Model, b: &[V4<f64>], cap: u32, product_of: f64) -> (Vec<V4<f64>>, Outcome) {
    let params = model.params();
    let rotation = vec![[0.0, 0.0, 0.0, 1.0]; model.grid.cell_count()];
    let (stiffness, layers) = (model.system_blocks(), &model.grid.layer_of);
    let count = model.rest.len();
    let zeros = || vec![[0.0; 4]; count];
    let mut block = vec![[0.0; 4]; 4 * count];
    blocks(&params, &stiffness, layers, &rotation, &model.dofs, &[], &mut block);
    factor(&params, &mut block);
    let (mut x, mut r, mut p, mut s, mut z, mut w) = (zeros(), b.to_vec(), zeros(), zeros(), zeros(), zeros());
    let request = Request {
        tolerance_squared: TOLERANCE * TOLERANCE,
        reference_squared: b.as_flattened().iter().map(|c| c * c).sum(),
        ..Request::default()
    };
    let outcome = solve(
        SolverVectors { x: &mut x, r: &mut r, p: &mut p, s: &mut s, z: &mut z, w: &mut w },
        &request,
        0.0,
        cap,
        &AtomicBool::new(false),
        |z: &[V4<f64>], w: &mut [V4<f64>]| {
            let dot = multiply(&params, model, &rotation, z, w);
            w.as_flattened_mut().iter_mut().for_each(|c| *c *= product_of);
            dot * product_of
        },
        |r: &[V4<f64>], z: &mut [V4<f64>]| precondition(&params, &block, r, z),
    );
    (x, outcome)
}

fn load(model: &Model) -> Vec<V4<f64>> {
    let mut b = Random::new(9).field(model.rest.len(), 1e-3);
    for (b, dofs) in b.iter_mut().zip(&model.dofs) {
        (0..3).for_each(|n| b[n] *= dofs[n]);
    }
    b
}

const ALL: [Preconditioner; 4] =
    [Preconditioner::None, Preconditioner::Jacobi, Preconditioner::Block, Preconditioner::Column];

/// With consistent masses, a step so short that they weigh as much as stiffness.
fn with(preconditioner: Preconditioner, mass: Mass) -> Model {
    let mut scene = small(Bbar);
    scene.skins[0].mass = mass;
    if mass == Consistent {
        scene.time.step = 1e-5;
    }
    scene.solver.preconditioner = preconditioner;
    let mut model = model(&scene);
    hold_some(&mut model);
    model
}

fn dense_solution() {
    // the condition of this body is under 1e6; a solve to 1e-12 leaves 1e-6 at worst, and less by far in the norm used here
    const BOUND: f64 = 1e-8;
    let mut iterations = vec![];
    for (preconditioner, mass) in ALL.map(|p| (p, Lumped)).into_iter().chain([(Preconditioner::Column, Consistent)]) {
        let model = with(preconditioner, mass);
        let b = load(&model);
        let flat: Vec<f64> = b.iter().flat_map(|b| [b[0], b[1], b[2]]).collect();
        let identity = vec![[0.0, 0.0, 0.0, 1.0]; model.grid.cell_count()];
        let exact = Dense::assemble(&model, &identity, 1.0).solve(flat);
        let (x, outcome) = cg(&model, &b, 5000, 1.0);
        assert!(outcome.converged, "{preconditioner:?}: {outcome:?}");
        let size = exact.iter().fold(0.0f64, |m, e| m.max(e.abs()));
        let error = |exact: &[f64]| {
            let at = |(k, e): (usize, &f64)| (x[k / 3][k % 3] - e).abs();
            exact.iter().enumerate().map(at).fold(0.0, f64::max) / size
        };
        measured(&format!("CG {preconditioner:?} against dense"), error(&exact), 0.0);
        assert!(error(&exact) < BOUND, "{preconditioner:?} {mass:?}: {:e}", error(&exact));
        // counter-test: another body's solution is told apart
        let mut other = model.clone();
        other.hexahedra_mut().stiffness[1][0][0] *= 1.001;
        let b: Vec<f64> = b.iter().flat_map(|b| [b[0], b[1], b[2]]).collect();
        let exact = Dense::assemble(&other, &identity, 1.0).solve(b);
        assert!(error(&exact) > 10.0 * BOUND, "{preconditioner:?}: {:e}", error(&exact));
        iterations.push(outcome.iterations);
    }
    assert!(iterations[3] < iterations[1], "columns beat Jacobi: {iterations:?}");
}

fn one_column() {
    let only = |preconditioner, mass| {
        let mut model = with(preconditioner, mass);
        let p = model.grid.params::<f64>();
        for node in 0..model.rest.len() {
            let [i, j, _] = p.node_at(node);
            let free = if (i, j) == (1, 1) { 1.0 } else { 0.0 };
            model.dofs[node][..3].fill(free);
        }
        let (_, outcome) = cg(&model, &load(&model), 100, 1.0);
        assert!(outcome.converged, "{outcome:?}");
        outcome.iterations
    };
    // the first iteration is exact; a second may take rounding away
    for mass in [Lumped, Consistent] {
        let columns = only(Preconditioner::Column, mass);
        assert!(columns <= 2, "{mass:?}: {columns} iterations");
    }
    let blocks = only(Preconditioner::Block, Lumped);
    assert!(blocks > 4, "node blocks cannot do that: {blocks} iterations");
}

fn indefinite() {
    let model = with(Preconditioner::Block, Lumped);
    let (_, outcome) = cg(&model, &load(&model), 100, -1.0);
    assert!(!outcome.converged && outcome.iterations < 100, "{outcome:?}");
    let (_, fine) = cg(&model, &load(&model), 5000, 1.0);
    assert!(fine.converged, "{fine:?}");
}

fn non_finite() {
    let model = with(Preconditioner::Column, Lumped);
    let mut b = load(&model);
    b[model.rest.len() / 2][1] = f64::NAN;
    let (_, outcome) = cg(&model, &b, 100, 1.0);
    assert!(!outcome.converged && outcome.iterations < 100, "{outcome:?}");
    for platform in [Platform::Cpu64, Platform::Cpu32] {
        let model = super::setup::model(&block(Bbar, true));
        let start = displaced(&model, |x| [1e-3 * x[2], f64::INFINITY, 0.0]);
        let outcome = Body::new(&platform, model, &start, 1e-3).try_step();
        assert!(!outcome.converged, "{platform:?}: {outcome:?}");
    }
}

fn too_few() {
    let model = with(Preconditioner::Jacobi, Lumped);
    let (_, outcome) = cg(&model, &load(&model), 3, 1.0);
    assert!(!outcome.converged, "{outcome:?}");
    assert!(outcome.residual > outcome.target && outcome.target > 0.0, "{outcome:?}");
    let (x, nothing) = cg(&model, &vec![[0.0; 4]; model.rest.len()], 3, 1.0);
    assert!(nothing.converged && nothing.iterations == 0, "{nothing:?}");
    assert!(x.iter().flatten().all(|c| *c == 0.0));
}

fn warned() {
    let mut scene = in_long_steps("verify/skin_block_045.toml");
    scene.solver.tolerance = 1e-8;
    for (cap, count) in [(5, 1), (5000, 0)] {
        scene.solver.max_iterations = cap;
        let mut run = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
        let report = run.step(false).unwrap_or_else(|e| panic!("{e}"));
        let found = report.warnings.get("solver_not_converged").copied();
        assert_eq!(found.unwrap_or(0), count, "cap {cap}: {:?}", report.free);
    }
}
