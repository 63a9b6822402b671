//! Bodies of tetrahedra in whole simulations: pressed by a tool, resumed, and refused with what is for other elements.

use crate::small;
use cutis::backend::{FREE, Needs, SolveRequest, Target, on_cpu};
use cutis::bodies::tetrahedra::auxiliary::Auxiliary;
use cutis::bodies::{Kind, Model};
use cutis::scene::Element::{Bbar, PlainTetra, Tetra};
use cutis::scene::{
    Component, Element, Integrator, Law, Mass, Material, OutputField, Preconditioner, Probe, ProbeKind, Region, Scene,
    read,
};
use cutis::step::{Platform, Simulation};
use std::path::Path;

/// Skin of 12 × 12 × 3 cells under a needle.
fn pressed(element: Element) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/needle_press.toml");
    let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
    let skin = &mut scene.skins[0];
    skin.law = Law::Fem { element, corotational: true };
    skin.cells = [12, 12];
    skin.layers.iter_mut().for_each(|layer| layer.cells = 1);
    scene.solver.preconditioner = Preconditioner::Block;
    scene.probes.clear();
    scene
}

fn simulation(scene: &Scene) -> Simulation {
    Simulation::new(scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"))
}

/// The same of a hyperelastic law.
fn soft(element: Element) -> Scene {
    let mut scene = pressed(element);
    scene.skins[0].law = Law::LargeTetra { material: Material::NeoHookean, element };
    scene
}

/// Largest force on the tool, N.
fn peak(scene: &Scene, platform: &Platform) -> f64 {
    let mut simulation = Simulation::new(scene, platform).unwrap_or_else(|e| panic!("{e}"));
    let mut peak = 0.0f64;
    for _ in 0..scene.time.steps() {
        let report = simulation.step(true).expect("the CPU path has no device to fail");
        // the small-strain law is used beyond its range under the needle's tip
        let others = report.warnings.keys().filter(|key| **key != "strain_beyond_law").count();
        assert_eq!(others, 0, "at {} s: {:?}", report.time, report.warnings);
        let force = report.contact.on_tool.first().copied().unwrap_or_default();
        peak = peak.max(force.iter().map(|f| f * f).sum::<f64>().sqrt());
    }
    peak
}

#[test]
fn smoothed_tetrahedra_push_back_like_hexahedra_and_plain_ones_lock() {
    let [bricks, smoothed, plain] = [Bbar, Tetra, PlainTetra].map(|element| peak(&pressed(element), &Platform::Cpu64));
    let [smoothed, plain] = [smoothed, plain].map(|force| force / bricks);
    println!("hexahedra {bricks} N, smoothed tetrahedra {smoothed} of it, plain {plain}");
    assert!((0.8..1.2).contains(&smoothed), "{smoothed}");
    // the counter-test
    assert!(plain > 1.2, "{plain}");
    let single = peak(&pressed(Tetra), &Platform::Cpu32) / bricks;
    assert!((single / smoothed - 1.0).abs() < 5e-3, "{single} in f32, {smoothed}");
}

#[test]
fn hyperelastic_tetrahedra_push_back_like_hyperelastic_hexahedra() {
    let mut bricks = pressed(Bbar);
    bricks.skins[0].law = Law::Hyperelastic(Material::NeoHookean);
    let bricks = peak(&bricks, &Platform::Cpu64);
    let [smoothed, plain] = [Tetra, PlainTetra].map(|element| peak(&soft(element), &Platform::Cpu64) / bricks);
    println!("neo-Hookean hexahedra {bricks} N, smoothed tetrahedra {smoothed} of it, plain {plain}");
    assert!((0.8..1.2).contains(&smoothed), "{smoothed}");
    // the counter-test
    assert!(plain > 1.2, "{plain}");
}

#[test]
fn tetrahedra_go_on_from_their_state() {
    [pressed(Tetra), soft(Tetra), soft(PlainTetra)].iter().for_each(go_on);
}

fn go_on(scene: &Scene) {
    let steps = |simulation: &mut Simulation, count: u32| {
        (0..count).for_each(|_| drop(simulation.step(false).expect("the CPU path has no device to fail")));
    };
    let [mut whole, mut first, mut rest] = [(); 3].map(|()| simulation(scene));
    steps(&mut whole, 60);
    steps(&mut first, 40);
    rest.restore(&first.state().expect("it has a state")).expect("the same scene");
    steps(&mut rest, 20);
    let bytes = |simulation: &mut Simulation| {
        postcard::to_allocvec(&simulation.state().expect("it has a state")).expect("it can be written")
    };
    assert_eq!(bytes(&mut whole), bytes(&mut rest));
    assert_ne!(bytes(&mut whole), bytes(&mut first), "the counter-test");
}

/// Iterations to 1e-6 of the weight of a block of one layer in one static step, by its own preconditioner or by one that is spoilt, and the
/// displacements found, m.
fn iterations(scene: &Scene, spoil: impl Fn(&mut Auxiliary)) -> (u32, Vec<[f64; 4]>) {
    let mut model = Model::new(scene, 0).unwrap_or_else(|e| panic!("{e}"));
    if let Kind::Tetrahedra(own) = &mut model.kind {
        own.auxiliary.iter_mut().for_each(|auxiliary| spoil(auxiliary));
    }
    let start = cutis::step::start(scene, &model);
    let mut backend = on_cpu(false, &model, Needs::default(), 1000, 0.0, &start);
    backend.begin().expect("the CPU path has no device to fail");
    let wanted = [SolveRequest { rhs: FREE, target: Target::OfLoad(1e-6) }];
    let (outcomes, _) = backend.solve(&wanted, &[]).expect("the CPU path has no device to fail");
    assert!(outcomes[0].converged, "{:?}", outcomes[0]);
    (outcomes[0].iterations, backend.solution(FREE).expect("the CPU path has no device to fail"))
}

/// A block of tetrahedra in a grid under its weight.
fn weighed(cells: u32, preconditioner: Preconditioner) -> Scene {
    let mut scene = small::block([20e-3; 2], [cells; 2], &[(cells / 4, 2.3e-3, 10e3, 0.45, 1000.0)]);
    scene.time.integrator = Integrator::Static;
    scene.boundaries = vec![small::held(Region::Bottom, [true; 3])];
    scene.solver.preconditioner = preconditioner;
    scene.skins[0].law = Law::Fem { element: Tetra, corotational: true };
    scene
}

#[test]
fn multigrid_of_hexahedra_takes_as_many_iterations_on_fine_grids_as_on_coarse_ones() {
    use Preconditioner::{Block, Multigrid};
    let of = |cells, which| iterations(&weighed(cells, which), |_| {});
    let [(coarse, _), (fine, found)] = [8, 16].map(|cells| of(cells, Multigrid));
    let [(plain, _), (finer, wanted)] = [8, 16].map(|cells| of(cells, Block));
    println!("multigrid {coarse} and {fine}, node blocks {plain} and {finer}");
    assert!(10 * fine < 12 * coarse && 2 * fine < finer, "{coarse}, {fine}; {plain}, {finer}");
    // the counter-tests: blocks take more on finer grids, and so does multigrid of an auxiliary body that is too stiff
    assert!(10 * finer > 15 * plain, "{plain}, {finer}");
    let spoilt = iterations(&weighed(16, Multigrid), |auxiliary| auxiliary.scale.iter_mut().for_each(|s| *s *= 3.0)).0;
    assert!(2 * spoilt > 3 * fine, "{fine}, spoilt {spoilt}");
    let most = wanted.iter().flatten().fold(0.0, |most: f64, c| most.max(c.abs()));
    let off =
        found.iter().flatten().zip(wanted.iter().flatten()).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    assert!(off < 1e-4 * most, "{off:e} of {most:e}");
}

#[test]
fn what_is_for_other_elements_is_refused() {
    type Change = fn(&mut Scene);
    let changes: [(Change, &str); 4] = [
        (|scene| scene.solver.preconditioner = Preconditioner::Column, "take \"block\" or \"multigrid\""),
        (|scene| scene.skins[0].mass = Mass::Consistent, "take \"lumped\""),
        (|scene| scene.skins[0].layers[0].pre_strain = [0.05; 2], "pre_strain"),
        (|scene| scene.solver.preconditioner = Preconditioner::Direct, "take \"block\""),
    ];
    for (change, words) in changes {
        let mut scene = pressed(Tetra);
        change(&mut scene);
        let refused = Simulation::new(&scene, &Platform::Cpu64).err().expect(words).to_string();
        assert!(refused.contains(words) && refused.contains("tetrahedra"), "{refused}");
    }
    // the counter-test
    let mut scene = pressed(Tetra);
    scene.output.fields = vec![OutputField::Alive, OutputField::Stress];
    let kind = ProbeKind::Stress { body: 0, point: [0.0; 3], component: Component::VonMises };
    scene.probes.push(Probe { name: "stress".into(), kind });
    assert!(Simulation::new(&scene, &Platform::Cpu64).is_ok());
}
