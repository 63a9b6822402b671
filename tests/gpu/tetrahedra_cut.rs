//! Bodies of tetrahedra that are cut and carved on the device: the nodes and tetrahedra are those of the CPU path in f32 bit for bit, the
//! motion is the same, and a run goes on from its state.

use super::falls::{self, CORNERS, fall};
use super::ragged::{split, through};
use super::small::held;
use super::{Failure, platform, report};
use cutis::gpu::Gpu;
use cutis::kernels::cut::Hit;
use cutis::math::random::Random;
use cutis::scene::{Element, Files, Law, Material, Preconditioner, Region, Scene, parse};
use cutis::step::{Platform, Simulation};
use std::path::Path;

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Every test here, by name.
pub const TESTS: &[(&str, Test)] = &[
    ("cut_tetrahedra_are_those_of_the_cpu", cut_alike),
    ("a_link_of_tetrahedra_that_stays_is_noticed", a_lost_link_is_noticed),
    ("a_blade_parts_the_same_tetrahedra_as_on_the_cpu", parted_alike),
    ("cut_tetrahedra_go_on_from_their_state_bit_for_bit", goes_on),
    ("a_small_piece_of_tetrahedra_falls_freely", falls_freely),
];

/// Difference of the displacements, of the largest: what the solver's tolerance leaves, times what free pieces make of it, which resist a
/// residual by inertia alone.
const APART: f64 = 5e-3;
/// The same after the first cut, when nothing is free.
const FIRST: f64 = 1e-5;
/// Steps with a change each.
const ROUNDS: usize = 24;

/// The block of tetrahedra under gravity.
fn block(law: Law) -> Scene {
    let mut scene = split(Element::Tetra);
    scene.skins[0].law = law;
    scene.boundaries = vec![held(Region::Bottom, [true; 3])];
    let skin = &mut scene.skins[0];
    (skin.rayleigh_mass, skin.rayleigh_stiffness) = (0.01, 0.01);
    scene.solver.tolerance = 1e-6;
    scene
}

/// A piece whose weight is less than the solves leave, under a linear law and Newton's method.
fn falls_freely(gpu: &Gpu) -> Result<(), Failure> {
    for law in [None, Some(Law::LargeTetra { material: Material::NeoHookean, element: Element::Tetra })] {
        let mut scene = falls::block(Preconditioner::Block, 1e-2);
        scene.skins[0].law = law.unwrap_or(scene.skins[0].law);
        let (share, iterations) = fall(scene, &platform(gpu), CORNERS[0]);
        report(gpu, &format!("{share} of the free fall, {iterations} iterations a step"));
        if (share - 0.9975).abs() > 0.004 {
            return Err(format!("{law:?}: {share} of the free fall").into());
        }
    }
    Ok(())
}

/// Cuts and carves the same on both, but for the first `lost` links of the first cut, which the device does not get; largest difference of
/// the displacements after each round, of the largest displacement.
fn rounds(gpu: &Gpu, law: Law, lost: usize) -> Result<Vec<f64>, Failure> {
    let scene = block(law);
    let mut both = [Simulation::new(&scene, &platform(gpu))?, Simulation::new(&scene, &Platform::Cpu32)?];
    let mut random = Random::new(11);
    let mut out = vec![];
    for round in 0..ROUNDS {
        let model = &both[1].bodies[0].model;
        let (links, count) = (model.mechanics().segment_count(model), model.cell_count());
        let mut next = |below: usize| (0.4999 * (random.signed() + 1.0) * below as f64) as u32;
        // a plane a quarter at a time, then links anywhere
        let mut hits = match round {
            0..4 => through(model, 0.4e-3).into_iter().skip(round).step_by(4).collect(),
            _ => (0..20).map(|_| Hit { segment: next(links), at: 0.5 }).collect::<Vec<_>>(),
        };
        hits.sort_by_key(|hit| hit.segment);
        hits.dedup_by_key(|hit| hit.segment);
        let gone: Vec<u32> = if round % 6 == 5 { (0..3).map(|_| next(count)).collect() } else { vec![] };
        let mut u = vec![];
        let mut tables = vec![];
        for (k, simulation) in both.iter_mut().enumerate() {
            let own = if k == 0 && round == 0 { &hits[lost..] } else { &hits };
            simulation.bodies[0].sever(own)?;
            simulation.bodies[0].carve(&gone)?;
            simulation.step(false)?;
            let state = simulation.snapshots()?.swap_remove(0);
            u.push(state.u);
            tables.push((state.split, state.dofs));
        }
        if lost == 0 && tables[0] != tables[1] {
            return Err(format!("round {round}: other nodes or masses than on the CPU path").into());
        }
        let size = |v: &[f64; 4]| v[..3].iter().map(|c| c * c).sum::<f64>().sqrt();
        let apart = u[0].iter().zip(&u[1]).map(|(a, b)| size(&[a[0] - b[0], a[1] - b[1], a[2] - b[2], 0.0]));
        out.push(apart.fold(0.0, f64::max) / u[1].iter().map(size).fold(0.0, f64::max));
        if lost > 0 {
            return Ok(out);
        }
    }
    let totals = both[0].totals();
    if totals.copies < 100 || totals.tetrahedra < 5 {
        return Err(format!("little was cut: {totals:?}").into());
    }
    Ok(out)
}

fn cut_alike(gpu: &Gpu) -> Result<(), Failure> {
    let both = |element| {
        [Law::Fem { element, corotational: true }, Law::LargeTetra { material: Material::NeoHookean, element }]
    };
    for law in both(Element::Tetra).into_iter().chain(both(Element::PlainTetra)) {
        let apart = rounds(gpu, law, 0)?;
        let worst = apart.iter().copied().fold(0.0, f64::max);
        super::report(gpu, &format!("{law:?}: {worst:.1e} apart at most"));
        // written so that NaN fails it
        if apart[0].is_nan() || apart[0] > FIRST || !apart.iter().all(|apart| *apart <= APART) {
            return Err(format!("{law:?}: {apart:?}").into());
        }
    }
    Ok(())
}

fn a_lost_link_is_noticed(gpu: &Gpu) -> Result<(), Failure> {
    let apart = rounds(gpu, Law::Fem { element: Element::Tetra, corotational: true }, 10)?;
    match apart[0] > 10.0 * FIRST {
        true => Ok(()),
        false => Err(format!("{apart:?}").into()),
    }
}

/// scenes/skin_tetra_cut.toml on its middle mesh.
fn skin(preconditioner: Preconditioner) -> Result<Scene, Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let file = "skin_tetra_cut.toml";
    let text = std::fs::read_to_string(folder.join(file)).map_err(|e| e.to_string())?;
    let text = text.replace("skin_fine.msh", "skin_middle.msh");
    let mut scene = parse(&text, Path::new(file), &Files::Folder(folder))?;
    scene.solver.preconditioner = preconditioner;
    Ok(scene)
}

/// For node blocks, and for multigrid on an auxiliary grid, whose weights follow the cut.
fn with_both(test: impl Fn(&Scene) -> Result<(), Failure>) -> Result<(), Failure> {
    [Preconditioner::Block, Preconditioner::Multigrid].into_iter().try_for_each(|which| test(&skin(which)?))
}

/// Steps until the blade is well in the skin.
const STEPS: usize = 50;

fn steps(simulation: &mut Simulation, count: usize) -> Result<(), Failure> {
    (0..count).try_for_each(|_| simulation.step(false).map(drop).map_err(Failure::from))
}

fn parted_alike(gpu: &Gpu) -> Result<(), Failure> {
    with_both(|scene| parted(gpu, scene))
}

fn parted(gpu: &Gpu, scene: &Scene) -> Result<(), Failure> {
    let mut both = [Simulation::new(scene, &platform(gpu))?, Simulation::new(scene, &Platform::Cpu32)?];
    for simulation in &mut both {
        steps(simulation, STEPS)?;
    }
    let [found, wanted] = both.each_ref().map(|simulation| &simulation.bodies[0].wound.surface);
    let totals = both[1].totals();
    super::report(gpu, &format!("{totals:?}"));
    if totals.links < 8 || totals.copies < 2 {
        return Err(format!("little was cut: {totals:?}").into());
    }
    match found.corners_of_tetrahedra() == wanted.corners_of_tetrahedra() && both[0].totals().links == totals.links {
        true => Ok(()),
        false => Err(format!("{:?} on the device, {totals:?} on the CPU path", both[0].totals()).into()),
    }
}

fn goes_on(gpu: &Gpu) -> Result<(), Failure> {
    with_both(|scene| went_on(gpu, scene))
}

fn went_on(gpu: &Gpu, scene: &Scene) -> Result<(), Failure> {
    let make = || Simulation::new(scene, &platform(gpu));
    let bytes = |simulation: &mut Simulation| -> Result<Vec<u8>, Failure> {
        Ok(postcard::to_allocvec(&simulation.state()?).map_err(|e| e.to_string())?)
    };
    let (mut whole, mut first, mut rest) = (make()?, make()?, make()?);
    steps(&mut first, STEPS - 6)?;
    if first.totals().links == 0 {
        return Err("nothing is cut before".into());
    }
    rest.restore(&first.state()?)?;
    let before = bytes(&mut rest)?;
    steps(&mut rest, 6)?;
    steps(&mut whole, STEPS)?;
    let wanted = bytes(&mut whole)?;
    if bytes(&mut rest)? != wanted {
        return Err("a restored run has other bits than the whole one".into());
    }
    // the counter-test
    if before == wanted { Err("six steps change nothing".into()) } else { Ok(()) }
}
