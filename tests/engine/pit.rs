//! Space carved finer than cells: how deep and how much, that every gram is booked, and that the equations solved are those of what is left.

use crate::carving::goes_on;
use crate::small::{block, held};
use cutis::bodies::{Model, Wound};
use cutis::math::random::Random;
use cutis::mesh::{Edges, LEAST};
use cutis::scene::{Carve, Contact, Cut, Element, Law, Material, Pose, Preconditioner, Region, Round, Scene, Tool};
use cutis::step::{Platform, Simulation, StepReport};

/// Radius of the ball and its reach, m.
const RADIUS: f64 = 1.5e-3;
const REACH: f64 = 5e-5;

/// A block of 8 × 8 × 4 mm in cells as wide as a millimetre over `fine`, and a ball that goes 0.8 mm deep and along x, by 3 mm.
fn groove(fine: u32) -> Scene {
    let cells = [8 * fine; 2];
    let mut scene =
        block([8e-3; 2], cells, &[(2 * fine, 2e-3, 30e3, 0.45, 1000.0), (2 * fine, 2e-3, 50e3, 0.45, 1100.0)]);
    let skin = &mut scene.skins[0];
    (skin.cut, skin.law) = (Cut::Remove, Law::Hyperelastic(Material::NeoHookean));
    (skin.rayleigh_mass, skin.rayleigh_stiffness) = (0.01, 0.01);
    scene.boundaries = vec![held(Region::Bottom, [true; 3])];
    let pose = |time, x, z| Pose { time, position: [x, 0.13e-3, z], ..Pose::default() };
    let deep = 4e-3 + RADIUS - 0.8e-3;
    let round = Round { ends: [[0.0; 3]; 2], radius: RADIUS };
    scene.tools = vec![Tool {
        blade: None,
        points: vec![],
        trajectory: vec![pose(0.0, -1.5e-3, 4.1e-3 + RADIUS), pose(0.1, -1.5e-3, deep), pose(0.3, 1.5e-3, deep)],
        round: Some(round),
        carve: Some(Carve { distance: REACH, ..Carve::default() }),
        ..Tool::default()
    }];
    scene.contact = Some(Contact { max_contacts: 400, ..Contact::default() });
    scene.time.duration = 0.3;
    scene
}

/// The same of smoothed tetrahedra, six to each cell.
fn of_tetrahedra(mut scene: Scene) -> Scene {
    scene.skins[0].law = Law::LargeTetra { material: Material::NeoHookean, element: Element::Tetra };
    scene.solver.preconditioner = Preconditioner::Block;
    scene
}

fn run(scene: &Scene, platform: &Platform, checked: bool) -> (Simulation, Vec<StepReport>) {
    let mut simulation = Simulation::new(scene, platform).unwrap_or_else(|e| panic!("{e}"));
    let mut step = || simulation.step(checked).unwrap_or_else(|e| panic!("{e}"));
    let steps = (0..scene.time.steps()).map(|_| step()).collect();
    (simulation, steps)
}

/// Differences between what is booked and what the cells have: volume, m³, and mass, kg, of the body's; and cells and nodes that do not fit.
fn booked(model: &Model, wound: &Wound) -> [f64; 2] {
    let surface = &wound.surface;
    let [mut gone, mut whole] = [0.0; 2];
    let mut count = |cell: usize, volume: f64, is_there: bool| {
        let left = if is_there { surface.share(cell) } else { 0.0 };
        assert!(left == 0.0 || left >= LEAST, "cell {cell}: {left}");
        gone += volume * (1.0 - left);
        whole += volume;
    };
    match model.unstructured() {
        Some(of) => (surface.present().iter().enumerate()).for_each(|(e, here)| count(e, of.mesh.volume(e), *here)),
        None => (surface.alive.iter().enumerate()).for_each(|(cell, here)| {
            let [x, y, z, _] = model.shape[model.grid.layer(cell)];
            count(cell, x * y * z, *here);
        }),
    }
    let [left, _] = wound.volume(model, &vec![[0.0; 4]; model.node_count()]);
    assert!(((whole - gone) / left - 1.0).abs() < 1e-12, "{left:e} m³ left of {whole:e}");
    let mass = wound.mass_of_nodes() - model.mechanics().mass_left(model, wound);
    [(wound.totals.volume - gone) / whole, mass / model.dofs.iter().map(|dofs| dofs[3]).sum::<f64>()]
}

#[test]
fn a_ball_carves_a_smooth_groove_of_its_own_size() {
    // a capsule of the ball's radius and reach, as deep as the ball's way: swept section times 3 mm, and a segment of a ball
    let (r, h) = (RADIUS + REACH, 0.8e-3 + REACH);
    let section = r * r * ((r - h) / r).acos() - (r - h) * (2.0 * r * h - h * h).sqrt();
    let wanted = 3e-3 * section + std::f64::consts::PI * h * h * (r - h / 3.0);
    let grooves = |of: fn(Scene) -> Scene| {
        [1, 2].map(|fine| {
            let scene = of(groove(fine));
            let (simulation, steps) = run(&scene, &Platform::Cpu64, fine == 1);
            let (totals, body) = (simulation.totals(), &simulation.bodies[0]);
            let warned: Vec<_> = steps.iter().flat_map(|step| step.warnings.keys()).collect();
            assert!(warned.is_empty(), "{warned:?}");
            for off in booked(&body.model, &body.wound) {
                assert!(off.abs() < 1e-12, "{off:e}");
            }
            assert_eq!((body.wound.surface.pieces(), body.wound.surface.edges()), (1, Edges::default()));
            let residual = steps.iter().filter_map(|step| step.true_residual).fold(0.0, f64::max);
            assert!(residual < 2.0 * scene.solver.tolerance, "{residual}");
            [totals.volume / wanted - 1.0, totals.depth / h - 1.0]
        })
    };
    let [[volume, depth], [finer, deeper]] = grooves(|scene| scene);
    println!("volume and depth: {volume} {depth}, in finer cells {finer} {deeper}");
    assert!(volume.abs() < 0.02 && finer.abs() < 0.01, "{volume} {finer}");
    assert!(depth.abs() < 0.04 && deeper.abs() < 0.03, "{depth} {deeper}");
    let [[volume, depth], [finer, deeper]] = grooves(of_tetrahedra);
    println!("of tetrahedra: {volume} {depth}, in finer ones {finer} {deeper}");
    assert!(volume.abs() < 0.02 && finer.abs() < 0.01, "{volume} {finer}");
    // their samples are up to a quarter of a cell high, and are taken from above
    assert!(depth.abs() < 0.1 && deeper.abs() < 0.07, "{depth} {deeper}");
}

#[test]
fn random_ways_through_the_body_leave_it_sound() {
    let of_cells: fn(Scene) -> Scene = |scene| scene;
    for (seed, platform, of, duration) in [
        (1, Platform::Cpu64, of_cells, 0.6),
        (2, Platform::Cpu32, of_cells, 0.6),
        (3, Platform::Cpu64, of_cells, 0.6),
        (4, Platform::Cpu64, of_tetrahedra, 0.25),
    ] {
        let mut random = Random::new(seed);
        let mut scene = of(groove(1));
        scene.time.duration = duration;
        // from place to place in 50 ms, through the held bottom and over the borders too
        let pose = |k: u32| {
            let position = [4.5e-3 * random.signed(), 4.5e-3 * random.signed(), 2.5e-3 + 3e-3 * random.signed()];
            Pose { time: 0.05 * f64::from(k), position, ..Pose::default() }
        };
        scene.tools[0].trajectory = (0..13).map(pose).collect();
        scene.tools[0].trajectory[0].position = [0.0, 0.0, 4.1e-3 + RADIUS];
        let mut simulation = Simulation::new(&scene, &platform).unwrap_or_else(|e| panic!("{e}"));
        for number in 0..scene.time.steps() {
            let step = simulation.step(false).unwrap_or_else(|e| panic!("seed {seed}, step {number}: {e}"));
            assert!(!step.warnings.contains_key("non_finite_nodes"), "seed {seed}, step {number}");
            let body = &simulation.bodies[0];
            for off in booked(&body.model, &body.wound) {
                assert!(off.abs() < 1e-12, "seed {seed}, step {number}: {off:e}");
            }
            assert_eq!(body.wound.surface.edges(), Edges::default(), "seed {seed}, step {number}");
        }
        assert!(simulation.totals().volume > 30e-9 * duration, "seed {seed}: {:?}", simulation.totals());
    }
}

#[test]
fn whole_cells_are_the_yardstick() {
    let mut scene = groove(1);
    scene.tools[0].carve = Some(Carve { distance: REACH, whole_cells: true, ..Carve::default() });
    let (simulation, _) = run(&scene, &Platform::Cpu64, false);
    let (totals, body) = (simulation.totals(), &simulation.bodies[0]);
    let shares = (0..body.wound.surface.alive.len()).map(|cell| body.wound.surface.share(cell));
    assert!(totals.hexahedra > 0 && shares.fold(1.0, f64::min) == 1.0);
    // a cell deep where the groove is less: nothing is finer than cells
    assert!((totals.volume * 1e9 - totals.hexahedra as f64).abs() < 1e-6, "{totals:?}");
}

#[test]
fn whole_cells_go_out_of_a_pit_too() {
    // the ball takes space; then a second one, pressed into its pit, removes what is left of the cells there
    let mut scene = groove(1);
    let pose = |time, z| Pose { time, position: [0.1e-3, 0.13e-3, z], ..Pose::default() };
    let (above, deep) = (7e-3 + RADIUS, 4e-3 + RADIUS - 1.1e-3);
    let leaves = Pose { time: 0.35, position: [1.5e-3, 0.13e-3, above], ..Pose::default() };
    scene.tools[0].trajectory.push(leaves);
    let second = Tool {
        name: "second".into(),
        trajectory: vec![pose(0.0, above), pose(0.35, above), pose(0.45, deep)],
        carve: Some(Carve { distance: REACH, whole_cells: true, ..Carve::default() }),
        ..scene.tools[0].clone()
    };
    scene.tools.push(second);
    scene.time.duration = 0.45;
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let mut whole = vec![];
    for number in 0..scene.time.steps() {
        simulation.step(false).unwrap_or_else(|e| panic!("step {number}: {e}"));
        let body = &simulation.bodies[0];
        whole.push(body.wound.totals.hexahedra);
        for off in booked(&body.model, &body.wound) {
            assert!(off.abs() < 1e-12, "step {number}: {off:e}");
        }
    }
    let before = whole[(0.35 / scene.time.step) as usize];
    assert!(*whole.last().expect("steps") > before + 1, "{before} cells, then {:?}", whole.last());
}

#[test]
fn lighter_cells_weigh_and_resist_less() {
    // a body that has lost half of its upper cells stands under its weight as its mass says, and rests at a smaller energy
    for mut scene in [groove(1), of_tetrahedra(groove(1))] {
        scene.time.gravity = [0.0, 0.0, -9.81];
        let (mut simulation, steps) = run(&scene, &Platform::Cpu64, true);
        let body = &simulation.bodies[0];
        let lost = body.model.dofs.iter().map(|dofs| dofs[3]).sum::<f64>() - body.wound.mass_of_nodes();
        assert!(lost > 1e-6 && steps.iter().all(|step| !step.warnings.contains_key("energy_grew")));
        // the state's own shares are what its energy is of
        let state = simulation.bodies[0].snapshot().unwrap_or_else(|e| panic!("{e}"));
        let model = &simulation.bodies[0].model;
        let energy = |state: &cutis::backend::Snapshot| cutis::bodies::elastic_energy(model, state, &state.rotation);
        let whole = cutis::backend::Snapshot { shares: vec![], ..state.clone() };
        assert!(energy(&state) < energy(&whole), "{} {}", energy(&state), energy(&whole));
    }
}

#[test]
fn both_precisions_carve_alike() {
    for scene in [groove(1), of_tetrahedra(groove(1))] {
        let volume = |platform| run(&scene, &platform, false).0.totals().volume;
        let [double, single] = [Platform::Cpu64, Platform::Cpu32].map(volume);
        assert!((single / double - 1.0).abs() < 0.01, "{single} {double}");
    }
}

#[test]
fn a_pressure_has_to_be_reached() {
    let volume = |pressure| {
        let mut scene = groove(1);
        scene.tools[0].carve = Some(Carve { distance: REACH, pressure, ..Carve::default() });
        run(&scene, &Platform::Cpu64, false).0.totals().volume
    };
    let [at_once, pressed, never] = [0.0, 10e3, 1e9].map(volume);
    assert!(at_once > pressed && pressed > 0.0 && never == 0.0, "{at_once} {pressed} {never}");
}

#[test]
fn a_carved_body_goes_on_from_its_state() {
    goes_on(&of_tetrahedra(groove(1)), 30, |simulation| simulation.totals().volume);
    let mut whole = goes_on(&groove(1), 30, |simulation| simulation.totals().volume);
    // another body's state is refused
    let other = Simulation::new(&groove(2), &Platform::Cpu64).and_then(|mut s| s.restore(&whole.state()?));
    assert!(other.is_err());
}

#[test]
fn a_body_without_space_to_carve_is_refused() {
    let refused = |change: fn(&mut Scene)| {
        let mut changed = groove(1);
        change(&mut changed);
        changed.check().expect_err("it cannot be carved").to_string()
    };
    let linear = refused(|scene| scene.skins[0].law = Law::Fem { element: Element::Bbar, corotational: true });
    let plain = refused(|scene| {
        *scene = of_tetrahedra(groove(1));
        scene.skins[0].law = Law::LargeTetra { material: Material::NeoHookean, element: Element::PlainTetra };
    });
    assert!(linear.contains("whole_cells = true") && plain.contains("whole_cells = true"), "{linear} {plain}");
    let small = refused(|scene| scene.tools[0].round = Some(Round { ends: [[0.0; 3]; 2], radius: 0.3e-3 }));
    assert!(small.contains("smaller than a cell"), "{small}");
    assert!(groove(1).check().is_ok());
}
