//! Multigrid on bodies whose nodes a cut has split: how many iterations an open slit and an undermined patch take beside the whole body.
//!
//! Pressed skin of 32 × 32 × 5 cells, `CUTIS_MEASURED=1`; in f32 on the CPU and on a GPU one more or less:
//!
//! | ν | residual | whole | slit, 10 mm | undermined, 10 mm × 10 mm |
//! |---|---|---|---|---|
//! | 0.45 | 1e-3 | 4 | 7 | 19 |
//! | 0.45 | 1e-6 | 10 | 12 | 29 |
//! | 0.49 | 1e-3 | 10 | 14 | 27 |
//! | 0.49 | 1e-6 | 22 | 26 | 41 |
//!
//! A slit keeps whole columns. Undermined, the thin stiff level on top keeps them, and the bed has its uppermost nodes in other columns
//! than those below: what couples them is left out by the smoother. (With the top level's lower nodes in other columns, 49, 87, 93 and 172.)

use super::multigrid::{THIN, press};
use super::setup::{Body, displaced, measured, model};
use super::{Case, Everywhere};
use cutis::bodies::Model;
use cutis::bodies::Wound;
use cutis::kernels::cut::Hit;
use cutis::step::Platform;

pub const CASES: &[Case] = &[
    ("an_open_slit_costs_few_iterations", slit_counts),
    ("an_undermined_patch_costs_few_iterations", undermined_counts),
];

pub const EVERYWHERE: &[Everywhere] = &[("iterations_on_a_split_body_are_those_of_f64", counted)];

/// Half of the slit and of the undermined square, m.
const HALF: f64 = 5e-3;
/// Cells across.
const ACROSS: usize = 32;

/// A body with room for both cuts.
fn body(poisson: f64) -> Model {
    let mut model = model(&press(ACROSS as u32, THIN, poisson));
    model.hexahedra_mut().extra_columns = 2 * (ACROSS + 1) * (ACROSS + 1);
    model.dofs.resize(model.node_count(), [0.0; 4]);
    model
}

/// Links along an axis of the cells that are chosen by grid coordinates and middle.
fn links(model: &Model, axis: usize, chosen: impl Fn([usize; 3], [f64; 2]) -> bool) -> Vec<u32> {
    let params = model.params::<f64>();
    let cells = (0..model.grid.cell_count()).filter(|cell| {
        let corners = params.corners(*cell);
        let middle = |n: usize| 0.5 * (model.rest[corners[0]][n] + model.rest[corners[6]][n]);
        chosen(params.cell_at(*cell), [middle(0), middle(1)])
    });
    cells.map(|cell| (3 * cell + axis) as u32).collect()
}

/// Through the top three of five levels, along x.
fn slit(model: &Model) -> Vec<u32> {
    links(model, 1, |at, [x, _]| at[1] + 1 == ACROSS / 2 && at[2] >= 2 && x.abs() < HALF)
}

/// Under the top level.
fn undermined(model: &Model) -> Vec<u32> {
    links(model, 2, |at, [x, y]| at[2] == 3 && x.abs() < HALF && y.abs() < HALF)
}

/// Iterations of one step from rest while the rows of nodes beside the middle are pulled apart, 1 N each way.
fn iterations(platform: &Platform, model: &Model, cut: &[u32], tolerance: f64) -> u32 {
    let params = model.params::<f64>();
    let mut start = displaced(model, |_| [0.0; 3]);
    start.u.resize(model.node_count(), [0.0; 4]);
    start.v.resize(model.node_count(), [0.0; 4]);
    let mut wound = Wound::new(model);
    let hits: Vec<Hit<f64>> = cut.iter().map(|link| Hit { segment: *link, at: 0.5 }).collect();
    let removal = wound.apply(model, &hits);
    assert_eq!((wound.totals.links, wound.totals.refused), (cut.len(), 0));
    let mut body = Body::new(platform, model.clone(), &start, tolerance);
    body.remove(&removal);
    let mut load = vec![[0.0; 3]; model.node_count()];
    let [x, y, top] = model.grid.nodes.map(|n| n - 1);
    let pulled: Vec<usize> = (0..=x).filter(|i| model.rest[params.node_id([*i, y / 2, top])][0].abs() < HALF).collect();
    for i in &pulled {
        load[params.node_id([*i, y / 2 - 1, top])][1] = -1.0 / pulled.len() as f64;
        load[params.node_id([*i, y / 2 + 1, top])][1] = 1.0 / pulled.len() as f64;
    }
    body.load(&load);
    let outcome = body.try_step();
    assert!(outcome.converged, "{outcome:?}");
    outcome.iterations
}

/// Iterations of the cut body are at most so many times those of the whole one, to 1e-3 and 1e-6.
fn grows(what: &str, cut: fn(&Model) -> Vec<u32>, most: [f64; 2]) {
    for poisson in [0.45, 0.49] {
        let model = body(poisson);
        for (tolerance, most) in [1e-3, 1e-6].into_iter().zip(most) {
            let whole = iterations(&Platform::Cpu64, &model, &[], tolerance);
            let found = iterations(&Platform::Cpu64, &model, &cut(&model), tolerance);
            measured(&format!("{what}, ν {poisson}: iterations to {tolerance:e}"), found.into(), whole.into());
            assert!(f64::from(found) <= most * f64::from(whole), "ν {poisson}, {tolerance:e}: {found} after {whole}");
        }
    }
}

fn slit_counts() {
    grows("slit", slit, [3.0, 2.0]);
}

fn undermined_counts() {
    grows("undermined", undermined, [5.0, 3.0]);
}

fn counted(platform: &Platform) {
    let model = body(0.45);
    for cut in [slit(&model), undermined(&model)] {
        let here = iterations(platform, &model, &cut, 1e-3);
        let exact = iterations(&Platform::Cpu64, &model, &cut, 1e-3);
        assert!(here.abs_diff(exact) <= 1, "{platform:?}: {here} iterations, {exact} in f64");
    }
}
