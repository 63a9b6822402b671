//! A body that is carved away to a tenth on the device stays that of the CPU path in f32: the same cells, and the same motion.

use super::small::{block, held};
use super::{Failure, platform};
use cutis::gpu::Gpu;
use cutis::scene::{Contact, Cut, Region, Scene, Tool};
use cutis::step::{Platform, Simulation};

/// Difference of the displacement, of the largest: what the solver's tolerance leaves, times what a slender rest of the body makes of it.
const APART: f64 = 1e-3;

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Every test here, by name.
pub const TESTS: &[(&str, Test)] = &[
    ("a_body_carved_to_a_tenth_is_that_of_the_cpu", carved_alike),
    ("a_cell_that_stays_is_noticed", a_lost_cell_is_noticed),
];

/// A block under gravity that can be carved.
fn scene() -> Scene {
    let mut scene = block([8e-3, 8e-3], [8, 8], &[(3, 3e-3, 30e3, 0.45, 1000.0), (2, 2e-3, 100e3, 0.45, 1100.0)]);
    scene.skins[0].cut = Cut::Remove;
    scene.boundaries = vec![held(Region::Bottom, [true; 3])];
    scene.time.gravity = [0.0, 0.0, -9.81];
    scene.solver.tolerance = 1e-5;
    // a tool far away: the body has the arrays of one that is touched
    scene.tools = vec![Tool::default()];
    scene.contact = Some(Contact::default());
    scene
}

/// Carves the same cells on both, but for the first `lost` of the first round, which the device does not get, and steps; largest difference
/// of the displacements in each round, of the largest displacement.
fn rounds(gpu: &Gpu, lost: usize) -> Result<Vec<f64>, Failure> {
    let scene = scene();
    let mut both = [Simulation::new(&scene, &platform(gpu))?, Simulation::new(&scene, &Platform::Cpu32)?];
    let cells = both[1].bodies[0].wound.surface.alive.len() as u64;
    let mut random = 0x9e37_79b9_7f4a_7c15u64;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        random
    };
    let mut out = vec![];
    loop {
        let alive = &both[1].bodies[0].wound.surface.alive;
        let left: Vec<u32> = (0..cells as u32).filter(|cell| alive[*cell as usize]).collect();
        if left.len() as u64 * 10 <= cells {
            return Ok(out);
        }
        // the upper half first: what is left stands on its bottom
        let chosen: Vec<u32> = (0..8).map(|_| left[left.len() - 1 - next() as usize % (left.len() / 2)]).collect();
        both[0].bodies[0].carve(&chosen[lost..])?;
        both[1].bodies[0].carve(&chosen)?;
        let mut u = vec![];
        for simulation in &mut both {
            simulation.step(false)?;
            u.push(simulation.snapshots()?.swap_remove(0).u);
        }
        let size = |v: &[f64; 4]| v[..3].iter().map(|c| c * c).sum::<f64>().sqrt();
        let apart = u[0].iter().zip(&u[1]).map(|(a, b)| size(&[a[0] - b[0], a[1] - b[1], a[2] - b[2], 0.0]));
        out.push(apart.fold(0.0, f64::max) / u[1].iter().map(size).fold(0.0, f64::max));
        if lost > 0 {
            return Ok(out);
        }
        if both[0].bodies[0].wound.surface.alive != both[1].bodies[0].wound.surface.alive {
            return Err("other cells went".into());
        }
    }
}

fn carved_alike(gpu: &Gpu) -> Result<(), Failure> {
    let apart = rounds(gpu, 0)?;
    let worst = apart.iter().copied().fold(0.0, f64::max);
    super::report(gpu, &format!("{} rounds, {worst:.1e} apart at most", apart.len()));
    match apart.len() > 20 && worst <= APART {
        true => Ok(()),
        false => Err(format!("{apart:?}").into()),
    }
}

fn a_lost_cell_is_noticed(gpu: &Gpu) -> Result<(), Failure> {
    let apart = rounds(gpu, 4)?;
    match apart[0] > APART {
        true => Ok(()),
        false => Err(format!("{apart:?}").into()),
    }
}
