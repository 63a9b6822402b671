//! Multigrid: how many iterations it takes, on every grid, under rotations and cuts.

use super::Case;
use super::setup::{measured, model, scene};
use cutis::kernels::advance::Request;
use cutis::kernels::blocks::blocks;
use cutis::kernels::factor::factor;
use cutis::kernels::product::{LANES, cell_groups, product};
use cutis::linear::multigrid::{Hierarchy, Operator, Work, cycle};
use cutis::linear::{Outcome, Slot, solve};
use cutis::math::V4;
use cutis::model::Model;
use cutis::scene::{Preconditioner, Scene};

pub const CASES: &[Case] = &[("table", table)];

/// A press on the skin block at a step of 10 ms, Rayleigh stiffness 0.01 s.
fn press(cells: [u32; 2], levels: [u32; 3], poisson: f64) -> Scene {
    let mut scene = scene("verify/skin_block_045.toml");
    scene.skin.cells = cells;
    for (layer, cells) in scene.skin.layers.iter_mut().zip(levels) {
        (layer.cells, layer.poisson) = (cells, poisson);
    }
    scene.time.step = 0.01;
    scene.skin.rayleigh_stiffness = 0.01;
    scene.solver.preconditioner = Preconditioner::Multigrid;
    scene
}

/// Quaternions of a dent: cells lean towards the middle by up to `degrees`.
fn dent(model: &Model, degrees: f64) -> Vec<V4<f64>> {
    let params = model.grid.params::<f64>();
    (0..model.grid.cell_count())
        .map(|cell| {
            let corners = params.corners(cell);
            let at = |n: usize| 0.5 * (model.rest[corners[0]][n] + model.rest[corners[6]][n]);
            let (x, y) = (at(0) / 4e-3, at(1) / 4e-3);
            let r = x.hypot(y).max(1e-9);
            // steepest at r = 1
            let angle = degrees.to_radians() * r * (0.5 * (1.0 - r * r)).exp() * (at(2) / 2.3e-3);
            let (s, c) = (0.5 * angle).sin_cos();
            [s * y / r, -s * x / r, 0.0, c]
        })
        .collect()
}

/// Kills the top levels of a row of cells 10 mm long.
fn slot(model: &Model, levels: usize, rotation: &mut [V4<f64>]) {
    let params = model.grid.params::<f64>();
    let [_, cells_y, cells_z] = model.grid.cells;
    for (cell, q) in rotation.iter_mut().enumerate() {
        let at = params.cell_at(cell);
        let x = 0.5 * (model.rest[params.corners(cell)[0]][0] + model.rest[params.corners(cell)[6]][0]);
        if at[1] == cells_y / 2 && at[2] >= cells_z - levels && x.abs() < 5e-3 {
            *q = [0.0; 4];
        }
    }
}

fn iterations(scene: &Scene, rotation: &dyn Fn(&Model) -> Vec<V4<f64>>, tolerance: f64) -> Outcome {
    let model = model(scene);
    let params = model.params::<f64>();
    let rotation = rotation(&model);
    let (stiffness, layers, modes) = (model.stiffness_blocks(), &model.grid.layer_of, model.modes());
    let count = model.rest.len();
    let zeros = || vec![[0.0; 4]; count];
    let mut free = model.free.clone();
    for node in 0..count {
        let at = params.node_at(node);
        if (0..8).filter_map(|a| params.cell_below(at, a)).all(|c| rotation[c] == [0.0; 4]) {
            free[node] = [0.0; 4];
        }
    }
    let mut block = vec![[0.0; 4]; 4 * count];
    blocks(&params, &stiffness, layers, &rotation, &free, &mut block);
    factor(&params, &mut block);
    let mut hierarchy = Hierarchy::new(&model).expect("multigrid");
    hierarchy.refresh(&params, layers, &rotation);
    let levels = hierarchy.operators(Operator {
        params,
        free: &free,
        block: &block,
        steps: &[],
        modes: &modes,
        layer_of: layers,
        rotation: &rotation,
    });
    let mut work = Work::new(&levels);
    let load = model.load_at(&scene.loads, 0.0);
    let b: Vec<V4<f64>> =
        load.iter().zip(&free).map(|(l, f)| [0, 1, 2].map(|n| l[n] * f[n])).map(|[a, b, c]| [a, b, c, 0.0]).collect();
    let (mut x, mut r, mut p, mut s, mut z, mut w) = (zeros(), b.clone(), zeros(), zeros(), zeros(), zeros());
    let request = Request {
        tolerance_squared: tolerance * tolerance,
        reference_squared: b.as_flattened().iter().map(|c| c * c).sum(),
        ..Request::default()
    };
    let mut scratch = vec![[[[0.0; LANES]; 3]; 8]; cell_groups(&params)];
    solve(
        Slot { x: &mut x, r: &mut r, p: &mut p, s: &mut s, z: &mut z, w: &mut w },
        &request,
        0.0,
        1000,
        |z: &[V4<f64>], w: &mut [V4<f64>]| product(&params, &modes, layers, &rotation, &free, z, w, &mut scratch),
        |r: &[V4<f64>], z: &mut [V4<f64>]| cycle(&levels, &mut work, r, z),
    )
}

fn table() {
    for (levels, name) in [([2, 2, 1], "5"), ([10, 10, 3], "23")] {
        for across in [14, 15, 16, 17, 20, 24, 25, 32, 64] {
            if across == 64 && name == "23" {
                continue;
            }
            for poisson in [0.45, 0.49] {
                let scene = press([across, across], levels, poisson);
                let rest = |m: &Model| vec![[0.0, 0.0, 0.0, 1.0]; m.grid.cell_count()];
                let dented = |m: &Model| dent(m, 70.0);
                let slotted = |m: &Model| {
                    let mut q = dent(m, 45.0);
                    slot(m, if name == "5" { 3 } else { 13 }, &mut q);
                    q
                };
                let of = |q: &dyn Fn(&Model) -> Vec<V4<f64>>| [1e-3, 1e-6].map(|t| iterations(&scene, q, t).iterations);
                println!(
                    "{across}²×{name} ν {poisson}: {:?} 70°: {:?} slot 45°: {:?}",
                    of(&rest),
                    of(&dented),
                    of(&slotted)
                );
            }
        }
    }
    measured("x", 0.0, 0.0);
}
