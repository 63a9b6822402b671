//! A body that is carved away to a tenth on the device stays that of the CPU path in f32: the same cells, and the same motion. Space finer than
//! cells likewise, and springs that break by over-stretch.

use super::small::{block, held};
use super::{Failure, platform};
use cutis::gpu::Gpu;
use cutis::mesh::Carved;
use cutis::scene::{
    Boundary, Carve, Contact, Cut, Element, Law, Material, Pose, Preconditioner, Region, Round, Scene, Tool,
};
use cutis::step::{Platform, Simulation};

/// Difference of the displacement, of the largest: what the solver's tolerance leaves, times what a slender rest of the body makes of it.
const APART: f64 = 1e-3;

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Every test here, by name.
pub const TESTS: &[(&str, Test)] = &[
    ("a_body_carved_to_a_tenth_is_that_of_the_cpu", carved_alike),
    ("a_cell_that_stays_is_noticed", a_lost_cell_is_noticed),
    ("space_carved_by_a_ball_is_that_of_the_cpu", space_alike),
    ("a_cell_of_another_share_is_noticed", another_share_is_noticed),
    ("springs_that_break_are_those_of_the_cpu", breaking_alike),
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
    match apart.len() > 15 && worst <= APART {
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

/// The block under a ball that carves space out of it.
fn under_a_ball() -> Scene {
    let mut scene = scene();
    scene.skins[0].law = Law::Hyperelastic(Material::NeoHookean);
    let pose = |time, x, z| Pose { time, position: [x, 0.1e-3, z], ..Pose::default() };
    scene.tools = vec![Tool {
        blade: None,
        points: vec![],
        trajectory: vec![pose(0.0, -1e-3, 6.1e-3), pose(0.1, -1e-3, 5.5e-3), pose(0.2, 1e-3, 5.5e-3)],
        round: Some(Round { ends: [[0.0; 3]; 2], radius: 1e-3 }),
        carve: Some(Carve::default()),
        ..Tool::default()
    }];
    scene.contact = Some(Contact { max_contacts: 200, ..Contact::default() });
    scene
}

/// The same block of smoothed tetrahedra, six to each cell.
fn tetrahedra_under_a_ball() -> Scene {
    let mut scene = under_a_ball();
    scene.skins[0].law = Law::LargeTetra { material: Material::NeoHookean, element: Element::Tetra };
    scene.solver.preconditioner = Preconditioner::Block;
    scene
}

/// Steps of the same scenes on both.
fn space_alike(gpu: &Gpu) -> Result<(), Failure> {
    [under_a_ball(), tetrahedra_under_a_ball()].iter().try_for_each(|scene| space_of(gpu, scene))
}

/// Volumes carved, and the largest true residual on the device.
fn space_of(gpu: &Gpu, scene: &Scene) -> Result<(), Failure> {
    let mut volumes = vec![];
    let mut residual: f64 = 0.0;
    for platform in [platform(gpu), Platform::Cpu32] {
        let mut simulation = Simulation::new(scene, &platform)?;
        for step in 0..40 {
            let report = simulation.step(step % 10 == 9)?;
            residual = residual.max(report.true_residual.unwrap_or(0.0));
        }
        volumes.push(1e9 * simulation.totals().volume);
    }
    super::report(gpu, &format!("{volumes:.4?} mm³, true residual {residual:.1e}"));
    match volumes[1] > 1.0 && (volumes[0] / volumes[1] - 1.0).abs() < 0.01 && residual < 1e-3 {
        true => Ok(()),
        false => Err(format!("{volumes:?} mm³, {residual}").into()),
    }
}

/// The top layer at half of its share on the CPU path, and so on the device but for one cell, or tetrahedron.
fn another_share_is_noticed(gpu: &Gpu) -> Result<(), Failure> {
    notices(gpu, &under_a_ball(), 1)?;
    notices(gpu, &tetrahedra_under_a_ball(), 6)
}

/// See there; with so many elements to each cell.
fn notices(gpu: &Gpu, scene: &Scene, per_cell: u32) -> Result<(), Failure> {
    let mut apart = vec![];
    for left_out in [0, 1] {
        let mut both = [Simulation::new(scene, &platform(gpu))?, Simulation::new(scene, &Platform::Cpu32)?];
        let top = per_cell * 4 * 64..per_cell * 5 * 64;
        let cells: Vec<(u32, Vec<u8>)> = top.map(|cell| (cell, vec![60; 64])).collect();
        let carved = |cells: &[(u32, Vec<u8>)]| Carved { cells: cells.to_vec(), corners: vec![] };
        both[0].bodies[0].carve_space(&carved(&cells[left_out..]))?;
        both[1].bodies[0].carve_space(&carved(&cells))?;
        let mut u = vec![];
        for simulation in &mut both {
            for _ in 0..3 {
                simulation.step(false)?;
            }
            u.push(simulation.snapshots()?.swap_remove(0).u);
        }
        let size = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
        let differ = u[0].iter().zip(&u[1]).map(|(a, b)| size([a[0] - b[0], a[1] - b[1], a[2] - b[2]]));
        let most = u[1].iter().map(|u| size([u[0], u[1], u[2]])).fold(0.0, f64::max);
        apart.push(differ.fold(0.0, f64::max) / most);
    }
    match apart[0] <= APART && apart[1] > APART {
        true => Ok(()),
        false => Err(format!("{apart:?}").into()),
    }
}

/// A network whose lifted top tears its lower layer, with nothing that touches it: springs severed in each step, on both.
fn breaking_alike(gpu: &Gpu) -> Result<(), Failure> {
    let mut scene = block([6e-3; 2], [3, 3], &[(2, 2e-3, 1e5, 0.3, 1000.0), (2, 2e-3, 1e5, 0.3, 1000.0)]);
    let skin = &mut scene.skins[0];
    skin.law = Law::Springs { stiffness: Some(100.0), damping: 0.1 };
    skin.layers[0].break_strain = 0.05;
    let top = Boundary { displacement: [0.0, 0.0, 0.3e-3], ..held(Region::Top, [true; 3]) };
    scene.boundaries = vec![held(Region::Bottom, [true; 3]), top];
    scene.solver.preconditioner = Preconditioner::Column;
    let mut counts = vec![];
    for platform in [platform(gpu), Platform::Cpu32] {
        let mut simulation = Simulation::new(&scene, &platform)?;
        let own: Vec<u32> = (0..20).map(|_| Ok(simulation.step(false)?.severed)).collect::<Result<_, Failure>>()?;
        counts.push(own);
    }
    match counts[0] == counts[1] && counts[0].iter().sum::<u32>() > 0 {
        true => Ok(()),
        false => Err(format!("{counts:?}").into()),
    }
}
